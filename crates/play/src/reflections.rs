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

use crate::glossy_ends::{self, GlossyEnd, GlossyEnds};
use crate::reconstruct::functions_at;
use crate::transfer::Transfer;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::exposure::Sighted;
use relight_render::sampler::Sampler;
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::{Look, TracedScene};
use relight_transport::basis::{FunctionsInOrder, NearestPoint};
use relight_transport::senders::SenderTree;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI};

/// Rays of the widest lobe where the camera stands still.
pub const FIXED_RAYS: u32 = 32;
/// The same where every frame casts them anew: the camera or materials move.
pub const MOVING_RAYS: u32 = 4;

/// Lobes that matter less are spread like the matt part: their share of the reflected light, times one for a mirror and a
/// half for the widest, which look much like it.
const LEAST: f32 = 0.05;

/// A mirror takes one ray in so many of what the widest lobe takes: edges of what it shows cross its pixels, too.
const LEAST_OF_MOST: u32 = 8;

/// What shows the sky, whose lamps are far brighter than walls, takes one in so many.
const SKY_OF_MOST: u32 = 2;

/// Angular radius, radians, of the widest lobe whose rays show the sky where the camera stands still (α = 0.02); in shares of
/// this lobes are narrow where fewer rays are cast. Wider ones would be noisy, and visibility cuts resolve them: a lobe so
/// wide covers some 80 of 32,768 directions.
const NARROW: f32 = 0.1;

/// Most glossy surfaces one after another.
const MOST_SURFACES: u32 = 4;

/// Lobes of a shot and what they see. By default of none.
#[derive(Clone, Debug, Default)]
pub struct Reflections {
    lobes: Vec<Lobes>,
    /// Whether each fragment's lobe is followed and narrow, so that its rays show the sky; empty if none is followed.
    pub narrow: Vec<bool>,
    /// Glossy surfaces that they end on.
    pub(crate) ends: GlossyEnds,
}

/// Lobes of some fragments.
#[derive(Clone, Debug, Default)]
struct Lobes {
    /// Each fragment, ascending, and the end of its entries.
    fragments: Vec<(u32, u32)>,
    /// Those that are narrow wherever their rays start.
    narrow: Vec<u32>,
    /// Places in [`sent`] and what each adds to the fragment's radiance, 1/sr.
    entries: Vec<(u32, Vec3)>,
    /// Of narrow lobes the rays that end nowhere: fragment, unit direction, and the share of the radiance from there that the
    /// fragment reflects.
    sky: Vec<(u32, Vec3, Vec3)>,
    /// Glossy surfaces that rays end on.
    ends: GlossyEnds,
}

/// Fragments whose lobes are followed one after the other.
const TASK: usize = 64;

/// Rays with which to follow a point's lobe seen from `wo` (unit, away from the surface), `most` for the widest; 0 where
/// spreading its light like the matt part's will do.
pub fn rays(point: &ShadingPoint, wo: Vec3, most: u32) -> u32 {
    let lobe = bsdf::lobe_albedo(point, wo);
    if lobe == Vec3::ZERO {
        return 0;
    }
    let matt = matt_albedo(point, wo);
    let share = (lobe / (lobe + matt).max(Vec3::splat(f32::MIN_POSITIVE))).max_element();
    let width = bsdf::width_facing(point) / FRAC_PI_2;
    if share * (1.0 - 0.5 * width) < LEAST {
        return 0;
    }
    ((most as f32 * share * width).ceil() as u32)
        .max(most / LEAST_OF_MOST)
        .max(1)
}

