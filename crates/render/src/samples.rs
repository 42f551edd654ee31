//! Random samples of one light for many places.

use crate::guide::{Guide, Guides};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::light_set::{LightSample, LightSet, ReferencePoint};
use relight_transport::random::Stream;
use relight_transport::sampling::r2;
use std::sync::Arc;

/// Stage numbers of the random streams.
const STAGE_POINTS: u32 = 0x10;
const STAGE_PIXELS: u32 = 0x11;
/// Added to a stage: its rays drawn by the reflection.
const STAGE_REFLECTED: u32 = 0x02;
/// Added to a stage: what is drawn by what its first samples told, which must not be the same again.
const STAGE_GUIDED: u32 = 0x04;

/// The `index`-th random triple of a place: evenly spread over a place's samples, shifted from place to place.
fn random_triple(stage: u32, seed: u64, place: usize, salt: u32, index: u32) -> [f32; 3] {
    let mut stream = random_stream(stage, seed, place, salt);
    let start = Vec2::new(stream.uniform(), stream.uniform());
    let point = r2(index, start);
    // The third number picks a triangle or the sun: the golden ratio's own sequence.
    let third = (f64::from(stream.uniform()) + f64::from(index) * 0.618_033_988_749_894_8).fract();
    [point.x, point.y, third as f32]
}

fn random_stream(stage: u32, seed: u64, place: usize, salt: u32) -> Stream {
    Stream::new(seed, stage ^ (salt << 8), place as u64)
}

/// Tells lights' random numbers apart. By the name, so that a light has the same noise whichever others there are: alone, as a
/// layer, and among all, which then add up (FNV-1a).
fn salt_of(name: &str) -> u32 {
    (name.bytes()).fold(0x811c_9dc5, |hash: u32, byte| {
        (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193)
    })
}

/// Samples that are drawn beforehand of a light that comes from all around. A map's bright part of some hundred
/// pixels has each of them some dozens of times.
pub(crate) const DRAWN: usize = 1 << 14;

/// Samples of one light for many places.
#[derive(Clone)]
pub struct Samples<'a> {
    pub(crate) lights: &'a LightSet<'a>,
    pub(crate) light: usize,
    /// Samples of each place: one for lights without extent.
    pub count: u32,
    stage: u32,
    seed: u64,
    salt: u32,
    /// What is drawn once for all places: each takes a run of its own of the sequence, which is evenly spread like all runs
    /// of it. Drawing from a map costs more than a shadow ray.
    drawn: Arc<[Option<LightSample>]>,
    /// Where each place's light is drawn from.
    guides: Option<Arc<Guides>>,
    /// Whether what each sample gives is told ([`crate::lighting::Told`]).
    pub(crate) is_told: bool,
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

    /// So many for each place, of which nothing is told; one of lights without extent.
    pub fn of_each(&self, samples: u32) -> Samples<'a> {
        let count = if self.is_delta() { 1 } else { samples.max(1) };
        Samples {
            count,
            is_told: false,
            ..self.clone()
        }
    }

    /// Whether the light has no extent.
    pub fn is_delta(&self) -> bool {
        self.lights.is_delta(self.light)
    }

    /// The same for points of the basis.
    pub(crate) fn of_points(
        lights: &'a LightSet<'a>,
        light: usize,
        places: usize,
        samples: u32,
        seed: u64,
    ) -> Samples<'a> {
        Samples::new(lights, light, places, samples, STAGE_POINTS, seed)
    }

    /// The same, and what each gives is told.
    pub fn told(self) -> Samples<'a> {
        Samples {
            is_told: true,
            ..self
        }
    }

    /// Others of the light, drawn where these were told to be worth it.
    pub(crate) fn guided(&self, guides: Guides) -> Samples<'a> {
        Samples {
            stage: self.stage + STAGE_GUIDED,
            guides: Some(Arc::new(guides)),
            ..self.clone()
        }
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
        let salt = salt_of(lights.name(light));
        let drawn = if lights.is_distant(light) && worthwhile {
            (0..DRAWN)
                .into_par_iter()
                .map(|index| random_triple(stage, seed, 0, salt, index as u32))
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
            salt,
            drawn,
            guides: None,
            is_told: false,
        }
        .of_each(samples)
    }

    /// The `index`-th sample of a place, which lies `at`.
    pub(crate) fn at(&self, place: usize, at: &ReferencePoint, index: u32) -> Option<LightSample> {
        if self.is_delta() {
            return self.lights.sample(self.light, *at, [0.0; 3]);
        }
        if !self.drawn.is_empty() && self.guide_of(place).is_none() {
            return self.drawn[self.drawn_of(place, index)];
        }
        let (random, density) = self.numbers(place, index);
        let sample = self.lights.sample(self.light, *at, random)?;
        Some(LightSample {
            radiance_over_pdf: sample.radiance_over_pdf / density,
            ..sample
        })
    }

    /// Numbers by which the `index`-th sample of a place is drawn, and their density.
    pub(crate) fn numbers(&self, place: usize, index: u32) -> ([f32; 3], f32) {
        let of = |place, index| random_triple(self.stage, self.seed, place, self.salt, index);
        match self.guide_of(place) {
            Some(guide) => guide.at(of(place, index)),
            None if self.drawn.is_empty() => (of(place, index), 1.0),
            None => (of(0, self.drawn_of(place, index) as u32), 1.0),
        }
    }

    fn guide_of(&self, place: usize) -> Option<&Guide> {
        self.guides.as_ref()?.of(place)
    }

    /// Numbers for the `index`-th of a place's rays drawn by the reflection.
    pub(crate) fn of_reflection(&self, place: usize, index: u32) -> [f32; 3] {
        random_triple(self.stage + STAGE_REFLECTED, self.seed, place, self.salt, index)
    }

    /// Which of those that were drawn beforehand it is.
    fn drawn_of(&self, place: usize, index: u32) -> usize {
        let mut stream = random_stream(self.stage, self.seed, place, self.salt);
        let start = (stream.uniform() * DRAWN as f32) as usize;
        (start + index as usize) % DRAWN
    }
}
