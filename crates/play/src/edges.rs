//! Smooth edges of shadows: direct light is found once per fragment, and where it ends between two pixels, again at
//! several of the fragment's rays.
//!
//! A fragment is lit at one place, so an edge of a shadow would follow the pixels' borders in steps. An edge can only
//! cross a fragment if one of its neighbours is lit and the other is not; those few are lit anew, so that a frame
//! costs hardly more.

use crate::lighting::{DARK, LIT, Met, reflected_in_runs};
use crate::shot::Shot;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::light_set::LightSet;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;

/// Fragments that are lit together: enough that drawing samples of a map once for all of them costs little, and few enough
/// that their ends take some megabytes.
const BATCH: usize = 4096;

/// Lights the fragments anew that an edge of a light's shadows may cross. `reflected`: what each sends towards the eye of it;
/// `met`: how it came to that. `samples`, `seed`: see [`reflected_at`].
pub(crate) fn smooth(
    scene: &TracedScene,
    shot: &Shot,
    (lights, light): (&LightSet, usize),
    met: &[Met],
    (samples, seed): (u32, u64),
    reflected: &mut [Vec3],
) {
    let crossed = crossed(shot, met);
    for fragments in crossed.chunks(BATCH) {
        let lit = lit_at_ends(scene, shot, (lights, light), fragments, (samples, seed));
        for (&fragment, lit) in fragments.iter().zip(lit) {
            reflected[fragment] = lit;
        }
    }
}

/// Means over their rays' ends, of which each has some, of what fragments send towards the eye of a light.
fn lit_at_ends(
    scene: &TracedScene,
    shot: &Shot,
    (lights, light): (&LightSet, usize),
    fragments: &[usize],
    (samples, seed): (u32, u64),
) -> Vec<Vec3> {
    let ends: Vec<Vec<SurfaceHit>> = (fragments.par_iter().with_min_len(64))
        .map(|&f| shot.ends_of(scene, f).collect())
        .collect();
    let mut starts = Vec::with_capacity(fragments.len() + 1);
    // Whose end each is, and the how manieth.
    let (mut owners, mut hits) = (Vec::new(), Vec::new());
    for (&f, ends) in fragments.iter().zip(ends) {
        starts.push(hits.len());
        owners.extend((0..ends.len()).map(|k| (f, k as u32)));
        hits.extend(ends.into_iter().map(Some));
    }
    starts.push(hits.len());
    let (points, views): (Vec<Option<ShadingPoint>>, Vec<Vec3>) = (owners.par_iter().zip(&hits))
        .with_min_len(256)
        .map(|(&(f, _), hit)| {
            let (Some(point), Some(hit)) = (&shot.points[f], hit) else {
                return (None, Vec3::Z);
            };
            let view = (shot.eye - hit.position).normalize_or_zero();
            (Some(point_at(point, hit, view)), view)
        })
        .unzip();
    let mut lit = vec![Vec3::ZERO; hits.len()];
    // A fragment's ends share one sequence, so that all its samples together are evenly spread.
    let run_of = |end: usize| (owners[end].0, owners[end].1 * samples);
    reflected_in_runs(
        scene,
        (lights, light),
        (&hits, &points, &views),
        (samples, seed),
        run_of,
        &mut lit,
    );
    (starts.windows(2))
        .map(|range| {
            let own = &lit[range[0]..range[1]];
            own.iter().sum::<Vec3>() / own.len() as f32
        })
        .collect()
}

/// How a fragment reflects where one of its rays ends: as the mean of its rays does, but from there, and, where that is
/// matt, as it faces there. A lobe is the fragment's, which is as wide as its normals are spread.
fn point_at(point: &ShadingPoint, hit: &SurfaceHit, view: Vec3) -> ShadingPoint {
    let at = ShadingPoint {
        position: hit.position,
        geometric_normal: hit.geometric_normal,
        ..*point
    };
    if point.lambert {
        ShadingPoint { shading_normal: hit.normal, ..at }.facing(view)
    } else {
        at
    }
}

/// The fragments of pixels that are lit beside such that are not, and the other way round, if they have ends.
fn crossed(shot: &Shot, met: &[Met]) -> Vec<usize> {
    let (width, height) = (shot.width, shot.height);
    let pixels: Vec<Met> = (0..width * height)
        .into_par_iter()
        .with_min_len(1024)
        .map(|pixel| {
            let of = |f: usize| match (shot.hits[f].is_some(), met[f]) {
                (false, _) => 0,
                // It faces away.
                (true, 0) => DARK,
                (true, met) => met,
            };
            shot.fragments_of(pixel).fold(0, |all, f| all | of(f))
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
            let is_crossed = around == LIT | DARK;
            shot.fragments_of(pixel)
                .filter(move |&f| is_crossed && shot.has_ends(f))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lighting::reflected_at;
    use crate::many_lights::tests::{camera, level, matt, sun, traced};
    use crate::shot::expose;
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
        let shot = expose(&scene, &eye, SIZE, SIZE, samples);
        let views: Vec<Vec3> = shot.directions.iter().map(|d| -*d).collect();
        let mut out = vec![Vec3::ZERO; shot.len()];
        let met = reflected_at(
            &scene,
            &lights,
            0,
            &shot.hits,
            &shot.points,
            &views,
            1,
            0,
            &mut out,
        );
        let full = out.iter().map(|v| v.x).fold(0.0, f32::max);
        smooth(&scene, &shot, (&lights, 0), &met, (1, 0), &mut out);
        let found = shot.resolve(&out);
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
}
