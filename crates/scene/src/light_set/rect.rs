//! Rectangular lights, sampled uniformly in solid angle: Ureña, Fajardo, King, *An Area-Preserving
//! Parametrization for Spherical Rectangles*, EGSR 2013.
//!
//! All in f64. **Deviation:** below a solid angle of 1e-6 the spherical excess is the difference of nearly
//! equal numbers, and a parallelogram whose edges are not perpendicular is no spherical rectangle: both are
//! sampled by area instead.

use super::emitters::Emitters;
use super::form::LightForm;
use super::shape::{
    Extent, LightSample, LongRay, ReferencePoint, Seen, Shape, attenuate, extended, luminance64, times,
};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// A rectangle that shines.
pub(super) struct RectLight {
    pub rect: Rect,
    /// RGB, W/(m² sr).
    pub radiance: Vec3,
}

impl Shape for RectLight {
    fn extent(&self) -> Extent {
        Extent::Near
    }

    fn sample(&self, _: &dyn Emitters, at: &ReferencePoint, [r0, r1, _]: [f32; 3]) -> Option<LightSample> {
        let from = at.position.as_dvec3();
        let (point, pdf) = self.rect.sample(from, [r0, r1])?;
        let d = point - from;
        Some(extended(
            d.try_normalize()?.as_vec3(),
            d.length(),
            self.radiance,
            pdf,
        ))
    }

    fn met_by(&self, ray: &LongRay) -> Option<Seen> {
        let t = self
            .rect
            .hit(ray.from, ray.direction)
            .filter(|&t| t < ray.reach)?;
        Some(Seen {
            radiance: self.radiance,
            pdf: self.rect.pdf(ray.from, ray.from + t * ray.direction) as f32,
        })
    }

    fn importance(&self, from: DVec3) -> f64 {
        let rect = &self.rect;
        if !rect.faces(from) {
            return 0.0;
        }
        let power = luminance64(self.radiance) * rect.area;
        attenuate(power, from, rect.center(), rect.area.sqrt() * 0.5)
    }

    fn power(&self, _: f64) -> Vec3 {
        times(self.radiance, PI * self.rect.area)
    }

    fn form<'a>(&'a self, _: &'a dyn Emitters) -> LightForm<'a> {
        let [corner, edge_u, edge_v] = self.rect.corner_and_edges().map(|v| v.as_vec3());
        LightForm::Rect {
            corner,
            edge_u,
            edge_v,
            radiance: self.radiance,
        }
    }
}

/// A parallelogram that emits towards `edge_u × edge_v`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    /// Its corner at −u, −v.
    corner: DVec3,
    edge_u: DVec3,
    edge_v: DVec3,
    /// Unit normal of the emitting side.
    pub normal: DVec3,
    /// m².
    pub area: f64,
    /// Whether the edges are perpendicular to within rounding.
    rectangular: bool,
}

/// Where the rectangle is seen from a point, for sampling and for densities alike.
enum View {
    SolidAngle(SphericalRectangle),
    Area,
}

impl Rect {
    /// `None` if it has no area.
    pub fn new(center: Vec3, edge_u: Vec3, edge_v: Vec3) -> Option<Rect> {
        let (u, v) = (edge_u.as_dvec3(), edge_v.as_dvec3());
        let cross = u.cross(v);
        let area = cross.length();
        let normal = cross / area;
        normal.is_finite().then(|| Rect {
            corner: center.as_dvec3() - 0.5 * (u + v),
            edge_u: u,
            edge_v: v,
            normal,
            area,
            rectangular: u.dot(v).abs() <= 1e-6 * u.length() * v.length(),
        })
    }

    /// Its middle.
    pub fn center(&self) -> DVec3 {
        self.corner + 0.5 * (self.edge_u + self.edge_v)
    }

    /// A corner, and the sides that start there.
    pub fn corner_and_edges(&self) -> [DVec3; 3] {
        [self.corner, self.edge_u, self.edge_v]
    }

    /// Whether `x` is on the emitting side.
    pub fn faces(&self, x: DVec3) -> bool {
        (x - self.corner).dot(self.normal) > 0.0
    }

    fn view(&self, x: DVec3) -> View {
        if self.rectangular
            && let Some(sphere) = SphericalRectangle::new(self, x)
        {
            return View::SolidAngle(sphere);
        }
        View::Area
    }

    /// A point on it and the density per steradian, seen from `x`; `None` from behind.
    pub fn sample(&self, x: DVec3, random: [f32; 2]) -> Option<(DVec3, f64)> {
        if !self.faces(x) {
            return None;
        }
        let (a, b) = (f64::from(random[0]), f64::from(random[1]));
        let point = match self.view(x) {
            View::SolidAngle(view) => {
                return Some((view.point(self, x, a, b), 1.0 / view.solid_angle));
            }
            View::Area => self.corner + a * self.edge_u + b * self.edge_v,
        };
        let pdf = self.area_pdf(x, point);
        (pdf > 0.0 && pdf.is_finite()).then_some((point, pdf))
    }

