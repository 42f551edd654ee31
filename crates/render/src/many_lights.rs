//! The lights of a frame as lights without extent, which lightcuts, pixelcuts and `brute` share.
//!
//! Source: Walter et al. 2005, section 5 and appendix A. Points, spots and directionals map one to one; rectangles and
//! emissive triangles become oriented lights on their surface, spheres omni lights inside them, environments
//! directional lights ([`relight_scene::environment_strata`]), lamps with photometric files points that know theirs (`measured`), sun and sky 64 and 5000 of them, and indirect light
//! virtual lights at what particles from all of these hit (`virtual_lights`), or at places that stand still,
//! whose light the caller knows ([`StandingLights`]).
//!
//! Every set is unbiased: over all seeds, the mean irradiance of unoccluded points is that of the lights themselves.
//! **Deviation:** what a light loses if it has fewer points than it has parts is spread over the rest, so its power is
//! right on average, not point by point.

mod area;
mod distant;
mod measured;
mod points;
mod standing;
mod virtual_lights;

#[cfg(test)]
mod tests;

pub use points::{PointLights, PointSettings, clamp_limit, clamped};
pub use standing::{Stand, StandingLights};

use glam::Vec3;
use measured::MeasuredLamp;
use points::{End, surfaces};
use relight_scene::light_set::{LightForm, LightSet};
use relight_scene::traced::TracedScene;
use relight_transport::point_light::{Emission, PointLight};

impl PointLights {
    /// Points for all lights of a frame, virtual ones included.
    pub fn new(scene: &TracedScene, lights: &LightSet<'_>, settings: &PointSettings) -> PointLights {
        let mut points = PointLights::that_shine(scene, lights, settings);
        points.add_virtual(scene, settings);
        points
    }

    /// Adds virtual lights where particles from what shines directly hit something.
    pub fn add_virtual(&mut self, scene: &TracedScene, settings: &PointSettings) {
        virtual_lights::push(self, scene, settings);
        self.surfaces = surfaces(&self.ends);
    }

    /// Points for what shines directly.
    pub fn that_shine(scene: &TracedScene, lights: &LightSet<'_>, settings: &PointSettings) -> PointLights {
        let mut points = PointLights {
            clamp: settings.clamp,
            ..PointLights::default()
        };
        let counts = area::counts(lights, settings.area_samples);
        for (light, &count) in counts.iter().enumerate() {
            let source = light as u32;
            let mut single = |emission, position, axis, intensity| {
                points.push(
                    PointLight {
                        emission,
                        position,
                        axis,
                        intensity,
                    },
                    source,
                    End::Free,
                );
            };
            match lights.form(light) {
                LightForm::Dark => {}
                LightForm::Profile {
                    position,
                    axes,
                    profile,
                    scale,
                } => {
                    let lamp = MeasuredLamp::new(axes, profile.clone());
                    let emission = lamp.emission(points.measured.len() as u32);
                    let intensity = (scale.as_dvec3() * profile.peak()).as_vec3();
                    let light = PointLight {
                        emission,
                        position,
                        axis: axes.aim().as_vec3(),
                        intensity,
                    };
                    points.measured.push(lamp);
                    points.push(light, source, End::Free);
                }
                LightForm::Point { position, intensity } => {
                    single(Emission::Omni, position, Vec3::ZERO, intensity);
                }
                LightForm::Spot {
                    position,
                    axis,
                    scale,
                    offset,
                    intensity,
                } => {
                    single(Emission::Spot { scale, offset }, position, axis, intensity);
                }
                LightForm::Directional { axis, irradiance } => {
                    single(Emission::Directional, Vec3::ZERO, axis, irradiance);
                }
                form @ (LightForm::Environment(_) | LightForm::SunSky { .. }) => {
                    distant::push(&mut points, source, &form, settings);
                }
                form => area::push(
                    &mut points,
                    scene,
                    lights.emitters(),
                    source,
                    &form,
                    count,
                    settings.seed,
                ),
            }
        }
        points.direct = points.lights.len();
        points.surfaces = surfaces(&points.ends);
        points
    }
}
