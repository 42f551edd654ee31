//! Scenes and lights that unit tests share, built in code.

use glam::{Affine3A, Vec3};
use relight_scene::animated::Animated;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::material::Material;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::sequence::Sequence;
use relight_scene::traced::{Shading, TracedScene};
use std::sync::Arc;

pub fn constant<T>(value: T) -> Animated<T> {
    Animated::Constant(value)
}

pub fn matt(albedo: f32, emission: f32) -> Material {
    Material {
        name: "matt".into(),
        base_color: Vec3::splat(albedo).extend(1.0),
        metallic: 0.0,
        emission: Vec3::splat(emission),
        ..Material::default()
    }
}

pub fn quad(corners: [Vec3; 4], material: u32) -> Mesh {
    Mesh {
        positions: corners.to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material,
        ..Mesh::default()
    }
}

pub fn level(half: f32, height: f32, material: u32) -> Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
    quad(
        [
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
            corner(-1.0, -1.0),
        ],
        material,
    )
}

/// The box from −1 to 1, fronts inwards.
pub fn room(material: u32) -> Mesh {
    let positions: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * 2.0 - 1.0)
        .collect();
    let mut triangles = Vec::new();
    for [a, b, c, d] in [
        [0, 1, 3, 2],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 2, 6, 4],
        [1, 3, 7, 5],
    ] {
        for [i, j, k] in [[a, b, c], [a, c, d]] {
            let [p, q, r] = [i, j, k].map(|v: u32| positions[v as usize]);
            let outwards = (q - p).cross(r - p).dot(p + q + r) > 0.0;
            triangles.push(if outwards { [i, k, j] } else { [i, j, k] });
        }
    }
    Mesh {
        positions,
        triangles,
        material,
        ..Mesh::default()
    }
}

pub fn traced(meshes: Vec<Mesh>, materials: Vec<Material>) -> TracedScene {
    let instances = (0..meshes.len() as u32)
        .map(|mesh| Instance {
            mesh,
            world_from_mesh: Affine3A::IDENTITY,
        })
        .collect();
    let scene = Scene {
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        cameras: Vec::new(),
        sequence: Sequence {
            frames: 1,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        notes: Vec::new(),
    };
    TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap()
}

pub fn camera(position: Vec3, look_at: Vec3, vfov_deg: f32) -> Camera {
    CameraTrack {
        name: String::new(),
        position: constant(position),
        look_at: constant(look_at),
        up: constant(Vec3::new(0.1, 1.0, 0.2)),
        vfov_deg: constant(vfov_deg),
        aspect: None,
    }
    .at(0.0)
}

pub fn light(name: &str, kind: LightKind) -> LightTrack {
    LightTrack {
        name: name.into(),
        kind,
    }
}

pub fn bulb(position: Vec3, intensity: f32) -> LightTrack {
    light(
        "bulb",
        LightKind::Point {
            position: constant(position),
            intensity: constant(Vec3::splat(intensity)),
        },
    )
}

pub fn spot() -> LightTrack {
    let kind = LightKind::Spot {
        position: constant(Vec3::new(0.2, 1.5, 0.1)),
        direction: constant(Vec3::new(0.1, -1.0, 0.2)),
        inner_angle_deg: constant(15.0),
        outer_angle_deg: constant(40.0),
        intensity: constant(Vec3::new(3.0, 4.0, 5.0)),
    };
    light("spot", kind)
}

pub fn sun() -> LightTrack {
    let kind = LightKind::Directional {
        direction: constant(Vec3::new(0.3, -1.0, 0.1)),
        irradiance: constant(Vec3::new(3.0, 2.0, 1.0)),
    };
    light("sun", kind)
}

pub fn panel() -> LightTrack {
    let kind = LightKind::Rect {
        center: constant(Vec3::new(0.5, 1.0, 0.0)),
        edge_u: constant(Vec3::X),
        edge_v: constant(Vec3::Z * 0.5),
        radiance: constant(Vec3::new(3.0, 2.0, 1.0)),
    };
    light("panel", kind)
}

pub fn globe() -> LightTrack {
    let kind = LightKind::Sphere {
        center: constant(Vec3::new(-0.7, 0.5, 0.3)),
        radius: constant(0.2),
        radiance: constant(Vec3::new(1.0, 5.0, 2.0)),
    };
    light("globe", kind)
}

pub fn sky() -> LightTrack {
    let pixels =
        (0..32 * 16).map(|i| Vec3::new(0.2, 0.3, 0.5) * if i == 133 { 500.0 } else { 1.0 + (i % 7) as f32 });
    let kind = LightKind::Environment {
        map: Arc::new(EnvironmentMap {
            width: 32,
            height: 16,
            pixels: pixels.collect(),
        }),
        file: String::new(),
        scale: constant(Vec3::new(1.0, 0.5, 2.0)),
        rotation_deg: constant(70.0),
    };
    light("sky", kind)
}

pub fn day() -> LightTrack {
    let kind = LightKind::SunSky {
        turbidity: constant(3.0),
        sun_direction: constant(Vec3::new(0.3, 0.7, 0.2)),
        scale: constant(Vec3::ONE),
    };
    light("day", kind)
}

pub fn glow() -> LightTrack {
    light(
        "glow",
        LightKind::Emissive {
            material: None,
            scale: constant(Vec3::splat(2.0)),
        },
    )
}
