//! Options of `relight bake`, and what they mean.

use crate::failure::Failure;
use crate::options::{LightUnitsName, ReplaceArgs, above_0, parse_point, real, relative_error, whole};
use clap::{Args, ValueEnum};
use glam::DVec3;
use relight_bake::params::{BakeParams, CutMode, CutParams, Omittable, Preset};
use relight_scene::traced::Shading;
use std::path::{Path, PathBuf};

/// Turn a glTF scene into an asset that can be relit.
///
/// Spreads a hierarchy of points over the surfaces that light can carry to the viewer, finds how strongly they
/// light each other, and writes geometry, materials, points and links into one file. Times and memory go into
/// ASSET.relight.log.json beside it.
///
/// Ends with a check of its own against path-traced probes, near the camera that `play` takes by itself, under --lights, else the scene's own
/// lights, else test lights: what indirect light is expected to err by is stored in the asset, and `play` and `inspect` repeat it.
#[derive(Args)]
#[command(after_help = "\
The JSON of --json: points (per level, coarsest first), links, potential_links, rays, seconds (per stage, total, check: measuring itself,
ray_tracing: thread-seconds in rays / threads), bytes (per section raw and stored, total), peak_memory_bytes, row_bytes
(memory of reconstructed rows), left_out (what, why, saved_bytes, saved_rays, and with the bake's log saved_seconds:
those rays at the bake's own pace), expected (of indirect light, by the bake's own check: error, bias, error_noise and bias_noise,
their standard errors; without_points, without_light, wide, shares of what it saw; target), and with --resume units (all, reused).
Of --dry-run: points, rays, links, seconds, bytes, memory_bytes, row_bytes. Of --plan: units.")]
pub struct BakeArgs {
    /// Scene to bake: .glb or .gltf, or .scene.json, which describes boxes, implicit surfaces and isosurfaces of volumes
    /// (data/README.md); they become triangles.
    #[arg(value_name = "SCENE", required_unless_present_any = ["unit", "merge"])]
    pub scene: Option<PathBuf>,
    /// Asset to write; an existing one is replaced when the new one is complete, another file only with --force.
    #[arg(short, long, value_name = "ASSET.relight", required_unless_present_any = ["unit", "merge"])]
    pub output: Option<PathBuf>,
    /// Quality: draft (seconds, to try lights and cameras), standard, or fine (half the standard error, several
    /// times the bake). The options below win over it.
    #[arg(long, value_enum, default_value_t = PresetName::Standard)]
    pub preset: PresetName,
    /// Choose levels, sender levels, epsilon and rays for this error of indirect light, such as 0.08 or 8%: the root of relMSE of
    /// the indirect layer, as `report` lists it, estimated at other viewpoints near the camera that `play` takes by itself, under --lights (or the
    /// scene's own lights, or a lamp). Bakes ever finer settings until one will do; exit code 3 where none does.
    #[arg(long, value_name = "E", value_parser = relative_error,
          conflicts_with_all = ["preset", "levels", "sender_levels", "epsilon", "resume", "plan", "unit", "merge", "dry_run"])]
    pub target_error: Option<f64>,
    /// Keep only what this lighting sequence can use. Without it the asset keeps what any light could use.
    #[arg(long, value_name = "SEQ.json")]
    pub lights: Option<PathBuf>,
    /// Receiver levels, 1 to 12: each halves the distance of the points of the one before [standard: 6].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(1, 12))]
    pub levels: Option<usize>,
    /// Sender levels, 1 to 12: so many of the coarsest levels send light [standard: 5].
    #[arg(long, value_name = "N", value_parser = whole::<usize>(1, 12))]
    pub sender_levels: Option<usize>,
    /// Distance of the points of the coarsest level, metres [default: from the scene].
    #[arg(long, value_name = "R", value_parser = above_0(1e12, ", in metres"))]
    pub coarse_radius: Option<f32>,
    /// How little a link may change and still be kept: fewer links for larger numbers, as in the paper, whose setting is
    /// 0.025 with three sender levels; at most 100 [standard: 0.018].
    #[arg(long, value_name = "E", value_parser = above_0(100.0, ""))]
    pub epsilon: Option<f32>,
    /// Bounces of indirect light [default: to convergence].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, u32::MAX))]
    pub bounces: Option<u32>,
    /// Solve the bounces now instead of at play time: frames get faster, and reflectances can no longer be
    /// edited.
    #[arg(long)]
    pub solution: bool,
    /// Visibility cuts: none; environment, for shadows and glossy reflections of environment maps and skies; auto, the same
    /// if --lights has one or is not given; or indirect, for glossy reflections of lit surfaces, by one bounce of any
    /// light.
    #[arg(long, value_enum, default_value_t = CutsName::None)]
    pub cuts: CutsName,
    /// Even directions, or even samples of the surfaces, that the cuts cluster: a power of two, 256 to 1048576 [default: 32768].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(256, 1_048_576))]
    pub cut_lights: Option<u32>,
    /// Threshold of a cut's nodes, for 32768 lights: 1.5 to 3 is usual; larger makes cuts shorter and shadows
    /// coarser [default: 2].
    #[arg(long, value_name = "S", value_parser = above_0(1000.0, " (1.5 to 3 is usual)"))]
    pub sigma: Option<f32>,
    /// What the tree of those lights minds: 1 geometry alone, 0 visibility alone [default: 0.45].
    #[arg(long, value_name = "B", value_parser = real(0.0, 1.0))]
    pub beta: Option<f32>,
    /// Most nodes of one visibility cut [default: 4096].
    #[arg(long, value_name = "N", value_parser = whole::<u32>(1, 1_048_576))]
    pub cut_nodes: Option<u32>,
    /// A place from which the scene is looked at, in the coordinates of its file, beside the cameras of the scene and of --lights: surfaces from which light
    /// reaches none of them get no points. May be given several times [default: the cameras alone or, without any, places in open
    /// space].
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true)]
    pub viewpoint: Vec<DVec3>,
    /// Keep what the scene and --lights cannot use, with commas between them: all, lights (the scene's own), emission,
    /// materials (maps, textures, coordinates, colours), points (on surfaces that no light path joins to the viewpoints), senders
    /// (levels that no link uses), bounces (the operator of the third bounce and further ones), cuts (of environments,
    /// with --cuts auto), precision (bits of links far below --epsilon, colour of grey points). Links below significance are
    /// kept by a smaller --epsilon.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    pub keep: Vec<KeepName>,
    /// Only the cameras of the scene and of --lights will look: surfaces that none of them sees get no fine receivers.
    #[arg(long)]
    pub cameras_only: bool,
    /// End with exit code 3 where the bake's own check finds it wrong: a bias of indirect light beyond 5 %, or an error beyond 25 %, by more
    /// than the check's noise. The asset is written all the same.
    #[arg(long)]
    pub strict: bool,
    /// Treat every material as Lambert with its base colour, for comparison with other renderers: metallic,
    /// roughness, transmission and normal maps are ignored, emission and alpha are kept.
    #[arg(long)]
    pub lambert: bool,
    /// How the exporter wrote light intensities: spec (candela and lux, as KHR_lights_punctual has them),
    /// unitless (W/sr), or raw (watts).
    #[arg(long, value_enum, default_value_t = LightUnitsName::Spec)]
    pub light_units: LightUnitsName,
    /// The variant of materials to bake alone (KHR_materials_variants), by its name; without it, the materials that the
    /// file shows by itself, and material edits show any variant.
    #[arg(long, value_name = "NAME")]
    pub variant: Option<String>,
    #[command(flatten)]
    pub long: LongArgs,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Print one JSON object on stdout.
    #[arg(long)]
    pub json: bool,
}

