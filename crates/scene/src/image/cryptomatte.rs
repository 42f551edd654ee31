//! Cryptomatte: which objects, or materials, each pixel shows, and how much of it each covers.
//!
//! Source: the Cryptomatte specification, version 1.1: names are hashed by MurmurHash3_32 and become floats bit by bit, but for exponents
//! that would make them infinite, NaN or denormal; a pixel's identifiers are ranked by coverage, two to a layer of four channels.
//! What is no object has no rank, as in Cycles: its coverage is what the others leave.

use super::layers::Layers;

/// Ranks that are kept of each pixel: what the specification suggests.
pub const RANKS: usize = 6;

/// MurmurHash3_x86_32 (Austin Appleby, public domain) with seed 0.
pub fn murmur3_32(bytes: &[u8]) -> u32 {
    let scrambled = |block: u32| {
        (block.wrapping_mul(0xcc9e_2d51))
            .rotate_left(15)
            .wrapping_mul(0x1b87_3593)
    };
    let (blocks, tail) = bytes.as_chunks::<4>();
    let mut hash = blocks.iter().fold(0u32, |hash, block| {
        (hash ^ scrambled(u32::from_le_bytes(*block)))
            .rotate_left(13)
            .wrapping_mul(5)
            .wrapping_add(0xe654_6b64)
    });
    if !tail.is_empty() {
        let block = (tail.iter().rev()).fold(0u32, |block, &byte| block << 8 | u32::from(byte));
        hash ^= scrambled(block);
    }
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// The identifier of a name, as it stands in pixels: a finite number that is not 0.
pub fn identifier(name: &str) -> f32 {
    let hash = murmur3_32(name.as_bytes());
    let exponent = (hash >> 23 & 0xff).clamp(1, 254);
    f32::from_bits(hash & 0x807f_ffff | exponent << 23)
}

/// One kind of mattes: of objects, or of materials.
pub struct Mattes<'a> {
    /// Its name in layers and attributes: `CryptoObject`, `CryptoMaterial`.
    pub kind: &'static str,
    /// All names that there are. Where several things have one name, it is one matte.
    pub names: &'a [String],
}

impl Mattes<'_> {
    /// The attributes that say what the layers are, by name.
    pub fn attributes(&self) -> Vec<(String, String)> {
        let key = format!("{:08x}", murmur3_32(self.kind.as_bytes()));
        let manifest: serde_json::Map<String, serde_json::Value> = (self.names.iter())
            .map(|name| {
                let bits = identifier(name).to_bits();
                (name.clone(), format!("{bits:08x}").into())
            })
            .collect();
        [
            ("conversion", "uint32_to_float32".to_owned()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("manifest", serde_json::Value::Object(manifest).to_string()),
            ("name", self.kind.to_owned()),
        ]
        .map(|(what, value)| (format!("cryptomatte/{}/{what}", &key[..7]), value))
        .to_vec()
    }

    /// Appends the layers. `shares` gives each pixel's things, by index into the names, and the share of the pixel that each covers; a thing
    /// may come several times.
    pub fn push_layers(&self, layers: &mut Layers, shares: impl Fn(usize) -> Vec<(u32, f32)>) {
        let identifiers: Vec<f32> = self.names.iter().map(|name| identifier(name)).collect();
        let pixels = layers.width * layers.height;
        let mut ranks = vec![vec![[0.0f32; 4]; pixels]; RANKS / 2];
        let mut found: Vec<(f32, f32)> = Vec::new();
        for pixel in 0..pixels {
            found.clear();
            for (index, share) in shares(pixel) {
                let Some(&id) = identifiers.get(index as usize) else {
                    continue;
                };
                match found
                    .iter_mut()
                    .find(|(known, _)| known.to_bits() == id.to_bits())
                {
                    Some((_, sum)) => *sum += share,
                    None => found.push((id, share)),
                }
            }
            // Of equal shares the order of the identifiers, so that it is the same in every frame.
            found.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.total_cmp(&b.0)));
            for (rank, &(id, share)) in found.iter().take(RANKS).enumerate() {
                let at = 2 * (rank % 2);
                ranks[rank / 2][pixel][at..at + 2].copy_from_slice(&[id, share]);
            }
        }
        for (number, layer) in ranks.iter().enumerate() {
            layers.push_raw(&format!("{}{number:02}", self.kind), layer);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Truth: the specification's examples of manifests, and the hash's published test vectors; for the keys another implementation of the hash.
    #[test]
    fn names_have_the_identifiers_of_the_specification() {
        for (name, bits) in [
            ("bunny", 0x1385_1a76),
            ("default", 0x42c9_679f),
            ("bunny_porcelain_mat", 0xb24b_26d4),
        ] {
            assert_eq!(identifier(name).to_bits(), bits, "{name}");
        }
        assert_eq!(murmur3_32(b""), 0);
        assert_eq!(murmur3_32(b"test"), 0xba6b_d213);
        assert_eq!(murmur3_32(b"Hello, world!"), 0xc036_3e43);
        assert_eq!(
            murmur3_32(b"The quick brown fox jumps over the lazy dog"),
            0x2e4f_f723
        );
        let keys: Vec<String> = ["CryptoObject", "CryptoMaterial"]
            .map(|kind| Mattes { kind, names: &[] }.attributes()[0].0.clone())
            .to_vec();
        assert_eq!(keys[0], "cryptomatte/3ae39a5/conversion");
        assert_eq!(keys[1], "cryptomatte/be359d6/conversion");
    }

    #[test]
    fn no_name_is_infinite_or_nothing() {
        for number in 0..100_000 {
            let id = identifier(&number.to_string());
            assert!(id.is_normal(), "{number}");
        }
        // What hashes to 0 is not taken for nothing.
        assert!(identifier("").is_normal());
    }

    /// Truth: by hand.
    #[test]
    fn things_are_ranked_by_what_they_cover_and_equal_names_are_one() {
        let names = ["a", "b", "c", "a"].map(str::to_owned);
        let mattes = Mattes {
            kind: "CryptoObject",
            names: &names,
        };
        let mut layers = Layers::new(2, 1);
        mattes.push_layers(&mut layers, |pixel| match pixel {
            0 => vec![(0, 0.25), (1, 0.3), (2, 0.05), (3, 0.25), (9, 1.0)],
            _ => Vec::new(),
        });
        let [a, b, c] = ["a", "b", "c"].map(identifier);
        let layer = |n: usize| layers.layers[n].data.clone();
        assert_eq!(layers.layers[0].name, "CryptoObject00");
        assert_eq!(layer(0), [a, 0.5, b, 0.3, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(layer(1)[..4], [c, 0.05, 0.0, 0.0]);
        assert_eq!(layers.layers.len(), 3);
    }
}
