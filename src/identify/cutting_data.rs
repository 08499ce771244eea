//! Force records arranged for fitting a waveform: order spectra of the steady cut, levels of air and cut, lines off the
//! tooth-passing comb, each with its noise.

use std::ops::Range;
use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;

use super::off_comb::{OffComb, find_vibration};
use crate::campaign::{Campaign, Process};
use crate::cutting::waveform::{DrillingCut, MillingCut, UnitForces};
use crate::cutting::{CutAnalysis, ForceAxis, analyse_cut, feed_mm};
use crate::effects::cutting::{CutSetting, CuttingSummary};
use crate::ingest::{ChannelRole, TimeRecord};
use crate::progress::Progress;
use crate::signal::{highest_order, line_amplitude, mean_between, order_spectrum};
use crate::{Error, InputError, Result, ingest};

/// One recorded channel of one cut.
#[derive(Debug, Clone)]
pub struct ForceChannel {
    /// Orders 1..=K of the steady waveform, N (N·m); angle zero at the window's first sample.
    pub orders: Vec<Complex64>,
    /// Root of E|noise|² of each.
    pub order_std: Vec<f64>,
    /// Mean of each block of the record, N (N·m), drift and all.
    pub level: Vec<f64>,
    pub level_std: Vec<f64>,
    /// ∫ (recorded − straight zero line) dt up to the middle of each block: what a leaking amplifier loses times its
    /// time constant.
    pub integral: Vec<f64>,
}

/// What was cut.
#[derive(Debug, Clone)]
pub enum CutKind {
    Milling {
        cut: MillingCut,
        /// Closed-form forces for one unit of each coefficient, up to the cut's highest order.
        unit: Box<UnitForces>,
    },
    Drilling {
        cut: DrillingCut,
        /// First contact lies in here, s.
        contact_s: [f64; 2],
    },
}

/// One cut as data.
#[derive(Debug, Clone)]
pub struct CutData {
    /// Index into `Campaign::cuts`.
    pub cut: usize,
    pub id: String,
    pub spindle_rpm: f64,
    pub cutting_speed_m_per_min: f64,
    /// Per tooth (milling), per revolution (drilling).
    pub feed_mm: f64,
    pub setting: CutSetting,
    pub kind: CutKind,
    /// Recorded x, y, z, torque; `None` where there is no usable channel or the process puts no force on it.
    pub channels: [Option<ForceChannel>; 4],
    /// Highest order of the spectra; 0 for drilling.
    pub orders: usize,
    /// Start and end of each block, s from the middle of the record.
    pub block_s: Vec<[f64; 2]>,
    /// Blocks of full engagement.
    pub steady: Range<usize>,
    pub vibration: Option<OffComb>,
}

impl CutData {
    pub fn spindle_hz(&self) -> f64 {
        self.spindle_rpm / 60.0
    }

    /// Numbers compared in this cut, less the zero lines and the phase (or contact) fitted to it.
    pub fn value_count(&self) -> usize {
        let channels = self.channels.iter().flatten();
        let own: usize = channels.map(|c| (2 * c.orders.len() + c.level.len()).saturating_sub(2)).sum();
        (own + self.vibration.as_ref().map_or(0, OffComb::value_count)).saturating_sub(1)
    }
}

/// The cuts of one process.
#[derive(Debug, Clone)]
pub struct CuttingData {
    pub process: Process,
    pub cuts: Vec<Arc<CutData>>,
    /// F_tool = A F_recorded, and its inverse.
    pub tool_from_dyno: [[f64; 3]; 3],
    pub dyno_from_tool: [[f64; 3]; 3],
    pub summary: CuttingSummary,
    /// Cuts left out, with the reason.
    pub warnings: Vec<String>,
}

/// Orders kept for each tooth, and in all.
const ORDERS_PER_TOOTH: usize = 24;
const MOST_ORDERS: usize = 96;
const MOST_STEADY_BLOCKS: usize = 40;
const MOST_AIR_BLOCKS: usize = 20;
const MOST_DRILLING_BLOCKS: usize = 120;
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Processes of the campaign's cuts, the one with more cuts first.
pub fn processes(campaign: &Campaign) -> Vec<Process> {
    let count = |p| campaign.cuts.iter().filter(|c| c.geometry.process() == p).count();
    let mut all = vec![Process::Milling, Process::Drilling];
    all.retain(|p| count(*p) > 0);
    all.sort_by_key(|p| std::cmp::Reverse(count(*p)));
    all
}

