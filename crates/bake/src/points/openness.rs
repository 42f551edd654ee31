//! How far apart points may be where surfaces see nothing near: indirect light changes over distances that are a part of those to what
//! reflects it.
//!
//! Source: Ward, Rubinstein and Clear 1988, "A ray tracing solution for diffuse interreflection", equation 4: irradiance changes by
//! about as much of itself as a step is of the harmonic mean distance to all that is seen. The same distance tells crevices in
//! Lehtinen et al. 2008, section 2.3. Deviation from the latter, whose points are equally close everywhere: where that distance is
//! long, finer levels have no points of their own but inherit the coarser one's, so that a plain wall takes few and its corners keep
//! theirs. So does the way to a lamp, where one is known: of a lantern over open ground the spot is as wide as the lantern is high.

use glam::Vec3;
use rayon::prelude::*;
use relight_scene::rays::Ray;
use relight_scene::surface::{SurfaceHit, Surfaces, WAYS, ray_from};
use relight_transport::grid::{CellHasher, key_of};
use relight_transport::kernel::width;
use relight_transport::random::Stream;
use relight_transport::sampling::{DirectionSet, Frame};
use std::collections::HashMap;
use std::hash::BuildHasherDefault;

/// Rays over the hemisphere; a quarter more or less of the distance is half a power of two.
const RAYS: usize = 32;
/// Stage number of the random stream.
const STAGE: u32 = 14;

/// Disk radius over the harmonic mean distance to what is seen, at most. A level's points are interpolated within two radii, where light
/// changes by some tenths of itself; what that leaves is less than what links leave out (docs/notebook/openness.md).
const STEP: f32 = 0.2;
/// Levels of the presets that aim at small errors; each further one halves [`STEP`], as it halves everything else.
const LEVELS: usize = 6;
/// Most that openness widens, as a power of two, beyond what relevance does.
const MOST: u8 = 4;

/// Part of the way to a lamp on which nothing may be: what is around its middle is its own.
const LAMP: f32 = 0.9;

type Cells = HashMap<u64, u8, BuildHasherDefault<CellHasher>>;

/// A cell that was asked: which way its surfaces face and how relevant they are, its key, and by how much radii are wider there.
pub type Asked = (u8, u64, u8);

/// How much wider points may be at places, known by cells as narrow as the finest points' distance.
pub struct Openness {
    /// Disk radius of the finest level; infinite: nothing is widened.
    radius: f32,
    /// Disk radius over distance.
    step: f32,
    directions: DirectionSet,
    /// Where lamps are.
    lamps: Vec<Vec3>,
    /// Widenings by what normals face, for each widening by relevance.
    cells: Vec<Cells>,
    /// What has been asked in order, as [`Openness::restore`] takes it.
    asked: Vec<Asked>,
}

impl Openness {
    /// For points on `levels` levels, of which the coarsest have disks of `coarse_radius`, under `lamps` at these places. A single level has
    /// nothing to inherit.
    pub fn new(levels: usize, coarse_radius: f32, lamps: Vec<Vec3>, seed: u64) -> Openness {
        let radius = match levels {
            1 => f32::INFINITY,
            _ => coarse_radius / (1u64 << (levels - 1)) as f32,
        };
        let further = levels.saturating_sub(LEVELS) as i32;
        Openness {
            radius,
            step: STEP * 2.0f32.powi(-further),
            directions: DirectionSet::uniform(RAYS, &mut Stream::new(seed, STAGE, 0)),
            lamps,
            cells: Vec::new(),
            asked: Vec::new(),
        }
    }

    /// Nothing is widened.
    pub fn none() -> Openness {
        Openness::new(1, f32::INFINITY, Vec::new(), 0)
    }

    /// Whether anything is widened.
    pub fn widens(&self) -> bool {
        self.radius.is_finite()
    }

    /// Where lamps are.
    pub fn lamps(&self) -> &[Vec3] {
        &self.lamps
    }

