//! Files that a number tells apart: `sky_####.hdr` stands for `sky_0000.hdr`, `sky_0001.hdr` and so on, each `#` for a digit, the
//! first one for any number of them.

use std::path::{Path, PathBuf};

/// Most files of one pattern, as sequences have frames.
const MOST: usize = 10_000_000;

/// Whether a file's name has `#` for a number.
pub fn is_pattern(file: &Path) -> bool {
    parts(file).is_some()
}

/// What stands before and after the number, and its least digits.
fn parts(file: &Path) -> Option<(&str, &str, usize)> {
    let name = file.file_name()?.to_str()?;
    let start = name.find('#')?;
    let digits = name[start..].chars().take_while(|&c| c == '#').count();
    Some((&name[..start], &name[start + digits..], digits))
}

/// The files of a pattern, by rising number.
///
/// # Errors
/// The folder can't be read, holds none, or lacks one between others; in words that go behind the pattern's name.
pub fn files(pattern: &Path) -> Result<Vec<PathBuf>, String> {
    let (before, after, digits) = parts(pattern).ok_or("has no # for a number")?;
    let folder = pattern.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder)
        .map_err(|error| format!("its folder {} cannot be read: {error}", folder.display()))?;
    let mut found: Vec<(u64, PathBuf)> = Vec::new();
    for entry in entries.take(MOST).flatten() {
        let name = entry.file_name();
        let number = name.to_str().and_then(|name| {
            let number = name.strip_prefix(before)?.strip_suffix(after)?;
            let plain = number.len() >= digits && number.bytes().all(|byte| byte.is_ascii_digit());
            // Longer numbers than the pattern's digits have no zeros before them, so that no two names mean one.
            let short = number.len() == digits || !number.starts_with('0');
            number.parse().ok().filter(|_| plain && short)
        });
        found.extend(number.map(|number| (number, entry.path())));
    }
    found.sort_unstable();
    for pair in found.windows(2) {
        let missing = pair[0].0 + 1;
        if pair[1].0 != missing {
            return Err(format!(
                "{before}{missing:0digits$}{after} is missing, but {} is there; number the files without gaps",
                pair[1].1.file_name().unwrap_or_default().to_string_lossy()
            ));
        }
    }
    if found.is_empty() {
        return Err(format!(
            "no file in {} is called so, with {digits} digits or more for the #",
            folder.display()
        ));
    }
    Ok(found.into_iter().map(|(_, file)| file).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_come_by_number_and_gaps_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str| std::fs::write(folder.path().join(name), "").unwrap();
        let names = |pattern: &str| -> Result<Vec<String>, String> {
            let found = files(&folder.path().join(pattern))?;
            Ok(found
                .iter()
                .map(|f| f.file_name().unwrap().to_string_lossy().into_owned())
                .collect())
        };
        for name in [
            "s_08.hdr",
            "s_10.hdr",
            "s_9.hdr",
            "s_09.hdr",
            "s_010.hdr",
            "s_x1.hdr",
            "s_11.exr",
            "t_08.hdr",
        ] {
            make(name);
        }
        assert_eq!(names("s_##.hdr").unwrap(), ["s_08.hdr", "s_09.hdr", "s_10.hdr"]);
        for i in 11..101 {
            make(&format!("s_{i}.hdr"));
        }
        assert_eq!(names("s_##.hdr").unwrap().len(), 93);
        std::fs::remove_file(folder.path().join("s_42.hdr")).unwrap();
        let said = names("s_##.hdr").unwrap_err();
        assert!(
            said.contains("s_42.hdr is missing, but s_43.hdr is there"),
            "{said}"
        );
        let said = names("u_##.hdr").unwrap_err();
        assert!(said.contains("is called so, with 2 digits"), "{said}");
        assert!(names("no/s_##.hdr").unwrap_err().contains("cannot be read"));
        assert!(is_pattern(Path::new("a/b_#.exr")) && !is_pattern(Path::new("a_#/b.exr")));
    }
}
