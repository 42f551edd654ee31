//! Options of `relight play`.

use crate::failure::Failure;
use crate::frames::{self, FrameRange, Pattern};
use crate::movie;
use crate::options::{ReplaceArgs, above_0, parsed, real, whole};
use clap::{Args, ValueEnum};
use relight_play::{FrameSettings, Integrator, Tracer};
use relight_render::lightcuts::LightcutSettings;
use relight_render::many_lights::PointSettings;
use relight_render::pixelcuts::PixelcutsSettings;
use relight_scene::image::{BEAUTY, DEPTH};
use relight_scene::sky_patches::SkyPatches;
use std::path::{Path, PathBuf};

/// Relight an asset for a sequence of lights and write OpenEXR frames.
///
/// beauty = emission (light seen directly) + direct (one reflection) + indirect (two and more). Each frame is
/// written, complete or not at all, while the next one is lit.
#[derive(Args)]
#[command(after_help = "\
The JSON of --json: time_unit, that of all times (ms); without_points, the share of fragments that have no point near them and no indirect light (bake
--viewpoint adds points); frames, an array of {frame, total, direct_points, bounces, transfer, flatten, direct_pixels,
reconstruct, resolve, write} in milliseconds (brute and path: {frame, total, render, write}); total is what the frame adds
to the run, which is less than its parts where the frame before is written beside it; once_per_shot, what
is done once: load, expose, weigh (with a moving camera expose and weigh are in the frames). Over lights without
extent a frame also has points (milliseconds), lights, virtual_lights and shadow_rays_per_pixel; with lightcuts also
tree and light (milliseconds), tree_bytes, nodes_per_pixel, limited_cuts_per_pixel (with --reconstruction on
eye_rays_per_pixel, samples_per_pixel, shadow_rays_per_reconstruction_cut); with pixelcuts also
nodes_per_pixel, exact_lights, and in milliseconds eye, exact, estimate, trees, cuts, scatter, shade and resolve. With --materials a
frame also has edit, the milliseconds of evaluating changed materials again. With --daylight-coefficients there is daylight, {patches, images,
unseen, bytes}; once_per_shot has patches, the milliseconds of making the images, and frames are {frame, total, sky, sum, write}, shares of what is done
for up to 16 at once.

