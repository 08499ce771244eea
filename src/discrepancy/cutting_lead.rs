//! Where no effect explains force records: what stands above the noise, grouped by what it follows (the turn, the teeth, a
//! frequency of its own, the mains), strongest first, with what usually causes that.

use serde::Serialize;

use super::cutting_trends::{Trend, cutting_trends};
use crate::cutting::ForceAxis;
use crate::data::Process;
use crate::identify::forces::cutting_data::CutData;
use crate::identify::{CutFit, CuttingData};
use crate::signal::{from_mains_hz, median};

/// What a line follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LineKind {
    /// The mean force over the steady cut.
    MeanForce,
    /// Comes and goes over several turns.
    SlowerThanTurn,
    /// At the rotation of the spindle.
    OncePerTurn,
    /// Another whole number of turns, not of tooth passing.
    TurnHarmonic,
    /// At the rotation times the number of teeth.
    ToothPassing,
    /// A multiple of the tooth passing.
    ToothHarmonic,
    /// The same frequency at every spindle speed.
    NaturalFrequency,
    /// Its own frequency, not a whole number of turns, and another at another speed.
    Chatter,
    /// Against the lines of the teeth: their modulation.
    BesideTeeth,
    /// A multiple of the tooth passing above half the sampling rate, folded down by it.
    Folded,
    /// 50 or 60 Hz and their harmonics.
    Mains,
    /// In the air as well.
    NotCutting,
}

impl LineKind {
    /// What it is called, for people.
    pub fn words(self) -> &'static str {
        match self {
            LineKind::MeanForce => "mean force",
            LineKind::SlowerThanTurn => "slower than a turn",
            LineKind::OncePerTurn => "once per turn",
            LineKind::TurnHarmonic => "several times per turn, not as the teeth",
            LineKind::ToothPassing => "tooth passing",
            LineKind::ToothHarmonic => "harmonics of tooth passing",
            LineKind::NaturalFrequency => "natural frequency (the same at every speed)",
            LineKind::Chatter => "not a whole number of turns, another at each speed (chatter)",
            LineKind::BesideTeeth => "close to tooth passing",
            LineKind::Folded => "harmonics of tooth passing, folded by the sampling rate",
            LineKind::Mains => "mains",
            LineKind::NotCutting => "in the air, too",
        }
    }

    /// As [`usual_cause`](Self::usual_cause), where the workpiece turns against one edge that never leaves it.
    pub fn usual_cause_in_turning(self) -> &'static str {
        match self {
            LineKind::MeanForce => {
                "a force that does not follow the feed as the model says (wear, built-up edge, another material), a wrong feed, depth, nose \
                 radius or cutting edge angle in campaign.toml, or a zero line that is off"
            }
            LineKind::OncePerTurn => {
                "a bar that runs out: chucked askew, bent, or with a keyway or crust on one side"
            }
            LineKind::TurnHarmonic => {
                "a bar that is not round: pressed by the jaws of the chuck, or with flats, seams or a crust"
            }
            _ => self.usual_cause(),
        }
    }

    /// What such a line usually comes from.
    pub fn usual_cause(self) -> &'static str {
        match self {
            LineKind::MeanForce => {
                "a force that does not follow the feed as the model says (wear, built-up edge, another material or depth), a \
                 wrong feed, depth or immersion in campaign.toml, or a zero line that is off"
            }
            LineKind::SlowerThanTurn => {
                "a force that comes and goes: built-up edge, chips that clog, a feed that stutters, a depth that changes, a drifting zero"
            }
            LineKind::OncePerTurn => {
                "runout of the tool in its holder, one tooth chipped or missing, an unbalanced spindle, a holder that bends"
            }
            LineKind::TurnHarmonic => {
                "teeth that differ: uneven pitch, two chipped teeth, inserts of different height; a wrong number of teeth"
            }
            LineKind::ToothPassing => {
                "a law of the force other than the model's (size effect, wear, built-up edge), a tool or workpiece that gives \
                 way, a wrong immersion, helix or gain of a channel"
            }
            LineKind::ToothHarmonic => {
                "the shape of the tooth's pass: entry and exit angle, helix, corner radius; a dynamometer or amplifier that \
                 distorts high frequencies"
            }
            LineKind::NaturalFrequency => {
                "a resonance of dynamometer, workpiece, clamping or robot that the cut keeps ringing: tap it and compare"
            }
            LineKind::Chatter => {
                "regenerative or mode-coupling chatter: listen, look for marks on the surface, cut at half the depth"
            }
            LineKind::BesideTeeth => {
                "a spindle speed that wavers, a load that comes and goes (feed not steady, chips), beating with another source"
            }
            LineKind::Folded => {
                "a sampling rate too low for the teeth, without an anti-aliasing filter: sample at 20 a tooth or more, or filter \
                 before sampling"
            }
            LineKind::Mains => "electrical pickup: earth loop, cable next to a motor's, amplifier supply",
            LineKind::NotCutting => {
                "something that runs without cutting: spindle bearings, coolant pump, extraction, a neighbouring machine"
            }
        }
    }
}

