//! Direct light of a point light on surfaces of any kind.

use glam::Vec3;
use relight_bake::points::candidates::Candidate;
use relight_scene::rays::Ray;
use relight_scene::surface::Surfaces;

/// Irradiance straight from a point light of `intensity` (W/sr, RGB) at `position`: the simplest input of
/// a radiosity solution.
pub fn from_point_light(surfaces: &dyn Surfaces, place: &Candidate, position: Vec3, intensity: Vec3) -> Vec3 {
    let way = position - place.origin;
    let squared = way.length_squared();
    let cosine = way.dot(place.normal) / squared.sqrt();
    let ray = Ray {
        origin: place.origin,
        direction: way,
        t_min: 0.0,
        t_max: 1.0,
    };
    // Not so for a light on the very place, where the cosine is no number.
    let faces = cosine > 0.0 && way.dot(place.geometric_normal) > 0.0;
    if faces && !surfaces.occluded(&ray) {
        intensity * (cosine / squared)
    } else {
        Vec3::ZERO
    }
}
