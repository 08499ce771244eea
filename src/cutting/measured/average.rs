//! Means over whole revolutions and their standard errors.

use std::ops::Range;

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{
    Average, ChannelAnalysis, CutAnalysis, TurnAverage, in_tool_axes,
};
use crate::data::{Sample, TimeRecord};
use crate::signal::{self, DriftLine, SignalBlocks};

/// Revolutions whose mean is further than this many robust standard deviations off are spikes.
const SPIKE_SIGMA: f64 = 8.0;
/// Student's t at 68 % with one and with two degrees of freedom.
const STUDENT: [f64; 2] = [1.84, 1.32];
/// Cuts with fewer revolutions than this take their scatter from the others too.
const FEW_TURNS: usize = 8;
/// Degrees of freedom that the other cuts' scatter counts as, and that they must have together.
const POOLED_FREEDOM: f64 = 8.0;

/// Mean over the revolutions of the window with the baseline taken off.
pub(crate) fn average<S: Sample>(
    values: &[S],
    steady: &Range<usize>,
    samples_per_revolution: f64,
    drift: &DriftLine,
    record: &TimeRecord<S>,
) -> TurnAverage {
    let time = |i: usize| record.start_s + i as f64 / record.sample_rate_hz;
    let compensated = |i: usize| values[steady.start + i].value() - drift.at(time(steady.start + i));
    let blocks = SignalBlocks::of(steady.len(), compensated, samples_per_revolution);
    let centre = signal::median(&blocks.mean);
    let deviation: Vec<f64> = blocks.mean.iter().map(|m| (m - centre).abs()).collect();
    let limit = SPIKE_SIGMA * 1.4826 * signal::median(&deviation);
    let mut kept: Vec<f64> = blocks
        .mean
        .iter()
        .copied()
        .filter(|m| limit == 0.0 || (m - centre).abs() <= limit)
        .collect();
    if 10 * (blocks.len() - kept.len()) > blocks.len() {
        // So many are no spikes.
        kept = blocks.mean.clone();
    }
    let dropped = blocks.len() - kept.len();
    let n = kept.len().max(1) as f64;
    let value = kept.iter().sum::<f64>() / n;
    let turn_std = turn_std(&kept);
    let scatter = match turn_std {
        Some(_) if kept.len() >= 4 => scatter_of_mean(&kept),
        // Student's t for two or three values: the interval of one standard deviation is that much wider.
        Some(std) => std / n.sqrt() * STUDENT[kept.len() - 2],
        None => {
            // One revolution is like no other: the samples themselves, which counts the ripple as noise.
            let m = steady.len().max(1) as f64;
            let squares = (0..steady.len()).map(|i| (compensated(i) - value).powi(2));
            (squares.sum::<f64>() / m).sqrt()
        }
    };
    let middle = 0.5 * (time(steady.start) + time(steady.end));
    let zero_std = drift.std_at(middle).hypot(drift.bend);
    TurnAverage {
        average: Average {
            value,
            std_error: scatter.hypot(zero_std),
        },
        turns: kept.len(),
        turn_std,
        zero_std,
        dropped,
    }
}

