//! The lights of one frame, ready to be sampled.
//!
//! [`LightRig`] prepares what does not change from frame to frame (tables of environment maps and of emissive
//! triangles); [`LightRig::at`] makes the [`LightSet`] of a frame. Units: design section 2.
//!
//! Rectangles and spheres of a sequence are light without matter: whoever looks at them sees their radiance
//! added to what lies behind, and they neither block nor reflect light, so that light layers add up and a
//! moving light does not change the scene that was baked.
//!
//! Geometry is evaluated in f64; no threshold is absolute, so lights of 1e-20 to 1e20 work at any scene scale.

mod alias;
mod distant;
mod emissive;
mod form;
mod rect;
mod scene_emitters;
mod sphere;
#[cfg(test)]
mod tests;

pub use distant::{DistantLight, Split};
pub use emissive::{EmissiveTriangle, Emitters, NoEmitters};
pub use form::{DistantMap, LightForm};
pub use scene_emitters::SceneEmitters;

use crate::environment::{EnvironmentSampler, direction_from_uv, luminance, uv_from_direction};
use crate::light::{EnvironmentMap, LightKind, LightTrack};
use crate::sky::{SUN_HALF_ANGLE, SunSky, sun_sky};
use emissive::EmissiveTable;
use glam::{DVec3, Vec3};
use rect::Rect;
use sphere::{Sphere, sample_cone, unit};
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;
use thiserror::Error;

/// Why lights cannot shine in a scene.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum LightSetError {
    /// An `emissive` light names a material that no emitting triangle has.
    #[error(
        "light {light:?}: no emissive surface has a material named {material:?}; emissive materials of this \
         scene: {}", if known.is_empty() { "none".to_string() } else { known.join(", ") }
    )]
    NoSuchMaterial {
        /// The light.
        light: String,
        /// The name that was not found.
        material: String,
        /// Names that would be found.
        known: Vec<String>,
    },
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

/// Light that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightHit {
    /// Which light.
    pub light: usize,
    /// Its radiance towards the ray's origin, RGB.
    pub radiance: Vec3,
    /// Density per steradian with which [`LightSet::sample`] draws the ray's direction from its origin.
    pub pdf: f32,
}

/// A light that lies in a surface is in front of it: this much of the ray's length counts as lying in it, as
/// much as [`crate::rays::shadow_ray_to_point`] stops short of a light.
const TOUCHING: f64 = 1.0 / (1u32 << 17) as f64;

/// What lights over time need that does not change from frame to frame. Clones share it.
#[derive(Clone)]
pub struct PreparedLights {
    /// Per light its environment sampler, if it is an environment that is not black.
    samplers: Vec<Option<Arc<EnvironmentSampler>>>,
    /// Per light its emissive triangles, if it is of that kind.
    tables: Vec<Option<Arc<EmissiveTable>>>,
}

impl PreparedLights {
    /// Prepares lights for a scene. Maps that several lights share are prepared once.
    ///
    /// # Errors
    /// An `emissive` light names a material that does not emit.
    pub fn new(emitters: &dyn Emitters, tracks: &[LightTrack]) -> Result<PreparedLights, LightSetError> {
        let all = emitters.emissive_triangles();
        let names = emitters.material_names();
        let name_of = |material: u32| names.get(material as usize).map_or("", String::as_str);
        let mut prepared: HashMap<*const EnvironmentMap, Option<Arc<EnvironmentSampler>>> = HashMap::new();
        let (mut samplers, mut tables) = (Vec::new(), Vec::new());
        for track in tracks {
            samplers.push(match &track.kind {
                LightKind::Environment { map, .. } => prepared
                    .entry(Arc::as_ptr(map))
                    .or_insert_with(|| EnvironmentSampler::new(map).map(Arc::new))
                    .clone(),
                _ => None,
            });
            tables.push(match &track.kind {
                LightKind::Emissive { material, .. } => {
                    let wanted = |t: &EmissiveTriangle| {
                        material
                            .as_ref()
                            .is_none_or(|material| name_of(t.material) == material)
                    };
                    let chosen: Vec<u32> = (0..all.len() as u32)
                        .filter(|&i| wanted(&all[i as usize]))
                        .collect();
                    if let (Some(material), true) = (material, chosen.is_empty()) {
                        let mut known: Vec<String> =
                            all.iter().map(|t| name_of(t.material).to_owned()).collect();
                        known.sort();
                        known.dedup();
                        return Err(LightSetError::NoSuchMaterial {
                            light: track.name.clone(),
                            material: material.clone(),
                            known,
                        });
                    }
                    Some(Arc::new(EmissiveTable::new(all, chosen)))
                }
                _ => None,
            });
        }
        Ok(PreparedLights { samplers, tables })
    }
}

