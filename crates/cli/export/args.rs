//! Options of `relight export`.

use crate::options::ReplaceArgs;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Most places: the light of a million takes hours.
const MOST: u64 = 1 << 20;

/// Write what an asset holds for other tools: .npy arrays, PLY points, Matrix Market and Radiance matrices.
///
/// Metres, +Y up; indices count through all levels, coarsest first. README.txt beside the files says their shapes, units and how they make
/// light again; what each matrix does is said in the format's specification, section 8.1: irradiance = normals · push · transfer · pull ·
/// radiosity.
#[derive(Args)]
pub struct ExportArgs {
    /// Asset to export from.
    #[arg(value_name = "ASSET.relight")]
    pub asset: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    pub what: What,
    /// Lighting sequence, for lightmap, point-cloud and irradiance-volume; without it the scene's own lights shine.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Frame of the sequence, for lightmap, point-cloud and irradiance-volume.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub frame: u32,
    /// Places of irradiance-volume along each axis, in the middles of equal parts of the points' bounds [default: 16 along the longest].
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_grid)]
    pub grid: Option<Grid>,
    /// Coordinates of lightmap: the scene's own set of that number, from 0, or auto, which unwraps the scene anew [default: auto].
    #[arg(long, value_name = "N|auto", value_parser = parse_uv)]
    pub uv: Option<Uv>,
    /// Texels of lightmap along each side, 16 to 4096 [default: 1024].
    #[arg(long, value_name = "TEXELS", value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub size: Option<u32>,
    /// Which light lightmap holds [default: all].
    #[arg(long, value_enum)]
    pub part: Option<PartName>,
    /// Also write a lightmap of each light by itself; together they are the one of all.
    #[arg(long)]
    pub per_light: bool,
    /// Folder for the files; made if it is not there. Files of the same names and kinds are replaced, once all are written.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Most bytes of a matrix that is dense: 20 per entry of points_from_points while it is computed, 4 per entry of a
    /// Radiance matrix (suffixes K, M, G: powers of 1024).
    #[arg(long, value_name = "BYTES", default_value = "1G", value_parser = parse_bytes)]
    pub matrix_limit: u64,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print one JSON object on stdout: the files, their shapes and units.
    #[arg(long)]
    pub json: bool,
}

/// Parts of an asset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum What {
    /// Points of all levels: positions, normals, albedo, level (.npy and .ply).
    Points,
    /// Sparse operators as compressed rows, and the clusters that send (.npy).
    Links,
    /// What each site sees of the lights: nodes and means (.npy).
    Cuts,
    /// The lights that cuts cluster: directions or surface samples (.npy and .ply).
    Lights,
    /// What one bounce does, as matrices: irradiance of the finest points from their radiosity (points_from_points), and
    /// the factors (Matrix Market .mtx; Radiance .rmx).
    Transfer,
    /// The factors alone, which are sparse however many points there are: pull, transfer, push, normals (.mtx).
    Factors,
    /// The bounce operator between clusters (.mtx, .rmx), or its solution (.mtx).
    Bounce,
    /// The finest points in the light of --lights: direct and indirect irradiance of each light, radiance (.npy and .ply).
    PointCloud,
    /// The light that arrives at the places of a grid: spherical harmonics (.npy), and ambient cubes as Bevy reads them (.npy, .ktx2).
    IrradianceVolume,
    /// Irradiance of all surfaces in the light of --lights as a texture (.exr, .ktx2), and the scene with its coordinates (.glb).
    Lightmap,
}

/// Light of a lightmap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PartName {
    /// Direct and indirect: engines show the map alone.
    #[default]
    All,
    /// Straight from the lights.
    Direct,
    /// By way of other surfaces: engines add the lights by themselves.
    Indirect,
}

/// Where the coordinates of a lightmap come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Uv {
    /// The scene is unwrapped.
    #[default]
    Auto,
    /// A set of the scene's own.
    Own(u32),
}

fn parse_uv(text: &str) -> Result<Uv, String> {
    if text == "auto" {
        return Ok(Uv::Auto);
    }
    let number = text.parse().ok().filter(|n| *n < 8);
    (number.map(Uv::Own)).ok_or_else(|| "give auto, or the number of a set from 0 to 7".into())
}

fn parse_bytes(text: &str) -> Result<u64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'K' | 'k')) => (&text[..at], 1u64 << 10),
        Some((at, 'M' | 'm')) => (&text[..at], 1 << 20),
        Some((at, 'G' | 'g')) => (&text[..at], 1 << 30),
        _ => (text, 1),
    };
    let number = digits.parse::<u64>().ok().and_then(|n| n.checked_mul(unit));
    number.ok_or_else(|| "give a number of bytes such as 500M or 4G".into())
}

/// How many places along each axis.
pub type Grid = [u32; 3];

/// Parses `X,Y,Z`.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_grid(text: &str) -> Result<Grid, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let grid: Option<Grid> = numbers.and_then(|numbers| numbers.try_into().ok());
    let places = |grid: &Grid| grid.iter().map(|&n| u64::from(n)).product::<u64>();
    grid.filter(|grid| (1..=MOST).contains(&places(grid)) && grid.iter().all(|&n| n <= 2048))
        .ok_or_else(|| {
            "give three numbers of places such as 16,8,16, each up to 2048, together up to 1048576".into()
        })
}
