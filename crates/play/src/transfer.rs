//! From direct irradiance at the points to indirect vector irradiance at the finest points.
//!
//! Source: Lehtinen et al. 2008, section 4: e = P↑↓ E, i = S e, flattened to the finest level. The pull goes to
//! clusters (`relight_transport::senders`); further bounces are solved on one level of them before the one
//! product with T (design section 6).

use glam::Vec3;
use relight_transport::basis::Level;
use relight_transport::bounce::{self, Solve};
use relight_transport::links::{Links, SenderLinks};
use relight_transport::pyramid::{LevelRanges, VectorIrradiance, fine_from_coarse, push};
use relight_transport::senders::SenderTree;
use relight_transport::sparse::Rows;
use std::time::Instant;

/// Operators and basis, ready to be applied frame after frame.
pub struct Transfer {
    /// The finest receiver level: the points that carry the result.
    pub finest: Level,
    /// Reflectance at the finest points.
    pub albedo: Vec<Vec3>,
    ranges: LevelRanges,
    /// Normals of all points.
    normals: Vec<Vec3>,
    fine_from_coarse: Rows,
    /// Clusters of the finest points.
    pub senders: SenderTree,
    links: SenderLinks,
    bounce: Rows,
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
    channels: Vec<Rows>,
    /// For each finest point its cluster on the level.
    cluster: Vec<u32>,
}

impl Solution {
    /// Irradiance from the first bounce on of each cluster.
    fn apply(&self, emitted: &[Vec3]) -> Vec<Vec3> {
        let mut out = self.channels[0].apply(emitted);
        for (i, channel) in self.channels.iter().enumerate().skip(1) {
            for (out, own) in out.iter_mut().zip(channel.apply(emitted)) {
                out[i] = own[i];
            }
        }
        out
    }
}

/// What a frame's transfer cost and how it converged. Milliseconds.
#[derive(Clone, Copy, Debug)]
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

impl Transfer {
    /// Prepares the operators. `levels`: all receiver levels, coarsest first; `senders`: their clusters;
    /// `albedo`: of the finest level's points; `bounce`: the flat operator on sender level `bounce_level`.
    pub fn new(
        mut levels: Vec<Level>,
        senders: SenderTree,
        albedo: Vec<Vec3>,
        links: &Links,
        bounce: Rows,
        bounce_level: usize,
        bounces: Option<u32>,
    ) -> Transfer {
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let normals = levels
            .iter()
            .flat_map(|level| level.normals.iter().copied())
            .collect();
        let fine_from_coarse = fine_from_coarse(&levels);
        let bounce_cluster = senders.cluster_of_point(bounce_level);
        let bounce_albedo = senders.pulled(&albedo).swap_remove(bounce_level);
        let links = SenderLinks::new(links);
        let finest = levels.swap_remove(levels.len() - 1);
        Transfer {
            finest,
            albedo,
            ranges,
            normals,
            fine_from_coarse,
            senders,
            links,
            bounce,
            bounce_level,
            bounce_albedo,
            bounce_cluster,
            bounces,
            solution: None,
        }
    }

    /// Bounces come from a baked solution on sender level `level` from now on: one matrix, or one for red,
    /// green and blue each.
    pub fn use_solution(&mut self, level: usize, channels: Vec<Rows>) {
        self.solution = (!channels.is_empty()).then(|| Solution {
            level,
            channels,
            cluster: self.senders.cluster_of_point(level),
        });
    }

    /// Indirect vector irradiance at the finest points from direct irradiance there.
    pub fn indirect_from_direct(&self, direct: &[Vec3]) -> (Vec<VectorIrradiance>, TransferStats) {
        let start = Instant::now();
        let mut radiosity: Vec<Vec3> = direct.iter().zip(&self.albedo).map(|(e, a)| *e * *a).collect();
        let pulled = self.senders.pulled(&radiosity);
        let further = self.bounces.map(|n| n.saturating_sub(1));
        let (irradiance, cluster_of_point, solve) = match &self.solution {
            Some(solution) => {
                let solve = Solve {
                    iterations: 1,
                    residual: 0.0,
                };
                (solution.apply(&pulled[solution.level]), &solution.cluster, solve)
            }
            None => {
                let emitted = &pulled[self.bounce_level];
                let (irradiance, solve) = bounce::solve(&self.bounce, emitted, &self.bounce_albedo, further);
                (irradiance, &self.bounce_cluster, solve)
            }
        };
        for (out, (cluster, a)) in radiosity
            .iter_mut()
            .zip(cluster_of_point.iter().zip(&self.albedo))
        {
            *out += irradiance[*cluster as usize] * *a;
        }
        let coefficients = self.senders.coefficients(&self.senders.pulled(&radiosity));
        let bounce_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let (mut values, links_used) = self.links.apply(&coefficients);
        let transfer_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        push(&mut values, &self.normals, &self.ranges, &self.fine_from_coarse);
        let range = self.ranges.range(self.ranges.levels() - 1);
        values.drain(..range.start);
        let flatten_ms = start.elapsed().as_secs_f64() * 1e3;
        (
            values,
            TransferStats {
                bounce_ms,
                transfer_ms,
                flatten_ms,
                links_used,
                solve,
            },
        )
    }
}
