//! Raw bytes: a checked reader, varints, zigzag, byte planes (SPEC 7.1 to 7.3).
//!
//! A byte plane holds one byte of each element: all lowest bytes, then all second bytes, and so on. zstd models
//! a plane of exponents or high bytes far better than the same bytes interleaved with noise.

use crate::error::{FormatError, Location, Result, invalid, limit, unsupported};

/// A reader over a section's raw bytes that knows its place and how much memory decoding may still take.
pub struct Cursor<'a> {
    section: &'a str,
    bytes: &'a [u8],
    at: usize,
    memory: &'a mut u64,
}

impl<'a> Cursor<'a> {
    /// Reads `bytes` from their start; `section` is for errors; `memory` is what decoded arrays may still take,
    /// and is reduced as they are allocated.
    pub fn new(section: &'a str, bytes: &'a [u8], memory: &'a mut u64) -> Self {
        Cursor {
            section,
            bytes,
            at: 0,
            memory,
        }
    }

    /// An error at the reader's place.
    pub fn invalid(&self, expected: impl std::fmt::Display, found: impl std::fmt::Display) -> FormatError {
        invalid(self.section, Location::Raw(self.at as u64), expected, found)
    }

    /// An error at the byte before the reader's place, for what only other versions read.
    pub fn unsupported(
        &self,
        expected: impl std::fmt::Display,
        found: impl std::fmt::Display,
    ) -> FormatError {
        let location = Location::Raw(self.at.saturating_sub(1) as u64);
        unsupported(self.section, location, expected, found)
    }

    /// Bytes not yet read.
    pub fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next `count` bytes.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8]> {
        if count > self.remaining() {
            return Err(self.invalid(format_args!("{count} more bytes"), self.remaining()));
        }
        let taken = &self.bytes[self.at..self.at + count];
        self.at += count;
        Ok(taken)
    }

    /// The next byte.
    ///
    /// # Errors
    /// None is left.
    pub fn u8(&mut self) -> Result<u8> {
        Ok(self.take(1)?[0])
    }

    /// The next unsigned LEB128 number of at most 32 bits (SPEC 7.1).
    ///
    /// # Errors
    /// The bytes end within it, or it has more than 32 bits.
    pub fn varint(&mut self) -> Result<u32> {
        let mut value = 0u64;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.u8()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return u32::try_from(value).map_err(|_| self.invalid("a varint of at most 32 bits", value));
            }
        }
        Err(self.invalid("a varint of at most 5 bytes", "a longer one"))
    }

    /// Checks that the raw bytes left can hold `count` elements of at least `min_raw` bytes each.
    ///
    /// # Errors
    /// They cannot.
    pub fn justify(&self, count: usize, min_raw: usize) -> Result<()> {
        match count.checked_mul(min_raw) {
            Some(needed) if needed <= self.remaining() => Ok(()),
            _ => Err(self.invalid(
                format_args!("at least {min_raw} bytes for each of {count} elements"),
                format_args!("{} bytes", self.remaining()),
            )),
        }
    }

    /// An empty vector with room for `count` elements, of which each takes at least `min_raw` of the raw bytes
    /// that are left. Nothing is allocated that the file cannot justify or the limits forbid.
    ///
    /// # Errors
    /// Too few raw bytes are left for `count` elements, or the memory limit is passed.
    pub fn vec<T>(&mut self, count: usize, min_raw: usize) -> Result<Vec<T>> {
        self.justify(count, min_raw)?;
        self.charge((count as u64).saturating_mul(size_of::<T>() as u64))?;
        Ok(Vec::with_capacity(count))
    }

    /// Counts `bytes` of memory against the limit.
    ///
    /// # Errors
    /// The limit is passed.
    pub fn charge(&mut self, bytes: u64) -> Result<()> {
        match self.memory.checked_sub(bytes) {
            Some(left) => {
                *self.memory = left;
                Ok(())
            }
            None => Err(limit(
                self.section,
                Location::Raw(self.at as u64),
                format_args!("at most {} more bytes of memory", self.memory),
                bytes,
            )),
        }
    }

    /// What `read` gives, with `bytes` of memory set aside meanwhile.
    ///
    /// # Errors
    /// The limit is passed, or those of `read`.
    pub fn lend<T>(&mut self, bytes: u64, read: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.charge(bytes)?;
        let result = read(self);
        *self.memory += bytes;
        result
    }

    /// The number of planes that follow, 1 to 4.
    ///
    /// # Errors
    /// It is another number, or no byte is left.
    pub fn plane_width(&mut self) -> Result<usize> {
        match self.u8()? {
            width @ 1..=4 => Ok(usize::from(width)),
            found => Err(self.invalid("1 to 4 byte planes", found)),
        }
    }

    /// Checks that everything was read.
    ///
    /// # Errors
    /// Bytes are left over.
    pub fn finish(self) -> Result<()> {
        match self.remaining() {
            0 => Ok(()),
            left => Err(self.invalid("the end of the section", format_args!("{left} more bytes"))),
        }
    }
}