/// Lights over time together with what can be prepared once for all frames.
pub struct LightRig<'a> {
    tracks: &'a [LightTrack],
    emitters: &'a dyn Emitters,
    prepared: PreparedLights,
}

impl<'a> LightRig<'a> {
    /// Prepares lights for a scene ([`PreparedLights::new`]).
    ///
    /// # Errors
    /// An `emissive` light names a material that does not emit.
    pub fn new(emitters: &'a dyn Emitters, tracks: &'a [LightTrack]) -> Result<LightRig<'a>, LightSetError> {
        let prepared = PreparedLights::new(emitters, tracks)?;
        Ok(LightRig::with(emitters, tracks, prepared))
    }

    /// Lights that were prepared before, of these tracks and emitters.
    pub fn with(
        emitters: &'a dyn Emitters,
        tracks: &'a [LightTrack],
        prepared: PreparedLights,
    ) -> LightRig<'a> {
        LightRig {
            tracks,
            emitters,
            prepared,
        }
    }

    /// The two parts of an environment's map for `directions` even directions (see [`Split`]); `None` for other lights
    /// and black maps. Costs a pass over the map: keep it.
    pub fn split(&self, light: usize, directions: u32) -> Option<Split> {
        match (&self.tracks[light].kind, &self.prepared.samplers[light]) {
            (LightKind::Environment { map, .. }, Some(sampler)) => Some(Split::new(map, sampler, directions)),
            _ => None,
        }
    }

    /// The lights at `frame`. Values that interpolation carries out of their range (a negative intensity
    /// after a cubic overshoot) are clamped to it.
    pub fn at(&self, frame: f64) -> LightSet<'a> {
        let lights = self
            .tracks
            .iter()
            .enumerate()
            .map(|(i, track)| Light {
                name: track.name.clone(),
                shape: self.shape(i, &track.kind, frame),
            })
            .collect();
        LightSet {
            lights,
            emitters: self.emitters,
        }
    }

    fn shape(&self, i: usize, kind: &LightKind, frame: f64) -> Shape {
        let positive = |v: Vec3| {
            if v.is_finite() {
                v.max(Vec3::ZERO)
            } else {
                Vec3::ZERO
            }
        };
        match kind {
            LightKind::Point { position, intensity } => Shape::Point {
                position: position.at(frame).as_dvec3(),
                intensity: positive(intensity.at(frame)),
                cone: None,
            },
            LightKind::Spot {
                position,
                direction,
                inner_angle_deg,
                outer_angle_deg,
                intensity,
            } => {
                let Some(axis) = unit(direction.at(frame)) else {
                    return Shape::Dark;
                };
                let cos = |degrees: f32| f64::from(degrees.clamp(0.0, 90.0)).to_radians().cos();
                let cos_outer = cos(outer_angle_deg.at(frame));
                let cos_inner = cos(inner_angle_deg.at(frame)).max(cos_outer);
                Shape::Point {
                    position: position.at(frame).as_dvec3(),
                    intensity: positive(intensity.at(frame)),
                    cone: Some(Cone {
                        axis,
                        cos_inner,
                        cos_outer,
                    }),
                }
            }
            LightKind::Directional {
                direction,
                irradiance,
            } => match unit(direction.at(frame)) {
                Some(d) => Shape::Directional {
                    towards: -d,
                    irradiance: positive(irradiance.at(frame)),
                },
                None => Shape::Dark,
            },
            LightKind::Rect {
                center,
                edge_u,
                edge_v,
                radiance,
            } => match Rect::new(center.at(frame), edge_u.at(frame), edge_v.at(frame)) {
                Some(rect) => Shape::Rect {
                    rect,
                    radiance: positive(radiance.at(frame)),
                },
                None => Shape::Dark,
            },
            LightKind::Sphere {
                center,
                radius,
                radiance,
            } => {
                let radius = f64::from(radius.at(frame));
                if radius.is_nan() || radius <= 0.0 {
                    return Shape::Dark;
                }
                let sphere = Sphere {
                    center: center.at(frame).as_dvec3(),
                    radius,
                };
                Shape::Sphere {
                    sphere,
                    radiance: positive(radiance.at(frame)),
                }
            }
            LightKind::Environment {
                map,
                scale,
                rotation_deg,
                ..
            } => match &self.prepared.samplers[i] {
                Some(sampler) => Shape::Environment(Environment {
                    map: map.clone(),
                    sampler: sampler.clone(),
                    scale: positive(scale.at(frame)),
                    turn: (f64::from(rotation_deg.at(frame)) / 360.0).rem_euclid(1.0) as f32,
                }),
                None => Shape::Dark,
            },
            LightKind::SunSky {
                turbidity,
                sun_direction,
                scale,
            } => {
                let SunSky {
                    sky,
                    sun_direction,
                    sun_radiance,
                } = sun_sky(turbidity.at(frame), sun_direction.at(frame));
                let scale = positive(scale.at(frame));
                let Some(sampler) = EnvironmentSampler::new(&sky) else {
                    return Shape::Dark;
                };
                let one_minus_cos = 2.0 * (SUN_HALF_ANGLE / 2.0).sin().powi(2);
                let sun = f64::from(luminance(sun_radiance)) * 2.0 * PI * one_minus_cos;
                // By irradiance the sun would take nearly every sample, and a place in its shade would see noise:
                // a disc this small needs no more than half of them.
                let chance = (sun / (sun + f64::from(luminance(sampler.flux())))).min(0.5);
                Shape::SunSky {
                    sky: Environment {
                        map: Arc::new(sky),
                        sampler: Arc::new(sampler),
                        scale,
                        turn: 0.0,
                    },
                    sun: SunDisc {
                        axis: sun_direction.as_dvec3().normalize(),
                        radiance: sun_radiance * scale,
                        one_minus_cos,
                        chance,
                    },
                }
            }
            LightKind::Emissive { scale, .. } => match &self.prepared.tables[i] {
                Some(table) => Shape::Emissive {
                    table: table.clone(),
                    scale: positive(scale.at(frame)),
                },
                None => Shape::Dark,
            },
        }
    }
}

