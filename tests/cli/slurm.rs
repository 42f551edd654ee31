//! The job scripts of `--slurm`, on a real Slurm of two nodes on this machine.
#![cfg(target_os = "linux")]

use crate::stage::{bake_json, data, folder};
use std::path::Path;
use std::process::Command;

/// Skipped, loudly, where Slurm is not installed or cannot run; with RELIGHT_SLURM_REQUIRED=1 that is a failure.
#[test]
fn a_job_array_and_its_merge_give_the_asset_of_one_go() {
    let options = ["--levels", "4", "--sender-levels", "2", "--coarse-radius", "0.06"];
    let folder = folder();
    let scene = data("cornell.glb");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/slurm/cluster.sh");
    let mut cluster = Command::new(script);
    cluster
        .arg(env!("CARGO_BIN_EXE_relight"))
        .arg(&scene)
        .arg(folder.path())
        .args(options);
    let output = cluster.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.code() == Some(77) {
        assert!(std::env::var_os("RELIGHT_SLURM_REQUIRED").is_none(), "{said}");
        eprintln!("SKIPPED: the job scripts are NOT tested: {said}");
        return;
    }
    assert!(output.status.success(), "{said}");
    assert!(said.contains("requeued"), "{said}");
    println!("{said}");
    let asset = folder.path().join("one.relight");
    bake_json(&scene, &asset, &options);
    let bytes = |path: &Path| std::fs::read(path).unwrap();
    assert!(
        bytes(&asset) == bytes(&folder.path().join("farm.relight")),
        "{said}"
    );
}
