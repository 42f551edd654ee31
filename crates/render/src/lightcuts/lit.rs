//! What clusters of lights give a receiver: the terms of Walter et al. 2005, equations 1 and 2.

use crate::lamp::cosine_over;
use crate::many_lights::{PointLights, clamped};
use glam::Vec3;
use relight_scene::bsdf::Viewed;
use relight_scene::bsdf::bounds::ReflectionBound;
use relight_scene::rays::{BvhPart, Ray};
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::{SurfaceHit, ray_end};
use relight_scene::traced::{Stop, TracedScene};
use relight_transport::light_bounds::{Axis, LightBox, geometric_bound};
use relight_transport::light_clusters::LightClusters;
use relight_transport::point_light::{Arrival, Emission};

/// How to choose cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightcutSettings {
    /// Most error of a cut's node, as a share of the light at the point. The paper: 2 % is not visible.
    pub error_ratio: f32,
    /// Most change that a node's parents make expect, in units of `error_ratio`; infinite as in the paper, which minds
    /// the bounds alone, and takes a cluster to be as visible as its representative.
    pub uncertainty: f32,
    /// Most nodes of a cut: reached in the dark only, where errors are not visible (section 3).
    pub max_nodes: usize,
}

impl Default for LightcutSettings {
    /// The paper's, but for the uncertainty: docs/notebook/lightcuts.md has what other values cost and give.
    fn default() -> Self {
        LightcutSettings {
            error_ratio: 0.02,
            uncertainty: 0.025,
            max_nodes: 1000,
        }
    }
}

/// Where light arrives and who looks at it.
pub(crate) struct Receiver<'a> {
    pub hit: &'a SurfaceHit,
    pub point: &'a ShadingPoint,
    /// Surface, m², that the place stands for.
    footprint: f32,
    viewed: Viewed<'a>,
    bound: ReflectionBound,
    axes: [Axis; 6],
}

impl<'a> Receiver<'a> {
    pub fn new(hit: &'a SurfaceHit, point: &'a ShadingPoint, wo: Vec3) -> Receiver<'a> {
        let bound = ReflectionBound::new(point, wo);
        Receiver {
            hit,
            point,
            footprint: 0.0,
            viewed: Viewed::new(point, wo),
            axes: bound.axes.map(Axis::new),
            bound,
        }
    }

    /// The same receiver as the middle of `footprint` m² of matt surface, over which light of near lamps is averaged
    /// ([`cosine_over`]). Bounds are those of the middle: a lamp nearer than the footprint is wide may exceed them.
    pub fn standing_for(mut self, footprint: f32) -> Receiver<'a> {
        self.footprint = footprint;
        self
    }

    /// A node's lights as seen from here.
    #[inline]
    pub fn sees(&self, clusters: &LightClusters, node: u32) -> LightBox {
        LightBox::new(
            &clusters.nodes[node as usize],
            clusters.emission(node),
            self.hit.position,
        )
    }

    /// Most that a node's lights can be reflected by, in all and the largest channel: radiance. Infinite near a
    /// cluster, 0 where none of its light is reflected.
    #[inline]
    pub fn node_bound(&self, clusters: &LightClusters, node: u32) -> f32 {
        let emission = clusters.emission(node);
        let cluster = &clusters.nodes[node as usize];
        let seen = self.sees(clusters, node);
        let geometric = geometric_bound(cluster, emission, &seen);
        if geometric <= 0.0 {
            return 0.0;
        }
        let reflected = self.bound.bound(|axis| {
            let angle = seen.angle(&self.axes[axis]);
            (angle.cos, angle.sin)
        });
        // First what cannot be infinite, or nothing times infinity would be no number.
        let most = (reflected * cluster.intensity).max_element();
        if most > 0.0 { most * geometric } else { 0.0 }
    }
}

