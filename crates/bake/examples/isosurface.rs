//! A radiosity solution on boxes, implicit surfaces and isosurfaces side by side, as in figure 6 of Lehtinen et
//! al. 2008: left all light, right the indirect light alone. Solver, basis and picture see the surfaces through
//! rays only.
//!
//! `cargo run --release -p relight-bake --example isosurface -- [OUT.png]`, in the repository root.

use glam::{Vec2, Vec3};
use rayon::prelude::*;
use relight_bake::points::candidates::Candidate;
use relight_bake::points::poisson::distribute;
use relight_bake::points::poisson::levels_of;
use relight_bake::radiosity::{RadiosityParams, from_point_light, solve};
use relight_bake::units::Units;
use relight_scene::camera::Camera;
use relight_scene::image::{FloatImage, contact_sheet, tone_mapped, write_png};
use relight_scene::light::LightKind;
use relight_scene::rays::Ray;
use relight_scene::sequence::read_sequence;
use relight_scene::surface::Surfaces;
use relight_scene::surface_scene::read_surface_scene;
use relight_transport::basis::Level;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Pixels of each of the two pictures, and rays through each along either axis.
const SIZE: (usize, usize) = (480, 384);
const SUBPIXELS: usize = 2;
/// Disk radius of the coarsest of four levels, metres: the finest has 2 cm, a tenth of the pot.
const COARSE_RADIUS: f32 = 0.16;
/// Below the default: the lamp stands near a wall, whose bright spot sets the scale for the dim rest.
const REFINE: f32 = 0.012;

fn main() -> Result<(), Box<dyn Error>> {
    let out = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "out/isosurface.png".into());
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
        &[camera.position],
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
        refine: REFINE,
        ..RadiosityParams::default()
    };
    let solution = solve(surfaces, &points, &direct, &params, |_, _| Ok(()))?;
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
    let indirect = &solution.irradiance[solution.irradiance.len() - level.len()..];
    let light = |place: &Candidate| from_point_light(surfaces, place, position, intensity);
    let pictures = pictures(surfaces, &camera, level, indirect, light);
    let both = contact_sheet(&pictures, 2)?;
    if let Some(folder) = Path::new(&out).parent() {
        std::fs::create_dir_all(folder)?;
    }
    write_png(Path::new(&out), &tone_mapped(&both, 0.5))?;
    println!("{out} in {:.1} s", start.elapsed().as_secs_f32());
    Ok(())
}

/// All light, and the indirect light alone.
fn pictures(
    surfaces: &dyn Surfaces,
    camera: &Camera,
    level: &Level,
    indirect: &[Vec3],
    light: impl Fn(&Candidate) -> Vec3 + Sync,
) -> [FloatImage; 2] {
    let (width, height) = SIZE;
    let size = Vec2::new(width as f32, height as f32);
    let radiance = |pixel: Vec2, row: &mut Vec<(u32, f32)>| {
        let direction = camera.direction(pixel, size);
        let ray = Ray {
            origin: camera.position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let Some(hit) = surfaces.closest_hit(&ray) else {
            return [Vec3::ZERO; 2];
        };
        let place = Candidate::at(surfaces, &hit);
        row.clear();
        level.functions_or_nearest_at(place.position, place.normal, row);
        let irradiance: Vec3 = row.iter().map(|&(j, w)| indirect[j as usize] * w).sum();
        let reflected = place.albedo / std::f32::consts::PI;
        [reflected * (irradiance + light(&place)), reflected * irradiance]
    };
    let pixels: Vec<[Vec3; 2]> = (0..width * height)
        .into_par_iter()
        .map_init(Vec::new, |row, i| {
            let mut sum = [Vec3::ZERO; 2];
            for sub in 0..SUBPIXELS * SUBPIXELS {
                let inside = Vec2::new((sub % SUBPIXELS) as f32, (sub / SUBPIXELS) as f32) + 0.5;
                let pixel = Vec2::new((i % width) as f32, (i / width) as f32) + inside / SUBPIXELS as f32;
                let [all, indirect] = radiance(pixel, row);
                sum = [sum[0] + all, sum[1] + indirect];
            }
            sum.map(|s| s / (SUBPIXELS * SUBPIXELS) as f32)
        })
        .collect();
    [0, 1].map(|layer| FloatImage {
        width,
        height,
        pixels: pixels.iter().map(|p| p[layer].to_array()).collect(),
    })
}
