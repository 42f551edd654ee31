//! Where two images look different, beside how different two references of other seeds look: the command behind the
//! contacts in docs/notebook/cuts.md.
//!
//! `cargo run --release --example flip_map -- IMAGE.exr REFERENCE.exr OTHER_REFERENCE.exr MAP.png [X,Y,WIDTH,HEIGHT]…`
//!
//! Draws, for each part of the image (the whole by default), image and reference above the FLIP map of the image to the
//! reference and that of the other reference to it: dark violet is 0, yellow is 1. Prints for each part the means and the
//! 99th percentiles of both maps, and how long the longest run of neighbouring pixels along a row or column is that
//! exceed what the references differ by anywhere in that part, and how many of those are brighter than the reference. All of the layer `direct`.

use relight_scene::image::metrics::percentile;
use relight_scene::image::preview::contact_sheet;
use relight_scene::image::{FloatImage, Limits, colormap, display_encoded, flip, read_exr, write_png};
use std::error::Error;
use std::path::Path;

/// Pixels of the picture for each of the image.
const ENLARGED: usize = 3;
/// Level to which the picture brings the reference's mean.
const MEAN: f32 = 0.3;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [image, reference, other, map, parts @ ..] = arguments.as_slice() else {
        return Err("IMAGE.exr REFERENCE.exr OTHER_REFERENCE.exr MAP.png [X,Y,WIDTH,HEIGHT]…".into());
    };
    let direct = |path: &String| -> Result<FloatImage, Box<dyn Error>> {
        let layers = read_exr(Path::new(path), &Limits::default())?;
        Ok(layers.rgb("direct").ok_or(format!("{path}: no layer direct"))?)
    };
    let (image, reference, other) = (direct(image)?, direct(reference)?, direct(other)?);
    let mut boxes = Vec::new();
    for part in parts {
        let numbers: Vec<usize> = part.split(',').map(str::parse).collect::<Result<_, _>>()?;
        boxes.push(<[usize; 4]>::try_from(numbers).map_err(|_| format!("{part}: not X,Y,WIDTH,HEIGHT"))?);
    }
    if boxes.is_empty() {
        boxes.push([0, 0, image.width, image.height]);
    }
    let found = flip::flip_hdr(&image, &reference)?.errors;
    let floor = flip::flip_hdr(&other, &reference)?.errors;
    let brightness = reference.pixels.iter().flatten().sum::<f32>() / (3 * reference.pixels.len()) as f32;
    let shown = |image: &FloatImage| FloatImage {
        pixels: image
            .pixels
            .iter()
            .map(|p| p.map(|v| v * MEAN / brightness))
            .collect(),
        ..*image
    };
    let heat = |errors: &[f32]| FloatImage {
        pixels: errors.iter().map(|&e| colormap::heat(e)).collect(),
        ..image
    };
    let pictures = [shown(&image), shown(&reference), heat(&found), heat(&floor)];
    println!(
        "| part | FLIP | 99 % | floor | 99 % | most | pixels above the floor's most | brighter | longest run |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
    for (i, &part) in boxes.iter().enumerate() {
        let (a, b) = (cut(&found, image.width, part)?, cut(&floor, image.width, part)?);
        let most = b.iter().copied().fold(0.0, f32::max);
        let above: Vec<bool> = a.iter().map(|&e| e > most).collect();
        let light = |image: &FloatImage| -> Result<Vec<f32>, Box<dyn Error>> {
            let pixels = cut(&image.pixels, image.width, part)?;
            Ok(pixels.iter().map(|p| p.iter().sum()).collect())
        };
        let brighter = (light(&image)?.iter().zip(light(&reference)?).zip(&above))
            .filter(|&((a, b), &above)| above && *a > b)
            .count();
        let (count, run) = (above.iter().filter(|&&x| x).count(), longest_run(&above, part[2]));
        let (mean_a, mean_b) = (mean(&a), mean(&b));
        let high = |errors: &[f32]| {
            let mut errors: Vec<f64> = errors.iter().map(|&e| f64::from(e)).collect();
            percentile(&mut errors, 0.99)
        };
        println!(
            "| {part:?} | {mean_a:.3} | {:.3} | {mean_b:.3} | {:.3} | {most:.3} | {count} of {} | {brighter} | {run} |",
            high(&a),
            high(&b),
            above.len(),
        );
        let tiles = pictures
            .iter()
            .map(|picture| enlarged(picture, part))
            .collect::<Result<Vec<_>, _>>()?;
        let path = if boxes.len() == 1 {
            map.clone()
        } else {
            format!("{}{i}.png", map.trim_end_matches(".png"))
        };
        write_png(Path::new(&path), &display_encoded(&contact_sheet(&tiles, 2)?))?;
    }
    Ok(())
}

/// The values of a part of an image that is `width` wide.
fn cut<T: Copy>(values: &[T], width: usize, [x, y, w, h]: [usize; 4]) -> Result<Vec<T>, Box<dyn Error>> {
    if w == 0 || h == 0 || x + w > width || (y + h) * width > values.len() {
        return Err(format!("{x},{y},{w},{h} does not lie in the image").into());
    }
    Ok((y..y + h)
        .flat_map(|row| values[row * width + x..][..w].iter().copied())
        .collect())
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

/// Most neighbours of one row or column that are all set.
fn longest_run(set: &[bool], width: usize) -> usize {
    let run = |line: &mut dyn Iterator<Item = bool>| {
        line.fold((0, 0), |(most, now), set| {
            let now = if set { now + 1 } else { 0 };
            (most.max(now), now)
        })
        .0
    };
    let rows = set.chunks(width).map(|row| run(&mut row.iter().copied()));
    let columns = (0..width).map(|x| run(&mut set.iter().skip(x).step_by(width).copied()));
    rows.chain(columns).max().unwrap_or(0)
}

fn enlarged(image: &FloatImage, part: [usize; 4]) -> Result<FloatImage, Box<dyn Error>> {
    let pixels = cut(&image.pixels, image.width, part)?;
    let (width, height) = (part[2] * ENLARGED, part[3] * ENLARGED);
    Ok(FloatImage {
        width,
        height,
        pixels: (0..width * height)
            .map(|i| pixels[i / width / ENLARGED * part[2] + i % width / ENLARGED])
            .collect(),
    })
}
