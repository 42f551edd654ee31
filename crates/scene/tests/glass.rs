//! Statements about solid glass: looks through it bend as Snell has it, straight rays take the right total, and what is absorbed
//! goes by the way inside.

use glam::{Affine3A, Vec2, Vec3};
use relight_scene::material::{AlphaMode, Extensions, Material, Texture, TextureUse, Wrap};
use relight_scene::rays::Ray;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Look, Shading, TracedScene};
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// White, smooth, all of it transmitted.
fn glass(ior: f32, absorption: Vec3) -> Material {
    Material {
        metallic: 0.0,
        roughness: 0.0,
        alpha_mode: AlphaMode::Pane { transmission: 1.0 },
        extensions: Some(Box::new(Extensions {
            ior,
            thickness: 0.1,
            absorption,
            ..Extensions::default()
        })),
        ..Material::default()
    }
}

fn traced(parts: Vec<(Mesh, Material)>) -> TracedScene {
    let instance = |mesh: usize| Instance {
        mesh: mesh as u32,
        world_from_mesh: Affine3A::IDENTITY,
    };
    let (meshes, materials): (Vec<Mesh>, Vec<Material>) = parts.into_iter().unzip();
    let number = |(i, mesh): (usize, Mesh)| Mesh {
        material: i as u32,
        ..mesh
    };
    let scene = Scene {
        instances: (0..meshes.len()).map(instance).collect(),
        meshes: meshes.into_iter().enumerate().map(number).collect(),
        materials,
        ..Scene::default()
    };
    TracedScene::new(Arc::new(scene), Shading::Full).unwrap()
}

/// A prism: an outline in x and y, anticlockwise, from z = −10 to 10.
fn prism(outline: &[[f32; 2]]) -> Mesh {
    let n = outline.len() as u32;
    let mut mesh = Mesh::default();
    for z in [-10.0, 10.0] {
        mesh.positions
            .extend(outline.iter().map(|&p| Vec2::from(p).extend(z)));
    }
    for i in 0..n {
        let j = (i + 1) % n;
        mesh.triangles.extend([[i, j, n + j], [i, n + j, n + i]]);
    }
    for i in 1..n - 1 {
        mesh.triangles.extend([[0, i + 1, i], [n, n + i, n + i + 1]]);
    }
    mesh
}

/// A slab between two heights.
fn slab(low: f32, high: f32) -> Mesh {
    prism(&[[-10.0, low], [10.0, low], [10.0, high], [-10.0, high]])
}

/// A finely tessellated sphere with smooth normals.
fn sphere(radius: f32) -> Mesh {
    const RINGS: u32 = 256;
    const SIDES: u32 = 2 * RINGS;
    let mut mesh = Mesh::default();
    mesh.normals.push(Vec3::Y);
    for ring in 1..RINGS {
        let (sin, cos) = (PI * ring as f32 / RINGS as f32).sin_cos();
        for side in 0..SIDES {
            let (z, x) = (TAU * side as f32 / SIDES as f32).sin_cos();
            mesh.normals.push(Vec3::new(x * sin, cos, z * sin));
        }
    }
    mesh.normals.push(Vec3::NEG_Y);
    let at = |ring: u32, side: u32| match ring {
        0 => 0,
        RINGS => 1 + (RINGS - 1) * SIDES,
        _ => 1 + (ring - 1) * SIDES + side % SIDES,
    };
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    mesh.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    mesh.positions = mesh.normals.iter().map(|&n| n * radius).collect();
    mesh
}

