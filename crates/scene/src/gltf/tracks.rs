//! Lights and cameras over time: node transforms, light properties and their animations, resampled once per
//! frame into world-space keys.
//!
//! Linear keys at every frame hold any chain of rotating parents and any of glTF's interpolations exactly at
//! the frames, which is where they are looked up.

use super::animation::{Curve, Target, forward_and_up, moves, targets_of_tracks, world_from_node};
use super::area_lights::AreaLight;
use super::ies::{Lamp, Profile, Profiles};
use super::json::Faults;
use super::nodes::{Graph, Perspective, Punctual, PunctualKind};
use super::notes::Notes;
use super::units::{EMISSIVE, FPS, LightUnits};
use crate::animated::{Animated, Interpolation};
use crate::camera::CameraTrack;
use crate::json::quantity::MAX_LIGHT;
use crate::light::{LightKind, LightTrack};
use glam::{DAffine3, DVec3, Vec3};
use std::collections::{BTreeMap, BTreeSet};

/// Frames of one scene's animation: more than an hour at 24 frames per second.
const MAX_FRAMES: f64 = 100_000.0;

/// Keys of all tracks together, some 64 bytes each.
const MAX_KEYS: f64 = 2e7;

/// Least scale of a node with an area light: what passes through 0 keeps sides that floats tell from none.
const LEAST_SCALE: f64 = 1e-6;

/// All that moves, or could.
pub(super) struct Tracks {
    pub frames: u32,
    pub cameras: Vec<CameraTrack>,
    pub lights: Vec<LightTrack>,
}

/// Makes the tracks of all lights and perspective cameras of the scene, with the graph's offset taken away from their places.
pub(super) fn build(
    graph: &Graph,
    curves: &BTreeMap<Target, Curve>,
    units: LightUnits,
    (profiles, loaded): (&Profiles, &[Option<Profile>]),
    faults: &Faults,
    notes: &mut Notes,
) -> Tracks {
    let Some(frames) = frame_count(graph, curves, faults) else {
        return Tracks {
            frames: 1,
            cameras: Vec::new(),
            lights: Vec::new(),
        };
    };
    let sampler = Sampler {
        graph,
        curves,
        frames,
    };
    let mut camera_names = BTreeSet::new();
    // Kept for the entry of the emissive materials.
    let mut light_names = BTreeSet::from([EMISSIVE.to_owned()]);
    let (mut cameras, mut lights) = (Vec::new(), Vec::new());
    for &i in &graph.order {
        let node = &graph.nodes[i];
        if let Some((index, camera)) = node.camera.and_then(|c| Some((c, graph.cameras.peek(c)?))) {
            let name = node
                .name
                .as_ref()
                .or(camera.name.as_ref())
                .map_or("camera", |name| name);
            match sampler.camera(i, index, camera) {
                Some(track) => cameras.push(CameraTrack {
                    name: unique(name, &mut camera_names),
                    ..track
                }),
                None => notes.count("cameras without a place or direction left out", 1),
            }
        }
        let punctual = node.light.and_then(|l| Some((l, graph.lights.peek(l)?)));
        let lamp = (node.lamp).and_then(|l| Some((l, loaded.get(l.profile)?.as_ref()?)));
        let area = node.area_light.and_then(|l| graph.area_lights.peek(l));
        // What hangs on the node, and its own name.
        let own = [
            punctual.map(|(index, light)| (sampler.light(i, index, light, units), light.name.as_ref())),
            lamp.map(|(lamp, profile)| (sampler.lamp(i, &lamp, profile), profiles.name(lamp.profile))),
            area.map(|light| (sampler.area_light(i, light), light.name.as_ref())),
        ];
        for (kind, name) in own.into_iter().flatten() {
            let name = node.name.as_ref().or(name);
            match kind {
                Some(kind) => lights.push(LightTrack {
                    name: unique(name.map_or("light", |name| name), &mut light_names),
                    kind,
                }),
                None => notes.count("lights without a place or direction left out", 1),
            }
        }
    }
    Tracks {
        frames,
        cameras,
        lights,
    }
}

/// A name like that of no other light, nor of the emissive materials.
pub(super) fn free_name(name: &str, lights: &[LightTrack]) -> String {
    let mut taken: BTreeSet<String> = lights.iter().map(|light| light.name.clone()).collect();
    taken.insert(EMISSIVE.to_owned());
    unique(name, &mut taken)
}