    /// Density with which [`Rect::sample`] draws `point`, seen from `x`.
    pub fn pdf(&self, x: DVec3, point: DVec3) -> f64 {
        match self.view(x) {
            View::SolidAngle(view) => 1.0 / view.solid_angle,
            View::Area => self.area_pdf(x, point),
        }
    }

    fn area_pdf(&self, x: DVec3, point: DVec3) -> f64 {
        let d = point - x;
        let squared = d.length_squared();
        squared * squared.sqrt() / (-d.dot(self.normal) * self.area)
    }

    /// Where a ray (unit direction) meets the emitting side.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let cos = direction.dot(self.normal);
        if cos >= 0.0 {
            return None;
        }
        let t = (self.corner - origin).dot(self.normal) / cos;
        if t.is_nan() || t <= 0.0 {
            return None;
        }
        // Coordinates along the edges: the planes that hold the normal and the other edge.
        let offset = origin + t * direction - self.corner;
        let a = offset.cross(self.edge_v).dot(self.normal) / self.area;
        let b = self.edge_u.cross(offset).dot(self.normal) / self.area;
        ((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b)).then_some(t)
    }
}

/// The paper's precomputed values (its section 4 and listing): the frame has the rectangle at z = z0 < 0.
struct SphericalRectangle {
    x0: f64,
    y0: f64,
    x1: f64,
    y1: f64,
    z0: f64,
    b0: f64,
    b1: f64,
    /// 2π − γ2 − γ3.
    k: f64,
    solid_angle: f64,
}

impl SphericalRectangle {
    /// `None` where the solid angle is too small for f64 to hold its excess well.
    fn new(rect: &Rect, x: DVec3) -> Option<SphericalRectangle> {
        let (length_u, length_v) = (rect.edge_u.length(), rect.edge_v.length());
        let d = rect.corner - x;
        // The emitting side looks at x, so the normal points from the rectangle to x: z0 is below zero.
        let z0 = d.dot(rect.normal);
        let x0 = d.dot(rect.edge_u) / length_u;
        let y0 = d.dot(rect.edge_v) / length_v;
        let (x1, y1) = (x0 + length_u, y0 + length_v);
        // Normals of the planes through x and an edge; only their z and their angles are needed:
        // n0 ∝ (0, z0, −y0), n1 ∝ (−z0, 0, x1), n2 ∝ (0, −z0, y1), n3 ∝ (z0, 0, −x0).
        let z_of = |along: f64| along / along.hypot(z0);
        let (n0, n1, n2, n3) = (-z_of(y0), z_of(x1), z_of(y1), -z_of(x0));
        // Adjacent normals share only their z components.
        let angle = |a: f64, b: f64| (-a * b).clamp(-1.0, 1.0).acos();
        let (g0, g1, g2, g3) = (angle(n0, n1), angle(n1, n2), angle(n2, n3), angle(n3, n0));
        let k = 2.0 * PI - g2 - g3;
        let solid_angle = g0 + g1 - k;
        (solid_angle > 1e-6).then_some(SphericalRectangle {
            x0,
            y0,
            x1,
            y1,
            z0,
            b0: n0,
            b1: n2,
            k,
            solid_angle,
        })
    }

    /// The paper's steps 1 to 4.
    fn point(&self, rect: &Rect, x: DVec3, u: f64, v: f64) -> DVec3 {
        // Step 1: cos φu.
        let au = u * self.solid_angle + self.k;
        let fu = (au.cos() * self.b0 - self.b1) / au.sin();
        let cu = (1.0 / (fu * fu + self.b0 * self.b0).sqrt())
            .copysign(fu)
            .clamp(-1.0, 1.0);
        // Step 2: x on the rectangle. cu = ±1 is the horizon, far beyond any edge.
        let xu = -(cu * self.z0) / (1.0 - cu * cu).max(1e-300).sqrt();
        let xu = xu.clamp(self.x0, self.x1);
        // Step 3: y, uniform in h = sin of the elevation over the strip.
        let d = (xu * xu + self.z0 * self.z0).sqrt();
        let h0 = self.y0 / d.hypot(self.y0);
        let h1 = self.y1 / d.hypot(self.y1);
        let hv = h0 + v * (h1 - h0);
        let yv = if hv * hv < 1.0 - 1e-12 {
            hv * d / (1.0 - hv * hv).sqrt()
        } else {
            self.y1
        };
        let yv = yv.clamp(self.y0, self.y1);
        // Step 4: back to the world.
        let (unit_u, unit_v) = (rect.edge_u.normalize(), rect.edge_v.normalize());
        x + xu * unit_u + yv * unit_v + self.z0 * rect.normal
    }
}
