//! One relit frame from an asset: direct light at points and pixels, transfer, reconstruction.
//!
//! Source: Lehtinen et al. 2008, section 4. How indirect light on surfaces that are not matt is shaded: the matt part
//! takes the vector irradiance dotted with the shading normal; lobes that matter are followed by rays
//! ([`crate::reflections`]), others spread their light like the matt part, with the right total.

use crate::cuts::VisibilityCuts;
use crate::cuts::illumination::Illumination;
use crate::cuts::shade::{Fragments, ShadeStats, Shaded, irradiance_at_sites, shade};
use crate::edges;
use crate::reconstruct;
use crate::shot::Shot;
use crate::snap::snapped;
use crate::transfer::{Transfer, TransferStats};
use glam::Vec3;
use rayon::prelude::*;
use relight_render::lightcuts::{self, AT_PIXELS, AT_POINTS, LightcutStats, ManyLights};
use relight_render::lighting::{self, Samples, own_run};
use relight_render::sum::Sum;
use relight_scene::light_set::{DistantLight, LightRig, LightSet, Split};
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::basis::Level;
use relight_transport::pyramid::VectorIrradiance;
use std::f32::consts::PI;
use std::sync::Arc;
use std::time::Instant;

/// Of so many samples of a small lamp one is cast everywhere, and tells where edges of its shadows are near; all are cast there
/// (a quarter everywhere: a tenth more error, docs/notebook/cuts.md).
const FIRST: u32 = 2;

/// A scene with its transport, ready to be lit.
pub struct Player {
    /// Surfaces and materials.
    pub scene: TracedScene,
    /// Operators; `None` for an asset without points.
    pub transfer: Option<Transfer>,
    /// Where each finest point lies on the scene's surfaces.
    pub points: Vec<Option<SurfaceHit>>,
    /// Visibility cuts; `None` for an asset baked without.
    pub cuts: Option<VisibilityCuts>,
}

/// The lights of a frame as visibility cuts take them.
pub struct Distant<'a> {
    /// What has shadow rays of its own.
    pub near: LightSet<'a>,
    /// Per light the part that comes from even directions.
    pub lights: Vec<Option<DistantLight>>,
    /// Most nodes of the illumination cut.
    pub most: usize,
}

impl<'a> Distant<'a> {
    /// The lights of a rig at `frame`; `split` gives the parts of each light's environment.
    pub fn at(
        rig: &LightRig<'a>,
        frame: f64,
        split: impl Fn(usize) -> Option<Arc<Split>>,
        most: usize,
    ) -> Distant<'a> {
        let mut near = rig.at(frame);
        let lights = near.take_distant(split);
        Distant { near, lights, most }
    }
}

/// How a frame is lit.
#[derive(Clone, Copy, Debug)]
pub struct LightingSettings {
    /// Shadow rays per fragment for each light with extent.
    pub pixel_samples: u32,
    /// Shadow rays per finest point for each light with extent. Fewer than per pixel: a sender averages some
    /// hundreds of points.
    pub point_samples: u32,
    /// Seed of the light samples.
    pub seed: u64,
    /// Keep each light's share apart.
    pub per_light: bool,
    /// Make indirect light by transfer.
    pub indirect: bool,
    /// Make the first bounce by visibility cuts of surface samples, with an illumination cut of at most so many nodes:
    /// at all fragments, or, if `indirect`, at those that are not matt. Nothing without such cuts.
    pub bounce_cuts: Option<usize>,
}

/// Milliseconds that a frame's stages took.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameTimes {
    /// Direct irradiance at the finest points.
    pub direct_points: f64,
    /// Pull-push and further bounces.
    pub bounces: f64,
    /// Product with T.
    pub transfer: f64,
    /// Flattening to the finest level.
    pub flatten: f64,
    /// Direct light at the pixels.
    pub direct_pixels: f64,
    /// Indirect light at the pixels.
    pub reconstruct: f64,
    /// Choosing the illumination cut.
    pub illumination_cut: f64,
    /// Light of even directions at the pixels.
    pub shade: f64,
}

