//! Thousands of damaged images: whatever a file holds, readers answer with an image or an error, soon, and without
//! asking for memory that the file does not justify. In a process of its own, so that its memory can be watched.

use relight_scene::image::{
    BEAUTY, ExrHeader, FloatImage, Image8, Layers, Limits, decode_environment, decode_exr, decode_ldr,
};
use relight_scene::image::{exr_write, ldr};

/// SplitMix64 (Steele et al. 2014): a seed gives the same damage on every machine.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// A few bytes changed, set to extremes, cut out, doubled, or cut off; early bytes, where headers are, more often.
fn damage(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..=random.below(4) {
        let reach = if random.below(2) == 0 {
            out.len().min(400)
        } else {
            out.len()
        };
        if reach < 8 {
            break;
        }
        let at = random.below(reach - 4);
        match random.below(7) {
            0 => out[at] ^= 1 << random.below(8),
            1 => out[at] = random.next() as u8,
            2 => out[at..at + 4].fill(0xff),
            3 => out[at..at + 4].copy_from_slice(&(random.next() as u32 >> random.below(32)).to_le_bytes()),
            4 => out.truncate(at),
            5 => {
                let end = (at + 1 + random.below(40)).min(out.len());
                let piece = out[at..end].to_vec();
                out.splice(at..at, piece);
            }
            _ => {
                let end = (at + 1 + random.below(40)).min(out.len());
                out.drain(at..end);
            }
        }
    }
    out
}

fn picture(width: usize, height: usize) -> FloatImage {
    let pixels = (0..width * height)
        .map(|i| [(i % 7) as f32, (i % 31) as f32 * 0.1, i as f32])
        .collect();
    FloatImage {
        width,
        height,
        pixels,
    }
}

fn exr() -> Vec<u8> {
    let mut layers = Layers::from_image(BEAUTY, &picture(24, 20));
    layers.push_scalar("depth", &[1.5; 24 * 20]);
    exr_write::encode_exr("t", &layers, &ExrHeader::new(), false)
        .unwrap()
        .0
}

/// Files as the `exr` crate writes them: tiles and other compressions take other paths through a reader.
fn foreign_exr(compression: exr::prelude::Compression) -> Vec<u8> {
    use exr::prelude::*;
    let list =
        ["B", "G", "R"].map(|n| AnyChannel::new(n, FlatSamples::F32((0..480).map(|i| i as f32).collect())));
    let encoding = Encoding {
        compression,
        blocks: Blocks::Tiles(Vec2(16, 16)),
        line_order: LineOrder::Increasing,
    };
    let channels = AnyChannels::sort(list.into_iter().collect());
    let mut out = std::io::Cursor::new(Vec::new());
    Image::from_encoded_channels((24, 20), encoding, channels)
        .write()
        .to_buffered(&mut out)
        .unwrap();
    out.into_inner()
}

fn hdr() -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<_> = picture(24, 20).pixels.into_iter().map(image::Rgb).collect();
    image::codecs::hdr::HdrEncoder::new(&mut bytes)
        .encode(&pixels, 24, 20)
        .unwrap();
    bytes
}

fn png() -> Vec<u8> {
    let rgba8 = (0..24 * 20)
        .map(|i| [i as u8, (i / 3) as u8, 9, (i % 200) as u8])
        .collect();
    ldr::encode_png(
        "t",
        &Image8 {
            width: 24,
            height: 20,
            rgba8,
        },
    )
    .unwrap()
}

fn jpeg() -> Vec<u8> {
    let mut bytes = Vec::new();
    let samples: Vec<u8> = (0..24 * 20 * 3).map(|i| (i * 7) as u8).collect();
    image::codecs::jpeg::JpegEncoder::new(&mut bytes)
        .encode(&samples, 24, 20, image::ExtendedColorType::Rgb8)
        .unwrap();
    bytes
}

/// The largest amount of memory this process ever held, in bytes. 0 where the system does not say.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status
        .lines()
        .find_map(|l| l.strip_prefix("VmHWM:"))
        .unwrap_or("0 kB");
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap_or(0) * 1024
}

#[test]
fn damaged_files_give_an_image_or_an_error_and_take_little_memory() {
    // Texture-sized: a mutated size field should not be able to claim more.
    let limits = Limits {
        max_pixels: 1 << 24,
        max_bytes: 1 << 28,
        ..Limits::default()
    };
    let mut random = Random(1);
    let before = peak_memory();
    // The last net catches panics; a decoder that needs it is counted.
    let caught = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let counter = caught.clone();
    std::panic::set_hook(Box::new(move |_| {
        counter.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    }));
    use exr::prelude::Compression;
    let mut exrs = vec![exr()];
    exrs.extend(
        [
            Compression::ZIP1,
            Compression::RLE,
            Compression::PIZ,
            Compression::PXR24,
        ]
        .map(foreign_exr),
    );
    let (mut read, mut refused) = (0, 0);
    let mut count = |whole: bool| if whole { read += 1 } else { refused += 1 };
    for file in &exrs {
        for _ in 0..1000 {
            count(decode_exr("t", &damage(file, &mut random), &limits).is_ok());
        }
    }
    let (hdr, images) = (hdr(), [png(), jpeg()]);
    for _ in 0..2000 {
        count(decode_environment("t", &damage(&hdr, &mut random), &limits).is_ok());
        for file in &images {
            count(decode_ldr("t", &damage(file, &mut random), &limits).is_ok());
        }
    }
    let _ = std::panic::take_hook();
    let grown = peak_memory().saturating_sub(before);
    let caught = caught.load(std::sync::atomic::Ordering::Relaxed);
    println!(
        "{read} read, {refused} refused, {caught} panics caught, memory grew by {} MB",
        grown >> 20
    );
    // Both happen, or the damage is not what it should be.
    assert!(read > 500 && refused > 2000, "{read} read, {refused} refused");
    // The limit on one image, and what decoders hold beside it.
    assert!(grown < 3 << 28, "memory grew by {grown} bytes");
    assert_eq!(caught, 0, "panics caught by the last net");
}
