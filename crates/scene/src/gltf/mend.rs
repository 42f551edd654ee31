//! What people's files have although glTF 2.0 or JSON forbids it, and of which there is no doubt what it means:
//! mended before anything is read, with a note each.

use super::notes::Notes;
use crate::json::token::string_length;
use serde_json::{Map, Value};
use std::borrow::Cow;

/// The text of a file as JSON needs it: UTF-8, without a byte order mark or zeros at its end.
pub(super) fn text<'a>(bytes: &'a [u8], notes: &mut Notes) -> Cow<'a, str> {
    let words = |from: fn([u8; 2]) -> u16| {
        let words: Vec<u16> = bytes[2..].chunks_exact(2).map(|w| from([w[0], w[1]])).collect();
        Cow::Owned(String::from_utf16_lossy(&words))
    };
    let utf16 = "the JSON is written in UTF-16 instead of UTF-8";
    if bytes.starts_with(b"\xff\xfe") {
        notes.say(utf16);
        return words(u16::from_le_bytes);
    }
    if bytes.starts_with(b"\xfe\xff") {
        notes.say(utf16);
        return words(u16::from_be_bytes);
    }
    // A byte order mark is forbidden, but some editors add one.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    // Chunks are to be padded with spaces; some writers pad with zeros.
    let end = bytes.iter().rposition(|&b| b != 0).map_or(0, |last| last + 1);
    let bytes = &bytes[..end];
    if let Ok(text) = std::str::from_utf8(bytes) {
        return Cow::Borrowed(text);
    }
    notes.say("the JSON is not UTF-8: bytes that are none are read as Latin-1, names may look odd");
    let mut text = String::with_capacity(bytes.len() + bytes.len() / 8);
    for chunk in bytes.utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|&b| char::from(b)));
    }
    Cow::Owned(text)
}

/// The text with quotes around what JSON has no numbers for (NaN and infinities, as C and Python print them), so
/// that whoever needs a number there can name the place; `None` if there is nothing of the kind.
pub(super) fn quoted_non_numbers(text: &str) -> Option<String> {
    let mut out = String::with_capacity(text.len());
    let (mut rest, mut found) = (text, false);
    while let Some(first) = rest.chars().next() {
        let length = match first {
            '"' => string_length(rest),
            _ if is_bare(first) => rest.find(|c| !is_bare(c)).unwrap_or(rest.len()),
            _ => first.len_utf8(),
        };
        let (token, after) = rest.split_at(length);
        if first != '"' && is_non_number(token) {
            found = true;
            out.extend(["\"", token, "\""]);
        } else {
            out.push_str(token);
        }
        rest = after;
    }
    found.then_some(out)
}

fn is_bare(c: char) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.' | '#' | '(' | ')' | '_')
}

/// NaN, -nan(ind), inf, Infinity, 1.#QNAN, 1e999 and their like.
fn is_non_number(token: &str) -> bool {
    let bare = token.trim_start_matches(['+', '-']).to_ascii_lowercase();
    bare.starts_with("nan")
        || bare.starts_with("1.#")
        || bare.parse::<f64>().is_ok_and(|number| !number.is_finite())
}

/// Lists in which the place of an entry means nothing, so that an empty entry can be left out.
const UNORDERED: &[&str] = &[
    "channels",
    "children",
    "extensionsRequired",
    "extensionsUsed",
    "primitives",
];

/// Properties that are true or false.
const FLAGS: &[&str] = &["doubleSided", "normalized", "visible"];

/// Takes `null` for absent wherever it stands, 0 and 1 for false and true, and a backslash in a file's name for a slash. Numbers in lists stay: a `null`
/// among them may have been NaN.
pub(super) fn document(root: &mut Value, notes: &mut Notes) {
    let mut counts = Counts::default();
    // What `scenes[i].nodes` lists are indices, what `nodes` of the document lists are nodes.
    if let Some(scenes) = root.get_mut("scenes").and_then(Value::as_array_mut) {
        for scene in scenes {
            if let Some(nodes) = scene.get_mut("nodes").and_then(Value::as_array_mut) {
                drop_nulls(nodes, &mut counts);
            }
        }
    }
    // The document's own lists hold objects, even if there is none.
    for list in root
        .as_object_mut()
        .into_iter()
        .flat_map(|members| members.values_mut())
    {
        for entry in list
            .as_array_mut()
            .into_iter()
            .flatten()
            .filter(|entry| entry.is_null())
        {
            *entry = Value::Object(Map::new());
            counts.nulls += 1;
        }
    }
    mend(root, &mut counts);
    notes.count("null written for what is absent, read as absent", counts.nulls);
    notes.count("0 or 1 written for false or true", counts.flags);
    notes.count(
        "file names with backslashes, taken for the slashes between folders",
        counts.backslashes,
    );
}

