//! What a seed's scene holds, decided before anything is built, and said in one line.

use super::dice::Dice;
use glam::{DVec3, dvec3};

/// How walls are made.
#[derive(Clone, Copy, PartialEq)]
pub enum Walls {
    /// One sheet that faces the room.
    Single,
    /// One sheet that faces away from it.
    Outward,
    /// Two sheets of different materials in one plane, back to back.
    Coincident,
    /// An inner and an outer sheet apart.
    TwoSheets,
    /// Boxes that meet or overlap.
    Slabs,
}

/// What lies around the place, in multiples of its size.
#[derive(Clone, Copy, PartialEq)]
pub enum Far {
    /// A plane under it.
    Ground(f64),
    /// A sphere around it.
    Dome(f64),
    /// A triangle far away.
    Stray(f64),
}

/// What shines from the sky.
#[derive(Clone, Copy, PartialEq)]
pub enum Sky {
    /// Nothing.
    Nothing,
    /// The sun and a clear sky, which only a sequence can have.
    Day,
    /// A directional light of the file.
    Sun,
    /// The dome is emissive.
    Dome,
}

/// Lamps of one kind, and their share of the light.
#[derive(Clone, Copy, PartialEq)]
pub enum Lamp {
    /// Emissive spheres.
    Bulbs(usize),
    /// Emissive tubes.
    Tubes(usize),
    /// Emissive rectangles with a texture of few bright patches.
    Screens(usize),
    /// Emissive rectangles that shine downwards.
    Panels(usize),
    /// Point lights of the file.
    Points(usize),
    /// Spots of the file.
    Spots(usize),
}

/// Where the scene stands in its file's coordinates.
#[derive(Clone, Copy)]
pub struct Frame {
    /// Name of the vertices' unit.
    pub name: &'static str,
    /// Units of the vertices per metre.
    pub factor: f64,
    /// Scale of the root node.
    pub root: f64,
    /// Turn of the root node about +Y, degrees.
    pub yaw: f64,
    /// Translation of the root node, metres.
    pub offset: DVec3,
}

impl Frame {
    /// Units of the world per metre.
    pub fn unit(&self) -> f64 {
        self.factor * self.root
    }
}

/// What a scene holds.
pub struct Plan {
    /// Houses on a ground under the sky instead of a room.
    pub yard: bool,
    /// Half the width, the height, half the depth, metres.
    pub half: DVec3,
    /// Walls of the room or of the houses.
    pub walls: Walls,
    /// Distance between two sheets, thickness of slabs, metres.
    pub thickness: f64,
    /// Windows of the room.
    pub windows: usize,
    /// A wall with a door opening across the room.
    pub partition: bool,
    /// Around the place; a yard always has a ground besides.
    pub far: Vec<Far>,
    /// In the sky.
    pub sky: Sky,
    /// Lamps.
    pub lamps: Vec<Lamp>,
    /// Pieces of furniture; houses in a yard.
    pub furniture: usize,
    /// Columns.
    pub columns: usize,
    /// Curtains; awnings in a yard.
    pub curtains: usize,
    /// Plants and trees.
    pub plants: usize,
    /// Leaves of each.
    pub leaves: usize,
    /// Small things.
    pub clutter: usize,
    /// Some surfaces are glossy.
    pub glossy: bool,
    /// Some have textures.
    pub textured: bool,
    /// Cameras in the file.
    pub cameras: usize,
    /// Coordinates.
    pub frame: Frame,
}

/// Units: name, vertices' units per metre, scale of the root node.
const UNITS: [(&str, f64, f64); 8] = [
    ("m", 1.0, 1.0),
    ("m", 1.0, 1.0),
    ("m", 1.0, 1.0),
    ("cm", 100.0, 1.0),
    ("cm under a root of 0.01", 100.0, 0.01),
    ("mm", 1000.0, 1.0),
    ("inch", 39.3701, 1.0),
    ("km", 0.001, 1.0),
];
/// Extents of what is far, in multiples of the place.
const FAR: [f64; 2] = [10.0, 1e5];

