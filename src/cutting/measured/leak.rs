//! Forces through a high-pass: a charge amplifier at a short time constant, or an input that is AC-coupled. What a cut lost of its
//! mean force stands on the other side of zero when the cut ends, and dies away.

use std::ops::Range;

use crate::cutting::measured::cut_analysis::Notice;
use crate::data::Sample;
use crate::signal::{self, SignalBlocks, robust_std};

pub(crate) const HIGH_PASS: &str = "a high-pass takes the mean force away: where the cut ends the zero stands on the other side and comes back; \
     set the amplifier to its long time constant and the input to DC, and cut again (averages and coefficients of this \
     record are too small)";

/// Part of the mean force that stands on the other side of zero from which on it is told.
const LOST: f64 = 0.1;
/// Ratio of the changes between thirds of the air above which it is a line, not something that dies away.
const STRAIGHT: f64 = 0.8;
/// Standard deviations of turn means by which the first third must differ from the second.
const SIGMAS: f64 = 6.0;
/// Turns of each third, at least.
const LEAST_TURNS: usize = 4;

/// Of one channel, from the air before the cut, its steady window and the air after it; samples a turn and a second.
pub(crate) fn high_pass<S: Sample>(
    channel: &str,
    values: &[S],
    [before, steady, after]: [&Range<usize>; 3],
    (turn, rate): (f64, f64),
) -> Option<Notice> {
    let own = values.get(after.clone())?;
    let level = |range: &Range<usize>| values.get(range.clone()).map_or(0.0, signal::mean);
    let force = level(steady) - level(before);
    let turns = SignalBlocks::of(own.len(), |i| own[i].value(), turn).mean;
    let third = turns.len() / 3;
    if third < LEAST_TURNS {
        return None;
    }
    let mean = |k: usize| turns[k * third..(k + 1) * third].iter().sum::<f64>() / third as f64;
    let (first, second) = (mean(0) - mean(1), mean(1) - mean(2));
    let ratio = second / first;
    // Turn against turn, for the last third may still come back.
    let steps: Vec<f64> = turns[2 * third..].windows(2).map(|w| w[1] - w[0]).collect();
    let scatter = robust_std(&steps) / std::f64::consts::SQRT_2;
    if !(ratio > 0.0 && ratio < STRAIGHT) || first.abs() < SIGMAS * scatter {
        return None;
    }
    // y e^(−t/τ) averaged over thirds of length a: the differences are y (τ/a) (1 − r)² rᵏ with r = e^(−a/τ).
    let a_s = third as f64 * turn / rate;
    let tau_s = -a_s / ratio.ln();
    let at_the_end = first * a_s / (tau_s * (1.0 - ratio).powi(2));
    (at_the_end * force < 0.0 && at_the_end.abs() > LOST * force.abs()).then(|| Notice {
        kind: HIGH_PASS,
        detail: format!("{channel}: {at_the_end:+.0} after {force:+.0}, time constant {tau_s:.2} s"),
    })
}

/// The shares that channels lost differ by this factor at most …
const SAME_SHARE: f64 = 1.4;
/// … and lie between these: of a force that leaks away within the cut the zero takes more than its mean.
const SHARES: std::ops::Range<f64> = 0.02..3.0;
/// Up to this share the force hardly changes in the cut, so that the share tells the time constant.
const SLOW: f64 = 0.7;

/// Of a time constant longer than the air after the cut, where the zero does not come back in the record: each channel's zero moved
/// against its force, by the same share of it. `channels`: mean force and step of the zero of those that carry it, N or N·m;
/// `cutting_s`: how long it acted.
pub(crate) fn leaked(channels: &[[f64; 2]], cutting_s: f64) -> Option<Notice> {
    let mut shares: Vec<f64> = channels.iter().map(|[force, step]| -step / force).collect();
    shares.sort_by(f64::total_cmp);
    let [least, .., most] = shares.as_slice() else {
        return None;
    };
    let alike = SHARES.contains(least) && SHARES.contains(most) && *most < SAME_SHARE * least;
    let share = 0.5 * (least + most);
    // What is left of a unit force after the time that it acted is e^(−t/τ).
    let time_constant = match share < SLOW {
        true => format!(
            "of about {} s",
            crate::text::figures(-cutting_s / (-share).ln_1p(), 2)
        ),
        false => format!(
            "no longer than the cut's {} s",
            crate::text::figures(cutting_s, 2)
        ),
    };
    alike.then(|| Notice {
        kind: HIGH_PASS,
        detail: format!(
            "the zero of each channel moved against its force by the same share, {:.0} %: a time constant {time_constant}",
            100.0 * share
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 5000.0;
    const TURN: f64 = 125.0;

    /// A cut of `force` from 1 s to 2 s, through a high-pass, with noise of a newton; what is told of the air after it.
    fn told(force: f64, tau_s: f64, drift_per_s: f64) -> Option<Notice> {
        let mut low = 0.0;
        let values: Vec<f64> = (0..(3.0 * RATE) as usize)
            .map(|i| {
                let t = i as f64 / RATE;
                let cutting = (1.0..2.0).contains(&t);
                let now = if cutting { force } else { 0.0 };
                low += (now - low) / (tau_s * RATE);
                let noise = ((i * 7919 % 1009) as f64 / 504.5 - 1.0) * 1.7;
                now - low + drift_per_s * t + noise
            })
            .collect();
        high_pass(
            "Fx",
            &values,
            [&(0..4900), &(5500..9500), &(10_300..15_000)],
            (TURN, RATE),
        )
    }

    #[test]
    fn what_dies_away_after_the_cut_is_told_and_a_drift_is_not() {
        let notice = told(200.0, 0.3, 0.0).unwrap();
        assert!(notice.detail.contains("time constant 0.3"), "{}", notice.detail);
        assert!(told(-80.0, 0.15, 5.0).is_some());
        assert_eq!(told(200.0, 1e9, 0.0), None);
        assert_eq!(told(200.0, 1e9, 30.0), None);
        // A long time constant takes little, and what it took does not come back within a second.
        assert_eq!(told(200.0, 40.0, 0.0), None);
    }

    #[test]
    fn zeros_that_move_against_their_forces_by_one_share_are_a_leak() {
        let told = |channels: &[[f64; 2]]| leaked(channels, 2.0).map(|n| n.detail);
        let found = told(&[[-100.0, 18.0], [400.0, -72.5]]).unwrap();
        assert!(found.contains("18 %") && found.contains("about 10 s"), "{found}");
        let fast = told(&[[-100.0, 130.0], [400.0, -510.0]]).unwrap();
        assert!(fast.contains("no longer than the cut's 2.0 s"), "{fast}");
        // One alone, along the force, of other shares, or none.
        assert_eq!(told(&[[400.0, -72.0]]), None);
        assert_eq!(told(&[[-100.0, -18.0], [400.0, 72.5]]), None);
        assert_eq!(told(&[[-100.0, 18.0], [400.0, -20.0]]), None);
        assert_eq!(told(&[[-100.0, 0.0], [400.0, 0.0]]), None);
    }
}