Models and parameters for --materials: metallic_roughness (metallic, roughness, metallic_roughness_texture),
lambert, phong (specular, specular_texture, exponent or roughness), ward (specular, specular_texture, roughness or
roughness_u and roughness_v, rotation_deg); all: base_color, base_color_texture, normal_texture, normal_scale,
bump_texture with bump_scale (metres), emission.")]
pub struct PlayArgs {
    /// Asset to play.
    #[arg(value_name = "ASSET.relight")]
    pub asset: PathBuf,
    /// Lighting sequence; without it the scene's own lights play.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Material edits: models and parameters, with keys where they change from frame to frame, of the asset's
    /// materials by name; no new bake (see data/table_materials.json).
    #[arg(long, value_name = "EDITS.json")]
    pub materials: Option<PathBuf>,
    /// Frames to write: #### or %04d stands for the frame number.
    #[arg(short, long, value_name = "out/frame_####.exr", value_parser = frames::parse_pattern, required_unless_present = "movie")]
    pub output: Option<Pattern>,
    /// How to make light: transfer (the asset's operators), cuts (as the asset's visibility cuts were baked: direct
    /// light of environments, or one bounce of indirect light; other direct light by shadow rays), brute (every light
    /// with its own shadow rays; direct light only, or, with --area-samples, --vpls and their like, all light of these points), lightcuts
    /// (the same points with a bounded error, by clusters of lights), pixelcuts (the same points, each sent to clusters of
    /// pixels: fast and without sharp shadows of many lights), path (a path tracer, the reference), or auto (cuts where the asset
    /// has them: environments, or the first bounce at surfaces that are not matt; transfer for other indirect light;
    /// path without points).
    #[arg(long, value_enum, default_value_t = IntegratorName::Auto)]
    pub integrator: IntegratorName,
    /// Light of suns and skies (weather, sun_sky) by daylight coefficients: the images that each of so many patches of the sky makes, once, and
    /// each frame as their sum, so that a year of hours of a standing camera takes little longer than its patches. Suns are spread over four patches:
    /// shadows are as soft as these are wide (12, 6 or 3 degrees). See docs/daylight.md.
    #[arg(long, value_name = "145|577|2305", value_parser = sky_patches)]
    pub daylight_coefficients: Option<SkyPatches>,
    /// Size of the image in pixels; keeps the camera's vertical field of view [default: 360 high, of the camera's
    /// aspect ratio].
    #[arg(long, value_name = "WxH", value_parser = frames::parse_size)]
    pub size: Option<(usize, usize)>,
    /// Camera of the scene by name [default: the sequence's, else the scene's first].
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Frames to play, from 0, both ends included, every Nth [default: all of the sequence].
    #[arg(long, value_name = "A-BxN", value_parser = frames::parse_range)]
    pub frames: Option<FrameRange>,
    /// Layers to write, with commas between them; lights stands for one layer per light, light.NAME. Beside the beauty is A, the share of the
    /// pixel that is scene; cut_size and nodes count nodes of visibility cuts: of those between which a pixel interpolates, and of all
    /// that shaded it, the illumination cut merged in.
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [LayerName::Beauty, LayerName::Direct, LayerName::Indirect])]
    pub layers: Vec<LayerName>,
    /// Write a PNG preview of the beauty beside each frame (Khronos PBR Neutral).
    #[arg(long, requires = "output")]
    pub png: bool,
    /// Exposure of previews and movie, -100 to 100: 2^EV times the image. auto: the EV that makes the middle of the first frame with
    /// light a middle grey, the same for all frames; it is printed [default: auto].
    #[arg(long, value_name = "EV", value_parser = exposure)]
    pub exposure: Option<Exposure>,
    /// Write all frames as one moving picture, as previews show them, at the sequence's frame rate: .webp (lossless), .gif (256 colours a
    /// frame) or .mp4 (by the program ffmpeg).
    #[arg(long, value_name = "FILE", value_parser = movie::parse)]
    pub movie: Option<PathBuf>,
    /// Write 32-bit floats instead of half precision.
    #[arg(long, requires = "output")]
    pub float: bool,
    /// Most nodes of the illumination cut, by which an environment, or what surfaces reflect, is taken with visibility
    /// cuts [default: 128].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1_048_576))]
    pub illumination_cut: Option<u32>,
    /// Samples per pixel; of transfer and cuts half as many (but eight) where a pixel shows one thing of one colour, four times as
    /// many where it sees several, and half as many of each light with extent, more where pixels side by side disagree [default: transfer 16, with a moving camera 1; brute 16; lightcuts 4, with reconstruction 5 to 50; pixelcuts 1; path 64].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1_048_576))]
    pub spp: Option<u32>,
    /// Most reflections of a path (path only) [default: no limit].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0, u32::MAX))]
    pub max_bounces: Option<u32>,
    /// Lights without extent.
    #[command(flatten)]
    pub points: PointArgs,
    /// Clusters of lights.
    #[command(flatten)]
    pub lightcuts: LightcutArgs,
    /// Pixelcuts.
    #[command(flatten)]
    pub pixelcuts: PixelcutsArgs,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Ways to make light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum IntegratorName {
    /// Cuts and transfer, whatever the asset has; else path.
    Auto,
    /// The asset's operators.
    Transfer,
    /// Visibility cuts.
    Cuts,
    /// Every light with its own shadow rays.
    Brute,
    /// Clusters of lights.
    Lightcuts,
    /// Points that stand for all lights, each sent to clusters of pixels.
    Pixelcuts,
    /// The path tracer.
    Path,
}

/// Layers that can be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LayerName {
    /// Emission + direct + indirect.
    Beauty,
    /// Light seen directly.
    Emission,
    /// One reflection.
    Direct,
    /// Two reflections and more.
    Indirect,
    /// Total reflectance of what is seen.
    Albedo,
    /// Shading normal, world space.
    Normal,
    /// Distance from the camera's plane (depth.Z) and along the ray (depth.ray), metres, in 32 bits.
    Depth,
    /// Nodes of the visibility cuts between which a pixel interpolates.
    #[value(name = "cut_size")]
    CutSize,
    /// Nodes of the cuts that shaded a pixel, the illumination cut merged in.
    Nodes,
    /// What of the emission comes from where nothing is: skies.
    Background,
    /// Which objects and materials each pixel shows, and how much of it each covers (CryptoObject, CryptoMaterial), in 32 bits.
    Cryptomatte,
    /// One layer per light.
    Lights,
}

