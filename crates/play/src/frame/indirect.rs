//! Indirect light at the pixels: T and the bounces carry what the points receive to all others, and each fragment takes what
//! its points' functions say, or what its lobe sees.

use super::parts::Received;
use super::stats::{CutStats, FrameTimes, milliseconds};
use super::task::{Task, add};
use crate::cuts::illumination::Illumination;
use crate::cuts::shade::shade;
use crate::reconstruct;
use crate::shot::Functions;
use crate::transfer::{OverLobes, Transfer, TransferStats};
use glam::Vec3;
use rayon::prelude::*;
use relight_transport::pyramid::VectorIrradiance;
use std::f32::consts::PI;
use std::time::Instant;

/// Indirect light at the fragments, and how it was made.
pub(super) struct Indirect {
    pub radiance: Vec<Vec3>,
    pub transfer: Option<TransferStats>,
    pub cuts: Option<CutStats>,
}

impl Task<'_> {
    /// Indirect light at the fragments of what points and samples have received.
    pub fn indirect(&self, received: &Received, times: &mut FrameTimes) -> Indirect {
        let (shaded, cuts) = self.first_bounce(received, times).unzip();
        let operators = (self.prepared.transfer.as_ref())
            .zip(self.shot.functions.as_ref())
            .zip(received.points.as_ref());
        let (over_lobes, at_ends) = (received.over_lobes.as_ref(), received.at_ends.as_deref());
        let Some(((transfer, functions), received)) = operators else {
            let radiance = shaded.unwrap_or_else(|| vec![Vec3::ZERO; self.shot.seen.len()]);
            return Indirect {
                radiance,
                transfer: None,
                cuts,
            };
        };
        // Where nothing is glossy, transfer makes it all, in one sum.
        let glossy = shaded.filter(|_| {
            cuts.is_some_and(|cuts| cuts.shading.fragments > 0) && self.settings.levels.is_none()
        });
        let (radiance, stats) = match glossy {
            None => {
                let (mut radiance, stats) =
                    self.by_transfer(transfer, functions, (received, over_lobes), times);
                at_ends.iter().for_each(|at_ends| add(&mut radiance, at_ends));
                (radiance, stats)
            }
            Some(glossy) => self.by_transfer_beside(transfer, functions, received, glossy, times),
        };
        times.bounces += stats.bounce_ms;
        times.transfer += stats.transfer_ms;
        times.flatten += stats.flatten_ms;
        Indirect {
            radiance,
            transfer: Some(stats),
            cuts,
        }
    }

    /// All of it by transfer.
    fn by_transfer(
        &self,
        transfer: &Transfer,
        functions: &Functions,
        (received, over_lobes): (&[Vec3], Option<&OverLobes>),
        times: &mut FrameTimes,
    ) -> (Vec<Vec3>, TransferStats) {
        let (values, stats) = match self.settings.levels {
            None => {
                let last = &self.prepared.transferred;
                last.indirect_from_direct(
                    transfer,
                    self.shot.edition,
                    received,
                    over_lobes,
                    self.settings.coarse,
                )
            }
            Some(part) => {
                let (values, stats) = transfer.indirect_of_levels(received, over_lobes, part);
                (values.into(), stats)
            }
        };
        let start = Instant::now();
        let mut radiance = reflected(functions, &values);
        let indirect = (values.iter().zip(&transfer.finest.normals)).map(|(e, n)| e.irradiance(*n));
        (self.shot.reflections).add_to(&mut radiance, transfer, Some(received), indirect);
        times.reconstruct += milliseconds(start);
        (radiance, stats)
    }

    /// By transfer what visibility cuts have not made: the first bounce on what is matt, and all further ones. `glossy`: the
    /// first bounce on what is not.
    fn by_transfer_beside(
        &self,
        transfer: &Transfer,
        functions: &Functions,
        received: &[Vec3],
        glossy: Vec<Vec3>,
        times: &mut FrameTimes,
    ) -> (Vec<Vec3>, TransferStats) {
        let mut radiance = glossy;
        let (first, further, stats) = transfer.first_and_further(received);
        let start = Instant::now();
        add(&mut radiance, &reflected(functions, &further));
        for ((out, first), point) in radiance
            .iter_mut()
            .zip(reflected(functions, &first))
            .zip(&self.shot.seen.points)
        {
            if point.as_ref().is_some_and(|p| p.lambert) {
                *out += first;
            }
        }
        // The first bounce in lobes is the cuts'.
        let indirect = (first.iter().zip(&further).zip(&transfer.finest.normals))
            .map(|((first, further), n)| first.irradiance(*n) + further.irradiance(*n));
        (self.shot.reflections).add_to(&mut radiance, transfer, None, indirect);
        times.reconstruct += milliseconds(start);
        (radiance, stats)
    }

    /// The first bounce by visibility cuts, from irradiance at the surface samples: where transfer makes indirect
    /// light, too, only at fragments that are not matt.
    fn first_bounce(&self, received: &Received, times: &mut FrameTimes) -> Option<(Vec<Vec3>, CutStats)> {
        let (cuts, irradiance) = (self.prepared.cuts.as_ref()?, received.samples.as_ref()?);
        let (samples, sites) = (cuts.samples()?, self.shot.sites.as_ref()?);
        let start = Instant::now();
        let light = Illumination::of_samples(&samples.flux(irradiance), self.settings.illumination_cut);
        times.illumination_cut += milliseconds(start);
        let start = Instant::now();
        let shaded = shade(cuts, &light, &self.fragments(sites, !self.shot.transfers));
        times.shade += milliseconds(start);
        self.nodes.add(&shaded.nodes);
        let stats = CutStats {
            nodes: light.heights.len(),
            shading: shaded.stats,
        };
        Some((shaded.radiance, stats))
    }
}

/// What fragments reflect, like something matt, of the points' vector irradiance.
fn reflected(functions: &Functions, values: &[VectorIrradiance]) -> Vec<Vec3> {
    let irradiance = reconstruct::irradiance(&functions.weights, &functions.components, values);
    (irradiance
        .into_par_iter()
        .zip(&functions.albedo)
        .with_min_len(4096))
    .map(|(e, albedo)| e * *albedo / PI)
    .collect()
}
