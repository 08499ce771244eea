//! How far model and data are apart, FRF by FRF, for every way of reading axes, sign and phase.

use num_complex::Complex64;

use super::super::group::FrfGroup;
use super::super::scene::{Curves, predict_all_axes};
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// Predictions between all axes of every FRF's points.
pub struct DistanceTable {
    /// [response axis][reference axis], curves in the order of the data; the sign of the file's axes is in.
    pub between: [[Curves; 3]; 3],
    /// Distance as recorded, one an FRF.
    pub now: Vec<f64>,
}

/// Σ |m − h|² / (|m|² + |h|² + 2σ²) over the lines: 0 where they agree, 1 for a line of another size, 2 for the opposite
/// sign. No line counts more than another, so that peaks away from their places and large values do not decide.
pub fn distance(model: impl Iterator<Item = Complex64>, frf: &FrfDatum) -> f64 {
    let lines = model.zip(&frf.receptance).zip(&frf.noise_std);
    lines
        .map(|((m, h), std)| (m - h).norm_sqr() / (m.norm_sqr() + h.norm_sqr() + 2.0 * std * std))
        .sum()
}

impl DistanceTable {
    pub fn new(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Self> {
        let between = predict_all_axes(model, theta, data)?;
        let now = data
            .frfs()
            .enumerate()
            .map(|(i, (_, frf))| {
                let own = &between[frf.response.axis.index()][frf.reference.axis.index()][i];
                distance(own.iter().copied(), frf)
            })
            .collect();
        Ok(DistanceTable { between, now })
    }

    /// The model's curve for the `i`-th FRF as recorded.
    pub fn own<'a>(&'a self, i: usize, frf: &FrfDatum) -> &'a [Complex64] {
        &self.between[frf.response.axis.index()][frf.reference.axis.index()][i]
    }

    /// How much nearer the FRFs of `group` come with `distance` (of the index and the FRF) in place of the present one.
    pub fn gain(&self, data: &FrfData, group: &FrfGroup, distance: impl Fn(usize, &FrfDatum) -> f64) -> f64 {
        let frfs = data.frfs().enumerate().filter(|(_, (_, f))| group.holds(f));
        frfs.map(|(i, (_, frf))| self.now[i] - distance(i, frf)).sum()
    }

    /// How much nearer the FRFs that a reading concerns come with what the model then predicts: `curves` in the order of the data.
    pub fn gain_by_curves(
        &self,
        data: &FrfData,
        curves: &Curves,
        concerns: impl Fn(&FrfDatum) -> bool,
    ) -> f64 {
        let frfs = data.frfs().zip(curves).enumerate();
        frfs.filter(|(_, ((_, frf), _))| concerns(frf))
            .map(|(i, ((_, frf), curve))| self.now[i] - distance(curve.iter().copied(), frf))
            .sum()
    }
}