/// Radiance per fragment of a shot.
#[derive(Clone, Debug, Default)]
pub struct Lit {
    /// Light seen directly.
    pub emission: Vec<Vec3>,
    /// One reflection.
    pub direct: Vec<Vec3>,
    /// Two reflections and more; not clamped.
    pub indirect: Vec<Vec3>,
    /// Per light of the sequence its emission + direct + indirect, if asked for.
    pub lights: Vec<(String, Vec<Vec3>)>,
    /// How the last transfer went.
    pub transfer: Option<TransferStats>,
    /// Nodes of the last illumination cut, and how shading with it went.
    pub cuts: Option<CutStats>,
    /// What direct light took where the lights were so many that lightcuts made it.
    pub lightcuts: Option<Lightcuts>,
}

/// Where direct light is wanted: fragments, finest points and surface samples.
struct Places<'a> {
    fragments: &'a [Option<SurfaceHit>],
    points: &'a [Option<SurfaceHit>],
    samples: &'a [Option<SurfaceHit>],
}

/// Direct light at the same places: radiance of fragments, irradiance of the others.
struct Sums {
    direct: Sum,
    points: Sum,
    samples: Sum,
}

/// What lightcuts for direct light took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lightcuts {
    /// Lights without extent that stand for all.
    pub lights: usize,
    /// Cuts at the points of the basis and at surface samples.
    pub points: LightcutStats,
    /// Cuts at the fragments.
    pub pixels: LightcutStats,
}

impl Player {
    /// Puts the finest points back on the scene's surfaces: the file stores them to a fraction of their
    /// distance, shadow rays need them exact.
    pub fn new(scene: TracedScene, transfer: Option<Transfer>, cuts: Option<VisibilityCuts>) -> Player {
        let points = transfer.as_ref().map_or_else(Vec::new, |t| {
            snapped(
                &scene,
                &t.finest.positions,
                &t.finest.normals,
                t.finest.disk_radius,
            )
        });
        Player {
            scene,
            transfer,
            points,
            cuts,
        }
    }

    /// Surface that each of the finest points stands for, m².
    pub fn footprint(&self) -> f32 {
        let radius = self.transfer.as_ref().map_or(0.0, |t| t.finest.disk_radius);
        lighting::FOOTPRINT * radius * radius
    }

