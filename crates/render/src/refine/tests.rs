use super::*;
use crate::expose::expose;
use crate::lighting::own_run;
use crate::test_scenes::{ball, camera, constant, even_sky, level, light, matt, panel, quad, traced};
use glam::DVec3;
use relight_scene::light::LightKind;
use relight_scene::light_set::{Emitters, LightRig, NoEmitters, SceneEmitters};
use relight_scene::scene::Mesh;
use std::f64::consts::PI;

const SIZE: usize = 24;

/// Half the sum of the sides' angles times the normals of their planes (Lambert 1760): ∫ of the direction over the solid
/// angle of a triangle.
fn vector_irradiance(x: DVec3, vertices: [Vec3; 3]) -> DVec3 {
    let d = vertices.map(|v| (v.as_dvec3() - x).normalize());
    let side = |a: DVec3, b: DVec3| a.cross(b).normalize_or_zero() * a.angle_between(b);
    0.5 * (side(d[0], d[1]) + side(d[1], d[2]) + side(d[2], d[0]))
}

/// Octahedra of an emissive material over a floor, all at one height, so that none hides another. Truth: Lambert's formula for
/// all triangles. Mean squared error over the square at most 0.01, the bias of all light 2 %.
#[test]
fn few_and_many_bulbs_light_a_floor_as_they_should() {
    for side in [1, 2, 4, 10] {
        let bulb = |i: usize| {
            let place = |k: usize| 3.0 * ((k as f32 + 0.5) / side as f32 - 0.5);
            let middle = Vec3::new(place(i % side), 0.6, place(i / side));
            let corners = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * 0.03);
            let mut positions = Vec::new();
            positions.extend(corners.map(|v| middle + v));
            positions.extend(corners.map(|v| middle - v));
            let mut triangles = Vec::new();
            for k in 0..8u32 {
                let of = |axis: u32| axis + 3 * (k >> axis & 1);
                let turned = k.count_ones() % 2 == 1;
                triangles.push(if turned {
                    [of(0), of(2), of(1)]
                } else {
                    [of(0), of(1), of(2)]
                });
            }
            Mesh {
                positions,
                triangles,
                material: 1,
                ..Mesh::default()
            }
        };
        let mut meshes = vec![level(2.0, 0.0, 0)];
        meshes.extend((0..side * side).map(bulb));
        let scene = traced(meshes, vec![matt(0.5, 0.0), matt(0.0, 100.0)]);
        let emitters = SceneEmitters::new(&scene);
        let tracks = [light(
            "glow",
            LightKind::Emissive {
                material: None,
                scale: constant(Vec3::ONE),
            },
        )];
        let rig = LightRig::new(&emitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        // Under the bulbs.
        let eye = camera(Vec3::new(0.01, 0.5, 0.0), Vec3::ZERO, 120.0);
        let seen = expose(&scene, &eye, SIZE, SIZE, 16);
        let views = seen.views();
        let samples = Samples::of_pixels(&lights, 0, seen.len(), 8, 3).told();
        let mut lit = vec![Vec3::ZERO; seen.len()];
        let told = reflected_at(&scene, &samples, &Receivers::of(&seen, &views), own_run, &mut lit);
        refine(&scene, &seen, &samples, &told, &mut lit);
        let (mut squares, mut sum, mut all, mut count) = (0.0, 0.0, 0.0, 0);
        for f in 0..seen.len() {
            let Some(hit) = seen.hits[f].filter(|hit| hit.position.y == 0.0) else {
                continue;
            };
            let x = hit.position.as_dvec3();
            let irradiance: f64 = (emitters.emissive_triangles().iter())
                .filter(|t| {
                    let [a, b, c] = t.vertices.map(|v| v.as_dvec3());
                    (b - a).cross(c - a).dot(x - a) > 0.0
                })
                .map(|t| 100.0 * -vector_irradiance(x, t.vertices).y)
                .sum();
            let truth = 0.5 / PI * irradiance;
            let found = f64::from(lit[f].x);
            squares += ((found - truth) / truth).powi(2);
            (sum, all, count) = (sum + found, all + truth, count + 1);
        }
        assert!(count > SIZE * SIZE / 2, "{count}");
        let error = squares / f64::from(count as u32);
        assert!(error < 0.01, "{side}: {error}");
        assert!((sum / all - 1.0).abs() < 0.02, "{side}: {sum} {all}");
    }
}

