//! Where two models differ most, whatever the noise: for data that have none.

use nalgebra::DVector;

use crate::Result;
use crate::data::Axis;
use crate::effects::Conditions;
use crate::identify::StructureModel;
use crate::robot::{FrfBasis, Kinematics, Place, Slot};

/// A posture at which one could measure, and the lines that are looked at there.
#[derive(Debug, Clone)]
pub struct Lookout<'a> {
    /// Its id.
    pub posture: &'a str,
    /// Where the frames are there.
    pub kinematics: &'a Kinematics,
    /// See [`crate::effects::PostureSetting`].
    pub conditions: Conditions,
    /// Lines that are looked at, Hz.
    pub frequency_hz: Vec<f64>,
}

/// An FRF on which two explanations differ.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Id of the posture.
    pub posture: String,
    /// In words: `the tool point`, `the far end of link 3`.
    pub point: String,
    /// Base axis of the response, and of the hit at the tool point.
    pub response: char,
    /// Base axis of the hit at the tool point.
    pub hit: char,
    /// Rms difference over the first one's rms.
    pub relative: f64,
}

impl Difference {
    /// In words, for people.
    pub fn sentence(&self) -> String {
        format!(
            "measure {} in base {}, hitting the tool in {}, at posture {}: the two explanations differ by {:.0} % there",
            self.point,
            self.response,
            self.hit,
            self.posture,
            100.0 * self.relative
        )
    }
}

/// The FRF (response at the tool point or a link's far end, hit at the tool) on which two models differ most. FRFs whose
/// rms is below `least_share` of the largest one's are passed over: they drown in noise. `None` without lines.
///
/// # Errors
/// A model that has no response.
pub fn greatest_difference(
    lookouts: &[Lookout],
    (a, theta_a): (&StructureModel, &[f64]),
    (b, theta_b): (&StructureModel, &[f64]),
    least_share: f64,
) -> Result<Option<Difference>> {
    let outputs = 3 * (a.robot.joint_count() + 1);
    let mut all: Vec<(f64, Difference)> = Vec::new();
    for lookout in lookouts {
        let (first, second) = (
            point_basis(a, theta_a, lookout)?,
            point_basis(b, theta_b, lookout)?,
        );
        // Outputs: tool, then the far end of each link; three axes each. Hit at the tool, in three axes.
        let mut sums = vec![(0.0, 0.0); 3 * outputs];
        for f in &lookout.frequency_hz {
            let omega = std::f64::consts::TAU * f;
            let (ra, rb) = (first.solve(omega)?, second.solve(omega)?);
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
            let point = match out / 3 {
                0 => "the tool point".into(),
                link => format!("the far end of link {link}"),
            };
            let difference = Difference {
                posture: lookout.posture.into(),
                point,
                response: Axis::ALL[out % 3].letter(),
                hit: Axis::ALL[input].letter(),
                relative: if size > 0.0 {
                    f64::sqrt(difference / size)
                } else {
                    0.0
                },
            };
            all.push((size.sqrt(), difference));
        }
    }
    let largest = all.iter().map(|(size, _)| *size).fold(0.0, f64::max);
    let mut best: Option<Difference> = None;
    for (_, difference) in all.into_iter().filter(|(size, _)| *size >= least_share * largest) {
        if best.as_ref().is_none_or(|b| difference.relative > b.relative) {
            best = Some(difference);
        }
    }
    Ok(best)
}

fn point_basis(model: &StructureModel, theta: &[f64], lookout: &Lookout) -> Result<FrfBasis> {
    let chain = model.chain(theta, lookout.kinematics, lookout.conditions, false);
    let kinematics = model.kinematics_at(theta, lookout.kinematics);
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
