use super::*;
use crate::campaign::RobotSection;
use crate::effects::find;
use crate::robot::RobotModel;
use crate::robot::fixture::{TAP_POSTURES, irb6640};

fn baseline() -> StructureModel {
    let section = RobotSection {
        model: "irb6640".into(),
        mass_tolerance: None,
        stiffness_tolerance: 0.3,
        links: Default::default(),
    };
    StructureModel::new(RobotModel::new(irb6640()), Vec::new(), &section)
}

const SUMMARY: DataSummary = DataSummary {
    force_levels: 1,
    postures: 4,
    lowest_hz: 5.0,
    highest_hz: 60.0,
};

/// The deepest minima of a robot, as they would be published: less than the assumed deviation off, by turns.
fn table(model: &StructureModel, theta: &[f64]) -> ResonanceStudy {
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
                    reading: Reading::RealPartMinimum,
                    frequency_hz,
                    readings_hz: [frequency_hz; 2],
                    frequency_std: 0.02,
                    size_m_per_n: mode.depth_m_per_n(axis) * (1.0 - 0.5 * sign),
                    size_std: 0.7,
                });
            }
        }
    }
    ResonanceStudy::new(&model.robot.spec, configurations, resonances)
}

#[test]
fn the_gradient_agrees_with_differences_of_the_cost() {
    for effect in ["local-resonator@link-3", "joint-transverse-compliance@joint-2"] {
        let model = baseline().with_effect(find(&irb6640(), effect)[0], &SUMMARY);
        let mut theta = model.nominal_theta();
        let study = table(&model, &theta);
        for (i, t) in theta.iter_mut().enumerate() {
            *t += [0.03, -0.05, 0.02][i % 3];
        }
        for view in [
            View::FULL,
            View {
                measure: Measure::Rough,
                ..View::FULL
            },
        ] {
            let problem = study.problem(&model, view);
            let here = problem.linearise(&theta).unwrap();
            assert!((here.cost - problem.cost(&theta).unwrap()).abs() < 1e-9 * here.cost);
            for p in 0..theta.len() {
                let at = |h: f64| {
                    let mut t = theta.clone();
                    t[p] += h;
                    problem.cost(&t).unwrap()
                };
                let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
                let error = (slope - here.gradient[p]).abs();
                assert!(
                    error < 1e-3 * (1.0 + slope.abs()),
                    "{effect} {p}: {slope} {}",
                    here.gradient[p]
                );
            }
        }
    }
}

#[test]
fn a_hidden_effect_is_found_from_a_table_of_resonances() {
    let hidden = "joint-transverse-compliance@joint-3";
    let model = baseline().with_effect(find(&irb6640(), hidden)[0], &SUMMARY);
    let mut truth = model.nominal_theta();
    truth[0] += 0.1;
    truth[2] -= 0.15;
    *truth.last_mut().unwrap() = 1.2e6f64.ln();
    let diagnosis = crate::discrepancy::diagnose(&table(&model, &truth), &baseline()).unwrap();
    assert_eq!(diagnosis.verdict, crate::discrepancy::Verdict::Effect);
    let winner = diagnosis.winner().unwrap();
    assert_eq!(winner.label(), hidden);
    let found = &winner.parameters[0];
    assert!((found.value - 1.2e6).abs() < 3.0 * found.std_error, "{found:?}");
}

#[test]
fn nothing_hidden_is_nothing_found() {
    let model = baseline();
    let mut truth = model.nominal_theta();
    truth[1] -= 0.2;
    truth[4] += 0.2;
    let diagnosis = crate::discrepancy::diagnose(&table(&model, &truth), &model).unwrap();
    assert_eq!(diagnosis.verdict, crate::discrepancy::Verdict::None);
}

#[test]
fn neighbouring_minima_are_one_resonance() {
    let minimum = |frequency_hz, real_m_per_n| Minimum {
        frequency_hz,
        real_m_per_n,
    };
    let groups = merged(&[minimum(48.7, -1e-7), minimum(12.8, -2e-5), minimum(47.0, -3e-7)]);
    assert_eq!(groups.len(), 2);
    assert_eq!(
        (groups[0].frequency_hz, groups[0].spread),
        (12.8f64.ln().exp(), 0.0)
    );
    assert_eq!(groups[1].readings_hz, [47.0, 48.7]);
    assert!((47.0..47.9).contains(&groups[1].frequency_hz));
    assert_eq!(groups[1].depth_m_per_n, 3e-7);
}
