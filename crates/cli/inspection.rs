//! What is known of an asset from its file, and of its bake from the log beside it.

use crate::failure::Failure;
use crate::output::{SCHEMA, log_path};
use relight_format::layout::Kind;
use relight_format::{self as format, Asset, Content, CutContent, Estimates, Summary};
use relight_play::frame::settings::ILLUMINATION_ERROR;
use relight_probes::expected::{self, Expected};
use relight_scene::sequence::stage_from_json;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// What is known of an asset.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Inspection {
    /// Version of the JSON.
    pub schema: u32,
    /// The asset's file.
    pub asset: String,
    /// Identifies its content.
    #[serde(with = "hexadecimal")]
    pub asset_hash: u64,
    /// Identifies the scene that was baked.
    #[serde(with = "hexadecimal")]
    pub source_hash: u64,
    /// The program that baked it.
    pub tool_version: String,
    /// Version of the format that the file needs.
    pub format_version: u32,
    /// Seed of the bake.
    pub seed: u64,
    /// Whether all materials are Lambert.
    pub lambert: bool,
    /// Settings of the bake by their names.
    pub settings: BTreeMap<String, String>,
    /// Triangles of all instances.
    pub triangles: u64,
    /// Meshes.
    pub meshes: u64,
    /// Placed copies of meshes.
    pub instances: u64,
    /// Materials.
    pub materials: u64,
    /// Variants of materials, by their names.
    #[serde(default)]
    pub variants: Vec<String>,
    /// Images.
    pub textures: u64,
    /// Points of each level, coarsest first.
    pub points: Vec<u64>,
    /// Poisson-disk radius of each level, metres.
    pub disk_radius: Vec<f32>,
    /// Links of all operators.
    pub links: u64,
    /// Links of each.
    pub links_by_operator: Links,
    /// Links of T to the points of each level.
    pub links_per_level: Vec<u64>,
    /// Links of T's longest row.
    pub longest_row: u64,
    /// Pairs of points and senders.
    pub potential_links: Option<u64>,
    /// Visibility cuts, if there are any.
    pub cuts: Option<Cuts>,
    /// Rays of the bake.
    pub rays: Option<u64>,
    /// Receivers that cast rays.
    pub receivers_gathered: Option<u64>,
    /// Rays that met surfaces without points.
    pub rays_without_points: Option<u64>,
    /// Surface of the scene, m².
    pub surface_m2: Option<f64>,
    /// Of that what has no points, m².
    pub surface_without_points_m2: Option<f64>,
    /// Bytes of the file.
    pub bytes: Bytes,
    /// Names that options, sequences and edits take.
    #[serde(default)]
    pub names: Names,
    /// What was left out.
    pub left_out: Vec<LeftOut>,
    /// What the bake estimated, by name.
    pub estimates: BTreeMap<String, f64>,
    /// What the bake expects of its errors, if it has measured itself.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub expected: Option<Expected>,
    /// The same in words.
    pub expected_error: Option<String>,
    /// What the bake noted.
    pub notes: Vec<String>,
    /// What the log says of the bake, if it is there.
    #[serde(flatten)]
    pub run: Option<BakeRun>,
}

/// Names that options, sequences and edits take.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Names {
    /// Cameras, the first of which `play` takes by itself.
    pub cameras: Vec<String>,
    /// The scene's own lights.
    pub lights: Vec<String>,
    /// Materials.
    pub materials: Vec<String>,
}

impl Names {
    /// The sections that have them.
    pub const SECTIONS: [Kind; 2] = [Kind::Materials, Kind::Stage];

    /// Of an asset, or its [`Names::SECTIONS`].
    pub fn of(asset: &Asset) -> Names {
        // What cannot be read is told by who plays it.
        let (cameras, sequence) = stage_from_json(&asset.stage.json).unwrap_or_default();
        Names {
            cameras: cameras.into_iter().map(|camera| camera.name).collect(),
            lights: sequence.lights.into_iter().map(|light| light.name).collect(),
            materials: asset
                .materials
                .iter()
                .map(|material| material.name.clone())
                .collect(),
        }
    }
}

/// Links of each operator.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Links {
    /// T.
    pub transfer: u64,
    /// All channels of the solution.
    pub solution: u64,
    /// The bounce operator.
    pub bounce: u64,
}

