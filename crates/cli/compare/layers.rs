//! Layers that belong together, and whether their error is allowed.

use super::args::CompareArgs;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::kinds::{self, Wanted};
use relight_scene::image::{ALPHA, FloatImage, Layer, Limits, read_exr};

/// Whether the worst relMSE is allowed.
pub fn judged(worst: f64, most: Option<f64>, console: &Console) -> Outcome {
    match most.filter(|&most| worst > most) {
        Some(most) => {
            // Asked for, so said even with --quiet.
            console.fail(&format!(
                "relight: relMSE is {worst:.6}, above --max-relmse {most}"
            ));
            Outcome::FellShort
        }
        None => Outcome::Done,
    }
}

/// A layer's name, the image's and the reference's.
pub type Pair = (String, FloatImage, FloatImage);

/// Whether a layer is compared without being asked for: coverage and identifiers are no light.
fn is_picture(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name);
    last != ALPHA && !name.starts_with("Crypto") && !last.starts_with("Crypto")
}

/// The layers that both files have and that are pictures, or the one asked for.
///
/// # Errors
/// A file can't be read, they have no layer in common, or one lacks what was asked for.
pub fn pairs(args: &CompareArgs, console: &Console) -> Result<Vec<Pair>, Failure> {
    for file in [&args.image, &args.reference] {
        kinds::check(file, Wanted::Image)?;
    }
    let limits = Limits::default();
    let (image, reference) = (
        read_exr(&args.image, &limits)?,
        read_exr(&args.reference, &limits)?,
    );
    let (a, b) = (args.image.display(), args.reference.display());
    if let Some(name) = &args.layer {
        let only = || {
            let mut pictures = reference.layers.iter().filter(|layer| is_picture(&layer.name));
            let first = pictures.next().filter(|_| pictures.next().is_none())?;
            reference.rgb(&first.name)
        };
        let left = image
            .find(name)
            .and_then(|layer| image.rgb(&layer.name))
            .ok_or_else(|| anyhow::anyhow!("{a}: has no layer {name:?}; it has {}", image.names()))?;
        let right = reference
            .find(name)
            .and_then(|layer| reference.rgb(&layer.name))
            .or_else(only)
            .ok_or_else(|| anyhow::anyhow!("{b}: has no layer {name:?}; it has {}", reference.names()))?;
        return Ok(vec![(name.clone(), left, right)]);
    }
    let mut pairs = Vec::new();
    let mut found = Vec::new();
    for layer in (image.layers.iter()).filter(|layer| is_picture(&layer.name)) {
        // Of two layers that mean the same here, none is the one that the reference means.
        let alone = image.find(&layer.name).is_some();
        let other = reference.find(&layer.name).filter(|other| {
            alone
                && image
                    .find(&other.name)
                    .is_some_and(|back| back.name == layer.name)
        });
        let other = other.map(|other| other.name.as_str());
        match (image.rgb(&layer.name), other.and_then(|name| reference.rgb(name))) {
            (Some(left), Some(right)) => {
                found.extend(other);
                pairs.push((layer.name.clone(), left, right));
            }
            _ => console.note(format!("note: layer {} is in {a} only", layer.name)),
        }
    }
    let missed = |layer: &&Layer| is_picture(&layer.name) && !found.contains(&layer.name.as_str());
    for layer in reference.layers.iter().filter(missed) {
        console.note(format!("note: layer {} is in {b} only", layer.name));
    }
    if pairs.is_empty() {
        return Err(anyhow::anyhow!(
            "{a} and {b} have no layer in common: {} against {}; --layer compares one with the reference's only one",
            image.names(),
            reference.names()
        )
        .into());
    }
    Ok(pairs)
}
