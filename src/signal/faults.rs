//! Faults of single samples: spikes, stuck stretches, clipped peaks. Few and sure: a warning that is wrong half the time
//! is read never.

use std::ops::Range;

use crate::data::Sample;

/// What is wrong with the samples of one channel, as sample ranges in ascending order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Faults {
    /// The same value in every sample: the channel is dead, and nothing else is said of it.
    pub dead: bool,
    /// One to three samples far out of line with those on both sides.
    pub spikes: Vec<Range<usize>>,
    /// Stretches without any change in a channel that else never rests.
    pub stuck: Vec<Range<usize>>,
    /// Peaks that the range of the amplifier cuts off.
    pub clipping: Option<Clipping>,
}

/// Peaks cut off at one end of the channel's range.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clipping {
    /// Value of the plateaus, unit of the channel.
    pub level: f64,
    /// Sample ranges that stand at `level`, ascending.
    pub plateaus: Vec<Range<usize>>,
}

impl Clipping {
    /// Clipped samples within `window`.
    pub fn samples_in(&self, window: &Range<usize>) -> usize {
        samples_in(&self.plateaus, window)
    }
}

/// Samples of `ranges` that lie in `window`.
pub fn samples_in(ranges: &[Range<usize>], window: &Range<usize>) -> usize {
    let inside = |r: &Range<usize>| r.end.min(window.end).saturating_sub(r.start.max(window.start));
    ranges.iter().map(inside).sum()
}

/// Looks for all of them.
pub fn find_faults<S: Sample>(samples: &[S]) -> Faults {
    if samples.len() > 1 && samples.iter().all(|v| *v == samples[0]) {
        return Faults {
            dead: true,
            ..Faults::default()
        };
    }
    if is_a_switch(samples) {
        return Faults::default();
    }
    let spikes = spikes(samples);
    let range = extremes(samples, &spikes);
    let runs = runs(samples);
    if repeats_by_nature(samples, &runs, range) {
        return Faults {
            spikes,
            ..Faults::default()
        };
    }
    let windowed = is_windowed(samples, &runs);
    let stands = |level: f64| {
        runs.iter()
            .any(|run| run.len() >= PLATEAU && samples[run.start].value() == level)
    };
    let rests = |level: &f64| stands(*level) && is_rest(samples, *level);
    let at_rest: Vec<f64> = [range.0, range.1].into_iter().filter(rests).collect();
    let clipping = clipping(samples, &runs, range, &at_rest).filter(|c| !(windowed && c.level == 0.0));
    let clipped = |run: &Range<usize>| clipping.as_ref().is_some_and(|c| c.plateaus.contains(run));
    let stuck = runs
        .into_iter()
        .filter(|run| run.len() >= STUCK && !clipped(run) && !(windowed && samples[run.start].value() == 0.0))
        .filter(|run| !at_rest.contains(&samples[run.start].value()))
        .collect();
    Faults {
        dead: false,
        spikes,
        stuck,
        clipping,
    }
}

/// Values of a channel that is no measurement but a state: a trigger …
const STATES: usize = 8;
/// … or a tool number, a program line: more of them, each held for a while.
const STATES_HELD: usize = 64;
/// Samples that a state is held for, on average.
const HELD: usize = 20;
/// Samples from which so few values cannot be chance.
const ENOUGH_FOR_STATES: usize = 1000;

/// A channel that knows a few values only rests at them and steps between them by nature.
fn is_a_switch<S: Sample>(samples: &[S]) -> bool {
    if samples.len() < ENOUGH_FOR_STATES {
        return false;
    }
    let changes = samples
        .windows(2)
        .filter(|w| w[0] != w[1])
        .take(samples.len() / HELD + 1);
    let most = if changes.count() > samples.len() / HELD {
        STATES
    } else {
        STATES_HELD
    };
    let mut states: Vec<S> = Vec::with_capacity(most);
    for sample in samples {
        // The one seen last is the likeliest.
        if let Some(at) = states.iter().rposition(|s| s == sample) {
            let last = states.len() - 1;
            states.swap(at, last);
        } else if states.len() == most {
            return false;
        } else {
            states.push(*sample);
        }
    }
    true
}

