//! What glossy fragments reflect of indirect light, found once per shot: rays of each lobe, and at their ends the
//! functions of the finest points. Narrow lobes keep the rays that end nowhere, too: the directions in which they
//! show the sky.
//!
//! The vector irradiance of Lehtinen et al. 2008 says how much light arrives, not whence, so that by itself it shades
//! every surface like a matt one. The points also say what the scene's surfaces send (direct and indirect irradiance,
//! times reflectance), and a lobe looks at those: final gathering (Reichert 1992; Christensen 2000) restricted to
//! lobes. Ends that are glossy themselves are followed on, and what lamps send over them goes over their lobes ([`crate::glossy_ends`]).
//!
//! All of it is linear in what the points receive, so that a frame costs one sparse product.

mod follower;
mod lobes;
mod shared;
mod which;

use crate::glossy_ends::GlossyEnds;
use crate::transfer::Transfer;
use follower::{Follower, Saw};
use glam::Vec3;
use lobes::Lobes;
use rayon::prelude::*;
use relight_render::exposure::Exposure;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::traced::TracedScene;
use relight_transport::basis::NearestPoint;
use relight_transport::senders::SenderTree;
use shared::{BLOCK, Followed, Group, Shares};

pub(crate) use which::matt_albedo;
pub use which::{FIXED_RAYS, MOVING_RAYS, rays};

/// Lobes of a shot and what they see. By default of none.
#[derive(Clone, Debug, Default)]
pub struct Reflections {
    /// One block's after the other's.
    lobes: Vec<Lobes>,
    /// What fragments take of the groups ([`shared::shares`]).
    shares: Shares,
    /// Whether each fragment's lobe is followed and narrow, so that its rays show the sky; empty if none is followed.
    pub narrow: Vec<bool>,
    /// Glossy surfaces that they end on.
    pub(crate) ends: GlossyEnds,
}

/// What the finest points and all senders get: direct and indirect irradiance together, then indirect alone.
fn sent(senders: &SenderTree, direct: Option<&[Vec3]>, indirect: impl Iterator<Item = Vec3>) -> Vec<Vec3> {
    let indirect: Vec<Vec3> = indirect.collect();
    let and_means = |points: Vec<Vec3>| {
        let means = senders.pulled(&points);
        [points, means.concat()].concat()
    };
    let all = direct.map(|direct| direct.iter().zip(&indirect).map(|(d, i)| *d + *i).collect());
    let indirect = and_means(indirect);
    let all = all.map_or_else(|| indirect.clone(), and_means);
    [all, indirect].concat()
}

impl Reflections {
    /// Follows the lobes of what is seen. `rays`: of each fragment's ([`rays`]), `most` for the widest.
    ///
    /// # Errors
    /// It was stopped.
    pub fn new(
        scene: &TracedScene,
        transfer: &Transfer,
        seen: &Exposure,
        rays: &[u32],
        most: u32,
        watch: &dyn Watch,
    ) -> Result<Reflections, Cancelled> {
        if rays.iter().all(|&rays| rays == 0) {
            return Ok(Reflections::default());
        }
        let nearest = NearestPoint::new(&transfer.finest);
        let all_rays = rays.iter().map(|&rays| u64::from(rays)).sum();
        let follower = || Follower::new(scene, transfer, &nearest, all_rays);
        let blocks = seen.blocks(BLOCK);
        let lobes = blocks.fragments.par_iter().map_init(follower, |follower, block| {
            go_on(watch)?;
            let mut lobes = Lobes::default();
            follower.saw = Saw::default();
            let followed: Vec<Followed> = (block.iter())
                .filter(|(f, _)| rays[*f as usize] > 0)
                .map(|&(f, pixel)| (f, pixel, seen.sighted(scene, f as usize)))
                .collect();
            let groups = lobes.push_block(follower, rays, &followed, blocks.eye, most);
            lobes.entries.shrink_to_fit();
            lobes.shared.shrink_to_fit();
            lobes.sky.shrink_to_fit();
            Ok((lobes, groups))
        });
        let lobes: Vec<(Lobes, Vec<Group>)> = lobes.collect::<Result<_, Cancelled>>()?;
        let (mut lobes, groups): (Vec<Lobes>, Vec<Vec<Group>>) = lobes.into_iter().unzip();
        let mut narrow = vec![false; rays.len()];
        for &fragment in lobes.iter().flat_map(|lobes| &lobes.narrow) {
            narrow[fragment as usize] = true;
        }
        let ends = lobes.iter_mut().map(|lobes| std::mem::take(&mut lobes.ends));
        let ends = GlossyEnds::joined(ends.collect(), transfer.finest.len() as u32);
        let shares = shared::shares(&blocks, &groups);
        Ok(Reflections {
            lobes,
            shares,
            narrow,
            ends,
        })
    }