/// A wide plate with a square hole over a floor, under an even sky, of which each place sees some hundredth by the hole. Truth:
/// Lambert's formula for the hole. Eight samples of the sky mostly see nothing, so that pixels side by side agree that it is dark.
#[test]
fn a_sky_that_shines_in_by_a_small_hole_is_not_lost() {
    let (hole, height, wide) = (0.25, 1.0, 1000.0);
    let across = |x: [f32; 2], z: [f32; 2]| {
        let at = |x: f32, z: f32| Vec3::new(x, height, z);
        quad(
            [at(x[0], z[1]), at(x[1], z[1]), at(x[1], z[0]), at(x[0], z[0])],
            0,
        )
    };
    let plate = [
        across([-wide, -hole], [-wide, wide]),
        across([hole, wide], [-wide, wide]),
        across([-hole, hole], [-wide, -hole]),
        across([-hole, hole], [hole, wide]),
    ];
    let floor = level(wide, 0.0, 0);
    let scene = traced([vec![floor], plate.to_vec()].concat(), vec![matt(0.5, 0.0)]);
    let tracks = [even_sky(1.0)];
    let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
    let lights = rig.at(0.0);
    let eye = camera(Vec3::new(0.9, 0.8, 0.3), Vec3::new(-0.3, 0.0, 0.1), 12.0);
    let seen = expose(&scene, &eye, 2 * SIZE, 2 * SIZE, 4);
    let views = seen.views();
    let truth = |x: DVec3| {
        let corner = |i: f32, k: f32| Vec3::new(i * hole, height, k * hole);
        let [a, b, c, d] = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        0.5 / PI
            * (vector_irradiance(x, [a, b, c]) + vector_irradiance(x, [a, c, d]))
                .y
                .abs()
    };
    let (mut before, mut after, mut sum, mut all) = (0.0, 0.0, 0.0, 0.0);
    let (seeds, mut count) = (4, 0);
    for seed in 0..seeds {
        let samples = Samples::of_pixels(&lights, 0, seen.len(), 8, seed).told();
        let mut lit = vec![Vec3::ZERO; seen.len()];
        let told = reflected_at(&scene, &samples, &Receivers::of(&seen, &views), own_run, &mut lit);
        let floor = |f: &usize| seen.hits[*f].is_some_and(|hit| hit.position.y == 0.0);
        let places: Vec<usize> = (0..seen.len()).filter(floor).collect();
        let squares = |lit: &[Vec3]| -> f64 {
            let error = |&f: &usize| {
                let truth = truth(seen.hits[f].unwrap().position.as_dvec3());
                ((f64::from(lit[f].x) - truth) / truth).powi(2)
            };
            places.iter().map(error).sum()
        };
        before += squares(&lit);
        refine(&scene, &seen, &samples, &told, &mut lit);
        after += squares(&lit);
        for &f in &places {
            sum += f64::from(lit[f].x);
            all += truth(seen.hits[f].unwrap().position.as_dvec3());
        }
        count += places.len();
    }
    let (before, after) = (before / count as f64, after / count as f64);
    assert!(count > seeds as usize * SIZE * SIZE, "{count}");
    // From the spread of the mean: thousands of pixels of a relative variance of a tenth or so.
    assert!((sum / all - 1.0).abs() < 0.02, "{sum} {all}");
    assert!(before > 3.0 && after < 0.1, "{before} {after}");
}

/// Truth: light is linear. By powers of two, which rounding doesn't see: some 10⁻³⁰ and 10³⁰.
#[test]
fn a_light_times_a_number_is_the_picture_times_it_however_faint_or_strong_it_is() {
    let scene = traced(vec![level(8.0, 0.0, 0), level(0.4, 0.5, 0)], vec![matt(0.5, 0.0)]);
    let eye = camera(Vec3::new(3.0, 2.5, 1.0), Vec3::new(0.0, 0.0, 0.1), 60.0);
    let seen = expose(&scene, &eye, SIZE, SIZE, 4);
    let views = seen.views();
    let picture = |exponent: i32| {
        let scale = 2f32.powi(exponent);
        let tracks = [ball(Vec3::new(0.3, 1.2, 0.0), 0.3, Vec3::splat(scale))];
        let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
        let lights = rig.at(0.0);
        let samples = Samples::of_pixels(&lights, 0, seen.len(), 8, 1).told();
        let mut lit = vec![Vec3::ZERO; seen.len()];
        let told = reflected_at(&scene, &samples, &Receivers::of(&seen, &views), own_run, &mut lit);
        let rays = refine(&scene, &seen, &samples, &told, &mut lit);
        (rays, lit.iter().map(|light| *light / scale).collect::<Vec<_>>())
    };
    let unit = picture(0);
    assert!(unit.0 > 0, "nothing is in the penumbra");
    assert!(picture(-100) == unit && picture(100) == unit);
}

