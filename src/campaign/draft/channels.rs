//! `[[channel]]` sections for force files whose columns have no names, or names that say nothing.

use super::answers::Answers;
use super::entry::{DraftTable, Entry, Kind};
use super::found::{FoundForce, cut_ids};
use super::making::Making;
use crate::Result;
use crate::ingest::{NamedForce, PlainColumn, taken_for};

/// A section for the time, where there is one, and for each signal, taken as x, y, z and torque in their order.
/// `says_times`: the files do, whatever their columns are called.
pub(super) fn channels(
    columns: &[PlainColumn],
    says_times: bool,
    answers: &Answers,
) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    let has_time = says_times || columns.first().is_some_and(PlainColumn::is_clock);
    for (place, column, name) in taken_for(columns) {
        let mut making = Making::new(answers, "channel", name, true);
        making.fact("name", Kind::Text, name);
        let at = place.to_string();
        let shows = column.describe();
        if column.is_clock() {
            match &column.name {
                Some(own) => making.fact("in_file", Kind::Text, own),
                None => making.fact("column", Kind::Whole, &at),
            }
            let unit = Entry::new(
                "unit",
                Kind::Choice(&["s", "ms"]),
                "unit of the time: s or ms",
                "s",
            );
            making.add(unit, &[(Some("s"), format!("the column {shows}").as_str())])?;
        } else {
            let (place, at) = match &column.name {
                Some(own) => (
                    Entry::new("in_file", Kind::Text, "how the file calls it", "Ch1"),
                    own,
                ),
                None => (
                    Entry::new("column", Kind::Whole, "which column it is, from 1", "1"),
                    &at,
                ),
            };
            let why = format!(
                "signals taken as fx, fy, fz, mz in their order; this one: {shows}{}",
                column.how_far()
            );
            making.add(place, &[(Some(at.as_str()), why.as_str())])?;
            let unit = Entry::new(
                "unit",
                Kind::Text,
                "unit of the values in the file: N, kN, V, mV, pC, A (counts of a converter: gain_n_per_unit instead)",
                "V",
            );
            making.add(unit, &[])?;
            let unit = making.table.entries.last().and_then(Entry::value_text);
            let is_electric = unit.is_some_and(|u| u.contains(['V', 'C']));
            making.add(if is_electric { gain() } else { gain().optional() }, &[])?;
            if !has_time && name == "fx" {
                let rate = Entry::new("rate_hz", Kind::Number, "samples a second, Hz", "10000.0");
                making.add(rate, &[])?;
            }
        }
        tables.push(making.table);
    }
    Ok(tables)
}

/// Sections for the channels of cuts that lie in one file: which of its arrays are those of which cut, and how fast they were
/// sampled where the file does not say it.
pub(super) fn channels_of_cuts(forces: &[FoundForce], answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    for (force, id) in forces.iter().zip(cut_ids(forces)) {
        for channel in force.part.iter().flat_map(|(_, channels)| channels) {
            let mut making = named(channel, answers);
            making.fact("cut", Kind::Text, &id);
            if !force.says_times {
                making.add(rate(), &[])?;
            }
            tables.push(making.table);
        }
    }
    Ok(tables)
}

/// Sections for channels that have names in files that say neither times nor a rate: the rate is what is missing.
pub(super) fn timeless(forces: &[NamedForce], answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    for (i, channel) in forces.iter().enumerate() {
        let mut making = named(channel, answers);
        if i == 0 {
            making.add(rate(), &[])?;
        }
        tables.push(making.table);
    }
    Ok(tables)
}

/// Sections for forces whose values are what the amplifier gave: its gain is what is missing.
pub(super) fn electric(forces: &[(NamedForce, String)], answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    for (channel, unit) in forces {
        let mut making = named(channel, answers);
        making.fact("unit", Kind::Text, unit);
        making.add(gain(), &[])?;
        tables.push(making.table);
    }
    Ok(tables)
}

fn gain() -> Entry {
    let of_amplifier =
        "what the amplifier makes of it, with its unit: N/V, mV/N, pC/N (none for values in N)";
    Entry::new("gain", Kind::Text, of_amplifier, "500 N/V")
}

/// A section for a channel that has a name in its file.
fn named<'a>((what, called): &NamedForce, answers: &'a Answers) -> Making<'a> {
    let mut making = Making::new(answers, "channel", what, true);
    making.fact("name", Kind::Text, what);
    making.fact("in_file", Kind::Text, called);
    making
}

fn rate() -> Entry {
    Entry::new(
        "rate_hz",
        Kind::Number,
        "samples a second, Hz (the files do not say it)",
        "10000.0",
    )
}