    /// Lights a shot. `distant`: the same lights as visibility cuts take them; without it all have shadow rays.
    pub fn light(
        &self,
        shot: &Shot,
        lights: &LightSet,
        distant: Option<&Distant>,
        settings: &LightingSettings,
    ) -> (Lit, FrameTimes) {
        let mut times = FrameTimes::default();
        let count = shot.len();
        let views: Vec<Vec3> = (shot.directions.par_iter().with_min_len(4096))
            .map(|d| -*d)
            .collect();
        let mut lit = Lit {
            emission: vec![Vec3::ZERO; count],
            indirect: vec![Vec3::ZERO; count],
            ..Lit::default()
        };
        let emission = |light: Option<usize>| emission_at(&self.scene, shot, lights, light);
        let lit_points: &[Option<SurfaceHit>] = if settings.indirect { &self.points } else { &[] };
        let samples = (self.cuts.as_ref()).and_then(|c| settings.bounce_cuts.and(c.samples()));
        let samples = samples.map_or(&[][..], |s| &s.hits);
        let mut sums = Sums {
            direct: Sum::Nothing(count),
            points: Sum::Nothing(lit_points.len()),
            samples: Sum::Nothing(samples.len()),
        };
        let mut places = Places {
            fragments: &shot.hits,
            points: lit_points,
            samples,
        };
        let shadowed = distant.map_or(lights, |d| &d.near);
        if !settings.per_light {
            lit.lightcuts = self.by_lightcuts(
                shot,
                &views,
                shadowed,
                &mut places,
                settings,
                &mut sums,
                &mut times,
            );
        }
        for light in 0..lights.len() {
            let start = Instant::now();
            let irradiance = |places: &[Option<SurfaceHit>], footprint: f32| {
                let mut irradiance = vec![Vec3::ZERO; places.len()];
                lighting::irradiance_at(
                    &self.scene,
                    shadowed,
                    light,
                    places,
                    footprint,
                    settings.point_samples,
                    settings.seed,
                    &mut irradiance,
                );
                irradiance
            };
            let mut own_received = Received {
                points: irradiance(places.points, self.footprint()),
                samples: irradiance(places.samples, 0.0),
            };
            times.direct_points += milliseconds(start);
            let start = Instant::now();
            let mut reflected = vec![Vec3::ZERO; places.fragments.len()];
            // Shadows of others are soft, mostly wider than a pixel. What cuts leave of an environment are its small lamps.
            let small = shadowed.is_delta(light) || (distant.is_some() && shadowed.is_distant(light));
            let most = settings.pixel_samples;
            let first = if small { most.div_ceil(FIRST) } else { most };
            let samples = Samples::of_pixels(shadowed, light, (shot.len(), first), settings.seed);
            let fragments = (places.fragments, &shot.points[..], &views[..]);
            let met = lighting::reflected_at(&self.scene, &samples, fragments, own_run, &mut reflected);
            if small && !reflected.is_empty() {
                edges::smooth(&self.scene, shot, &samples.of_each(most), &met, &mut reflected);
            }
            times.direct_pixels += milliseconds(start);
            if settings.per_light
                && let Some(distant) = distant
                && let Some(own) = &distant.lights[light]
            {
                let most = distant.most;
                let even = self.of_distant(shot, &views, &[own], most, settings, &mut times);
                add(&mut reflected, &even.radiance);
                add(&mut own_received.points, &even.irradiance);
                lit.cuts = even.stats;
            }
            if settings.per_light {
                let mut own = emission(Some(light));
                add(&mut own, &reflected);
                let (indirect, ..) = self.indirect(shot, &views, &own_received, settings, &mut times);
                add(&mut own, &indirect);
                lit.lights.push((lights.name(light).to_owned(), own));
            }
            sums.direct.add(reflected);
            sums.points.add(own_received.points);
            sums.samples.add(own_received.samples);
        }
        if let (Some(distant), false) = (distant, settings.per_light) {
            let all: Vec<&DistantLight> = distant.lights.iter().flatten().collect();
            let even = self.of_distant(shot, &views, &all, distant.most, settings, &mut times);
            sums.direct.add(even.radiance);
            sums.points.add(even.irradiance);
            lit.cuts = even.stats;
        }
        lit.direct = sums.direct.rounded();
        let received = Received {
            points: sums.points.rounded(),
            samples: sums.samples.rounded(),
        };
        lit.emission = emission(None);
        let bounced;
        (lit.indirect, lit.transfer, bounced) = self.indirect(shot, &views, &received, settings, &mut times);
        lit.cuts = lit.cuts.or(bounced);
        (lit, times)
    }

    /// Direct light by lightcuts at the kinds of places where lights are so many that these take less time; such places
    /// are taken from `places`.
    fn by_lightcuts(
        &self,
        shot: &Shot,
        views: &[Vec3],
        lights: &LightSet,
        places: &mut Places,
        settings: &LightingSettings,
        sums: &mut Sums,
        times: &mut FrameTimes,
    ) -> Option<Lightcuts> {
        let points = lightcuts::worthwhile(lights, settings.point_samples, AT_POINTS);
        let pixels = lightcuts::worthwhile(lights, settings.pixel_samples, AT_PIXELS);
        if !points && !pixels {
            return None;
        }
        let start = Instant::now();
        let many = ManyLights::new(&self.scene, lights, settings.seed);
        let mut used = Lightcuts {
            lights: many.len(),
            ..Lightcuts::default()
        };
        if points {
            for (places, footprint, sum) in [
                (&mut places.points, self.footprint(), &mut sums.points),
                (&mut places.samples, 0.0, &mut sums.samples),
            ] {
                let (irradiance, stats) = many.irradiance_at(&self.scene, std::mem::take(places), footprint);
                sum.add(irradiance);
                used.points = used.points.sum(stats);
            }
        }
        times.direct_points += milliseconds(start);
        if pixels {
            let start = Instant::now();
            let fragments = std::mem::take(&mut places.fragments);
            let (reflected, stats) = many.reflected_at(&self.scene, fragments, &shot.points, views);
            sums.direct.add(reflected);
            used.pixels = stats;
            times.direct_pixels += milliseconds(start);
        }
        Some(used)
    }

