//! Building the trees bottom-up.

use super::cone::Cone;
use super::node::{ClusterNode, ENVELOPE_BITS, Envelope, LEAF, LightClusters, Root, type_of};
use crate::point_light::{Emission, PointLight};
use crate::random::Stream;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// How to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildSettings {
    /// Up to this many clusters are joined by exact search, which takes time with the square of the number.
    pub exact: usize,
    /// Neighbours on either side along the Morton curve among which partners of more clusters are sought.
    pub window: usize,
    /// Representatives of different seeds are independent.
    pub seed: u64,
}

impl Default for BuildSettings {
    /// 2048: beyond it the exact search of the last clusters takes longer than all rounds before it.
    fn default() -> Self {
        BuildSettings {
            exact: 2048,
            window: 16,
            seed: 0,
        }
    }
}

/// Stage of the random numbers that draw representatives.
const STAGE: u32 = 0x4c43;

/// Half of the widest half angle: its tangent is finite, and within 2e-4 of a half turn nothing is bounded anyway.
const MOST_QUARTER: f32 = std::f32::consts::FRAC_PI_2 - 1e-4;

/// A cluster on its way up.
#[derive(Clone, Copy)]
struct Cluster {
    low: Vec3,
    high: Vec3,
    cone: Cone,
    /// Share of the group's brightest light, or more for clusters.
    weight: f32,
    /// Index into [`Grower::nodes`].
    node: u32,
    intensity: DVec3,
}

/// Builds the trees of `lights`. `groups` has a group per light (empty: all are in group 0); trees hold lights of one
/// group and type. `scene_diagonal` in metres, of the scene's bounding box.
///
/// Results depend on the input alone, not on threads.
///
/// # Panics
/// `groups` is neither empty nor as long as `lights`, or there are 2³⁰ lights or more.
pub fn build(
    lights: &[PointLight],
    groups: &[u32],
    scene_diagonal: f32,
    settings: &BuildSettings,
) -> LightClusters {
    assert!(groups.is_empty() || groups.len() == lights.len());
    assert!(lights.len() < 1 << ENVELOPE_BITS);
    let key = |light: u32| {
        let group = groups.get(light as usize).copied().unwrap_or(0);
        (group, type_of(&lights[light as usize]))
    };
    let mut shining: Vec<u32> = (0..lights.len() as u32)
        .filter(|&i| lights[i as usize].intensity.max_element() > 0.0)
        .collect();
    shining.sort_by_key(|&light| key(light));
    let mut out = LightClusters::default();
    out.nodes.reserve_exact(2 * shining.len());
    for tree in shining.chunk_by(|&a, &b| key(a) == key(b)) {
        let (group, kind) = key(tree[0]);
        let mut grower = Grower::new(lights, kind, scene_diagonal, settings, tree);
        while grower.clusters.len() > settings.exact.max(2) {
            grower.round_in_window(settings.window.max(1));
        }
        grower.join_exactly();
        out.roots.push(Root {
            node: out.nodes.len() as u32,
            group,
        });
        grower.lay_out(kind, &mut out);
    }
    out
}

struct Grower<'a> {
    lights: &'a [PointLight],
    clusters: Vec<Cluster>,
    /// Leaves, then joined clusters; `children` is the left child.
    nodes: Vec<ClusterNode>,
    /// Right child of each node.
    right: Vec<u32>,
    /// c² in units of the scene's squared diagonal (see `unit`): 0 where axes don't count.
    c2: f32,
    /// One over the length in which boxes are measured: squares of any scene's size stay in range.
    unit: f32,
    seed: u64,
}

