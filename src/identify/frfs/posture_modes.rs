//! The model's vibration modes at a posture as a table of modes has them: frequency, damping and compliance at the tool
//! point, with derivatives.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::Result;
use crate::data::Axis;
use crate::identify::frfs::structure::StructureModel;
use crate::robot::{Kinematics, ModalBasis};

/// One undamped mode of the whole structure, branches included.
#[derive(Debug, Clone, PartialEq)]
pub struct PostureMode {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Modal strain energy method (Johnson & Kienholz 1982): each part's damping counts by its share of the mode's strain
    /// energy. The chain's part is exactly its one damping ratio.
    pub damping_ratio: f64,
    /// Modal compliance 1/k of the direct receptance at the tool point along each base axis, m/N.
    pub compliance_m_per_n: [f64; 3],
    /// Derivatives with respect to the parameters on the solver's scale; empty where none were asked for.
    pub ln_frequency_slope: Vec<f64>,
    /// The same of the damping ratio.
    pub damping_slope: Vec<f64>,
    /// The same of the logarithm of each compliance.
    pub ln_compliance_slope: [Vec<f64>; 3],
}

impl PostureMode {
    /// Largest and smallest real part of the receptance near the mode, as if it stood alone: 1/(4kζ(1−ζ)) and
    /// −1/(4kζ(1+ζ)) (Altintas 2012, §3), m/N, by magnitude.
    pub fn peak_real_m_per_n(&self, axis: Axis) -> f64 {
        self.compliance_m_per_n[axis.index()] / (4.0 * self.damping_ratio * (1.0 - self.damping_ratio))
    }

    /// The smallest real part by magnitude, m/N; see [`peak_real_m_per_n`](Self::peak_real_m_per_n).
    pub fn depth_m_per_n(&self, axis: Axis) -> f64 {
        self.compliance_m_per_n[axis.index()] / (4.0 * self.damping_ratio * (1.0 + self.damping_ratio))
    }

    /// Where the real part is smallest: f sqrt(1 + 2ζ), Hz.
    pub fn minimum_hz(&self) -> f64 {
        self.frequency_hz * (1.0 + 2.0 * self.damping_ratio).sqrt()
    }
}

