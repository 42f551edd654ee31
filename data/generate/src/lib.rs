//! Makes the scenes and lighting sequences of `data/`: every byte of them comes from here, and comes again when the
//! program is run again. Functions that build a scene with parameters (the furnaces) are public for tests.
//!
//! A scene is made in three steps: [`mesh`] and [`texture`] give triangles and images, a module per scene puts them
//! together, [`glb`] writes them as binary glTF 2.0.

#![forbid(unsafe_code)]

pub mod atrium;
mod columns;
pub mod cornell;
pub mod furnace;
mod furnishing;
pub mod glb;
pub mod mesh;
pub mod sequence;
pub mod sky;
pub mod texture;

pub use atrium::atrium;
pub use cornell::cornell;
pub use furnace::{furnace_box, furnace_sphere, furnace_varying, varying_albedo};

/// A file of `data/`: its name and contents.
pub struct File {
    /// Name within the folder.
    pub name: &'static str,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// The glTF scenes, by file name.
pub fn scenes() -> Vec<(&'static str, glb::Glb)> {
    vec![
        ("cornell.glb", cornell()),
        ("furnace_sphere.glb", furnace_sphere([0.5; 3])),
        ("furnace_box.glb", furnace_box([0.5; 3])),
        ("furnace_varying.glb", furnace_varying(0.5, 0.4)),
        ("atrium.glb", atrium()),
    ]
}

/// Every file that the program writes, in the order in which it does.
pub fn files() -> Vec<File> {
    let scenes = scenes().into_iter().map(|(name, glb)| File {
        name,
        bytes: glb.to_bytes(),
    });
    let sequences = [cornell::sequences(), furnace::sequences(), atrium::sequences()];
    let sequences = sequences
        .into_iter()
        .flatten()
        .map(|(name, bytes)| File { name, bytes });
    let skies = sky::maps().into_iter().map(|(name, bytes)| File { name, bytes });
    scenes.chain(sequences).chain(skies).collect()
}
