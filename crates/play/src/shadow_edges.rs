//! Direct light where a shadow's edge passes: the mean over the surface that a place stands for.
//!
//! A single shadow ray switches a place from light to dark at once, and as a lamp moves, indirect light flickers with every place
//! that its shadows pass. Where neighbours disagree, light is found at several spots around each instead, which the edge passes one
//! after the other.

use crate::spread::sunflower;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::irradiance::Place;
use relight_render::lighting::{DARK, LIT, Met};
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces, ray_from};
use relight_scene::traced::TracedScene;
use relight_transport::basis::Level;
use relight_transport::sampling::Frame;
use relight_transport::sparse::{SparseMatrix, build, row};
use std::sync::OnceLock;

/// Spots of a place: a step of light is a sixteenth of the place's.
const SPOTS: usize = 16;

/// Spots of a place on which [`MUCH`] steps: a sixteenth of it would show. Of the atrium's flicker they take a third, for a thirtieth of the
/// time.
const MANY: usize = 64;

/// Those asked first: along the rim, some 70° apart by the golden angle. Where they agree with the place, no edge passes it, or one that
/// cuts off less than an eighth.
const RIM: [u8; 5] = [9, 11, 12, 13, 15];

/// Radius of the surface that a place stands for, in disk radii: [`relight_render::irradiance::FOOTPRINT`] is its area.
const REACH: f32 = 0.6;

/// Neighbours of a place are within this many disk radii: an edge that passes its surface has places of a maximal set on its other side
/// there.
const NEAR: f32 = 2.0;

/// Times the mean light from which on a place's has much: without, the 99.9th percentile of the atrium's flicker is a fifth more
/// (docs/notebook/transfer.md).
const MUCH: f32 = 4.0;

/// Places whose spots are lit together: some packets of rays, whose hits stay in a core's cache.
const TOGETHER: usize = 64;

/// How far above a place's plane its spots are looked for, as a share of the way there.
const HEIGHT: f32 = 0.25;

/// Shares of a spot's distance at which it is looked for, one after the other.
const NEARER: [f32; 3] = [1.0, 0.5, 0.25];

/// What is known of the places' surroundings; found when it is first asked for.
#[derive(Debug, Default)]
pub struct ShadowEdges {
    neighbours: OnceLock<SparseMatrix>,
    /// Spots of each place on its own surface, that nothing separates from it.
    spots: Vec<OnceLock<Box<Spots>>>,
    /// The same, [`MANY`].
    many: Vec<OnceLock<Box<Spots>>>,
}

/// Spots around a place.
#[derive(Debug)]
struct Spots {
    /// Those of [`RIM`] before all others.
    at: Box<[Place]>,
    /// Which of the place's each is.
    which: Box<[u8]>,
    /// How many of [`RIM`] there are.
    rim: u8,
}

/// A place that an edge may pass.
struct NearEdge {
    place: u32,
    /// Whether it and its neighbours have light that differs by much. A bent surface turns some spots away from the light, and a lamp with
    /// extent is behind an edge for some and not for others: all are asked, whatever the rim says.
    steps_much: bool,
}

/// Places where light is found.
#[derive(Clone, Copy)]
pub struct Places<'a> {
    /// The surfaces that they lie on.
    pub scene: &'a TracedScene,
    /// Where.
    pub hits: &'a [Option<SurfaceHit>],
    /// Disk radius of the maximal set that they are, m.
    pub disk_radius: f32,
}

/// Lights spots, of each the place and which of its spots it is: irradiance, and what its sample met.
pub trait Lighting: Fn(&[Place], &[(usize, u32)]) -> (Vec<Vec3>, Vec<Met>) + Sync {}
impl<F: Fn(&[Place], &[(usize, u32)]) -> (Vec<Vec3>, Vec<Met>) + Sync> Lighting for F {}

impl ShadowEdges {
    /// Nothing known yet of so many places.
    pub fn new(places: usize) -> ShadowEdges {
        let unknown = || (0..places).map(|_| OnceLock::new()).collect();
        ShadowEdges {
            neighbours: OnceLock::new(),
            spots: unknown(),
            many: unknown(),
        }
    }

