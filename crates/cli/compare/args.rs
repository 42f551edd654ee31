//! What `relight compare` is asked.

use clap::Args;
use std::path::PathBuf;

/// Compare an OpenEXR image with a reference, layer by layer.
///
/// Per layer: RMSE; relMSE (squared error relative to the pixel's squared brightness plus 1 % of the squared
/// mean, the worst 0.1 % of the pixels left out); PSNR; bias (relative error of the mean); the 99th percentile of
/// the relative error; HDR-FLIP (what the eye sees, 0 to 1). Layers of the same pass belong together although other
/// programs name them otherwise (ViewLayer.Combined is beauty, RenderLayer.DiffDir is DiffDir); layers that only one
/// image has are named and left aside. Colours are compared in Rec. 709, over the display window.
///
/// Two sequences, given with #### or %04d for the frame number, are compared frame by frame; then flicker is told, too: the absolute
/// second difference in time of a pixel over its mean, of the image, of the reference, and of what differs between them.
#[derive(Args, Clone)]
pub struct CompareArgs {
    /// Image to judge, or a sequence (frame_####.exr).
    #[arg(value_name = "A.exr")]
    pub image: PathBuf,
    /// Reference; of a sequence the sequence with the same frame numbers.
    #[arg(value_name = "B.exr")]
    pub reference: PathBuf,
    /// Compare this layer only. A reference without it is taken by its only layer.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Exit with code 3 if the relMSE of any layer is above this.
    #[arg(long, value_name = "X", value_parser = at_least_0)]
    pub max_relmse: Option<f64>,
    /// Print one JSON object on stdout instead of a table. What has no meaning is left out: psnr_db of equal images, relmse, bias and
    /// relative_error_p99 against a black reference (reference_is_black).
    #[arg(long)]
    pub json: bool,
}

fn at_least_0(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 => Ok(number),
        _ => Err("expected a number of at least 0".into()),
    }
}
