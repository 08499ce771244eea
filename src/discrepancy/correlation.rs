//! How many neighbouring lines say the same: model error is smooth over frequency, noise is not.

use num_complex::Complex64;

use crate::identify::FrfData;

/// Correlations below this are noise of the estimate.
const NEGLIGIBLE: f64 = 0.1;

/// Integrated correlation length of the weighted residuals over frequency, in lines: 1 + 2 Σ ρ(lag) over the lags up to
/// the first negligible one, all FRFs together. So many lines count as one; 1 where the residuals are white.
///
/// `predicted`: in the order of `data.frfs()`, on the same lines.
pub fn lines_together(data: &FrfData, predicted: &[Vec<Complex64>]) -> f64 {
    let residuals: Vec<Vec<Complex64>> = data
        .frfs()
        .zip(predicted)
        .map(|((_, frf), model)| {
            let lines = frf.receptance.iter().zip(model).zip(&frf.noise_std);
            lines.map(|((h, m), std)| (m - h) / *std).collect()
        })
        .collect();
    correlation_length(&residuals)
}

fn correlation_length(series: &[Vec<Complex64>]) -> f64 {
    let at_lag = |lag: usize| -> f64 {
        let products = series.iter().flat_map(|s| {
            let later = s.iter().skip(lag);
            s.iter().zip(later).map(|(a, b)| (a * b.conj()).re)
        });
        products.sum()
    };
    let power = at_lag(0);
    let longest = series.iter().map(Vec::len).max().unwrap_or(0) / 4;
    if !(power > 0.0) {
        return 1.0;
    }
    let correlations = (1..longest).map(|lag| at_lag(lag) / power);
    1.0 + 2.0 * correlations.take_while(|rho| *rho > NEGLIGIBLE).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    /// First-order autoregression: ρ(lag) = aˡᵃᵍ, 1 + 2 Σ = (1 + a)/(1 − a).
    fn series(a: f64) -> Vec<Vec<Complex64>> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        (0..8)
            .map(|_| {
                let mut last = Complex64::ZERO;
                let mut next = || {
                    let noise =
                        Complex64::new(random.random_range(-1.0..1.0), random.random_range(-1.0..1.0));
                    last = last * a + noise * (1.0 - a * a).sqrt();
                    last
                };
                (0..400).map(|_| next()).collect()
            })
            .collect()
    }

    #[test]
    fn white_residuals_count_line_by_line_and_smooth_ones_do_not() {
        assert!((correlation_length(&series(0.0)) - 1.0).abs() < 1e-12);
        let length = correlation_length(&series(0.8));
        assert!((7.0..10.0).contains(&length), "{length}");
        assert_eq!(correlation_length(&[]), 1.0);
    }
}
