//! Nodes, scenes, cameras and KHR_lights_punctual (glTF 2.0, section 3.5), with KHR_node_visibility: the tree that is
//! shown, and what hangs on it.
//!
//! Nodes must form trees whose roots scenes list. Files in which a node is reached by several paths mean what they
//! say: it is there once per path, as a copy of its own after the file's nodes. Circles mean nothing.

use super::area_lights::{self, AreaLight};
use super::ies::{Lamp, Profiles};
use super::instancing::{self, Instancing};
use super::json::At;
use super::layout::Layout;
use super::list::List;
use super::notes::Notes;
use crate::json::quantity::MAX_LIGHT;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Vec3};
use std::collections::HashSet;

/// How deep nodes may be nested: transforms of moving lights cost time in proportion.
const MAX_DEPTH: u32 = 1000;

/// Copies of nodes that several paths reach. Paths double at every diamond, so a small file can ask for any number.
const MAX_COPIES: usize = 1 << 16;

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
#[derive(Clone)]
pub(super) struct Node {
    /// Its index in the file, which animations and messages name.
    pub source: usize,
    pub name: Option<String>,
    pub local: Local,
    /// Above it in the tree that is shown.
    pub parent: Option<usize>,
    /// As the file lists them.
    children: Vec<usize>,
    pub mesh: Option<usize>,
    pub camera: Option<usize>,
    pub light: Option<usize>,
    /// Of EXT_lights_ies.
    pub lamp: Option<Lamp>,
    /// Of EXT_lights_area.
    pub area_light: Option<usize>,
    pub skin: Option<usize>,
    /// Weights of its mesh's morph targets, as bits of f32, where it has its own.
    pub weights: Option<Vec<u32>>,
    pub instancing: Option<Instancing>,
    /// Neither it nor what is below it is seen or shines.
    hidden: bool,
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

/// The scene graph. Orthographic cameras are left out. What nodes of the scene refer to is there.
pub(super) struct Graph {
    /// Those of the file, and copies.
    pub nodes: Vec<Node>,
    pub cameras: List<Perspective>,
    pub lights: List<Punctual>,
    pub area_lights: List<AreaLight>,
    /// All nodes of the scene that is shown, parents before children, in the order of the file.
    pub order: Vec<usize>,
    /// Taken away from all places in the world.
    pub offset: DVec3,
    /// What the file calls its meshes; empty where it has no word.
    pub mesh_names: Vec<String>,
}

impl Graph {
    /// Reads the graph and checks what is shown.
    pub fn parse(root: &At, layout: &Layout, meshes: usize, profiles: &Profiles, notes: &mut Notes) -> Graph {
        let cameras = List::parse(root, "cameras", |at| parse_camera(at, notes));
        let lights = List::lights_of(root, "KHR_lights_punctual", |at| Some(parse_light(at, notes)));
        let area_lights = area_lights::parse(root, notes);
        let skins = root.items("skins").len();
        let count = root.items("nodes").len();
        let nodes = List::parse(root, "nodes", |at| {
            let node = parse_node(at, count, meshes, cameras.len(), lights.len(), skins);
            let instancing = instancing::parse(at, layout);
            Some(Node {
                instancing,
                lamp: profiles.lamp(at),
                area_light: area_lights::of_node(at, area_lights.len()),
                ..node
            })
        });
        let mut graph = shown_tree(root, &nodes, notes);
        nodes.note_unused(notes);
        for &i in &graph.order {
            let node = &mut graph.nodes[i];
            node.camera = node.camera.filter(|&c| cameras.get(c, root.faults()).is_some());
            node.light = node.light.filter(|&l| lights.get(l, root.faults()).is_some());
            node.area_light = (node.area_light).filter(|&l| area_lights.get(l, root.faults()).is_some());
        }
        cameras.note_unused(notes);
        lights.note_unused(notes);
        area_lights.note_unused(notes);
        Graph {
            nodes: graph.nodes,
            cameras,
            lights,
            area_lights,
            order: graph.order,
            offset: DVec3::ZERO,
            mesh_names: (root.items("meshes").iter())
                .map(|mesh| mesh.text("name").unwrap_or_default().to_owned())
                .collect(),
        }
    }

