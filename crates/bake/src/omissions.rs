//! What of points and operators is left out, why, and what that saved.
//!
//! Bytes are estimates after compression; rays are those that were not cast, counted or, where nothing was traced that
//! could be counted, left at none.

use crate::left_out::{note, plural};
use crate::links::operators::Transport;
use crate::links::refinement::{Spared, is_pursued};
use crate::params::{BakeParams, Omittable};
use crate::points::coverage::Coverage;
use relight_format::LeftOut;

/// Bytes that a point takes on disk, about (docs/notebook/format.md).
const POINT_BYTES: f64 = 10.0;
/// Bytes of a link of T, about (docs/notebook/transfer.md).
const LINK_BYTES: f64 = 5.2;
/// Bytes that shorter mantissas save of it: a byte for the high bits, half of which compresses away (docs/notebook/report.md).
const SHORT_BYTES: f64 = 0.6;
/// Entries in a row of the bounce operator and bytes of each, about (docs/notebook/stability.md, docs/notebook/format.md).
const BOUNCE_ENTRIES: f64 = 150.0;
const BOUNCE_BYTES: f64 = 3.0;
/// Bytes of a cluster in the tree of senders, about (docs/notebook/format.md).
const CLUSTER_BYTES: f64 = 0.5;
/// Bytes of an element of a cut, about (docs/notebook/format.md), and elements of one.
const CUT_BYTES: f64 = 0.3;
const CUT_ELEMENTS: f64 = 400.0;
/// Rays of a cut's site, about (docs/notebook/cuts.md).
const CUT_RAYS: u64 = 2400;
/// Bytes of two channels of albedo, each the same as the first, after compression and before.
const CHANNEL_BYTES: f64 = 3.0;
/// Share of the surface below which nothing is said: samples on rims miss now and then.
const NEGLIGIBLE: f64 = 0.002;

/// A list of what was left out, and the rays that some of it saved.
#[derive(Debug, Default)]
pub struct Omissions {
    /// The list.
    pub list: Vec<LeftOut>,
    /// Index in the list, and rays.
    pub rays: Vec<(usize, u64)>,
}

impl Omissions {
    fn add(&mut self, what: String, why: &str, bytes: f64, rays: u64) {
        if rays > 0 {
            self.rays.push((self.list.len(), rays));
        }
        note(&mut self.list, what, why, bytes.max(0.0) as usize);
    }

    /// The rays as counts of provenance: `saved_rays_i` of entry i.
    pub fn counts(&self) -> Vec<(String, u64)> {
        (self.rays.iter())
            .map(|(i, rays)| (format!("saved_rays_{i}"), *rays))
            .collect()
    }

    /// Surfaces without points.
    pub fn unreached(&mut self, covered: Coverage, points: usize) {
        let Coverage { area, uncovered } = covered;
        if uncovered <= NEGLIGIBLE * area {
            return;
        }
        let per_area = points as f64 / (area - uncovered).max(f64::MIN_POSITIVE);
        self.add(
            format!("points on {:.1} % of the surface", 100.0 * uncovered / area),
            "no light path leads from there to the viewpoints; --viewpoint adds places that can be seen, --keep points \
             all surfaces",
            per_area * uncovered * POINT_BYTES,
            0,
        );
    }

    /// What the operators lack.
    pub fn of_operators(&mut self, made: &Transport, params: &BakeParams) {
        let Transport {
            dropped,
            spared,
            idle_senders: (idle_levels, idle_clusters),
            ..
        } = *made;
        let Spared {
            weak,
            weak_rays,
            unwanted,
            unwanted_rays,
        } = spared;
        let (gathered, links) = (made.gathered.iter().sum::<usize>(), made.links.columns.len());
        let per_receiver = links as f64 / gathered.max(1) as f64 * LINK_BYTES;
        if dropped > 0 {
            self.add(
                format!("{} below significance", plural(dropped as usize, "link")),
                match is_pursued(made.points.levels.len().saturating_sub(1), params.epsilon) {
                    true => {
                        "lights change too little by them (--epsilon); the coarse links that stay make up for their light in \
                         the mean, not for where it falls; a smaller --epsilon keeps more"
                    }
                    false => {
                        "weaker than --epsilon; what they carry went to their neighbours; a smaller --epsilon keeps more"
                    }
                },
                dropped as f64 * LINK_BYTES,
                0,
            );
        }
        if weak > 0 {
            self.add(
                format!("gathers at {}", plural(weak as usize, "receiver")),
                "coarser receivers there keep no link, so none would be above --epsilon; a smaller --epsilon keeps more",
                0.0,
                weak_rays,
            );
        }
        if unwanted > 0 {
            self.add(
                format!("gathers at {}", plural(unwanted as usize, "receiver")),
                "no camera sees them (--cameras-only); bake without --cameras-only to keep them",
                unwanted as f64 * per_receiver,
                unwanted_rays,
            );
        }
        if idle_levels > 0 {
            self.add(
                plural(idle_levels, "sender level"),
                "no link leads to its clusters; --keep senders keeps it",
                idle_clusters as f64 * CLUSTER_BYTES,
                0,
            );
        }
        let clusters = made.bounce.rows();
        let (why, given) = match (params.needs_bounces(), params.solution) {
            (false, _) => (
                "of two bounces at most none is left to solve (--bounces); --keep bounces keeps it",
                true,
            ),
            (true, true) => (
                "the solution takes its place (--solution); bake without --solution to keep it",
                true,
            ),
            (true, false) => ("", false),
        };
        if given && !made.links.is_empty() {
            let entries = (clusters as f64 * BOUNCE_ENTRIES).min((clusters as f64).powi(2));
            self.add("bounce operator".into(), why, entries * BOUNCE_BYTES, 0);
        }
    }

    /// Visibility cuts that no light would use.
    pub fn unused_cuts(&mut self, sites: usize) {
        self.add(
            "visibility cuts of environments".into(),
            "the sequence given with --lights has no environment and no sky; --keep cuts or --cuts environment keeps them",
            sites as f64 * CUT_ELEMENTS * CUT_BYTES,
            sites as u64 * CUT_RAYS,
        );
    }

    /// Bits that nothing can tell.
    pub fn precision(&mut self, points: usize, grey: bool, short_links: Option<usize>, params: &BakeParams) {
        debug_assert!(!params.keeps(Omittable::Precision) || !grey && short_links.is_none());
        if grey {
            self.add(
                "two channels of the points' albedo".into(),
                "all of them are grey; --keep precision keeps them",
                points as f64 * CHANNEL_BYTES,
                0,
            );
        }
        if let Some(links) = short_links {
            self.add(
                "two bits of the links' mantissas".into(),
                "they are below half of what --epsilon drops; --keep precision keeps them",
                links as f64 * SHORT_BYTES,
                0,
            );
        }
    }

    /// Bits of cuts that σ does not use: means are stored to a step of σ over twice the root of a node's leaves.
    pub fn cut_precision(&mut self, elements: usize) {
        self.add(
            "float precision of the cuts' means".into(),
            "steps of half of what --sigma lets a node scatter; a smaller --sigma keeps more",
            elements as f64 * (size_of::<f32>() as f64 - CUT_BYTES),
            0,
        );
    }
}
