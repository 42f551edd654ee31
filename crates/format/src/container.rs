//! The container: header, sections, table of contents (SPEC 3 to 5). Everything is checked against the file's real
//! length before anything is allocated, every byte is under a checksum, and sections lie end to end.

use std::fmt::Arguments;

use bincode::{Decode, Encode};
use xxhash_rust::xxh3::xxh3_64;

use crate::codec::bytes::Cursor;
use crate::codec::{frame, record};
use crate::error::{Location, Result, limit, require, unsupported};
use crate::layout::{
    BYTE_ORDER_MARK, CONTAINER_VERSION, Codec, ENTRY_BYTES, FLAG_REQUIRED, HEADER_BYTES, Kind, MAGIC,
    MAX_RATIO, MAX_SECTIONS, SPEC_VERSION, entry, header,
};

/// What a reader may take. Files are refused with `LimitExceeded` before it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Longest file, bytes.
    pub file_bytes: u64,
    /// Longest section after decompression, bytes.
    pub section_bytes: u64,
    /// Most memory for decoded arrays together with the section being read and decompressed, bytes.
    pub total_bytes: u64,
}

impl Default for Limits {
    /// Eight, four and sixteen gibibytes: more than any scene that a workstation bakes, less than would fill it.
    fn default() -> Self {
        Limits {
            file_bytes: 8 << 30,
            section_bytes: 4 << 30,
            total_bytes: 16 << 30,
        }
    }
}

/// One entry of the table of contents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SectionInfo {
    /// Number of the kind in the table.
    pub kind_number: u32,
    /// The kind, if this version knows it.
    pub kind: Option<Kind>,
    /// Name of the kind, or `unknown_N`.
    pub name: String,
    /// Version of the section's layout.
    pub version: u16,
    /// A reader that cannot decode it must refuse the file.
    pub required: bool,
    /// Number of the codec.
    pub codec_number: u32,
    /// The codec, if this version knows it.
    pub codec: Option<Codec>,
    /// Lowest specification version whose readers decode it.
    pub needs: u32,
    /// Where its stored bytes start in the file.
    pub offset: u64,
    /// Bytes in the file.
    pub stored_bytes: u64,
    /// Bytes after decompression.
    pub raw_bytes: u64,
    /// XXH3-64 of the stored bytes.
    pub checksum: u64,
}

impl SectionInfo {
    /// The kind and codec when this version decodes the section. A section that it does not know is `None` when
    /// optional.
    ///
    /// # Errors
    /// `Unsupported` when the section is required.
    pub(crate) fn readable(&self, entry_offset: u64) -> Result<Option<(Kind, Codec)>> {
        match (self.kind, self.codec) {
            (Some(kind), Some(codec)) if (1..=kind.version()).contains(&self.version) => {
                Ok(Some((kind, codec)))
            }
            _ if !self.required => Ok(None),
            _ => Err(unsupported(
                &self.name,
                Location::File(entry_offset),
                format_args!("what a reader of format version {SPEC_VERSION} knows"),
                format_args!(
                    "a required section of version {} with codec {}, which needs a reader of format version {}",
                    self.version, self.codec_number, self.needs
                ),
            )),
        }
    }
}

/// The header as it stands in the file (SPEC 3).
#[derive(Debug, Clone, Copy, Encode, Decode)]
pub(crate) struct Header {
    magic: [u8; 8],
    byte_order_mark: u32,
    pub version: u32,
    file_bytes: u64,
    pub table_offset: u64,
    section_count: u32,
    reserved: u32,
    table_checksum: u64,
    header_checksum: u64,
}

impl Header {
    /// Bytes of the table.
    pub fn table_bytes(&self) -> u64 {
        u64::from(self.section_count) * ENTRY_BYTES
    }
}

/// An entry of the table as it stands in the file (SPEC 4).
#[derive(Encode, Decode)]
struct Entry {
    kind: u32,
    version: u16,
    flags: u16,
    codec: u32,
    needs: u32,
    offset: u64,
    stored_bytes: u64,
    raw_bytes: u64,
    checksum: u64,
}

