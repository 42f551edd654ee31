//! Light of lamps that stand still: found once, and kept from frame to frame.
//!
//! Light adds up, so that a lamp that shines as it did in the last frame need not be computed again, whatever the others do. Its
//! random numbers depend on its place in the sequence alone: what is kept is what would be found again, to the bit. Coarse frames may get better than that:
//! what a careful one has found.

use crate::edition::Edition;
use crate::frame::settings::FrameSettings;
use glam::Vec3;
use relight_scene::light_state::LightState;
use std::sync::{Arc, Mutex, PoisonError};

/// Most memory that what is kept of one kind takes, bytes: direct light of some forty lamps at the fragments of 640 × 360 pixels. Further
/// lamps are found anew in every frame.
const MOST_BYTES: usize = 256 << 20;

/// What light of a lamp follows from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cause {
    pub light: Arc<LightState>,
    pub settings: FrameSettings,
    /// Whether visibility cuts take what of it comes from even directions.
    pub by_directions: bool,
    /// Whether it is wanted at points, and at surface samples.
    pub starts: [bool; 2],
    /// Materials.
    pub edition: Edition,
}

impl Cause {
    /// What direct light at points and surface samples follows from: settings of pixels are not among it.
    pub fn at_points(&self) -> Cause {
        Cause {
            settings: FrameSettings {
                pixel_samples: 0,
                ..self.settings.of_light()
            },
            ..self.clone()
        }
    }

    /// Whether light of this cause is also what is wanted of another: the same, or for a coarse frame the same found with care.
    fn serves(&self, wanted: &Cause) -> bool {
        let with_care = || Cause {
            settings: FrameSettings {
                coarse: false,
                point_samples: self.settings.point_samples,
                ..wanted.settings
            },
            ..wanted.clone()
        };
        self == wanted || (wanted.settings.coarse && *self == with_care())
    }

    /// What direct light at fragments follows from: settings of points are not among it.
    pub fn at_pixels(&self) -> Cause {
        Cause {
            settings: FrameSettings {
                point_samples: 0,
                coarse: false,
                ..self.settings.of_light()
            },
            ..self.clone()
        }
    }
}

/// Light as it is kept.
pub(crate) trait Kept {
    /// Memory that it takes.
    fn bytes(&self) -> usize;
}

impl Kept for Vec<Vec3> {
    fn bytes(&self) -> usize {
        size_of_val(self.as_slice())
    }
}

impl<K: Kept> Kept for Option<K> {
    fn bytes(&self) -> usize {
        self.as_ref().map_or(0, K::bytes)
    }
}

/// Light of lamps, of those that stand still.
#[derive(Debug)]
pub(crate) struct Still<K> {
    /// Per light of the sequence.
    lamps: Mutex<Vec<Lamp<K>>>,
}

#[derive(Debug)]
struct Lamp<K> {
    /// What it was the last time.
    cause: Option<Cause>,
    light: Option<Arc<K>>,
}

impl<K> Default for Still<K> {
    fn default() -> Still<K> {
        Still {
            lamps: Mutex::default(),
        }
    }
}

