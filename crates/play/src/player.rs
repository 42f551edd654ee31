//! The front door: an asset, lights and a camera to frames.

use crate::camera::{CameraError, camera_of};
use crate::choice::{Choice, ChoiceError, CutKind, CutUse, Integrator};
use crate::edited::{EditError, Edited};
use crate::edition::Edition;
use crate::frame::light::{Lit, cut_use, light};
use crate::frame::light_cut::{LightCut, light_cut};
use crate::frame::resolve::resolve;
use crate::frame::settings::FrameSettings;
use crate::frame::stats::{FrameStats, RelitStats, milliseconds};
use crate::frame::traced::traced;
use crate::kept::{self, LeftOutError};
use crate::lights::Lights;
use crate::open::{self, OpenError, Sections};
use crate::prepared::PreparedScene;
use crate::reflections::{FIXED_RAYS, MOVING_RAYS};
use crate::shot::{MOVING_SAMPLES, RelitShot, STANDING_SAMPLES, Shot, ShotSettings, ShotTimes, TracedShot};
use glam::Vec3;
use relight_format::{Asset, Estimates, Provenance};
use relight_render::expose::expose_watched;
use relight_render::exposure::Exposure;
use relight_render::layers::RenderSize;
use relight_render::lightcuts::{AT_PIXELS, worthwhile};
use relight_render::watch::{Cancelled, Watch, go_on};
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::light_set::LightSetError;
use relight_scene::material_edits::{MaterialEdits, read_material_edits};
use relight_scene::scene::Scene;
use relight_scene::sequence::Sequence;
use relight_scene::surface::SurfaceHit;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// An asset, ready to be lit.
///
/// A player is shared by any number of [`Shot`]s (what a camera sees) and [`Lights`] (what is prepared of a sequence once), which
/// are all that is kept from frame to frame, with the light of lamps that stand still. Only edits of materials change it.
pub struct Player {
    /// Surfaces and operators.
    pub prepared: PreparedScene,
    /// Where the asset came from.
    pub provenance: Provenance,
    /// What the bake expects of its errors, if it said.
    pub estimates: Option<Estimates>,
    /// Identifies the file's content: the header's hash, which covers the table's checksum, which covers
    /// those of all sections.
    pub hash: u64,
    /// The asset's file, for messages.
    file: PathBuf,
    edited: Option<Edited>,
    edition: Edition,
}

/// One frame.
pub struct Frame {
    /// `beauty` = `emission` + `direct` + `indirect`, W/(m² sr), linear RGB, and `A`, the share of each pixel that shows scene; where asked
    /// for `light.NAME` for each light, and `background`, `albedo`, `normal`, `depth` and `depth.ray`.
    pub layers: Layers,
    /// How its light was made, and why.
    pub choice: Choice,
    /// What it took.
    pub stats: FrameStats,
}

