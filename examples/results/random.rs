//! Random scenes, by the program's own check of them.

use crate::numbers::{fixed, percent, whole};
use crate::page::{Page, Table};
use crate::program::{Result, number, relight};
use serde_json::Value;

/// From this on a number needs no digits after the point.
const LARGE: f64 = 100.0;

/// The distribution over so many seeds, and which miss.
pub fn random(page: &mut Page, seeds: u32) -> Result<()> {
    let seeds = seeds.to_string();
    let command = ["check", "--random", &seeds, "--json", "--quiet"];
    let said = relight(&command)?;
    let list = |key: &str| -> Result<&Vec<Value>> {
        let found = said["random"][key].as_array();
        Ok(found.ok_or_else(|| format!("relight {}: its JSON has no random/{key}", command.join(" ")))?)
    };
    for spread in list("distribution")? {
        let what = spread["what"].as_str().unwrap_or_default();
        let cell = |key: &str| match number(spread.get(key)) {
            x if what.ends_with("error") || what.ends_with("bias") => percent(x),
            x if x >= LARGE => whole(x),
            x => fixed(x, 1),
        };
        let [median, tenth, worst] = ["median", "worst_tenth", "worst"].map(cell);
        let seed = spread["worst_seed"].to_string();
        page.row(Table::Random, &[what.into(), median, tenth, worst, seed])?;
    }
    for trial in list("seeds")? {
        if let Some(why) = trial["failed"].as_str() {
            page.without(
                &[Table::Random],
                &format!("seed {}", trial["seed"]),
                &format!("failed: {why}"),
            )?;
        }
    }
    let missed: Vec<String> = list("missed")?.iter().map(Value::to_string).collect();
    let line = format!(
        "{} of {seeds} seeds err by more than 25 % or have a bias beyond 5 %, of direct or of indirect light{}{}.",
        missed.len(),
        if missed.is_empty() { "" } else { ": " },
        missed.join(", ")
    );
    page.note(Table::Random, line)
}
