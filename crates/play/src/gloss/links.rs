//! What receivers get of what senders send over their lobes.

use super::clusters::{Clusters, NONE};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::pyramid::{VectorIrradiance, carry};
use relight_transport::sparse;

/// Length of links from which on the coefficients of siblings leave their mean to their parent exactly: what a hemisphere full of radiosity 1
/// sends. Where a row keeps all of a family but one small child, links are as much longer than that as the child is smaller than its family, and
/// cancel each other for coefficients whose weighted sum is zero alone. Of shorter ones the parent's own points say its mean.
const LONG: f32 = 1.0;

/// Of receivers of all levels, weights of senders: vector irradiance per radiosity that they send to that receiver beyond
/// what all of their surroundings are taken to send evenly.
///
/// Links are for senders that send the same all around: a receiver of a finer level has the difference of its links to those of the
/// coarser ones around it alone, W − Σ w W', since the coarser ones' light is passed on to it. What goes over lobes differs from
/// place to place, and what passes on is right only as far as the lobes at the coarser receiver are those at the finer one. Of
/// senders that are close to a receiver for its size finer receivers around it have weights of their own, W, and take
/// out of what is passed on what it has of them.
pub(super) struct LobeLinks {
    /// Per receiver, where its senders start, and after the last their end.
    starts: Vec<u32>,
    /// Per receiver, where those end that finer receivers around it have, too.
    split: Vec<u32>,
    senders: Vec<u32>,
    weights: Vec<Vec3>,
    raw: Vec<Vec3>,
}

/// A receiver's senders and their weights.
#[derive(Clone, Copy)]
pub(super) struct LobeRow<'a> {
    senders: &'a [u32],
    weights: &'a [Vec3],
    raw: &'a [Vec3],
    /// How many of the first ones finer receivers have, too.
    shared: usize,
}

impl LobeRow<'_> {
    /// Vector irradiance of what `sent` says that each sender sends here; `.1`: the part of it that finer receivers find by themselves.
    pub fn apply(&self, mut sent: impl FnMut(u32, Vec3) -> (Vec3, Vec3)) -> (VectorIrradiance, VectorIrradiance) {
        let mut part = |range: std::ops::Range<usize>, mut sum: VectorIrradiance| {
            for k in range {
                let (lobe, matt) = sent(self.senders[k], self.raw[k]);
                sum.add(self.weights[k], lobe.into());
                sum.add(self.raw[k], (-matt).into());
            }
            sum
        };
        let shared = part(0..self.shared, VectorIrradiance::default());
        (part(self.shared..self.senders.len(), shared), shared)
    }
}

