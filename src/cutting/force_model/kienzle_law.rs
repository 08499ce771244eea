//! Kienzle's law over a set of average forces: its terms by geometry, and its fit.

use std::f64::consts::{FRAC_PI_2, PI};

use statrs::function::beta::{beta, beta_reg};

use crate::cutting::fit::regression::{CoefficientFit, Observation, fit};
use crate::cutting::force_model::average_force::average_row;
use crate::cutting::force_model::drill_geometry::DrillGeometry;
use crate::cutting::force_model::force_axis::ForceAxis;
use crate::cutting::force_model::turning::engaged_edge;
use crate::data::{CutGeometry, Process, Tool};

/// What m may be in a fit: 0 is no size effect, 1 a force that does not know the chip.
pub(crate) const EXPONENTS: [f64; 2] = [-0.9, 0.99];

/// ∫ over the immersion of what a force component brings to an axis, at h ∝ sin^p φ.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Moment {
    /// 1: the chip is the same everywhere.
    One,
    /// ∫ sin^p cos.
    Cosine,
    /// ∫ sin^(p+1).
    Sine,
    /// ∫ sin^p.
    Plain,
}

/// What one component brings to one average: width (chip/reference)^p moment(p), times the force per width at the reference chip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct KienzleTerm {
    pub(crate) component: usize,
    /// Width, mm, with sign, share of the turn, and for a torque its arm.
    scale: f64,
    /// Chip thickness; in milling that at φ = 90°.
    pub(crate) chip_mm: f64,
    moment: Moment,
    /// Immersion angles within the half turn that cuts, rad.
    angles: [f64; 2],
}

impl KienzleTerm {
    pub(crate) fn value(&self, m: f64, reference_mm: f64) -> f64 {
        let p = 1.0 - m;
        let over = |f: &dyn Fn(f64) -> f64| f(self.angles[1]) - f(self.angles[0]);
        let moment = match self.moment {
            Moment::One => 1.0,
            Moment::Cosine => over(&|a| a.sin().max(0.0).powf(p + 1.0) / (p + 1.0)),
            Moment::Sine => over(&|a| sine_power(p + 1.0, a)),
            Moment::Plain => over(&|a| sine_power(p, a)),
        };
        self.scale * (self.chip_mm / reference_mm).powf(p) * moment
    }
}

/// ∫ sin^p from 0 to `angle` (0…π), p > −1: half an incomplete beta function (NIST DLMF 8.17.1 with t = sin²).
fn sine_power(p: f64, angle: f64) -> f64 {
    let (a, b) = (0.5 * (p + 1.0), 0.5);
    let half = 0.5 * beta(a, b);
    let part = |angle: f64| half * beta_reg(a, b, angle.sin().powi(2).clamp(0.0, 1.0));
    if angle <= FRAC_PI_2 {
        part(angle)
    } else {
        2.0 * half - part(PI - angle)
    }
}

/// The terms of one average; `None` for a geometry that has none.
pub(crate) fn terms(tool: &Tool, geometry: &CutGeometry, axis: ForceAxis) -> Option<Vec<KienzleTerm>> {
    match *geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
        } => {
            // Where the chip differs along the edge or from tooth to tooth the law has no closed form.
            if !tool.has_straight_edge() || !tool.each_tooth.is_empty() {
                return None;
            }
            let scale = tool.teeth as f64 * axial_depth_mm / (2.0 * PI);
            let term = |component, sign: f64, moment| KienzleTerm {
                component,
                scale: sign * scale,
                chip_mm: feed_per_tooth_mm,
                moment,
                angles: [immersion.start_rad.min(PI), immersion.exit_rad.min(PI)],
            };
            Some(match axis {
                ForceAxis::X => vec![term(0, -1.0, Moment::Cosine), term(1, -1.0, Moment::Sine)],
                ForceAxis::Y => vec![term(0, 1.0, Moment::Sine), term(1, -1.0, Moment::Cosine)],
                ForceAxis::Z => vec![term(2, 1.0, Moment::Plain)],
                ForceAxis::Mz => vec![],
            })
        }
        CutGeometry::Drilling { .. } => {
            let chip_mm = DrillGeometry::new(tool, geometry).ok()?.chip_thickness_mm();
            // The edge columns of the linear-edge law: width, and arm for the torque.
            let row = average_row(tool, geometry, axis).ok()?;
            let term = |component, scale| KienzleTerm {
                component,
                scale,
                chip_mm,
                moment: Moment::One,
                angles: [0.0; 2],
            };
            Some(match axis {
                ForceAxis::Mz => vec![term(0, row[1])],
                ForceAxis::Z => vec![term(1, row[3])],
                ForceAxis::X | ForceAxis::Y => vec![],
            })
        }
        CutGeometry::Turning { .. } => {
            let edge = engaged_edge(tool, geometry).ok()?;
            let cutting = edge.iter().filter(|bit| bit.chip_mm > 0.0);
            let terms = cutting.flat_map(|bit| {
                let directions = bit.directions(axis).into_iter().enumerate();
                directions
                    .filter(|(_, direction)| *direction != 0.0)
                    .map(|(component, direction)| KienzleTerm {
                        component,
                        scale: direction * bit.length_mm,
                        chip_mm: bit.chip_mm,
                        moment: Moment::One,
                        angles: [0.0; 2],
                    })
            });
            Some(terms.collect())
        }
    }
}