    /// What was asked since the last call.
    pub fn take_asked(&mut self) -> Vec<Asked> {
        std::mem::take(&mut self.asked)
    }

    /// Takes back what was asked before.
    pub fn restore(&mut self, asked: Vec<Asked>) {
        for (side, cell, widening) in asked {
            self.cells_of(side).insert(cell, widening);
        }
    }

    fn cells_of(&mut self, side: u8) -> &mut Cells {
        let side = usize::from(side);
        if self.cells.len() <= side {
            self.cells.resize_with(side + 1, Cells::default);
        }
        &mut self.cells[side]
    }

    /// The cell of a place, as narrow as the finest points' distance where radii are wider by `relevant`.
    fn key(&self, hit: &SurfaceHit, relevant: u8) -> (u8, u64) {
        let cell = (hit.position / (self.radius * width(relevant)))
            .floor()
            .as_ivec3();
        (hit.way() as u8 + WAYS as u8 * relevant, key_of(cell))
    }

    /// By how much radii may be wider at each place, as a power of two, where those of all levels are by `relevant`; and the number
    /// of rays cast. The first place that is asked about in a cell answers for it.
    pub fn widenings(
        &mut self,
        surfaces: &dyn Surfaces,
        hits: &[SurfaceHit],
        relevant: &[u8],
    ) -> (Vec<u8>, u64) {
        if !self.widens() {
            return (vec![0; hits.len()], 0);
        }
        let keys: Vec<(u8, u64)> = (hits.iter().zip(relevant))
            .map(|(hit, &relevant)| self.key(hit, relevant))
            .collect();
        let mut new = Vec::new();
        for (i, &(side, cell)) in keys.iter().enumerate() {
            self.cells_of(side).entry(cell).or_insert_with(|| {
                new.push(i);
                0
            });
        }
        let found: Vec<(u8, u64)> = new
            .par_iter()
            .with_min_len(64)
            .map(|&i| self.widening(surfaces, &hits[i], relevant[i]))
            .collect();
        let mut rays = 0;
        for (&i, (widening, cast)) in new.iter().zip(found) {
            rays += cast;
            let (side, cell) = keys[i];
            self.cells_of(side).insert(cell, widening);
            self.asked.push((side, cell, widening));
        }
        let widenings = keys
            .iter()
            .map(|(side, cell)| self.cells[usize::from(*side)][cell]);
        (widenings.collect(), rays)
    }

    /// By how much radii may be wider at a place, and the number of rays cast.
    fn widening(&self, surfaces: &dyn Surfaces, hit: &SurfaceHit, relevant: u8) -> (u8, u64) {
        let radius = self.radius * width(relevant);
        let farthest = radius * f32::from(1u16 << (MOST + 1)) / self.step;
        let distances = distances(surfaces, hit, farthest, &self.directions);
        // The sky, which sends no indirect light, says nothing about how far away that is which does.
        let (sum, count) = (distances.flatten()).fold((0.0, 0), |(sum, count), t| (sum + 1.0 / t, count + 1));
        let distance = if count > 0 { count as f32 / sum } else { farthest };
        let (wider, cast) = self.under_lamps(surfaces, hit, radius, self.wider(radius, distance));
        (relevant + wider, RAYS as u64 + cast)
    }

    /// By how much radii may be wider than `radius`, as a power of two, where light changes over `distance`.
    fn wider(&self, radius: f32, distance: f32) -> u8 {
        let power = (self.step * distance / radius).log2().floor();
        power.clamp(0.0, f32::from(MOST)) as u8
    }

