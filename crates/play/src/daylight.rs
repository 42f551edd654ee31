//! Daylight coefficients: what a standing camera sees under each patch of the sky, and frames as sums of that.
//!
//! Source: Tregenza and Waters 1983, "Daylight coefficients", Lighting Research and Technology 15(2), for whole images. Light adds up, so that
//! a frame under any sky is the sum of the images of its patches, each times the patch's radiance. Images are made by the player as those of
//! any environment map, once; a frame then costs a pass over them, several frames at a time.
//!
//! Images are kept in half floats, block of pixels by block, black blocks left out; each part of an image has a power of two of its own, by which its
//! largest value uses half's range: what is 2²⁸ below it keeps 11 bits. Sums are of floats, in the order of the patches.

use crate::frame::settings::FrameSettings;
use crate::player::{FrameError, LightsError, Player};
use crate::shot::Shot;
use glam::Vec3;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use relight_render::watch::{Watch, go_on};
use relight_scene::animated::Animated;
use relight_scene::daylight::patches_at;
use relight_scene::image::{BEAUTY, Layer, Layers};
use relight_scene::light::{EnvironmentMap, LightKind, LightTrack};
use relight_scene::sky_patches::SkyPatches;
use relight_transport::random::mix;
use std::sync::Arc;

/// Most memory of the images, bytes: as much as maps of a sequence may take.
pub const MOST_BYTES: u64 = 4 << 30;
/// Layers of a frame whose sum is its beauty.
const SUMMANDS: [&str; 3] = ["emission", "direct", "indirect"];
/// What of the emission comes from where nothing is.
const BACKGROUND: &str = "background";
/// Pixels of a block: its floats of some frames stay in a core's cache.
const BLOCK: usize = 256;
const VALUES: usize = 3 * BLOCK;
/// Most frames that are summed at once, and most memory of their floats, bytes.
const AT_ONCE: usize = 16;
const AT_ONCE_BYTES: usize = 256 << 20;
/// Exponent of the largest value of what is kept: half's largest is below 2¹⁶.
const LARGEST: f32 = 14.0;
/// Frames that are looked at at once for what shines.
const LOOKED_AT: usize = 64;

/// What a camera sees under each patch.
pub struct DaylightLayers {
    /// The frame of a black sky: what does not depend on light, and surfaces that are bright by themselves.
    dark: Layers,
    /// Layers that are sums, by name.
    parts: Vec<&'static str>,
    images: Vec<Image>,
    /// Patches that shone and lit nothing that is seen.
    unseen: usize,
}

/// What is seen under one patch of radiance 1.
struct Image {
    patch: usize,
    /// In the order of `parts`.
    parts: Vec<Part>,
}

/// One layer of it.
struct Part {
    /// Values times this are radiance.
    unit: f32,
    /// Per block where its values begin, in blocks; `None`: black.
    starts: Vec<Option<u32>>,
    /// Of each block that is not black the reds, the greens, the blues.
    values: Vec<f16>,
}

/// How images of patches are made.
pub struct DaylightOrder<'a> {
    /// The sky.
    pub patches: &'a SkyPatches,
    /// Which patches ever shine ([`lit_patches`]).
    pub lit: &'a [bool],
    /// Names of the layers that are wanted of frames. Those that follow from no light are there in any case.
    pub wanted: &'a [&'a str],
    /// How each is lit.
    pub frame: FrameSettings,
}

/// Why there are no images.
#[derive(Debug, thiserror::Error)]
pub enum DaylightError {
    /// The asset lacks what a sky takes.
    #[error(transparent)]
    Lights(#[from] LightsError),
    /// One could not be made.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// They are too large.
    #[error(
        "images of {patches} patches of {width}x{height} pixels take up to {:.1} GB, and may take {:.1} GB; choose fewer patches, a smaller \
         image, or the beauty alone", *.bytes as f64 / 1e9, MOST_BYTES as f64 / 1e9
    )]
    Memory {
        /// Patches that shine.
        patches: usize,
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
        /// What they may take.
        bytes: u64,
    },
}

