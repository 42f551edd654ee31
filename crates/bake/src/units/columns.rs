//! Results of stages as columns of numbers, and back.

use super::Unit;
use crate::cuts::light_samples::Ordered;
use crate::cuts::visibility::{TASK, TaskCuts, UnitCuts};
use crate::links::refinement::{Receiver, Receivers};
use crate::links::solution::SparseRows;
use crate::points::poisson::Growth;
use crate::senders::clusters::Signatures;
use crate::senders::importance::Met;
use glam::Vec3;
use relight_format::unit::Column;
use relight_scene::surface::SurfaceHit;

/// Takes columns one after the other; `None` where the next is of another type.
struct Taker(std::vec::IntoIter<Column>);

macro_rules! take {
    ($name:ident, $kind:ident, $of:ty) => {
        fn $name(&mut self) -> Option<Vec<$of>> {
            match self.0.next()? {
                Column::$kind(numbers) => Some(numbers),
                _ => None,
            }
        }
    };
}

impl Taker {
    take!(u8s, U8, u8);
    take!(u32s, U32, u32);
    take!(u64s, U64, u64);
    take!(f32s, F32, f32);
    take!(f64s, F64, f64);
}

fn taker(columns: Vec<Column>) -> Taker {
    Taker(columns.into_iter())
}

/// The lengths of lists, and their parts of `all`, whose lengths must add up.
fn split<T: Clone>(lengths: &[u32], all: &[T]) -> Option<Vec<Vec<T>>> {
    let mut rest = all;
    let mut lists = Vec::with_capacity(lengths.len());
    for &length in lengths {
        let (list, after) = rest.split_at_checked(length as usize)?;
        lists.push(list.to_vec());
        rest = after;
    }
    rest.is_empty().then_some(lists)
}

fn lengths<T>(lists: impl Iterator<Item = Vec<T>>) -> (Vec<u32>, Vec<T>) {
    let (mut lengths, mut all) = (Vec::new(), Vec::new());
    for list in lists {
        lengths.push(list.len() as u32);
        all.extend(list);
    }
    (lengths, all)
}

/// Numbers of a hit that are floats.
const HIT_FLOATS: usize = 15;

impl Unit for Growth {
    fn columns(&self) -> Vec<Column> {
        let hits = || self.points.iter().flat_map(|level| &level.0);
        let floats = hits().flat_map(|hit| {
            let vectors = [hit.position, hit.position_error, hit.geometric_normal, hit.normal];
            let [u, v] = hit.barycentric;
            vectors
                .into_iter()
                .flat_map(|v| v.to_array())
                .chain([hit.t, u, v])
        });
        vec![
            Column::U32(self.points.iter().map(|level| level.0.len() as u32).collect()),
            Column::U64(
                self.points
                    .iter()
                    .flat_map(|level| level.1.iter().copied())
                    .collect(),
            ),
            Column::F32(floats.collect()),
            Column::U32(hits().map(|hit| hit.primitive).collect()),
            Column::U8(hits().map(|hit| u8::from(hit.front)).collect()),
            Column::U32(self.failures.clone()),
            Column::U64(self.totals.to_vec()),
            Column::U8(self.widenings.clone()),
            Column::U8(self.inherited.clone()),
            Column::U8(self.openness.iter().map(|asked| asked.0).collect()),
            Column::U64(self.openness.iter().map(|asked| asked.1).collect()),
            Column::U8(self.openness.iter().map(|asked| asked.2).collect()),
        ]
    }

