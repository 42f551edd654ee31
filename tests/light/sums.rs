//! Light adds up, and every bounce carries less than the one before.

use crate::stage::{bake_glb, light, mean, shot, through_file};
use glam::{DVec3, Vec3};
use relight_bake::params::BakeParams;
use relight_data_generate::cornell;
use relight_play::Player;
use relight_scene::animated::Animated;
use relight_scene::light::{LightKind, LightTrack};
use std::sync::OnceLock;

/// Points of 2.5 cm in a box of 0.55 m.
fn tiny(bounces: Option<u32>, seed: u64) -> BakeParams {
    BakeParams {
        levels: 3,
        sender_levels: 2,
        coarse_radius: Some(0.1),
        bounces,
        seed,
        ..BakeParams::default()
    }
}

/// All bounces, with several seeds of the points: which places come out dark depends on them.
fn boxes() -> &'static [Player] {
    static LOADED: OnceLock<Vec<Player>> = OnceLock::new();
    LOADED.get_or_init(|| {
        let baked = |seed| through_file(&bake_glb(&cornell(), &tiny(None, seed)));
        (0..3).map(baked).collect()
    })
}

fn point(name: &str, position: [f32; 3], intensity: f32) -> LightTrack {
    LightTrack {
        name: name.into(),
        kind: LightKind::Point {
            position: Animated::Constant(position.into()),
            intensity: Animated::Constant(Vec3::splat(intensity)),
        },
    }
}

/// Places of the two lamps, metres.
const LEFT: [f32; 3] = [0.2, 0.4, 0.1];
const RIGHT: [f32; 3] = [0.45, 0.4, 0.15];

/// Rounding of a sum of `terms` terms in f32, relative to the sum of their magnitudes.
fn rounding(terms: usize) -> f64 {
    terms as f64 * f64::from(f32::EPSILON)
}

/// Bound for what rounding does to indirect light, relative to the brightest of the image. A value is a chain
/// of sums: a cluster's mean and bounces over at most some hundred links each, T, the push through
/// the levels and the pixel's functions. Differences between levels cancel, so errors count against the
/// brightest, lights below 1e-7 of it may be skipped, and bounces are solved to 1e-5: 1000 roundings in all, 1.2e-4.
const CHAIN: usize = 1000;

/// Truth: transport is linear in the lights, whatever they are.
#[test]
fn a_plus_two_b_is_the_sum_of_both_apart() {
    for player in boxes() {
        adds_up(player);
    }
}

/// Truth: what a lamp that stands still sends is the same in every frame, however it was come by. A shot whose lamps moved, stood,
/// blinked and changed places gives what one gives that knows nothing yet, to the bit; so with a layer for each lamp.
#[test]
fn frames_do_not_depend_on_those_before() {
    let sphere = |x: f32| LightTrack {
        name: "sphere".into(),
        kind: LightKind::Sphere {
            center: Animated::Constant(Vec3::new(x, 0.3, 0.2)),
            radius: Animated::Constant(0.02),
            radiance: Animated::Constant(Vec3::splat(100.0)),
        },
    };
    let (left, right, dark) = (
        point("a", LEFT, 1.0),
        point("a", RIGHT, 1.0),
        point("a", LEFT, 0.0),
    );
    let frames = [
        vec![left.clone(), sphere(0.3)],
        vec![right.clone(), sphere(0.3)],
        vec![right, sphere(0.3)],
        vec![dark, sphere(0.3)],
        vec![sphere(0.3), left.clone()],
        vec![left.clone(), sphere(0.25)],
        vec![left.clone(), sphere(0.3)],
        vec![left.clone(), sphere(0.3)],
        vec![left],
    ];
    let asset = bake_glb(&cornell(), &tiny(None, 0));
    let player = &through_file(&asset);
    // As of a camera that comes and goes.
    let known = [16, 12].map(|size| (size, shot(player, size)));
    for (i, tracks) in frames.iter().enumerate() {
        for (layers, (size, known)) in [false, true, false].into_iter().zip(known.iter().cycle()) {
            let again = light(player, known, tracks, layers);
            // A player of its own: points keep what they receive, too.
            let alone = through_file(&asset);
            let once = light(&alone, &shot(&alone, *size), tracks, layers);
            assert_eq!(again.direct, once.direct, "frame {i}, layers {layers}");
            assert_eq!(again.indirect, once.indirect, "frame {i}, layers {layers}");
            assert_eq!(again.lights, once.lights, "frame {i}, layers {layers}");
        }
    }
}

