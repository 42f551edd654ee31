//! What a camera sees: the fragments of each pixel.
//!
//! A pixel is sampled by several primary rays. Rays that meet the same material, facing the same way, at
//! neighbouring places make one fragment: it is lit once, at the place nearest its middle, with the mean of
//! its rays' reflectances and normals, and a lobe as much wider as the normal map spreads them. Nearly all pixels have
//! one fragment, so that antialiased silhouettes and filtered textures cost a frame little more than one sample per pixel.
//!
//! [`crate::expose`] makes it.

use glam::Vec3;
use rayon::prelude::*;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use std::ops::Range;

/// Fragments of all pixels, in order of pixels; a pixel's first fragment is where its row starts. By default of no pixel.
#[derive(Clone, Debug, Default)]
pub struct Exposure {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// Start of each pixel's fragments, and the end of the last.
    pub offsets: Vec<u32>,
    /// Share of the pixel that each fragment covers; a pixel's shares sum to 1.
    pub coverage: Vec<f32>,
    /// Where each fragment is lit, `t` the length of the way from the camera; `None` for the background.
    pub hits: Vec<Option<SurfaceHit>>,
    /// How it reflects.
    pub points: Vec<Option<ShadingPoint>>,
    /// Unit direction in which it is looked at: from the camera, but where solid glass bends the way.
    pub directions: Vec<Vec3>,
    /// Unit direction from the camera, where that may be another one; empty if nothing bends.
    pub through: Vec<Vec3>,
    /// Whether nobody looks from `eye`: every place is looked at along its own normal, and shows no light of its own.
    pub apart: bool,
    /// Camera position.
    pub eye: Vec3,
    /// The camera's unit view direction.
    pub forward: Vec3,
    /// Where some of each fragment's rays end, fragment by fragment; [`Exposure::ends_of`].
    pub(crate) ends: Vec<RayEnd>,
    /// Start of each fragment's ends, and the end of the last; empty where pixels have one ray.
    pub(crate) end_offsets: Vec<u32>,
}

/// Where a ray from the eye ends: a place on a triangle, seen from its front or back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RayEnd {
    pub primitive: u32,
    pub barycentric: [f32; 2],
    pub front: bool,
}

/// A place on a surface as it is seen.
#[derive(Clone, Copy, Debug)]
pub struct Sighted {
    /// Where it is.
    pub hit: SurfaceHit,
    /// How it reflects.
    pub point: ShadingPoint,
    /// Unit direction to whoever sees it.
    pub view: Vec3,
}

/// An image in square blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Pixels along a side of each.
    pub side: usize,
    /// Blocks in a row.
    pub across: usize,
    /// Where they are seen from.
    pub eye: Vec3,
    /// Of each block, row by row: its fragments, and the column and row of the pixel that each is of.
    pub fragments: Vec<Vec<(u32, [u32; 2])>>,
}

impl Exposure {
    /// Unit direction from the camera to where fragment `f` shows in the image.
    pub fn through(&self, f: usize) -> Vec3 {
        *self.through.get(f).unwrap_or(&self.directions[f])
    }

    /// Whether solid glass bends or mirrors the way to fragment `f`.
    pub fn is_bent(&self, f: usize) -> bool {
        self.through(f) != self.directions[f]
    }

    /// Fragments of a pixel.
    pub fn fragments_of(&self, pixel: usize) -> Range<usize> {
        self.offsets[pixel] as usize..self.offsets[pixel + 1] as usize
    }

    /// Fragments of each block of `side` by `side` pixels, row by row, and the pixels that they are of.
    pub fn blocks(&self, side: usize) -> Blocks {
        let [across, down] = [self.width, self.height].map(|pixels| pixels.div_ceil(side));
        let pixels = |block: usize| {
            let (x, y) = (block % across * side, block / across * side);
            let columns = x..(x + side).min(self.width);
            (y..(y + side).min(self.height)).flat_map(move |y| columns.clone().map(move |x| (x, y)))
        };
        let of_pixel = |(x, y): (usize, usize)| {
            let fragments = self.fragments_of(y * self.width + x);
            fragments.map(move |f| (f as u32, [x as u32, y as u32]))
        };
        Blocks {
            side,
            across,
            eye: self.eye,
            fragments: (0..across * down)
                .into_par_iter()
                .map(|block| pixels(block).flat_map(of_pixel).collect())
                .collect(),
        }
    }

    /// Unit directions from the fragments to the eye.
    pub fn views(&self) -> Vec<Vec3> {
        (self.directions.par_iter().with_min_len(4096))
            .map(|d| -*d)
            .collect()
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

    /// The places of a fragment ([`Exposure::places_of`]) and how they reflect.
    pub fn sighted(&self, scene: &TracedScene, f: usize) -> Vec<Sighted> {
        self.sighted_first(scene, f, usize::MAX)
    }

    /// The first so many of [`Exposure::sighted`].
    pub(crate) fn sighted_first(&self, scene: &TracedScene, f: usize, most: usize) -> Vec<Sighted> {
        let (Some(hit), Some(point)) = (self.hits[f], self.points[f]) else {
            return Vec::new();
        };
        if !self.has_ends(f) {
            return vec![Sighted {
                hit,
                point,
                view: -self.directions[f],
            }];
        }
        self.sighted_ends(scene, f).take(most).collect()
    }

    /// The ends of a fragment's rays, how they reflect and the directions from them to the eye. Colours are the fragment's, as a
    /// mean of more rays; normals and roughness are those of each end, whose mean would reflect far less sharply.
    pub fn sighted_ends(&self, scene: &TracedScene, f: usize) -> impl Iterator<Item = Sighted> {
        let point = self.points[f];
        self.ends_of(scene, f).filter_map(move |hit| {
            let point = point?;
            let view = match self.apart {
                true => hit.normal,
                false if self.is_bent(f) => -self.directions[f],
                false => (self.eye - hit.position).normalize_or_zero(),
            };
            let own = if point.lambert {
                ShadingPoint::lambert(&hit, point.diffuse)
            } else {
                scene.shading_point_of(&hit, Some(point.base_color))
            };
            let point = ShadingPoint {
                diffuse: point.diffuse,
                f0: point.f0,
                ..own.facing(view)
            };
            Some(Sighted { hit, point, view })
        })
    }

    /// How many of its ends stand for fragment `f` where its pixel has about `of_pixel` of them, or as many as there are.
    pub(crate) fn ends_for(&self, f: usize, of_pixel: f32) -> usize {
        let wanted = (of_pixel * self.coverage[f]).ceil() as usize;
        wanted.min(self.range_of_ends(f).len())
    }

    /// Whether [`Exposure::ends_of`] has any.
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

    /// Whether there are no fragments (an image of no pixels).
    pub fn is_empty(&self) -> bool {
        self.coverage.is_empty()
    }

    /// Adds the pixels of another exposure below; it must be as wide. For light that leaves alike in all directions, which
    /// needs no eye: the first one's stays. Ray ends are forgotten.
    pub fn append(&mut self, below: Exposure) {
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
        self.through.extend(below.through);
        (self.ends, self.end_offsets) = (Vec::new(), Vec::new());
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
