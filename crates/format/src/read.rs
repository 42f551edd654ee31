//! Bytes and files to assets: all of one, some of its sections, or what is in it.
//!
//! One way for all: header and table first, then each wanted section, whose stored bytes are verified before they are
//! decompressed or decoded. What is not wanted is not read, unless the whole file is (SPEC 4.2).

use std::borrow::Cow;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use xxhash_rust::xxh3::Xxh3;

use crate::asset::{Asset, Provenance};
use crate::codec::frame;
use crate::container::{self, Header, Limits, SectionInfo};
use crate::error::{Location, Result, io, limit};
use crate::layout::{Codec, ENTRY_BYTES, HEADER_BYTES, Kind, MAX_RECORD_BYTES};
use crate::section;

/// Bytes that are read at once to verify a section that is not decoded.
const CHUNK_BYTES: u64 = 1 << 20;

/// What a file holds and what it costs, read from header, table and provenance alone.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Version of the specification that the file needs.
    pub format_version: u32,
    /// Length of the file.
    pub file_bytes: u64,
    /// The table of contents, in file order.
    pub sections: Vec<SectionInfo>,
    /// Where the asset came from.
    pub provenance: Provenance,
}

/// Where an asset's bytes come from.
trait Source {
    /// Length of the whole.
    fn length(&self) -> u64;

    /// `count` bytes from `offset` on, fewer when the source ends; `section` is for errors.
    fn bytes(&mut self, section: &str, offset: u64, count: u64) -> Result<Cow<'_, [u8]>>;

    /// Whether [`bytes`](Self::bytes) takes memory.
    fn copies(&self) -> bool;
}

impl Source for &[u8] {
    fn length(&self) -> u64 {
        self.len() as u64
    }

    fn bytes(&mut self, _: &str, offset: u64, count: u64) -> Result<Cow<'_, [u8]>> {
        let start = usize::try_from(offset).unwrap_or(usize::MAX).min(self.len());
        let count = usize::try_from(count)
            .unwrap_or(usize::MAX)
            .min(self.len() - start);
        Ok(Cow::Borrowed(&self[start..start + count]))
    }

    fn copies(&self) -> bool {
        false
    }
}

/// An open file and its length when it was opened.
struct OpenFile {
    file: File,
    path: PathBuf,
    length: u64,
}

impl OpenFile {
    fn new(path: &Path) -> Result<Self> {
        let opened = File::open(path).and_then(|file| {
            let length = file.metadata()?.len();
            Ok((file, length))
        });
        let (file, length) = opened.map_err(io("open", path, "file", 0))?;
        Ok(OpenFile {
            file,
            path: path.to_path_buf(),
            length,
        })
    }
}

impl Source for OpenFile {
    fn length(&self) -> u64 {
        self.length
    }

    fn bytes(&mut self, section: &str, offset: u64, count: u64) -> Result<Cow<'_, [u8]>> {
        let mut bytes = Vec::with_capacity(usize::try_from(count.min(self.length)).unwrap_or(0));
        self.file
            .seek(SeekFrom::Start(offset))
            // `take`: a file that grows meanwhile stays within what was asked for.
            .and_then(|_| (&mut self.file).take(count).read_to_end(&mut bytes))
            .map_err(io("read", &self.path, section, offset))?;
        Ok(Cow::Owned(bytes))
    }

    fn copies(&self) -> bool {
        true
    }
}

/// Header and table, checked.
fn contents(source: &mut impl Source, limits: &Limits) -> Result<(Header, Vec<SectionInfo>)> {
    let length = source.length();
    let header = container::parse_header(&source.bytes("header", 0, HEADER_BYTES)?, length, limits)?;
    // At most 256 entries, which end at the end of the file.
    let table = source.bytes("table", header.table_offset, header.table_bytes())?;
    let sections = container::parse_table(&table, &header, limits)?;
    Ok((header, sections))
}

/// Decodes one section into the asset; `memory` is what decoded arrays may still take.
fn decode(
    source: &mut impl Source,
    info: &SectionInfo,
    (kind, codec): (Kind, Codec),
    memory: &mut u64,
    asset: &mut Asset,
) -> Result<()> {
    let stored_memory = if source.copies() { info.stored_bytes } else { 0 };
    let raw_memory = if codec == Codec::Stored { 0 } else { info.raw_bytes };
    // Both are given back below.
    let transient = stored_memory.saturating_add(raw_memory);
    if transient > *memory {
        let expected = format_args!("at most {memory} more bytes of memory");
        return Err(limit(
            &info.name,
            Location::File(info.offset),
            expected,
            transient,
        ));
    }
    *memory -= transient;
    let stored = source.bytes(&info.name, info.offset, info.stored_bytes)?;
    container::verify(info, xxhash_rust::xxh3::xxh3_64(&stored))?;
    match codec {
        Codec::Stored => section::decode(kind, info.version, &stored, memory, asset)?,
        Codec::Zstd => {
            let raw = frame::decompress(&info.name, info.offset, info.raw_bytes, &stored)?;
            drop(stored);
            section::decode(kind, info.version, &raw, memory, asset)?;
        }
    }
    *memory += transient;
    Ok(())
}

