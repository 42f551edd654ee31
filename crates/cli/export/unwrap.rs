//! Coordinates of a lightmap: a set that the scene has, or new ones by the crate uvunwrap, after xatlas: triangles are grown to charts, laid
//! flat, and packed into one square.

use crate::signals;
use anyhow::{Result, anyhow, bail};
use glam::{Vec2, Vec3};
use relight_play::texels::Atlas;
use relight_scene::scene::{Instance, Mesh};
use relight_scene::traced::TracedScene;
use uvunwrap::{Density, Error, MeshInput, Options, Packing};

/// Texels around each chart: two charts are four apart, so that bilinear lookups and the first mip levels meet none but their own.
const PADDING: u32 = 2;

/// Largest angle between a triangle and its chart, degrees: a smooth ball of 102,400 triangles takes 8 s, with 45° 114 s.
const ANGLE: f32 = 30.0;

/// Triangles from which on charts are packed by rows, which is faster and less dense than by their shapes.
const MANY: usize = 20_000;

/// How far beyond the square coordinates may lie: what rounding makes of its border.
const ROUNDING: f32 = 1e-4;

/// Coordinates of a scene's instances, one after the other.
pub struct Coordinates {
    /// As many as instances.
    pub instances: Vec<Layout>,
    /// Where the scene was unwrapped.
    pub unwrapped: Option<Unwrapped>,
}

/// What unwrapping made.
#[derive(Clone, Copy)]
pub struct Unwrapped {
    pub charts: u32,
    pub texels_per_metre: f32,
}

/// A mesh with coordinates of its own; its vertices are split where charts end.
#[derive(Default)]
pub struct Layout {
    /// Of each vertex the mesh's that it was.
    pub origins: Vec<u32>,
    /// Of each vertex its place in the map.
    pub uvs: Vec<Vec2>,
    /// The mesh's, of these vertices.
    pub triangles: Vec<[u32; 3]>,
}

/// The scene's triangles, instance by instance.
fn placed(scene: &TracedScene) -> impl Iterator<Item = (usize, &Instance, &Mesh)> {
    let own = scene.scene();
    (own.instances.iter().enumerate())
        .map(move |(i, instance)| (i, instance, &own.meshes[instance.mesh as usize]))
}

/// Unwraps a scene into a square of `size` texels.
///
/// # Errors
/// It does not fit, or it was stopped.
pub fn unwrapped(scene: &TracedScene, size: u32) -> Result<Coordinates> {
    let mut first = 0;
    let mut inputs = Vec::new();
    for (_, instance, mesh) in placed(scene) {
        let last = first + mesh.triangles.len() as u32;
        let unlit = scene.materials()[mesh.material as usize].unlit;
        let finite = |p: &Vec3| instance.world_from_mesh.transform_point3(*p);
        let positions: Vec<[f32; 3]> = (mesh.positions.iter().map(finite))
            .map(|p| if p.is_finite() { p.to_array() } else { [0.0; 3] })
            .collect();
        let ignored: Vec<bool> = (first..last)
            .map(|triangle| unlit || scene.triangle_area(triangle) <= 0.0)
            .collect();
        inputs.push((positions, mesh.triangles.as_flattened(), ignored));
        first = last;
    }
    let meshes: Vec<MeshInput> = (inputs.iter())
        .map(|(positions, indices, ignored)| MeshInput {
            ignored_faces: Some(ignored),
            ..MeshInput::new(positions, indices)
        })
        .collect();
    let options = Options {
        density: Density::Auto { page_size: size },
        padding: PADDING,
        max_chart_angle: ANGLE,
        packing: if first as usize > MANY {
            Packing::Fast
        } else {
            Packing::Shape
        },
        ..Options::default()
    };
    let atlas = uvunwrap::generate_with_progress(&meshes, &options, |_| !signals::stopped());
    let too_small = || {
        anyhow!(
            "the scene's {first} triangles do not fit into a lightmap of {size} × {size} texels; give a larger --size, or coordinates \
             of its own with --uv"
        )
    };
    let atlas = match atlas {
        Ok(atlas) if atlas.page_count <= 1 => atlas,
        Ok(_) | Err(Error::ChartTooLarge { .. } | Error::AtlasTooLarge { .. }) => return Err(too_small()),
        Err(error) => bail!("the scene cannot be unwrapped: {error}"),
    };
    // The map is cropped to the rows in use, but textures are square.
    let scale = Vec2::new(atlas.width as f32, atlas.height as f32) / size as f32;
    let layout = |mesh: &uvunwrap::OutputMesh| Layout {
        origins: mesh.vertices.iter().map(|v| v.xref).collect(),
        uvs: mesh.vertices.iter().map(|v| Vec2::from(v.uv) * scale).collect(),
        triangles: mesh.indices.as_chunks::<3>().0.to_vec(),
    };
    Ok(Coordinates {
        instances: atlas.meshes.iter().map(layout).collect(),
        unwrapped: Some(Unwrapped {
            charts: atlas.chart_count,
            texels_per_metre: atlas.texels_per_unit,
        }),
    })
}

