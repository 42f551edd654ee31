//! Lights, cameras and animation of hand-made glTF files. Independent truth: KHR_lights_punctual, glTF 2.0
//! (section 3.11 and appendix C), worked out by hand.
#![cfg(feature = "gltf")]

mod gltf_support;

use std::f32::consts::FRAC_1_SQRT_2 as SQRT_HALF;

use glam::{Vec3, vec3};
use gltf_support::Doc;
use relight_scene::animated::Animated;
use relight_scene::gltf::LightUnits;
use relight_scene::light::LightKind;
use relight_scene::scene::Scene;
use serde_json::{Value, json};

/// The triangle with these lights, and nodes from index 1 on, all of them roots.
fn lit(lights: Value, nodes: Value) -> Doc {
    let mut doc = Doc::triangle();
    doc.set(
        "/extensions",
        json!({ "KHR_lights_punctual": { "lights": lights } }),
    );
    let nodes = nodes.as_array().unwrap().clone();
    let roots: Vec<usize> = (0..=nodes.len()).collect();
    for node in nodes {
        doc.push("/nodes", node);
    }
    doc.set("/scenes/0/nodes", json!(roots));
    doc
}

fn light(index: usize) -> Value {
    json!({ "KHR_lights_punctual": { "light": index } })
}

/// Appends an animation channel; `interpolation` as in glTF.
fn animate(doc: &mut Doc, target: Value, times: &[f32], values: &[f32], kind: &str, interpolation: &str) {
    let (input, output) = (doc.floats(times, "SCALAR"), doc.floats(values, kind));
    if doc.json.get("animations").is_none() {
        doc.set("/animations", json!([]));
    }
    doc.push(
        "/animations",
        json!({
            "samplers": [{ "input": input, "output": output, "interpolation": interpolation }],
            "channels": [{ "sampler": 0, "target": target }],
        }),
    );
}

fn pointer(text: &str) -> Value {
    json!({ "path": "pointer", "extensions": { "KHR_animation_pointer": { "pointer": text } } })
}

fn has_note(scene: &Scene, part: &str) -> bool {
    scene.notes.iter().any(|note| note.contains(part))
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() < 1e-5
}

#[test]
fn punctual_lights_of_all_kinds() {
    let mut doc = lit(
        json!([
            { "type": "point", "color": [1, 0.5, 0], "intensity": 20, "name": "bulb", "range": 5 },
            { "type": "spot", "intensity": 3, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.6 } },
            { "type": "directional" },
        ]),
        json!([
            { "name": "torch", "translation": [1, 2, 3], "extensions": light(0) },
            { "extensions": light(0) },
            // Turned by -90 degrees about x: -z becomes -y. Scale is no matter for lights.
            { "rotation": [(-SQRT_HALF), 0, 0, SQRT_HALF], "scale": [2, 2, 2], "extensions": light(1) },
            { "extensions": light(2) },
        ]),
    );
    doc.set("/extensionsRequired", json!(["KHR_lights_punctual"]));
    let scene = doc.scene();
    let names: Vec<&str> = scene.sequence.lights.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["torch", "bulb", "light", "light.1"]);
    assert!(has_note(&scene, "range of lights is ignored"));
    assert_eq!((scene.sequence.frames, scene.sequence.fps), (1, 24.0));
    let LightKind::Point { position, intensity } = &scene.sequence.lights[0].kind else {
        panic!()
    };
    assert_eq!(*position, Animated::Constant(vec3(1.0, 2.0, 3.0)));
    assert_eq!(*intensity, Animated::Constant(vec3(20.0, 10.0, 0.0)));
    let LightKind::Spot {
        direction,
        inner_angle_deg,
        outer_angle_deg,
        ..
    } = &scene.sequence.lights[2].kind
    else {
        panic!()
    };
    assert!(close(direction.at(0.0), Vec3::NEG_Y));
    assert!(
        (inner_angle_deg.at(0.0) - 5.729578).abs() < 1e-4
            && (outer_angle_deg.at(0.0) - 34.377468).abs() < 1e-4
    );
    let LightKind::Directional {
        direction,
        irradiance,
    } = &scene.sequence.lights[3].kind
    else {
        panic!()
    };
    assert_eq!((direction.at(0.0), irradiance.at(0.0)), (Vec3::NEG_Z, Vec3::ONE));
}

