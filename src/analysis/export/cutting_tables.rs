//! Cutting force coefficients, and the records that they come from.

use crate::Result;
use crate::analysis::workbench::Workbench;
use crate::cutting::CfcResult;
use crate::ingest::{
    self, Channel, ColumnTable, Encoding58, NamedColumn, TimeRecord, uff58_bytes, units, variable_name,
};

/// A row a group and coefficient; the name of a coefficient has its unit.
pub(super) fn coefficient_table(result: &CfcResult) -> ColumnTable {
    let groups = result.groups.iter().map(|g| (g, "one speed"));
    let all: Vec<_> = groups
        .chain(result.pooled.iter().map(|g| (g, "all speeds")))
        .flat_map(|(g, of)| g.coefficients.iter().map(move |c| (g, of, c)))
        .collect();
    ColumnTable::new(
        "coefficients",
        vec![
            NamedColumn::text("group", all.iter().map(|(_, of, _)| of.to_string()).collect()),
            NamedColumn::text(
                "process",
                all.iter().map(|(g, ..)| g.process.name().into()).collect(),
            ),
            NamedColumn::text(
                "material",
                all.iter()
                    .map(|(g, ..)| g.material.clone().unwrap_or_default())
                    .collect(),
            ),
            NamedColumn::numbers(
                "cutting_speed",
                "m_per_min",
                all.iter().map(|(g, ..)| g.cutting_speed_m_per_min).collect(),
            ),
            NamedColumn::text("coefficient", all.iter().map(|(.., c)| c.key.into()).collect()),
            NamedColumn::text("unit", all.iter().map(|(.., c)| c.unit.into()).collect()),
            NamedColumn::known("value", "", all.iter().map(|(.., c)| c.value)),
            NamedColumn::known("std_error", "", all.iter().map(|(.., c)| c.std_error)),
        ],
    )
}

type RecordFiles = (ColumnTable, (String, Vec<u8>), Vec<String>);

/// The record of every cut as it was recorded, in SI, channels as the campaign says; with what was noticed while reading.
///
/// # Errors
/// The first record that cannot be read.
pub(super) fn record_files(campaign: &Workbench) -> Result<Vec<RecordFiles>> {
    let one = |cut: &crate::campaign::Cut| {
        let file = ingest::read_time_with(&cut.file, &campaign.channel_rules(&cut.id))?;
        let name = format!("record-{}", file_name(&cut.id));
        let universal = uff58_bytes(
            &ingest::time_datasets(&file.record),
            Encoding58 {
                binary: None,
                double: true,
            },
        );
        let table = ColumnTable::new(name.clone(), record_columns(&file.record));
        Ok((table, (name, universal), file.warnings))
    };
    campaign.cuts.iter().map(one).collect()
}

/// Letters, digits and hyphens of a cut's id.
fn file_name(id: &str) -> String {
    id.chars()
        .map(|c| if c.is_alphanumeric() { c } else { '-' })
        .collect()
}

fn record_columns(record: &TimeRecord) -> Vec<NamedColumn> {
    let time = |k: usize| record.start_s + k as f64 / record.sample_rate_hz;
    let mut columns = vec![NamedColumn::numbers(
        "time",
        "s",
        (0..record.len()).map(time).collect(),
    )];
    for channel in &record.channels {
        let (quantity, unit) = channel_name(channel);
        let mut column = NamedColumn::numbers(&quantity, unit, channel.samples.clone());
        let mut number = 1;
        while columns.iter().any(|c| c.name() == column.name()) {
            number += 1;
            column.quantity = format!("{quantity}_{number}");
        }
        columns.push(column);
    }
    columns
}

/// The channel's name as a variable's, and its unit; `as_recorded` where the unit is not known.
fn channel_name(channel: &Channel) -> (String, &'static str) {
    let known = units::parse(&channel.file_unit).and_then(|u| u.dimension.describe());
    let unit = match known.map(|(_, unit)| unit) {
        Some("s") => "s",
        Some("Hz") => "hz",
        Some("m") => "m",
        Some("m/s") => "m_per_s",
        Some("m/s²") => "m_per_s2",
        Some("N") => "n",
        Some("N·m") => "nm",
        Some("Pa") => "pa",
        Some("V") => "v",
        _ => "as_recorded",
    };
    // A name that ends with the unit, such as `Fx [N]`, says it once.
    let name = variable_name(&channel.name).to_lowercase();
    let name = name.trim_end_matches('_');
    let bare = name.strip_suffix(unit).and_then(|n| n.strip_suffix('_'));
    (bare.unwrap_or(name).to_owned(), unit)
}
