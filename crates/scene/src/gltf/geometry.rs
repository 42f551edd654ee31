//! Triangles: decodes primitives into meshes and places them.
//!
//! Vertices that are not finite cannot be traced: their triangles are dropped and counted. Triangles without
//! area stay, since casting rays copes with them.

use super::accessors::Data;
use super::deform::{self, Skin, SkinPose, Vertices};
use super::json::Faults;
use super::list::List;
use super::material_numbers::MaterialNumbers;
use super::nodes::{Graph, Node};
use super::notes::Notes;
use super::primitives::{MeshPrimitives, Mode, Primitive};
use crate::scene::{Instance, Mesh};
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec2, Vec3, Vec4};
use std::collections::HashMap;

/// Attributes and indices decoded for one scene, all meshes together: about 3 GB.
const MAX_ELEMENTS: u64 = 1 << 28;

/// Triangles with every instance drawn: whoever traces them numbers them all, and a mesh may be placed by
/// millions of nodes.
const MAX_DRAWN: u64 = 1 << 28;

/// What a file may ask for however small it is.
const FREE_ELEMENTS: u64 = 1 << 24;

/// Elements per byte of the buffers. Primitives may share accessors, and sparse ones need few bytes, so a
/// small file can ask for very much; real ones use a byte in less than this many primitives.
const ELEMENTS_PER_BYTE: u64 = 64;

/// Counts what is decoded, and refuses what is out of all proportion.
struct Budget {
    left: u64,
}

impl Budget {
    fn new(data: &Data) -> Budget {
        Budget {
            left: data
                .total_bytes()
                .saturating_mul(ELEMENTS_PER_BYTE)
                .clamp(FREE_ELEMENTS, MAX_ELEMENTS),
        }
    }

    fn take(&mut self, elements: u64, path: &str, faults: &Faults) -> Option<()> {
        if elements > self.left {
            let message = "brings the scene to far more vertices than its buffers hold; split the scene";
            faults.add(path, message);
            return None;
        }
        self.left -= elements;
        Some(())
    }
}

/// What makes a mesh: nodes that agree in all of this show the same one.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Shape<'a> {
    primitive: &'a Primitive,
    /// Weights of its morph targets, as bits of f32; empty where all are 0.
    weights: Vec<u32>,
    skin: Option<usize>,
}

