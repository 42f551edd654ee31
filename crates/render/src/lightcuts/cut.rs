//! Choosing a lightcut: the clusters that stand for all lights at one point.
//!
//! Source: Walter et al. 2005, section 3, "Choosing lightcuts", and section 5 (clamping of virtual lights).

use super::hidden::hides;
use super::lit::{Lit, Receiver, Term};
use super::sights::{Sight, Sights};
use crate::many_lights::clamp_limit;
use glam::{DVec3, Vec3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

impl Lit<'_> {
    /// What a refinement changed says how far the estimate was off: half of that is the uncertainty of each of the two
    /// children, or a third of the uncertainty of their parent. Where [`Lit::mean_among`] will say how much of a node is seen,
    /// shadows make nothing uncertain.
    fn spread_uncertainty(&self, parent: &CutNode, a: &mut CutNode, b: &mut CutNode) {
        let change = |of: fn(Term) -> Vec3| {
            let [before, a, b] = [&*parent, a, b].map(|n| self.estimate(n.node, n.term.with(of(n.term))));
            0.5 * (a + b - before).abs().max_element()
        };
        let inherited = parent.uncertainty / FORGOTTEN;
        let open = change(|term| term.radiance).max(inherited);
        let closed = if a.sight.closed || b.sight.closed {
            change(|term| term.unshadowed).max(if parent.sight.closed { inherited } else { 0.0 })
        } else {
            0.0
        };
        for child in [a, b] {
            if child.error > 0.0 {
                let weight = if child.sight.closed { SEEN_UNCERTAINTY } else { 1.0 };
                child.uncertainty = if child.sight.closed { closed } else { open };
                child.error = child
                    .error
                    .max(weight * child.uncertainty / self.settings.uncertainty);
            }
        }
    }
}

/// A node of a cut.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CutNode {
    /// Upper bound of the error in the largest channel, or the uncertainty by as much as it counts more; 0 of single lights.
    pub error: f32,
    /// What the error may really be (see [`Cut::choose`]).
    uncertainty: f32,
    pub node: u32,
    /// Place among the roots.
    pub root: u32,
    sight: Sight,
    /// Place among those of [`Sights`].
    place: u32,
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
    /// Place among those of [`Sights`].
    place: u32,
    /// The representative's term, if they share it.
    known: Option<Term>,
    /// What hides the other's representative.
    hidden_by: Option<u32>,
}

/// How much the uncertainty of a node counts whose sight is closed: the mean over its parts errs by less.
const SEEN_UNCERTAINTY: f32 = 0.1;
/// What is left of the uncertainty of a node for its children, at least: less than the half that their light is, so that a
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
    /// shadows' edges cross many clusters they are not, and a sixth of an interior's pixels erred by over 2 %. So a node
    /// is also refined if its uncertainty ([`Lit::spread_uncertainty`]) exceeds `uncertainty` times the error ratio, and where few triangles
    /// lie between a cluster and the receiver (`sights`), they say how much of it is seen.
    pub fn choose(
        &mut self,
        lit: &Lit<'_>,
        receiver: &Receiver<'_>,
        sights: &mut Sights,
        shadow_rays: &mut u64,
    ) {
        self.heap.clear();
        self.leaves.clear();
        self.slots.clear();
        self.total = DVec3::ZERO;
        self.size = lit.clusters.roots.len();
        for (root, start) in lit.clusters.roots.iter().enumerate() {
            let above = Above {
                place: root as u32,
                ..Above::default()
            };
            let node = self.look(lit, receiver, sights, start.node, root as u32, above, shadow_rays);
            self.put(lit, node);
        }
        let mut largest = self.total.max_element();
        while let Some(&top) = self.heap.peek() {
            let allowed = f64::from(lit.settings.error_ratio) * self.total.max_element();
            if f64::from(top.error) <= allowed || self.len() >= lit.settings.max_nodes {
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
            let place = sights.children(top.place);
            let [mut a, mut b] = [(children[0], place), (children[1], place + 1)].map(|(child, place)| {
                let shared = lit.clusters.nodes[child as usize].representative == representative;
                let above = Above {
                    place,
                    known: shared.then_some(top.term),
                    hidden_by: top.term.hidden_by,
                };
                self.look(lit, receiver, sights, child, top.root, above, shadow_rays)
            });
            lit.spread_uncertainty(&top, &mut a, &mut b);
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
        self.look_closer(lit, receiver, sights, shadow_rays);
        self.total = self
            .nodes()
            .map(|n| lit.estimate(n.node, n.term).as_dvec3())
            .sum();
    }

    /// How much is seen of the nodes whose sight is closed.
    fn look_closer(
        &mut self,
        lit: &Lit<'_>,
        receiver: &Receiver<'_>,
        sights: &Sights,
        shadow_rays: &mut u64,
    ) {
        let mut nodes = std::mem::take(&mut self.heap).into_vec();
        for n in &mut nodes {
            if n.sight.closed {
                n.term.radiance = lit.mean_among(n.node, receiver, sights.parts(n.sight), shadow_rays);
            }
        }
        self.heap = nodes.into();
    }

    /// A node's estimate and bound.
    fn look(
        &mut self,
        lit: &Lit<'_>,
        receiver: &Receiver<'_>,
        sights: &mut Sights,
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
            uncertainty: 0.0,
            node,
            root,
            sight: Sight::OPEN,
            place: above.place,
            slot,
            term: Term::DARK,
        };
        let leaf = lit.clusters.children(node).is_none();
        if leaf && lit.clusters.nodes[node as usize].intensity == Vec3::ZERO {
            return looked;
        }
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
        looked.sight = sights.of(lit, above.place, node);
        looked.term = (above.known)
            .unwrap_or_else(|| lit.seen_from(representative, receiver, sights, looked.sight, shadow_rays));
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
