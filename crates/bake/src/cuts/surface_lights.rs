//! Even samples of the surfaces, which send one bounce of light.
//!
//! Source: Cheslack-Postava et al. 2008, section 4.1 (indirect light from even samples of the surfaces); the geometry
//! factor A cos θ/(d² + A/π) is folded into their cuts.

use crate::points::candidates::Candidate;
use glam::{Vec2, Vec3};
use relight_format as format;
use relight_scene::rays::{self, Ray, SurfacePoint};
use relight_scene::traced::TracedScene;
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::grid::morton_order;
use relight_transport::random::Stream;
use relight_transport::sampling::r2;
use std::f32::consts::FRAC_1_PI;

/// Surface samples, parallel arrays.
#[derive(Clone, Debug, Default)]
pub struct SurfaceLights {
    /// What each stands for, m².
    pub area: f32,
    /// World space, as a reader of the file will see them.
    pub positions: Vec<Vec3>,
    /// Unit geometric normals on the side that sends, likewise.
    pub normals: Vec<Vec3>,
    /// Where shadow rays end: the exact places.
    ends: Vec<SurfacePoint>,
}

impl SurfaceLights {
    /// A cos θ/(d² + A/π): the share of the site's hemisphere times π that the sample fills, bounded by π where the site
    /// lies upon it. NaN below the site's horizon, 0 where the sample faces away.
    #[inline]
    pub fn factor(&self, site: &Candidate, light: usize) -> f32 {
        let to = self.positions[light] - site.position;
        if site.geometric_normal.dot(to) > 0.0 {
            let d2 = to.length_squared();
            let cosine = (-self.normals[light].dot(to)).max(0.0) / d2.sqrt();
            self.area * cosine / (d2 + self.area * FRAC_1_PI)
        } else {
            f32::NAN
        }
    }

    /// A ray from a site to a sample that meets neither's surface.
    pub fn ray(&self, site: &Candidate, light: usize) -> Ray {
        // Sites keep a start just above their surface, which needs no further clearance.
        let from = SurfacePoint {
            position: site.origin,
            normal: site.geometric_normal,
            clearance: 0.0,
        };
        rays::shadow_ray(&from, &self.ends[light])
    }

    /// The samples `by`.
    pub fn reordered(&self, by: &[u32]) -> SurfaceLights {
        let by = || by.iter().map(|&i| i as usize);
        SurfaceLights {
            area: self.area,
            positions: by().map(|i| self.positions[i]).collect(),
            normals: by().map(|i| self.normals[i]).collect(),
            ends: by().map(|i| self.ends[i]).collect(),
        }
    }

    fn new(area: f32, ends: Vec<SurfacePoint>) -> SurfaceLights {
        let exact = format::LightTree {
            lights: format::LightSamples::Surface {
                area,
                positions: ends.iter().map(|e| e.position.to_array()).collect(),
                normals: ends.iter().map(|e| e.normal.to_array()).collect(),
            },
        };
        match format::quantised_light_tree(&exact).lights {
            format::LightSamples::Surface {
                positions, normals, ..
            } => SurfaceLights {
                area,
                positions: positions.into_iter().map(Vec3::from).collect(),
                normals: normals.into_iter().map(Vec3::from).collect(),
                ends,
            },
            format::LightSamples::Environment { .. } => SurfaceLights::default(),
        }
    }
}

/// Stage numbers of the random streams.
const STAGE: u32 = 11;
const STAGE_TRIANGLES: u32 = 12;
/// Places that are looked for, for each that is wanted. Few are left over, since thinning makes holes.
const SPARE: f64 = 1.02;
/// Most places that are tried for each sample that is wanted: of a scene of which points cover less than a 64th, samples
/// come more than once.
const MOST_TRIES: usize = 64;

