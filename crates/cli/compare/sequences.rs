//! Sequences of images: errors frame by frame, and flicker.

use super::args::CompareArgs;
use super::layers::{judged, pairs};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::frames::{Pattern, parse_pattern};
use crate::output::{self, SCHEMA};
use anyhow::{Context, anyhow};
use relight_scene::image::FloatImage;
use relight_scene::image::flicker::{Flicker, FlickerMeter, PixelMeans, greys};
use relight_scene::image::metrics::{Comparison, compare};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Two sequences with the same frame numbers.
pub struct Both {
    image: Pattern,
    reference: Pattern,
    frames: Vec<u32>,
}

/// The sequences that were asked for; `None` if they are single images.
pub fn given(args: &CompareArgs) -> Result<Option<Both>, Failure> {
    let pattern = |file: &Path| {
        (!file.exists())
            .then(|| parse_pattern(&file.to_string_lossy()).ok())
            .flatten()
            .filter(Pattern::has_number)
    };
    let (image, reference) = match (pattern(&args.image), pattern(&args.reference)) {
        (None, None) => return Ok(None),
        (Some(image), Some(reference)) => (image, reference),
        _ => {
            return Err(anyhow!(
                "{} and {}: one is a sequence and one is not: give both with #### for the frame number, or two files",
                args.image.display(),
                args.reference.display()
            )
            .into());
        }
    };
    let found = |pattern: &Pattern, name: &Path| {
        let frames =
            (pattern.found()).with_context(|| format!("{}: can't look for frames", name.display()))?;
        match frames.is_empty() {
            true => Err(anyhow!("{}: no file has such a name", name.display())),
            false => Ok(frames),
        }
    };
    let frames = found(&image, &args.image)?;
    let others = found(&reference, &args.reference)?;
    let missing = |of: &[u32], all: &[u32]| {
        all.iter()
            .find(|&frame| of.binary_search(frame).is_err())
            .copied()
    };
    let lacking = missing(&others, &frames)
        .map(|frame| reference.file(frame))
        .or_else(|| missing(&frames, &others).map(|frame| image.file(frame)));
    if let Some(file) = lacking {
        return Err(anyhow!(
            "{}: is missing, although the other sequence has that frame: compare sequences of the same frames",
            file.display()
        )
        .into());
    }
    Ok(Some(Both {
        image,
        reference,
        frames,
    }))
}

/// What is known of a layer.
#[derive(Default)]
struct OfLayer {
    frames: Vec<Comparison>,
    image: PixelMeans,
    reference: PixelMeans,
}

/// Flicker of a layer; none with fewer than three frames or without light.
#[derive(Default)]
struct Steadiness {
    image: Option<Flicker>,
    reference: Option<Flicker>,
    /// Of what differs, relative to the reference.
    difference: Option<Flicker>,
}

#[derive(Serialize)]
struct Percentiles {
    median: f64,
    p99: f64,
    p999: f64,
}

impl Percentiles {
    fn of(flicker: Flicker) -> Percentiles {
        let Flicker { median, p99, p999 } = flicker;
        Percentiles { median, p99, p999 }
    }
}

#[derive(Serialize)]
struct Told {
    #[serde(skip_serializing_if = "Option::is_none")]
    relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_relmse: Option<f64>,
    worst_frame: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    bias: Option<f64>,
    flip: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    flicker: Option<Percentiles>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference_flicker: Option<Percentiles>,
    #[serde(skip_serializing_if = "Option::is_none")]
    difference_flicker: Option<Percentiles>,
}

#[derive(Serialize)]
struct Report<'a> {
    schema: u32,
    command: &'static str,
    image: String,
    reference: String,
    frames: usize,
    layers: BTreeMap<&'a str, Told>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_relmse: Option<f64>,
    passed: bool,
}

impl Both {
    /// Calls `visit(layer, image, reference)` for every layer of every frame, in order. What is amiss with layers is told once.
    fn each(
        &self,
        args: &CompareArgs,
        console: &Console,
        mut visit: impl FnMut(&str, &FloatImage, &FloatImage) -> anyhow::Result<()>,
    ) -> Result<(), Failure> {
        let silent = console.silent();
        for &frame in &self.frames {
            let of_frame = CompareArgs {
                image: self.image.file(frame),
                reference: self.reference.file(frame),
                ..args.clone()
            };
            let told = if frame == self.frames[0] { console } else { &silent };
            for (layer, image, reference) in pairs(&of_frame, told)? {
                visit(&layer, &image, &reference)
                    .with_context(|| format!("{}: layer {layer}", of_frame.image.display()))?;
            }
        }
        Ok(())
    }
}

