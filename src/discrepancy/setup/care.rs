//! How careful a laboratory was: the sizes of its small errors, kind by kind, as its own data show them.
//!
//! Every error is a normal number whose standard deviation is the usual one of its kind times a factor. The factors are
//! those of greatest evidence (MacKay 1992, Neural Computation 4, 415–447: type-II maximum likelihood) times what is known
//! of laboratories: they differ in care as a whole, less so from kind to kind. One kind may be far smaller than the
//! others; far larger, with all else quiet, is no lack of care but something else.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};
use nalgebra::{DMatrix, DVector};

use crate::{Error, Result};

/// Standard deviation of ln of the care from laboratory to laboratory, about half of the usual sizes: the median of few
/// squares.
pub const CARE: f64 = 1.0;
const MEDIAN: f64 = 0.5;
/// Standard deviation of ln of a kind's factor over the laboratory's, for kinds that are larger than the others.
const LARGER: f64 = 0.5;
/// What each e-fold less than the others costs in the end, as ln of a probability.
const SMALLER: f64 = 0.4;
/// How many times as far the factors of the kinds spread where they only imitate something else.
const UNRELATED: f64 = 2.0;
/// Physics looks like errors of the files, all the same whatever the robot does, once in so many times: of 44 simulated effects that
/// no library has six were taken whole by errors, five of these by the stiffness and one by the
/// hammer's direction, the same at all postures.
const PHYSICS_LIKE_FILES: f64 = 20.0;
/// A kind so many e-folds below the largest does not show; a laboratory has it or not, each as likely, and what is the robot's own
/// (stiffness) mostly not.
const UNSEEN: f64 = 2.0;
const NONE_OF_THE_FILES: f64 = std::f64::consts::LN_2;
const NONE_OF_THE_ROBOT: f64 = 0.3;
/// Change of a logarithm that no longer matters, largest change in one step, and steps.
const SETTLED: f64 = 0.01;
const LEAP: f64 = 1.5;
const STEPS: usize = 25;

/// What the data say of the small errors.
#[derive(Debug, Clone)]
pub struct Care {
    /// Most likely size of each error, in its usual standard deviations.
    pub sizes: DVector<f64>,
    /// Σ (size / standard deviation)², the standard deviation that of this laboratory.
    pub price: f64,
    /// −ln of how likely such standard deviations are, against the likeliest ones.
    unlikely: f64,
    /// ln of the laboratory's factor, and of each kind's over it.
    common: f64,
    by_kind: Vec<f64>,
    /// ln of how much denser the factors of the kinds lie in one laboratory than where they have nothing to do with one another, at
    /// the likeliest ones: what the data do not tell apart counts for nothing.
    kinship: f64,
    /// ln of the determinant of the information on the errors over that of their prior: by how much the data narrow them down.
    pub log_det: f64,
}

impl Care {
    /// ln of the evidence for such errors against none, where they take `taken` of χ²: half of that less what so many unknowns
    /// and their standard deviations pay for being fitted (Laplace's approximation at these sizes).
    pub fn evidence(&self, taken: f64) -> f64 {
        0.5 * (taken - self.price - self.log_det) - self.unlikely
    }

    /// −ln of how likely such standard deviations are in a laboratory, against where errors only imitate something else; `origins`:
    /// what each kind is an error of.
    pub fn surprise(&self, origins: &[Origin]) -> f64 {
        let all = self.unlikely - self.kinship;
        careless_in_few(&self.by_kind, self.common, origins).map_or(all, |few| few.min(all))
    }
}

/// Errors and care of greatest probability. `information` and `gradient`: those of χ²/2 by the errors, in units of their
/// usual standard deviations, the model's parameters having followed; `kinds`: the kind of each error, from 0 on.
///
/// # Errors
/// Information that is no number.
pub fn estimate(information: &DMatrix<f64>, gradient: &DVector<f64>, kinds: &[usize]) -> Result<Care> {
    let count = kinds.iter().map(|k| k + 1).max().unwrap_or(0);
    let data = Data {
        information,
        gradient,
        kinds,
    };
    // ln of the laboratory's factor, then of each kind's over it.
    let mut at = DVector::<f64>::zeros(1 + count);
    let mut here = data
        .at(&at)
        .ok_or_else(|| Error::computation("the data do not determine the small errors of the setup"))?;
    for _ in 0..STEPS {
        let mut step = here.newton_step(&at)?;
        let longest = step.amax();
        if longest > LEAP {
            step *= LEAP / longest;
        }
        let mut next = None;
        while step.amax() > SETTLED {
            // Where the factors are so large that rounding decides, nothing is better.
            next = data
                .at(&(&at + &step))
                .filter(|there| there.objective() < here.objective());
            if next.is_some() {
                break;
            }
            step *= 0.5;
        }
        let Some(there) = next else { break };
        at += step;
        here = there;
    }
    Ok(Care {
        price: here.whitened.norm_squared(),
        unlikely: here.unlikely,
        common: at[0],
        by_kind: at.iter().skip(1).copied().collect(),
        kinship: here.kinship(),
        log_det: here.log_det,
        sizes: -here.whitened.component_mul(&here.factors),
    })
}

