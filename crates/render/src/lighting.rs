//! Direct light at many places at once, light by light: points of the basis and fragments of a shot.
//!
//! Lobes that are narrower than an emissive surface find it by rays drawn by the reflection, which join in, weighted by
//! the balance heuristic (Veach 1997, 9.2.2).

use crate::direct::{light_met, shadow_ray};
use crate::exposure::Exposure;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::light_set::{LightSample, LightSet};
use relight_scene::rays::Ray;
use relight_scene::shading::{Gloss, ShadingPoint};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::random::Stream;
use relight_transport::sampling::r2;
use std::sync::Arc;

/// Stage numbers of the random streams.
const STAGE_POINTS: u32 = 0x10;
const STAGE_PIXELS: u32 = 0x11;
/// Added to a stage: its rays drawn by the reflection.
const STAGE_REFLECTED: u32 = 0x02;

/// Places per parallel task and per packet of shadow rays.
const PACKET: usize = 256;

/// Samples of an emissive light for each ray drawn by the reflection.
const PER_REFLECTED: u32 = 4;

/// Width α of the lobes above which samples of the light alone do: a cosine's is about 1.
const WIDE: f32 = 0.5;

/// How places reflect: two densities per steradian of the same distribution.
struct Reflection<D, P> {
    /// Whether any place draws directions.
    any: bool,
    /// Direction and its density, from a place and three random numbers in [0, 1); `None`: no light is reflected, or
    /// the place draws none.
    draw: D,
    /// Density with which `draw` gives a place this direction.
    density: P,
}

/// The `index`-th random triple of a place: evenly spread over a place's samples, shifted from place to place.
fn random_triple(stage: u32, seed: u64, place: usize, light: usize, index: u32) -> [f32; 3] {
    let mut stream = random_stream(stage, seed, place, light);
    let start = Vec2::new(stream.uniform(), stream.uniform());
    let point = r2(index, start);
    // The third number picks a triangle or the sun: the golden ratio's own sequence.
    let third = (f64::from(stream.uniform()) + f64::from(index) * 0.618_033_988_749_894_8).fract();
    [point.x, point.y, third as f32]
}

fn random_stream(stage: u32, seed: u64, place: usize, light: usize) -> Stream {
    Stream::new(seed, stage ^ ((light as u32) << 8), place as u64)
}

/// Samples that are drawn beforehand of a light that comes from all around. A map's bright part of some hundred
/// pixels has each of them some dozens of times.
const DRAWN: usize = 1 << 14;

/// Samples of one light for many places.
#[derive(Clone)]
pub struct Samples<'a> {
    lights: &'a LightSet<'a>,
    light: usize,
    /// Samples of each place: one for lights without extent.
    pub count: u32,
    stage: u32,
    seed: u64,
    /// What is drawn once for all places: each takes a run of its own of the sequence, which is evenly spread like all runs
    /// of it. Drawing from a map costs more than a shadow ray.
    drawn: Arc<[Option<LightSample>]>,
}

