//! The rules that an asset keeps, checked before it is written and after it is read, so that whoever gets one
//! need not check again: arrays of equal length, indices in range, sorted rows, finite values, unit normals.

mod cuts;
mod parted;

use crate::asset::{
    AlphaMode, Asset, Estimates, Geometry, Level, Links, Material, Mesh, Senders, Texture, TextureRef,
    WeightRows,
};
use crate::error::{Place, Result, invalid};
use crate::layout::Kind;

/// Most texture coordinate sets of a mesh: glTF viewers support two, exporters write up to eight.
pub(crate) const MAX_UV_SETS: usize = 8;

/// How far a normal's squared length may be from 1: normals normalised in half precision pass, forgotten
/// normalisation does not.
const UNIT_TOLERANCE: f32 = 4e-3;

/// How far a bounce row may sum from its stated sum, relative: f32 sums of thousands of weights pass.
const ROW_SUM_TOLERANCE: f64 = 1e-4;

fn check(
    holds: bool,
    section: Kind,
    element: usize,
    expected: impl std::fmt::Display,
    found: impl std::fmt::Display,
) -> Result<()> {
    if holds {
        Ok(())
    } else {
        Err(invalid(
            section.name(),
            Place::Element(element as u64),
            expected,
            found,
        ))
    }
}

fn check_length(section: Kind, what: &str, length: usize, expected: usize) -> Result<()> {
    check(
        length == expected,
        section,
        length.min(expected),
        format_args!("{expected} {what}"),
        length,
    )
}

fn check_finite<const N: usize>(section: Kind, what: &str, values: &[[f32; N]]) -> Result<()> {
    match values
        .iter()
        .position(|value| !value.iter().all(|c| c.is_finite()))
    {
        None => Ok(()),
        Some(i) => check(
            false,
            section,
            i,
            format_args!("finite {what}"),
            format_args!("{:?}", values[i]),
        ),
    }
}

fn is_unit(n: &[f32; 3]) -> bool {
    // NaN compares false.
    (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0).abs() <= UNIT_TOLERANCE
}

fn check_unit(section: Kind, what: &str, normals: &[[f32; 3]]) -> Result<()> {
    match normals.iter().position(|n| !is_unit(n)) {
        None => Ok(()),
        Some(i) => check(
            false,
            section,
            i,
            format_args!("unit {what}"),
            format_args!("{:?}", normals[i]),
        ),
    }
}