    fn from_columns(columns: Vec<Column>, _: usize) -> Option<Growth> {
        let mut take = taker(columns);
        let (counts, candidates) = (take.u32s()?, take.u64s()?);
        let (floats, primitives, fronts) = (take.f32s()?, take.u32s()?, take.u8s()?);
        let (failures, totals) = (take.u32s()?, take.u64s()?);
        let (widenings, inherited) = (take.u8s()?, take.u8s()?);
        let (sides, cells, open) = (take.u8s()?, take.u64s()?, take.u8s()?);
        let same = [
            floats.len() / HIT_FLOATS,
            primitives.len(),
            fronts.len(),
            candidates.len(),
            widenings.len(),
            inherited.len(),
        ];
        let asked = [cells.len(), open.len()];
        if same != [same[0]; 6] || asked != [sides.len(); 2] || failures.len() != counts.len() {
            return None;
        }
        let hits: Vec<SurfaceHit> = (floats.chunks_exact(HIT_FLOATS).zip(&primitives).zip(&fronts))
            .map(|((f, &primitive), &front)| SurfaceHit {
                t: f[12],
                position: Vec3::from_slice(&f[0..3]),
                position_error: Vec3::from_slice(&f[3..6]),
                geometric_normal: Vec3::from_slice(&f[6..9]),
                normal: Vec3::from_slice(&f[9..12]),
                front: front != 0,
                primitive,
                barycentric: [f[13], f[14]],
            })
            .collect();
        let points = split(&counts, &hits)?
            .into_iter()
            .zip(split(&counts, &candidates)?);
        Some(Growth {
            points: points.collect(),
            widenings,
            inherited,
            openness: (sides.into_iter().zip(cells).zip(open))
                .map(|((side, cell), open)| (side, cell, open))
                .collect(),
            failures,
            totals: totals.try_into().ok()?,
        })
    }
}

impl Unit for Met {
    fn columns(&self) -> Vec<Column> {
        vec![Column::U32(self.counts.clone()), Column::U64(vec![self.rays])]
    }

    fn from_columns(columns: Vec<Column>, _: usize) -> Option<Met> {
        let mut take = taker(columns);
        Some(Met {
            counts: take.u32s()?,
            rays: *take.u64s()?.first()?,
        })
    }
}

impl Unit for Signatures {
    fn columns(&self) -> Vec<Column> {
        let halves = |s: &u128| [*s as u64, (*s >> 64) as u64];
        vec![Column::U64(self.0.iter().flat_map(halves).collect())]
    }

    fn from_columns(columns: Vec<Column>, count: usize) -> Option<Signatures> {
        let halves = taker(columns).u64s()?;
        let whole = |h: &[u64]| u128::from(h[0]) | (u128::from(h[1]) << 64);
        (halves.len() == 2 * count).then(|| Signatures(halves.chunks_exact(2).map(whole).collect()))
    }
}

impl Unit for Receivers {
    fn columns(&self) -> Vec<Column> {
        let links = || self.0.iter().flat_map(|r| &r.links);
        let bounces = || self.0.iter().flat_map(|r| &r.bounce);
        vec![
            Column::U32(self.0.iter().map(|r| r.links.len() as u32).collect()),
            Column::U32(links().map(|link| link.0).collect()),
            Column::F32(links().flat_map(|link| link.1.to_array()).collect()),
            Column::U32(self.0.iter().map(|r| r.bounce.len() as u32).collect()),
            Column::U32(bounces().map(|e| e.0).collect()),
            Column::F32(bounces().map(|e| e.1).collect()),
            Column::U8(self.0.iter().map(|r| u8::from(r.gathered)).collect()),
            Column::U32(self.0.iter().map(|r| r.lost).collect()),
            Column::U32(self.0.iter().map(|r| r.dropped).collect()),
        ]
    }

    fn from_columns(columns: Vec<Column>, count: usize) -> Option<Receivers> {
        let mut take = taker(columns);
        let (lengths, senders, vectors) = (take.u32s()?, take.u32s()?, take.f32s()?);
        let links: Vec<(u32, Vec3)> = (senders.into_iter())
            .zip(vectors.chunks_exact(3).map(Vec3::from_slice))
            .collect();
        let links = split(&lengths, &links)?;
        let (lengths, clusters, responses) = (take.u32s()?, take.u32s()?, take.f32s()?);
        let bounces: Vec<(u32, f32)> = clusters.into_iter().zip(responses).collect();
        let bounces = split(&lengths, &bounces)?;
        let (gathered, lost, dropped) = (take.u8s()?, take.u32s()?, take.u32s()?);
        let found = [
            links.len(),
            bounces.len(),
            gathered.len(),
            lost.len(),
            dropped.len(),
        ];
        if found != [count; 5] {
            return None;
        }
        let rays = gathered.into_iter().zip(lost).zip(dropped);
        let receivers = links.into_iter().zip(bounces).zip(rays);
        let receiver = |((links, bounce), ((gathered, lost), dropped))| Receiver {
            links,
            bounce,
            gathered: gathered != 0,
            lost,
            dropped,
            ..Receiver::default()
        };
        Some(Receivers(receivers.map(receiver).collect()))
    }
}

