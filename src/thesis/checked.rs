//! What can be checked of any way to explain the thesis' tables, of what no fit saw too.

use serde::Serialize;

use super::published::{RECURRING_BANDS, STATIC_STIFFNESS, StaticRow, rows};
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::resonances::resonance_study::ResonanceStudy;
use crate::robot::{PostureReport, posture_deg};

/// A resonance whose mode is within this many standard deviations, frequency and size together, has found its own.
const CLOSE_SIGMAS: f64 = 2.0;
/// A joint farther from its published stiffness than this many standard deviations of its tolerance (a factor of 2.5 where
/// the tolerance is 0.3) is no longer that joint: what a model reaches by that is not explained.
const CREDIBLE_SIGMAS: f64 = 3.0;

/// How a model with a solution meets the tables.
#[derive(Debug, Clone, Serialize)]
pub struct Checked {
    /// Resonances that have a mode within four standard deviations, of all.
    pub met: usize,
    /// The bands of recurring resonances.
    pub bands: Vec<BandCheck>,
    /// Static stiffness at the flange, model over measurement, least and greatest: never fitted.
    pub static_ratio: [f64; 2],
    /// The joint that had to be moved farthest for that; `None` without a tolerance to measure it by.
    pub farthest_joint: Option<FarthestJoint>,
}

/// A band of recurring resonances in one explanation.
#[derive(Debug, Clone, Serialize)]
pub struct BandCheck {
    /// Lower end of the band, Hz.
    pub from_hz: f64,
    /// Upper end of the band, Hz.
    pub to_hz: f64,
    /// Resonances measured in the band.
    pub measured: usize,
    /// Those that have a mode within four standard deviations.
    pub met: usize,
    /// Those that have a mode within two: near enough to be theirs rather than just the nearest.
    pub close: usize,
    /// More than half are close, and no joint is farther from its published stiffness than is credible.
    pub explained: bool,
}

/// The joint that a fit has moved farthest from its published stiffness.
#[derive(Debug, Clone, Serialize)]
pub struct FarthestJoint {
    /// Such as `joint-5.stiffness`.
    pub name: String,
    /// Fitted over published stiffness.
    pub factor: f64,
    /// |ln factor| in standard deviations of the robot file's tolerance.
    pub sigmas: f64,
}

impl FarthestJoint {
    /// Whether one still believes the published value to be that of this robot.
    pub fn is_credible(&self) -> bool {
        self.sigmas <= CREDIBLE_SIGMAS
    }
}

/// Checks a model at `theta` (solver's scale).
pub(super) fn checked(study: &ResonanceStudy, model: &StructureModel, theta: &[f64]) -> Result<Checked> {
    let matches = study.matches(model, theta)?;
    let pairs = || study.resonances().iter().zip(&matches);
    let farthest_joint = farthest_joint(model, theta);
    let credible = farthest_joint.as_ref().is_none_or(FarthestJoint::is_credible);
    let bands = RECURRING_BANDS.iter().map(|&(from_hz, to_hz)| {
        let inside =
            || pairs().filter(move |(r, _)| r.readings_hz[0] <= to_hz && r.readings_hz[1] >= from_hz);
        let measured = inside().count();
        let close = inside()
            .filter(|(_, m)| m.distance2 <= CLOSE_SIGMAS * CLOSE_SIGMAS)
            .count();
        BandCheck {
            from_hz,
            to_hz,
            measured,
            met: inside().filter(|(_, m)| m.is_there()).count(),
            close,
            explained: credible && 2 * close > measured,
        }
    });
    Ok(Checked {
        met: pairs().filter(|(_, m)| m.is_there()).count(),
        bands: bands.collect(),
        static_ratio: static_ratio(model, theta)?,
        farthest_joint,
    })
}

fn farthest_joint(model: &StructureModel, theta: &[f64]) -> Option<FarthestJoint> {
    let joints = model
        .parameters
        .iter()
        .zip(theta)
        .filter_map(|(parameter, theta)| {
            let prior = parameter
                .prior
                .filter(|_| parameter.name.starts_with("joint-") && parameter.name.ends_with(".stiffness"))?;
            let factor = parameter.natural(*theta) / parameter.nominal;
            Some(FarthestJoint {
                name: parameter.name.clone(),
                factor,
                sigmas: factor.ln().abs() / prior.std,
            })
        });
    joints.max_by(|a, b| a.sigmas.total_cmp(&b.sigmas))
}

/// Flange stiffness where it was measured, model over measurement: least and greatest.
fn static_ratio(model: &StructureModel, theta: &[f64]) -> Result<[f64; 2]> {
    let mut range = [f64::INFINITY, 0.0f64];
    for row in rows::<StaticRow>(STATIC_STIFFNESS)? {
        let kinematics = model.robot.kinematics(&posture_deg(&row.posture)?)?;
        let chain = model.chain(theta, &kinematics, Default::default(), false);
        let stiffness = PostureReport::new(&model.robot, &kinematics, &chain)?.flange_stiffness_n_per_m;
        for (axis, measured) in [row.kx_measured_n_per_m, row.ky_measured_n_per_m]
            .into_iter()
            .enumerate()
        {
            if let Some(measured) = measured {
                let ratio = stiffness[axis] / measured;
                range = [range[0].min(ratio), range[1].max(ratio)];
            }
        }
    }
    Ok(range)
}
