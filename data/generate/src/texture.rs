//! Procedural textures: tiling value noise, and the stones, weaves and normal maps made of it, encoded as PNG.
//!
//! Patterns are functions of (u, v) in [0, 1)², v pointing down, that repeat at the borders. Tones are kept to a few
//! dozen levels: it is what the eye needs of a rough stone and it halves the PNG files.

use glam::{DVec3, dvec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// A number in [0, 1) for a lattice point: the finaliser of MurmurHash3 (Appleby) over the mixed coordinates.
pub fn hash01(x: i64, y: i64, seed: u32) -> f64 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ seed.wrapping_mul(0xc2b2_ae3d);
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^= h >> 16;
    f64::from(h) / 4_294_967_296.0
}

/// Value noise in [0, 1] with `period` cells per unit, smoothly interpolated, repeating.
pub fn noise(u: f64, v: f64, period: i64, seed: u32) -> f64 {
    let (x, y) = (u * period as f64, v * period as f64);
    let (i, j) = (x.floor(), y.floor());
    let fade = |t: f64| t * t * (3.0 - 2.0 * t);
    let (s, t) = (fade(x - i), fade(y - j));
    let at = |di: i64, dj: i64| {
        hash01(
            (i as i64 + di).rem_euclid(period),
            (j as i64 + dj).rem_euclid(period),
            seed,
        )
    };
    let top = at(0, 0) * (1.0 - s) + at(1, 0) * s;
    let bottom = at(0, 1) * (1.0 - s) + at(1, 1) * s;
    top * (1.0 - t) + bottom * t
}

/// Fractal sum of `octaves` of noise, halved in amplitude per octave; mean 0.5, within [0, 1].
pub fn fbm(u: f64, v: f64, period: i64, octaves: u32, seed: u32) -> f64 {
    let mut sum = 0.0;
    let mut weight = 0.0;
    for o in 0..octaves {
        let amplitude = 0.5f64.powi(o as i32);
        sum += amplitude * noise(u, v, period << o, seed + o);
        weight += amplitude;
    }
    sum / weight
}

/// 0 below `a`, 1 above `b`, smooth in between.
pub fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Linear blend of colours.
pub fn mix(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    a + (b - a) * t
}

fn encode(width: u32, height: u32, bytes: &[u8], kind: ExtendedColorType) -> Vec<u8> {
    let mut png = vec![];
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive);
    encoder
        .write_image(bytes, width, height, kind)
        .expect("a PNG written to memory cannot fail");
    png
}

fn sample<const N: usize>(width: u32, height: u32, f: impl Fn(f64, f64) -> [f64; N]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity((width * height) as usize * N);
    for y in 0..height {
        for x in 0..width {
            let texel = f(
                (f64::from(x) + 0.5) / f64::from(width),
                (f64::from(y) + 0.5) / f64::from(height),
            );
            bytes.extend(texel.map(|t| (t.clamp(0.0, 1.0) * 255.0).round() as u8));
        }
    }
    bytes
}

/// A grey PNG of the stored (sRGB-encoded) tones, in steps of four levels.
pub fn grey(width: u32, height: u32, tone: impl Fn(f64, f64) -> f64) -> Vec<u8> {
    let bytes = sample(width, height, |u, v| [(tone(u, v) * 63.75).round() / 63.75]);
    encode(width, height, &bytes, ExtendedColorType::L8)
}

/// A colour PNG of stored values, in steps of four levels.
pub fn color(width: u32, height: u32, rgb: impl Fn(f64, f64) -> DVec3) -> Vec<u8> {
    let bytes = sample(width, height, |u, v| {
        rgb(u, v).to_array().map(|c| (c * 63.75).round() / 63.75)
    });
    encode(width, height, &bytes, ExtendedColorType::Rgb8)
}

/// A colour PNG with alpha.
pub fn color_alpha(width: u32, height: u32, rgba: impl Fn(f64, f64) -> [f64; 4]) -> Vec<u8> {
    encode(
        width,
        height,
        &sample(width, height, rgba),
        ExtendedColorType::Rgba8,
    )
}

/// A normal map of a height field given in units of the texture's width: slopes by central differences over one texel.
pub fn normal_map(size: u32, height: impl Fn(f64, f64) -> f64) -> Vec<u8> {
    let e = 0.5 / f64::from(size);
    let bytes = sample(size, size, |u, v| {
        let du = (height(u + e, v) - height(u - e, v)) / (2.0 * e);
        let dv = (height(u, v + e) - height(u, v - e)) / (2.0 * e);
        // +Y of tangent space is up in the image, v runs down.
        (dvec3(-du, dv, 1.0).normalize() * 0.5 + 0.5).to_array()
    });
    encode(size, size, &bytes, ExtendedColorType::Rgb8)
}

/// A limestone: clouds, grain and a few pits; a light tone to be tinted by the base colour factor.
pub fn stone(size: u32) -> Vec<u8> {
    grey(size, size, |u, v| {
        let clouds = fbm(u, v, 4, 5, 1) - 0.5;
        let grain = noise(u, v, 128, 9) - 0.5;
        let pits = smoothstep(0.72, 0.9, noise(u, v, 48, 23)) * smoothstep(0.45, 0.6, fbm(u, v, 6, 2, 31));
        0.86 + 0.30 * clouds + 0.06 * grain - 0.16 * pits
    })
}

