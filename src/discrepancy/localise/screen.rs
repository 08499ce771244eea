//! Every place at once, without a law: what an unknown dynamic stiffness there would take away, and what that stiffness
//! is, line by line.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use crate::effects::Spot;
use crate::effects::drawn::{self, DrawnForm};
use crate::identify::frfs::spot_response::{SpotLine, SpotResponses};
use crate::parameter::Parameter;

/// The dynamic stiffness that the data ask for on one line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurvePoint {
    /// Hz.
    pub frequency_hz: f64,
    /// N/m, or N·m/rad at a displacement that is an angle.
    pub stiffness: Complex64,
    /// Standard deviation of the complex value, same unit; infinite where the line says nothing.
    pub std: f64,
}

/// One place, screened.
#[derive(Debug, Clone)]
pub struct Screened {
    /// Where it is.
    pub spot: Spot,
    /// Misfit per complex value that is left with an unknown of its own for each line and posture.
    pub left_free: f64,
    /// The same with one unknown a line, common to all postures, for a part that is small compared with the structure.
    pub left_common: f64,
    /// Scatter of the dynamic stiffness over postures beyond its noise: 1 where it is the same everywhere.
    pub consistency: f64,
    /// On common lines of all postures, ascending in frequency.
    pub curve: Vec<CurvePoint>,
    /// Step of the model's parameters that goes with it, solver's scale.
    pub step: Vec<f64>,
}

/// Screens every spot of `responses`, whose model's parameters are `parameters` at `theta` (solver's scale).
pub fn screen(responses: &SpotResponses, parameters: &[Parameter], theta: &[f64]) -> Vec<Screened> {
    let groups = common_lines(responses);
    (0..responses.spots.len())
        .filter_map(|s| screen_spot(responses, parameters, theta, &groups, s))
        .collect()
}

/// What a law at the one spot of `responses` should be, line by line, where the model has one there already: that, with what the data ask
/// for beyond it while the model's parameters stay, and its scatter over postures. `law`: dynamic stiffness at a frequency (Hz). To first
/// order in what is added, so that noise does not bend the values: z = −g and, at a series spot, 1/κ = g.
pub fn draw_beyond(responses: &SpotResponses, law: impl Fn(f64) -> Complex64) -> (Vec<CurvePoint>, f64) {
    let is_series = responses.spots[0].is_series();
    let (mut scatter, mut freedom) = (0.0, 0usize);
    let points = common_lines(responses)
        .into_iter()
        .map(|(frequency_hz, lines)| {
            let each = lines.iter().map(|&l| responses.line(l, 0).0);
            let own: Vec<(Complex64, f64)> = each
                .filter(|at| at.strength > 0.0)
                .map(|at| (at.on_residual / at.strength, at.strength))
                .collect();
            let mean = Mean::of(&own);
            scatter += mean.scatter;
            freedom += own.len().saturating_sub(1);
            let law = law(frequency_hz);
            let slope = if is_series { law * law } else { Complex64::ONE };
            CurvePoint {
                frequency_hz,
                stiffness: law - slope * mean.value,
                std: slope.norm() * mean.std(),
            }
        })
        .collect();
    (points, scatter / freedom.max(1) as f64)
}

/// Of values and their weights (1/variance).
struct Mean {
    value: Complex64,
    weight: f64,
    /// Σ of the weighted squares about it.
    scatter: f64,
}

impl Mean {
    fn of(own: &[(Complex64, f64)]) -> Self {
        let weight: f64 = own.iter().map(|(_, w)| w).sum();
        let value = own.iter().map(|(z, w)| z * *w).sum::<Complex64>() / weight.max(f64::MIN_POSITIVE);
        Mean {
            value,
            weight,
            scatter: own.iter().map(|(z, w)| w * (z - value).norm_sqr()).sum(),
        }
    }

    /// Infinite without a value.
    fn std(&self) -> f64 {
        1.0 / self.weight.sqrt()
    }
}

/// Lines of equal frequency, ascending.
fn common_lines(responses: &SpotResponses) -> Vec<(f64, Vec<usize>)> {
    let mut order: Vec<usize> = (0..responses.lines.len()).collect();
    order.sort_by(|a, b| responses.lines[*a].0.total_cmp(&responses.lines[*b].0));
    let mut groups: Vec<(f64, Vec<usize>)> = Vec::new();
    for l in order {
        let f = responses.lines[l].0;
        match groups.last_mut().filter(|(g, _)| *g == f) {
            Some((_, lines)) => lines.push(l),
            None => groups.push((f, vec![l])),
        }
    }
    groups
}

/// Normal equations of the parameters once the unknowns of the place are projected out.
struct Reduced {
    information: DMatrix<f64>,
    score: DVector<f64>,
    taken: f64,
    unknowns: usize,
}

