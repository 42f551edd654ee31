//! Import of glTF 2.0 scenes (feature `gltf`).
//!
//! Implements the Khronos glTF 2.0 specification with KHR_draco_mesh_compression, KHR_lights_punctual,
//! KHR_materials_emissive_strength, KHR_materials_pbrSpecularGlossiness (converted), KHR_materials_unlit,
//! KHR_materials_variants, KHR_mesh_quantization, KHR_meshopt_compression, KHR_node_visibility, KHR_texture_basisu, KHR_texture_ktx,
//! KHR_texture_transform, EXT_lights_area, EXT_lights_ies, EXT_lights_image_based, EXT_mesh_gpu_instancing, EXT_meshopt_compression, EXT_texture_webp and, for lights and cameras,
//! KHR_animation_pointer. Skins and morph targets are posed at rest. docs/import.md has the whole table.
//!
//! **Anybody may have written the file.** Every index, range, count and type is checked against the JSON and
//! the real bytes before anything is decoded or allocated; all faults of a stage are reported together, each
//! with its JSON path, but for those in parts that nothing shown uses: they are noted. The `gltf` crate, which panics or silently drops geometry on many malformed files,
//! decodes accessors of a document rebuilt from what was checked, and sees nothing else. Other files are read
//! only from the scene's own folder.
//!
//! **Coordinates.** Node transforms are multiplied in f64. A scene that lies far from its origin for its size is moved to its
//! own middle (`middle`), which [`Scene::offset`] and a note say.
//!
//! **Left out, with a note in [`Scene::notes`]:** points and lines, orthographic cameras, animation of meshes, skins and morph targets,
//! triangles with vertices that are not finite, the range of lights. Occlusion textures are left out without
//! one: relight computes occlusion. What the specification forbids but can only mean one thing is accepted:
//! quaternions that are not quite of unit length, factors slightly out of range, an incomplete last triangle,
//! vertex colours of plain integers, nodes on several paths, strides of 0, empty accessors, `null` for absent, names in
//! Latin-1, chunks without padding; all but the commonest with a note.
//!
//! The way of the data: `container` splits the file, `mend` makes JSON of it, `list` holds entries, `layout`, `materials`,
//! `nodes`, `primitives`, `instancing` and `animation` read and check, `accessors`, `meshopt`, `draco` and `basis` decode, `geometry`,
//! `deform`, `specgloss`, `tracks`, `image_light` and `cube_map` build the scene.

mod accessors;
mod animation;
mod area_lights;
mod basis;
mod component;
mod container;
mod cube_map;
mod deform;
mod draco;
mod duplicates;
mod error;
mod extensions;
mod geometry;
mod guard;
mod ies;
mod image_light;
mod instancing;
mod json;
mod ktx;
mod layout;
mod list;
mod material_numbers;
mod materials;
mod mend;
mod meshopt;
mod middle;
mod nodes;
mod notes;
mod primitives;
mod refined;
mod specgloss;
mod texture_use;
mod tracks;
mod units;
mod uri;
mod variants;

pub use error::{Fault, ImportError, MAX_FAULTS, UnsupportedExtension};
pub use units::{EMISSIVE, FPS, LightUnits};

use crate::animated::Animated;
use crate::light::{LightKind, LightTrack};
use crate::material::Material;
use crate::scene::{Mesh, Scene, Variant, replacements, shown_as};
use crate::sequence::Sequence;
use glam::{DVec3, Vec2, Vec3};
use json::{At, Faults};
use material_numbers::MaterialNumbers;
use notes::Notes;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// How often a scene is moved nearer to its middle.
const MOST_MOVES: usize = 3;

/// What the file itself does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImportOptions {
    /// Units of light intensities.
    pub light_units: LightUnits,
    /// Name of the variant of materials that is shown (KHR_materials_variants); `None` for those without a variant.
    pub variant: Option<String>,
}

/// Imports the scene of a `.glb` or `.gltf` file: meshes once per different primitive, instances in the order
/// of the nodes, perspective cameras, and the scene's own lights as a sequence with [`FPS`] frames per second
/// that ends with the last key of a light or camera.
///
/// # Errors
/// See [`ImportError`]; never a panic.
pub fn import(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    catch_unwind(AssertUnwindSafe(|| import_shown(path, options))).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
        Err(ImportError::Internal {
            file: path.into(),
            message: text.unwrap_or_else(|| "it panicked".into()),
        })
    })
}

/// Leaves variants of materials out where they are what keeps the scene from being shown without them.
fn import_shown(path: &Path, options: &ImportOptions) -> Result<Scene, ImportError> {
    let mut varied = false;
    let scene = import_checked(path, options, true, &mut varied);
    match scene {
        Err(error) if varied => {
            let mut scene = import_checked(path, options, false, &mut varied)?;
            (scene.notes).push(format!("variants of materials are left out ({error})"));
            Ok(scene)
        }
        scene => scene,
    }
}