fn turn_std(means: &[f64]) -> Option<f64> {
    let n = means.len() as f64;
    let mean = signal::mean(means);
    (means.len() >= 2).then(|| (means.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

/// Standard errors of cuts with few revolutions, from how the revolutions of all cuts scatter: relative to the force, so that
/// large cuts speak for small ones. The cut's own scatter counts by its revolutions, the others' as at most
/// [`POOLED_FREEDOM`] more.
pub(crate) fn pool_scatter(cuts: &mut [CutAnalysis], tool_from_dyno: &[[f64; 3]; 3]) {
    for axis in ForceAxis::ALL {
        let channel = |c: &CutAnalysis| c.channels.iter().find(|o| o.axis == axis).map(|o| o.mean);
        let size = |c: &CutAnalysis| {
            let same = |o: &&ChannelAnalysis| (o.axis == ForceAxis::Mz) == (axis == ForceAxis::Mz);
            let squares = c
                .channels
                .iter()
                .filter(same)
                .map(|o| o.mean.average.value.powi(2));
            squares.sum::<f64>().sqrt()
        };
        let (mut freedom, mut squares) = (0.0, 0.0);
        for cut in cuts.iter() {
            if let Some((mean, std)) = channel(cut).and_then(|m| Some((m, m.turn_std?)))
                && size(cut) > 0.0
            {
                let own = (mean.turns - 1) as f64;
                freedom += own;
                squares += own * (std / size(cut)).powi(2);
            }
        }
        if freedom < POOLED_FREEDOM {
            continue;
        }
        for cut in cuts.iter_mut() {
            let size = size(cut);
            let Some(channel) = cut.channels.iter_mut().find(|o| o.axis == axis) else {
                continue;
            };
            let mean = &mut channel.mean;
            if mean.turns == 0 || mean.turns >= FEW_TURNS {
                continue;
            }
            let own = (mean.turns - 1) as f64;
            let common = squares / freedom * size * size;
            let variance = (own * mean.turn_std.unwrap_or(0.0).powi(2) + POOLED_FREEDOM * common)
                / (own + POOLED_FREEDOM);
            mean.average.std_error = (variance / mean.turns as f64).sqrt().hypot(mean.zero_std);
        }
    }
    for cut in cuts {
        cut.averages = in_tool_axes(tool_from_dyno, &cut.channels);
    }
}

/// Standard error of the mean of a series whose neighbours may be alike (first-order autoregressive).
fn scatter_of_mean(series: &[f64]) -> f64 {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    let variance = series.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    if variance <= 0.0 {
        return 0.0;
    }
    let lagged: f64 = series.windows(2).map(|w| (w[0] - mean) * (w[1] - mean)).sum();
    let rho = (lagged / (n - 1.0) / variance).clamp(0.0, 0.9);
    (variance / n * (1.0 + rho) / (1.0 - rho)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// White: σ/√n. First-order autoregressive with ρ: √((1 + ρ)/(1 − ρ)) times that (Bayley and Hammersley 1946).
    #[test]
    fn the_scatter_of_a_mean_grows_with_what_neighbours_share() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let white: Vec<f64> = (0..20_000)
            .map(|_| crate::statistics::nearly_normal(&mut random))
            .collect();
        let n = white.len() as f64;
        approx::assert_relative_eq!(scatter_of_mean(&white), 1.0 / n.sqrt(), max_relative = 0.05);
        let rho = 0.6f64;
        let mut last = 0.0;
        let alike: Vec<f64> = white
            .iter()
            .map(|w| {
                last = rho * last + (1.0 - rho * rho).sqrt() * w;
                last
            })
            .collect();
        let expected = ((1.0 + rho) / (1.0 - rho) / n).sqrt();
        approx::assert_relative_eq!(scatter_of_mean(&alike), expected, max_relative = 0.08);
        assert_eq!(scatter_of_mean(&[2.0, 2.0, 2.0]), 0.0);
        approx::assert_relative_eq!(turn_std(&[1.0, 3.0]).unwrap(), 2f64.sqrt(), max_relative = 1e-12);
        assert_eq!(turn_std(&[1.0]), None);
    }

    use crate::cutting::measured::cut_analysis::made_channel;
    use crate::data::Process;
    use crate::signal::{Air, fit_drift};
    use approx::assert_relative_eq;

    /// Turns of ten samples at 100 Hz with these means and a ripple of 3 N that each turn has; a zero that is known.
    fn of_turns(means: &[f64]) -> TurnAverage {
        let ripple = [3.0, -3.0];
        let values: Vec<f64> = means
            .iter()
            .flat_map(|m| (0..10).map(move |i| m + ripple[i % 2]))
            .collect();
        of(&values, &fit_drift::<f64>(&[], 100.0, 0.0, &Air::default()))
    }

    fn of(values: &[f64], drift: &DriftLine) -> TurnAverage {
        let record = TimeRecord {
            sample_rate_hz: 100.0,
            start_s: 0.0,
            channels: Vec::new(),
            filled: Vec::new(),
        };
        average(values, &(0..values.len()), 10.0, drift, &record)
    }

    /// One turn of twenty with a spike is left out; three of twenty are no spikes.
    #[test]
    fn spikes_are_left_out_as_long_as_they_are_few() {
        let even = |i: usize| 100.0 + if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut means: Vec<f64> = (0..20).map(even).collect();
        means[7] = 500.0;
        let one = of_turns(&means);
        assert_eq!((one.dropped, one.turns), (1, 19));
        assert_relative_eq!(one.average.value, 100.0 + 1.0 / 19.0, max_relative = 1e-12);
        (means[3], means[11]) = (500.0, 500.0);
        let three = of_turns(&means);
        assert_eq!((three.dropped, three.turns), (0, 20));
        // Three of 99 N are 500 N.
        assert_relative_eq!(three.average.value, 160.15, max_relative = 1e-12);
        // Eight robust standard deviations (1.4826 N each) from the middle is the end.
        let near = |off: f64| {
            let mut means: Vec<f64> = (0..20).map(even).collect();
            means[7] = 100.0 + off;
            of_turns(&means).dropped
        };
        assert_eq!((near(11.0), near(13.5)), (0, 1));
    }

    /// Student's t at 68.3 % is 1.84 with one degree of freedom and 1.32 with two: the interval of a mean of two or three turns.
    #[test]
    fn few_turns_widen_the_interval_as_student_has_it() {
        assert_relative_eq!(
            of_turns(&[9.0, 11.0]).average.std_error,
            1.84,
            max_relative = 1e-2
        );
        let three = of_turns(&[9.0, 10.0, 11.0]).average.std_error;
        assert_relative_eq!(three, 1.32 / 3f64.sqrt(), max_relative = 1e-2);
        // One turn says nothing of the others: its ripple is what is known.
        let one = of_turns(&[10.0]);
        assert_relative_eq!(one.average.std_error, 3.0, max_relative = 1e-12);
        assert_eq!((one.turn_std, one.turns), (None, 1));
    }

    /// The zero's own uncertainty counts at the middle of the window, and a zero that bends by 2 N is known to 2 N.
    #[test]
    fn the_zero_is_as_certain_as_at_the_middle_of_the_window() {
        let mut drift = fit_drift::<f64>(&[], 100.0, 0.0, &Air::default());
        (drift.offset, drift.slope_per_s, drift.reference_s) = (4.0, 10.0, 1.0);
        (drift.slope_std_per_s, drift.bend) = (1.5, 2.0);
        // Four turns, 0.4 s; the zero rises from −6 N to −2 N.
        let values: Vec<f64> = (0..40).map(|i| 50.0 + drift.at(f64::from(i) / 100.0)).collect();
        let mean = of(&values, &drift);
        assert_relative_eq!(mean.average.value, 50.0, max_relative = 1e-9);
        assert_relative_eq!(mean.zero_std, f64::hypot(1.5 * 0.8, 2.0), max_relative = 1e-12);
        assert_relative_eq!(mean.average.std_error, mean.zero_std, max_relative = 1e-6);
    }

    fn cut(forces: [f64; 2], torque: f64, turns: usize, scatter: f64) -> CutAnalysis {
        let channel = |axis, value: f64, size: f64| {
            let average = Average {
                value,
                std_error: 123.0,
            };
            let mut channel = made_channel(axis, average);
            channel.mean.turns = turns;
            channel.mean.turn_std = Some(scatter * size);
            channel
        };
        let size = forces[0].hypot(forces[1]);
        CutAnalysis {
            cut: 0,
            id: String::new(),
            process: Process::Drilling,
            spindle_rpm: 1200.0,
            cutting_speed_m_per_min: 36.0,
            feed_mm: 0.2,
            record_s: [0.0, 1.0],
            air_before_s: None,
            air_after_s: None,
            steady_s: [0.0, 1.0],
            steady_given: false,
            revolutions: turns as f64,
            channels: vec![
                channel(ForceAxis::X, forces[0], size),
                channel(ForceAxis::Z, forces[1], size),
                channel(ForceAxis::Mz, torque, torque),
            ],
            contact_share: 1.0,
            averages: [None; 4],
            tooth_line: None,
            passes_times: None,
            uneven_teeth: None,
            spindle: None,
            notices: Vec::new(),
        }
    }

    const AS_IT_IS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    /// Turns of all cuts scatter by 2 % of the force, of 10 N as of 5000 N; a torque by 2 % of the torque. A mean of three turns is
    /// known to 2 % / √3.
    #[test]
    fn cuts_of_few_turns_have_the_scatter_of_all_cuts() {
        let mut cuts = [
            cut([6.0, 8.0], 0.1, 3, 0.02),
            cut([300.0, 400.0], 2.0, 3, 0.02),
            cut([3000.0, 4000.0], 30.0, 3, 0.02),
            cut([60.0, 80.0], 0.7, 3, 0.02),
        ];
        pool_scatter(&mut cuts, &AS_IT_IS);
        let known = 0.02 / 3f64.sqrt();
        for (cut, size) in cuts.iter().zip([10.0, 500.0, 5000.0, 100.0]) {
            let error = |axis: usize| cut.averages[axis].unwrap().std_error;
            assert_relative_eq!(error(0), known * size, max_relative = 1e-9);
            assert_relative_eq!(error(2), known * size, max_relative = 1e-9);
            let torque = cut.averages[3].unwrap();
            assert_relative_eq!(torque.std_error, known * torque.value, max_relative = 1e-9);
        }
    }

    /// Turns that happen to be alike are no certainty: the scatter of 18 other differences of turns counts as eight of its own two.
    #[test]
    fn alike_by_luck_is_no_certainty() {
        let others = || (0..6).map(|_| cut([300.0, 400.0], 2.0, 4, 0.02));
        let mut cuts: Vec<CutAnalysis> = others().chain([cut([300.0, 400.0], 2.0, 3, 0.0)]).collect();
        pool_scatter(&mut cuts, &AS_IT_IS);
        let common = 0.02f64.powi(2) * 18.0 / 20.0;
        let error = cuts[6].averages[0].unwrap().std_error;
        assert_relative_eq!(error, 500.0 * (0.8 * common / 3.0).sqrt(), max_relative = 1e-9);
        // Cuts of eight turns know their own scatter, and seven differences of turns are too few to speak for others.
        let mut many = [
            cut([300.0, 400.0], 2.0, 8, 0.02),
            cut([300.0, 400.0], 2.0, 7, 0.0),
        ];
        pool_scatter(&mut many, &AS_IT_IS);
        assert_eq!(many[0].averages[0].unwrap().std_error, 123.0);
        assert!(many[1].averages[0].unwrap().std_error < 123.0);
        let mut few = [
            cut([300.0, 400.0], 2.0, 4, 0.02),
            cut([300.0, 400.0], 2.0, 5, 0.0),
        ];
        pool_scatter(&mut few, &AS_IT_IS);
        assert_eq!(few[1].averages[0].unwrap().std_error, 123.0);
    }
}
