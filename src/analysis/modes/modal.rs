//! Modes of measured FRFs, set by set: of a campaign (one set a posture), of FRF files and of raw tap tests (one set
//! a file).

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

pub use crate::analysis::modes::frf_inputs::FrfReading;
use crate::analysis::modes::frf_inputs::{Told, read, settle_unsaid};
pub use crate::analysis::modes::mode_set::{AnalysedFrf, FrfInput, SetModes};
use crate::analysis::modes::mode_set::{analyse_set, set_warnings};
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, MeasuredDof, Point};
use crate::ingest::is_no_measurement;
use crate::modal::chosen::Choice;
use crate::modal::quality::SetQuality;
use crate::modal::tracking::{self, Track};
use crate::modal::{Hit, Method, Settings};
use crate::{Error, InputError, Result};

/// Name of the set that files together make.
pub const TOGETHER: &str = "all files";

/// Modes of measured FRFs, set by set.
#[derive(Debug, Clone, Default)]
pub struct ModalAnalysis {
    /// In the order of the inputs; sets without FRFs are left out.
    pub sets: Vec<SetModes>,
    /// Hits of the raw records among the inputs, by file.
    pub hits: Vec<(String, Vec<Hit>)>,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

impl ModalAnalysis {
    /// All FRFs of a campaign, one set a posture.
    ///
    /// # Errors
    /// The FRFs cannot be read, there are none, or a posture's cannot be analysed.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        Self::of_campaign(campaign, &Settings::default())
    }

    /// As [`ModalAnalysis::run`], within a band.
    ///
    /// # Errors
    /// As [`ModalAnalysis::run`].
    pub fn of_campaign(campaign: &Campaign, settings: &Settings) -> Result<Self> {
        Self::on(&Workbench::new(campaign), settings)
    }

    /// As [`ModalAnalysis::of_campaign`], of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`ModalAnalysis::run`].
    pub fn on(campaign: &Workbench, settings: &Settings) -> Result<Self> {
        let (set, warnings) = campaign.load_frfs()?;
        let dof = |d: &MeasuredDof| dof_name(&campaign.points, d);
        let inputs = set
            .frfs
            .into_iter()
            .map(|frf| FrfInput {
                dofs: Some([dof(&frf.response), dof(&frf.reference)]),
                set: campaign.postures[frf.posture].id.clone(),
                name: frf.name,
                frequency_hz: frf.frequency_hz,
                receptance_m_per_n: frf.receptance_m_per_n,
                coherence: frf.coherence,
                added_decay_per_s: 0.0,
            })
            .collect();
        Self::of(inputs, warnings, settings)
    }

    /// In the usual way, worked out once of what lies on the bench.
    ///
    /// # Errors
    /// As [`ModalAnalysis::run`].
    pub fn usual(campaign: &Workbench) -> Result<Arc<Self>> {
        campaign.once(|| Self::on(campaign, &Settings::default()))
    }

    /// FRF files and raw tap tests: one set a file, or all files as one set (FRFs exported one by one). Of several files those that are no
    /// measurements by their names (a README beside them) are passed over and told.
    ///
    /// # Errors
    /// A file that cannot be read or holds neither FRFs nor hits; no good hit in any of them.
    pub fn of_files(
        files: &[impl AsRef<Path>],
        together: bool,
        reading: &FrfReading,
        settings: &Settings,
    ) -> Result<Self> {
        let mut reading = reading.clone();
        reading.taps.band_hz = reading.taps.band_hz.or(settings.band_hz);
        let mut inputs = Vec::new();
        let mut told = Told::default();
        let measured = files.iter().any(|file| !is_no_measurement(file.as_ref()));
        for file in files.iter().map(AsRef::as_ref) {
            if measured && is_no_measurement(file) {
                let why = "passed over: no measurement by its name";
                told.warnings.push(format!("{}: {why}", file.display()));
                continue;
            }
            inputs.extend(read(file, &reading, &mut told)?);
        }
        settle_unsaid(&mut inputs, &reading, &mut told);
        let refused = told.refused.into_iter().next();
        if let (true, Some(error)) = (inputs.is_empty(), refused) {
            return Err(error);
        }
        if together {
            join(&mut inputs, &mut told.warnings);
        }
        let mut analysis = Self::of(inputs, told.warnings, settings)?;
        analysis.hits = told.hits;
        Ok(analysis)
    }

