//! Maximum-likelihood refinement of common poles: all FRFs of a set at once, weighted with their noise.
//!
//! Model of the receptance of FRF m: `H_m = Σ_r (a_mr ω_r² + b_mr iω ω_r) / (ω_r² − ω² + 2iζ_r ω_r ω)` with real a, b
//! (any viscously damped mode, complex shapes included), lower residual terms 1/ω², i/ω³, 1/ω⁴ and upper ones
//! 1, iω, ω² for the modes outside the band. Given the poles, a, b and the residual terms enter linearly and are projected out
//! (variable projection: Golub & Pereyra 1973, Kaufman's 1975 Jacobian); the poles are found by Levenberg–Marquardt.
//! With Gaussian noise of known variance this is the maximum-likelihood estimate, and the inverse of the normal
//! matrix its covariance (Cramér–Rao).

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Matrix2};
use num_complex::Complex64;
use rayon::prelude::*;

use crate::modal::max_likelihood::alike::{Alike, AlikeLinear};
use crate::modal::max_likelihood::ml_linear::{
    FrfSolution, NoisyFrf, PoleColumns, RESIDUAL_TERMS, Solved, SolvedFrf, centre_hz, linearise_one, product,
    residual_terms, weigh, weights,
};
use crate::modal::shape;
use crate::modal::single::local_fit::Pole;
use crate::stop;

const MAX_ITERATIONS: usize = 30;
const MIN_DAMPING: f64 = 1e-7;
/// A fall of the misfit below this part of itself is rounding.
const RELATIVELY_SETTLED: f64 = 1e-9;
/// Fall of the misfit that is worth no further step: a hundredth of a standard deviation.
pub(crate) const SETTLED: f64 = 1e-4;

/// The refined poles with what the fit says of them.
pub(crate) struct Solution {
    pub poles: Vec<Pole>,
    /// By FRF.
    pub frfs: Vec<FrfSolution>,
    /// Σ |e|²/(σ²/2): twice the negative log-likelihood.
    pub misfit: f64,
    pub degrees_of_freedom: usize,
    /// Of (ln f₁, ln ζ₁, ln f₂, …) for the noise as given.
    pub covariance: DMatrix<f64>,
    /// By FRF, how far it pulls the poles: the covariance times its part of the gradient. They add up to nothing.
    influence: Vec<DVector<f64>>,
    pub converged: bool,
    fixed: Vec<Pole>,
    centre_hz: f64,
}

/// A standard deviation from a scatter, relative, and the factor by which twice that holds 95 % for as many parts as there
/// are in effect (Student's t with 1/Σh² − 1 degrees of freedom).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Jackknife {
    pub std: f64,
    pub few: f64,
}

impl Solution {
    pub fn frequency_std_hz(&self, mode: usize) -> f64 {
        self.covariance[(2 * mode, 2 * mode)].max(0.0).sqrt() * self.poles[mode].frequency_hz
    }

    pub fn damping_std(&self, mode: usize) -> f64 {
        self.covariance[(2 * mode + 1, 2 * mode + 1)].max(0.0).sqrt() * self.poles[mode].damping_ratio
    }

    /// By how much more than its noise the fit leaves, never less than 1: what standard deviations are widened by.
    pub fn level(&self) -> f64 {
        (self.misfit / self.degrees_of_freedom as f64).max(1.0).sqrt()
    }

    /// The poles that took part without being moved.
    pub fn fixed(&self) -> &[Pole] {
        &self.fixed
    }

    /// Number of FRFs that took part: whose bands reach into the window.
    pub fn taking_part(&self) -> usize {
        self.frfs.iter().filter(|f| f.took_part()).count()
    }

    /// Relative standard deviations of frequency and damping ratio from how the FRFs scatter about the common pole, whatever
    /// their noise is (Liang & Zeger 1986, one cluster an FRF); zero for a single FRF.
    pub fn scatter_std(&self, mode: usize) -> [f64; 2] {
        let count = self.taking_part() as f64;
        if count < 2.0 {
            return [0.0; 2];
        }
        [0, 1].map(|k| {
            let squares: f64 = self.influence.iter().map(|i| i[2 * mode + k].powi(2)).sum();
            (squares * count / (count - 1.0)).sqrt()
        })
    }

