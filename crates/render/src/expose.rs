//! Exposing: the rays of each pixel, and which of them share a fragment.
//!
//! A pixel gets a few rays, and as many more if they show one thing of several colours; where they meet several things, or what a pixel
//! beside it sees reaches into it, or a slender lamp passes, it gets far more. What covers a sliver of a pixel can be most of its light: under
//! lamps in a dark hall a fiftieth of a pixel was as bright as the whole image's mean.

use crate::exposure::Exposure;
use crate::fragments::{ENDS, FINER_ENDS, Met, PixelRays, SightRef};
use crate::pieces::{Origin, put_together};
use crate::slender::passed_by_slender;
use crate::watch::{Cancelled, Watch, go_on};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::Camera;
use relight_scene::material::{AlphaMode, Material};
use relight_scene::rays::Ray;
use relight_scene::traced::{Faces, TracedScene};
use relight_transport::sampling::r2;

/// Rays of a pixel that sees several things, is reached by what pixels around it see, or passed by a slender lamp, for each that others get. Twice as many lower the
/// error by a tenth (docs/notebook/cuts.md).
const FINER: u32 = 4;

/// Fewest rays by which a pixel may be left, and half of the usual ones: [`ENDS`] of them are kept.
const FEW: u32 = 8;

/// First ray of a pixel, in pixels. Of starts a twentieth of a pixel apart the one from which 4, 6 and 16 rays tell best how
/// much of a pixel lies to one side of a straight line: by 0.11, 0.085 and 0.037 (root mean square; 0.14, 0.16 and 0.075 from
/// a quarter).
const PATTERN_START: Vec2 = Vec2::new(0.6, 0.1);

/// Casts `samples` primary rays per pixel and groups them; half of them (but eight) where those show one thing of one colour, [`FINER`] times as many where a pixel sees
/// several things. Deterministic: the same sub-pixel pattern in every pixel.
pub fn expose(scene: &TracedScene, camera: &Camera, width: usize, height: usize, samples: u32) -> Exposure {
    // Nobody stops it.
    expose_watched(scene, camera, (width, height), samples, &()).unwrap_or_default()
}

/// [`expose`] of an image of a width and a height under the eyes of someone who may stop it.
///
/// # Errors
/// It was stopped.
pub fn expose_watched(
    scene: &TracedScene,
    camera: &Camera,
    (width, height): (usize, usize),
    samples: u32,
    watch: &dyn Watch,
) -> Result<Exposure, Cancelled> {
    if samples <= 1 {
        return expose_centres(scene, camera, (width, height), watch);
    }
    let exposing = Exposing {
        scene,
        camera,
        width,
        height,
        pattern: (0..samples * FINER).map(|i| r2(i, PATTERN_START)).collect(),
        few: few_of(scene, samples) as usize,
        samples: samples as usize,
        footprint: 2.0 * camera.tan_half_vfov / height as f32,
        slender: passed_by_slender(scene, camera, width, height),
    };
    let mut pieces = rows(height, watch, |y| exposing.first_row(y))?;
    let finer = rows(height, watch, |y| exposing.finer_pixels(&pieces, y))?;
    let mut pixels = Vec::with_capacity(width * height);
    for (y, (finer, _)) in finer.iter().enumerate() {
        let of = |piece: usize, index: usize| Origin {
            piece: piece as u32,
            index: index as u32,
        };
        let start = pixels.len();
        pixels.extend((0..width).map(|x| of(y, x)));
        for (index, x) in finer.iter().enumerate() {
            pixels[start + x] = of(height + y, index);
        }
    }
    pieces.extend(finer.into_iter().map(|(_, pixels)| pixels));
    let like = Exposure {
        eye: camera.position,
        forward: camera.forward,
        ..exposing.empty(height)
    };
    Ok(put_together(like, &pieces, &pixels))
}

