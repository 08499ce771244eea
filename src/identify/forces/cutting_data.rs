//! Force records arranged for fitting a waveform: order spectra of the steady cut, levels of air and cut, lines off the
//! tooth-passing comb, each with its noise.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::cutting::waveform::{DrillTerm, DrillingCut, MillingCut, UnitForces};
use crate::cutting::{
    CutAnalysis, EdgeBit, ForceAxis, RecordSlips, engaged_edge, feed_mm, record_at_full_contact,
};
use crate::data::{ChannelRole, Cut, Immersion, Process, Sample, TimeRecord, Tool};
use crate::effects::cutting::{CutSetting, CuttingSummary};
use crate::identify::forces::asynchronous_lines::{
    AsynchronousLines, StandingLine, find_vibration, standing_lines,
};
use crate::identify::forces::cutting_windows::Windows;
pub use crate::identify::forces::force_channel::ForceChannel;
use crate::identify::forces::force_channel::{force_channel, widen_for_vibration};
use crate::signal::{MAINS_HZ, SpindleTrack, highest_order_seen_whole, line_amplitude, order_spectrum_above};
use crate::{Error, InputError, Result};

/// What was cut.
#[derive(Debug, Clone)]
pub enum CutKind {
    /// With an end mill.
    Milling {
        /// Tool and engagement.
        cut: MillingCut,
        /// Closed-form forces for one unit of each coefficient, up to the cut's highest order.
        unit: Box<UnitForces>,
    },
    /// With a twist drill.
    Drilling {
        /// Drill and hole.
        cut: DrillingCut,
        /// First contact lies in here, s.
        contact_s: [f64; 2],
    },
    /// On a lathe.
    Turning {
        /// The edge in the work, bit by bit.
        edge: Vec<EdgeBit>,
    },
}

/// One cut as data.
#[derive(Debug, Clone)]
pub struct CutData {
    /// Index into `Campaign::cuts`.
    pub cut: usize,
    /// Its id.
    pub id: String,
    /// Rotation of the spindle, 1/min.
    pub spindle_rpm: f64,
    /// Of its record, Hz.
    pub sample_rate_hz: f64,
    /// At the tool's diameter (turning: the workpiece's), m/min.
    pub cutting_speed_m_per_min: f64,
    /// Per tooth (milling), per revolution (drilling, turning).
    pub feed_mm: f64,
    /// What effects on it need to know.
    pub setting: CutSetting,
    /// Place in the sequence of cuts, where the campaign says it.
    pub order: Option<i64>,
    /// Tool, engagement and forces.
    pub kind: CutKind,
    /// Recorded x, y, z, torque; `None` where there is no usable channel or the process puts no force on it.
    pub channels: [Option<ForceChannel>; 4],
    /// Highest order of the spectra; 0 for drilling and turning.
    pub orders: usize,
    /// Start and end of each block, s from the middle of the record.
    pub block_s: Vec<[f64; 2]>,
    /// Blocks of full engagement.
    pub steady: Range<usize>,
    /// Lines off the tooth-passing comb; `None` where none stands out (and for drilling and turning).
    pub vibration: Option<AsynchronousLines>,
    /// What stands above the noise beside the orders (drilling and turning: orders and all).
    pub lines: Vec<StandingLine>,
    /// The angle of a spindle that did not keep the stated speed, by which the record was put in step; `None` where it did.
    pub spindle: Option<SpindleTrack>,
}

impl CutData {
    /// Angles between which a tooth is in the work, degrees; `None` where nothing is milled.
    pub fn immersion_deg(&self) -> Option<[f64; 2]> {
        let CutKind::Milling { cut, .. } = &self.kind else {
            return None;
        };
        Some([cut.immersion.start_rad, cut.immersion.exit_rad].map(f64::to_degrees))
    }

    /// Milled with more of the tool on one side of the feed than on the other, by 20° and more: up or down milling.
    pub fn is_one_sided(&self) -> bool {
        self.immersion_deg()
            .is_some_and(|[start, exit]| (start + exit - 180.0).abs() >= 20.0)
    }

    /// Whether its record could be that of the other one: alike in speed, otherwise in feed, depth or width.
    pub fn may_be_exchanged_with(&self, other: &CutData) -> bool {
        let width = |cut: &CutData| match &cut.kind {
            CutKind::Milling { cut, .. } => Some((cut.axial_depth_mm, cut.immersion)),
            CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
        };
        (self.spindle_rpm / other.spindle_rpm - 1.0).abs() < 1e-3
            && (self.feed_mm != other.feed_mm || width(self) != width(other))
    }

