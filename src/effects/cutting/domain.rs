//! The forces of a cut as a [`Domain`]: effects write into the [`CutPhysics`] of each cut.

use crate::cutting::waveform::MillingCut;
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
    /// The records show another number of teeth, or another speed of all cuts.
    pub teeth_in_doubt: bool,
    /// The edge runs straight up the side of the tool.
    pub straight_edge: bool,
    /// All teeth have one helix angle.
    pub one_helix: bool,
    /// The teeth are evenly spaced, as the campaign has them.
    pub even_pitch: bool,
    /// Different engagements of the cutter: depth, entry and exit angle.
    pub engagements: usize,
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
    /// Largest feed per tooth or revolution, mm.
    pub largest_feed_mm: f64,
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
    /// p in K ∝ (h / 0.1 mm)^−p, of the tangential, radial and axial coefficient (drilling: of torque and twice of thrust).
    pub size_exponent: Option<[Dual; 3]>,
    /// Eccentric tool; `None` where it runs true.
    pub runout: Option<Runout>,
    /// Teeth that differ beyond what the tool's description says; `None` where they do not.
    pub own_teeth: Option<OwnTeeth>,
    /// Way of the tool along its axis out of the work for the mean axial force on it, mm/N.
    pub axial_compliance_mm_per_n: Option<Dual>,
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

impl CutPhysics {
    /// A plain cut with these coefficients.
    pub fn of(coefficient: Vec<Dual>) -> Self {
        CutPhysics {
            coefficient,
            size_exponent: None,
            runout: None,
            own_teeth: None,
            axial_compliance_mm_per_n: None,
            chisel_thrust_n: None,
            margin_n_per_mm: None,
            tilt: None,
            dynamics: None,
            crosstalk: None,
            transient_s: None,
            leak_per_s: None,
            vibration: None,
        }
    }
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

/// What is added to radius and angle of single teeth, in the order in which [`MillingCut`] counts them: each is ahead of the one before
/// and cuts before it.
#[derive(Debug, Clone, Default)]
pub struct OwnTeeth {
    /// Beyond the radius, mm: number of the tooth, amount.
    radius_mm: Vec<(usize, Dual)>,
    /// Ahead of its place, rad.
    ahead_rad: Vec<(usize, Dual)>,
}

impl OwnTeeth {
    /// Adds to the radius of a tooth, by its number in the order of cutting (that of campaign.toml), from 0.
    pub fn add_radius(&mut self, tooth: usize, teeth: usize, radius_mm: Dual) {
        self.radius_mm.push(((teeth - tooth % teeth) % teeth, radius_mm));
    }

    /// Puts a tooth later, by its number in the order of cutting, from 0: by an angle of the tool.
    pub fn add_delay(&mut self, tooth: usize, teeth: usize, delay_rad: &Dual) {
        let index = (teeth - tooth % teeth) % teeth;
        self.ahead_rad.push((index, delay_rad.scale(-1.0)));
    }

    /// Numbers of teeth and what is added to their radii, mm.
    pub fn radii(&self) -> impl Iterator<Item = (usize, &Dual)> {
        self.radius_mm.iter().map(|(index, by)| (*index, by))
    }

    /// Numbers of teeth and what is added to their angles, rad.
    pub fn angles(&self) -> impl Iterator<Item = (usize, &Dual)> {
        self.ahead_rad.iter().map(|(index, by)| (*index, by))
    }

    /// The cut with these teeth.
    pub fn on(&self, cut: &MillingCut) -> MillingCut {
        let mut places = cut.places_or_even();
        for (index, by) in self.radii() {
            if let Some(place) = places.get_mut(index) {
                place.radius_mm += by.value;
            }
        }
        for (index, by) in self.angles() {
            if let Some(place) = places.get_mut(index) {
                place.ahead_rad += by.value;
            }
        }
        MillingCut {
            places,
            ..cut.clone()
        }
    }
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
    /// Teeth of the tool.
    pub teeth: usize,
    /// The record shows lines off the tooth-passing comb.
    pub has_vibration: bool,
}
