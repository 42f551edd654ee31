//! Lightmaps: irradiance of all surfaces as a texture, and the scene with its coordinates.

use super::args::{ExportArgs, PartName, Uv};
use super::files::Folder;
use super::lit::Stage;
use super::report::Facts;
use super::{glb, ktx2, unwrap};
use crate::console::Console;
use crate::failure::Failure;
use crate::signals::{self, Signals};
use anyhow::{Result, anyhow, bail};
use glam::Vec3;
use relight_play::Lights;
use relight_play::frame::lightmap::{Part, irradiance, uncover};
use relight_play::frame::settings::FrameSettings;
use relight_play::player::FrameError;
use relight_play::scene::light::LightTrack;
use relight_play::texels::{Texels, fill};
use relight_render::watch::Cancelled;
use relight_scene::image::{BEAUTY, ExrHeader, FloatImage, Image8, Layers, encode_exr, encode_png};
use relight_transport::random::Stream;

/// Texels along each side, if nobody says how many.
const SIZE: u32 = 1024;

/// Shadow rays per texel for lights with extent, and where texels disagree more: a map is made once, and looked at for long.
const SAMPLES: u32 = 32;

/// Share of what is covered that may be covered twice: seams that rounding moves, and no more.
const OVERLAP: f64 = 0.005;

/// Share of the texels that the picture within the .glb may clip: those beside a lamp would leave no steps for all others.
const CLIPPED: f64 = 0.001;

/// Name of the map of all lights, without its ending.
const NAME: &str = "lightmap";
/// Name of the scene's file.
const SCENE: &str = "lightmap.glb";

/// The maps and the scene.
pub fn write(args: &ExportArgs, seed: u64, folder: &mut Folder, console: &Console) -> Result<Facts, Failure> {
    let stage = Stage::read(args, seed, console)?;
    let name = args.asset.display();
    let of_asset = |error: anyhow::Error| anyhow!("{name}: {error}");
    let scene = &stage.player.prepared.scene;
    if scene.triangle_count() == 0 {
        return Err(anyhow!("{name}: has no triangles: there is nothing to light").into());
    }
    if stage.lights.tracks().is_empty() {
        return Err(Failure::Usage(
            "there are no lights: give --lights SEQ.json with at least one".into(),
        ));
    }
    stage.transfer()?;
    let size = args.size.unwrap_or(SIZE);
    let uv = args.uv.unwrap_or_default();
    console.begin("Laying surfaces flat", None);
    let coordinates = match uv {
        Uv::Auto => unwrap::unwrapped(scene, size),
        Uv::Own(set) => numbered_as_in_the_source(&stage, set).and_then(|()| unwrap::own(scene, set)),
    };
    signals::go_on()?;
    let coordinates = coordinates.map_err(of_asset)?;
    let mut texels = Texels::of(&unwrap::atlas(scene, &coordinates, size));
    check_overlap(&texels, uv, console).map_err(of_asset)?;
    let touched = count_of(&texels);
    if touched == 0 {
        return Err(anyhow!("{name}: no surface covers any of the lightmap").into());
    }
    uncover(scene, &mut texels, &Signals).map_err(|Cancelled| signals::failure())?;
    let hidden = touched - count_of(&texels);
    let baking = Baking {
        args,
        stage: &stage,
        texels: &texels,
        console,
    };
    let (sum, maps) = baking.write_maps(folder)?;
    let (picture, intensity) = picture(size, &sum, &texels);
    let png = encode_png("lightmap.png", &picture)?;
    let scene = glb::scene(scene.scene(), &coordinates, (&png, intensity), NAME);
    folder.texture(SCENE, &[], "m", &scene?)?;
    let all = texels.len() as f64;
    Ok(Facts::Lightmap {
        maps,
        frame: args.frame,
        size,
        part: words(args.part.unwrap_or_default()),
        uv: match uv {
            Uv::Auto => "auto".into(),
            Uv::Own(set) => set.to_string(),
        },
        texels_per_metre: coordinates.unwrapped.map(|u| u.texels_per_metre),
        charts: coordinates.unwrapped.map(|u| u.charts),
        covered: touched as f64 / all,
        hidden: hidden as f64 / all,
        intensity,
    })
}

fn words(part: PartName) -> &'static str {
    match part {
        PartName::All => "direct and indirect light",
        PartName::Direct => "direct light alone",
        PartName::Indirect => "indirect light alone",
    }
}

/// Texels with a place.
fn count_of(texels: &Texels) -> usize {
    (0..texels.len())
        .filter(|&i| !texels.places_of(i).is_empty())
        .count()
}

/// Whether sets of coordinates have the numbers that they had in the scene's file.
fn numbered_as_in_the_source(stage: &Stage, set: u32) -> Result<()> {
    let left_out = &stage.player.provenance.left_out;
    if left_out.iter().any(|l| l.what.contains("of texture coordinates")) {
        bail!(
            "sets of texture coordinates that no texture uses were left out of this asset, so that set {set} of the scene is not known; \
             bake with --keep materials, or give --uv auto"
        );
    }
    Ok(())
}

/// Refuses maps in which surfaces share texels.
fn check_overlap(texels: &Texels, uv: Uv, console: &Console) -> Result<()> {
    let (count, twice) = (texels.overlapping.len(), texels.covered_twice);
    if count == 0 {
        return Ok(());
    }
    let share = 100.0 * twice / texels.covered.max(f64::MIN_POSITIVE);
    let said = format!("{count} triangles lie over others in the map ({share:.2} % of what is covered)");
    let Uv::Own(set) = uv else {
        console.warn(said);
        return Ok(());
    };
    if twice > OVERLAP * texels.covered {
        bail!(
            "{said} by set {set} of texture coordinates, and would share their light: objects that are placed several times, and \
             tiles of a texture, do; give a set that was made for lightmaps, or --uv auto"
        );
    }
    console.warn(format!("{said}: what lies over another has its light"));
    Ok(())
}

