//! The lights that visibility cuts cluster, and what sites see of them.

use super::cells::Cells;
use super::node_view::{NodeView, radii};
use super::position_tree::PositionTree;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::TracedScene;
use relight_transport::cuts::SiteCuts;
use relight_transport::light_tree::sums;

/// What sites see of many lights, as the asset has it.
pub struct VisibilityCuts {
    /// The cut of each site; site i is finest point i.
    pub cuts: SiteCuts,
    /// The lights.
    pub lights: CutLights,
}

/// Lights that cuts cluster.
pub enum CutLights {
    /// Even directions, which carry the light of environments.
    Directions(Directions),
    /// Even surface samples, which carry the first bounce of any light.
    Surface(SurfaceSamples),
}

/// Even directions in the order of the leaves of their tree.
pub struct Directions {
    /// The tree.
    pub tree: DirectionTree,
    /// Which leaf each part of the sphere belongs to.
    pub cells: Cells,
}

/// Surface samples in the order of the leaves of their tree.
pub struct SurfaceSamples {
    /// The tree.
    pub tree: PositionTree,
    /// Where each lies on the scene's surfaces; a primitive that the scene does not have where it was not found.
    pub hits: Vec<Option<SurfaceHit>>,
    /// Reflectance of each.
    pub albedo: Vec<Vec3>,
    /// What a value of 1 in the cuts stands for.
    pub unit: f32,
}

impl VisibilityCuts {
    /// Cuts through the tree whose leaves look into `directions` (unit; a power of two of them).
    pub fn of_directions(cuts: SiteCuts, directions: &[Vec3]) -> VisibilityCuts {
        let lights = CutLights::Directions(Directions {
            tree: DirectionTree::new(directions),
            cells: Cells::new(directions),
        });
        VisibilityCuts { cuts, lights }
    }

    /// The even directions, if those are the lights.
    pub fn directions(&self) -> Option<&Directions> {
        match &self.lights {
            CutLights::Directions(directions) => Some(directions),
            CutLights::Surface(_) => None,
        }
    }

    /// The surface samples, if those are the lights.
    pub fn samples(&self) -> Option<&SurfaceSamples> {
        match &self.lights {
            CutLights::Directions(_) => None,
            CutLights::Surface(samples) => Some(samples),
        }
    }
}

impl CutLights {
    /// Height of the tree's root.
    #[inline]
    pub fn height(&self) -> u8 {
        match self {
            CutLights::Directions(directions) => directions.tree.height,
            CutLights::Surface(samples) => samples.tree.height,
        }
    }

    /// Number of leaves.
    #[inline]
    pub fn leaves(&self) -> usize {
        1 << self.height()
    }
}

impl SurfaceSamples {
    /// Samples that each stand for `area`; `hits` are where they lie on the scene's surfaces. `unfound(sample)` is the
    /// reflectance of those that lie on none.
    pub fn new(
        scene: &TracedScene,
        area: f32,
        positions: &[Vec3],
        hits: Vec<Option<SurfaceHit>>,
        unit: f32,
        unfound: impl Fn(usize) -> Vec3 + Sync + Send,
    ) -> SurfaceSamples {
        let mut samples = SurfaceSamples {
            tree: PositionTree::new(positions, area),
            albedo: (0..hits.len()).into_par_iter().map(unfound).collect(),
            hits,
            unit,
        };
        reflectances(scene, &samples.hits, &mut samples.albedo, |_| true);
        samples
    }

    /// Flux of each leaf for [`super::illumination::Illumination`], in the cuts' unit: what it reflects (radiance) of the
    /// irradiance that it receives.
    pub fn flux(&self, irradiance: &[Vec3]) -> Vec<Vec3> {
        let scale = self.unit * std::f32::consts::FRAC_1_PI;
        (irradiance.iter().zip(&self.albedo))
            .map(|(&e, &albedo)| e * albedo * scale)
            .collect()
    }
}

/// Evaluates the reflectance of places again whose material is `wanted`. Places that found no surface keep theirs.
pub fn reflectances(
    scene: &TracedScene,
    hits: &[Option<SurfaceHit>],
    albedo: &mut [Vec3],
    wanted: impl Fn(u32) -> bool + Sync,
) {
    (albedo.par_iter_mut().zip(hits))
        .with_min_len(256)
        .for_each(|(albedo, hit)| {
            if let Some(hit) = hit
                && (hit.primitive as usize) < scene.triangle_count()
                && wanted(scene.material_of(hit.primitive))
            {
                *albedo = scene.albedo(hit).clamp(Vec3::ZERO, Vec3::ONE);
            }
        });
}

/// A complete tree of directions, seen alike from everywhere.
pub struct DirectionTree {
    /// Height of the root.
    pub height: u8,
    /// The nodes, by [`relight_transport::light_tree::Node::slot`].
    pub views: Vec<NodeView>,
}

impl DirectionTree {
    fn new(leaves: &[Vec3]) -> DirectionTree {
        let n = leaves.len();
        let all = sums(leaves);
        let mean_length = |slot: usize| all[slot].length() * (slot.max(1).ilog2() as f32).exp2() / n as f32;
        let directions: Vec<Vec3> = all.iter().map(|d| d.normalize_or(Vec3::Y)).collect();
        // A leaf is a disc of 4π/n steradians.
        let leaf = 2.0 / (n as f32).sqrt();
        // atan2 of the chord, because the arc cosine of f32 loses small angles.
        let radii = radii(leaves, leaf, |slot, d| {
            directions[slot].cross(d).length().atan2(directions[slot].dot(d))
        });
        let views = (directions.iter().zip(radii).enumerate())
            .map(|(slot, (&direction, radius))| NodeView {
                direction,
                length: mean_length(slot),
                radius,
            })
            .collect();
        DirectionTree {
            height: n.trailing_zeros() as u8,
            views,
        }
    }
}
