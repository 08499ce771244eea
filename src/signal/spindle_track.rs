//! The angle of the spindle from the forces of a steady cut: the phase of a line of the teeth (or of the turn), turn by turn,
//! and what low-order profile of the speed makes it.
//!
//! Each turn of the stated speed is demodulated at the line (as in Vold & Leuridan 1993, with a window of one turn); the phase
//! of all channels together, from turn to turn, is unwrapped. The profile of maximum likelihood is then found among cosines
//! over the window (Ahmed, Natarajan & Rao 1974) next to a constant and a linear change of speed, as many as Schwarz's criterion
//! (1978) pays for; white noise of the phase makes that least squares.

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::blocks::mean;
use crate::data::Sample;

/// The angle of the spindle over a steady cut.
#[derive(Debug, Clone, PartialEq)]
pub struct SpindleTrack {
    /// Line that was followed, in orders of the turn.
    pub order: usize,
    /// Speed over the stated one less 1, mean over the window, with its standard error.
    pub offset: f64,
    /// Standard error of `offset`.
    pub offset_std: f64,
    /// Change of the speed from the window's start to its end, over the stated speed (the linear part).
    pub droop: f64,
    /// Standard error of `droop`.
    pub droop_std: f64,
    /// Standard deviation of the rest of the speed's changes, over the stated speed.
    pub wander: f64,
    /// Standard error of `wander`.
    pub wander_std: f64,
    /// Root mean square by which the tool is early or late against the stated speed, rad of its turn.
    pub smear_rad: f64,
    /// Share of the line's power that is in step: at the stated speed, and along the track.
    pub in_step: [f64; 2],
    /// Part by which the line's amplitude changes over the window.
    line_change: f64,
    /// First sample of the window.
    from: usize,
    samples_per_turn: f64,
    turns: usize,
    /// Angle ahead of the stated speed, rad: x, 2 x² − 1 with x from −1 to 1 over the window, then cosines.
    coefficients: Vec<f64>,
}

/// Shorter cuts tell no profile.
const LEAST_TURNS: usize = 8;
/// Turns that a cosine needs, at least: half a period.
const TURNS_PER_COSINE: usize = 5;
const MOST_COSINES: usize = 24;
/// Share of the line's power that must be in step along the track for it to be believed: less is chatter, noise or no line.
const LEAST_IN_STEP: f64 = 0.8;
/// Speeds further off than this show in the spectrum as a wrong speed or a wrong number of teeth, and nothing is removed.
const FURTHEST: f64 = 0.03;
/// Share of a line that putting in step may leave wrong, as made records show.
const WITHIN_A_TURN: f64 = 1e-3;
/// Turns of the line from one turn of the tool to the next, above what is stated, up to which the count is sure.
const SURE_STEP: f64 = 0.4;
/// Part by which the line's amplitude may change over the window beside what changes of the speed make of it.
const ONE_FORCE: f64 = 0.15;
/// Smear of the followed line, rad of its own phase (rms), from which on it is reported: at 0.15 the line's average loses 1 %.
const WORTH_TELLING: f64 = 0.15;
/// Standard deviations that a part of the profile must exceed zero by to be reported.
const SIGMAS: f64 = 5.0;

/// Follows the spindle over `window` of `channels` (baselines need not be taken off). `None` where nothing can be
/// found wrong: too few turns, no line that is in step, or one that keeps the stated speed as closely as matters.
pub fn spindle_track<S: Sample>(
    channels: &[&[S]],
    window: &Range<usize>,
    samples_per_turn: f64,
    teeth: usize,
) -> Option<SpindleTrack> {
    let turns = (window.len() as f64 / samples_per_turn + 1e-6).floor() as usize;
    if turns < LEAST_TURNS || !(samples_per_turn > 2.5 * teeth as f64) {
        return None;
    }
    // The teeth's line is the strongest as a rule; where it is not in step the turn's own may be.
    let mut orders = vec![teeth.max(1)];
    if teeth > 1 {
        orders.push(1);
    }
    let length = (turns as f64 * samples_per_turn).ceil() as usize;
    let own: Vec<&[S]> = channels
        .iter()
        .map(|values| {
            let end = (window.start + length).min(values.len());
            values.get(window.start..end).unwrap_or(&[])
        })
        .collect();
    let start = Start {
        from: window.start,
        samples_per_turn,
        turns,
    };
    orders
        .into_iter()
        .filter_map(|order| follow(&own, start, order))
        .filter(|track| track.is_of_one_force())
        .find(|track| track.in_step[1] >= LEAST_IN_STEP)
        .filter(SpindleTrack::is_told)
}