/// Name and symbol of each force component.
pub(crate) fn components(process: Process) -> &'static [(&'static str, &'static str)] {
    match process {
        Process::Milling | Process::Turning => {
            &[("tangential", "kt1.1"), ("radial", "kr1.1"), ("axial", "ka1.1")]
        }
        Process::Drilling => &[("tangential", "kt1.1"), ("feed", "kf1.1")],
    }
}

/// Kienzle's law over a set of averages. Parameters: force per width at the reference chip (N/mm) of each component, then
/// the exponents: so they are hardly correlated, as k1.1 and m are.
pub(crate) struct KienzleLaw<'a> {
    /// By observation: its terms.
    pub(crate) terms: &'a [Vec<KienzleTerm>],
    /// Number of force components.
    pub(crate) components: usize,
    /// Chip thickness at which the first parameters are given, mm.
    pub(crate) reference_mm: f64,
}

/// Kienzle's law fitted to a set of averages.
pub(crate) struct KienzleLawFit {
    /// The parameters.
    pub(crate) theta: Vec<f64>,
    /// The regression of the last linearisation.
    pub(crate) linear: CoefficientFit,
    /// False where the steps did not settle.
    pub(crate) converged: bool,
}

impl KienzleLaw<'_> {
    /// The average that has these terms, N or N·m.
    pub(crate) fn predict(&self, terms: &[KienzleTerm], theta: &[f64]) -> f64 {
        let one = |t: &KienzleTerm| {
            theta[t.component] * t.value(theta[self.components + t.component], self.reference_mm)
        };
        terms.iter().map(one).sum()
    }

    /// Derivatives of [`KienzleLaw::predict`] with respect to the parameters.
    pub(crate) fn jacobian(&self, terms: &[KienzleTerm], theta: &[f64]) -> Vec<f64> {
        const STEP: f64 = 1e-5;
        let mut row = vec![0.0; 2 * self.components];
        for t in terms {
            let m = theta[self.components + t.component];
            let at = |m: f64| t.value(m, self.reference_mm);
            row[t.component] += at(m);
            row[self.components + t.component] +=
                theta[t.component] * (at(m + STEP) - at(m - STEP)) / (2.0 * STEP);
        }
        row
    }

    /// With the exponents held, the law is linear.
    pub(crate) fn start(&self, observations: &[Observation], m: f64) -> Option<Vec<f64>> {
        let held: Vec<Observation> = observations
            .iter()
            .zip(self.terms)
            .map(|(o, terms)| {
                let mut row = vec![0.0; self.components];
                for t in terms {
                    row[t.component] += t.value(m, self.reference_mm);
                }
                Observation { row, ..o.clone() }
            })
            .collect();
        let mut theta = fit(&held)?.solution;
        theta.resize(2 * self.components, m);
        Some(theta)
    }

    /// Gauss and Newton's method; each step is the same regression as that of the linear-edge law.
    pub(crate) fn fit(
        &self,
        observations: &[Observation],
        start: Vec<f64>,
        most_steps: usize,
    ) -> Option<KienzleLawFit> {
        let mut theta = start;
        let (mut linear, mut converged) = (None, false);
        for _ in 0..most_steps {
            let linearised: Vec<Observation> = observations
                .iter()
                .zip(self.terms)
                .map(|(o, terms)| {
                    let row = self.jacobian(terms, &theta);
                    let along: f64 = row.iter().zip(&theta).map(|(r, x)| r * x).sum();
                    Observation {
                        value: o.value - self.predict(terms, &theta) + along,
                        row,
                        ..o.clone()
                    }
                })
                .collect();
            let solved = fit(&linearised)?;
            let squares = |theta: &[f64]| -> f64 {
                let each = observations.iter().zip(self.terms).zip(&solved.weight);
                each.map(|((o, terms), w)| w * (o.value - self.predict(terms, theta)).powi(2))
                    .sum()
            };
            let before = squares(&theta);
            let towards = |share: f64| -> Vec<f64> {
                let mut next: Vec<f64> = theta
                    .iter()
                    .zip(&solved.solution)
                    .map(|(x, to)| x + share * (to - x))
                    .collect();
                for m in &mut next[self.components..] {
                    *m = m.clamp(EXPONENTS[0], EXPONENTS[1]);
                }
                next
            };
            let next = (0..10)
                .map(|k| towards(0.5f64.powi(k)))
                .find(|next| squares(next) <= before * (1.0 + 1e-12));
            linear = Some(solved);
            let Some(next) = next else {
                // Nothing better that way: rounding, or the end of an exponent's range.
                converged = true;
                break;
            };
            let size = theta[..self.components]
                .iter()
                .fold(0.0f64, |s, q| s.max(q.abs()));
            let change = theta.iter().zip(&next).enumerate().map(|(j, (a, b))| {
                let unit = if j < self.components { size } else { 1.0 };
                (a - b).abs() / unit.max(f64::MIN_POSITIVE)
            });
            let change = change.fold(0.0, f64::max);
            theta = next;
            if change < 1e-7 {
                converged = true;
                break;
            }
        }
        Some(KienzleLawFit {
            linear: linear?,
            theta,
            converged,
        })
    }

    /// −2 ln likelihood of a fit, up to a constant.
    pub(crate) fn deviance(&self, observations: &[Observation], fit: &KienzleLawFit) -> f64 {
        let fitted = self.terms.iter().map(|t| self.predict(t, &fit.theta));
        deviance(observations, &fit.linear.weight, fitted)
    }
}

