//! A `campaign.toml` from bytes that libFuzzer chooses, in a folder that holds the files which the seeds name.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

#[path = "../promises.rs"]
#[allow(dead_code)] // Each target uses some of them.
mod promises;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("lobestone-fuzz-campaign-{}", std::process::id()));
    for toml in [
        include_str!("../../data/campaign_full.toml"),
        include_str!("../../data/blind/frf-9112/campaign.toml"),
        include_str!("../../data/blind/force-9400/campaign.toml"),
    ] {
        promises::put_files(&folder, toml);
    }
    folder
});

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    promises::reads_campaign(&FOLDER, bytes);
});
