//! What receivers get of what senders send over their lobes.

use super::clusters::Clusters;
use super::families::{Families, Family};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::links::Links;
use relight_transport::pyramid::{VectorIrradiance, carry};
use relight_transport::sparse;
use std::collections::BTreeMap;
use std::ops::Range;

/// Part of a row's weights that it may lose, the shortest first.
const LOST: f32 = 1.0 / 32.0;

/// The same as a part of what a hemisphere full of radiosity 1 sends: rows of fine receivers are small differences.
const LEAST: f32 = 1e-3;

/// Radius of a receiver's disk over the distance of a sender from which on finer receivers have it, too: the sender's directions change by
/// so many radians over the disk then, and half vectors by half of that.
const CLOSE: f32 = 0.25;

/// Most by which weights are lengthened so that their sum stays.
const MOST: f32 = 2.0;

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
            is_glossy: &is_glossy,
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
        // Of each receiver so far, weights of what it shares with finer ones.
        let mut shared: Vec<Row> = Vec::new();
        for level in 0..ranges.levels() {
            let is_finest = level + 1 == ranges.levels();
            let rows: Vec<(Row, Row, usize)> = (ranges.range(level).into_par_iter())
                .map(|receiver| {
                    let mut own = making.row(receiver, &shared);
                    own.retain(|entry| is_glossy(entry.0));
                    let mut row = own.clone();
                    making.bound(&mut row, receiver, &all.others(transfer, receiver));
                    shorten(&mut row);
                    let is_shared = |entry: &(u32, Vec3)| !is_finest && making.is_close(entry.0, receiver);
                    row.sort_by_cached_key(|entry| (!is_shared(entry), entry.0));
                    let count = row.partition_point(is_shared);
                    own.retain(is_shared);
                    (own, row, count)
                })
                .collect();
            for (own, row, count) in rows {
                all.splits.push((all.senders.len() + count) as u32);
                all.senders.extend(row.iter().map(|entry| entry.0));
                all.weights.extend(row.iter().map(|entry| entry.1));
                all.starts.push(all.senders.len() as u32);
                shared.push(own);
            }
        }
        all
    }

    /// Senders that the coarser receivers around one have and do not share with it, ascending.
    fn others(&self, transfer: &Transfer, receiver: usize) -> Vec<u32> {
        let parents = sparse::row(transfer.parents().0, receiver);
        let of = |(parent, _): (u32, f32)| self.senders[self.parts(parent as usize).1].iter().copied();
        let mut others: Vec<u32> = parents.flat_map(of).collect();
        others.sort_unstable();
        others
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
                    let (shared, from) = (&sums[parent as usize][0], transfer.normal_of(parent as usize));
                    // Mostly nothing: where nothing is glossy nearby.
                    if *shared != VectorIrradiance::default() {
                        received.add_carried(shared, from, normal, -weight);
                    }
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
    is_glossy: &'a (dyn Fn(u32) -> bool + Sync),
    transfer: &'a Transfer,
    clusters: &'a Clusters,
    families: Families,
    links: Links,
}

impl Making<'_> {
    /// Weights of a receiver by its links and those that the coarser ones around it share with it; senders ascend.
    fn row(&self, receiver: usize, shared: &[Row]) -> Row {
        let (mut row, mut opened) = (Row::new(), Vec::new());
        self.families
            .each_family(self.links.row(receiver), |family, run| {
                if !family.members.iter().any(|member| (self.is_glossy)(member.0)) {
                    return;
                }
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
            row.extend(
                shared[parent as usize]
                    .iter()
                    .map(|&(sender, weight)| (sender, carried * weight)),
            );
        }
        merge(&mut row);
        self.open(&mut row, opened, receiver);
        row
    }

    /// Bounds whole weights by what can be: nothing, and form factors. What a row has of each cluster of the coarsest level and those in it stays: links
    /// are right to within some per cent for what is alike all around, but which of them has it, they know less.
    /// `others`: senders that coarser receivers have by themselves, ascending; weights of these are differences.
    fn bound(&self, row: &mut Row, receiver: usize, others: &[u32]) {
        let is_other = |sender: u32| others.binary_search(&sender).is_ok();
        let mut above: Vec<u32> = others
            .iter()
            .flat_map(|&other| self.families.ancestors(other))
            .collect();
        above.sort_unstable();
        let is_whole = |sender: u32| {
            !is_other(sender)
                && above.binary_search(&sender).is_err()
                && !self.families.ancestors(sender).any(is_other)
        };
        let normal = self.transfer.normal_of(receiver);
        let root = |sender: u32| self.families.ancestors(sender).last().unwrap_or(sender);
        let mut sums: BTreeMap<u32, [f32; 2]> = BTreeMap::new();
        for (sender, weight) in row.iter_mut().filter(|entry| is_whole(entry.0)) {
            let had = weight.dot(normal);
            let has = had.clamp(0.0, self.clusters.form_factor(self.transfer, *sender, receiver));
            *weight *= if had > 0.0 { has / had } else { 0.0 };
            let sum = sums.entry(root(*sender)).or_default();
            *sum = [sum[0] + had, sum[1] + has];
        }
        for (sender, weight) in row.iter_mut().filter(|entry| is_whole(entry.0)) {
            let [had, has] = sums[&root(*sender)];
            *weight *= if has > 0.0 {
                (had / has).clamp(0.0, MOST)
            } else {
                1.0
            };
        }
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
            .map(|&(sender, own)| match has_link(sender) || all <= 0.0 {
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
        match sum > 0.0 {
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
        let reach = self.transfer.radius_of(receiver) / CLOSE;
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
    let most = (all * LOST).max(LEAST);
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
    row.iter_mut().for_each(|entry| entry.1 *= all / kept);
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
