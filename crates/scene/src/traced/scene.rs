//! The prepared scene and its rays.

use super::corner::{Corner, hash_to_unit};
use super::face::Face;
use super::occluders::{FlatPiece, Occluders};
use crate::bsdf;
use crate::image::ImageError;
use crate::material::{AlphaMode, Material};
use crate::rays::{BvhPart, Hit, Ray, TriangleBvh, TriangleSurface};
use crate::scene::{Mesh, Scene};
use crate::surface::{SurfaceHit, Surfaces, unshaded};
use crate::texture::DecodedTexture;
use glam::{Mat3A, Vec3};
use std::sync::{Arc, OnceLock};

/// How materials are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shading {
    /// As glTF describes them.
    Full,
    /// Every material is Lambert with its base colour: metallic, roughness, transmission and normal maps are ignored,
    /// emission and alpha are kept (`--lambert`).
    Lambert,
}

/// Why a scene cannot be prepared for rendering.
#[derive(Debug, thiserror::Error)]
pub enum TracedSceneError {
    /// A texture that a material uses is damaged or too large.
    #[error(transparent)]
    Texture(#[from] ImageError),
    /// Something refers to an element that does not exist.
    #[error(
        "{from} refers to {kind} {index}, but the scene has {count}; the importer should have refused it"
    )]
    Reference {
        /// What refers, with its number.
        from: String,
        /// What is referred to.
        kind: &'static str,
        /// The number that is out of range.
        index: u32,
        /// How many there are.
        count: usize,
    },
    /// A vertex array is neither empty nor as long as the positions.
    #[error("mesh {mesh} has {found} {attribute} for {expected} positions; there must be as many, or none")]
    AttributeLength {
        /// Index of the mesh.
        mesh: usize,
        /// Which array.
        attribute: &'static str,
        /// Its length.
        found: usize,
        /// Length of the positions.
        expected: usize,
    },
    /// More triangles or vertices than 32-bit indices can count.
    #[error("the scene expands to more than 2^32 triangles or vertices; split it or place fewer instances")]
    TooLarge,
}

/// What the triangles of one instance share.
pub(super) struct TracedInstance {
    /// World index of its first triangle.
    pub(super) first_triangle: u32,
    pub(super) mesh: u32,
    pub(super) material: u32,
    /// Maps normals to world-space directions of any length, fronts to fronts.
    pub(super) normal_from_mesh: Mat3A,
    pub(super) mirrored: bool,
    /// No ray can pass any of its triangles.
    pub(super) opaque: bool,
    /// It is a body of solid glass.
    pub(super) solid: bool,
}

/// A [`Scene`] prepared for rendering. See the module's description. Clones share all but the materials.
#[derive(Clone)]
pub struct TracedScene {
    pub(super) scene: Arc<Scene>,
    pub(super) shading: Shading,
    /// The scene's, or what [`TracedScene::set_materials`] has put in their place.
    pub(super) materials: Vec<Material>,
    pub(super) bvh: Arc<TriangleBvh>,
    pub(super) instances: Arc<[TracedInstance]>,
    /// Per world triangle the instance it belongs to.
    pub(super) instance_of_triangle: Arc<[u32]>,
    /// Per texture of the scene its texels, where a material uses or has used it.
    pub(super) textures: Vec<Option<Arc<DecodedTexture>>>,
    /// World indices of triangles whose material can emit.
    pub(super) emissive: Arc<[u32]>,
    /// All instances are opaque.
    pub(super) opaque: bool,
    /// Some are panes, and some of those have a colour.
    pub(super) panes: bool,
    pub(super) tinted: bool,
    /// Some are solid glass.
    pub(super) solid: bool,
    /// Made when first asked for.
    pub(super) occluders: Arc<OnceLock<Occluders>>,
}

/// What stops a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// A triangle that no ray passes.
    Opaque(u32),
    /// A triangle that other rays pass.
    Other,
}

