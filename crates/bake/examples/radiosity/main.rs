//! A radiosity solution on boxes, implicit surfaces and isosurfaces side by side, as in figure 6 of Lehtinen et
//! al. 2008. Solver, basis and picture see the surfaces through rays only; no triangle is made of them.
//!
//! Above all light and the indirect light alone; below the indirect light on the same surfaces if they were glossy, from
//! radiance in the basis times spherical harmonics, and white where the solver cast rays on the finest level.
//!
//! `cargo run -p relight-bake --example radiosity -- [OUT.png]`, in the repository root: docs/images/radiosity.jpg.

mod incident;
mod point_light;
mod solver;
mod tensor;
#[cfg(test)]
#[path = "../../src/test_scenes.rs"]
mod test_scenes;
#[cfg(test)]
mod tests;

use glam::{Vec2, Vec3};
use incident::{Rgb, incident_radiance, lobe};
use point_light::from_point_light;
use rayon::prelude::*;
use relight_bake::points::candidates::Candidate;
use relight_bake::points::openness::Openness;
use relight_bake::points::poisson::{distribute, levels_of};
use relight_bake::points::relevance::Relevance;
use relight_bake::units::Units;
use relight_scene::camera::Camera;
use relight_scene::image::{FloatImage, contact_sheet, tone_mapped, write_png};
use relight_scene::light::LightKind;
use relight_scene::rays::Ray;
use relight_scene::sequence::read_sequence;
use relight_scene::surface::Surfaces;
use relight_scene::surface_scene::read_surface_scene;
use relight_transport::basis::Level;
use relight_transport::sh::Coefficients;
use solver::{RadiosityParams, solve};
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Pixels of each of the four pictures, and rays through each along either axis.
const SIZE: (usize, usize) = (200, 150);
const SUBPIXELS: usize = 3;
/// Exponent of the glossy lobe: about as narrow as harmonics of degree 3 can show.
const EXPONENT: f32 = 8.0;
/// Disk radius of the coarsest of four levels, metres: the finest has 3 cm, a seventh of the pot.
const COARSE_RADIUS: f32 = 0.24;
/// Below the default: the lamp stands near a wall, whose bright spot sets the scale for the dim rest.
const REFINE: f32 = 0.012;

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "out/radiosity.png".into());
    let scene = read_surface_scene(Path::new("data/isosurface.scene.json"))?;
    let camera = scene.camera.at(0.0);
    let lights = read_sequence(Path::new("data/isosurface.lights.json"))?;
    let Some(LightKind::Point { position, intensity }) = lights.lights.first().map(|l| &l.kind) else {
        return Err("data/isosurface.lights.json: the first light must be a point light".into());
    };
    let (position, intensity) = (position.at(0.0), intensity.at(0.0));
    let surfaces = &scene.surfaces;

    let start = Instant::now();
    let points = distribute(
        surfaces,
        &Relevance::even(&[camera.position]),
        Openness::none(),
        4,
        COARSE_RADIUS,
        0,
        Units::none(),
        |_| Ok(()),
    )?;
    let counts: Vec<usize> = points.levels.iter().map(|l| l.points.len()).collect();
    println!("points {counts:?} in {:.1} s", start.elapsed().as_secs_f32());

    let start = Instant::now();
    let finest = &points.levels[points.levels.len() - 1].points;
    let direct: Vec<Vec3> = finest
        .par_iter()
        .map(|p| from_point_light(surfaces, p, position, intensity))
        .collect();
    let params = RadiosityParams {
        rays: 256,
        refine: REFINE,
        ..RadiosityParams::default()
    };
    let solution = solve(surfaces, &points, &direct, &params)?;
    println!(
        "{} bounces, gathered at {:?}, {} rays ({} lost), rest of the series below {:.2} %, in {:.1} s",
        solution.bounces,
        solution.gathered,
        solution.rays,
        solution.lost,
        100.0 * solution.remainder,
        start.elapsed().as_secs_f32()
    );

    let start = Instant::now();
    let levels = levels_of(&points);
    let level = &levels[levels.len() - 1];
    let coarser = solution.irradiance.len() - level.len();
    let solved = Solved {
        level,
        irradiance: &solution.irradiance[coarser..],
        radiance: incident_radiance(&points, &solution, &direct),
        gathered: solution.hits[coarser..]
            .iter()
            .map(|hits| !hits.is_empty())
            .collect(),
    };
    let light = |place: &Candidate| from_point_light(surfaces, place, position, intensity);
    let pictures = pictures(surfaces, &camera, &solved, light);
    let sheet = contact_sheet(&pictures, 2)?;
    if let Some(folder) = Path::new(&out).parent() {
        std::fs::create_dir_all(folder)?;
    }
    write_png(Path::new(&out), &tone_mapped(&sheet, 0.5))?;
    println!("{out} in {:.1} s", start.elapsed().as_secs_f32());
    Ok(())
}

