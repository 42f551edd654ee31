//! How far a bake's rays have come, and which objects they could have met there.
//!
//! A unit follows from where its rays went. What they passed is kept with it as cells of a grid over the scene, and a hash of
//! the objects in these cells: where an edited scene has the same objects there, bit by bit, every ray of the unit would go
//! as it went before, one after the other, and the unit holds. So an object that is moved where no ray comes, in another room
//! or inside a wall, makes nothing anew.
//!
//! Rays are followed through the whole bake, not unit by unit: what a unit was given (points, coarser rows) came of earlier rays.
//! Those of visibility cuts, which are many and cheap, are not: they count as going everywhere, and cuts come last.

use super::key::{Key, meshes};
use glam::Vec3;
use relight_format::unit::Column;
use relight_scene::rays::Ray;
use relight_scene::scene::{Instance, Mesh, Scene};
use relight_scene::surface::{SurfaceHit, Surfaces};
use std::sync::atomic::{AtomicU64, Ordering};

/// Cells along the longest side of the scene. More tell objects beside a wall from the wall's other side, and each ray
/// takes as many steps.
const SIDE: u32 = 32;
const WORDS: usize = (SIDE * SIDE * SIDE / 64) as usize;

/// Share of a cell by which objects count as larger than they are: far more than the rounding of a ray's steps.
const MARGIN: f32 = 0.01;

/// More than any distance, and less than what overflows when it is multiplied by a place.
const NEVER: f32 = 1e30;

/// Cells per unit of a ray's direction that are none: less, and their inverse times a place would overflow.
const ALONG: f32 = 1e-20;

/// Cells, a bit each.
type Cells = [u64; WORDS];

/// What rays can meet, object by object, and the cells that they have passed.
pub struct Reach {
    grid: Grid,
    /// The scene's bounds: what they are asked for is an input of every unit.
    bounds: [Vec3; 2],
    objects: Vec<Object>,
    passed: Vec<AtomicU64>,
}

/// An instance of a mesh.
struct Object {
    /// Its triangles in the world, in their place among all, and what lets rays pass.
    hash: u128,
    /// The cells that its triangles may lie in, ascending.
    cells: Vec<u32>,
}

#[derive(Clone, Copy)]
struct Grid {
    low: Vec3,
    cell: f32,
    /// Absolute error of coordinates in the scene.
    rounding: f32,
}

impl Grid {
    fn new([low, high]: [Vec3; 2]) -> Grid {
        // A cell less than there are, so that the margins lie within.
        let cell = ((high - low).max_element() / (SIDE - 1) as f32).max(f32::MIN_POSITIVE);
        Grid {
            low: low - 0.5 * cell,
            cell,
            rounding: 4.0 * f32::EPSILON * low.abs().max(high.abs()).max_element(),
        }
    }

    /// In cells from the grid's corner.
    fn place(&self, position: Vec3) -> Vec3 {
        (position - self.low) / self.cell
    }

    /// The cells that a ray passes until `end`, in units of its direction's length.
    #[inline]
    fn cells_on(&self, ray: &Ray, end: f32) -> Steps {
        let (origin, step) = (self.place(ray.origin), ray.direction / self.cell);
        // Along an axis no wall of the others is ever reached; nor by what is as good as along it.
        let is_along = |s: f32| s.abs() < ALONG;
        let inverse = Vec3::from_array(
            step.to_array()
                .map(|s| if is_along(s) { NEVER } else { s.recip() }),
        );
        let moves = Vec3::from_array(step.to_array().map(|s| f32::from(!is_along(s))));
        // Surfaces lie within the grid: where it is entered and left.
        let (a, b) = (-origin * inverse, (SIDE as f32 - origin) * inverse);
        let never = (Vec3::ONE - moves) * NEVER;
        let start = (a.min(b) * moves).max_element().max(ray.t_min).max(0.0);
        let end = (a.max(b) * moves + never).min_element().min(end).max(start);
        let cell_at = |t: f32| {
            (origin + step * t)
                .to_array()
                .map(|x| (x as i32).clamp(0, SIDE as i32 - 1))
        };
        let (first, last) = (cell_at(start), cell_at(end));
        let forward = step.to_array().map(|s| s > 0.0);
        let walls: [f32; 3] = std::array::from_fn(|k| first[k] as f32 + f32::from(forward[k]));
        let next = (Vec3::from_array(walls) - origin) * inverse;
        let to_last = |k: usize| {
            if forward[k] {
                last[k] - first[k]
            } else {
                first[k] - last[k]
            }
        };
        Steps {
            cell: index(first.map(|c| c as u32)) as i32,
            left: 1 + (0..3).map(|k| to_last(k).max(0) as u32).sum::<u32>(),
            next: next * moves + never,
            between: inverse.abs(),
            strides: std::array::from_fn(|k| if forward[k] { 1 } else { -1 } * (SIDE as i32).pow(k as u32)),
        }
    }

