//! How finely places are to be known: as finely as their share in what viewers get to see asks for.
//!
//! Importance particles, which carry what surfaces reflect, tell how much of the light at a place reaches the viewpoints
//! (the adjoint of light: Veach 1997, section 4.7). Where they land closely, points are as close as their level says; where
//! they land far apart, points keep as many of them between each other, and radii grow by powers of two. So a ground or a sky dome a
//! hundred times as wide as the room that is looked at takes few points, and a stray triangle none of the room's.

use crate::points::particles::walk;
use crate::points::viewpoints::ASPECT;
use glam::{IVec3, Vec2, Vec3};
use rayon::prelude::*;
use relight_scene::camera::Camera;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;
use relight_transport::grid::{CellHasher, cell_of, key_of};
use relight_transport::random::Stream;
use relight_transport::sampling::uniform_hemisphere;
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Particles: their landings, some ten each, are a hundred times [`SHARE`]'s inverse and more.
const PARTICLES: u32 = 1 << 14;
/// Landings of a particle at most: what is left by then is a thousandth where surfaces reflect half.
const LANDINGS: usize = 10;
/// Stage number of the random stream.
const STAGE: u32 = 13;

/// Part of all importance that places are told apart by: a disk with so much of it is as wide as its middle's surroundings go. Parts of
/// a room are, its mouldings are not; and as many landings are in one as leave its width a few per cent of noise.
const SHARE: f32 = 1.0 / 512.0;

/// Part of what is looked at where points are as close as levels say: the rest of it may be a sky dome.
const CLOSE: f64 = 0.1;

/// So many landings are asked how closely others are: enough to know a tenth of them to a few per cent of all.
const ASKED: usize = 2048;

/// How many times as far apart as usual particles may land before radii become wider, in what is looked at: within a room they do, and
/// whoever walks about in it comes near all of it. The ground around it has points as its importance asks for, or the half of them would be
/// beneath the camera.
const SLACK: f32 = 8.0;

/// Part of the particles that go on from where points are wide. Few points are to be found from there, so that all would find what is known
/// many times over; but what only such places see (a dome's far side) is a large part of their light, and a quarter of the landings fills it.
const GOES_ON_FROM_WIDE: f32 = 0.25;

/// Widest: a million times the level's radii.
const WIDEST: u8 = 20;

/// Importance in cubic cells of one edge, a power of two.
type Cells = HashMap<u64, f32, BuildHasherDefault<CellHasher>>;

/// How finely places are to be known.
#[derive(Clone, Debug)]
pub struct Relevance {
    /// Where it is looked from.
    pub viewpoints: Vec<Vec3>,
    /// Cameras that are known, over all frames.
    cameras: Vec<Camera>,
    /// Importance in cells of edge 2^first, 2^(first + 1), …, as parts of all.
    cells: Vec<Cells>,
    /// The same in cubes of two cells each way, by the lowest of them.
    cubes: Vec<Cells>,
    first: i32,
    /// Whether hardly any particle lands where radii are wider.
    is_even: bool,
    /// Usual radius of a disk that holds [`SHARE`], metres.
    usual: f32,
    /// Bounds of what is looked at, if not all that is seen is.
    within: Option<(Vec3, Vec3)>,
    /// Rays that were cast.
    pub rays: u64,
}

/// Where a particle landed.
#[derive(Clone, Copy, Debug)]
struct Landing {
    position: Vec3,
    /// What it still carried.
    carried: f32,
    /// Whether an image shows it: how bright surfaces are has no part in that.
    in_image: bool,
}

