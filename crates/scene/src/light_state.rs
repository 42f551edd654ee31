//! A light at one time, to tell whether it shines as it did.

use crate::animated::{Animated, Blend};
use crate::light::{EnvironmentMap, EnvironmentMaps, LightKind, LightTrack};
use glam::Vec3;
use std::sync::Arc;

/// A light at one time. Two of the same place in a sequence that are equal shine alike, to the bit.
#[derive(Clone, Debug)]
pub struct LightState {
    /// With constant values, and without an environment's maps.
    kind: LightKind,
    /// Of an environment its map.
    map: Option<Arc<EnvironmentMap>>,
}

/// Maps are equal if they are the same one: comparing their pixels would cost a pass over them.
impl PartialEq for LightState {
    fn eq(&self, other: &LightState) -> bool {
        let map = |state: &LightState| state.map.as_ref().map(Arc::as_ptr);
        map(self) == map(other) && self.kind == other.kind
    }
}

impl LightState {
    /// The same light at a colour of 1 ([`LightKind::color`]): what it is in proportion to is no part of this.
    pub fn white(mut self) -> LightState {
        *self.kind.color_mut() = Animated::Constant(Vec3::ONE);
        self
    }
}

impl LightTrack {
    /// The light at a time, in frames.
    pub fn state_at(&self, frame: f64) -> LightState {
        let mut kind = self.kind.clone();
        let mut map = None;
        match &mut kind {
            LightKind::Point { position, intensity } => {
                hold(position, frame);
                hold(intensity, frame);
            }
            LightKind::Spot {
                position,
                direction,
                inner_angle_deg,
                outer_angle_deg,
                intensity,
            } => {
                for value in [position, direction, intensity] {
                    hold(value, frame);
                }
                hold(inner_angle_deg, frame);
                hold(outer_angle_deg, frame);
            }
            LightKind::Ies {
                position,
                direction,
                up,
                scale,
                ..
            } => {
                for value in [position, direction, up, scale] {
                    hold(value, frame);
                }
            }
            LightKind::Directional {
                direction,
                irradiance,
            } => {
                hold(direction, frame);
                hold(irradiance, frame);
            }
            LightKind::Rect {
                center,
                edge_u,
                edge_v,
                radiance,
            } => {
                for value in [center, edge_u, edge_v, radiance] {
                    hold(value, frame);
                }
            }
            LightKind::Sphere {
                center,
                radius,
                radiance,
            } => {
                hold(center, frame);
                hold(radius, frame);
                hold(radiance, frame);
            }
            LightKind::Environment {
                maps,
                scale,
                rotation_deg,
                ..
            } => {
                map = Some(maps.at(frame));
                *maps = EnvironmentMaps::default();
                hold(scale, frame);
                hold(rotation_deg, frame);
            }
            LightKind::SunSky {
                turbidity,
                sun_direction,
                scale,
            } => {
                hold(turbidity, frame);
                hold(sun_direction, frame);
                hold(scale, frame);
            }
            LightKind::Weather {
                hours,
                scale,
                rotation_deg,
                ..
            } => {
                hold(hours, frame);
                hold(scale, frame);
                hold(rotation_deg, frame);
            }
            LightKind::Emissive { scale, .. } => hold(scale, frame),
        }
        LightState { kind, map }
    }
}

/// Makes a value the constant that it is at a time.
fn hold<T: Blend>(value: &mut Animated<T>, frame: f64) {
    *value = Animated::Constant(value.at(frame));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::animated::Interpolation;

    fn keys<T>(keys: Vec<(f64, T)>) -> Animated<T> {
        Animated::Keys {
            keys,
            interpolation: Interpolation::Linear,
        }
    }

    fn sphere(center: Animated<Vec3>) -> LightTrack {
        LightTrack {
            name: "lamp".into(),
            kind: LightKind::Sphere {
                center,
                radius: Animated::Constant(0.1),
                radiance: Animated::Constant(Vec3::ONE),
            },
        }
    }

    #[test]
    fn a_lamp_that_rests_between_moves_shines_alike_only_while_it_rests() {
        let lamp = sphere(keys(vec![(0.0, Vec3::ZERO), (4.0, Vec3::X), (8.0, Vec3::X)]));
        assert_eq!(lamp.state_at(5.0), lamp.state_at(7.5));
        assert_ne!(lamp.state_at(3.0), lamp.state_at(5.0));
        assert_eq!(
            lamp.state_at(4.0),
            sphere(Animated::Constant(Vec3::X)).state_at(0.0)
        );
    }

    #[test]
    fn a_lamp_that_is_dimmed_is_the_same_but_for_its_colour() {
        let lamp = |radiance: Vec3, center: Vec3| {
            let mut lamp = sphere(Animated::Constant(center));
            *lamp.kind.color_mut() = keys(vec![(0.0, radiance), (1.0, Vec3::ZERO)]);
            lamp.state_at(0.5)
        };
        assert_ne!(lamp(Vec3::ONE, Vec3::X), lamp(Vec3::X, Vec3::X));
        assert_eq!(lamp(Vec3::ONE, Vec3::X).white(), lamp(Vec3::X, Vec3::X).white());
        assert_ne!(lamp(Vec3::ONE, Vec3::X).white(), lamp(Vec3::ONE, Vec3::Y).white());
    }

    #[test]
    fn environments_are_alike_while_their_map_and_its_turn_are_the_same() {
        let black = || Arc::new(EnvironmentMap::default());
        let sky = |rotation_deg| LightTrack {
            name: "sky".into(),
            kind: LightKind::Environment {
                maps: EnvironmentMaps::of_frames(vec![black(), black()]).unwrap(),
                file: "sky_####.hdr".into(),
                scale: Animated::Constant(Vec3::ONE),
                rotation_deg,
            },
        };
        let still = sky(Animated::Constant(90.0));
        assert_eq!(still.state_at(0.0), still.state_at(0.5));
        assert_ne!(still.state_at(0.0), still.state_at(1.0), "another map");
        let turning = sky(keys(vec![(0.0, 0.0), (1.0, 90.0)]));
        assert_ne!(turning.state_at(0.0), turning.state_at(0.5));
    }
}
