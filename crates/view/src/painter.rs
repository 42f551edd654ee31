//! What is kept of one tab, and its pictures.

use crate::beside::{Apart, MOST_PASSES, Reference};
use crate::desk::Stage;
use crate::exhibit::Maps;
use crate::wish::{By, Eye, Wish};
use relight_play::choice::CutUse;
use relight_play::frame::stats::Figure;
use relight_play::header::{FrameOrigin, sequence_hash};
use relight_play::player::{FrameError, ShotError};
use relight_play::render::watch::Watch;
use relight_play::scene::image::{ExrHeader, Layers};
use relight_play::scene::sequence::{Sequence, parse_sequence_with};
use relight_play::{Choice, CutSites, FrameSettings, Integrator, Lights, Player, Shot, ShotSettings, Tracer};
use std::sync::Arc;
use std::time::Instant;

/// Milliseconds that a coarse picture may take: 15 a second.
const COARSE_TARGET: f64 = 60.0;
/// Milliseconds that the eye's rays and the functions where they end may take of the picture that refines a coarse one: of large pictures they
/// hold up the final one, which follows, by half a second and more.
const MIDDLE_TARGET: f64 = 350.0;
/// Part of its time that makes a coarse picture of fewer pixels worthwhile.
const WORTHWHILE: f64 = 0.1;
/// Least pixels across a coarse picture: fewer don't tell where a lamp goes.
const LEAST_WIDTH: u32 = 200;
/// How many times narrower a coarse picture may be that is path-traced, however few that leaves.
const MOST_DIVISOR_TRACED: u32 = 8;
/// Rays to each light with extent, of a fragment and of a point, of coarse pictures.
const COARSE_RAYS: (u32, u32) = (2, 1);

/// What pictures are made of, as it is now.
pub struct Room<'a> {
    /// The asset, its materials as the wish has them.
    pub player: &'a Player,
    /// The lights of wishes that bring none.
    pub sequence: &'a Sequence,
    /// What lights may name.
    pub maps: Maps,
    /// Of all random numbers.
    pub seed: u64,
    /// Counts edits of materials: shots of before are stale.
    pub edition: u64,
}

/// Why there is no picture.
#[derive(Debug, PartialEq, Eq)]
pub enum NoPicture {
    /// Something else came first.
    Interrupted,
    /// It can't be made, in words.
    Refused(String),
}

