//! Lines of rotating parts among the responses: recognised, taken out, named.
//!
//! A rotating part at constant speed gives a line as narrow as the record is long; a mode is 2ζf wide. So a line is what
//! stands in the periodogram of the whole record above its immediate neighbours further than noise of that level ever
//! does. Where the speed wavers the line widens, but its envelope stays constant while that of a mode under random forces
//! comes and goes (Brincker, Andersen & Møller 2000, use the kurtosis of the band-passed signal for the same).

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rayon::prelude::*;
use realfft::RealFftPlanner;
use serde::Serialize;

use super::mode::OperationalMode;

/// Lines of the periodogram on either side of a peak that are its own (Hann window) …
const OWN: usize = 3;
/// … and those beyond that tell the level around it, each side.
const AROUND: usize = 12;
/// One record in this many shows a line where there is none.
const FALSE_ALARM: f64 = 1e-3;
/// Hann's neighbouring lines are correlated: so many of them are worth one independent one.
const CORRELATED: f64 = 1.5;
/// What a sine of slowly changing size and phase leaves of its lines is at most this share of them (of random motion whose band is a line
/// wide 2 % are below, half are above 16 %), or so many times the level around.
const WIDER: f64 = 0.02;
const BY_CHANCE: f64 = 1.5;
/// Rounds of finding and taking out: a strong line hides weak ones next to it.
const ROUNDS: usize = 3;
/// Mean fourth power of the envelope over its squared mean square: 2 for random motion, 1 for a sine.
const CONSTANT: f64 = 1.5;
/// Standard deviations below 2.
const SURE: f64 = 3.0;
/// Independent values of the envelope in a stretch that is judged by itself.
const STRETCH: f64 = 12.0;
/// A spindle under load is slower than it was told to be by up to this part.
const SLIP: f64 = 0.01;
/// Damping ratio below which what is near a multiple of the spindle's speed is doubtful …
const NARROW: f64 = 3e-3;
/// … and what is anywhere, where other lines tell that something turns: welded steel has about this.
const VERY_NARROW: f64 = 1e-3;
/// A speed is believed where chance would bring as many multiples of any in less than this part of all records.
const BY_LUCK: f64 = 1e-2;
/// A multiple of the spindle's frequency is met to within this part, or two lines of the periodogram.
const SAME: f64 = 1e-3;
/// Lines that must be multiples of one frequency to call it the speed.
const ENOUGH: usize = 3;
/// Highest multiple that is named.
const HIGHEST: u32 = 200;

/// One line of a rotating part (or of the mains).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Harmonic {
    /// Frequency of the line, Hz.
    pub frequency_hz: f64,
    /// Power of the line over that of its neighbourhood, in the channel that shows it best.
    pub over_noise: f64,
    /// Multiple of [`Harmonic::of_hz`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiple: Option<u32>,
    /// Frequency of rotation that it is a multiple of, Hz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_hz: Option<f64>,
}

impl Harmonic {
    /// `38.42 Hz (3 × 12.81 Hz)`.
    pub fn describe(&self) -> String {
        match (self.multiple, self.of_hz) {
            (Some(k), Some(of)) => format!("{:.2} Hz ({k} × {of:.2} Hz)", self.frequency_hz),
            _ => format!("{:.2} Hz", self.frequency_hz),
        }
    }
}

/// Finds the lines within the band and takes them out of all channels; what remains of the channels has none.
pub(super) fn take_out(
    channels: &mut [Vec<f64>],
    rate_hz: f64,
    band_hz: [f64; 2],
    spindle_rpm: Option<f64>,
) -> Vec<Harmonic> {
    let samples = channels.first().map_or(0, Vec::len);
    let mut found: Vec<Harmonic> = Vec::new();
    if samples < 16 * (OWN + AROUND) {
        return found;
    }
    for _ in 0..ROUNDS {
        let new = lines(channels, rate_hz, band_hz);
        if new.is_empty() {
            break;
        }
        let frequencies: Vec<f64> = new.iter().map(|h| h.frequency_hz).collect();
        channels.par_iter_mut().for_each(|channel| {
            for &f in &frequencies {
                subtract(channel, f / rate_hz);
            }
        });
        for line in new {
            let near =
                |h: &Harmonic| (h.frequency_hz - line.frequency_hz).abs() < 2.0 * rate_hz / samples as f64;
            if !found.iter().any(near) {
                found.push(line);
            }
        }
    }
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    name(
        &mut found,
        spindle_rpm.map(|rpm| rpm / 60.0),
        rate_hz / samples as f64,
    );
    found
}

