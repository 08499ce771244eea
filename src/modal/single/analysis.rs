//! One FRF: peaks, the three fits at each, and what is worth a warning.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::Result;
use crate::modal::settings::{SET, Settings};
use crate::modal::single::curve::{Curve, MIN_LINES, detuning, reach};
use crate::modal::single::frf_modes::{Disturbance, FrfMode, FrfModes, Method, ModeEstimate};
use crate::modal::single::local_fit::{self, LocalSolution, Pole, Problem, ROUGHLY_SETTLED, SETTLED};
use crate::modal::single::method_bias::{FittedCurves, MethodBias};
use crate::modal::single::peaks::{self, FrfPeak};
use crate::modal::single::{circle_fit, half_power};

/// Half-widths (ζf₀) on either side of a peak that take part in the local fit: the window whose fit is best
/// determined is kept, so that a wide one averages noise and a narrow one avoids what is not modelled.
const WINDOWS_HALF_WIDTHS: [f64; 3] = [8.0, 5.0, 3.0];
/// More FRFs than this are fitted singly in one window each, with fewer neighbours: their modes are those of the set.
const MANY_FRFS: usize = 12;
/// A [`SET`] is fitted that way, too, where its FRFs have more lines than this together.
const MANY_LINES: usize = 60_000;
/// A window is wide enough where its inner lines are left with at least this share of the power of all.
const NOISE_SHARE: f64 = 0.8;
/// Lines on either side of a peak that take part at least.
const WINDOW_LINES: usize = 4;
/// How an FRF's peaks are fitted.
#[derive(Clone, Copy)]
struct Effort {
    /// See [`WINDOWS_HALF_WIDTHS`].
    windows: &'static [f64],
    /// Neighbouring peaks fitted together with a mode, on each side.
    neighbours: usize,
}

const FULL: Effort = Effort {
    windows: &WINDOWS_HALF_WIDTHS,
    neighbours: 2,
};
const BRIEF: Effort = Effort {
    windows: &[5.0],
    neighbours: 1,
};
/// Above this a fit is no vibration mode.
const MAX_DAMPING: f64 = 0.5;
/// A damping estimate scattering by more than this part of itself is no finding (where lines are not too coarse).
const MAX_RELATIVE_STD: f64 = 0.7;
/// Where lines are coarse the damping depends on one or two of them, and leakage between lines comes on top of
/// the noise: an allowance of this part of the line spacing on the half-power width. (Three measured
/// free–free beam records at 0.05–0.2 lines in the band differ from each other by about this much.)
const LEAKAGE_LINES: f64 = 0.02;
/// A local fit that leaves this many times the noise power lacks something.
const MORE_THAN_NOISE: f64 = 2.0;
/// One more pole that leaves less than this part of the variance is a mode.
const MOST_TAKEN_AWAY: f64 = 0.5;
/// One more pole that is damped this many times as much as its neighbour is no mode there but a shape of the residual.
const MOST_DAMPED: f64 = 5.0;
/// The sense of turning of a peak counts by its height over what is around it, up to this.
const MOST_WEIGHT: f64 = 50.0;
/// What turns the wrong way weighs so many times the rest before a whole FRF is taken to be conjugated, which is rare.
const CONJUGATED: f64 = 2.0;
/// FRFs that so many peaks say to be conjugated are so whatever the others are; of fewer, noise may have turned the one that counts.
const OWN_WORD: usize = 3;
/// A peak that rises by less than this part of its height is a ripple.
const RIPPLE: f64 = 0.5;
/// Modes nearer to each other than this many sums of their half-widths overlap.
const OVERLAP_WIDTHS: f64 = 4.0;
/// A bias of the damping below this part of it is not worth a word.
const WORTH_TELLING: f64 = 0.02;
/// A simpler method whose error is below this part of the local fit's is to be taken instead.
const MUCH_BETTER: f64 = 0.7;
/// Modes of one FRF closer than this part of their half-width are one.
const SAME_WIDTHS: f64 = 0.1;
/// Standard deviations of noise that a mode rises above at a line that shows it.
const LEAST_HEIGHT: f64 = 3.0;
/// Fewer lines than this inside the half-power band are worth a warning.
const FINE_LINES: f64 = 3.0;

/// Finds the modes of each of many FRFs: [`analyse_frf`], with less effort on each where there are more than twelve, or more
/// than 60,000 lines in at least four ([`FrfModes::brief`]), unless those of each are asked for.
///
/// # Errors
/// As [`analyse_frf`].
pub fn analyse_frfs<F, H>(frfs: &[(F, H)], settings: &Settings) -> Result<Vec<FrfModes>>
where
    F: AsRef<[f64]> + Sync,
    H: AsRef<[Complex64]> + Sync,
{
    let lines = || frfs.iter().map(|(f, _)| f.as_ref().len()).sum::<usize>();
    let many = frfs.len() > MANY_FRFS || (frfs.len() >= SET && lines() > MANY_LINES);
    let effort = if many && !settings.each { BRIEF } else { FULL };
    let ready: Vec<Ready> = frfs
        .par_iter()
        .map(|(f, h)| Ready::new(f.as_ref(), h.as_ref(), settings))
        .collect::<Result<_>>()?;
    // One analyser counts the phases of all its FRFs in one way.
    let all = ready
        .iter()
        .fold(Turning::default(), |sum, r| sum.with(&r.turning));
    let conjugated: Vec<bool> = ready
        .iter()
        .map(|r| {
            let own = r.turning.is_conjugated();
            match own == all.is_conjugated() || r.turning.peaks[usize::from(own)] >= OWN_WORD {
                true => own,
                false => !own,
            }
        })
        .collect();
    Ok(ready
        .into_par_iter()
        .zip(conjugated)
        .map(|(ready, conjugated)| analyse(ready, conjugated, effort))
        .collect())
}

