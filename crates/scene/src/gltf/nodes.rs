//! Nodes, scenes, cameras and KHR_lights_punctual (glTF 2.0, section 3.5): the tree, proved to be one, and
//! what hangs on it.

use super::json::At;
use super::notes::Notes;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};

/// How deep nodes may be nested: transforms of moving lights cost time in proportion.
const MAX_DEPTH: u32 = 1000;

/// Translation, rotation and scale, in the order in which they are applied last to first; f64, since chains
/// of them get long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trs {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

/// Where a node is relative to its parent.
#[derive(Clone, Copy, Debug)]
pub(super) enum Local {
    Trs(Trs),
    Matrix(DAffine3),
}

impl Local {
    /// As a transform.
    pub fn parent_from_node(&self) -> DAffine3 {
        match self {
            Local::Trs(trs) => trs.parent_from_node(),
            Local::Matrix(matrix) => *matrix,
        }
    }

    /// As parts that can be animated. A matrix with shear loses it.
    pub fn trs(&self) -> Trs {
        match self {
            Local::Trs(trs) => *trs,
            Local::Matrix(matrix) => {
                let m = matrix.matrix3;
                let mut scale = DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length());
                if m.determinant() < 0.0 {
                    scale.x = -scale.x;
                }
                let unit = |axis: DVec3, length: f64| (axis / length).try_normalize();
                let axes = (
                    unit(m.x_axis, scale.x),
                    unit(m.y_axis, scale.y),
                    unit(m.z_axis, scale.z),
                );
                let rotation = match axes {
                    (Some(x), Some(y), Some(z)) => DQuat::from_mat3(&DMat3::from_cols(x, y, z)),
                    _ => DQuat::IDENTITY,
                };
                Trs {
                    translation: matrix.translation,
                    rotation: rotation.normalize(),
                    scale,
                }
            }
        }
    }
}

impl Trs {
    /// As a transform.
    pub fn parent_from_node(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// A node of the tree.
pub(super) struct Node {
    pub name: Option<String>,
    pub local: Local,
    pub parent: Option<usize>,
    pub children: Vec<usize>,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    pub light: Option<usize>,
    pub skinned: bool,
}

/// A perspective camera.
pub(super) struct Perspective {
    pub name: Option<String>,
    /// Vertical field of view in radians.
    pub yfov: f32,
    pub aspect: Option<f32>,
}

/// Kinds of KHR_lights_punctual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PunctualKind {
    Point,
    Directional,
    /// Half angles in radians.
    Spot {
        inner: f32,
        outer: f32,
    },
}

/// A light of KHR_lights_punctual, in the file's units.
pub(super) struct Punctual {
    pub name: Option<String>,
    pub kind: PunctualKind,
    pub color: Vec3,
    pub intensity: f32,
}

/// The scene graph. `cameras` holds `None` for orthographic ones.
pub(super) struct Graph {
    pub nodes: Vec<Node>,
    pub cameras: Vec<Option<Perspective>>,
    pub lights: Vec<Punctual>,
    /// All nodes of the scene that is shown, parents before children, in the order of the file.
    pub order: Vec<usize>,
}

impl Graph {
    /// Reads and checks the graph. Faults leave defaults, so that one pass finds them all.
    pub fn parse(root: &At, meshes: usize, notes: &mut Notes) -> Graph {
        let cameras: Vec<_> = root
            .objects("cameras")
            .iter()
            .map(|at| parse_camera(at, notes))
            .collect();
        let lights: Vec<Punctual> = match root.extension("KHR_lights_punctual") {
            Some(extension) => extension
                .objects("lights")
                .iter()
                .map(|at| parse_light(at, notes))
                .collect(),
            None => Vec::new(),
        };
        let items = root.objects("nodes");
        let skins = root.objects("skins").len();
        let mut nodes: Vec<Node> = (items.iter())
            .map(|at| parse_node(at, items.len(), meshes, cameras.len(), lights.len(), skins))
            .collect();
        link_parents(&mut nodes, &items);
        let order = parse_scene(root, &nodes, notes);
        Graph {
            nodes,
            cameras,
            lights,
            order,
        }
    }