/// All lines of one kind.
#[derive(Debug, Clone, Serialize)]
pub struct LineGroup {
    /// What they follow.
    pub kind: LineKind,
    /// The kind in words.
    pub what: &'static str,
    /// Of the mean square that stands above the noise, over all cuts and channels; torques count as large as thrusts.
    pub share: f64,
    /// The strongest line: recorded axis, cut, amplitude (a mean: its deviation), 0 Hz for the mean force.
    pub axis: ForceAxis,
    /// Id of the cut with the strongest line.
    pub cut: String,
    /// Amplitude of that line in `unit`.
    pub amplitude: f64,
    /// N, or N·m.
    pub unit: &'static str,
    /// Frequency of that line, Hz.
    pub frequency_hz: f64,
    /// Frequency over spindle frequency.
    pub order: f64,
    /// Cuts that show it.
    pub cuts: usize,
    /// How many cuts there are.
    pub of_cuts: usize,
    /// What such lines usually come from.
    pub usual_cause: &'static str,
}

/// What stands above the noise, by what it follows.
#[derive(Debug, Clone, Serialize)]
pub struct CuttingLead {
    /// Root mean square of model less record above the noise, over all cuts and channels, N.
    pub above_noise_n: f64,
    /// The rest against what was different, what is no chance and explains most first.
    pub trends: Vec<Trend>,
    /// Strongest first.
    pub lines: Vec<LineGroup>,
}

/// One line of one cut on one recorded channel.
#[derive(Debug, Clone, Copy)]
struct Line {
    cut: usize,
    axis: ForceAxis,
    frequency_hz: f64,
    /// N (N·m).
    amplitude: f64,
    /// Above the noise, N².
    mean_square: f64,
    kind: LineKind,
}

/// A number of teeth whose passing no line follows.
const NO_TEETH: usize = usize::MAX;
/// An order this many times its noise (power) is no chance among some ten thousand.
const STANDS_OUT: f64 = 16.0;
/// Share of a frequency within which it is the same at another speed.
const SAME_FREQUENCY: f64 = 0.005;
/// Share of the speed by which cuts must differ to tell.
const OTHER_SPEED: f64 = 0.02;
/// Share of the tooth-passing frequency within which a line is close to it.
const BESIDE: f64 = 0.12;
/// Share of the spindle frequency below which a line is slow.
const SLOW: f64 = 0.5;
/// Multiples of the tooth passing that fold with a size that matters.
const FOLDED_AT_MOST: usize = 12;
/// Half width of a resonance among the orders, as a share of its frequency.
const RESONANCE: f64 = 0.2;

