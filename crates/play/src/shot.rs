//! What a camera sees, found once for as long as it stands still, complete once it exists.

use crate::choice::{Integrator, Tracer};
use crate::cuts::own_sites;
use crate::cuts::sites::FragmentSites;
use crate::edition::Edition;
use crate::frame::parts::EvenLight;
use crate::prepared::PreparedScene;
use crate::reconstruct;
use crate::reflections::{self, Reflections};
use crate::still::Still;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::exposure::Exposure;
use relight_render::layers::RenderSize;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::bsdf;
use relight_scene::camera::Camera;
use relight_scene::traced::TracedScene;
use relight_transport::basis::Level;
use relight_transport::sparse::{SparseMatrix, row};

/// Primary rays per pixel where the camera stands still: they are cast once per shot.
pub const STANDING_SAMPLES: u32 = 16;
/// The same where it moves and every frame casts them anew.
pub const MOVING_SAMPLES: u32 = 1;

/// How to look.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotSettings {
    /// How light will be made: a shot holds what this needs.
    pub integrator: Integrator,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Samples per pixel; of transfer and cuts half as many, but eight, where they show one thing of one colour, and four times as
    /// many where a pixel sees several. `None`: 16, with a moving camera 1; of other integrators those of their settings' defaults.
    pub samples: Option<u32>,
    /// The camera moves, and the next frame wants another shot: this one is made quickly.
    pub moving: bool,
    /// Which sites of the asset's visibility cuts each fragment takes; `None`: all light goes other ways.
    pub sites: Option<CutSites>,
}

/// Between which sites of visibility cuts a fragment interpolates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutSites {
    /// The points around it.
    Around,
    /// Those, or where they disagree one of its own, found with rays.
    Own,
}

impl Default for ShotSettings {
    /// 640 × 360 pixels of a camera that stands still, whatever shines.
    fn default() -> ShotSettings {
        ShotSettings {
            integrator: Integrator::Auto,
            width: 640,
            height: 360,
            samples: None,
            moving: false,
            sites: Some(CutSites::Own),
        }
    }
}

/// What a camera sees, for any number of frames.
pub enum Shot {
    /// Fragments, to be lit by what the asset holds.
    Relit(Box<RelitShot>),
    /// A camera, for integrators that trace every frame anew.
    Traced(TracedShot),
}

/// A camera and how to trace what it sees.
#[derive(Clone, Debug)]
pub struct TracedShot {
    /// Where from.
    pub camera: Camera,
    /// Size of the image.
    pub size: RenderSize,
    /// Samples per pixel, if they were chosen.
    pub samples: Option<u32>,
    /// How light is made.
    pub tracer: Tracer,
}

/// Fragments with all that lighting them needs of the asset.
pub struct RelitShot {
    /// The fragments of each pixel.
    pub seen: Exposure,
    /// Functions of the finest points at them; `None` for an asset without points.
    pub functions: Option<Functions>,
    /// Between which sites each interpolates visibility; `None`: no cuts are used.
    pub sites: Option<FragmentSites>,
    /// What lobes see.
    pub reflections: Reflections,
    /// Whether indirect light is made by transfer.
    pub transfers: bool,
    /// What it took.
    pub times: ShotTimes,
    /// Of which state of the player's materials it is.
    pub(crate) edition: Edition,
    /// What fragments reflect of lamps that stand still, by shadow rays.
    pub(crate) reflected: Still<Vec<Vec3>>,
    /// What of it they see over two lobes ([`crate::glossy_ends`]).
    pub(crate) at_ends: Still<Option<Vec<Vec3>>>,
    /// The same of even directions, by visibility cuts.
    pub(crate) even: Still<Option<EvenLight>>,
}

/// Milliseconds that a shot took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShotTimes {
    /// Primary rays.
    pub expose: f64,
    /// Functions, lobes and sites of the fragments.
    pub weigh: f64,
}

/// Functions of the finest points at fragments.
#[derive(Clone, Debug)]
pub struct Functions {
    /// Weights of the points, a row for each fragment; empty where there is no surface.
    pub weights: SparseMatrix,
    /// Those weights on the components of vector irradiance, one per entry of `weights`.
    pub components: Vec<Vec3>,
    /// Reflectance of each fragment for indirect light that it spreads like something matt: all, or, of fragments whose
    /// lobe is followed, the matt part.
    pub albedo: Vec<Vec3>,
}