/// Finds the modes of one FRF.
///
/// `frequency_hz` in ascending order, `receptance_m_per_n` (displacement per force, e^{+iωt}) on the same
/// lines. The 0 Hz line and lines that are not finite are left out.
///
/// # Errors
/// Lengths differ, or frequencies are not finite and ascending. Too few lines or no modes are no error:
/// the result is empty and its warnings say why.
pub fn analyse_frf(
    frequency_hz: &[f64],
    receptance_m_per_n: &[Complex64],
    settings: &Settings,
) -> Result<FrfModes> {
    let ready = Ready::new(frequency_hz, receptance_m_per_n, settings)?;
    let conjugated = ready.turning.is_conjugated();
    Ok(analyse(ready, conjugated, FULL))
}

/// An FRF with its peaks, and which way each turns (`None` where noise hides it; true: the wrong way).
struct Ready {
    curve: Curve,
    noise_std: Vec<f64>,
    peaks: Vec<FrfPeak>,
    backwards: Vec<Option<bool>>,
    turning: Turning,
}

impl Ready {
    fn new(frequency_hz: &[f64], receptance_m_per_n: &[Complex64], settings: &Settings) -> Result<Ready> {
        let curve = Curve::from_receptance(frequency_hz, receptance_m_per_n, settings.band_hz)?;
        let (mut noise_std, mut peaks) = (Vec::new(), Vec::new());
        if curve.len() >= MIN_LINES {
            noise_std = curve.noise_std();
            peaks = peaks::find(&curve, &noise_std);
        }
        let backwards: Vec<Option<bool>> = peaks
            .iter()
            .map(|p| {
                let lines = p.from.saturating_sub(1)..(p.to + 2).min(curve.len());
                circle_fit::turns_backwards(&curve, lines, noise_std[p.index])
            })
            .collect();
        let turning = Turning::of(&peaks, &backwards);
        Ok(Ready {
            curve,
            noise_std,
            peaks,
            backwards,
            turning,
        })
    }
}

/// Which way the peaks of an FRF turn: those that turn as they must first, then those that turn the wrong way.
#[derive(Debug, Clone, Copy, Default)]
struct Turning {
    /// The resonances tell, not the ripples between them, however many those are: each by its height over what is around it.
    weight: [f64; 2],
    /// How many rise out of what is around them.
    peaks: [usize; 2],
}

impl Turning {
    fn of(peaks: &[FrfPeak], backwards: &[Option<bool>]) -> Turning {
        let mut turning = Turning::default();
        for (p, sense) in peaks.iter().zip(backwards) {
            if let Some(wrong) = sense.map(usize::from) {
                turning.weight[wrong] += (1.0 - p.rise).recip().min(MOST_WEIGHT);
                turning.peaks[wrong] += usize::from(p.rise >= RIPPLE);
            }
        }
        turning
    }

    fn with(self, other: &Turning) -> Turning {
        Turning {
            weight: [0, 1].map(|k| self.weight[k] + other.weight[k]),
            peaks: [0, 1].map(|k| self.peaks[k] + other.peaks[k]),
        }
    }

    /// The highest peak alone does not say so: a mode on two or three noisy lines turns as it likes.
    fn is_conjugated(&self) -> bool {
        self.weight[1] > CONJUGATED * self.weight[0] && self.peaks[1] >= self.peaks[0]
    }
}

