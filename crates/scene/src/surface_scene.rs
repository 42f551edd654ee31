//! Reader of `*.scene.json`: small scenes of boxes, implicit surfaces and isosurfaces (`data/README.md` specifies
//! the description). All surfaces are Lambertian.

#[cfg(test)]
mod tests;

use crate::animated::Animated;
use crate::camera::CameraTrack;
use crate::composite::{Composite, Part};
use crate::implicit::{ImplicitSurface, Sdf};
use crate::isosurface::{Isosurface, VolumeError};
use crate::material::Material;
use crate::scene::{Instance, Mesh, Scene};
use crate::sequence::Sequence;
use crate::traced::{Shading, TracedScene, TracedSceneError};
use glam::{Affine3A, DVec3, UVec3, Vec3};
use serde::Deserialize;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The version of the description that is read.
const VERSION: u32 = 1;
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
    /// The description is no JSON or not of this form.
    #[error("{file}: {source}; data/README.md specifies the form")]
    Form {
        /// Which file.
        file: PathBuf,
        /// What was found, with line and column.
        source: serde_json::Error,
    },
    /// A value makes no sense.
    #[error("{file}: {place}: {found}")]
    Value {
        /// Which file.
        file: PathBuf,
        /// Path of the value within it.
        place: String,
        /// What is wrong and what to do.
        found: String,
    },
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    relight_scene: u32,
    camera: CameraForm,
    #[serde(default)]
    boxes: Vec<BoxForm>,
    #[serde(default)]
    implicits: Vec<ImplicitForm>,
    #[serde(default)]
    volumes: Vec<VolumeForm>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraForm {
    position: [f32; 3],
    look_at: [f32; 3],
    up: [f32; 3],
    vfov_deg: f32,
    aspect: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxForm {
    name: String,
    min: [f32; 3],
    max: [f32; 3],
    albedo: [f32; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ImplicitForm {
    name: String,
    albedo: [f32; 3],
    bounds: [[f32; 3]; 2],
    sdf: SdfForm,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct VolumeForm {
    name: String,
    albedo: [f32; 3],
    file: String,
    size: [u32; 3],
    bounds: [[f32; 3]; 2],
    level: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
enum SdfForm {
    Sphere {
        center: [f64; 3],
        radius: f64,
    },
    Ellipsoid {
        center: [f64; 3],
        radii: [f64; 3],
    },
    Torus {
        center: [f64; 3],
        major: f64,
        minor: f64,
    },
    RoundedCylinder {
        center: [f64; 3],
        radius: f64,
        half_height: f64,
        rounding: f64,
    },
    Union {
        of: Vec<SdfForm>,
    },
    Intersection {
        of: Vec<SdfForm>,
    },
    Difference {
        of: Vec<SdfForm>,
    },
    SmoothUnion {
        k: f64,
        of: Vec<SdfForm>,
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
        parts.push(Part {
            name: "boxes".into(),
            primitives: traced.triangle_count() as u32,
            surfaces: Box::new(traced),
        });
    }
    let mut single = |name: String, surfaces| {
        parts.push(Part {
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
    let check = Checker { file: path };
    let surfaces = Composite::new(parts)
        .ok_or_else(|| check.error("boxes", "more than 2^32 primitives; leave some out"))?;
    Ok(SurfaceScene {
        surfaces,
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
    scene.materials.push(Material {
        name: name.to_owned(),
        base_color: albedo.extend(1.0),
        metallic: 0.0,
        ..Material::default()
    });
}

fn read(path: &Path) -> Result<Described, SurfaceSceneError> {
    let mut bytes = read_bounded(path, MAX_DESCRIPTION_BYTES)?;
    let description: Description =
        serde_json::from_slice(&bytes).map_err(|source| SurfaceSceneError::Form {
            file: path.into(),
            source,
        })?;
    let check = Checker { file: path };
    if description.relight_scene != VERSION {
        let found = format!(
            "version {}, this program reads {VERSION}",
            description.relight_scene
        );
        return Err(check.error("relight_scene", &found));
    }
    let camera = camera(&check, &description.camera)?;
    let boxes = boxes(&check, &description.boxes)?;
    let (mut implicits, mut volumes) = (Vec::new(), Vec::new());
    for (at, form) in description.implicits.into_iter().enumerate() {
        let place = format!("implicits[{at}] ('{}')", form.name);
        let bounds = check.bounds(&place, form.bounds)?;
        let albedo = check.albedo(&place, form.albedo)?;
        let sdf = sdf(&check, &format!("{place}.sdf"), &form.sdf)?;
        implicits.push((form.name, ImplicitSurface::new(sdf, bounds, albedo)));
    }
    for (at, form) in description.volumes.into_iter().enumerate() {
        let place = format!("volumes[{at}] ('{}')", form.name);
        let bounds = check.bounds(&place, form.bounds)?;
        let albedo = check.albedo(&place, form.albedo)?;
        let file = check.sibling(&place, &form.file)?;
        let samples = read_bounded(&file, MAX_VOLUME_BYTES)?;
        bytes.extend_from_slice(&samples);
        let surface = Isosurface::new(UVec3::from(form.size), samples, form.level, bounds, albedo)
            .map_err(|source| SurfaceSceneError::Volume { file, source })?;
        volumes.push((form.name, surface));
    }
    Ok(Described {
        camera,
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

/// Checks values and names their place in errors.
struct Checker<'a> {
    file: &'a Path,
}

impl Checker<'_> {
    fn error(&self, place: &str, found: &str) -> SurfaceSceneError {
        SurfaceSceneError::Value {
            file: self.file.into(),
            place: place.into(),
            found: found.into(),
        }
    }

    fn bounds(&self, place: &str, [low, high]: [[f32; 3]; 2]) -> Result<(Vec3, Vec3), SurfaceSceneError> {
        let (low, high) = (Vec3::from(low), Vec3::from(high));
        // NaN fails the comparison.
        if low.cmplt(high).all() && low.is_finite() && high.is_finite() {
            return Ok((low, high));
        }
        let found =
            format!("from {low} to {high}: the second corner must be above the first along each axis");
        Err(self.error(place, &found))
    }

    fn albedo(&self, place: &str, albedo: [f32; 3]) -> Result<Vec3, SurfaceSceneError> {
        let albedo = Vec3::from(albedo);
        if albedo.cmpge(Vec3::ZERO).all() && albedo.cmple(Vec3::ONE).all() {
            return Ok(albedo);
        }
        Err(self.error(
            &format!("{place}.albedo"),
            &format!("{albedo}: give three numbers from 0 to 1"),
        ))
    }

    fn finite(&self, place: &str, value: [f32; 3]) -> Result<Vec3, SurfaceSceneError> {
        let value = Vec3::from(value);
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.error(place, "not finite: give three numbers"))
    }

    fn positive(&self, place: &str, key: &str, value: f64) -> Result<f64, SurfaceSceneError> {
        if value > 0.0 && value.is_finite() {
            return Ok(value);
        }
        Err(self.error(
            &format!("{place}.{key}"),
            &format!("{value}: give a length above 0"),
        ))
    }

    /// A file beside the description; nothing outside its folder can be named.
    fn sibling(&self, place: &str, name: &str) -> Result<PathBuf, SurfaceSceneError> {
        let relative = Path::new(name);
        let inside = relative
            .components()
            .all(|component| matches!(component, std::path::Component::Normal(_)));
        if name.is_empty() || !inside {
            let found = format!("'{name}': name a file in the description's own folder or below it");
            return Err(self.error(&format!("{place}.file"), &found));
        }
        Ok(self.file.parent().unwrap_or(Path::new("")).join(relative))
    }
}

fn camera(check: &Checker<'_>, form: &CameraForm) -> Result<CameraTrack, SurfaceSceneError> {
    if !(form.vfov_deg > 0.0 && form.vfov_deg < 180.0) {
        let found = format!("{}: give an angle between 0 and 180 degrees", form.vfov_deg);
        return Err(check.error("camera.vfov_deg", &found));
    }
    if !(form.aspect > 0.0 && form.aspect.is_finite()) {
        return Err(check.error(
            "camera.aspect",
            &format!("{}: give width over height", form.aspect),
        ));
    }
    Ok(CameraTrack {
        name: "Camera".into(),
        position: Animated::Constant(check.finite("camera.position", form.position)?),
        look_at: Animated::Constant(check.finite("camera.look_at", form.look_at)?),
        up: Animated::Constant(check.finite("camera.up", form.up)?),
        vfov_deg: Animated::Constant(form.vfov_deg),
        aspect: Some(form.aspect),
    })
}

fn sdf(check: &Checker<'_>, place: &str, form: &SdfForm) -> Result<Sdf, SurfaceSceneError> {
    let point = |center: &[f64; 3]| {
        let center = DVec3::from(*center);
        if center.is_finite() {
            return Ok(center);
        }
        Err(check.error(&format!("{place}.center"), "not finite: give three numbers"))
    };
    let children = |of: &[SdfForm]| -> Result<Vec<Sdf>, SurfaceSceneError> {
        if of.is_empty() {
            return Err(check.error(&format!("{place}.of"), "empty: give at least one shape"));
        }
        of.iter()
            .enumerate()
            .map(|(at, child)| sdf(check, &format!("{place}.of[{at}]"), child))
            .collect()
    };
    let positive = |key, value| check.positive(place, key, value);
    Ok(match form {
        SdfForm::Sphere { center, radius } => Sdf::Sphere {
            center: point(center)?,
            radius: positive("radius", *radius)?,
        },
        SdfForm::Ellipsoid { center, radii } => {
            for &radius in radii {
                positive("radii", radius)?;
            }
            Sdf::Ellipsoid {
                center: point(center)?,
                radii: DVec3::from(*radii),
            }
        }
        SdfForm::Torus { center, major, minor } => Sdf::Torus {
            center: point(center)?,
            major: positive("major", *major)?,
            minor: positive("minor", *minor)?,
        },
        SdfForm::RoundedCylinder {
            center,
            radius,
            half_height,
            rounding,
        } => {
            let least = positive("radius", *radius)?.min(positive("half_height", *half_height)?);
            if !(0.0..=least).contains(rounding) {
                let found = format!("{rounding}: give a length from 0 to {least}, radius and half height");
                return Err(check.error(&format!("{place}.rounding"), &found));
            }
            Sdf::RoundedCylinder {
                center: point(center)?,
                radius: *radius,
                half_height: *half_height,
                rounding: *rounding,
            }
        }
        SdfForm::Union { of } => Sdf::Union(children(of)?),
        SdfForm::Intersection { of } => Sdf::Intersection(children(of)?),
        SdfForm::Difference { of } => Sdf::Difference(children(of)?),
        SdfForm::SmoothUnion { k, of } => Sdf::SmoothUnion {
            width: positive("k", *k)?,
            of: children(of)?,
        },
    })
}

/// All boxes as one scene.
fn boxes(check: &Checker<'_>, forms: &[BoxForm]) -> Result<Scene, SurfaceSceneError> {
    let mut scene = Scene {
        meshes: Vec::new(),
        instances: Vec::new(),
        materials: Vec::new(),
        textures: Vec::new(),
        cameras: Vec::new(),
        sequence: Sequence {
            frames: 1,
            fps: 24.0,
            camera: None,
            lights: Vec::new(),
        },
        notes: Vec::new(),
    };
    for (at, form) in forms.iter().enumerate() {
        let place = format!("boxes[{at}] ('{}')", form.name);
        let (low, high) = check.bounds(&place, [form.min, form.max])?;
        let albedo = check.albedo(&place, form.albedo)?;
        push(&mut scene, &form.name, albedo, |material| {
            box_mesh(low, high, material)
        });
    }
    Ok(scene)
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
