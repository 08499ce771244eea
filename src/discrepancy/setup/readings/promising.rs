//! Which readings are worth a fit.

use super::proposal::Proposed;
use super::table::DistanceTable;
use super::{
    axes, channel_sign, dead_channel, joint_convention, mistyped_angles, phase_conjugated, point_frame,
    point_swap, posture_swap, quantity, reciprocal,
};
use crate::Result;
use crate::discrepancy::ranking::keep_first_of_each;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;

/// Share of all disagreement that a reading must take away to be worth a fit: what is wrong in one file of many leaves
/// the others in agreement.
const WORTH_A_FIT: f64 = 0.03;
/// Relative difference of the gains of two readings of one kind that do the same: rounding.
const SAME_CHANGE: f64 = 1e-9;

/// Readings that bring the model at any of `thetas` nearer to the data, most promising first.
///
/// # Errors
/// A model that has no response.
pub fn proposed(
    model: &StructureModel,
    data: &FrfData,
    thetas: &[&[f64]],
    most: usize,
) -> Result<Vec<Proposed>> {
    let mut all: Vec<Proposed> = Vec::new();
    let kind = |p: &Proposed| p.reading.finding(data, &model.points).kind;
    for theta in thetas {
        let table = DistanceTable::new(model, data, theta)?;
        let mut here: Vec<Proposed> = Vec::new();
        // Before the axes, which have names for a sign as well.
        here.extend(channel_sign::proposed(&table, data));
        here.extend(axes::proposed(&table, data));
        here.extend(dead_channel::proposed(&table, data));
        here.extend(phase_conjugated::proposed(&table, data));
        here.extend(quantity::proposed(&table, data));
        here.extend(reciprocal::proposed(&table, data));
        here.extend(point_frame::proposed(&table, model, data, theta)?);
        here.extend(point_swap::proposed(&table, model, data, theta)?);
        here.extend(joint_convention::proposed(&table, model, data, theta)?);
        here.extend(mistyped_angles::proposed(&table, model, data, theta)?);
        here.extend(posture_swap::proposed(&table, model, data, theta)?);
        let disagreement: f64 = table.now.iter().sum();
        for proposed in &mut here {
            proposed.gain /= disagreement.max(f64::MIN_POSITIVE);
        }
        here.retain(|p| p.gain > WORTH_A_FIT);
        here.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        // What brings the model as near under two names (sensor or hammer of the other polarity) does the same to the data.
        here.dedup_by(|other, one| {
            one.gain - other.gain <= SAME_CHANGE * one.gain && kind(one) == kind(other)
        });
        here.truncate(most);
        all.extend(here);
    }
    // The same reading is proposed from several places.
    keep_first_of_each(&mut all, |p| {
        let finding = p.reading.finding(data, &model.points);
        (finding.kind, finding.place, finding.value.map(f64::to_bits))
    });
    Ok(all)
}
