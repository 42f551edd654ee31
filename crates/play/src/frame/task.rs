//! What the stages of a relit frame share.

use super::settings::FrameSettings;
use crate::cuts::shade::Fragments;
use crate::cuts::sites::FragmentSites;
use crate::prepared::PreparedScene;
use crate::shot::RelitShot;
use glam::Vec3;
use rayon::prelude::*;

/// A frame that is being lit.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub prepared: &'a PreparedScene,
    pub shot: &'a RelitShot,
    /// Unit directions from the fragments to the eye.
    pub views: &'a [Vec3],
    pub settings: &'a FrameSettings,
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
