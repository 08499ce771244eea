//! A log of revisions from bytes that libFuzzer chooses.
#![no_main]

#[path = "../promises.rs"]
#[allow(dead_code)] // Each target uses one of them.
mod promises;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    promises::reads_revisions(std::path::Path::new("/nonexistent"), bytes);
});