    /// As [`Self::scatter_std`], as large as a few FRFs make it that say most of a mode: each left out in turn (an FRF that
    /// makes the share h of what is known pulls the pole so far that only 1 − h of its pull is seen; Bell & McCaffrey 2002).
    /// FRFs that follow one another share errors (one hit, one mounting of the sensor, one hour of the day), so that blocks of
    /// 1, 2, 4 … are left out (Künsch 1989), and the largest counts. Of (ln f, ln ζ).
    pub fn jackknife(&self, mode: usize) -> [Jackknife; 2] {
        /// Fewer blocks say little about a scatter.
        const LEAST_BLOCKS: usize = 8;
        let with_all: Matrix2<f64> = self.frfs.iter().map(|f| f.own[mode].0).sum();
        let part: Vec<usize> = (0..self.frfs.len())
            .filter(|&m| self.frfs[m].took_part())
            .collect();
        let inverse = match with_all.try_inverse() {
            Some(inverse) if part.len() > 1 => inverse,
            _ => return self.scatter_std(mode).map(|std| Jackknife { std, few: 1.0 }),
        };
        let lengths = std::iter::successors(Some(1), |length| Some(2 * length))
            .take_while(|&length| length == 1 || part.len() >= LEAST_BLOCKS * length);
        let mut most = [Jackknife::default(); 2];
        for length in lengths {
            let blocks = self.leave_out(mode, part.chunks(length), &inverse);
            for (most, of_blocks) in most.iter_mut().zip(blocks) {
                if of_blocks.few * of_blocks.std > most.few * most.std {
                    *most = of_blocks;
                }
            }
        }
        most
    }

