//! What a camera sees, found once for as long as it stands still: the fragments of each pixel.
//!
//! A pixel is sampled by several primary rays. Rays that meet the same material, facing the same way, at
//! neighbouring places make one fragment: it is lit once, at the place nearest its middle, with the mean of
//! its rays' reflectances and normals, and a lobe as much wider as the normal map spreads them. Nearly all pixels have
//! one fragment, so that antialiased silhouettes and filtered textures cost a frame little more than one sample per pixel.

mod expose;

pub(crate) use expose::ENDS;
pub use expose::expose;

use crate::cuts::sites::FragmentSites;
use crate::reconstruct;
use crate::reflections::{self, Reflections, Start};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::basis::Level;
use relight_transport::sparse::{SparseMatrix, row};
use std::ops::Range;

/// Fragments of all pixels, in order of pixels; a pixel's first fragment is where its row starts.
#[derive(Debug, Default)]
pub struct Shot {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Start of each pixel's fragments, and the end of the last.
    pub offsets: Vec<u32>,
    /// Share of the pixel that each fragment covers; a pixel's shares sum to 1.
    pub coverage: Vec<f32>,
    /// Where each fragment is lit; `None` for the background.
    pub hits: Vec<Option<SurfaceHit>>,
    /// How it reflects.
    pub points: Vec<Option<ShadingPoint>>,
    /// Unit direction from the camera.
    pub directions: Vec<Vec3>,
    /// Functions of the finest points at each fragment, rows of fragments; `None` if none were asked for.
    pub weights: Option<SparseMatrix>,
    /// Those functions' weights on the components of vector irradiance, one per entry of `weights`.
    pub components: Vec<Vec3>,
    /// Sites between which each fragment interpolates visibility; empty if no cuts are used.
    pub sites: FragmentSites,
    /// Reflectance of each fragment for indirect light that it spreads like something matt: all, or, of fragments whose
    /// lobe is followed, the matt part.
    pub albedo: Vec<Vec3>,
    /// What lobes see.
    pub reflections: Reflections,
    /// Camera position.
    pub eye: Vec3,
    /// Where some of each fragment's rays end, fragment by fragment; [`Shot::ends_of`].
    ends: Vec<RayEnd>,
    /// Start of each fragment's ends, and the end of the last; empty where pixels have one ray.
    end_offsets: Vec<u32>,
}

/// Where a ray from the eye ends: a place on a triangle, seen from its front or back.
#[derive(Clone, Copy, Debug)]
struct RayEnd {
    primitive: u32,
    barycentric: [f32; 2],
    front: bool,
}

impl Shot {
    /// Appends some pixels of another shot; the end of the last one's fragments is left to be told.
    fn push_pixels(&mut self, of: &Shot, pixels: Range<usize>) {
        let fragments = of.offsets[pixels.start] as usize..of.offsets[pixels.end] as usize;
        let moved = |at: u32, from: usize, to: usize| (at as usize - from + to) as u32;
        let to = self.coverage.len();
        (self.offsets).extend(
            of.offsets[pixels]
                .iter()
                .map(|&at| moved(at, fragments.start, to)),
        );
        let ends = of.end_offsets[fragments.start] as usize..of.end_offsets[fragments.end] as usize;
        let to = self.ends.len();
        let last = &of.end_offsets[fragments.start + 1..=fragments.end];
        (self.end_offsets).extend(last.iter().map(|&at| moved(at, ends.start, to)));
        self.ends.extend_from_slice(&of.ends[ends]);
        self.coverage.extend_from_slice(&of.coverage[fragments.clone()]);
        self.hits.extend_from_slice(&of.hits[fragments.clone()]);
        self.points.extend_from_slice(&of.points[fragments.clone()]);
        self.directions.extend_from_slice(&of.directions[fragments]);
    }

    /// Finds the finest points' functions, reflectances and what lobes see, once per shot; `rays`: of the widest lobe
    /// ([`reflections::FIXED_RAYS`]).
    pub fn weigh(&mut self, transfer: &Transfer, scene: &TracedScene, rays: u32) {
        let finest = &transfer.finest;
        let places: Vec<Option<(Vec3, Vec3)>> = self
            .hits
            .iter()
            .map(|hit| hit.as_ref().map(|h| (h.position, h.normal)))
            .collect();
        let is_parted = |place, point| transfer.is_parted(scene, place, point);
        let weights = reconstruct::weights_at(finest, &places, &transfer.near_parted, is_parted);
        self.weights = Some(weights);
        self.weigh_lobes(transfer, scene, rays);
        self.weigh_components(finest);
    }

    /// The part of [`Shot::weigh`] that depends on how surfaces reflect.
    pub(crate) fn weigh_lobes(&mut self, transfer: &Transfer, scene: &TracedScene, rays: u32) {
        let (albedo, lobes): (Vec<Vec3>, Vec<u32>) = (self.points.par_iter().zip(&self.directions))
            .with_min_len(256)
            .map(|(point, direction)| {
                let (Some(point), wo) = (point, -*direction) else {
                    return (Vec3::ZERO, 0);
                };
                match reflections::rays(point, wo, rays) {
                    0 => (bsdf::hemispherical_albedo(point), 0),
                    rays => (
                        bsdf::diffuse_reflectance(point, point.shading_normal.dot(wo)),
                        rays,
                    ),
                }
            })
            .unzip();
        self.albedo = albedo;
        self.reflections = Reflections::new(scene, transfer, &lobes, rays, |f| self.starts_of(scene, f));
    }