/// Groups what the model, fitted as `fits` (in the order of the cuts), leaves of the records; `None` where no line stands above
/// the noise.
pub fn cutting_lead(data: &CuttingData, fits: &[CutFit]) -> Option<CuttingLead> {
    let teeth = match data.process {
        Process::Turning => NO_TEETH,
        Process::Milling | Process::Drilling => data.summary.teeth.max(1),
    };
    let mut lines = Vec::new();
    for (index, (cut, fit)) in data.cuts.iter().zip(fits).enumerate() {
        lines.extend(of_orders(index, cut, fit, teeth));
        lines.extend(beside_orders(data, index, teeth));
    }
    name_resonance_among_orders(data, &mut lines);
    let square = |l: &Line| {
        let factor = if l.axis == ForceAxis::Mz {
            data.force_per_torque
        } else {
            1.0
        };
        l.mean_square * factor * factor
    };
    let total: f64 = lines.iter().map(square).sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mut kinds: Vec<LineKind> = lines.iter().map(|l| l.kind).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut groups: Vec<LineGroup> = kinds
        .into_iter()
        .filter_map(|kind| {
            let of_kind = || lines.iter().filter(|l| l.kind == kind);
            let strongest = of_kind().max_by(|a, b| square(a).total_cmp(&square(b)))?;
            let cut = &data.cuts[strongest.cut];
            let mut shown: Vec<usize> = of_kind().map(|l| l.cut).collect();
            shown.sort_unstable();
            shown.dedup();
            Some(LineGroup {
                kind,
                what: kind.words(),
                share: of_kind().map(square).sum::<f64>() / total,
                axis: strongest.axis,
                cut: cut.id.clone(),
                amplitude: strongest.amplitude,
                unit: strongest.axis.unit(),
                frequency_hz: strongest.frequency_hz,
                order: strongest.frequency_hz / cut.spindle_hz(),
                cuts: shown.len(),
                of_cuts: data.cuts.len(),
                usual_cause: match data.process {
                    Process::Turning => kind.usual_cause_in_turning(),
                    Process::Milling | Process::Drilling => kind.usual_cause(),
                },
            })
        })
        .collect();
    groups.sort_by(|a, b| b.share.total_cmp(&a.share));
    let channels: usize = data
        .cuts
        .iter()
        .map(|c| c.channels.iter().flatten().count())
        .sum();
    Some(CuttingLead {
        above_noise_n: (total / channels.max(1) as f64).sqrt(),
        trends: cutting_trends(data, fits),
        lines: groups,
    })
}

fn order_kind(order: usize, teeth: usize) -> LineKind {
    match order {
        n if n == teeth => LineKind::ToothPassing,
        n if n % teeth == 0 => LineKind::ToothHarmonic,
        1 => LineKind::OncePerTurn,
        _ => LineKind::TurnHarmonic,
    }
}

/// What the model misses of the mean and of the orders.
fn of_orders(index: usize, cut: &CutData, fit: &CutFit, teeth: usize) -> Vec<Line> {
    let mut lines = Vec::new();
    for axis in ForceAxis::ALL {
        let i = axis.index();
        let (Some(channel), Some(model)) = (&cut.channels[i], &fit.channels[i]) else {
            continue;
        };
        let mut push = |kind, frequency_hz, amplitude: f64, mean_square: f64, noise: f64| {
            if mean_square > STANDS_OUT * noise {
                lines.push(Line {
                    cut: index,
                    axis,
                    frequency_hz,
                    amplitude,
                    mean_square: mean_square - noise,
                    kind,
                });
            }
        };
        let n = cut.steady.len().max(1) as f64;
        let off = |b: usize| channel.level[b] - model.level[b] - model.reference[b];
        let mean = cut.steady.clone().map(off).sum::<f64>() / n;
        let variance = cut
            .steady
            .clone()
            .map(|b| channel.level_std[b].powi(2))
            .sum::<f64>()
            / (n * n);
        push(LineKind::MeanForce, 0.0, mean.abs(), mean * mean, variance);
        let orders = channel.orders.iter().zip(&model.orders).zip(&channel.order_std);
        for (k, ((measured, model), std)) in orders.enumerate() {
            let square = 2.0 * (measured - model).norm_sqr();
            push(
                order_kind(k + 1, teeth),
                (k + 1) as f64 * cut.spindle_hz(),
                (2.0 * square).sqrt(),
                square,
                2.0 * std * std,
            );
        }
    }
    lines
}

