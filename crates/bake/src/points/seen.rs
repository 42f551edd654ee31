//! Which points cameras see (`--cameras-only`).
//!
//! Finer receivers than the bounces need serve pixels alone, with the coarser ones that predict them. Where no pixel of
//! any camera asks for one, its rows need not be gathered: what it reflects is then known from coarser rows, which clusters
//! average anyway, and so is what only mirrors show.

use crate::points::candidates::Candidate;
use crate::points::viewpoints::ASPECT;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::basis::Level;
use relight_transport::sparse::{SparseMatrix, row};
use std::collections::BTreeSet;

/// Primary rays across and down a camera's image: points are wider than a pixel, and one that slips through only leaves
/// its place to coarser points.
const RAYS: [u32; 2] = [480, 270];
/// Frames of a moving camera that are looked at.
const FRAMES: u32 = 32;

/// Where cameras stand, over all frames.
pub fn poses(tracks: &[&CameraTrack], frames: u32) -> Vec<Camera> {
    let mut poses = Vec::new();
    for track in tracks {
        let count = if track.is_fixed() {
            1
        } else {
            frames.clamp(1, FRAMES)
        };
        let last = f64::from(frames.max(1) - 1);
        poses.extend((0..count).map(|i| track.at(last * f64::from(i) / f64::from(count.max(2) - 1))));
    }
    poses
}

/// For every point of all levels whether cameras see it or a finer one whose parent it is; points of levels before `first`
/// count as seen. Also returns the number of rays cast.
pub fn seen_by(
    surfaces: &dyn Surfaces,
    cameras: &[Camera],
    levels: &[Level],
    fine_from_coarse: &SparseMatrix,
    first: usize,
) -> (Vec<bool>, u64) {
    let [width, height] = RAYS;
    let mut starts = vec![0usize];
    for level in levels {
        starts.push(starts[starts.len() - 1] + level.len());
    }
    let all: usize = levels.iter().map(Level::len).sum();
    let mut seen = vec![false; all];
    seen[..starts[first.min(levels.len())]].fill(true);
    for camera in cameras {
        let met: BTreeSet<usize> = (0..height)
            .into_par_iter()
            .map(|y| {
                let mut met = BTreeSet::new();
                for x in 0..width {
                    let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    // Pixels of the shape that makes the image so wide.
                    let size = Vec2::new(width as f32, height as f32);
                    let squeezed = Vec2::new(
                        (pixel.x - size.x * 0.5) * (ASPECT * size.y / size.x) + size.x * 0.5,
                        pixel.y,
                    );
                    let Some(hit) = surfaces.closest_hit(&Ray {
                        origin: camera.position,
                        direction: camera.direction(squeezed, size),
                        t_min: 0.0,
                        t_max: f32::INFINITY,
                    }) else {
                        continue;
                    };
                    mark(levels, first, &starts, hit.position, hit.normal, &mut met);
                }
                met
            })
            .reduce(BTreeSet::new, |mut a, mut b| {
                a.append(&mut b);
                a
            });
        met.into_iter().for_each(|i| seen[i] = true);
    }
    // Fine points come after their parents.
    for i in (0..all).rev().filter(|&i| i >= starts[first.min(levels.len())]) {
        if seen[i] {
            for (parent, _) in row(fine_from_coarse, i) {
                seen[parent as usize] = true;
            }
        }
    }
    (seen, u64::from(width * height) * cameras.len() as u64)
}

fn mark(
    levels: &[Level],
    first: usize,
    starts: &[usize],
    position: Vec3,
    normal: Vec3,
    met: &mut BTreeSet<usize>,
) {
    for (l, level) in levels.iter().enumerate().skip(first) {
        level.weights_at(position, normal, |i, _| {
            met.insert(starts[l] + i as usize);
        });
    }
}

/// Which of `count` ways from each place are above its surface and meet nothing, a bit each. `way`: direction, of any length, and how
/// many times that length it goes.
pub fn open_ways(
    surfaces: &dyn Surfaces,
    places: &[Candidate],
    count: usize,
    way: impl Fn(&Candidate, usize) -> (Vec3, f32) + Sync,
) -> Vec<u128> {
    places
        .par_iter()
        .with_min_len(64)
        .map_init(
            || (Vec::new(), vec![false; count]),
            |(rays, occluded): &mut (Vec<Ray>, Vec<bool>), place| {
                rays.clear();
                rays.extend((0..count).map(|k| {
                    let (direction, t_max) = way(place, k);
                    Ray {
                        origin: place.origin,
                        direction,
                        t_min: 0.0,
                        t_max,
                    }
                }));
                surfaces.occluded_packet(rays, occluded);
                let mut bits = 0u128;
                for (bit, (ray, dark)) in rays.iter().zip(occluded.iter()).enumerate() {
                    if !dark && ray.direction.dot(place.geometric_normal) > 0.0 {
                        bits |= 1 << bit;
                    }
                }
                bits
            },
        )
        .collect()
}
