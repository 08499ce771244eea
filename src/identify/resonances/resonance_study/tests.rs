use crate::effects::Registry;
use crate::identify::resonances::resonance_study::made_table::{SUMMARY, baseline, table};
use crate::identify::resonances::resonance_study::*;
use crate::robot::fixture::irb6640;

#[test]
fn the_gradient_agrees_with_differences_of_the_cost() {
    for effect in ["local-resonator@link-3", "joint-transverse-compliance@joint-2"] {
        let model = baseline().with_effect(
            Registry::structure().find(&irb6640(), effect)[0],
            &baseline().known(&SUMMARY),
        );
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
