//! Wrong wiring and wrong filters of force records: the dynamometer's axes, a channel's gain, an amplifier's low-pass.
//!
//! The mean forces of a few feeds fit six coefficients through any wiring; the waveform over a revolution and what
//! coefficients a cut can have do not. Another reading of the channels is another `tool_from_dyno`: it is fitted anew, and
//! those that leave equally little are told apart by their coefficients.

mod direction;
mod plausible;

use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;

use super::decide::{Noise, Rival, Rivals, TriedMistake, decide};
use super::examine::SetupCheck;
use super::finding::{SetupFinding, with_error};
use super::readings::Turn;
use crate::Result;
use crate::data::Process;
use crate::identify::forces::cutting_study::{NOISE_KNOWN_TO, calibrate_cutting, small_errors};
use crate::identify::{Calibration, CuttingData, CuttingModel, CuttingProblem};
use crate::signal::SpindleTrack;
use crate::text::listed;
use direction::milling_direction;
use plausible::{FittedReading, IMPLAUSIBLE, MUCH_BETTER, SUSPICIOUS, fit, improbability};

/// Cuts that readings of the axes are tried on.
const CUTS: usize = 4;
/// Cuts of which one may be said to be other than stated: of fewer each could be the one.
const FEWEST_CUTS: usize = 4;
/// Cuts that a wrong feed or depth is looked for in: a wrong one pulls at the coefficients and need not be the worst itself.
const WORST_CUTS: usize = 3;
/// Readings that leave no more than this times the least are equal.
const ALIKE: f64 = 1.1;

/// The dynamometer's axes first, for nothing else can be judged before; then gain and filter of the channels. Last what was taken out
/// while the records were read.
///
/// # Errors
/// Records that no model can be fitted to.
pub fn examine_cutting(data: &CuttingData, rival: impl FnOnce() -> Option<Rival>) -> Result<SetupCheck> {
    let mut check = examine(data, rival)?;
    let known = check.findings.iter().any(|f| f.kind == SPEED_VARIATION);
    if let Some(finding) = speed_variation(data).filter(|_| !known) {
        check.findings.push(finding);
        check.last_taken_out = 1;
    }
    Ok(check)
}

const SPEED_VARIATION: &str = "spindle-speed-variation";

/// A speed that wanders or droops, as the records were put in step for it.
fn speed_variation(data: &CuttingData) -> Option<SetupFinding> {
    let varying: Vec<(&str, &SpindleTrack)> = data
        .cuts
        .iter()
        .filter_map(|cut| Some((cut.id.as_str(), cut.spindle.as_ref()?)))
        .filter(|(_, track)| track.varies())
        .collect();
    let worst = varying
        .iter()
        .map(|(_, track)| *track)
        .max_by(|a, b| a.varying_rad().total_cmp(&b.varying_rad()))?;
    let (relative, std) = worst.variation();
    let cuts: Vec<String> = varying.iter().map(|(id, _)| (*id).to_string()).collect();
    let place = match varying.len() == data.cuts.len() {
        true => "all cuts".to_string(),
        false => format!("cut {}", listed(&cuts)),
    };
    Some(SetupFinding {
        kind: SPEED_VARIATION,
        place,
        value: Some(worst.varying_rad()),
        std_error: Some(worst.varying_rad() * std / relative),
        unit: "rad",
        confidence: 0.97,
        remedy: format!(
            "Look why the speed changes under load (it varies by {} %, rms): the tool is early or late by so much (rms). Averages and \
             waveforms are put in step by the angle that the forces show, so that coefficients and verdict do not suffer from it.",
            with_error(100.0 * relative, 100.0 * std)
        ),
    })
}

