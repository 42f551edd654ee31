//! `relight inspect --images`: pictures of the levels.
//!
//! As figure 3 of Lehtinen et al. 2008: every surface place in the colour of the level's point that weighs most
//! there, the points themselves as dark dots; black is where no function of the level reaches.

use crate::failure::Failure;
use crate::output;
use crate::signals;
use anyhow::anyhow;
use glam::Vec3;
use rayon::prelude::*;
use relight_format::Asset;
use relight_play::{Player, Tracer};
use relight_render::expose::expose;
use relight_scene::image::{FloatImage, preview::display_encoded, write_png};
use relight_transport::basis::Level;
use relight_transport::random::mix;
use std::path::{Path, PathBuf};

/// Height of the pictures, and primary rays per pixel.
const HEIGHT: usize = 540;
const RAYS: u32 = 4;
/// Radius of a point's dot in disk radii: dots of neighbours stay well apart.
const DOT: f32 = 0.12;
/// Brightness of surfaces that are seen edge-on, so that shapes show.
const EDGE: f32 = 0.35;

/// The picture of each level, as `level_N.png`.
pub fn files(folder: &Path, levels: usize) -> Vec<PathBuf> {
    (0..levels)
        .map(|number| folder.join(format!("level_{number}.png")))
        .collect()
}

/// Draws every level from the scene's first camera into [`files`].
pub fn draw(path: &Path, asset: &Asset, folder: &Path) -> Result<(), Failure> {
    let player = Player::open_for(path, &Tracer::default().into())?;
    let camera = player.scene().cameras.first().ok_or_else(|| {
        anyhow!(
            "{}: the scene has no camera to draw the levels from",
            path.display()
        )
    })?;
    output::make_folder(folder)?;
    let aspect = camera
        .aspect
        .filter(|a| a.is_finite() && *a > 0.0)
        .unwrap_or(16.0 / 9.0);
    let width = ((HEIGHT as f32 * aspect).round() as usize).clamp(1, 16 * HEIGHT);
    let seen = expose(&player.prepared.scene, &camera.at(0.0), width, HEIGHT, RAYS);
    for (file, level) in files(folder, asset.points.len()).iter().zip(&asset.points) {
        signals::go_on()?;
        let vectors = |values: &[[f32; 3]]| values.iter().copied().map(Vec3::from).collect::<Vec<_>>();
        let basis = Level::widened(
            vectors(&level.positions),
            vectors(&level.normals),
            level.widenings.clone(),
            level.disk_radius,
            level.support_radius,
        );
        let colors: Vec<Vec3> = (0..seen.len())
            .into_par_iter()
            .map(|f| {
                let Some(hit) = &seen.hits[f] else {
                    return Vec3::ONE;
                };
                let facing = EDGE + (1.0 - EDGE) * hit.normal.dot(seen.directions[f]).abs();
                strongest(&basis, hit.position, hit.normal).map_or(Vec3::ZERO, |point| {
                    let distance = basis.positions[point as usize].distance(hit.position);
                    let dot = if distance < DOT * basis.disk_radius_of(point as usize) {
                        0.15
                    } else {
                        1.0
                    };
                    color(point) * facing * dot
                })
            })
            .collect();
        let pixels = seen.resolve(&colors).iter().map(Vec3::to_array).collect();
        let _whole = signals::whole();
        write_png(
            file,
            &display_encoded(&FloatImage {
                width,
                height: HEIGHT,
                pixels,
            }),
        )?;
    }
    Ok(())
}

fn strongest(level: &Level, position: Vec3, normal: Vec3) -> Option<u32> {
    let mut best = None;
    let mut most = 0.0;
    level.weights_at(position, normal, |point, weight| {
        if weight > most {
            (most, best) = (weight, Some(point));
        }
    });
    best
}

/// A colour of its own for every point, none of them dark.
fn color(point: u32) -> Vec3 {
    let bits = mix(u64::from(point) + 1);
    let part = |shift: u32| 0.15 + 0.85 * f32::from((bits >> shift) as u8) / 255.0;
    Vec3::new(part(0), part(8), part(16))
}
