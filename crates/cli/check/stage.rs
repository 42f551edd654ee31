//! What the cases share: scene → bytes of an asset → light, by the calls that the commands make.

use crate::signals;
use glam::{DVec3, Vec3};
use relight_bake::error::BakeError;
use relight_bake::params::{BakeParams, Preset};
use relight_bake::{Progress, bake};
use relight_format::{self as format, Asset, Limits};
use relight_play::frame::{LightingSettings, Lit};
use relight_play::load::{Loaded, from_asset};
use relight_play::reflections::FIXED_RAYS;
use relight_play::shot::{Shot, expose};
use relight_render::layers::{RenderSize, Watch};
use relight_render::path::{PathSettings, render};
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::scene::Scene;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::{Shading, TracedScene};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use super::case::Measure;

/// Where a case is, for the message when it fails.
#[derive(Default)]
pub struct Stage {
    now: Mutex<String>,
}

impl Progress for Stage {
    fn stage(&self, name: &'static str, _: Option<u64>) {
        self.at(format!("bake: {name}"));
    }
    fn advance(&self, _: u64) {}
    fn stopped(&self) -> bool {
        signals::go_on().is_err()
    }
}

/// Pixels along each side of a case's image.
pub const SIZE: usize = 48;

/// Pixels along each side of a path-traced image.
pub const TRACED: usize = 24;

/// The preset `draft` less its finest level: small scenes have no more detail.
pub fn quick() -> BakeParams {
    BakeParams {
        levels: 4,
        ..BakeParams::preset(Preset::Draft)
    }
}

/// As [`quick`] with a third of its points, where not errors but sanity is at stake.
pub fn coarse() -> BakeParams {
    BakeParams {
        levels: 3,
        rays: 128,
        ..quick()
    }
}

impl Stage {
    /// A small path-traced frame of a scene under some lights, seen by its first camera.
    pub fn traced(&self, scene: &TracedScene, tracks: &[LightTrack]) -> Result<Layers, String> {
        self.traced_with(scene, tracks, 64)
    }

    /// As [`Stage::traced`] with so many paths per pixel.
    fn traced_with(&self, scene: &TracedScene, tracks: &[LightTrack], spp: u32) -> Result<Layers, String> {
        self.at("play: path");
        let emitters = SceneEmitters::new(scene);
        let lights = LightSet::new(&emitters, tracks, 0.0).map_err(|e| e.to_string())?;
        let size = RenderSize {
            width: TRACED,
            height: TRACED,
        };
        let watch = Watch {
            cancel: &AtomicBool::new(false),
            progress: &|_, _| {},
        };
        let settings = PathSettings {
            spp,
            ..PathSettings::default()
        };
        let camera = scene.scene().cameras[0].at(0.0);
        render(scene, &lights, &camera, size, &settings, &watch).map_err(|e| e.to_string())
    }

    /// Indirect light per pixel of [`Stage::traced_with`].
    pub fn traced_indirect(
        &self,
        scene: &TracedScene,
        tracks: &[LightTrack],
        spp: u32,
    ) -> Result<Vec<Vec3>, String> {
        let layers = self.traced_with(scene, tracks, spp)?;
        let pixels = layers.rgb("indirect").unwrap_or_default().pixels;
        Ok(pixels.into_iter().map(Vec3::from).collect())
    }

    /// Says what is being done.
    pub fn at(&self, what: impl Into<String>) {
        if let Ok(mut now) = self.now.lock() {
            *now = what.into();
        }
    }

    /// What is being done.
    pub fn now(&self) -> String {
        self.now.lock().map(|now| now.clone()).unwrap_or_default()
    }

    /// Bakes a scene.
    pub fn asset(&self, scene: Scene, shading: Shading, params: &BakeParams) -> Result<Asset, BakeError> {
        bake(Arc::new(scene), shading, params, None, 0, self).map(|baked| baked.asset)
    }

