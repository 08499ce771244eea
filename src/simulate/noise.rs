//! Noise of simulated FRFs: how large, how alike on neighbouring lines, how alike in the outputs of one hit.

use num_complex::Complex64;
use serde::Serialize;

use super::draw::Draws;

/// How the noise of neighbouring lines belongs together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum LineNoise {
    /// Every line on its own.
    #[default]
    White,
    /// As a Hann window leaves it: correlated with the two neighbours on each side.
    Hann,
    /// As zero padding to twice the length leaves it: half as many independent values as lines.
    ZeroPadded,
}

/// Independent standard normal real and imaginary parts.
fn white(lines: usize, draws: &mut Draws) -> Vec<Complex64> {
    (0..lines)
        .map(|_| {
            let (re, im) = draws.normal_pair();
            Complex64::new(re, im)
        })
        .collect()
}

impl LineNoise {
    /// One value a line, real and imaginary part of variance 1. The draws are the same for all kinds.
    pub fn draw(self, lines: usize, draws: &mut Draws) -> Vec<Complex64> {
        let white = white(lines, draws);
        match self {
            LineNoise::White => white,
            LineNoise::Hann => {
                // Weights −1/4, 1/2, −1/4, whose squares add up to 3/8. The ends meet.
                let scale = (3.0_f64 / 8.0).sqrt().recip();
                let at = |k: usize| white[k % lines];
                (0..lines)
                    .map(|k| (at(k) * 0.5 - (at(k + lines - 1) + at(k + 1)) * 0.25) * scale)
                    .collect()
            }
            LineNoise::ZeroPadded => padded(&white),
        }
    }
}

/// Spectrum of a record whose second half is zeros: the white values as time samples, half of them kept.
fn padded(white: &[Complex64]) -> Vec<Complex64> {
    let n = white.len();
    let kept = n.div_ceil(2);
    let turns: Vec<Complex64> = (0..n)
        .map(|k| Complex64::from_polar(1.0, -std::f64::consts::TAU * k as f64 / n as f64))
        .collect();
    let scale = (kept as f64).sqrt().recip();
    (0..n)
        .map(|k| {
            let sum: Complex64 = (0..kept).map(|t| white[t] * turns[k * t % n]).sum();
            sum * scale
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::draw::Purpose;

    /// Mean of n*_k n_{k+lag} over many lines and draws.
    fn correlation(kind: LineNoise, lag: usize) -> Complex64 {
        let mut draws = Draws::new(3, Purpose::Noise);
        let (lines, times) = (256, 60);
        let mut sum = Complex64::ZERO;
        for _ in 0..times {
            let n = kind.draw(lines, &mut draws);
            sum += (0..lines - lag)
                .map(|k| n[k].conj() * n[k + lag])
                .sum::<Complex64>()
                / (lines - lag) as f64;
        }
        sum / (2.0 * times as f64)
    }

    /// Closed forms: a Hann window correlates neighbours by −2/3 and those after them by 1/6; padding to twice the
    /// length by |sinc(lag / 2)| (exactly 1/(n/2)·|Σ e^{…}| here).
    #[test]
    fn lines_are_as_alike_as_the_window_makes_them() {
        for kind in [LineNoise::White, LineNoise::Hann, LineNoise::ZeroPadded] {
            assert!((correlation(kind, 0) - 1.0).norm() < 0.03, "{kind:?}");
        }
        assert!(correlation(LineNoise::White, 1).norm() < 0.03);
        assert!((correlation(LineNoise::Hann, 1) + 2.0 / 3.0).norm() < 0.03);
        assert!((correlation(LineNoise::Hann, 2) - 1.0 / 6.0).norm() < 0.03);
        assert!(correlation(LineNoise::Hann, 3).norm() < 0.03);
        let sinc = 2.0 / std::f64::consts::PI;
        assert!((correlation(LineNoise::ZeroPadded, 1).norm() - sinc).abs() < 0.03);
        assert!(correlation(LineNoise::ZeroPadded, 2).norm() < 0.04);
    }
}
