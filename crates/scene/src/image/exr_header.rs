//! The attributes of an OpenEXR header, as bytes.
//!
//! Source: "OpenEXR File Layout" and "Reserved Attributes" of the OpenEXR documentation. Attributes are written in
//! alphabetical order: the bytes depend on nothing but their values. (The `exr` crate keeps custom attributes in a
//! randomly seeded hash map, so its files differ from run to run.)

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

/// Numbers of the file's pixel types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PixelType {
    Half = 1,
    Float = 2,
}

impl PixelType {
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Half => 2,
            Self::Float => 4,
        }
    }
}

/// Scan lines in a ZIP block.
pub(crate) const LINES_PER_BLOCK: usize = 16;
/// `compression` attribute for [`LINES_PER_BLOCK`] lines of zlib.
const ZIP: u8 = 3;
/// Longest attribute or channel name without the `long names` flag; with it 255.
const SHORT_NAME: usize = 31;
/// Rec. 709 primaries and the white point D65 (CIE xy: red, green, blue, white), ITU-R BT.709-6 table 1.
const REC_709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

/// Everything before the offset table: magic, version, attributes. `channels` are sorted by name.
pub(crate) fn header_bytes(
    width: usize,
    height: usize,
    channels: &[(String, PixelType)],
    header: &ExrHeader,
) -> Vec<u8> {
    let window: Vec<u8> = [0, 0, width as i32 - 1, height as i32 - 1]
        .iter()
        .flat_map(|v: &i32| v.to_le_bytes())
        .collect();
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let mut list = Vec::new();
    for (name, pixel_type) in channels {
        list.extend_from_slice(name.as_bytes());
        list.push(0);
        list.extend_from_slice(&(*pixel_type as u32).to_le_bytes());
        // Not perceptually linear, three reserved bytes, no subsampling.
        list.extend_from_slice(&[0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    }
    list.push(0);

    let mut attributes: Vec<(&str, &str, Vec<u8>)> = vec![
        ("channels", "chlist", list),
        ("chromaticities", "chromaticities", floats(&REC_709)),
        ("compression", "compression", vec![ZIP]),
        ("dataWindow", "box2i", window.clone()),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", vec![0]),
        ("pixelAspectRatio", "float", floats(&[1.0])),
        ("screenWindowCenter", "v2f", floats(&[0.0, 0.0])),
        ("screenWindowWidth", "float", floats(&[1.0])),
    ];
    if let Some((numerator, denominator)) = header.frames_per_second.and_then(rational) {
        let mut bytes = numerator.to_le_bytes().to_vec();
        bytes.extend_from_slice(&denominator.to_le_bytes());
        attributes.push(("framesPerSecond", "rational", bytes));
    }
    if let Some(frame) = header.frame {
        let frame = i32::try_from(frame).unwrap_or(i32::MAX);
        attributes.push(("imageCounter", "int", frame.to_le_bytes().to_vec()));
    }
    if let Some(hash) = &header.asset_hash {
        attributes.push(("relightAssetHash", "string", hash.clone().into_bytes()));
    }
    if let Some(seed) = header.seed {
        attributes.push(("relightSeed", "string", seed.to_string().into_bytes()));
    }
    if !header.software.is_empty() {
        attributes.push(("software", "string", header.software.clone().into_bytes()));
    }
    attributes.sort_by_key(|a| a.0);

    // Magic number 20000630, file version 2, flags of a single-part scan line file.
    let mut out = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    if channels.iter().any(|(name, _)| name.len() > SHORT_NAME) {
        out[5] |= 0x04;
    }
    for (name, kind, value) in attributes {
        for text in [name, kind] {
            out.extend_from_slice(text.as_bytes());
            out.push(0);
        }
        out.extend_from_slice(&(value.len() as u32).to_le_bytes());
        out.extend_from_slice(&value);
    }
    out.push(0);
    out
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
