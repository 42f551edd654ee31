//! What a camera sees, found once for as long as it stands still: the fragments of each pixel.
//!
//! A pixel is sampled by several primary rays. Rays that meet the same material, facing the same way, at
//! neighbouring places make one fragment: it is lit once, at the place nearest its middle, with the mean of
//! its rays' reflectances and normals, and a lobe as much wider as the normal map spreads them. Nearly all pixels have one fragment, so that antialiased silhouettes and filtered
//! textures cost a frame little more than one sample per pixel.

use crate::cuts::SitePlaces;
use crate::cuts::sites::FragmentSites;
use crate::reconstruct;
use crate::reflections::{self, Reflections, Start};
use crate::transfer::Transfer;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces};
use relight_scene::traced::TracedScene;
use relight_transport::basis::Level;
use relight_transport::sampling::r2;
use relight_transport::sparse::Rows;
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
    /// Functions of the finest points at each fragment; empty if none were asked for.
    pub weights: Rows,
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

/// Ray ends that are kept of a pixel, shared among its fragments by coverage: the error of a straight edge of a shadow
/// falls with the power 3/4 of their number, to a quarter.
pub(crate) const ENDS: f32 = 6.0;
const FINER_ENDS: f32 = 16.0;

/// Cosine between the smooth normals of two rays above which they may share a fragment: 8°. A lamp that grazes a fold lights
/// one side of it only: 18° left Sponza's mouldings 2.7 % too dark instead of 1.7 %, for a tenth fewer fragments (docs/cuts.md).
const SAME_FACING: f32 = 0.99;

/// How far, in pixel footprints, the second ray's surface may lie off the first one's tangent plane.
const SAME_PLANE: f32 = 2.0;

/// First ray of a pixel, in pixels. Of starts a twentieth of a pixel apart the one from which 4, 6 and 16 rays tell best how
/// much of a pixel lies to one side of a straight line: by 0.11, 0.085 and 0.037 (root mean square; 0.14, 0.16 and 0.075 from
/// a quarter).
const PATTERN_START: Vec2 = Vec2::new(0.6, 0.1);

/// Rays of a pixel that sees several things, for each of those that told so. 
const FINER: u32 = 4;

struct Sample {
    direction: Vec3,
    seen: Seen,
    group: usize,
}

/// What a ray meets and how that reflects; `None` for the background.
type Seen = Option<(SurfaceHit, ShadingPoint)>;

/// Casts `samples` primary rays per pixel and groups them; [`FINER`] times as many where a pixel, or one beside it, sees several
/// things. Deterministic: the same sub-pixel pattern in every pixel.
pub fn expose(scene: &TracedScene, camera: &Camera, width: usize, height: usize, samples: u32) -> Shot {
    if samples <= 1 {
        return expose_centres(scene, camera, width, height);
    }
    let exposure = Exposure {
        scene,
        camera,
        size: Vec2::new(width as f32, height as f32),
        pattern: (0..samples * FINER).map(|i| r2(i, PATTERN_START)).collect(),
        footprint: 2.0 * camera.tan_half_vfov / height as f32,
    };
    let coarse = exposure.of_pixels(width, height, (samples, ENDS), |_, _| true);
    let finer: Vec<bool> = (0..width * height)
        .into_par_iter()
        .with_min_len(1024)
        .map(|pixel| exposure.sees_several(&coarse, pixel))
        .collect();
    let fine = exposure.of_pixels(width, height, (samples * FINER, FINER_ENDS), |x, y| finer[y * width + x]);
    let mut shot = Shot {
        width,
        height,
        eye: camera.position,
        end_offsets: vec![0],
        ..Shot::default()
    };
    for (pixel, &finer) in finer.iter().enumerate() {
        shot.push_pixel(if finer { &fine } else { &coarse }, pixel);
    }
    shot.offsets.push(shot.coverage.len() as u32);
    shot
}

/// What pixels are exposed with.
struct Exposure<'a> {
    scene: &'a TracedScene,
    camera: &'a Camera,
    /// Pixels across and down.
    size: Vec2,
    /// Places within a pixel, in pixels; any number of first ones is evenly spread.
    pattern: Vec<Vec2>,
    /// Size of a pixel at distance 1.
    footprint: f32,
}