/// How many of its rays decide whether a pixel takes the others. All where some surfaces stop a part of the rays: a thin veil that few rays tell of would be
/// shown too thin.
fn few_of(scene: &TracedScene, samples: u32) -> u32 {
    let is_veil =
        |material: &Material| !matches!(material.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask { .. });
    match scene.materials().iter().any(is_veil) {
        true => samples,
        false => (samples / 2).max(FEW).min(samples),
    }
}

/// Makes something of each row, side by side.
fn rows<T: Send>(
    height: usize,
    watch: &dyn Watch,
    make: impl Fn(usize) -> T + Sync,
) -> Result<Vec<T>, Cancelled> {
    let each = (0..height).into_par_iter().map(|y| {
        go_on(watch)?;
        Ok(make(y))
    });
    each.collect()
}

/// Rays of pixels side by side that are cast together.
const TOGETHER: usize = 128;

/// Pixels along each side of a tile whose rays make a packet.
const TILE: usize = 4;

/// Rays of some pixels, and those of one; to be used again.
struct Buffers<'a> {
    rays: Vec<Ray>,
    pixel: PixelRays<'a>,
}

/// What pixels are exposed with.
struct Exposing<'a> {
    scene: &'a TracedScene,
    camera: &'a Camera,
    width: usize,
    height: usize,
    /// Places within a pixel, in pixels: any number of first ones is evenly spread.
    pattern: Vec<Vec2>,
    /// As many of those are looked at first, and as many where they show a thing of several colours.
    few: usize,
    samples: usize,
    /// Size of a pixel at distance 1.
    footprint: f32,
    /// Pixels that may show lamps narrower than they are; empty if none does.
    slender: Vec<bool>,
}