    /// Replaces light at shadows' edges by means over the places' surfaces. `met` and `lit`: of each place.
    pub fn soften(&self, places: Places, met: &[Met], lighting: impl Lighting, lit: &mut [Vec3]) {
        let sum: f64 = lit.iter().map(|lit| f64::from(lit.max_element())).sum();
        let mean = (sum / lit.len().max(1) as f64) as f32;
        let near_edges = self.near_edges(places, met, mean, lit);
        let numbers: Vec<u32> = near_edges.iter().map(|near| near.place).collect();
        let rims = self.lit_at(places, &numbers, Which::Rim, &lighting);
        let crossed: Vec<(u32, Lit)> = (near_edges.iter().zip(rims))
            .filter(|(near, rim)| near.steps_much || rim.is_crossed(met[near.place as usize]))
            .map(|(near, rim)| (near.place, rim))
            .collect();
        let mut set = |place: u32, found: &Lit| {
            if found.count > 0 {
                lit[place as usize] = found.sum / found.count as f32;
            }
        };
        let inside: Vec<u32> = crossed.iter().map(|(place, _)| *place).collect();
        let inner = self.lit_at(places, &inside, Which::Inner, &lighting);
        let mut bright = Vec::new();
        for ((place, rim), inner) in crossed.into_iter().zip(inner) {
            let all = rim.and(inner);
            set(place, &all);
            if all.step() > MUCH * mean {
                bright.push(place);
            }
        }
        let many = self.lit_at(places, &bright, Which::Many, &lighting);
        for (&place, found) in bright.iter().zip(&many) {
            set(place, found);
        }
    }

    /// Places that neighbours see the light otherwise than, that see it in part, or that have much of it. `mean`: of the light of all places.
    fn near_edges(&self, places: Places, met: &[Met], mean: f32, lit: &[Vec3]) -> Vec<NearEdge> {
        let neighbours = self.neighbours.get_or_init(|| neighbours(places));
        let near = |place: u32| {
            let (own, own_met) = (lit[place as usize].max_element(), met[place as usize]);
            let (mut least, mut most, mut differs) = (own, own, own_met == LIT | DARK);
            for (other, _) in row(neighbours, place as usize) {
                let (light, met) = (lit[other as usize].max_element(), met[other as usize]);
                (least, most) = (least.min(light), most.max(light));
                differs |= met != own_met && (met != 0 && own_met != 0 || own.max(light) > mean);
            }
            let steps_much = most - least > MUCH * mean;
            let is_near = steps_much || differs || own > MUCH * mean;
            is_near.then_some(NearEdge { place, steps_much })
        };
        (0..met.len() as u32)
            .into_par_iter()
            .with_min_len(1024)
            .filter_map(near)
            .collect()
    }

    /// Light at some spots of places.
    fn lit_at(&self, places: Places, wanted: &[u32], which: Which, lighting: &impl Lighting) -> Vec<Lit> {
        let lit = |wanted: &[u32]| {
            let (mut spots, mut runs, mut ends) = (Vec::new(), Vec::new(), Vec::new());
            for &place in wanted {
                if let Some((own, numbers)) = self.spots_of(places, place as usize, which) {
                    spots.extend_from_slice(own);
                    runs.extend(numbers.iter().map(|&number| (place as usize, u32::from(number))));
                }
                ends.push(spots.len());
            }
            let (irradiance, met) = lighting(&spots, &runs);
            let mut start = 0;
            ends.into_iter().map(move |end| {
                let own = start..end;
                start = end;
                let mut lit = Lit::NONE;
                (irradiance[own.clone()].iter().zip(&met[own]))
                    .for_each(|(&light, &met)| lit.add(light, met));
                lit
            })
        };
        wanted.par_chunks(TOGETHER).flat_map_iter(lit).collect()
    }

    /// Some spots of a place, and their numbers.
    fn spots_of(&self, places: Places, place: usize, which: Which) -> Option<(&[Place], &[u8])> {
        let (known, count) = match which {
            Which::Many => (&self.many[place], MANY),
            Which::Rim | Which::Inner => (&self.spots[place], SPOTS),
        };
        let reach = REACH * places.disk_radius;
        let hit = places.hits[place].as_ref()?;
        let spots = known.get_or_init(|| Box::new(spots_around(places.scene, hit, place, count, reach)));
        let rim = usize::from(spots.rim);
        let wanted = match which {
            Which::Rim => 0..rim,
            Which::Inner => rim..spots.at.len(),
            Which::Many => 0..spots.at.len(),
        };
        Some((&spots.at[wanted.clone()], &spots.which[wanted]))
    }
}