    /// One cut, the `index`-th of all, from its record and what was read off it.
    ///
    /// # Errors
    /// No channel that carries the cutting force over two revolutions or more; a tool that cannot have made the cut.
    pub fn new<S: Sample>(
        tool: &Tool,
        (index, cut): (usize, &Cut),
        record: &TimeRecord<S>,
        analysis: &CutAnalysis,
    ) -> Result<CutData> {
        let whole;
        let record = match analysis.contact_share < 1.0 {
            true => {
                whole = record_at_full_contact(record, analysis);
                &whole
            }
            false => record,
        };
        let rate = record.sample_rate_hz;
        let per_turn = rate * 60.0 / cut.spindle_rpm;
        let window = Windows::new(analysis, record, per_turn);
        let milling = MillingCut::new(tool, &cut.geometry);
        let orders = match &milling {
            Some(m) => {
                highest_order_seen_whole(per_turn, m.teeth, (ORDERS_PER_TOOTH * m.teeth).min(MOST_ORDERS))
            }
            None => 0,
        };
        let mut spectra = Vec::new();
        let mut channels: [Option<ForceChannel>; 4] = std::array::from_fn(|i| {
            let axis = ForceAxis::ALL[i];
            // A drill puts nothing on the lateral channels; what they show is its wobble.
            if !ForceAxis::of(cut.geometry.process()).contains(&axis) {
                return None;
            }
            let channel = analysis.channels.iter().find(|c| c.axis == axis)?;
            let role = [
                ChannelRole::ForceX,
                ChannelRole::ForceY,
                ChannelRole::ForceZ,
                ChannelRole::TorqueZ,
            ][i];
            let values = record.channel(role)?.samples.as_slice();
            let zero = |k: usize| channel.drift.at(record.start_s + k as f64 / rate);
            let first = window.steady.start;
            let steady = &values[window.steady.clone()];
            let mut spectrum = order_spectrum_above(steady, |k| zero(first + k), rate, per_turn, orders)?;
            if let Some(track) = &analysis.spindle {
                let lines = spectrum.coefficient.iter().zip(&mut spectrum.std);
                for (order, (line, std)) in (1..).zip(lines) {
                    *std = std.hypot(track.lost_of_line(order) * line.norm());
                }
            }
            let quiet = window.air().max_by_key(|r| r.len());
            let hum: Vec<(f64, f64)> = MAINS_HZ
                .iter()
                .map(|hz| {
                    (
                        *hz,
                        quiet
                            .clone()
                            .map_or(0.0, |r| line_amplitude(&values[r], rate, *hz)),
                    )
                })
                .collect();
            let channel = force_channel(
                values,
                zero,
                rate,
                &window,
                &spectrum,
                &hum,
                cut.spindle_rpm / 60.0,
            );
            spectra.push((i, spectrum, quiet.map_or(&[][..], |r| &values[r])));
            channel
        });
        if channels.iter().all(Option::is_none) {
            return Err(Error::computation(
                "no channel that carries the cutting force over two revolutions or more",
            ));
        }
        let kind = match milling {
            Some(m) => CutKind::Milling {
                unit: Box::new(m.linear(orders)),
                cut: m,
            },
            None if cut.geometry.process() == Process::Turning => CutKind::Turning {
                edge: engaged_edge(tool, &cut.geometry)?,
            },
            None => {
                let drill = DrillingCut::new(tool, &cut.geometry, cut.spindle_rpm)?;
                let middle = window.middle_s;
                let earliest = analysis
                    .air_before_s
                    .map_or(analysis.record_s[0] - 2.0 * drill.entry_s(), |a| a[0]);
                CutKind::Drilling {
                    contact_s: [earliest - middle, analysis.steady_s[0] - middle],
                    cut: drill,
                }
            }
        };
        let vibration = match &kind {
            // The model of chatter takes all teeth as alike.
            CutKind::Milling { cut: m, .. } if !m.places.is_empty() => None,
            CutKind::Milling { cut: m, .. } => {
                find_vibration(&spectra, rate, cut.spindle_rpm / 60.0, m.teeth)
            }
            CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
        };
        if let (Some(vibration), CutKind::Milling { cut: m, .. }) = (&vibration, &kind) {
            for (i, channel) in channels.iter_mut().enumerate() {
                if let Some(channel) = channel {
                    widen_for_vibration(channel, vibration, i, m.teeth, window.steady_blocks());
                }
            }
        }
        let lines = standing_lines(&spectra, rate, cut.spindle_rpm / 60.0, orders > 0);
        let mut data = CutData {
            sample_rate_hz: rate,
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
                teeth: tool.teeth.max(1),
                has_vibration: vibration.is_some(),
            },
            order: cut.order,
            kind,
            channels,
            orders,
            block_s: window.block_s(record),
            steady: window.steady_blocks(),
            vibration,
            lines,
            spindle: analysis.spindle.clone(),
        };
        data.narrow_contact();
        Ok(data)
    }

    /// Rotation of the spindle, 1/s.
    pub fn spindle_hz(&self) -> f64 {
        self.spindle_rpm / 60.0
    }

    /// Narrows the range of the first contact (drilling): where a zero line and the shape of entry and hole, each of a
    /// size of its own, fit the levels best, and a margin for what effects add to the shape.
    fn narrow_contact(&mut self) {
        let CutKind::Drilling {
            cut: drill,
            contact_s,
        } = &self.kind
        else {
            return;
        };
        let block = self.block_s.first().map_or(0.0, |b| b[1] - b[0]);
        let misfit = |contact: f64| -> f64 {
            let terms = [
                (ForceAxis::Z, DrillTerm::Thrust),
                (ForceAxis::Mz, DrillTerm::Torque),
            ];
            let channels = terms.iter().filter_map(|(axis, term)| {
                let channel = self.channels[axis.index()].as_ref()?;
                let shape = |b: usize| {
                    let [from, to] = self.block_s[b];
                    if b < self.steady.end {
                        drill.mean(*term, from, to, contact).0
                    } else {
                        0.0
                    }
                };
                let basis = DMatrix::from_fn(channel.level.len(), 3, |b, k| {
                    let value = [1.0, 0.5 * (self.block_s[b][0] + self.block_s[b][1]), shape(b)][k];
                    value / channel.level_std[b]
                });
                let level = DVector::from_fn(channel.level.len(), |b, _| {
                    channel.level[b] / channel.level_std[b]
                });
                let solution = (basis.transpose() * &basis)
                    .cholesky()?
                    .solve(&(basis.transpose() * &level));
                Some((level - basis * solution).norm_squared())
            });
            channels.sum()
        };
        let [low, high] = *contact_s;
        let steps = ((high - low) / block.max(1e-3)).ceil().clamp(20.0, 200.0);
        let at = |k: f64| low + (high - low) * k / steps;
        let best = (0..=steps as usize)
            .map(|k| (misfit(at(k as f64)), at(k as f64)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(low, |best| best.1);
        let margin = 0.15 * drill.entry_s() + 3.0 * block;
        let range = [(best - margin).max(low), (best + margin).min(high)];
        if range[1] > range[0]
            && let CutKind::Drilling { contact_s, .. } = &mut self.kind
        {
            *contact_s = range;
        }
    }

    /// For another hole than stated: the first contact may be anywhere before the steady cut.
    fn find_contact_again(&mut self) {
        let (first, last) = (self.block_s.first(), self.block_s.get(self.steady.start));
        if let (Some(first), Some(last), CutKind::Drilling { contact_s, .. }) = (first, last, &mut self.kind)
            && last[0] > first[0]
        {
            *contact_s = [first[0], last[0]];
            self.narrow_contact();
        }
    }

    /// Levels of the steady cut above the air before it, over their standard deviations.
    pub(crate) fn levels_over_noise<'a>(
        &self,
        channel: &'a ForceChannel,
    ) -> impl Iterator<Item = f64> + use<'a> {
        let before = self.steady.start.min(AIR_BLOCKS);
        let air = channel.level[..before].iter().sum::<f64>() / before.max(1) as f64;
        let steady = self.steady.clone();
        channel.level[steady.clone()]
            .iter()
            .zip(&channel.level_std[steady])
            .map(move |(level, std)| (level - air) / std)
    }

    /// Mean steady level of a channel above its first blocks.
    fn mean_above_air(&self, channel: usize) -> Option<f64> {
        let level = &self.channels[channel].as_ref()?.level;
        let of = |r: Range<usize>| {
            let n = r.len().max(1) as f64;
            level.get(r).map_or(0.0, |l| l.iter().sum::<f64>() / n)
        };
        let before = self.steady.start.min(AIR_BLOCKS);
        Some(of(self.steady.clone()) - if before > 0 { of(0..before) } else { 0.0 })
    }

    /// Numbers compared in this cut, less the zero lines and the phase (or contact) fitted to it.
    pub fn value_count(&self) -> usize {
        let channels = self.channels.iter().flatten();
        let own: usize = channels
            .map(|c| (2 * c.orders.len() + c.level.len()).saturating_sub(2))
            .sum();
        (own + self.vibration.as_ref().map_or(0, AsynchronousLines::value_count)).saturating_sub(1)
    }
}

