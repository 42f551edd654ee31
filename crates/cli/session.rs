//! What a play keeps from frame to frame, and how a frame is rendered by each integrator.

use crate::choice::ByCuts;
use crate::console::Console;
use crate::failure::Failure;
use crate::lightcuts;
use crate::many_lights::insert_pixelcuts;
use crate::play::{Integrator, LayerName, PlayArgs};
use crate::signals;
use crate::words;
use glam::Vec3;
use rayon::prelude::*;
use relight_play::cuts::own_sites;
use relight_play::edited::Editor;
use relight_play::frame::{Distant, FrameTimes, LightingSettings, Lit};
use relight_play::load::Loaded;
use relight_play::reflections::{FIXED_RAYS, MOVING_RAYS};
use relight_play::shot::{Shot, expose};
use relight_play::views;
use relight_render::brute::{self, BruteSettings, PointsSettings};
use relight_render::layers::{RenderSize, Watch};
use relight_render::path::{self, PathSettings};
use relight_render::pixelcuts;
use relight_scene::camera::Camera;
use relight_scene::image::{BEAUTY, Layers};
use relight_scene::light_set::{LightRig, LightSet, Split};
use serde_json::{Map, Value};
use std::sync::Arc;
use std::time::Instant;

/// Shadow rays for each light with extent: at a pixel's fragments and at the points. A sender averages some
/// hundreds of points, a pixel nothing.
pub const PIXEL_LIGHT_SAMPLES: u32 = 8;
/// See [`PIXEL_LIGHT_SAMPLES`].
pub const POINT_LIGHT_SAMPLES: u32 = 4;
/// Primary rays per pixel of the transfer integrator where the camera stands still: they are cast once per shot.
pub const FIXED_SPP: u32 = 16;
/// The same where it moves and every frame casts them anew.
const MOVING_SPP: u32 = 1;

/// What lasts from frame to frame.
pub struct Session<'a> {
    /// What was asked for.
    pub args: &'a PlayArgs,
    /// The asset.
    pub loaded: &'a mut Loaded,
    /// Edits of its materials.
    pub editor: Option<Editor>,
    /// The lights of all frames.
    pub rig: &'a LightRig<'a>,
    /// The parts of each light's environment, where visibility cuts take it.
    pub splits: Option<Vec<Option<Arc<Split>>>>,
    /// What visibility cuts are used for.
    pub by_cuts: ByCuts,
    /// How light is made.
    pub integrator: Integrator,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// What the camera sees, once it has looked.
    pub shot: Option<Shot>,
    /// Whether the camera stands still.
    pub fixed: bool,
    /// Milliseconds of what is done once per shot, for the JSON.
    pub once: Map<String, Value>,
    /// Milliseconds of the frame at hand that count as done once per shot.
    pub apart_ms: f64,
}

/// Layers of a frame and the milliseconds of its stages.
pub type Rendered = (Layers, Map<String, Value>);

