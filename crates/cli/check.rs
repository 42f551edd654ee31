//! `relight check`: the stability suite, or one asset's self-consistency.

mod asset;
mod bounces;
mod case;
mod fineness;
mod fresh;
mod furnaces;
mod geometry;
mod glass;
mod lights;
mod materials;
mod random;
mod sanity;
mod scales;
mod shapes;
mod stage;
mod steady;
mod sums;

use crate::console::Console;
use crate::failure::{Failure, Outcome};
use crate::guard::Guard;
use crate::kinds::{self, Wanted};
use crate::options::{ReplaceArgs, whole};
use crate::output::{self, SCHEMA};
use crate::signals;
use crate::words;
use case::{Case, Measure};
use clap::Args;
use comfy_table::Table;
use comfy_table::presets;
use random::RandomRun;
use serde::Serialize;
use stage::Stage;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Instant;

/// Check what an asset holds against itself and against fresh rays; without an asset, run the numerical stability
/// suite.
///
/// An asset: its checksums and structure, whether its operators keep energy and its bounces converge, whether its
/// points cover what the cameras see, and some of its links and cuts against rays that know nothing of them.
///
/// The suite bakes and plays small scenes made in code: closed furnaces, scenes and lights of all sizes, broken
/// triangles, lights in contact with surfaces, stiff bounces. It takes some minutes, with --fast under one.
///
/// --random N makes interiors and yards of N seeds from --seed on, with furniture, lamps, skies, far grounds, units and offsets
/// as files of others have them, bakes each in draft less its finest level, plays it at 64 × 48 and compares it with the path tracer: error (root
/// of relMSE, less the reference's noise) and bias of indirect and direct light, each seed and their distribution.
#[derive(Args)]
#[command(after_help = "\
Exits with code 3 if something falls short, 1 if the asset is damaged. The JSON of --json: passed, seconds, and
cases, an array of {name, ok, value, bound, margin, why, stage, seconds}: value null if it is no number, margin the
share of the bound that is left. With --random also random: seeds (what each holds and measures), distribution (median,
worst_tenth, worst and its seed of each number) and missed, the seeds that err by more than 25 % or have a bias of more than 5 %.")]
pub struct CheckArgs {
    /// Asset to check; without it, the suite runs.
    #[arg(value_name = "ASSET.relight")]
    pub asset: Option<PathBuf>,
    /// Only the cases of the suite that take under a minute together, on two cores.
    #[arg(long, conflicts_with = "asset")]
    pub fast: bool,
    /// Only the cases whose names begin so; may be given several times.
    #[arg(long, value_name = "NAME", conflicts_with = "asset")]
    pub case: Vec<String>,
    /// Instead of the suite, so many random scenes against the path tracer, from --seed on.
    #[arg(long, value_name = "N", conflicts_with_all = ["asset", "fast", "case", "list"],
        value_parser = whole::<u32>(1, u32::MAX))]
    pub random: Option<u32>,
    /// Folder for each random scene's files, with a picture: relit, path traced, error.
    #[arg(long, value_name = "DIR", requires = "random")]
    pub images: Option<PathBuf>,
    #[command(flatten)]
    pub replace: ReplaceArgs,
    /// Name the cases of the suite and what they say, and leave.
    #[arg(long, conflicts_with = "asset")]
    pub list: bool,
    /// Print one JSON object on stdout instead of a table.
    #[arg(long)]
    pub json: bool,
}

/// One line of the result. What is no finite number is null in JSON.
#[derive(Serialize)]
struct Line {
    #[serde(skip)]
    case: String,
    /// Of the case and of what it measures.
    name: String,
    ok: bool,
    value: f64,
    bound: f64,
    margin: f64,
    why: &'static str,
    stage: String,
    seconds: f64,
}

impl Line {
    /// Of an asset's check, which is no case of the suite, `case` is empty.
    fn new(case: &str, measure: Measure, stage: String, seconds: f64) -> Line {
        Line {
            case: case.to_owned(),
            ok: measure.ok(),
            margin: measure.margin(),
            name: match case {
                "" => measure.what,
                case => format!("{case}: {}", measure.what),
            },
            value: measure.value,
            bound: measure.bound,
            why: measure.why,
            stage,
            seconds,
        }
    }
}

/// What `check` prints.
#[derive(Serialize)]
struct CheckReport<'a> {
    schema: u32,
    command: &'static str,
    asset: Option<String>,
    passed: bool,
    seconds: f64,
    cases: &'a [Line],
    #[serde(skip_serializing_if = "Option::is_none")]
    random: Option<&'a RandomRun>,
}

/// What `check --list` prints.
#[derive(Serialize)]
struct CaseList<'a> {
    schema: u32,
    command: &'static str,
    cases: &'a [Case],
}

