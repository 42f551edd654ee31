//! Neighbourhoods in which a light is rarely seen: which they are, and what their samples teach.

use crate::guide::{Guide, Lesson};
use crate::lighting::Told;
use crate::samples::Samples;

/// Variance of a place's light, over the square of its neighbourhood's, above which light is rare: with eight samples a place, it comes from less
/// than a ninth of what is drawn, and places beside one another may agree that there is none. Drawn more often, but without its
/// even spread, light is hardly less noisy than before.
const RARE: f64 = 1.0;

/// What was learned where most samples were in vain.
#[derive(Clone, Debug)]
pub(crate) struct Rare {
    pub guide: Guide,
    /// Variance of a place's light by one sample that is drawn by the guide, over the square of the light.
    pub variance: f32,
}

impl Rare {
    /// From the samples of some places, whose light counts by their `scale`; `None` where light is not rare, or nothing is known
    /// of it. `dark`: light that counts as much as the places' own.
    pub fn found(
        samples: &Samples,
        told: &Told,
        places: &[usize],
        scale: impl Fn(usize) -> f32,
        dark: f32,
    ) -> Option<Rare> {
        let count = f64::from(samples.count);
        let (mut sum, mut within) = (0.0, 0.0);
        for &place in places {
            let (own, squares) = (told.of(place, samples.count).iter())
                .map(|&light| f64::from(scale(place) * light))
                .fold((0.0, 0.0), |(sum, squares), light| {
                    (sum + light, squares + light * light)
                });
            sum += own;
            within += squares - own * own / count;
        }
        let all = places.len() as f64 * count;
        // Of a place's mean, from the spread of each place's own samples.
        let variance = within / (all * (count - 1.0));
        let relative = variance / against(sum / all, dark);
        let is_rare = relative > RARE && relative.is_finite();
        is_rare.then(|| Rare::learned(samples, told, places, |k| places[k], scale, dark))?
    }

    /// The same, rare or not, from what was told of the places `told_of`, which are `places` in the samples' order.
    pub fn learned(
        samples: &Samples,
        told: &Told,
        places: &[usize],
        told_of: impl Fn(usize) -> usize,
        scale: impl Fn(usize) -> f32,
        dark: f32,
    ) -> Option<Rare> {
        let lessons_of = |(k, &place): (usize, &usize)| {
            let (own, scale) = (told.of(told_of(k), samples.count), scale(place));
            (0..).zip(own).map(move |(index, light)| {
                let (at, density) = samples.numbers(place, index);
                Lesson {
                    at,
                    density,
                    light: scale * light,
                }
            })
        };
        let mut lessons: Vec<Lesson> = places.iter().enumerate().flat_map(lessons_of).collect();
        let sum: f64 = lessons.iter().map(|l| f64::from(l.light)).sum();
        let mean = sum / lessons.len().max(1) as f64;
        let guide = Guide::learned(&mut lessons)?;
        let variance = (guide.variance / against(mean, dark)) as f32;
        Some(Rare { guide, variance })
    }
}

/// Square of the light that variances are compared with.
fn against(mean: f64, dark: f32) -> f64 {
    mean * mean + f64::from(dark) * f64::from(dark)
}
