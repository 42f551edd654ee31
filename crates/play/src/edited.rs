//! Edited materials while playing: what has to be evaluated again, and what stays.
//!
//! Rays, fragments and weights depend on geometry alone and stay. Again, at most once a frame and only for
//! materials that are edited: reflectance at the finest points (at each point's place on the surface, without the
//! bake's rounding), from which the bounces take theirs, and the shading points of a standing camera's fragments.
//!
//! A fragment of a material that moves is evaluated where it is lit, not averaged over its rays: its textures are
//! sampled once a pixel. All its frames are, so that none differs from the others. A material whose edits are
//! constant is averaged as ever.

use crate::cuts::{Lights, reflectances};
use crate::frame::Player;
use crate::load::Loaded;
use crate::reflections::MOVING_RAYS;
use crate::shot::Shot;
use rayon::prelude::*;
use relight_format::layout::setting;
use relight_scene::json::error::JsonError;
use relight_scene::material_edits::{MaterialEdits, read_material_edits};
use relight_scene::shading::ShadingPoint;
use relight_scene::traced::TracedSceneError;
use std::path::{Path, PathBuf};

/// Why materials cannot be edited.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// The edits are wrong in themselves, or for this asset.
    #[error(transparent)]
    Edits(#[from] JsonError),
    /// The asset treats every material alike.
    #[error(
        "{}: baked with --lambert, which shades every material as Lambert with its base colour: materials cannot be \
         edited; bake without --lambert", file.display()
    )]
    Lambert {
        /// The asset.
        file: PathBuf,
    },
    /// A texture that an edit names cannot be used.
    #[error("{}: {source}", file.display())]
    Texture {
        /// The asset.
        file: PathBuf,
        /// What is wrong.
        source: TracedSceneError,
    },
}

/// Material edits of a loaded asset, applied frame by frame.
pub struct Editor {
    edits: MaterialEdits,
    /// The asset's file, for messages.
    asset: PathBuf,
    /// Per material whether it changes from frame to frame.
    moves: Vec<bool>,
    /// Whether the edits have been applied before.
    begun: bool,
}

impl Editor {
    /// Reads edits for an asset and checks that it can take them; changes nothing yet.
    ///
    /// # Errors
    /// [`EditError`].
    pub fn new(file: &Path, asset: &Path, loaded: &Loaded) -> Result<Editor, EditError> {
        if loaded.provenance.lambert {
            return Err(EditError::Lambert { file: asset.into() });
        }
        let edits = read_material_edits(file, &loaded.scene)?;
        let is = |name, value| loaded.provenance.setting(name) == Some(value);
        if is(setting::SOLUTION, setting::BAKED)
            && let Some(error) = edits.refuse_reflectance(
                "this asset was baked with --solution, which fixes how much every surface reflects; bake without \
                 --solution to edit that",
            )
        {
            return Err(error.into());
        }
        if is(setting::EMISSION, setting::LEFT_OUT)
            && let Some(error) = edits.refuse_emission(
                "the emission of materials was left out of this asset, because it was baked with --lights for a \
                 sequence without an `emissive` light; bake with --keep emission, or with one that has it",
            )
        {
            return Err(error.into());
        }
        let moves = (0..loaded.scene.materials.len() as u32)
            .map(|i| edits.moves(i))
            .collect();
        Ok(Editor {
            edits,
            asset: asset.into(),
            moves,
            begun: false,
        })
    }

    /// Whether any material changes from frame to frame.
    pub fn moves(&self) -> bool {
        self.moves.contains(&true)
    }

    /// Gives the player the materials of a frame, and the transfer the reflectances that they make.
    ///
    /// # Errors
    /// A texture that an edit names is damaged.
    pub fn apply(&mut self, frame: f64, player: &mut Player) -> Result<(), EditError> {
        if self.begun && !self.moves() {
            return Ok(());
        }
        let materials = self.edits.at(frame, &player.scene.scene().materials);
        player
            .scene
            .set_materials(materials)
            .map_err(|source| EditError::Texture {
                file: self.asset.clone(),
                source,
            })?;
        let all = !self.begun;
        self.begun = true;
        let wanted =
            |index: u32| self.edits.touches(index) && (all || self.moves.get(index as usize) == Some(&true));
        let Player {
            scene,
            transfer,
            points,
            cuts,
        } = player;
        if let Some(transfer) = transfer {
            let mut albedo = std::mem::take(&mut transfer.albedo);
            reflectances(scene, points, &mut albedo, wanted);
            transfer.set_albedo(albedo);
        }
        if let Some(Lights::Surface(samples)) = cuts.as_mut().map(|c| &mut c.lights) {
            reflectances(scene, &samples.hits, &mut samples.albedo, wanted);
        }
        Ok(())
    }

    /// Evaluates the fragments of materials that move again, with the materials that the player has now, and, if the shot was
    /// weighed, what follows from them.
    pub fn reshade(&self, player: &Player, shot: &mut Shot) {
        if !self.moves() {
            return;
        }
        let scene = &player.scene;
        let moved = |point: &ShadingPoint| self.moves.get(point.material as usize) == Some(&true);
        let Shot {
            points,
            hits,
            directions,
            ..
        } = &mut *shot;
        points
            .par_iter_mut()
            .zip(&*hits)
            .zip(&*directions)
            .with_min_len(256)
            .for_each(|((point, hit), direction)| {
                if let (Some(point), Some(hit)) = (point, hit)
                    && moved(point)
                {
                    let mut again = scene.shading_point(hit).facing(-*direction);
                    if !self.edits.moves_normals(point.material) {
                        again.shading_normal = point.shading_normal;
                    }
                    *point = again;
                }
            });
        let Some(transfer) = player.transfer.as_ref().filter(|_| !shot.albedo.is_empty()) else {
            return;
        };
        shot.weigh_lobes(transfer, scene, MOVING_RAYS);
        let bends = (0u32..)
            .zip(&self.moves)
            .any(|(i, &m)| m && self.edits.moves_normals(i));
        if bends {
            shot.weigh_components(&transfer.finest);
        }
    }
}
