//! Lobes of the fragments of a block of pixels: what their rays found.

use super::follower::{Follower, Saw};
use super::shared::{self, Followed, Group, Member};
use super::which::FIXED_RAYS;
use crate::glossy_ends::GlossyEnds;
use glam::Vec3;
use relight_render::exposure::Sighted;
use relight_render::sampler::Sampler;
use relight_scene::bsdf;

/// What shows the sky, whose lamps are far brighter than walls, takes one in so many.
const SKY_OF_MOST: u32 = 2;

/// Angular radius, radians, of the widest lobe whose rays show the sky where the camera stands still (α = 0.02); in shares of
/// this lobes are narrow where fewer rays are cast. Wider ones would be noisy, and visibility cuts resolve them: a lobe so
/// wide covers some 80 of 32,768 directions.
const NARROW: f32 = 0.1;

/// Lobes of some fragments.
#[derive(Clone, Debug, Default)]
pub(super) struct Lobes {
    /// Each fragment, and the end of its entries.
    pub(super) fragments: Vec<(u32, u32)>,
    /// Where the entries of each group that shares what it sees far away end.
    pub(super) groups: Vec<u32>,
    /// Entries of the groups, for a lobe that reflects all.
    pub(super) shared: Vec<(u32, Vec3)>,
    /// Those that are narrow wherever their rays start.
    pub(super) narrow: Vec<u32>,
    /// Places in [`super::sent`] and what each adds to the fragment's radiance, 1/sr.
    pub(super) entries: Vec<(u32, Vec3)>,
    /// Of narrow lobes the rays that end nowhere: fragment, unit direction, and the share of the radiance from there that the
    /// fragment reflects.
    pub(super) sky: Vec<(u32, Vec3, Vec3)>,
    /// Glossy surfaces that rays end on.
    pub(super) ends: GlossyEnds,
}

impl Lobes {
    /// Appends a fragment's lobe, which takes `rays`, or more if the fragment before saw the sky or other lobes: its own rays must not decide, or
    /// what few of them see would be counted where they see it and left out where they don't.
    /// `far`: what it sees far away is taken from it, to be shared.
    fn push(
        &mut self,
        follower: &mut Follower,
        (fragment, rays): (u32, u32),
        starts: &[Sighted],
        most: u32,
        mut far: Option<&mut FarThings>,
    ) {
        let narrow_below = NARROW * most as f32 / FIXED_RAYS as f32;
        let narrow = (starts.iter()).all(|start| bsdf::width_facing(&start.point) <= narrow_below);
        let (first, first_end) = (self.sky.len(), self.ends.ends.len());
        let cast = match std::mem::take(&mut follower.saw) {
            Saw { lobes: true, .. } => most,
            Saw { sky: true, .. } if narrow => rays.max(most / SKY_OF_MOST),
            _ => rays,
        };
        // Rays of a group are stratified together.
        let (key, first_ray) = far.as_ref().map_or((fragment, 0), |far| (far.key, far.rays));
        for (ray, start) in (0..cast).zip(starts.iter().cycle()) {
            let sampler = Sampler::new(0, key.into(), first_ray + ray);
            let before = follower.found.len();
            let missed = follower.follow(*start, sampler, (fragment, cast), &mut self.ends);
            if let Some(far) = &mut far {
                far.take(follower.first_length, &mut follower.found, before);
            }
            if let (Some((direction, share)), true) = (missed, narrow) {
                self.sky.push((fragment, direction, share));
            }
        }
        follower.saw.sky = self.sky.len() > first;
        let share = (cast as f32).recip();
        self.sky[first..].iter_mut().for_each(|ray| ray.2 *= share);
        (self.ends.ends[first_end..].iter_mut()).for_each(|end| end.throughput *= share);
        take(&mut follower.found, share, &mut self.entries);
        self.fragments.push((fragment, self.entries.len() as u32));
        if narrow {
            self.narrow.push(fragment);
        }
    }

    /// Appends the fragments of a block, seen from `eye`; each takes `rays[fragment]` rays. Returns its groups.
    pub(super) fn push_block(
        &mut self,
        follower: &mut Follower,
        rays: &[u32],
        followed: &[Followed],
        eye: Vec3,
        most: u32,
    ) -> Vec<Group> {
        let rays_of = |fragment: u32| (fragment, rays[fragment as usize]);
        let (groups, narrow) = shared::groups(followed, eye);
        for at in narrow {
            let (fragment, _, starts) = &followed[at];
            self.push(follower, rays_of(*fragment), starts, most, None);
        }
        let follow = |group: Vec<(usize, Member)>| {
            let places = group.iter().flat_map(|&(at, _)| &followed[at].2);
            let mut far = FarThings {
                beyond: shared::beyond(&group, places.map(|start| start.hit.position)),
                key: group[0].1.fragment,
                ..FarThings::default()
            };
            for (at, member) in &group {
                far.albedo = member.albedo;
                let starts = &followed[*at].2;
                self.push(follower, rays_of(member.fragment), starts, most, Some(&mut far));
            }
            take(&mut far.found, (far.rays as f32).recip(), &mut self.shared);
            let members = group.into_iter().map(|member| member.1).collect();
            self.groups.push(self.shared.len() as u32);
            Group::new(members, far.beyond)
        };
        groups.into_iter().map(follow).collect()
    }
}

/// What rays of a group found so far of things far away.
#[derive(Default)]
struct FarThings {
    /// From where on they are that, m.
    beyond: f32,
    /// What the lobe at hand reflects of even light.
    albedo: Vec3,
    /// Number of the group's rays among others: a fragment's.
    key: u32,
    /// Rays cast, whatever they met.
    rays: u32,
    /// What they found, for a lobe that reflects all: places in [`super::sent`] and their parts of the radiance.
    found: Vec<(u32, Vec3)>,
}

impl FarThings {
    /// Counts a ray, and takes what it found last if what it met first is far away.
    fn take(&mut self, first_length: f32, found: &mut Vec<(u32, Vec3)>, last: usize) {
        self.rays += 1;
        if first_length > self.beyond {
            let per_albedo = Vec3::select(self.albedo.cmpgt(Vec3::ZERO), self.albedo.recip(), Vec3::ZERO);
            self.found
                .extend(found.drain(last..).map(|(at, part)| (at, part * per_albedo)));
        }
    }
}

/// Moves what was found, times `share`, to `entries`, one for each place.
fn take(found: &mut Vec<(u32, Vec3)>, share: f32, entries: &mut Vec<(u32, Vec3)>) {
    found.sort_by_key(|entry| entry.0);
    let first = entries.len();
    for (at, weight) in found.drain(..) {
        let weight = weight * share;
        match entries[first..].last_mut() {
            Some(last) if last.0 == at => last.1 += weight,
            _ => entries.push((at, weight)),
        }
    }
}
