//! Weights of glossy senders, row by row.

use super::clusters::Clusters;
use super::disk::Receiver;
use super::marks::{Marks, Sums};
use crate::transfer::Transfer;
use glam::Vec3;
use relight_transport::pyramid::carry;
use relight_transport::sparse;

/// Part of a row's weights that it may lose, the shortest first.
const LOST: f32 = 1.0 / 32.0;

/// The same as a part of what a hemisphere full of radiosity 1 sends: rows of fine receivers are small differences.
const LEAST: f32 = 1e-3;

/// Radius of a receiver's disk over the distance of a sender from which on finer receivers have it, too: the sender's directions change by
/// so many radians over the disk then, and half vectors by half of that.
const CLOSE: f32 = 0.25;

/// Most by which weights are lengthened so that their sum stays, and by which they are longer than what their receiver may see of the sender, where lobes count by them.
const MOST: f32 = 2.0;

/// Senders and their weights, ascending.
pub(super) type Row = Vec<(u32, Vec3)>;

/// What weights are made of.
pub(super) struct Making<'a> {
    transfer: &'a Transfer,
    clusters: &'a Clusters,
    is_glossy: &'a [bool],
    /// Of each receiver.
    links: Vec<Row>,
    /// Of each sender; `None` of the coarsest.
    parents: Vec<Option<u32>>,
}

/// What making a row takes, of all senders; to be used again.
pub(super) struct Buffers {
    weights: Sums,
    others: Marks,
    above: Marks,
    /// Of each coarsest sender, what those in it had and have.
    whole: Vec<[f32; 2]>,
}

