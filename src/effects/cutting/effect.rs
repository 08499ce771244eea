//! What an effect on cutting forces is to the loop: its parameters, and what it writes into the physics of a cut.

use std::fmt;

use crate::data::Process;
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::Dual;

/// What is known of a campaign's cuts when an effect is asked for its parameters, starts, or whether this data can show it.
#[derive(Debug, Clone, PartialEq)]
pub struct CuttingSummary {
    /// The one process of all cuts.
    pub process: Process,
    /// Teeth of the tool.
    pub teeth: usize,
    /// The edge runs straight up the side of the tool.
    pub straight_edge: bool,
    /// Number of cuts.
    pub cuts: usize,
    /// Different positions in the sequence of cuts; 0 where the campaign does not say.
    pub sequence_length: usize,
    /// Slowest and fastest cut.
    pub speed_m_per_min: [f64; 2],
    /// Different chip thicknesses at full engagement.
    pub feeds: usize,
    /// Smallest feed per tooth or revolution, mm.
    pub smallest_feed_mm: f64,
    /// Recorded channels x, y, z, torque that every cut has.
    pub channels: [bool; 4],
    /// Highest frequency that the order spectra hold, Hz; 0 where there are none.
    pub highest_hz: f64,
    /// Air before and after the cut, in every record.
    pub air_on_both_sides: bool,
    /// Holes drilled into full material.
    pub full_holes: usize,
    /// Holes drilled over a pilot hole.
    pub pilot_holes: usize,
    /// The baseline has edge coefficients.
    pub has_edge: bool,
    /// Middle of the lines found off the comb, Hz; `None` where there are none.
    pub vibration_hz: Option<f64>,
    /// Longest record, s.
    pub longest_record_s: f64,
    /// Largest cutting coefficient of the baseline, N/mm²: sets scales.
    pub cutting_scale_n_per_mm2: f64,
}

/// What a cut's forces are made with; effects change it. Lengths mm, forces N, coefficients N/mm² and N/mm.
#[derive(Debug, Clone)]
pub struct CutPhysics {
    /// Of this cut: milling and turning Ktc Krc Kac Kte Kre Kae; drilling Ktc Kte Kfc Kfe.
    pub coefficient: Vec<Dual>,
    /// p in K ∝ (h / 0.1 mm)^−p.
    pub size_exponent: Option<Dual>,
    /// Eccentric tool; `None` where it runs true.
    pub runout: Option<Runout>,
    /// Thrust of the chisel edge in a full hole, N.
    pub chisel_thrust_n: Option<Dual>,
    /// Friction force on the circumference for each mm of depth, N.
    pub margin_n_per_mm: Option<Dual>,
    /// Rotation of the recorded x, y, z forces.
    pub tilt: Option<Mixing>,
    /// Natural frequency (Hz) and damping ratio of each channel.
    pub dynamics: Option<[[Dual; 2]; 3]>,
    /// Recorded x, y, z as mixtures of what the channels should show.
    pub crosstalk: Option<Mixing>,
    /// Additive transients exp(−t/τ) of free amplitude, by channel: τ, s.
    pub transient_s: Option<[Dual; 4]>,
    /// Leaking charge amplifiers, by channel: 1/τ, 1/s.
    pub leak_per_s: Option<[Dual; 4]>,
    /// Chatter; `None` where there is none.
    pub vibration: Option<Vibration>,
}

/// Rows of a 3×3 matrix.
pub type Mixing = [[Dual; 3]; 3];

/// The tool's axis beside the spindle's.
#[derive(Debug, Clone)]
pub struct Runout {
    /// Distance of the two axes, mm.
    pub offset_mm: Dual,
    /// From tooth 0.
    pub angle_rad: Dual,
}

/// A self-excited vibration of the tool against the workpiece, in cuts whose records show one.
#[derive(Debug, Clone)]
pub struct Vibration {
    /// Of the chatter, Hz.
    pub frequency_hz: Dual,
    /// Amplitude, mm.
    pub amplitude_mm: Dual,
    /// From x towards y.
    pub direction_rad: Dual,
}

/// The cut that an effect is applied to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutSetting {
    /// Of the cut.
    pub process: Process,
    /// 0 at the first cut of the sequence, 1 at the last.
    pub progress: f64,
    /// Cutting speed over the geometric mean of the slowest and fastest cut.
    pub speed_ratio: f64,
    /// Per tooth (milling), per revolution (drilling, turning).
    pub feed_mm: f64,
    /// The record shows lines off the tooth-passing comb.
    pub has_vibration: bool,
}

