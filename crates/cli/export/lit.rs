//! The finest points in the light of a sequence.

use super::args::ExportArgs;
use super::files::{Column, Folder, Positions};
use super::report::Facts;
use crate::console::Console;
use crate::failure::Failure;
use crate::kinds::{self, Wanted};
use crate::signals::{self, Signals};
use anyhow::anyhow;
use glam::{DVec3, Vec3};
use relight_play::frame::points::{LitPoints, lit_points};
use relight_play::transfer::Transfer;
use relight_play::{FrameSettings, Integrator, Lights, Player};
use relight_render::watch::Cancelled;
use relight_scene::sequence::read_sequence_at;
use std::f32::consts::FRAC_1_PI;
use std::path::PathBuf;

/// An asset and what lights it.
pub struct Stage {
    pub player: Player,
    pub lights: Lights,
    pub settings: FrameSettings,
    asset: PathBuf,
}

impl Stage {
    /// What the options name.
    pub fn read(args: &ExportArgs, seed: u64, console: &Console) -> Result<Stage, Failure> {
        args.lights
            .as_ref()
            .map(|file| kinds::check(file, Wanted::Lights))
            .transpose()?;
        console.begin("Reading the asset", None);
        let player = Player::open_for(&args.asset, &Integrator::Transfer)?;
        let sequence = match &args.lights {
            Some(file) => read_sequence_at(file, player.scene().offset)?,
            None => player.own_lights()?.clone(),
        };
        if args.frame >= sequence.frames {
            return Err(Failure::Usage(format!(
                "--frame is {}, but the sequence has frames 0 to {}",
                args.frame,
                sequence.frames.max(1) - 1
            )));
        }
        Ok(Stage {
            lights: player.lights(&sequence.lights)?,
            player,
            settings: FrameSettings {
                seed,
                ..FrameSettings::default()
            },
            asset: args.asset.clone(),
        })
    }

    /// The asset's points and operators.
    ///
    /// # Errors
    /// It has none.
    pub fn transfer(&self) -> anyhow::Result<&Transfer> {
        self.player.prepared.transfer.as_ref().ok_or_else(|| {
            anyhow!(
                "{}: holds no points; bake it with points, or export something else",
                self.asset.display()
            )
        })
    }
}

/// Points with what arrives at them, light by light, and what they send.
pub fn points(
    args: &ExportArgs,
    seed: u64,
    folder: &mut Folder,
    console: &Console,
) -> Result<Facts, Failure> {
    let stage = Stage::read(args, seed, console)?;
    let transfer = stage.transfer()?;
    let offset = stage.player.scene().offset;
    console.begin("Lighting points", Some(stage.lights.tracks().len() as u64));
    let lit = lit_points(
        &stage.player.prepared,
        &stage.lights,
        args.frame.into(),
        &stage.settings,
        &Signals,
    )
    .map_err(|Cancelled| signals::failure())?;
    let finest = &transfer.finest;
    let plain = |values: &[Vec3]| values.iter().map(Vec3::to_array).collect::<Vec<_>>();
    let (here, normals, albedo) = (
        plain(&finest.positions),
        plain(&finest.normals),
        plain(&transfer.albedo),
    );
    let positions = match offset {
        DVec3::ZERO => Positions::Here(&here),
        _ => Positions::Moved(
            (finest.positions.iter())
                .map(|p| (p.as_dvec3() + offset).to_array())
                .collect(),
        ),
    };
    let radiance: Vec<[f32; 3]> = (0..finest.len())
        .map(|i| {
            let arrives = |light: &LitPoints| light.direct[i] + light.indirect[i];
            let sum: Vec3 = lit.iter().map(arrives).sum();
            (sum * transfer.albedo[i] * FRAC_1_PI).to_array()
        })
        .collect();
    let supports: Vec<f32> = (0..finest.len())
        .map(|i| {
            let widening = finest.widenings.get(i).copied().unwrap_or(0);
            finest.support_radius * f32::powi(2.0, i32::from(widening))
        })
        .collect();
    folder.positions("positions", &positions)?;
    folder.vectors("normals", "1", &normals)?;
    folder.vectors("albedo", "1", &albedo)?;
    folder.floats("support_radius", "m", &supports)?;
    let columns =
        |part: fn(&LitPoints) -> &[Vec3]| lit.iter().map(|light| plain(part(light))).collect::<Vec<_>>();
    let count = finest.len();
    folder.vectors_of_several(
        "irradiance_direct",
        "W/m²",
        count,
        &columns(|light| &light.direct),
    )?;
    folder.vectors_of_several(
        "irradiance_indirect",
        "W/m²",
        count,
        &columns(|light| &light.indirect),
    )?;
    folder.vectors("radiance", "W/(m² sr)", &radiance)?;
    folder.ply(
        "points",
        &[
            (["x", "y", "z"], positions.column()),
            (["nx", "ny", "nz"], Column::Vectors(&normals)),
            (
                ["radiance_r", "radiance_g", "radiance_b"],
                Column::Vectors(&radiance),
            ),
        ],
    )?;
    Ok(Facts::PointCloud {
        lights: lit.into_iter().map(|light| light.name).collect(),
        frame: args.frame,
    })
}
