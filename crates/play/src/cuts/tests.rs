//! Truth: the dense sum over all lights in f64, with visibility interpolated between the sites.

use super::illumination::Illumination;
use super::position_tree::PositionTree;
use super::shade::{Fragments, irradiance_at_sites, shade};
use super::sites::{FragmentSites, SITES};
use super::*;
use crate::test_scenes::{camera, level, matt, quad, traced};
use glam::{DVec3, Vec3};
use relight_render::expose::expose;
use relight_render::exposure::Exposure;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use relight_scene::surface::SurfaceHit;
use relight_scene::traced::TracedScene;
use relight_transport::cuts::{Selector, SiteCuts};
use relight_transport::light_tree::{Features, order, sphere_direction};
use relight_transport::random::Stream;

pub(super) const LIGHTS: u32 = 1024;
const SITE_COUNT: usize = 9;

pub(super) struct World {
    /// Directions, or places in a box around the fragments' place.
    pub(super) lights: Vec<Vec3>,
    pub(super) near: bool,
    /// Per site what it sees of each leaf.
    pub(super) seen: Vec<Vec<f32>>,
    pub(super) flux: Vec<Vec3>,
}

pub(super) fn world() -> World {
    let lattice: Vec<Vec3> = (0..LIGHTS).map(|i| sphere_direction(i, LIGHTS)).collect();
    let features = Features {
        positions: &lattice,
        normals: &lattice,
        visibility: &[],
        pilots: 0,
    };
    let directions: Vec<Vec3> = order(&features, 1.0)
        .iter()
        .map(|&i| lattice[i as usize])
        .collect();
    let mut s = Stream::new(1, 0, 0);
    let mut unit =
        || Vec3::new(s.uniform() - 0.5, s.uniform() - 0.5, s.uniform() - 0.5).normalize_or(Vec3::X);
    // Each site sees past two balls.
    let seen = (0..SITE_COUNT)
        .map(|_| {
            let (a, b) = (unit(), unit());
            let dark = |d: &Vec3| d.dot(a) > 0.8 || d.dot(b) > 0.9;
            directions
                .iter()
                .map(|d| if dark(d) { 0.0 } else { 1.0 })
                .collect()
        })
        .collect();
    // A smooth sky, a window and some noise.
    let window = unit();
    let mut noise = Stream::new(2, 0, 0);
    let flux = directions
        .iter()
        .map(|d| {
            let bright = if d.dot(window) > 0.95 {
                20.0
            } else {
                0.3 + 0.2 * d.y
            };
            Vec3::new(1.0, 0.8, 0.5) * (bright * (0.9 + 0.2 * noise.uniform()) / LIGHTS as f32)
        })
        .collect();
    World {
        lights: directions,
        near: false,
        seen,
        flux,
    }
}

/// The same lights as surface samples, from a tenth of a metre to some metres away.
fn near_world() -> World {
    let mut world = world();
    let mut s = Stream::new(5, 0, 0);
    for light in &mut world.lights {
        let far = s.uniform();
        *light = FROM + *light * (0.1 + 4.0 * far * far);
    }
    World { near: true, ..world }
}

/// Where all fragments are.
const FROM: Vec3 = Vec3::new(1.0, -2.0, 3.0);

/// Cuts of sites that see so much of each leaf.
fn site_cuts(seen: &[Vec<f32>], sigma: f32) -> SiteCuts {
    let (mut cuts, mut selector) = (SiteCuts::default(), Selector::default());
    cuts.offsets.push(0);
    for seen in seen {
        selector.select(seen, sigma, usize::MAX, &mut cuts.heights, &mut cuts.values);
        cuts.offsets.push(cuts.heights.len() as u32);
    }
    cuts
}

pub(super) fn cuts(world: &World, sigma: f32) -> VisibilityCuts {
    let cuts = site_cuts(&world.seen, sigma);
    if !world.near {
        return VisibilityCuts::of_directions(cuts, &world.lights);
    }
    let samples = SurfaceSamples {
        tree: PositionTree::new(&world.lights, 1e-6),
        hits: Vec::new(),
        albedo: Vec::new(),
        unit: 1.0,
    };
    VisibilityCuts {
        cuts,
        lights: CutLights::Surface(samples),
    }
}

