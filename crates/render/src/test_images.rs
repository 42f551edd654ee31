//! Images that unit tests share, and what they look at.

use crate::brute;
use crate::layers::RenderSize;
use crate::many_lights::{PointLights, PointSettings};
use crate::path;
use crate::picture::Picture;
use relight_scene::camera::Camera;
use relight_scene::image::Layers;
use relight_scene::light::LightTrack;
use relight_scene::light_set::{LightSet, SceneEmitters};
use relight_scene::traced::TracedScene;

pub const SIZE: RenderSize = RenderSize {
    width: 16,
    height: 16,
};

/// Calls `make` with the picture of a scene in the light of `tracks`.
pub fn pictured<R>(
    scene: &TracedScene,
    tracks: &[LightTrack],
    camera: &Camera,
    spp: u32,
    make: impl FnOnce(Picture<'_>) -> R,
) -> R {
    let emitters = SceneEmitters::new(scene);
    let lights = LightSet::new(&emitters, tracks, 0.0).unwrap();
    make(Picture {
        spp: Some(spp),
        ..Picture::new(scene, &lights, camera, SIZE)
    })
}

pub fn path_traced(scene: &TracedScene, tracks: &[LightTrack], camera: &Camera, spp: u32) -> Layers {
    pictured(scene, tracks, camera, spp, |picture| {
        path::render(&picture, None).unwrap()
    })
}

/// Every one of the points that stand for the picture's lights, with a shadow ray of its own.
pub fn by_points(picture: &Picture<'_>, settings: &PointSettings) -> Layers {
    let points = PointLights::new(picture.scene, picture.lights, settings);
    brute::render_points(picture, &points).unwrap().0
}

/// Values of a layer, channel by channel.
pub fn data<'a>(layers: &'a Layers, name: &str) -> &'a [f32] {
    &layers.layer(name).unwrap().data
}

/// Mean over all pixels and channels.
pub fn mean(layers: &Layers, name: &str) -> f64 {
    let data = data(layers, name);
    data.iter().map(|&v| f64::from(v)).sum::<f64>() / data.len() as f64
}

/// Asserts that one thread and three make the same.
pub fn same_on_any_threads<R: PartialEq + Send>(make: impl Fn() -> R + Sync) -> R {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(&make)
    };
    let one = on(1);
    assert!(one == on(3), "threads change it");
    one
}
