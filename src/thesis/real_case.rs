//! The loop on the thesis' own measurements: which effect do its tables propose for the resonances at which the model
//! calibrated on the strongest modes has none?

use serde::Serialize;

use super::checked::{Checked, checked};
use super::drawn_case::{DrawnCase, drawn_case};
use super::published::{MINIMA, MODAL, ModalRow, rows};
use crate::discrepancy::comparison::difference::{Difference, Lookout, greatest_difference};
use crate::discrepancy::verdict::{STRONG_BIC, evidence_weight};
use crate::discrepancy::{DiagnosisVerdict, diagnose};
use crate::identify::resonances::modal_table::{FREQUENCY_STD, PEAK_STD};
use crate::identify::resonances::resonance_study::{
    Minimum, Resonance, ResonanceReading, ResonanceStudy, merged,
};
use crate::identify::{Estimate, StructureModel};
use crate::ingest::Axis;
use crate::robot::posture_deg;
use crate::{Error, Result};

/// The four configurations of the tap tests.
pub const CONFIGURATIONS: [&str; 4] = ["1", "2", "3", "4"];
/// Standard deviation of the logarithm of a depth in the list of minima, a factor of two: damping differs from mode to
/// mode where the model has one ratio, and neighbours add to a minimum.
pub const DEPTH_STD: f64 = 0.7;
/// The loop is run once more with frequencies this much less certain: a conclusion that depends on the assumed standard
/// deviation does not count.
pub const WIDENED: f64 = 2.0;
/// Band in which the next measurement is sought, Hz: both bands of resonances in question.
const LOOK_HZ: [f64; 2] = [30.0, 52.0];
/// FRFs below this share of the largest are no advice: they drown in noise.
const LEAST_SHARE: f64 = 0.1;

/// The answer and what it rests on.
#[derive(Debug, Clone, Serialize)]
pub struct RealCase {
    /// What the loop answers.
    pub verdict: DiagnosisVerdict,
    /// How sure it is of that, 0..1.
    pub confidence: f64,
    /// Resonances after neighbouring minima were merged; two numbers each.
    pub resonances: Vec<MeasuredResonance>,
    /// Assumed standard deviations of logarithms: frequency; peak of the modal table; depth of a minimum.
    pub frequency_std: f64,
    /// Of a peak of the modal table.
    pub peak_std: f64,
    /// Of the depth of a minimum.
    pub depth_std: f64,
    /// The rigid-link model with its joints tuned to all resonances: the loop's baseline.
    pub baseline: Explanation,
    /// Joint stiffnesses and damping there.
    pub baseline_parameters: Vec<Estimate>,
    /// Starting points of that fit, and how many of them led to it.
    pub starts: usize,
    /// Starting points that led to the same fit.
    pub starts_agreeing: usize,
    /// Best first.
    pub candidates: Vec<Explanation>,
    /// Explanations whose BIC is within "very strong" of the best one's and better than none.
    pub rivals: Vec<String>,
    /// The same with frequencies less certain.
    pub widened: Widened,
    /// Modes of each configuration, Hz, as far as the table reaches: baseline and best candidate.
    pub baseline_modes_hz: Vec<Vec<f64>>,
    /// Modes of the best candidate, by configuration, Hz.
    pub best_modes_hz: Vec<Vec<f64>>,
    /// What to measure next.
    pub next: Vec<TellingMeasurement>,
    /// Effects that the tables cannot show, with the reason.
    pub not_tried: Vec<(String, String)>,
    /// What the tables draw where the library has no name.
    pub drawn: DrawnCase,
}

/// A measured resonance, and the mode that comes nearest in the baseline and in the best candidate.
#[derive(Debug, Clone, Serialize)]
pub struct MeasuredResonance {
    /// `1` … `4`, as in the thesis.
    pub configuration: String,
    /// `X` or `Y`.
    pub axis: char,
    /// Which table it is from.
    pub reading: ResonanceReading,
    /// Measured frequency, Hz.
    pub frequency_hz: f64,
    /// Lowest and highest reading behind it.
    pub readings_hz: [f64; 2],
    /// Peak or depth of the real part of the receptance, m/N.
    pub size_m_per_n: f64,
    /// Nearest mode of the baseline, Hz.
    pub baseline_hz: f64,
    /// Nearest mode of the best candidate, Hz.
    pub best_hz: f64,
    /// Distance in standard deviations, frequency and size together.
    pub baseline_distance: f64,
    /// The same for the best candidate.
    pub best_distance: f64,
    /// Whether the best candidate has a mode within four standard deviations.
    pub best_met: bool,
}