#[test]
fn light_units_follow_blenders_exporter() {
    // A 100 W point or spot and a sun of 3 W/m²: raw keeps the numbers, unitless divides the watts by 4π.
    let four_pi = 4.0 * std::f32::consts::PI;
    let doc = |point: f32| {
        lit(
            json!([{ "type": "point", "intensity": point }, { "type": "spot", "intensity": point },
                   { "type": "directional", "intensity": 3 }]),
            json!([{ "extensions": light(0) }, { "extensions": light(1) }, { "extensions": light(2) }]),
        )
    };
    for (units, written) in [
        (LightUnits::Raw, 100.0),
        (LightUnits::Unitless, 100.0 / four_pi),
        (LightUnits::Spec, 100.0 / four_pi),
    ] {
        for light in doc(written).scene_with(units).sequence.lights {
            match light.kind {
                LightKind::Point { intensity, .. } | LightKind::Spot { intensity, .. } => {
                    assert!((intensity.at(0.0).x - 100.0 / four_pi).abs() < 1e-5, "{units:?}");
                }
                LightKind::Directional { irradiance, .. } => assert_eq!(irradiance.at(0.0).x, 3.0),
                _ => panic!(),
            }
        }
    }
}

#[test]
fn names_stay_unique_beside_the_emissive_entry() {
    let mut doc = lit(
        json!([{ "type": "point" }]),
        json!([
            { "name": "emissive", "extensions": light(0) }, { "name": "a", "extensions": light(0) },
            { "name": "a.1", "extensions": light(0) }, { "name": "a", "extensions": light(0) },
        ]),
    );
    doc.set("/materials", json!([{ "emissiveFactor": [1, 1, 1] }]));
    doc.set("/meshes/0/primitives/0/material", 0.into());
    let names: Vec<String> = doc.scene().sequence.lights.into_iter().map(|l| l.name).collect();
    assert_eq!(names, ["emissive.1", "a", "a.1", "a.2", "emissive"]);
}