/// The cuts of one process.
#[derive(Debug, Clone)]
pub struct CuttingData {
    /// Of all its cuts.
    pub process: Process,
    /// In the campaign's order.
    pub cuts: Vec<Arc<CutData>>,
    /// F_tool = A F_recorded, and its inverse.
    pub tool_from_dyno: [[f64; 3]; 3],
    /// Rows of the inverse: F_recorded = A⁻¹ F_tool.
    pub dyno_from_tool: [[f64; 3]; 3],
    /// What a torque counts as where forces and torques are added up, N per N·m: thrusts and torques are equally large then.
    pub force_per_torque: f64,
    /// What effects need to know of the cuts.
    pub summary: CuttingSummary,
    /// Half of the records or more contradict their stated speed, or repeat nothing with it: what their waveforms say of channels,
    /// axes and physics is not to be believed.
    pub speed_is_contradicted: bool,
    /// What the records show to be wrong with themselves or with the list of the cuts; some cuts were left out for it.
    pub slips: RecordSlips,
    /// Ids of cuts whose files hold the same record, and of the one that it is not of, where that is known.
    pub copies: Vec<([String; 2], Option<String>)>,
    /// Cuts left out, with the reason.
    pub warnings: Vec<String>,
}

/// Blocks at the beginning that the air before the cut is taken from, at most.
const AIR_BLOCKS: usize = 5;
/// A pilot hole leaves the lips at least a fiftieth of the drill's radius.
const WIDEST_PILOT: f64 = 0.98;
/// Orders kept for each tooth, and in all.
const ORDERS_PER_TOOTH: usize = 24;
const MOST_ORDERS: usize = 96;