/// Options of long bakes.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Long bakes")]
pub struct LongArgs {
    /// Keep finished units of work in ASSET.relight.units, and go on from what is there: after Ctrl-C, a kill, or a
    /// loss of power the same command continues. The asset is the same, byte by byte. Units are removed when the asset is
    /// written.
    #[arg(long)]
    pub resume: bool,
    /// Leave the units of the finished bake where they are (with --resume): a later bake with --resume takes over all
    /// that an edit of scene, lights or settings does not reach.
    #[arg(long, requires = "resume")]
    pub keep_units: bool,
    /// Do not bake: say what the bake will take (points, rays, links, seconds on this machine, bytes of the asset,
    /// memory), from a small bake of the same scene, a sixteenth of the work.
    #[arg(long, conflicts_with_all = ["plan", "unit", "merge"])]
    pub dry_run: bool,
    /// Do not bake: make a plan of N units in DIR, for any number of processes and machines that see DIR and SCENE at the
    /// same paths. With --json prints {"units": N}. Next, for I = 1 to N in any order and at once: relight bake
    /// --unit I/N DIR; then: relight bake --merge DIR.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["resume"])]
    pub plan: Option<PathBuf>,
    /// With --plan: also write DIR/slurm/submit.sh, which submits the units as a job array and the merge after them.
    /// Options of sbatch may be given to it.
    #[arg(long, requires = "plan")]
    pub slurm: bool,
    /// Compute unit I of the N units of the plan in DIR. May be repeated, killed and started again.
    #[arg(long, num_args = 2, value_names = ["I/N", "DIR"],
          conflicts_with_all = ["scene", "output", "plan", "resume", "merge"])]
    pub unit: Option<Vec<PathBuf>>,
    /// Write the asset that the plan in DIR is for, once all its units are done: the bytes of a bake in one go.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["scene", "output", "plan", "resume"])]
    pub merge: Option<PathBuf>,
}

