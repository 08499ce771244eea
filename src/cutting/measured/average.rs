//! Means over whole revolutions and their standard errors.

use std::ops::Range;

use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::measured::cut_analysis::{
    Average, ChannelAnalysis, CutAnalysis, TurnAverage, in_tool_axes,
};
use crate::data::TimeRecord;
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
pub(crate) fn average(
    values: &[f64],
    steady: &Range<usize>,
    samples_per_revolution: f64,
    drift: &DriftLine,
    record: &TimeRecord,
) -> TurnAverage {
    let time = |i: usize| record.start_s + i as f64 / record.sample_rate_hz;
    let compensated: Vec<f64> = steady.clone().map(|i| values[i] - drift.at(time(i))).collect();
    let blocks = SignalBlocks::new(&compensated, samples_per_revolution);
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
            let m = compensated.len().max(1) as f64;
            (compensated.iter().map(|v| (v - value).powi(2)).sum::<f64>() / m).sqrt()
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
}