impl Exposing<'_> {
    /// A row of pixels as their first rays see it.
    fn first_row(&self, y: usize) -> Exposure {
        let mut row = self.empty(1);
        let (mut buffers, at_once) = (self.buffers(), TOGETHER.div_ceil(self.few));
        let mut further = Vec::new();
        for first in (0..self.width).step_by(at_once) {
            let pixels = first..(first + at_once).min(self.width);
            let Buffers { rays, pixel } = &mut buffers;
            rays.clear();
            for x in pixels {
                self.push_rays((x, y), self.pattern[..self.few].iter().copied(), rays);
            }
            Met::by_each(self.scene, rays, |i, met| {
                pixel.push(rays[i], met);
                if pixel.len() < self.few {
                    return;
                }
                if pixel.is_one_uneven() {
                    further.clear();
                    let x = first + i / self.few;
                    self.push_rays(
                        (x, y),
                        self.pattern[self.few..self.samples].iter().copied(),
                        &mut further,
                    );
                    Met::by_each(self.scene, &further, |i, met| pixel.push(further[i], met));
                }
                pixel.append_to(&mut row, ENDS);
            });
        }
        row.offsets.push(row.coverage.len() as u32);
        row
    }

    /// Those pixels of a row that need more rays than the first ones, and what they show then.
    fn finer_pixels(&self, first: &[Exposure], y: usize) -> (Vec<usize>, Exposure) {
        let (mut pixels, mut buffers) = (self.empty(1), self.buffers());
        let finer = (0..self.width).filter(|&x| {
            let slender = self.slender.get(y * self.width + x) == Some(&true);
            let several = first[y].fragments_of(x).len() > 1;
            let is_finer = slender || several || self.is_reached(first, (x, y), &mut buffers.rays);
            if is_finer {
                let Buffers { rays, pixel } = &mut buffers;
                rays.clear();
                self.push_rays((x, y), self.pattern.iter().copied(), rays);
                Met::by_each(self.scene, rays, |i, met| pixel.push(rays[i], met));
                pixel.append_to(&mut pixels, FINER_ENDS);
            }
            is_finer
        });
        let finer = finer.collect();
        pixels.offsets.push(pixels.coverage.len() as u32);
        (finer, pixels)
    }

    fn buffers(&self) -> Buffers<'_> {
        Buffers {
            rays: Vec::new(),
            pixel: PixelRays::new(self.scene, self.footprint),
        }
    }

    /// An exposure as wide, to which pixels are appended.
    fn empty(&self, height: usize) -> Exposure {
        Exposure {
            width: self.width,
            height,
            end_offsets: vec![0],
            ..Exposure::default()
        }
    }

    /// Whether something that pixels around show reaches into one of a single fragment: as many more rays as there were, through the places nearest to them, tell
    /// what all find (docs/notebook/cuts.md).
    fn is_reached(&self, rows: &[Exposure], (x, y): (usize, usize), rays: &mut Vec<Ray>) -> bool {
        let own = SightRef::of(&rows[y], rows[y].fragments_of(x).start);
        let others = self.others_around(&own, rows, (x, y));
        if others.is_empty() {
            return false;
        }
        let near = |place: Vec2| {
            let towards = others
                .iter()
                .map(|other| (place - 0.5).dot(*other) / other.length_squared());
            towards.fold(f32::NEG_INFINITY, f32::max)
        };
        let mut places: Vec<(f32, Vec2)> = (self.pattern[self.few..].iter())
            .map(|&place| (near(place), place))
            .collect();
        if places.len() > self.samples {
            places.select_nth_unstable_by(self.samples, |a, b| b.0.total_cmp(&a.0));
            places.truncate(self.samples);
        }
        rays.clear();
        self.push_rays((x, y), places.iter().map(|place| place.1), rays);
        let (mut reached, mut faces) = (false, Faces::new(self.scene));
        Met::by_each(self.scene, rays, |i, met| {
            reached = reached
                || !(met.is_on(own.triangle())
                    || own.is_like(
                        &met.sight(self.scene, &mut faces, &rays[i]).as_ref(),
                        self.footprint,
                    ));
        });
        reached
    }

    /// Offsets of the pixels around one that show something else than its `own` fragment.
    fn others_around(&self, own: &SightRef<'_>, rows: &[Exposure], (x, y): (usize, usize)) -> Vec<Vec2> {
        let beside = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        let around = beside(y, rows.len()).flat_map(|v| beside(x, self.width).map(move |u| (u, v)));
        let is_other = |&(u, v): &(usize, usize)| {
            let mut fragments = rows[v].fragments_of(u);
            fragments.any(|f| !own.is_like(&SightRef::of(&rows[v], f), self.footprint))
        };
        (around.filter(is_other))
            .map(|(u, v)| Vec2::new(u as f32 - x as f32, v as f32 - y as f32))
            .collect()
    }

    /// Appends rays through places of a pixel.
    fn push_rays(&self, (x, y): (usize, usize), places: impl Iterator<Item = Vec2>, rays: &mut Vec<Ray>) {
        let size = Vec2::new(self.width as f32, self.height as f32);
        let corner = Vec2::new(x as f32, y as f32);
        let toward = |place: Vec2| self.camera.direction(corner + place, size);
        rays.extend(places.map(|place| Ray::endless(self.camera.position, toward(place))));
    }
}

/// [`expose`] by one ray through each pixel's centre: every pixel is one fragment.
fn expose_centres(
    scene: &TracedScene,
    camera: &Camera,
    (width, height): (usize, usize),
    watch: &dyn Watch,
) -> Result<Exposure, Cancelled> {
    let size = Vec2::new(width as f32, height as f32);
    let count = width * height;
    let mut whole = Exposure {
        width,
        height,
        offsets: (0..=count as u32).collect(),
        coverage: vec![1.0; count],
        eye: camera.position,
        forward: camera.forward,
        ..Exposure::default()
    };
    (0..count)
        .into_par_iter()
        .with_min_len(256)
        .map(|pixel| {
            let corner = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
            camera.direction(corner + 0.5, size)
        })
        .collect_into_vec(&mut whole.directions);
    see_from(scene, width, &mut whole, watch);
    go_on(watch)?;
    Ok(whole)
}

