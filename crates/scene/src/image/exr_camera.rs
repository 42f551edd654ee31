//! A camera as OpenEXR's attributes have it.
//!
//! Source: "Position and Orientation" of OpenEXR's standard attributes: camera space is left-handed, x to the right, y up, z along the
//! view; normalised device coordinates run from (0, 0) in the upper left corner of the display window to (1, 1) in the lower
//! right one. Points are rows that matrices multiply from the right, as in Imath, so that the last row is the translation.

use crate::camera::Camera;
use glam::DVec3;

/// Distance at which the third coordinate of normalised device space is 0, metres. The image has no near plane, and nobody reads that
/// coordinate; but a matrix that has none can't be inverted.
const NEAR: f64 = 0.01;

/// What a frame says about the camera that sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrCamera {
    /// Its name, attribute `cameraLabel`; empty: it has none.
    pub name: String,
    /// Attribute `worldToCamera`, row by row; metres to metres.
    pub world_to_camera: [f32; 16],
    /// Attribute `worldToNDC`, row by row.
    pub world_to_ndc: [f32; 16],
    /// Attributes `fieldOfViewHorizontal` and `fieldOfViewVertical`, degrees.
    pub field_of_view_deg: [f32; 2],
    /// Attribute `screenWindowWidth`: the image's width one metre before the eye, metres.
    pub screen_window_width: f32,
}

impl ExrCamera {
    /// Of an image of `size` (columns and rows). The world is that of the scene's file, from whose coordinates `offset` was taken
    /// away ([`crate::scene::Scene::offset`]).
    pub fn of(camera: &Camera, name: &str, offset: DVec3, size: (usize, usize)) -> ExrCamera {
        let axes = [camera.right, camera.up, camera.forward].map(|axis| axis.as_dvec3());
        let eye = camera.position.as_dvec3() + offset;
        let mut to_camera = [[0.0f64; 4]; 4];
        for (column, axis) in axes.iter().enumerate() {
            for (row, component) in axis.to_array().into_iter().enumerate() {
                to_camera[row][column] = component;
            }
            to_camera[3][column] = -eye.dot(*axis);
        }
        to_camera[3][3] = 1.0;
        let tan_y = f64::from(camera.tan_half_vfov);
        let tan_x = tan_y * size.0 as f64 / size.1.max(1) as f64;
        // Divided by the fourth coordinate, which is the planar distance.
        let to_ndc = to_camera.map(|[x, y, z, w]| {
            [
                0.5 * x / tan_x + 0.5 * z,
                -0.5 * y / tan_y + 0.5 * z,
                z - NEAR * w,
                z,
            ]
        });
        let flat = |matrix: [[f64; 4]; 4]| {
            let mut values = [0.0f32; 16];
            (values.iter_mut().zip(matrix.as_flattened())).for_each(|(to, v)| *to = *v as f32);
            values
        };
        ExrCamera {
            name: name.to_owned(),
            world_to_camera: flat(to_camera),
            world_to_ndc: flat(to_ndc),
            field_of_view_deg: [tan_x, tan_y].map(|tan| (2.0 * tan.atan().to_degrees()) as f32),
            screen_window_width: (2.0 * tan_x) as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, Vec3};

    fn times(point: Vec3, matrix: &[f32; 16]) -> [f32; 4] {
        let row = [point.x, point.y, point.z, 1.0];
        [0, 1, 2, 3].map(|column| (0..4).map(|r| row[r] * matrix[4 * r + column]).sum())
    }

    /// Truth: the rays that the camera casts. What lies on the one through a place of the image has that place's coordinates.
    #[test]
    fn what_a_ray_meets_has_the_coordinates_of_its_pixel() {
        let camera = Camera::looking(
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(0.3, -0.4, -0.8).normalize(),
            Vec3::Y,
            0.4,
        );
        let size = Vec2::new(64.0, 36.0);
        let said = ExrCamera::of(&camera, "c", DVec3::ZERO, (64, 36));
        for pixel in [Vec2::new(0.0, 0.0), Vec2::new(64.0, 36.0), Vec2::new(10.5, 30.5)] {
            let direction = camera.direction(pixel, size);
            let point = camera.position + 5.0 * direction;
            let [x, y, z, w] = times(point, &said.world_to_ndc);
            assert!(
                (Vec2::new(x / w, y / w) - pixel / size).length() < 1e-5,
                "{pixel}"
            );
            assert!(0.0 < z && z < w);
            let seen = times(point, &said.world_to_camera);
            let planar = 5.0 * direction.dot(camera.forward);
            assert!((seen[2] - planar).abs() < 1e-5 && (w - planar).abs() < 1e-5);
            // To the right and above the middle are positive.
            assert_eq!(seen[0] > 0.0, pixel.x > 32.0);
            assert_eq!(seen[1] > 0.0, pixel.y < 18.0);
        }
        let [horizontal, vertical] = said.field_of_view_deg.map(f32::to_radians);
        assert!(((0.5 * vertical).tan() - 0.4).abs() < 1e-6);
        assert!(((0.5 * horizontal).tan() - 0.4 * 64.0 / 36.0).abs() < 1e-6);
        assert!((said.screen_window_width - 0.8 * 64.0 / 36.0).abs() < 1e-6);
    }

    /// Truth: the same camera of the file's own coordinates.
    #[test]
    fn a_scene_that_was_moved_is_told_where_its_file_has_it() {
        let here = Camera::looking(Vec3::new(1.0, 2.0, 3.0), Vec3::NEG_Z, Vec3::Y, 0.5);
        let there = Camera::looking(Vec3::new(1025.0, 2.0, -509.0), Vec3::NEG_Z, Vec3::Y, 0.5);
        let offset = DVec3::new(1024.0, 0.0, -512.0);
        assert_eq!(
            ExrCamera::of(&here, "", offset, (8, 8)),
            ExrCamera::of(&there, "", DVec3::ZERO, (8, 8))
        );
    }
}
