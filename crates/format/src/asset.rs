//! What an asset holds, as plain arrays.
//!
//! Conventions: metres, right-handed, +Y up, linear Rec. 709, f32. World space unless said otherwise.

use crate::layout::setting;
use bincode::{Decode, Encode};

/// Everything in one file. A part that is empty or `None` has no section in the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Asset {
    /// Where the asset came from and what was left out of it. Always stored.
    pub provenance: Provenance,
    /// Triangle meshes and their instances.
    pub geometry: Geometry,
    /// Materials, indexed by [`Mesh::material`].
    pub materials: Vec<Material>,
    /// What further extensions say of some of them, by rising material, at most once each.
    pub material_extensions: Vec<MaterialExtensions>,
    /// What further extensions say of some panes, by rising material, at most once each.
    pub material_glass: Vec<MaterialGlass>,
    /// Images, indexed by [`TextureRef::texture`].
    pub textures: Vec<Texture>,
    /// Cameras, lights and animations of the scene.
    pub stage: Stage,
    /// Points of the meshless hierarchy, coarsest level first. A global point index counts through all levels.
    pub points: Vec<Level>,
    /// Points that surfaces separate from each other, if any are.
    pub separations: Option<Separations>,
    /// The clusters of finest points that send light. Without them there are no operators.
    pub senders: Option<Senders>,
    /// T: vector irradiance at the points per unit radiosity of the senders.
    pub transfer: Option<Links>,
    /// One bounce as a flat, non-negative scalar operator on one sender level.
    pub bounce: Option<BounceLinks>,
    /// All bounces as such operators, when the bake solved them; it fixes the albedo.
    pub solution: Option<Solution>,
    /// Error estimates of the bake.
    pub estimates: Option<Estimates>,
    /// The lights that cuts cluster.
    pub light_tree: Option<LightTree>,
    /// What each site sees of the lights. Never without a light tree.
    pub cuts: Option<Cuts>,
    /// How short some parts are stored.
    pub coding: Coding,
}

/// What a file may store in fewer bits, because the content does not use them. Reading says how it was stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coding {
    /// One channel of albedo at the points: red, green and blue are equal at each of all levels.
    pub grey: bool,
    /// Mantissas of 8 bits instead of 10 in the vectors of T ([`quantised_vector`](crate::quantised_vector)).
    pub short_links: bool,
}

/// Where an asset came from. Nothing in it may vary from run to run (no times, paths, thread counts).
#[derive(Debug, Clone, PartialEq, Eq, Default, Encode, Decode)]
pub struct Provenance {
    /// Version of the tool that baked, such as `relight 0.1.0`.
    pub tool_version: String,
    /// Settings of the bake as names and values, in the order of the command line's help.
    pub settings: Vec<(String, String)>,
    /// [`content_hash`](crate::content_hash) of the source scene's bytes.
    pub source_hash: u64,
    /// Seed of all random numbers of the bake.
    pub seed: u64,
    /// Every material was treated as Lambert with its base colour.
    pub lambert: bool,
    /// Parts that were left out, with reasons.
    pub left_out: Vec<LeftOut>,
    /// Deterministic counts of the bake as names and values, such as `rays` and `potential_links`.
    pub counts: Vec<(String, u64)>,
    /// Sentences for whoever inspects the asset, such as warnings about the scene.
    pub notes: Vec<String>,
}

impl Provenance {
    /// Value of a setting.
    pub fn setting(&self, name: &str) -> Option<&str> {
        let found = self.settings.iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value.as_str())
    }

    /// What was taken away from all positions, metres: add it to get the scene's own coordinates. `None` if the setting
    /// holds something else than three numbers. SPEC 6.1.1.
    pub fn offset(&self) -> Option<[f64; 3]> {
        let Some(text) = self.setting(setting::OFFSET) else {
            return Some([0.0; 3]);
        };
        let number = |text: &str| text.parse::<f64>().ok().filter(|x| x.is_finite());
        let numbers: Option<Vec<f64>> = text.split(' ').map(number).collect();
        numbers?.try_into().ok()
    }
}

