//! The rules that an asset keeps, checked before it is written and after it is read, so that whoever gets one
//! need not check again: arrays of equal length, indices in range, sorted rows, finite values, unit normals.

mod check;
mod cuts;
mod operators;
mod points;
mod scene;

use crate::asset::{Asset, Level};
use crate::error::Result;
use crate::layout::Kind;
use check::{check, check_below, check_each, check_length};

impl Asset {
    /// Checks every part and the references between them.
    ///
    /// # Errors
    /// `Invalid` with the section and the element that breaks a rule.
    pub fn validate(&self) -> Result<()> {
        self.validate_scene()?;
        for (i, level) in self.points.iter().enumerate() {
            level.validate(i)?;
        }
        if self.coding.grey {
            let grey = |level: &Level| level.albedo.iter().all(|[r, g, b]| r == g && g == b);
            let coloured = self.points.iter().position(|level| !grey(level));
            let expected = "equal red, green and blue of every albedo of a grey asset, unlike on the level";
            let level = coloured.unwrap_or(0);
            check(coloured.is_none(), Kind::Points, level, expected, "another")?;
        }
        let points: usize = self.points.iter().map(|level| level.positions.len()).sum();
        let expected = format_args!("at most {} points", u32::MAX);
        check(points <= u32::MAX as usize, Kind::Points, 0, expected, points)?;
        if let Some(senders) = &self.senders {
            senders.validate(&self.points)?;
        }
        self.validate_operators(points)?;
        if let Some(separations) = &self.separations {
            separations.validate(&self.points)?;
        }
        if let Some(estimates) = &self.estimates {
            let finite = |(_, value): &(String, f64)| value.is_finite();
            check_each(Kind::Estimates, &estimates.values, "finite estimates", finite)?;
        }
        cuts::validate(self)
    }

    /// Geometry, materials and textures, and their references.
    fn validate_scene(&self) -> Result<()> {
        self.geometry.validate()?;
        for (i, mesh) in self.geometry.meshes.iter().enumerate() {
            check_below(Kind::Geometry, i, "material", mesh.material, self.materials.len())?;
        }
        for (i, material) in self.materials.iter().enumerate() {
            material.validate(i)?;
            for texture in material.textures() {
                check_below(
                    Kind::Materials,
                    i,
                    "texture",
                    texture.texture,
                    self.textures.len(),
                )?;
            }
        }
        for (i, extensions) in self.material_extensions.iter().enumerate() {
            extensions.validate(i)?;
            let kind = Kind::Materials;
            check_below(kind, i, "material", extensions.material, self.materials.len())?;
            for texture in extensions.textures() {
                check_below(kind, i, "texture", texture.texture, self.textures.len())?;
            }
        }
        let rising = self.material_extensions.is_sorted_by_key(|e| e.material)
            && self
                .material_extensions
                .windows(2)
                .all(|pair| pair[0].material != pair[1].material);
        let expected = "extensions by rising material, each once";
        check(rising, Kind::Materials, 0, expected, "another order")?;
        for (i, glass) in self.material_glass.iter().enumerate() {
            glass.validate(i)?;
            let kind = Kind::Materials;
            check_below(kind, i, "material", glass.material, self.materials.len())?;
            if let Some(texture) = &glass.transmission_texture {
                check_below(kind, i, "texture", texture.texture, self.textures.len())?;
            }
        }
        let rising = self.material_glass.is_sorted_by(|a, b| a.material < b.material);
        let expected = "glass by rising material, each once";
        check(rising, Kind::Materials, 0, expected, "another order")?;
        let known = |mime: &str| ["image/png", "image/jpeg"].contains(&mime);
        for (i, texture) in self.textures.iter().enumerate() {
            let mime = &texture.mime;
            check(known(mime), Kind::Textures, i, "image/png or image/jpeg", mime)?;
        }
        Ok(())
    }

    /// T, K and S against `points` receivers and the clusters of the senders.
    fn validate_operators(&self, points: usize) -> Result<()> {
        let counts = self.senders.as_ref().map_or(&[][..], |s| &s.counts);
        if let Some(links) = &self.transfer {
            let kind = Kind::LinksTransfer;
            links.validate()?;
            check_length(kind, "receivers, one per point", links.receivers as usize, points)?;
            let senders: usize = counts.iter().map(|&c| c as usize).sum();
            check_length(kind, "senders, one per cluster", links.senders as usize, senders)?;
        }
        if let Some(bounce) = &self.bounce {
            (bounce.matrix).validate(Kind::LinksBounce, bounce.level, counts, 1.0)?;
        }
        if let Some(solution) = &self.solution {
            let kind = Kind::LinksSolution;
            let channels = solution.channels.len();
            check([1, 3].contains(&channels), kind, 0, "1 or 3 channels", channels)?;
            for matrix in &solution.channels {
                matrix.validate(kind, solution.level, counts, f32::MAX)?;
            }
        }
        Ok(())
    }
}
