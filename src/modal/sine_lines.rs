//! Lines without a shape: hum of the mains, a running spindle. A sine in the record stands on one line of the FRF (and on
//! those that the window spreads it to); a resonance, however lightly damped, has flanks that fall with the distance.

use num_complex::Complex64;
use serde::Serialize;

/// Lines on either side that a window spreads a sine to.
const SPREAD: usize = 2;
/// Lines on either side that the flanks are read from, beyond those.
const FLANK: usize = 6;
/// A line must stand out of its neighbours this far in half of the FRFs, in standard deviations.
const STANDS_OUT: f64 = 6.0;
/// The flanks of a resonance are at least this part of its peak, a line away. (Those of a sine between two lines, through a
/// Hann window, are 0.012.)
const FLANK_OF_PEAK: f64 = 0.015;
/// … and in the same proportion to it in all FRFs: the common denominator. (Squared coherence; a sine has phases of its own.)
const IN_PROPORTION: f64 = 0.5;
/// Where half of the FRFs show flanks by themselves, so many standard deviations high and at least this part of the peak, it is a
/// resonance too: one that moves from FRF to FRF (a roving sensor's mass, a warming structure) has no common proportion.
const OWN_FLANKS: f64 = 5.0;
const OWN_FLANK_OF_PEAK: f64 = 0.1;
/// FRFs that sines are looked for in, at most.
const ENOUGH_FRFS: usize = 40;
/// Mains frequencies, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// A sine among the responses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SineLine {
    /// Frequency of the sine, Hz.
    pub frequency_hz: f64,
    /// Lowest and highest line that it spoils.
    pub spoils_hz: [f64; 2],
    /// What it may be.
    pub what: String,
}

/// Sines in FRFs measured together, on common even lines; empty where lines differ or are uneven.
pub fn sine_lines(frequency_hz: &[f64], frfs: &[&[Complex64]]) -> Vec<SineLine> {
    let reach = SPREAD + FLANK;
    let lines = frequency_hz.len();
    if frfs.is_empty() || lines < 4 * reach || frfs.iter().any(|h| h.len() != lines) {
        return Vec::new();
    }
    let step = (frequency_hz[lines - 1] - frequency_hz[0]) / (lines - 1) as f64;
    let even = frequency_hz
        .windows(2)
        .all(|w| ((w[1] - w[0]) / step - 1.0).abs() < 1e-3);
    let Some(flanks) = Flanks::new().filter(|_| even) else {
        return Vec::new();
    };
    // What half of the FRFs show, some of them show too.
    let count = frfs.len().min(ENOUGH_FRFS);
    let some: Vec<&[Complex64]> = (0..count).map(|k| frfs[k * frfs.len() / count]).collect();
    let frfs = &some[..];
    let mut found: Vec<SineLine> = Vec::new();
    let mut k = reach;
    while k + reach < lines {
        if let Some([low, high]) = flanks.sine_at(k, frfs) {
            let f = frequency_hz[k];
            found.push(SineLine {
                frequency_hz: f,
                spoils_hz: [frequency_hz[low], frequency_hz[high]],
                what: what(f, step),
            });
            k = high + 1;
        } else {
            k += 1;
        }
    }
    found
}

/// The lines that no sine spoils.
pub fn without_sines(
    frequency_hz: &[f64],
    receptance_m_per_n: &[Complex64],
    sines: &[SineLine],
) -> (Vec<f64>, Vec<Complex64>) {
    let spoilt = |f: f64| {
        sines
            .iter()
            .any(|s| (s.spoils_hz[0]..=s.spoils_hz[1]).contains(&f))
    };
    frequency_hz
        .iter()
        .zip(receptance_m_per_n)
        .filter(|(f, _)| !spoilt(**f))
        .map(|(f, h)| (*f, *h))
        .unzip()
}

fn what(frequency_hz: f64, step_hz: f64) -> String {
    mains(frequency_hz, step_hz).unwrap_or_else(|| "a sine: something that runs nearby".into())
}

/// The mains, or the multiple of theirs, that lies within `step_hz` of a frequency (Hz), in words.
fn mains(frequency_hz: f64, step_hz: f64) -> Option<String> {
    MAINS_HZ.into_iter().find_map(|mains| {
        let harmonic = (frequency_hz / mains).round();
        let is_near = (1.0..=20.0).contains(&harmonic) && (frequency_hz - harmonic * mains).abs() <= step_hz;
        is_near.then(|| match harmonic as usize {
            1 => format!("mains hum of {mains:.0} Hz"),
            n => format!("harmonic {n} of the {mains:.0} Hz mains"),
        })
    })
}

