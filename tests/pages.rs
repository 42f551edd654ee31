//! Pages: short ones stay short, and what they and the code's comments refer to is there.

use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files under `folder` whose names end in `.ending`, without what builds make.
fn files(folder: &Path, ending: &str, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with('.') && name != "target" {
            files(&path, ending, found);
        } else if path.extension().is_some_and(|e| e == ending) {
            found.push(path);
        }
    }
}

fn texts(ending: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    files(root(), ending, &mut found);
    assert!(!found.is_empty());
    found
        .into_iter()
        .map(|path| (path.clone(), std::fs::read_to_string(&path).unwrap()))
        .collect()
}

#[test]
fn the_first_pages_are_short() {
    for (page, most) in [("README.md", 120), ("ARCHITECTURE.md", 150)] {
        let lines = std::fs::read_to_string(root().join(page))
            .unwrap()
            .lines()
            .count();
        assert!(lines <= most, "{page} has {lines} lines, {most} at most");
    }
}

#[test]
fn links_between_pages_lead_somewhere() {
    let mut dead = Vec::new();
    for (path, text) in texts("md") {
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split(['#', ' ']).next().unwrap();
            let is_file = !file.is_empty() && !file.contains("://");
            if is_file && !path.with_file_name(file).exists() {
                dead.push(format!("{}: {link}", path.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{dead:#?}");
}

/// Comments name a page for the reason of a constant. A section of a page that isn't here would be no reason.
#[test]
fn pages_that_the_code_names_are_there() {
    let mut dead = Vec::new();
    for (path, text) in texts("rs").into_iter().chain(texts("toml")) {
        for rest in text.split("docs/").skip(1) {
            let page: String = rest
                .chars()
                .take_while(|c| c.is_ascii_alphanumeric() || "/._-".contains(*c))
                .collect();
            let page = page.trim_end_matches('.');
            if page.ends_with(".md") && !root().join("docs").join(page).exists() {
                dead.push(format!("{}: docs/{page}", path.display()));
            }
        }
    }
    assert!(dead.is_empty(), "{dead:#?}");
}
