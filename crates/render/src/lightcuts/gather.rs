//! Direct light of many lights at given places: points of the basis and fragments of a shot.
//!
//! The twin of [`crate::lighting`] for frames with so many lights that a shadow ray for each costs more than a cut
//! ([`worthwhile`]).

use super::cut::Cut;
use super::lit::{LightcutSettings, Lit, Receiver};
use super::sights::Sights;
use super::{LightcutStats, trees};
use crate::lighting::Receivers;
use crate::many_lights::{PointLights, PointSettings};
use crate::sum::Total;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::light_set::{LightForm, LightSet};
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::light_clusters::LightClusters;
use std::f32::consts::PI;

/// Shadow rays per place that lights would take one by one, above which lightcuts take less time (docs/notebook/lightcuts.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Crossover(u64);

/// At points of the basis, whose cuts have no limit on uncertainty.
pub const AT_POINTS: Crossover = Crossover(350);
/// At pixels.
pub const AT_PIXELS: Crossover = Crossover(400);

/// Whether a place would send more shadow rays to the lights themselves, `samples` to each with extent, than are worth
/// it.
pub fn worthwhile(lights: &LightSet<'_>, samples: u32, crossover: Crossover) -> bool {
    let shines = |light: Vec3| u64::from(light != Vec3::ZERO);
    let rays = |light: usize| match lights.form(light) {
        LightForm::Dark => 0,
        LightForm::Profile { scale, .. } => shines(scale),
        LightForm::Point { intensity, .. } | LightForm::Spot { intensity, .. } => shines(intensity),
        LightForm::Directional { irradiance, .. } => shines(irradiance),
        _ => u64::from(samples),
    };
    (0..lights.len()).map(rays).sum::<u64>() > crossover.0
}

/// Places per parallel task.
const CHUNK: usize = 64;

/// The lights of a frame as points, and trees over them.
#[derive(Debug)]
pub struct ManyLights {
    points: PointLights,
    clusters: LightClusters,
}

impl ManyLights {
    /// All lights of a frame.
    pub fn new(scene: &TracedScene, lights: &LightSet<'_>, seed: u64) -> ManyLights {
        let settings = PointSettings {
            seed,
            ..PointSettings::default()
        };
        let points = PointLights::new(scene, lights, &settings);
        let clusters = trees(scene, &points, None, false, seed);
        ManyLights { points, clusters }
    }

    /// Number of lights without extent.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Irradiance on the geometric side of each place, for its smooth normal: as [`crate::irradiance::irradiance_at`],
    /// `footprint` included.
    pub fn irradiance_at(
        &self,
        scene: &TracedScene,
        hits: &[Option<SurfaceHit>],
        footprint: f32,
    ) -> (Vec<Vec3>, LightcutStats) {
        // Without a limit on uncertainty, as in the paper: a sender averages some hundreds of points.
        let settings = LightcutSettings {
            uncertainty: f32::INFINITY,
            ..LightcutSettings::default()
        };
        self.gather(scene, &settings, hits.len(), |place, light| {
            let hit = hits[place].as_ref()?;
            // Reflects its irradiance as it is: ρ/π = 1.
            let point = ShadingPoint::lambert(hit, Vec3::splat(PI));
            let receiver = Receiver::new(hit, &point, hit.normal).standing_for(footprint);
            Some(light(&receiver))
        })
    }

    /// Radiance that each shading point sends towards its viewer after one reflection: as
    /// [`crate::lighting::reflected_at`].
    pub fn reflected_at(&self, scene: &TracedScene, receivers: &Receivers) -> (Vec<Vec3>, LightcutStats) {
        let Receivers { hits, points, views } = *receivers;
        self.gather(scene, &LightcutSettings::default(), hits.len(), |place, light| {
            let (hit, point) = (hits[place].as_ref()?, points[place].as_ref()?);
            Some(light(&Receiver::new(hit, point, views[place])))
        })
    }