/// Share of even light that the matt part reflects towards `wo`.
pub(crate) fn matt_albedo(point: &ShadingPoint, wo: Vec3) -> Vec3 {
    bsdf::diffuse_reflectance(point, point.shading_normal.dot(wo))
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

impl Lobes {
    /// Appends a fragment's lobe, which takes `rays`, or more if the fragment before saw the sky or other lobes: its own rays must not decide, or
    /// what few of them see would be counted where they see it and left out where they don't.
    fn push(&mut self, follower: &mut Follower, (fragment, rays): (u32, u32), starts: &[Sighted], most: u32) {
        let narrow_below = NARROW * most as f32 / FIXED_RAYS as f32;
        let narrow = (starts.iter()).all(|start| bsdf::width_facing(&start.point) <= narrow_below);
        let (first, first_end) = (self.sky.len(), self.ends.ends.len());
        let cast = match std::mem::take(&mut follower.saw) {
            Saw { lobes: true, .. } => most,
            Saw { sky: true, .. } if narrow => rays.max(most / SKY_OF_MOST),
            _ => rays,
        };
        for (ray, start) in (0..cast).zip(starts.iter().cycle()) {
            let sampler = Sampler::new(0, fragment.into(), ray);
            let missed = follower.follow(*start, sampler, (fragment, cast), &mut self.ends);
            if let (Some((direction, share)), true) = (missed, narrow) {
                self.sky.push((fragment, direction, share));
            }
        }
        follower.saw.sky = self.sky.len() > first;
        let share = (cast as f32).recip();
        self.sky[first..].iter_mut().for_each(|ray| ray.2 *= share);
        (self.ends.ends[first_end..].iter_mut()).for_each(|end| end.throughput *= share);
        follower.take(share, &mut self.entries);
        self.fragments.push((fragment, self.entries.len() as u32));
        if narrow {
            self.narrow.push(fragment);
        }
    }
}

impl Reflections {
    /// Follows the lobes of fragments. `rays`: of each lobe ([`rays`]), `most` for the widest; `starts_of`: where a fragment's
    /// rays start, one or more places in turn.
    ///
    /// # Errors
    /// It was stopped.
    pub fn new(
        scene: &TracedScene,
        transfer: &Transfer,
        rays: &[u32],
        most: u32,
        starts_of: impl Fn(usize) -> Vec<Sighted> + Sync,
        watch: &dyn Watch,
    ) -> Result<Reflections, Cancelled> {
        let fragments: Vec<u32> = (0u32..).zip(rays).filter(|f| *f.1 > 0).map(|f| f.0).collect();
        if fragments.is_empty() {
            return Ok(Reflections::default());
        }
        let nearest = NearestPoint::new(&transfer.finest);
        let all_rays = rays.iter().map(|&rays| u64::from(rays)).sum();
        let follower = || Follower {
            scene,
            rays: all_rays,
            saw: Saw::default(),
            transfer,
            functions: FunctionsInOrder::new(&transfer.finest),
            nearest: &nearest,
            end: Vec::new(),
            point: None,
            found: Vec::new(),
        };
        let lobes = fragments
            .par_chunks(TASK)
            .map_init(follower, |follower, fragments| {
                go_on(watch)?;
                let mut lobes = Lobes::default();
                follower.saw = Saw::default();
                for &f in fragments {
                    let starts = starts_of(f as usize);
                    lobes.push(follower, (f, rays[f as usize]), &starts, most);
                }
                lobes.entries.shrink_to_fit();
                lobes.sky.shrink_to_fit();
                Ok(lobes)
            });
        let mut lobes: Vec<Lobes> = lobes.collect::<Result<_, Cancelled>>()?;
        let mut narrow = vec![false; rays.len()];
        for &fragment in lobes.iter().flat_map(|lobes| &lobes.narrow) {
            narrow[fragment as usize] = true;
        }
        let ends = lobes.iter_mut().map(|lobes| std::mem::take(&mut lobes.ends));
        let ends = GlossyEnds::joined(ends.collect(), transfer.finest.len() as u32);
        Ok(Reflections { lobes, narrow, ends })
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
        let reflected = |lobes: &Lobes| -> Vec<Vec3> {
            let mut start = 0;
            (lobes.fragments.iter())
                .map(|&(_, end)| {
                    let entries = &lobes.entries[start..end as usize];
                    start = end as usize;
                    entries
                        .iter()
                        .map(|&(at, weight)| sent[at as usize] * weight)
                        .sum()
                })
                .collect()
        };
        let all: Vec<Vec<Vec3>> = self.lobes.par_iter().with_min_len(4).map(reflected).collect();
        for (lobes, reflected) in self.lobes.iter().zip(all) {
            for ((fragment, _), lobe) in lobes.fragments.iter().zip(reflected) {
                radiance[*fragment as usize] += lobe;
            }
        }
    }
}

/// What rays of a fragment's lobe met that wants more of them.
#[derive(Clone, Copy, Default)]
struct Saw {
    /// The sky, in a narrow lobe.
    sky: bool,
    /// Glossy surfaces that matter.
    lobes: bool,
}

/// Follows the lobes of one fragment after the other.
struct Follower<'a> {
    scene: &'a TracedScene,
    transfer: &'a Transfer,
    functions: FunctionsInOrder<'a>,
    nearest: &'a NearestPoint<'a>,
    /// Of all fragments.
    rays: u64,
    /// What rays saw since this was taken last: those of the fragment before.
    saw: Saw,
    /// Functions at one end.
    end: Vec<(u32, f32)>,
    /// The point that counts most there.
    point: Option<u32>,
    /// What the fragment's rays found so far: places in [`sent`] and what each adds to its radiance.
    found: Vec<(u32, Vec3)>,
}

