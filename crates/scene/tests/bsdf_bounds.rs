//! Bounds of BRDFs over sets of directions, against the BRDFs themselves: Lambert, Phong, Ward (isotropic or not) and
//! metallic-roughness with its extensions, with bent shading normals.

use glam::Vec3;
use relight_scene::bsdf::bounds::ReflectionBound;
use relight_scene::bsdf::{MIN_SHEEN_ALPHA, eval};
use relight_scene::shading::{Gloss, Layers, ShadingPoint};
use relight_scene::surface::SurfaceHit;

/// A lobe's power below f32's smallest normal number is a multiple of a coarse step, and is then multiplied by up to
/// 1e6.
const COARSE: Vec3 = Vec3::splat(1e-31);

struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    fn unit(&mut self) -> Vec3 {
        loop {
            let v = Vec3::new(self.uniform(), self.uniform(), self.uniform()) * 2.0 - 1.0;
            if v.length_squared() > 1e-3 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }

    /// One extension of GGX or another, or none.
    fn extend(&mut self, point: &mut ShadingPoint) {
        point.gloss = Gloss::Ggx;
        let pick = self.uniform();
        if pick < 0.3 {
            return;
        }
        if pick < 0.5 {
            let other = 10f32.powf(-4.0 * self.uniform());
            point.gloss = Gloss::GgxAnisotropic {
                alpha: [other, point.alpha],
                tangent: self.unit(),
            };
        }
        if self.uniform() < 0.5 {
            point.f90 = point.f0.max_element() + (1.0 - point.f0.max_element()) * self.uniform();
            point.veil = Some([point.f0.max_element(), point.f90]);
        }
        if pick > 0.4 {
            point.layers = Some(Layers {
                coat: if pick < 0.8 { self.uniform() } else { 0.0 },
                coat_alpha: 10f32.powf(-4.0 * self.uniform()),
                coat_normal: (point.geometric_normal + self.unit() * 0.4).normalize(),
                sheen: if pick > 0.6 {
                    Vec3::new(self.uniform(), 0.5, 0.0)
                } else {
                    Vec3::ZERO
                },
                sheen_alpha: self.uniform().max(MIN_SHEEN_ALPHA),
            });
        }
    }

    fn point(&mut self) -> ShadingPoint {
        let normal = self.unit();
        let hit = SurfaceHit {
            t: 1.0,
            position: Vec3::ZERO,
            position_error: Vec3::ZERO,
            geometric_normal: normal,
            normal,
            front: true,
            primitive: 0,
            barycentric: [0.0; 2],
        };
        let mut point = ShadingPoint::lambert(&hit, Vec3::new(self.uniform(), self.uniform(), 0.0));
        if self.uniform() < 0.5 {
            point.shading_normal = (normal + self.unit() * 0.4).normalize();
        }
        let alpha = 10f32.powf(-4.0 * self.uniform());
        let pick = self.uniform();
        if pick < 0.1 {
            return point;
        }
        point.lambert = false;
        point.alpha = alpha;
        point.f0 = Vec3::new(0.04, self.uniform(), self.uniform());
        point.gloss = if pick < 0.5 {
            self.extend(&mut point);
            return point;
        } else {
            point.diffuse = point.diffuse.min(Vec3::ONE - point.f0);
            let other = if self.uniform() < 0.5 {
                alpha
            } else {
                10f32.powf(-4.0 * self.uniform())
            };
            if pick < 0.7 {
                Gloss::Phong {
                    exponent: 10f32.powf(6.0 * self.uniform()) - 1.0,
                }
            } else {
                Gloss::Ward {
                    alpha: [alpha, other],
                    tangent: self.unit(),
                }
            }
        };
        point
    }
}

/// Smallest angle of any of the directions with an axis, as exactly as it can be known.
fn angle(directions: &[Vec3], axis: Vec3) -> (f32, f32) {
    let (mut most, mut sine) = (-1.0f64, 0.0);
    for d in directions {
        // In f32 unit vectors are so to 1e-7 only, which near an axis is more than the cosines differ by.
        let (d, axis) = (d.as_dvec3().normalize(), axis.as_dvec3().normalize());
        if d.dot(axis) > most {
            (most, sine) = (d.dot(axis), d.cross(axis).length());
        }
    }
    // What callers promise: no f32 rounding makes the angle too large.
    (most as f32 + 1e-7, (sine as f32 - 1e-6).max(0.0))
}

/// Truth: `eval`, direction by direction. The directions lie around a middle that is the mirror direction half of
/// the time, within any angle.
#[test]
fn no_direction_reflects_more_than_the_bound() {
    let mut random = Random(1);
    let (mut seen, mut tight) = (0u32, 0.0f64);
    for case in 0..200_000 {
        let point = random.point();
        let wo = (point.shading_normal * random.uniform() + random.unit()).normalize_or(Vec3::X);
        let point = point.facing(wo);
        let middle = if case % 2 == 0 {
            random.unit()
        } else {
            point.shading_normal * (2.0 * point.shading_normal.dot(wo)) - wo
        };
        let width = 10f32.powf(-5.0 * random.uniform());
        let directions: [Vec3; 12] =
            std::array::from_fn(|_| (middle + random.unit() * width).normalize_or(Vec3::X));
        let bound = ReflectionBound::new(&point, wo);
        let most = bound.bound(|axis| angle(&directions, bound.axes[axis]));
        let mut found = Vec3::ZERO;
        for wi in directions {
            let cos = point.shading_normal.dot(wi).max(0.0);
            found = found.max(eval(&point, wo, wi) * cos);
        }
        assert!(
            found.cmple(most + COARSE).all(),
            "{case}: {found} {most} {point:?} {wo} {middle} {width}"
        );
        assert!(most.is_finite());
        if found.max_element() > 0.0 {
            seen += 1;
            tight += f64::from(found.element_sum() / most.element_sum());
        }
    }
    // A bound far above what there is would be of no use.
    assert!(tight / f64::from(seen) > 0.38, "{}", tight / f64::from(seen));
}