impl Asset {
    /// Checks every part and the references between them.
    ///
    /// # Errors
    /// `Invalid` with the section and the element that breaks a rule.
    pub fn validate(&self) -> Result<()> {
        self.geometry.validate()?;
        for (i, mesh) in self.geometry.meshes.iter().enumerate() {
            let materials = self.materials.len();
            let expected = format_args!("a material below {materials}");
            check(
                (mesh.material as usize) < materials,
                Kind::Geometry,
                i,
                expected,
                mesh.material,
            )?;
        }
        for (i, material) in self.materials.iter().enumerate() {
            material.validate(i)?;
            for texture in material.textures() {
                let textures = self.textures.len();
                let expected = format_args!("a texture below {textures}");
                check(
                    (texture.texture as usize) < textures,
                    Kind::Materials,
                    i,
                    expected,
                    texture.texture,
                )?;
            }
        }
        for (i, texture) in self.textures.iter().enumerate() {
            texture.validate(i)?;
        }
        for (i, level) in self.points.iter().enumerate() {
            level.validate(i)?;
        }
        if self.coding.grey {
            let grey = |level: &Level| level.albedo.iter().all(|[r, g, b]| r == g && g == b);
            let coloured = self.points.iter().position(|level| !grey(level));
            let expected = "equal red, green and blue of every albedo of a grey asset, unlike on the level";
            check(
                coloured.is_none(),
                Kind::Points,
                coloured.unwrap_or(0),
                expected,
                "another",
            )?;
        }
        let points: usize = self.points.iter().map(|level| level.positions.len()).sum();
        let expected = format_args!("at most {} points", u32::MAX);
        check(points <= u32::MAX as usize, Kind::Points, 0, expected, points)?;
        if let Some(senders) = &self.senders {
            senders.validate(&self.points)?;
        }
        let counts = self.senders.as_ref().map_or(&[][..], |s| &s.counts);
        if let Some(links) = &self.transfer {
            let kind = Kind::LinksTransfer;
            links.validate()?;
            check_length(kind, "receivers, one per point", links.receivers as usize, points)?;
            let senders: usize = counts.iter().map(|&c| c as usize).sum();
            check_length(kind, "senders, one per cluster", links.senders as usize, senders)?;
        }
        if let Some(bounce) = &self.bounce {
            validate_on_level(Kind::LinksBounce, bounce.level, &bounce.matrix, counts, 1.0)?;
        }
        if let Some(solution) = &self.solution {
            let kind = Kind::LinksSolution;
            let channels = solution.channels.len();
            check([1, 3].contains(&channels), kind, 0, "1 or 3 channels", channels)?;
            for matrix in &solution.channels {
                validate_on_level(kind, solution.level, matrix, counts, f32::MAX)?;
            }
        }
        if let Some(parted) = &self.parted {
            parted::validate(parted, &self.points)?;
        }
        self.estimates.as_ref().map_or(Ok(()), Estimates::validate)?;
        cuts::validate(self)
    }
}

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
            let expected = format_args!("a mesh below {}", self.meshes.len());
            check(
                (instance.mesh as usize) < self.meshes.len(),
                Kind::Geometry,
                i,
                expected,
                instance.mesh,
            )?;
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
        check(
            u32::try_from(vertices).is_ok(),
            kind,
            index,
            "at most 2³² − 1 vertices",
            vertices,
        )?;
        let triangles = self.triangles.len();
        check(
            u32::try_from(triangles).is_ok(),
            kind,
            index,
            "at most 2³² − 1 triangles",
            triangles,
        )?;
        check_finite(kind, "positions", &self.positions)?;
        if let Some(normals) = &self.normals {
            check_length(kind, "normals, one per vertex", normals.len(), vertices)?;
            check_unit(kind, "normals", normals)?;
        }
        let expected = format_args!("at most {MAX_UV_SETS} sets of texture coordinates");
        check(
            self.uvs.len() <= MAX_UV_SETS,
            kind,
            index,
            expected,
            self.uvs.len(),
        )?;
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
            if let Some(i) = tangents.iter().position(|t| !fine(t)) {
                let found = format_args!("{:?}", tangents[i]);
                check(false, kind, i, "a unit tangent and a handedness of ±1", found)?;
            }
        }
        let in_range = |triangle: &[u32; 3]| triangle.iter().all(|&i| (i as usize) < vertices);
        match self.triangles.iter().position(|triangle| !in_range(triangle)) {
            None => Ok(()),
            Some(i) => {
                let found = format_args!("{:?}", self.triangles[i]);
                check(
                    false,
                    kind,
                    i,
                    format_args!("vertex indices below {vertices}"),
                    found,
                )
            }
        }
    }
}

impl Material {
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

    fn validate(&self, index: usize) -> Result<()> {
        let cutoff = if let AlphaMode::Mask(cutoff) = self.alpha_mode {
            cutoff
        } else {
            0.0
        };
        let transforms = self.textures().flat_map(|texture| texture.transform);
        let factors = self.base_color.into_iter().chain(self.emissive).chain(transforms);
        let scalars = [self.metallic, self.roughness, self.normal_scale, cutoff];
        let finite = factors.chain(scalars).all(|value| value.is_finite());
        check(
            finite,
            Kind::Materials,
            index,
            "finite parameters",
            format_args!("{self:?}"),
        )?;
        let emits = self.emissive.iter().all(|&e| e >= 0.0);
        check(
            emits,
            Kind::Materials,
            index,
            "emission of at least 0",
            format_args!("{:?}", self.emissive),
        )
    }
}

