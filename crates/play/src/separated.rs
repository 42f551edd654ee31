//! Which finest points walls separate from which of their neighbours.
//!
//! A wall between a place and a point that covers it has other points that cover the place on its own side of it, and separates the point
//! from those as well. So only where points that cover a place are separated from one another rays ask about the place itself.

use crate::transfer::Transfer;
use rayon::prelude::*;
use relight_scene::surface::Surfaces;

/// Points that are separated, point by point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Separated {
    /// Where each point's begin in `others`, and the last one's end; empty where there are none at all.
    offsets: Vec<u32>,
    others: Vec<u32>,
}

/// Points that are asked about together: their rays stay in fast memory.
const TOGETHER: usize = 256;

impl Separated {
    /// Asks about all neighbours of which the bake says that something separates them from some.
    pub fn find(surfaces: &dyn Surfaces, transfer: &Transfer) -> Separated {
        let (finest, near) = (&transfer.finest, &transfer.near_separated);
        if !near.contains(&true) {
            return Separated::default();
        }
        let around = finest.across_walls();
        let points: Vec<u32> = (0..finest.len() as u32).collect();
        let found: Vec<Vec<[u32; 2]>> = (points.par_chunks(TOGETHER))
            .map(|points| {
                let (mut asked, mut pairs) = (Vec::new(), Vec::new());
                for &i in points.iter().filter(|&&i| near[i as usize]) {
                    let place = (finest.positions[i as usize], finest.normals[i as usize]);
                    around.weights_at(place.0, place.1, |j, _| {
                        if j != i && near[j as usize] {
                            asked.push((place, j));
                            pairs.push([i, j]);
                        }
                    });
                }
                let separated = transfer.each_separated(surfaces, &asked);
                let separated = pairs.into_iter().zip(separated).filter(|pair| pair.1);
                separated.flat_map(|([i, j], _)| [[i, j], [j, i]]).collect()
            })
            .collect();
        let mut pairs = found.concat();
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; finest.len() + 1];
        pairs.iter().for_each(|pair| offsets[pair[0] as usize + 1] += 1);
        for point in 0..finest.len() {
            offsets[point + 1] += offsets[point];
        }
        Separated {
            offsets,
            others: pairs.into_iter().map(|pair| pair[1]).collect(),
        }
    }

    /// Points that one is separated from.
    #[inline]
    pub fn from(&self, point: u32) -> &[u32] {
        match self.offsets.get(point as usize..) {
            Some(&[start, end, ..]) => &self.others[start as usize..end as usize],
            _ => &[],
        }
    }
}
