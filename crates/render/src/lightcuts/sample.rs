//! Reconstruction cuts: light at a point from lightcuts near by.
//!
//! Source: Walter et al. 2005, section 7: samples with impostor lights (equations 5 and 6) and the rules discard,
//! interpolate, cluster-evaluate and refine, with their three exceptions.

use super::View;
use super::cut::{Cut, Slot};
use super::lit::{Lit, Receiver, Term};
use super::sights::Sights;
use crate::many_lights::clamp_limit;
use glam::Vec3;
use relight_scene::bsdf;
use std::f32::consts::FRAC_1_PI;

/// A directional light that is never hidden and gives a sample point what a node's lights give it.
#[derive(Clone, Copy, Debug)]
struct Impostor {
    /// Unit, towards the light.
    direction: Vec3,
    /// γ, equation 5: radiance by the node over the material term. Infinite where the latter is zero but the first is
    /// not.
    intensity: Vec3,
    /// Γ, equation 6: all radiance over the material term, in the largest channels.
    all: f32,
}

/// A lightcut prepared for interpolation.
pub(crate) struct Sample {
    pub view: View,
    /// As [`Cut::slots`].
    slots: Vec<Slot>,
    impostors: Vec<Impostor>,
    /// All light before clamping.
    total: Vec3,
}

impl Sample {
    /// Chooses a lightcut at a view and makes impostors of it. `cut`, `sights` and `estimates` are buffers.
    pub fn new(
        lit: &Lit<'_>,
        view: View,
        (cut, sights): (&mut Cut, &mut Sights),
        estimates: &mut Vec<(Vec3, Vec3)>,
        shadow_rays: &mut u64,
    ) -> Sample {
        let receiver = Receiver::new(&view.hit, &view.point, view.wo);
        cut.keep = true;
        sights.begin(lit, std::iter::once(&view.hit));
        cut.choose(lit, &receiver, sights, shadow_rays);
        let total = cut.total.as_vec3();
        let limit = clamp_limit(total, lit.points.clamp);
        // Per slot its radiance and the direction from which that comes, not yet a unit vector.
        estimates.clear();
        estimates.extend(cut.slots.iter().map(|slot| {
            let light = lit.clusters.nodes[slot.node as usize].representative;
            let arrival = lit.points.arrival(light as usize, view.hit.position);
            (Vec3::ZERO, arrival.map_or(Vec3::ZERO, |a| a.direction))
        }));
        for n in cut.nodes() {
            estimates[n.slot as usize].0 = lit.clamped(n.node, n.term, limit);
        }
        for slot in (0..cut.slots.len()).rev() {
            let first = cut.slots[slot].children as usize;
            if first > 0 {
                let [(la, da), (lb, db)] = [estimates[first], estimates[first + 1]];
                // Weighted by radiance; relative weights, since radiances may be of any size.
                let (wa, wb) = (la.element_sum(), lb.element_sum());
                let sum = wa + wb;
                let mean = if sum > 0.0 && sum.is_finite() {
                    da * (wa / sum) + db * (wb / sum)
                } else {
                    da + db
                };
                estimates[slot] = (la + lb, mean.normalize_or_zero());
            }
        }
        let largest = total.max_element();
        let impostors = (estimates.iter())
            .map(|&(radiance, direction)| {
                let material = crate::direct::reflected(&view.point, view.wo, direction);
                let over = |l: f32, m: f32| match (l > 0.0, m > 0.0) {
                    (false, _) => 0.0,
                    (true, true) => l / m,
                    (true, false) => f32::INFINITY,
                };
                Impostor {
                    direction,
                    intensity: Vec3::new(
                        over(radiance.x, material.x),
                        over(radiance.y, material.y),
                        over(radiance.z, material.z),
                    ),
                    all: if material.max_element() > 0.0 {
                        largest / material.max_element()
                    } else {
                        f32::INFINITY
                    },
                }
            })
            .collect();
        Sample {
            view,
            slots: cut.slots.clone(),
            impostors,
            total,
        }
    }

