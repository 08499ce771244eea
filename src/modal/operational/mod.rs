//! Output-only (operational) modal analysis: modes of a structure from its motion alone, while it idles or cuts.
//!
//! Covariance-driven stochastic subspace identification with reference channels (Peeters & De Roeck 1999): correlations
//! of the responses → Hankel matrix → singular vectors → poles of many orders → the ones that stay. Standard deviations
//! come from the scatter of the correlations between segments of the record, carried through to every pole to first
//! order (Reynders, Pintelon & De Roeck 2008; Döhler & Mevel 2013), and from the scatter of a pole over the orders.
//!
//! The excitation must be broad-band. A spindle is not: its harmonics are recognised beforehand as lines that are
//! narrower than any mode, taken out, and told; what wavers too much for that is recognised by its constant envelope.

use rayon::prelude::*;
use serde::Serialize;

use super::stabilisation::DiagramPole;
use crate::modal::together::global_modes::RejectedMode;
use crate::{InputError, Result};

mod chains;
mod correlation;
mod event;
mod harmonics;
mod mode;
mod record;
mod resample;
mod subspace;
#[cfg(test)]
mod tests;

pub use harmonics::Harmonic;
pub use mode::OperationalMode;
pub use record::OperationalRecord;

/// What to look at, and how far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OperationalSettings {
    /// From, to in Hz; up to 0.4 times the sampling rate where `None`.
    pub band_hz: Option<[f64; 2]>,
    /// Highest model order (two a mode); from the number of channels and samples where `None`.
    pub max_order: Option<usize>,
    /// Speed of the spindle, 1/min; its harmonics are then named by it.
    pub spindle_rpm: Option<f64>,
}

/// What a record of responses says.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct OperationalModes {
    /// Ascending in frequency.
    pub modes: Vec<OperationalMode>,
    /// Lines of rotating parts, ascending in frequency; taken out before the modes were sought.
    pub harmonics: Vec<Harmonic>,
    /// What resembled a mode but is not one; ascending in frequency.
    pub rejected: Vec<RejectedMode>,
    /// Poles of all orders.
    pub poles: Vec<DiagramPole>,
    /// Highest model order.
    pub max_order: usize,
    /// Sampling rate after thinning, Hz.
    pub sample_rate_hz: f64,
    /// Segments of the record whose scatter gives the standard deviations.
    pub segments: usize,
    /// Longest lag of the correlations, s.
    pub longest_lag_s: f64,
    /// What changes the result, in words.
    pub warnings: Vec<String>,
}