fn examine(data: &CuttingData, rival: impl FnOnce() -> Option<Rival>) -> Result<SetupCheck> {
    let mut check = SetupCheck {
        reduced_chi2: 1.0,
        ..SetupCheck::default()
    };
    if data.process == Process::Turning {
        // Three constant forces fit through any wiring: the coefficients' signs are looked at where they are given.
        return Ok(check);
    }
    if data.process != Process::Milling {
        check.findings.extend(drilling_signs(data)?);
        if let (true, Some(base)) = (check.findings.is_empty(), fit(data)) {
            let changes = worst_cuts(data, &base)?.into_iter().map(Change::FeedOf);
            try_changes(data, &base, &changes.collect::<Vec<_>>(), rival, &mut check);
        }
        return Ok(check);
    }
    // At a wrong speed the waveform is none, and any reading of it fits as badly as any other.
    if data.speed_is_contradicted {
        return Ok(check);
    }
    // The waveform is cut from the other side, or seen from one: what leaves less is told.
    let model = CuttingModel::new(data, true);
    let base = model.and_then(|model| calibrate_cutting(&model, data));
    let found = [milling_direction(data, base.as_ref().ok()), dyno_axes(data)?];
    let least = found.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((finding, left)) = least {
        check.explained_share = 1.0;
        check.reduced_chi2 = left;
        check.findings.push(finding);
        return Ok(check);
    }
    let base = base?;
    check.reduced_chi2 = base.reduced_chi2;
    let mut changes: Vec<Change> = [
        Change::GainOfY,
        Change::SpeedWander {
            steady_in_time: false,
        },
        Change::SpeedWander { steady_in_time: true },
        Change::LowPass { order: 1 },
        Change::LowPass { order: 2 },
    ]
    .into();
    for cut in worst_cuts(data, &base)? {
        changes.extend([Change::FeedOf(cut), Change::DepthOf(cut)]);
    }
    try_changes(data, &base, &changes, rival, &mut check);
    Ok(check)
}

/// Adds what `changes` explain of the misfit that the model has, fitted (`base`), where it has more than noise leaves.
fn try_changes(
    data: &CuttingData,
    base: &Calibration,
    changes: &[Change],
    rival: impl FnOnce() -> Option<Rival>,
    check: &mut SetupCheck,
) {
    let values = data.value_count();
    if base.reduced_chi2 < SUSPICIOUS.min(1.0 + 30.0 / values as f64) {
        return;
    }
    let rivals = || Rivals {
        library: rival(),
        small_errors: None,
    };
    let noise = Noise {
        values,
        known_to: NOISE_KNOWN_TO,
        small_errors: small_errors(data),
    };
    let chi2 = base.reduced_chi2 * values as f64;
    let tried: Vec<TriedMistake> = changes
        .par_iter()
        .filter_map(|change| change.tried(data, chi2))
        .collect();
    if let Some(decision) = decide(&tried, chi2, noise, rivals) {
        check.reduced_chi2 = decision.reduced_chi2;
        check.explained_share = decision.explained_share;
        check.findings.extend(decision.findings);
    }
}

fn read(data: &CuttingData, turn: Turn) -> CuttingData {
    let mut own = data.clone();
    for i in 0..3 {
        for j in 0..3 {
            // The recorded channel j is `sign[j]` times what the campaign takes channel `to[j]` for.
            own.tool_from_dyno[i][j] = data.tool_from_dyno[i][turn.to[j]] * turn.sign[j];
            own.dyno_from_tool[j][i] = data.dyno_from_tool[turn.to[j]][i] * turn.sign[j];
        }
    }
    own
}