    /// The jackknife over `blocks` of FRFs; `inverse` of what all know of the pole.
    fn leave_out<'a>(
        &self,
        mode: usize,
        blocks: impl Iterator<Item = &'a [usize]>,
        inverse: &Matrix2<f64>,
    ) -> [Jackknife; 2] {
        /// A block that knows nearly all says nothing about its own scatter.
        const LEAST_SEEN: f64 = 0.2;
        const LEAST_FREEDOM: f64 = 1.5;
        let mut squares = [0.0; 2];
        let mut shares = 0.0;
        for block in blocks {
            let known: Matrix2<f64> = block.iter().map(|&m| self.frfs[m].own[mode].0).sum();
            let share = 0.5 * (inverse * known).trace();
            shares += share * share;
            for (k, square) in squares.iter_mut().enumerate() {
                let pull: f64 = block.iter().map(|&m| self.influence[m][2 * mode + k]).sum();
                *square += (pull / (1.0 - share).max(LEAST_SEEN)).powi(2);
            }
        }
        let few = students_t_over_normal((1.0 / shares - 1.0).max(LEAST_FREEDOM));
        squares.map(|square: f64| Jackknife {
            std: square.sqrt(),
            few,
        })
    }

    /// Where an FRF alone would have a pole, the others held, to the first order: change of (ln f, ln ζ), and the standard
    /// deviations for the noise as given. `None` where it does not show the mode.
    pub fn own_step(&self, frf: usize, mode: usize) -> Option<([f64; 2], [f64; 2])> {
        let (information, gradient) = self.frfs[frf].own[mode];
        let covariance = information.try_inverse()?;
        let step = covariance * gradient;
        let std = [covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()];
        let known = step.iter().chain(&std).all(|x| x.is_finite());
        known.then_some(([step[0], step[1]], std))
    }

    /// What the fit says of an FRF on any lines of its window.
    pub fn fitted(&self, frf: usize, frequency_hz: &[f64]) -> Vec<Complex64> {
        let linear = &self.frfs[frf].linear;
        frequency_hz
            .iter()
            .map(|&f| {
                let poles = self.poles.iter().chain(&self.fixed).enumerate();
                let modes: Complex64 = poles
                    .map(|(j, pole)| {
                        let r = f / pole.frequency_hz;
                        Complex64::new(linear[2 * j], linear[2 * j + 1] * r)
                            / Complex64::new(1.0 - r * r, 2.0 * pole.damping_ratio * r)
                    })
                    .sum();
                let from = linear.len() - RESIDUAL_TERMS;
                let rest = residual_terms(f, self.centre_hz).into_iter().enumerate();
                modes + rest.map(|(n, term)| term * linear[from + n]).sum::<Complex64>()
            })
            .collect()
    }

    /// Complex modal constant A of a mode in an FRF, 1/kg, and the standard deviation of its modulus' parts:
    /// at the pole the numerator a ω₀² + b s ω₀ is A.
    pub fn constant(&self, frf: usize, mode: usize) -> (Complex64, f64) {
        let found = &self.frfs[frf];
        let pole = self.poles[mode];
        let omega = TAU * pole.frequency_hz;
        let s = Complex64::new(
            -pole.damping_ratio,
            (1.0 - pole.damping_ratio.powi(2)).max(0.0).sqrt(),
        );
        let value = (found.linear[2 * mode] + found.linear[2 * mode + 1] * s) * omega * omega;
        let by_poles = found.linear_by_poles.rows(2 * mode, 2);
        let total = found.pair_covariance[mode] + by_poles * &self.covariance * by_poles.transpose();
        (value, (0.5 * total.trace()).max(0.0).sqrt() * omega * omega)
    }

    /// Modal constants of a mode in all FRFs, 1/kg, each as far as it is known.
    pub fn known_constants(&self, mode: usize) -> Vec<Complex64> {
        let each = (0..self.frfs.len()).map(|frf| self.constant(frf, mode));
        each.map(|(value, std)| shape::as_known(value, std)).collect()
    }

    /// How far a mode, or a pole held in place (these follow the modes), displaces the point of an FRF right after a blow, m/(N·s), up
    /// to 2π: b of its numerator a + b s.
    pub fn displaces_at_once(&self, frf: usize, pole: usize) -> f64 {
        let frequency_hz = match pole.checked_sub(self.poles.len()) {
            None => self.poles[pole].frequency_hz,
            Some(held) => self.fixed[held].frequency_hz,
        };
        self.frfs[frf].linear[2 * pole + 1] * frequency_hz
    }

    /// Squared size of a mode in an FRF against its uncertainty (two degrees of freedom).
    pub fn evidence(&self, frf: usize, mode: usize) -> f64 {
        let found = &self.frfs[frf];
        let x = found.linear.fixed_rows::<2>(2 * mode);
        found.pair_covariance[mode]
            .try_inverse()
            .map_or(0.0, |inverse| (x.transpose() * inverse * x)[(0, 0)])
    }
}

/// The FRFs of a fit, made ready once: what does not depend on the poles. Complex columns are stored as real and
/// imaginary parts by turns.
struct Prepared<'a> {
    frfs: &'a [NoisyFrf<'a>],
    /// By FRF, the index of the first one on the same lines.
    axis_of: Vec<usize>,
    centre_hz: f64,
    /// √2/σ, twice for each line: a complex standard deviation of σ is σ/√2 in each part. Empty where the FRFs are alike.
    weight: Vec<Vec<f64>>,
    /// Weighted measurement. Empty where the FRFs are alike.
    target: Vec<Vec<f64>>,
    alike: Option<Alike>,
}