/// Where the window begins, and what is stated.
#[derive(Debug, Clone, Copy)]
struct Start {
    from: usize,
    samples_per_turn: f64,
    turns: usize,
}

/// The phase of a line in `windows`, one a channel.
fn follow<S: Sample>(windows: &[&[S]], start: Start, order: usize) -> Option<SpindleTrack> {
    let Start {
        from,
        samples_per_turn,
        turns,
    } = start;
    let of_turns: Vec<Vec<Complex64>> = windows
        .iter()
        .map(|values| {
            let each = (0..turns).map(|k| line_of_turn(values, k, samples_per_turn, order));
            each.collect()
        })
        .collect();
    let power: f64 = of_turns.iter().flatten().map(|z| z.norm_sqr()).sum();
    if !(power > 0.0 && power.is_finite()) {
        return None;
    }
    // Phase of all channels from one turn to the next.
    let step = |k: usize| -> f64 {
        let product: Complex64 = of_turns.iter().map(|z| z[k + 1] * z[k].conj()).sum();
        product.arg()
    };
    let mut phase = vec![0.0];
    for k in 0..turns - 1 {
        phase.push(phase[k] + step(k));
    }
    // From this track, which adds up the errors of its steps, to each turn against the mean of all.
    let mut profile = fit_profile(&phase)?;
    for _ in 0..2 {
        let ahead = |k: usize| profile.at(k, turns);
        let reference: Vec<Complex64> = of_turns
            .iter()
            .map(|z| {
                let each = z.iter().enumerate();
                each.map(|(k, z)| z * Complex64::from_polar(1.0, -ahead(k))).sum()
            })
            .collect();
        phase = (0..turns)
            .map(|k| {
                let each = of_turns.iter().zip(&reference);
                let product: Complex64 = each.map(|(z, r)| z[k] * r.conj()).sum();
                ahead(k) + (product * Complex64::from_polar(1.0, -ahead(k))).arg()
            })
            .collect();
        profile = fit_profile(&phase)?;
    }
    let in_step = |angle: &dyn Fn(usize) -> f64| -> f64 {
        let sums = of_turns.iter().map(|z| {
            let each = z.iter().enumerate();
            each.map(|(k, z)| z * Complex64::from_polar(1.0, -angle(k)))
                .sum::<Complex64>()
                .norm_sqr()
        });
        sums.sum::<f64>() / (turns as f64 * power)
    };
    let amplitude: Vec<f64> = (0..turns)
        .map(|k| of_turns.iter().map(|z| z[k].norm_sqr()).sum::<f64>().sqrt())
        .collect();
    let n = order as f64;
    let in_step = [in_step(&|_| 0.0), in_step(&|k| profile.at(k, turns))];
    let [rate, rate_std, change, change_std] = profile.of_speed(turns);
    let coefficients: Vec<f64> = profile.coefficients.iter().map(|c| c / n).collect();
    let (wander, wander_std) = profile.wander(turns);
    Some(SpindleTrack {
        order,
        offset: rate / (TAU * n),
        offset_std: rate_std / (TAU * n),
        droop: change / (TAU * n),
        droop_std: change_std / (TAU * n),
        wander: wander / (TAU * n),
        wander_std: wander_std / (TAU * n),
        smear_rad: smear_rad(&coefficients, turns),
        in_step,
        line_change: super::change(&amplitude),
        from,
        samples_per_turn,
        turns,
        coefficients,
    })
}

