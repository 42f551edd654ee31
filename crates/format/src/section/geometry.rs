//! Meshes and instances (SPEC 6.2). Positions, texture coordinates and colours keep their bits; normals and
//! tangents become octahedral; indices become distances below the highest index seen so far.

use bincode::{Decode, Encode};

use crate::asset::{Geometry, Mesh};
use crate::codec::bytes::{Cursor, Planes, put_planes, put_varint, unzigzag, zigzag};
use crate::codec::octahedral;
use crate::codec::record::{self, Zeros};
use crate::error::Result;
use crate::layout::MAX_UV_SETS;

/// Bits of each component of an octahedral vertex normal or tangent.
const NORMAL_BITS: u32 = 16;

const FLAG_NORMALS: u8 = 1;
const FLAG_COLORS: u8 = 2;
const FLAG_TANGENTS: u8 = 4;

/// How exact floats are stored. SPEC 6.2.1.
const FLOATS_PLAIN: u8 = 0;
const FLOATS_DELTA_PLANES: u8 = 1;

/// zstd level of the trial that chooses between the two: it ranks them as level 9 does, at a tenth of the time.
const TRIAL_LEVEL: i32 = 1;

/// A mesh's fixed fields.
#[derive(Encode, Decode)]
struct MeshHead {
    vertices: u32,
    triangles: u32,
    material: u32,
    flags: u8,
    uv_sets: u8,
    zeros: Zeros<2>,
}

/// Bytes of a mesh's fixed fields.
const MESH_BYTES: usize = 16;
/// Bytes of an instance.
const INSTANCE_BYTES: usize = 52;

pub fn encode(geometry: &Geometry, out: &mut Vec<u8>) {
    record::put(geometry.meshes.len() as u32, out);
    for mesh in &geometry.meshes {
        let flag = |present: bool, flag: u8| if present { flag } else { 0 };
        let flags = flag(mesh.normals.is_some(), FLAG_NORMALS)
            | flag(mesh.colors.is_some(), FLAG_COLORS)
            | flag(mesh.tangents.is_some(), FLAG_TANGENTS);
        let head = MeshHead {
            vertices: mesh.positions.len() as u32,
            triangles: mesh.triangles.len() as u32,
            material: mesh.material,
            flags,
            uv_sets: mesh.uvs.len() as u8,
            zeros: Zeros,
        };
        record::put(head, out);
        put_floats(&mesh.positions, out);
        if let Some(normals) = &mesh.normals {
            put_normals(normals.iter().copied(), out);
        }
        for uvs in &mesh.uvs {
            put_floats(uvs, out);
        }
        if let Some(colors) = &mesh.colors {
            put_floats(colors, out);
        }
        if let Some(tangents) = &mesh.tangents {
            put_normals(tangents.iter().map(|t| [t[0], t[1], t[2]]), out);
            out.extend(tangents.iter().map(|t| u8::from(t[3] < 0.0)));
        }
        put_triangles(&mesh.triangles, out);
    }
    record::put(geometry.instances.len() as u32, out);
    for instance in &geometry.instances {
        record::put(instance, out);
    }
}

pub fn decode(cursor: &mut Cursor<'_>) -> Result<Geometry> {
    let mesh_count = record::fixed::<u32>(cursor)? as usize;
    let mut meshes = cursor.vec(mesh_count, MESH_BYTES)?;
    for _ in 0..mesh_count {
        let head: MeshHead = record::fixed(cursor)?;
        let (vertices, triangle_count) = (head.vertices as usize, head.triangles as usize);
        let (flags, uv_sets) = (head.flags, usize::from(head.uv_sets));
        if flags > FLAG_NORMALS | FLAG_COLORS | FLAG_TANGENTS {
            return Err(cursor.invalid("mesh flags of 0 to 7", flags));
        }
        if uv_sets > MAX_UV_SETS {
            return Err(cursor.invalid(format_args!("at most {MAX_UV_SETS} sets of coordinates"), uv_sets));
        }
        let positions = floats(cursor, vertices)?;
        let normals = if flags & FLAG_NORMALS != 0 {
            Some(decode_normals(cursor, vertices)?)
        } else {
            None
        };
        let mut uvs = cursor.vec(uv_sets, 0)?;
        for _ in 0..uv_sets {
            uvs.push(floats(cursor, vertices)?);
        }
        let colors = if flags & FLAG_COLORS != 0 {
            Some(floats(cursor, vertices)?)
        } else {
            None
        };
        let tangents = if flags & FLAG_TANGENTS != 0 {
            Some(decode_tangents(cursor, vertices)?)
        } else {
            None
        };
        let triangles = decode_triangles(cursor, triangle_count, vertices)?;
        meshes.push(Mesh {
            positions,
            normals,
            uvs,
            colors,
            tangents,
            triangles,
            material: head.material,
        });
    }
    let instance_count = record::fixed::<u32>(cursor)? as usize;
    let mut instances = cursor.vec(instance_count, INSTANCE_BYTES)?;
    for _ in 0..instance_count {
        instances.push(record::fixed(cursor)?);
    }
    Ok(Geometry { meshes, instances })
}