impl CuttingData {
    /// Reads the records of the campaign's cuts of `process`, in parallel. A cut that cannot be used is left out with a
    /// warning.
    ///
    /// # Errors
    /// No usable cut; no tool; a `tool_from_dyno` that cannot be inverted.
    pub fn load(campaign: &Campaign, process: Process) -> Result<Self> {
        let indices: Vec<usize> =
            (0..campaign.cuts.len()).filter(|i| campaign.cuts[*i].geometry.process() == process).collect();
        if indices.is_empty() {
            return Err(InputError::new("the campaign has no [[cut]] of this process: no force records to compare")
                .file(campaign.dir.join("campaign.toml"))
                .key("cut")
                .remedy("add [[cut]] tables that name the force records")
                .into());
        }
        let progress = Progress::new("force waveforms", indices.len());
        let outcomes: Vec<Result<CutData>> = indices
            .par_iter()
            .map(|&i| {
                let (record, _) = ingest::read_time(&campaign.cuts[i].file)?;
                let outcome = cut_data(campaign, i, &record);
                progress.step();
                outcome
            })
            .collect();
        let (mut cuts, mut warnings) = (Vec::new(), Vec::new());
        for (&i, outcome) in indices.iter().zip(outcomes) {
            match outcome {
                Ok(cut) => cuts.push(cut),
                Err(error) => warnings.push(format!("cut {} is left out: {error}", campaign.cuts[i].id)),
            }
        }
        if cuts.is_empty() {
            return Err(Error::computation(format!(
                "none of the {} cuts can be used; the first: {}",
                indices.len(),
                warnings.first().map_or("", String::as_str)
            )));
        }
        turn_torque(&mut cuts);
        place_in_campaign(campaign, &mut cuts);
        let tool_from_dyno = campaign.dynamometer.tool_from_dyno;
        let matrix = nalgebra::Matrix3::from_fn(|i, j| tool_from_dyno[i][j]);
        let inverse = matrix.try_inverse().filter(|m| m.iter().all(|v| v.is_finite())).ok_or_else(|| {
            InputError::new("the matrix cannot be inverted: channels are lost in it")
                .file(campaign.dir.join("campaign.toml"))
                .key("dynamometer.tool_from_dyno")
        })?;
        let summary = summary(campaign, process, &cuts);
        Ok(CuttingData {
            process,
            cuts: cuts.into_iter().map(Arc::new).collect(),
            tool_from_dyno,
            dyno_from_tool: std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)])),
            summary,
            warnings,
        })
    }

    /// The cuts for which `keep` holds (by index into [`CuttingData::cuts`]); the summary stays that of all.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let cuts = self.cuts.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, c)| c.clone()).collect();
        CuttingData { cuts, ..self.clone() }
    }

    /// Numbers compared.
    pub fn value_count(&self) -> usize {
        self.cuts.iter().map(|c| c.value_count()).sum()
    }

    /// Channels with data, over all cuts: each brings its own zero line.
    pub fn channel_count(&self) -> usize {
        self.cuts.iter().map(|c| c.channels.iter().flatten().count()).sum()
    }
}