/// All that stays the same for an image.
pub(crate) struct Lit<'a> {
    pub scene: &'a TracedScene,
    pub points: &'a PointLights,
    pub clusters: &'a LightClusters,
    pub settings: LightcutSettings,
}

/// Clusters that a node whose sight is closed is split into to see how much of it is seen. With 4 a tenth of the hall's
/// pixels are beyond 2 %, 16 take a sixth more time for a third of a percent (docs/notebook/lightcuts.md).
const PARTS_OF_CLUSTER: usize = 8;
/// The same where all of it is seen: half as many err by as little.
const PARTS_OF_SEEN: usize = 4;

/// A light's effect on a receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Term {
    /// Radiance per unit of the light's intensity: M G V of the paper's equation 1.
    pub radiance: Vec3,
    /// The same if nothing is in between.
    pub unshadowed: Vec3,
    /// The opaque triangle that hides it; `None` also where it sends nothing for other reasons.
    pub hidden_by: Option<u32>,
}

impl Term {
    pub fn with(self, radiance: Vec3) -> Term {
        Term { radiance, ..self }
    }

    pub const DARK: Term = Term {
        radiance: Vec3::ZERO,
        unshadowed: Vec3::ZERO,
        hidden_by: None,
    };
}

impl Lit<'_> {
    /// What light `i` gives, shadow ray included.
    pub fn term(&self, i: u32, receiver: &Receiver<'_>, shadow_rays: &mut u64) -> Term {
        let unshadowed = self.unshadowed(i, receiver);
        self.shadowed(i, unshadowed, receiver, |ray| {
            *shadow_rays += 1;
            self.scene.stop(ray)
        })
    }

    /// As [`Lit::term`], where nothing but `parts` may be in between.
    pub fn term_among(
        &self,
        i: u32,
        receiver: &Receiver<'_>,
        parts: &[BvhPart],
        shadow_rays: &mut u64,
    ) -> Term {
        let unshadowed = self.unshadowed(i, receiver);
        if self.is_clear(parts) {
            return Term {
                radiance: unshadowed,
                unshadowed,
                hidden_by: None,
            };
        }
        self.shadowed(i, unshadowed, receiver, |ray| {
            *shadow_rays += 1;
            self.scene.stop_among(ray, parts)
        })
    }

    /// Whether a light is seen for sure: one with a sphere is not from inside of it.
    fn is_clear(&self, parts: &[BvhPart]) -> bool {
        parts.is_empty() && self.points.rays_end_at_lights()
    }

    /// M G V of the paper's equation 1, where nothing but `parts` may be in between. Visibility is asked first, since most
    /// parts of a cluster in the dark are hidden, and shading takes longer.
    fn radiance_among(
        &self,
        i: u32,
        receiver: &Receiver<'_>,
        parts: &[BvhPart],
        shadow_rays: &mut u64,
    ) -> Option<Vec3> {
        let arrival = self.points.arrival(i as usize, receiver.hit.position)?;
        if receiver.point.shading_normal.dot(arrival.direction) <= 0.0 {
            return None;
        }
        if !self.is_clear(parts) {
            let ray = self.points.shadow_ray(i as usize, &ray_end(receiver.hit))?;
            *shadow_rays += 1;
            if self.scene.stop_among(&ray, parts).is_some() {
                return None;
            }
        }
        Some(self.reflected(i, &arrival, receiver))
    }

    /// M G of the paper's equation 1: radiance by light `i` per unit of its intensity, if nothing is in between.
    fn unshadowed(&self, i: u32, receiver: &Receiver<'_>) -> Vec3 {
        let arrival = self.points.arrival(i as usize, receiver.hit.position);
        arrival.map_or(Vec3::ZERO, |arrival| self.reflected(i, &arrival, receiver))
    }

    /// The same of what arrives.
    fn reflected(&self, i: u32, arrival: &Arrival, receiver: &Receiver<'_>) -> Vec3 {
        let Receiver { hit, point, .. } = *receiver;
        let light = &self.points.lights[i as usize];
        let reflected = receiver.viewed.reflected(arrival.direction);
        let stands_for_more = receiver.footprint > 0.0;
        if reflected == Vec3::ZERO || stands_for_more && hit.geometric_normal.dot(arrival.direction) <= 0.0 {
            return Vec3::ZERO;
        }
        let mut radiance = reflected * arrival.factor;
        if stands_for_more && light.emission != Emission::Directional {
            let distance = hit.position.distance(light.position);
            let cosine = point.shading_normal.dot(arrival.direction);
            radiance *= cosine_over(receiver.footprint, distance, cosine) / cosine;
        }
        radiance
    }

    fn shadowed(
        &self,
        i: u32,
        unshadowed: Vec3,
        receiver: &Receiver<'_>,
        stop: impl FnOnce(&Ray) -> Option<Stop>,
    ) -> Term {
        if unshadowed == Vec3::ZERO {
            return Term::DARK;
        }
        let Some(ray) = self.points.shadow_ray(i as usize, &ray_end(receiver.hit)) else {
            return Term::DARK;
        };
        let stop = stop(&ray);
        Term {
            radiance: if stop.is_some() { Vec3::ZERO } else { unshadowed },
            unshadowed,
            hidden_by: match stop {
                Some(Stop::Opaque(triangle)) if self.points.rays_end_at_lights() => Some(triangle),
                _ => None,
            },
        }
    }

    /// A node's radiance per unit of its intensity, where nothing but `parts` may be in between: the mean over the
    /// representatives of the clusters that it consists of, up to [`PARTS_OF_CLUSTER`].
    pub fn mean_among(
        &self,
        node: u32,
        receiver: &Receiver<'_>,
        parts: &[BvhPart],
        shadow_rays: &mut u64,
    ) -> Vec3 {
        let most = if parts.is_empty() {
            PARTS_OF_SEEN
        } else {
            PARTS_OF_CLUSTER
        };
        let mut clusters = [node; PARTS_OF_CLUSTER];
        // One after another gives way to its children until they are enough or all are lights.
        let (mut count, mut first, mut lights) = (1, 0, 0);
        while count < most && lights < count {
            match self.clusters.children(clusters[first]) {
                Some([a, b]) => {
                    clusters[first] = a;
                    clusters[count] = b;
                    count += 1;
                    lights = 0;
                }
                None => lights += 1,
            }
            first = (first + 1) % count;
        }
        let mut sum = Vec3::ZERO;
        for &cluster in &clusters[..count] {
            let representative = self.clusters.nodes[cluster as usize].representative;
            if let Some(radiance) = self.radiance_among(representative, receiver, parts, shadow_rays) {
                sum += self.estimate(cluster, Term::DARK.with(radiance));
            }
        }
        let intensity = self.clusters.nodes[node as usize].intensity;
        Vec3::select(intensity.cmpgt(Vec3::ZERO), sum / intensity, Vec3::ZERO)
    }

    /// Equation 2: a cluster's light, all of it as its representative's.
    #[inline]
    pub fn estimate(&self, node: u32, term: Term) -> Vec3 {
        let intensity = self.clusters.nodes[node as usize].intensity;
        // In f64: an intensity of 1e20 near by would overflow on the way.
        let radiance = (term.radiance.as_dvec3() * intensity.as_dvec3()).as_vec3();
        if radiance.is_finite() {
            radiance
        } else {
            Vec3::ZERO
        }
    }

    /// A node's estimate; virtual lights that stand alone are clamped to `limit`.
    pub fn clamped(&self, node: u32, term: Term, limit: f32) -> Vec3 {
        let radiance = self.estimate(node, term);
        let light = self.clusters.nodes[node as usize].representative as usize;
        if self.points.is_clamped(light) && self.clusters.children(node).is_none() {
            clamped(radiance, limit)
        } else {
            radiance
        }
    }
}