/// Visibility cuts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Cuts {
    /// `indirect` or `environment`.
    pub mode: String,
    /// Lights of the tree.
    pub lights: u64,
    /// Sites.
    pub sites: u64,
    /// Elements of all sites.
    pub elements: u64,
    /// Elements of a site, on average.
    pub mean_length: f64,
    /// Threshold of nodes.
    pub sigma: f32,
    /// Estimate of their error.
    pub rms_error: Option<f64>,
    /// The most that it may be by what each node may err by, of environments: where everything is seen and no cut has the most nodes.
    #[serde(default)]
    pub predicted_rms_error: Option<f64>,
    /// The most that a product of an environment's light and visibility may err by, as a share of that light.
    #[serde(default)]
    pub predicted_light_error: Option<f64>,
}

/// Bytes of a file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Bytes {
    /// Of each section by its name.
    #[serde(flatten)]
    pub sections: BTreeMap<String, SectionBytes>,
    /// Of the whole.
    pub total: u64,
}

/// Bytes of a section.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct SectionBytes {
    /// As its records are.
    pub raw: u64,
    /// As the file holds them.
    pub stored: u64,
}

/// Something that was left out.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct LeftOut {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
    /// Bytes that it would have taken.
    pub saved_bytes: u64,
    /// Rays that it would have taken.
    pub saved_rays: u64,
    /// Those rays at the bake's own pace, seconds; `None` where the log does not say how fast that was.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub saved_seconds: Option<f64>,
}

/// What a bake took, which varies from run to run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BakeRun {
    /// Seconds.
    pub seconds: Seconds,
    /// Most memory at once; `None` where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// Of that what reconstructed rows took.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub row_bytes: Option<u64>,
    /// Worker threads.
    pub threads: usize,
}

/// Seconds of a bake.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seconds {
    /// Of its stages by their names.
    #[serde(flatten)]
    pub stages: BTreeMap<String, f64>,
    /// Of the whole.
    pub total: f64,
    /// Thread-seconds in rays, divided by the threads; `None` in logs of bakes that did not measure it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub ray_tracing: Option<f64>,
}

/// The log beside an asset.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BakeLog {
    /// Version of the JSON.
    pub schema: u32,
    /// What the bake took.
    #[serde(flatten)]
    pub run: BakeRun,
}

impl BakeLog {
    /// The log beside an asset; `None` if there is none.
    ///
    /// # Errors
    /// It cannot be read or is none; in words, because it is left aside then.
    pub fn beside(asset: &Path) -> Result<Option<BakeLog>, String> {
        let path = log_path(asset);
        match std::fs::read_to_string(&path) {
            Ok(text) => serde_json::from_str(&text).map(Some).map_err(|error| {
                let path = path.display();
                format!("{path}: not the log of a bake ({error}), so it is left aside")
            }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(format!("{}: cannot be read: {error}", path.display())),
        }
    }
}

impl Inspection {
    /// Everything that is known from an asset in memory and its file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_asset(path: &Path, asset: &Asset) -> Result<Inspection, Failure> {
        let summary = format::read_summary(path)?;
        let content = Content::of(asset);
        Inspection::new(
            path,
            &summary,
            &content,
            asset.estimates.as_ref(),
            Names::of(asset),
        )
    }

