//! Lights over time: what is prepared once, and the lights of a frame.

use super::directional::DirectionalLight;
use super::distant::Split;
use super::emissive::{EmissiveLight, EmissiveTable};
use super::emitters::Emitters;
use super::environment::EnvironmentLight;
use super::map::TurnedMap;
use super::point::{Cone, PointLight};
use super::profile::ProfileLight;
use super::rect::{Rect, RectLight};
use super::set::LightSet;
use super::shape::{Dark, Shape, positive, times, unit};
use super::sphere::{Sphere, SphereLight};
use super::sun_sky::SunSkyLight;
use crate::daylight::sun_sky_at;
use crate::environment::EnvironmentSampler;
use crate::light::{EnvironmentMap, EnvironmentMaps, LightKind, LightTrack};
use crate::photometry::LampAxes;
use glam::Vec3;
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

/// What lights over time need that does not change from frame to frame, light by light. Clones share it.
#[derive(Clone, Default)]
pub struct PreparedLights(Vec<Prepared>);

/// What one light needs.
#[derive(Clone)]
enum Prepared {
    Nothing,
    /// Of an environment of one map; no sampler if that is black.
    Map(Arc<EnvironmentMap>, Option<Arc<EnvironmentSampler>>),
    /// Of emissive surfaces of a material, or of all.
    Surfaces(Option<String>, Arc<EmissiveTable>),
}

impl PreparedLights {
    /// Prepares lights for a scene. Maps that several lights share are prepared once.
    ///
    /// # Errors
    /// An `emissive` light names a material that does not emit.
    pub fn new(emitters: &dyn Emitters, tracks: &[LightTrack]) -> Result<PreparedLights, LightSetError> {
        PreparedLights::default().again(emitters, tracks)
    }

    /// The same of other lights of the same surfaces: maps and surfaces that were prepared before are not prepared again.
    ///
    /// # Errors
    /// As [`PreparedLights::new`].
    pub fn again(
        &self,
        emitters: &dyn Emitters,
        tracks: &[LightTrack],
    ) -> Result<PreparedLights, LightSetError> {
        let mut all: Vec<Prepared> = self.0.clone();
        for track in tracks {
            let prepared = match &track.kind {
                LightKind::Environment { maps, .. } => maps.only().map(|map| {
                    let known = all.iter().find_map(|known| match known {
                        Prepared::Map(of, sampler) if Arc::ptr_eq(of, map) => Some(sampler.clone()),
                        _ => None,
                    });
                    let sampler = || EnvironmentSampler::new(map).map(Arc::new);
                    Prepared::Map(map.clone(), known.unwrap_or_else(sampler))
                }),
                LightKind::Emissive { material, .. } => {
                    let known = all.iter().find_map(|known| match known {
                        Prepared::Surfaces(of, table) if of == material => Some(table.clone()),
                        _ => None,
                    });
                    let table = match known {
                        Some(table) => table,
                        None => Arc::new(table_of(emitters, &track.name, material.as_deref())?),
                    };
                    Some(Prepared::Surfaces(material.clone(), table))
                }
                _ => None,
            };
            all.push(prepared.unwrap_or(Prepared::Nothing));
        }
        Ok(PreparedLights(all.split_off(self.0.len())))
    }

    /// What does not depend on surfaces.
    pub fn of_maps(&self) -> PreparedLights {
        let maps = self
            .0
            .iter()
            .filter(|prepared| matches!(prepared, Prepared::Map(..)));
        PreparedLights(maps.cloned().collect())
    }
}