impl Relevance {
    /// Of what is seen from `viewpoints`, of which there must be one, and in the images of `cameras`. Where nothing is, all is as relevant.
    /// `within`: bounds of what is looked at, if not all that is seen is: a dark room in a bright dome has little of the importance, and
    /// little of an image that was made from far away.
    pub fn of(
        surfaces: &dyn Surfaces,
        viewpoints: &[Vec3],
        within: Option<(Vec3, Vec3)>,
        cameras: Vec<Camera>,
        seed: u64,
    ) -> Relevance {
        let even = Relevance {
            cameras,
            ..Relevance::even(viewpoints)
        };
        let landings: Vec<Landing> = (0..PARTICLES)
            .into_par_iter()
            .with_min_len(256)
            .flat_map_iter(|i| even.particle(surfaces, i, seed))
            .collect();
        let rays = u64::from(PARTICLES) + landings.len() as u64;
        Relevance { rays, ..even }.with(&landings, within)
    }

    /// All is as relevant.
    pub fn even(viewpoints: &[Vec3]) -> Relevance {
        Relevance {
            viewpoints: viewpoints.to_vec(),
            cameras: Vec::new(),
            is_even: true,
            cells: Vec::new(),
            cubes: Vec::new(),
            first: 0,
            usual: f32::INFINITY,
            within: None,
            rays: 0,
        }
    }