fn hann(samples: &[f64]) -> Vec<Complex64> {
    let n = samples.len();
    let mut windowed: Vec<f64> = samples
        .iter()
        .enumerate()
        .map(|(k, x)| x * (0.5 - 0.5 * (TAU * k as f64 / n as f64).cos()))
        .collect();
    spectrum(&mut windowed)
}

fn spectrum(samples: &mut [f64]) -> Vec<Complex64> {
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(samples.len());
    let mut out = plan.make_output_vec();
    // Lengths are those of the plan.
    let done = plan.process(samples, &mut out);
    debug_assert!(done.is_ok());
    out
}

fn lines(channels: &[Vec<f64>], rate_hz: f64, band_hz: [f64; 2]) -> Vec<Harmonic> {
    let samples = channels[0].len();
    let spectra: Vec<Vec<Complex64>> = channels.par_iter().map(|c| hann(c)).collect();
    let count = spectra[0].len();
    let step_hz = rate_hz / samples as f64;
    let reach = OWN + AROUND;
    // Ratio of two exponential means is F(2, 2m)-distributed: P(> x) = (1 + x/m)^−m.
    let m = 2.0 * AROUND as f64 / CORRELATED;
    let trials = (count * channels.len()) as f64;
    let threshold = m * ((trials / FALSE_ALARM).powf(1.0 / m) - 1.0);
    let mut found: Vec<Harmonic> = Vec::new();
    for k in reach + 2..count.saturating_sub(reach) {
        let f = k as f64 * step_hz;
        if f < band_hz[0] || f > band_hz[1] {
            continue;
        }
        let mut best = (0.0, 0);
        for (c, spectrum) in spectra.iter().enumerate() {
            let power = spectrum[k].norm_sqr();
            if power < spectrum[k - 1].norm_sqr() || power <= spectrum[k + 1].norm_sqr() {
                continue;
            }
            let side =
                |from: usize| -> f64 { spectrum[from..from + AROUND].iter().map(|z| z.norm_sqr()).sum() };
            let around = (side(k - reach) + side(k + OWN + 1)) / (2.0 * AROUND as f64);
            if around > 0.0 && power / around > best.0 {
                best = (power / around, c);
            }
        }
        let spectrum = &spectra[best.1];
        // A mode that is hardly wider than a line stands above its neighbours as well.
        let noise = (2 * OWN + 1) as f64 * spectrum[k].norm_sqr() / best.0.max(f64::MIN_POSITIVE);
        let as_narrow = || {
            let [whole, left] = beside_a_sine(spectrum, k);
            left < (WIDER * whole).max(BY_CHANCE * noise)
        };
        if best.0 > threshold && as_narrow() {
            found.push(Harmonic {
                frequency_hz: (k as f64 + between(spectrum, k)) * step_hz,
                over_noise: best.0,
                multiple: None,
                of_hz: None,
            });
        }
    }
    found
}

/// Power in the lines of a peak, and what a sine of slowly changing size and phase leaves of it.
fn beside_a_sine(spectrum: &[Complex64], k: usize) -> [f64; 2] {
    // Hann's lines of a sine d lines away, seen from the middle of the record: 1 at 0, ½ at ±1.
    let lobe = |d: f64| match (d.abs() < 1e-9, (d.abs() - 1.0).abs() < 1e-6) {
        (true, _) => 1.0,
        (_, true) => 0.5,
        _ => (PI * d).sin() / (PI * d * (1.0 - d * d)),
    };
    let slope = |d: f64| (lobe(d + 1e-3) - lobe(d - 1e-3)) / 2e-3;
    let at = k as f64 + between(spectrum, k);
    let lines = k - OWN..=k + OWN;
    let seen: Vec<Complex64> = lines
        .clone()
        .map(|i| if i % 2 == 0 { spectrum[i] } else { -spectrum[i] })
        .collect();
    let rows: Vec<nalgebra::Vector2<f64>> = lines
        .map(|i| i as f64 - at)
        .map(|d| nalgebra::Vector2::new(lobe(d), slope(d)))
        .collect();
    let whole = seen.iter().map(|z| z.norm_sqr()).sum();
    let normal: nalgebra::Matrix2<f64> = rows.iter().map(|row| row * row.transpose()).sum();
    let Some(factor) = normal.cholesky() else {
        return [whole, whole];
    };
    let fitted = |part: fn(&Complex64) -> f64| {
        factor.solve(&rows.iter().zip(&seen).map(|(row, z)| row * part(z)).sum())
    };
    let (re, im) = (fitted(|z| z.re), fitted(|z| z.im));
    let rest = |(row, z): (&nalgebra::Vector2<f64>, &Complex64)| {
        (z - Complex64::new(row.dot(&re), row.dot(&im))).norm_sqr()
    };
    [whole, rows.iter().zip(&seen).map(rest).sum()]
}