impl<'a> Prepared<'a> {
    fn new(frfs: &'a [NoisyFrf<'a>]) -> Self {
        match Alike::new(frfs) {
            Some(alike) => Prepared {
                frfs,
                axis_of: vec![0; frfs.len()],
                centre_hz: centre_hz(frfs),
                weight: Vec::new(),
                target: Vec::new(),
                alike: Some(alike),
            },
            None => Self::each_its_own(frfs),
        }
    }

    /// With a basis for each FRF.
    fn each_its_own(frfs: &'a [NoisyFrf<'a>]) -> Self {
        let axis_of = (0..frfs.len())
            .map(|m| {
                (0..m)
                    .find(|&k| frfs[k].frequency_hz == frfs[m].frequency_hz)
                    .unwrap_or(m)
            })
            .collect();
        let weight: Vec<Vec<f64>> = frfs.iter().map(|frf| weights(frf.sigma)).collect();
        let target = frfs
            .iter()
            .zip(&weight)
            .map(|(frf, weight)| {
                let parts = frf.receptance.iter().flat_map(|h| [h.re, h.im]);
                parts.zip(weight).map(|(part, w)| part * w).collect()
            })
            .collect();
        Prepared {
            frfs,
            axis_of,
            centre_hz: centre_hz(frfs),
            weight,
            target,
            alike: None,
        }
    }

    /// Columns of the poles on the lines of each FRF that is the first with its lines.
    fn axes(&self, moving: &[Pole], fixed: &[Pole]) -> Vec<Option<PoleColumns>> {
        (0..self.frfs.len())
            .map(|m| {
                let own = self.axis_of[m] == m;
                own.then(|| {
                    let NoisyFrf {
                        frequency_hz,
                        spread_hz,
                        ..
                    } = self.frfs[m];
                    PoleColumns::new(frequency_hz, spread_hz, moving, fixed, self.centre_hz)
                })
            })
            .collect()
    }

    /// `work` on every FRF with its axis, in order, so that rounding does not depend on the threads.
    fn each<T: Send>(
        &self,
        axes: &[Option<PoleColumns>],
        work: impl Fn(usize, &PoleColumns, &mut Vec<f64>) -> Option<T> + Sync,
    ) -> Option<Vec<T>> {
        let each: Vec<Option<T>> = (0..self.frfs.len())
            .into_par_iter()
            .map_init(Vec::new, |buffer, m| {
                work(m, axes[self.axis_of[m]].as_ref()?, buffer)
            })
            .collect();
        each.into_iter().collect()
    }
}

/// Refines the poles `start`; `fixed` poles take part with residues of their own but are not moved. FRFs whose bands end before
/// have nothing to say ([`NoisyFrf::takes_part`]). `settled`: fall of the misfit that is worth no further step ([`SETTLED`], or more
/// where only the misfit is asked for). `None` where the lines do not determine the poles.
pub(crate) fn fit(frfs: &[NoisyFrf], start: &[Pole], fixed: &[Pole], settled: f64) -> Option<Solution> {
    let parameters = 2 * start.len();
    let poles = start.len() + fixed.len();
    let (numbers, part) = taking_part(frfs, poles);
    let equations: usize = part.iter().map(|c| 2 * c.frequency_hz.len()).sum();
    let degrees_of_freedom = equations
        .checked_sub(parameters + (2 * poles + RESIDUAL_TERMS) * part.len())
        .filter(|&free| free > 0)?;
    let found = fit_prepared(&Prepared::new(&part), start, fixed, settled, degrees_of_freedom)?;
    let mut all = Solution {
        frfs: frfs
            .iter()
            .map(|_| FrfSolution::nothing(poles, start.len()))
            .collect(),
        influence: vec![DVector::zeros(parameters); frfs.len()],
        ..found
    };
    for (m, (frf, influence)) in numbers
        .into_iter()
        .zip(found.frfs.into_iter().zip(found.influence))
    {
        (all.frfs[m], all.influence[m]) = (frf, influence);
    }
    Some(all)
}

/// The FRFs with enough lines for so many poles, and which they are.
fn taking_part<'a>(frfs: &[NoisyFrf<'a>], poles: usize) -> (Vec<usize>, Vec<NoisyFrf<'a>>) {
    let with_lines = frfs.iter().enumerate().filter(|(_, frf)| frf.takes_part(poles));
    with_lines.map(|(m, frf)| (m, frf.clone())).unzip()
}