/// `name`, or `name.1`, `name.2`, … if it is taken; taken afterwards.
fn unique(name: &str, taken: &mut BTreeSet<String>) -> String {
    let mut candidate = name.to_owned();
    let mut number = 0;
    while !taken.insert(candidate.clone()) {
        number += 1;
        candidate = format!("{name}.{number}");
    }
    candidate
}

/// The number of frames up to and with the last key that moves a light or camera of the scene.
fn frame_count(graph: &Graph, curves: &BTreeMap<Target, Curve>, faults: &Faults) -> Option<u32> {
    let (targets, tracks) = targets_of_tracks(graph);
    let ends = targets
        .iter()
        .filter_map(|target| curves.get(target))
        .map(Curve::end);
    let end = ends.fold(0.0, f64::max);
    // Times are f32: the last key of a long animation may come out slightly before its frame.
    let last = (end * FPS + 1e-3).floor();
    if last >= MAX_FRAMES || last * f64::from(tracks) > MAX_KEYS {
        faults.add(
            "animations",
            format!(
                "last {end} seconds for {tracks} lights and cameras; at most {MAX_FRAMES} frames at {FPS} per second \
                 and {MAX_KEYS} keys in all are imported: shorten them"
            ),
        );
        return None;
    }
    Some(last as u32 + 1)
}

struct Sampler<'a> {
    graph: &'a Graph,
    curves: &'a BTreeMap<Target, Curve>,
    frames: u32,
}