/// Place of a sine's peak between lines, −½ … ½, from the two largest lines under Hann's window: for δ lines from the
/// larger the ratio of the neighbour to it is (1 + δ)/(2 − δ).
fn between(spectrum: &[Complex64], k: usize) -> f64 {
    let (below, at, above) = (
        spectrum[k - 1].norm(),
        spectrum[k].norm().max(f64::MIN_POSITIVE),
        spectrum[k + 1].norm(),
    );
    let (ratio, sign) = if above > below {
        (above / at, 1.0)
    } else {
        (below / at, -1.0)
    };
    sign * ((2.0 * ratio - 1.0) / (ratio + 1.0)).clamp(0.0, 0.5)
}

/// Takes out a sine of known frequency (cycles a sample) and its slow change of size and phase over the record: fitted
/// with Hann-weighted least squares in a constant and a slope.
fn subtract(samples: &mut [f64], cycles: f64) {
    let n = samples.len() as f64;
    // cos, sin, t·cos, t·sin; normal equations of four.
    let terms = |k: usize| {
        let (sin, cos) = (TAU * (cycles * k as f64).fract()).sin_cos();
        let t = 2.0 * k as f64 / n - 1.0;
        [cos, sin, t * cos, t * sin]
    };
    let mut normal = nalgebra::Matrix4::<f64>::zeros();
    let mut right = nalgebra::Vector4::<f64>::zeros();
    for (k, x) in samples.iter().enumerate() {
        let row = nalgebra::Vector4::from(terms(k));
        let weight = (PI * k as f64 / n).sin().powi(2);
        normal += weight * row * row.transpose();
        right += weight * *x * row;
    }
    let Some(fitted) = normal.cholesky().map(|c| c.solve(&right)) else {
        return;
    };
    for (k, x) in samples.iter_mut().enumerate() {
        *x -= nalgebra::Vector4::from(terms(k)).dot(&fitted);
    }
}

/// How unlikely it is that chance brings `count` lines where it brings `mean` on average: −ln P of a Poisson count that is far above its
/// mean (Chernoff's bound).
fn surprise(count: f64, mean: f64) -> f64 {
    if count <= mean {
        return 0.0;
    }
    count * (count / mean.max(f64::MIN_POSITIVE)).ln() - count + mean
}

/// Names the lines as multiples of the speed that is given, else of the highest frequency that most are multiples of.
fn name(lines: &mut [Harmonic], speed_hz: Option<f64>, step_hz: f64) {
    let multiple = |f: f64, of: f64| {
        let k = (f / of).round();
        let apart = (f - k * of).abs();
        (k >= 1.0 && k <= f64::from(HIGHEST) && apart < (SAME * f).max(2.0 * step_hz)).then_some(k as u32)
    };
    let of_hz = speed_hz.or_else(|| {
        let frequencies: Vec<f64> = lines.iter().map(|l| l.frequency_hz).collect();
        let mut best: Option<(f64, f64)> = None;
        for f in &frequencies {
            for part in 1..=6 {
                let of = f / f64::from(part);
                // Anything is a multiple of a frequency that is small enough.
                if of < 40.0 * step_hz {
                    continue;
                }
                let fit = frequencies
                    .iter()
                    .filter(|f| (**f - (**f / of).round() * of).abs() < 2.0 * step_hz && **f > 0.9 * of)
                    .count();
                // Among many lines some are multiples of anything; one of them was chosen to be.
                let chance = (4.0 * step_hz / of).min(1.0) * (frequencies.len() - 1) as f64;
                let told = surprise((fit.max(1) - 1) as f64, chance);
                let believed = told > ((6 * frequencies.len()) as f64 / BY_LUCK).ln();
                if fit >= ENOUGH && believed && best.is_none_or(|(t, b)| told > t || told == t && of > b) {
                    best = Some((told, of));
                }
            }
        }
        best.map(|b| b.1)
    });
    let Some(of_hz) = of_hz.filter(|f| *f > 0.0) else {
        return;
    };
    for line in lines {
        if let Some(k) = multiple(line.frequency_hz, of_hz) {
            (line.multiple, line.of_hz) = (Some(k), Some(of_hz));
        }
    }
}

