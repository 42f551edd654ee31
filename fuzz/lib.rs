//! Functions that take any bytes and must neither panic nor hang nor take much memory: `cargo fuzz` feeds them for hours
//! (README.md), tests named `fuzz` in the crates for seconds.

use std::collections::HashSet;
use std::sync::Mutex;

/// Decoders of others panic on some damaged files, which our readers catch and report; the hook that libFuzzer sets would end
/// the process at the panic itself. What nobody catches still ends it. Each place is said once, as the log is to tell what
/// nets had to catch.
pub fn let_nets_catch() {
    let said = Mutex::new(HashSet::new());
    std::panic::set_hook(Box::new(move |panic| {
        let place = panic.location().map(ToString::to_string);
        if said.lock().is_ok_and(|mut said| said.insert(place)) {
            eprintln!("{panic}");
        }
    }));
}

pub mod targets {
    //! The functions.

    pub mod assets;
    #[cfg(feature = "scene")]
    pub mod readers;

    /// A function to be fed with any bytes.
    pub type Target = fn(&[u8]);
}
