//! Virtual lights that stand still: whatever shines, they are at the same places in the same clusters.
//!
//! Those that particles leave ([`super::virtual_lights`]) lie elsewhere whenever a lamp moves, in other clusters with other
//! representatives, and indirect light flickers by what each of these errs. Where somebody knows how much light arrives at places that stand
//! still, these make steadier virtual lights, and nothing is traced for them.

use super::points::{End, PointLights, surfaces};
use glam::Vec3;
use relight_scene::rays::SurfacePoint;
use relight_transport::light_clusters::{BuildSettings, LightClusters, build};
use relight_transport::point_light::{Emission, Patch, PointLight};
use std::collections::BinaryHeap;

/// Virtual lights that stand still, and a tree over them.
#[derive(Clone, Debug)]
pub struct StandingLights {
    lights: Vec<PointLight>,
    /// Metres.
    clearances: Vec<f32>,
    /// Clusters by area.
    pub(crate) tree: LightClusters,
}

/// Where a virtual light stands, and what it stands for.
#[derive(Clone, Copy, Debug)]
pub struct Stand {
    /// Where shadow rays to it end.
    pub end: SurfacePoint,
    /// Its surface as a rectangle around there.
    pub patch: Patch,
    /// Area of the surface, m²: positive.
    pub area: f32,
}

impl StandingLights {
    /// `scene_diagonal` in metres.
    pub fn new(stands: &[Stand], scene_diagonal: f32) -> StandingLights {
        let lights: Vec<PointLight> = (stands.iter())
            .map(|stand| PointLight {
                emission: Emission::Patch(stand.patch),
                position: stand.end.position,
                axis: stand.end.normal,
                intensity: Vec3::splat(stand.area),
            })
            .collect();
        let tree = build(&lights, &[], scene_diagonal, &BuildSettings::default());
        StandingLights {
            lights,
            clearances: stands.iter().map(|stand| stand.end.clearance).collect(),
            tree,
        }
    }

    /// Number of lights.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// At most `most` sets of lights that are near each other and face the same way, every light in one: those of a cut through the tree
    /// where what is wide is split first.
    pub fn sets(&self, most: usize) -> Vec<Vec<u32>> {
        let size = |node: u32| {
            let node = &self.tree.nodes[node as usize];
            let (sin, _) = node.half_angle();
            node.intensity.x * ((node.high - node.low).length_squared() + sin * sin)
        };
        let mut open: BinaryHeap<(u32, u32)> = (self.tree.roots.iter())
            .map(|root| (size(root.node).to_bits(), root.node))
            .collect();
        let mut leaves = Vec::new();
        while open.len() + leaves.len() < most {
            let Some((_, node)) = open.pop() else { break };
            match self.tree.children(node) {
                Some(children) => open.extend(children.map(|child| (size(child).to_bits(), child))),
                None => leaves.push(node),
            }
        }
        let mut nodes: Vec<u32> = open.into_iter().map(|(_, node)| node).chain(leaves).collect();
        nodes.sort_unstable();
        nodes.into_iter().map(|node| self.below(node)).collect()
    }

    /// Lights of a cluster.
    fn below(&self, node: u32) -> Vec<u32> {
        let (mut open, mut found) = (vec![node], Vec::new());
        while let Some(node) = open.pop() {
            match self.tree.children(node) {
                Some(children) => open.extend(children),
                None => found.push(self.tree.nodes[node as usize].representative),
            }
        }
        found.sort_unstable();
        found
    }
}

impl PointLights {
    /// Adds virtual lights that pass on the light of `source`. `intensities`: W/sr along the normals, one per light.
    pub fn add_standing(&mut self, lights: &StandingLights, intensities: &[Vec3], source: u32) {
        self.standing
            .push(self.lights.len()..self.lights.len() + lights.len());
        for ((light, &clearance), &intensity) in
            (lights.lights.iter().zip(&lights.clearances)).zip(intensities)
        {
            let shines = intensity.is_finite() && intensity.min_element() >= 0.0;
            self.lights.push(PointLight {
                intensity: if shines { intensity } else { Vec3::ZERO },
                ..*light
            });
            self.source.push(source);
            self.ends.push(End::Surface { clearance });
        }
        self.surfaces = surfaces(&self.ends);
    }
}