#[derive(Default)]
struct Counts {
    nulls: u64,
    flags: u64,
    backslashes: u64,
}

/// The parser bounds how deep values nest.
fn mend(value: &mut Value, counts: &mut Counts) {
    match value {
        Value::Object(members) => {
            let before = members.len();
            members.retain(|_, member| !member.is_null());
            counts.nulls += (before - members.len()) as u64;
            for (key, member) in members.iter_mut() {
                match member {
                    // Nothing in there is glTF's.
                    _ if key == "extras" => {}
                    Value::Number(number) if FLAGS.contains(&key.as_str()) => {
                        let flag = [0.0, 1.0].iter().position(|&f| number.as_f64() == Some(f));
                        if let Some(flag) = flag {
                            *member = Value::Bool(flag == 1);
                            counts.flags += 1;
                        }
                    }
                    // Programs of Windows write them.
                    Value::String(uri) if key == "uri" && uri.contains('\\') => {
                        *uri = uri.replace('\\', "/");
                        counts.backslashes += 1;
                    }
                    Value::Array(list) if UNORDERED.contains(&key.as_str()) => {
                        drop_nulls(list, counts);
                        mend(member, counts);
                    }
                    _ => mend(member, counts),
                }
            }
        }
        Value::Array(list) => {
            let objects = list.iter().any(Value::is_object);
            for entry in list {
                if entry.is_null() && objects {
                    *entry = Value::Object(Map::new());
                    counts.nulls += 1;
                } else {
                    mend(entry, counts);
                }
            }
        }
        _ => {}
    }
}

fn drop_nulls(list: &mut Vec<Value>, counts: &mut Counts) {
    let before = list.len();
    list.retain(|entry| !entry.is_null());
    counts.nulls += (before - list.len()) as u64;
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn nan_and_infinity_get_quotes_outside_of_strings_alone() {
        let text =
            r#"{"a":[NaN,-nan(ind), 1.5,-Infinity ,1e999,1.#QNAN],"NaN":"inf, \"NaN\" [nan]","b":nan}"#;
        let quoted = quoted_non_numbers(text).unwrap();
        let expected = r#"{"a":["NaN","-nan(ind)", 1.5,"-Infinity" ,"1e999","1.#QNAN"],"NaN":"inf, \"NaN\" [nan]","b":"nan"}"#;
        assert_eq!(quoted, expected);
        for plain in ["", "{}", r#"{"inf":[1,-2.5e3,true,null]}"#, r#""unended \" NaN"#] {
            assert_eq!(quoted_non_numbers(plain), None, "{plain}");
        }
    }

    #[test]
    fn null_is_absent_but_among_numbers() {
        let mut notes = Notes::default();
        let mut root = json!({
            "scene": null, "scenes": [{ "nodes": [null, 1] }], "extras": { "a": null },
            "nodes": [null, { "children": [null, 0, null], "matrix": [1, null], "name": null }],
            "materials": [{ "doubleSided": 1.0, "extensions": { "X": null } }],
        });
        document(&mut root, &mut notes);
        let expected = json!({
            "scenes": [{ "nodes": [1] }], "extras": { "a": null },
            "nodes": [{}, { "children": [0], "matrix": [1, null] }],
            "materials": [{ "doubleSided": true, "extensions": {} }],
        });
        assert_eq!(root, expected);
        let notes = notes.into_sentences();
        assert_eq!(notes[0], "null written for what is absent, read as absent: 7");
    }

    #[test]
    fn backslashes_of_file_names_are_slashes() {
        let mut root =
            json!({ "images": [{ "uri": "maps\\a.png", "name": "a\\b" }], "extras": { "uri": "a\\b" } });
        let mut notes = Notes::default();
        document(&mut root, &mut notes);
        assert_eq!(
            root,
            json!({ "images": [{ "uri": "maps/a.png", "name": "a\\b" }], "extras": { "uri": "a\\b" } })
        );
        assert!(notes.into_sentences()[0].starts_with("file names with backslashes"));
    }

    #[test]
    fn any_bytes_become_text() {
        let mut notes = Notes::default();
        assert_eq!(text(b"\xef\xbb\xbf{}\0\0", &mut notes), "{}");
        assert_eq!(text(b"\xff\xfe{\0}\0", &mut notes), "{}");
        assert_eq!(text(b"\xfe\xff\0{\0}\0", &mut notes), "{}");
        assert_eq!(text(b"K\xfcche \xc3\xa9", &mut notes), "Küche é");
        assert_eq!(text(b"\0\0", &mut notes), "");
    }
}
