//! Which options count with which integrator: others are refused, and what an asset or its lights leave without effect is told.

use super::args::{IntegratorName, PlayArgs};
use crate::failure::Failure;
use relight_play::choice::{Choice, CutKind, CutUse};

const PATH: &[&str] = &["path"];
const POINTS: &[&str] = &["brute", "lightcuts", "pixelcuts"];
const LIGHTCUTS: &[&str] = &["lightcuts"];
const PIXELCUTS: &[&str] = &["pixelcuts"];

/// Options that count with some integrators only, whether they are given, and with which.
fn special(args: &PlayArgs) -> [(&'static str, bool, &'static [&'static str]); 14] {
    let PlayArgs {
        points,
        lightcuts,
        pixelcuts,
        ..
    } = args;
    [
        ("--max-bounces", args.max_bounces.is_some(), PATH),
        ("--area-samples", points.area_samples.is_some(), POINTS),
        (
            "--environment-samples",
            points.environment_samples.is_some(),
            POINTS,
        ),
        ("--sun-samples", points.sun_samples.is_some(), POINTS),
        ("--sky-samples", points.sky_samples.is_some(), POINTS),
        ("--vpls", points.vpls.is_some(), POINTS),
        ("--clamp", points.clamp.is_some(), POINTS),
        ("--error-ratio", lightcuts.error_ratio.is_some(), LIGHTCUTS),
        ("--max-nodes", lightcuts.max_nodes.is_some(), LIGHTCUTS),
        (
            "--cluster-visibility",
            lightcuts.cluster_visibility.is_some(),
            LIGHTCUTS,
        ),
        ("--reconstruction", lightcuts.reconstruction.is_some(), LIGHTCUTS),
        ("--clusters", pixelcuts.clusters.is_some(), PIXELCUTS),
        ("--trees", pixelcuts.trees.is_some(), PIXELCUTS),
        ("--sh-degree", pixelcuts.sh_degree.is_some(), PIXELCUTS),
    ]
}

/// Refuses options that the integrator, as decided, has no use for; says which have no effect on this asset.
///
/// # Errors
/// [`Failure::Usage`].
pub fn check(args: &PlayArgs, choice: &Choice, has_points: bool) -> Result<Vec<String>, Failure> {
    let refused = |option: &str, with: &[&str], now: &str| {
        let list = match with {
            [only] => (*only).to_owned(),
            [first @ .., last] => format!("{} and {last}", first.join(", ")),
            [] => String::new(),
        };
        let advice = match option {
            "--max-bounces" => "; what an asset holds is chosen by bake --bounces",
            _ => "",
        };
        Failure::Usage(format!(
            "{option} counts with --integrator {list} alone, and light is made by {now} here{advice}"
        ))
    };
    let now = choice.integrator.name();
    for (option, _, with) in special(args).into_iter().filter(|(_, given, _)| *given) {
        if !with.contains(&now) {
            return Err(refused(option, with, now));
        }
    }
    if args.counts_nodes() && choice.cuts == CutUse::Nothing {
        return Err(Failure::Usage(format!(
            "--layers cut_size and nodes count nodes of visibility cuts, and none are used here: {}",
            match choice.of {
                _ if !matches!(args.integrator, IntegratorName::Auto | IntegratorName::Cuts) =>
                    format!("light is made by {now}; leave out --integrator"),
                CutKind::None =>
                    "the asset has none; bake it with --cuts environment or --cuts indirect".into(),
                _ => "the asset's are for environments and skies, and none shines".into(),
            }
        )));
    }
    let mut notes = Vec::new();
    if args.illumination_cut.is_some() {
        if !matches!(args.integrator, IntegratorName::Auto | IntegratorName::Cuts) {
            return Err(refused("--illumination-cut", &["auto", "cuts"], now));
        }
        if choice.cuts == CutUse::Nothing {
            notes.push(
                "--illumination-cut counts for nothing here: the asset has no visibility cuts (bake --cuts), or none that these lights use",
            );
        }
    }
    if args.points.clamp.is_some() {
        match (args.points.vpls.unwrap_or(0), has_points) {
            (0, _) => notes.push("--clamp counts for nothing here: there are no virtual lights (--vpls)"),
            (_, true) => {
                notes.push("--clamp counts for nothing here: the virtual lights are at the asset's points, which need none");
            }
            _ => {}
        }
    }
    if args.exposure.is_some() && !args.png && args.movie.is_none() {
        notes.push("--exposure counts for nothing here: it is that of previews (--png) and movies (--movie)");
    }
    Ok(notes.into_iter().map(|note| format!("warning: {note}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::parsed;
    use clap::ValueEnum;
    use relight_play::Integrator;

    /// Each option of the table with a value that is not its default.
    const VALUES: [(&str, &str); 14] = [
        ("--max-bounces", "3"),
        ("--area-samples", "77"),
        ("--environment-samples", "77"),
        ("--sun-samples", "77"),
        ("--sky-samples", "77"),
        ("--vpls", "77"),
        ("--clamp", "0.5"),
        ("--error-ratio", "0.5"),
        ("--max-nodes", "77"),
        ("--cluster-visibility", "representative"),
        ("--reconstruction", "on"),
        ("--clusters", "77"),
        ("--trees", "7"),
        ("--sh-degree", "1"),
    ];

    fn args(words: &[&str]) -> PlayArgs {
        let words: Vec<String> = (["a.relight", "-o", "f.exr"].iter().chain(words))
            .map(|word| (*word).to_owned())
            .collect();
        parsed(&words).unwrap_or_else(|error| panic!("{words:?}: {error:?}"))
    }

    /// As an asset with points and cuts has it.
    fn choice(integrator: Integrator, cuts: CutUse) -> Choice {
        Choice {
            integrator: match integrator {
                Integrator::Auto => Integrator::Transfer,
                other => other,
            },
            cuts,
            of: CutKind::Directions,
            by_lightcuts: false,
        }
    }

    /// Truth: an option that is taken changes how light is made, one that is refused would not have.
    #[test]
    fn options_are_taken_by_the_integrators_that_they_change_and_refused_by_others() {
        let table = special(&args(&[])).map(|(option, ..)| option);
        assert_eq!(table, VALUES.map(|(option, _)| option));
        for integrator in IntegratorName::value_variants() {
            let value = integrator.to_possible_value().unwrap();
            let name = value.get_name();
            for (option, value) in VALUES {
                let plain = args(&["--integrator", name]);
                let with = args(&["--integrator", name, option, value]);
                let changes = plain.integrator() != with.integrator();
                let checked = check(&with, &choice(with.integrator(), CutUse::Environments), false);
                // Of brute force as soon as another option asks for points.
                let limits_points = (name, option) == ("brute", "--clamp");
                assert_eq!(checked.is_ok(), changes || limits_points, "{name} {option}");
                if let Err(refused) = checked {
                    let Failure::Usage(text) = refused else {
                        panic!("{refused:?}")
                    };
                    assert!(
                        text.starts_with(&format!("{option} counts with --integrator ")),
                        "{text}"
                    );
                }
            }
        }
    }

    #[test]
    fn nodes_of_the_illumination_cut_are_told_where_no_visibility_cuts_are_used() {
        for integrator in IntegratorName::value_variants() {
            let value = integrator.to_possible_value().unwrap();
            let args = args(&["--integrator", value.get_name(), "--illumination-cut", "64"]);
            let checked = |cuts| check(&args, &choice(args.integrator(), cuts), true);
            match integrator {
                IntegratorName::Auto | IntegratorName::Cuts => {
                    assert_eq!(checked(CutUse::Environments).ok(), Some(Vec::new()));
                    assert_eq!(checked(CutUse::Nothing).unwrap_or_default().len(), 1);
                }
                _ => assert!(checked(CutUse::Nothing).is_err()),
            }
        }
    }

    #[test]
    fn what_has_no_effect_is_told() {
        let notes = |words: &[&str], has_points: bool| {
            let args = args(words);
            check(&args, &choice(args.integrator(), CutUse::Nothing), has_points).unwrap_or_default()
        };
        let lightcuts = ["--integrator", "lightcuts", "--clamp", "0.1"];
        assert!(notes(&lightcuts, true)[0].contains("no virtual lights"));
        let virtual_lights = [&lightcuts[..], &["--vpls", "10"]].concat();
        assert!(notes(&virtual_lights, true)[0].contains("at the asset's points"));
        assert!(notes(&virtual_lights, false).is_empty());
        assert!(notes(&["--exposure", "1"], true)[0].contains("--png"));
        assert!(notes(&["--exposure", "1", "--png"], true).is_empty());
    }
}
