//! From direct irradiance at the points to indirect vector irradiance at the finest points.
//!
//! Source: Lehtinen et al. 2008, section 4: e = P↑↓ E, i = S e, flattened to the finest level. The pull goes to
//! clusters (`relight_transport::senders`); further bounces are solved on one level of them before the one
//! product with T.

use crate::separated::{Separated, pair_of};
use glam::{Vec3, Vec3A};
use rayon::prelude::*;
use relight_render::irradiance::FOOTPRINT;
use relight_scene::separation::{self, Pair};
use relight_scene::surface::Surfaces;
use relight_transport::basis::Level;
use relight_transport::bounce::{self, Solve};
use relight_transport::factors::Factors;
use relight_transport::links::{Links, SenderLinks};
use relight_transport::pyramid::{LevelRanges, VectorIrradiance, fine_from_coarse, push};
use relight_transport::senders::SenderTree;
use relight_transport::sparse::{SparseMatrix, apply};
use std::sync::OnceLock;
use std::time::Instant;

/// Which levels of receivers make indirect light, to see what each adds; all else is what it always is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LevelPart {
    /// Those from the coarsest, 0, to this one.
    UpTo(usize),
    /// This one alone: its difference to the coarser ones. Below zero where they are too bright.
    Only(usize),
}

impl LevelPart {
    /// Whether a level is among them.
    pub fn has(self, level: usize) -> bool {
        match self {
            LevelPart::UpTo(last) => level <= last,
            LevelPart::Only(only) => level == only,
        }
    }
}

/// What lobes send of the first bounce, in place of links ([`crate::gloss`]).
#[derive(Clone, Debug, PartialEq)]
pub struct OverLobes {
    /// Vector irradiance at all receivers, as T has it.
    pub received: Vec<VectorIrradiance>,
    /// What of the finest points' radiosity it is that links do not take, W/m².
    pub sent: Vec<Vec3>,
}

impl OverLobes {
    /// Nothing, of as many receivers and points.
    pub fn nothing(like: &OverLobes) -> OverLobes {
        OverLobes {
            received: vec![VectorIrradiance::default(); like.received.len()],
            sent: vec![Vec3::ZERO; like.sent.len()],
        }
    }

    /// Memory that it takes.
    pub fn bytes(&self) -> usize {
        size_of_val(self.received.as_slice()) + size_of_val(self.sent.as_slice())
    }

    /// Adds that of another lamp, times its colour.
    pub fn add(&mut self, other: &OverLobes, color: Vec3) {
        add_vectors(&mut self.received, &other.received, color);
        for (sum, part) in self.sent.iter_mut().zip(&other.sent) {
            *sum += *part * color;
        }
    }

    /// What links take of radiosity at the finest points.
    fn rest(&self, radiosity: &[Vec3]) -> Vec<Vec3> {
        (radiosity.iter().zip(&self.sent))
            .map(|(all, sent)| *all - *sent)
            .collect()
    }
}

/// Operators and basis, ready to be applied frame after frame.
pub struct Transfer {
    /// The finest receiver level: the points that carry the result.
    pub finest: Level,
    /// Of each of its points, whether a surface separates it from a neighbour; empty where none does.
    pub near_separated: Vec<bool>,
    /// From which; found when it is first asked for.
    separated: OnceLock<Separated>,
    /// Found when it is first asked for.
    enclosed: OnceLock<Vec<f32>>,
    /// Reflectance at the finest points.
    pub albedo: Vec<Vec3>,
    ranges: LevelRanges,
    /// Of all points.
    positions: Vec<Vec3>,
    /// Of all points.
    normals: Vec<Vec3>,
    /// Radii of the disks of all points, m.
    radii: Vec<f32>,
    fine_from_coarse: SparseMatrix,
    /// Clusters of the finest points.
    pub senders: SenderTree,
    /// Surface that each of them has, m².
    pub sender_areas: Vec<f32>,
    /// How many of their levels, from the coarsest on, links lead to: the bake leaves the others out where nobody keeps them.
    pub linked_levels: usize,
    links: SenderLinks,
    bounce: SparseMatrix,
    bounce_level: usize,
    bounce_albedo: Vec<Vec3>,
    /// For each finest point its cluster on the bounce level.
    bounce_cluster: Vec<u32>,
    /// Bounces of indirect light; `None`: to convergence.
    bounces: Option<u32>,
    solution: Option<Solution>,
}

