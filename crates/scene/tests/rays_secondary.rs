//! Rays between surfaces: in a convex room everything sees everything, at every scale, and what stands just beyond the
//! offset still casts a shadow.

mod rays_common;

use glam::Vec3;
use rays_common::*;
use relight_scene::rays::{self, Ray, SurfacePoint, TriangleBvh};

/// From 1e-4 to 1e5, with the 7 mm of a small product model.
const SCALES: [f32; 7] = [1e-4, 3e-3, 7e-3, 1.0, 40.0, 1e3, 1e5];

/// Points that rays from the middle of a convex mesh find, a third of them aimed at vertices and edges. Normals inward.
fn inner_points(mesh: &Mesh, bvh: &TriangleBvh, count: usize) -> Vec<SurfacePoint> {
    let mut random = Random(9);
    let eye = mesh.center();
    (0..count)
        .map(|index| {
            let [a, b, _] =
                mesh.triangles[random.below(mesh.triangles.len())].map(|i| mesh.positions[i as usize]);
            let direction = match index % 6 {
                0 => a - eye,
                1 => a + (b - a) * random.unit() - eye,
                _ => random.direction(),
            };
            let ray = Ray {
                origin: eye,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            let hit = bvh.closest_hit(&ray).expect("a closed mesh");
            let point = rays::surface_point(bvh, &hit);
            let inward = if point.normal.dot(eye - point.position) < 0.0 {
                -point.normal
            } else {
                point.normal
            };
            SurfacePoint {
                normal: inward,
                ..point
            }
        })
        .collect()
}

/// A room whose walls are made of triangles of very different size: a coarse half beside a fine one.
fn room() -> Mesh {
    let mut mesh = Mesh {
        positions: vec![],
        triangles: vec![],
    };
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            for (columns, low, high) in [(1, 0.0, 0.5), (16, 0.5, 1.0)] {
                mesh.quads(columns, columns, |u, v| {
                    let (u, v) = (u / columns as f32, v / columns as f32);
                    let mut p = Vec3::splat(side);
                    p[(axis + 1) % 3] = low + (high - low) * u;
                    p[(axis + 2) % 3] = v;
                    p
                });
            }
        }
    }
    mesh
}

/// Every pair of points with at least `least_cosine` at both ends sees each other; returns how many pairs were asked.
fn all_see_each_other(name: &str, points: &[SurfacePoint], bvh: &TriangleBvh, least_cosine: f32) -> usize {
    let mut random = Random(13);
    let mut asked = 0;
    for _ in 0..20_000 {
        let (from, to) = (
            &points[random.below(points.len())],
            &points[random.below(points.len())],
        );
        let direction = (to.position - from.position).normalize_or_zero();
        if direction.dot(from.normal) < least_cosine || -direction.dot(to.normal) < least_cosine {
            continue;
        }
        asked += 1;
        let ray = rays::shadow_ray(from, to);
        assert_eq!(
            bvh.closest_hit(&ray),
            None,
            "{name}: {from:?} does not see {to:?} along {ray:?}"
        );
    }
    asked
}

#[test]
fn in_a_flat_walled_room_no_wall_shadows_another() {
    for scale in SCALES {
        let mesh = room().scaled(scale);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let points = inner_points(&mesh, &bvh, 2000);
        // Walls are exactly plane, so that even grazing chords between two of them are free.
        let asked = all_see_each_other(&format!("room × {scale}"), &points, &bvh, 1e-3);
        assert!(asked > 10_000, "only {asked} pairs");
    }
}

#[test]
fn a_room_ten_kilometres_from_the_origin_behaves_like_one_at_home() {
    for shift in [Vec3::new(1e4, 0.0, -1e4), Vec3::splat(1e4)] {
        let mesh = room().scaled(40.0).moved(shift);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let points = inner_points(&mesh, &bvh, 2000);
        // Coordinates there are 1 mm apart: the offset is a few of them, not more.
        let clearance = points.iter().map(|p| p.clearance).fold(0.0, f32::max);
        assert!(clearance < 3e-3, "clearance {clearance}");
        assert!(all_see_each_other("far room", &points, &bvh, 0.01) > 10_000);
    }
}

#[test]
fn inside_a_sphere_all_points_see_each_other() {
    for scale in SCALES {
        let mesh = sphere(24, 32).scaled(scale);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let points = inner_points(&mesh, &bvh, 2000);
        assert!(all_see_each_other(&format!("sphere × {scale}"), &points, &bvh, 1e-3) > 10_000);
    }
}