    /// # Errors
    /// No FRFs, or frequencies that are not ascending.
    pub fn of(inputs: Vec<FrfInput>, warnings: Vec<String>, settings: &Settings) -> Result<Self> {
        if inputs.is_empty() {
            return Err(Error::computation("there are no FRFs in what was given"));
        }
        let mut names: Vec<String> = Vec::new();
        let mut sets: Vec<Vec<FrfInput>> = Vec::new();
        for input in inputs {
            match names.iter().position(|n| *n == input.set) {
                Some(k) => sets[k].push(input),
                None => {
                    names.push(input.set.clone());
                    sets.push(vec![input]);
                }
            }
        }
        let sets = names
            .into_par_iter()
            .zip(sets)
            .map(|(name, inputs)| analyse_set(name, inputs, settings))
            .collect::<Result<Vec<_>>>()?;
        let mut analysis = ModalAnalysis {
            sets,
            hits: Vec::new(),
            warnings,
        };
        for set in &analysis.sets {
            analysis.warnings.extend(set_warnings(set));
        }
        Ok(analysis)
    }

    /// Every set as the analyst wants it.
    ///
    /// # Errors
    /// A pole that is nowhere near, in any set.
    pub fn choose(&mut self, choice: &Choice) -> Result<()> {
        for set in &mut self.sets {
            set.choose(choice).map_err(|why| {
                InputError::new(format!("{}: {why}", set.set))
                    .remedy("look at the poles of the stabilisation diagram (--report, or --json)")
            })?;
        }
        Ok(())
    }

    /// Single FRFs: the parameters by this method only. Modes that it does not find are not there any more.
    pub fn keep_method(&mut self, method: Method) {
        for frf in self.sets.iter_mut().flat_map(|s| &mut s.frfs) {
            let modes = &mut frf.modes.modes;
            modes
                .iter_mut()
                .for_each(|m| m.estimates.retain(|e| e.method == method));
            modes.retain(|m| !m.estimates.is_empty());
        }
    }

    /// The same mode from set to set.
    pub fn tracks(&self) -> Vec<Track> {
        tracking::track(&self.sets.iter().map(|s| &s.global).collect::<Vec<_>>())
    }

    /// The set with the most modes.
    pub fn richest_set(&self) -> Option<&SetModes> {
        self.sets.iter().max_by_key(|s| s.global.modes.len())
    }

    /// Of the set that is worst.
    pub fn quality(&self) -> Option<&SetQuality> {
        let qualities = self.sets.iter().map(|s| &s.global.quality);
        qualities.max_by(|a, b| {
            let unexplained = || a.unexplained_share.total_cmp(&b.unexplained_share);
            a.verdict.cmp(&b.verdict).then_with(unexplained)
        })
    }

    /// Modes of all sets together.
    pub fn mode_count(&self) -> usize {
        self.sets.iter().map(|s| s.global.modes.len()).sum()
    }
}

/// `1X`, `12-Z`.
pub(crate) fn dof_name(points: &[Point], dof: &MeasuredDof) -> String {
    let sign = if dof.negative { "-" } else { "" };
    format!("{}{sign}{}", points[dof.point].node, dof.axis.letter())
}

/// Makes one set of all FRFs. The files say where they were measured only if every FRF has a place of its own; else they
/// are told apart by their files.
fn join(inputs: &mut [FrfInput], warnings: &mut Vec<String>) {
    let mut names: Vec<&str> = inputs.iter().map(|i| i.name.as_str()).collect();
    names.sort_unstable();
    let named_twice = names.windows(2).any(|w| w[0] == w[1]);
    let mut places: Vec<&[String; 2]> = inputs.iter().filter_map(|i| i.dofs.as_ref()).collect();
    let known = places.len();
    places.sort_unstable();
    let placed_twice = places.windows(2).any(|w| w[0] == w[1]);
    if placed_twice {
        warnings.push(
            "the files give several FRFs the same response and reference: each is taken as a point of its own".into(),
        );
    }
    let placed = known == inputs.len() && !placed_twice;
    for input in inputs {
        if named_twice {
            let file = Path::new(&input.set)
                .file_name()
                .map_or("".into(), |n| n.to_string_lossy());
            input.name = format!("{file} {}", input.name);
        }
        if !placed {
            input.dofs = None;
        }
        input.set = TOGETHER.to_owned();
    }
}
