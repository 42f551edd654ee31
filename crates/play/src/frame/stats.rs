//! What a frame took, by stage.

use crate::cuts::shade::ShadeStats;
use crate::transfer::TransferStats;
use relight_render::lightcuts::{LightcutStats, ReconstructionStats};
use relight_render::pixelcuts::PixelcutsStats;
use std::time::Instant;

/// Milliseconds since `start`.
pub(crate) fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

/// Milliseconds that the stages of a relit frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// Direct irradiance at the finest points.
    pub direct_points: f64,
    /// Pull-push and further bounces.
    pub bounces: f64,
    /// Product with T.
    pub transfer: f64,
    /// Flattening to the finest level.
    pub flatten: f64,
    /// Direct light at the pixels.
    pub direct_pixels: f64,
    /// Indirect light at the pixels.
    pub reconstruct: f64,
    /// Choosing the illumination cut.
    pub illumination_cut: f64,
    /// Light of even directions at the pixels.
    pub shade: f64,
    /// Pixels from fragments.
    pub resolve: f64,
}

/// What a relit frame took.
#[derive(Clone, Copy, Debug, Default)]
pub struct RelitStats {
    /// By stage.
    pub times: FrameTimes,
    /// How the last transfer went.
    pub transfer: Option<TransferStats>,
    /// How shading with visibility cuts went, the last time.
    pub cuts: Option<CutStats>,
    /// What direct light took where the lights were so many that lightcuts made it.
    pub lightcuts: Option<DirectLightcuts>,
    /// Lights that were taken as they were in the frame before.
    pub still_lights: usize,
    /// Pixels of the image.
    pub pixels: usize,
}

/// What shading with visibility cuts took.
#[derive(Clone, Copy, Debug, Default)]
pub struct CutStats {
    /// Nodes of the illumination cut.
    pub nodes: usize,
    /// How shading went.
    pub shading: ShadeStats,
}

/// What lightcuts for direct light took.
#[derive(Clone, Copy, Debug, Default)]
pub struct DirectLightcuts {
    /// Lights without extent that stand for all.
    pub lights: usize,
    /// Cuts at the points of the basis and at surface samples.
    pub points: LightcutStats,
    /// Cuts at the fragments.
    pub pixels: LightcutStats,
}

/// What a frame took that was traced without what the asset holds.
#[derive(Clone, Copy, Debug)]
pub struct TracedStats {
    /// Milliseconds of all of it.
    pub render: f64,
    /// Making points of lights, where the integrator takes these.
    pub points: Option<PointStats>,
    /// What the integrator says of itself.
    pub detail: TracedDetail,
    /// Pixels of the image.
    pub pixels: usize,
}

/// Points that stand for all lights.
#[derive(Clone, Copy, Debug)]
pub struct PointStats {
    /// Milliseconds of making them.
    pub milliseconds: f64,
    /// How many there are.
    pub lights: usize,
    /// How many of them are virtual lights.
    pub virtual_lights: usize,
}

/// What an integrator says of itself.
#[derive(Clone, Copy, Debug)]
pub enum TracedDetail {
    /// Nothing.
    Plain,
    /// Shadow rays to every point.
    BrutePoints {
        /// Of all pixels.
        shadow_rays: u64,
    },
    /// A lightcut at each sample.
    Lightcuts {
        /// Building the trees.
        tree: TreeStats,
        /// Milliseconds of lighting.
        light: f64,
        /// The cuts.
        stats: LightcutStats,
    },
    /// Lightcuts at some places and reconstruction between.
    Reconstruction {
        /// Building the trees.
        tree: TreeStats,
        /// Milliseconds of lighting.
        light: f64,
        /// The cuts.
        stats: ReconstructionStats,
    },
    /// Pixelcuts.
    Pixelcuts(PixelcutsStats),
}

/// Trees over points.
#[derive(Clone, Copy, Debug)]
pub struct TreeStats {
    /// Milliseconds of building them.
    pub milliseconds: f64,
    /// Memory that they take.
    pub bytes: usize,
}

/// What a frame took.
#[derive(Clone, Copy, Debug)]
pub enum FrameStats {
    /// Of what the asset holds.
    Relit(RelitStats),
    /// Of the scene alone.
    Traced(TracedStats),
}

/// A figure of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Figure {
    /// A time.
    Milliseconds(f64),
    /// A number of things, or bytes.
    Count(u64),
    /// A mean, of nodes or rays for each of some places.
    Mean(f64),
}

impl Figure {
    /// Its value.
    pub fn value(self) -> f64 {
        match self {
            Figure::Milliseconds(value) | Figure::Mean(value) => value,
            Figure::Count(count) => count as f64,
        }
    }
}

