//! `relight compare`: how far an image is from a reference.

mod sequences;

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::kinds::{self, Wanted};
use crate::output::{self, SCHEMA};
use clap::Args;
use relight_scene::image::metrics::{Comparison, compare};
use relight_scene::image::{FloatImage, Layers, Limits, read_exr};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Compare an OpenEXR image with a reference, layer by layer.
///
/// Per layer: RMSE; relMSE (squared error relative to the pixel's squared brightness plus 1 % of the squared
/// mean, the worst 0.1 % of the pixels left out); PSNR; bias (relative error of the mean); the 99th percentile of
/// the relative error; HDR-FLIP (what the eye sees, 0 to 1). Layers of the same pass belong together although other
/// programs name them otherwise (ViewLayer.Combined is beauty, RenderLayer.DiffDir is DiffDir); layers that only one
/// image has are named and left aside. Colours are compared in Rec. 709, over the display window.
///
/// Two sequences, given with #### or %04d for the frame number, are compared frame by frame; then flicker is told, too: the absolute
/// second difference in time of a pixel over its mean, of the image, of the reference, and of what differs between them.
#[derive(Args, Clone)]
pub struct CompareArgs {
    /// Image to judge, or a sequence (frame_####.exr).
    #[arg(value_name = "A.exr")]
    pub image: PathBuf,
    /// Reference; of a sequence the sequence with the same frame numbers.
    #[arg(value_name = "B.exr")]
    pub reference: PathBuf,
    /// Compare this layer only. A reference without it is taken by its only layer.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Exit with code 3 if the relMSE of any layer is above this.
    #[arg(long, value_name = "X", value_parser = at_least_0)]
    pub max_relmse: Option<f64>,
    /// Print one JSON object on stdout instead of a table. What has no meaning is left out: psnr_db of equal images, relmse, bias and
    /// relative_error_p99 against a black reference (reference_is_black).
    #[arg(long)]
    pub json: bool,
}

fn at_least_0(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 => Ok(number),
        _ => Err("expected a number of at least 0".into()),
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    schema: u32,
    command: &'static str,
    image: String,
    reference: String,
    layers: BTreeMap<&'a str, Measured>,
    /// Nothing where light stands against a black reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max_relmse: Option<f64>,
    passed: bool,
}

/// How far a layer is from the reference. What has no meaning is left out: errors relative to black, the PSNR of equal images.
#[derive(Serialize)]
struct Measured {
    image_is_black: bool,
    reference_is_black: bool,
    rmse: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    relmse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    psnr_db: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bias: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_rgb: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    relative_error_p99: Option<f64>,
    flip: f64,
}

impl Measured {
    fn new(c: &Comparison, black: [bool; 2]) -> Measured {
        let finite = |x: f64| x.is_finite().then_some(x);
        Measured {
            image_is_black: black[0],
            reference_is_black: black[1],
            rmse: c.rmse,
            relmse: finite(c.relmse),
            psnr_db: finite(c.psnr_db),
            bias: finite(c.bias),
            bias_rgb: Some(c.bias_rgb).filter(|bias| bias.iter().all(|b| b.is_finite())),
            relative_error_p99: finite(c.relative_error_p99),
            flip: c.flip,
        }
    }
}

fn is_black(image: &FloatImage) -> bool {
    image.pixels.iter().all(|pixel| *pixel == [0.0; 3])
}

/// Says that an image is black.
fn tell_black(args: &CompareArgs, layer: &str, black: [bool; 2], console: &Console) {
    let file = |path: &PathBuf| path.display().to_string();
    let (image, reference) = (file(&args.image), file(&args.reference));
    match black {
        [false, false] => {}
        [true, true] => console.note(format!("note: layer {layer} is black in both images")),
        [true, false] => console.note(format!("warning: layer {layer} of {image} is black")),
        [false, true] => console.note(format!(
            "warning: layer {layer} of {reference} is black: nothing is relative to it, and {image} is not black"
        )),
    }
}

/// Runs the command.
pub fn run(args: &CompareArgs, console: &Console) -> Result<Outcome, Failure> {
    if let Some(both) = sequences::given(args)? {
        return sequences::run(args, &both, console);
    }
    for file in [&args.image, &args.reference] {
        kinds::check(file, Wanted::Image)?;
    }
    let limits = Limits::default();
    let (image, reference) = (
        read_exr(&args.image, &limits)?,
        read_exr(&args.reference, &limits)?,
    );
    let pairs = pairs(args, &image, &reference, console)?;
    let (mut results, mut black) = (Vec::new(), Vec::new());
    for (name, a, b) in pairs {
        black.push([is_black(&a), is_black(&b)]);
        tell_black(args, &name, [is_black(&a), is_black(&b)], console);
        let measured = compare(&a, &b)
            .map_err(|error| anyhow::anyhow!("{}: layer {name}: {error}", args.image.display()))?;
        results.push((name, measured));
    }
    let worst = results.iter().map(|(_, c)| c.relmse).fold(0.0, f64::max);
    let short = args.max_relmse.is_some_and(|most| worst > most);
    if args.json {
        output::print_json(&Report {
            schema: SCHEMA,
            command: "compare",
            image: args.image.display().to_string(),
            reference: args.reference.display().to_string(),
            layers: (results.iter().zip(black))
                .map(|((name, c), black)| (&**name, Measured::new(c, black)))
                .collect(),
            worst_relmse: worst.is_finite().then_some(worst),
            max_relmse: args.max_relmse,
            passed: !short,
        })?;
    } else {
        output::print_text(&(results_table(&results) + "\n"))?;
    }
    Ok(judged(worst, args.max_relmse, console))
}

/// Whether the worst relMSE is allowed.
fn judged(worst: f64, most: Option<f64>, console: &Console) -> Outcome {
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

type Pair = (String, FloatImage, FloatImage);

fn pairs(
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

/// A table of comparisons, one row each.
pub fn results_table(results: &[(String, Comparison)]) -> String {
    let header = ["layer", "RMSE", "relMSE", "PSNR dB", "bias %", "p99 rel.", "FLIP"];
    // Against black.
    let of = |x: f64, word: fn(f64) -> String| if x.is_finite() { word(x) } else { "-".into() };
    let rows = results.iter().map(|(name, c)| {
        vec![
            name.clone(),
            format!("{:.5}", c.rmse),
            of(c.relmse, |x| format!("{x:.6}")),
            match c.psnr_db {
                f64::INFINITY => "equal".into(),
                psnr => of(psnr, |x| format!("{x:.2}")),
            },
            of(c.bias, |x| format!("{:+.3}", 100.0 * x)),
            of(c.relative_error_p99, |x| format!("{x:.4}")),
            format!("{:.4}", c.flip),
        ]
    });
    output::table(&header, rows)
}
