//! Random scenes: the same bytes for the same seed, what is said of them is in the file, all reflectances are those of real
//! surfaces, and every kind of thing comes up.

use relight_data_generate::random;
use serde_json::Value;

/// Seeds in which every kind of thing must occur.
const SEEDS: u64 = 200;

fn json(glb: &[u8]) -> Value {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    serde_json::from_slice(&glb[20..20 + length]).unwrap()
}

#[test]
fn a_seed_is_the_same_scene_every_time_and_another_seed_is_another() {
    for seed in [0, 7, u64::MAX] {
        let (a, b) = (random(seed), random(seed));
        assert_eq!(a.glb.to_bytes(), b.glb.to_bytes());
        assert_eq!((a.says, a.sequence), (b.says, b.sequence));
    }
    assert_ne!(random(1).glb.to_bytes(), random(2).glb.to_bytes());
}

#[test]
fn albedos_are_those_of_real_surfaces_and_cover_their_range() {
    let mut all = vec![];
    for seed in 0..50 {
        let json = json(&random(seed).glb.to_bytes());
        for material in json["materials"].as_array().unwrap() {
            let color = &material["pbrMetallicRoughness"]["baseColorFactor"];
            all.extend((0..3).map(|k| color[k].as_f64().unwrap()));
        }
    }
    assert!(all.iter().all(|a| (0.02..=0.95).contains(a)));
    let share = |range: std::ops::Range<f64>| {
        all.iter().filter(|&a| range.contains(a)).count() as f64 / all.len() as f64
    };
    // Tones are even over the range, so that a fifth of it holds about a fifth of them; tints move some.
    for tenth in [0.02..0.2, 0.4..0.6, 0.75..0.951] {
        assert!(
            (0.1..0.35).contains(&share(tenth.clone())),
            "{tenth:?}: {}",
            share(tenth.clone())
        );
    }
}

#[test]
fn every_kind_of_thing_comes_up() {
    let said: Vec<String> = (0..SEEDS).map(|seed| random(seed).says).collect();
    let kinds = "interior, yard, single-sheet walls, walls facing outwards, walls of two coincident sheets, two-sheet walls, \
        walls of boxes, house, window, partition, ground ×, dome ×, stray triangle ×, sun and sky, sun alone, glowing dome, \
        bulbs, tubes, screen, panel, point light, spot, furniture, columns, curtain, leaves, clutter, gloss, textures, \
        unit m, unit cm, unit cm under a root, unit mm, unit inch, unit km, turned, offset, no camera, 1 camera, 3 cameras";
    for kind in kinds.split(", ") {
        let seeds = said.iter().filter(|says| says.contains(kind)).count();
        assert!(seeds >= 3, "{kind}: {seeds} of {SEEDS} seeds");
    }
    // Far things reach from a few times the place to a city and beyond.
    let extents = said.iter().flat_map(|says| says.split('×').skip(1));
    let extents: Vec<f64> = extents
        .filter_map(|text| text.split([',', ' ']).next()?.parse().ok())
        .filter(|&times| times >= 10.0)
        .collect();
    assert!(extents.iter().any(|&x| x < 30.0) && extents.iter().any(|&x| x > 30_000.0));
}

#[test]
fn the_file_has_what_is_said_of_it() {
    for seed in 0..50 {
        let scene = random(seed);
        let json = json(&scene.glb.to_bytes());
        let cameras = json["cameras"].as_array().map_or(0, Vec::len);
        let said = match cameras {
            0 => "no camera".into(),
            1 => "1 camera".into(),
            n => format!("{n} cameras"),
        };
        assert!(scene.says.ends_with(&said), "{seed}: {}, {cameras}", scene.says);
        let sequence: Value = serde_json::from_slice(&scene.sequence).unwrap();
        assert_eq!(sequence["camera"].is_object(), cameras == 0, "{seed}");
        // Something shines in every scene.
        let emits = (json["materials"].as_array().unwrap().iter()).any(|m| m["emissiveFactor"].is_array());
        let lights = json["extensions"]["KHR_lights_punctual"]["lights"]
            .as_array()
            .map_or(0, Vec::len);
        assert!(emits || lights > 0 || scene.has_sky, "{seed}: {}", scene.says);
        assert_eq!(
            sequence["lights"].as_array().unwrap().len(),
            lights + usize::from(scene.has_sky) + 1,
            "{seed}"
        );
    }
}
