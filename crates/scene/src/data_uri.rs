//! Data URIs (RFC 2397): files that stand in a text.

use base64::Engine;
use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};

/// Whether a name is a data URI.
pub fn is_data_uri(name: &str) -> bool {
    (name.get(..5)).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// A data URI of bytes.
#[cfg(feature = "gltf")]
pub(crate) fn data_uri(media_type: &str, bytes: &[u8]) -> String {
    format!(
        "data:{media_type};base64,{}",
        base64::engine::general_purpose::STANDARD.encode(bytes)
    )
}

/// Decodes a data URI, or returns `None` where `uri` is not one.
pub(crate) fn decode_data_uri(uri: &str) -> Option<Result<Vec<u8>, String>> {
    let rest = is_data_uri(uri).then(|| &uri[5..])?;
    let Some((head, data)) = rest.split_once(',') else {
        return Some(Err("is a data URI without a comma; export the file again".into()));
    };
    if !head.to_ascii_lowercase().ends_with(";base64") {
        return Some(percent_decode(data));
    }
    // Some writers leave out the padding, some percent-encode it.
    let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let engine = GeneralPurpose::new(&base64::alphabet::STANDARD, config);
    let decoded = match data.contains('%') {
        true => percent_decode(data).and_then(|data| decode_base64(&engine, &data)),
        false => decode_base64(&engine, data.as_bytes()),
    };
    Some(decoded)
}

fn decode_base64(engine: &GeneralPurpose, data: &[u8]) -> Result<Vec<u8>, String> {
    engine
        .decode(data)
        .map_err(|e| format!("holds damaged base64 ({e}); export the file again"))
}

/// Undoes percent-encoding, once, byte by byte.
pub(crate) fn percent_decode(text: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        if byte != b'%' {
            bytes.push(byte);
            continue;
        }
        let mut digit = || rest.next().and_then(|b| (b as char).to_digit(16));
        match (digit(), digit()) {
            (Some(high), Some(low)) => bytes.push((high * 16 + low) as u8),
            _ => {
                return Err(
                    "has a % that two hexadecimal digits don't follow; write a literal % as %25".to_owned(),
                );
            }
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_decode() {
        let ok = |uri| decode_data_uri(uri).unwrap().unwrap();
        assert_eq!(ok("data:application/octet-stream;base64,AAEC"), [0, 1, 2]);
        assert_eq!(ok("DATA:;base64,AAE"), [0, 1], "missing padding");
        assert_eq!(ok("data:;base64,AAE%3D"), [0, 1], "encoded padding");
        assert_eq!(ok("data:text/plain,a%20b"), b"a b");
        assert!(decode_data_uri("data:;base64,A!").unwrap().is_err());
        assert!(decode_data_uri("data:nothing").unwrap().is_err());
        assert!(decode_data_uri("plain.bin").is_none());
    }
}
