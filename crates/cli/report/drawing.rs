//! What a plot is drawn of, as SVG and as pixels: lines, dots and letters, each in a group with a class by which a page colours it.

use super::bitmap::{self, Bitmap};
use super::shape::{Color, Shape};
use relight_scene::image::Image8;
use std::fmt::Write;

/// Shapes of one colour.
pub struct Group {
    /// By which a page colours it.
    pub class: String,
    /// Its colour where no page does.
    pub color: Color,
    /// What it stands for, where somebody may ask: it can be pointed at and reached by keyboard then.
    pub tip: Option<String>,
    /// What is drawn.
    pub shapes: Vec<Shape>,
}

/// A drawing.
pub struct Drawing {
    /// Units across and down.
    pub size: [f64; 2],
    /// What it says to who cannot see it.
    pub says: String,
    /// From the back to the front.
    pub groups: Vec<Group>,
}

/// Size of letters.
const LETTERS: f64 = 13.0;

/// Text as it stands in a page.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

impl Drawing {
    /// As SVG.
    pub fn svg(&self) -> String {
        let [width, height] = self.size;
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"group\" aria-label=\"{}\" \
             font-family=\"system-ui, sans-serif\" font-size=\"{LETTERS}\">\n\
             <rect class=\"paper\" width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n",
            escaped(&self.says)
        );
        // Writing to a String cannot fail.
        for group in &self.groups {
            let [r, g, b] = group.color;
            let color = format!("#{r:02x}{g:02x}{b:02x}");
            let _ = write!(
                out,
                "<g class=\"{}\" stroke=\"{color}\" fill=\"{color}\"",
                group.class
            );
            match &group.tip {
                Some(tip) => {
                    let tip = escaped(tip);
                    let _ = write!(
                        out,
                        " tabindex=\"0\" role=\"img\" aria-label=\"{tip}\" data-tip=\"{tip}\"><title>{tip}</title>"
                    );
                }
                None => out += ">",
            }
            group.shapes.iter().for_each(|shape| write(shape, &mut out));
            out += "</g>\n";
        }
        out += "</svg>\n";
        out
    }

    /// As pixels.
    pub fn png(&self) -> Image8 {
        let scale = f64::from(bitmap::SCALE);
        let mut image = bitmap::white(self.size.map(|s| s as u32).into());
        let mut pixels = Bitmap(&mut image);
        for group in &self.groups {
            for shape in &group.shapes {
                match shape {
                    Shape::Line { from, to, width } => pixels.line(
                        from.map(|v| v * scale),
                        to.map(|v| v * scale),
                        width * scale,
                        group.color,
                    ),
                    Shape::Dot { at, radius, filled } => {
                        pixels.dot(at.map(|v| v * scale), radius * scale, *filled, group.color);
                    }
                    Shape::Text {
                        at,
                        text,
                        anchor,
                        upwards,
                    } => pixels.text(at.map(|v| v * scale), text, *anchor, *upwards, group.color),
                }
            }
        }
        image
    }
}

fn write(shape: &Shape, out: &mut String) {
    let _ = match shape {
        Shape::Line { from, to, width } => write!(
            out,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke-width=\"{width}\"/>",
            from[0], from[1], to[0], to[1]
        ),
        Shape::Dot { at, radius, filled } => write!(
            out,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" stroke-width=\"1.5\"{}/>",
            at[0],
            at[1],
            if *filled {
                ""
            } else {
                " fill=\"none\" pointer-events=\"all\""
            }
        ),
        Shape::Text {
            at,
            text,
            anchor,
            upwards,
        } => {
            let turn = match upwards {
                true => format!(" transform=\"rotate(-90 {:.1} {:.1})\"", at[0], at[1]),
                false => String::new(),
            };
            write!(
                out,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{}\" stroke=\"none\"{turn}>{}</text>",
                at[0],
                at[1],
                anchor.name(),
                escaped(text)
            )
        }
    };
}