/// The lights of one frame. A light's index is its place in the sequence.
pub struct LightSet<'a> {
    lights: Vec<Light>,
    emitters: &'a dyn Emitters,
}

struct Light {
    name: String,
    shape: Shape,
}

enum Shape {
    /// Nothing shines.
    Dark,
    Point {
        position: DVec3,
        intensity: Vec3,
        cone: Option<Cone>,
    },
    Directional {
        towards: DVec3,
        irradiance: Vec3,
    },
    Rect {
        rect: Rect,
        radiance: Vec3,
    },
    Sphere {
        sphere: Sphere,
        radiance: Vec3,
    },
    Environment(Environment),
    SunSky {
        sky: Environment,
        sun: SunDisc,
    },
    Emissive {
        table: Arc<EmissiveTable>,
        scale: Vec3,
    },
}

struct Cone {
    axis: DVec3,
    cos_inner: f64,
    cos_outer: f64,
}

impl Cone {
    /// KHR_lights_punctual: the square of a ramp in the cosine, from the outer to the inner angle. 0.001 is
    /// the extension's own smallest width of the ramp.
    fn falloff(&self, from_light: DVec3) -> f32 {
        let ramp = (self.axis.dot(from_light) - self.cos_outer) * self.ramp();
        ramp.clamp(0.0, 1.0).powi(2) as f32
    }

    /// Rise of the ramp per cosine.
    fn ramp(&self) -> f64 {
        1.0 / (self.cos_inner - self.cos_outer).max(1e-3)
    }

    /// ∫ falloff dω.
    fn solid_angle(&self) -> f64 {
        2.0 * PI * ((1.0 - self.cos_inner) + (self.cos_inner - self.cos_outer) / 3.0)
    }
}

#[derive(Clone)]
struct Environment {
    map: Arc<EnvironmentMap>,
    sampler: Arc<EnvironmentSampler>,
    scale: Vec3,
    /// Turns of the map about +Y.
    turn: f32,
}

impl Environment {
    fn map_uv(&self, direction: Vec3) -> [f32; 2] {
        let [u, v] = uv_from_direction(direction);
        let u = u + self.turn;
        [u - u.floor(), v]
    }

    fn radiance(&self, map_uv: [f32; 2]) -> Vec3 {
        self.map.at(map_uv) * self.scale
    }

