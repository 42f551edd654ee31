//! Walls as two sheets that lie on each other and face opposite ways: the one whose front faces the ray is met, whichever is
//! nearer by a rounding or by a hundred-thousandth of the wall, and neither hides what the other one sees.

mod rays_common;

use glam::{Quat, Vec3};
use rays_common::*;
use relight_scene::rays::{self, Kernel, Ray, TriangleBvh};

/// How the two sheets of a wall differ.
#[derive(Clone, Copy, Debug)]
struct Sheets {
    /// How far the back sheet lies behind the front one, in widths of the room.
    gap: f32,
    /// The back sheets are the first in the list.
    backs_first: bool,
    /// Columns and rows of the back sheet; the front sheet has 1.
    columns: u32,
    rotation: Quat,
    scale: f32,
    center: Vec3,
}

/// A cube of width 2 `scale` around `center`. Fronts of triangles below the number that is returned with it face the room if
/// `backs_first` is off, and all others face outwards.
fn room(sheets: &Sheets) -> (Mesh, usize) {
    let mut parts = [false, true].map(|back| {
        let mut mesh = Mesh {
            positions: vec![],
            triangles: vec![],
        };
        for axis in 0..3 {
            for side in [-1.0f32, 1.0] {
                let columns = if back { sheets.columns } else { 1 };
                let away = if back { 2.0 * sheets.gap } else { 0.0 };
                mesh.quads(columns, columns, |u, v| {
                    let (u, v) = (2.0 * u / columns as f32 - 1.0, 2.0 * v / columns as f32 - 1.0);
                    let mut p = Vec3::splat(side * (1.0 + away));
                    p[(axis + 1) % 3] = u;
                    p[(axis + 2) % 3] = v;
                    sheets.center + sheets.rotation * p * sheets.scale
                });
            }
        }
        for triangle in &mut mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let inward = (b - a).cross(c - a).dot(sheets.center - a) > 0.0;
            if inward == back {
                triangle.swap(1, 2);
            }
        }
        mesh
    });
    if sheets.backs_first {
        parts.swap(0, 1);
    }
    let [mut mesh, second] = parts;
    let (first, vertices) = (mesh.triangles.len(), mesh.positions.len() as u32);
    mesh.positions.extend(second.positions);
    (mesh.triangles).extend(second.triangles.iter().map(|t| t.map(|i| i + vertices)));
    (mesh, first)
}

fn all_sheets() -> Vec<Sheets> {
    let mut all = vec![];
    let turned = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.3);
    for gap in [0.0, 1e-7, 1e-5, 1e-4, -1e-7, -1e-6, -1e-5] {
        for (rotation, scale, center) in [
            (Quat::IDENTITY, 2.0, Vec3::ZERO),
            (turned, 2.0, Vec3::new(7.0, -3.0, 11.0)),
            (turned, 3e-3, Vec3::ZERO),
            (Quat::IDENTITY, 1e4, Vec3::splat(2e4)),
        ] {
            for (backs_first, columns) in [(false, 1), (true, 1), (true, 3)] {
                all.push(Sheets {
                    gap,
                    backs_first,
                    columns,
                    rotation,
                    scale,
                    center,
                });
            }
        }
    }
    all
}

#[test]
fn of_two_sheets_the_one_that_faces_the_ray_is_met_and_neither_hides_what_it_sees() {
    for sheets in all_sheets() {
        let (mesh, first) = room(&sheets);
        let faces_room = |triangle: u32| ((triangle as usize) < first) != sheets.backs_first;
        let simd = TriangleBvh::build(&mesh.positions, &mesh.triangles);
        let scalar = TriangleBvh::build(&mesh.positions, &mesh.triangles).with_kernel(Kernel::Scalar);
        let mut random = Random(5);
        let mut points = vec![];
        let cast = |ray: &Ray, at: &str| {
            let hit = simd.closest_hit(ray);
            assert_eq!(hit, scalar.closest_hit(ray), "kernels differ {at}: {sheets:?}");
            let hit = hit.unwrap_or_else(|| panic!("lost {at}: {ray:?} {sheets:?}"));
            assert!(
                faces_room(hit.triangle),
                "the back is met {at}: {hit:?} {ray:?} {sheets:?}"
            );
            hit
        };
        for _ in 0..400 {
            // A place on a wall, not in an edge of the room: there sheets before other walls' are real.
            let mut place = Vec3::from_array([0; 3].map(|_| 1.998 * random.unit() - 0.999));
            let axis = random.below(3);
            place[axis] = 1f32.copysign(place[axis]);
            let target = sheets.center + sheets.rotation * place * sheets.scale;
            let eye = Vec3::from_array([0; 3].map(|_| 1.8 * random.unit() - 0.9));
            let eye = sheets.center + sheets.rotation * eye * sheets.scale;
            let hit = cast(
                &Ray {
                    origin: eye,
                    direction: target - eye,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                },
                "from the room",
            );
            points.push(rays::surface_point(&simd, &hit));
        }
        for (i, from) in points.iter().enumerate() {
            let direction = random.direction();
            let direction = direction * direction.dot(from.normal).signum();
            if direction.dot(from.normal) > 0.02 {
                cast(&rays::ray_from_surface(from, direction), "from a wall");
            }
            let to = points[(i + 1) % points.len()];
            let between = (to.position - from.position).normalize_or_zero();
            if between.dot(from.normal).min(-between.dot(to.normal)) > 0.02 {
                let ray = rays::shadow_ray(from, &to);
                assert!(
                    !simd.any_hit(&ray) && !scalar.any_hit(&ray),
                    "{from:?} {to:?} {sheets:?}"
                );
            }
            let ray = rays::shadow_ray_to_point(from, sheets.center);
            assert!(!simd.any_hit(&ray), "to the middle: {from:?} {sheets:?}");
        }
    }
}

#[test]
fn a_back_with_no_front_close_behind_it_is_met() {
    // Seen from outside, the walls of a single-sheeted room show their backs; the far walls' fronts lie behind.
    let sheets = Sheets {
        gap: 0.0,
        backs_first: false,
        columns: 1,
        rotation: Quat::IDENTITY,
        scale: 1.0,
        center: Vec3::ZERO,
    };
    let (mut mesh, first) = room(&sheets);
    mesh.triangles.truncate(first);
    let bvh = TriangleBvh::build(&mesh.positions, &mesh.triangles);
    let mut random = Random(3);
    for _ in 0..500 {
        let direction = random.direction();
        let inside = Vec3::from_array([0; 3].map(|_| 1.8 * random.unit() - 0.9));
        let ray = Ray {
            origin: inside - 9.0 * direction,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let hit = bvh.closest_hit(&ray).expect("a wall");
        let at = ray.origin + hit.t * direction;
        assert!(
            hit.t < 9.0 && (at.abs().max_element() - 1.0).abs() < 1e-5 && hit.sheet == 0.0,
            "{hit:?}"
        );
    }
}
