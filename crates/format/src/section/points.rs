//! Points of the levels: grid positions, octahedral normals, albedo (SPEC 6.6).

use crate::asset::Level;
use crate::codec::bytes::{Cursor, Planes, put_planes, unzigzag, width_of, zigzag};
use crate::codec::grid::Grid;
use crate::codec::{albedo, octahedral, record};
use crate::error::Result;

/// Bits of each component of a point's octahedral normal.
const NORMAL_BITS: u32 = 12;

/// Layout since which one channel of albedo may stand for all three.
const GREY: u16 = 2;
/// Layout since which points may be wider than their level.
const WIDENED: u16 = 3;

/// How positions are stored. SPEC 6.6.
const MODE_EXACT: u8 = 0;
const MODE_GRID: u8 = 1;
const MODE_GRID_DELTA: u8 = 2;

/// Fewest raw bytes of a level: radii, number of points, mode of positions.
const MIN_LEVEL_BYTES: usize = 13;
/// Fewest raw bytes of a position and a normal: 3 each.
const MIN_PLACE_BYTES: usize = 6;

/// Layout in which levels are written: the lowest that holds them. `grey`: one channel of albedo stands for all three.
pub fn version(levels: &[Level], grey: bool) -> u16 {
    if levels.iter().any(|level| !level.widenings.is_empty()) {
        WIDENED
    } else if grey {
        GREY
    } else {
        1
    }
}

/// `grey`: one channel of albedo stands for all three.
pub fn encode(levels: &[Level], grey: bool, out: &mut Vec<u8>) {
    let widened = version(levels, grey) == WIDENED;
    if widened {
        out.push(channels(grey) as u8);
    }
    record::put(levels.len() as u32, out);
    for level in levels {
        let points = level.positions.len() as u32;
        record::put((level.disk_radius, level.support_radius, points), out);
        encode_positions(level.disk_radius, &level.positions, out);
        encode_normals(&level.normals, out);
        encode_albedo(&level.albedo, channels(grey), out);
        if widened {
            let none = level.widenings.is_empty();
            out.push(u8::from(!none));
            out.extend_from_slice(&level.widenings);
        }
    }
}

/// Inverse of [`encode`]: the levels, and whether they are grey.
pub fn decode(cursor: &mut Cursor<'_>, version: u16) -> Result<(Vec<Level>, bool)> {
    let widened = version == WIDENED;
    let grey = match widened {
        false => version == GREY,
        true => match cursor.u8()? {
            1 => true,
            3 => false,
            other => return Err(cursor.invalid("1 or 3 channels of albedo", other)),
        },
    };
    let count = record::fixed::<u32>(cursor)? as usize;
    let mut levels = cursor.vec(count, MIN_LEVEL_BYTES)?;
    for _ in 0..count {
        let (disk_radius, support_radius, points): (f32, f32, u32) = record::fixed(cursor)?;
        let points = points as usize;
        let positions = decode_positions(cursor, points)?;
        let normals = decode_normals(cursor, points)?;
        let albedo = decode_albedo(cursor, channels(grey), points)?;
        let is_widened = widened
            && match cursor.u8()? {
                0 => false,
                1 => true,
                other => return Err(cursor.invalid("0 or 1: whether points are widened", other)),
            };
        let widenings = cursor.take(if is_widened { points } else { 0 })?.to_vec();
        levels.push(Level {
            disk_radius,
            support_radius,
            positions,
            normals,
            albedo,
            widenings,
        });
    }
    Ok((levels, grey))
}

/// Differences from the point before, as zigzag codes; the first from 0.
fn deltas(values: &[u32]) -> Vec<u32> {
    let mut previous = 0;
    let delta = |&value: &u32| zigzag(value.wrapping_sub(std::mem::replace(&mut previous, value)));
    values.iter().map(delta).collect()
}

/// Bits that an ideal coder of magnitudes would take, about: enough to choose between two codings.
fn cost(codes: &[u32]) -> u64 {
    codes
        .iter()
        .map(|code| u64::from(32 - code.leading_zeros()))
        .sum()
}

/// Positions to a 256th of `radius` (SPEC 6.6.1).
pub(super) fn encode_positions(radius: f32, positions: &[[f32; 3]], out: &mut Vec<u8>) {
    let Some(grid) = Grid::of(radius, positions) else {
        out.push(MODE_EXACT);
        for axis in 0..3 {
            let bits: Vec<u32> = positions.iter().map(|p| p[axis].to_bits()).collect();
            put_planes(out, 4, &bits);
        }
        return;
    };
    let mut axes = [Vec::new(), Vec::new(), Vec::new()];
    for &position in positions {
        for (axis, code) in axes.iter_mut().zip(grid.encode(position)) {
            axis.push(code);
        }
    }
    let delta_axes = axes.each_ref().map(|axis| deltas(axis));
    let total = |axes: &[Vec<u32>; 3]| axes.iter().map(|axis| cost(axis)).sum::<u64>();
    let (mode, axes) = if total(&delta_axes) < total(&axes) {
        (MODE_GRID_DELTA, delta_axes)
    } else {
        (MODE_GRID, axes)
    };
    out.push(mode);
    record::put(grid, out);
    for axis in &axes {
        let width = width_of(axis.iter().copied().max().unwrap_or(0));
        out.push(width as u8);
        put_planes(out, width, axis);
    }
}