/// −2 ln likelihood, up to a constant, of independent normal errors.
fn deviance(observations: &[Observation], weight: &[f64], fitted: impl Iterator<Item = f64>) -> f64 {
    let each = observations.iter().zip(weight).zip(fitted);
    each.map(|((o, w), f)| w * (o.value - f).powi(2) - w.ln()).sum()
}

/// The same of the linear-edge law.
pub(crate) fn linear_deviance(observations: &[Observation], fit: &CoefficientFit) -> f64 {
    let fitted = observations.iter().map(|o| fit.predict(&o.row));
    deviance(observations, &fit.weight, fitted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_tools::endmill;
    use crate::data::Immersion;
    use approx::assert_relative_eq;

    const PART: Immersion = Immersion {
        start_rad: 1.9,
        exit_rad: PI,
    };

    #[test]
    fn moments_are_the_integrals() {
        for (p, from, to) in [(0.3, 0.0, PI), (1.7, 0.4, 1.2), (0.75, 1.2, 2.9), (1.0, 0.0, 2.0)] {
            let steps = 400_000;
            let width = (to - from) / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|k| (from + (f64::from(k) + 0.5) * width).sin().powf(p) * width)
                .sum();
            assert_relative_eq!(sine_power(p, to) - sine_power(p, from), sum, max_relative = 1e-7);
        }
        // m = 0 is the linear law without edges, on every axis.
        let tool = endmill(0.0, 90.0);
        let geometry = CutGeometry::Milling {
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 3.0,
            immersion: PART,
        };
        for axis in [ForceAxis::X, ForceAxis::Y, ForceAxis::Z] {
            let row = average_row(&tool, &geometry, axis).unwrap();
            for t in terms(&tool, &geometry, axis).unwrap() {
                assert_relative_eq!(t.value(0.0, 1.0), row[t.component], max_relative = 1e-12);
            }
        }
    }
}
