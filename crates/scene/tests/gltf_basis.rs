//! KHR_texture_basisu. Independent truth: the texels from which Basis Universal 2.10 wrote the files below.
#![cfg(feature = "gltf")]

mod gltf_support;

use base64::Engine;
use gltf_support::Doc;
use relight_scene::gltf::ImportError;
use relight_scene::image::{Image8, Limits, decode_ldr};
use relight_scene::scene::Scene;
use serde_json::json;

/// 10 × 6 texels of [`texel`] with four levels, opaque.
const ETC1S: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAKAAAABgAAAAAAAAAAAAAAAQAAAAQAAAABAAAAsAAAACwAAADcAAAAJAAAAAABAAAAAAAA6AAA\
    AAAAAADsAQAAAAAAAAQAAAAAAAAAAAAAAAAAAADqAQAAAAAAAAIAAAAAAAAAAAAAAAAAAADpAQAAAAAAAAEAAAAAAAAAAAAAAAAA\
    AADoAQAAAAAAAAEAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA/////x8AAABL\
    VFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAoABQA/AAAAFQAAADAAAAAAAAAAAAAAAAAAAAAEAAAAAAAAAAAAAAAAAAAA\
    AAAAAAIAAAAAAAAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAAAAAAAAAAAAAABAAAAAAAAAAAAAAAgwNsAAQAAIGwi5QMgwBMAAQAA\
    QY1OQqehJzQDmAEAAAAAAIJ82zoApgAAAAAAgiBsZOQIHJc8KSHqb+s7SNjs7+/vr6r6/6+qqqoCgPL3V1VVVQUAwUQAAAAAAADy\
    X00BmAIwAAAABMC8GCbAEwECAIAhtyEIoicIACYAAAAAAAAQQABOJgoH8kaFEQ==";
/// The same with alpha, in a slice of its own.
const ETC1S_ALPHA: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAKAAAABgAAAAAAAAAAAAAAAQAAAAQAAAABAAAAsAAAADwAAADsAAAAJAAAABABAAAAAAAAAAEA\
    AAAAAAAZAgAAAAAAAAgAAAAAAAAAAAAAAAAAAAAVAgAAAAAAAAQAAAAAAAAAAAAAAAAAAAASAgAAAAAAAAMAAAAAAAAAAAAAAAAA\
    AAAQAgAAAAAAAAIAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8A\
    AAAAAAAAAP////8fAAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjEwAAAOAAcASQAAAB0AAAA2AAAAAAAAAAAAAAAAAAAA\
    BAAAAAQAAAAEAAAAAAAAAAAAAAACAAAAAgAAAAIAAAAAAAAAAAAAAAIAAAACAAAAAQAAAAAAAAAAAAAAAQAAAAEAAAABAAAAF0AU\
    gAEAACAYmmJ7AQI8ARAAABBULUOvQUsQIArAAACAIKxaFDfdCwEEIAKAAACAIEhnkvmJQOa38KPusmGDJK2KLi7w28PFAvxXraqq\
    qqqqqqr6///////v7+/vB4Dy91dVVVUFAMFEAAAAAEAYBpW/QTYHmAMwB0AAAEAQgGURXksBnjgQAAAIOhcEg5EnYAAwAQAAAAAA\
    gAACBlK2AVJ+JB0JBCNnASt8iRc=";
/// UASTC under Zstandard.
const UASTC_ALPHA: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAKAAAABgAAAAAAAAAAAAAAAQAAAAQAAAACAAAAsAAAACwAAADcAAAAJAAAAAAAAAAAAAAAAAAA\
    AAAAAABbAQAAAAAAAEUAAAAAAAAAYAAAAAAAAAAyAQAAAAAAACkAAAAAAAAAIAAAAAAAAAAZAQAAAAAAABkAAAAAAAAAEAAAAAAA\
    AAAAAQAAAAAAABkAAAAAAAAAEAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABL\
    VFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAACi1L/0gEIEAAHfQadM7gmoCAAAAAAAAAAAotS/9IBCBAABO0uHpsNQ0QzqK\
    +I//+I//KLUv/SAgAQEATzYg1AbvGDMHZxj/8fB4eBaw1SKrStJFMXgBkCT///8otS/9IGDlAQC0AhcFBfk/MCYDAFcQRfA/ggUC\
    AJcbhed/1OQAFwUPeXMkDk9wM4IPj2dz1O4GAKBoYPRUxgDCQT4ZOAI=";