    /// Transforms from every node to the world, at rest, by node index; identity outside the scene.
    pub fn world_from_nodes(&self) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; self.nodes.len()];
        for &i in &self.order {
            let node = &self.nodes[i];
            let parent = node.parent.map_or(DAffine3::IDENTITY, |p| world[p]);
            world[i] = parent * node.local.parent_from_node();
        }
        world
    }

    /// A node and its ancestors, the root first.
    pub fn chain(&self, node: usize) -> Vec<usize> {
        let mut chain: Vec<usize> = std::iter::successors(Some(node), |&i| self.nodes[i].parent).collect();
        chain.reverse();
        chain
    }
}

fn name_of(at: &At) -> Option<String> {
    at.text("name").filter(|name| !name.is_empty()).map(str::to_owned)
}

fn parse_camera(at: &At, notes: &mut Notes) -> Option<Perspective> {
    match at.text("type") {
        Some("perspective") => {}
        Some("orthographic") => {
            notes.count("orthographic cameras left out", 1);
            return None;
        }
        _ => {
            at.fault_at("type", "must be \"perspective\" or \"orthographic\"");
            return None;
        }
    }
    let Some(perspective) = at.object("perspective") else {
        at.fault_at("perspective", "is missing");
        return None;
    };
    let yfov = perspective.float("yfov");
    if !yfov.is_some_and(|yfov| yfov > 0.0 && yfov < std::f32::consts::PI) {
        perspective.fault_at("yfov", "must be an angle between 0 and π, in radians");
    }
    let aspect = perspective.float("aspectRatio");
    if aspect.is_some_and(|aspect| aspect <= 0.0) {
        perspective.fault_at("aspectRatio", "must be above 0; leave it out for any");
    }
    Some(Perspective {
        name: name_of(at),
        yfov: yfov?,
        aspect,
    })
}

fn parse_light(at: &At, notes: &mut Notes) -> Punctual {
    let kind = match at.text("type") {
        Some("point") => PunctualKind::Point,
        Some("directional") => PunctualKind::Directional,
        Some("spot") => {
            let spot = at.object("spot");
            let angle = |key, default| spot.as_ref().and_then(|spot| spot.float(key)).unwrap_or(default);
            let inner = angle("innerConeAngle", 0.0);
            let outer = angle("outerConeAngle", std::f32::consts::FRAC_PI_4);
            // Half angles. π/2 written with few digits may come out slightly above it.
            let most = std::f32::consts::FRAC_PI_2 + 1e-4;
            if inner < 0.0 || outer <= 0.0 || inner > outer || outer > most {
                at.fault_at(
                    "spot",
                    "needs 0 <= innerConeAngle < outerConeAngle <= π/2, in radians",
                );
            }
            PunctualKind::Spot {
                inner,
                outer: outer.min(std::f32::consts::FRAC_PI_2),
            }
        }
        _ => {
            at.fault_at("type", "must be \"point\", \"spot\" or \"directional\"");
            PunctualKind::Point
        }
    };
    let color = at.floats("color").map_or(Vec3::ONE, Vec3::from_array);
    let intensity = at.float("intensity").unwrap_or(1.0);
    if color.min_element() < 0.0 {
        at.fault_at("color", "must not be negative");
    }
    if intensity < 0.0 {
        at.fault_at("intensity", "must not be negative");
    }
    if at.get("range").is_some() {
        notes.say("the range of lights is ignored: their light falls off with the squared distance");
    }
    Punctual {
        name: name_of(at),
        kind,
        color,
        intensity,
    }
}

fn parse_node(at: &At, nodes: usize, meshes: usize, cameras: usize, lights: usize, skins: usize) -> Node {
    let children = at.items("children");
    let children = children
        .iter()
        .filter_map(|child| child.as_index(nodes, "nodes"))
        .collect();
    let light = at
        .extension("KHR_lights_punctual")
        .and_then(|extension| extension.required_index("light", lights, "lights"));
    Node {
        name: name_of(at),
        local: parse_local(at),
        parent: None,
        children,
        mesh: at.index("mesh", meshes, "meshes"),
        camera: at.index("camera", cameras, "cameras"),
        light,
        skinned: at.index("skin", skins, "skins").is_some(),
    }
}

