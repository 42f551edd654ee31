//! The sky in patches, for daylight coefficients.
//!
//! Source: Tregenza 1987, "Subdivision of the sky hemisphere for luminance measurements", Lighting Research and Technology 19(1): 145
//! patches in rows of even height, and the zenith; Reinhart's finer ones cut each side of these in `subdivision` parts. Rows are 90°
//! / (7 · subdivision + ½) high, and the cap around the zenith has half of that as its radius. Patches are numbered as Radiance's
//! gendaymtx does without its ground: from the horizon up, in each row from north by east, the zenith last; north is −Z, east +X. The sun
//! goes to the four patches whose middles are nearest, by weights of 1 / (1.002 − cos), as in gendaymtx; its irradiance on what faces it is kept.
//!
//! **Deviations.** A patch has the mean of the sky over it, where gendaymtx takes the sky at its middle. Below the horizon there is
//! nothing, as in [`crate::sky`].

use crate::light::EnvironmentMap;
use crate::sky::{SKY_SIZE, SUN_HALF_ANGLE, SunSky};
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Patches of each row of the coarsest subdivision, from the horizon up.
const IN_ROW: [usize; 7] = [30, 30, 24, 24, 18, 12, 6];
/// The subdivisions that are in use: 145, 577 and 2305 patches.
const SUBDIVISIONS: [usize; 3] = [1, 2, 4];
/// Patches that share the sun's light, and how sharply they do: 1 / (this − cos).
const SUN_PATCHES: usize = 4;
const SUN_SHARPNESS: f64 = 1.002;

/// Patches of one height.
#[derive(Clone, Debug)]
struct Row {
    /// Number of its patches.
    count: usize,
    /// Sines of the altitudes at which it begins and ends.
    sines: [f64; 2],
}

/// A sky in patches that tile the upper hemisphere.
#[derive(Clone, Debug)]
pub struct SkyPatches {
    /// From the horizon up; the zenith is a row of one.
    rows: Vec<Row>,
    /// Unit, towards the middle of each patch: x east, y up, z south.
    middles: Vec<DVec3>,
}

impl SkyPatches {
    /// A sky of 145, 577 or 2305 patches; `None` for any other number.
    pub fn new(count: usize) -> Option<SkyPatches> {
        let per_patch: usize = IN_ROW.iter().sum();
        let subdivision = *SUBDIVISIONS.iter().find(|&s| per_patch * s * s + 1 == count)?;
        let height = PI / 2.0 / (IN_ROW.len() as f64 * subdivision as f64 + 0.5);
        let (mut rows, mut middles) = (Vec::new(), Vec::with_capacity(count));
        for i in 0..IN_ROW.len() * subdivision {
            let in_row = IN_ROW[i / subdivision] * subdivision;
            let (sin, cos) = (height * (i as f64 + 0.5)).sin_cos();
            middles.extend((0..in_row).map(|j| {
                let (east, north) = (TAU * j as f64 / in_row as f64).sin_cos();
                DVec3::new(east * cos, sin, -north * cos)
            }));
            rows.push(Row {
                count: in_row,
                sines: [i, i + 1].map(|edge| (height * edge as f64).sin()),
            });
        }
        rows.push(Row {
            count: 1,
            sines: [(height / 2.0).cos(), 1.0],
        });
        middles.push(DVec3::Y);
        Some(SkyPatches { rows, middles })
    }

    /// How many patches there are.
    pub fn len(&self) -> usize {
        self.middles.len()
    }

    /// Never.
    pub fn is_empty(&self) -> bool {
        self.middles.is_empty()
    }

    /// Unit vectors towards the middles of the patches, in order: x east, y up, z south.
    pub fn middles(&self) -> &[DVec3] {
        &self.middles
    }

    /// The patches' solid angles, sr, in order.
    pub fn solid_angles(&self) -> impl Iterator<Item = f64> {
        (self.rows.iter()).flat_map(|row| std::iter::repeat_n(row.solid_angle(), row.count))
    }