/// `count` samples, evenly by area, of the sides of surfaces that have points: only those light can carry to the viewer.
pub fn surface_lights(scene: &TracedScene, finest: &Level, count: usize, seed: u64) -> SurfaceLights {
    let strip = Strip::new(scene);
    let nearest = NearestPoint::new(finest);
    let mut tries = count;
    let mut found = strip.places(&nearest, tries, seed);
    let wanted = SPARE * count as f64;
    if (found.len() as f64) < wanted {
        let more = wanted / found.len().max(1) as f64;
        tries = ((tries as f64 * more).ceil() as usize).min(MOST_TRIES * count);
        found = strip.places(&nearest, tries, seed);
    }
    let mut reached = strip.total() * found.len() as f64 / tries as f64;
    if found.is_empty() {
        // Specks in a vast scene: their points stand for them. Disks of half the radius pack to 0.7 of a plane.
        reached =
            finest.len() as f64 * f64::from(finest.disk_radius).powi(2) * std::f64::consts::FRAC_PI_4 / 0.7;
        found = points(finest);
    }
    let ends = (0..count)
        .filter_map(|i| found.get((2 * i + 1) * found.len() / (2 * count)).copied())
        .collect();
    let area = (reached / count as f64) as f32;
    SurfaceLights::new(if area.is_normal() { area } else { f32::MIN_POSITIVE }, ends)
}

fn points(level: &Level) -> Vec<SurfacePoint> {
    (level.positions.iter().zip(&level.normals))
        .map(|(&position, &normal)| SurfacePoint {
            position,
            normal,
            clearance: level.disk_radius / 128.0,
        })
        .collect()
}

/// The `index`-th of evenly spread places in a triangle: a large one holds thousands, and random places would
/// leave lobes that see ten of them noise of a third.
fn in_triangle(index: u32, seed: u64, triangle: u32) -> [f32; 2] {
    let mut stream = Stream::new(seed, STAGE_TRIANGLES, u64::from(triangle));
    let even = r2(index, Vec2::new(stream.uniform(), stream.uniform()));
    let root = even.x.sqrt();
    let v = even.y * root;
    [root - v, v]
}

/// All triangles side by side along a space-filling curve: equal steps along it are even on the surfaces.
struct Strip<'a> {
    scene: &'a TracedScene,
    triangles: Vec<u32>,
    /// Area up to the end of each of `triangles`.
    sums: Vec<f64>,
}