    /// The cells of the bounds of a triangle, enlarged by the margin.
    fn cells_of(&self, corners: [Vec3; 3], mut each: impl FnMut(u32)) {
        let margin = Vec3::splat(MARGIN + self.rounding / self.cell);
        let corners = corners.map(|corner| self.place(corner));
        let low = corners[0].min(corners[1]).min(corners[2]) - margin;
        let high = corners[0].max(corners[1]).max(corners[2]) + margin;
        let [low, high] = [low, high].map(|v| v.to_array().map(|x| (x.max(0.0) as u32).min(SIDE - 1)));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                (low[0]..=high[0]).for_each(|x| each(index([x, y, z])));
            }
        }
    }
}

/// Cells along a ray, one after the other (Amanatides and Woo 1987). As many walls lie between the first and the last as
/// their places differ, so that no step asks whether it is the last.
struct Steps {
    cell: i32,
    left: u32,
    next: Vec3,
    between: Vec3,
    strides: [i32; 3],
}

impl Iterator for Steps {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        self.left = self.left.checked_sub(1)?;
        let cell = self.cell as usize % (64 * WORDS);
        // Without branches: which wall comes first is chance.
        let next = self.next;
        let x = next.x <= next.y && next.x <= next.z;
        let y = !x && next.y <= next.z;
        let z = !(x || y);
        let [x, y, z] = [x, y, z].map(|is_first| -i32::from(is_first));
        self.cell += (self.strides[0] & x) + (self.strides[1] & y) + (self.strides[2] & z);
        self.next += self.between * Vec3::new(-x as f32, -y as f32, -z as f32);
        Some(cell)
    }
}

fn index(cell: [u32; 3]) -> u32 {
    cell[0] + SIDE * (cell[1] + SIDE * cell[2])
}

fn has(cells: &[u64], cell: u32) -> bool {
    cells[cell as usize / 64] >> (cell % 64) & 1 == 1
}

impl Object {
    fn new(instance: &Instance, mesh: &Mesh, hash: u128, first_triangle: u64, grid: &Grid) -> Object {
        let mut key = Key::default();
        // Rays tell triangles by their numbers: of two at the same place they meet the first.
        key.u128s(&[hash])
            .f32s(&instance.world_from_mesh.to_cols_array())
            .u64s(&[first_triangle]);
        let corners: Vec<Vec3> = (mesh.positions.iter())
            .map(|&p| instance.world_from_mesh.transform_point3(p))
            .collect();
        let mut within: Cells = [0; WORDS];
        for triangle in &mesh.triangles {
            grid.cells_of(triangle.map(|i| corners[i as usize]), |cell| {
                within[cell as usize / 64] |= 1 << (cell % 64);
            });
        }
        Object {
            hash: key.hash(),
            cells: (0..SIDE * SIDE * SIDE)
                .filter(|&cell| has(&within, cell))
                .collect(),
        }
    }
}