/// A picture in linear light.
pub struct Painted {
    /// All layers of the frame.
    pub layers: Layers,
    /// How its light was made.
    pub choice: Choice,
    /// Milliseconds by stage, of what was done for this picture.
    pub times: Vec<(&'static str, f64)>,
    /// What its file says about it.
    pub header: ExrHeader,
    /// Frames per second of its sequence.
    pub fps: f64,
    /// How far what the asset makes is from it, where it is the reference.
    pub apart: Option<Apart>,
    /// Whether nothing better follows.
    pub last: bool,
}

struct KeptLights {
    /// What they were read from.
    text: Option<Arc<str>>,
    /// Materials that shine are those of then.
    edition: u64,
    fps: f64,
    hash: String,
    lights: Lights,
}

#[derive(PartialEq)]
struct ShotKey {
    eye: Eye,
    settings: ShotSettings,
    edition: u64,
}

/// What is kept of a tab from picture to picture: its lights, and a shot of each stage.
pub struct Painter {
    lights: Option<KeptLights>,
    shots: [Option<(ShotKey, Shot)>; 4],
    /// How many times narrower coarse pictures are.
    divisor: u32,
    /// The last coarse picture had a shot of its own.
    turned: bool,
    /// Milliseconds that a pixel's ray and functions took in the last coarse picture that had a shot of its own; 0: there was none.
    of_pixel: f64,
    /// Path tracing beside the last picture that was compared.
    reference: Option<Reference>,
}

impl Default for Painter {
    fn default() -> Painter {
        Painter {
            lights: None,
            shots: [None, None, None, None],
            divisor: 2,
            turned: false,
            of_pixel: 0.0,
            reference: None,
        }
    }
}

/// Milliseconds since `start`.
fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

fn refused(error: impl std::fmt::Display) -> NoPicture {
    NoPicture::Refused(error.to_string())
}

impl Painter {
    /// Makes a picture.
    ///
    /// # Errors
    /// [`NoPicture`].
    pub fn paint(
        &mut self,
        room: &Room<'_>,
        wish: &Wish,
        stage: Stage,
        watch: &dyn Watch,
    ) -> Result<Painted, NoPicture> {
        let mut times = Vec::new();
        let start = Instant::now();
        if self.light(room, wish)? {
            times.push(("lights", milliseconds(start)));
        }
        let Some(kept) = &self.lights else {
            return Err(NoPicture::Interrupted);
        };
        let fps = kept.fps;
        let integrator = match (wish.by, stage) {
            (By::Path, _) | (By::Both, Stage::Beside) => Tracer::default().into(),
            (By::Asset | By::Both, _) => Integrator::Auto,
        };
        let passes = self.reference.as_ref().map_or(0, |reference| reference.passes);
        let seed = match stage {
            Stage::Beside => room.seed.wrapping_add(1 + u64::from(passes)),
            _ => room.seed,
        };
        let settings = frame_settings(wish, stage, seed);
        let choice = (room.player)
            .choose(&integrator, &kept.lights, wish.time, &settings)
            .map_err(refused)?;
        let traced = matches!(choice.integrator, Integrator::Traced(_));
        let shot_settings = self.shot_settings(wish, stage, &choice, integrator);
        let key = ShotKey {
            eye: wish.eye,
            settings: shot_settings,
            edition: room.edition,
        };
        let header = (room.player).header(&FrameOrigin {
            camera: (&key.eye.camera(), ""),
            shot: &key.settings,
            choice: &choice,
            seed: room.seed,
            fps: kept.fps,
            frame: wish.time as u32,
            sequence_hash: &kept.hash,
        });
        let slot = &mut self.shots[stage as usize];
        let turned = slot.as_ref().is_none_or(|(of, _)| *of != key);
        if turned {
            *slot = None;
            let shot = (room.player)
                .shot_watched(&key.eye.camera(), &key.settings, watch)
                .map_err(|error| match error {
                    ShotError::Cancelled(_) => NoPicture::Interrupted,
                    ShotError::Choice(error) => refused(error),
                })?;
            if let Shot::Relit(shot) = &shot {
                times.extend([("expose", shot.times.expose), ("weigh", shot.times.weigh)]);
                if stage == Stage::Coarse {
                    let pixels = key.settings.width * key.settings.height;
                    self.of_pixel = (shot.times.expose + shot.times.weigh) / pixels.max(1) as f64;
                }
            }
            *slot = Some((key, shot));
        }
        let Some((_, shot)) = slot else {
            return Err(NoPicture::Interrupted);
        };
        let frame = (room.player)
            .frame_watched(shot, &kept.lights, wish.time, &settings, watch)
            .map_err(|error| match error {
                FrameError::Cancelled(_) => NoPicture::Interrupted,
                FrameError::Stale => refused(error),
            })?;
        for (name, figure) in frame.stats.figures() {
            if let Figure::Milliseconds(time) = figure {
                times.push((name, time));
            }
        }
        if stage == Stage::Coarse {
            // The first shot of a place tells nothing about the pictures that follow it.
            if turned == self.turned {
                self.adapt(&times, wish.size.0, traced);
            }
            self.turned = turned;
        }
        let mut painted = Painted {
            layers: frame.layers,
            choice: frame.choice,
            times,
            header,
            fps,
            apart: None,
            last: true,
        };
        match stage {
            Stage::Final if wish.compares() => self.compare_with(wish, &painted.layers),
            Stage::Beside => self.add_pass(wish, &mut painted)?,
            _ => {}
        }
        Ok(painted)
    }

    /// Begins path tracing beside a picture of the asset, unless it goes on.
    fn compare_with(&mut self, wish: &Wish, layers: &Layers) {
        let Some(own) = layers.rgb(wish.layer_of_frame()) else {
            return;
        };
        let goes_on = (self.reference.as_ref())
            .is_some_and(|reference| reference.wish.is_alike_in_light(wish) && reference.own == own);
        if !goes_on {
            self.reference = Some(Reference::new(wish, own));
        }
    }

    /// Adds one pass of path tracing: the picture is then the mean of all.
    fn add_pass(&mut self, wish: &Wish, painted: &mut Painted) -> Result<(), NoPicture> {
        // The final picture came before, or comes again.
        let Some(reference) = (self.reference.as_mut()).filter(|r| r.wish.is_alike_in_light(wish)) else {
            return Err(NoPicture::Interrupted);
        };
        let layer = wish.layer_of_frame();
        let pass = (painted.layers.rgb(layer))
            .ok_or_else(|| NoPicture::Refused(format!("path tracing makes no layer {layer:?}")))?;
        if reference.passes < MOST_PASSES {
            reference.add(&pass);
        }
        painted.layers = Layers::new(pass.width, pass.height);
        painted.layers.push_rgb(layer, &reference.mean().pixels);
        painted.apart = reference.apart();
        painted.last = reference.passes >= MOST_PASSES;
        Ok(())
    }