/// Spectra of whole channels, for envelopes of bands.
pub(super) struct Spectra {
    by_channel: Vec<Vec<Complex64>>,
    step_hz: f64,
}

impl Spectra {
    pub fn new(channels: &[Vec<f64>], rate_hz: f64) -> Spectra {
        Spectra {
            by_channel: channels.par_iter().map(|c| spectrum(&mut c.clone())).collect(),
            step_hz: rate_hz / channels.first().map_or(1, Vec::len).max(1) as f64,
        }
    }

    /// E|a|⁴/(E|a|²)² of the envelope a of a band of one channel, and the number of independent values behind it.
    fn envelope(&self, channel: usize, band_hz: [f64; 2]) -> Option<(f64, f64)> {
        let spectrum = &self.by_channel[channel];
        let at = |f: f64| ((f / self.step_hz).round().max(1.0) as usize).min(spectrum.len());
        let mut inside = spectrum[at(band_hz[0])..at(band_hz[1])].to_vec();
        if inside.len() < 32 {
            return None;
        }
        let powers = || inside.iter().map(|z| z.norm_sqr());
        let (sum, squares) = (powers().sum::<f64>(), powers().map(|p| p * p).sum::<f64>());
        // Powers of random lines are exponential, with twice the mean square of their expectation.
        let independent = 2.0 * sum * sum / squares;
        envelope_in_place(&mut inside);
        let whole = constancy(&inside, independent, 1)?;
        // A tool that cuts for a part of the record only: the level of its lines comes and goes, which makes the kurtosis of a
        // sine that of random motion. Within a stretch it does not.
        let by_stretches = constancy(&inside, independent, (independent / STRETCH) as usize)?;
        let sureness = |(kurtosis, count): (f64, f64)| (2.0 - kurtosis) * count.sqrt();
        Some(if sureness(by_stretches) > sureness(whole) {
            by_stretches
        } else {
            whole
        })
    }
}

/// Kurtosis of an envelope with so many independent values, stretch by stretch, weighted with the power of each; and how many
/// independent values that weighs.
fn constancy(envelope: &[Complex64], independent: f64, stretches: usize) -> Option<(f64, f64)> {
    let stretches = stretches.max(1);
    let of_each = independent / stretches as f64;
    let length = envelope.len().div_ceil(stretches).max(1);
    let (mut sum, mut weights, mut squares) = (0.0, 0.0, 0.0);
    for stretch in envelope.chunks(length) {
        let n = stretch.len() as f64;
        let second = stretch.iter().map(|z| z.norm_sqr()).sum::<f64>() / n;
        let fourth = stretch.iter().map(|z| z.norm_sqr().powi(2)).sum::<f64>() / n;
        if second > 0.0 {
            let weight = second * n;
            sum += weight * fourth / (second * second);
            weights += weight;
            squares += weight * weight;
        }
    }
    // The mean square of few values scatters, so that the quotient is too small by m/(m + 1) (powers of random motion are
    // exponential).
    let unbiased = if stretches == 1 { 1.0 } else { 1.0 + 1.0 / of_each };
    let share = weights * weights / (stretches as f64 * squares);
    (weights > 0.0).then(|| (unbiased * sum / weights, independent * share.min(1.0)))
}

