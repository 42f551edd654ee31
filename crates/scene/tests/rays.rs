//! Ray casting against an independent loop over all triangles in double precision, on input that other traversals get wrong.

mod rays_common;

use glam::Vec3;
use rays_common::*;
use relight_scene::rays::{Hit, Kernel, Ray, TriangleBvh};

/// Casts all rays with both kernels, singly and as a packet, demands bitwise agreement, and compares with the truth.
fn check(name: &str, mesh: &Mesh, rays: &[Ray]) {
    let simd = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    let scalar = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(Kernel::Scalar);
    let mut packet = [vec![false; rays.len()], vec![false; rays.len()]];
    simd.any_hit_packet(rays, &mut packet[0]);
    scalar.any_hit_packet(rays, &mut packet[1]);
    let mut closest = [vec![None; rays.len()], vec![None; rays.len()]];
    simd.closest_hit_packet(rays, &mut closest[0], |_, _| true);
    scalar.closest_hit_packet(rays, &mut closest[1], |_, _| true);
    let mut certain = 0;
    for (index, ray) in rays.iter().enumerate() {
        let hit = simd.closest_hit(ray);
        assert_eq!(closest[0][index], hit, "{name}: closest of a packet, {ray:?}");
        assert_eq!(
            closest[1][index], hit,
            "{name}: closest of a packet (scalar), {ray:?}"
        );
        assert_eq!(hit, scalar.closest_hit(ray), "{name}: kernels differ for {ray:?}");
        let any = hit.is_some();
        assert_eq!(simd.any_hit(ray), any, "{name}: any hit, {ray:?}");
        assert_eq!(scalar.any_hit(ray), any, "{name}: any hit (scalar), {ray:?}");
        assert_eq!(packet[0][index], any, "{name}: packet, {ray:?}");
        assert_eq!(packet[1][index], any, "{name}: packet (scalar), {ray:?}");
        certain += usize::from(compare_with_truth(name, mesh, ray, hit));
    }
    // A comparison that never was certain would prove nothing.
    assert!(
        certain * 4 > rays.len(),
        "{name}: only {certain} of {} rays are far from all edges",
        rays.len()
    );
}

#[test]
fn random_and_axis_aligned_rays_hit_what_a_double_precision_loop_hits_at_every_scale() {
    for scale in [1e-6, 1e-4, 1.0, 1e5] {
        for (name, mesh) in [
            ("boxes", box_grid(4)),
            ("sphere", sphere(12, 16)),
            ("soup", soup(300)),
        ] {
            let mesh = mesh.scaled(scale);
            check(&format!("{name} × {scale}"), &mesh, &awkward_rays(&mesh, 1500));
        }
    }
}

#[test]
fn axis_aligned_rays_with_zeros_and_denormals_of_either_sign_lose_no_hit() {
    for scale in [1e-6, 1e-4, 1.0, 1e5] {
        let mesh = box_grid(4).scaled(scale);
        let mut rays = vec![];
        let mut random = Random(7);
        for tiny in [
            0.0,
            -0.0,
            f32::from_bits(1),
            -f32::from_bits(1),
            1e-30,
            -1e-30,
            1e-12,
            -1e-12,
        ] {
            for axis in 0..3 {
                for sign in [1.0, -1.0] {
                    for _ in 0..40 {
                        let mut direction = Vec3::splat(tiny);
                        direction[axis] = sign;
                        let mut origin = random.point_in(&mesh);
                        origin[axis] -= 20.0 * scale * sign;
                        rays.push(Ray {
                            origin,
                            direction,
                            t_min: 0.0,
                            t_max: f32::INFINITY,
                        });
                    }
                }
            }
        }
        check(&format!("zeros × {scale}"), &mesh, &rays);
    }
}