/// Appends an unsigned LEB128 number: seven bits per byte, lowest first, high bit set on all but the last.
pub fn put_varint(out: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Maps a difference modulo 2³² to a number that is small when the difference is near zero: 0, −1, 1, −2 … become
/// 0, 1, 2, 3 …
pub fn zigzag(difference: u32) -> u32 {
    (difference << 1) ^ ((difference as i32 >> 31) as u32)
}

/// Inverse of [`zigzag`].
pub fn unzigzag(code: u32) -> u32 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

/// Appends the lowest `width` bytes of each value as planes, lowest plane first.
pub fn put_planes(out: &mut Vec<u8>, width: usize, values: &[u32]) {
    for plane in 0..width {
        out.extend(values.iter().map(|value| (value >> (8 * plane)) as u8));
    }
}

/// `width` planes of `count` bytes each.
#[derive(Clone, Copy)]
pub struct Planes<'a> {
    bytes: &'a [u8],
    count: usize,
}

impl<'a> Planes<'a> {
    /// Takes the planes from the reader.
    ///
    /// # Errors
    /// Too few bytes are left.
    pub fn take(cursor: &mut Cursor<'a>, width: usize, count: usize) -> Result<Self> {
        let total = width.saturating_mul(count);
        Ok(Planes {
            bytes: cursor.take(total)?,
            count,
        })
    }

    /// The values, whose missing high bytes are zero.
    pub fn values(self) -> impl Iterator<Item = u32> + 'a {
        let Planes { bytes, count } = self;
        // An absent plane reads as zero through an empty slice.
        let plane = move |k: usize| bytes.get(k * count..(k + 1) * count).unwrap_or(&[]);
        let planes = [plane(0), plane(1), plane(2), plane(3)];
        (0..count).map(move |i| {
            let byte = |k: usize| u32::from(planes[k].get(i).copied().unwrap_or(0));
            byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24
        })
    }
}

/// Bytes needed for the largest of the values, 1 to 4.
pub fn width_of(largest: u32) -> usize {
    (4 - largest.leading_zeros() as usize / 8).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn varints_zigzag_and_planes_lose_nothing(values in prop::collection::vec(any::<u32>(), 0..50)) {
            let mut bytes = Vec::new();
            values.iter().for_each(|&v| put_varint(&mut bytes, zigzag(v)));
            let varints = bytes.len();
            put_planes(&mut bytes, 4, &values);
            let mut memory = 1 << 20;
            let mut cursor = Cursor::new("test", &bytes, &mut memory);
            for &v in &values {
                prop_assert_eq!(unzigzag(cursor.varint().unwrap()), v);
            }
            prop_assert_eq!(cursor.remaining(), bytes.len() - varints);
            let planes: Vec<u32> = Planes::take(&mut cursor, 4, values.len()).unwrap().values().collect();
            prop_assert_eq!(planes, values);
            cursor.finish().unwrap();
        }
    }

    #[test]
    fn a_number_takes_the_bytes_that_it_needs() {
        assert_eq!(
            [0, 255, 256, 65535, 65536, 1 << 24].map(width_of),
            [1, 1, 2, 2, 3, 4]
        );
        assert_eq!([0u32, u32::MAX, 1, u32::MAX - 1].map(zigzag), [0, 1, 2, 3]);
    }

    #[test]
    fn a_varint_that_is_too_long_is_refused() {
        let mut memory = 0;
        for bytes in [&[0xff, 0xff, 0xff, 0xff, 0x7f][..], &[0x80; 6], &[0x80]] {
            assert!(Cursor::new("test", bytes, &mut memory).varint().is_err());
        }
    }

    #[test]
    fn memory_is_refused_before_it_is_allocated() {
        let mut memory = 1000;
        let bytes = [0; 100];
        let mut cursor = Cursor::new("test", &bytes, &mut memory);
        assert!(matches!(cursor.vec::<u32>(101, 1), Err(FormatError::Invalid(_))));
        assert!(matches!(
            cursor.vec::<[u32; 3]>(100, 1),
            Err(FormatError::LimitExceeded(_))
        ));
        assert!(matches!(
            cursor.vec::<u32>(usize::MAX, 2),
            Err(FormatError::Invalid(_))
        ));
        assert!(cursor.vec::<u32>(100, 1).is_ok());
    }
}