impl<'a> Shape<'a> {
    fn new(primitive: &'a Primitive, node: &Node) -> Shape<'a> {
        let weights = node.weights.as_ref().unwrap_or(&primitive.weights);
        let weights = &weights[..weights.len().min(primitive.targets.len())];
        let rests = weights.iter().all(|&weight| f32::from_bits(weight) == 0.0);
        Shape {
            primitive,
            weights: if rests { Vec::new() } else { weights.to_vec() },
            skin: node.skin,
        }
    }
}

/// Meshes and where they are.
pub(super) struct Geometry {
    pub meshes: Vec<Mesh>,
    pub instances: Vec<Instance>,
    /// One per instance.
    pub names: Vec<String>,
}

/// Decodes what the scene's nodes show: each different primitive once, however often it is placed.
pub(super) fn build(
    data: &Data,
    meshes: &List<MeshPrimitives>,
    graph: &Graph,
    skins: &List<Skin>,
    numbers: &MaterialNumbers,
    faults: &Faults,
    notes: &mut Notes,
) -> Geometry {
    let mut geometry = Geometry {
        meshes: Vec::new(),
        instances: Vec::new(),
        names: Vec::new(),
    };
    let mut mesh_of: HashMap<Shape, Option<u32>> = HashMap::new();
    let mut poses: Vec<Option<SkinPose>> = (0..skins.len()).map(|_| None).collect();
    for node in graph.order.iter().map(|&i| &graph.nodes[i]) {
        if let (Some(index), Some(_)) = (node.skin, node.mesh)
            && poses[index].is_none()
            && let Some(skin) = skins.peek(index)
        {
            poses[index] = Some(SkinPose::at_rest(skin, data, graph));
        }
    }
    let mut budget = Budget::new(data);
    let mut drawn = 0u64;
    // Of each mesh, the greatest distances from its origin along the axes.
    let mut extents: Vec<Vec3> = Vec::new();
    let world_from_nodes = graph.world_from_nodes();
    for &i in &graph.order {
        let node = &graph.nodes[i];
        let Some(mesh) = node.mesh else { continue };
        let pose = node.skin.and_then(|skin| poses[skin].as_ref());
        let placements = match (pose, &node.instancing) {
            (Some(pose), _) => vec![DAffine3::from_translation(-graph.offset) * pose.world_from_posed],
            (None, Some(instancing)) => {
                let placed = instancing.node_from_mesh(data, notes).into_iter();
                placed
                    .map(|node_from_mesh| world_from_nodes[i] * node_from_mesh)
                    .collect()
            }
            (None, None) => vec![world_from_nodes[i]],
        };
        if pose.is_some() {
            notes.count("skinned meshes, imported at rest", 1);
        }
        for (primitive, path) in meshes.peek(mesh).into_iter().flatten() {
            let shape = Shape::new(primitive, node);
            let index = *mesh_of.entry(shape.clone()).or_insert_with(|| {
                budget.take(element_count(data, primitive), path, faults)?;
                let mesh = decode(data, &shape, pose, path, numbers, faults, notes)?;
                extents.push(
                    mesh.positions
                        .iter()
                        .fold(Vec3::ZERO, |most, p| most.max(p.abs())),
                );
                geometry.meshes.push(mesh);
                Some(geometry.meshes.len() as u32 - 1)
            });
            let Some(index) = index else { continue };
            for world_from_mesh in &placements {
                drawn += geometry.meshes[index as usize].triangles.len() as u64;
                if drawn > MAX_DRAWN {
                    let path = format!("nodes[{}].mesh", node.source);
                    let message =
                        format!("brings the scene to more than {MAX_DRAWN} drawn triangles; split the scene");
                    faults.add(path, message);
                    return geometry;
                }
                if !within_reach(extents[index as usize], world_from_mesh) {
                    notes.count("placed meshes beyond the reach of 32-bit numbers left out", 1);
                    continue;
                }
                let placed = geometry.instances.len();
                match rank(world_from_mesh.matrix3) {
                    3 => geometry.instances.push(Instance {
                        mesh: index,
                        world_from_mesh: Affine3A::from_mat4(glam::DMat4::from(*world_from_mesh).as_mat4()),
                    }),
                    2 => {
                        let source = &geometry.meshes[index as usize];
                        let elements = element_count(data, primitive);
                        if budget.take(elements, path, faults).is_some() {
                            let flat = flattened(source, world_from_mesh);
                            geometry.meshes.push(flat);
                            extents.push(Vec3::ZERO);
                            geometry.instances.push(Instance {
                                mesh: geometry.meshes.len() as u32 - 1,
                                world_from_mesh: Affine3A::IDENTITY,
                            });
                        }
                    }
                    _ => notes.count("placed meshes scaled to nothing left out", 1),
                }
                if geometry.instances.len() > placed {
                    let name = node.name.as_ref().or_else(|| graph.mesh_names.get(mesh));
                    geometry.names.push(name.cloned().unwrap_or_default());
                }
            }
        }
    }
    geometry
}

fn element_count(data: &Data, primitive: &Primitive) -> u64 {
    let count = |accessor: usize| data.layout.accessors.peek(accessor).map_or(0, |a| a.count as u64);
    let attributes = 1
        + primitive.uvs.len()
        + 2 * primitive.joints.len()
        + (primitive.targets.iter())
            .map(|target| 3 + target.uvs.len())
            .sum::<usize>()
        + [primitive.normals, primitive.tangents, primitive.colors]
            .iter()
            .flatten()
            .count();
    // Without indices every vertex is one.
    let indices = primitive.indices.unwrap_or(primitive.positions);
    (count(primitive.positions).saturating_mul(attributes as u64)).saturating_add(count(indices))
}

/// Whether squared distances stay finite in f32 for a mesh of this extent.
fn within_reach(extent: Vec3, world_from_mesh: &DAffine3) -> bool {
    let (m, extent) = (world_from_mesh.matrix3, extent.as_dvec3());
    let reach = m.x_axis.abs() * extent.x
        + m.y_axis.abs() * extent.y
        + m.z_axis.abs() * extent.z
        + world_from_mesh.translation.abs();
    reach.is_finite() && reach.max_element() < f64::from(f32::MAX).sqrt()
}

/// A mesh under a scale of 0 along one axis: flat, but visible. There is no inverse to transform normals
/// with, so the vertices go to the world once and for all, flat shaded.
fn flattened(source: &Mesh, world_from_mesh: &DAffine3) -> Mesh {
    let world = |p: &Vec3| world_from_mesh.transform_point3(p.as_dvec3()).as_vec3();
    Mesh {
        positions: source.positions.iter().map(world).collect(),
        normals: Vec::new(),
        tangents: Vec::new(),
        ..source.clone()
    }
}

/// How many dimensions a transform leaves. Relative to its own columns, so that a small scale is no collapse.
fn rank(m: DMat3) -> usize {
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    // Below f32's smallest normal number the instance's own matrix would be zero.
    let unit: Vec<DVec3> = (columns.iter())
        .filter(|c| c.length() >= f64::from(f32::MIN_POSITIVE))
        .filter_map(|c| c.try_normalize())
        .collect();
    // Sines of angles that f32 cannot tell from 0.
    const TINY: f64 = 1e-7;
    match unit[..] {
        [a, b, c] if a.cross(b).dot(c).abs() > TINY => 3,
        [a, b, c]
            if [a.cross(b), b.cross(c), c.cross(a)]
                .iter()
                .any(|n| n.length() > TINY) =>
        {
            2
        }
        [a, b] if a.cross(b).length() > TINY => 2,
        _ => usize::from(!unit.is_empty()),
    }
}

/// A shape's vertices and triangles; `None` if no triangle is left.
fn decode(
    data: &Data,
    shape: &Shape,
    pose: Option<&SkinPose>,
    path: &str,
    numbers: &MaterialNumbers,
    faults: &Faults,
    notes: &mut Notes,
) -> Option<Mesh> {
    let primitive = shape.primitive;
    let positions = data.vectors(primitive.positions).into_iter();
    let mut vertices = Vertices {
        positions: positions.map(Vec3::from_array).collect(),
        normals: primitive
            .normals
            .map(|accessor| data.vectors(accessor))
            .unwrap_or_default(),
        tangents: primitive
            .tangents
            .map(|accessor| data.vectors(accessor))
            .unwrap_or_default(),
        uvs: (primitive.uvs.iter())
            .map(|set| set.map(|accessor| data.vectors(accessor)).unwrap_or_default())
            .collect(),
    };
    deform::morph(data, &primitive.targets, &shape.weights, &mut vertices);
    if let Some(pose) = pose {
        deform::skin(data, primitive, pose, path, &mut vertices, faults, notes);
    }
    let Vertices {
        positions,
        normals: read_normals,
        tangents: read_tangents,
        uvs,
    } = vertices;
    let mut triangles = triangles(data, primitive, positions.len(), path, faults, notes)?;
    if pose.is_some_and(SkinPose::is_mirrored) {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let bad: Vec<bool> = positions.iter().map(|p| !p.is_finite()).collect();
    if bad.contains(&true) {
        let before = triangles.len();
        triangles.retain(|t| t.iter().all(|&v| !bad[v as usize]));
        notes.count(
            "triangles with vertices that are not finite dropped",
            (before - triangles.len()) as u64,
        );
    }
    if triangles.is_empty() {
        notes.count("primitives without triangles left out", 1);
        return None;
    }
    let positions: Vec<Vec3> = positions
        .into_iter()
        .map(|p| if p.is_finite() { p } else { Vec3::ZERO })
        .collect();
    let degenerate = triangles.iter().filter(|t| !has_area(&positions, t)).count();
    // A few are in almost every scene and not worth a word.
    if degenerate > 1000 || degenerate * 100 > triangles.len() {
        notes.count("triangles without area, kept", degenerate as u64);
    }
    let count = positions.len();
    let normals = match primitive.normals {
        Some(_) => normals(read_normals, &positions, &triangles, notes),
        None => Vec::new(),
    };
    let tangents = match primitive.tangents {
        Some(_) if !normals.is_empty() => tangents(read_tangents, notes),
        _ => Vec::new(),
    };
    let mut bad_uvs = 0;
    let mut finite_uv = |uv: [f32; 2]| {
        let uv = Vec2::from_array(uv);
        bad_uvs += u64::from(!uv.is_finite());
        if uv.is_finite() { uv } else { Vec2::ZERO }
    };
    let uvs = (primitive.uvs.iter().zip(uvs)).map(|(set, read)| match set {
        Some(_) => read.into_iter().map(&mut finite_uv).collect(),
        None => vec![Vec2::ZERO; count],
    });
    let uvs = uvs.collect();
    notes.count("texture coordinates that are not finite replaced by 0", bad_uvs);
    Some(Mesh {
        normals,
        tangents,
        uvs,
        colors: primitive
            .colors
            .map_or_else(Vec::new, |accessor| colors(data, accessor, notes)),
        triangles,
        material: numbers.of(primitive),
        positions,
    })
}

/// Joins vertices to triangles; `None` after a fault.
fn triangles(
    data: &Data,
    primitive: &Primitive,
    vertices: usize,
    path: &str,
    faults: &Faults,
    notes: &mut Notes,
) -> Option<Vec<[u32; 3]>> {
    let indices = match primitive.indices {
        Some(accessor) => data.indices(accessor),
        None => (0..vertices as u32).collect(),
    };
    if let Some(at) = indices.iter().position(|&v| v as usize >= vertices) {
        faults.add(
            format!("{path}.indices"),
            format!(
                "element {at} is {}, but there are only {vertices} vertices; export the scene again",
                indices[at]
            ),
        );
        return None;
    }
    // Strips: every second triangle is turned round, so that all have the same front (section 3.7.2.1).
    let strip = |(i, w): (usize, &[u32])| match i % 2 {
        0 => [w[0], w[1], w[2]],
        _ => [w[0], w[2], w[1]],
    };
    Some(match primitive.mode {
        Mode::Triangles => {
            if !indices.len().is_multiple_of(3) {
                notes.count("primitives whose last triangle is incomplete, ended before it", 1);
            }
            indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
        }
        Mode::Strip => indices.windows(3).enumerate().map(strip).collect(),
        Mode::Fan => match indices.split_first() {
            Some((&first, rest)) => rest.windows(2).map(|w| [w[0], w[1], first]).collect(),
            None => Vec::new(),
        },
    })
}

fn area_vector(positions: &[Vec3], t: &[u32; 3]) -> DVec3 {
    let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
    (b - a).cross(c - a)
}

fn has_area(positions: &[Vec3], t: &[u32; 3]) -> bool {
    let [a, b, c] = t.map(|v| positions[v as usize].as_dvec3());
    let longest = (b - a)
        .length_squared()
        .max((c - a).length_squared())
        .max((c - b).length_squared());
    // Twice the area over the longest edge squared: a sliver ten million times longer than wide has none
    // that f32 can tell from 0.
    area_vector(positions, t).length() > 1e-7 * longest
}

/// Unit normals; those that are zero or not finite get the area-weighted mean of their triangles'. Empty if
/// none is usable, which means flat shading.
fn normals(read: Vec<[f32; 3]>, positions: &[Vec3], triangles: &[[u32; 3]], notes: &mut Notes) -> Vec<Vec3> {
    let unit = |n: [f32; 3]| {
        let n = Vec3::from_array(n);
        // In f64 the length of tiny vectors does not vanish.
        n.is_finite()
            .then(|| n.as_dvec3().try_normalize())
            .flatten()
            .map(DVec3::as_vec3)
    };
    let read: Vec<Option<Vec3>> = read.into_iter().map(unit).collect();
    let missing = read.iter().filter(|n| n.is_none()).count();
    if missing == read.len() {
        notes.count("meshes without a usable normal, shaded flat", 1);
        return Vec::new();
    }
    if missing == 0 {
        return read.into_iter().flatten().collect();
    }
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for t in triangles {
        let area = area_vector(positions, t);
        for &v in t {
            if read[v as usize].is_none() {
                sums[v as usize] += area;
            }
        }
    }
    notes.count(
        "normals without a direction replaced by those of their triangles",
        missing as u64,
    );
    let filled = read.into_iter().zip(sums).map(|(n, sum)| {
        // A vertex of no triangle with area: any direction does, it is never seen.
        n.unwrap_or_else(|| sum.try_normalize().map_or(Vec3::Y, DVec3::as_vec3))
    });
    filled.collect()
}

/// Unit tangents with a handedness of ±1; empty if any is unusable, so that they are derived instead.
fn tangents(read: Vec<[f32; 4]>, notes: &mut Notes) -> Vec<Vec4> {
    let unit = |[x, y, z, w]: [f32; 4]| {
        let t = Vec3::new(x, y, z).as_dvec3().try_normalize()?.as_vec3();
        (w.is_finite() && w != 0.0).then(|| t.extend(w.signum()))
    };
    let unit: Option<Vec<Vec4>> = read.into_iter().map(unit).collect();
    unit.unwrap_or_else(|| {
        notes.count(
            "meshes with unusable tangents, derived from the coordinates instead",
            1,
        );
        Vec::new()
    })
}

/// Linear RGBA; alpha 1 where there is none. Negative and non-finite values become 0 and 1.
fn colors(data: &Data, accessor: usize, notes: &mut Notes) -> Vec<Vec4> {
    let info = data.layout.accessors.peek(accessor);
    let (width, max) = info.map_or((4, 1.0), |info| {
        use super::component::Component::*;
        // Some exporters forget `normalized`: plain integers are meant the same way.
        let max = match (info.normalized, info.component) {
            (false, U8) => 255.0,
            (false, U16) => 65535.0,
            _ => 1.0,
        };
        (info.width, max)
    });
    let mut bad = 0;
    let mut clean = |c: Vec4| {
        if !c.is_finite() {
            bad += 1;
            return Vec4::ONE;
        }
        (c / max).max(Vec4::ZERO)
    };
    let colors = match width {
        3 => data
            .vectors(accessor)
            .into_iter()
            .map(|c| clean(Vec3::from_array(c).extend(max)))
            .collect(),
        _ => data
            .vectors(accessor)
            .into_iter()
            .map(|c| clean(Vec4::from_array(c)))
            .collect(),
    };
    notes.count("vertex colours that are not finite replaced by white", bad);
    colors
}
