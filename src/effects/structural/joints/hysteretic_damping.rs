use crate::data::RobotSpec;
use crate::effects::background::EWINS;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior};
use crate::robot::{Attachment, AttachmentLaw, Chain, Dual, Grip, Role};

/// Gears lose energy by a loss factor η: joint stiffness k (1 + iη), the same at every frequency, on top of what is left of
/// the one damping ratio for all modes.
///
/// As in `joint-damping` the common ratio is multiplied by `common_share`: 0 where all damping is hysteretic, 1 in the model
/// without the effect.
pub struct HystereticDamping;

/// Loss factor that 3 % of critical damping means at resonance: η = 2ζ.
const LOSS_FACTOR: f64 = 0.06;
/// By number of the choice: a loss factor a joint, or one for all joints.
const EXTENTS: [&str; 2] = ["each-joint", "one"];

impl Effect<Structure> for HystereticDamping {
    fn id(&self) -> &'static str {
        "hysteretic-damping"
    }

    fn explanation(&self) -> &'static str {
        "Gears lose a fixed share of their energy in each cycle, however slowly they move (loss factor, structural damping), \
         instead of damping that grows with speed."
    }

    fn fingerprint(&self) -> &'static str {
        "Frequencies and peak heights nearly fit, but the phase below the first resonance is too small in the model: the real \
         structure lags the force even when pushed slowly."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Load a joint slowly one way, then the other, brake set: the twist's loop has an area that does not depend \
                        on how slowly it is done. Or read the phase of the FRF at a third of the first resonance: tan φ is the \
                        loss factor there.",
            typical: "Gears with grease and preload: loss factors of 0.03 to 0.15; bolted steel 0.01 to 0.04; steel itself 0.001.",
            best_measured: "Lines far below the first resonance and between resonances with good coherence (a soft tip, a long \
                            record without exponential window), and sensors whose phase is right at low frequency.",
            sources: &[
                "Crandall, S. H. (1970): The role of damping in vibration theory. Journal of Sound and Vibration 11(1).",
                EWINS,
            ],
        }
    }

    fn variants(&self, _site: Site) -> Vec<usize> {
        (0..EXTENTS.len()).collect()
    }

    fn variant_label(&self, variant: usize) -> Option<(&'static str, &'static str)> {
        EXTENTS.get(variant).map(|extent| ("extent", *extent))
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, at: At, Known { object: robot, .. }: &Known<Structure>) -> Vec<Parameter> {
        let loss = |name: String| Parameter::logarithmic(name, "1", LOSS_FACTOR, 1.0, [1e-5, 3.0]);
        let mut parameters: Vec<Parameter> = match at.variant {
            0 => (0..robot.joints.len())
                .map(|i| loss(format!("loss_factor[{i}]")))
                .collect(),
            _ => vec![loss("loss_factor".into())],
        };
        let prior = Prior { mean: 0.0, std: 1.0 };
        parameters.push(Parameter::linear("common_share", "1", 0.0, prior, [-0.5, 1.5]));
        parameters
    }

    fn starts(
        &self,
        at: At,
        Known { object: robot, .. }: &Known<Structure>,
        _peaks_hz: &[f64],
    ) -> Vec<Vec<f64>> {
        let count = if at.variant == 0 { robot.joints.len() } else { 1 };
        let with = |loss: f64, share: f64| std::iter::repeat_n(loss, count).chain([share]).collect();
        vec![with(0.03, 0.5), with(0.01, 1.0)]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let (_, losses) = sizes.split_last()?;
        losses.iter().find_map(|loss| {
            loss.outside(
                "a loss factor",
                [0.0, 0.6],
                (1.0, ""),
                "greased and preloaded gears stay below 0.2, rubber mounts below 0.5",
            )
        })
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("loss_factor", SizeRange::Log(0.03, 0.12), FollowsSize::Not),
                // All damping is hysteretic.
                UsualSize::new("common_share", SizeRange::Either(1e-9), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        let (_, losses) = parameters.split_last()?;
        let none = losses.iter().map(|p| NEGLIGIBLE * p.nominal);
        Some(none.chain([1.0]).collect())
    }

    /// After what changes the joints' stiffness.
    fn order(&self) -> u8 {
        3
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &PostureSetting, chain: &mut Chain) {
        let Some((share, losses)) = values.split_last() else {
            return;
        };
        chain.modal_damping_ratio = &chain.modal_damping_ratio * share;
        for (index, element) in chain.elements.iter().enumerate() {
            let Role::Joint(i) = element.role else { continue };
            let Some(loss) = losses.get(i - 1).or_else(|| losses.first()) else {
                continue;
            };
            chain.attachments.push(Attachment {
                grip: Grip {
                    coordinates: vec![(index, 1.0)],
                    point: None,
                },
                law: AttachmentLaw::Hysteresis,
                size: &element.stiffness * loss,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, FrfBasis, RobotModel};
    use nalgebra::Vector3;
    use num_complex::Complex64;

    /// Receptance of the tool point along base y at `hz`; joint stiffnesses times a complex factor is what a loss factor means
    /// (correspondence principle): K (1 + iη) − ω² M = (1 + iη) [K − ω²/(1 + iη) M], so that H(ω) is the undamped
    /// modal sum at a complex frequency.
    fn receptance(values: &[f64], variant: usize, hz: f64) -> (Complex64, Complex64) {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
        let row = chain.output_row(kinematics.tcp(), model.flange_place(), true, &Vector3::y());
        let undamped = chain.system(0);
        let omega = std::f64::consts::TAU * hz;
        let modes = crate::robot::frf::ModalBasis::new(&undamped.stiffness, &undamped.mass).unwrap();
        let stretched = Complex64::new(1.0, values[0]);
        let exact: Complex64 = (0..modes.inverse_omega2.len())
            .map(|k| {
                let along = modes.shapes.column(k).dot(&row);
                along * along / (stretched - omega * omega * modes.inverse_omega2[k])
            })
            .sum();
        let setting = PostureSetting::of_tests(&model, &kinematics);
        let at = At {
            site: Site::Everywhere,
            variant,
        };
        let values: Vec<Dual> = values.iter().map(|v| Dual::constant(*v)).collect();
        HystereticDamping.apply(at, &values, &setting, &mut chain);
        let basis = FrfBasis::new(&chain.system(0), &[row]).unwrap();
        (basis.receptance_at(omega, 0, 0).unwrap(), exact)
    }

    #[test]
    fn one_loss_factor_is_a_complex_stiffness_of_all_modes() {
        for hz in [0.5, 7.5, 14.0, 40.0] {
            for (values, variant) in [(vec![0.1, 0.0], 1), (vec![0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.0], 0)] {
                let (found, exact) = receptance(&values, variant, hz);
                assert!(
                    (found - exact).norm() < 1e-9 * exact.norm(),
                    "{hz}: {found} {exact}"
                );
            }
        }
    }

    /// Each joint loses its own share: what is added to a joint's spring is that spring times its loss factor.
    #[test]
    fn every_joint_has_its_own_loss() {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
        let setting = PostureSetting::of_tests(&model, &kinematics);
        let at = At {
            site: Site::Everywhere,
            variant: 0,
        };
        let losses = [0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.0];
        HystereticDamping.apply(at, &losses.map(Dual::constant), &setting, &mut chain);
        for (index, element) in chain.elements.iter().enumerate() {
            let Role::Joint(joint) = element.role else {
                continue;
            };
            let own: Vec<f64> = chain
                .attachments
                .iter()
                .filter(|a| a.grip.coordinates == [(index, 1.0)])
                .map(|a| a.size.value / element.stiffness.value)
                .collect();
            assert_eq!(own.len(), 1);
            approx::assert_relative_eq!(own[0], 0.01 * joint as f64, max_relative = 1e-12);
        }
    }
}
