//! Frames as files: the layers that are asked for, previews and movies.

use super::args::{Exposure, LayerName, PlayArgs};
use crate::console::Console;
use crate::movie::Movie;
use crate::signals;
use crate::statistics::milliseconds;
use relight_scene::image::preview::{auto_exposure, tone_mapped};
use relight_scene::image::{
    ALPHA, BEAUTY, ExrHeader, ExrWarning, Image8, Layers, RAY_DEPTH, write_exr, write_png,
};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Stops for the previews of this frame and all later ones; `None` while there is no light to choose by.
pub fn exposure(args: &PlayArgs, layers: &Layers, console: &Console) -> Option<f32> {
    match args.exposure {
        Some(Exposure::Stops(stops)) => Some(stops),
        Some(Exposure::Auto) | None => {
            let stops = auto_exposure(&layers.rgb(BEAUTY)?)?;
            // No finer than an eye tells, and as the option takes it.
            let stops = ((10.0 * stops).round() / 10.0).clamp(-100.0, 100.0);
            console.note(format!("Exposure of the previews: --exposure {stops}"));
            Some(stops)
        }
    }
}

/// A frame's files.
pub struct Written {
    /// Or none: the movie alone.
    pub file: Option<PathBuf>,
    /// What it took.
    pub milliseconds: f64,
    /// What the file holds that nobody asked for.
    pub warnings: Vec<ExrWarning>,
    /// As a movie shows it, if there is one.
    shown: Option<Image8>,
}

/// Writes the layers of a frame that are asked for.
pub fn write(
    args: &PlayArgs,
    file: Option<PathBuf>,
    all: &Layers,
    header: &ExrHeader,
    exposure_ev: f32,
) -> anyhow::Result<Written> {
    let _whole = signals::whole();
    let start = Instant::now();
    let mut written = Written {
        file,
        milliseconds: 0.0,
        warnings: Vec::new(),
        shown: None,
    };
    if let Some(file) = &written.file {
        written.warnings = write_exr(file, &chosen(all, &args.layers), header, args.float)?;
    }
    if args.png || args.movie.is_some() {
        let shown = tone_mapped(&all.rgb(BEAUTY).unwrap_or_default(), exposure_ev);
        if let Some(file) = written.file.as_ref().filter(|_| args.png) {
            write_png(&file.with_extension("png"), &shown)?;
        }
        written.shown = args.movie.is_some().then_some(shown);
    }
    written.milliseconds = milliseconds(start);
    Ok(written)
}

impl Written {
    /// Adds the frame to the movie, if there is one.
    pub fn show(&mut self, movie: &Mutex<Option<Movie>>) -> anyhow::Result<()> {
        let (start, shown) = (Instant::now(), self.shown.take());
        if let (Some(movie), Some(shown)) =
            (&mut *movie.lock().unwrap_or_else(PoisonError::into_inner), shown)
        {
            movie.push(&shown)?;
        }
        self.milliseconds += milliseconds(start);
        Ok(())
    }
}

/// The asked-for layers, in the order of the request.
fn chosen(all: &Layers, wanted: &[LayerName]) -> Layers {
    let mut out = Layers::new(all.width, all.height);
    for want in wanted {
        for layer in &all.layers {
            let fits = match want {
                LayerName::Lights | LayerName::Cryptomatte => layer.name.starts_with(want.name()),
                LayerName::Beauty => [want.name(), ALPHA].contains(&&*layer.name),
                LayerName::Depth => [want.name(), RAY_DEPTH].contains(&&*layer.name),
                _ => layer.name == want.name(),
            };
            if fits && out.layer(&layer.name).is_none() {
                out.layers.push(layer.clone());
            }
        }
    }
    out
}
