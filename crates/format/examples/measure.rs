//! Measures what an asset takes: bytes per link, point and element of a cut, time to encode and to decode, and what other
//! codecs would take for the same links, clusters and cuts.
//!
//! `cargo run --release -p relight-format --example measure -- ASSET.relight`

// Reason: it measures.
#![allow(clippy::disallowed_methods)]

use std::time::Instant;

use relight_format::codec::bytes::{put_planes, put_varint, zigzag};
use relight_format::codec::vector::{self, Code, Mantissa};
use relight_format::codec::{cut, octahedral, recency};
use relight_format::*;

/// The median of five runs, ms.
fn median_ms(mut run: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e3
    };
    let mut times: Vec<f64> = (0..5).map(time).collect();
    times.sort_by(f64::total_cmp);
    times[2]
}

/// A line of what `bytes` take for each of `count` things, raw and packed by zstd.
fn report(what: &str, bytes: &[u8], count: usize) {
    let stored = zstd::bulk::compress(bytes, layout::ZSTD_LEVEL).map_or(0, |stored| stored.len());
    let per = |bytes: usize| bytes as f64 / count as f64;
    println!(
        "  {what:<52} raw {:6.3}  stored {:6.3}",
        per(bytes.len()),
        per(stored)
    );
}

fn planes(width: usize, values: &[u32]) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_planes(&mut bytes, width, values);
    bytes
}

fn varints(values: impl IntoIterator<Item = u32>) -> Vec<u8> {
    let mut bytes = Vec::new();
    values.into_iter().for_each(|value| put_varint(&mut bytes, value));
    bytes
}

/// Differences from the number before, as zigzag codes.
fn deltas(values: &[u32]) -> Vec<u32> {
    let mut previous = 0;
    let delta = |&value: &u32| zigzag(value.wrapping_sub(std::mem::replace(&mut previous, value)));
    values.iter().map(delta).collect()
}

fn of_sections(asset: &Asset) -> Result<Vec<u8>> {
    let bytes = write_asset(asset)?;
    let content = Content::of(asset);
    for section in summarise(&bytes)?.sections {
        let (count, unit) = match section.name.as_str() {
            "points" => (content.points.iter().sum(), "point"),
            "links_transfer" => (content.links_transfer, "link"),
            "links_bounce" => (content.links_bounce, "link"),
            "links_solution" => (content.links_solution, "link"),
            "senders" => (content.points.last().copied().unwrap_or(0), "finest point"),
            "geometry" => (content.triangles, "triangle"),
            "light_tree" => (content.cuts.map_or(0, |cuts| cuts.lights), "light"),
            "cuts" => (content.cuts.map_or(0, |cuts| cuts.elements), "element"),
            _ => (1, "section"),
        };
        let per = |bytes: u64| bytes as f64 / count as f64;
        let (raw, stored) = (per(section.raw_bytes), per(section.stored_bytes));
        println!(
            "{:<16} {count:>9} {unit}s  raw {raw:8.3}  stored {stored:8.3} bytes per {unit}",
            section.name
        );
    }
    Ok(bytes)
}

/// f32 to half with rounding, for numbers in half's normal range; smaller ones become zero.
fn half_bits(value: f32) -> u32 {
    let bits = value.to_bits() + 0xfff + ((value.to_bits() >> 13) & 1);
    let exponent = (bits >> 23 & 0xff) as i32 - 112;
    let magnitude = (exponent.max(0) as u32) << 10 | bits >> 13 & 0x3ff;
    bits >> 16 & 0x8000 | if exponent > 0 { magnitude } else { 0 }
}