/// The processes of `cuts`, the one with more cuts first.
pub fn processes(cuts: &[Cut]) -> Vec<Process> {
    let count = |p| cuts.iter().filter(|c| c.geometry.process() == p).count();
    let mut all = Process::ALL.to_vec();
    all.retain(|p| count(*p) > 0);
    all.sort_by_key(|p| std::cmp::Reverse(count(*p)));
    all
}

impl CuttingData {
    /// The cuts of one process, each read by [`CutData::new`]: turns a torque that is counted the other way round, and
    /// places each cut in the sequence and in the range of speeds. `teeth`: of the tool. `tool_from_dyno`: rows of A in
    /// F_tool = A F_recorded.
    ///
    /// # Errors
    /// A `tool_from_dyno` that cannot be inverted.
    pub fn new(
        process: Process,
        teeth: usize,
        tool_from_dyno: [[f64; 3]; 3],
        mut cuts: Vec<CutData>,
    ) -> Result<Self> {
        turn_torque(&mut cuts);
        place_in_sequence(&mut cuts);
        let matrix = nalgebra::Matrix3::from_fn(|i, j| tool_from_dyno[i][j]);
        let inverse = matrix
            .try_inverse()
            .filter(|m| m.iter().all(|v| v.is_finite()))
            .ok_or_else(|| {
                InputError::new("the matrix cannot be inverted: channels are lost in it")
                    .key("dynamometer.tool_from_dyno")
            })?;
        let summary = summary(process, teeth, &cuts);
        let size = |axis: ForceAxis| -> f64 {
            let means = cuts.iter().filter_map(|c| c.mean_above_air(axis.index()));
            means.map(|m| m * m).sum::<f64>().sqrt()
        };
        let (thrust, torque) = (size(ForceAxis::Z), size(ForceAxis::Mz));
        let force_per_torque = if thrust > 0.0 && torque > 0.0 {
            thrust / torque
        } else {
            1.0
        };
        Ok(CuttingData {
            force_per_torque,
            process,
            cuts: cuts.into_iter().map(Arc::new).collect(),
            tool_from_dyno,
            dyno_from_tool: std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)])),
            summary,
            speed_is_contradicted: false,
            slips: RecordSlips::default(),
            copies: Vec::new(),
            warnings: Vec::new(),
        })
    }

    /// The cuts for which `keep` holds (by index into [`CuttingData::cuts`]); the summary stays that of all.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let cuts = self
            .cuts
            .iter()
            .enumerate()
            .filter(|(i, _)| keep(*i))
            .map(|(_, c)| c.clone())
            .collect();
        CuttingData { cuts, ..self.clone() }
    }

    /// The same records, the milled cuts for which `turned` holds (by index into [`CuttingData::cuts`]) with their immersion seen
    /// from the other side: up milling for down milling.
    pub fn milled_the_other_way(&self, turned: impl Fn(usize) -> bool) -> Self {
        self.milled_otherwise(turned, |milling| {
            Some(MillingCut {
                immersion: milling.immersion.mirrored(),
                ..milling.clone()
            })
        })
    }

    /// One cut milled or drilled with `factor` times the stated feed.
    #[must_use]
    pub fn with_feed_of(&self, cut: usize, factor: f64) -> Self {
        let mut own = self.clone();
        let cut = Arc::make_mut(&mut own.cuts[cut]);
        cut.feed_mm *= factor;
        cut.setting.feed_mm *= factor;
        match &mut cut.kind {
            CutKind::Milling { cut: milling, unit } => {
                milling.feed_per_tooth_mm *= factor;
                **unit = milling.linear(cut.orders);
            }
            CutKind::Drilling { cut: hole, .. } => {
                hole.geometry.feed_per_rev_mm *= factor;
                hole.feed_mm_per_s *= factor;
                cut.find_contact_again();
            }
            CutKind::Turning { .. } => {}
        }
        own
    }

    /// One hole drilled with `factor` times the stated spindle speed at the stated feed per revolution.
    #[must_use]
    pub fn with_drill_speed_of(&self, cut: usize, factor: f64) -> Self {
        self.drilled_otherwise(|i| i == cut, |hole| hole.feed_mm_per_s *= factor)
    }

    /// One hole whose lips begin at `factor` times the stated radius: that of its pilot hole, or the chisel's half length.
    #[must_use]
    pub fn with_pilot_of(&self, cut: usize, factor: f64) -> Self {
        self.drilled_otherwise(
            |i| i == cut,
            |hole| {
                let g = &mut hole.geometry;
                g.inner_radius_mm = (factor * g.inner_radius_mm).min(WIDEST_PILOT * g.radius_mm);
            },
        )
    }

    /// All holes drilled with a drill of `factor` times the stated diameter; their pilot holes stay.
    #[must_use]
    pub fn with_drill_diameter(&self, factor: f64) -> Self {
        self.drilled_otherwise(
            |_| true,
            |hole| {
                let g = &mut hole.geometry;
                g.radius_mm = (factor * g.radius_mm).max(g.inner_radius_mm / WIDEST_PILOT);
            },
        )
    }

    /// All holes drilled with a point of which half the angle has `factor` times the tangent stated: it enters so many times as fast.
    #[must_use]
    pub fn with_point_angle(&self, factor: f64) -> Self {
        self.drilled_otherwise(
            |_| true,
            |hole| {
                let g = &mut hole.geometry;
                g.half_point_rad = (factor * g.half_point_rad.tan()).atan();
            },
        )
    }

    fn drilled_otherwise(&self, which: impl Fn(usize) -> bool, otherwise: impl Fn(&mut DrillingCut)) -> Self {
        let mut own = self.clone();
        for (_, cut) in own.cuts.iter_mut().enumerate().filter(|(i, _)| which(*i)) {
            let cut = Arc::make_mut(cut);
            if let CutKind::Drilling { cut: hole, .. } = &mut cut.kind {
                otherwise(hole);
                cut.find_contact_again();
            }
        }
        own
    }

    /// One cut milled `factor` times as deep as stated.
    #[must_use]
    pub fn with_depth_of(&self, cut: usize, factor: f64) -> Self {
        self.milled_otherwise(|i| i == cut, |milling| Some(milling.deeper(factor)))
    }

    /// The cuts for which `wider` holds (by index into [`CuttingData::cuts`]) milled `factor` times as wide as stated, where the work
    /// reaches to one edge of the cutter.
    #[must_use]
    pub fn with_width_of(&self, wider: impl Fn(usize) -> bool, factor: f64) -> Self {
        self.milled_otherwise(wider, |milling| {
            Some(MillingCut {
                immersion: milling.immersion.wider(factor)?,
                ..milling.clone()
            })
        })
    }

    /// All cuts milled with a helix of `factor` times the tangent stated for the tool (or with a tool so many times thinner).
    #[must_use]
    pub fn with_helix(&self, factor: f64) -> Self {
        self.milled_otherwise(|_| true, |milling| Some(milling.steeper(factor)))
    }

    fn milled_otherwise(
        &self,
        which: impl Fn(usize) -> bool,
        otherwise: impl Fn(&MillingCut) -> Option<MillingCut>,
    ) -> Self {
        let mut own = self.clone();
        for (_, cut) in own.cuts.iter_mut().enumerate().filter(|(i, _)| which(*i)) {
            let cut = Arc::make_mut(cut);
            if let CutKind::Milling { cut: milling, unit } = &mut cut.kind
                && let Some(other) = otherwise(milling)
            {
                *milling = other;
                **unit = milling.linear(cut.orders);
            }
        }
        own
    }

    /// Each of two cuts with the other one's record.
    #[must_use]
    pub fn with_exchanged(&self, [a, b]: [usize; 2]) -> Self {
        let mut own = self.clone();
        for (to, from) in [(a, b), (b, a)] {
            let of = &self.cuts[from];
            let cut = Arc::make_mut(&mut own.cuts[to]);
            cut.sample_rate_hz = of.sample_rate_hz;
            cut.channels.clone_from(&of.channels);
            cut.block_s.clone_from(&of.block_s);
            cut.steady = of.steady.clone();
            cut.vibration.clone_from(&of.vibration);
            cut.setting.has_vibration = of.setting.has_vibration;
            cut.lines.clone_from(&of.lines);
            cut.spindle.clone_from(&of.spindle);
            cut.orders = of.orders;
            if let CutKind::Milling { cut: milling, unit } = &mut cut.kind {
                **unit = milling.linear(cut.orders);
            }
            if let (CutKind::Drilling { contact_s, .. }, CutKind::Drilling { contact_s: other, .. }) =
                (&mut cut.kind, &of.kind)
            {
                *contact_s = *other;
            }
        }
        own
    }

    /// Numbers compared.
    pub fn value_count(&self) -> usize {
        self.cuts.iter().map(|c| c.value_count()).sum()
    }

    /// Channels with data, over all cuts: each brings its own zero line.
    pub fn channel_count(&self) -> usize {
        self.cuts
            .iter()
            .map(|c| c.channels.iter().flatten().count())
            .sum()
    }
}

