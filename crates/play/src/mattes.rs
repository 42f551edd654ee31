//! Which objects and materials a camera sees: Cryptomatte.

use crate::player::Player;
use crate::shot::{STANDING_SAMPLES, Shot};
use relight_render::expose::expose_watched;
use relight_render::exposure::Exposure;
use relight_render::watch::{Cancelled, Watch};
use relight_scene::image::cryptomatte::Mattes;
use relight_scene::image::{Layer, Layers};
use relight_scene::traced::TracedScene;

/// The layers of Cryptomatte of a shot, and the attributes that say what they are.
#[derive(Clone, Debug, Default)]
pub struct ShotMattes {
    /// `CryptoObject00` to `02` and `CryptoMaterial00` to `02`.
    pub layers: Vec<Layer>,
    /// By name.
    pub attributes: Vec<(String, String)>,
}

impl Player {
    /// Which objects and materials a shot shows. Objects have the names of the scene's nodes; what has none is "object N" or "material N", N from
    /// 0.
    ///
    /// # Errors
    /// [`Cancelled`] if `watch` says so.
    pub fn mattes(&self, shot: &Shot, watch: &dyn Watch) -> Result<ShotMattes, Cancelled> {
        let scene = &self.prepared.scene;
        let traced;
        let seen = match shot {
            Shot::Relit(shot) => &shot.seen,
            Shot::Traced(shot) => {
                let size = (shot.size.width, shot.size.height);
                traced = expose_watched(scene, &shot.camera, size, STANDING_SAMPLES, watch)?;
                &traced
            }
        };
        let mut layers = Layers::new(seen.width, seen.height);
        let mut attributes = Vec::new();
        let named = |name: Option<&String>, what: &str, number: usize| match name {
            Some(name) if !name.is_empty() => name.clone(),
            _ => format!("{what} {number}"),
        };
        let objects: Vec<String> = (0..scene.scene().instances.len())
            .map(|i| named(scene.scene().object_names.get(i), "object", i))
            .collect();
        let materials: Vec<String> = (scene.materials().iter().enumerate())
            .map(|(i, material)| named(Some(&material.name), "material", i))
            .collect();
        for (kind, names, of_triangle) in [
            (
                "CryptoObject",
                &objects,
                TracedScene::instance_of as fn(&TracedScene, u32) -> u32,
            ),
            ("CryptoMaterial", &materials, TracedScene::material_of),
        ] {
            let mattes = Mattes { kind, names };
            mattes.push_layers(&mut layers, |pixel| shares(scene, seen, pixel, of_triangle));
            attributes.extend(mattes.attributes());
        }
        Ok(ShotMattes {
            layers: layers.layers,
            attributes,
        })
    }
}

/// What a pixel's rays meet, and the share of the pixel that each stands for.
fn shares(
    scene: &TracedScene,
    seen: &Exposure,
    pixel: usize,
    of_triangle: fn(&TracedScene, u32) -> u32,
) -> Vec<(u32, f32)> {
    let mut shares = Vec::new();
    for f in seen.fragments_of(pixel).filter(|&f| seen.hits[f].is_some()) {
        // A fragment is of one material, but may lie on several objects.
        let places = seen.places_of(scene, f);
        let each = seen.coverage[f] / places.len().max(1) as f32;
        shares.extend(
            places
                .iter()
                .map(|place| (of_triangle(scene, place.primitive), each)),
        );
    }
    shares
}
