//! Light with extent: where pixels side by side disagree about it, or hardly any sample finds it, more samples are cast.
//!
//! A pixel's samples are an estimate, whose error shows in the pixels around it: they see about the same light, by other
//! random numbers. How many samples a pixel needs is decided by those around it alone, never by its own, or pixels whose
//! samples happened to miss a lamp would be believed, and the image too dark. What is lit anew is lit at the ends of the
//! pixel's rays, so that edges of shadows are smooth, too.
//!
//! Of light that is rarely seen ([`crate::rare`]), pixels side by side mostly agree that there is none. There the samples of a
//! whole square of pixels decide, and teach where others are drawn.

use crate::exposure::{Exposure, Sighted};
use crate::guide::{Guide, Guides};
use crate::lighting::{Receivers, Told, reflected_at};
use crate::rare::Rare;
use crate::samples::Samples;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::environment::luminance;
use relight_scene::shading::ShadingPoint;
use relight_scene::traced::TracedScene;
use std::collections::BTreeMap;

/// Samples of a light with extent for which [`ERROR`] is wanted; with others it goes with the root of their number.
const USUAL_SAMPLES: f32 = 8.0;

/// Standard error of a pixel's light that is wanted, as a share of that light: 5 % in every pixel is a relMSE of 0.0025.
const ERROR: f32 = 0.05;

/// Most samples of a pixel; where all get many, [`MORE`] times as many.
const MOST: u32 = 128;
const MORE: u32 = 4;

/// Share of the image's mean light that counts as much as a pixel's own: what is darker need not be as exact. As the
/// measure relMSE has it.
const DARK: f32 = 0.1;

/// Cosine between normals above which two pixels see one surface.
pub(crate) const SAME_FACING: f32 = 0.97;

/// Fragments that are lit together: what they take stays in fast memory.
const TASK: usize = 64;

/// Pixels along each side of a square whose first samples teach where its others are drawn: some eight thousand of them.
const SQUARE: usize = 32;

/// Samples of each pixel of such a square by which it learns once more: what the first found a trace of, these find.
const SECOND: u32 = 16;

/// Lights the pixels anew that need more samples of a light with extent than the `samples` that made `reflected`: what each
/// fragment sends towards the eye. `told`: what those samples gave. Returns how many were cast.
pub fn refine(
    scene: &TracedScene,
    seen: &Exposure,
    samples: &Samples,
    told: &Told,
    reflected: &mut [Vec3],
) -> u64 {
    let shown = shown(seen, reflected);
    let needs = Needs::new(samples.count, &shown);
    let mut wanted = needs.by_neighbours(seen, &shown);
    let samples = needs.by_squares(scene, seen, samples, told, &mut wanted);
    let mut rays = 0;
    // Fragments that send as many to each of their ends are lit together.
    let mut groups: BTreeMap<u32, Vec<(usize, usize)>> = BTreeMap::new();
    for (pixel, &wanted) in wanted.iter().enumerate().filter(|(_, wanted)| **wanted > 0) {
        for f in seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some()) {
            // One sample at each of as many ends is better than several at fewer.
            let ends = seen.ends_for(f, wanted as f32).max(1);
            let own = (wanted as f32 * seen.coverage[f]).ceil() as u32;
            let of_end = own.div_ceil(ends as u32).max(1);
            groups.entry(of_end).or_default().push((f, ends));
            rays += ends as u64 * u64::from(of_end);
        }
    }
    for (of_end, fragments) in &groups {
        let samples = samples.of_each(*of_end);
        let lit: Vec<Vec3> = fragments
            .par_chunks(TASK)
            .flat_map_iter(|fragments| lit_at_ends(scene, seen, &samples, fragments))
            .collect();
        for (&(fragment, _), lit) in fragments.iter().zip(lit) {
            reflected[fragment] = lit;
        }
    }
    rays
}

/// Means over their rays' ends, the first so many of each, of what fragments send towards the eye of a light.
pub(crate) fn lit_at_ends(
    scene: &TracedScene,
    seen: &Exposure,
    samples: &Samples,
    fragments: &[(usize, usize)],
) -> Vec<Vec3> {
    let (mut hits, mut points, mut views) = (Vec::new(), Vec::new(), Vec::new());
    let mut starts = Vec::with_capacity(fragments.len());
    // Ends of a fragment share one sequence of samples, so that all of them together are evenly spread.
    let mut runs: Vec<(usize, u32)> = Vec::new();
    for &(f, ends) in fragments {
        starts.push(hits.len());
        for (k, Sighted { hit, point, view }) in (0..).zip(seen.sighted_first(scene, f, ends)) {
            hits.push(Some(hit));
            points.push(Some(point));
            views.push(view);
            runs.push((f, k * samples.count));
        }
    }
    let mut own = vec![Vec3::ZERO; hits.len()];
    let receivers = Receivers {
        hits: &hits,
        points: &points,
        views: &views,
    };
    reflected_at(scene, samples, &receivers, |end| runs[end], &mut own);
    let ends = starts.iter().skip(1).copied().chain([own.len()]);
    (starts.iter().zip(ends))
        .map(|(&start, end)| own[start..end].iter().sum::<Vec3>() / (end - start).max(1) as f32)
        .collect()
}

