//! The thread that owns the player.

use crate::desk::{Desk, Outbox, Save, Stage, Task};
use crate::encode::{encoded, shown};
use crate::exhibit::{Exhibit, Reopen};
use crate::painter::{NoPicture, Painted, Painter, Room};
use crate::wish::{Pick, Wish};
use relight_play::LevelPart;
use relight_play::glam::{Vec2, Vec3};
use relight_play::near::near;
use relight_play::render::watch::Watch;
use relight_play::scene::image::preview::auto_exposure;
use relight_play::scene::image::{Layers, encode_exr};
use relight_play::scene::material_edits::parse_material_edits;
use relight_play::scene::rays::Ray;
use relight_play::scene::surface::{SurfaceHit, Surfaces};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

/// The layers that `relight play` writes by default.
const SAVED: [&str; 4] = ["beauty", "A", "direct", "indirect"];

/// Most links of a place that are told, and most clusters.
const MOST_LINKS: usize = 400;
const MOST_CLUSTERS: usize = 1000;

/// Materials as they were baked.
const NO_EDITS: &str = r#"{ "relight_materials": 1, "edits": [] }"#;

/// Paints what the desk wants until it closes; `reopen` opens the asset anew.
pub fn work(exhibit: Exhibit, desk: &Desk, reopen: Option<Reopen>) {
    let mut worker = Worker {
        exhibit,
        reopen,
        painters: HashMap::new(),
        edits: None,
        edition: 0,
    };
    loop {
        let task = desk.next();
        if matches!(task, Task::End) {
            return;
        }
        worker.forget(&desk.tabs());
        // Whatever is wrong with one picture, the next tab gets its own.
        let done = catch_unwind(AssertUnwindSafe(|| worker.one(task, desk)));
        if done.is_err() {
            worker.painters.clear();
            desk.give_up(
                "this picture failed inside relight, which is a bug; what stands in the terminal tells more",
            );
        }
    }
}

/// Refinements give way to what moves.
struct Patience<'a> {
    desk: &'a Desk,
    /// Goes on whatever comes.
    firm: bool,
}

impl Watch for Patience<'_> {
    fn stopped(&self) -> bool {
        self.desk.closed() || (!self.firm && self.desk.urgent())
    }
}

struct Worker {
    exhibit: Exhibit,
    reopen: Option<Reopen>,
    painters: HashMap<u64, Painter>,
    /// The material edits that the player has.
    edits: Option<Arc<str>>,
    edition: u64,
}

impl Worker {
    fn forget(&mut self, tabs: &[u64]) {
        self.painters.retain(|tab, _| tabs.contains(tab));
    }

    fn one(&mut self, task: Task, desk: &Desk) {
        match task {
            Task::Paint {
                tab,
                wish,
                stage,
                outbox,
            } => {
                let mut painter = self.painters.remove(&tab).unwrap_or_default();
                let painted = self.picture(&mut painter, &wish, stage, desk);
                self.painters.insert(tab, painter);
                match painted {
                    Ok((picture, next)) => {
                        outbox.show(picture);
                        desk.painted(tab, &wish, next);
                    }
                    Err(NoPicture::Interrupted) => {}
                    Err(NoPicture::Refused(what)) => {
                        say_refused(&outbox, Some(wish.id), &what);
                        desk.painted(tab, &wish, None);
                    }
                }
            }
            Task::Pick {
                tab,
                wish,
                pick,
                outbox,
            } => {
                let mut painter = self.painters.remove(&tab).unwrap_or_default();
                outbox.say(self.picked(&mut painter, &wish, pick, desk));
                self.painters.insert(tab, painter);
            }
            Task::Save(Save { wish, float, answer }) => {
                // Whoever asked may have gone.
                let _ = answer.send(self.saved(&wish, float, desk));
            }
            Task::Reopen => self.open_anew(desk),
            Task::End => {}
        }
    }

    /// Shows the asset that stands in the file now.
    fn open_anew(&mut self, desk: &Desk) {
        let Some(reopen) = &self.reopen else { return };
        match reopen() {
            Ok(exhibit) => {
                self.exhibit = exhibit;
                self.painters.clear();
                self.edits = None;
                desk.reopened(self.exhibit.maps(), self.exhibit.hello().to_string());
            }
            Err(why) => desk.say_refused(&format!(
                "{} was replaced, and what stands there now can't be shown ({why}): the one of before goes on",
                self.exhibit.asset
            )),
        }
    }

