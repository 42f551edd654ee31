//! Looks through solid glass: rays from eyes and off mirrors, which bend.
//!
//! Source: Snell's law with the index of KHR_materials_ior, at the shading normal; beyond the critical angle all is mirrored. Of the
//! rest Schlick's term at the angle outside is mirrored, so that a surface mirrors as much from within as from without along one way, and as much as
//! [`super::panes`] says. Radiance is divided by the square of the index on the way in and multiplied on the way out; ways that
//! end outside of glass know neither. Absorption is that of the lengths really gone inside.
//!
//! Which way a ray takes at a surface is decided by a hash, as alpha is. A ray that is mirrored inside goes on; one that is stopped outside
//! ends there, and the surface reflects as that of a pane does.
//!
//! Deviations: roughness blurs neither what passes nor what is mirrored inside; bodies within bodies count as glass in air.

use super::corner::hash_to_unit;
use super::panes::{MOST, Pane, left_after};
use super::scene::TracedScene;
use crate::bsdf;
use crate::rays::Ray;
use crate::shading::ShadingPoint;
use crate::surface::{SurfaceHit, Surfaces, ray_from};
use glam::Vec3;

/// What a ray shows that bends in solid glass.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// The last, straight part of its way, with a unit direction; the ray itself where it met no solid glass.
    pub ray: Ray,
    /// Where that ends, `t` counted from its own origin; `None`: nowhere.
    pub hit: Option<SurfaceHit>,
    /// Factor of the light that comes to the start of the last part, and what is lost along it inside of glass; linear RGB. Without the [`Surfaces::tint`] of
    /// the last part.
    pub tint: Vec3,
    /// Length of the parts before the last, m.
    pub before: f32,
    /// Whether solid glass has bent or mirrored it.
    pub bent: bool,
}

impl Look {
    /// Of a straight ray that ends at `hit`.
    pub fn straight(ray: &Ray, hit: Option<SurfaceHit>) -> Look {
        Look {
            ray: *ray,
            hit,
            tint: Vec3::ONE,
            before: 0.0,
            bent: false,
        }
    }

    /// Length of the whole way, m; infinite where it ends nowhere.
    pub fn length(&self) -> f32 {
        self.before + self.hit.map_or(f32::INFINITY, |hit| hit.t)
    }
}

/// Where a ray goes on that meets solid glass.
enum Onwards {
    /// In this direction, with this factor.
    To(Vec3, Vec3),
    /// Nowhere: the surface is seen.
    Stopped,
    /// Nowhere: it is lost.
    Lost,
}

impl TracedScene {
    /// Whether there is solid glass, in which looks bend: elsewhere [`TracedScene::look`] is [`Surfaces::closest_hit`].
    pub fn bends(&self) -> bool {
        self.solid
    }

    /// What a ray with a unit direction from an eye or off a mirror meets. `visit(part, end, tint)` of each straight part of its way but
    /// the last: the ray, the `t` where it meets glass, and the factor of the light that comes to its start.
    pub fn look(&self, ray: &Ray, mut visit: impl FnMut(&Ray, f32, Vec3)) -> Look {
        if !self.solid {
            return Look::straight(ray, self.closest_hit(ray));
        }
        let mut look = Look::straight(ray, None);
        // What absorbs where the ray is, as far as it is known.
        let mut inside = Vec3::ZERO;
        for _ in 0..MOST {
            let hit = self.bvh().closest_hit_where(&look.ray, |hit| {
                self.traced_instance(hit.triangle).solid || self.stops(&look.ray, hit)
            });
            let Some(hit) = hit else {
                return look;
            };
            let surface = self.surface_hit(&look.ray, &hit);
            let solid = self.traced_instance(hit.triangle).solid;
            if solid && !surface.front {
                inside = self.absorption_of(hit.triangle);
            }
            let through = left_after(inside, hit.t);
            let (onwards, pane) = match self.pane_met(&hit) {
                Some(pane) if solid => (self.onwards(&look.ray, &surface, &pane), Some(pane)),
                _ => (Onwards::Stopped, None),
            };
            let (direction, factor) = match onwards {
                Onwards::To(direction, factor) => (direction, factor),
                Onwards::Stopped => {
                    look.tint *= through;
                    look.hit = Some(surface);
                    return look;
                }
                Onwards::Lost => break,
            };
            visit(&look.ray, hit.t, look.tint);
            look.tint *= through * factor * self.tint(&look.ray, hit.t);
            look.before += hit.t;
            look.bent = true;
            let passes = direction.dot(surface.geometric_normal) < 0.0;
            if pane.is_some() && passes {
                inside = if surface.front {
                    self.absorption_of(hit.triangle)
                } else {
                    Vec3::ZERO
                };
            }
            look.ray = ray_from(&surface, direction);
        }
        look.tint = Vec3::ZERO;
        look
    }

