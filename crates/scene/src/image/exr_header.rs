//! The header of an OpenEXR file, as the `exr` crate writes it.
//!
//! Source: "Reserved Attributes" of the OpenEXR documentation.

use exr::meta::BlockDescription;
use exr::meta::attribute::{
    AttributeValue, ChannelDescription, Chromaticities, Compression, LineOrder, SampleType, Text,
};
use exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use exr::prelude::Vec2;
use std::collections::HashMap;

/// What a frame says about itself, beside its pixels. All of it depends on the inputs only: no times, no paths.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExrHeader {
    /// Program and version, attribute `software`.
    pub software: String,
    /// Hash of the asset that was played, attribute `relightAssetHash`.
    pub asset_hash: Option<String>,
    /// Seed of the random streams, attribute `relightSeed` (text: OpenEXR has no 64-bit integers).
    pub seed: Option<u64>,
    /// Frames per second, attribute `framesPerSecond`.
    pub frames_per_second: Option<f64>,
    /// Number of the frame in its sequence, from 0, attribute `imageCounter`.
    pub frame: Option<u32>,
}

impl ExrHeader {
    /// The header of this version of relight, with nothing else known.
    pub fn new() -> Self {
        Self {
            software: format!("relight {}", env!("CARGO_PKG_VERSION")),
            ..Self::default()
        }
    }
}

/// Rec. 709 primaries and the white point D65 (CIE xy), ITU-R BT.709-6 table 1.
pub(super) const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// The header of a file of one part, scan lines and ZIP, that says what `frame` says. `channels` are sorted by name.
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
    let mut other = Vec::new();
    if let Some(number) = frame.frame {
        let number = i32::try_from(number).unwrap_or(i32::MAX);
        other.push((text("imageCounter"), AttributeValue::I32(number)));
    }
    if let Some(hash) = &frame.asset_hash {
        other.push((text("relightAssetHash"), AttributeValue::Text(text(hash))));
    }
    if let Some(seed) = frame.seed {
        let seed = text(&seed.to_string());
        other.push((text("relightSeed"), AttributeValue::Text(seed)));
    }
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
            other: in_order(&other),
            ..LayerAttributes::default()
        })
}

/// A map that is iterated in the order of its keys. Every new map has another order, and [`Header`] wants a map with the
/// standard hasher, so maps are made until one is in order: six tries for three attributes, in the mean.
fn in_order(attributes: &[(Text, AttributeValue)]) -> HashMap<Text, AttributeValue> {
    loop {
        let map: HashMap<_, _> = attributes.iter().cloned().collect();
        if map.keys().is_sorted() {
            return map;
        }
    }
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
