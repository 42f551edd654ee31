//! What a reader takes: memory within its limits whatever a file says, time in proportion, and of a file only the bytes
//! that it needs. An allocator counts, thread by thread.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

mod common;

use common::assets::wide_asset;
use common::{Forged, fixtures, forge, sections_of, small_asset};
use relight_format::layout::Kind;
use relight_format::*;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::{Duration, Instant};

/// The system's allocator, counted.
struct Counting;

thread_local! {
    /// Bytes that this thread holds, and the most since it was set.
    static HELD: Cell<(usize, usize)> = const { Cell::new((0, 0)) };
}

fn count(change: impl Fn(usize) -> usize) {
    // No counting while a thread ends.
    let _ = HELD.try_with(|held| {
        let now = change(held.get().0);
        held.set((now, held.get().1.max(now)));
    });
}

// The one place outside the ray kernel that needs `unsafe`: the trait asks for it, and what it does is the system's.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(|held| held + layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // What another thread allocated may end here.
        count(|held| held.saturating_sub(layout.size()));
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most memory that `act` held at once beyond what was held before, bytes.
fn peak(act: impl FnOnce()) -> usize {
    let before = HELD.get().0;
    HELD.set((before, before));
    act();
    HELD.get().1 - before
}

/// Memory that limits do not count: a table of 256 entries, the words of an error, what a section's decoder keeps aside.
const ASIDE: usize = 128 << 10;

fn limits(total_bytes: u64) -> Limits {
    Limits {
        total_bytes,
        ..Limits::default()
    }
}

/// Reads; it must take no more than its limit and less than a second.
fn read_within(bytes: &[u8], total_bytes: u64) -> Result<Asset> {
    let mut result = None;
    let start = Instant::now();
    let most = peak(|| result = Some(read_asset(bytes, &limits(total_bytes))));
    assert!(start.elapsed() < Duration::from_secs(1));
    let allowed = total_bytes as usize + ASIDE;
    assert!(most <= allowed, "{most} bytes were taken of {allowed}");
    result.unwrap()
}

#[test]
fn every_prefix_and_every_flipped_bit_of_every_fixture_is_refused_within_the_limits() {
    let (mut prefixes, mut flips) = (0, 0);
    for (name, mut bytes) in fixtures() {
        assert!(read_within(&bytes, 1 << 20).is_ok(), "{name}");
        for length in 0..bytes.len() {
            assert!(
                read_within(&bytes[..length], 1 << 20).is_err(),
                "{name}: {length} bytes"
            );
            prefixes += 1;
        }
        for bit in 0..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(read_within(&bytes, 1 << 20).is_err(), "{name}: bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
            flips += 1;
        }
    }
    println!("{prefixes} prefixes and {flips} flipped bits refused");
    assert!(flips > 100_000);
}

/// Truth: the allocator. The least limit that a file can be read with is what reading it takes, and no more.
#[test]
fn a_limit_is_kept_to_the_byte_that_it_names() {
    for (name, bytes) in fixtures() {
        let (mut refused, mut enough) = (0u64, 1 << 24);
        while enough - refused > 1 {
            let middle = (refused + enough) / 2;
            match read_within(&bytes, middle) {
                Ok(_) => enough = middle,
                Err(FormatError::LimitExceeded(_)) => refused = middle,
                Err(other) => panic!("{name}: {other}"),
            }
        }
        // Sixteen bytes of memory for each of a record's (names, numbers), some tens for each of an array's.
        assert!(enough <= 64 * bytes.len() as u64 + 4096, "{name}: {enough}");
    }
}

/// Every u32 of every section's raw bytes as the largest there is: no count is believed.
#[test]
fn counts_that_the_file_does_not_justify_take_no_memory() {
    let mut tried = 0;
    for asset in [small_asset(), wide_asset()] {
        let sections = sections_of(&write_asset(&asset).unwrap());
        for (i, section) in sections.iter().enumerate() {
            let raw = section.raw();
            // Counts stand at the start or between arrays: all places of the first kilobyte.
            for at in 0..raw.len().saturating_sub(4).min(1024) {
                for number in [u32::MAX, 1 << 30, 1 << 24] {
                    let mut changed = raw.clone();
                    changed[at..at + 4].copy_from_slice(&number.to_le_bytes());
                    let mut sections = sections.clone();
                    sections[i] = section.with_raw(changed);
                    let file = forge(&sections);
                    // In proportion to the file, although the limits would allow sixteen gibibytes.
                    let most = peak(|| drop(read_asset(&file, &Limits::default())));
                    assert!(most <= 64 * file.len() + ASIDE, "{most} bytes for {}", file.len());
                    tried += 1;
                }
            }
        }
    }
    assert!(tried > 5000, "{tried}");
}