impl TracedScene {
    /// The materials in use: the scene's, or those set in their place.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The scene as it was given.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// How materials are evaluated.
    pub fn shading(&self) -> Shading {
        self.shading
    }

    /// Number of world-space triangles, including those that are never hit.
    pub fn triangle_count(&self) -> usize {
        self.instance_of_triangle.len()
    }

    /// Number of triangles that are never hit because a vertex is not finite.
    pub fn dropped_triangles(&self) -> usize {
        self.bvh.dropped()
    }

    /// The ray caster, for algorithms that want triangles and no alpha.
    pub fn bvh(&self) -> &TriangleBvh {
        &self.bvh
    }

    /// World indices, rising, of the triangles whose material can emit: an emission factor above zero, or
    /// unlit. A texture may still darken all of it.
    pub fn emissive_triangles(&self) -> &[u32] {
        &self.emissive
    }

    /// Index into [`Scene::instances`] of the instance that a triangle belongs to.
    ///
    /// # Panics
    /// `triangle` is not below [`TracedScene::triangle_count`].
    pub fn instance_of(&self, triangle: u32) -> u32 {
        self.instance_of_triangle[triangle as usize]
    }

    /// Index into [`Scene::materials`] of a triangle's material.
    ///
    /// # Panics
    /// As [`TracedScene::instance_of`].
    pub fn material_of(&self, triangle: u32) -> u32 {
        self.traced_instance(triangle).material
    }

