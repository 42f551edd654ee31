//! Reader of `*.scene.json`: small scenes of boxes, implicit surfaces and isosurfaces (`data/README.md` specifies
//! the description). All surfaces are Lambertian.

mod description;
#[cfg(test)]
mod tests;

use crate::camera::CameraTrack;
use crate::composite::{Composite, CompositeSurface};
use crate::implicit::{ImplicitSurface, Sdf};
use crate::isosurface::{Isosurface, VolumeError};
use crate::json::decode::{Document, decoded};
use crate::json::error::JsonError;
use crate::json::path::JsonPath;
use crate::json::quantity::{Fixed, Position};
use crate::material::Material;
use crate::scene::{Instance, Mesh, Scene};
use crate::traced::{Shading, TracedScene, TracedSceneError};
pub(crate) use description::Description;
use glam::{Affine3A, UVec3, Vec3};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest description, bytes. It is written by hand or by a small script.
const MAX_DESCRIPTION_BYTES: u64 = 16 << 20;
/// Largest volume file, bytes; [`Isosurface::new`] allows no more samples.
const MAX_VOLUME_BYTES: u64 = 1 << 28;

/// A scene of surfaces that need not be triangles.
pub struct SurfaceScene {
    /// All surfaces: the boxes together as one part named "boxes", then each implicit surface, then each volume.
    pub surfaces: Composite,
    /// Its camera.
    pub camera: CameraTrack,
}

/// Why a description cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SurfaceSceneError {
    /// A file cannot be read.
    #[error("{file}: {source}")]
    Io {
        /// Which file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A file is larger than any sensible one.
    #[error("{file} has more than {limit} bytes; make it smaller")]
    TooLarge {
        /// Which file.
        file: PathBuf,
        /// Most bytes that are read.
        limit: u64,
    },
    /// More surfaces than 32-bit numbers can tell apart.
    #[error("{file}: more than 2^32 primitives; leave some out")]
    TooMany {
        /// Which file.
        file: PathBuf,
    },
    /// The description is no JSON, not of this form, or has a value that makes no sense.
    #[error("{0}; data/README.md specifies the form")]
    Description(#[from] JsonError),
    /// A volume cannot be traced.
    #[error("{file}: {source}")]
    Volume {
        /// The volume's file.
        file: PathBuf,
        /// What is wrong.
        source: VolumeError,
    },
    /// The boxes cannot be traced.
    #[error("{file}: boxes: {source}")]
    Boxes {
        /// Which file.
        file: PathBuf,
        /// What is wrong.
        source: TracedSceneError,
    },
}

/// What a description describes.
struct Described {
    camera: CameraTrack,
    boxes: Scene,
    implicits: Vec<(String, ImplicitSurface)>,
    volumes: Vec<(String, Isosurface)>,
    /// All that was read, one file after the other.
    bytes: Vec<u8>,
}

/// Reads a description and the volumes it names, relative to its own place.
///
/// # Errors
/// See [`SurfaceSceneError`]; unknown keys are errors, so that typos cannot pass.
pub fn read_surface_scene(path: &Path) -> Result<SurfaceScene, SurfaceSceneError> {
    let described = read(path)?;
    let mut parts = Vec::new();
    if !described.boxes.meshes.is_empty() {
        let traced = TracedScene::new(Arc::new(described.boxes), Shading::Lambert).map_err(|source| {
            SurfaceSceneError::Boxes {
                file: path.into(),
                source,
            }
        })?;
        parts.push(CompositeSurface {
            name: "boxes".into(),
            primitives: traced.triangle_count() as u32,
            surfaces: Box::new(traced),
        });
    }
    let mut single = |name: String, surfaces| {
        parts.push(CompositeSurface {
            name,
            surfaces,
            primitives: 1,
        });
    };
    for (name, surface) in described.implicits {
        single(name, Box::new(surface));
    }
    for (name, surface) in described.volumes {
        single(name, Box::new(surface));
    }
    Ok(SurfaceScene {
        surfaces: Composite::new(parts).ok_or_else(|| SurfaceSceneError::TooMany { file: path.into() })?,
        camera: described.camera,
    })
}

/// Reads a description as [`read_surface_scene`] does and makes triangles of all surfaces. Returns the bytes of all its
/// files, too, one after the other.
///
/// # Errors
/// See [`SurfaceSceneError`].
pub fn read_meshed(path: &Path) -> Result<(Scene, Vec<u8>), SurfaceSceneError> {
    let described = read(path)?;
    let mut scene = described.boxes;
    for (name, surface) in &described.implicits {
        push(&mut scene, name, surface.color(), |material| {
            surface.mesh(material)
        });
    }
    for (name, surface) in &described.volumes {
        push(&mut scene, name, surface.color(), |material| {
            surface.mesh(material)
        });
    }
    scene.cameras = vec![described.camera];
    Ok((scene, described.bytes))
}

/// Adds a matt mesh where it stands.
fn push(scene: &mut Scene, name: &str, albedo: Vec3, mesh: impl FnOnce(u32) -> Mesh) {
    let index = scene.meshes.len() as u32;
    scene.meshes.push(mesh(index));
    scene.instances.push(Instance {
        mesh: index,
        world_from_mesh: Affine3A::IDENTITY,
    });
    scene
        .object_names
        .resize(scene.instances.len() - 1, String::new());
    scene.object_names.push(name.to_owned());
    scene.materials.push(Material {
        name: name.to_owned(),
        base_color: albedo.extend(1.0),
        metallic: 0.0,
        ..Material::default()
    });
}

fn read(path: &Path) -> Result<Described, SurfaceSceneError> {
    let mut bytes = read_bounded(path, MAX_DESCRIPTION_BYTES)?;
    // What is no text is told by the reader of JSON.
    let text = decoded(bytes.clone()).unwrap_or_else(|| String::from_utf8_lossy(&bytes).into_owned());
    let check = Checker {
        file: path,
        document: Document {
            name: &path.display().to_string(),
            text: &text,
        },
    };
    let root = JsonPath::default();
    let description: Description = check.document.decode(&text, &root)?;
    let mut boxes = Scene::default();
    for (at, form) in description.boxes.iter().enumerate() {
        let path = root.key("boxes").index(at).key("max");
        let (low, high) = check.bounds(&path, &form.min, &form.max)?;
        push(&mut boxes, &form.name, form.albedo.0, |material| {
            box_mesh(low, high, material)
        });
    }
    let (mut implicits, mut volumes) = (Vec::new(), Vec::new());
    for (at, form) in description.implicits.into_iter().enumerate() {
        let path = root.key("implicits").index(at);
        let bounds = check.bounds(&path.key("bounds"), &form.bounds[0], &form.bounds[1])?;
        check.roundings(&path.key("sdf"), &form.sdf)?;
        implicits.push((form.name, ImplicitSurface::new(form.sdf, bounds, form.albedo.0)));
    }
    for (at, form) in description.volumes.into_iter().enumerate() {
        let path = root.key("volumes").index(at);
        let bounds = check.bounds(&path.key("bounds"), &form.bounds[0], &form.bounds[1])?;
        let file = check.sibling(&path.key("file"), &form.file)?;
        let samples = read_bounded(&file, MAX_VOLUME_BYTES)?;
        bytes.extend_from_slice(&samples);
        let size = UVec3::from(form.size);
        let surface = Isosurface::new(size, samples, form.level, bounds, form.albedo.0)
            .map_err(|source| SurfaceSceneError::Volume { file, source })?;
        volumes.push((form.name, surface));
    }
    Ok(Described {
        camera: CameraTrack {
            name: "Camera".into(),
            ..description.camera
        },
        boxes,
        implicits,
        volumes,
        bytes,
    })
}

fn read_bounded(file: &Path, limit: u64) -> Result<Vec<u8>, SurfaceSceneError> {
    let io = |source| SurfaceSceneError::Io {
        file: file.into(),
        source,
    };
    let mut bytes = Vec::new();
    let mut reader = std::fs::File::open(file).map_err(io)?.take(limit + 1);
    reader.read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > limit {
        return Err(SurfaceSceneError::TooLarge {
            file: file.into(),
            limit,
        });
    }
    Ok(bytes)
}

/// Checks what types do not say.
struct Checker<'a> {
    file: &'a Path,
    document: Document<'a>,
}

