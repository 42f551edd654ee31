//! Error against time, bake time and size, on logarithmic axes: each dot with its number in the table, its spread and, pointed at or
//! reached by keyboard, its words.

use super::drawing::{Drawing, Group};
use super::findings::pareto;
use super::measured::Measured;
use super::reference::Reference;
use super::shape::{Anchor, Color, Shape};
use super::ticks::{label, ticks};
use relight_scene::image::Image8;

/// Units of a plot, and its margins: left, top, right, bottom.
const SIZE: [f64; 2] = [520.0, 380.0];
const MARGIN: [f64; 4] = [72.0, 12.0, 16.0, 50.0];
/// Height of a line of the legend, and about the width of a letter.
const LINE: f64 = 18.0;
const LETTER: f64 = 7.0;
/// Radius of a dot, and of what keeps numbers off it.
const RADIUS: f64 = 4.0;
const ROOM: f64 = 6.0;
/// Width of a digit and height of a number beside a dot: the page draws them 13 units high on narrow screens, and digits are some
/// 0.64 of that wide in the fonts that browsers fall back on.
const DIGIT: f64 = 8.4;
const TALL: f64 = 13.0;
/// Errors below this are drawn here: a logarithm has no zero.
const LEAST_ERROR: f64 = 1e-4;
/// Pixels between two labels of an axis.
const BETWEEN: f64 = 6.0;

/// A plot.
pub struct Plot {
    /// File name without ending.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// The drawing.
    pub svg: String,
    /// The same as pixels.
    pub png: Image8,
}

/// One dot; of each value the least and the most that it may be.
struct Dot<'a> {
    number: usize,
    x: [f64; 3],
    y: [f64; 3],
    front: bool,
    integrator: &'a str,
    says: String,
}

/// Colours of the integrators, alike for most kinds of colour blindness (Okabe and Ito 2008).
fn color(integrator: &str) -> Color {
    match integrator {
        "path" => [0, 0, 0],
        "brute" => [230, 159, 0],
        "auto" => [0, 114, 178],
        "transfer" => [86, 180, 233],
        "cuts" => [0, 158, 115],
        "lightcuts" => [213, 94, 0],
        _ => [204, 121, 167],
    }
}

const INK: Color = [40, 40, 40];
const GRID: Color = [232, 232, 232];
const PALE: Color = [140, 140, 140];

/// Name, title, layer, name of the axis, and what it counts: the value, the least and the most.
type Axis = fn(&Measured) -> Option<[f64; 3]>;
const PLOTS: [(&str, &str, &str, &str, Axis); 4] = [
    (
        "error_time",
        "All light: error against time of a frame",
        "beauty",
        "milliseconds a frame",
        |m| Some(m.ms_range()),
    ),
    (
        "error_time_direct",
        "Direct light alone: error against time of a frame",
        "direct",
        "milliseconds a frame",
        |m| Some(m.ms_range()),
    ),
    (
        "error_bake",
        "All light: error against time of the bake",
        "beauty",
        "seconds of bake",
        |m| m.bake_seconds.filter(|_| m.needs_bake()).map(|s| [s; 3]),
    ),
    (
        "error_bytes",
        "All light: error against size of the asset",
        "beauty",
        "size of the asset, MB",
        |m| m.needs_bake().then(|| [m.asset_bytes() as f64 / 1e6; 3]),
    ),
];

