//! How a frame is lit.

use crate::transfer::LevelPart;

/// Nodes of the illumination cut: 256 are no better (docs/notebook/cuts.md). The paper's 256 to 512 (Cheslack-Postava et al. 2008,
/// section 5) are of nodes whose light comes from their middles.
pub const ILLUMINATION_CUT: usize = 128;

/// Error of one node of an illumination cut, as a share of the frame's light, that refinement by error goes on for: √(|C|·var L).
/// Together with visibility cuts of σ = 2 a node's product is then off by at most a thousandth of all light (equation 8 of the same).
pub const ILLUMINATION_ERROR: f64 = 5e-4;

/// How a frame is lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSettings {
    /// Seed of all random numbers.
    pub seed: u64,
    /// Whether to make a layer per light, `light.NAME`.
    pub light_layers: bool,
    /// Whether to make the layers `background`, `albedo`, `normal`, `depth` and `depth.ray` (integrators that trace every frame always do).
    pub surface_layers: bool,
    /// Shadow rays per fragment for each light with extent.
    pub pixel_samples: u32,
    /// Shadow rays per finest point for each light with extent. Fewer than per pixel: a sender averages some
    /// hundreds of points.
    pub point_samples: u32,
    /// Whether a finer frame follows at once. Points are lit at their middles alone, also wide ones and where shadows' edges pass, so that indirect light
    /// flickers as lamps move, and bounces go from cluster to cluster ([`Transfer::coarsely_from_direct`]). What a frame that was not coarse has found of lamps that
    /// still shine as they did is taken as it is.
    ///
    /// [`Transfer::coarsely_from_direct`]: crate::transfer::Transfer::coarsely_from_direct
    pub coarse: bool,
    /// Most nodes of the illumination cut, by which an environment, or what surfaces reflect, is taken with visibility cuts.
    pub illumination_cut: usize,
    /// Whether to make the layers `cut_size` and `nodes`, numbers of nodes: of the visibility cuts between which a pixel interpolates,
    /// merged, and of all that it was shaded with, the illumination cut merged in; 0 where none was. Not of integrators that trace.
    pub cut_layers: bool,
    /// Indirect light of some levels of the transfer alone; `None`: of all.
    pub levels: Option<LevelPart>,
}

impl FrameSettings {
    /// Those that light depends on: the same layers for all.
    pub(crate) fn of_light(self) -> FrameSettings {
        FrameSettings {
            light_layers: false,
            surface_layers: false,
            cut_layers: false,
            levels: None,
            ..self
        }
    }
}

impl Default for FrameSettings {
    fn default() -> FrameSettings {
        FrameSettings {
            seed: 0,
            light_layers: false,
            surface_layers: false,
            pixel_samples: 8,
            point_samples: 4,
            coarse: false,
            illumination_cut: ILLUMINATION_CUT,
            cut_layers: false,
            levels: None,
        }
    }
}
