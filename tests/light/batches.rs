//! Links that are made part by part, to take less memory.

use crate::stage::{Silent, bake_file, data};
use relight_bake::params::{BakeParams, Preset};
use relight_bake::units::Ledger;
use relight_bake::units::folder::UnitFolder;
use relight_bake::{Request, bake_in_units};
use relight_format as format;
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::traced::Shading;
use std::sync::Arc;

/// Truth: the bake in one go. Each batch makes the rows that it needs and forgets the others; what was forgotten is taken
/// from its unit.
#[test]
fn links_made_in_batches_are_those_of_one_go() {
    let params = BakeParams {
        levels: 5,
        sender_levels: 3,
        coarse_radius: Some(0.13),
        rays: 400,
        ..BakeParams::preset(Preset::Draft)
    };
    let wanted = bake_file(&data("cornell.glb"), &params);
    let scene = Arc::new(import(&data("cornell.glb"), &ImportOptions::default()).unwrap());
    let folder = tempfile::tempdir().unwrap();
    let units = UnitFolder::open(folder.path(), &|note| panic!("{note}")).unwrap();
    let ledger = Ledger::new(&units, 0);
    let request = Request {
        scene,
        shading: Shading::Lambert,
        params: &params,
        lights: None,
        source_hash: 0,
        batches: 3,
    };
    let baked = bake_in_units(&request, Some(&ledger), &Silent).unwrap();
    let rows = std::fs::read_dir(folder.path()).unwrap().flatten();
    let rows = rows.filter(|file| file.file_name().to_string_lossy().starts_with("refine"));
    let rows = rows.count();
    assert!(rows > params.levels, "{rows} ranges: some level is in several");
    assert!(ledger.counts().0 > 0, "a batch takes what another made");
    assert!(format::write_asset(&baked.asset).unwrap() == format::write_asset(&wanted).unwrap());
}