/// One way to explain the tables.
#[derive(Debug, Clone, Serialize)]
pub struct Explanation {
    /// `effect@site`; `rigid links` for the baseline.
    pub name: String,
    /// The same, for people.
    pub explanation: String,
    /// The effect's own parameters.
    pub parameters: Vec<Estimate>,
    /// BIC less the baseline's: below zero the effect pays for its parameters.
    pub delta_bic: f64,
    /// Corrected for the number of effects tried; 1 for the baseline.
    pub p_value: f64,
    /// χ² over degrees of freedom.
    pub reduced_chi2: f64,
    /// Σ d² on configurations left out in turn.
    pub held_out_chi2: f64,
    /// Whether a parameter ended at a bound.
    pub at_bound: bool,
    /// Tempered weight of its BIC among all explanations, baseline included; they sum to 1. Not a probability that it is
    /// right: that supposes that one of them is.
    pub weight: f64,
    /// How it meets the tables.
    #[serde(flatten)]
    pub checked: Checked,
}

/// The loop's answer with wider standard deviations.
#[derive(Debug, Clone, Serialize)]
pub struct Widened {
    /// What the loop answers.
    pub verdict: DiagnosisVerdict,
    /// How sure it is of that, 0..1.
    pub confidence: f64,
    /// Name of the best explanation.
    pub best: String,
    /// Its BIC less the baseline's.
    pub delta_bic: f64,
    /// Corrected for the number of effects tried.
    pub p_value: f64,
    /// χ² over degrees of freedom.
    pub reduced_chi2: f64,
}

/// What would tell two explanations apart.
#[derive(Debug, Clone, Serialize)]
pub struct TellingMeasurement {
    /// Names of the two.
    pub explanations: [String; 2],
    /// Where their FRFs differ most, against the noise.
    pub difference: Difference,
}

#[derive(serde::Deserialize)]
struct MinimumRow {
    configuration: String,
    axis: String,
    frequency_hz: f64,
    real_receptance_m_per_n: f64,
}

fn axis(letter: &str) -> Result<Axis> {
    let found = Axis::ALL.into_iter().find(|a| a.letter().to_string() == letter);
    found.ok_or_else(|| Error::computation(format!("a built-in table has an axis {letter}")))
}

fn configuration(id: &str) -> Result<usize> {
    let found = CONFIGURATIONS.iter().position(|c| *c == id);
    found.ok_or_else(|| Error::computation(format!("a built-in table has a configuration {id}")))
}

/// Both tables as resonances. The deepest minimum of each FRF is its strongest mode, for which the modal table stands.
pub fn resonances(widening: f64) -> Result<Vec<Resonance>> {
    let mut all = Vec::new();
    for row in rows::<ModalRow>(MODAL)? {
        all.push(Resonance {
            configuration: configuration(&row.configuration)?,
            axis: axis(&row.axis)?,
            reading: ResonanceReading::ModalTable,
            frequency_hz: row.frequency_hz,
            readings_hz: [row.frequency_hz; 2],
            frequency_std: widening * FREQUENCY_STD,
            size_m_per_n: row.peak_real_receptance_m_per_n,
            size_std: PEAK_STD,
        });
    }
    let mut lists: Vec<((usize, Axis), Vec<Minimum>)> = Vec::new();
    for row in rows::<MinimumRow>(MINIMA)? {
        let key = (configuration(&row.configuration)?, axis(&row.axis)?);
        let minimum = Minimum {
            frequency_hz: row.frequency_hz,
            real_m_per_n: row.real_receptance_m_per_n,
        };
        match lists.iter_mut().find(|(k, _)| *k == key) {
            Some((_, list)) => list.push(minimum),
            None => lists.push((key, vec![minimum])),
        }
    }
    for ((configuration, axis), list) in lists {
        let groups = merged(&list);
        let deepest = groups.iter().map(|g| g.depth_m_per_n).fold(0.0, f64::max);
        for group in groups.iter().filter(|g| g.depth_m_per_n < deepest) {
            all.push(Resonance {
                configuration,
                axis,
                reading: ResonanceReading::RealPartMinimum,
                frequency_hz: group.frequency_hz,
                readings_hz: group.readings_hz,
                frequency_std: widening * FREQUENCY_STD.hypot(group.spread),
                size_m_per_n: group.depth_m_per_n,
                size_std: DEPTH_STD,
            });
        }
    }
    Ok(all)
}

