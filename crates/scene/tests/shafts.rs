//! Shafts: what rays from somewhere to somewhere may meet.

mod rays_common;

use glam::Vec3;
use rays_common::*;
use relight_scene::rays::{
    self, BvhPart, Kernel, Ray, ShaftEnd, ShaftStart, SurfacePoint, TriangleBvh, surface_point,
};

/// Points of a mesh that rays from anywhere find, normals towards where those come from; neighbours lie within `spread`.
fn points(
    mesh: &Mesh,
    bvh: &TriangleBvh,
    random: &mut Random,
    count: usize,
    spread: f32,
) -> Vec<SurfacePoint> {
    let (low, high) = mesh.bounds();
    let size = (high - low).max_element();
    let eye = random.point_in(mesh) + random.direction() * size * 0.1;
    let aim = random.direction();
    let rays = (0..20 * count).map(|_| Ray {
        origin: eye,
        direction: aim + random.direction() * spread,
        t_min: 0.0,
        t_max: f32::INFINITY,
    });
    rays.filter_map(|ray| {
        let point = surface_point(bvh, &bvh.closest_hit(&ray)?);
        let facing = point.normal * -point.normal.dot(ray.direction).signum();
        (facing != Vec3::ZERO).then_some(SurfacePoint {
            normal: facing,
            ..point
        })
    })
    .take(count)
    .collect()
}

/// A shaft with rays in it.
struct Case {
    start: ShaftStart,
    end: ShaftEnd,
    rays: Vec<Ray>,
}

fn case(mesh: &Mesh, bvh: &TriangleBvh, random: &mut Random, number: usize) -> Option<Case> {
    let spread = [0.0, 1e-3, 0.1][number % 3];
    let from = points(mesh, bvh, random, 8, spread);
    let start = ShaftStart::around(from.iter().copied());
    let half = 10f32.powf(-4.0 * random.unit());
    let mut ends = Vec::new();
    let mut rays = Vec::new();
    let (mut endless, mut clearance) = (false, 0.0f32);
    let (low, high) = mesh.bounds();
    let size = (high - low).max_element();
    match number / 3 % 3 {
        // To surfaces.
        0 => {
            let to = points(mesh, bvh, random, 24, half);
            clearance = to.iter().map(|p| p.clearance).fold(0.0, f32::max);
            for (k, to) in to.iter().enumerate() {
                ends.push(to.position - start.centre);
                rays.push(rays::shadow_ray(from.get(k % from.len().max(1))?, to));
            }
        }
        // To points in space, some beyond the scene.
        1 => {
            let middle = random.point_in(mesh) + random.direction() * size * (random.unit() - 0.5).max(0.0);
            for k in 0..24 {
                let to = middle + (random.point_in_cube() - 0.5) * half * size;
                ends.push(to - start.centre);
                rays.push(rays::shadow_ray_to_point(from.get(k % from.len().max(1))?, to));
            }
        }
        // Into directions.
        _ => {
            endless = true;
            let axis = if number.is_multiple_of(2) {
                Vec3::Y
            } else {
                random.direction()
            };
            for k in 0..24 {
                let to = (axis + (random.point_in_cube() - 0.5) * half).normalize();
                ends.push(to);
                rays.push(rays::ray_from_surface(from.get(k % from.len().max(1))?, to));
            }
        }
    }
    let bound = |of: fn(Vec3, Vec3) -> Vec3| ends.iter().copied().reduce(of);
    Some(Case {
        start,
        end: ShaftEnd {
            low: bound(Vec3::min)?,
            high: bound(Vec3::max)?,
            endless,
            clearance,
            on_surfaces: (number / 3).is_multiple_of(3),
        },
        rays,
    })
}

