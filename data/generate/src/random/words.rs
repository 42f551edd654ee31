//! What a scene holds, in one line of words.

use super::plan::{Far, Lamp, Plan, Sky, Walls};

/// Phrases, from the place to the coordinates; each has the word by which tests find the kind.
pub fn phrases(plan: &Plan) -> Vec<String> {
    let counted = |n: usize, one: &str, many: &str| match n {
        0 => vec![],
        1 => vec![format!("1 {one}")],
        n => vec![format!("{n} {many}")],
    };
    let when = |holds: bool, words: &str| if holds { vec![words.to_owned()] } else { vec![] };
    let [w, h, d] = [2.0 * plan.half.x, plan.half.y, 2.0 * plan.half.z];
    let place = match plan.yard {
        true => format!("yard {w:.0}×{d:.0} m"),
        false => format!("interior {w:.1}×{h:.1}×{d:.1} m"),
    };
    let (houses, furniture) = match plan.yard {
        true => (1 + plan.furniture.div_ceil(2), 0),
        false => (0, plan.furniture),
    };
    let metres = plan.frame.offset.length();
    [
        vec![place, walls(plan.walls).to_owned()],
        counted(houses, "house", "houses"),
        counted(plan.windows, "window", "windows"),
        when(plan.partition, "partition"),
        plan.far.iter().map(far).collect(),
        when(plan.sky != Sky::Nothing, sky(plan.sky)),
        plan.lamps.iter().map(lamp).collect(),
        counted(furniture, "piece of furniture", "pieces of furniture"),
        counted(plan.columns, "column", "columns"),
        counted(plan.curtains, "curtain", "curtains"),
        match plan.plants {
            0 => vec![],
            n => vec![format!("{} leaves", n * plan.leaves)],
        },
        match plan.clutter {
            0 => vec![],
            n => vec![format!("clutter of {n}")],
        },
        when(plan.glossy, "gloss"),
        when(plan.textured, "textures"),
        vec![format!("unit {}", plan.frame.name)],
        when(plan.frame.yaw != 0.0, "turned"),
        match metres {
            0.0 => vec![],
            m => vec![format!("offset {m:.0e} m")],
        },
        vec![match plan.cameras {
            0 => "no camera".to_owned(),
            1 => "1 camera".to_owned(),
            n => format!("{n} cameras"),
        }],
    ]
    .concat()
}

fn walls(walls: Walls) -> &'static str {
    match walls {
        Walls::Single => "single-sheet walls",
        Walls::Outward => "walls facing outwards",
        Walls::Coincident => "walls of two coincident sheets",
        Walls::TwoSheets => "two-sheet walls",
        Walls::Slabs => "walls of boxes",
    }
}

fn far(far: &Far) -> String {
    match far {
        Far::Ground(x) => format!("ground ×{x:.0}"),
        Far::Dome(x) => format!("dome ×{x:.0}"),
        Far::Stray(x) => format!("stray triangle ×{x:.0}"),
    }
}

fn sky(sky: Sky) -> &'static str {
    match sky {
        Sky::Nothing => "",
        Sky::Day => "sun and sky",
        Sky::Sun => "sun alone",
        Sky::Dome => "glowing dome",
    }
}

fn lamp(lamp: &Lamp) -> String {
    let (n, name) = match *lamp {
        Lamp::Bulbs(n) => (n, "bulb"),
        Lamp::Tubes(n) => (n, "tube"),
        Lamp::Screens(n) => (n, "screen"),
        Lamp::Panels(n) => (n, "panel"),
        Lamp::Points(n) => (n, "point light"),
        Lamp::Spots(n) => (n, "spot"),
    };
    format!("{n} {name}{}", if n == 1 { "" } else { "s" })
}
