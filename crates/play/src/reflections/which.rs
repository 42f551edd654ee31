//! Which lobes are followed, and by how many rays.

use glam::Vec3;
use relight_scene::bsdf;
use relight_scene::shading::ShadingPoint;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_3};

/// Rays of the widest lobe where the camera stands still.
pub const FIXED_RAYS: u32 = 32;

/// The same where every frame casts them anew: the camera or materials move.
pub const MOVING_RAYS: u32 = 4;

/// Lobes that matter less are spread like the matt part: their share of the reflected light, times one for a mirror and a
/// half for the widest, which look much like it. Of wide lobes of places that see surfaces in a tenth of their hemisphere alone, as on open ground, times
/// ten: the lobe may see all of those, and the matt part none.
const LEAST: f32 = 0.05;

/// Share by which rays are counted of lobes that have less, but may make up as much or more where little is seen: others of their group show much of what they see.
const OPEN_SHARE: f32 = 0.5;

/// Least angular radius of a wide lobe, radians. Such lobes of neighbouring fragments share what they see far away, and a lobe's rays are everywhere in the
/// hemisphere.
pub(super) const WIDE: f32 = FRAC_PI_3;

/// A mirror takes one ray in so many of what the widest lobe takes: edges of what it shows cross its pixels, too.
const LEAST_OF_MOST: u32 = 8;

/// Rays with which to follow a point's lobe seen from `wo` (unit, away from the surface), `most` for the widest; 0 where
/// spreading its light like the matt part's will do. `enclosed`: irradiance over radiosity if all surfaces send the same, 0 to 1.
pub fn rays(point: &ShadingPoint, wo: Vec3, most: u32, enclosed: f32) -> u32 {
    let lobe = bsdf::lobe_albedo(point, wo);
    if lobe == Vec3::ZERO {
        return 0;
    }
    let matt = matt_albedo(point, wo);
    let share = (lobe / (lobe + matt).max(Vec3::splat(f32::MIN_POSITIVE))).max_element();
    let radius = bsdf::width_facing(point);
    let width = radius / FRAC_PI_2;
    let most_share = if radius >= WIDE {
        (share / enclosed).min(1.0)
    } else {
        share
    };
    if most_share * (1.0 - 0.5 * width) < LEAST {
        return 0;
    }
    ((most as f32 * share.max(OPEN_SHARE.min(most_share)) * width).ceil() as u32)
        .max(most / LEAST_OF_MOST)
        .max(1)
}

/// Share of even light that the matt part reflects towards `wo`.
pub(crate) fn matt_albedo(point: &ShadingPoint, wo: Vec3) -> Vec3 {
    bsdf::diffuse_reflectance(point, point.shading_normal.dot(wo))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{level, matt, traced};
    use relight_scene::material::Material;
    use relight_scene::rays::Ray;
    use relight_scene::surface::Surfaces;
    use relight_scene::traced::{Shading, TracedScene};

    /// What a ray from above meets of a floor of this material.
    fn floor(material: Material, wo: Vec3) -> ShadingPoint {
        let matt = traced(vec![level(1.0, 0.0, 0)], vec![material]);
        let scene = TracedScene::new(matt.scene().clone(), Shading::Full).unwrap();
        let ray = Ray {
            origin: wo,
            direction: -wo,
            t_min: 0.0,
            t_max: 2.0,
        };
        scene.shading_point(&scene.closest_hit(&ray).unwrap()).facing(wo)
    }

    fn glossy(roughness: f32, metallic: f32) -> Material {
        Material {
            roughness,
            metallic,
            ..matt(0.5, 0.0)
        }
    }

    #[test]
    fn lobes_are_followed_where_they_matter() {
        let above = Vec3::new(0.0, 0.8, 0.6);
        let grazing = Vec3::new(0.0, 0.05, 1.0).normalize();
        let rays = |roughness, metallic, wo| rays(&floor(glossy(roughness, metallic), wo), wo, 32, 1.0);
        // A mirror's few are for edges; the rougher a metal, the more it takes.
        assert_eq!(rays(0.0, 1.0, above), 32 / LEAST_OF_MOST);
        assert!(rays(0.3, 1.0, above) < rays(0.5, 1.0, above));
        assert_eq!(rays(1.0, 1.0, above), 32);
        // 4 % of a rough dielectric's light are spread; a polished one shows its mirror image, most of all at the horizon.
        assert_eq!(rays(1.0, 0.0, above), 0);
        assert!(rays(0.3, 0.0, above) > 0);
        assert!(rays(0.3, 0.0, grazing) > rays(0.3, 0.0, above));
    }

    /// On open ground the lobe may see a bright house, and the matt part next to nothing.
    #[test]
    fn wide_lobes_are_followed_where_little_is_seen() {
        let above = Vec3::new(0.0, 0.8, 0.6);
        let rays = |roughness, enclosed| rays(&floor(glossy(roughness, 0.0), above), above, 32, enclosed);
        assert_eq!(rays(1.0, 0.9), 0);
        assert!(rays(1.0, 0.15) > 0);
        assert_eq!(rays(1.0, 0.01), 16);
        assert_eq!(rays(1.0, 0.0), 16);
        // What a narrower one sees nobody shares.
        assert_eq!(rays(0.3, 0.01), rays(0.3, 1.0));
    }

    #[test]
    fn a_point_that_shows_nothing_follows_nothing() {
        let below = Vec3::new(0.0, -1.0, 0.0);
        let point = floor(glossy(0.0, 1.0), Vec3::Y);
        assert_eq!(rays(&point, below, 32, 1.0), 0);
        let black = ShadingPoint {
            diffuse: Vec3::ZERO,
            f0: Vec3::ZERO,
            lambert: true,
            ..point
        };
        assert_eq!(rays(&black, Vec3::Y, 32, 1.0), 0);
    }
}
