//! The loop on the thesis' own measurements: which effect do the tables propose for the resonances that no rigid-link
//! model has?

use crate::discrepancy::{Diagnosis, diagnose};
use crate::effects::Instance;
use crate::identify::modal_table::{FREQUENCY_STD, PEAK_STD, StrongestMode};
use crate::identify::resonance_study::{Minimum, Reading, Resonance, ResonanceStudy, merged};
use crate::identify::StructureModel;
use crate::ingest::Axis;
use crate::robot::Kinematics;
use crate::Result;

/// Standard deviation of the logarithm of a depth in the list of minima: factor two. Damping differs from mode to mode
/// and the model has one; neighbours add to a minimum.
const DEPTH_STD: f64 = 0.7;

pub fn resonances(strongest: &[(usize, &StrongestMode)], minima: &[(usize, Axis, Vec<Minimum>)], widening: f64) -> Vec<Resonance> {
    let mut all: Vec<Resonance> = strongest.iter().map(|(configuration, mode)| Resonance {
        configuration: *configuration,
        axis: mode.axis,
        reading: Reading::ModalTable,
        frequency_hz: mode.frequency_hz,
        frequency_std: widening * FREQUENCY_STD,
        size_m_per_n: mode.peak_real_m_per_n,
        size_std: PEAK_STD,
    }).collect();
    for (configuration, axis, list) in minima {
        let groups = merged(list);
        let deepest = groups.iter().map(|g| g.depth_m_per_n).fold(0.0, f64::max);
        // The deepest is the strongest mode, for which the modal table stands.
        for group in groups.iter().filter(|g| g.depth_m_per_n < deepest) {
            all.push(Resonance {
                configuration: *configuration,
                axis: *axis,
                reading: Reading::RealPartMinimum,
                frequency_hz: group.frequency_hz,
                frequency_std: widening * FREQUENCY_STD.hypot(group.spread),
                size_m_per_n: group.depth_m_per_n,
                size_std: DEPTH_STD,
            });
        }
    }
    all
}

pub fn run(model: &StructureModel, configurations: Vec<Kinematics>, resonances: Vec<Resonance>) -> Result<(ResonanceStudy, Diagnosis<StructureModel, Instance>)> {
    let study = ResonanceStudy::new(&model.robot.spec, configurations, resonances);
    let diagnosis = diagnose(&study, model)?;
    Ok((study, diagnosis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::RobotSection;
    use crate::identify::Study;
    use crate::robot::{RobotModel, RobotSpec};

    #[test]
    #[ignore]
    fn proto() {
        for (mass, widening) in [(None, 1.0), (None, 2.0), (Some(0.1), 1.0), (Some(0.1), 2.0)] {
            let section = RobotSection { model: "irb6640".into(), mass_tolerance: mass, stiffness_tolerance: 0.3 };
            let spec = RobotSpec::load("irb6640", std::path::Path::new(".")).unwrap();
            let model = StructureModel::new(RobotModel::new(spec), Vec::new(), &section);
            let (kin, strongest, minima) = super::super::tables(&model).unwrap();
            let strongest: Vec<(usize, &StrongestMode)> = strongest.iter().map(|(i, m)| (*i, m)).collect();
            let list = resonances(&strongest, &minima, widening);
            let t = std::time::Instant::now();
            let (study, d) = run(&model, kin, list).unwrap();
            println!("== mass {mass:?} widening {widening}: {:?} {:?} conf {:.2} indist {:?} comp {:?} base red {:.2} nrms {:.3} ho {:?} agree {}/{} values {} {:?}",
                d.verdict, d.winner().map(|w| w.label()), d.confidence, d.indistinguishable, d.companion, d.baseline.reduced_chi2, d.baseline.residual.nrms,
                d.baseline.held_out.map(|h| (h.nrms(), h.chi2)), d.baseline.calibration.starts_agreeing, d.baseline.calibration.starts, study.real_values(crate::identify::study::Extent::Full), t.elapsed());
            for c in d.candidates.iter().take(12) {
                let m = study.matches(&c.model, &c.theta).unwrap();
                let open = m.iter().filter(|m| !m.is_there()).count();
                println!("  {:45} dbic {:7.1} p {:.1e} red {:.2} nrms {:.3} ho {:?} bound {} ref {} open {} {:?}", study.name(&c.instance).label(), c.delta_bic, c.p_value, c.reduced_chi2, c.nrms, c.held_out.map(|h| (h.nrms(), h.chi2)), c.at_bound, c.refined, open,
                    c.parameters.iter().map(|p| format!("{:.3e}±{:.1e}", p.value, p.std_error)).collect::<Vec<_>>());
            }
            let show = |name: &str, model: &StructureModel, theta: &[f64]| {
                println!(" {name}");
                let matches = study.matches(model, theta).unwrap();
                for (r, m) in study.resonances().iter().zip(&matches) {
                    println!("   {} {:?} {:6.2}±{:.3} {:.2e} -> {:6.2} {:.2e} d2 {:.1}", r.configuration + 1, r.axis, r.frequency_hz, r.frequency_std, r.size_m_per_n, m.frequency_hz, m.size_m_per_n, m.distance2);
                }
                for modes in study.modes(model, theta).unwrap() {
                    println!("   modes {:?}", modes.iter().filter(|m| m.frequency_hz < 120.0).map(|m| format!("{:.1}", m.frequency_hz)).collect::<Vec<_>>());
                }
            };
            if widening == 1.0 {
                show("base", &d.baseline.calibration.parameters.first().map(|_| model.clone()).unwrap(), &d.baseline.theta);
                show("best", &d.candidates[0].model, &d.candidates[0].theta);
                show("second", &d.candidates[1].model, &d.candidates[1].theta);
            }
        }
    }
}