/// Truth: rays through the whole scene.
#[test]
fn what_a_ray_meets_is_among_the_parts_of_its_shaft_at_every_scale() {
    let mut room = box_grid(1).scaled(4.0).moved(Vec3::splat(-2.0));
    room.add(soup(300));
    let (mut met, mut missed, mut narrowed) = (0, 0, 0);
    for (name, mesh) in [("boxes", box_grid(4)), ("sphere", sphere(24, 32)), ("room", room)] {
        for (scale, shift) in [
            (1e-6, Vec3::ZERO),
            (1.0, Vec3::ZERO),
            (1e5, Vec3::ZERO),
            (1.0, Vec3::new(1e4, -1e4, 1e4)),
        ] {
            let mesh = Mesh {
                positions: mesh.positions.clone(),
                triangles: mesh.triangles.clone(),
            };
            let mesh = mesh.scaled(scale).moved(shift);
            let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
            let scalar = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(Kernel::Scalar);
            let mut random = Random(77);
            for number in 0..400 {
                let Some(Case { start, end, rays }) = case(&mesh, &bvh, &mut random, number) else {
                    continue;
                };
                // In one go, or in two.
                let steps = [usize::MAX, 2][number % 2];
                let (mut first, mut kept, mut same) = (vec![], vec![], vec![]);
                assert!(bvh.narrow(&start, &end, &[BvhPart::ALL], steps, usize::MAX, &mut first));
                assert!(bvh.narrow(&start, &end, &first, usize::MAX, usize::MAX, &mut kept));
                assert!(scalar.narrow(&start, &end, &first, usize::MAX, usize::MAX, &mut same));
                assert_eq!(kept, same, "{name} × {scale}, {number}");
                assert!(kept.iter().all(|part| part.is_triangles()));
                for ray in &rays {
                    let truth = bvh.any_hit(ray);
                    let among = bvh.some_hit_among(ray, &kept, |_| true).is_some();
                    assert_eq!(truth, among, "{name} × {scale} at {shift}, {number}: {ray:?}");
                    assert_eq!(truth, scalar.some_hit_among(ray, &kept, |_| true).is_some());
                    *(if truth { &mut met } else { &mut missed }) += 1;
                }
                narrowed += usize::from(kept.len() * 16 < mesh.triangles.len());
            }
        }
    }
    // Nothing would be shown if no ray met anything, or if shafts kept all.
    assert!(met > 10_000 && missed > 10_000, "{met} {missed}");
    assert!(narrowed > 2000, "{narrowed}");
}

/// In a room with flat walls nothing lies between a wall and what hangs in the air, the walls' own triangles included.
#[test]
fn a_shaft_through_air_is_empty() {
    for scale in [1e-3, 1.0, 1e4] {
        let mut room = box_grid(1).scaled(scale);
        room.quads(12, 12, |u, v| Vec3::new(u / 12.0, 0.5, v / 12.0) * scale);
        let bvh = TriangleBvh::build(&room.positions, &room.triangles);
        let mut random = Random(3);
        let (mut empty, mut count) = (0, 0);
        while count < 500 {
            // From the lower side of the shelf to boxes below it.
            let place = Vec3::new(random.unit(), 0.3, random.unit()) * scale;
            let up = Ray {
                origin: place,
                direction: Vec3::Y,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            let point = surface_point(&bvh, &bvh.closest_hit(&up).unwrap());
            let point = SurfacePoint {
                normal: -Vec3::Y,
                ..point
            };
            let along = |unit: f32| 0.05 + 0.9 * unit;
            let centre = Vec3::new(along(random.unit()), 0.25, along(random.unit())) * scale - point.position;
            let half = Vec3::splat(0.2 * random.unit() * scale) * Vec3::new(0.1, 1.0, 0.1);
            let end = ShaftEnd {
                low: centre - half,
                high: centre + half,
                endless: false,
                clearance: 0.0,
                on_surfaces: false,
            };
            let mut kept = vec![];
            let start = ShaftStart::around(std::iter::once(point));
            assert!(bvh.narrow(&start, &end, &[BvhPart::ALL], usize::MAX, usize::MAX, &mut kept));
            empty += usize::from(kept.is_empty());
            count += 1;
        }
        assert!(empty * 1000 > 999 * count, "{empty} of {count} at {scale}");
    }
}

#[test]
fn a_shaft_that_holds_too_much_says_so() {
    let mesh = box_grid(4);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    let start = ShaftStart {
        centre: mesh.center(),
        half: Vec3::ZERO,
        normal: Vec3::ZERO,
        floor: 0.0,
        slack: 0.0,
    };
    let end = ShaftEnd {
        low: Vec3::splat(-100.0),
        high: Vec3::splat(100.0),
        endless: false,
        clearance: 0.0,
        on_surfaces: false,
    };
    let mut kept = vec![];
    assert!(!bvh.narrow(&start, &end, &[BvhPart::ALL], usize::MAX, 8, &mut kept));
    assert!(kept.len() <= 8);
    kept.clear();
    assert!(bvh.narrow(&start, &end, &[BvhPart::ALL], 0, 8, &mut kept));
    assert_eq!(kept, [BvhPart::ALL], "nothing opened, nothing told apart");
    for bad in [f32::NAN, f32::INFINITY] {
        let end = ShaftEnd {
            high: Vec3::splat(bad),
            ..end
        };
        assert!(!bvh.narrow(&start, &end, &[BvhPart::ALL], 9, 9, &mut kept));
    }
}