impl Reduced {
    fn new(responses: &SpotResponses) -> Self {
        Reduced {
            information: responses.information.clone(),
            score: responses.score.clone(),
            taken: 0.0,
            unknowns: 0,
        }
    }

    /// One complex unknown with pattern strength |a|², aᴴr and aᴴJ.
    fn project(&mut self, strength: f64, on_residual: Complex64, on_parameters: &[Complex64]) {
        if !(strength > 0.0) {
            return;
        }
        self.unknowns += 1;
        self.taken += on_residual.norm_sqr() / strength;
        for (p, a) in on_parameters.iter().enumerate() {
            self.score[p] -= (a.conj() * on_residual).re / strength;
            for (q, b) in on_parameters.iter().enumerate() {
                self.information[(p, q)] -= (a.conj() * b).re / strength;
            }
        }
    }

    /// Step of the parameters and what is left of the misfit, priors included.
    fn solve(&self, square: f64, parameters: &[Parameter], theta: &[f64]) -> Option<(DVector<f64>, f64)> {
        let mut hessian = &self.information * 2.0;
        let mut downhill = &self.score * 2.0;
        for (p, parameter) in parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                let [_, slope, curvature] = prior.half_square(theta[p]);
                hessian[(p, p)] += curvature;
                downhill[p] -= slope;
            }
        }
        let scale: Vec<f64> = (0..hessian.nrows())
            .map(|i| hessian[(i, i)].max(f64::MIN_POSITIVE).sqrt())
            .collect();
        let scaled = DMatrix::from_fn(hessian.nrows(), hessian.ncols(), |i, j| {
            // What the place takes altogether must not make the rest singular.
            hessian[(i, j)] / (scale[i] * scale[j]) + if i == j { 1e-9 } else { 0.0 }
        });
        let right = DVector::from_fn(downhill.len(), |i, _| downhill[i] / scale[i]);
        let solved = scaled.cholesky()?.solve(&right);
        let step = DVector::from_fn(solved.len(), |i, _| solved[i] / scale[i]);
        let left = square - self.taken - 0.5 * downhill.dot(&step);
        Some((step, left.max(0.0)))
    }
}

fn screen_spot(
    responses: &SpotResponses,
    parameters: &[Parameter],
    theta: &[f64],
    groups: &[(f64, Vec<usize>)],
    s: usize,
) -> Option<Screened> {
    let (mut free, mut common) = (Reduced::new(responses), Reduced::new(responses));
    for (_, lines) in groups {
        let mut strength = 0.0;
        let mut on_residual = Complex64::ZERO;
        let mut on_parameters = vec![Complex64::ZERO; responses.parameters];
        for &l in lines {
            let (at, own) = responses.line(l, s);
            free.project(at.strength, at.on_residual, own);
            strength += at.strength;
            on_residual += at.on_residual;
            for (sum, value) in on_parameters.iter_mut().zip(own) {
                *sum += value;
            }
        }
        common.project(strength, on_residual, &on_parameters);
    }
    let values = responses.values as f64;
    let freedom = |r: &Reduced| (values - r.unknowns as f64).max(1.0);
    let (step, left) = free.solve(responses.square, parameters, theta)?;
    let (_, left_common) = common.solve(responses.square, parameters, theta)?;
    let spot = responses.spots[s];
    let (curve, consistency) = curve(responses, groups, s, &step);
    Some(Screened {
        spot,
        left_free: left / freedom(&free),
        left_common: left_common / freedom(&common),
        consistency,
        curve,
        step: step.iter().copied().collect(),
    })
}

/// The dynamic stiffness of each line from the unknowns of its postures, and how far those scatter.
fn curve(
    responses: &SpotResponses,
    groups: &[(f64, Vec<usize>)],
    s: usize,
    step: &DVector<f64>,
) -> (Vec<CurvePoint>, f64) {
    let series = responses.spots[s].is_series();
    let (mut scatter, mut freedom) = (0.0, 0usize);
    let points = groups
        .iter()
        .map(|(frequency_hz, lines)| {
            let own: Vec<(Complex64, f64)> = lines
                .iter()
                .filter_map(|&l| {
                    let (at, on_parameters) = responses.line(l, s);
                    let absorbed: Complex64 =
                        on_parameters.iter().zip(step.iter()).map(|(a, d)| a * *d).sum();
                    stiffness(at, (at.on_residual - absorbed) / at.strength, series)
                })
                .collect();
            let mean = Mean::of(&own);
            scatter += mean.scatter;
            freedom += own.len().saturating_sub(1);
            CurvePoint {
                frequency_hz: *frequency_hz,
                stiffness: mean.value,
                std: mean.std(),
            }
        })
        .collect();
    (points, scatter / freedom.max(1) as f64)
}

