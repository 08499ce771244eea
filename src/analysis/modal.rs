//! Modes of measured FRFs, set by set: of a campaign (one set a posture), of FRF files and of raw tap tests (one set
//! a file).

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::campaign::{Campaign, MeasuredDof, Point};
use crate::ingest::units::{self, Dimension};
use crate::ingest::{self, Channel, FrfRecord, Quantity, TimeRecord};
use crate::modal::chosen::Choice;
use crate::modal::delay::{self, Delay};
use crate::modal::quality::{self, Quality, QualityGrade, SetQuality};
use crate::modal::tracking::{self, Track};
use crate::modal::{self, FrfModes, GlobalModes, Hit, Method, SetMember, Settings, TapRecord, TapSettings};
use crate::{Error, InputError, Result};

/// Name of the set that files together make.
pub const TOGETHER: &str = "all files";

/// One FRF to analyse.
#[derive(Debug, Clone)]
pub struct FrfInput {
    pub name: String,
    /// Posture or file: FRFs of one set share their modes.
    pub set: String,
    /// Response and reference, as text that is equal where the degree of freedom is.
    pub dofs: Option<[String; 2]>,
    pub frequency_hz: Vec<f64>,
    pub receptance_m_per_n: Vec<Complex64>,
    pub coherence: Option<Vec<f64>>,
    /// What an exponential window added to ζω of every mode; taken out of the results.
    pub added_decay_per_s: f64,
}

/// One FRF and what was found in it.
#[derive(Debug, Clone)]
pub struct AnalysedFrf {
    pub input: FrfInput,
    pub modes: FrfModes,
    pub quality: Quality,
}

/// One posture or file.
#[derive(Debug, Clone)]
pub struct SetModes {
    pub set: String,
    pub frfs: Vec<AnalysedFrf>,
    /// Degrees of freedom by the numbers that [`modal::GlobalMode::shape`] uses.
    pub dofs: Vec<String>,
    pub global: GlobalModes,
    pub verdict: QualityGrade,
    /// The verdict in words.
    pub why: String,
}

#[derive(Debug, Clone, Default)]
pub struct ModalAnalysis {
    /// In the order of the inputs; sets without FRFs are left out.
    pub sets: Vec<SetModes>,
    /// Hits of the raw records among the inputs, by file.
    pub hits: Vec<(String, Vec<Hit>)>,
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

    /// FRF files and raw tap tests: one set a file, or all files as one set (FRFs exported one by one).
    ///
    /// # Errors
    /// A file that cannot be read or holds neither FRFs nor hits.
    pub fn of_files(
        files: &[impl AsRef<Path>],
        together: bool,
        settings: &Settings,
        taps: &TapSettings,
    ) -> Result<Self> {
        Self::of_windowed_files(files, together, 0.0, settings, taps)
    }

