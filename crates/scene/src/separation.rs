//! Whether a surface stands between two places of a surface: a wall on a floor, a table on it, the next storey.
//!
//! What is known at one of them says nothing about the other then, however near it is. Values at points that a place
//! interpolates between would leak through every wall that is thinner than the points' distance.

use crate::rays::Ray;
use crate::surface::Surfaces;
use glam::Vec3;

/// Height above the places, in their distance, at which rays between them start and end: they are to clear the bulge of
/// curved surfaces and the rounding of stored positions (a 256th of the points' distance), and meet all that is higher.
const LIFT: f32 = 0.05;

/// Height of the way around, in the places' distance: convex surfaces that turn by less than some 90° between the
/// places, steps and mouldings pass below it.
const DETOUR: f32 = 0.5;

/// Two places, each a position and unit normal, that a surface may separate.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// From here.
    pub from: (Vec3, Vec3),
    /// To here.
    pub to: (Vec3, Vec3),
    /// Distance (metres) of the points that there are: places nearer to each other are lifted as if they were so far apart.
    pub scale: f32,
    /// Distance (metres) of the points at `from`: what stands lower above it than that is not told from the place's own surface.
    pub own: f32,
}

impl Pair {
    fn distance(&self) -> f32 {
        self.from.0.distance(self.to.0).max(self.scale)
    }

    /// Straight from one to the other.
    fn straight(&self) -> Ray {
        let [from, to] = self.lifted();
        between(from, to)
    }

    /// Both halves of the way around, over what lies low between them.
    fn around(&self) -> [Ray; 2] {
        let (a, b) = (self.from, self.to);
        let up = (a.1 + b.1).try_normalize().unwrap_or(a.1);
        let over = (a.0 + b.0) * 0.5 + up * (DETOUR * self.distance());
        let [from, to] = self.lifted();
        [between(from, over), between(over, to)]
    }

    /// Up to where the straight way starts, where that is high above the place: a place in a room is separated from a ground that is as far away as
    /// the room's roof is low.
    fn rise(&self) -> Option<Ray> {
        let (position, normal) = self.from;
        let high = self.lift();
        // From as high as ways between places start that are as far apart as points are here.
        (high > self.own).then(|| between(position + normal * (LIFT * self.own), position + normal * high))
    }

    /// Height above the places at which the straight way starts and ends, m.
    fn lift(&self) -> f32 {
        LIFT * self.distance()
    }

    fn lifted(&self) -> [Vec3; 2] {
        let lift = self.lift();
        [self.from, self.to].map(|(position, normal)| position + normal * lift)
    }
}

fn between(origin: Vec3, end: Vec3) -> Ray {
    Ray {
        origin,
        direction: end - origin,
        t_min: 0.0,
        t_max: 1.0,
    }
}

/// Whether a surface separates two places: it stands between them, and on the way around over what lies low between them as well; or right above
/// the first, where the way to the other starts higher.
pub fn are_separated(surfaces: &dyn Surfaces, pair: &Pair) -> bool {
    let blocked = |ray: &Ray| surfaces.occluded(ray);
    pair.rise().as_ref().is_some_and(blocked)
        || blocked(&pair.straight()) && pair.around().iter().any(blocked)
}