/// Dynamic stiffness and its weight (1/variance) from the strength g of the pattern.
fn stiffness(at: &SpotLine, g: Complex64, series: bool) -> Option<(Complex64, f64)> {
    let (z, slope) = if series {
        // κ = 1/g − Z, dκ/dg = −1/g²
        (g.inv() - at.own, 1.0 / g.norm_sqr())
    } else {
        // z = −g/(1 + g Y), dz/dg = −1/(1 + g Y)²
        let factor = 1.0 + g * at.own;
        (-g / factor, 1.0 / factor.norm_sqr())
    };
    let weight = at.strength / (slope * slope);
    (z.is_finite() && weight.is_finite() && weight > 0.0).then_some((z, weight))
}

/// Starting values of a mass on a spring from a drawn curve, best first: (mass kg, frequency Hz, damping ratio).
pub fn resonators(curve: &[CurvePoint], count: usize) -> Vec<[f64; 3]> {
    const FREQUENCIES: usize = 60;
    const RATIOS: [f64; 3] = [0.015, 0.05, 0.15];
    let used: Vec<&CurvePoint> = curve
        .iter()
        .filter(|c| c.std.is_finite() && c.std > 0.0)
        .collect();
    let (Some(first), Some(last)) = (used.first(), used.last()) else {
        return Vec::new();
    };
    let (low, high) = (first.frequency_hz.max(1e-6), last.frequency_hz);
    let mut found: Vec<(f64, [f64; 3])> = Vec::new();
    for i in 0..FREQUENCIES {
        let f0 = low * (high / low).powf(i as f64 / (FREQUENCIES - 1) as f64);
        let best = RATIOS
            .iter()
            .map(|&zeta| {
                let (mut along, mut square) = (0.0, 0.0);
                for point in &used {
                    let shape = resonator_stiffness(point.frequency_hz, f0, zeta);
                    let weight = 1.0 / (point.std * point.std);
                    along += weight * (shape.conj() * point.stiffness).re;
                    square += weight * shape.norm_sqr();
                }
                let mass = (along / square).max(0.0);
                (mass * along, [mass, f0, zeta])
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        found.extend(best);
    }
    let mut starts: Vec<[f64; 3]> = Vec::new();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, start) in found {
        let apart = starts.iter().all(|s| (start[1] / s[1]).ln().abs() > 0.15);
        if start[0] > 0.0 && apart && starts.len() < count {
            starts.push(start);
        }
    }
    starts
}

/// Dynamic stiffness of 1 kg on a spring, N/m.
fn resonator_stiffness(frequency_hz: f64, natural_hz: f64, damping_ratio: f64) -> Complex64 {
    let values = [1.0, natural_hz, damping_ratio];
    drawn::dynamic_stiffness(Spot::LinkAxis(1, 0), DrawnForm::Resonator, &values, frequency_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonator_is_read_off_its_curve() {
        let curve: Vec<CurvePoint> = (0..400)
            .map(|i| 4.0 + 0.2 * f64::from(i))
            .map(|f| CurvePoint {
                frequency_hz: f,
                stiffness: 5.0 * resonator_stiffness(f, 27.0, 0.04),
                std: 1e3,
            })
            .collect();
        let [mass, frequency, _] = resonators(&curve, 2)[0];
        assert!((frequency / 27.0 - 1.0).abs() < 0.03, "{frequency}");
        assert!((mass / 5.0 - 1.0).abs() < 0.3, "{mass}");
        // Far below its frequency it is its mass, far above its spring.
        let heavy = resonator_stiffness(0.27, 27.0, 0.0);
        assert!((heavy.re / -(std::f64::consts::TAU * 0.27).powi(2) - 1.0).abs() < 1e-3);
        let spring = resonator_stiffness(2700.0, 27.0, 0.0);
        assert!((spring.re / (std::f64::consts::TAU * 27.0).powi(2) - 1.0).abs() < 1e-3);
    }

    /// Lines that say a thousand times less, however far off they are, change nothing; starts are places apart.
    #[test]
    fn uncertain_lines_do_not_hide_a_resonator() {
        let curve: Vec<CurvePoint> = (0..400)
            .map(|i| {
                let f = 4.0 + 0.2 * f64::from(i);
                let astray = i % 3 == 0;
                CurvePoint {
                    frequency_hz: f,
                    stiffness: if astray {
                        Complex64::new(-4e6, 0.0)
                    } else {
                        5.0 * resonator_stiffness(f, 27.0, 0.04)
                    },
                    std: if astray { 1e7 } else { 1e3 },
                }
            })
            .collect();
        let starts = resonators(&curve, 3);
        assert!(
            (starts[0][1] / 27.0 - 1.0).abs() < 0.03 && (starts[0][0] / 5.0 - 1.0).abs() < 0.3,
            "{starts:?}"
        );
        for (k, start) in starts.iter().enumerate() {
            assert!(
                starts[..k].iter().all(|s| (s[1] / start[1] - 1.0).abs() > 0.1),
                "{starts:?}"
            );
        }
    }
}
