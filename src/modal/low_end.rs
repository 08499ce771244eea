//! Where FRFs begin to say something: below what sensor and excitation reach, their lines are rubbish.
//!
//! An accelerometer measures nothing but drift at the lowest lines, and as displacements these lines are the largest of all: a
//! fit spends its poles on them. There a line has nothing to do with its neighbours, while every structure moves smoothly below
//! its first mode.

use num_complex::Complex64;

/// Neighbouring lines that differ by more than this share of the larger one scatter. (The mobility of a spring or of a mass changes by a
/// half between the first two lines of a file, and by less between all others.)
const SCATTER: f64 = 0.6;
/// So many pairs of lines in a row that do not scatter end the rubbish.
const SOUND_PAIRS: usize = 2;
/// At most this share of the lines is left out.
const MOST: f64 = 0.05;

/// Index of the first line above 0 Hz that is no rubbish, of FRFs on the same lines; the common run of them counts.
pub(crate) fn first_sound_line(frequency_hz: &[f64], receptances: &[&[Complex64]]) -> usize {
    let first = frequency_hz.partition_point(|f| *f <= 0.0);
    let last =
        (first + (MOST * frequency_hz.len() as f64) as usize).min(frequency_hz.len().saturating_sub(1));
    let (mut sound, mut pairs) = (first, 0);
    for k in first..last {
        let change = |h: &&[Complex64]| {
            let [a, b] = [k, k + 1].map(|line| h[line] * frequency_hz[line]);
            let larger = a.norm().max(b.norm());
            // A line that was never measured is no better than one that scatters.
            if larger > 0.0 && larger.is_finite() {
                (a - b).norm() / larger
            } else {
                1.0
            }
        };
        let changes: Vec<f64> = receptances.iter().map(change).collect();
        if !changes.is_empty() && crate::signal::median(&changes) > SCATTER {
            (sound, pairs) = (k + 1, 0);
        } else {
            pairs += 1;
            if pairs == SOUND_PAIRS {
                break;
            }
        }
    }
    sound
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    #[test]
    fn the_lines_below_the_sensors_range_are_left_out_and_no_others() {
        let case = |mode: f64| Synthetic::new(0.0, 200.0, 0.5, &[SyntheticMode::new(mode, 0.01, 1.0)]).frf();
        let (f, clean) = case(60.0);
        assert_eq!(first_sound_line(&f, &[&clean]), 1);
        // Drift on seven lines, as an accelerometer has it.
        let mut drifting = clean.clone();
        for (k, h) in drifting.iter_mut().enumerate().take(8).skip(1) {
            *h += Complex64::from_polar(3.0 * clean[8].norm(), (k * k * 7) as f64);
        }
        assert_eq!(first_sound_line(&f, &[&drifting]), 8);
        // One FRF of three says nothing of the others.
        assert_eq!(first_sound_line(&f, &[&clean, &drifting, &clean]), 1);
        // A narrow mode on the first lines stays.
        let (f, low) = case(2.6);
        assert_eq!(first_sound_line(&f, &[&low]), 1);
        // Lines that were not measured, and nothing but noise: at most a twentieth goes.
        let mut zeros = clean.clone();
        zeros[..6].fill(Complex64::ZERO);
        assert_eq!(first_sound_line(&f, &[&zeros]), 6);
        let noise: Vec<Complex64> = (0..f.len())
            .map(|k| Complex64::from_polar(1.0, (k * k) as f64))
            .collect();
        assert!(first_sound_line(&f, &[&noise]) <= 1 + f.len() / 20);
        assert_eq!(first_sound_line(&[], &[]), 0);
    }
}
