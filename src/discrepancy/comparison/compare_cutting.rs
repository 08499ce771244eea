//! Model against force records: the steady waveform averaged over tool revolutions, in tool axes; totals, and by cut,
//! axis, speed, feed, order in the sequence and harmonic.

use serde::Serialize;

use crate::data::Process;
use crate::discrepancy::comparison::error_sums::{ErrorTotals, GroupError, Groups, Sums};
use crate::discrepancy::comparison::place;
use crate::identify::forces::cutting_data::CuttingData;
use crate::identify::forces::cutting_problem::CutFit;
use crate::identify::forces::cutting_waves::axis_waves;

/// Model against the steady waveforms.
#[derive(Debug, Clone)]
pub struct CuttingComparison {
    /// Over everything.
    pub totals: ErrorTotals,
    /// One a cut, in the order of the data.
    pub by_cut: Vec<GroupError>,
    /// One a tool axis.
    pub by_axis: Vec<GroupError>,
    /// Cutting speed, m/min.
    pub by_speed: Vec<GroupError>,
    /// Feed per tooth (milling) or revolution (drilling), mm.
    pub by_feed: Vec<GroupError>,
    /// Milling: order of the tool's rotation, 0 the mean.
    pub by_harmonic: Vec<HarmonicError>,
    /// Place in the sequence of cuts, as the campaign has it; first cut first, empty where it does not say.
    pub by_order: Vec<GroupError>,
    /// One a cut, with what only cuts have.
    pub cuts: Vec<CutError>,
    /// Where the error sits, in words: the axis, order of rotation and cuts that hold most of what stands above the noise.
    pub mostly: Option<String>,
}

/// Error of one order of rotation over all cuts and axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HarmonicError {
    /// Multiple of the rotation; 0 is the mean.
    pub order: usize,
    /// Relative to the whole signal, so that the squares of all orders add up to that of the total.
    pub nrms: f64,
    /// The same of a perfect model.
    pub noise_floor_nrms: f64,
}

/// Error of one cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CutError {
    /// Its id.
    pub cut: String,
    /// Error over the signal.
    pub nrms: f64,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
    /// Weighted misfit per number compared, entry, air and lines off the comb included: 1 where only noise is left.
    pub chi2_per_value: f64,
    /// By tool axis: error in multiples of the noise; `None` where there is no noise to compare with.
    pub times_noise: Vec<(String, Option<f64>)>,
}

impl CuttingComparison {
    /// `fits`: the model in each cut, in the order of `data.cuts`.
    pub fn new(data: &CuttingData, fits: &[CutFit]) -> Self {
        let mut total = Sums::default();
        let mut decibel = (0.0, 0usize);
        let [mut by_cut, mut by_axis, mut by_speed, mut by_feed, mut by_order] =
            std::array::from_fn(|_| Groups::default());
        let mut harmonics: Vec<Sums> = Vec::new();
        let mut cuts = Vec::new();
        let mut cells: Vec<(String, String, usize, Sums)> = Vec::new();
        for (cut, fit) in data.cuts.iter().zip(fits) {
            let mut own = Sums::default();
            let mut times_noise = Vec::new();
            for axis in axis_waves(data, cut, fit) {
                let mut sums = Sums::default();
                for (n, wave) in axis.orders.iter().enumerate() {
                    let s = Sums {
                        error: wave.error,
                        noise: wave.noise,
                        signal: wave.signal,
                        ..Sums::default()
                    };
                    sums.add(s);
                    if harmonics.len() <= n {
                        harmonics.push(Sums::default());
                    }
                    harmonics[n].add(s);
                    cells.push((cut.id.clone(), axis.axis.label().to_string(), n, s));
                }
                decibel.0 += axis.decibel.0;
                decibel.1 += axis.decibel.1;
                by_axis.add(axis.axis.label(), sums);
                by_speed.add(&format!("{:.1}", cut.cutting_speed_m_per_min), sums);
                by_feed.add(&format!("{}", cut.feed_mm), sums);
                times_noise.push((
                    axis.axis.label().to_string(),
                    (sums.noise > 0.0).then(|| (sums.error / sums.noise).sqrt()),
                ));
                own.add(sums);
            }
            by_cut.add(&cut.id, own);
            if let Some(order) = cut.order {
                by_order.add(&order.to_string(), own);
            }
            total.add(own);
            cuts.push(CutError {
                cut: cut.id.clone(),
                nrms: own.nrms(),
                noise_floor_nrms: own.floor(),
                chi2_per_value: fit.chi2 / cut.value_count().max(1) as f64,
                times_noise,
            });
        }
        let whole = |part: f64| {
            if total.signal > 0.0 {
                (part / total.signal).sqrt()
            } else {
                0.0
            }
        };
        let milling = data.process == Process::Milling;
        CuttingComparison {
            mostly: place::of_cuts(&cells, milling),
            totals: ErrorTotals {
                nrms: total.nrms(),
                mean_abs_db: if decibel.1 > 0 {
                    decibel.0 / decibel.1 as f64
                } else {
                    0.0
                },
                noise_floor_nrms: total.floor(),
            },
            by_cut: by_cut.finish(),
            by_axis: by_axis.finish(),
            by_speed: by_speed.finish(),
            by_feed: by_feed.finish(),
            by_order: {
                let mut groups = by_order.finish();
                groups.sort_by_key(|g| g.name.parse::<i64>().unwrap_or(i64::MAX));
                groups
            },
            by_harmonic: harmonics
                .iter()
                .enumerate()
                .filter(|_| milling)
                .map(|(order, s)| HarmonicError {
                    order,
                    nrms: whole(s.error),
                    noise_floor_nrms: whole(s.noise),
                })
                .collect(),
            cuts,
        }
    }
}
