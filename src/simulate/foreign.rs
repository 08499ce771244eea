//! Physics under no name of the library of effects, for campaigns whose right verdict is `unknown`, or the effect that comes
//! next to it (a sliding base is `base-mounting` by now).
//!
//! They are written as effects because that is the form the model takes, but they are not in
//! [`crate::effects::STRUCTURAL`]: no diagnosis can name them.

use nalgebra::{DMatrix, Point3, Vector3, Vector6};

use super::draw::{Draws, Purpose};
use crate::data::RobotSpec;
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{
    At, Background, ChannelFilter, Effect, Instance, Known, PostureSetting, Site, Structure,
};
use crate::parameter::{Parameter, Scale};
use crate::robot::{Branch, Chain, Dual, Element, Place, Role, Slot};

/// All foreign effects, each at its one site.
pub const FOREIGN: [&dyn Effect<Structure>; 4] = [
    &ViscoelasticJoints,
    &BaseSliding,
    &CrossAxisLeak,
    &ToolAxialFlexibility,
];

/// Nobody looks these up: they are not in the library.
const FOREIGN_BACKGROUND: Background = Background {
    lab_check: "",
    typical: "",
    best_measured: "",
    sources: &[],
};

/// The foreign effect of this id.
pub fn find(id: &str) -> Option<Instance<Structure>> {
    FOREIGN.into_iter().find(|e| e.id() == id).map(|effect| Instance {
        effect,
        site: Site::Everywhere,
        variant: 0,
    })
}

/// A foreign effect drawn from a seed.
pub fn any(seed: u64) -> &'static dyn Effect<Structure> {
    *Draws::new(seed, Purpose::Foreign).pick(&FOREIGN)
}

fn parameter(
    name: impl Into<String>,
    unit: &'static str,
    scale: Scale,
    nominal: f64,
    bounds: [f64; 2],
) -> Parameter {
    Parameter {
        name: name.into(),
        unit,
        scale,
        nominal,
        prior: None,
        bounds,
    }
}

/// Joints of a standard linear solid: behind each gear's spring a second one with a damper parallel to it (Kelvin–Voigt), so
/// that a joint is softer when moved slowly than when moved fast.
struct ViscoelasticJoints;

impl Effect<Structure> for ViscoelasticJoints {
    fn id(&self) -> &'static str {
        "viscoelastic-joints"
    }

    fn explanation(&self) -> &'static str {
        "Gears creep: each joint is softer when moved slowly than when moved fast."
    }

    fn fingerprint(&self) -> &'static str {
        "Low modes lie lower, high modes higher than any constant stiffness allows, and both are damped."
    }

    fn background(&self) -> Background {
        FOREIGN_BACKGROUND
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new(
                    "stiffness_ratio",
                    SizeRange::Log(1.5, 4.0),
                    FollowsSize::Power(-1.0),
                ),
                UsualSize::new("relaxation_hz", SizeRange::Log(5.0, 20.0), FollowsSize::Not),
            ]
        }
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![
            parameter("stiffness_ratio", "1", Scale::Logarithmic, 2.5, [0.05, 1e6]),
            parameter("relaxation_hz", "Hz", Scale::Logarithmic, 10.0, [0.1, 1e3]),
        ]
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &PostureSetting, chain: &mut Chain) {
        let time_s = values[1].scale(std::f64::consts::TAU).recip();
        let creeping: Vec<Element> = chain
            .elements
            .iter()
            .filter(|e| matches!(e.role, Role::Joint(_)))
            .map(|joint| {
                let stiffness = &joint.stiffness * &values[0];
                let damping = Some(&stiffness * &time_s);
                Element {
                    // Not the gear's own spring: what changes a joint's stiffness must not touch this one.
                    role: Role::Bearing,
                    stiffness,
                    damping,
                    ..joint.clone()
                }
            })
            .collect();
        chain.elements.extend(creeping);
    }
}

/// The pedestal slides along the base x and y axes on its fixing (in the library: `base-mounting`).
struct BaseSliding;

impl Effect<Structure> for BaseSliding {
    fn id(&self) -> &'static str {
        "base-sliding"
    }

    fn explanation(&self) -> &'static str {
        "The pedestal slides on its fixing along both horizontal axes."
    }

    fn fingerprint(&self) -> &'static str {
        "All points move sideways together, points near the floor as far as those high up."
    }

    fn background(&self) -> Background {
        FOREIGN_BACKGROUND
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "sliding_n_per_m",
                SizeRange::Log(3e6, 1e7),
                FollowsSize::Power(-1.0),
            )]
        }
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![parameter(
            "sliding_n_per_m",
            "N/m",
            Scale::Logarithmic,
            5e6,
            [1e4, 1e13],
        )]
    }

    fn apply(&self, _at: At, values: &[Dual], _setting: &PostureSetting, chain: &mut Chain) {
        chain.elements.push(Element {
            role: Role::Base,
            place: Place::new(0, Slot::Joint),
            at: Point3::origin(),
            directions: vec![
                Vector6::new(1.0, 0.0, 0.0, 0.0, 0.0, 0.0),
                Vector6::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
            ],
            shape: DMatrix::identity(2, 2),
            stiffness: values[0].clone(),
            damping: None,
        });
    }
}

/// Each response channel holds a share of its neighbours', the same both ways: a sensor's transverse sensitivity, which
/// no rotation of its axes can make (a rotation's shares have opposite signs).
struct CrossAxisLeak;

