//! Points that stand for clusters of points.

use super::disk::{Disk, Receiver};
use crate::transfer::Transfer;
use glam::DVec3;
use std::f32::consts::PI;
use std::ops::Range;

/// Points that stand for a cluster.
pub(super) const SAMPLES: usize = 4;

/// Where within its share of a cluster's weight the point lies that stands for it. About its middle; at the very middle, of points that weigh
/// the same, rounding would choose.
const MIDDLE: f64 = 0.518_034;

/// Part of the variance of the cluster's normals that each of its points stands for: as a kernel estimate of that many in two dimensions has it, n^(−1/3)
/// (Silverman 1986, equation 4.14).
const SILVERMAN: f32 = 0.63;

/// Places of a disk by which its form factor is taken from near by.
const PLACES: usize = 4;

/// Distance over its radius from which on its middle says as much: to within (r / d)², a part in sixteen.
const FAR: f32 = 4.0;

/// No number.
pub(super) const NONE: u32 = u32::MAX;

/// One of the points that stand for a cluster.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    /// Finest point.
    pub point: u32,
    /// The cluster of the next finer level around it, of the finest clusters they themselves.
    pub around: u32,
}

/// All senders, and the points that stand for them.
pub(super) struct Clusters {
    /// Where each sender's part of `samples` starts, and after the last its end; none where it has no points.
    starts: Vec<u32>,
    /// Of each sender, the radius of the surface that each of those stands for, m.
    radii: Vec<f32>,
    /// Of each sender, what the normals of that surface add to α² of its lobe.
    spreads: Vec<f32>,
    /// Points that stand for clusters, cluster by cluster.
    pub samples: Vec<Sample>,
}

impl Clusters {
    /// Those of all sender levels.
    pub fn new(transfer: &Transfer) -> Clusters {
        let senders = &transfer.senders;
        let mut starts = vec![0];
        let (mut radii, mut spreads, mut samples) = (Vec::new(), Vec::new(), Vec::new());
        for level in 0..senders.levels() {
            let range = senders.ranges.range(level);
            let mut found = vec![[NONE; SAMPLES]; range.len()];
            let mut weights = vec![0.0; range.len()];
            let mut normals = vec![DVec3::ZERO; range.len()];
            for (point, (cluster, weight)) in senders.point_weights(level).into_iter().enumerate() {
                let cluster = cluster as usize;
                // Whoever has the weight at the middle of a sample's share stands for it.
                let before: f64 = weights[cluster];
                weights[cluster] += weight;
                normals[cluster] += weight * transfer.finest.normals[point].as_dvec3();
                for (k, sample) in found[cluster].iter_mut().enumerate() {
                    let middle = (k as f64 + MIDDLE) / SAMPLES as f64;
                    if before <= middle && middle < weights[cluster] {
                        *sample = point as u32;
                    }
                }
            }
            // The finest clusters have none within: their own mean is that around all of their points.
            let around = (level + 1).min(senders.levels() - 1);
            let start = senders.ranges.range(around).start as u32;
            let cluster_of_point = senders.cluster_of_point(around);
            let around = |point: u32| start + cluster_of_point[point as usize];
            let areas = &transfer.sender_areas[range.clone()];
            for ((found, area), normal) in found.into_iter().zip(areas).zip(normals) {
                let points = found.into_iter().filter(|&point| point != NONE);
                samples.extend(points.map(|point| Sample {
                    point,
                    around: around(point),
                }));
                starts.push(samples.len() as u32);
                // The variance of normals is 1 − length², along both axes together.
                spreads.push((1.0 - normal.length_squared()).max(0.0) as f32 * SILVERMAN);
                radii.push((area / (PI * SAMPLES as f32)).sqrt());
            }
        }
        Clusters {
            starts,
            radii,
            spreads,
            samples,
        }
    }

    /// How many senders there are.
    pub fn len(&self) -> usize {
        self.radii.len()
    }

    /// Where in [`Clusters::samples`] the points are that stand for a sender.
    pub fn range_of(&self, sender: u32) -> Range<usize> {
        self.starts[sender as usize] as usize..self.starts[sender as usize + 1] as usize
    }

    /// The points that stand for a sender.
    pub fn samples_of(&self, sender: u32) -> &[Sample] {
        &self.samples[self.range_of(sender)]
    }

    /// What the normals of the surface that each of those stands for add to α² of its lobe.
    pub fn spread_of(&self, sender: u32) -> f32 {
        self.spreads[sender as usize]
    }

    /// Radius of the surface that each of those stands for, m.
    pub fn radius_of(&self, sender: u32) -> f32 {
        self.radii[sender as usize]
    }

    /// Irradiance of a receiver by radiosity 1 of a sender with nothing in the way.
    pub fn form_factor(&self, transfer: &Transfer, sender: u32, to: &Receiver) -> f32 {
        let of = |sample: &Sample| {
            let point = sample.point as usize;
            let disk = Disk {
                middle: transfer.finest.positions[point],
                normal: transfer.finest.normals[point],
                radius: self.radius_of(sender),
            };
            let is_far = disk.middle.distance_squared(to.place) > (FAR * disk.radius).powi(2);
            let parts = disk
                .places(if is_far { 1 } else { PLACES })
                .map(|(place, radius)| to.form_factor(place, disk.normal, radius));
            parts.sum::<f32>()
        };
        self.samples_of(sender).iter().map(of).sum()
    }
}
