//! STAND-IN, dropped at merge: just enough of the force-text readers to run the cutting side.

use std::path::Path;

use super::{Channel, ChannelRole, TimeRecord};
use crate::{Error, InputError, Result};

pub fn read_time(path: &Path) -> Result<(TimeRecord, Vec<String>)> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
    let bad = |what: &str| Error::from(InputError::new(what.to_string()).file(path));
    let mut names: Vec<String> = Vec::new();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut separator = ',';
    for line in text.lines().filter(|l| !l.trim().is_empty()) {
        let numeric = line.starts_with(|c: char| c.is_ascii_digit() || c == '-');
        if !numeric {
            separator = [';', '\t', ',']
                .into_iter()
                .find(|&s| line.contains(s))
                .unwrap_or(',');
            if line.to_ascii_lowercase().starts_with("time") {
                names = line.split(separator).map(|s| s.trim().to_string()).collect();
            }
            continue;
        }
        let row: std::result::Result<Vec<f64>, _> = line
            .split(separator)
            .map(|s| s.trim().replace(',', ".").parse())
            .collect();
        rows.push(row.map_err(|_| bad("not a number"))?);
    }
    if rows.len() < 2 || names.is_empty() || rows.iter().any(|r| r.len() != names.len()) {
        return Err(bad("no samples"));
    }
    let rate = (rows.len() - 1) as f64 / (rows[rows.len() - 1][0] - rows[0][0]);
    let channels = (1..names.len())
        .map(|j| Channel {
            name: names[j].clone(),
            file_unit: String::new(),
            role: match names[j].to_ascii_lowercase().get(..2) {
                Some("fx") => ChannelRole::ForceX,
                Some("fy") => ChannelRole::ForceY,
                Some("fz") => ChannelRole::ForceZ,
                Some("mz") => ChannelRole::TorqueZ,
                _ => ChannelRole::Other,
            },
            samples: rows.iter().map(|r| r[j]).collect(),
        })
        .collect();
    Ok((
        TimeRecord {
            sample_rate_hz: rate,
            start_s: rows[0][0],
            channels,
        },
        Vec::new(),
    ))
}