    /// Light at the sample point itself, root by root.
    pub fn light(&self, lit: &Lit<'_>, mut visit: impl FnMut(u32, Vec3)) {
        let View { point, wo, .. } = &self.view;
        for root in 0..lit.clusters.roots.len() {
            let impostor = &self.impostors[root];
            if impostor.intensity.is_finite() {
                let material = crate::direct::reflected(point, *wo, impostor.direction);
                visit(root as u32, material * impostor.intensity);
            }
        }
    }
}

/// Most samples that are interpolated between.
pub(crate) const MOST_SAMPLES: usize = 8;

/// Where a node is in a sample: its own slot, or the one of the node above it on the sample's cut.
#[derive(Clone, Copy, Debug, Default)]
struct SampleSlot {
    slot: u32,
    /// Share of that slot's light that is the node's: 1 unless it is below the cut.
    share: f32,
    /// On the cut, or below it.
    reached: bool,
    /// Below the cut.
    below: bool,
}

#[derive(Clone, Copy, Debug)]
struct Visit {
    node: u32,
    root: u32,
    /// Place among those of [`Sights`].
    place: u32,
    /// Evaluate, whatever the samples say (third exception), with the representative's term where it is known.
    evaluate: bool,
    known: Option<Term>,
    places: [SampleSlot; MOST_SAMPLES],
}

/// What reconstruction cuts took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReconstructionStats {
    /// Reconstruction cuts: points lit by interpolation.
    pub cuts: u64,
    /// Their shadow rays.
    pub shadow_rays: u64,
    /// Nodes that were interpolated.
    pub interpolations: u64,
    /// Lightcuts that were made into samples.
    pub samples: u64,
    /// Shadow rays of the samples.
    pub sample_rays: u64,
    /// Nodes on the samples' cuts.
    pub sample_nodes: u64,
    /// Eye rays.
    pub eye_rays: u64,
}

/// The traversal's stack, to be used again and again.
#[derive(Default)]
pub(crate) struct Traversal {
    stack: Vec<Visit>,
}

/// An evaluated cluster this many times brighter than the threshold is "much larger than expected" (the paper gives no
/// number).
const UNEXPECTED: f32 = 2.0;
/// Above this a BRDF value is of a glossy lobe: a white Lambert surface has 1/π.
const GLOSSY: f32 = FRAC_1_PI * 1.0001;