/// One part that a bake left out.
#[derive(Debug, Clone, PartialEq, Eq, Default, Encode, Decode)]
pub struct LeftOut {
    /// What: "texture coordinates", "environment cuts", ...
    pub what: String,
    /// Why nothing will miss it.
    pub why: String,
    /// Bytes that it would have taken in the file, estimated.
    pub saved_bytes: u64,
}

/// Triangle meshes and where they stand.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Geometry {
    /// Meshes in their own spaces; one glTF primitive is one mesh.
    pub meshes: Vec<Mesh>,
    /// Placed copies of meshes.
    pub instances: Vec<Instance>,
}

/// One placed copy of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct Instance {
    /// Index into [`Geometry::meshes`].
    pub mesh: u32,
    /// 3 × 4 matrix, row-major: world = M · (mesh, 1). Negative determinants mirror.
    pub world_from_mesh: [f32; 12],
}

/// Triangles of one material. All arrays that are present have one entry per vertex.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// Vertex positions, mesh space, metres. Stored exactly.
    pub positions: Vec<[f32; 3]>,
    /// Unit vertex normals, mesh space. Stored as octahedral 2 × 16 bits.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinate sets, 0 to 8 of them. Stored exactly.
    pub uvs: Vec<Vec<[f32; 2]>>,
    /// Linear RGBA vertex colours. Stored exactly.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Unit tangent and handedness (±1), mesh space. Stored as octahedral 2 × 16 bits and a sign.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// Vertex indices, three per triangle, counter-clockwise seen from the front. Order and rotation are kept.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Asset::materials`].
    pub material: u32,
}

/// glTF metallic-roughness parameters. All values finite.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Material {
    /// Name in the source, for lighting sequences and material edits. May be empty or shared.
    pub name: String,
    /// Linear RGBA factor of the base colour.
    pub base_color: [f32; 4],
    /// Factor of metalness, 0 to 1.
    pub metallic: f32,
    /// Factor of perceptual roughness, 0 to 1.
    pub roughness: f32,
    /// Emitted radiance factor, linear RGB, emissive strength multiplied in; not negative.
    pub emissive: [f32; 3],
    /// How alpha acts.
    pub alpha_mode: AlphaMode,
    /// Emits and is shaded on both sides.
    pub double_sided: bool,
    /// KHR_materials_unlit.
    pub unlit: bool,
    /// Scale of the normal texture's x and y.
    pub normal_scale: f32,
    /// Base colour and alpha, sRGB.
    pub base_color_texture: Option<TextureRef>,
    /// Roughness in G, metalness in B, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals, linear.
    pub normal_texture: Option<TextureRef>,
    /// Emission, sRGB.
    pub emissive_texture: Option<TextureRef>,
}

impl Default for Material {
    /// glTF's default material: white, fully metallic and fully rough.
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color: [1.0; 4],
            metallic: 1.0,
            roughness: 1.0,
            emissive: [0.0; 3],
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            normal_scale: 1.0,
            base_color_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            emissive_texture: None,
        }
    }
}

