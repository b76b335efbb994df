//! The target `knob` for libFuzzer.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mtj_fuzz::knob(data));