/// Another order or sign of the dynamometer's channels, where the records say so; with the misfit that it leaves.
fn dyno_axes(data: &CuttingData) -> Result<Option<(SetupFinding, f64)>> {
    let step = data.cuts.len().div_ceil(CUTS).max(1);
    let some = data.filtered(|i| i % step == 0);
    let Some(now) = fit(&some) else { return Ok(None) };
    let now_improbable = improbability(&now);
    if now.reduced_chi2 < SUSPICIOUS && now_improbable < IMPLAUSIBLE {
        return Ok(None);
    }
    let trials: Vec<(Turn, FittedReading)> = Turn::all()
        .into_par_iter()
        .filter(|turn| *turn != Turn::NONE)
        .filter_map(|turn| Some((turn, FittedReading::of(&read(&some, turn))?)))
        .collect();
    let least = trials.iter().map(|t| t.1.chi2()).fold(now.reduced_chi2, f64::min);
    let mut equal: Vec<&(Turn, FittedReading)> =
        trials.iter().filter(|t| t.1.chi2() <= ALIKE * least).collect();
    equal.sort_by(|a, b| a.1.improbability.total_cmp(&b.1.improbability));
    let Some((turn, best)) = equal.first() else {
        return Ok(None);
    };
    // As recorded counts among the rivals where it fits as well.
    let much_better = best.chi2() < MUCH_BETTER * now.reduced_chi2;
    let more_plausible = now_improbable > IMPLAUSIBLE && best.improbability + IMPLAUSIBLE < now_improbable;
    let alike_now = now.reduced_chi2 <= ALIKE * least;
    if !best.is_plausible() || !(much_better || (alike_now && more_plausible)) {
        return Ok(None);
    }
    let weight = |improbability: f64| (-0.5 * (improbability - best.improbability)).exp();
    let sum: f64 = equal.iter().map(|t| weight(t.1.improbability)).sum::<f64>()
        + if alike_now { weight(now_improbable) } else { 0.0 };
    let matrix = read(data, *turn).tool_from_dyno;
    let rows: Vec<String> = matrix
        .iter()
        .map(|row| {
            let entries: Vec<String> = row.iter().map(|v| decimal(*v)).collect();
            format!("[{}]", entries.join(", "))
        })
        .collect();
    let others: Vec<String> = equal
        .iter()
        .skip(1)
        .filter(|t| weight(t.1.improbability) > 0.05)
        .map(|t| t.0.words(["Fx", "Fy", "Fz"], [true; 3]))
        .collect();
    let also = match others.is_empty() {
        true => String::new(),
        false => format!(" These records cannot tell it from: {}.", others.join("; or ")),
    };
    Ok(Some((
        SetupFinding {
            kind: "axes",
            place: format!("dynamometer: {}", turn.words(["Fx", "Fy", "Fz"], [true; 3])),
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.97 / sum,
            remedy: format!(
                "Write tool_from_dyno = [{}] in [dynamometer] of campaign.toml: read so, {}. The coefficients of the present matrix are \
                 wrong.{also}",
                rows.join(", "),
                best.in_words(now.reduced_chi2),
            ),
        },
        best.chi2(),
    )))
}

/// `0.0`, `-1.0`, `0.9848`: as campaign.toml has it.
fn decimal(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6 + 0.0;
    match rounded.fract() == 0.0 {
        true => format!("{rounded:.1}"),
        false => format!("{rounded}"),
    }
}

/// Thrust and torque oppose the drill: coefficients below zero are a channel of the wrong sign.
fn drilling_signs(data: &CuttingData) -> Result<Vec<SetupFinding>> {
    let Some(calibration) = fit(data) else {
        return Ok(Vec::new());
    };
    let estimate = |name: &str| calibration.parameters.iter().find(|p| p.name == name);
    let channels = [("kfc_n_per_mm2", "thrust Fz"), ("ktc_n_per_mm2", "torque Mz")];
    let turned = channels.into_iter().filter_map(|(name, channel)| {
        let p = estimate(name)?;
        (p.value < -5.0 * p.std_error).then(|| SetupFinding {
            kind: "channel-sign",
            place: format!("all drilling cuts, {channel}"),
            value: Some(-1.0),
            std_error: None,
            unit: "",
            confidence: 0.95,
            remedy: format!(
                "Turn the sign of {channel} round (tool_from_dyno, or the amplifier's polarity): it pulls the drill along."
            ),
        })
    });
    Ok(turned.collect())
}

/// A change of all records that one number describes; zero changes nothing.
#[derive(Debug, Clone, Copy)]
enum Change {
    /// Logarithm of the gain of Fy against Fx. One of the two cannot be told from the other, for all coefficients scale with
    /// both; nor can the gain of Fz, with which the axial coefficients scale.
    GainOfY,
    /// Standard deviation of the tool's angle, rad, about its mean turning while lines are averaged: high orders smear. Where
    /// the drive swings at a frequency of its own the same turning error is the steadier one in time, s.
    SpeedWander { steady_in_time: bool },
    /// Time constant of the amplifiers, s.
    LowPass { order: u8 },
    /// Logarithm of the true feed of one cut over the stated one.
    FeedOf(usize),
    /// Logarithm of the true depth of one cut over the stated one.
    DepthOf(usize),
}