impl LobeLinks {
    /// Those of a transfer's links to senders that are glossy.
    pub fn new(transfer: &Transfer, clusters: &Clusters, is_glossy: impl Fn(u32) -> bool + Sync) -> LobeLinks {
        let families = Families::new(transfer);
        let links = transfer.links();
        let (parents, ranges) = transfer.parents();
        let tree = Tree::new(transfer);
        let mut roots: Vec<u32> = (0..transfer.senders.ranges.total() as u32).collect();
        for level in 1..transfer.senders.levels() {
            let (above, own) = (transfer.senders.ranges.range(level - 1).start, transfer.senders.ranges.range(level).start);
            for (at, &parent) in transfer.senders.parents[level - 1].iter().enumerate() {
                roots[own + at] = roots[above + parent as usize];
            }
        }
        let mut all = LobeLinks {
            starts: vec![0],
            split: Vec::new(),
            senders: Vec::new(),
            weights: Vec::new(),
            raw: Vec::new(),
        };
        for level in 0..ranges.levels() {
            let is_finest = level + 1 == ranges.levels();
            let rows: Vec<(Vec<(u32, Vec3, Vec3)>, usize)> = (ranges.range(level).into_par_iter())
                .map(|receiver| {
                    let mut row: Vec<(u32, Vec3)> = Vec::new();
                    families.weights(&mut links.row(receiver).collect::<Vec<_>>(), &mut row);
                    let mut lobe: Vec<(u32, Vec3)> = Vec::new();
                    let mut parts = std::collections::BTreeMap::<u32, Vec<(u32, f32)>>::new();
                    let part_of = |parent: u32, is_complete: bool| -> Vec<(u32, f32)> {
                        let children = &tree.children[parent as usize];
                        let shares = || children.iter().map(|&k| (k, tree.share[k as usize])).collect::<Vec<_>>();
                        if is_complete { return shares(); }
                        let all: Vec<f32> = children.iter().map(|&k| geometric(transfer, clusters, k, receiver)).collect();
                        let sum: f32 = all.iter().sum();
                        if sum <= 0.0 { return shares(); }
                        children.iter().zip(all).map(|(&k, f)| (k, f / sum)).collect()
                    };
                    {
                        let mut own: Vec<(u32, Vec3)> = links.row(receiver).filter(|l| families.of[l.0 as usize] != NONE).collect();
                        own.sort_by_key(|link| families.of[link.0 as usize]);
                        for run in own.chunk_by(|a, b| families.of[a.0 as usize] == families.of[b.0 as usize]) {
                            let Family { parent, members } = &families.families[families.of[run[0].0 as usize] as usize];
                            lobe.extend_from_slice(run);
                            if *parent == NONE { continue; }
                            let sum: Vec3 = run.iter().map(|link| link.1).sum();
                            let part = part_of(*parent, run.len() + 1 >= members.len());
                            lobe.extend(part.iter().map(|&(k, f)| (k, -f * sum)));
                            parts.insert(*parent, part);
                        }
                    }
                    let normal = transfer.normal_of(receiver);
                    let mut partial: Vec<u32> = Vec::new();
                    for (parent, weight) in sparse::row(parents, receiver) {
                        let carried = carry(transfer.normal_of(parent as usize), normal) * weight;
                        let LobeRow { senders, raw, shared, weights } = all.row(parent as usize);
                        lobe.extend((senders.iter().zip(weights).take(shared)).map(|(&sender, &weight)| (sender, carried * weight)));
                        partial.extend(&senders[shared..]);
                        row.extend((senders.iter().zip(raw).take(shared)).map(|(&sender, &weight)| (sender, carried * weight)));
                    }
                    tree.open(&mut row, |node| part_of(node, true));
                    tree.open(&mut lobe, |node| parts.get(&node).cloned().unwrap_or_else(|| part_of(node, false)));
                    merge(&mut row);
                    partial.sort_unstable();
                    let mut above: Vec<u32> = partial.iter().flat_map(|&s| tree.ancestors(s)).collect();
                    above.sort_unstable();
                    let is_partial = |s: u32| partial.binary_search(&s).is_ok() || above.binary_search(&s).is_ok() || tree.ancestors(s).any(|a| partial.binary_search(&a).is_ok());
                    let least = var("LEASTW", LEAST);
                    row.retain(|&(sender, weight)| is_glossy(sender) && weight.length_squared() > least * least);
                    let is_shared = |&(sender, _): &(u32, Vec3)| !is_finest && is_close(transfer, clusters, sender, receiver);
                    row.sort_by_key(|entry| !is_shared(entry));
                    let shared = row.partition_point(is_shared);
                    let mut row: Vec<(u32, Vec3, Vec3)> = row.into_iter().map(|(sender, raw)| {
                        let full = !is_partial(sender);
                        let most = var("CLAMP", 1.25) * geometric(transfer, clusters, sender, receiver);
                        let own = lobe.binary_search_by_key(&sender, |e| e.0).map_or(Vec3::ZERO, |at| lobe[at].1);
                        let own = if var("PHI", 1.0) > 0.0 { own } else { raw };
                        let seen = own.dot(normal);
                        let used = match full {
                            _ if var("ZERO", 1.0) == 0.0 => own,
                            true if seen <= 0.0 => Vec3::ZERO,
                            _ if seen.abs() > most => own * (most / seen.abs()),
                            _ => own,
                        };
                        (sender, raw, used)
                    }).collect();
                    if var("RENORM", 1.0) > 0.0 {
                        let is_full = |e: &(u32, Vec3, Vec3)| !is_partial(e.0);
                        let mut sums = std::collections::BTreeMap::<u32, (f32, f32)>::new();
                        let group = |s: u32| if var("RENORM", 1.0) > 1.5 { roots[s as usize] } else { 0 };
                        for e in row.iter().filter(|e| is_full(e)) {
                            let sum = sums.entry(group(e.0)).or_default();
                            sum.0 += e.1.dot(normal);
                            sum.1 += e.2.dot(normal);
                        }
                        for e in row.iter_mut().filter(|e| is_full(e)) {
                            let (had, has) = sums[&group(e.0)];
                            let by = if has > 0.0 { (had / has).clamp(0.0, var("RMAX", 2.0)) } else { 1.0 };
                            e.2 *= by;
                        }
                    }
                    (row, shared)
                })
                .collect();
            for (row, shared) in rows {
                all.split.push((all.senders.len() + shared) as u32);
                all.senders.extend(row.iter().map(|entry| entry.0));
                all.raw.extend(row.iter().map(|entry| entry.1));
                all.weights.extend(row.iter().map(|entry| entry.2));
                all.starts.push(all.senders.len() as u32);
            }
        }
        if std::env::var("TIMES").is_ok() { eprintln!("lobe links {} receivers {}", all.senders.len(), ranges.total()); }
        all
    }