/// Mean of x e^(−i n θ) over turn `k` of the stated speed, the turn's mean taken out. (A slope taken out, too, would take some of
/// every line with it.)
fn line_of_turn<S: Sample>(values: &[S], k: usize, samples_per_turn: f64, order: usize) -> Complex64 {
    let start = k as f64 * samples_per_turn;
    let (first, last) = (
        start.round() as usize,
        ((start + samples_per_turn).round() as usize).min(values.len()),
    );
    let own = values.get(first..last).unwrap_or(&[]);
    let level = mean(own);
    let step = TAU * order as f64 / samples_per_turn;
    let each = own
        .iter()
        .enumerate()
        .map(|(i, v)| Complex64::from_polar(v.value() - level, -step * (first + i) as f64));
    each.sum::<Complex64>() / own.len().max(1) as f64
}

/// Phase of the line over the turns, less its constant.
struct Profile {
    /// As [`SpindleTrack::coefficients`], of the line's own phase.
    coefficients: Vec<f64>,
    covariance: DMatrix<f64>,
}

fn basis(count: usize, x: f64) -> Vec<f64> {
    let terms = (0..count).map(|j| match j {
        0 => x,
        1 => 2.0 * x * x - 1.0,
        _ => (PI * (j - 1) as f64 * 0.5 * (x + 1.0)).cos(),
    });
    terms.collect()
}

fn slope_of_basis(count: usize, x: f64) -> Vec<f64> {
    let terms = (0..count).map(|j| match j {
        0 => 1.0,
        1 => 4.0 * x,
        _ => {
            let w = PI * (j - 1) as f64;
            -0.5 * w * (w * 0.5 * (x + 1.0)).sin()
        }
    });
    terms.collect()
}

/// The angle with these coefficients at turn `k`, less its constant.
fn angle_at(coefficients: &[f64], k: usize, turns: usize) -> f64 {
    let basis = basis(coefficients.len(), place(k as f64, turns));
    coefficients.iter().zip(basis).map(|(c, b)| c * b).sum()
}

/// Root mean square of an angle with these coefficients about its mean, over the turns.
fn smear_rad(coefficients: &[f64], turns: usize) -> f64 {
    let angles: Vec<f64> = (0..turns).map(|k| angle_at(coefficients, k, turns)).collect();
    let middle = mean(&angles);
    (angles.iter().map(|a| (a - middle).powi(2)).sum::<f64>() / turns as f64).sqrt()
}

/// Place of the middle of turn `k` in the window, −1 to 1.
fn place(k: f64, turns: usize) -> f64 {
    (2.0 * k + 1.0) / turns as f64 - 1.0
}

fn fit_profile(phase: &[f64]) -> Option<Profile> {
    let turns = phase.len();
    let n = turns as f64;
    let most = 2 + (turns / TURNS_PER_COSINE).min(MOST_COSINES);
    let value = DVector::from_column_slice(phase);
    let mut all = DMatrix::from_element(turns, most + 1, 1.0);
    for k in 0..turns {
        for (j, b) in basis(most, place(k as f64, turns)).into_iter().enumerate() {
            all[(k, j + 1)] = b;
        }
    }
    let (gram, with_value) = (all.tr_mul(&all), all.tr_mul(&value));
    let solve = |count: usize| -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        let normal = gram
            .view((0, 0), (count + 1, count + 1))
            .into_owned()
            .try_inverse()?;
        let x = &normal * with_value.rows(0, count + 1);
        let rest = (&value - all.columns(0, count + 1) * &x).norm_squared();
        Some((rest, x, normal))
    };
    let tried: Vec<(f64, usize)> = (1..=most)
        .filter_map(|count| {
            // Rounding errors are no phase: a hundredth of a milliradian.
            let rest = solve(count)?.0 / n + 1e-10;
            Some((n * rest.ln() + count as f64 * n.ln(), count))
        })
        .collect();
    let (_, count) = tried.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (rest, x, normal) = solve(count)?;
    let variance = rest / (n - count as f64 - 1.0).max(1.0);
    Some(Profile {
        coefficients: x.iter().skip(1).copied().collect(),
        covariance: normal.view((1, 1), (count, count)) * variance,
    })
}

impl Profile {
    /// Phase at turn `k`, less the constant.
    fn at(&self, k: usize, turns: usize) -> f64 {
        angle_at(&self.coefficients, k, turns)
    }

    /// `weight` · coefficients, and its standard deviation.
    fn sum(&self, weight: &[f64]) -> (f64, f64) {
        let w = DVector::from_column_slice(weight);
        let value: f64 = self.coefficients.iter().zip(weight).map(|(c, w)| c * w).sum();
        (value, (w.transpose() * &self.covariance * &w)[0].max(0.0).sqrt())
    }

