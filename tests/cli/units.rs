//! Bakes in units: what is kept is taken again, only where it is right, and the asset is that of one go, byte by byte.

use crate::stage::{
    TINY, bake_json, complaint, cornell, data, edited, folder, json, names, relight, send, sequence,
};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// A bake with all stages, in some dozens of units, in a second or two.
const ALL: [&str; 12] = [
    "--levels",
    "4",
    "--sender-levels",
    "2",
    "--coarse-radius",
    "0.1",
    "--cuts",
    "environment",
    "--cut-lights",
    "256",
    "--solution",
    "--lambert",
];

const KEEP: [&str; 2] = ["--resume", "--keep-units"];

/// The asset that `ALL` gives in one go.
fn in_one_go(folder: &Path, scene: &Path, options: &[&str]) -> Vec<u8> {
    let asset = folder.join("in_one_go.relight");
    bake_json(scene, &asset, options);
    std::fs::read(asset).unwrap()
}

/// Units of a bake, and how many of them were there.
fn units(said: &Value) -> (u64, u64) {
    let number = |key: &str| said["units"][key].as_u64().unwrap();
    (number("all"), number("reused"))
}

#[test]
fn a_bake_that_keeps_units_gives_the_same_bytes_and_leaves_none_behind() {
    let folder = folder();
    let scene = data("cornell.glb");
    let wanted = in_one_go(folder.path(), &scene, &ALL);
    let asset = folder.path().join("kept.relight");
    let said = bake_json(&scene, &asset, &[&ALL[..], &["--resume"]].concat());
    let (all, reused) = units(&said);
    assert!(all > 10 && reused == 0, "{all} {reused}");
    assert!(std::fs::read(&asset).unwrap() == wanted);
    let left = names(folder.path());
    assert!(
        !left
            .iter()
            .any(|name| name.contains("units") || name.contains("lock")),
        "{left:?}"
    );
}

#[test]
fn damaged_units_are_noticed_and_made_anew_and_all_others_are_taken() {
    let folder = folder();
    let scene = data("cornell.glb");
    let wanted = in_one_go(folder.path(), &scene, &ALL);
    let asset = folder.path().join("kept.relight");
    let options = [&ALL[..], &KEEP].concat();
    let (all, _) = units(&bake_json(&scene, &asset, &options));
    let (again, reused) = units(&bake_json(&scene, &asset, &options));
    assert_eq!((again, reused), (all, all));

    let kept = folder.path().join("kept.relight.units");
    let files = names(&kept);
    assert_eq!(files.len() as u64, all);
    // One of each stage is flipped in the middle or cut short, in turn.
    let mut stages = std::collections::BTreeMap::new();
    for name in &files {
        stages.entry(name.split('-').next().unwrap()).or_insert(name);
    }
    assert_eq!(
        stages.keys().copied().collect::<Vec<_>>(),
        [
            "cuts",
            "importance",
            "light_tree",
            "pilots",
            "points",
            "refine",
            "solution"
        ]
    );
    for (i, name) in stages.values().enumerate() {
        let mut bytes = std::fs::read(kept.join(name)).unwrap();
        let middle = bytes.len() / 2;
        if i % 2 == 0 {
            bytes[middle] ^= 4;
        } else {
            bytes.truncate(middle);
        }
        std::fs::write(kept.join(name), bytes).unwrap();
    }
    let mut bake = relight();
    bake.arg("bake")
        .arg(&scene)
        .arg("-o")
        .arg(&asset)
        .args(&options)
        .arg("--json");
    let output = bake.assert().success().get_output().clone();
    let damaged = stages.len() as u64;
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(said.matches("computed anew").count() as u64, damaged, "{said}");
    assert_eq!(units(&json(&output.stdout)), (all, all - damaged));
    assert!(std::fs::read(&asset).unwrap() == wanted);
}

/// What kept units hold, each with its stage, without the hash of what they were made from and the cells that rays passed.
fn contents(asset: &Path) -> Vec<(String, Vec<u8>)> {
    let mut folder = asset.as_os_str().to_owned();
    folder.push(".units");
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|e| e == "unit"))
        .map(|path| {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let stage = name.split('-').next().unwrap();
            // A magic number of 8 bytes, the stage and its length, a hash, a range; at the end 32³ bits and a hash of what is
            // there, and a checksum.
            let bytes = std::fs::read(&path).unwrap();
            let end = bytes.len() - (32usize.pow(3) / 8 + 16) - 8;
            (stage.to_owned(), bytes[8 + 1 + stage.len() + 16..end].to_vec())
        })
        .collect()
}

