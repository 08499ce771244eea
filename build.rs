//! Packs the campaigns that come inside the program (`src/builtin.rs`): as text they are an eighth of it.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::DeflateEncoder;

const CAMPAIGNS: [&str; 2] = ["first-cell", "second-cell"];
/// What of a campaign folder is packed; results that commands leave in it are not.
const PARTS: [&str; 3] = ["campaign.toml", "frf", "force"];

fn main() -> io::Result<()> {
    let from = Path::new("datasets/campaigns");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").ok_or(io::ErrorKind::NotFound)?);
    for campaign in CAMPAIGNS {
        for part in PARTS {
            let part = Path::new(campaign).join(part);
            if from.join(&part).exists() {
                println!("cargo::rerun-if-changed={}", from.join(&part).display());
                pack(from, &part, &out)?;
            }
        }
    }
    Ok(())
}

/// A file, or all files of a folder, each as a file of its name in `out`.
fn pack(from: &Path, part: &Path, out: &Path) -> io::Result<()> {
    let source = from.join(part);
    if source.is_dir() {
        for entry in fs::read_dir(source)? {
            pack(from, &part.join(entry?.file_name()), out)?;
        }
        return Ok(());
    }
    let packed = out.join(part);
    fs::create_dir_all(packed.parent().unwrap_or(out))?;
    let mut encoder = DeflateEncoder::new(fs::File::create(packed)?, Compression::best());
    encoder.write_all(&fs::read(source)?)?;
    encoder.finish()?.flush()
}
