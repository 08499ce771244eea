//! A zero that jumps while the tool cuts: an amplifier that overloads or is reset. The air on either side says by how much, the
//! record itself says when.

use std::ops::Range;

use crate::cutting::force_model::force_axis::axis_of;
use crate::cutting::measured::cut_analysis::{CutAnalysis, Notice};
use crate::data::{Sample, TimeRecord};
use crate::signal::{self, median};

const JUMPED: &str = "the zero jumped within the cut and is put right from there on: look for an amplifier that overloaded \
     or was reset, and choose a larger range";

/// Turns before and after a jump whose means are held against one another.
const TURNS: usize = 4;
/// The means differ by what the air says, to this part of it …
const AS_MUCH: f64 = 0.15;
/// … and scatter by less than this part.
const STEADY: f64 = 0.1;
/// Within its turns the force varies at least by this part of what it does in the steady window: the tool cuts before and after.
const CUTTING: f64 = 0.5;
/// … where that is so many times what it does in the air: else nothing tells a jump from the tool's entry.
const OVER_AIR: f64 = 2.0;

/// Takes jumps of the zero out of a record whose air before and after the cut stands apart, where it can be seen when they came.
pub(crate) fn put_jumps_right<S: Sample>(
    record: &mut TimeRecord<S>,
    analysis: &CutAnalysis,
) -> Option<Notice> {
    let rate = record.sample_rate_hz;
    let turn = (rate * 60.0 / analysis.spindle_rpm).round() as usize;
    let sample = |t: f64| ((t - record.start_s) * rate).round().max(0.0) as usize;
    let within = sample(analysis.air_before_s?[1])..sample(analysis.air_after_s?[0]).min(record.len());
    let steady = sample(analysis.steady_s[0])..sample(analysis.steady_s[1]).min(record.len());
    let start_s = record.start_s;
    let mut told = Vec::new();
    for found in analysis.channels.iter().filter(|c| c.drift.step != 0.0) {
        let channel = record
            .channels
            .iter_mut()
            .find(|c| axis_of(c.role) == Some(found.axis));
        let Some(channel) = channel else { continue };
        let Some(at) = jump(&channel.samples, turn, &within, &steady, found.drift.step) else {
            continue;
        };
        for value in &mut channel.samples[at..] {
            *value = S::of(value.value() - found.drift.step);
        }
        told.push(format!(
            "{} by {:+.1} {} at {:.2} s",
            found.axis.label(),
            found.drift.step,
            found.axis.unit(),
            start_s + at as f64 / rate
        ));
    }
    (!told.is_empty()).then(|| Notice {
        kind: JUMPED,
        detail: told.join(", "),
    })
}

/// First sample after a jump by `step`. Means of whole turns know nothing of what comes once a tooth.
fn jump<S: Sample>(
    values: &[S],
    turn: usize,
    within: &Range<usize>,
    steady: &Range<usize>,
    step: f64,
) -> Option<usize> {
    if turn < 4 || within.len() < 2 * TURNS * turn {
        return None;
    }
    let own = &values[within.clone()];
    let mut sums = vec![0.0; own.len() + 1];
    for (i, value) in own.iter().enumerate() {
        sums[i + 1] = sums[i] + value.value();
    }
    let mean = |from: usize| (sums[from + turn] - sums[from]) / turn as f64;
    // A jump stands out most where one turn lies before it and one after it.
    let change = |at: usize| (mean(at) - mean(at - turn)) * step.signum();
    let at = (turn..own.len() - turn).max_by(|a, b| change(*a).total_cmp(&change(*b)))?;
    let (first, last) = (at.checked_sub(TURNS * turn)?, at + TURNS * turn);
    if last > own.len() {
        return None;
    }
    let means = |from: usize| -> Vec<f64> { (0..TURNS).map(|k| mean(from + k * turn)).collect() };
    let (before, after) = (means(first), means(at));
    let apart = median(&after) - median(&before);
    let scatter = |means: &[f64]| {
        means
            .iter()
            .map(|m| (m - median(means)).abs())
            .fold(0.0, f64::max)
    };
    let varies = |from: usize| ripple(&own[from..from + TURNS * turn], turn);
    let (cutting, air) = (
        ripple(&values[steady.clone()], turn),
        ripple(&values[..within.start], turn),
    );
    let is_jump = cutting > OVER_AIR * air
        && (apart / step - 1.0).abs() < AS_MUCH
        && scatter(&before).max(scatter(&after)) < STEADY * step.abs()
        && varies(first).min(varies(at)) > CUTTING * cutting;
    is_jump.then_some(within.start + at)
}

/// Standard deviation within a turn, of the middle one.
fn ripple<S: Sample>(values: &[S], turn: usize) -> f64 {
    let of_turn = |turn: &[S]| {
        let mean = signal::mean(turn);
        let squares: f64 = turn.iter().map(|v| (v.value() - mean).powi(2)).sum();
        (squares / turn.len() as f64).sqrt()
    };
    median(&values.chunks_exact(turn).map(of_turn).collect::<Vec<f64>>())
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// Turns of 50 samples, two teeth a turn, 100 N ± 80 N with noise of 5 N; air outside 500..1500.
    fn record(jump_at: usize, step: f64) -> Vec<f64> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        (0..2000)
            .map(|i| {
                let cuts = (500..1500).contains(&i);
                let tooth = 100.0 + 80.0 * (std::f64::consts::TAU * i as f64 / 25.0).sin();
                let force = if cuts { tooth } else { 0.0 };
                let zero = if i >= jump_at { step } else { 0.0 };
                force + zero + 5.0 * crate::statistics::nearly_normal(&mut random)
            })
            .collect()
    }

    #[test]
    fn a_jump_within_the_cut_is_found_where_it_is() {
        for at in [800, 1013, 1200] {
            for step in [-150.0, 60.0, 300.0] {
                let values = record(at, step);
                let found = jump(&values, 50, &(490..1510), &(600..1400), step).unwrap();
                assert!(found.abs_diff(at) <= 3, "{step} at {at}: {found}");
            }
        }
    }

    #[test]
    fn neither_entry_nor_exit_nor_a_zero_that_crept_is_a_jump() {
        // By as much as the cutting force: entry and exit look alike but for the teeth.
        for (at, step) in [(300, 100.0), (1700, 100.0), (1700, -100.0)] {
            assert_eq!(
                jump(&record(at, step), 50, &(490..1510), &(600..1400), step),
                None
            );
        }
        let mut crept = record(2000, 0.0);
        let creep = |i: usize| 150.0 * (i.clamp(500, 1500) - 500) as f64 / 1000.0;
        crept.iter_mut().enumerate().for_each(|(i, v)| *v += creep(i));
        assert_eq!(jump(&crept, 50, &(490..1510), &(600..1400), 150.0), None);
        // Another size than the air says.
        assert_eq!(
            jump(&record(1000, 100.0), 50, &(490..1510), &(600..1400), 150.0),
            None
        );
    }
}
