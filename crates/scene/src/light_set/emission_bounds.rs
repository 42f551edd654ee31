//! Bounds of what some emissive surfaces send out: where they are, which way they face, and how bright they are.
//!
//! Source: Conty Estévez and Kulla, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, HPG 2018, sections 4
//! and 5; Pharr et al., *Physically Based Rendering*, 4th ed., 12.6.3. **Deviations:** what lies wholly
//! behind a plane, the receiver's or that of flat surfaces, is told by the box, not the ball around it; surfaces that emit on both sides are a cone of lines.

use super::shape::ReferencePoint;
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Least cosine at the receiver that a bound counts with: it is that of the true surface, and smooth normals, or lobes that
/// shine at grazing angles, reflect more of what grazes it.
const GRAZING: f64 = 0.1;

/// Radians from opposite within which axes are: rounding alone would say in which plane they turn to each other.
const LEAST_TURN: f64 = 1e-6;

/// Directions within an angle of an axis, or, of surfaces that emit on both sides, of either end of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalCone {
    /// Unit.
    pub axis: DVec3,
    /// Radians, 0 to π.
    pub angle: f64,
    pub two_sided: bool,
}

impl NormalCone {
    /// The smallest one around both, or nearly.
    fn union(&self, other: &NormalCone) -> NormalCone {
        let two_sided = self.two_sided || other.two_sided;
        let mut towards = other.axis;
        if two_sided && self.axis.dot(towards) < 0.0 {
            towards = -towards;
        }
        let cross = self.axis.cross(towards);
        let between = cross.length().atan2(self.axis.dot(towards));
        let of = |cone: &NormalCone, axis| NormalCone {
            axis,
            two_sided,
            ..*cone
        };
        if (between + other.angle).min(PI) <= self.angle {
            return of(self, self.axis);
        }
        if (between + self.angle).min(PI) <= other.angle {
            return of(other, towards);
        }
        let angle = 0.5 * (self.angle + between + other.angle);
        // Opposite axes span no plane that one turns to the other in.
        let across = cross.cross(self.axis).try_normalize();
        match across {
            Some(across) if angle < PI && between < PI - LEAST_TURN => {
                let turn = angle - self.angle;
                NormalCone {
                    axis: (self.axis * turn.cos() + across * turn.sin()).normalize(),
                    angle,
                    two_sided,
                }
            }
            _ => NormalCone {
                axis: self.axis,
                angle: PI,
                two_sided,
            },
        }
    }

    /// Measure of the directions that light may leave in: the paper's M_Ω, with an emission of π/2 around each normal.
    fn measure(&self) -> f64 {
        let (o, w) = (self.angle, (self.angle + FRAC_PI_2).min(PI));
        2.0 * PI * (1.0 - o.cos())
            + FRAC_PI_2 * (2.0 * w * o.sin() - (o - 2.0 * w).cos() - 2.0 * o * o.sin() + o.cos())
    }
}

/// Surfaces together, while a tree is built.
#[derive(Clone, Copy, Debug)]
pub(super) struct Emission {
    pub low: DVec3,
    pub high: DVec3,
    pub cone: NormalCone,
    /// Luminance × area, in any unit.
    pub power: f64,
}

impl Emission {
    /// Of one triangle. `None` without a normal.
    pub fn of_triangle(vertices: [DVec3; 3], power: f64, two_sided: bool) -> Option<Emission> {
        let [a, b, c] = vertices;
        Some(Emission {
            low: a.min(b).min(c),
            high: a.max(b).max(c),
            cone: NormalCone {
                axis: (b - a).cross(c - a).try_normalize()?,
                angle: 0.0,
                two_sided,
            },
            power,
        })
    }

    pub fn union(&self, other: &Emission) -> Emission {
        Emission {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            cone: self.cone.union(&other.cone),
            power: self.power + other.power,
        }
    }