/// All cases of the suite.
fn suite() -> Vec<Case> {
    [
        furnaces::cases(),
        bounces::cases(),
        fineness::cases(),
        scales::cases(),
        lights::cases(),
        geometry::cases(),
        glass::cases(),
        materials::cases(),
        steady::cases(),
        sums::cases(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Runs the command.
pub fn run(args: &CheckArgs, seed: u64, console: &Console) -> Result<Outcome, Failure> {
    if args.list {
        return list(args);
    }
    let start = Instant::now();
    let random = (args.random)
        .map(|number| {
            random::run(
                number,
                seed,
                args.images.as_deref(),
                &Guard::new(args.replace.force),
                console,
            )
        })
        .transpose()?;
    let lines = match (&random, &args.asset) {
        (Some(run), _) => (random::measures(run).into_iter())
            .map(|measure| Line::new("", measure, "random".into(), 0.0))
            .collect(),
        (None, Some(path)) => {
            kinds::check(path, Wanted::Asset)?;
            console.begin("Checking the asset", None);
            let stage = Stage::default();
            let found = asset::check(path, seed, &stage)?;
            let seconds = start.elapsed().as_secs_f64();
            let line = |(stage, measure)| Line::new("", measure, stage, seconds);
            found.into_iter().map(line).collect()
        }
        (None, None) => run_suite(args, console)?,
    };
    console.close();
    let short: Vec<&Line> = lines.iter().filter(|l| !l.ok).collect();
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        output::print_json(&CheckReport {
            schema: SCHEMA,
            command: "check",
            asset: args.asset.as_ref().map(|p| p.display().to_string()),
            passed: short.is_empty(),
            seconds,
            cases: &lines,
            random: random.as_ref(),
        })?;
    } else if let Some(run) = &random {
        output::print_text(&random::text(run))?;
    } else {
        let shown = shown(&lines, args.asset.is_some() || console.is_verbose());
        output::print_text(&(table(&shown) + "\n"))?;
    }
    console.note(format!(
        "{} of {} hold, in {seconds:.1} s.",
        lines.len() - short.len(),
        words::plural(lines.len(), "bound"),
    ));
    for line in &short {
        // Asked for, so said even with --quiet.
        console.fail(&format!(
            "relight: {} is {:.4e}, above its bound {:.4e} ({}); stage: {}",
            line.name, line.value, line.bound, line.why, line.stage
        ));
    }
    Ok(if short.is_empty() {
        Outcome::Done
    } else {
        Outcome::FellShort
    })
}

fn chosen(args: &CheckArgs) -> Result<Vec<Case>, Failure> {
    let named = |case: &Case| args.case.is_empty() || args.case.iter().any(|n| case.name.starts_with(n));
    for name in &args.case {
        if !suite().iter().any(|case| case.name.starts_with(name)) {
            return Err(Failure::Usage(format!(
                "--case {name}: no case of the suite begins so; --list names them"
            )));
        }
    }
    let cases: Vec<Case> = suite().into_iter().filter(named).collect();
    Ok(cases.into_iter().filter(|case| case.fast || !args.fast).collect())
}

fn list(args: &CheckArgs) -> Result<Outcome, Failure> {
    let cases = chosen(args)?;
    if args.json {
        output::print_json(&CaseList {
            schema: SCHEMA,
            command: "check",
            cases: &cases,
        })?;
        return Ok(Outcome::Done);
    }
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_header(["case", "", "what must hold"]);
    for case in &cases {
        table.add_row([case.name.as_str(), if case.fast { "fast" } else { "" }, case.says]);
    }
    output::print_text(&(table.trim_fmt() + "\n"))?;
    Ok(Outcome::Done)
}

fn run_suite(args: &CheckArgs, console: &Console) -> Result<Vec<Line>, Failure> {
    let cases = chosen(args)?;
    console.begin("Running the stability suite", Some(cases.len() as u64));
    let mut lines = Vec::new();
    for (done, case) in cases.iter().enumerate() {
        signals::go_on()?;
        let stage = Stage::default();
        let start = Instant::now();
        // A panic is a failure of this case, not the end of the suite.
        let result = catch_unwind(AssertUnwindSafe(|| (case.run)(&stage)));
        signals::go_on()?;
        let seconds = start.elapsed().as_secs_f64();
        let measures = match result {
            Ok(Ok(measures)) => measures,
            Ok(Err(error)) => vec![Measure::none(format!("failed: {error}"), 1, "it must run")],
            Err(_) => vec![Measure::none("panicked", 1, "no input may cause a panic")],
        };
        console.detail(format!("{}: {seconds:.1} s", case.name));
        let line = |measure| Line::new(&case.name, measure, stage.now(), seconds);
        lines.extend(measures.into_iter().map(line));
        console.advance_to(done as u64 + 1);
    }
    Ok(lines)
}

/// All lines, or of each case the one with the least margin and those that fall short.
fn shown(lines: &[Line], all: bool) -> Vec<&Line> {
    if all {
        return lines.iter().collect();
    }
    let mut shown = Vec::new();
    for of_case in lines.chunk_by(|a, b| a.case == b.case) {
        // Of equal margins the last: general sanity comes first, what the case is about after it.
        let tightest = of_case.iter().rev().min_by(|a, b| a.margin.total_cmp(&b.margin));
        for line in of_case {
            if !line.ok || tightest.is_some_and(|t| std::ptr::eq(t, line)) {
                shown.push(line);
            }
        }
    }
    shown
}

fn table(lines: &[&Line]) -> String {
    let rows = lines.iter().map(|line| {
        vec![
            line.name.clone(),
            number(line.value),
            number(line.bound),
            if line.margin.is_finite() {
                format!("{:.0}", 100.0 * line.margin)
            } else {
                "-".into()
            },
            if line.ok { "ok".into() } else { "SHORT".into() },
            format!("{:.1}", line.seconds),
        ]
    });
    output::table(&["case", "value", "bound", "left %", "", "seconds"], rows)
}

fn number(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        a if (1e-3..1e5).contains(&a) => format!("{x:.4}"),
        _ => format!("{x:.2e}"),
    }
}