fn study(model: &StructureModel, widening: f64) -> Result<ResonanceStudy> {
    let configurations = CONFIGURATIONS
        .iter()
        .map(|id| model.robot.kinematics(&posture_deg(id)?))
        .collect::<Result<_>>()?;
    Ok(ResonanceStudy::new(configurations, resonances(widening)?))
}

/// Runs the loop on the tables, from the untuned `model`.
pub fn real_case(model: &StructureModel) -> Result<RealCase> {
    let study = study(model, 1.0)?;
    let diagnosis = diagnose(&study, model)?;
    let base = &diagnosis.baseline;
    let best = diagnosis
        .candidates
        .first()
        .ok_or_else(|| Error::computation("no effect could be tried on the thesis' tables"))?;
    let total = 1.0
        + diagnosis
            .candidates
            .iter()
            .map(|c| evidence_weight(c.delta_bic))
            .sum::<f64>();

    let baseline = Explanation {
        name: "rigid links".into(),
        explanation: "Nothing is missing: the joints are just not as stiff as published.".into(),
        parameters: Vec::new(),
        delta_bic: 0.0,
        p_value: 1.0,
        reduced_chi2: base.reduced_chi2,
        held_out_chi2: base.held_out.as_ref().map_or(0.0, |h| h.chi2),
        at_bound: false,
        weight: 1.0 / total,
        checked: checked(&study, model, &base.theta)?,
    };
    let candidates = diagnosis
        .candidates
        .iter()
        .map(|c| {
            Ok(Explanation {
                name: c.label(),
                explanation: c.instance.effect.explanation().into(),
                parameters: c.parameters.clone(),
                delta_bic: c.delta_bic,
                p_value: c.p_value,
                reduced_chi2: c.reduced_chi2,
                held_out_chi2: c.held_out.as_ref().map_or(0.0, |h| h.chi2),
                at_bound: c.at_bound,
                weight: evidence_weight(c.delta_bic) / total,
                checked: checked(&study, &c.model, &c.theta)?,
            })
        })
        .collect::<Result<Vec<_>>>()?;
    let rival =
        |c: &&Explanation| c.delta_bic < 0.0 && c.delta_bic - best.delta_bic < STRONG_BIC && !c.at_bound;
    let rivals: Vec<String> = candidates[1..]
        .iter()
        .filter(rival)
        .map(|c| c.name.clone())
        .collect();

    let next_to = |name: &str, model: &StructureModel, theta: &[f64]| -> Result<Option<TellingMeasurement>> {
        let difference = difference(&study, (&best.model, &best.theta), (model, theta))?;
        Ok(difference.map(|difference| TellingMeasurement {
            explanations: [best.label(), name.to_string()],
            difference,
        }))
    };
    let mut next = Vec::new();
    for candidate in diagnosis
        .candidates
        .iter()
        .filter(|c| rivals.contains(&c.label()))
    {
        next.extend(next_to(&candidate.label(), &candidate.model, &candidate.theta)?);
    }
    next.extend(next_to(&baseline.name, model, &base.theta)?);

    let modes_hz = |model: &StructureModel, theta: &[f64]| -> Result<Vec<Vec<f64>>> {
        let all = study.modes(model, theta)?.into_iter();
        let shown = |f: &f64| *f < 1.3 * LOOK_HZ[1];
        Ok(all
            .map(|modes| modes.iter().map(|m| m.frequency_hz).filter(shown).collect())
            .collect())
    };
    let matches = study
        .matches(model, &base.theta)?
        .into_iter()
        .zip(study.matches(&best.model, &best.theta)?);
    let resonances = study
        .resonances()
        .iter()
        .zip(matches)
        .map(|(r, (before, after))| MeasuredResonance {
            configuration: CONFIGURATIONS[r.configuration].into(),
            axis: r.axis.letter(),
            reading: r.reading,
            frequency_hz: r.frequency_hz,
            readings_hz: r.readings_hz,
            size_m_per_n: r.size_m_per_n,
            baseline_hz: before.frequency_hz,
            best_hz: after.frequency_hz,
            baseline_distance: before.distance2.sqrt(),
            best_distance: after.distance2.sqrt(),
            best_met: after.is_there(),
        });
    // The reason is the same at every site.
    let mut not_tried: Vec<(String, String)> = diagnosis
        .not_tried
        .iter()
        .map(|(label, reason)| {
            (
                label.split('@').next().unwrap_or(label).to_string(),
                reason.clone(),
            )
        })
        .collect();
    not_tried.dedup();
    Ok(RealCase {
        verdict: diagnosis.verdict,
        confidence: diagnosis.confidence,
        resonances: resonances.collect(),
        frequency_std: FREQUENCY_STD,
        peak_std: PEAK_STD,
        depth_std: DEPTH_STD,
        baseline_parameters: base.calibration.parameters.clone(),
        starts: base.calibration.starts,
        starts_agreeing: base.calibration.starts_agreeing,
        baseline_modes_hz: modes_hz(model, &base.theta)?,
        best_modes_hz: modes_hz(&best.model, &best.theta)?,
        drawn: drawn_case(&study, model, &base.theta)?,
        widened: widened(model)?,
        not_tried,
        baseline,
        candidates,
        rivals,
        next,
    })
}

