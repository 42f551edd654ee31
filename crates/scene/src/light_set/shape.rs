//! What every kind of light can do, at one frame.

use super::distant::Split;
use super::emitters::Emitters;
use super::form::LightForm;
use super::map::TurnedMap;
use crate::environment::luminance;
use crate::rays::SurfacePoint;
use crate::surface::SurfaceHit;
use glam::{DVec3, Vec3};

/// Where light is to arrive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferencePoint {
    /// World space.
    pub position: Vec3,
    /// Unit normal of the true surface, on the side that is looked at: no light from behind it is of use. Zero in free
    /// space, and where light from all sides is.
    pub normal: Vec3,
}

impl From<Vec3> for ReferencePoint {
    fn from(position: Vec3) -> ReferencePoint {
        ReferencePoint {
            position,
            normal: Vec3::ZERO,
        }
    }
}

impl From<&SurfaceHit> for ReferencePoint {
    fn from(hit: &SurfaceHit) -> ReferencePoint {
        ReferencePoint {
            position: hit.position,
            normal: hit.geometric_normal,
        }
    }
}

impl From<&SurfacePoint> for ReferencePoint {
    fn from(point: &SurfacePoint) -> ReferencePoint {
        ReferencePoint {
            position: point.position,
            normal: point.normal,
        }
    }
}

/// An emissive surface that a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetEmitter {
    /// Which primitive.
    pub primitive: u32,
    /// Barycentric weights of its vertices 1 and 2.
    pub barycentric: [f32; 2],
    /// How far the ray went, metres.
    pub distance: f64,
    /// Cosine between the ray and the geometric normal; its sign does not matter.
    pub cos: f64,
}

/// A direction in which a light is sampled from a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit vector from the point towards the light.
    pub direction: Vec3,
    /// Distance to the light; infinite for distant ones.
    pub distance: f32,
    /// Radiance divided by `pdf`; for lights without extent (`pdf` 0) the irradiance on a surface that faces
    /// the light. RGB, before any occlusion and cosine at the receiver.
    pub radiance_over_pdf: Vec3,
    /// Density per steradian; 0 for lights without extent.
    pub pdf: f32,
    /// Where on a light of the scene's own surfaces the sample lies; `None` for every other light.
    pub emitter: Option<EmitterPoint>,
}

/// A point of an emissive surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitterPoint {
    /// Which primitive; shadow rays must not be stopped by it.
    pub primitive: u32,
    /// Barycentric weights of its vertices 1 and 2.
    pub barycentric: [f32; 2],
    /// World space.
    pub position: Vec3,
    /// Unit normal on the emitting side that was drawn.
    pub normal: Vec3,
}

/// How a light meets rays and samples.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Extent {
    /// None: one sample says all about it.
    Delta,
    /// A surface of its own, which rays meet.
    Near,
    /// All around: samples do not depend on the place.
    Distant,
    /// Surfaces of the scene.
    Emissive,
}

/// A ray in f64.
pub(super) struct LongRay {
    pub from: DVec3,
    /// Unit.
    pub direction: DVec3,
    /// The same in f32.
    pub direction_f32: Vec3,
    /// How far it reaches; infinite for rays that leave the scene.
    pub reach: f64,
}

/// Radiance, and the density per steradian with which sampling draws that direction.
pub(super) struct Seen {
    pub radiance: Vec3,
    pub pdf: f32,
}

/// A light of one kind at one frame. Places are in world space.
pub(super) trait Shape: Send + Sync {
    fn extent(&self) -> Extent;

    /// Draws a direction from a place towards it, from three random numbers in [0, 1).
    fn sample(&self, scene: &dyn Emitters, at: &ReferencePoint, random: [f32; 3]) -> Option<LightSample>;

    /// What a ray meets of it; nothing of lights without extent and of the scene's own surfaces.
    fn met_by(&self, _ray: &LongRay) -> Option<Seen> {
        None
    }