impl Session<'_> {
    /// Materials of a frame, and what a standing camera sees of them; milliseconds, if there are edits.
    pub fn edit(&mut self, frame: u32) -> Result<Option<f64>, Failure> {
        let Some(editor) = &mut self.editor else {
            return Ok(None);
        };
        let start = Instant::now();
        editor.apply(frame.into(), &mut self.loaded.player)?;
        if let Some(shot) = &mut self.shot
            && self.fixed
        {
            editor.reshade(&self.loaded.player, shot);
        }
        Ok(Some(milliseconds(start)))
    }

    /// Renders a frame.
    ///
    /// # Errors
    /// A signal asked to stop.
    pub fn render(&mut self, frame: u32, camera: &Camera, console: &Console) -> Result<Rendered, Failure> {
        match self.integrator {
            Integrator::Transfer | Integrator::Cuts | Integrator::Auto => self.relit(frame, camera, console),
            Integrator::Brute | Integrator::Lightcuts | Integrator::Pixelcuts | Integrator::Path => {
                self.reference(&self.rig.at(frame.into()), camera)
            }
        }
    }

    fn wants(&self, layer: LayerName) -> bool {
        self.args.layers.contains(&layer)
    }

    fn reference(&self, lights: &LightSet, camera: &Camera) -> Result<Rendered, Failure> {
        let start = Instant::now();
        let size = RenderSize {
            width: self.width,
            height: self.height,
        };
        let watch = Watch {
            cancel: signals::stop_flag(),
            progress: &|_, _| {},
        };
        let scene = &self.loaded.player.scene;
        let light_layers = self.wants(LayerName::Lights);
        let seed = self.seed;
        let mut times = Map::new();
        let layers = if self.integrator == Integrator::Lightcuts {
            let options = (&self.args.lightcuts, &self.args.points);
            let image = (self.args.spp, seed, light_layers);
            lightcuts::render(scene, lights, camera, size, options, image, &watch, &mut times)
        } else if self.integrator == Integrator::Pixelcuts {
            let points = self.args.points.points(scene, lights, seed, &mut times);
            let settings = self.args.pixelcuts.settings(self.args.spp, seed, light_layers);
            pixelcuts::render(scene, lights, &points, camera, size, &settings, &watch).map(
                |(layers, stats)| {
                    insert_pixelcuts(&mut times, &stats, size.width * size.height);
                    layers
                },
            )
        } else if self.integrator == Integrator::Brute && self.args.points.given() {
            let points = self.args.points.points(scene, lights, seed, &mut times);
            let settings = PointsSettings {
                spp: self.args.spp.unwrap_or(BruteSettings::default().spp),
                seed,
                light_layers,
                packets: true,
            };
            brute::render_points(scene, lights, &points, camera, size, &settings, &watch).map(
                |(layers, shadow_rays)| {
                    let per_pixel = shadow_rays as f64 / (size.width * size.height) as f64;
                    times.insert("shadow_rays_per_pixel".into(), per_pixel.into());
                    layers
                },
            )
        } else if self.integrator == Integrator::Brute {
            let defaults = BruteSettings::default();
            let spp = self.args.spp.unwrap_or(defaults.spp);
            let settings = BruteSettings {
                spp,
                seed,
                light_layers,
                ..defaults
            };
            brute::render(scene, lights, camera, size, &settings, &watch)
        } else {
            let spp = self.args.spp.unwrap_or(PathSettings::default().spp);
            let settings = PathSettings {
                spp,
                max_bounces: self.args.max_bounces,
                seed,
                light_layers,
            };
            path::render(scene, lights, camera, size, &settings, &watch)
        };
        let layers = layers.map_err(|_| signals::failure())?;
        times.insert("render".into(), milliseconds(start).into());
        Ok((layers, times))
    }

    fn relit(&mut self, frame: u32, camera: &Camera, console: &Console) -> Result<Rendered, Failure> {
        let player = &self.loaded.player;
        let mut times = Map::new();
        if self.shot.is_none() || !self.fixed {
            let start = Instant::now();
            let spp = self
                .args
                .spp
                .unwrap_or(if self.fixed { FIXED_SPP } else { MOVING_SPP });
            let mut shot = expose(&player.scene, camera, self.width, self.height, spp);
            let exposed = milliseconds(start);
            let start = Instant::now();
            // Before lobes are followed, which depends on what surfaces are like.
            let moves = self.editor.as_ref().is_some_and(|editor| {
                editor.reshade(player, &mut shot);
                editor.moves()
            });
            if let Some(transfer) = &player.transfer {
                let rays = if self.fixed && !moves {
                    FIXED_RAYS
                } else {
                    MOVING_RAYS
                };
                shot.weigh(transfer, &player.scene, rays);
            }
            if let (Some(cuts), true) = (&player.cuts, self.by_cuts != ByCuts::Nothing) {
                shot.choose_sites();
                if self.fixed {
                    own_sites::give(cuts, &player.scene, &mut shot);
                }
            }
            let weighed = milliseconds(start);
            let keep = if self.fixed {
                self.apart_ms = exposed + weighed;
                &mut self.once
            } else {
                &mut times
            };
            keep.insert("expose".into(), exposed.into());
            keep.insert("weigh".into(), weighed.into());
            let uncovered = shot.uncovered();
            if uncovered > 0 {
                console.detail(format!(
                    "{} of {} fragments have no point near them and get no indirect light",
                    words::count(uncovered as u64),
                    words::count(shot.len() as u64)
                ));
            }
            self.shot = Some(shot);
        }
        let Some(shot) = &self.shot else {
            unreachable!("made above")
        };
        let settings = LightingSettings {
            pixel_samples: PIXEL_LIGHT_SAMPLES,
            point_samples: POINT_LIGHT_SAMPLES,
            seed: self.seed,
            per_light: self.wants(LayerName::Lights),
            indirect: self.integrator != Integrator::Cuts,
            bounce_cuts: (self.by_cuts == ByCuts::FirstBounce).then_some(self.args.illumination_cut as usize),
        };
        let lights = self.rig.at(frame.into());
        let distant = self.splits.as_ref().map(|splits| {
            let most = self.args.illumination_cut as usize;
            Distant::at(self.rig, frame.into(), |light| splits[light].clone(), most)
        });
        let (lit, frame) = player.light(shot, &lights, distant.as_ref(), &settings);
        let start = Instant::now();
        let layers = self.resolved(shot, &lit);
        let resolve = milliseconds(start);
        let FrameTimes {
            direct_points,
            bounces,
            transfer,
            flatten,
            direct_pixels,
            reconstruct,
            illumination_cut,
            shade,
        } = frame;
        for (name, value) in [
            ("direct_points", direct_points),
            ("bounces", bounces),
            ("transfer", transfer),
            ("flatten", flatten),
            ("direct_pixels", direct_pixels),
            ("reconstruct", reconstruct),
            ("resolve", resolve),
        ] {
            times.insert(name.into(), value.into());
        }
        if let Some(cuts) = lit.lightcuts {
            let per = |count: u64, places: usize| count as f64 / places.max(1) as f64;
            let pixels = shot.width * shot.height;
            times.insert("lights".into(), cuts.lights.into());
            for (name, value) in [
                ("shadow_rays_per_pixel", per(cuts.pixels.shadow_rays, pixels)),
                ("nodes_per_pixel", per(cuts.pixels.nodes, pixels)),
                (
                    "nodes_per_point",
                    per(cuts.points.nodes, cuts.points.cuts as usize),
                ),
            ] {
                times.insert(name.into(), value.into());
            }
        }
        if let Some((nodes, stats)) = lit.cuts {
            times.insert("illumination_cut".into(), illumination_cut.into());
            times.insert("shade".into(), shade.into());
            times.insert("illumination_cut_nodes".into(), nodes.into());
            let mean = stats.merged_nodes as f64 / stats.fragments.max(1) as f64;
            times.insert("merged_nodes_per_fragment".into(), mean.into());
        }
        Ok((layers, times))
    }

    /// Pixels from fragments. Indirect light is clamped at zero here, where all of it is summed; light layers
    /// are not, so that they add up.
    fn resolved(&self, shot: &Shot, lit: &Lit) -> Layers {
        let mut layers = Layers::new(shot.width, shot.height);
        let mut push = |name: &str, pixels: &[Vec3]| {
            let pixels: Vec<[f32; 3]> = pixels.par_iter().with_min_len(4096).map(Vec3::to_array).collect();
            layers.push_rgb(name, &pixels);
        };
        let emission = shot.resolve(&lit.emission);
        let direct = shot.resolve(&lit.direct);
        let mut indirect = shot.resolve(&lit.indirect);
        (indirect.par_iter_mut().with_min_len(4096)).for_each(|v| *v = v.max(Vec3::ZERO));
        let beauty: Vec<Vec3> = (0..indirect.len())
            .into_par_iter()
            .with_min_len(4096)
            .map(|i| emission[i] + direct[i] + indirect[i])
            .collect();
        push(BEAUTY, &beauty);
        push("emission", &emission);
        push("direct", &direct);
        push("indirect", &indirect);
        for (name, fragments) in &lit.lights {
            push(&format!("light.{name}"), &shot.resolve(fragments));
        }
        if self.wants(LayerName::Albedo) {
            push("albedo", &views::albedo(shot));
        }
        if self.wants(LayerName::Normal) {
            push("normal", &views::normals(shot));
        }
        if self.wants(LayerName::Depth) {
            layers.push_scalar("depth", &views::depth(shot));
        }
        layers
    }
}

/// Median; 0 of nothing.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Milliseconds since `start`.
pub fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
