//! Rules of meshes, instances and materials (SPEC 6.2, 6.3).

use super::check::{check, check_below, check_each, check_finite, check_length, check_unit, is_unit};
use crate::asset::{AlphaMode, Geometry, Material, MaterialExtensions, MaterialGlass, Mesh, TextureRef};
use crate::error::Result;
use crate::layout::{Kind, MAX_UV_SETS};

impl Geometry {
    /// Checks meshes and instances; materials are the asset's to check.
    ///
    /// # Errors
    /// `Invalid` with the mesh's or instance's vertex, triangle or index.
    pub fn validate(&self) -> Result<()> {
        for (i, mesh) in self.meshes.iter().enumerate() {
            mesh.validate(i)?;
        }
        for (i, instance) in self.instances.iter().enumerate() {
            check_below(Kind::Geometry, i, "mesh", instance.mesh, self.meshes.len())?;
            let finite = instance.world_from_mesh.iter().all(|m| m.is_finite());
            let found = format_args!("{:?}", instance.world_from_mesh);
            check(finite, Kind::Geometry, i, "a finite world_from_mesh", found)?;
        }
        Ok(())
    }
}

impl Mesh {
    fn validate(&self, index: usize) -> Result<()> {
        let kind = Kind::Geometry;
        let vertices = self.positions.len();
        for (what, count) in [("vertices", vertices), ("triangles", self.triangles.len())] {
            let expected = format_args!("at most 2³² − 1 {what}");
            check(u32::try_from(count).is_ok(), kind, index, expected, count)?;
        }
        check_finite(kind, "positions", &self.positions)?;
        if let Some(normals) = &self.normals {
            check_length(kind, "normals, one per vertex", normals.len(), vertices)?;
            check_unit(kind, "normals", normals)?;
        }
        let (sets, expected) = (
            self.uvs.len(),
            format_args!("at most {MAX_UV_SETS} sets of texture coordinates"),
        );
        check(sets <= MAX_UV_SETS, kind, index, expected, sets)?;
        for uvs in &self.uvs {
            check_length(kind, "texture coordinates, one per vertex", uvs.len(), vertices)?;
            check_finite(kind, "texture coordinates", uvs)?;
        }
        if let Some(colors) = &self.colors {
            check_length(kind, "colours, one per vertex", colors.len(), vertices)?;
            check_finite(kind, "colours", colors)?;
        }
        if let Some(tangents) = &self.tangents {
            check_length(kind, "tangents, one per vertex", tangents.len(), vertices)?;
            let fine = |t: &[f32; 4]| is_unit(&[t[0], t[1], t[2]]) && t[3].abs() == 1.0;
            check_each(kind, tangents, "a unit tangent and a handedness of ±1", fine)?;
        }
        let in_range = |triangle: &[u32; 3]| triangle.iter().all(|&i| (i as usize) < vertices);
        let expected = format_args!("vertex indices below {vertices}");
        check_each(kind, &self.triangles, expected, in_range)
    }
}

impl Material {
    /// Whether light passes it as a thin pane.
    pub(crate) fn is_pane(&self) -> bool {
        matches!(self.alpha_mode, AlphaMode::Pane(_))
    }

    /// The textures that the material refers to.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let all = [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emissive_texture,
        ];
        all.into_iter().flatten()
    }

    pub(super) fn validate(&self, index: usize) -> Result<()> {
        let cutoff = match self.alpha_mode {
            AlphaMode::Mask(cutoff) | AlphaMode::Pane(cutoff) => cutoff,
            _ => 0.0,
        };
        let transforms = self.textures().flat_map(|texture| texture.transform);
        let factors = self.base_color.into_iter().chain(self.emissive).chain(transforms);
        let scalars = [self.metallic, self.roughness, self.normal_scale, cutoff];
        let finite = factors.chain(scalars).all(|value| value.is_finite());
        let kind = Kind::Materials;
        check(finite, kind, index, "finite parameters", format_args!("{self:?}"))?;
        if let AlphaMode::Pane(share) = self.alpha_mode {
            let found = format_args!("{share}");
            check(
                (0.0..=1.0).contains(&share),
                kind,
                index,
                "a transmission of 0 to 1",
                found,
            )?;
        }
        let emits = self.emissive.iter().all(|&e| e >= 0.0);
        let found = format_args!("{:?}", self.emissive);
        check(emits, kind, index, "emission of at least 0", found)
    }
}

impl MaterialExtensions {
    /// The textures that the extensions refer to.
    pub fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let all = [
            &self.specular_texture,
            &self.specular_color_texture,
            &self.clearcoat_texture,
            &self.clearcoat_roughness_texture,
            &self.clearcoat_normal_texture,
            &self.sheen_color_texture,
            &self.sheen_roughness_texture,
            &self.anisotropy_texture,
            &self.iridescence_texture,
            &self.iridescence_thickness_texture,
        ];
        all.into_iter().flatten().map(AsRef::as_ref)
    }

    pub(super) fn validate(&self, index: usize) -> Result<()> {
        let kind = Kind::Materials;
        let transforms = self.textures().flat_map(|texture| texture.transform);
        let shares = [
            self.specular,
            self.clearcoat,
            self.clearcoat_roughness,
            self.sheen_roughness,
            self.anisotropy,
            self.iridescence,
        ];
        let shares = || shares.into_iter().chain(self.sheen_color);
        let lengths = || self.specular_color.into_iter().chain(self.iridescence_thickness);
        let others = [
            self.ior,
            self.clearcoat_normal_scale,
            self.anisotropy_rotation,
            self.iridescence_ior,
        ];
        let all = shares().chain(lengths()).chain(others).chain(transforms);
        let found = format_args!("{self:?}");
        check(
            { all }.all(f32::is_finite),
            kind,
            index,
            "finite parameters of extensions",
            found,
        )?;
        let within = shares().all(|share| (0.0..=1.0).contains(&share)) && lengths().all(|x| x >= 0.0);
        check(
            within,
            kind,
            index,
            "parameters of extensions within their ranges",
            found,
        )?;
        let refracts = (self.ior == 0.0 || self.ior >= 1.0) && self.iridescence_ior >= 1.0;
        check(
            refracts,
            kind,
            index,
            "indices of refraction of at least 1, or an ior of 0",
            found,
        )
    }
}

impl MaterialGlass {
    pub(super) fn validate(&self, index: usize) -> Result<()> {
        let lengths = || self.absorption.into_iter().chain([self.thickness]);
        let transforms = (self.transmission_texture.iter()).flat_map(|texture| texture.transform);
        let fine = lengths().all(|x| x.is_finite() && x >= 0.0) && { transforms }.all(f32::is_finite);
        let (expected, found) = (
            "finite parameters of glass, none negative",
            format_args!("{self:?}"),
        );
        check(fine, Kind::Materials, index, expected, found)
    }
}