impl<'a> Strip<'a> {
    fn new(scene: &'a TracedScene) -> Strip<'a> {
        let there: Vec<u32> = (0..scene.triangle_count() as u32)
            .filter(|&t| scene.triangle_area(t) > 0.0)
            .collect();
        let middles: Vec<Vec3> = (there.iter())
            .map(|&t| scene.triangle_positions(t).iter().sum::<Vec3>() / 3.0)
            .collect();
        let triangles: Vec<u32> = (morton_order(&middles).iter())
            .map(|&i| there[i as usize])
            .collect();
        let mut total = 0.0;
        let sums = (triangles.iter())
            .map(|&t| {
                total += f64::from(scene.triangle_area(t));
                total
            })
            .collect();
        Strip {
            scene,
            triangles,
            sums,
        }
    }

    fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// One place in each of `tries` equal parts, on each side that has a point near.
    fn places(&self, nearest: &NearestPoint, tries: usize, seed: u64) -> Vec<SurfacePoint> {
        let mut places = Vec::new();
        let (mut last, mut within) = (u32::MAX, 0);
        for i in 0..tries {
            let mut stream = Stream::new(seed, STAGE, i as u64);
            let at = (i as f64 + f64::from(stream.uniform())) / tries as f64 * self.total();
            let index = self.sums.partition_point(|sum| *sum <= at);
            let Some(&triangle) = self.triangles.get(index).or(self.triangles.last()) else {
                return places;
            };
            within = if triangle == last { within + 1 } else { 0 };
            last = triangle;
            let barycentric = in_triangle(within, seed, triangle);
            if self.scene.coverage(triangle, barycentric) <= stream.uniform() {
                continue;
            }
            for front in [true, false] {
                let hit = self.scene.surface_at(triangle, barycentric, front);
                // The nearest point may be one of another side, where there is none of this.
                let reached = (nearest.at(hit.position, hit.normal))
                    .is_some_and(|p| nearest.level.normals[p as usize].dot(hit.normal) > 0.0);
                if reached && hit.position.is_finite() {
                    places.push(SurfacePoint {
                        position: hit.position,
                        normal: hit.geometric_normal,
                        clearance: hit.position_error.max_element(),
                    });
                }
            }
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_scene::gltf::{ImportOptions, import};
    use relight_scene::traced::Shading;
    use std::path::Path;
    use std::sync::Arc;

    fn cornell() -> TracedScene {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/cornell.glb");
        let scene = import(&file, &ImportOptions::default()).unwrap();
        TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap()
    }

    /// Points on the fronts of all triangles, 1 cm apart or so.
    fn points_of(scene: &TracedScene, keep: impl Fn(Vec3) -> bool) -> Level {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for triangle in 0..scene.triangle_count() as u32 {
            for i in 0..(scene.triangle_area(triangle) / 1e-4) as u32 {
                let hit = scene.surface_at(triangle, in_triangle(i, 1, triangle), true);
                if keep(hit.position) {
                    positions.push(hit.position);
                    normals.push(hit.normal);
                }
            }
        }
        Level::new(positions, normals, 0.02, 0.04)
    }

    /// Truth: the triangles' areas.
    #[test]
    fn samples_are_even_and_stand_for_the_sides_that_have_points() {
        let scene = cornell();
        let area: f64 = (0..scene.triangle_count() as u32)
            .map(|t| f64::from(scene.triangle_area(t)))
            .sum();
        let level = points_of(&scene, |_| true);
        let samples = surface_lights(&scene, &level, 1 << 14, 0);
        assert_eq!(samples.positions.len(), 1 << 14);
        let found = f64::from(samples.area) * f64::from(1 << 14);
        assert!((found / area - 1.0).abs() < 0.01, "{found} {area}");
        // The nearest neighbour of n random places is 0.5/√density away on average, that of a lattice up to 1.07.
        let mean = (samples.positions.iter().step_by(64))
            .map(|p| {
                let other = samples.positions.iter().filter(|q| *q != p);
                other.map(|q| q.distance(*p)).fold(f32::INFINITY, f32::min)
            })
            .sum::<f32>()
            / 256.0;
        assert!(mean / samples.area.sqrt() > 0.6, "{}", mean / samples.area.sqrt());
        for (p, n) in samples.positions.iter().zip(&samples.normals) {
            assert!(p.is_finite() && (n.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn few_places_and_none_still_give_all_samples() {
        let scene = cornell();
        let low = points_of(&scene, |p| p.y < 0.005);
        let samples = surface_lights(&scene, &low, 1024, 0);
        assert_eq!(samples.positions.len(), 1024);
        assert!(samples.positions.iter().all(|p| p.y < 0.05));
        let far = Level::new(vec![Vec3::splat(50.0)], vec![Vec3::Y], 0.02, 0.04);
        let samples = surface_lights(&scene, &far, 256, 0);
        assert_eq!(samples.positions.len(), 256);
        assert!(samples.area > 0.0);
    }

    /// Truth: the solid angle of a square seen from above its middle, π for a whole hemisphere of them.
    #[test]
    fn factors_are_those_of_form_factors() {
        let n = 64;
        let ends = (0..n * n)
            .map(|i| SurfacePoint {
                position: Vec3::new((i % n) as f32 + 0.5, 0.0, (i / n) as f32 + 0.5) / n as f32,
                normal: Vec3::Y,
                clearance: 1e-6,
            })
            .collect();
        let samples = SurfaceLights::new(1.0 / (n * n) as f32, ends);
        let site = |height: f32, up: f32| Candidate {
            position: Vec3::new(0.5, height, 0.5),
            normal: Vec3::Y * up,
            geometric_normal: Vec3::Y * up,
            origin: Vec3::new(0.5, height, 0.5),
            albedo: Vec3::ONE,
            widening: 0,
            inherited: false,
        };
        let sum = |site: &Candidate| (0..n * n).map(|i| samples.factor(site, i)).sum::<f32>();
        // A cube's face from its middle is a sixth of the sphere.
        let sixth = 4.0 * std::f32::consts::PI / 6.0;
        assert!((sum(&site(0.5, -1.0)) / sixth - 1.0).abs() < 1e-2);
        assert!(sum(&site(0.5, 1.0)).is_nan());
        assert_eq!(sum(&site(-0.5, 1.0)), 0.0);
        assert!(samples.factor(&site(1e-4, -1.0), 0).is_finite());
    }
}