impl<'a> Grower<'a> {
    fn new(
        lights: &'a [PointLight],
        kind: u32,
        scene_diagonal: f32,
        settings: &BuildSettings,
        members: &[u32],
    ) -> Grower<'a> {
        let directed = kind == 1 || kind == 2;
        let place = |light: &PointLight| match light.emission {
            Emission::Directional => -light.axis,
            _ => light.position,
        };
        let strength = |light: &PointLight| light.intensity.as_dvec3().element_sum();
        let brightest = (members.iter())
            .map(|&i| strength(&lights[i as usize]))
            .fold(f64::MIN_POSITIVE, f64::max);
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &i in members {
            let place = place(&lights[i as usize]);
            (low, high) = (low.min(place), high.max(place));
        }
        // A light far outside the scene must not overflow.
        let length = f64::from(scene_diagonal).max((high.as_dvec3() - low.as_dvec3()).length());
        let unit = if kind != 3 && length > 0.0 && length.is_finite() {
            (1.0 / length) as f32
        } else {
            1.0
        };
        let mut coded: Vec<(u64, u32)> = (members.par_iter())
            .map(|&i| {
                let light = &lights[i as usize];
                let at = (place(light) - low) * unit;
                let axis = if directed { light.axis } else { Vec3::NEG_ONE };
                (morton(at, axis * 0.5 + 0.5), i)
            })
            .collect();
        coded.par_sort_unstable();
        let (mut clusters, mut nodes) = (Vec::with_capacity(members.len()), Vec::new());
        nodes.reserve_exact(2 * members.len() - 1);
        for &(_, i) in &coded {
            let light = &lights[i as usize];
            clusters.push(Cluster {
                low: place(light),
                high: place(light),
                cone: Cone {
                    axis: light.axis,
                    half: 0.0,
                },
                weight: (strength(light) / brightest) as f32,
                node: nodes.len() as u32,
                intensity: light.intensity.as_dvec3(),
            });
            nodes.push(ClusterNode {
                low: place(light),
                high: place(light),
                intensity: light.intensity,
                axis: light.axis,
                tan_quarter: 0.0,
                representative: i,
                children: LEAF,
                kind: 0,
            });
        }
        Grower {
            lights,
            right: vec![LEAF; nodes.len()],
            clusters,
            nodes,
            c2: if directed {
                // The scene's diagonal in the unit; its square.
                (scene_diagonal * unit).min(1.0).powi(2)
            } else {
                0.0
            },
            unit,
            seed: settings.seed,
        }
    }

    /// The paper's metric of two clusters joined, in units of the group; `most` ends the search for something smaller.
    fn cost(&self, a: &Cluster, b: &Cluster, most: f32) -> f32 {
        let weight = a.weight + b.weight;
        let extent = (a.high.max(b.high) - a.low.min(b.low)) * self.unit;
        let by_extent = weight * extent.length_squared();
        if self.c2 == 0.0 || by_extent > most {
            return by_extent;
        }
        let turned = 1.0 - a.cone.merged_half(&b.cone).cos();
        by_extent + weight * self.c2 * (turned * turned)
    }

    fn join(&mut self, a: &Cluster, b: &Cluster) -> Cluster {
        let node = self.nodes.len() as u32;
        let cone = if self.c2 == 0.0 {
            a.cone
        } else {
            a.cone.merged(&b.cone)
        };
        let intensity = a.intensity + b.intensity;
        let (ia, ib) = (a.intensity.element_sum(), b.intensity.element_sum());
        let random = f64::from(Stream::new(self.seed, STAGE, node.into()).uniform());
        let elder = if random * (ia + ib) < ia { a } else { b };
        let joined = Cluster {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
            cone,
            weight: a.weight + b.weight,
            node,
            intensity,
        };
        self.nodes.push(ClusterNode {
            low: joined.low,
            high: joined.high,
            intensity: intensity.as_vec3(),
            axis: cone.axis,
            tan_quarter: (0.5 * cone.half).min(MOST_QUARTER).tan(),
            representative: self.nodes[elder.node as usize].representative,
            children: a.node,
            kind: 0,
        });
        self.right.push(b.node);
        joined
    }

    /// Joins all clusters that are each other's best partners within a window along the curve.
    fn round_in_window(&mut self, window: usize) {
        let n = self.clusters.len();
        let clusters = &self.clusters;
        let mut partner: Vec<u32> = (0..n)
            .into_par_iter()
            .with_min_len(256)
            .map(|i| {
                let near = (i.saturating_sub(window)..i).chain(i + 1..(i + window + 1).min(n));
                self.best(clusters, i, near)
            })
            .collect();
        let mutual = (0..n)
            .filter(|&i| partner[partner[i] as usize] == i as u32)
            .count()
            / 2;
        // Where all want the same few dim partners, rounds would be many: then neighbours are joined.
        if mutual < n / 64 {
            partner = (0..n as u32).map(|i| (i ^ 1).min(n as u32 - 1)).collect();
        }
        let clusters = std::mem::take(&mut self.clusters);
        let mut next = Vec::with_capacity(n - mutual);
        for (i, cluster) in clusters.iter().enumerate() {
            let j = partner[i] as usize;
            if j == i || partner[j] as usize != i {
                next.push(*cluster);
            } else if i < j {
                next.push(self.join(cluster, &clusters[j]));
            }
        }
        self.clusters = next;
    }

    /// The best partner of `i`. Of equally good ones the one whose number differs in the lowest bits: that is mutual,
    /// and a thousand lights at one place are joined in ten rounds.
    fn best(&self, clusters: &[Cluster], i: usize, others: impl Iterator<Item = usize>) -> u32 {
        let (mut best, mut at) = (f32::INFINITY, usize::MAX);
        for j in others {
            // In the same order for both, so that both get the same number.
            let cost = self.cost(&clusters[i.min(j)], &clusters[i.max(j)], best);
            if cost < best || (cost == best && (i ^ j) < (i ^ at)) || at == usize::MAX {
                (best, at) = (cost, j);
            }
        }
        at as u32
    }

    /// Joins all clusters to one, every time all pairs that are each other's best partners among all.
    fn join_exactly(&mut self) {
        let mut slots = std::mem::take(&mut self.clusters);
        let mut alive: Vec<u32> = (0..slots.len() as u32).collect();
        let mut partner = vec![u32::MAX; slots.len()];
        let mut stale: Vec<u32> = alive.clone();
        while alive.len() > 1 {
            let found: Vec<(u32, u32)> = (stale.par_iter().with_min_len(16))
                .map(|&i| {
                    let others = alive.iter().map(|&j| j as usize).filter(|&j| j != i as usize);
                    (i, self.best(&slots, i as usize, others))
                })
                .collect();
            for (i, j) in found {
                partner[i as usize] = j;
            }
            let mut joined = vec![false; slots.len()];
            for &i in &alive {
                let j = partner[i as usize];
                if i < j && partner.get(j as usize) == Some(&i) {
                    let (a, b) = (slots[i as usize], slots[j as usize]);
                    slots[i as usize] = self.join(&a, &b);
                    (joined[i as usize], joined[j as usize]) = (true, true);
                    // Its slot is gone, but whoever had it as a partner has to see that it is.
                    partner[j as usize] = u32::MAX;
                }
            }
            // Rounding can make a metric fall and leave nobody's partner mutual: then all search anew.
            let none = !joined.iter().any(|&j| j);
            alive.retain(|&i| !(joined[i as usize] && partner[i as usize] == u32::MAX));
            stale = (alive.iter().copied())
                .filter(|&i| none || joined[i as usize] || joined[partner[i as usize] as usize])
                .collect();
        }
        if let Some(&last) = alive.first() {
            self.clusters = vec![slots[last as usize]];
        }
    }

    /// Appends the finished tree, siblings side by side.
    fn lay_out(&self, kind: u32, out: &mut LightClusters) {
        let Some(root) = self.clusters.first() else {
            return;
        };
        let put = |out: &mut LightClusters, node: u32| {
            out.nodes.push(ClusterNode {
                kind: kind << ENVELOPE_BITS,
                ..self.nodes[node as usize]
            });
        };
        let first = out.nodes.len();
        let mut from: Vec<u32> = vec![root.node];
        put(out, root.node);
        // Breadth first: `from` is the queue of old numbers.
        let mut at = 0;
        while at < from.len() {
            let old = from[at] as usize;
            let left = self.nodes[old].children;
            if left != LEAF {
                out.nodes[first + at].children = out.nodes.len() as u32;
                for child in [left, self.right[old]] {
                    put(out, child);
                    from.push(child);
                }
            }
            at += 1;
        }
        if kind == 2 {
            self.envelopes(first, out);
        }
    }

    /// Envelopes of spot lights, from the leaves up; children come after their parents.
    fn envelopes(&self, first: usize, out: &mut LightClusters) {
        let start = out.envelopes.len();
        let count = out.nodes.len() - first;
        let empty = Envelope {
            outer: 1.0,
            inner: 1.0,
        };
        out.envelopes.resize(start + count, empty);
        for i in (0..count).rev() {
            let node = out.nodes[first + i];
            out.envelopes[start + i] = match node.children {
                LEAF => match self.lights[node.representative as usize].emission {
                    Emission::Spot { scale, offset } => Envelope::of(scale, offset),
                    // Full from where it begins.
                    Emission::Measured { outer, .. } => Envelope { outer, inner: outer },
                    _ => empty,
                },
                children => {
                    let at = start + children as usize - first;
                    out.envelopes[at].around(out.envelopes[at + 1])
                }
            };
            out.nodes[first + i].kind |= (start + i) as u32;
        }
    }
}

/// Place on a curve through positions and axes: the upper 7 bits of all six numbers interleaved, below them the lower 7
/// of the positions. Equal steps of place (in scene diagonals) and axis cost about the same in the metric.
fn morton(at: Vec3, axis: Vec3) -> u64 {
    let bits = |v: f32, count: u32| {
        let most = (1u32 << count) - 1;
        ((v * (most as f32 + 1.0)) as u32).min(most)
    };
    let p = at.to_array().map(|v| bits(v, 14));
    let a = axis.to_array().map(|v| bits(v, 7));
    let mut code = 0u64;
    for bit in (0..7).rev() {
        for k in 0..3 {
            code = code << 1 | u64::from(p[k] >> (bit + 7) & 1);
        }
        for k in 0..3 {
            code = code << 1 | u64::from(a[k] >> bit & 1);
        }
    }
    for bit in (0..7).rev() {
        for k in 0..3 {
            code = code << 1 | u64::from(p[k] >> bit & 1);
        }
    }
    code
}
