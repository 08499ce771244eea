//! The time column of a table: rate and start, gaps and how they are filled, units that are called wrongly.

use std::ops::Range;

use crate::InputError;
use crate::ingest::tables::clock::{self, Grid, Stamps};
use crate::ingest::tables::table::Header;
use crate::ingest::text::Notes;

/// How the time column runs, decided from the first piece.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    pub rate_hz: f64,
    pub start_s: f64,
    /// Rounding of the printed times; `None` where they are too coarse to show gaps.
    pub rounding_s: Option<f64>,
    /// Where the times are not even: what the samples are put on.
    pub grid: Option<Grid>,
}

/// A place where samples are missing: those behind sample `after`, so many.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gap {
    pub after: usize,
    pub missing: usize,
}

/// Puts a straight line into the gaps; gives where it now runs.
pub(crate) fn fill(values: &mut Vec<f64>, gaps: &[Gap]) -> Vec<Range<usize>> {
    if gaps.is_empty() {
        return Vec::new();
    }
    let missing: usize = gaps.iter().map(|g| g.missing).sum();
    let mut whole = Vec::with_capacity(values.len() + missing);
    let (mut filled, mut done) = (Vec::new(), 0);
    for gap in gaps {
        let Some([from, to]) = values
            .get(gap.after..gap.after + 2)
            .and_then(|v| v.first_chunk::<2>())
        else {
            continue;
        };
        whole.extend_from_slice(&values[done..=gap.after]);
        done = gap.after + 1;
        let start = whole.len();
        let step = (to - from) / (gap.missing + 1) as f64;
        whole.extend((1..=gap.missing).map(|k| from + step * k as f64));
        filled.push(start..whole.len());
    }
    whole.extend_from_slice(&values[done..]);
    *values = whole;
    filled
}

/// The remedy of times that are wrong where the samples are right.
const OR_A_RATE: &str = "where the samples are even and the times are not to be trusted: give rate_hz in a [[channel]] of campaign.toml";

/// Sampling rate and start from the time column, checked against the rate of the header. The column is what was
/// measured: a header describes the recording, an export may be decimated.
pub(crate) fn time_axis(
    seconds: &[f64],
    resolution: f64,
    header_rate: Option<f64>,
    header: &Header,
    is_whole: bool,
    notes: &mut Notes,
) -> Result<Clock, InputError> {
    let start_s = seconds[0];
    let runs = Runs::find(seconds, resolution);
    if !(runs.step_s.is_finite() && runs.step_s > 0.0) {
        let error = InputError::new("the time column does not rise").line(header.data_line);
        return match header_rate {
            Some(rate) if seconds.is_sorted() && resolution * rate > 1.0 => {
                notes.file("the printed time is too coarse: time from the sampling rate");
                Ok(Clock {
                    rate_hz: rate,
                    start_s,
                    rounding_s: None,
                    grid: None,
                })
            }
            _ => Err(error.remedy(format!("the time column must rise from row to row; {OR_A_RATE}"))),
        };
    }
    if !runs.are_even(seconds) {
        let (grid, told) = match clock::look(seconds, resolution) {
            Ok(Stamps::Uneven(grid, told)) => (grid, told),
            Ok(Stamps::Even(grid)) => (grid, "the times drift off their own steps: resampled".into()),
            Err(problem) => return Err(refused(&problem, header)),
        };
        if !is_whole {
            return Err(refused(
                "steps that change, in a file too long to be resampled at once",
                header,
            ));
        }
        notes.file(told);
        return Ok(Clock {
            rate_hz: grid.rate_hz,
            start_s,
            rounding_s: None,
            grid: Some(grid),
        });
    }
    let (own, rounding) = (runs.step_s, runs.rounding);
    let rate = match header_rate {
        // Within the rounding of the printed time the header is the sharper witness.
        Some(rate) if (own * rate - 1.0).abs() <= (1e-3_f64).max(2.0 * rounding) => rate,
        other => {
            if let Some(rate) = other {
                notes.file(format!(
                    "the header says {rate} Hz, the time column {:.6} Hz: the time column is taken",
                    1.0 / own
                ));
            }
            rounded_rate(own, rounding)
        }
    };
    Ok(Clock {
        rate_hz: rate,
        start_s,
        rounding_s: Some(runs.resolution_s),
        grid: None,
    })
}

