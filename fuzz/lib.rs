//! Functions that take any bytes and must neither panic nor hang nor take much memory: `cargo fuzz` feeds them for hours
//! (README.md), tests named `fuzz` in the crates for seconds.

/// Image decoders of others panic on some damaged files, which our readers catch and report; the hook that libFuzzer sets
/// would end the process at the panic itself. What nobody catches still ends it.
pub fn let_nets_catch() {
    std::panic::set_hook(Box::new(|_| {}));
}

pub mod targets {
    //! The functions.

    pub mod assets;
    #[cfg(feature = "scene")]
    pub mod readers;

    /// A function to be fed with any bytes.
    pub type Target = fn(&[u8]);
}
