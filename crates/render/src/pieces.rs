//! An exposure put together of the pixels of others: two passes of rows see pixels, and what they saw is hundreds of megabytes, so that it is copied once,
//! by all cores.

use crate::exposure::Exposure;
use rayon::prelude::*;

/// Where a pixel or a fragment comes from.
#[derive(Clone, Copy)]
pub(crate) struct Origin {
    /// Which piece.
    pub piece: u32,
    /// Which of its pixels or fragments.
    pub index: u32,
}

/// Fragments that are copied together at least.
const TASK: usize = 4096;

/// The exposure `like` one without pixels, with `pixels` of some pieces.
pub(crate) fn put_together(like: Exposure, pieces: &[Exposure], pixels: &[Origin]) -> Exposure {
    let mut offsets = Vec::with_capacity(pixels.len() + 1);
    let (mut fragments, mut end_offsets, mut ends) = (Vec::new(), vec![0], 0);
    for pixel in pixels {
        let piece = &pieces[pixel.piece as usize];
        offsets.push(fragments.len() as u32);
        for f in piece.fragments_of(pixel.index as usize) {
            fragments.push(Origin {
                index: f as u32,
                ..*pixel
            });
            ends += piece.end_offsets[f + 1] - piece.end_offsets[f];
            end_offsets.push(ends);
        }
    }
    offsets.push(fragments.len() as u32);
    let of = |from: &Origin| (&pieces[from.piece as usize], from.index as usize);
    let each = || fragments.par_iter().with_min_len(TASK).map(of);
    let ends = (0..ends).into_par_iter().with_min_len(TASK).map_init(
        || 0,
        |fragment, end| {
            if !(end_offsets[*fragment]..end_offsets[*fragment + 1]).contains(&end) {
                *fragment = end_offsets.partition_point(|&start| start <= end) - 1;
            }
            let (piece, f) = of(&fragments[*fragment]);
            piece.ends[(piece.end_offsets[f] + end - end_offsets[*fragment]) as usize]
        },
    );
    let bent = pieces.iter().any(|piece| !piece.through.is_empty());
    Exposure {
        offsets,
        coverage: each().map(|(piece, f)| piece.coverage[f]).collect(),
        hits: each().map(|(piece, f)| piece.hits[f]).collect(),
        points: each().map(|(piece, f)| piece.points[f]).collect(),
        directions: each().map(|(piece, f)| piece.directions[f]).collect(),
        through: match bent {
            true => each().map(|(piece, f)| piece.through(f)).collect(),
            false => Vec::new(),
        },
        ends: ends.collect(),
        end_offsets,
        ..like
    }
}
