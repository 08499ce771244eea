//! Drift of a charge amplifier: a line through the air before and after the cut.
//!
//! The line is never fitted to the cut itself: there, drift and a constant force look alike.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::blocks::{SignalBlocks, line, robust_std};
use crate::data::Sample;

/// Sample ranges in which the tool cut nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Air {
    /// Before the cut; `None` where none was found there.
    pub before: Option<Range<usize>>,
    /// After the cut; `None` where none was found there.
    pub after: Option<Range<usize>>,
}

impl Air {
    fn ranges(&self) -> impl Iterator<Item = &Range<usize>> {
        self.before.iter().chain(&self.after)
    }
}

/// The baseline of one channel, in the channel's unit against the record's own time axis.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DriftLine {
    /// Value at `reference_s`.
    pub offset: f64,
    /// Slope, unit of the channel per s.
    pub slope_per_s: f64,
    /// Mean time of the air samples, s.
    pub reference_s: f64,
    /// The line uses air before the cut.
    pub air_before: bool,
    /// The line uses air after the cut.
    pub air_after: bool,
    /// Standard deviation of the fitted value at `reference_s`, from the scatter of block means.
    pub offset_std: f64,
    /// Standard deviation of the slope, unit of the channel per s.
    pub slope_std_per_s: f64,
    /// By how much the air bends away from the line (rms of block means less their noise);
    /// 0 for a drift that is a line.
    pub bend: f64,
    /// Time constant of an exponential that explains the bend; `None` where there is no bend or another one.
    pub time_constant_s: Option<f64>,
    /// By how much the air after the cut stands off the line that the air before it goes on along (and the other way
    /// round), where that is more than chance: the zero jumped during the cut. 0 otherwise.
    pub step: f64,
}

impl DriftLine {
    /// The zero at a time on the record's axis, unit of the channel.
    pub fn at(&self, time_s: f64) -> f64 {
        self.offset + self.slope_per_s * (time_s - self.reference_s)
    }

    /// Carries only this part of the slope beyond its air; what is held back may be true.
    pub fn hold_back(&mut self, part: f64) {
        let held = (1.0 - part) * self.slope_per_s;
        self.slope_per_s *= part;
        self.slope_std_per_s = self.slope_std_per_s.hypot(held);
    }

    /// How the bend looks, for people; empty where that is not known.
    pub fn shape(&self) -> String {
        self.time_constant_s.map_or(String::new(), |tau| {
            format!(" (exponential, time constant about {tau:.2} s)")
        })
    }

    /// Standard deviation of [`DriftLine::at`].
    pub fn std_at(&self, time_s: f64) -> f64 {
        // When it jumped within the cut is not known.
        self.offset_std
            .hypot(self.slope_std_per_s * (time_s - self.reference_s))
            .hypot(self.step / 12f64.sqrt())
    }
}

/// Samples further than this many robust standard deviations from the line are spikes.
const SPIKE_SIGMA: f64 = 6.0;
/// Samples that tell the scatter of the air: of more only every n-th is looked at.
const ENOUGH_FOR_SCATTER: usize = 1 << 17;
/// Blocks that each air segment is cut into to see how far its noise is from white.
const BLOCKS_PER_SEGMENT: usize = 8;
/// Scatter of block means over that of white noise from which on the air is called bent: chance stays below
/// it (14 degrees of freedom, one in ten thousand).
const BEND_RATIO: f64 = 3.0;

/// Standard deviations from which on a jump of the zero is believed.
const STEP_SIGMA: f64 = 6.0;

