//! Tables without names: what is in them, and what to write so that they get names.

use super::text::Notes;
use super::units;
use crate::ingest::tables::table::Header;

/// What a table without names holds, and the lines of `campaign.toml` that give it names.
pub(super) fn preview(bytes: &[u8], header: &Header) -> (String, String) {
    const ROWS: usize = 2000;
    let end = bytes[header.data_at..]
        .iter()
        .enumerate()
        .filter(|(_, b)| **b == b'\n')
        .nth(ROWS)
        .map_or(bytes.len(), |(i, _)| header.data_at + i + 1);
    let columns = header
        .read(&bytes[..end], None, &mut Notes::default())
        .map_or_else(|_| Vec::new(), |t| t.columns);
    let even = |values: &[f64]| -> Option<f64> {
        let [first, .., last] = values else { return None };
        let step = (last - first) / (values.len() - 1) as f64;
        let is_even = values
            .iter()
            .enumerate()
            .all(|(i, v)| (first + i as f64 * step - v).abs() <= 0.51 * step);
        (step > 0.0 && values.len() > 3 && is_even).then_some(step)
    };
    let mut seen = Vec::new();
    let mut lines = String::new();
    let mut forces = ["fx", "fy", "fz", "mz"].into_iter();
    let mut has_time = false;
    for (i, values) in columns.iter().enumerate() {
        let (low, high) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(*v), b.max(*v))
            });
        let step = even(values).filter(|_| i == 0);
        seen.push(match step {
            Some(step) => format!("1: rises by {} (time?)", units::figures(step, 4)),
            None => format!(
                "{}: {} to {}",
                i + 1,
                units::figures(low, 4),
                units::figures(high, 4)
            ),
        });
        has_time |= step.is_some();
        let name = if step.is_some() {
            Some("time")
        } else {
            forces.next()
        };
        if let Some(name) = name {
            let gain = if name == "time" {
                "unit = \"s\""
            } else {
                "unit = \"V\"\ngain = \"500 N/V\""
            };
            lines += &format!("\n[[channel]]\nname = \"{name}\"\ncolumn = {}\n{gain}", i + 1);
            if !has_time {
                lines += "\nrate_hz = 10000.0";
                has_time = true;
            }
        }
    }
    let what = format!(
        "{} columns of numbers without names ({})",
        header.columns,
        seen.join("; ")
    );
    let remedy = format!(
        "put a line of column names on top (frequency_hz,re,im or time_s,fx_n,fy_n,fz_n), or, for forces, say in campaign.toml \
         what they are, such as{lines}"
    );
    (what, remedy)
}