impl Reach {
    /// Nothing passed yet. `bounds`: of the scene's surfaces, `None` where there are none.
    pub fn new(scene: &Scene, bounds: Option<(Vec3, Vec3)>) -> Reach {
        let bounds = bounds.map_or([Vec3::ZERO; 2], |(low, high)| [low, high]);
        let grid = Grid::new(bounds);
        let hashes = meshes(scene);
        let mut triangles = 0;
        let objects = (scene.instances.iter())
            .map(|instance| {
                let mesh = &scene.meshes[instance.mesh as usize];
                let first = triangles;
                triangles += mesh.triangles.len() as u64;
                Object::new(instance, mesh, hashes[instance.mesh as usize], first, &grid)
            })
            .collect();
        Reach {
            grid,
            bounds,
            objects,
            passed: (0..WORDS).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// What all units depend on, wherever their rays go.
    pub fn inputs(&self, key: &mut Key) {
        key.vectors(self.bounds.iter());
    }

    /// The cells that rays have passed and the hash of what is there, for a unit that follows from these rays.
    pub fn column(&self) -> Column {
        let mut passed: Vec<u64> = self.passed.iter().map(|w| w.load(Ordering::Relaxed)).collect();
        let there = self.content(&passed);
        passed.extend([there as u64, (there >> 64) as u64]);
        Column::U64(passed)
    }

    /// Whether what a unit's rays passed ([`Reach::column`]) is here as it was there; they count as cast then.
    pub fn take_over(&self, column: Column) -> bool {
        let Column::U64(numbers) = column else {
            return false;
        };
        let Some((passed, &[low, high])) = numbers.split_last_chunk::<2>() else {
            return false;
        };
        let there = u128::from(low) | u128::from(high) << 64;
        let is_same = passed.len() == WORDS && self.content(passed) == there;
        if is_same {
            for (all, own) in self.passed.iter().zip(passed) {
                all.fetch_or(*own, Ordering::Relaxed);
            }
        }
        is_same
    }

    /// Hash of the objects that may lie in these cells.
    fn content(&self, passed: &[u64]) -> u128 {
        let met = |object: &&Object| object.cells.iter().any(|&cell| has(passed, cell));
        let hashes: Vec<u128> = self.objects.iter().filter(met).map(|o| o.hash).collect();
        let mut key = Key::default();
        key.u128s(&hashes);
        key.hash()
    }

    /// Marks what a ray passes until `end`, in units of its direction's length.
    fn pass(&self, ray: &Ray, end: f32) {
        for cell in self.grid.cells_on(ray, end) {
            let (word, bit) = (&self.passed[cell / 64], 1 << (cell % 64));
            // Nearly all are marked already, and to read is cheaper than to write what other threads read.
            if word.load(Ordering::Relaxed) & bit == 0 {
                word.fetch_or(bit, Ordering::Relaxed);
            }
        }
    }

    /// From now on rays go anywhere: to follow those of visibility cuts would take as long as they do themselves.
    pub fn pass_everywhere(&self) {
        self.passed
            .iter()
            .for_each(|word| word.store(!0, Ordering::Relaxed));
    }

    /// Whether rays have passed all that a ray passes until `end`.
    fn is_passed(&self, ray: &Ray, end: f32) -> bool {
        let is_marked = |cell: usize| self.passed[cell / 64].load(Ordering::Relaxed) >> (cell % 64) & 1 == 1;
        self.grid.cells_on(ray, end).all(is_marked)
    }
}

/// Surfaces whose rays are followed.
pub struct Followed<'a> {
    inner: &'a dyn Surfaces,
    reach: &'a Reach,
}

impl<'a> Followed<'a> {
    /// Follows the rays into `reach`.
    pub fn new(inner: &'a dyn Surfaces, reach: &'a Reach) -> Followed<'a> {
        Followed { inner, reach }
    }

    /// A shadow ray that something stops would be stopped whatever lies behind: it is cast once more to find where.
    fn pass_shadow(&self, ray: &Ray, is_occluded: bool) {
        if is_occluded && self.reach.is_passed(ray, ray.t_max) {
            return;
        }
        let stop = is_occluded.then(|| self.inner.closest_hit(ray)).flatten();
        self.reach.pass(ray, stop.map_or(ray.t_max, |hit| hit.t));
    }
}