impl<'a> Samples<'a> {
    /// Prepares `samples` of them for each of some `places` that fragments are lit at.
    pub fn of_pixels(
        lights: &'a LightSet<'a>,
        light: usize,
        places: usize,
        samples: u32,
        seed: u64,
    ) -> Samples<'a> {
        Samples::new(lights, light, places, samples, STAGE_PIXELS, seed)
    }

    /// So many for each place; one of lights without extent.
    pub fn of_each(&self, samples: u32) -> Samples<'a> {
        let count = if self.is_delta() { 1 } else { samples.max(1) };
        Samples {
            count,
            ..self.clone()
        }
    }

    /// Whether the light has no extent.
    pub fn is_delta(&self) -> bool {
        self.lights.is_delta(self.light)
    }

    /// Prepares `samples` of them for each of `places`.
    fn new(
        lights: &'a LightSet<'a>,
        light: usize,
        places: usize,
        samples: u32,
        stage: u32,
        seed: u64,
    ) -> Samples<'a> {
        let worthwhile = places.saturating_mul(samples as usize) > 2 * DRAWN;
        let drawn = if lights.is_distant(light) && worthwhile {
            (0..DRAWN)
                .into_par_iter()
                .map(|index| random_triple(stage, seed, 0, light, index as u32))
                .map(|random| lights.sample(light, Vec3::ZERO, random))
                .collect()
        } else {
            Arc::default()
        };
        Samples {
            lights,
            light,
            count: 1,
            stage,
            seed,
            drawn,
        }
        .of_each(samples)
    }

    /// The `index`-th sample of a place at `hit`.
    fn at(&self, place: usize, hit: &SurfaceHit, index: u32) -> Option<LightSample> {
        let (stage, seed, light) = (self.stage, self.seed, self.light);
        if self.lights.is_delta(light) {
            return self.lights.sample(light, hit, [0.0; 3]);
        }
        if self.drawn.is_empty() {
            let random = random_triple(stage, seed, place, light, index);
            return self.lights.sample(light, hit, random);
        }
        let mut stream = random_stream(stage, seed, place, light);
        let start = (stream.uniform() * DRAWN as f32) as usize;
        self.drawn[(start + index as usize) % DRAWN]
    }
}

/// What samples of a light met on their way to a place: bits of how some of them fared.
pub type Met = u8;
/// Nothing was in the way.
pub const LIT: Met = 1;
/// It was occluded.
pub const DARK: Met = 2;

/// Adds `contribution(place, sample)` of one light, where its direction `is_above` the place and not occluded, to
/// `out[place]`, averaged over the place's samples. Places without a hit get nothing. `run_of`: see [`reflected_at`]. Returns
/// what those of each place's samples met that had anything to add.
fn add_light<D, P>(
    scene: &TracedScene,
    samples: &Samples,
    hits: &[Option<SurfaceHit>],
    run_of: impl Fn(usize) -> (usize, u32) + Sync,
    is_above: impl Fn(usize, Vec3) -> bool + Sync,
    contribution: impl Fn(usize, &LightSample) -> Vec3 + Sync,
    reflection: &Reflection<D, P>,
    out: &mut [Vec3],
) -> Vec<Met>
where
    D: Fn(usize, [f32; 3]) -> Option<(Vec3, f32)> + Sync,
    P: Fn(usize, Vec3) -> f32 + Sync,
{
    let Samples {
        lights,
        light,
        count,
        stage,
        seed,
        ..
    } = *samples;
    let reflected = if reflection.any && lights.is_emissive(light) {
        count.div_ceil(PER_REFLECTED)
    } else {
        0
    };
    // Expected samples per steradian of both kinds, over those of the light's own.
    let (own, other) = (count as f32, reflected as f32);
    let mut met = vec![0; out.len()];
    (out.par_chunks_mut(PACKET)
        .zip(met.par_chunks_mut(PACKET))
        .enumerate())
    .for_each_init(
        || (Vec::new(), Vec::new(), Vec::new()),
        |(rays, targets, occluded): &mut (Vec<Ray>, Vec<(usize, LightSample)>, Vec<bool>),
         (chunk, (out, met))| {
            for index in 0..count {
                rays.clear();
                targets.clear();
                for local in 0..out.len() {
                    let place = chunk * PACKET + local;
                    let Some(hit) = &hits[place] else { continue };
                    let (owner, start) = run_of(place);
                    let Some(sample) = samples.at(owner, hit, start + index) else {
                        continue;
                    };
                    if sample.radiance_over_pdf.max_element() > 0.0 && is_above(place, sample.direction) {
                        rays.push(shadow_ray(scene, hit, &sample));
                        targets.push((local, sample));
                    }
                }
                occluded.clear();
                occluded.resize(rays.len(), false);
                scene.occluded_packet(rays, occluded);
                for ((local, _), dark) in targets.iter().zip(occluded.iter()) {
                    met[*local] |= if *dark { DARK } else { LIT };
                }
                // What is reflected is asked last: a reflection can cost as much as a shadow ray, and many see nothing.
                for ((local, sample), _) in targets.iter().zip(occluded.iter()).filter(|(_, dark)| !**dark) {
                    let place = chunk * PACKET + local;
                    let weight = if reflected > 0 {
                        let density = (reflection.density)(place, sample.direction);
                        1.0 / (1.0 + other * density / (own * sample.pdf))
                    } else {
                        1.0
                    };
                    out[*local] += contribution(place, sample) * (weight / own);
                }
            }
            for index in 0..reflected {
                for (local, out) in out.iter_mut().enumerate() {
                    let place = chunk * PACKET + local;
                    let Some(hit) = &hits[place] else { continue };
                    let (owner, start) = run_of(place);
                    let start = start.div_ceil(PER_REFLECTED);
                    let random = random_triple(stage + STAGE_REFLECTED, seed, owner, light, start + index);
                    let Some((direction, density)) = (reflection.draw)(place, random) else {
                        continue;
                    };
                    if !is_above(place, direction) {
                        continue;
                    }
                    let ray = ray_from(hit, direction);
                    let end = scene.closest_hit(&ray);
                    light_met(
                        scene,
                        lights,
                        ray.origin,
                        direction,
                        end.as_ref(),
                        Some(&hit.into()),
                        |seen, radiance, pdf| {
                            if seen == light {
                                let sample = LightSample {
                                    direction,
                                    distance: end.as_ref().map_or(f32::INFINITY, |hit| hit.t),
                                    radiance_over_pdf: radiance / (other * density + own * pdf),
                                    pdf: density,
                                    emitter: None,
                                };
                                *out += contribution(place, &sample);
                            }
                        },
                    );
                }
            }
        },
    );
    met
}

