//! Two images.

use super::args::CompareArgs;
use super::layers::{judged, pairs};
use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::output::{self, SCHEMA};
use relight_scene::image::FloatImage;
use relight_scene::image::metrics::{Comparison, compare};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

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

/// Compares them.
pub fn run(args: &CompareArgs, console: &Console) -> Result<Outcome, Failure> {
    let (mut results, mut black) = (Vec::new(), Vec::new());
    for (name, a, b) in pairs(args, console)? {
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
