//! Pixels from fragments: the layers of a frame.

use super::light::Lit;
use glam::Vec3;
use rayon::prelude::*;
use relight_render::exposure::Exposure;
use relight_render::views;
use relight_scene::image::{ALPHA, BEAUTY, DEPTH, Layers, RAY_DEPTH};

/// The layers of a frame: `beauty` = `emission` + `direct` + `indirect`, `A`, `light.NAME`, with `surface_layers` `background`,
/// `albedo`, `normal`, `depth` and `depth.ray`, and where they were counted `cut_size` and `nodes`, means over a pixel. Nothing is
/// clamped, so that layers add up.
pub fn resolve(seen: &Exposure, lit: &Lit, surface_layers: bool) -> Layers {
    let mut layers = Layers::new(seen.width, seen.height);
    let mut push = |name: &str, pixels: &[Vec3]| {
        let pixels: Vec<[f32; 3]> = pixels.par_iter().with_min_len(4096).map(Vec3::to_array).collect();
        layers.push_rgb(name, &pixels);
    };
    let emission = seen.resolve(&lit.emission);
    let direct = seen.resolve(&lit.direct);
    let indirect = seen.resolve(&lit.indirect);
    let beauty: Vec<Vec3> = (0..indirect.len())
        .into_par_iter()
        .with_min_len(4096)
        .map(|i| emission[i] + direct[i] + indirect[i])
        .collect();
    push(BEAUTY, &beauty);
    push("emission", &emission);
    push("direct", &direct);
    push("indirect", &indirect);
    for (name, fragments) in &lit.lights {
        push(&format!("light.{name}"), &seen.resolve(fragments));
    }
    if surface_layers {
        push("background", &views::background(seen, &lit.emission));
        push("albedo", &views::albedo(seen));
        push("normal", &views::normals(seen));
        let (planar, along) = views::depths(seen);
        layers.push_scalar(DEPTH, &planar);
        layers.push_scalar(RAY_DEPTH, &along);
    }
    if let Some(cuts) = &lit.cuts {
        for (name, counts) in [("cut_size", &cuts.cut_size), ("nodes", &cuts.nodes)] {
            let counts: Vec<Vec3> = counts.iter().map(|n| Vec3::splat(*n as f32)).collect();
            let means: Vec<f32> = seen.resolve(&counts).iter().map(|mean| mean.x).collect();
            layers.push_scalar(name, &means);
        }
    }
    layers.push_scalar(ALPHA, &views::alpha(seen));
    layers
}
