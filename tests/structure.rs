//! Files of a crate form no circles: what a file uses never uses that file.
//!
//! Read from the paths in the sources: `use` lines and paths that begin with `crate`, `self`, `super` or a child
//! module. A module and its children count as files like any others. Re-exports (`pub use`) and `mod` lines are a
//! module's face and no use; tests may use what they please.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Modules of a crate by their path within it (`cuts::shade`; the root is empty), with their source.
type Modules = BTreeMap<String, String>;
/// What each module uses.
type Uses = BTreeMap<String, BTreeSet<String>>;

fn sources() -> Vec<PathBuf> {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates");
    let mut roots: Vec<PathBuf> = fs::read_dir(&crates)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| {
            if path.ends_with("cli") {
                path
            } else {
                path.join("src")
            }
        })
        .collect();
    roots.sort();
    assert!(roots.len() >= 6, "{roots:?}");
    roots
}

fn modules(root: &Path) -> Modules {
    fn walk(folder: &Path, root: &Path, found: &mut Modules) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, root, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let relative = path.strip_prefix(root).unwrap().with_extension("");
                let mut names: Vec<&str> = relative.iter().map(|n| n.to_str().unwrap()).collect();
                if matches!(names.last(), Some(&("mod" | "lib" | "main"))) {
                    names.pop();
                }
                if !names.last().is_some_and(|n| n.ends_with("tests")) {
                    found.insert(names.join("::"), code(&fs::read_to_string(&path).unwrap()));
                }
            }
        }
    }
    let mut found = Modules::new();
    walk(root, root, &mut found);
    found
}

/// A source without comments, strings and unit tests.
fn code(source: &str) -> String {
    let source = source
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap_or_default();
    let mut code = String::new();
    for line in source.lines() {
        // What follows an odd number of quotes is within a string.
        let kept = line.split("//").next().unwrap_or_default();
        code.extend(kept.split('"').step_by(2));
        code.push('\n');
    }
    code
}

/// All paths of a source: those of `use` lines with their braces expanded, and those in expressions and signatures.
fn paths(code: &str) -> Vec<String> {
    let mut paths = Vec::new();
    let mut rest = String::new();
    for (i, statement) in code.split(';').enumerate() {
        let (before, used) = match statement.rsplit_once("\nuse ") {
            Some(parts) => parts,
            None if i == 0 && statement.starts_with("use ") => ("", &statement[4..]),
            None => (statement, ""),
        };
        // A `pub use` stays in `before`, and is dropped with its line.
        rest.push_str(before.split("pub use ").next().unwrap_or_default());
        expand("", used, &mut paths);
    }
    let word = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    paths.extend(
        rest.split(|c| !word(c))
            .map(|p| p.trim_end_matches(':'))
            .filter(|p| p.contains("::") && !p.starts_with(':'))
            .map(str::to_owned),
    );
    paths
}

fn expand(before: &str, tree: &str, paths: &mut Vec<String>) {
    let tree = tree.trim();
    let Some((head, inner)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or_default().trim();
        if !path.is_empty() {
            paths.push(format!("{before}{path}"));
        }
        return;
    };
    let inner = inner.rsplit_once('}').map_or(inner, |(inner, _)| inner);
    let before = format!("{before}{}", head.trim());
    let (mut depth, mut start) = (0, 0);
    for (at, c) in inner.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                expand(&before, &inner[start..at], paths);
                start = at + 1;
            }
            _ => {}
        }
    }
    expand(&before, &inner[start..], paths);
}

/// The module in which a path ends, seen from module `here`; `None` for paths out of the crate and to its root.
fn target(path: &str, here: &str, modules: &Modules) -> Option<String> {
    let mut names: Vec<&str> = here.split("::").filter(|n| !n.is_empty()).collect();
    let mut path = path.split("::").peekable();
    match *path.peek()? {
        "crate" => {
            path.next();
            names.clear();
        }
        "self" => {
            path.next();
        }
        "super" => {
            while path.next_if_eq(&"super").is_some() {
                names.pop();
            }
        }
        child => {
            names.push(child);
            modules.get(&names.join("::"))?;
            path.next();
        }
    }
    names.extend(path);
    while !names.is_empty() && !modules.contains_key(&names.join("::")) {
        names.pop();
    }
    let found = names.join("::");
    (!found.is_empty() && found != here).then_some(found)
}

fn uses(modules: &Modules) -> Uses {
    (modules.iter())
        .map(|(here, code)| {
            let used = paths(code)
                .iter()
                .filter_map(|p| target(p, here, modules))
                .collect();
            (here.clone(), used)
        })
        .collect()
}

/// All that a module uses, and what that uses.
fn reached(from: &str, uses: &Uses) -> BTreeSet<String> {
    let mut reached = BTreeSet::new();
    let mut next: Vec<&str> = vec![from];
    while let Some(here) = next.pop() {
        for used in &uses[here] {
            if reached.insert(used.clone()) {
                next.push(used);
            }
        }
    }
    reached
}

/// Modules that use each other, one set per circle.
fn circles(uses: &Uses) -> BTreeSet<BTreeSet<String>> {
    let reach: BTreeMap<&str, BTreeSet<String>> =
        uses.keys().map(|m| (m.as_str(), reached(m, uses))).collect();
    (reach.iter())
        .filter(|(module, reached)| reached.contains(**module))
        .map(|(module, reached)| {
            (reached.iter())
                .filter(|other| reach[other.as_str()].contains(*module))
                .cloned()
                .collect()
        })
        .collect()
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let mut found = Vec::new();
    for root in sources() {
        let uses = uses(&modules(&root));
        for circle in circles(&uses) {
            for module in &circle {
                let within: Vec<&String> = uses[module].intersection(&circle).collect();
                found.push(format!("{}: {module} uses {within:?}", root.display()));
            }
        }
    }
    assert!(
        found.is_empty(),
        "files that use each other in a circle:\n{}",
        found.join("\n")
    );
}

#[test]
fn a_circle_is_found_however_it_is_spelled() {
    let modules: Modules = [
        ("", "pub mod a;\npub use a::A;\n"),
        ("a", "mod b;\nuse b::{C, d::{E, F as G}};\n"),
        ("a::b", "mod d;\nfn f() -> super::super::c::X {}\n"),
        ("a::b::d", ""),
        ("c", "fn g(a: crate::a::A) {}\n"),
        ("e", "use crate::a;\n"),
    ]
    .map(|(name, code)| (name.to_owned(), code.to_owned()))
    .into();
    let uses = uses(&modules);
    let set = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(uses["a"], set(&["a::b", "a::b::d"]));
    assert_eq!(uses["a::b"], set(&["c"]));
    assert_eq!(circles(&uses), BTreeSet::from([set(&["a", "a::b", "c"])]));
}