fn analyse(ready: Ready, conjugated: bool, effort: Effort) -> FrfModes {
    let Ready {
        mut curve,
        noise_std,
        mut peaks,
        backwards,
        ..
    } = ready;
    let mut result = FrfModes {
        conjugated,
        ..FrfModes::default()
    };
    if curve.dropped > 0 {
        result.warnings.push(format!(
            "{} lines are not finite and were left out",
            curve.dropped
        ));
    }
    if curve.len() < MIN_LINES {
        result.warnings.push(format!(
            "only {} usable lines in the band: no modes can be found (at least {MIN_LINES} are needed)",
            curve.len()
        ));
        return result;
    }
    if result.conjugated {
        curve.conjugate();
        result.warnings.push(
            "the phase is conjugated (sign convention e^(-iωt)): the FRF was turned to e^(+iωt)".into(),
        );
    }
    // What still turns the wrong way would have negative damping.
    let mut turn = backwards.iter().map(|b| *b == Some(!result.conjugated));
    peaks.retain(|p| {
        let wrong = turn.next().unwrap_or(false);
        if wrong {
            result.warnings.push(format!(
                "the peak at {:.2} Hz turns the wrong way round (negative damping): left out",
                curve.frequency_hz[p.index]
            ));
        }
        !wrong
    });

    let starts: Vec<Start> = peaks
        .iter()
        .map(|p| Start::new(&curve, p, noise_std[p.index]))
        .collect();
    let mut refused = Vec::new();
    let mut found = Vec::new();
    for (index, start) in starts.iter().enumerate() {
        match mode_at(&curve, &starts, index, noise_std[start.peak.index], effort) {
            Ok(mode) => found.push(mode),
            Err(why) => {
                refused.push(format!("{:.2} Hz ({why})", curve.frequency_hz[start.peak.index]));
            }
        }
    }
    settle(&curve, &mut found, &noise_std, effort);
    result.brief = effort.windows.len() < FULL.windows.len();
    result.modes = found.into_iter().map(|f| f.mode).collect();
    result
        .modes
        .sort_by(|a, b| a.best().frequency_hz.total_cmp(&b.best().frequency_hz));
    // Two peaks whose fits ended in the same pole are one mode.
    result.modes.dedup_by(|b, a| {
        let (first, second) = (a.best(), b.best());
        let width = first.damping_ratio.min(second.damping_ratio) * first.frequency_hz;
        let same = second.frequency_hz - first.frequency_hz < SAME_WIDTHS * width;
        if same && b.significance > a.significance {
            std::mem::swap(a, b);
        }
        same
    });
    let (modes, undetermined): (Vec<FrfMode>, Vec<FrfMode>) = std::mem::take(&mut result.modes)
        .into_iter()
        .partition(|mode| match what_is_open(mode, &curve, &peaks, &noise_std) {
            Some(why) => {
                refused.push(format!("{:.2} Hz ({why})", mode.best().frequency_hz));
                false
            }
            None => true,
        });
    (result.modes, result.undetermined) = (modes, undetermined);
    if !refused.is_empty() {
        result
            .remarks
            .push(format!("peaks not reported as modes: {}", refused.join(", ")));
    }
    quality_remarks(&result.modes, &mut result.remarks);
    result
}

/// What the lines leave open of a mode, all that is known of its errors put together, where that is too much to call it one.
fn what_is_open(mode: &FrfMode, curve: &Curve, peaks: &[FrfPeak], noise_std: &[f64]) -> Option<&'static str> {
    let best = mode.best();
    let distance = |p: &FrfPeak| (curve.frequency_hz[p.index] - best.frequency_hz).abs();
    let peak = peaks.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    if !reach(&curve.frequency_hz, best.frequency_hz) {
        return Some("beyond the measured lines");
    }
    let half_width_hz = best.damping_ratio * best.frequency_hz;
    let placed_hz = half_width_hz.max(0.5 * curve.spacing_hz(peak.index));
    if best.frequency_std_hz.is_some_and(|std| std > placed_hz) {
        return Some("its lines do not determine its frequency");
    }
    // A resonance narrower than a line rises out of what is around it; noise and hum are ripples on it.
    let unknown_width = best
        .damping_std
        .is_some_and(|std| std > MAX_RELATIVE_STD * best.damping_ratio);
    if !unknown_width {
        return None;
    }
    if peak.rise < RIPPLE {
        return Some("a ripple whose width its lines do not determine");
    }
    let shows = |line: usize| {
        let residue = best.modal_constant? / (2.0 * TAU * best.frequency_hz);
        let u = detuning(*curve.frequency_hz.get(line)?, best.frequency_hz);
        let height = (residue / Complex64::new(best.damping_ratio, u)).norm();
        Some(height >= LEAST_HEIGHT * noise_std.get(line)?)
    };
    let beside = [peak.index.wrapping_sub(1), peak.index + 1];
    // Its skirts tell a mode from a disturbance.
    (!beside.into_iter().any(|line| shows(line).unwrap_or(true)))
        .then_some("one line that stands out, without the skirts of a mode")
}

/// A peak with the first estimate of its pole.
struct Start {
    peak: FrfPeak,
    pole: Pole,
    half_power: Option<half_power::HalfPower>,
}

impl Start {
    fn new(curve: &Curve, peak: &FrfPeak, noise_std: f64) -> Start {
        let half_power = half_power::fit(curve, peak.index, noise_std);
        let f = &curve.frequency_hz;
        let f0 = f[peak.index];
        // Without half-power: |Y| has half its height at u = ±√3 ζ.
        let width = (f[peak.to] - f[peak.from]).max(curve.spacing_hz(peak.index));
        let pole = half_power.map_or(
            Pole {
                frequency_hz: f0,
                damping_ratio: (0.5 * width / (3f64.sqrt() * f0)).min(0.3),
            },
            |h| Pole {
                frequency_hz: h.frequency_hz,
                damping_ratio: h.damping_ratio.min(0.3),
            },
        );
        Start {
            peak: *peak,
            pole,
            half_power,
        }
    }
}

