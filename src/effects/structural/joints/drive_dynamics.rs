use nalgebra::DMatrix;

use crate::data::RobotSpec;
use crate::effects::background::MOBERG;
use crate::effects::structural::{PostureSetting, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, NEGLIGIBLE, Site, Spot};
use crate::effects::{Background, Size};
use crate::parameter::Parameter;
use crate::robot::{Attachment, AttachmentLaw, Chain, Dual, Element, Grip, Role};

/// Behind the gear's spring the motor's rotor turns on the servo's stiffness: two springs in series with an inertia between.
pub struct DriveDynamics;

/// Main axes: those with the large motors.
const MAIN_AXES: usize = 3;

impl Effect<Structure> for DriveDynamics {
    fn id(&self) -> &'static str {
        "drive-dynamics"
    }

    fn explanation(&self) -> &'static str {
        "The motor gives way: behind the gear's spring its rotor is held by the servo's position loop only, which acts like a \
         spring with a damper (without a site: the same for the main axes 1 to 3)."
    }

    fn fingerprint(&self) -> &'static str {
        "Soft below the servo's bandwidth and stiff above it: low modes that turn this joint lie lower than its stiffness \
         allows and are damped far more than high ones."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Hit the arm once with the brakes set and once under servo: what changes is the drive. Or record the motor's \
                        encoder while the arm is hit; it stands still where the drive is stiff.",
            typical: "Position loops of industrial robots: 5 to 30 Hz, damping 0.3 to 1 of critical, 1 to 10 times the gear's \
                      stiffness; rotors count with the square of the gear ratio (100 to 500 kg·m² on main axes).",
            best_measured: "FRFs from a few Hz to well above the servo's bandwidth, under servo, at postures in which this joint \
                            takes part in different modes; one posture more with brakes set tells gear from drive.",
            sources: &[
                "Spong, M. W. (1987): Modeling and control of elastic joint robots. ASME Journal of Dynamic Systems, \
                 Measurement, and Control 109(4).",
                MOBERG,
            ],
        }
    }

    fn sites(&self, robot: &RobotSpec) -> Vec<Site> {
        let joints = (1..=robot.joints.len()).map(Site::Joint);
        std::iter::once(Site::Everywhere).chain(joints).collect()
    }

    fn on_promise(&self) -> bool {
        true
    }

    fn parameters(&self, _at: At, Known { data, .. }: &Known<Structure>) -> Vec<Parameter> {
        // A rotor far outside the band acts as a spring or a mass, which other effects are.
        let band = [0.4 * data.lowest_hz, 2.0 * data.highest_hz];
        vec![
            Parameter::logarithmic("servo_ratio", "1", 2.0, 2.0, [0.05, 1e5]),
            Parameter::logarithmic("frequency_hz", "Hz", 15f64.clamp(band[0], band[1]), 1.5, band),
            Parameter::logarithmic("damping_ratio", "1", 0.5, 1.0, [1e-3, 5.0]),
        ]
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![20.0, 10.0, 0.5], vec![20.0, 25.0, 0.5], vec![3.0, 40.0, 0.5]]
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let [ratio, _, damping] = sizes else { return None };
        let soft = ratio.outside(
            "a servo",
            [0.2, f64::INFINITY],
            (1.0, "times the gear's stiffness"),
            "a position loop as soft as that would not carry the arm",
        );
        soft.or_else(|| {
            damping.outside(
                "a servo's damping",
                [0.1, 2.5],
                (1.0, "of critical"),
                "position loops are tuned to 0.3 to 1, and one that rings for long is no loop but a part that resonates",
            )
        })
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("servo_ratio", SizeRange::Log(1.0, 3.0), FollowsSize::Power(-1.0)),
                UsualSize::new("frequency_hz", SizeRange::Log(8.0, 30.0), FollowsSize::Not),
                UsualSize::new("damping_ratio", SizeRange::Log(0.3, 0.8), FollowsSize::Not),
            ]
        }
    }

    fn vanishing(&self, _at: At, parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![
            parameters[0].nominal / NEGLIGIBLE,
            parameters[1].nominal,
            parameters[2].nominal,
        ])
    }

    fn apply(&self, At { site, .. }: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let joints = match site {
            Site::Joint(i) => i..=i,
            _ => 1..=MAIN_AXES.min(setting.robot.joint_count()),
        };
        let [ratio, frequency_hz, damping_ratio] = values else {
            return;
        };
        for joint in joints {
            let gear = chain.elements.iter().find(|e| e.role == Role::Joint(joint));
            let (Some(gear), Some((place, at, twist))) = (gear, Spot::Drive(joint).twist(setting.kinematics))
            else {
                return;
            };
            let stiffness = &gear.stiffness * ratio;
            let omega = frequency_hz.scale(std::f64::consts::TAU);
            let momentum = &stiffness / &omega;
            let rotor = Grip {
                coordinates: vec![(chain.elements.len(), 1.0)],
                point: None,
            };
            chain.elements.push(Element {
                // Not the gear's own spring: what changes that must not touch this one.
                role: Role::Bearing,
                place,
                at,
                directions: vec![twist],
                shape: DMatrix::identity(1, 1),
                damping: Some((&momentum * damping_ratio).scale(2.0)),
                stiffness,
            });
            // The rotor turns with the servo's coordinate alone: it is geared, its own turning with the arm is negligible.
            chain.attachments.push(Attachment {
                grip: rotor,
                law: AttachmentLaw::Inertia,
                size: &momentum / &omega,
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

    /// Receptance of the tool point along base y at `hz`, stiffness of joint 1 as given (real), with the drive or without.
    fn receptance(stiffness: f64, drive: Option<[f64; 3]>, hz: f64) -> Complex64 {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut baseline = Baseline::nominal(&model.spec);
        baseline.damping_ratio = Dual::constant(0.0);
        baseline.joint_stiffness_nm_per_rad[0] = Dual::constant(stiffness);
        let mut chain = model.chain(&kinematics, &baseline);
        if let Some(values) = drive {
            let setting = PostureSetting::of_tests(&model, &kinematics);
            let at = At {
                site: Site::Joint(1),
                variant: 0,
            };
            DriveDynamics.apply(at, &values.map(Dual::constant), &setting, &mut chain);
        }
        let row = chain.output_row(kinematics.tcp(), model.flange_place(), true, &Vector3::y());
        let basis = FrfBasis::new(&chain.system(0), &[row]).unwrap();
        basis.receptance_at(std::f64::consts::TAU * hz, 0, 0).unwrap()
    }

    /// Without damper the gear with its drive is one dynamic stiffness 1/k = 1/k_g + 1/(k_s − ω² J): at each frequency a
    /// gear of that stiffness is the same, and at rest two springs in series.
    #[test]
    fn gear_and_drive_are_springs_in_series_with_a_rotor_between() {
        let (gear, ratio, rotor_hz) = (1.5e6, 2.0, 18.0);
        for hz in [0.2, 5.0, 11.0, 30.0] {
            let servo = ratio * gear * (1.0 - f64::powi(hz / rotor_hz, 2));
            let together = 1.0 / (1.0 / gear + 1.0 / servo);
            // Above the rotor's resonance the series stiffness is positive again, larger than the gear's.
            assert!(together > 0.0);
            let exact = receptance(together, None, hz);
            let found = receptance(gear, Some([ratio, rotor_hz, 1e-12]), hz);
            assert!(
                (found - exact).norm() < 1e-6 * exact.norm(),
                "{hz}: {found} {exact}"
            );
        }
        let damped = receptance(gear, Some([ratio, rotor_hz, 0.5]), 7.0);
        assert!(damped.im < -0.02 * damped.norm(), "{damped}");
    }
}
