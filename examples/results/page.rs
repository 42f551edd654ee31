//! The page: tables that grow by rows, written whole after each.

use crate::program::{PROFILE, Result, says};

/// Where the page goes.
const FILE: &str = "docs/results.md";
/// Frames after the first, of the same light, for the time of each.
pub const FRAMES: usize = 8;

/// A table of the page.
#[derive(Clone, Copy)]
pub enum Table {
    Bakes,
    Frames,
    Errors,
    Estimates,
    Field,
    Random,
    Flicker,
}

/// Their titles, texts and columns, in the same order.
const TABLES: [[&str; 3]; 7] = [
    [
        "Bakes",
        "Preset `standard`. `in rays`: seconds in rays, of all.",
        "scene, options | triangles | points | rays | in rays, s | all, s | links | MB | peak MB",
    ],
    [
        "Frames",
        "Seconds from the asset's file to the first frame; milliseconds of each further one, and the stages of the last.",
        "lights | size | first, s | each, ms | stages, ms",
    ],
    [
        "Errors",
        "Preset `standard`. relMSE as measured, and how much of it is the reference's noise; bias of the mean. `direct` holds \
         emission. `true` is the root of the relMSE of indirect light less that noise; `expected` what the bake said of it, under \
         the scene's own lights or test lights, which need not be these; `ratio` expected to true.",
        "lights | direct | noise | bias | indirect | noise | bias | true | expected | ratio | beauty | noise | bias | reference",
    ],
    [
        "Estimates of the bakes against truth",
        "Preset `draft`, each baked with `--lights` of its row, so that the bake judged itself under the lights that played. Error \
         (root of relMSE, less the reference's noise) and bias of indirect light: expected, with its standard error, and true.",
        "lights | bake, s | expected error | true error | ratio | expected bias | true bias",
    ],
    [
        "Field",
        "Small files with the faults that people's files have; preset `standard` without options, the scene's own lights or its \
         sequence. relMSE, of it noise, and bias of direct light (without emission) and of indirect light, 160x120, against two \
         path tracings of the same asset. What import gets wrong is in both, so see `mean`, of the reference: g4e5 and g4e6 must have \
         g0's. `before`: as commit 2bec939 had them, seen by hand and not measured by this program.",
        "scene | bake, s | points | links | first, s | direct | noise | bias | indirect | noise | bias | mean | before",
    ],
    [
        "Random scenes",
        "`relight check --random`: scenes of random seeds, in draft less its finest level, 64x48, against the path tracer. Error: \
         root of relMSE, less the reference's noise. Bias: its size.",
        "number | median | worst tenth | worst | its seed",
    ],
    [
        "Flicker",
        "Absolute second difference of a pixel in time over the pixel's mean, of pixels above 2 % of the mean, in %: median, 99th and \
         99.9th percentile. Sixteen frames of a lamp of 150 W/sr, or a sphere of 0.2 m, that glides by 0.3 m, and of `data/sky.hdr` as it \
         turns by 15°. Indirect light; of visibility cuts direct light. 20,000 virtual lights; the atrium in `standard`, 80x45, the others \
         in `draft`, 64x36, the lamp one metre before the camera. Wanted: transfer 0.05, 0.5, 3; lightcuts and pixelcuts 0.3, 3, 10; \
         visibility cuts as before. `smooth`: of pixels alone whose light is smooth in truth, 1,024 samples a pixel of path tracing, \
         whose second differences are all within 0.5 %; and how many those are, with its noise. `before`: as commit edd9447 had them, \
         seen by hand and not measured by this program.",
        "scene | light by | before | now | smooth",
    ],
];

pub struct Page {
    head: String,
    /// Tables that the file had, from title on, where they are to stay.
    kept: [Option<String>; TABLES.len()],
    /// Sections that the file had and this program doesn't make, from title on. They stay.
    others: Vec<String>,
    /// What tells where tables are from that are not what the head tells.
    origin: Option<String>,
    rows: [Vec<String>; TABLES.len()],
    /// Below a table.
    notes: [Vec<String>; TABLES.len()],
    failed: usize,
}