/// Takes a set of the scene's own coordinates.
///
/// # Errors
/// A mesh lacks it, or it leaves the square from 0 to 1.
pub fn own(scene: &TracedScene, set: u32) -> Result<Coordinates> {
    let mut instances = Vec::new();
    let (mut outside, mut count) = (0, 0);
    for (i, _, mesh) in placed(scene) {
        let uvs = mesh.uvs.get(set as usize).filter(|uvs| !uvs.is_empty());
        let Some(uvs) = uvs else {
            let name = scene.scene().object_names.get(i).map_or("", String::as_str);
            bail!(
                "object {i} '{name}' has no set {set} of texture coordinates (it has {}); sets that no texture uses are kept by baking \
                 with --keep materials; --uv auto makes new ones",
                mesh.uvs.len()
            );
        };
        let beyond = |uv: &Vec2| !(uv.min_element() >= -ROUNDING && uv.max_element() <= 1.0 + ROUNDING);
        let leaves = |t: &&[u32; 3]| t.iter().any(|&v| beyond(&uvs[v as usize]));
        outside += mesh.triangles.iter().filter(leaves).count();
        count += mesh.triangles.len();
        instances.push(Layout {
            origins: (0..uvs.len() as u32).collect(),
            uvs: uvs.clone(),
            triangles: mesh.triangles.clone(),
        });
    }
    if outside > 0 {
        bail!(
            "{outside} of {count} triangles leave the square from 0 to 1 in set {set} of texture coordinates, so that it tiles, or \
             means a texture; give a set that was made for lightmaps, or --uv auto"
        );
    }
    Ok(Coordinates {
        instances,
        unwrapped: None,
    })
}