    /// What is left of `wider` at a place on which lamps shine, whose light changes over a part of their distances; and the number of rays cast.
    fn under_lamps(
        &self,
        surfaces: &dyn Surfaces,
        hit: &SurfaceHit,
        radius: f32,
        mut wider: u8,
    ) -> (u8, u64) {
        let mut cast = 0;
        for &lamp in &self.lamps {
            if wider == 0 {
                break;
            }
            let way = lamp - hit.position;
            let own = self.wider(radius, way.length());
            if own < wider && way.dot(hit.geometric_normal) > 0.0 {
                cast += 1;
                if shines_on(surfaces, hit, way) {
                    wider = own;
                }
            }
        }
        (wider, cast)
    }
}

/// Whether nothing is on the way from a place to a lamp but, maybe, the lamp itself, at the way's end.
fn shines_on(surfaces: &dyn Surfaces, place: &SurfaceHit, way: Vec3) -> bool {
    let ray = Ray {
        t_max: LAMP,
        ..ray_from(place, way)
    };
    !surfaces.occluded(&ray)
}

/// Harmonic mean distance to the geometry above a place, along rays of length `farthest`, misses counting as that.
pub fn mean_distance(
    surfaces: &dyn Surfaces,
    place: &SurfaceHit,
    farthest: f32,
    directions: &DirectionSet,
) -> f32 {
    let distances = distances(surfaces, place, farthest, directions);
    let sum: f32 = distances.map(|t| 1.0 / t.unwrap_or(farthest)).sum();
    directions.directions.len() as f32 / sum
}