    /// A triangle's material.
    ///
    /// # Panics
    /// As [`TracedScene::instance_of`].
    pub fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.material_of(triangle) as usize]
    }

    /// World-space vertices of a triangle, counter-clockwise seen from its front; NaN for triangles that are
    /// never hit. Barycentric weights of hits refer to this order.
    pub fn triangle_positions(&self, triangle: u32) -> [Vec3; 3] {
        self.bvh.triangle(triangle).unwrap_or([Vec3::NAN; 3])
    }

    /// Area of a triangle in m², good for slivers, too; 0 for triangles that are never hit.
    pub fn triangle_area(&self, triangle: u32) -> f32 {
        let Some(vertices) = self.bvh.triangle(triangle) else {
            return 0.0;
        };
        // In f64, so that neither slivers nor scenes of any size lose their area.
        let [a, b, c] = vertices.map(|vertex| vertex.as_dvec3());
        (0.5 * (b - a).cross(c - a).length()) as f32
    }

    /// Whether, or how much, of a surface there is at a point of a triangle: 0 or 1 for opaque and masked
    /// materials, alpha for blended ones.
    ///
    /// # Panics
    /// As [`TracedScene::instance_of`].
    pub fn coverage(&self, triangle: u32, barycentric: [f32; 2]) -> f32 {
        if self.traced_instance(triangle).opaque {
            return 1.0;
        }
        let alpha = self.alpha(triangle, barycentric);
        match self.material(triangle).alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask { cutoff } => f32::from(u8::from(alpha >= cutoff)),
            AlphaMode::Blend => alpha.clamp(0.0, 1.0),
            AlphaMode::Pane { .. } => 1.0,
        }
    }

    /// A point of a triangle as if a ray had hit it from its front or back; `t` is 0. For algorithms that
    /// sample surfaces. The position is NaN for triangles that are never hit.
    ///
    /// # Panics
    /// As [`TracedScene::instance_of`].
    pub fn surface_at(&self, triangle: u32, barycentric: [f32; 2], front: bool) -> SurfaceHit {
        let [u, v] = barycentric;
        let hit = Hit {
            t: 0.0,
            triangle,
            u,
            v,
            sheet: 0.0,
        };
        self.face(triangle).hit_from(front, &hit)
    }

    /// What stops a ray, not always what it meets first: `None` where [`Surfaces::occluded`] says no.
    pub fn stop(&self, ray: &Ray) -> Option<Stop> {
        self.stopping_hit(ray).map(|hit| self.stop_at(&hit))
    }

    /// As [`TracedScene::stop`], among some parts of the ray caster ([`TriangleBvh::some_hit_among`]).
    pub fn stop_among(&self, ray: &Ray, parts: &[BvhPart]) -> Option<Stop> {
        let hit = if self.opaque {
            self.bvh.some_hit_among(ray, parts, |_| true)
        } else {
            self.bvh.some_hit_among(ray, parts, |hit| self.stops(ray, hit))
        };
        hit.map(|hit| self.stop_at(&hit))
    }

    fn stop_at(&self, hit: &Hit) -> Stop {
        if self.opaque || self.traced_instance(hit.triangle).opaque {
            Stop::Opaque(hit.triangle)
        } else {
            Stop::Other
        }
    }

    fn stopping_hit(&self, ray: &Ray) -> Option<Hit> {
        if self.opaque {
            self.bvh.some_hit_where(ray, |_| true)
        } else {
            self.bvh.some_hit_where(ray, |hit| self.stops(ray, hit))
        }
    }

    /// Calls `with` with the largest known flat and convex piece of opaque surface that an opaque triangle is part of.
    pub fn with_flat_piece<R>(&self, triangle: u32, with: impl FnOnce(FlatPiece<'_>) -> R) -> R {
        let opaque = |triangle: u32| {
            self.traced_instance(triangle)
                .opaque
                .then(|| self.triangle_positions(triangle))
        };
        match self
            .occluders
            .get_or_init(|| Occluders::new(self.triangle_count() as u32, opaque))
            .piece(triangle)
        {
            Some(piece) => with(piece),
            None => with(FlatPiece {
                corners: &self.triangle_positions(triangle),
                slack: 0.0,
            }),
        }
    }

    pub(super) fn traced_instance(&self, triangle: u32) -> &TracedInstance {
        &self.instances[self.instance_of_triangle[triangle as usize] as usize]
    }

    /// The instance, the mesh and the mesh's vertex indices of a triangle, in the order of the front.
    fn mesh_triangle(&self, triangle: u32) -> (&TracedInstance, &Mesh, [u32; 3]) {
        let instance = self.traced_instance(triangle);
        let mesh = &self.scene.meshes[instance.mesh as usize];
        let [a, b, c] = mesh.triangles[(triangle - instance.first_triangle) as usize];
        let indices = if instance.mirrored { [a, c, b] } else { [a, b, c] };
        (instance, mesh, indices)
    }

    /// Index of the material and the attributes at a point of a triangle.
    pub(crate) fn corner_of(&self, triangle: u32, barycentric: [f32; 2]) -> (u32, Corner<'_>) {
        let (instance, corner) = self.corner(triangle, barycentric);
        (instance.material, corner)
    }

    pub(super) fn corner(&self, triangle: u32, barycentric: [f32; 2]) -> (&TracedInstance, Corner<'_>) {
        let (instance, mesh, indices) = self.mesh_triangle(triangle);
        (instance, Corner::new(mesh, indices, barycentric))
    }

    pub(super) fn surface_hit(&self, ray: &Ray, hit: &Hit) -> SurfaceHit {
        self.face(hit.triangle).hit_by(ray, hit)
    }

    pub(super) fn face(&self, triangle: u32) -> Face {
        let (instance, corner) = self.corner(triangle, [0.0; 2]);
        Face {
            triangle,
            surface: TriangleSurface::new(&self.bvh, triangle),
            normals: corner.vertex_normals(),
            normal_from_mesh: instance.normal_from_mesh,
        }
    }

    /// What stops a ray first.
    fn first_stop(&self, ray: &Ray) -> Option<Hit> {
        if self.opaque {
            self.bvh.closest_hit(ray)
        } else {
            self.bvh.closest_hit_where(ray, |hit| self.stops(ray, hit))
        }
    }

    /// What each of some rays meets first that start at one place and lie close to each other in the slice: `visit(i, hit)` in
    /// order; [`Faces`](super::Faces) says what is there. Right for any rays.
    pub fn closest_hits_packet(&self, rays: &[Ray], mut visit: impl FnMut(usize, Option<Hit>)) {
        for (chunk, rays) in rays.chunks(PACKETS).enumerate() {
            let mut hits = [None; PACKETS];
            if self.opaque {
                self.bvh.closest_hit_packet(rays, &mut hits, |_, _| true);
            } else {
                let stops = |i: usize, hit: &Hit| self.stops(&rays[i], hit);
                self.bvh.closest_hit_packet(rays, &mut hits, stops);
            }
            for (i, hit) in hits.into_iter().enumerate().take(rays.len()) {
                visit(chunk * PACKETS + i, hit);
            }
        }
    }

    /// Whether the ray meets a surface where it meets this triangle.
    pub(super) fn stops(&self, ray: &Ray, hit: &Hit) -> bool {
        if self.traced_instance(hit.triangle).opaque {
            return true;
        }
        let alpha = || self.alpha(hit.triangle, [hit.u, hit.v]);
        match self.material(hit.triangle).alpha_mode {
            AlphaMode::Opaque => true,
            AlphaMode::Mask { cutoff } => alpha() >= cutoff,
            AlphaMode::Blend => alpha() > hash_to_unit(ray, hit.triangle),
            AlphaMode::Pane { .. } => self.pane_passes(ray, hit) <= hash_to_unit(ray, hit.triangle),
        }
    }
}

