//! `lobestone modal RECORD… --output-only`: modes from responses alone.

use std::fmt::Write;

use serde::Serialize;

use crate::analysis::modes::operational::OperationalSet;
use crate::commands::text::warnings;
use crate::modal::RejectedMode;
use crate::modal::operational::{Harmonic, OperationalMode};
use crate::modal::stabilisation::DiagramPole;
use crate::report::number::with_error;

/// Poles that are not taken, shown to a person; all are in the JSON.
const MOST_REJECTED: usize = 6;
/// Lines of rotating parts, likewise, the strongest.
const MOST_LINES: usize = 12;

/// What `modal --output-only` found.
#[derive(Serialize)]
pub(super) struct OperationalDocument<'a> {
    output_only: Vec<Set<'a>>,
    warnings: Vec<&'a String>,
}

impl<'a> OperationalDocument<'a> {
    pub fn new(sets: &'a [OperationalSet]) -> Self {
        OperationalDocument {
            output_only: sets.iter().map(Set::of).collect(),
            warnings: sets.iter().flat_map(|s| &s.warnings).collect(),
        }
    }
}

/// The modes of one record.
#[derive(Serialize)]
struct Set<'a> {
    file: &'a str,
    channels: &'a [String],
    length_s: f64,
    modes: Vec<Mode<'a>>,
    harmonics: &'a [Harmonic],
    rejected: &'a [RejectedMode],
    stabilisation: Poles<'a>,
    sample_rate_hz: f64,
    segments: usize,
    longest_lag_s: f64,
}

/// Poles of all orders.
#[derive(Serialize)]
struct Poles<'a> {
    max_order: usize,
    poles: &'a [DiagramPole],
}

impl<'a> Set<'a> {
    fn of(set: &'a OperationalSet) -> Self {
        let found = &set.modes;
        Set {
            file: &set.file,
            channels: &set.channels,
            length_s: set.length_s,
            modes: found
                .modes
                .iter()
                .map(|mode| Mode::of(mode, &set.channels))
                .collect(),
            harmonics: &found.harmonics,
            rejected: &found.rejected,
            stabilisation: Poles {
                max_order: found.max_order,
                poles: &found.poles,
            },
            sample_rate_hz: found.sample_rate_hz,
            segments: found.segments,
            longest_lag_s: found.longest_lag_s,
        }
    }
}

#[derive(Serialize)]
struct Mode<'a> {
    #[serde(flatten)]
    mode: &'a OperationalMode,
    shape: Vec<ChannelPart<'a>>,
}

/// One channel of a shape whose largest component is 1.
#[derive(Serialize)]
struct ChannelPart<'a> {
    channel: &'a str,
    re: f64,
    im: f64,
}

impl<'a> Mode<'a> {
    fn of(mode: &'a OperationalMode, channels: &'a [String]) -> Self {
        let shape = channels.iter().zip(&mode.shape);
        Mode {
            mode,
            shape: shape
                .map(|(channel, z)| ChannelPart {
                    channel,
                    re: z.re,
                    im: z.im,
                })
                .collect(),
        }
    }
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