/// Fits the baseline of a channel to its air segments. Without air there is no line: offset and slope
/// are zero and the flags say so. With air on one side only the line is extrapolated, its uncertainty with it.
pub fn fit_drift<S: Sample>(samples: &[S], sample_rate_hz: f64, start_s: f64, air: &Air) -> DriftLine {
    let mut drift = DriftLine {
        offset: 0.0,
        slope_per_s: 0.0,
        reference_s: start_s,
        air_before: air.before.is_some(),
        air_after: air.after.is_some(),
        offset_std: 0.0,
        slope_std_per_s: 0.0,
        bend: 0.0,
        time_constant_s: None,
        step: 0.0,
    };
    let time = |i: usize| start_s + i as f64 / sample_rate_hz;
    let mut kept: Vec<Range<usize>> = air
        .ranges()
        .map(|r| r.start.min(samples.len())..r.end.min(samples.len()))
        .collect();
    if count(&kept) < 2 {
        return drift;
    }
    // Least squares, dropping spikes, until nothing more is dropped.
    for _ in 0..5 {
        let before = count(&kept);
        let each = || kept.iter().flat_map(Range::clone);
        let (offset, slope, reference) = line(each().map(time), each().map(|i| samples[i].value()));
        (drift.offset, drift.slope_per_s, drift.reference_s) = (offset, slope, reference);
        let residual = |i: usize| samples[i].value() - drift.at(time(i));
        let some: Vec<f64> = each()
            .step_by(before.div_ceil(ENOUGH_FOR_SCATTER))
            .map(residual)
            .collect();
        let limit = SPIKE_SIGMA * robust_std(&some);
        let centre = super::median(&some);
        let is_good = |i: usize| limit == 0.0 || (residual(i) - centre).abs() <= limit;
        kept = kept.iter().flat_map(|r| stretches(r, is_good)).collect();
        if count(&kept) == before || count(&kept) < 2 {
            break;
        }
    }
    uncertainty(&mut drift, samples, &kept, air, &time);
    match (&air.before, &air.after) {
        (Some(_), Some(_)) => jump(&mut drift, samples, &kept, air, &time),
        // Carried far beyond its air, a slope that may be chance does more harm than none: it counts by what is known of it
        // (the mean of a slope that may be of any size up to the one seen; James & Stein 1961).
        _ => {
            let (seen, chance) = (drift.slope_per_s.powi(2), drift.slope_std_per_s.powi(2));
            if seen + chance > 0.0 {
                drift.hold_back(seen / (seen + chance));
            }
        }
    }
    drift
}

/// Samples in all of them.
fn count(ranges: &[Range<usize>]) -> usize {
    ranges.iter().map(Range::len).sum()
}

/// The stretches of `range` without what is not good.
fn stretches(range: &Range<usize>, is_good: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let mut stretches = Vec::new();
    let mut start = range.start;
    for bad in range.clone().filter(|i| !is_good(*i)) {
        stretches.push(start..bad);
        start = bad + 1;
    }
    stretches.push(start..range.end);
    stretches.retain(|r| !r.is_empty());
    stretches
}

/// The samples of `kept` that belong to one segment of air.
fn inside(kept: &[Range<usize>], segment: &Range<usize>) -> impl Iterator<Item = usize> + Clone {
    let of_segment = kept.iter().filter(|r| segment.contains(&r.start));
    of_segment.flat_map(Range::clone)
}

/// Is the air before and after the cut two parallel lines rather than one? Then the zero jumped in between, and the line
/// goes half-way.
fn jump<S: Sample>(
    drift: &mut DriftLine,
    samples: &[S],
    kept: &[Range<usize>],
    air: &Air,
    time: &impl Fn(usize) -> f64,
) {
    // Block means of both segments: time, value, and whether it is after the cut.
    let mut points: Vec<(f64, f64, f64)> = Vec::new();
    for (side, range) in air.ranges().enumerate() {
        let all = inside(kept, range);
        let per_block = all.clone().count() / BLOCKS_PER_SEGMENT;
        if per_block < 2 {
            return;
        }
        points.extend((0..BLOCKS_PER_SEGMENT).map(|k| {
            let block = || all.clone().skip(k * per_block).take(per_block);
            let mean_of = |f: &dyn Fn(usize) -> f64| block().map(f).sum::<f64>() / per_block as f64;
            (
                mean_of(&|i| time(i) - drift.reference_s),
                mean_of(&|i| samples[i].value()),
                side as f64,
            )
        }));
    }
    let basis = DMatrix::from_fn(points.len(), 3, |i, k| [1.0, points[i].0, points[i].2][k]);
    let value = DVector::from_iterator(points.len(), points.iter().map(|p| p.1));
    let Some(inverse) = (basis.transpose() * &basis).try_inverse() else {
        return;
    };
    let solution = &inverse * basis.transpose() * &value;
    let left = (&value - &basis * &solution).norm_squared() / (points.len() - 3) as f64;
    let (slope, step) = (solution[1], solution[2]);
    if !step.is_finite()
        || drift.time_constant_s.is_some()
        || step.abs() < STEP_SIGMA * (left * inverse[(2, 2)]).sqrt()
    {
        return;
    }
    drift.step = step;
    drift.bend = 0.0;
    drift.offset = solution[0] + 0.5 * step;
    drift.slope_per_s = slope;
    drift.offset_std = (left * inverse[(0, 0)]).sqrt();
    drift.slope_std_per_s = (left * inverse[(1, 1)]).sqrt();
}

