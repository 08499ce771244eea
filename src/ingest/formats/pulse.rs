//! Text exports of PULSE LabShop (Brüel & Kjær): some eighty lines `Key:<tab>value`, then rows of a running number, the
//! abscissa, and one value or a real and an imaginary part. There are no column names: the lines say what the columns are.
//! Source: exports of version 15.1.

use std::collections::HashMap;

use crate::InputError;
use crate::data::Dof;
use crate::ingest::tables::table::Header;

/// Puts column names and units into the header of such an export, so that it is a table like others; leaves all others alone.
///
/// # Errors
/// Where the file holds a function that is neither a frequency response nor a signal over time.
pub(crate) fn join(header: &mut Header) -> Result<(), InputError> {
    let starts = |line: &String| {
        let key = line.split(':').next().unwrap_or_default();
        key.trim().eq_ignore_ascii_case("pulse version")
    };
    if !header.names.is_empty() || !header.lines.iter().any(starts) {
        return Ok(());
    }
    let said: HashMap<String, String> = header
        .lines
        .iter()
        .filter_map(|line| line.split_once(':'))
        .map(|(key, value)| (key.trim().to_lowercase(), value.trim().to_owned()))
        .filter(|(_, value)| !value.is_empty())
        .collect();
    let get = |key: &str| said.get(key).map_or("", String::as_str);
    let is_complex = get("data type").eq_ignore_ascii_case("complex");
    let values: &[&str] = if is_complex { &["re", "im"] } else { &["value"] };
    let Some(before) = header.columns.checked_sub(values.len() + 1).filter(|n| *n <= 1) else {
        return Ok(());
    };
    let (function, over) = (get("function"), get("x-axis unit"));
    let unit = get("amplitudeunit");
    let unit = if unit.is_empty() { get("signalunit") } else { unit };
    let is_response = function.to_lowercase().contains("frequency response");
    // The running number has no meaning.
    let mut names = vec![String::from("line"); before];
    let mut units = vec![String::new(); before];
    if is_complex && is_response && over.eq_ignore_ascii_case("hz") {
        names.extend(["frequency_hz", "re", "im"].map(String::from));
        units.extend(["Hz", unit, unit].map(String::from));
        for (name, key) in [("Reference", "ref_signal"), ("Response", "signal")] {
            if let Ok(dof) = get(key).parse::<Dof>() {
                header.lines.insert(0, format!("{name}: {dof}"));
            }
        }
    } else if !is_complex && over.eq_ignore_ascii_case("s") {
        let signal = get("signal");
        names.extend(["time_s", if signal.is_empty() { "signal" } else { signal }].map(String::from));
        units.extend(["s", unit].map(String::from));
    } else {
        let of = if function.is_empty() {
            "an unnamed function"
        } else {
            function
        };
        return Err(InputError::new(format!(
            "a PULSE export of {of} over {}: no frequency response with real and imaginary part, and no signal over time",
            if over.is_empty() { "an unnamed axis" } else { over }
        ))
        .remedy("in PULSE: export the frequency response H1 as complex values, or the time signals"));
    }
    header.columns = names.len();
    (header.names, header.units) = (names, units);
    Ok(())
}
