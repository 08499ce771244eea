//! Predicted FRFs with their derivatives by every parameter: what a measurement would say of them.

use std::sync::Arc;

use num_complex::Complex64;

use crate::Result;
use crate::identify::frfs::channels::Channels;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData};
use crate::identify::frfs::structure::StructureModel;

/// One FRF as a model predicts it, with its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct PredictedFrf {
    /// m/N, one a line.
    pub receptance: Vec<Complex64>,
    /// Derivatives by the parameters (solver's scale), line by line.
    slopes: Vec<Complex64>,
}

impl PredictedFrf {
    /// With one parameter.
    #[cfg(test)]
    pub fn for_test(receptance: Vec<Complex64>, slopes: Vec<Complex64>) -> Self {
        PredictedFrf { receptance, slopes }
    }

    /// dH/dp of every parameter on line `line`, m/N per unit of the solver's scale.
    pub fn slopes(&self, line: usize) -> &[Complex64] {
        let count = self.slopes.len() / self.receptance.len().max(1);
        &self.slopes[count * line..count * (line + 1)]
    }
}

impl StructureModel {
    /// Predicted receptances of the FRFs of a block, m/N, in its order.
    ///
    /// # Errors
    /// A model that has no response.
    pub fn predict_block(&self, theta: &[f64], block: &FrfBlock) -> Result<Vec<Vec<Complex64>>> {
        let data = FrfData {
            blocks: vec![Arc::new(block.clone())],
            posture_ids: Vec::new(),
        };
        self.predict(theta, &data)
    }

    /// Predictions for the FRFs of a block, in its order; its measured values and noise are not looked at.
    ///
    /// # Errors
    /// A model that has no response.
    pub fn predict_with_slopes(&self, theta: &[f64], block: &FrfBlock) -> Result<Vec<PredictedFrf>> {
        let basis = self.basis(theta, block, true)?;
        let channels = Channels::new(&self.filter(theta, true));
        let lines = block.frequency_hz.len();
        let mut slope = vec![Complex64::ZERO; theta.len()];
        let mut predicted: Vec<PredictedFrf> = block
            .frfs
            .iter()
            .map(|_| PredictedFrf {
                receptance: Vec::with_capacity(lines),
                slopes: Vec::with_capacity(lines * theta.len()),
            })
            .collect();
        basis.solve_lines_with_slopes(&block.rates(), &block.inputs(), |_, response, slopes| {
            for (frf, predicted) in block.frfs.iter().zip(&mut predicted) {
                let value = channels.measured(frf, &basis, response);
                let of_truth = slopes.along(frf.input);
                channels.slopes(frf, value, (&basis, response), of_truth, &mut slope);
                predicted.receptance.push(value);
                predicted.slopes.extend_from_slice(&slope);
            }
            Ok(())
        })?;
        Ok(predicted)
    }
}