/// Records of every magnitude, whose readers have a limit each: a list that claims more than stands behind it is refused
/// before memory is taken for more than the file is long, but for a factor.
#[test]
fn lists_of_records_take_memory_in_proportion() {
    for notes in [1usize, 100, 1000, 10_000, 100_000, 1_000_000] {
        let mut asset = Asset::default();
        asset.provenance.notes = vec![String::new(); notes];
        let mut sections = sections_of(&write_asset(&asset).unwrap());
        let whole = forge(&sections);
        // 24 bytes of memory for 8 in the file, which are read beside them.
        assert_eq!(read_within(&whole, 64 * whole.len() as u64).unwrap(), asset);
        let mut raw = sections[0].raw();
        let at = raw.len() - 8 * notes - 8;
        let count = notes as u64;
        assert_eq!(raw[at..at + 8], count.to_le_bytes());
        for claimed in [count + 1, 2 * count, 10 * count, 1 << 30, u64::MAX] {
            raw[at..at + 8].copy_from_slice(&claimed.to_le_bytes());
            sections[0] = sections[0].with_raw(raw.clone());
            let file = forge(&sections);
            let mut result = None;
            let most = peak(|| result = Some(read_asset(&file, &Limits::default())));
            assert!(matches!(result, Some(Err(FormatError::Invalid(_)))));
            assert!(most <= 32 * file.len() + ASIDE, "{most} bytes for {}", file.len());
        }
    }
}

/// Bytes that this thread has read from files.
#[cfg(target_os = "linux")]
fn bytes_read() -> u64 {
    let text = std::fs::read_to_string("/proc/thread-self/io").unwrap();
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("rchar: "))
        .unwrap();
    line.parse().unwrap()
}

/// Bytes that `act` reads from files, less those of asking.
#[cfg(target_os = "linux")]
fn bytes_read_by(act: impl FnOnce()) -> u64 {
    let first = bytes_read();
    let asking = bytes_read() - first;
    let before = bytes_read();
    act();
    (bytes_read() - before).saturating_sub(asking)
}

/// A file of ten gibibytes, nearly all of it a hole: header and provenance before, the table behind.
#[cfg(target_os = "linux")]
#[test]
fn a_summary_of_ten_gibibytes_reads_kilobytes() {
    use std::os::unix::fs::FileExt;
    let hole = 10u64 << 30;
    let mut sections = sections_of(&write_asset(&Asset::default()).unwrap());
    sections.push(Forged::new(4, vec![0; 8]));
    let small = forge(&sections);
    let table = small.len() - 96;
    let (mut head, mut tail) = (small[..table - 8].to_vec(), small[table..].to_vec());
    for field in [24, 32] {
        tail[48 + field..][..8].copy_from_slice(&hole.to_le_bytes());
    }
    let table_offset = head.len() as u64 + hole;
    head[16..24].copy_from_slice(&(table_offset + 96).to_le_bytes());
    head[24..32].copy_from_slice(&table_offset.to_le_bytes());
    head[40..48].copy_from_slice(&content_hash(&tail).to_le_bytes());
    let checksum = content_hash(&head[..48]);
    head[48..56].copy_from_slice(&checksum.to_le_bytes());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.relight");
    let file = std::fs::File::create(&path).unwrap();
    file.write_all_at(&head, 0).unwrap();
    file.write_all_at(&tail, table_offset).unwrap();

    let start = Instant::now();
    let mut most = 0;
    let read = bytes_read_by(|| {
        most = peak(|| {
            let summary = read_summary(&path).unwrap();
            assert_eq!(summary.file_bytes, table_offset + 96);
            assert_eq!(summary.sections[1].stored_bytes, hole);
        });
    });
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{read} bytes read, {most} bytes of memory, {:.2} ms",
        1e3 * seconds
    );
    assert!(read < 1000, "{read} bytes read");
    assert!(most < ASIDE, "{most} bytes of memory");
    // What a disk needs for three reads, and a busy machine; reading it all would take ten.
    assert!(seconds < 1.0, "{seconds} s");
    assert!(matches!(
        read_file(&path, &Limits::default()),
        Err(FormatError::LimitExceeded(_))
    ));
}

