//! Stands in for the AVX2 kernel where there is none: a type without values.

use super::layout::Tree;
use super::ray::{Hit, Ray};
use super::shaft::{BvhPart, ShaftEnd, ShaftStart};

/// Proof that the processor runs the AVX2 kernel: none here.
#[derive(Clone, Copy)]
pub(super) enum Avx2 {}

impl Avx2 {
    pub(super) fn detect() -> Option<Avx2> {
        None
    }

    pub(super) fn cast<const ANY: bool>(self, _: &Tree, _: &Ray, _: &impl Fn(&Hit) -> bool) -> Option<Hit> {
        match self {}
    }

    pub(super) fn narrow(
        self,
        _: &Tree,
        _: (&ShaftStart, &ShaftEnd),
        _: &[BvhPart],
        _: usize,
        _: usize,
        _: &mut Vec<BvhPart>,
    ) -> bool {
        match self {}
    }

    pub(super) fn cast_among(
        self,
        _: &Tree,
        _: &Ray,
        _: &[BvhPart],
        _: &impl Fn(&Hit) -> bool,
    ) -> Option<Hit> {
        match self {}
    }

    pub(super) fn any_hit_packet<const ALL: bool>(
        self,
        _: &Tree,
        _: &[Ray],
        _: &mut [bool],
        _: &impl Fn(usize, &Hit) -> bool,
    ) {
        match self {}
    }

    pub(super) fn closest_hit_packet(
        self,
        _: &Tree,
        _: &[Ray],
        _: &mut [Option<Hit>],
        _: &impl Fn(usize, &Hit) -> bool,
    ) {
        match self {}
    }
}