/// What a pixel shows those around it: its largest fragment, and the light there, over what the surface reflects.
#[derive(Clone, Copy)]
struct Shown {
    fragment: usize,
    light: f32,
}

/// What all pixels show; `None`: nothing.
fn shown(seen: &Exposure, reflected: &[Vec3]) -> Vec<Option<Shown>> {
    (0..seen.width * seen.height)
        .into_par_iter()
        .with_min_len(1024)
        .map(|pixel| shown_by(seen, pixel, reflected))
        .collect()
}

/// How many samples are needed for some variance.
struct Needs {
    /// Samples that pixels had.
    count: u32,
    /// Square of the wanted standard error, as a share of the light.
    error: f32,
    /// Light below which errors need not be as small.
    dark: f32,
}

impl Needs {
    fn new(count: u32, shown: &[Option<Shown>]) -> Needs {
        let (sum, shining) = (shown.iter().flatten()).fold((0.0, 0), |(sum, count), shown| {
            (sum + f64::from(shown.light), count + 1)
        });
        Needs {
            count,
            error: ERROR * ERROR * USUAL_SAMPLES / count as f32,
            dark: DARK * (sum / f64::from(shining.max(1))) as f32,
        }
    }

    /// Samples for a pixel whose light has so much variance, over the square of the light; 0 where those that it had will do.
    fn of_variance(&self, relative: f32) -> u32 {
        if relative > self.error {
            let needed = self.count as f32 * relative / self.error;
            (needed.ceil() as u32).min(MOST.max(self.count.saturating_mul(MORE)))
        } else {
            0
        }
    }

    /// Samples that each pixel needs by what those around it disagree.
    fn by_neighbours(&self, seen: &Exposure, shown: &[Option<Shown>]) -> Vec<u32> {
        let (width, height) = (seen.width, seen.height);
        (0..width * height)
            .into_par_iter()
            .with_min_len(1024)
            .map(|pixel| {
                if shown[pixel].is_none() {
                    return 0;
                }
                let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
                let at = |(dx, dy): (isize, isize)| {
                    let (x, y) = (x + dx, y + dy);
                    let inside = x >= 0 && y >= 0 && x < width as isize && y < height as isize;
                    inside.then(|| shown[y as usize * width + x as usize]).flatten()
                };
                self.of_variance(disagreement(seen, &AROUND.map(at), self.dark))
            })
            .collect()
    }

    /// Raises what is wanted in squares of pixels where light is rare; returns samples that are drawn there by what two rounds of
    /// others taught.
    fn by_squares<'a>(
        &self,
        scene: &TracedScene,
        seen: &Exposure,
        samples: &Samples<'a>,
        told: &Told,
        wanted: &mut [u32],
    ) -> Samples<'a> {
        let squares = Squares::of(seen);
        let scale = |f: usize| seen.points[f].as_ref().map_or(1.0, |point| 1.0 / albedo(point));
        let found: Vec<Option<Rare>> = (squares.fragments.par_iter())
            .map(|lit| Rare::found(samples, told, lit, scale, self.dark))
            .collect();
        if found.iter().all(Option::is_none) {
            return samples.clone();
        }
        let again = samples
            .guided(squares.guides(found.iter().map(rare_guide)))
            .of_each(SECOND)
            .told();
        let rare: Vec<Option<Rare>> = (found.into_par_iter().zip(&squares.fragments))
            .map(|(found, lit)| {
                let first = found?;
                let told = told_by(scene, seen, &again, lit);
                let second = Rare::learned(&again, &told, lit, |k| k, scale, self.dark);
                Some(second.unwrap_or(first))
            })
            .collect();
        for (pixel, wanted) in wanted.iter_mut().enumerate() {
            let lit = seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some());
            let rare = lit
                .filter_map(|f| rare.get(squares.of_fragment[f] as usize)?.as_ref())
                .map(|rare| self.of_variance(rare.variance / self.count as f32));
            if let Some(most) = rare.max() {
                *wanted = most;
            }
        }
        again.guided(squares.guides(rare.iter().map(rare_guide)))
    }
}