    /// As [`ModalAnalysis::of_files`] for FRF files measured with an exponential window e^(−decay t) on the responses (and
    /// the force): what it added to the damping is taken out.
    ///
    /// # Errors
    /// As [`ModalAnalysis::of_files`].
    pub fn of_windowed_files(
        files: &[impl AsRef<Path>],
        together: bool,
        decay_per_s: f64,
        settings: &Settings,
        taps: &TapSettings,
    ) -> Result<Self> {
        let mut inputs = Vec::new();
        let mut warnings = Vec::new();
        let mut hits = Vec::new();
        for file in files {
            let before = hits.len();
            let mut of_file = read(file.as_ref(), taps, &mut hits, &mut warnings)?;
            // A raw record has its window from here, not from the analyser.
            if decay_per_s > 0.0 && hits.len() == before {
                of_file.iter_mut().for_each(|i| i.added_decay_per_s = decay_per_s);
            }
            inputs.extend(of_file);
        }
        if together {
            join(&mut inputs, &mut warnings);
        }
        let mut analysis = Self::of(inputs, warnings, settings)?;
        analysis.hits = hits;
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
            let dofs = super::modal_export::dofs_of_frfs(set);
            choice.apply(&mut set.global, &dofs).map_err(|why| {
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

    pub fn mode_count(&self) -> usize {
        self.sets.iter().map(|s| s.global.modes.len()).sum()
    }
}

/// `1X`, `12-Z`.
pub(super) fn dof_name(points: &[Point], dof: &MeasuredDof) -> String {
    let sign = if dof.negative { "-" } else { "" };
    format!("{}{sign}{}", points[dof.point].node, dof.axis.letter())
}

fn analyse_set(set: String, inputs: Vec<FrfInput>, settings: &Settings) -> Result<SetModes> {
    let sines = sines_of(&inputs);
    #[allow(clippy::type_complexity)]
    let clean: Vec<(Cow<[f64]>, Cow<[Complex64]>)> = inputs
        .iter()
        .map(|input| {
            let (f, h) = (&input.frequency_hz[..], &input.receptance_m_per_n[..]);
            if sines.is_empty() {
                return (Cow::Borrowed(f), Cow::Borrowed(h));
            }
            let (f, h) = modal::without_sines(f, h, &sines);
            (Cow::Owned(f), Cow::Owned(h))
        })
        .collect();
    let single = modal::analyse_frfs(&clean, settings)?;
    let mut dofs: Vec<String> = inputs
        .iter()
        .filter_map(|i| i.dofs.as_ref())
        .flatten()
        .cloned()
        .collect();
    dofs.sort();
    dofs.dedup();
    let number = |name: &String| dofs.binary_search(name).ok();
    let members: Vec<SetMember> = inputs
        .iter()
        .zip(&clean)
        .zip(&single)
        .map(|((input, (frequency_hz, receptance_m_per_n)), modes)| SetMember {
            frequency_hz,
            receptance_m_per_n,
            modes,
            dofs: input
                .dofs
                .as_ref()
                .and_then(|[a, b]| Some([number(a)?, number(b)?])),
        })
        .collect();
    let mut global = modal::global(&members, settings)?;
    if !sines.is_empty() {
        let told: Vec<String> = sines
            .iter()
            .map(|s| format!("{:.2} Hz ({})", s.frequency_hz, s.what))
            .collect();
        global.warnings.push(format!(
            "sine lines without a resonance, taken out before the fits: {}",
            told.join(", ")
        ));
    }
    global.sine_lines = sines;
    let mirror = |k: usize| {
        let [response, reference] = inputs[k].dofs.as_ref()?;
        if response == reference {
            return None;
        }
        let other = inputs.iter().position(|i| {
            i.dofs
                .as_ref()
                .is_some_and(|[a, b]| a == reference && b == response)
        })?;
        global.reconstructions[other].as_ref()
    };
    let qualities: Vec<Quality> = inputs
        .par_iter()
        .enumerate()
        .map(|(k, input)| {
            quality::judge(
                &input.frequency_hz,
                &input.receptance_m_per_n,
                input.coherence.as_deref(),
                global.reconstructions[k].as_ref(),
                mirror(k),
            )
        })
        .collect();
    let (of_frfs, why) = quality::of_set(&qualities.iter().collect::<Vec<_>>());
    let verdict = of_frfs.max(global.quality.verdict);
    let why = [why].into_iter().chain(global.quality.reasons.iter().cloned());
    let why = why.collect::<Vec<_>>().join("; ");
    // A record's window is the same for all its FRFs.
    let added = inputs.iter().map(|i| i.added_decay_per_s).fold(0.0, f64::max);
    let mut lost = Vec::new();
    if added > 0.0 {
        let without = |f: f64, zeta: f64| zeta - added / (TAU * f);
        global.modes.retain_mut(|mode| {
            mode.damping_ratio = without(mode.frequency_hz, mode.damping_ratio);
            let left = mode.damping_ratio > 0.0;
            if !left {
                lost.push(format!("{:.2} Hz", mode.frequency_hz));
            }
            left
        });
        if !lost.is_empty() {
            global.warnings.push(format!(
                "no damping is left when the window's is taken out (left out): {}",
                lost.join(", ")
            ));
        }
    }
    let frfs = inputs
        .into_iter()
        .zip(single)
        .zip(qualities)
        .map(|((input, mut modes), quality)| {
            for mode in &mut modes.modes {
                for e in &mut mode.estimates {
                    e.damping_ratio -= input.added_decay_per_s / (TAU * e.frequency_hz);
                }
                mode.estimates.retain(|e| e.damping_ratio > 0.0);
            }
            modes.modes.retain(|m| !m.estimates.is_empty());
            AnalysedFrf {
                input,
                modes,
                quality,
            }
        })
        .collect();
    Ok(SetModes {
        set,
        frfs,
        dofs,
        global,
        verdict,
        why,
    })
}

/// Sines among FRFs that share their lines.
fn sines_of(inputs: &[FrfInput]) -> Vec<modal::SineLine> {
    let Some(first) = inputs.first() else {
        return Vec::new();
    };
    if inputs.iter().any(|i| i.frequency_hz != first.frequency_hz) {
        return Vec::new();
    }
    let curves: Vec<&[Complex64]> = inputs.iter().map(|i| i.receptance_m_per_n.as_slice()).collect();
    modal::sine_lines(&first.frequency_hz, &curves)
}

/// What is worth saying of a set, one line for each kind of trouble.
fn set_warnings(set: &SetModes) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for frf in &set.frfs {
        lines.extend(
            frf.modes
                .warnings
                .iter()
                .map(|w| format!("{} {}: {w}", set.set, frf.input.name)),
        );
    }
    // The same trouble in several FRFs is one line.
    const BACKWARDS: &str = "turns the wrong way round";
    let backwards: Vec<&str> = set
        .frfs
        .iter()
        .filter(|f| f.modes.warnings.iter().any(|w| w.contains(BACKWARDS)))
        .map(|f| f.input.name.as_str())
        .collect();
    if backwards.len() > 1 {
        lines.retain(|l| !l.contains(BACKWARDS));
        let shown = backwards.iter().take(4).copied().collect::<Vec<_>>().join(", ");
        let more = backwards.len().saturating_sub(4);
        lines.push(format!(
            "{}: {} of {} FRFs have peaks that turn the wrong way round (negative damping), left out: {shown}{} (where: \
             --json)",
            set.set,
            backwards.len(),
            set.frfs.len(),
            if more > 0 { format!(" and {more} more") } else { String::new() },
        ));
    }
    let conjugated: Vec<&AnalysedFrf> = set.frfs.iter().filter(|f| f.modes.conjugated).collect();
    if conjugated.len() > 3 {
        lines.retain(|l| !l.contains("conjugated"));
        lines.push(format!(
            "{}: the phase of {} of {} FRFs is conjugated (sign convention e^(-iωt)): they were turned to e^(+iωt)",
            set.set,
            conjugated.len(),
            set.frfs.len()
        ));
    }
    lines.extend(set.global.warnings.iter().map(|w| format!("{}: {w}", set.set)));
    lines.extend(delay::in_words(&delays(set)).map(|w| format!("{}: {w}", set.set)));
    let refused = set
        .frfs
        .iter()
        .filter(|f| f.modes.remarks.iter().any(|r| r.contains("not reported")))
        .count();
    if refused > 0 {
        lines.push(format!(
            "{}: {refused} FRFs have peaks that are no modes (which: --json)",
            set.set
        ));
    }
    if set.verdict != QualityGrade::Good {
        let worst: Vec<String> = set
            .frfs
            .iter()
            .filter(|f| f.quality.verdict != QualityGrade::Good)
            .take(4)
            .map(|f| format!("{} ({})", f.input.name, f.quality.reasons.join(", ")))
            .collect();
        lines.push(format!("{}: {}: {}", set.set, set.why, worst.join("; ")));
    }
    lines
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

/// By FRF: its response (its name where that is not known), and how late it is against the force.
fn delays(set: &SetModes) -> Vec<(String, Option<Delay>)> {
    let own = set.frfs.iter().enumerate();
    own.map(|(k, frf)| {
        let modes: Vec<(f64, Complex64, f64)> = set
            .global
            .modes
            .iter()
            .filter_map(|m| {
                let (constant, std) = (*m.constants.get(k)?)?;
                Some((m.frequency_hz, constant, std))
            })
            .collect();
        let name = frf.input.dofs.as_ref().map_or(&frf.input.name, |d| &d[0]);
        (name.clone(), delay::delay(&modes))
    })
    .collect()
}

/// FRFs of one file: as they stand there, or from the hits of a raw record.
fn read(
    path: &Path,
    taps: &TapSettings,
    hits: &mut Vec<(String, Vec<Hit>)>,
    warnings: &mut Vec<String>,
) -> Result<Vec<FrfInput>> {
    let set = path.display().to_string();
    let file = ingest::read_file(path)?;
    warnings.extend(file.warnings.iter().map(|w| format!("{set}: {w}")));
    if !file.contents.frfs.is_empty() {
        let unsaid = file.contents.frfs.iter().filter(|r| r.quantity.is_none()).count();
        if unsaid > 0 {
            warnings.push(format!(
                "{set}: the file does not say what its {unsaid} FRFs are; taken as receptance (m/N)"
            ));
        }
        return Ok(file
            .contents
            .frfs
            .into_iter()
            .map(|r| frf_input(&set, r))
            .collect());
    }
    if file.contents.times.is_empty() {
        return Err(InputError::new(format!(
            "neither FRFs nor a raw tap test in this {} file, but {}",
            file.format,
            file.contents.describe()
        ))
        .file(path)
        .remedy("give a UFF 58 file or a CSV with FRFs, or a time record of hammer and sensors")
        .into());
    }
    let mut inputs = Vec::new();
    for alike in file.contents.times.chunk_by(TimeRecord::same_channels) {
        inputs.extend(from_segments(&set, path, alike, taps, hits, warnings)?);
    }
    Ok(inputs)
}

/// FRFs of records with the same channels: of all hits together, unless they contradict each other (a hammer that goes
/// from point to point).
fn from_segments(
    set: &str,
    path: &Path,
    segments: &[TimeRecord],
    taps: &TapSettings,
    hits: &mut Vec<(String, Vec<Hit>)>,
    warnings: &mut Vec<String>,
) -> Result<Vec<FrfInput>> {
    let [first, others @ ..] = segments else {
        return Ok(Vec::new());
    };
    if others.is_empty() {
        return Ok(from_taps(set, path, first, taps, hits, warnings)?.frfs);
    }
    let mut whole = first.clone();
    others.iter().for_each(|segment| whole.append(segment));
    let (mut their_hits, mut their_warnings) = (Vec::new(), Vec::new());
    let together = from_taps(set, path, &whole, taps, &mut their_hits, &mut their_warnings)?;
    if !together.contradictory {
        warnings.push(format!(
            "{set}: {} records with the same channels: their hits are averaged",
            segments.len()
        ));
        warnings.extend(their_warnings);
        hits.extend(their_hits);
        return Ok(together.frfs);
    }
    warnings.push(format!(
        "{set}: {} records with the same channels, whose hits contradict each other (other points or directions, or noise \
         as large as the response): FRFs of each record alone",
        segments.len()
    ));
    let mut inputs = Vec::new();
    for (k, segment) in segments.iter().enumerate() {
        let alone = from_taps(set, path, segment, taps, hits, warnings)?.frfs;
        inputs.extend(alone.into_iter().map(|input| FrfInput {
            name: format!("{} record {}", input.name, k + 1),
            ..input
        }));
    }
    Ok(inputs)
}

/// FRFs of a tap record, and whether its hits contradict each other.
struct FromTaps {
    frfs: Vec<FrfInput>,
    contradictory: bool,
}

fn frf_input(set: &str, record: FrfRecord) -> FrfInput {
    FrfInput {
        set: set.to_owned(),
        receptance_m_per_n: receptance(&record.frequency_hz, &record.value, record.quantity),
        dofs: record
            .response
            .zip(record.reference)
            .map(|(a, b)| [a.to_string(), b.to_string()]),
        name: record.name,
        frequency_hz: record.frequency_hz,
        coherence: record.coherence,
        added_decay_per_s: 0.0,
    }
}

/// H = V/(iω) = A/(iω)². The 0 Hz line of a mobility or accelerance says nothing about receptance; it comes
/// out as not finite and the analysis leaves it out anyway.
fn receptance(frequency_hz: &[f64], value: &[Complex64], quantity: Option<Quantity>) -> Vec<Complex64> {
    let order = match quantity {
        None | Some(Quantity::Receptance) => return value.to_vec(),
        Some(Quantity::Mobility) => 1,
        Some(Quantity::Accelerance) => 2,
    };
    let lines = frequency_hz.iter().zip(value);
    lines
        .map(|(f, v)| v / Complex64::new(0.0, TAU * f).powi(order))
        .collect()
}

/// The hammer's channel: the only one in newtons, or else the only one that is called so.
fn hammer<'a>(record: &'a TimeRecord, path: &Path) -> Result<&'a Channel> {
    let in_newtons =
        |c: &&Channel| units::parse(&c.file_unit).is_some_and(|u| u.dimension == Dimension::FORCE);
    let called = |c: &&Channel| {
        let name = c.name.to_lowercase();
        ["hammer", "force", "impact", "kladivo", "kraft"]
            .iter()
            .any(|w| name.contains(w))
    };
    let by = |test: &dyn Fn(&&Channel) -> bool| -> Vec<&'a Channel> {
        record.channels.iter().filter(|c| test(c)).collect()
    };
    let (newtons, named) = (by(&in_newtons), by(&called));
    match (newtons.as_slice(), named.as_slice()) {
        ([one], _) | ([], [one]) => Ok(one),
        _ => {
            let names: Vec<&str> = record.channels.iter().map(|c| c.name.as_str()).collect();
            let both: Vec<&&Channel> = newtons.iter().filter(|c| called(c)).collect();
            match both.as_slice() {
                [one] => Ok(one),
                _ => Err(InputError::new(format!(
                    "a time record without exactly one hammer channel ({})",
                    names.join(", ")
                ))
                .file(path)
                .remedy("give the hammer's channel the unit N, or call it force; cutting forces go to `lobestone cfc`")
                .into()),
            }
        }
    }
}

