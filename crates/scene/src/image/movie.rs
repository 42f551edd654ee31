//! Moving pictures of a few formats that need no other program: animated WebP (lossless) and GIF (256 colours a frame).
//!
//! A WebP file is a RIFF container (RFC 9649): a header VP8X that says it moves, ANIM with the number of repetitions, and for each
//! frame ANMF with place, size, time and the frame's own bitstream, which the encoder of still images makes.

use super::error::ImageError;
use super::ldr::Image8;
use image::codecs::gif::{GifEncoder, Repeat};
use image::codecs::webp::WebPEncoder;
use image::{Delay, ExtendedColorType, Frame, RgbaImage};
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

/// Formats that [`MovieWriter`] writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MovieFormat {
    /// Lossless.
    WebP,
    /// Of 256 colours a frame, times in hundredths of a second.
    Gif,
}

/// Writes frame after frame; nothing of it is a movie before [`MovieWriter::finish`].
pub struct MovieWriter<W: Write + Seek> {
    to: To<W>,
    size: Option<(usize, usize)>,
    /// Seconds of all frames so far, and units of the format that they have been given.
    seconds: f64,
    given: u64,
}

enum To<W: Write + Seek> {
    WebP(W),
    Gif(Box<GifEncoder<W>>),
}

/// Least hundredths of a second of a GIF's frame: players take what is shorter for a tenth of a second.
const LEAST_GIF: u64 = 2;
/// Flags of VP8X: it moves.
const ANIMATED: u8 = 0b10;
/// Flags of ANMF: the frame replaces what was there.
const NO_BLENDING: u8 = 0b10;

impl<W: Write + Seek> MovieWriter<W> {
    /// Begins one, which repeats for ever.
    ///
    /// # Errors
    /// The first bytes cannot be written.
    pub fn new(out: W, format: MovieFormat) -> std::io::Result<Self> {
        let to = match format {
            MovieFormat::WebP => To::WebP(out),
            MovieFormat::Gif => {
                // The best of 1 to 30 that takes no longer than the frame itself.
                let mut encoder = GifEncoder::new_with_speed(out, 10);
                encoder.set_repeat(Repeat::Infinite).map_err(other)?;
                To::Gif(Box::new(encoder))
            }
        };
        Ok(MovieWriter {
            to,
            size: None,
            seconds: 0.0,
            given: 0,
        })
    }

    /// Adds a frame that is shown for so many seconds. Where the format is too coarse for that, errors don't add up.
    ///
    /// # Errors
    /// It is of another size than the first, or cannot be encoded or written.
    pub fn push(&mut self, image: &Image8, seconds: f64) -> std::io::Result<()> {
        let size = (image.width, image.height);
        if *self.size.get_or_insert(size) != size {
            return Err(other("a frame has another size than the first"));
        }
        self.seconds += seconds;
        let (per_second, least) = match &self.to {
            To::WebP(_) => (1000.0, 1),
            To::Gif(_) => (100.0, LEAST_GIF),
        };
        let units = ((self.seconds * per_second).round() as u64)
            .saturating_sub(self.given)
            .max(least);
        self.given += units;
        let (width, height) = (image.width as u32, image.height as u32);
        match &mut self.to {
            To::WebP(out) => {
                if self.given == units {
                    write_header(out, width, height)?;
                }
                write_frame(out, image, units.min(0xff_ffff) as u32)
            }
            To::Gif(encoder) => {
                let pixels = RgbaImage::from_raw(width, height, image.rgba8.as_flattened().to_vec());
                let pixels = pixels.ok_or_else(|| other("a frame lacks pixels"))?;
                let delay = Delay::from_numer_denom_ms(units.min(60_000) as u32 * 10, 1);
                let frame = Frame::from_parts(pixels, 0, 0, delay);
                encoder.encode_frame(frame).map_err(other)
            }
        }
    }

    /// Ends it.
    ///
    /// # Errors
    /// The last bytes cannot be written, or it is too long for its format (4 GiB).
    pub fn finish(self) -> std::io::Result<()> {
        match self.to {
            To::WebP(mut out) => {
                let end = out.stream_position()?;
                let length =
                    u32::try_from(end.saturating_sub(8)).map_err(|_| other("a WebP has at most 4 GiB"))?;
                out.seek(SeekFrom::Start(4))?;
                out.write_all(&length.to_le_bytes())?;
                out.seek(SeekFrom::Start(end))?;
                out.flush()
            }
            // Dropping it writes the trailer.
            To::Gif(encoder) => {
                drop(encoder);
                Ok(())
            }
        }
    }
}

