//! Measures what writing one frame costs: `cargo run --release -p relight-scene --example exr_write_time -- REFERENCE
//! FOLDER [RUNS]`, where REFERENCE.full.exr and REFERENCE.indirect.exr are two renders of one frame, such as those of
//! the reference folder. They are enlarged to 640 × 360 and written as beauty, direct and indirect (nine channels)
//! into FOLDER, in turn by relight and by the `exr` crate. Medians go to stdout; docs/notebook/images.md quotes them.

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

use relight_scene::image::{
    BEAUTY, ExrHeader, FloatImage, Layers, Limits, encode_exr, read_exr, write_atomically,
};
use std::path::Path;
use std::time::Instant;

/// Bilinear, clamped at the border.
fn enlarged(image: &FloatImage, width: usize, height: usize) -> FloatImage {
    let mut out = FloatImage::black(width, height);
    let along = |i: usize, to: usize, from: usize| {
        let x = ((i as f32 + 0.5) * from as f32 / to as f32 - 0.5).clamp(0.0, (from - 1) as f32);
        let low = (x as usize).min(from.saturating_sub(2));
        (low, (low + 1).min(from - 1), x - low as f32)
    };
    for (i, p) in out.pixels.iter_mut().enumerate() {
        let (x0, x1, tx) = along(i % width, width, image.width);
        let (y0, y1, ty) = along(i / width, height, image.height);
        let at = |x: usize, y: usize, k: usize| image.pixels[y * image.width + x][k];
        *p = std::array::from_fn(|k| {
            let top = at(x0, y0, k) * (1.0 - tx) + at(x1, y0, k) * tx;
            let bottom = at(x0, y1, k) * (1.0 - tx) + at(x1, y1, k) * tx;
            top * (1.0 - ty) + bottom * ty
        });
    }
    out
}

/// The same frame through the `exr` crate.
fn encoded_by_crate(layers: &Layers) -> Vec<u8> {
    use exr::prelude::*;
    let mut list = Vec::new();
    for layer in &layers.layers {
        let names = relight_scene::image::exr_write::channel_names(layer);
        for (k, name) in names.iter().enumerate() {
            let values = layer.data[k..]
                .iter()
                .step_by(3)
                .map(|&v| f16::from_f32(v))
                .collect();
            list.push(AnyChannel::new(name.as_str(), FlatSamples::F16(values)));
        }
    }
    let encoding = Encoding {
        compression: Compression::ZIP16,
        ..Encoding::FAST_LOSSLESS
    };
    let mut out = std::io::Cursor::new(Vec::new());
    Image::from_encoded_channels(
        (layers.width, layers.height),
        encoding,
        AnyChannels::sort(list.into()),
    )
    .write()
    .to_buffered(&mut out)
    .expect("writing to memory");
    out.into_inner()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [reference, folder, rest @ ..] = arguments.as_slice() else {
        eprintln!("usage: exr_write_time REFERENCE FOLDER [RUNS]");
        std::process::exit(2);
    };
    let runs: usize = rest.first().and_then(|r| r.parse().ok()).unwrap_or(21);
    let read = |part: &str| {
        let path = format!("{reference}.{part}.exr");
        let layers = read_exr(Path::new(&path), &Limits::default()).expect("the reference image");
        enlarged(&layers.rgb(BEAUTY).expect("R, G, B"), 640, 360)
    };
    let (full, indirect) = (read("full"), read("indirect"));
    let direct: Vec<_> = full
        .pixels
        .iter()
        .zip(&indirect.pixels)
        .map(|(f, i)| std::array::from_fn(|k| (f[k] - i[k]).max(0.0)))
        .collect();
    let mut layers = Layers::from_image(BEAUTY, &full);
    layers.push_rgb("direct", &direct);
    layers.push_rgb("indirect", &indirect.pixels);

    let path = Path::new(folder).join("exr_write_time.exr");
    let mut times: [Vec<f64>; 5] = Default::default();
    let mut sizes = [0; 2];
    for _ in 0..runs {
        let mut clock = Instant::now();
        let mut lap = |slot: &mut Vec<f64>| {
            slot.push(clock.elapsed().as_secs_f64() * 1e3);
            clock = Instant::now();
        };
        let ours = encode_exr("frame", &layers, &ExrHeader::new(), false)
            .expect("encoding")
            .0;
        lap(&mut times[0]);
        std::fs::write(&path, &ours).expect("writing");
        lap(&mut times[1]);
        write_atomically(&path, &ours).expect("writing");
        lap(&mut times[2]);
        let theirs = encoded_by_crate(&layers);
        lap(&mut times[3]);
        let float = encode_exr("frame", &layers, &ExrHeader::new(), true)
            .expect("encoding")
            .0;
        lap(&mut times[4]);
        sizes = [ours.len(), theirs.len()];
        assert!(float.len() > ours.len());
    }
    let _ = std::fs::remove_file(&path);
    let labels = [
        "encode, half, ZIP (relight)",
        "plain write, no sync",
        "write, sync file and folder, rename",
        "encode, half, ZIP (exr crate)",
        "encode, float, ZIP (relight)",
    ];
    println!(
        "640 x 360, 9 channels, {runs} interleaved runs, {} threads",
        rayon::current_num_threads()
    );
    for (label, times) in labels.iter().zip(&mut times) {
        times.sort_by(f64::total_cmp);
        println!(
            "{label:38} median {:6.2} ms, least {:6.2} ms",
            times[times.len() / 2],
            times[0]
        );
    }
    println!("bytes: relight {}, exr crate {}", sizes[0], sizes[1]);
}
