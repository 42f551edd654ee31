//! Choosing a lightcut: the clusters that stand for all lights at one point.
//!
//! Source: Walter et al. 2005, section 3, "Choosing lightcuts", and section 5 (clamping of virtual lights).

use super::hidden::hides;
use crate::direct::reflected;
use crate::lighting::cosine_over;
use crate::many_lights::{PointLights, clamp_limit, clamped};
use glam::{DVec3, Vec3};
use relight_scene::bsdf::bounds::ReflectionBound;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, ray_end};
use relight_scene::traced::{Stop, TracedScene};
use relight_transport::light_bounds::{Axis, LightBox, geometric_bound};
use relight_transport::light_clusters::LightClusters;
use relight_transport::point_light::Emission;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Where light arrives and who looks at it.
pub(crate) struct Receiver<'a> {
    pub hit: &'a SurfaceHit,
    pub point: &'a ShadingPoint,
    pub wo: Vec3,
    /// Surface, m², that the place stands for.
    footprint: f32,
    bound: ReflectionBound,
    axes: [Axis; 4],
}

impl<'a> Receiver<'a> {
    pub fn new(hit: &'a SurfaceHit, point: &'a ShadingPoint, wo: Vec3) -> Receiver<'a> {
        let bound = ReflectionBound::new(point, wo);
        Receiver {
            hit,
            point,
            wo,
            footprint: 0.0,
            axes: bound.axes.map(Axis::new),
            bound,
        }
    }

    /// The same receiver as the middle of `footprint` m² of matt surface, over which light of near lamps is averaged
    /// ([`cosine_over`]). Bounds are those of the middle: a lamp nearer than the footprint is wide may exceed them.
    pub fn standing_for(mut self, footprint: f32) -> Receiver<'a> {
        self.footprint = footprint;
        self
    }

    /// A node's lights as seen from here.
    #[inline]
    fn sees(&self, clusters: &LightClusters, node: u32) -> LightBox {
        LightBox::new(
            &clusters.nodes[node as usize],
            clusters.emission(node),
            self.hit.position,
        )
    }

    /// Most that a node's lights can be reflected by, in all and the largest channel: radiance. Infinite near a
    /// cluster, 0 where none of its light is reflected.
    #[inline]
    pub fn node_bound(&self, clusters: &LightClusters, node: u32) -> f32 {
        let emission = clusters.emission(node);
        let cluster = &clusters.nodes[node as usize];
        let seen = self.sees(clusters, node);
        let geometric = geometric_bound(cluster, emission, &seen);
        if geometric <= 0.0 {
            return 0.0;
        }
        let reflected = self.bound.bound(|axis| {
            let angle = seen.angle(&self.axes[axis]);
            (angle.cos, angle.sin)
        });
        // First what cannot be infinite, or nothing times infinity would be no number.
        let most = (reflected * cluster.intensity).max_element();
        if most > 0.0 { most * geometric } else { 0.0 }
    }
}

/// All that stays the same for an image.
pub(crate) struct Lit<'a> {
    pub scene: &'a TracedScene,
    pub points: &'a PointLights,
    pub clusters: &'a LightClusters,
    pub error_ratio: f32,
    pub doubt: f32,
    pub max_nodes: usize,
}

/// A light's effect on a receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Term {
    /// Radiance per unit of the light's intensity: M G V of the paper's equation 1.
    pub radiance: Vec3,
    /// The opaque triangle that hides it; `None` also where it sends nothing for other reasons.
    hidden_by: Option<u32>,
}

impl Term {
    const DARK: Term = Term {
        radiance: Vec3::ZERO,
        hidden_by: None,
    };
}