    /// Slopes of the basis in rad per turn, one row a turn.
    fn slopes(&self, turns: usize) -> Vec<Vec<f64>> {
        let count = self.coefficients.len();
        let per_turn = 2.0 / turns as f64;
        let of = |k: usize| slope_of_basis(count, place(k as f64, turns));
        (0..turns)
            .map(|k| of(k).into_iter().map(|s| s * per_turn).collect())
            .collect()
    }

    /// Mean of the slope (rad per turn), and its change over the window by a straight line, each with its standard deviation.
    fn of_speed(&self, turns: usize) -> [f64; 4] {
        let slopes = self.slopes(turns);
        let n = turns as f64;
        let count = self.coefficients.len();
        let squares: f64 = (0..turns).map(|k| place(k as f64, turns).powi(2)).sum();
        let weights = |weight: &dyn Fn(usize) -> f64| -> Vec<f64> {
            (0..count)
                .map(|j| slopes.iter().enumerate().map(|(k, s)| weight(k) * s[j]).sum())
                .collect()
        };
        let (rate, rate_std) = self.sum(&weights(&|_| 1.0 / n));
        let (change, change_std) = self.sum(&weights(&|k| 2.0 * place(k as f64, turns) / squares));
        [rate, rate_std, change, change_std]
    }

    /// Standard deviation of the slope about that straight line (rad per turn), and of itself.
    fn wander(&self, turns: usize) -> (f64, f64) {
        let slopes = self.slopes(turns);
        let [rate, _, change, _] = self.of_speed(turns);
        let n = turns as f64;
        let rest: Vec<f64> = slopes
            .iter()
            .enumerate()
            .map(|(k, s)| {
                let slope: f64 = s.iter().zip(&self.coefficients).map(|(s, c)| s * c).sum();
                slope - rate - 0.5 * change * place(k as f64, turns)
            })
            .collect();
        let wander = (rest.iter().map(|r| r * r).sum::<f64>() / n).sqrt();
        if wander <= 0.0 || self.coefficients.len() < 3 {
            return (0.0, 0.0);
        }
        // dW = Σ rest ds / (n W).
        let count = self.coefficients.len();
        let weights: Vec<f64> = (0..count)
            .map(|j| {
                let each = slopes.iter().zip(&rest).map(|(s, r)| s[j] * r);
                each.sum::<f64>() / (n * wander)
            })
            .collect();
        (wander, self.sum(&weights).1)
    }
}

impl SpindleTrack {
    /// Offset, droop and wander with their standard errors.
    pub fn parts(&self) -> [(f64, f64); 3] {
        [
            (self.offset, self.offset_std),
            (self.droop, self.droop_std),
            (self.wander, self.wander_std),
        ]
    }

    /// Where the engagement changes, the angle at which a tooth cuts does as well, and the force with it: no change of the speed,
    /// which makes the chip as much thicker as the spindle is slower.
    fn is_of_one_force(&self) -> bool {
        let speed = self.offset.abs() + self.droop.abs() + 3.0 * self.wander;
        self.line_change.abs() < ONE_FORCE + 3.0 * speed
    }

    fn is_told(&self) -> bool {
        // Of a speed that droops so far that it passes the stated one the mean lies further off, as far as steps from turn to turn are
        // sure by a whole one.
        let changes = 0.5 * self.droop.abs() + 2.0 * self.wander;
        let is_sure = self.order as f64 * (self.offset.abs() + changes) < SURE_STEP;
        let is_near = self.offset.abs() < FURTHEST || (is_sure && self.offset.abs() < changes + FURTHEST);
        is_near && self.order as f64 * self.smear_rad > WORTH_TELLING && self.told().contains(&true)
    }

    /// The parts that stand above their errors: offset, droop, wander.
    pub fn told(&self) -> [bool; 3] {
        self.parts().map(|(value, std)| value.abs() > SIGMAS * std)
    }

    /// Whether droop or wander are worth telling, and not an offset alone.
    pub fn varies(&self) -> bool {
        let [_, droops, wanders] = self.told();
        self.order as f64 * self.varying_rad() > WORTH_TELLING && (droops || wanders)
    }

