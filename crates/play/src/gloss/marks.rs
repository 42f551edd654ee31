//! Some of many numbers, and sums of theirs: quick to add to, and to empty.

use glam::Vec3;

/// Which of all numbers are marked.
pub(super) struct Marks {
    is_marked: Vec<bool>,
    /// Those.
    marked: Vec<u32>,
}

impl Marks {
    /// None of the numbers below `all`.
    pub fn of(all: usize) -> Marks {
        Marks {
            is_marked: vec![false; all],
            marked: Vec::new(),
        }
    }

    /// Whether it was not marked yet.
    pub fn mark(&mut self, number: u32) -> bool {
        let is_new = !std::mem::replace(&mut self.is_marked[number as usize], true);
        if is_new {
            self.marked.push(number);
        }
        is_new
    }

    pub fn has(&self, number: u32) -> bool {
        self.is_marked[number as usize]
    }

    pub fn ascending(&mut self) -> &[u32] {
        self.marked.sort_unstable();
        &self.marked
    }

    /// Marks none.
    pub fn clear(&mut self) {
        for number in self.marked.drain(..) {
            self.is_marked[number as usize] = false;
        }
    }
}

/// Sums of some of all numbers.
pub(super) struct Sums {
    sums: Vec<Vec3>,
    is_member: Vec<bool>,
    /// Those, some removed, some more than once.
    added: Vec<u32>,
}

impl Sums {
    /// None of the numbers below `all`.
    pub fn of(all: usize) -> Sums {
        Sums {
            sums: vec![Vec3::ZERO; all],
            is_member: vec![false; all],
            added: Vec::new(),
        }
    }

    /// Adds to sums of numbers.
    pub fn add_all(&mut self, more: impl Iterator<Item = (u32, Vec3)>) {
        for (number, value) in more {
            let at = number as usize;
            if !std::mem::replace(&mut self.is_member[at], true) {
                self.added.push(number);
                self.sums[at] = Vec3::ZERO;
            }
            self.sums[at] += value;
        }
    }

    /// Takes out a number's sum, if it has one.
    pub fn remove(&mut self, number: u32) -> Option<Vec3> {
        let at = number as usize;
        std::mem::replace(&mut self.is_member[at], false).then(|| self.sums[at])
    }

    /// Numbers that have sums, in any order, some more than once.
    pub fn members(&self) -> impl Iterator<Item = u32> + '_ {
        (self.added.iter().copied()).filter(|&number| self.is_member[number as usize])
    }

    /// Takes out all, ascending.
    pub fn take(&mut self) -> Vec<(u32, Vec3)> {
        let mut added = std::mem::take(&mut self.added);
        added.sort_unstable();
        let all = (added.iter())
            .filter_map(|&number| Some((number, self.remove(number)?)))
            .collect();
        added.clear();
        self.added = added;
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_taken_once_and_ascend_whatever_was_removed_between() {
        let mut sums = Sums::of(4);
        for _ in 0..2 {
            let of = |number: u32, value: f32| std::iter::once((number, Vec3::splat(value)));
            sums.add_all(of(3, 1.0));
            sums.add_all(of(1, 2.0));
            sums.add_all(of(3, 4.0));
            assert_eq!(sums.remove(1), Some(Vec3::splat(2.0)));
            assert_eq!(sums.remove(1), None);
            sums.add_all(of(1, 8.0));
            sums.add_all(of(0, 16.0));
            let expected = [(0, 16.0), (1, 8.0), (3, 5.0)];
            assert_eq!(
                sums.take(),
                expected.map(|(number, sum)| (number, Vec3::splat(sum)))
            );
            assert_eq!(sums.take(), []);
        }
    }

    #[test]
    fn marks_are_told_once_and_ascend() {
        let mut marks = Marks::of(4);
        for _ in 0..2 {
            assert!(marks.mark(2) && marks.mark(0) && !marks.mark(2));
            assert_eq!(marks.ascending(), [0, 2]);
            assert!(marks.has(0) && !marks.has(1));
            marks.clear();
            assert!(!marks.has(0));
        }
    }
}
