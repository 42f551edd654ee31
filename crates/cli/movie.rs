//! `relight play --movie`: all frames as one moving picture, as their previews show them.
//!
//! It is made in a folder of its own beside its target, and takes its name when it is whole.

use crate::kinds::Kind;
use crate::output;
use crate::signals;
use anyhow::{Context, Result, anyhow, bail};
use relight_scene::image::Image8;
use relight_scene::image::movie::{MovieFormat, MovieWriter, format_of};
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use tempfile::TempDir;

/// Name of the program that writes MP4.
const FFMPEG: &str = "ffmpeg";

/// Parses the name of a movie.
///
/// # Errors
/// It has none of the endings that are written.
pub fn parse(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match kind(&path) {
        Some(_) => Ok(path),
        None => Err("the name must end in .webp, .gif or .mp4".into()),
    }
}

/// What a movie of this name is.
pub fn kind(path: &Path) -> Option<Kind> {
    match format_of(path) {
        Some(MovieFormat::WebP) => Some(Kind::WebP),
        Some(MovieFormat::Gif) => Some(Kind::Gif),
        None => (path.extension())
            .is_some_and(|end| end.eq_ignore_ascii_case("mp4"))
            .then_some(Kind::Mp4),
    }
}

/// A movie in the making.
pub struct Movie {
    target: PathBuf,
    unfinished: PathBuf,
    /// Where that lies, removed with it.
    _folder: TempDir,
    seconds: f64,
    maker: Maker,
}

enum Maker {
    Own(MovieWriter<BufWriter<File>>),
    Ffmpeg(Child),
}

impl Movie {
    /// Begins a movie of frames of that size, each shown for so many seconds.
    ///
    /// # Errors
    /// Its file cannot be written, or it is an MP4 and there is no ffmpeg.
    pub fn begin(target: &Path, (width, height): (usize, usize), seconds: f64) -> Result<Movie> {
        output::prepare_output(target)?;
        let parent = target.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = output::scratch_in(parent.unwrap_or(Path::new(".")))?;
        let name = target.file_name().context("a movie has a name")?;
        let unfinished = folder.path().join(name);
        let maker = match format_of(target) {
            Some(format) => {
                let file = File::create(&unfinished).with_context(|| cannot(target))?;
                Maker::Own(MovieWriter::new(BufWriter::new(file), format).with_context(|| cannot(target))?)
            }
            None => Maker::Ffmpeg(ffmpeg(&unfinished, width, height, seconds).map_err(|error| {
                anyhow!(
                    "{}: .mp4 is written by the program {FFMPEG}, which cannot be started ({error}): install it, or give a name \
                     that ends in .webp or .gif, which need none",
                    target.display()
                )
            })?),
        };
        Ok(Movie {
            target: target.to_owned(),
            unfinished,
            _folder: folder,
            seconds,
            maker,
        })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// It cannot be encoded or written.
    pub fn push(&mut self, frame: &Image8) -> Result<()> {
        match &mut self.maker {
            Maker::Own(writer) => writer
                .push(frame, self.seconds)
                .with_context(|| cannot(&self.target)),
            Maker::Ffmpeg(child) => {
                let bytes: Vec<u8> = frame.rgba8.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
                let input = child.stdin.as_mut().context("ffmpeg takes frames")?;
                match input.write_all(&bytes) {
                    Ok(()) => Ok(()),
                    Err(_) => ended(child, &self.target),
                }
            }
        }
    }

    /// Ends it and gives it its name.
    ///
    /// # Errors
    /// As [`Movie::push`].
    pub fn finish(self) -> Result<()> {
        let _whole = signals::whole();
        match self.maker {
            Maker::Own(writer) => writer.finish().with_context(|| cannot(&self.target))?,
            Maker::Ffmpeg(mut child) => {
                drop(child.stdin.take());
                ended(&mut child, &self.target)?;
            }
        }
        let file = File::open(&self.unfinished).with_context(|| cannot(&self.target))?;
        file.sync_all()
            .and_then(|()| std::fs::rename(&self.unfinished, &self.target))
            .with_context(|| cannot(&self.target))
    }
}

fn cannot(target: &Path) -> String {
    format!("{}: cannot be written", target.display())
}

/// Starts ffmpeg, which takes pixels from its standard input.
fn ffmpeg(file: &Path, width: usize, height: usize, seconds: f64) -> std::io::Result<Child> {
    Command::new(FFMPEG)
        .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo"])
        .args([
            "-pixel_format",
            "rgb24",
            "-video_size",
            &format!("{width}x{height}"),
        ])
        .args(["-framerate", &(1.0 / seconds).to_string(), "-i", "-"])
        // Colours are stored for two by two pixels.
        .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"])
        .args(["-movflags", "+faststart"])
        .arg(file)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
}

/// Waits for ffmpeg; an error with its words if it failed.
fn ended(child: &mut Child, target: &Path) -> Result<()> {
    let mut words = String::new();
    if let Some(mut said) = child.stderr.take() {
        // What cannot be read is not said.
        let _ = said.read_to_string(&mut words);
    }
    if !child.wait()?.success() {
        bail!("{}: {FFMPEG} failed: {}", target.display(), words.trim());
    }
    Ok(())
}