impl Plan {
    /// What a seed decides.
    pub fn new(seed: u64) -> Plan {
        let mut dice = Dice::new(seed, "plan");
        let yard = dice.chance(0.35);
        let half = if yard {
            dvec3(dice.between(6.0, 15.0), 4.0, dice.between(6.0, 15.0))
        } else {
            dvec3(
                dice.between(1.5, 4.5),
                dice.between(2.3, 4.5),
                dice.between(1.5, 4.5),
            )
        };
        let walls = dice.one_of(&[
            Walls::Single,
            Walls::Outward,
            Walls::Coincident,
            Walls::TwoSheets,
            Walls::Slabs,
        ]);
        let far = far(&mut Dice::new(seed, "far"), yard);
        let has_dome = far.iter().any(|f| matches!(f, Far::Dome(_)));
        let sky = sky(&mut Dice::new(seed, "sky"), yard, has_dome);
        let windows = match sky {
            Sky::Nothing if dice.chance(0.7) => 0,
            _ => dice.count(1, 3),
        };
        let mut things = Dice::new(seed, "things");
        let mut some = |share: f64, most: usize| match things.chance(share) {
            true => things.count(1, most),
            false => 0,
        };
        Plan {
            yard,
            half,
            walls,
            thickness: dice.between(0.05, 0.3),
            windows: if yard { 0 } else { windows },
            partition: !yard && half.x > 2.5 && dice.chance(0.3),
            far,
            sky,
            lamps: lamps(&mut Dice::new(seed, "lamps"), sky),
            furniture: some(0.85, 8),
            columns: some(0.3, 6),
            curtains: some(0.35, 3),
            plants: some(0.4, 4),
            leaves: 40 + some(1.0, 560),
            clutter: 20 * some(0.6, 15),
            glossy: some(0.35, 1) > 0,
            textured: some(0.5, 1) > 0,
            cameras: dice.one_of(&[0, 0, 1, 1, 3]),
            frame: frame(&mut Dice::new(seed, "frame")),
        }
    }
}

fn far(dice: &mut Dice, yard: bool) -> Vec<Far> {
    let extent = dice.log_between(FAR[0], FAR[1]);
    let stray = Far::Stray(dice.log_between(FAR[0], FAR[1]));
    let mut far = vec![];
    match dice.uniform() {
        _ if yard => far.push(Far::Ground(extent)),
        u if u < 0.2 => far.push(Far::Ground(extent)),
        u if u < 0.35 => far.push(Far::Dome(extent)),
        _ => {}
    }
    if yard && dice.chance(0.2) {
        far.push(Far::Dome(dice.log_between(FAR[0], FAR[1])));
    }
    if dice.chance(0.15) {
        far.push(stray);
    }
    far
}

fn sky(dice: &mut Dice, yard: bool, has_dome: bool) -> Sky {
    match dice.uniform() {
        u if has_dome => [Sky::Dome, Sky::Nothing][usize::from(u > 0.5)],
        u if u < if yard { 0.55 } else { 0.25 } => Sky::Day,
        u if u < if yard { 0.75 } else { 0.35 } => Sky::Sun,
        _ => Sky::Nothing,
    }
}

fn lamps(dice: &mut Dice, sky: Sky) -> Vec<Lamp> {
    let number = match sky {
        Sky::Nothing => dice.count(1, 3),
        _ => usize::from(dice.chance(0.4)),
    };
    let mut lamps: Vec<Lamp> = vec![];
    while lamps.len() < number {
        let count = dice.count(1, 48);
        let lamp = match dice.uniform() {
            u if u < 0.35 => Lamp::Bulbs(count),
            u if u < 0.5 => Lamp::Tubes(count.div_ceil(4)),
            u if u < 0.65 => Lamp::Screens(count.div_ceil(24)),
            u if u < 0.8 => Lamp::Panels(count.div_ceil(12)),
            // Lights of the file don't shine beside those of a sequence.
            _ if sky == Sky::Day => continue,
            u if u < 0.9 => Lamp::Points(count.div_ceil(6)),
            _ => Lamp::Spots(count.div_ceil(8)),
        };
        let same = std::mem::discriminant(&lamp);
        if lamps.iter().all(|other| std::mem::discriminant(other) != same) {
            lamps.push(lamp);
        }
    }
    lamps
}

fn frame(dice: &mut Dice) -> Frame {
    let (name, factor, root) = dice.one_of(&UNITS);
    let far = match dice.chance(0.35) {
        true => dice.log_between(100.0, 6.4e6),
        false => 0.0,
    };
    let direction = dice.direction();
    let yaw = match dice.chance(0.3) {
        true => dice.between(0.0, 360.0).round(),
        false => 0.0,
    };
    Frame {
        name,
        factor,
        root,
        yaw,
        offset: (direction * far).round(),
    }
}