const LEAKS: [(&str, usize, usize); 3] = [("leak[0]", 0, 1), ("leak[1]", 0, 2), ("leak[2]", 1, 2)];

impl Effect<Structure> for CrossAxisLeak {
    fn id(&self) -> &'static str {
        "cross-axis-leak"
    }

    fn explanation(&self) -> &'static str {
        "The response sensor is sensitive across its axes: each channel holds a share of its neighbours' motion."
    }

    fn fingerprint(&self) -> &'static str {
        "Cross FRFs are wrong as with a turned sensor, but the shares have the same sign both ways."
    }

    fn background(&self) -> Background {
        FOREIGN_BACKGROUND
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "leak",
                SizeRange::Either(0.15),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        LEAKS
            .map(|(name, ..)| parameter(name, "1", Scale::Linear, 0.05, [-0.5, 0.5]))
            .to_vec()
    }

    fn distort(&self, values: &[Dual], filter: &mut ChannelFilter) {
        let before = filter.mixing.clone();
        for ((_, i, j), share) in LEAKS.into_iter().zip(values) {
            for (into, from) in [(i, j), (j, i)] {
                for k in 0..3 {
                    filter.mixing[into][k] = &filter.mixing[into][k] + &(share * &before[from][k]);
                }
            }
        }
    }
}

/// The tool gives way along its own axis (the library's only normal to it).
struct ToolAxialFlexibility;

impl Effect<Structure> for ToolAxialFlexibility {
    fn id(&self) -> &'static str {
        "tool-axial-flexibility"
    }

    fn explanation(&self) -> &'static str {
        "Spindle bearings give way along the tool axis: a mass at the tool point on a spring along that axis."
    }

    fn fingerprint(&self) -> &'static str {
        "One extra resonance along the tool axis, at the tool point only."
    }

    fn background(&self) -> Background {
        FOREIGN_BACKGROUND
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[
                UsualSize::new("mass_kg", SizeRange::Log(3.0, 8.0), FollowsSize::Not),
                UsualSize::new(
                    "frequency_hz",
                    SizeRange::Log(20.0, 60.0),
                    FollowsSize::Power(-0.5),
                ),
                UsualSize::new("damping_ratio", SizeRange::Log(0.015, 0.04), FollowsSize::Not),
            ]
        }
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        vec![
            parameter("mass_kg", "kg", Scale::Logarithmic, 5.0, [0.02, 300.0]),
            parameter("frequency_hz", "Hz", Scale::Logarithmic, 40.0, [1.0, 1e4]),
            parameter("damping_ratio", "1", Scale::Logarithmic, 0.03, [5e-4, 0.6]),
        ]
    }

    fn apply(&self, _at: At, values: &[Dual], setting: &PostureSetting, chain: &mut Chain) {
        let omega = values[1].scale(std::f64::consts::TAU);
        let momentum = &values[0] * &omega;
        chain.branches.push(Branch {
            place: Place::new(setting.robot.joint_count(), Slot::End),
            at: setting.kinematics.tcp(),
            directions: vec![setting.kinematics.tool.rotation * Vector3::z()],
            mass_kg: values[0].clone(),
            stiffness_n_per_m: &momentum * &omega,
            damping_ns_per_m: (&momentum * &values[2]).scale(2.0),
            carries_tool_point: true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Baseline, FrfBasis, RobotModel};
    use num_complex::Complex64;

    /// Receptance of the tool point along base y at 3 Hz, joint stiffnesses times `factor`.
    fn receptance(factor: f64, viscoelastic: Option<[f64; 2]>) -> Complex64 {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut baseline = Baseline::nominal(&model.spec);
        baseline.damping_ratio = Dual::constant(1e-4);
        for stiffness in &mut baseline.joint_stiffness_nm_per_rad {
            *stiffness = stiffness.scale(factor);
        }
        let mut chain = model.chain(&kinematics, &baseline);
        if let Some(values) = viscoelastic {
            let setting = PostureSetting::of_tests(&model, &kinematics);
            let values = values.map(Dual::constant);
            ViscoelasticJoints.apply(At::EVERYWHERE, &values, &setting, &mut chain);
        }
        let row = chain.output_row(kinematics.tcp(), model.flange_place(), true, &Vector3::y());
        let basis = FrfBasis::new(&chain.system(0), &[row]).unwrap();
        basis.receptance_at(std::f64::consts::TAU * 3.0, 0, 0).unwrap()
    }

    /// Far below its relaxation a standard linear solid is two springs in series, far above it the first spring alone;
    /// between, by the correspondence principle, one complex spring.
    #[test]
    fn viscoelastic_joints_are_a_standard_linear_solid() {
        let close = |a: Complex64, b: Complex64| (a - b).norm() < 0.01 * b.norm();
        let ratio = 2.0;
        let slow = receptance(1.0, Some([ratio, 1e3]));
        assert!(close(slow, receptance(ratio / (1.0 + ratio), None)), "{slow}");
        let fast = receptance(1.0, Some([ratio, 1e-2]));
        assert!(close(fast, receptance(1.0, None)), "{fast}");
        // At the relaxation frequency the loss is largest: well off the real axis.
        let between = receptance(1.0, Some([ratio, 3.0]));
        assert!(between.im < -0.05 * between.norm(), "{between}");
    }
}
