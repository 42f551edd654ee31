//! What an asset says of its bake: settings, counts, what was left out, notes.

use crate::convert;
use crate::cuts::sections::CutSections;
use crate::left_out::Pruned;
use crate::links::operators::Transport;
use crate::omissions::Omissions;
use crate::points::coverage::Coverage;
use crate::points::placing::Placed;
use crate::request::Request;
use crate::settings;
use glam::DVec3;
use relight_format::{self as format, layout::setting};
use relight_scene::traced::Shading;

/// What the stages of a bake made, as far as its report depends on it.
pub(crate) struct Made<'a> {
    /// Points and viewers; the points themselves are in `transport`.
    pub placed: &'a Placed<'a>,
    /// How much of the surface the points cover.
    pub covered: Coverage,
    /// Points and operators.
    pub transport: &'a Transport,
    /// Visibility cuts, if any.
    pub cuts: Option<&'a CutSections>,
    /// What the scene's own parts became.
    pub pruned: &'a Pruned,
    /// What takes fewer bits in the file.
    pub coding: format::Coding,
}

impl Made<'_> {
    /// Provenance of the asset, less the counts of its content.
    pub fn provenance(&self, request: &Request) -> format::Provenance {
        let (omitted, scene, params) = (self.omissions(request), &request.scene, request.params);
        let mut counts = self.counts(params.sender_levels);
        counts.extend(omitted.counts());
        format::Provenance {
            tool_version: concat!("relight ", env!("CARGO_PKG_VERSION")).into(),
            settings: self.settings(request),
            source_hash: request.source_hash,
            seed: params.seed,
            lambert: request.shading == Shading::Lambert,
            left_out: omitted.list,
            counts,
            notes: scene.notes.iter().cloned().chain(self.remarks()).collect(),
        }
    }

    fn omissions(&self, request: &Request) -> Omissions {
        let (params, transport) = (request.params, self.transport);
        let receivers = transport.points.count();
        let mut omitted = Omissions {
            list: self.pruned.left_out.clone(),
            ..Omissions::default()
        };
        omitted.unreached(self.covered, receivers);
        omitted.of_operators(transport, params);
        if params.cuts.is_some() && self.cuts.is_none() {
            let finest = transport.points.levels.last();
            omitted.unused_cuts(finest.map_or(0, |level| level.points.len()));
        }
        let short = (self.coding.short_links).then_some(transport.links.columns.len());
        omitted.precision(receivers, self.coding.grey, short, params);
        if let Some(made) = self.cuts {
            omitted.cut_precision(made.cuts.heights.len());
        }
        omitted
    }

    fn settings(&self, request: &Request) -> Vec<(String, String)> {
        let kept = |keeps: bool| if keeps { "kept" } else { setting::LEFT_OUT };
        let mut all = settings::settings(request.params, self.pruned.scene.offset);
        let mut add = |name: &str, value: String| all.push((name.to_owned(), value));
        add(setting::OWN_LIGHTS, kept(self.pruned.keeps_lights).into());
        add(setting::EMISSION, kept(self.pruned.keeps_emission).into());
        if request.params.cameras_only {
            add(setting::CAMERAS_ONLY, convert::camera_hashes(&self.placed.tracks));
        }
        let offset = self.pruned.scene.offset;
        if offset != DVec3::ZERO {
            add(setting::OFFSET, format!("{} {} {}", offset.x, offset.y, offset.z));
        }
        if let Some(lines) = convert::object_lines(&self.pruned.scene.object_names) {
            add(setting::OBJECTS, lines);
        }
        if let Some(lines) = convert::variant_lines(&self.pruned.scene.variants) {
            add(setting::VARIANTS, lines);
        }
        all
    }

    /// Rays of all stages but the cuts, which have a caster of their own.
    pub fn rays(&self) -> u64 {
        self.transport.rays + self.placed.rays
    }

    fn counts(&self, sender_levels: usize) -> Vec<(String, u64)> {
        let points = &self.transport.points;
        let gathered = self.transport.gathered.iter().sum::<usize>() as u64;
        let square_mm = |area: f64| (area * 1e6).round() as u64;
        let senders = points
            .levels
            .iter()
            .take(sender_levels)
            .map(|level| level.points.len());
        [
            ("rays", self.rays() + self.cuts.map_or(0, |cuts| cuts.rays)),
            (
                "potential_links",
                points.count() as u64 * senders.sum::<usize>() as u64,
            ),
            ("candidates", points.candidates),
            ("receivers_gathered", gathered),
            ("rays_without_points", self.transport.lost),
            ("surface_square_mm", square_mm(self.covered.area)),
            ("uncovered_square_mm", square_mm(self.covered.uncovered)),
        ]
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect()
    }

    fn remarks(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.placed.found.is_empty() {
            let places: Vec<String> = (self.placed.found.iter())
                .map(|v| v.as_dvec3() + self.pruned.scene.offset)
                .map(|v| format!("({:.3}, {:.3}, {:.3})", v.x, v.y, v.z))
                .collect();
            notes.push(format!(
                "The scene has no camera: points were spread from the open space around {}; --viewpoint sets other places.",
                places.join(", ")
            ));
        }
        if self.transport.links.is_empty() {
            notes.push(
                "No surface sees another: there is no indirect light, and the transfer operator is empty."
                    .into(),
            );
        }
        notes
    }
}