    /// Prepares the wish's lights, unless they are those of before; whether it did.
    fn light(&mut self, room: &Room<'_>, wish: &Wish) -> Result<bool, NoPicture> {
        let same = |kept: &KeptLights| {
            kept.edition == room.edition
                && match (&kept.text, &wish.lights) {
                    (Some(old), Some(new)) => Arc::ptr_eq(old, new),
                    (None, None) => true,
                    _ => false,
                }
        };
        if self.lights.as_ref().is_some_and(same) {
            return Ok(false);
        }
        let read = match &wish.lights {
            Some(text) => Some(parse_sequence_with(text, &room.maps, "the lights").map_err(refused)?),
            None => None,
        };
        let sequence = read.as_ref().unwrap_or(room.sequence);
        let lights = match &self.lights {
            Some(before) => room.player.lights_after(&before.lights, &sequence.lights),
            None => room.player.lights(&sequence.lights),
        };
        let lights = lights.map_err(refused)?;
        self.lights = Some(KeptLights {
            text: wish.lights.clone(),
            edition: room.edition,
            fps: sequence.fps,
            hash: sequence_hash(sequence),
            lights,
        });
        Ok(true)
    }

    /// The wish's lights, ready to shine.
    ///
    /// # Errors
    /// [`NoPicture::Refused`]: they can't.
    pub fn lights_of(&mut self, room: &Room<'_>, wish: &Wish) -> Result<Option<&Lights>, NoPicture> {
        self.light(room, wish)?;
        Ok(self.lights.as_ref().map(|kept| &kept.lights))
    }

    fn shot_settings(
        &self,
        wish: &Wish,
        stage: Stage,
        choice: &Choice,
        integrator: Integrator,
    ) -> ShotSettings {
        let still = stage == Stage::Final;
        let divisor = match stage {
            Stage::Coarse => self.divisor,
            Stage::Middle => self.middle_divisor(wish.size),
            Stage::Final | Stage::Beside => 1,
        };
        let side = |pixels: u32| pixels.div_ceil(divisor) as usize;
        ShotSettings {
            integrator,
            width: side(wish.size.0),
            height: side(wish.size.1),
            samples: (!still).then_some(1),
            moving: !still,
            sites: match choice.cuts {
                CutUse::Nothing => None,
                _ if still => Some(CutSites::Own),
                _ => Some(CutSites::Around),
            },
        }
    }

    /// How many times narrower the picture is that refines a coarse one.
    fn middle_divisor(&self, (width, height): (u32, u32)) -> u32 {
        let whole = self.of_pixel * f64::from(width) * f64::from(height);
        let narrower = (whole / MIDDLE_TARGET).sqrt().ceil().max(1.0);
        (narrower as u32).min(self.divisor)
    }

    /// Makes coarse pictures of a picture so wide smaller where they take too long for their pixels, and larger where time is left.
    fn adapt(&mut self, times: &[(&'static str, f64)], width: u32, traced: bool) {
        const OF_PIXELS: [&str; 7] = [
            "expose",
            "weigh",
            "direct_pixels",
            "reconstruct",
            "shade",
            "resolve",
            "render",
        ];
        let all: f64 = times.iter().map(|(_, time)| time).sum();
        let of_pixels: f64 = times
            .iter()
            .filter(|(name, _)| OF_PIXELS.contains(name))
            .map(|(_, time)| time)
            .sum();
        let most = match traced {
            true => MOST_DIVISOR_TRACED,
            false => (width / LEAST_WIDTH).max(1),
        };
        self.divisor = self.divisor.min(most);
        // The time that such a picture would take with another divisor.
        let with = |divisor: u32| {
            let sides = f64::from(self.divisor) / f64::from(divisor);
            all - of_pixels + of_pixels * sides * sides
        };
        if self.divisor < most && all > COARSE_TARGET && all - with(self.divisor + 1) > WORTHWHILE * all {
            self.divisor += 1;
        } else if self.divisor > 1 {
            let larger = with(self.divisor - 1);
            // Half of the bounds on the way back, so that it does not go to and fro.
            if larger < 0.6 * COARSE_TARGET || larger - all < 0.5 * WORTHWHILE * larger {
                self.divisor -= 1;
            }
        }
    }
}

fn frame_settings(wish: &Wish, stage: Stage, seed: u64) -> FrameSettings {
    let settings = FrameSettings {
        seed,
        cut_layers: ["cut_size", "nodes"].contains(&wish.layer.as_str()),
        levels: wish.levels(),
        light_layers: wish.layer.starts_with("light."),
        surface_layers: ["albedo", "normal", "depth"].contains(&wish.layer.as_str()),
        ..FrameSettings::default()
    };
    if stage == Stage::Coarse {
        return FrameSettings {
            pixel_samples: COARSE_RAYS.0,
            point_samples: COARSE_RAYS.1,
            coarse: true,
            ..settings
        };
    }
    settings
}
