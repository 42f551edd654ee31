//! Today's figures, docs/results.md: what bakes and frames take, how far they are from references, what bakes expect of themselves.
//!
//! `cargo run --release --example results -- [--fast] [--only NAME]`
//!
//! Plays scenes of `data/` against our own path tracer, and, where `../shared` has them, scenes of others (`scenes`, `reference`)
//! against images of another renderer, and files with the faults that people's files have (`field`); then random scenes, and what
//! flickers. `--fast` takes a few of each; `--only` those whose name holds NAME: lights of the tables, `field/SCENE`, `random`, or
//! `flicker/SCENE`; all other rows stay as the page has them. One thing at a time; bakes by the program, for the memory of
//! each. The page is written after every row, so that a stop loses nothing.

mod cases;
mod field;
mod flicker;
mod light;
mod numbers;
mod page;
mod program;
mod random;

use cases::{Cases, OTHERS, OWN};
use field::FIELD;
use flicker::SCENES;
use page::{Page, Table};
use program::{FOLDER, Result, build};

/// Own cases and scenes of the field that `--fast` takes.
const FAST: (usize, usize) = (3, 1);
/// Random seeds, and those that `--fast` takes.
const SEEDS: [u32; 2] = [40, 5];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (mut fast, mut only) = (false, None);
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--fast" => fast = true,
            "--only" => only = Some(words.next().ok_or("--only: give a part of a name after it")?),
            _ => return Err(format!("{word}: no option; there are --fast and --only NAME").into()),
        }
    }
    let wanted = |name: &str| only.is_none_or(|only| name.contains(only));
    let (own, other, fields, shown) = match fast {
        true => (FAST.0, 0, FAST.1, 1),
        false => (OWN.len(), OTHERS.len(), FIELD.len(), SCENES.len()),
    };
    build()?;
    std::fs::create_dir_all(FOLDER).map_err(|error| format!("{FOLDER}: cannot make the folder: {error}"))?;
    let mut page = Page::new(&arguments.join(" "), only.is_some())?;
    let mut cases = Cases::default();
    let both = [Table::Errors, Table::Estimates];
    for case in OWN[..own].iter().filter(|case| wanted(case.0)) {
        let result = cases.own(&mut page, case);
        page.told(&both, case.0, result)?;
    }
    for &name in OTHERS[..other].iter().filter(|name| wanted(name)) {
        let result = cases.other(&mut page, name);
        page.told(&both, name, result)?;
    }
    for &(name, before) in FIELD[..fields]
        .iter()
        .filter(|case| wanted(&format!("field/{}", case.0)))
    {
        let result = field::field(&mut page, name, before);
        page.told(&[Table::Field], name, result)?;
    }
    if wanted("random") {
        let result = random::random(&mut page, SEEDS[usize::from(fast)]);
        page.told(&[Table::Random], "random", result)?;
    }
    for scene in SCENES[..shown].iter().filter(|scene| wanted(&scene.case())) {
        let result = flicker::flicker(&mut page, scene);
        page.told(&[Table::Flicker], scene.name, result)?;
    }
    page.end()
}
