//! Smooth edges of shadows: direct light is found once per fragment, and where it ends between two pixels or within one,
//! again at several of the fragment's rays.
//!
//! A fragment is lit at one place, so an edge of a shadow would follow the pixels' borders in steps. An edge can only
//! cross a fragment if light is occluded from it or one of its neighbours, and not from all of them; those few are lit anew, so
//! that a frame costs hardly more. So are those around which light of a lamp without extent changes steeply: what is right at one place of a pixel
//! under a lamp that all but touches the floor is wrong by a factor in the mean.

use crate::exposure::Exposure;
use crate::fragments::ENDS;
use crate::lighting::{DARK, LIT, Met};
use crate::refine::{SAME_FACING, lit_at_ends};
use crate::samples::Samples;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::shading::ShadingPoint;
use relight_scene::traced::TracedScene;

/// Fragments that are lit together: what they take stays in fast memory.
const TASK: usize = 64;

/// How many times as bright as the next a pixel may be without more places of it being lit. Of light that goes on so, by e^g from pixel to
/// pixel, the mean over a pixel is 1 + g²/24 times its middle's: 1 % more at g = 0.5.
const STEEP: f32 = 1.65;

/// Lights the fragments anew that an edge of a light's shadows may cross. `reflected`: what each sends towards the eye of it; `met`:
/// what its samples met on their way there.
pub fn smooth(scene: &TracedScene, seen: &Exposure, samples: &Samples, met: &[Met], reflected: &mut [Vec3]) {
    // A light without extent has one sample at each end: a pixel has few that count.
    let of_pixel = if samples.is_delta() { ENDS } else { f32::INFINITY };
    // Of lights with extent `refine` sees to it.
    let is_steep = |pixel: usize, other: usize| samples.is_delta() && steep(seen, reflected, pixel, other);
    let crossed = crossed(seen, met, of_pixel, is_steep);
    let lit: Vec<Vec3> = crossed
        .par_chunks(TASK)
        .flat_map_iter(|fragments| lit_at_ends(scene, seen, samples, fragments))
        .collect();
    for ((fragment, _), lit) in crossed.into_iter().zip(lit) {
        reflected[fragment] = lit;
    }
}

/// Whether light on one surface changes steeply from a pixel to another.
fn steep(seen: &Exposure, reflected: &[Vec3], pixel: usize, other: usize) -> bool {
    let [f, g] = [pixel, other].map(|pixel| seen.fragments_of(pixel).start);
    let [a, b] = [f, g].map(|f| reflected.get(f).map_or(0.0, |light| light.max_element()));
    let is_steep = |a: f32, b: f32| a.max(b) > STEEP * a.min(b);
    // First what few pass: surfaces are looked up for those alone.
    if !is_steep(a, b) {
        return false;
    }
    let (Some(Some(p)), Some(Some(q))) = (seen.points.get(f), seen.points.get(g)) else {
        return false;
    };
    let albedo = |point: &ShadingPoint| (point.diffuse + point.f0).max_element().max(f32::MIN_POSITIVE);
    is_steep(a / albedo(p), b / albedo(q)) && p.material == q.material && p.normal.dot(q.normal) > SAME_FACING
}