/// All bounces, solved by the bake.
struct Solution {
    level: usize,
    /// One matrix for all colours, or one each for red, green and blue.
    channels: Vec<SparseMatrix>,
    /// For each finest point its cluster on the level.
    cluster: Vec<u32>,
}

impl Solution {
    /// Irradiance from the first bounce on of each cluster.
    fn apply(&self, emitted: &[Vec3]) -> Vec<Vec3> {
        let mut out = apply(&self.channels[0], emitted);
        for (i, channel) in self.channels.iter().enumerate().skip(1) {
            for (out, own) in out.iter_mut().zip(apply(channel, emitted)) {
                out[i] = own[i];
            }
        }
        out
    }
}

/// What a frame's transfer cost and how it converged. Milliseconds.
#[derive(Clone, Copy, Debug, Default)]
pub struct TransferStats {
    /// Pull-push of the radiosity and the bounces.
    pub bounce_ms: f64,
    /// Product with T.
    pub transfer_ms: f64,
    /// Flattening to the finest level.
    pub flatten_ms: f64,
    /// Links that carried light.
    pub links_used: usize,
    /// The bounce iteration.
    pub solve: Solve,
}

impl TransferStats {
    /// The same, of a result that was there already.
    pub(crate) fn of_nothing_new(self) -> TransferStats {
        TransferStats {
            bounce_ms: 0.0,
            transfer_ms: 0.0,
            flatten_ms: 0.0,
            ..self
        }
    }
}

impl Transfer {
    /// Prepares the operators. `levels`: all receiver levels, coarsest first; `senders`: their clusters;
    /// `separated`: points and points of coarser levels that surfaces separate them from, numbered over all levels, ascending;
    /// `near_separated`: of each finest point, or empty;
    /// `albedo`: of the finest level's points; `bounce`: the flat operator on sender level `bounce_level`.
    pub fn new(
        mut levels: Vec<Level>,
        separated: &[[u32; 2]],
        near_separated: Vec<bool>,
        senders: SenderTree,
        albedo: Vec<Vec3>,
        links: &Links,
        bounce: SparseMatrix,
        bounce_level: usize,
        bounces: Option<u32>,
    ) -> Transfer {
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let positions = levels
            .iter()
            .flat_map(|level| level.positions.iter().copied())
            .collect();
        let normals = levels
            .iter()
            .flat_map(|level| level.normals.iter().copied())
            .collect();
        let radii = (levels.iter())
            .flat_map(|level| (0..level.len()).map(|point| level.disk_radius_of(point)))
            .collect();
        let fine_from_coarse = fine_from_coarse(&levels, |point, parent| {
            separated.binary_search(&[point, parent]).is_ok()
        });
        let bounce_cluster = senders.cluster_of_point(bounce_level);
        let bounce_albedo = senders.pulled(&albedo).swap_remove(bounce_level);
        let last = links.columns.iter().max().map_or(0, |&j| j as usize);
        let linked_levels = senders.ranges.level_of(last).max(bounce_level) + 1;
        let links = SenderLinks::new(links);
        let finest = levels.swap_remove(levels.len() - 1);
        let sender_areas = senders.sums(|point| FOOTPRINT * finest.disk_radius_of(point).powi(2));
        Transfer {
            finest,
            near_separated,
            separated: OnceLock::new(),
            enclosed: OnceLock::new(),
            albedo,
            ranges,
            positions,
            normals,
            radii,
            fine_from_coarse,
            senders,
            sender_areas,
            linked_levels,
            links,
            bounce,
            bounce_level,
            bounce_albedo,
            bounce_cluster,
            bounces,
            solution: None,
        }
    }

    /// Whether a surface separates a place (position and smooth normal) from a finest point.
    pub fn is_separated(&self, surfaces: &dyn Surfaces, place: (Vec3, Vec3), point: u32) -> bool {
        separation::are_separated(surfaces, &self.pair_of(place, point))
    }