/// Positions that normals follow.
pub(super) fn decode_positions(cursor: &mut Cursor<'_>, points: usize) -> Result<Vec<[f32; 3]>> {
    let mode = cursor.u8()?;
    let mut positions = cursor.vec(points, MIN_PLACE_BYTES)?;
    positions.resize(points, [0.0; 3]);
    if mode == MODE_EXACT {
        for axis in 0..3 {
            for (position, bits) in positions
                .iter_mut()
                .zip(Planes::take(cursor, 4, points)?.values())
            {
                position[axis] = f32::from_bits(bits);
            }
        }
        return Ok(positions);
    }
    if mode > MODE_GRID_DELTA {
        return Err(cursor.invalid("a position mode of 0 to 2", mode));
    }
    let grid: Grid = record::fixed(cursor)?;
    // Of no points nothing would show it later.
    if !(grid.origin.iter().all(|c| c.is_finite()) && grid.step.is_finite()) {
        return Err(cursor.invalid("a finite grid", format_args!("{grid:?}")));
    }
    for axis in 0..3 {
        let width = cursor.plane_width()?;
        let mut previous = 0u32;
        for (position, code) in positions
            .iter_mut()
            .zip(Planes::take(cursor, width, points)?.values())
        {
            previous = if mode == MODE_GRID {
                code
            } else {
                previous.wrapping_add(unzigzag(code))
            };
            position[axis] = grid.decode_axis(axis, previous);
        }
    }
    Ok(positions)
}

/// Octahedral normals of 2 × 12 bits (SPEC 6.6.2).
pub(super) fn encode_normals(normals: &[[f32; 3]], out: &mut Vec<u8>) {
    // Codes are stored as u + M, 0 to 2M.
    let offset = octahedral::max_code(NORMAL_BITS);
    let codes: Vec<[u32; 2]> = normals
        .iter()
        .map(|&n| octahedral::encode(n, NORMAL_BITS).map(|c| (c + offset) as u32))
        .collect();
    out.extend(codes.iter().map(|[u, _]| (u >> 4) as u8));
    out.extend(codes.iter().map(|[_, v]| (v >> 4) as u8));
    out.extend(codes.iter().map(|[u, v]| (u & 15) as u8 | ((v & 15) << 4) as u8));
}

/// Inverse of [`encode_normals`].
pub(super) fn decode_normals(cursor: &mut Cursor<'_>, points: usize) -> Result<Vec<[f32; 3]>> {
    let mut normals = cursor.vec(points, 3)?;
    let [high_u, high_v, low] = [cursor.take(points)?, cursor.take(points)?, cursor.take(points)?];
    let offset = octahedral::max_code(NORMAL_BITS);
    normals.extend((0..points).map(|i| {
        let u = i32::from(high_u[i]) << 4 | i32::from(low[i] & 15);
        let v = i32::from(high_v[i]) << 4 | i32::from(low[i] >> 4);
        octahedral::decode([u - offset, v - offset], NORMAL_BITS)
    }));
    Ok(normals)
}

/// Stored channels of albedo.
fn channels(grey: bool) -> usize {
    if grey { 1 } else { 3 }
}

fn encode_albedo(albedos: &[[f32; 3]], channels: usize, out: &mut Vec<u8>) {
    for channel in 0..channels {
        let codes: Vec<u32> = albedos.iter().map(|rgb| albedo::encode(rgb[channel])).collect();
        out.extend(codes.iter().map(|code| (code >> 4) as u8));
        let nibble = |code: Option<&u32>| code.map_or(0, |code| (code & 15) as u8);
        out.extend(
            codes
                .chunks(2)
                .map(|pair| nibble(pair.first()) | nibble(pair.get(1)) << 4),
        );
    }
}

fn decode_albedo(cursor: &mut Cursor<'_>, channels: usize, points: usize) -> Result<Vec<[f32; 3]>> {
    // At least twelve bits each.
    let mut albedos = cursor.vec(points, 1)?;
    albedos.resize(points, [0.0; 3]);
    for channel in 0..channels {
        let high = cursor.take(points)?;
        let low = cursor.take(points.div_ceil(2))?;
        for (i, rgb) in albedos.iter_mut().enumerate() {
            let nibble = low[i / 2] >> (4 * (i % 2)) & 15;
            let value = albedo::decode(u32::from(high[i]) << 4 | u32::from(nibble));
            // The first stands for all until another comes.
            rgb[channel..].fill(value);
        }
    }
    Ok(albedos)
}

/// The positions that a reader will see.
pub(super) fn quantised_positions(radius: f32, positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    match Grid::of(radius, positions) {
        Some(grid) => positions.iter().map(|&p| grid.decode(grid.encode(p))).collect(),
        None => positions.to_vec(),
    }
}

/// The normals that a reader will see.
pub(super) fn quantised_normals(normals: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let normal = |&n: &[f32; 3]| octahedral::decode(octahedral::encode(n, NORMAL_BITS), NORMAL_BITS);
    normals.iter().map(normal).collect()
}

/// The level that a reader of the file will see in place of `level`; bounds in [`codec`](crate::codec).
pub fn quantised_level(level: &Level) -> Level {
    Level {
        positions: quantised_positions(level.disk_radius, &level.positions),
        normals: quantised_normals(&level.normals),
        albedo: level
            .albedo
            .iter()
            .map(|rgb| rgb.map(|c| albedo::decode(albedo::encode(c))))
            .collect(),
        widenings: level.widenings.clone(),
        ..*level
    }
}
