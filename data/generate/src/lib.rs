//! Makes the scenes and lighting sequences of `data/`: every byte of them comes from here, and comes again when the
//! program is run again. Functions that build a scene with parameters (the furnaces) are public for tests; [`random()`]
//! makes any number of other scenes, for `relight check --random`.
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
pub mod isosurface;
pub mod mesh;
mod pattern;
pub mod random;
pub mod sequence;
pub mod sky;
pub mod table;
pub mod texture;
pub mod two_rooms;

pub use atrium::atrium;
pub use cornell::cornell;
pub use furnace::{furnace_box, furnace_sphere, furnace_varying, varying_albedo};
pub use random::{RandomScene, random};
pub use table::table;
pub use two_rooms::two_rooms;

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
        ("two_rooms.glb", two_rooms()),
        ("table.glb", table()),
    ]
}

/// Every file that the program writes, in the order in which it does.
pub fn files() -> Vec<File> {
    let scenes = scenes().into_iter().map(|(name, glb)| File {
        name,
        bytes: glb.to_bytes(),
    });
    let others = [
        cornell::sequences(),
        furnace::sequences(),
        atrium::sequences(),
        two_rooms::sequences(),
        table::sequences(),
        isosurface::files(),
        isosurface::sequences(),
        sky::maps(),
    ];
    let others = others
        .into_iter()
        .flatten()
        .map(|(name, bytes)| File { name, bytes });
    scenes.chain(others).collect()
}