    /// [`Transfer::is_separated`] of many places and points.
    pub fn each_separated(&self, surfaces: &dyn Surfaces, asked: &[((Vec3, Vec3), u32)]) -> Vec<bool> {
        let pairs: Vec<Pair> = (asked.iter())
            .map(|&(place, point)| self.pair_of(place, point))
            .collect();
        separation::each_separated(surfaces, &pairs)
    }

    /// A place of a surface that may be seen, and a finest point.
    fn pair_of(&self, place: (Vec3, Vec3), point: u32) -> Pair {
        pair_of(&self.finest, place, self.finest.disk_radius, point)
    }

    /// Which finest points walls separate from which others.
    pub(crate) fn separated(&self, surfaces: &dyn Surfaces) -> &Separated {
        (self.separated).get_or_init(|| Separated::find(surfaces, &self.finest, &self.near_separated))
    }

    /// Irradiance at the finest points over the radiosity that all surfaces send alike: how much of what each sees are surfaces, 0 to 1 but for what
    /// links leave out.
    pub(crate) fn enclosed(&self) -> &[f32] {
        self.enclosed.get_or_init(|| {
            let even = vec![Vec3::ONE; self.finest.len()];
            let values = self.one_bounce(&even, None, &mut TransferStats::default());
            (values.iter().zip(&self.finest.normals))
                .map(|(value, normal)| value.irradiance(*normal).x)
                .collect()
        })
    }

    /// Other reflectances at the finest points, one each. A baked solution keeps those that it was solved with.
    pub fn set_albedo(&mut self, albedo: Vec<Vec3>) {
        self.bounce_albedo = self.senders.pulled(&albedo).swap_remove(self.bounce_level);
        self.albedo = albedo;
    }

    /// Bounces come from a baked solution on sender level `level` from now on: one matrix, or one for red,
    /// green and blue each.
    pub fn use_solution(&mut self, level: usize, channels: Vec<SparseMatrix>) {
        self.solution = (!channels.is_empty()).then(|| Solution {
            level,
            channels,
            cluster: self.senders.cluster_of_point(level),
        });
    }

    /// Indirect vector irradiance at the finest points from direct irradiance there.
    ///
    /// The first bounce, which carries most of the light and all of its detail, is T's. Further bounces are
    /// solved on clusters from that, and all together sent once more through T.
    pub fn indirect_from_direct(&self, direct: &[Vec3]) -> (Vec<VectorIrradiance>, TransferStats) {
        self.indirect_with_lobes(direct, None)
    }

    /// [`Transfer::indirect_from_direct`] of direct light of whose first bounce some goes over lobes.
    pub fn indirect_with_lobes(
        &self,
        direct: &[Vec3],
        over_lobes: Option<&OverLobes>,
    ) -> (Vec<VectorIrradiance>, TransferStats) {
        let mut stats = TransferStats::default();
        let radiosity = self.radiosity_from_direct(direct, over_lobes, &mut stats);
        let values = self.one_bounce(&radiosity, over_lobes, &mut stats);
        (values, stats)
    }

    /// Radiosity of the finest points, W/m², whose one bounce, with `over_lobes`, is [`Transfer::indirect_with_lobes`].
    pub fn radiosity_from_direct(
        &self,
        direct: &[Vec3],
        over_lobes: Option<&OverLobes>,
        stats: &mut TransferStats,
    ) -> Vec<Vec3> {
        let mut radiosity = self.radiosity(direct);
        if self.bounces != Some(1) {
            let once = self.one_bounce(&radiosity, over_lobes, stats);
            let start = Instant::now();
            self.add_bounces(&mut radiosity, &once, stats);
            stats.bounce_ms += milliseconds(start);
        }
        radiosity
    }

