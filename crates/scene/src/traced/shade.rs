//! A material evaluated where a ray met it.
//!
//! Source: glTF 2.0 sections 3.9 (materials) and 3.7.2.1 (normals and tangents), KHR_materials_unlit. Deviation: where a mesh has no tangents, they are derived triangle by triangle from
//! the normal map's coordinates and made perpendicular to the smooth normal, not smoothed over vertices as
//! MikkTSpace does it.

use super::corner::Corner;
use super::scene::{Shading, TracedScene};
use crate::bsdf::{MAX_EXPONENT, exponent_of_alpha};
use crate::material::{AlphaMode, Bump, Material, Model, TextureUse};
use crate::shading::{DIELECTRIC_F0, Gloss, MIN_ALPHA, ShadingPoint, bend_towards};
use crate::surface::SurfaceHit;
use crate::texture::ColorSpace;
use glam::{DVec3, Vec2, Vec3};

impl TracedScene {
    /// Evaluates the material where a ray hit this scene. Its shading normal is above the geometric horizon;
    /// use [`ShadingPoint::facing`] where the viewer is known.
    ///
    /// # Panics
    /// The hit is from another scene with more triangles.
    pub fn shading_point(&self, hit: &SurfaceHit) -> ShadingPoint {
        self.shading_point_of(hit, None)
    }

    /// As [`TracedScene::shading_point`], of another base colour than what is there: none is looked up then.
    ///
    /// # Panics
    /// As [`TracedScene::shading_point`].
    pub fn shading_point_of(&self, hit: &SurfaceHit, base_color: Option<Vec3>) -> ShadingPoint {
        let (index, corner) = self.corner_of(hit.primitive, hit.barycentric);
        let material = &self.materials()[index as usize];
        let base_color = base_color.unwrap_or_else(|| self.base_color(index, &corner).truncate());
        let mut point = ShadingPoint {
            base_color,
            material: index,
            ..ShadingPoint::lambert(hit, base_color)
        };
        if hit.front || material.double_sided {
            point.emission = self.emitted(index, &corner);
        }
        if material.unlit {
            point.diffuse = Vec3::ZERO;
            return point;
        }
        let pane = self.pane(index, &corner, self.traced_instance(hit.primitive).solid);
        if let Some(pane) = &pane {
            point.diffuse = pane.diffuse(point.diffuse);
        }
        if self.shading() == Shading::Lambert {
            return point;
        }
        let (map, scale) = (&material.normal_texture, material.normal_scale);
        if let Some(normal) = self.mapped_normal(map, scale, hit, &corner) {
            point.shading_normal = bend_towards(normal, hit.geometric_normal);
        }
        if let Some(bump) = &material.bump
            && let Some(normal) = self.bumped_normal(bump, hit, &corner, point.shading_normal)
        {
            point.shading_normal = bend_towards(normal, hit.geometric_normal);
        }
        self.reflection(material, hit, &corner, &mut point);
        if let (Some(pane), Model::MetallicRoughness) = (&pane, material.model) {
            point.diffuse = pane.diffuse(point.diffuse);
            point.f0 = pane.mirrored(point.f0);
            point.f90 = pane.mirrored(Vec3::splat(point.f90)).x;
            point.layers = None;
        }
        point
    }

    /// Fills in how the point reflects, by its material's model.
    fn reflection(
        &self,
        material: &Material,
        hit: &SurfaceHit,
        corner: &Corner<'_>,
        point: &mut ShadingPoint,
    ) {
        let texture = self.texture_value(&material.metallic_roughness_texture, corner, ColorSpace::Linear);
        let alpha = |roughness: f32| {
            let roughness = unit_interval(roughness * texture.y);
            (roughness * roughness).max(MIN_ALPHA)
        };
        match material.model {
            Model::Lambert => {}
            Model::MetallicRoughness => {
                let metallic = unit_interval(material.metallic * texture.z);
                point.diffuse = point.base_color * (1.0 - metallic);
                point.f0 = Vec3::splat(DIELECTRIC_F0 * (1.0 - metallic)) + point.base_color * metallic;
                point.alpha = alpha(material.roughness);
                point.lambert = false;
                if let Some(extensions) = &material.extensions {
                    self.extend(material, extensions, metallic, hit, corner, point);
                }
            }
            Model::Phong { specular, exponent } => {
                self.balance(material, specular, corner, point);
                let exponent = match exponent {
                    Some(exponent) if exponent.is_nan() => 0.0,
                    Some(exponent) => exponent.clamp(0.0, MAX_EXPONENT),
                    None => exponent_of_alpha(alpha(material.roughness)),
                };
                point.gloss = Gloss::Phong { exponent };
            }
            Model::Ward {
                specular,
                roughness,
                rotation,
            } => {
                self.balance(material, specular, corner, point);
                let (x, y) = self.tangents(hit, corner, material);
                let (sin, cos) = rotation.sin_cos();
                point.gloss = Gloss::Ward {
                    alpha: roughness.map(alpha),
                    tangent: x * cos + y * sin,
                };
            }
        }
    }