#[cfg(target_os = "linux")]
#[test]
fn parts_are_read_with_what_they_refer_to_and_without_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.relight");
    write_file(&path, &wide_asset()).unwrap();
    let summary = read_summary(&path).unwrap();
    let whole = read_file(&path, &Limits::default()).unwrap();
    for kind in Kind::ALL {
        let mut asset = Asset::default();
        let read = bytes_read_by(|| asset = read_parts(&path, &Limits::default(), &[kind]).unwrap());
        let mut wanted = vec![Kind::Provenance, kind];
        // Three steps reach everything that anything refers to.
        for _ in 0..3 {
            let more: Vec<Kind> = wanted.iter().flat_map(|k| k.refers_to()).copied().collect();
            wanted.extend(more);
        }
        let of_wanted = summary
            .sections
            .iter()
            .filter(|s| wanted.contains(&s.kind.unwrap()));
        let bytes: u64 = of_wanted.map(|s| s.stored_bytes).sum();
        let table = 48 * summary.sections.len() as u64;
        // The count itself is read as text, which may be a digit longer the second time.
        assert!(
            read.abs_diff(56 + table + bytes) <= 4,
            "{kind:?}: {read} bytes read of {bytes}"
        );
        let mut expected = whole.clone();
        for left in Kind::ALL.into_iter().filter(|kind| !wanted.contains(kind)) {
            match left {
                Kind::Provenance => expected.provenance = Provenance::default(),
                Kind::Geometry => expected.geometry = Geometry::default(),
                Kind::Materials => expected.materials.clear(),
                Kind::Textures => expected.textures.clear(),
                Kind::Stage => expected.stage = Stage::default(),
                Kind::Points => {
                    expected.points.clear();
                    expected.coding.grey = false;
                }
                Kind::LinksTransfer => {
                    expected.transfer = None;
                    expected.coding.short_links = false;
                }
                Kind::LinksBounce => expected.bounce = None,
                Kind::LinksSolution => expected.solution = None,
                Kind::Estimates => expected.estimates = None,
                Kind::Senders => expected.senders = None,
                Kind::LightTree => expected.light_tree = None,
                Kind::Cuts => expected.cuts = None,
                Kind::Separations => expected.separations = None,
            }
        }
        assert_eq!(asset, expected, "{kind:?}");
    }
}

#[test]
fn damage_is_seen_in_what_is_read_and_unknown_demands_always() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.relight");
    let mut bytes = write_asset(&small_asset()).unwrap();
    let links = summarise(&bytes).unwrap();
    let links = links
        .sections
        .iter()
        .find(|s| s.kind == Some(Kind::LinksTransfer))
        .unwrap();
    bytes[links.offset as usize] ^= 4;
    std::fs::write(&path, &bytes).unwrap();
    assert!(read_parts(&path, &Limits::default(), &[Kind::Points]).is_ok());
    let error = read_parts(&path, &Limits::default(), &[Kind::LinksTransfer]).unwrap_err();
    assert_eq!(error.fault().section, "links_transfer");
    assert_eq!(error.fault().location, Location::File(links.offset));
    let mut sections = sections_of(&write_asset(&small_asset()).unwrap());
    sections.push(Forged {
        needs: 7,
        ..Forged::new(500, vec![1])
    });
    std::fs::write(&path, forge(&sections)).unwrap();
    let error = read_parts(&path, &Limits::default(), &[Kind::Points]).unwrap_err();
    assert!(matches!(error, FormatError::Unsupported(_)), "{error}");
    assert!(error.to_string().contains("format version 7"), "{error}");
}

/// Each class of error has its evidence: the part, the place, what should be and what is.
#[test]
fn every_class_of_error_says_where_and_what() {
    let good = write_asset(&small_asset()).unwrap();
    let mut newer = good.clone();
    newer[12] = 9;
    common::reseal_header(&mut newer);
    let read = |bytes: &[u8]| read_asset(bytes, &Limits::default()).unwrap_err();
    let tight = read_asset(&good, &limits(100)).unwrap_err();
    let missing = read_file("missing/a.relight", &Limits::default()).unwrap_err();
    let errors = [read(&good[..70]), read(&newer), tight, missing];
    assert!(matches!(errors[0], FormatError::Invalid(_)));
    assert!(matches!(errors[1], FormatError::Unsupported(_)));
    assert!(matches!(errors[2], FormatError::LimitExceeded(_)));
    assert!(matches!(errors[3], FormatError::Io { .. }));
    for (error, section) in errors.iter().zip(["header", "header", "provenance", "file"]) {
        let fault = error.fault();
        assert_eq!(fault.section, section, "{error}");
        assert!(!fault.expected.is_empty() && !fault.found.is_empty(), "{error}");
    }
    assert_eq!(errors[1].fault().location, Location::File(12));
}

/// Counts in provenance are what the rest holds, for whoever reads provenance alone.
#[test]
fn counts_say_what_an_asset_holds() {
    for asset in [small_asset(), wide_asset(), Asset::default()] {
        let content = Content::of(&asset);
        assert_eq!(Content::from_counts(&content.to_counts()), Some(content.clone()));
        assert_eq!(Content::from_counts(&content.to_counts()[1..]), None, "one lacks");
    }
    let content = Content::of(&wide_asset());
    // Three instances: two of 38 triangles, one of 2.
    assert_eq!((content.triangles, content.instances), (78, 3));
    assert_eq!(content.points, [7, 120, 333]);
    assert_eq!(
        content.links_per_level.iter().sum::<u64>(),
        content.links_transfer
    );
    assert_eq!(content.cuts.unwrap().sites, 333);
    // A number of levels that nothing stands behind.
    assert_eq!(Content::from_counts(&[("levels".into(), u64::MAX)]), None);
}
