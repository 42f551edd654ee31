//! Small scenes made in code.

use glam::{Affine3A, Vec2, Vec3, Vec4};
use relight_scene::animated::Animated;
use relight_scene::camera::CameraTrack;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::material::Material;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::sequence::Sequence;

/// A matt material.
pub fn matt(albedo: Vec3) -> Material {
    Material {
        base_color: albedo.extend(1.0),
        metallic: 0.0,
        ..Material::default()
    }
}

/// A matt material that emits radiance 1.
pub fn glowing(albedo: f32) -> Material {
    Material {
        emission: Vec3::ONE,
        ..matt(Vec3::splat(albedo))
    }
}

/// Four corners, counter-clockwise seen from the front, each side in `parts`.
pub fn quad(corners: [Vec3; 4], parts: u32) -> Mesh {
    let [a, b, c, d] = corners;
    let mut mesh = Mesh::default();
    let n = parts + 1;
    for j in 0..n {
        for i in 0..n {
            let (u, v) = (i as f32 / parts as f32, j as f32 / parts as f32);
            mesh.positions.push(a.lerp(b, u).lerp(d.lerp(c, u), v));
        }
    }
    for j in 0..parts {
        for i in 0..parts {
            let k = j * n + i;
            mesh.triangles
                .extend([[k, k + 1, k + n + 1], [k, k + n + 1, k + n]]);
        }
    }
    mesh
}

/// Puts `other` behind the triangles of `mesh`.
pub fn join(mesh: &mut Mesh, other: &Mesh) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(&other.positions);
    mesh.normals.extend(&other.normals);
    mesh.triangles
        .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
}

/// The six faces of a box seen from inside (or from outside): x−, x+, y−, y+, z−, z+.
pub fn faces(low: Vec3, high: Vec3, inside: bool) -> [Mesh; 6] {
    let at = |x: bool, y: bool, z: bool| {
        let pick = |upper: bool, axis: usize| if upper { high[axis] } else { low[axis] };
        Vec3::new(pick(x, 0), pick(y, 1), pick(z, 2))
    };
    let (f, t) = (false, true);
    [
        [at(f, f, f), at(f, t, f), at(f, t, t), at(f, f, t)],
        [at(t, f, f), at(t, f, t), at(t, t, t), at(t, t, f)],
        [at(f, f, f), at(f, f, t), at(t, f, t), at(t, f, f)],
        [at(f, t, f), at(t, t, f), at(t, t, t), at(f, t, t)],
        [at(f, f, f), at(t, f, f), at(t, t, f), at(f, t, f)],
        [at(f, f, t), at(f, t, t), at(t, t, t), at(t, f, t)],
    ]
    .map(|[a, b, c, d]| quad(if inside { [a, b, c, d] } else { [d, c, b, a] }, 1))
}

/// A box of one piece.
pub fn cuboid(low: Vec3, high: Vec3, inside: bool) -> Mesh {
    let mut mesh = Mesh::default();
    faces(low, high, inside)
        .iter()
        .for_each(|face| join(&mut mesh, face));
    mesh
}

/// A sphere of radius 1 about the origin as a cube blown up, `parts` squares along an edge, with smooth normals; seen
/// from inside or from outside. Its vertices lie on the sphere; with 32 parts flat triangles are off by 3e-4 of the area.
pub fn sphere(parts: u32, inside: bool) -> Mesh {
    let mut mesh = Mesh::default();
    for face in faces(Vec3::NEG_ONE, Vec3::ONE, inside) {
        let corners = [
            face.positions[0],
            face.positions[1],
            face.positions[3],
            face.positions[2],
        ];
        let mut piece = quad(corners, parts);
        for p in &mut piece.positions {
            // Equal angles along each edge, so that triangles are of about one size.
            *p = p
                .map_axes(|x| (x * std::f32::consts::FRAC_PI_4).tan())
                .normalize();
        }
        piece.normals = piece
            .positions
            .iter()
            .map(|&p| if inside { -p } else { p })
            .collect();
        join(&mut mesh, &piece);
    }
    mesh
}

trait MapAxes {
    fn map_axes(self, f: impl Fn(f32) -> f32) -> Self;
}

impl MapAxes for Vec3 {
    fn map_axes(self, f: impl Fn(f32) -> f32) -> Vec3 {
        Vec3::new(f(self.x), f(self.y), f(self.z))
    }
}