/// Modes from responses alone.
///
/// # Errors
/// Channels of different length or with values that are not finite, a channel without any motion, a record too short or whose motion
/// is one brief event, a band outside what was sampled.
pub fn operational_modes(
    record: &OperationalRecord,
    settings: &OperationalSettings,
) -> Result<OperationalModes> {
    check(record)?;
    let half_rate = 0.5 * record.sample_rate_hz;
    let band_hz = settings
        .band_hz
        .unwrap_or([0.0, resample::USABLE * record.sample_rate_hz]);
    if !(band_hz[1] > band_hz[0] && band_hz[0] < half_rate) {
        return Err(InputError::new(format!(
            "the band {}–{} Hz lies outside what was sampled (up to {half_rate} Hz)",
            band_hz[0], band_hz[1]
        ))
        .remedy("give a band below half the sampling rate")
        .into());
    }
    let band_hz = [band_hz[0], band_hz[1].min(0.96 * half_rate)];
    let (mut channels, rate_hz): (Vec<Vec<f64>>, f64) = resample::thinned(record, band_hz[1]);
    let mut result = OperationalModes {
        sample_rate_hz: rate_hz,
        ..OperationalModes::default()
    };
    let motion = event::motion(&channels);
    if let Some(event) = motion.as_ref().and_then(event::one_event) {
        let seconds = channels.first().map_or(0, Vec::len) as f64 / rate_hz;
        return Err(InputError::new(format!(
            "the motion is one event: nearly all of it lies between {:.2} and {:.2} s of {seconds:.2} s (a release, a drop, a single hit)",
            event[0] * seconds,
            event[1] * seconds
        ))
        .remedy(
            "modes from responses alone need motion that lasts: leave the quiet part out of the file if the machine ran only then; for \
             a hit, record the hammer's force as well and run `lobestone modal` without --output-only",
        )
        .into());
    }
    let changes = motion.as_ref().and_then(event::level_changes);
    result.harmonics = harmonics::take_out(&mut channels, rate_hz, band_hz, settings.spindle_rpm);
    let scale: Vec<f64> = channels.iter().map(|c| rms(c)).collect();
    if let Some(still) = scale.iter().position(|s| !(*s > 0.0)) {
        return Err(InputError::new(format!("channel {} does not move", still + 1))
            .remedy("leave the channel out")
            .into());
    }
    for (channel, scale) in channels.iter_mut().zip(&scale) {
        channel.iter_mut().for_each(|x| *x /= scale);
    }
    let plan = correlation::Plan::new(&channels, settings.max_order)?;
    result.max_order = plan.max_order;
    result.segments = plan.segments;
    result.longest_lag_s = plan.lags() as f64 / rate_hz;
    let correlations = correlation::of_segments(&channels, &plan);
    let mut orders = subspace::orders(&correlations, &plan, rate_hz, band_hz)?;
    for pole in orders.iter_mut().flat_map(|order| &mut order.poles) {
        pole.differentiate(record.differentiations);
    }
    let chains = chains::follow(&orders, &mut result.poles);
    let (modes, rejected) = chains::choose(&chains, plan.orders().len(), channels.len());
    let spectra = harmonics::Spectra::new(&channels, rate_hz);
    result.rejected = rejected;
    for mut mode in modes {
        if let Some(reason) = harmonics::is_line(&mode, &result.harmonics, &spectra) {
            result.rejected.push(RejectedMode {
                frequency_hz: mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                reason,
            });
            continue;
        }
        let half_width = mode.damping_ratio * mode.frequency_hz;
        let inside: Vec<String> = result
            .harmonics
            .iter()
            .filter(|h| (h.frequency_hz - mode.frequency_hz).abs() < half_width)
            .map(|h| format!("{:.2} Hz", h.frequency_hz))
            .collect();
        if !inside.is_empty() {
            mode.doubts.push(format!(
                "a rotating part's line lies within its half-power band ({}): it was taken out, what wavers of it remains",
                inside.join(", ")
            ));
        }
        mode.doubts
            .extend(harmonics::doubt(&mode, &result.harmonics, settings.spindle_rpm));
        for (z, scale) in mode.shape.iter_mut().zip(&scale) {
            *z *= *scale;
        }
        mode.shape = super::shape::normalised(&mode.shape);
        mode.complexity = super::shape::complexity(&mode.shape);
        result.modes.push(mode);
    }
    result
        .rejected
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    result.warnings = warnings(&result);
    if let Some(changes) = changes {
        let seconds = channels.first().map_or(0, Vec::len) as f64 / rate_hz;
        result.warnings.push(format!(
            "the motion is {:.0} times as large between {:.1} and {:.1} s as in the rest of the record (a cut and the air around it?): \
             the modes are those of the loud stretch, the standard deviations suffer; a record of one kind is better",
            changes.times,
            changes.loud[0] * seconds,
            changes.loud[1] * seconds
        ));
    }
    Ok(result)
}

fn check(record: &OperationalRecord) -> Result<()> {
    let Some(first) = record.channels.first() else {
        return Err(InputError::new("a record without a response channel").into());
    };
    if !(record.sample_rate_hz > 0.0) || record.channels.iter().any(|c| c.len() != first.len()) {
        return Err(InputError::new("the channels of the record are not of one length and rate").into());
    }
    if !record
        .channels
        .par_iter()
        .all(|c| c.iter().all(|x| x.is_finite()))
    {
        return Err(InputError::new("the record holds values that are not numbers").into());
    }
    Ok(())
}

fn warnings(found: &OperationalModes) -> Vec<String> {
    let mut warnings = Vec::new();
    if found.modes.is_empty() {
        warnings.push("no pole stays over the orders with a scatter small enough to call it a mode".into());
    }
    if !found.harmonics.is_empty() {
        let named: Vec<String> = found.harmonics.iter().take(6).map(Harmonic::describe).collect();
        let more = found.harmonics.len().saturating_sub(6);
        warnings.push(format!(
            "{} narrow lines are no modes but rotating parts or hum, taken out: {}{}",
            found.harmonics.len(),
            named.join(", "),
            if more > 0 {
                format!(" and {more} more")
            } else {
                String::new()
            }
        ));
    }
    let few = found.modes.iter().filter(|m| !m.doubts.is_empty());
    warnings.extend(few.map(|m| format!("{:.2} Hz: {}", m.frequency_hz, m.doubts.join("; "))));
    warnings
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}
