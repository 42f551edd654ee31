//! Direct light at fragments, finest points and surface samples: light by light with shadow rays, or, of very many, by
//! lightcuts.

use super::parts::{EvenLight, Received};
use super::received::{Receiving, Starts};
use super::stats::{DirectLightcuts, FrameTimes, milliseconds};
use super::task::Task;
use crate::transfer::OverLobes;
use glam::Vec3;
use relight_render::lightcuts::{self, AT_PIXELS, AT_POINTS, ManyLights};
use relight_render::lighting::{self, Receivers, own_run};
use relight_render::samples::Samples;
use relight_render::sum::Sum;
use relight_render::{edges, refine};
use relight_scene::light_set::LightSet;
use std::time::Instant;

/// Of so many samples of a small lamp one is cast everywhere, and tells where edges of its shadows are near; all are cast there
/// (a quarter everywhere: a tenth more error, docs/notebook/cuts.md).
const FIRST: u32 = 2;

/// Sums over lights: radiance of fragments, irradiance of the others.
pub(super) struct Sums {
    pub direct: Sum,
    pub points: Option<Sum>,
    pub samples: Option<Sum>,
    /// Of few lights, so that f32 will do.
    pub over_lobes: Option<OverLobes>,
    /// Radiance of fragments over two lobes.
    pub at_ends: Option<Sum>,
}

impl Sums {
    /// Of no light yet.
    pub fn new(fragments: usize, starts: Starts) -> Sums {
        Sums {
            direct: Sum::Nothing(fragments),
            points: starts.points.map(|places| Sum::Nothing(places.points())),
            samples: starts.samples.map(|hits| Sum::Nothing(hits.len())),
            over_lobes: None,
            at_ends: None,
        }
    }

    /// Adds what a light lets arrive at the starts of indirect light, times its colour.
    pub fn add_received(&mut self, received: &Received, color: Vec3) {
        if let Some(part) = &received.over_lobes {
            let nothing = || OverLobes::nothing(part);
            self.over_lobes.get_or_insert_with(nothing).add(part, color);
        }
        for (sum, part) in [
            (&mut self.points, &received.points),
            (&mut self.samples, &received.samples),
        ] {
            if let (Some(sum), Some(part)) = (sum, part) {
                sum.add(part, color);
            }
        }
    }

    /// Adds light of even directions, times its colour.
    pub fn add_even(&mut self, even: &EvenLight, color: Vec3) {
        self.direct.add(&even.radiance, color);
        if let (Some(sum), Some(part)) = (&mut self.points, &even.irradiance) {
            sum.add(part, color);
        }
    }

    /// Radiance of the fragments, and what arrives where indirect light starts.
    pub fn rounded(self) -> (Vec<Vec3>, Received) {
        let received = Received {
            points: self.points.map(Sum::rounded),
            samples: self.samples.map(Sum::rounded),
            over_lobes: self.over_lobes,
            at_ends: self.at_ends.map(Sum::rounded),
        };
        (self.direct.rounded(), received)
    }
}

impl Task<'_> {
    /// What lights let arrive where indirect light starts.
    pub fn receiving(&self) -> Receiving<'_> {
        Receiving {
            prepared: self.prepared,
            settings: self.settings,
        }
    }

    /// What fragments reflect of one light. `by_cuts`: visibility cuts have taken what is wide of environments.
    pub fn reflected_of(&self, lights: &LightSet, light: usize, by_cuts: bool) -> Vec<Vec3> {
        let (scene, seen) = (&self.prepared.scene, &self.shot.seen);
        let mut reflected = vec![Vec3::ZERO; seen.len()];
        if lights.is_dark(light) {
            return reflected;
        }
        // Shadows of others are soft, mostly wider than a pixel. What cuts leave of an environment are its small lamps.
        let small = lights.is_delta(light) || (by_cuts && lights.is_distant(light));
        let most = self.settings.pixel_samples;
        let first = if small { most.div_ceil(FIRST) } else { most };
        let mut samples = Samples::of_pixels(lights, light, seen.len(), first, self.settings.seed);
        if !small {
            samples = samples.told();
        }
        let receivers = Receivers::of(seen, self.views);
        let told = lighting::reflected_at(scene, &samples, &receivers, own_run, &mut reflected);
        if small && !reflected.is_empty() {
            edges::smooth(scene, seen, &samples.of_each(most), &told.met, &mut reflected);
        } else if !small {
            refine::refine(scene, seen, &samples, &told, &mut reflected);
        }
        reflected
    }

    /// Adds the direct light of all lights by lightcuts at those kinds of places where lights are so many that these take less
    /// time.
    pub fn add_by_lightcuts(
        &self,
        starts: Starts,
        lights: &LightSet,
        sums: &mut Sums,
        times: &mut FrameTimes,
    ) -> ByLightcuts {
        let points = lightcuts::worthwhile(lights, self.settings.point_samples, AT_POINTS);
        let pixels = lightcuts::worthwhile(lights, self.settings.pixel_samples, AT_PIXELS);
        if !points && !pixels {
            return ByLightcuts::default();
        }
        let scene = &self.prepared.scene;
        let start = Instant::now();
        let many = ManyLights::new(scene, lights, self.settings.seed);
        let mut used = DirectLightcuts {
            lights: many.len(),
            ..DirectLightcuts::default()
        };
        if points {
            if let (Some(places), Some(sum)) = (starts.points, &mut sums.points) {
                let (irradiance, stats) = self.receiving().by_lightcuts(&many, places);
                sum.add(&irradiance, Vec3::ONE);
                used.points += stats;
            }
            if let (Some(hits), Some(sum)) = (starts.samples, &mut sums.samples) {
                let (irradiance, stats) = many.irradiance_at(scene, hits, 0.0);
                sum.add(&irradiance, Vec3::ONE);
                used.points += stats;
            }
        }
        times.direct_points += milliseconds(start);
        if pixels {
            let start = Instant::now();
            let (reflected, stats) = many.reflected_at(scene, &Receivers::of(&self.shot.seen, self.views));
            sums.direct.add(&reflected, Vec3::ONE);
            used.pixels = stats;
            times.direct_pixels += milliseconds(start);
        }
        ByLightcuts {
            points,
            pixels,
            used: Some(used),
        }
    }
}

/// What lightcuts have made.
#[derive(Clone, Copy, Default)]
pub(super) struct ByLightcuts {
    /// Irradiance where indirect light starts.
    pub points: bool,
    /// Direct light of the fragments.
    pub pixels: bool,
    pub used: Option<DirectLightcuts>,
}
