//! What receivers get of what senders send over their lobes.

use super::clusters::Clusters;
use super::families::{Families, Family};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::links::Links;
use relight_transport::pyramid::{VectorIrradiance, carry};
use relight_transport::sparse;
use std::ops::Range;

/// Part of a row's weights that it may lose, the shortest first.
const LOST: f32 = 1.0 / 32.0;

/// The same as a part of what a hemisphere full of radiosity 1 sends: rows of fine receivers are small differences.
const LEAST: f32 = 1e-3;

/// Radius of a receiver's disk over the distance of a sender from which on finer receivers have it, too: the sender's directions change by
/// so many radians over the disk then, and half vectors by half of that.
const CLOSE: f32 = 0.25;

/// Of receivers of all levels, weights of glossy senders: vector irradiance per radiosity that they send to that very receiver.
///
/// T has differences, on both sides: a link is for what a cluster sends beyond its parent, to a receiver beyond what the coarser ones around
/// it get. That is for senders that send the same all around. Here a family of clusters that a row has links to takes the place of its
/// parent, each member with a weight of its own; and clusters that are close to a receiver for its size are close to finer receivers around
/// it, too, which have whole weights of them, the coarser ones' and the difference, and take out of what they are passed what the coarser ones had of
/// them ([`LobeLinks::received`]): lobes are not the same there.
pub(super) struct LobeLinks {
    /// Per receiver, where its senders start, and after the last their end.
    starts: Vec<u32>,
    /// Per receiver, where those of its senders end that finer receivers have, too.
    splits: Vec<u32>,
    senders: Vec<u32>,
    weights: Vec<Vec3>,
}

/// Senders and their weights.
type Row = Vec<(u32, Vec3)>;

impl LobeLinks {
    /// Those of a transfer's links to senders that are glossy.
    pub fn new(
        transfer: &Transfer,
        clusters: &Clusters,
        is_glossy: impl Fn(u32) -> bool + Sync,
    ) -> LobeLinks {
        let making = Making {
            transfer,
            clusters,
            families: Families::new(&transfer.senders),
            links: transfer.links(),
        };
        let (_, ranges) = transfer.parents();
        let mut all = LobeLinks {
            starts: vec![0],
            splits: Vec::new(),
            senders: Vec::new(),
            weights: Vec::new(),
        };
        for level in 0..ranges.levels() {
            let is_finest = level + 1 == ranges.levels();
            let rows: Vec<(Row, usize)> = (ranges.range(level).into_par_iter())
                .map(|receiver| {
                    let mut row = making.row(receiver, &all);
                    row.retain(|entry| is_glossy(entry.0));
                    shorten(&mut row);
                    let is_shared = |entry: &(u32, Vec3)| !is_finest && making.is_close(entry.0, receiver);
                    row.sort_by_cached_key(|entry| (!is_shared(entry), entry.0));
                    let shared = row.partition_point(is_shared);
                    (row, shared)
                })
                .collect();
            for (row, shared) in rows {
                all.splits.push((all.senders.len() + shared) as u32);
                all.senders.extend(row.iter().map(|entry| entry.0));
                all.weights.extend(row.iter().map(|entry| entry.1));
                all.starts.push(all.senders.len() as u32);
            }
        }
        all
    }

    /// Vector irradiance at all receivers, as T has it: beyond what the coarser ones around a receiver pass on to it.
    /// `sent(sender, receiver, weight)` is what a sender sends there, W/m².
    pub fn received(
        &self,
        transfer: &Transfer,
        sent: impl Fn(u32, usize, Vec3) -> Vec3 + Sync,
    ) -> Vec<VectorIrradiance> {
        let sum = |receiver: usize, range: Range<usize>| {
            let mut sum = VectorIrradiance::default();
            for (&sender, &weight) in self.senders[range.clone()].iter().zip(&self.weights[range]) {
                sum.add(weight, sent(sender, receiver, weight).into());
            }
            sum
        };
        let sums: Vec<[VectorIrradiance; 2]> = (0..self.splits.len())
            .into_par_iter()
            .with_min_len(64)
            .map(|receiver| {
                let (shared, own) = self.parts(receiver);
                [sum(receiver, shared), sum(receiver, own)]
            })
            .collect();
        let (parents, _) = transfer.parents();
        (sums.par_iter().with_min_len(1024).enumerate())
            .map(|(receiver, [shared, own])| {
                let normal = transfer.normal_of(receiver);
                let mut received = *own;
                received.add_scaled(shared, 1.0);
                for (parent, weight) in sparse::row(parents, receiver) {
                    let parent = parent as usize;
                    received.add_carried(&sums[parent][0], transfer.normal_of(parent), normal, -weight);
                }
                received
            })
            .collect()
    }

    /// Where a receiver's senders are that finer receivers have, too, and where its other ones.
    fn parts(&self, receiver: usize) -> (Range<usize>, Range<usize>) {
        let split = self.splits[receiver] as usize;
        (
            self.starts[receiver] as usize..split,
            split..self.starts[receiver + 1] as usize,
        )
    }
}

/// What weights are made of.
struct Making<'a> {
    transfer: &'a Transfer,
    clusters: &'a Clusters,
    families: Families,
    links: Links,
}

