//! What a bake can be told.

use glam::Vec3;
use relight_format as format;

/// Parameters of a bake. [`BakeParams::default`] is the preset `standard`.
#[derive(Clone, Debug, PartialEq)]
pub struct BakeParams {
    /// Receiver levels, 1..=12.
    pub levels: usize,
    /// Sender levels, 1..=levels: the coarsest ones.
    pub sender_levels: usize,
    /// Poisson-disk radius of the coarsest level, scene units; `None`: from the scene.
    pub coarse_radius: Option<f32>,
    /// ε (section 3.2), on reflectance times link, at the finest level: the threshold of links of the coarsest receivers, and
    /// by its square what error those of others take away at least (`refine`).
    pub epsilon: f32,
    /// Rays per receiver on the finest level; each coarser level takes twice as many.
    pub rays: usize,
    /// Bounces of indirect light, T + … + Tᴺ; `None`: to convergence.
    pub bounces: Option<u32>,
    /// Bakes the bounces with the scene's reflectances instead of iterating them at play time.
    pub solution: bool,
    /// Where importance particles start beside the cameras; without either: places in open space.
    pub viewpoints: Vec<Vec3>,
    /// Visibility cuts; `None`: no cuts.
    pub cuts: Option<CutParams>,
    /// Refines only receivers that the cameras see, beyond what the bounces need; frames of other cameras are refused.
    pub cameras_only: bool,
    /// What is kept although scene and lights cannot use it.
    pub keep: Vec<Omittable>,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// What a bake leaves out unless it is told to keep it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Omittable {
    /// The scene's own lights, where a sequence replaces them.
    Lights,
    /// Emission of materials, where the sequence lets none shine.
    Emission,
    /// Maps, textures, coordinates, tangents and colours that nothing looks up.
    Materials,
    /// Points on surfaces from which no light comes to the viewpoints.
    Points,
    /// Sender levels to which no link leads.
    Senders,
    /// The operator of further bounces, where there are none or a solution takes its place.
    Bounces,
    /// Visibility cuts of environments, where the sequence has none.
    Cuts,
    /// Colour of grey points; bits of links far below ε.
    Precision,
}

impl Omittable {
    /// All of them.
    pub const ALL: [Omittable; 8] = [
        Omittable::Lights,
        Omittable::Emission,
        Omittable::Materials,
        Omittable::Points,
        Omittable::Senders,
        Omittable::Bounces,
        Omittable::Cuts,
        Omittable::Precision,
    ];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Omittable::Lights => "lights",
            Omittable::Emission => "emission",
            Omittable::Materials => "materials",
            Omittable::Points => "points",
            Omittable::Senders => "senders",
            Omittable::Bounces => "bounces",
            Omittable::Cuts => "cuts",
            Omittable::Precision => "precision",
        }
    }
}

impl BakeParams {
    /// Whether a part is kept that nothing uses.
    pub fn keeps(&self, part: Omittable) -> bool {
        self.keep.contains(&part)
    }

    /// Whether further bounces need an operator of their own: the first two are T's.
    pub fn needs_bounces(&self) -> bool {
        self.keeps(Omittable::Bounces) || self.bounces.is_none_or(|n| n > 2)
    }

    /// What a reader of the file will see of a link.
    pub fn stored_link(&self) -> impl Fn(Vec3) -> Vec3 + Copy + Sync + use<> {
        let coding = format::Coding {
            short_links: self.short_links(),
            ..format::Coding::default()
        };
        move |v| Vec3::from(format::quantised_vector(v.to_array(), coding))
    }

    /// What takes fewer bits in the file, for points of these albedos.
    pub fn coding(&self, levels: &[format::Level], has_links: bool) -> format::Coding {
        let mut albedos = levels.iter().flat_map(|l| &l.albedo);
        format::Coding {
            grey: !self.keeps(Omittable::Precision) && albedos.all(|[r, g, b]| r == g && g == b),
            short_links: self.short_links() && has_links,
        }
    }

    /// Whether the vectors of T are stored with short mantissas. Those are off by at most 2⁻⁷ of a link, which is half of
    /// what is dropped for being weak when ε is twice that or more, even of the strongest link there can be.
    pub fn short_links(&self) -> bool {
        !self.keeps(Omittable::Precision) && self.epsilon >= 1.0 / 64.0
    }
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

/// Parameters of visibility cuts.
#[derive(Clone, Debug, PartialEq)]
pub struct CutParams {
    /// What they are made for.
    pub mode: CutMode,
    /// Lights that the cuts cluster: a power of two, 256 to 2²⁰.
    pub lights: u32,
    /// Threshold of a node's error, |C|·var ≤ σ² (Cheslack-Postava et al. 2008, equation 5), for 32 768 lights: it grows
    /// with the square root of their number.
    pub sigma: f32,
    /// β of the tree: 1 for geometry alone, 0 for pilot visibility alone (equation 12).
    pub beta: f32,
    /// Most nodes of one cut.
    pub most: usize,
    /// Made only if an environment or a sky may shine.
    pub if_used: bool,
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
            lights: 32_768,
            sigma: 2.0,
            beta: 0.45,
            most: 4096,
            if_used: false,
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
            sender_levels: 5,
            coarse_radius: None,
            epsilon: 0.018,
            rays: 320,
            bounces: None,
            solution: false,
            viewpoints: Vec::new(),
            cuts: None,
            cameras_only: false,
            keep: Vec::new(),
            seed: 0,
        };
        match preset {
            Preset::Draft => BakeParams {
                levels: 5,
                sender_levels: 3,
                rays: 256,
                epsilon: 0.04,
                ..standard
            },
            Preset::Standard => standard,
            Preset::Fine => BakeParams {
                epsilon: 0.0075,
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