fn cut_data(campaign: &Campaign, index: usize, record: &TimeRecord) -> Result<CutData> {
    let analysis = analyse_cut(campaign, index, record)?;
    let cut = &campaign.cuts[index];
    let tool = campaign
        .tool
        .as_ref()
        .ok_or_else(|| Error::computation("[tool] is missing: cutting forces need its teeth and diameter"))?;
    let rate = record.sample_rate_hz;
    let per_turn = rate * 60.0 / cut.spindle_rpm;
    let window = Windows::new(&analysis, record, per_turn);
    let milling = MillingCut::new(tool, &cut.geometry);
    let orders = match &milling {
        Some(m) => highest_order(per_turn, (ORDERS_PER_TOOTH * m.teeth).min(MOST_ORDERS)),
        None => 0,
    };
    let mut spectra = Vec::new();
    let mut channels: [Option<ForceChannel>; 4] = std::array::from_fn(|i| {
        let axis = ForceAxis::ALL[i];
        // A drill puts nothing on the lateral channels; what they show is its wobble.
        if milling.is_none() && !ForceAxis::of(Process::Drilling).contains(&axis) {
            return None;
        }
        let channel = analysis.channels.iter().find(|c| c.axis == axis)?;
        let role = [ChannelRole::ForceX, ChannelRole::ForceY, ChannelRole::ForceZ, ChannelRole::TorqueZ][i];
        if milling.is_some() && axis == ForceAxis::Mz {
            return None;
        }
        let values = record.channel(role)?.samples.as_slice();
        let zeroed: Vec<f64> =
            values.iter().enumerate().map(|(k, v)| v - channel.drift.at(record.start_s + k as f64 / rate)).collect();
        let spectrum = order_spectrum(&zeroed[window.steady.clone()], rate, per_turn, orders)?;
        let air_std = window.air().map(|r| sample_std(&values[r])).filter(|s| *s > 0.0).fold(0.0, f64::max);
        let quiet = window.air().max_by_key(|r| r.len());
        let hum: Vec<(f64, f64)> = MAINS_HZ
            .iter()
            .map(|hz| (*hz, quiet.clone().map_or(0.0, |r| line_amplitude(&values[r], rate, *hz))))
            .collect();
        let channel = force_channel(values, &zeroed, rate, &window, &spectrum, air_std, &hum, cut.spindle_rpm / 60.0);
        spectra.push((i, spectrum, quiet.map(|r| values[r].to_vec()).unwrap_or_default()));
        channel
    });
    if channels.iter().all(Option::is_none) {
        return Err(Error::computation("no channel that carries the cutting force over three revolutions or more"));
    }
    let kind = match milling {
        Some(m) => CutKind::Milling {
            unit: Box::new(m.closed_form(orders)),
            cut: m,
        },
        None => {
            let drill = DrillingCut::new(tool, &cut.geometry, cut.spindle_rpm)?;
            let middle = window.middle_s;
            let earliest = analysis.air_before_s.map_or(analysis.record_s[0] - 2.0 * drill.entry_s(), |a| a[0]);
            CutKind::Drilling {
                contact_s: [earliest - middle, analysis.steady_s[0] - middle],
                cut: drill,
            }
        }
    };
    let vibration = match &kind {
        CutKind::Milling { cut: m, .. } => find_vibration(&spectra, rate, cut.spindle_rpm / 60.0, m.teeth),
        CutKind::Drilling { .. } => None,
    };
    if let (Some(vibration), CutKind::Milling { cut: m, .. }) = (&vibration, &kind) {
        for (i, channel) in channels.iter_mut().enumerate() {
            if let Some(channel) = channel {
                widen_for_vibration(channel, vibration, i, m.teeth, window.steady_blocks());
            }
        }
    }
    Ok(CutData {
        cut: index,
        id: cut.id.clone(),
        spindle_rpm: cut.spindle_rpm,
        cutting_speed_m_per_min: analysis.cutting_speed_m_per_min,
        feed_mm: feed_mm(&cut.geometry),
        setting: CutSetting {
            process: cut.geometry.process(),
            progress: 0.0,
            speed_ratio: 1.0,
            feed_mm: feed_mm(&cut.geometry),
            has_vibration: vibration.is_some(),
        },
        kind,
        channels,
        orders,
        block_s: window.block_s(record),
        steady: window.steady_blocks(),
        vibration,
    })
}

/// The record cut into blocks of whole revolutions.
struct Windows {
    before: Option<Range<usize>>,
    after: Option<Range<usize>>,
    steady: Range<usize>,
    /// In samples, not whole in general: air before, cut, air after.
    blocks: Vec<[f64; 2]>,
    block_kinds: [usize; 3],
    /// Blocks of the cut before the steady ones.
    entering: usize,
    middle_s: f64,
}

