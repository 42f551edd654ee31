//! From direct irradiance at the points to indirect vector irradiance at the finest points.
//!
//! Source: Lehtinen et al. 2008, section 4: e = P↑↓ E, i = S e, flattened to the finest level. Further
//! bounces are solved on a flat sender level before the one product with T (design section 6).

use glam::Vec3;
use relight_transport::basis::Level;
use relight_transport::bounce::{self, Solve};
use relight_transport::links::{Links, SenderLinks};
use relight_transport::pyramid::{LevelRanges, SenderPyramid, VectorIrradiance, fine_from_coarse, push};
use relight_transport::sparse::Rows;
use std::time::Instant;

/// Operators and basis, ready to be applied frame after frame.
pub struct Transfer {
    /// The finest receiver level: the points that carry the result.
    pub finest: Level,
    /// Reflectance at the finest points.
    pub albedo: Vec<Vec3>,
    ranges: LevelRanges,
    fine_from_coarse: Rows,
    senders: SenderPyramid,
    links: SenderLinks,
    bounce: Rows,
    bounce_level: usize,
    bounce_albedo: Vec<Vec3>,
    points_from_bounce: Rows,
    /// Bounces of indirect light; `None`: to convergence.
    bounces: Option<u32>,
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
    /// Prepares the operators. `levels`: all receiver levels, the first `sender_levels` of which send;
    /// `albedo`: of the finest level's points; `bounce`: the flat operator on sender level `bounce_level`.
    pub fn new(
        mut levels: Vec<Level>,
        sender_levels: usize,
        albedo: Vec<Vec3>,
        links: &Links,
        bounce: Rows,
        bounce_level: usize,
        bounces: Option<u32>,
    ) -> Transfer {
        let ranges = LevelRanges::new(levels.iter().map(Level::len));
        let fine_from_coarse = fine_from_coarse(&levels);
        let finest = &levels[levels.len() - 1];
        let at = |level: &Level| level.covering(&finest.positions, &finest.normals);
        let senders_at_points = at(&levels[sender_levels - 1]);
        let senders = SenderPyramid::new(&levels[..sender_levels], &senders_at_points, &finest.areas());
        let points_from_bounce = at(&levels[bounce_level]);
        let bounce_albedo = senders.pulled(&albedo).swap_remove(bounce_level);
        let links = SenderLinks::new(links);
        let finest = levels.swap_remove(levels.len() - 1);
        Transfer {
            finest,
            albedo,
            ranges,
            fine_from_coarse,
            senders,
            links,
            bounce,
            bounce_level,
            bounce_albedo,
            points_from_bounce,
            bounces,
        }
    }

    /// Indirect vector irradiance at the finest points from direct irradiance there.
    pub fn indirect_from_direct(&self, direct: &[Vec3]) -> (Vec<VectorIrradiance>, TransferStats) {
        let start = Instant::now();
        let mut radiosity: Vec<Vec3> = direct.iter().zip(&self.albedo).map(|(e, a)| *e * *a).collect();
        let pulled = self.senders.pulled(&radiosity);
        let further = self.bounces.map(|n| n.saturating_sub(1));
        let (irradiance, solve) = bounce::solve(
            &self.bounce,
            &pulled[self.bounce_level],
            &self.bounce_albedo,
            further,
        );
        let at_points = self.points_from_bounce.apply(&irradiance);
        for (out, (e, a)) in radiosity.iter_mut().zip(at_points.iter().zip(&self.albedo)) {
            *out += *e * *a;
        }
        let coefficients = self.senders.coefficients(&radiosity);
        let bounce_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let (mut values, links_used) = self.links.apply(&coefficients);
        let transfer_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        push(&mut values, &self.ranges, &self.fine_from_coarse);
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