    /// [`Transfer::indirect_from_direct`] with one product with T instead of two: all bounces but the last go from cluster to cluster.
    pub fn coarsely_from_direct(
        &self,
        direct: &[Vec3],
        over_lobes: Option<&OverLobes>,
    ) -> (Vec<VectorIrradiance>, TransferStats) {
        let mut stats = TransferStats::default();
        let mut radiosity = self.radiosity(direct);
        if self.bounces != Some(1) {
            let start = Instant::now();
            let further = self.bounces.map(|n| n.saturating_sub(1));
            let (irradiance, cluster_of_point) = self.bounced(&radiosity, further, &mut stats);
            for ((out, &cluster), &albedo) in radiosity.iter_mut().zip(cluster_of_point).zip(&self.albedo) {
                *out += irradiance[cluster as usize] * albedo;
            }
            stats.bounce_ms += milliseconds(start);
        }
        let values = self.one_bounce(&radiosity, over_lobes, &mut stats);
        (values, stats)
    }

    /// [`Transfer::indirect_from_direct`] in two parts that sum to it: the first bounce, and all further ones.
    pub fn first_and_further(
        &self,
        direct: &[Vec3],
    ) -> (Vec<VectorIrradiance>, Vec<VectorIrradiance>, TransferStats) {
        let mut stats = TransferStats::default();
        let first = self.one_bounce(&self.radiosity(direct), None, &mut stats);
        if self.bounces == Some(1) {
            let nothing = vec![VectorIrradiance::default(); first.len()];
            return (first, nothing, stats);
        }
        let start = Instant::now();
        let mut further = vec![Vec3::ZERO; first.len()];
        self.add_bounces(&mut further, &first, &mut stats);
        stats.bounce_ms += milliseconds(start);
        let further = self.one_bounce(&further, None, &mut stats);
        (first, further, stats)
    }

    /// Vector irradiance at the finest points that radiosity there causes: one bounce, T alone.
    pub fn of_radiosity(&self, radiosity: &[Vec3]) -> Vec<VectorIrradiance> {
        self.one_bounce(radiosity, None, &mut TransferStats::default())
    }

    /// [`Transfer::indirect_with_lobes`], of which the last bounce takes the links of some levels alone ([`LevelPart`]); all levels together
    /// are all of it.
    pub fn indirect_of_levels(
        &self,
        direct: &[Vec3],
        over_lobes: Option<&OverLobes>,
        part: LevelPart,
    ) -> (Vec<VectorIrradiance>, TransferStats) {
        let mut stats = TransferStats::default();
        let radiosity = self.radiosity_from_direct(direct, over_lobes, &mut stats);
        let mut values = self.at_receivers(&radiosity, over_lobes, &mut stats);
        for level in (0..self.ranges.levels()).filter(|level| !part.has(*level)) {
            values[self.ranges.range(level)].fill(VectorIrradiance::default());
        }
        (self.flattened(values), stats)
    }

    /// Senders and vectors of the links of a receiver, numbered over all levels.
    pub fn links_of(&self, receiver: usize) -> Vec<(u32, Vec3)> {
        self.links.of_receiver(receiver)
    }

    /// Senders and vectors of the links of each receiver, numbered over all levels.
    pub fn links(&self) -> Vec<Vec<(u32, Vec3)>> {
        self.links.rows()
    }

    /// Place of a receiver, numbered over all levels.
    pub fn position_of(&self, receiver: usize) -> Vec3 {
        self.positions[receiver]
    }

    /// Unit normal of a receiver, numbered over all levels.
    pub fn normal_of(&self, receiver: usize) -> Vec3 {
        self.normals[receiver]
    }

    /// Radius of a receiver's disk, m; receivers numbered over all levels.
    pub fn radius_of(&self, receiver: usize) -> f32 {
        self.radii[receiver]
    }

    /// The flat bounce operator, the sender level that it works on, and its clusters' reflectances.
    pub fn bounces(&self) -> (&SparseMatrix, usize, &[Vec3]) {
        (&self.bounce, self.bounce_level, &self.bounce_albedo)
    }

    /// The first bounce as a product of sparse matrices: pull, T, push and normals.
    pub fn factors(&self) -> Factors {
        Factors::new(
            &self.senders,
            &self.links,
            &self.normals,
            &self.ranges,
            &self.fine_from_coarse,
        )
    }

    /// For every point of every level the points of the next coarser level that predict it.
    pub fn parents(&self) -> (&SparseMatrix, &LevelRanges) {
        (&self.fine_from_coarse, &self.ranges)
    }

