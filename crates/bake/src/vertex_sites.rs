//! Mesh vertices as sites of visibility cuts.
//!
//! Source: Cheslack-Postava et al. 2008, section 3: sites are the scene's vertices, and a pixel interpolates between the
//! three of its triangle. A vertex looks past the horizon of its normal.
//!
//! Deviations. A vertex whose back is reached by light, as finest points tell, has both hemispheres in one cut: all
//! surfaces here have two sides. And rays don't start at the vertex, which may lie in the wall that a floor runs into,
//! but a little way into its triangles: see [`NUDGE`].

use crate::candidates::Candidate;
use crate::light_samples::Lights;
use crate::visibility::Site;
use glam::Vec3;
use relight_format as format;
use relight_scene::rays::{Ray, offset_origin};
use relight_scene::traced::TracedScene;
use relight_transport::basis::{Level, NearestPoint};

/// How far rays start from a vertex, of the way to the middle of its triangles: inside a convex corner of three walls
/// as well as on a floor's edge. At a vertex with triangles all around, these ways cancel.
const NUDGE: f32 = 1.0 / 64.0;

/// A vertex as a site.
#[derive(Clone, Copy, Debug, Default)]
pub struct VertexSite {
    /// On its front and on its back; `None` where no light comes by, and on both for a vertex whose triangles cannot be
    /// hit. The normal stands for the geometric one, too.
    pub sides: [Option<Candidate>; 2],
}

impl VertexSite {
    fn above(&self, lights: &Lights, light: usize) -> Option<(&Candidate, f32)> {
        (self.sides.iter().flatten())
            .map(|side| (side, lights.factor(side, light)))
            .find(|found| !found.1.is_nan())
    }
}

impl Site for VertexSite {
    fn factor(&self, lights: &Lights, light: usize) -> f32 {
        self.above(lights, light).map_or(f32::NAN, |found| found.1)
    }

    fn ray(&self, lights: &Lights, light: usize) -> Ray {
        match self.above(lights, light) {
            Some((side, _)) => lights.ray(side, light),
            // Nobody asks for what is below all horizons; such a ray hits nothing.
            None => Ray {
                origin: Vec3::NAN,
                direction: Vec3::NAN,
                t_min: 0.0,
                t_max: 0.0,
            },
        }
    }
}

/// What a vertex's triangles say.
#[derive(Clone, Copy, Default)]
struct Around {
    /// Position and unit normal, once a triangle that can be hit has been met.
    place: Option<(Vec3, Vec3)>,
    /// Sum of the ways to the triangles' middles, and their number.
    ways: Vec3,
    triangles: f32,
    /// Farthest that a middle lies above and below the tangent plane.
    rise: [f32; 2],
    clearance: f32,
}

/// The sites of [`format::vertex_sites`] on a scene's surfaces, whose meshes as they will be stored are `geometry`.
/// `finest`: points on the sides of surfaces that light can carry to the viewer.
pub fn vertex_sites(scene: &TracedScene, geometry: &format::Geometry, finest: &Level) -> Vec<VertexSite> {
    let of_meshes: Vec<format::VertexSites> = geometry.meshes.iter().map(format::vertex_sites).collect();
    let numbers: Vec<(u32, &[[u32; 3]])> = (of_meshes.iter())
        .map(|sites| (sites.count as u32, sites.of_corners.as_slice()))
        .collect();
    let count = (geometry.instances.iter())
        .map(|instance| of_meshes[instance.mesh as usize].count)
        .sum();
    let mut around = vec![Around::default(); count];
    let corners = scene.corner_numbers(&numbers);
    // First what way the vertices face, then how their triangles lie to that.
    for (triangle, sites) in (0..).zip(&corners) {
        if scene.triangle_area(triangle) > 0.0 {
            for (corner, &site) in sites.iter().enumerate() {
                let at = &mut around[site as usize];
                let hit = scene.surface_at(triangle, CORNERS[corner], true);
                at.place.get_or_insert((hit.position, hit.normal));
                at.clearance = at.clearance.max(hit.position_error.max_element());
            }
        }
    }
    for (triangle, sites) in (0..).zip(&corners) {
        let middle = scene.triangle_positions(triangle).iter().sum::<Vec3>() / 3.0;
        for &site in sites.iter().filter(|_| middle.is_finite()) {
            let at = &mut around[site as usize];
            let Some((position, normal)) = at.place else {
                continue;
            };
            let way = middle - position;
            let height = way.dot(normal);
            at.ways += way - normal * height;
            at.triangles += 1.0;
            at.rise = [at.rise[0].max(height), at.rise[1].max(-height)];
        }
    }
    let nearest = NearestPoint::new(finest);
    around.iter().map(|at| at.site(&nearest)).collect()
}