/// Exact floats, as they are or as byte planes of the differences of neighbouring bit patterns (SPEC 6.2.1). Models
/// with many equal vertices (architecture) are shorter as they are, since zstd finds the repeats; scans are shorter as
/// planes. A quick trial decides.
fn put_floats<const N: usize>(values: &[[f32; N]], out: &mut Vec<u8>) {
    let plain: Vec<u8> = values.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    let mut planes = Vec::with_capacity(plain.len());
    for component in 0..N {
        let mut previous = 0u32;
        let delta = |value: &[f32; N]| {
            let bits = value[component].to_bits();
            zigzag(bits.wrapping_sub(std::mem::replace(&mut previous, bits)))
        };
        put_planes(&mut planes, 4, &values.iter().map(delta).collect::<Vec<_>>());
    }
    // Without memory for a trial the plain floats are as right.
    let trial =
        |bytes: &[u8]| zstd::bulk::compress(bytes, TRIAL_LEVEL).map_or(usize::MAX, |stored| stored.len());
    let (mode, bytes) = if trial(&planes) < trial(&plain) {
        (FLOATS_DELTA_PLANES, planes)
    } else {
        (FLOATS_PLAIN, plain)
    };
    out.push(mode);
    out.extend_from_slice(&bytes);
}

fn floats<const N: usize>(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<[f32; N]>> {
    let mode = cursor.u8()?;
    let mut values = cursor.vec(count, 4 * N)?;
    values.resize(count, [0.0; N]);
    match mode {
        FLOATS_PLAIN => {
            for value in &mut values {
                *value = record::fixed(cursor)?;
            }
        }
        FLOATS_DELTA_PLANES => {
            for component in 0..N {
                let mut previous = 0u32;
                for (value, code) in values.iter_mut().zip(Planes::take(cursor, 4, count)?.values()) {
                    previous = previous.wrapping_add(unzigzag(code));
                    value[component] = f32::from_bits(previous);
                }
            }
        }
        _ => return Err(cursor.invalid("a float mode of 0 or 1", mode)),
    }
    Ok(values)
}

fn put_normals(normals: impl Iterator<Item = [f32; 3]>, out: &mut Vec<u8>) {
    // Codes are stored as u + M, 0 to 2M.
    let offset = octahedral::max_code(NORMAL_BITS);
    let codes: Vec<[u32; 2]> = normals
        .map(|n| octahedral::encode(n, NORMAL_BITS).map(|c| (c + offset) as u32))
        .collect();
    for component in 0..2 {
        put_planes(
            out,
            2,
            &codes.iter().map(|code| code[component]).collect::<Vec<_>>(),
        );
    }
}

fn decode_normals(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<[f32; 3]>> {
    let mut normals = cursor.vec(count, 4)?;
    let u = Planes::take(cursor, 2, count)?.values();
    let v = Planes::take(cursor, 2, count)?.values();
    let offset = octahedral::max_code(NORMAL_BITS);
    normals.extend(
        u.zip(v)
            .map(|(u, v)| octahedral::decode([u as i32 - offset, v as i32 - offset], NORMAL_BITS)),
    );
    Ok(normals)
}

fn decode_tangents(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<[f32; 4]>> {
    let directions = decode_normals(cursor, count)?;
    let mut tangents = cursor.vec(count, 1)?;
    let signs = cursor.take(count)?;
    if let Some(sign) = signs.iter().find(|&&sign| sign > 1) {
        return Err(cursor.invalid("a tangent sign of 0 or 1", sign));
    }
    let handed = |([x, y, z], sign): ([f32; 3], &u8)| [x, y, z, if *sign == 0 { 1.0 } else { -1.0 }];
    tangents.extend(directions.into_iter().zip(signs).map(handed));
    Ok(tangents)
}

/// Indices as zigzag varints of the distance below the next unseen index: vertices that appear in order cost a
/// zero each, and reused ones are near (SPEC 6.2.3).
fn put_triangles(triangles: &[[u32; 3]], out: &mut Vec<u8>) {
    let mut next = 0u32;
    for &index in triangles.iter().flatten() {
        put_varint(out, zigzag(next.wrapping_sub(index)));
        next = next.max(index.wrapping_add(1));
    }
}

fn decode_triangles(cursor: &mut Cursor<'_>, count: usize, vertices: usize) -> Result<Vec<[u32; 3]>> {
    let mut triangles = cursor.vec(count, 3)?;
    let mut next = 0u32;
    for _ in 0..count {
        let mut triangle = [0; 3];
        for corner in &mut triangle {
            let index = next.wrapping_sub(unzigzag(cursor.varint()?));
            if index as usize >= vertices {
                return Err(cursor.invalid(format_args!("a vertex index below {vertices}"), index));
            }
            next = next.max(index + 1);
            *corner = index;
        }
        triangles.push(triangle);
    }
    Ok(triangles)
}