/// Rays along and across the walls of boxes on a grid, through their corners: nothing is certain about the hit, but a box
/// that the ray passes through the middle of must be hit, and both kernels must agree.
#[test]
fn rays_through_grid_vertices_and_box_faces_find_the_box_behind() {
    for scale in [1e-6f32, 1e-4, 1.0, 1e5] {
        // Layer x = 0 is a plane of quads with integer corners; rays aim at corners and edge middles head-on and diagonally.
        let mesh = plane_grid(8).scaled(scale);
        for kernel in [Kernel::Scalar, Kernel::Avx2] {
            let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(kernel);
            for y in 1..16 {
                for z in 1..16 {
                    for (dy, dz) in [
                        (0.0, 0.0),
                        (-0.0, -0.0),
                        (1.0, 0.0),
                        (0.0, -1.0),
                        (1.0, 1.0),
                        (-1.0, 1.0),
                    ] {
                        let target = Vec3::new(0.0, y as f32, z as f32) * 0.5 * scale;
                        let direction = Vec3::new(1.0, dy, dz);
                        let ray = Ray {
                            origin: target - direction * 3.0 * scale,
                            direction,
                            t_min: 0.0,
                            t_max: f32::INFINITY,
                        };
                        let hit = bvh.closest_hit(&ray).unwrap_or_else(|| panic!("lost {ray:?}"));
                        // Three scale units away along x, where all coordinates are exact halves times the scale.
                        assert!((hit.t / (3.0 * scale) - 1.0).abs() < 1e-6, "{hit:?} for {ray:?}");
                        assert!(bvh.any_hit(&ray));
                    }
                }
            }
        }
    }
}

#[test]
fn the_length_of_the_direction_only_scales_t() {
    let mesh = sphere(12, 16);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    for ray in awkward_rays(&mesh, 500) {
        let hit = bvh.closest_hit(&ray);
        for exponent in [-40, -20, 30] {
            let power = 2f32.powi(exponent);
            let scaled = Ray {
                direction: ray.direction * power,
                t_max: ray.t_max / power,
                ..ray
            };
            let scaled_hit = bvh.closest_hit(&scaled);
            assert_eq!(
                scaled_hit.map(|h| (h.t * power, h.triangle)),
                hit.map(|h| (h.t, h.triangle))
            );
        }
    }
}

#[test]
fn a_scene_scaled_by_a_power_of_two_is_traced_bit_by_bit_alike() {
    let mesh = soup(200);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    for exponent in [-60, -14, 17, 60] {
        let scale = 2f32.powi(exponent);
        let scaled = mesh.clone().scaled(scale);
        let scaled_bvh = TriangleBvh::build(&scaled.positions, &scaled.triangles);
        for ray in awkward_rays(&mesh, 500) {
            let scaled_ray = Ray {
                origin: ray.origin * scale,
                t_max: ray.t_max * scale,
                ..ray
            };
            let hit = bvh.closest_hit(&ray).map(|h| (h.triangle, h.u, h.v, h.t * scale));
            assert_eq!(
                scaled_bvh
                    .closest_hit(&scaled_ray)
                    .map(|h| (h.triangle, h.u, h.v, h.t)),
                hit
            );
        }
    }
}

#[test]
fn a_scene_far_from_the_origin_is_hit_like_the_double_precision_loop_says() {
    for shift in [Vec3::new(1e4, -1e4, 1e4), Vec3::new(0.0, 1e5, 0.0)] {
        let mesh = sphere(12, 16).moved(shift);
        check(&format!("moved by {shift}"), &mesh, &awkward_rays(&mesh, 1500));
    }
}

#[test]
fn detail_inside_a_dome_a_hundred_thousand_times_larger_is_hit() {
    let mut mesh = sphere(12, 16).scaled(0.01);
    mesh.add(sphere(8, 8).scaled(1000.0));
    let inner = sphere(12, 16).scaled(0.01);
    check("dome", &mesh, &awkward_rays(&inner, 1500));
}