impl RelitShot {
    /// Finds what lighting needs of some fragments. `lobe_rays`: of the widest lobe ([`reflections::FIXED_RAYS`]).
    ///
    /// # Errors
    /// It was stopped.
    pub fn new(
        prepared: &PreparedScene,
        seen: Exposure,
        lobe_rays: u32,
        sites: Option<CutSites>,
        watch: &dyn Watch,
    ) -> Result<RelitShot, Cancelled> {
        let scene = &prepared.scene;
        let (functions, reflections) = match &prepared.transfer {
            Some(transfer) => {
                let weights = weights(transfer, scene, &seen, watch);
                go_on(watch)?;
                let (albedo, reflections) = lobes(transfer, scene, &seen, &weights, lobe_rays, watch)?;
                let functions = Functions {
                    components: components(&transfer.finest, &seen, &weights),
                    weights,
                    albedo,
                };
                (Some(functions), reflections)
            }
            None => (None, Reflections::default()),
        };
        go_on(watch)?;
        let sites = match (&prepared.cuts, &functions, sites) {
            (Some(cuts), Some(functions), Some(wanted)) => {
                let around = FragmentSites::new(&functions.weights);
                Some(match wanted {
                    CutSites::Around => around,
                    CutSites::Own => own_sites::with_own(cuts, scene, &seen, around),
                })
            }
            _ => None,
        };
        Ok(RelitShot {
            seen,
            functions,
            sites,
            reflections,
            transfers: true,
            times: ShotTimes::default(),
            edition: Edition::default(),
            reflected: Still::default(),
            at_ends: Still::default(),
            even: Still::default(),
        })
    }

    /// Fragments that lie on a surface which no function covers.
    pub fn uncovered(&self) -> usize {
        let Some(Functions { weights, .. }) = &self.functions else {
            return 0;
        };
        (0..self.seen.len())
            .filter(|&f| self.seen.hits[f].is_some() && row(weights, f).len() == 0)
            .count()
    }

    /// Finds again what depends on how surfaces reflect: what `seen` has of it was changed.
    pub(crate) fn weigh_lobes(&mut self, transfer: &Transfer, scene: &TracedScene, rays: u32) {
        let Some(functions) = &mut self.functions else {
            return;
        };
        // Nobody stops it.
        if let Ok(lobes) = lobes(transfer, scene, &self.seen, &functions.weights, rays, &()) {
            (functions.albedo, self.reflections) = lobes;
        }
    }

    /// Finds again what depends on shading normals.
    pub(crate) fn weigh_components(&mut self, finest: &Level) {
        if let Some(functions) = &mut self.functions {
            functions.components = components(finest, &self.seen, &functions.weights);
        }
    }
}

fn weights(transfer: &Transfer, scene: &TracedScene, seen: &Exposure, watch: &dyn Watch) -> SparseMatrix {
    let places: Vec<Option<(Vec3, Vec3)>> = (seen.hits.par_iter().with_min_len(4096))
        .map(|hit| hit.as_ref().map(|h| (h.position, h.normal)))
        .collect();
    let each_separated = |asked: &[reconstruct::Asked]| transfer.each_separated(scene, asked);
    reconstruct::weights_at(
        &transfer.finest,
        &places,
        transfer.separated(scene),
        each_separated,
        watch,
    )
}

/// Reflectances for what is spread like something matt, and what lobes see.
fn lobes(
    transfer: &Transfer,
    scene: &TracedScene,
    seen: &Exposure,
    weights: &SparseMatrix,
    rays: u32,
    watch: &dyn Watch,
) -> Result<(Vec<Vec3>, Reflections), Cancelled> {
    let at_points = transfer.enclosed();
    let enclosed = |f| {
        let sum: f32 = row(weights, f).map(|(j, w)| w * at_points[j as usize]).sum();
        sum.clamp(0.0, 1.0)
    };
    let (albedo, lobes): (Vec<Vec3>, Vec<u32>) = (seen.points.par_iter().zip(&seen.directions).enumerate())
        .with_min_len(256)
        .map(|(f, (point, direction))| {
            let (Some(point), wo) = (point, -*direction) else {
                return (Vec3::ZERO, 0);
            };
            match reflections::rays(point, wo, rays, enclosed(f)) {
                0 => (bsdf::hemispherical_albedo(point), 0),
                rays => (reflections::matt_albedo(point, wo), rays),
            }
        })
        .unzip();
    let reflections = Reflections::new(scene, transfer, seen, &lobes, rays, watch)?;
    Ok((albedo, reflections))
}

fn components(finest: &Level, seen: &Exposure, weights: &SparseMatrix) -> Vec<Vec3> {
    let normals: Vec<(Vec3, Vec3)> = (seen.points.par_iter().with_min_len(4096))
        .map(|p| {
            p.as_ref()
                .map_or((Vec3::Z, Vec3::Z), |p| (p.normal, p.shading_normal))
        })
        .collect();
    reconstruct::components(weights, finest, &normals)
}