impl Exposure<'_> {
    /// Fragments of the pixels (x, y) that are `wanted`, by this many rays each. Others have none.
    fn of_pixels(
        &self,
        width: usize,
        height: usize,
        (samples, ends): (u32, f32),
        wanted: impl Fn(usize, usize) -> bool + Sync,
    ) -> Shot {
        let rows: Vec<Shot> = (0..height)
            .into_par_iter()
            .map(|y| {
                let mut row = Shot {
                    end_offsets: vec![0],
                    ..Shot::default()
                };
                let mut pixel: Vec<Sample> = Vec::new();
                for x in 0..width {
                    row.offsets.push(row.coverage.len() as u32);
                    if wanted(x, y) {
                        let corner = Vec2::new(x as f32, y as f32);
                        pixel.clear();
                        pixel.extend(self.pattern[..samples as usize].iter().map(|&offset| {
                            let direction = self.camera.direction(corner + offset, self.size);
                            Sample {
                                direction,
                                seen: seen_along(self.scene, self.camera, direction),
                                group: 0,
                            }
                        }));
                        group(&mut pixel, self.footprint);
                        append_fragments(&pixel, ends, &mut row);
                    }
                }
                row.offsets.push(row.coverage.len() as u32);
                row
            })
            .collect();
        let mut all = Shot {
            width,
            height,
            end_offsets: vec![0],
            ..Shot::default()
        };
        for row in &rows {
            for x in 0..width {
                all.push_pixel(row, x);
            }
        }
        all.offsets.push(all.coverage.len() as u32);
        all
    }

    /// Whether a pixel, or it together with one of those around it, has fragments of several things.
    fn sees_several(&self, shot: &Shot, pixel: usize) -> bool {
        let (x, y) = (pixel % shot.width, pixel / shot.width);
        let own = shot.offsets[pixel] as usize;
        if shot.fragments_of(pixel).len() > 1 {
            return true;
        }
        let beside = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        beside(y, shot.height).any(|y| {
            beside(x, shot.width).any(|x| {
                shot.fragments_of(y * shot.width + x).any(|f| {
                    let [a, b] = [own, f].map(|f| shot.hits[f].zip(shot.points[f]));
                    !are_alike(&a, &b, self.footprint)
                })
            })
        })
    }
}

/// [`expose`] by one ray through each pixel's centre: every pixel is one fragment.
fn expose_centres(scene: &TracedScene, camera: &Camera, width: usize, height: usize) -> Shot {
    let size = Vec2::new(width as f32, height as f32);
    let count = width * height;
    let mut shot = Shot {
        width,
        height,
        offsets: (0..=count as u32).collect(),
        coverage: vec![1.0; count],
        eye: camera.position,
        ..Shot::default()
    };
    (0..count)
        .into_par_iter()
        .with_min_len(256)
        .map(|pixel| {
            let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
            camera.direction(corner + 0.5, size)
        })
        .collect_into_vec(&mut shot.directions);
    (shot.directions.par_iter())
        .with_min_len(256)
        .map(|&direction| seen_along(scene, camera, direction).unzip())
        .unzip_into_vecs(&mut shot.hits, &mut shot.points);
    shot
}

/// What a camera's ray meets.
fn seen_along(scene: &TracedScene, camera: &Camera, direction: Vec3) -> Seen {
    let ray = Ray {
        origin: camera.position,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    scene.closest_hit(&ray).map(|hit| {
        let point = scene.shading_point(&hit).facing(-direction);
        (hit, point)
    })
}

/// Each ray joins the first group whose first ray it is like. Returns the number of groups.
fn group(pixel: &mut [Sample], footprint: f32) -> usize {
    // Indices of the groups' first rays.
    let mut firsts: Vec<usize> = Vec::new();
    for i in 0..pixel.len() {
        let like = |&first: &usize| are_alike(&pixel[first].seen, &pixel[i].seen, footprint);
        pixel[i].group = firsts.iter().position(like).unwrap_or_else(|| {
            firsts.push(i);
            firsts.len() - 1
        });
    }
    firsts.len()
}

/// Whether two rays may share a fragment.
fn are_alike(a: &Seen, b: &Seen, footprint: f32) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some((a, p)), Some((b, q))) => {
            let off_plane = (b.position - a.position).dot(a.geometric_normal).abs();
            p.material == q.material
                && a.normal.dot(b.normal) > SAME_FACING
                && (p.lambert || p.shading_normal.dot(q.shading_normal) > SAME_FACING)
                && off_plane < SAME_PLANE * footprint * a.t.max(b.t)
                && (p.emission == Vec3::ZERO) == (q.emission == Vec3::ZERO)
        }
        _ => false,
    }
}