#[test]
fn perspective_cameras_look_along_minus_z() {
    let mut doc = lit(
        json!([]),
        json!([
            { "name": "Eye", "camera": 0, "translation": [0, 0, 5] },
            { "name": "Eye", "camera": 0, "rotation": [0, SQRT_HALF, 0, SQRT_HALF] },
            { "camera": 1 },
        ]),
    );
    doc.set(
        "/cameras",
        json!([
            { "type": "perspective", "perspective": { "yfov": std::f32::consts::FRAC_PI_3, "znear": 0.1, "aspectRatio": 2 } },
            { "type": "orthographic", "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 1 } },
        ]),
    );
    let scene = doc.scene();
    assert!(has_note(&scene, "orthographic cameras left out: 1"));
    let [a, b] = &scene.cameras[..] else {
        panic!("two cameras")
    };
    assert_eq!(
        (a.name.as_str(), b.name.as_str(), a.aspect),
        ("Eye", "Eye.1", Some(2.0))
    );
    assert!((a.vfov_deg.at(0.0) - 60.0).abs() < 1e-4 && a.is_fixed());
    assert!(close(a.look_at.at(0.0), vec3(0.0, 0.0, 4.0)));
    // A quarter turn about y takes -z to -x.
    assert!(close(b.at(0.0).forward, Vec3::NEG_X) && close(b.at(0.0).up, Vec3::Y));
    assert!(scene.sequence.camera.is_none());
}

/// A point light under a moving, scaled parent.
fn moving(target: &str, times: &[f32], values: &[f32], kind: &str, interpolation: &str) -> Scene {
    let mut doc = lit(json!([{ "type": "point" }]), json!([]));
    doc.push("/nodes", json!({ "children": [2], "scale": [2, 2, 2] }));
    doc.push(
        "/nodes",
        json!({ "translation": [1, 0, 0], "extensions": light(0) }),
    );
    doc.set("/scenes/0/nodes", json!([0, 1]));
    animate(
        &mut doc,
        json!({ "node": 1, "path": target }),
        times,
        values,
        kind,
        interpolation,
    );
    doc.scene()
}

fn position(scene: &Scene, frame: f64) -> Vec3 {
    let LightKind::Point { position, .. } = &scene.sequence.lights[0].kind else {
        panic!()
    };
    position.at(frame)
}

#[test]
fn parents_carry_lights_linearly() {
    let scene = moving(
        "translation",
        &[0.5, 1.0],
        &[0., 0., 0., 0., 12., 0.],
        "VEC3",
        "LINEAR",
    );
    // The last key is at frame 24: frames 0 to 24.
    assert_eq!(scene.sequence.frames, 25);
    for (frame, y) in [(0.0, 0.0), (12.0, 0.0), (15.0, 3.0), (24.0, 12.0), (30.0, 12.0)] {
        assert!(close(position(&scene, frame), vec3(2.0, y, 0.0)), "frame {frame}");
    }
}

#[test]
fn rotations_are_slerped() {
    // From 0 to 90 degrees about z: at a third of the way 30 degrees, at distance 2 (scale 2).
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let scene = moving(
        "rotation",
        &[0.0, 1.0],
        &[0., 0., 0., 1., 0., 0., half, half],
        "VEC4",
        "LINEAR",
    );
    let angle = 30f32.to_radians();
    assert!(close(
        position(&scene, 8.0),
        vec3(2.0 * angle.cos(), 2.0 * angle.sin(), 0.0)
    ));
    // The negative quaternion is the same rotation: the short way round.
    let other = moving(
        "rotation",
        &[0.0, 1.0],
        &[0., 0., 0., 1., 0., 0., -half, -half],
        "VEC4",
        "LINEAR",
    );
    assert!(close(position(&other, 8.0), position(&scene, 8.0)));
}

#[test]
fn steps_hold_and_splines_bend() {
    let step = moving(
        "translation",
        &[0.0, 0.5, 1.0],
        &[0., 0., 0., 0., 1., 0., 0., 5., 0.],
        "VEC3",
        "STEP",
    );
    for (frame, y) in [(0.0, 0.0), (11.0, 0.0), (12.0, 1.0), (23.0, 1.0), (24.0, 5.0)] {
        assert_eq!(position(&step, frame).y, y, "frame {frame}");
    }
    // Hermite with tangents 0 and 8 over 1 s from 0 to 4, at t = 1/4:
    // 4 (3/16 - 2/64) + 8 (1/64 - 1/16) = 0.625 - 0.375.
    let keys = [
        0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 8., 0., 0., 4., 0., 0., 0., 0.,
    ];
    let cubic = moving("translation", &[0.0, 1.0], &keys, "VEC3", "CUBICSPLINE");
    assert!((position(&cubic, 6.0).y - 0.25).abs() < 1e-6);
}

#[test]
fn what_does_not_change_stays_constant() {
    let scene = moving(
        "translation",
        &[0.0, 2.0],
        &[1., 1., 1., 1., 1., 1.],
        "VEC3",
        "LINEAR",
    );
    let LightKind::Point { position, intensity } = &scene.sequence.lights[0].kind else {
        panic!()
    };
    assert_eq!(*position, Animated::Constant(vec3(3.0, 1.0, 1.0)));
    assert!(matches!(intensity, Animated::Constant(_)));
    assert_eq!(scene.sequence.frames, 49);
}

#[test]
fn cameras_move_with_their_nodes() {
    let mut doc = lit(json!([]), json!([{ "camera": 0 }]));
    doc.set(
        "/cameras",
        json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]),
    );
    animate(
        &mut doc,
        json!({ "node": 1, "path": "translation" }),
        &[0., 1.],
        &[0., 0., 0., 0., 0., 24.],
        "VEC3",
        "LINEAR",
    );
    animate(
        &mut doc,
        pointer("/cameras/0/perspective/yfov"),
        &[0., 1.],
        &[1.0, 0.5],
        "SCALAR",
        "LINEAR",
    );
    let scene = doc.scene();
    let camera = &scene.cameras[0];
    assert!(
        close(camera.position.at(5.0), vec3(0.0, 0.0, 5.0))
            && close(camera.look_at.at(5.0), vec3(0.0, 0.0, 4.0))
    );
    assert!((camera.vfov_deg.at(12.0) - 0.75f32.to_degrees()).abs() < 1e-4);
    assert!(matches!(camera.up, Animated::Constant(_)));
}

