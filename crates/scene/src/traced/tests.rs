//! Statements about a prepared scene: where its surfaces are, which way they face, and what passes them.

use super::*;
use crate::material::{AlphaMode, Material};
use crate::material::{Texture, TextureUse, Wrap};
use crate::rays::Ray;
use crate::scene::Instance;
use crate::scene::{Mesh, Scene};
use crate::surface::{SurfaceHit, Surfaces};
use crate::surface::{ray_between, ray_between_hits, ray_from};
use glam::{Affine2, Affine3A, Mat3, Quat, Vec2, Vec3, Vec4};
use std::sync::Arc;

pub(super) fn scene(
    meshes: Vec<Mesh>,
    instances: Vec<Instance>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
) -> Arc<Scene> {
    Arc::new(Scene {
        meshes,
        instances,
        materials,
        textures,
        ..Scene::default()
    })
}

pub(super) fn place(world_from_mesh: Affine3A) -> Instance {
    Instance {
        mesh: 0,
        world_from_mesh,
    }
}

/// A matt material of the given base colour.
pub(super) fn matt(base_color: Vec4) -> Material {
    Material {
        base_color,
        metallic: 0.0,
        ..Material::default()
    }
}

/// The square from (−1, −1) to (1, 1) in z = 0, front towards +z, u to the right, v down.
fn square() -> Mesh {
    let corners = [
        Vec2::new(-1.0, -1.0),
        Vec2::new(1.0, -1.0),
        Vec2::new(1.0, 1.0),
        Vec2::new(-1.0, 1.0),
    ];
    Mesh {
        positions: corners.map(|corner| corner.extend(0.0)).to_vec(),
        uvs: vec![
            corners
                .map(|c| Vec2::new(0.5 + 0.5 * c.x, 0.5 - 0.5 * c.y))
                .to_vec(),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A unit sphere of quads cut in two, with smooth normals.
fn sphere(rows: u32, columns: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for row in 0..=rows {
        for column in 0..columns {
            let (theta, phi) = (
                std::f32::consts::PI * row as f32 / rows as f32,
                std::f32::consts::TAU * column as f32 / columns as f32,
            );
            mesh.positions.push(Vec3::new(
                theta.sin() * phi.cos(),
                theta.cos(),
                -theta.sin() * phi.sin(),
            ));
        }
    }
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    for row in 0..rows {
        for column in 0..columns {
            let next = (column + 1) % columns;
            let (a, b) = (row * columns + column, row * columns + next);
            let (c, d) = (a + columns, b + columns);
            if row > 0 {
                mesh.triangles.push([a, d, b]);
            }
            if row + 1 < rows {
                mesh.triangles.push([a, c, d]);
            }
        }
    }
    mesh
}

fn texture(width: u32, height: u32, pixels: &[[u8; 4]]) -> Texture {
    let encoded = crate::texture::png(width, height, pixels);
    Texture {
        name: "test".into(),
        encoded,
        wrap: [Wrap::Clamp; 2],
        nearest: true,
    }
}

fn use_texture(texture: u32) -> Option<TextureUse> {
    Some(TextureUse {
        texture,
        uv_set: 0,
        texture_from_mesh: Affine2::IDENTITY,
    })
}

fn traced(mesh: Mesh, world_from_mesh: Affine3A, material: Material, textures: Vec<Texture>) -> TracedScene {
    let scene = scene(vec![mesh], vec![place(world_from_mesh)], vec![material], textures);
    TracedScene::new(scene, Shading::Full).unwrap()
}

fn ray(origin: Vec3, direction: Vec3) -> Ray {
    Ray {
        origin,
        direction,
        t_min: 0.0,
        t_max: f32::INFINITY,
    }
}

fn down(x: f32, y: f32) -> Ray {
    ray(Vec3::new(x, y, 5.0), Vec3::NEG_Z)
}

/// Counter-based uniform number in 0..1.
fn uniform(index: u64) -> f32 {
    let mut z = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

fn direction(index: u64) -> Vec3 {
    let z = 2.0 * uniform(2 * index) - 1.0;
    let (sin, cos) = (std::f32::consts::TAU * uniform(2 * index + 1)).sin_cos();
    let radius = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(radius * cos, radius * sin, z)
}

/// Truth: a sphere's front is outside, whatever mirrors, stretches or turns it.
#[test]
fn a_mirrored_instance_keeps_its_front_and_its_normals() {
    let turn = Mat3::from_quat(Quat::from_rotation_z(0.7));
    for scale in [
        Vec3::ONE,
        Vec3::new(-1.0, 1.0, 1.0),
        Vec3::new(-2.0, -1.0, -0.5),
        Vec3::new(1.0, -3.0, 1.0),
    ] {
        let linear = turn * Mat3::from_diagonal(scale);
        let world_from_mesh = Affine3A::from_mat3_translation(linear, Vec3::new(1.0, 2.0, 3.0));
        let scene = traced(sphere(32, 64), world_from_mesh, matt(Vec4::ONE), Vec::new());
        for k in 0..500 {
            let toward = direction(k);
            let target = world_from_mesh.transform_point3(toward);
            // Normal of the ellipsoid's implicit form |M⁻¹(x − c)|² = 1.
            let truth = (linear.inverse().transpose() * toward).normalize();
            let hit = scene.closest_hit(&ray(target + truth * 9.0, -truth)).unwrap();
            assert!(hit.front, "scale {scale}");
            // The tessellation's deviation from the ellipsoid, stretched at most threefold.
            assert!(
                hit.normal.dot(truth) > 0.95,
                "scale {scale}: {} {truth}",
                hit.normal
            );
            assert!(hit.geometric_normal.dot(truth) > 0.9, "scale {scale}");
            let inside = scene.closest_hit(&ray(Vec3::new(1.0, 2.0, 3.0), toward)).unwrap();
            assert!(
                !inside.front && inside.normal.dot(toward) < 0.0 && inside.geometric_normal.dot(toward) < 0.0
            );
        }
    }
}

/// Truth: on a sphere the normal is the position. A chord of 2π/64 turns the flat normal by up to half of it,
/// the interpolated one by its square over eight.
#[test]
fn normals_are_interpolated() {
    let scene = traced(sphere(32, 64), Affine3A::IDENTITY, matt(Vec4::ONE), Vec::new());
    for k in 0..1000 {
        let hit = scene
            .closest_hit(&ray(direction(k) * 3.0, -direction(k)))
            .unwrap();
        assert!(hit.normal.dot(hit.position.normalize()) > 0.9999, "{hit:?}");
    }
}

/// Truth: the texture, two by two texels of which the top left and bottom right are cut out.
#[test]
fn a_mask_lets_rays_through_where_the_texture_says_so() {
    let (solid, hole) = ([255, 255, 255, 255], [255, 255, 255, 100]);
    let material = Material {
        base_color_texture: use_texture(0),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..matt(Vec4::ONE)
    };
    let textures = vec![texture(2, 2, &[hole, solid, solid, hole])];
    let scene = traced(square(), Affine3A::IDENTITY, material.clone(), textures.clone());
    for (x, y, there) in [
        (-0.5, 0.5, false),
        (0.5, 0.5, true),
        (-0.5, -0.5, true),
        (0.5, -0.5, false),
    ] {
        assert_eq!(scene.closest_hit(&down(x, y)).is_some(), there, "({x}, {y})");
        assert_eq!(scene.occluded(&down(x, y)), there, "({x}, {y})");
        let mut packet = [!there];
        scene.occluded_packet(&[down(x, y)], &mut packet);
        assert_eq!(packet[0], there);
    }
    // A factor lifts or lowers alpha: 100/255 × 1 < 0.5; 1 × 0.4 < 0.5: nothing is left.
    let faint = Material {
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.4),
        ..material
    };
    let scene = traced(square(), Affine3A::IDENTITY, faint, textures);
    assert!(scene.closest_hit(&down(0.5, 0.5)).is_none());
}

/// Truth: the binomial distribution, standard deviation √(α(1 − α)/n).
#[test]
fn a_blended_surface_stops_its_alpha_of_the_rays() {
    for alpha in [0.0f32, 0.1, 0.5, 0.9, 1.0] {
        let mut mesh = square();
        mesh.colors = vec![Vec4::new(1.0, 1.0, 1.0, 0.5); 4];
        let material = Material {
            alpha_mode: AlphaMode::Blend,
            ..matt(Vec4::new(1.0, 1.0, 1.0, 2.0 * alpha))
        };
        let scene = traced(mesh, Affine3A::IDENTITY, material, Vec::new());
        let count = 100_000;
        let stopped = (0..count)
            .filter(|&k| {
                let ray = down(1.9 * (uniform(2 * k) - 0.5), 1.9 * (uniform(2 * k + 1) - 0.5));
                let hit = scene.closest_hit(&ray);
                assert_eq!(hit, scene.closest_hit(&ray), "equal rays meet equal surfaces");
                assert_eq!(hit.is_some(), scene.occluded(&ray));
                hit.is_some()
            })
            .count();
        let (share, alpha) = (stopped as f64 / count as f64, f64::from(alpha));
        let deviation = (alpha * (1.0 - alpha) / count as f64).sqrt();
        assert!((share - alpha).abs() <= 4.0 * deviation, "alpha {alpha}: {share}");
        assert!((f64::from(scene.coverage(0, [0.3, 0.3])) - alpha).abs() < 1e-6);
    }
}

/// Truth: the rays one by one. More of them than are looked up together, of which some miss.
#[test]
fn rays_cast_together_meet_what_they_meet_alone() {
    let blend = Material {
        alpha_mode: AlphaMode::Blend,
        ..matt(Vec4::new(1.0, 1.0, 1.0, 0.5))
    };
    for material in [matt(Vec4::ONE), blend] {
        let scene = traced(sphere(8, 12), Affine3A::IDENTITY, material, Vec::new());
        let rays: Vec<Ray> = (0..150)
            .map(|k| down(2.4 * (uniform(2 * k) - 0.5), 2.4 * (uniform(2 * k + 1) - 0.5)))
            .collect();
        let mut together = Vec::new();
        scene.closest_hits(&rays, &mut |i, hit| together.push((i, hit)));
        let hit_alone = |(i, ray)| scene.closest_hit(ray).map(|hit| (i, hit));
        let alone: Vec<(usize, SurfaceHit)> = rays.iter().enumerate().filter_map(hit_alone).collect();
        assert_eq!(together, alone);
        assert!(alone.len() > 30 && alone.len() < 120, "{}", alone.len());
    }
}

/// A convex body hides no direction above its surface from any of its points, at any size and place.
#[test]
fn rays_from_a_surface_do_not_meet_it_again() {
    for scale in [1e-4f32, 1e-2, 1.0, 1e2, 1e5] {
        for offset in [0.0, 10.0] {
            let world_from_mesh = Affine3A::from_scale_rotation_translation(
                Vec3::splat(scale),
                Quat::from_rotation_x(0.3),
                Vec3::new(offset, -offset, 0.5 * offset) * scale,
            );
            let scene = traced(sphere(24, 48), world_from_mesh, matt(Vec4::ONE), Vec::new());
            let center = Vec3::from(world_from_mesh.translation);
            for k in 0..2000 {
                let from = direction(3 * k);
                let hit = scene
                    .closest_hit(&ray(center + from * (4.0 * scale), -from))
                    .unwrap();
                let away = direction(3 * k + 1);
                let away = if away.dot(hit.geometric_normal) < 0.0 {
                    -away
                } else {
                    away
                };
                assert!(
                    !scene.occluded(&ray_from(&hit, away)),
                    "scale {scale}, hit {hit:?}"
                );
                assert!(!scene.occluded(&ray_between(&hit, hit.position + away * (3.0 * scale))));
                // Into the body, the ray meets the far side; two points of the inside see each other.
                let inward = ray_from(&hit, -hit.geometric_normal);
                let far = scene.closest_hit(&inward).expect("the far side");
                assert!((far.position - hit.position).length() > 0.5 * scale);
                assert!(!scene.occluded(&ray_between_hits(&hit, &far)));
            }
        }
    }
}

#[test]
fn emission_leaves_the_front_and_from_both_sides_only_if_double_sided() {
    let emission = Vec3::new(3.0, 2.0, 1.0);
    for double_sided in [false, true] {
        let material = Material {
            emission,
            double_sided,
            ..matt(Vec4::ONE)
        };
        let scene = traced(square(), Affine3A::IDENTITY, material, Vec::new());
        assert_eq!(scene.emissive_triangles(), [0, 1]);
        let front = scene.closest_hit(&down(0.1, 0.2)).unwrap();
        let back = scene
            .closest_hit(&ray(Vec3::new(0.1, 0.2, -1.0), Vec3::Z))
            .unwrap();
        assert_eq!(scene.shading_point(&front).emission, emission);
        let behind = if double_sided { emission } else { Vec3::ZERO };
        assert_eq!(scene.shading_point(&back).emission, behind);
        // Reflection is two-sided in any case.
        assert_eq!(scene.shading_point(&back).diffuse, Vec3::ONE);
        assert_eq!(scene.shading_point(&back).geometric_normal, Vec3::NEG_Z);
    }
}

#[test]
fn an_unlit_material_shows_its_base_colour_and_reflects_nothing() {
    let material = Material {
        unlit: true,
        ..matt(Vec4::new(0.2, 0.4, 0.6, 1.0))
    };
    let scene = traced(square(), Affine3A::IDENTITY, material, Vec::new());
    let hit = scene.closest_hit(&down(0.0, 0.1)).unwrap();
    let point = scene.shading_point(&hit);
    assert_eq!(point.emission, Vec3::new(0.2, 0.4, 0.6));
    assert_eq!(scene.albedo(&hit), Vec3::ZERO);
}

/// Truth by hand: a texel of (0.5 + 0.5 sin 30°, 0.5, 0.5 + 0.5 cos 30°) leans the normal 30° along rising u;
/// green leans it up, against v. The back has the front's normal reversed.
#[test]
fn normal_maps_lean_along_the_texture() {
    let lean = |x: f32, y: f32, z: f32| [x, y, z].map(|c| ((0.5 + 0.5 * c) * 255.0).round() as u8);
    let (s, c) = (30f32.to_radians().sin(), 30f32.to_radians().cos());
    let with_tangents = |mut mesh: Mesh| {
        mesh.tangents = vec![Vec4::new(1.0, 0.0, 0.0, 1.0); 4];
        mesh
    };
    for (rgb, expected) in [
        (lean(s, 0.0, c), Vec3::new(s, 0.0, c)),
        (lean(0.0, s, c), Vec3::new(0.0, s, c)),
    ] {
        for mesh in [square(), with_tangents(square())] {
            let texel = [rgb[0], rgb[1], rgb[2], 255];
            let material = Material {
                normal_texture: use_texture(0),
                ..matt(Vec4::ONE)
            };
            let textures = vec![texture(1, 1, &[texel])];
            let scene = traced(
                mesh.clone(),
                Affine3A::IDENTITY,
                material.clone(),
                textures.clone(),
            );
            let front = scene.shading_point(&scene.closest_hit(&down(0.1, 0.2)).unwrap());
            let back = ray(Vec3::new(0.1, 0.2, -1.0), Vec3::Z);
            let back = scene.shading_point(&scene.closest_hit(&back).unwrap());
            // 8-bit texels: half a code is 0.002.
            assert!(
                (front.shading_normal - expected).length() < 0.01,
                "{}",
                front.shading_normal
            );
            assert!(
                (back.shading_normal + expected).length() < 0.01,
                "{}",
                back.shading_normal
            );
            // Mirroring the instance in x mirrors the bump with it.
            let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
            let scene = traced(mesh, mirror, material.clone(), textures.clone());
            let front = scene.shading_point(&scene.closest_hit(&down(0.1, 0.2)).unwrap());
            let mirrored = Vec3::new(-expected.x, expected.y, expected.z);
            assert!(
                (front.shading_normal - mirrored).length() < 0.01,
                "{}",
                front.shading_normal
            );
            // Lambert shading ignores the map.
            let lambert = TracedScene::new(scene.scene().clone(), Shading::Lambert).unwrap();
            let point = lambert.shading_point(&lambert.closest_hit(&down(0.1, 0.2)).unwrap());
            assert_eq!(point.shading_normal, Vec3::Z);
        }
    }
}

/// A shading normal never turns its back on the viewer or on the surface's own side.
#[test]
fn shading_normals_stay_above_both_horizons() {
    // A map that leans the normal below the surface.
    let material = Material {
        normal_texture: use_texture(0),
        ..matt(Vec4::ONE)
    };
    let scene = traced(
        square(),
        Affine3A::IDENTITY,
        material,
        vec![texture(1, 1, &[[255, 128, 60, 255]])],
    );
    for k in 0..1000 {
        let from = direction(k);
        let hit = scene.closest_hit(&ray(from * 3.0, -from)).unwrap();
        let point = scene.shading_point(&hit);
        assert!(point.shading_normal.dot(hit.geometric_normal) > 0.0);
        let seen = point.facing(from);
        assert!(
            seen.shading_normal.dot(from) > 0.0,
            "{from}: {}",
            seen.shading_normal
        );
        assert!(seen.shading_normal.is_normalized());
        let same = seen.facing(from).shading_normal;
        assert!((same - seen.shading_normal).length() < 1e-2);
    }
}

/// Truth: the definition of `--lambert` and glTF's mapping to c_diff, f0 and α.
#[test]
fn metallic_and_roughness_become_reflectances() {
    let base = Vec4::new(0.8, 0.4, 0.2, 1.0);
    let material = Material {
        metallic: 0.5,
        roughness: 0.6,
        ..matt(base)
    };
    let full = traced(
        square(),
        Affine3A::IDENTITY,
        Material {
            metallic: 0.5,
            ..material
        },
        Vec::new(),
    );
    let hit = full.closest_hit(&down(0.0, 0.1)).unwrap();
    let point = full.shading_point(&hit);
    assert!((point.diffuse - base.truncate() * 0.5).length() < 1e-6);
    assert!((point.f0 - (Vec3::splat(0.02) + base.truncate() * 0.5)).length() < 1e-6);
    assert!((point.alpha - 0.36).abs() < 1e-6);
    let lambert = TracedScene::new(full.scene().clone(), Shading::Lambert).unwrap();
    let point = lambert.shading_point(&hit);
    assert!(point.lambert && point.diffuse == base.truncate() && point.f0 == Vec3::ZERO);
    assert_eq!(lambert.albedo(&hit), base.truncate());
}

/// Truth: the points one by one. A checkered square whose vertices have colours, and which is met on either of its triangles.
#[test]
fn colours_looked_up_one_after_the_other_are_those_of_each_point() {
    let mut mesh = square();
    mesh.colors = [0.2, 0.4, 0.8, 1.0]
        .map(|c| Vec4::new(c, 1.0, 1.0 - 0.5 * c, 1.0))
        .to_vec();
    let [dark, light] = [[10, 80, 120, 255], [250, 200, 90, 255]];
    let material = Material {
        base_color_texture: use_texture(0),
        metallic: 0.3,
        ..matt(Vec4::new(0.9, 0.8, 0.7, 1.0))
    };
    let textures = vec![texture(2, 2, &[dark, light, light, dark])];
    let scene = traced(mesh, Affine3A::IDENTITY, material, textures);
    let rays: Vec<Ray> = (0..150)
        .map(|k| down(2.0 * (uniform(2 * k) - 0.5), 2.0 * (uniform(2 * k + 1) - 0.5)))
        .collect();
    let (mut faces, mut colors) = (Faces::new(&scene), BaseColors::new(&scene));
    let mut met = [0; 2];
    scene.closest_hits_packet(&rays, |i, hit| {
        let hit = hit.unwrap();
        met[hit.triangle as usize] += 1;
        let alone = scene.closest_hit(&rays[i]).unwrap();
        assert_eq!(faces.hit_by(&rays[i], &hit), alone);
        assert!(faces.is_flat(hit.triangle, 0.999));
        let point = scene.shading_point(&alone);
        let color = colors.at(hit.triangle, [hit.u, hit.v]);
        assert!(
            color.distance(point.base_color) < 1e-6,
            "{color} {}",
            point.base_color
        );
        // How much of it is in what the point reflects.
        let metallic = scene.metallic_but_for_color(hit.triangle).unwrap();
        assert!(point.diffuse.distance(color * (1.0 - metallic)) < 1e-6);
        assert!(
            point
                .f0
                .distance(Vec3::splat(0.04 * (1.0 - metallic)) + color * metallic)
                < 1e-6
        );
    });
    assert!(met[0].min(met[1]) > 50, "{met:?}");
}

/// Of what has a relief, varies in gloss, shines by a picture or is glass, the colour does not say all.
#[test]
fn materials_of_which_more_than_the_colour_changes_are_known() {
    let plain = || matt(Vec4::ONE);
    let of = |material: Material| {
        let textures = vec![texture(1, 1, &[[128, 128, 255, 255]])];
        traced(square(), Affine3A::IDENTITY, material, textures).metallic_but_for_color(0)
    };
    let map = || use_texture(0);
    assert_eq!(of(plain()), Some(0.0));
    assert_eq!(
        of(Material {
            emission: Vec3::ONE,
            metallic: 0.4,
            base_color_texture: map(),
            ..plain()
        }),
        Some(0.4)
    );
    for more in [
        Material {
            normal_texture: map(),
            ..plain()
        },
        Material {
            metallic_roughness_texture: map(),
            ..plain()
        },
        Material {
            emission: Vec3::ONE,
            emission_texture: map(),
            ..plain()
        },
        Material {
            unlit: true,
            ..plain()
        },
    ] {
        assert_eq!(of(more.clone()), None, "{more:?}");
    }
}

/// A degenerate, an infinite and a NaN triangle beside a good one: the good one is hit, the others are not and
/// have no area to emit from.
#[test]
fn broken_triangles_are_left_out() {
    let mut mesh = square();
    mesh.positions.push(Vec3::new(f32::NAN, 0.0, 0.0));
    mesh.positions.push(Vec3::new(f32::INFINITY, 0.0, 0.0));
    mesh.uvs.clear();
    mesh.triangles.extend([[0, 1, 4], [0, 5, 1], [2, 2, 2]]);
    let material = Material {
        emission: Vec3::ONE,
        ..matt(Vec4::ONE)
    };
    let scene = traced(mesh, Affine3A::IDENTITY, material, Vec::new());
    assert_eq!(scene.dropped_triangles(), 2);
    assert_eq!(scene.emissive_triangles(), [0, 1, 4]);
    let areas: Vec<f32> = (0..5).map(|triangle| scene.triangle_area(triangle)).collect();
    assert_eq!(areas, [2.0, 2.0, 0.0, 0.0, 0.0]);
    assert!(scene.closest_hit(&down(0.3, 0.2)).is_some());
}

#[test]
fn contradictions_are_named() {
    let mut mesh = square();
    mesh.triangles.push([0, 1, 9]);
    let broken = scene(
        vec![mesh],
        vec![place(Affine3A::IDENTITY)],
        vec![matt(Vec4::ONE)],
        Vec::new(),
    );
    let message = TracedScene::new(broken, Shading::Full).err().unwrap().to_string();
    assert!(
        message.contains("mesh 0 refers to vertex 9") && message.contains("has 4"),
        "{message}"
    );

    let material = Material {
        base_color_texture: use_texture(0),
        ..matt(Vec4::ONE)
    };
    let broken_texture = Texture {
        encoded: vec![0; 9],
        ..texture(1, 1, &[[0; 4]])
    };
    let broken = scene(
        vec![square()],
        vec![place(Affine3A::IDENTITY)],
        vec![material],
        vec![broken_texture],
    );
    let message = TracedScene::new(broken, Shading::Full).err().unwrap().to_string();
    assert!(message.contains("texture 0 ('test')"), "{message}");
}

#[test]
fn an_empty_scene_is_dark_and_has_no_bounds() {
    let scene = TracedScene::new(
        scene(Vec::new(), Vec::new(), Vec::new(), Vec::new()),
        Shading::Full,
    )
    .unwrap();
    assert_eq!(scene.bounds(), None);
    assert!(scene.closest_hit(&down(0.0, 0.0)).is_none() && !scene.occluded(&down(0.0, 0.0)));
}
