//! What rules are checked with: each fails as `Invalid`, with the section and the element that breaks the rule.

use std::fmt::{Debug, Display};

use crate::error::{Location, Result, require};
use crate::layout::Kind;

/// How far a normal's squared length may be from 1: normals normalised in half precision pass, forgotten
/// normalisation does not.
const UNIT_TOLERANCE: f32 = 4e-3;

pub fn check(
    holds: bool,
    section: Kind,
    element: usize,
    expected: impl Display,
    found: impl Display,
) -> Result<()> {
    let element = Location::Element(element as u64);
    require(holds, section.name(), element, expected, found)
}

/// Each of some values; the first that breaks the rule is in the error.
pub fn check_each<T: Debug>(
    section: Kind,
    values: &[T],
    expected: impl Display,
    holds: impl Fn(&T) -> bool,
) -> Result<()> {
    match values.iter().position(|value| !holds(value)) {
        None => Ok(()),
        Some(i) => check(false, section, i, expected, format_args!("{:?}", values[i])),
    }
}

pub fn check_length(section: Kind, what: &str, length: usize, expected: usize) -> Result<()> {
    let first = length.min(expected);
    let expected_what = format_args!("{expected} {what}");
    check(length == expected, section, first, expected_what, length)
}

/// An index that is to be below an end.
pub fn check_below(section: Kind, element: usize, what: &str, index: u32, end: usize) -> Result<()> {
    let expected = format_args!("a {what} below {end}");
    check((index as usize) < end, section, element, expected, index)
}

pub fn check_above_zero(section: Kind, element: usize, what: &str, value: f32) -> Result<()> {
    let holds = value > 0.0 && value.is_finite();
    check(
        holds,
        section,
        element,
        format_args!("a finite {what} above 0"),
        value,
    )
}

pub fn check_finite<const N: usize>(section: Kind, what: &str, values: &[[f32; N]]) -> Result<()> {
    let finite = |value: &[f32; N]| value.iter().all(|c| c.is_finite());
    check_each(section, values, format_args!("finite {what}"), finite)
}

pub fn is_unit(n: &[f32; 3]) -> bool {
    // NaN compares false.
    (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0).abs() <= UNIT_TOLERANCE
}

pub fn check_unit(section: Kind, what: &str, normals: &[[f32; 3]]) -> Result<()> {
    check_each(section, normals, format_args!("unit {what}"), is_unit)
}
