//! Whence a lamp's light comes at one place, and what a glossy surface there sends of it.

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relight_render::irradiance::{Arrivals, Incident};
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use std::f32::consts::PI;

/// Length of the mean of unit directions from which on lobes tell them hardly from one: they are spread by 0.1 then (√(1 − CLOSE), along either axis),
/// and by half of that the half vectors.
const CLOSE: f64 = 0.99;

/// A lamp's light at one place.
#[derive(Clone, Debug)]
pub(crate) struct Lit {
    /// Direction by direction.
    from: Vec<Incident>,
    /// Whether that is as if nothing were in the way.
    is_unoccluded: bool,
    /// Twice the variance by which half vectors differ, along either axis, within what one of the directions stands for: it is to be added to α².
    spread: f32,
}

impl Lit {
    /// Place by place; `None` where none arrives anywhere.
    pub fn of(arrivals: &Arrivals) -> Option<Vec<Lit>> {
        let is_unoccluded = arrivals.is_unoccluded;
        let of = |directions: &[Incident]| {
            let lit = || {
                directions
                    .iter()
                    .copied()
                    .filter(|lit| lit.irradiance != Vec3::ZERO)
            };
            let (middle, length) = middle(lit());
            // The variance of directions is 1 − length², along both axes together; that of half vectors a quarter. Of `each` samples
            // one stands for so much less.
            let spread = (1.0 - length * length).max(0.0) as f32 / 4.0;
            let from: Vec<Incident> = match middle.filter(|_| is_unoccluded && length > CLOSE) {
                Some(middle) => vec![middle],
                None => lit().collect(),
            };
            let spread = spread / from.len().max(1) as f32;
            Lit {
                from,
                is_unoccluded,
                spread,
            }
        };
        let lit: Vec<Lit> = (arrivals.directions.par_chunks(arrivals.each))
            .with_min_len(256)
            .map(of)
            .collect();
        (!lit.iter().all(Lit::is_dark)).then_some(lit)
    }

    /// Whether none arrives.
    pub fn is_dark(&self) -> bool {
        self.from.is_empty()
    }

    /// Whether it is what would arrive if nothing were in the way.
    pub fn is_unoccluded(&self) -> bool {
        self.is_unoccluded
    }

    /// All of it, W/m².
    pub fn irradiance(&self) -> Vec3 {
        self.from.iter().map(|lit| lit.irradiance).sum()
    }

    /// How far away it comes from, m; infinite if from several directions.
    pub fn distance(&self) -> f32 {
        match self.from[..] {
            [one] => one.distance,
            _ => f32::INFINITY,
        }
    }

    /// How bright a surface is that is `away` from the place, m, for its brightness there; 1 of light from several directions. `normal`: of both, unit.
    pub fn brightness(&self, normal: Vec3, away: Vec3) -> f32 {
        match self.from[..] {
            [one] if one.distance.is_finite() => {
                let way = one.direction * one.distance - away;
                normal.dot(way).max(0.0) * one.distance.powi(2) / way.length().powi(3).max(f32::MIN_POSITIVE)
            }
            _ => 1.0,
        }
    }

    /// About the most that a surface at the place sends of it anywhere over its lobe, whose α is at least `least`: radiosity, W/m², as if it sent as much all around.
    pub fn most(&self, surface: &ShadingPoint, least: f32) -> f32 {
        let wide = bsdf::at_least_as_wide(surface, least);
        let of = |lit: &Incident| {
            lit.irradiance.max_element() * bsdf::strongest(&wide, surface.shading_normal.dot(lit.direction))
        };
        PI * self.from.iter().map(of).sum::<f32>()
    }

