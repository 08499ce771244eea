//! The next measurement: the one that is expected to tell two explanations apart, against the noise and after each has
//! taken in what it can, at the least effort.

use std::fmt;

use serde::Serialize;

use crate::Result;
use crate::data::Posture;
use crate::discrepancy::candidate::EffectCandidate;
use crate::discrepancy::diagnosis::Diagnosis;
use crate::discrepancy::outlook::lab::{Lab, NewPoint, Setup};
use crate::discrepancy::verdict::DiagnosisVerdict;
use crate::effects::Structure;
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::{FrfData, LeastSquares};

/// Standard deviations that a measurement should promise: what is found scatters by two about their square's root, and
/// must still stand clear of chance.
pub(crate) const ENOUGH_SIGMAS: f64 = 6.0;
/// Standard deviations below which a measurement is no promise.
pub(crate) const LEAST_SIGMAS: f64 = 4.0;
/// Further measurements that are named.
const ALTERNATIVES: usize = 4;

/// What to measure next.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NextMeasurement {
    /// In a sentence.
    pub what: String,
    /// Standard deviations, sqrt of the expected growth of Σ r²/σ², at which the wrong one of `between` would be off after
    /// it has taken in what it can; the lesser of both directions. `None` where that cannot be worked out.
    pub expected_sigmas: Option<f64>,
    /// `effect@site` of the two explanations that it would tell apart.
    pub between: Option<[String; 2]>,
    /// Effort in units of one FRF with everything in place.
    pub cost: Option<f64>,
    /// Where and what, for a program; empty where the sentence says it all.
    pub setups: Vec<Setup>,
    /// Points that campaign.toml would need.
    pub new_points: Vec<NewPoint>,
    /// Others, cheapest first, each dearer and more telling than the one before.
    pub alternatives: Vec<Alternative>,
}

/// Another measurement.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// In words.
    pub what: String,
    /// As [`NextMeasurement::expected_sigmas`].
    pub expected_sigmas: f64,
    /// As [`NextMeasurement::cost`].
    pub cost: f64,
}

impl NextMeasurement {
    /// Only a sentence.
    pub fn words(what: impl Into<String>) -> Self {
        NextMeasurement {
            what: what.into(),
            expected_sigmas: None,
            between: None,
            cost: None,
            setups: Vec::new(),
            new_points: Vec::new(),
            alternatives: Vec::new(),
        }
    }
}

impl fmt::Display for NextMeasurement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

type StructureCandidate = EffectCandidate<Structure>;

/// What to measure next on a robot. `postures`: the campaign's.
///
/// # Errors
/// A model that has no response at a posture that could be measured.
pub fn advise(
    data: &FrfData,
    postures: &[Posture],
    diagnosis: &Diagnosis<Structure>,
) -> Result<NextMeasurement> {
    match (diagnosis.verdict, diagnosis.winner()) {
        (DiagnosisVerdict::Effect, Some(winner)) => {
            let others = || {
                diagnosis
                    .candidates
                    .iter()
                    .filter(|c| c.label() != winner.label())
            };
            let rival = |c: &&StructureCandidate| diagnosis.indistinguishable.contains(&c.label());
            let rivals = others().any(|c| rival(&c));
            let Some(second) = others().find(rival).or_else(|| others().next()) else {
                return Ok(NextMeasurement::words("none needed"));
            };
            let scale = winner.reduced_chi2.max(1.0);
            let advice = best(data, postures, (winner, second), scale)?;
            Ok(NextMeasurement {
                what: match rivals {
                    true => advice.what,
                    false => format!("none needed; to confirm it, {}", advice.what),
                },
                ..advice
            })
        }
        (DiagnosisVerdict::Unknown, _) => Ok(NextMeasurement::words(where_it_sits(data, diagnosis))),
        _ => Ok(NextMeasurement::words(
            "none needed for this model; two more postures or a second hammer level would test it further",
        )),
    }
}

/// For a rest that nothing explains: what would show its shape.
fn where_it_sits(data: &FrfData, diagnosis: &Diagnosis<Structure>) -> String {
    let posture = data
        .measured_postures()
        .first()
        .map_or("p1", |p| data.posture_ids[*p].as_str());
    let model = diagnosis.candidates.first().map(|c| &c.model);
    let links = model.map_or(6, |m| m.robot.joint_count());
    let measured = |link: usize| {
        let on_link = |point: usize| {
            let point = model.and_then(|m| m.points.get(point));
            point.is_some_and(|p| p.body == crate::data::BodyRef::Link(link))
        };
        data.frfs().any(|(_, frf)| on_link(frf.response.point))
    };
    let unseen: Vec<String> = (1..links)
        .filter(|l| !measured(*l))
        .map(|l| l.to_string())
        .collect();
    match unseen.as_slice() {
        [] => format!(
            "response points on the floor, the base and next to the tool, three directions, at posture {posture}: the rest is \
             real, every link is measured, and what moves there would say whether it sits outside the arm"
        ),
        some => format!(
            "more response points along the arm (the far end of link {}, three directions) at posture {posture}: the rest \
             is real and its shape would say where it sits",
            some.join(", ")
        ),
    }
}