fn wall(y: f32) -> Mesh {
    Mesh {
        positions: [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]]
            .map(|[x, z]| Vec3::new(x, y, z))
            .to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Rays that differ by less than a thousandth, each of which passes or is mirrored by itself: the looks of those that pass `surfaces` of glass
/// without being mirrored once, and how many rays there were.
fn looks(scene: &TracedScene, from: Vec3, direction: Vec3, surfaces: usize) -> (Vec<Look>, usize) {
    const RAYS: usize = 400;
    let all = (0..RAYS).map(|i| {
        let ray = Ray::endless(from + Vec3::Z * (i as f32 * 1e-6), direction.normalize());
        let mut parts = 0;
        let look = scene.look(&ray, |_, _, _| parts += 1);
        (parts, look)
    });
    let passed = all.filter(|(parts, _)| *parts == surfaces).map(|(_, look)| look);
    (passed.collect(), RAYS)
}

/// How far the ways below may be off, m: rays start beside the surfaces that they leave, in a scene of 100 m by some 1e-5 of that.
const CLEAR: f32 = 1e-3;

/// Schlick's term at normal incidence and the cosine outside.
fn fresnel(ior: f32, cos: f32) -> f32 {
    let root = (ior - 1.0) / (ior + 1.0);
    let f0 = root * root;
    f0 + (1.0 - f0) * (1.0 - cos).powi(5)
}

/// Truth: a slab of thickness d moves what is seen at an angle θ sideways by d sin θ (1 − cos θ / √(n² − sin² θ)), and turns nothing; both
/// surfaces pass 1 − F.
#[test]
fn a_slab_moves_the_view() {
    for (ior, degrees, thickness) in [(1.5f32, 45.0f32, 1.0f32), (1.33, 60.0, 0.5), (2.4, 20.0, 2.0)] {
        let scene = traced(vec![
            (slab(1.0, 1.0 + thickness), glass(ior, Vec3::ZERO)),
            (wall(0.0), Material::default()),
        ]);
        let (sin, cos) = degrees.to_radians().sin_cos();
        let (from, direction) = (Vec3::new(-2.0, 4.0, 0.3), Vec3::new(sin, -cos, 0.0));
        let (passed, rays) = looks(&scene, from, direction, 2);
        let passes = (1.0 - fresnel(ior, cos)).powi(2);
        // Four standard deviations of a binomial.
        let error = 4.0 * (passes * (1.0 - passes) / rays as f32).sqrt();
        assert!(
            (passed.len() as f32 / rays as f32 - passes).abs() < error,
            "{passes}"
        );
        let aside = thickness * sin * (1.0 - cos / (ior * ior - sin * sin).sqrt());
        let straight = from + direction * (from.y / cos);
        for look in passed {
            assert!((look.ray.direction - direction).length() < 1e-5);
            let hit = look.hit.unwrap();
            // On the wall the way across is longer than aside of the ray by 1/cos θ.
            let found = straight.x - hit.position.x;
            assert!((found - aside / cos).abs() < CLEAR, "{found} {aside}");
            assert!(look.bent && (look.tint - Vec3::ONE).abs().max_element() < 1e-6);
            let inside = thickness / (1.0 - sin * sin / (ior * ior)).sqrt();
            let outside = (4.0 - thickness) / cos;
            assert!(
                (look.length() - inside - outside).abs() < CLEAR,
                "{}",
                look.length()
            );
        }
        // Shadow rays and gathers go straight.
        let ray = Ray::endless(from, direction);
        assert!(scene.crosses_solid(&ray) && scene.meets_solid(&ray));
        let shadow = Ray {
            t_max: 3.9 / cos,
            ..ray
        };
        assert!((scene.passed(&shadow) - passes).abs().max_element() < 1e-5);
    }
}

/// Truth: a ray that comes at height h to a ball of radius R is turned by 2 (asin h/R − asin h/(nR)) and leaves it as high over the
/// axis as it has come, on the way that is turned by as much around the middle. Beyond the focus the picture is upside down.
/// Tolerance: interpolated normals of 512 sides are off by some 1e-5, places by R (1 − cos π/512).
#[test]
fn a_ball_turns_the_picture_around() {
    let ior = 1.5f32;
    let absorption = Vec3::new(0.0, 0.3, 1.0);
    let scene = traced(vec![
        (sphere(1.0), glass(ior, absorption)),
        (wall(-10.0), Material::default()),
    ]);
    for height in [0.1f32, 0.3, 0.5, 0.7] {
        let (passed, rays) = looks(&scene, Vec3::new(height, 5.0, 0.0), Vec3::NEG_Y, 2);
        assert!(passed.len() > rays / 2);
        let (outside, inside) = (height.asin(), (height / ior).asin());
        let turned = 2.0 * (outside - inside);
        // Where it leaves, as an angle from the axis downwards, and its way on to the wall.
        let around = PI - outside - (PI - 2.0 * inside);
        let (x, y) = (around.sin(), -around.cos());
        let truth = x - turned.tan() * (10.0 + y);
        assert!(truth < 0.0);
        for look in passed {
            let hit = look.hit.unwrap();
            assert!(
                (hit.position.x - truth).abs() < 0.02,
                "{height}: {} {truth}",
                hit.position.x
            );
            let chord = 2.0 * inside.cos();
            let left = (-absorption * chord).exp();
            assert!(
                (look.tint - left).abs().max_element() < 1e-3,
                "{} {left}",
                look.tint
            );
        }
    }
}

/// Truth: the critical angle of index 1.5 is 41.8°, that of 1.3 is 50.3°. At 45° one mirrors all, the other refracts by Snell's law.
#[test]
fn beyond_the_critical_angle_all_is_mirrored() {
    // Two legs along x = 0 and y = 0, the hypotenuse at 45°.
    let outline = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]];
    let (from, direction) = (Vec3::new(-1.0, 0.5, 0.2), Vec3::X);
    let through = |ior: f32| {
        let scene = traced(vec![(prism(&outline), glass(ior, Vec3::ZERO))]);
        let mut mirrored = 0;
        let mut refracted = Vec::new();
        for i in 0..400 {
            let ray = Ray::endless(from + Vec3::Z * (i as f32 * 1e-6), direction);
            let mut parts = Vec::new();
            let look = scene.look(&ray, |part, _, _| parts.push(part.direction));
            if parts.len() == 3 && (parts[2] - Vec3::NEG_Y).length() < 1e-5 {
                // Out of the lower leg, straight down.
                assert!((look.ray.direction - Vec3::NEG_Y).length() < 1e-4);
                mirrored += 1;
            } else if parts.len() == 2 {
                refracted.push(look.ray.direction);
            }
        }
        (mirrored, refracted)
    };
    let (mirrored, refracted) = through(1.5);
    // All but those that the two legs mirror, 4 % each.
    assert!(refracted.is_empty() && mirrored > 340, "{mirrored}");
    let (mirrored, refracted) = through(1.3);
    assert!(refracted.len() > mirrored && mirrored > 0, "{mirrored}");
    let outside = (1.3 * 0.5f32.sqrt()).asin();
    let truth = Vec2::from_angle(PI / 4.0 - outside).extend(0.0);
    for found in refracted {
        assert!((found - truth).length() < 1e-4, "{found} {truth}");
    }
}