/// More than half of the samples are exactly zero, in long stretches: a force window left the contacts only (or a trigger
/// the blocks). What freezes or drops out makes up a part of a record.
fn is_windowed<S: Sample>(samples: &[S], runs: &[Range<usize>]) -> bool {
    let zeros = runs
        .iter()
        .filter(|run| run.len() >= STUCK && samples[run.start].value() == 0.0);
    2 * zeros.map(|run| run.len()).sum::<usize>() > samples.len()
}

/// Samples looked at in one go by loops without branches.
const BLOCK: usize = 256;

/// Runs of two and more equal samples. Measured values hardly ever repeat: most blocks hold none.
fn runs<S: Sample>(samples: &[S]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for from in (0..samples.len().saturating_sub(1)).step_by(BLOCK) {
        let block = &samples[from..(from + BLOCK + 1).min(samples.len())];
        let pairs = || block.iter().zip(&block[1..]);
        if !pairs().fold(false, |any, (a, b)| any | (a == b)) {
            continue;
        }
        for (i, _) in pairs().enumerate().filter(|(_, (a, b))| a == b) {
            match runs.last_mut() {
                Some(last) if last.end == from + i + 1 => last.end += 1,
                _ => runs.push(from + i..from + i + 2),
            }
        }
    }
    runs
}

/// Least and greatest value; infinite the wrong way round where there is none.
pub(crate) fn least_and_greatest<S: Sample>(samples: &[S]) -> (f64, f64) {
    // Eight by eight, without a branch.
    let (eights, rest) = samples.as_chunks::<8>();
    let (mut low, mut high) = ([f64::INFINITY; 8], [f64::NEG_INFINITY; 8]);
    for eight in eights {
        for k in 0..8 {
            let value = eight[k].value();
            low[k] = if value < low[k] { value } else { low[k] };
            high[k] = if value > high[k] { value } else { high[k] };
        }
    }
    let rest = || rest.iter().map(|v| v.value());
    (
        low.into_iter().chain(rest()).fold(f64::INFINITY, f64::min),
        high.into_iter().chain(rest()).fold(f64::NEG_INFINITY, f64::max),
    )
}

/// Samples in a row without any change that mean a stuck channel.
const STUCK: usize = 20;
/// Samples in a row at the extreme value that make a plateau.
const PLATEAU: usize = 3;

/// Long stretches that are looked at one by one.
const STRETCHES_AT_MOST: usize = 50;

/// Signals of few digits repeat values by nature: nothing can be said about plateaus and rests there. A long stretch
/// speaks for that only where its value is seen elsewhere too, as the zeros of coarse quiet air are.
fn repeats_by_nature<S: Sample>(samples: &[S], runs: &[Range<usize>], (low, high): (f64, f64)) -> bool {
    let (mut repeats, mut stretches) = (0, Vec::new());
    for run in runs {
        if run.len() >= STUCK {
            stretches.push(run.clone());
        } else if ![low, high].contains(&samples[run.start].value()) {
            repeats += run.len() - 1;
        }
    }
    let held = |run: &Range<usize>| {
        let same = samples.iter().filter(|v| **v == samples[run.start]).count();
        500 * (same - run.len()) < samples.len()
    };
    let few = stretches.len() <= STRETCHES_AT_MOST;
    let extreme = |run: &Range<usize>| [low, high].contains(&samples[run.start].value());
    let longest = stretches.iter().map(Range::len).max();
    let natural = stretches
        .iter()
        .filter(|run| !extreme(run) && Some(run.len()) != longest && !(few && held(run)))
        .map(Range::len)
        .sum::<usize>();
    10 * (repeats + natural) > samples.len()
}

/// Least and greatest value; `spikes` do not count.
fn extremes<S: Sample>(samples: &[S], spikes: &[Range<usize>]) -> (f64, f64) {
    let starts = std::iter::once(0).chain(spikes.iter().map(|s| s.end));
    let ends = spikes.iter().map(|s| s.start).chain([samples.len()]);
    let sound = starts
        .zip(ends)
        .map(|(from, to)| least_and_greatest(&samples[from..to]));
    sound.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (l, h)| {
        (low.min(l), high.max(h))
    })
}

