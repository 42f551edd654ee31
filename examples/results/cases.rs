//! Scenes and lights with a reference: of our own path tracer, or of another renderer.

use crate::light::{Parts, Reference, View, parts, relit, with_emission};
use crate::numbers::{fixed, percent, signed, whole, within};
use crate::page::{FRAMES, Page, Table};
use crate::program::{Baked, FOLDER, Result, SHARED, absent, number};
use relight_scene::image::preview::{contact_sheet, display_encoded, pbr_neutral};
use relight_scene::image::{Limits, error_map, read_exr, write_png};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

const CUTS: &str = "--cuts environment";
/// Where a case that cannot run is told.
const BOTH: [Table; 2] = [Table::Errors, Table::Estimates];

type Own = (&'static str, &'static str, &'static str, [usize; 2], u32);

/// Name of the lights, options of the bake, scene, size, samples a pixel of each of two path tracings, which take some ten
/// seconds on two cores, the first half a minute: it is the README's picture.
pub const OWN: [Own; 6] = [
    ("atrium_point", "", "atrium.glb", [480, 270], 96),
    ("cornell", "", "cornell.glb", [180, 180], 256),
    ("table", "", "table.glb", [240, 135], 128),
    ("atrium_sun", CUTS, "atrium.glb", [240, 135], 128),
    ("two_rooms_near", "", "two_rooms.glb", [240, 135], 128),
    ("isosurface", "", "isosurface.scene.json", [160, 128], 96),
];

/// Names of references in `../shared`, in which all surfaces are matt.
pub const OTHERS: [&str; 9] = [
    "sponza_dabrovic_point",
    "sponza_dabrovic_sun",
    "sponza_crytek_point",
    "sibenik_points",
    "modern_hall_emissive",
    "pbr_table_panel",
    "white_room",
    "country_kitchen",
    "stanford_bunny_env",
];

/// What is baked and played.
struct Case {
    name: &'static str,
    scene: String,
    options: String,
    lights: String,
    size: [usize; 2],
}

/// Standard assets, each baked once.
#[derive(Default)]
pub struct Cases(BTreeMap<String, Baked>);

impl Cases {
    /// A case against the mean of two path tracings.
    pub fn own(&mut self, page: &mut Page, &(name, options, scene, size, spp): &Own) -> Result<()> {
        let case = Case {
            name,
            scene: format!("data/{scene}"),
            options: options.into(),
            lights: format!("data/{name}.lights.json"),
            size,
        };
        if let Some(why) = absent([&*case.scene, &case.lights]) {
            return page.without(&BOTH, name, &why);
        }
        let baked = self.baked(page, &case)?;
        let image = case.played(page, &baked)?;
        let reference = Reference::traced(case.view(&baked), spp, with_emission)?;
        case.judged(page, &baked, &image, &reference)?;
        draw(&format!("{FOLDER}/{name}.png"), &image, &reference.parts)
    }

    /// A case against an image of another renderer, if it is there.
    pub fn other(&mut self, page: &mut Page, name: &'static str) -> Result<()> {
        let [about, lights, full, indirect] = ["json", "lights.json", "full.exr", "indirect.exr"]
            .map(|suffix| format!("{SHARED}/reference/{name}.{suffix}"));
        if let Some(why) = absent([&*about, &lights, &full, &indirect]) {
            return page.without(&BOTH, name, &why);
        }
        let read =
            |file: &str| read_exr(Path::new(file), &Limits::default()).map_err(|e| format!("{file}: {e}"));
        let said = std::fs::read(&about).map_err(|error| format!("{about}: {error}"))?;
        let said: Value = serde_json::from_slice(&said).map_err(|error| format!("{about}: {error}"))?;
        let text = |key: &str| said[key].as_str().ok_or(format!("{about}: has no {key}"));
        let (full, indirect) = (read(&full)?, read(&indirect)?);
        let case = Case {
            name,
            scene: format!("{SHARED}/scenes/{}", text("scene")?),
            options: format!("--lambert {}", if name.ends_with("_env") { CUTS } else { "" }),
            lights,
            size: [full.width, full.height],
        };
        if let Some(why) = absent([&*case.scene]) {
            return page.without(&BOTH, name, &why);
        }
        let reference = Reference {
            parts: parts(&full, &indirect, "beauty")?,
            noise: ["", "indirect", "full"].map(|of| said[of]["noise_relmse"].as_f64()),
            by: format!(
                "{}, {} samples a pixel",
                text("renderer")?,
                whole(number(said.get("spp")))
            ),
        };
        let baked = self.baked(page, &case)?;
        let image = case.played(page, &baked)?;
        case.judged(page, &baked, &image, &reference)
    }

    /// The asset of a scene, baked once for the same options.
    fn baked(&mut self, page: &mut Page, case: &Case) -> Result<Baked> {
        let scene = Path::new(&case.scene).file_name().unwrap_or_default().display();
        let asset = format!("{FOLDER}/{scene}{}.relight", case.options.replace(' ', ""));
        if let Some(baked) = self.0.get(&asset) {
            return Ok(baked.clone());
        }
        let baked = Baked::new(&case.scene, asset.clone(), &case.options)?;
        let n = |at: &str| baked.number(at);
        let cells = [
            format!("{scene} {}", case.options).trim().into(),
            whole(n("/triangles")),
            whole(baked.points()),
            whole(n("/rays")),
            fixed(n("/seconds/ray_tracing"), 1),
            fixed(n("/seconds/total"), 1),
            whole(baked.links()),
            fixed(n("/bytes/total") / 1e6, 1),
            whole(n("/peak_memory_bytes") / 1e6),
        ];
        page.row(Table::Bakes, &cells)?;
        self.0.insert(asset, baked.clone());
        Ok(baked)
    }
}

impl Case {
    fn view<'a>(&'a self, baked: &'a Baked) -> View<'a> {
        View {
            asset: &baked.asset,
            lights: Some(&self.lights),
            size: self.size,
        }
    }

    /// What the player makes of the first light; the times go to the page.
    fn played(&self, page: &mut Page, baked: &Baked) -> Result<Parts> {
        let lit = relit(self.view(baked), FRAMES)?;
        let [width, height] = self.size;
        let size = format!("{width}x{height}");
        let cells = [
            self.name.into(),
            size,
            fixed(lit.first, 2),
            fixed(lit.each, 0),
            lit.stages,
        ];
        page.row(Table::Frames, &cells)?;
        with_emission(&lit.layers)
    }

    /// How far a frame is from the reference, and how far a draft is that was baked for its lights.
    fn judged(&self, page: &mut Page, baked: &Baked, image: &Parts, reference: &Reference) -> Result<()> {
        let [direct, indirect, beauty] = reference.distances(image)?;
        let [expected, noise] = baked.expected_error();
        let mut cells = vec![self.name.to_owned()];
        cells.extend(direct.cells());
        cells.extend(indirect.cells());
        cells.push(percent(indirect.error()));
        cells.push(within(expected, noise));
        cells.push(fixed(expected / indirect.error(), 2));
        cells.extend(beauty.cells());
        cells.push(reference.by.clone());
        page.row(Table::Errors, &cells)?;
        let result = self.draft(page, reference);
        page.told(&[Table::Estimates], self.name, result)
    }

    /// What a draft for these lights expects of itself, and what it is.
    fn draft(&self, page: &mut Page, reference: &Reference) -> Result<()> {
        let options = format!("--preset draft --lights {} {}", self.lights, self.options);
        let baked = Baked::new(
            &self.scene,
            format!("{FOLDER}/{}.draft.relight", self.name),
            &options,
        )?;
        let image = with_emission(&relit(self.view(&baked), 0)?.layers)?;
        let [_, indirect, _] = reference.distances(&image)?;
        let ([error, error_noise], [bias, bias_noise]) = (baked.expected_error(), baked.expected_bias());
        let cells = [
            self.name.into(),
            fixed(baked.number("/seconds/total"), 1),
            within(error, error_noise),
            percent(indirect.error()),
            fixed(error / indirect.error(), 2),
            signed(bias, bias_noise),
            signed(indirect.bias, None),
        ];
        page.row(Table::Estimates, &cells)
    }
}

/// What the README shows of the first scene: relit, path traced, and the error.
fn draw(file: &str, image: &Parts, reference: &Parts) -> Result<()> {
    let mut panels = [
        image[2].clone(),
        reference[2].clone(),
        error_map(&image[2], &reference[2])?,
    ];
    for pixel in panels[..2].iter_mut().flat_map(|panel| &mut panel.pixels) {
        *pixel = pbr_neutral(*pixel);
    }
    let picture = display_encoded(&contact_sheet(&panels, 3)?);
    Ok(write_png(Path::new(file), &picture).map_err(|error| format!("{file}: {error}"))?)
}