fn append_fragments(pixel: &[Sample], ends: f32, row: &mut Shot) {
    let groups = pixel.iter().map(|s| s.group).max().map_or(0, |g| g + 1);
    for g in 0..groups {
        let members: Vec<&Sample> = pixel.iter().filter(|s| s.group == g).collect();
        let count = members.len() as f32;
        let coverage = count / pixel.len() as f32;
        row.coverage.push(coverage);
        // Any number of first rays of the pattern is evenly spread.
        let kept = (members.iter().filter_map(|m| m.seen.as_ref())).map(|(hit, _)| RayEnd {
            primitive: hit.primitive,
            barycentric: hit.barycentric,
            front: hit.front,
        });
        row.ends.extend(kept.take((ends * coverage).ceil() as usize));
        row.end_offsets.push(row.ends.len() as u32);
        let middle = members.iter().map(|s| s.direction).sum::<Vec3>() / count;
        let distance = |s: &&&Sample| (s.direction - middle).length_squared();
        let Some(nearest) = members.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
            continue;
        };
        row.directions.push(nearest.direction);
        row.hits.push(nearest.seen.as_ref().map(|s| s.0));
        row.points.push(nearest.seen.as_ref().map(|s| {
            let mean = |value: fn(&ShadingPoint) -> Vec3| {
                members
                    .iter()
                    .filter_map(|m| m.seen.as_ref())
                    .map(|m| value(&m.1))
                    .sum::<Vec3>()
                    / count
            };
            let normal = mean(|p| p.shading_normal);
            let point = ShadingPoint {
                geometric_normal: mean(|p| p.geometric_normal).try_normalize().unwrap_or(s.1.geometric_normal),
                base_color: mean(|p| p.base_color),
                diffuse: mean(|p| p.diffuse),
                f0: mean(|p| p.f0),
                emission: mean(|p| p.emission),
                shading_normal: normal.try_normalize().unwrap_or(s.1.shading_normal),
                ..s.1
            };
            // Only what the normal map adds: over a smooth curve normals change evenly, and a lobe of their spread
            // would have tails that reach farther than any of them.
            let smooth = mean(|p| p.normal).length();
            bsdf::spread_by_normals(&point, 1.0 - (smooth - normal.length()).max(0.0))
        }));
    }
}

impl Shot {
    /// Appends a pixel of another shot.
    fn push_pixel(&mut self, of: &Shot, pixel: usize) {
        self.offsets.push(self.coverage.len() as u32);
        let fragments = of.fragments_of(pixel);
        for f in fragments.clone() {
            self.ends.extend_from_slice(&of.ends[of.range_of_ends(f)]);
            self.end_offsets.push(self.ends.len() as u32);
        }
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
        self.weights = reconstruct::weights_at(finest, &places, &transfer.near_parted, |place, point| {
            transfer.is_parted(scene, place, point)
        });
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
        self.components = reconstruct::components(&self.weights, finest, &normals);
    }

    /// Chooses the sites of every fragment; where those are points, after [`Shot::weigh`].
    pub fn choose_sites(&mut self, places: &SitePlaces) {
        self.sites = match places {
            SitePlaces::Points => FragmentSites::new(&self.weights),
            SitePlaces::Vertices(corners) => FragmentSites::at_corners(&self.hits, corners),
        };
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

    /// Where rays of a fragment's lobe start: at its rays' ends, or, where none are kept, at the place where it is lit. Colours
    /// are the fragment's, as a mean of more rays; normals and roughness are those of each end, whose mean would
    /// reflect far less sharply.
    fn starts_of(&self, scene: &TracedScene, f: usize) -> Vec<Start> {
        let (Some(lit), Some(point)) = (self.hits[f], self.points[f]) else {
            return Vec::new();
        };
        if !self.has_ends(f) {
            return vec![(lit, point, -self.directions[f])];
        }
        let start = |hit: SurfaceHit| {
            let wo = (self.eye - hit.position).normalize_or_zero();
            let point = ShadingPoint {
                base_color: point.base_color,
                diffuse: point.diffuse,
                f0: point.f0,
                ..scene.shading_point(&hit).facing(wo)
            };
            (hit, point, wo)
        };
        self.ends_of(scene, f).map(start).collect()
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
        (0..self.len().min(self.weights.rows()))
            .filter(|&f| self.hits[f].is_some() && self.weights.row(f).is_empty())
            .count()
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