impl FrameStats {
    /// All of it by name, for tables and logs.
    pub fn figures(&self) -> Vec<(&'static str, Figure)> {
        match self {
            FrameStats::Relit(stats) => stats.figures(),
            FrameStats::Traced(stats) => stats.figures(),
        }
    }
}

/// `count` things at so many places.
fn mean(count: u64, places: usize) -> Figure {
    Figure::Mean(count as f64 / places.max(1) as f64)
}

impl RelitStats {
    fn figures(&self) -> Vec<(&'static str, Figure)> {
        use Figure::{Count, Milliseconds};
        let times = &self.times;
        let mut all = vec![
            ("direct_points", Milliseconds(times.direct_points)),
            ("bounces", Milliseconds(times.bounces)),
            ("transfer", Milliseconds(times.transfer)),
            ("flatten", Milliseconds(times.flatten)),
            ("direct_pixels", Milliseconds(times.direct_pixels)),
            ("reconstruct", Milliseconds(times.reconstruct)),
            ("resolve", Milliseconds(times.resolve)),
        ];
        if self.still_lights > 0 {
            all.push(("still_lights", Count(self.still_lights as u64)));
        }
        if let Some(DirectLightcuts {
            lights,
            points,
            pixels,
        }) = self.lightcuts
        {
            all.extend([
                ("lights", Count(lights as u64)),
                ("shadow_rays_per_pixel", mean(pixels.shadow_rays, self.pixels)),
                ("nodes_per_pixel", mean(pixels.nodes, self.pixels)),
                ("nodes_per_point", mean(points.nodes, points.cuts as usize)),
            ]);
        }
        if let Some(CutStats { nodes, shading }) = self.cuts {
            all.extend([
                ("illumination_cut", Milliseconds(times.illumination_cut)),
                ("shade", Milliseconds(times.shade)),
                ("illumination_cut_nodes", Count(nodes as u64)),
                (
                    "merged_nodes_per_fragment",
                    mean(shading.merged_nodes, shading.fragments as usize),
                ),
            ]);
        }
        all
    }
}

impl TracedStats {
    fn figures(&self) -> Vec<(&'static str, Figure)> {
        use Figure::{Count, Milliseconds};
        let per_pixel = |count: u64| mean(count, self.pixels);
        let mut all = vec![("render", Milliseconds(self.render))];
        if let Some(points) = self.points {
            all.extend([
                ("points", Milliseconds(points.milliseconds)),
                ("lights", Count(points.lights as u64)),
                ("virtual_lights", Count(points.virtual_lights as u64)),
            ]);
        }
        let of_tree = |tree: TreeStats, light: f64| {
            [
                ("tree", Milliseconds(tree.milliseconds)),
                ("tree_bytes", Count(tree.bytes as u64)),
                ("light", Milliseconds(light)),
            ]
        };
        match self.detail {
            TracedDetail::Plain => {}
            TracedDetail::BrutePoints { shadow_rays } => {
                all.push(("shadow_rays_per_pixel", per_pixel(shadow_rays)));
            }
            TracedDetail::Lightcuts { tree, light, stats } => {
                all.extend(of_tree(tree, light));
                all.extend([
                    ("shadow_rays_per_pixel", per_pixel(stats.shadow_rays)),
                    ("nodes_per_pixel", per_pixel(stats.nodes)),
                    ("limited_cuts_per_pixel", per_pixel(stats.limited)),
                ]);
            }
            TracedDetail::Reconstruction { tree, light, stats } => {
                all.extend(of_tree(tree, light));
                all.extend([
                    ("eye_rays_per_pixel", per_pixel(stats.eye_rays)),
                    (
                        "shadow_rays_per_pixel",
                        per_pixel(stats.shadow_rays + stats.sample_rays),
                    ),
                    ("nodes_per_pixel", per_pixel(stats.sample_nodes)),
                    ("samples_per_pixel", per_pixel(stats.samples)),
                    (
                        "shadow_rays_per_reconstruction_cut",
                        mean(stats.shadow_rays, stats.cuts as usize),
                    ),
                ]);
            }
            TracedDetail::Pixelcuts(stats) => {
                let times = stats.times;
                all.extend([
                    ("eye", Milliseconds(times.eye)),
                    ("exact", Milliseconds(times.exact)),
                    ("estimate", Milliseconds(times.estimate)),
                    ("trees", Milliseconds(times.trees)),
                    ("cuts", Milliseconds(times.cuts)),
                    ("scatter", Milliseconds(times.scatter)),
                    ("shade", Milliseconds(times.shade)),
                    ("resolve", Milliseconds(times.resolve)),
                    ("exact_lights", Count(stats.exact as u64)),
                    ("shadow_rays_per_pixel", per_pixel(stats.shadow_rays)),
                    ("nodes_per_pixel", per_pixel(stats.clusters)),
                ]);
            }
        }
        all
    }
}
