//! Where importance particles start: the cameras, or a place in open space.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::CameraTrack;
use relight_scene::rays::Ray;
use relight_scene::scene::Scene;
use relight_scene::sequence::{Sequence, SequenceCamera};
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_transport::random::Stream;
use relight_transport::sampling::r2;

/// Width over height of what cameras look at: wider than most screens, since `--size` decides it at play time.
pub const ASPECT: f32 = 2.4;

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

/// Bounds are narrowed to where most of the scene is if they are so many times as wide: a ground, a dome or a stray triangle makes them so.
const VAST: f32 = 4.0;
/// Part of all triangles, or of all things, that may lie beyond those narrower bounds on either side.
const BEYOND: f32 = 0.1;
/// Triangles that are asked where they are.
const ASKED: usize = 1 << 16;

/// Places of what is seen from all places that are tried, to find out what the chosen ones don't see.
const SAMPLES: usize = 1024;
/// Most viewpoints: those of a cube's sides and two more.
const MOST: usize = 8;
/// Part of all that is seen from anywhere that another viewpoint must add.
const WORTH: f32 = 0.04;

/// What is looked at where nobody says what: the surfaces' bounds or, in a vast scene, those of [`most()`].
pub fn focus(scene: &Scene, bounds: (Vec3, Vec3)) -> (Vec3, Vec3) {
    most(scene, bounds).unwrap_or(bounds)
}

/// In a vast scene the bounds of most triangles or of most things, whichever are narrower: a sky dome may have more triangles than the room
/// in it, but it is one thing. `None` where they are about as wide as the whole scene's.
pub fn most(scene: &Scene, bounds: (Vec3, Vec3)) -> Option<(Vec3, Vec3)> {
    let wide = |(low, high): (Vec3, Vec3)| (high - low).length();
    [of_triangles(scene), of_things(scene)]
        .into_iter()
        .flatten()
        .filter(|&most| wide(most) > 0.0 && wide(bounds) > VAST * wide(most))
        .min_by(|&a, &b| wide(a).total_cmp(&wide(b)))
}

/// Bounds of the middles of most triangles.
fn of_triangles(scene: &Scene) -> Option<(Vec3, Vec3)> {
    let count: usize = (scene.instances.iter())
        .map(|i| scene.meshes[i.mesh as usize].triangles.len())
        .sum();
    let middles = scene.instances.iter().flat_map(|instance| {
        let mesh = &scene.meshes[instance.mesh as usize];
        mesh.triangles.iter().map(|t| {
            let middle = t.iter().map(|&v| mesh.positions[v as usize]).sum::<Vec3>() / 3.0;
            instance.world_from_mesh.transform_point3(middle)
        })
    });
    let middles: Vec<Vec3> = middles.step_by(count.div_ceil(ASKED).max(1)).collect();
    most_of(&middles, &middles)
}

/// Bounds of most instances.
fn of_things(scene: &Scene) -> Option<(Vec3, Vec3)> {
    let (mut lows, mut highs) = (Vec::new(), Vec::new());
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        let vertices = mesh
            .triangles
            .iter()
            .flatten()
            .map(|&v| mesh.positions[v as usize]);
        let corners = vertices.map(|v| instance.world_from_mesh.transform_point3(v));
        let bounds = corners
            .map(|v| (v, v))
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        lows.extend(bounds.map(|b| b.0));
        highs.extend(bounds.map(|b| b.1));
    }
    most_of(&lows, &highs)
}

/// Bounds beyond which no more than [`BEYOND`] of the lower ends are on one side, and of the upper ends on the other.
fn most_of(lows: &[Vec3], highs: &[Vec3]) -> Option<(Vec3, Vec3)> {
    let last = lows.len().checked_sub(1)? as f32;
    let within = |of: &[Vec3], share: f32| {
        let along = |axis: usize| {
            let mut places: Vec<f32> = of.iter().map(|m| m[axis]).collect();
            places.sort_unstable_by(f32::total_cmp);
            places[(share * last).round() as usize]
        };
        Vec3::new(along(0), along(1), along(2))
    };
    Some((within(lows, BEYOND), within(highs, 1.0 - BEYOND)))
}

