//! What is written is read back, by our reader and by the `exr` crate alone; damaged files are refused.

use super::*;
use exr::meta::attribute::AttributeValue;
use exr::prelude::{self as ex, ReadChannels, ReadLayers, WritableImage};

fn ramp(width: usize, height: usize, scale: f32) -> FloatImage {
    let mut image = FloatImage::black(width, height);
    for (i, p) in image.pixels.iter_mut().enumerate() {
        let (x, y) = ((i % width) as f32, (i / width) as f32);
        *p = [
            scale * (x + 1.0) / width as f32,
            scale * (y + 0.5) / height as f32,
            scale * (x * y).sin().abs(),
        ];
    }
    image
}

fn frame() -> Layers {
    // 37 columns and 35 rows: an odd width and a last block that is not full.
    let mut layers = Layers::from_image(BEAUTY, &ramp(37, 35, 1.0));
    layers.push_rgb("indirect", &ramp(37, 35, 0.1).pixels);
    layers.push_rgb(
        "light.a name of more than thirty-one bytes",
        &ramp(37, 35, 3.0).pixels,
    );
    layers.push_rgb("normal", &ramp(37, 35, -1.0).pixels);
    layers.push_scalar(
        "depth",
        &(0..37 * 35).map(|i| i as f32 * 0.37).collect::<Vec<_>>(),
    );
    layers
}

fn assert_close(read: &Layers, written: &Layers, relative: f32) {
    assert_eq!((read.width, read.height), (written.width, written.height));
    assert_eq!(read.layers.len(), written.layers.len());
    for layer in &written.layers {
        let other = read
            .layer(&layer.name)
            .unwrap_or_else(|| panic!("no layer {}", layer.name));
        assert_eq!(other.channels, layer.channels);
        for (a, b) in layer.data.iter().zip(&other.data) {
            // 2⁻²⁵ is half of half's smallest denormal.
            assert!(
                (a - b).abs() <= relative * a.abs() + 2.0_f32.powi(-25),
                "{}: {a} {b}",
                layer.name
            );
        }
    }
}

/// Truth: the values themselves. Half keeps 11 significant bits, so rounding moves a value by at most 2⁻¹¹ of it.
#[test]
fn a_frame_comes_back_within_half_precision_and_exactly_in_float() {
    for (float, relative) in [(false, 2.0_f32.powi(-11)), (true, 0.0)] {
        let (bytes, warnings) = encode_exr("t", &frame(), &ExrHeader::new(), float).unwrap();
        assert_eq!(warnings, []);
        let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
        assert_eq!(read.layers[0].name, BEAUTY);
        assert_close(&read, &frame(), relative);
    }
}

/// Truth: the `exr` crate, an independent reader, in its pedantic mode.
#[test]
fn the_exr_crate_reads_our_files_pedantically_with_names_and_attributes() {
    let header = ExrHeader {
        asset_hash: Some("00ff".into()),
        seed: Some(u64::MAX),
        frames_per_second: Some(24.0),
        frame: Some(7),
        ..ExrHeader::new()
    };
    let (bytes, _) = encode_exr("t", &frame(), &header, false).unwrap();
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .pedantic()
        .from_buffered(std::io::Cursor::new(&bytes))
        .unwrap();
    assert_eq!(image.layer_data.len(), 1, "one part");
    let part = &image.layer_data[0];
    let names: Vec<String> = part
        .channel_data
        .list
        .iter()
        .map(|c| c.name.to_string())
        .collect();
    for name in ["R", "G", "B", "indirect.R", "normal.X", "normal.Z", "depth.Z"] {
        assert!(names.iter().any(|n| n == name), "{name} in {names:?}");
    }
    for channel in &part.channel_data.list {
        let half = matches!(channel.sample_data, ex::FlatSamples::F16(_));
        assert_eq!(half, channel.name.to_string() != "depth.Z", "{}", channel.name);
    }
    assert_eq!(part.encoding.compression, ex::Compression::ZIP16);
    let white = image.attributes.chromaticities.unwrap().white;
    assert_eq!((white.0, white.1), (0.3127, 0.3290));
    assert!(
        part.attributes
            .software_name
            .as_ref()
            .unwrap()
            .to_string()
            .starts_with("relight ")
    );
    assert_eq!(part.attributes.frames_per_second, Some((24, 1)));
    let other = |name: &str| part.attributes.other.get(&ex::Text::from(name)).unwrap().clone();
    assert_eq!(other("imageCounter"), AttributeValue::I32(7));
    assert_eq!(other("relightAssetHash"), AttributeValue::Text("00ff".into()));
    assert_eq!(
        other("relightSeed"),
        AttributeValue::Text("18446744073709551615".into())
    );
}

