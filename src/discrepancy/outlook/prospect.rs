//! What a measurement that was not made yet would say: the misfit that a wrong explanation would be left with after it
//! has taken in what it can.
//!
//! A rival with parameters θ is off by d (weighted by the noise) on the new values, d ≈ d₀ − J δ; the data that are there
//! hold δ with their information I. What is left at the best δ, d₀ᵀd₀ − gᵀ (I + JᵀJ)⁻¹ g with g = Jᵀd₀, is the expected
//! growth of Σ r²/σ² (Atkinson, Donev, Tobias 2007: Optimum Experimental Designs, with SAS, ch. 20: T-optimality).

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::identify::frfs::sensitivity::PredictedFrf;

/// Sums over weighted real values: what a rival explanation is off by, and how far its parameters reach.
#[derive(Debug, Clone, PartialEq)]
pub struct Prospect {
    /// d₀ᵀ d₀ = 2 Σ|ΔH|²/σ².
    square: f64,
    /// Jᵀ d₀.
    gradient: DVector<f64>,
    /// JᵀJ.
    information: DMatrix<f64>,
}

impl Prospect {
    /// Nothing measured, for a rival with `parameters` parameters.
    pub fn nothing(parameters: usize) -> Self {
        Prospect {
            square: 0.0,
            gradient: DVector::zeros(parameters),
            information: DMatrix::zeros(parameters, parameters),
        }
    }

    /// One FRF: `truth` as it would be measured with noise `noise_std` (complex standard deviation, m/N, > 0), the rival's
    /// prediction with its slopes. Each line counts `times` times.
    pub fn of_frf(truth: &[Complex64], noise_std: &[f64], rival: &PredictedFrf, times: f64) -> Self {
        let count = rival.slopes(0).len();
        let mut sum = Self::nothing(count);
        let mut row = vec![0.0; count];
        for (k, ((h, std), model)) in truth.iter().zip(noise_std).zip(&rival.receptance).enumerate() {
            // Each of the two parts has half the variance.
            let weight = (2.0 * times).sqrt() / std;
            let difference = (h - model) * weight;
            let slopes = rival.slopes(k);
            for part in [|z: Complex64| z.re, |z: Complex64| z.im] {
                let d = part(difference);
                sum.square += d * d;
                for (value, slope) in row.iter_mut().zip(slopes) {
                    *value = part(*slope) * weight;
                }
                for (i, a) in row.iter().enumerate() {
                    sum.gradient[i] += a * d;
                    // The lower triangle; the other one is its mirror image.
                    for (j, b) in row[..=i].iter().enumerate() {
                        sum.information[(i, j)] += a * b;
                    }
                }
            }
        }
        for i in 0..count {
            for j in 0..i {
                sum.information[(j, i)] = sum.information[(i, j)];
            }
        }
        sum
    }

    /// Adds what another measurement says.
    pub fn add(&mut self, other: &Prospect) {
        self.square += other.square;
        self.gradient += &other.gradient;
        self.information += &other.information;
    }

    /// The same, every value measured `times` times.
    pub fn repeated(&self, times: f64) -> Prospect {
        Prospect {
            square: self.square * times,
            gradient: &self.gradient * times,
            information: &self.information * times,
        }
    }

    /// Expected growth of the rival's Σ r²/σ² where `present` (parameters × parameters, priors included) is what its
    /// parameters are known to already. Zero where the present information is no positive definite matrix.
    pub fn growth(&self, present: &DMatrix<f64>) -> f64 {
        let together = present + &self.information;
        match together.cholesky() {
            Some(cholesky) => {
                let taken = self.gradient.dot(&cholesky.solve(&self.gradient));
                (self.square - taken).clamp(0.0, self.square)
            }
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn frf(receptance: Vec<Complex64>) -> PredictedFrf {
        PredictedFrf::for_test(
            receptance.clone(),
            vec![Complex64::new(1.0, 0.0); receptance.len()],
        )
    }

    /// One parameter that shifts all lines alike: of a difference that is alike on all lines the share
    /// I/(I + J'J) is left; one that changes sign from line to line is left whole.
    #[test]
    fn a_rival_takes_in_what_its_parameter_can_reach_and_the_present_data_allow() {
        let zero = vec![Complex64::ZERO; 4];
        let noise = [2.0; 4];
        let real = |v: [f64; 4]| v.map(|x| Complex64::new(x, 0.0)).to_vec();
        let alike = Prospect::of_frf(&real([3.0; 4]), &noise, &frf(zero.clone()), 1.0);
        // 2 Σ|ΔH|²/σ² = 2 · 4 · 9/4; J'J = 2 · 4/4.
        assert_relative_eq!(alike.square, 18.0, max_relative = 1e-12);
        let held = |i: f64| alike.growth(&DMatrix::from_element(1, 1, i));
        assert_relative_eq!(held(6.0), 18.0 * 6.0 / 8.0, max_relative = 1e-12);
        assert_relative_eq!(held(1e12), 18.0, max_relative = 1e-9);
        assert!(held(1e-12) < 1e-9);
        let wavy = Prospect::of_frf(&real([3.0, -3.0, 3.0, -3.0]), &noise, &frf(zero.clone()), 1.0);
        assert_relative_eq!(
            wavy.growth(&DMatrix::from_element(1, 1, 1e-12)),
            18.0,
            max_relative = 1e-12
        );
        let thrice = Prospect::of_frf(&real([3.0; 4]), &noise, &frf(zero), 3.0);
        assert_relative_eq!(
            thrice.growth(&DMatrix::from_element(1, 1, 6.0)),
            alike.repeated(3.0).growth(&DMatrix::from_element(1, 1, 6.0)),
            max_relative = 1e-12
        );
        // A rival that predicts what is there has nothing to lose.
        let same = real([3.0; 4]);
        assert_eq!(
            Prospect::of_frf(&same, &noise, &frf(same.clone()), 1.0).square,
            0.0
        );
        let mut both = alike.clone();
        both.add(&wavy);
        assert_relative_eq!(both.square, 36.0, max_relative = 1e-12);
    }
}
