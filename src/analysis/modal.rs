//! Modes of a campaign's FRFs, posture by posture.

use rayon::prelude::*;

use crate::campaign::Campaign;
use crate::modal::{self, GlobalMode, SetMember, Settings};
use crate::{Error, Result};

/// Modes of one posture, all its FRFs together.
#[derive(Debug, Clone)]
pub struct PostureModes {
    pub posture: String,
    /// FRFs measured there.
    pub frfs: usize,
    pub modes: Vec<GlobalMode>,
}

#[derive(Debug, Clone)]
pub struct ModalAnalysis {
    /// Postures that have FRFs, in the campaign's order.
    pub postures: Vec<PostureModes>,
    pub warnings: Vec<String>,
}

impl ModalAnalysis {
    /// # Errors
    /// The FRFs cannot be read, there are none, or a posture's cannot be analysed.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        let (set, mut warnings) = campaign.load_frfs()?;
        if set.frfs.is_empty() {
            return Err(Error::computation("the campaign has no FRFs"));
        }
        let settings = Settings { band_hz: None };
        let found = set
            .frfs
            .par_iter()
            .map(|frf| modal::analyse_frf(&frf.frequency_hz, &frf.receptance_m_per_n, &settings))
            .collect::<Result<Vec<_>>>()?;
        let of_postures = campaign
            .postures
            .par_iter()
            .enumerate()
            .map(|(index, posture)| {
                let members: Vec<SetMember> = set
                    .frfs
                    .iter()
                    .zip(&found)
                    .filter(|(frf, _)| frf.posture == index)
                    .map(|(frf, modes)| SetMember {
                        frequency_hz: &frf.frequency_hz,
                        receptance_m_per_n: &frf.receptance_m_per_n,
                        modes,
                        dofs: None,
                    })
                    .collect();
                if members.is_empty() {
                    return Ok(None);
                }
                let global = modal::global(&members, &settings)?;
                let modes = PostureModes {
                    posture: posture.id.clone(),
                    frfs: members.len(),
                    modes: global.modes,
                };
                Ok(Some((modes, global.warnings)))
            })
            .collect::<Result<Vec<_>>>()?;
        let mut postures = Vec::new();
        for (modes, notes) in of_postures.into_iter().flatten() {
            warnings.extend(notes.into_iter().map(|w| format!("{}: {w}", modes.posture)));
            postures.push(modes);
        }
        Ok(ModalAnalysis { postures, warnings })
    }

    pub fn mode_count(&self) -> usize {
        self.postures.iter().map(|p| p.modes.len()).sum()
    }
}