    /// The part of [`Shot::weigh`] that depends on shading normals.
    pub(crate) fn weigh_components(&mut self, finest: &Level) {
        let normals: Vec<(Vec3, Vec3)> = (self.points.iter())
            .map(|p| {
                p.as_ref()
                    .map_or((Vec3::Z, Vec3::Z), |p| (p.normal, p.shading_normal))
            })
            .collect();
        if let Some(weights) = &self.weights {
            self.components = reconstruct::components(weights, finest, &normals);
        }
    }

    /// Chooses the points between which every fragment interpolates visibility, after [`Shot::weigh`].
    pub fn choose_sites(&mut self) {
        self.sites = self.weights.as_ref().map(FragmentSites::new).unwrap_or_default();
    }

    /// Fragments of a pixel.
    pub fn fragments_of(&self, pixel: usize) -> Range<usize> {
        self.offsets[pixel] as usize..self.offsets[pixel + 1] as usize
    }

    /// Where some of the rays end that make up fragment `f`; none where pixels have one ray.
    pub fn ends_of(&self, scene: &TracedScene, f: usize) -> impl Iterator<Item = SurfaceHit> {
        (self.ends[self.range_of_ends(f)].iter())
            .map(|end| scene.surface_at(end.primitive, end.barycentric, end.front))
    }

    /// Where fragment `f` is looked from: where some of its rays end, or, where none are kept, where it is lit.
    pub fn places_of(&self, scene: &TracedScene, f: usize) -> Vec<SurfaceHit> {
        let mut places: Vec<SurfaceHit> = self.ends_of(scene, f).collect();
        if places.is_empty() {
            places.extend(self.hits[f]);
        }
        places
    }

    /// Where rays of a fragment's lobe start: at its rays' ends, or, where none are kept, at the place where it is lit.
    fn starts_of(&self, scene: &TracedScene, f: usize) -> Vec<Start> {
        let (Some(lit), Some(point)) = (self.hits[f], self.points[f]) else {
            return Vec::new();
        };
        if !self.has_ends(f) {
            return vec![(lit, point, -self.directions[f])];
        }
        self.reflecting_at_ends(scene, f).collect()
    }

    /// The ends of a fragment's rays, how they reflect and the unit directions from them to the eye. Colours are the fragment's, as a
    /// mean of more rays; normals and roughness are those of each end, whose mean would reflect far less sharply.
    pub(crate) fn reflecting_at_ends(&self, scene: &TracedScene, f: usize) -> impl Iterator<Item = Start> {
        let point = self.points[f];
        self.ends_of(scene, f).filter_map(move |hit| {
            let point = point?;
            let wo = (self.eye - hit.position).normalize_or_zero();
            let own = if point.lambert {
                ShadingPoint::lambert(&hit, point.diffuse)
            } else {
                scene.shading_point(&hit)
            };
            let point = ShadingPoint {
                base_color: point.base_color,
                diffuse: point.diffuse,
                f0: point.f0,
                ..own.facing(wo)
            };
            Some((hit, point, wo))
        })
    }

    /// How many of its ends stand for fragment `f` where its pixel has about `of_pixel` of them, or as many as there are.
    pub(crate) fn ends_for(&self, f: usize, of_pixel: f32) -> usize {
        let wanted = (of_pixel * self.coverage[f]).ceil() as usize;
        wanted.min(self.range_of_ends(f).len())
    }

    /// Whether [`Shot::ends_of`] has any.
    pub fn has_ends(&self, f: usize) -> bool {
        !self.range_of_ends(f).is_empty()
    }

    fn range_of_ends(&self, f: usize) -> Range<usize> {
        match self.end_offsets.get(f..f + 2) {
            Some(&[start, end]) => start as usize..end as usize,
            _ => 0..0,
        }
    }

    /// Number of fragments.
    pub fn len(&self) -> usize {
        self.coverage.len()
    }

    /// Adds the pixels of another shot below; it must be as wide. For light that leaves alike in all directions, which
    /// needs no eye: the first shot's stays. Weights and sites are to be found afterwards; ray ends are forgotten.
    pub fn append(&mut self, below: Shot) {
        if self.offsets.is_empty() {
            *self = below;
            return;
        }
        let start = self.offsets[self.offsets.len() - 1];
        self.height += below.height;
        (self.offsets).extend(below.offsets.iter().skip(1).map(|&at| start + at));
        self.coverage.extend(below.coverage);
        self.hits.extend(below.hits);
        self.points.extend(below.points);
        self.directions.extend(below.directions);
        (self.ends, self.end_offsets) = (Vec::new(), Vec::new());
        self.albedo.extend(below.albedo);
    }

    /// Whether there are no fragments (an image of no pixels).
    pub fn is_empty(&self) -> bool {
        self.coverage.is_empty()
    }

    /// Fragments that lie on a surface which no function covers.
    pub fn uncovered(&self) -> usize {
        self.weights.as_ref().map_or(0, |weights| {
            (0..self.len())
                .filter(|&f| self.hits[f].is_some() && row(weights, f).len() == 0)
                .count()
        })
    }

    /// Pixels from fragments: coverage-weighted sums.
    pub fn resolve(&self, fragments: &[Vec3]) -> Vec<Vec3> {
        (0..self.width * self.height)
            .into_par_iter()
            .with_min_len(4096)
            .map(|pixel| {
                self.fragments_of(pixel)
                    .map(|f| fragments[f] * self.coverage[f])
                    .sum()
            })
            .collect()
    }
}