/// Fragments of all kinds between random sites, some of which repeat.
pub(super) fn fragments() -> (FragmentSites, Vec<Option<ShadingPoint>>, Vec<Vec3>) {
    let mut s = Stream::new(3, 0, 0);
    let (mut sites, mut points, mut views) = (FragmentSites::default(), Vec::new(), Vec::new());
    for i in 0..200u32 {
        let normal = Vec3::new(s.uniform() - 0.5, s.uniform() - 0.5, s.uniform() - 0.5).normalize_or(Vec3::Y);
        let hit = SurfaceHit {
            t: 1.0,
            position: FROM,
            position_error: Vec3::ZERO,
            geometric_normal: normal,
            normal,
            front: true,
            primitive: 0,
            barycentric: [0.0; 2],
        };
        let matt = ShadingPoint::lambert(&hit, Vec3::new(0.7, 0.5, 0.3));
        let glossy = ShadingPoint {
            lambert: false,
            f0: Vec3::splat(0.04 + 0.9 * s.uniform()),
            alpha: 0.08 + 0.5 * s.uniform(),
            ..matt
        };
        points.push(Some(if i % 2 == 0 { matt } else { glossy }));
        let tilt = Vec3::new(s.uniform(), s.uniform(), s.uniform());
        views.push((normal + 0.7 * tilt).normalize());
        let first = i / 4 % 5;
        let count = 1 + (i % SITES as u32);
        let mut chosen = [u32::MAX; SITES];
        let mut weights = [0.0; SITES];
        for k in 0..count {
            chosen[k as usize] = first + k;
            weights[k as usize] = 1.0 / count as f32;
        }
        sites.order.push(i);
        sites.sites.push(chosen);
        sites.weights.push(weights);
    }
    (sites, points, views)
}

pub(super) fn dense(
    world: &World,
    sites: &FragmentSites,
    points: &[Option<ShadingPoint>],
    views: &[Vec3],
) -> Vec<DVec3> {
    (0..points.len())
        .map(|i| {
            let point = points[i].unwrap();
            let mut sum = DVec3::ZERO;
            for (leaf, &light) in world.lights.iter().enumerate() {
                let d = if world.near {
                    (light - FROM).normalize()
                } else {
                    light
                };
                let seen: f64 = (sites.sites[i].iter().zip(&sites.weights[i]))
                    .filter(|(site, _)| **site != u32::MAX)
                    .map(|(&site, &w)| f64::from(w) * f64::from(world.seen[site as usize][leaf]))
                    .sum();
                let cosine = f64::from(point.shading_normal.dot(d).max(0.0));
                let f = bsdf::eval(&point, views[i], d).as_dvec3();
                sum += f * world.flux[leaf].as_dvec3() * (cosine * seen);
            }
            sum
        })
        .collect()
}

/// Relative errors of all fragments: the largest, and the root of their mean square.
fn errors(world: &World, sigma: f32, most: usize) -> (f64, f64) {
    let cuts = cuts(world, sigma);
    let light = match cuts.directions() {
        Some(directions) => Illumination::of_directions(directions, &world.flux, most),
        None => Illumination::of_samples(&world.flux, most),
    };
    let (sites, points, views) = fragments();
    let fragments = Fragments {
        sites: &sites,
        points: &points,
        views: &views,
        narrow: &[],
        matt: true,
    };
    let found = shade(&cuts, &light, &fragments).radiance;
    let truth = dense(world, &sites, &points, &views);
    let mean = truth.iter().map(|t| t.max_element()).sum::<f64>() / truth.len() as f64;
    let errors = (found.iter().zip(&truth))
        .map(|(f, t)| (f.as_dvec3() - *t).abs().max_element() / t.max_element().max(0.05 * mean));
    let squares = errors.clone().map(|e| e * e).sum::<f64>();
    (errors.fold(0.0, f64::max), (squares / truth.len() as f64).sqrt())
}

#[test]
fn cuts_of_all_leaves_give_the_dense_sum() {
    // f32 sums of a thousand terms.
    for world in [world(), near_world()] {
        let (largest, _) = errors(&world, 0.0, LIGHTS as usize);
        assert!(largest < 1e-4, "{largest}");
    }
}

#[test]
fn shorter_cuts_are_nearly_as_good() {
    // σ grows with the root of the number of lights: 2 for 32 768 is 0.35 for 1024.
    let world = world();
    let (largest, typical) = errors(&world, 0.35, 128);
    assert!(typical < 0.03 && largest < 0.15, "{typical} {largest}");
    assert!(typical > 1e-4, "nothing was approximated");
}

/// Truth: the sum over all leaves, none of which is hidden or below the horizon. Tolerance: f32 sums of 32 nodes.
#[test]
fn matt_surfaces_under_an_open_sky_reflect_just_what_it_sends_however_coarse_the_cut() {
    let mut world = world();
    let normal = Vec3::Y;
    for (flux, light) in world.flux.iter_mut().zip(&world.lights) {
        *flux = if light.y > 0.4 {
            Vec3::splat(flux.x)
        } else {
            Vec3::ZERO
        };
    }
    world.seen = vec![vec![1.0; LIGHTS as usize]];
    let cuts = cuts(&world, 0.35);
    let light = Illumination::of_directions(cuts.directions().unwrap(), &world.flux, 1);
    let found = irradiance_at_sites(&cuts, &light, &[Vec3::ZERO], &[normal])[0].x;
    let leaves = world.lights.iter().zip(&world.flux);
    let truth: f64 = leaves.map(|(d, flux)| f64::from(d.dot(normal) * flux.x)).sum();
    assert!((f64::from(found) / truth - 1.0).abs() < 1e-5, "{found} {truth}");
}