#[test]
fn a_ray_that_leaves_a_convex_body_never_meets_it_again() {
    for scale in SCALES {
        for (name, mesh) in [("sphere", sphere(24, 32)), ("room", room())] {
            let mesh = mesh.scaled(scale);
            let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
            let mut random = Random(17);
            for point in inner_points(&mesh, &bvh, 3000) {
                for _ in 0..10 {
                    let direction = random.direction();
                    let outward = if direction.dot(point.normal) > 0.0 {
                        -direction
                    } else {
                        direction
                    };
                    let ray = rays::ray_from_surface(&point, outward);
                    assert_eq!(
                        bvh.closest_hit(&ray),
                        None,
                        "{name} × {scale}: {point:?}, {ray:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn rays_into_a_room_arrive_at_the_opposite_wall() {
    for scale in SCALES {
        let mesh = room().scaled(scale);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        for point in inner_points(&mesh, &bvh, 2000) {
            let ray = rays::ray_from_surface(&point, point.normal);
            let hit = bvh.closest_hit(&ray).expect("the opposite wall");
            // The room is `scale` wide and the offset a few hundred thousandths of that.
            assert!((hit.t / scale - 1.0).abs() < 1e-4, "{hit:?} from {point:?}");
        }
    }
}

/// A patch a small multiple of the offset above the start, or above the end, hides the one from the other.
#[test]
fn an_occluder_a_few_offsets_away_is_not_missed() {
    for (scale, shift) in SCALES
        .iter()
        .map(|&s| (s, Vec3::ZERO))
        .chain([(40.0, Vec3::splat(1e4))])
    {
        let mesh = room().scaled(scale).moved(shift);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let points = inner_points(&mesh, &bvh, 400);
        for pair in points.chunks_exact(2) {
            let (from, to) = (&pair[0], &pair[1]);
            let direction = (to.position - from.position).normalize_or_zero();
            if direction.dot(from.normal) < 0.1 || -direction.dot(to.normal) < 0.1 {
                continue;
            }
            let free = rays::shadow_ray(from, to);
            assert!(!bvh.any_hit(&free));
            let end = free.origin + free.direction;
            for (point, tip) in [(from, free.origin), (to, end)] {
                let offset = (tip - point.position).length();
                // Four offsets above the wall, wide enough that the slanted ray passes through it.
                let middle = point.position + point.normal * (4.0 * offset);
                let (u, v) = point.normal.any_orthonormal_pair();
                let reach = 100.0 * offset;
                let mut occluded = mesh.clone();
                let first = occluded.positions.len() as u32;
                let corners = [u - v, v * 2.0 - u * 0.1, -u - v];
                occluded
                    .positions
                    .extend(corners.map(|corner| middle + corner * reach));
                occluded.triangles.push([first, first + 1, first + 2]);
                let with = TriangleBvh::build(&occluded.positions, &occluded.triangles);
                assert!(
                    with.any_hit(&rays::shadow_ray(from, to)),
                    "× {scale}: occluder at {middle} missed by {free:?}"
                );
            }
        }
    }
}

#[test]
fn a_point_light_at_the_end_of_the_ray_is_seen_and_one_behind_a_wall_is_not() {
    for scale in SCALES {
        let mesh = room().scaled(scale);
        let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let light = Vec3::new(0.4, 0.7, 0.3) * scale;
        for point in inner_points(&mesh, &bvh, 1000) {
            assert!(!bvh.any_hit(&rays::shadow_ray_to_point(&point, light)));
            // A light beyond the room in the same direction is hidden by the wall between. The light in the room is at
            // least 0.3 of its size from each wall, so that six times its distance is outside.
            let outside = point.position + (light - point.position) * 6.0;
            assert!(bvh.any_hit(&rays::shadow_ray_to_point(&point, outside)));
        }
    }
}

#[test]
fn the_point_of_a_hit_lies_on_its_triangle_within_its_bound() {
    let mesh = soup(300);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    for ray in awkward_rays(&mesh, 2000) {
        let Some(hit) = bvh.closest_hit(&ray) else {
            continue;
        };
        let (position, error) = rays::hit_position(&bvh, &hit);
        let [a, b, c] = bvh.triangle(hit.triangle).expect("hit").map(Vec3::as_dvec3);
        let exact =
            a * (1.0 - f64::from(hit.u) - f64::from(hit.v)) + b * f64::from(hit.u) + c * f64::from(hit.v);
        assert!(
            (position.as_dvec3() - exact).abs().cmple(error.as_dvec3()).all(),
            "{position} ± {error}"
        );
    }
}