fn fit_prepared(
    prepared: &Prepared,
    start: &[Pole],
    fixed: &[Pole],
    settled: f64,
    degrees_of_freedom: usize,
) -> Option<Solution> {
    let frfs = prepared.frfs;
    let parameters = 2 * start.len();
    let mut poles = start.to_vec();
    let mut current = linearise(prepared, &poles, fixed)?;
    let mut lambda = 1e-4;
    let mut converged = parameters == 0;
    for _ in 0..MAX_ITERATIONS {
        if converged {
            break;
        }
        stop::point();
        let mut damped = current.normal.clone();
        for j in 0..parameters {
            damped[(j, j)] *= 1.0 + lambda;
        }
        let Some(step) = damped.cholesky().map(|c| c.solve(&current.gradient)) else {
            break;
        };
        let worth = settled + RELATIVELY_SETTLED * current.misfit;
        // The fall that the step promises, where it is nearly a full one.
        if lambda < 1e-2 && step.dot(&current.gradient) <= worth {
            converged = true;
            break;
        }
        let trial: Vec<Pole> = poles
            .iter()
            .enumerate()
            .map(|(j, p)| {
                let widest = (2.0 * p.damping_ratio).clamp(1e-4, 0.1);
                Pole {
                    frequency_hz: p.frequency_hz * step[2 * j].clamp(-widest, widest).exp(),
                    damping_ratio: (p.damping_ratio * step[2 * j + 1].clamp(-0.7, 0.7).exp())
                        .max(MIN_DAMPING),
                }
            })
            .collect();
        let sane = trial
            .iter()
            .all(|p| p.frequency_hz > 0.0 && p.damping_ratio < 0.9);
        match if sane {
            linearise(prepared, &trial, fixed)
        } else {
            None
        } {
            Some(next) if next.misfit <= current.misfit => {
                converged = current.misfit - next.misfit <= worth;
                poles = trial;
                current = next;
                lambda = (lambda * 0.2).max(1e-12);
            }
            _ => {
                // No way down that rounding lets one see.
                if step.amax() < 1e-9 {
                    converged = true;
                }
                lambda *= 10.0;
                if lambda > 1e8 {
                    break;
                }
            }
        }
    }
    let covariance = current.normal.try_inverse()?;
    let influence = current.scores.iter().map(|score| &covariance * score).collect();
    let solved: Option<Vec<FrfSolution>> = (0..frfs.len())
        .into_par_iter()
        .map(|m| {
            let axis = current.axes[prepared.axis_of[m]].as_ref()?;
            Some(match &current.frfs {
                Linear::Own(solved) => solved[m].finish(&frfs[m], axis),
                Linear::Alike(solved) => solved.of_frf(m).finish(&frfs[m], axis),
            })
        })
        .collect();
    let frfs = solved?;
    covariance.iter().all(|c| c.is_finite()).then_some(Solution {
        poles,
        frfs,
        misfit: current.misfit,
        degrees_of_freedom,
        covariance,
        influence,
        converged,
        fixed: fixed.to_vec(),
        centre_hz: prepared.centre_hz,
    })
}

/// The 97.5 % point of Student's t over that of the normal distribution, by degrees of freedom (Cornish–Fisher series, 3 %
/// off at 2, less above).
fn students_t_over_normal(freedom: f64) -> f64 {
    1.0 + 1.21 / freedom + 1.44 / freedom.powi(2) + 1.31 / freedom.powi(3)
}