/// Where the triangles of the scene lie; those without a surface, or that reflect nothing, are left out.
pub fn atlas(scene: &TracedScene, coordinates: &Coordinates, size: u32) -> Atlas {
    let mut corners = Vec::with_capacity(scene.triangle_count());
    for ((_, instance, mesh), layout) in placed(scene).zip(&coordinates.instances) {
        let mirrored = instance.world_from_mesh.matrix3.determinant() < 0.0;
        let unlit = scene.materials()[mesh.material as usize].unlit;
        for triangle in &layout.triangles {
            let [a, b, c] = triangle.map(|v| layout.uvs[v as usize]);
            let absent = unlit || scene.triangle_area(corners.len() as u32) <= 0.0;
            corners.push(match (absent, mirrored) {
                (true, _) => [Vec2::NAN; 3],
                (_, true) => [a, c, b],
                (_, false) => [a, b, c],
            });
        }
    }
    Atlas { size, corners }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, DVec2, Quat};
    use relight_play::texels::Texels;
    use relight_scene::material::Material;
    use relight_scene::scene::Scene;
    use relight_scene::traced::Shading;
    use relight_transport::random::Stream;
    use std::sync::Arc;

    fn traced(placed: Vec<(Mesh, Affine3A)>) -> TracedScene {
        let (meshes, places): (Vec<Mesh>, Vec<Affine3A>) = placed.into_iter().unzip();
        let scene = Scene {
            instances: (0..)
                .zip(places)
                .map(|(mesh, world_from_mesh)| Instance {
                    mesh,
                    world_from_mesh,
                })
                .collect(),
            meshes,
            materials: vec![Material::default()],
            ..Scene::default()
        };
        TracedScene::new(Arc::new(scene), Shading::Full).unwrap()
    }

    /// A bumpy ball of `rings` × 2 `rings` quads, whose poles are triangles without area.
    fn ball(rings: u32, bumps: f32, stream: &mut Stream) -> Mesh {
        let columns = 2 * rings;
        let mut mesh = Mesh::default();
        for i in 0..=rings {
            for j in 0..=columns {
                let (polar, around) = (
                    std::f32::consts::PI * i as f32 / rings as f32,
                    std::f32::consts::TAU * j as f32 / columns as f32,
                );
                let radius = 1.0 + bumps * stream.uniform();
                let place = Vec3::new(
                    polar.sin() * around.cos(),
                    polar.cos(),
                    polar.sin() * around.sin(),
                );
                mesh.positions.push(radius * place);
            }
        }
        for i in 0..rings {
            for j in 0..columns {
                let at = |di: u32, dj: u32| (i + di) * (columns + 1) + j + dj;
                mesh.triangles.push([at(0, 0), at(0, 1), at(1, 1)]);
                mesh.triangles.push([at(0, 0), at(1, 1), at(1, 0)]);
            }
        }
        mesh
    }

    /// Triangles that are nothing to each other.
    fn soup(count: u32, stream: &mut Stream) -> Mesh {
        let mut place = || Vec3::new(stream.uniform(), stream.uniform(), stream.uniform()) - 0.5;
        Mesh {
            positions: (0..count)
                .flat_map(|_| {
                    let middle = 10.0 * place();
                    [middle + place(), middle + place(), middle + place()]
                })
                .collect(),
            triangles: (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            ..Mesh::default()
        }
    }

    /// Area of a triangle in the map, of a square of side 1.
    fn area(corners: [Vec2; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner: Vec2| -> DVec2 { corner.as_dvec2() });
        0.5 * (b - a).perp_dot(c - a).abs()
    }

    /// Balls, soups, several objects, mirrored and without area. Truths: no place of the map is inside of two triangles; every triangle with
    /// an area has one in the map, all together about in proportion; what has none isn't in the map.
    #[test]
    fn surfaces_are_laid_flat_side_by_side() {
        for seed in 0..6 {
            let mut stream = Stream::new(seed, 1, 0);
            let mirror = Affine3A::from_scale(Vec3::new(-1.0, 2.0, 1.0));
            let moved = Affine3A::from_rotation_translation(Quat::from_rotation_x(1.0), Vec3::splat(5.0));
            let mut broken = soup(3, &mut stream);
            broken.positions[4] = Vec3::splat(f32::NAN);
            let bumps = 0.1 * seed as f32;
            let scene = traced(vec![
                (ball(12, bumps, &mut stream), Affine3A::IDENTITY),
                (ball(5, bumps, &mut stream), mirror),
                (soup(20 * seed as u32, &mut stream), moved),
                (broken, Affine3A::IDENTITY),
            ]);
            let coordinates = unwrapped(&scene, 512).unwrap();
            let atlas = atlas(&scene, &coordinates, 512);
            let texels = Texels::of(&atlas);
            assert!(
                texels.overlapping.is_empty(),
                "seed {seed}: {:?}",
                texels.overlapping
            );
            assert!(
                texels.covered > 0.2 * 512.0 * 512.0,
                "seed {seed}: {}",
                texels.covered
            );
            let density = f64::from(coordinates.unwrapped.unwrap().texels_per_metre) / 512.0;
            let (mut flat, mut whole) = (0.0, 0.0);
            for (i, &corners) in (0..).zip(&atlas.corners) {
                let surface = f64::from(scene.triangle_area(i));
                if surface > 1e-6 {
                    let own = area(corners);
                    assert!(
                        own > 0.0,
                        "seed {seed}, triangle {i} of {surface} m² has no place"
                    );
                    flat += own;
                    whole += surface * density * density;
                } else {
                    assert!(
                        corners[0].is_nan() || area(corners) < 1e-9,
                        "seed {seed}, triangle {i}"
                    );
                }
            }
            assert!(
                (0.8..1.25).contains(&(flat / whole)),
                "seed {seed}: {}",
                flat / whole
            );
            for (layout, instance) in coordinates.instances.iter().zip(&scene.scene().instances) {
                let mesh = &scene.scene().meshes[instance.mesh as usize];
                let back = |t: &[u32; 3]| t.map(|v| layout.origins[v as usize]);
                let same = layout
                    .triangles
                    .iter()
                    .map(back)
                    .eq(mesh.triangles.iter().copied());
                assert!(same, "triangles keep their order and their vertices");
            }
        }
    }

    #[test]
    fn a_hundred_thousand_triangles_fit_or_are_refused() {
        let mut stream = Stream::new(7, 1, 0);
        let scene = traced(vec![(ball(160, 0.01, &mut stream), Affine3A::IDENTITY)]);
        assert!(scene.triangle_count() > 100_000);
        let coordinates = unwrapped(&scene, 1024).unwrap();
        let texels = Texels::of(&atlas(&scene, &coordinates, 1024));
        assert!(texels.overlapping.is_empty(), "{:?}", texels.overlapping);
        let scene = traced(vec![(soup(20_000, &mut stream), Affine3A::IDENTITY)]);
        let error = unwrapped(&scene, 64)
            .err()
            .expect("64 × 64 texels are no place for 20000 charts");
        let text = error.to_string();
        assert!(
            text.contains("20000 triangles") && text.contains("--size"),
            "{text}"
        );
    }

    #[test]
    fn a_set_of_ones_own_is_there_and_within_the_square() {
        let mut mesh = soup(2, &mut Stream::new(1, 1, 0));
        let place = Affine3A::IDENTITY;
        let refused = |mesh: &Mesh, set| {
            own(&traced(vec![(mesh.clone(), place)]), set)
                .err()
                .unwrap()
                .to_string()
        };
        assert!(refused(&mesh, 0).contains("no set 0"), "{}", refused(&mesh, 0));
        mesh.uvs = vec![vec![Vec2::splat(0.5); 6]];
        assert!(refused(&mesh, 1).contains("it has 1"));
        assert!(own(&traced(vec![(mesh.clone(), place)]), 0).is_ok());
        for outside in [1.5, f32::NAN] {
            mesh.uvs[0][2].y = outside;
            assert!(
                refused(&mesh, 0).starts_with("1 of 2 triangles leave"),
                "{}",
                refused(&mesh, 0)
            );
        }
    }
}