impl Follower<'_> {
    /// Follows a lobe's ray, one of `rays` of a fragment, over glossy surfaces until it ends on one that is not. Returns the direction of one that meets no
    /// surface, and how much of the light from there it takes to the eye.
    fn follow(
        &mut self,
        start: Sighted,
        mut sampler: Sampler,
        (fragment, rays): (u32, u32),
        ends: &mut GlossyEnds,
    ) -> Option<(Vec3, Vec3)> {
        let Sighted {
            mut hit,
            mut point,
            view: mut wo,
        } = start;
        let mut throughput = Vec3::ONE;
        let mut blur = 0.0;
        for surface in 1..=MOST_SURFACES {
            let (wi, weight) = bsdf::sample_lobe(&point, wo, sampler.next_2d())?;
            throughput *= weight;
            let ray = ray_from(&hit, wi);
            let look = if self.scene.bends_from(&hit, &point) {
                self.scene.look(&ray, |_, _, _| ())
            } else {
                Look::straight(&ray, self.scene.closest_hit(&ray))
            };
            let end = look.hit.map_or(f32::INFINITY, |next| next.t);
            throughput *= look.tint * self.scene.tint(&look.ray, end);
            let Some(next) = look.hit else {
                return (surface == 1).then_some((look.ray.direction, throughput));
            };
            blur += look.length() * bsdf::width_facing(&point);
            (hit, wo) = (next, -look.ray.direction);
            point = self.scene.shading_point(&hit).facing(wo);
            let is_glossy = self::rays(&point, wo, 1) > 0;
            let last = surface == MOST_SURFACES || !is_glossy;
            self.functions_at(&hit, blur, blur * (rays as f32).sqrt().recip());
            self.add(&point, wo, throughput, last);
            if is_glossy {
                let Sighted {
                    point: seen, view, ..
                } = &start;
                let reflected = bsdf::lobe_albedo(seen, *view) + matt_albedo(seen, *view);
                let over_lobe = throughput * bsdf::lobe_albedo(&point, wo);
                let part = over_lobe.max_element() / reflected.max_element();
                if part >= glossy_ends::PART {
                    self.saw.lobes = true;
                    let chance = glossy_ends::chance(self.rays);
                    if sampler.next_1d() < chance {
                        let kept = (rays as f32 * chance).max(1.0);
                        let (reach, throughput) = (blur / kept.sqrt(), throughput / chance);
                        self.keep_end(fragment, &point, look.ray.origin, reach, throughput, ends);
                    }
                }
            }
            if last {
                break;
            }
        }
        None
    }

    /// Keeps the end whose functions were found last.
    fn keep_end(
        &self,
        fragment: u32,
        point: &ShadingPoint,
        seen_from: Vec3,
        reach: f32,
        throughput: Vec3,
        ends: &mut GlossyEnds,
    ) {
        let Some(finest) = self.point else { return };
        ends.lit_by.extend_from_slice(&self.end);
        ends.ends.push(GlossyEnd {
            fragment,
            point: finest,
            lit_end: ends.lit_by.len() as u32,
            shading: *point,
            albedo: bsdf::hemispherical_albedo(point),
            seen_from,
            reach,
            throughput,
        });
    }

    /// Finds the functions at an end. Where the lobe blurs what is there over more than a point's distance (`blur`, metres),
    /// the nearest point will do, and a frame has that many fewer products. Each ray stands for what is within `reach` metres, as a texture's
    /// smaller image does: the largest of the point's clusters that is no larger. Else a small bright thing is met by a ray of one fragment
    /// and by none of the next one's.
    fn functions_at(&mut self, hit: &SurfaceHit, blur: f32, reach: f32) {
        let Transfer {
            finest,
            near_separated,
            ..
        } = self.transfer;
        let place = (hit.position, hit.normal);
        let separated = |place, j| self.transfer.is_separated(self.scene, place, j);
        self.end.clear();
        self.point = None;
        if blur < finest.disk_radius {
            functions_at(
                &mut self.functions,
                place,
                self.transfer.separated(self.scene),
                separated,
                &mut self.end,
            );
            let most = self.end.iter().max_by(|a, b| a.1.total_cmp(&b.1));
            self.point = most.map(|entry| entry.0);
        } else if let Some(j) = self.nearest.at(place.0, place.1) {
            let j = (self.nearest).on_same_side(place, j, near_separated, |j| separated(place, j));
            let Transfer {
                senders,
                sender_areas,
                linked_levels,
                ..
            } = self.transfer;
            let sender = around(senders, *linked_levels, sender_areas, j, PI * reach * reach);
            let at = sender.map_or(j, |sender| (finest.len() + sender) as u32);
            self.end.push((at, 1.0));
            self.point = Some(j);
        }
    }

    /// Adds what a surface sends: of direct light always the total reflectance, of indirect light only the matt part's where
    /// its lobe is followed (not `last`).
    fn add(&mut self, point: &ShadingPoint, wo: Vec3, throughput: Vec3, last: bool) {
        let total = bsdf::hemispherical_albedo(point);
        let all = (self.transfer.finest.len() + self.transfer.senders.ranges.total()) as u32;
        for &(j, w) in &self.end {
            let scale = throughput * (w * FRAC_1_PI);
            self.found.push((j, scale * total));
            if !last {
                let matt = matt_albedo(point, wo);
                self.found.push((all + j, scale * (matt - total)));
            }
        }
    }

    /// Moves what was found, times `share`, to `entries`, one for each place.
    fn take(&mut self, share: f32, entries: &mut Vec<(u32, Vec3)>) {
        self.found.sort_by_key(|entry| entry.0);
        let first = entries.len();
        for (at, weight) in self.found.drain(..) {
            let weight = weight * share;
            match entries[first..].last_mut() {
                Some(last) if last.0 == at => last.1 += weight,
                _ => entries.push((at, weight)),
            }
        }
    }
}

