//! Sequences as people write them, right and wrong.

use super::*;
use crate::animated::{Animated, Interpolation};
use crate::image::{BEAUTY, ExrHeader, FloatImage, Layers, write_exr};
use crate::light::{EnvironmentMap, LightKind};
use glam::Vec3;
use proptest::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// One light of each type but environments.
const EXAMPLE: &str = r#"{ "relight_sequence": 1, "frames": 48, "fps": 24,
  "camera": { "node": "hall" },
  "lights": [
    { "name": "torch", "type": "spot", "position": {"keys": [[0,[0,2,0]],[47,[6,2,0]]], "interpolation": "linear"},
      "direction": [0,-1,0.2], "inner_angle_deg": 20, "outer_angle_deg": 35, "intensity": [40,36,30] },
    { "name": "bulb",  "type": "point", "position": [1,2,3], "intensity": [10,10,10] },
    { "name": "sun",   "type": "directional", "direction": [-0.3,-1,0.1], "irradiance": [5,5,4.5] },
    { "name": "panel", "type": "rect", "center": [0,3,0], "edge_u": [1,0,0], "edge_v": [0,0,1], "radiance": [8,8,8] },
    { "name": "globe", "type": "sphere", "center": [0,2,0], "radius": 0.1, "radiance": [50,50,50] },
    { "name": "day",   "type": "sun_sky", "turbidity": 3, "sun_direction": [0.2,0.8,0.1], "scale": 1.0 },
    { "name": "neon",  "type": "emissive", "material": "Neon", "scale": [1,1,1] } ] }"#;

fn parse(text: &str) -> Result<Sequence, String> {
    parse_sequence(text, Path::new("."), "seq.json").map_err(|e| e.to_string())
}

#[test]
fn one_light_of_each_type_is_read_as_it_is_meant() {
    let sequence = parse(EXAMPLE).unwrap();
    assert_eq!(
        (sequence.frames, sequence.fps, sequence.lights.len()),
        (48, 24.0, 7)
    );
    assert_eq!(sequence.camera, Some(SequenceCamera::Node("hall".into())));
    let LightKind::Spot {
        position, intensity, ..
    } = &sequence.lights[0].kind
    else {
        panic!()
    };
    assert_eq!(position.at(47.0), Vec3::new(6.0, 2.0, 0.0));
    assert_eq!(intensity.at(3.0), Vec3::new(40.0, 36.0, 30.0));
    let LightKind::SunSky { scale, .. } = &sequence.lights[5].kind else {
        panic!()
    };
    assert_eq!(scale.at(0.0), Vec3::ONE);
}

#[test]
fn frames_and_fps_have_defaults() {
    let sequence = parse(r#"{"relight_sequence": 1, "lights": []}"#).unwrap();
    assert_eq!((sequence.frames, sequence.fps, sequence.camera), (1, 24.0, None));
}

#[test]
fn writing_and_reading_back_changes_nothing() {
    let sequence = parse(EXAMPLE).unwrap();
    assert_eq!(parse(&sequence_to_json(&sequence)).unwrap(), sequence);
    let camera = CameraTrack {
        name: "hall".into(),
        position: Animated::Constant(Vec3::new(0.1, 1e-20, -3.0)),
        look_at: Animated::Keys {
            keys: vec![(0.0, Vec3::X), (1.5, Vec3::Y)],
            interpolation: Interpolation::Cubic,
        },
        up: Animated::Constant(Vec3::Y),
        vfov_deg: Animated::Constant(42.7),
        aspect: Some(1.7777778),
    };
    let text = stage_to_json(std::slice::from_ref(&camera), &sequence);
    assert_eq!(stage_from_json(&text).unwrap(), (vec![camera], sequence));
}

/// Truth: the same light under its documented names.
#[test]
fn rectangle_and_center_and_position_mean_the_same_for_all_lights() {
    let others = EXAMPLE
        .replace("\"rect\"", "\"rectangle\"")
        .replace("\"center\"", "\"CENTER\"")
        .replace("\"position\"", "\"center\"")
        .replace("\"CENTER\"", "\"position\"");
    // Torch, bulb, panel and globe, and the panel's type.
    assert_eq!(others.matches("\"center\"").count(), 2);
    assert_eq!(others.matches("\"position\"").count(), 2);
    assert_eq!(parse(&others).unwrap(), parse(EXAMPLE).unwrap());
    // Without its file no IES lamp is made: what is missed tells that its place was read.
    for place in ["position", "center"] {
        let lamp = r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "ies", "PLACE": [0,0,0], "file": "no.ies"}]}"#;
        let message = parse(&lamp.replace("PLACE", place)).unwrap_err();
        assert!(message.contains("lights[0].file: "), "{message}");
    }
}

