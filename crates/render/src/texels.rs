//! Texels of a lightmap as a camera's pixels are: each is one fragment, lit by its places on the surface.

use crate::exposure::{Exposure, RayEnd};
use glam::Vec3;
use rayon::prelude::*;
use relight_scene::shading::ShadingPoint;
use relight_scene::traced::TracedScene;

/// A place on a triangle's front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnTriangle {
    /// World index of the triangle.
    pub triangle: u32,
    /// Weights of its vertices 1 and 2.
    pub barycentric: [f32; 2],
}

/// Fragments of some texels, `width` to a row, whose places are `places[offsets[i]..offsets[i + 1]]`: the first is where texel `i` is lit, all
/// are what it is the mean of; a texel without one shows nothing. Every fragment is white and matt, so that the radiance it reflects is
/// irradiance over π; its normal is the smooth one, without normal maps, as engines read lightmaps.
///
/// # Panics
/// There are no offsets, or a place lies on no triangle of the scene.
pub fn expose_texels(scene: &TracedScene, width: usize, offsets: &[u32], places: &[OnTriangle]) -> Exposure {
    let texels = offsets.len() - 1;
    let hits: Vec<_> = (offsets.par_windows(2).with_min_len(1024))
        .map(|range| {
            let first = places[range[0] as usize..range[1] as usize].first()?;
            Some(scene.surface_at(first.triangle, first.barycentric, true))
        })
        .collect();
    let white = |hit: &Option<_>| hit.as_ref().map(|hit| ShadingPoint::lambert(hit, Vec3::ONE));
    let ends = places.iter().map(|place| RayEnd {
        primitive: place.triangle,
        barycentric: place.barycentric,
        front: true,
    });
    Exposure {
        width,
        height: texels / width.max(1),
        offsets: (0..=texels as u32).collect(),
        coverage: vec![1.0; texels],
        points: hits.iter().map(white).collect(),
        directions: (hits.iter())
            .map(|hit| hit.as_ref().map_or(Vec3::NEG_Y, |hit| -hit.normal))
            .collect(),
        hits,
        apart: true,
        ends: ends.collect(),
        end_offsets: offsets.to_vec(),
        ..Exposure::default()
    }
}
