//! Links that are made part by part, to take less memory.

use crate::stage::{Silent, bake_file, data};
use relight_bake::error::BakeError;
use relight_bake::params::{BakeParams, Preset};
use relight_bake::units::folder::UnitFolder;
use relight_bake::units::{Ledger, UnitStore};
use relight_bake::{Request, bake_in_units};
use relight_format as format;
use relight_format::unit::{Column, UnitName};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::traced::Shading;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts the units that are found.
struct Counted<'a>(UnitFolder<'a>, AtomicUsize);

impl UnitStore for Counted<'_> {
    fn load(&self, name: &UnitName) -> Option<Vec<Column>> {
        let found = self.0.load(name)?;
        self.1.fetch_add(1, Ordering::Relaxed);
        Some(found)
    }
    fn save(&self, name: &UnitName, columns: &[Column]) -> Result<(), BakeError> {
        self.0.save(name, columns)
    }
}

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
    let units = Counted(units, AtomicUsize::new(0));
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
    let found = units.1.load(Ordering::Relaxed);
    assert!(
        found > rows,
        "{found} of {rows}: a batch takes what another made, and the last takes all"
    );
    assert_eq!(ledger.counts().0, 0, "what this bake made itself is no reuse");
    assert!(format::write_asset(&baked.asset).unwrap() == format::write_asset(&wanted).unwrap());
}
