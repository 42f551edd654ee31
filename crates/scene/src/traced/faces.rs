//! Triangles that rays hit one after the other.

use super::face::Face;
use super::scene::TracedScene;
use crate::rays::{Hit, Ray};
use crate::surface::SurfaceHit;

/// Looks up what rays have hit. Neighbours mostly hit the same triangle: it keeps the last.
pub struct Faces<'a> {
    scene: &'a TracedScene,
    last: Option<Face>,
}

impl<'a> Faces<'a> {
    /// Of a scene.
    pub fn new(scene: &'a TracedScene) -> Faces<'a> {
        Faces { scene, last: None }
    }

    /// Where a ray hit the scene.
    ///
    /// # Panics
    /// The hit is from another scene with more triangles.
    pub fn hit_by(&mut self, ray: &Ray, hit: &Hit) -> SurfaceHit {
        self.face(hit.triangle).hit_by(ray, hit)
    }

    /// Whether the vertices' normals of a triangle differ by less than an angle of such a cosine.
    ///
    /// # Panics
    /// As [`Faces::hit_by`].
    pub fn is_flat(&mut self, triangle: u32, cosine: f32) -> bool {
        self.face(triangle).is_flat(cosine)
    }

    fn face(&mut self, triangle: u32) -> &Face {
        // A reference that is returned early keeps `last` borrowed in the other branch, too.
        if self.last.as_ref().is_none_or(|face| face.triangle != triangle) {
            self.last = None;
        }
        self.last.get_or_insert_with(|| self.scene.face(triangle))
    }
}