impl Windows {
    fn new(analysis: &CutAnalysis, record: &TimeRecord, per_turn: f64) -> Windows {
        let rate = record.sample_rate_hz;
        let sample = |t: f64| (((t - record.start_s) * rate).round().max(0.0) as usize).min(record.len());
        let range = |s: [f64; 2]| sample(s[0])..sample(s[1]);
        let steady = range(analysis.steady_s);
        let before = analysis.air_before_s.map(range).filter(|r| !r.is_empty());
        let after = analysis.air_after_s.map(range).filter(|r| !r.is_empty());
        let drilling = analysis.process == Process::Drilling;
        // Equal blocks of whole revolutions that end where the range ends (`back`) or begin where it begins.
        let split = |r: Range<usize>, most: usize| -> Vec<[f64; 2]> {
            let turns = (r.len() as f64 / per_turn + 1e-6).floor();
            let per_block = (turns / most as f64).ceil().max(1.0) * per_turn;
            let count = (r.len() as f64 / per_block + 1e-6).floor() as usize;
            (0..count)
                .map(|k| [r.start as f64 + k as f64 * per_block, r.start as f64 + (k + 1) as f64 * per_block])
                .collect()
        };
        let air = |r: &Option<Range<usize>>| r.clone().map_or(Vec::new(), |r| split(r, MOST_AIR_BLOCKS));
        let (first, last) = (air(&before), air(&after));
        let (cut, entering) = if drilling {
            let from = before.as_ref().map_or(0, |r| r.end);
            let cut = split(from..steady.end, MOST_DRILLING_BLOCKS);
            let entering = cut.iter().filter(|b| b[0] < steady.start as f64).count();
            (cut, entering)
        } else {
            (split(steady.clone(), MOST_STEADY_BLOCKS), 0)
        };
        let block_kinds = [first.len(), cut.len(), last.len()];
        Windows {
            before,
            after,
            steady,
            blocks: first.into_iter().chain(cut).chain(last).collect(),
            block_kinds,
            entering,
            middle_s: record.start_s + 0.5 * record.len() as f64 / rate,
        }
    }

    fn air(&self) -> impl Iterator<Item = Range<usize>> {
        self.before.iter().chain(&self.after).cloned()
    }

    fn steady_blocks(&self) -> Range<usize> {
        self.block_kinds[0] + self.entering..self.block_kinds[0] + self.block_kinds[1]
    }

    fn is_cut(&self, block: usize) -> bool {
        (self.block_kinds[0]..self.block_kinds[0] + self.block_kinds[1]).contains(&block)
    }

    fn block_s(&self, record: &TimeRecord) -> Vec<[f64; 2]> {
        let seconds = |s: f64| record.start_s + s / record.sample_rate_hz - self.middle_s;
        self.blocks.iter().map(|b| b.map(seconds)).collect()
    }
}

/// White noise of a stretch of air: differences of neighbouring samples know no drift and little hum.
fn sample_std(samples: &[f64]) -> f64 {
    let squares: f64 = samples.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum();
    (0.5 * squares / samples.len().saturating_sub(1).max(1) as f64).sqrt()
}

