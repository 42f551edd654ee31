//! The header of an OpenEXR file, as the `exr` crate writes it.
//!
//! Source: "Reserved Attributes" of the OpenEXR documentation.

use super::exr_camera::ExrCamera;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, Chromaticities, Compression, LineOrder, SampleType, Text};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::Vec2;

/// What a frame says about itself, beside its pixels. All of it depends on the inputs only: no times, no paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrHeader {
    /// Program and version, attribute `software`.
    pub software: String,
    /// Hash of the asset that was played, attribute `relightAssetHash`.
    pub asset_hash: Option<String>,
    /// Hash of the sequence whose lights shine, attribute `relightSequenceHash`.
    pub sequence_hash: Option<String>,
    /// Name of the integrator, attribute `relightIntegrator`.
    pub integrator: Option<String>,
    /// Samples per pixel, attribute `relightSamples`.
    pub samples: Option<u32>,
    /// Seed of the random streams, attribute `relightSeed` (text: OpenEXR has no 64-bit integers).
    pub seed: Option<u64>,
    /// Frames per second, attribute `framesPerSecond`.
    pub frames_per_second: Option<f64>,
    /// Number of the frame in its sequence, from 0, attribute `imageCounter`.
    pub frame: Option<u32>,
    /// Who looks.
    pub camera: Option<ExrCamera>,
    /// What lies behind the scene, in words, attribute `relightBackground`.
    pub background: Option<String>,
    /// Of lights whose layers can't have their names: the name in the layers and their own. Attribute `relightLights`, a JSON object.
    pub lights: Vec<(String, String)>,
    /// Further attributes of text: name, of at most 31 bytes, and value.
    pub texts: Vec<(String, String)>,
}

impl ExrHeader {
    /// The header of this version of relight, with nothing else known.
    pub fn new() -> Self {
        Self {
            software: format!("relight {}", env!("CARGO_PKG_VERSION")),
            ..Self::default()
        }
    }

    /// The attributes that the `exr` crate doesn't know, in the order of their names.
    fn further(&self) -> Vec<(&str, Value)> {
        let text = |value: &Option<String>| value.clone().map(Value::Text);
        let number = |value: Option<u32>| value.map(|v| Value::Number(i32::try_from(v).unwrap_or(i32::MAX)));
        let label = self.camera.as_ref().map(|camera| &camera.name);
        let lights: serde_json::Map<String, serde_json::Value> = (self.lights.iter())
            .map(|(layer, own)| (layer.clone(), own.as_str().into()))
            .collect();
        let lights = (!lights.is_empty()).then(|| serde_json::Value::Object(lights).to_string());
        let mut all = vec![
            (
                "cameraLabel",
                label.filter(|l| !l.is_empty()).cloned().map(Value::Text),
            ),
            ("imageCounter", number(self.frame)),
            ("relightAssetHash", text(&self.asset_hash)),
            ("relightBackground", text(&self.background)),
            ("relightIntegrator", text(&self.integrator)),
            ("relightLights", text(&lights)),
            ("relightSamples", number(self.samples)),
            ("relightSeed", self.seed.map(|seed| Value::Text(seed.to_string()))),
            ("relightSequenceHash", text(&self.sequence_hash)),
        ];
        all.extend((self.texts.iter()).map(|(name, text)| (name.as_str(), Some(Value::Text(text.clone())))));
        let mut known: Vec<_> = (all.into_iter())
            .filter_map(|(name, value)| Some((name, value?)))
            .collect();
        known.sort_by_key(|(name, _)| *name);
        known
    }
}

/// Of an attribute.
enum Value {
    Number(i32),
    Text(String),
}