/// Marble: veins where a warped fractal crosses its middle.
pub fn marble_tone(u: f64, v: f64, seed: u32) -> f64 {
    let warp = fbm(u, v, 3, 4, seed) - 0.5;
    let field = fbm(u + 0.35 * warp, v + 0.25 * warp, 3, 5, seed + 11) - 0.5;
    let vein = 1.0 - smoothstep(0.0, 0.035, field.abs());
    let faint = 1.0 - smoothstep(0.0, 0.02, (fbm(u - 0.2 * warp, v, 5, 4, seed + 29) - 0.5).abs());
    0.93 + 0.10 * warp - 0.16 * vein - 0.07 * faint
}

/// A marble texture.
pub fn marble(size: u32) -> Vec<u8> {
    grey(size, size, |u, v| marble_tone(u, v, 40))
}

/// Coursed ashlar: five courses of blocks with mortar joints, each block of its own tone.
pub fn ashlar(size: u32) -> Vec<u8> {
    grey(size, size, |u, v| {
        let course = (v * 5.0).floor() as i64;
        // Blocks per course and their offsets alternate so that joints break.
        let blocks = [2.0, 3.0, 2.0, 3.0, 2.0][course as usize % 5];
        let shifted = (u + [0.0, 0.11, 0.37, 0.26, 0.19][course as usize % 5]).rem_euclid(1.0) * blocks;
        let (fx, fy) = (shifted.fract() / blocks, (v * 5.0).fract() / 5.0);
        // Distance to the nearest joint in units of the texture, roughened; a joint is 0.4 % of it: 8 mm at 2 m.
        let edge = fx.min(1.0 / blocks - fx).min(fy.min(0.2 - fy)) + 0.004 * (fbm(u, v, 24, 2, 3) - 0.5);
        let joint = 1.0 - smoothstep(0.0025, 0.0075, edge);
        let block = hash01(shifted.floor() as i64, course, 77) - 0.5;
        let clouds = fbm(u, v, 5, 5, 51) - 0.5;
        let grain = noise(u, v, 128, 19) - 0.5;
        0.86 + 0.10 * block + 0.20 * clouds + 0.06 * grain - 0.26 * joint
    })
}

/// A floor of four by four cream octagonal slabs of marble with small red and slate squares at their corners.
pub fn octagon_tiles(size: u32) -> Vec<u8> {
    color(size, size, |u, v| {
        let n = 4.0;
        let (x, y) = (u * n, v * n);
        let (cx, cy) = (x.round(), y.round());
        // Distance from the nearest corner in the city-block norm: the small squares stand on a point.
        let diamond = (x - cx).abs() + (y - cy).abs();
        let small = 0.27;
        let joint_diamond = 1.0 - smoothstep(0.008, 0.022, (diamond - small).abs());
        let (fx, fy) = ((x - cx).abs(), (y - cy).abs());
        let joint_side = if diamond > small {
            1.0 - smoothstep(0.006, 0.016, fx.min(fy))
        } else {
            0.0
        };
        let (i, j) = ((x.floor() as i64).rem_euclid(4), (y.floor() as i64).rem_euclid(4));
        let vein = marble_tone((u + 0.37 * i as f64).fract(), (v + 0.61 * j as f64).fract(), 90);
        let slab = hash01(i, j, 5) - 0.5;
        let cream = dvec3(0.91, 0.85, 0.74) * (vein + 0.09 * slab);
        let odd = (cx as i64 + cy as i64).rem_euclid(2) == 1;
        let dark = if odd {
            dvec3(0.55, 0.22, 0.17)
        } else {
            dvec3(0.25, 0.29, 0.33)
        };
        let dark = dark * (0.75 + 0.5 * fbm(u, v, 12, 4, 63));
        let body = if diamond < small { dark } else { cream };
        let joint = joint_diamond.max(joint_side);
        mix(body, dvec3(0.50, 0.46, 0.40), joint * 0.85)
    })
}

/// A woven fabric with a damask of ogival medallions; a light tone to be tinted.
pub fn damask(size: u32) -> Vec<u8> {
    grey(size, size, |u, v| {
        use std::f64::consts::TAU;
        // Two threads of the weave per eight texels.
        let n = f64::from(size) / 8.0;
        let weave = (TAU * n * u).sin() * (TAU * n * v).sin();
        // Ogees: vertical waves in counter-phase that meet, twice across and once down.
        let wave = 0.125 + 0.085 * (TAU * v).cos();
        let cell = (u * 2.0).fract() / 2.0 - 0.25;
        let shifted = (u * 2.0 + 0.5).fract() / 2.0 - 0.25;
        let a = (cell.abs() - wave).abs();
        let b = (shifted.abs() - (0.25 - wave)).abs();
        let band = 1.0 - smoothstep(0.010, 0.016, a.min(b));
        // A flower of eight petals in each medallion.
        let flower = |x: f64, y: f64| {
            let (r, angle) = ((x * x + y * y).sqrt(), y.atan2(x));
            1.0 - smoothstep(-0.008, 0.008, r - 0.055 * (0.65 + 0.35 * (8.0 * angle).cos()))
        };
        let tall = (v + 0.5).fract() - 0.5;
        let motif = band
            .max(flower(cell, tall * 0.6))
            .max(flower(shifted, (v - 0.5) * 0.6));
        0.66 + 0.26 * motif + 0.03 * weave + 0.06 * (fbm(u, v, 8, 3, 71) - 0.5)
    })
}