impl Checker<'_> {
    fn bounds(
        &self,
        path: &JsonPath,
        Fixed(low): &Fixed<Position>,
        Fixed(high): &Fixed<Position>,
    ) -> Result<(Vec3, Vec3), JsonError> {
        if low.cmplt(*high).all() {
            return Ok((*low, *high));
        }
        let message =
            format!("from {low} to {high}: the second corner must be above the first along each axis");
        Err(self.document.error(path, message))
    }

    /// A file beside the description; nothing outside its folder can be named.
    fn sibling(&self, path: &JsonPath, name: &str) -> Result<PathBuf, JsonError> {
        let relative = Path::new(name);
        let inside = relative
            .components()
            .all(|component| matches!(component, std::path::Component::Normal(_)));
        if name.is_empty() || !inside {
            let message = format!("'{name}': name a file in the description's own folder or below it");
            return Err(self.document.error(path, message));
        }
        Ok(self.file.parent().unwrap_or(Path::new("")).join(relative))
    }

    /// Refuses cylinders whose edges are rounder than they are thick.
    fn roundings(&self, path: &JsonPath, sdf: &Sdf) -> Result<(), JsonError> {
        let (key, of) = match sdf {
            Sdf::RoundedCylinder {
                radius,
                half_height,
                rounding,
                ..
            } => {
                let most = radius.min(*half_height);
                if *rounding <= most {
                    return Ok(());
                }
                let message =
                    format!("expected a number from 0 to {most} (radius and half height), found {rounding}");
                let path = path.key("rounded_cylinder").key("rounding");
                return Err(self.document.error(&path, message));
            }
            Sdf::Union(of) => ("union", of),
            Sdf::Intersection(of) => ("intersection", of),
            Sdf::Difference(of) => ("difference", of),
            Sdf::SmoothUnion { of, .. } => ("smooth_union", of),
            Sdf::Sphere { .. } | Sdf::Ellipsoid { .. } | Sdf::Torus { .. } => return Ok(()),
        };
        let path = path.key(key).key("of");
        (of.iter().enumerate()).try_for_each(|(at, child)| self.roundings(&path.index(at), child))
    }
}

/// Twelve triangles that face outwards.
fn box_mesh(low: Vec3, high: Vec3, material: u32) -> Mesh {
    // Corner k: bit 0 chooses x, bit 1 y, bit 2 z.
    let positions = (0..8u32)
        .map(|k| {
            let upper = Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32);
            Vec3::select(upper.cmpgt(Vec3::ZERO), high, low)
        })
        .collect();
    // Counter-clockwise seen from outside: -x, +x, -y, +y, -z, +z.
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = faces
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    Mesh {
        positions,
        triangles,
        material,
        ..Mesh::default()
    }
}