/// A level at which peaks are cut off holds so many times the samples of the value next to it: all that would have gone beyond.
/// Where a signal rests in few digits, the value next to its rest is seen as often.
const PILED_UP: usize = 4;

/// True where samples stand at `level` because the signal rests there, with the values next to it in its steps as frequent.
fn is_rest<S: Sample>(samples: &[S], level: f64) -> bool {
    let values = || samples.iter().map(|v| v.value());
    let next = values()
        .filter(|v| *v != level)
        .fold(f64::INFINITY, |least: f64, v| {
            if (v - level).abs() < (least - level).abs() {
                v
            } else {
                least
            }
        });
    let count = |value: f64| values().filter(|v| *v == value).count();
    PILED_UP * count(next) > count(level)
}

/// At least two plateaus at one of the extreme values.
fn clipping<S: Sample>(
    samples: &[S],
    runs: &[Range<usize>],
    (low, high): (f64, f64),
    at_rest: &[f64],
) -> Option<Clipping> {
    [high, low].into_iter().find_map(|level| {
        let plateaus: Vec<Range<usize>> = runs
            .iter()
            .filter(|run| run.len() >= PLATEAU && samples[run.start].value() == level)
            .cloned()
            .collect();
        // A single long one is a stuck channel rather than a peak cut off.
        (plateaus.len() >= 2 && !at_rest.contains(&level)).then_some(Clipping { level, plateaus })
    })
}

/// Longest spike, samples; so far apart lie the neighbours it is compared with.
const WIDEST_SPIKE: usize = 3;
/// Times the height above both neighbours that 99.5 % of the samples stay below.
const SPIKE: f64 = 8.0;

/// Samples on either side of a spike in which an impact would still ring …
const RINGS: usize = 24;
/// … by this part of its height.
const RINGING: f64 = 0.2;

/// Samples that stand far above (or below) those three before and three after. A step has no height in that sense, and
/// what comes back once a revolution is the signal's own.
fn spikes<S: Sample>(samples: &[S]) -> Vec<Range<usize>> {
    let n = samples.len();
    if n < 200 {
        return Vec::new();
    }
    let height = |i: usize| height([i - WIDEST_SPIKE, i, i + WIDEST_SPIKE].map(|at| samples[at].value()));
    let within = WIDEST_SPIKE..n - WIDEST_SPIKE;
    let rank = (within.len() as f64 * 0.995) as usize;
    if none_stands_out(samples, within.len() - rank) {
        return Vec::new();
    }
    let usual = highest(within.clone().map(height), within.len() - rank);
    if usual == 0.0 {
        return Vec::new();
    }
    let mut found: Vec<Range<usize>> = Vec::new();
    for i in within.filter(|i| height(*i) > SPIKE * usual) {
        match found.last_mut() {
            Some(last) if last.end == i => last.end = i + 1,
            _ => found.push(i..i + 1),
        }
    }
    found.retain(|spike| spike.len() <= WIDEST_SPIKE);
    // What swings on after it, or swung before, is an impact that rings.
    found.retain(|spike| {
        let top = spike.clone().map(height).fold(0.0, f64::max);
        let around =
            spike.start.saturating_sub(RINGS).max(WIDEST_SPIKE)..(spike.end + RINGS).min(n - WIDEST_SPIKE);
        let near = spike.start.saturating_sub(WIDEST_SPIKE)..spike.end + WIDEST_SPIKE;
        !around
            .filter(|i| !near.contains(i))
            .any(|i| height(i) > RINGING * top)
    });
    if come_back_evenly(&found) {
        Vec::new()
    } else {
        found
    }
}

/// How far a sample stands above (or below) the one before and the one after it.
#[inline]
fn height([before, here, after]: [f64; 3]) -> f64 {
    let (rise, fall) = (here - before, here - after);
    let least = if rise.abs() < fall.abs() {
        rise.abs()
    } else {
        fall.abs()
    };
    if rise * fall > 0.0 { least } else { 0.0 }
}