    /// Whether rays off a point's sharp lobe bend in solid glass, and its light samples therefore don't show the lobe what lies behind it. From
    /// within glass they don't: only straight rays end there, and where one mirrored within would bend, total reflection could hold it for ever.
    pub fn bends_from(&self, hit: &SurfaceHit, point: &ShadingPoint) -> bool {
        self.solid && bsdf::is_sharp(point) && (hit.front || !self.traced_instance(hit.primitive).solid)
    }

    /// Whether a surface of solid glass is the first that a ray meets, whether or not the ray passes it.
    pub fn meets_solid(&self, ray: &Ray) -> bool {
        let solid = |hit: &crate::rays::Hit| self.traced_instance(hit.triangle).solid;
        self.solid
            && (self.bvh())
                .closest_hit_where(ray, |hit| solid(hit) || self.stops(ray, hit))
                .is_some_and(|hit| solid(&hit))
    }

    /// Whether a straight ray goes through a surface of solid glass.
    pub fn crosses_solid(&self, ray: &Ray) -> bool {
        let solid = |hit: &crate::rays::Hit| self.traced_instance(hit.triangle).solid;
        self.solid && self.bvh().some_hit_where(ray, solid).is_some()
    }

    fn onwards(&self, ray: &Ray, hit: &SurfaceHit, pane: &Pane) -> Onwards {
        let random = hash_to_unit(ray, hit.primitive);
        let d = ray.direction;
        let normal = self.facing_normal(hit, d);
        let cos = -normal.dot(d);
        let n = self.index_of(hit.primitive);
        let ratio = if hit.front { n.recip() } else { n };
        let below = 1.0 - ratio * ratio * (1.0 - cos * cos);
        let refracted = (below > 0.0).then(|| {
            let bent = d * ratio + normal * (ratio * cos - below.sqrt());
            (bent.normalize(), if hit.front { cos } else { below.sqrt() })
        });
        let mirrored = (d + normal * (2.0 * cos)).normalize();
        let (passing, fresnel) = match refracted {
            Some((_, outside)) => {
                let fresnel = pane.fresnel(outside);
                (pane.passing.max_element() * (1.0 - fresnel), fresnel)
            }
            None => (0.0, 1.0),
        };
        let through = |direction: Vec3| direction.dot(hit.geometric_normal) < 0.0;
        match refracted {
            // A bent normal may send what passes back, and what is mirrored through.
            Some((direction, _)) if random < passing => match through(direction) {
                true => Onwards::To(direction, pane.tint()),
                false => Onwards::To(d, pane.tint()),
            },
            _ if hit.front => Onwards::Stopped,
            _ if random < passing + fresnel => match through(mirrored) {
                true => {
                    let g = hit.geometric_normal;
                    Onwards::To((d - g * (2.0 * g.dot(d))).normalize(), Vec3::ONE)
                }
                false => Onwards::To(mirrored, Vec3::ONE),
            },
            _ if pane.transmission < 1.0 => Onwards::Stopped,
            _ => Onwards::Lost,
        }
    }

    /// The shading normal if a ray in direction `d` comes from its side, else that of the true surface.
    fn facing_normal(&self, hit: &SurfaceHit, d: Vec3) -> Vec3 {
        let normal = self.shading_point(hit).shading_normal;
        if normal.dot(d) < 0.0 {
            normal
        } else {
            hit.geometric_normal
        }
    }

    /// Index of refraction of the body that a triangle belongs to; 1 for what mirrors all light.
    fn index_of(&self, triangle: u32) -> f32 {
        let material = &self.scene().materials[self.material_of(triangle) as usize];
        let ior = material.extensions.as_ref().map_or(1.5, |e| e.ior);
        if ior >= 1.0 { ior } else { 1.0 }
    }
}
