//! What lights give in photometric units: lumens, candela, and lux at a place.
//!
//! A watt of linear Rec. 709 light makes 683 lm, weighted by the luminance of its channels: the factor by which exporters of glTF turn watts into
//! candela. Where a scene's numbers were candela (`--light-units spec`), or a photometric file's, they are told as they are; suns and skies by
//! models, whose radiance is luminance over 179 lm/W, by that.

use crate::console::Console;
use crate::failure::Failure;
use crate::kinds::{self, Wanted as WantedKind};
use crate::signals::{self, Signals};
use crate::words::count;
use anyhow::anyhow;
use glam::{DVec3, Vec3};
use relight_format::layout::Kind;
use relight_format::{self as format, Limits};
use relight_play::frame::illuminance::{Arriving, arriving};
use relight_play::player::FrameError;
use relight_play::{FrameSettings, Player};
use relight_scene::environment::luminance;
use relight_scene::light::{LightKind, LightTrack};
use relight_scene::light_set::{LightForm, LightSet, NoEmitters, SceneEmitters};
use relight_scene::sequence::{Sequence, read_sequence_at, stage_from_json};
use relight_scene::sky::LUMENS_PER_WATT as OF_DAYLIGHT;
use serde::Serialize;
use std::path::Path;

/// Lumens of a watt, by the definition of the candela.
const LUMENS_PER_WATT: f64 = 683.0;
/// Directions over which the light of skies is summed.
const DIRECTIONS: u32 = 1 << 14;
/// Lights listed one by one for people; JSON has all.
const MOST_LISTED: usize = 40;

/// What is asked.
pub struct Wanted<'a> {
    /// A sequence, instead of the scene's own lights.
    pub lights: Option<&'a Path>,
    /// Of the sequence.
    pub frame: u32,
    /// In the coordinates of the scene's file.
    pub place: Option<DVec3>,
    /// Whether the scene's own lights have candela and lux as their numbers.
    pub own_in_candela: bool,
}

/// Photometric values of lights.
#[derive(Clone, Debug, Serialize)]
pub struct Photometric {
    /// The frame that they are of.
    frame: u32,
    /// Each light.
    lights: Vec<Light>,
    /// Lux at a place, if one was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    place: Option<Place>,
}

/// A light.
#[derive(Clone, Debug, Serialize)]
struct Light {
    name: String,
    r#type: String,
    /// Lumens that a watt of it counts for.
    lumens_per_watt: f64,
    /// All that it sends; of lights without end, and where the scene was not read, unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    lumens: Option<f64>,
    /// Largest luminous intensity.
    #[serde(skip_serializing_if = "Option::is_none")]
    candela: Option<f64>,
    /// Of lights without end: illuminance of the ground, or of a surface that faces a directional light.
    #[serde(skip_serializing_if = "Option::is_none")]
    lux: Option<f64>,
    /// What the photometric file of a lamp says itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    file_lumens: Option<f64>,
    /// At the place that was asked for, with shadows.
    #[serde(skip_serializing_if = "Option::is_none")]
    lux_at_place: Option<f64>,
}

/// A place, on a surface that faces up.
#[derive(Clone, Debug, Serialize)]
struct Place {
    position: [f64; 3],
    /// Direct and reflected light.
    lux: f64,
    lux_direct: f64,
    lux_reflected: f64,
}

/// What the lights that are wanted give.
///
/// # Errors
/// The asset or the sequence cannot be read, or it was stopped.
pub fn of(asset: &Path, wanted: &Wanted<'_>, console: &Console) -> Result<Photometric, Failure> {
    if wanted.lights.is_none() && wanted.place.is_none() {
        return own_lights(asset, wanted);
    }
    if let Some(file) = wanted.lights {
        kinds::check(file, WantedKind::Lights)?;
    }
    console.begin("Reading the asset", None);
    let player = Player::open(asset)?;
    let offset = player.scene().offset;
    let sequence = match wanted.lights {
        Some(file) => read_sequence_at(file, offset)?,
        None => player.own_lights()?.clone(),
    };
    check_frame(wanted.frame, &sequence)?;
    let time = f64::from(wanted.frame);
    let emitters = SceneEmitters::new(&player.prepared.scene);
    let set = LightSet::new(&emitters, &sequence.lights, time).map_err(|error| anyhow!("{error}"))?;
    let mut found = Photometric {
        frame: wanted.frame,
        lights: lights(&set, &sequence.lights, wanted, true),
        place: None,
    };
    if let Some(place) = wanted.place {
        console.begin("Lighting the place", None);
        found.place = Some(at_place(&player, &sequence, &mut found.lights, (place, time))?);
    }
    Ok(found)
}