fn other(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> std::io::Error {
    std::io::Error::other(error)
}

fn three_bytes(value: u32) -> [u8; 3] {
    let [a, b, c, _] = value.to_le_bytes();
    [a, b, c]
}

/// RIFF, VP8X and ANIM; the length of the whole comes at the end.
fn write_header(out: &mut impl Write, width: u32, height: u32) -> std::io::Result<()> {
    out.write_all(b"RIFF\0\0\0\0WEBPVP8X")?;
    out.write_all(&10u32.to_le_bytes())?;
    out.write_all(&[ANIMATED, 0, 0, 0])?;
    out.write_all(&three_bytes(width - 1))?;
    out.write_all(&three_bytes(height - 1))?;
    out.write_all(b"ANIM")?;
    out.write_all(&6u32.to_le_bytes())?;
    // Background; no end of repetitions.
    out.write_all(&[0, 0, 0, 0, 0, 0])
}

fn write_frame(out: &mut impl Write, image: &Image8, milliseconds: u32) -> std::io::Result<()> {
    let opaque: Vec<u8> = image.rgba8.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
    let mut still = Vec::new();
    let (width, height) = (image.width as u32, image.height as u32);
    WebPEncoder::new_lossless(&mut still)
        .encode(&opaque, width, height, ExtendedColorType::Rgb8)
        .map_err(other)?;
    // Behind RIFF, its length and WEBP.
    let bitstream = still.get(12..).filter(|chunk| chunk.starts_with(b"VP8L"));
    let bitstream = bitstream.ok_or_else(|| other("the encoder of still images made no plain frame"))?;
    out.write_all(b"ANMF")?;
    out.write_all(&(16 + bitstream.len() as u32).to_le_bytes())?;
    out.write_all(&[0; 6])?;
    out.write_all(&three_bytes(width - 1))?;
    out.write_all(&three_bytes(height - 1))?;
    out.write_all(&three_bytes(milliseconds))?;
    out.write_all(&[NO_BLENDING])?;
    out.write_all(bitstream)
}

/// The format of a file's name; `None` of others.
pub fn format_of(path: &Path) -> Option<MovieFormat> {
    let ending = path.extension()?.to_str()?.to_ascii_lowercase();
    match ending.as_str() {
        "webp" => Some(MovieFormat::WebP),
        "gif" => Some(MovieFormat::Gif),
        _ => None,
    }
}

/// The frames of a movie and the milliseconds of each, as other programs read them.
///
/// # Errors
/// It is no movie of these formats.
pub fn decode_movie(bytes: &[u8]) -> Result<Vec<(Image8, u32)>, ImageError> {
    use image::AnimationDecoder;
    use image::codecs::gif::GifDecoder;
    use image::codecs::webp::WebPDecoder;
    let invalid = |message: String| ImageError::invalid("movie", message);
    let cursor = std::io::Cursor::new(bytes);
    let frames = match bytes.starts_with(b"GIF8") {
        true => GifDecoder::new(cursor).map(|d| d.into_frames().collect_frames()),
        false => WebPDecoder::new(cursor).map(|d| d.into_frames().collect_frames()),
    };
    let frames = frames
        .and_then(|frames| frames)
        .map_err(|error| invalid(error.to_string()))?;
    let image = |frame: Frame| {
        let (numerator, denominator) = frame.delay().numer_denom_ms();
        let pixels = frame.into_buffer();
        let image = Image8 {
            width: pixels.width() as usize,
            height: pixels.height() as usize,
            rgba8: pixels.pixels().map(|p| p.0).collect(),
        };
        (image, numerator / denominator.max(1))
    };
    Ok(frames.into_iter().map(image).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Three frames of one colour each and a corner of another.
    fn frames() -> Vec<Image8> {
        let colours = [[200, 10, 10, 255], [10, 200, 10, 255], [10, 10, 200, 255]];
        let frame = |colour: [u8; 4]| {
            let mut rgba8 = vec![colour; 7 * 5];
            rgba8[0] = [255, 255, 255, 255];
            Image8 {
                width: 7,
                height: 5,
                rgba8,
            }
        };
        colours.map(frame).to_vec()
    }

    /// Truth: the decoders of the crate `image`, which know nothing of how this was written.
    #[test]
    fn what_is_written_is_read_again() {
        for format in [MovieFormat::WebP, MovieFormat::Gif] {
            let mut bytes = Cursor::new(Vec::new());
            let mut writer = MovieWriter::new(&mut bytes, format).unwrap();
            for frame in frames() {
                writer.push(&frame, 1.0 / 24.0).unwrap();
            }
            writer.finish().unwrap();
            let read = decode_movie(bytes.get_ref()).unwrap();
            assert_eq!(read.len(), 3);
            // Three frames at 24 a second: an eighth of a second, to the unit.
            let all: u32 = read.iter().map(|(_, ms)| ms).sum();
            let unit = if format == MovieFormat::Gif { 10 } else { 1 };
            assert!(all.abs_diff(125) <= unit, "{format:?}: {all}");
            for ((image, _), frame) in read.iter().zip(frames()) {
                let apart = image.rgba8.as_flattened().iter().zip(frame.rgba8.as_flattened());
                let most = apart.map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                // Two colours a frame are in any palette.
                assert!(
                    most <= if format == MovieFormat::Gif { 3 } else { 0 },
                    "{format:?}: {most}"
                );
            }
        }
    }

    #[test]
    fn frames_are_of_one_size_and_no_movie_is_told() {
        let mut writer = MovieWriter::new(Cursor::new(Vec::new()), MovieFormat::WebP).unwrap();
        let [first, ..] = &frames()[..] else {
            unreachable!()
        };
        writer.push(first, 0.1).unwrap();
        let mut other = first.clone();
        other.height = 4;
        other.rgba8.truncate(28);
        assert!(writer.push(&other, 0.1).is_err());
        assert!(decode_movie(b"RIFF").is_err() && decode_movie(b"GIF89a").is_err());
        assert_eq!(format_of(Path::new("a/B.GIF")), Some(MovieFormat::Gif));
        assert_eq!(format_of(Path::new("a/b.mp4")), None);
    }
}