    /// What is known from the parts of a file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn new(
        path: &Path,
        summary: &Summary,
        content: &Content,
        estimates: Option<&Estimates>,
        names: Names,
    ) -> Result<Inspection, Failure> {
        let provenance = &summary.provenance;
        let counted = |name: &str| provenance.counts.iter().find(|c| c.0 == name).map(|c| c.1);
        let square_metres = |name: &str| counted(name).map(|n| n as f64 * 1e-6);
        let section = |s: &format::SectionInfo| {
            let (raw, stored) = (s.raw_bytes, s.stored_bytes);
            (s.name.clone(), SectionBytes { raw, stored })
        };
        let left_out = provenance.left_out.iter().enumerate().map(|(i, l)| LeftOut {
            what: l.what.clone(),
            why: l.why.clone(),
            saved_bytes: l.saved_bytes,
            saved_rays: counted(&format!("saved_rays_{i}")).unwrap_or(0),
            saved_seconds: None,
        });
        let known = estimates.iter().flat_map(|e| &e.values);
        let known: BTreeMap<String, f64> = known.map(|(name, value)| (name.clone(), *value)).collect();
        let links = Links {
            transfer: content.links_transfer,
            solution: content.links_solution,
            bounce: content.links_bounce,
        };
        Ok(Inspection {
            schema: SCHEMA,
            asset: path.display().to_string(),
            asset_hash: relight_play::open::asset_hash(path)?,
            source_hash: provenance.source_hash,
            tool_version: provenance.tool_version.clone(),
            format_version: summary.format_version,
            seed: provenance.seed,
            lambert: provenance.lambert,
            settings: provenance.settings.iter().cloned().collect(),
            triangles: content.triangles,
            meshes: content.meshes,
            instances: content.instances,
            materials: content.materials,
            variants: (relight_play::open::variants(provenance, content.materials as usize).into_iter())
                .map(|variant| variant.name)
                .collect(),
            textures: content.textures,
            points: content.points.clone(),
            disk_radius: content.disk_radii.clone(),
            // Saturating: the counts of a forged file may be anything.
            links: (links.transfer)
                .saturating_add(links.bounce)
                .saturating_add(links.solution),
            links_by_operator: links,
            links_per_level: content.links_per_level.clone(),
            longest_row: content.longest_row,
            potential_links: counted("potential_links"),
            cuts: content
                .cuts
                .map(|cuts| Cuts::new(&cuts, known.get("cut_rms_error").copied())),
            rays: counted("rays"),
            receivers_gathered: counted("receivers_gathered"),
            rays_without_points: counted("rays_without_points"),
            surface_m2: square_metres("surface_square_mm"),
            surface_without_points_m2: square_metres("uncovered_square_mm"),
            bytes: Bytes {
                sections: summary.sections.iter().map(section).collect(),
                total: summary.file_bytes,
            },
            names,
            left_out: left_out.collect(),
            estimates: known,
            expected: Expected::of(estimates),
            expected_error: expected::line(estimates),
            notes: provenance.notes.clone(),
            run: None,
        })
    }

    /// With what the bake took, and the seconds that the rays of what was left out would have taken at its pace.
    pub fn with_run(mut self, run: BakeRun) -> Inspection {
        if let (Some(seconds), Some(rays @ 1..)) = (run.seconds.ray_tracing, self.rays) {
            for left in &mut self.left_out {
                left.saved_seconds = Some(left.saved_rays as f64 * seconds / rays as f64);
            }
        }
        self.run = Some(run);
        self
    }
}

impl Cuts {
    /// Predicted (Cheslack-Postava et al. 2008): a node of a visibility cut errs by √(|C|·var V) ≤ σ (equation 5), so that a site's
    /// K nodes over the half of the lights that is above its horizon err by σ √(2K / lights) on average. Its product with a node of an
    /// illumination cut, which errs by a share e of the light, errs by at most σe (equation 8); what a surface reflects of all nodes by no
    /// more, since its BRDF times the cosine, even over a node, sums to at most 1 (equation 9).
    fn new(cuts: &CutContent, rms_error: Option<f64>) -> Cuts {
        let environment = !cuts.of_surfaces && cuts.lights > 0;
        let sigma = f64::from(cuts.sigma);
        let mean_length = cuts.elements as f64 / cuts.sites.max(1) as f64;
        Cuts {
            mode: if cuts.of_surfaces {
                "indirect"
            } else {
                "environment"
            }
            .into(),
            lights: cuts.lights,
            sites: cuts.sites,
            elements: cuts.elements,
            mean_length,
            sigma: cuts.sigma,
            rms_error,
            predicted_rms_error: environment.then(|| sigma * (2.0 * mean_length / cuts.lights as f64).sqrt()),
            predicted_light_error: environment.then_some(sigma * ILLUMINATION_ERROR),
        }
    }
}

/// Hashes as sixteen hexadecimal digits.
mod hexadecimal {
    use serde::{Deserialize, Deserializer, Serializer, de};

    pub fn serialize<S: Serializer>(hash: &u64, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(&format_args!("{hash:016x}"))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
        let text = String::deserialize(from)?;
        u64::from_str_radix(&text, 16).map_err(|_| de::Error::custom("expected hexadecimal digits"))
    }
}