#[test]
fn pointers_animate_lights() {
    let mut doc = lit(
        json!([{ "type": "spot", "intensity": 2, "color": [1, 1, 0.5], "spot": { "outerConeAngle": 0.5 } }]),
        json!([{ "extensions": light(0) }]),
    );
    let root = "/extensions/KHR_lights_punctual/lights/0";
    let at = |name: &str| pointer(&format!("{root}/{name}"));
    animate(
        &mut doc,
        at("intensity"),
        &[0., 1.],
        &[0., 24.],
        "SCALAR",
        "LINEAR",
    );
    animate(
        &mut doc,
        at("color"),
        &[0., 1.],
        &[1., 0., 0., 0., 1., 0.],
        "VEC3",
        "STEP",
    );
    animate(
        &mut doc,
        at("spot/innerConeAngle"),
        &[0., 1.],
        &[0., 1.0],
        "SCALAR",
        "LINEAR",
    );
    animate(
        &mut doc,
        at("spot/outerConeAngle"),
        &[0., 1.],
        &[0.5, 1.0],
        "SCALAR",
        "LINEAR",
    );
    animate(&mut doc, at("range"), &[0., 9.], &[1., 2.], "SCALAR", "LINEAR");
    animate(
        &mut doc,
        pointer("/materials/0/emissiveFactor"),
        &[0., 9.],
        &[1., 2.],
        "SCALAR",
        "LINEAR",
    );
    doc.set("/extensionsRequired", json!(["KHR_animation_pointer"]));
    let scene = doc.scene();
    assert_eq!(
        scene.sequence.frames, 25,
        "what is left out does not lengthen the animation"
    );
    assert!(has_note(&scene, "lights/0/range is left out") && has_note(&scene, "emissiveFactor is left out"));
    let LightKind::Spot {
        intensity,
        inner_angle_deg,
        outer_angle_deg,
        position,
        ..
    } = &scene.sequence.lights[0].kind
    else {
        panic!()
    };
    assert!(close(intensity.at(5.0), vec3(5.0, 0.0, 0.0)) && close(intensity.at(24.0), vec3(0.0, 24.0, 0.0)));
    assert!((inner_angle_deg.at(12.0) - 0.5f32.to_degrees()).abs() < 1e-4);
    assert!((outer_angle_deg.at(12.0) - 0.75f32.to_degrees()).abs() < 1e-4);
    assert!(matches!(position, Animated::Constant(_)));
}

#[test]
fn meshes_stay_at_rest_with_a_note() {
    let mut doc = Doc::triangle();
    doc.set("/nodes/0/translation", json!([1, 0, 0]));
    doc.set("/nodes/0/skin", 0.into());
    doc.set("/skins", json!([{ "joints": [0] }]));
    doc.set("/meshes/0/primitives/0/targets", json!([{ "POSITION": 0 }]));
    animate(
        &mut doc,
        json!({ "node": 0, "path": "translation" }),
        &[0., 1.],
        &[0.; 6],
        "VEC3",
        "LINEAR",
    );
    animate(
        &mut doc,
        json!({ "node": 0, "path": "weights" }),
        &[0., 1.],
        &[0.; 2],
        "SCALAR",
        "LINEAR",
    );
    let scene = doc.scene();
    assert_eq!(scene.instances[0].world_from_mesh.translation, glam::Vec3A::X);
    assert_eq!(scene.sequence.frames, 1);
    for note in [
        "animated nodes with meshes, which stay at rest: 1",
        "skinned meshes, imported at rest: 1",
        "morph targets, imported at rest: 1",
        "animations of morph targets left out: 1",
    ] {
        assert!(has_note(&scene, note), "{note}: {:?}", scene.notes);
    }
}

#[test]
fn the_first_of_two_animations_of_one_property_counts() {
    let mut doc = lit(json!([{ "type": "point" }]), json!([{ "extensions": light(0) }]));
    let target = json!({ "node": 1, "path": "translation" });
    animate(
        &mut doc,
        target.clone(),
        &[0., 1.],
        &[0., 0., 0., 24., 0., 0.],
        "VEC3",
        "LINEAR",
    );
    animate(
        &mut doc,
        target,
        &[0., 9.],
        &[0., 0., 0., 0., 24., 0.],
        "VEC3",
        "LINEAR",
    );
    let scene = doc.scene();
    assert!(close(position(&scene, 24.0), vec3(24.0, 0.0, 0.0)));
    assert!(has_note(&scene, "drive what an earlier one drives already"));
}