impl Change {
    /// The data as they were before the change.
    fn undone(self, data: &CuttingData, value: f64) -> CuttingData {
        let mut own = data.clone();
        match self {
            Change::FeedOf(cut) => return data.with_feed_of(cut, value.exp()),
            Change::DepthOf(cut) => return data.with_depth_of(cut, value.exp()),
            Change::GainOfY => {
                let channel = 1;
                for row in &mut own.tool_from_dyno {
                    row[channel] *= (-value).exp();
                }
                for entry in &mut own.dyno_from_tool[channel] {
                    *entry *= value.exp();
                }
            }
            Change::SpeedWander { steady_in_time } => {
                for cut in &mut own.cuts {
                    let angle = match steady_in_time {
                        true => value * std::f64::consts::TAU * cut.spindle_hz(),
                        false => value,
                    };
                    for channel in Arc::make_mut(cut).channels.iter_mut().flatten() {
                        let lines = channel.orders.iter_mut().zip(&mut channel.order_std);
                        for (k, (line, std)) in lines.enumerate() {
                            let smeared = (-0.5 * ((k + 1) as f64 * angle).powi(2)).exp().max(1e-3);
                            *line /= smeared;
                            *std /= smeared;
                        }
                    }
                }
            }
            Change::LowPass { order } => {
                for cut in &mut own.cuts {
                    let spindle = std::f64::consts::TAU * cut.spindle_hz();
                    let cut = Arc::make_mut(cut);
                    for channel in cut.channels.iter_mut().flatten() {
                        let lines = channel.orders.iter_mut().zip(&mut channel.order_std);
                        for (k, (line, std)) in lines.enumerate() {
                            let s = Complex64::new(0.0, spindle * (k + 1) as f64 * value);
                            let divisor = match order {
                                1 => 1.0 + s,
                                _ => 1.0 + s * std::f64::consts::SQRT_2 + s * s,
                            };
                            *line *= divisor;
                            *std *= divisor.norm();
                        }
                    }
                }
            }
        }
        own
    }

    /// Values to begin with, rising.
    fn starts(self) -> [f64; 4] {
        match self {
            Change::GainOfY => [-0.3, -0.1, 0.1, 0.3],
            Change::SpeedWander {
                steady_in_time: false,
            } => [0.0, 5e-3, 2e-2, 5e-2],
            Change::SpeedWander { steady_in_time: true } => [0.0, 5e-5, 2e-4, 5e-4],
            Change::LowPass { .. } => [0.0, 5e-5, 2e-4, 6e-4],
            Change::FeedOf(_) | Change::DepthOf(_) => [-0.7, -0.2, 0.2, 0.7],
        }
    }

    /// What values are possible.
    fn range(self) -> [f64; 2] {
        match self {
            Change::GainOfY => [-1.5, 1.5],
            Change::SpeedWander {
                steady_in_time: false,
            } => [0.0, 0.3],
            Change::SpeedWander { steady_in_time: true } => [0.0, 3e-3],
            Change::LowPass { .. } => [0.0, 0.01],
            Change::FeedOf(_) | Change::DepthOf(_) => [-2.5, 2.5],
        }
    }

    /// The best value with its standard error and χ², where there is one inside what is possible.
    fn best(self, data: &CuttingData) -> Option<(f64, f64, f64)> {
        let [low, high] = self.range();
        let chi2 = |value: f64| -> Option<f64> {
            let own = self.undone(data, value);
            Some(fit(&own)?.reduced_chi2 * data.value_count() as f64)
        };
        let mut points: Vec<(f64, f64)> = Vec::new();
        for value in self.starts() {
            points.push((value, chi2(value)?));
        }
        let mut around = [points[0]; 3];
        for _ in 0..8 {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let best = (0..points.len()).min_by(|a, b| points[*a].1.total_cmp(&points[*b].1))?;
            let middle = best.clamp(1, points.len() - 2);
            around = [points[middle - 1], points[middle], points[middle + 1]];
            // At an end of what was tried the range is widened by half.
            let width = 0.5 * (points[points.len() - 1].0 - points[0].0);
            let next = match best {
                0 => (points[0].0 - width).max(low),
                i if i + 1 == points.len() => (points[i].0 + width).min(high),
                _ => vertex(&around)?.clamp(low, high),
            };
            if points
                .iter()
                .any(|p| (p.0 - next).abs() < 1e-3 * (next.abs() + 1e-6))
            {
                break;
            }
            points.push((next, chi2(next)?));
        }
        let (value, least) = points.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let curvature = curvature(&around)?;
        (curvature > 0.0).then(|| (value, (2.0 / curvature).sqrt(), least))
    }