    /// How many receivers there are.
    pub fn receivers(&self) -> usize {
        self.split.len()
    }

    /// The senders of a receiver, numbered over all levels.
    pub fn row(&self, receiver: usize) -> LobeRow<'_> {
        let range = self.starts[receiver] as usize..self.starts[receiver + 1] as usize;
        LobeRow {
            shared: self.split[receiver] as usize - range.start,
            senders: &self.senders[range.clone()],
            weights: &self.weights[range.clone()],
            raw: &self.raw[range],
        }
    }
}

/// Part of full irradiance that a weight is to be worth.
const LEAST: f32 = 1e-3;

/// Radius of a receiver's disk over the distance of a sender from which on lobes are taken apart at finer receivers.
const CLOSE: f32 = 0.25;

fn is_close(transfer: &Transfer, clusters: &Clusters, sender: u32, receiver: usize) -> bool {
    let place = transfer.position_of(receiver);
    let reach = transfer.radius_of(receiver) / var("KAPPA", CLOSE);
    (clusters.samples_of(sender).iter())
        .any(|sample| transfer.finest.positions[sample.point as usize].distance_squared(place) < reach * reach)
}

struct Tree {
    parent: Vec<u32>,
    share: Vec<f32>,
    children: Vec<Vec<u32>>,
}

impl Tree {
    fn new(transfer: &Transfer) -> Tree {
        let senders = &transfer.senders;
        let n = senders.ranges.total();
        let (mut parent, mut children) = (vec![NONE; n], vec![Vec::new(); n]);
        for level in 1..senders.levels() {
            let (above, own) = (senders.ranges.range(level - 1).start, senders.ranges.range(level).start);
            for (at, &p) in senders.parents[level - 1].iter().enumerate() {
                parent[own + at] = (above + p as usize) as u32;
                children[above + p as usize].push((own + at) as u32);
            }
        }
        Tree { parent, share: senders.shares.clone(), children }
    }

    fn ancestors(&self, sender: u32) -> impl Iterator<Item = u32> + '_ {
        let up = |&s: &u32| Some(self.parent[s as usize]).filter(|&p| p != NONE);
        std::iter::successors(up(&sender), up)
    }

    /// Gives what ancestors of other senders have to their children.
    fn open(&self, row: &mut Vec<(u32, Vec3)>, part_of: impl Fn(u32) -> Vec<(u32, f32)>) {
        let mut map = std::collections::BTreeMap::<u32, Vec3>::new();
        for &(s, w) in row.iter() { *map.entry(s).or_default() += w; }
        let opened: std::collections::BTreeSet<u32> = map.keys().flat_map(|&s| self.ancestors(s)).collect();
        for node in opened {
            if let Some(w) = map.remove(&node) {
                for (k, part) in part_of(node) { *map.entry(k).or_default() += part * w; }
            }
        }
        row.clear();
        row.extend(map);
    }
}

