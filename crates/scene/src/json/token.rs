//! Where parts of JSON end that no parser takes.

/// Bytes of a JSON string with its quotes, the first of which begins `text`; to the end where it has no end.
pub fn string_length(text: &str) -> usize {
    let mut escaped = false;
    for (i, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = true,
            b'"' => return i + 1,
            _ => {}
        }
    }
    text.len()
}
