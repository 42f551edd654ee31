//! Skins and morph targets at rest (glTF 2.0, sections 3.7.2.2 and 3.7.3): vertices as the file shows them before any
//! animation plays.
//!
//! A skinned vertex is where its joints take it; the transform of the node that shows the mesh has no part in that. Skinned
//! vertices come out relative to the first joint's place, so that they keep their digits far from the origin.

use super::accessors::Data;
use super::component::Component;
use super::json::{At, Faults};
use super::layout::Layout;
use super::list::List;
use super::nodes::Graph;
use super::notes::Notes;
use super::primitives::{MorphTarget, Primitive};
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};

/// Joints of a skin.
pub(super) struct Skin {
    /// Nodes of the file.
    joints: Vec<usize>,
    /// Accessor of as many matrices or more; identities where there is none.
    inverse_bind: Option<usize>,
}

/// Reads all skins; what is wrong with those that shown meshes use is reported.
pub(super) fn parse_skins(root: &At, layout: &Layout, graph: &Graph, notes: &mut Notes) -> List<Skin> {
    let count = root.items("nodes").len();
    let skins = List::parse(root, "skins", |at| Some(parse_skin(at, layout, count)));
    for node in graph.order.iter().map(|&i| &graph.nodes[i]) {
        if let (Some(skin), Some(_)) = (node.skin, node.mesh) {
            skins.get(skin, root.faults());
        }
    }
    skins.note_unused(notes);
    skins
}

fn parse_skin(at: &At, layout: &Layout, nodes: usize) -> Skin {
    let joints = at.items("joints");
    let joints: Vec<usize> = (joints.iter())
        .filter_map(|joint| joint.as_index(nodes, "nodes"))
        .collect();
    if joints.is_empty() {
        at.fault_at("joints", "is empty; export the scene again");
    }
    let key = "inverseBindMatrices";
    let inverse_bind = at.index(key, layout.accessors.len(), "accessors");
    if let Some(index) = inverse_bind
        && let Some(info) = layout.accessors.get(index, at.faults())
        && (!info.is_matrix_4() || info.component != Component::F32 || info.count < joints.len())
    {
        at.fault_at(
            key,
            format!("uses accessors[{index}], which has no matrix of floats for each joint; export the scene again"),
        );
    }
    Skin { joints, inverse_bind }
}

/// Where a skin takes the vertices of meshes.
pub(super) struct SkinPose {
    /// The origin that `posed_from_mesh` leads to, in the world.
    pub world_from_posed: DAffine3,
    /// By joint.
    posed_from_mesh: Vec<DAffine3>,
}

impl SkinPose {
    /// The skin at rest.
    pub fn at_rest(skin: &Skin, data: &Data, graph: &Graph) -> SkinPose {
        let world_from_joints: Vec<DAffine3> = (skin.joints.iter())
            .map(|&joint| graph.world_from_node(joint))
            .collect();
        let origin = world_from_joints
            .first()
            .map_or(DVec3::ZERO, |world| world.translation);
        let binds = skin
            .inverse_bind
            .map(|accessor| data.matrices(accessor))
            .unwrap_or_default();
        let posed_from_mesh = world_from_joints
            .into_iter()
            .enumerate()
            .map(|(i, mut posed_from_joint)| {
                posed_from_joint.translation -= origin;
                match binds.get(i) {
                    Some(bind) => {
                        let columns = bind.map(|column| column.map(f64::from));
                        posed_from_joint * DAffine3::from_mat4(DMat4::from_cols_array_2d(&columns))
                    }
                    None => posed_from_joint,
                }
            });
        SkinPose {
            world_from_posed: DAffine3::from_translation(origin),
            posed_from_mesh: posed_from_mesh.collect(),
        }
    }

    /// Whether joints turn meshes inside out, so that triangles must be turned round to keep their front.
    pub fn is_mirrored(&self) -> bool {
        (self.posed_from_mesh.iter()).all(|posed| posed.matrix3.determinant() < 0.0)
    }
}

/// Vertices as they are decoded; normals and tangents of any length, empty where the mesh has none.
pub(super) struct Vertices {
    pub positions: Vec<Vec3>,
    pub normals: Vec<[f32; 3]>,
    pub tangents: Vec<[f32; 4]>,
    /// By set; empty for a set that is missing below another one.
    pub uvs: Vec<Vec<[f32; 2]>>,
}