/// Names of presets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PresetName {
    /// Seconds instead of tens of seconds.
    Draft,
    /// The default.
    Standard,
    /// Half the standard error or less.
    Fine,
}

/// What visibility cuts are made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CutsName {
    /// No cuts.
    None,
    /// Environment maps and skies.
    Environment,
    /// Those, if one may shine.
    Auto,
    /// The first bounce of any light.
    Indirect,
}

/// What to keep although nothing uses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum KeepName {
    /// Everything.
    All,
    /// The scene's own lights.
    Lights,
    /// Emission of materials.
    Emission,
    /// What materials look up.
    Materials,
    /// Points on unreachable surfaces.
    Points,
    /// Sender levels without links.
    Senders,
    /// The bounce operator.
    Bounces,
    /// Cuts of environments.
    Cuts,
    /// Bits.
    Precision,
}

impl KeepName {
    fn parts(self) -> Vec<Omittable> {
        let name = self.to_possible_value();
        let named = |part: &Omittable| name.as_ref().is_some_and(|n| n.matches(part.name(), false));
        match self {
            KeepName::All => Omittable::ALL.to_vec(),
            _ => Omittable::ALL.into_iter().filter(named).collect(),
        }
    }
}

/// The parameters that the options make, for a scene that was moved by `offset` from the coordinates of its file.
///
/// # Errors
/// The options contradict each other.
pub fn params(args: &BakeArgs, seed: u64, offset: DVec3) -> Result<BakeParams, Failure> {
    let mut params = BakeParams::preset(match args.preset {
        PresetName::Draft => Preset::Draft,
        PresetName::Standard => Preset::Standard,
        PresetName::Fine => Preset::Fine,
    });
    params.levels = args.levels.unwrap_or(params.levels);
    params.sender_levels = args
        .sender_levels
        .unwrap_or(params.sender_levels.min(params.levels));
    params.coarse_radius = args.coarse_radius;
    params.epsilon = args.epsilon.unwrap_or(params.epsilon);
    params.bounces = args.bounces;
    params.solution = args.solution;
    params.cuts = cut_params(args)?;
    params.viewpoints = (args.viewpoint.iter())
        .map(|place| (*place - offset).as_vec3())
        .collect();
    params.cameras_only = args.cameras_only;
    params.keep = Omittable::ALL.to_vec();
    (params.keep).retain(|part| args.keep.iter().any(|name| name.parts().contains(part)));
    params.seed = seed;
    relight_bake::settings::validate(&params).map_err(|error| Failure::Usage(error.to_string()))?;
    Ok(params)
}

fn cut_params(args: &BakeArgs) -> Result<Option<CutParams>, Failure> {
    let given = [
        ("--cut-lights", args.cut_lights.is_some()),
        ("--sigma", args.sigma.is_some()),
        ("--beta", args.beta.is_some()),
        ("--cut-nodes", args.cut_nodes.is_some()),
    ];
    let mode = match args.cuts {
        CutsName::Environment | CutsName::Auto => CutMode::Environment,
        CutsName::Indirect => CutMode::Indirect,
        CutsName::None => {
            return match given.iter().find(|option| option.1) {
                None => Ok(None),
                Some((option, _)) => Err(Failure::Usage(format!(
                    "{option} belongs to visibility cuts, which --cuts environment and --cuts indirect bake"
                ))),
            };
        }
    };
    let defaults = CutParams::default();
    Ok(Some(CutParams {
        mode,
        lights: args.cut_lights.unwrap_or(defaults.lights),
        sigma: args.sigma.unwrap_or(defaults.sigma),
        beta: args.beta.unwrap_or(defaults.beta),
        most: args.cut_nodes.map_or(defaults.most, |most| most as usize),
        if_used: args.cuts == CutsName::Auto,
    }))
}

impl BakeArgs {
    /// The scene that is baked.
    ///
    /// # Errors
    /// None was given, which only `--unit` and `--merge` allow.
    pub fn scene(&self) -> Result<&Path, Failure> {
        self.scene
            .as_deref()
            .ok_or_else(|| Failure::Usage("give the scene to bake".into()))
    }