/// What edits reach: lights and colours no unit that casts rays, a moved object all that do.
#[test]
fn an_edit_bakes_only_what_it_reaches() {
    let folder = folder();
    let scene = folder.path().join("scene.glb");
    std::fs::copy(data("cornell.glb"), &scene).unwrap();
    let asset = folder.path().join("a.relight");
    let solved = [&ALL[..], &KEEP].concat();
    let unsolved: Vec<&str> = solved.iter().copied().filter(|o| *o != "--solution").collect();
    let (all, _) = units(&bake_json(&scene, &asset, &solved));

    let lights = sequence(
        folder.path(),
        "l.json",
        r#"{"relight_sequence": 1, "lights": [{"name": "p", "type": "point", "position": [0.3, 0.3, 0.1],
            "intensity": [1, 1, 1]}]}"#,
    );
    let lit = [&solved[..], &["--lights", lights.to_str().unwrap()]].concat();
    assert_eq!(
        units(&bake_json(&scene, &asset, &lit)),
        (all, all),
        "lights reach no unit"
    );

    let paint = |json: &mut Value| {
        let material = &mut json["materials"][1];
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([0.2, 0.3, 0.4, 1.0]);
        material["emissiveFactor"] = json!([0.1, 0.1, 0.1]);
    };
    edited(&data("cornell.glb"), &scene, paint);
    let (of, reused) = units(&bake_json(&scene, &asset, &unsolved));
    assert_eq!(of, reused, "colours reach points' albedo alone");
    let wanted = in_one_go(folder.path(), &scene, &unsolved);
    assert!(std::fs::read(&asset).unwrap() == wanted, "and are in the asset");

    let paint_and_move = |json: &mut Value| {
        paint(json);
        let nodes = json["nodes"].as_array_mut().unwrap();
        let node = nodes.iter_mut().rfind(|n| n.get("mesh").is_some()).unwrap();
        node.as_object_mut().unwrap().remove("matrix");
        node["translation"] = json!([0.01, 0.0, 0.0]);
    };
    let before = contents(&asset);
    let twin = folder.path().join("twin.relight");
    bake_json(&scene, &twin, &unsolved);
    for unit in contents(&twin) {
        assert!(
            before.contains(&unit),
            "{}: the same scene gives the same",
            unit.0
        );
    }
    edited(&data("cornell.glb"), &scene, paint_and_move);
    let (of, reused) = units(&bake_json(&scene, &asset, &unsolved));
    assert_eq!(reused, 0, "importance that meets the object comes by everywhere");
    let after = contents(&asset);
    assert_eq!(after.len() as u64, of);
    for unit in &after {
        assert!(!before.contains(unit), "{}: baked anew for nothing", unit.0);
    }
    let wanted = in_one_go(folder.path(), &scene, &unsolved);
    assert!(std::fs::read(&asset).unwrap() == wanted);
}

/// A box within the tall block of the Cornell box, where no ray comes, moved there; then moved out of it. Cuts' rays are not
/// followed.
#[test]
fn an_object_moved_where_no_ray_comes_makes_nothing_anew() {
    let folder = folder();
    let scene = folder.path().join("scene.glb");
    let asset = folder.path().join("a.relight");
    let options = [&ALL[..], &KEEP].concat();
    let bake_with_box_at = |place: [f32; 3]| {
        edited(&data("cornell.glb"), &scene, |json| {
            let nodes = json["nodes"].as_array_mut().unwrap();
            let mesh = nodes.iter().find(|n| n["name"] == "Short block").unwrap()["mesh"].clone();
            nodes.push(json!({"mesh": mesh, "translation": place, "scale": [0.1, 0.1, 0.1]}));
            let added = nodes.len() - 1;
            json["scenes"][0]["nodes"]
                .as_array_mut()
                .unwrap()
                .push(json!(added));
        });
        let counts = units(&bake_json(&scene, &asset, &options));
        assert!(std::fs::read(&asset).unwrap() == in_one_go(folder.path(), &scene, &options[..ALL.len()]));
        let of_cuts = contents(&asset);
        let of_cuts = of_cuts.iter().filter(|u| u.0 == "cuts" || u.0 == "light_tree");
        (counts.0 - of_cuts.count() as u64, counts.1)
    };
    let within = bake_with_box_at([0.35, 0.15, 0.334]);
    assert!(within.0 > 10 && within.1 == 0, "{within:?}");
    let moved = bake_with_box_at([0.36, 0.14, 0.344]);
    assert_eq!(moved, (within.0, within.0), "all but cuts: no ray comes there");
    let outside = bake_with_box_at([0.1, 0.4, 0.3]);
    assert_eq!(outside.1, 0, "rays come here");
}

