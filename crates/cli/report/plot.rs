//! Error against time, bake time and size, on logarithmic axes.

use super::bitmap::{self, Bitmap};
use super::findings::pareto;
use super::measure::Measured;
use super::reference::Reference;
use crate::failure::Failure;
use plotters::coord::Shift;
use plotters::prelude::*;
use relight_scene::image::Image8;
use std::ops::Range;

/// Pixels of a plot.
const SIZE: (u32, u32) = (760, 460);
/// Errors below this are drawn here: a logarithm has no zero.
const LEAST_ERROR: f64 = 1e-4;

/// A plot as text.
pub struct Plot {
    /// File name without ending.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// The drawing.
    pub svg: String,
    /// The same as pixels.
    pub png: Image8,
}

/// One dot.
struct Dot<'a> {
    x: f64,
    y: f64,
    front: bool,
    integrator: &'a str,
}

/// Colours of the integrators, alike for most kinds of colour blindness (Okabe and Ito 2008).
fn color(integrator: &str) -> RGBColor {
    match integrator {
        "path" => RGBColor(0, 0, 0),
        "brute" => RGBColor(230, 159, 0),
        "auto" => RGBColor(0, 114, 178),
        "transfer" => RGBColor(86, 180, 233),
        "cuts" => RGBColor(0, 158, 115),
        "lightcuts" => RGBColor(213, 94, 0),
        _ => RGBColor(204, 121, 167),
    }
}

/// All plots of a report; none for what was not measured.
///
/// # Errors
/// A plot can't be drawn.
pub fn all(measured: &[Measured], references: &[Reference]) -> Result<Vec<Plot>, Failure> {
    type Axis = fn(&Measured) -> Option<f64>;
    let time: Axis = |m| Some(m.ms());
    let bake: Axis = |m| m.bake_seconds.filter(|_| m.needs_bake());
    let bytes: Axis = |m| m.needs_bake().then(|| m.asset_bytes() as f64 / 1e6);
    let front = pareto(measured);
    let mut plots = Vec::new();
    for (name, title, layer, label, x) in [
        (
            "error_time",
            "All light: error against milliseconds a frame",
            "beauty",
            "ms a frame",
            time,
        ),
        (
            "error_time_direct",
            "Direct light alone: error against milliseconds a frame",
            "direct",
            "ms a frame",
            time,
        ),
        (
            "error_bake",
            "All light: error against bake time",
            "beauty",
            "seconds of bake",
            bake,
        ),
        (
            "error_bytes",
            "All light: error against asset size",
            "beauty",
            "MB",
            bytes,
        ),
    ] {
        let dots: Vec<Dot> = measured
            .iter()
            .zip(&front)
            .filter(|(m, _)| m.setting.layer == layer)
            .filter_map(|(m, &front)| {
                // Against black, a relative error is infinite: no axis holds it.
                let error = Some(m.judged().relative()).filter(|e| e.is_finite())?;
                let x = x(m).filter(|x| *x > 0.0)?;
                Some(Dot {
                    x,
                    y: error.max(LEAST_ERROR),
                    front,
                    integrator: m.setting.integrator,
                })
            })
            .collect();
        if dots.is_empty() {
            continue;
        }
        let floors = references
            .iter()
            .map(|r| r.floor_of(layer))
            .filter(|f| f.is_finite());
        let floor = (floors.sum::<f64>() / references.len().max(1) as f64).sqrt();
        let (svg, png) =
            both(&dots, label, floor).map_err(|error| anyhow::anyhow!("plot {name}: {error}"))?;
        plots.push(Plot {
            name,
            title: title.to_owned(),
            svg,
            png,
        });
    }
    Ok(plots)
}

/// A range that holds all values with room around them.
fn around(values: impl Iterator<Item = f64> + Clone) -> Range<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(0.0, f64::max);
    low / 1.6..high * 1.6
}

/// As lines and as pixels.
fn both(dots: &[Dot], label: &str, floor: f64) -> Result<(String, Image8), Box<dyn std::error::Error>> {
    let mut svg = String::new();
    drawn(
        &SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(),
        1,
        dots,
        label,
        floor,
    )?;
    let mut png = bitmap::white(SIZE);
    drawn(
        &Bitmap(&mut png).into_drawing_area(),
        bitmap::SCALE,
        dots,
        label,
        floor,
    )?;
    Ok((svg, png))
}

/// Draws on an area that is `scale` times [`SIZE`].
fn drawn<B: DrawingBackend>(
    root: &DrawingArea<B, Shift>,
    scale: u32,
    dots: &[Dot],
    label: &str,
    floor: f64,
) -> Result<(), Box<dyn std::error::Error>>
where
    B::ErrorType: 'static,
{
    let length = 16 * scale as i32;
    root.fill(&WHITE)?;
    let x = around(dots.iter().map(|d| d.x));
    let floor = floor.max(LEAST_ERROR);
    let y = around(dots.iter().map(|d| d.y).chain([floor]));
    let mut chart = ChartBuilder::on(root)
        .margin(12 * scale)
        .x_label_area_size(42 * scale)
        .y_label_area_size(64 * scale)
        .build_cartesian_2d(x.clone().log_scale(), y.log_scale())?;
    chart
        .configure_mesh()
        .x_desc(label)
        .y_desc("relative error (root of relMSE)")
        .light_line_style(RGBColor(245, 245, 245))
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| format!("{} %", short(100.0 * v)))
        .draw()?;
    let line = [(x.start, floor), (x.end, floor)];
    chart
        .draw_series(LineSeries::new(line, RGBColor(150, 150, 150).stroke_width(scale)))?
        .label("reference's own error")
        .legend(|(x, y)| PathElement::new([(x, y), (x + length, y)], RGBColor(150, 150, 150)));
    let mut names: Vec<&str> = dots.iter().map(|d| d.integrator).collect();
    names.sort_unstable();
    names.dedup();
    for name in names {
        let own = || dots.iter().filter(|d| d.integrator == name);
        let color = color(name);
        chart
            .draw_series(own().map(|d| Circle::new((d.x, d.y), 4 * scale, color.stroke_width(scale))))?
            .label(name)
            .legend(move |(x, y)| Circle::new((x + length / 2, y), 4 * scale, color.filled()));
        chart.draw_series(
            own()
                .filter(|d| d.front)
                .map(|d| Circle::new((d.x, d.y), 4 * scale, color.filled())),
        )?;
        if name == "path" {
            let mut curve: Vec<(f64, f64)> = own().map(|d| (d.x, d.y)).collect();
            curve.sort_by(|a, b| a.0.total_cmp(&b.0));
            chart.draw_series(LineSeries::new(curve, color.stroke_width(scale)))?;
        }
    }
    chart
        .configure_series_labels()
        .legend_area_size(30 * scale)
        .label_font(("sans-serif", 13 * scale))
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    root.present()?;
    Ok(())
}

/// At most three digits.
fn short(value: f64) -> String {
    if value >= 100.0 {
        format!("{value:.0}")
    } else if value >= 1.0 {
        format!("{}", (value * 10.0).round() / 10.0)
    } else {
        format!("{}", (value * 1000.0).round() / 1000.0)
    }
}
