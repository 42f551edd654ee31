//! Lights without extent that stand for others, and the rays to them.

use super::measured::MeasuredLamp;
use glam::Vec3;
use relight_scene::bsdf::Viewed;
use relight_scene::rays::{self, Ray, SurfacePoint};
use relight_scene::surface::{SurfaceHit, ray_from_end};
use relight_transport::point_light::{Arrival, Emission, PointLight};
use std::ops::Range;

/// Stages of the random streams: values of one must not repeat in another.
pub(super) mod stage {
    pub const AREA: u32 = 0x6d61_0001;
    pub const CELLS: u32 = 0x6d61_0002;
    pub const DISTANT: u32 = 0x6d61_0003;
    pub const THINNING: u32 = 0x6d61_0004;
    /// Of a sampler, not of a stream: mixed into its seed.
    pub const PARTICLES: u64 = 0x6d61_0005;
}

/// How many points stand for the lights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSettings {
    /// Points over all lights with an area together, at least one each; half of them go by power, half evenly to all
    /// lights, so that none is coarse where no other shines. `None`: 64 per light, and one per triangle of emissive
    /// surfaces up to 4096, shared out alike.
    pub area_samples: Option<u32>,
    /// Directions for each environment map. The paper (section 5) finds that scenes with much occlusion need 3000.
    pub environment: u32,
    /// Directions for the disc of the sun.
    pub sun: u32,
    /// Directions for its sky.
    pub sky: u32,
    /// Virtual lights: exactly as many, unless too few particles hit anything.
    pub vpls: u32,
    /// Largest share of the unclamped light at a pixel that a virtual light may have ([`clamp_limit`]).
    pub clamp: f32,
    /// Sets with different seeds are independent.
    pub seed: u64,
}

impl Default for PointSettings {
    fn default() -> Self {
        PointSettings {
            area_samples: None,
            environment: 3000,
            sun: 64,
            sky: 5000,
            vpls: 0,
            // Half of the error ratio of lightcuts, 2 % (section 5).
            clamp: 0.01,
            seed: 0,
        }
    }
}

/// Points for an area light where nobody says another number: what the paper's kitchen has.
pub(super) const POINTS_PER_AREA_LIGHT: usize = 64;
/// The same for emissive surfaces of many triangles, at most.
pub(super) const POINTS_PER_EMITTER: usize = 4096;

/// Where a light's shadow rays end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    /// At the point, or never.
    Free,
    /// On a surface, whose normal is the light's axis, within this clearance (metres).
    Surface { clearance: f32 },
    /// Where they meet the sphere of this index: matter inside does not hide its points (appendix A).
    Sphere(u32),
}

/// Middle and radius of a spherical light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sphere {
    pub center: Vec3,
    pub radius: f32,
}

/// Lights without extent that stand for all lights of a frame.
#[derive(Clone, Debug, Default)]
pub struct PointLights {
    /// World space: first what shines directly, then virtual lights. Intensities are finite and not negative, and, but for those of
    /// virtual lights that stand still, not all zero.
    pub lights: Vec<PointLight>,
    /// For each the light of the [`relight_scene::light_set::LightSet`] that it is of, or whose light it passes on.
    pub source: Vec<u32>,
    /// How many shine directly; the rest is virtual.
    pub direct: usize,
    /// [`PointSettings::clamp`].
    pub clamp: f32,
    pub(super) ends: Vec<End>,
    /// As [`PointLights::ends`].
    pub(super) surfaces: (f32, bool),
    pub(super) spheres: Vec<Sphere>,
    /// What [`Emission::Measured`] counts.
    pub(super) measured: Vec<MeasuredLamp>,
    /// The sets of virtual lights that stand still ([`super::StandingLights`]); they are the last ones.
    pub(crate) standing: Vec<Range<usize>>,
}

impl PointLights {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether nothing shines.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Whether a point is a virtual light.
    pub fn is_virtual(&self, i: usize) -> bool {
        i >= self.direct
    }

    /// Whether what a light gives is limited where it stands alone ([`clamp_limit`]): virtual lights without extent, whose light near by
    /// has no bound.
    pub fn is_clamped(&self, i: usize) -> bool {
        self.is_virtual(i) && !matches!(self.lights[i].emission, Emission::Patch(_))
    }

    /// Whether shadow rays end at the lights: those to spherical lights end where they meet the sphere.
    pub(crate) fn rays_end_at_lights(&self) -> bool {
        self.spheres.is_empty()
    }

    /// The largest clearance within which shadow rays end above surfaces (metres), and whether all of them do.
    pub(crate) fn ends(&self) -> (f32, bool) {
        self.surfaces
    }

