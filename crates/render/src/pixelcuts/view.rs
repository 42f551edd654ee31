//! What eye rays find: the points whose light is wanted.

use crate::layers::RenderSize;
use crate::picture::Picture;
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_transport::pixel_tree::TreePixel;

/// A point of a surface that the eye sees.
pub(super) struct Point {
    pub hit: SurfaceHit,
    pub shading: ShadingPoint,
    /// Unit, towards the eye.
    pub wo: Vec3,
    /// What solid glass leaves of its light, linear RGB.
    pub tint: Vec3,
}

/// All points of an image.
pub(super) struct View {
    pub size: RenderSize,
    pub points: Vec<Point>,
    /// Point per sample, pixel and row, or [`NOTHING`].
    index: Vec<u32>,
    /// Per point its column, row and sample.
    pub place: Vec<[u32; 3]>,
    /// Diagonal of the box of all points, metres; not 0.
    pub diagonal: f32,
}

const NOTHING: u32 = u32::MAX;
/// Cosine between shading normal and smooth normal from which on they are one.
const SAME_NORMAL: f32 = 1.0 - 1e-6;

impl View {
    /// The same eye rays as of `brute` and `path`.
    pub fn new(picture: &Picture<'_>, spp: u32) -> View {
        let Picture { scene, size, .. } = *picture;
        let RenderSize { width, height } = size;
        let found: Vec<Vec<(Point, [u32; 3])>> = (0..height * spp as usize)
            .into_par_iter()
            .map(|row| {
                let (sample, y) = ((row / height) as u32, row % height);
                let points = (0..width).filter_map(|x| {
                    let (eye, _) = picture.eye_ray((x, y), sample);
                    let look = scene.look(&eye, |_, _, _| ());
                    let (hit, wo, tint) = (look.hit?, -look.ray.direction, look.tint);
                    let shading = scene.shading_point(&hit).facing(wo);
                    let point = Point {
                        hit,
                        shading,
                        wo,
                        tint,
                    };
                    Some((point, [x as u32, y as u32, sample]))
                });
                points.collect()
            })
            .collect();
        let (points, place): (Vec<Point>, Vec<[u32; 3]>) = found.into_iter().flatten().unzip();
        let mut view = View {
            size,
            index: vec![NOTHING; width * height * spp as usize],
            points,
            place,
            diagonal: 0.0,
        };
        for (point, &[x, y, sample]) in view.place.iter().enumerate() {
            let at = view.slot((x as usize, y as usize), sample);
            view.index[at] = point as u32;
        }
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for point in &view.points {
            low = low.min(point.hit.position);
            high = high.max(point.hit.position);
        }
        let diagonal = (high.as_dvec3() - low.as_dvec3()).length() as f32;
        // One point alone: any length will do.
        view.diagonal = if diagonal > 0.0 && diagonal.is_finite() {
            diagonal
        } else {
            1.0
        };
        view
    }

    fn slot(&self, (x, y): (usize, usize), sample: u32) -> usize {
        (sample as usize * self.size.height + y) * self.size.width + x
    }

    /// The point of a sample of a pixel.
    pub fn at(&self, pixel: (usize, usize), sample: u32) -> Option<usize> {
        let point = self.index[self.slot(pixel, sample)];
        (point != NOTHING).then_some(point as usize)
    }

    /// The points as trees see them.
    pub fn tree_pixels(&self) -> Vec<TreePixel> {
        self.points
            .par_iter()
            .map(|point| TreePixel {
                position: point.hit.position,
                normal: point.hit.normal,
                plain: point.shading.shading_normal.dot(point.hit.normal) >= SAME_NORMAL,
                glossy: !point.shading.lambert
                    && (point.shading.f0 != Vec3::ZERO || point.shading.layers.is_some()),
            })
            .collect()
    }
}
