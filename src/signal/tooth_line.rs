//! Is the record made at the spindle speed the campaign says? Its spectrum must hold the tooth-passing line.

use std::f64::consts::TAU;

use realfft::{RealFftPlanner, RealToComplex};

use super::blocks::median;
use super::mains::MAINS_HZ;
use crate::data::Sample;

/// What the spectrum of a steady cut says about the spindle speed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ToothLine {
    /// Strongest line on a multiple of the nominal spindle frequency, over the noise floor (amplitudes).
    pub nominal_to_noise: f64,
    /// Strongest line anywhere, Hz.
    pub strongest_hz: f64,
    /// Its amplitude over the noise floor.
    pub strongest_to_noise: f64,
    /// The strongest line, or that of which it is a harmonic, Hz: tooth passing.
    pub tooth_hz: f64,
}

impl ToothLine {
    /// A clear line exists, and none of the spindle's own multiples rises from the noise and the skirts of that
    /// line. (Chatter, too, is a
    /// clear line off the comb, but next to it.)
    pub fn speed_is_doubtful(&self) -> bool {
        self.strongest_to_noise > 30.0 && self.nominal_to_noise < (0.03 * self.strongest_to_noise).max(8.0)
    }
}

/// Longest transform; a longer record is looked at from its start.
const MAX_SAMPLES: usize = 1 << 17;
/// A line of this part of the strongest, at a fraction of its frequency, is what the strongest is a harmonic of. (Not where that
/// fraction is one of the number of teeth: there runout puts its line, once per turn, and as strong a one as it likes.)
const FUNDAMENTAL: f64 = 0.3;
/// A nominal speed is good to this part of it.
const NOMINAL: f64 = 0.005;
/// The frequency of a line is good to this part of the spectrum's resolution.
const PLACED: f64 = 0.5;

/// Looks for lines in the Hann-windowed amplitude spectra of the `channels` of one steady cut, all together (drift compensated, or
/// not: a line is taken out). All together, because one direction may show twice the tooth passing more strongly than itself.
/// `None` where the record is shorter than 8 revolutions, or has no spectrum.
pub fn tooth_line<S: Sample>(
    channels: &[&[S]],
    sample_rate_hz: f64,
    spindle_hz: f64,
    teeth: usize,
) -> Option<ToothLine> {
    let n = channels.iter().map(|c| c.len()).min()?.min(MAX_SAMPLES);
    let resolution_hz = sample_rate_hz / n.max(1) as f64;
    let usable = spindle_hz.is_finite() && sample_rate_hz.is_finite() && spindle_hz > 8.0 * resolution_hz;
    if n < 64 || !usable {
        return None;
    }
    let mut power = vec![0.0; n / 2 + 1];
    let transform = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    for samples in channels {
        add_power(&samples[..n], transform.as_ref(), &mut power);
    }
    let amplitude: Vec<f64> = power.into_iter().map(f64::sqrt).collect();
    let noise = median(&amplitude);
    if !noise.is_finite() || noise <= 0.0 {
        return None;
    }
    let lines_in = |hz: f64, half_width_hz: f64| {
        let from = ((hz - half_width_hz) / resolution_hz).round().max(0.0) as usize;
        let to = ((hz + half_width_hz) / resolution_hz).round().max(0.0) as usize;
        from..(to + 1).min(amplitude.len())
    };
    let peak = |hz: f64, half_width_hz: f64| -> f64 {
        amplitude
            .get(lines_in(hz, half_width_hz))
            .map_or(0.0, |part| part.iter().copied().fold(0.0, f64::max))
    };
    // The strongest line that stands there itself: what only rises towards a line beside it is the skirt of that.
    let own_peak = |hz: f64| -> f64 {
        let half_width_hz = (NOMINAL * hz).max(PLACED * resolution_hz).min(0.2 * spindle_hz);
        lines_in(hz, half_width_hz + resolution_hz)
            .filter(|&i| {
                let at = |i: usize| amplitude.get(i).copied().unwrap_or(0.0);
                let is_top = i > 0 && at(i) > at(i - 1) && at(i) >= at(i + 1);
                let place_hz = (i as f64 + peak_shift(&amplitude, i)) * resolution_hz;
                is_top && (place_hz - hz).abs() <= half_width_hz
            })
            .map(|i| amplitude[i])
            .fold(0.0, f64::max)
    };
    // Mains hum and its first odd harmonic are no tooth.
    let off_mains = |hz: f64| {
        let mut loud = MAINS_HZ.iter().flat_map(|mains| [*mains, 3.0 * mains]);
        loud.all(|loud| (loud - hz).abs() > 4.0 * resolution_hz)
    };
    // Below half a turn there is only drift.
    let first = (0.5 * spindle_hz / resolution_hz).ceil() as usize;
    let (at, strongest) = amplitude
        .iter()
        .enumerate()
        .skip(first)
        .filter(|(i, _)| off_mains(*i as f64 * resolution_hz))
        .max_by(|a, b| a.1.total_cmp(b.1))?;
    let strongest_hz = (at as f64 + peak_shift(&amplitude, at)) * resolution_hz;
    // A line that the strongest and its own turn put there says nothing of the stated turn. (2.5 turns are off its comb, and their
    // double is on it.)
    let is_multiple = |hz: f64, of_hz: f64| {
        let nearest = (hz / of_hz).round().max(1.0) * of_hz;
        (hz - nearest).abs() <= (NOMINAL * hz).max(PLACED * resolution_hz)
    };
    let own_turn_hz = (!is_multiple(strongest_hz, spindle_hz)).then(|| strongest_hz / teeth.max(1) as f64);
    let nominal = (1..=teeth.max(1))
        .chain([2 * teeth.max(1)])
        .map(|k| k as f64 * spindle_hz)
        .filter(|hz| off_mains(*hz))
        .filter(|hz| !own_turn_hz.is_some_and(|turn_hz| is_multiple(*hz, turn_hz)))
        .map(own_peak)
        .fold(0.0, f64::max);
    let is_harmonic = |m: &usize| {
        let hz = strongest_hz / *m as f64;
        *m != teeth && hz > 0.5 * spindle_hz && peak(hz, 1.5 * resolution_hz) > FUNDAMENTAL * strongest
    };
    let harmonic = (2..=4).rev().find(is_harmonic).unwrap_or(1);
    Some(ToothLine {
        nominal_to_noise: nominal / noise,
        strongest_hz,
        strongest_to_noise: strongest / noise,
        tooth_hz: strongest_hz / harmonic as f64,
    })
}

