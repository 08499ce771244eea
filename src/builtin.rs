//! Campaigns that come inside the program (`datasets/campaigns/`, see the README there): what `demo` works on.

use std::io::Read;
use std::path::{Path, PathBuf};

use flate2::read::DeflateDecoder;

use crate::{Error, Result};

/// A campaign folder inside the program.
pub struct BuiltinCampaign {
    /// Name of its folder.
    pub name: &'static str,
    /// Path within the folder, content as `build.rs` packs it.
    files: &'static [(&'static str, &'static [u8])],
}

macro_rules! campaign {
    ($name:literal: $($file:literal),+ $(,)?) => {
        BuiltinCampaign {
            name: $name,
            files: &[$((
                $file,
                include_bytes!(concat!(env!("OUT_DIR"), "/", $name, "/", $file)),
            )),+],
        }
    };
}

/// FRFs of a robot, milling cuts and drilling lobes; the model can explain all of it.
pub const FIRST_CELL: BuiltinCampaign = campaign!("first-cell":
    "campaign.toml",
    "frf/p1.uff", "frf/p2.uff", "frf/p3.uff", "frf/p4.uff", "frf/p5.uff", "frf/p6.uff",
    "force/cut01.txt", "force/cut02.txt", "force/cut03.txt", "force/cut04.txt",
    "force/cut05.txt", "force/cut06.txt", "force/cut07.txt", "force/cut08.txt",
);

/// FRFs of a robot with physics that the model does not have.
pub const SECOND_CELL: BuiltinCampaign = campaign!("second-cell":
    "campaign.toml",
    "frf/p1.uff", "frf/p2.uff", "frf/p3.uff", "frf/p4.uff", "frf/p5.uff", "frf/p6.uff",
);

impl BuiltinCampaign {
    /// Writes the campaign as a folder of its name into `parent` and gives its path. Files of the same names are
    /// replaced, others are left alone.
    ///
    /// # Errors
    /// What the file system refuses, naming the file.
    pub fn write(&self, parent: &Path) -> Result<PathBuf> {
        let folder = parent.join(self.name);
        for (name, packed) in self.files {
            let path = folder.join(name);
            let mut content = Vec::new();
            DeflateDecoder::new(*packed)
                .read_to_end(&mut content)
                .map_err(|e| Error::io(&path, e))?;
            let below = path.parent().unwrap_or(&folder);
            std::fs::create_dir_all(below).map_err(|e| Error::io(below, e))?;
            crate::files::write_atomically(&path, &content)?;
        }
        Ok(folder)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_the_campaign_of_the_repository() {
        let folder = tempfile::tempdir().unwrap();
        let campaigns = Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/campaigns");
        for campaign in [FIRST_CELL, SECOND_CELL] {
            let written = campaign.write(folder.path()).unwrap();
            for (name, _) in campaign.files {
                let source = campaigns.join(campaign.name).join(name);
                assert_eq!(
                    std::fs::read(written.join(name)).unwrap(),
                    std::fs::read(&source).unwrap(),
                    "{}",
                    source.display()
                );
            }
        }
    }
}