/// Torque opposes rotation; where all of it is negative the amplifier counts it the other way round.
fn turn_torque(cuts: &mut [CutData]) {
    let torque = ForceAxis::Mz.index();
    let means: Vec<f64> = cuts.iter().filter_map(|c| c.mean_above_air(torque)).collect();
    if means.is_empty() || means.iter().any(|m| *m >= 0.0) {
        return;
    }
    for channel in cuts.iter_mut().filter_map(|c| c.channels[torque].as_mut()) {
        channel
            .level
            .iter_mut()
            .chain(&mut channel.integral)
            .for_each(|v| *v = -*v);
    }
}

/// How far a cut is between the first and the last of the sequence: 0 to 1.
fn progress(own: i64, [first, last]: [i64; 2]) -> f64 {
    match last > first {
        true => (own - first) as f64 / (last - first) as f64,
        false => 0.0,
    }
}

/// Where each cut stands in the sequence and in the range of speeds.
fn place_in_sequence(cuts: &mut [CutData]) {
    let orders: Vec<i64> = cuts.iter().filter_map(|c| c.order).collect();
    let (first, last) = (orders.iter().min().copied(), orders.iter().max().copied());
    let [slow, fast] = speed_range(cuts);
    for cut in cuts {
        if let (Some(first), Some(last), Some(own)) = (first, last, cut.order) {
            cut.setting.progress = progress(own, [first, last]);
        }
        cut.setting.speed_ratio = cut.cutting_speed_m_per_min / (slow * fast).sqrt();
    }
}

