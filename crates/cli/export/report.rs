//! What `export` says that it wrote.

use super::files::Written;
use serde::Serialize;

/// What `--json` prints.
#[derive(Serialize)]
pub struct Report {
    pub schema: u32,
    pub command: &'static str,
    pub asset: String,
    pub what: Option<String>,
    pub facts: Facts,
    pub files: Vec<Written>,
}

/// Numbers that go with the files.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Facts {
    Points {
        levels: usize,
    },
    Links {
        receivers: Option<u32>,
        senders: Option<u32>,
        bounce_level: Option<u32>,
        solution_level: Option<u32>,
    },
    Cuts {
        sigma: f32,
        unit: f32,
        lights: usize,
    },
    Lights {
        kind: &'static str,
        #[serde(skip_serializing_if = "Option::is_none")]
        steradians: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        area_m2: Option<f32>,
    },
    PointCloud {
        lights: Vec<String>,
        frame: u32,
    },
    IrradianceVolume {
        low: [f64; 3],
        high: [f64; 3],
        grid: [u32; 3],
        frame: u32,
    },
    Lightmap {
        /// File's name without its ending, and the light; of the first all.
        maps: Vec<[String; 2]>,
        frame: u32,
        size: u32,
        part: &'static str,
        /// `auto`, or the number of the set.
        uv: String,
        /// Where the scene was unwrapped.
        #[serde(skip_serializing_if = "Option::is_none")]
        texels_per_metre: Option<f32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        charts: Option<u32>,
        /// Shares of the map: what shows surfaces, and what of that lies hidden under others.
        covered: f64,
        hidden: f64,
        /// Irradiance of white in the picture within the .glb, W/m².
        intensity: f32,
    },
    Transfer {
        finest_points: usize,
        receivers: usize,
        senders: usize,
    },
    Bounce {
        bounce_level: Option<u32>,
        solution_level: Option<u32>,
    },
}