/// Kills a bake after each of these times; the last may end it.
fn killed_and_resumed(kills: u32, longest: Duration) {
    let folder = folder();
    let scene = data("cornell.glb");
    let wanted = in_one_go(folder.path(), &scene, &ALL);
    let asset = folder.path().join("kept.relight");
    let mut survived = 0;
    let mut random = relight_transport::random::Stream::new(u64::from(kills), 0, 0);
    for i in 0..kills {
        let mut bake = Command::new(env!("CARGO_BIN_EXE_relight"));
        bake.arg("bake")
            .arg(&scene)
            .arg("-o")
            .arg(&asset)
            .args(ALL)
            .args(KEEP)
            .arg("-q");
        let mut child = bake.stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(longest.mul_f32(random.uniform()));
        let signal = ["-KILL", "-TERM", "-INT", "-KILL"][i as usize % 4];
        let running = child.try_wait().unwrap().is_none();
        if running {
            send(signal, &child);
            survived += 1;
        }
        let code = child.wait().unwrap().code();
        let expected: &[Option<i32>] = match signal {
            "-KILL" => &[None, Some(0)],
            "-TERM" => &[Some(143), Some(0), None],
            _ => &[Some(130), Some(0), None],
        };
        assert!(expected.contains(&code), "{signal}: {code:?}");
        if asset.exists() {
            assert!(std::fs::read(&asset).unwrap() == wanted, "whole after kill {i}");
            if i % 8 == 7 {
                // Begin again, so that all stages are met.
                std::fs::remove_file(&asset).unwrap();
                std::fs::remove_dir_all(folder.path().join("kept.relight.units")).unwrap();
            }
        }
    }
    let said = bake_json(&scene, &asset, &[&ALL[..], &["--resume"]].concat());
    assert!(std::fs::read(&asset).unwrap() == wanted);
    let (all, reused) = units(&said);
    println!("{survived} of {kills} kills hit a running bake; the last one reused {reused} of {all} units");
    assert!(survived * 2 > kills, "kills came too late: {survived} of {kills}");
    let left: Vec<String> = names(folder.path())
        .into_iter()
        .filter(|n| n.contains("kept"))
        .collect();
    assert_eq!(left, ["kept.relight", "kept.relight.log.json"]);
}

#[cfg(unix)]
#[test]
fn a_bake_survives_some_kills() {
    killed_and_resumed(8, Duration::from_millis(600));
}

/// The long loop: cargo test --release --test cli -- --ignored --nocapture a_bake_survives_sixty
#[cfg(unix)]
#[test]
#[ignore = "a minute or two"]
fn a_bake_survives_sixty_kills() {
    killed_and_resumed(60, Duration::from_millis(1500));
}

/// Two bakes at one output: the second says so and goes.
#[cfg(unix)]
#[test]
fn an_output_has_one_bake_at_a_time() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let mut first = Command::new(env!("CARGO_BIN_EXE_relight"));
    first
        .arg("bake")
        .arg(data("atrium.glb"))
        .arg("-o")
        .arg(&asset)
        .arg("-q");
    let mut first = first.spawn().unwrap();
    let lock = folder.path().join(".a.relight.lock");
    while !lock.exists() {
        assert!(first.try_wait().unwrap().is_none(), "it ended before it locked");
        std::thread::sleep(Duration::from_millis(5));
    }
    // Between making the file and locking it passes a moment.
    std::thread::sleep(Duration::from_millis(50));
    let text = complaint(
        relight()
            .arg("bake")
            .arg(data("cornell.glb"))
            .arg("-o")
            .arg(&asset)
            .args(TINY),
        1,
    );
    assert!(
        text.contains("another bake is writing it") && text.contains("a.relight"),
        "{text}"
    );
    first.kill().unwrap();
    first.wait().unwrap();
    assert!(lock.exists(), "a killed bake cannot take its lock away");
    bake_json(&data("cornell.glb"), &asset, &TINY);
    assert!(!lock.exists());
}

