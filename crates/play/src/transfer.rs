//! From direct irradiance at the points to indirect vector irradiance at the finest points.
//!
//! Source: Lehtinen et al. 2008, section 4: e = P↑↓ E, i = S e, flattened to the finest level. Further
//! bounces are solved on a flat sender level before the one product with T (design section 6).

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
        let normals = levels.iter().flat_map(|level| level.normals.iter().copied()).collect();
        let fine_from_coarse = fine_from_coarse(&levels);
        let bounce_cluster = senders.cluster_of_point(bounce_level);
        let bounce_albedo = senders.pulled(&albedo).swap_remove(bounce_level);
        let links = SenderLinks::new(links);
        let finest = levels.swap_remove(levels.len() - 1);
        let finest = { let cf: f32 = std::env::var("CF").map_or(2.5, |v| v.parse().unwrap()); Level::new(finest.positions, finest.normals, finest.disk_radius, finest.disk_radius * cf) };
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

    /// Diagnostic.
    pub fn diagnose(&self) {
        let sums: Vec<f32> = (0..self.bounce.rows()).map(|i| self.bounce.row(i).iter().map(|e| e.1).sum()).collect();
        println!("  K row sums mean {} min {}", sums.iter().sum::<f32>() / sums.len() as f32, sums.iter().copied().fold(9.0, f32::min));
        let c = self.senders.coefficients(&self.senders.pulled(&vec![Vec3::ONE; self.albedo.len()]));
        let (mut v, _) = self.links.apply(&c);
        let mean = |v: &[VectorIrradiance], l: usize| -> f32 {
            let _ = l;
            v.iter().map(|v| v.irradiance(Vec3::X).x.powi(2) + v.irradiance(Vec3::Y).x.powi(2) + v.irradiance(Vec3::Z).x.powi(2)).map(f32::sqrt).sum::<f32>() / v.len() as f32
        };
        println!("  level 0 |V| {}", mean(&v[self.ranges.range(0)], 0));
        push(&mut v, &self.normals, &self.ranges, &self.fine_from_coarse);
        for l in 0..self.ranges.levels() { println!("  level {l} |V| {}", mean(&v[self.ranges.range(l)], l)); }
        let r = self.ranges.range(self.ranges.levels() - 1);
        let e: Vec<f32> = v[r].iter().zip(&self.finest.normals).map(|(v, n)| v.irradiance(*n).x).collect();
        println!("  finest n.V mean {} min {} max {}", e.iter().sum::<f32>() / e.len() as f32, e.iter().copied().fold(9.0, f32::min), e.iter().copied().fold(-9.0, f32::max));
        println!("  albedo mean {}", self.albedo.iter().sum::<Vec3>() / self.albedo.len() as f32);
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
        for (out, (cluster, a)) in radiosity.iter_mut().zip(cluster_of_point.iter().zip(&self.albedo)) {
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