    fn with(self, landings: &[Landing], within: Option<(Vec3, Vec3)>) -> Relevance {
        let total: f64 = landings.iter().map(|l| f64::from(l.carried)).sum();
        let (low, high) = (landings.iter()).fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), l| {
            (low.min(l.position), high.max(l.position))
        });
        let extent = (high - low).max_element();
        if !(total > 0.0 && extent > 0.0 && extent.is_finite()) {
            return self;
        }
        let mut relevance = self;
        // From a millionth of the whole, below which no usual disk is found, to all of it in one cell.
        let last = extent.log2().ceil() as i32 + 1;
        relevance.first = last - i32::from(WIDEST);
        relevance.cells = (relevance.first..=last)
            .into_par_iter()
            .map(|power| {
                let mut cells = Cells::default();
                for Landing {
                    position, carried, ..
                } in landings
                {
                    let cell = (position / edge(power)).floor().as_ivec3();
                    *cells.entry(key_of(cell)).or_default() += (f64::from(*carried) / total) as f32;
                }
                cells
            })
            .collect();
        // Of cells so narrow that eight hold no share nobody asks.
        let holds = |cells: &Cells| cells.values().any(|held| 8.0 * held >= SHARE);
        let narrow = relevance.cells.iter().position(holds).unwrap_or(0);
        relevance.cells.drain(..narrow);
        relevance.first += narrow as i32;
        relevance.cubes = relevance.cells.par_iter().map(cubes).collect();
        relevance.usual = relevance.usual_of(landings, within);
        relevance.within = within;
        let sampled = sampled(landings, |_| true);
        let wide = (sampled.par_iter()).filter(|landing| relevance.widening(landing.position) > 0);
        relevance.is_even = wide.count() <= sampled.len() / 100;
        relevance
    }

    /// The radius of disks where particles land closely: [`CLOSE`] of what images show or of what lies `within` the bounds, whichever is
    /// less; of all there is, where neither has a landing. Too small a radius takes few points from other places, since those never get fewer
    /// than a quarter of what their importance asks for; too large a one gives them by area, and a dome has ten thousand times a room's.
    fn usual_of(&self, landings: &[Landing], within: Option<(Vec3, Vec3)>) -> f32 {
        let is_within = |landing: &Landing| within.is_some_and(|within| holds(within, landing.position));
        let looked_at = [
            sampled(landings, |landing| landing.in_image),
            sampled(landings, is_within),
        ];
        let close = looked_at.iter().filter_map(|landings| self.close(landings));
        (close.reduce(f32::min))
            .or_else(|| self.close(&sampled(landings, |_| true)))
            .unwrap_or(f32::INFINITY)
    }

    /// The radius of disks at the closest [`CLOSE`] of some landings; `None` of none.
    fn close(&self, landings: &[Landing]) -> Option<f32> {
        let mut radii: Vec<(f32, f32)> = (landings.par_iter())
            .map(|landing| (self.radius(landing.position), landing.carried))
            .collect();
        let total: f64 = radii.iter().map(|disk| f64::from(disk.1)).sum();
        radii.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut below = 0.0;
        let close = radii.iter().find(|&&(_, carried)| {
            below += f64::from(carried);
            below >= CLOSE * total
        });
        close.map(|disk| disk.0)
    }

    /// Of a disk around a place that holds [`SHARE`], about, metres.
    fn radius(&self, x: Vec3) -> f32 {
        for (power, cubes) in (self.first..).zip(&self.cubes) {
            let edge = edge(power);
            let corner = (x / edge - 0.5).floor().as_ivec3();
            let held = cubes.get(&key_of(corner)).copied().unwrap_or(0.0);
            if held >= SHARE {
                // Twice as wide as a cell; of surfaces that cross it a disk of its edge's radius has about as much. Between powers
                // importance goes with the disk's area.
                return edge * (SHARE / held).sqrt().max(0.5);
            }
        }
        self.cells
            .last()
            .map_or(0.0, |_| edge(self.first + self.cells.len() as i32))
    }

    /// Radius of disks, metres, of which a set shows how much relevant surface there is: several hundred, a thousand where parts of it are
    /// more relevant than others. Infinite where nothing is seen.
    pub fn trial_radius(&self) -> f32 {
        self.usual * if self.is_even { 2.0 } else { 1.0 }
    }

    /// By how much radii are wider at a place, as a power of two.
    pub fn widening(&self, x: Vec3) -> u8 {
        let is_aside = (self.within).is_some_and(|within| !holds(within, x));
        let slack = if is_aside { 1.0 } else { SLACK };
        let limit = slack * self.usual;
        // Nearly all places: their own cell, no wider than that, holds its share.
        if !limit.is_finite() || self.holds_its_share(x, limit) {
            return 0;
        }
        let apart = self.radius(x) / self.usual;
        if apart < slack {
            return 0;
        }
        let power = apart.log2();
        // A point at the limit still stands for less importance than a usual one, and farther away for more, up to four times as much: what
        // lies there is many things to nobody.
        let wider = (1.5 * power - 2.0).floor().min(power.floor() + 1.0);
        let wider = if is_aside { wider.max(power.round()) } else { wider };
        wider.clamp(0.0, f32::from(WIDEST)) as u8
    }

    fn holds_its_share(&self, x: Vec3, widest: f32) -> bool {
        let power = widest.log2().floor() as i32;
        let cells = usize::try_from(power - self.first)
            .ok()
            .and_then(|i| self.cells.get(i));
        cells.is_some_and(|cells| {
            let cell = (x / edge(power)).floor().as_ivec3();
            cells.get(&key_of(cell)).is_some_and(|held| *held >= SHARE)
        })
    }

    /// The ray with which an importance particle starts: in a uniform direction from a viewpoint or, where `in_view` and there are
    /// cameras, through one's image.
    fn ray(&self, number: u64, in_view: bool, s: &mut Stream) -> Ray {
        let n = number as usize;
        match self.cameras.get(n % self.cameras.len().max(1)) {
            Some(camera) if in_view => camera_ray(camera, Vec2::new(s.uniform(), s.uniform())),
            _ => start(self.viewpoints[n % self.viewpoints.len()], s),
        }
    }

    /// The ray with which particle `number` starts. Where all is as relevant, directions are uniform; else half of all particles are seen by the
    /// cameras: of a room's front before a sky dome few others would tell.
    pub fn start(&self, number: u64, s: &mut Stream) -> Ray {
        self.ray(number, !self.is_even && number / 2 % 2 == 1, s)
    }

    /// Whether a particle goes on from where it landed: see [`GOES_ON_FROM_WIDE`].
    pub fn goes_on(&self, x: Vec3, s: &mut Stream) -> bool {
        self.widening(x) == 0 || s.uniform() < GOES_ON_FROM_WIDE
    }

    fn particle(&self, surfaces: &dyn Surfaces, number: u32, seed: u64) -> Vec<Landing> {
        let mut s = Stream::new(seed, STAGE, u64::from(number));
        let in_view = number / 2 % 2 == 1;
        let ray = self.ray(u64::from(number), in_view, &mut s);
        let through_image = in_view && !self.cameras.is_empty();
        let (mut landings, mut carried) = (Vec::with_capacity(LANDINGS), 1.0);
        walk(surfaces, ray, &mut s, LANDINGS, |_, hit, _| {
            landings.push(Landing {
                position: hit.position,
                carried,
                in_image: through_image && landings.is_empty(),
            });
            carried *= surfaces.albedo(hit).max_element().clamp(0.0, 1.0);
            carried > 0.0
        });
        landings
    }
}

