//! The scene of implicit and volumetric surfaces, read again from its files as `data/README.md` defines them.

use glam::DVec3;
use relight_data_generate::isosurface;
use serde_json::Value;

fn vec3(v: &Value) -> DVec3 {
    let a: Vec<f64> = v
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect();
    DVec3::from_slice(&a)
}

/// The value of a tree of primitives at a point: negative inside.
fn sdf(node: &Value, p: DVec3) -> f64 {
    let (kind, v) = node.as_object().unwrap().iter().next().unwrap();
    let number = |key: &str| v[key].as_f64().unwrap();
    let of = || v["of"].as_array().unwrap().iter().map(|child| sdf(child, p));
    match kind.as_str() {
        "sphere" => p.distance(vec3(&v["center"])) - number("radius"),
        "ellipsoid" => {
            let (q, r) = (p - vec3(&v["center"]), vec3(&v["radii"]));
            let (a, b) = ((q / r).length(), (q / (r * r)).length());
            if b > 0.0 {
                a * (a - 1.0) / b
            } else {
                -r.min_element()
            }
        }
        "torus" => {
            let q = p - vec3(&v["center"]);
            (q.x.hypot(q.z) - number("major")).hypot(q.y) - number("minor")
        }
        "rounded_cylinder" => {
            let (q, rounding) = (p - vec3(&v["center"]), number("rounding"));
            let a = q.x.hypot(q.z) - (number("radius") - rounding);
            let b = q.y.abs() - (number("half_height") - rounding);
            a.max(b).min(0.0) + a.max(0.0).hypot(b.max(0.0)) - rounding
        }
        "union" => of().reduce(f64::min).unwrap(),
        "intersection" => of().reduce(f64::max).unwrap(),
        "difference" => of().reduce(|a, b| a.max(-b)).unwrap(),
        "smooth_union" => {
            let k = number("k");
            let blend = |a: f64, b: f64| {
                let h = (0.5 + 0.5 * (b - a) / k).clamp(0.0, 1.0);
                b + (a - b) * h - k * h * (1.0 - h)
            };
            of().reduce(blend).unwrap()
        }
        other => panic!("unknown primitive {other}"),
    }
}

fn scene() -> Value {
    let files = isosurface::files();
    serde_json::from_slice(&files.iter().find(|f| f.0 == "isosurface.scene.json").unwrap().1).unwrap()
}

/// Points of a regular lattice over a box, `n` per axis.
fn lattice(low: DVec3, high: DVec3, n: usize) -> impl Iterator<Item = DVec3> {
    (0..n * n * n).map(move |i| {
        let t = DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) / (n - 1) as f64;
        low + (high - low) * t
    })
}

#[test]
fn implicit_surfaces_close_within_their_bounds() {
    for object in scene()["implicits"].as_array().unwrap() {
        let (low, high) = (vec3(&object["bounds"][0]), vec3(&object["bounds"][1]));
        let value = |p| sdf(&object["sdf"], p);
        assert!(
            lattice(low, high, 40).any(|p| value(p) < 0.0),
            "{}: something is inside",
            object["name"]
        );
        let on_border = |p: &DVec3| (*p - low).min_element() < 1e-9 || (high - *p).min_element() < 1e-9;
        let least = lattice(low, high, 40)
            .filter(on_border)
            .map(value)
            .fold(f64::INFINITY, f64::min);
        assert!(least > 0.0, "{}: {least} on the border", object["name"]);
    }
}

/// What the README promises to a sphere tracer: a step of 0.9 times the value never passes through a surface.
#[test]
fn implicit_values_grow_at_most_by_a_tenth_faster_than_distance() {
    for object in scene()["implicits"].as_array().unwrap() {
        let (low, high) = (vec3(&object["bounds"][0]), vec3(&object["bounds"][1]));
        let value = |p| sdf(&object["sdf"], p);
        // Central differences; 1e-6 m resolves the smallest radius, 2 cm, and stays far above rounding.
        let e = 1e-6;
        let steepest = lattice(low, high, 60)
            .filter(|&p| value(p) > 0.0)
            .map(|p| {
                let slope = |axis: DVec3| (value(p + axis * e) - value(p - axis * e)) / (2.0 * e);
                DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).length()
            })
            .fold(0.0, f64::max);
        assert!(steepest < 1.0 / 0.9, "{}: {steepest}", object["name"]);
    }
}

#[test]
fn volumes_hold_a_closed_surface_and_have_the_stated_size() {
    let files = isosurface::files();
    let mut seen = 0;
    for volume in scene()["volumes"].as_array().unwrap() {
        let name = volume["file"].as_str().unwrap();
        let bytes = &files.iter().find(|f| f.0 == name).unwrap().1;
        let n: Vec<usize> = volume["size"]
            .as_array()
            .unwrap()
            .iter()
            .map(|x| x.as_u64().unwrap() as usize)
            .collect();
        assert_eq!(bytes.len(), n[0] * n[1] * n[2], "{name}");
        let level = volume["level"].as_u64().unwrap();
        let mut inside = 0;
        for (i, &density) in bytes.iter().enumerate() {
            let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
            if u64::from(density) > level {
                inside += 1;
                assert!(
                    (0..3).all(|k| at[k] > 0 && at[k] < n[k] - 1),
                    "{name}: the surface reaches the border"
                );
            }
        }
        // A trunk of a few per cent, leaves of some fifteen: neither empty nor a block.
        assert!(
            inside * 100 > bytes.len() && inside * 4 < bytes.len(),
            "{name}: {inside} samples inside"
        );
        seen += 1;
    }
    assert_eq!(seen, 2);
}

#[test]
fn the_camera_looks_at_the_pot() {
    let scene = scene();
    let eye = vec3(&scene["camera"]["position"]);
    let direction = (vec3(&scene["camera"]["look_at"]) - eye).normalize();
    let pot = &scene["implicits"][0];
    // The view's middle passes a hand above the pot, where the trunk stands; a little lower it meets the pot.
    let lower = (direction - DVec3::Y * 0.08).normalize();
    let met = (0..4000).any(|k| sdf(&pot["sdf"], eye + lower * (f64::from(k) * 1e-3)) < 0.0);
    assert!(met);
}
