//! A mistake that has a size.

use num_complex::Complex64;

use super::finding::SetupFinding;
use super::group::FrfGroup;
use super::truth::Truth;
use crate::Result;
use crate::data::{Axis, Point};
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};
use crate::robot::Kinematics;

/// One quantity of a mistake; zero means that nothing is wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MistakeSize {
    /// Standard deviation of the normal prior about zero: sizes that occur.
    pub usual: f64,
    pub bounds: [f64; 2],
}

impl MistakeSize {
    pub const fn either_way(usual: f64, most: f64) -> Self {
        MistakeSize {
            usual,
            bounds: [-most, most],
        }
    }

    pub const fn positive(usual: f64, most: f64) -> Self {
        MistakeSize {
            usual,
            bounds: [0.0, most],
        }
    }
}

/// A mistake's linear estimate for one group.
#[derive(Debug, Clone)]
pub struct Score {
    pub group: FrfGroup,
    /// Decrease of χ² that it promises.
    pub gain: f64,
    pub values: Vec<f64>,
}

/// What was estimated of a mistake.
pub struct Estimated<'a> {
    pub group: FrfGroup,
    pub values: &'a [f64],
    /// Standard errors of `values`.
    pub errors: &'a [f64],
    pub data: &'a FrfData,
    pub points: &'a [Point],
}

impl Estimated<'_> {
    /// Euclidean length of the values with its standard error.
    pub fn length(&self) -> (f64, f64) {
        let length = self.values.iter().map(|v| v * v).sum::<f64>().sqrt();
        let pairs = self.values.iter().zip(self.errors);
        let error = pairs.map(|(v, e)| (v * e).powi(2)).sum::<f64>().sqrt() / length.max(f64::MIN_POSITIVE);
        (length, error)
    }

    pub fn place(&self) -> String {
        self.group.label(self.data, self.points)
    }
}

/// Where an FRF's structure is pushed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pushed {
    /// At the reference point, along its axis.
    AlongHit,
    /// At the reference point, along all axes.
    AtHit,
    /// At reference and response point, along all axes.
    AtBothPoints,
}

/// What a mistake of given sizes does to the files. Its vanishing is `values` = 0.
pub trait Distortion: Sync + Send {
    /// The posture in truth, where campaign.toml gives `kinematics`.
    fn kinematics(&self, _values: &[f64], kinematics: &Kinematics) -> Kinematics {
        kinematics.clone()
    }

    /// The point in truth, where campaign.toml gives `point`, the `index`-th.
    fn point(&self, _values: &[f64], _index: usize, point: &Point) -> Point {
        point.clone()
    }

    /// Rate of an exponential window that was not taken out, 1/s.
    fn decay_per_s(&self, _values: &[f64]) -> f64 {
        0.0
    }

    /// True frequency over that of the file.
    fn frequency_ratio(&self, _values: &[f64]) -> f64 {
        1.0
    }

    /// What each line is the mean of: weights, and frequencies beside the line's, rad/s.
    fn spread(&self, _values: &[f64]) -> Vec<(f64, f64)> {
        vec![(1.0, 0.0)]
    }

    /// The forces whose responses [`Self::shown`] asks for.
    fn forces(&self) -> Pushed {
        Pushed::AtHit
    }

    /// What the file holds at `omega` (rad/s), m/N.
    fn shown(&self, _values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        truth.between(frf.response.axis, frf.reference.axis)
    }
}

/// A mistake whose size is estimated.
pub trait Mistake: Distortion {
    /// The quantities that are estimated.
    fn sizes(&self) -> Vec<MistakeSize>;

    /// Selections of FRFs that it may concern.
    fn groups(&self, data: &FrfData) -> Vec<FrfGroup>;

    /// Makes of what a linear estimate gives what large mistakes really are; small ones stay.
    fn beyond_the_first_order(&self, _values: &mut [f64]) {}

    /// Whether it occurs so small that a linear estimate finds it.
    fn is_ever_small(&self) -> bool {
        true
    }

    /// Sizes too large for a linear estimate, found by trying; `gain` is then no χ².
    ///
    /// # Errors
    /// A model without a response.
    fn far(&self, _model: &StructureModel, _data: &FrfData, _theta: &[f64]) -> Result<Vec<Score>> {
        Ok(Vec::new())
    }

    /// The finding, its confidence still open.
    fn finding(&self, estimated: &Estimated) -> SetupFinding;
}

/// Small rotation by `degrees` about x, y, z: row `axis` of I + [r]×, so that ⟨row, v⟩ is the turned axis' part of v.
pub(super) fn turned_axis(axis: Axis, degrees: &[f64]) -> [f64; 3] {
    let vector = nalgebra::Vector3::from_column_slice(degrees).map(f64::to_radians);
    let rotation = nalgebra::Rotation3::new(vector).into_inner();
    let column = rotation.column(axis.index());
    [column[0], column[1], column[2]]
}