/// Surface that each point of a maximal Poisson-disk set stands for, over its squared disk radius: disks of half that
/// radius cover 0.7 of a plane.
pub const FOOTPRINT: f32 = std::f32::consts::FRAC_PI_4 / 0.7;

/// Cosine under which a lamp at `distance` lights a place, for the mean over the `footprint` (m²) that the place stands
/// for, where `cosine` is that of its middle.
///
/// A lamp nearer than the next point would light its own point like a sun, and give the scene a thousand times the
/// light that it has. It is seen as if it hung √(h² + A/2π) above the place instead of h: then it sends half of its
/// light down whatever h is (∫ h/(x² + h²)^{3/2} dA = 2π), right above a place the 2π/A that half of its light is on
/// the footprint, and from some footprints away what the middle gets. docs/notebook/stability.md has the figures.
pub(crate) fn cosine_over(footprint: f32, distance: f32, cosine: f32) -> f32 {
    let squared = f64::from(distance) * f64::from(distance);
    let lifted = f64::from(footprint) * std::f64::consts::FRAC_1_PI / 2.0 / squared;
    let cosine = f64::from(cosine);
    ((cosine * cosine + lifted).sqrt() / (1.0 + lifted).powf(1.5)) as f32
}

/// Irradiance of one light on the geometric side of each place, for its smooth normal. `samples` per place
/// for lights with extent. `footprint`: the surface, m², that a place stands for, over which light of lamps without
/// extent is averaged; 0 for the place alone.
pub fn irradiance_at(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    footprint: f32,
    samples: u32,
    seed: u64,
    out: &mut [Vec3],
) {
    let spread = lights.is_delta(light) && footprint > 0.0;
    let is_above = |place: usize, direction: Vec3| {
        hits[place]
            .as_ref()
            .is_some_and(|hit| hit.normal.dot(direction) > 0.0 && hit.geometric_normal.dot(direction) > 0.0)
    };
    let contribution = |place: usize, sample: &LightSample| {
        hits[place].as_ref().map_or(Vec3::ZERO, |hit| {
            let cosine = hit.normal.dot(sample.direction);
            if spread && sample.distance.is_finite() {
                sample.radiance_over_pdf * cosine_over(footprint, sample.distance, cosine)
            } else {
                sample.radiance_over_pdf * cosine
            }
        })
    };
    // A cosine is wider than what samples of a light miss.
    let reflection = Reflection {
        any: false,
        draw: |_: usize, _: [f32; 3]| None,
        density: |_: usize, _: Vec3| 0.0,
    };
    let samples = Samples::new(lights, light, hits.len(), samples, STAGE_POINTS, seed);
    add_light(
        scene,
        &samples,
        hits,
        own_run,
        is_above,
        contribution,
        &reflection,
        out,
    );
}