#[test]
fn non_finite_vertices_are_dropped_counted_and_hide_nothing() {
    let good = sphere(12, 16);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut mesh = good.clone();
        let first_bad = mesh.positions.len() as u32;
        mesh.positions
            .extend([Vec3::new(bad, 0.0, 0.0), Vec3::splat(bad)]);
        let mut bad_count = 0;
        let mut mixed = vec![];
        for (index, triangle) in good.triangles.iter().enumerate() {
            if index % 10 == 0 {
                mixed.push([triangle[0], first_bad + (index as u32 / 10) % 2, triangle[2]]);
                bad_count += 1;
            }
            mixed.push(*triangle);
        }
        mixed.push([0, 1, u32::MAX]);
        mesh.triangles = mixed;
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        assert_eq!(bvh.dropped(), bad_count + 1);
        let reference = TriangleBvh::build(&good.positions, &good.triangles);
        assert_eq!(bvh.bounds(), reference.bounds());
        for ray in awkward_rays(&good, 500) {
            let hit = bvh.closest_hit(&ray).map(|h| (h.t, h.u, h.v));
            assert_eq!(hit, reference.closest_hit(&ray).map(|h| (h.t, h.u, h.v)));
        }
    }
}

#[test]
fn empty_single_identical_and_degenerate_triangles_work() {
    let towards = Ray {
        origin: Vec3::new(0.2, 0.2, -1.0),
        direction: Vec3::Z,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let empty = TriangleBvh::build(&[], &[]);
    assert_eq!(
        (empty.closest_hit(&towards), empty.bounds(), empty.dropped()),
        (None, None, 0)
    );
    for count in [1, 2, 5, 9, 33, 1000] {
        for kernel in [Kernel::Scalar, Kernel::Avx2] {
            let bvh = TriangleBvh::build(&corners, &vec![[0, 1, 2]; count]).with_kernel(kernel);
            let hit = bvh.closest_hit(&towards).expect("the triangle stands in the way");
            // Of identical triangles the first one is named; the ray meets it at distance 1 with weights (0.6, 0.2, 0.2).
            assert_eq!((hit.t, hit.triangle), (1.0, 0));
            assert!((hit.u - 0.2).abs() < 1e-6 && (hit.v - 0.2).abs() < 1e-6);
            let points = TriangleBvh::build(&corners, &vec![[1, 1, 1]; count]).with_kernel(kernel);
            assert_eq!(points.closest_hit(&towards), None);
            let origin_only = TriangleBvh::build(&[Vec3::ZERO], &vec![[0, 0, 0]; count]).with_kernel(kernel);
            assert_eq!(origin_only.closest_hit(&towards), None);
            let mut mixed = vec![[0, 0, 1]; count];
            mixed.extend([[0, 1, 2], [1, 1, 2]]);
            let bvh = TriangleBvh::build(&corners, &mixed).with_kernel(kernel);
            assert_eq!(bvh.closest_hit(&towards).map(|h| h.triangle), Some(count as u32));
        }
    }
}

#[test]
fn rays_that_are_no_rays_hit_nothing() {
    let mesh = sphere(8, 8);
    for kernel in [Kernel::Scalar, Kernel::Avx2] {
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(kernel);
        let good = Ray {
            origin: Vec3::ZERO,
            direction: Vec3::X,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        assert!(bvh.any_hit(&good));
        let mut rays = vec![
            Ray {
                direction: Vec3::ZERO,
                ..good
            },
            Ray {
                t_min: f32::NAN,
                ..good
            },
            Ray {
                t_max: f32::NAN,
                ..good
            },
            Ray {
                t_min: 2.0,
                t_max: 1.0,
                ..good
            },
            Ray { t_max: -1.0, ..good },
            Ray {
                t_min: f32::INFINITY,
                ..good
            },
            Ray {
                origin: Vec3::splat(1e38),
                ..good
            },
        ];
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for axis in 0..3 {
                let (mut origin, mut direction) = (good, good);
                origin.origin[axis] = bad;
                direction.direction[axis] = bad;
                rays.extend([origin, direction]);
            }
        }
        let mut occluded = vec![true; rays.len()];
        bvh.any_hit_packet(&rays, &mut occluded);
        for (ray, occluded) in rays.iter().zip(occluded) {
            assert_eq!(bvh.closest_hit(ray), None, "{ray:?}");
            assert!(!bvh.any_hit(ray) && !occluded, "{ray:?}");
        }
    }
}

#[test]
fn rejected_hits_are_passed_through() {
    let mesh = soup(300);
    let odd = Mesh {
        positions: mesh.positions.clone(),
        triangles: mesh.triangles.iter().skip(1).step_by(2).copied().collect(),
    };
    let odd_bvh = TriangleBvh::build(&odd.positions, &odd.triangles);
    for kernel in [Kernel::Scalar, Kernel::Avx2] {
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(kernel);
        let rays = awkward_rays(&mesh, 1000);
        // Every ray passes through triangles of its own.
        let passes = |i: usize, hit: &Hit| hit.triangle as usize % 2 != i % 2;
        let mut occluded = vec![false; rays.len()];
        bvh.any_hit_packet_where(&rays, &mut occluded, passes);
        for (i, (ray, &occluded)) in rays.iter().zip(&occluded).enumerate() {
            assert_eq!(occluded, bvh.any_hit_where(ray, |hit| passes(i, hit)), "{ray:?}");
        }
        let mut packet = vec![None; rays.len()];
        bvh.closest_hit_packet(&rays, &mut packet, passes);
        for (i, (ray, hit)) in rays.iter().zip(packet).enumerate() {
            assert_eq!(hit, bvh.closest_hit_where(ray, |hit| passes(i, hit)), "{ray:?}");
        }
        for ray in rays {
            let hit = bvh.closest_hit_where(&ray, |hit| hit.triangle % 2 == 1);
            assert_eq!(
                bvh.any_hit_where(&ray, |hit| hit.triangle % 2 == 1),
                hit.is_some()
            );
            let expected = odd_bvh.closest_hit(&ray);
            assert_eq!(
                hit.map(|h| (h.t, h.triangle / 2)),
                expected.map(|h| (h.t, h.triangle))
            );
        }
    }
}

#[test]
fn a_ray_ends_where_its_interval_ends() {
    let mesh = plane_grid(4);
    for kernel in [Kernel::Scalar, Kernel::Avx2] {
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(kernel);
        let ray = Ray {
            origin: Vec3::new(-2.0, 1.3, 1.2),
            direction: Vec3::X,
            t_min: 0.0,
            t_max: 2.0,
        };
        assert!(bvh.any_hit(&ray));
        assert!(!bvh.any_hit(&Ray {
            t_max: 2f32.next_down(),
            ..ray
        }));
        assert!(bvh.any_hit(&Ray { t_min: 2.0, ..ray }));
        assert!(!bvh.any_hit(&Ray {
            t_min: 2f32.next_up(),
            t_max: 9.0,
            ..ray
        }));
    }
}

/// Watertightness: from inside a closed mesh every ray must hit, most of all one that aims at an edge or a vertex.
#[test]
fn no_ray_leaks_through_shared_edges_and_vertices_of_closed_meshes() {
    let mut cast = 0;
    for (mesh, scale, shift) in [
        (sphere(40, 60), 1.0, Vec3::ZERO),
        (sphere(40, 60), 1e-4, Vec3::ZERO),
        (sphere(40, 60), 1e5, Vec3::ZERO),
        (sphere(40, 60), 1.0, Vec3::splat(1e3)),
        (box_grid(1), 1.0, Vec3::ZERO),
    ] {
        let inside = mesh.center() * scale + shift;
        let mesh = mesh.scaled(scale).moved(shift);
        let kernels = [Kernel::Scalar, Kernel::Avx2]
            .map(|kernel| TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(kernel));
        let mut random = Random(3);
        for index in 0..80_000 {
            let triangle = mesh.triangles[random.below(mesh.triangles.len())];
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let target = match index % 4 {
                0 => a,
                1 => (a + b) * 0.5,
                _ => b + (c - b) * random.unit(),
            };
            let origin = inside + (random.point_in_cube() - 0.5) * 0.3 * scale;
            let ray = Ray {
                origin,
                direction: target - origin,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            for bvh in &kernels {
                assert!(bvh.closest_hit(&ray).is_some(), "leak: {ray:?}");
                assert!(bvh.any_hit(&ray), "leak of any hit: {ray:?}");
            }
            cast += 1;
        }
    }
    assert_eq!(cast, 400_000);
}

/// Coherent packets take paths of their own: they must return what single rays return, ray by ray.
#[test]
fn packets_with_a_common_end_return_what_single_rays_return() {
    let mut mesh = soup(3000);
    mesh.add(box_grid(3));
    for scale in [1e-4, 1.0, 1e5] {
        let mesh = mesh.clone().scaled(scale);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let scalar = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(Kernel::Scalar);
        let mut random = Random(23);
        let mut hits = [0, 0];
        for index in 0..200 {
            // A narrow or wide bundle of segments between a point and a cloud, common origin or common target; a
            // corner of a box as the common point now and then, so that triangles straddle origins.
            let common = if index % 3 == 0 {
                Vec3::new(2.0, 3.0, 1.0) * scale
            } else {
                random.point_in(&mesh)
            };
            let (center, width) = (random.point_in(&mesh), [0.05, 0.5, 3.0][index % 3] * scale);
            let rays: Vec<Ray> = (0..1 + random.below(300))
                .map(|_| {
                    let other = center + (random.point_in_cube() - 0.5) * width;
                    let (origin, target) = if index % 2 == 0 {
                        (common, other)
                    } else {
                        (other, common)
                    };
                    Ray {
                        origin,
                        direction: target - origin,
                        t_min: 0.0,
                        t_max: 0.999,
                    }
                })
                .collect();
            let mut occluded = vec![false; rays.len()];
            bvh.any_hit_packet(&rays, &mut occluded);
            for (ray, &occluded) in rays.iter().zip(&occluded) {
                assert_eq!(occluded, scalar.any_hit(ray), "{ray:?}");
                hits[usize::from(occluded)] += 1;
            }
            let mut closest = vec![None; rays.len()];
            bvh.closest_hit_packet(&rays, &mut closest, |_, _| true);
            for (ray, closest) in rays.iter().zip(closest) {
                assert_eq!(closest, scalar.closest_hit(ray), "{ray:?}");
            }
        }
        assert!(hits[0] > 1000 && hits[1] > 1000, "free and occluded: {hits:?}");
    }
}

#[test]
fn a_packet_longer_than_its_answer_fills_the_answer() {
    let mesh = sphere(8, 8);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    let ray = Ray {
        origin: Vec3::ZERO,
        direction: Vec3::X,
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let mut occluded = [false; 3];
    bvh.any_hit_packet(&[ray; 400], &mut occluded);
    assert_eq!(occluded, [true; 3]);
    let mut occluded = [false; 400];
    bvh.any_hit_packet(&[ray; 3], &mut occluded);
    assert_eq!(occluded.iter().filter(|o| **o).count(), 3);
    let mut hits = [None; 400];
    bvh.closest_hit_packet(&[ray; 3], &mut hits, |_, _| true);
    assert_eq!(hits.iter().flatten().count(), 3);
    bvh.closest_hit_packet(&[ray; 400], &mut hits[..200], |i, _| i % 2 == 0);
    assert_eq!(hits.iter().flatten().count(), 100);
}