/// Some of a place's spots.
#[derive(Clone, Copy)]
enum Which {
    /// Of [`SPOTS`] those on the rim.
    Rim,
    /// All others.
    Inner,
    /// All of [`MANY`].
    Many,
}

/// Light of several spots.
#[derive(Clone, Copy)]
struct Lit {
    sum: Vec3,
    count: u32,
    least: f32,
    most: f32,
    /// What any of them met.
    met: [bool; 1 + (LIT | DARK) as usize],
}

impl Lit {
    /// Of no spot.
    const NONE: Lit = Lit {
        sum: Vec3::ZERO,
        count: 0,
        least: f32::INFINITY,
        most: 0.0,
        met: [false; 1 + (LIT | DARK) as usize],
    };

    fn add(&mut self, lit: Vec3, met: Met) {
        self.sum += lit;
        self.count += 1;
        self.least = self.least.min(lit.max_element());
        self.most = self.most.max(lit.max_element());
        self.met[usize::from(met)] = true;
    }

    /// Of these and others.
    fn and(self, others: Lit) -> Lit {
        Lit {
            sum: self.sum + others.sum,
            count: self.count + others.count,
            least: self.least.min(others.least),
            most: self.most.max(others.most),
            met: std::array::from_fn(|met| self.met[met] || others.met[met]),
        }
    }

    /// What an edge takes away that passes all of them.
    fn step(&self) -> f32 {
        self.most - self.least
    }

    /// Whether any has met something else than the place.
    fn is_crossed(&self, place: Met) -> bool {
        (0..).zip(self.met).any(|(met, any)| any && met != place) || place == LIT | DARK
    }
}

/// So many spots on the surface around a hit, on its own side of all others.
fn spots_around(scene: &TracedScene, hit: &SurfaceHit, place: usize, count: usize, reach: f32) -> Spots {
    let frame = Frame::around(hit.geometric_normal);
    let at = |which: usize, reach: f32| {
        let offset = frame.world_from_local((sunflower(which, count, place) * reach).extend(0.0));
        let height = HEIGHT * offset.length();
        let way = Ray {
            t_max: 1.0,
            ..ray_from(hit, offset + hit.geometric_normal * height)
        };
        if scene.occluded(&way) {
            return None;
        }
        let down = Ray {
            origin: way.origin + way.direction,
            direction: -hit.geometric_normal,
            t_min: 0.0,
            t_max: 2.0 * height,
        };
        scene.closest_hit(&down)
    };
    // On what is small or bent, nearer ones.
    let found = |which: usize| {
        let hit = (NEARER.iter()).find_map(|nearer| at(which, reach * nearer))?;
        Some((Place::from(&hit), which as u8))
    };
    let is_rim = |which: &usize| RIM.contains(&(*which as u8));
    let (rim, inner): (Vec<usize>, Vec<usize>) = (0..count).partition(is_rim);
    let rim: Vec<(Place, u8)> = rim.into_iter().filter_map(found).collect();
    let count = rim.len() as u8;
    let all = rim.into_iter().chain(inner.into_iter().filter_map(found));
    let (at, which): (Vec<Place>, Vec<u8>) = all.unzip();
    Spots {
        at: at.into(),
        which: which.into(),
        rim: count,
    }
}