/// Verifies a section piece by piece, without decoding it.
fn verify(source: &mut impl Source, info: &SectionInfo) -> Result<()> {
    let mut hash = Xxh3::new();
    let end = info.offset + info.stored_bytes;
    let mut at = info.offset;
    while at < end {
        let count = (end - at).min(CHUNK_BYTES);
        hash.update(&source.bytes(&info.name, at, count)?);
        at += count;
    }
    container::verify(info, hash.digest())
}

/// Reads the sections that `wanted` accepts; the others are verified when `whole`.
fn read(
    source: &mut impl Source,
    limits: &Limits,
    wanted: impl Fn(Kind) -> bool,
    whole: bool,
) -> Result<Asset> {
    let (header, sections) = contents(source, limits)?;
    let mut asset = Asset::default();
    let mut memory = limits.total_bytes;
    for (index, info) in sections.iter().enumerate() {
        let entry_offset = header.table_offset + index as u64 * ENTRY_BYTES;
        // A required section of a kind that nobody knows might change the meaning of the others.
        let wanted = info.kind.is_none_or(&wanted);
        let readable = if wanted {
            info.readable(entry_offset)?
        } else {
            None
        };
        match readable {
            Some(how) => decode(source, info, how, &mut memory, &mut asset)?,
            None if whole => verify(source, info)?,
            None => {}
        }
    }
    asset.validate()?;
    Ok(asset)
}

/// Reads and validates all of an asset.
///
/// # Errors
/// `Invalid` when a byte is not what SPEC.md asks for or the content breaks a rule of [`Asset::validate`];
/// `Unsupported` when a required section needs a newer reader; `LimitExceeded` before anything is allocated that
/// passes `limits` or that the file's length does not justify.
pub fn read_asset(bytes: &[u8], limits: &Limits) -> Result<Asset> {
    let mut source = bytes;
    read(&mut source, limits, |_| true, true)
}

/// Reads and validates all of an asset from a file, one section at a time.
///
/// # Errors
/// As [`read_asset`]; `Io` when the file cannot be opened or read.
pub fn read_file(path: impl AsRef<Path>, limits: &Limits) -> Result<Asset> {
    read(&mut OpenFile::new(path.as_ref())?, limits, |_| true, true)
}

/// Reads provenance, the sections of `kinds`, and those that these refer to ([`Kind::refers_to`]), and validates them.
/// The rest of the file is neither read nor verified; its parts of the asset are as if the file did not have them.
///
/// # Errors
/// As [`read_file`], of what is read. A required section of a kind that this version does not know is refused all the
/// same.
pub fn read_parts(path: impl AsRef<Path>, limits: &Limits, kinds: &[Kind]) -> Result<Asset> {
    let wanted = with_references(kinds);
    read(
        &mut OpenFile::new(path.as_ref())?,
        limits,
        |kind| wanted.contains(&kind),
        false,
    )
}

/// The kinds and all that they refer to, and provenance.
fn with_references(kinds: &[Kind]) -> Vec<Kind> {
    let mut all = vec![Kind::Provenance];
    let mut open = kinds.to_vec();
    while let Some(kind) = open.pop() {
        if !all.contains(&kind) {
            all.push(kind);
            open.extend(kind.refers_to());
        }
    }
    all
}

/// Reads header, table of contents and provenance of a file, and nothing else of it.
///
/// # Errors
/// `Io`, `Invalid` and `Unsupported` (header, table or provenance) as [`read_asset`]; sections other than provenance
/// are not checked.
pub fn read_summary(path: impl AsRef<Path>) -> Result<Summary> {
    summary_of(&mut OpenFile::new(path.as_ref())?)
}

/// The summary of a file's bytes.
///
/// # Errors
/// As [`read_summary`], without `Io`.
pub fn summarise(bytes: &[u8]) -> Result<Summary> {
    let mut source = bytes;
    summary_of(&mut source)
}

fn summary_of(source: &mut impl Source) -> Result<Summary> {
    // A summary takes no memory that a limit would guard: the table and provenance are bounded by the format.
    let limits = Limits {
        file_bytes: u64::MAX,
        section_bytes: u64::MAX,
        total_bytes: u64::MAX,
    };
    let (header, sections) = contents(source, &limits)?;
    let mut asset = Asset::default();
    // Provenance is first, or the table's check would have failed.
    if let Some(info) = sections.first() {
        let most = MAX_RECORD_BYTES as u64;
        if info.raw_bytes > most || info.stored_bytes > most {
            let expected = format_args!("at most {most} bytes");
            return Err(limit(
                &info.name,
                Location::File(info.offset),
                expected,
                info.raw_bytes,
            ));
        }
        if let Some(how) = info.readable(header.table_offset)? {
            decode(source, info, how, &mut { u64::MAX }, &mut asset)?;
        }
    }
    Ok(Summary {
        format_version: header.version,
        file_bytes: source.length(),
        sections,
        provenance: asset.provenance,
    })
}