/// What the pictures show, at the points of the finest level.
struct Solved<'a> {
    level: &'a Level,
    /// Indirect irradiance.
    irradiance: &'a [Vec3],
    /// Incident radiance off surfaces.
    radiance: Rgb<Vec<Coefficients>>,
    /// Whether the solver cast rays there.
    gathered: Vec<bool>,
}

/// All light, the indirect light alone, the same on glossy surfaces, and where rays were cast.
fn pictures(
    surfaces: &dyn Surfaces,
    camera: &Camera,
    solved: &Solved,
    light: impl Fn(&Candidate) -> Vec3 + Sync,
) -> [FloatImage; 4] {
    let (width, height) = SIZE;
    let size = Vec2::new(width as f32, height as f32);
    let shown = |pixel: Vec2, row: &mut Vec<(u32, f32)>| {
        let direction = camera.direction(pixel, size);
        let ray = Ray {
            origin: camera.position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let Some(hit) = surfaces.closest_hit(&ray) else {
            return [Vec3::ZERO; 4];
        };
        let place = Candidate::at(surfaces, &hit, 0);
        let (x, normal) = (place.position, place.normal);
        let mirror = direction.normalize().reflect(normal);
        let glossy = solved.radiance.each_ref().map(|values| {
            let there = tensor::at(solved.level, values, x, normal, row);
            // Harmonics of degree 3 undershoot beside bright spots.
            lobe(&there, mirror, EXPONENT).max(0.0)
        });
        row.clear();
        solved.level.functions_or_nearest_at(x, normal, row);
        let irradiance: Vec3 = row.iter().map(|&(j, w)| solved.irradiance[j as usize] * w).sum();
        let cast = row.iter().filter(|(j, _)| solved.gathered[*j as usize]);
        let reflected = place.albedo / std::f32::consts::PI;
        [
            reflected * (irradiance + light(&place)),
            reflected * irradiance,
            place.albedo * Vec3::from(glossy),
            Vec3::splat(cast.map(|(_, w)| w).sum()),
        ]
    };
    let pixels: Vec<[Vec3; 4]> = (0..width * height)
        .into_par_iter()
        .map_init(Vec::new, |row, i| {
            let mut sum = [Vec3::ZERO; 4];
            for sub in 0..SUBPIXELS * SUBPIXELS {
                let inside = Vec2::new((sub % SUBPIXELS) as f32, (sub / SUBPIXELS) as f32) + 0.5;
                let pixel = Vec2::new((i % width) as f32, (i / width) as f32) + inside / SUBPIXELS as f32;
                for (sum, value) in sum.iter_mut().zip(shown(pixel, row)) {
                    *sum += value / (SUBPIXELS * SUBPIXELS) as f32;
                }
            }
            sum
        })
        .collect();
    [0, 1, 2, 3].map(|layer| FloatImage {
        width,
        height,
        pixels: pixels.iter().map(|p| p[layer].to_array()).collect(),
    })
}