/// What compositors look for comes back under its name, and what is no colour stays as it is, bit by bit.
#[test]
fn coverage_distances_and_identifiers_keep_names_and_bits() {
    let mut layers = frame();
    let values: Vec<f32> = (0..37 * 35).map(|i| 1.0 + i as f32 * 1e-4).collect();
    layers.push_scalar(ALPHA, &values);
    layers.push_scalar(RAY_DEPTH, &values);
    let raw: Vec<[f32; 4]> = (values.iter())
        .map(|v| [*v, -v, f32::MAX, f32::MIN_POSITIVE])
        .collect();
    layers.push_raw("CryptoObject00", &raw);
    let (bytes, warnings) = encode_exr("t", &layers, &ExrHeader::new(), false).unwrap();
    assert_eq!(warnings, []);
    let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
    assert_eq!(read.layer(RAY_DEPTH).unwrap().data, values);
    assert_eq!(
        read.layer(DEPTH).unwrap().data,
        frame().layer(DEPTH).unwrap().data
    );
    assert!(read.layer(ALPHA).is_some());
    let three = read.rgb("CryptoObject00").unwrap().pixels;
    assert!(three.iter().zip(&raw).all(|(read, raw)| *read == raw[..3]));
    let fourth = &read.layer("CryptoObject00.a").unwrap().data;
    assert!(fourth.iter().all(|v| *v == f32::MIN_POSITIVE));
}

/// Also with all attributes, which the `exr` crate keeps in a map of random order.
#[test]
fn equal_frames_give_equal_bytes_whatever_the_number_of_threads() {
    let header = ExrHeader {
        asset_hash: Some("00ff".into()),
        seed: Some(1),
        frames_per_second: Some(24.0),
        frame: Some(7),
        ..ExrHeader::new()
    };
    let encode = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let encode = || encode_exr("t", &frame(), &header, false).unwrap().0;
        pool.unwrap().install(encode)
    };
    let first = encode(1);
    for threads in (0..24).map(|i| 1 + i % 5) {
        assert_eq!(first, encode(threads));
    }
}

/// Truth: "OpenEXR File Layout": bit 10 of the version field is set if any name is longer than 31 bytes, and only then.
#[test]
fn files_with_long_names_say_so() {
    for (name, long) in [("b".repeat(29), false), ("b".repeat(30), true)] {
        let mut layers = Layers::new(1, 1);
        layers.push_scalar(&name, &[1.0]);
        let (bytes, _) = encode_exr("t", &layers, &ExrHeader::new(), false).unwrap();
        let version = u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
        assert_eq!(version, if long { 2 | 1 << 10 } else { 2 });
        assert_eq!(decode_exr("t", &bytes, &Limits::default()).unwrap(), layers);
    }
}

/// Truth: half's largest finite number is 65504; 65520 is the first that rounds up to infinity (IEEE 754 binary16).
#[test]
fn light_beyond_half_precision_is_written_in_32_bits_with_a_warning() {
    let mut layers = Layers::new(2, 1);
    layers.push_scalar("just fits", &[65519.0, 1.0]);
    layers.push_scalar("too bright", &[65520.0, 1.0]);
    layers.push_scalar("starlight", &[1e-20, 0.0]);
    layers.push_scalar("black", &[0.0, 0.0]);
    let (bytes, warnings) = encode_exr("t", &layers, &ExrHeader::new(), false).unwrap();
    let beyond = |layer: &str, largest| ExrWarning::BeyondHalf {
        layer: layer.into(),
        largest,
    };
    assert_eq!(
        warnings,
        [beyond("too bright", 65520.0), beyond("starlight", 1e-20)]
    );
    let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
    assert_eq!(read.layer("just fits").unwrap().data, [65504.0, 1.0]);
    assert_eq!(read.layer("too bright").unwrap().data, [65520.0, 1.0]);
    assert_eq!(read.layer("starlight").unwrap().data, [1e-20, 0.0]);
}

#[test]
fn values_that_are_no_numbers_are_counted_and_never_written() {
    let mut layers = Layers::new(2, 2);
    layers.push_scalar("bad", &[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1.0]);
    for (float, largest) in [(false, 65504.0), (true, f32::MAX)] {
        let (bytes, warnings) = encode_exr("t", &layers, &ExrHeader::new(), float).unwrap();
        assert_eq!(
            warnings,
            [ExrWarning::NotFinite {
                layer: "bad".into(),
                nan: 1,
                infinite: 2
            }]
        );
        let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
        assert_eq!(read.layer("bad").unwrap().data, [0.0, largest, -largest, 1.0]);
    }
}