    /// Calls `at(place, light)` for every place; `light` is what cuts give a receiver.
    fn gather(
        &self,
        scene: &TracedScene,
        settings: &LightcutSettings,
        places: usize,
        at: impl Fn(usize, &mut dyn FnMut(&Receiver<'_>) -> Vec3) -> Option<Vec3> + Sync,
    ) -> (Vec<Vec3>, LightcutStats) {
        let lit = Lit {
            scene,
            points: &self.points,
            clusters: &self.clusters,
            settings: *settings,
        };
        let mut out = vec![Vec3::ZERO; places];
        let total = Total::<LightcutStats>::default();
        (out.par_chunks_mut(CHUNK).enumerate()).for_each_init(Cut::default, |cut, (chunk, out)| {
            let mut stats = LightcutStats::default();
            let mut sights = Sights::default();
            for (local, out) in out.iter_mut().enumerate() {
                let mut light = |receiver: &Receiver<'_>| {
                    sights.begin(&lit, std::iter::once(receiver.hit));
                    cut.choose(&lit, receiver, &mut sights, &mut stats.shadow_rays);
                    stats.count(cut, &lit);
                    cut.total.as_vec3()
                };
                *out = at(chunk * CHUNK + local, &mut light).unwrap_or(Vec3::ZERO);
            }
            total.add(stats);
        });
        (out, total.sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::irradiance;
    use crate::test_scenes::{bulb, level, light, matt, room, traced};
    use relight_scene::animated::Animated;
    use relight_scene::light::LightKind;
    use relight_scene::light_set::{LightRig, SceneEmitters};
    use relight_scene::rays::Ray;
    use relight_scene::surface::Surfaces;
    use relight_transport::random::Stream;

    /// The box from −1 to 1 with a table in it, and places all over both.
    fn furnished() -> (TracedScene, Vec<Option<SurfaceHit>>) {
        let scene = traced(vec![room(0), level(0.5, -0.2, 0)], vec![matt(0.5, 0.0)]);
        let mut s = Stream::new(3, 0, 0);
        let mut between = || Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 1.8 - 0.9;
        let places = (0..400)
            .map(|_| {
                let origin = between();
                scene.closest_hit(&Ray::endless(origin, (between() - origin).normalize()))
            })
            .collect();
        (scene, places)
    }

    fn irradiance_one_by_one(
        scene: &TracedScene,
        lights: &LightSet<'_>,
        places: &[Option<SurfaceHit>],
        footprint: f32,
    ) -> Vec<Vec3> {
        let mut sum = vec![Vec3::ZERO; places.len()];
        for light in 0..lights.len() {
            let (own, _) = irradiance::irradiance_at(scene, lights, light, places, footprint, 1, 0);
            sum.iter_mut().zip(&own).for_each(|(s, o)| *s += *o);
        }
        sum
    }

    /// Truth: a shadow ray for each lamp. Every node of a cut may err by 2 % of the light; the paper finds that all
    /// together hardly err by more. Some lamps hang within a footprint of the walls.
    #[test]
    fn five_hundred_lamps_light_every_place_as_one_by_one_but_for_a_few_percent() {
        let (scene, places) = furnished();
        let mut s = Stream::new(4, 0, 0);
        let tracks: Vec<_> = (0..500)
            .map(|_| {
                let position = Vec3::new(s.uniform(), s.uniform(), s.uniform()) * 1.99 - 0.995;
                bulb(position, 0.1 + s.uniform())
            })
            .collect();
        let emitters = SceneEmitters::new(&scene);
        let rig = LightRig::new(&emitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        assert!(worthwhile(&lights, 1, AT_POINTS));
        for footprint in [0.0, 0.01] {
            let truth = irradiance_one_by_one(&scene, &lights, &places, footprint);
            let (found, stats) =
                ManyLights::new(&scene, &lights, 1).irradiance_at(&scene, &places, footprint);
            assert!(stats.nodes < 300 * stats.cuts, "cuts, not all lights: {stats:?}");
            let mut within = 0;
            let (mut found_sum, mut truth_sum) = (0.0, 0.0);
            for (found, truth) in found.iter().zip(&truth) {
                within += usize::from((*found - *truth).abs().max_element() <= 0.05 * truth.max_element());
                found_sum += f64::from(found.element_sum());
                truth_sum += f64::from(truth.element_sum());
            }
            assert!(within >= places.len() * 95 / 100, "{within} of {}", places.len());
            assert!(
                (found_sum / truth_sum - 1.0).abs() < 0.01,
                "{found_sum} {truth_sum}"
            );
        }
    }

    #[test]
    fn few_lamps_among_many_dark_ones_are_not_worth_a_cut() {
        let (scene, _) = furnished();
        let dark = LightKind::Point {
            position: Animated::Constant(Vec3::ZERO),
            intensity: Animated::Constant(Vec3::ZERO),
        };
        let tracks: Vec<_> = (0..1000)
            .map(|i| {
                if i < AT_POINTS.0 as usize {
                    bulb(Vec3::ZERO, 1.0)
                } else {
                    light("dark", dark.clone())
                }
            })
            .collect();
        let emitters = SceneEmitters::new(&scene);
        let count = |lamps: &[_]| {
            let rig = LightRig::new(&emitters, lamps).unwrap();
            worthwhile(&rig.at(0.0), 8, AT_POINTS)
        };
        assert!(!count(&tracks));
        let shining = &tracks[..AT_POINTS.0 as usize];
        assert!(count(&[shining, &tracks[..1]].concat()), "one more");
    }
}
