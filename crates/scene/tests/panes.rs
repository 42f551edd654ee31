//! Statements about thin panes: what passes, what stays, and that both together are no more than all.

use glam::{Affine3A, Vec2, Vec3, Vec4};
use relight_scene::bsdf;
use relight_scene::material::{AlphaMode, Extensions, Material};
use relight_scene::rays::Ray;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::surface::Surfaces;
use relight_scene::traced::{Shading, TracedScene};
use std::sync::Arc;

/// Panes of 20 m across at z = 0, 1, …, of a material each.
fn panes(materials: Vec<Material>) -> TracedScene {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let mesh = |material: usize| Mesh {
        positions: corners.map(|c| (Vec2::from(c) * 10.0).extend(0.0)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        material: material as u32,
        ..Mesh::default()
    };
    let instance = |mesh: usize| Instance {
        mesh: mesh as u32,
        world_from_mesh: Affine3A::from_translation(Vec3::Z * mesh as f32),
    };
    let scene = Scene {
        meshes: (0..materials.len()).map(mesh).collect(),
        instances: (0..materials.len()).map(instance).collect(),
        materials,
        ..Scene::default()
    };
    TracedScene::new(Arc::new(scene), Shading::Full).unwrap()
}

fn glass(color: [f32; 3], transmission: f32) -> Material {
    Material {
        base_color: Vec4::new(color[0], color[1], color[2], 1.0),
        metallic: 0.0,
        roughness: 0.0,
        alpha_mode: AlphaMode::Pane { transmission },
        ..Material::default()
    }
}

/// Schlick's term of a dielectric of index 1.5.
fn fresnel(cos: f32) -> f32 {
    0.04 + 0.96 * (1.0 - cos).powi(5)
}

fn passed(scene: &TracedScene, ray: Ray) -> Vec3 {
    let passed = scene.passed(&ray);
    let mut together = [Vec3::ZERO; 2];
    scene.passed_packet(&[ray, ray], &mut together, &mut Vec::new());
    assert_eq!(together, [passed; 2]);
    passed
}

fn ray(from: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin: from,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

#[test]
fn shadow_rays_take_the_product_of_all_panes() {
    let colors = [[1.0, 0.5, 0.25], [0.9, 0.9, 0.9]];
    let scene = panes(vec![glass(colors[0], 1.0), glass(colors[1], 0.5)]);
    // The last way goes through the edge that the two triangles of each pane share.
    for direction in [
        Vec3::new(0.1, 0.05, -1.0),
        Vec3::new(2.0, 0.3, -1.0),
        Vec3::NEG_Z * 3.0,
    ] {
        let cos = direction.normalize().z.abs();
        let share =
            |color: [f32; 3], transmission: f32| Vec3::from(color) * transmission * (1.0 - fresnel(cos));
        let truth = share(colors[0], 1.0) * share(colors[1], 0.5);
        let found = passed(&scene, ray(Vec3::new(0.0, 0.0, 4.0), direction));
        assert!((found - truth).abs().max_element() < 1e-5, "{found} {truth}");
    }
    // One alone, where the ray ends between them.
    let short = Ray {
        t_max: 1.5,
        ..ray(Vec3::new(0.3, 0.2, 2.0), Vec3::NEG_Z)
    };
    assert!((passed(&scene, short) - 0.9 * 0.5 * 0.96).abs().max_element() < 1e-5);
    // Something opaque.
    let scene = panes(vec![glass([1.0; 3], 1.0), Material::default()]);
    assert_eq!(passed(&scene, ray(Vec3::Z * 2.0, Vec3::NEG_Z)), Vec3::ZERO);
    // More panes than anybody has.
    let scene = panes(vec![glass([1.0; 3], 1.0); 100]);
    assert_eq!(passed(&scene, ray(Vec3::Z * 200.0, Vec3::NEG_Z)), Vec3::ZERO);
}

/// Rays that look for a surface pass as often as the largest channel says, and the rest is their tint.
#[test]
fn rays_pass_as_often_as_light_does() {
    let color = [0.8, 0.4, 0.2];
    let scene = panes(vec![glass(color, 0.9)]);
    let (mut gone, mut tints) = (0, 0);
    const RAYS: usize = 20_000;
    for i in 0..RAYS {
        let from = Vec3::new((i % 141) as f32 * 0.05 - 3.5, (i / 141) as f32 * 0.05 - 3.5, 1.0);
        let ray = ray(from, Vec3::new(0.75, 0.0, -1.0));
        if scene.closest_hit(&ray).is_none() {
            gone += 1;
            let tint = scene.tint(&ray, f32::INFINITY);
            tints += usize::from((tint - Vec3::new(1.0, 0.5, 0.25)).abs().max_element() < 1e-6);
        }
        assert_eq!(scene.occluded(&ray), scene.closest_hit(&ray).is_some());
    }
    let truth = f64::from(0.8 * 0.9 * (1.0 - fresnel(0.8)));
    // Four standard deviations of a binomial.
    let error = 4.0 * (truth * (1.0 - truth) / RAYS as f64).sqrt();
    assert!((gone as f64 / RAYS as f64 - truth).abs() < error, "{gone}");
    assert_eq!(tints, gone);
}

/// KHR_materials_ior and _specular: Fresnel's share of a pane is that of its material.
#[test]
fn panes_mirror_what_their_index_says() {
    for (ior, specular, share) in [
        (1.5, 1.0, 0.04),
        (2.0, 1.0, 1.0 / 9.0),
        (2.0, 0.5, 0.5 / 9.0),
        (1.0, 1.0, 0.0),
        (0.0, 1.0, 1.0),
    ] {
        let extensions = Extensions {
            ior,
            specular,
            ..Extensions::default()
        };
        let scene = panes(vec![Material {
            extensions: Some(Box::new(extensions)),
            ..glass([1.0; 3], 1.0)
        }]);
        let found = passed(&scene, ray(Vec3::new(1.0, 0.5, 1.0), Vec3::NEG_Z));
        assert!(
            (found - (1.0 - share)).abs().max_element() < 1e-6,
            "{ior} {specular}: {found}"
        );
    }
}

/// What passes and what is reflected, by a quadrature of the BRDF's samples, is no more than what came; of clear glass all of it.
#[test]
fn panes_make_no_energy() {
    for (color, transmission, metallic, roughness) in [
        ([1.0; 3], 1.0, 0.0, 0.0),
        ([1.0; 3], 1.0, 0.0, 0.5),
        ([1.0; 3], 0.5, 0.0, 0.2),
        ([0.9, 0.5, 0.1], 1.0, 0.0, 0.0),
        ([0.9, 0.5, 0.1], 0.7, 0.5, 0.3),
        ([0.0; 3], 1.0, 0.0, 0.1),
        ([1.0; 3], 1.0, 1.0, 0.1),
    ] {
        for extensions in [
            None,
            Some(Extensions {
                ior: 2.0,
                specular: 0.7,
                clearcoat: 1.0,
                ..Extensions::default()
            }),
        ] {
            let material = Material {
                metallic,
                roughness,
                extensions: extensions.clone().map(Box::new),
                ..glass(color, transmission)
            };
            let scene = panes(vec![material]);
            for degrees in [5.0f32, 40.0, 70.0, 85.0] {
                let (sin, cos) = degrees.to_radians().sin_cos();
                let wo = Vec3::new(sin, 0.0, cos);
                let hit = scene.surface_at(0, [0.3, 0.3], true);
                let point = scene.shading_point(&hit).facing(wo);
                let mut reflected = Vec3::ZERO;
                const N: usize = 4096;
                for i in 0..N {
                    let u = [
                        i as f32 / N as f32,
                        (i * 2531 % N) as f32 / N as f32,
                        (i * 1597 % N) as f32 / N as f32,
                    ];
                    if let Some(sample) = bsdf::sample(&point, wo, u) {
                        reflected += sample.weight / N as f32;
                    }
                }
                let pass = passed(&scene, ray(wo + Vec3::new(1.0, 0.5, 0.0), -wo));
                let all = pass + reflected * (1.0 - pass.max_element());
                // The noise of the samples.
                assert!(
                    all.max_element() < 1.01,
                    "{color:?} {transmission} {degrees}: {all}"
                );
                if color == [1.0; 3] && metallic == 0.0 && transmission == 1.0 && roughness == 0.0 {
                    assert!((all - 1.0).abs().max_element() < 0.01, "{degrees}: {all}");
                }
            }
        }
    }
}