fn edge(power: i32) -> f32 {
    2.0f32.powi(power)
}

/// Sums over cubes of two cells each way, by the lowest of them.
fn cubes(cells: &Cells) -> Cells {
    let offsets = || (0..8).map(|i| IVec3::new(i & 1, (i >> 1) & 1, i >> 2));
    let mut sums = Cells::default();
    for &key in cells.keys() {
        for lowest in offsets().map(|offset| cell_of(key) - offset) {
            sums.entry(key_of(lowest)).or_insert_with(|| {
                let within = offsets().filter_map(|offset| cells.get(&key_of(lowest + offset)));
                within.sum()
            });
        }
    }
    sums
}

/// Whether bounds hold a place.
fn holds((low, high): (Vec3, Vec3), x: Vec3) -> bool {
    x.cmpge(low).all() && x.cmple(high).all()
}

/// Of the landings that count, evenly, [`ASKED`] or all.
fn sampled(landings: &[Landing], counts: impl Fn(&Landing) -> bool) -> Vec<Landing> {
    let counting: Vec<Landing> = landings.iter().copied().filter(counts).collect();
    let step = counting.len().div_ceil(ASKED).max(1);
    counting.into_iter().step_by(step).collect()
}

/// A ray through a camera's image, at `at` of its width and height.
fn camera_ray(camera: &Camera, at: Vec2) -> Ray {
    let size = Vec2::new(ASPECT, 1.0);
    Ray::endless(camera.position, camera.direction(at * size, size))
}