impl Unit for SparseRows {
    fn columns(&self) -> Vec<Column> {
        let (lengths, entries) = lengths(self.0.iter().cloned());
        vec![
            Column::U32(lengths),
            Column::U32(entries.iter().map(|e| e.0).collect()),
            Column::F32(entries.iter().map(|e| e.1).collect()),
        ]
    }

    fn from_columns(columns: Vec<Column>, count: usize) -> Option<SparseRows> {
        let mut take = taker(columns);
        let lengths = take.u32s()?;
        let entries: Vec<(u32, f32)> = take.u32s()?.into_iter().zip(take.f32s()?).collect();
        split(&lengths, &entries)
            .filter(|rows| rows.len() == count || rows.len() == 3 * count)
            .map(SparseRows)
    }
}

impl Unit for Ordered {
    fn columns(&self) -> Vec<Column> {
        vec![
            Column::U32(self.order.clone()),
            Column::F32(vec![self.unit]),
            Column::U64(vec![self.rays]),
        ]
    }

    fn from_columns(columns: Vec<Column>, count: usize) -> Option<Ordered> {
        let mut take = taker(columns);
        let order = take.u32s()?;
        let all_there = order.len() == count && order.iter().all(|&i| (i as usize) < count);
        all_there.then_some(())?;
        Some(Ordered {
            order,
            unit: *take.f32s()?.first()?,
            rays: *take.u64s()?.first()?,
        })
    }
}

impl Unit for UnitCuts {
    fn columns(&self) -> Vec<Column> {
        let ends = self.0.iter().flat_map(|p| p.ends.iter().map(|&e| e as u32));
        let per_part = |pick: fn(&TaskCuts) -> f64| Column::F64(self.0.iter().map(pick).collect());
        vec![
            Column::U32(ends.collect()),
            Column::U8(self.0.iter().flat_map(|p| p.heights.iter().copied()).collect()),
            Column::F32(self.0.iter().flat_map(|p| p.values.iter().copied()).collect()),
            Column::U64(self.0.iter().map(|p| p.rays).collect()),
            per_part(|p| p.count),
            per_part(|p| p.squares),
        ]
    }

    fn from_columns(columns: Vec<Column>, count: usize) -> Option<UnitCuts> {
        let mut take = taker(columns);
        let (ends, heights, values) = (take.u32s()?, take.u8s()?, take.f32s()?);
        let (rays, counts, squares) = (take.u64s()?, take.f64s()?, take.f64s()?);
        let tasks = count.div_ceil(TASK);
        if ends.len() != count || [rays.len(), counts.len(), squares.len()] != [tasks; 3] {
            return None;
        }
        if ends.chunks(TASK).any(|ends| !ends.is_sorted()) {
            return None;
        }
        // Ends count within a part, so that a part's last end is its length.
        let lengths: Vec<u32> = ends.chunks(TASK).filter_map(|e| e.last().copied()).collect();
        let (heights, values) = (split(&lengths, &heights)?, split(&lengths, &values)?);
        let parts = ends.chunks(TASK).zip(heights).zip(values).enumerate();
        Some(UnitCuts(
            parts
                .map(|(i, ((ends, heights), values))| TaskCuts {
                    ends: ends.iter().map(|&e| e as usize).collect(),
                    heights,
                    values,
                    rays: rays[i],
                    count: counts[i],
                    squares: squares[i],
                })
                .collect(),
        ))
    }
}