#[allow(clippy::too_many_arguments)]
fn force_channel(
    values: &[f64],
    zeroed: &[f64],
    rate: f64,
    window: &Windows,
    spectrum: &crate::signal::OrderSpectrum,
    air_std: f64,
    hum: &[(f64, f64)],
    spindle_hz: f64,
) -> Option<ForceChannel> {
    let steady_s = window.steady.len() as f64 / rate;
    // What a line of mains hum puts into a mean over a stretch of time, at `off_hz` from the line; squared.
    let leak = |amplitude: f64, off_hz: f64, length_s: f64| {
        let x = std::f64::consts::PI * off_hz * length_s;
        let sinc = if x.abs() < 1e-6 { 1.0 } else { x.sin() / x };
        0.5 * (amplitude * sinc).powi(2)
    };
    let mut integral = Vec::with_capacity(values.len() + 1);
    let mut sum = 0.0;
    for v in zeroed {
        integral.push(sum);
        sum += v / rate;
    }
    integral.push(sum);
    let (mut level, mut level_std, mut lost) = (Vec::new(), Vec::new(), Vec::new());
    for (b, [from, to]) in window.blocks.iter().enumerate() {
        let std = if window.is_cut(b) { spectrum.sample_std.max(air_std) } else { air_std.max(1e-12) };
        let mut hum: f64 = hum.iter().map(|(hz, a)| leak(*a, *hz, (to - from) / rate)).sum();
        if window.is_cut(b) {
            hum = hum.max(lines_in_mean(spectrum, rate, (to - from) / rate));
        }
        level.push(mean_between(values, *from, *to));
        level_std.push((std * std / (to - from) + hum).sqrt());
        lost.push(mean_between(&integral, *from + 0.5, *to + 0.5));
    }
    let order_std = spectrum
        .std
        .iter()
        .enumerate()
        .map(|(k, std)| {
            let hz = (k + 1) as f64 * spindle_hz;
            // |coefficient|² of a line is a quarter of its amplitude's square.
            let hum: f64 = hum.iter().map(|(line, a)| 0.5 * leak(*a, hz - line, steady_s)).sum();
            (std * std + hum).sqrt()
        })
        .collect();
    let channel = ForceChannel {
        orders: spectrum.coefficient.clone(),
        order_std,
        level,
        level_std,
        integral: lost,
    };
    let sound = |v: &[f64]| v.iter().all(|x| x.is_finite());
    let positive = |v: &[f64]| v.iter().all(|x| *x > 0.0);
    (sound(&channel.level)
        && positive(&channel.level_std)
        && positive(&channel.order_std)
        && channel.orders.iter().all(|c| c.is_finite()))
    .then_some(channel)
}

/// A limit cycle's amplitude wanders by about this share while it lasts.
const VIBRATION_WANDERS: f64 = 0.25;

/// Where a tooth leaves the cut in every swing, the vibration changes the orders of tooth passing as well, by about what it
/// puts on the lines beside its own; and it does so no more steadily than its amplitude is.
fn widen_for_vibration(
    channel: &mut ForceChannel,
    vibration: &OffComb,
    index: usize,
    teeth: usize,
    steady: Range<usize>,
) {
    let beside: Vec<f64> = vibration
        .lines
        .iter()
        .filter(|l| l.shift != 0)
        .flat_map(|l| l.channels.iter().filter(|c| c.0 == index))
        .map(|(_, amplitude, noise)| (amplitude * amplitude - noise * noise).max(0.0))
        .collect();
    if beside.is_empty() {
        return;
    }
    // Mean square amplitude of the lines; a coefficient is half an amplitude.
    let power = beside.iter().sum::<f64>() / beside.len() as f64;
    let variance = VIBRATION_WANDERS.powi(2) * power / 4.0;
    let widen = |std: &mut f64| *std = (*std * *std + variance).sqrt();
    channel.order_std.iter_mut().skip(teeth - 1).step_by(teeth).for_each(widen);
    channel.level_std[steady].iter_mut().for_each(widen);
}

/// Variance that lines above the noise (vibration, hum) leave in a mean over `length_s`. Slower than that is no line but a
/// level that changes, which the model has to explain.
fn lines_in_mean(spectrum: &crate::signal::OrderSpectrum, rate: f64, length_s: f64) -> f64 {
    let floor = spectrum.sample_std.powi(2) * spectrum.line_hz / rate;
    let first = (1.0 / (length_s * spectrum.line_hz)).ceil() as usize;
    spectrum
        .rest
        .iter()
        .enumerate()
        .skip(first.max(1))
        .filter(|(_, a)| **a * **a > 10.0 * floor)
        .map(|(j, a)| {
            let x = std::f64::consts::PI * j as f64 * spectrum.line_hz * length_s;
            2.0 * (a * x.sin() / x).powi(2)
        })
        .sum()
}