    /// The asset that is written.
    ///
    /// # Errors
    /// As [`BakeArgs::scene`].
    pub fn output(&self) -> Result<&Path, Failure> {
        self.output
            .as_deref()
            .ok_or_else(|| Failure::Usage("give the asset to write with -o".into()))
    }

    /// How materials are evaluated.
    pub fn shading(&self) -> Shading {
        if self.lambert {
            Shading::Lambert
        } else {
            Shading::Full
        }
    }

    /// The command line that bakes the same again, from any folder, without the options of long bakes.
    ///
    /// # Errors
    /// A path does not exist or is not UTF-8.
    pub fn words(&self) -> Result<Vec<String>, Failure> {
        let text = |path: &Path| {
            let path = std::path::absolute(path)?;
            path.to_str()
                .map(str::to_owned)
                .ok_or_else(|| anyhow::anyhow!("{}: its name is not UTF-8", path.display()))
        };
        fn name<T: ValueEnum>(value: &T) -> Option<String> {
            value.to_possible_value().map(|v| v.get_name().to_owned())
        }
        let number = |n: Option<f32>| n.map(|n| n.to_string());
        let count = |n: Option<usize>| n.map(|n| n.to_string());
        let lights = self.lights.as_deref().map(text).transpose()?;
        let mut words = vec![text(self.scene()?)?, "-o".into(), text(self.output()?)?];
        for (option, value) in [
            ("--preset", name(&self.preset)),
            ("--lights", lights),
            ("--levels", count(self.levels)),
            ("--sender-levels", count(self.sender_levels)),
            ("--coarse-radius", number(self.coarse_radius)),
            ("--epsilon", number(self.epsilon)),
            ("--bounces", self.bounces.map(|n| n.to_string())),
            ("--cuts", name(&self.cuts)),
            ("--cut-lights", self.cut_lights.map(|n| n.to_string())),
            ("--sigma", number(self.sigma)),
            ("--beta", number(self.beta)),
            ("--cut-nodes", self.cut_nodes.map(|n| n.to_string())),
            ("--light-units", name(&self.light_units)),
            ("--variant", self.variant.clone()),
        ] {
            // One word each: a value may begin with a dash.
            words.extend(value.map(|value| format!("{option}={value}")));
        }
        words.extend(
            self.viewpoint
                .iter()
                .map(|v| format!("--viewpoint={},{},{}", v.x, v.y, v.z)),
        );
        words.extend((self.keep.iter().filter_map(name)).map(|what| format!("--keep={what}")));
        for (option, given) in [
            ("--solution", self.solution),
            ("--lambert", self.lambert),
            ("--cameras-only", self.cameras_only),
            ("--strict", self.strict),
            ("--force", self.replace.force),
        ] {
            words.extend(given.then(|| option.to_owned()));
        }
        Ok(words)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use glam::Vec3;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: BakeArgs,
    }

    fn parsed(words: &[String]) -> BakeArgs {
        Line::try_parse_from(std::iter::once("bake".to_owned()).chain(words.iter().cloned()))
            .unwrap()
            .args
    }

    /// A plan's units bake what the plan was made for, whatever options it had.
    #[test]
    fn words_say_all_that_was_asked_for() {
        let all = "/s.glb -o /a.relight --preset fine --lights /l.json --levels 5 --sender-levels 3 --coarse-radius 0.3 \
                   --epsilon 0.07 --bounces 3 --solution --cuts indirect --cut-lights 1024 \
                   --sigma 1.7 --beta 0.1 --cut-nodes 77 --viewpoint -1,2.5,3e-7 --viewpoint 0,0,0.1 --lambert --light-units raw --variant beach \
                   --keep lights,senders --cameras-only --strict --force";
        let given = parsed(&all.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
        let again = parsed(&given.words().unwrap());
        let params = |args| params(args, 7, DVec3::X).unwrap();
        assert_eq!(params(&again), params(&given));
        assert_eq!(params(&given).viewpoints[0], Vec3::new(-2.0, 2.5, 3e-7));
        assert_eq!(again.words().unwrap(), given.words().unwrap());
        assert_eq!((again.lambert, again.light_units), (true, LightUnitsName::Raw));
        assert_eq!(again.variant.as_deref(), Some("beach"));
        assert_eq!(again.lights, given.lights);
        assert_eq!(again.scene().unwrap(), Path::new("/s.glb"));
    }
}