/// The largest of a point's clusters, of the first so many `levels`, whose surface, of `areas`, is at most `area`.
fn around(senders: &SenderTree, levels: usize, areas: &[f32], point: u32, area: f32) -> Option<usize> {
    let mut cluster = senders.leaf_of_point[point as usize];
    let mut found = None;
    for level in (0..senders.levels()).rev() {
        let sender = senders.ranges.range(level).start + cluster as usize;
        if areas[sender] > area {
            break;
        }
        if level < levels {
            found = Some(sender);
        }
        if level > 0 {
            cluster = senders.parents[level - 1][cluster as usize];
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, traced};
    use relight_scene::material::Material;
    use relight_scene::rays::Ray;
    use relight_scene::traced::Shading;

    /// What a ray from above meets of a floor of this material.
    fn floor(material: Material, wo: Vec3) -> ShadingPoint {
        let matt = traced(vec![level(1.0, 0.0, 0)], vec![material]);
        let scene = TracedScene::new(matt.scene().clone(), Shading::Full).unwrap();
        let ray = Ray {
            origin: wo,
            direction: -wo,
            t_min: 0.0,
            t_max: 2.0,
        };
        scene.shading_point(&scene.closest_hit(&ray).unwrap()).facing(wo)
    }

    fn glossy(roughness: f32, metallic: f32) -> Material {
        Material {
            roughness,
            metallic,
            ..matt(0.5, 0.0)
        }
    }

    #[test]
    fn lobes_are_followed_where_they_matter() {
        let above = Vec3::new(0.0, 0.8, 0.6);
        let grazing = Vec3::new(0.0, 0.05, 1.0).normalize();
        let rays = |roughness, metallic, wo| rays(&floor(glossy(roughness, metallic), wo), wo, 32);
        // A mirror's few are for edges; the rougher a metal, the more it takes.
        assert_eq!(rays(0.0, 1.0, above), 32 / LEAST_OF_MOST);
        assert!(rays(0.3, 1.0, above) < rays(0.5, 1.0, above));
        assert_eq!(rays(1.0, 1.0, above), 32);
        // 4 % of a rough dielectric's light are spread; a polished one shows its mirror image, most of all at the horizon.
        assert_eq!(rays(1.0, 0.0, above), 0);
        assert!(rays(0.3, 0.0, above) > 0);
        assert!(rays(0.3, 0.0, grazing) > rays(0.3, 0.0, above));
    }

    #[test]
    fn a_point_that_shows_nothing_follows_nothing() {
        let below = Vec3::new(0.0, -1.0, 0.0);
        let point = floor(glossy(0.0, 1.0), Vec3::Y);
        assert_eq!(rays(&point, below, 32), 0);
        let black = ShadingPoint {
            diffuse: Vec3::ZERO,
            f0: Vec3::ZERO,
            lambert: true,
            ..point
        };
        assert_eq!(rays(&black, Vec3::Y, 32), 0);
    }

    /// Two points in a cluster, a third in another, all three in one.
    #[test]
    fn a_ray_sees_the_largest_cluster_that_is_no_larger_than_what_it_stands_for() {
        let senders = SenderTree::new(&[1, 2], vec![0, 0, 1], vec![vec![0, 0]], vec![0; 3]);
        let areas = senders.sums(|point| [1.0, 1.0, 3.0][point]);
        assert_eq!(areas, [5.0, 2.0, 3.0]);
        let found = |point, area| around(&senders, 2, &areas, point, area);
        assert_eq!(around(&senders, 1, &areas, 0, 4.9), None);
        assert_eq!(
            [0.5, 1.9, 2.0, 4.9, 5.0].map(|area| found(0, area)),
            [None, None, Some(1), Some(1), Some(0)]
        );
        assert_eq!(
            [2.9, 3.0, 5.0].map(|area| found(2, area)),
            [None, Some(2), Some(0)]
        );
    }

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