#[test]
fn nodes_of_near_lights_are_split_where_they_are_wide() {
    // The random distances of this world put the leaves of a node anywhere along its line of sight, not elsewhere.
    let world = near_world();
    let (largest, typical) = errors(&world, 0.35, 128);
    assert!(typical < 0.04 && largest < 0.2, "{typical} {largest}");
    assert!(typical > 1e-4, "nothing was approximated");
}

#[test]
fn the_flux_of_all_cells_is_that_of_the_sphere() {
    let world = world();
    let cells = cells::Cells::new(&world.lights);
    let flux = cells.flux(&cells.parts(|d| Vec3::new(1.0, 1.0 + d.y, 2.0)));
    let total: DVec3 = flux.iter().map(|f| f.as_dvec3()).sum();
    let expected = DVec3::new(1.0, 1.0, 2.0) * 4.0 * std::f64::consts::PI;
    // Rows of equal latitude are integrated exactly but for y within a row: 1/90² of 1.
    assert!(
        (total - expected).abs().max_element() < 1e-3,
        "{total} {expected}"
    );
    // Cells of even directions differ by some per cent.
    let mean = expected.x / f64::from(LIGHTS);
    assert!(flux.iter().all(|f| (f64::from(f.x) / mean - 1.0).abs() < 0.25));
}

#[test]
fn an_illumination_cut_is_a_cut_of_the_size_asked_for() {
    let world = world();
    let height = LIGHTS.ilog2() as u8;
    for most in [1, 32, 100, 256, 1024, 5000] {
        let light = Illumination::of_samples(&world.flux, most);
        assert!(relight_transport::cuts::is_cut(&light.heights, height));
        // 32 nodes are the fewest.
        assert_eq!(light.heights.len(), most.clamp(32, 1024));
    }
}

/// Half a roof at height 1 over a floor that reflects half, from its edge at x = 0 to x = −100, and sites at x = ±2 with
/// exact cuts.
pub(super) struct HalfRoof {
    pub(super) scene: TracedScene,
    pub(super) seen: Exposure,
    pub(super) sites: FragmentSites,
    pub(super) cuts: VisibilityCuts,
    views: Vec<Vec3>,
}

impl HalfRoof {
    /// `own`: where the sites disagree fragments look for themselves.
    pub(super) fn new(own: bool) -> HalfRoof {
        let corner = |x: f32, z: f32| Vec3::new(x, 1.0, z);
        let roof = quad(
            [
                corner(-100.0, 100.0),
                corner(0.0, 100.0),
                corner(0.0, -100.0),
                corner(-100.0, -100.0),
            ],
            0,
        );
        let scene = traced(vec![level(100.0, 0.0, 0), roof], vec![matt(0.5, 0.0)]);
        let camera = camera(Vec3::new(0.0, 0.8, 2.0), Vec3::ZERO, 40.0);
        let seen = expose(&scene, &camera, 16, 16, 1);
        let directions = world().lights;
        let leaves = [-2.0, 2.0].map(|x| {
            let sees = |d: &Vec3| match d.y {
                ..=0.0 => f32::NAN,
                y if x + d.x / y < 0.0 => 0.0,
                _ => 1.0,
            };
            directions.iter().map(sees).collect()
        });
        let cuts = VisibilityCuts::of_directions(site_cuts(&leaves, 0.0), &directions);
        let mut sites = FragmentSites::default();
        for f in 0..seen.len() as u32 {
            let Some(hit) = seen.hits[f as usize] else {
                continue;
            };
            let right = (0.25 * hit.position.x + 0.5).clamp(0.0, 1.0);
            sites.order.push(f);
            sites.sites.push([0, 1, u32::MAX]);
            sites.weights.push([1.0 - right, right, 0.0]);
        }
        if own {
            sites = own_sites::with_own(&cuts, &scene, &seen, sites);
        }
        let views = seen.views();
        HalfRoof {
            scene,
            seen,
            sites,
            cuts,
            views,
        }
    }

    pub(super) fn fragments(&self) -> Fragments<'_> {
        Fragments {
            sites: &self.sites,
            points: &self.seen.points,
            views: &self.views,
            narrow: &[],
            matt: true,
        }
    }

    /// Where each fragment between the sites is (x), and its irradiance over π.
    pub(super) fn between_the_sites(&self, radiance: &[Vec3]) -> Vec<(f32, f32)> {
        (self.sites.order.iter())
            .filter_map(|&f| {
                let x = self.seen.hits[f as usize]?.position.x;
                (x.abs() < 1.5).then_some((x, radiance[f as usize].x / 0.5))
            })
            .collect()
    }
}
