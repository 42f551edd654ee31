//! Pixels that slender emissive surfaces pass: a lit tube, or a lamp far away, can be narrower than a pixel's rays lie apart,
//! and with the same rays in every pixel all of a tube would be missed.

use glam::Vec2;
use relight_scene::camera::Camera;
use relight_scene::traced::TracedScene;

/// Least height of a triangle in the image, in pixels, that the usual rays find.
const SLENDER: f32 = 1.0;

/// Whether each pixel is passed by a side of a slender emissive triangle, hidden or not; empty where none is. Triangles that
/// reach behind the eye are none.
pub(crate) fn passed_by_slender(
    scene: &TracedScene,
    camera: &Camera,
    width: usize,
    height: usize,
) -> Vec<bool> {
    let size = Vec2::new(width as f32, height as f32);
    let mut passed = Vec::new();
    for &triangle in scene.emissive_triangles() {
        let project = |vertex: glam::Vec3| {
            let d = vertex - camera.position;
            let along = Vec2::new(d.dot(camera.right), -d.dot(camera.up));
            let depth = d.dot(camera.forward);
            let at = 0.5 * (size + along / (depth * camera.tan_half_vfov) * size.y);
            (depth > 0.0 && at.is_finite()).then_some(at)
        };
        let [Some(a), Some(b), Some(c)] = scene.triangle_positions(triangle).map(project) else {
            continue;
        };
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if (b - a).perp_dot(c - a).abs() >= SLENDER * longest {
            continue;
        }
        passed.resize(width * height, false);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            mark(from, to, size, &mut passed);
        }
    }
    passed
}

/// Marks the pixels of a line, a place every half pixel.
fn mark(from: Vec2, to: Vec2, size: Vec2, passed: &mut [bool]) {
    // The part of it that lies in the image.
    let (mut first, mut last) = (0.0f32, 1.0f32);
    for (at, step, end) in [(from.x, to.x - from.x, size.x), (from.y, to.y - from.y, size.y)] {
        if step == 0.0 {
            if !(0.0..end).contains(&at) {
                return;
            }
            continue;
        }
        let (a, b) = ((0.0 - at) / step, (end - at) / step);
        first = first.max(a.min(b));
        last = last.min(a.max(b));
    }
    if first.is_nan() || last.is_nan() || first > last {
        return;
    }
    let steps = (2.0 * (to - from).length() * (last - first)).ceil().max(1.0) as usize;
    for k in 0..=steps {
        let at = from + (to - from) * (first + (last - first) * k as f32 / steps as f32);
        let (x, y) = (at.x.floor(), at.y.floor());
        if x >= 0.0 && y >= 0.0 && x < size.x && y < size.y {
            passed[y as usize * size.x as usize + x as usize] = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::expose::expose;
    use crate::test_scenes::{level, matt, quad, traced};
    use glam::Vec3;
    use relight_scene::camera::Camera;

    /// A tube a twentieth of a pixel wide before a wall, at 16 places of its pixel: every pixel that it passes shows it, and on
    /// average it covers a twentieth.
    #[test]
    fn a_tube_far_narrower_than_a_pixel_is_seen_along_all_of_its_length() {
        let size = 12;
        let pixel = 2.0 / size as f32;
        let mut covered = 0.0;
        for place in 0..16 {
            let x = pixel * (place as f32 / 16.0 + 0.013);
            let w = pixel / 40.0;
            let at = |x: f32, z: f32| Vec3::new(x, 0.1, z);
            let tube = quad(
                [at(x - w, 2.0), at(x + w, 2.0), at(x + w, -2.0), at(x - w, -2.0)],
                1,
            );
            let scene = traced(
                vec![level(3.0, 0.0, 0), tube],
                vec![matt(0.5, 0.0), matt(0.0, 1.0)],
            );
            // Sees 2 m of the tube's height.
            let eye = Camera::looking(Vec3::new(0.0, 2.1, 0.0), Vec3::NEG_Y, Vec3::NEG_Z, 0.5);
            let seen = expose(&scene, &eye, size, size, 16);
            for row in 0..size {
                let of_row = (0..size).flat_map(|x| seen.fragments_of(row * size + x));
                let glowing = of_row.filter(|&f| seen.points[f].is_some_and(|p| p.emission != Vec3::ZERO));
                let shown: f32 = glowing.map(|f| seen.coverage[f]).sum();
                assert!(shown > 0.0, "place {place}, row {row}");
                covered += shown / (16 * size) as f32;
            }
        }
        assert!((covered - 0.05).abs() < 0.01, "{covered}");
    }
}
