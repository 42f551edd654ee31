//! The tree of senders: clusters of the finest points, and clusters of clusters (SPEC 6.11).

use crate::asset::Senders;
use crate::codec::bytes::Cursor;
use crate::codec::recency;
use crate::error::Result;

pub fn encode(senders: &Senders, out: &mut Vec<u8>) {
    out.extend_from_slice(&(senders.leaf_of_point.len() as u32).to_le_bytes());
    out.extend_from_slice(&(senders.counts.len() as u32).to_le_bytes());
    for count in &senders.counts {
        out.extend_from_slice(&count.to_le_bytes());
    }
    recency::encode(&senders.leaf_of_point, out);
    out.extend_from_slice(&senders.importance);
    senders
        .parents
        .iter()
        .for_each(|parents| recency::encode(parents, out));
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Senders> {
    let points = cursor.u32()? as usize;
    let levels = cursor.u32()? as usize;
    let mut counts = cursor.vec(levels, 4)?;
    for _ in 0..levels {
        counts.push(cursor.u32()?);
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
