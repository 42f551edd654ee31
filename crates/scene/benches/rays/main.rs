//! Rays per second of the ray casting kernel, beside obvhs's own eight-wide traversal and, where its development files are installed
//! (Debian's libembree-dev), Embree 3 in its fast and its robust mode, in the same run.
//!
//! `cargo bench -p relight-scene --bench rays`, with `RELIGHT_SCENES` naming a folder (or one file) of `.glb` scenes to measure
//! besides the procedural one. Further arguments keep the measurements whose names contain one of them; `--dump DIR` leaves the triangles
//! and rays of each scene there, raw, little-endian, for any other ray caster (`embree.rs` has their shape). Rounds of all contestants
//! are interleaved, and medians of rounds reported, so that a noisy machine disturbs all alike.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

mod embree;

use embree::Embree;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use glam::{Mat4, Quat, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::{Ray as ObvhsRay, RayHit};
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;
use rayon::prelude::*;
use relight_scene::rays::{self, Kernel, Ray, SurfacePoint, TriangleBvh};

const ROUNDS: usize = 9;
/// Rays are handed out in parts of this size, in one thread or two.
const PART: usize = 4096;
const LIGHTS: usize = 128;

fn main() {
    // `cargo test --benches` passes no --bench: then there is nothing to measure.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let temporary = tempfile::tempdir().expect("a temporary folder");
    let folder = dump_folder().unwrap_or_else(|| temporary.path().to_path_buf());
    let program = embree::compiled(temporary.path());
    let place = Place {
        folder: &folder,
        embree: program.as_deref(),
    };
    println!(
        "{:<24}{:<22}{:>8}  M rays/s (median of {ROUNDS}), ratio to obvhs CwBvh",
        "scene", "rays", "threads"
    );
    let (positions, triangles) = procedural();
    measure("procedural", &positions, &triangles, place);
    for path in scene_files() {
        match read_glb(&path) {
            Some((positions, triangles)) => {
                let name = path
                    .file_stem()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned();
                measure(&name, &positions, &triangles, place);
            }
            None => eprintln!(
                "{}: not a self-contained glb of triangles, skipped",
                path.display()
            ),
        }
    }
}

/// Where files of rays go, and the program that times Embree on them.
#[derive(Clone, Copy)]
struct Place<'a> {
    folder: &'a Path,
    embree: Option<&'a Path>,
}

/// The folder after `--dump`, made if it is not there.
fn dump_folder() -> Option<PathBuf> {
    let mut arguments = std::env::args().skip_while(|argument| argument != "--dump");
    arguments.next()?;
    let folder = PathBuf::from(arguments.next().expect("--dump: give a folder after it"));
    if let Err(error) = std::fs::create_dir_all(&folder) {
        panic!("{}: {error}", folder.display());
    }
    Some(folder)
}

/// Parts of the names of wanted measurements; empty: all.
fn wanted() -> Vec<String> {
    let mut wanted = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--dump" => drop(arguments.next()),
            option if option.starts_with('-') => {}
            _ => wanted.push(argument),
        }
    }
    wanted
}

fn scene_files() -> Vec<PathBuf> {
    let Some(given) = std::env::var_os("RELIGHT_SCENES") else {
        return vec![];
    };
    let given = PathBuf::from(given);
    if given.is_file() {
        return vec![given];
    }
    let entries = std::fs::read_dir(given).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|p| p.extension().is_some_and(|e| e == "glb"))
        .collect();
    files.sort();
    files
}

/// obvhs's compressed hierarchy with its precomputed triangles in traversal order: its fastest arrangement.
struct Obvhs {
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
}

