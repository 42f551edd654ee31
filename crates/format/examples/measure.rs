//! Measures what an asset of the size of the plain Sponza takes: bytes per link and per point, time to encode and to
//! decode, and what other codecs would have taken for the same link vectors.
//!
//! `cargo run --release -p relight-format --example measure`
//!
//! The data is synthetic but shaped like a bake's: 190 k points on the walls and columns of a hall, six levels in
//! Morton order, a million links whose columns come in clusters that neighbouring receivers share (35 in the rows of
//! the sender levels, about five in the others, many rows empty), vectors of a form factor towards the sender with
//! noise. Every number is derived from a hash, so that every run measures the same bytes.

use std::time::Instant;

use relight_format::codec::bytes::{put_varint, zigzag};
use relight_format::codec::octahedral;
use relight_format::*;

/// A counter-based random number of 0 to 1 (splitmix64 finaliser).
fn uniform(stream: u64, index: u64) -> f32 {
    let mut x = stream
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(index.wrapping_mul(0xd134_2543_de82_ef95));
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

const HALL: [f32; 3] = [30.0, 12.0, 14.0];

/// A point with its normal on the hall's six sides or on one of 24 columns.
fn surface_point(stream: u64, i: u64) -> ([f32; 3], [f32; 3]) {
    let [a, u, v] = [0, 1, 2].map(|k| uniform(stream, 3 * i + k));
    if a < 0.35 {
        // Columns of radius 0.4 m in two rows.
        let column = (a / 0.35 * 24.0) as u32;
        let angle = u * std::f32::consts::TAU;
        let centre = [
            1.5 + 2.4 * (column % 12) as f32,
            if column < 12 { 4.0 } else { 10.0 },
        ];
        let n = [angle.cos(), 0.0, angle.sin()];
        return ([centre[0] + 0.4 * n[0], v * HALL[1], centre[1] + 0.4 * n[2]], n);
    }
    let side = ((a - 0.35) / 0.65 * 6.0) as usize;
    let axis = (side / 2).min(2);
    let mut p = [0.0; 3];
    let mut n = [0.0; 3];
    p[(axis + 1) % 3] = u * HALL[(axis + 1) % 3];
    p[(axis + 2) % 3] = v * HALL[(axis + 2) % 3];
    p[axis] = if side.is_multiple_of(2) { 0.0 } else { HALL[axis] };
    n[axis] = if side.is_multiple_of(2) { 1.0 } else { -1.0 };
    (p, n)
}

fn morton(p: [f32; 3]) -> u64 {
    let spread = |c: f32| {
        (0..16).fold(0u64, |m, bit| {
            m | (((c / 32.0 * 65535.0) as u64 >> bit) & 1) << (3 * bit)
        })
    };
    spread(p[0]) | spread(p[1]) << 1 | spread(p[2]) << 2
}

/// `sorted` in Morton order, as a bake has them, or in random order.
fn level(index: u64, count: usize, sorted: bool) -> Level {
    let mut points: Vec<_> = (0..count as u64).map(|i| surface_point(index, i)).collect();
    if sorted {
        points.sort_by_key(|(p, _)| morton(*p));
    }
    // Poisson disks cover the hall's 2,300 m² about 0.7 times.
    let disk_radius = (2300.0 * 0.7 / (count as f32 * std::f32::consts::PI)).sqrt();
    // Textured: a smooth tint and noise per point.
    let albedo = points.iter().enumerate().map(|(i, (p, _))| {
        [0, 1, 2]
            .map(|c| 0.4 + 0.2 * (p[c] * 0.7).sin() + 0.15 * uniform(77 + index, 3 * i as u64 + c as u64))
    });
    Level {
        disk_radius,
        support_radius: 2.0 * disk_radius,
        albedo: albedo.collect(),
        positions: points.iter().map(|(p, _)| *p).collect(),
        normals: points.iter().map(|(_, n)| *n).collect(),
    }
}

/// Links of `receivers` points (all levels) to the first `senders` of them.
fn links(levels: &[Level], senders: usize) -> Links {
    let positions: Vec<[f32; 3]> = levels.iter().flat_map(|l| l.positions.iter().copied()).collect();
    let receivers = positions.len();
    let sender_offsets: Vec<usize> = levels
        .iter()
        .scan(0, |end, l| Some(std::mem::replace(end, *end + l.positions.len())))
        .collect();
    let mut row_offsets = vec![0u32];
    let mut columns: Vec<u32> = Vec::new();
    let mut vectors = Vec::new();
    for receiver in 0..receivers {
        let r = receiver as u64;
        let is_sender = receiver < senders;
        let wanted = match (is_sender, uniform(5, r)) {
            (true, t) => 20 + (30.0 * t) as usize,
            (false, t) if t < 0.4 => 0,
            (false, t) => 1 + (-6.5 * (1.0 - (t - 0.4) / 0.6 + 1e-6).ln()) as usize,
        };
        // Neighbouring receivers (16 in Morton order) share the centres of their clusters.
        let mut row = std::collections::BTreeSet::new();
        let mut cluster = 0;
        while row.len() < wanted && cluster < 60 {
            let key = r / 16 * 64 + cluster;
            let sender_level = ((uniform(6, key) * 3.0) as usize).min(2);
            let size = levels[sender_level].positions.len();
            let centre = (uniform(7, key) * size as f32) as usize;
            for k in 0..5 {
                if row.len() < wanted && uniform(8, r * 311 + cluster * 5 + k) < 0.7 {
                    row.insert((sender_offsets[sender_level] + (centre + k as usize).min(size - 1)) as u32);
                }
            }
            cluster += 1;
        }
        for &column in &row {
            let [from, to] = [positions[receiver], positions[column as usize]];
            let d = [0, 1, 2].map(|k| to[k] - from[k]);
            let distance = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt().max(0.3);
            let magnitude = (0.8 / distance).min(1.5) * (0.2 + uniform(9, columns.len() as u64));
            let noise = |k: u64| 0.3 * (uniform(10, 3 * columns.len() as u64 + k) - 0.5);
            vectors.push([0, 1, 2].map(|k| magnitude * (d[k as usize] / distance + noise(k))));
            columns.push(column);
        }
        row_offsets.push(columns.len() as u32);
    }
    Links {
        receivers: receivers as u32,
        senders: senders as u32,
        row_offsets,
        columns,
        vectors,
    }
}

fn bounce(rows: u32) -> BounceLinks {
    let mut links = WeightRows {
        rows,
        row_offsets: vec![0],
        ..WeightRows::default()
    };
    for row in 0..rows {
        let mut weights = Vec::new();
        for column in 0..rows {
            let near = uniform(20, u64::from(row / 8 * rows + column) / 6);
            if near < 0.05 {
                links.columns.push(column);
                weights.push(uniform(21, u64::from(row * rows + column)).powi(2) + 0.01);
            }
        }
        let total: f32 = weights.iter().sum();
        links.weights.extend(weights.iter().map(|w| w / total * 0.9));
        links.row_sums.push(if weights.is_empty() { 0.0 } else { 0.9 });
        links.row_offsets.push(links.columns.len() as u32);
    }
    BounceLinks {
        level: 2,
        matrix: links,
    }
}

/// Clusters of the finest points around the points of the coarsest `sending` levels: nearest by distance, with a
/// noise of a fifth of the spacing for what visibility adds.
fn senders(levels: &[Level], sending: usize) -> Senders {
    let nearest = |level: &Level, seeds: &Level, stream: u64| -> Vec<u32> {
        let positions = level.positions.iter().enumerate();
        positions
            .map(|(i, p)| {
                let noise = 0.2 * seeds.disk_radius;
                let p = [0, 1, 2].map(|k| p[k] + noise * (uniform(stream, 3 * i as u64 + k as u64) - 0.5));
                let squared = |s: &[f32; 3]| (0..3).map(|k| (s[k] - p[k]).powi(2)).sum::<f32>();
                let all = (0u32..).zip(&seeds.positions);
                all.min_by(|a, b| squared(a.1).total_cmp(&squared(b.1)))
                    .map_or(0, |s| s.0)
            })
            .collect()
    };
    Senders {
        counts: levels[..sending]
            .iter()
            .map(|l| l.positions.len() as u32)
            .collect(),
        importance: (0..levels[levels.len() - 1].positions.len())
            .map(|p| (p / 40 % 65) as u8)
            .collect(),
        leaf_of_point: nearest(&levels[levels.len() - 1], &levels[sending - 1], 40),
        parents: (1..sending)
            .map(|l| nearest(&levels[l], &levels[l - 1], 41))
            .collect(),
    }
}

/// The same assignments by other codecs.
fn compare_cluster_codecs(clusters: &[u32]) {
    let mut previous = 0;
    let deltas: Vec<u32> = clusters
        .iter()
        .map(|&c| zigzag(c.wrapping_sub(std::mem::replace(&mut previous, c))))
        .collect();
    let mut varints = Vec::new();
    deltas.iter().for_each(|&d| put_varint(&mut varints, d));
    // One byte per point, and those that do not fit apart.
    let mut escaped: Vec<u8> = deltas.iter().map(|&d| d.min(255) as u8).collect();
    deltas
        .iter()
        .filter(|&&d| d >= 255)
        .for_each(|&d| put_varint(&mut escaped, d - 255));
    let mut recency = Vec::new();
    codec::recency::encode(clusters, &mut recency);
    for (name, bytes) in [
        ("numbers in two planes", planes(2, clusters)),
        ("differences in two planes", planes(2, &deltas)),
        ("differences as varints", varints),
        ("differences as bytes, large ones apart", escaped),
        ("recency (in use)", recency),
    ] {
        let size = zstd::bulk::compress(&bytes, 9).map_or(0, |stored| stored.len());
        println!(
            "clusters: {name:<40} {:.3} bytes per point",
            size as f64 / clusters.len() as f64
        );
    }
}

/// 66 k triangles: 40 curved patches with normals and texture coordinates, as an arcade has them.
fn geometry() -> Geometry {
    let (columns, rows) = (33u32, 26u32);
    let mesh = |m: u32| {
        let vertex = |i: u32| ((i % columns) as f32 / 32.0, (i / columns) as f32 / 25.0);
        let vertices = columns * rows;
        let radius = 0.3 + uniform(30, u64::from(m));
        let turn = |i: u32| vertex(i).0 * std::f32::consts::PI;
        Mesh {
            positions: (0..vertices)
                .map(|i| {
                    [
                        m as f32 * 0.7 + radius * turn(i).cos(),
                        vertex(i).1 * 4.0,
                        radius * turn(i).sin(),
                    ]
                })
                .collect(),
            normals: Some(
                (0..vertices)
                    .map(|i| [turn(i).cos(), 0.0, turn(i).sin()])
                    .collect(),
            ),
            uvs: vec![
                (0..vertices)
                    .map(|i| [vertex(i).0 * 3.0, vertex(i).1 * 5.0])
                    .collect(),
            ],
            triangles: (0..(columns - 1) * (rows - 1))
                .flat_map(|q| {
                    let a = q / (columns - 1) * columns + q % (columns - 1);
                    [[a, a + 1, a + columns], [a + 1, a + columns + 1, a + columns]]
                })
                .collect(),
            ..Mesh::default()
        }
    };
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    Geometry {
        meshes: (0..41).map(mesh).collect(),
        instances: (0..41)
            .map(|mesh| Instance {
                mesh,
                world_from_mesh: identity,
            })
            .collect(),
    }
}

fn median_ms(mut run: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..5)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[2]
}