/// What is seen from a place along some unit directions: a row of pixels of one fragment each. It has no view direction.
pub fn expose_around(scene: &TracedScene, eye: Vec3, directions: &[Vec3]) -> Exposure {
    let mut around = Exposure {
        width: directions.len(),
        height: 1,
        offsets: (0..=directions.len() as u32).collect(),
        coverage: vec![1.0; directions.len()],
        directions: directions.to_vec(),
        eye,
        ..Exposure::default()
    };
    see_from(scene, directions.len(), &mut around, &());
    around
}

/// Fills in what rays from the eye along the directions, one per fragment, show; through pixels' centres row by row, cast in tiles. From where on `watch` stops it
/// nothing is seen.
fn see_from(scene: &TracedScene, width: usize, whole: &mut Exposure, watch: &dyn Watch) {
    if scene.bends() {
        whole.through = whole.directions.clone();
    }
    let (eye, fragments) = (whole.eye, whole.directions.len());
    whole.hits = vec![None; fragments];
    whole.points = vec![None; fragments];
    let band = TILE * width.max(1);
    (whole.directions.par_chunks_mut(band))
        .zip(whole.hits.par_chunks_mut(band))
        .zip(whole.points.par_chunks_mut(band))
        .for_each(|((directions, hits), points)| {
            if watch.stopped() {
                return;
            }
            let tiles = (0..width).step_by(TILE).flat_map(|x| {
                let columns = x..(x + TILE).min(width);
                let rows = (0..directions.len()).step_by(width);
                rows.flat_map(move |row| columns.clone().map(move |x| row + x))
            });
            let order: Vec<usize> = tiles.collect();
            let rays: Vec<Ray> = (order.iter())
                .map(|&pixel| Ray::endless(eye, directions[pixel]))
                .collect();
            let mut faces = Faces::new(scene);
            Met::by_each(scene, &rays, |i, met| {
                let sight = met.sight(scene, &mut faces, &rays[i]);
                directions[order[i]] = sight.direction;
                (hits[order[i]], points[order[i]]) = sight.seen.unzip();
            });
        });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{camera, level, matt, traced, traced_with};
    use relight_scene::traced::Shading;

    const SIZE: usize = 64;

    /// What each pixel shows of a square before nothing, and the part of it that the square covers.
    fn shown_and_covered() -> Vec<(f32, f32)> {
        let scene = traced(vec![level(1.0, 0.0, 0)], vec![matt(0.5, 0.0)]);
        // Turned a little so that no edge follows the pixels.
        let eye = camera(Vec3::new(1.5, 3.0, 0.6), Vec3::new(0.1, 0.0, 0.05), 50.0);
        let seen = expose(&scene, &eye, SIZE, SIZE, 16);
        let parts = 64;
        (0..SIZE * SIZE)
            .map(|pixel| {
                let on_square = |k: &usize| {
                    let inside = |i: usize| (i as f32 + 0.5) / parts as f32;
                    let (x, y) = ((pixel % SIZE) as f32, (pixel / SIZE) as f32);
                    let place = Vec2::new(x + inside(k % parts), y + inside(k / parts));
                    let toward = eye.direction(place, Vec2::splat(SIZE as f32));
                    let at = eye.position - toward * (eye.position.y / toward.y);
                    at.x.abs() <= 1.0 && at.z.abs() <= 1.0
                };
                let covered = (0..parts * parts).filter(on_square).count();
                let shown = seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some());
                (
                    shown.map(|f| seen.coverage[f]).sum(),
                    covered as f32 / (parts * parts) as f32,
                )
            })
            .collect()
    }

    /// Truth: the square's outline. 16 places tell how much lies to one side of a line by 0.037 (root mean square, see
    /// [`PATTERN_START`]); four times as many at least halve that.
    #[test]
    fn a_pixel_on_a_silhouette_shows_as_much_as_is_covered() {
        let errors: Vec<f32> = (shown_and_covered().into_iter())
            .filter(|(_, covered)| (0.001..0.999).contains(covered))
            .map(|(shown, covered)| shown - covered)
            .collect();
        let squares: f32 = errors.iter().map(|e| e * e).sum();
        let error = (squares / errors.len() as f32).sqrt();
        assert!(
            errors.len() > SIZE && error < 0.019,
            "{error} of {}",
            errors.len()
        );
    }

    /// Slivers of a fortieth to a sixteenth of a pixel: 16 rays miss most of them, but the pixels beside see more.
    #[test]
    fn slivers_are_found_beside_what_they_are_a_part_of() {
        let slivers = shown_and_covered()
            .into_iter()
            .filter(|(_, covered)| (0.025..0.0625).contains(covered));
        let found: Vec<bool> = slivers.map(|(shown, _)| shown > 0.0).collect();
        let missed = found.iter().filter(|found| !**found).count();
        assert!(found.len() >= 3 && missed == 0, "{missed} of {}", found.len());
    }

    /// Truth: its alpha. Of 576 pixels in which 32 rays look for it and 64 tell its share: 0.05 ± 0.0012, of which a tenth is lost where none of the 32 meets it.
    #[test]
    fn a_thin_veil_covers_what_its_alpha_says() {
        let veil = Material {
            alpha_mode: AlphaMode::Blend,
            base_color: Vec3::ONE.extend(0.05),
            ..matt(1.0, 0.0)
        };
        let scene = traced(
            vec![level(3.0, 0.0, 0), level(3.0, 0.5, 1)],
            vec![matt(0.5, 0.0), veil],
        );
        let size = 24;
        let eye = Camera::looking(Vec3::Y * 2.0, Vec3::NEG_Y, Vec3::NEG_Z, 0.9);
        let seen = expose(&scene, &eye, size, size, 16);
        let of_veil = (0..seen.len()).filter(|&f| seen.points[f].is_some_and(|point| point.material == 1));
        let shown = of_veil.map(|f| seen.coverage[f]).sum::<f32>() / (size * size) as f32;
        assert!((0.042..0.054).contains(&shown), "{shown}");
    }

    /// Truth: colours that grow evenly from black to white, whose mean over a pixel is that in its middle. Dark pixels, whose colour changes by much of itself, take more
    /// rays; others err by a hundredth at most, half of what their few rays may.
    #[test]
    fn a_pixels_colour_is_the_mean_over_it() {
        let mut floor = level(1.0, 0.0, 0);
        floor.colors = (floor.positions.iter())
            .map(|p| Vec3::splat(0.5 + 0.5 * p.x).extend(1.0))
            .collect();
        let material = Material {
            metallic: 0.3,
            ..matt(1.0, 0.0)
        };
        let scene = traced_with(vec![floor], vec![material], Shading::Full);
        let size = 24;
        let half = 0.95;
        let eye = Camera::looking(Vec3::Y, Vec3::NEG_Y, Vec3::NEG_Z, half);
        let seen = expose(&scene, &eye, size, size, 16);
        for pixel in 0..size * size {
            let [f] = seen.fragments_of(pixel).collect::<Vec<_>>()[..] else {
                panic!("pixel {pixel} sees several things");
            };
            let point = seen.points[f].unwrap();
            let across = ((pixel % size) as f32 + 0.5) / size as f32;
            let truth = 0.5 + half * (across - 0.5);
            let error = (point.base_color.x / truth - 1.0).abs();
            assert!(error < if truth < 0.2 { 0.03 } else { 0.01 }, "{pixel}: {error}");
            assert!((point.diffuse.x - 0.7 * point.base_color.x).abs() < 1e-5);
            assert!((point.f0.x - 0.028 - 0.3 * point.base_color.x).abs() < 1e-5);
        }
    }
}