/// Why lights cannot play.
#[derive(Debug, thiserror::Error)]
pub enum LightsError {
    /// The asset lacks what they need.
    #[error(transparent)]
    LeftOut(#[from] LeftOutError),
    /// They do not fit the scene.
    #[error(transparent)]
    Set(#[from] LightSetError),
}

/// Why there is no camera to play.
#[derive(Debug, thiserror::Error)]
pub enum PlayCameraError {
    /// None is found.
    #[error("{}: {source}", file.display())]
    Camera {
        /// The asset.
        file: PathBuf,
        /// What is wrong.
        source: CameraError,
    },
    /// The asset was baked for others.
    #[error(transparent)]
    LeftOut(#[from] LeftOutError),
}

/// Why there is no shot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShotError {
    /// The asset lacks what the integrator takes.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// It was stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Why there is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FrameError {
    /// It was stopped from outside.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The player's materials have changed since the shot was made.
    #[error("the shot shows materials that have changed: refresh it, or make another")]
    Stale,
}

impl Player {
    /// Opens an asset for any integrator.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open(path: impl AsRef<Path>) -> Result<Player, OpenError> {
        Player::open_sections(path.as_ref(), Sections::All)
    }

    /// Opens an asset for one integrator: without operators, which are most of it, where it needs none.
    ///
    /// # Errors
    /// [`OpenError`].
    pub fn open_for(path: impl AsRef<Path>, integrator: &Integrator) -> Result<Player, OpenError> {
        let sections = if integrator.needs_operators() {
            Sections::All
        } else {
            Sections::Scene
        };
        Player::open_sections(path.as_ref(), sections)
    }

    fn open_sections(path: &Path, sections: Sections) -> Result<Player, OpenError> {
        let asset = open::read(path, sections)?;
        let hash = open::asset_hash(path).map_err(|source| OpenError::Format {
            file: path.to_path_buf(),
            source,
        })?;
        Player::of_asset(asset, hash, path, sections)
    }

    /// A player of what has been read already, or was never in a file: `file` is for messages, `hash` identifies the
    /// content.
    ///
    /// # Errors
    /// [`OpenError`], all but `Format`.
    pub fn of_asset(
        asset: Asset,
        hash: u64,
        file: impl AsRef<Path>,
        sections: Sections,
    ) -> Result<Player, OpenError> {
        let file = file.as_ref();
        let opened = open::opened(asset, file, sections)?;
        Ok(Player {
            provenance: opened.provenance,
            estimates: opened.estimates,
            hash,
            file: file.to_path_buf(),
            ..Player::new(opened.prepared)
        })
    }

    /// A player of what was in no asset.
    pub fn new(prepared: PreparedScene) -> Player {
        Player {
            prepared,
            provenance: Provenance::default(),
            estimates: None,
            hash: 0,
            file: PathBuf::new(),
            edited: None,
            edition: Edition::default(),
        }
    }

    /// The scene as it was baked: cameras, own lights, materials.
    pub fn scene(&self) -> &Arc<Scene> {
        self.prepared.scene.scene()
    }

    /// The sequence of the scene's own lights.
    ///
    /// # Errors
    /// They were left out, or it has none.
    pub fn own_lights(&self) -> Result<&Sequence, LeftOutError> {
        let own = &self.scene().sequence;
        kept::check_own_lights(&self.provenance, own)?;
        Ok(own)
    }

    /// Prepares lights to play.
    ///
    /// # Errors
    /// They want what the asset lacks.
    pub fn lights(&self, tracks: &[LightTrack]) -> Result<Lights, LightsError> {
        kept::check_emission(&self.provenance, tracks)?;
        let lights = Lights::new(&self.prepared.scene, tracks, self.prepared.directions())?;
        Ok(lights)
    }

    /// The same after others: maps and surfaces that those had are not prepared again.
    ///
    /// # Errors
    /// As [`Player::lights`].
    pub fn lights_after(&self, before: &Lights, tracks: &[LightTrack]) -> Result<Lights, LightsError> {
        kept::check_emission(&self.provenance, tracks)?;
        let lights = before.again(&self.prepared.scene, tracks, self.prepared.directions())?;
        Ok(lights)
    }

    /// The camera of this name, else that of the sequence, else the scene's first.
    ///
    /// # Errors
    /// There is none, or the asset was baked for others.
    pub fn camera(&self, sequence: &Sequence, name: Option<&str>) -> Result<CameraTrack, PlayCameraError> {
        let track = camera_of(self.scene(), sequence, name).map_err(|source| PlayCameraError::Camera {
            file: self.file.clone(),
            source,
        })?;
        if self.prepared.transfer.is_some() {
            kept::check_camera(&self.provenance, track)?;
        }
        Ok(track.clone())
    }

    /// How an integrator will make the light of a frame, and why.
    ///
    /// # Errors
    /// The asset lacks what the integrator takes.
    pub fn choose(
        &self,
        integrator: &Integrator,
        lights: &Lights,
        time: f64,
        settings: &FrameSettings,
    ) -> Result<Choice, ChoiceError> {
        let cuts = match integrator {
            Integrator::Auto | Integrator::Cuts => CutKind::of(&self.prepared).used_for(lights),
            _ => CutUse::Nothing,
        };
        let decided = self.decided(integrator)?;
        Ok(self.choice(decided, cuts, lights, time, settings))
    }

    fn decided(&self, integrator: &Integrator) -> Result<Integrator, ChoiceError> {
        (integrator.decided(&self.prepared)).map_err(|missing| ChoiceError {
            file: self.file.clone(),
            missing,
        })
    }

    fn choice(
        &self,
        integrator: Integrator,
        cuts: CutUse,
        lights: &Lights,
        time: f64,
        settings: &FrameSettings,
    ) -> Choice {
        Choice {
            integrator,
            cuts,
            of: CutKind::of(&self.prepared),
            by_lightcuts: !settings.light_layers
                && worthwhile(&lights.at(time), settings.pixel_samples, AT_PIXELS),
        }
    }

    /// What a camera sees, with all that lighting it needs.
    ///
    /// # Errors
    /// The asset lacks what the integrator takes.
    pub fn shot(&self, camera: &Camera, settings: &ShotSettings) -> Result<Shot, ChoiceError> {
        match self.shot_watched(camera, settings, &()) {
            Ok(shot) => Ok(shot),
            Err(ShotError::Choice(error)) => Err(error),
            Err(ShotError::Cancelled(_)) => unreachable!("nobody stops it"),
        }
    }

    /// [`Player::shot`] under the eyes of someone who may stop it.
    ///
    /// # Errors
    /// [`ShotError`].
    pub fn shot_watched(
        &self,
        camera: &Camera,
        settings: &ShotSettings,
        watch: &dyn Watch,
    ) -> Result<Shot, ShotError> {
        let (width, height) = (settings.width, settings.height);
        let transfers = match self.decided(&settings.integrator)? {
            Integrator::Traced(tracer) => {
                return Ok(Shot::Traced(TracedShot {
                    camera: *camera,
                    size: RenderSize { width, height },
                    samples: settings.samples,
                    tracer,
                }));
            }
            Integrator::Cuts => false,
            Integrator::Auto | Integrator::Transfer => true,
        };
        let samples = settings.samples.unwrap_or(if settings.moving {
            MOVING_SAMPLES
        } else {
            STANDING_SAMPLES
        });
        let start = Instant::now();
        let seen = expose_watched(&self.prepared.scene, camera, (width, height), samples, watch)?;
        let exposed = milliseconds(start);
        let mut shot = self.relit(seen, settings, watch)?;
        shot.transfers = transfers;
        shot.times.expose = exposed;
        Ok(Shot::Relit(Box::new(shot)))
    }

    /// A shot of fragments that were exposed already, of one camera or several.
    pub fn shot_of(&self, seen: Exposure, settings: &ShotSettings) -> RelitShot {
        match self.relit(seen, settings, &()) {
            Ok(shot) => shot,
            Err(Cancelled) => unreachable!("nobody stops it"),
        }
    }

    fn relit(
        &self,
        mut seen: Exposure,
        settings: &ShotSettings,
        watch: &dyn Watch,
    ) -> Result<RelitShot, Cancelled> {
        let start = Instant::now();
        // Before lobes are followed, which depends on what surfaces are like.
        let edited = self.edited.as_ref().filter(|edited| edited.moves());
        if let Some(edited) = edited {
            edited.reshade(&self.prepared.scene, &mut seen);
        }
        let rays = if settings.moving || edited.is_some() {
            MOVING_RAYS
        } else {
            FIXED_RAYS
        };
        let sites = match settings.integrator {
            Integrator::Auto | Integrator::Cuts => settings.sites,
            _ => None,
        };
        let shot = RelitShot::new(&self.prepared, seen, rays, sites, watch)?;
        Ok(RelitShot {
            times: ShotTimes {
                expose: 0.0,
                weigh: milliseconds(start),
            },
            edition: self.edition,
            ..shot
        })
    }

    /// A frame of a shot under some lights, `time` in frames of their sequence.
    ///
    /// # Errors
    /// The shot is older than the player's materials.
    pub fn frame(
        &self,
        shot: &Shot,
        lights: &Lights,
        time: f64,
        settings: &FrameSettings,
    ) -> Result<Frame, FrameError> {
        self.frame_watched(shot, lights, time, settings, &())
    }

    /// [`Player::frame`] under the eyes of someone who may stop it.
    ///
    /// # Errors
    /// [`FrameError`].
    pub fn frame_watched(
        &self,
        shot: &Shot,
        lights: &Lights,
        time: f64,
        settings: &FrameSettings,
        watch: &dyn Watch,
    ) -> Result<Frame, FrameError> {
        let shot = match shot {
            Shot::Traced(shot) => {
                let set = lights.at(time);
                let (layers, stats) = traced(&self.prepared, &set, shot, settings, watch)?;
                let integrator = shot.tracer.clone().into();
                return Ok(Frame {
                    layers,
                    choice: self.choice(integrator, CutUse::Nothing, lights, time, settings),
                    stats: FrameStats::Traced(stats),
                });
            }
            Shot::Relit(shot) => shot,
        };
        let (lit, mut stats) = self.light(shot, lights, time, settings, watch)?;
        go_on(watch)?;
        let start = Instant::now();
        let layers = resolve(&shot.seen, &lit, settings.surface_layers);
        stats.times.resolve = milliseconds(start);
        let integrator = if shot.transfers {
            Integrator::Transfer
        } else {
            Integrator::Cuts
        };
        let cuts = cut_use(&self.prepared, shot, lights);
        Ok(Frame {
            layers,
            choice: self.choice(integrator, cuts, lights, time, settings),
            stats: FrameStats::Relit(stats),
        })
    }

    /// Radiance of a shot's fragments, before pixels are made of them.
    ///
    /// # Errors
    /// [`FrameError`].
    pub fn light(
        &self,
        shot: &RelitShot,
        lights: &Lights,
        time: f64,
        settings: &FrameSettings,
        watch: &dyn Watch,
    ) -> Result<(Lit, RelitStats), FrameError> {
        if shot.edition != self.edition {
            return Err(FrameError::Stale);
        }
        Ok(light(&self.prepared, shot, lights, time, settings, watch)?)
    }

    /// The clusters of lights, and of the asset's points as virtual lights, that light a place which is looked at from `towards`, a unit
    /// vector: a lightcut by the defaults of that integrator.
    ///
    /// # Errors
    /// [`Cancelled`] if `watch` says so.
    pub fn light_cut(
        &self,
        lights: &Lights,
        time: f64,
        hit: &SurfaceHit,
        towards: Vec3,
        watch: &dyn Watch,
    ) -> Result<LightCut, Cancelled> {
        light_cut(&self.prepared, &lights.at(time), hit, towards, watch)
    }

    /// Forgets the light of lamps that stand still, and what it became: the next frame of the shot takes as long as if all of them had moved, which is what
    /// measuring frames wants.
    pub fn forget(&self, shot: &Shot) {
        if let Shot::Relit(shot) = shot {
            self.prepared.received.forget();
            self.prepared.transferred.forget();
            shot.reflected.forget();
            shot.at_ends.forget();
            shot.even.forget();
        }
    }

    /// Edits materials, as a file says, in place of what was edited before; from now on they are those of `time`.
    ///
    /// # Errors
    /// [`EditError`].
    pub fn edit_materials_from(&mut self, file: &Path, time: f64) -> Result<(), EditError> {
        let edits = read_material_edits(file, self.scene())?;
        self.edit_materials(edits, time)
    }

    /// Edits materials, in place of what was edited before; from now on they are those of `time`. Shots and lights that were
    /// made before are to be made again.
    ///
    /// # Errors
    /// [`EditError`].
    pub fn edit_materials(&mut self, edits: MaterialEdits, time: f64) -> Result<(), EditError> {
        let materials = self.scene().materials.len();
        let edited = Edited::new(
            edits,
            &self.file,
            &self.provenance,
            materials,
            self.edited.as_ref(),
        )?;
        self.edited = Some(edited);
        self.edition.edits += 1;
        self.set_time(time)
    }

    /// Moves edited materials to a time, in frames. Shots that were made before are to be [refreshed](Player::refresh) if any
    /// moved.
    ///
    /// # Errors
    /// A texture that an edit names is damaged.
    pub fn set_time(&mut self, time: f64) -> Result<(), EditError> {
        if let Some(edited) = &mut self.edited
            && edited.apply(time, &mut self.prepared, &self.file)?
        {
            self.edition.moves += 1;
        }
        Ok(())
    }

    /// Whether edited materials change from frame to frame.
    pub fn materials_move(&self) -> bool {
        self.edited.as_ref().is_some_and(Edited::moves)
    }

    /// Whether materials were edited.
    pub fn is_edited(&self) -> bool {
        self.edited.is_some()
    }

    /// Gives a shot the materials that the player has now, those that move.
    ///
    /// # Errors
    /// Materials were edited anew since it was made: it takes another shot.
    pub fn refresh(&self, shot: &mut Shot) -> Result<(), FrameError> {
        let Shot::Relit(shot) = shot else {
            return Ok(());
        };
        if shot.edition.edits != self.edition.edits {
            return Err(FrameError::Stale);
        }
        if shot.edition != self.edition
            && let Some(edited) = &self.edited
        {
            edited.refresh(&self.prepared, shot);
            shot.edition = self.edition;
        }
        Ok(())
    }
}
