//! The page beside the arrays that says how they make light again.

use super::args::What;
use super::files::Written;
use super::report::Facts;
use std::fmt::Write;

/// Its name.
pub const FILE: &str = "README.txt";

/// What it says of files that were written.
pub fn text(what: What, facts: &Facts, files: &[Written]) -> String {
    let mut text = format!(
        "relight export: {}. Version {}.\n\
         Metres, +Y up, right-handed, linear RGB (Rec. 709 primaries). Arrays are numpy's, C order, little-endian.\n\n",
        subject(what),
        env!("CARGO_PKG_VERSION")
    );
    let width = files.iter().map(|f| f.file.len()).max().unwrap_or(0);
    for Written { file, shape, unit } in files {
        let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
        // Strings of any length can be written to.
        let _ = writeln!(text, "{file:width$}  {:24}  {unit}", shape.join(" x "));
    }
    text.push('\n');
    text += formula(what);
    if let Facts::IrradianceVolume {
        low,
        high,
        grid,
        frame,
    } = facts
    {
        let size = [0, 1, 2].map(|i| high[i] - low[i]);
        let middle = [0, 1, 2].map(|i| 0.5 * (high[i] + low[i]));
        let _ = writeln!(
            text,
            "\nFrame {frame}. The box from {low:?} to {high:?} in {grid:?} parts. In Bevy a LightProbe with an IrradianceVolume of ambient_cubes.ktx2,\n\
             scaled by {size:?} at {middle:?}."
        );
    }
    if let Facts::Lightmap {
        maps,
        frame,
        size,
        part,
        intensity,
        covered,
        hidden,
        ..
    } = facts
    {
        let _ = writeln!(
            text,
            "\nFrame {frame}, {part}, {size} x {size} texels, of which {:.1} % show surfaces; {:.1} % lie hidden under others and were filled.\n\
             White in the picture within lightmap.glb is {intensity} W/m2. Maps (.exr, .ktx2):",
            100.0 * covered,
            100.0 * hidden
        );
        for [file, light] in maps {
            let _ = writeln!(text, "{file}  {light:?}");
        }
        text += ENGINES;
    }
    if let Facts::PointCloud { lights, frame } = facts {
        let _ = writeln!(
            text,
            "\nFrame {frame}. Lights, in the order of the first index of irradiance_*.npy:"
        );
        for (number, name) in lights.iter().enumerate() {
            let _ = writeln!(text, "{number:4}  {name:?}");
        }
        text += EXAMPLE;
    }
    text
}

fn subject(what: What) -> &'static str {
    match what {
        What::Points => "points of all levels, coarsest first",
        What::Links => "sparse operators as compressed rows, and the clusters that send",
        What::Cuts => "visibility cuts: what each finest point sees of the lights",
        What::Lights => "the lights that visibility cuts cluster",
        What::Transfer => "what one bounce does, as matrices",
        What::Factors => "the factors of one bounce",
        What::Bounce => "bounces between clusters",
        What::PointCloud => "the finest points in the light of a sequence",
        What::IrradianceVolume => "the light that arrives at the places of a grid",
        What::Lightmap => "irradiance of all surfaces as a texture",
    }
}