/// A plan's folder and the number of its units.
fn planned(folder: &Path, scene: &Path, asset: &Path, options: &[&str]) -> (PathBuf, u64) {
    let plan = folder.join("plan");
    let mut command = relight();
    command.arg("bake").arg(scene).arg("-o").arg(asset).args(options);
    command.arg("--plan").arg(&plan).arg("--json");
    let output = command.assert().success().get_output().clone();
    let units = json(&output.stdout)["units"].as_u64().unwrap();
    assert!(!asset.exists());
    (plan, units)
}

fn unit(plan: &Path, number: u64, of: u64) -> assert_cmd::Command {
    let mut command = relight();
    command
        .arg("bake")
        .arg("--unit")
        .arg(format!("{number}/{of}"))
        .arg(plan);
    command
}

/// Fine enough for a few pieces.
const SHARED: [&str; 10] = [
    "--levels",
    "4",
    "--sender-levels",
    "2",
    "--coarse-radius",
    "0.04",
    "--cuts",
    "environment",
    "--cut-lights",
    "256",
];

#[test]
fn units_in_any_order_merge_to_the_asset_of_one_go() {
    let folder = folder();
    let scene = folder.path().join("scene.glb");
    std::fs::copy(data("cornell.glb"), &scene).unwrap();
    let wanted = in_one_go(folder.path(), &scene, &SHARED);
    let asset = folder.path().join("a.relight");
    let (plan, of) = planned(folder.path(), &scene, &asset, &SHARED);
    assert!(of > 1, "{of}");
    let merge = || {
        let mut merge = relight();
        merge.arg("bake").arg("--merge").arg(&plan);
        merge
    };
    for number in (2..=of).rev() {
        unit(&plan, number, of).assert().success();
    }
    let text = complaint(&mut merge(), 1);
    assert!(text.contains("1 of") && text.contains("--unit I/"), "{text}");
    unit(&plan, 1, of).arg("-q").assert().success();
    unit(&plan, 1, of).assert().success(); // again: nothing to do
    let text = complaint(&mut unit(&plan, 1, of + 1), 2);
    assert!(text.contains("not"), "{text}");
    complaint(&mut unit(&plan, 0, of), 2);
    let output = merge().arg("--json").assert().success().get_output().clone();
    assert!(std::fs::read(&asset).unwrap() == wanted);
    let (all, reused) = units(&json(&output.stdout));
    assert_eq!(all, reused, "merging makes nothing anew");

    // A unit's file is lost all the same: merging makes up for it.
    std::fs::remove_file(&asset).unwrap();
    let files = names(&plan.join("units"));
    let lost = files.iter().rfind(|name| name.starts_with("refine")).unwrap();
    std::fs::remove_file(plan.join("units").join(lost)).unwrap();
    merge().assert().success();
    assert!(std::fs::read(&asset).unwrap() == wanted);

    edited(&data("cornell.glb"), &scene, |json| {
        json["materials"][0]["name"] = "other".into()
    });
    let text = complaint(&mut merge(), 1);
    assert!(text.contains("scene.glb") && text.contains("changed"), "{text}");
    // A unit that is done needs no scene; another one would refuse it.
    std::fs::remove_dir_all(plan.join("done")).unwrap();
    std::fs::create_dir(plan.join("done")).unwrap();
    let text = complaint(&mut unit(&plan, 1, of), 1);
    assert!(
        text.contains("scene.glb") && text.contains("plan again"),
        "{text}"
    );
}

