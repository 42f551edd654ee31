//! Edited materials while playing: what has to be evaluated again, and what stays.
//!
//! Rays, fragments and weights depend on geometry alone and stay. Again, at most once a frame and only for
//! materials that are edited: reflectance at the finest points ([`crate::cell_reflectances`]), from which the bounces
//! take theirs, and the shading points of a standing camera's fragments.
//!
//! A fragment of a material that moves is evaluated where it is lit, not averaged over its rays: its textures are
//! sampled once a pixel. All its frames are, so that none differs from the others. A material whose edits are
//! constant is averaged as ever.

use crate::cell_reflectances::CellReflectances;
use crate::cuts::CutLights;
use crate::cuts::lights::reflectances;
use crate::prepared::PreparedScene;
use crate::reflections::MOVING_RAYS;
use crate::shot::RelitShot;
use rayon::prelude::*;
use relight_format::Provenance;
use relight_format::layout::setting;
use relight_render::exposure::Exposure;
use relight_scene::json::error::JsonError;
use relight_scene::material_edits::MaterialEdits;
use relight_scene::shading::ShadingPoint;
use relight_scene::traced::{TracedScene, TracedSceneError};
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

/// Material edits of a player, applied frame by frame.
pub(crate) struct Edited {
    edits: MaterialEdits,
    /// Per material whether it changes from frame to frame.
    moves: Vec<bool>,
    /// Materials that edits before these have touched, and that these may not touch.
    stale: Vec<bool>,
    /// Whether the edits have been applied before.
    begun: bool,
}

impl Edited {
    /// Checks that an asset can take edits; changes nothing yet. `file`: the asset's, for messages; `before`: the edits that these
    /// replace.
    pub fn new(
        edits: MaterialEdits,
        file: &Path,
        provenance: &Provenance,
        materials: usize,
        before: Option<&Edited>,
    ) -> Result<Edited, EditError> {
        if provenance.lambert {
            return Err(EditError::Lambert { file: file.into() });
        }
        let is = |name, value| provenance.setting(name) == Some(value);
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
        let touched = |before: &Edited, i: u32| before.stale[i as usize] || before.edits.touches(i);
        Ok(Edited {
            moves: (0..materials as u32).map(|i| edits.moves(i)).collect(),
            stale: (0..materials as u32)
                .map(|i| before.is_some_and(|before| touched(before, i)))
                .collect(),
            begun: false,
            edits,
        })
    }

    /// Whether any material changes from frame to frame.
    pub fn moves(&self) -> bool {
        self.moves.contains(&true)
    }

    /// Gives the scene the materials of a frame, and the transfer the reflectances that they make. Whether anything
    /// changed.
    pub fn apply(&mut self, time: f64, prepared: &mut PreparedScene, file: &Path) -> Result<bool, EditError> {
        if self.begun && !self.moves() {
            return Ok(false);
        }
        let PreparedScene {
            scene,
            transfer,
            points,
            cuts,
            gloss,
            cells,
            ..
        } = prepared;
        if let (Some(transfer), None) = (&transfer, &cells) {
            *cells = Some(CellReflectances::of(scene, points, &transfer.albedo));
        }
        let materials = self.edits.at(time, &scene.scene().materials);
        scene
            .set_materials(materials)
            .map_err(|source| EditError::Texture {
                file: file.to_path_buf(),
                source,
            })?;
        let all = !self.begun;
        self.begun = true;
        let is = |flags: &[bool], index: u32| flags.get(index as usize) == Some(&true);
        let wanted = |index: u32| {
            (self.edits.touches(index) && (all || is(&self.moves, index))) || (all && is(&self.stale, index))
        };
        gloss.forget();
        if let (Some(transfer), Some(cells)) = (transfer, cells) {
            let mut albedo = std::mem::take(&mut transfer.albedo);
            cells.edit(scene, points, wanted, &mut albedo);
            transfer.set_albedo(albedo);
        }
        if let Some(CutLights::Surface(samples)) = cuts.as_mut().map(|c| &mut c.lights) {
            reflectances(scene, &samples.hits, &mut samples.albedo, wanted);
        }
        Ok(true)
    }

    /// Evaluates the fragments of materials that move again, with the materials that the scene has now.
    pub fn reshade(&self, scene: &TracedScene, seen: &mut Exposure) {
        let moved = |point: &ShadingPoint| self.moves.get(point.material as usize) == Some(&true);
        (seen.points.par_iter_mut())
            .zip(&seen.hits)
            .zip(&seen.directions)
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
    }

    /// As [`Edited::reshade`] of a shot, with what follows from it.
    pub fn refresh(&self, prepared: &PreparedScene, shot: &mut RelitShot) {
        self.reshade(&prepared.scene, &mut shot.seen);
        let Some(transfer) = &prepared.transfer else {
            return;
        };
        shot.weigh_lobes(transfer, &prepared.scene, MOVING_RAYS);
        let bends = (0u32..)
            .zip(&self.moves)
            .any(|(i, &m)| m && self.edits.moves_normals(i));
        if bends {
            shot.weigh_components(&transfer.finest);
        }
    }
}
