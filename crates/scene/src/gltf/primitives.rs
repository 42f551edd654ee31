//! Mesh primitives as the JSON has them (glTF 2.0, section 3.7.2): attributes and indices checked for type,
//! width and count before anything is decoded.

use super::component::Component;
use super::draco;
use super::json::At;
use super::layout::{Accessor, Layout};
use super::list::List;
use super::notes::Notes;
use super::texture_use::MAX_UV_SETS;
use super::variants::Variants;

/// Elements of an accessor that no bytes stand behind (zeros, some of them replaced): such attributes are
/// rare and small, and nothing else bounds them.
const MAX_UNBACKED: usize = 1 << 22;

/// How vertices are joined to triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Mode {
    Triangles,
    Strip,
    Fan,
}

/// A checked primitive: every number is an accessor of the right type and, for attributes, of the same
/// count. Two equal ones are the same mesh.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Primitive {
    pub mode: Mode,
    pub positions: usize,
    pub normals: Option<usize>,
    pub tangents: Option<usize>,
    /// By set; `None` for a set that is missing below another one.
    pub uvs: Vec<Option<usize>>,
    pub colors: Option<usize>,
    /// JOINTS_n and WEIGHTS_n by set.
    pub joints: Vec<(usize, usize)>,
    pub targets: Vec<MorphTarget>,
    /// The mesh's weights of the targets, as bits of f32.
    pub weights: Vec<u32>,
    pub indices: Option<usize>,
    pub material: Option<usize>,
    /// Variants that put another material in its place, rising, and which.
    pub variants: Vec<(usize, usize)>,
}

/// Accessors of displacements of a primitive's attributes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct MorphTarget {
    pub positions: Option<usize>,
    pub normals: Option<usize>,
    pub tangents: Option<usize>,
    /// By set.
    pub uvs: Vec<Option<usize>>,
}

/// Sets of joints and weights that are read: sixteen joints a vertex.
const MAX_JOINT_SETS: usize = 4;

/// The primitives of a mesh with their JSON paths.
pub(super) type MeshPrimitives = Vec<(Primitive, String)>;

/// All meshes; primitives without triangles are left out.
pub(super) fn parse(
    root: &At,
    layout: &Layout,
    materials: usize,
    variants: &Variants,
    notes: &mut Notes,
) -> List<MeshPrimitives> {
    List::parse(root, "meshes", |at| {
        let primitives = at.objects("primitives");
        let weights = at.weights("weights");
        let parsed = primitives.iter().filter_map(|at| {
            let primitive = parse_primitive(at, layout, materials, variants, notes)?;
            let weights = weights.clone();
            Some((Primitive { weights, ..primitive }, at.path.clone()))
        });
        Some(parsed.collect())
    })
}