fn mode_at(
    curve: &Curve,
    starts: &[Start],
    index: usize,
    noise_std: f64,
    effort: Effort,
) -> std::result::Result<Found, String> {
    let start = &starts[index];
    let f = &curve.frequency_hz;
    let line_hz = curve.spacing_hz(start.peak.index);
    let mut estimates = Vec::with_capacity(3);
    let local = local(curve, starts, index, effort);
    let mut why = "its lines do not determine a pole".to_string();
    if let Some((solution, pole, _)) = &local {
        match judge(curve, solution, *pole, &start.peak, noise_std) {
            Ok(estimate) => estimates.push(estimate),
            Err(problem) => why = problem,
        }
    }
    let near = estimates.first().map_or(start.pole, |e| Pole {
        frequency_hz: e.frequency_hz,
        damping_ratio: e.damping_ratio,
    });
    if let Some(circle) = circle_fit::fit(curve, near.frequency_hz, near.damping_ratio) {
        let w0 = TAU * circle.frequency_hz;
        estimates.push(ModeEstimate {
            method: Method::CircleFit,
            frequency_hz: circle.frequency_hz,
            damping_ratio: circle.damping_ratio,
            frequency_std_hz: Some(circle.frequency_std_hz),
            damping_std: Some(circle.damping_std),
            frequency_bias_hz: None,
            damping_bias: None,
            damping_spread: circle.damping_spread,
            modal_constant: Some(circle.diameter * (2.0 * circle.damping_ratio * w0)),
            one_sided: false,
        });
    }
    if let Some(half) = start.half_power {
        estimates.push(ModeEstimate {
            method: Method::HalfPower,
            frequency_hz: half.frequency_hz,
            damping_ratio: half.damping_ratio,
            frequency_std_hz: half.std.map(|s| s.frequency_hz),
            damping_std: half.std.map(|s| s.damping_ratio),
            frequency_bias_hz: None,
            damping_bias: None,
            damping_spread: None,
            modal_constant: None,
            one_sided: half.reached != [true, true],
        });
    }

    // Inside the band by at least a line, near the peak, damping known better than not at all.
    let (low, high) = (f[1], f[f.len() - 2]);
    estimates.retain(|e| {
        let inside = e.frequency_hz >= low && e.frequency_hz <= high;
        let width = (e.damping_ratio * e.frequency_hz).max(line_hz);
        let near = (e.frequency_hz - f[start.peak.index]).abs()
            <= 2.0 * width.max(f[start.peak.to] - f[start.peak.from]);
        inside && near && e.damping_ratio < MAX_DAMPING
    });
    // The other methods have no residual terms: they alone do not make a mode of what the local fit refused.
    let Some(best) = estimates.first().filter(|e| e.method == Method::LocalFit) else {
        return Err(why);
    };
    // A neighbour's flank can pull the simpler methods off their peak: what contradicts the local fit is
    // another mode's, or nobody's.
    let best = best.clone();
    let half_width_hz = best.damping_ratio * best.frequency_hz;
    let methods = estimates.len();
    estimates.retain(|e| {
        (e.frequency_hz - best.frequency_hz).abs() <= 0.5 * half_width_hz.max(line_hz)
            && (0.5..=2.0).contains(&(e.damping_ratio / best.damping_ratio))
    });
    let contradicted = estimates.len() < methods;
    let fitted = local.as_ref().and_then(|(solution, pole, lines)| {
        FittedCurves::new(curve, solution, *pole, lines.first, start.peak.index)
    });
    let mut disturbance = None;
    for estimate in estimates.iter_mut().filter(|e| e.method != Method::LocalFit) {
        let bias = fitted.as_ref().and_then(|f| f.bias(estimate.method));
        disturbance = disturbance.or(add_bias(estimate, bias, &best));
    }
    if contradicted {
        disturbance = disturbance.or_else(|| {
            let methods = [Method::CircleFit, Method::HalfPower];
            let gone = methods
                .iter()
                .find(|m| estimates.iter().all(|e| e.method != **m))?;
            fitted.as_ref()?.bias(*gone).map(|bias| bias.cause)
        });
    }
    let lines_in_half_power_band = 2.0 * best.damping_ratio * best.frequency_hz / line_hz;
    if lines_in_half_power_band < FINE_LINES {
        let leakage = LEAKAGE_LINES * line_hz / (2.0 * best.frequency_hz);
        for estimate in &mut estimates {
            estimate.damping_std = estimate.damping_std.map(|std| std.hypot(leakage));
        }
    }
    let Some((solution, pole, lines)) = local else {
        return Err(why);
    };
    let mode = FrfMode {
        lines_in_half_power_band,
        significance: start.peak.significance,
        contradicted,
        disturbance,
        recommended: Method::LocalFit,
        reason: String::new(),
        estimates,
    };
    Ok(Found {
        mode,
        solution,
        pole,
        lines,
    })
}

/// What can be said of a mode only when the others are known: how far they push the local fit, whose window does not hold
/// them all; whether one of them overlaps; which answer is to be taken.
fn settle(curve: &Curve, found: &mut [Found], noise_std: &[f64], effort: Effort) {
    let poles: Vec<(Pole, Complex64)> = found
        .iter()
        .map(|f| (f.solution.poles[f.pole], f.solution.residues[f.pole]))
        .collect();
    for (own, one) in found.iter_mut().enumerate() {
        // Of many FRFs the modes are those of the set; these are but their starts.
        let is_thorough = effort.windows.len() > 1;
        let hidden = is_thorough
            .then(|| hidden_neighbour(curve, one, noise_std))
            .flatten();
        let bias = match hidden {
            Some((bias, _)) => bias,
            None if is_thorough => local_bias(curve, one, &poles),
            None => [0.0; 2],
        };
        for estimate in &mut one.mode.estimates {
            estimate.frequency_std_hz = estimate.frequency_std_hz.map(|std| std + bias[0].abs());
            estimate.damping_std = estimate.damping_std.map(|std| std + bias[1].abs());
        }
        let half_width = |p: &Pole| p.damping_ratio * p.frequency_hz;
        let here = poles[own].0;
        let overlaps = poles.iter().enumerate().any(|(other, (p, _))| {
            let apart = (p.frequency_hz - here.frequency_hz).abs();
            other != own && apart < OVERLAP_WIDTHS * (half_width(p) + half_width(&here))
        });
        if one.mode.contradicted || one.mode.disturbance.is_some() || hidden.is_some() {
            let near = overlaps.then_some(Disturbance::Overlap);
            one.mode.disturbance = near.or(hidden.map(|(_, cause)| cause)).or(one.mode.disturbance);
        }
        (one.mode.recommended, one.mode.reason) =
            recommended(&one.mode.estimates, one.mode.disturbance, one.mode.contradicted);
    }
}