/// Places near each other that face the same way: a row for each, weights of no use.
fn neighbours(places: Places) -> SparseMatrix {
    let (mut numbers, mut positions, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    for (place, hit) in (0u32..).zip(places.hits) {
        if let Some(hit) = hit {
            numbers.push(place);
            positions.push(hit.position);
            normals.push(hit.normal);
        }
    }
    let level = Level::new(positions, normals, places.disk_radius, NEAR * places.disk_radius);
    let count = places.hits.len();
    build(count, count, |place, row| {
        if let Some(hit) = &places.hits[place] {
            level.weights_at(hit.position, hit.normal, |other, weight| {
                let other = numbers[other as usize];
                if other as usize != place {
                    row.push((other, weight));
                }
            });
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, quad, traced};
    use relight_scene::surface::ray_from_end;

    /// Disk radius of the places, m.
    const RADIUS: f32 = 0.1;

    /// Light from straight above: 1 where nothing is over a hit.
    fn from_above(scene: &TracedScene) -> impl Lighting {
        |spots: &[Place], _: &[(usize, u32)]| {
            let is_lit = |spot: &Place| !scene.occluded(&ray_from_end(&spot.start, Vec3::Y));
            let met: Vec<Met> = (spots.iter())
                .map(|spot| if is_lit(spot) { LIT } else { DARK })
                .collect();
            let lit = met
                .iter()
                .map(|&met| Vec3::splat(f32::from(u8::from(met == LIT))));
            (lit.collect(), met)
        }
    }

    /// Places on a floor, as far apart as points of a maximal set.
    fn floor_places(scene: &TracedScene) -> Vec<Option<SurfaceHit>> {
        let at = |i: i32| 0.1 * i as f32 + 0.013;
        let from = |i: i32| Vec3::new(at(i % 11 - 5), 0.3, at(i / 11 - 5));
        (0..121)
            .map(|i| scene.closest_hit(&Ray::endless(from(i), Vec3::NEG_Y)))
            .collect()
    }

    /// A roof over x < edge that is pushed on. Truth: the share of each place's disk that is not under it. Tolerance: spots are spread
    /// evenly, so that an edge is off by some of sixteen.
    #[test]
    fn a_place_goes_dark_bit_by_bit_as_a_shadow_passes_it() {
        let mut before: Option<f32> = None;
        for step in 0..24 {
            let edge = -0.12 + 0.01 * step as f32;
            let roof =
                [[-2.0, 2.0], [edge, 2.0], [edge, -2.0], [-2.0, -2.0]].map(|[x, z]| Vec3::new(x, 0.5, z));
            let scene = traced(vec![level(1.0, 0.0, 0), quad(roof, 0)], vec![matt(0.5, 0.0)]);
            let hits = floor_places(&scene);
            let places = Places {
                scene: &scene,
                hits: &hits,
                disk_radius: RADIUS,
            };
            let lighting = from_above(&scene);
            let own: Vec<Place> = hits.iter().flatten().map(Place::from).collect();
            let (mut lit, met) = lighting(&own, &[]);
            ShadowEdges::new(hits.len()).soften(places, &met, lighting, &mut lit);
            for (hit, lit) in hits.iter().flatten().zip(&lit) {
                let d = ((hit.position.x - edge) / (REACH * RADIUS)).clamp(-1.0, 1.0);
                let truth = 0.5 + (d * (1.0 - d * d).sqrt() + d.asin()) / std::f32::consts::PI;
                assert!((lit.x - truth).abs() < 3.0 / 16.0, "{d}: {}, not {truth}", lit.x);
            }
            let sum: f32 = lit.iter().map(|lit| lit.x).sum();
            // A hundredth of a step of the places, eleven of them abreast: a switch at once would be eleven.
            if let Some(before) = before {
                assert!((0.0..2.2).contains(&(before - sum)), "{before} to {sum}");
            }
            before = Some(sum);
        }
    }

    /// Truth: a floor, a thin wall on it and a carpet beside it.
    #[test]
    fn spots_are_on_the_surface_that_shows_and_not_beyond_a_wall() {
        let wall = [[0.0, -1.0], [0.5, -1.0], [0.5, 1.0], [0.0, 1.0]].map(|[y, z]| Vec3::new(0.02, y, z));
        let mut carpet = level(1.0, 0.002, 0);
        carpet.positions.iter_mut().for_each(|p| p.x -= 1.03);
        let scene = traced(
            vec![level(1.0, 0.0, 0), quad(wall, 0), carpet],
            vec![matt(0.5, 0.0)],
        );
        let from = Vec3::new(-0.01, 0.3, 0.0);
        let hit = scene.closest_hit(&Ray::endless(from, Vec3::NEG_Y)).unwrap();
        let spots = spots_around(&scene, &hit, 0, SPOTS, REACH * RADIUS);
        assert!(spots.at.len() > SPOTS / 2, "{}", spots.at.len());
        for spot in &spots.at {
            let at = spot.start.position;
            assert!(at.x < 0.02, "{at}");
            let height = if at.x < -0.03 { 0.002 } else { 0.0 };
            assert!((at.y - height).abs() < 1e-5, "{at}");
        }
    }
}