/// The hum that a mode is, in words: at a multiple of the mains, and so little damped that it would go on through the whole record as a
/// sine does. A window that dies away broadens a sine's line, which then looks like a mode. `step_hz`: between lines, Hz.
pub fn undamped_hum(frequency_hz: f64, damping_ratio: f64, step_hz: f64) -> Option<String> {
    /// Of the distance between lines, which is one over the record's length.
    const UNDAMPED: f64 = 0.1;
    let goes_on = damping_ratio * frequency_hz < UNDAMPED * step_hz;
    goes_on.then(|| mains(frequency_hz, 0.5 * step_hz)).flatten()
}

/// Least squares of constant, slope, curvature and a resonance 1/x on the lines ±(SPREAD + 1 … SPREAD + FLANK) around a
/// line: real weights of the lines.
struct Flanks {
    positions: Vec<f64>,
    /// By unknown, then line.
    solve: Vec<Vec<f64>>,
    /// Variance of the constant and of the 1/x term for unit noise.
    variance: [f64; 2],
}

impl Flanks {
    fn new() -> Option<Flanks> {
        let positions: Vec<f64> = (SPREAD + 1..=SPREAD + FLANK)
            .flat_map(|k| [-(k as f64), k as f64])
            .collect();
        let basis = nalgebra::DMatrix::from_fn(positions.len(), 4, |line, term| {
            let x = positions[line];
            [1.0, x, x * x, 1.0 / x][term]
        });
        let inverse = (basis.transpose() * &basis).try_inverse()?;
        let solve = &inverse * basis.transpose();
        Some(Flanks {
            solve: (0..4).map(|t| solve.row(t).iter().copied().collect()).collect(),
            variance: [inverse[(0, 0)], inverse[(3, 3)]],
            positions,
        })
    }

    /// First and last line that a sine on line `k` spoils.
    fn sine_at(&self, k: usize, frfs: &[&[Complex64]]) -> Option<[usize; 2]> {
        let mut stands_out = vec![Vec::new(); 2 * SPREAD + 1];
        let (mut peak, mut flank, mut flank_noise) = (0.0, 0.0, 0.0);
        let mut both = Complex64::ZERO;
        let (mut own_flanks, mut own_shares) = (Vec::new(), Vec::new());
        for h in frfs {
            let value = |x: f64| h[(k as f64 + x) as usize];
            let term = |t: usize| -> Complex64 {
                self.positions
                    .iter()
                    .zip(&self.solve[t])
                    .map(|(x, w)| value(*x) * w)
                    .sum()
            };
            let [constant, slope, curvature, resonance] = [term(0), term(1), term(2), term(3)];
            let smooth = |x: f64| constant + slope * x + curvature * (x * x);
            let left: f64 = self
                .positions
                .iter()
                .map(|x| (value(*x) - smooth(*x) - resonance / x).norm_sqr())
                .sum();
            let variance = left / (self.positions.len() - 4) as f64;
            if !(variance.is_finite() && variance > 0.0) {
                continue;
            }
            let size = variance * (1.0 + self.variance[0]);
            for (n, out) in stands_out.iter_mut().enumerate() {
                let x = n as f64 - SPREAD as f64;
                out.push((value(x) - smooth(x)).norm_sqr() / size);
            }
            // Each FRF counts by what it shows over its own noise.
            peak += (value(0.0) - constant).norm_sqr() / variance;
            flank += resonance.norm_sqr() / variance;
            both += resonance.conj() * (value(0.0) - constant) / variance;
            flank_noise += self.variance[1];
            own_flanks.push((resonance.norm_sqr() / (variance * self.variance[1])).sqrt());
            own_shares.push(resonance.norm() / (value(0.0) - constant).norm().max(f64::MIN_POSITIVE));
        }
        let middles: Vec<f64> = stands_out
            .iter()
            .map(|s| {
                if s.is_empty() {
                    0.0
                } else {
                    crate::signal::median(s)
                }
            })
            .collect();
        let highest = middles.iter().copied().fold(0.0, f64::max);
        let out = STANDS_OUT * STANDS_OUT;
        if middles[SPREAD] < out || middles[SPREAD] < highest {
            return None;
        }
        let flanks = flank > FLANK_OF_PEAK * FLANK_OF_PEAK * peak + 1.5 * flank_noise;
        if flanks && both.norm_sqr() > IN_PROPORTION * flank * peak {
            return None;
        }
        if crate::signal::median(&own_flanks) > OWN_FLANKS
            && crate::signal::median(&own_shares) > OWN_FLANK_OF_PEAK
        {
            return None;
        }
        let mut low = k;
        let mut high = k;
        while low > k - SPREAD && middles[low - 1 + SPREAD - k] > 4.0 {
            low -= 1;
        }
        while high < k + SPREAD && middles[high + 1 + SPREAD - k] > 4.0 {
            high += 1;
        }
        Some([low, high])
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Synthetic, SyntheticMode};
    use super::*;

