//! Which of many lights a place sees, from rays to some of them.
//!
//! A node of 64 lights, neighbours in their tree, gets 8 rays, spread over its parts. If all end alike, so do those
//! that were not cast; otherwise its halves get 8 rays each, those that were cast included, and so on down to single
//! lights. Edges of shadows so are found ray by ray, and what lies in the middle of light or shadow costs an eighth.
//! What is lost are occluders that fall between 8 rays (docs/notebook/cuts.md has the figures). How much an unoccluded light
//! counts for is known without rays.

/// A place that looks at lights.
pub trait Sight {
    /// What an unoccluded light counts for; NaN for what lies below the place's horizon and counts for nothing.
    fn factor(&self, light: usize) -> f32;

    /// Whether each of `lights` is occluded; all have a factor above 0.
    fn occluded(&mut self, lights: &[u32], dark: &mut [bool]);
}

/// Height of the nodes that are looked at first: 64 neighbouring lights.
pub const FIRST_HEIGHT: u8 = 6;
/// Lights that get a ray in every node that is looked at: one in each of its 8 parts.
const RAYS_HEIGHT: u8 = 3;

/// Looks from one place after the other.
#[derive(Debug)]
pub struct Sampler {
    /// Per light: 1 for visible, 0 for occluded, times its factor once all are known; NaN for what lies below the
    /// horizon.
    seen: Vec<f32>,
    /// Per light what it counts for unoccluded.
    factors: Vec<f32>,
    targets: Vec<u32>,
    occluded: Vec<bool>,
    /// Nodes of the present height that are still open, and those of the next.
    open: Vec<u32>,
    next: Vec<u32>,
}

/// In `seen`: above the horizon, not known yet.
const UNKNOWN: f32 = -1.0;
/// In `seen`: above the horizon, but facing away.
const AWAY: f32 = -2.0;

impl Sampler {
    /// For `lights` in the order of their tree's leaves, a power of two and at least 64 of them.
    pub fn new(lights: usize) -> Sampler {
        Sampler {
            seen: vec![0.0; lights],
            factors: vec![0.0; lights],
            targets: Vec::new(),
            occluded: Vec::new(),
            open: Vec::new(),
            next: Vec::new(),
        }
    }

    /// What the last place saw of each light: its factor or 0; NaN for what lies below the horizon.
    pub fn seen(&self) -> &[f32] {
        &self.seen
    }

    /// Looks from a place at all lights; returns the number of rays cast.
    pub fn sample(&mut self, sight: &mut impl Sight) -> u64 {
        self.sample_in(0..(self.seen.len() >> FIRST_HEIGHT) as u32, sight)
    }

    /// Looks from a place at the lights in some nodes of height [`FIRST_HEIGHT`]; what was seen of others stays. Returns the
    /// number of rays cast.
    pub fn sample_in(&mut self, nodes: impl Iterator<Item = u32> + Clone, sight: &mut impl Sight) -> u64 {
        let lights = |node: u32| {
            let start = (node as usize) << FIRST_HEIGHT;
            start..start + (1 << FIRST_HEIGHT)
        };
        for light in nodes.clone().flat_map(lights) {
            let factor = sight.factor(light);
            self.factors[light] = factor;
            self.seen[light] = match factor {
                f if f > 0.0 => UNKNOWN,
                0.0 => AWAY,
                _ => f32::NAN,
            };
        }
        let mut cast = 0;
        self.open.clear();
        self.open.extend(nodes.clone());
        for height in (RAYS_HEIGHT..=FIRST_HEIGHT).rev() {
            self.aim(height);
            cast += self.cast(sight);
            self.next.clear();
            for i in 0..self.open.len() {
                self.settle(self.open[i], height);
            }
            std::mem::swap(&mut self.open, &mut self.next);
        }
        for light in nodes.flat_map(lights) {
            let seen = &mut self.seen[light];
            *seen = if *seen == AWAY {
                0.0
            } else {
                *seen * self.factors[light]
            };
        }
        cast
    }

    /// Mean of what is seen of the lights above the horizon.
    pub fn mean_seen(&self) -> f32 {
        let (mut above, mut seen) = (0.0, 0.0);
        for light in self.seen.iter().filter(|s| !s.is_nan()) {
            above += 1.0;
            seen += light;
        }
        if above > 0.0 { seen / above } else { 0.0 }
    }