/// Lays out a file: header, the sections in the given order, table.
///
/// # Errors
/// `Io` never; `Invalid` when zstd fails, which it does only without memory.
pub(crate) fn assemble(sections: &[(Kind, u16, Vec<u8>)]) -> Result<Vec<u8>> {
    let mut body = Vec::new();
    let mut table = Vec::new();
    for (kind, version, raw) in sections {
        let packed = match kind.preferred_codec() {
            Codec::Stored => None,
            Codec::Zstd => frame::compress(kind.name(), raw)?,
        };
        let codec = packed.as_ref().map_or(Codec::Stored, |_| Codec::Zstd);
        let stored = packed.as_deref().unwrap_or(raw);
        let entry = Entry {
            kind: *kind as u32,
            version: *version,
            flags: if kind.required() { FLAG_REQUIRED } else { 0 },
            codec: codec as u32,
            needs: kind.needs(*version),
            offset: HEADER_BYTES + body.len() as u64,
            stored_bytes: stored.len() as u64,
            raw_bytes: raw.len() as u64,
            checksum: xxh3_64(stored),
        };
        record::put(entry, &mut table);
        body.extend_from_slice(stored);
    }
    let table_offset = HEADER_BYTES + body.len() as u64;
    let header = Header {
        magic: MAGIC,
        byte_order_mark: BYTE_ORDER_MARK,
        version: CONTAINER_VERSION,
        file_bytes: table_offset + table.len() as u64,
        table_offset,
        section_count: sections.len() as u32,
        reserved: 0,
        table_checksum: xxh3_64(&table),
        header_checksum: 0,
    };
    let mut file = Vec::with_capacity(header.file_bytes as usize);
    record::put(header, &mut file);
    let checksum = xxh3_64(&file[..header::HEADER_CHECKSUM]);
    file.truncate(header::HEADER_CHECKSUM);
    record::put(checksum, &mut file);
    file.extend_from_slice(&body);
    file.extend_from_slice(&table);
    Ok(file)
}

/// Checks the first bytes of a file of `file_bytes` bytes. `bytes` are its first [`HEADER_BYTES`], or all if there
/// are fewer.
pub(crate) fn parse_header(bytes: &[u8], file_bytes: u64, limits: &Limits) -> Result<Header> {
    let at = |field: usize| Location::File(field as u64);
    let magic = bytes.get(..MAGIC.len()).unwrap_or(bytes);
    let expected = format_args!("the magic {MAGIC:02x?} of a relight asset");
    let found = match bytes {
        _ if bytes.starts_with(b"version https://git-lfs") => {
            "a Git LFS pointer: run `git lfs pull` in its repository to fetch the file".to_owned()
        }
        _ => format!("{magic:02x?}"),
    };
    require(magic == MAGIC, "header", at(header::MAGIC), expected, found)?;
    let (whole, end) = (bytes.len() as u64 >= HEADER_BYTES, at(bytes.len()));
    let expected = format_args!("a header of {HEADER_BYTES} bytes");
    require(whole, "header", end, expected, "the end of the file")?;
    if file_bytes > limits.file_bytes {
        let expected = format_args!("a file of at most {} bytes", limits.file_bytes);
        return Err(limit("file", at(0), expected, file_bytes));
    }
    let mut memory = 0;
    let fields: Header = record::fixed(&mut Cursor::new("header", bytes, &mut memory))?;
    let check = |holds: bool, field: usize, expected: Arguments<'_>, found: Arguments<'_>| {
        require(holds, "header", at(field), expected, found)
    };
    let mark = fields.byte_order_mark;
    check(
        mark == BYTE_ORDER_MARK,
        header::BYTE_ORDER_MARK,
        format_args!("the byte order mark {BYTE_ORDER_MARK:#010x}"),
        format_args!("{mark:#010x}"),
    )?;
    let actual = xxh3_64(&bytes[..header::HEADER_CHECKSUM]);
    check(
        fields.header_checksum == actual,
        header::HEADER_CHECKSUM,
        format_args!("the header's checksum {actual:#018x}"),
        format_args!("{:#018x}", fields.header_checksum),
    )?;
    let version = fields.version;
    if version == 0 || version > SPEC_VERSION {
        let expected = format_args!("a format version of 1 to {SPEC_VERSION}");
        let found = format_args!("{version}, which needs a reader of format version {version}");
        return Err(unsupported("header", at(header::VERSION), expected, found));
    }
    check(
        fields.reserved == 0,
        header::RESERVED,
        format_args!("a reserved field of 0"),
        format_args!("{}", fields.reserved),
    )?;
    check(
        fields.file_bytes == file_bytes,
        header::FILE_BYTES,
        format_args!("the file's length {file_bytes}"),
        format_args!("{}", fields.file_bytes),
    )?;
    let count = fields.section_count;
    check(
        count <= MAX_SECTIONS,
        header::SECTION_COUNT,
        format_args!("at most {MAX_SECTIONS} sections"),
        format_args!("{count}"),
    )?;
    let table_end = fields.table_offset.checked_add(fields.table_bytes());
    check(
        fields.table_offset >= HEADER_BYTES && table_end == Some(file_bytes),
        header::TABLE_OFFSET,
        format_args!("a table of {count} entries that ends at the end of the file"),
        format_args!("offset {}", fields.table_offset),
    )?;
    Ok(fields)
}