/// Vectors of links: the codec in use beside others of about the same error.
fn of_vectors(vectors: &[[f32; 3]]) {
    println!("vectors of {} links", vectors.len());
    let report = |what: &str, parts: &[Vec<u8>]| report(what, &parts.concat(), vectors.len());
    let floats = vectors.iter().flatten().flat_map(|c| c.to_le_bytes());
    report("3 × f32 as they are", &[floats.collect()]);
    let half = |k: usize| planes(2, &vectors.iter().map(|v| half_bits(v[k])).collect::<Vec<_>>());
    report("3 × f16, byte planes", &[half(0), half(1), half(2)]);
    // 9 bits of mantissa (relative 2⁻¹⁰) and a direction of 2 × 12 bits.
    let norm = |v: &[f32; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let magnitudes = vectors.iter().map(|v| (norm(v).to_bits() + (1 << 13)) >> 14);
    let least = magnitudes.clone().min().unwrap_or(0);
    let magnitudes: Vec<u32> = magnitudes.map(|m| m - least).collect();
    let direction = |v: &[f32; 3]| octahedral::encode(*v, 12).map(|c| (c + 2047) as u32);
    let directions: Vec<[u32; 2]> = vectors.iter().map(direction).collect();
    let plane = |of: &dyn Fn(&[u32; 2]) -> u32| directions.iter().map(|d| of(d) as u8).collect();
    report(
        "magnitude 9-bit float, octahedral 2 × 12",
        &[
            planes(2, &magnitudes),
            plane(&|d| d[0] >> 4),
            plane(&|d| d[1] >> 4),
            plane(&|d| d[0] & 15 | (d[1] & 15) << 4),
        ],
    );
    let codes: Vec<Code> = vectors
        .iter()
        .map(|&v| vector::encode(v, Mantissa::Long))
        .collect();
    let plane = |of: &dyn Fn(&Code) -> u32| codes.iter().map(|code| of(code) as u8).collect::<Vec<u8>>();
    let high = |c: &Code, k: usize| u32::from(c.mantissas[k] >> 8) | u32::from(c.negative[k]) << 2;
    let exponents = plane(&|c| c.exponent.into());
    let lows = [0, 1, 2].map(|k| plane(&|c| c.mantissas[k].into())).concat();
    report(
        "shared exponent, high bits in three planes",
        &[
            exponents.clone(),
            [0, 1, 2].map(|k| plane(&|c| high(c, k))).concat(),
            lows.clone(),
        ],
    );
    report(
        "shared exponent, signs and high bits together (in use)",
        &[
            exponents,
            plane(&|c| (0..3).fold(0, |bits, k| bits | high(c, k) >> 2 << k)),
            plane(&|c| (0..3).fold(0, |bits, k| bits | (high(c, k) & 3) << (2 * k))),
            lows,
        ],
    );
}

/// Clusters of the finest points.
fn of_clusters(clusters: &[u32]) {
    println!("clusters of {} points", clusters.len());
    let report = |what: &str, bytes: &[u8]| report(what, bytes, clusters.len());
    let deltas = deltas(clusters);
    report("numbers in planes", &planes(3, clusters));
    report("differences in planes", &planes(3, &deltas));
    report("differences as varints", &varints(deltas.iter().copied()));
    // One byte per point, and those that do not fit apart.
    let mut escaped: Vec<u8> = deltas.iter().map(|&d| d.min(255) as u8).collect();
    escaped.extend(varints(deltas.iter().filter(|&&d| d >= 255).map(|&d| d - 255)));
    report("differences as bytes, large ones apart", &escaped);
    let mut bytes = Vec::new();
    recency::encode(clusters, &mut bytes);
    report("recency (in use)", &bytes);
}

/// An element of a cut as layouts see it.
struct Element {
    height: u8,
    /// Height of the largest node that could start here, less the height.
    descent: u8,
    code: u32,
    /// 0 nothing, 1 everything, 2 to 10 other codes up to 9, 11 others.
    class: u8,
}

fn elements(cuts: &Cuts, tree_height: u32) -> Vec<Element> {
    let mut start = 0u32;
    let element = |(&height, &value): (&u8, &f32)| {
        let largest = start.trailing_zeros().min(tree_height) as u8;
        start = (start + (1 << height)) & ((1 << tree_height) - 1);
        let steps = cut::steps(height, cuts.sigma);
        let code = cut::encode(value, steps);
        let class = match code {
            0 => 0,
            code if code == steps => 1,
            code => (code + 1).min(11) as u8,
        };
        Element {
            height,
            descent: largest - height,
            code,
            class,
        }
    };
    cuts.heights.iter().zip(&cuts.values).map(element).collect()
}

fn of_cuts(cuts: &Cuts, tree: &LightTree) {
    let all = elements(cuts, tree.lights.len().ilog2());
    println!("{} elements of cuts", all.len());
    let report = |what: &str, node: &dyn Fn(&Element) -> u8, coded: &dyn Fn(&Element) -> bool| {
        let mut bytes: Vec<u8> = all.iter().map(node).collect();
        bytes.extend(varints(all.iter().filter(|e| coded(e)).map(|e| e.code)));
        report(what, &bytes, all.len());
    };
    let few = |e: &Element| e.class.min(2);
    report("heights | codes", &|e| e.height, &|_| true);
    report("descents | codes", &|e| e.descent, &|_| true);
    report(
        "descent × (0, all, other) | others",
        &|e| e.descent + 21 * few(e),
        &|e| e.class > 1,
    );
    report(
        "height × (0, all, 1 to 9, other) | others",
        &|e| e.height + 21 * e.class,
        &|e| e.class == 11,
    );
    report(
        "descent × (0, all, 1 to 9, other) | others (in use)",
        &|e| e.descent + 21 * e.class,
        &|e| e.class == 11,
    );
}

fn of_order(order: &[u32]) {
    println!("order of {} directions", order.len());
    let deltas = deltas(order);
    report("indices in planes", &planes(3, order), order.len());
    report("differences in planes", &planes(3, &deltas), order.len());
    report("differences as varints (in use)", &varints(deltas), order.len());
}

fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: measure ASSET.relight")?;
    let asset = read_file(&path, &Limits::default())?;
    let bytes = of_sections(&asset)?;
    let encode = median_ms(|| drop(write_asset(&asset)));
    let decode = median_ms(|| drop(read_asset(&bytes, &Limits::default())));
    println!(
        "{} bytes, encode {encode:.0} ms, decode {decode:.0} ms",
        bytes.len()
    );
    if let Some(links) = &asset.transfer {
        of_vectors(&links.vectors);
    }
    if let Some(senders) = &asset.senders {
        of_clusters(&senders.leaf_of_point);
    }
    if let (Some(cuts), Some(tree)) = (&asset.cuts, &asset.light_tree) {
        of_cuts(cuts, tree);
        if let LightSamples::Environment { order } = &tree.lights {
            of_order(order);
        }
    }
    Ok(())
}