/// Every place has a sequence of samples of its own.
pub fn own_run(place: usize) -> (usize, u32) {
    (place, 0)
}

/// Places that reflect light towards whoever sees them. All slices are as long.
#[derive(Clone, Copy)]
pub struct Receivers<'a> {
    /// Where they are; `None`: nowhere, and dark.
    pub hits: &'a [Option<SurfaceHit>],
    /// How they reflect.
    pub points: &'a [Option<ShadingPoint>],
    /// Unit directions to their viewers.
    pub views: &'a [Vec3],
}

impl<'a> Receivers<'a> {
    /// The fragments of an exposure; `views` are its own ([`Exposure::views`]).
    pub fn of(seen: &'a Exposure, views: &'a [Vec3]) -> Receivers<'a> {
        Receivers {
            hits: &seen.hits,
            points: &seen.points,
            views,
        }
    }
}

/// Whether a lobe is so narrow that samples of a light may miss what it reflects.
fn is_narrow(point: &ShadingPoint) -> bool {
    !point.lambert && (point.gloss != Gloss::Ggx || point.alpha < WIDE)
}

/// Adds to `out` the radiance that each receiver sends towards its viewer after one reflection of one light. `run_of` says whose sequence a place's samples are taken from ([`own_run`] for its own), and
/// from which on. Returns what they met on their way to each.
pub fn reflected_at(
    scene: &TracedScene,
    samples: &Samples,
    receivers: &Receivers,
    run_of: impl Fn(usize) -> (usize, u32) + Sync,
    out: &mut [Vec3],
) -> Vec<Met> {
    let Receivers { hits, points, views } = *receivers;
    let is_above = |place: usize, direction: Vec3| {
        points[place].as_ref().is_some_and(|point| {
            point.shading_normal.dot(direction) > 0.0 && point.geometric_normal.dot(direction) > 0.0
        })
    };
    let contribution = |place: usize, sample: &LightSample| {
        points[place].as_ref().map_or(Vec3::ZERO, |point| {
            let cosine = point.shading_normal.dot(sample.direction);
            bsdf::eval(point, views[place], sample.direction) * sample.radiance_over_pdf * cosine
        })
    };
    let narrow = |place: usize| points[place].as_ref().filter(|point| is_narrow(point));
    let reflection = Reflection {
        any: points.iter().flatten().any(is_narrow),
        draw: |place: usize, random: [f32; 3]| {
            let sample = bsdf::sample(narrow(place)?, views[place], random)?;
            Some((sample.wi, sample.pdf))
        },
        density: |place: usize, direction: Vec3| {
            narrow(place).map_or(0.0, |point| bsdf::pdf(point, views[place], direction))
        },
    };
    add_light(
        scene,
        samples,
        hits,
        run_of,
        is_above,
        contribution,
        &reflection,
        out,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, sky, traced};
    use relight_scene::light::LightKind;
    use relight_scene::light_set::{LightRig, NoEmitters};

    /// Truth: the integral of radiance times cosine over the map, pixel by pixel. Tolerance: three standard errors of the few
    /// places' mean, from their own spread. Samples drawn for all places together must spread no more than a place's own.
    #[test]
    fn a_sky_lights_a_floor_alike_whether_samples_are_drawn_for_each_place_or_for_all() {
        let scene = traced(vec![level(1.0, 0.0, 0)], vec![matt(0.5, 0.0)]);
        let tracks = [sky()];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        let samples = 8;
        let lit = |side: usize| -> Vec<f64> {
            let at = |k: usize| 1.8 * ((k as f32 + 0.5) / side as f32 - 0.5);
            let down = |i: usize| Ray::endless(Vec3::new(at(i % side), 1.0, at(i / side)), Vec3::NEG_Y);
            let hits: Vec<_> = (0..side * side).map(|i| scene.closest_hit(&down(i))).collect();
            let mut out = vec![Vec3::ZERO; hits.len()];
            irradiance_at(&scene, &lights, 0, &hits, 0.0, samples, 1, &mut out);
            out.iter().map(|e| f64::from(e.x)).collect()
        };
        let LightKind::Environment { map, .. } = &tracks[0].kind else {
            unreachable!("a sky is an environment")
        };
        // Far finer than the map's pixels.
        let (columns, rows) = (512, 256);
        let mut truth = 0.0;
        for row in 0..rows / 2 {
            let v = (f64::from(row) + 0.5) / f64::from(rows);
            let (sin, cos) = (std::f64::consts::PI * v).sin_cos();
            let angle =
                sin * std::f64::consts::PI / f64::from(rows) * std::f64::consts::TAU / f64::from(columns);
            for column in 0..columns {
                let u = (column as f32 + 0.5) / columns as f32;
                truth += f64::from(map.at([u, v as f32]).x) * cos * angle;
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let spread =
            |values: &[f64]| mean(&values.iter().map(|e| (e - truth).powi(2)).collect::<Vec<_>>()).sqrt();
        let (few, many) = (lit(40), lit(100));
        assert!(few.len() * 8 <= 2 * DRAWN && many.len() * 8 > 2 * DRAWN);
        let tolerance = 3.0 * spread(&few) / (few.len() as f64).sqrt();
        assert!(tolerance < 0.03 * truth, "{tolerance} of {truth}");
        assert!((mean(&few) - truth).abs() < tolerance, "{} {truth}", mean(&few));
        assert!((mean(&many) - truth).abs() < tolerance, "{} {truth}", mean(&many));
        assert!(
            spread(&many) < 1.2 * spread(&few),
            "{} {}",
            spread(&many),
            spread(&few)
        );
    }

    /// Truth: a lamp of 1 W/sr above a plane sends 2π down, however near it hangs. A square lattice of points, each for its
    /// square; the mean over places of the lamp between them is the integral over the plane. Tolerance: what lies beyond
    /// the lattice, a share of height/reach, and as much again for the lift. Single places: right above a point
    /// the lift leaves 1.5 times the light, in the middle between four the least.
    #[test]
    fn a_lamp_upon_a_plane_of_points_gives_half_of_its_light_on_average() {
        let flux = |height: f64, offset: [f64; 2], footprint: f32| -> f64 {
            let reach = 150;
            let mut sum = 0.0;
            for i in -reach..=reach {
                for j in -reach..=reach {
                    let (x, z) = (f64::from(i) + offset[0], f64::from(j) + offset[1]);
                    let squared = x * x + z * z + height * height;
                    let cosine = height / squared.sqrt();
                    let spread = if footprint > 0.0 {
                        f64::from(cosine_over(footprint, squared.sqrt() as f32, cosine as f32))
                    } else {
                        cosine
                    };
                    sum += spread / squared;
                }
            }
            sum / (2.0 * std::f64::consts::PI)
        };
        for height in [1e-3, 1e-2, 0.1, 0.5, 2.0] {
            let steps = 6;
            let mut mean = 0.0;
            for k in 0..steps * steps {
                let offset = [k % steps, k / steps].map(|at| f64::from(at) / f64::from(steps));
                let found = flux(height, offset, 1.0);
                assert!((0.6..1.6).contains(&found), "{height} {offset:?}: {found}");
                mean += found / f64::from(steps * steps);
            }
            assert!((mean - 1.0).abs() < 0.02, "{height}: {mean}");
        }
        assert!(
            flux(1e-3, [0.0; 2], 0.0) > 1e5,
            "the middle alone takes it for a sun"
        );
        // Ten footprints away it is the cosine: A/2π in 100 A is a six-hundredth, 1.5 of them at normal incidence.
        assert!((cosine_over(1.0, 10.0, 1.0) - 1.0).abs() < 3e-3);
    }
}
