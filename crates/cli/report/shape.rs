//! Lines, dots and letters of a plot.

/// A colour of the light theme: what a drawing has by itself, without a page around it.
pub type Color = [u8; 3];

/// Where a text stands of its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

impl Anchor {
    /// As SVG calls it.
    pub fn name(self) -> &'static str {
        match self {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        }
    }
}

/// A part of a drawing; places in units of it, y downwards.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A line of some width.
    Line {
        /// Where it begins.
        from: [f64; 2],
        /// Where it ends.
        to: [f64; 2],
        /// Its width.
        width: f64,
    },
    /// A circle.
    Dot {
        /// Its middle.
        at: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Whether it is full or a ring.
        filled: bool,
    },
    /// A line of letters.
    Text {
        /// The place on its base line.
        at: [f64; 2],
        /// What it says.
        text: String,
        /// Where it stands of its place.
        anchor: Anchor,
        /// Whether it reads from bottom to top.
        upwards: bool,
    },
}