/// Misfit that each of the `trials` would explain in addition to the poles of a solution, these and the trial held where they
/// are: twice the log-likelihood ratio, exact in the residues. `None` where the lines do not determine those.
pub(crate) fn explained_by(frfs: &[NoisyFrf], held: &[Pole], trials: &[Pole]) -> Option<Vec<f64>> {
    let (_, part) = taking_part(frfs, held.len());
    let prepared = Prepared::new(&part);
    let held_axes = prepared.axes(&[], held);
    let trial_axes = prepared.axes(&[], trials);
    if let Some(alike) = &prepared.alike {
        return alike.explained_by(held_axes[0].as_ref()?, trial_axes[0].as_ref()?, trials.len());
    }
    let each = prepared.each(&held_axes, |m, axis, buffer| {
        let trial_axis = trial_axes[prepared.axis_of[m]].as_ref()?;
        let (solved, basis_columns) = Solved::new(
            &prepared.weight[m],
            &prepared.target[m],
            axis,
            2 * trials.len(),
            buffer,
        )?;
        let (rows, weight) = (axis.rows, &prepared.weight[m]);
        let added = &mut buffer[rows * (basis_columns + 1)..];
        weigh(added, &trial_axis.columns, weight);
        // Basis and residual, each with the residual and the trials.
        let mut all = DMatrix::zeros(basis_columns + 1, 1 + 2 * trials.len());
        let (left, right) = (
            &buffer[..rows * (basis_columns + 1)],
            &buffer[rows * basis_columns..],
        );
        product(&mut all, left, right, rows);
        let half = solved.half_solved(all.rows(0, basis_columns).into_owned());
        let added = &buffer[rows * (basis_columns + 1)..];
        let gains = (0..trials.len()).map(|t| {
            let pair = &added[2 * t * rows..2 * (t + 1) * rows];
            let (a, b) = pair.split_at(rows);
            let (p, q) = (half.column(2 * t + 1), half.column(2 * t + 2));
            let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
            let (aa, ab, bb) = (
                dot(a, a) - p.norm_squared(),
                dot(a, b) - p.dot(&q),
                dot(b, b) - q.norm_squared(),
            );
            let (u, v) = (
                all[(basis_columns, 2 * t + 1)] - half.column(0).dot(&p),
                all[(basis_columns, 2 * t + 2)] - half.column(0).dot(&q),
            );
            let gain = (u * u * bb - 2.0 * u * v * ab + v * v * aa) / (aa * bb - ab * ab);
            // A column that the others already hold explains nothing.
            if gain.is_finite() && gain > 0.0 { gain } else { 0.0 }
        });
        Some(gains.collect::<Vec<f64>>())
    })?;
    let mut sum = vec![0.0; trials.len()];
    for gains in each {
        for (sum, gain) in sum.iter_mut().zip(gains) {
            *sum += gain;
        }
    }
    Some(sum)
}

struct Linearised {
    misfit: f64,
    normal: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Each FRF's part of the gradient.
    scores: Vec<DVector<f64>>,
    frfs: Linear,
    axes: Vec<Option<PoleColumns>>,
}

/// The linear parameters, by FRF.
enum Linear {
    Own(Vec<SolvedFrf>),
    Alike(Box<AlikeLinear>),
}