/// True where `upper` samples or more are at least a [`SPIKE`]th as high as the highest: then so is the usual height, and none
/// can be [`SPIKE`] times that. Sound records are known by it without their heights being kept and sorted.
fn none_stands_out<S: Sample>(samples: &[S], upper: usize) -> bool {
    let blocks = || {
        let before = samples.chunks(BLOCK);
        let here = samples[WIDEST_SPIKE..].chunks(BLOCK);
        let after = samples[2 * WIDEST_SPIKE..].chunks(BLOCK);
        before.zip(here).zip(after).map(|((before, here), after)| {
            let mut heights = [0.0; BLOCK];
            for (((h, b), c), a) in heights.iter_mut().zip(before).zip(here).zip(after) {
                *h = height([b.value(), c.value(), a.value()]);
            }
            heights
        })
    };
    let highest = blocks().fold(0.0_f64, |most, heights| most.max(least_and_greatest(&heights).1));
    let enough = highest / SPIKE;
    let mut count = 0;
    highest > 0.0
        && blocks().any(|heights| {
            count += heights.iter().map(|h| usize::from(*h >= enough)).sum::<usize>();
            count >= upper
        })
}

/// The least of the `count` highest values.
fn highest(values: impl Iterator<Item = f64>, count: usize) -> f64 {
    let count = count.max(1);
    // Never more than twice as many are kept.
    let mut kept: Vec<f64> = Vec::with_capacity(2 * count);
    let keep = |kept: &mut Vec<f64>| {
        if kept.len() > count {
            kept.select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a));
            kept.truncate(count);
        }
    };
    let mut least = f64::NEG_INFINITY;
    for value in values {
        if value < least {
            continue;
        }
        kept.push(value);
        if kept.len() == 2 * count {
            keep(&mut kept);
            least = kept.iter().copied().fold(f64::INFINITY, f64::min);
        }
    }
    keep(&mut kept);
    kept.into_iter().fold(f64::INFINITY, f64::min)
}

fn come_back_evenly(found: &[Range<usize>]) -> bool {
    if found.len() < 6 {
        return false;
    }
    let mut gaps: Vec<usize> = found.windows(2).map(|w| w[1].start - w[0].start).collect();
    gaps.sort_unstable();
    let middle = gaps[gaps.len() / 2];
    let alike = gaps
        .iter()
        .filter(|g| g.abs_diff(middle) <= 1 + middle / 50)
        .count();
    2 * alike > gaps.len()
}

