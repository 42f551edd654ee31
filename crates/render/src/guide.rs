//! Where in the cube of its random numbers a light shines from, learned from samples that were cast before.
//!
//! Of a sky behind a window, or a hundred lamps of which walls hide most, nearly all samples are in vain. A light is drawn by
//! three random numbers, and places near one another find the same parts of it by the same numbers. So the first samples of a
//! neighbourhood say which numbers are worth drawing, and those that follow are drawn there.
//!
//! Source: Guo, Bauszat, Bikker and Eisemann 2018, *Primary Sample Space Path Guiding*: a tree of halved cells, each drawn in
//! proportion to the root of the mean square that was found in it, which makes the variance of the estimate least. **Deviations:**
//! the axis of each cut is the one that helps most; and a share of the density is even, so that what the first samples missed stays in
//! the estimate, with bounded weight.

/// Share of the density that is even: a sample counts at most so many times as an even one as one over it.
const EVEN: f64 = 0.5;

/// Least samples in a cell: fewer say too little of its mean square.
const LEAST: usize = 48;

/// A sample that was cast: its random numbers, the density that they were drawn with, and its estimate of the light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lesson {
    pub at: [f32; 3],
    pub density: f32,
    pub light: f32,
}

/// The guides of neighbourhoods.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guides {
    /// For each place its neighbourhood.
    pub of_place: Vec<u32>,
    /// For each neighbourhood what it has learned.
    pub guides: Vec<Option<Guide>>,
}

impl Guides {
    /// The guide of a place, if it has one.
    pub fn of(&self, place: usize) -> Option<&Guide> {
        let neighbourhood = *self.of_place.get(place)?;
        self.guides.get(neighbourhood as usize)?.as_ref()
    }
}

/// A density over the unit cube.
#[derive(Clone, Debug)]
pub(crate) struct Guide {
    /// Depth first: the lower half of a cell follows it.
    cells: Vec<Cell>,
    /// Expected variance of one of its samples.
    pub variance: f64,
}

#[derive(Clone, Copy, Debug)]
enum Cell {
    Whole,
    Halved {
        axis: usize,
        /// Probability of the lower half.
        lower: f32,
        /// Index of the upper half.
        upper: u32,
    },
}

/// What a cell is while the tree grows.
struct Growing {
    volume: f64,
    /// Root of its volume times the sum of squares, summed over the parts.
    weight: f64,
    axis: usize,
    /// 0 for a leaf.
    upper: usize,
}

impl Guide {
    /// `None` where samples gave no light, or nothing is to be gained.
    pub fn learned(lessons: &mut [Lesson]) -> Option<Guide> {
        let count = lessons.len().max(1) as f64;
        let mean = lessons.iter().map(|l| f64::from(l.light)).sum::<f64>() / count;
        let mut growing = Vec::new();
        let total = grow(&mut growing, lessons, Room::ALL);
        let worthwhile = growing.len() > 1 && total > 0.0 && total.is_finite();
        if !worthwhile {
            return None;
        }
        let mass = |cell: &Growing| (1.0 - EVEN) * cell.weight / total + EVEN * cell.volume;
        let (mut even, mut guided) = (0.0, 0.0);
        for cell in growing.iter().filter(|cell| cell.upper == 0) {
            even += cell.weight * cell.weight / cell.volume;
            guided += cell.weight * cell.weight / mass(cell);
        }
        let variance = guided / count - mean * mean;
        let cells = (growing.iter().enumerate()).map(|(i, cell)| match cell.upper {
            0 => Cell::Whole,
            upper => Cell::Halved {
                axis: cell.axis,
                lower: (mass(&growing[i + 1]) / mass(cell)) as f32,
                upper: upper as u32,
            },
        });
        (guided < even).then(|| Guide {
            cells: cells.collect(),
            variance: variance.max(0.0),
        })
    }

    /// The numbers to draw by for three even ones in [0, 1), and their density.
    pub fn at(&self, mut random: [f32; 3]) -> ([f32; 3], f32) {
        let (mut low, mut size, mut density) = ([0.0f32; 3], [1.0f32; 3], 1.0);
        let mut cell = 0;
        while let Cell::Halved { axis, lower, upper } = self.cells[cell] {
            size[axis] *= 0.5;
            // The number is used again: what is left of it is as even as before.
            let left = &mut random[axis];
            let share = if *left < lower {
                *left /= lower;
                cell += 1;
                lower
            } else {
                *left = (*left - lower) / (1.0 - lower);
                low[axis] += size[axis];
                cell = upper as usize;
                1.0 - lower
            };
            *left = left.min(1.0 - f32::EPSILON);
            density *= 2.0 * share;
        }
        let at = [0, 1, 2].map(|axis| low[axis] + size[axis] * random[axis]);
        (at, density)
    }
}

/// A cell of the cube.
#[derive(Clone, Copy)]
struct Room {
    low: [f32; 3],
    size: [f32; 3],
}

impl Room {
    const ALL: Room = Room {
        low: [0.0; 3],
        size: [1.0; 3],
    };

    fn middle(&self, axis: usize) -> f32 {
        self.low[axis] + 0.5 * self.size[axis]
    }

    fn volume(&self) -> f64 {
        self.size.iter().map(|&s| f64::from(s)).product()
    }

    fn halves(mut self, axis: usize) -> [Room; 2] {
        self.size[axis] *= 0.5;
        let mut upper = self;
        upper.low[axis] += self.size[axis];
        [self, upper]
    }
}

