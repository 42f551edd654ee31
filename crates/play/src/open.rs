//! Opening an asset: from its file to a scene that can be lit.

use crate::convert;
use crate::cuts::{CutLights, SurfaceSamples, VisibilityCuts};
use crate::prepared::PreparedScene;
use crate::snap::snapped;
use crate::transfer::Transfer;
use glam::Vec3;
use relight_format::layout::{Kind, setting};
use relight_format::{self as format, Asset, FormatError, Limits, Provenance};
use relight_scene::json::error::JsonError;
use relight_scene::scene::{Scene, Variant};
use relight_scene::sequence::{Sequence, stage_from_json};
use relight_scene::traced::{Shading, TracedScene, TracedSceneError};
use relight_transport::basis::{Level, NearestPoint};
use relight_transport::cuts::SiteCuts;
use relight_transport::light_tree::sphere_direction;
use relight_transport::links::Links;
use relight_transport::senders::SenderTree;
use relight_transport::sparse::{SparseMatrix, zero};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Why an asset cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be read, is damaged, or needs a newer relight.
    #[error("{}: {source}", file.display())]
    Format {
        /// The asset.
        file: PathBuf,
        /// What is wrong.
        source: FormatError,
    },
    /// Cameras and lights in it cannot be read.
    #[error("{}: {source}; bake it again", file.display())]
    Stage {
        /// The asset.
        file: PathBuf,
        /// What is wrong.
        source: JsonError,
    },
    /// The scene in it contradicts itself or has a damaged texture.
    #[error("{}: {source}; bake it again", file.display())]
    Scene {
        /// The asset.
        file: PathBuf,
        /// What is wrong.
        source: TracedSceneError,
    },
    /// Parts that belong together do not fit.
    #[error("{}: {message}; bake it again", file.display())]
    Mismatch {
        /// The asset.
        file: PathBuf,
        /// What does not fit.
        message: String,
    },
}

/// An asset that was opened.
pub(crate) struct Opened {
    /// Surfaces and operators.
    pub prepared: PreparedScene,
    /// Where the asset came from.
    pub provenance: Provenance,
    /// What the bake expects of its errors, if it said.
    pub estimates: Option<format::Estimates>,
}

/// What integrators need that trace the scene.
const SCENE: [Kind; 4] = [Kind::Geometry, Kind::Materials, Kind::Textures, Kind::Stage];

/// The operators, and what they work on.
const OPERATORS: [Kind; 6] = [
    Kind::Points,
    Kind::Separations,
    Kind::Senders,
    Kind::LinksTransfer,
    Kind::LinksBounce,
    Kind::LinksSolution,
];

/// What visibility cuts need besides, and expected errors.
const CUTS: [Kind; 3] = [Kind::Estimates, Kind::LightTree, Kind::Cuts];

/// Which sections of an asset are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sections {
    /// All that light needs.
    All,
    /// The scene alone, where no operators are needed ([`crate::choice::Integrator::needs_operators`]): they are most of the file.
    Scene,
}

/// Reads what is wanted of an asset.
pub(crate) fn read(path: &Path, sections: Sections) -> Result<Asset, OpenError> {
    match sections {
        Sections::All => read_kinds(path, &[&SCENE[..], &OPERATORS, &CUTS].concat()),
        Sections::Scene => read_kinds(path, &SCENE),
    }
}

fn read_kinds(path: &Path, kinds: &[Kind]) -> Result<Asset, OpenError> {
    format::read_parts(path, &Limits::default(), kinds).map_err(|source| OpenError::Format {
        file: path.to_path_buf(),
        source,
    })
}