fn parse_primitive(
    at: &At,
    layout: &Layout,
    materials: usize,
    variants: &Variants,
    notes: &mut Notes,
) -> Option<Primitive> {
    let mode = match at.uint("mode") {
        None if at.get("mode").is_some() => return None,
        None | Some(4) => Mode::Triangles,
        Some(5) => Mode::Strip,
        Some(6) => Mode::Fan,
        Some(0..=3) => {
            notes.count(
                "primitives of points or lines left out, since only triangles are surfaces",
                1,
            );
            return None;
        }
        Some(other) => {
            at.fault_at("mode", format!("is {other}; glTF knows 0 to 6"));
            return None;
        }
    };
    let Some(attributes) = at.object("attributes") else {
        if at.get("attributes").is_none() {
            at.fault_at("attributes", "is missing");
        }
        return None;
    };
    let material = at.index("material", materials, "materials");
    let material = variants.material(at, materials).or(material);
    let variants = variants.replacements(at, materials, notes);
    if attributes.get("POSITION").is_none() {
        notes.count("primitives without positions left out", 1);
        return None;
    }
    let accessor = |at: &At, key: &str| -> Option<(usize, &Accessor)> {
        let index = at.index(key, layout.accessors.len(), "accessors")?;
        let info = layout.accessors.get(index, at.faults())?;
        if info.view.is_none() && info.count > MAX_UNBACKED {
            at.fault_at(
                key,
                format!(
                    "uses accessors[{index}], which declares {} elements without a bufferView; \
                     at most {MAX_UNBACKED} are imported: export the scene again",
                    info.count
                ),
            );
            return None;
        }
        Some((index, info))
    };
    use Component::*;
    let attribute = |key: &str, widths: &[usize], components: &[Component]| {
        let (index, info) = accessor(&attributes, key)?;
        if widths.contains(&info.width) && components.contains(&info.component) {
            return Some(index);
        }
        attributes.fault_at(
            key,
            format!("uses accessors[{index}], which has the wrong type for it; export the scene again"),
        );
        None
    };
    // Integers are KHR_mesh_quantization's (but those of colours); whether they are normalised the accessor says, and
    // the length of normals and tangents means nothing.
    let positions = attribute("POSITION", &[3], &[F32, I8, U8, I16, U16]);
    let mut normals = attribute("NORMAL", &[3], &[F32, I8, I16]);
    let mut tangents = attribute("TANGENT", &[4], &[F32, I8, I16]);
    let mut colors = attribute("COLOR_0", &[3, 4], &[F32, U8, U16]);
    let mut uvs: Vec<Option<usize>> = (0..MAX_UV_SETS)
        .map(|set| attribute(&format!("TEXCOORD_{set}"), &[2], &[F32, I8, U8, I16, U16]))
        .collect();
    let positions = positions?;
    let info = layout.accessors.peek(positions)?;
    if info.count == 0 {
        notes.count("primitives of 0 vertices left out", 1);
        return None;
    }
    // Attributes of 0 elements are as absent.
    let filled = |attribute: &Option<usize>| {
        let info = attribute.and_then(|index| layout.accessors.peek(index));
        info.is_none_or(|info| info.count > 0)
    };
    let mut empty = 0;
    for attribute in [&mut normals, &mut tangents, &mut colors]
        .into_iter()
        .chain(&mut uvs)
    {
        if !filled(attribute) {
            empty += 1;
            *attribute = None;
        }
    }
    notes.count("vertex attributes of 0 elements left out", empty);
    uvs.truncate(uvs.iter().rposition(Option::is_some).map_or(0, |last| last + 1));
    if info.view.is_none() && info.sparse.is_none() {
        attributes.fault_at(
            "POSITION",
            match at.extension(draco::NAME) {
                Some(_) => format!(
                    "has its data in {} only, which needs a bufferView, attributes, indices and triangles (mode 4); \
                     export the scene again",
                    draco::NAME
                ),
                None => format!("uses accessors[{positions}], which holds no data; export the scene again"),
            },
        );
        return None;
    }
    for other in [normals, tangents, colors]
        .into_iter()
        .chain(uvs.iter().copied())
        .flatten()
    {
        let count = layout.accessors.peek(other)?.count;
        if count != info.count {
            attributes.fault(format!(
                "use accessors[{other}] with {count} elements, but there are {} positions; export the scene again",
                info.count
            ));
            return None;
        }
    }
    let positions_count = info.count;
    // Of what is wrong here the scene's triangles are right: it is left out with a note.
    let mut refined = |of: &At, key: &str, width: usize, components: &[Component]| {
        of.get(key)?;
        let index = of.value[key]
            .as_u64()
            .and_then(|index| usize::try_from(index).ok());
        let fits = |index: &usize| {
            layout.accessors.peek(*index).is_some_and(|info| {
                let backed = info.view.is_some() || info.count <= MAX_UNBACKED;
                info.width == width
                    && components.contains(&info.component)
                    && info.count == positions_count
                    && backed
            })
        };
        let index = index.filter(fits);
        if index.is_none() {
            notes.count(
                "joints, weights and morph targets of wrong type or length left out",
                1,
            );
        }
        index
    };
    let joints = (0..MAX_JOINT_SETS).map_while(|set| {
        let joints = refined(&attributes, &format!("JOINTS_{set}"), 4, &[U8, U16])?;
        let weights = refined(&attributes, &format!("WEIGHTS_{set}"), 4, &[F32, U8, U16])?;
        Some((joints, weights))
    });
    let joints = joints.collect();
    let targets = at.items("targets");
    let targets = targets.iter().map(|target| MorphTarget {
        positions: refined(target, "POSITION", 3, &[F32, I8, I16]),
        normals: refined(target, "NORMAL", 3, &[F32, I8, I16]),
        tangents: refined(target, "TANGENT", 3, &[F32, I8, I16]),
        uvs: (0..uvs.len())
            .map(|set| refined(target, &format!("TEXCOORD_{set}"), 2, &[F32, I8, U8, I16, U16]))
            .collect(),
    });
    let targets: Vec<MorphTarget> = targets.collect();
    if !targets.is_empty() {
        notes.count("primitives with morph targets, imported at rest", 1);
    }
    let indices = match at.get("indices") {
        None => None,
        Some(_) => {
            let (index, info) = accessor(at, "indices")?;
            if info.width != 1 || !matches!(info.component, U8 | U16 | U32) {
                at.fault_at(
                    "indices",
                    format!("uses accessors[{index}], which is no list of unsigned integers; export the scene again"),
                );
                return None;
            }
            Some(index)
        }
    };
    Some(Primitive {
        mode,
        positions,
        normals,
        tangents,
        uvs,
        colors,
        joints,
        targets,
        weights: Vec::new(),
        indices,
        material,
        variants,
    })
}