/// The measurement that tells two candidates apart at the least effort. `scale`: what the noise is too small by.
fn best(
    data: &FrfData,
    postures: &[Posture],
    (a, b): (&StructureCandidate, &StructureCandidate),
    scale: f64,
) -> Result<NextMeasurement> {
    let lab = Lab::new(&a.model.robot, &a.model.points, postures, data)?;
    let [ab, ba] = [(a, b), (b, a)];
    let table = |(truth, rival): (&StructureCandidate, &StructureCandidate)| {
        lab.prospects((&truth.model, &truth.theta), (&rival.model, &rival.theta))
    };
    let (against_b, against_a) = (table(ab)?, table(ba)?);
    let known = |c: &StructureCandidate| {
        let problem = FrfProblem::likelihood(&c.model, data);
        problem.linearise(&c.theta).map(|l| l.hessian)
    };
    let (known_b, known_a) = (known(b)?, known(a)?);
    let sigmas: Vec<f64> = lab
        .measurements
        .iter()
        .map(|m| {
            let of_b = m.prospect(&against_b, b.theta.len()).growth(&known_b);
            let of_a = m.prospect(&against_a, a.theta.len()).growth(&known_a);
            (of_b.min(of_a) / scale).sqrt()
        })
        .collect();
    let Some(chosen) = cheapest_enough(&lab, &sigmas) else {
        return Ok(NextMeasurement::words(
            "none that this robot and these points offer",
        ));
    };
    let names = [a.label(), b.label()];
    let measurement = &lab.measurements[chosen];
    let promise = format!(
        "{:.0} standard deviations expected between {} and {}",
        sigmas[chosen], names[0], names[1]
    );
    let what = match sigmas[chosen] < LEAST_SIGMAS {
        false => format!("{}: {promise}", measurement.what),
        true => format!(
            "nothing within reach tells {} from {} at four standard deviations; nearest comes to {}: {:.1} expected",
            names[0],
            names[1],
            measurement.what.trim_start_matches("measure "),
            sigmas[chosen]
        ),
    };
    Ok(NextMeasurement {
        what,
        expected_sigmas: Some(sigmas[chosen]),
        between: Some(names),
        cost: Some(measurement.cost),
        setups: lab.setups(measurement, postures),
        new_points: lab.new_points(measurement),
        alternatives: alternatives(&lab, &sigmas, chosen),
    })
}

/// The cheapest of the measurements that promise enough; where none does, the most telling.
fn cheapest_enough(lab: &Lab, sigmas: &[f64]) -> Option<usize> {
    let all = || 0..lab.measurements.len();
    let cost = |i: usize| lab.measurements[i].cost;
    let by_cost = |a: &usize, b: &usize| {
        cost(*a)
            .total_cmp(&cost(*b))
            .then(sigmas[*b].total_cmp(&sigmas[*a]))
    };
    all()
        .filter(|i| sigmas[*i] >= ENOUGH_SIGMAS)
        .min_by(by_cost)
        .or_else(|| all().min_by(|a, b| sigmas[*b].total_cmp(&sigmas[*a]).then(by_cost(a, b))))
}

/// Those that no cheaper one surpasses, around the chosen one.
fn alternatives(lab: &Lab, sigmas: &[f64], chosen: usize) -> Vec<Alternative> {
    let mut order: Vec<usize> = (0..sigmas.len()).collect();
    order.sort_by(|a, b| {
        let cost = |i: usize| lab.measurements[i].cost;
        cost(*a)
            .total_cmp(&cost(*b))
            .then(sigmas[*b].total_cmp(&sigmas[*a]))
    });
    let mut most = 1.0;
    let mut front: Vec<usize> = Vec::new();
    for i in order {
        // Hardly more is no reason for more effort.
        if sigmas[i] > 1.2 * most {
            most = sigmas[i];
            front.push(i);
        }
    }
    let at = front.iter().position(|i| *i == chosen).unwrap_or(front.len());
    front.retain(|i| *i != chosen);
    let first = at
        .saturating_sub(ALTERNATIVES / 2)
        .min(front.len().saturating_sub(ALTERNATIVES));
    front
        .into_iter()
        .skip(first)
        .take(ALTERNATIVES)
        .map(|i| Alternative {
            what: lab.measurements[i].what.clone(),
            expected_sigmas: sigmas[i],
            cost: lab.measurements[i].cost,
        })
        .collect()
}
