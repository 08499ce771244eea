//! The FRFs of one posture or file, and the modes that they share.

use std::borrow::Cow;
use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::Result;
use crate::modal::chosen::Choice;
use crate::modal::delay::{self, Delay};
use crate::modal::low_end;
use crate::modal::max_likelihood::joint_fit;
use crate::modal::quality::{self, Quality, QualityGrade};
use crate::modal::{self, FrfModes, GlobalModes, RejectedMode, SetMember, Settings};

/// One FRF to analyse.
#[derive(Debug, Clone)]
pub struct FrfInput {
    /// For people, and to tell one FRF of the set from another.
    pub name: String,
    /// Posture or file: FRFs of one set share their modes.
    pub set: String,
    /// Response and reference, as text that is equal where the degree of freedom is.
    pub dofs: Option<[String; 2]>,
    /// Lines, ascending.
    pub frequency_hz: Vec<f64>,
    /// By line.
    pub receptance_m_per_n: Vec<Complex64>,
    /// By line, 0 to 1; `None` where the file has none.
    pub coherence: Option<Vec<f64>>,
    /// What an exponential window added to ζω of every mode; taken out of the results.
    pub added_decay_per_s: f64,
}

/// One FRF and what was found in it.
#[derive(Debug, Clone)]
pub struct AnalysedFrf {
    /// The FRF.
    pub input: FrfInput,
    /// Modes found in this FRF alone.
    pub modes: FrfModes,
    /// How far it can be trusted.
    pub quality: Quality,
}

/// One posture or file.
#[derive(Debug, Clone)]
pub struct SetModes {
    /// The posture or file.
    pub set: String,
    /// In the order of the inputs.
    pub frfs: Vec<AnalysedFrf>,
    /// Degrees of freedom by the numbers that [`modal::GlobalMode::shape`] uses.
    pub dofs: Vec<String>,
    /// The modes that all FRFs share.
    pub global: GlobalModes,
    /// How far the set can be trusted: the worse of its FRFs and of the shared fit.
    pub verdict: QualityGrade,
    /// The verdict in words.
    pub why: String,
}

impl SetModes {
    /// Makes the modes what the analyst wants, and judges the set by what these leave.
    ///
    /// # Errors
    /// In words: those of [`Choice::apply`].
    pub(crate) fn choose(&mut self, choice: &Choice) -> std::result::Result<(), String> {
        if choice.is_empty() {
            return Ok(());
        }
        let dofs = dofs_of_frfs(self);
        choice.apply(&mut self.global, &dofs)?;
        // What was said of the FRFs before holds no more.
        let before = quality::of_set(&self.frfs.iter().map(|f| &f.quality).collect::<Vec<_>>()).1;
        let quality = &mut self.global.quality;
        quality.reasons.retain(|reason| *reason != before);
        if quality.reasons.is_empty() {
            quality.verdict = QualityGrade::Good;
        }
        let inputs: Vec<&FrfInput> = self.frfs.iter().map(|f| &f.input).collect();
        let (qualities, verdict, why) = judge(&inputs, &mut self.global);
        for (frf, quality) in self.frfs.iter_mut().zip(qualities) {
            frf.quality = quality;
        }
        (self.verdict, self.why) = (verdict, why);
        Ok(())
    }
}

/// Response and reference of each FRF as numbers of [`SetModes::dofs`].
pub fn dofs_of_frfs(set: &SetModes) -> Vec<Option<[usize; 2]>> {
    let number = |name: &String| set.dofs.iter().position(|d| d == name);
    set.frfs
        .iter()
        .map(|f| {
            let [response, reference] = f.input.dofs.as_ref()?;
            Some([number(response)?, number(reference)?])
        })
        .collect()
}

