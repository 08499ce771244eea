//! The cheapest further measurement that would settle a diagnosis.

use nalgebra::DVector;

use super::diagnose::{Candidate, Verdict};
use crate::Result;
use crate::effects::Instance;
use crate::identify::{FrfData, StructureModel};
use crate::ingest::Axis;
use crate::robot::frf::Response;
use crate::robot::{FrfBasis, Place, Slot};

/// What to measure next, in a sentence.
pub fn advise(
    model: &StructureModel,
    data: &FrfData,
    candidates: &[Candidate],
    effect: Option<usize>,
    verdict: Verdict,
    indistinguishable: &[String],
) -> Result<String> {
    let rival = |label: &str| candidates.iter().find(|c| c.instance.label() == label);
    match (verdict, effect.map(|w| &candidates[w])) {
        (Verdict::Effect, Some(winner)) => {
            let second = indistinguishable
                .first()
                .and_then(|label| rival(label))
                .or_else(|| {
                    candidates
                        .iter()
                        .find(|c| c.instance.label() != winner.instance.label())
                });
            let Some(second) = second else {
                return Ok("none needed".into());
            };
            let purpose = if indistinguishable.is_empty() {
                "to confirm it against"
            } else {
                "to tell it from"
            };
            let place = most_different(model, data, winner, second)?;
            Ok(format!("{place}, {purpose} {}", second.instance.label()))
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

/// Where and how, among the robot's natural measurement points, two explanations differ most.
fn most_different(model: &StructureModel, data: &FrfData, a: &Candidate, b: &Candidate) -> Result<String> {
    let joints = model.robot.joint_count();
    let mut best: Option<(f64, String)> = None;
    let mut seen = Vec::new();
    for block in &data.blocks {
        if seen.contains(&block.posture) {
            continue;
        }
        seen.push(block.posture);
        let bases = [a, b].map(|c| point_basis(model, data, c.instance, &c.theta, block));
        let [first, second] = bases;
        let (first, second) = (first?, second?);
        // Outputs: tool, then the far end of each link; three axes each. Hit at the tool, in three axes.
        for out in 0..3 * (joints + 1) {
            for input in 0..3 {
                let (mut difference, mut size) = (0.0, 0.0);
                let (mut ra, mut rb) = (Response::default(), Response::default());
                for f in block.frequency_hz.iter().step_by(4) {
                    let omega = std::f64::consts::TAU * f;
                    first.solve(omega, &mut ra)?;
                    second.solve(omega, &mut rb)?;
                    let (ha, hb) = (
                        first.receptance(&ra, out, input),
                        second.receptance(&rb, out, input),
                    );
                    difference += (ha - hb).norm_sqr();
                    size += ha.norm_sqr();
                }
                let relative = if size > 0.0 {
                    (difference / size).sqrt()
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
    }
    Ok(
        best.map_or("repeat the measurement at another posture".into(), |(_, text)| {
            text
        }),
    )
}

fn point_basis(
    model: &StructureModel,
    data: &FrfData,
    instance: Instance,
    theta: &[f64],
    block: &crate::identify::frf_data::FrfBlock,
) -> Result<FrfBasis> {
    let extended = model.with_effect(instance, &data.summary());
    let chain = extended.chain(theta, &block.kinematics, block.lowness, false);
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