/// Solves for the linear parameters of every FRF and builds the normal equations of the poles.
fn linearise(prepared: &Prepared, poles: &[Pole], fixed: &[Pole]) -> Option<Linearised> {
    let axes = prepared.axes(poles, fixed);
    if let Some(alike) = &prepared.alike {
        let found = alike.linearise(axes[0].as_ref()?)?;
        return found.misfit.is_finite().then(|| Linearised {
            misfit: found.misfit.max(0.0),
            normal: found.normal,
            gradient: found.scores.iter().sum(),
            scores: found.scores,
            frfs: Linear::Alike(Box::new(found.solved)),
            axes,
        });
    }
    let each = prepared.each(&axes, |m, axis, buffer| {
        linearise_one(&prepared.weight[m], &prepared.target[m], axis, buffer)
    })?;
    let parameters = 2 * poles.len();
    let mut sum = DMatrix::zeros(1 + parameters, 1 + parameters);
    let mut frfs = Vec::with_capacity(each.len());
    let mut scores = Vec::with_capacity(each.len());
    for (products, solved) in each {
        scores.push(products.view((1, 0), (parameters, 1)).column(0).into_owned());
        sum += products;
        frfs.push(solved);
    }
    sum[(0, 0)].is_finite().then(|| Linearised {
        misfit: sum[(0, 0)].max(0.0),
        normal: sum.view((1, 1), (parameters, parameters)).into_owned(),
        gradient: DVector::from_fn(parameters, |j, _| sum[(1 + j, 0)]),
        scores,
        frfs: Linear::Own(frfs),
        axes,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    /// Residual terms are the first of a series in the modes outside the band: what is cut off stays below the marks.
    #[test]
    fn modes_outside_the_band_leave_exact_data_within_the_marks() {
        let modes = [
            SyntheticMode::new(0.2, 0.02, 0.01),
            SyntheticMode::new(12.0, 0.03, 0.01),
            SyntheticMode::new(12.5, 0.02, -0.02),
            SyntheticMode::new(400.0, 0.02, 30.0),
        ];
        let (f, h) = Synthetic::new(4.0, 40.0, 0.25, &modes).frf();
        let sigma: Vec<f64> = h.iter().map(|h| 0.01 * h.norm()).collect();
        let frf = NoisyFrf {
            frequency_hz: &f,
            receptance: &h,
            sigma: &sigma,
            spread_hz: &vec![0.0; f.len()],
        };
        let start = [(11.8, 0.04), (12.7, 0.015)].map(|(frequency_hz, damping_ratio)| Pole {
            frequency_hz,
            damping_ratio,
        });
        let solution = fit(&[frf], &start, &[], SETTLED).unwrap();
        assert!(solution.converged);
        for (pole, mode) in solution.poles.iter().zip(&modes[1..3]) {
            approx::assert_relative_eq!(pole.frequency_hz, mode.frequency_hz, max_relative = 1e-4);
            approx::assert_relative_eq!(pole.damping_ratio, mode.damping_ratio, max_relative = 2e-3);
        }
        for (j, mode) in modes[1..3].iter().enumerate() {
            let (constant, _) = solution.constant(0, j);
            approx::assert_relative_eq!(constant.re, mode.constant, max_relative = 1e-2);
        }
    }

    #[test]
    fn few_frfs_widen_as_students_t_does() {
        // 97.5 % points of tables.
        for (freedom, point) in [(2.0, 4.3027), (5.0, 2.5706), (20.0, 2.0860)] {
            let normal = 1.95996;
            approx::assert_relative_eq!(
                students_t_over_normal(freedom),
                point / normal,
                max_relative = 0.035
            );
        }
    }

    /// 64 FRFs of one mode, whose frequency moves with every FRF or with every eight: the same scatter from FRF to FRF, but an
    /// eighth of the places. Errors of the mean are σ/√64 and σ/√8.
    #[test]
    fn frfs_that_share_an_error_count_as_one() {
        let stds = [1, 8].map(|shared| {
            let curves: Vec<(Vec<f64>, Vec<Complex64>)> = (0..64)
                .map(|m| {
                    let turn = (m / shared) as f64;
                    let moved = 20.0 * (1.0 + 1e-3 * (2.4 * turn).sin());
                    Synthetic::new(18.0, 22.0, 0.02, &[SyntheticMode::new(moved, 0.01, 1.0)])
                        .with_noise(0.0, 0.005, m as u64)
                        .frf()
                })
                .collect();
            let sigma: Vec<Vec<f64>> = curves
                .iter()
                .map(|(_, h)| h.iter().map(|h| 0.005 * h.norm()).collect())
                .collect();
            let spread = vec![0.0; curves[0].0.len()];
            let frfs: Vec<NoisyFrf> = curves
                .iter()
                .zip(&sigma)
                .map(|((f, h), sigma)| NoisyFrf {
                    frequency_hz: f,
                    receptance: h,
                    sigma,
                    spread_hz: &spread,
                })
                .collect();
            let start = Pole {
                frequency_hz: 20.0,
                damping_ratio: 0.01,
            };
            let found = fit(&frfs, &[start], &[], SETTLED).unwrap();
            found.jackknife(0)[0].std
        });
        let scatter = 1e-3 / std::f64::consts::SQRT_2;
        approx::assert_relative_eq!(stds[0], scatter / 8.0, max_relative = 0.3);
        approx::assert_relative_eq!(stds[1], scatter / 8.0_f64.sqrt(), max_relative = 0.3);
    }

    /// FRFs with noises that differ by a factor only are fitted with one basis for all: the same poles, residues, deviations.
    #[test]
    fn a_common_basis_gives_what_a_basis_for_each_frf_gives() {
        let poles = [(12.0, 0.03), (12.7, 0.02), (25.0, 0.015)];
        let constants = [[1.0, 0.5, -0.3], [-0.4, 1.0, 0.8], [0.7, -0.9, 1.0]];
        let curves: Vec<(Vec<f64>, Vec<Complex64>)> = constants
            .iter()
            .enumerate()
            .map(|(k, row)| {
                let modes: Vec<SyntheticMode> = poles
                    .iter()
                    .zip(row)
                    .map(|(&(f, zeta), &a)| SyntheticMode::new(f, zeta, a))
                    .collect();
                Synthetic::new(4.0, 40.0, 0.25, &modes)
                    .with_noise(0.0, 0.02, k as u64)
                    .frf()
            })
            .collect();
        let lines = curves[0].0.len();
        let shape: Vec<f64> = curves[0].1.iter().map(|h| 0.02 * h.norm()).collect();
        let sigmas: Vec<Vec<f64>> = [1.0, 3.0, 0.4]
            .iter()
            .map(|level| shape.iter().map(|s| level * s).collect())
            .collect();
        let none = vec![0.0; lines];
        let frfs: Vec<NoisyFrf> = curves
            .iter()
            .zip(&sigmas)
            .map(|((f, h), sigma)| NoisyFrf {
                frequency_hz: f,
                receptance: h,
                sigma,
                spread_hz: &none,
            })
            .collect();
        let pole = |(frequency_hz, damping_ratio)| Pole {
            frequency_hz,
            damping_ratio,
        };
        let start = [pole((11.9, 0.035)), pole((12.8, 0.018))];
        let fixed = [pole(poles[2])];
        let together = Prepared::new(&frfs);
        assert!(together.alike.is_some());
        let apart = Prepared::each_its_own(&frfs);
        let fit = |prepared: &Prepared| fit_prepared(prepared, &start, &fixed, SETTLED, 100).unwrap();
        let (a, b) = (fit(&together), fit(&apart));
        approx::assert_relative_eq!(a.misfit, b.misfit, max_relative = 1e-9);
        for j in 0..2 {
            approx::assert_relative_eq!(
                a.poles[j].frequency_hz,
                b.poles[j].frequency_hz,
                max_relative = 1e-9
            );
            approx::assert_relative_eq!(
                a.poles[j].damping_ratio,
                b.poles[j].damping_ratio,
                max_relative = 1e-7
            );
            for k in 0..2 {
                approx::assert_relative_eq!(a.scatter_std(j)[k], b.scatter_std(j)[k], max_relative = 1e-5);
            }
            for m in 0..3 {
                let ((a_value, a_std), (b_value, b_std)) = (a.constant(m, j), b.constant(m, j));
                assert!((a_value - b_value).norm() < 1e-6 * b_value.norm());
                approx::assert_relative_eq!(a_std, b_std, max_relative = 1e-6);
                approx::assert_relative_eq!(a.evidence(m, j), b.evidence(m, j), max_relative = 1e-6);
                let ((a_step, a_std), (b_step, b_std)) =
                    (a.own_step(m, j).unwrap(), b.own_step(m, j).unwrap());
                for k in 0..2 {
                    assert!((a_step[k] - b_step[k]).abs() < 1e-5 * b_std[k]);
                    approx::assert_relative_eq!(a_std[k], b_std[k], max_relative = 1e-6);
                }
            }
        }
        let trials = [pole((18.0, 0.02)), pole((12.3, 0.03))];
        let held = [pole(poles[0]), pole(poles[2])];
        let a = explained_by(&frfs, &held, &trials).unwrap();
        // A hair's breadth off proportion: each its own basis.
        let mut off = sigmas.clone();
        off[1][5] *= 1.0 + 1e-7;
        let frfs: Vec<NoisyFrf> = frfs
            .iter()
            .zip(&off)
            .map(|(frf, sigma)| NoisyFrf { sigma, ..frf.clone() })
            .collect();
        assert!(Prepared::new(&frfs).alike.is_none());
        let b = explained_by(&frfs, &held, &trials).unwrap();
        for (a, b) in a.iter().zip(b) {
            approx::assert_relative_eq!(*a, b, max_relative = 1e-5);
        }
    }
}
