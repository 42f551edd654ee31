#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| relight_fuzz::targets::assets::container(data));
