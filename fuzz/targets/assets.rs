//! Targets of the asset file: the container, each section behind right checksums, and round trips.

use super::Target;
use relight_format::*;

/// An asset with every section, to put a fuzzed one into.
const WHOLE: &[u8] = include_bytes!("../../crates/format/tests/fixtures/version_3_environment.relight");

/// A memory that every valid file of a few kilobytes fits.
const LIMITS: Limits = Limits {
    file_bytes: 1 << 20,
    section_bytes: 16 << 20,
    total_bytes: 64 << 20,
};

macro_rules! section_targets {
    ($($name:ident = $kind:literal),*) => {
        $(
            #[doc = concat!("Raw bytes of the section ", stringify!($name), ".")]
            pub fn $name(data: &[u8]) {
                section($kind, data);
            }
        )*

        const SECTIONS: &[(&str, Target)] = &[$((stringify!($name), $name)),*];
    };
}

section_targets!(
    provenance = 1,
    geometry = 2,
    materials = 3,
    textures = 4,
    stage = 5,
    points = 6,
    links_transfer = 7,
    links_bounce = 8,
    links_solution = 9,
    estimates = 10,
    senders = 11,
    light_tree = 12,
    cuts = 13,
    parted = 14
);

/// The targets of this module.
pub fn all() -> Vec<(&'static str, Target)> {
    let mut all: Vec<(&str, Target)> = vec![("container", container), ("round_trip", round_trip)];
    all.extend(SECTIONS);
    all
}

/// Any bytes as a file.
pub fn container(data: &[u8]) {
    let summary = summarise(data);
    if let Ok(asset) = read_asset(data, &LIMITS) {
        assert!(summary.is_ok(), "what is read can be summed up");
        writes_and_reads(&asset);
    }
    // As most flips end at a checksum, once more behind right ones.
    let mut resealed = data.to_vec();
    if reseal(&mut resealed).is_some()
        && let Ok(asset) = read_asset(&resealed, &LIMITS)
    {
        writes_and_reads(&asset);
    }
}

fn u64_at(bytes: &[u8], at: usize) -> Option<usize> {
    let number = bytes.get(at..at + 8)?.try_into().ok()?;
    usize::try_from(u64::from_le_bytes(number)).ok()
}

/// Puts the checksums of the sections, the table and the header right, where header and table say where they are.
fn reseal(file: &mut [u8]) -> Option<()> {
    let table = u64_at(file, layout::header::TABLE_OFFSET)?;
    let entry_bytes = layout::ENTRY_BYTES as usize;
    let entries = file.get(table..)?.len() / entry_bytes;
    for i in 0..entries.min(layout::MAX_SECTIONS as usize) {
        let entry = table + i * entry_bytes;
        let start = u64_at(file, entry + layout::entry::OFFSET)?;
        let end = start.checked_add(u64_at(file, entry + layout::entry::STORED_BYTES)?)?;
        let checksum = content_hash(file.get(start..end)?);
        let at = entry + layout::entry::CHECKSUM;
        file.get_mut(at..at + 8)?.copy_from_slice(&checksum.to_le_bytes());
    }
    let checksum = content_hash(file.get(table..)?);
    let at = layout::header::TABLE_CHECKSUM;
    file.get_mut(at..at + 8)?.copy_from_slice(&checksum.to_le_bytes());
    let at = layout::header::HEADER_CHECKSUM;
    let checksum = content_hash(file.get(..at)?);
    file.get_mut(at..at + 8)?.copy_from_slice(&checksum.to_le_bytes());
    Some(())
}

