//! Text exports of TwinCAT Scope (Beckhoff): lines `Key<tab>value` for every channel, then rows of its time in milliseconds and its
//! value. Several channels stand side by side, each with its own key and time. There are no column names.
//! Source: exports of 2021 and 2022; that times are milliseconds is seen from their first and last time of day.

use crate::ingest::tables::table::Header;

/// Puts column names and units into the header of such an export; leaves all others alone, and channels of different rates.
pub(crate) fn join(header: &mut Header) {
    let fields = |line: &String| -> Vec<String> { line.split('\t').map(|f| f.trim().to_owned()).collect() };
    let of_key = |key: &str| -> Option<Vec<String>> {
        // A line whose value sounds like a channel may have been taken for the names.
        let rows = header
            .lines
            .iter()
            .rev()
            .map(fields)
            .chain([header.names.clone()]);
        let mut named = rows.filter(|r| r.len() >= header.columns && r[0].eq_ignore_ascii_case(key));
        // Key and value by turns.
        let row = named.find(|r| {
            r.chunks(2)
                .all(|pair| pair[0].is_empty() || pair[0].eq_ignore_ascii_case(key))
        })?;
        Some(
            row.chunks(2)
                .filter_map(|pair| pair.get(1).cloned())
                .take(header.columns / 2)
                .collect(),
        )
    };
    let is_scope = header.columns >= 2
        && header.columns.is_multiple_of(2)
        && of_key("SymbolName").is_some()
        && of_key("Data-Type").is_some();
    let (Some(names), Some(steps)) = (of_key("Name"), of_key("SampleTime")) else {
        return;
    };
    if !is_scope || steps.windows(2).any(|w| w[0] != w[1]) || names.len() * 2 != header.columns {
        return;
    }
    let units = of_key("Unit").unwrap_or_default();
    let unit = |k: usize| {
        units
            .get(k)
            .filter(|u| *u != "(None)")
            .cloned()
            .unwrap_or_default()
    };
    let pair = |(k, name): (usize, &String)| {
        let time = if k == 0 {
            "time_ms".to_owned()
        } else {
            format!("unused {}", 2 * k + 1)
        };
        [time, name.clone()]
    };
    header.units = (0..names.len())
        .flat_map(|k| [if k == 0 { "ms".into() } else { String::new() }, unit(k)])
        .collect();
    header.names = names.iter().enumerate().flat_map(pair).collect();
}
