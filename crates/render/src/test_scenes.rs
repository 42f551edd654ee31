//! Scenes and lights that unit tests share, built in code.

use glam::{Affine3A, Vec3, Vec4};
use relight_scene::animated::Animated;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::material::{AlphaMode, Material};
use relight_scene::photometry::Photometry;
use relight_scene::scene::{Instance, Mesh, Scene};
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

/// An axis-aligned box, fronts outwards or inwards.
pub fn cuboid(low: Vec3, high: Vec3, inwards: bool, material: u32) -> Mesh {
    let positions: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32))
        .map(|p| low + (high - low) * p)
        .collect();
    let middle = (low + high) * 0.5;
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
            let outwards = (q - p).cross(r - p).dot(p + q + r - middle * 3.0) > 0.0;
            triangles.push(if outwards != inwards { [i, j, k] } else { [i, k, j] });
        }
    }
    Mesh {
        positions,
        triangles,
        material,
        ..Mesh::default()
    }
}

/// The box from −1 to 1, fronts inwards.
pub fn room(material: u32) -> Mesh {
    cuboid(Vec3::splat(-1.0), Vec3::ONE, true, material)
}

pub fn traced(meshes: Vec<Mesh>, materials: Vec<Material>) -> TracedScene {
    traced_with(meshes, materials, Shading::Lambert)
}

pub fn traced_with(meshes: Vec<Mesh>, materials: Vec<Material>, shading: Shading) -> TracedScene {
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
        ..Scene::default()
    };
    TracedScene::new(Arc::new(scene), shading).unwrap()
}

/// A floor, and over it a small plate of the given material that faces down.
pub fn stage(plate: Material) -> TracedScene {
    let at = |x: f32, z: f32| Vec3::new(x - 0.4, 0.7, z - 0.6);
    let lamp = quad([at(0.0, 0.0), at(0.3, 0.0), at(0.3, 0.3), at(0.0, 0.3)], 1);
    traced(vec![level(2.0, 0.0, 0), lamp], vec![matt(0.6, 0.0), plate])
}

/// What lets some of all rays pass, alpha of them not.
pub fn blended(color: Vec3, alpha: f32, emission: f32) -> Material {
    Material {
        base_color: Vec4::from((color, alpha)),
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        ..matt(0.5, emission)
    }
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

pub fn spot(position: Vec3, outer_angle_deg: f32) -> LightTrack {
    let kind = LightKind::Spot {
        position: constant(position),
        direction: constant(Vec3::new(0.1, -1.0, 0.2)),
        inner_angle_deg: constant(15.0),
        outer_angle_deg: constant(outer_angle_deg),
        intensity: constant(Vec3::new(3.0, 4.0, 5.0)),
    };
    light("spot", kind)
}

pub fn spot_inside() -> LightTrack {
    spot(Vec3::new(0.2, 0.9, 0.1), 60.0)
}

/// A lamp that was measured: a beam aslant, and some light up at one side.
pub fn measured(position: Vec3, scale: f32) -> LightTrack {
    let file = "IES:LM-63-2019\nTILT=NONE\n1 -1 1 6 4 1 2 0 0 0\n1 1 60\n0 15 40 90 120 180\n0 90 180 360\n\
        3 3 1 0.3 0 0\n3 2 1 0.5 0 0\n3 3 0.5 0.3 0.6 0\n3 3 1 0.3 0 0\n";
    let kind = LightKind::Ies {
        profile: Arc::new(Photometry::parse(file).unwrap()),
        file: file.into(),
        position: constant(position),
        direction: constant(Vec3::new(0.3, -1.0, 0.2)),
        up: constant(Vec3::X),
        scale: constant(Vec3::new(1.0, 0.7, 0.5) * scale),
    };
    light("measured", kind)
}

pub fn sun() -> LightTrack {
    let kind = LightKind::Directional {
        direction: constant(Vec3::new(0.3, -1.0, 0.1)),
        irradiance: constant(Vec3::new(3.0, 2.0, 1.0)),
    };
    light("sun", kind)
}

pub fn rect(name: &str, center: Vec3, edges: [Vec3; 2], radiance: Vec3) -> LightTrack {
    let kind = LightKind::Rect {
        center: constant(center),
        edge_u: constant(edges[0]),
        edge_v: constant(edges[1]),
        radiance: constant(radiance),
    };
    light(name, kind)
}

pub fn panel() -> LightTrack {
    let edges = [Vec3::X, Vec3::Z * 0.5];
    rect("panel", Vec3::new(0.5, 1.0, 0.0), edges, Vec3::new(3.0, 2.0, 1.0))
}

pub fn ball(center: Vec3, radius: f32, radiance: Vec3) -> LightTrack {
    let kind = LightKind::Sphere {
        center: constant(center),
        radius: constant(radius),
        radiance: constant(radiance),
    };
    light("globe", kind)
}

pub fn globe() -> LightTrack {
    ball(Vec3::new(-0.7, 0.5, 0.3), 0.2, Vec3::new(1.0, 5.0, 2.0))
}

pub fn even_sky(radiance: f32) -> LightTrack {
    let kind = LightKind::Environment {
        maps: Arc::new(EnvironmentMap {
            width: 8,
            height: 4,
            pixels: vec![Vec3::splat(radiance); 32],
        })
        .into(),
        file: String::new().into(),
        scale: constant(Vec3::ONE),
        rotation_deg: constant(0.0),
    };
    light("sky", kind)
}

pub fn sky() -> LightTrack {
    let pixels =
        (0..32 * 16).map(|i| Vec3::new(0.2, 0.3, 0.5) * if i == 133 { 500.0 } else { 1.0 + (i % 7) as f32 });
    let kind = LightKind::Environment {
        maps: Arc::new(EnvironmentMap {
            width: 32,
            height: 16,
            pixels: pixels.collect(),
        })
        .into(),
        file: String::new().into(),
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

/// What materials emit, so many times.
pub fn emitted(scale: f32) -> LightTrack {
    let scale = constant(Vec3::splat(scale));
    light(
        "glow",
        LightKind::Emissive {
            material: None,
            scale,
        },
    )
}

pub fn glow() -> LightTrack {
    emitted(2.0)
}