/// The fragments of pixels that are lit beside such that are not, and the other way round, or beside such that are lit otherwise
/// (`is_steep(pixel, other)`), if several of their ends can tell more than they have told, each with how many those are.
fn crossed(
    seen: &Exposure,
    met: &[Met],
    of_pixel: f32,
    is_steep: impl Fn(usize, usize) -> bool + Sync,
) -> Vec<(usize, usize)> {
    let (width, height) = (seen.width, seen.height);
    let pixels: Vec<Met> = (0..width * height)
        .into_par_iter()
        .with_min_len(1024)
        .map(|pixel| {
            let of = |f: usize| match (seen.hits[f].is_some(), met[f]) {
                (false, _) => 0,
                // It faces away.
                (true, 0) => DARK,
                (true, met) => met,
            };
            seen.fragments_of(pixel).fold(0, |all, f| all | of(f))
        })
        .collect();
    (0..width * height)
        .into_par_iter()
        .with_min_len(1024)
        .flat_map_iter(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            let beside = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                (y > 0).then(|| pixel - width),
                (y + 1 < height).then_some(pixel + width),
            ];
            let around = (beside.into_iter().flatten()).fold(pixels[pixel], |all, other| all | pixels[other]);
            let is_crossed =
                around == LIT | DARK || (beside.into_iter().flatten()).any(|other| is_steep(pixel, other));
            seen.fragments_of(pixel)
                .map(move |f| (f, seen.ends_for(f, of_pixel)))
                .filter(move |&(_, ends)| is_crossed && ends > 1)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expose::expose;
    use crate::lighting::{Receivers, own_run, reflected_at};
    use crate::test_scenes::{bulb, camera, level, matt, panel, sun, traced};
    use relight_scene::light_set::{LightRig, NoEmitters};

    const SIZE: usize = 24;

    /// A floor under a square of half width 1 at height 1; the light travels along (0.3, −1, 0.1), so that the square's
    /// shadow is x from −0.7 to 1.3, z from −0.9 to 1.1. Returns each pixel's light over that of a lit one, and the part of the pixel that is
    /// lit by the shadow's outline.
    fn lit_and_expected(samples: u32) -> Vec<(f32, f32)> {
        let scene = traced(vec![level(8.0, 0.0, 0), level(1.0, 1.0, 0)], vec![matt(0.5, 0.0)]);
        let tracks = [sun()];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        // From the side, turned a little so that no edge follows the pixels.
        let eye = camera(Vec3::new(4.0, 2.0, 1.0), Vec3::new(1.4, 0.0, 0.15), 25.0);
        let seen = expose(&scene, &eye, SIZE, SIZE, samples);
        let views = seen.views();
        let mut out = vec![Vec3::ZERO; seen.len()];
        let samples = Samples::of_pixels(&lights, 0, seen.len(), 1, 0);
        let receivers = Receivers::of(&seen, &views);
        let met = reflected_at(&scene, &samples, &receivers, own_run, &mut out).met;
        let full = out.iter().map(|v| v.x).fold(0.0, f32::max);
        smooth(&scene, &seen, &samples, &met, &mut out);
        let found = seen.resolve(&out);
        (0..SIZE * SIZE)
            .map(|pixel| {
                let parts = 32;
                let at = |k: usize| ((k % SIZE) as f32, (k / SIZE) as f32);
                let (x, y) = at(pixel);
                let lit = (0..parts * parts).filter(|k| {
                    let inside = |i: usize| (i as f32 + 0.5) / parts as f32;
                    let place = glam::Vec2::new(x + inside(k % parts), y + inside(k / parts));
                    let toward = eye.direction(place, glam::Vec2::splat(SIZE as f32));
                    let on_floor = eye.position - toward * (eye.position.y / toward.y);
                    !(-0.7..=1.3).contains(&on_floor.x) || !(-0.9..=1.1).contains(&on_floor.z)
                });
                (found[pixel].x / full, lit.count() as f32 / (parts * parts) as f32)
            })
            .collect()
    }

    fn worst_and_root_mean_square(samples: u32) -> (f32, f32) {
        let errors: Vec<f32> = (lit_and_expected(samples).iter())
            .filter(|(_, expected)| (0.001..0.999).contains(expected))
            .map(|(found, expected)| (found - expected).abs())
            .collect();
        assert!(errors.len() > SIZE, "an edge crosses the image");
        let squares: f32 = errors.iter().map(|e| e * e).sum();
        let worst = errors.iter().copied().fold(0.0, f32::max);
        (worst, (squares / errors.len() as f32).sqrt())
    }

    /// Truth: the outline of a square's shadow. A pixel that is lit or not as a whole errs by up to a half, by 0.29 in the
    /// mean of squares (the deviation of an even distribution); six places by up to two of them, and by a quarter of that.
    #[test]
    fn a_pixel_on_a_shadows_edge_is_lit_in_part() {
        let (worst, mean) = worst_and_root_mean_square(1);
        assert!(worst > 0.4 && mean > 0.2, "{worst} {mean}");
        let (worst, mean) = worst_and_root_mean_square(16);
        assert!(worst < 0.34 && mean < 0.12, "{worst} {mean}");
    }

    /// Truth: irradiance I cos θ/d² of a lamp a third of a pixel's width above the floor, over a grid of 64 × 64 places a pixel. One place of
    /// a pixel may get many times its mean: all light errs by more than a fifth. Six are off by less than an eighth.
    #[test]
    fn a_pixel_under_a_lamp_that_all_but_touches_the_floor_gets_the_mean() {
        let scene = traced(vec![level(8.0, 0.0, 0)], vec![matt(0.5, 0.0)]);
        let eye = camera(Vec3::new(0.0, 10.0, 0.0), Vec3::new(0.003, 0.0, 0.001), 30.0);
        let pixel = 2.0 * 10.0 * 15f32.to_radians().tan() / SIZE as f32;
        let height = pixel / 3.0;
        let (mut worst, mut worst_before) = (0.0f32, 0.0f32);
        for k in 0..8 {
            let at = Vec3::new(0.37 * pixel * k as f32, height, -0.23 * pixel * k as f32);
            let tracks = [bulb(at, 1.0)];
            let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
            let lights = rig.at(0.0);
            let seen = expose(&scene, &eye, SIZE, SIZE, 16);
            let views = seen.views();
            let mut out = vec![Vec3::ZERO; seen.len()];
            let samples = Samples::of_pixels(&lights, 0, seen.len(), 1, 0);
            let receivers = Receivers::of(&seen, &views);
            let met = reflected_at(&scene, &samples, &receivers, own_run, &mut out).met;
            let total =
                |out: &[Vec3]| seen.resolve(out).iter().map(|v| v.x).sum::<f32>() / (SIZE * SIZE) as f32;
            let before = total(&out);
            smooth(&scene, &seen, &samples, &met, &mut out);
            let parts = 64 * SIZE;
            let sum: f64 = (0..parts * parts)
                .map(|i| {
                    let along = |i: usize| (i as f32 + 0.5) / 64.0;
                    let toward = eye.direction(
                        glam::Vec2::new(along(i % parts), along(i / parts)),
                        glam::Vec2::splat(SIZE as f32),
                    );
                    let from = at - (eye.position - toward * (eye.position.y / toward.y));
                    f64::from(0.5 * std::f32::consts::FRAC_1_PI * from.y / from.length().powi(3))
                })
                .sum();
            let truth = (sum / (parts * parts) as f64) as f32;
            worst = worst.max((total(&out) / truth - 1.0).abs());
            worst_before = worst_before.max((before / truth - 1.0).abs());
        }
        assert!(worst_before > 0.2 && worst < 0.12, "{worst_before} {worst}");
    }

    /// Truth: 1,024 samples at every end. Eight samples at one place of a penumbra err by the spread of a share between 0 and
    /// 1, some 0.35 over the root of 8; eight at each of a pixel's six ends, one sequence, by less than half of that.
    #[test]
    fn a_lamps_penumbra_is_smoother_for_several_ends() {
        let scene = traced(vec![level(8.0, 0.0, 0), level(0.4, 0.5, 0)], vec![matt(0.5, 0.0)]);
        let tracks = [panel()];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        let eye = camera(Vec3::new(3.0, 2.5, 1.0), Vec3::new(0.0, 0.0, 0.1), 40.0);
        let seen = expose(&scene, &eye, SIZE, SIZE, 16);
        let views = seen.views();
        let receivers = Receivers::of(&seen, &views);
        let lit = |samples: u32| {
            let samples = Samples::of_pixels(&lights, 0, seen.len(), samples, 0);
            let mut out = vec![Vec3::ZERO; seen.len()];
            let met = reflected_at(&scene, &samples, &receivers, own_run, &mut out).met;
            let rough = out.clone();
            smooth(&scene, &seen, &samples, &met, &mut out);
            (met, rough, out)
        };
        let (met, rough, smoothed) = lit(8);
        let (.., truth) = lit(1024);
        let penumbra: Vec<usize> = (0..seen.len()).filter(|&f| met[f] == LIT | DARK).collect();
        assert!(penumbra.len() > SIZE, "{}", penumbra.len());
        let error = |found: &[Vec3]| {
            let squares: f32 = penumbra
                .iter()
                .map(|&f| (found[f] - truth[f]).length_squared())
                .sum();
            squares.sqrt()
        };
        let (before, after) = (error(&rough), error(&smoothed));
        assert!(after > 0.0 && after < 0.5 * before, "{after} of {before}");
    }
}
