//! Small files with the faults that people's files have.

use crate::light::{Reference, View, relit, without_emission};
use crate::numbers::{fixed, whole};
use crate::page::{Page, Table};
use crate::program::{Baked, FOLDER, Result, SHARED, absent};
use std::path::Path;

/// Scenes of `../shared/field`, and what its README says of them at commit 2bec939.
pub const FIELD: [(&str, &str); 14] = [
    ("base", "bake 62 s, 181 k points, 0.66 M links"),
    ("plane1000", "indirect −37 %, 2,797 links"),
    ("dome500", "indirect −41 %, bake 114 s"),
    ("stray1k", "indirect −2.5 %"),
    ("bulbs16", "direct relMSE 0.55"),
    ("tv", "direct +23 %, fireflies, blotches"),
    ("facade_tex", "noise"),
    ("facade_geo", "clean"),
    ("g0", "–"),
    ("g4e5", "distorted"),
    ("g4e6", "broken"),
    ("room_backmat", "speckle, two to five times too dark"),
    ("chair", "indirect −23 %, splotches"),
    ("yard", "–"),
];

const SIZE: [usize; 2] = [160, 120];
/// Samples a pixel of each of two path tracings: some ten seconds on two cores.
const SPP: u32 = 256;

/// A scene in standard against our own path tracer.
pub fn field(page: &mut Page, name: &str, before: &str) -> Result<()> {
    let scene = format!("{SHARED}/field/{name}.gltf");
    if let Some(why) = absent([&*scene]) {
        return page.without(&[Table::Field], name, &why);
    }
    let sequence = format!("{SHARED}/field/{name}.seq.json");
    let baked = Baked::new(&scene, format!("{FOLDER}/field_{name}.relight"), "")?;
    let view = View {
        asset: &baked.asset,
        lights: Path::new(&sequence).exists().then_some(&*sequence),
        size: SIZE,
    };
    let lit = relit(view, 0)?;
    let reference = Reference::traced(view, SPP, without_emission)?;
    let [direct, indirect, _] = reference.distances(&without_emission(&lit.layers)?)?;
    let mut cells = vec![
        name.to_owned(),
        fixed(baked.number("/seconds/total"), 1),
        whole(baked.points()),
        whole(baked.links()),
        fixed(lit.first, 2),
    ];
    cells.extend(direct.cells());
    cells.extend(indirect.cells());
    let pixels = reference.parts[2].pixels.as_flattened();
    let mean = pixels.iter().map(|&x| f64::from(x)).sum::<f64>() / pixels.len() as f64;
    cells.extend([fixed(mean, 4), before.into()]);
    page.row(Table::Field, &cells)
}