/// Lines off the orders, each named by the strongest reason that there is.
fn beside_orders(data: &CuttingData, index: usize, teeth: usize) -> Vec<Line> {
    let cut = &data.cuts[index];
    let (spindle_hz, tooth_hz) = (cut.spindle_hz(), cut.spindle_hz() * teeth as f64);
    let mut lines = Vec::new();
    for line in &cut.lines {
        let hz = line.frequency_hz;
        let near = |spacing: f64, width: f64| {
            let multiple = (hz / spacing).round();
            multiple >= 1.0 && (hz - multiple * spacing).abs() < width
        };
        let strongest = line.channels.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let in_air = strongest.is_some_and(|(_, own, air)| air.is_some_and(|air| air > 0.5 * own));
        let air_is_known = strongest.is_some_and(|c| c.2.is_some());
        let is_mains = from_mains_hz(hz) < line.resolution_hz.clamp(0.3, 2.0);
        let same = |other: &CutData| {
            let speed = other.spindle_rpm / cut.spindle_rpm - 1.0;
            speed.abs() > OTHER_SPEED
                && other.lines.iter().any(|l| {
                    let within = (SAME_FREQUENCY * hz).max(line.resolution_hz.max(l.resolution_hz));
                    (l.frequency_hz - hz).abs() < within
                })
        };
        let kind = if is_mains && (in_air || !air_is_known) {
            LineKind::Mains
        } else if in_air {
            LineKind::NotCutting
        } else if hz < SLOW * spindle_hz {
            LineKind::SlowerThanTurn
        } else if cut.orders == 0 && near(spindle_hz, 1.5 * line.resolution_hz) {
            order_kind((hz / spindle_hz).round() as usize, teeth)
        } else if is_folded(hz, tooth_hz, cut.sample_rate_hz, 1.5 * line.resolution_hz) {
            LineKind::Folded
        } else if near(tooth_hz, (BESIDE * tooth_hz).max(3.0 * line.resolution_hz)) {
            LineKind::BesideTeeth
        } else if data.cuts.iter().any(|other| same(other)) {
            LineKind::NaturalFrequency
        } else {
            LineKind::Chatter
        };
        for &(channel, amplitude, _) in &line.channels {
            lines.extend((amplitude > 0.0).then(|| Line {
                cut: index,
                axis: ForceAxis::ALL[channel],
                frequency_hz: hz,
                amplitude,
                mean_square: 0.5 * amplitude * amplitude,
                kind,
            }));
        }
    }
    lines
}

/// Whether `hz` is where sampling at `rate_hz` shows a multiple of `tooth_hz` from above half of it, within `width_hz`.
fn is_folded(hz: f64, tooth_hz: f64, rate_hz: f64, width_hz: f64) -> bool {
    (1..=FOLDED_AT_MOST).map(|k| k as f64 * tooth_hz).any(|true_hz| {
        let seen_hz = (true_hz - rate_hz * (true_hz / rate_hz).round()).abs();
        true_hz > 0.5 * rate_hz && (seen_hz - hz).abs() < width_hz
    })
}

/// Orders that stand out about one frequency whatever the speed show a resonance.
fn name_resonance_among_orders(data: &CuttingData, lines: &mut [Line]) {
    let is_order = |l: &Line| {
        use LineKind::{OncePerTurn, ToothHarmonic, ToothPassing, TurnHarmonic};
        matches!(l.kind, OncePerTurn | TurnHarmonic | ToothPassing | ToothHarmonic)
    };
    // The strongest order of each cut, with its speed.
    let peaks: Vec<(f64, f64)> = (0..data.cuts.len())
        .filter_map(|cut| {
            let own = lines.iter().filter(|l| l.cut == cut && is_order(l));
            let peak = own.max_by(|a, b| a.mean_square.total_cmp(&b.mean_square))?;
            Some((data.cuts[cut].spindle_rpm.ln(), peak.frequency_hz.ln()))
        })
        .collect();
    let spread = |values: Vec<f64>| {
        let middle = median(&values);
        let off: Vec<f64> = values.iter().map(|v| (v - middle).powi(2)).collect();
        (off.iter().sum::<f64>() / off.len().max(1) as f64).sqrt()
    };
    let of_speed = spread(peaks.iter().map(|p| p.0).collect());
    let frequencies: Vec<f64> = peaks.iter().map(|p| p.1).collect();
    if peaks.len() < 3 || of_speed < 0.1 || spread(frequencies.clone()) > 0.4 * of_speed {
        return;
    }
    let frequency_hz = median(&frequencies).exp();
    for line in lines.iter_mut().filter(|l| is_order(l)) {
        if (line.frequency_hz / frequency_hz - 1.0).abs() < RESONANCE {
            line.kind = LineKind::NaturalFrequency;
        }
    }
}

