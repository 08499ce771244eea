//! The forces of a cut as a [`Domain`]: effects write into the [`CutPhysics`] of each cut.

use crate::data::Process;
use crate::effects::{Domain, Known};
use crate::robot::Dual;

/// Effects on cutting forces and on their measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cutting;

impl Domain for Cutting {
    type Object = ();
    type Summary = CuttingSummary;
    type Setting<'a> = CutSetting;
    type Physics = CutPhysics;
    type Sensors = ();
}

impl Known<'static, Cutting> {
    /// A summary of cuts: they have no places.
    pub fn cuts(data: CuttingSummary) -> Self {
        Known { object: &(), data }
    }
}

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

/// The tool's axis off the spindle's.
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