/// Where the local fit leaves more than noise, a mode without a peak of its own may stand beside: one more pole is tried on
/// either side. Where that takes away most of what is left, the answer is by how much the fit without it was off
/// (frequency in Hz, damping ratio), and whether that mode is among the lines or stands for what lies beyond them.
fn hidden_neighbour(curve: &Curve, one: &Found, noise_std: &[f64]) -> Option<([f64; 2], Disturbance)> {
    let lines = one.lines.first..one.lines.first + one.lines.weight.len();
    let (frequency_hz, mobility) = (
        curve.frequency_hz.get(lines.clone())?,
        curve.mobility.get(lines.clone())?,
    );
    let noise: f64 = noise_std.get(lines)?.iter().map(|s| s * s).sum();
    let left: f64 = one.solution.residual.iter().map(|r| r.norm_sqr()).sum();
    let freedom = frequency_hz.len().checked_sub(2 * one.solution.poles.len() + 4)?;
    if freedom < 4 || left < MORE_THAN_NOISE * noise {
        return None;
    }
    let problem = Problem {
        frequency_hz,
        mobility,
        line_weight: one.lines.weight.clone(),
        residual_terms: residual_terms(frequency_hz.len()),
    };
    let own = one.solution.poles[one.pole];
    let starts = [-4.0, -1.5, 1.5, 4.0].map(|widths| Pole {
        frequency_hz: own.frequency_hz * (1.0 + widths * own.damping_ratio),
        ..own
    });
    // A broad mode has its half-widths reach below zero; a pole begins among the lines.
    let lines_hz = *frequency_hz.first()?..=*frequency_hz.last()?;
    let best = starts
        .into_iter()
        .filter(|extra| lines_hz.contains(&extra.frequency_hz))
        .filter_map(|extra| {
            let mut poles = one.solution.poles.clone();
            poles.push(extra);
            local_fit::fit(&problem, &poles, ROUGHLY_SETTLED)
        })
        .min_by(|a, b| a.variance.total_cmp(&b.variance))?;
    let (found, extra) = (best.poles[one.pole], best.poles.last()?);
    let inside = lines_hz.contains(&extra.frequency_hz);
    let cause = match inside && extra.damping_ratio < MOST_DAMPED * own.damping_ratio {
        true => Disturbance::Overlap,
        false => Disturbance::Residual,
    };
    let bias = [
        found.frequency_hz - own.frequency_hz,
        found.damping_ratio - own.damping_ratio,
    ];
    (best.variance < MOST_TAKEN_AWAY * one.solution.variance).then_some((bias, cause))
}

/// By how much the local fit is off (frequency in Hz, damping ratio) on a curve that is the sum of all modes found, fitted on
/// the lines and with the neighbours that it had.
fn local_bias(curve: &Curve, one: &Found, poles: &[(Pole, Complex64)]) -> [f64; 2] {
    let lines = one.lines.first..one.lines.first + one.lines.weight.len();
    let Some(frequency_hz) = curve.frequency_hz.get(lines) else {
        return [0.0; 2];
    };
    let sum = |f: &f64| -> Complex64 {
        poles
            .iter()
            .map(|(p, residue)| {
                let u = crate::modal::single::curve::detuning(*f, p.frequency_hz);
                residue / Complex64::new(p.damping_ratio, u)
            })
            .sum()
    };
    let mobility: Vec<Complex64> = frequency_hz.iter().map(sum).collect();
    let problem = Problem {
        frequency_hz,
        mobility: &mobility,
        line_weight: one.lines.weight.clone(),
        residual_terms: residual_terms(frequency_hz.len()),
    };
    let own = one.solution.poles[one.pole];
    match local_fit::fit(&problem, &one.solution.poles, SETTLED) {
        Some(again) => {
            let found = again.poles[one.pole];
            [
                found.frequency_hz - own.frequency_hz,
                found.damping_ratio - own.damping_ratio,
            ]
        }
        None => [0.0; 2],
    }
}

/// Puts a method's bias at this peak into its errors (where it is not known: its distance from the local fit), and says
/// whether it is more than the noise makes of it anyway.
fn add_bias(
    estimate: &mut ModeEstimate,
    bias: Option<MethodBias>,
    local: &ModeEstimate,
) -> Option<Disturbance> {
    let (frequency_hz, damping) = bias.map_or_else(
        || {
            (
                estimate.frequency_hz - local.frequency_hz,
                estimate.damping_ratio - local.damping_ratio,
            )
        },
        |b| (b.frequency_hz, b.damping_ratio),
    );
    let noise = estimate.damping_std.unwrap_or(0.0);
    (estimate.frequency_bias_hz, estimate.damping_bias) = (Some(frequency_hz), Some(damping));
    estimate.frequency_std_hz = estimate.frequency_std_hz.map(|std| std + frequency_hz.abs());
    estimate.damping_std = estimate.damping_std.map(|std| std + damping.abs());
    let matters = damping.abs() > (0.5 * noise).max(WORTH_TELLING * local.damping_ratio);
    bias.filter(|_| matters).map(|b| b.cause)
}

