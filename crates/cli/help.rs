//! What `relight help` adds to what options say of themselves: headings, and three examples per command.

use crate::frames::FrameRange;
use clap::{Arg, Command};
use std::any::TypeId;
use std::time::Duration;

/// Headings and the options under them, of all commands.
const HEADINGS: [(&str, &[&str]); 9] = [
    (
        "Input",
        &[
            "lights",
            "materials",
            "lambert",
            "light_units",
            "variant",
            "reference",
            "lux",
        ],
    ),
    (
        "Points and links",
        &[
            "preset",
            "target_error",
            "levels",
            "sender_levels",
            "coarse_radius",
            "epsilon",
            "bounces",
            "solution",
            "viewpoint",
            "keep",
            "cameras_only",
            "strict",
        ],
    ),
    (
        "Visibility cuts",
        &[
            "cuts",
            "cut_lights",
            "sigma",
            "beta",
            "cut_nodes",
            "illumination_cut",
        ],
    ),
    (
        "Long bakes",
        &[
            "resume",
            "keep_units",
            "dry_run",
            "plan",
            "slurm",
            "unit",
            "merge",
        ],
    ),
    (
        "Image",
        &[
            "integrator",
            "size",
            "camera",
            "frames",
            "daylight_coefficients",
            "frame",
            "spp",
            "max_bounces",
        ],
    ),
    (
        "Many lights",
        &[
            "area_samples",
            "environment_samples",
            "sun_samples",
            "sky_samples",
            "vpls",
            "clamp",
            "error_ratio",
            "max_nodes",
            "cluster_visibility",
            "reconstruction",
            "clusters",
            "trees",
            "sh_degree",
        ],
    ),
    (
        "How much is done",
        &[
            "fast",
            "case",
            "random",
            "list",
            "quick",
            "full",
            "budget",
            "frames_planned",
            "verify",
            "layer",
            "max_relmse",
        ],
    ),
    ("Server", &["port", "listen", "open", "demo"]),
    (
        "Output",
        &[
            "output",
            "what",
            "matrix_limit",
            "grid",
            "uv",
            "part",
            "per_light",
            "layers",
            "png",
            "exposure",
            "movie",
            "float",
            "images",
            "force",
            "json",
        ],
    ),
];

/// Per command three examples.
const EXAMPLES: [(&str, [&str; 3]); 13] = [
    (
        "bake",
        [
            "relight bake hall.glb -o hall.relight",
            "relight bake hall.glb -o hall.relight --preset fine --lights evening.json --resume",
            "relight bake yard.glb -o yard.relight --cuts environment --target-error 8%",
        ],
    ),
    (
        "play",
        [
            "relight play hall.relight --lights evening.json -o 'out/frame_####.exr' --png",
            "relight play hall.relight --lights evening.json --movie evening.webp --size 640x360",
            "relight play hall.relight --lights evening.json -o path.exr --frames 12-12 --integrator path --spp 256",
        ],
    ),
    (
        "view",
        [
            "relight view hall.relight",
            "relight view hall.relight --lights evening.json --open",
            "relight view --demo",
        ],
    ),
    (
        "inspect",
        [
            "relight inspect hall.relight",
            "relight inspect hall.relight --verify --json",
            "relight inspect hall.relight --lights evening.json --lux 0,0.8,0",
        ],
    ),
    (
        "check",
        [
            "relight check --fast",
            "relight check --random 40",
            "relight check hall.relight --json",
        ],
    ),
    (
        "export",
        [
            "relight export hall.relight --what lightmap --lights evening.json -o lightmap",
            "relight export hall.relight --what point-cloud --lights evening.json -o cloud",
            "relight export hall.relight --what transfer -o matrices --matrix-limit 4G",
        ],
    ),
    (
        "mix",
        [
            "relight mix hall.glb --lights evening.json -o hall_evening.glb",
            "relight mix hall.glb --lights evening.json --frame 12 -o hall_evening.glb",
            "relight mix hall.gltf --lights evening.json -o hall_evening.gltf --light-units raw",
        ],
    ),
    (
        "compare",
        [
            "relight compare relit.exr path.exr",
            "relight compare relit.exr path.exr --layer indirect --max-relmse 0.02 --json",
            "relight compare 'relit_####.exr' 'path_####.exr'",
        ],
    ),
    (
        "report",
        [
            "relight report hall.relight --lights evening.json -o report --quick",
            "relight report hall.relight --lights evening.json -o report --budget 30m --frames 0-23x8",
            "relight report hall.relight --lights evening.json -o report --full --reference references",
        ],
    ),
    (
        "schema",
        [
            "relight schema sequence",
            "relight schema materials",
            "relight schema scene",
        ],
    ),
    (
        "completions",
        [
            "relight completions bash",
            "relight completions zsh",
            "relight completions fish",
        ],
    ),
    (
        "man",
        [
            "relight man pages",
            "relight man pages --force",
            "relight man pages --quiet",
        ],
    ),
    (
        "demo",
        [
            "relight demo",
            "relight demo -o out/demo",
            "relight demo --threads 2 --progress plain",
        ],
    ),
];