    fn tried(self, data: &CuttingData, base: f64) -> Option<TriedMistake> {
        let (value, std, chi2) = self.best(data)?;
        if chi2 >= base || value == 0.0 {
            return None;
        }
        let std = std * (chi2 / data.value_count() as f64).max(1.0).sqrt();
        let finding = match self {
            Change::FeedOf(cut) => other_than_stated(&data.cuts[cut].id, "feed-override", "feed", value, std),
            Change::DepthOf(cut) => {
                other_than_stated(&data.cuts[cut].id, "axial-depth", "axial depth", value, std)
            }
            Change::GainOfY => {
                let factor = value.exp();
                let error = factor * std;
                SetupFinding {
                    kind: "channel-gain",
                    place: "all cuts, Fy against Fx".into(),
                    value: Some(factor),
                    std_error: Some(error),
                    unit: "1",
                    confidence: 0.0,
                    remedy: format!(
                        "Calibrate the dynamometer's channels: recorded Fy is {} times what it should be (or Fx {:.4} times: \
                         only their ratio shows).",
                        with_error(factor, error),
                        1.0 / factor
                    ),
                }
            }
            Change::SpeedWander { steady_in_time } => {
                let (factor, unit) = match steady_in_time {
                    true => (1e3, "ms"),
                    false => (1.0, "rad"),
                };
                SetupFinding {
                    kind: SPEED_VARIATION,
                    place: "all cuts".into(),
                    value: Some(factor * value),
                    std_error: Some(factor * std),
                    unit,
                    confidence: 0.0,
                    remedy: format!(
                        "Average the turns over the angle of the spindle (an encoder's, or shorter records): the tool is {} \
                         {unit} (rms) early or late while turns are averaged, which smears what is quick within a turn.",
                        with_error(factor * value, factor * std)
                    ),
                }
            }
            Change::LowPass { order } => {
                let corner = 1.0 / (std::f64::consts::TAU * value);
                let error = corner * std / value;
                SetupFinding {
                    kind: "amplifier-low-pass",
                    place: "all cuts, all channels".into(),
                    value: Some(corner),
                    std_error: Some(error),
                    unit: "Hz",
                    confidence: 0.0,
                    remedy: format!(
                        "Open the charge amplifier's low-pass filter: corner {} Hz, order {order}.",
                        with_error(corner, error)
                    ),
                }
            }
        };
        Some(TriedMistake {
            finding,
            chi2,
            parameters: 1,
            tried: match self {
                Change::FeedOf(_) | Change::DepthOf(_) => 2.0 * data.cuts.len() as f64,
                _ => 4.0,
            },
            at_bound: false,
        })
    }
}

/// A cut whose `what` was not as stated but the exponential of `value` times that.
fn other_than_stated(id: &str, kind: &'static str, what: &str, value: f64, std: f64) -> SetupFinding {
    let factor = value.exp();
    let error = factor * std;
    SetupFinding {
        kind,
        place: format!("cut {id}"),
        value: Some(factor),
        std_error: Some(error),
        unit: "1",
        confidence: 0.0,
        remedy: format!(
            "Look what {what} cut {id} was made with (the override knob, a line of the program, a slip in the cut list): its forces are \
             those of {} times the stated one. Write the true one down, or leave the cut out.",
            with_error(factor, error)
        ),
    }
}