/// Torque opposes rotation; where all of it is negative the amplifier counts it the other way round.
fn turn_torque(cuts: &mut [CutData]) {
    let torque = ForceAxis::Mz.index();
    let mean = |cut: &CutData| {
        let channel = cut.channels[torque].as_ref()?;
        let of = |r: Range<usize>| {
            let n = r.len().max(1) as f64;
            channel.level.get(r).map_or(0.0, |l| l.iter().sum::<f64>() / n)
        };
        let before = cut.steady.start.min(5);
        Some(of(cut.steady.clone()) - if before > 0 { of(0..before) } else { 0.0 })
    };
    let means: Vec<f64> = cuts.iter().filter_map(mean).collect();
    if means.is_empty() || means.iter().any(|m| *m >= 0.0) {
        return;
    }
    for channel in cuts.iter_mut().filter_map(|c| c.channels[torque].as_mut()) {
        channel.level.iter_mut().chain(&mut channel.integral).for_each(|v| *v = -*v);
    }
}

/// Where each cut stands in the sequence and in the range of speeds.
fn place_in_campaign(campaign: &Campaign, cuts: &mut [CutData]) {
    let orders: Vec<i64> = cuts.iter().filter_map(|c| campaign.cuts[c.cut].order).collect();
    let (first, last) = (orders.iter().min().copied(), orders.iter().max().copied());
    let [slow, fast] = speed_range(cuts);
    for cut in cuts {
        if let (Some(first), Some(last), Some(own)) = (first, last, campaign.cuts[cut.cut].order) {
            cut.setting.progress = if last > first { (own - first) as f64 / (last - first) as f64 } else { 0.0 };
        }
        cut.setting.speed_ratio = cut.cutting_speed_m_per_min / (slow * fast).sqrt();
    }
}

fn speed_range(cuts: &[CutData]) -> [f64; 2] {
    let speeds = || cuts.iter().map(|c| c.cutting_speed_m_per_min);
    [speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max)]
}

fn summary(campaign: &Campaign, process: Process, cuts: &[CutData]) -> CuttingSummary {
    let distinct = |values: Vec<f64>| {
        let mut sorted = values;
        sorted.sort_by(f64::total_cmp);
        sorted.dedup_by(|b, a| (*b - *a).abs() <= 1e-3 * a.abs());
        sorted.len()
    };
    let all_ordered = cuts.iter().all(|c| campaign.cuts[c.cut].order.is_some());
    let mut order: Vec<i64> = cuts.iter().filter_map(|c| campaign.cuts[c.cut].order).collect();
    order.sort_unstable();
    order.dedup();
    let lines: Vec<f64> = cuts.iter().filter_map(|c| c.vibration.as_ref()).map(|v| v.frequency_hz).collect();
    let holes = |full: bool| {
        cuts.iter().filter(|c| matches!(&c.kind, CutKind::Drilling { cut, .. } if cut.full_hole == full)).count()
    };
    let length = |c: &CutData| match (c.block_s.first(), c.block_s.last()) {
        (Some(first), Some(last)) => last[1] - first[0],
        _ => 0.0,
    };
    CuttingSummary {
        process,
        teeth: campaign.tool.as_ref().map_or(1, |t| t.teeth.max(1)),
        cuts: cuts.len(),
        sequence_length: if all_ordered { order.len() } else { 0 },
        speed_m_per_min: speed_range(cuts),
        feeds: distinct(cuts.iter().map(|c| c.feed_mm).collect()),
        smallest_feed_mm: cuts.iter().map(|c| c.feed_mm).fold(f64::INFINITY, f64::min),
        channels: std::array::from_fn(|i| cuts.iter().all(|c| c.channels[i].is_some())),
        highest_hz: cuts.iter().map(|c| c.orders as f64 * c.spindle_hz()).fold(0.0, f64::max),
        air_on_both_sides: cuts.iter().all(|c| c.steady.start > 3 && c.block_s.len() > c.steady.end + 3),
        full_holes: holes(true),
        pilot_holes: holes(false),
        has_edge: true,
        vibration_hz: (!lines.is_empty()).then(|| crate::signal::median(&lines)),
        longest_record_s: cuts.iter().map(length).fold(0.0, f64::max),
        cutting_scale_n_per_mm2: 1000.0,
    }
}