impl Page {
    /// Without rows; `arguments` are those of this program. With `keep`, what the file has stays, but rows of cases that get
    /// new ones; sections that this program doesn't make stay in any case.
    pub fn new(arguments: &str, keep: bool) -> Result<Page> {
        let command = format!("cargo run --release --example results -- {arguments}");
        let command = command.trim_end_matches([' ', '-']);
        let commit = says("git", &["describe", "--always", "--dirty", "--exclude=*"]);
        let (rustc, system) = (says("rustc", &["--version"]), std::env::consts::OS);
        let model = "sed -n 's/^model name.*: //p' /proc/cpuinfo | head -n 1";
        let (cpu, threads) = (says("sh", &["-c", model]), std::thread::available_parallelism()?);
        let head = format!(
            "# Results

Written by `{command}`.

- Commit {commit}, {rustc}, {PROFILE} build.
- {cpu}, {system}, {threads} threads.
- Seeds: 0 for bakes and frames, 1 and 2 for path tracings. Bakes: one each; frames: medians of {FRAMES}.
"
        );
        let old = std::fs::read_to_string(FILE).unwrap_or_default();
        let mut parts = old.split("\n## ");
        let old_head = parts.next().filter(|head| keep && !head.is_empty());
        let is_ours = |section: &&str| {
            TABLES
                .iter()
                .any(|[title, ..]| section.lines().next() == Some(title))
        };
        let (tables, others): (Vec<&str>, Vec<&str>) = parts.partition(is_ours);
        let page = Page {
            head,
            kept: Default::default(),
            others: others.into_iter().map(str::to_owned).collect(),
            origin: None,
            rows: Default::default(),
            notes: Default::default(),
            failed: 0,
        };
        match old_head {
            None => Ok(page),
            Some(head) => {
                let of = |title: &str| tables.iter().find(|table| table.lines().next() == Some(title));
                Ok(Page {
                    head: head.to_owned(),
                    kept: TABLES.map(|[title, ..]| of(title).map(|&table| table.to_owned())),
                    origin: Some(format!(
                        "`{command}`: commit {commit}, {PROFILE} build, {cpu}, {threads} threads."
                    )),
                    ..page
                })
            }
        }
    }

    /// Adds a row and writes the page.
    pub fn row(&mut self, table: Table, cells: &[String]) -> Result<()> {
        // What a program said may hold what ends a cell or a row.
        let cells: Vec<String> = cells
            .iter()
            .map(|c| c.replace('\n', " ").replace('|', "/"))
            .collect();
        self.rows[table as usize].push(format!("| {} |\n", cells.join(" | ")));
        self.write()
    }

    /// Adds a line below a table and writes the page.
    pub fn note(&mut self, table: Table, line: String) -> Result<()> {
        self.notes[table as usize].push(line);
        self.write()
    }

    /// A row for a case without numbers, and why, which is said on stderr, too.
    pub fn without(&mut self, tables: &[Table], name: &str, why: &str) -> Result<()> {
        eprintln!("{name}: {why}");
        for &table in tables {
            self.row(table, &[name.into(), why.into()])?;
        }
        Ok(())
    }

    /// Where a case failed, that; the others go on.
    pub fn told(&mut self, tables: &[Table], name: &str, result: Result<()>) -> Result<()> {
        match result {
            Ok(()) => Ok(()),
            Err(error) => {
                self.failed += 1;
                self.without(tables, name, &format!("failed: {error}"))
            }
        }
    }

    /// An error if a case failed, or none ran.
    pub fn end(&self) -> Result<()> {
        if self.rows.iter().all(Vec::is_empty) {
            return Err("--only: no case has this in its name".into());
        }
        match self.failed {
            0 => Ok(()),
            failed => Err(format!("cases that failed: {failed}; {FILE} says how").into()),
        }
    }

