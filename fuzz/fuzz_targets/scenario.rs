//! The target `scenario` for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mtj_fuzz::scenario(data));