/// Emissive surfaces of a material, or all.
fn table_of(
    emitters: &dyn Emitters,
    light: &str,
    material: Option<&str>,
) -> Result<EmissiveTable, LightSetError> {
    let (all, names) = (emitters.emissive_triangles(), emitters.material_names());
    let name_of = |of: u32| names.get(of as usize).map(String::as_str);
    let is_wanted = |of: u32| name_of(of).is_some_and(|name| material.is_none_or(|wanted| name == wanted));
    let chosen: Vec<u32> = (0..all.len() as u32)
        .filter(|&i| is_wanted(all[i as usize].material))
        .collect();
    if let (Some(material), true) = (material, chosen.is_empty()) {
        let mut known: Vec<String> = (all.iter())
            .map(|t| name_of(t.material).unwrap_or_default().to_owned())
            .collect();
        known.sort();
        known.dedup();
        return Err(LightSetError::NoSuchMaterial {
            light: light.to_owned(),
            material: material.to_owned(),
            known,
        });
    }
    Ok(EmissiveTable::new(all, chosen))
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

    /// The two parts of an environment's map at `frame` for `directions` even directions (see [`Split`]); `None` for other lights
    /// and black maps. Costs a pass over the map: keep it where [`LightRig::map_changes`] says no.
    pub fn split(&self, light: usize, frame: f64, directions: u32) -> Option<Split> {
        match &self.tracks[light].kind {
            LightKind::Environment { maps, .. } => {
                let sampler = self.sampler(light, maps, frame)?;
                Some(Split::new(&maps.at(frame), &sampler, directions))
            }
            _ => None,
        }
    }

    /// Whether a light is an environment with several maps.
    pub fn map_changes(&self, light: usize) -> bool {
        matches!(&self.tracks[light].kind, LightKind::Environment { maps, .. } if maps.only().is_none())
    }

    /// What draws directions of an environment at `frame`; `None` where it is black.
    fn sampler(&self, light: usize, maps: &EnvironmentMaps, frame: f64) -> Option<Arc<EnvironmentSampler>> {
        match maps.only() {
            Some(_) => match &self.prepared.0[light] {
                Prepared::Map(_, sampler) => sampler.clone(),
                _ => None,
            },
            None => EnvironmentSampler::new(&maps.at(frame)).map(Arc::new),
        }
    }

    /// The lights at `frame`. Values that interpolation carries out of their range (a negative intensity
    /// after a cubic overshoot) are clamped to it.
    pub fn at(&self, frame: f64) -> LightSet<'a> {
        self.set_of(&self.shapes(frame), &self.colors(frame))
    }

    /// The same; and again each at a colour of 1 ([`LightKind::color`]), with the colours that it is to be multiplied by.
    pub fn colored_at(&self, frame: f64) -> (LightSet<'a>, LightSet<'a>, Vec<Vec3>) {
        let (shapes, colors) = (self.shapes(frame), self.colors(frame));
        let white = self.set_of(&shapes, &vec![Vec3::ONE; colors.len()]);
        (self.set_of(&shapes, &colors), white, colors)
    }

    fn colors(&self, frame: f64) -> Vec<Vec3> {
        (self.tracks.iter())
            .map(|track| positive(track.kind.color().at(frame)))
            .collect()
    }

    fn shapes(&self, frame: f64) -> Vec<Option<Colored>> {
        (self.tracks.iter().enumerate())
            .map(|(i, track)| self.shape(i, &track.kind, frame))
            .collect()
    }

    fn set_of(&self, shapes: &[Option<Colored>], colors: &[Vec3]) -> LightSet<'a> {
        let lights = (self.tracks.iter().zip(shapes).zip(colors)).map(|((track, shape), color)| {
            let shape = shape.as_ref().map(|shape| shape(*color));
            (track.name.clone(), shape.unwrap_or_else(|| Box::new(Dark)))
        });
        LightSet::of_shapes(lights, self.emitters)
    }

    /// A light at `frame`, of any colour; `None` where nothing shines.
    fn shape(&self, i: usize, kind: &LightKind, frame: f64) -> Option<Colored> {
        Some(match kind {
            LightKind::Point { position, .. } => {
                let position = position.at(frame).as_dvec3();
                colored(move |intensity| PointLight {
                    position,
                    intensity,
                    cone: None,
                })
            }
            LightKind::Spot {
                position,
                direction,
                inner_angle_deg,
                outer_angle_deg,
                ..
            } => {
                let cos = |degrees: f32| f64::from(degrees.clamp(0.0, 90.0)).to_radians().cos();
                let cos_outer = cos(outer_angle_deg.at(frame));
                let position = position.at(frame).as_dvec3();
                let cone = Cone {
                    axis: unit(direction.at(frame))?,
                    cos_inner: cos(inner_angle_deg.at(frame)).max(cos_outer),
                    cos_outer,
                };
                colored(move |intensity| PointLight {
                    position,
                    intensity,
                    cone: Some(cone),
                })
            }
            LightKind::Ies {
                profile,
                position,
                direction,
                up,
                ..
            } => {
                let axes = LampAxes::new(direction.at(frame).as_dvec3(), up.at(frame).as_dvec3())?;
                let (position, profile) = (position.at(frame).as_dvec3(), profile.clone());
                let tilted = profile.tilted(axes.aim());
                colored(move |scale| ProfileLight {
                    position,
                    axes,
                    profile: profile.clone(),
                    scale: times(scale, tilted),
                })
            }
            LightKind::Directional { direction, .. } => {
                let towards = -unit(direction.at(frame))?;
                colored(move |irradiance| DirectionalLight { towards, irradiance })
            }
            LightKind::Rect {
                center,
                edge_u,
                edge_v,
                ..
            } => {
                let rect = Rect::new(center.at(frame), edge_u.at(frame), edge_v.at(frame))?;
                colored(move |radiance| RectLight { rect, radiance })
            }
            LightKind::Sphere { center, radius, .. } => {
                let sphere = Sphere {
                    center: center.at(frame).as_dvec3(),
                    radius: Some(f64::from(radius.at(frame))).filter(|&radius| radius > 0.0)?,
                };
                colored(move |radiance| SphereLight { sphere, radiance })
            }
            LightKind::Environment {
                maps, rotation_deg, ..
            } => {
                let (map, sampler) = (maps.at(frame), self.sampler(i, maps, frame)?);
                let turn = (f64::from(rotation_deg.at(frame)) / 360.0).rem_euclid(1.0) as f32;
                colored(move |scale| {
                    EnvironmentLight(TurnedMap {
                        map: map.clone(),
                        sampler: sampler.clone(),
                        scale,
                        turn,
                    })
                })
            }
            LightKind::SunSky { .. } | LightKind::Weather { .. } => {
                let (sky, _) = sun_sky_at(kind, frame)?;
                let white = SunSkyLight::new(sky)?;
                colored(move |scale| white.scaled(scale))
            }
            LightKind::Emissive { .. } => {
                let Prepared::Surfaces(_, table) = &self.prepared.0[i] else {
                    return None;
                };
                let table = table.clone();
                colored(move |scale| EmissiveLight {
                    table: table.clone(),
                    scale,
                })
            }
        })
    }
}

/// A light that may have any colour.
type Colored = Box<dyn Fn(Vec3) -> Box<dyn Shape>>;

fn colored<S: Shape + 'static>(of_color: impl Fn(Vec3) -> S + 'static) -> Colored {
    Box::new(move |color| Box::new(of_color(color)))
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
}