fn check_frame(frame: u32, sequence: &Sequence) -> Result<(), Failure> {
    if frame < sequence.frames {
        return Ok(());
    }
    let last = sequence.frames.max(1) - 1;
    Err(Failure::Usage(format!(
        "--frame is {frame}, but the sequence has frames 0 to {last}"
    )))
}

/// The scene's own lights from their section alone.
fn own_lights(asset: &Path, wanted: &Wanted<'_>) -> Result<Photometric, Failure> {
    let parts = format::read_parts(asset, &Limits::default(), &[Kind::Stage])
        .map_err(|error| anyhow!("{}: {error}", asset.display()))?;
    // What cannot be read is told by who plays it.
    let (_, sequence) = stage_from_json(&parts.stage.json).unwrap_or_default();
    check_frame(wanted.frame, &sequence)?;
    // Emissive surfaces are not read.
    let (dark, others): (Vec<LightTrack>, Vec<LightTrack>) =
        (sequence.lights.into_iter()).partition(|track| matches!(track.kind, LightKind::Emissive { .. }));
    let set =
        LightSet::new(&NoEmitters, &others, f64::from(wanted.frame)).map_err(|error| anyhow!("{error}"))?;
    let mut lights = lights(&set, &others, wanted, false);
    lights.extend(dark.iter().map(|track| Light::new(track, wanted)));
    Ok(Photometric {
        frame: wanted.frame,
        lights,
        place: None,
    })
}

impl Light {
    /// Of which only the kind is known.
    fn new(track: &LightTrack, wanted: &Wanted<'_>) -> Light {
        let kind = serde_json::to_value(track).unwrap_or_default();
        let lumens_per_watt = match track.kind {
            LightKind::SunSky { .. } | LightKind::Weather { .. } => OF_DAYLIGHT,
            _ if wanted.lights.is_none() && wanted.own_in_candela => 1.0,
            _ => LUMENS_PER_WATT,
        };
        Light {
            name: track.name.clone(),
            r#type: kind["type"].as_str().unwrap_or_default().to_owned(),
            lumens_per_watt,
            lumens: None,
            candela: None,
            lux: None,
            file_lumens: match &track.kind {
                LightKind::Ies { profile, .. } => Some(profile.lumens()),
                _ => None,
            },
            lux_at_place: None,
        }
    }
}

fn lights(set: &LightSet<'_>, tracks: &[LightTrack], wanted: &Wanted<'_>, with_surfaces: bool) -> Vec<Light> {
    let one = |(i, track): (usize, &LightTrack)| {
        let mut light = Light::new(track, wanted);
        let photometric = |rgb: Vec3| f64::from(luminance(rgb)) * light.lumens_per_watt;
        let lumens = photometric(set.power(i, 1.0));
        let form = set.form(i);
        let candela = match &form {
            LightForm::Point { intensity, .. } | LightForm::Spot { intensity, .. } => {
                Some(photometric(*intensity))
            }
            LightForm::Profile { profile, scale, .. } => Some(photometric(*scale) * profile.peak()),
            LightForm::Rect {
                edge_u,
                edge_v,
                radiance,
                ..
            } => Some(photometric(*radiance) * f64::from(edge_u.cross(*edge_v).length())),
            LightForm::Sphere { radius, radiance, .. } => {
                Some(photometric(*radiance) * std::f64::consts::PI * f64::from(*radius).powi(2))
            }
            LightForm::Dark => Some(0.0),
            _ => None,
        };
        let lux = match &form {
            LightForm::Directional { irradiance, .. } => Some(photometric(*irradiance)),
            LightForm::Environment(_) | LightForm::SunSky { .. } => Some(photometric(on_the_ground(set, i))),
            _ => None,
        };
        light.lumens = (lux.is_none() && (with_surfaces || !set.is_emissive(i))).then_some(lumens);
        light.candela = candela.filter(|_| lux.is_none());
        light.lux = lux;
        light
    };
    tracks.iter().enumerate().map(one).collect()
}

/// Irradiance of level ground by a light without end, nothing in between.
fn on_the_ground(set: &LightSet<'_>, light: usize) -> Vec3 {
    let mut sum = DVec3::ZERO;
    for i in 0..DIRECTIONS {
        let place = relight_transport::sampling::r2(i, glam::Vec2::ZERO);
        let random = [place.x, place.y, (i as f32 + 0.5) / DIRECTIONS as f32];
        if let Some(sample) = set.sample(light, Vec3::ZERO, random) {
            sum += sample.radiance_over_pdf.as_dvec3() * f64::from(sample.direction.y.max(0.0));
        }
    }
    (sum / f64::from(DIRECTIONS)).as_vec3()
}