    /// Light of even directions at fragments and points.
    fn of_distant(
        &self,
        shot: &Shot,
        views: &[Vec3],
        lights: &[&DistantLight],
        most: usize,
        settings: &LightingSettings,
        times: &mut FrameTimes,
    ) -> EvenLight {
        let cuts = self.cuts.as_ref().filter(|_| !lights.is_empty());
        let Some((cuts, directions)) = cuts.and_then(|c| Some((c, c.directions()?))) else {
            return EvenLight::default();
        };
        let start = Instant::now();
        let parts = directions
            .cells
            .parts(|direction| lights.iter().map(|light| light.radiance(direction)).sum());
        let light = Illumination::of_parts(directions, &parts, most);
        times.illumination_cut += milliseconds(start);
        let start = Instant::now();
        let by_cuts = Fragments {
            narrow: &shot.reflections.narrow,
            ..fragments(shot, views, true)
        };
        let Shaded {
            mut radiance,
            doubts,
            stats,
        } = shade(cuts, &light, &by_cuts);
        (light.uneven).resolve(&self.scene, shot, &doubts, &mut radiance);
        (shot.reflections).add_sky_to(&mut radiance, |direction| {
            lights.iter().map(|light| light.radiance(direction)).sum()
        });
        times.shade += milliseconds(start);
        let start = Instant::now();
        let irradiance = match &self.transfer {
            Some(transfer) if settings.indirect => {
                irradiance_at_sites(cuts, &light, &transfer.finest.positions, &transfer.finest.normals)
            }
            _ => Vec::new(),
        };
        times.direct_points += milliseconds(start);
        EvenLight {
            radiance,
            irradiance,
            stats: Some((light.heights.len(), stats)),
        }
    }

    /// Indirect light at the fragments, and how transfer and cuts went.
    fn indirect(
        &self,
        shot: &Shot,
        views: &[Vec3],
        received: &Received,
        settings: &LightingSettings,
        times: &mut FrameTimes,
    ) -> (Vec<Vec3>, Option<TransferStats>, Option<CutStats>) {
        let bounce = self.first_bounce(shot, views, &received.samples, settings, times);
        let (shaded, cut_stats) = bounce.unzip();
        let Some(transfer) = self.transfer.as_ref().filter(|_| !received.points.is_empty()) else {
            let radiance = shaded.unwrap_or_else(|| vec![Vec3::ZERO; shot.len()]);
            return (radiance, None, cut_stats);
        };
        let mut add_times = |stats: &TransferStats| {
            times.bounces += stats.bounce_ms;
            times.transfer += stats.transfer_ms;
            times.flatten += stats.flatten_ms;
        };
        // Where nothing is glossy, transfer makes it all, in one sum.
        let shaded = shaded.filter(|_| cut_stats.is_some_and(|(_, stats)| stats.fragments > 0));
        let Some(mut radiance) = shaded else {
            let (values, stats) = transfer.indirect_from_direct(&received.points);
            add_times(&stats);
            let start = Instant::now();
            let mut radiance = indirect_at(shot, &transfer.finest, &values);
            let indirect = (values.iter().zip(&transfer.finest.normals)).map(|(e, n)| e.irradiance(*n));
            shot.reflections
                .add_to(&mut radiance, Some(&received.points), indirect);
            times.reconstruct += milliseconds(start);
            return (radiance, Some(stats), cut_stats);
        };
        let (first, further, stats) = transfer.first_and_further(&received.points);
        add_times(&stats);
        let start = Instant::now();
        add(&mut radiance, &indirect_at(shot, &transfer.finest, &further));
        for ((out, first), point) in radiance
            .iter_mut()
            .zip(indirect_at(shot, &transfer.finest, &first))
            .zip(&shot.points)
        {
            if point.as_ref().is_some_and(|p| p.lambert) {
                *out += first;
            }
        }
        // The first bounce in lobes is the cuts'.
        let indirect = (first.iter().zip(&further).zip(&transfer.finest.normals))
            .map(|((first, further), n)| first.irradiance(*n) + further.irradiance(*n));
        shot.reflections.add_to(&mut radiance, None, indirect);
        times.reconstruct += milliseconds(start);
        (radiance, Some(stats), cut_stats)
    }

