//! What the cases share: scene → bytes of an asset → light, by the calls that the commands make.

use crate::signals;
use glam::{DVec3, Vec3};
use relight_bake::error::BakeError;
use relight_bake::params::{BakeParams, Preset};
use relight_bake::{Progress, Request, bake};
use relight_format::{self as format, Asset, Limits};
use relight_play::frame::light::Lit;
use relight_play::open::Sections;
use relight_play::shot::RelitShot;
use relight_play::{CutSites, FrameSettings, Player, ShotSettings};
use relight_render::expose::expose;
use relight_render::layers::RenderSize;
use relight_render::path::render;
use relight_render::picture::Picture;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::scene::Scene;
use relight_scene::traced::{Shading, TracedScene};
use std::sync::{Arc, Mutex};

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
        let camera = scene.scene().cameras[0].at(0.0);
        let picture = Picture {
            spp: Some(spp),
            ..Picture::new(scene, &lights, &camera, size)
        };
        render(&picture, None).map_err(|e| e.to_string())
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
        let request = Request {
            shading,
            ..Request::new(Arc::new(scene), params)
        };
        bake(&request, None, self).map(|baked| baked.asset)
    }

    /// What a player makes of an asset, by way of the file's bytes.
    pub fn through_file(&self, asset: &Asset) -> Result<Player, String> {
        self.at("format: write");
        let bytes = format::write_asset(asset).map_err(|e| e.to_string())?;
        self.at("format: read");
        let asset = format::read_asset(&bytes, &Limits::default()).map_err(|e| e.to_string())?;
        self.at("play: load");
        Player::of_asset(asset, format::content_hash(&bytes), "case", Sections::All)
            .map_err(|e| e.to_string())
    }

    /// Bakes, writes, reads and loads; all materials matt.
    pub fn player(&self, scene: Scene, params: &BakeParams) -> Result<Player, String> {
        let asset = self
            .asset(scene, Shading::Lambert, params)
            .map_err(|e| e.to_string())?;
        self.through_file(&asset)
    }

    /// What the first camera sees, for light without visibility cuts.
    pub fn shot(&self, player: &Player, size: usize) -> Result<RelitShot, String> {
        let camera = player.scene().cameras.first().ok_or("no camera")?.at(0.0);
        Ok(self.shot_of(player, &camera, size, 1, None))
    }

    /// What a camera sees with so many rays a pixel.
    pub fn shot_of(
        &self,
        player: &Player,
        camera: &Camera,
        size: usize,
        samples: u32,
        sites: Option<CutSites>,
    ) -> RelitShot {
        self.at("play: expose");
        let seen = expose(&player.prepared.scene, camera, size, size, samples);
        self.at("play: weigh");
        let settings = ShotSettings {
            sites,
            ..ShotSettings::default()
        };
        player.shot_of(seen, &settings)
    }

    /// Lights a shot.
    pub fn lit(&self, player: &Player, shot: &RelitShot, tracks: &[LightTrack]) -> Result<Lit, String> {
        self.lit_with(player, shot, tracks, &FrameSettings::default())
    }

    /// As [`Stage::lit`] with other settings.
    pub fn lit_with(
        &self,
        player: &Player,
        shot: &RelitShot,
        tracks: &[LightTrack],
        settings: &FrameSettings,
    ) -> Result<Lit, String> {
        self.at("play: light");
        let lights = player.lights(tracks).map_err(|e| e.to_string())?;
        let lit = player.light(shot, &lights, 0.0, settings, &());
        lit.map(|lit| lit.0).map_err(|e| e.to_string())
    }

    /// Bakes a scene and lights what its camera sees.
    pub fn picture(&self, scene: Scene, params: &BakeParams, tracks: &[LightTrack]) -> Result<Lit, String> {
        let player = self.player(scene, params)?;
        let shot = self.shot(&player, SIZE)?;
        self.lit(&player, &shot, tracks)
    }
}

/// Direct light and its indirect light at the finest points, W/m².
pub struct AtPoints {
    /// Irradiance that lights cause.
    pub direct: Vec<Vec3>,
    /// Irradiance after one reflection and more.
    pub indirect: Vec<Vec3>,
    /// Surface that each stands for, in proportion.
    pub areas: Vec<f64>,
}

impl AtPoints {
    /// Mean of `direct` over the surface.
    pub fn mean_direct(&self) -> DVec3 {
        mean_by(self.direct.iter().zip(&self.areas))
    }

    /// Mean of `indirect` over the surface.
    pub fn mean_indirect(&self) -> DVec3 {
        mean_by(self.indirect.iter().zip(&self.areas))
    }
}

/// Mean of values by weights.
pub fn mean_by<'a>(values: impl Iterator<Item = (&'a Vec3, &'a f64)>) -> DVec3 {
    let (sum, weights) = values.fold((DVec3::ZERO, 0.0), |(sum, weights), (value, weight)| {
        (sum + value.as_dvec3() * *weight, weights + weight)
    });
    sum / weights
}

/// Irradiance at the finest points.
pub fn at_points(stage: &Stage, player: &Player, tracks: &[LightTrack]) -> Result<AtPoints, String> {
    stage.at("play: direct light at the points");
    let transfer = player
        .prepared
        .transfer
        .as_ref()
        .ok_or("the asset has no points")?;
    let emitters = SceneEmitters::new(&player.prepared.scene);
    let lights = LightSet::new(&emitters, tracks, 0.0).map_err(|e| e.to_string())?;
    let mut direct = vec![Vec3::ZERO; transfer.finest.len()];
    let places = &player.prepared.places;
    for light in 0..lights.len() {
        let (own, _) = relight_render::irradiance::irradiance_at(
            &player.prepared.scene,
            &lights,
            light,
            &places.hits,
            player.prepared.footprint(),
            4,
            0,
        );
        (direct.iter_mut().zip(places.means(own))).for_each(|(sum, own)| *sum += own);
    }
    stage.at("play: transfer");
    let (values, _) = transfer.indirect_from_direct(&direct);
    let indirect = (values.iter().zip(&transfer.finest.normals))
        .map(|(v, n)| v.irradiance(*n))
        .collect();
    let finest = &transfer.finest;
    let area = |point| f64::from(finest.disk_radius_of(point)).powi(2);
    Ok(AtPoints {
        direct,
        indirect,
        areas: (0..finest.len()).map(area).collect(),
    })
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