/// The modes of one set.
///
/// # Errors
/// Frequencies that are not ascending.
pub(crate) fn analyse_set(set: String, inputs: Vec<FrfInput>, settings: &Settings) -> Result<SetModes> {
    let sines = sines_of(&inputs);
    // Who asks for a band has it.
    let sound_hz = match settings.band_hz {
        Some(_) => vec![None; inputs.len()],
        None => sound_from_hz(&inputs),
    };
    #[allow(clippy::type_complexity)]
    let clean: Vec<(Cow<[f64]>, Cow<[Complex64]>)> = inputs
        .iter()
        .zip(&sound_hz)
        .map(|(input, sound_hz)| {
            let (f, h) = (&input.frequency_hz[..], &input.receptance_m_per_n[..]);
            let from = sound_hz.map_or(0, |sound| f.partition_point(|f| *f < sound));
            let (f, h) = (&f[from..], &h[from..]);
            if sines.is_empty() {
                return (Cow::Borrowed(f), Cow::Borrowed(h));
            }
            let (f, h) = modal::without_sines(f, h, &sines);
            (Cow::Owned(f), Cow::Owned(h))
        })
        .collect();
    // What all FRFs have together does not depend on whether those of each are asked for.
    let starts = Settings {
        each: false,
        ..*settings
    };
    let mut single = modal::analyse_frfs(&clean, &starts)?;
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
    if settings.each && single.iter().any(|frf| frf.brief) {
        single = modal::analyse_frfs(&clean, settings)?;
    }
    global.warnings.extend(shorter_bands(&inputs, settings.band_hz));
    if let Some(highest) = sound_hz.iter().flatten().copied().reduce(f64::max) {
        global.warnings.push(format!(
            "the lines below {highest:.2} Hz scatter by as much as they are large (below what the sensor measures or the force excites): \
             left out (a --band takes them)"
        ));
    }
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
    let (qualities, verdict, why) = judge(&inputs.iter().collect::<Vec<_>>(), &mut global);
    // A record's window is the same for all its FRFs.
    let added = inputs.iter().map(|i| i.added_decay_per_s).fold(0.0, f64::max);
    for mode in &mut global.modes {
        [mode.frequency_hz, mode.damping_ratio] =
            without_window(mode.frequency_hz, mode.damping_ratio, added);
    }
    let step_hz = |at_hz: f64| {
        let steps = inputs
            .iter()
            .map(|i| joint_fit::spacing_hz(&i.frequency_hz, at_hz));
        steps.fold(f64::INFINITY, f64::min)
    };
    let against: Vec<Option<String>> = global
        .modes
        .iter()
        .map(|mode| {
            let hum = modal::undamped_hum(mode.frequency_hz, mode.damping_ratio, step_hz(mode.frequency_hz));
            let undamped = mode.damping_ratio <= 0.0;
            hum.map(|hum| format!("{hum}: a sine that does not die away"))
                .or_else(|| undamped.then(|| "no damping is left when the window's is taken out".to_owned()))
        })
        .collect();
    leave_out(&mut global, &against);
    let frfs = inputs
        .into_iter()
        .zip(single)
        .zip(qualities)
        .map(|((input, mut modes), quality)| {
            for mode in &mut modes.modes {
                for e in &mut mode.estimates {
                    let added = input.added_decay_per_s;
                    [e.frequency_hz, e.damping_ratio] =
                        without_window(e.frequency_hz, e.damping_ratio, added);
                }
                mode.estimates.retain(|e| e.damping_ratio > 0.0);
            }
            modes.modes.retain(|m| !m.estimates.is_empty());
            modes.leave_out_unknown_errors();
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

/// Moves modes to those that are rejected, for the reasons given mode by mode, and tells it.
fn leave_out(global: &mut GlobalModes, why: &[Option<String>]) {
    let stays = |k: usize| why[k].is_none();
    let keep = |row: &[f64]| {
        (0..row.len())
            .filter(|k| stays(*k))
            .map(|k| row[k])
            .collect::<Vec<f64>>()
    };
    if global.mac.len() == why.len() {
        let rows = global.mac.iter().enumerate().filter(|(k, _)| stays(*k));
        global.mac = rows.map(|(_, row)| keep(row)).collect();
    }
    let (modes, mut told) = (std::mem::take(&mut global.modes), Vec::new());
    for (mode, why) in modes.into_iter().zip(why) {
        match why {
            None => global.modes.push(mode),
            Some(reason) => {
                told.push(format!("{:.2} Hz ({reason})", mode.frequency_hz));
                global.rejected.push(RejectedMode {
                    frequency_hz: mode.frequency_hz,
                    damping_ratio: mode.damping_ratio,
                    reason: reason.clone(),
                });
            }
        }
    }
    if !told.is_empty() {
        global
            .rejected
            .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        global.warnings.push(format!("left out: {}", told.join(", ")));
    }
}

/// Frequency (Hz) and damping ratio of the pole that lies left of the real axis by `added_decay_per_s` less: the frequency at which it
/// swings stays, |λ| does not. A damping ratio of zero and less: the window made it.
fn without_window(frequency_hz: f64, damping_ratio: f64, added_decay_per_s: f64) -> [f64; 2] {
    if added_decay_per_s == 0.0 {
        return [frequency_hz, damping_ratio];
    }
    let omega = TAU * frequency_hz;
    let swing = omega * (1.0 - damping_ratio * damping_ratio).max(0.0).sqrt();
    let decay = damping_ratio * omega - added_decay_per_s;
    let own = swing.hypot(decay);
    [own / TAU, decay / own]
}

/// The FRFs by what the common modes leave of them, and the verdict on the set with its words: the worse of its FRFs and of the common
/// fit, whose own verdict it becomes.
fn judge(inputs: &[&FrfInput], global: &mut GlobalModes) -> (Vec<Quality>, QualityGrade, String) {
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
    let (of_frfs, of_frfs_in_words) = quality::of_set(&qualities.iter().collect::<Vec<_>>());
    let reasons = global.quality.reasons.iter().cloned();
    let why: Vec<String> = std::iter::once(of_frfs_in_words.clone()).chain(reasons).collect();
    if of_frfs > global.quality.verdict {
        global.quality.verdict = of_frfs;
        global.quality.reasons.insert(0, of_frfs_in_words);
    }
    (qualities, global.quality.verdict, why.join("; "))
}

/// The FRFs whose lines end well before those of the others, within the band that is looked at (Hz), in words.
fn shorter_bands(inputs: &[FrfInput], band_hz: Option<[f64; 2]>) -> Option<String> {
    /// Less of the longest band than this is worth a warning.
    const WELL_BEFORE: f64 = 0.9;
    const MOST_NAMES: usize = 4;
    let end = band_hz.map_or(f64::INFINITY, |[_, to]| to);
    let last_hz = |input: &FrfInput| input.frequency_hz.last().map_or(0.0, |f| f.min(end));
    let longest_hz = inputs.iter().map(last_hz).fold(0.0, f64::max);
    let shorter: Vec<String> = inputs
        .iter()
        .filter(|input| last_hz(input) < WELL_BEFORE * longest_hz)
        .map(|input| format!("{} ({:.1} Hz)", input.name, last_hz(input)))
        .collect();
    let more = match shorter.len().saturating_sub(MOST_NAMES) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!shorter.is_empty()).then(|| {
        format!(
            "lines that end before those of the other FRFs ({longest_hz:.1} Hz) say nothing of the modes beyond: {}{more}",
            shorter[..shorter.len().min(MOST_NAMES)].join(", ")
        )
    })
}

/// By FRF, the frequency from which on its lines are more than rubbish, Hz; `None` where the lowest are as good as the others.
fn sound_from_hz(inputs: &[FrfInput]) -> Vec<Option<f64>> {
    let mut sound_hz = vec![None; inputs.len()];
    let mut todo: Vec<usize> = (0..inputs.len()).collect();
    while let Some(&first) = todo.first() {
        let lines_hz = &inputs[first].frequency_hz;
        let (same, other): (Vec<usize>, Vec<usize>) =
            todo.iter().partition(|&&k| inputs[k].frequency_hz == *lines_hz);
        let curves: Vec<&[Complex64]> = same
            .iter()
            .map(|&k| inputs[k].receptance_m_per_n.as_slice())
            .collect();
        let line = low_end::first_sound_line(lines_hz, &curves);
        if line > lines_hz.partition_point(|f| *f <= 0.0) {
            same.iter()
                .for_each(|&k| sound_hz[k] = lines_hz.get(line).copied());
        }
        todo = other;
    }
    sound_hz
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
pub(crate) fn set_warnings(set: &SetModes) -> Vec<String> {
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
        let frfs = match refused {
            1 => "1 FRF has".to_string(),
            n => format!("{n} FRFs have"),
        };
        lines.push(format!(
            "{}: {frfs} peaks that are no modes (which: --json)",
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
        let mut line = format!("{}: {}: {}", set.set, set.verdict, set.why);
        if !worst.is_empty() {
            line += &format!(": {}", worst.join("; "));
        }
        lines.push(line);
    }
    lines
}

/// By FRF: its response (its name where that is not known), and how late it is against the force.
fn delays(set: &SetModes) -> Vec<(String, Option<Delay>)> {
    // A pole beside its place turns the constant by as many of its half-widths.
    let scatter = set.global.quality.frequency_scatter.unwrap_or(0.0);
    let own = set.frfs.iter().enumerate();
    own.map(|(k, frf)| {
        let modes: Vec<(f64, Complex64, f64)> = set
            .global
            .modes
            .iter()
            .filter_map(|m| {
                let (constant, std) = (*m.constants.get(k)?)?;
                let std = std.hypot(constant.norm() * scatter / m.damping_ratio);
                Some((m.frequency_hz, constant, std))
            })
            .collect();
        let name = frf.input.dofs.as_ref().map_or(&frf.input.name, |d| &d[0]);
        (name.clone(), delay::delay(&modes))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pole_without_the_window_is_the_own_one() {
        let (omega, zeta, decay): (f64, f64, f64) = (TAU * 11.263, 0.02, 1.0 / 0.3);
        let own = Complex64::new(-zeta * omega, omega * (1.0 - zeta * zeta).sqrt());
        let windowed = own - decay;
        let [f, found] = without_window(windowed.norm() / TAU, -windowed.re / windowed.norm(), decay);
        assert!(
            (f / 11.263 - 1.0).abs() < 1e-12 && (found / zeta - 1.0).abs() < 1e-10,
            "{f} {found}"
        );
        assert_eq!(without_window(10.0, 0.01, 0.0), [10.0, 0.01]);
        assert!(without_window(10.0, 0.01, 1.0)[1] < 0.0);
    }

    #[test]
    fn frfs_with_a_shorter_band_are_named() {
        let input = |name: &str, last_hz: f64| FrfInput {
            name: name.into(),
            set: "set".into(),
            dofs: None,
            frequency_hz: vec![1.0, last_hz],
            receptance_m_per_n: vec![Complex64::ONE; 2],
            coherence: None,
            added_decay_per_s: 0.0,
        };
        let mut inputs = vec![input("a", 200.0), input("b", 195.0), input("c", 40.0)];
        let said = shorter_bands(&inputs, None).unwrap();
        assert!(
            said.contains("(200.0 Hz)") && said.ends_with("beyond: c (40.0 Hz)"),
            "{said}"
        );
        // What is not looked at may be missing.
        assert_eq!(shorter_bands(&inputs, Some([0.0, 42.0])), None);
        inputs.extend((0..6).map(|k| input(&format!("d{k}"), 100.0)));
        assert!(shorter_bands(&inputs, None).unwrap().ends_with("and 3 more"));
    }
}