#[test]
fn frames_that_are_no_files_are_refused_with_a_reason() {
    let refuse = |layers: &Layers| {
        encode_exr("out.exr", layers, &ExrHeader::new(), false)
            .unwrap_err()
            .to_string()
    };
    assert!(refuse(&Layers::new(4, 4)).contains("0 channels"));
    let mut twice = Layers::new(1, 1);
    twice.push_scalar("a", &[0.0]);
    twice.push_scalar("a", &[0.0]);
    assert!(refuse(&twice).contains("a.Y would be written twice"));
    let mut short = Layers::new(2, 1);
    short.push_scalar("a", &[0.0]);
    assert!(refuse(&short).contains("out.exr: layer a has 1 values"));
    let mut nameless = Layers::new(1, 1);
    nameless.push_scalar("", &[0.0]);
    assert!(refuse(&nameless).contains("no name"));
}

/// Truth: the values given to the `exr` crate's writer.
#[test]
fn files_of_other_programs_are_read_half_float_uint_tiles_and_parts() {
    let size = (33, 18);
    let n = size.0 * size.1;
    let value = |i: usize| (i % 251) as f32;
    let part = |name: &str, blocks, compression| {
        let list = ex::AnyChannels::sort(
            vec![
                ex::AnyChannel::new("A", ex::FlatSamples::F32(vec![1.0; n])),
                ex::AnyChannel::new(
                    "B",
                    ex::FlatSamples::F32((0..n).map(|i| 3.0 * value(i)).collect()),
                ),
                ex::AnyChannel::new(
                    "G",
                    ex::FlatSamples::U32((0..n).map(|i| 2 * (i as u32 % 251)).collect()),
                ),
                ex::AnyChannel::new(
                    "R",
                    ex::FlatSamples::F16((0..n).map(|i| half::f16::from_f32(value(i))).collect()),
                ),
                ex::AnyChannel::new("mist.V", ex::FlatSamples::F32((0..n).map(value).collect())),
            ]
            .into(),
        );
        let encoding = ex::Encoding {
            compression,
            blocks,
            line_order: ex::LineOrder::Increasing,
        };
        ex::Layer::new(size, ex::LayerAttributes::named(name), encoding, list)
    };
    let write = |parts: Vec<ex::Layer<ex::AnyChannels<ex::FlatSamples>>>| {
        let attributes = ex::ImageAttributes::with_size(size);
        let mut out = std::io::Cursor::new(Vec::new());
        ex::Image {
            attributes,
            layer_data: ex::Layers::from(parts),
        }
        .write()
        .to_buffered(&mut out)
        .unwrap();
        decode_exr("t", &out.into_inner(), &Limits::default()).unwrap()
    };
    let rgb: Vec<f32> = (0..n)
        .flat_map(|i| [value(i), 2.0 * value(i), 3.0 * value(i)])
        .collect();
    use ex::{Blocks, Compression};
    for (blocks, compression) in [
        (Blocks::ScanLines, Compression::Uncompressed),
        (Blocks::ScanLines, Compression::ZIP1),
        (Blocks::Tiles(ex::Vec2(16, 16)), Compression::ZIP16),
        (Blocks::Tiles(ex::Vec2(8, 16)), Compression::RLE),
        (Blocks::ScanLines, Compression::PIZ),
    ] {
        let read = write(vec![part("alone", blocks, compression)]);
        assert_eq!(read.layer(BEAUTY).unwrap().data, rgb, "{compression:?}");
        assert_eq!(read.layer("A").unwrap().data, vec![1.0; n]);
        assert_eq!(read.layer("mist").unwrap().data.len(), n);
    }
    let two = write(vec![
        part("left", Blocks::ScanLines, Compression::ZIP16),
        part("right", Blocks::ScanLines, Compression::RLE),
    ]);
    for name in ["left", "right"] {
        assert_eq!(two.layer(name).unwrap().data, rgb);
        assert_eq!(two.layer(&format!("{name}.A")).unwrap().channels, 1);
        assert_eq!(two.layer(&format!("{name}.mist")).unwrap().channels, 1);
    }
}