/// Lux at a place; lights whose watts count for as many lumens are reflected together.
fn at_place(
    player: &Player,
    sequence: &Sequence,
    lights: &mut [Light],
    (place, time): (DVec3, f64),
) -> Result<Place, Failure> {
    let here = (place - player.scene().offset).as_vec3();
    let (mut direct, mut reflected) = (0.0, 0.0);
    for factor in [1.0, OF_DAYLIGHT, LUMENS_PER_WATT] {
        let members: Vec<usize> = (0..lights.len())
            .filter(|&i| lights[i].lumens_per_watt == factor)
            .collect();
        if members.is_empty() {
            continue;
        }
        let tracks: Vec<LightTrack> = members.iter().map(|&i| sequence.lights[i].clone()).collect();
        let Arriving {
            direct: each,
            indirect,
        } = arriving(
            player,
            &player.lights(&tracks)?,
            time,
            (here, Vec3::Y),
            &FrameSettings::default(),
            &Signals,
        )
        .map_err(|error| match error {
            FrameError::Cancelled(_) => signals::failure(),
            other => other.into(),
        })?;
        for (&i, irradiance) in members.iter().zip(each) {
            let lux = f64::from(luminance(irradiance)) * factor;
            lights[i].lux_at_place = Some(lux);
            direct += lux;
        }
        // The operator's error may be below zero.
        reflected += f64::from(luminance(indirect)).max(0.0) * factor;
    }
    Ok(Place {
        position: place.to_array(),
        lux: direct + reflected,
        lux_direct: direct,
        lux_reflected: reflected,
    })
}

/// A number with three digits that count, of thousands four.
fn number(value: f64) -> String {
    if (1000.0..1e15).contains(&value) {
        let digits = value.log10().floor() as i32 - 3;
        let step = 10f64.powi(digits.max(0));
        count(((value / step).round() * step) as u64)
    } else if value == 0.0 || value >= 1e15 {
        format!("{value:.3e}").replace("0.000e0", "0")
    } else {
        let digits = 2 - value.log10().floor() as i32;
        format!("{value:.0$}", digits.clamp(0, 9) as usize)
    }
}

/// For people.
pub fn lines(found: &Photometric) -> Vec<String> {
    let mut lines: Vec<String> = (found.lights.iter().take(MOST_LISTED))
        .map(|light| {
            let mut parts = Vec::new();
            parts.extend(light.lumens.map(|lumens| format!("{} lm", number(lumens))));
            parts.extend(
                light
                    .candela
                    .map(|candela| format!("{} cd at most", number(candela))),
            );
            parts.extend(light.lux.map(|lux| match light.r#type.as_str() {
                "directional" => format!("{} lx on what faces it", number(lux)),
                _ => format!("{} lx on level ground", number(lux)),
            }));
            parts.extend(
                light
                    .lux_at_place
                    .map(|lux| format!("{} lx at the place", number(lux))),
            );
            if parts.is_empty() {
                parts.push("told with --lux or --lights".into());
            }
            let file = match light.file_lumens {
                Some(own) if light.lumens_per_watt != 1.0 => format!("; its file has {} lm", number(own)),
                _ => String::new(),
            };
            let unit = match light.lumens_per_watt {
                1.0 => "its candela".to_owned(),
                factor => format!("{factor} lm/W"),
            };
            format!("photometry {:?}: {} ({unit}{file})", light.name, parts.join(", "))
        })
        .collect();
    if found.lights.len() > MOST_LISTED {
        lines.push(format!(
            "photometry {} more lights in --json",
            found.lights.len() - MOST_LISTED
        ));
    }
    if let Some(place) = &found.place {
        let [x, y, z] = place.position;
        lines.push(format!(
            "photometry {} lx at {x}, {y}, {z}, facing up: {} direct, {} reflected",
            number(place.lux),
            number(place.lux_direct),
            number(place.lux_reflected)
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_have_the_digits_that_count() {
        for (value, text) in [
            (0.0, "0"),
            (0.01234, "0.0123"),
            (1.0, "1.00"),
            (12.56, "12.6"),
            (683.4, "683"),
            (1256.6, "1,257"),
            (123_456.0, "123,500"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