/// [`are_separated`] of many pairs, whose rays are cast together.
pub fn each_separated(surfaces: &dyn Surfaces, pairs: &[Pair]) -> Vec<bool> {
    let occluded = |rays: &[Ray]| {
        let mut occluded = vec![false; rays.len()];
        surfaces.occluded_packet(rays, &mut occluded);
        occluded
    };
    let straight: Vec<Ray> = pairs.iter().map(Pair::straight).collect();
    let mut separated = occluded(&straight);
    let blocked: Vec<usize> = (0..pairs.len()).filter(|&i| separated[i]).collect();
    let around: Vec<Ray> = blocked.iter().flat_map(|&i| pairs[i].around()).collect();
    for (&i, halves) in blocked.iter().zip(occluded(&around).chunks_exact(2)) {
        separated[i] = halves[0] || halves[1];
    }
    for (pair, separated) in pairs.iter().zip(&mut separated) {
        *separated = *separated || pair.rise().is_some_and(|rise| surfaces.occluded(&rise));
    }
    separated
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::implicit::{ImplicitSurface, Sdf};
    use glam::DVec3;

    /// On the unit sphere, this far from its top.
    fn on_sphere(degrees: f32) -> (Vec3, Vec3) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let normal = Vec3::new(sin, cos, 0.0);
        (normal, normal)
    }

    fn on_floor(x: f32) -> (Vec3, Vec3) {
        (Vec3::new(x, 0.0, 0.0), Vec3::Y)
    }

    fn are_separated(surfaces: &dyn Surfaces, from: (Vec3, Vec3), to: (Vec3, Vec3), scale: f32) -> bool {
        let own = scale;
        let pair = Pair { from, to, scale, own };
        let alone = super::are_separated(surfaces, &pair);
        assert_eq!(each_separated(surfaces, &[pair, pair]), [alone; 2]);
        alone
    }

    fn ellipsoid(x: f64, y: f64) -> ImplicitSurface {
        let wall = Sdf::Ellipsoid {
            center: DVec3::ZERO,
            radii: DVec3::new(x, y, 1.0),
        };
        ImplicitSurface::new(wall, (Vec3::splat(-2.0), Vec3::splat(2.0)), Vec3::ONE)
    }

    #[test]
    fn a_wall_separates_a_floor_whatever_the_distance() {
        let wall = ellipsoid(0.001, 1.0);
        for half in [0.002, 0.05, 0.5] {
            assert!(
                are_separated(&wall, on_floor(-half), on_floor(half), 0.02),
                "{half}"
            );
            assert!(
                !are_separated(&wall, on_floor(half), on_floor(2.0 * half), 0.02),
                "{half}"
            );
        }
    }

    /// Truth: a roof of 2 mm, 10 cm above a floor with points 1 cm apart, beside which the ground's are 10 m apart.
    #[test]
    fn a_place_under_a_roof_is_separated_from_far_ground_however_high_the_way_between_them_starts() {
        let roof = Sdf::Ellipsoid {
            center: DVec3::new(0.0, 0.1, 0.0),
            radii: DVec3::new(1.0, 0.001, 1.0),
        };
        let roof = ImplicitSurface::new(roof, (Vec3::splat(-2.0), Vec3::splat(2.0)), Vec3::ONE);
        let is_separated = |x: f32| {
            let pair = Pair {
                from: on_floor(x),
                to: on_floor(20.0),
                scale: 10.0,
                own: 0.01,
            };
            let alone = super::are_separated(&roof, &pair);
            assert_eq!(each_separated(&roof, &[pair]), [alone]);
            alone
        };
        assert!(is_separated(0.0) && is_separated(-0.8));
        assert!(!is_separated(1.1));
    }

    #[test]
    fn a_step_that_light_passes_over_separates_nothing() {
        let step = ellipsoid(0.05, 0.1);
        assert!(!are_separated(&step, on_floor(-0.2), on_floor(0.2), 0.02));
        assert!(
            are_separated(&step, on_floor(-0.06), on_floor(0.06), 0.02),
            "it is a wall for what is near"
        );
    }

    #[test]
    fn the_bulge_between_places_separates_them_where_it_hides_each_from_the_other_altogether() {
        let sphere = Sdf::Sphere {
            center: DVec3::ZERO,
            radius: 1.0,
        };
        let sphere = ImplicitSurface::new(sphere, (Vec3::splat(-2.0), Vec3::splat(2.0)), Vec3::ONE);
        for half in [0.0, 1.0, 10.0, 30.0, 44.0] {
            assert!(
                !are_separated(&sphere, on_sphere(-half), on_sphere(half), 0.02),
                "{half}"
            );
        }
        assert!(are_separated(&sphere, on_sphere(-70.0), on_sphere(70.0), 0.02));
    }
}
