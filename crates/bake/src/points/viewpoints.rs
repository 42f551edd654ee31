//! Where importance particles start: the cameras, or a place in open space.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::CameraTrack;
use relight_scene::rays::Ray;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, SequenceCamera};
use relight_scene::surface::Surfaces;
use relight_transport::random::Stream;
use relight_transport::sampling::r2;

/// Places along a moving camera's way that count as viewpoints: enough that every room on its way has one.
const PER_MOVING_CAMERA: u32 = 16;

/// The cameras that can be played: those of the scene and the sequences' own.
pub fn tracks<'a>(scene: &'a Scene, lights: Option<&'a Sequence>) -> Vec<&'a CameraTrack> {
    let own = [Some(&scene.sequence), lights]
        .into_iter()
        .flatten()
        .filter_map(|s| match &s.camera {
            Some(SequenceCamera::Own(track)) => Some(track),
            _ => None,
        });
    scene.cameras.iter().chain(own).collect()
}

/// Frames that can be played.
pub fn frames(scene: &Scene, lights: Option<&Sequence>) -> u32 {
    lights.map_or(1, |s| s.frames).max(scene.sequence.frames)
}

/// Eyes of all cameras.
pub fn of_cameras(scene: &Scene, lights: Option<&Sequence>) -> Vec<Vec3> {
    let frames = frames(scene, lights);
    let tracks = tracks(scene, lights);
    let mut eyes: Vec<Vec3> = tracks
        .into_iter()
        .flat_map(|track| eyes_of(track, frames))
        .collect();
    eyes.retain(|eye: &Vec3| eye.is_finite());
    eyes
}

fn eyes_of(track: &CameraTrack, frames: u32) -> Vec<Vec3> {
    if track.position.is_constant() {
        return vec![track.position.at(0.0)];
    }
    let count = frames.clamp(1, PER_MOVING_CAMERA);
    let last = f64::from(frames.saturating_sub(1));
    (0..count)
        .map(|i| {
            track
                .position
                .at(last * f64::from(i) / f64::from(count.max(2) - 1))
        })
        .collect()
}

/// Places that are tried.
const PLACES: u32 = 512;
/// Rays per place.
const RAYS: u32 = 64;
/// How far beyond the scene's bounds places are tried, in parts of its size: a single object is best seen
/// from outside.
const MARGIN: f32 = 0.25;
/// What a surface seen from behind counts: much less than a front, which the author meant to be seen, but
/// more than nothing, since a scene may be modelled without regard to its fronts.
const BACK: f32 = 0.25;
/// Stage number of the random stream.
const STAGE: u32 = 9;

/// A place in open space that sees much of the scene: the one with the largest mean distance to what it sees,
/// sky counting as nothing and backs of surfaces little. `None` where no ray meets anything. Also returns the
/// number of rays cast.
pub fn in_open_space(surfaces: &dyn Surfaces, seed: u64) -> (Option<Vec3>, u64) {
    let Some((min, max)) = surfaces.bounds() else {
        return (None, 0);
    };
    let margin = (max - min) * MARGIN;
    let (min, size) = (min - margin, (max - min) + margin * 2.0);
    let scores: Vec<(f32, Vec3)> = (0..PLACES)
        .into_par_iter()
        .map(|i| {
            let mut stream = Stream::new(seed, STAGE, u64::from(i));
            let at = Vec3::new(stream.uniform(), stream.uniform(), stream.uniform());
            let place = min + size * at;
            (
                score(surfaces, place, Vec2::new(stream.uniform(), stream.uniform())),
                place,
            )
        })
        .collect();
    let best = scores.iter().fold((0.0, None), |best, &(score, place)| {
        if score > best.0 {
            (score, Some(place))
        } else {
            best
        }
    });
    (best.1, u64::from(PLACES * RAYS))
}

fn score(surfaces: &dyn Surfaces, origin: Vec3, start: Vec2) -> f32 {
    (0..RAYS)
        .map(|i| {
            let u = r2(i, start);
            // Evenly over the sphere (Archimedes).
            let z = 1.0 - 2.0 * u.x;
            let (sin, cos) = (u.y * std::f32::consts::TAU).sin_cos();
            let s = (1.0 - z * z).max(0.0).sqrt();
            let direction = Vec3::new(s * cos, s * sin, z);
            let ray = Ray {
                origin,
                direction,
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            surfaces
                .closest_hit(&ray)
                .map_or(0.0, |hit| hit.t * if hit.front { 1.0 } else { BACK })
        })
        .sum()
}