    /// Mean radiance of each patch under a sky and its sun, RGB, W/(m² sr).
    pub fn radiance(&self, of: &SunSky) -> Vec<Vec3> {
        let EnvironmentMap {
            width,
            height,
            pixels,
        } = &of.sky;
        let mut means = Vec::with_capacity(self.len());
        for row in &self.rows {
            let lines = row.lines(*height);
            let columns: Vec<DVec3> = (0..*width)
                .map(|x| {
                    let part = |&(y, share): &(usize, f64)| pixels[y * width + x].as_dvec3() * share;
                    lines.iter().map(part).sum()
                })
                .collect();
            means.extend((0..row.count).map(|patch| {
                let parts = row.columns(patch, *width);
                parts.iter().map(|&(x, share)| columns[x] * share).sum::<DVec3>()
            }));
        }
        let disc = TAU * 2.0 * (SUN_HALF_ANGLE / 2.0).sin().powi(2);
        self.add_sun(
            of.sun_direction.as_dvec3(),
            of.sun_radiance.as_dvec3() * disc,
            &mut means,
        );
        means.into_iter().map(DVec3::as_vec3).collect()
    }

    /// Adds a sun to the patches around it. `irradiance`: of what faces it, W/m².
    fn add_sun(&self, sun: DVec3, irradiance: DVec3, means: &mut [DVec3]) {
        if irradiance == DVec3::ZERO {
            return;
        }
        let mut near: Vec<(f64, usize, f64)> = (self.middles.iter().zip(self.solid_angles()).enumerate())
            .map(|(patch, (middle, solid_angle))| (middle.dot(sun), patch, solid_angle))
            .collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        near.truncate(SUN_PATCHES);
        let weight = |cos: f64| 1.0 / (SUN_SHARPNESS - cos);
        let sum: f64 = near.iter().map(|&(cos, ..)| weight(cos)).sum();
        for (cos, patch, solid_angle) in near {
            means[patch] += irradiance * (weight(cos) / sum / solid_angle);
        }
    }

    /// A map in which one patch shines with radiance 1 and all else is black: pixels have the share of them that the patch covers, so that
    /// the maps of all patches add up to an even sky. Black for a number that no patch has.
    pub fn map(&self, patch: usize) -> EnvironmentMap {
        let (width, height) = SKY_SIZE;
        let mut map = EnvironmentMap {
            width,
            height,
            pixels: vec![Vec3::ZERO; width * height],
        };
        let mut first = 0;
        for row in &self.rows {
            if let Some(patch) = patch.checked_sub(first).filter(|&patch| patch < row.count) {
                let pixels_wide = width as f64 / row.count as f64;
                for (y, share_y) in row.lines(height) {
                    let [low, high] = line(y, height);
                    let pixels_high = (row.sines[1] - row.sines[0]) / (high - low);
                    for (x, share_x) in row.columns(patch, width) {
                        let covered = share_x * pixels_wide * share_y * pixels_high;
                        map.pixels[y * width + x] += Vec3::splat(covered as f32);
                    }
                }
            }
            first += row.count;
        }
        map
    }
}

impl Row {
    /// Of one patch, sr.
    fn solid_angle(&self) -> f64 {
        TAU * (self.sines[1] - self.sines[0]) / self.count as f64
    }

    /// Lines of a map of so many that the row covers, and their shares of it.
    fn lines(&self, height: usize) -> Vec<(usize, f64)> {
        let [bottom, top] = self.sines;
        (0..height)
            .filter_map(|y| {
                let [low, high] = line(y, height);
                let covered = high.min(top) - low.max(bottom);
                (covered > 0.0).then(|| (y, covered / (top - bottom)))
            })
            .collect()
    }

    /// Columns of a map of so many that a patch covers, and their shares of it.
    fn columns(&self, patch: usize, width: usize) -> Vec<(usize, f64)> {
        let wide = width as f64 / self.count as f64;
        let (start, end) = ((patch as f64 - 0.5) * wide, (patch as f64 + 0.5) * wide);
        (start.floor() as i64..end.ceil() as i64)
            .filter_map(|x| {
                let covered = end.min(x as f64 + 1.0) - start.max(x as f64);
                (covered > 0.0).then(|| (x.rem_euclid(width as i64) as usize, covered / wide))
            })
            .collect()
    }
}

/// Sines of the altitudes at which a line of a map of so many begins and ends.
fn line(y: usize, height: usize) -> [f64; 2] {
    [y + 1, y].map(|edge| (PI * edge as f64 / height as f64).cos())
}

#[cfg(test)]
mod tests;