    /// Gives the player the wish's materials.
    fn dress(&mut self, wish: &Wish) -> Result<(), NoPicture> {
        let refused = |error: String| NoPicture::Refused(error);
        if self.edits != wish.materials {
            let player = &mut self.exhibit.player;
            let text = wish.materials.as_deref().unwrap_or(NO_EDITS);
            let edits = parse_material_edits(text, player.scene(), "the materials")
                .map_err(|error| refused(error.to_string()))?;
            // An asset whose materials cannot be edited is looked at as it is.
            if player.is_edited() || !edits.is_empty() {
                (player.edit_materials(edits, wish.time)).map_err(|error| refused(error.to_string()))?;
            }
            self.edits = wish.materials.clone();
            self.edition += 1;
        }
        Ok(())
    }

    fn paint(
        &mut self,
        painter: &mut Painter,
        wish: &Wish,
        stage: Stage,
        desk: &Desk,
        firm: bool,
    ) -> Result<Painted, NoPicture> {
        self.dress(wish)?;
        painter.paint(&self.room(desk), wish, stage, &Patience { desk, firm })
    }

    fn room(&self, desk: &Desk) -> Room<'_> {
        Room {
            player: &self.exhibit.player,
            sequence: &self.exhibit.sequence,
            maps: desk.maps(),
            seed: self.exhibit.seed,
            edition: self.edition,
        }
    }

    /// A picture as it is sent, and what follows it: the length of its JSON head in four bytes (little endian), the head, the file.
    fn picture(
        &mut self,
        painter: &mut Painter,
        wish: &Wish,
        stage: Stage,
        desk: &Desk,
    ) -> Result<(Vec<u8>, Option<Stage>), NoPicture> {
        let start = Instant::now();
        let painted = self.paint(painter, wish, stage, desk, stage == Stage::Coarse)?;
        let encoding = Instant::now();
        let layers = &painted.layers;
        let difference = matches!(wish.levels(), Some(LevelPart::Only(_)));
        let shown = shown(layers, wish.layer_of_frame(), difference, wish.look).ok_or_else(|| {
            let known: Vec<&str> = layers.layers.iter().map(|layer| layer.name.as_str()).collect();
            NoPicture::Refused(format!(
                "no layer {:?}; there are {}",
                wish.layer,
                known.join(", ")
            ))
        })?;
        // Not while something moves: it takes a pass over the pixels.
        let auto = (!wish.moving && stage != Stage::Beside)
            .then(|| auto_exposure(&layers.rgb(wish.layer_of_frame())?))
            .flatten();
        let lossless = matches!(stage, Stage::Final | Stage::Beside);
        let file =
            encoded(&shown.picture, lossless).map_err(|error| NoPicture::Refused(error.to_string()))?;
        let mut times: serde_json::Map<String, Value> = (painted.times.iter())
            .map(|(name, time)| ((*name).to_owned(), json!(time)))
            .collect();
        times.insert("encode".into(), json!(encoding.elapsed().as_secs_f64() * 1e3));
        let head = json!({
            "id": wish.id,
            "stage": stage.name(),
            "width": layers.width,
            "height": layers.height,
            "format": file.format,
            "layer": wish.layer,
            "times": times,
            "total": start.elapsed().as_secs_f64() * 1e3,
            "choice": painted.choice.to_string(),
            "scale": shown.scale,
            "auto_exposure": auto,
            "apart": painted.apart.map(|apart| json!({
                "samples": apart.samples, "error": apart.error, "noise": apart.noise, "bias": apart.bias,
            })),
        })
        .to_string();
        let mut message = (head.len() as u32).to_le_bytes().to_vec();
        message.extend(head.into_bytes());
        message.extend(file.bytes);
        let next = stage.next(wish).filter(|next| *next != stage || !painted.last);
        Ok((message, next))
    }

    fn picked(&mut self, painter: &mut Painter, wish: &Wish, pick: Pick, desk: &Desk) -> String {
        if pick.clusters {
            // What can't be dressed is refused where it is painted.
            let _ = self.dress(wish);
        }
        let scene = &self.exhibit.player.prepared.scene;
        let size = Vec2::new(wish.size.0 as f32, wish.size.1 as f32);
        let camera = wish.eye.camera();
        let direction = camera.direction(Vec2::new(pick.x, pick.y) * size, size);
        let ray = Ray {
            origin: camera.position,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let hit = scene
            .closest_hit(&ray)
            .filter(|_| pick.x.is_finite() && pick.y.is_finite());
        let found = hit.map(|hit| {
            let material = scene.material_of(hit.primitive);
            json!({
                "position": hit.position.to_array(),
                "normal": hit.normal.to_array(),
                "distance": hit.t,
                "material": material,
                "name": scene.material(hit.primitive).name,
                "transport": pick.links.then(|| self.transport_at((hit.position, hit.normal))).flatten(),
                "clusters": pick.clusters.then(|| self.clusters_at(painter, wish, &hit, -direction, desk)).flatten(),
            })
        });
        json!({ "picked": { "id": pick.id, "hit": found } }).to_string()
    }

    /// The clusters of lights that light a place, as JSON; `None` where the wish's lights can't be prepared, which is told where they are
    /// painted.
    fn clusters_at(
        &self,
        painter: &mut Painter,
        wish: &Wish,
        hit: &SurfaceHit,
        towards: Vec3,
        desk: &Desk,
    ) -> Option<Value> {
        let lights = painter.lights_of(&self.room(desk), wish).ok()??;
        let watch = Patience { desk, firm: true };
        let cut = (self.exhibit.player).light_cut(lights, wish.time, hit, towards, &watch);
        let cut = cut.ok()?;
        let all: f32 = cut.clusters.iter().map(|c| c.radiance.element_sum()).sum();
        let rows = cut.clusters.iter().take(MOST_CLUSTERS).map(|cluster| {
            let share = cluster.radiance.element_sum() / all.max(f32::MIN_POSITIVE);
            json!({
                "low": cluster.low.to_array(), "high": cluster.high.to_array(), "distant": cluster.distant,
                "indirect": cluster.indirect, "lights": cluster.lights, "share": share,
            })
        });
        Some(json!({ "of": cut.clusters.len(), "lights": cut.lights, "cut": rows.collect::<Vec<_>>() }))
    }

    /// Points and links of a place, as JSON: `docs/view.md` has the fields.
    fn transport_at(&self, place: (Vec3, Vec3)) -> Option<Value> {
        let prepared = &self.exhibit.player.prepared;
        let near = near(prepared, place)?;
        let positions = &prepared.transfer.as_ref()?.finest.positions;
        let points = near.points.iter().map(|(point, weight)| {
            let [x, y, z] = positions[*point as usize].to_array();
            [x, y, z, *weight]
        });
        let links = near.links.iter().take(MOST_LINKS).map(|link| {
            let [x, y, z] = link.middle.to_array();
            json!([x, y, z, link.strength, link.level])
        });
        Some(json!({
            "points": points.collect::<Vec<_>>(),
            "links": links.collect::<Vec<_>>(),
            "of": near.links.len(),
        }))
    }

    /// The file that `relight play` would write.
    fn saved(&mut self, wish: &Wish, float: bool, desk: &Desk) -> Result<Vec<u8>, String> {
        let wish = Wish {
            layer: "beauty".into(),
            ..wish.clone()
        };
        let painted = (self.paint(&mut Painter::default(), &wish, Stage::Final, desk, true)).map_err(
            |none| match none {
                NoPicture::Interrupted => "the server ends".into(),
                NoPicture::Refused(what) => what,
            },
        )?;
        let mut layers = Layers::new(painted.layers.width, painted.layers.height);
        for name in SAVED {
            layers.layers.extend(painted.layers.layer(name).cloned());
        }
        match encode_exr("the picture", &layers, &painted.header, float) {
            Ok((bytes, _)) => Ok(bytes),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// Tells a tab what can't be done.
pub fn say_refused(outbox: &Outbox, id: Option<u64>, what: &str) {
    outbox.say(json!({ "refused": { "id": id, "what": what } }).to_string());
}
