//! Scenes of closed form that several tests, and those of the example `radiosity`, share.

use glam::{DVec3, Vec3};
use relight_bake::points::openness::Openness;
use relight_bake::points::poisson::{PointLevels, distribute};
use relight_bake::points::relevance::Relevance;
use relight_bake::units::Units;
use relight_scene::implicit::{ImplicitSurface, Sdf};

/// A hollow implicit ball of radius 1, seen from inside, and its points on three levels.
pub fn hollow(albedo: f32) -> (ImplicitSurface, PointLevels) {
    let sdf = Sdf::Sphere {
        center: DVec3::ZERO,
        radius: 1.0,
    };
    let ball = ImplicitSurface::new(sdf, (Vec3::splat(-1.0), Vec3::splat(1.0)), Vec3::splat(albedo));
    let points = distribute(
        &ball,
        &Relevance::even(&[Vec3::new(0.1, 0.2, -0.1)]),
        Openness::none(),
        3,
        0.4,
        0,
        Units::none(),
        |_| Ok(()),
    )
    .unwrap();
    (ball, points)
}