/// What is lit and how.
struct Baking<'a> {
    args: &'a ExportArgs,
    stage: &'a Stage,
    texels: &'a Texels,
    console: &'a Console,
}

impl Baking<'_> {
    /// Writes the maps; returns the one of all lights, and the names of all.
    fn write_maps(&self, folder: &mut Folder) -> Result<(Vec<Vec3>, Vec<[String; 2]>), Failure> {
        let tracks = self.stage.lights.tracks();
        let mut maps = vec![[NAME.to_owned(), "all lights".to_owned()]];
        if !self.args.per_light {
            let mut sum = self.lit(&self.stage.lights, "Lighting texels")?;
            self.write(folder, NAME, "all lights", &mut sum)?;
            return Ok((sum, maps));
        }
        let mut sum = vec![Vec3::ZERO; self.texels.len()];
        for (number, track) in tracks.iter().enumerate() {
            let own = self.stage.player.lights(std::slice::from_ref(track))?;
            let mut map = self.lit(
                &own,
                &format!("Lighting texels, light {} of {}", number + 1, tracks.len()),
            )?;
            sum.iter_mut().zip(&map).for_each(|(sum, own)| *sum += *own);
            let file = file_name(number, track);
            self.write(folder, &file, &track.name, &mut map)?;
            maps.push([file, track.name.clone()]);
        }
        self.write(folder, NAME, "all lights", &mut sum)?;
        Ok((sum, maps))
    }

    fn lit(&self, lights: &Lights, what: &str) -> Result<Vec<Vec3>, Failure> {
        self.console.begin(what, None);
        let part = match self.args.part.unwrap_or_default() {
            PartName::All => Part::All,
            PartName::Direct => Part::Direct,
            PartName::Indirect => Part::Indirect,
        };
        let settings = FrameSettings {
            pixel_samples: SAMPLES,
            ..self.stage.settings
        };
        let time = self.args.frame.into();
        irradiance(
            &self.stage.player,
            lights,
            time,
            (self.texels, part),
            &settings,
            &Signals,
        )
        .map_err(|error| match error {
            FrameError::Cancelled(_) => signals::failure(),
            other => other.into(),
        })
    }

    /// Writes a map, without what is below zero, and with what no surface covers filled.
    fn write(&self, folder: &mut Folder, name: &str, light: &str, map: &mut [Vec3]) -> Result<()> {
        let lit: Vec<bool> = (0..map.len())
            .map(|i| !self.texels.places_of(i).is_empty())
            .collect();
        map.iter_mut().for_each(|e| *e = e.max(Vec3::ZERO));
        fill(self.texels.size, &lit, map);
        let size = self.texels.size as usize;
        let pixels: Vec<[f32; 3]> = map.iter().map(Vec3::to_array).collect();
        let shape = [size, size, 3];
        let file = format!("{name}.ktx2");
        let texture = ktx2::texture([size as u32, size as u32, 0], &pixels);
        folder.texture(&file, &[size, size, 4], "W/m²", &texture)?;
        let image = FloatImage {
            width: size,
            height: size,
            pixels,
        };
        let header = ExrHeader {
            frame: Some(self.args.frame),
            seed: Some(self.stage.settings.seed),
            texts: vec![
                ("relightQuantity".into(), "irradiance, W/m²".into()),
                ("relightLight".into(), light.into()),
            ],
            ..ExrHeader::new()
        };
        let file = format!("{name}.exr");
        let layers = Layers::from_image(BEAUTY, &image);
        let (bytes, warnings) = encode_exr(&file, &layers, &header, false)?;
        for warning in warnings {
            self.console.warn(format!("{file}: {warning}"));
        }
        folder.texture(&file, &shape, "W/m²", &bytes)
    }
}

/// The name of a light's map: what every system takes in a file's name, and its number, so that all differ.
fn file_name(number: usize, track: &LightTrack) -> String {
    let fits = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    let clean: String = (track.name.chars().take(60))
        .map(|c| if fits(c) { c } else { '_' })
        .collect();
    format!("{NAME}_{number:03}_{}", clean.trim())
}

/// The map as 8 bits, and the irradiance that its white stands for: linear, with noise below a step, so that no steps are seen.
fn picture(size: u32, map: &[Vec3], texels: &Texels) -> (Image8, f32) {
    let lit = (0..map.len()).filter(|&i| !texels.places_of(i).is_empty());
    let mut values: Vec<f32> = lit.map(|i| map[i].max_element()).collect();
    let at = ((1.0 - CLIPPED) * values.len() as f64) as usize;
    let at = at.min(values.len().saturating_sub(1));
    let white = match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(at, f32::total_cmp).1,
    };
    let white = if white > 0.0 { white } else { 1.0 };
    let rgba8 = (map.iter().enumerate())
        .map(|(i, e)| {
            let noise = Stream::new(0, 0, i as u64).uniform();
            let code = |v: f32| (v / white * 255.0 + noise).clamp(0.0, 255.0) as u8;
            [code(e.x), code(e.y), code(e.z), 255]
        })
        .collect();
    let image = Image8 {
        width: size as usize,
        height: size as usize,
        rgba8,
    };
    (image, white)
}