/// Adds |X|² of a channel, a line taken out of it, to that of the others.
fn add_power<S: Sample>(samples: &[S], transform: &dyn RealToComplex<f64>, power: &mut [f64]) {
    let n = samples.len();
    let index = || (0..n).map(|i| i as f64);
    let (mean, slope, centre) = super::blocks::line(index(), samples.iter().map(|v| v.value()));
    let mut input: Vec<f64> = samples
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let hann = 0.5 - 0.5 * (TAU * i as f64 / n as f64).cos();
            hann * (v.value() - mean - slope * (i as f64 - centre))
        })
        .collect();
    let mut spectrum = transform.make_output_vec();
    // It fails with buffers of other lengths only, and these are its own.
    if transform.process(&mut input, &mut spectrum).is_ok() {
        power
            .iter_mut()
            .zip(&spectrum)
            .for_each(|(p, c)| *p += c.norm_sqr());
    }
}

/// Where a peak lies between lines: the top of the parabola through the logarithms of three neighbours, in lines.
fn peak_shift(amplitude: &[f64], at: usize) -> f64 {
    let log = |i: usize| amplitude.get(i).map(|a| a.max(f64::MIN_POSITIVE).ln());
    let (Some(left), Some(top), Some(right)) = (at.checked_sub(1).and_then(log), log(at), log(at + 1)) else {
        return 0.0;
    };
    let bend = left - 2.0 * top + right;
    if bend < 0.0 {
        (0.5 * (left - right) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn cut(tooth_hz: f64, hum: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        (0..6000)
            .map(|i| {
                let t = i as f64 / 5000.0;
                let noise: f64 = rng.random_range(-10.0..10.0);
                100.0 + 30.0 * (TAU * tooth_hz * t).sin() + hum * (TAU * 50.0 * t).sin() + 8.0 * t + noise
            })
            .collect()
    }

    #[test]
    fn the_right_speed_passes_and_a_wrong_one_is_told_with_its_line() {
        let right = tooth_line(&[&cut(120.0, 5.0)], 5000.0, 20.0, 6).unwrap();
        assert!(!right.speed_is_doubtful(), "{right:?}");
        // Off by 7 %: no line on the nominal comb.
        let wrong = tooth_line(&[&cut(128.9, 5.0)], 5000.0, 20.0, 6).unwrap();
        assert!(wrong.speed_is_doubtful(), "{wrong:?}");
        assert!((wrong.strongest_hz - 128.9).abs() < 0.1);
    }

    #[test]
    fn noise_hum_and_silence_accuse_nobody() {
        let hum = tooth_line(&[&cut(0.0, 50.0)], 5000.0, 20.0, 6).unwrap();
        assert!(!hum.speed_is_doubtful(), "{hum:?}");
        assert_eq!(tooth_line(&[&[0.0; 5000]], 5000.0, 20.0, 6), None);
        assert_eq!(tooth_line(&[&[1.0; 10]], 5000.0, 20.0, 6), None);
        assert_eq!(tooth_line(&[&cut(120.0, 0.0)], 5000.0, f64::NAN, 6), None);
    }

    /// Forces of two teeth, one of which cuts less: lines once per turn, `turn_hz`, and twice; noise beside them.
    fn uneven_pair(turn_hz: f64, once_per_turn: f64, seconds: f64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        (0..(seconds * 5000.0) as usize)
            .map(|i| {
                let angle = TAU * turn_hz * i as f64 / 5000.0;
                let noise: f64 = rng.random_range(-1.0..1.0);
                once_per_turn * (angle + 0.3).sin() + 100.0 * (2.0 * angle).sin() + noise
            })
            .collect()
    }

    #[test]
    fn the_skirt_of_a_line_in_a_short_record_is_no_line_of_the_stated_speed() {
        // One second shows lines 1 Hz wide at best: at 700 rpm the tooth passing of 802 rpm stands three of them beside.
        let record = uneven_pair(802.0 / 60.0, 10.0, 1.0);
        let at = |rpm: f64| tooth_line(&[&record], 5000.0, rpm / 60.0, 2).unwrap();
        for rpm in [700.0, 750.0, 775.0, 830.0, 850.0, 900.0] {
            assert!(at(rpm).speed_is_doubtful(), "{rpm}: {:?}", at(rpm));
            assert!(
                (at(rpm).tooth_hz * 30.0 - 802.0).abs() < 4.0,
                "{rpm}: {:?}",
                at(rpm)
            );
        }
        for rpm in [799.0, 802.0, 806.0] {
            assert!(!at(rpm).speed_is_doubtful(), "{rpm}: {:?}", at(rpm));
        }
    }

    #[test]
    fn runout_is_not_taken_for_the_tooth_passing() {
        for once_per_turn in [0.0, 35.0, 60.0, 90.0] {
            let record = uneven_pair(100.0, once_per_turn, 2.0);
            let found = tooth_line(&[&record], 5000.0, 5000.0 / 60.0, 2).unwrap();
            assert!(found.speed_is_doubtful(), "{found:?}");
            assert!((found.tooth_hz - 200.0).abs() < 0.2, "{once_per_turn}: {found:?}");
        }
    }

    #[test]
    fn a_line_that_happens_to_stand_on_both_combs_excuses_no_wrong_speed() {
        // The fifth line of 80 Hz is twice the tooth passing of 100 Hz × 2 teeth.
        let mut record = uneven_pair(80.0, 30.0, 2.0);
        for (i, v) in record.iter_mut().enumerate() {
            *v += 12.0 * (TAU * 400.0 * i as f64 / 5000.0).cos();
        }
        let at = |turn_hz: f64| tooth_line(&[&record], 5000.0, turn_hz, 2).unwrap();
        assert!(at(100.0).speed_is_doubtful(), "{:?}", at(100.0));
        assert!((at(100.0).tooth_hz - 160.0).abs() < 0.2, "{:?}", at(100.0));
        assert!(!at(80.0).speed_is_doubtful(), "{:?}", at(80.0));
    }

    #[test]
    fn chatter_beside_the_tooth_passing_is_no_wrong_speed() {
        let mut record = uneven_pair(80.0, 30.0, 2.0);
        for chatter_hz in [217.0, 433.0, 505.6] {
            for (i, v) in record.iter_mut().enumerate() {
                *v += 250.0 * (TAU * chatter_hz * i as f64 / 5000.0).cos();
            }
            let found = tooth_line(&[&record], 5000.0, 80.0, 2).unwrap();
            assert!(!found.speed_is_doubtful(), "{chatter_hz}: {found:?}");
        }
    }
}
