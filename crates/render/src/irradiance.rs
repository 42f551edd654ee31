//! Irradiance of a light at many places at once: points of the basis.

use crate::guide::Guides;
use crate::lamp::{Lamp, contribution};
use crate::lighting::{Met, Reflection, Told, add_light, own_run};
pub use crate::place::Place;
use crate::rare::Rare;
use crate::samples::Samples;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::environment::luminance;
use relight_scene::light_set::{LightSample, LightSet};
use relight_scene::surface::{SurfaceHit, WAYS};
use relight_scene::traced::TracedScene;
use std::collections::BTreeMap;

/// Surface that each point of a maximal Poisson-disk set stands for, over its squared disk radius: disks of half that
/// radius cover 0.7 of a plane.
pub const FOOTPRINT: f32 = std::f32::consts::FRAC_PI_4 / 0.7;

/// Irradiance of one light on the geometric side of each place, for its smooth normal. `samples` per place
/// for lights with extent, more in a neighbourhood of places where most of them are in vain. `footprint`: the surface, m², that a
/// place stands for, over which light of lamps without extent is averaged; 0 for the place alone. Second, what each place's samples
/// met.
pub fn irradiance_at(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    footprint: f32,
    samples: u32,
    seed: u64,
) -> (Vec<Vec3>, Vec<Met>) {
    let mut samples = Samples::of_points(lights, light, hits.len(), samples, seed);
    if samples.count > 1 {
        samples = samples.told();
    }
    let place = |place: usize| hits[place].as_ref().map(Place::from);
    let (mut irradiance, told) = irradiance_by(scene, &samples, hits.len(), place, footprint, own_run);
    if samples.is_told {
        for again in rarely_lit(&samples, &told, hits, &irradiance) {
            let own = |k: usize| place(again.places[k]);
            let run_of = |k: usize| (again.places[k], 0);
            let (lit, _) = irradiance_by(scene, &again.samples, again.places.len(), own, footprint, run_of);
            for (&place, lit) in again.places.iter().zip(lit) {
                irradiance[place] = lit;
            }
        }
    }
    (irradiance, told.met)
}

/// The same by one sample each, at several spots of some places. `runs`: of every spot its place, and which of the place's samples.
pub fn irradiance_around(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    spots: &[Place],
    runs: &[(usize, u32)],
    footprint: f32,
    seed: u64,
) -> (Vec<Vec3>, Vec<Met>) {
    let samples = Samples::of_points(lights, light, spots.len(), 1, seed);
    let spot = |spot: usize| Some(spots[spot]);
    let (irradiance, told) = irradiance_by(scene, &samples, spots.len(), spot, footprint, |spot| runs[spot]);
    (irradiance, told.met)
}

/// Light that arrives at a place from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Incident {
    /// Of the place, on its geometric side, for its smooth normal, W/m².
    pub irradiance: Vec3,
    /// Unit, towards the light.
    pub direction: Vec3,
    /// To the light, m.
    pub distance: f32,
}

/// What arrives at some places, direction by direction.
#[derive(Clone, Debug)]
pub struct Arrivals {
    /// Place by place, as many each; their sum is the place's irradiance.
    pub directions: Vec<Incident>,
    /// How many of each place, one or more.
    pub each: usize,
    /// Whether no ray was cast, so that it is what would arrive if nothing were in the way.
    pub is_unoccluded: bool,
}

/// Irradiance of one light at the `wanted` of some places, by `samples` each; one of a light without extent. No ray is cast for lamps:
/// whoever knows the light around a place knows better what of a lamp it sees than some rays do, which a shadow's edge switches.
pub fn incident_at(
    scene: &TracedScene,
    lights: &LightSet,
    light: usize,
    hits: &[Option<SurfaceHit>],
    wanted: &[u32],
    footprint: f32,
    samples: u32,
    seed: u64,
) -> Arrivals {
    let one = Samples::of_points(lights, light, hits.len(), 1, seed);
    let each = one.of_each(samples).count;
    let runs: Vec<(usize, u32)> = (wanted.iter())
        .flat_map(|&place| (0..each).map(move |index| (place as usize, index)))
        .collect();
    let footprint = if one.is_delta() { footprint } else { 0.0 };
    let seen = (!lights.is_lamp(light)).then(|| {
        let own = |run: usize| hits[runs[run].0].as_ref().map(Place::from);
        irradiance_by(scene, &one, runs.len(), own, 0.0, |run| runs[run]).0
    });
    let dark = Incident {
        irradiance: Vec3::ZERO,
        direction: Vec3::Y,
        distance: f32::INFINITY,
    };
    let directions = (runs.par_iter().enumerate())
        .with_min_len(256)
        .map(|(run, &(place, index))| {
            let irradiance = |at: &Place, sample: &LightSample| match &seen {
                Some(seen) => seen[run],
                None => contribution(at, sample, footprint) * above(at, sample.direction),
            };
            let is_dark = seen.as_ref().is_some_and(|seen| seen[run] == Vec3::ZERO);
            let at = hits[place].as_ref().filter(|_| !is_dark).map(Place::from);
            let sample = at.and_then(|at| Some((at, one.at(place, &(&at.start).into(), index)?)));
            sample.map_or(dark, |(at, sample)| Incident {
                irradiance: irradiance(&at, &sample) / each as f32,
                direction: sample.direction,
                distance: sample.distance,
            })
        })
        .collect();
    Arrivals {
        directions,
        each: each.max(1) as usize,
        is_unoccluded: seen.is_none(),
    }
}

/// Places beside one another in their order, as points lie along a curve, that learn where a light is drawn from.
const NEIGHBOURS: usize = 1024;