/// The answer to take and why: the local fit, unless a simpler one is known much better.
fn recommended(
    estimates: &[ModeEstimate],
    disturbance: Option<Disturbance>,
    contradicted: bool,
) -> (Method, String) {
    let error = |e: &ModeEstimate| e.damping_std.unwrap_or(f64::INFINITY);
    let percent = |e: &ModeEstimate| 100.0 * error(e) / e.damping_ratio;
    let local = &estimates[0];
    if disturbance.is_none() && estimates.len() == 1 && error(local) >= local.damping_ratio {
        let reason = "for its frequency alone: these lines do not determine its width; it is a sine (hum, a disturbance), or damped too lightly for them";
        return (local.method, reason.into());
    }
    let simpler = estimates[1..]
        .iter()
        .filter(|e| error(e) < MUCH_BETTER * error(local))
        .min_by(|a, b| error(a).total_cmp(&error(b)));
    if let Some(best) = simpler {
        let reason = format!(
            "it has fewer unknowns, nothing disturbs it here, and its damping is known to {:.1} %, that of the local fit to {:.1} %",
            percent(best),
            percent(local)
        );
        return (best.method, reason);
    }
    let biases: Vec<String> = estimates[1..]
        .iter()
        .filter_map(|e| {
            let share = 100.0 * e.damping_bias? / local.damping_ratio;
            Some(format!("{} by {share:+.1} %", e.method.id()))
        })
        .collect();
    let reason = match disturbance {
        Some(cause) => {
            let off = match (contradicted, &biases[..]) {
                (true, []) => "; the others are far off".to_string(),
                (false, []) => String::new(),
                (_, biases) => format!("; it puts the damping of {} off", biases.join(", of ")),
            };
            format!("{} here: only the local fit has that in it{off}", cause.words())
        }
        None if contradicted => {
            "the other methods contradict it, and it has the neighbours and a residual in it".into()
        }
        None if biases.is_empty() => "the only answer that these lines give".into(),
        None => "all methods agree, and it uses all lines around the peak".into(),
    };
    (local.method, reason)
}

/// Is the fitted pole a mode that this peak shows?
fn judge(
    curve: &Curve,
    solution: &LocalSolution,
    pole: usize,
    peak: &FrfPeak,
    noise_std: f64,
) -> std::result::Result<ModeEstimate, String> {
    let Pole {
        frequency_hz,
        damping_ratio,
    } = solution.poles[pole];
    let (frequency_std_hz, damping_std) = (solution.frequency_std_hz(pole), solution.damping_std(pole));
    let residue = solution.residues[pole];
    let line_hz = curve.spacing_hz(peak.index);
    let coarse = 2.0 * damping_ratio * frequency_hz < FINE_LINES * line_hz;
    if damping_ratio >= MAX_DAMPING {
        return Err(format!("the fit gives a damping ratio of {damping_ratio:.2}"));
    }
    if !coarse && damping_std > MAX_RELATIVE_STD * damping_ratio {
        return Err(format!(
            "its damping ratio {damping_ratio:.3} is uncertain by ±{damping_std:.3}"
        ));
    }
    if frequency_std_hz > (damping_ratio * frequency_hz).max(0.5 * line_hz) {
        return Err("its lines do not determine its frequency".into());
    }
    // Height of the mode at the line nearest to it, against the noise.
    let u = detuning(curve.frequency_hz[peak.index], frequency_hz);
    let height = (residue / Complex64::new(damping_ratio, u)).norm();
    if height < LEAST_HEIGHT * noise_std {
        return Err("the fitted mode is lost in the noise".into());
    }
    Ok(ModeEstimate {
        method: Method::LocalFit,
        frequency_hz,
        damping_ratio,
        frequency_std_hz: Some(frequency_std_hz),
        damping_std: Some(damping_std),
        frequency_bias_hz: None,
        damping_bias: None,
        damping_spread: None,
        // Y = R/(ζ + iu) is iωA/(ω₀² − ω² + 2iζω₀ω) with R = A/(2ω₀).
        modal_constant: Some(residue * (2.0 * TAU * frequency_hz)),
        one_sided: false,
    })
}

/// The lines of a local fit.
struct Lines {
    first: usize,
    weight: Vec<f64>,
}

/// A mode and the local fit behind it.
struct Found {
    mode: FrfMode,
    solution: LocalSolution,
    pole: usize,
    lines: Lines,
}