    /// The first bounce by visibility cuts, from irradiance at the surface samples: where transfer makes indirect
    /// light, too, only at fragments that are not matt.
    fn first_bounce(
        &self,
        shot: &Shot,
        views: &[Vec3],
        irradiance: &[Vec3],
        settings: &LightingSettings,
        times: &mut FrameTimes,
    ) -> Option<(Vec<Vec3>, CutStats)> {
        let (cuts, most) = (self.cuts.as_ref()?, settings.bounce_cuts?);
        let samples = cuts.samples()?;
        let start = Instant::now();
        let light = Illumination::of_samples(&samples.flux(irradiance), most);
        times.illumination_cut += milliseconds(start);
        let start = Instant::now();
        let shaded = shade(cuts, &light, &fragments(shot, views, !settings.indirect));
        times.shade += milliseconds(start);
        Some((shaded.radiance, (light.heights.len(), shaded.stats)))
    }
}

/// Nodes of an illumination cut, and how shading with it went.
pub type CutStats = (usize, ShadeStats);

/// Direct irradiance from which indirect light starts.
struct Received {
    /// At the finest points, for transfer.
    points: Vec<Vec3>,
    /// At surface samples, for visibility cuts.
    samples: Vec<Vec3>,
}

fn fragments<'a>(shot: &'a Shot, views: &'a [Vec3], matt: bool) -> Fragments<'a> {
    Fragments {
        sites: &shot.sites,
        points: &shot.points,
        views,
        narrow: &[],
        matt,
    }
}

/// Light of even directions; empty where there is none.
#[derive(Default)]
struct EvenLight {
    /// Reflected by each fragment.
    radiance: Vec<Vec3>,
    /// At each finest point, for transfer.
    irradiance: Vec<Vec3>,
    stats: Option<CutStats>,
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

fn add(sum: &mut [Vec3], part: &[Vec3]) {
    (sum.par_iter_mut().zip(part).with_min_len(4096)).for_each(|(s, p)| *s += *p);
}

fn indirect_at(shot: &Shot, finest: &Level, values: &[VectorIrradiance]) -> Vec<Vec3> {
    let Some(weights) = &shot.weights else {
        return vec![Vec3::ZERO; shot.len()];
    };
    let irradiance = reconstruct::irradiance(weights, &shot.components, finest, values);
    (irradiance.into_par_iter().zip(&shot.albedo).with_min_len(4096))
        .map(|(e, albedo)| e * *albedo / PI)
        .collect()
}

/// Light that each fragment shows directly: emissive surfaces that a light lets shine, environments, and
/// rectangles and spheres of the sequence. Of one light, or of all.
fn emission_at(scene: &TracedScene, shot: &Shot, lights: &LightSet, only: Option<usize>) -> Vec<Vec3> {
    // Looking at all fragments takes as long as their reconstruction.
    if scene.emissive_triangles().is_empty() && !lights.any_along() {
        return vec![Vec3::ZERO; shot.len()];
    }
    (0..shot.len())
        .into_par_iter()
        .with_min_len(1024)
        .map(|f| {
            let mut sum = Vec3::ZERO;
            let direction = shot.directions[f];
            let distance = shot.hits[f].as_ref().map_or(f32::INFINITY, |hit| hit.t);
            let wanted = |light: usize| only.is_none_or(|o| o == light);
            lights.along(shot.eye, direction, distance, |seen| {
                if wanted(seen.light) {
                    sum += seen.radiance;
                }
            });
            if let (Some(hit), Some(point)) = (&shot.hits[f], &shot.points[f])
                && point.emission != Vec3::ZERO
            {
                let cosine = hit.geometric_normal.dot(direction).abs();
                lights.emitted(hit.primitive, hit.barycentric, hit.t, cosine, |seen| {
                    if wanted(seen.light) {
                        sum += seen.radiance;
                    }
                });
                if only.is_none() && scene.material(hit.primitive).unlit {
                    sum += point.emission;
                }
            }
            sum
        })
        .collect()
}