/// Bounds with [`MARGIN`] around them.
pub fn with_margin((min, max): (Vec3, Vec3)) -> (Vec3, Vec3) {
    let margin = (max - min) * MARGIN;
    (min - margin, max + margin)
}

/// Where somebody may look from, of whom nothing is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpenSpace {
    /// A few that see most of the scene.
    pub viewpoints: Vec<Vec3>,
    /// Those and all other places tried that one of them sees. A single viewpoint near a surface makes it matter more than all else; over
    /// many such nearness cancels out.
    pub places: Vec<Vec3>,
    /// Bounds of what is looked at; `None`: all that is seen.
    pub within: Option<(Vec3, Vec3)>,
    /// Rays cast to find them.
    pub rays: u64,
}

/// Places in open space from which much of what lies in `focus` is seen: first the one with the largest mean distance to what it sees,
/// sky counting as nothing and backs of surfaces little; then, while they add to it, those that see most of what those
/// before don't see. None where no ray meets anything.
pub fn in_open_space(surfaces: &dyn Surfaces, focus: (Vec3, Vec3), seed: u64) -> OpenSpace {
    let (min, max) = with_margin(focus);
    let size = max - min;
    let views: Vec<(Vec3, Vec<SurfaceHit>)> = (0..PLACES)
        .into_par_iter()
        .map(|i| {
            let mut stream = Stream::new(seed, STAGE, u64::from(i));
            let at = Vec3::new(stream.uniform(), stream.uniform(), stream.uniform());
            let place = min + size * at;
            (
                place,
                seen_from(surfaces, place, Vec2::new(stream.uniform(), stream.uniform())),
            )
        })
        .collect();
    let mut rays = u64::from(PLACES * RAYS);
    // Of a vast scene only what lies near: a dome is seen from everywhere, and has more surface than all else.
    let is_within = |hit: &SurfaceHit| hit.position.cmpge(min).all() && hit.position.cmple(max).all();
    let any_within = views.iter().flat_map(|view| &view.1).any(is_within);
    let is_near = |hit: &SurfaceHit| !any_within || is_within(hit);
    let score = |hits: &[SurfaceHit]| -> f32 {
        let near = hits.iter().filter(|hit| is_near(hit));
        near.map(|hit| hit.t * counts(hit)).sum()
    };
    let first = (views.iter().enumerate()).fold((0.0, None), |best, (i, view)| {
        let score = score(&view.1);
        if score > best.0 { (score, Some(i)) } else { best }
    });
    let Some(first) = first.1 else {
        return OpenSpace {
            rays,
            ..OpenSpace::default()
        };
    };
    let all: Vec<&SurfaceHit> = views
        .iter()
        .flat_map(|view| &view.1)
        .filter(|hit| is_near(hit))
        .collect();
    let samples: Vec<&SurfaceHit> = all
        .iter()
        .copied()
        .step_by(all.len().div_ceil(SAMPLES).max(1))
        .collect();
    let eyes: Vec<Vec3> = views.iter().map(|view| view.0).collect();
    let seen: Vec<Vec<bool>> = (eyes.par_iter())
        .map(|&eye| samples.iter().map(|sample| sees(surfaces, eye, sample)).collect())
        .collect();
    rays += (eyes.len() * samples.len()) as u64;
    let viewpoints: Vec<Vec3> = (chosen(first, &seen, &samples).into_iter())
        .map(|i| eyes[i])
        .collect();
    let others = (eyes.par_iter()).filter(|eye| {
        !viewpoints.contains(eye)
            && viewpoints
                .iter()
                .any(|viewpoint| meet(surfaces, **eye, *viewpoint))
    });
    let others: Vec<Vec3> = others.copied().collect();
    OpenSpace {
        rays: rays + (eyes.len() * viewpoints.len()) as u64,
        places: [&viewpoints[..], &others].concat(),
        within: any_within.then_some((min, max)),
        viewpoints,
    }
}

/// Whether nothing lies between two places.
fn meet(surfaces: &dyn Surfaces, a: Vec3, b: Vec3) -> bool {
    !surfaces.occluded(&Ray {
        origin: a,
        direction: b - a,
        t_min: 0.0,
        t_max: 1.0,
    })
}