impl Obvhs {
    fn build(positions: &[Vec3], triangles: &[[u32; 3]]) -> Obvhs {
        let corner = |i: u32| Vec3A::from(positions[i as usize]);
        let triangles: Vec<Triangle> = triangles
            .iter()
            .map(|t| Triangle {
                v0: corner(t[0]),
                v1: corner(t[1]),
                v2: corner(t[2]),
            })
            .collect();
        let bvh = build_cwbvh_from_tris(
            &triangles,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        let triangles = bvh
            .primitive_indices
            .iter()
            .map(|&i| RtTriangle::from(&triangles[i as usize]))
            .collect();
        Obvhs { bvh, triangles }
    }

    fn ray(ray: &Ray) -> ObvhsRay {
        ObvhsRay::new(ray.origin.into(), ray.direction.into(), ray.t_min, ray.t_max)
    }

    fn closest(&self, ray: &Ray) -> bool {
        let mut hit = RayHit::none();
        self.bvh.ray_traverse(Self::ray(ray), &mut hit, |ray, id| {
            self.triangles[id].intersect(ray)
        })
    }

    fn any(&self, ray: &Ray) -> bool {
        !self
            .bvh
            .ray_traverse_miss(Self::ray(ray), |ray, id| self.triangles[id].intersect(ray))
    }
}

type Contestant<'a> = (&'a str, Box<dyn Fn(&[Ray]) -> usize + Sync + 'a>);

fn measure(scene: &str, positions: &[Vec3], triangles: &[[u32; 3]], place: Place) {
    let mut build_ms: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            black_box(TriangleBvh::build(positions, triangles));
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    println!(
        "{scene}: {} triangles, built in {:.0} ms",
        triangles.len(),
        median(&mut build_ms)
    );
    let simd = TriangleBvh::build(positions, triangles);
    let scalar = TriangleBvh::build(positions, triangles).with_kernel(Kernel::Scalar);
    let obvhs = Obvhs::build(positions, triangles);
    let corners = embree::dump_triangles(place.folder, scene, positions, triangles);
    let mut embree = place.embree.map(|program| Embree::new(program, &corners));
    let mut random = Random(1);

    let views = views(&simd, 512);
    let gather: Vec<Ray> = (0..1 << 18)
        .map(|_| {
            let point = views[random.below(views.len())];
            rays::ray_from_surface(&point, random.hemisphere(point.normal))
        })
        .collect();
    let count_closest =
        |bvh: &TriangleBvh, rays: &[Ray]| rays.iter().filter(|ray| bvh.closest_hit(ray).is_some()).count();
    let count_any = |bvh: &TriangleBvh, rays: &[Ray]| rays.iter().filter(|ray| bvh.any_hit(ray)).count();
    let count_packet = |rays: &[Ray]| {
        let mut occluded = vec![false; rays.len()];
        simd.any_hit_packet(rays, &mut occluded);
        occluded.iter().filter(|o| **o).count()
    };
    let file = embree::dump_rays(place.folder, scene, "gather", &gather);
    compare(
        scene,
        "gather",
        &gather,
        PART,
        embree
            .as_mut()
            .map(|embree| (embree, &file, ["closest"].as_slice())),
        &[
            (
                "obvhs",
                Box::new(|r| r.iter().filter(|ray| obvhs.closest(ray)).count()),
            ),
            ("avx2", Box::new(|r| count_closest(&simd, r))),
            ("scalar", Box::new(|r| count_closest(&scalar, r))),
        ],
    );

    let (low, high) = simd.bounds().unwrap_or_default();
    let camera = camera(low + (high - low) * EYE);
    let count_closest_packet = |rays: &[Ray]| {
        let mut hits = vec![None; rays.len()];
        simd.closest_hit_packet(rays, &mut hits, |_, _| true);
        hits.iter().flatten().count()
    };
    let file = embree::dump_rays(place.folder, scene, "camera", &camera);
    compare(
        scene,
        "camera, 16 a pixel",
        &camera,
        PART,
        embree
            .as_mut()
            .map(|embree| (embree, &file, ["closest"].as_slice())),
        &[
            (
                "obvhs",
                Box::new(|r| r.iter().filter(|ray| obvhs.closest(ray)).count()),
            ),
            ("avx2", Box::new(|r| count_closest(&simd, r))),
            ("packet", Box::new(count_closest_packet)),
            ("scalar", Box::new(|r| count_closest(&scalar, r))),
        ],
    );

    let light = low + (high - low) * Vec3::new(0.52, 0.6, 0.49);
    let shadow: Vec<Ray> = views
        .iter()
        .map(|point| rays::shadow_ray_to_point(point, light))
        .collect();
    let any: Vec<Contestant> = vec![
        (
            "obvhs",
            Box::new(|r| r.iter().filter(|ray| obvhs.any(ray)).count()),
        ),
        ("avx2", Box::new(|r| count_any(&simd, r))),
        ("packet", Box::new(count_packet)),
        ("scalar", Box::new(|r| count_any(&scalar, r))),
    ];
    let both = ["any", "packet"];
    let file = embree::dump_rays(place.folder, scene, "shadow", &shadow);
    let by_embree = embree.as_mut().map(|embree| (embree, &file, both.as_slice()));
    compare(scene, "shadow, one light", &shadow, PART, by_embree, &any);

    let lights: Vec<SurfacePoint> = (0..LIGHTS).map(|_| views[random.below(views.len())]).collect();
    let many: Vec<Ray> = (0..(1 << 18) / LIGHTS)
        .map(|_| views[random.below(views.len())])
        .flat_map(|point| {
            lights
                .iter()
                .map(move |light| rays::shadow_ray(&point, light))
                .collect::<Vec<_>>()
        })
        .collect();
    let file = embree::dump_rays(place.folder, scene, "lights", &many);
    let by_embree = embree.as_mut().map(|embree| (embree, &file, both.as_slice()));
    compare(scene, "one point, 128 lights", &many, LIGHTS, by_embree, &any);
}

/// Prints the medians of interleaved rounds, one and two threads; Embree's in one, as kinds of rays from a file.
fn compare(
    scene: &str,
    name: &str,
    rays: &[Ray],
    part: usize,
    mut embree: Option<(&mut Embree, &PathBuf, &[&str])>,
    contestants: &[Contestant],
) {
    let wanted = wanted();
    if !wanted.is_empty()
        && !wanted
            .iter()
            .any(|w| format!("{scene} {name}").contains(w.as_str()))
    {
        return;
    }
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        let mut speeds = vec![Vec::new(); contestants.len()];
        let mut counts = vec![0; contestants.len()];
        let mut others: Vec<(String, usize, Vec<f64>)> = Vec::new();
        for round in 0..ROUNDS {
            if let (1, Some((embree, file, kinds))) = (threads, &mut embree) {
                if round == 0 {
                    // Reads the rays and builds the hierarchies.
                    for mode in ["fast", "robust"] {
                        for kind in *kinds {
                            let (hits, _) = embree.round(mode, kind, file);
                            others.push((format!("embree {mode} {kind}"), hits, Vec::new()));
                        }
                    }
                }
                let modes = ["fast", "robust"].into_iter();
                let rounds = modes.flat_map(|mode| kinds.iter().map(move |kind| (mode, kind)));
                for ((mode, kind), other) in rounds.zip(&mut others) {
                    let (_, seconds) = embree.round(mode, kind, file);
                    other.2.push(rays.len() as f64 / seconds * 1e-6);
                }
            }
            for (index, (_, cast)) in contestants.iter().enumerate() {
                let start = Instant::now();
                counts[index] = pool.install(|| rays.par_chunks(part).map(cast).sum::<usize>());
                speeds[index].push(rays.len() as f64 / start.elapsed().as_secs_f64() * 1e-6);
            }
        }
        let medians: Vec<f64> = speeds.iter_mut().map(|s| median(s)).collect();
        print!("{scene:<24}{name:<22}{threads:>8}");
        for (index, (contestant, _)) in contestants.iter().enumerate() {
            print!(
                "  {contestant} {:.2} ({:.2}x)",
                medians[index],
                medians[index] / medians[0]
            );
        }
        println!("   hits {:.1} %", 100.0 * counts[1] as f64 / rays.len() as f64);
        for (other, hits, mut speeds) in others {
            let speed = median(&mut speeds);
            println!(
                "{:<54}  {other} {speed:.2} ({:.2}x)   hits {:.1} %; best of ours {:.2} of it",
                "",
                speed / medians[0],
                100.0 * hits as f64 / rays.len() as f64,
                medians[1..].iter().copied().fold(0.0, f64::max) / speed,
            );
        }
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Where cameras stand within the scene's bounds.
const EYE: Vec3 = Vec3::new(0.47, 0.3, 0.51);

/// Rays of a camera of 640 × 360 pixels that looks along x: 16 through each of every fourth pixel.
fn camera(eye: Vec3) -> Vec<Ray> {
    let mut random = Random(2);
    let pixels = (0..360usize).flat_map(|y| (0..160usize).map(move |x| (4 * x, y)));
    pixels
        .flat_map(|(x, y)| {
            (0..16)
                .map(|_| {
                    let across = (x as f32 + random.unit()) / 320.0 - 1.0;
                    let down = (y as f32 + random.unit()) / 320.0 - 0.5625;
                    Ray::endless(eye, Vec3::new(1.0, -down, across))
                })
                .collect::<Vec<_>>()
        })
        .collect()
}

/// What six cameras in the middle of the scene see: surface points in tiles of 8 × 8 pixels, as a renderer visits them.
fn views(bvh: &TriangleBvh, width: usize) -> Vec<SurfacePoint> {
    let (low, high) = bvh.bounds().unwrap_or_default();
    let eye = low + (high - low) * EYE;
    let mut points = Vec::new();
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    for forward in axes {
        let right = Vec3::new(forward.y, forward.z, forward.x);
        let up = forward.cross(right);
        for tile in 0..(width / 8) * (width / 8) {
            for pixel in 0..64 {
                let x = tile % (width / 8) * 8 + pixel % 8;
                let y = tile / (width / 8) * 8 + pixel / 8;
                let screen = |i: usize| (i as f32 + 0.5) / width as f32 * 2.0 - 1.0;
                let direction = forward + right * screen(x) + up * screen(y);
                let ray = Ray {
                    origin: eye,
                    direction,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                if let Some(hit) = bvh.closest_hit(&ray) {
                    let mut point = rays::surface_point(bvh, &hit);
                    if point.normal.dot(direction) > 0.0 {
                        point.normal = -point.normal;
                    }
                    points.push(point);
                }
            }
        }
    }
    points
}

/// A hall of bumpy columns on a floor under a bumpy vault: about 300,000 triangles of uneven size.
fn procedural() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut grid = |columns: u32, rows: u32, place: &dyn Fn(f32, f32) -> Vec3| {
        let first = positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                positions.push(place(column as f32 / columns as f32, row as f32 / rows as f32));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let c = a + columns + 1;
                triangles.extend([[a, a + 1, c + 1], [a, c + 1, c]]);
            }
        }
    };
    grid(1, 1, &|u, v| Vec3::new(40.0 * u - 20.0, 0.0, 20.0 * v - 10.0));
    for side in [-1.0, 1.0] {
        grid(8, 4, &|u, v| Vec3::new(40.0 * u - 20.0, 12.0 * v, 10.0 * side));
        grid(4, 4, &|u, v| Vec3::new(20.0 * side, 12.0 * v, 20.0 * u - 10.0));
    }
    grid(300, 150, &|u, v| {
        let (x, z) = (40.0 * u - 20.0, 20.0 * v - 10.0);
        Vec3::new(
            x,
            12.0 + 2.0 * (x * 0.8).sin() * (z * 0.9).cos() + 0.1 * (x * 9.0).sin() * (z * 7.0).sin(),
            z,
        )
    });
    for column in 0..24 {
        let (x, z) = (
            (column % 12) as f32 * 3.2 - 17.6,
            if column < 12 { -5.0 } else { 5.0 },
        );
        grid(64, 64, &|u, v| {
            let angle = u * std::f32::consts::TAU;
            let radius = 0.5 + 0.05 * (angle * 12.0).cos() + 0.3 * (v * 12.0 - 6.0).abs().powi(2) / 36.0;
            Vec3::new(x + radius * angle.cos(), 12.0 * v, z + radius * angle.sin())
        });
    }
    (positions, triangles)
}