/// What an error is one of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// Of the angles, gains, directions and corners that files and sensors state: no physics of the robot does the same.
    Files,
    /// Of the files, and the same at all postures: what a hammer does always, physics may do as well.
    Always,
    /// Of the robot itself.
    Robot,
}

/// −ln of how likely a laboratory is whose largest errors are its files', and whose others do not show, less how seldom physics looks
/// like that. `kinds`: ln of each kind's factor over the laboratory's, whose own is `common`.
fn careless_in_few(kinds: &[f64], common: f64, origins: &[Origin]) -> Option<f64> {
    let with = || kinds.iter().zip(origins);
    let (largest, _) = with()
        .filter(|(_, origin)| **origin == Origin::Files)
        .max_by(|a, b| a.0.total_cmp(b.0))?;
    let others = with().map(|(kind, origin)| match (kind < &(largest - UNSEEN), origin) {
        (true, Origin::Robot) => Some(NONE_OF_THE_ROBOT),
        (true, _) => Some(NONE_OF_THE_FILES),
        (false, Origin::Robot) => None,
        (false, _) => (kind <= largest).then_some(0.0),
    });
    let others: f64 = others.sum::<Option<f64>>()?;
    Some(0.5 * ((common + largest) / CARE).powi(2) + others - PHYSICS_LIKE_FILES.ln())
}

struct Data<'a> {
    information: &'a DMatrix<f64>,
    gradient: &'a DVector<f64>,
    kinds: &'a [usize],
}

/// The data seen with certain standard deviations.
struct Seen {
    /// Standard deviation of each error over the usual one.
    factors: DVector<f64>,
    /// Errors over their standard deviations, sign turned.
    whitened: DVector<f64>,
    /// ln of the evidence, and −ln of the prior against its peak.
    evidence: f64,
    unlikely: f64,
    log_det: f64,
    /// Slope of the evidence by ln of the laboratory's and of each kind's factor, and its expected curvature with the sign turned.
    slope: Vec<f64>,
    curvature: Vec<f64>,
}

impl Data<'_> {
    /// `None` where rounding leaves nothing of the information.
    fn at(&self, logs: &DVector<f64>) -> Option<Seen> {
        let n = self.kinds.len();
        let factors = DVector::from_fn(n, |i, _| MEDIAN * (logs[0] + logs[1 + self.kinds[i]]).exp());
        let whitened = Mat::from_fn(n, n, |i, j| {
            factors[i] * self.information[(i, j)] * factors[j] + if i == j { 1.0 } else { 0.0 }
        });
        let factor = whitened.llt(Side::Lower).ok()?;
        let inverse = factor.inverse();
        let log_det: f64 = (0..n).map(|i| 2.0 * factor.L()[(i, i)].ln()).sum();
        let gradient = factors.component_mul(self.gradient);
        let whitened = DVector::from_fn(n, |i, _| (0..n).map(|j| inverse[(i, j)] * gradient[j]).sum());
        let evidence = 0.5 * (gradient.dot(&whitened) - log_det);
        let (mut slope, mut curvature) = (vec![0.0; logs.len()], vec![0.0; logs.len()]);
        for (i, kind) in self.kinds.iter().enumerate() {
            // The share of an error that the data determine, not its prior.
            let determined = 1.0 - inverse[(i, i)];
            for factor in [0, 1 + kind] {
                slope[factor] += whitened[i].powi(2) - determined;
                curvature[factor] += 2.0 * determined.powi(2);
            }
        }
        let kinds: f64 = logs.iter().skip(1).map(|d| cost(*d)[0]).sum();
        let seen = Seen {
            factors,
            whitened,
            evidence,
            unlikely: 0.5 * (logs[0] / CARE).powi(2) + kinds,
            log_det,
            slope,
            curvature,
        };
        seen.objective().is_finite().then_some(seen)
    }
}