fn parse_local(at: &At) -> Local {
    let translation = at.floats("translation").map_or(Vec3::ZERO, Vec3::from_array);
    let scale = at.floats("scale").map_or(Vec3::ONE, Vec3::from_array);
    let rotation: [f32; 4] = at.floats("rotation").unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = DQuat::from_array(rotation.map(f64::from));
    // Any length but zero names a rotation; exporters round.
    if rotation.length_squared() < 1e-12 {
        at.fault_at("rotation", "must be a unit quaternion (x, y, z, w)");
    }
    if at.get("matrix").is_none() {
        return Local::Trs(Trs {
            translation: translation.as_dvec3(),
            rotation: rotation.normalize(),
            scale: scale.as_dvec3(),
        });
    }
    if ["translation", "rotation", "scale"]
        .iter()
        .any(|key| at.get(key).is_some())
    {
        at.fault_at(
            "matrix",
            "stands beside translation, rotation or scale; keep one or the other",
        );
    }
    let matrix: [f32; 16] = at
        .floats("matrix")
        .unwrap_or(glam::Mat4::IDENTITY.to_cols_array());
    let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
    // Exporters round; a real projection is far from this.
    if (matrix.row(3) - glam::DVec4::W).abs().max_element() > 1e-4 {
        at.fault_at(
            "matrix",
            "must end in the row 0 0 0 1: projections have no meaning here",
        );
    }
    Local::Matrix(DAffine3::from_mat4(matrix))
}

/// Sets parents and reports nodes with two of them, and cycles.
fn link_parents(nodes: &mut [Node], items: &[At]) {
    for i in 0..nodes.len() {
        for k in 0..nodes[i].children.len() {
            let child = nodes[i].children[k];
            match nodes[child].parent {
                None => nodes[child].parent = Some(i),
                Some(other) => items[i].fault_at(
                    "children",
                    format!(
                        "holds node {child}, which is a child of node {other} already; a node has one parent"
                    ),
                ),
            }
        }
    }
    // With one parent each, following parents either ends at a root or runs in a circle. `seen` holds the
    // walk that visited a node first.
    let mut seen = vec![usize::MAX; nodes.len()];
    for start in 0..nodes.len() {
        let mut at = Some(start);
        while let Some(i) = at {
            if seen[i] == start {
                items[i].fault_at(
                    "children",
                    "makes the node an ancestor of itself; nodes must form a tree",
                );
            }
            if seen[i] != usize::MAX {
                break;
            }
            seen[i] = start;
            at = nodes[i].parent;
        }
    }
}

/// The nodes of the scene that is shown, parents first: `scene`, else the first scene, else all roots.
fn parse_scene(root: &At, nodes: &[Node], notes: &mut Notes) -> Vec<usize> {
    let scenes = root.objects("scenes");
    let mut shown: Vec<usize> = Vec::new();
    let chosen = root.index("scene", scenes.len(), "scenes").unwrap_or(0);
    for (i, scene) in scenes.iter().enumerate() {
        let mut roots: Vec<usize> = Vec::new();
        for item in scene.items("nodes") {
            let Some(node) = item.as_index(nodes.len(), "nodes") else {
                continue;
            };
            if let Some(parent) = nodes[node].parent {
                item.fault(format!(
                    "is node {node}, a child of node {parent}; a scene lists root nodes only"
                ));
                continue;
            }
            roots.push(node);
        }
        let mut sorted = roots.clone();
        sorted.sort_unstable();
        if let Some(twice) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            scene.fault_at("nodes", format!("lists node {} twice", twice[0]));
            roots.clear();
        }
        if i == chosen {
            shown = roots;
        }
    }
    if scenes.is_empty() {
        shown = (0..nodes.len()).filter(|&i| nodes[i].parent.is_none()).collect();
    } else if scenes.len() > 1 {
        notes.say(format!(
            "scenes[{chosen}] is imported; the file has {} scenes",
            scenes.len()
        ));
    }
    let mut order = Vec::new();
    let mut depth = vec![0u32; nodes.len()];
    let mut stack: Vec<usize> = shown.into_iter().rev().collect();
    // The tree has at most as many nodes as there are; more means a fault that was reported above.
    while let Some(i) = stack.pop()
        && order.len() < nodes.len()
    {
        order.push(i);
        depth[i] = nodes[i].parent.map_or(0, |p| depth[p] + 1);
        if depth[i] > MAX_DEPTH {
            root.fault_at(
                "nodes",
                format!("are nested more than {MAX_DEPTH} deep, at node {i}; flatten them"),
            );
            break;
        }
        stack.extend(
            nodes[i]
                .children
                .iter()
                .rev()
                .filter(|&&c| nodes[c].parent == Some(i)),
        );
    }
    order
}
