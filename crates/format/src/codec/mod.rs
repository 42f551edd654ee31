//! Codecs: how numbers become few bytes. Each module is testable alone and states its error bound; SPEC 6
//! and 7 specify them. All arithmetic is IEEE 754 addition, multiplication, division, square root and rounding, so
//! that every machine writes and reads the same bits (no logarithms, whose libraries differ).
//!
//! | what | codec | bound |
//! | --- | --- | --- |
//! | point positions | [`grid`] | distance ≤ R/256 |
//! | point normals, 2 × 12 bits | [`octahedral`] | angle ≤ 1.1e-3 rad |
//! | vertex normals and tangents, 2 × 16 bits | [`octahedral`] | angle ≤ 6.6e-5 rad |
//! | albedo, 12 bits | [`albedo`] | ≤ 1.9e-4, and less towards 0 and 1 |
//! | link vectors | [`vector`] | relative ≤ 2⁻⁹ |
//! | bounce weights, 16 bits | [`fraction`] | ≤ 1.6e-5 of the row's largest, times 1 + that of the rescaling |
//! | clusters of points | [`recency`] | exact |
//! | surface lights | [`grid`], [`octahedral`] | distance ≤ √area/256, angle ≤ 1.1e-3 rad |
//! | means over the nodes of cuts | [`cut`] | ≤ 1/(2·steps), about σ/(4·√leaves), and f32 rounding; 0 and 1 exact |

pub mod albedo;
pub mod bytes;
pub mod cut;
pub mod fraction;
pub(crate) mod frame;
pub mod grid;
pub mod octahedral;
pub mod recency;
pub(crate) mod record;
pub mod vector;