impl Lit<'_> {
    /// What light `i` gives, shadow ray included.
    pub fn term(&self, i: u32, receiver: &Receiver<'_>, shadow_rays: &mut u64) -> Term {
        let Receiver { hit, point, wo, .. } = *receiver;
        let light = &self.points.lights[i as usize];
        let Some(arrival) = light.arrival(hit.position) else {
            return Term::DARK;
        };
        let reflected = reflected(point, wo, arrival.direction);
        let stands_for_more = receiver.footprint > 0.0;
        if reflected == Vec3::ZERO || stands_for_more && hit.geometric_normal.dot(arrival.direction) <= 0.0 {
            return Term::DARK;
        }
        let Some(ray) = self.points.shadow_ray(i as usize, &ray_end(hit)) else {
            return Term::DARK;
        };
        *shadow_rays += 1;
        if let Some(stop) = self.scene.stop(&ray) {
            let sure = self.points.rays_end_at_lights();
            return Term {
                radiance: Vec3::ZERO,
                hidden_by: match stop {
                    Stop::Opaque(triangle) if sure => Some(triangle),
                    _ => None,
                },
            };
        }
        let mut radiance = reflected * arrival.factor;
        if stands_for_more && light.emission != Emission::Directional {
            let distance = hit.position.distance(light.position);
            let cosine = point.shading_normal.dot(arrival.direction);
            radiance *= cosine_over(receiver.footprint, distance, cosine) / cosine;
        }
        Term {
            radiance,
            hidden_by: None,
        }
    }

    /// Equation 2: a cluster's light, all of it as its representative's.
    #[inline]
    pub fn estimate(&self, node: u32, term: Term) -> Vec3 {
        let intensity = self.clusters.nodes[node as usize].intensity;
        // In f64: an intensity of 1e20 near by would overflow on the way.
        let radiance = (term.radiance.as_dvec3() * intensity.as_dvec3()).as_vec3();
        if radiance.is_finite() {
            radiance
        } else {
            Vec3::ZERO
        }
    }
}

impl Lit<'_> {
    /// A node's estimate; virtual lights that stand alone are clamped to `limit`.
    pub fn clamped(&self, node: u32, term: Term, limit: f32) -> Vec3 {
        let radiance = self.estimate(node, term);
        let light = self.clusters.nodes[node as usize].representative as usize;
        if self.points.is_virtual(light) && self.clusters.children(node).is_none() {
            clamped(radiance, limit)
        } else {
            radiance
        }
    }
}

/// A node of a cut.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CutNode {
    /// Upper bound of the error in the largest channel, or the doubt by as much as it counts more; 0 of single lights.
    pub error: f32,
    /// What the error may really be (see [`Cut::choose`]).
    doubt: f32,
    pub node: u32,
    /// Place among the roots.
    pub root: u32,
    /// Place among [`Cut::slots`], if they are kept.
    pub slot: u32,
    /// Of the representative.
    pub term: Term,
}

impl PartialEq for CutNode {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for CutNode {}
impl PartialOrd for CutNode {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for CutNode {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error
            .total_cmp(&other.error)
            .then(other.node.cmp(&self.node))
    }
}

/// A node that was looked at while a cut was chosen; the roots are the first ones, siblings are side by side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    pub node: u32,
    /// Place of the first child; 0 of nodes on the cut, and of those that can send nothing.
    pub children: u32,
}

/// What a node knows from the one above it.
#[derive(Clone, Copy, Default)]
struct Above {
    /// The representative's term, if they share it.
    known: Option<Term>,
    /// What hides the other's representative.
    hidden_by: Option<u32>,
}

/// What is left of the doubt about a node for its children, at least: less than the half that their light is, so that a
/// disagreement long ago is forgotten.
const FORGOTTEN: f32 = 3.0;

/// A cut and the buffers it is made in, to be used again and again.
#[derive(Default)]
pub(crate) struct Cut {
    heap: BinaryHeap<CutNode>,
    /// Single lights.
    leaves: Vec<CutNode>,
    /// Unclamped sum of all estimates.
    pub total: DVec3,
    size: usize,
    /// All nodes on and above the cut, if `keep`.
    pub slots: Vec<Slot>,
    /// Whether slots are kept.
    pub keep: bool,
}