/// Distances to the geometry above a place, along rays of length `farthest`; `None`: there is none. None is 0.
fn distances<'a>(
    surfaces: &'a dyn Surfaces,
    place: &SurfaceHit,
    farthest: f32,
    directions: &'a DirectionSet,
) -> impl Iterator<Item = Option<f32>> + 'a {
    let frame = Frame::around(place.geometric_normal);
    let origin = ray_from(place, place.geometric_normal).origin;
    directions.directions.iter().map(move |&d| {
        let ray = Ray {
            origin,
            direction: frame.world_from_local(d),
            t_min: 0.0,
            t_max: farthest,
        };
        let hit = surfaces.closest_hit(&ray);
        hit.map(|hit| hit.t.max(farthest * f32::EPSILON))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::poisson::{PointLevels, distribute, levels_of};
    use crate::points::relevance::Relevance;
    use crate::units::Units;
    use glam::Affine3A;
    use relight_scene::material::Material;
    use relight_scene::scene::{Instance, Mesh, Scene};
    use relight_scene::traced::{Shading, TracedScene};
    use relight_transport::pyramid::fine_from_coarse;
    use relight_transport::sparse::row;
    use std::sync::Arc;

    /// Half the edge of the room.
    const HALF: f32 = 2.0;

    /// A closed cube.
    fn cube() -> TracedScene {
        let corner = |i: u32| Vec3::from([0, 1, 2].map(|bit| if i >> bit & 1 == 1 { HALF } else { -HALF }));
        let mesh = Mesh {
            positions: (0..8).map(corner).collect(),
            triangles: [
                [0, 1, 3, 2],
                [4, 6, 7, 5],
                [0, 4, 5, 1],
                [2, 3, 7, 6],
                [0, 2, 6, 4],
                [1, 5, 7, 3],
            ]
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect(),
            ..Mesh::default()
        };
        let material = Material {
            double_sided: true,
            ..Material::default()
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

    const LEVELS: usize = 4;
    const COARSE: f32 = 0.8;

    fn points(scene: &TracedScene, openness: Openness) -> PointLevels {
        let relevance = Relevance::even(&[Vec3::splat(0.3)]);
        distribute(
            scene,
            &relevance,
            openness,
            LEVELS,
            COARSE,
            0,
            Units::none(),
            |_| Ok(()),
        )
        .unwrap()
    }

    /// Distance to the nearest edge of the cube.
    fn from_edge(position: Vec3) -> f32 {
        let mut sides = (Vec3::splat(HALF) - position.abs()).to_array();
        sides.sort_by(f32::total_cmp);
        sides[1]
    }

    #[test]
    fn plain_walls_inherit_and_corners_have_their_own() {
        let scene = cube();
        let all = points(&scene, Openness::none());
        let open = points(&scene, Openness::new(LEVELS, COARSE, Vec::new(), 0));
        // The middle of a wall sees some two metres far: a fifth of that is more than a finest radius of 0.1.
        let finest = &open.levels[LEVELS - 1].points;
        let own = finest.iter().filter(|p| !p.inherited);
        let far = own.clone().filter(|p| from_edge(p.position) > 1.2).count();
        assert_eq!(far, 0);
        let near = |points: &PointLevels| {
            let finest = points.levels[LEVELS - 1].points.iter();
            finest.filter(|p| from_edge(p.position) < 0.15).count() as f32
        };
        assert!(
            (near(&open) / near(&all) - 1.0).abs() < 0.1,
            "{} {}",
            near(&open),
            near(&all)
        );
        assert!(2 * finest.len() < all.levels[LEVELS - 1].points.len());
        // Nothing is left bare.
        let levels = levels_of(&open);
        let mut functions = Vec::new();
        for place in &all.levels[LEVELS - 1].points {
            functions.clear();
            levels[LEVELS - 1].functions_at(place.position, place.normal, &mut functions);
            assert!(!functions.is_empty(), "{:?}", place.position);
        }
    }

    /// Truth: a plane that sees nothing. Under a lamp 0.5 m above it a fifth of that is the finest radius.
    #[test]
    fn an_open_ground_has_close_points_under_a_lamp_and_none_where_nothing_shines_on_it() {
        let quad = |edge: f32, height: f32| Mesh {
            positions: [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]]
                .map(|[x, z]| Vec3::new(x * edge, height, z * edge))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        };
        let material = Material {
            double_sided: true,
            ..Material::default()
        };
        let scene = Scene {
            meshes: vec![quad(4.0, 0.0)],
            instances: vec![Instance {
                mesh: 0,
                world_from_mesh: Affine3A::IDENTITY,
            }],
            materials: vec![material],
            ..Scene::default()
        };
        let ground = TracedScene::new(Arc::new(scene), Shading::Lambert).unwrap();
        let own_around = |lamps: Vec<Vec3>| {
            let openness = Openness::new(LEVELS, COARSE, lamps, 0);
            let finest = points(&ground, openness).levels.remove(LEVELS - 1).points;
            let own = |within: f32| {
                let is_own = |p: &&crate::points::candidates::Candidate| {
                    !p.inherited && p.position.length() < within && p.normal.y > 0.0
                };
                finest.iter().filter(is_own).count()
            };
            [own(0.3), own(f32::INFINITY)]
        };
        assert_eq!(own_around(Vec::new()), [0, 0]);
        assert_eq!(own_around(vec![Vec3::new(0.0, 30.0, 0.0)]), [0, 0], "a high lamp");
        let [near, all] = own_around(vec![Vec3::new(0.0, 0.5, 0.0)]);
        // 0.70 points for each squared radius of 0.1, up to where twice that is a fifth of the way to the lamp.
        assert!((12..=28).contains(&near), "{near}");
        assert!(all < 400, "{all}");
    }

    #[test]
    fn an_inherited_point_is_the_coarser_levels() {
        let scene = cube();
        let points = points(&scene, Openness::new(LEVELS, COARSE, Vec::new(), 0));
        let parents = fine_from_coarse(&levels_of(&points), |_, _| false);
        let places: Vec<_> = points.levels.iter().flat_map(|level| &level.points).collect();
        let inherited: Vec<usize> = (0..places.len()).filter(|&i| places[i].inherited).collect();
        assert!(inherited.len() > 100);
        for i in inherited {
            let own: Vec<_> = row(&parents, i).collect();
            assert!(own.len() == 1 && own[0].1 == 1.0, "{own:?}");
            assert_eq!(places[own[0].0 as usize].position, places[i].position);
        }
    }
}