/// Appends the cell of some lessons, halved as far as they tell; returns its weight.
fn grow(cells: &mut Vec<Growing>, lessons: &mut [Lesson], room: Room) -> f64 {
    let own = cells.len();
    let squares = lessons.iter().map(square).sum::<f64>();
    cells.push(Growing {
        volume: room.volume(),
        weight: weight(squares, room.volume()),
        axis: 0,
        upper: 0,
    });
    if squares > 0.0
        && let Some(axis) = best_cut(lessons, squares, &room)
    {
        let middle = room.middle(axis);
        let first = partition(lessons, |lesson| lesson.at[axis] < middle);
        let (lower, upper) = lessons.split_at_mut(first);
        let [of_lower, of_upper] = room.halves(axis);
        let mut sum = grow(cells, lower, of_lower);
        let start = cells.len();
        sum += grow(cells, upper, of_upper);
        let cell = &mut cells[own];
        (cell.axis, cell.upper, cell.weight) = (axis, start, sum);
    }
    cells[own].weight
}

/// The axis along which two halves draw best; `None` if there are too few lessons.
fn best_cut(lessons: &[Lesson], squares: f64, room: &Room) -> Option<usize> {
    let half = room.volume() / 2.0;
    let both = |axis: usize| {
        let middle = room.middle(axis);
        let (mut count, mut of_lower) = (0, 0.0);
        for lesson in lessons.iter().filter(|lesson| lesson.at[axis] < middle) {
            count += 1;
            of_lower += square(lesson);
        }
        let other = lessons.len() - count;
        let of_upper = (squares - of_lower).max(0.0);
        (count.min(other) >= LEAST).then(|| (axis, weight(of_lower, half) + weight(of_upper, half)))
    };
    let cuts = (0..3).filter_map(both);
    cuts.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(axis, _)| axis)
}

/// What a lesson adds to the integral of the squared light, but for the number of lessons.
fn square(lesson: &Lesson) -> f64 {
    f64::from(lesson.light) * f64::from(lesson.light) * f64::from(lesson.density)
}

/// Of a cell with the integral of squares: what it is drawn in proportion to.
fn weight(squares: f64, volume: f64) -> f64 {
    (volume * squares).sqrt()
}

/// Brings those to the front that are `first`; returns how many these are.
fn partition(lessons: &mut [Lesson], first: impl Fn(&Lesson) -> bool) -> usize {
    let mut count = 0;
    for i in 0..lessons.len() {
        if first(&lessons[i]) {
            lessons.swap(i, count);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;

    /// Light from a corner of the cube that a hundredth of all numbers find.
    fn light(at: [f32; 3]) -> f32 {
        if at[0] > 0.75 && (0.3..0.6).contains(&at[1]) && at[2] < 0.15 {
            1.0 + at[2]
        } else {
            0.0
        }
    }

    fn lesson(at: [f32; 3]) -> Lesson {
        Lesson {
            at,
            density: 1.0,
            light: light(at),
        }
    }

    fn random(s: &mut Stream) -> [f32; 3] {
        [s.uniform(), s.uniform(), s.uniform()]
    }

    /// Truth: the integral of `light`. Tolerance of the mean: four standard errors; the variance is a tenth of that of even
    /// samples, and what was expected of it within a half.
    #[test]
    fn what_is_drawn_by_a_guide_has_the_same_mean_and_a_tenth_of_the_variance() {
        let truth = 0.25 * 0.3 * 0.15 * (1.0 + 0.075);
        for seed in 0..4 {
            let mut s = Stream::new(seed, 0, 0);
            let mut lessons: Vec<Lesson> = (0..8192)
                .map(|_| {
                    let at = random(&mut s);
                    lesson(at)
                })
                .collect();
            let guide = Guide::learned(&mut lessons).unwrap();
            let (mut even, mut guided, mut squares, count) = (0.0, 0.0, 0.0, 40_000);
            for _ in 0..count {
                even += f64::from(light(random(&mut s))).powi(2);
                let (at, density) = guide.at(random(&mut s));
                let value = f64::from(light(at) / density);
                guided += value;
                squares += value * value;
            }
            let count = f64::from(count);
            let (mean, variance) = (guided / count, squares / count - truth * truth);
            let error = (variance / count).sqrt();
            assert!((mean - truth).abs() < 4.0 * error, "{mean} {truth} ± {error}");
            let left = variance / (even / count - truth * truth);
            assert!(left < 0.1, "{left}");
            assert!(
                (guide.variance / variance).ln().abs() < 0.4,
                "{} {variance}",
                guide.variance
            );
        }
    }

    /// What no lesson met is drawn half as often as by even numbers, at least.
    #[test]
    fn nothing_is_drawn_less_than_half_as_often() {
        let mut s = Stream::new(1, 0, 0);
        let mut lessons: Vec<Lesson> = (0..4096)
            .map(|_| {
                let at = random(&mut s);
                lesson(at)
            })
            .collect();
        let guide = Guide::learned(&mut lessons).unwrap();
        let least = (0..40_000)
            .map(|_| guide.at(random(&mut s)).1)
            .fold(f32::INFINITY, f32::min);
        assert!((0.499..0.75).contains(&least), "{least}");
        lessons.iter_mut().for_each(|lesson| lesson.light = 0.0);
        assert!(
            Guide::learned(&mut lessons).is_none(),
            "nothing is known of no light"
        );
    }
}