impl Cut {
    /// Refines from the roots until every node's error bound is at most the error ratio times the total, or the cut has
    /// too many nodes.
    ///
    /// Deviation: the paper counts on errors of clusters that are independent and mostly far below their bounds. Where
    /// shadows' edges cross many clusters they are not, and a sixth of an interior's pixels erred by over 2 %. What a
    /// refinement changed says how far the estimate was off: half of that is the doubt about each of the two children,
    /// or a third of the doubt about their parent. A node is also refined if its doubt exceeds `doubt` times the error
    /// ratio.
    pub fn choose(&mut self, lit: &Lit<'_>, receiver: &Receiver<'_>, shadow_rays: &mut u64) {
        self.heap.clear();
        self.leaves.clear();
        self.slots.clear();
        self.total = DVec3::ZERO;
        self.size = lit.clusters.roots.len();
        for (root, start) in lit.clusters.roots.iter().enumerate() {
            let above = Above::default();
            let node = self.look(lit, receiver, start.node, root as u32, above, shadow_rays);
            self.put(lit, node);
        }
        let mut largest = self.total.max_element();
        while let Some(&top) = self.heap.peek() {
            let allowed = f64::from(lit.error_ratio) * self.total.max_element();
            if f64::from(top.error) <= allowed || self.len() >= lit.max_nodes {
                break;
            }
            self.heap.pop();
            self.total -= lit.estimate(top.node, top.term).as_dvec3();
            let Some(children) = lit.clusters.children(top.node) else {
                continue;
            };
            self.size += 1;
            if self.keep {
                self.slots[top.slot as usize].children = self.slots.len() as u32;
            }
            let representative = lit.clusters.nodes[top.node as usize].representative;
            let [mut a, mut b] = children.map(|child| {
                let shared = lit.clusters.nodes[child as usize].representative == representative;
                let above = Above {
                    known: shared.then_some(top.term),
                    hidden_by: top.term.hidden_by,
                };
                self.look(lit, receiver, child, top.root, above, shadow_rays)
            });
            let before = lit.estimate(top.node, top.term);
            let after = lit.estimate(a.node, a.term) + lit.estimate(b.node, b.term);
            let changed = (after - before).abs().max_element();
            let doubt = (0.5 * changed).max(top.doubt / FORGOTTEN);
            for child in [&mut a, &mut b] {
                if child.error > 0.0 {
                    child.doubt = doubt;
                    child.error = child.error.max(doubt / lit.doubt);
                }
            }
            self.put(lit, a);
            self.put(lit, b);
            let total = self.total.max_element();
            largest = largest.max(total);
            // Where a bright estimate has gone, its rounding is left: 1e-16 of it must not pass for light.
            if total < 1e-9 * largest {
                self.total = self
                    .nodes()
                    .map(|n| lit.estimate(n.node, n.term).as_dvec3())
                    .sum();
                largest = self.total.max_element();
            }
        }
        self.total = self
            .nodes()
            .map(|n| lit.estimate(n.node, n.term).as_dvec3())
            .sum();
    }

    /// A node's estimate and bound.
    fn look(
        &mut self,
        lit: &Lit<'_>,
        receiver: &Receiver<'_>,
        node: u32,
        root: u32,
        above: Above,
        shadow_rays: &mut u64,
    ) -> CutNode {
        let slot = self.slots.len() as u32;
        if self.keep {
            self.slots.push(Slot { node, children: 0 });
        }
        let mut looked = CutNode {
            error: 0.0,
            doubt: 0.0,
            node,
            root,
            slot,
            term: Term::DARK,
        };
        let leaf = lit.clusters.children(node).is_none();
        if !leaf {
            looked.error = receiver.node_bound(lit.clusters, node);
            // What can send nothing needs no ray.
            if looked.error <= 0.0 {
                return looked;
            }
        }
        let hidden = |by: Option<u32>| {
            by.is_some_and(|triangle| {
                let seen = receiver.sees(lit.clusters, node);
                hides(lit.scene, triangle, receiver.hit, &seen)
            })
        };
        if hidden(above.hidden_by) {
            looked.error = 0.0;
            return looked;
        }
        let representative = lit.clusters.nodes[node as usize].representative;
        looked.term = (above.known).unwrap_or_else(|| lit.term(representative, receiver, shadow_rays));
        if above.known.is_none() && !leaf && hidden(looked.term.hidden_by) {
            looked.error = 0.0;
        }
        looked
    }

    fn put(&mut self, lit: &Lit<'_>, node: CutNode) {
        self.total += lit.estimate(node.node, node.term).as_dvec3();
        if node.error > 0.0 {
            self.heap.push(node);
        } else if node.term.radiance != Vec3::ZERO {
            self.leaves.push(node);
        }
    }

    /// Nodes of the cut that may send something.
    pub fn nodes(&self) -> impl Iterator<Item = &CutNode> {
        self.leaves.iter().chain(self.heap.iter())
    }

    /// Size of the cut, with nodes that can send nothing.
    pub fn len(&self) -> usize {
        self.size
    }

    /// Calls `visit(root, radiance)` with the light of all nodes; virtual lights that stand alone are clamped.
    pub fn light(&self, lit: &Lit<'_>, mut visit: impl FnMut(u32, Vec3)) {
        let limit = clamp_limit(self.total.as_vec3(), lit.points.clamp);
        for n in self.nodes() {
            visit(n.root, lit.clamped(n.node, n.term, limit));
        }
    }
}