/// Checks the table of contents: checksum, contiguous sections from header to table, no kind twice, lengths that
/// limits and stored bytes justify, provenance first.
pub(crate) fn parse_table(table: &[u8], header: &Header, limits: &Limits) -> Result<Vec<SectionInfo>> {
    let table_offset = header.table_offset;
    let start = Location::File(table_offset);
    let actual = xxh3_64(table);
    let expected = format_args!("the checksum {:#018x} that the header has", header.table_checksum);
    let (holds, found) = (actual == header.table_checksum, format_args!("{actual:#018x}"));
    require(holds, "table", start, expected, found)?;
    let mut sections: Vec<SectionInfo> = Vec::with_capacity(table.len() / ENTRY_BYTES as usize);
    let mut end = HEADER_BYTES;
    for (index, bytes) in table.chunks_exact(ENTRY_BYTES as usize).enumerate() {
        let mut memory = 0;
        let fields: Entry = record::fixed(&mut Cursor::new("table", bytes, &mut memory))?;
        let flags = fields.flags;
        let section = SectionInfo::from(fields);
        let name = &section.name;
        let entry_offset = table_offset + index as u64 * ENTRY_BYTES;
        let at = |field: usize| Location::File(entry_offset + field as u64);
        let known = flags <= FLAG_REQUIRED;
        require(known, name, at(entry::FLAGS), "flags of 0 or 1", flags)?;
        let first = sections.iter().all(|s| s.kind_number != section.kind_number);
        require(first, name, at(entry::KIND), "each kind once", "a second one")?;
        let stored_end = section.offset.checked_add(section.stored_bytes);
        let fits = section.offset == end && stored_end.is_some_and(|stored_end| stored_end <= table_offset);
        let expected = format_args!("bytes from {end} on that end by {table_offset}");
        let found = format_args!("{} bytes from {} on", section.stored_bytes, section.offset);
        require(fits, name, at(entry::OFFSET), expected, found)?;
        end += section.stored_bytes;
        check_lengths(&section, at(entry::RAW_BYTES), limits)?;
        sections.push(section);
    }
    let expected = format_args!("sections that end at {table_offset}");
    require(end == table_offset, "table", Location::File(end), expected, end)?;
    let first = sections.first();
    let holds = first.is_some_and(|section| section.kind == Some(Kind::Provenance));
    let found = first.map_or("no section", |section| section.name.as_str());
    require(holds, "table", start, "provenance as the first section", found)?;
    Ok(sections)
}

impl From<Entry> for SectionInfo {
    fn from(entry: Entry) -> Self {
        let kind = Kind::from_number(entry.kind);
        let unknown = || format!("unknown_{}", entry.kind);
        SectionInfo {
            kind_number: entry.kind,
            kind,
            name: kind.map_or_else(unknown, |kind| kind.name().to_string()),
            version: entry.version,
            required: entry.flags & FLAG_REQUIRED != 0,
            codec_number: entry.codec,
            codec: Codec::from_number(entry.codec),
            needs: entry.needs,
            offset: entry.offset,
            stored_bytes: entry.stored_bytes,
            raw_bytes: entry.raw_bytes,
            checksum: entry.checksum,
        }
    }
}

fn check_lengths(section: &SectionInfo, location: Location, limits: &Limits) -> Result<()> {
    let (name, stored, raw) = (&section.name, section.stored_bytes, section.raw_bytes);
    let holds = section.codec != Some(Codec::Stored) || raw == stored;
    let expected = format_args!("{stored} raw bytes, as stored");
    require(holds, name, location, expected, raw)?;
    if raw > stored.saturating_mul(MAX_RATIO) {
        let expected = format_args!("at most {MAX_RATIO} raw bytes for each of {stored} stored");
        return Err(limit(name, location, expected, raw));
    }
    if raw > limits.section_bytes {
        let expected = format_args!("at most {} bytes", limits.section_bytes);
        return Err(limit(name, location, expected, raw));
    }
    Ok(())
}

/// Compares the XXH3-64 of a section's stored bytes with its checksum.
pub(crate) fn verify(section: &SectionInfo, actual: u64) -> Result<()> {
    let expected = format_args!("stored bytes with the checksum {:#018x}", section.checksum);
    let (holds, found) = (actual == section.checksum, format_args!("{actual:#018x}"));
    require(
        holds,
        &section.name,
        Location::File(section.offset),
        expected,
        found,
    )
}