impl LineGroup {
    /// `14.2 N on Fx at 25.0 Hz (order 1), cut 03`.
    pub fn strongest(&self) -> String {
        let figures = |v: f64| crate::text::figures(v, 3);
        let amplitude = format!(
            "{} {} on {}",
            figures(self.amplitude),
            self.unit,
            self.axis.label()
        );
        match self.kind {
            LineKind::MeanForce => format!("{amplitude}, cut {}", self.cut),
            _ => {
                let whole = (self.order - self.order.round()).abs() < 1e-6;
                let order = if whole {
                    format!("{:.0}", self.order)
                } else {
                    figures(self.order)
                };
                let hz = figures(self.frequency_hz);
                format!("{amplitude} at {hz} Hz (order {order}), cut {}", self.cut)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::forces::made_force_records::{MadeCut, write_campaign};
    use crate::identify::CuttingCase;
    use crate::identify::forces::cutting_problem::CuttingProblem;
    use crate::identify::forces::cutting_study::calibrate_cutting;
    use std::f64::consts::TAU;

    fn lead(more: &dyn Fn(usize, usize, f64, f64, bool) -> f64) -> Option<CuttingLead> {
        let dir = tempfile::tempdir().unwrap();
        let cuts: Vec<MadeCut> = [
            (1150.0, 0.05),
            (1390.0, 0.05),
            (1930.0, 0.05),
            (1150.0, 0.12),
            (1930.0, 0.12),
        ]
        .map(|(rpm, feed_mm)| MadeCut {
            rpm,
            feed_mm,
            speed: &|_| 1.0,
        })
        .into();
        let campaign = write_campaign(dir.path(), &cuts, more);
        let case = CuttingCase::load(&campaign).unwrap();
        let (model, data) = (&case.model, &case.data);
        let theta = calibrate_cutting(model, data).unwrap().theta;
        let fits = CuttingProblem { model, data }.fits(&theta).unwrap();
        cutting_lead(data, &fits)
    }

    #[test]
    fn multiples_of_tooth_passing_come_back_folded() {
        // Sampled at 700 Hz, twice 200.5 Hz shows at 299 Hz, and four times at 102 Hz.
        let folded = |hz| is_folded(hz, 200.5, 700.0, 0.5);
        assert!(folded(299.0) && folded(102.0) && !folded(200.5) && !folded(250.0));
        assert!(!is_folded(299.0, 200.5, 10_000.0, 0.5));
    }

    #[test]
    fn tones_are_named_by_what_they_follow() {
        // Once per turn, a frequency of its own at every speed, one at one speed only, and the mains in air and cut.
        let found = lead(&|cut, axis, t, angle, cutting| {
            let wave = |hz: f64| (TAU * hz * t).sin();
            let in_cut = f64::from(u8::from(cutting));
            let hum = if axis == 2 { 7.0 * wave(50.0) } else { 0.0 };
            let turn = if axis == 0 { 30.0 * angle.cos() } else { 0.0 };
            let ring = if axis == 1 { 15.0 * wave(437.0) } else { 0.0 };
            let chatter = if cut == 1 { 25.0 * wave(613.0) } else { 0.0 };
            hum + in_cut * (turn + ring + chatter)
        })
        .unwrap();
        let of = |kind: LineKind| {
            let group = found.lines.iter().find(|g| g.kind == kind);
            group.unwrap_or_else(|| panic!("{kind:?} of {:#?}", found.lines))
        };
        let turn = of(LineKind::OncePerTurn);
        assert_eq!((turn.axis, turn.cuts), (ForceAxis::X, 5));
        assert!(
            (turn.amplitude - 30.0).abs() < 1.0 && (turn.order - 1.0).abs() < 1e-9,
            "{turn:?}"
        );
        let ring = of(LineKind::NaturalFrequency);
        assert_eq!((ring.axis, ring.cuts), (ForceAxis::Y, 5));
        assert!(
            (ring.frequency_hz - 437.0).abs() < 0.5 && (ring.amplitude - 15.0).abs() < 1.5,
            "{ring:?}"
        );
        let chatter = of(LineKind::Chatter);
        assert_eq!((chatter.cut.as_str(), chatter.cuts), ("02", 1));
        assert!(
            (chatter.frequency_hz - 613.0).abs() < 0.5 && (chatter.amplitude - 25.0).abs() < 2.5,
            "{chatter:?}"
        );
        let hum = of(LineKind::Mains);
        assert!(
            hum.axis == ForceAxis::Z && (hum.amplitude - 7.0).abs() < 1.0,
            "{hum:?}"
        );
        // Strongest first; powers on 5 + 5 + 3 · 1 + 5 channels.
        let kinds: Vec<LineKind> = found.lines.iter().map(|g| g.kind).take(4).collect();
        let powers = [450.0 * 5.0, 312.5 * 3.0, 112.5 * 5.0, 24.5 * 5.0];
        assert_eq!(
            kinds,
            [
                LineKind::OncePerTurn,
                LineKind::Chatter,
                LineKind::NaturalFrequency,
                LineKind::Mains
            ]
        );
        let total: f64 = powers.iter().sum();
        for (group, power) in found.lines.iter().zip(powers) {
            assert!((group.share - power / total).abs() < 0.06, "{group:?}");
        }
        assert!(
            (found.above_noise_n - (total / 15.0).sqrt()).abs() < 2.0,
            "{}",
            found.above_noise_n
        );
    }

    #[test]
    fn hardly_anything_stands_above_the_noise_of_a_right_model() {
        let above = lead(&|_, _, _, _, _| 0.0).map_or(0.0, |l| l.above_noise_n);
        assert!(above < 0.5, "{above} N");
    }

    use crate::identify::CuttingModel;
    use crate::identify::forces::made_cuts::{METAL, MILLED, milled, with_orders_of};

    /// A mean that is off by 2 N in six blocks of 1 N error, and an order that is off by 5 N of 1 N: amplitudes of 2 N and 10 N, mean
    /// squares less those of the noise, 1/6 N² and 2 N².
    #[test]
    fn lines_of_the_rest_have_their_amplitude_and_stand_above_the_noise() {
        let mut data = milled(METAL, &MILLED[..1]);
        let model = CuttingModel::new(&data, true).unwrap();
        let problem = CuttingProblem {
            model: &model,
            data: &data,
        };
        let fit = problem.fits(&METAL).unwrap().remove(0);
        let cut = std::sync::Arc::make_mut(&mut data.cuts[0]);
        with_orders_of(cut, &fit);
        for (channel, made) in cut
            .channels
            .iter_mut()
            .flatten()
            .zip(fit.channels.iter().flatten())
        {
            let sum = made.level.iter().zip(&made.reference);
            channel.level = sum.map(|(force, zero)| force + zero).collect();
        }
        assert!(of_orders(0, cut, &fit, 2).is_empty());
        let x = cut.channels[0].as_mut().unwrap();
        x.level.iter_mut().for_each(|v| *v -= 2.0);
        x.orders[2] += num_complex::Complex64::new(3.0, -4.0);
        let y = cut.channels[1].as_mut().unwrap();
        // An order off by 2.5 N is chance among ten thousand: 12.5 N² against sixteen times 2 N².
        y.orders[1] += 2.5;
        let lines = of_orders(0, cut, &fit, 2);
        assert_eq!(lines.len(), 2);
        let [mean, order] = [&lines[0], &lines[1]];
        assert_eq!(
            (mean.kind, mean.axis, mean.frequency_hz),
            (LineKind::MeanForce, ForceAxis::X, 0.0)
        );
        approx::assert_relative_eq!(mean.amplitude, 2.0, max_relative = 1e-9);
        approx::assert_relative_eq!(mean.mean_square, 4.0 - 1.0 / 6.0, max_relative = 1e-9);
        assert_eq!(
            (order.kind, order.axis, order.frequency_hz),
            (LineKind::TurnHarmonic, ForceAxis::X, 150.0)
        );
        approx::assert_relative_eq!(order.amplitude, 10.0, max_relative = 1e-9);
        approx::assert_relative_eq!(order.mean_square, 48.0, max_relative = 1e-9);
    }
}