pub(crate) fn refused(problem: &str, header: &Header) -> InputError {
    InputError::new(format!("the samples are not evenly spaced in time: {problem}"))
        .line(header.data_line)
        .remedy(format!(
            "export the record again with even steps, or cut the row range out that has them; {OR_A_RATE}"
        ))
}

/// Factor that puts right a time column whose unit is called wrongly ("ms" on values in seconds): what the header's rate
/// says, else nothing is put right and what cannot be is refused.
pub(crate) fn time_unit(
    seconds: &[f64],
    resolution: f64,
    factor: f64,
    header_rate: Option<f64>,
    header: &Header,
    notes: &mut Notes,
) -> Result<f64, InputError> {
    let is_ms = (factor - 1e-3).abs() < 1e-9;
    if header_rate.is_none() && !is_ms {
        return Ok(1.0);
    }
    let own = 1.0 / Runs::find(seconds, resolution).step_s;
    if !(own.is_finite() && own > 0.0) {
        return Ok(1.0);
    }
    if let Some(rate) = header_rate {
        for k in [1e-6, 1e-3, 1e3, 1e6] {
            if (own / (rate * k) - 1.0).abs() < 0.01 {
                notes.file(format!(
                    "the time column gives {own:.0} Hz, the header {rate} Hz: the unit of the times is called wrongly and put right"
                ));
                return Ok(k);
            }
        }
        return Ok(1.0);
    }
    // Milliseconds are written for slow clocks; hundreds of kilohertz of them are seconds called milliseconds.
    if is_ms && own >= MS_AT_MOST {
        return Err(InputError::new(format!(
            "the time column is in ms and gives {own:.0} samples a second: seconds called ms"
        ))
        .line(header.data_line.saturating_sub(1).max(1))
        .remedy("name the column time_s, or add a line `Sampling rate [Hz]:,10000` above the names"));
    }
    Ok(1.0)
}

/// Sampling rate from which times in "ms" must be something else, Hz: analysers of forces and vibrations end at 262 kHz (a bandwidth
/// of 102.4 kHz), and forces in seconds are hardly ever sampled below 300 Hz, which is 300 kHz where the seconds are called ms.
const MS_AT_MOST: f64 = 300e3;

/// Stretches of a time column without gaps, and the step in them.
pub(crate) struct Runs {
    /// Mean over all stretches, s; what rounding of the printed times leaves in it, as a part of it.
    pub step_s: f64,
    pub rounding: f64,
    stretches: Vec<Range<usize>>,
    /// What printing left of the times, s; 0 where they are exact.
    pub resolution_s: f64,
}

impl Runs {
    pub fn find(seconds: &[f64], resolution: f64) -> Runs {
        let steps = || seconds.windows(2).map(|w| w[1] - w[0]);
        let mut runs = Runs {
            step_s: f64::NAN,
            rounding: 0.0,
            stretches: Vec::new(),
            resolution_s: resolution,
        };
        let Some(median) = median_step(seconds) else {
            return runs;
        };
        let count = seconds.len() - 1;
        let mean = steps().sum::<f64>() / count as f64;
        // Nine steps of ten agree, and what the others add up to does not speak against them: nothing was rounded.
        let agree = steps().filter(|s| (s - median).abs() <= 1e-3 * median).count();
        let (sum, short) = steps()
            .filter(|s| *s <= 1.5 * median)
            .fold((0.0, 0.0), |(sum, short), s| (sum + s, short + 1.0));
        let is_exact = 10 * agree >= 9 * count && (sum / short / median - 1.0).abs() <= 1e-5;
        let resolution = if is_exact { 0.0 } else { resolution };
        runs.resolution_s = resolution;
        // Where times are printed coarsely most steps are zero and the median says nothing.
        let usual = 1.5 * median.max(mean.min(2.0 * resolution)) + 1.01 * resolution;
        let is_gap = |w: &[f64]| !(-1.01 * resolution.max(1e-12)..=usual).contains(&(w[1] - w[0]));
        let ends = seconds
            .windows(2)
            .enumerate()
            .filter(|(_, w)| is_gap(w))
            .map(|(i, _)| i + 1);
        let (mut from, mut span_s, mut intervals) = (0, 0.0, 0);
        for end in ends.chain([seconds.len()]) {
            span_s += seconds[end - 1] - seconds[from];
            intervals += end - 1 - from;
            runs.stretches.push(from..end);
            from = end;
        }
        if intervals > 0 && span_s > 0.0 {
            runs.step_s = span_s / intervals as f64;
            // Both ends of each stretch are rounded.
            runs.rounding = resolution * (runs.stretches.len() as f64).sqrt() / span_s;
        }
        runs
    }

