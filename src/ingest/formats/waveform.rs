//! Channels of formats that say name, unit and sampling interval of each: made SI, and gathered into records.

use crate::InputError;
use crate::data::{Channel, TimeRecord};
use crate::ingest::checks;
use crate::ingest::tables::channel_names::{force_without_gain, role_of, unit_in_name, unit_label};
use crate::ingest::text::Notes;
use crate::ingest::units;

/// A channel in SI; the unit is read from its label, else from its name (`fx_n`, `Force [N]`).
///
/// # Errors
/// Samples that no sensor gives.
pub(crate) fn channel(
    name: String,
    file_unit: String,
    mut samples: Vec<f64>,
    notes: &mut Notes,
) -> Result<Channel, InputError> {
    let unit = units::parse_named(&file_unit).or_else(|| unit_in_name(&name));
    let role = role_of(&name, unit);
    let file_unit = if units::is_blank(&file_unit) {
        unit_label(&name)
    } else {
        file_unit
    };
    match force_without_gain(role, unit, &file_unit) {
        Some(told) => notes.about(&name, told),
        None if unit.is_none() => notes.about(&name, "unit unknown: values as they stand in the file"),
        None => {}
    }
    let factor = unit.map_or(1.0, |u| u.factor);
    samples.iter_mut().for_each(|v| *v *= factor);
    checks::plausible_samples(&name, &samples)?;
    Ok(Channel {
        name,
        file_unit,
        role,
        samples,
    })
}

/// Adds a channel to the record with its time axis, or begins one.
///
/// # Errors
/// A rate or start that no recorder has.
pub(crate) fn put(
    records: &mut Vec<TimeRecord>,
    sample_rate_hz: f64,
    start_s: f64,
    channel: Channel,
) -> Result<(), InputError> {
    checks::plausible_clock(&channel.name, sample_rate_hz, start_s)?;
    let same = records.iter_mut().find(|r| {
        (r.sample_rate_hz / sample_rate_hz - 1.0).abs() < 1e-9
            && r.len() == channel.samples.len()
            && r.start_s == start_s
    });
    match same {
        Some(record) => record.channels.push(channel),
        None => records.push(TimeRecord {
            filled: Vec::new(),
            sample_rate_hz,
            start_s,
            channels: vec![channel],
        }),
    }
    Ok(())
}
