//! A measurement file from bytes that libFuzzer chooses.
#![no_main]

#[path = "../promises.rs"]
#[allow(dead_code)] // Each target uses one of them.
mod promises;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    promises::reads_measurements(bytes);
});