fn geometric(transfer: &Transfer, clusters: &Clusters, sender: u32, receiver: usize) -> f32 {
    let (to, normal) = (transfer.position_of(receiver), transfer.normal_of(receiver));
    let radius = clusters.radius_of(sender);
    let count = 16;
    let mut sum = 0.0;
    for sample in clusters.samples_of(sender) {
        let (place, n) = (transfer.finest.positions[sample.point as usize], transfer.finest.normals[sample.point as usize]);
        let (a, b) = n.any_orthonormal_pair();
        for k in 0..count {
            let (u, v) = ((k as f32 + 0.5) / count as f32, k as f32 * 2.399_963);
            let way = place + radius * u.sqrt() * (a * v.cos() + b * v.sin()) - to;
            let square = way.length_squared();
            let (here, there) = (normal.dot(way), -n.dot(way));
            if here > 0.0 && there > 0.0 {
                sum += here * there * radius * radius / (square * square.max(radius * radius / count as f32));
            }
        }
    }
    (sum / count as f32).min(1.0)
}

/// Sums entries of the same sender; senders ascend.
fn merge(row: &mut Vec<(u32, Vec3)>) {
    row.sort_by_key(|entry| entry.0);
    row.dedup_by(|next, first| {
        let same = next.0 == first.0;
        if same {
            first.1 += next.1;
        }
        same
    });
}

/// Senders of one parent each, or one of the coarsest level; children without siblings, which have no coefficient, are in none.
struct Families {
    /// Of each sender its family, [`NONE`] if it has none.
    of: Vec<u32>,
    families: Vec<Family>,
}

struct Family {
    /// Parent, or [`NONE`].
    parent: u32,
    /// Senders and their parts of the parent.
    members: Vec<(u32, f32)>,
}

impl Families {
    fn new(transfer: &Transfer) -> Families {
        let senders = &transfer.senders;
        let alone = |sender: usize| Family {
            parent: NONE,
            members: vec![(sender as u32, 1.0)],
        };
        let mut families: Vec<Family> = senders.ranges.range(0).map(alone).collect();
        for level in 1..senders.levels() {
            let start = senders.ranges.range(level).start as u32;
            for (at, parent) in senders.ranges.range(level - 1).enumerate() {
                let children = senders.children(level - 1, at);
                if children.len() > 1 {
                    let member = |&child: &u32| (start + child, senders.shares[(start + child) as usize]);
                    families.push(Family {
                        parent: parent as u32,
                        members: children.iter().map(member).collect(),
                    });
                }
            }
        }
        let mut of = vec![NONE; senders.ranges.total()];
        for (at, family) in (0..).zip(&families) {
            for &(sender, _) in &family.members {
                of[sender as usize] = at;
            }
        }
        Families { of, families }
    }

    /// What a row's links make of what each sender sends: a link takes what its sender sends beyond its parent.
    fn weights(&self, links: &mut Vec<(u32, Vec3)>, row: &mut Vec<(u32, Vec3)>) {
        links.retain(|link| self.of[link.0 as usize] != NONE);
        links.sort_by_key(|link| self.of[link.0 as usize]);
        for run in links.chunk_by(|a, b| self.of[a.0 as usize] == self.of[b.0 as usize]) {
            let Family { parent, members } = &self.families[self.of[run[0].0 as usize] as usize];
            row.extend_from_slice(run);
            let sum: Vec3 = run.iter().map(|link| link.1).sum();
            let longest = run.iter().map(|link| link.1.length_squared()).fold(0.0, f32::max);
            if *parent == NONE {
                continue;
            }
            let long = var("LONG", 0.0);
            match longest > long * long {
                true => row.extend(members.iter().map(|&(member, share)| (member, -share * sum))),
                false => row.push((*parent, -sum)),
            }
        }
    }
}

pub(super) fn var(name: &'static str, or: f32) -> f32 {
    thread_local! { static C: std::cell::RefCell<std::collections::HashMap<&'static str, f32>> = Default::default(); }
    C.with(|c| *c.borrow_mut().entry(name).or_insert_with(|| std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(or)))
}