/// Which patches shine in any of some frames, under the suns and skies of some lights.
pub fn lit_patches(
    lights: &[LightTrack],
    patches: &SkyPatches,
    frames: impl Iterator<Item = u32>,
) -> Vec<bool> {
    let mut lit = vec![false; patches.len()];
    let mut frames = frames.peekable();
    while frames.peek().is_some() && lit.contains(&false) {
        let some: Vec<u32> = frames.by_ref().take(LOOKED_AT).collect();
        let skies: Vec<Vec<Vec3>> = (some.par_iter())
            .map(|&frame| patches_at(lights, patches, frame.into()))
            .collect();
        for sky in skies {
            (lit.iter_mut().zip(sky)).for_each(|(lit, radiance)| *lit |= radiance != Vec3::ZERO);
        }
    }
    lit
}

/// Layers that are sums, of those that are wanted: without its summands the beauty is one itself.
fn parts(wanted: &[&str]) -> Vec<&'static str> {
    let has = |name: &&str| wanted.contains(name);
    let some = SUMMANDS.iter().any(has);
    let mut parts: Vec<&str> = match (has(&BEAUTY), some) {
        (true, false) => vec![BEAUTY],
        (true, true) => SUMMANDS.to_vec(),
        (false, _) => SUMMANDS.into_iter().filter(has).collect(),
    };
    parts.extend(has(&BACKGROUND).then_some(BACKGROUND));
    parts
}

/// Most memory that images take, bytes. What is seen of the sky itself is seen under one patch or two, and not counted.
///
/// # Errors
/// [`DaylightError::Memory`].
pub fn most_bytes(
    patches: usize,
    wanted: &[&str],
    (width, height): (usize, usize),
) -> Result<u64, DaylightError> {
    let full = (parts(wanted).into_iter()).filter(|part| !["emission", BACKGROUND].contains(part));
    let blocks = (width * height).div_ceil(BLOCK);
    let bytes = (patches * full.count() * blocks) as u64 * (VALUES * size_of::<f16>()) as u64;
    check(bytes, patches, (width, height)).map(|()| bytes)
}

fn check(bytes: u64, patches: usize, (width, height): (usize, usize)) -> Result<(), DaylightError> {
    match bytes <= MOST_BYTES {
        true => Ok(()),
        false => Err(DaylightError::Memory {
            patches,
            width,
            height,
            bytes,
        }),
    }
}

impl DaylightLayers {
    /// Makes the images. `watch` hears of every patch.
    ///
    /// # Errors
    /// [`DaylightError`].
    pub fn new(
        player: &Player,
        shot: &Shot,
        order: &DaylightOrder<'_>,
        watch: &dyn Watch,
    ) -> Result<DaylightLayers, DaylightError> {
        let settings = FrameSettings {
            surface_layers: true,
            light_layers: false,
            cut_layers: false,
            ..order.frame
        };
        let frame = |tracks: &[LightTrack], seed: u64| {
            let lights = player.lights(tracks)?;
            let settings = FrameSettings { seed, ..settings };
            Ok::<_, DaylightError>(
                player
                    .frame_watched(shot, &lights, 0.0, &settings, &Stop(watch))?
                    .layers,
            )
        };
        let dark = frame(&[], settings.seed)?;
        let parts = parts(order.wanted);
        let shining: Vec<usize> = (0..order.patches.len())
            .filter(|&patch| order.lit.get(patch) == Some(&true))
            .collect();
        let size = (dark.width, dark.height);
        most_bytes(shining.len(), order.wanted, size)?;
        let mut layers = DaylightLayers {
            dark,
            parts,
            images: Vec::new(),
            unseen: 0,
        };
        for (done, &patch) in shining.iter().enumerate() {
            go_on(watch).map_err(FrameError::from)?;
            // Numbers of their own, so that what is noise in one patch is not in all.
            let made = frame(
                &[shines(order.patches.map(patch))],
                mix(settings.seed ^ patch as u64),
            )?;
            let image = layers.image(patch, &made);
            match image.parts.iter().all(|part| part.values.is_empty()) {
                true => layers.unseen += 1,
                false => layers.images.push(image),
            }
            check(layers.bytes(), shining.len(), size)?;
            watch.advance_to(done + 1, shining.len());
        }
        Ok(layers)
    }