    /// Adds a light unless it is dark or beyond what f32 holds.
    pub(super) fn push(&mut self, light: PointLight, source: u32, end: End) {
        if light.intensity.is_finite() && light.intensity.max_element() > 0.0 {
            self.lights.push(light);
            self.source.push(source);
            self.ends.push(end);
        }
    }

    /// What reaches `x` from light `i` if nothing is in between; `None` if nothing does.
    #[inline]
    pub fn arrival(&self, i: usize, x: Vec3) -> Option<Arrival> {
        let light = &self.lights[i];
        let arrival = light.arrival(x)?;
        let Emission::Measured { profile, .. } = light.emission else {
            return Some(arrival);
        };
        let factor = arrival.factor * self.measured.get(profile as usize)?.share(-arrival.direction);
        (factor > 0.0).then_some(Arrival { factor, ..arrival })
    }

    /// Radiance towards the viewer by light `i` if nothing is in between, before any clamp: M G I of the paper's equation 1,
    /// RGB. `None` where it is zero or beyond what f32 holds. `hit` and `point` are the same place.
    pub fn unoccluded(&self, i: usize, hit: &SurfaceHit, point: &Viewed<'_>) -> Option<Vec3> {
        let light = &self.lights[i];
        let arrival = self.arrival(i, hit.position)?;
        let reflected = point.reflected(arrival.direction);
        if reflected == Vec3::ZERO {
            return None;
        }
        // In f64: an intensity of 1e20 near by would overflow on the way.
        let irradiance = light.intensity.as_dvec3() * f64::from(arrival.factor);
        let radiance = (reflected.as_dvec3() * irradiance).as_vec3();
        (radiance.is_finite() && radiance != Vec3::ZERO).then_some(radiance)
    }

    /// The shadow ray from a point of a surface to light `i`: it meets neither the surface that it starts on nor one that
    /// the light lies on. `None` from where the light is not seen whatever is in between: inside of a spherical light.
    pub fn shadow_ray(&self, i: usize, from: &SurfacePoint) -> Option<Ray> {
        let light = &self.lights[i];
        if light.emission == Emission::Directional {
            return Some(ray_from_end(from, -light.axis));
        }
        match self.ends[i] {
            End::Free => Some(rays::shadow_ray_to_point(from, light.position)),
            End::Surface { clearance } => {
                let target = SurfacePoint {
                    position: light.position,
                    normal: light.axis,
                    clearance,
                };
                Some(rays::shadow_ray(from, &target))
            }
            End::Sphere(sphere) => {
                let Sphere { center, radius } = self.spheres[sphere as usize];
                let start = from.position.as_dvec3();
                let towards = light.position.as_dvec3() - start;
                let to_center = center.as_dvec3() - start;
                let squared = f64::from(radius) * f64::from(radius);
                // |from + t towards − center| = radius, the nearer t, without cancellation.
                let outside = to_center.length_squared() - squared;
                if outside <= 0.0 {
                    return None;
                }
                let along = to_center.dot(towards);
                let root = (along * along - towards.length_squared() * outside)
                    .max(0.0)
                    .sqrt();
                let t = (outside / (along + root)).clamp(0.0, 1.0);
                Some(rays::shadow_ray_to_point(from, (start + towards * t).as_vec3()))
            }
        }
    }
}

pub(super) fn surfaces(ends: &[End]) -> (f32, bool) {
    let clearance = |end: &End| match end {
        End::Surface { clearance } => Some(*clearance),
        End::Free | End::Sphere(_) => None,
    };
    let largest = ends.iter().filter_map(clearance).fold(0.0, f32::max);
    (largest, ends.iter().all(|end| clearance(end).is_some()))
}

/// Largest contribution of a virtual light, in the measure of [`clamped`], where all lights together give `total`
/// before any clamp, occlusion included: radiance, RGB.
///
/// The paper (section 5) limits every virtual light to a share of the total, since the light of a single one is
/// noise; clusters of them are not limited. Measure: the largest channel. As a share of the total it means the same at
/// any exposure; fewer virtual lights than 1 / `clamp` lose light even where they are alike.
pub fn clamp_limit(total: Vec3, clamp: f32) -> f32 {
    total.max_element() * clamp
}

/// The contribution of one virtual light, scaled down if its largest channel exceeds `limit`.
pub fn clamped(contribution: Vec3, limit: f32) -> Vec3 {
    let largest = contribution.max_element();
    if largest > limit {
        contribution * (limit / largest)
    } else {
        contribution
    }
}