/// `keep`: whether variants of materials are kept that none is chosen of; `varied`: becomes whether there are any.
fn import_checked(
    path: &Path,
    options: &ImportOptions,
    keep: bool,
    varied: &mut bool,
) -> Result<Scene, ImportError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let (faults, mut notes) = (Faults::default(), Notes::default());
    let mut container = container::read(path, &mut notes)?;
    let streams = draco::unfold(&mut container.json);
    let root = At::root(&container.json, &faults);
    check_version(&root);
    faults.finish(path)?;
    let extensions = extensions::check(&root, &mut notes);
    if !extensions.is_empty() {
        return Err(ImportError::UnsupportedExtensions {
            file: path.into(),
            extensions,
        });
    }

    let layout = layout::Layout::parse(&root, container.bin.is_some(), streams, &mut notes);
    let variants = variants::Variants::parse(&root, path, options.variant.as_deref(), keep, &mut notes)?;
    let source = materials::Materials::parse(&root, &layout, &mut notes);
    let meshes = primitives::parse(&root, &layout, source.materials.len(), &variants, &mut notes);
    let profiles = ies::Profiles::parse(&root, &layout);
    let image_lights = image_light::ImageLights::parse(&root, source.images.len(), &mut notes);
    let mut graph = nodes::Graph::parse(&root, &layout, meshes.len(), &profiles, &mut notes);
    let skins = deform::parse_skins(&root, &layout, &graph, &mut notes);
    let glossy = specgloss::parse(&root, &source);
    // Asking for what is shown reports what is wrong with it.
    let mut used = vec![false; source.materials.len()];
    for mesh in graph.order.iter().filter_map(|&i| graph.nodes[i].mesh) {
        for (primitive, _) in meshes.get(mesh, &faults).into_iter().flatten() {
            if let Some(material) = primitive.material {
                source.materials.get(material, &faults);
                glossy.get(material, &faults);
                used[material] = true;
            }
        }
    }
    let default_material = used.len() as u32;
    let shown = (graph.order.iter())
        .filter_map(|&i| meshes.peek(graph.nodes[i].mesh?))
        .flatten();
    let numbers = MaterialNumbers::new(shown.map(|(primitive, _)| primitive), default_material);
    for material in numbers.replacements() {
        *varied = true;
        source.materials.get(material, &faults);
        glossy.get(material, &faults);
        used[material] = true;
    }
    meshes.note_unused(&mut notes);
    let channels = animation::parse(&root, &layout, &graph, &mut notes);
    animation::note_moving_meshes(&graph, &channels, &mut notes);
    faults.finish(path)?;

    let bin = container.bin.clone().map(|range| &container.bytes[range]);
    let buffers = accessors::load_buffers(&layout, bin, folder);
    let data = accessors::Data::new(path, &layout, &buffers, &faults)?;

    let mut materials: Vec<Material> = (0..used.len())
        .map(|i| source.materials.peek(i).cloned().unwrap_or_default())
        .collect();
    specgloss::set_factors(&glossy, &mut materials, &mut notes);
    let build = |graph: &nodes::Graph, notes: &mut Notes| {
        geometry::build(&data, &meshes, graph, &skins, &numbers, &faults, notes)
    };
    let mut geometry = build(&graph, &mut notes);
    // Once is enough up to some ten million sizes; beyond, the first answer is as coarse as what it is to mend.
    for _ in 0..MOST_MOVES {
        let away = middle::far_middle(&geometry.meshes, &geometry.instances);
        if away == DVec3::ZERO {
            break;
        }
        graph.offset += away;
        geometry = build(&graph, &mut Notes::default());
    }
    if graph.offset != DVec3::ZERO {
        let [x, y, z] = graph.offset.to_array();
        notes.say(format!(
            "the scene lies far from its origin and is moved by ({x}, {y}, {z}), so that 32-bit numbers can tell its parts; \
             cameras and lights of sequences are given in the file's coordinates"
        ));
    }
    if geometry
        .meshes
        .iter()
        .any(|mesh| mesh.material == default_material)
    {
        materials.push(Material::default());
    }
    used.push(true);
    let mut textures =
        materials::load_textures(&source, &mut materials, &used, &data, folder, &faults, &mut notes);
    specgloss::convert(
        &glossy,
        &source,
        &mut materials,
        &used,
        &mut textures,
        &data,
        folder,
        &faults,
        &mut notes,
    );
    let environment = image_lights.load(&source, &data, folder, &faults, &mut notes);
    image_lights.note_unused(&mut notes);
    source.note_unused(&mut notes);
    numbers.append_copies(&mut materials);
    let variants = numbers.variants(variants.names());
    let lamps: Vec<usize> = (graph.order.iter())
        .filter_map(|&i| Some(graph.nodes[i].lamp?.profile))
        .collect();
    let loaded = profiles.load(|i| lamps.contains(&i), &data, folder, &faults, &mut notes);
    profiles.note_unused(&mut notes);
    layout.note_unused(&mut notes);
    let curves = animation::decode(&graph, &channels, &data, &faults);
    let tracks = tracks::build(
        &graph,
        &curves,
        options.light_units,
        (&profiles, &loaded),
        &faults,
        &mut notes,
    );
    faults.finish(path)?;
    add_missing_uvs(&mut geometry, &materials, &variants, &mut notes);
    if geometry.instances.is_empty() {
        let why = notes.into_sentences().join("; ");
        let why = if why.is_empty() {
            "no node of the scene shows a mesh".to_owned()
        } else {
            why
        };
        return Err(ImportError::NoGeometry {
            file: path.into(),
            message: format!("there is no triangle to light ({why}); export the scene with its meshes"),
        });
    }
    note_open_glass(&geometry.meshes, &materials, &mut notes);
    let mut lights = tracks.lights;
    if let Some((name, kind)) = environment {
        let name = tracks::free_name(&name, &lights);
        lights.push(LightTrack { name, kind });
    }
    let emits = |m: &Material| m.emission != Vec3::ZERO || m.unlit;
    let replacements = replacements(&variants);
    let shown = |mesh: &Mesh| shown_as(mesh.material, &replacements);
    if (geometry.meshes.iter().flat_map(shown)).any(|material| emits(&materials[material as usize])) {
        lights.push(LightTrack {
            name: EMISSIVE.to_owned(),
            kind: LightKind::Emissive {
                material: None,
                scale: Animated::Constant(Vec3::ONE),
            },
        });
    }
    Ok(Scene {
        meshes: geometry.meshes,
        instances: geometry.instances,
        object_names: geometry.names,
        materials,
        variants,
        textures,
        cameras: tracks.cameras,
        sequence: Sequence {
            frames: tracks.frames,
            fps: FPS,
            camera: None,
            lights,
        },
        offset: graph.offset,
        notes: notes.into_sentences(),
    })
}