/// One physical effect on cutting forces or their measurement.
pub trait CuttingEffect: Sync {
    /// As in docs/effects.md: `tool-wear`.
    fn id(&self) -> &'static str;

    /// The physics in plain words, one or two sentences.
    fn explanation(&self) -> &'static str;

    /// How it shows in force records, one sentence.
    fn fingerprint(&self) -> &'static str;

    /// How to check it in the lab, usual sizes, sources.
    fn background(&self) -> Background;

    /// Discrete choices.
    fn variants(&self) -> usize {
        1
    }

    /// Name of a discrete choice as (key, value) for the JSON; `None` where there is no choice.
    fn variant_label(&self, _variant: usize) -> Option<(&'static str, &'static str)> {
        None
    }

    /// Why this campaign cannot show the effect; `None` if it can.
    fn obstacle(&self, data: &CuttingSummary) -> Option<String>;

    /// Tunable quantities. `nominal` is the first starting value.
    fn parameters(&self, variant: usize, data: &CuttingSummary) -> Vec<Parameter>;

    /// Further starting points, natural values in the order of the parameters.
    fn starts(&self, _variant: usize, _data: &CuttingSummary) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// Why this effect cannot be of the size that was fitted (parameters in their order); `None` if it can.
    fn impossible(&self, _sizes: &[Size]) -> Option<String> {
        None
    }

    /// Values of [`Self::parameters`] (given), natural units, at which the effect is not there: the model is the one without
    /// it, to rounding. They may lie outside the parameters' bounds, which are those of an effect worth a name. `None` only
    /// for what is simulated and never fitted.
    fn vanishing(&self, _variant: usize, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        None
    }

    /// Free amplitudes for each cut and channel that are fitted along without standing in the list of parameters.
    fn nuisances_per_channel(&self, _variant: usize) -> usize {
        0
    }

    /// Effects with lower order are applied first (edge coefficients are there before they wear).
    fn order(&self) -> u8 {
        1
    }

    /// Writes the effect into the physics of a cut; `values`: natural values of its parameters in their order.
    fn apply(&self, variant: usize, values: &[Dual], setting: &CutSetting, physics: &mut CutPhysics);
}

/// An effect and its discrete choice: what is added to a model.
#[derive(Clone, Copy)]
pub struct CuttingInstance {
    /// The effect.
    pub effect: &'static dyn CuttingEffect,
    /// Its discrete choice, from 0.
    pub variant: usize,
}

impl CuttingInstance {
    /// The id; the discrete choice is not part of it.
    pub fn label(&self) -> String {
        self.effect.id().to_string()
    }
}

impl fmt::Debug for CuttingInstance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}", self.effect.id(), self.variant)
    }
}

impl PartialEq for CuttingInstance {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id() == other.effect.id() && self.variant == other.variant
    }
}

/// Unit matrix.
pub(super) fn unit_mixing() -> Mixing {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| Dual::constant(f64::from(u8::from(i == j)))))
}

pub(super) fn linear(
    name: impl Into<String>,
    unit: &'static str,
    nominal: f64,
    std: f64,
    mean: f64,
    bounds: [f64; 2],
) -> Parameter {
    Parameter {
        name: name.into(),
        unit,
        scale: Scale::Linear,
        nominal,
        prior: Some(Prior { mean, std }),
        bounds,
    }
}

pub(super) fn logarithmic(
    name: impl Into<String>,
    unit: &'static str,
    nominal: f64,
    std: f64,
    bounds: [f64; 2],
) -> Parameter {
    Parameter {
        name: name.into(),
        unit,
        scale: Scale::Logarithmic,
        nominal,
        prior: Some(Prior {
            mean: nominal.ln(),
            std,
        }),
        bounds,
    }
}

/// Share of an effect's usual size that no measurement can show.
pub(super) const NEGLIGIBLE: f64 = 1e-10;

pub(super) fn milling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Milling)
        .then(|| "milling only: it shows in the waveform over a revolution".to_string())
}

pub(super) fn straight_edge_only(data: &CuttingSummary) -> Option<String> {
    (data.process == Process::Milling && !data.straight_edge).then(|| {
        "not worked out for an edge that is not straight (corner_radius_mm, lead_angle_deg of [tool])"
            .to_string()
    })
}

pub(super) fn drilling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Drilling).then(|| "drilling only".to_string())
}
