//! Animations (glTF 2.0, section 3.11) and KHR_animation_pointer, as far as they move lights and cameras.
//!
//! All animations of a file play together, since exporters write one per object. Where two drive the same
//! property, the first one counts.

use super::accessors::Data;
use super::component::Component;
use super::json::{At, Faults};
use super::layout::{Accessor, Layout};
use super::nodes::{Graph, Local, Trs};
use super::notes::Notes;
use glam::{DAffine3, DQuat, DVec3, DVec4};
use std::collections::{BTreeMap, BTreeSet};

/// A property that can move. The numbers index nodes, lights and cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Target {
    Translation(usize),
    Rotation(usize),
    Scale(usize),
    Intensity(usize),
    Color(usize),
    InnerAngle(usize),
    OuterAngle(usize),
    Yfov(usize),
}

impl Target {
    /// Components of its value.
    fn width(self) -> usize {
        match self {
            Target::Translation(_) | Target::Scale(_) | Target::Color(_) => 3,
            Target::Rotation(_) => 4,
            _ => 1,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

/// What drives a target: accessors of times and values.
pub(super) struct Channel {
    input: usize,
    output: usize,
    interpolation: Interpolation,
    path: String,
}

/// A decoded channel: values over time in seconds.
pub(super) struct Curve {
    times: Vec<f64>,
    /// One a key; three (in-tangent, value, out-tangent) for cubic splines. Unused components are 0.
    values: Vec<DVec4>,
    interpolation: Interpolation,
    is_rotation: bool,
}

/// All that could move a light or camera of the scene, and how many of these there are.
pub(super) fn targets_of_tracks(graph: &Graph) -> (BTreeSet<Target>, u32) {
    let (mut targets, mut tracks) = (BTreeSet::new(), 0);
    for &i in &graph.order {
        let node = &graph.nodes[i];
        let shines = node.light.is_some() || node.lamp.is_some() || node.area_light.is_some();
        if !shines && node.camera.is_none() {
            continue;
        }
        tracks += 1;
        for ancestor in graph.chain(i) {
            targets.extend(movements(graph.nodes[ancestor].source));
        }
        if let Some(l) = node.light {
            targets.extend([
                Target::Intensity(l),
                Target::Color(l),
                Target::InnerAngle(l),
                Target::OuterAngle(l),
            ]);
        }
        targets.extend(node.camera.map(Target::Yfov));
    }
    (targets, tracks)
}

/// What can move a node of the file.
fn movements(source: usize) -> [Target; 3] {
    [
        Target::Translation(source),
        Target::Rotation(source),
        Target::Scale(source),
    ]
}

/// Reads and checks the channels. Those that move only meshes, or what is not imported, are noted, and so are
/// broken ones that move no light or camera.
pub(super) fn parse(
    root: &At,
    layout: &Layout,
    graph: &Graph,
    notes: &mut Notes,
) -> BTreeMap<Target, Channel> {
    let (used, _) = targets_of_tracks(graph);
    let mut channels: BTreeMap<Target, Channel> = BTreeMap::new();
    let broken = Faults::default();
    for animation in root.items("animations") {
        let animation = animation.reporting_to(&broken);
        let samplers = animation.items("samplers");
        for at in animation.items("channels") {
            let Some(target) = parse_target(&at, graph, notes) else {
                continue;
            };
            let faults = if used.contains(&target) {
                root.faults()
            } else {
                &broken
            };
            let sampler = at
                .reporting_to(faults)
                .required_index("sampler", samplers.len(), "samplers");
            let channel =
                sampler.and_then(|i| parse_sampler(&samplers[i].reporting_to(faults), layout, target));
            let Some(channel) = channel else {
                continue;
            };
            if channels.contains_key(&target) {
                notes.count(
                    "animation channels that drive what an earlier one drives already, left out",
                    1,
                );
                continue;
            }
            channels.insert(target, channel);
        }
    }
    for fault in broken.take() {
        notes.say(format!(
            "an animation that moves no light or camera is broken: {fault}"
        ));
    }
    channels
}

fn parse_target(at: &At, graph: &Graph, notes: &mut Notes) -> Option<Target> {
    let Some(target) = at.object("target") else {
        at.fault_at("target", "is missing");
        return None;
    };
    if let Some(pointer) = target.extension("KHR_animation_pointer") {
        let Some(text) = pointer.text("pointer") else {
            pointer.fault_at("pointer", "must be a string");
            return None;
        };
        return parse_pointer(&pointer, text, graph, notes);
    }
    let path = target.text("path");
    // Without a node, only an extension could say what moves.
    target.get("node")?;
    let node = target.index("node", graph.nodes.len(), "nodes")?;
    match path {
        Some("translation") => Some(Target::Translation(node)),
        Some("rotation") => Some(Target::Rotation(node)),
        Some("scale") => Some(Target::Scale(node)),
        Some("weights") => {
            notes.count("animations of morph targets left out", 1);
            None
        }
        Some("pointer") => {
            target.fault_at(
                "extensions",
                "must hold KHR_animation_pointer, since the path is \"pointer\"",
            );
            None
        }
        _ => {
            target.fault_at("path", "must be translation, rotation, scale or weights");
            None
        }
    }
}

/// A JSON pointer (RFC 6901) to a property of a light, camera or node; others are noted.
fn parse_pointer(at: &At, text: &str, graph: &Graph, notes: &mut Notes) -> Option<Target> {
    let parts: Vec<&str> = text.split('/').collect();
    let index = |digits: &str, len: usize, what: &str| {
        let index = digits.parse::<usize>().ok().filter(|&i| i < len);
        if index.is_none() {
            at.fault_at(
                "pointer",
                format!("is \"{text}\", but there are only {len} {what}"),
            );
        }
        index
    };
    let light = |i: &str| index(i, graph.lights.len(), "lights");
    let node = |i: &str| index(i, graph.nodes.len(), "nodes");
    match parts[..] {
        ["", "extensions", "KHR_lights_punctual", "lights", i, "intensity"] => {
            Some(Target::Intensity(light(i)?))
        }
        ["", "extensions", "KHR_lights_punctual", "lights", i, "color"] => Some(Target::Color(light(i)?)),
        [
            "",
            "extensions",
            "KHR_lights_punctual",
            "lights",
            i,
            "spot",
            "innerConeAngle",
        ] => Some(Target::InnerAngle(light(i)?)),
        [
            "",
            "extensions",
            "KHR_lights_punctual",
            "lights",
            i,
            "spot",
            "outerConeAngle",
        ] => Some(Target::OuterAngle(light(i)?)),
        ["", "nodes", i, "translation"] => Some(Target::Translation(node(i)?)),
        ["", "nodes", i, "rotation"] => Some(Target::Rotation(node(i)?)),
        ["", "nodes", i, "scale"] => Some(Target::Scale(node(i)?)),
        ["", "cameras", i, "perspective", "yfov"] => {
            Some(Target::Yfov(index(i, graph.cameras.len(), "cameras")?))
        }
        _ => {
            let short: String = text.chars().take(100).collect();
            notes.say(format!("the animation of {short} is left out"));
            None
        }
    }
}

fn parse_sampler(at: &At, layout: &Layout, target: Target) -> Option<Channel> {
    let interpolation = match at.text("interpolation") {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(other) => {
            at.fault_at(
                "interpolation",
                format!("is \"{other}\"; glTF knows LINEAR, STEP and CUBICSPLINE"),
            );
            return None;
        }
    };
    let accessor = |key| {
        let index = at.required_index(key, layout.accessors.len(), "accessors")?;
        Some((index, layout.accessors.get(index, at.faults())?))
    };
    let (input, output) = (accessor("input"), accessor("output"));
    let ((input, times), (output, values)) = (input?, output?);
    if times.width != 1 || times.component != Component::F32 {
        at.fault_at(
            "input",
            format!("uses accessors[{input}], which is no list of 32-bit float scalars"),
        );
        return None;
    }
    let usable =
        |a: &Accessor| a.component == Component::F32 || (a.normalized && a.component != Component::U32);
    if values.width != target.width() || !usable(values) {
        at.fault_at(
            "output",
            format!(
                "uses accessors[{output}], but {} components of floats or normalised integers are needed",
                target.width()
            ),
        );
        return None;
    }
    let per_key = if interpolation == Interpolation::CubicSpline {
        3
    } else {
        1
    };
    if times.count.checked_mul(per_key) != Some(values.count) {
        at.fault_at(
            "output",
            format!(
                "has {} values for {} keys; {per_key} a key are needed",
                values.count, times.count
            ),
        );
        return None;
    }
    // An accessor without bytes is mostly zeros: no animation, and its size is unbounded.
    for (key, index, accessor) in [("input", input, times), ("output", output, values)] {
        if accessor.view.is_none() {
            at.fault_at(key, format!("uses accessors[{index}], which holds no data"));
            return None;
        }
    }
    Some(Channel {
        input,
        output,
        interpolation,
        path: at.path.clone(),
    })
}

/// Decodes the channels that move lights and cameras into curves.
pub(super) fn decode(
    graph: &Graph,
    channels: &BTreeMap<Target, Channel>,
    data: &Data,
    faults: &Faults,
) -> BTreeMap<Target, Curve> {
    let mut curves = BTreeMap::new();
    let (used, _) = targets_of_tracks(graph);
    for (&target, channel) in channels.iter().filter(|(target, _)| used.contains(target)) {
        let times: Vec<f64> = data.scalars(channel.input).into_iter().map(f64::from).collect();
        let rising = times.windows(2).all(|pair| pair[0] < pair[1]);
        if times.is_empty() || !rising || !times.iter().all(|t| t.is_finite() && *t >= 0.0) {
            faults.add(
                format!("{}.input", channel.path),
                "holds times that don't rise from 0 on; export the animation again",
            );
            continue;
        }
        let output = channel.output;
        let values: Vec<DVec4> = match target.width() {
            1 => data
                .scalars(output)
                .into_iter()
                .map(|x| DVec4::new(x.into(), 0.0, 0.0, 0.0))
                .collect(),
            3 => (data.vectors(output).into_iter())
                .map(|v| glam::Vec3::from_array(v).as_dvec3().extend(0.0))
                .collect(),
            _ => data
                .vectors(output)
                .into_iter()
                .map(|v| glam::Vec4::from_array(v).as_dvec4())
                .collect(),
        };
        if !values.iter().all(|v| v.is_finite()) {
            faults.add(
                format!("{}.output", channel.path),
                "holds values that are not finite; export the animation again",
            );
            continue;
        }
        curves.insert(
            target,
            Curve {
                times,
                values,
                interpolation: channel.interpolation,
                is_rotation: matches!(target, Target::Rotation(_)),
            },
        );
    }
    curves
}

impl Curve {
    /// The time of the last key, in seconds.
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// The value at a time, as appendix C of glTF 2.0 interpolates it.
    pub fn at(&self, time: f64) -> DVec4 {
        let per_key = if self.interpolation == Interpolation::CubicSpline {
            3
        } else {
            1
        };
        let value = |key: usize| self.values[key * per_key + per_key / 2];
        let next = self.times.partition_point(|&t| t <= time);
        if next == 0 {
            return value(0);
        }
        if next == self.times.len() || self.interpolation == Interpolation::Step {
            return value(next - 1);
        }
        let key = next - 1;
        let span = self.times[next] - self.times[key];
        let t = (time - self.times[key]) / span;
        if self.interpolation == Interpolation::Linear {
            if !self.is_rotation {
                return value(key).lerp(value(next), t);
            }
            let (a, b) = (rotation(value(key)), rotation(value(next)));
            return DVec4::from(a.slerp(b, t));
        }
        let (t2, t3) = (t * t, t * t * t);
        let leaving = self.values[key * 3 + 2] * span;
        let arriving = self.values[next * 3] * span;
        value(key) * (2.0 * t3 - 3.0 * t2 + 1.0)
            + leaving * (t3 - 2.0 * t2 + t)
            + value(next) * (3.0 * t2 - 2.0 * t3)
            + arriving * (t3 - t2)
    }
}

/// A unit quaternion; identity where the numbers name no rotation.
fn rotation(v: DVec4) -> DQuat {
    let q = DQuat::from_vec4(v);
    if q.length_squared() > 1e-12 {
        q.normalize()
    } else {
        DQuat::IDENTITY
    }
}

/// The transform from a node, the last of `chain`, to the world at a time in seconds. `chain` starts at a root.
pub(super) fn world_from_node(
    graph: &Graph,
    curves: &BTreeMap<Target, Curve>,
    chain: &[usize],
    time: f64,
) -> DAffine3 {
    let mut world = DAffine3::IDENTITY;
    for &node in chain {
        let (local, node) = (&graph.nodes[node].local, graph.nodes[node].source);
        let value = |target| curves.get(&target).map(|curve: &Curve| curve.at(time));
        let (t, r, s) = (
            value(Target::Translation(node)),
            value(Target::Rotation(node)),
            value(Target::Scale(node)),
        );
        let local = if t.is_none() && r.is_none() && s.is_none() {
            *local
        } else {
            let rest = local.trs();
            Local::Trs(Trs {
                translation: t.map_or(rest.translation, DVec4::truncate),
                rotation: r.map_or(rest.rotation, rotation),
                scale: s.map_or(rest.scale, DVec4::truncate),
            })
        };
        world *= local.parent_from_node();
    }
    world
}

/// Whether a node of the chain moves.
pub(super) fn moves(graph: &Graph, curves: &BTreeMap<Target, Curve>, chain: &[usize]) -> bool {
    let moves = |node: &usize| movements(graph.nodes[*node].source);
    chain
        .iter()
        .flat_map(moves)
        .any(|target| curves.contains_key(&target))
}

/// Notes how many animated nodes carry meshes: those stay at rest.
pub(super) fn note_moving_meshes(graph: &Graph, curves: &BTreeMap<Target, Channel>, notes: &mut Notes) {
    let mut carries = vec![false; graph.nodes.len()];
    for &i in graph.order.iter().rev() {
        let node = &graph.nodes[i];
        carries[i] |= node.mesh.is_some();
        if let Some(parent) = node.parent {
            carries[parent] |= carries[i];
        }
    }
    let moving = (0..graph.nodes.len()).filter(|&node| {
        let targets = movements(graph.nodes[node].source);
        carries[node] && targets.iter().any(|target| curves.contains_key(target))
    });
    notes.count(
        "animated nodes with meshes, which stay at rest",
        moving.count() as u64,
    );
}

/// Directions of a node's axes in the world: (−Z, +Y), of unit length; `None` where a scale of 0 leaves none.
pub(super) fn forward_and_up(world_from_node: &DAffine3) -> Option<(DVec3, DVec3)> {
    let m = world_from_node.matrix3;
    Some((
        (-m.z_axis).try_normalize()?,
        m.y_axis.try_normalize().unwrap_or(DVec3::Y),
    ))
}
