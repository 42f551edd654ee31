//! A small asset with every section, and a writer of containers that is independent of the crate's own.
#![allow(dead_code)] // each test file uses its part

pub mod assets;
pub mod dump;

use relight_format::*;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

fn weight_rows(scale: f32) -> WeightRows {
    WeightRows {
        rows: 2,
        row_offsets: vec![0, 1, 3],
        columns: vec![1, 0, 1],
        weights: [0.25, 0.5, 0.125].map(|w| w * scale).to_vec(),
        row_sums: [0.25, 0.625].map(|s| s * scale).to_vec(),
    }
}

/// One quad with texture, two levels of points, all link sections.
pub fn small_asset() -> Asset {
    let texture_ref = TextureRef {
        texture: 0,
        uv_set: 0,
        transform: TextureRef::IDENTITY,
    };
    Asset {
        provenance: Provenance {
            tool_version: "relight 0.1.0".into(),
            settings: vec![("levels".into(), "2".into()), ("epsilon".into(), "0.025".into())],
            source_hash: 0x0123_4567_89ab_cdef,
            seed: 7,
            lambert: true,
            left_out: vec![LeftOut {
                what: "tangents".into(),
                why: "no normal map".into(),
                saved_bytes: 64,
            }],
            counts: vec![("rays".into(), 480)],
            notes: vec!["one quad".into()],
        },
        geometry: Geometry {
            meshes: vec![Mesh {
                positions: vec![
                    [0.0, 0.0, 0.0],
                    [1.0, 0.0, 0.0],
                    [1.0, 1.0, -0.5],
                    [0.0, 1.0, -0.5],
                ],
                normals: Some(vec![
                    [0.0, 0.0, 1.0],
                    [0.6, 0.0, 0.8],
                    [0.0, -0.6, -0.8],
                    [0.0, 1.0, 0.0],
                ]),
                uvs: vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]],
                colors: Some(vec![[1.0, 0.5, 0.25, 1.0]; 4]),
                tangents: Some(vec![[1.0, 0.0, 0.0, -1.0]; 4]),
                triangles: vec![[0, 1, 2], [2, 3, 0]],
                material: 0,
            }],
            instances: vec![Instance {
                mesh: 0,
                world_from_mesh: [1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.25],
            }],
        },
        material_extensions: Vec::new(),
        material_glass: Vec::new(),
        materials: vec![Material {
            name: "wall".into(),
            alpha_mode: AlphaMode::Mask(0.5),
            base_color_texture: Some(texture_ref),
            ..Material::default()
        }],
        textures: vec![Texture {
            bytes: vec![0x89, b'P', b'N', b'G', 1, 2, 3],
            mime: "image/png".into(),
            wrap_u: Wrap::ClampToEdge,
            wrap_v: Wrap::MirroredRepeat,
            filter: Filter::Nearest,
        }],
        stage: Stage {
            json: "{\"cameras\":[]}".into(),
        },
        points: vec![
            Level {
                disk_radius: 0.5,
                widenings: Vec::new(),
                support_radius: 0.75,
                positions: vec![[0.1, 0.2, 0.3], [0.9, 0.2, 0.3]],
                normals: vec![[0.0, 0.0, 1.0], [0.0, 0.8, 0.6]],
                albedo: vec![[0.5, 0.25, 0.0], [0.99, 1.0, 0.8]],
            },
            Level {
                disk_radius: 0.25,
                widenings: Vec::new(),
                support_radius: 0.625,
                positions: vec![[0.1, 0.2, 0.3], [0.4, 0.8, 0.3], [0.9, 0.7, 0.1]],
                normals: vec![[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.6, -0.8]],
                albedo: vec![[0.5; 3]; 3],
            },
        ],
        separations: Some(Separations {
            pairs: vec![[2, 1], [4, 0]],
            near: vec![0, 2],
        }),
        senders: Some(Senders {
            counts: vec![2, 3],
            leaf_of_point: vec![1, 2, 1],
            importance: vec![0, 64, 17],
            parents: vec![vec![0, 1, 0]],
        }),
        transfer: Some(Links {
            receivers: 5,
            senders: 5,
            row_offsets: vec![0, 1, 3, 3, 5, 6],
            columns: vec![1, 0, 1, 2, 4, 0],
            vectors: vec![
                [0.1, -0.2, 0.3],
                [0.0; 3],
                [1e-3, 2e-4, -0.5],
                [0.7, 0.7, 0.1],
                [-1.9, 0.0, 0.0],
                [0.01, 0.02, 0.03],
            ],
        }),
        bounce: Some(BounceLinks {
            level: 0,
            matrix: weight_rows(1.0),
        }),
        // A real asset has one of the two.
        solution: Some(Solution {
            level: 0,
            channels: [4.0, 2.0, 1.0].map(weight_rows).to_vec(),
        }),
        estimates: Some(Estimates {
            values: vec![("relmse_indirect".into(), 0.0123)],
        }),
        light_tree: Some(LightTree { lights: directions() }),
        cuts: Some(completed(Cuts {
            sigma: 2.0,
            unit: 1.0,
            row_offsets: vec![0, 1, 5, 9],
            heights: vec![8, 0, 0, 1, 2, 4, 4, 5, 6],
            values: vec![0.0, 1.0, 0.0, 0.5, 0.25, 0.9, 0.1, 0.7, 1.0],
        })),
        coding: Coding::default(),
    }
}

