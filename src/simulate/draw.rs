//! Random numbers of the virtual lab: one independent stream for each purpose, all from one seed, so that changing the
//! noise (say) does not change the postures.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What a stream is drawn for; its number is part of what a seed means, so numbers are never reused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Settings of a campaign's kind.
    Scenario = 0,
    /// True parameters of the robot.
    Robot = 1,
    /// Postures.
    Postures = 2,
    /// Hidden effects of the library.
    Effects = 3,
    /// Noise of the FRFs.
    Noise = 4,
    /// Physics outside the library.
    Foreign = 5,
    /// Departures ([`super::departure`]).
    Departure = 6,
    /// Small errors of setup ([`super::Slip`]).
    Laboratory = 7,
    /// Errors of an FRF that are correlated over frequency.
    ColouredError = 8,
    /// Noise that the outputs of one hit have in common.
    CommonNoise = 9,
    /// Tool, material and cuts of force records.
    Cutting = 10,
    /// What is hidden in force records.
    CuttingEffects = 11,
    /// Noise of force records.
    ForceNoise = 12,
}

/// A stream of random numbers.
pub struct Draws(ChaCha8Rng);

impl Draws {
    /// The stream of a seed for one purpose.
    pub fn new(seed: u64, purpose: Purpose) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(purpose as u64);
        Draws(random)
    }

    /// Uniform from `low` to below `high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Uniform on the logarithm; both ends above zero.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    /// Two independent standard normal numbers (Box and Muller 1958).
    pub fn normal_pair(&mut self) -> (f64, f64) {
        // 1 − u lies in (0, 1]: its logarithm is finite.
        let radius = (-2.0 * (1.0 - self.0.random::<f64>()).ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * self.0.random::<f64>()).sin_cos();
        (radius * cosine, radius * sine)
    }

    /// A standard normal number, redrawn until it is within `limit` of zero.
    pub fn normal_within(&mut self, limit: f64) -> f64 {
        loop {
            let value = self.normal_pair().0;
            if value.abs() <= limit {
                return value;
            }
        }
    }

    /// True with probability `share`.
    pub fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }

    /// One of `items`, which must not be empty.
    pub fn pick<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        &items[self.pick_index(items.len())]
    }

    /// One of 0..`count`, which must not be zero.
    pub fn pick_index(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_reproducible_and_independent() {
        let first = |purpose| Draws::new(7, purpose).uniform(0.0, 1.0);
        assert_eq!(first(Purpose::Noise), first(Purpose::Noise));
        assert_ne!(first(Purpose::Noise), first(Purpose::Postures));
        assert_ne!(
            first(Purpose::Noise),
            Draws::new(8, Purpose::Noise).uniform(0.0, 1.0)
        );
    }

    #[test]
    fn normal_numbers_have_zero_mean_and_unit_variance() {
        let mut draws = Draws::new(1, Purpose::Noise);
        let n = 20_000;
        let (mut sum, mut squares, mut product) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let (a, b) = draws.normal_pair();
            sum += a + b;
            squares += a * a + b * b;
            product += a * b;
        }
        let n = f64::from(n);
        assert!((sum / (2.0 * n)).abs() < 0.02);
        assert!((squares / (2.0 * n) - 1.0).abs() < 0.03);
        assert!((product / n).abs() < 0.03);
    }
}
