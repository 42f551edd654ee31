//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views whose bytes are coded by meshoptimizer.
//!
//! Written from the bitstream's specification in KHR_meshopt_compression (appendices A and B), which holds that of
//! EXT_meshopt_compression: both versions of attribute streams and all filters are read under either name. Why this is our
//! own and no crate: docs/import.md.
//!
//! Any bytes give elements or an error. What is allocated is `count · stride` bytes, which whoever calls bounds beforehand
//! by [`Stream::fewest_bytes`] and by the file's size.

mod attributes;
mod filters;
mod indices;
#[cfg(test)]
mod tests;

use super::json::At;

/// Both names of the extension.
pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// What a stream holds and how it is coded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stream {
    mode: Mode,
    filter: Filter,
    count: u64,
    stride: u64,
}

impl Stream {
    /// Reads and checks an extension's object.
    pub fn parse(at: &At) -> Option<Stream> {
        let (count, stride) = (at.required_uint("count"), at.required_uint("byteStride"));
        let mode = match at.text("mode") {
            Some("ATTRIBUTES") => Mode::Attributes,
            Some("TRIANGLES") => Mode::Triangles,
            Some("INDICES") => Mode::Indices,
            other => {
                let found = other.unwrap_or("missing");
                at.fault_at(
                    "mode",
                    format!("is {found}; it must be ATTRIBUTES, TRIANGLES or INDICES"),
                );
                return None;
            }
        };
        let filter = match at.text("filter") {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some("COLOR") => Filter::Color,
            Some(other) => {
                let list = "NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL or COLOR";
                at.fault_at("filter", format!("is {other}; it must be {list}"));
                return None;
            }
        };
        let (count, stride) = (count?, stride?);
        let fits = match mode {
            Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
            _ => stride == 2 || stride == 4,
        };
        let filtered = match filter {
            Filter::None => true,
            _ if mode != Mode::Attributes => false,
            Filter::Octahedral | Filter::Color => stride == 4 || stride == 8,
            Filter::Quaternion => stride == 8,
            Filter::Exponential => true,
        };
        if !fits || !filtered {
            let coded = format!("{mode:?} with filter {filter:?}").to_uppercase();
            at.fault_at(
                "byteStride",
                format!("is {stride}, which {coded} cannot have; compress the scene again"),
            );
            return None;
        }
        if mode == Mode::Triangles && !count.is_multiple_of(3) {
            at.fault_at("count", format!("is {count}; triangles have a multiple of 3"));
            return None;
        }
        Some(Stream {
            mode,
            filter,
            count,
            stride,
        })
    }

    /// Bytes that it decodes to.
    pub fn decoded_bytes(&self) -> Option<u64> {
        self.count.checked_mul(self.stride)
    }

    /// Bytes that a stream of so many elements has at least.
    pub fn fewest_bytes(&self) -> u64 {
        match self.mode {
            Mode::Attributes => attributes::fewest_bytes(self.count, self.stride),
            Mode::Triangles => indices::fewest_triangle_bytes(self.count),
            Mode::Indices => indices::fewest_sequence_bytes(self.count),
        }
    }

    /// The elements that `bytes` hold, `count · stride` bytes.
    ///
    /// # Errors
    /// What is wrong with the stream, as the rest of a sentence about it.
    pub fn decode(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let (count, stride) = (self.count as usize, self.stride as usize);
        let mut decoded = match self.mode {
            Mode::Attributes => attributes::decode(bytes, count, stride)?,
            Mode::Triangles => indices::pack(&indices::decode_triangles(bytes, count)?, stride)?,
            Mode::Indices => indices::pack(&indices::decode_sequence(bytes, count)?, stride)?,
        };
        match (self.filter, stride) {
            (Filter::None, _) => {}
            (Filter::Octahedral, 4) => filters::octahedral_8(&mut decoded),
            (Filter::Octahedral, _) => filters::octahedral_16(&mut decoded),
            (Filter::Quaternion, _) => filters::quaternion(&mut decoded),
            (Filter::Exponential, _) => filters::exponential(&mut decoded),
            (Filter::Color, 4) => filters::color_8(&mut decoded),
            (Filter::Color, _) => filters::color_16(&mut decoded),
        }
        Ok(decoded)
    }
}