/// Standard errors from block means, since hum and bend make neighbouring samples alike.
fn uncertainty<S: Sample>(
    drift: &mut DriftLine,
    samples: &[S],
    kept: &[Range<usize>],
    air: &Air,
    time: &impl Fn(usize) -> f64,
) {
    let each = || kept.iter().flat_map(Range::clone);
    let residual = |i: usize| samples[i].value() - drift.at(time(i));
    let sample_variance = each().map(|i| residual(i).powi(2)).sum::<f64>() / count(kept) as f64;
    let (mut square_sum, mut block_count, mut block_len) = (0.0, 0usize, 0.0);
    let mut bent: Vec<(f64, f64)> = Vec::new();
    for range in air.ranges() {
        let values: Vec<f64> = inside(kept, range).map(residual).collect();
        let blocks = SignalBlocks::new(&values, values.len() as f64 / BLOCKS_PER_SEGMENT as f64);
        square_sum += blocks
            .mean
            .iter()
            .map(|m| m * m * blocks.samples_per_block)
            .sum::<f64>();
        bent.extend(blocks.mean.iter().enumerate().filter_map(|(k, mean)| {
            let middle = ((k as f64 + 0.5) * blocks.samples_per_block) as usize;
            Some((time(inside(kept, range).nth(middle)?), *mean))
        }));
        block_count += blocks.len();
        block_len += values.len() as f64;
    }
    // Two degrees of freedom went into the line.
    let per_sample = if block_count > 2 {
        (square_sum / (block_count - 2) as f64).max(sample_variance)
    } else {
        sample_variance
    };
    let n = count(kept) as f64;
    let sxx: f64 = each().map(|i| (time(i) - drift.reference_s).powi(2)).sum();
    let mean_block_len = block_len / block_count.max(1) as f64;
    if mean_block_len > 0.0 && per_sample > BEND_RATIO * sample_variance {
        drift.bend = ((per_sample - sample_variance) / mean_block_len).max(0.0).sqrt();
        drift.time_constant_s = exponential(&bent);
    }
    drift.offset_std = (per_sample / n).sqrt();
    drift.slope_std_per_s = if sxx > 0.0 { (per_sample / sxx).sqrt() } else { 0.0 };
}

/// An exponential counts where it leaves this part of the squares that a line leaves.
const EXPLAINS: f64 = 0.2;
/// Time constants tried, in record lengths, from shortest to longest.
const TIME_CONSTANTS: (f64, f64, usize) = (0.03, 3.0, 60);