fn from_taps(
    set: &str,
    path: &Path,
    record: &TimeRecord,
    taps: &TapSettings,
    hits: &mut Vec<(String, Vec<Hit>)>,
    warnings: &mut Vec<String>,
) -> Result<FromTaps> {
    let hammer = hammer(record, path)?;
    let sensors: Vec<(&Channel, Quantity)> = record
        .channels
        .iter()
        .filter(|c| !std::ptr::eq(*c, hammer))
        .filter_map(|c| {
            let motion = units::parse(&c.file_unit).and_then(|u| u.dimension.motion());
            if motion.is_none() {
                warnings.push(format!(
                    "{set}: channel {} ({}) is no displacement, velocity or acceleration: left out",
                    c.name, c.file_unit
                ));
            }
            Some((c, motion?))
        })
        .collect();
    if sensors.is_empty() {
        return Err(InputError::new("a tap record without a response channel")
            .file(path)
            .remedy("give the sensors' channels a unit: m/s² or g, m/s, m or µm")
            .into());
    }
    let responses: Vec<&[f64]> = sensors.iter().map(|(c, _)| c.samples.as_slice()).collect();
    let tap = TapRecord {
        sample_rate_hz: record.sample_rate_hz,
        force_n: &hammer.samples,
        responses: &responses,
    };
    let found = modal::impact_test(&tap, taps).map_err(|e| match e {
        Error::Input(e) => (*e).file(path).into(),
        other => other,
    })?;
    warnings.extend(found.warnings.iter().map(|w| format!("{set}: {w}")));
    hits.push((set.to_owned(), found.hits));
    let frfs = sensors
        .iter()
        .enumerate()
        .map(|(k, (channel, quantity))| FrfInput {
            name: format!("{}/{}", channel.name, hammer.name),
            set: set.to_owned(),
            dofs: None,
            receptance_m_per_n: receptance(&found.frequency_hz, &found.frf[k], Some(*quantity)),
            frequency_hz: found.frequency_hz.clone(),
            coherence: found.coherence.as_ref().map(|c| c[k].clone()),
            added_decay_per_s: found.added_decay_per_s,
        })
        .collect();
    Ok(FromTaps {
        frfs,
        contradictory: found.contradictory,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accelerance_and_mobility_become_receptance() {
        let f = 10.0;
        let omega = TAU * f;
        let of = |value: Complex64, quantity| receptance(&[f], &[value], quantity)[0].re;
        let a = of(
            Complex64::new(-omega * omega * 2e-6, 0.0),
            Some(Quantity::Accelerance),
        );
        let v = of(Complex64::new(0.0, omega * 2e-6), Some(Quantity::Mobility));
        let x = of(Complex64::new(2e-6, 0.0), None);
        for value in [a, v, x] {
            approx::assert_relative_eq!(value, 2e-6, max_relative = 1e-12);
        }
    }
}
