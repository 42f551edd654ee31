//! Where lamps shine that are known when a scene is baked: those of the scene and of the sequence that will be played.
//!
//! A lamp makes light change over distances that are a part of its own, whatever else a surface sees: a lantern two metres above an open ground
//! lights a spot of some metres.

use glam::{IVec3, Vec3};
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use std::collections::HashSet;

/// Most places: each place of a surface asks all of them. Of more, those that lie together count as one.
const MOST: usize = 256;

/// Places of a moving lamp.
const PER_MOVING_LAMP: u32 = 64;

/// Where lamps are that have a place; no more than [`MOST`], and none that is not finite.
pub fn places(scene: &Scene, lights: Option<&Sequence>) -> Vec<Vec3> {
    let mut places: Vec<Vec3> = [Some(&scene.sequence), lights]
        .into_iter()
        .flatten()
        .flat_map(|sequence| {
            let frames = sequence.frames;
            sequence.lights.iter().flat_map(move |light| of_light(scene, light, frames))
        })
        .collect();
    places.retain(|place| place.is_finite());
    thinned(places)
}

fn of_light(scene: &Scene, light: &LightTrack, frames: u32) -> Vec<Vec3> {
    let position = match &light.kind {
        LightKind::Point { position, .. } | LightKind::Spot { position, .. } | LightKind::Ies { position, .. } => position,
        LightKind::Rect { center, .. } | LightKind::Sphere { center, .. } => center,
        LightKind::Emissive { .. } => return emissive(scene),
        LightKind::Directional { .. } | LightKind::Environment { .. } | LightKind::SunSky { .. } | LightKind::Weather { .. } => {
            return Vec::new();
        }
    };
    if position.is_constant() {
        return vec![position.at(0.0)];
    }
    let count = frames.clamp(1, PER_MOVING_LAMP);
    let last = f64::from(frames.max(1) - 1);
    let frame = |i: u32| last * f64::from(i) / f64::from(count.max(2) - 1);
    (0..count).map(|i| position.at(frame(i))).collect()
}

/// Middles of triangles that can emit.
fn emissive(scene: &Scene) -> Vec<Vec3> {
    let shines = |material: u32| {
        let material = scene.materials.get(material as usize);
        material.is_some_and(|material| material.emission.max_element() > 0.0)
    };
    let mut middles = Vec::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh as usize];
        if shines(mesh.material) {
            middles.extend(mesh.triangles.iter().map(|t| {
                let middle = t.iter().map(|&v| mesh.positions[v as usize]).sum::<Vec3>() / 3.0;
                instance.world_from_mesh.transform_point3(middle)
            }));
        }
    }
    middles
}

/// Of places in one cell the first, of cells so wide that few are left.
fn thinned(mut places: Vec<Vec3>) -> Vec<Vec3> {
    let (low, high) = (places.iter()).fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &place| {
        (low.min(place), high.max(place))
    });
    let mut edge = (high - low).max_element() / 1024.0;
    while places.len() > MOST && edge > 0.0 && edge.is_finite() {
        let mut taken: HashSet<IVec3> = HashSet::new();
        places.retain(|&place| taken.insert(((place - low) / edge).floor().as_ivec3()));
        edge *= 2.0;
    }
    places.truncate(MOST);
    places
}