/// Time constant of offset + slope t + amplitude e^(−t/τ) through points (time, value) off a line.
fn exponential(points: &[(f64, f64)]) -> Option<f64> {
    let (first, last) = (points.first()?.0, points.last()?.0);
    let length = last - first;
    if points.len() < 8 || !(length > 0.0) {
        return None;
    }
    let value = DVector::from_iterator(points.len(), points.iter().map(|p| p.1));
    let left = |tau: f64| -> Option<f64> {
        let basis = DMatrix::from_fn(points.len(), 3, |i, k| {
            let t = points[i].0 - first;
            [1.0, t / length, (-t / tau).exp()][k]
        });
        let solution = basis.clone().svd(true, true).solve(&value, 1e-9).ok()?;
        Some((&value - basis * solution).norm_squared())
    };
    let (short, long, count) = TIME_CONSTANTS;
    let tau = |k: usize| length * short * (long / short).powf(k as f64 / (count - 1) as f64);
    let (squares, best) = (0..count)
        .filter_map(|k| Some((left(tau(k))?, k)))
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    // At an end of what was tried it may be anything.
    let inside = best > 0 && best + 1 < count;
    (inside && squares < EXPLAINS * value.norm_squared()).then(|| tau(best))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const RATE: f64 = 1000.0;

    fn record(seed: u64, noise: f64, bend: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..3000)
            .map(|i| {
                let t = i as f64 / RATE;
                let cut = if (1.0..2.5).contains(&t) { 200.0 } else { 0.0 };
                let gauss: f64 = crate::statistics::nearly_normal(&mut rng);
                12.0 + 3.0 * t + bend(t) + cut + noise * gauss
            })
            .collect()
    }

    fn air() -> Air {
        Air {
            before: Some(0..1000),
            after: Some(2500..3000),
        }
    }

    #[test]
    fn the_line_comes_from_the_air_alone_and_spikes_do_not_move_it() {
        let mut samples = record(1, 0.0, |_| 0.0);
        samples[17] = 5000.0;
        samples[2800] = -9000.0;
        // A touch of scatter: with none at all there is no scale to call a spike by.
        for (i, v) in samples.iter_mut().enumerate() {
            *v += if i % 2 == 0 { 1e-6 } else { -1e-6 };
        }
        let drift = fit_drift(&samples, RATE, 5.0, &air());
        assert!((drift.slope_per_s - 3.0).abs() < 1e-6, "{drift:?}");
        assert!((drift.at(5.0 + 1.75) - (12.0 + 3.0 * 1.75)).abs() < 1e-5);
    }

    #[test]
    fn the_standard_error_covers_the_truth_about_as_often_as_it_should() {
        let mut inside = 0;
        for seed in 0..200 {
            let drift = fit_drift(&record(seed, 2.0, |_| 0.0), RATE, 0.0, &air());
            let error = drift.at(1.75) - (12.0 + 3.0 * 1.75);
            inside += usize::from(error.abs() < 2.0 * drift.std_at(1.75));
        }
        assert!((180..=200).contains(&inside), "{inside} of 200 within two sigma");
    }

    #[test]
    fn a_zero_that_jumps_during_the_cut_is_told_from_drift() {
        for seed in 0..20 {
            let jumped = fit_drift(
                &record(seed, 2.0, |t| if t < 1.4 { 0.0 } else { 17.0 }),
                RATE,
                0.0,
                &air(),
            );
            assert!((jumped.step - 17.0).abs() < 3.0, "{jumped:?}");
            assert!((jumped.at(1.0) - (12.0 + 3.0 + 8.5)).abs() < 2.0, "{jumped:?}");
            assert!(jumped.std_at(1.4) > 4.0 && jumped.bend == 0.0, "{jumped:?}");
            assert_eq!(
                fit_drift(&record(seed, 2.0, |_| 0.0), RATE, 0.0, &air()).step,
                0.0
            );
        }
    }

    #[test]
    fn a_slope_that_may_be_chance_is_not_carried_away_from_its_air() {
        let before = Air {
            before: Some(0..200),
            after: None,
        };
        let mut off = [0.0f64; 2];
        for seed in 0..50 {
            let drift = fit_drift(&record(seed, 2.0, |t| -3.0 * t), RATE, 0.0, &before);
            let inside: Vec<f64> = record(seed, 2.0, |t| -3.0 * t)[..200].to_vec();
            let (_, slope, _) = line((0..200).map(|i| i as f64 / RATE), inside.iter().copied());
            assert!(
                drift.slope_per_s.abs() < slope.abs() && drift.slope_std_per_s > 0.0,
                "{drift:?}"
            );
            off[0] += drift.slope_per_s.powi(2);
            off[1] += slope.powi(2);
        }
        assert!(off[0] < 0.5 * off[1], "{off:?}");
        let steep = fit_drift(&record(2, 2.0, |t| 97.0 * t), RATE, 0.0, &before);
        assert!((steep.slope_per_s - 100.0).abs() < 10.0, "{steep:?}");
    }

    #[test]
    fn a_bent_drift_is_seen_and_no_air_is_said() {
        let bent = fit_drift(
            &record(3, 0.5, |t| 300.0 * (1.0 - (-t / 2.0).exp())),
            RATE,
            0.0,
            &air(),
        );
        assert!(bent.bend > 2.0, "{bent:?}");
        let tau = bent.time_constant_s.unwrap();
        assert!((tau / 2.0 - 1.0).abs() < 0.15, "{tau}");
        let straight = fit_drift(&record(3, 0.5, |_| 0.0), RATE, 0.0, &air());
        assert!(
            straight.bend < 0.2 && straight.time_constant_s.is_none(),
            "{straight:?}"
        );
        assert_eq!((bent.step, straight.step), (0.0, 0.0));
        let none = fit_drift(&record(3, 0.5, |_| 0.0), RATE, 0.0, &Air::default());
        assert!(!none.air_before && !none.air_after && none.at(1.0) == 0.0);
    }
}