    /// Transforms from every node to the world less the offset, at rest, by node index; identity outside the scene.
    pub fn world_from_nodes(&self) -> Vec<DAffine3> {
        let mut world = vec![DAffine3::IDENTITY; self.nodes.len()];
        for &i in &self.order {
            let node = &self.nodes[i];
            let parent = node
                .parent
                .map_or(DAffine3::from_translation(-self.offset), |p| world[p]);
            world[i] = parent * node.local.parent_from_node();
        }
        world
    }

    /// Transform from a node to the world, at rest, also of nodes that the scene doesn't show.
    pub fn world_from_node(&self, node: usize) -> DAffine3 {
        let locals = self.chain(node).into_iter();
        locals.fold(DAffine3::IDENTITY, |world, i| {
            world * self.nodes[i].local.parent_from_node()
        })
    }

    /// A node and its ancestors, the root first.
    pub fn chain(&self, node: usize) -> Vec<usize> {
        let mut chain: Vec<usize> = std::iter::successors(Some(node), |&i| self.nodes[i].parent).collect();
        chain.reverse();
        chain
    }
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
        name: at.name(),
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
    if f64::from(intensity) * f64::from(color.max_element()) > MAX_LIGHT {
        at.fault_at(
            "intensity",
            format!("is {intensity:e} (colour times intensity may be up to {MAX_LIGHT:e})"),
        );
    }
    if at.get("range").is_some() {
        notes.say("the range of lights is ignored: their light falls off with the squared distance");
    }
    Punctual {
        name: at.name(),
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
    let visibility = at.extension("KHR_node_visibility");
    let shown =
        visibility.is_none_or(|visibility| visibility.get("visible").is_none() || visibility.flag("visible"));
    Node {
        source: 0,
        hidden: !shown,
        name: at.name(),
        local: parse_local(at),
        parent: None,
        children,
        mesh: at.index("mesh", meshes, "meshes"),
        camera: at.index("camera", cameras, "cameras"),
        light,
        lamp: None,
        area_light: None,
        skin: at.index("skin", skins, "skins"),
        weights: at.get("weights").map(|_| at.weights("weights")),
        instancing: None,
    }
}

fn parse_local(at: &At) -> Local {
    let translation = at.doubles("translation").map_or(DVec3::ZERO, DVec3::from_array);
    let scale = at.floats("scale").map_or(Vec3::ONE, Vec3::from_array);
    let rotation: [f32; 4] = at.floats("rotation").unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let rotation = DQuat::from_array(rotation.map(f64::from));
    // Any length but zero names a rotation; exporters round.
    if rotation.length_squared() < 1e-12 {
        at.fault_at("rotation", "must be a unit quaternion (x, y, z, w)");
    }
    if at.get("matrix").is_none() {
        return Local::Trs(Trs {
            translation,
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
    let matrix = (at.doubles("matrix")).map_or(DMat4::IDENTITY, |matrix| DMat4::from_cols_array(&matrix));
    // Exporters round; a real projection is far from this.
    if (matrix.row(3) - glam::DVec4::W).abs().max_element() > 1e-4 {
        at.fault_at(
            "matrix",
            "must end in the row 0 0 0 1: projections have no meaning here",
        );
    }
    Local::Matrix(DAffine3::from_mat4(matrix))
}

/// Nodes with parents as they are shown, and their order.
struct Tree {
    nodes: Vec<Node>,
    order: Vec<usize>,
}

/// Follows every path from the roots of the scene that is shown.
fn shown_tree(root: &At, list: &List<Node>, notes: &mut Notes) -> Tree {
    let none = Node {
        source: 0,
        hidden: false,
        name: None,
        local: Local::Matrix(DAffine3::IDENTITY),
        parent: None,
        children: Vec::new(),
        mesh: None,
        camera: None,
        light: None,
        lamp: None,
        area_light: None,
        skin: None,
        weights: None,
        instancing: None,
    };
    let mut nodes: Vec<Node> = (0..list.len())
        .map(|source| Node {
            source,
            ..list.peek(source).unwrap_or(&none).clone()
        })
        .collect();
    let mut children: Vec<Vec<usize>> = nodes.iter().map(|node| node.children.clone()).collect();
    let mut is_child = vec![false; nodes.len()];
    let mut repeated = 0;
    for children in &mut children {
        repeated += drop_repeated(children);
        for &child in &*children {
            is_child[child] = true;
        }
    }
    let mut roots = roots(root, &is_child, notes);
    repeated += drop_repeated(&mut roots);
    notes.count("nodes listed twice in one list, drawn once", repeated);

    let (mut order, mut hidden_count, mut copies) = (Vec::new(), 0, 0);
    let mut placed = vec![false; nodes.len()];
    let mut depth = vec![0u32; nodes.len()];
    let mut hidden = vec![false; nodes.len()];
    // Nodes of the file to place, and the placed ones above them.
    let mut stack: Vec<(usize, Option<usize>)> = roots.into_iter().rev().map(|i| (i, None)).collect();
    while let Some((source, parent)) = stack.pop() {
        list.get(source, root.faults());
        let mut i = source;
        if std::mem::replace(&mut placed[source], true) {
            let above = std::iter::successors(parent, |&p| nodes[p].parent);
            if above.into_iter().any(|p| nodes[p].source == source) {
                root.fault_at(
                    &format!("nodes[{source}].children"),
                    "makes the node an ancestor of itself; nodes must form a tree",
                );
                continue;
            }
            copies += 1;
            if copies > MAX_COPIES {
                root.fault_at(
                    "nodes",
                    format!("are reached by more than {MAX_COPIES} paths beside the first, as node {source} is; list them once"),
                );
                break;
            }
            i = nodes.len();
            nodes.push(Node {
                source,
                ..list.peek(source).unwrap_or(&none).clone()
            });
            depth.push(0);
            hidden.push(false);
        }
        order.push(i);
        nodes[i].parent = parent;
        if let Some(p) = parent {
            depth[i] = depth[p] + 1;
        }
        hidden[i] = nodes[i].hidden || parent.is_some_and(|p| hidden[p]);
        if hidden[i] {
            hidden_count += 1;
            // Visibility does not affect cameras.
            (nodes[i].mesh, nodes[i].light) = (None, None);
            (nodes[i].lamp, nodes[i].area_light) = (None, None);
        }
        if depth[i] > MAX_DEPTH {
            root.fault_at(
                "nodes",
                format!("are nested more than {MAX_DEPTH} deep, at node {source}; flatten them"),
            );
            break;
        }
        stack.extend(children[source].iter().rev().map(|&child| (child, Some(i))));
    }
    notes.count("nodes that KHR_node_visibility hides, left out", hidden_count);
    notes.count(
        "nodes that more than one path leads to, drawn once per path: copies",
        copies as u64,
    );
    Tree { nodes, order }
}

/// Keeps the first of equal indices; returns how many others there were.
fn drop_repeated(list: &mut Vec<usize>) -> u64 {
    let before = list.len();
    let mut seen = HashSet::new();
    list.retain(|&i| seen.insert(i));
    (before - list.len()) as u64
}

/// The scene that is shown, and its index: `scene`, else the first one.
pub(super) fn shown_scene<'a>(root: &At<'a>) -> Option<(usize, At<'a>)> {
    let scenes = root.items("scenes");
    let chosen = root.index("scene", scenes.len(), "scenes").unwrap_or(0);
    Some((chosen, scenes.get(chosen)?.clone()))
}

/// The roots of the scene that is shown; without any scene, all nodes that are no child.
fn roots(root: &At, is_child: &[bool], notes: &mut Notes) -> Vec<usize> {
    let Some((chosen, scene)) = shown_scene(root) else {
        return (0..is_child.len()).filter(|&i| !is_child[i]).collect();
    };
    let scenes = root.items("scenes").len();
    if scenes > 1 {
        notes.say(format!(
            "scenes[{chosen}] is imported; the file has {scenes} scenes"
        ));
    }
    if !scene.value.is_object() {
        scene.fault("must be an object");
    }
    let items = scene.items("nodes");
    let roots: Vec<usize> = (items.iter())
        .filter_map(|item| item.as_index(is_child.len(), "nodes"))
        .collect();
    notes.count(
        "nodes that the scene lists although they are children of others, drawn once per path",
        roots.iter().filter(|&&i| is_child[i]).count() as u64,
    );
    roots
}