impl Making<'_> {
    /// By a transfer's links. `is_glossy`: of all senders, whether something of them is.
    pub fn new<'a>(transfer: &'a Transfer, clusters: &'a Clusters, is_glossy: &'a [bool]) -> Making<'a> {
        Making {
            transfer,
            clusters,
            is_glossy,
            links: transfer.links(),
            parents: (0..clusters.len() as u32)
                .map(|sender| transfer.senders.parent_of(sender))
                .collect(),
        }
    }

    pub fn buffers(&self) -> Buffers {
        let senders = self.clusters.len();
        Buffers {
            weights: Sums::of(senders),
            others: Marks::of(senders),
            above: Marks::of(senders),
            whole: vec![[0.0; 2]; self.transfer.senders.ranges.range(0).len()],
        }
    }

    /// Weights of a receiver by its links and those that the coarser ones around it share with it.
    pub fn row(&self, receiver: usize, shared: &[Row], buffers: &mut Buffers) -> Row {
        let Buffers { weights, above, .. } = buffers;
        let mut opened = Vec::new();
        let parent_of = |link: &(u32, Vec3)| self.parents[link.0 as usize];
        let is_of_use = |link: &(u32, Vec3)| self.is_glossy[parent_of(link).unwrap_or(link.0) as usize];
        let mut links: Row = self.links[receiver].iter().copied().filter(is_of_use).collect();
        // Of a level, those of one parent are not next to each other.
        links.sort_by_key(parent_of);
        for siblings in links.chunk_by(|a, b| parent_of(a) == parent_of(b)) {
            let Some(parent) = parent_of(&siblings[0]) else {
                weights.add_all(siblings.iter().copied());
                continue;
            };
            // Children without siblings are their parents, and have no coefficient.
            if self.transfer.senders.children_of(parent).len() < 2 {
                continue;
            }
            weights.add_all(siblings.iter().copied());
            // What the links give to some they do not take from the parent.
            let sum: Vec3 = siblings.iter().map(|link| link.1).sum();
            let parts = self.parts(parent, siblings, receiver);
            weights.add_all(parts.iter().map(|&(child, part)| (child, -part * sum)));
            opened.push((parent, parts));
        }
        let normal = self.transfer.normal_of(receiver);
        for (parent, weight) in sparse::row(self.transfer.parents().0, receiver) {
            let carried = carry(self.transfer.normal_of(parent as usize), normal) * weight;
            let shared = shared[parent as usize].iter();
            weights.add_all(shared.map(|&(sender, weight)| (sender, carried * weight)));
        }
        self.open(weights, above, &opened, receiver);
        let mut row = weights.take();
        row.retain(|entry| self.is_glossy[entry.0 as usize]);
        row
    }

    /// Bounds whole weights by what can be: nothing, and form factors. What a row has of each cluster of the coarsest level and those in it stays: links
    /// are right to within some per cent for what is alike all around, but which of them has it, they know less. Leaves out the shortest.
    /// `others`: senders that coarser receivers have by themselves; weights of these are differences.
    pub fn bounded(
        &self,
        row: &Row,
        receiver: usize,
        others: impl Iterator<Item = u32>,
        buffers: &mut Buffers,
    ) -> Row {
        let Buffers {
            others: is_other,
            above,
            whole: sums,
            ..
        } = buffers;
        let mut row = row.clone();
        for other in others {
            if is_other.mark(other) {
                self.mark_above(other, above);
            }
        }
        let is_whole = |sender: u32| {
            let within_other = || self.ancestors(sender).any(|parent| is_other.has(parent));
            !is_other.has(sender) && !above.has(sender) && !within_other()
        };
        let mut whole: Vec<(u32, &mut (u32, Vec3))> = (row.iter_mut())
            .filter(|entry| is_whole(entry.0))
            .map(|entry| (self.ancestors(entry.0).last().unwrap_or(entry.0), entry))
            .collect();
        let to = Receiver::at(self.transfer, receiver);
        for (root, (sender, weight)) in &mut whole {
            let had = weight.dot(to.normal);
            let has = had.clamp(0.0, self.clusters.form_factor(self.transfer, *sender, &to));
            *weight *= if had > 0.0 { has / had } else { 0.0 };
            let sum = &mut sums[*root as usize];
            *sum = [sum[0] + had, sum[1] + has];
        }
        for (root, (_, weight)) in &mut whole {
            let [had, has] = sums[*root as usize];
            *weight *= if has > 0.0 {
                (had / has).clamp(0.0, MOST)
            } else {
                1.0
            };
        }
        for (root, _) in whole {
            sums[root as usize] = [0.0; 2];
        }
        is_other.clear();
        above.clear();
        shorten(&mut row);
        row
    }

    /// Gives the weights of clusters of which a row has descendants to their children; of `opened` ones, ascending, by the parts that they have.
    fn open(
        &self,
        weights: &mut Sums,
        above: &mut Marks,
        opened: &[(u32, Vec<(u32, f32)>)],
        receiver: usize,
    ) {
        for sender in weights.members() {
            self.mark_above(sender, above);
        }
        // Coarser ones have smaller numbers: what they give to their children goes on from there.
        for &cluster in above.ascending() {
            let Some(weight) = weights.remove(cluster) else {
                continue;
            };
            let give = |&(child, part): &(u32, f32)| (child, part * weight);
            match opened.binary_search_by_key(&cluster, |entry| entry.0) {
                Ok(at) => weights.add_all(opened[at].1.iter().map(give)),
                Err(_) => weights.add_all(self.parts(cluster, &[], receiver).iter().map(give)),
            }
        }
        above.clear();
    }

    fn ancestors(&self, sender: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(self.parents[sender as usize], |&parent| {
            self.parents[parent as usize]
        })
    }

    /// Marks a sender's ancestors. Of one that is marked all are.
    fn mark_above(&self, sender: u32, above: &mut Marks) {
        for parent in self.ancestors(sender) {
            if !above.mark(parent) {
                break;
            }
        }
    }

    /// A cluster's children, and which parts of what links leave of it they have. Those with `links` of their own have their shares of it, since links are for what
    /// they send beyond the others' mean; the rest is the others', by what the receiver sees of them, or by their shares if it sees none.
    fn parts(&self, cluster: u32, links: &[(u32, Vec3)], receiver: usize) -> Vec<(u32, f32)> {
        let has_link = |child: u32| links.iter().any(|link| link.0 == child);
        let children = self.transfer.senders.children_of(cluster);
        let share = |child: u32| self.transfer.senders.shares[child as usize];
        let to = Receiver::at(self.transfer, receiver);
        let seen: Vec<f32> = (children.clone())
            .map(|child| match has_link(child) {
                true => 0.0,
                false => self.clusters.form_factor(self.transfer, child, &to),
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

    /// The part of a weight that lobes count by: what the receiver may see of the sender, or where the weight takes light back, what those see
    /// of it that pass the light on; no more. The rest is what links take from one sender to give it to another: right for light that goes
    /// all ways alike, but lobes send a hundred times as much to where next to nothing of them is seen.
    pub fn part_over_lobes(&self, (sender, weight): (u32, Vec3), receiver: usize) -> f32 {
        let along = weight.dot(self.transfer.normal_of(receiver)).abs();
        let most = lobes_end(self.transfer, receiver, weight).map_or(0.0, |to| {
            MOST * self.clusters.form_factor(self.transfer, sender, &to)
        });
        if along > most { most / along } else { 1.0 }
    }

    /// Whether lobes of a sender differ over the disk of a receiver.
    pub fn is_close(&self, sender: u32, receiver: usize) -> bool {
        let place = self.transfer.position_of(receiver);
        let reach = self.transfer.radius_of(receiver) / CLOSE;
        let positions = &self.transfer.finest.positions;
        (self.clusters.samples_of(sender).iter())
            .any(|sample| positions[sample.point as usize].distance_squared(place) < reach * reach)
    }
}

/// Where lobes end that a weight of a receiver counts by: there, or if it takes light back, in the middle of those that pass the light on to the
/// receiver; `None` where none do.
pub(super) fn lobes_end(transfer: &Transfer, receiver: usize, weight: Vec3) -> Option<Receiver> {
    let here = Receiver::at(transfer, receiver);
    if weight.dot(here.normal) >= 0.0 {
        return Some(here);
    }
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for (parent, weight) in sparse::row(transfer.parents().0, receiver) {
        sum += transfer.position_of(parent as usize) * weight;
        weights += weight;
    }
    let place = sum / weights;
    (weights > 0.0).then_some(Receiver { place, ..here })
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
