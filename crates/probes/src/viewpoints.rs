//! Where probes look: windows of images from other viewpoints than the cameras'.

use crate::error::ProbeError;
use glam::{Vec2, Vec3};
use relight_bake::Request;
use relight_bake::points::viewpoints::{focus, in_open_space};
use relight_format as format;
use relight_play::camera::camera_of;
use relight_render::layers::RenderSize;
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;
use relight_transport::random::Stream;

/// How many windows, and how large.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// Windows that see something in their middle.
    pub windows: u64,
    /// Pixels across and down in each.
    pub size: RenderSize,
}

/// Those by which settings are chosen: many, so that they hold what images hold.
pub const SEARCH: Detail = Detail {
    windows: 72,
    size: RenderSize {
        width: 16,
        height: 12,
    },
};
/// Those of a bake's own check, which are to take little time: small windows, since neighbours know much of each other.
pub const CHECK: Detail = Detail {
    windows: 432,
    size: RenderSize { width: 2, height: 2 },
};
/// Most windows in all, where few see something, over those that are wanted.
const MOST_WINDOWS: u64 = 8;
/// Rows of the image that a window is a part of: what a pixel spans.
const ROWS: f32 = 180.0;
/// Width over height where the camera says none.
const ASPECT: f32 = 16.0 / 9.0;
/// How far from the camera other viewpoints lie, as a share of the distance to what it sees.
const APART: f32 = 0.15;
/// Most of the free way there that is taken, so that none lies in a wall.
const FREE: f32 = 0.5;
/// Tangent of half the vertical field of view where there is no camera: that of 60°.
const TAN_HALF_VFOV: f32 = 0.577;
/// Frames that are looked at: first, middle and last.
const FRAMES: u32 = 3;
/// Stage number of the random stream.
const STAGE: u32 = 12;

/// Lamps that would light what is seen, by their rank among all of the windows' ways: farther than from most things, as lamps are, and
/// nearer than from a few that may be outside.
const LAMPS: [f32; 3] = [0.625, 0.75, 0.875];
/// Where they are on the way to what is seen: halfway is open space.
const HALFWAY: f32 = 0.5;

/// Where probes look from.
pub struct Viewpoints {
    /// The scene, whole.
    pub scene: TracedScene,
    /// Frame and camera of each window.
    pub windows: Vec<(u32, Camera)>,
    /// Pixels across and down in each.
    pub size: RenderSize,
    /// Share of the windows that see something in their middle.
    pub seen: f32,
    /// Lamps in open space that would light what is seen: places, world space, and distances, metres, of what they light.
    pub lamps: Vec<(Vec3, f32)>,
}

impl Viewpoints {
    /// Other viewpoints near those of the camera that `play` takes by itself, or, without one, near the viewpoints of the bake,
    /// or in open space; `None` where they see nothing.
    ///
    /// # Errors
    /// [`ProbeError::Scene`].
    pub fn new(request: &Request, detail: Detail) -> Result<Option<Viewpoints>, ProbeError> {
        let (scene, lights, params) = (&request.scene, request.lights, request.params);
        // Not the seed of what is judged.
        let seed = format::content_hash(format!("probes {}", params.seed).as_bytes());
        let traced = TracedScene::new(scene.clone(), request.shading)?;
        let frames = lights.map_or(scene.sequence.frames, |s| s.frames).max(1);
        // That which `play` takes by itself: errors of several cameras together would be those of the darkest room that any sees.
        let track = camera_of(scene, lights.unwrap_or(&scene.sequence), None).ok();
        let mut places = params.viewpoints.clone();
        if track.is_none()
            && places.is_empty()
            && let Some(bounds) = traced.bounds()
        {
            places = in_open_space(&traced, focus(scene, bounds), seed).places;
        }
        if track.is_none() && places.is_empty() {
            return Ok(None);
        }
        let mut windows = Vec::new();
        let mut lamps = Vec::new();
        let mut seen = 0;
        for i in 0..MOST_WINDOWS * detail.windows {
            if seen == detail.windows {
                break;
            }
            let mut s = Stream::new(seed, STAGE, i);
            let frame = (frames - 1) * (i as u32 % FRAMES) / (FRAMES - 1);
            let base = match track {
                Some(track) => (track.at(frame.into()), track.aspect.unwrap_or(ASPECT)),
                None => {
                    let place = places[i as usize % places.len()];
                    (looking(place, uniform_sphere(two(&mut s))), ASPECT)
                }
            };
            let camera = window(&traced, base, detail.size.height, &mut s);
            if let Some(away) = distance(&traced, camera.position, camera.forward) {
                seen += 1;
                let way = away * HALFWAY;
                lamps.push((camera.position + camera.forward * way, way));
            }
            windows.push((frame, camera));
        }
        let share = seen as f32 / windows.len().max(1) as f32;
        lamps.sort_by(|a: &(Vec3, f32), b| a.1.total_cmp(&b.1));
        let ranked = LAMPS.map(|rank| (rank * lamps.len() as f32) as usize);
        let lamps = ranked.iter().filter_map(|&i| lamps.get(i).copied()).collect();
        Ok((seen > 0).then_some(Viewpoints {
            scene: traced,
            size: detail.size,
            seen: share,
            windows,
            lamps,
        }))
    }

    /// Pixels of each window.
    pub fn pixels(&self) -> usize {
        self.size.width * self.size.height
    }

    /// Frames at which any window looks.
    pub fn frames(&self) -> Vec<u32> {
        let mut frames: Vec<u32> = self.windows.iter().map(|w| w.0).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

/// A direction, all alike (Archimedes).
fn uniform_sphere(u: Vec2) -> Vec3 {
    let z = 1.0 - 2.0 * u.x;
    let (sin, cos) = (u.y * std::f32::consts::TAU).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * cos, z, r * sin)
}

fn two(s: &mut Stream) -> Vec2 {
    Vec2::new(s.uniform(), s.uniform())
}

fn looking(position: Vec3, forward: Vec3) -> Camera {
    Camera::looking(position, forward, Vec3::Y, TAN_HALF_VFOV)
}

fn distance(scene: &TracedScene, origin: Vec3, direction: Vec3) -> Option<f32> {
    (scene.closest_hit(&Ray::endless(origin, direction))).map(|hit| hit.t)
}

/// A window somewhere in the image that a camera would make from a place nearby.
fn window(scene: &TracedScene, (camera, aspect): (Camera, f32), height: usize, s: &mut Stream) -> Camera {
    let aspect = if aspect.is_finite() && aspect > 0.0 {
        aspect
    } else {
        ASPECT
    };
    let size = Vec2::new(aspect, 1.0);
    let toward = camera.direction(two(s) * size, size);
    let aside = uniform_sphere(two(s));
    let away = distance(scene, camera.position, toward).unwrap_or(0.0) * APART * s.uniform();
    let free = distance(scene, camera.position, aside).map_or(away, |t| away.min(t * FREE));
    let turned = looking(camera.position + aside * free, toward);
    Camera {
        tan_half_vfov: camera.tan_half_vfov * height as f32 / ROWS,
        ..turned
    }
}
