//! What receivers get of what senders send over their lobes.

use super::clusters::Clusters;
use super::weights::{Making, Row};
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::pyramid::VectorIrradiance;
use relight_transport::sparse;
use std::ops::Range;

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
    links: Vec<LobeLink>,
}

/// What a receiver gets of a sender.
#[derive(Clone, Copy)]
pub(super) struct LobeLink {
    pub sender: u32,
    /// Vector irradiance per radiosity.
    pub weight: Vec3,
    /// Part of it that lobes count by ([`Making::part_over_lobes`]).
    pub part_over_lobes: f32,
}

impl LobeLinks {
    /// Those of a transfer's links to senders that are glossy. `is_glossy`: of all senders, whether something of them is.
    pub fn new(transfer: &Transfer, clusters: &Clusters, is_glossy: &[bool]) -> LobeLinks {
        let making = Making::new(transfer, clusters, is_glossy);
        let (_, ranges) = transfer.parents();
        let mut all = LobeLinks {
            starts: vec![0],
            splits: Vec::new(),
            links: Vec::new(),
        };
        // Of each receiver so far, weights of what it shares with finer ones.
        let mut shared: Vec<Row> = Vec::new();
        for level in 0..ranges.levels() {
            let is_finest = level + 1 == ranges.levels();
            let rows: Vec<(Row, Vec<LobeLink>, usize)> = (ranges.range(level).into_par_iter())
                .with_min_len(64)
                .map_init(
                    || making.buffers(),
                    |buffers, receiver| {
                        let mut own = making.row(receiver, &shared, buffers);
                        let row = making.bounded(&own, receiver, all.others(transfer, receiver), buffers);
                        let is_shared =
                            |entry: &(u32, Vec3)| !is_finest && making.is_close(entry.0, receiver);
                        let (mut of_finer, of_itself): (Row, Row) = row.into_iter().partition(is_shared);
                        let count = of_finer.len();
                        of_finer.extend(of_itself);
                        own.retain(is_shared);
                        let link = |(sender, weight)| LobeLink {
                            sender,
                            weight,
                            part_over_lobes: making.part_over_lobes((sender, weight), receiver),
                        };
                        (own, of_finer.into_iter().map(link).collect(), count)
                    },
                )
                .collect();
            for (own, row, count) in rows {
                all.splits.push((all.links.len() + count) as u32);
                all.links.extend(row);
                all.starts.push(all.links.len() as u32);
                shared.push(own);
            }
        }
        all
    }

    /// Senders that the coarser receivers around one have and do not share with it; some more than once.
    fn others<'a>(&'a self, transfer: &'a Transfer, receiver: usize) -> impl Iterator<Item = u32> + 'a {
        let parents = sparse::row(transfer.parents().0, receiver);
        parents.flat_map(|(parent, _)| {
            self.links[self.parts(parent as usize).1]
                .iter()
                .map(|link| link.sender)
        })
    }

    /// Vector irradiance at all receivers, as T has it: beyond what the coarser ones around a receiver pass on to it.
    /// `sent(link, receiver)` is what the link's sender sends there, W/m².
    pub fn received(
        &self,
        transfer: &Transfer,
        sent: impl Fn(&LobeLink, usize) -> Vec3 + Sync,
    ) -> Vec<VectorIrradiance> {
        let sum = |receiver: usize, range: Range<usize>| {
            let mut sum = VectorIrradiance::default();
            for link in &self.links[range] {
                sum.add(link.weight, sent(link, receiver).into());
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
