//! Follows rays of lobes to what they show.

use super::which::{WIDE, matt_albedo, rays};
use crate::glossy_ends::{self, GlossyEnd, GlossyEnds};
use crate::reconstruct::functions_at;
use crate::transfer::Transfer;
use glam::Vec3;
use relight_render::exposure::Sighted;
use relight_render::sampler::Sampler;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::{Look, TracedScene};
use relight_transport::basis::{FunctionsInOrder, NearestPoint};
use relight_transport::senders::SenderTree;
use std::f32::consts::{FRAC_1_PI, PI};

/// Most glossy surfaces one after another.
const MOST_SURFACES: u32 = 4;

/// What rays of a fragment's lobe met that wants more of them.
#[derive(Clone, Copy, Default)]
pub(super) struct Saw {
    /// The sky, in a narrow lobe.
    pub(super) sky: bool,
    /// Glossy surfaces that matter.
    pub(super) lobes: bool,
}

/// Follows the lobes of one fragment after the other.
pub(super) struct Follower<'a> {
    scene: &'a TracedScene,
    transfer: &'a Transfer,
    functions: FunctionsInOrder<'a>,
    nearest: &'a NearestPoint<'a>,
    /// Of all fragments.
    rays: u64,
    /// What rays saw since this was taken last: those of the fragment before.
    pub(super) saw: Saw,
    /// Functions at one end.
    end: Vec<(u32, f32)>,
    /// The point that counts most there.
    point: Option<u32>,
    /// How long the way of the last ray was to what it met first, m; infinite if nothing.
    pub(super) first_length: f32,
    /// What the fragment's rays found so far: places in [`super::sent`] and what each adds to its radiance.
    pub(super) found: Vec<(u32, Vec3)>,
}

impl<'a> Follower<'a> {
    /// Follows lobes of so many rays, all in all.
    pub(super) fn new(
        scene: &'a TracedScene,
        transfer: &'a Transfer,
        nearest: &'a NearestPoint<'a>,
        rays: u64,
    ) -> Follower<'a> {
        Follower {
            scene,
            transfer,
            functions: FunctionsInOrder::new(&transfer.finest),
            nearest,
            rays,
            saw: Saw::default(),
            end: Vec::new(),
            point: None,
            first_length: f32::INFINITY,
            found: Vec::new(),
        }
    }

    /// Follows a lobe's ray, one of `rays` of a fragment, over glossy surfaces until it ends on one that is not. Returns the direction of one that meets no
    /// surface, and how much of the light from there it takes to the eye.
    pub(super) fn follow(
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
        self.first_length = f32::INFINITY;
        for surface in 1..=MOST_SURFACES {
            let (wi, weight) = bsdf::sample_lobe(&point, wo, sampler.next_2d())?;
            throughput *= weight;
            let width = bsdf::width_facing(&point);
            if surface == 1 && width >= WIDE {
                throughput += weight * uneven_matt(&point, wo, wi);
            }
            let ray = ray_from(&hit, wi);
            let look = if self.scene.bends_from(&hit, &point) {
                self.scene.look(&ray, |_, _, _| ())
            } else {
                Look::straight(&ray, self.scene.closest_hit(&ray))
            };
            let end = look.hit.map_or(f32::INFINITY, |next| next.t);
            throughput *= look.tint * self.scene.tint(&look.ray, end);
            if surface == 1 {
                self.first_length = look.length();
            }
            let Some(next) = look.hit else {
                return (surface == 1).then_some((look.ray.direction, throughput));
            };
            blur += look.length() * width;
            (hit, wo) = (next, -look.ray.direction);
            point = self.scene.shading_point(&hit).facing(wo);
            let is_glossy = self::rays(&point, wo, 1, 1.0) > 0;
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

/// What the matt part sends to `wo` of light from `wi` beyond its share of even light, over what the lobe does: the half vector's Fresnel term
/// takes more from it where light comes towards the viewer over a ground than where it comes from behind them: a third more where both are 80° from the normal. A wide lobe's
/// rays show both.
fn uneven_matt(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> Vec3 {
    let matt = bsdf::eval_diffuse(point, wo, wi);
    let lobe = bsdf::eval(point, wo, wi) - matt;
    let uneven = matt - matt_albedo(point, wo) * FRAC_1_PI;
    Vec3::select(lobe.cmpgt(Vec3::ZERO), uneven / lobe, Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// A surface whose matt part reflects 0.6.
    fn plastic(alpha: f32) -> ShadingPoint {
        let hit = SurfaceHit {
            t: 1.0,
            position: Vec3::ZERO,
            position_error: Vec3::ZERO,
            geometric_normal: Vec3::Z,
            normal: Vec3::Z,
            front: true,
            primitive: 0,
            barycentric: [0.0; 2],
        };
        ShadingPoint {
            lambert: false,
            alpha,
            f0: Vec3::splat(0.04),
            ..ShadingPoint::lambert(&hit, Vec3::splat(0.6))
        }
    }

    fn seen_at(cosine: f32) -> Vec3 {
        Vec3::new((1.0f32 - cosine * cosine).sqrt(), 0.0, cosine)
    }

    /// What rays of the lobe carry of the matt part, 1/sr.
    fn beyond_share(point: &ShadingPoint, wo: Vec3, wi: Vec3) -> f32 {
        let lobe = bsdf::eval(point, wo, wi) - bsdf::eval_diffuse(point, wo, wi);
        (lobe * uneven_matt(point, wo, wi)).x
    }

    /// Truth: Schlick's term, 0.04 + 0.96 (1 − cos 80°)⁵ = 0.41 where light and eye face each other at 80° from the normal and so from the half vector; 0.04 where they
    /// are on one side. What is lost of even light, by which both are divided, albedos tell.
    #[test]
    fn of_light_that_faces_the_eye_the_matt_part_sends_a_third_less() {
        let (point, wo) = (plastic(1.0), seen_at(80f32.to_radians().cos()));
        let even = matt_albedo(&point, wo).x * FRAC_1_PI;
        let kept = 0.6 * FRAC_1_PI / even;
        let facing = beyond_share(&point, wo, Vec3::new(-wo.x, 0.0, wo.z)) / even;
        let beside = beyond_share(&point, wo, wo) / even;
        println!("{facing} {beside}");
        assert!((facing - (0.59 * kept - 1.0)).abs() < 0.005, "{facing}");
        assert!((beside - (0.96 * kept - 1.0)).abs() < 0.005, "{beside}");
        assert!(facing < -0.33 && beside > 0.0);
    }

    /// Truth: of even light a surface reflects what its albedos say, so that what the matt part sends beyond its share sums to nothing. Midpoints of 128 x 256
    /// directions; tables of albedos are within 3e-3.
    #[test]
    fn of_even_light_the_matt_part_sends_no_more_than_its_share() {
        for (alpha, cosine) in [(1.0, 0.1), (1.0, 0.5), (0.4, 0.2), (0.4, 0.9)] {
            let (point, wo) = (plastic(alpha), seen_at(cosine));
            let mut sum = 0.0;
            for k in 0..128 {
                // Even in the square of the cosine.
                let z = ((k as f32 + 0.5) / 128.0).sqrt();
                for l in 0..256 {
                    let (sin, cos) = (std::f32::consts::TAU * (l as f32 + 0.5) / 256.0).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let wi = Vec3::new(r * cos, r * sin, z);
                    sum += beyond_share(&point, wo, wi) * PI / (128.0 * 256.0);
                }
            }
            println!("alpha {alpha}, cosine {cosine}: {sum}");
            assert!(sum.abs() < 3e-3, "{sum}");
        }
    }
}