impl LayerName {
    /// Its name in a file; of light layers and Cryptomatte what their names begin with.
    pub fn name(self) -> &'static str {
        match self {
            LayerName::Beauty => BEAUTY,
            LayerName::Emission => "emission",
            LayerName::Direct => "direct",
            LayerName::Indirect => "indirect",
            LayerName::Albedo => "albedo",
            LayerName::Normal => "normal",
            LayerName::Depth => DEPTH,
            LayerName::CutSize => "cut_size",
            LayerName::Nodes => "nodes",
            LayerName::Background => "background",
            LayerName::Cryptomatte => "Crypto",
            LayerName::Lights => "light.",
        }
    }
}

/// How many lights without extent stand for all lights.
#[derive(Args, Clone, Debug)]
pub struct PointArgs {
    /// Points over all area lights together, each light gets one at least; brute takes the same points [default: 64 per
    /// light, for emissive surfaces of more triangles one each, up to 4096].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 16_777_216))]
    pub area_samples: Option<u32>,
    /// Directions for each environment map [default: 3000].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 16_777_216))]
    pub environment_samples: Option<u32>,
    /// Directions for the disc of each sun [default: 64].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 16_777_216))]
    pub sun_samples: Option<u32>,
    /// Directions for the sky of each sun [default: 5000].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 16_777_216))]
    pub sky_samples: Option<u32>,
    /// Virtual lights, which make indirect light: at the asset's points, at most so many (lightcuts take all points), of an asset without
    /// points so many where particles land; 0: none [default: 0].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0, 16_777_216))]
    pub vpls: Option<u32>,
    /// Largest share of the light at a pixel that a single virtual light of particles may have; inf for no limit. Those at points have none
    /// [default: 0.01].
    #[arg(long, value_name = "SHARE", value_parser = above_0(f32::INFINITY, "; inf for no limit"))]
    pub clamp: Option<f32>,
}

/// How to choose lightcuts.
#[derive(Args, Clone, Debug)]
pub struct LightcutArgs {
    /// Most error of a cluster of lights, as a share of a pixel's light (lightcuts only); 0 evaluates every light [default: 0.02].
    #[arg(long, value_name = "SHARE", value_parser = real(0.0, 1.0))]
    pub error_ratio: Option<f32>,
    /// Most nodes of a lightcut (lightcuts only); 0 for no limit [default: 1000].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(0, usize::MAX))]
    pub max_nodes: Option<usize>,
    /// How visible a cluster of lights is (lightcuts only): as its parts are, or as its representative light is, as in the paper:
    /// three times as fast, but for shadows' edges, where pixels err by several percent [default: parts].
    #[arg(long, value_enum)]
    pub cluster_visibility: Option<ClusterVisibility>,
    /// Lightcuts at some places only, and reconstruction cuts between them (lightcuts only): several times as fast, and
    /// adaptively antialiased, but without the bounded error [default: off].
    #[arg(long, value_enum)]
    pub reconstruction: Option<Switch>,
}

/// What says how much of a cluster is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ClusterVisibility {
    /// Its parts.
    Parts,
    /// Its representative light.
    Representative,
}

/// On or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// Do.
    On,
    /// Don't.
    Off,
}

/// How pixelcuts go about it.
#[derive(Args, Clone, Debug, Default)]
pub struct PixelcutsArgs {
    /// Clusters of pixels that each light is sent to, before refinement (pixelcuts) [default: 2048].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1_048_576))]
    pub clusters: Option<u32>,
    /// Trees of pixels, each for a random part of the lights (pixelcuts) [default: 4].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1024))]
    pub trees: Option<u32>,
    /// Highest degree of the spherical harmonics that incident light is kept in (pixelcuts) [default: 3].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(0, 3))]
    pub sh_degree: Option<u32>,
}

impl PlayArgs {
    /// A play of an asset into `output`, all else by default.
    ///
    /// # Errors
    /// `output` is no name of an image.
    pub fn new(asset: &Path, output: &Path) -> Result<PlayArgs, Failure> {
        parsed(&[
            asset.display().to_string(),
            "-o".into(),
            output.display().to_string(),
        ])
    }

    /// The file of a frame, if frames are written.
    pub fn output_of(&self, frame: u32) -> Option<PathBuf> {
        self.output.as_ref().map(|output| output.file(frame))
    }