/// The same, opaque.
const UASTC: &str = "\
    q0tUWCAyMLsNChoKAAAAAAEAAAAKAAAABgAAAAAAAAAAAAAAAQAAAAQAAAACAAAAsAAAACwAAADcAAAAJAAAAAAAAAAAAAAAAAAA\
    AAAAAABbAQAAAAAAAEUAAAAAAAAAYAAAAAAAAAAyAQAAAAAAACkAAAAAAAAAIAAAAAAAAAAZAQAAAAAAABkAAAAAAAAAEAAAAAAA\
    AAAAAQAAAAAAABkAAAAAAAAAEAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AAAAAAAAAAAA/////x8AAABL\
    VFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAACi1L/0gEIEAAHfQafM/gmoCAAAAAAAAAAAotS/9IBCBAAAxSfMUS00zpPH/\
    8P/w//D/KLUv/SAgAQEAWzYQ1qm+4u8DMwAzzP/M/2FAa6GqJF0UAQAiIv////8otS/9IGDlAQC0AhcFBfk/MCYDAFcQRfA/ggUC\
    AJcbhed/1OQAFwUP+X8kDk/wP4IPj+d/1O4GAKBoYPRUxgDCQT4ZOAI=";

fn bytes(file: &str) -> Vec<u8> {
    base64::engine::general_purpose::STANDARD.decode(file).unwrap()
}

/// Blocks of one colour each.
fn texel(x: usize, y: usize, alpha: bool) -> [u8; 4] {
    let (x, y) = (x / 4, y / 4);
    let alpha = if alpha { 255 - 100 * y } else { 255 };
    [40 + 90 * x, 40 + 80 * y, 200 - 70 * x, alpha].map(|v| v as u8)
}