    /// Memory of the images, bytes.
    pub fn bytes(&self) -> u64 {
        let parts = self.images.iter().flat_map(|image| &image.parts);
        parts
            .map(|part| size_of_val(&*part.values) + size_of_val(&*part.starts))
            .sum::<usize>() as u64
    }

    /// Patches that have an image.
    pub fn len(&self) -> usize {
        self.images.len()
    }

    /// Whether no patch lights anything.
    pub fn is_empty(&self) -> bool {
        self.images.is_empty()
    }

    /// Patches that shine on nothing that is seen.
    pub fn unseen(&self) -> usize {
        self.unseen
    }

    /// How many frames are best summed at once.
    pub fn at_once(&self) -> usize {
        let frame = self.blocks() * VALUES * size_of::<f32>() * self.parts.len();
        (AT_ONCE_BYTES / frame.max(1)).clamp(1, AT_ONCE)
    }

    fn blocks(&self) -> usize {
        (self.dark.width * self.dark.height).div_ceil(BLOCK)
    }

    fn image(&self, patch: usize, made: &Layers) -> Image {
        let part = |name: &&str| {
            let black = Layer {
                name: String::new(),
                channels: 3,
                data: Vec::new(),
            };
            let [lit, dark] = [made, &self.dark].map(|layers| layers.layer(name).unwrap_or(&black));
            let light: Vec<f32> = lit
                .data
                .iter()
                .zip(&dark.data)
                .map(|(lit, dark)| lit - dark)
                .collect();
            Part::new(&light)
        };
        Image {
            patch,
            parts: self.parts.iter().map(part).collect(),
        }
    }

    /// Frames under some skies: of each the radiance of all patches, W/(m² sr). They have the layers that were wanted, and those that
    /// follow from no light.
    pub fn frames(&self, skies: &[Vec<Vec3>]) -> Vec<Layers> {
        let sums: Vec<Vec<f32>> = (0..self.parts.len()).map(|part| self.sum(part, skies)).collect();
        (0..skies.len())
            .into_par_iter()
            .map(|frame| self.frame(frame, skies.len(), &sums))
            .collect()
    }

    /// Of one part, block by block, the values of all frames: pixels side by side.
    fn sum(&self, part: usize, skies: &[Vec<Vec3>]) -> Vec<f32> {
        let mut sums = vec![0.0f32; self.blocks() * skies.len() * VALUES];
        (sums.par_chunks_mut((skies.len() * VALUES).max(1)).enumerate()).for_each(|(block, out)| {
            let mut planes = vec![0.0f32; out.len()];
            let mut image_planes = [0.0f32; VALUES];
            for image in &self.images {
                let part = &image.parts[part];
                let Some(values) = part.block(block) else {
                    continue;
                };
                values.convert_to_f32_slice(&mut image_planes);
                for (sky, planes) in skies.iter().zip(planes.as_chunks_mut::<VALUES>().0) {
                    let radiance = sky[image.patch] * part.unit;
                    if radiance != Vec3::ZERO {
                        add(planes, &image_planes, radiance);
                    }
                }
            }
            let frames = planes
                .as_chunks::<VALUES>()
                .0
                .iter()
                .zip(out.as_chunks_mut::<VALUES>().0);
            for (planes, out) in frames {
                for (pixel, out) in out.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                    *out = [planes[pixel], planes[BLOCK + pixel], planes[2 * BLOCK + pixel]];
                }
            }
        });
        sums
    }

    /// The layers of one of some frames, in the order of any frame's.
    fn frame(&self, frame: usize, of: usize, sums: &[Vec<f32>]) -> Layers {
        let summed = |part: &str| self.parts.iter().position(|name| *name == part);
        let data = |layer: &Layer, part: usize| -> Vec<f32> {
            let blocks = sums[part].as_chunks::<VALUES>().0.iter().skip(frame).step_by(of);
            let light = blocks.flatten();
            layer
                .data
                .iter()
                .zip(light)
                .map(|(dark, light)| dark + light)
                .collect()
        };
        let mut layers = Layers::new(self.dark.width, self.dark.height);
        for layer in &self.dark.layers {
            let name = layer.name.as_str();
            let data = match summed(name) {
                Some(part) => data(layer, part),
                None if name == BEAUTY || name == BACKGROUND || SUMMANDS.contains(&name) => continue,
                None => layer.data.clone(),
            };
            layers.layers.push(Layer {
                name: layer.name.clone(),
                channels: layer.channels,
                data,
            });
        }
        if SUMMANDS.iter().all(|name| summed(name).is_some()) {
            let mut data = vec![0.0f32; self.dark.width * self.dark.height * 3];
            for layer in SUMMANDS.iter().filter_map(|name| layers.layer(name)) {
                (data.iter_mut().zip(&layer.data)).for_each(|(sum, value)| *sum += value);
            }
            let beauty = Layer {
                name: BEAUTY.into(),
                channels: 3,
                data,
            };
            layers.layers.insert(0, beauty);
        }
        layers
    }
}