fn widened(model: &StructureModel) -> Result<Widened> {
    let study = study(model, WIDENED)?;
    let diagnosis = diagnose(&study, model)?;
    let best = diagnosis
        .candidates
        .first()
        .ok_or_else(|| Error::computation("no effect could be tried on the thesis' tables"))?;
    Ok(Widened {
        verdict: diagnosis.verdict,
        confidence: diagnosis.confidence,
        best: best.label(),
        delta_bic: best.delta_bic,
        p_value: best.p_value,
        reduced_chi2: best.reduced_chi2,
    })
}

fn difference(
    study: &ResonanceStudy,
    a: (&StructureModel, &[f64]),
    b: (&StructureModel, &[f64]),
) -> Result<Option<Difference>> {
    const LINES: usize = 89;
    let step = (LOOK_HZ[1] - LOOK_HZ[0]) / (LINES - 1) as f64;
    let lookouts: Vec<Lookout> = CONFIGURATIONS
        .iter()
        .zip(study.configurations())
        .map(|(posture, kinematics)| Lookout {
            posture,
            kinematics,
            conditions: Default::default(),
            frequency_hz: (0..LINES).map(|i| LOOK_HZ[0] + step * i as f64).collect(),
        })
        .collect();
    greatest_difference(&lookouts, a, b, LEAST_SHARE)
}

#[cfg(test)]
mod tests {
    use super::super::published::untuned_model;
    use super::*;

    /// What the tables say today, verdict and order; the digits may move.
    #[test]
    fn the_tables_leave_it_open_and_propose_the_tilt_of_joint_2() {
        let case = real_case(&untuned_model().unwrap()).unwrap();
        assert_eq!(case.verdict, DiagnosisVerdict::Unknown);
        assert_eq!(case.candidates[0].name, "joint-transverse-compliance@joint-2");
        assert_eq!(case.widened.best, case.candidates[0].name);
        assert_eq!(case.widened.verdict, DiagnosisVerdict::Unknown);
        assert!(case.candidates[0].weight < 0.7 && !case.rivals.is_empty());
        assert!(
            case.candidates
                .windows(2)
                .all(|c| c[0].delta_bic <= c[1].delta_bic)
        );
        let weights: f64 = case.candidates.iter().map(|c| c.weight).sum::<f64>() + case.baseline.weight;
        assert!((weights - 1.0).abs() < 1e-9);
        // One advice for each rival, and one for the rigid links.
        assert_eq!(case.next.len(), case.rivals.len() + 1);
        assert!(case.next.iter().all(|n| n.difference.relative > 0.2));
        for id in ["time-delay", "sensor-misalignment", "joint-damping"] {
            assert!(case.not_tried.iter().any(|(effect, _)| effect == id), "{id}");
        }
        assert!(
            case.baseline
                .checked
                .bands
                .iter()
                .all(|b| b.measured > 0 && b.met <= b.measured && b.close <= b.met)
        );
        // Rigid links reach the bands with joint 5 nearly three times and joint 6 a third as stiff as published: nobody would
        // believe that, so neither band counts as explained by them, and the story is the same as before that fit.
        let joint = case.baseline.checked.farthest_joint.as_ref().unwrap();
        assert!(
            joint.name.starts_with("joint-6") || joint.name.starts_with("joint-5"),
            "{joint:?}"
        );
        assert!(!joint.is_credible() && joint.sigmas > 3.3, "{joint:?}");
        assert!(
            case.baseline
                .checked
                .bands
                .iter()
                .all(|b| b.met > 0 && !b.explained)
        );
        let answer = case.answer().join(" ");
        assert!(answer.contains("not explained by rigid links"), "{answer}");
        // Two tables at the tool point leave open where it is.
        assert!(case.drawn.laws > 100 && case.drawn.places > 60);
        assert!(
            case.drawn.places_as_good.len() > 1,
            "{:?}",
            case.drawn.places_as_good
        );
        assert!(answer.contains("What cannot: where it is"), "{answer}");
    }
}
