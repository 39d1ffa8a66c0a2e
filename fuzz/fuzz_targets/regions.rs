#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| nullsweep_inputs::run("regions", bytes));