/// Truth: EXT_lights_ies: the aim is the node's −Z, and its X/Y plane the horizontal photometric one.
#[test]
fn photometric_lamps() {
    let file = "TILT=NONE%0A1 -1 1 2 1 1 2 0 0 0%0A1 1 9%0A0 90%0A0%0A50 0";
    let lamp = |uri: &str, node: Value| {
        let mut doc = lit(json!([]), json!([]));
        doc.set(
            "/extensions",
            json!({ "EXT_lights_ies": { "lights": [{ "uri": uri, "name": "downlight" }] } }),
        );
        doc.push("/nodes", node);
        doc.set("/scenes/0/nodes", json!([0, 1]));
        doc.set("/extensionsRequired", json!(["EXT_lights_ies"]));
        doc
    };
    let here = |more: Value| json!({ "EXT_lights_ies": more });
    let uri = format!("data:application/x-ies-lm-63,{file}");
    // Turned by -90 degrees about x: -z becomes -y, x stays.
    let node = json!({ "translation": [1, 2, 3], "rotation": [(-SQRT_HALF), 0, 0, SQRT_HALF],
        "extensions": here(json!({ "light": 0, "multiplier": 2, "color": [1, 0.5, 7] })) });
    let scene = lamp(&uri, node.clone()).scene();
    let [light] = &scene.sequence.lights[..] else {
        panic!("one light")
    };
    let LightKind::Ies {
        profile,
        file,
        position,
        direction,
        up,
        scale,
    } = &light.kind
    else {
        panic!()
    };
    assert_eq!((light.name.as_str(), profile.peak()), ("downlight", 50.0));
    assert!(file.starts_with("TILT=NONE\n") && has_note(&scene, "50 cd at most"));
    assert_eq!(*position, Animated::Constant(vec3(1.0, 2.0, 3.0)));
    assert!(close(direction.at(0.0), Vec3::NEG_Y) && close(up.at(0.0), Vec3::X));
    assert_eq!(*scale, Animated::Constant(vec3(2.0, 1.0, 2.0)));
    let mut hidden = node.clone();
    hidden["extensions"]["KHR_node_visibility"] = json!({ "visible": false });
    assert!(lamp(&uri, hidden).scene().sequence.lights.is_empty());
    let node = |more: Value| json!({ "extensions": here(more) });
    for (uri, more, said) in [
        (
            "data:,no lamp",
            json!({ "light": 0 }),
            "EXT_lights_ies.lights[0]: is no photometric file",
        ),
        (uri.as_str(), json!({ "light": 1 }), "light"),
        (
            uri.as_str(),
            json!({ "light": 0, "multiplier": -1 }),
            "multiplier: must be a number of at least 0",
        ),
    ] {
        let error = lamp(uri, node(more)).import().unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

/// Truth: the draft's text of EXT_lights_area: centred on the node, shining along its −Z, width along X and height along Y, both times the
/// largest scale; a disc's area is π d²/4.
#[test]
fn area_lights() {
    let here = |more: Value| json!({ "EXT_lights_area": more });
    let lit_by = |light: Value, node: Value| {
        let mut doc = lit(json!([]), json!([]));
        doc.set("/extensions", here(json!({ "lights": [light] })));
        doc.push("/nodes", node);
        doc.set("/scenes/0/nodes", json!([0, 1]));
        doc.set("/extensionsRequired", json!(["EXT_lights_area"]));
        doc
    };
    // Turned by -90 degrees about x: -z becomes -y, y becomes -z.
    let node = json!({ "translation": [1, 2, 3], "rotation": [(-SQRT_HALF), 0, 0, SQRT_HALF],
        "scale": [1, -3, 2], "extensions": here(json!({ "light": 0 })) });
    let rectangle = |light: Value| {
        let scene = lit_by(light, node.clone()).scene();
        let [light] = &scene.sequence.lights[..] else {
            panic!("one light")
        };
        let LightKind::Rect {
            center,
            edge_u,
            edge_v,
            radiance,
        } = &light.kind
        else {
            panic!("a rectangle")
        };
        assert_eq!(*center, Animated::Constant(vec3(1.0, 2.0, 3.0)));
        let [u, v] = [edge_u.at(0.0), edge_v.at(0.0)];
        assert!(close(u.cross(v).normalize(), Vec3::NEG_Y), "{u} {v}");
        let noted = has_note(&scene, "discs of EXT_lights_area taken as squares");
        (light.name.clone(), u.abs(), v.abs(), radiance.at(0.0), noted)
    };
    let (name, u, v, radiance, noted) = rectangle(json!({ "type": "rect", "name": "softbox", "size": 0.5,
        "rect": { "aspect": 4 }, "color": [1, 0.5, 0], "intensity": 200 }));
    assert_eq!((name.as_str(), noted), ("softbox", false));
    assert!(
        close(u, vec3(6.0, 0.0, 0.0)) && close(v, vec3(0.0, 0.0, 1.5)),
        "{u} {v}"
    );
    assert!(close(radiance, vec3(200.0, 100.0, 0.0)));
    let (_, u, v, radiance, noted) = rectangle(json!({ "type": "disk", "size": 2 }));
    let area = std::f32::consts::PI * 9.0;
    assert!(
        noted && (u.length() * v.length() / area - 1.0).abs() < 1e-5,
        "{u} {v}"
    );
    assert!(close(radiance, Vec3::splat(1000.0)));
    // As an earlier draft had them.
    let (_, u, v, ..) = rectangle(json!({ "shape": "rect", "width": 2, "height": 1 }));
    assert!(
        close(u, vec3(6.0, 0.0, 0.0)) && close(v, vec3(0.0, 0.0, 3.0)),
        "{u} {v}"
    );
    for (light, said) in [
        (json!({ "type": "tube" }), "type: must be \"rect\" or \"disk\""),
        (json!({ "type": "rect", "size": 0 }), "size: must be above 0"),
        (
            json!({ "type": "rect", "rect": { "aspect": -1 } }),
            "rect: needs an aspect above 0",
        ),
        (json!({ "type": "rect", "intensity": -1 }), "intensity: is -1e0"),
        (json!({ "type": "rect", "intensity": 3e38 }), "intensity: is 3e38"),
    ] {
        let error = lit_by(light, node.clone()).import().unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    // It doesn't shine where its node is hidden.
    let mut hidden = node.clone();
    hidden["extensions"]["KHR_node_visibility"] = json!({ "visible": false });
    let scene = lit_by(json!({ "type": "rect" }), hidden).scene();
    assert!(scene.sequence.lights.is_empty(), "{:?}", scene.sequence.lights);
}

/// A rectangle that turns and grows with its node. Truth: the node's own axes at a frame.
#[test]
fn area_lights_move_with_their_nodes() {
    let mut doc = lit(json!([]), json!([]));
    let of = |more: Value| json!({ "EXT_lights_area": more });
    doc.set("/extensions", of(json!({ "lights": [{ "type": "rect" }] })));
    doc.push("/nodes", json!({ "extensions": of(json!({ "light": 0 })) }));
    doc.set("/scenes/0/nodes", json!([0, 1]));
    let target = |path: &str| json!({ "node": 1, "path": path });
    let quarter = [0., 0., 0., 1., 0., SQRT_HALF, 0., SQRT_HALF];
    animate(
        &mut doc,
        target("rotation"),
        &[0., 1.],
        &quarter,
        "VEC4",
        "LINEAR",
    );
    animate(
        &mut doc,
        target("scale"),
        &[0., 1.],
        &[1., 1., 1., 2., 2., 2.],
        "VEC3",
        "LINEAR",
    );
    let scene = doc.scene();
    let LightKind::Rect { edge_u, edge_v, .. } = &scene.sequence.lights[0].kind else {
        panic!("a rectangle")
    };
    let sides = |frame: f64| [edge_u.at(frame), edge_v.at(frame)];
    let [u, v] = sides(0.0);
    assert!(close(u.cross(v), Vec3::NEG_Z), "{u} {v}");
    // A quarter about +Y: -z becomes -x.
    let [u, v] = sides(24.0);
    assert!(close(u.cross(v), 4.0 * Vec3::NEG_X), "{u} {v}");
}