    /// Specular factor of Phong and Ward, and the diffuse albedo that it leaves.
    fn balance(&self, material: &Material, specular: Vec3, corner: &Corner<'_>, point: &mut ShadingPoint) {
        let texture = self.texture_value(&material.specular_texture, corner, ColorSpace::Srgb);
        let specular = specular * texture.truncate();
        point.f0 = Vec3::from(specular.to_array().map(unit_interval));
        point.diffuse = point.base_color.min(Vec3::ONE - point.f0);
        point.lambert = false;
    }

    /// How metallic a triangle's material is, if within the triangle nothing but its base colour changes, which colours what it reflects in
    /// proportion; `None` of materials of which more does.
    ///
    /// # Panics
    /// `triangle` is not below [`TracedScene::triangle_count`].
    pub fn metallic_but_for_color(&self, triangle: u32) -> Option<f32> {
        let material = self.material(triangle);
        let is_pane = matches!(material.alpha_mode, AlphaMode::Pane { .. });
        let emits_by_texture = material.emission != Vec3::ZERO && material.emission_texture.is_some();
        // Tints are those of ways, not of materials.
        if self.tinted || is_pane || material.unlit || emits_by_texture {
            return None;
        }
        if self.shading() == Shading::Lambert || material.model == Model::Lambert {
            return Some(0.0);
        }
        let extended = (material.extensions.as_ref()).is_some_and(|extensions| {
            extensions.iridescence > 0.0 || extensions.textures().into_iter().any(Option::is_some)
        });
        let has_relief = material.normal_texture.is_some() || material.bump.is_some();
        (material.model == Model::MetallicRoughness
            && material.metallic_roughness_texture.is_none()
            && !has_relief
            && !extended)
            .then_some(unit_interval(material.metallic))
    }

    /// Radiance that a point of a triangle emits from its front (and back, if double-sided), not scaled by
    /// coverage. Unlit materials emit their base colour.
    ///
    /// # Panics
    /// `triangle` is not below [`TracedScene::triangle_count`].
    pub fn emission(&self, triangle: u32, barycentric: [f32; 2]) -> Vec3 {
        let (material, corner) = self.corner_of(triangle, barycentric);
        self.emitted(material, &corner)
    }

    fn emitted(&self, index: u32, corner: &Corner<'_>) -> Vec3 {
        let material = &self.materials()[index as usize];
        if material.unlit {
            return self.base_color(index, corner).truncate();
        }
        if material.emission == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let texture = self.texture_value(&material.emission_texture, corner, ColorSpace::Srgb);
        (material.emission * texture.truncate()).max(Vec3::ZERO)
    }

    /// Tangent along rising u and bitangent for anisotropic lobes, on the ray's side: of the mesh, else of the
    /// coordinates that the material looks its textures up with, else any.
    pub(super) fn tangents(
        &self,
        hit: &SurfaceHit,
        corner: &Corner<'_>,
        material: &Material,
    ) -> (Vec3, Vec3) {
        let any = || hit.normal.any_orthonormal_pair();
        if let Some((tangent, handedness)) = self.authored_tangent(hit.primitive, corner) {
            let side = if hit.front { 1.0 } else { -1.0 };
            return match tangent.reject_from_normalized(hit.normal).try_normalize() {
                Some(tangent) => (tangent, (hit.normal * side).cross(tangent) * handedness),
                None => any(),
            };
        }
        let uvs = match material.any_texture() {
            Some(usage) => {
                (corner.vertex_uvs(usage.uv_set)).map(|uv| usage.texture_from_mesh.transform_point2(uv))
            }
            None => corner.vertex_uvs(0),
        };
        derived_tangents(&self.triangle_positions(hit.primitive), uvs, hit.normal).unwrap_or_else(any)
    }

    /// `normal` leaned by the slope of a height map, on the ray's side (Blinn 1978); `None` where there are no
    /// usable coordinates.
    fn bumped_normal(
        &self,
        bump: &Bump,
        hit: &SurfaceHit,
        corner: &Corner<'_>,
        normal: Vec3,
    ) -> Option<Vec3> {
        let side = if hit.front { 1.0 } else { -1.0 };
        let slope = self.texture_slope(&bump.texture, corner)? * bump.scale;
        let usage = &bump.texture;
        let uvs = (corner.vertex_uvs(usage.uv_set)).map(|uv| usage.texture_from_mesh.transform_point2(uv));
        let gradient = surface_gradient(&self.triangle_positions(hit.primitive), uvs, slope)?;
        // The height rises from the front; seen from behind it sinks.
        let leaned = (normal * side).as_dvec3() - gradient;
        leaned.try_normalize().map(|leaned| leaned.as_vec3() * side)
    }