    /// How to make light.
    pub fn integrator(&self) -> Integrator {
        match self.integrator {
            IntegratorName::Auto => Integrator::Auto,
            IntegratorName::Transfer => Integrator::Transfer,
            IntegratorName::Cuts => Integrator::Cuts,
            IntegratorName::Brute if self.points.given() => {
                Tracer::BrutePoints(self.points.settings()).into()
            }
            IntegratorName::Brute => Tracer::Brute.into(),
            IntegratorName::Lightcuts => Tracer::Lightcuts {
                points: self.points.settings(),
                cuts: self.lightcuts.settings(),
                reconstruction: self.lightcuts.reconstruction == Some(Switch::On),
            }
            .into(),
            IntegratorName::Pixelcuts => Tracer::Pixelcuts {
                points: self.points.settings(),
                cuts: self.pixelcuts.settings(),
            }
            .into(),
            IntegratorName::Path => Tracer::Path {
                max_bounces: self.max_bounces,
            }
            .into(),
        }
    }

    /// Whether nodes of visibility cuts are to be counted.
    pub fn counts_nodes(&self) -> bool {
        let counts = [LayerName::CutSize, LayerName::Nodes];
        self.layers.iter().any(|layer| counts.contains(layer))
    }

    /// How to light frames.
    pub fn frame_settings(&self, seed: u64) -> FrameSettings {
        let surface = [
            LayerName::Albedo,
            LayerName::Normal,
            LayerName::Depth,
            LayerName::Background,
        ];
        let defaults = FrameSettings::default();
        FrameSettings {
            // By default 8 to 16 rays.
            pixel_samples: self.spp.map_or(defaults.pixel_samples, |spp| spp.div_ceil(2)),
            seed,
            light_layers: self.layers.contains(&LayerName::Lights),
            surface_layers: self.layers.iter().any(|layer| surface.contains(layer)),
            cut_layers: self.counts_nodes(),
            illumination_cut: (self.illumination_cut)
                .map_or(defaults.illumination_cut, |nodes| nodes as usize),
            ..defaults
        }
    }
}

impl PointArgs {
    /// Whether points were asked for.
    fn given(&self) -> bool {
        let samples = [
            self.area_samples,
            self.environment_samples,
            self.sun_samples,
            self.sky_samples,
            self.vpls,
        ];
        samples.iter().any(Option::is_some)
    }

    fn settings(&self) -> PointSettings {
        let defaults = PointSettings::default();
        PointSettings {
            area_samples: self.area_samples,
            environment: self.environment_samples.unwrap_or(defaults.environment),
            sun: self.sun_samples.unwrap_or(defaults.sun),
            sky: self.sky_samples.unwrap_or(defaults.sky),
            vpls: self.vpls.unwrap_or(0),
            clamp: self.clamp.unwrap_or(defaults.clamp),
            ..defaults
        }
    }
}

impl LightcutArgs {
    fn settings(&self) -> LightcutSettings {
        let defaults = LightcutSettings::default();
        LightcutSettings {
            error_ratio: self.error_ratio.unwrap_or(defaults.error_ratio),
            max_nodes: match self.max_nodes {
                Some(0) => usize::MAX,
                nodes => nodes.unwrap_or(defaults.max_nodes),
            },
            uncertainty: match self.cluster_visibility {
                Some(ClusterVisibility::Representative) => f32::INFINITY,
                _ => defaults.uncertainty,
            },
        }
    }
}

impl PixelcutsArgs {
    fn settings(&self) -> PixelcutsSettings {
        let defaults = PixelcutsSettings::default();
        PixelcutsSettings {
            clusters: self.clusters.unwrap_or(defaults.clusters),
            trees: self.trees.unwrap_or(defaults.trees),
            degree: self.sh_degree.map_or(defaults.degree, |degree| degree as usize),
            ..defaults
        }
    }
}

/// Exposure of previews.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// Chosen by the first frame that has light.
    Auto,
    /// In stops.
    Stops(f32),
}

fn sky_patches(text: &str) -> Result<SkyPatches, String> {
    let patches = text.parse().ok().and_then(SkyPatches::new);
    patches.ok_or_else(|| "a sky has 145, 577 or 2305 patches".into())
}

fn exposure(text: &str) -> Result<Exposure, String> {
    match text {
        "auto" => Ok(Exposure::Auto),
        _ => real(-100.0, 100.0)(text).map(Exposure::Stops),
    }
}