/// A triangle whose base colour and normals are the KTX2 file.
fn textured(file: &[u8]) -> Doc {
    let mut doc = Doc::triangle();
    let view = doc.view(file);
    let uvs = doc.floats(&[0., 0., 1., 0., 0., 1.], "VEC2");
    doc.set("/meshes/0/primitives/0/attributes/TEXCOORD_0", uvs.into());
    doc.set("/meshes/0/primitives/0/material", json!(0));
    doc.set(
        "/images",
        json!([{ "bufferView": view, "mimeType": "image/ktx2", "name": "blocks" }]),
    );
    doc.set(
        "/textures",
        json!([{ "extensions": { "KHR_texture_basisu": { "source": 0 } } }]),
    );
    doc.set(
        "/materials",
        json!([{ "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } }, "normalTexture": { "index": 0 } }]),
    );
    doc.set("/extensionsRequired", json!(["KHR_texture_basisu"]));
    doc
}

fn picture(scene: &Scene) -> Image8 {
    assert_eq!(scene.textures.len(), 1, "one for colour and for normals");
    assert!(
        scene.textures[0].encoded.starts_with(b"\x89PNG"),
        "players have no transcoder"
    );
    decode_ldr("t", &scene.textures[0].encoded, &Limits::default()).unwrap()
}

#[test]
fn etc1s_and_uastc_become_png() {
    // UASTC keeps blocks of one colour; ETC1S has five bits of each channel.
    for (file, alpha, tolerance) in [
        (ETC1S, false, 4),
        (ETC1S_ALPHA, true, 4),
        (UASTC_ALPHA, true, 0),
        (UASTC, false, 0),
    ] {
        let scene = textured(&bytes(file)).scene();
        assert_eq!(scene.textures[0].name, "blocks");
        assert_eq!(scene.notes, Vec::<String>::new());
        let image = picture(&scene);
        assert_eq!((image.width, image.height), (10, 6));
        for (i, found) in image.rgba8.iter().enumerate() {
            let expected = texel(i % 10, i / 10, alpha);
            let far = found
                .iter()
                .zip(expected)
                .map(|(f, e)| f.abs_diff(e))
                .max()
                .unwrap();
            assert!(far <= tolerance, "texel {i}: {found:?} where {expected:?} was");
        }
    }
}

#[test]
fn another_image_of_the_texture_is_taken() {
    let mut doc = textured(&bytes(UASTC));
    let png = doc.view(gltf_support::PNG);
    doc.push("/images", json!({ "bufferView": png }));
    doc.set("/textures/0/source", json!(1));
    assert_eq!(doc.scene().textures[0].encoded, gltf_support::PNG);
}

/// A KTX 2.0 file of one level: the header after the specification's section 3, no description of the format, and the level.
fn plain(format: u32, [width, height]: [u32; 2], scheme: u32, level: &[u8], size: u64) -> Vec<u8> {
    let mut file = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    for word in [format, 1, width, height, 0, 0, 1, 1, scheme, 0, 0, 0, 0] {
        file.extend(word.to_le_bytes());
    }
    for long in [0, 0, 104, level.len() as u64, size] {
        file.extend(long.to_le_bytes());
    }
    assert_eq!(file.len(), 104);
    file.extend(level);
    file
}

/// Truth: the same by KHR_texture_basisu.
#[test]
fn the_proposed_khr_texture_ktx_is_read_as_far_as_its_first_layer() {
    let texels = [10, 20, 30, 255, 40, 50, 60, 255];
    let file = plain(37, [2, 1], 0, &texels, 8);
    let with_layer = |layer: u32| {
        let mut doc = textured(&file);
        doc.set(
            "/textures",
            json!([{ "extensions": { "KHR_texture_ktx": { "source": 0, "layer": layer } } }]),
        );
        doc.set("/extensionsRequired", json!(["KHR_texture_ktx"]));
        doc
    };
    let expected = picture(&textured(&file).scene());
    assert_eq!(picture(&with_layer(0).scene()).rgba8, expected.rgba8);
    let error = with_layer(3).import().unwrap_err().to_string();
    assert!(
        error.contains("textures[0]") && error.contains("layer 3"),
        "{error}"
    );
}

/// Truth: the texels. `zlib` and `zstd` are those of 2 × 2 texels of red and green, as Python's `zlib` and the program `zstd` write them.
#[test]
fn plain_texels_are_read_with_a_note() {
    let texels = [10u8, 20, 30, 40, 50, 60, 70, 80];
    let zstd = [
        0x28, 0xb5, 0x2f, 0xfd, 0x20, 0x08, 0x41, 0x00, 0x00, 10, 20, 30, 40, 50, 60, 70, 80,
    ];
    let zlib = [
        0x78, 0x01, 0x01, 0x08, 0x00, 0xf7, 0xff, 10, 20, 30, 40, 50, 60, 70, 80, 0x04, 0xb8, 0x01, 0x69,
    ];
    for (format, scheme, level) in [
        (16, 0, &texels[..]),
        (16, 2, &zstd),
        (16, 3, &zlib),
        (22, 0, &texels),
    ] {
        let scene = textured(&plain(format, [2, 2], scheme, level, 8)).scene();
        assert!(
            scene.notes[0].contains("not Basis Universal's"),
            "{:?}",
            scene.notes
        );
        let found = picture(&scene).rgba8;
        assert_eq!(
            found,
            [
                [10, 20, 0, 255],
                [30, 40, 0, 255],
                [50, 60, 0, 255],
                [70, 80, 0, 255]
            ]
        );
    }
    let scene = textured(&plain(44, [2, 1], 0, &texels, 8)).scene();
    assert_eq!(
        picture(&scene).rgba8,
        [[30, 20, 10, 40], [70, 60, 50, 80]],
        "blue first"
    );
    for (file, what) in [
        (plain(16, [2, 1], 2, &zstd, 8), "images[0]: "),
        (plain(16, [2, 1], 3, &zlib, 8), "images[0]: can't be decompressed"),
        (
            plain(16, [3, 2], 2, &zstd, 8),
            "holds 8 bytes of 3 × 2 texels, which have 12",
        ),
        (
            plain(16, [2, 2], 0, &texels[..7], 8),
            "holds 7 bytes of 2 × 2 texels, which have 8",
        ),
        (
            plain(131, [4, 4], 0, &texels, 8),
            "texels of BC1_RGB_UNORM_BLOCK, where KHR_texture_basisu has ETC1S and UASTC",
        ),
        (plain(37, [1 << 20, 1 << 20], 2, &zstd, 8), "over the limit"),
    ] {
        let error = textured(&file).import().unwrap_err().to_string();
        assert!(error.contains(what), "{what}: {error}");
    }
}

/// Fields of the header: at 20 the width, at 36 the faces, at 44 the supercompression, at 96 what level 0 decompresses to.
#[test]
fn files_of_another_kind_and_bombs_are_refused_by_place() {
    for (file, at, value, what) in [
        (UASTC, 20, 0u32, "is no whole KTX 2.0 file"),
        (UASTC, 28, 2, "is not one two-dimensional picture"),
        (UASTC, 36, 6, "is not one two-dimensional picture"),
        (ETC1S, 20, 1 << 31, "over the limit"),
        (UASTC, 20, 1 << 14, "declares 96 bytes for 16384 × 6 texels"),
        (
            UASTC,
            96,
            u32::MAX,
            "declares 4294967295 bytes for 10 × 6 texels, which have 96",
        ),
        (UASTC, 100, u32::MAX, "bytes for 10 × 6 texels, which have 96"),
        (UASTC, 12, 131, "where KHR_texture_basisu has ETC1S and UASTC"),
        (ETC1S, 64, 1, "images[0]: "),
    ] {
        let mut bytes = bytes(file);
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        let error = textured(&bytes).import().unwrap_err().to_string();
        assert!(
            error.contains("images[0]: ") && error.contains(what),
            "{what}: {error}"
        );
    }
}

/// A frame of Zstandard (RFC 8878) of one block of sequences that all copy one literal and, 65,539 + 65,535 times, the byte before: two
/// bytes make 131,075.
fn bomb(sequences: u32) -> Vec<u8> {
    let mut block = ((sequences << 4 | 0b11_01).to_le_bytes()[..3]).to_vec();
    block.push(b'a');
    block.extend([(sequences >> 8) as u8 + 128, sequences as u8]);
    // Each code repeated: literals 1, offset 0, match length 52.
    block.extend([0b0101_0100, 1, 0, 52]);
    block.extend(vec![0xff; 2 * sequences as usize]);
    block.push(1);
    let header = (block.len() as u32) << 3 | 0b101;
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0xa0];
    frame.extend((sequences * 131_075).to_le_bytes());
    frame.extend(&header.to_le_bytes()[..3]);
    frame.extend(block);
    frame
}

/// The largest amount of memory this process ever held, in bytes. 0 where the system does not say.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let number = line.unwrap_or("0 kB").trim().trim_end_matches(" kB").parse();
    number.unwrap_or(0) * 1024
}

/// A decoder that makes the whole block before it looks at its size takes 2 GB.
#[test]
fn a_block_that_grows_without_bounds_takes_no_memory() {
    let frame = bomb(16_000);
    let mut uastc = bytes(UASTC);
    let place = [uastc.len() as u64, frame.len() as u64].map(u64::to_le_bytes);
    uastc[80..96].copy_from_slice(place.as_flattened());
    uastc.extend(&frame);
    let before = peak_memory();
    for file in [uastc, plain(37, [16, 16], 2, &frame, 1024)] {
        let error = textured(&file).import().unwrap_err().to_string();
        assert!(error.contains("images[0]: can't be decompressed"), "{error}");
    }
    let grown = peak_memory() - before;
    assert!(grown < 1 << 28, "memory grew by {grown} bytes");
}

#[test]
fn damaged_files_are_refused_or_give_a_picture() {
    let plain = plain(16, [2, 2], 0, &[10, 20, 30, 40, 50, 60, 70, 80], 8);
    for whole in [ETC1S, ETC1S_ALPHA, UASTC_ALPHA, UASTC]
        .map(bytes)
        .into_iter()
        .chain([plain])
    {
        for at in (0..whole.len()).step_by(5) {
            let mut damaged = whole.clone();
            damaged[at] = damaged[at].wrapping_mul(37).wrapping_add(11);
            for bytes in [&damaged[..], &whole[..at]] {
                match textured(bytes).import() {
                    Ok(scene) => assert!(!picture(&scene).rgba8.is_empty()),
                    Err(error) => assert!(!matches!(error, ImportError::Internal { .. }), "{error}"),
                }
            }
        }
    }
}
