//! Pictures of a report: of each setting, to be flipped against its reference and its error map.

use super::drawing::escaped;
use super::measured::Measured;
use super::reference::Reference;
use super::task::Task;
use crate::failure::Failure;
use crate::output;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use relight_scene::image::preview::auto_exposure;
use relight_scene::image::{Image8, Limits, display_encoded, error_map, read_exr, tone_mapped, write_png};
use std::fmt::Write;
use std::path::Path;

/// A picture of each setting, to be flipped against reference and error map.
pub fn strip(
    page: &mut String,
    task: &Task,
    measured: &[Measured],
    references: &[Reference],
) -> Result<(), Failure> {
    let Some(reference) = references.first() else {
        return Ok(());
    };
    let folder = task.folder.join("pictures");
    let frame = reference.frame;
    let _ = writeln!(
        page,
        "<h2>Frame {frame}</h2>\n<p class=\"note\">Click a picture, or press a key: <kbd>1</kbd> pictures, \
         <kbd>2</kbd> references, <kbd>3</kbd> error maps (relative error, from 0.1 % dark to 100 % yellow, logarithmic).</p>\n<div class=\"strip\">"
    );
    for (i, m) in measured.iter().enumerate() {
        let layer = m.setting.layer;
        let exr = m.images.join(format!("frame_{frame:04}.exr"));
        let image = read_exr(&exr, &Limits::default())?.rgb(layer);
        let (Some(image), Some(truth)) = (image, reference.layers.rgb(layer)) else {
            continue;
        };
        let (number, label, error) = (i + 1, escaped(&m.setting.label()), m.error_words());
        let (width, height) = (image.width, image.height);
        let exposure = auto_exposure(&truth).unwrap_or_default();
        let save = |kind: &str, image: &Image8| embedded(&folder.join(format!("{i:02}_{kind}.png")), image);
        let _ = writeln!(
            page,
            "<figure class=\"flip\"><button type=\"button\" aria-label=\"Setting {number}: show the next of picture, reference and error map\">\
             <img class=\"shown\" width=\"{width}\" height=\"{height}\" alt=\"{layer} of frame {frame} by {label}: error {error}\" src=\"{}\">\
             <img width=\"{width}\" height=\"{height}\" alt=\"Path-traced reference of {layer} of frame {frame}\" src=\"{}\">\
             <img width=\"{width}\" height=\"{height}\" alt=\"Where {label} errs, mean {error}, one pixel in a hundred by more than {:.0} %\" src=\"{}\">\
             </button><figcaption><span class=\"kind\">picture</span> {number}. {label}<br>{error}, {:.1} ms</figcaption></figure>",
            save("picture", &tone_mapped(&image, exposure))?,
            save("reference", &tone_mapped(&truth, exposure))?,
            100.0 * m.judged().p99,
            save("error", &display_encoded(&error_map(&image, &truth)?))?,
            m.ms(),
        );
    }
    *page += "</div>\n";
    Ok(())
}

/// Writes a PNG and returns it as a data URL.
fn embedded(path: &Path, image: &Image8) -> Result<String, Failure> {
    output::prepare_output(path)?;
    write_png(path, image)?;
    Ok(format!(
        "data:image/png;base64,{}",
        STANDARD.encode(std::fs::read(path)?)
    ))
}
