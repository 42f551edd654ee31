//! Which frames, and what their files are called.

use crate::failure::Failure;
use crate::words;
use std::path::{Path, PathBuf};

/// Frames to play: first to last inclusive, every so many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// First frame.
    pub first: u32,
    /// Last frame, inclusive.
    pub last: u32,
    /// Distance from frame to frame, at least 1.
    pub step: u32,
}

impl FrameRange {
    /// Whether a sequence of so many frames has them.
    ///
    /// # Errors
    /// It ends before.
    pub fn check(self, frames: u32) -> Result<(), Failure> {
        let end = frames.max(1) - 1;
        if self.last <= end {
            return Ok(());
        }
        Err(Failure::Usage(format!(
            "--frames goes up to {}, but the sequence has {} (0 to {end})",
            self.last,
            words::plural(frames as usize, "frame")
        )))
    }

    /// The frames in order.
    pub fn iter(self) -> impl Iterator<Item = u32> {
        (self.first..=self.last).step_by(self.step as usize)
    }
}

/// Parses `A`, `A-B` or `A-BxN`.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_range(text: &str) -> Result<FrameRange, String> {
    let expected = || "expected A, A-B or A-BxN, such as 0-47x2".to_owned();
    let number = |text: &str| text.parse::<u32>().map_err(|_| expected());
    let (range, step) = match text.split_once('x') {
        Some((range, step)) => (range, number(step)?),
        None => (text, 1),
    };
    let (first, last) = match range.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (number(range)?, number(range)?),
    };
    if step == 0 {
        return Err("the step after x must be at least 1".into());
    }
    if first > last {
        return Err(format!("the first frame, {first}, comes after the last, {last}"));
    }
    Ok(FrameRange { first, last, step })
}

/// A file name with a place for the frame number: `####` or `%04d`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    before: String,
    after: String,
    /// Digits of the number; 0: the name has no place for one.
    digits: usize,
}

/// Parses an output name. It must end in `.exr`; the last run of `#`, or a `%d` or `%0Nd`, in the file's name is
/// the frame number.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_pattern(text: &str) -> Result<Pattern, String> {
    if !text.to_ascii_lowercase().ends_with(".exr") || text.len() == 4 {
        return Err("the name must end in .exr; --png adds previews beside".into());
    }
    let folder = text.rfind('/').map_or(0, |slash| slash + 1);
    let name = &text[folder..];
    let plain = Pattern {
        before: text.into(),
        after: String::new(),
        digits: 0,
    };
    if let Some(end) = name.rfind('#') {
        let start = name[..end]
            .rfind(|c| c != '#')
            .map_or(0, |i| i + name[i..].chars().next().map_or(1, char::len_utf8));
        return Ok(Pattern {
            before: text[..folder + start].into(),
            after: name[end + 1..].into(),
            digits: end + 1 - start,
        });
    }
    let Some(percent) = name.find('%') else {
        return Ok(plain);
    };
    let rest = &name[percent + 1..];
    let Some(d) = rest.find('d') else {
        return Err(format!("{name:?}: a % must begin a frame number such as %04d"));
    };
    let digits = match &rest[..d] {
        "" => 1,
        width => width
            .parse::<usize>()
            .ok()
            .filter(|n| (1..=9).contains(n))
            .ok_or_else(|| format!("{name:?}: a % must begin a frame number such as %04d"))?,
    };
    Ok(Pattern {
        before: text[..folder + percent].into(),
        after: rest[d + 1..].into(),
        digits,
    })
}

impl Pattern {
    /// Whether different frames get different names.
    pub fn has_number(&self) -> bool {
        self.digits > 0
    }

    /// The frames that have a file, ascending.
    ///
    /// # Errors
    /// The folder can't be read.
    pub fn found(&self) -> std::io::Result<Vec<u32>> {
        let file = self.file(0);
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        let before = self.before.rsplit('/').next().unwrap_or_default();
        let mut frames = Vec::new();
        for entry in std::fs::read_dir(folder.unwrap_or(Path::new(".")))? {
            let name = entry?.file_name();
            let number = (name.to_str())
                .and_then(|name| {
                    name.strip_prefix(before)?
                        .strip_suffix(&*self.after)?
                        .parse()
                        .ok()
                })
                .filter(|&frame| self.file(frame).file_name() == Some(&name));
            frames.extend(number);
        }
        frames.sort_unstable();
        Ok(frames)
    }

    /// The file of a frame.
    pub fn file(&self, frame: u32) -> PathBuf {
        if self.digits == 0 {
            return self.before.clone().into();
        }
        format!(
            "{}{frame:0width$}{}",
            self.before,
            self.after,
            width = self.digits
        )
        .into()
    }
}

/// Parses `WxH`.
///
/// # Errors
/// What is wrong, in words.
pub fn parse_size(text: &str) -> Result<(usize, usize), String> {
    // 16384 squared is the largest image that viewers open, and 12 GiB of layers.
    let side = |text: &str| text.parse::<usize>().ok().filter(|n| (1..=16384).contains(n));
    match text.split_once('x').map(|(w, h)| (side(w), side(h))) {
        Some((Some(width), Some(height))) => Ok((width, height)),
        _ => Err("expected WxH in pixels, such as 640x360, each from 1 to 16384".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_inclusive_and_stepped() {
        let frames = |text| parse_range(text).map(|r| r.iter().collect::<Vec<_>>());
        assert_eq!(frames("0-6x2"), Ok(vec![0, 2, 4, 6]));
        assert_eq!(frames("3"), Ok(vec![3]));
        assert_eq!(frames("4-5"), Ok(vec![4, 5]));
        for wrong in ["", "5-4", "0-4x0", "a", "1-", "-1", "1-2x"] {
            assert!(frames(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn patterns_name_frames() {
        let name = |text: &str, frame| parse_pattern(text).map(|p| p.file(frame).display().to_string());
        assert_eq!(name("out/f_####.exr", 7), Ok("out/f_0007.exr".into()));
        assert_eq!(name("####.exr", 12345), Ok("12345.exr".into()));
        assert_eq!(name("o/é##.exr", 3), Ok("o/é03.exr".into()));
        assert_eq!(name("f%04d_x.exr", 7), Ok("f0007_x.exr".into()));
        assert_eq!(name("f%d.exr", 7), Ok("f7.exr".into()));
        assert_eq!(name("plain.exr", 7), Ok("plain.exr".into()));
        assert_eq!(name("a#b/plain.EXR", 7), Ok("a#b/plain.EXR".into()));
        for wrong in ["f.png", ".exr", "f%q.exr", "f%99d.exr", "f"] {
            assert!(name(wrong, 0).is_err(), "{wrong}");
        }
    }
}