    /// As [`Self::smear_rad`], against the mean speed instead of the stated one.
    pub fn varying_rad(&self) -> f64 {
        let mut own = self.coefficients.clone();
        if let Some(first) = own.first_mut() {
            *first -= PI * self.turns as f64 * self.offset;
        }
        smear_rad(&own, self.turns)
    }

    /// Share of a line at `order` by which its average over the turns may be wrong. Where the track does not follow, a phase that
    /// scatters by σ leaves 1 − σ²/2, and it scatters in proportion to the order; between two samples the interpolation takes
    /// 1 − (9 cos ω/2 − cos 3ω/2) / 8, ω rad a sample; and some is left of what is quicker than a turn.
    pub fn lost_of_line(&self, order: usize) -> f64 {
        let ratio = order as f64 / self.order as f64;
        let unfollowed = 0.5 * ratio * ratio * (1.0 - self.in_step[1]).max(0.0);
        let half = 0.5 * TAU * order as f64 / self.samples_per_turn;
        let between = 1.0 - (9.0 * half.cos() - (3.0 * half).cos()) / 8.0;
        (unfollowed + between + WITHIN_A_TURN).min(1.0)
    }

    /// Root mean square of the speed's changes over the stated speed, and its standard error.
    pub fn variation(&self) -> (f64, f64) {
        // A straight line from −d/2 to d/2 has d/√12.
        let (droop, droop_std) = (self.droop / 12f64.sqrt(), self.droop_std / 12f64.sqrt());
        let all = droop.hypot(self.wander);
        let std = ((droop * droop_std).powi(2) + (self.wander * self.wander_std).powi(2)).sqrt() / all;
        (all, std)
    }

    /// Angle ahead of the stated speed at a sample, rad, zero at the middle of the window; outside it stays what it is at its
    /// ends: nothing is known there.
    fn ahead(&self, sample: f64) -> f64 {
        let turn = (sample - self.from as f64) / self.samples_per_turn;
        let x = (2.0 * turn / self.turns as f64 - 1.0).clamp(-1.0, 1.0);
        let at = |x: f64| -> f64 {
            let basis = basis(self.coefficients.len(), x);
            self.coefficients.iter().zip(basis).map(|(c, b)| c * b).sum()
        };
        at(x) - at(0.0)
    }

    /// The sample of the record at which the spindle stands where it would at `sample` had it kept the stated speed.
    pub fn sample_in_step(&self, sample: f64) -> f64 {
        // θ(s) = s + ahead(s) is to be `sample`; the speed is off by a few per cent, so that the map contracts.
        let mut s = sample;
        for _ in 0..30 {
            let next = sample - self.ahead(s) * self.samples_per_turn / TAU;
            let done = (next - s).abs() < 1e-9;
            s = next;
            if done {
                break;
            }
        }
        s
    }

    /// `values` as they would have been sampled in step with a spindle of the stated speed; as long as before.
    pub fn in_step_samples<S: Sample>(&self, values: &[S]) -> Vec<S> {
        self.resampled(values, 0..values.len())
    }

    /// Samples `range` of that: cubic interpolation between samples (Keys 1981).
    fn resampled<S: Sample>(&self, values: &[S], range: Range<usize>) -> Vec<S> {
        let last = values.len().saturating_sub(1) as isize;
        let from = self.from as f64;
        let window = from..from + self.turns as f64 * self.samples_per_turn;
        // Beyond the record it goes backwards: one value throughout would be no air.
        let within = |i: isize| i.abs().min(2 * last - i).clamp(0, last) as usize;
        let value = |i: isize| values.get(within(i)).map_or(0.0, |v| v.value());
        range
            .map(|i| {
                let at = self.sample_in_step(i as f64);
                // Beyond what was followed samples move whole: between two of them noise is less, and air would not be air any more.
                let at = if window.contains(&at) { at } else { at.round() };
                let low = at.floor();
                let (t, i) = (at - low, low as isize);
                let [a, b, c, d] = [value(i - 1), value(i), value(i + 1), value(i + 2)];
                S::of(
                    b + 0.5
                        * t
                        * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a))),
                )
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const PER_TURN: f64 = 97.3;
    const TEETH: usize = 4;