    fn write(&self) -> Result<()> {
        let mut text = self.head.clone();
        for (k, [title, about, columns]) in TABLES.iter().enumerate() {
            let (rows, notes) = (&self.rows[k], &self.notes[k]);
            if rows.is_empty() && notes.is_empty() {
                if let Some(kept) = &self.kept[k] {
                    text += &format!("\n## {}\n", kept.trim_end());
                }
                continue;
            }
            let rule = " --- |".repeat(columns.split('|').count());
            let old = Kept::of(self.kept[k].as_deref().unwrap_or_default());
            let (rows, is_all) = old.with(rows);
            text += &format!("\n## {title}\n\n{about}\n");
            if let Some(origin) = &self.origin {
                let origin = match is_all {
                    true => format!("{WHOLE}{origin}"),
                    false => old.origin_with(&cases(&self.rows[k]).join(", "), origin),
                };
                text += &format!("\n{origin}\n");
            }
            text += &format!("\n| {columns} |\n|{rule}\n{rows}");
            for line in notes {
                text += &format!("\n{line}\n");
            }
        }
        for section in &self.others {
            text += &format!("\n## {}\n", section.trim_end());
        }
        Ok(std::fs::write(FILE, text).map_err(|error| format!("{FILE}: cannot be written: {error}"))?)
    }
}

/// How the line begins that tells where a table is from, and how it goes on for rows that are from elsewhere.
const WHOLE: &str = "This table by ";
const ROWS: &str = "Rows of ";

/// What a row is about.
fn case(row: &str) -> &str {
    row.split('|').nth(1).unwrap_or_default().trim()
}

/// What rows are about, each once.
fn cases(rows: &[String]) -> Vec<&str> {
    let mut cases: Vec<&str> = rows.iter().map(|row| case(row)).collect();
    cases.dedup();
    cases
}

/// A table as the file has it.
struct Kept<'a> {
    /// What tells where it is from.
    origin: &'a str,
    rows: Vec<&'a str>,
}

impl Kept<'_> {
    fn of(text: &str) -> Kept<'_> {
        let is_row = |line: &&str| line.starts_with('|');
        Kept {
            origin: text
                .lines()
                .find(|line| line.starts_with(WHOLE) || line.starts_with(ROWS))
                .unwrap_or_default(),
            // After the columns' names and the rule below them.
            rows: text.lines().filter(is_row).skip(2).collect(),
        }
    }

    /// What tells where it is from, once the rows of some `cases` are from `origin`.
    fn origin_with(&self, cases: &str, origin: &str) -> String {
        let mut parts = self.origin.split(ROWS).map(str::trim);
        let whole = parts.next().unwrap_or_default();
        let new = format!("{cases} by {origin}");
        let rows: Vec<&str> = parts
            .filter(|part| !part.starts_with(&format!("{cases} by ")))
            .chain([&*new])
            .collect();
        let is_told = |row: &&str| {
            rows.iter()
                .any(|told| told.starts_with(&format!("{} by ", case(row))))
        };
        let told: Vec<String> = rows.iter().map(|rows| format!("{ROWS}{rows}")).collect();
        match self.rows.iter().all(is_told) {
            true => told.join(" "),
            false => format!("{whole} {}", told.join(" ")).trim().to_owned(),
        }
    }

    /// Its rows with `new` ones in place of those about the same, and whether none of its own is left.
    fn with(&self, new: &[String]) -> (String, bool) {
        let made = cases(new);
        let of = |name: &str| -> String { new.iter().filter(|row| case(row) == name).cloned().collect() };
        let (mut rows, mut placed, mut is_all) = (String::new(), Vec::new(), true);
        for &row in &self.rows {
            let name = case(row);
            if !made.contains(&name) {
                rows += &format!("{row}\n");
                is_all = false;
            } else if !placed.contains(&name) {
                rows += &of(name);
                placed.push(name);
            }
        }
        for name in made.iter().filter(|name| !placed.contains(name)) {
            rows += &of(name);
        }
        (rows, is_all)
    }
}