/// The best determined local fit, the position of the peak's pole in it, and its lines.
fn local(
    curve: &Curve,
    starts: &[Start],
    index: usize,
    effort: Effort,
) -> Option<(LocalSolution, usize, Lines)> {
    let mut best: Option<(f64, LocalSolution, usize, Lines)> = None;
    // A window begins where the one before ended.
    let mut poles: Vec<Pole> = starts.iter().map(|s| s.pole).collect();
    for (k, &reach) in effort.windows.iter().enumerate() {
        let Some(window) = fit_window(curve, starts, &poles, index, reach, effort.neighbours) else {
            continue;
        };
        let narrower = effort.windows.get(k + 1);
        let enough = narrower.is_some_and(|reach| window.as_noisy_within(*reach));
        let WindowFit {
            solution,
            group,
            pole,
            first_line,
            line_weight,
            ..
        } = window;
        for (&member, found) in group.iter().zip(&solution.poles) {
            let first = starts[member].pole;
            let width_hz = first.damping_ratio * first.frequency_hz;
            let near = (found.frequency_hz - first.frequency_hz).abs() < width_hz
                && (0.3..3.0).contains(&(found.damping_ratio / first.damping_ratio));
            poles[member] = if near { *found } else { first };
        }
        let relative_std = solution.damping_std(pole) / solution.poles[pole].damping_ratio;
        if best.as_ref().is_none_or(|(least, ..)| relative_std < *least) {
            best = Some((
                relative_std,
                solution,
                pole,
                Lines {
                    first: first_line,
                    weight: line_weight,
                },
            ));
        }
        if enough {
            break;
        }
    }
    best.map(|(_, solution, pole, lines)| (solution, pole, lines))
}

/// The fit of the lines around a peak.
struct WindowFit<'a> {
    first_line: usize,
    frequency_hz: &'a [f64],
    line_weight: Vec<f64>,
    solution: LocalSolution,
    /// Which starts it holds, and the position of the peak's own among them.
    group: Vec<usize>,
    pole: usize,
}

impl WindowFit<'_> {
    /// Is as much left over within `reach` half-widths of the peak as in the whole window? Then it is noise, and fewer
    /// lines determine the pole less well; what is not modelled shows on the flanks.
    fn as_noisy_within(&self, reach: f64) -> bool {
        let Pole {
            frequency_hz,
            damping_ratio,
        } = self.solution.poles[self.pole];
        let half_hz = reach * damping_ratio * frequency_hz;
        let mut inner = (0.0, 0.0);
        let mut all = (0.0, 0.0);
        let left = self.solution.residual.iter().zip(&self.solution.leverage);
        for ((f, w), (r, leverage)) in self.frequency_hz.iter().zip(&self.line_weight).zip(left) {
            let square = (r * w).norm_sqr();
            let freedom = 1.0 - leverage;
            all = (all.0 + square, all.1 + freedom);
            if (f - frequency_hz).abs() <= half_hz {
                inner = (inner.0 + square, inner.1 + freedom);
            }
        }
        inner.0 * all.1 >= NOISE_SHARE * all.0 * inner.1
    }
}

/// Fits the lines within `reach` half-widths of a peak, from `poles` (one for each start).
fn fit_window<'a>(
    curve: &'a Curve,
    starts: &[Start],
    poles: &[Pole],
    index: usize,
    reach: f64,
    neighbours: usize,
) -> Option<WindowFit<'a>> {
    let start = &starts[index];
    let centre = start.peak.index;
    let half_hz = reach * start.pole.damping_ratio * start.pole.frequency_hz;
    let mut lines = curve.range(
        start.pole.frequency_hz - half_hz,
        start.pole.frequency_hz + half_hz,
    );
    lines.start = lines.start.min(centre.saturating_sub(WINDOW_LINES));
    lines.end = lines.end.max((centre + WINDOW_LINES + 1).min(curve.len()));

    // Neighbours inside the window are fitted with it and the window grows to hold their peak; where there
    // are too many the window ends before the next.
    let mut group = vec![index];
    for (step, neighbour) in (0..index).rev().enumerate() {
        let peak = &starts[neighbour].peak;
        if peak.index < lines.start {
            break;
        }
        if step == neighbours {
            lines.start = lines.start.max(peak.to.min(centre.saturating_sub(WINDOW_LINES)));
            break;
        }
        lines.start = lines.start.min(peak.from.saturating_sub(2));
        group.insert(0, neighbour);
    }
    for (step, neighbour) in (index + 1..starts.len()).enumerate() {
        let peak = &starts[neighbour].peak;
        if peak.index >= lines.end {
            break;
        }
        if step == neighbours {
            lines.end = lines
                .end
                .min(peak.from.max(centre + WINDOW_LINES) + 1)
                .min(curve.len());
            break;
        }
        lines.end = lines.end.max((peak.to + 3).min(curve.len()));
        group.push(neighbour);
    }

    let pole = group.iter().position(|&g| g == index)?;
    let poles: Vec<Pole> = group.iter().map(|&g| poles[g]).collect();
    let first_line = lines.start;
    let f = &curve.frequency_hz[lines.clone()];
    let y = &curve.mobility[lines];
    let mut problem = Problem {
        frequency_hz: f,
        mobility: y,
        line_weight: vec![1.0; f.len()],
        residual_terms: residual_terms(f.len()),
    };

    // Where the peak is a few lines only, its width is anyone's guess: try several.
    let line_hz = curve.spacing_hz(centre);
    let f0 = poles[pole].frequency_hz;
    let mut guesses = vec![poles[pole].damping_ratio];
    if poles[pole].damping_ratio * f0 < 2.0 * line_hz {
        guesses.extend([0.05, 0.3, 1.0].map(|lines| lines * line_hz / f0));
    }
    // What only gives the weights need not be exact.
    let mut rough = y.len() >= local_fit::FEW_LINES;
    let settled = if rough { ROUGHLY_SETTLED } else { SETTLED };
    let mut solution = guesses
        .into_iter()
        .filter_map(|guess| {
            let mut poles = poles.clone();
            poles[pole].damping_ratio = guess;
            local_fit::fit(&problem, &poles, settled)
        })
        .min_by(|a, b| a.variance.total_cmp(&b.variance))?;

    // Noise may be constant or in proportion to the curve; the residual tells, and the weights follow.
    for settled in [ROUGHLY_SETTLED, SETTLED] {
        let Some(weight) = noise_weights(y, &solution) else {
            break;
        };
        problem.line_weight = weight;
        let Some(refined) = local_fit::fit(&problem, &solution.poles, settled) else {
            break;
        };
        solution = refined;
        rough = settled == ROUGHLY_SETTLED;
    }
    if rough && let Some(refined) = local_fit::fit(&problem, &solution.poles, SETTLED) {
        solution = refined;
    }
    Some(WindowFit {
        first_line,
        frequency_hz: f,
        line_weight: problem.line_weight,
        solution,
        group,
        pole,
    })
}

