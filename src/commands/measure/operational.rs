//! `lobestone modal RECORD… --output-only`: modes from responses alone.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::analysis::modes::operational::OperationalSet;
use crate::commands::text::warnings;
use crate::report::number::with_error;

/// Poles that are not taken, shown to a person; all are in the JSON.
const MOST_REJECTED: usize = 6;
/// Lines of rotating parts, likewise, the strongest.
const MOST_LINES: usize = 12;

pub fn document(sets: &[OperationalSet]) -> Value {
    let of_set = |set: &OperationalSet| {
        let found = &set.modes;
        let modes: Vec<Value> = found
            .modes
            .iter()
            .map(|mode| {
                let mut value = json!(mode);
                let shape = set.channels.iter().zip(&mode.shape);
                value["shape"] = shape
                    .map(|(channel, z)| json!({ "channel": channel, "re": z.re, "im": z.im }))
                    .collect();
                value
            })
            .collect();
        json!({
            "file": set.file,
            "channels": set.channels,
            "length_s": set.length_s,
            "modes": modes,
            "harmonics": found.harmonics,
            "rejected": found.rejected,
            "stabilisation": { "max_order": found.max_order, "poles": found.poles },
            "sample_rate_hz": found.sample_rate_hz,
            "segments": found.segments,
            "longest_lag_s": found.longest_lag_s,
        })
    };
    json!({
        "output_only": sets.iter().map(of_set).collect::<Vec<_>>(),
        "warnings": sets.iter().flat_map(|s| &s.warnings).collect::<Vec<_>>(),
    })
}

pub fn text(sets: &[OperationalSet]) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    for set in sets {
        let found = &set.modes;
        let _ = writeln!(
            out,
            "{}: modes from {} responses alone, {:.0} s, orders to {}",
            set.file,
            set.channels.len(),
            set.length_s,
            found.max_order
        );
        let _ = writeln!(out, "  {:<18}  {:<14}  orders  MPC", "f Hz", "ζ %");
        for mode in &found.modes {
            let _ = writeln!(
                out,
                "  {:<18}  {:<14}  {:<6}  {}{}",
                with_error(mode.frequency_hz, mode.frequency_std_hz),
                with_error(100.0 * mode.damping_ratio, 100.0 * mode.damping_std),
                mode.orders,
                mode.complexity.map_or("–".into(), |c| format!("{:.3}", c.mpc)),
                if mode.doubts.is_empty() { "" } else { "  doubtful" },
            );
        }
        let mut strength: Vec<f64> = found.harmonics.iter().map(|line| line.over_noise).collect();
        strength.sort_by(|a, b| b.total_cmp(a));
        let least = strength.get(MOST_LINES - 1).copied().unwrap_or(0.0);
        let shown = found.harmonics.iter().filter(|line| line.over_noise >= least);
        for line in shown.take(MOST_LINES) {
            let _ = writeln!(
                out,
                "    no mode: {}, a rotating part or hum, taken out",
                line.describe()
            );
        }
        if found.harmonics.len() > MOST_LINES {
            let _ = writeln!(
                out,
                "    … and {} weaker lines more: see --json",
                found.harmonics.len() - MOST_LINES
            );
        }
        for rejected in found.rejected.iter().take(MOST_REJECTED) {
            let _ = writeln!(
                out,
                "    not taken: {} Hz, {}",
                crate::text::hertz(rejected.frequency_hz),
                rejected.reason
            );
        }
        if found.rejected.len() > MOST_REJECTED {
            let _ = writeln!(
                out,
                "    … and {} more: see --json",
                found.rejected.len() - MOST_REJECTED
            );
        }
        out += &warnings(&set.warnings);
    }
    out
}