/// Truth: counted by eye. Whatever is given twice, by its own or by its other name, is refused where the second begins.
#[test]
fn fields_given_twice_are_refused_with_the_place_of_the_second() {
    let text = |fields: &str| format!("{{\"relight_sequence\": 1,\n \"lights\": [{{\n  {fields}}}]}}");
    let point = "\"name\": \"a\", \"type\": \"point\", \"intensity\": [1,1,1],\n \"position\": [0,0,0],\n\t";
    for (text, wanted) in [
        (
            text(&format!("{point}\"position\": [1,1,1]")),
            "lights[0]: duplicate field `position` (line 5, column 2)",
        ),
        (
            text(&format!("{point}\"center\": [1,1,1]")),
            "lights[0]: duplicate field `position` (line 5, column 2)",
        ),
        (
            text(&format!("{point} \"type\" : \"point\"")),
            "lights[0]: duplicate field `type` (line 5, column 3)",
        ),
        (
            text(&format!("{point}\"name\": \"ä\"")),
            "lights[0]: duplicate field `name` (line 5, column 2)",
        ),
        (
            text(
                "\"name\": \"ä\", \"type\": \"emissive\", \"scale\": {\"keys\": [[0, 1]],\n\n  \"keys\": [[0, 1]]}",
            ),
            "lights[0].scale: duplicate field `keys` (line 5, column 3)",
        ),
        (
            "{\"relight_sequence\": 1, \"lights\": [],\n\"lights\": []}".into(),
            "the whole text: duplicate field `lights` (line 2, column 1)",
        ),
        (
            "{\"relight_sequence\": 1, \"camera\": {\"node\": \"a\",\n \"node\": \"b\"}, \"lights\": []}"
                .into(),
            "camera: duplicate field `node` (line 2, column 2)",
        ),
    ] {
        let message = parse(&text).unwrap_err();
        assert_eq!(message, format!("seq.json: {wanted}"), "{text}");
    }
}