/// A square's penumbra under a panel. Truth: 256 samples at each of a pixel's ends. Over 24 seeds the mean of what is refined
/// is the truth, in deep shadow, too, where a pixel's own eight samples mostly see nothing: to 2 %, from the spread of
/// the seeds' means. Single images err by what is wanted, where without they err by several times as much; only pixels in or at the
/// penumbra get more.
#[test]
fn pixels_that_disagree_get_as_many_samples_as_they_need_and_none_is_darker_for_it() {
    let scene = traced(vec![level(8.0, 0.0, 0), level(0.4, 0.5, 0)], vec![matt(0.5, 0.0)]);
    let tracks = [panel()];
    let rig = LightRig::new(&NoEmitters, &tracks).unwrap();
    let lights = rig.at(0.0);
    let eye = camera(Vec3::new(3.0, 2.5, 1.0), Vec3::new(0.0, 0.0, 0.1), 60.0);
    let seen = expose(&scene, &eye, 2 * SIZE, 2 * SIZE, 16);
    let views = seen.views();
    let receivers = Receivers::of(&seen, &views);
    let all: Vec<usize> = (0..seen.len()).filter(|&f| seen.hits[f].is_some()).collect();
    let ends: Vec<(usize, usize)> = all
        .iter()
        .map(|&f| (f, seen.ends_for(f, f32::INFINITY).max(1)))
        .collect();
    let samples = Samples::of_pixels(&lights, 0, seen.len(), 256, 99);
    let truth = lit_at_ends(&scene, &seen, &samples, &ends);
    let full = truth.iter().map(|v| v.x).fold(0.0, f32::max);
    let penumbra = |least: f32, most: f32| -> Vec<usize> {
        (0..all.len())
            .filter(|&k| (least * full..most * full).contains(&truth[k].x))
            .collect()
    };
    let (deep, all_of_it) = (penumbra(0.005, 0.15), penumbra(0.05, 0.9));
    assert!(
        deep.len() >= 8 && all_of_it.len() > SIZE,
        "{} {}",
        deep.len(),
        all_of_it.len()
    );
    let seeds = 24;
    let (mut mean, mut before, mut after, mut cast) = (0.0, 0.0, 0.0, 0);
    for seed in 0..seeds {
        let samples = Samples::of_pixels(&lights, 0, seen.len(), 8, seed).told();
        let mut lit = vec![Vec3::ZERO; seen.len()];
        let told = reflected_at(&scene, &samples, &receivers, own_run, &mut lit);
        let error = |lit: &[Vec3]| {
            let square = |&k: &usize| ((lit[all[k]].x - truth[k].x) / truth[k].x).powi(2);
            all_of_it.iter().map(square).sum::<f32>() / all_of_it.len() as f32
        };
        before += error(&lit) / seeds as f32;
        cast += refine(&scene, &seen, &samples, &told, &mut lit) / seeds;
        after += error(&lit) / seeds as f32;
        mean += deep.iter().map(|&k| lit[all[k]].x).sum::<f32>() / seeds as f32;
    }
    let expected: f32 = deep.iter().map(|&k| truth[k].x).sum();
    assert!((mean / expected - 1.0).abs() < 0.02, "{mean} {expected}");
    assert!(
        before > 4.0 * after && after.sqrt() < 2.0 * ERROR,
        "{before} {after}"
    );
    // Where nothing hides the panel, or all of it is hidden, none are cast: by the same with the square under the floor.
    let open = traced(
        vec![level(8.0, 0.0, 0), level(0.4, -5.0, 0)],
        vec![matt(0.5, 0.0)],
    );
    let open = lit_at_ends(&open, &seen, &samples, &ends);
    let mut partly = vec![false; seen.width * seen.height];
    for (pixel, partly) in partly.iter_mut().enumerate() {
        let fragments = seen.fragments_of(pixel);
        let visible = |f| all.binary_search(&f).map_or(0.0, |k| truth[k].x / open[k].x);
        *partly = fragments.len() > 1 || fragments.into_iter().any(|f| (0.003..0.98).contains(&visible(f)));
    }
    let beside = |pixel: &usize| {
        let (x, y) = (pixel % seen.width, pixel / seen.width);
        let near =
            |y: usize| (x.saturating_sub(1)..(x + 2).min(seen.width)).any(|x| partly[y * seen.width + x]);
        (y.saturating_sub(1)..(y + 2).min(seen.height)).any(near)
    };
    let near = (0..partly.len()).filter(beside).count();
    assert!(2 * near < partly.len(), "{near} of {}", partly.len());
    // Each ray end has one at least: 64 of a pixel that sees several things.
    assert!(
        cast < (u64::from(MOST) + 64) * near as u64,
        "{cast} rays for {near}"
    );
}