fn planes(width: usize, values: &[u32]) -> Vec<u8> {
    (0..width)
        .flat_map(|k| values.iter().map(move |v| (v >> (8 * k)) as u8))
        .collect()
}

/// f32 to half with rounding, for numbers in half's normal range; smaller ones become zero.
fn half_bits(value: f32) -> u32 {
    let bits = value.to_bits() + 0xfff + ((value.to_bits() >> 13) & 1);
    let exponent = (bits >> 23 & 0xff) as i32 - 112;
    if exponent <= 0 {
        bits >> 16 & 0x8000
    } else {
        bits >> 16 & 0x8000 | (exponent as u32) << 10 | bits >> 13 & 0x3ff
    }
}

fn compare_vector_codecs(vectors: &[[f32; 3]]) {
    let report = |name: &str, level: i32, bytes: &[u8]| {
        let start = Instant::now();
        let size = zstd::bulk::compress(bytes, level).map_or(0, |stored| stored.len());
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!(
            "{name:<56} zstd {level:>2}: {:.2} bytes, {ms:.0} ms",
            size as f64 / vectors.len() as f64
        );
    };
    let components =
        |k: usize, code: &dyn Fn(f32) -> u32| vectors.iter().map(|v| code(v[k])).collect::<Vec<_>>();
    let floats: Vec<u8> = vectors.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    report("3 × f32 as they are", 3, &floats);
    let halves: Vec<u8> = (0..3)
        .flat_map(|k| planes(2, &components(k, &half_bits)))
        .collect();
    report("3 × f16, byte planes", 9, &halves);
    // Magnitude as a float of 9 bits of mantissa (relative 2⁻¹⁰) and a direction of 2 × 12 bits: about the same error.
    let norm = |v: &[f32; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let magnitudes: Vec<u32> = vectors
        .iter()
        .map(|v| (norm(v).to_bits() + (1 << 13)) >> 14)
        .collect();
    let least = magnitudes.iter().copied().min().unwrap_or(0);
    let directions: Vec<[u32; 2]> = vectors
        .iter()
        .map(|v| octahedral::encode(*v, 12).map(|c| (c + 2047) as u32))
        .collect();
    let mut polar = planes(2, &magnitudes.iter().map(|m| m - least).collect::<Vec<_>>());
    polar.extend(directions.iter().map(|[u, _]| (u >> 4) as u8));
    polar.extend(directions.iter().map(|[_, v]| (v >> 4) as u8));
    polar.extend(directions.iter().map(|[u, v]| (u & 15 | (v & 15) << 4) as u8));
    report("magnitude 9-bit float, octahedral 2 × 12", 9, &polar);
    // The codec in use, with other arrangements of its planes.
    let codes: Vec<_> = vectors
        .iter()
        .map(|&v| codec::vector::encode(v, codec::vector::Mantissa::Long))
        .collect();
    let high = |c: &codec::vector::Code, k: usize| (c.mantissas[k] >> 8) as u8 | u8::from(c.negative[k]) << 2;
    let lows = (0..3).flat_map(|k| codes.iter().map(move |c| c.mantissas[k] as u8));
    let mut apart: Vec<u8> = codes.iter().map(|c| c.exponent).collect();
    (0..3).for_each(|k| apart.extend(codes.iter().map(|c| high(c, k))));
    apart.extend(lows.clone());
    report("shared exponent, high bits in three planes", 9, &apart);
    let mut joint: Vec<u8> = codes.iter().map(|c| c.exponent).collect();
    joint.extend(codes.iter().map(|c| high(c, 0) | high(c, 1) << 3));
    joint.extend(codes.iter().map(|c| high(c, 2)));
    joint.extend(lows.clone());
    report("shared exponent, x and y in one plane", 9, &joint);
    let mut signs: Vec<u8> = codes.iter().map(|c| c.exponent).collect();
    signs.extend(
        codes
            .iter()
            .map(|c| (0..3).fold(0, |s, k| s | high(c, k) >> 2 << k)),
    );
    signs.extend(
        codes
            .iter()
            .map(|c| (0..3).fold(0, |s, k| s | (high(c, k) & 3) << (2 * k))),
    );
    signs.extend(lows);
    for level in [1, 3, 9, 15] {
        report(
            "shared exponent, signs and high bits together (in use)",
            level,
            &signs,
        );
    }
}

fn main() -> Result<()> {
    // Of a real asset, the assignments alone.
    if let Some(path) = std::env::args().nth(1) {
        let asset = read_file(path, &Limits::default())?;
        compare_cluster_codecs(&asset.senders.unwrap_or_default().leaf_of_point);
        return Ok(());
    }
    let counts = [139, 556, 2225, 8900, 35600, 142400];
    let points: Vec<Level> = counts.iter().zip(0..).map(|(&n, i)| level(i, n, true)).collect();
    let unsorted: Vec<Level> = counts.iter().zip(0..).map(|(&n, i)| level(i, n, false)).collect();
    let transfer = links(&points, 139 + 556 + 2225);
    let asset = Asset {
        geometry: geometry(),
        materials: vec![Material::default()],
        bounce: Some(bounce(2225)),
        senders: Some(senders(&points, 3)),
        transfer: Some(transfer),
        points,
        ..Asset::default()
    };
    let bytes = write_asset(&asset)?;
    let count = |name: &str| match name {
        "points" => (asset.points.iter().map(|l| l.positions.len()).sum(), "point"),
        "links_transfer" => (asset.transfer.as_ref().map_or(0, |l| l.columns.len()), "link"),
        "links_bounce" => (
            asset.bounce.as_ref().map_or(0, |l| l.matrix.columns.len()),
            "link",
        ),
        "senders" => (
            asset.senders.as_ref().map_or(0, |s| s.leaf_of_point.len()),
            "finest point",
        ),
        "geometry" => (
            asset.geometry.meshes.iter().map(|m| m.triangles.len()).sum(),
            "triangle",
        ),
        _ => (1, "section"),
    };
    let per_section = |asset: &Asset, bytes: &[u8]| -> Result<()> {
        for section in summarise(bytes)?.sections {
            let (n, unit) = count(&section.name);
            let per = |bytes: u64| bytes as f64 / n as f64;
            let (raw, stored) = (per(section.raw_bytes), per(section.stored_bytes));
            println!(
                "{:<16} {n:>8} {unit}s  raw {raw:6.2}  stored {stored:6.2} bytes per {unit}",
                section.name
            );
        }
        let encode = median_ms(|| drop(write_asset(asset)));
        let decode = median_ms(|| drop(read_asset(bytes, &Limits::default())));
        println!(
            "{} bytes, encode {encode:.0} ms, decode {decode:.0} ms\n",
            bytes.len()
        );
        Ok(())
    };
    per_section(&asset, &bytes)?;
    for part in ["geometry", "points", "transfer", "bounce"] {
        let mut alone = Asset {
            points: asset.points.clone(),
            senders: asset.senders.clone(),
            ..Asset::default()
        };
        match part {
            "geometry" => {
                alone = Asset {
                    geometry: asset.geometry.clone(),
                    materials: asset.materials.clone(),
                    ..Asset::default()
                }
            }
            "transfer" => alone.transfer = asset.transfer.clone(),
            "bounce" => alone.bounce = asset.bounce.clone(),
            _ => {}
        }
        println!("{part} (links: with points and senders)");
        per_section(&alone, &write_asset(&alone)?)?;
    }
    println!("points in random order:");
    let random = Asset {
        points: unsorted,
        ..Asset::default()
    };
    per_section(&random, &write_asset(&random)?)?;
    if let Some(transfer) = &asset.transfer {
        let rows = transfer.row_offsets.windows(2).filter(|p| p[0] < p[1]).count();
        println!(
            "{} links in {rows} of {} rows",
            transfer.columns.len(),
            transfer.receivers
        );
        println!(
            "quantised_links: {:.1} ms",
            median_ms(|| drop(quantised_links(transfer)))
        );
        let level = &asset.points[5];
        println!(
            "quantised_level ({} points): {:.1} ms\n",
            level.positions.len(),
            median_ms(|| drop(quantised_level(level)))
        );
        compare_vector_codecs(&transfer.vectors);
    }
    if let Some(senders) = &asset.senders {
        compare_cluster_codecs(&senders.leaf_of_point);
    }
    Ok(())
}