/// Relative variance of a place's irradiance that is wanted where light is rare: indirect light averages some hundreds of places.
const VARIANCE: f32 = 0.25;

/// Most samples of such a place.
const MOST: u32 = 16;

/// Places that are lit again, by as many samples each.
struct Again<'a> {
    samples: Samples<'a>,
    places: Vec<usize>,
}

/// Those where light is rare.
fn rarely_lit<'a>(
    samples: &Samples<'a>,
    told: &Told,
    hits: &[Option<SurfaceHit>],
    irradiance: &[Vec3],
) -> Vec<Again<'a>> {
    let sum: f64 = irradiance.iter().map(|&e| f64::from(luminance(e))).sum();
    let dark = 0.1 * (sum / irradiance.len().max(1) as f64) as f32;
    // Of each run of places those that face one way.
    let mut neighbours = vec![Vec::new(); WAYS * hits.len().div_ceil(NEIGHBOURS)];
    let mut of_place = vec![0; hits.len()];
    for (place, hit) in hits.iter().enumerate() {
        if let Some(hit) = hit {
            let own = WAYS * (place / NEIGHBOURS) + hit.way();
            of_place[place] = own as u32;
            neighbours[own].push(place);
        }
    }
    let rare: Vec<Option<Rare>> = (neighbours.par_iter())
        .map(|lit| Rare::found(samples, told, lit, |_| 1.0, dark))
        .collect();
    let mut by_count: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (lit, rare) in neighbours.iter().zip(&rare) {
        let Some(rare) = rare else { continue };
        let needed = (rare.variance / VARIANCE).ceil() as u32;
        let count = needed
            .clamp(samples.count, MOST.max(samples.count))
            .next_power_of_two();
        by_count.entry(count).or_default().extend(lit);
    }
    let guided = samples.guided(Guides {
        of_place,
        guides: rare.into_iter().map(|rare| rare.map(|rare| rare.guide)).collect(),
    });
    (by_count.into_iter())
        .map(|(count, places)| Again {
            samples: guided.of_each(count),
            places,
        })
        .collect()
}

/// Irradiance by these samples of `count` places; `run_of`: see [`crate::lighting::reflected_at`].
fn irradiance_by(
    scene: &TracedScene,
    samples: &Samples,
    count: usize,
    place: impl Fn(usize) -> Option<Place> + Sync,
    footprint: f32,
    run_of: impl Fn(usize) -> (usize, u32) + Sync,
) -> (Vec<Vec3>, Told) {
    if samples.is_delta() {
        let lamp = Lamp {
            scene,
            lights: samples.lights,
            light: samples.light,
            footprint,
        };
        let (out, met) = lamp.irradiance_at(count, place);
        return (
            out,
            Told {
                met,
                light: Vec::new(),
            },
        );
    }
    let is_above = |at: usize, direction: Vec3| place(at).is_some_and(|place| place.faces(direction));
    let contribution = |at: usize, sample: &LightSample| {
        place(at).map_or(Vec3::ZERO, |place| contribution(&place, sample, 0.0))
    };
    // A cosine is wider than what samples of a light miss.
    let reflection = Reflection {
        any: false,
        draw: |_: usize, _: [f32; 3]| None,
        density: |_: usize, _: Vec3| 0.0,
    };
    let mut out = vec![Vec3::ZERO; count];
    let told = add_light(
        scene,
        samples,
        |at| place(at).map(|place| place.start),
        run_of,
        is_above,
        contribution,
        &reflection,
        &mut out,
    );
    (out, told)
}

/// How much of a direction is on the side where both normals are: 0 below either horizon, 1 where the geometric normal is nearer to it.
fn above(place: &Place, direction: Vec3) -> f32 {
    let (smooth, geometric) = (place.normal.dot(direction), place.start.normal.dot(direction));
    match smooth > 0.0 && geometric > 0.0 {
        true => (geometric / smooth).min(1.0),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::DRAWN;
    use crate::test_scenes::{ball, level, matt, sky, traced};
    use relight_scene::light::LightKind;
    use relight_scene::light_set::{LightRig, NoEmitters};
    use relight_scene::rays::Ray;
    use relight_scene::surface::Surfaces;

    /// Truth: a globe of radius r at distance d lights a place that faces it by π r²/d² (Lambert's law of the sphere), whatever is between.
    #[test]
    fn what_arrives_of_a_globe_is_told_as_if_nothing_were_in_the_way() {
        let scene = traced(vec![level(1.0, 0.0, 0), level(1.0, 0.5, 0)], vec![matt(0.5, 0.0)]);
        let tracks = [ball(Vec3::Y, 0.1, Vec3::ONE)];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        let down = Ray::endless(0.3 * Vec3::Y, Vec3::NEG_Y);
        let hits = [scene.closest_hit(&down)];
        let arrivals = incident_at(&scene, &lights, 0, &hits, &[0], 0.0, 64, 1);
        assert!(arrivals.is_unoccluded);
        let sum: Vec3 = arrivals.directions.iter().map(|lit| lit.irradiance).sum();
        let truth = std::f32::consts::PI * 0.01;
        assert!((sum.x / truth - 1.0).abs() < 1e-3, "{sum} {truth}");
        assert_eq!(
            irradiance_at(&scene, &lights, 0, &hits, 0.0, 64, 1).0,
            [Vec3::ZERO]
        );
    }

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
            let (out, _) = irradiance_at(&scene, &lights, 0, &hits, 0.0, samples, 1);
            out.iter().map(|e| f64::from(e.x)).collect()
        };
        let LightKind::Environment { maps, .. } = &tracks[0].kind else {
            unreachable!("a sky is an environment")
        };
        let map = maps.at(0.0);
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
}