/// `first` and, while one adds enough, the view that adds most to those before.
fn chosen(first: usize, seen: &[Vec<bool>], samples: &[&SurfaceHit]) -> Vec<usize> {
    // Directions are even, so that a hit stands for an area that grows with t².
    let worth: Vec<f32> = (samples.iter()).map(|hit| counts(hit) * hit.t * hit.t).collect();
    let visible = (0..samples.len()).filter(|&s| seen.iter().any(|seen| seen[s]));
    let enough = WORTH * visible.map(|s| worth[s]).sum::<f32>();
    let (mut views, mut left) = (vec![first], worth);
    loop {
        for (left, _) in left
            .iter_mut()
            .zip(&seen[views[views.len() - 1]])
            .filter(|s| *s.1)
        {
            *left = 0.0;
        }
        let adds = |seen: &Vec<bool>| -> f32 { left.iter().zip(seen).filter(|s| *s.1).map(|s| s.0).sum() };
        let best =
            (seen.iter().map(adds).enumerate()).fold(
                (0, 0.0),
                |best, (i, adds)| if adds > best.1 { (i, adds) } else { best },
            );
        if views.len() == MOST || best.1 <= enough {
            return views;
        }
        views.push(best.0);
    }
}

fn counts(hit: &SurfaceHit) -> f32 {
    if hit.front { 1.0 } else { BACK }
}

/// Whether the side of a surface that was hit is seen from a place.
fn sees(surfaces: &dyn Surfaces, eye: Vec3, hit: &SurfaceHit) -> bool {
    let ray = ray_from(hit, (eye - hit.position).normalize_or(hit.geometric_normal));
    let way = eye - ray.origin;
    way.dot(hit.geometric_normal) > 0.0
        && !surfaces.occluded(&Ray {
            direction: way,
            t_min: 0.0,
            t_max: 1.0,
            ..ray
        })
}