impl<K> Still<K> {
    /// Forgets all of it.
    pub fn forget(&self) {
        self.lamps.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

impl<K: Kept> Still<K> {
    /// The light of a lamp: what is kept, if its cause is as it was or a coarse frame asks for what was found with care, else what `make`
    /// makes, which is kept unless the lamp has just moved. And whether it was kept.
    pub fn light_of(&self, lamp: usize, cause: &Cause, make: impl FnOnce() -> K) -> (Arc<K>, bool) {
        let moved = {
            let mut lamps = self.lamps.lock().unwrap_or_else(PoisonError::into_inner);
            if lamps.len() <= lamp {
                lamps.resize_with(lamp + 1, || Lamp {
                    cause: None,
                    light: None,
                });
            }
            let known = &mut lamps[lamp];
            let stands = known.cause.as_ref().is_some_and(|known| known.serves(cause));
            match &known.light {
                Some(light) if stands => return (light.clone(), true),
                _ => {}
            }
            let before = known.cause.replace(cause.clone());
            known.light = None;
            before.is_some_and(|before| before.light != cause.light || before.edition != cause.edition)
        };
        let light = Arc::new(make());
        if !moved {
            let mut lamps = self.lamps.lock().unwrap_or_else(PoisonError::into_inner);
            let kept: usize = (lamps.iter().flat_map(|lamp| &lamp.light))
                .map(|light| light.bytes())
                .sum();
            // Meanwhile another frame may have moved the lamp, or all been forgotten.
            let known = (lamps.get_mut(lamp)).filter(|known| known.cause.as_ref() == Some(cause));
            if let Some(known) = known.filter(|_| kept + light.bytes() <= MOST_BYTES) {
                known.light = Some(light.clone());
            }
        }
        (light, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_scene::animated::Animated;
    use relight_scene::light::{LightKind, LightTrack};

    fn cause(x: f32) -> Cause {
        let lamp = LightTrack {
            name: "lamp".into(),
            kind: LightKind::Point {
                position: Animated::Constant(Vec3::X * x),
                intensity: Animated::Constant(Vec3::ONE),
            },
        };
        Cause {
            light: Arc::new(lamp.state_at(0.0)),
            settings: FrameSettings::default(),
            by_directions: false,
            starts: [true, false],
            edition: Edition::default(),
        }
    }

    /// Whether light had to be made, place after place of a lamp.
    fn made(still: &Still<Vec<Vec3>>, places: &[f32]) -> Vec<bool> {
        let of = |&x| {
            let (light, kept) = still.light_of(0, &cause(x), || vec![Vec3::splat(x)]);
            assert_eq!(*light, [Vec3::splat(x)]);
            !kept
        };
        places.iter().map(of).collect()
    }

    #[test]
    fn the_light_of_a_lamp_that_stands_still_is_made_once_and_kept_until_it_moves() {
        let still = Still::default();
        assert_eq!(
            made(&still, &[1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0]),
            [true, false, false, true, true, true, false]
        );
    }

    #[test]
    fn other_settings_and_other_materials_are_other_light() {
        let still = Still::default();
        let make = |cause: &Cause| still.light_of(0, cause, || vec![Vec3::ONE]).1;
        let first = cause(1.0);
        assert_eq!([make(&first), make(&first)], [false, true]);
        let seed = Cause {
            settings: FrameSettings {
                seed: 1,
                ..FrameSettings::default()
            },
            ..first.clone()
        };
        assert!(!make(&seed) && make(&seed), "the lamp has not moved");
        let layers = FrameSettings {
            light_layers: true,
            point_samples: 1,
            ..seed.settings
        };
        let more = Cause {
            settings: layers,
            ..seed.clone()
        };
        assert_eq!(more.at_pixels(), seed.at_pixels());
        assert_ne!(more.at_points(), seed.at_points());
        let edition = Edition { edits: 1, moves: 0 };
        assert!(!make(&Cause { edition, ..seed }));
    }

    #[test]
    fn a_coarse_frame_takes_what_a_careful_one_has_found_and_not_the_other_way_round() {
        let still = Still::default();
        let is_kept = |x: f32, coarse: bool| {
            let point_samples = if coarse { 1 } else { 4 };
            let of = Cause {
                settings: FrameSettings {
                    coarse,
                    point_samples,
                    ..FrameSettings::default()
                },
                ..cause(x)
            };
            let made = if coarse { Vec3::ONE } else { Vec3::ZERO };
            let (light, kept) = still.light_of(0, &of, || vec![made]);
            (kept, light[0] == Vec3::ZERO)
        };
        let (coarse, careful) = (true, false);
        assert_eq!(is_kept(1.0, coarse), (false, false));
        assert_eq!(is_kept(1.0, careful), (false, true));
        assert_eq!(is_kept(1.0, coarse), (true, true));
        assert_eq!(is_kept(1.0, careful), (true, true));
        assert_eq!(is_kept(2.0, coarse), (false, false), "the lamp has moved");
    }

    #[test]
    fn light_may_be_forgotten_while_it_is_made() {
        let still = Still::default();
        let light_of = |forgets: bool| {
            still.light_of(3, &cause(1.0), || {
                if forgets {
                    still.forget();
                }
                vec![Vec3::ONE]
            })
        };
        assert_eq!(light_of(true), (Arc::new(vec![Vec3::ONE]), false));
        assert_eq!(
            [light_of(false).1, light_of(false).1],
            [false, true],
            "nothing was kept"
        );
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let still = Still::default();
        let many = || vec![Vec3::ONE; MOST_BYTES / 12 / 2];
        let kept = |lamp| {
            still.light_of(lamp, &cause(1.0), many);
            still.light_of(lamp, &cause(1.0), many).1
        };
        assert_eq!([kept(0), kept(1), kept(2)], [true, true, false]);
    }
}