/// A file with `data` as the raw bytes of one section, stored as they are, and with the other sections of [`WHOLE`], or
/// with provenance `alone`.
fn with_section(kind: u32, data: &[u8], alone: bool) -> Vec<u8> {
    let summary = summarise(WHOLE).expect("the fixture is valid");
    let mut file = WHOLE[..layout::HEADER_BYTES as usize].to_vec();
    let mut table = Vec::new();
    let kept = |info: &&SectionInfo| !alone || [1, kind].contains(&info.kind_number);
    for info in summary.sections.iter().filter(kept) {
        let stored = &WHOLE[info.offset as usize..(info.offset + info.stored_bytes) as usize];
        let fuzzed = info.kind_number == kind;
        let stored = if fuzzed { data } else { stored };
        let offset = file.len() as u64;
        table.extend(info.kind_number.to_le_bytes());
        table.extend(info.version.to_le_bytes());
        table.extend(u16::from(info.required).to_le_bytes());
        table.extend(if fuzzed { 0 } else { info.codec_number }.to_le_bytes());
        table.extend(info.needs.to_le_bytes());
        table.extend(offset.to_le_bytes());
        table.extend((stored.len() as u64).to_le_bytes());
        let raw = if fuzzed { data.len() as u64 } else { info.raw_bytes };
        table.extend(raw.to_le_bytes());
        // The checksum comes with the others.
        table.extend([0; 8]);
        file.extend_from_slice(stored);
    }
    let count = (table.len() / layout::ENTRY_BYTES as usize) as u32;
    let table_offset = file.len() as u64;
    file.extend(table);
    let length = file.len() as u64;
    file[layout::header::FILE_BYTES..][..8].copy_from_slice(&length.to_le_bytes());
    file[layout::header::TABLE_OFFSET..][..8].copy_from_slice(&table_offset.to_le_bytes());
    file[layout::header::SECTION_COUNT..][..4].copy_from_slice(&count.to_le_bytes());
    // Right by construction.
    let _ = reseal(&mut file);
    file
}

fn section(kind: u32, data: &[u8]) {
    // Without the checks that compare sections with each other too: a point more would end at the links otherwise.
    for alone in [false, true] {
        if let Ok(asset) = read_asset(&with_section(kind, data, alone), &LIMITS) {
            writes_and_reads(&asset);
        }
    }
}

/// What was read is valid, can be written, and is the same when read again; from then on its bytes stay.
fn writes_and_reads(asset: &Asset) {
    asset.validate().expect("what was read is valid");
    let bytes = write_asset(asset).expect("what was read can be written");
    let again = read_asset(&bytes, &Limits::default()).expect("what was written can be read");
    assert_eq!(
        write_asset(&again).expect("and written again"),
        bytes,
        "the same bytes"
    );
    assert_eq!(
        Content::from_counts(&Content::of(asset).to_counts()),
        Some(Content::of(asset))
    );
}

/// Draws numbers from fuzzed bytes; zeros when there are no more.
struct Draw<'a>(&'a [u8]);

impl Draw<'_> {
    fn u8(&mut self) -> u8 {
        let (&first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        first
    }

    fn u32(&mut self) -> u32 {
        u32::from_le_bytes([self.u8(), self.u8(), self.u8(), self.u8()])
    }

    fn below(&mut self, n: u32) -> u32 {
        if n < 256 {
            u32::from(self.u8()) % n.max(1)
        } else {
            self.u32() % n
        }
    }

    /// Any bits, or a number of common size.
    fn f32(&mut self) -> f32 {
        match self.u8() {
            0 => f32::from_bits(self.u32()),
            small => (f32::from(small) - 128.0) / 16.0,
        }
    }

    fn vector<const N: usize>(&mut self) -> [f32; N] {
        [0; N].map(|_: i32| self.f32())
    }

    fn unit(&mut self) -> [f32; 3] {
        let v: [f32; 3] = self.vector();
        let length = v.iter().map(|&c| f64::from(c) * f64::from(c)).sum::<f64>().sqrt();
        let unit = v.map(|c| (f64::from(c) / length) as f32);
        if unit.iter().all(|c| c.is_finite()) {
            unit
        } else {
            [0.0, 0.0, -1.0]
        }
    }

    fn rows(&mut self, rows: u32, columns: u32) -> (Vec<u32>, Vec<u32>) {
        let mut offsets = vec![0];
        let mut all = Vec::new();
        for _ in 0..rows {
            let mut column = 0;
            for _ in 0..self.below(4) {
                column += self.below(5);
                if column < columns {
                    all.push(column);
                }
                column += 1;
            }
            offsets.push(all.len() as u32);
        }
        (offsets, all)
    }

    fn weights(&mut self, rows: u32) -> WeightRows {
        let (row_offsets, columns) = self.rows(rows, rows);
        let weights: Vec<f32> = columns.iter().map(|_| self.f32().abs() / 32.0).collect();
        let row_sums = row_offsets
            .windows(2)
            .map(|pair| weights[pair[0] as usize..pair[1] as usize].iter().sum())
            .collect();
        WeightRows {
            rows,
            row_offsets,
            columns,
            weights,
            row_sums,
        }
    }
}