    pub fn are_even(&self, seconds: &[f64]) -> bool {
        let even = |r: &Range<usize>| clock::is_even(&seconds[r.clone()], self.step_s, self.resolution_s);
        self.stretches.iter().all(even)
    }
}

/// Steps of the beginning from which the median of all is guessed.
const GUESSED_FROM: usize = 1024;
/// Part of it by which a guess may miss the median: what rounding of `f64` leaves in steps, and nothing beside any limit here.
const SAME_STEP: f64 = 1e-7;

/// Median of the steps of a time column, to within [`SAME_STEP`]: that of the beginning, where neither half of all steps lies
/// below it nor half above; else all are sorted. `None` without steps.
fn median_step(seconds: &[f64]) -> Option<f64> {
    let median = |seconds: &[f64]| {
        let mut steps: Vec<f64> = seconds.windows(2).map(|w| w[1] - w[0]).collect();
        let middle = steps.len() / 2;
        (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    let guess = median(&seconds[..seconds.len().min(GUESSED_FROM + 1)])?;
    let (low, high) = (guess - SAME_STEP * guess.abs(), guess + SAME_STEP * guess.abs());
    let steps = seconds.windows(2).map(|w| w[1] - w[0]);
    let (below, above) = steps.fold((0_usize, 0_usize), |(below, above), s| {
        (below + usize::from(s < low), above + usize::from(s > high))
    });
    if 2 * below.max(above) + 1 < seconds.len() {
        return Some(guess);
    }
    median(seconds)
}

/// Rate of a step: a whole number of hertz where the rounding of the times allows it.
fn rounded_rate(step: f64, rounding: f64) -> f64 {
    let rate = 1.0 / step;
    let slack = 2.0 * rounding.max(1e-9);
    if rate >= 1.0 && (rate.round() / rate - 1.0).abs() <= slack {
        rate.round()
    } else {
        rate
    }
}

/// Gaps may add up to this part of a record; beyond it the time column is something else than a clock.
const FILL_AT_MOST: f64 = 0.1;

/// Samples that were lost on the way, over all pieces.
#[derive(Debug, Default)]
pub(crate) struct Lost {
    pub missing: f64,
    places: usize,
    first_after_s: Option<f64>,
    backwards: usize,
}

impl Lost {
    /// Where samples are missing in the times of a piece.
    ///
    /// # Errors
    /// The problem, where too many are missing to be filled.
    pub fn look(&mut self, seconds: &[f64], step: f64, resolution: f64) -> Result<Vec<Gap>, String> {
        let slack = 0.5 * step + 1.01 * resolution;
        let (mut missing, mut gaps, mut backwards) = (0.0, Vec::new(), 0);
        for (after, pair) in seconds.windows(2).enumerate() {
            let jump = pair[1] - pair[0];
            if jump > step + slack {
                let count = (jump / step).round() - 1.0;
                missing += count;
                gaps.push(Gap {
                    after,
                    missing: count as usize,
                });
            } else if jump < -1.01 * resolution.max(1e-12) {
                backwards += 1;
            }
        }
        self.backwards += backwards;
        self.missing += missing;
        self.places += gaps.len();
        let first = gaps.first().map(|g| seconds[g.after]);
        self.first_after_s = self.first_after_s.or(first);
        match first {
            Some(first) if missing > FILL_AT_MOST * seconds.len() as f64 => Err(format!(
                "{missing:.0} samples dropped at {} places (the first after {first:.6} s) are too many to fill",
                gaps.len()
            )),
            _ => Ok(gaps),
        }
    }

    pub fn tell(&self, notes: &mut Notes) {
        if self.backwards > 0 {
            notes.file(format!(
                "the time column runs backwards at {} places: the samples are taken as if they followed each other",
                self.backwards
            ));
        }
        let Some(first) = self.first_after_s else { return };
        let places = if self.places == 1 { "place" } else { "places" };
        notes.file(format!(
            "{:.0} samples dropped at {} {places} (the first after {first:.6} s): the gaps are filled, so that times behind \
             them are right (cfc puts the revolutions beside in their place); record to a faster disk or at a lower rate",
            self.missing, self.places
        ));
    }
}