    /// What a player makes of an asset, by way of the file's bytes.
    pub fn through_file(&self, asset: &Asset) -> Result<Loaded, String> {
        self.at("format: write");
        let bytes = format::write_asset(asset).map_err(|e| e.to_string())?;
        self.at("format: read");
        let asset = format::read_asset(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
        self.at("play: load");
        from_asset(asset, format::content_hash(&bytes), Path::new("case"), true).map_err(|e| e.to_string())
    }

    /// Bakes, writes, reads and loads; all materials matt.
    pub fn loaded(&self, scene: Scene, params: &BakeParams) -> Result<Loaded, String> {
        let asset = self
            .asset(scene, Shading::Lambert, params)
            .map_err(|e| e.to_string())?;
        self.through_file(&asset)
    }

    /// What the first camera sees.
    pub fn shot(&self, loaded: &Loaded, size: usize) -> Result<Shot, String> {
        self.at("play: expose");
        let camera = loaded.scene.cameras.first().ok_or("no camera")?.at(0.0);
        let mut shot = expose(&loaded.player.scene, &camera, size, size, 1);
        self.at("play: weigh");
        if let Some(transfer) = &loaded.player.transfer {
            shot.weigh(transfer, &loaded.player.scene, FIXED_RAYS);
        }
        Ok(shot)
    }

    /// Lights a shot with the transfer integrator.
    pub fn lit(&self, loaded: &Loaded, shot: &Shot, tracks: &[LightTrack]) -> Result<Lit, String> {
        self.lit_with(loaded, shot, tracks, 4, false)
    }

    /// As [`Stage::lit`] with so many rays per point to lights with extent, and layers per light if wanted.
    pub fn lit_with(
        &self,
        loaded: &Loaded,
        shot: &Shot,
        tracks: &[LightTrack],
        point_samples: u32,
        per_light: bool,
    ) -> Result<Lit, String> {
        self.at("play: light");
        let emitters = SceneEmitters::new(&loaded.player.scene);
        let lights = LightSet::new(&emitters, tracks, 0.0).map_err(|e| e.to_string())?;
        let settings = LightingSettings {
            pixel_samples: 8,
            point_samples,
            seed: 0,
            per_light,
            indirect: loaded.player.transfer.is_some(),
            bounce_cuts: None,
        };
        Ok(loaded.player.light(shot, &lights, None, &settings).0)
    }

    /// Bakes a scene and lights what its camera sees.
    pub fn picture(&self, scene: Scene, params: &BakeParams, tracks: &[LightTrack]) -> Result<Lit, String> {
        let loaded = self.loaded(scene, params)?;
        let shot = self.shot(&loaded, SIZE)?;
        self.lit(&loaded, &shot, tracks)
    }
}

/// Direct light and its indirect light at the finest points, W/m².
pub struct AtPoints {
    /// Irradiance that lights cause.
    pub direct: Vec<Vec3>,
    /// Irradiance after one reflection and more.
    pub indirect: Vec<Vec3>,
}

/// Irradiance at the finest points, which stand for equal areas.
pub fn at_points(stage: &Stage, loaded: &Loaded, tracks: &[LightTrack]) -> Result<AtPoints, String> {
    stage.at("play: direct light at the points");
    let transfer = loaded.player.transfer.as_ref().ok_or("the asset has no points")?;
    let emitters = SceneEmitters::new(&loaded.player.scene);
    let lights = LightSet::new(&emitters, tracks, 0.0).map_err(|e| e.to_string())?;
    let mut direct = vec![Vec3::ZERO; transfer.finest.len()];
    let points: &[Option<SurfaceHit>] = &loaded.player.points;
    for light in 0..lights.len() {
        let mut own = vec![Vec3::ZERO; direct.len()];
        relight_render::lighting::irradiance_at(
            &loaded.player.scene,
            &lights,
            light,
            points,
            loaded.player.footprint(),
            4,
            0,
            &mut own,
        );
        direct.iter_mut().zip(own).for_each(|(sum, own)| *sum += own);
    }
    stage.at("play: transfer");
    let (values, _) = transfer.indirect_from_direct(&direct);
    let indirect = (values.iter().zip(&transfer.finest.normals))
        .map(|(v, n)| v.irradiance(*n))
        .collect();
    Ok(AtPoints { direct, indirect })
}

/// Mean over places, RGB, f64.
pub fn mean(values: &[Vec3]) -> DVec3 {
    values.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / values.len().max(1) as f64
}

/// Root of the mean squared difference relative to the root of the mean square of `b`.
pub fn difference(a: &[Vec3], b: &[Vec3]) -> f64 {
    let squares = |v: &mut dyn Iterator<Item = DVec3>| v.map(|v| v.length_squared()).sum::<f64>();
    let apart = squares(&mut a.iter().zip(b).map(|(a, b)| a.as_dvec3() - b.as_dvec3()));
    let size = squares(&mut b.iter().map(|b| b.as_dvec3()));
    if size > 0.0 {
        (apart / size).sqrt()
    } else {
        apart.sqrt()
    }
}

/// How far apart two bakes of one scene may be that differ in what does not matter: twice what another seed changes
/// in it, measured beside them.
pub fn seeds_apart(
    stage: &Stage,
    scene: impl Fn() -> Scene,
    params: &BakeParams,
    tracks: &[LightTrack],
    plain: &Lit,
) -> Result<f64, String> {
    let other = BakeParams {
        seed: params.seed + 1,
        ..params.clone()
    };
    let other = stage.picture(scene(), &other, tracks)?;
    Ok(2.0 * difference(&other.indirect, &plain.indirect))
}

/// That all light is finite, that light which is a sum of positive parts is nowhere negative, and that the negative
/// parts of indirect light, which differences between levels may leave, are small.
pub fn sane(lit: &Lit) -> Vec<Measure> {
    let all = || lit.emission.iter().chain(&lit.direct).chain(&lit.indirect);
    let broken = all().filter(|v| !v.is_finite()).count();
    let negative = lit
        .emission
        .iter()
        .chain(&lit.direct)
        .filter(|v| v.min_element() < 0.0)
        .count();
    let sum = |sign: f64| -> f64 {
        let parts = lit
            .indirect
            .iter()
            .map(|v| (v.as_dvec3() * sign).max(DVec3::ZERO));
        parts.sum::<DVec3>().element_sum()
    };
    let (below, above) = (sum(-1.0), sum(1.0));
    let share = if above > 0.0 { below / above } else { below };
    vec![
        Measure::none("not finite", broken, "every value must be a number"),
        Measure::none("negative direct light", negative, "a sum of non-negative parts"),
        Measure::new(
            "negative indirect light",
            share,
            1e-3,
            "share of all: what the final clamp at zero may add, below a tenth of the error",
        ),
    ]
}