fn rare_guide(rare: &Option<Rare>) -> Option<Guide> {
    rare.as_ref().map(|rare| rare.guide.clone())
}

/// What samples give at some fragments.
fn told_by(scene: &TracedScene, seen: &Exposure, samples: &Samples, fragments: &[usize]) -> Told {
    let hits: Vec<_> = fragments.iter().map(|&f| seen.hits[f]).collect();
    let points: Vec<_> = fragments.iter().map(|&f| seen.points[f]).collect();
    let views: Vec<Vec3> = fragments.iter().map(|&f| -seen.directions[f]).collect();
    let receivers = Receivers {
        hits: &hits,
        points: &points,
        views: &views,
    };
    let mut lit = vec![Vec3::ZERO; fragments.len()];
    reflected_at(scene, samples, &receivers, |k| (fragments[k], 0), &mut lit)
}

/// Squares of pixels, each for every way that surfaces face and every material: the reveal of a window is far brighter than the wall
/// beside it, as is what is seen through the window.
struct Squares {
    /// Of each the fragments that can be lit.
    fragments: Vec<Vec<usize>>,
    /// Which of them each fragment is of, if it can be lit.
    of_fragment: Vec<u32>,
}

impl Squares {
    fn of(seen: &Exposure) -> Squares {
        let across = seen.width.div_ceil(SQUARE);
        let mut squares = Squares {
            fragments: Vec::new(),
            of_fragment: vec![0; seen.len()],
        };
        let mut numbers = BTreeMap::new();
        for pixel in 0..seen.width * seen.height {
            let (x, y) = (pixel % seen.width, pixel / seen.width);
            let square = y / SQUARE * across + x / SQUARE;
            for f in seen.fragments_of(pixel) {
                if let (Some(hit), Some(point)) = (&seen.hits[f], &seen.points[f]) {
                    let own = *numbers
                        .entry((square, hit.way(), point.material))
                        .or_insert_with(|| {
                            squares.fragments.push(Vec::new());
                            squares.fragments.len() - 1
                        });
                    squares.of_fragment[f] = own as u32;
                    squares.fragments[own].push(f);
                }
            }
        }
        squares
    }

    fn guides(&self, guides: impl Iterator<Item = Option<Guide>>) -> Guides {
        Guides {
            of_place: self.of_fragment.clone(),
            guides: guides.collect(),
        }
    }
}

fn albedo(point: &ShadingPoint) -> f32 {
    luminance(point.diffuse + point.f0).max(1e-3)
}

/// The pixels around one, one beside the other.
const AROUND: [(isize, isize); 8] = [
    (-1, -1),
    (0, -1),
    (1, -1),
    (1, 0),
    (1, 1),
    (0, 1),
    (-1, 1),
    (-1, 0),
];

/// Variance of one of these pixels' light, over the square of their mean: from pairs side by side that see one surface. Squares are of f64:
/// those of very faint and very strong lights are none in f32.
fn disagreement(seen: &Exposure, around: &[Option<Shown>; 8], dark: f32) -> f32 {
    let (mut squares, mut pairs, mut sum) = (0.0f64, 0.0f64, 0.0f64);
    for (k, first) in around.iter().enumerate() {
        let (Some(first), Some(second)) = (first, &around[(k + 1) % 8]) else {
            continue;
        };
        let surface = |shown: &Shown| seen.hits[shown.fragment].zip(seen.points[shown.fragment]);
        let (Some((hit, point)), Some((other, beside))) = (surface(first), surface(second)) else {
            continue;
        };
        if point.material == beside.material && hit.normal.dot(other.normal) > SAME_FACING {
            let (first, second) = (f64::from(first.light), f64::from(second.light));
            squares += 0.5 * (first - second).powi(2);
            sum += 0.5 * (first + second);
            pairs += 1.0;
        }
    }
    if pairs == 0.0 {
        return 0.0;
    }
    let mean = sum / pairs;
    let against = mean * mean + f64::from(dark).powi(2);
    // Nothing shines.
    if against > 0.0 {
        (squares / pairs / against) as f32
    } else {
        0.0
    }
}

fn shown_by(seen: &Exposure, pixel: usize, reflected: &[Vec3]) -> Option<Shown> {
    let lit = seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some());
    let fragment = lit.max_by(|&a, &b| seen.coverage[a].total_cmp(&seen.coverage[b]))?;
    let point = seen.points[fragment].as_ref()?;
    let light = luminance(reflected[fragment]) / albedo(point);
    light.is_finite().then_some(Shown { fragment, light })
}

#[cfg(test)]
mod tests;