#[test]
fn a_file_over_the_limits_is_refused_before_it_is_decoded() {
    let (bytes, _) = encode_exr("t", &frame(), &ExrHeader::new(), false).unwrap();
    let small = Limits {
        max_pixels: 37 * 35 - 1,
        ..Limits::default()
    };
    assert!(matches!(
        decode_exr("t", &bytes, &small),
        Err(ImageError::LimitExceeded { .. })
    ));
    // 12 channels of 2 bytes in the file and one of 4, all of 4 in memory.
    let few_bytes = Limits {
        max_bytes: 37 * 35 * (12 * 6 + 8) - 1,
        ..Limits::default()
    };
    assert!(matches!(
        decode_exr("t", &bytes, &few_bytes),
        Err(ImageError::LimitExceeded { .. })
    ));
    let enough = Limits {
        max_bytes: 37 * 35 * (12 * 6 + 8),
        max_pixels: 37 * 35,
        ..Limits::default()
    };
    assert!(decode_exr("t", &bytes, &enough).is_ok());
}

/// A header that asks for 2²⁶ × 64 pixels in a file of a few kilobytes is refused by the file's length alone.
#[test]
fn a_size_that_the_file_cannot_hold_is_refused() {
    let (mut bytes, _) = encode_exr("t", &frame(), &ExrHeader::new(), false).unwrap();
    let at = bytes
        .windows(17)
        .position(|w| w == b"dataWindow\0box2i\0")
        .unwrap()
        + 17
        + 4
        + 8;
    bytes[at..at + 4].copy_from_slice(&((1_u32 << 20) - 1).to_le_bytes());
    let limits = Limits {
        max_bytes: u64::MAX,
        max_pixels: u64::MAX,
        ..Limits::default()
    };
    let message = decode_exr("t", &bytes, &limits).unwrap_err().to_string();
    assert!(message.contains("cannot be in"), "{message}");
}

#[test]
fn every_strict_prefix_of_a_file_is_an_error() {
    let (bytes, _) = encode_exr("t", &frame(), &ExrHeader::new(), false).unwrap();
    for length in (0..bytes.len()).step_by(61).chain([bytes.len() - 1]) {
        assert!(
            decode_exr("t", &bytes[..length], &Limits::default()).is_err(),
            "{length} bytes"
        );
    }
}

#[test]
fn a_missing_file_is_an_error_that_names_it() {
    let message = read_exr(std::path::Path::new("no/such.exr"), &Limits::default())
        .unwrap_err()
        .to_string();
    assert!(message.contains("no/such.exr"), "{message}");
}

/// A file of one part with R, G, B of `rgb` in float, its data window at `position`.
fn foreign(
    names: [&str; 3],
    size: (usize, usize),
    position: (i32, i32),
    rgb: &[[f32; 3]],
    attributes: ex::ImageAttributes,
    projection: Option<exr::meta::attribute::EnvironmentMap>,
) -> Vec<u8> {
    let channel =
        |k: usize| ex::AnyChannel::new(names[k], ex::FlatSamples::F32(rgb.iter().map(|c| c[k]).collect()));
    let list = ex::AnyChannels::sort(vec![channel(0), channel(1), channel(2)].into());
    let part = ex::LayerAttributes {
        layer_position: ex::Vec2(position.0, position.1),
        environment_map: projection,
        ..ex::LayerAttributes::default()
    };
    let encoding = ex::Encoding::SMALL_LOSSLESS;
    let layers = vec![ex::Layer::new(size, part, encoding, list)];
    let mut out = std::io::Cursor::new(Vec::new());
    ex::Image {
        attributes,
        layer_data: ex::Layers::from(layers),
    }
    .write()
    .to_buffered(&mut out)
    .unwrap();
    out.into_inner()
}

/// Truth: the colour (0.2, 0.4, 0.8) of Rec. 709 in ACES AP0, by the matrix that the ACES transforms publish (their inverse of
/// Rec. 709 with Bradford adaptation, five digits).
#[test]
fn colours_of_other_primaries_become_rec_709() {
    let to_ap0 = [
        [0.43963, 0.38299, 0.17738],
        [0.08978, 0.81344, 0.09678],
        [0.01754, 0.11155, 0.87091],
    ];
    let color = [0.2, 0.4, 0.8];
    let ap0 = to_ap0.map(|row: [f32; 3]| row.iter().zip(color).map(|(a, b)| a * b).sum::<f32>());
    let attributes = ex::ImageAttributes {
        chromaticities: Some(exr::meta::attribute::Chromaticities {
            red: ex::Vec2(0.7347, 0.2653),
            green: ex::Vec2(0.0, 1.0),
            blue: ex::Vec2(0.0001, -0.077),
            white: ex::Vec2(0.32168, 0.33767),
        }),
        ..ex::ImageAttributes::with_size((2, 1))
    };
    let bytes = foreign(
        ["R", "G", "B"],
        (2, 1),
        (0, 0),
        &[ap0; 2],
        attributes.clone(),
        None,
    );
    let map = decode_environment("t", &bytes, &Limits::default()).unwrap();
    for (found, expected) in map.image.pixels[1].iter().zip(color) {
        assert!((found - expected).abs() < 1e-3, "{:?}", map.image.pixels);
    }
    // Positions are no colours.
    let bytes = foreign(["P.X", "P.Y", "P.Z"], (2, 1), (0, 0), &[ap0; 2], attributes, None);
    let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
    assert_eq!(read.layer("P").unwrap().data[..3], ap0);
}

