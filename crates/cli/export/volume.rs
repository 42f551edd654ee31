//! Irradiance volumes: a grid of places with the light that arrives at each.

use super::args::{ExportArgs, Grid};
use super::files::Folder;
use super::ktx2;
use super::lit::Stage;
use super::report::Facts;
use crate::console::Console;
use crate::failure::Failure;
use crate::signals::{self, Signals};
use glam::{DVec3, Vec3};
use relight_play::frame::probes::{Incident, incident};
use relight_play::player::FrameError;
use std::f32::consts::FRAC_1_PI;

/// Places along the longest side, if nobody says how many.
const LONGEST: f32 = 16.0;
/// Least extent of the box along any axis, as a share of its longest side: places over a plain floor are to have somewhere to be.
const FLATTEST: f32 = 0.25;

/// Bounds of the finest points, metres.
fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    points
        .iter()
        .fold(start, |(low, high), p| (low.min(*p), high.max(*p)))
}

/// The light of the grid's places, x fastest, then y, then z.
pub fn write(args: &ExportArgs, seed: u64, folder: &mut Folder, console: &Console) -> Result<Facts, Failure> {
    let stage = Stage::read(args, seed, console)?;
    let (low, high) = bounds(&stage.transfer()?.finest.positions);
    let longest = (high - low).max_element();
    if !(longest > 0.0 && longest.is_finite()) {
        return Err(Failure::Usage(format!(
            "{}: all of its points are at one place: there is no box for a grid of places",
            args.asset.display()
        )));
    }
    let wider = 0.5 * (Vec3::splat(FLATTEST * longest) - (high - low)).max(Vec3::ZERO);
    let (low, high) = (low - wider, high + wider);
    let size = high - low;
    let grid = args.grid.unwrap_or_else(|| {
        (size / longest * LONGEST)
            .round()
            .max(Vec3::splat(2.0))
            .to_array()
            .map(|n| n as u32)
    });
    let [nx, ny, nz] = grid;
    let cell = size / Vec3::new(nx as f32, ny as f32, nz as f32);
    let places: Vec<Vec3> = (0..nz)
        .flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
        .map(|at| low + cell * (Vec3::from_array(at.map(|n| n as f32)) + 0.5))
        .collect();
    console.begin("Lighting places", Some(places.len() as u64));
    let lit = incident(
        &stage.player,
        &stage.lights,
        args.frame.into(),
        &places,
        &stage.settings,
        &Signals,
    )
    .map_err(|error| match error {
        FrameError::Cancelled(_) => signals::failure(),
        other => other.into(),
    })?;
    let [x, y, z] = grid.map(|n| n as usize);
    let coefficients: Vec<f32> = lit
        .iter()
        .flat_map(|i| i.radiance)
        .flat_map(|c| c.to_array())
        .collect();
    folder.array(
        "sh",
        "W/(m² sr)",
        &[z, y, x, lit.first().map_or(0, |i| i.radiance.len()), 3],
        &coefficients,
    )?;
    let open: Vec<f32> = lit.iter().map(|i| i.open).collect();
    folder.array("open", "1", &[z, y, x], &open)?;
    let atlas = ambient_cubes(grid, &lit);
    folder.array(
        "ambient_cubes",
        "W/(m² sr)",
        &[3 * z, 2 * y, x, 3],
        atlas.as_flattened(),
    )?;
    let texture = ktx2::texture([nx, 2 * ny, 3 * nz], &atlas);
    folder.texture("ambient_cubes.ktx2", &[3 * z, 2 * y, x, 4], "W/(m² sr)", &texture)?;
    let offset: DVec3 = stage.player.scene().offset;
    let place = |v: Vec3| (v.as_dvec3() + offset).to_array();
    Ok(Facts::IrradianceVolume {
        low: place(low),
        high: place(high),
        grid,
        frame: args.frame,
    })
}

/// The six faces of each place's cube, as Bevy has them: irradiance over π of a surface that faces the axis; x, y and z one after the other
/// along the third axis, below zero behind above zero along the second.
fn ambient_cubes([nx, ny, nz]: Grid, lit: &[Incident]) -> Vec<[f32; 3]> {
    let mut atlas = Vec::with_capacity(6 * lit.len());
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for z in 0..nz {
            for normal in [axis, -axis] {
                for y in 0..ny {
                    for x in 0..nx {
                        let place = ((z * ny + y) * nx + x) as usize;
                        let light = lit[place].irradiance(normal) * FRAC_1_PI;
                        // Nine coefficients of a sharp light go below zero on its far side.
                        atlas.push(light.max(Vec3::ZERO).to_array());
                    }
                }
            }
        }
    }
    atlas
}