/// The vibration modes at a posture below `highest_hz`, lowest first. Effects that only change channels do not show here.
///
/// # Errors
/// A chain whose stiffness is not positive definite.
pub fn posture_modes(
    model: &StructureModel,
    theta: &[f64],
    kinematics: &Kinematics,
    highest_hz: f64,
    with_derivatives: bool,
) -> Result<Vec<PostureMode>> {
    let chain = model.chain(theta, kinematics, Default::default(), with_derivatives);
    let count = if with_derivatives { theta.len() } else { 0 };
    let mut system = chain.system(count);
    if with_derivatives {
        model.add_file_slopes(&mut system, theta, kinematics, Default::default());
    }
    let kinematics = &*model.kinematics_at(theta, kinematics);
    let modes = ModalBasis::new(&system.stiffness, &system.mass)?;
    let (shapes, mu) = (&modes.shapes, &modes.inverse_omega2);
    let n = mu.len();
    let least = (std::f64::consts::TAU * highest_hz).powi(-2).max(0.0);
    let outputs = [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|axis| chain.output_row(kinematics.tcp(), model.robot.flange_place(), true, &axis));
    // Participation of each mode: with xᵀKx = 1 its square is the modal compliance 1/k.
    let participation = outputs.map(|row| shapes.transpose() * row);
    let zeta = &system.modal_damping_ratio;
    let size = system.chain_count;
    let on_chain = |matrix: &DMatrix<f64>, x: &DVector<f64>| -> DVector<f64> {
        let mut result = DVector::zeros(n);
        result
            .rows_mut(0, size)
            .copy_from(&(matrix.view((0, 0), (size, size)) * x.rows(0, size)));
        result
    };
    let times = |matrix: &Option<DMatrix<f64>>, x: &DVector<f64>| -> DVector<f64> {
        matrix.as_ref().map_or_else(|| DVector::zeros(n), |m| m * x)
    };
    (0..n)
        .filter(|&k| mu[k] > least)
        .map(|k| {
            let x: DVector<f64> = shapes.column(k).into_owned();
            let strained = on_chain(&system.stiffness, &x);
            let damped = times(&system.viscous, &x);
            let (share, loss) = (x.dot(&strained), x.dot(&damped));
            let root = mu[k].sqrt();
            let mut mode = PostureMode {
                frequency_hz: 1.0 / (std::f64::consts::TAU * root),
                damping_ratio: zeta.value * share + 0.5 * loss / root,
                compliance_m_per_n: [0, 1, 2].map(|axis: usize| participation[axis][k].powi(2)),
                ln_frequency_slope: Vec::with_capacity(count),
                damping_slope: Vec::with_capacity(count),
                ln_compliance_slope: std::array::from_fn(|_| Vec::with_capacity(count)),
            };
            for (p, derivative) in system.derivatives.iter().enumerate() {
                // dμ = xᵀ(dM − μ dK)x; dx = Σ x_l x_lᵀ(dM − μ dK)x/(μ − μ_l) − ½ x xᵀdK x (Fox & Kapoor 1968,
                // K-normalised).
                let stiffened = times(&derivative.stiffness, &x);
                let change = times(&derivative.mass, &x) - &stiffened * mu[k];
                let mu_slope = x.dot(&change);
                let along = shapes.transpose() * &change;
                let weights = DVector::from_fn(n, |l, _| {
                    let gap = mu[k] - mu[l];
                    match l == k {
                        true => -0.5 * x.dot(&stiffened),
                        false if gap.abs() > 1e-9 * mu[k] => along[l] / gap,
                        false => 0.0,
                    }
                });
                let dx = shapes * &weights;
                let share_slope = 2.0 * dx.dot(&strained)
                    + derivative
                        .stiffness
                        .as_ref()
                        .map_or(0.0, |dk| x.dot(&on_chain(dk, &x)));
                let loss_slope = 2.0 * dx.dot(&damped) + x.dot(&times(&derivative.viscous, &x));
                mode.ln_frequency_slope.push(-0.5 * mu_slope / mu[k]);
                mode.damping_slope.push(
                    zeta.derivative(p) * share + zeta.value * share_slope + 0.5 * loss_slope / root
                        - 0.25 * loss * mu_slope / (root * mu[k]),
                );
                for (axis, slope) in mode.ln_compliance_slope.iter_mut().enumerate() {
                    let own = participation[axis][k];
                    let moved = participation[axis].dot(&weights);
                    slope.push(if own == 0.0 { 0.0 } else { 2.0 * moved / own });
                }
            }
            Ok(mode)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::RobotSection;
    use crate::effects::{DataSummary, Registry};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{FrfBasis, RobotModel};

    fn model(effect: &str) -> StructureModel {
        let section = RobotSection {
            model: "irb6640".into(),
            mass_tolerance: Some(0.1),
            stiffness_tolerance: 0.3,
            links: Default::default(),
        };
        let model = StructureModel::new(RobotModel::new(irb6640()), Vec::new(), &section);
        let data = DataSummary {
            force_levels: 1,
            postures: 4,
            lowest_hz: 5.0,
            highest_hz: 50.0,
        };
        model.with_effect(
            Registry::structure().find(&irb6640(), effect)[0],
            &model.known(&data),
        )
    }

    #[test]
    fn slopes_agree_with_differences() {
        for effect in [
            "local-resonator@link-3",
            "joint-transverse-compliance@joint-3",
            "payload",
        ] {
            let model = model(effect);
            let theta = model.nominal_theta();
            let kinematics = model.robot.kinematics(&TAP_POSTURES[0]).unwrap();
            let modes =
                |t: &[f64], slopes| posture_modes(&model, t, &kinematics, f64::INFINITY, slopes).unwrap();
            let here = modes(&theta, true);
            for p in 0..theta.len() {
                let h = 1e-6 * (1.0 + theta[p].abs());
                let at = |sign: f64| {
                    let mut t = theta.clone();
                    t[p] += sign * h;
                    modes(&t, false)
                };
                for ((u, d), x) in at(1.0).iter().zip(&at(-1.0)).zip(&here) {
                    let close = |difference: f64, slope: f64| {
                        let error = (difference / (2.0 * h) - slope).abs();
                        assert!(
                            error < 2e-4 * (0.1 + slope.abs()),
                            "{effect} {p}: {error} {slope}"
                        );
                    };
                    close((u.frequency_hz / d.frequency_hz).ln(), x.ln_frequency_slope[p]);
                    close(u.damping_ratio - d.damping_ratio, x.damping_slope[p]);
                    for axis in 0..2 {
                        let [up, down] = [u, d].map(|m| m.compliance_m_per_n[axis]);
                        close((up / down).ln(), x.ln_compliance_slope[axis][p]);
                    }
                }
            }
        }
    }

    /// A mode of the whole with its branch: frequency, damping and compliance agree with the real part of the full FRF.
    #[test]
    fn a_branch_shows_as_the_full_frf_has_it() {
        let model = model("tool-flexibility");
        let theta = model.nominal_theta();
        let kinematics = model.robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let modes = posture_modes(&model, &theta, &kinematics, 100.0, false).unwrap();
        let tool: Vec<&PostureMode> = modes
            .iter()
            .filter(|m| (35.0..75.0).contains(&m.frequency_hz))
            .collect();
        let axis = 0;
        let most = |m: &&&PostureMode| m.compliance_m_per_n[axis];
        let mode = *tool.iter().max_by(|a, b| most(a).total_cmp(&most(b))).unwrap();
        let chain = model.chain(&theta, &kinematics, Default::default(), false);
        let row = chain.output_row(kinematics.tcp(), model.robot.flange_place(), true, &Vector3::x());
        let basis = FrfBasis::new(&chain.system(0), &[row]).unwrap();
        let real = |f: f64| basis.receptance_at(std::f64::consts::TAU * f, 0, 0).unwrap().re;
        let grid: Vec<f64> = (0..4000)
            .map(|i| mode.frequency_hz * (0.95 + 0.1 * i as f64 / 4000.0))
            .collect();
        let lowest = grid
            .iter()
            .copied()
            .min_by(|a, b| real(*a).total_cmp(&real(*b)))
            .unwrap();
        let highest = grid
            .iter()
            .copied()
            .max_by(|a, b| real(*a).total_cmp(&real(*b)))
            .unwrap();
        assert!(
            (lowest / mode.minimum_hz() - 1.0).abs() < 0.01,
            "{lowest} {tool:?}"
        );
        // Between the two extremes of a lone mode the real part falls by 1/(2kζ(1−ζ²)).
        let fall = (real(highest) - real(lowest)) * 2.0 * mode.damping_ratio;
        assert!(
            (fall / mode.compliance_m_per_n[axis] - 1.0).abs() < 0.1,
            "{fall} {tool:?}"
        );
    }
}