fn envelope_in_place(lines: &mut Vec<Complex64>) {
    // A complex transform by two real ones: x = Re, y = Im.
    let n = lines.len() & !1;
    lines.truncate(n);
    let mut re: Vec<f64> = lines.iter().map(|z| z.re).collect();
    let mut im: Vec<f64> = lines.iter().map(|z| z.im).collect();
    let (a, b) = (spectrum(&mut re), spectrum(&mut im));
    let i = Complex64::I;
    for k in 0..n {
        // Real signals have X(n − k) = conj X(k).
        let full = |x: &[Complex64]| if k < x.len() { x[k] } else { x[n - k].conj() };
        lines[k] = full(&a) + i * full(&b);
    }
}

/// Why a pole is a rotating part's line rather than a mode, if it is.
pub(super) fn is_line(mode: &OperationalMode, lines: &[Harmonic], spectra: &Spectra) -> Option<String> {
    let near = lines.iter().find(|h| {
        let apart = (h.frequency_hz - mode.frequency_hz).abs();
        let width = (3.0 * spectra.step_hz).max(2.0 * mode.frequency_std_hz);
        // What is left of a line taken out is narrow; a mode that it lies on is not.
        apart < width && mode.damping_ratio * mode.frequency_hz < 8.0 * spectra.step_hz
    });
    if let Some(line) = near {
        return Some(format!("what is left of the line at {}", line.describe()));
    }
    let half_width = (4.0 * mode.damping_ratio).max(0.01) * mode.frequency_hz;
    let band_hz = [mode.frequency_hz - half_width, mode.frequency_hz + half_width];
    let strongest = mode
        .shape
        .iter()
        .enumerate()
        .max_by(|a, b| a.1.norm().total_cmp(&b.1.norm()))?
        .0;
    let (kurtosis, independent) = spectra.envelope(strongest, band_hz)?;
    let significance = (2.0 - kurtosis) / (2.0 / independent.sqrt());
    (kurtosis < CONSTANT && significance > SURE).then(|| {
        format!(
            "its envelope is constant (kurtosis {kurtosis:.2}; random motion 2, a sine 1): a rotating part whose speed wavers"
        )
    })
}