/// What KHR_materials_ior, _specular, _clearcoat, _sheen, _anisotropy and _iridescence say of a material. All values finite.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct MaterialExtensions {
    /// Index into [`Asset::materials`].
    pub material: u32,
    /// Index of refraction of the dielectric, at least 1, or 0 for one that mirrors all light.
    pub ior: f32,
    /// Strength of the dielectric's reflection, 0 to 1.
    pub specular: f32,
    /// Its colour at normal incidence, linear RGB, not negative.
    pub specular_color: [f32; 3],
    /// Strength of the clearcoat, 0 to 1.
    pub clearcoat: f32,
    /// Perceptual roughness of the clearcoat, 0 to 1.
    pub clearcoat_roughness: f32,
    /// Scale of the clearcoat normal texture's x and y.
    pub clearcoat_normal_scale: f32,
    /// Colour of the sheen, linear RGB, 0 to 1.
    pub sheen_color: [f32; 3],
    /// Perceptual roughness of the sheen, 0 to 1.
    pub sheen_roughness: f32,
    /// How much rougher the lobe is along the tangent, 0 to 1.
    pub anisotropy: f32,
    /// Turns the tangent towards the bitangent, radians.
    pub anisotropy_rotation: f32,
    /// Strength of the thin film, 0 to 1.
    pub iridescence: f32,
    /// Index of refraction of the film, at least 1.
    pub iridescence_ior: f32,
    /// Thickness of the film where its texture is 0 and where it is 1 or absent, nanometres, not negative.
    pub iridescence_thickness: [f32; 2],
    /// Strength of the reflection in alpha, linear.
    pub specular_texture: Option<Box<TextureRef>>,
    /// sRGB.
    pub specular_color_texture: Option<Box<TextureRef>>,
    /// Strength in red, linear.
    pub clearcoat_texture: Option<Box<TextureRef>>,
    /// Roughness in green, linear.
    pub clearcoat_roughness_texture: Option<Box<TextureRef>>,
    /// Tangent-space normals, linear.
    pub clearcoat_normal_texture: Option<Box<TextureRef>>,
    /// sRGB.
    pub sheen_color_texture: Option<Box<TextureRef>>,
    /// Roughness in alpha, linear.
    pub sheen_roughness_texture: Option<Box<TextureRef>>,
    /// Direction in red and green, strength in blue, linear.
    pub anisotropy_texture: Option<Box<TextureRef>>,
    /// Strength in red, linear.
    pub iridescence_texture: Option<Box<TextureRef>>,
    /// Thickness in green, linear.
    pub iridescence_thickness_texture: Option<Box<TextureRef>>,
}

impl Default for MaterialExtensions {
    /// The extensions' defaults, of material 0.
    fn default() -> Self {
        MaterialExtensions {
            material: 0,
            ior: 1.5,
            specular: 1.0,
            specular_color: [1.0; 3],
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            clearcoat_normal_scale: 1.0,
            sheen_color: [0.0; 3],
            sheen_roughness: 0.0,
            anisotropy: 0.0,
            anisotropy_rotation: 0.0,
            iridescence: 0.0,
            iridescence_ior: 1.3,
            iridescence_thickness: [100.0, 400.0],
            specular_texture: None,
            specular_color_texture: None,
            clearcoat_texture: None,
            clearcoat_roughness_texture: None,
            clearcoat_normal_texture: None,
            sheen_color_texture: None,
            sheen_roughness_texture: None,
            anisotropy_texture: None,
            iridescence_texture: None,
            iridescence_thickness_texture: None,
        }
    }
}

/// What KHR_materials_volume and the texture of KHR_materials_transmission say of a pane. All values finite.
#[derive(Debug, Clone, PartialEq, Default, Encode, Decode)]
pub struct MaterialGlass {
    /// Index into [`Asset::materials`].
    pub material: u32,
    /// Above 0 for solid glass, 0 for thin panes; metres.
    pub thickness: f32,
    /// Of light that goes through solid glass the share exp(−absorption · length) is left: linear RGB, 1/m, not negative.
    pub absorption: [f32; 3],
    /// Multiplies the transmission, in red, linear.
    pub transmission_texture: Option<Box<TextureRef>>,
}

/// How a material's alpha acts.
#[derive(Debug, Clone, Copy, PartialEq, Default, Encode, Decode)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Alpha below the cutoff is a hole.
    Mask(f32),
    /// Alpha is coverage.
    Blend,
    /// A thin pane: of the light that its surface does not mirror this share, 0 to 1, passes straight on, times the base colour.
    Pane(f32),
}

/// Which image a material reads, and how texture coordinates reach it.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct TextureRef {
    /// Index into [`Asset::textures`].
    pub texture: u32,
    /// Index into [`Mesh::uvs`].
    pub uv_set: u8,
    /// 2 × 3 matrix, row-major: (u′, v′) = M · (u, v, 1). KHR_texture_transform.
    pub transform: [f32; 6],
}

impl TextureRef {
    /// The transform that changes nothing.
    pub const IDENTITY: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
}