#[allow(clippy::single_range_in_vec_init)]
#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn the_least_of_the_highest_is_that_of_the_sorted_values() {
        let values: Vec<f64> = (0..1000).map(|i| f64::from(i * 7919 % 1000)).collect();
        for count in [1, 2, 5, 17, 999, 1000] {
            let expected = 1000.0 - count as f64;
            assert_eq!(highest(values.iter().copied(), count), expected);
        }
        assert_eq!(highest([3.0; 40].into_iter(), 5), 3.0);
    }

    fn signal() -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        (0..4000)
            .map(|i| 100.0 * (f64::from(i) * 0.15).sin() + random.random_range(-5.0..5.0))
            .collect()
    }

    fn faults(change: impl Fn(&mut [f64])) -> Faults {
        let mut samples = signal();
        change(&mut samples);
        find_faults(&samples)
    }

    #[test]
    fn a_sound_signal_has_none() {
        assert_eq!(faults(|_| ()), Faults::default());
        assert_eq!(
            faults(|v| v.iter_mut().for_each(|v| *v = (*v / 20.0).round())),
            Faults::default()
        );
        assert_eq!(find_faults::<f64>(&[]), Faults::default());
        assert_eq!(find_faults(&[1.0]), Faults::default());
        // A tooth that rings once a revolution is no fault.
        assert_eq!(
            faults(|v| v.iter_mut().step_by(400).for_each(|v| *v += 900.0)),
            Faults::default()
        );
        // Neither is a step.
        assert_eq!(
            faults(|v| v[2000..].iter_mut().for_each(|v| *v += 2000.0)),
            Faults::default()
        );
    }

    /// A trigger, a tool number; a current in whole steps that rests at its least.
    #[test]
    fn states_and_a_rest_in_few_digits_are_no_faults() {
        let switch: Vec<f64> = (0..4000).map(|i| f64::from((i / 700) % 2)).collect();
        assert_eq!(find_faults(&switch), Faults::default());
        let tool: Vec<f64> = (0..4000).map(|i| f64::from((i / 150 * 7) % 19)).collect();
        assert_eq!(find_faults(&tool), Faults::default());
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let current: Vec<f64> = (0..8000)
            .map(|i| {
                let idle: f64 = random.random_range(0.6..2.6);
                let cut: f64 = random.random_range(200.0..900.0);
                if (i / 1000) % 2 == 0 {
                    idle.round()
                } else {
                    cut.round()
                }
            })
            .collect();
        assert_eq!(find_faults(&current).clipping, None);
        // Cut off in whole steps: piled up at the end of the range.
        let cut_off: Vec<f64> = signal().iter().map(|v| v.round().min(60.0)).collect();
        assert_eq!(find_faults(&cut_off).clipping.map(|c| c.level), Some(60.0));
    }

    #[test]
    fn each_is_found_where_it_is() {
        let found = faults(|v| {
            v[700] += 700.0;
            v[1500] -= 800.0;
            v[1501] -= 800.0;
        });
        assert_eq!(found.spikes, [700..701, 1500..1502]);
        let found = faults(|v| v[1000..1050].fill(12.5));
        assert_eq!((found.stuck.len(), &found.stuck[0]), (1, &(1000..1050)));
        assert_eq!(found.clipping, None);
        assert!(faults(|v| v.fill(3.0)).dead);
        // A spike beyond the range does not hide that the range is too small.
        let found = faults(|v| {
            v.iter_mut().for_each(|v| *v = v.min(80.0));
            v[900] = 5000.0;
        });
        let clipping = found.clipping.unwrap();
        assert_eq!(clipping.level, 80.0);
        assert!(clipping.plateaus.len() > 50, "{}", clipping.plateaus.len());
        assert!(
            found.stuck.is_empty() && found.spikes.len() == 1 && found.spikes[0] == (900..901),
            "{:?}",
            found.spikes
        );
        let inside = clipping.plateaus[3].clone();
        assert_eq!(clipping.samples_in(&(inside.start..inside.end)), inside.len());
    }

    /// A force window's zeros are no stuck channel, and a tool that rings at a few samples a period has no spikes; a spike and
    /// a frozen stretch among them are still found.
    #[test]
    fn taps_with_a_force_window_on_a_ringing_tool_are_sound() {
        let (mut force, mut tool) = (vec![0.0; 20_000], vec![0.0; 20_000]);
        let mut random = ChaCha8Rng::seed_from_u64(8);
        tool.iter_mut()
            .for_each(|v| *v = random.random_range(-0.01..0.01));
        for hit in [1500, 7000, 13_100] {
            for k in 0..9 {
                force[hit + k] = 200.0 * (f64::from(k as u32 + 1) * 0.314).sin();
            }
            for k in 0..60 {
                // A quarter of the sampling rate.
                tool[hit + k] += 80.0 * (k as f64 * 1.6).sin() * (-(k as f64) / 15.0).exp();
            }
        }
        assert_eq!(find_faults(&force), Faults::default());
        assert_eq!(find_faults(&tool), Faults::default());
        tool[4000] += 60.0;
        assert_eq!(find_faults(&tool).spikes, [4000..4001]);
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let mut hanging: Vec<f64> = (0..20_000).map(|_| random.random_range(-5.0..5.0)).collect();
        hanging[5000..9000].fill(0.0);
        assert_eq!(find_faults(&hanging).stuck, [5000..9000]);
    }

    /// Long plateaus are clipping too, where there are several.
    #[test]
    fn slow_peaks_cut_off_are_clipped_and_not_stuck() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let samples: Vec<f64> = (0..20_000)
            .map(|i| (100.0 * (f64::from(i) * 0.005).sin() + random.random_range(-1.0..1.0)).min(60.0))
            .collect();
        let found = find_faults(&samples);
        assert!(found.stuck.is_empty() && found.clipping.is_some());
    }
}
