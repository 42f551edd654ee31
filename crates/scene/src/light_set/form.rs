//! What the lights of a frame are, for algorithms that take them apart, such as lights to points.

use super::{EmissiveTriangle, Environment, LightSet, Shape};
use crate::environment_strata::{Stratum, strata};
use glam::Vec3;

/// What a light is at one frame. World space, units of design section 2; every vector finite.
pub enum LightForm<'a> {
    /// Nothing shines.
    Dark,
    /// W/sr, the same in all directions.
    Point {
        /// Where it is.
        position: Vec3,
        /// RGB, W/sr.
        intensity: Vec3,
    },
    /// As a point light, times (cos · `scale` + `offset`) clamped to 0..1 and squared (KHR_lights_punctual).
    Spot {
        /// Where it is.
        position: Vec3,
        /// Unit, the way it shines.
        axis: Vec3,
        /// Of the cosine to the axis.
        scale: f32,
        /// See `scale`.
        offset: f32,
        /// RGB on the axis, W/sr.
        intensity: Vec3,
    },
    /// Parallel light.
    Directional {
        /// Unit, the way it shines.
        axis: Vec3,
        /// RGB, W/m² on a surface that faces it.
        irradiance: Vec3,
    },
    /// A parallelogram that emits towards `edge_u × edge_v`.
    Rect {
        /// One corner; the others are at + `edge_u`, + `edge_v` and + both.
        corner: Vec3,
        /// One full side.
        edge_u: Vec3,
        /// The other full side.
        edge_v: Vec3,
        /// RGB, W/(m² sr).
        radiance: Vec3,
    },
    /// A sphere that emits outwards.
    Sphere {
        /// Its middle.
        center: Vec3,
        /// Metres.
        radius: f32,
        /// RGB, W/(m² sr).
        radiance: Vec3,
    },
    /// Light from all around.
    Environment(DistantMap<'a>),
    /// Sun and sky.
    SunSky {
        /// The sky.
        sky: DistantMap<'a>,
        /// Unit, towards the middle of the sun's disc.
        sun: Vec3,
        /// Radius of the disc seen from the scene: 1 − cos of its half angle.
        one_minus_cos: f64,
        /// RGB, W/(m² sr).
        sun_radiance: Vec3,
    },
    /// Surfaces of the scene. Their emission is [`super::Emitters::emitted`] × [`super::Emitters::coverage`] × `scale`.
    Emissive {
        /// Which of them.
        triangles: Vec<&'a EmissiveTriangle>,
        /// RGB factor.
        scale: Vec3,
    },
}

/// An environment at one frame.
pub struct DistantMap<'a> {
    environment: &'a Environment,
}

impl DistantMap<'_> {
    /// At most `count` directions that stand for all of it, each for one of as many disjoint parts
    /// ([`mod@crate::environment_strata`]). `random(i)` are three uniform numbers in [0, 1) for part i.
    pub fn strata(&self, count: usize, random: impl FnMut(usize) -> [f32; 3]) -> Vec<Stratum> {
        let Environment { map, scale, turn, .. } = self.environment;
        let mut strata = strata(map, *turn, count, random);
        for stratum in &mut strata {
            stratum.flux *= scale.as_dvec3();
        }
        strata
    }
}

impl LightSet<'_> {
    /// What light `light` is.
    pub fn form(&self, light: usize) -> LightForm<'_> {
        match &self.lights[light].shape {
            Shape::Dark => LightForm::Dark,
            Shape::Point {
                position,
                intensity,
                cone,
            } => {
                let (position, intensity) = (position.as_vec3(), *intensity);
                match cone {
                    None => LightForm::Point { position, intensity },
                    Some(cone) => {
                        let scale = cone.ramp();
                        LightForm::Spot {
                            position,
                            axis: cone.axis.as_vec3(),
                            scale: scale as f32,
                            offset: (-cone.cos_outer * scale) as f32,
                            intensity,
                        }
                    }
                }
            }
            Shape::Directional { towards, irradiance } => LightForm::Directional {
                axis: -towards.as_vec3(),
                irradiance: *irradiance,
            },
            Shape::Rect { rect, radiance } => {
                let [corner, edge_u, edge_v] = rect.corner_and_edges().map(|v| v.as_vec3());
                LightForm::Rect {
                    corner,
                    edge_u,
                    edge_v,
                    radiance: *radiance,
                }
            }
            Shape::Sphere { sphere, radiance } => LightForm::Sphere {
                center: sphere.center.as_vec3(),
                radius: sphere.radius as f32,
                radiance: *radiance,
            },
            Shape::Environment(environment) => LightForm::Environment(DistantMap { environment }),
            Shape::SunSky { sky, sun } => LightForm::SunSky {
                sky: DistantMap { environment: sky },
                sun: sun.axis.as_vec3(),
                one_minus_cos: sun.one_minus_cos,
                sun_radiance: sun.radiance,
            },
            Shape::Emissive { table, scale } => {
                let all = self.emitters.emissive_triangles();
                LightForm::Emissive {
                    triangles: table.triangles.iter().map(|&i| &all[i as usize]).collect(),
                    scale: *scale,
                }
            }
        }
    }

    /// The surfaces of the scene that can emit.
    pub fn emitters(&self) -> &dyn super::Emitters {
        self.emitters
    }
}