fn formula(what: What) -> &'static str {
    match what {
        What::Points => {
            "Point j of a level weighs W_j(x, n) = f(r) max(n.n_j, 0)^2 at a place x with normal n, with f(r) = 1 - 3 r^2 + 2 r^3 for r < 1, else 0,\n\
             r = |d + 2 (d.n_j) n_j| / s_j, d = x - x_j, s_j = support_radius[level] * 2^widening. Functions are B_j = W_j / sum(W), each W_j times\n\
             4^-widening first.\n"
        }
        What::Links => {
            "Row i of an operator has the entries row_offsets[i] to row_offsets[i + 1] of columns and vectors (or weights). Receivers are points of all\n\
             levels, columns of transfer global numbers of clusters (senders of level 0 first, sender_counts of each). The specification of the\n\
             format, sections 6.7 to 6.11 and 8.1, says what they multiply.\n"
        }
        What::Cuts => {
            "Site i (a finest point) has the nodes row_offsets[i] to row_offsets[i + 1] of cut_*. Node k stands for the lights first_leaves[k] to\n\
             first_leaves[k] + 2^heights[k] - 1, in the order of --what lights; values[k] times the unit that --json tells is the mean over them of\n\
             visibility times cosine. Irradiance of lights of radiance L_k (mean over a node): E = sum over k of values[k] unit 2^heights[k] w L_k, with\n\
             w the solid angle of one direction.\n"
        }
        What::Lights => {
            "Directions have 4 pi / N steradians each; surface samples have each the area that --json tells.\n"
        }
        What::Transfer | What::Factors => {
            "E = normals @ push @ transfer @ pull @ B: irradiance of the finest points after one bounce of their radiosity B = albedo E0, E0 their direct\n\
             irradiance, channel by channel (scipy.io.mmread reads the matrices). points_from_points is the product of the four.\n"
        }
        What::Bounce => {
            "E = bounce @ B: mean irradiance of the clusters of one level per radiosity of clusters; all bounces are (1 - bounce diag(albedo))^-1 of\n\
             the first. solution_* is that inverse, applied, for all channels or for red, green and blue.\n"
        }
        What::PointCloud => {
            "Arrays irradiance_* have a light, a point and a channel. With E_j = irradiance_direct + irradiance_indirect, summed over the lights, a point\n\
             sends L_j = albedo_j E_j / pi, which is radiance_j; light adds up, so that any lights may be scaled.\n\
             A place x with normal n of the same smooth surface receives E(x, n) = sum_j B_j E_j, B_j = W_j / sum(W), over the points around it:\n\
             W_j = f(r) max(n.n_j, 0)^2 (support_radius_min / support_radius_j)^2, f(r) = 1 - 3 r^2 + 2 r^3 for r < 1, else 0,\n\
             r = |d + 2 (d.n_j) n_j| / support_radius_j, d = x - x_j.\n\
             The pixel that sees a matt place there has the indirect layer albedo E_indirect(x, n) / pi, but for walls between points and where normals\n\
             differ, where the player turns vector irradiance. Its direct layer is finer than the points: shadow rays of its own.\n"
        }
        What::IrradianceVolume => {
            "Arrays have the indices k, j, i of places first: z, y, x. Place (i, j, k) is at low + (high - low) * ((i, j, k) + 0.5) / (nx, ny, nz).\n\
             sh holds coefficients c of incident radiance L(w) = sum_n c_n Y_n(w), real and orthonormal, n = l (l + 1) + m, Y_1, Y_2, Y_3 = 0.4886 y, z, x,\n\
             Y_4 to Y_8 = 1.0925 xy, 1.0925 yz, 0.31539 (3 zz - 1), 1.0925 xz, 0.54627 (xx - yy), Y_0 = 0.28209. Irradiance of a surface with normal n:\n\
             E(n) = sum_n A_l c_n Y_n(n) with A = pi, 2 pi / 3, pi / 4.\n\
             ambient_cubes holds E(n) / pi, 0 where it would be below, of the six axes: parts along k for x, y, z, in each the first half along j for\n\
             the positive axis, the second for the negative one. A matt surface shows albedo times that.\n\
             open is the share of directions without backs of surfaces: near 0 inside of things, where light means nothing.\n\
             There is light of surfaces, skies and lamps with extent, as rays meet it. Lamps without extent (points, spots, directional) are not in it;\n\
             what they light is: engines add them by themselves.\n"
        }
        What::Lightmap => {
            "A texel holds the irradiance E of the front of the surface that it shows: a matt surface has the radiance albedo E / pi there. (0, 0) is\n\
             the upper left corner of the upper left texel, as in glTF. Coordinates are TEXCOORD_1 of lightmap.glb. What no surface covers has the\n\
             light of the nearest texel that one does.\n"
        }
    }
}

const ENGINES: &str = r#"
lightmap.glb has the scene without its lights, which are in the map: don't add them again. It has the map of all lights in 8 bits, linear,
by the extension MOZ_lightmap; the files beside it are finer.

three.js: load lightmap.glb with GLTFLoader; then, with a texture of lightmap.ktx2 (KTX2Loader, or EXRLoader and lightmap.exr with
texture.flipY = true),

    texture.channel = 1;
    model.traverse((o) => { if (o.isMesh) { o.material.lightMap = texture; o.material.lightMapIntensity = 1; } });

Bevy: spawn the scene of lightmap.glb; give each of its Mesh3d entities
Lightmap { image: asset_server.load("lightmap.ktx2"), uv_rect: Rect::new(0.0, 0.0, 1.0, 1.0), bicubic_sampling: false }, and each
StandardMaterial lightmap_exposure: 1.0 / PI (Bevy multiplies with the albedo, without the pi).

Godot 4: import lightmap.glb and lightmap.exr; give each surface a ShaderMaterial with

    shader_type spatial;
    render_mode ambient_light_disabled;
    uniform sampler2D map : filter_linear, repeat_disable;
    uniform vec4 albedo : source_color = vec4(1.0);
    void fragment() { ALBEDO = albedo.rgb; EMISSION = albedo.rgb * texture(map, UV2).rgb / PI; }
"#;

const EXAMPLE: &str = r#"
An example, run in this folder as `python example.py X Y Z NX NY NZ`, prints the irradiance there; times the albedo over pi it is the pixel:

import sys
import numpy as np

x, n = np.array(sys.argv[1:4], float), np.array(sys.argv[4:7], float)
load = lambda name: np.load(name + ".npy").astype(float)
positions, normals, support = load("positions"), load("normals"), load("support_radius")
d = x - positions
along = np.sum(d * normals, axis=1, keepdims=True)
r = np.linalg.norm(d + 2 * along * normals, axis=1) / support
f = np.where(r < 1, 1 - 3 * r**2 + 2 * r**3, 0)
w = f * np.maximum(normals @ n, 0) ** 2 * (support.min() / support) ** 2
b = w / w.sum()
for part in ["direct", "indirect"]:
    print(part, *(b @ load("irradiance_" + part).sum(axis=0)))
"#;
