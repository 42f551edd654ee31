//! Reads every glTF file below a folder and says what became of it: for each folder in it how many were read, how many refused, and
//! what was said of those.
//!
//!     cargo run --release --example survey -- FOLDER [--each]
//!
//! `--each` lists every file. Exit code 1 if a file made the importer panic.

use relight_scene::gltf::{ImportOptions, import};
use relight_scene::traced::{Shading, TracedScene};
use std::collections::BTreeMap;
use std::error::Error;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// What became of a file.
enum Outcome {
    /// Its triangles, and what was noted.
    Read(usize, Vec<String>),
    /// What was said.
    Refused(String),
    Panicked,
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let folder = PathBuf::from(words.next().ok_or("name a folder")?);
    let each = words.next().is_some_and(|word| word == "--each");
    let mut files = Vec::new();
    collect(&folder, &mut files)?;
    files.sort();
    let mut counts: BTreeMap<String, [usize; 4]> = BTreeMap::new();
    let mut refusals: BTreeMap<String, Vec<&Path>> = BTreeMap::new();
    let mut panics = 0;
    for file in &files {
        let within = file.strip_prefix(&folder)?;
        let source = within
            .iter()
            .next()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let count = counts.entry(source).or_default();
        let told = match read(file) {
            Outcome::Read(triangles, notes) => {
                count[if notes.is_empty() { 0 } else { 1 }] += 1;
                format!("{triangles} triangles {}", notes.join(" | "))
            }
            Outcome::Refused(what) => {
                count[2] += 1;
                refusals.entry(kind_of(&what)).or_default().push(within);
                format!("REFUSED {what}")
            }
            Outcome::Panicked => {
                count[3] += 1;
                panics += 1;
                "PANIC".into()
            }
        };
        if each {
            println!("{}: {told}", within.display());
        }
    }
    println!(
        "| source | files | read | read with notes | refused | panics |\n| --- | --- | --- | --- | --- | --- |"
    );
    for (source, [read, noted, refused, panicked]) in &counts {
        let all = read + noted + refused + panicked;
        println!("| {source} | {all} | {read} | {noted} | {refused} | {panicked} |");
    }
    println!("\n| files | refused with | such as |\n| --- | --- | --- |");
    let mut refusals: Vec<_> = refusals.into_iter().collect();
    refusals.sort_by_key(|(_, files)| std::cmp::Reverse(files.len()));
    for (what, files) in refusals {
        println!("| {} | {what} | {} |", files.len(), files[0].display());
    }
    Ok(ExitCode::from(u8::from(panics > 0)))
}

/// All `.gltf` and `.glb` files below a folder.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            collect(&path, files)?;
        } else if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("gltf") || e.eq_ignore_ascii_case("glb"))
        {
            files.push(path);
        }
    }
    Ok(())
}

/// Imports a file and prepares it for rays, which decodes its textures.
fn read(file: &Path) -> Outcome {
    let read = catch_unwind(|| -> Result<(usize, Vec<String>), Box<dyn Error>> {
        let mut scene = import(file, &ImportOptions::default())?;
        let notes = std::mem::take(&mut scene.notes);
        let traced = TracedScene::new(Arc::new(scene), Shading::Full)?;
        Ok((traced.triangle_count(), notes))
    });
    match read {
        Ok(Ok((triangles, notes))) => Outcome::Read(triangles, notes),
        Ok(Err(error)) => Outcome::Refused(error.to_string().replace(&file.display().to_string(), "FILE")),
        Err(_) => Outcome::Panicked,
    }
}

/// A message without what differs from file to file.
fn kind_of(message: &str) -> String {
    let short: String = message
        .lines()
        .next()
        .unwrap_or_default()
        .chars()
        .take(150)
        .collect();
    let mut kind = String::new();
    for c in short.chars() {
        match c {
            '0'..='9' if kind.ends_with('N') => {}
            '0'..='9' => kind.push('N'),
            '|' => kind.push('/'),
            other => kind.push(other),
        }
    }
    kind
}