/// Cuts that a wrong value is looked for in: those that fit worst, by index.
fn worst_cuts(data: &CuttingData, now: &Calibration) -> Result<Vec<usize>> {
    if data.cuts.len() < FEWEST_CUTS {
        return Ok(Vec::new());
    }
    let model = CuttingModel::new(data, true)?;
    let fits = CuttingProblem { model: &model, data }.fits(&now.theta)?;
    let misfit = |i: usize| fits[i].chi2 / data.cuts[i].value_count().max(1) as f64;
    let mut cuts: Vec<usize> = (0..data.cuts.len()).collect();
    cuts.sort_by(|a, b| misfit(*b).total_cmp(&misfit(*a)));
    cuts.truncate(WORST_CUTS);
    Ok(cuts)
}

/// Second derivative of the parabola through three points.
fn curvature(points: &[(f64, f64)]) -> Option<f64> {
    let [(a, fa), (b, fb), (c, fc)] = *points else {
        return None;
    };
    let slope = |x: f64, fx: f64, y: f64, fy: f64| (fy - fx) / (y - x);
    let second = 2.0 * (slope(b, fb, c, fc) - slope(a, fa, b, fb)) / (c - a);
    second.is_finite().then_some(second)
}

/// Where the parabola through three points is lowest.
fn vertex(points: &[(f64, f64)]) -> Option<f64> {
    let [(a, fa), (b, fb), _] = *points else {
        return None;
    };
    let second = curvature(points)?;
    if second <= 0.0 {
        return Some(a);
    }
    let slope_at_middle = (fb - fa) / (b - a);
    Some(0.5 * (a + b) - slope_at_middle / second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::forces::made_cuts::{METAL, drilled, milled};

    #[test]
    fn the_vertex_of_a_parabola_is_found() {
        let f = |x: f64| 3.0 + 5.0 * (x - 0.7).powi(2);
        let points = [-1.0, 0.2, 2.0].map(|x| (x, f(x)));
        assert!((vertex(&points).unwrap() - 0.7).abs() < 1e-12);
        assert!((curvature(&points).unwrap() - 10.0).abs() < 1e-12);
    }

    #[test]
    fn a_cut_that_was_not_made_as_the_list_says_is_named_with_what_it_was_made_with() {
        let ways =
            [0.05, 0.1, 0.15].map(|feed| [[feed, 1.0, 0.0, 180.0, 0.4], [feed, 2.0, 90.0, 180.0, -0.7]]);
        // Ten times as hard: what a wrong feed changes is then more than the errors of 1 N, which these forces do not have.
        let made = milled(METAL.map(|k| 10.0 * k), &ways.concat());
        assert_eq!(examine_cutting(&made, || None).unwrap().findings, []);
        // What the list says is the true value over the factor.
        for (cut, factor) in [(0, 0.8), (3, 1.25), (5, 0.5)] {
            let listed = [
                ("feed-override", made.with_feed_of(cut, 1.0 / factor)),
                ("axial-depth", made.with_depth_of(cut, 1.0 / factor)),
            ];
            for (kind, listed) in listed {
                let findings = examine_cutting(&listed, || None).unwrap().findings;
                let found = &findings[0];
                assert_eq!(
                    (found.kind, &found.place),
                    (kind, &format!("cut {}", listed.cuts[cut].id)),
                    "{findings:?}"
                );
                assert!(found.confidence > 0.9, "{found:?}");
                approx::assert_relative_eq!(found.value.unwrap(), factor, max_relative = 1e-2);
            }
        }
    }

    #[test]
    fn a_hole_that_was_not_drilled_with_the_stated_feed_is_named() {
        let holes = [[0.1, 4.0], [0.15, 4.0], [0.2, 4.0], [0.1, 0.0], [0.2, 0.0]];
        let made = drilled([800.0, 20.0, 500.0, 30.0], &holes);
        let listed = made.with_feed_of(1, 1.0 / 0.7);
        let findings = examine_cutting(&listed, || None).unwrap().findings;
        let found = &findings[0];
        assert_eq!(
            (found.kind, found.place.as_str()),
            ("feed-override", "cut cut-1"),
            "{findings:?}"
        );
        approx::assert_relative_eq!(found.value.unwrap(), 0.7, max_relative = 3e-2);
    }

    #[test]
    fn matrices_are_written_as_campaign_toml_has_them() {
        assert_eq!(decimal(-1.0), "-1.0");
        assert_eq!(decimal(-0.0), "0.0");
        assert_eq!(decimal(0.984_807_753), "0.984808");
    }
}