/// One wrong light, or one wrong top-level field, at a time, and what the message must say.
#[test]
fn messages_name_the_path_and_what_was_found() {
    let light = |fields: &str| format!(r#"{{"relight_sequence": 1, "lights": [{{"name": "a", {fields}}}]}}"#);
    let point = r#""type": "point", "position": [0,0,0]"#;
    let cases = [
        (light(&format!(r#"{point}, "intensity": "red""#)), "lights[0].intensity: invalid type: string \"red\", expected 3 numbers"),
        (light(&format!(r#"{point}, "intensity": [1,-2,1]"#)), "lights[0].intensity[1]: expected a number from 0 to 1e30, found -2"),
        (light(&format!(r#"{point}, "intensity": [1,2]"#)), "lights[0].intensity: invalid length 2, expected 3 numbers"),
        (light(&format!(r#"{point}, "intensity": "NaN""#)), "lights[0].intensity"),
        (light(&format!(r#"{point}, "intensity": [1e300,1,1]"#)), "lights[0].intensity[0]: expected a number from 0 to 1e30, found 1e300"),
        (light(&format!(r#"{point}, "intensity": [1,1,1], "color": 3"#)), "lights[0].color: unknown field `color`, expected one of `center`, `position`, `intensity`"),
        (light(point), "lights[0]: missing field `intensity` (line 1, column 36)"),
        (light(r#""type": "laser""#), "lights[0].type: unknown variant `laser`, expected one of `point`, `spot`, `ies`, `directional`, `rect`, `rectangle`, `sphere`, `environment`, `sun_sky`, `weather`, `emissive`"),
        (light(r#""type": "spot", "position": [0,0,0], "direction": [0,0,0], "outer_angle_deg": 10, "intensity": [1,1,1]"#), "lights[0].direction: expected a direction"),
        (light(r#""type": "spot", "position": [0,0,0], "direction": [0,1,0], "outer_angle_deg": 120, "intensity": [1,1,1]"#), "lights[0].outer_angle_deg: expected a number from 0 to 90, found 120"),
        (light(r#""type": "spot", "position": [0,0,0], "direction": [0,1,0], "inner_angle_deg": 30, "outer_angle_deg": 20, "intensity": [1,1,1]"#), "lights[0].inner_angle_deg: must not exceed"),
        (light(r#""type": "rect", "center": [0,0,0], "edge_u": [1,0,0], "edge_v": [2,0,0], "radiance": [1,1,1]"#), "lights[0].edge_v: must not be parallel"),
        (light(r#""type": "sphere", "center": [0,0,0], "radius": 0, "radiance": [1,1,1]"#), "lights[0].radius: expected a number above 0, found 0"),
        (light(r#""type": "emissive", "scale": "x""#), "lights[0].scale: invalid type: string \"x\", expected a number or 3 numbers (RGB)"),
        (light(r#""type": "environment", "file": "no/such.hdr""#), "lights[0].file: "),
        (light(&format!(r#"{point}, "intensity": {{"keys": [[1,[1,1,1]],[1,[2,2,2]]]}}"#)), "lights[0].intensity.keys[1][0]: frames of keys must rise"),
        (light(&format!(r#"{point}, "intensity": {{"keys": []}}"#)), "lights[0].intensity.keys: invalid length 0, expected a list of at least one [frame, value]"),
        (light(&format!(r#"{point}, "intensity": {{"keys": [[0,[1,1,"b"]]]}}"#)), "lights[0].intensity.keys[0][1][2]: invalid type: string \"b\", expected a number from 0 to 1e30"),
        (light(&format!(r#"{point}, "intensity": {{"keys": [[0,[1,1,1]]], "interpolation": "bezier"}}"#)), "lights[0].intensity.interpolation: unknown variant `bezier`, expected one of `step`, `linear`, `cubic`"),
        (r#"{"relight_sequence": 2, "lights": []}"#.into(), "relight_sequence: expected 1"),
        (r#"{"lights": []}"#.into(), "the whole text: missing field `relight_sequence`"),
        (r#"{"relight_sequence": 1, "frames": 0, "lights": []}"#.into(), "frames: expected a number from 1 to 10000000, found 0"),
        (r#"{"relight_sequence": 1, "fps": -1, "lights": []}"#.into(), "fps: expected a number above 0"),
        (r#"{"relight_sequence": 1, "ligths": []}"#.into(), "ligths: unknown field"),
        (r#"{"relight_sequence": 1, "camera": {"position": [0,0,0], "look_at": [1,0,0], "vfov_deg": 180}, "lights": []}"#.into(), "camera.vfov_deg: expected a number above 0 and below 180"),
        (r#"{"relight_sequence": 1, "lights": [{"name": "a", "type": "emissive"}, {"name": "a", "type": "emissive"}]}"#.into(), "lights[1].name: \"a\" is already"),
        ("[]".into(), "the whole text: invalid type: sequence, expected an object"),
        ("{\n  \"relight_sequence\": 1,,".into(), "not valid JSON at line 2, column 25"),
    ];
    for (text, wanted) in cases {
        let message = parse(&text).unwrap_err();
        assert!(
            message.starts_with("seq.json: ") && message.contains(wanted),
            "{message}\nlacks\n{wanted}"
        );
    }
}

/// What JSON allows and a sequence doesn't, and what nobody writes by accident.
#[test]
fn hostile_json_is_refused_with_a_place() {
    let nested = |depth: usize| "[".repeat(depth) + &"]".repeat(depth);
    let light = |fields: &str| format!(r#"{{"relight_sequence": 1, "lights": [{{"name": "a", {fields}}}]}}"#);
    let point = r#""type": "point", "position": [0,0,0], "intensity": [1,1,1]"#;
    let cases = [
        (nested(100_000), "line 1"),
        (
            light(&format!(r#"{point}, "deep": {}"#, nested(100_000))),
            "unknown field `deep`",
        ),
        (
            light(&format!(r#""type": "emissive", "scale": {}"#, nested(100_000))),
            "lights[0].scale[0]: invalid type: sequence",
        ),
        (
            light(&format!(r#"{point}, "position": [1,1,1]"#)),
            "lights[0]: duplicate field `position`",
        ),
        (
            light(&format!(r#"{point}, "name": "b""#)),
            "lights[0]: duplicate field `name`",
        ),
        (
            light(&format!(r#"{point}, "type": "spot""#)),
            "lights[0]: duplicate field `type`",
        ),
        (
            r#"{"relight_sequence": 1, "lights": [], "lights": []}"#.into(),
            "the whole text: duplicate field `lights`",
        ),
        (
            light(r#""type": "emissive", "scale": {"keys": [[0, 1]], "keys": [[0, 1]]}"#),
            "lights[0].scale: duplicate field `keys`",
        ),
        (
            light(r#""type": "emissive", "scale": 1e999"#),
            "lights[0].scale: number out of range",
        ),
        (
            light(r#""type": "emissive", "scale": NaN"#),
            "not valid JSON at line 1",
        ),
        (
            light(r#""type": "emissive", "scale": -0.5"#),
            "lights[0].scale: expected a number from 0 to 1e15, found -0.5",
        ),
        (
            light(r#""type": "emissive", "material": null"#),
            "lights[0].material: invalid type: null",
        ),
        (
            light(r#""type": "emissive", "scale": true"#),
            "lights[0].scale: invalid type: boolean `true`",
        ),
        (
            light(r#""type": ["emissive"]"#),
            "lights[0].type: invalid type: sequence",
        ),
        (
            light(r#""type": "sphere", "center": [0,0,0], "radius": 1e-60, "radiance": [1,1,1]"#),
            "lights[0].radius: expected a number of at least",
        ),
        (
            r#"{"relight_sequence": 1, "frames": 4294967296, "lights": []}"#.into(),
            "frames: ",
        ),
        (
            r#"{"relight_sequence": 1, "camera": null, "lights": []}"#.into(),
            "camera: invalid type: null",
        ),
        (
            r#"{"relight_sequence": 1, "camera": ["hall"], "lights": []}"#.into(),
            "camera: invalid type: sequence, expected an object",
        ),
        (
            r#"{"relight_sequence": 1, "camera": {"node": "a", "up": [0,1,0]}, "lights": []}"#.into(),
            "camera.up: unknown field `up`, expected `node`",
        ),
        (
            r#"{"relight_sequence": 1, "lights": [["a", "emissive"]]}"#.into(),
            "lights[0]: invalid type: sequence, expected an object",
        ),
        (
            r#"{"relight_sequence": 1, "lights": []} []"#.into(),
            "trailing characters",
        ),
    ];
    for (text, wanted) in cases {
        let message = parse(&text).unwrap_err();
        assert!(
            message.starts_with("seq.json: ") && message.contains(wanted),
            "{message}\nlacks\n{wanted}"
        );
        assert!(message.contains("line 1, column "), "{message}");
    }
}

/// A pattern names a map for each frame; what is wrong with any of them is told.
#[test]
fn a_pattern_is_a_map_for_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    let write = |number: u32, radiance: f32| {
        let image = FloatImage {
            width: 2,
            height: 1,
            pixels: vec![[radiance; 3]; 2],
        };
        let file = folder.path().join(format!("sky_{number:04}.exr"));
        let layers = Layers::from_image(BEAUTY, &image);
        write_exr(&file, &layers, &ExrHeader::default(), true).unwrap();
    };
    for (number, radiance) in [(7, 1.0), (8, 2.0), (9, 4.0)] {
        write(number, radiance);
    }
    let read = |frames: u32| {
        let light = r#"{"name": "a", "type": "environment", "file": "sky_####.exr"}"#;
        let text = format!(r#"{{"relight_sequence": 1, "frames": {frames}, "lights": [{light}]}}"#);
        parse_sequence(&text, folder.path(), "seq.json").map_err(|e| e.to_string())
    };
    let sequence = read(5).unwrap();
    let LightKind::Environment { maps, file, .. } = &sequence.lights[0].kind else {
        panic!()
    };
    assert_eq!(*file, "sky_####.exr".into());
    let at = |frame: f64| maps.at(frame).pixels[0].x;
    // Fractions belong to the frame that has begun, the last map stays.
    assert_eq!(
        [-1.0, 0.0, 0.9, 1.0, 2.0, 4.0, f64::NAN].map(at),
        [1.0, 1.0, 1.0, 2.0, 4.0, 4.0, 1.0]
    );
    let LightKind::Environment { maps, .. } = &read(2).unwrap().lights[0].kind else {
        panic!()
    };
    assert_eq!(
        maps.all().len(),
        2,
        "maps of frames that there aren't are not read"
    );
    std::fs::remove_file(folder.path().join("sky_0008.exr")).unwrap();
    let said = read(3).unwrap_err();
    assert!(
        said.contains("lights[0].file: sky_####.exr: sky_0008.exr is missing, but sky_0009.exr is there"),
        "{said}"
    );
    std::fs::write(folder.path().join("sky_0008.exr"), "no picture").unwrap();
    let said = read(3).unwrap_err();
    assert!(
        said.contains("lights[0].file: ") && said.contains("sky_0008.exr"),
        "{said}"
    );
}

/// A weather file becomes the lines that the sequence asks for, and its messages name it.
#[test]
fn weather_is_read_for_the_hours_of_the_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let tape = "place a\nlatitude 47\nlongitude -8\ntime_zone -15\nweather_data_file_units 1\n3 21 8.5 100 50\n6 21 11.5 500 100\n6 21 12.5 600 100\n";
    std::fs::write(folder.path().join("city.wea"), tape).unwrap();
    let light = |fields: &str| {
        format!(
            r#"{{"relight_sequence": 1, "lights": [{{"name": "a", "type": "weather", "file": "city.wea", {fields}}}]}}"#
        )
    };
    let read =
        |fields: &str| parse_sequence(&light(fields), folder.path(), "seq.json").map_err(|e| e.to_string());
    let sequence = read(r#""day": "06-21", "hours": {"keys": [[0, 11.5], [9, 12.5]]}"#).unwrap();
    let LightKind::Weather {
        file,
        weather,
        hours,
        day,
        ..
    } = &sequence.lights[0].kind
    else {
        panic!()
    };
    assert!(file.contains("6 21 11.5") && !file.contains("3 21"), "{file}");
    let (daylight, sun) = weather.at(day.unwrap().hours() + f64::from(hours.at(4.5)));
    assert!((daylight.direct_normal - 550.0).abs() < 1e-9 && sun.y > 0.9);
    // It needs no file any more.
    assert_eq!(parse(&sequence_to_json(&sequence)).unwrap(), sequence);
    for (fields, expected) in [
        (
            r#""hours": 12"#,
            "lights[0].file: city.wea: has nothing between 06-21 12:30 and 03-21 08:30",
        ),
        (
            r#""day": "21.6.", "hours": 12"#,
            "lights[0].day: expected a day of the year as \"MM-DD\", found \"21.6.\"",
        ),
        (r#""day": "02-29", "hours": 12"#, "lights[0].day: expected a day"),
        (
            r#""day": "06-21", "hours": -1"#,
            "lights[0].hours: expected a number from 0 to 8784",
        ),
        (r#""day": "06-21""#, "missing field `hours`"),
    ] {
        let message = read(fields).unwrap_err();
        assert!(message.contains(expected), "{message}\nlacks\n{expected}");
    }
    std::fs::write(folder.path().join("city.wea"), tape.replace("500", "-500")).unwrap();
    let message = read(r#""hours": 12"#).unwrap_err();
    assert!(
        message.contains("lights[0].file: city.wea: line 7: direct normal irradiance is -500"),
        "{message}"
    );
}

#[test]
fn an_asset_refuses_environment_maps_by_name() {
    let mut sequence = parse(r#"{"relight_sequence": 1, "lights": []}"#).unwrap();
    sequence.lights.push(LightTrack {
        name: "sky".into(),
        kind: LightKind::Environment {
            maps: Arc::new(EnvironmentMap {
                width: 1,
                height: 1,
                pixels: vec![Vec3::ONE],
            })
            .into(),
            file: "meadow.hdr".into(),
            scale: Animated::Constant(Vec3::ONE),
            rotation_deg: Animated::Constant(0.0),
        },
    });
    let error = stage_from_json(&stage_to_json(&[], &sequence))
        .unwrap_err()
        .to_string();
    assert!(error.contains("sequence.lights[0].file"), "{error}");
}

proptest! {
    /// Any text whatsoever is either read or refused with a message; nothing panics.
    #[test]
    fn mutated_text_never_panics(place in 0usize..1500, with in any::<u8>(), cut in 0usize..1500) {
        let mut bytes = EXAMPLE.as_bytes().to_vec();
        let place = place % bytes.len();
        bytes[place] = with;
        bytes.truncate(cut.max(1).min(bytes.len()));
        let _ = parse(&String::from_utf8_lossy(&bytes));
    }

    /// Every finite f32 survives writing and reading bit by bit.
    #[test]
    fn numbers_survive_exactly(x in any::<f32>().prop_filter("finite", |x| x.is_finite())) {
        let mut sequence = parse(EXAMPLE).unwrap();
        sequence.lights.truncate(2);
        if let LightKind::Point { position, .. } = &mut sequence.lights[1].kind {
            *position = Animated::Constant(Vec3::splat(x));
        }
        prop_assert_eq!(parse(&sequence_to_json(&sequence)).unwrap(), sequence);
    }
}

/// Truth: the maps' own pixels, mixed by hand.
#[test]
fn maps_have_keys_like_other_values() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, width: usize, radiance: f32| {
        let image = FloatImage {
            width,
            height: 1,
            pixels: vec![[radiance; 3]; width],
        };
        let layers = Layers::from_image(BEAUTY, &image);
        write_exr(&folder.path().join(name), &layers, &ExrHeader::default(), true).unwrap();
    };
    write("noon.exr", 2, 4.0);
    write("dusk.exr", 2, 1.0);
    write("night.exr", 4, 0.5);
    let read = |file: &str| {
        let light = format!(r#"{{"name": "a", "type": "environment", "file": {file}}}"#);
        let text = format!(r#"{{"relight_sequence": 1, "frames": 9, "lights": [{light}]}}"#);
        parse_sequence(&text, folder.path(), "seq.json").map_err(|e| e.to_string())
    };
    let radiance = |file: &str, frame: f64| {
        let sequence = read(file).unwrap();
        let LightKind::Environment { maps, .. } = &sequence.lights[0].kind else {
            panic!()
        };
        maps.at(frame).pixels[0].x
    };
    let blended = r#"{"keys": [[0, "noon.exr"], [4, "dusk.exr"], [8, "noon.exr"]]}"#;
    assert_eq!(
        [0.0, 2.0, 4.0, 7.0].map(|f| radiance(blended, f)),
        [4.0, 2.5, 1.0, 3.25]
    );
    let steps = r#"{"keys": [[0, "noon.exr"], [4.5, "night.exr"]], "interpolation": "step"}"#;
    assert_eq!([4.0, 5.0].map(|f| radiance(steps, f)), [4.0, 0.5]);
    // Written again, it is the same.
    let sequence = read(blended).unwrap();
    let text = sequence_to_json(&sequence);
    assert_eq!(parse_sequence(&text, folder.path(), "again").unwrap(), sequence);
    for (file, said) in [
        (r#"{"keys": []}"#, "lights[0].file: expected at least one"),
        (
            r#"{"keys": [[1, "noon.exr"], [1, "dusk.exr"]]}"#,
            "lights[0].file: frames of keys must rise, but 1 follows 1",
        ),
        (
            r#"{"keys": [[0, "noon.exr"], [1, "night.exr"]]}"#,
            "noon.exr has 2x1 and night.exr has 4x1 pixels",
        ),
        (r#"{"keys": [[0, "none.exr"]]}"#, "lights[0].file.keys[0][1]: "),
        (
            r#"{"keys": [[0, "noon.exr"]], "interpolation": "cubic"}"#,
            "by step or linear",
        ),
        (r#"{"keys": [[0, "noon.exr"]], "loop": true}"#, "loop"),
        ("7", "the name of a file, or an object with keys"),
    ] {
        let error = read(file).unwrap_err();
        assert!(error.contains(said), "{file}: {error}");
    }
}