/// An encoded image with its sampler. Whether it is sRGB is decided by its use.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Texture {
    /// The source's bytes, unchanged.
    pub bytes: Vec<u8>,
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Between texels.
    pub filter: Filter,
}

/// What texture coordinates outside 0 to 1 read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored.
    MirroredRepeat,
    /// The edge texel.
    ClampToEdge,
}

/// How texels are interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Filter {
    /// Bilinear.
    #[default]
    Linear,
    /// Nearest texel.
    Nearest,
}

/// Cameras, lights and animations of the scene as UTF-8 JSON text. The `scene` crate writes and reads it; this
/// crate keeps it as it is. Empty means none.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Stage {
    /// The text.
    pub json: String,
}

/// Points of one level of the meshless hierarchy. All arrays have one entry per point (`widenings` may have none); their order is
/// kept, and spatially coherent order makes the file smaller.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Level {
    /// R: Poisson-disk radius of the level, metres, above zero. Positions are stored to R/256.
    pub disk_radius: f32,
    /// r: radius of the basis functions' support, metres, above zero.
    pub support_radius: f32,
    /// Positions, world space, metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals, world space. Stored as octahedral 2 × 12 bits.
    pub normals: Vec<[f32; 3]>,
    /// Total hemispherical albedo, linear RGB, each 0 to 1. Stored in 12 bits.
    pub albedo: Vec<[f32; 3]>,
    /// By how much both radii of each point are wider than the level's, as a power of two, 0 to 31; empty: none is.
    pub widenings: Vec<u8>,
}

/// Senders: disjoint clusters of the finest level's points, in a tree of as many levels as send. Cluster j of
/// sender level l belongs to point j of level l. Every finest point is in one cluster of the finest sender
/// level, every cluster in one of the next coarser level; a cluster may be empty. A *global sender index* counts
/// through all sender levels, coarsest first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Senders {
    /// Clusters of each sender level, coarsest first: the number of points of that level.
    pub counts: Vec<u32>,
    /// For each point of the finest level its cluster on the finest sender level (index on that level).
    pub leaf_of_point: Vec<u32>,
    /// For each point of the finest level how much it counts: its weight in its cluster's mean is
    /// (importance + 1)², relative to the others.
    pub importance: Vec<u8>,
    /// For each sender level but the coarsest: for each cluster the one on the level above that holds it.
    pub parents: Vec<Vec<u32>>,
}

/// A sparse `receivers × senders` matrix of vectors: vector irradiance (W·m⁻²) at a receiver per unit radiosity
/// (W·m⁻²) of a sender, world space. Compressed rows: the links of receiver i stand at
/// `row_offsets[i]..row_offsets[i + 1]`, sorted by column, no column twice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Links {
    /// Number of rows; a row is a global point index.
    pub receivers: u32,
    /// Number of columns; a column is a global sender index.
    pub senders: u32,
    /// `receivers + 1` offsets, from 0 to the number of links.
    pub row_offsets: Vec<u32>,
    /// Sender of each link.
    pub columns: Vec<u32>,
    /// Vector of each link. Stored to a relative 2⁻⁹, see [`quantised_vector`](crate::quantised_vector).
    pub vectors: Vec<[f32; 3]>,
}

/// One bounce between the clusters of one sender level: irradiance averaged over a row's cluster per unit
/// radiosity of a column's, so that no row sums to more than 1.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BounceLinks {
    /// The sender level.
    pub level: u32,
    /// K.
    pub matrix: WeightRows,
}

/// All bounces between the clusters of one sender level: irradiance from the first bounce on, averaged over a
/// row's cluster, per unit radiosity that direct light alone causes at a column's. With K of [`BounceLinks`] and
/// reflectances ρ: K + KρK + …, as far as the bake's setting `bounces` says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Solution {
    /// The sender level.
    pub level: u32,
    /// One matrix when all reflectances are grey, else one for red, green and blue each. Row sums may exceed 1.
    pub channels: Vec<WeightRows>,
}

