//! The loop on a table of resonances instead of FRFs.

use super::{DiagnosisVerdict, diagnose};
use crate::effects::Registry;
use crate::identify::resonances::resonance_study::made_table::{SUMMARY, baseline, table};
use crate::robot::fixture::irb6640;

#[test]
fn a_hidden_effect_is_found_from_a_table_of_resonances() {
    let hidden = "joint-transverse-compliance@joint-3";
    let model = baseline().with_effect(
        Registry::structure().find(&irb6640(), hidden)[0],
        &baseline().known(&SUMMARY),
    );
    let mut truth = model.nominal_theta();
    truth[0] += 0.1;
    truth[2] -= 0.15;
    *truth.last_mut().unwrap() = 1.2e6f64.ln();
    let diagnosis = diagnose(&table(&model, &truth), &baseline()).unwrap();
    assert_eq!(diagnosis.verdict, DiagnosisVerdict::Effect);
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
    let diagnosis = diagnose(&table(&model, &truth), &model).unwrap();
    assert_eq!(diagnosis.verdict, DiagnosisVerdict::None);
}
