//! The cheapest further measurement that would settle a diagnosis.

use nalgebra::DVector;

use super::diagnose::{Candidate, Diagnosis};
use super::verdict::Verdict;
use crate::Result;
use crate::effects::Instance;
use crate::identify::frf_data::FrfBlock;
use crate::identify::{FrfData, StructureModel};
use crate::ingest::Axis;
use crate::robot::frf::Response;
use crate::robot::{FrfBasis, Place, Slot};

/// What to measure next, in a sentence.
pub fn advise(data: &FrfData, diagnosis: &Diagnosis<StructureModel, Instance>) -> Result<String> {
    match (diagnosis.verdict, diagnosis.winner()) {
        (Verdict::Effect, Some(winner)) => {
            let others = || {
                diagnosis
                    .candidates
                    .iter()
                    .filter(|c| c.label() != winner.label())
            };
            let rival = |c: &&Candidate<_, _>| diagnosis.indistinguishable.contains(&c.label());
            let Some(second) = others().find(rival).or_else(|| others().next()) else {
                return Ok("none needed".into());
            };
            let purpose = if diagnosis.indistinguishable.is_empty() {
                "to confirm it against"
            } else {
                "to tell it from"
            };
            let place = most_different(data, winner, second)?;
            Ok(format!("{place}, {purpose} {}", second.label()))
        }
        (Verdict::Unknown, _) => Ok(format!(
            "more response points along the arm (each link's far end, three directions) at posture {}: the rest is real \
             and its shape would say where it sits",
            data.measured_postures()
                .first()
                .map_or("p1", |p| data.posture_ids[*p].as_str())
        )),
        _ => Ok(
            "none needed for this model; two more postures or a second hammer level would test it further"
                .into(),
        ),
    }
}

/// Lines between those compared.
const LINE_STEP: usize = 8;

/// Where and how, among the robot's natural measurement points, two explanations differ most.
fn most_different(
    data: &FrfData,
    a: &Candidate<StructureModel, Instance>,
    b: &Candidate<StructureModel, Instance>,
) -> Result<String> {
    let outputs = 3 * (a.model.robot.joint_count() + 1);
    let mut best: Option<(f64, String)> = None;
    let mut seen = Vec::new();
    for block in &data.blocks {
        if seen.contains(&block.posture) {
            continue;
        }
        seen.push(block.posture);
        let (first, second) = (
            point_basis(&a.model, &a.theta, block)?,
            point_basis(&b.model, &b.theta, block)?,
        );
        // Outputs: tool, then the far end of each link; three axes each. Hit at the tool, in three axes.
        let mut sums = vec![(0.0, 0.0); 3 * outputs];
        let (mut ra, mut rb) = (Response::default(), Response::default());
        for f in block.frequency_hz.iter().step_by(LINE_STEP) {
            let omega = std::f64::consts::TAU * f;
            first.solve(omega, &mut ra)?;
            second.solve(omega, &mut rb)?;
            for (i, (difference, size)) in sums.iter_mut().enumerate() {
                let (out, input) = (i / 3, i % 3);
                let ha = first.receptance(&ra, out, input);
                let hb = second.receptance(&rb, out, input);
                *difference += (ha - hb).norm_sqr();
                *size += ha.norm_sqr();
            }
        }
        for (i, (difference, size)) in sums.into_iter().enumerate() {
            let (out, input) = (i / 3, i % 3);
            let relative = if size > 0.0 {
                f64::sqrt(difference / size)
            } else {
                0.0
            };
            if best.as_ref().is_none_or(|(least, _)| relative > *least) {
                let point = if out < 3 {
                    "the tool point".into()
                } else {
                    format!("the far end of link {}", out / 3)
                };
                let posture = &data.posture_ids[block.posture];
                let (r, i) = (Axis::ALL[out % 3].letter(), Axis::ALL[input].letter());
                let text = format!(
                    "measure {point} in base {r}, hitting the tool in {i}, at posture {posture}: the two explanations \
                     differ by {:.0} % there",
                    100.0 * relative
                );
                best = Some((relative, text));
            }
        }
    }
    let otherwise = "repeat the measurement at another posture";
    Ok(best.map_or(otherwise.into(), |(_, text)| text))
}

fn point_basis(model: &StructureModel, theta: &[f64], block: &FrfBlock) -> Result<FrfBasis> {
    let chain = model.chain(theta, &block.kinematics, block.lowness, false);
    let kinematics = &block.kinematics;
    let mut rows: Vec<DVector<f64>> = Vec::new();
    let mut push = |point, place, tool| {
        for axis in 0..3 {
            let mut direction = nalgebra::Vector3::zeros();
            direction[axis] = 1.0;
            rows.push(chain.output_row(point, place, tool, &direction));
        }
    };
    push(kinematics.tcp(), model.robot.flange_place(), true);
    for i in 1..=model.robot.joint_count() {
        push(
            kinematics.frames[i].translation.vector.into(),
            Place::new(i, Slot::End),
            false,
        );
    }
    FrfBasis::new(&chain.system(0), &rows)
}