    /// What a surface near the place sends of it, `from` where it is `to` another one, times π: radiosity, W/m², as if it sent as much all around. The surface
    /// reflects as `shading` does, stands for places within `radius`, m, whose normals add `spread` to α², and is `away` from the place, m. Its lobe's α is at
    /// least `least`.
    pub fn reflected(
        &self,
        shading: &ShadingPoint,
        (from, to, away): (Vec3, Vec3, Vec3),
        (radius, spread): (f32, f32),
        least: f32,
    ) -> Vec3 {
        let way = to - from;
        let distance = way.length();
        let view = way / distance.max(f32::MIN_POSITIVE);
        if shading.geometric_normal.dot(view) <= 0.0 {
            return Vec3::ZERO;
        }
        // Half vectors turn by half of what either direction does over the surface that the point stands for, whose places lie half its
        // radius from the middle along each axis.
        let turn = |distance: f32| 0.25 * radius / distance.max(radius).max(f32::MIN_POSITIVE);
        let of = |lit: &Incident| {
            let turn = turn(distance) + turn(lit.distance);
            let slope = (shading.alpha * shading.alpha + 2.0 * turn * turn + self.spread + spread).sqrt();
            let wide = bsdf::at_least_as_wide(shading, slope.clamp(least, 1.0));
            let direction = match lit.distance.is_finite() {
                true => (lit.direction * lit.distance - away).try_normalize(),
                false => None,
            };
            lit.irradiance * bsdf::eval(&wide, view, direction.unwrap_or(lit.direction))
        };
        PI * self.from.iter().map(of).sum::<Vec3>()
    }
}

/// What part `expected` is of the larger of itself and what there is: at most 1, and 1 of nothing. What has less than expected stands for what is
/// dark: it sends what it would if it were lit, and the first ray that reaches it does not turn all of a cluster's light.
pub(crate) fn share(expected: Vec3, had: Vec3) -> Vec3 {
    let least = Vec3::splat(f32::MIN_POSITIVE);
    expected.max(least) / had.max(expected).max(least)
}

/// Light from several directions as one from their middle, `None` of no light, and the length of the directions' mean. In f64: however faint a light is, it
/// goes the same way.
fn middle(lit: impl Iterator<Item = Incident>) -> (Option<Incident>, f64) {
    let (mut irradiance, mut weight, mut direction, mut distance) = (Vec3::ZERO, 0.0, DVec3::ZERO, 0.0);
    for lit in lit {
        let own = lit.irradiance.as_dvec3().element_sum();
        irradiance += lit.irradiance;
        weight += own;
        direction += own * lit.direction.as_dvec3();
        distance += own * f64::from(lit.distance);
    }
    let length = direction.length() / weight;
    let is_light = weight > 0.0 && length > 0.0;
    let middle = is_light.then(|| Incident {
        irradiance,
        direction: direction.normalize().as_vec3(),
        distance: (distance / weight) as f32,
    });
    (middle, if is_light { length.min(1.0) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(x: f32, light: f32) -> Incident {
        Incident {
            irradiance: Vec3::splat(light),
            direction: Vec3::new(x, 1.0, 0.0).normalize(),
            distance: 2.0,
        }
    }

    fn lit(directions: Vec<Incident>) -> Option<Lit> {
        let arrivals = Arrivals {
            each: directions.len(),
            directions,
            is_unoccluded: true,
        };
        Some(Lit::of(&arrivals)?.remove(0))
    }

    /// Truth: light adds up, its middle is weighed by it, and neither depends on how faint it is.
    #[test]
    fn close_directions_are_one_and_others_stay_apart() {
        for scale in [1e-30, 1.0, 1e30] {
            let close = lit(vec![from(-0.1, scale), from(0.1, 3.0 * scale)]).unwrap();
            let [one] = close.from[..] else {
                panic!("{close:?}");
            };
            assert!((one.irradiance.x / scale - 4.0).abs() < 1e-5);
            assert!((one.direction.x - 0.05).abs() < 1e-3, "{}", one.direction);
            assert_eq!(one.distance, 2.0);
            let apart = lit(vec![from(-0.5, scale), from(0.5, scale)]).unwrap();
            assert_eq!(apart.from.len(), 2);
        }
        assert!(lit(vec![from(0.0, 0.0)]).is_none());
    }
}