/// All plots of a report; none for what was not measured.
pub fn all(measured: &[Measured], references: &[Reference]) -> Vec<Plot> {
    let front = pareto(measured);
    let mut plots = Vec::new();
    for (name, title, layer, axis, x) in PLOTS {
        let of_layer =
            (measured.iter().zip(&front).enumerate()).filter(|(_, (m, _))| m.setting.layer == layer);
        let dots: Vec<Dot> = of_layer
            .filter_map(|(i, (m, &front))| {
                // Against black, a relative error is infinite: no axis holds it.
                let error = Some(m.error_range()).filter(|e| e.iter().all(|e| e.is_finite()))?;
                let x = x(m).filter(|x| x[1] > 0.0)?;
                Some(Dot {
                    number: i + 1,
                    x,
                    y: error.map(|e| e.max(LEAST_ERROR)),
                    front,
                    integrator: m.setting.integrator,
                    says: format!(
                        "{}. {}: error {}, {} {}{}",
                        i + 1,
                        m.setting.label(),
                        m.error_words(),
                        label(x[0]),
                        axis,
                        if front { "; on the Pareto front" } else { "" }
                    ),
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
        let drawing = drawn(title, axis, &dots, floor.max(LEAST_ERROR));
        plots.push(Plot {
            name,
            title,
            svg: drawing.svg(),
            png: drawing.png(),
        });
    }
    plots
}

/// From values to places along an axis.
struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// Holds all values with room around them.
    fn around(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Scale {
        let low = values.clone().fold(f64::INFINITY, f64::min) / 1.5;
        let high = values.fold(0.0, f64::max) * 1.5;
        Scale { low, high, from, to }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value.max(self.low) / self.low).ln() / (self.high / self.low).ln();
        self.from + (self.to - self.from) * share.min(1.0)
    }
}

fn text(at: [f64; 2], text: impl Into<String>, anchor: Anchor) -> Shape {
    Shape::Text {
        at,
        text: text.into(),
        anchor,
        upwards: false,
    }
}

fn line(from: [f64; 2], to: [f64; 2], width: f64) -> Shape {
    Shape::Line { from, to, width }
}

fn group(class: &str, color: Color, shapes: Vec<Shape>) -> Group {
    Group {
        class: class.into(),
        color,
        tip: None,
        shapes,
    }
}

fn drawn(title: &str, axis: &str, dots: &[Dot], floor: f64) -> Drawing {
    let mut names: Vec<&str> = dots.iter().map(|d| d.integrator).collect();
    names.sort_unstable();
    names.dedup();
    let (legend, height) = legend(&names);
    let [left, top, right, bottom] = MARGIN;
    let (top, base, end) = (top + height, SIZE[1] - bottom, SIZE[0] - right);
    // Bars go to the edge where nothing is known: they would make all else small.
    let x = Scale::around(dots.iter().map(|d| d.x[0]), left, end);
    let y = Scale::around(dots.iter().map(|d| d.y[0]).chain([floor]), base, top);
    let mut groups = axes(&x, &y, axis);
    groups.extend(legend);
    let at_floor = y.at(floor);
    groups.push(group(
        "floor",
        PALE,
        vec![line([left, at_floor], [end, at_floor], 1.5)],
    ));
    let mut path: Vec<[f64; 2]> = (dots.iter().filter(|d| d.integrator == "path"))
        .map(|d| [x.at(d.x[0]), y.at(d.y[0])])
        .collect();
    path.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let steps = path.windows(2).map(|pair| line(pair[0], pair[1], 1.0));
    groups.push(group("of-path", color("path"), steps.collect()));
    groups.extend(dots.iter().map(|dot| {
        let at = [x.at(dot.x[0]), y.at(dot.y[0])];
        let bars = [
            line([x.at(dot.x[1]), at[1]], [x.at(dot.x[2]), at[1]], 1.0),
            line([at[0], y.at(dot.y[1])], [at[0], y.at(dot.y[2])], 1.0),
        ];
        let circle = Shape::Dot {
            at,
            radius: RADIUS,
            filled: dot.front,
        };
        Group {
            class: format!("dot of-{}", dot.integrator),
            color: color(dot.integrator),
            tip: Some(dot.says.clone()),
            shapes: bars.into_iter().chain([circle]).collect(),
        }
    }));
    let places: Vec<[f64; 2]> = dots.iter().map(|d| [x.at(d.x[0]), y.at(d.y[0])]).collect();
    groups.push(group(
        "number",
        INK,
        numbers(dots, &places, [left, top, end, base]),
    ));
    Drawing {
        size: SIZE,
        says: format!(
            "{title}: {} settings; the table below has their numbers",
            dots.len()
        ),
        groups,
    }
}

/// Names of integrators with their colours in lines above a plot, and the height of these.
fn legend(names: &[&str]) -> (Vec<Group>, f64) {
    let mut groups = Vec::new();
    let mut at = [MARGIN[0], MARGIN[1] + 6.0];
    let mut place = |name: &str, class: String, color: Color, shape: fn([f64; 2]) -> Shape| {
        let width = 16.0 + LETTER * name.len() as f64 + 10.0;
        if at[0] + width > SIZE[0] && at[0] > MARGIN[0] {
            at = [MARGIN[0], at[1] + LINE];
        }
        groups.push(group(&class, color, vec![shape(at)]));
        let words = text([at[0] + 13.0, at[1] + 4.5], name, Anchor::Start);
        groups.push(group("ink", INK, vec![words]));
        at[0] += width;
    };
    for name in names {
        place(name, format!("of-{name}"), color(name), |at| Shape::Dot {
            at: [at[0] + 4.0, at[1]],
            radius: RADIUS,
            filled: true,
        });
    }
    place("reference's own error", "floor".into(), PALE, |at| {
        line([at[0] - 3.0, at[1]], [at[0] + 9.0, at[1]], 1.5)
    });
    let height = at[1] + 0.5 * LINE - MARGIN[1];
    (groups, height)
}

/// Grid, ticks, their labels and the names of both axes.
fn axes(x: &Scale, y: &Scale, name: &str) -> Vec<Group> {
    let (mut grid, mut ink) = (Vec::new(), Vec::new());
    let mut free = f64::NEG_INFINITY;
    for value in ticks(x.low, x.high) {
        let at = x.at(value);
        grid.push(line([at, y.to], [at, y.from], 1.0));
        let half = 0.5 * LETTER * label(value).len() as f64;
        if at - half > free && at + half < SIZE[0] {
            ink.push(text([at, y.from + 17.0], label(value), Anchor::Middle));
            free = at + half + BETWEEN;
        }
    }
    let mut free = f64::INFINITY;
    for value in ticks(100.0 * y.low, 100.0 * y.high) {
        let at = y.at(value / 100.0);
        grid.push(line([x.from, at], [x.to, at], 1.0));
        if at + LINE / 2.0 < free {
            let words = format!("{} %", label(value));
            ink.push(text([x.from - 6.0, at + 4.5], words, Anchor::End));
            free = at - LINE / 2.0;
        }
    }
    let middle = 0.5 * (x.from + x.to);
    ink.push(text([middle, SIZE[1] - 10.0], name, Anchor::Middle));
    ink.push(Shape::Text {
        at: [13.0, 0.5 * (y.from + y.to)],
        text: "relative error (root of relMSE)".into(),
        anchor: Anchor::Middle,
        upwards: true,
    });
    let frame = vec![
        line([x.from, y.from], [x.to, y.from], 1.0),
        line([x.from, y.from], [x.from, y.to], 1.0),
    ];
    vec![
        group("grid", GRID, grid),
        group("axis", PALE, frame),
        group("ink", INK, ink),
    ]
}

/// A box: left, top, right, bottom.
type Area = [f64; 4];

fn overlap(a: &Area, b: &Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Numbers beside their dots where there is room, those of the front first.
fn numbers(dots: &[Dot], places: &[[f64; 2]], within: Area) -> Vec<Shape> {
    let around = |at: &[f64; 2]| [at[0] - ROOM, at[1] - ROOM, at[0] + ROOM, at[1] + ROOM];
    let mut taken: Vec<Area> = places.iter().map(around).collect();
    let mut order: Vec<usize> = (0..dots.len()).collect();
    order.sort_by_key(|&i| !dots[i].front);
    let mut shapes = Vec::new();
    for i in order {
        let words = dots[i].number.to_string();
        let (width, height) = (DIGIT * words.len() as f64, TALL);
        let [px, py] = places[i];
        // Middle of the letters: beside, above and below, then askew.
        let far = ROOM + 0.5 * width + 1.0;
        let tried = [
            (far, 0.0),
            (-far, 0.0),
            (0.0, -13.5),
            (0.0, 13.5),
            (far, -10.0),
            (-far, -10.0),
            (far, 10.0),
            (-far, 10.0),
        ];
        let free = tried.into_iter().find_map(|(dx, dy)| {
            let (cx, cy) = (px + dx, py + dy);
            let area = [
                cx - 0.5 * width,
                cy - 0.5 * height,
                cx + 0.5 * width,
                cy + 0.5 * height,
            ];
            let inside =
                area[0] > within[0] && area[1] > within[1] && area[2] < within[2] && area[3] < within[3];
            (inside && !taken.iter().any(|other| overlap(other, &area))).then_some((area, [cx, cy]))
        });
        if let Some((area, [cx, cy])) = free {
            taken.push(area);
            shapes.push(text([cx, cy + 4.5], words, Anchor::Middle));
        }
    }
    shapes
}
