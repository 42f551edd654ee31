//! The numbers of the layout: magic, versions, kinds, codecs, offsets. `SPEC.md` sections 3 to 5 list the same
//! numbers, and a test compares the two: a change here without one there fails.

/// Version of the specification that this crate implements: the highest that it reads. SPEC 3.
pub const SPEC_VERSION: u32 = 7;

/// Version of the specification since which header and table are as they are: what the header says. SPEC 3.3.
pub const CONTAINER_VERSION: u32 = 1;

/// First eight bytes of every asset. The first byte has its high bit set and CR LF and ^Z follow the letters, so
/// that transfers which strip the eighth bit or translate line ends are noticed at once (as in PNG). SPEC 3.1.
pub const MAGIC: [u8; 8] = [0x8b, b'R', b'L', b'T', 0x0d, 0x0a, 0x1a, 0x0a];

/// Written little-endian, so a reader that sees 0x04030201 has mixed up its byte order. SPEC 3.2.
pub const BYTE_ORDER_MARK: u32 = 0x0102_0304;

/// Bytes of the header. SPEC 3.
pub const HEADER_BYTES: u64 = 56;
/// Offsets of the header's fields from the start of the file. SPEC 3.
pub mod header {
    /// Magic, 8 bytes.
    pub const MAGIC: usize = 0;
    /// Byte order mark, u32.
    pub const BYTE_ORDER_MARK: usize = 8;
    /// Specification version that reads header and table, u32.
    pub const VERSION: usize = 12;
    /// Length of the file, u64.
    pub const FILE_BYTES: usize = 16;
    /// Offset of the table of contents, u64.
    pub const TABLE_OFFSET: usize = 24;
    /// Number of sections, u32.
    pub const SECTION_COUNT: usize = 32;
    /// Zero, u32.
    pub const RESERVED: usize = 36;
    /// XXH3-64 of the table, u64.
    pub const TABLE_CHECKSUM: usize = 40;
    /// XXH3-64 of the header's bytes before this field, u64.
    pub const HEADER_CHECKSUM: usize = 48;
}

/// Bytes of one entry of the table of contents. SPEC 4.
pub const ENTRY_BYTES: u64 = 48;
/// Offsets of an entry's fields from the start of the entry. SPEC 4.
pub mod entry {
    /// Kind, u32.
    pub const KIND: usize = 0;
    /// Version of the section's layout, u16.
    pub const VERSION: usize = 4;
    /// Flags, u16.
    pub const FLAGS: usize = 6;
    /// Codec, u32.
    pub const CODEC: usize = 8;
    /// Lowest specification version whose readers decode this section, u32.
    pub const NEEDS: usize = 12;
    /// Offset of the stored bytes in the file, u64.
    pub const OFFSET: usize = 16;
    /// Length of the stored bytes, u64.
    pub const STORED_BYTES: usize = 24;
    /// Length of the raw bytes, u64.
    pub const RAW_BYTES: usize = 32;
    /// XXH3-64 of the stored bytes, u64.
    pub const CHECKSUM: usize = 40;
}

/// Entry flag: a reader that cannot decode this section must refuse the file. SPEC 4.3.
pub const FLAG_REQUIRED: u16 = 1;

/// Most sections that a table may list: far more than there are kinds, far fewer than would hurt. SPEC 4.
pub const MAX_SECTIONS: u32 = 256;

/// Most raw bytes per stored byte. zstd alone reaches 32,750; real sections stay under 100, and a writer stores
/// a section uncompressed when it would pass this bound. SPEC 4.4.
pub const MAX_RATIO: u64 = 1024;

/// zstd level for bulk sections: the highest that still encodes a large asset in about a second (docs/notebook/format.md).
pub const ZSTD_LEVEL: i32 = 9;

/// Most raw bytes of a section of small records (provenance, materials, estimates): sixteen mebibytes hold some
/// hundred thousand materials. SPEC 7.9.
pub const MAX_RECORD_BYTES: usize = 16 << 20;

/// Most texture coordinate sets of a mesh: glTF viewers support two, exporters write up to eight. SPEC 6.2.
pub const MAX_UV_SETS: usize = 8;

/// Names of the settings in provenance that a reader must mind. SPEC 6.1.1.
pub mod setting {
    /// Bounces of indirect light: a number, or [`CONVERGED`].
    pub const BOUNCES: &str = "bounces";
    /// Whether links_solution has all bounces: [`BAKED`] or not.
    pub const SOLUTION: &str = "solution";
    /// Whether the scene's own lights are there: [`LEFT_OUT`] or not.
    pub const OWN_LIGHTS: &str = "own_lights";
    /// Whether the emission of materials is there: [`LEFT_OUT`] or not.
    pub const EMISSION: &str = "emission";
    /// Hashes of the only cameras that the asset is for.
    pub const CAMERAS_ONLY: &str = "cameras_only";

    /// Three numbers: what was taken away from all positions.
    pub const OFFSET: &str = "offset";

    /// What the scene calls its instances, a line for each.
    pub const OBJECTS: &str = "objects";

    /// Variants of materials, a line for each.
    pub const VARIANTS: &str = "variants";