/// Truth: Beer's law over the length inside, whether a ray comes in, goes out, does both or neither.
#[test]
fn straight_rays_lose_what_their_way_inside_takes() {
    let absorption = Vec3::new(0.2, 0.7, 3.0);
    let scene = traced(vec![
        (slab(1.0, 1.5), glass(1.5, absorption)),
        (slab(2.0, 2.25), glass(1.5, 2.0 * absorption)),
    ]);
    let passes = |cos: f32| 1.0 - fresnel(1.5, cos);
    for direction in [Vec3::NEG_Y, Vec3::new(3.0, -4.0, 0.0), Vec3::new(0.0, -0.8, -0.6)] {
        let cos = -direction.normalize().y;
        let from = Vec3::new(0.1, 3.0, 0.2);
        let passed = |low: f32, high: f32| {
            scene.passed(&Ray {
                origin: from + direction * ((from.y - high) / -direction.y),
                direction,
                t_min: 0.0,
                t_max: (high - low) / -direction.y,
            })
        };
        for (low, high, surfaces, through) in [
            (0.0, 3.0, 4, 1.0),
            (1.25, 3.0, 3, 0.75),
            (0.5, 2.1, 3, 0.7),
            (1.2, 2.2, 2, 0.7),
            (1.6, 1.9, 0, 0.0),
        ] {
            let truth = passes(cos).powi(surfaces) * (-absorption * (through / cos)).exp();
            let found = passed(low, high);
            assert!(
                (found - truth).abs().max_element() < 1e-5,
                "{low} {high}: {found} {truth}"
            );
        }
        // What rays that look for a surface have passed loses as much.
        let ray = Ray::endless(from, direction);
        let tint = scene.tint(&ray, f32::INFINITY);
        let truth = (-absorption / cos).exp();
        assert!((tint - truth).abs().max_element() < 1e-5, "{tint} {truth}");
    }
    // Where a ray that bends comes out of what it started in, and where it doesn't.
    let from_inside = Ray::endless(Vec3::new(0.1, 1.25, 0.2), Vec3::NEG_Y);
    let look = scene.look(&from_inside, |_, _, _| ());
    if look.hit.is_none() && look.ray.direction == Vec3::NEG_Y {
        assert!((look.tint - (-absorption * 0.25).exp()).abs().max_element() < 1e-5);
    }
}