/// Prepares what was read; `path` is for messages.
pub(crate) fn opened(mut asset: Asset, path: &Path, sections: Sections) -> Result<Opened, OpenError> {
    let file = || path.to_path_buf();
    let (cameras, sequence) = match asset.stage.json.as_str() {
        "" => Ok((Vec::new(), Sequence::default())),
        json => stage_from_json(json),
    }
    .map_err(|source| OpenError::Stage { file: file(), source })?;
    let offset = asset.provenance.offset().ok_or_else(|| OpenError::Mismatch {
        file: file(),
        message: "its setting offset is not three numbers".into(),
    })?;
    let transfer = match sections {
        Sections::All => transfer(&mut asset, path)?,
        Sections::Scene => None,
    };
    let mut materials: Vec<_> = asset.materials.into_iter().map(convert::material).collect();
    for extensions in asset.material_extensions {
        let index = extensions.material as usize;
        if let Some(material) = materials.get_mut(index) {
            material.extensions = Some(Box::new(convert::extensions(extensions)));
        }
    }
    for glass in asset.material_glass {
        if let Some(material) = materials.get_mut(glass.material as usize) {
            convert::glass(glass, material);
        }
    }
    let scene = Arc::new(Scene {
        meshes: convert::meshes(asset.geometry.meshes),
        object_names: object_names(&asset.provenance, asset.geometry.instances.len()),
        instances: (asset.geometry.instances.iter()).map(convert::instance).collect(),
        variants: variants(&asset.provenance, materials.len()),
        materials,
        textures: (asset.textures.into_iter().enumerate())
            .map(convert::texture)
            .collect(),
        cameras,
        sequence,
        offset: offset.into(),
        notes: Vec::new(),
    });
    let shading = if asset.provenance.lambert {
        Shading::Lambert
    } else {
        Shading::Full
    };
    let traced =
        TracedScene::new(scene, shading).map_err(|source| OpenError::Scene { file: file(), source })?;
    // Without points nothing is indirect, nor are there cuts.
    let cuts = (asset.light_tree.zip(asset.cuts).zip(transfer.as_ref()))
        .map(|((tree, cuts), transfer)| visibility(tree, cuts, &traced, transfer));
    Ok(Opened {
        prepared: PreparedScene::new(traced, transfer, cuts),
        provenance: asset.provenance,
        estimates: asset.estimates,
    })
}

/// Variants of an asset's materials, of which there are so many; none if what the asset says of them is wrong. SPEC 6.1.1.
pub fn variants(provenance: &Provenance, materials: usize) -> Vec<Variant> {
    let lines = provenance.setting(setting::VARIANTS);
    lines.map_or_else(Vec::new, |lines| convert::variants(lines, materials))
}

/// What the scene calls its instances. SPEC 6.1.1.
fn object_names(provenance: &Provenance, instances: usize) -> Vec<String> {
    let lines = provenance.setting(setting::OBJECTS).into_iter();
    let names: Vec<String> = lines
        .flat_map(|text| text.split('\n'))
        .map(str::to_owned)
        .collect();
    if names.len() == instances {
        names
    } else {
        Vec::new()
    }
}

/// The operators of an asset alone, which need no scene; `None` where it has no points.
///
/// # Errors
/// [`OpenError`].
pub fn load_operators(path: &Path) -> Result<Option<Transfer>, OpenError> {
    transfer(&mut read_kinds(path, &OPERATORS)?, path)
}

/// Hash that identifies the content of an asset's file, from its header alone.
///
/// # Errors
/// [`FormatError::Io`].
pub fn asset_hash(path: &Path) -> Result<u64, FormatError> {
    let mut header = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(format::layout::HEADER_BYTES).read_to_end(&mut header))
        .map_err(|source| FormatError::Io {
            action: "read",
            path: path.to_path_buf(),
            section: "header".into(),
            offset: 0,
            source,
        })?;
    Ok(format::content_hash(&header))
}

/// Takes the operators out of an asset; `None` where it has no points. `path` is for messages.
fn transfer(asset: &mut Asset, path: &Path) -> Result<Option<Transfer>, OpenError> {
    if asset.points.is_empty() {
        return Ok(None);
    }
    (prepared(asset).map(Some)).map_err(|message| OpenError::Mismatch {
        file: path.to_path_buf(),
        message,
    })
}

