//! The tree of senders: clusters of the finest points, and clusters of clusters (SPEC 6.11).

use crate::asset::Senders;
use crate::codec::bytes::Cursor;
use crate::codec::{recency, record};
use crate::error::Result;

pub fn encode(senders: &Senders, out: &mut Vec<u8>) {
    let (points, levels) = (senders.leaf_of_point.len(), senders.counts.len());
    record::put((points as u32, levels as u32), out);
    senders.counts.iter().for_each(|count| record::put(count, out));
    recency::encode(&senders.leaf_of_point, out);
    out.extend_from_slice(&senders.importance);
    senders
        .parents
        .iter()
        .for_each(|parents| recency::encode(parents, out));
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Senders> {
    let (points, levels): (u32, u32) = record::fixed(cursor)?;
    let (points, levels) = (points as usize, levels as usize);
    let mut counts = cursor.vec(levels, 4)?;
    for _ in 0..levels {
        counts.push(record::fixed::<u32>(cursor)?);
    }
    let Some(&leaves) = counts.last() else {
        return Err(cursor.invalid("at least 1 sender level", 0));
    };
    let leaf_of_point = recency::decode(cursor, points, leaves)?;
    let importance = cursor.take(points)?.to_vec();
    let mut parents = cursor.vec(levels - 1, 0)?;
    for pair in counts.windows(2) {
        parents.push(recency::decode(cursor, pair[1] as usize, pair[0])?);
    }
    Ok(Senders {
        counts,
        leaf_of_point,
        importance,
        parents,
    })
}
