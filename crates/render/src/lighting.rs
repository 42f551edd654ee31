//! Light that many places reflect, light by light: fragments of a shot.
//!
//! Lobes that are narrower than an emissive surface find it by rays drawn by the reflection, which join in, weighted by
//! the balance heuristic (Veach 1997, 9.2.2).

use crate::direct::{light_met, shadow_ray};
use crate::exposure::Exposure;
use crate::samples::Samples;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::bsdf;
use relight_scene::environment::luminance;
use relight_scene::light_set::LightSample;
use relight_scene::rays::{Ray, SurfacePoint};
use relight_scene::shading::{Gloss, ShadingPoint};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_end, ray_from_end};
use relight_scene::traced::TracedScene;

/// Places per parallel task and per packet of shadow rays.
const PACKET: usize = 256;

/// Samples of an emissive light for each ray drawn by the reflection.
const PER_REFLECTED: u32 = 4;

/// Width α of the lobes above which samples of the light alone do: a cosine's is about 1.
const WIDE: f32 = 0.5;

/// How places reflect: two densities per steradian of the same distribution.
pub(crate) struct Reflection<D, P> {
    /// Whether any place draws directions.
    pub any: bool,
    /// Direction and its density, from a place and three random numbers in [0, 1); `None`: no light is reflected, or
    /// the place draws none.
    pub draw: D,
    /// Density with which `draw` gives a place this direction.
    pub density: P,
}

/// What samples of a light met on their way to a place: bits of how some of them fared.
pub type Met = u8;
/// Nothing was in the way.
pub const LIT: Met = 1;
/// It was occluded.
pub const DARK: Met = 2;

/// How samples of a light fared.
#[derive(Clone, Debug, Default)]
pub struct Told {
    /// What those of each place met that had anything to add.
    pub met: Vec<Met>,
    /// Luminance that each alone would give, place by place; empty if not asked for ([`Samples::told`]).
    pub light: Vec<f32>,
}

impl Told {
    /// Luminance of the `count` samples of a place; none if it was not asked for.
    pub(crate) fn of(&self, place: usize, count: u32) -> &[f32] {
        let count = count as usize;
        self.light
            .get(place * count..(place + 1) * count)
            .unwrap_or_default()
    }
}

/// Shadow rays that are cast together.
#[derive(Default)]
struct Packet {
    rays: Vec<Ray>,
    /// Where each starts, within the task, and what it is for.
    targets: Vec<(usize, LightSample)>,
    /// What gets through.
    passed: Vec<Vec3>,
    occluded: Vec<bool>,
}