/// An asset made of any bytes, valid or not: what is written is read with the stated losses only.
pub fn round_trip(data: &[u8]) {
    let mut draw = Draw(data);
    let levels = 1 + draw.below(3);
    let points: Vec<Level> = (0..levels)
        .map(|_| {
            let count = draw.below(6);
            Level {
                disk_radius: draw.f32(),
                support_radius: draw.f32(),
                positions: (0..count).map(|_| draw.vector()).collect(),
                normals: (0..count).map(|_| draw.unit()).collect(),
                albedo: (0..count)
                    .map(|_| [0; 3].map(|_: i32| f32::from(draw.u8()) / 255.0))
                    .collect(),
                // Few, so that most levels stay in the older layouts.
                widenings: match draw.below(4) {
                    0 => (0..count).map(|_| draw.u8() % 40).collect(),
                    _ => Vec::new(),
                },
            }
        })
        .collect();
    let sizes: Vec<u32> = points.iter().map(|level| level.positions.len() as u32).collect();
    let sender_levels = 1 + draw.below(levels) as usize;
    let counts = sizes[..sender_levels].to_vec();
    let finest = sizes[sizes.len() - 1];
    let senders = Senders {
        leaf_of_point: (0..finest)
            .map(|_| draw.below(counts[sender_levels - 1]))
            .collect(),
        importance: (0..finest).map(|_| draw.u8()).collect(),
        parents: counts
            .windows(2)
            .map(|pair| (0..pair[1]).map(|_| draw.below(pair[0])).collect())
            .collect(),
        counts: counts.clone(),
    };
    let (receivers, columns) = (sizes.iter().sum(), counts.iter().sum());
    let (row_offsets, link_columns) = draw.rows(receivers, columns);
    let transfer = Links {
        receivers,
        senders: columns,
        vectors: link_columns.iter().map(|_| draw.vector()).collect(),
        row_offsets,
        columns: link_columns,
    };
    let level = draw.below(sender_levels as u32);
    let matrix = draw.weights(counts[level as usize]);
    let vertices = draw.below(6);
    let mesh = Mesh {
        positions: (0..vertices).map(|_| draw.vector()).collect(),
        normals: (draw.u8() & 1 != 0).then(|| (0..vertices).map(|_| draw.unit()).collect()),
        uvs: (0..draw.below(3))
            .map(|_| (0..vertices).map(|_| draw.vector()).collect())
            .collect(),
        colors: (draw.u8() & 1 != 0).then(|| (0..vertices).map(|_| draw.vector()).collect()),
        tangents: None,
        triangles: (0..draw.below(5))
            .map(|_| [0; 3].map(|_: i32| draw.below(vertices)))
            .collect(),
        material: 0,
    };
    let asset = Asset {
        geometry: Geometry {
            meshes: vec![mesh],
            instances: vec![Instance {
                mesh: 0,
                world_from_mesh: draw.vector(),
            }],
        },
        materials: vec![Material::default()],
        points,
        senders: Some(senders),
        transfer: Some(transfer),
        bounce: Some(BounceLinks { level, matrix }),
        ..Asset::default()
    };
    // What breaks a rule is refused, not written.
    let Ok(bytes) = write_asset(&asset) else { return };
    let read = read_asset(&bytes, &Limits::default()).expect("what was written can be read");
    for (written, read) in asset.points.iter().zip(&read.points) {
        assert_eq!(&quantised_level(written), read);
        for (p, q) in written.positions.iter().zip(&read.positions) {
            let square = |i: usize| (f64::from(p[i]) - f64::from(q[i])).powi(2);
            let distance = (square(0) + square(1) + square(2)).sqrt();
            assert!(
                distance <= f64::from(written.disk_radius) / 256.0,
                "{p:?} became {q:?}"
            );
        }
    }
    let links = asset.transfer.as_ref();
    let quantised = links.map(|links| quantised_links(links, asset.coding));
    assert_eq!(quantised, read.transfer);
    let quantised = asset.bounce.as_ref().map(|b| quantised_weights(&b.matrix));
    assert_eq!(quantised.as_ref(), read.bounce.as_ref().map(|b| &b.matrix));
    let bits = |mesh: &Mesh| -> Vec<u32> { mesh.positions.iter().flatten().map(|c| c.to_bits()).collect() };
    assert_eq!(
        bits(&asset.geometry.meshes[0]),
        bits(&read.geometry.meshes[0]),
        "not a bit of a vertex is lost"
    );
    assert_eq!(
        asset.geometry.meshes[0].triangles,
        read.geometry.meshes[0].triangles
    );
    writes_and_reads(&read);
}