impl Surfaces for Followed<'_> {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.inner.bounds()
    }
    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        let hit = self.inner.closest_hit(ray);
        self.reach.pass(ray, hit.map_or(ray.t_max, |hit| hit.t));
        hit
    }
    fn closest_hits(&self, rays: &[Ray], visit: &mut dyn FnMut(usize, SurfaceHit)) {
        let miss = |rays: &[Ray]| rays.iter().for_each(|ray| self.reach.pass(ray, ray.t_max));
        let mut next = 0;
        self.inner.closest_hits(rays, &mut |i, hit| {
            miss(&rays[next..i]);
            self.reach.pass(&rays[i], hit.t);
            next = i + 1;
            visit(i, hit);
        });
        miss(&rays[next..]);
    }
    fn occluded(&self, ray: &Ray) -> bool {
        let is_occluded = self.inner.occluded(ray);
        self.pass_shadow(ray, is_occluded);
        is_occluded
    }
    fn occluded_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.inner.occluded_packet(rays, occluded);
        for (ray, &is_occluded) in rays.iter().zip(occluded.iter()) {
            self.pass_shadow(ray, is_occluded);
        }
    }
    fn tint(&self, ray: &Ray, t: f32) -> Vec3 {
        self.inner.tint(ray, t)
    }
    fn albedo(&self, hit: &SurfaceHit) -> Vec3 {
        self.inner.albedo(hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::hollow;
    use relight_transport::random::Stream;
    use relight_transport::sampling::uniform_hemisphere;

    fn reach(low: Vec3, high: Vec3) -> Reach {
        Reach {
            grid: Grid::new([low, high]),
            bounds: [low, high],
            objects: Vec::new(),
            passed: (0..WORDS).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// Truth: the places along the ray themselves, a thousand of them. A triangle there, as small as it may be, is in a
    /// cell that was passed.
    #[test]
    fn whatever_lies_on_a_ray_is_in_a_cell_that_it_passed() {
        for (low, high) in [
            (Vec3::splat(-1.0), Vec3::splat(1.0)),
            (Vec3::new(1e4, 0.0, -3.0), Vec3::new(1e4 + 20.0, 0.5, 3.0)),
            (Vec3::splat(-1e-5), Vec3::splat(2e-5)),
        ] {
            let mut s = Stream::new(1, 0, 0);
            let mut inside =
                |low: Vec3, high: Vec3| low + (high - low) * Vec3::new(s.uniform(), s.uniform(), s.uniform());
            for i in 0..300u64 {
                let here = reach(low, high);
                let origin = inside(low, high);
                let target = inside(low, high);
                let mut direction = target - origin;
                if i % 3 == 0 {
                    // Along an axis, exactly or nearly, and along a diagonal of the grid.
                    direction = [Vec3::X, -Vec3::Y, Vec3::ONE, Vec3::new(1e-42, 1.0, -1e-30)]
                        [i as usize / 3 % 4]
                        * direction.length();
                }
                let ray = Ray {
                    origin,
                    direction,
                    t_min: 0.0,
                    t_max: 1.0,
                };
                here.pass(&ray, 1.0);
                let passed: Vec<u64> = here.passed.iter().map(|w| w.load(Ordering::Relaxed)).collect();
                for k in 0..=1000 {
                    let place = origin + direction * (k as f32 / 1000.0);
                    if place.cmplt(low).any() || place.cmpgt(high).any() {
                        continue;
                    }
                    let mut is_met = false;
                    here.grid
                        .cells_of([place; 3], |cell| is_met |= has(&passed, cell));
                    assert!(is_met, "{origin} {direction} at {k}");
                }
            }
        }
    }

    #[test]
    fn a_ray_passes_no_more_than_its_own_cells() {
        let here = reach(Vec3::ZERO, Vec3::ONE);
        let mut s = Stream::new(2, 0, 0);
        let ray = Ray {
            origin: Vec3::splat(0.5),
            direction: uniform_hemisphere(glam::Vec2::new(s.uniform(), s.uniform())) * 0.2,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        here.pass(&ray, 1.0);
        let passed: u32 = here
            .passed
            .iter()
            .map(|w| w.load(Ordering::Relaxed).count_ones())
            .sum();
        // A fifth of 31 cells along, at most √3 of that in walls crossed, and where it starts.
        assert!((4..=12).contains(&passed), "{passed}");
    }

    /// Truth: the rays one by one. The ball is hollow, so that those from outside miss where they pass it.
    #[test]
    fn rays_cast_together_pass_what_they_pass_alone() {
        let (ball, _) = hollow(0.5);
        let mut s = Stream::new(3, 0, 0);
        let rays: Vec<Ray> = (0..100)
            .map(|i| Ray {
                origin: if i % 2 == 0 { Vec3::ZERO } else { Vec3::splat(1.4) },
                direction: uniform_hemisphere(glam::Vec2::new(s.uniform(), s.uniform())),
                t_min: 0.0,
                t_max: 3.0,
            })
            .collect();
        let [alone, together] = [(); 2].map(|()| reach(Vec3::splat(-2.0), Vec3::splat(2.0)));
        let one_by_one = Followed::new(&ball, &alone);
        let hits = rays
            .iter()
            .filter(|ray| one_by_one.closest_hit(ray).is_some())
            .count();
        let mut visited = 0;
        Followed::new(&ball, &together).closest_hits(&rays, &mut |_, _| visited += 1);
        assert!(hits == visited && (50..100).contains(&hits), "{hits} {visited}");
        assert!(together.column() == alone.column());
    }

    #[test]
    fn units_hold_where_what_their_rays_passed_is_the_same() {
        let object = |hash, x| Object {
            hash,
            cells: vec![index([x, 3, 3])],
        };
        let scene = |near: u128, far: u128| Reach {
            objects: vec![object(near, 3), object(far, 20)],
            ..reach(Vec3::ZERO, Vec3::ONE)
        };
        let before = scene(1, 2);
        before.passed[index([3, 3, 3]) as usize / 64]
            .fetch_or(1 << (index([3, 3, 3]) % 64), Ordering::Relaxed);
        assert!(scene(1, 2).take_over(before.column()), "nothing changed");
        let moved = scene(1, 7);
        assert!(moved.take_over(before.column()), "no ray came there");
        assert!(moved.column() == before.column(), "and its rays count as cast");
        assert!(!scene(7, 2).take_over(before.column()), "met");
        assert!(!scene(1, 2).take_over(Column::U64(vec![1])), "no such unit");
    }
}