/// A small counter-based generator (SplitMix64): the same rays in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// A direction above a surface, uniform over the hemisphere.
    fn hemisphere(&mut self, normal: Vec3) -> Vec3 {
        let z = 1.0 - 2.0 * self.unit();
        let angle = self.unit() * std::f32::consts::TAU;
        let radius = (1.0 - z * z).max(0.0).sqrt();
        let direction = Vec3::new(radius * angle.cos(), radius * angle.sin(), z);
        if direction.dot(normal) < 0.0 {
            -direction
        } else {
            direction
        }
    }
}

/// World-space triangles of a self-contained glb with tightly described float positions and any index type.
fn read_glb(path: &Path) -> Option<(Vec<Vec3>, Vec<[u32; 3]>)> {
    let bytes = std::fs::read(path).ok()?;
    let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?) as usize);
    let json_length = word(12)?;
    let json: serde_json::Value = serde_json::from_slice(bytes.get(20..20 + json_length)?).ok()?;
    let binary = bytes.get(28 + json_length..)?;
    let number = |value: &serde_json::Value| value.as_u64().map(|n| n as usize);
    let accessor = |index: usize| {
        let accessor = &json["accessors"][index];
        let view = &json["bufferViews"][number(&accessor["bufferView"])?];
        let start = number(&view["byteOffset"]).unwrap_or(0) + number(&accessor["byteOffset"]).unwrap_or(0);
        Some((
            start,
            number(&accessor["count"])?,
            number(&accessor["componentType"])?,
            number(&view["byteStride"]),
        ))
    };
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let floats = |value: &serde_json::Value| -> Vec<f32> {
        value
            .as_array()
            .map(|a| a.iter().filter_map(|x| Some(x.as_f64()? as f32)).collect())
            .unwrap_or_default()
    };
    let scene = number(&json["scene"]).unwrap_or(0);
    let mut open: Vec<(usize, Mat4)> = json["scenes"][scene]["nodes"]
        .as_array()?
        .iter()
        .filter_map(|n| Some((number(n)?, Mat4::IDENTITY)))
        .collect();
    while let Some((index, world_from_parent)) = open.pop() {
        let node = &json["nodes"][index];
        let matrix = floats(&node["matrix"]);
        let local = if let Ok(columns) = <&[f32; 16]>::try_from(matrix.as_slice()) {
            Mat4::from_cols_array(columns)
        } else {
            let part = |name: &str, fallback: &[f32]| {
                let given = floats(&node[name]);
                if given.len() == fallback.len() {
                    given
                } else {
                    fallback.to_vec()
                }
            };
            Mat4::from_scale_rotation_translation(
                Vec3::from_slice(&part("scale", &[1.0; 3])),
                Quat::from_slice(&part("rotation", &[0.0, 0.0, 0.0, 1.0])),
                Vec3::from_slice(&part("translation", &[0.0; 3])),
            )
        };
        let world = world_from_parent * local;
        open.extend(
            node["children"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(|c| Some((number(c)?, world))),
        );
        let Some(mesh) = number(&node["mesh"]) else {
            continue;
        };
        for primitive in json["meshes"][mesh]["primitives"].as_array()? {
            let (start, count, _, stride) = accessor(number(&primitive["attributes"]["POSITION"])?)?;
            let first = positions.len() as u32;
            for vertex in 0..count {
                let at = start + vertex * stride.unwrap_or(12);
                let float = |i: usize| {
                    Some(f32::from_le_bytes(
                        binary.get(at + 4 * i..at + 4 * i + 4)?.try_into().ok()?,
                    ))
                };
                positions.push(world.transform_point3(Vec3::new(float(0)?, float(1)?, float(2)?)));
            }
            let indices: Vec<u32> = match number(&primitive["indices"]) {
                None => (0..count as u32).collect(),
                Some(index) => {
                    let (start, count, kind, _) = accessor(index)?;
                    // glTF component types: 5121 u8, 5123 u16, 5125 u32.
                    let size = match kind {
                        5121 => 1,
                        5123 => 2,
                        _ => 4,
                    };
                    let data = binary.get(start..start + count * size)?;
                    data.chunks_exact(size)
                        .map(|c| c.iter().rev().fold(0u32, |sum, byte| sum << 8 | u32::from(*byte)))
                        .collect()
                }
            };
            triangles.extend(
                indices
                    .chunks_exact(3)
                    .map(|t| [t[0] + first, t[1] + first, t[2] + first]),
            );
        }
    }
    Some((positions, triangles))
}
