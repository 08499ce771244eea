//! A table of resonances made from a model, for tests.

use crate::data::{Axis, RobotSection};
use crate::effects::DataSummary;
use crate::identify::StructureModel;
use crate::identify::frfs::posture_modes::{PostureMode, posture_modes};
use crate::identify::resonances::resonance_study::{Resonance, ResonanceReading, ResonanceStudy};
use crate::robot::fixture::{TAP_POSTURES, irb6640};
use crate::robot::{Kinematics, RobotModel};

/// The IRB 6640 without effects, masses exact.
pub(crate) fn baseline() -> StructureModel {
    let section = RobotSection {
        model: "irb6640".into(),
        mass_tolerance: None,
        stiffness_tolerance: 0.3,
        links: Default::default(),
    };
    StructureModel::new(RobotModel::new(irb6640()), Vec::new(), &section)
}

/// What the table below measures.
pub(crate) const SUMMARY: DataSummary = DataSummary {
    force_levels: 1,
    postures: 4,
    lowest_hz: 5.0,
    highest_hz: 60.0,
};

/// The deepest minima of a robot, as they would be published: less than the assumed deviation off, by turns.
pub(crate) fn table(model: &StructureModel, theta: &[f64]) -> ResonanceStudy {
    const NAMED: usize = 6;
    let configurations: Vec<Kinematics> = TAP_POSTURES
        .iter()
        .map(|p| model.robot.kinematics(p).unwrap())
        .collect();
    let mut resonances = Vec::new();
    for (configuration, kinematics) in configurations.iter().enumerate() {
        let modes = posture_modes(model, theta, kinematics, 60.0, false).unwrap();
        for axis in [Axis::X, Axis::Y] {
            let mut order: Vec<&PostureMode> = modes.iter().collect();
            order.sort_by(|a, b| b.depth_m_per_n(axis).total_cmp(&a.depth_m_per_n(axis)));
            for mode in order.into_iter().take(NAMED) {
                let sign = [0.6, -0.9, 0.3, -0.2, 0.8][resonances.len() % 5];
                let frequency_hz = mode.minimum_hz() * (1.0 + 0.02 * sign);
                resonances.push(Resonance {
                    configuration,
                    axis,
                    reading: ResonanceReading::RealPartMinimum,
                    frequency_hz,
                    readings_hz: [frequency_hz; 2],
                    frequency_std: 0.02,
                    size_m_per_n: mode.depth_m_per_n(axis) * (1.0 - 0.5 * sign),
                    size_std: 0.7,
                });
            }
        }
    }
    ResonanceStudy::new(configurations, resonances)
}