/// An open sheet has no inside: light goes straight on, and each surface takes what half of the thickness does.
#[test]
fn open_meshes_bend_nothing() {
    let absorption = Vec3::new(0.0, 5.0, 10.0);
    let scene = traced(vec![(wall(0.0), glass(1.5, absorption))]);
    assert!(!scene.bends());
    let ray = Ray::endless(Vec3::Y, Vec3::NEG_Y);
    let truth = 0.96 * (-absorption * 0.05).exp();
    assert!((scene.passed(&ray) - truth).abs().max_element() < 1e-5);
    let look = scene.look(&ray, |_, _, _| panic!("it bends"));
    assert!(!look.bent && look.tint == Vec3::ONE);
}

/// A body is what has no edges and fronts outwards, wherever its vertices are parted.
#[test]
fn bodies_are_told_from_sheets() {
    let body = slab(0.0, 1.0);
    assert!(body.is_closed() && sphere(2.0).is_closed());
    let mut inside_out = body.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    assert!(!inside_out.is_closed());
    let mut open = body.clone();
    open.triangles.pop();
    assert!(!open.is_closed());
    let mut turned = body.clone();
    turned.triangles[0].swap(0, 1);
    assert!(!turned.is_closed());
    // Each triangle with vertices of its own, as flat shading has it.
    let own = Mesh {
        positions: (body.triangles.iter().flatten())
            .map(|&i| body.positions[i as usize])
            .collect(),
        triangles: (0..body.triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
        ..Mesh::default()
    };
    assert!(own.is_closed());
    assert!(!Mesh::default().is_closed());
}

/// A PNG of two texels, (255, 0, 9) and (51, 255, 77): red is 1 and 0.2; the others count for nothing.
const TEXELS: &[u8] = b"\
    \x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x02\x00\x00\x00\x01\x08\x02\x00\
    \x00\x00\x7b\x40\xe8\xdd\x00\x00\x00\x0f\x49\x44\x41\x54\x78\x9c\x63\xf8\xcf\xc0\x69\xfc\xdf\x17\x00\x09\x09\
    \x02\x88\x3b\x89\xf3\xad\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";

/// Truth: the texture's red texels times the factor, where they are.
#[test]
fn textures_of_transmission_say_where_light_passes() {
    let usage = TextureUse {
        texture: 0,
        uv_set: 0,
        texture_from_mesh: glam::Affine2::IDENTITY,
    };
    let mut material = glass(1.5, Vec3::ZERO);
    material.alpha_mode = AlphaMode::Pane { transmission: 0.5 };
    let e = material.extensions.as_mut().unwrap();
    (e.thickness, e.transmission_texture) = (0.0, Some(usage));
    let mesh = Mesh {
        uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]],
        ..wall(0.0)
    };
    let scene = Scene {
        meshes: vec![mesh],
        instances: vec![Instance {
            mesh: 0,
            world_from_mesh: Affine3A::IDENTITY,
        }],
        materials: vec![material],
        textures: vec![Texture {
            name: "t".into(),
            encoded: TEXELS.to_vec(),
            wrap: [Wrap::Clamp; 2],
            nearest: true,
        }],
        ..Scene::default()
    };
    let scene = TracedScene::new(Arc::new(scene), Shading::Full).unwrap();
    for (x, red) in [(-20.0, 1.0), (20.0, 0.2)] {
        let ray = Ray::endless(Vec3::new(x, 1.0, 3.0), Vec3::NEG_Y);
        let truth = red * 0.5 * 0.96;
        let found = scene.passed(&ray);
        assert!((found - truth).abs().max_element() < 1e-5, "{found} {truth}");
    }
}