impl Texture {
    fn validate(&self, index: usize) -> Result<()> {
        let known = ["image/png", "image/jpeg"].contains(&self.mime.as_str());
        check(
            known,
            Kind::Textures,
            index,
            "image/png or image/jpeg",
            &self.mime,
        )
    }
}

impl Level {
    /// Checks radii, lengths, finiteness, unit normals, albedo of 0 to 1. `index` is the level's.
    ///
    /// # Errors
    /// `Invalid` with the level or the point.
    pub fn validate(&self, index: usize) -> Result<()> {
        let kind = Kind::Points;
        for (what, radius) in [("disk", self.disk_radius), ("support", self.support_radius)] {
            let holds = radius > 0.0 && radius.is_finite();
            check(
                holds,
                kind,
                index,
                format_args!("a finite {what} radius above 0 of the level"),
                radius,
            )?;
        }
        let points = self.positions.len();
        check_length(kind, "normals, one per point", self.normals.len(), points)?;
        check_length(kind, "albedos, one per point", self.albedo.len(), points)?;
        check_finite(kind, "positions", &self.positions)?;
        check_unit(kind, "normals", &self.normals)?;
        let fraction = |rgb: &[f32; 3]| rgb.iter().all(|c| (0.0..=1.0).contains(c));
        if let Some(i) = self.albedo.iter().position(|rgb| !fraction(rgb)) {
            check(
                false,
                kind,
                i,
                "an albedo of 0 to 1",
                format_args!("{:?}", self.albedo[i]),
            )?;
        }
        Ok(())
    }
}

impl Senders {
    /// Checks that there is a cluster for every point of the coarsest levels, that every finest point has a
    /// cluster and every cluster but the coarsest a parent.
    ///
    /// # Errors
    /// `Invalid` with the sender level, the point or the cluster.
    pub fn validate(&self, points: &[Level]) -> Result<()> {
        let kind = Kind::Senders;
        let Senders {
            counts,
            leaf_of_point,
            importance,
            parents,
        } = self;
        let (levels, most) = (counts.len(), points.len());
        let expected = format_args!("1 to {most} sender levels, as many as levels of points");
        check((1..=most).contains(&levels), kind, 0, expected, levels)?;
        for (i, (&count, level)) in counts.iter().zip(points).enumerate() {
            let expected = format_args!(
                "{} clusters, as many as points of the level",
                level.positions.len()
            );
            check(count as usize == level.positions.len(), kind, i, expected, count)?;
        }
        let finest = points[most - 1].positions.len();
        check_assignment(
            "clusters, one per finest point",
            leaf_of_point,
            finest,
            counts[levels - 1],
        )?;
        check_length(
            kind,
            "importances, one per finest point",
            importance.len(),
            finest,
        )?;
        check_length(kind, "levels of parents", parents.len(), levels - 1)?;
        for (parents, pair) in parents.iter().zip(counts.windows(2)) {
            check_assignment("parents, one per cluster", parents, pair[1] as usize, pair[0])?;
        }
        Ok(())
    }
}

fn check_assignment(what: &str, clusters: &[u32], length: usize, end: u32) -> Result<()> {
    check_length(Kind::Senders, what, clusters.len(), length)?;
    match clusters.iter().position(|&c| c >= end) {
        None => Ok(()),
        Some(i) => check(
            false,
            Kind::Senders,
            i,
            format_args!("a cluster below {end}"),
            clusters[i],
        ),
    }
}

/// A matrix on the clusters of a sender level, whose rows sum to at most `most`.
fn validate_on_level(kind: Kind, level: u32, matrix: &WeightRows, counts: &[u32], most: f32) -> Result<()> {
    let Some(&clusters) = counts.get(level as usize) else {
        let expected = format_args!("a sender level below {}", counts.len());
        return check(false, kind, 0, expected, level);
    };
    check_length(
        kind,
        "rows, one per cluster",
        matrix.rows as usize,
        clusters as usize,
    )?;
    matrix.validate_as(kind, most)
}