/// Reports anything but glTF 2.x that a reader of 2.0 may read.
fn check_version(root: &At) {
    if !root.value.is_object() {
        root.fault_at("(root)", "must be an object; this is no glTF file");
        return;
    }
    let Some(asset) = root.object("asset") else {
        root.fault_at("asset", "is missing: this is no glTF 2.0 file");
        return;
    };
    match asset.text("version") {
        Some(version) if version.starts_with("2.") => {}
        Some(version) => {
            let short: String = version.chars().take(20).collect();
            asset.fault_at("version", format!("is \"{short}\"; export the scene as glTF 2.0"));
        }
        None if asset.get("version").is_none() => asset.fault_at("version", "is missing; it must be \"2.0\""),
        None => {}
    }
    if let Some(least) = asset.text("minVersion")
        && least != "2.0"
    {
        let short: String = least.chars().take(20).collect();
        asset.fault_at("minVersion", format!("is \"{short}\", but only glTF 2.0 is read"));
    }
}

/// Notes solid glass whose mesh bounds no body: nothing says where light comes out of it.
fn note_open_glass(meshes: &[Mesh], materials: &[Material], notes: &mut Notes) {
    let solid = |mesh: &&Mesh| materials[mesh.material as usize].is_solid_glass();
    let open = meshes
        .iter()
        .filter(solid)
        .filter(|mesh| !mesh.is_closed())
        .count();
    notes.count(
        "meshes of solid glass that are not closed, which bend no light and absorb by thicknessFactor",
        open as u64,
    );
}

/// Gives meshes the sets of coordinates that their materials look up, so that no one has to ask again.
fn add_missing_uvs(
    geometry: &mut geometry::Geometry,
    materials: &[Material],
    variants: &[Variant],
    notes: &mut Notes,
) {
    let replacements = replacements(variants);
    for mesh in &mut geometry.meshes {
        let shown = shown_as(mesh.material, &replacements);
        let sets = shown.map(|material| materials[material as usize].uv_sets() as usize);
        let needed = sets.max().unwrap_or(0);
        if needed > mesh.uvs.len() {
            notes.count(
                "textured meshes without the texture coordinates they need, which are taken as 0",
                1,
            );
            mesh.uvs.resize(needed, vec![Vec2::ZERO; mesh.positions.len()]);
        }
    }
}