/// Barycentric weights of a triangle's corners.
const CORNERS: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

impl Around {
    fn site(&self, nearest: &NearestPoint) -> VertexSite {
        let Some((position, front)) = self.place else {
            return VertexSite::default();
        };
        let start = position + self.ways * (NUDGE / self.triangles.max(1.0));
        let side = |normal: Vec3, rise: f32| Candidate {
            position,
            normal,
            geometric_normal: normal,
            // Beside a vertex in a hollow the surface lies higher than at it.
            origin: offset_origin(start, normal, normal, self.clearance + NUDGE * rise),
            albedo: Vec3::ZERO,
        };
        let [front, back] = [side(front, self.rise[0]), side(-front, self.rise[1])];
        let reached = |side: &Candidate| {
            (nearest.at(start, side.normal))
                .is_some_and(|point| nearest.level.normals[point as usize].dot(side.normal) > 0.0)
        };
        match [reached(&front), reached(&back)] {
            [_, false] => VertexSite {
                sides: [Some(front), None],
            },
            [false, true] => VertexSite {
                sides: [None, Some(back)],
            },
            [true, true] => VertexSite {
                sides: [Some(front), Some(back)],
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert;
    use crate::light_samples::{LightLeaves, in_tree};
    use crate::params::CutParams;
    use crate::visibility::site_cuts;
    use glam::Affine3A;
    use relight_scene::material::Material;
    use relight_scene::scene::{Instance, Mesh, Scene};
    use relight_scene::traced::Shading;
    use relight_transport::cuts::merge;
    use std::sync::Arc;

    /// A square of corners a, b, c, d that faces `normal`.
    fn square(corners: [Vec3; 4], normal: Vec3) -> Mesh {
        Mesh {
            positions: corners.to_vec(),
            normals: vec![normal; 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        }
    }

    fn scene(meshes: Vec<Mesh>, mirror: bool) -> TracedScene {
        let world_from_mesh = if mirror {
            Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))
        } else {
            Affine3A::IDENTITY
        };
        let instances = (0..meshes.len() as u32)
            .map(|mesh| Instance {
                mesh,
                world_from_mesh,
            })
            .collect();
        let scene = Scene {
            meshes,
            instances,
            materials: vec![Material::default()],
            textures: Vec::new(),
            cameras: Vec::new(),
            sequence: relight_scene::sequence::Sequence {
                frames: 1,
                fps: 24.0,
                camera: None,
                lights: Vec::new(),
            },
            notes: Vec::new(),
        };
        TracedScene::new(Arc::new(scene), Shading::Full).unwrap()
    }

    /// Points on the sides of surfaces near the origin that face `normals`.
    fn points(normals: &[Vec3]) -> Level {
        Level::new(vec![Vec3::ZERO; normals.len()], normals.to_vec(), 3.0, 6.0)
    }

    fn sites(scene: &TracedScene, finest: &Level) -> Vec<VertexSite> {
        vertex_sites(scene, &convert::geometry(scene.scene()), finest)
    }

    /// Mean over the directions towards `facing` of what the cut of each site holds.
    fn seen(scene: &TracedScene, sites: &[VertexSite], facing: Vec3) -> Vec<f64> {
        let params = CutParams {
            lights: 4096,
            sigma: 0.01,
            every_light: true,
            ..CutParams::default()
        };
        let leaves: LightLeaves = in_tree(scene, &[], &Lights::directions(params.lights), 1.0);
        let Lights::Directions { directions, .. } = &leaves.lights else {
            unreachable!()
        };
        let made = site_cuts(scene, sites, &leaves, &params, |_| Ok(())).unwrap();
        (0..sites.len())
            .map(|site| {
                let (mut sum, mut count) = (0.0, 0.0);
                merge([made.cuts.cut(site)], |node, [value]| {
                    let leaves = node.first() as usize..node.end() as usize;
                    let towards = leaves.filter(|&l| directions[l].dot(facing) > 0.0).count() as f64;
                    sum += towards * f64::from(*value);
                    count += towards;
                });
                sum / count
            })
            .collect()
    }

    /// A floor of 2 m that runs into a wall 2 km high and wide: its far vertices are in the wall's plane.
    fn floor_and_wall() -> Vec<Mesh> {
        let floor = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
        let wall = [[-1e3, -1e3], [1e3, -1e3], [1e3, 1e3], [-1e3, 1e3]].map(|[x, y]| Vec3::new(x, y, -1.0));
        vec![square(floor, Vec3::Y), square(wall, Vec3::Z)]
    }

    /// Truth: a floor sees its hemisphere, and half of it where it meets a wall without end.
    #[test]
    fn a_vertex_in_the_plane_of_a_wall_sees_what_is_before_it() {
        for mirror in [false, true] {
            let scene = scene(floor_and_wall(), mirror);
            let floor = &sites(&scene, &points(&[Vec3::Y]))[..4];
            assert!(floor.iter().all(|s| s.sides[0].is_some() && s.sides[1].is_none()));
            for (site, seen) in floor.iter().zip(seen(&scene, floor, Vec3::Y)) {
                let z = site.sides[0].unwrap().position.z;
                // From 2 m before it, a wall of 1 km lacks a thousandth of the half.
                let expected = if z < 0.0 { 0.5 } else { seen.max(0.5) };
                assert!((seen - expected).abs() < 0.01, "{seen} at {z}");
                assert!(z < 0.0 || seen < 0.52, "{seen}");
            }
        }
    }

    /// Truth: a lone sheet hides nothing from either of its sides.
    #[test]
    fn a_sheet_that_is_reached_from_both_sides_sees_the_whole_sphere_through_one_cut() {
        let sheet = vec![floor_and_wall().remove(0)];
        let scene = scene(sheet, false);
        let both = sites(&scene, &points(&[Vec3::Y, Vec3::NEG_Y]));
        assert_eq!(both.len(), 4);
        for facing in [Vec3::Y, Vec3::NEG_Y] {
            assert!(seen(&scene, &both, facing).iter().all(|&s| s > 0.995));
        }
        // And one that is reached from below only does not look up.
        let below = sites(&scene, &points(&[Vec3::NEG_Y]));
        let side = below[0].sides.iter().flatten().next().unwrap();
        assert!(side.normal.y < 0.0 && below[0].sides[0].is_none());
    }

    /// Truth: the inside of a sphere of vertices sees nothing, its outside everything above its tangent plane.
    #[test]
    fn smooth_vertices_are_not_hidden_by_their_own_triangles() {
        let (rows, columns) = (16u32, 32u32);
        let at = |row: u32, column: u32| {
            let polar = std::f32::consts::PI * (row as f32 / rows as f32).clamp(0.01, 0.99);
            let around = std::f32::consts::TAU * (column % columns) as f32 / columns as f32;
            Vec3::new(
                polar.sin() * around.cos(),
                polar.cos(),
                polar.sin() * around.sin(),
            )
        };
        let positions: Vec<Vec3> = (0..=rows)
            .flat_map(|row| (0..=columns).map(move |column| at(row, column)))
            .collect();
        let index = |row, column| row * (columns + 1) + column;
        let triangles = (0..rows)
            .flat_map(|r| (0..columns).map(move |c| (r, c)))
            .flat_map(|(r, c)| {
                let [a, b, d, e] = [index(r, c), index(r, c + 1), index(r + 1, c), index(r + 1, c + 1)];
                [[a, b, d], [b, e, d]]
            })
            .collect();
        let ball = Mesh {
            normals: positions.clone(),
            positions,
            triangles,
            ..Mesh::default()
        };
        let scene = scene(vec![ball], false);
        let sites = sites(&scene, &Level::new(vec![Vec3::Y], vec![Vec3::Y], 0.1, 0.2));
        // The seam is not there twice.
        assert_eq!(sites.len(), (columns * (rows + 1)) as usize);
        for site in [100, 200, 300] {
            let outside = &sites[site..=site];
            let up = outside[0].sides[0].unwrap().normal;
            assert!(seen(&scene, outside, up)[0] > 0.98);
            let inside = Candidate {
                normal: -up,
                geometric_normal: -up,
                ..outside[0].sides[0].unwrap()
            };
            assert!(inside.normal.dot(inside.position) < 0.0);
        }
    }
}