/// Rays whose hits are looked up together.
const TOGETHER: usize = 64;
/// Rays that are cast in packets together: as many as the ray caster sorts.
const PACKETS: usize = 128;

impl Surfaces for TracedScene {
    fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bvh.bounds()
    }

    fn closest_hit(&self, ray: &Ray) -> Option<SurfaceHit> {
        self.first_stop(ray).map(|hit| self.surface_hit(ray, &hit))
    }

    fn closest_hits(&self, rays: &[Ray], visit: &mut dyn FnMut(usize, SurfaceHit)) {
        for (chunk, rays) in rays.chunks(TOGETHER).enumerate() {
            let mut hits = [None; TOGETHER];
            for (hit, ray) in hits.iter_mut().zip(rays) {
                *hit = self.first_stop(ray);
            }
            for (i, (hit, ray)) in hits.iter().zip(rays).enumerate() {
                if let Some(hit) = hit {
                    visit(chunk * TOGETHER + i, self.surface_hit(ray, hit));
                }
            }
        }
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.stopping_hit(ray).is_some()
    }

    fn occluded_packet(&self, rays: &[Ray], occluded: &mut [bool]) {
        if self.opaque {
            self.bvh.any_hit_packet(rays, occluded);
        } else {
            (self.bvh).any_hit_packet_where(rays, occluded, |i, hit| self.stops(&rays[i], hit));
        }
    }

    fn passed(&self, ray: &Ray) -> Vec3 {
        match self.panes {
            true => self.passed_panes(ray),
            false if self.occluded(ray) => Vec3::ZERO,
            false => Vec3::ONE,
        }
    }

    fn passed_packet(&self, rays: &[Ray], passed: &mut [Vec3], occluded: &mut Vec<bool>) {
        if !self.panes {
            unshaded(self, rays, passed, occluded);
            return;
        }
        self.passed_panes_packet(rays, passed, occluded);
    }

    fn tint(&self, ray: &Ray, t: f32) -> Vec3 {
        if self.tinted {
            self.tint_of_panes(ray, t)
        } else {
            Vec3::ONE
        }
    }

    fn albedo(&self, hit: &SurfaceHit) -> Vec3 {
        bsdf::hemispherical_albedo(&self.shading_point(hit))
    }
}
