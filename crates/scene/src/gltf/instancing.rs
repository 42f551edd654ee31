//! EXT_mesh_gpu_instancing: a mesh placed many times by one node, each placement a translation, rotation and scale of its
//! own that is applied before the node's transform. Other attributes are for shaders and ignored.

use super::accessors::Data;
use super::json::At;
use super::layout::Layout;
use super::notes::Notes;
use glam::{DAffine3, DQuat, DVec3, Vec3};

/// Placements that no bytes stand behind: as many as a real file may ask for by zeros alone.
const MAX_UNBACKED: usize = 1 << 16;

/// Accessors of a node's placements, checked for width and count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instancing {
    translation: Option<usize>,
    rotation: Option<usize>,
    scale: Option<usize>,
    count: usize,
}

/// The placements that a node's extension asks for; `None` without one. A node that has no mesh needs none.
pub(super) fn parse(node: &At, layout: &Layout) -> Option<Instancing> {
    node.get("mesh")?;
    let attributes = node.extension("EXT_mesh_gpu_instancing")?.object("attributes")?;
    let mut found = Instancing::default();
    let mut slots_filled = false;
    for (key, width, slot) in [
        ("TRANSLATION", 3, &mut found.translation),
        ("ROTATION", 4, &mut found.rotation),
        ("SCALE", 3, &mut found.scale),
    ] {
        let Some(index) = attributes.index(key, layout.accessors.len(), "accessors") else {
            continue;
        };
        let Some(info) = layout.accessors.get(index, attributes.faults()) else {
            continue;
        };
        if info.width != width {
            let what =
                format!("uses accessors[{index}], which has no {width} components; export the scene again");
            attributes.fault_at(key, what);
        } else if info.view.is_none() && info.count > MAX_UNBACKED {
            let what = format!(
                "uses accessors[{index}], which declares {} elements without a bufferView; export the scene again",
                info.count
            );
            attributes.fault_at(key, what);
        } else if slots_filled && found.count != info.count {
            let what = format!(
                "has {} elements where the others have {}; export the scene again",
                info.count, found.count
            );
            attributes.fault_at(key, what);
        } else {
            *slot = Some(index);
            slots_filled = true;
            found.count = info.count;
        }
    }
    slots_filled.then_some(found)
}

impl Instancing {
    /// Transforms from the mesh to the node, one for each placement.
    pub fn node_from_mesh(&self, data: &Data, notes: &mut Notes) -> Vec<DAffine3> {
        let vectors = |accessor: Option<usize>, default: f32| -> Vec<DVec3> {
            let read = accessor.map(|accessor| data.vectors(accessor));
            let read = read.unwrap_or_else(|| vec![[default; 3]; self.count]);
            read.into_iter().map(|v| Vec3::from_array(v).as_dvec3()).collect()
        };
        let (translations, scales) = (vectors(self.translation, 0.0), vectors(self.scale, 1.0));
        let rotations: Vec<[f32; 4]> = match self.rotation {
            Some(accessor) => data.vectors(accessor),
            None => vec![[0.0, 0.0, 0.0, 1.0]; self.count],
        };
        let mut without = 0;
        // Any length but zero names a rotation: exporters round, and some forget `normalized`.
        let mut unit = |rotation: [f32; 4]| {
            let rotation = DQuat::from_array(rotation.map(f64::from));
            let usable = rotation.is_finite() && rotation.length_squared() > 1e-12;
            without += u64::from(!usable);
            if usable {
                rotation.normalize()
            } else {
                DQuat::IDENTITY
            }
        };
        let placed = (translations.into_iter().zip(rotations).zip(scales))
            .map(|((t, r), s)| DAffine3::from_scale_rotation_translation(s, unit(r), t))
            .collect();
        notes.count("instances whose rotation is no direction, not rotated", without);
        placed
    }
}