/// A scene of meshes with a material each, seen by a camera.
pub fn scene(parts: Vec<(Mesh, Material)>, eye: Vec3, target: Vec3) -> Scene {
    let (mut meshes, mut instances, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (mesh, material)) in parts.into_iter().enumerate() {
        meshes.push(Mesh {
            material: i as u32,
            ..mesh
        });
        instances.push(Instance {
            mesh: i as u32,
            world_from_mesh: Affine3A::IDENTITY,
        });
        materials.push(Material {
            name: format!("material {i}"),
            ..material
        });
    }
    Scene {
        meshes,
        instances,
        materials,
        textures: Vec::new(),
        cameras: vec![camera(eye, target, 70.0)],
        sequence: Sequence {
            frames: 1,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        ..Scene::default()
    }
}

/// A camera that stands still.
pub fn camera(eye: Vec3, target: Vec3, vfov_deg: f32) -> CameraTrack {
    CameraTrack {
        name: "camera".into(),
        position: Animated::Constant(eye),
        look_at: Animated::Constant(target),
        up: Animated::Constant(Vec3::Y),
        vfov_deg: Animated::Constant(vfov_deg),
        aspect: Some(1.0),
    }
}

/// The scene with all lengths times `factor`.
pub fn scaled(mut scene: Scene, factor: f32) -> Scene {
    for p in scene.meshes.iter_mut().flat_map(|m| &mut m.positions) {
        *p *= factor;
    }
    for track in &mut scene.cameras {
        for place in [&mut track.position, &mut track.look_at] {
            *place = Animated::Constant(place.at(0.0) * factor);
        }
    }
    scene
}

/// Vertex colours from a function of the position.
pub fn painted(mut mesh: Mesh, color: impl Fn(Vec3) -> Vec3) -> Mesh {
    mesh.colors = mesh
        .positions
        .iter()
        .map(|&p| -> Vec4 { color(p).extend(1.0) })
        .collect();
    mesh
}

/// A closed room of edge 2 m about the origin with a red and a green wall, and a box in it.
pub fn room() -> Scene {
    let [left, right, floor, ceiling, back, front] = faces(Vec3::NEG_ONE, Vec3::ONE, true);
    let mut white = floor;
    [&ceiling, &back, &front]
        .into_iter()
        .for_each(|face| join(&mut white, face));
    let block = cuboid(Vec3::new(-0.6, -1.0, -0.5), Vec3::new(0.1, 0.1, 0.2), false);
    scene(
        vec![
            (white, matt(Vec3::splat(0.7))),
            (left, matt(Vec3::new(0.6, 0.1, 0.1))),
            (right, matt(Vec3::new(0.1, 0.5, 0.1))),
            (block, matt(Vec3::splat(0.6))),
        ],
        Vec3::new(0.5, 0.4, 0.9),
        Vec3::new(-0.2, -0.3, -0.4),
    )
}

/// Where the room's lamp hangs.
pub const LAMP: Vec3 = Vec3::new(0.3, 0.6, 0.1);

/// A light by name.
pub fn track(name: &str, kind: LightKind) -> LightTrack {
    LightTrack {
        name: name.into(),
        kind,
    }
}

/// A point light.
pub fn point(position: Vec3, intensity: f32) -> LightTrack {
    let kind = LightKind::Point {
        position: Animated::Constant(position),
        intensity: Animated::Constant(Vec3::splat(intensity)),
    };
    track("point", kind)
}

/// Lets everything that emits shine.
pub fn emissive() -> LightTrack {
    let kind = LightKind::Emissive {
        material: None,
        scale: Animated::Constant(Vec3::ONE),
    };
    track("walls", kind)
}

/// A rectangle in the plane y = `center.y` that emits downwards.
pub fn panel(center: Vec3, edge: Vec2, radiance: f32) -> LightTrack {
    let kind = LightKind::Rect {
        center: Animated::Constant(center),
        edge_u: Animated::Constant(Vec3::X * edge.x),
        edge_v: Animated::Constant(Vec3::Z * edge.y),
        radiance: Animated::Constant(Vec3::splat(radiance)),
    };
    track("panel", kind)
}

/// A glowing sphere.
pub fn globe(center: Vec3, radius: f32, radiance: f32) -> LightTrack {
    let kind = LightKind::Sphere {
        center: Animated::Constant(center),
        radius: Animated::Constant(radius),
        radiance: Animated::Constant(Vec3::splat(radiance)),
    };
    track("globe", kind)
}

/// Sunlight.
pub fn sun(direction: Vec3, irradiance: f32) -> LightTrack {
    let kind = LightKind::Directional {
        direction: Animated::Constant(direction),
        irradiance: Animated::Constant(Vec3::splat(irradiance)),
    };
    track("sun", kind)
}

/// An even sky all around.
pub fn sky(radiance: f32) -> LightTrack {
    let map = relight_scene::light::EnvironmentMap {
        width: 8,
        height: 4,
        pixels: vec![Vec3::ONE; 32],
    };
    let kind = LightKind::Environment {
        maps: std::sync::Arc::new(map).into(),
        file: String::new().into(),
        scale: Animated::Constant(Vec3::splat(radiance)),
        rotation_deg: Animated::Constant(0.0),
    };
    track("sky", kind)
}