/// A file with the attributes of `frame` that [`file_header`] leaves out: the `exr` crate keeps what it doesn't know in maps whose order
/// is another every time. `None` if the bytes are no file of `chunks` chunks.
pub(super) fn with_attributes(bytes: &[u8], chunks: usize, frame: &ExrHeader) -> Option<Vec<u8>> {
    let mut added = Vec::new();
    for (name, value) in frame.further() {
        let (kind, value) = match value {
            Value::Number(number) => ("int", number.to_le_bytes().to_vec()),
            Value::Text(text) => ("string", text.into_bytes()),
        };
        for text in [name, kind] {
            added.extend(text.bytes().chain([0]));
        }
        added.extend(i32::try_from(value.len()).ok()?.to_le_bytes());
        added.extend(value);
    }
    let table = header_end(bytes)?;
    let chunks_start = table.checked_add(chunks.checked_mul(8)?)?;
    let (head, offsets, rest) = (
        bytes.get(..table)?,
        bytes.get(table..chunks_start)?,
        bytes.get(chunks_start..)?,
    );
    let mut whole = Vec::with_capacity(bytes.len() + added.len());
    // Behind magic number and version; the header ends in a byte of 0.
    whole.extend_from_slice(&head[..8]);
    whole.extend_from_slice(&added);
    whole.extend_from_slice(&head[8..]);
    for offset in offsets.as_chunks::<8>().0 {
        let moved = u64::from_le_bytes(*offset) + added.len() as u64;
        whole.extend(moved.to_le_bytes());
    }
    whole.extend_from_slice(rest);
    Some(whole)
}

/// Where the header of a file of one part ends and the table of offsets begins.
fn header_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 8;
    while *bytes.get(at)? != 0 {
        for _ in ["name", "type"] {
            at += bytes.get(at..)?.iter().position(|&byte| byte == 0)? + 1;
        }
        let size = bytes.get(at..at.checked_add(4)?)?;
        let size = u32::from_le_bytes(size.try_into().ok()?) as usize;
        at = at.checked_add(4)?.checked_add(size)?;
    }
    Some(at + 1)
}

/// Rec. 709 primaries and the white point D65 (CIE xy), ITU-R BT.709-6 table 1.
pub(super) const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// The header of a file of one part, scan lines and ZIP, that says what `frame` says, as far as the `exr` crate has words for it; the rest
/// is [`with_attributes`]'. `channels` are sorted by name.
pub(crate) fn file_header(
    width: usize,
    height: usize,
    channels: impl Iterator<Item = (String, SampleType)>,
    frame: &ExrHeader,
) -> Header {
    // Names are UTF-8, as in OpenEXR; `Text::from` takes Latin 1 only, and panics.
    let text = |t: &str| Text::from_slice_unchecked(t.as_bytes());
    // "Not perceptually linear", which matters to lossy compression only.
    let channels = channels.map(|(name, kind)| ChannelDescription::new(text(&name), kind, false));
    let camera = frame.camera.as_ref();
    let size = Vec2(width, height);
    Header::new(Text::default(), size, channels.collect())
        .with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        )
        .with_shared_attributes(ImageAttributes {
            chromaticities: Some(REC_709),
            ..ImageAttributes::with_size(size)
        })
        .with_attributes(LayerAttributes {
            software_name: (!frame.software.is_empty()).then(|| text(&frame.software)),
            frames_per_second: frame.frames_per_second.and_then(rational),
            screen_window_width: camera.map_or(1.0, |camera| camera.screen_window_width),
            world_to_camera: camera.map(|camera| camera.world_to_camera),
            world_to_normalized_device: camera.map(|camera| camera.world_to_ndc),
            horizontal_field_of_view: camera.map(|camera| camera.field_of_view_deg[0]),
            vertical_field_of_view: camera.map(|camera| camera.field_of_view_deg[1]),
            ..LayerAttributes::default()
        })
}

/// A rate as a fraction: whole rates, the 1000/1001 rates of television, else millionths. None if it is no rate.
fn rational(rate: f64) -> Option<(i32, u32)> {
    /// Fine enough for any rate that is neither whole nor television's.
    const FINEST: u32 = 1_000_000;
    let numerator = |denominator: u32| (rate * f64::from(denominator)).round();
    let exact = |d: &u32| (numerator(*d) / f64::from(*d) - rate).abs() <= 1e-9 * rate;
    let denominator = [1, 2, 1001].into_iter().find(exact).unwrap_or(FINEST);
    let numerator = numerator(denominator);
    (1.0..=f64::from(i32::MAX))
        .contains(&numerator)
        .then_some((numerator as i32, denominator))
}

#[cfg(test)]
mod tests {
    use super::rational;

    /// Truth: the rates as SMPTE writes them.
    #[test]
    fn frame_rates_become_the_customary_fractions() {
        assert_eq!(rational(24.0), Some((24, 1)));
        assert_eq!(rational(24000.0 / 1001.0), Some((24000, 1001)));
        assert_eq!(rational(12.5), Some((25, 2)));
        for none in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(rational(none), None);
        }
    }
}
