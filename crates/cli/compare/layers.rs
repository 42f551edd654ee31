//! Layers that belong together, and whether their error is allowed.

use super::args::CompareArgs;
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use relight_scene::image::{FloatImage, Layers};

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

/// The layers that both have, or the one asked for.
///
/// # Errors
/// They have none in common, or one lacks what was asked for.
pub fn pairs(
    args: &CompareArgs,
    image: &Layers,
    reference: &Layers,
    console: &Console,
) -> Result<Vec<Pair>, Failure> {
    let names = |layers: &Layers| {
        layers
            .layers
            .iter()
            .map(|l| l.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let (a, b) = (args.image.display(), args.reference.display());
    if let Some(name) = &args.layer {
        let only = || match reference.layers.as_slice() {
            [only] => reference.rgb(&only.name),
            _ => None,
        };
        let left = image
            .find(name)
            .and_then(|layer| image.rgb(&layer.name))
            .ok_or_else(|| anyhow::anyhow!("{a}: has no layer {name:?}; it has {}", names(image)))?;
        let right = reference
            .find(name)
            .and_then(|layer| reference.rgb(&layer.name))
            .or_else(only)
            .ok_or_else(|| anyhow::anyhow!("{b}: has no layer {name:?}; it has {}", names(reference)))?;
        return Ok(vec![(name.clone(), left, right)]);
    }
    let mut pairs = Vec::new();
    let mut found = Vec::new();
    for layer in &image.layers {
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
    for layer in (reference.layers.iter()).filter(|layer| !found.contains(&layer.name.as_str())) {
        console.note(format!("note: layer {} is in {b} only", layer.name));
    }
    if pairs.is_empty() {
        return Err(anyhow::anyhow!(
            "{a} and {b} have no layer in common: {} against {}; --layer compares one with the reference's only one",
            names(image),
            names(reference)
        )
        .into());
    }
    Ok(pairs)
}
