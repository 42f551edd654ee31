//! What a bake can be told.

use glam::Vec3;

/// Parameters of a bake. [`BakeParams::default`] is the preset `standard`.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeParams {
    /// Receiver levels, 1..=12.
    pub levels: usize,
    /// Sender levels, 1..=levels: the coarsest ones.
    pub sender_levels: usize,
    /// Poisson-disk radius of the coarsest level, scene units; `None`: from the scene.
    pub coarse_radius: Option<f32>,
    /// Link threshold ε (section 3.2) on reflectance times link, at the finest level; 0.8 stands for every
    /// reflectance.
    pub epsilon: f32,
    /// Rays per receiver on the finest level; each coarser level takes twice as many.
    pub rays: usize,
    /// Bounces of indirect light, T + … + Tᴺ; `None`: to convergence.
    pub bounces: Option<u32>,
    /// Bakes the bounces with the scene's reflectances instead of iterating them at play time.
    pub solution: bool,
    /// Where importance particles start; empty: the scene's cameras, or a place in open space.
    pub viewpoints: Vec<Vec3>,
    /// Visibility cuts; `None`: no cuts.
    pub cuts: Option<CutParams>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// What visibility cuts are made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CutMode {
    /// Even directions: direct light of environments.
    #[default]
    Environment,
    /// Even surface samples: the first bounce of any light.
    Indirect,
}

/// Where visibility cuts stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CutSites {
    /// At the finest points: as many as the lighting needs.
    #[default]
    Points,
    /// At the vertices of the meshes, as in the paper: for comparison.
    Vertices,
}

/// Parameters of visibility cuts (design section 7).
#[derive(Clone, Debug, PartialEq)]
pub struct CutParams {
    /// What they are made for.
    pub mode: CutMode,
    /// Where they stand.
    pub sites: CutSites,
    /// Lights that the cuts cluster: a power of two, 256 to 2²⁰.
    pub lights: u32,
    /// Threshold of a node's error, |C|·var ≤ σ² (Cheslack-Postava et al. 2008, equation 5), for 32 768 lights: it grows
    /// with the square root of their number.
    pub sigma: f32,
    /// β of the tree: 1 for geometry alone, 0 for pilot visibility alone (equation 12).
    pub beta: f32,
    /// Most nodes of one cut.
    pub most: usize,
    /// Casts a ray at every light above a site's horizon instead of only where shadows have edges: for studies.
    pub every_light: bool,
}

/// Lights for which σ is given (section 4.1 of the paper).
const SIGMA_LIGHTS: f32 = 32_768.0;

impl CutParams {
    /// σ for this number of lights.
    pub fn sigma(&self) -> f32 {
        self.sigma * (self.lights as f32 / SIGMA_LIGHTS).sqrt()
    }
}

impl Default for CutParams {
    fn default() -> Self {
        CutParams {
            mode: CutMode::Environment,
            sites: CutSites::Points,
            lights: 32_768,
            sigma: 2.0,
            beta: 0.45,
            most: 4096,
            every_light: false,
        }
    }
}

/// Named presets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Seconds instead of tens of seconds: for trying lights and cameras.
    Draft,
    /// The default.
    Standard,
    /// Half the standard error or less, for several times the bake.
    Fine,
}

impl BakeParams {
    /// The parameters of a preset.
    pub fn preset(preset: Preset) -> BakeParams {
        let standard = BakeParams {
            levels: 6,
            sender_levels: 4,
            coarse_radius: None,
            epsilon: 0.025,
            rays: 320,
            bounces: None,
            solution: false,
            viewpoints: Vec::new(),
            cuts: None,
            seed: 0,
        };
        match preset {
            Preset::Draft => BakeParams {
                levels: 5,
                sender_levels: 3,
                rays: 256,
                epsilon: 0.05,
                ..standard
            },
            Preset::Standard => standard,
            Preset::Fine => BakeParams {
                sender_levels: 5,
                epsilon: 0.01,
                rays: 1024,
                ..standard
            },
        }
    }
}

impl Default for BakeParams {
    fn default() -> Self {
        BakeParams::preset(Preset::Standard)
    }
}
