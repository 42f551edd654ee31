//! JSON that people write and this program reads: lighting sequences, material edits, scene descriptions.
//!
//! Types say what a file may hold (`serde`, with [`quantity`] for numbers in a range and [`keyed`] for values with
//! keys); [`decode`] reads them so that every message has the path of the field, and the place in the text. An object
//! whose fields depend on one of them (a light's on its `type`) is kept as text first and read once that is known, since
//! serde forgets paths where it buffers values itself.

pub(crate) mod decode;
pub mod error;
pub(crate) mod keyed;
pub(crate) mod path;
pub(crate) mod quantity;
pub mod token;
