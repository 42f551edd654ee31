//! Frames of an asset, relit and path traced, and how far apart they are.

use crate::numbers::{fixed, signed};
use crate::program::Result;
use relight_play::frame::stats::Figure;
use relight_play::{FrameSettings, Integrator, Player, ShotSettings, Tracer};
use relight_scene::image::metrics::{bias, relmse};
use relight_scene::image::{FloatImage, Layers};
use relight_scene::sequence::read_sequence_at;
use std::path::Path;
use std::time::Instant;

/// Direct light, light of two and more reflections, and all.
pub type Parts = [FloatImage; 3];

/// What is looked at.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub asset: &'a str,
    /// A sequence, else the scene's own lights.
    pub lights: Option<&'a str>,
    pub size: [usize; 2],
}

/// A frame.
pub struct Lit {
    pub layers: Layers,
    /// Seconds from the asset's file to the first frame.
    pub first: f64,
    /// Median milliseconds of the others.
    pub each: f64,
    /// Stages of the last, milliseconds.
    pub stages: String,
}

/// What frames are judged by.
pub struct Reference {
    pub parts: Parts,
    /// relMSE of each part by the reference's own noise.
    pub noise: [Option<f64>; 3],
    /// In words.
    pub by: String,
}

/// How far a part is from a reference.
pub struct Distance {
    relmse: f64,
    noise: Option<f64>,
    pub bias: f64,
}

impl Distance {
    /// Root of relMSE, less the reference's noise.
    pub fn error(&self) -> f64 {
        (self.relmse - self.noise.unwrap_or(0.0)).max(0.0).sqrt()
    }

    /// relMSE, of it noise, bias.
    pub fn cells(&self) -> [String; 3] {
        let noise = self.noise.unwrap_or(f64::NAN);
        [fixed(self.relmse, 4), fixed(noise, 4), signed(self.bias, None)]
    }
}

impl Reference {
    /// The mean of two path tracings of so many samples a pixel.
    pub fn traced(view: View, spp: u32, of: impl Fn(&Layers) -> Result<Parts>) -> Result<Reference> {
        let traced = |seed| lit(view, (Some(spp), seed), 0);
        let (a, b) = (traced(1)?, traced(2)?);
        let seconds = a.first;
        let (a, b) = (of(&a.layers)?, of(&b.layers)?);
        Ok(Reference {
            parts: [0, 1, 2].map(|k| combined(&a[k], &b[k], |a, b| 0.5 * (a + b))),
            // Each of two errs by half of what they differ by, their mean by half of that.
            noise: [0, 1, 2].map(|k| relmse(&a[k], &b[k]).ok().map(|error| error / 4.0)),
            by: format!("two path tracings of {spp} samples a pixel, {seconds:.0} s each"),
        })
    }

    /// How far each part of a frame is from it.
    pub fn distances(&self, parts: &Parts) -> Result<[Distance; 3]> {
        let of = |k: usize| -> Result<Distance> {
            Ok(Distance {
                relmse: relmse(&parts[k], &self.parts[k])?,
                noise: self.noise[k],
                bias: bias(&parts[k], &self.parts[k])?.1,
            })
        };
        Ok([of(0)?, of(1)?, of(2)?])
    }
}

/// A frame as the asset has it, and so `many` further ones for their times.
pub fn relit(view: View, many: usize) -> Result<Lit> {
    lit(view, (None, 0), many)
}

fn lit(view: View, traced: (Option<u32>, u64), many: usize) -> Result<Lit> {
    let name = |error| {
        format!(
            "playing {} with {}: {error}",
            view.asset,
            view.lights.unwrap_or("its own lights")
        )
    };
    Ok(played(view, traced, many).map_err(name)?)
}

/// A frame of the first light, relit or of so many path traced samples a pixel with this seed.
fn played(view: View, (samples, seed): (Option<u32>, u64), many: usize) -> Result<Lit> {
    let start = Instant::now();
    let path = |_| Integrator::Traced(Tracer::Path { max_bounces: None });
    let settings = ShotSettings {
        integrator: samples.map_or(Integrator::Auto, path),
        width: view.size[0],
        height: view.size[1],
        samples,
        ..ShotSettings::default()
    };
    let player = Player::open_for(view.asset, &settings.integrator)?;
    let sequence = match view.lights {
        Some(file) => read_sequence_at(Path::new(file), player.scene().offset)?,
        None => player.own_lights()?.clone(),
    };
    let lights = player.lights(&sequence.lights)?;
    let shot = player.shot(&player.camera(&sequence, None)?.at(0.0), &settings)?;
    let settings = FrameSettings {
        seed,
        ..FrameSettings::default()
    };
    let mut frame = player.frame(&shot, &lights, 0.0, &settings)?;
    let first = start.elapsed().as_secs_f64();
    let mut times = vec![0.0; many];
    for time in &mut times {
        player.forget(&shot);
        let start = Instant::now();
        frame = player.frame(&shot, &lights, 0.0, &settings)?;
        *time = 1e3 * start.elapsed().as_secs_f64();
    }
    times.sort_by(f64::total_cmp);
    let stage = |(stage, figure): (&str, Figure)| match figure {
        Figure::Milliseconds(time) => Some(format!("{} {time:.0}", stage.replace('_', " "))),
        _ => None,
    };
    let stages: Vec<String> = frame.stats.figures().into_iter().filter_map(stage).collect();
    Ok(Lit {
        layers: frame.layers,
        first,
        each: times.get(many / 2).copied().unwrap_or(f64::NAN),
        stages: stages.join(", "),
    })
}

/// Parts of a frame of ours, its emission with its direct light, as images of others have them.
pub fn with_emission(layers: &Layers) -> Result<Parts> {
    parts(layers, layers, "indirect")
}

/// From an image of everything and one whose layer `name` is the indirect light.
pub fn parts(full: &Layers, indirect: &Layers, name: &str) -> Result<Parts> {
    let (full, indirect) = (layer(full, "beauty")?, layer(indirect, name)?);
    Ok([combined(&full, &indirect, |f, i| f - i), indirect, full])
}

/// Parts of a frame of ours, direct light without what shines itself.
pub fn without_emission(layers: &Layers) -> Result<Parts> {
    Ok([
        layer(layers, "direct")?,
        layer(layers, "indirect")?,
        layer(layers, "beauty")?,
    ])
}

fn layer(layers: &Layers, name: &str) -> Result<FloatImage> {
    Ok(layers
        .rgb(name)
        .ok_or_else(|| format!("an image has no layer {name}"))?)
}

fn combined(a: &FloatImage, b: &FloatImage, f: impl Fn(f32, f32) -> f32) -> FloatImage {
    let mut out = a.clone();
    let both = out.pixels.iter_mut().zip(&b.pixels);
    both.for_each(|(a, b)| *a = [0, 1, 2].map(|k| f(a[k], b[k])));
    out
}