/// Joints and weights of all vertices, four of each.
type JointSet = (Vec<[f32; 4]>, Vec<[f32; 4]>);

/// Adds morph targets by their weights (bits of f32).
pub(super) fn morph(data: &Data, targets: &[MorphTarget], weights: &[u32], vertices: &mut Vertices) {
    for (target, weight) in targets.iter().zip(weights) {
        let weight = f32::from_bits(*weight);
        if weight == 0.0 {
            continue;
        }
        if let Some(accessor) = target.positions {
            for (p, d) in vertices.positions.iter_mut().zip(data.vectors(accessor)) {
                *p += weight * Vec3::from_array(d);
            }
        }
        if let Some(accessor) = target.normals {
            add(&mut vertices.normals, &data.vectors::<3>(accessor), weight);
        }
        if let Some(accessor) = target.tangents {
            // Displacements have no handedness.
            add(&mut vertices.tangents, &data.vectors::<3>(accessor), weight);
        }
        for (uvs, accessor) in vertices.uvs.iter_mut().zip(&target.uvs) {
            if let Some(accessor) = accessor {
                add(uvs, &data.vectors::<2>(*accessor), weight);
            }
        }
    }
}

fn add<const N: usize, const D: usize>(to: &mut [[f32; N]], displacements: &[[f32; D]], weight: f32) {
    for (to, displacement) in to.iter_mut().zip(displacements) {
        for (x, d) in to.iter_mut().zip(displacement) {
            *x += weight * d;
        }
    }
}

/// Moves vertices with the joints. Weights are scaled to a sum of 1; vertices without any follow the first joint.
pub(super) fn skin(
    data: &Data,
    primitive: &Primitive,
    pose: &SkinPose,
    path: &str,
    vertices: &mut Vertices,
    faults: &Faults,
    notes: &mut Notes,
) {
    if primitive.joints.is_empty() {
        notes.count(
            "skinned meshes without joints or weights, which follow the first joint",
            1,
        );
    }
    let sets: Vec<JointSet> = (primitive.joints.iter())
        .map(|&(joints, weights)| (data.vectors(joints), data.vectors(weights)))
        .collect();
    let mut unweighted = 0;
    for v in 0..vertices.positions.len() {
        let (mut linear, mut translation, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for (joints, weights) in &sets {
            for (joint, weight) in joints[v].iter().zip(weights[v]) {
                let weight = f64::from(weight);
                if weight == 0.0 || !weight.is_finite() {
                    continue;
                }
                let Some(posed) = pose.posed_from_mesh.get(*joint as usize) else {
                    let message = format!(
                        "names joint {joint} at vertex {v}, but the skin has {}; export the scene again",
                        pose.posed_from_mesh.len()
                    );
                    faults.add(format!("{path}.attributes"), message);
                    return;
                };
                linear += posed.matrix3 * weight;
                translation += posed.translation * weight;
                sum += weight;
            }
        }
        if sum > 0.0 {
            (linear, translation) = (linear * sum.recip(), translation / sum);
        } else {
            unweighted += 1;
            let first = pose
                .posed_from_mesh
                .first()
                .copied()
                .unwrap_or(DAffine3::IDENTITY);
            (linear, translation) = (first.matrix3, first.translation);
        }
        let position = &mut vertices.positions[v];
        *position = (linear * position.as_dvec3() + translation).as_vec3();
        if let Some(normal) = vertices.normals.get_mut(v) {
            let n = DVec3::from_array(normal.map(f64::from));
            *normal = (cofactors(linear) * n).as_vec3().to_array();
        }
        if let Some([x, y, z, _]) = vertices.tangents.get_mut(v) {
            let t = linear * DVec3::new((*x).into(), (*y).into(), (*z).into());
            [*x, *y, *z] = t.as_vec3().to_array();
        }
    }
    if !primitive.joints.is_empty() {
        notes.count(
            "vertices without a joint's weight, which follow the first joint",
            unweighted,
        );
    }
}

/// The inverse transposed times the determinant: what normals are transformed by, up to their length.
fn cofactors(m: DMat3) -> DMat3 {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * sign
}