/// Offsets from 0 to the number of links, never falling; columns rising within a row and below `columns_end`.
fn check_rows(kind: Kind, rows: u32, columns_end: u32, row_offsets: &[u32], columns: &[u32]) -> Result<()> {
    check_length(
        kind,
        "row offsets, one per row and one more",
        row_offsets.len(),
        rows as usize + 1,
    )?;
    check(
        row_offsets[0] == 0,
        kind,
        0,
        "a first row offset of 0",
        row_offsets[0],
    )?;
    let last = row_offsets[rows as usize];
    check(
        last as usize == columns.len(),
        kind,
        rows as usize,
        format_args!("{} links", columns.len()),
        last,
    )?;
    for (row, pair) in row_offsets.windows(2).enumerate() {
        let expected = format_args!("row offsets from {} to {last}", pair[0]);
        check(
            pair[0] <= pair[1] && pair[1] <= last,
            kind,
            row,
            expected,
            pair[1],
        )?;
        let row_columns = &columns[pair[0] as usize..pair[1] as usize];
        let sorted = row_columns.windows(2).all(|pair| pair[0] < pair[1]);
        check(
            sorted,
            kind,
            row,
            "rising columns in the row",
            "a column that does not rise",
        )?;
        let end = row_columns.last().map_or(0, |&column| u64::from(column) + 1);
        check(
            end <= u64::from(columns_end),
            kind,
            row,
            format_args!("columns below {columns_end}"),
            end.max(1) - 1,
        )?;
    }
    Ok(())
}

impl Links {
    /// Checks rows, columns and vectors.
    ///
    /// # Errors
    /// `Invalid` with the row or link.
    pub fn validate(&self) -> Result<()> {
        let kind = Kind::LinksTransfer;
        check_length(
            kind,
            "vectors, one per link",
            self.vectors.len(),
            self.columns.len(),
        )?;
        check_rows(
            kind,
            self.receivers,
            self.senders,
            &self.row_offsets,
            &self.columns,
        )?;
        check_finite(kind, "vectors", &self.vectors)
    }
}

impl WeightRows {
    /// Checks rows and columns, weights of at least 0, and row sums of at most `most` that the weights add up to.
    fn validate_as(&self, kind: Kind, most: f32) -> Result<()> {
        check_length(
            kind,
            "weights, one per link",
            self.weights.len(),
            self.columns.len(),
        )?;
        check_length(
            kind,
            "row sums, one per row",
            self.row_sums.len(),
            self.rows as usize,
        )?;
        check_rows(kind, self.rows, self.rows, &self.row_offsets, &self.columns)?;
        if let Some(i) = self.weights.iter().position(|&w| !(w >= 0.0 && w.is_finite())) {
            check(false, kind, i, "a finite weight of at least 0", self.weights[i])?;
        }
        for (row, (pair, &stated)) in self.row_offsets.windows(2).zip(&self.row_sums).enumerate() {
            check(
                (0.0..=most).contains(&stated),
                kind,
                row,
                format_args!("a row sum of 0 to {most}"),
                stated,
            )?;
            let weights = &self.weights[pair[0] as usize..pair[1] as usize];
            let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
            let close = (sum - f64::from(stated)).abs() <= ROW_SUM_TOLERANCE * f64::from(stated);
            check(
                close,
                kind,
                row,
                format_args!("weights that sum to the row's {stated}"),
                sum,
            )?;
        }
        Ok(())
    }
}

impl Estimates {
    fn validate(&self) -> Result<()> {
        match self.values.iter().position(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some(i) => check(false, Kind::Estimates, i, "finite estimates", self.values[i].1),
        }
    }
}