/// Lets -1 or -1e9 be answered with the range of a number, instead of being taken for an option.
fn with_negative_numbers(option: Arg) -> Arg {
    let kind = option.get_value_parser().type_id();
    let numbers = [
        TypeId::of::<f32>(),
        TypeId::of::<f64>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<(usize, usize)>(),
        TypeId::of::<FrameRange>(),
        TypeId::of::<Duration>(),
    ];
    match option.get_action().takes_values() && !option.is_positional() {
        true if numbers.iter().any(|number| kind == *number) => option.allow_hyphen_values(true),
        true => option.allow_negative_numbers(true),
        false => option,
    }
}

/// The commands with their options under headings and examples at the end of their help.
pub fn complete(cli: Command) -> Command {
    let cli = cli.mut_args(with_negative_numbers);
    cli.mut_subcommands(|command| {
        let examples = EXAMPLES.iter().find(|(name, _)| *name == command.get_name());
        let examples = examples.map_or(String::new(), |(_, lines)| lines.join("\n  "));
        let before = command.get_after_help().map(|text| format!("{text}\n\n"));
        let text = format!("{}Examples:\n  {examples}", before.unwrap_or_default());
        command.after_help(text).mut_args(|option| {
            let option = with_negative_numbers(option);
            let id = option.get_id().as_str();
            match HEADINGS.iter().find(|(_, ids)| ids.contains(&id)) {
                Some((heading, _)) if !option.is_positional() => option.help_heading(*heading),
                _ => option,
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::complete;
    use crate::Cli;
    use clap::{CommandFactory, Parser};

    #[test]
    fn the_help_of_each_command_ends_with_three_examples_that_parse() {
        for mut command in complete(Cli::command()).get_subcommands().cloned() {
            let name = command.get_name().to_string();
            let help = command.render_long_help().to_string();
            let (_, examples) = help.rsplit_once("Examples:\n").expect("examples");
            let examples: Vec<&str> = examples
                .lines()
                .map(str::trim)
                .filter(|line| !line.is_empty())
                .collect();
            assert_eq!(examples.len(), 3, "{name}: {examples:?}");
            for example in examples {
                assert!(example.starts_with(&format!("relight {name}")), "{example}");
                let words = example.split_whitespace().map(|word| word.trim_matches('\''));
                if let Err(error) = Cli::try_parse_from(words) {
                    panic!("{example}: {error}");
                }
            }
        }
    }

    #[test]
    fn each_option_is_under_a_heading() {
        let mut cli = complete(Cli::command());
        cli.build();
        for command in cli.get_subcommands().filter(|c| c.get_name() != "help") {
            let own = |id: &str| !["help", "version"].contains(&id);
            for option in command
                .get_arguments()
                .filter(|a| !a.is_positional() && own(a.get_id().as_str()))
            {
                let heading = option.get_help_heading();
                assert!(
                    heading.is_some(),
                    "{}: --{} has none",
                    command.get_name(),
                    option.get_id()
                );
            }
        }
    }
}