    /// Factor on the emission of a primitive; `None` where it does not make that primitive shine.
    fn lights_up(&self, _primitive: u32) -> Option<Vec3> {
        None
    }

    /// Density per steradian with which sampling draws what a ray met of a surface that it makes shine.
    fn density_of(&self, _scene: &dyn Emitters, _met: &MetEmitter, _from: &ReferencePoint) -> f32 {
        0.0
    }

    /// About how much irradiance it can give at `from`, occlusion and the receiver's cosine aside.
    fn importance(&self, from: DVec3) -> f64;

    /// Power into a scene whose ball has a disc of this area, m²; RGB, W.
    fn power(&self, disc: f64) -> Vec3;

    /// What it is.
    fn form<'a>(&'a self, scene: &'a dyn Emitters) -> LightForm<'a>;

    /// What stays of it, and what comes from even directions: `parts` are those of its map. `None`: it stays as it is.
    fn split(&self, _parts: Option<&Split>) -> Option<(Box<dyn Shape>, TurnedMap)> {
        None
    }
}

/// Nothing shines.
pub(super) struct Dark;

impl Shape for Dark {
    fn extent(&self) -> Extent {
        Extent::Delta
    }

    fn sample(&self, _: &dyn Emitters, _: &ReferencePoint, _: [f32; 3]) -> Option<LightSample> {
        None
    }

    fn importance(&self, _: DVec3) -> f64 {
        0.0
    }

    fn power(&self, _: f64) -> Vec3 {
        Vec3::ZERO
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        LightForm::Dark
    }
}

/// Radiance over pdf goes through f64: 1e20 over 1e-20 must not overflow on the way.
pub(super) fn over(radiance: Vec3, pdf: f64) -> Vec3 {
    (radiance.as_dvec3() / pdf).as_vec3()
}

pub(super) fn times(rgb: Vec3, factor: f64) -> Vec3 {
    (rgb.as_dvec3() * factor).as_vec3()
}

pub(super) fn luminance64(rgb: Vec3) -> f64 {
    f64::from(luminance(rgb))
}

/// A sample of a light without extent; `intensity_towards` a unit direction from it, W/sr. `None` on the light.
pub(super) fn from_point(
    position: DVec3,
    at: &ReferencePoint,
    intensity_towards: impl FnOnce(DVec3) -> Vec3,
) -> Option<LightSample> {
    let d = position - at.position.as_dvec3();
    let squared = d.length_squared();
    let direction = d.try_normalize()?;
    Some(LightSample {
        direction: direction.as_vec3(),
        distance: squared.sqrt() as f32,
        radiance_over_pdf: over(intensity_towards(-direction), squared),
        pdf: 0.0,
        emitter: None,
    })
}

/// A sample of a light that has extent.
pub(super) fn extended(direction: Vec3, distance: f64, radiance: Vec3, pdf: f64) -> LightSample {
    LightSample {
        direction,
        distance: distance as f32,
        radiance_over_pdf: over(radiance, pdf),
        pdf: pdf as f32,
        emitter: None,
    }
}

/// Importance of a light of some power and size. No extended light is nearer than its own size, or one that touches
/// `from` would drown all others.
pub(super) fn attenuate(power: f64, from: DVec3, center: DVec3, radius: f64) -> f64 {
    let squared = (center - from).length_squared().max(radius * radius);
    if squared > 0.0 { power / squared } else { 0.0 }
}

/// Clamps what interpolation carried below zero; black where it is not finite.
pub(super) fn positive(v: Vec3) -> Vec3 {
    if v.is_finite() {
        v.max(Vec3::ZERO)
    } else {
        Vec3::ZERO
    }
}

/// [`DVec3`] of a world-space f32 vector of any length, as a unit vector; `None` for zero and NaN.
pub(super) fn unit(v: Vec3) -> Option<DVec3> {
    v.as_dvec3().try_normalize()
}