/// The ray of a particle that leaves a viewpoint in a uniform direction.
fn start(viewpoint: Vec3, s: &mut Stream) -> Ray {
    let u = Vec2::new(2.0 * s.uniform() - 1.0, s.uniform());
    Ray::endless(viewpoint, uniform_hemisphere(u))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::candidates::Candidate;
    use crate::points::openness::Openness;
    use crate::points::poisson::{coarse_radius_for, distribute};
    use crate::units::Units;
    use glam::Affine3A;
    use relight_scene::material::Material;
    use relight_scene::scene::{Instance, Mesh, Scene};
    use relight_scene::traced::{Shading, TracedScene};
    use std::sync::Arc;

    /// A room of 4 × 3 × 4 m that is open to one side.
    fn room() -> Vec<[Vec3; 4]> {
        let corner = |i: u32| {
            let sign = |bit: u32| if i >> bit & 1 == 1 { 2.0 } else { -2.0 };
            Vec3::new(sign(0), if i >> 1 & 1 == 1 { 3.0 } else { 0.0 }, sign(2))
        };
        [
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ]
        .map(|face| face.map(corner))
        .to_vec()
    }

    /// A ground a centimetre below the room, so wide to either side.
    fn ground(wide: f32) -> [Vec3; 4] {
        [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| Vec3::new(wide * x, -0.01, wide * z))
    }

    fn scene(quads: &[[Vec3; 4]]) -> TracedScene {
        scene_of(quads, Material::default())
    }

    fn scene_of(quads: &[[Vec3; 4]], material: Material) -> TracedScene {
        let mesh = Mesh {
            positions: quads.iter().flatten().copied().collect(),
            triangles: (0..quads.len() as u32)
                .flat_map(|q| [[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| 4 * q + i)))
                .collect(),
            ..Mesh::default()
        };
        let scene = Scene {
            meshes: vec![mesh],
            instances: vec![Instance {
                mesh: 0,
                world_from_mesh: Affine3A::IDENTITY,
            }],
            materials: vec![material],
            ..Scene::default()
        };
        TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap()
    }

    const EYE: Vec3 = Vec3::new(0.2, 1.5, 1.0);

    /// The finest points' distance of a default bake, and its number of finest points in the room, at that radius on two levels.
    fn in_room(surfaces: &TracedScene) -> (f32, usize) {
        let relevance = Relevance::of(surfaces, &[EYE], None, Vec::new(), 0);
        let (radius, _) = coarse_radius_for(surfaces, &relevance, 6, 0, Units::none()).unwrap();
        let points = distribute(
            surfaces,
            &relevance,
            Openness::none(),
            2,
            radius,
            0,
            Units::none(),
            |_| Ok(()),
        )
        .unwrap();
        let inside = points.levels[1].points.iter().filter(|p| p.position.y > -0.005);
        (radius, inside.count())
    }

    /// Truth: the room without anything around it. Two seeds of the points differ by some 2 % in their number.
    #[test]
    fn a_room_has_its_points_whatever_lies_around_it() {
        let (alone, count) = in_room(&scene(&room()));
        let stray = [1e3, 1e5].map(|far| {
            let x = Vec3::new(far, far, 0.0);
            [x, x + Vec3::X, x + Vec3::X, x + Vec3::Y]
        });
        for around in [stray[0], stray[1]] {
            let (radius, same) = in_room(&scene(&[room(), vec![around]].concat()));
            assert!((radius / alone - 1.0).abs() < 0.05, "{radius} {alone}");
            assert!((same as f32 / count as f32 - 1.0).abs() < 0.1, "{same} {count}");
        }
        // A ground in front is looked at, too: it takes its share of the points, the same of ten times to ten thousand times the room's width.
        let radii = [40.0, 400.0, 4e4].map(|wide| in_room(&scene(&[room(), vec![ground(wide)]].concat())).0);
        for radius in radii {
            assert!(radius / alone < 2.0, "{radius} {alone}");
            assert!((radius / radii[0] - 1.0).abs() < 0.2, "{radii:?}");
        }
    }

    /// Truth: the lower half of a box around a small ground lights its upper half, which is seen.
    #[test]
    fn what_only_wide_places_see_has_points_too() {
        let wide = |v: Vec3| (v - Vec3::Y * 1.5) * 1e4;
        let dome: Vec<[Vec3; 4]> = room().into_iter().map(|quad| quad.map(wide)).collect();
        let scene = scene(&[room(), vec![ground(10.0)], dome].concat());
        let relevance = Relevance::of(&scene, &[Vec3::new(0.0, 1.0, 8.0)], None, Vec::new(), 0);
        let points = distribute(
            &scene,
            &relevance,
            Openness::none(),
            3,
            1.0,
            0,
            Units::none(),
            |_| Ok(()),
        )
        .unwrap();
        for level in &points.levels {
            let far = (level.points.iter()).filter(|p| p.position.length() > 1e3);
            let (below, above): (Vec<&Candidate>, Vec<&Candidate>) = far.partition(|p| p.position.y < 0.0);
            let ratio = below.len() as f32 / above.len() as f32;
            assert!((0.33..3.0).contains(&ratio), "{} {}", below.len(), above.len());
        }
    }

    #[test]
    fn points_are_as_wide_as_their_surroundings_are_far() {
        let scene = scene(&[room(), vec![ground(1e3)]].concat());
        let relevance = Relevance::of(&scene, &[EYE], None, Vec::new(), 0);
        assert!(!relevance.is_even);
        for inside in [
            Vec3::new(0.3, 0.0, 0.1),
            Vec3::new(-2.0, 1.0, 0.5),
            Vec3::new(1.0, 3.0, -1.0),
        ] {
            assert_eq!(relevance.widening(inside), 0, "{inside}");
        }
        let far = [20.0, 80.0, 320.0].map(|z| relevance.widening(Vec3::new(3.0, -0.01, z)));
        assert!(0 < far[0] && far.is_sorted() && far[2] >= far[0] + 3, "{far:?}");
    }

    /// Of two hundred places one is in the room, the others are high above the ground around: less than a tenth of the importance is the
    /// room's, which is 4 m wide, where parts of the ground with as much as is told apart are some 15 m wide.
    #[test]
    fn points_are_as_close_as_what_is_looked_at_asks_for_however_little_of_all_that_is_seen_it_is() {
        let scene = scene(&[room(), vec![ground(400.0)]].concat());
        let above = (1..200).map(|i| {
            Vec3::new(
                24.0 * (i % 15) as f32 - 160.0,
                30.0,
                24.0 * (i / 15) as f32 - 150.0,
            )
        });
        let places: Vec<Vec3> = [EYE].into_iter().chain(above).collect();
        let within = Some((Vec3::new(-3.0, -1.0, -3.0), Vec3::new(3.0, 4.0, 3.0)));
        let usual = |within| Relevance::of(&scene, &places, within, Vec::new(), 0).usual;
        let (near, all) = (usual(within), usual(None));
        assert!(near < 2.0 && all > 6.0, "{near} {all}");
        // Where nothing of it is seen, all that is seen is as good.
        let nowhere = Some((Vec3::splat(1e6), Vec3::splat(2e6)));
        assert_eq!(usual(nowhere), all);
    }

    /// Truth: the same room in the same image, in a dome a hundred times as wide. The darker its walls, the fewer particles go on within it: its
    /// share of all importance falls below a tenth.
    #[test]
    fn points_are_as_close_in_a_dark_room_as_in_a_bright_one_and_from_far_away_as_from_near() {
        let wide = |v: Vec3| (v - Vec3::Y * 1.5) * 100.0;
        let dome: Vec<[Vec3; 4]> = room().into_iter().map(|quad| quad.map(wide)).collect();
        let quads = [room(), dome].concat();
        let usual = |reflectance: f32, away: f32, within| {
            let material = Material {
                base_color: Vec3::splat(reflectance).extend(1.0),
                ..Material::default()
            };
            let eye = Vec3::new(0.0, 1.5, 2.0 + away);
            let camera = Camera::looking(eye, Vec3::NEG_Z, Vec3::Y, 0.4);
            Relevance::of(&scene_of(&quads, material), &[eye], within, vec![camera], 0).usual
        };
        let within = Some((Vec3::new(-3.0, -1.0, -3.0), Vec3::new(3.0, 4.0, 3.0)));
        let near = usual(0.8, 6.0, None);
        assert!(near < 1.0, "{near}");
        for reflectance in [0.8, 0.4, 0.1, 0.02] {
            let in_image = usual(reflectance, 6.0, None);
            assert!(
                (0.5..2.0).contains(&(in_image / near)),
                "{reflectance}: {in_image} {near}"
            );
            // A thirtieth or a hundredth of an image: most things are there.
            for away in [20.0, 40.0] {
                let far = usual(reflectance, away, within);
                assert!(
                    (0.2..5.0).contains(&(far / near)),
                    "{reflectance} {away}: {far} {near}"
                );
            }
        }
    }

    #[test]
    fn a_closed_scene_is_even_and_nothing_seen_is_no_matter() {
        let (ball, _) = crate::test_scenes::hollow(0.5);
        let inside = Relevance::of(&ball, &[Vec3::ZERO], None, Vec::new(), 0);
        assert!(inside.is_even && inside.trial_radius().is_finite());
        assert_eq!(inside.widening(Vec3::X), 0);
        let away = Relevance::of(&scene(&[]), &[Vec3::ZERO], None, Vec::new(), 0);
        assert!(away.is_even && away.widening(Vec3::X) == 0);
    }
}