/// What is wrong with a plan is said with its file and place, before anything is read or baked.
#[test]
fn a_plan_that_is_none_is_refused_by_its_place() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let (plan, of) = planned(folder.path(), &data("cornell.glb"), &asset, &TINY);
    let file = plan.join("plan.json");
    let good: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    for (key, value, wanted) in [
        ("relight_plan", json!(7), "version 7, expected 1"),
        ("program", json!("00"), "another build"),
        ("seed", json!("one"), "expected u64 at line"),
        ("units", json!(0), "at line"),
        ("words", json!(["--no-such-option"]), "`words`"),
    ] {
        let mut bad = good.clone();
        bad[key] = value;
        std::fs::write(&file, format!("{bad:#}")).unwrap();
        let text = complaint(&mut unit(&plan, 1, of), 1);
        assert!(
            text.contains("plan.json") && text.contains(wanted) && text.contains("again"),
            "{text}"
        );
    }
}

/// As a farm does it: all at once, some killed, tried again until they are done.
#[cfg(unix)]
#[test]
fn units_at_once_and_killed_at_random_merge_to_the_asset_of_one_go() {
    let folder = folder();
    let scene = data("cornell.glb");
    let wanted = in_one_go(folder.path(), &scene, &SHARED);
    let asset = folder.path().join("a.relight");
    let (plan, of) = planned(folder.path(), &scene, &asset, &SHARED);
    let script = r#"
        try=0
        while [ $try -lt 12 ]; do
            try=$((try + 1))
            # At first no machine is fast enough; later the n-th try may take some n fifths of a second.
            if [ $try -eq 1 ]; then limit=0.02; elif [ $try -gt 8 ]; then limit=60; else limit=0.$((try * (2 + $1 % 3) % 10))1; fi
            timeout -s KILL $limit "$RELIGHT" bake --unit "$1/$OF" "$PLAN" -q && exit 0
            echo killed >> "$PLAN/killed"
        done
        exit 1"#;
    let mut xargs = Command::new("xargs");
    xargs.args(["-P", "3", "-n", "1", "sh", "-c", script, "unit"]);
    xargs.env("RELIGHT", env!("CARGO_BIN_EXE_relight"));
    xargs.env("PLAN", &plan).env("OF", of.to_string());
    let mut xargs = xargs.stdin(Stdio::piped()).spawn().unwrap();
    let numbers: String = (1..=of).rev().map(|n| format!("{n}\n")).collect();
    std::io::Write::write_all(&mut xargs.stdin.take().unwrap(), numbers.as_bytes()).unwrap();
    assert!(xargs.wait().unwrap().success());
    let killed = std::fs::read_to_string(plan.join("killed")).unwrap_or_default();
    println!("{} units, {} kills", of, killed.lines().count());
    assert!(killed.lines().count() > 0, "no unit was killed: mend the times");
    relight().arg("bake").arg("--merge").arg(&plan).assert().success();
    assert!(std::fs::read(&asset).unwrap() == wanted);
}

/// What a bake will take is said before it begins, by a bake that writes nothing.
#[test]
fn a_dry_run_foretells_the_bake() {
    let folder = folder();
    let scene = data("cornell.glb");
    let options = ["--levels", "5", "--sender-levels", "3", "--coarse-radius", "0.2"];
    let asset = folder.path().join("a.relight");
    let mut dry = relight();
    dry.arg("bake").arg(&scene).arg("-o").arg(&asset).args(options);
    let said = json(
        &dry.args(["--dry-run", "--json"])
            .assert()
            .success()
            .get_output()
            .stdout,
    );
    assert!(names(folder.path()).is_empty(), "a dry run writes nothing");
    let baked = bake_json(&scene, &asset, &options);
    let all: u64 = baked["points"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_u64)
        .sum();
    // The small bake of this scene has some hundred points; real ones are within 1.5 (docs/notebook/reliability.md).
    for (key, truth) in [
        ("points", all),
        ("rays", baked["rays"].as_u64().unwrap()),
        ("links", baked["links"].as_u64().unwrap()),
        ("bytes", baked["bytes"]["total"].as_u64().unwrap()),
    ] {
        let ratio = said[key].as_f64().unwrap() / truth as f64;
        assert!((0.5..2.0).contains(&ratio), "{key}: {ratio}");
    }
    assert!(said["seconds"].as_f64().unwrap() > 0.0);

    // The allocator keeps more or less of what is freed, and a small scene hides in that.
    let memory = said["memory_bytes"].as_f64().unwrap() / baked["peak_memory_bytes"].as_f64().unwrap();
    assert!((0.4..2.5).contains(&memory), "{memory}");
}