impl Traversal {
    /// A reconstruction cut at `view` from `samples` (at most [`MOST_SAMPLES`]) with weights that sum to 1: calls
    /// `visit(root, radiance)`. `sights` have begun at places with the view among them.
    pub fn light(
        &mut self,
        lit: &Lit<'_>,
        view: &View,
        samples: &[(&Sample, f32)],
        sights: &mut Sights,
        stats: &mut ReconstructionStats,
        mut visit: impl FnMut(u32, Vec3),
    ) {
        let samples = &samples[..samples.len().min(MOST_SAMPLES)];
        let receiver = Receiver::new(&view.hit, &view.point, view.wo);
        let total: Vec3 = samples.iter().map(|(s, w)| s.total * *w).sum();
        let limit = clamp_limit(total, lit.points.clamp);
        // What a cluster may give at most where it counts as expected.
        let expected = UNEXPECTED * lit.settings.error_ratio * total.max_element();
        stats.cuts += 1;
        self.stack.clear();
        for (root, start) in lit.clusters.roots.iter().enumerate() {
            let mut places = [SampleSlot::default(); MOST_SAMPLES];
            for (place, (sample, _)) in places.iter_mut().zip(samples) {
                *place = SampleSlot {
                    slot: root as u32,
                    share: 1.0,
                    reached: sample.slots[root].children == 0,
                    below: false,
                };
            }
            self.stack.push(Visit {
                node: start.node,
                root: root as u32,
                place: root as u32,
                evaluate: false,
                known: None,
                places,
            });
        }
        while let Some(at) = self.stack.pop() {
            let children = lit.clusters.children(at.node);
            let mut evaluate = at.evaluate;
            if !evaluate {
                let places = &at.places[..samples.len()];
                let (mut low, mut high, mut all) = (Vec3::INFINITY, Vec3::ZERO, f32::INFINITY);
                for (place, (sample, _)) in places.iter().zip(samples) {
                    let impostor = &sample.impostors[place.slot as usize];
                    let intensity = impostor.intensity * place.share;
                    (low, high) = (low.min(intensity), high.max(intensity));
                    all = all.min(impostor.all);
                }
                // Discard.
                if high == Vec3::ZERO {
                    continue;
                }
                let threshold = lit.settings.error_ratio * all;
                // Interpolate, unless all samples stop above.
                if (high - low).max_element() < threshold
                    && low.max_element() > 0.0
                    && !places.iter().all(|place| place.below)
                    && let Some(radiance) = interpolated(view, samples, places)
                {
                    stats.interpolations += 1;
                    visit(at.root, radiance);
                    continue;
                }
                // Cluster-evaluate, at or below at least one of the samples' cuts.
                evaluate = children.is_none()
                    || (high.max_element() < threshold && places.iter().any(|place| place.reached));
            }
            if evaluate {
                // What can send nothing needs no ray.
                if at.known.is_none()
                    && children.is_some()
                    && receiver.node_bound(lit.clusters, at.node) <= 0.0
                {
                    continue;
                }
                let representative = lit.clusters.nodes[at.node as usize].representative;
                let sight = sights.of(lit, at.place, at.node);
                let term = if sight.closed && children.is_some() {
                    Term::DARK.with(lit.mean_among(
                        at.node,
                        &receiver,
                        sights.parts(sight),
                        &mut stats.shadow_rays,
                    ))
                } else {
                    (at.known).unwrap_or_else(|| {
                        lit.seen_from(representative, &receiver, sights, sight, &mut stats.shadow_rays)
                    })
                };
                let radiance = lit.clamped(at.node, term, limit);
                let unexpected = expected > 0.0 && radiance.max_element() > expected;
                match children {
                    Some(children) if unexpected => {
                        let place = sights.children(at.place);
                        for (side, node) in children.into_iter().enumerate() {
                            let shared = lit.clusters.nodes[node as usize].representative == representative;
                            self.stack.push(Visit {
                                node,
                                place: place + side as u32,
                                evaluate: true,
                                known: (shared && !sight.closed).then_some(term),
                                ..at
                            });
                        }
                    }
                    _ => visit(at.root, radiance),
                }
                continue;
            }
            // Refine.
            let Some(children) = children else { continue };
            let parent = lit.clusters.nodes[at.node as usize].intensity.element_sum();
            let first_place = sights.children(at.place);
            for (side, node) in children.into_iter().enumerate() {
                let mut places = at.places;
                for (place, (sample, _)) in places.iter_mut().zip(samples) {
                    let first = sample.slots[place.slot as usize].children;
                    if !place.reached {
                        place.slot = first + side as u32;
                        place.reached = sample.slots[place.slot as usize].children == 0;
                    } else {
                        let own = lit.clusters.nodes[node as usize].intensity.element_sum();
                        place.share *= own / parent;
                        place.below = true;
                    }
                }
                self.stack.push(Visit {
                    node,
                    place: first_place + side as u32,
                    places,
                    ..at
                });
            }
        }
    }
}

/// Radiance by the weighted mean of the impostors; `None` in a glossy highlight (first exception), or where they have no
/// common direction.
fn interpolated(view: &View, samples: &[(&Sample, f32)], places: &[SampleSlot]) -> Option<Vec3> {
    let (mut direction, mut intensity) = (Vec3::ZERO, Vec3::ZERO);
    for (place, (sample, weight)) in places.iter().zip(samples) {
        let impostor = &sample.impostors[place.slot as usize];
        direction += impostor.direction * *weight;
        intensity += impostor.intensity * (place.share * weight);
    }
    let direction = direction.try_normalize()?;
    let brdf = bsdf::eval(&view.point, view.wo, direction);
    if brdf.max_element() > GLOSSY {
        return None;
    }
    let radiance = brdf * view.point.shading_normal.dot(direction).max(0.0) * intensity;
    radiance.is_finite().then_some(radiance)
}
