//! Lamps at the pilots, by which links are chosen and to which they are fitted.

use glam::Vec3;
use rayon::prelude::*;
use relight_transport::kernel::width;
use relight_transport::senders::Signed;

/// How many times as much power as the middle one of all lamps one may have for the points to get a mean of 1 from it. A lamp far out on a ground
/// lights a single wide point among ten thousand: with all of the mean there, and errors counted by it, rows that do not even see that
/// point would have no other care. Lamps in a cupboard or in the next room, which light a fiftieth of what others do, keep their say.
const MOST_POWER: f64 = 64.0;

/// Lamps and what they may light.
#[derive(Clone, Copy, Debug)]
pub struct Lamps<'a> {
    /// Where they are.
    pub pilots: &'a [Vec3],
    /// The finest points.
    pub places: &'a [Signed],
    /// Distance of the coarsest points that are not wider than others, metres.
    pub coarse: f32,
    /// The same of the finest points.
    pub finest: f32,
    /// How near a lamp comes to a surface, in distances of the coarsest points or, where points are farther apart, in theirs: nearer,
    /// one point beside a lamp would be all that its light shows.
    pub softness: f32,
}

impl Lamps<'_> {
    /// Irradiance of point `p` from lamp `k`, up to a factor.
    pub fn light(&self, k: usize, p: usize) -> f32 {
        let place = &self.places[p];
        if place.signature >> k & 1 == 0 {
            return 0.0;
        }
        let way = self.pilots[k] - place.position;
        let squared = way.length_squared();
        let cosine = way.dot(place.normal).max(0.0) / squared.sqrt().max(f32::MIN_POSITIVE);
        let softness = self.softness * self.coarse.max(self.finest * width(place.widening));
        cosine / (squared + softness * softness).max(f32::MIN_POSITIVE)
    }

    /// Mean over the points of each lamp's light.
    pub fn means(&self) -> Vec<f64> {
        let points = 0..self.places.len();
        let mean = |k| {
            let sum: f64 = points.clone().map(|p| f64::from(self.light(k, p))).sum();
            sum / points.len().max(1) as f64
        };
        (0..self.pilots.len()).into_par_iter().map(mean).collect()
    }
}

/// What lights are multiplied by at most, given the means of lights of one power: of those that light something.
pub fn most_power(means: &[f64]) -> f64 {
    let mut lit: Vec<f64> = means.iter().copied().filter(|&mean| mean > 0.0).collect();
    lit.sort_unstable_by(f64::total_cmp);
    (lit.get(lit.len() / 2)).map_or(0.0, |middle| MOST_POWER / middle)
}

/// What a light with this mean is multiplied by: for a mean of 1, or by `most`.
pub fn power(mean: f64, most: f64) -> f64 {
    if mean > 0.0 { (1.0 / mean).min(most) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use relight_transport::random::Stream;
    use relight_transport::senders::PILOTS;

    /// A floor of 4 × 4 m with a point every 25 cm and lamps above it, and 1 km away a single point, as wide as that is far, with a lamp
    /// of its own, 20 cm above it.
    fn floor_and_far_point() -> (Vec<Signed>, Vec<Vec3>) {
        let mut s = Stream::new(5, 0, 0);
        let of_floor = (1 << (PILOTS - 1)) - 1;
        let at = |i: i32| 0.25 * i as f32 - 2.0;
        let floor = (0..256).map(|i| (Vec3::new(at(i % 16), 0.0, at(i / 16)), 0, of_floor));
        let far = Vec3::X * 1000.0;
        let places = floor.chain([(far, 12, 1 << (PILOTS - 1))]);
        let signed = |(position, widening, signature)| Signed {
            position,
            normal: Vec3::Y,
            widening,
            signature,
        };
        let above = |_| {
            Vec3::new(
                4.0 * s.uniform() - 2.0,
                0.2 + 2.0 * s.uniform(),
                4.0 * s.uniform() - 2.0,
            )
        };
        let lamps = (1..PILOTS).map(above).chain([far + Vec3::Y * 0.2]);
        (places.map(signed).collect(), lamps.collect())
    }

    /// Truth: a lamp lights what its flux falls on. Of one point among 257 the share of all light would be all of it.
    #[test]
    fn a_lamp_beside_a_far_wide_point_has_little_to_say_and_all_others_a_mean_of_one() {
        let (places, pilots) = floor_and_far_point();
        let lamps = Lamps {
            pilots: &pilots,
            places: &places,
            coarse: 0.5,
            finest: 0.25,
            softness: 0.5,
        };
        let means = lamps.means();
        let most = most_power(&means);
        let (far, floor) = means.split_last().unwrap();
        for &mean in floor {
            assert!((mean * power(mean, most) - 1.0).abs() < 1e-9, "{mean}");
        }
        // A disk of 1 km has a millionth of the irradiance of one of 1 m.
        assert!(far * power(*far, most) < 1e-4, "{far}");
        assert_eq!(power(0.0, most), 0.0);
    }

    #[test]
    fn lights_of_a_fiftieth_of_the_middle_ones_are_as_bright_as_others_and_darker_ones_less() {
        let means = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0 / 50.0, 1.0 / 128.0, 0.0];
        let most = most_power(&means);
        let mean = |i: usize| means[i] * power(means[i], most);
        assert_eq!([0, 1, 5, 6].map(mean), [0.0, 1.0, 1.0, 0.5]);
        assert_eq!(most_power(&[0.0]), 0.0);
    }
}