    /// Normal of a normal map, on the ray's side; `None` without a map or where there are no usable
    /// coordinates.
    pub(super) fn mapped_normal(
        &self,
        map: &Option<TextureUse>,
        scale: f32,
        hit: &SurfaceHit,
        corner: &Corner<'_>,
    ) -> Option<Vec3> {
        let usage = map.as_ref()?;
        // Everything as seen from the front; the back has the front's normal reversed.
        let side = if hit.front { 1.0 } else { -1.0 };
        let normal = hit.normal * side;
        let (tangent, bitangent) = match self.authored_tangent(hit.primitive, corner) {
            Some((tangent, handedness)) => {
                let tangent = tangent.reject_from_normalized(normal).try_normalize()?;
                (tangent, normal.cross(tangent) * handedness)
            }
            None => {
                let uvs = corner
                    .vertex_uvs(usage.uv_set)
                    .map(|uv| usage.texture_from_mesh.transform_point2(uv));
                derived_tangents(&self.triangle_positions(hit.primitive), uvs, normal)?
            }
        };
        let value = self.texture_value(map, corner, ColorSpace::Linear);
        let mut local = value.truncate() * 2.0 - 1.0;
        local.x *= scale;
        local.y *= scale;
        let mapped = tangent * local.x + bitangent * local.y + normal * local.z;
        mapped.try_normalize().map(|mapped| mapped * side)
    }

    /// World-space tangent of any length and handedness (±1) from the mesh.
    fn authored_tangent(&self, triangle: u32, corner: &Corner<'_>) -> Option<(Vec3, f32)> {
        let tangent = corner.tangent()?;
        let instance = &self.scene().instances[self.instance_of(triangle) as usize];
        let linear = &instance.world_from_mesh.matrix3;
        // Mirroring turns the cross product of normal and tangent around.
        let mirrored = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let world = Vec3::from(*linear * glam::Vec3A::from(tangent.truncate()));
        Some((world, tangent.w.signum() * mirrored))
    }
}

/// Unit tangent along rising u and unit bitangent along falling v (green of a normal map points up, v points
/// down), perpendicular to `normal`; `None` where the coordinates span nothing.
fn derived_tangents(vertices: &[Vec3; 3], uvs: [Vec2; 3], normal: Vec3) -> Option<(Vec3, Vec3)> {
    let [a, b, c] = vertices.map(|vertex| vertex.as_dvec3());
    let [ua, ub, uc] = uvs.map(|uv| uv.as_dvec2());
    let (e1, e2) = (b - a, c - a);
    let (d1, d2) = (ub - ua, uc - ua);
    let area = d1.perp_dot(d2);
    if area == 0.0 {
        return None;
    }
    // ∂P/∂u and ∂P/∂v times |area|.
    let along_u = (e1 * d2.y - e2 * d1.y) * area.signum();
    let along_v = (e2 * d1.x - e1 * d2.x) * area.signum();
    let normal_f64 = normal.as_dvec3();
    let tangent = (along_u - normal_f64 * along_u.dot(normal_f64))
        .try_normalize()?
        .as_vec3();
    let bitangent = normal.cross(tangent);
    let up = if bitangent.as_dvec3().dot(-along_v) < 0.0 {
        -bitangent
    } else {
        bitangent
    };
    Some((tangent, up))
}

/// Gradient on a triangle, per metre, of a function whose derivatives by the coordinates are `slope`; `None`
/// where the coordinates span nothing.
fn surface_gradient(vertices: &[Vec3; 3], uvs: [Vec2; 3], slope: Vec2) -> Option<DVec3> {
    let [a, b, c] = vertices.map(|vertex| vertex.as_dvec3());
    let [ua, ub, uc] = uvs.map(|uv| uv.as_dvec2());
    let (e1, e2, slope) = (b - a, c - a, slope.as_dvec2());
    // What the function rises by along both edges, and from there the vector in their plane that does so.
    let (rise1, rise2) = (slope.dot(ub - ua), slope.dot(uc - ua));
    let normal = e1.cross(e2);
    let gradient = (e2.cross(normal) * rise1 + normal.cross(e1) * rise2) / normal.length_squared();
    ((ub - ua).perp_dot(uc - ua) != 0.0 && gradient.is_finite()).then_some(gradient)
}

/// Clamps to 0..=1; NaN becomes 0.
pub(super) fn unit_interval(value: f32) -> f32 {
    if value.is_nan() {
        0.0
    } else {
        value.clamp(0.0, 1.0)
    }
}