    /// What the finest points reflect of irradiance there.
    pub(crate) fn radiosity(&self, irradiance: &[Vec3]) -> Vec<Vec3> {
        (irradiance.iter().zip(&self.albedo))
            .map(|(e, a)| *e * *a)
            .collect()
    }

    /// Vector irradiance at the finest points that radiosity there causes by way of T, and in place of some of it `over_lobes`.
    fn one_bounce(
        &self,
        radiosity: &[Vec3],
        over_lobes: Option<&OverLobes>,
        stats: &mut TransferStats,
    ) -> Vec<VectorIrradiance> {
        let values = self.at_receivers(radiosity, over_lobes, stats);
        let start = Instant::now();
        let values = self.flattened(values);
        stats.flatten_ms += milliseconds(start);
        values
    }

    /// The same at the receivers of all levels, not flattened.
    fn at_receivers(
        &self,
        radiosity: &[Vec3],
        over_lobes: Option<&OverLobes>,
        stats: &mut TransferStats,
    ) -> Vec<VectorIrradiance> {
        let start = Instant::now();
        let pulled = match over_lobes {
            Some(over_lobes) => self.senders.pulled(&over_lobes.rest(radiosity)),
            None => self.senders.pulled(radiosity),
        };
        let coefficients = self.senders.coefficients(&pulled);
        stats.bounce_ms += milliseconds(start);
        let start = Instant::now();
        let (mut values, links_used) = self.links.apply(&coefficients);
        if let Some(over_lobes) = over_lobes {
            add_vectors(&mut values, &over_lobes.received, Vec3::ONE);
        }
        stats.links_used = links_used;
        stats.transfer_ms += milliseconds(start);
        values
    }

    /// Values of all levels at the finest points.
    fn flattened(&self, mut values: Vec<VectorIrradiance>) -> Vec<VectorIrradiance> {
        push(&mut values, &self.normals, &self.ranges, &self.fine_from_coarse);
        let range = self.ranges.range(self.ranges.levels() - 1);
        values.drain(..range.start);
        values
    }

    /// Adds what the first bounce, whose vector irradiance is `once`, and all further ones add to the radiosity
    /// at the finest points.
    fn add_bounces(&self, radiosity: &mut [Vec3], once: &[VectorIrradiance], stats: &mut TransferStats) {
        let reflected: Vec<Vec3> = (once.iter().zip(&self.finest.normals))
            .zip(&self.albedo)
            .map(|((e, &normal), &albedo)| e.irradiance(normal) * albedo)
            .collect();
        let further = self.bounces.map(|n| n.saturating_sub(2));
        let (irradiance, cluster_of_point) = self.bounced(&reflected, further, stats);
        for (i, out) in radiosity.iter_mut().enumerate() {
            *out += reflected[i] + irradiance[cluster_of_point[i] as usize] * self.albedo[i];
        }
    }

    /// Irradiance of all bounces, at most so many, of radiosity at the finest points: that of clusters, and of each finest point its
    /// cluster.
    fn bounced(
        &self,
        radiosity: &[Vec3],
        bounces: Option<u32>,
        stats: &mut TransferStats,
    ) -> (Vec<Vec3>, &[u32]) {
        let pulled = self.senders.pulled(radiosity);
        if let Some(solution) = &self.solution {
            return (solution.apply(&pulled[solution.level]), &solution.cluster);
        }
        let emitted = &pulled[self.bounce_level];
        let (irradiance, solve) = bounce::solve(&self.bounce, emitted, &self.bounce_albedo, bounces);
        stats.solve = solve;
        (irradiance, &self.bounce_cluster)
    }
}

/// Adds vector irradiance times a colour, place by place.
fn add_vectors(sum: &mut [VectorIrradiance], part: &[VectorIrradiance], color: Vec3) {
    let color = Vec3A::from(color);
    (sum.par_iter_mut().zip(part).with_min_len(4096)).for_each(|(sum, part)| {
        sum.x += part.x * color;
        sum.y += part.y * color;
        sum.z += part.z * color;
    });
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