impl Making<'_> {
    /// Weights of a receiver by its links and those that the coarser ones around it share with it; senders ascend.
    fn row(&self, receiver: usize, coarser: &LobeLinks) -> Row {
        let (mut row, mut opened) = (Row::new(), Vec::new());
        self.families
            .each_family(self.links.row(receiver), |family, run| {
                row.extend_from_slice(run);
                if let Some(parent) = family.parent {
                    // What the links give to the members they do not take from the parent.
                    let sum: Vec3 = run.iter().map(|link| link.1).sum();
                    let parts = self.parts_beside(family, run, receiver);
                    row.extend(
                        (family.members.iter().zip(&parts)).map(|(member, part)| (member.0, -*part * sum)),
                    );
                    opened.push((parent, parts));
                }
            });
        let normal = self.transfer.normal_of(receiver);
        for (parent, weight) in sparse::row(self.transfer.parents().0, receiver) {
            let carried = carry(self.transfer.normal_of(parent as usize), normal) * weight;
            let (shared, _) = coarser.parts(parent as usize);
            let weights = coarser.weights[shared.clone()]
                .iter()
                .map(|&weight| carried * weight);
            row.extend(coarser.senders[shared].iter().copied().zip(weights));
        }
        merge(&mut row);
        self.open(&mut row, opened, receiver);
        row
    }

    /// Gives the weights of clusters of which a row has descendants to their children.
    fn open(&self, row: &mut Row, mut parts_of: Vec<(u32, Vec<f32>)>, receiver: usize) {
        parts_of.sort_by_key(|entry| entry.0);
        let mut above: Vec<u32> = row
            .iter()
            .flat_map(|entry| self.families.ancestors(entry.0))
            .collect();
        above.sort_unstable();
        above.dedup();
        // Coarser ones have smaller numbers: what they give to their children goes on from there.
        for cluster in above {
            let Ok(at) = row.binary_search_by_key(&cluster, |entry| entry.0) else {
                continue;
            };
            let weight = row.remove(at).1;
            let children = self.families.children(cluster);
            let known = parts_of.binary_search_by_key(&cluster, |entry| entry.0);
            let parts = match known {
                Ok(at) => std::mem::take(&mut parts_of[at].1),
                Err(_) => self.parts(cluster, receiver),
            };
            row.extend(
                children
                    .iter()
                    .zip(parts)
                    .map(|(&child, part)| (child, part * weight)),
            );
            merge(row);
        }
    }

    /// Which parts of what is left of a family's parent its members have: those with links of their own their shares of it, since links are for what
    /// their members send beyond the others' mean; what is left of it is the others', by what a receiver sees of them.
    fn parts_beside(&self, family: &Family, links: &[(u32, Vec3)], receiver: usize) -> Vec<f32> {
        let has_link = |sender: u32| links.iter().any(|link| link.0 == sender);
        let others = || family.members.iter().filter(|member| !has_link(member.0));
        let share: f32 = others().map(|member| member.1).sum();
        let seen = |sender: u32| self.clusters.form_factor(self.transfer, sender, receiver);
        let all: f32 = others().map(|member| seen(member.0)).sum();
        (family.members.iter())
            .map(|&(sender, own)| match has_link(sender) || all <= 0.0 || var("SHARE", 0.0) > 0.0 {
                true => own,
                false => share * seen(sender) / all,
            })
            .collect()
    }

    /// Which part of what a cluster sends to a receiver is each of its children's, if nothing is in the way and all send the same; by their
    /// shares of the cluster where it sees none.
    fn parts(&self, cluster: u32, receiver: usize) -> Vec<f32> {
        let children = self.families.children(cluster);
        let seen: Vec<f32> = children
            .iter()
            .map(|&child| self.clusters.form_factor(self.transfer, child, receiver))
            .collect();
        let sum: f32 = seen.iter().sum();
        match sum > 0.0 && var("SHARE", 0.0) == 0.0 {
            true => seen.iter().map(|seen| seen / sum).collect(),
            false => children
                .iter()
                .map(|&child| self.transfer.senders.shares[child as usize])
                .collect(),
        }
    }

    /// Whether lobes of a sender differ over the disk of a receiver.
    fn is_close(&self, sender: u32, receiver: usize) -> bool {
        let place = self.transfer.position_of(receiver);
        let reach = self.transfer.radius_of(receiver) / var("KAPPA", CLOSE);
        let positions = &self.transfer.finest.positions;
        (self.clusters.samples_of(sender).iter())
            .any(|sample| positions[sample.point as usize].distance_squared(place) < reach * reach)
    }
}

/// Leaves out the shortest weights, which together are next to nothing, and gives theirs to the others: light that goes elsewhere over lobes
/// than to this receiver would seem to reach it from what was left out, as if that were matt.
fn shorten(row: &mut Row) {
    let mut lengths: Vec<f32> = row.iter().map(|entry| entry.1.length()).collect();
    lengths.sort_by(f32::total_cmp);
    let all: f32 = lengths.iter().sum();
    let most = (all * var("LOST", LOST)).max(var("LEASTW", LEAST));
    let mut lost = 0.0;
    let least = lengths.iter().find(|&&length| {
        lost += length;
        lost > most
    });
    let Some(&least) = least else {
        return row.clear();
    };
    row.retain(|entry| entry.1.length() >= least);
    let kept: f32 = row.iter().map(|entry| entry.1.length()).sum();
    row.iter_mut().for_each(|entry| entry.1 *= if var("COMP", 1.0) > 0.0 { all / kept } else { 1.0 });
}

/// Sums entries of the same sender; senders ascend.
fn merge(row: &mut Row) {
    row.sort_by_key(|entry| entry.0);
    row.dedup_by(|next, first| {
        let same = next.0 == first.0;
        if same {
            first.1 += next.1;
        }
        same
    });
}

pub(super) fn var(name: &'static str, or: f32) -> f32 {
    thread_local! { static C: std::cell::RefCell<std::collections::HashMap<&'static str, f32>> = Default::default(); }
    C.with(|c| *c.borrow_mut().entry(name).or_insert_with(|| std::env::var(name).ok().and_then(|s| s.parse().ok()).unwrap_or(or)))
}
