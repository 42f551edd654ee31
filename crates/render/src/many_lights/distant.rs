//! Environments, sun and sky as directional lights.

use super::points::{End, PointLights, PointSettings, stage};
use glam::{DVec3, Vec2, Vec3};
use relight_scene::light_set::{DistantMap, LightForm};
use relight_transport::point_light::{Emission, PointLight};
use relight_transport::random::Stream;
use relight_transport::sampling::r2;
use std::f64::consts::TAU;

/// Adds the directions of one light.
pub(super) fn push(points: &mut PointLights, source: u32, form: &LightForm<'_>, settings: &PointSettings) {
    let mut stream = Stream::new(settings.seed, stage::DISTANT, u64::from(source));
    let mut start = || Vec2::new(stream.uniform(), stream.uniform());
    match form {
        LightForm::Environment(map) => push_map(points, source, map, settings.environment, start()),
        LightForm::SunSky {
            sky,
            sun,
            one_minus_cos,
            sun_radiance,
        } => {
            let solid_angle = TAU * one_minus_cos;
            let count = settings.sun.max(1);
            let irradiance = sun_radiance.as_dvec3() * (solid_angle / f64::from(count));
            let place = start();
            for k in 0..count {
                let towards = in_cone(*sun, *one_minus_cos, r2(k, place));
                push_direction(points, source, towards, irradiance);
            }
            push_map(points, source, sky, settings.sky, start());
        }
        _ => {}
    }
}

fn push_map(points: &mut PointLights, source: u32, map: &DistantMap<'_>, count: u32, start: Vec2) {
    let random = |i: usize| {
        let place = r2(i as u32, start);
        [place.x, place.y, 0.0]
    };
    for stratum in map.strata(count.max(1) as usize, random) {
        push_direction(points, source, stratum.towards, stratum.flux);
    }
}

fn push_direction(points: &mut PointLights, source: u32, towards: Vec3, irradiance: DVec3) {
    let light = PointLight {
        emission: Emission::Directional,
        position: Vec3::ZERO,
        axis: -towards,
        intensity: irradiance.as_vec3(),
    };
    points.push(light, source, End::Free);
}

/// A unit direction, uniform in the cone around `axis` whose half angle has the given 1 − cos.
fn in_cone(axis: Vec3, one_minus_cos: f64, place: Vec2) -> Vec3 {
    let axis = axis.as_dvec3();
    let lost = f64::from(place.x) * one_minus_cos;
    let sin = (lost * (2.0 - lost)).max(0.0).sqrt();
    let (sin_phi, cos_phi) = (f64::from(place.y) * TAU).sin_cos();
    let (u, v) = axis.any_orthonormal_pair();
    (axis * (1.0 - lost) + (u * cos_phi + v * sin_phi) * sin)
        .normalize()
        .as_vec3()
}
