//! The text of files as people write them, whoever else reads them: UTF-8, UTF-16 with a byte-order mark, or older.

use std::borrow::Cow;

/// The text without a byte-order mark; what is neither UTF-8 nor marked as UTF-16 is taken for Latin-1, byte by byte, as the reader of
/// scenes does.
pub fn of(bytes: &[u8]) -> Cow<'_, str> {
    let utf16 = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.as_chunks::<2>().0.iter().map(|pair| unit(*pair)).collect();
        Cow::Owned(String::from_utf16_lossy(&units))
    };
    let bytes = match bytes {
        [0xff, 0xfe, text @ ..] => return utf16(text, u16::from_le_bytes),
        [0xfe, 0xff, text @ ..] => return utf16(text, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, text @ ..] => text,
        _ => bytes,
    };
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    let mut text = String::with_capacity(bytes.len() + bytes.len() / 8);
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|&b| char::from(b)));
    }
    Cow::Owned(text)
}

#[cfg(test)]
mod tests {
    #[test]
    fn any_encoding_is_read() {
        assert_eq!(super::of(b"\xef\xbb\xbf{}"), "{}");
        assert_eq!(super::of(b"\xff\xfe{\0}\0"), "{}");
        assert_eq!(super::of(b"\xfe\xff\0{\0}\0"), "{}");
        assert_eq!(super::of(b"K\xfcche"), "Küche");
        assert_eq!(super::of(b"\xff\xfe{\0}"), "{");
        assert_eq!(super::of(b""), "");
    }
}