    fn sample(&self, random: [f32; 2]) -> (Vec3, Vec3, f32) {
        let ([u, v], pdf) = self.sampler.sample(random);
        (direction_from_uv([u - self.turn, v]), self.radiance([u, v]), pdf)
    }
}

struct SunDisc {
    axis: DVec3,
    radiance: Vec3,
    one_minus_cos: f64,
    /// Chance that the sun is drawn rather than the sky.
    chance: f64,
}

impl SunDisc {
    fn contains(&self, direction: Vec3) -> bool {
        let d = direction.as_dvec3();
        // Between unit vectors, |a − b|² / 2 is 1 − cos without cancellation.
        (d.normalize() - self.axis).length_squared() * 0.5 <= self.one_minus_cos
    }

    fn pdf(&self) -> f64 {
        1.0 / (2.0 * PI * self.one_minus_cos)
    }
}

impl<'a> LightSet<'a> {
    /// The lights at one frame; shorthand for a [`LightRig`] that is used once.
    ///
    /// # Errors
    /// As [`LightRig::new`].
    pub fn new(
        emitters: &'a dyn Emitters,
        tracks: &'a [LightTrack],
        frame: f64,
    ) -> Result<LightSet<'a>, LightSetError> {
        Ok(LightRig::new(emitters, tracks)?.at(frame))
    }

    /// Number of lights, dark ones included.
    pub fn len(&self) -> usize {
        self.lights.len()
    }

    /// Whether there are no lights at all.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// The name of a light.
    ///
    /// # Panics
    /// `light` is not below [`LightSet::len`]; so for every method that takes a light's index.
    pub fn name(&self, light: usize) -> &str {
        &self.lights[light].name
    }

    /// Whether a light has no extent: one sample says all about it.
    pub fn is_delta(&self, light: usize) -> bool {
        matches!(
            self.lights[light].shape,
            Shape::Point { .. } | Shape::Directional { .. } | Shape::Dark
        )
    }

    /// Whether a light comes from all around, as [`LightTrack::is_distant`] has it: its samples do not depend on the place.
    pub fn is_distant(&self, light: usize) -> bool {
        matches!(
            self.lights[light].shape,
            Shape::Environment(_) | Shape::SunSky { .. }
        )
    }

    /// Whether a light is the scene's own emissive surfaces, which rays meet.
    pub fn is_emissive(&self, light: usize) -> bool {
        matches!(self.lights[light].shape, Shape::Emissive { .. })
    }

    /// Draws a direction from `x` (world space) towards a light, from three random numbers in [0, 1). `None`
    /// where that light sends nothing to `x` (or what was drawn turns its back: an estimate of zero).
    pub fn sample(&self, light: usize, x: Vec3, random: [f32; 3]) -> Option<LightSample> {
        let from = x.as_dvec3();
        let [r0, r1, r2] = random;
        // Radiance over pdf goes through f64: 1e20 over 1e-20 must not overflow on the way.
        let over = |radiance: Vec3, pdf: f64| (radiance.as_dvec3() / pdf).as_vec3();
        let extended = |direction: Vec3, distance: f64, radiance: Vec3, pdf: f64| LightSample {
            direction,
            distance: distance as f32,
            radiance_over_pdf: over(radiance, pdf),
            pdf: pdf as f32,
            emitter: None,
        };
        let sample = match &self.lights[light].shape {
            Shape::Dark => return None,
            Shape::Point {
                position,
                intensity,
                cone,
            } => {
                let d = *position - from;
                let squared = d.length_squared();
                let direction = d.try_normalize()?;
                let falloff = cone.as_ref().map_or(1.0, |cone| cone.falloff(-direction));
                LightSample {
                    direction: direction.as_vec3(),
                    distance: squared.sqrt() as f32,
                    radiance_over_pdf: over(*intensity * falloff, squared),
                    pdf: 0.0,
                    emitter: None,
                }
            }
            Shape::Directional { towards, irradiance } => LightSample {
                direction: towards.as_vec3(),
                distance: f32::INFINITY,
                radiance_over_pdf: *irradiance,
                pdf: 0.0,
                emitter: None,
            },
            Shape::Rect { rect, radiance } => {
                let (point, pdf) = rect.sample(from, [r0, r1])?;
                let d = point - from;
                extended(d.try_normalize()?.as_vec3(), d.length(), *radiance, pdf)
            }
            Shape::Sphere { sphere, radiance } => {
                let (direction, distance, pdf) = sphere.sample(from, [r0, r1])?;
                extended(direction.as_vec3(), distance, *radiance, pdf)
            }
            Shape::Environment(environment) => {
                let (direction, radiance, pdf) = environment.sample([r0, r1]);
                extended(direction, f64::INFINITY, radiance, f64::from(pdf))
            }
            Shape::SunSky { sky, sun } => {
                let direction = if f64::from(r2) < sun.chance {
                    sample_cone(sun.axis, sun.one_minus_cos, [r0, r1]).as_vec3()
                } else {
                    sky.sample([r0, r1]).0
                };
                let hit = sun_sky_hit(light, sky, sun, direction);
                extended(direction, f64::INFINITY, hit.radiance, f64::from(hit.pdf))
            }
            Shape::Emissive { table, scale } => {
                let drawn = table.sample(self.emitters.emissive_triangles(), from, random)?;
                // A ray would meet the surface with probability `coverage`.
                let radiance = self.emitters.emitted(drawn.primitive, drawn.barycentric)
                    * self.emitters.coverage(drawn.primitive, drawn.barycentric)
                    * *scale;
                let d = drawn.point - from;
                LightSample {
                    emitter: Some(EmitterPoint {
                        primitive: drawn.primitive,
                        barycentric: drawn.barycentric,
                        position: drawn.point.as_vec3(),
                        normal: drawn.normal.as_vec3(),
                    }),
                    ..extended(d.try_normalize()?.as_vec3(), d.length(), radiance, drawn.pdf)
                }
            }
        };
        let lit = sample.radiance_over_pdf.max_element() > 0.0 && sample.radiance_over_pdf.is_finite();
        lit.then_some(sample)
    }

    /// Calls `visit` for every rectangle and sphere that a ray (unit `direction`, world space) meets before
    /// `t_max` or within rounding of it, and, where `t_max` is infinite, for every environment.
    pub fn along(&self, origin: Vec3, direction: Vec3, t_max: f32, mut visit: impl FnMut(LightHit)) {
        let (from, d) = (origin.as_dvec3(), direction.as_dvec3());
        let reach = f64::from(t_max) * (1.0 + TOUCHING);
        for (light, Light { shape, .. }) in self.lights.iter().enumerate() {
            match shape {
                Shape::Rect { rect, radiance } => {
                    if let Some(t) = rect.hit(from, d)
                        && t < reach
                    {
                        let pdf = rect.pdf(from, from + t * d) as f32;
                        visit(LightHit {
                            light,
                            radiance: *radiance,
                            pdf,
                        });
                    }
                }
                Shape::Sphere { sphere, radiance } => {
                    if let Some(t) = sphere.hit(from, d)
                        && t < reach
                    {
                        visit(LightHit {
                            light,
                            radiance: *radiance,
                            pdf: sphere.pdf(from) as f32,
                        });
                    }
                }
                Shape::Environment(environment) if t_max == f32::INFINITY => {
                    let uv = environment.map_uv(direction);
                    let pdf = environment.sampler.pdf(uv);
                    visit(LightHit {
                        light,
                        radiance: environment.radiance(uv),
                        pdf,
                    });
                }
                Shape::SunSky { sky, sun } if t_max == f32::INFINITY => {
                    visit(sun_sky_hit(light, sky, sun, direction));
                }
                _ => {}
            }
        }
    }

    /// Calls `visit` for every light that makes a surface shine where a ray from `origin` met it at distance
    /// `distance`. `cos` is the cosine between the ray and the surface's geometric normal (its sign does not
    /// matter). The caller makes sure that the side that was met emits.
    pub fn emitted(
        &self,
        primitive: u32,
        barycentric: [f32; 2],
        distance: f32,
        cos: f32,
        mut visit: impl FnMut(LightHit),
    ) {
        let mut emission = None;
        for (light, Light { shape, .. }) in self.lights.iter().enumerate() {
            if let Shape::Emissive { table, scale } = shape
                && let Some(pdf) = table.pdf(primitive, f64::from(distance), f64::from(cos))
            {
                let emission = *emission.get_or_insert_with(|| self.emitters.emitted(primitive, barycentric));
                visit(LightHit {
                    light,
                    radiance: emission * *scale,
                    pdf: pdf as f32,
                });
            }
        }
    }

    /// Whether rays can meet any light ([`LightSet::along`]).
    pub fn any_along(&self) -> bool {
        let seen = |light: &Light| {
            matches!(
                light.shape,
                Shape::Rect { .. } | Shape::Sphere { .. } | Shape::Environment(_) | Shape::SunSky { .. }
            )
        };
        self.lights.iter().any(seen)
    }

    /// Whether any light makes surfaces shine.
    pub fn has_emissive(&self) -> bool {
        self.lights
            .iter()
            .any(|light| matches!(light.shape, Shape::Emissive { .. }))
    }

    /// About how much irradiance a light can give at `x`, occlusion and the receiver's cosine aside: for
    /// choosing among lights. Zero only where there is no light at all.
    pub fn importance(&self, light: usize, x: Vec3) -> f64 {
        let from = x.as_dvec3();
        let lum = |rgb: Vec3| f64::from(luminance(rgb));
        // No extended light is nearer than its own size, or one that touches x would drown all others.
        let attenuate = |power: f64, center: DVec3, radius: f64| {
            let squared = (center - from).length_squared().max(radius * radius);
            if squared > 0.0 { power / squared } else { 0.0 }
        };
        match &self.lights[light].shape {
            Shape::Dark => 0.0,
            Shape::Point {
                position,
                intensity,
                cone,
            } => {
                let d = from - *position;
                let falloff = match (cone, d.try_normalize()) {
                    (Some(cone), Some(direction)) => f64::from(cone.falloff(direction)),
                    _ => 1.0,
                };
                attenuate(lum(*intensity) * falloff, *position, 0.0)
            }
            Shape::Directional { irradiance, .. } => lum(*irradiance),
            Shape::Rect { rect, radiance } if rect.faces(from) => {
                attenuate(lum(*radiance) * rect.area, rect.center(), rect.area.sqrt() * 0.5)
            }
            Shape::Rect { .. } => 0.0,
            Shape::Sphere { sphere, radiance } => {
                let disc = PI * sphere.radius * sphere.radius;
                attenuate(lum(*radiance) * disc, sphere.center, sphere.radius)
            }
            // Half of the sphere of directions lies above a surface.
            Shape::Environment(environment) => 0.5 * lum(environment.sampler.flux() * environment.scale),
            Shape::SunSky { sky, sun } => {
                lum(sky.sampler.flux() * sky.scale) + lum(sun.radiance) * 2.0 * PI * sun.one_minus_cos
            }
            Shape::Emissive { table, scale } => {
                let power = lum((table.power / PI).as_vec3() * *scale);
                attenuate(power, table.center, table.radius)
            }
        }
    }

    /// Power that a light sends into a scene inside a ball of `radius` metres, RGB, W: all that near lights
    /// emit, and what of distant lights falls on the ball's disc.
    pub fn power(&self, light: usize, radius: f32) -> Vec3 {
        let disc = PI * f64::from(radius) * f64::from(radius);
        let times = |rgb: Vec3, factor: f64| (rgb.as_dvec3() * factor).as_vec3();
        match &self.lights[light].shape {
            Shape::Dark => Vec3::ZERO,
            Shape::Point { intensity, cone, .. } => {
                times(*intensity, cone.as_ref().map_or(4.0 * PI, Cone::solid_angle))
            }
            Shape::Directional { irradiance, .. } => times(*irradiance, disc),
            Shape::Rect { rect, radiance } => times(*radiance, PI * rect.area),
            Shape::Sphere { sphere, radiance } => times(*radiance, 4.0 * (PI * sphere.radius).powi(2)),
            Shape::Environment(environment) => times(environment.sampler.flux() * environment.scale, disc),
            Shape::SunSky { sky, sun } => {
                times(sky.sampler.flux() * sky.scale, disc)
                    + times(sun.radiance, 2.0 * PI * sun.one_minus_cos * disc)
            }
            Shape::Emissive { table, scale } => (table.power * scale.as_dvec3()).as_vec3(),
        }
    }
}

/// Radiance of sun and sky in a direction and the density of the mixture that samples them.
fn sun_sky_hit(light: usize, sky: &Environment, sun: &SunDisc, direction: Vec3) -> LightHit {
    let uv = sky.map_uv(direction);
    let mut radiance = sky.radiance(uv);
    let mut pdf = (1.0 - sun.chance) * f64::from(sky.sampler.pdf(uv));
    if sun.contains(direction) {
        radiance += sun.radiance;
        pdf += sun.chance * sun.pdf();
    }
    LightHit {
        light,
        radiance,
        pdf: pdf as f32,
    }
}