    #[test]
    fn a_pole_at_the_mains_that_never_dies_away_is_hum() {
        assert_eq!(
            undamped_hum(50.02, 1e-4, 0.25).as_deref(),
            Some("mains hum of 50 Hz")
        );
        assert_eq!(
            undamped_hum(180.1, -1e-5, 0.25).as_deref(),
            Some("harmonic 3 of the 60 Hz mains")
        );
        assert_eq!(undamped_hum(50.02, 1e-3, 0.25), None);
        assert_eq!(undamped_hum(50.2, 1e-4, 0.25), None);
    }

    fn found(modes: &[SyntheticMode], hum: f64) -> Vec<SineLine> {
        let mut frequency = Vec::new();
        let frfs: Vec<Vec<Complex64>> = (0..6)
            .map(|k| {
                let (f, mut h) = Synthetic::new(5.0, 200.0, 0.5, modes)
                    .with_noise(0.0, 0.01, k)
                    .frf();
                let at = f.iter().position(|f| *f == 100.0).unwrap();
                let size = hum * h[at].norm();
                for (line, share) in [(at - 1, -0.5), (at, 1.0), (at + 1, -0.5)] {
                    h[line] += Complex64::from_polar(size * share, k as f64);
                }
                frequency = f;
                h
            })
            .collect();
        sine_lines(&frequency, &frfs.iter().map(|h| h.as_slice()).collect::<Vec<_>>())
    }

    #[test]
    fn hum_is_found_and_named() {
        let found = found(
            &[
                SyntheticMode::new(60.0, 0.01, 1.0),
                SyntheticMode::new(130.0, 0.01, 1.0),
            ],
            20.0,
        );
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].frequency_hz, 100.0);
        assert!(found[0].spoils_hz[0] <= 99.5 && found[0].spoils_hz[1] >= 100.5);
        assert_eq!(found[0].what, "harmonic 2 of the 50 Hz mains");
    }

    /// A sensor that is moved from place to place moves a light structure's frequencies with it.
    #[test]
    fn a_narrow_resonance_that_moves_from_frf_to_frf_is_none() {
        for size in [0.15, 0.4] {
            let mut frequency = Vec::new();
            let frfs: Vec<Vec<Complex64>> = (0..10)
                .map(|k| {
                    let f0 = 100.1 + size * (f64::from(k) * 2.4).sin();
                    let modes = [
                        SyntheticMode::new(60.0, 0.01, 1.0),
                        SyntheticMode::new(f0, 5e-4, 1.0),
                    ];
                    let (f, h) = Synthetic::new(5.0, 200.0, 0.5, &modes)
                        .with_noise(0.0, 0.01, k as u64)
                        .frf();
                    frequency = f;
                    h
                })
                .collect();
            let found = sine_lines(&frequency, &frfs.iter().map(|h| h.as_slice()).collect::<Vec<_>>());
            assert!(found.is_empty(), "{size}: {found:?}");
        }
    }

    /// Also where its half-power band is a small part of a line.
    #[test]
    fn a_resonance_narrower_than_a_line_is_none() {
        for f0 in [100.0, 100.1, 100.25] {
            for damping in [1e-4, 1e-3, 5e-3] {
                let found = found(
                    &[
                        SyntheticMode::new(60.0, 0.01, 1.0),
                        SyntheticMode::new(f0, damping, 1.0),
                    ],
                    0.0,
                );
                assert!(found.is_empty(), "{f0} Hz, {damping}: {found:?}");
            }
        }
    }

    /// Hum no larger than the FRF itself, on the flank of a resonance, where a straight line through the neighbours is far off; it
    /// leaks upwards only, as a sine between two lines does.
    #[test]
    fn hum_on_a_steep_flank_is_found_with_the_lines_it_spoils() {
        let mut frequency = Vec::new();
        let frfs: Vec<Vec<Complex64>> = (0..6)
            .map(|k| {
                let modes = [
                    SyntheticMode::new(60.0, 0.01, 1.0),
                    SyntheticMode::new(108.0, 0.01, 1.0),
                ];
                let (f, mut h) = Synthetic::new(5.0, 200.0, 0.5, &modes)
                    .with_noise(0.0, 0.01, k)
                    .frf();
                let at = f.iter().position(|f| *f == 100.0).unwrap();
                let size = h[at].norm();
                for (line, share) in [(at, 1.0), (at + 1, 0.8)] {
                    h[line] += Complex64::from_polar(size * share, k as f64);
                }
                frequency = f;
                h
            })
            .collect();
        let found = sine_lines(&frequency, &frfs.iter().map(|h| h.as_slice()).collect::<Vec<_>>());
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0].frequency_hz, 100.0);
        assert!(
            found[0].spoils_hz[0] <= 100.0 && found[0].spoils_hz[0] > 99.0,
            "{found:?}"
        );
        assert!(
            found[0].spoils_hz[1] >= 100.5 && found[0].spoils_hz[1] < 101.5,
            "{found:?}"
        );
    }
}
