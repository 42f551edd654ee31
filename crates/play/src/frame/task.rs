//! What the stages of a relit frame share.

use super::settings::FrameSettings;
use crate::cuts::shade::Fragments;
use crate::cuts::sites::FragmentSites;
use crate::prepared::PreparedScene;
use crate::shot::RelitShot;
use glam::Vec3;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Nodes that each fragment was shaded with, of all its lights, where somebody wants to know; else nothing.
#[derive(Default)]
pub(super) struct NodeCounts(Option<Mutex<Vec<u32>>>);

impl NodeCounts {
    /// Of so many fragments.
    pub fn of(fragments: usize) -> NodeCounts {
        NodeCounts(Some(Mutex::new(vec![0; fragments])))
    }

    /// Adds those of one more shading.
    pub fn add(&self, nodes: &[u32]) {
        let Some(sums) = &self.0 else { return };
        let mut sums = sums.lock().unwrap_or_else(PoisonError::into_inner);
        for (sum, more) in sums.iter_mut().zip(nodes) {
            *sum = sum.saturating_add(*more);
        }
    }

    /// The sums, if they were counted.
    pub fn into_sums(self) -> Option<Vec<u32>> {
        Some(self.0?.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A frame that is being lit.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub prepared: &'a PreparedScene,
    pub shot: &'a RelitShot,
    /// Unit directions from the fragments to the eye.
    pub views: &'a [Vec3],
    pub settings: &'a FrameSettings,
    pub nodes: &'a NodeCounts,
}

impl<'a> Task<'a> {
    /// The fragments for shading with cuts between `sites`; `matt`: those of matt surfaces, too.
    pub fn fragments(&self, sites: &'a FragmentSites, matt: bool) -> Fragments<'a> {
        Fragments {
            sites,
            points: &self.shot.seen.points,
            views: self.views,
            narrow: &[],
            matt,
        }
    }
}

/// Adds a part to a sum, place by place.
pub(super) fn add(sum: &mut [Vec3], part: &[Vec3]) {
    (sum.par_iter_mut().zip(part).with_min_len(4096)).for_each(|(s, p)| *s += *p);
}