/// A sparse, square, non-negative matrix of scalars on the clusters of one sender level. Compressed rows as in
/// [`Links`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WeightRows {
    /// Number of rows and of columns: clusters of the level.
    pub rows: u32,
    /// `rows + 1` offsets, from 0 to the number of links.
    pub row_offsets: Vec<u32>,
    /// Column of each link.
    pub columns: Vec<u32>,
    /// Weight of each link. Stored in 16 bits relative to the row's largest.
    pub weights: Vec<f32>,
    /// Sum of each row's weights, at least 0. Stored exactly; a reader rescales the weights to it.
    pub row_sums: Vec<f32>,
}

/// Which points surfaces separate from each other, such as those of two rooms beside a thin wall: nothing is interpolated
/// between them. The file calls the section `parted`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Separations {
    /// Pairs of a point and of a point of a coarser level that is no parent of it although near enough. Global indices,
    /// ascending.
    pub pairs: Vec<[u32; 2]>,
    /// Points of the finest level, counted in it, that a surface separates from a neighbour; ascending.
    /// Whoever interpolates between them must look.
    pub near: Vec<u32>,
}

/// Error estimates of the bake, as names and values.
#[derive(Debug, Clone, PartialEq, Default, Encode, Decode)]
pub struct Estimates {
    /// Such as `relmse_indirect` and its value; all finite.
    pub values: Vec<(String, f64)>,
}

/// The lights that cuts cluster, in the order of the leaves of a complete binary tree over them. The tree itself
/// needs no bytes: node j of height h holds the leaves j·2ʰ to (j + 1)·2ʰ − 1, and the root has height log₂ N.
#[derive(Debug, Clone, PartialEq)]
pub struct LightTree {
    /// One light per leaf.
    pub lights: LightSamples,
}

/// The lights of a [`LightTree`] in the order of its leaves; their number N is a power of two, 256 to 2²⁰.
#[derive(Debug, Clone, PartialEq)]
pub enum LightSamples {
    /// Directions of the spherical Fibonacci lattice of N points (SPEC 6.12.1), each for 4π/N sr.
    Environment {
        /// Lattice index of each leaf: a permutation of 0 to N − 1.
        order: Vec<u32>,
    },
    /// Points spread evenly over the surfaces.
    Surface {
        /// What each point stands for, m², above zero.
        area: f32,
        /// Positions, world space, metres. Stored to √area/256.
        positions: Vec<[f32; 3]>,
        /// Unit normals, world space. Stored as octahedral 2 × 12 bits.
        normals: Vec<[f32; 3]>,
    },
}

impl LightSamples {
    /// N: number of lights, and of leaves.
    pub fn len(&self) -> usize {
        match self {
            LightSamples::Environment { order } => order.len(),
            LightSamples::Surface { positions, .. } => positions.len(),
        }
    }

    /// Whether there is no light, which no valid asset has.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Cuts through a [`LightTree`], one per site, which are the points of the finest level: what the site sees of the lights, as a piecewise constant function
/// over them (Cheslack-Postava et al. 2008, section 3). The elements of site i stand at
/// `row_offsets[i]..row_offsets[i + 1]`, their nodes from left to right; together a site's nodes tile the leaves: a node
/// starts at the sum of 2^height of those before it, a multiple of its own 2^height. A site that sees nothing has one
/// element, the root with value 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cuts {
    /// σ of |C|·var > σ² (Cheslack-Postava et al. 2008, equation 5), by which the cuts were refined; above zero, finite.
    /// Values are stored as precisely as it deserves.
    pub sigma: f32,
    /// What a value of 1 stands for: 1 for visibility, the mean geometry factor for surface lights; above zero, finite.
    pub unit: f32,
    /// `sites + 1` offsets, from 0 to the number of elements.
    pub row_offsets: Vec<u32>,
    /// Height of each element's node: it holds 2^height leaves.
    pub heights: Vec<u8>,
    /// Mean over each element's node, in `unit`s, at least 0. Stored as a whole number of steps, see
    /// [`quantised_cuts`](crate::quantised_cuts).
    pub values: Vec<f32>,
}
