//! Functions that take any bytes and must neither panic nor hang nor take much memory: `cargo fuzz` feeds them for hours
//! (README.md), tests named `fuzz` in the crates for seconds.

pub mod targets {
    //! The functions.

    pub mod assets;
    #[cfg(feature = "scene")]
    pub mod readers;

    /// A function to be fed with any bytes.
    pub type Target = fn(&[u8]);

    /// Feeds one target.
    pub fn feed(name: &str, data: &[u8]) {
        let all = assets::all();
        #[cfg(feature = "scene")]
        let all = all.into_iter().chain(readers::all());
        for (known, target) in all {
            if known == name {
                return target(data);
            }
        }
        panic!("no target {name}");
    }
}