fn adds_up(player: &Player) {
    let shot = shot(player, 32);
    let lit = |tracks: &[LightTrack]| light(player, &shot, tracks, false);
    let (a, b) = (lit(&[point("a", LEFT, 1.0)]), lit(&[point("b", RIGHT, 1.0)]));
    let both = lit(&[point("a", LEFT, 1.0), point("b", RIGHT, 2.0)]);
    let brightest = both.indirect.iter().fold(0.0f32, |m, v| m.max(v.max_element()));
    for one in [&a, &b] {
        assert!(one.indirect.iter().any(|v| v.max_element() > 0.05 * brightest));
    }
    let mut worst = 0.0f64;
    for i in 0..shot.seen.len() {
        // One product and one sum on direct light.
        let direct = a.direct[i].as_dvec3() + 2.0 * b.direct[i].as_dvec3();
        let error = (both.direct[i].as_dvec3() - direct).abs();
        assert!(error.cmple(rounding(4) * direct).all(), "direct, fragment {i}");
        let indirect = a.indirect[i].as_dvec3() + 2.0 * b.indirect[i].as_dvec3();
        let error = (both.indirect[i].as_dvec3() - indirect).abs().max_element();
        worst = worst.max(error / f64::from(brightest));
    }
    println!("linearity: {worst:e} of the brightest");
    assert!(worst < rounding(CHAIN), "{worst}");
}

/// Truth: linearity once more; the layers, each lit alone, against all lights at once.
#[test]
fn light_layers_sum_to_the_beauty() {
    for player in boxes() {
        layers_add_up(player);
    }
}

fn layers_add_up(player: &Player) {
    let shot = shot(player, 32);
    let mut tracks = vec![point("a", LEFT, 1.0), point("b", RIGHT, 2.0)];
    // The box's own emissive patch.
    tracks.extend(player.scene().sequence.lights.iter().cloned());
    tracks.push(LightTrack {
        name: "glow".into(),
        kind: LightKind::Emissive {
            material: None,
            scale: Animated::Constant(Vec3::splat(0.1)),
        },
    });
    let lit = light(player, &shot, &tracks, true);
    assert_eq!(lit.lights.len(), tracks.len());
    let beauty = |i: usize| (lit.emission[i] + lit.direct[i] + lit.indirect[i]).as_dvec3();
    let brightest = (0..shot.seen.len())
        .map(|i| lit.indirect[i].max_element())
        .fold(0.0, f32::max);
    for i in 0..shot.seen.len() {
        let sum: DVec3 = lit.lights.iter().map(|l| l.1[i].as_dvec3()).sum();
        let tolerance = rounding(CHAIN) * f64::from(brightest) + rounding(8) * beauty(i).max_element();
        let error = (sum - beauty(i)).abs().max_element();
        assert!(error < tolerance, "fragment {i}: {error}");
    }
}

/// Truth: energy. What leaves the surfaces on bounce n + 1 is at most the largest reflectance times what left on
/// bounce n. The finest points stand for equal areas. Tolerance: 2 % of the previous bounce for the noise of
/// T's rays (320 per point, hundreds of points) and uneven areas at the rims.
#[test]
fn every_bounce_carries_less_than_the_one_before() {
    let mut sums = vec![DVec3::ZERO];
    let mut direct_flux = DVec3::ZERO;
    let mut largest = 0.0f32;
    for bounces in 1..=3 {
        let player = through_file(&bake_glb(&cornell(), &tiny(Some(bounces), 2)));
        let transfer = player.prepared.transfer.as_ref().unwrap();
        largest = transfer.albedo.iter().fold(0.0, |m, a| m.max(a.max_element()));
        // Irradiance on all that faces up: any light will do.
        let direct: Vec<Vec3> = (transfer.finest.normals.iter())
            .map(|n| Vec3::splat(n.y.max(0.0)))
            .collect();
        direct_flux = mean(
            &direct
                .iter()
                .zip(&transfer.albedo)
                .map(|(e, a)| *e * *a)
                .collect::<Vec<_>>(),
        );
        let (values, _) = transfer.indirect_from_direct(&direct);
        let flux: Vec<Vec3> = (values.iter().zip(&transfer.finest.normals).zip(&transfer.albedo))
            .map(|((v, n), a)| v.irradiance(*n) * *a)
            .collect();
        sums.push(mean(&flux));
    }
    let mut before = direct_flux;
    for bounce in 1..sums.len() {
        let carried = sums[bounce] - sums[bounce - 1];
        println!(
            "bounce {bounce}: flux {carried:.4}, of the one before {:.3}",
            carried / before
        );
        assert!(carried.cmpgt(DVec3::ZERO).all(), "bounce {bounce}: {carried}");
        let most = before * (f64::from(largest) + 0.02);
        assert!(
            carried.cmple(most).all(),
            "bounce {bounce}: {carried} of {before}"
        );
        before = carried;
    }
}
