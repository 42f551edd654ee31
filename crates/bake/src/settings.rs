//! Checks of a bake's parameters, and their names and values for provenance.

use crate::error::BakeError;
use crate::params::{BakeParams, CutMode, CutParams};
use glam::DVec3;
use relight_format::layout::setting;
use relight_transport::light_tree::HEIGHTS;

/// Most receiver levels: radii halve from level to level, and 2¹² is already finer than any pixel.
const MOST_LEVELS: usize = 12;

/// Checks that every parameter is in its range.
///
/// # Errors
/// [`BakeError::Parameter`] with the option's name.
pub fn validate(params: &BakeParams) -> Result<(), BakeError> {
    let check = |holds: bool, name, found: String, expected| {
        if holds {
            Ok(())
        } else {
            Err(BakeError::Parameter {
                name,
                found,
                expected,
            })
        }
    };
    let positive = |x: f32| x.is_finite() && x > 0.0;
    let BakeParams {
        levels,
        sender_levels,
        coarse_radius,
        epsilon,
        rays,
        ref viewpoints,
        ..
    } = *params;
    check(
        (1..=MOST_LEVELS).contains(&levels),
        "--levels",
        levels.to_string(),
        "a number from 1 to 12",
    )?;
    check(
        (1..=levels).contains(&sender_levels),
        "--sender-levels",
        sender_levels.to_string(),
        "a number from 1 to that of --levels",
    )?;
    let radius = coarse_radius.unwrap_or(1.0);
    check(
        positive(radius),
        "--coarse-radius",
        radius.to_string(),
        "a length above 0, in metres",
    )?;
    check(
        positive(epsilon),
        "--epsilon",
        epsilon.to_string(),
        "a number above 0",
    )?;
    check(rays >= 2, "rays per receiver", rays.to_string(), "at least 2")?;
    check(params.bounces != Some(0), "--bounces", "0".into(), "at least 1")?;
    if let Some(v) = viewpoints.iter().find(|v| !v.is_finite()) {
        check(false, "--viewpoint", v.to_string(), "finite coordinates")?;
    }
    let Some(cuts) = &params.cuts else { return Ok(()) };
    check(
        cuts.lights.is_power_of_two() && HEIGHTS.contains(&cuts.lights.ilog2()),
        "--cut-lights",
        cuts.lights.to_string(),
        "a power of two from 256 to 1048576",
    )?;
    check(
        positive(cuts.sigma),
        "--sigma",
        cuts.sigma.to_string(),
        "a number above 0 (1.5 to 3 is usual)",
    )?;
    check(
        (0.0..=1.0).contains(&cuts.beta),
        "--beta",
        cuts.beta.to_string(),
        "a number from 0 (visibility alone) to 1 (geometry alone)",
    )
}

/// Names and values in the order of the command line's help, places in the coordinates of the scene's file, from which it was moved by
/// `offset`.
pub fn settings(params: &BakeParams, offset: DVec3) -> Vec<(String, String)> {
    let of_cuts = params.cuts.iter().flat_map(|cuts| {
        let mode = match cuts.mode {
            CutMode::Environment => "environment",
            CutMode::Indirect => "indirect",
        };
        // Said where it is another than ever before.
        let most = (cuts.most != CutParams::default().most).then(|| ("cut_nodes", cuts.most.to_string()));
        [
            ("cuts", mode.to_owned()),
            ("cut_lights", cuts.lights.to_string()),
            ("sigma", cuts.sigma.to_string()),
            ("beta", cuts.beta.to_string()),
        ]
        .into_iter()
        .chain(most)
    });
    let names: Vec<&str> = params.keep.iter().map(|part| part.name()).collect();
    let kept = (!names.is_empty()).then(|| ("keep", names.join(" ")));
    let automatic = |value: Option<String>| value.unwrap_or_else(|| "automatic".into());
    let viewpoints: Vec<String> = params
        .viewpoints
        .iter()
        .map(|v| match offset {
            DVec3::ZERO => format!("{},{},{}", v.x, v.y, v.z),
            _ => {
                let v = v.as_dvec3() + offset;
                format!("{},{},{}", v.x, v.y, v.z)
            }
        })
        .collect();
    [
        ("levels", params.levels.to_string()),
        ("sender_levels", params.sender_levels.to_string()),
        (
            "coarse_radius",
            automatic(params.coarse_radius.map(|r| r.to_string())),
        ),
        ("epsilon", params.epsilon.to_string()),
        ("rays", params.rays.to_string()),
        (
            setting::BOUNCES,
            params
                .bounces
                .map_or(setting::CONVERGED.into(), |n| n.to_string()),
        ),
        (
            setting::SOLUTION,
            if params.solution {
                setting::BAKED
            } else {
                "at play time"
            }
            .into(),
        ),
        (
            "viewpoints",
            if viewpoints.is_empty() {
                "automatic".into()
            } else {
                viewpoints.join(" ")
            },
        ),
    ]
    .into_iter()
    .chain(of_cuts)
    .chain(kept)
    .map(|(name, value)| (name.to_owned(), value))
    .collect()
}
