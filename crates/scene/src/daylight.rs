//! Sun and sky of the lights that are made of both.

use crate::light::{Day, LightKind, LightTrack};
use crate::perez::weather_sky;
use crate::sky::{SunSky, sun_sky};
use crate::sky_patches::SkyPatches;
use glam::{DQuat, Vec3};

/// Sun and sky of a light at a time, in frames, and the factor on both, RGB; `None` for lights that are neither `sun_sky` nor
/// `weather`.
pub fn sun_sky_at(kind: &LightKind, frame: f64) -> Option<(SunSky, Vec3)> {
    match kind {
        LightKind::SunSky {
            turbidity,
            sun_direction,
            scale,
        } => Some((
            sun_sky(turbidity.at(frame), sun_direction.at(frame)),
            scale.at(frame),
        )),
        LightKind::Weather {
            weather,
            day,
            hours,
            scale,
            rotation_deg,
            ..
        } => {
            let time = day.map_or(0.0, Day::hours) + f64::from(hours.at(frame));
            let (daylight, sun) = weather.at(time);
            let turn = DQuat::from_rotation_y(f64::from(rotation_deg.at(frame)).to_radians());
            Some((weather_sky(&daylight, turn * sun), scale.at(frame)))
        }
        _ => None,
    }
}

/// Mean radiance of each patch of the sky under all suns and skies of some lights at a time, in frames, RGB, W/(m² sr).
pub fn patches_at(lights: &[LightTrack], patches: &SkyPatches, frame: f64) -> Vec<Vec3> {
    let mut sum = vec![Vec3::ZERO; patches.len()];
    for light in lights {
        let Some((sky, scale)) = sun_sky_at(&light.kind, frame) else {
            continue;
        };
        // Interpolation may carry a factor out of its range.
        let scale = if scale.is_finite() {
            scale.max(Vec3::ZERO)
        } else {
            Vec3::ZERO
        };
        for (sum, radiance) in sum.iter_mut().zip(patches.radiance(&sky)) {
            *sum += radiance * scale;
        }
    }
    sum
}