    /// Chooses a light that gets a ray in each part of the open nodes that has none yet.
    fn aim(&mut self, height: u8) {
        let part = 1usize << (height - RAYS_HEIGHT);
        self.targets.clear();
        for &node in &self.open {
            let start = (node as usize) << height;
            for first in (start..start + (1 << height)).step_by(part) {
                let lights = &self.seen[first..first + part];
                if lights.iter().any(|&s| s >= 0.0) {
                    continue;
                }
                // The first above the horizon from some place within the part on, not the same in every part.
                let turn = first.wrapping_mul(0x9e37_79b1) >> 7;
                let above = (0..part)
                    .map(|k| (turn + k) % part)
                    .find(|&k| lights[k] == UNKNOWN);
                if let Some(k) = above {
                    self.targets.push((first + k) as u32);
                }
            }
        }
    }

    fn cast(&mut self, sight: &mut impl Sight) -> u64 {
        self.occluded.clear();
        self.occluded.resize(self.targets.len(), false);
        sight.occluded(&self.targets, &mut self.occluded);
        for (&light, &dark) in self.targets.iter().zip(&self.occluded) {
            self.seen[light as usize] = if dark { 0.0 } else { 1.0 };
        }
        self.targets.len() as u64
    }

    /// Fills a node whose rays agree, or puts its halves on the list.
    fn settle(&mut self, node: u32, height: u8) {
        let start = (node as usize) << height;
        let lights = &mut self.seen[start..start + (1 << height)];
        let mut known = lights.iter().copied().filter(|&s| s >= 0.0);
        let Some(first) = known.next() else {
            return; // wholly below the horizon, or facing away
        };
        if known.all(|s| s == first) {
            lights
                .iter_mut()
                .filter(|s| **s == UNKNOWN)
                .for_each(|s| *s = first);
        } else if height > RAYS_HEIGHT {
            self.next.extend([2 * node, 2 * node + 1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHTS: usize = 1024;

    /// A place that sees the lights from `edge` on, but for every tenth, which faces away, and the first hundred, which are
    /// below its horizon.
    struct Half {
        edge: u32,
        asked: Vec<u32>,
    }

    impl Sight for Half {
        fn factor(&self, light: usize) -> f32 {
            match light {
                ..100 => f32::NAN,
                _ if light.is_multiple_of(10) => 0.0,
                _ => light as f32,
            }
        }

        fn occluded(&mut self, lights: &[u32], dark: &mut [bool]) {
            self.asked.extend(lights);
            for (dark, light) in dark.iter_mut().zip(lights) {
                *dark = *light < self.edge;
            }
        }
    }

    fn half(edge: u32) -> Half {
        let asked = Vec::new();
        Half { edge, asked }
    }

    fn truth(edge: u32) -> impl Fn(usize) -> f32 {
        move |light| {
            let factor = half(edge).factor(light);
            if light < edge as usize && factor > 0.0 {
                0.0
            } else {
                factor
            }
        }
    }

    fn alike(a: f32, b: f32) -> bool {
        a == b || (a.is_nan() && b.is_nan())
    }

    #[test]
    fn an_edge_is_found_to_the_light_by_a_fraction_of_the_rays() {
        for edge in [0, 137, 640, 999, 1024] {
            let mut sampler = Sampler::new(LIGHTS);
            let mut sight = half(edge);
            let rays = sampler.sample(&mut sight);
            assert!((0..LIGHTS).all(|light| alike(sampler.seen()[light], truth(edge)(light))));
            assert_eq!(rays as usize, sight.asked.len());
            // 8 of 64 in 15 nodes that are above the horizon, and up to 8 more in each of three halvings of one.
            assert!(rays <= 15 * 8 + 3 * 8, "{rays}");
        }
    }

    #[test]
    fn nodes_that_are_not_asked_for_keep_what_was_seen_of_them() {
        let mut sampler = Sampler::new(LIGHTS);
        sampler.sample(&mut half(640));
        let mut sight = half(0);
        sampler.sample_in([4, 9].into_iter(), &mut sight);
        assert!(
            sight
                .asked
                .iter()
                .all(|light| [4, 9].contains(&(light >> FIRST_HEIGHT)))
        );
        for light in 0..LIGHTS {
            let edge = if [4, 9].contains(&(light >> FIRST_HEIGHT)) {
                0
            } else {
                640
            };
            assert!(alike(sampler.seen()[light], truth(edge)(light)), "{light}");
        }
    }
}