/// A file system of its own size in a name space of its own; `None`, loudly, where the system allows none. Runs `script`
/// with the folder, the program, the scene, and the options of the bake.
#[cfg(target_os = "linux")]
fn on_a_small_disk(script: &str) -> Option<(Option<i32>, String)> {
    let folder = folder();
    let mut command = Command::new("unshare");
    command.args(["-rm", "sh", "-c", script, "disk"]);
    command
        .arg(folder.path())
        .arg(env!("CARGO_BIN_EXE_relight"))
        .arg(data("cornell.glb"));
    command.args(TINY);
    let output = command.output().ok()?;
    let text = String::from_utf8(output.stderr).unwrap();
    if matches!(output.status.code(), Some(99) | None) || text.contains("unshare") {
        eprintln!("SKIPPED: this system lets the test mount no small file system ({text})");
        return None;
    }
    Some((output.status.code(), text))
}

/// Full after every 8 KiB from none on: an error that says so, no asset and no half unit; with more room the same command
/// goes on.
#[cfg(target_os = "linux")]
#[test]
fn a_disk_that_fills_up_between_units_is_an_error_from_which_a_bake_goes_on() {
    let script = r#"
        dir=$1; program=$2; scene=$3; shift 3
        mount -t tmpfs -o size=64m none "$dir" || exit 99
        "$program" bake "$scene" -o "$dir/whole.relight" -q "$@" || exit 98
        mkdir "$dir/small"
        full=0
        for size in 4k 8k 12k 16k 24k 32k 48k 64k 96k 128k 192k 256k; do
            mount -t tmpfs -o size=$size none "$dir/small" || exit 99
            if "$program" bake "$scene" -o "$dir/small/a.relight" --resume --force -q "$@" 2> "$dir/said"; then
                echo "$size is enough" >&2
            else
                code=$?
                [ $code = 1 ] || exit 10
                grep -q "small" "$dir/said" || { cat "$dir/said" >&2; exit 11; }
                grep -q "o space left" "$dir/said" || { cat "$dir/said" >&2; exit 12; }
                [ ! -e "$dir/small/a.relight" ] || exit 13
                [ -z "$(find "$dir/small" -name '*.part')" ] || exit 14
                full=$((full + 1))
                mount -o remount,size=32m "$dir/small" || exit 99
                "$program" bake "$scene" -o "$dir/small/a.relight" --resume -q "$@" || exit 15
            fi
            cmp "$dir/small/a.relight" "$dir/whole.relight" || exit 16
            umount "$dir/small"
        done
        echo "full $full times" >&2
        [ $full -ge 4 ] || exit 17
        # A disk that may only be read.
        mount -o remount,ro "$dir" || exit 99
        "$program" bake "$scene" -o "$dir/b.relight" --resume -q "$@"
        [ $? = 1 ] || exit 18
        exit 0"#;
    let Some((code, text)) = on_a_small_disk(script) else {
        return;
    };
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("cannot") && text.contains("b.relight"), "{text}");
}

/// Clocks only measure: with one that stands, jumps, or runs backwards the asset is the same.
#[cfg(target_os = "linux")]
#[test]
fn a_clock_that_jumps_changes_nothing() {
    let folder = folder();
    let asset = folder.path().join("a.relight");
    let mut bake = Command::new("unshare");
    // A year into a name space's own time.
    bake.args(["-rT", "--boottime", "31536000", "--monotonic", "31536000"]);
    bake.arg(env!("CARGO_BIN_EXE_relight"));
    bake.arg("bake")
        .arg(data("cornell.glb"))
        .arg("-o")
        .arg(&asset)
        .args(TINY)
        .arg("--resume");
    let output = bake.output();
    let Some(output) = output.ok().filter(|o| o.status.success()) else {
        eprintln!("SKIPPED: this system lets the test have no time of its own");
        return;
    };
    assert!(output.status.success());
    assert!(std::fs::read(&asset).unwrap() == std::fs::read(cornell()).unwrap());
}
