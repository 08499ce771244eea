//! Model against force records: the steady waveform averaged over tool revolutions, in tool axes; totals, and by cut,
//! axis, speed, feed, order in the sequence and harmonic.

use num_complex::Complex64;
use serde::Serialize;

use super::compare::{ErrorTotals, Group, Groups, Sums};
use crate::campaign::Process;
use crate::cutting::ForceAxis;
use crate::identify::cutting_data::{CutData, CuttingData};
use crate::identify::cutting_problem::{ChannelFit, CutFit};

/// Model against the steady waveforms.
#[derive(Debug, Clone)]
pub struct CuttingComparison {
    pub totals: ErrorTotals,
    pub by_cut: Vec<Group>,
    pub by_axis: Vec<Group>,
    /// Cutting speed, m/min.
    pub by_speed: Vec<Group>,
    /// Feed per tooth (milling) or revolution (drilling), mm.
    pub by_feed: Vec<Group>,
    /// Milling: order of the tool's rotation, 0 the mean.
    pub by_harmonic: Vec<Harmonic>,
    pub cuts: Vec<CutError>,
}

/// Error of one order of rotation over all cuts and axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Harmonic {
    pub order: usize,
    /// Relative to the whole signal, so that the squares of all orders add up to that of the total.
    pub nrms: f64,
    pub noise_floor_nrms: f64,
}

/// Error of one cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CutError {
    pub cut: String,
    pub nrms: f64,
    pub noise_floor_nrms: f64,
    /// Weighted misfit per number compared, entry, air and lines off the comb included: 1 where only noise is left.
    pub chi2_per_value: f64,
}

/// One tool axis of one cut as sums over the waveform.
struct AxisSums {
    axis: ForceAxis,
    /// `[0]`: the mean; then the orders of rotation (milling) or nothing (drilling).
    orders: Vec<Sums>,
    /// Σ | |model| − |measured| | in dB over the orders that stand above the noise, and their number.
    decibel: (f64, usize),
}

impl CuttingComparison {
    /// `fits`: the model in each cut, in the order of `data.cuts`.
    pub fn new(data: &CuttingData, fits: &[CutFit]) -> Self {
        let mut total = Sums::default();
        let mut decibel = (0.0, 0usize);
        let [mut by_cut, mut by_axis, mut by_speed, mut by_feed] = std::array::from_fn(|_| Groups::default());
        let mut harmonics: Vec<Sums> = Vec::new();
        let mut cuts = Vec::new();
        for (cut, fit) in data.cuts.iter().zip(fits) {
            let mut own = Sums::default();
            for axis in axis_sums(data, cut, fit) {
                let mut sums = Sums::default();
                for (n, s) in axis.orders.iter().enumerate() {
                    sums.add(*s);
                    if harmonics.len() <= n {
                        harmonics.push(Sums::default());
                    }
                    harmonics[n].add(*s);
                }
                decibel.0 += axis.decibel.0;
                decibel.1 += axis.decibel.1;
                by_axis.add(axis.axis.label(), sums);
                by_speed.add(&format!("{:.1}", cut.cutting_speed_m_per_min), sums);
                by_feed.add(&format!("{}", cut.feed_mm), sums);
                own.add(sums);
            }
            by_cut.add(&cut.id, own);
            total.add(own);
            cuts.push(CutError {
                cut: cut.id.clone(),
                nrms: own.nrms(),
                noise_floor_nrms: own.floor(),
                chi2_per_value: fit.chi2 / cut.value_count().max(1) as f64,
            });
        }
        let whole = |part: f64| if total.signal > 0.0 { (part / total.signal).sqrt() } else { 0.0 };
        let milling = data.process == Process::Milling;
        CuttingComparison {
            totals: ErrorTotals {
                nrms: total.nrms(),
                mean_abs_db: if decibel.1 > 0 { decibel.0 / decibel.1 as f64 } else { 0.0 },
                noise_floor_nrms: total.floor(),
            },
            by_cut: by_cut.finish(),
            by_axis: by_axis.finish(),
            by_speed: by_speed.finish(),
            by_feed: by_feed.finish(),
            by_harmonic: harmonics
                .iter()
                .enumerate()
                .filter(|_| milling)
                .map(|(order, s)| Harmonic {
                    order,
                    nrms: whole(s.error),
                    noise_floor_nrms: whole(s.noise),
                })
                .collect(),
            cuts,
        }
    }
}

/// The tool axes that the recorded channels of a cut determine.
fn axis_sums(data: &CuttingData, cut: &CutData, fit: &CutFit) -> Vec<AxisSums> {
    let mut all = Vec::new();
    for axis in ForceAxis::ALL {
        let i = axis.index();
        // Which recorded channels make this axis, and with what weight.
        let parts: Vec<(usize, f64)> = if axis == ForceAxis::Mz {
            vec![(i, 1.0)]
        } else {
            let row = data.tool_from_dyno[i];
            let largest = row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            (0..3).filter(|j| row[*j].abs() > 1e-9 * largest).map(|j| (j, row[j])).collect()
        };
        let known = parts.iter().map(|(j, a)| Some((cut.channels[*j].as_ref()?, fit.channels[*j].as_ref()?, *a)));
        let Some(known) = known.collect::<Option<Vec<_>>>().filter(|k| !k.is_empty()) else { continue };
        let orders = known[0].1.orders.len();
        let mut sums = AxisSums {
            axis,
            orders: vec![steady(data.process, cut, &known)],
            decibel: (0.0, 0),
        };
        for n in 0..orders {
            let sum = |f: &dyn Fn(usize) -> Complex64| -> Complex64 { (0..known.len()).map(f).sum() };
            let model = sum(&|k| known[k].1.orders[n] * known[k].2);
            let measured = sum(&|k| known[k].0.orders[n] * known[k].2);
            let noise: f64 = known.iter().map(|(c, _, a)| (a * c.order_std[n]).powi(2)).sum();
            // A waveform's mean square is that of its mean plus twice those of its orders.
            sums.orders.push(Sums {
                error: 2.0 * (model - measured).norm_sqr(),
                noise: 2.0 * noise,
                signal: 2.0 * measured.norm_sqr(),
            });
            if measured.norm_sqr() > 25.0 * noise && model.norm() > 0.0 {
                sums.decibel.0 += (20.0 * (model.norm() / measured.norm()).log10()).abs();
                sums.decibel.1 += 1;
            }
        }
        all.push(sums);
    }
    all
}

/// The steady level: its mean (milling: the rest is in the orders) or its course over the hole (drilling).
fn steady(
    process: Process,
    cut: &CutData,
    known: &[(&crate::identify::cutting_data::ForceChannel, &ChannelFit, f64)],
) -> Sums {
    let n = cut.steady.len().max(1) as f64;
    let (mut error, mut signal, mut noise) = (Vec::new(), Vec::new(), 0.0);
    for b in cut.steady.clone() {
        error.push(known.iter().map(|(c, f, a)| a * (f.level[b] + f.zero[b] - c.level[b])).sum::<f64>());
        signal.push(known.iter().map(|(c, f, a)| a * (c.level[b] - f.zero[b])).sum::<f64>());
        noise += known.iter().map(|(c, _, a)| (a * c.level_std[b]).powi(2)).sum::<f64>() / n;
    }
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / n;
    match process {
        Process::Milling => Sums {
            error: mean(&error).powi(2),
            signal: mean(&signal).powi(2),
            noise: noise / n,
        },
        Process::Drilling => Sums {
            error: square(&error),
            signal: square(&signal),
            noise,
        },
    }
}
