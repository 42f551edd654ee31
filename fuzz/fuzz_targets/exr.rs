#![no_main]
libfuzzer_sys::fuzz_target!(
    init: relight_fuzz::let_nets_catch(),
    |data: &[u8]| relight_fuzz::targets::readers::exr(data)
);
