//! Statistics of each scene of `data/`, one line per scene in `tests/golden.txt`: a change of the bake shows in
//! review. Write the file anew with
//! `cargo test --release --test light -- --ignored write_golden`.

use crate::stage::{bake_file, data, light, mean, shot, through_file};
use relight_bake::params::{BakeParams, Preset};
use std::path::{Path, PathBuf};

/// Scene and lights.
const SCENES: [(&str, &str); 7] = [
    ("cornell", "cornell"),
    ("furnace_sphere", "furnace"),
    ("furnace_box", "furnace"),
    ("furnace_varying", "furnace_varying"),
    ("atrium", "atrium_point"),
    ("two_rooms", "two_rooms_near"),
    ("table", "table_spot"),
];

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden.txt")
}

fn line((scene, sequence): (&str, &str)) -> String {
    let params = BakeParams {
        levels: 3,
        ..BakeParams::preset(Preset::Draft)
    };
    let asset = bake_file(&data(&format!("{scene}.glb")), &params);
    let points: Vec<String> = (asset.points.iter())
        .map(|l| l.positions.len().to_string())
        .collect();
    let links = asset.transfer.as_ref().map_or(0, |t| t.columns.len());
    let bounce = asset.bounce.as_ref().map_or(0, |b| b.matrix.columns.len());
    let player = through_file(&asset);
    let tracks = crate::stage::lights(&format!("{sequence}.lights.json")).lights;
    let indirect = mean(&light(&player, &shot(&player, 32), &tracks, false).indirect);
    format!(
        "{scene} {sequence} points {} links {links} bounce {bounce} indirect {:.7e} {:.7e} {:.7e}",
        points.join(","),
        indirect.x,
        indirect.y,
        indirect.z
    )
}

/// Counts are deterministic on one architecture; means may differ by the rounding of some library function:
/// 1e-5.
#[test]
fn every_scene_has_its_statistics() {
    let golden = std::fs::read_to_string(file()).unwrap();
    let golden: Vec<&str> = golden.lines().collect();
    assert_eq!(golden.len(), SCENES.len(), "one line per scene");
    for (scene, golden) in SCENES.into_iter().zip(golden) {
        let found = line(scene);
        let parts = |line: &str| {
            let (counts, means) = line.split_once(" indirect ").unwrap();
            let means: Vec<f64> = means.split(' ').map(|v| v.parse().unwrap()).collect();
            (counts.to_owned(), means)
        };
        let ((found_counts, found_means), (counts, means)) = (parts(&found), parts(golden));
        let same = found_means
            .iter()
            .zip(&means)
            .all(|(a, b)| (a - b).abs() <= 1e-5 * b.abs());
        let counts_agree = found_counts == counts || cfg!(not(target_arch = "x86_64"));
        assert!(
            counts_agree && same,
            "found {found}\ngolden {golden}\nif this is meant: cargo test --release --test light -- --ignored write_golden"
        );
    }
}

#[test]
#[ignore = "writes tests/golden.txt"]
fn write_golden() {
    let lines: String = SCENES.into_iter().map(|s| line(s) + "\n").collect();
    std::fs::write(file(), lines).unwrap();
}