impl Part {
    /// Of pixels side by side.
    fn new(light: &[f32]) -> Part {
        let largest = light
            .iter()
            .filter(|v| v.is_finite())
            .fold(0.0f32, |m, v| m.max(v.abs()));
        let exponent = if largest > 0.0 {
            LARGEST - largest.log2().floor()
        } else {
            0.0
        };
        // Powers that, and whose inverse, a float holds.
        let scale = exponent.clamp(-120.0, 120.0).exp2();
        let mut part = Part {
            unit: scale.recip(),
            starts: Vec::with_capacity(light.len().div_ceil(VALUES)),
            values: Vec::new(),
        };
        for block in light.chunks(VALUES) {
            if block.iter().all(|value| *value == 0.0) {
                part.starts.push(None);
                continue;
            }
            part.starts.push(Some((part.values.len() / VALUES) as u32));
            let mut planes = [0.0f32; VALUES];
            for (pixel, rgb) in block.as_chunks::<3>().0.iter().enumerate() {
                for (channel, value) in rgb.iter().enumerate() {
                    planes[channel * BLOCK + pixel] = value * scale;
                }
            }
            part.values.extend(planes.map(f16::from_f32));
        }
        part.values.shrink_to_fit();
        part
    }

    fn block(&self, block: usize) -> Option<&[f16]> {
        let start = (*self.starts.get(block)?)? as usize * VALUES;
        self.values.get(start..start + VALUES)
    }
}

/// Adds an image's block times a colour.
fn add(planes: &mut [f32; VALUES], image: &[f32; VALUES], color: Vec3) {
    let planes = planes.as_chunks_mut::<BLOCK>().0;
    for ((sum, image), factor) in planes
        .iter_mut()
        .zip(image.as_chunks::<BLOCK>().0)
        .zip(color.to_array())
    {
        for (sum, value) in sum.iter_mut().zip(image) {
            *sum += value * factor;
        }
    }
}

/// An environment of this map.
fn shines(map: EnvironmentMap) -> LightTrack {
    LightTrack {
        name: "patch".into(),
        kind: LightKind::Environment {
            maps: Arc::new(map).into(),
            file: "patch".into(),
            scale: Animated::Constant(Vec3::ONE),
            rotation_deg: Animated::Constant(0.0),
        },
    }
}

/// Stops what another's watch stops, and tells it nothing: images count, not their parts.
struct Stop<'a>(&'a dyn Watch);

impl Watch for Stop<'_> {
    fn stopped(&self) -> bool {
        self.0.stopped()
    }
}