impl Seen {
    fn objective(&self) -> f64 {
        self.unlikely - self.evidence
    }

    fn kinship(&self) -> f64 {
        let wider = UNRELATED.powi(2) - 1.0;
        let resolved = self.curvature[1..].iter().map(|c| c / (c + LARGER.powi(-2)));
        resolved.map(|share| 0.5 * (wider * share).ln_1p()).sum()
    }

    fn newton_step(&self, at: &DVector<f64>) -> Result<DVector<f64>> {
        let n = at.len();
        let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
        hessian[(0, 0)] = CARE.powi(-2) + self.curvature[0];
        gradient[0] = at[0] / CARE.powi(2) - self.slope[0];
        for k in 1..n {
            let [_, slope, curvature] = cost(at[k]);
            hessian[(k, k)] = curvature + self.curvature[k];
            hessian[(0, k)] = self.curvature[k];
            hessian[(k, 0)] = self.curvature[k];
            gradient[k] = slope - self.slope[k];
        }
        let factor = hessian.cholesky();
        let factor = factor.ok_or_else(|| Error::computation("the care of the laboratory cannot be told"))?;
        Ok(-factor.solve(&gradient))
    }
}

/// −ln of the prior of a kind's factor over the laboratory's, its slope and its curvature: normal above, and below with a
/// tail that only falls off as a power of the factor.
fn cost(log: f64) -> [f64; 3] {
    let curvature = LARGER.powi(-2);
    if log >= 0.0 {
        return [0.5 * curvature * log * log, curvature * log, curvature];
    }
    let turn = SMALLER / curvature;
    let root = (1.0 + (log / turn).powi(2)).sqrt();
    [
        curvature * turn * turn * (root - 1.0),
        curvature * log / root,
        curvature / root.powi(3),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const KINDS: usize = 6;
    const EACH: usize = 30;
    /// Standard deviations of the noise that a usual error is worth.
    const PLAIN: f64 = 50.0;

    /// A model that is far off leaves so much that ever larger errors look likelier; information of low rank is then a matter of
    /// rounding (the least eigenvalue a little below zero). There is an answer all the same.
    #[test]
    fn a_rest_that_no_small_error_explains_is_no_failure() {
        let kinds: Vec<usize> = (0..KINDS * EACH).map(|i| i / EACH).collect();
        let seen = DMatrix::<f64>::from_fn(KINDS, KINDS * EACH, |row, i| ((row * 7 + i * 3) as f64).sin());
        let rounding = DMatrix::from_diagonal_element(KINDS * EACH, KINDS * EACH, 1e-13);
        let information = seen.tr_mul(&seen) * PLAIN.powi(2) - rounding;
        let gradient = seen.tr_mul(&DVector::from_element(KINDS, 1e12));
        let care = estimate(&information, &gradient, &kinds).unwrap();
        assert!(care.sizes.iter().all(|size| size.is_finite()), "{:?}", care.sizes);
        assert!(care.price.is_finite() && care.log_det.is_finite());
    }

    /// Errors with these factors, each seen with noise of its own, and the evidence for them.
    fn laboratory(factors: [f64; KINDS], seed: u64) -> (Care, f64) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || crate::statistics::nearly_normal(&mut random);
        let kinds: Vec<usize> = (0..KINDS * EACH).map(|i| i / EACH).collect();
        let gradient = DVector::from_fn(KINDS * EACH, |i, _| {
            PLAIN * (PLAIN * factors[i / EACH] * normal() + normal())
        });
        let information = DMatrix::identity(KINDS * EACH, KINDS * EACH) * PLAIN.powi(2);
        let care = estimate(&information, &gradient, &kinds).unwrap();
        let taken = -2.0 * gradient.dot(&care.sizes) - care.sizes.dot(&(&information * &care.sizes));
        let evidence = care.evidence(taken);
        (care, evidence)
    }

    #[test]
    fn usual_laboratories_are_likely_and_one_that_is_wrong_in_one_thing_only_is_not() {
        for (seed, care) in [(1, 0.25), (2, 0.5), (3, 1.0)] {
            let (usual, _) = laboratory([care; KINDS], seed);
            assert!(usual.unlikely < 1.5, "{care}: {usual:?}");
        }
        let (one_perfect, _) = laboratory([0.6, 0.6, 0.01, 0.6, 0.6, 0.6], 4);
        assert!(one_perfect.unlikely < 4.0, "{}", one_perfect.unlikely);
        let (one_wrong, _) = laboratory([0.0, 0.0, 3.0, 0.0, 0.0, 0.0], 5);
        assert!(one_wrong.unlikely > 8.0, "{}", one_wrong.unlikely);
    }

    #[test]
    fn a_laboratory_whose_files_are_wrong_by_the_usual_in_one_or_two_things_is_likely() {
        let [files, always, robot] = [Origin::Files, Origin::Always, Origin::Robot];
        let origins = [files, files, always, always, robot, robot];
        let unseen = -4.0;
        let care = |by_kind: [f64; KINDS]| Care {
            sizes: DVector::zeros(0),
            price: 0.0,
            unlikely: 8.0,
            common: 0.2,
            by_kind: by_kind.to_vec(),
            kinship: 1.0,
            log_det: 0.0,
        };
        let of = |by_kind: [f64; KINDS]| care(by_kind).surprise(&origins);
        let one = of([0.5, unseen, unseen, unseen, unseen, unseen]);
        let two = of([0.4, 0.5, unseen, unseen, unseen, unseen]);
        assert!(one < 0.0 && two < one, "{one} {two}");
        // Far larger than usual, it is no lack of care.
        assert!(of([2.5, unseen, unseen, unseen, unseen, unseen]) > 3.0);
        // Where the robot's stiffness changes as much, or what is always the same is more, it is another matter.
        assert_eq!(of([0.5, unseen, unseen, unseen, -1.0, unseen]), 7.0);
        assert_eq!(of([0.5, unseen, 0.6, unseen, unseen, unseen]), 7.0);
    }

    #[test]
    fn only_kinds_that_the_data_show_are_kin() {
        let (plain, _) = laboratory([0.6; KINDS], 8);
        let most = KINDS as f64 * UNRELATED.ln();
        assert!(
            plain.kinship > 0.9 * most && plain.kinship < most,
            "{}",
            plain.kinship
        );
        let (nothing, _) = laboratory([0.0; KINDS], 9);
        // Noise alone bounds the factors from above only.
        assert!(nothing.kinship < 0.4 * most, "{}", nothing.kinship);
    }

    #[test]
    fn errors_are_found_and_paid_for() {
        let (care, evidence) = laboratory([0.5; KINDS], 6);
        let spread = (care.sizes.norm_squared() / (KINDS * EACH) as f64).sqrt();
        assert!((spread / 0.5 - 1.0).abs() < 0.15, "{spread}");
        let each = care.price / (KINDS * EACH) as f64;
        assert!((each - 1.0).abs() < 0.1, "{each}");
        assert!(evidence > 1000.0);
        // Of noise alone they take nothing.
        let (_, nothing) = laboratory([0.0; KINDS], 7);
        assert!(nothing < 1.0, "{nothing}");
    }

    /// The slopes are those of the evidence.
    #[test]
    fn slopes_are_differences() {
        let kinds = [0, 0, 1];
        let information = DMatrix::from_row_slice(3, 3, &[9.0, 2.0, 1.0, 2.0, 5.0, 0.5, 1.0, 0.5, 20.0]);
        let gradient = DVector::from_row_slice(&[4.0, -7.0, 9.0]);
        let data = Data {
            information: &information,
            gradient: &gradient,
            kinds: &kinds,
        };
        let at = DVector::from_row_slice(&[0.3, -0.4, 0.2]);
        let here = data.at(&at).unwrap();
        for k in 0..3 {
            let mut step = DVector::zeros(3);
            step[k] = 1e-5;
            let [up, down] = [1.0, -1.0].map(|s| data.at(&(&at + &step * s)).unwrap().evidence);
            assert!(((up - down) / 2e-5 - here.slope[k]).abs() < 1e-5);
        }
        for log in [-3.0, -0.2, 0.4] {
            let [up, down] = [1e-5, -1e-5].map(|s| cost(log + s));
            assert!(((up[0] - down[0]) / 2e-5 - cost(log)[1]).abs() < 1e-6);
            assert!(((up[1] - down[1]) / 2e-5 - cost(log)[2]).abs() < 1e-6);
        }
    }
}
