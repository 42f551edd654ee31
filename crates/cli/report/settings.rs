//! What a report tries: options of `bake` and `play`, varied one at a time.

use relight_bake::params::{BakeParams, Preset};
use relight_format::{Asset, LightSamples};
use relight_scene::image::BEAUTY;
use relight_scene::light::LightTrack;
use relight_scene::sequence::Sequence;
use relight_scene::traced::Shading;

/// One thing to try.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Name of the integrator.
    pub integrator: &'static str,
    /// Options of `bake` if the scene is baked anew, all of them; empty: the asset itself.
    pub bake: Vec<String>,
    /// What of `bake` differs from the asset: option and value.
    pub varied: Option<(&'static str, String)>,
    /// Options of `play` beside the integrator: option and value.
    pub play: Vec<(&'static str, String)>,
    /// The layer by which it is judged: all that the integrator makes.
    pub layer: &'static str,
}

impl Setting {
    fn play(integrator: &'static str, layer: &'static str, play: &[(&'static str, &str)]) -> Setting {
        Setting {
            integrator,
            bake: Vec::new(),
            varied: None,
            play: play
                .iter()
                .map(|(option, value)| (*option, (*value).to_owned()))
                .collect(),
            layer,
        }
    }

    /// Words of the play command.
    pub fn play_words(&self) -> Vec<String> {
        let mut words = vec!["--integrator".to_owned(), self.integrator.to_owned()];
        for (option, value) in &self.play {
            words.push((*option).to_owned());
            words.push(value.clone());
        }
        words
    }

    /// What identifies it in tables: the options, shortened to what is varied.
    pub fn label(&self) -> String {
        let play = self
            .play
            .iter()
            .map(|(o, v)| format!("{} {v}", o.trim_start_matches("--")));
        let bake = self
            .varied
            .iter()
            .map(|(o, v)| format!("bake {} {v}", o.trim_start_matches("--")));
        let parts: Vec<String> = bake.chain(play).collect();
        if parts.is_empty() {
            self.integrator.to_owned()
        } else {
            format!("{} ({})", self.integrator, parts.join(", "))
        }
    }

    /// The commands in full, for an asset and options of every play. Plays do not share the references' random numbers.
    pub fn command_of(&self, asset: &str, common: &str, seed: u64) -> String {
        let (bake, asset) = if self.bake.is_empty() {
            (String::new(), asset)
        } else {
            let bake = format!(
                "relight bake SCENE -o other.relight {} --seed {seed} && ",
                self.bake.join(" ")
            );
            (bake, "other.relight")
        };
        format!(
            "{bake}relight play {asset} {} {common} -o frame_####.exr --seed {}",
            self.play_words().join(" "),
            seed ^ 1
        )
    }

    /// The commands that do the same by hand.
    pub fn command(&self) -> String {
        let play = format!("relight play ASSET {}", self.play_words().join(" "));
        if self.bake.is_empty() {
            play
        } else {
            format!("relight bake SCENE {} && {play}", self.bake.join(" "))
        }
    }
}

/// What the choice of settings hangs on.
pub struct Facts {
    /// Options of `bake` that made the asset.
    pub base: Vec<(&'static str, String)>,
    /// Whether it was baked with `--lambert`.
    pub shading: Shading,
    has_points: bool,
    cuts: Option<&'static str>,
    /// An environment or a sky shines.
    distant: bool,
    levels: usize,
    sender_levels: usize,
    epsilon: f32,
    coarse_radius: Option<f32>,
}

impl Facts {
    /// Of an asset under a sequence.
    pub fn new(asset: &Asset, sequence: &Sequence) -> Facts {
        let settings = &asset.provenance.settings;
        let value = |name: &str| settings.iter().find(|s| s.0 == name).map(|s| s.1.as_str());
        let number = |name: &str| value(name).and_then(|v| v.parse::<f32>().ok());
        let mut base = Vec::new();
        if let Some(rays) = number("rays") {
            let of = |preset| BakeParams::preset(preset).rays as f32 == rays;
            let presets = [
                ("draft", Preset::Draft),
                ("standard", Preset::Standard),
                ("fine", Preset::Fine),
            ];
            if let Some((name, _)) = presets.into_iter().find(|p| of(p.1)) {
                base.push(("--preset", name.to_owned()));
            }
        }
        // Values that are words ("automatic", "converged") are the options' defaults.
        for (name, option) in [
            ("levels", "--levels"),
            ("sender_levels", "--sender-levels"),
            ("coarse_radius", "--coarse-radius"),
            ("epsilon", "--epsilon"),
            ("bounces", "--bounces"),
            ("cut_lights", "--cut-lights"),
            ("sigma", "--sigma"),
            ("beta", "--beta"),
            ("cut_nodes", "--cut-nodes"),
        ] {
            if let (Some(text), Some(_)) = (value(name), number(name)) {
                base.push((option, text.to_owned()));
            }
        }
        base.extend(value("cuts").map(|text| ("--cuts", text.to_owned())));
        for viewpoint in value("viewpoints")
            .filter(|v| *v != "automatic")
            .into_iter()
            .flat_map(str::split_whitespace)
        {
            base.push(("--viewpoint", viewpoint.to_owned()));
        }
        let cuts = asset.light_tree.as_ref().map(|tree| match tree.lights {
            LightSamples::Environment { .. } => "environment",
            LightSamples::Surface { .. } => "indirect",
        });
        Facts {
            base,
            shading: if asset.provenance.lambert {
                Shading::Lambert
            } else {
                Shading::Full
            },
            has_points: asset.transfer.is_some() || asset.solution.is_some(),
            cuts,
            distant: sequence.lights.iter().any(LightTrack::is_distant),
            levels: number("levels").map_or(0, |n| n as usize),
            sender_levels: number("sender_levels").map_or(0, |n| n as usize),
            epsilon: number("epsilon").unwrap_or(0.018),
            coarse_radius: asset.points.first().map(|level| level.disk_radius),
        }
    }

    /// The asset's bake with one option changed.
    fn baked(&self, option: &'static str, value: String) -> Setting {
        let others = self.base.iter().filter(|(name, _)| *name != option);
        let mut bake: Vec<String> = others
            .flat_map(|(name, value)| [(*name).to_owned(), value.clone()])
            .collect();
        bake.extend([option.to_owned(), value.clone()]);
        Setting {
            bake,
            varied: Some((option, value)),
            ..Setting::play("auto", BEAUTY, &[])
        }
    }
}

/// What to try, in the order of what it tells; `full` for all of it.
pub fn sweep(facts: &Facts, full: bool) -> Vec<Setting> {
    let mut all = Vec::new();
    let by_cuts = facts.cuts == Some("indirect") || (facts.cuts == Some("environment") && facts.distant);
    if facts.has_points {
        all.push(Setting::play("auto", BEAUTY, &[]));
        for spp in ["1", "4"] {
            all.push(Setting::play("auto", BEAUTY, &[("--spp", spp)]));
        }
        if by_cuts {
            all.push(Setting::play("transfer", BEAUTY, &[]));
        }
    }
    let samples: &[&str] = if full {
        &["1", "4", "16", "64", "256"]
    } else {
        &["1", "4", "16", "64"]
    };
    for spp in samples {
        all.push(Setting::play("path", BEAUTY, &[("--spp", spp)]));
    }
    for spp in &samples[..3] {
        all.push(Setting::play(
            "path",
            "direct",
            &[("--spp", spp), ("--max-bounces", "1")],
        ));
        all.push(Setting::play("brute", "direct", &[("--spp", spp)]));
    }
    if by_cuts {
        let layer = if facts.cuts == Some("environment") {
            "direct"
        } else {
            BEAUTY
        };
        let sizes: &[&str] = if full {
            &["32", "64", "128", "256", "512", "1024", "2048"]
        } else {
            &["64", "256", "1024"]
        };
        for nodes in sizes {
            all.push(Setting::play("cuts", layer, &[("--illumination-cut", nodes)]));
        }
    }
    let mut bakes = if facts.has_points {
        bakes(facts, full)
    } else {
        Vec::new()
    };
    let finer = bakes.split_off(bakes.len().min(COARSER));
    all.extend(bakes);
    all.extend(many_lights(full));
    all.extend(finer);
    if by_cuts {
        for sigma in if full { &["1", "1.5", "3", "4"][..] } else { &["4"] } {
            all.push(facts.baked("--sigma", (*sigma).to_owned()));
        }
        all.push(facts.baked("--cut-lights", "8192".to_owned()));
    }
    all
}

/// Bakes before the integrators over points: those that are coarser than the asset's own, and so quicker.
const COARSER: usize = 3;

/// Virtual lights of the integrators over lights without extent: indirect light of some tens of lights a reflection.
const VIRTUAL: &str = "2000";

/// All light by points: clusters of lights, clusters of pixels, and every point with a shadow ray, which shows what the points
/// themselves err by. One eye ray a pixel in all but reconstruction, which chooses its own.
fn many_lights(full: bool) -> Vec<Setting> {
    let points = [("--vpls", VIRTUAL), ("--spp", "1")];
    let of = |integrator, more: &[(&'static str, &str)]| {
        Setting::play(integrator, BEAUTY, &[&points[..], more].concat())
    };
    let mut all = vec![of("lightcuts", &[]), of("pixelcuts", &[]), of("brute", &[])];
    let ratios: &[&str] = if full {
        &["0.005", "0.01", "0.05", "0.1"]
    } else {
        &["0.1"]
    };
    all.push(of("lightcuts", &[("--cluster-visibility", "representative")]));
    all.extend(ratios.iter().map(|r| of("lightcuts", &[("--error-ratio", r)])));
    let nodes: &[&str] = if full { &["50", "100", "300"] } else { &["100"] };
    all.extend(nodes.iter().map(|n| of("lightcuts", &[("--max-nodes", n)])));
    all.push(Setting::play(
        "lightcuts",
        BEAUTY,
        &[("--vpls", VIRTUAL), ("--reconstruction", "on")],
    ));
    let clusters: &[&str] = if full {
        &["256", "512", "1024", "4096"]
    } else {
        &["512"]
    };
    all.extend(clusters.iter().map(|k| of("pixelcuts", &[("--clusters", k)])));
    let trees: &[&str] = if full { &["1", "16", "64"] } else { &["16"] };
    all.extend(trees.iter().map(|l| of("pixelcuts", &[("--trees", l)])));
    all
}

fn bakes(facts: &Facts, full: bool) -> Vec<Setting> {
    let mut all = Vec::new();
    let epsilon = |factor: f32| facts.baked("--epsilon", (facts.epsilon * factor).to_string());
    all.push(epsilon(4.0));
    if facts.levels > facts.sender_levels.max(1) {
        all.push(facts.baked("--levels", (facts.levels - 1).to_string()));
    }
    let factors: &[f32] = if full { &[1.4, 2.0, 0.7] } else { &[1.4] };
    for (factor, radius) in factors.iter().zip(facts.coarse_radius.into_iter().cycle()) {
        let radius = radius * factor;
        // Three digits.
        let digits = (2.0 - radius.log10().floor()).max(0.0) as usize;
        all.push(facts.baked("--coarse-radius", format!("{radius:.digits$}")));
    }
    let factors: &[f32] = if full { &[2.0, 0.5, 0.25] } else { &[0.5] };
    all.extend(factors.iter().map(|&factor| epsilon(factor)));
    if facts.sender_levels > 1 && full {
        all.push(facts.baked("--sender-levels", (facts.sender_levels - 1).to_string()));
    }
    if full {
        all.push(facts.baked("--levels", (facts.levels + 1).to_string()));
    }
    for bounces in if full { &["1", "2", "4"][..] } else { &["1"] } {
        all.push(facts.baked("--bounces", (*bounces).to_owned()));
    }
    all
}