fn speed_range(cuts: &[CutData]) -> [f64; 2] {
    let speeds = || cuts.iter().map(|c| c.cutting_speed_m_per_min);
    [
        speeds().fold(f64::INFINITY, f64::min),
        speeds().fold(0.0, f64::max),
    ]
}

/// Different depths and immersions of milled cuts.
fn engagements(cuts: &[CutData]) -> usize {
    let mut all: Vec<[i64; 3]> = cuts
        .iter()
        .filter_map(|c| match &c.kind {
            CutKind::Milling { cut, .. } => {
                let Immersion { start_rad, exit_rad } = cut.immersion;
                Some([cut.axial_depth_mm, start_rad, exit_rad].map(|v| (v * 1e6).round() as i64))
            }
            CutKind::Drilling { .. } | CutKind::Turning { .. } => None,
        })
        .collect();
    all.sort_unstable();
    all.dedup();
    all.len()
}

fn summary(process: Process, teeth: usize, cuts: &[CutData]) -> CuttingSummary {
    let distinct = |values: Vec<f64>| {
        let mut sorted = values;
        sorted.sort_by(f64::total_cmp);
        sorted.dedup_by(|b, a| (*b - *a).abs() <= 1e-3 * a.abs());
        sorted.len()
    };
    let all_ordered = cuts.iter().all(|c| c.order.is_some());
    let mut order: Vec<i64> = cuts.iter().filter_map(|c| c.order).collect();
    order.sort_unstable();
    order.dedup();
    let lines: Vec<f64> = cuts
        .iter()
        .filter_map(|c| c.vibration.as_ref())
        .map(|v| v.frequency_hz)
        .collect();
    let holes = |full: bool| {
        cuts.iter()
            .filter(|c| matches!(&c.kind, CutKind::Drilling { cut, .. } if cut.full_hole == full))
            .count()
    };
    let length = |c: &CutData| match (c.block_s.first(), c.block_s.last()) {
        (Some(first), Some(last)) => last[1] - first[0],
        _ => 0.0,
    };
    CuttingSummary {
        process,
        teeth: teeth.max(1),
        teeth_in_doubt: false,
        straight_edge: cuts
            .iter()
            .all(|c| !matches!(&c.kind, CutKind::Milling { cut, .. } if cut.shape.is_some())),
        one_helix: cuts
            .iter()
            .all(|c| !matches!(&c.kind, CutKind::Milling { cut, .. } if !cut.has_one_helix())),
        even_pitch: cuts
            .iter()
            .all(|c| !matches!(&c.kind, CutKind::Milling { cut, .. } if !cut.is_evenly_spaced())),
        engagements: engagements(cuts),
        cuts: cuts.len(),
        sequence_length: if all_ordered { order.len() } else { 0 },
        speed_m_per_min: speed_range(cuts),
        feeds: distinct(cuts.iter().map(|c| c.feed_mm).collect()),
        smallest_feed_mm: cuts.iter().map(|c| c.feed_mm).fold(f64::INFINITY, f64::min),
        largest_feed_mm: cuts.iter().map(|c| c.feed_mm).fold(0.0, f64::max),
        channels: std::array::from_fn(|i| cuts.iter().all(|c| c.channels[i].is_some())),
        highest_hz: cuts
            .iter()
            .map(|c| c.orders as f64 * c.spindle_hz())
            .fold(0.0, f64::max),
        air_on_both_sides: cuts
            .iter()
            .all(|c| c.steady.start > 3 && c.block_s.len() > c.steady.end + 3),
        full_holes: holes(true),
        pilot_holes: holes(false),
        has_edge: true,
        vibration_hz: (!lines.is_empty()).then(|| crate::signal::median(&lines)),
        longest_record_s: cuts.iter().map(length).fold(0.0, f64::max),
        cutting_scale_n_per_mm2: 1000.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_runs_from_the_first_cut_to_the_last() {
        assert_eq!([3, 5, 9].map(|own| progress(own, [3, 9])), [0.0, 1.0 / 3.0, 1.0]);
        assert_eq!(progress(4, [4, 4]), 0.0);
    }

    use crate::identify::forces::made_cuts::{
        AS_IT_IS, CONTACT_S, METAL, MILLED, changed, drilled, milled, turned,
    };
    use approx::assert_relative_eq;

    const HOLES: [f64; 4] = [900.0, 30.0, 700.0, 45.0];

    fn own(data: &CuttingData) -> Vec<CutData> {
        data.cuts.iter().map(|c| (**c).clone()).collect()
    }

    /// An amplifier that counts torque the other way round: all torques come out negative, and are turned. One that is positive, and
    /// they are what they are.
    #[test]
    fn a_torque_that_is_negative_throughout_is_turned() {
        let right = drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0]]);
        let torque = |data: &CuttingData, i: usize| {
            let channel = data.cuts[i].channels[3].as_ref().unwrap();
            (channel.level[8], channel.integral[8])
        };
        let negative = |cuts: &[usize]| {
            let mut all = own(&right);
            for i in cuts {
                let channel = all[*i].channels[3].as_mut().unwrap();
                channel.level.iter_mut().for_each(|v| *v = -*v);
                channel.integral = vec![-0.25; 14];
            }
            CuttingData::new(Process::Drilling, 2, AS_IT_IS, all).unwrap()
        };
        let turned = negative(&[0, 1]);
        assert_eq!(torque(&turned, 0), (torque(&right, 0).0, 0.25));
        assert_eq!(torque(&turned, 1), (torque(&right, 1).0, 0.25));
        let one = negative(&[1]);
        assert_eq!(torque(&one, 1), (-torque(&right, 1).0, -0.25));
    }

    /// Thrusts of 3 N and 4 N above the air against torques of 0.3 N·m and 0.4 N·m: a torque counts ten times.
    #[test]
    fn torques_and_thrusts_are_made_equally_large() {
        let mut cuts = own(&drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0]]));
        for (cut, force) in cuts.iter_mut().zip([3.0, 4.0]) {
            for (channel, part) in [(2, 1.0), (3, 0.1)] {
                let channel = cut.channels[channel].as_mut().unwrap();
                for (b, level) in channel.level.iter_mut().enumerate() {
                    *level = 7.0
                        + if cut.steady.contains(&b) {
                            part * force
                        } else {
                            0.0
                        };
                }
            }
        }
        let data = CuttingData::new(Process::Drilling, 2, AS_IT_IS, cuts).unwrap();
        assert_relative_eq!(data.force_per_torque, 10.0, max_relative = 1e-12);
        // Where nothing says what a torque is worth it counts as it is.
        assert_eq!(turned(METAL, &[0.1]).force_per_torque, 1.0);
        let mut none = own(&data);
        for channel in none.iter_mut().filter_map(|c| c.channels[2].as_mut()) {
            channel.level = vec![7.0; 14];
        }
        assert_eq!(
            CuttingData::new(Process::Drilling, 2, AS_IT_IS, none)
                .unwrap()
                .force_per_torque,
            1.0
        );
    }

    /// A dynamometer turned by 30° about z: the inverse turns back.
    #[test]
    fn recorded_forces_are_the_tools_turned_back() {
        let (s, c) = (0.5, 0.75f64.sqrt());
        let turned_by = [[c, -s, 0.0], [s, c, 0.0], AS_IT_IS[2]];
        let data =
            CuttingData::new(Process::Milling, 2, turned_by, own(&milled(METAL, &MILLED[..1]))).unwrap();
        let back = [[c, s, 0.0], [-s, c, 0.0], AS_IT_IS[2]];
        for (found, expected) in data.dyno_from_tool.iter().flatten().zip(back.iter().flatten()) {
            assert_relative_eq!(*found, *expected, epsilon = 1e-12);
        }
        let lost = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], AS_IT_IS[2]];
        assert!(CuttingData::new(Process::Milling, 2, lost, own(&data)).is_err());
    }

    /// Two real numbers an order and one a block, less the offset and slope of each zero line and the angle of the tool.
    #[test]
    fn values_are_counted_less_what_is_fitted_to_the_cut_alone() {
        let data = milled(METAL, &MILLED[..2]);
        assert_eq!(data.cuts[0].value_count(), 3 * (2 * 12 + 14 - 2) - 1);
        assert_eq!(data.value_count(), 2 * data.cuts[0].value_count());
        assert_eq!(data.channel_count(), 6);
        assert_eq!(data.filtered(|i| i == 1).cuts[0].id, "cut-1");
    }

    /// What effects are told: a wear effect needs the order of the cuts, a speed effect their speeds, a size effect the feeds.
    #[test]
    fn the_summary_says_what_the_cuts_can_show() {
        let made = milled(METAL, &MILLED);
        let mut cuts = own(&made);
        for (cut, (order, speed)) in cuts.iter_mut().zip([(7, 50.0), (3, 200.0), (5, 100.0)]) {
            (cut.order, cut.cutting_speed_m_per_min) = (Some(order), speed);
        }
        let data = CuttingData::new(Process::Milling, 2, AS_IT_IS, cuts.clone()).unwrap();
        // From the 3rd to the 7th; against √(50 · 200) m/min.
        let settings: Vec<(f64, f64)> = data
            .cuts
            .iter()
            .map(|c| (c.setting.progress, c.setting.speed_ratio))
            .collect();
        assert_eq!(settings, [(1.0, 0.5), (0.0, 2.0), (0.5, 1.0)]);
        let s = &data.summary;
        assert_eq!((s.sequence_length, s.feeds, s.engagements, s.cuts), (3, 3, 3, 3));
        assert_eq!(s.speed_m_per_min, [50.0, 200.0]);
        assert_eq!((s.smallest_feed_mm, s.largest_feed_mm), (0.05, 0.1));
        assert_eq!(s.channels, [true, true, true, false]);
        assert!(s.straight_edge && s.one_helix && s.even_pitch && s.air_on_both_sides);
        // Order 12 of 50 Hz; fourteen blocks of a tenth of a second.
        assert_relative_eq!(s.highest_hz, 600.0, max_relative = 1e-12);
        assert_relative_eq!(s.longest_record_s, 1.4, max_relative = 1e-9);
        assert_eq!(s.vibration_hz, None);
        // One cut without its place, and there is no sequence; feeds a thousandth apart are one feed.
        cuts[1].order = None;
        cuts[1].feed_mm = 0.05 * 1.0005;
        cuts[2].steady = 3..10;
        let some = CuttingData::new(Process::Milling, 2, AS_IT_IS, cuts)
            .unwrap()
            .summary;
        assert_eq!(
            (some.sequence_length, some.feeds, some.air_on_both_sides),
            (0, 2, false)
        );
        let holes = drilled(HOLES, &[[0.2, 0.0], [0.3, 3.0], [0.3, 0.0]]).summary;
        assert_eq!(
            (holes.full_holes, holes.pilot_holes, holes.engagements),
            (2, 1, 0)
        );
        let uneven = changed(&made, |cut| {
            if let CutKind::Milling { cut, .. } = &mut cut.kind {
                cut.places = cut.places_or_even();
                cut.places[1].ahead_rad += 0.1;
                cut.places[1].lag_rad *= 1.1;
            }
        });
        let uneven = CuttingData::new(Process::Milling, 2, AS_IT_IS, own(&uneven))
            .unwrap()
            .summary;
        assert!(!uneven.even_pitch && !uneven.one_helix && uneven.straight_edge);
    }

    /// Where the contact may be is narrowed to the moment that zero line and shape of the entry fit best, and kept there.
    #[test]
    fn the_contact_of_a_drill_is_narrowed_to_where_its_entry_fits() {
        let data = drilled(HOLES, &[[0.05, 3.0]]);
        let mut cut = own(&data).remove(0);
        let CutKind::Drilling { cut: hole, contact_s } = &mut cut.kind else {
            unreachable!()
        };
        // 2.5 mm/s: it enters for half a second, from contact on.
        let entry = hole.entry_s();
        assert_relative_eq!(
            entry,
            3.25 / f64::to_radians(67.5).tan() / 2.5,
            max_relative = 1e-9
        );
        *contact_s = [-3.0, -0.3];
        for channel in cut.channels.iter_mut().flatten() {
            channel.level_std = vec![0.1; 14];
        }
        cut.narrow_contact();
        let CutKind::Drilling { contact_s, .. } = &cut.kind else {
            unreachable!()
        };
        let made = CONTACT_S;
        // A seventh of the entry and three blocks to either side, not beyond the beginning of the steady cut.
        assert_relative_eq!(contact_s[0], made - 0.15 * entry - 0.3, epsilon = 0.06);
        assert_eq!(contact_s[1], -0.3);
    }
}
