//! Measures what cuts take: bytes per element of several layouts, and the time to encode and to decode the one in use.
//!
//! `cargo run --release -p relight-format --example measure_cuts [-- asset.relight]`
//!
//! Without an asset the cuts are synthetic: a courtyard of boxes (walls, galleries, columns, furniture) with a tree's
//! crown of balls in it, 2,048 sites on its floor and walls in Morton order, a tenth of a metre apart; 32,768 lights,
//! directions or surface samples, in the order of a tree of median splits; visibility by casting rays; cuts by
//! |C|·var > σ² with σ = 2. Every number is derived from a hash or a lattice, so that every run measures the same bytes.

use std::time::Instant;

use relight_format::codec::bytes::{put_planes, put_varint, zigzag};
use relight_format::codec::cut;
use relight_format::*;

const LIGHTS: usize = 1 << 15;
const HEIGHT: u32 = 15;
const SIGMA: f32 = 2.0;

type V3 = [f32; 3];

fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: V3, b: V3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A counter-based random number of 0 to 1 (splitmix64 finaliser).
fn uniform(stream: u64, index: u64) -> f32 {
    let mut x = stream
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(index.wrapping_mul(0xd134_2543_de82_ef95));
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

/// An axis-aligned box: its corners.
type Block = [V3; 2];

/// A courtyard of 12 × 6 × 8 m under the open sky: four walls, two galleries, ten columns, eight pieces of furniture.
fn courtyard() -> Vec<Block> {
    let mut blocks = vec![
        [[-0.5, -0.5, -0.5], [12.5, 0.0, 8.5]],
        [[-0.5, 0.0, -0.5], [0.0, 6.0, 8.5]],
        [[12.0, 0.0, -0.5], [12.5, 6.0, 8.5]],
        [[0.0, 0.0, -0.5], [12.0, 6.0, 0.0]],
        [[0.0, 0.0, 8.0], [12.0, 4.0, 8.5]],
        [[0.0, 3.0, 0.0], [12.0, 3.3, 1.8]],
        [[0.0, 3.0, 6.2], [12.0, 3.3, 8.0]],
    ];
    for i in 0..10 {
        let (x, z) = (1.2 + 2.4 * (i % 5) as f32, if i < 5 { 1.6 } else { 6.1 });
        blocks.push([[x - 0.2, 0.0, z - 0.2], [x + 0.2, 3.0, z + 0.2]]);
    }
    for i in 0..8 {
        let [x, z, w, h] = [0, 1, 2, 3].map(|k| uniform(1, 4 * i + k));
        let corner = [1.0 + 10.0 * x, 0.0, 2.0 + 4.0 * z];
        blocks.push([
            corner,
            [corner[0] + 0.2 + w, 0.3 + 0.8 * h, corner[2] + 0.2 + 0.5 * w],
        ]);
    }
    blocks
}

/// A crown of balls: centres and radii; the first holds all others.
fn crown() -> Vec<(V3, f32)> {
    let mut balls = vec![([6.0, 3.6, 4.0], 1.4)];
    for i in 0..150 {
        let offset = [0, 1, 2].map(|k| 2.0 * uniform(3, 3 * i + k) - 1.0);
        let inside = dot(offset, offset).max(1.0).sqrt();
        let centre = [0, 1, 2].map(|k| balls[0].0[k] + 1.25 * offset[k] / inside);
        balls.push((centre, 0.05 + 0.1 * uniform(4, i)));
    }
    balls
}

struct Scene {
    blocks: Vec<Block>,
    balls: Vec<(V3, f32)>,
}

/// Whether a ray meets a ball before `end` directions.
fn meets((centre, radius): &(V3, f32), origin: V3, direction: V3, end: f32) -> bool {
    let to = sub(*centre, origin);
    let squared = dot(direction, direction);
    let t = dot(to, direction) / squared;
    t > 0.0 && t < end && dot(to, to) - t * t * squared < radius * radius
}

/// Whether something stands in the way from `origin` along `direction`, closer than `end` directions.
fn blocked(scene: &Scene, origin: V3, direction: V3, end: f32) -> bool {
    let inverse = direction.map(|d| 1.0 / d);
    let hit = |ball: &(V3, f32)| meets(ball, origin, direction, end);
    let crown = hit(&scene.balls[0]) && scene.balls[1..].iter().any(hit);
    crown
        || scene.blocks.iter().any(|[low, high]| {
            let (mut near, mut far) = (1e-3f32, end);
            for k in 0..3 {
                let (a, b) = (
                    (low[k] - origin[k]) * inverse[k],
                    (high[k] - origin[k]) * inverse[k],
                );
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            near < far
        })
}

/// Points of the lattice of SPEC 6.12.1.
fn lattice(i: usize) -> V3 {
    let y = 1.0 - (2 * i + 1) as f64 / LIGHTS as f64;
    let turns = i as f64 * ((5f64.sqrt() - 1.0) / 2.0);
    let phi = std::f64::consts::TAU * turns.fract();
    let s = (1.0 - y * y).sqrt();
    [s * phi.cos(), y, s * phi.sin()].map(|c| c as f32)
}

/// A point and its normal on one of the boxes, by area.
fn surface_point(blocks: &[Block], stream: u64, i: u64) -> (V3, V3) {
    let side = |block: &Block, axis: usize| {
        let d = sub(block[1], block[0]);
        d[(axis + 1) % 3] * d[(axis + 2) % 3]
    };
    let total: f32 = blocks
        .iter()
        .map(|b| (0..3).map(|a| 2.0 * side(b, a)).sum::<f32>())
        .sum();
    let mut left = uniform(stream, 4 * i) * total;
    for block in blocks {
        for face in 0..6 {
            let axis = face / 2;
            if left < side(block, axis) {
                let mut p = [0.0; 3];
                let mut n = [0.0; 3];
                for k in 1..3 {
                    let c = (axis + k) % 3;
                    p[c] = block[0][c] + uniform(stream, 4 * i + k as u64) * (block[1][c] - block[0][c]);
                }
                p[axis] = block[face % 2][axis];
                n[axis] = if face % 2 == 0 { -1.0 } else { 1.0 };
                return (p, n);
            }
            left -= side(block, axis);
        }
    }
    ([0.0; 3], [0.0, 1.0, 0.0])
}

/// Orders items as the leaves of a tree of median splits along the longest axis of their keys.
fn split(order: &mut [u32], keys: &[V3]) {
    if order.len() < 2 {
        return;
    }
    let extent = |k: usize| {
        let values = || order.iter().map(|&i| keys[i as usize][k]);
        values().fold(f32::MIN, f32::max) - values().fold(f32::MAX, f32::min)
    };
    let axis = (0..3)
        .max_by(|&a, &b| extent(a).total_cmp(&extent(b)))
        .unwrap_or(0);
    order.sort_by(|&a, &b| {
        keys[a as usize][axis]
            .total_cmp(&keys[b as usize][axis])
            .then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(order.len() / 2);
    split(left, keys);
    split(right, keys);
}

/// 2,048 sites: eight patches of 16 × 16 in Morton order, on floor, gallery and walls.
fn sites() -> Vec<(V3, V3)> {
    let patches: [(V3, usize); 8] = [
        ([5.0, 0.0, 3.0], 1),
        ([2.0, 0.0, 0.3], 1),
        ([8.0, 0.0, 5.5], 1),
        ([4.0, 3.3, 0.1], 1),
        ([0.0, 1.0, 3.0], 0),
        ([0.0, 4.2, 3.0], 0),
        ([5.0, 1.0, 0.0], 2),
        ([9.0, 4.0, 0.0], 2),
    ];
    let unmix = |i: u64, shift: u64| (0..4).map(|b| (i >> (2 * b + shift) & 1) << b).sum::<u64>();
    let site = |(patch, &(corner, axis)): (usize, &(V3, usize)), i: u64| {
        let mut p = corner;
        let mut n = [0.0; 3];
        for k in 0..2 {
            let jitter = uniform(50 + patch as u64, 2 * i + k);
            p[(axis + 1 + k as usize) % 3] += 0.1 * (unmix(i, k) as f32 + 0.8 * jitter);
        }
        n[axis] = 1.0;
        (p, n)
    };
    let all = patches.iter().enumerate();
    all.flat_map(|patch| (0..256).map(move |i| site(patch, i)))
        .collect()
}

/// The cut of one site's values over the leaves.
fn select(values: &[f32], cuts: &mut Cuts) {
    // Sums and sums of squares of every node, leaves first.
    let mut levels = vec![
        values
            .iter()
            .map(|&v| [f64::from(v), f64::from(v).powi(2)])
            .collect::<Vec<_>>(),
    ];
    for h in 0..HEIGHT as usize {
        let merged = levels[h]
            .chunks(2)
            .map(|p| [p[0][0] + p[1][0], p[0][1] + p[1][1]])
            .collect();
        levels.push(merged);
    }
    let mut stack = vec![(HEIGHT as usize, 0usize)];
    while let Some((h, j)) = stack.pop() {
        let [sum, squares] = levels[h][j];
        let count = (1u32 << h) as f64;
        let deviation = squares - sum * sum / count;
        if h > 0 && deviation > f64::from(SIGMA * SIGMA) {
            stack.push((h - 1, 2 * j + 1));
            stack.push((h - 1, 2 * j));
        } else {
            cuts.heights.push(h as u8);
            cuts.values.push((sum / count) as f32);
        }
    }
    cuts.row_offsets.push(cuts.heights.len() as u32);
}

fn no_cuts(unit: f32) -> Cuts {
    Cuts {
        sigma: SIGMA,
        unit,
        row_offsets: vec![0],
        ..Cuts::default()
    }
}

fn environment(scene: &Scene) -> (LightTree, Cuts) {
    let directions: Vec<V3> = (0..LIGHTS).map(lattice).collect();
    let mut order: Vec<u32> = (0..LIGHTS as u32).collect();
    split(&mut order, &directions);
    let mut cuts = no_cuts(1.0);
    for (p, n) in sites() {
        let sees = |&i: &u32| {
            let d = directions[i as usize];
            f32::from(dot(d, n) > 0.0 && !blocked(scene, p, d, f32::MAX))
        };
        select(&order.iter().map(sees).collect::<Vec<_>>(), &mut cuts);
    }
    let lights = LightSamples::Environment { order };
    (LightTree { lights }, cuts)
}

/// Samples of 500 m² and what they mean to the sites: A·cosθ/(d² + A/π) in units of its mean.
fn surface(scene: &Scene) -> (LightTree, Cuts) {
    let lights: Vec<_> = (0..LIGHTS as u64)
        .map(|i| surface_point(&scene.blocks, 2, i))
        .collect();
    // Positions over the scene's size, and normals: equation 10 in spirit.
    let key = |(p, n): &(V3, V3)| [0, 1, 2].map(|k| p[k] / 12.0 + 0.3 * n[k]);
    let mut order: Vec<u32> = (0..LIGHTS as u32).collect();
    split(&mut order, &lights.iter().map(key).collect::<Vec<_>>());
    let lights: Vec<_> = order.iter().map(|&i| lights[i as usize]).collect();
    let area = 500.0 / LIGHTS as f32;
    let factor = |(p, n): &(V3, V3), (q, m): &(V3, V3)| {
        let d = sub(*q, *p);
        let squared = dot(d, d);
        if dot(d, *n) <= 0.0 || dot(d, *m) >= 0.0 || blocked(scene, *p, d, 0.999) {
            return 0.0;
        }
        area * -dot(d, *m) / squared.sqrt() / (squared + area / std::f32::consts::PI)
    };
    let row = |site: &(V3, V3)| lights.iter().map(|light| factor(site, light)).collect();
    let rows: Vec<Vec<f32>> = sites().iter().map(row).collect();
    let sum: f64 = rows.iter().flatten().map(|&f| f64::from(f)).sum();
    let mean = (sum / (rows.len() * LIGHTS) as f64) as f32;
    let mut cuts = no_cuts(mean);
    for row in rows {
        select(&row.iter().map(|f| f / mean).collect::<Vec<_>>(), &mut cuts);
    }
    let (positions, normals) = lights.into_iter().unzip();
    let lights = LightSamples::Surface {
        area,
        positions,
        normals,
    };
    (LightTree { lights }, cuts)
}

/// An element as the layouts see it.
#[derive(Clone, Copy)]
struct Element {
    start: u32,
    height: u8,
    /// Height of the largest node that could start here, less the height.
    descent: u8,
    code: u32,
    steps: u32,
}

impl Element {
    /// 0, full or something else.
    fn class(&self) -> u8 {
        match self.code {
            0 => 0,
            code if code == self.steps => 1,
            _ => 2,
        }
    }

    /// 0, full, codes up to 9, or something else.
    fn fine_class(&self) -> u8 {
        match self.class() {
            2 => (self.code + 1).min(11) as u8,
            class => class,
        }
    }
}

fn elements(cuts: &Cuts, tree_height: u32) -> Vec<Vec<Element>> {
    let row = |pair: &[u32]| {
        let mut start = 0u32;
        let element = |i: usize| {
            let (at, height) = (start, cuts.heights[i]);
            start += 1 << height;
            let steps = cut::steps(height, cuts.sigma);
            Element {
                start: at,
                height,
                descent: at.trailing_zeros().min(tree_height) as u8 - height,
                code: cut::encode(cuts.values[i], steps),
                steps,
            }
        };
        (pair[0] as usize..pair[1] as usize).map(element).collect()
    };
    cuts.row_offsets.windows(2).map(row).collect()
}

/// The element of the row before that holds the leaf where each element starts.
fn before(rows: &[Vec<Element>]) -> Vec<Option<Element>> {
    let mut out = Vec::new();
    for (r, row) in rows.iter().enumerate() {
        let above = if r > 0 { &rows[r - 1][..] } else { &[] };
        let mut at = 0;
        for element in row {
            while above.get(at + 1).is_some_and(|next| next.start <= element.start) {
                at += 1;
            }
            out.push(above.get(at).copied());
        }
    }
    out
}

/// Bytes per element of layouts, raw and after zstd.
fn compare(cuts: &Cuts, tree_height: u32) {
    let rows = elements(cuts, tree_height);
    let all: Vec<Element> = rows.concat();
    let above = before(&rows);
    let plane = |symbol: &dyn Fn(&Element) -> u8| all.iter().map(symbol).collect::<Vec<u8>>();
    let codes = |of: &dyn Fn(&Element) -> bool| {
        let mut bytes = Vec::new();
        all.iter()
            .filter(|e| of(e))
            .for_each(|e| put_varint(&mut bytes, e.code));
        bytes
    };
    let other = |e: &Element| e.class() == 2;
    let same = |e: &Element, b: &Option<Element>| {
        b.is_some_and(|b| (b.start, b.height, b.class()) == (e.start, e.height, e.class()))
    };
    let unless_same = |(e, b): (&Element, &Option<Element>)| match same(e, b) {
        true => 0,
        false => 1 + e.descent + 21 * e.class(),
    };
    let mut by_context: [Vec<u8>; 6] = Default::default();
    for (e, b) in all.iter().zip(&above) {
        let context = b.map_or(0, |b| {
            usize::from(b.class()) + 3 * usize::from(b.start == e.start)
        });
        by_context[context].push(e.descent + 21 * e.class());
    }
    let layouts = [
        (
            "heights | codes",
            [plane(&|e| e.height), codes(&|_| true)].concat(),
        ),
        (
            "descents | codes",
            [plane(&|e| e.descent), codes(&|_| true)].concat(),
        ),
        (
            "descents | 0, full, other | others",
            [plane(&|e| e.descent), plane(&|e| e.class()), codes(&other)].concat(),
        ),
        (
            "height × (0, full, other) | others",
            [plane(&|e| e.height + 21 * e.class()), codes(&other)].concat(),
        ),
        (
            "descent × (0, full, other) | others",
            [plane(&|e| e.descent + 21 * e.class()), codes(&other)].concat(),
        ),
        (
            "  in 6 planes by the row above",
            [by_context.concat(), codes(&other)].concat(),
        ),
        (
            "  or one symbol for what the row above has",
            [all.iter().zip(&above).map(unless_same).collect(), codes(&other)].concat(),
        ),
        (
            "descent × (0 to 10, other) | others",
            [
                plane(&|e| e.descent + 21 * e.code.min(11) as u8),
                codes(&|e| e.code > 10),
            ]
            .concat(),
        ),
        (
            "height × (0, full, 1 to 9, other) | others",
            [
                plane(&|e| e.height + 21 * e.fine_class()),
                codes(&|e| e.fine_class() == 11),
            ]
            .concat(),
        ),
        (
            "descent × (0, full, 1 to 9, other) | others",
            [
                plane(&|e| e.descent + 21 * e.fine_class()),
                codes(&|e| e.fine_class() == 11),
            ]
            .concat(),
        ),
    ];
    for (name, bytes) in layouts {
        let stored = zstd_bytes(&bytes) as f64 / all.len() as f64;
        println!(
            "{name:<48} raw {:.2}  stored {stored:.3}",
            bytes.len() as f64 / all.len() as f64
        );
    }
    // What a coder that knows nothing of neighbours could reach at best.
    let mut counts = std::collections::BTreeMap::<_, f64>::new();
    all.iter()
        .for_each(|e| *counts.entry((e.descent, e.code)).or_default() += 1.0);
    let bits: f64 = counts.values().map(|n| -n * (n / all.len() as f64).log2()).sum();
    println!(
        "{:<58} {:.3}",
        "entropy of descent and code",
        bits / 8.0 / all.len() as f64
    );
    let same = all.iter().zip(&above).filter(|(e, b)| same(e, b)).count();
    println!(
        "{:<58} {:.3}",
        "elements that the row above has",
        same as f64 / all.len() as f64
    );
}

fn zstd_bytes(bytes: &[u8]) -> usize {
    zstd::bulk::compress(bytes, layout::ZSTD_LEVEL).map_or(0, |stored| stored.len())
}

fn compare_orders(order: &[u32]) {
    let mut previous = 0;
    let delta = |&index: &u32| zigzag(index.wrapping_sub(std::mem::replace(&mut previous, index)));
    let deltas: Vec<u32> = order.iter().map(delta).collect();
    let [mut plain, mut planes, mut varints] = [const { Vec::new() }; 3];
    put_planes(&mut plain, 2, order);
    put_planes(&mut planes, 3, &deltas);
    deltas.iter().for_each(|&delta| put_varint(&mut varints, delta));
    let names = [
        "indices in planes",
        "differences in planes",
        "differences as varints",
    ];
    for (name, bytes) in names.into_iter().zip([plain, planes, varints]) {
        println!(
            "order: {name:<51} {:.3}",
            zstd_bytes(&bytes) as f64 / order.len() as f64
        );
    }
}

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

fn report(asset: &Asset) -> Result<()> {
    let (Some(tree), Some(cuts)) = (&asset.light_tree, &asset.cuts) else {
        println!("no cuts");
        return Ok(());
    };
    let (sites, count) = (cuts.row_offsets.len() - 1, cuts.heights.len());
    println!(
        "{sites} sites, {count} elements, {:.0} at each",
        count as f64 / sites as f64
    );
    compare(cuts, tree.lights.len().ilog2());
    if let LightSamples::Environment { order } = &tree.lights {
        compare_orders(order);
    }
    // All but tree, cuts and their sites left out, for the times.
    let alone = Asset {
        geometry: asset.geometry.clone(),
        materials: asset.materials.clone(),
        textures: asset.textures.clone(),
        points: asset.points.clone(),
        light_tree: asset.light_tree.clone(),
        ..Asset::default()
    };
    let with = Asset {
        cuts: asset.cuts.clone(),
        ..alone.clone()
    };
    let [without, bytes] = [write_asset(&alone)?, write_asset(&with)?];
    for section in summarise(&bytes)?.sections {
        println!(
            "{:<16} raw {:>10}  stored {:>10} bytes",
            section.name, section.raw_bytes, section.stored_bytes
        );
    }
    let encode = median_ms(|| drop(write_asset(&with))) - median_ms(|| drop(write_asset(&alone)));
    let read = |bytes: &[u8]| median_ms(|| drop(read_asset(bytes, &Limits::default())));
    let decode = read(&bytes) - read(&without);
    let per_second = |ms: f64| count as f64 / ms / 1e3;
    println!(
        "cuts alone: encode {encode:.0} ms, {:.0} million elements a second",
        per_second(encode)
    );
    println!(
        "            decode and validate {decode:.0} ms, {:.0} million elements a second\n",
        per_second(decode)
    );
    Ok(())
}

/// One level of points at the sites.
fn site_points() -> Vec<Level> {
    let (positions, normals): (Vec<V3>, Vec<V3>) = sites().into_iter().unzip();
    vec![Level {
        disk_radius: 0.1,
        support_radius: 0.2,
        albedo: vec![[0.5; 3]; positions.len()],
        positions,
        normals,
    }]
}

fn main() -> Result<()> {
    if let Some(path) = std::env::args_os().nth(1) {
        return report(&read_file(path, &Limits::default())?);
    }
    let scene = Scene {
        blocks: courtyard(),
        balls: crown(),
    };
    for (name, (tree, cuts)) in [("environment", environment(&scene)), ("surface", surface(&scene))] {
        println!("{name}");
        report(&Asset {
            points: site_points(),
            light_tree: Some(tree),
            cuts: Some(cuts),
            ..Asset::default()
        })?;
    }
    Ok(())
}
