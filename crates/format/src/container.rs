//! The container: header, sections, table of contents (SPEC 3 to 5). Everything is checked against the file's real
//! length before anything is allocated, every byte is under a checksum, and sections lie end to end.

use bincode::{Decode, Encode};
use xxhash_rust::xxh3::xxh3_64;

use crate::codec::bytes::Cursor;
use crate::codec::record;
use crate::error::{Location, Result, invalid, limit, unsupported};
use crate::layout::{
    BYTE_ORDER_MARK, CONTAINER_VERSION, Codec, ENTRY_BYTES, FLAG_REQUIRED, HEADER_BYTES, Kind, MAGIC,
    MAX_RATIO, MAX_SECTIONS, SPEC_VERSION, ZSTD_LEVEL, entry, header,
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
        let (codec, compressed) = compress(*kind, raw)?;
        let stored = compressed.as_deref().unwrap_or(raw);
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

/// The codec to use and the compressed bytes, unless the section is better stored as it is.
fn compress(kind: Kind, raw: &[u8]) -> Result<(Codec, Option<Vec<u8>>)> {
    if kind.preferred_codec() == Codec::Stored {
        return Ok((Codec::Stored, None));
    }
    let compressed = zstd::bulk::compress(raw, ZSTD_LEVEL)
        .map_err(|error| invalid(kind.name(), Location::Raw(0), "bytes that zstd compresses", error))?;
    let worthwhile = compressed.len() < raw.len() && raw.len() as u64 <= compressed.len() as u64 * MAX_RATIO;
    Ok(if worthwhile {
        (Codec::Zstd, Some(compressed))
    } else {
        (Codec::Stored, None)
    })
}

/// Checks the first bytes of a file of `file_bytes` bytes. `bytes` are its first [`HEADER_BYTES`], or all if there
/// are fewer.
pub(crate) fn parse_header(bytes: &[u8], file_bytes: u64, limits: &Limits) -> Result<Header> {
    let fail = |at: usize, expected: &dyn std::fmt::Display, found: &dyn std::fmt::Display| {
        invalid("header", Location::File(at as u64), expected, found)
    };
    let magic = bytes.get(..MAGIC.len()).unwrap_or(bytes);
    if magic != MAGIC {
        let found = format!("{magic:02x?}");
        return Err(fail(
            header::MAGIC,
            &format!("the magic {MAGIC:02x?} of a relight asset"),
            &found,
        ));
    }
    if (bytes.len() as u64) < HEADER_BYTES {
        return Err(fail(
            bytes.len(),
            &format!("a header of {HEADER_BYTES} bytes"),
            &"the end of the file",
        ));
    }
    if file_bytes > limits.file_bytes {
        let expected = format_args!("a file of at most {} bytes", limits.file_bytes);
        return Err(limit("file", Location::File(0), expected, file_bytes));
    }
    let mut memory = 0;
    let header: Header = record::fixed(&mut Cursor::new("header", bytes, &mut memory))?;
    if header.byte_order_mark != BYTE_ORDER_MARK {
        let expected = format!("the byte order mark {BYTE_ORDER_MARK:#010x}");
        let found = format!("{:#010x}", header.byte_order_mark);
        return Err(fail(header::BYTE_ORDER_MARK, &expected, &found));
    }
    let actual = xxh3_64(&bytes[..header::HEADER_CHECKSUM]);
    if header.header_checksum != actual {
        let expected = format!("the header's checksum {actual:#018x}");
        let found = format!("{:#018x}", header.header_checksum);
        return Err(fail(header::HEADER_CHECKSUM, &expected, &found));
    }
    let version = header.version;
    if version == 0 || version > SPEC_VERSION {
        return Err(unsupported(
            "header",
            Location::File(header::VERSION as u64),
            format_args!("a format version of 1 to {SPEC_VERSION}"),
            format_args!("{version}, which needs a reader of format version {version}"),
        ));
    }
    if header.reserved != 0 {
        return Err(fail(header::RESERVED, &"a reserved field of 0", &header.reserved));
    }
    if header.file_bytes != file_bytes {
        let expected = format!("the file's length {file_bytes}");
        return Err(fail(header::FILE_BYTES, &expected, &header.file_bytes));
    }
    let count = header.section_count;
    if count > MAX_SECTIONS {
        let expected = format!("at most {MAX_SECTIONS} sections");
        return Err(fail(header::SECTION_COUNT, &expected, &count));
    }
    let table_end = header.table_offset.checked_add(header.table_bytes());
    if header.table_offset < HEADER_BYTES || table_end != Some(file_bytes) {
        let expected = format!("a table of {count} entries that ends at the end of the file");
        let found = format!("offset {}", header.table_offset);
        return Err(fail(header::TABLE_OFFSET, &expected, &found));
    }
    Ok(header)
}

/// Checks the table of contents: checksum, contiguous sections from header to table, no kind twice, lengths that
/// limits and stored bytes justify, provenance first.
pub(crate) fn parse_table(table: &[u8], header: &Header, limits: &Limits) -> Result<Vec<SectionInfo>> {
    let actual = xxh3_64(table);
    if actual != header.table_checksum {
        let expected = format_args!("the checksum {:#018x} that the header has", header.table_checksum);
        return Err(invalid(
            "table",
            Location::File(header.table_offset),
            expected,
            format_args!("{actual:#018x}"),
        ));
    }
    let mut sections: Vec<SectionInfo> = Vec::with_capacity(table.len() / ENTRY_BYTES as usize);
    let mut end = HEADER_BYTES;
    for (index, bytes) in table.chunks_exact(ENTRY_BYTES as usize).enumerate() {
        let mut memory = 0;
        let fields: Entry = record::fixed(&mut Cursor::new("table", bytes, &mut memory))?;
        let flags = fields.flags;
        let section = SectionInfo::from(fields);
        let entry_offset = header.table_offset + index as u64 * ENTRY_BYTES;
        let place = |field: usize| Location::File(entry_offset + field as u64);
        if flags > FLAG_REQUIRED {
            return Err(invalid(
                &section.name,
                place(entry::FLAGS),
                "flags of 0 or 1",
                flags,
            ));
        }
        if sections
            .iter()
            .any(|other| other.kind_number == section.kind_number)
        {
            return Err(invalid(
                &section.name,
                place(entry::KIND),
                "each kind once",
                "a second one",
            ));
        }
        let stored_end = section.offset.checked_add(section.stored_bytes);
        if section.offset != end || stored_end.is_none_or(|stored_end| stored_end > header.table_offset) {
            return Err(invalid(
                &section.name,
                place(entry::OFFSET),
                format_args!("bytes from {end} on that end by {}", header.table_offset),
                format_args!("{} bytes from {} on", section.stored_bytes, section.offset),
            ));
        }
        end += section.stored_bytes;
        check_lengths(&section, place(entry::RAW_BYTES), limits)?;
        sections.push(section);
    }
    if end != header.table_offset {
        let expected = format_args!("sections that end at {}", header.table_offset);
        return Err(invalid("table", Location::File(end), expected, end));
    }
    match sections.first() {
        Some(first) if first.kind == Some(Kind::Provenance) => Ok(sections),
        other => {
            let found = other.map_or("no section", |section| section.name.as_str());
            Err(invalid(
                "table",
                Location::File(header.table_offset),
                "provenance as the first section",
                found,
            ))
        }
    }
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

fn check_lengths(section: &SectionInfo, place: Location, limits: &Limits) -> Result<()> {
    let SectionInfo {
        name,
        stored_bytes,
        raw_bytes,
        ..
    } = section;
    if section.codec == Some(Codec::Stored) && raw_bytes != stored_bytes {
        return Err(invalid(
            name,
            place,
            format_args!("{stored_bytes} raw bytes, as stored"),
            raw_bytes,
        ));
    }
    if *raw_bytes > stored_bytes.saturating_mul(MAX_RATIO) {
        let expected = format_args!("at most {MAX_RATIO} raw bytes for each of {stored_bytes} stored");
        return Err(limit(name, place, expected, raw_bytes));
    }
    if *raw_bytes > limits.section_bytes {
        return Err(limit(
            name,
            place,
            format_args!("at most {} bytes", limits.section_bytes),
            raw_bytes,
        ));
    }
    Ok(())
}

/// Compares the XXH3-64 of a section's stored bytes with its checksum.
pub(crate) fn verify(section: &SectionInfo, actual: u64) -> Result<()> {
    if actual == section.checksum {
        return Ok(());
    }
    let expected = format_args!("stored bytes with the checksum {:#018x}", section.checksum);
    Err(invalid(
        &section.name,
        Location::File(section.offset),
        expected,
        format_args!("{actual:#018x}"),
    ))
}

/// First bytes of a zstd frame that is not to be skipped (RFC 8878, 3.1.1).
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// The raw bytes of verified zstd bytes, whose declared length was checked by [`parse_table`].
pub(crate) fn decompress(section: &SectionInfo, stored: &[u8]) -> Result<Vec<u8>> {
    let fail = |found: &dyn std::fmt::Display| {
        let expected = format_args!("a zstd frame of {} raw bytes", section.raw_bytes);
        invalid(&section.name, Location::File(section.offset), expected, found)
    };
    // zstd itself would read several frames, and skip those that it may.
    let frame = zstd::zstd_safe::find_frame_compressed_size(stored)
        .map_err(|code| fail(&zstd::zstd_safe::get_error_name(code)))?;
    if frame != stored.len() || !stored.starts_with(&ZSTD_MAGIC) {
        return Err(fail(&format_args!(
            "{frame} of {} stored bytes in one",
            stored.len()
        )));
    }
    let capacity = usize::try_from(section.raw_bytes).map_err(|error| fail(&error))?;
    let raw = zstd::bulk::decompress(stored, capacity).map_err(|error| fail(&error))?;
    if raw.len() == capacity {
        Ok(raw)
    } else {
        Err(fail(&raw.len()))
    }
}
