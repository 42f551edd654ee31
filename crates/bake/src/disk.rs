//! Room on disks.

use std::path::Path;
use std::process::Command;

/// Bytes of an asset for each of its points: 20 to 90 with their links (docs/results.md).
const LEAST_BYTES_OF_POINT: f64 = 30.0;

/// What to say where the disk of an asset, or a folder of units, that is not there yet is too full for so many points.
pub fn lacks_for(file: &Path, points: f64) -> Option<String> {
    lacks(file, (points * LEAST_BYTES_OF_POINT) as u64)
}

/// What to say where the disk of a file that is not there yet has less room than so many bytes; `None` where it has enough, or nobody
/// knows.
pub fn lacks(file: &Path, bytes: u64) -> Option<String> {
    let free = free(file)?;
    (free < bytes).then(|| {
        format!(
            "{}: about {} will be written, but its disk has {} left: free some space, or write elsewhere",
            file.display(),
            in_words(bytes),
            in_words(free)
        )
    })
}

fn in_words(bytes: u64) -> String {
    match bytes {
        0..10_000_000 => format!("{} kB", bytes / 1000),
        _ => format!("{} MB", bytes / 1_000_000),
    }
}

/// Bytes that can be written beside a file, as `df` of POSIX says.
fn free(file: &Path) -> Option<u64> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let said = Command::new("df")
        .arg("-Pk")
        .arg("--")
        .arg(folder)
        .output()
        .ok()?;
    kibibytes(&String::from_utf8_lossy(&said.stdout)).map(|n| n.saturating_mul(1024))
}

/// Blocks of 1024 bytes that are available: the number before the share in use. Names of file systems may hold blanks.
fn kibibytes(said: &str) -> Option<u64> {
    let line = said.lines().nth(1)?;
    let share = line.split_whitespace().position(|word| word.ends_with('%'))?;
    line.split_whitespace().nth(share.checked_sub(1)?)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_available_is_found() {
        let said = "Filesystem 1024-blocks Used Available Capacity Mounted on\n/dev/a b 100 40 60 40% /x y\n";
        assert_eq!(kibibytes(said), Some(60));
        assert_eq!(kibibytes(""), None);
    }
}
