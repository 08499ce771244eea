//! Measured FRFs of a robot, as receptance between its measurement points.

use std::path::PathBuf;

use num_complex::Complex64;

use super::dof::Axis;

/// All measured FRFs of a robot, in the order in which they were given.
#[derive(Debug, Clone, Default)]
pub struct FrfSet {
    /// Of all postures and force levels.
    pub frfs: Vec<MeasuredFrf>,
}

/// A direction at one of the campaign's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MeasuredDof {
    /// Index into the points of the measurement.
    pub point: usize,
    /// Axis of the frame that the point's `axes` name.
    pub axis: Axis,
    /// True where the file says −X, −Y or −Z: values hold for the negative direction.
    pub negative: bool,
}

impl MeasuredDof {
    /// Along the positive `axis` of the `point`-th point.
    pub fn new(point: usize, axis: Axis) -> Self {
        MeasuredDof {
            point,
            axis,
            negative: false,
        }
    }
}

/// One FRF as receptance.
#[derive(Debug, Clone)]
pub struct MeasuredFrf {
    /// Index into its postures.
    pub posture: usize,
    /// Where and along what the displacement is.
    pub response: MeasuredDof,
    /// Where and along what the force acts.
    pub reference: MeasuredDof,
    /// Posture and degrees of freedom, `p1 1X/1X`.
    pub name: String,
    /// Ascending, above zero.
    pub frequency_hz: Vec<f64>,
    /// Same length as `frequency_hz`.
    pub receptance_m_per_n: Vec<Complex64>,
    /// Same length as `frequency_hz`, 0..1.
    pub coherence: Option<Vec<f64>>,
    /// Level of the hammer or shaker; `None` where nobody says.
    pub force_level_n: Option<f64>,
    /// File that it was read from; empty where it is made in memory.
    pub file: PathBuf,
}

impl MeasuredFrf {
    /// An FRF in memory, named by its degrees of freedom: receptance in m/N on ascending frequencies above zero, between two
    /// of the points, at the `posture`-th posture.
    pub fn new(
        posture: usize,
        response: MeasuredDof,
        reference: MeasuredDof,
        frequency_hz: Vec<f64>,
        receptance_m_per_n: Vec<Complex64>,
    ) -> Self {
        let dof = |d: MeasuredDof| {
            let sign = if d.negative { "-" } else { "" };
            format!("{}{sign}{}", d.point + 1, d.axis.letter())
        };
        MeasuredFrf {
            posture,
            response,
            reference,
            name: format!("p{} {}/{}", posture + 1, dof(response), dof(reference)),
            frequency_hz,
            receptance_m_per_n,
            coherence: None,
            force_level_n: None,
            file: PathBuf::new(),
        }
    }
}