/// The smallest environment: 256 directions in the bit-reversed order of the lattice.
pub fn directions() -> LightSamples {
    LightSamples::Environment {
        order: (0..256u32).map(|i| u32::from((i as u8).reverse_bits())).collect(),
    }
}

/// 256 surface lights on a wall, in rows.
pub fn wall() -> LightSamples {
    LightSamples::Surface {
        area: 0.0625,
        positions: (0..256)
            .map(|i| [(i % 16) as f32 * 0.25, (i / 16) as f32 * 0.25, -1.0])
            .collect(),
        normals: vec![[0.0, 0.6, 0.8]; 256],
    }
}

/// Each row with the nodes that it lacks to tile 256 leaves, of value 0.3.
pub fn completed(cuts: Cuts) -> Cuts {
    let mut whole = Cuts {
        row_offsets: vec![0],
        heights: vec![],
        values: vec![],
        ..cuts
    };
    for row in cuts.row_offsets.windows(2) {
        let row = row[0] as usize..row[1] as usize;
        let mut start: u32 = cuts.heights[row.clone()].iter().map(|h| 1 << h).sum();
        whole.heights.extend(&cuts.heights[row.clone()]);
        whole.values.extend(&cuts.values[row]);
        while start < 256 {
            let height = start.trailing_zeros().min(8);
            whole.heights.push(height as u8);
            whole.values.push(0.3);
            start += 1 << height;
        }
        whole.row_offsets.push(whole.heights.len() as u32);
    }
    whole
}

/// One section to forge, with every field of its table entry but those that follow from the bytes.
#[derive(Clone)]
pub struct Forged {
    pub kind: u32,
    pub version: u16,
    pub flags: u16,
    pub codec: u32,
    pub needs: u32,
    pub raw_bytes: u64,
    pub stored: Vec<u8>,
}

impl Forged {
    /// A stored, required section of version 1.
    pub fn new(kind: u32, stored: Vec<u8>) -> Self {
        Forged {
            kind,
            version: 1,
            flags: 1,
            codec: 0,
            needs: 1,
            raw_bytes: stored.len() as u64,
            stored,
        }
    }

    /// The raw bytes of a section of the crate's own writer.
    pub fn raw(&self) -> Vec<u8> {
        match self.codec {
            0 => self.stored.clone(),
            _ => zstd::bulk::decompress(&self.stored, self.raw_bytes as usize).unwrap(),
        }
    }

    /// The section with other raw bytes, stored as they are.
    pub fn with_raw(&self, raw: Vec<u8>) -> Self {
        Forged {
            codec: 0,
            raw_bytes: raw.len() as u64,
            stored: raw,
            ..*self
        }
    }
}

/// A container around any sections, written from SPEC.md sections 3 and 4, all checksums right.
pub fn forge(sections: &[Forged]) -> Vec<u8> {
    let mut body: Vec<u8> = Vec::new();
    let mut table: Vec<u8> = Vec::new();
    for s in sections {
        table.extend(s.kind.to_le_bytes());
        table.extend(s.version.to_le_bytes());
        table.extend(s.flags.to_le_bytes());
        table.extend(s.codec.to_le_bytes());
        table.extend(s.needs.to_le_bytes());
        table.extend((56 + body.len() as u64).to_le_bytes());
        table.extend((s.stored.len() as u64).to_le_bytes());
        table.extend(s.raw_bytes.to_le_bytes());
        table.extend(xxh3_64(&s.stored).to_le_bytes());
        body.extend(&s.stored);
    }
    let table_offset = 56 + body.len() as u64;
    let mut file = vec![0x8b, b'R', b'L', b'T', 0x0d, 0x0a, 0x1a, 0x0a];
    file.extend([4, 3, 2, 1, 1, 0, 0, 0]);
    file.extend((table_offset + table.len() as u64).to_le_bytes());
    file.extend(table_offset.to_le_bytes());
    file.extend((sections.len() as u32).to_le_bytes());
    file.extend([0; 4]);
    file.extend(xxh3_64(&table).to_le_bytes());
    file.extend(xxh3_64(&file).to_le_bytes());
    file.extend(body);
    file.extend(table);
    file
}

/// Recomputes the header's checksum after a test changed the header.
pub fn reseal_header(file: &mut [u8]) {
    let checksum = xxh3_64(&file[..48]);
    file[48..56].copy_from_slice(&checksum.to_le_bytes());
}

/// The stored sections of a file, read from its table as SPEC.md section 4 has it.
pub fn sections_of(file: &[u8]) -> Vec<Forged> {
    let u64_at = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap());
    let u32_at = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
    let table = u64_at(24) as usize;
    (0..u32_at(32) as usize)
        .map(|i| {
            let at = table + 48 * i;
            let offset = u64_at(at + 16) as usize;
            Forged {
                kind: u32_at(at),
                version: u32_at(at + 4) as u16,
                flags: (u32_at(at + 4) >> 16) as u16,
                codec: u32_at(at + 8),
                needs: u32_at(at + 12),
                raw_bytes: u64_at(at + 32),
                stored: file[offset..offset + u64_at(at + 24) as usize].to_vec(),
            }
        })
        .collect()
}

/// The files of all versions, with their paths, in the order of these.
pub fn fixtures() -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let mut all: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_file())
        .map(|path| (path.display().to_string(), std::fs::read(path).unwrap()))
        .collect();
    all.sort();
    all
}
