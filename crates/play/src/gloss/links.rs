//! What receivers get of what senders send over their lobes.

use super::clusters::Clusters;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::pyramid::{VectorIrradiance, carry};
use relight_transport::senders::SenderTree;
use relight_transport::sparse;
use std::collections::{BTreeMap, BTreeSet};
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
    /// Those of a transfer's links to senders that are glossy. `is_glossy`: of all senders, whether something of them is.
    pub fn new(transfer: &Transfer, clusters: &Clusters, is_glossy: &[bool]) -> LobeLinks {
        let making = Making {
            transfer,
            clusters,
            is_glossy,
            senders: &transfer.senders,
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
    transfer: &'a Transfer,
    clusters: &'a Clusters,
    is_glossy: &'a [bool],
    senders: &'a SenderTree,
    /// Of each receiver.
    links: Vec<Row>,
}

impl Making<'_> {
    /// Weights of a receiver by its links and those that the coarser ones around it share with it; senders ascend.
    fn row(&self, receiver: usize, shared: &[Row]) -> Row {
        let parent_of = |link: &(u32, Vec3)| self.senders.ancestors(link.0).next();
        let (mut weights, mut opened) = (BTreeMap::new(), Vec::new());
        let is_of_use = |link: &(u32, Vec3)| self.is_glossy[parent_of(link).unwrap_or(link.0) as usize];
        let mut links: Row = self.links[receiver].iter().copied().filter(is_of_use).collect();
        // Of a level, those of one parent are not next to each other.
        links.sort_by_key(parent_of);
        for siblings in links.chunk_by(|a, b| parent_of(a) == parent_of(b)) {
            let Some(parent) = parent_of(&siblings[0]) else {
                add(&mut weights, siblings.iter().copied());
                continue;
            };
            // Children without siblings are their parents, and have no coefficient.
            if self.senders.children_of(parent).len() < 2 {
                continue;
            }
            add(&mut weights, siblings.iter().copied());
            // What the links give to some they do not take from the parent.
            let sum: Vec3 = siblings.iter().map(|link| link.1).sum();
            let parts = self.parts(parent, siblings, receiver);
            add(
                &mut weights,
                parts.iter().map(|&(child, part)| (child, -part * sum)),
            );
            opened.push((parent, parts));
        }
        let normal = self.transfer.normal_of(receiver);
        for (parent, weight) in sparse::row(self.transfer.parents().0, receiver) {
            let carried = carry(self.transfer.normal_of(parent as usize), normal) * weight;
            let shared = shared[parent as usize].iter();
            add(
                &mut weights,
                shared.map(|&(sender, weight)| (sender, carried * weight)),
            );
        }
        self.open(&mut weights, &opened, receiver);
        weights.retain(|&sender, _| self.is_glossy[sender as usize]);
        weights.into_iter().collect()
    }

    /// Bounds whole weights by what can be: nothing, and form factors. What a row has of each cluster of the coarsest level and those in it stays: links
    /// are right to within some per cent for what is alike all around, but which of them has it, they know less.
    /// `others`: senders that coarser receivers have by themselves, ascending; weights of these are differences.
    fn bound(&self, row: &mut Row, receiver: usize, others: &[u32]) {
        let is_other = |sender: u32| others.binary_search(&sender).is_ok();
        let mut above: Vec<u32> = others
            .iter()
            .flat_map(|&other| self.senders.ancestors(other))
            .collect();
        above.sort_unstable();
        let is_whole = |sender: u32| {
            !is_other(sender)
                && above.binary_search(&sender).is_err()
                && !self.senders.ancestors(sender).any(is_other)
        };
        let mut whole: Vec<&mut (u32, Vec3)> = row.iter_mut().filter(|entry| is_whole(entry.0)).collect();
        let normal = self.transfer.normal_of(receiver);
        let root = |sender: u32| self.senders.ancestors(sender).last().unwrap_or(sender);
        let mut sums: BTreeMap<u32, [f32; 2]> = BTreeMap::new();
        for (sender, weight) in &mut whole {
            let had = weight.dot(normal);
            let has = had.clamp(0.0, self.clusters.form_factor(self.transfer, *sender, receiver));
            *weight *= if had > 0.0 { has / had } else { 0.0 };
            let sum = sums.entry(root(*sender)).or_default();
            *sum = [sum[0] + had, sum[1] + has];
        }
        for (sender, weight) in whole {
            let [had, has] = sums[&root(*sender)];
            *weight *= if has > 0.0 {
                (had / has).clamp(0.0, MOST)
            } else {
                1.0
            };
        }
    }

    /// Gives the weights of clusters of which a row has descendants to their children; of `opened` ones, ascending, by the parts that they have.
    fn open(&self, weights: &mut BTreeMap<u32, Vec3>, opened: &[(u32, Vec<(u32, f32)>)], receiver: usize) {
        let above: BTreeSet<u32> = weights
            .keys()
            .flat_map(|&sender| self.senders.ancestors(sender))
            .collect();
        // Coarser ones have smaller numbers: what they give to their children goes on from there.
        for cluster in above {
            let Some(weight) = weights.remove(&cluster) else {
                continue;
            };
            let give = |&(child, part): &(u32, f32)| (child, part * weight);
            match opened.binary_search_by_key(&cluster, |entry| entry.0) {
                Ok(at) => add(weights, opened[at].1.iter().map(give)),
                Err(_) => add(weights, self.parts(cluster, &[], receiver).iter().map(give)),
            }
        }
    }

    /// A cluster's children, and which parts of what links leave of it they have. Those with `links` of their own have their shares of it, since links are for what
    /// they send beyond the others' mean; the rest is the others', by what the receiver sees of them, or by their shares if it sees none.
    fn parts(&self, cluster: u32, links: &[(u32, Vec3)], receiver: usize) -> Vec<(u32, f32)> {
        let has_link = |child: u32| links.iter().any(|link| link.0 == child);
        let children = self.senders.children_of(cluster);
        let share = |child: u32| self.senders.shares[child as usize];
        let seen: Vec<f32> = (children.clone())
            .map(|child| match has_link(child) {
                true => 0.0,
                false => self.clusters.form_factor(self.transfer, child, receiver),
            })
            .collect();
        let all: f32 = seen.iter().sum();
        let rest: f32 = children
            .clone()
            .filter(|&child| !has_link(child))
            .map(share)
            .sum();
        let part = |(child, seen): (u32, f32)| match has_link(child) || all <= 0.0 {
            true => (child, share(child)),
            false => (child, rest * seen / all),
        };
        children.zip(seen).map(part).collect()
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

/// Adds weights to those of the same senders.
fn add(weights: &mut BTreeMap<u32, Vec3>, more: impl Iterator<Item = (u32, Vec3)>) {
    for (sender, weight) in more {
        *weights.entry(sender).or_default() += weight;
    }
}
