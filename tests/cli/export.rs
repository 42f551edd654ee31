//! `relight export`: other tools read what an asset holds.

use crate::stage::{
    SQUARE, TINY, bake_json, complaint, cornell, data, folder, gltf, json, names, relight, sequence,
    with_broken_links,
};
use glam::Vec3;
use relight_format::{Asset, LightSamples, Limits, read_file};
use relight_play::open::load_operators;
use relight_transport::random::Stream;
use serde_json::Value;
use sprs::CsMatI;
use sprs::prod::mul_acc_mat_vec_csr;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use tempfile::TempDir;

/// The Cornell box with cuts of the fewest lights, of directions or of surfaces.
fn with_cuts(mode: &'static str) -> &'static Path {
    static ASSETS: [OnceLock<(TempDir, PathBuf)>; 2] = [const { OnceLock::new() }; 2];
    let place = usize::from(mode == "indirect");
    &ASSETS[place]
        .get_or_init(|| {
            let folder = folder();
            let asset = folder.path().join("cuts.relight");
            let options = [&TINY[..], &["--cuts", mode, "--cut-lights", "256"]].concat();
            bake_json(&data("cornell.glb"), &asset, &options);
            (folder, asset)
        })
        .1
}

fn export(asset: &Path, what: &str, folder: &Path) -> Value {
    let output = relight()
        .arg("export")
        .arg(asset)
        .args(["--what", what, "--json", "-o"])
        .arg(folder)
        .assert()
        .success()
        .get_output()
        .clone();
    let said = json(&output.stdout);
    let mut listed: Vec<String> = said["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["file"].as_str().unwrap().to_owned())
        .collect();
    listed.sort();
    assert_eq!(names(folder), listed, "nothing but what is said is there");
    said
}

/// Type, shape and data of an .npy file, read as numpy's own description of the format has it.
fn npy(file: &Path) -> (String, Vec<usize>, Vec<u8>) {
    let bytes = std::fs::read(file).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert!(end.is_multiple_of(64) && bytes[end - 1] == b'\n');
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    let between = |start: &str, stop: &str| {
        let rest = header.split_once(start).unwrap().1;
        rest.split_once(stop).unwrap().0.to_owned()
    };
    assert!(header.contains("'fortran_order': False"));
    let shape: Vec<usize> = between("'shape': (", ")")
        .split(',')
        .filter(|n| !n.is_empty())
        .map(|n| n.parse().unwrap())
        .collect();
    (between("'descr': '", "'"), shape, bytes[end..].to_vec())
}

fn floats(file: &Path) -> Vec<f32> {
    let (kind, shape, bytes) = npy(file);
    assert_eq!(kind, "<f4");
    assert_eq!(bytes.len(), 4 * shape.iter().product::<usize>());
    bytes
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

fn numbers(file: &Path) -> Vec<u32> {
    let (kind, shape, bytes) = npy(file);
    assert_eq!((kind.as_str(), shape.len()), ("<u4", 1));
    bytes
        .chunks(4)
        .map(|b| u32::from_le_bytes(b.try_into().unwrap()))
        .collect()
}

fn asset(path: &Path) -> Asset {
    read_file(path, &Limits::default()).unwrap()
}

#[test]
fn points_are_those_of_the_file_in_arrays_and_in_a_ply() {
    let folder = folder();
    export(cornell(), "points", folder.path());
    let levels = asset(cornell()).points;
    let positions: Vec<f32> = levels
        .iter()
        .flat_map(|l| l.positions.as_flattened())
        .copied()
        .collect();
    assert_eq!(floats(&folder.path().join("positions.npy")), positions);
    let albedo: Vec<f32> = levels
        .iter()
        .flat_map(|l| l.albedo.as_flattened())
        .copied()
        .collect();
    assert_eq!(floats(&folder.path().join("albedo.npy")), albedo);
    let (kind, shape, level) = npy(&folder.path().join("level.npy"));
    assert_eq!((kind.as_str(), shape), ("|u1", vec![positions.len() / 3]));
    let of_finest = level.iter().filter(|&&l| l == 1).count();
    assert_eq!(of_finest, levels[1].positions.len());

    let ply = std::fs::read(folder.path().join("points.ply")).unwrap();
    let end = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&ply[..end]).unwrap();
    assert!(
        header.starts_with("ply\nformat binary_little_endian 1.0\n"),
        "{header}"
    );
    assert!(
        header.contains(&format!("element vertex {}\n", level.len())),
        "{header}"
    );
    // Nine floats, level and widening.
    assert_eq!(ply.len() - end, level.len() * 38);
    let at = end + 38 * (level.len() - 1);
    let last = [0, 1, 2].map(|i| f32::from_le_bytes(ply[at + 4 * i..at + 4 * i + 4].try_into().unwrap()));
    assert_eq!(last, *levels[1].positions.last().unwrap());
    assert_eq!(ply[at + 36], 1);
}

#[test]
fn links_are_those_of_the_file() {
    let folder = folder();
    let said = export(cornell(), "links", folder.path());
    let asset = asset(cornell());
    let transfer = asset.transfer.unwrap();
    assert_eq!(said["facts"]["receivers"], transfer.receivers);
    assert_eq!(
        numbers(&folder.path().join("transfer_row_offsets.npy")),
        transfer.row_offsets
    );
    assert_eq!(
        numbers(&folder.path().join("transfer_columns.npy")),
        transfer.columns
    );
    assert_eq!(
        floats(&folder.path().join("transfer_vectors.npy")),
        transfer.vectors.as_flattened()
    );
    let bounce = asset.bounce.unwrap().matrix;
    assert_eq!(floats(&folder.path().join("bounce_weights.npy")), bounce.weights);
    let senders = asset.senders.unwrap();
    assert_eq!(
        numbers(&folder.path().join("sender_of_finest_point.npy")),
        senders.leaf_of_point
    );
}

/// The Radiance header, then rows of `NCOLS` entries of `NCOMP` floats.
fn matrix(file: &Path) -> ([usize; 3], Vec<f32>) {
    let bytes = std::fs::read(file).unwrap();
    let end = bytes.windows(2).position(|w| w == b"\n\n").unwrap() + 2;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(
        header.starts_with("#?RADIANCE\n") && header.contains("\nFORMAT=float\n"),
        "{header}"
    );
    let field = |name: &str| {
        let line = header.lines().find_map(|line| line.strip_prefix(name)).unwrap();
        line.parse::<usize>().unwrap()
    };
    let shape = [field("NROWS="), field("NCOLS="), field("NCOMP=")];
    let values: Vec<f32> = bytes[end..]
        .chunks(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert_eq!(values.len(), shape.iter().product::<usize>());
    (shape, values)
}

/// A Matrix Market file as sprs reads it.
fn market(file: &Path) -> CsMatI<f64, u32> {
    sprs::io::read_matrix_market::<f64, u32, _>(file)
        .unwrap()
        .to_csr()
}

fn product(matrix: &CsMatI<f64, u32>, values: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; matrix.rows()];
    mul_acc_mat_vec_csr(matrix.view(), values, &mut out[..]);
    out
}

/// A closed room, three levels of receivers and two of senders, so that T's rows are differences to be pushed and its
/// columns differences to the parent's mean.
fn furnace(folder: &Path) -> PathBuf {
    let asset = folder.join("furnace.relight");
    let options = ["--levels", "3", "--sender-levels", "2", "--coarse-radius", "0.6"];
    bake_json(&data("furnace_box.glb"), &asset, &options);
    asset
}

/// Truth: walls that send 1 everywhere receive 1 everywhere; any other light, what the player makes of it.
#[test]
fn matrices_of_one_bounce_multiply_as_they_say() {
    let folder = folder();
    let file = furnace(folder.path());
    let out = folder.path().join("out");
    let said = export(&file, "transfer", &out);
    let whole = market(&out.join("points_from_points.mtx"));
    let factors =
        ["pull", "transfer", "push", "normals"].map(|name| market(&out.join(format!("{name}.mtx"))));
    let points = whole.rows();
    assert_eq!(said["facts"]["finest_points"], points);
    assert_eq!(whole.cols(), points);
    let through = |radiosity: &[f64]| factors.iter().fold(radiosity.to_vec(), |v, m| product(m, &v));
    // Rows are fitted to even light; what is left is the file's rounding of links to 8 bits, hundreds to a row.
    for irradiance in [product(&whole, &vec![1.0; points]), through(&vec![1.0; points])] {
        let worst = irradiance.iter().map(|e| (e - 1.0).abs()).fold(0.0, f64::max);
        let mean = irradiance.iter().sum::<f64>() / points as f64;
        assert!(worst < 0.005 && (mean - 1.0).abs() < 0.0005, "{worst} {mean}");
    }

    let mut stream = Stream::new(71, 0, 0);
    let radiosity: Vec<Vec3> = (0..points)
        .map(|_| Vec3::new(stream.uniform(), stream.uniform() + 0.5, 0.0))
        .collect();
    let operators = load_operators(&file).unwrap().unwrap();
    let played = operators.of_radiosity(&radiosity);
    for channel in 0..3 {
        let sent: Vec<f64> = radiosity.iter().map(|b| f64::from(b[channel])).collect();
        let (one, by_factors) = (product(&whole, &sent), through(&sent));
        for (p, (value, normal)) in played.iter().zip(&operators.finest.normals).enumerate() {
            let played = f64::from(value.irradiance(*normal)[channel]);
            // Matrices are f32, and so are the player's sums: some hundred terms below 1.
            assert!(
                (one[p] - by_factors[p]).abs() < 1e-5,
                "{} {}",
                one[p],
                by_factors[p]
            );
            assert!(
                (played - one[p]).abs() < 2e-5,
                "{channel} {p}: {played} {}",
                one[p]
            );
        }
    }

    // What was written is what was computed, and Radiance's dense matrix is the sparse one.
    let computed = operators.factors();
    let computed = [
        &computed.pull,
        &computed.transfer,
        &computed.push,
        &computed.normals,
    ];
    for (read, computed) in factors.iter().zip(computed) {
        assert_eq!(read.map(|w| *w as f32), *computed);
    }
    let (shape, dense) = matrix(&out.join("points_from_points.rmx"));
    assert_eq!(shape, [points, points, 1]);
    for (i, row) in dense.chunks(points).enumerate() {
        for (j, &value) in row.iter().enumerate() {
            assert_eq!(
                f64::from(value),
                whole.get(i, j).copied().unwrap_or(0.0) as f32 as f64
            );
        }
    }
}

/// Truth: the operators of the file, entry by entry.
#[test]
fn matrices_hold_the_operators_of_the_file() {
    let folder = folder();
    let asset = asset(cornell());
    let t = asset.transfer.unwrap();
    export(cornell(), "transfer", &folder.path().join("transfer"));
    let (shape, dense) = matrix(&folder.path().join("transfer/transfer.rmx"));
    assert_eq!(shape, [t.receivers as usize, t.senders as usize, 3]);
    let sparse = market(&folder.path().join("transfer/transfer.mtx"));
    assert_eq!(sparse.shape(), (3 * t.receivers as usize, t.senders as usize));
    assert_eq!(sparse.nnz(), 3 * t.columns.len());
    for i in 0..t.receivers as usize {
        for link in t.row_offsets[i] as usize..t.row_offsets[i + 1] as usize {
            let (column, vector) = (t.columns[link] as usize, t.vectors[link]);
            for axis in 0..3 {
                assert_eq!(dense[3 * (i * shape[1] + column) + axis], vector[axis]);
                assert_eq!(
                    sparse.get(3 * i + axis, column).map(|w| *w as f32),
                    Some(vector[axis])
                );
            }
        }
    }

    export(cornell(), "factors", &folder.path().join("factors"));
    for name in ["pull", "transfer", "push", "normals"] {
        let [a, b] = ["transfer", "factors"].map(|of| folder.path().join(of).join(format!("{name}.mtx")));
        assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap(), "{name}");
    }

    export(cornell(), "bounce", &folder.path().join("bounce"));
    let k = asset.bounce.unwrap().matrix;
    let sparse = market(&folder.path().join("bounce/bounce.mtx"));
    let (shape, dense) = matrix(&folder.path().join("bounce/bounce.rmx"));
    assert_eq!(shape, [k.rows as usize, k.rows as usize, 1]);
    assert_eq!(sparse.indices(), k.columns);
    let of_file = |w: &f64| *w as f32;
    assert!(sparse.data().iter().map(of_file).eq(k.weights.iter().copied()));
    for (sum, row) in k.row_sums.iter().zip(dense.chunks(shape[1])) {
        let all: f64 = row.iter().map(|&w| f64::from(w)).sum();
        assert!((all - f64::from(*sum)).abs() <= 1e-6 * f64::from(*sum));
    }
}

/// What stands in the place of the bounce operator where a bake has solved it.
#[test]
fn a_solution_is_exported_channel_by_channel() {
    let folder = folder();
    let file = folder.path().join("solved.relight");
    bake_json(
        &data("cornell.glb"),
        &file,
        &[&TINY[..], &["--solution"]].concat(),
    );
    let out = folder.path().join("out");
    export(&file, "bounce", &out);
    let solution = asset(&file).solution.unwrap();
    // And README.txt.
    assert_eq!(names(&out).len(), solution.channels.len() + 1);
    for (i, channel) in solution.channels.iter().enumerate() {
        let read = market(&out.join(format!("solution_{i}.mtx")));
        assert_eq!(read.indices(), channel.columns);
        assert!(
            read.data()
                .iter()
                .map(|w| *w as f32)
                .eq(channel.weights.iter().copied())
        );
    }
}

#[test]
fn a_matrix_that_would_be_too_large_is_refused_with_its_size() {
    let folder = folder();
    let out = folder.path().join("out");
    let text = complaint(
        relight()
            .arg("export")
            .arg(cornell())
            .args(["--what", "transfer", "--matrix-limit", "10K", "-o"])
            .arg(&out),
        1,
    );
    assert!(
        text.contains("--matrix-limit (10240)")
            && text.contains("--what factors")
            && text.contains("cornell.relight"),
        "{text}"
    );
    assert!(!out.exists());
    let usage = relight()
        .arg("export")
        .arg(cornell())
        .args(["--what", "transfer", "--matrix-limit", "much", "-o"])
        .arg(&out)
        .assert()
        .code(2)
        .get_output()
        .clone();
    assert!(String::from_utf8(usage.stderr).unwrap().contains("500M"));
}

#[test]
fn cuts_and_their_lights_are_those_of_the_file() {
    for mode in ["environment", "indirect"] {
        let file = with_cuts(mode);
        let asset = asset(file);
        let (cuts, tree) = (asset.cuts.unwrap(), asset.light_tree.unwrap());
        let out = folder();
        let said = export(file, "cuts", out.path());
        assert_eq!(said["facts"]["lights"], 256);
        assert_eq!(numbers(&out.path().join("cut_row_offsets.npy")), cuts.row_offsets);
        assert_eq!(npy(&out.path().join("cut_heights.npy")).2, cuts.heights);
        assert_eq!(floats(&out.path().join("cut_values.npy")), cuts.values);
        // Nodes tile: each starts where the one before it ends, and the last ends at the last light.
        let first = numbers(&out.path().join("cut_first_leaves.npy"));
        for row in cuts.row_offsets.windows(2) {
            let mut next = 0;
            for i in row[0] as usize..row[1] as usize {
                assert_eq!(first[i], next);
                next += 1 << cuts.heights[i];
            }
            assert_eq!(next, 256);
        }
        let out = folder();
        let said = export(file, "lights", out.path());
        match tree.lights {
            LightSamples::Environment { .. } => {
                assert_eq!(said["facts"]["kind"], "environment");
                let directions = floats(&out.path().join("light_directions.npy"));
                // Even over the sphere: their sum is nothing, their lengths 1.
                for axis in 0..3 {
                    let sum: f32 = directions.iter().skip(axis).step_by(3).sum();
                    assert!(sum.abs() < 0.01 * 256.0, "{sum}");
                }
                for d in directions.chunks(3) {
                    let square: f32 = d.iter().map(|c| c * c).sum();
                    assert!((square - 1.0).abs() < 1e-5);
                }
            }
            LightSamples::Surface { positions, .. } => {
                assert_eq!(said["facts"]["kind"], "surface");
                let positions = positions.as_flattened();
                assert_eq!(floats(&out.path().join("light_positions.npy")), positions);
            }
        }
        assert!(out.path().join("lights.ply").is_file());
    }
}

#[test]
fn what_an_asset_lacks_is_said() {
    let folder = folder();
    let refused = |what: &str| {
        complaint(
            relight()
                .arg("export")
                .arg(cornell())
                .args(["--what", what, "-o"])
                .arg(folder.path().join(what)),
            1,
        )
    };
    for what in ["cuts", "lights"] {
        let text = refused(what);
        assert!(
            text.contains("--cuts environment") && text.contains("cornell.relight"),
            "{text}"
        );
    }
    let missing = complaint(
        relight()
            .args(["export", "missing.relight", "--what", "points", "-o"])
            .arg(folder.path()),
        1,
    );
    assert!(missing.contains("missing.relight"), "{missing}");
}

/// Only what is asked for is read: damage elsewhere is not even seen, damage in it is.
#[test]
fn points_are_exported_from_a_file_whose_links_are_damaged() {
    let folder = folder();
    let broken = with_broken_links(folder.path(), |links| links[5] ^= 1);
    export(&broken, "points", &folder.path().join("points"));
    let out = folder.path().join("links");
    let text = complaint(
        relight()
            .arg("export")
            .arg(&broken)
            .args(["--what", "links", "-o"])
            .arg(&out),
        1,
    );
    assert!(
        text.contains("links_transfer") && text.contains("checksum"),
        "{text}"
    );
    // The reference integrators need no links either.
    relight()
        .arg("play")
        .arg(&broken)
        .args(["--integrator", "path", "--spp", "1", "--size", "16x16", "-o"])
        .arg(folder.path().join("frame.exr"))
        .assert()
        .success();
}

/// Truth: the frames that play makes of the same light, and numpy alone: the example of README.txt is run as it stands there.
#[test]
fn a_point_cloud_and_its_example_make_a_pixel_again() {
    let folder = folder();
    let lights = sequence(folder.path(), "lamp.json", crate::stage::TINY_LIGHT);
    let out = folder.path().join("cloud");
    let mut run = relight();
    run.arg("export")
        .arg(cornell())
        .args(["--what", "point-cloud", "--lights"]);
    run.arg(&lights)
        .arg("-o")
        .arg(&out)
        .arg("--json")
        .assert()
        .success();
    let normals = floats(&out.join("normals.npy"));
    let [albedo, radiance, direct, indirect] =
        ["albedo", "radiance", "irradiance_direct", "irradiance_indirect"]
            .map(|name| floats(&out.join(format!("{name}.npy"))));
    assert_eq!(
        npy(&out.join("irradiance_direct.npy")).1,
        [1, normals.len() / 3, 3]
    );
    let mut lit = 0;
    for i in 0..radiance.len() {
        let expected = (direct[i] + indirect[i]) * albedo[i] / std::f32::consts::PI;
        assert!((radiance[i] - expected).abs() <= 1e-5 * expected.abs() + 1e-9);
        lit += usize::from(indirect[i] > 0.0);
    }
    assert!(lit > radiance.len() / 2);

    let readme = std::fs::read_to_string(out.join("README.txt")).unwrap();
    assert!(
        readme.contains("irradiance_indirect.npy") && readme.contains("\"lamp\""),
        "{readme}"
    );
    let script = &readme[readme.find("import sys").unwrap()..];
    std::fs::write(out.join("example.py"), script).unwrap();
    let python = std::env::var_os("RELIGHT_PYTHON").unwrap_or_else(|| "python3".into());
    let ready = std::process::Command::new(&python)
        .args(["-c", "import numpy"])
        .output();
    if !ready.is_ok_and(|output| output.status.success()) {
        eprintln!("no Python with numpy: the example is not run; name one by RELIGHT_PYTHON");
        return;
    }
    // The back wall of the Cornell box, whose pixels' rays are known.
    let frame = folder.path().join("frame.exr");
    let mut play = relight();
    play.arg("play")
        .arg(cornell())
        .arg("--lights")
        .arg(&lights)
        .arg("-o")
        .arg(&frame);
    play.args([
        "--layers",
        "indirect,albedo,normal,depth",
        "--float",
        "--spp",
        "1",
        "--size",
        "40x40",
    ]);
    play.assert().success();
    let layers = relight_scene::image::read_exr(&frame, &Default::default()).unwrap();
    let [shown, reflectance, facing] =
        ["indirect", "albedo", "normal"].map(|name| layers.rgb(name).unwrap().pixels);
    let along = &layers.layer("depth.ray").unwrap().data;
    let player = relight_play::Player::open(cornell()).unwrap();
    let camera = player.scene().cameras[0].at(0.0);
    let mut tried = 0;
    for (x, y) in [(20, 22), (14, 16), (25, 12), (18, 27), (22, 18)] {
        let pixel = y * 40 + x;
        let direction = camera.direction(
            glam::Vec2::new(x as f32 + 0.5, y as f32 + 0.5),
            glam::Vec2::splat(40.0),
        );
        let place = camera.position + direction * along[pixel];
        // Where points of other facing have a say, vector irradiance is turned.
        if camera.forward.dot(Vec3::from(facing[pixel])) > -0.999 {
            continue;
        }
        let numbers = [place, Vec3::from(facing[pixel])].map(|v| v.to_array().map(|c| c.to_string()));
        let output = std::process::Command::new(&python)
            .arg("example.py")
            .args(numbers.as_flattened())
            .current_dir(&out)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let said = String::from_utf8(output.stdout).unwrap();
        let line = said
            .lines()
            .find_map(|line| line.strip_prefix("indirect "))
            .unwrap();
        for (channel, number) in line.split(' ').enumerate() {
            let irradiance: f32 = number.parse().unwrap();
            let made = irradiance * reflectance[pixel][channel] / std::f32::consts::PI;
            let seen = shown[pixel][channel];
            assert!(
                (made - seen).abs() <= 0.002 * seen,
                "{x} {y} {channel}: {made} {seen}"
            );
        }
        tried += 1;
    }
    assert!(tried >= 3, "{tried} pixels on the back wall");
}

#[test]
fn lights_are_for_point_clouds_alone() {
    let folder = folder();
    let mut run = relight();
    run.arg("export")
        .arg(cornell())
        .args(["--what", "points", "--frame", "3", "-o"])
        .arg(folder.path());
    assert!(complaint(&mut run, 2).contains("--what point-cloud"));
    let mut run = relight();
    run.arg("export")
        .arg(cornell())
        .args(["--what", "point-cloud", "--grid", "2,2,2", "-o"])
        .arg(folder.path());
    assert!(complaint(&mut run, 2).contains("irradiance-volume"));
    for grid in ["2,2", "0,1,1", "a,b,c", "2048,2048,2048"] {
        let mut run = relight();
        run.arg("export").arg(cornell());
        run.args(["--what", "irradiance-volume", "--grid", grid, "-o"])
            .arg(folder.path());
        let said = run.assert().code(2).get_output().stderr.clone();
        assert!(String::from_utf8(said).unwrap().contains("16,8,16"), "{grid}");
    }
    let mut run = relight();
    let lights = sequence(folder.path(), "lamp.json", crate::stage::TINY_LIGHT);
    run.arg("export")
        .arg(cornell())
        .args(["--what", "point-cloud", "--frame", "3", "--lights"])
        .arg(lights);
    run.arg("-o").arg(folder.path().join("out"));
    assert!(complaint(&mut run, 2).contains("frames 0 to 0"));
}

/// Truth: in a closed room whose walls have albedo 1/2 and emit radiance 1, radiance is 2 everywhere in every direction: the first
/// coefficient is 2 √(4π), all others are 0, and every face of every cube is 2.
#[test]
fn an_irradiance_volume_holds_the_light_of_a_furnace() {
    let folder = folder();
    let file = furnace(folder.path());
    let out = folder.path().join("volume");
    let mut run = relight();
    run.arg("export")
        .arg(&file)
        .args(["--what", "irradiance-volume", "--grid", "2,3,4", "-o"])
        .arg(&out);
    run.arg("--lights").arg(data("furnace.lights.json")).arg("--json");
    let said = json(&run.assert().success().get_output().stdout);
    assert_eq!(said["facts"]["grid"], serde_json::json!([2, 3, 4]));
    assert_eq!(npy(&out.join("sh.npy")).1, [4, 3, 2, 9, 3]);
    for light in floats(&out.join("sh.npy")).chunks(27) {
        for (i, value) in light.iter().enumerate() {
            let expected = if i < 3 {
                2.0 * (4.0 * std::f32::consts::PI).sqrt()
            } else {
                0.0
            };
            assert!((value - expected).abs() < 0.02 * 7.09, "{i}: {value}");
        }
    }
    assert!(floats(&out.join("open.npy")).iter().all(|&open| open == 1.0));
    assert_eq!(npy(&out.join("ambient_cubes.npy")).1, [12, 6, 2, 3]);
    let cubes = floats(&out.join("ambient_cubes.npy"));
    // Of this coarse bake, whose points receive 3 % too little indirect light, which is a quarter of all.
    assert!(cubes.iter().all(|light| (light - 2.0).abs() < 0.06), "{cubes:?}");
    let mean = cubes.iter().sum::<f32>() / cubes.len() as f32;
    assert!((mean - 2.0).abs() < 0.03, "{mean}");

    // The texture is of the size that Bevy takes, and holds the same numbers.
    let texture = std::fs::read(out.join("ambient_cubes.ktx2")).unwrap();
    let word = |at: usize| u32::from_le_bytes(texture[at..at + 4].try_into().unwrap());
    assert_eq!(&texture[..12], b"\xabKTX 20\xbb\r\n\x1a\n");
    // R16G16B16A16_SFLOAT, 2 x 6 x 12.
    assert_eq!([12, 20, 24, 28].map(word), [97, 2, 6, 12]);
    let start = word(80) as usize;
    assert_eq!(texture.len(), start + 8 * 2 * 6 * 12);
    let halves: Vec<f32> = texture[start..]
        .chunks(2)
        .map(|b| half_of(u16::from_le_bytes([b[0], b[1]])))
        .collect();
    for (texel, light) in halves.chunks(4).zip(cubes.chunks(3)) {
        assert!(
            texel[3] == 1.0 && (0..3).all(|c| (texel[c] - light[c]).abs() < 2e-3),
            "{texel:?} {light:?}"
        );
    }
}

/// Truth: in the Cornell box light comes from the lamp above, and from the red wall at large X and the green one at small X.
#[test]
fn an_irradiance_volume_tells_where_light_comes_from() {
    let folder = folder();
    let (asset, out) = (
        folder.path().join("cornell.relight"),
        folder.path().join("volume"),
    );
    bake_json(
        &data("cornell.glb"),
        &asset,
        &["--preset", "draft", "--levels", "3"],
    );
    let mut run = relight();
    run.arg("export")
        .arg(&asset)
        .args(["--what", "irradiance-volume", "--grid", "3,3,3", "-o"]);
    run.arg(&out).arg("--lights").arg(data("cornell.lights.json"));
    run.assert().success();
    let cubes = floats(&out.join("ambient_cubes.npy"));
    // Axis, then behind or ahead of the place along it: +x, -x, +y, -y, +z, -z of 27 places, the 14th of which is in the middle.
    let face = |axis: usize, negative: usize| {
        let (nx, ny, nz) = (3, 3, 3);
        let (x, y, z) = (1, 1, 1);
        let texel = ((axis * nz + z) * 2 * ny + negative * ny + y) * nx + x;
        [0, 1, 2].map(|channel| cubes[3 * texel + channel])
    };
    let [up, down] = [face(1, 0), face(1, 1)];
    assert!(up[1] > 2.0 * down[1] && down[1] > 0.0, "{up:?} {down:?}");
    let redness = |light: [f32; 3]| light[0] / light[1];
    let [to_red, to_green] = [face(0, 0), face(0, 1)];
    assert!(
        redness(to_red) > 1.5 * redness(to_green),
        "{to_red:?} {to_green:?}"
    );
}

/// A square alone has no depth: its box is given some.
#[test]
fn an_irradiance_volume_of_a_square_has_places_before_it() {
    let folder = folder();
    let (asset, out) = (folder.path().join("square.relight"), folder.path().join("volume"));
    bake_json(
        &gltf(folder.path(), &SQUARE),
        &asset,
        &["--preset", "draft", "--levels", "2"],
    );
    let sun = r#"{ "relight_sequence": 1, "frames": 1, "lights": [
        { "name": "sun", "type": "directional", "direction": [0, 0, -1], "irradiance": [3, 3, 3] } ] }"#;
    let lights = sequence(folder.path(), "sun.json", sun);
    let mut run = relight();
    run.arg("export")
        .arg(&asset)
        .args(["--what", "irradiance-volume", "--grid", "1,1,2", "-o"]);
    run.arg(&out).arg("--lights").arg(&lights).assert().success();
    let cubes = floats(&out.join("ambient_cubes.npy"));
    // Three axes of two places of two faces; of the place before the square the face that looks at it.
    let lit = cubes[3 * ((2 * 2 + 1) * 2 + 1)];
    assert!(lit > 0.1, "{cubes:?}");
}

/// A normal number of half precision.
fn half_of(bits: u16) -> f32 {
    let exponent = f32::from(bits >> 10 & 31) - 15.0;
    (1.0 + f32::from(bits & 1023) / 1024.0) * exponent.exp2()
}