    pub fn center(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// What a node of these costs: the paper's measure without the factor of its split axis.
    pub fn cost(&self) -> f64 {
        let size = self.high - self.low;
        let area = size.x * size.y + size.y * size.z + size.z * size.x;
        self.power * self.cone.measure() * area
    }
}

/// What a node of the tree knows.
#[derive(Clone, Copy, Debug)]
pub(super) struct EmissionBounds {
    center: Vec3,
    /// Half the box around all.
    half: Vec3,
    /// Of the ball around that.
    radius: f32,
    axis: Vec3,
    cos_cone: f32,
    sin_cone: f32,
    /// Share of the whole tree's.
    power: f32,
    two_sided: bool,
}

impl EmissionBounds {
    /// `all`: the power of the whole tree.
    pub fn new(of: &Emission, all: f64) -> EmissionBounds {
        let center = of.center().as_vec3();
        let middle = center.as_dvec3();
        // Outwards by what rounding takes.
        let half = (of.high - middle).abs().max((middle - of.low).abs()) * (1.0 + 1e-6);
        EmissionBounds {
            center,
            half: half.as_vec3(),
            radius: half.length() as f32,
            axis: of.cone.axis.as_vec3(),
            cos_cone: of.cone.angle.cos() as f32,
            sin_cone: of.cone.angle.sin() as f32,
            // However little, it is something.
            power: ((of.power / all) as f32).max(f32::MIN_POSITIVE),
            two_sided: of.cone.two_sided,
        }
    }

    /// About the irradiance that arrives from here, in any unit that all nodes share. 0 only where nothing does.
    pub fn importance(&self, at: &ReferencePoint) -> f64 {
        let to = self.center.as_dvec3() - at.position.as_dvec3();
        let squared = to.length_squared();
        let (radius, power) = (f64::from(self.radius), f64::from(self.power));
        let normal = at.normal.as_dvec3();
        if at.normal != Vec3::ZERO && normal.dot(to) + self.reach(normal) <= 0.0 {
            return 0.0;
        }
        let axis = self.axis.as_dvec3();
        let (cos_cone, sin_cone) = (f64::from(self.cos_cone), f64::from(self.sin_cone));
        if !self.two_sided && cos_cone > 0.0 {
            // However a normal leans within the cone, and wherever in the box it stands, it looks away.
            let leaning = sin_cone * (squared.sqrt() + radius);
            if (self.reach(axis) - axis.dot(to)) * cos_cone + leaning <= 0.0 {
                return 0.0;
            }
        }
        let within = radius * radius;
        if squared <= within {
            return if within > 0.0 { power / within } else { 0.0 };
        }
        let over_distance = 1.0 / squared.sqrt();
        let sin_ball = radius * over_distance;
        let cos_ball = (1.0 - sin_ball * sin_ball).max(0.0).sqrt();
        let mut cos = -axis.dot(to) * over_distance;
        if self.two_sided {
            cos = cos.abs();
        }
        let (cos, sin) = less(cos, sin_of(cos), cos_cone, sin_cone);
        let (emitted, _) = less(cos, sin, cos_ball, sin_ball);
        if emitted <= 0.0 {
            return 0.0;
        }
        let received = if at.normal == Vec3::ZERO {
            1.0
        } else {
            let cos = normal.dot(to) * over_distance;
            let (cos, _) = less(cos, sin_of(cos), cos_ball, sin_ball);
            if cos <= 0.0 {
                return 0.0;
            }
            cos.max(GRAZING)
        };
        power * emitted * received / squared
    }

    /// How far the box reaches from its middle along a direction.
    fn reach(&self, direction: DVec3) -> f64 {
        self.half.as_dvec3().dot(direction.abs())
    }
}

fn sin_of(cos: f64) -> f64 {
    (1.0 - cos * cos).max(0.0).sqrt()
}

/// Cosine and sine of the difference of two angles, 0 where it is negative.
fn less(cos_a: f64, sin_a: f64, cos_b: f64, sin_b: f64) -> (f64, f64) {
    if cos_a >= cos_b {
        (1.0, 0.0)
    } else {
        (cos_a * cos_b + sin_a * sin_b, sin_a * cos_b - cos_a * sin_b)
    }
}