/// Compares them.
pub fn run(args: &CompareArgs, both: &Both, console: &Console) -> Result<Outcome, Failure> {
    let mut layers: BTreeMap<String, OfLayer> = BTreeMap::new();
    let mut size = None;
    both.each(args, console, |layer, image, reference| {
        let own = (image.width, image.height);
        if *size.get_or_insert(own) != own {
            return Err(anyhow!(
                "is {} x {}: frames of a sequence are of one size",
                own.0,
                own.1
            ));
        }
        let of_layer = layers.entry(layer.to_owned()).or_default();
        of_layer.frames.push(compare(image, reference)?);
        of_layer.image.add(&greys(image));
        of_layer.reference.add(&greys(reference));
        Ok(())
    })?;
    layers.retain(|layer, of_layer| {
        let everywhere = of_layer.frames.len() == both.frames.len();
        if !everywhere {
            console.note(format!(
                "note: layer {layer} is not in all frames and is left aside"
            ));
        }
        everywhere
    });
    let steadiness = steadiness(args, both, &layers, &console.silent())?;
    let worst = (layers.values().flat_map(|layer| &layer.frames))
        .map(|frame| frame.relmse)
        .fold(0.0, f64::max);
    if args.json {
        output::print_json(&Report {
            schema: SCHEMA,
            command: "compare",
            image: args.image.display().to_string(),
            reference: args.reference.display().to_string(),
            frames: both.frames.len(),
            layers: (layers.iter().zip(steadiness))
                .map(|((name, layer), steadiness)| (&**name, told(layer, steadiness, &both.frames)))
                .collect(),
            worst_relmse: worst.is_finite().then_some(worst),
            max_relmse: args.max_relmse,
            passed: args.max_relmse.is_none_or(|most| worst <= most),
        })?;
    } else {
        output::print_text(&(table(&layers, &steadiness, &both.frames) + "\n"))?;
    }
    Ok(judged(worst, args.max_relmse, console))
}

/// Second pass.
fn steadiness(
    args: &CompareArgs,
    both: &Both,
    layers: &BTreeMap<String, OfLayer>,
    console: &Console,
) -> Result<Vec<Steadiness>, Failure> {
    let mut meters: BTreeMap<&str, [FlickerMeter; 3]> = (layers.iter())
        .map(|(name, layer)| {
            let of = FlickerMeter::new;
            (
                &**name,
                [of(&layer.image), of(&layer.reference), of(&layer.reference)],
            )
        })
        .collect();
    both.each(args, console, |layer, image, reference| {
        if let Some([of_image, of_reference, of_difference]) = meters.get_mut(layer) {
            let (image, reference) = (greys(image), greys(reference));
            of_difference.add(image.iter().zip(&reference).map(|(a, b)| a - b).collect());
            of_image.add(image);
            of_reference.add(reference);
        }
        Ok(())
    })?;
    Ok((meters.into_values())
        .map(|[image, reference, difference]| Steadiness {
            image: image.flicker(),
            reference: reference.flicker(),
            difference: difference.flicker(),
        })
        .collect())
}

impl OfLayer {
    /// Mean over the frames.
    fn mean(&self, of: impl Fn(&Comparison) -> f64) -> f64 {
        self.frames.iter().map(of).sum::<f64>() / self.frames.len() as f64
    }

    /// Which frame has the largest relMSE.
    fn worst(&self) -> usize {
        let by_error = |a: &usize, b: &usize| self.frames[*a].relmse.total_cmp(&self.frames[*b].relmse);
        (0..self.frames.len()).max_by(by_error).unwrap_or(0)
    }
}

fn told(layer: &OfLayer, steadiness: Steadiness, frames: &[u32]) -> Told {
    let finite = |x: f64| x.is_finite().then_some(x);
    Told {
        relmse: finite(layer.mean(|frame| frame.relmse)),
        worst_relmse: finite(layer.frames[layer.worst()].relmse),
        worst_frame: frames[layer.worst()],
        bias: finite(layer.mean(|frame| frame.bias)),
        flip: layer.mean(|frame| frame.flip),
        flicker: steadiness.image.map(Percentiles::of),
        reference_flicker: steadiness.reference.map(Percentiles::of),
        difference_flicker: steadiness.difference.map(Percentiles::of),
    }
}

/// A row for each layer; flicker as median, 99th and 99.9th percentile.
fn table(layers: &BTreeMap<String, OfLayer>, steadiness: &[Steadiness], frames: &[u32]) -> String {
    let header = [
        "layer",
        "relMSE",
        "worst",
        "frame",
        "bias %",
        "FLIP",
        "flicker %",
        "reference's %",
        "difference's %",
    ];
    let of = |x: f64, word: fn(f64) -> String| if x.is_finite() { word(x) } else { "-".into() };
    let percent = |flicker: Option<Flicker>| match flicker {
        Some(Flicker { median, p99, p999 }) => {
            format!("{:.3} / {:.2} / {:.1}", 100.0 * median, 100.0 * p99, 100.0 * p999)
        }
        None => "-".into(),
    };
    let rows = layers.iter().zip(steadiness).map(|((name, layer), steady)| {
        let worst = layer.worst();
        vec![
            name.clone(),
            of(layer.mean(|frame| frame.relmse), |x| format!("{x:.6}")),
            of(layer.frames[worst].relmse, |x| format!("{x:.6}")),
            frames[worst].to_string(),
            of(layer.mean(|frame| frame.bias), |x| format!("{:+.3}", 100.0 * x)),
            format!("{:.4}", layer.mean(|frame| frame.flip)),
            percent(steady.image),
            percent(steady.reference),
            percent(steady.difference),
        ]
    });
    output::table(&header, rows)
}