/// Reading has checked that the sections fit.
fn prepared(asset: &mut Asset) -> Result<Transfer, String> {
    let bounces = match asset.provenance.setting(setting::BOUNCES) {
        None | Some(setting::CONVERGED) => None,
        Some(n) => Some(
            n.parse()
                .map_err(|_| format!("setting bounces in provenance is {n:?}, not a number"))?,
        ),
    };
    let points = std::mem::take(&mut asset.points);
    let finest = &points[points.len() - 1];
    let albedo = vectors(&finest.albedo);
    let receivers: usize = points.iter().map(|l| l.positions.len()).sum();
    // An asset without indirect light has no senders: one that sends nothing does.
    let tree = match asset.senders.take() {
        Some(senders) => {
            let counts: Vec<usize> = senders.counts.iter().map(|&c| c as usize).collect();
            SenderTree::new(
                &counts,
                senders.leaf_of_point,
                senders.parents,
                senders.importance,
            )
        }
        None => SenderTree::new(&[1], vec![0; albedo.len()], Vec::new(), vec![0; albedo.len()]),
    };
    let links = match asset.transfer.take() {
        Some(links) => Links {
            receivers: links.receivers,
            senders: links.senders,
            row_offsets: links.row_offsets,
            columns: links.columns,
            vectors: links.vectors.into_iter().map(Vec3::from).collect(),
        },
        None => Links {
            receivers: receivers as u32,
            senders: tree.shares.len() as u32,
            row_offsets: vec![0; receivers + 1],
            ..Links::default()
        },
    };
    let (bounce_level, bounce) = match asset.bounce.take() {
        Some(bounce) => (bounce.level as usize, matrix(bounce.matrix)?),
        None => {
            let size = tree.ranges.range(0).len();
            (0, zero(size, size))
        }
    };
    let levels = points
        .iter()
        .map(|l| {
            Level::widened(
                vectors(&l.positions),
                vectors(&l.normals),
                l.widenings.clone(),
                l.disk_radius,
                l.support_radius,
            )
        })
        .collect();
    let separations = asset.separations.take().unwrap_or_default();
    let mut near_separated = match separations.near.is_empty() {
        true => Vec::new(),
        false => vec![false; albedo.len()],
    };
    for &point in &separations.near {
        near_separated[point as usize] = true;
    }
    let mut transfer = Transfer::new(
        levels,
        &separations.pairs,
        near_separated,
        tree,
        albedo,
        &links,
        bounce,
        bounce_level,
        bounces,
    );
    if let Some(solution) = asset.solution.take() {
        let channels = solution
            .channels
            .into_iter()
            .map(matrix)
            .collect::<Result<_, _>>()?;
        transfer.use_solution(solution.level as usize, channels);
    }
    Ok(transfer)
}

/// Cuts through the tree of an environment or of surface samples.
fn visibility(
    tree: format::LightTree,
    cuts: format::Cuts,
    scene: &TracedScene,
    transfer: &Transfer,
) -> VisibilityCuts {
    let unit = cuts.unit;
    let cuts = SiteCuts {
        offsets: cuts.row_offsets,
        heights: cuts.heights,
        values: cuts.values,
    };
    match tree.lights {
        format::LightSamples::Environment { order } => {
            let count = order.len() as u32;
            let directions: Vec<Vec3> = order.iter().map(|&i| sphere_direction(i, count)).collect();
            VisibilityCuts::of_directions(cuts, &directions)
        }
        format::LightSamples::Surface {
            area,
            positions,
            normals,
        } => {
            let (positions, normals) = (vectors(&positions), vectors(&normals));
            let hits = snapped(scene, &positions, &normals, area.sqrt());
            let nearest = NearestPoint::new(&transfer.finest);
            let unfound = |i: usize| {
                let point = nearest.at(positions[i], normals[i]);
                point.map_or(Vec3::ZERO, |p| transfer.albedo[p as usize])
            };
            let samples = SurfaceSamples::new(scene, area, &positions, hits, unit, unfound);
            VisibilityCuts {
                cuts,
                lights: CutLights::Surface(samples),
            }
        }
    }
}

/// An operator between clusters as a matrix.
///
/// # Errors
/// What is wrong with its rows; never with those of an asset that was read.
pub fn matrix(stored: format::WeightRows) -> Result<SparseMatrix, String> {
    let size = stored.rows as usize;
    SparseMatrix::try_new((size, size), stored.row_offsets, stored.columns, stored.weights)
        .map_err(|(.., error)| format!("links between clusters: {error}"))
}

fn vectors(values: &[[f32; 3]]) -> Vec<Vec3> {
    values.iter().copied().map(Vec3::from).collect()
}
