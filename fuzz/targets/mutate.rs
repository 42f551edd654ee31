//! A small fuzzer for every toolchain: mutates a corpus by chance, the same way each time. It knows nothing of the code
//! that it runs, so it finds less than libFuzzer in the same time, but it always runs.

use super::Target;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}

/// Longest input that is made.
const LONGEST: usize = 1 << 16;

fn mutate(corpus: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let pick = |random: &mut Random| corpus[random.below(corpus.len())].clone();
    let mut out = pick(random);
    for _ in 0..=random.below(4) {
        let at = random.below(out.len() + 1);
        let end = (at + 1 + random.below(16)).min(out.len());
        match random.below(8) {
            0 if at < out.len() => out[at] ^= 1 << random.below(8),
            1 if at < out.len() => out[at] = random.next() as u8,
            2 if at < out.len() => out[at..end].fill([0, 0x7f, 0x80, 0xff][random.below(4)]),
            3 if at < out.len() => {
                out.drain(at..end);
            }
            4 if at < out.len() => {
                let piece = out[at..end].to_vec();
                out.splice(at..at, piece);
            }
            5 => {
                let other = pick(random);
                let from = random.below(other.len() + 1);
                let piece = &other[from..(from + random.below(64)).min(other.len())];
                out.splice(at..at, piece.iter().copied());
            }
            6 if at + 4 <= out.len() => {
                let number = random.next() as u32 >> random.below(32);
                out[at..at + 4].copy_from_slice(&number.to_le_bytes());
            }
            7 => out.truncate(at),
            _ => out.push(random.next() as u8),
        }
    }
    out.truncate(LONGEST);
    out
}

/// Where a target's corpus is.
fn corpus_folder(target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fuzz/corpus")
        .join(target)
}

/// Puts an input into a target's corpus, in place of one of the same name.
pub fn write_seed(target: &str, name: &str, data: &[u8]) {
    let folder = corpus_folder(target);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(name), data).unwrap();
}

/// The files of one target's corpus, by name.
fn corpus_of(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    files
        .into_iter()
        .map(|file| (file.clone(), std::fs::read(file).unwrap()))
        .collect()
}

/// Feeds one input; an input that panics, or takes over a second, is kept and the test fails.
fn try_one(name: &str, target: Target, data: &[u8]) {
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| target(data)));
    let slow = start.elapsed() > Duration::from_secs(SLOW_SECONDS);
    if result.is_err() || slow {
        let kept = std::env::temp_dir().join(format!("relight_fuzz_{name}"));
        let _ = std::fs::write(&kept, data);
        let what = if slow { "took over a second" } else { "panicked" };
        panic!("{name} {what}; the input is kept as {}", kept.display());
    }
}

/// A hang, with room for a busy machine.
const SLOW_SECONDS: u64 = 5;

/// Feeds each target its corpus, then `rounds` mutations of it, or with RELIGHT_FUZZ_SECONDS set as many as fit into that
/// many seconds for each target, from a seed of its own (RELIGHT_FUZZ_SEED). Returns how many inputs each was fed.
pub fn feed_all(targets: &[(&'static str, Target)], rounds: usize) -> Vec<(&'static str, usize)> {
    let number = |name: &str| std::env::var(name).ok().and_then(|v| v.parse::<u64>().ok());
    let (seconds, seed) = (
        number("RELIGHT_FUZZ_SECONDS"),
        number("RELIGHT_FUZZ_SEED").unwrap_or(0),
    );
    let only = std::env::var("RELIGHT_FUZZ_TARGET").ok();
    let mut fed = Vec::new();
    for &(name, target) in targets
        .iter()
        .filter(|t| only.as_deref().is_none_or(|only| only == t.0))
    {
        let files = corpus_of(&corpus_folder(name));
        assert!(!files.is_empty(), "{name} has a corpus");
        files.iter().for_each(|(_, data)| try_one(name, target, data));
        let corpus: Vec<Vec<u8>> = files.into_iter().map(|file| file.1).collect();
        let mut random = Random(seed);
        let start = Instant::now();
        let mut count = 0;
        let go_on = |count: usize| match seconds {
            Some(seconds) => start.elapsed() < Duration::from_secs(seconds),
            None => count < rounds,
        };
        while go_on(count) {
            try_one(name, target, &mutate(&corpus, &mut random));
            count += 1;
        }
        fed.push((name, corpus.len() + count));
    }
    fed
}