/// Why a mode may be a rotating part whose speed wavers, where nothing proves it.
pub(super) fn doubt(mode: &OperationalMode, lines: &[Harmonic], spindle_rpm: Option<f64>) -> Option<String> {
    let speed_hz = spindle_rpm
        .map(|rpm| rpm / 60.0)
        .or_else(|| lines.iter().find_map(|line| line.of_hz))
        .filter(|f| *f > 0.0);
    let percent = 100.0 * mode.damping_ratio;
    if let Some(speed_hz) = speed_hz {
        let multiple = (mode.frequency_hz / speed_hz).round();
        let near = (mode.frequency_hz - multiple * speed_hz).abs() < SLIP * mode.frequency_hz;
        // Beyond, all frequencies are near a multiple.
        let tells = multiple >= 1.0 && multiple * SLIP < 0.15;
        if near && tells && mode.damping_ratio < NARROW {
            return Some(format!(
                "near {multiple} × {speed_hz:.2} Hz and narrow (damping {percent:.2} %): it may be the spindle, whose speed wavers or \
                 falls in the cut"
            ));
        }
    }
    (!lines.is_empty() && mode.damping_ratio < VERY_NARROW).then(|| {
        format!(
            "narrower than structures are (damping {percent:.3} %) in a record in which something turns: it may be a rotating part \
             whose speed wavers; a record at another speed tells"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn noise(n: usize, seed: u64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..n).map(|_| super::super::tests::gauss(&mut random)).collect()
    }

    #[test]
    fn white_noise_holds_no_line() {
        let found: usize = (0..60)
            .map(|seed| {
                let mut channels = [noise(4096, seed), noise(4096, 1000 + seed)];
                take_out(&mut channels, 100.0, [0.0, 40.0], None).len()
            })
            .sum();
        assert!(found <= 1, "{found} lines in 60 records");
    }

    /// Random motion of a mode whose half-power band is two lines of the record wide is no line; a sine of the same height is.
    #[test]
    fn a_mode_as_narrow_as_two_lines_is_no_rotating_part() {
        let (rate_hz, f_hz, count) = (20.0, 1.43, 4096);
        // A sample's decay where 2ζf is two lines.
        let decay = TAU / count as f64;
        let (mut modes, mut sines) = (0, 0);
        for seed in 0..40 {
            let (drive, ground) = (noise(3 * count, 100 + seed), noise(count, 300 + seed));
            let turn = Complex64::from_polar((-decay).exp(), TAU * f_hz / rate_hz);
            let mut state = Complex64::ZERO;
            let ringing: Vec<f64> = drive
                .iter()
                .map(|x| {
                    state = turn * state + x;
                    state.re
                })
                .collect();
            let ringing = &ringing[2 * count..];
            let size = (ringing.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
            let found = |own: &dyn Fn(usize) -> f64| {
                let mut channels = [(0..count).map(|k| own(k) + 0.05 * size * ground[k]).collect()];
                !take_out(&mut channels, rate_hz, [0.5, 5.0], None).is_empty()
            };
            modes += usize::from(found(&|k| ringing[k]));
            sines += usize::from(found(&|k| {
                std::f64::consts::SQRT_2 * size * (TAU * f_hz * k as f64 / rate_hz).sin()
            }));
        }
        assert_eq!(sines, 40);
        assert!(modes <= 6, "{modes} of 40");
    }

    #[test]
    fn a_sine_is_found_between_lines_and_taken_out_to_the_noise() {
        let f = 12.34567;
        let mut samples = noise(8192, 3);
        for (k, x) in samples.iter_mut().enumerate() {
            *x += 3.0 * (TAU * f * k as f64 / 100.0 + 0.7).sin();
        }
        let mut channels = [samples];
        let found = take_out(&mut channels, 100.0, [0.0, 40.0], None);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(
            (found[0].frequency_hz - f).abs() < 2e-4,
            "{}",
            found[0].frequency_hz
        );
        let clean = noise(8192, 3);
        let left: f64 = channels[0]
            .iter()
            .zip(&clean)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>()
            / 8192.0;
        // Of 9/2 a few parts in ten thousand may stay.
        assert!(left < 0.005, "{left}");
    }

    #[test]
    fn lines_are_named_by_the_speed_given_or_found() {
        let line = |frequency_hz| Harmonic {
            frequency_hz,
            over_noise: 100.0,
            multiple: None,
            of_hz: None,
        };
        let mut lines: Vec<Harmonic> = [20.0, 40.001, 47.0, 60.0].map(line).to_vec();
        name(&mut lines, None, 0.005);
        let multiples: Vec<Option<u32>> = lines.iter().map(|l| l.multiple).collect();
        assert_eq!(multiples, [Some(1), Some(2), None, Some(3)]);
        let mut lines: Vec<Harmonic> = [30.0, 50.0].map(line).to_vec();
        name(&mut lines, Some(10.0), 0.005);
        assert_eq!(lines[1].describe(), "50.00 Hz (5 × 10.00 Hz)");
        let mut few: Vec<Harmonic> = [30.0, 50.0].map(line).to_vec();
        name(&mut few, None, 0.005);
        assert_eq!(few[0].multiple, None);
        // Of a hundred lines anywhere some are multiples of any speed.
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut many: Vec<Harmonic> = (0..100)
            .map(|_| line(3000.0 * rand::Rng::random::<f64>(&mut random)))
            .collect();
        name(&mut many, None, 0.2);
        assert!(many.iter().all(|l| l.multiple.is_none()));
        // A spindle's twenty among them are still seen.
        many.extend((1..=20).map(|k| line(100.02 * f64::from(k))));
        name(&mut many, None, 0.2);
        let named = many.iter().filter(|l| l.multiple.is_some()).count();
        assert!(
            named >= 20
                && many
                    .last()
                    .is_some_and(|l| l.of_hz.is_some_and(|f| (f - 100.02).abs() < 0.05))
        );
    }

    #[test]
    fn a_narrow_mode_near_a_multiple_of_the_speed_is_doubtful() {
        let mode = |frequency_hz, damping_ratio| OperationalMode {
            frequency_hz,
            damping_ratio,
            frequency_std_hz: 0.1,
            damping_std: 1e-4,
            orders: 10,
            complexity: None,
            shape: vec![Complex64::ONE],
            doubts: Vec::new(),
        };
        let found = doubt(&mode(699.5, 6e-4), &[], Some(7000.0)).unwrap();
        assert!(found.starts_with("near 6 × 116.67 Hz"), "{found}");
        // Wide as a structure's, or between multiples.
        assert_eq!(doubt(&mode(699.5, 0.01), &[], Some(7000.0)), None);
        assert_eq!(doubt(&mode(640.0, 2e-3), &[], Some(7000.0)), None);
        let line = Harmonic {
            frequency_hz: 50.0,
            over_noise: 100.0,
            multiple: None,
            of_hz: None,
        };
        assert!(doubt(&mode(640.0, 5e-4), &[line], None).is_some());
        assert_eq!(doubt(&mode(640.0, 5e-4), &[], None), None);
    }

    /// A tool that cuts for a third of the record: its wavering line is as constant as ever while it is there; random motion
    /// that comes and goes is not.
    #[test]
    fn a_line_that_comes_and_goes_is_constant_while_it_is_there() {
        let n = 65_536;
        let there = |k: usize| if k < n / 3 { 1.0 } else { 0.03 };
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let (mut phase, mut offset) = (0.0, 0.0);
        let line: Vec<f64> = (0..n)
            .map(|k| {
                offset += 0.02 * super::super::tests::gauss(&mut random) - 0.002 * offset;
                phase += TAU * (20.0 + offset) / 100.0;
                there(k) * phase.sin()
            })
            .collect();
        let gated: Vec<f64> = noise(n, 4)
            .iter()
            .enumerate()
            .map(|(k, x)| there(k) * x)
            .collect();
        let spectra = Spectra::new(&[line, gated], 100.0);
        let (line, count) = spectra.envelope(0, [18.0, 22.0]).unwrap();
        assert!(
            line < CONSTANT && (2.0 - line) > SURE * 2.0 / count.sqrt(),
            "{line} {count}"
        );
        let (gated, count) = spectra.envelope(1, [18.0, 22.0]).unwrap();
        assert!((2.0 - gated) < SURE * 2.0 / count.sqrt(), "{gated} {count}");
    }

    #[test]
    fn a_constant_envelope_is_told_from_a_random_one() {
        let n = 16_384;
        let mut random = ChaCha8Rng::seed_from_u64(9);
        let mut phase = 0.0;
        // 20 Hz at 100 Hz, wavering slowly by some tenths of a hertz.
        let mut offset = 0.0;
        let wavering: Vec<f64> = (0..n)
            .map(|_| {
                offset += 0.002 * super::super::tests::gauss(&mut random) - 0.0002 * offset;
                phase += TAU * (20.0 + offset) / 100.0;
                phase.sin()
            })
            .collect();
        let spectra = Spectra::new(&[wavering, noise(n, 4)], 100.0);
        let (sine, _) = spectra.envelope(0, [18.0, 22.0]).unwrap();
        let (random, count) = spectra.envelope(1, [18.0, 22.0]).unwrap();
        assert!(sine < 1.1, "{sine}");
        assert!(
            (random - 2.0).abs() < 4.0 * 2.0 / count.sqrt(),
            "{random} {count}"
        );
    }

    /// Random motion has E|a|⁴ = 2 (E|a|²)² and as many independent values as its band has lines; the envelope of a sine whose speed
    /// wavers is constant.
    #[test]
    fn an_envelope_tells_random_motion_from_a_wavering_sine() {
        let count = 20_000;
        let random = noise(count, 7);
        let mut phase = 0.0;
        let wavering: Vec<f64> = noise(count, 8)
            .iter()
            .map(|x| {
                phase += TAU * (0.15 + 0.004 * x);
                phase.sin()
            })
            .collect();
        let spectra = Spectra::new(&[random, wavering], 1000.0);
        let (kurtosis, independent) = spectra.envelope(0, [100.0, 200.0]).unwrap();
        assert!((kurtosis - 2.0).abs() < 0.2, "{kurtosis}");
        // 100 Hz at 0.05 Hz; stretches count by their powers, whose relative variance is one over the values in each.
        let expected = 2000.0 / (1.0 + 1.0 / STRETCH);
        assert!(
            (independent / expected - 1.0).abs() < 0.1,
            "{independent} {expected}"
        );
        let (kurtosis, _) = spectra.envelope(1, [100.0, 200.0]).unwrap();
        assert!(kurtosis < 1.1, "{kurtosis}");
        assert_eq!(spectra.envelope(0, [100.0, 101.5]), None);
    }
}
