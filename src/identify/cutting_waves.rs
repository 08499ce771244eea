//! The steady waveform, averaged over tool revolutions, as sums of squares of model against record, in tool axes.

use num_complex::Complex64;

use super::cutting_data::{CutData, CuttingData, ForceChannel};
use super::cutting_problem::{ChannelFit, CutFit};
use crate::campaign::Process;
use crate::cutting::ForceAxis;

/// Mean squares over the waveform, N²; torques as [`CuttingData::force_per_torque`] times themselves.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WaveSums {
    /// Of model − record.
    pub error: f64,
    /// Of the record's noise.
    pub noise: f64,
    /// Of the record.
    pub signal: f64,
}

/// One tool axis of one cut.
#[derive(Debug, Clone)]
pub struct AxisWaves {
    pub axis: ForceAxis,
    /// `[0]`: the level; then the orders of rotation (milling). They add up to the whole waveform.
    pub orders: Vec<WaveSums>,
    /// Σ |20 log10(|model| / |measured|)| over the orders that stand above the noise, and their number.
    pub decibel: (f64, usize),
}

/// An order this many times above its noise (power) has a magnitude worth comparing in dB.
const ABOVE_NOISE: f64 = 25.0;

/// The tool axes that the recorded channels of a cut determine.
pub fn axis_waves(data: &CuttingData, cut: &CutData, fit: &CutFit) -> Vec<AxisWaves> {
    ForceAxis::ALL
        .into_iter()
        .filter_map(|axis| one_axis(data, cut, fit, axis))
        .collect()
}

/// Recorded channel, the model on it, and its weight in the tool axis.
type Part<'a> = (&'a ForceChannel, &'a ChannelFit, f64);

fn one_axis(data: &CuttingData, cut: &CutData, fit: &CutFit, axis: ForceAxis) -> Option<AxisWaves> {
    let i = axis.index();
    let weights: Vec<(usize, f64)> = if axis == ForceAxis::Mz {
        // Force and torque in one sum: each relative to its own size.
        vec![(i, data.force_per_torque)]
    } else {
        let row = data.tool_from_dyno[i];
        let largest = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        (0..3)
            .filter(|j| row[*j].abs() > 1e-9 * largest)
            .map(|j| (j, row[j]))
            .collect()
    };
    let parts: Vec<Part> = weights
        .iter()
        .map(|(j, a)| Some((cut.channels[*j].as_ref()?, fit.channels[*j].as_ref()?, *a)))
        .collect::<Option<_>>()?;
    let orders = parts.first()?.1.orders.len();
    let mut waves = AxisWaves {
        axis,
        orders: vec![level(data.process, cut, &parts)],
        decibel: (0.0, 0),
    };
    for n in 0..orders {
        let model: Complex64 = parts.iter().map(|(_, f, a)| f.orders[n] * *a).sum();
        let measured: Complex64 = parts.iter().map(|(c, _, a)| c.orders[n] * *a).sum();
        let noise: f64 = parts.iter().map(|(c, _, a)| (a * c.order_std[n]).powi(2)).sum();
        // A waveform's mean square is that of its mean plus twice those of its orders.
        waves.orders.push(WaveSums {
            error: 2.0 * (model - measured).norm_sqr(),
            noise: 2.0 * noise,
            signal: 2.0 * measured.norm_sqr(),
        });
        if measured.norm_sqr() > ABOVE_NOISE * noise && model.norm() > 0.0 {
            waves.decibel.0 += (20.0 * (model.norm() / measured.norm()).log10()).abs();
            waves.decibel.1 += 1;
        }
    }
    Some(waves)
}

/// The steady level: its mean (milling: the rest is in the orders) or its course over the hole (drilling).
fn level(process: Process, cut: &CutData, parts: &[Part]) -> WaveSums {
    let n = cut.steady.len().max(1) as f64;
    let (mut error, mut signal, mut noise) = (Vec::new(), Vec::new(), 0.0);
    for b in cut.steady.clone() {
        error.push(
            parts
                .iter()
                .map(|(c, f, a)| a * (f.level[b] + f.reference[b] - c.level[b]))
                .sum::<f64>(),
        );
        signal.push(
            parts
                .iter()
                .map(|(c, f, a)| a * (c.level[b] - f.reference[b]))
                .sum::<f64>(),
        );
        noise += parts
            .iter()
            .map(|(c, _, a)| (a * c.level_std[b]).powi(2))
            .sum::<f64>()
            / n;
    }
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / n;
    match process {
        Process::Milling => WaveSums {
            error: mean(&error).powi(2),
            signal: mean(&signal).powi(2),
            noise: noise / n,
        },
        Process::Drilling => WaveSums {
            error: square(&error),
            signal: square(&signal),
            noise,
        },
    }
}