    /// Adds what narrow lobes show of the sky, whose `radiance(direction)` is asked for, to the radiance of the fragments.
    pub fn add_sky_to(&self, reflected: &mut [Vec3], radiance: impl Fn(Vec3) -> Vec3 + Sync) {
        let seen: Vec<Vec<Vec3>> = (self.lobes.par_iter().with_min_len(4))
            .map(|lobes| {
                let seen = lobes.sky.iter().map(|&(_, direction, _)| radiance(direction));
                seen.collect()
            })
            .collect();
        for (lobes, seen) in self.lobes.iter().zip(seen) {
            for (&(fragment, _, share), seen) in lobes.sky.iter().zip(seen) {
                reflected[fragment as usize] += share * seen;
            }
        }
    }

    /// Adds what the lobes reflect to the radiance of the fragments, from direct and indirect irradiance at the finest
    /// points; without `direct`, only of what surfaces send of indirect light.
    pub fn add_to(
        &self,
        radiance: &mut [Vec3],
        transfer: &Transfer,
        direct: Option<&[Vec3]>,
        indirect: impl Iterator<Item = Vec3>,
    ) {
        if self.lobes.is_empty() {
            return;
        }
        let sent = sent(&transfer.senders, direct, indirect);
        let sum = |entries: &[(u32, Vec3)]| -> Vec3 {
            (entries.iter())
                .map(|&(at, weight)| sent[at as usize] * weight)
                .sum()
        };
        let reflected = |lobes: &Lobes| -> (Vec<Vec3>, Vec<Vec3>) {
            let sums = |all: &[(u32, Vec3)], ends: &mut dyn Iterator<Item = u32>| -> Vec<Vec3> {
                let mut start = 0;
                ends.map(|end| sum(&all[std::mem::replace(&mut start, end as usize)..end as usize]))
                    .collect()
            };
            let own = sums(&lobes.entries, &mut lobes.fragments.iter().map(|f| f.1));
            (own, sums(&lobes.shared, &mut lobes.groups.iter().copied()))
        };
        let all: Vec<(Vec<Vec3>, Vec<Vec3>)> = self.lobes.par_iter().with_min_len(4).map(reflected).collect();
        let mut of_groups = Vec::new();
        for (lobes, (own, groups)) in self.lobes.iter().zip(all) {
            for ((fragment, _), lobe) in lobes.fragments.iter().zip(own) {
                radiance[*fragment as usize] += lobe;
            }
            of_groups.extend(groups);
        }
        let mut start = 0;
        for &(fragment, albedo, end) in &self.shares.fragments {
            let parts = &self.shares.parts[std::mem::replace(&mut start, end as usize)..end as usize];
            let mean: Vec3 = (parts.iter())
                .map(|&(group, part)| part * of_groups[group as usize])
                .sum();
            radiance[fragment as usize] += albedo * mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_clusters_send_direct_and_indirect_light_and_then_indirect_alone() {
        let [a, b] = [Vec3::X, Vec3::Y];
        // Two points in one cluster.
        let senders = SenderTree::new(&[1], vec![0, 0], Vec::new(), vec![0, 0]);
        let all_sent =
            |direct: Option<&[Vec3]>, indirect: [Vec3; 2]| sent(&senders, direct, indirect.into_iter());
        let direct = [a, a];
        assert_eq!(
            all_sent(Some(&direct), [b, -b]),
            [a + b, a - b, a, b, -b, Vec3::ZERO]
        );
        assert_eq!(all_sent(None, [b, b]), [b; 6]);
    }
}