/// Adds `contribution(place, sample)` of one light, where its direction `is_above` the place and not occluded, to
/// `out[place]`, averaged over the place's samples. Places that rays `start` at nowhere get nothing. `run_of`: see [`reflected_at`].
pub(crate) fn add_light<D, P>(
    scene: &TracedScene,
    samples: &Samples,
    start: impl Fn(usize) -> Option<SurfacePoint> + Sync,
    run_of: impl Fn(usize) -> (usize, u32) + Sync,
    is_above: impl Fn(usize, Vec3) -> bool + Sync,
    contribution: impl Fn(usize, &LightSample) -> Vec3 + Sync,
    reflection: &Reflection<D, P>,
    out: &mut [Vec3],
) -> Told
where
    D: Fn(usize, [f32; 3]) -> Option<(Vec3, f32)> + Sync,
    P: Fn(usize, Vec3) -> f32 + Sync,
{
    let Samples {
        lights, light, count, ..
    } = *samples;
    let reflected = if reflection.any && !lights.is_delta(light) {
        count.div_ceil(PER_REFLECTED)
    } else {
        0
    };
    // Expected samples per steradian of both kinds, over those of the light's own.
    let (own, other) = (count as f32, reflected as f32);
    let mut met = vec![0; out.len()];
    let told = if samples.is_told { count as usize } else { 0 };
    let mut light_of = vec![0.0; told * out.len()];
    let mut told_chunks: Vec<&mut [f32]> = light_of.chunks_mut((told * PACKET).max(1)).collect();
    told_chunks.resize_with(out.len().div_ceil(PACKET), Default::default);
    (out.par_chunks_mut(PACKET)
        .zip(met.par_chunks_mut(PACKET))
        .zip(told_chunks)
        .enumerate())
    .for_each_init(Packet::default, |packet, (chunk, ((out, met), light_of))| {
        let Packet {
            rays,
            targets,
            passed,
            occluded,
        } = packet;
        for index in 0..count {
            rays.clear();
            targets.clear();
            for local in 0..out.len() {
                let place = chunk * PACKET + local;
                let Some(start) = start(place) else { continue };
                let (owner, first) = run_of(place);
                let Some(sample) = samples.at(owner, &(&start).into(), first + index) else {
                    continue;
                };
                if sample.radiance_over_pdf.max_element() > 0.0 && is_above(place, sample.direction) {
                    rays.push(shadow_ray(scene, &start, &sample));
                    targets.push((local, sample));
                }
            }
            passed.clear();
            passed.resize(rays.len(), Vec3::ZERO);
            scene.passed_packet(rays, passed, occluded);
            for ((local, _), passed) in targets.iter().zip(passed.iter()) {
                met[*local] |= if *passed == Vec3::ZERO { DARK } else { LIT };
            }
            // What is reflected is asked last: a reflection can cost as much as a shadow ray, and many see nothing.
            let lit = targets.iter().zip(passed.iter());
            for ((local, sample), passed) in lit.filter(|(_, passed)| **passed != Vec3::ZERO) {
                let place = chunk * PACKET + local;
                let weight = if reflected > 0 {
                    let density = (reflection.density)(place, sample.direction);
                    1.0 / (1.0 + other * density / (own * sample.pdf))
                } else {
                    1.0
                };
                let light = contribution(place, sample) * *passed;
                out[*local] += light * (weight / own);
                if told > 0 {
                    light_of[*local * told + index as usize] = luminance(light) * weight;
                }
            }
        }
        for index in 0..reflected {
            for (local, out) in out.iter_mut().enumerate() {
                let place = chunk * PACKET + local;
                let Some(start) = start(place) else { continue };
                let (owner, first) = run_of(place);
                let first = first.div_ceil(PER_REFLECTED);
                let random = samples.of_reflection(owner, first + index);
                let Some((direction, density)) = (reflection.draw)(place, random) else {
                    continue;
                };
                if !is_above(place, direction) {
                    continue;
                }
                let ray = ray_from_end(&start, direction);
                let end = scene.closest_hit(&ray);
                light_met(
                    scene,
                    lights,
                    ray.origin,
                    direction,
                    end.as_ref(),
                    Some(&(&start).into()),
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
    });
    Told { met, light: light_of }
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
    let coat = (point.layers.as_ref()).is_some_and(|layers| layers.coat > 0.0 && layers.coat_alpha < WIDE);
    !point.lambert && (point.gloss != Gloss::Ggx || point.alpha < WIDE || coat)
}

/// Adds to `out` the radiance that each receiver sends towards its viewer after one reflection of one light. `run_of` says whose sequence a place's samples are taken from ([`own_run`] for its own), and
/// from which on.
pub fn reflected_at(
    scene: &TracedScene,
    samples: &Samples,
    receivers: &Receivers,
    run_of: impl Fn(usize) -> (usize, u32) + Sync,
    out: &mut [Vec3],
) -> Told {
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
        any: !samples.is_delta() && points.iter().flatten().any(is_narrow),
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
        |place| hits[place].as_ref().map(ray_end),
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
    use crate::expose::expose;
    use crate::test_scenes::{camera, day, level, matt, traced_with};
    use relight_scene::light_set::{LightRig, NoEmitters};
    use relight_scene::material::Material;
    use relight_scene::traced::Shading;

    /// A polished floor under a sky: most of what it reflects comes from a few degrees, where samples of the sky hardly ever are. Truth:
    /// two thousand samples. Tolerance: without rays drawn by the reflection the mean square error is above 1.
    #[test]
    fn a_polished_floor_shows_the_sky_and_not_its_noise() {
        let polished = Material {
            metallic: 1.0,
            roughness: 0.2,
            ..matt(0.8, 0.0)
        };
        let scene = traced_with(vec![level(1.0, 0.0, 0)], vec![polished], Shading::Full);
        let tracks = [day()];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        let seen = expose(
            &scene,
            &camera(Vec3::new(0.0, 0.3, 1.5), Vec3::ZERO, 20.0),
            16,
            16,
            1,
        );
        let views = seen.views();
        let lit = |samples: u32, seed: u64| {
            let mut out = vec![Vec3::ZERO; seen.len()];
            let samples = Samples::of_pixels(&lights, 0, seen.len(), samples, seed);
            reflected_at(&scene, &samples, &Receivers::of(&seen, &views), own_run, &mut out);
            out
        };
        let (found, truth) = (lit(8, 1), lit(2048, 2));
        let places: Vec<usize> = (0..seen.len()).filter(|&f| seen.hits[f].is_some()).collect();
        let square = |&f: &usize| f64::from((found[f].y - truth[f].y) / truth[f].y).powi(2);
        let error = places.iter().map(square).sum::<f64>() / places.len() as f64;
        assert!(places.len() > 100 && error < 0.1, "{} {error}", places.len());
    }
}