fn seen_from(surfaces: &dyn Surfaces, origin: Vec3, start: Vec2) -> Vec<SurfaceHit> {
    (0..RAYS)
        .filter_map(|i| {
            let u = r2(i, start);
            // Evenly over the sphere (Archimedes).
            let z = 1.0 - 2.0 * u.x;
            let (sin, cos) = (u.y * std::f32::consts::TAU).sin_cos();
            let s = (1.0 - z * z).max(0.0).sqrt();
            surfaces.closest_hit(&Ray::endless(origin, Vec3::new(s * cos, s * sin, z)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, DVec3};
    use relight_scene::gltf::{ImportOptions, import};
    use relight_scene::implicit::{ImplicitSurface, Sdf};
    use relight_scene::material::Material;
    use relight_scene::scene::{Instance, Mesh};
    use relight_scene::traced::{Shading, TracedScene};
    use std::f32::consts::{PI, TAU};
    use std::path::Path;
    use std::sync::Arc;

    /// A thin plate: no single place sees both of its sides.
    #[test]
    fn both_sides_of_a_plate_are_seen_and_no_viewpoint_is_inside() {
        let sdf = Sdf::Ellipsoid {
            center: DVec3::ZERO,
            radii: DVec3::new(1.0, 1.0, 0.02),
        };
        let bounds = (Vec3::new(-1.0, -1.0, -0.5), Vec3::new(1.0, 1.0, 0.5));
        let plate = ImplicitSurface::new(sdf, bounds, Vec3::ONE);
        for seed in 0..4 {
            let OpenSpace {
                viewpoints: places,
                rays,
                ..
            } = in_open_space(&plate, bounds, seed);
            assert!((2..=MOST).contains(&places.len()) && rays > 0, "{places:?}");
            assert!(places.iter().any(|p| p.z > 0.02) && places.iter().any(|p| p.z < -0.02));
        }
    }

    #[test]
    fn a_closed_room_is_seen_from_inside_alone() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/furnace_box.glb");
        let scene = Arc::new(import(&file, &ImportOptions::default()).unwrap());
        let room = TracedScene::new(scene, Shading::Lambert).unwrap();
        let (low, high) = room.bounds().unwrap();
        for seed in 0..4 {
            let OpenSpace {
                viewpoints, places, ..
            } = in_open_space(&room, (low, high), seed);
            assert_eq!(viewpoints.len(), 1, "{viewpoints:?}");
            // A box is a third of its bounds with their margin.
            assert!((100..=300).contains(&places.len()), "{}", places.len());
            let is_inside = |p: &Vec3| p.cmpgt(low).all() && p.cmplt(high).all();
            assert!(places.iter().all(is_inside), "{places:?}");
        }
    }

    #[test]
    fn a_vast_ground_does_not_draw_attention_from_a_house() {
        let triangle = |at: Vec3, wide: f32| [at, at + Vec3::X * wide, at + Vec3::Z * wide];
        let house = (0..40).map(|i| {
            triangle(
                Vec3::new(i as f32 * 0.1, (i % 7) as f32 * 0.5, (i % 5) as f32),
                0.5,
            )
        });
        let ground = [
            triangle(Vec3::new(-1e4, 0.0, -1e4), 4e4),
            triangle(Vec3::new(1e4, 0.0, 1e4), -4e4),
        ];
        let positions: Vec<Vec3> = house.chain(ground).flatten().collect();
        let scene = Scene {
            meshes: vec![Mesh {
                triangles: (0..positions.len() as u32 / 3)
                    .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
                    .collect(),
                positions,
                ..Mesh::default()
            }],
            instances: vec![Instance {
                mesh: 0,
                world_from_mesh: Affine3A::IDENTITY,
            }],
            ..Scene::default()
        };
        let bounds = (Vec3::splat(-3e4), Vec3::splat(3e4));
        let (low, high) = focus(&scene, bounds);
        assert!(
            low.min_element() > -1.0 && high.max_element() < 6.0,
            "{low} {high}"
        );
        let near = (Vec3::splat(-1.0), Vec3::splat(6.0));
        assert_eq!(focus(&scene, near), near, "all of it is where the triangles are");
    }

    /// Six walls and a few things, in a sky dome that has most of the triangles and nearly all of the surface.
    #[test]
    fn a_finely_made_dome_does_not_draw_attention_from_the_room_in_it() {
        let corner = |k: u32| Vec3::from([0, 1, 2].map(|bit| if k >> bit & 1 == 1 { 2.0 } else { -2.0 }));
        let mesh = |positions: Vec<Vec3>, triangles: Vec<[u32; 3]>| Mesh {
            positions,
            triangles,
            ..Mesh::default()
        };
        let cube: Vec<Vec3> = (0..8).map(corner).collect();
        let wall = |[a, b, c, d]: [u32; 4]| mesh(cube.clone(), vec![[a, b, c], [a, c, d]]);
        let mut meshes: Vec<Mesh> = [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 5, 7, 3],
        ]
        .map(wall)
        .to_vec();
        meshes.extend((0..6).map(|i| {
            let small = cube.iter().map(|v| 0.05 * *v + Vec3::splat(0.2 * i as f32 - 0.5));
            mesh(small.collect(), vec![[0, 1, 3], [4, 6, 7]])
        }));
        let (across, up) = (48, 24);
        let on_dome = |i: u32| {
            let (a, b) = (i % (across + 1), i / (across + 1));
            let (phi, theta) = (TAU * a as f32 / across as f32, PI * b as f32 / up as f32);
            1000.0 * Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
        };
        let quad = |i: u32| {
            let (first, below) = (i / across * (across + 1) + i % across, across + 1);
            [
                [first, first + 1, first + below],
                [first + 1, first + below + 1, first + below],
            ]
        };
        meshes.push(mesh(
            (0..(across + 1) * (up + 1)).map(on_dome).collect(),
            (0..across * up).flat_map(quad).collect(),
        ));
        let instances = (0..meshes.len() as u32)
            .map(|mesh| Instance {
                mesh,
                world_from_mesh: Affine3A::IDENTITY,
            })
            .collect();
        let materials = vec![Material::default()];
        let scene = Scene {
            meshes,
            instances,
            materials,
            ..Scene::default()
        };
        let scene = TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap();
        let bounds = scene.bounds().unwrap();
        for seed in 0..4 {
            let places = in_open_space(&scene, focus(scene.scene(), bounds), seed).viewpoints;
            let inside = |p: &Vec3| p.abs().max_element() < 2.0;
            assert!(places.iter().any(inside), "{places:?}");
        }
    }
}
