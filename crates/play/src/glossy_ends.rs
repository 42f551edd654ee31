//! What lamps send to the eye over two lobes: a fragment's, and that of the glossy surface which its rays end on.
//!
//! The points know how much light arrives at such an end, not whence, so that by themselves they make it matt. Each end keeps its own
//! BRDF; what that sends along the ray of a lamp's light, less what the points say, is added lamp by lamp ([`crate::gloss`] does the same for what
//! surfaces send one another). All of it is linear in the lamps' light.

use crate::lit::Lit;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::irradiance::Arrivals;
use relight_scene::shading::ShadingPoint;
use std::f32::consts::FRAC_1_PI;

/// About as many ends as a shot keeps if all of its rays end on glossy surfaces, each for as many as were left out: a frame takes some 0.2 µs of a core for
/// each and each lamp that moves, 0.7 µs if the lamp has extent, and each takes 240 bytes.
const MOST: f32 = 250e3;

/// Part of what a fragment reflects of even light that comes over an end's lobe, from which on that lobe matters. Light of a small lamp is up to
/// 1 / (4 α²) times as bright in a lobe that it shines into as what is matt sends of it: 16 for α = 0.12.
pub(crate) const PART: f32 = 1.0 / 16.0;

/// Chance with which an end is kept whose lobe matters, where a shot's fragments cast so many rays.
pub(crate) fn chance(rays: u64) -> f32 {
    (MOST / rays as f32).min(1.0)
}

/// A glossy surface that a fragment's ray ends on, or is mirrored by.
#[derive(Clone, Debug)]
pub(crate) struct GlossyEnd {
    /// Which fragment sees it.
    pub fragment: u32,
    /// The finest point there.
    pub point: u32,
    /// Where its part of [`GlossyEnds::lit_by`] ends.
    pub lit_end: u32,
    pub shading: ShadingPoint,
    /// What it reflects of even light, as the points take it.
    pub albedo: Vec3,
    /// Where it is seen from.
    pub seen_from: Vec3,
    /// Radius of the surface that it stands for, m.
    pub reach: f32,
    /// Which part of the radiance from there the fragment reflects.
    pub throughput: Vec3,
}

/// Glossy ends of a shot's fragments.
#[derive(Clone, Debug, Default)]
pub(crate) struct GlossyEnds {
    pub ends: Vec<GlossyEnd>,
    /// Finest points, and after them senders, and how much of their irradiance is an end's: one end's after the other's.
    pub lit_by: Vec<(u32, f32)>,
    /// Finest points that know whence light comes, ascending.
    points: Vec<u32>,
}

impl GlossyEnds {
    /// All of several lists; `points`: how many finest points there are.
    pub fn joined(lists: Vec<GlossyEnds>, points: u32) -> GlossyEnds {
        let mut all = GlossyEnds::default();
        for list in lists {
            let before = all.lit_by.len() as u32;
            all.lit_by.extend(list.lit_by);
            all.ends.extend(list.ends.into_iter().map(|end| GlossyEnd {
                lit_end: before + end.lit_end,
                ..end
            }));
        }
        let finest = |at: &(u32, f32)| (at.0 < points).then_some(at.0);
        let known = all.lit_by.iter().filter_map(finest);
        all.points = known.chain(all.ends.iter().map(|end| end.point)).collect();
        all.points.par_sort_unstable();
        all.points.dedup();
        all
    }

    /// Numbers of the finest points at which it must be known whence a lamp's light comes.
    pub fn points(&self) -> &[u32] {
        &self.points
    }

    /// Radiance of `fragments` fragments: what they see of a lamp's light over the ends' lobes, less what they would if the ends were matt.
    /// `direct`: its irradiance at the finest points; `arrivals`: the same at [`GlossyEnds::points`]. `None` where it is nothing.
    pub fn over_lobes(
        &self,
        transfer: &Transfer,
        fragments: usize,
        direct: &[Vec3],
        arrivals: &Arrivals,
    ) -> Option<Vec<Vec3>> {
        let lit = Lit::of(arrivals)?;
        let lamp = LampLight {
            of: self,
            transfer,
            direct,
            means: transfer.senders.pulled(direct).concat(),
            lit,
        };
        let starts = std::iter::once(0).chain(self.ends.iter().map(|end| end.lit_end));
        let runs: Vec<(u32, &GlossyEnd)> = starts.zip(&self.ends).collect();
        let seen: Vec<Vec3> = (runs.par_iter().with_min_len(256))
            .map(|&(start, end)| lamp.over_lobe(end, &self.lit_by[start as usize..end.lit_end as usize]))
            .collect();
        let mut radiance = vec![Vec3::ZERO; fragments];
        for (end, seen) in self.ends.iter().zip(seen) {
            radiance[end.fragment as usize] += seen;
        }
        Some(radiance)
    }
}

/// A lamp's light at the ends.
struct LampLight<'a> {
    of: &'a GlossyEnds,
    transfer: &'a Transfer,
    /// Irradiance at the finest points.
    direct: &'a [Vec3],
    /// Its means over the senders.
    means: Vec<Vec3>,
    /// Whence it comes at each of [`GlossyEnds::points`].
    lit: Vec<Lit>,
}

impl LampLight<'_> {
    /// What an end adds to its fragment's radiance, less what it would if it were matt; `lit_by`: its part of that list.
    fn over_lobe(&self, end: &GlossyEnd, lit_by: &[(u32, f32)]) -> Vec3 {
        let around: Vec3 = lit_by
            .iter()
            .map(|&(at, weight)| self.irradiance(at) * weight)
            .sum();
        if around == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let GlossyEnd {
            shading,
            albedo,
            seen_from,
            reach,
            ..
        } = end;
        // As if all light came from where it comes from at a point.
        let as_at = |point: u32| {
            let away = shading.position - self.transfer.finest.positions[point as usize];
            let lit = &self.lit[self.of.points.partition_point(|&other| other < point)];
            let reflected = lit.reflected(shading, (shading.position, *seen_from, away), (*reach, 0.0), 0.0);
            (lit.is_unoccluded(), reflected, lit.irradiance())
        };
        let (is_unoccluded, mut reflected, mut irradiance) = as_at(end.point);
        if !is_unoccluded {
            // A point's few samples are noise; those of all points around an end are less.
            let is_point = |at: &&(u32, f32)| (at.0 as usize) < self.direct.len() && at.0 != end.point;
            for &(point, _) in lit_by.iter().filter(is_point) {
                let (_, also, more) = as_at(point);
                reflected += also;
                irradiance += more;
            }
        }
        // The light around says how much of it there is.
        let least = Vec3::splat(f32::MIN_POSITIVE);
        let lobe = Vec3::select(
            irradiance.cmpgt(least),
            reflected / irradiance.max(least),
            *albedo,
        );
        let light = match is_unoccluded {
            true => around.min(irradiance),
            false => around,
        };
        end.throughput * (lobe - *albedo) * light * FRAC_1_PI
    }

    fn irradiance(&self, at: u32) -> Vec3 {
        match self.direct.get(at as usize) {
            Some(direct) => *direct,
            None => self.means[at as usize - self.direct.len()],
        }
    }
}