/// Truth: by hand. Two pixels of data below and right of the display window's first.
#[test]
fn a_data_window_has_its_place_in_the_display_window() {
    let window = |position, size| ex::ImageAttributes::new(ex::IntegerBounds::new(position, size));
    let rgb = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
    let attributes = window((10, -5), (4, 2));
    let bytes = foreign(["R", "G", "B"], (2, 1), (11, -4), &rgb, attributes, None);
    let read = decode_exr("t", &bytes, &Limits::default()).unwrap();
    assert_eq!((read.width, read.height), (4, 2));
    let pixels = read.rgb(BEAUTY).unwrap().pixels;
    assert_eq!(pixels[5..7], rgb);
    assert!((0..8).all(|i| (5..7).contains(&i) || pixels[i] == [0.0; 3]));
    let bytes = foreign(
        ["R", "G", "B"],
        (2, 1),
        (0, 0),
        &rgb,
        window((10, -5), (4, 2)),
        None,
    );
    let error = decode_exr("t", &bytes, &Limits::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("display window"), "{error}");
    let huge = foreign(
        ["R", "G", "B"],
        (2, 1),
        (0, 0),
        &rgb,
        window((0, 0), (100_000, 100_000)),
        None,
    );
    let error = decode_exr("t", &huge, &Limits::default());
    assert!(
        matches!(error, Err(ImageError::LimitExceeded { .. })),
        "{error:?}"
    );
}

/// Truth: OpenEXR's attribute `envmap`: +X, −X, +Y, −Y, +Z, −Z from the top; a map's middle looks along +Z, the middle of its
/// left half along +X.
#[test]
fn a_cube_map_becomes_a_map_of_latitude_and_longitude() {
    let rgb: Vec<[f32; 3]> = (0..6 * 16).map(|i| [(i / 16) as f32; 3]).collect();
    let attributes = ex::ImageAttributes::with_size((4, 24));
    let cube = Some(exr::meta::attribute::EnvironmentMap::Cube);
    let bytes = foreign(["R", "G", "B"], (4, 24), (0, 0), &rgb, attributes, cube);
    let map = decode_environment("t", &bytes, &Limits::default()).unwrap().image;
    assert_eq!((map.width, map.height), (16, 8));
    let at = |x: usize, y: usize| map.pixels[y * 16 + x][0];
    assert_eq!([at(8, 4), at(4, 4), at(12, 4), at(0, 4)], [4.0, 0.0, 1.0, 5.0]);
    assert_eq!([at(8, 0), at(8, 7)], [2.0, 3.0]);
}

/// Truth: the names that Blender writes.
#[test]
fn passes_of_other_programs_are_found_by_what_they_are() {
    let names = [
        "ViewLayer.Combined.R",
        "ViewLayer.Combined.G",
        "ViewLayer.Combined.B",
    ];
    let attributes = ex::ImageAttributes::with_size((2, 1));
    let bytes = foreign(names, (2, 1), (0, 0), &[[1.0, 2.0, 3.0]; 2], attributes, None);
    let mut read = decode_exr("t", &bytes, &Limits::default()).unwrap();
    assert_eq!(read.find(BEAUTY).unwrap().name, "ViewLayer.Combined");
    read.push_rgb("RenderLayer.DiffDir", &[[0.0; 3]; 2]);
    read.push_rgb("light.DiffDir", &[[0.0; 3]; 2]);
    assert_eq!(read.find("DiffDir").unwrap().name, "RenderLayer.DiffDir");
    assert_eq!(read.find("Other.diffdir").unwrap().name, "RenderLayer.DiffDir");
    read.push_rgb("Second.Combined", &[[0.0; 3]; 2]);
    assert!(read.find(BEAUTY).is_none(), "two may be meant");
}