impl Sampler<'_> {
    /// Samples a function of time in seconds; a constant if it is one.
    fn sample<T: Copy>(
        &self,
        moving: bool,
        same: impl Fn(T, T) -> bool,
        f: impl Fn(f64) -> T,
    ) -> Animated<T> {
        let first = f(0.0);
        if !moving || self.frames == 1 {
            return Animated::Constant(first);
        }
        let keys: Vec<(f64, T)> = (0..self.frames)
            .map(|frame| (f64::from(frame), f(f64::from(frame) / FPS)))
            .collect();
        if keys.iter().all(|key| same(first, key.1)) {
            return Animated::Constant(first);
        }
        Animated::Keys {
            keys,
            interpolation: Interpolation::Linear,
        }
    }

    /// From the node at the end of the chain to the world less the offset.
    fn world(&self, chain: &[usize], time: f64) -> DAffine3 {
        let mut world = world_from_node(self.graph, self.curves, chain, time);
        world.translation -= self.graph.offset;
        world
    }

    fn vector(&self, moving: bool, f: impl Fn(f64) -> DVec3) -> Animated<Vec3> {
        // Rounding in a chain of transforms is no movement.
        let same = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= 1e-6 * a.abs().max_element();
        self.sample(moving, same, |t| f(t).as_vec3())
    }

    fn scalar(&self, moving: bool, f: impl Fn(f64) -> f64) -> Animated<f32> {
        self.sample(
            moving,
            |a: f32, b: f32| (a - b).abs() <= 1e-6 * a.abs(),
            |t| f(t) as f32,
        )
    }

    /// A property's value: animated, or as it is at rest.
    fn value(&self, target: Target, rest: f32, time: f64) -> f64 {
        self.curves
            .get(&target)
            .map_or(f64::from(rest), |curve| curve.at(time).x)
    }

    fn animated(&self, target: Target) -> bool {
        self.curves.contains_key(&target)
    }

    fn camera(&self, node: usize, index: usize, camera: &Perspective) -> Option<CameraTrack> {
        let chain = self.graph.chain(node);
        let moving = moves(self.graph, self.curves, &chain);
        let world = |t| self.world(&chain, t);
        let axes = |t| axes_or_default(&world(t));
        usable(&world(0.0))?;
        let target = Target::Yfov(index);
        // A camera that sees nothing or everything behind it is no camera.
        let yfov = |t| {
            self.value(target, camera.yfov, t)
                .to_degrees()
                .clamp(1e-3, 179.999)
        };
        let track = CameraTrack {
            name: String::new(),
            position: self.vector(moving, |t| world(t).translation),
            look_at: self.vector(moving, |t| world(t).translation + axes(t).0),
            up: self.vector(moving, |t| axes(t).1),
            vfov_deg: self.scalar(self.animated(target), yfov),
            aspect: camera.aspect,
        };
        Some(track)
    }

    /// Its aim is the node's −Z; planes are counted from its +X.
    fn lamp(&self, node: usize, lamp: &Lamp, profile: &Profile) -> Option<LightKind> {
        let chain = self.graph.chain(node);
        let moving = moves(self.graph, self.curves, &chain);
        let world = |t| self.world(&chain, t);
        usable(&world(0.0))?;
        let right = |t| {
            let (forward, up) = axes_or_default(&world(t));
            forward.cross(up)
        };
        Some(LightKind::Ies {
            profile: profile.photometry.clone(),
            file: profile.text.clone(),
            position: self.vector(moving, |t| world(t).translation),
            direction: self.vector(moving, |t| axes_or_default(&world(t)).0),
            up: self.vector(moving, right),
            scale: Animated::Constant(lamp.scale),
        })
    }

    /// It shines along the node's −Z, and grows with the largest of its scales in the world.
    fn area_light(&self, node: usize, light: &AreaLight) -> Option<LightKind> {
        let chain = self.graph.chain(node);
        let moving = moves(self.graph, self.curves, &chain);
        let world = |t| self.world(&chain, t);
        usable(&world(0.0))?;
        let sides = |t| {
            let world = world(t);
            let m = world.matrix3;
            let scale = [m.x_axis, m.y_axis, m.z_axis]
                .map(DVec3::length)
                .into_iter()
                .fold(LEAST_SCALE, f64::max);
            let (forward, up) = axes_or_default(&world);
            let right = forward.cross(up).try_normalize();
            let right = right.unwrap_or_else(|| forward.any_orthonormal_vector());
            let [width, height] = light.size.map(|side| f64::from(side) * scale);
            // Rectangles shine towards u × v.
            [-width * right, height * right.cross(forward)]
        };
        let side = |k: usize| self.vector(moving, |t| sides(t)[k]);
        Some(LightKind::Rect {
            center: self.vector(moving, |t| world(t).translation),
            edge_u: side(0),
            edge_v: side(1),
            radiance: Animated::Constant(light.radiance),
        })
    }

    fn light(&self, node: usize, index: usize, light: &Punctual, units: LightUnits) -> Option<LightKind> {
        let chain = self.graph.chain(node);
        let moving = moves(self.graph, self.curves, &chain);
        let world = |t| self.world(&chain, t);
        if light.kind != PunctualKind::Point {
            usable(&world(0.0))?;
        }
        if !world(0.0).translation.as_vec3().is_finite() {
            return None;
        }
        let position = || self.vector(moving, |t| world(t).translation);
        let direction = || self.vector(moving, |t| axes_or_default(&world(t)).0);
        let (color, intensity) = (Target::Color(index), Target::Intensity(index));
        let factor = units.factor(light.kind);
        let strength = self.vector(self.animated(color) || self.animated(intensity), |t| {
            let rgb = self
                .curves
                .get(&color)
                .map_or(light.color.as_dvec3(), |curve| curve.at(t).truncate());
            // Cubic splines can swing below 0, and nothing may leave f32's range.
            let scale = self.value(intensity, light.intensity, t).max(0.0) * factor;
            (rgb.max(DVec3::ZERO) * scale).min(DVec3::splat(MAX_LIGHT))
        });
        Some(match light.kind {
            PunctualKind::Point => LightKind::Point {
                position: position(),
                intensity: strength,
            },
            PunctualKind::Directional => LightKind::Directional {
                direction: direction(),
                irradiance: strength,
            },
            PunctualKind::Spot { inner, outer } => {
                let (inner_target, outer_target) = (Target::InnerAngle(index), Target::OuterAngle(index));
                let outer_deg = |t| self.value(outer_target, outer, t).to_degrees().clamp(1e-3, 90.0);
                let inner_deg = |t| {
                    self.value(inner_target, inner, t)
                        .to_degrees()
                        .clamp(0.0, outer_deg(t))
                };
                LightKind::Spot {
                    position: position(),
                    direction: direction(),
                    inner_angle_deg: self.scalar(
                        self.animated(inner_target) || self.animated(outer_target),
                        inner_deg,
                    ),
                    outer_angle_deg: self.scalar(self.animated(outer_target), outer_deg),
                    intensity: strength,
                }
            }
        })
    }
}

/// Whether a transform has a finite place and a direction.
fn usable(world: &DAffine3) -> Option<()> {
    forward_and_up(world)?;
    world.translation.as_vec3().is_finite().then_some(())
}

/// The axes of a node; its own −Z and +Y for the moments at which an animated scale passes through 0.
fn axes_or_default(world: &DAffine3) -> (DVec3, DVec3) {
    forward_and_up(world).unwrap_or((DVec3::NEG_Z, DVec3::Y))
}
