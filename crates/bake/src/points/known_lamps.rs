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
            sequence
                .lights
                .iter()
                .flat_map(move |light| of_light(scene, light, frames))
        })
        .collect();
    places.retain(|place| place.is_finite());
    thinned(places)
}

fn of_light(scene: &Scene, light: &LightTrack, frames: u32) -> Vec<Vec3> {
    let position = match &light.kind {
        LightKind::Point { position, .. }
        | LightKind::Spot { position, .. }
        | LightKind::Ies { position, .. } => position,
        LightKind::Rect { center, .. } | LightKind::Sphere { center, .. } => center,
        LightKind::Emissive { material, .. } => return emissive(scene, material.as_deref()),
        LightKind::Directional { .. }
        | LightKind::Environment { .. }
        | LightKind::SunSky { .. }
        | LightKind::Weather { .. } => {
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

/// Middles of triangles that can emit, of all materials or those of a name.
fn emissive(scene: &Scene, name: Option<&str>) -> Vec<Vec3> {
    let shines = |material: u32| {
        let material = scene.materials.get(material as usize);
        material.is_some_and(|material| {
            material.emission.max_element() > 0.0 && name.is_none_or(|name| material.name == name)
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;
    use relight_scene::animated::{Animated, Interpolation};
    use relight_scene::material::Material;
    use relight_scene::scene::{Instance, Mesh};

    fn point(position: Animated<Vec3>) -> LightTrack {
        LightTrack {
            name: "lamp".into(),
            kind: LightKind::Point {
                position,
                intensity: Animated::Constant(Vec3::ONE),
            },
        }
    }

    fn playing(lights: Vec<LightTrack>) -> Sequence {
        Sequence {
            frames: 3,
            lights,
            ..Sequence::default()
        }
    }

    #[test]
    fn a_lamp_is_where_its_way_leads_and_a_sky_nowhere() {
        let way = Animated::Keys {
            keys: vec![(0.0, Vec3::ZERO), (2.0, Vec3::X)],
            interpolation: Interpolation::Linear,
        };
        let sun = LightTrack {
            name: "sun".into(),
            kind: LightKind::Directional {
                direction: Animated::Constant(Vec3::NEG_Y),
                irradiance: Animated::Constant(Vec3::ONE),
            },
        };
        let lost = point(Animated::Constant(Vec3::splat(f32::NAN)));
        let played = playing(vec![point(way), sun, lost]);
        let found = places(&Scene::default(), Some(&played));
        assert_eq!(found, [Vec3::ZERO, Vec3::X * 0.5, Vec3::X]);
    }

    /// Truth: 1,000 bulbs in a row, of which one material glows.
    #[test]
    fn of_many_bulbs_some_stand_for_all() {
        let bulb = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X * 0.03, Vec3::Y * 0.03],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        let dark = Mesh {
            material: 1,
            ..bulb.clone()
        };
        let along = |mesh: u32| {
            (0..1000).map(move |i| Instance {
                mesh,
                world_from_mesh: Affine3A::from_translation(Vec3::new(i as f32, 0.0, mesh as f32)),
            })
        };
        let glowing = Material {
            emission: Vec3::ONE,
            ..Material::default()
        };
        let scene = Scene {
            meshes: vec![bulb, dark],
            instances: along(0).chain(along(1)).collect(),
            materials: vec![glowing, Material::default()],
            sequence: playing(vec![LightTrack {
                name: "bulbs".into(),
                kind: LightKind::Emissive {
                    material: None,
                    scale: Animated::Constant(Vec3::ONE),
                },
            }]),
            ..Scene::default()
        };
        let found = places(&scene, None);
        assert!((100..=MOST).contains(&found.len()), "{}", found.len());
        assert!(found.iter().all(|place| place.z < 0.5), "dark ones are no lamps");
        for i in 0..1000 {
            let nearest = found.iter().map(|place| (place.x - i as f32).abs());
            assert!(nearest.fold(f32::INFINITY, f32::min) < 16.0);
        }
    }
}
