//! Data that come inside the library: campaigns (`datasets/campaigns/`, see the README there), which `demo` and the examples
//! work on, and the postures in which the IRB 6640 was measured.

use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::{Error, Result};

/// A campaign folder inside the program.
pub struct BuiltinCampaign {
    /// Name of its folder.
    pub name: &'static str,
    /// Path within the folder, content.
    pub files: &'static [(&'static str, &'static [u8])],
}

macro_rules! campaign {
    ($name:literal: $($file:literal),+ $(,)?) => {
        BuiltinCampaign {
            name: $name,
            files: &[$((
                $file,
                include_bytes!(concat!("../datasets/campaigns/", $name, "/", $file)),
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
        for (name, content) in self.files {
            let path = folder.join(name);
            let below = path.parent().unwrap_or(&folder);
            std::fs::create_dir_all(below).map_err(|e| Error::io(below, e))?;
            crate::files::write_atomically(&path, content)?;
        }
        Ok(folder)
    }
}

const IRB6640_POSTURES: &str = include_str!("../datasets/irb6640/postures.csv");

#[derive(Deserialize)]
struct PostureRow {
    id: String,
    j1_deg: f64,
    j2_deg: f64,
    j3_deg: f64,
    j4_deg: f64,
    j5_deg: f64,
    j6_deg: f64,
}

/// Joint angles of a posture in which the IRB 6640 was measured (`A`, `B`: static stiffness; `1` … `4`: tap tests), degrees.
///
/// # Errors
/// There is no such posture.
pub fn irb6640_posture_deg(id: &str) -> Result<[f64; 6]> {
    // Notes at the end of a row hold commas of their own.
    let mut table = csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(IRB6640_POSTURES.as_bytes());
    for row in table.deserialize() {
        let p: PostureRow =
            row.map_err(|e| Error::computation(format!("a built-in table is damaged: {e}")))?;
        if p.id == id {
            return Ok([p.j1_deg, p.j2_deg, p.j3_deg, p.j4_deg, p.j5_deg, p.j6_deg]);
        }
    }
    Err(Error::computation(format!("the thesis has no posture {id}")))
}