    /// Two channels of a tool of four teeth with runout; `speed(x)`: over the stated one, x from 0 to 1 over the record.
    fn records(turns: usize, noise: f64, seed: u64, speed: &dyn Fn(f64) -> f64) -> [Vec<f64>; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let n = (turns as f64 * PER_TURN) as usize;
        let mut angle = 0.7;
        let mut channels = [vec![], vec![]];
        for i in 0..n {
            for (c, channel) in channels.iter_mut().enumerate() {
                let of = |order: f64, size: f64| size * (order * angle + order * order + c as f64).cos();
                let error: f64 = crate::statistics::nearly_normal(&mut random);
                let drift = 0.001 * i as f64;
                channel.push(150.0 + of(1.0, 8.0) + of(4.0, 60.0) + of(8.0, 20.0) + noise * error + drift);
            }
            angle += TAU / PER_TURN * speed(i as f64 / n as f64);
        }
        channels
    }

    fn track(turns: usize, noise: f64, seed: u64, speed: &dyn Fn(f64) -> f64) -> Option<SpindleTrack> {
        let channels = records(turns, noise, seed, speed);
        let refs: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
        spindle_track(&refs, &(0..refs[0].len()), PER_TURN, TEETH)
    }

    #[test]
    fn an_offset_a_droop_and_a_wander_are_found_with_their_errors() {
        for seed in 0..5 {
            let offset = track(60, 15.0, seed, &|_| 1.007).unwrap();
            assert!(
                (offset.offset - 0.007).abs() < 5.0 * offset.offset_std.max(1e-5),
                "{offset:?}"
            );
            assert!(offset.offset_std < 1e-4 && offset.in_step[1] > 0.95);

            let droop = track(60, 15.0, seed, &|x| 1.0 - 0.02 * x).unwrap();
            assert!(
                (droop.droop + 0.02).abs() < 5.0 * droop.droop_std.max(2e-5),
                "{droop:?}"
            );
            assert!((droop.offset + 0.01).abs() < 3e-4, "{droop:?}");

            // 1.3 Hz at 25 turns/s over 60 turns: 3.1 periods, 0.5 % high.
            let wander = track(60, 15.0, seed, &|x| 1.0 + 0.005 * (TAU * 3.12 * x + 0.4).sin()).unwrap();
            let truth = 0.005 / 2f64.sqrt();
            assert!((wander.wander / truth - 1.0).abs() < 0.1, "{wander:?}");
            assert!(wander.in_step[1] > 0.95, "{wander:?}");
        }
    }

    #[test]
    fn what_keeps_its_speed_is_left_alone() {
        for seed in 0..20 {
            let turns = 10 + 9 * seed as usize;
            for noise in [0.0, 15.0, 60.0, 300.0] {
                assert_eq!(
                    track(turns, noise, seed, &|_| 1.0),
                    None,
                    "{turns} turns, {noise} N"
                );
            }
        }
        // Noise alone, and a speed that is not this cut's.
        assert_eq!(track(60, 3000.0, 3, &|_| 1.0), None);
        assert_eq!(track(60, 15.0, 3, &|_| 1.06), None);
    }

    #[test]
    fn in_step_every_turn_is_like_the_others() {
        let speed = |x: f64| 0.995 - 0.02 * x + 0.005 * (TAU * 3.0 * x).sin();
        let channels = records(60, 0.0, 1, &speed);
        let refs: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
        let found = spindle_track(&refs, &(0..refs[0].len()), PER_TURN, TEETH).unwrap();
        let amplitude = |values: &[f64]| {
            let turns = 58;
            let sum: Complex64 = (1..=turns)
                .map(|k| line_of_turn(values, k, PER_TURN, TEETH))
                .sum();
            2.0 * sum.norm() / f64::from(turns as u32)
        };
        assert!(amplitude(refs[0]) < 30.0, "{}", amplitude(refs[0]));
        let straight = found.in_step_samples(refs[0]);
        let (got, truth) = (amplitude(&straight), amplitude(&records(60, 0.0, 1, &|_| 1.0)[0]));
        assert!((got / truth - 1.0).abs() < 0.01, "{got} {truth}");
    }
}
