//! How much an asset holds, as numbers that provenance can keep, so that a tool which only wants to know them reads
//! three small pieces of a file of any length (SPEC 6.1).

use std::collections::HashMap;

use crate::asset::{Asset, LightSamples};

/// How much an asset holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Content {
    /// Triangles of all instances.
    pub triangles: u64,
    /// Meshes.
    pub meshes: u64,
    /// Placed copies of meshes.
    pub instances: u64,
    /// Materials.
    pub materials: u64,
    /// Images.
    pub textures: u64,
    /// Points of each level, coarsest first.
    pub points: Vec<u64>,
    /// Poisson-disk radius of each level, metres.
    pub disk_radii: Vec<f32>,
    /// Links of T to the points of each level; all 0 without T.
    pub links_per_level: Vec<u64>,
    /// Links of T.
    pub links_transfer: u64,
    /// Links of the bounce operator.
    pub links_bounce: u64,
    /// Links of all channels of the solution.
    pub links_solution: u64,
    /// Links of T's longest row.
    pub longest_row: u64,
    /// Cuts, if there are any.
    pub cuts: Option<CutContent>,
}

/// How much the cuts of an asset hold.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CutContent {
    /// The lights are surface samples, else directions.
    pub of_surfaces: bool,
    /// Lights of the tree.
    pub lights: u64,
    /// Sites.
    pub sites: u64,
    /// Elements of all sites.
    pub elements: u64,
    /// σ.
    pub sigma: f32,
}

impl Content {
    /// Counts what an asset holds, which must be valid.
    pub fn of(asset: &Asset) -> Self {
        let meshes = &asset.geometry.meshes;
        let instances = &asset.geometry.instances;
        let offsets = asset.transfer.as_ref().map_or(&[][..], |t| &t.row_offsets);
        let mut first = 0;
        let links_of = |count: usize| {
            let start = first;
            first += count;
            let at = |row: usize| offsets.get(row).copied().unwrap_or(0);
            u64::from(at(start + count) - at(start))
        };
        let counts = asset.points.iter().map(|level| level.positions.len());
        Content {
            triangles: instances
                .iter()
                .map(|i| meshes[i.mesh as usize].triangles.len() as u64)
                .sum(),
            meshes: meshes.len() as u64,
            instances: instances.len() as u64,
            materials: asset.materials.len() as u64,
            textures: asset.textures.len() as u64,
            points: counts.clone().map(|count| count as u64).collect(),
            disk_radii: asset.points.iter().map(|level| level.disk_radius).collect(),
            links_per_level: counts.map(links_of).collect(),
            links_transfer: asset.transfer.as_ref().map_or(0, |t| t.columns.len() as u64),
            links_bounce: asset.bounce.as_ref().map_or(0, |b| b.matrix.columns.len() as u64),
            links_solution: asset
                .solution
                .iter()
                .flat_map(|s| &s.channels)
                .map(|c| c.columns.len() as u64)
                .sum(),
            longest_row: offsets
                .windows(2)
                .map(|pair| u64::from(pair[1] - pair[0]))
                .max()
                .unwrap_or(0),
            cuts: asset
                .cuts
                .as_ref()
                .zip(asset.light_tree.as_ref())
                .map(|(cuts, tree)| CutContent {
                    of_surfaces: matches!(tree.lights, LightSamples::Surface { .. }),
                    lights: tree.lights.len() as u64,
                    sites: cuts.row_offsets.len().saturating_sub(1) as u64,
                    elements: cuts.heights.len() as u64,
                    sigma: cuts.sigma,
                }),
        }
    }

    /// Names and numbers for [`Provenance::counts`](crate::Provenance::counts); floats as their bits. SPEC 6.1.
    pub fn to_counts(&self) -> Vec<(String, u64)> {
        let mut counts: Vec<(String, u64)> = [
            ("triangles", self.triangles),
            ("meshes", self.meshes),
            ("instances", self.instances),
            ("materials", self.materials),
            ("textures", self.textures),
            ("levels", self.points.len() as u64),
            ("links_transfer", self.links_transfer),
            ("links_bounce", self.links_bounce),
            ("links_solution", self.links_solution),
            ("longest_row", self.longest_row),
        ]
        .map(|(name, value)| (name.to_owned(), value))
        .into();
        let levels = self
            .points
            .iter()
            .zip(&self.disk_radii)
            .zip(&self.links_per_level);
        for (i, ((&points, radius), &links)) in levels.enumerate() {
            counts.push((format!("points_{i}"), points));
            counts.push((format!("disk_radius_bits_{i}"), radius.to_bits().into()));
            counts.push((format!("links_transfer_{i}"), links));
        }
        if let Some(cuts) = &self.cuts {
            counts.push(("cut_of_surfaces".into(), cuts.of_surfaces.into()));
            counts.push(("cut_lights".into(), cuts.lights));
            counts.push(("cut_sites".into(), cuts.sites));
            counts.push(("cut_elements".into(), cuts.elements));
            counts.push(("cut_sigma_bits".into(), cuts.sigma.to_bits().into()));
        }
        counts
    }

    /// What [`to_counts`](Self::to_counts) made, among other counts; `None` where one lacks, as in files of bakes before
    /// there were any, and for cuts at vertices, which no reader takes.
    pub fn from_counts(counts: &[(String, u64)]) -> Option<Self> {
        // A map: a hostile file may have a million of them.
        let all: HashMap<&str, u64> = counts
            .iter()
            .rev()
            .map(|(name, value)| (name.as_str(), *value))
            .collect();
        let find = |name: &str| all.get(name).copied();
        // Of such a file only its sections tell that it is not read any more.
        if find("cut_at_vertices") == Some(1) {
            return None;
        }
        let bits = |name: &str| {
            find(name)
                .and_then(|bits| u32::try_from(bits).ok())
                .map(f32::from_bits)
        };
        // A level has three counts: a number beyond them all is none.
        let levels = usize::try_from(find("levels")?)
            .ok()
            .filter(|&n| n <= counts.len())?;
        let each =
            |name: &str| -> Option<Vec<u64>> { (0..levels).map(|i| find(&format!("{name}_{i}"))).collect() };
        Some(Content {
            triangles: find("triangles")?,
            meshes: find("meshes")?,
            instances: find("instances")?,
            materials: find("materials")?,
            textures: find("textures")?,
            points: each("points")?,
            disk_radii: (0..levels)
                .map(|i| bits(&format!("disk_radius_bits_{i}")))
                .collect::<Option<_>>()?,
            links_per_level: each("links_transfer")?,
            links_transfer: find("links_transfer")?,
            links_bounce: find("links_bounce")?,
            links_solution: find("links_solution")?,
            longest_row: find("longest_row")?,
            cuts: match find("cut_lights") {
                None => None,
                Some(lights) => Some(CutContent {
                    of_surfaces: find("cut_of_surfaces")? != 0,
                    lights,
                    sites: find("cut_sites")?,
                    elements: find("cut_elements")?,
                    sigma: bits("cut_sigma_bits")?,
                }),
            },
        })
    }
}
