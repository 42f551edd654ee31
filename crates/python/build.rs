//! On macOS the linker has to be told that Python itself brings its functions; elsewhere there is nothing to do.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
