//! A mistake without a size: the data are read another way.

use super::finding::SetupFinding;
use crate::data::Point;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;

/// Another reading of the files.
pub trait FileReading: Send + Sync {
    /// The data as they are if this reading is right.
    fn corrected(&self, data: &FrfData) -> FrfData {
        data.clone()
    }

    /// The points as they are if this reading is right.
    fn points(&self, points: &[Point]) -> Vec<Point> {
        points.to_vec()
    }

    /// The finding, its confidence still open.
    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding;

    /// How many readings of the same sort were looked at: what chance has to be allowed for.
    fn tried(&self) -> f64 {
        50.0
    }
}

/// The model with the points as they are if `reading` is right.
pub fn model_read(model: &StructureModel, reading: &dyn FileReading) -> StructureModel {
    let read = model.without_start();
    read.with_fixed(|fixed| fixed.points = reading.points(&model.points))
}