/// Terms of the residual beside the poles, for so many lines.
fn residual_terms(lines: usize) -> usize {
    if lines > 6 { 2 } else { 1 }
}

/// 1/σ of each line from the model variance = a + b |Y|², a and b ≥ 0 from the residual of a fit.
/// `None` where there are too few lines to tell.
fn noise_weights(y: &[Complex64], solution: &LocalSolution) -> Option<Vec<f64>> {
    if y.len() < local_fit::FEW_LINES {
        return None;
    }
    // Model power and expected noise power: a line that the model follows closely shows only 1 − leverage of it.
    let samples: Vec<(f64, f64)> = y
        .iter()
        .zip(&solution.residual)
        .zip(&solution.leverage)
        .map(|((y, r), h)| ((y - r).norm_sqr(), r.norm_sqr() / (1.0 - h).max(0.05)))
        .collect();
    let n = samples.len() as f64;
    let constant = samples.iter().map(|s| s.1).sum::<f64>() / n;
    let proportional = constant / (samples.iter().map(|s| s.0).sum::<f64>() / n);
    if !(constant > 0.0 && proportional.is_finite()) {
        return None;
    }
    let (mut a, mut b) = (0.5 * constant, 0.5 * proportional);
    for _ in 0..10 {
        // |r|² has a standard deviation equal to its mean: weight 1/(a + b|Y|²)².
        let mut sums = [0.0; 5];
        for &(power, square) in &samples {
            let w = (a + b * power).powi(-2);
            for (sum, term) in sums
                .iter_mut()
                .zip([1.0, power, power * power, square, power * square])
            {
                *sum += w * term;
            }
        }
        let [s1, sp, spp, sr, spr] = sums;
        let determinant = s1 * spp - sp * sp;
        (a, b) = (
            (spp * sr - sp * spr) / determinant,
            (s1 * spr - sp * sr) / determinant,
        );
        if b.is_nan() || b <= 0.0 {
            return None;
        }
        // A hundredth of the mean square is taken as constant: no line has all the weight.
        a = a.max(0.01 * constant);
    }
    let weights: Vec<f64> = samples.iter().map(|s| (a + b * s.0).powf(-0.5)).collect();
    let largest = weights.iter().fold(0.0, |m: f64, w| m.max(*w));
    (largest.is_finite() && largest > 0.0).then(|| weights.iter().map(|w| w / largest).collect())
}

fn quality_remarks(modes: &[FrfMode], remarks: &mut Vec<String>) {
    let coarse: Vec<String> = modes
        .iter()
        .filter(|m| m.lines_in_half_power_band < FINE_LINES)
        .map(|m| {
            let best = m.best();
            let known = match best.damping_std {
                Some(std) if std < best.damping_ratio => {
                    format!(
                        "damping uncertain by {:.0} %",
                        (100.0 * std / best.damping_ratio).ceil()
                    )
                }
                _ => "damping unknown".into(),
            };
            format!(
                "{:.2} Hz ({:.2} lines, {known})",
                best.frequency_hz, m.lines_in_half_power_band
            )
        })
        .collect();
    if !coarse.is_empty() {
        remarks.push(format!(
            "too coarse lines, fewer than {FINE_LINES:.0} inside the half-power band: {}",
            coarse.join(", ")
        ));
    }
    let contradicted: Vec<String> = modes
        .iter()
        .filter(|m| m.contradicted)
        .map(|m| format!("{:.2} Hz", m.best().frequency_hz))
        .collect();
    if !contradicted.is_empty() {
        remarks.push(format!(
            "circle fit or half-power contradict the local fit (close modes or coarse lines) and are left out: {}",
            contradicted.join(", ")
        ));
    }
    for cause in [Disturbance::Overlap, Disturbance::Residual] {
        let disturbed: Vec<String> = modes
            .iter()
            .filter(|m| m.disturbance == Some(cause))
            .map(|m| format!("{:.2} Hz", m.best().frequency_hz))
            .collect();
        if !disturbed.is_empty() {
            remarks.push(format!(
                "{}: half-power and circle fit are off there (in their stated errors), take the local fit: {}",
                cause.words(),
                disturbed.join(", ")
            ));
        }
    }
    let one_sided: Vec<String> = modes
        .iter()
        .filter_map(|m| m.estimates.iter().find(|e| e.one_sided))
        .map(|e| format!("{:.2} Hz", e.frequency_hz))
        .collect();
    if !one_sided.is_empty() {
        remarks.push(format!(
            "half-power crossing measured on one side only, the other is the fitted curve's: {}",
            one_sided.join(", ")
        ));
    }
}