    /// All of these.
    pub const ALL: [&str; 8] = [
        BOUNCES,
        SOLUTION,
        OWN_LIGHTS,
        EMISSION,
        CAMERAS_ONLY,
        OFFSET,
        OBJECTS,
        VARIANTS,
    ];

    /// Value: as many bounces as change anything.
    pub const CONVERGED: &str = "converged";
    /// Value: the bake solved the bounces.
    pub const BAKED: &str = "baked";
    /// Value: it is not in the asset.
    pub const LEFT_OUT: &str = "left out";
}

/// How a section's stored bytes become its raw bytes. SPEC 4.4.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Codec {
    /// Stored and raw bytes are the same.
    Stored = 0,
    /// The stored bytes are one zstd frame (RFC 8878).
    Zstd = 1,
}

impl Codec {
    /// The codec of a number in the table, if this version knows it.
    pub fn from_number(number: u32) -> Option<Self> {
        [Codec::Stored, Codec::Zstd]
            .into_iter()
            .find(|codec| *codec as u32 == number)
    }

    /// The name used in summaries.
    pub fn name(self) -> &'static str {
        match self {
            Codec::Stored => "stored",
            Codec::Zstd => "zstd",
        }
    }
}

/// What a section holds. The discriminant is the number in the table. SPEC 5.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Kind {
    /// Tool version, settings, source hash, what was left out and why.
    Provenance = 1,
    /// Meshes and instances.
    Geometry = 2,
    /// glTF metallic-roughness materials.
    Materials = 3,
    /// Encoded images with their samplers.
    Textures = 4,
    /// Cameras, lights and animations, as JSON text.
    Stage = 5,
    /// Points of all levels.
    Points = 6,
    /// The transfer operator T.
    LinksTransfer = 7,
    /// The flat scalar operator for bounces.
    LinksBounce = 8,
    /// The baked solution S.
    LinksSolution = 9,
    /// Error estimates.
    Estimates = 10,
    /// Clusters of points that send light.
    Senders = 11,
    /// The lights that cuts cluster.
    LightTree = 12,
    /// What each site sees of the lights.
    Cuts = 13,
    /// Points that surfaces separate from each other.
    Separations = 14,
}

impl Kind {
    /// All kinds, in the order in which they stand in a file.
    pub const ALL: [Kind; 14] = [
        Kind::Provenance,
        Kind::Geometry,
        Kind::Materials,
        Kind::Textures,
        Kind::Stage,
        Kind::Points,
        Kind::LinksTransfer,
        Kind::LinksBounce,
        Kind::LinksSolution,
        Kind::Estimates,
        Kind::Senders,
        Kind::LightTree,
        Kind::Cuts,
        Kind::Separations,
    ];

    /// The kind of a number in the table, if this version knows it.
    pub fn from_number(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u32 == number)
    }

    /// The name used in summaries and errors.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Provenance => "provenance",
            Kind::Geometry => "geometry",
            Kind::Materials => "materials",
            Kind::Textures => "textures",
            Kind::Stage => "stage",
            Kind::Points => "points",
            Kind::LinksTransfer => "links_transfer",
            Kind::LinksBounce => "links_bounce",
            Kind::LinksSolution => "links_solution",
            Kind::Estimates => "estimates",
            Kind::Senders => "senders",
            Kind::LightTree => "light_tree",
            Kind::Cuts => "cuts",
            Kind::Separations => "parted",
        }
    }

    /// Highest version of the section's layout: this crate reads it and all before it, and writes the lowest that holds
    /// the content.
    pub fn version(self) -> u16 {
        match self {
            Kind::Materials => 4,
            Kind::Points => 3,
            Kind::LinksTransfer => 2,
            _ => 1,
        }
    }

    /// Lowest specification version whose readers decode a version of the section's layout.
    pub fn needs(self, layout: u16) -> u32 {
        match self {
            Kind::Separations => 3,
            Kind::Points if layout == 3 => 4,
            Kind::Materials if layout == 2 => 5,
            Kind::Materials if layout == 3 => 6,
            Kind::Materials if layout == 4 => 7,
            // Other layouts of version N came with specification version N.
            _ => u32::from(layout),
        }
    }

    /// Whether a reader that cannot decode the section must refuse the file: estimates only inform.
    pub fn required(self) -> bool {
        self != Kind::Estimates
    }

    /// The kinds whose content this one's refers to: [`Asset::validate`](crate::Asset::validate) compares them.
    pub fn refers_to(self) -> &'static [Kind] {
        match self {
            Kind::Geometry => &[Kind::Materials],
            Kind::Materials => &[Kind::Textures],
            Kind::LinksTransfer | Kind::LinksBounce | Kind::LinksSolution => &[Kind::Senders],
            Kind::Senders | Kind::Separations => &[Kind::Points],
            Kind::Cuts => &[Kind::LightTree, Kind::Points],
            Kind::Provenance
            | Kind::Textures
            | Kind::Stage
            | Kind::Points
            | Kind::Estimates
            | Kind::LightTree => &[],
        }
    }

    /// Codec that a writer tries. Textures are PNG and JPEG already; provenance stays readable in a hex dump.
    pub(crate) fn preferred_codec(self) -> Codec {
        match self {
            Kind::Provenance | Kind::Textures => Codec::Stored,
            _ => Codec::Zstd,
        }
    }
}
