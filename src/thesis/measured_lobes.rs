//! The thesis's drilling lobes (table 30) computed again from its own measurements.
//!
//! The measured FRFs are not published, but the ten deepest minima of their real parts are, per configuration and
//! axis. Each is taken as a mode of its own: the real part of (1/k)/(1 − r² + 2iζr) is least at f = f_n √(1 + 2ζ),
//! where it is −1/(4kζ(1 + ζ)); ζ is the measured one of that configuration and axis. No cross FRFs are known.

use serde::{Deserialize, Serialize};

use crate::lobes::{
    AbsoluteLimit, AxisMode, LobeCurve, ModalFrf, Peak, RegenerativeForce, SpeedLimit, StabilitySolver,
    peaks, speed_grid,
};
use crate::{Error, Result};

const MINIMA: &str = include_str!("../../datasets/irb6640/real_part_minima_measured.csv");
const MODAL: &str = include_str!("../../datasets/irb6640/modal_measured.csv");
const PEAKS: &str = include_str!("../../datasets/irb6640/stability_peaks.csv");
const CONDITIONS: &str = include_str!("../../datasets/irb6640/cutting_conditions.toml");

/// Tips farther than this from where they are expected belong to something else.
const WINDOW: f64 = 0.1;

/// One configuration of table 30: our lobes and those of the two published programs.
#[derive(Debug, Clone, Serialize)]
pub struct ThesisLobes {
    /// 1..4, as in the thesis.
    pub configuration: u32,
    /// Strongest measured mode, which sets the speeds: peaks lie near 60 f/(N k).
    pub dominant_hz: f64,
    /// Ours, 100–1500 rpm in steps of 1 rpm.
    pub curve: LobeCurve,
    /// Ours at the tip near 60 f/(2 N), between lobes 1 and 2, to the rpm (the true tip is up to 4 % deeper).
    pub second_region: Peak,
    /// Ours at the tip near 60 f/N, between lobes 0 and 1, to the rpm.
    pub first_region: Peak,
    /// Ours, over all speeds.
    pub absolute_limit: AbsoluteLimit,
    /// The commercial program on the measured FRFs, in the order of the thesis (lower speed first).
    pub commercial: Vec<Peak>,
    /// The thesis's program, whose depths are about a hundred times too deep.
    pub published_program: Vec<Peak>,
}

#[derive(Deserialize)]
struct MinimumRow {
    configuration: u32,
    axis: String,
    frequency_hz: f64,
    real_receptance_m_per_n: f64,
}

#[derive(Deserialize)]
struct ModalRow {
    configuration: u32,
    axis: String,
    frequency_hz: f64,
    peak_real_receptance_m_per_n: f64,
    damping_ratio: f64,
}

#[derive(Deserialize)]
struct PeakRow {
    configuration: u32,
    cutpro_rpm: f64,
    cutpro_depth_mm: f64,
    published_program_rpm: f64,
    published_program_depth_mm: f64,
}

#[derive(Deserialize)]
struct Conditions {
    lobes: LobeConditions,
}

#[derive(Deserialize)]
pub(super) struct LobeConditions {
    pub ktc_n_per_mm2: f64,
    pub krc_n_per_mm2: f64,
    pub half_tip_angle_rad: f64,
    pub flutes: usize,
    pub speed_step_rpm: f64,
}

fn rows<T: for<'de> Deserialize<'de>>(name: &str, text: &str) -> Result<Vec<T>> {
    csv::Reader::from_reader(text.as_bytes())
        .deserialize()
        .collect::<std::result::Result<_, _>>()
        .map_err(|e| Error::computation(format!("built-in {name}: {e}")))
}

pub(super) fn conditions() -> Result<LobeConditions> {
    let Conditions { lobes } = toml::from_str(CONDITIONS)
        .map_err(|e| Error::computation(format!("built-in cutting_conditions.toml: {e}")))?;
    Ok(lobes)
}

/// The force of table 30: drilling directional matrix with the thesis's milling coefficients of Al 7075.
pub fn thesis_force() -> Result<RegenerativeForce> {
    let lobes = conditions()?;
    RegenerativeForce::drilling_lateral(
        lobes.ktc_n_per_mm2,
        lobes.krc_n_per_mm2,
        lobes.half_tip_angle_rad,
        lobes.flutes,
    )
}

/// The modes rebuilt out of the measured minima of a configuration; axis 0 = X, 1 = Y.
pub fn thesis_modes(configuration: u32) -> Result<Vec<AxisMode>> {
    let modal: Vec<ModalRow> = rows("modal_measured.csv", MODAL)?;
    let minima: Vec<MinimumRow> = rows("real_part_minima_measured.csv", MINIMA)?;
    minima
        .iter()
        .filter(|m| m.configuration == configuration)
        .map(|m| {
            let zeta = modal
                .iter()
                .find(|row| row.configuration == configuration && row.axis == m.axis)
                .map(|row| row.damping_ratio)
                .ok_or_else(|| {
                    Error::computation(format!(
                        "built-in modal_measured.csv: no damping for configuration {configuration}, axis {}",
                        m.axis
                    ))
                })?;
            Ok(AxisMode {
                axis: usize::from(m.axis == "Y"),
                frequency_hz: m.frequency_hz / (1.0 + 2.0 * zeta).sqrt(),
                damping_ratio: zeta,
                stiffness_n_per_m: 1.0 / (4.0 * zeta * (1.0 + zeta) * m.real_receptance_m_per_n.abs()),
            })
        })
        .collect()
}

/// Table 30 side by side, one entry a configuration.
///
/// # Errors
/// Only where the built-in tables are damaged.
pub fn thesis_lobes() -> Result<Vec<ThesisLobes>> {
    let modal: Vec<ModalRow> = rows("modal_measured.csv", MODAL)?;
    let published: Vec<PeakRow> = rows("stability_peaks.csv", PEAKS)?;
    let force = thesis_force()?;
    let speeds = speed_grid([100.0, 1500.0, 1.0])?;
    let mut configurations: Vec<u32> = published.iter().map(|row| row.configuration).collect();
    configurations.dedup();
    configurations
        .into_iter()
        .map(|configuration| {
            let missing = |what: &str| {
                Error::computation(format!(
                    "built-in tables: configuration {configuration} has no {what}"
                ))
            };
            let frf = ModalFrf::from_axis_modes(&thesis_modes(configuration)?)?;
            let solver = StabilitySolver::new(force, &frf);
            let curve = solver.curve(&speeds);
            let dominant_hz = modal
                .iter()
                .filter(|row| row.configuration == configuration)
                .max_by(|a, b| {
                    a.peak_real_receptance_m_per_n
                        .total_cmp(&b.peak_real_receptance_m_per_n)
                })
                .map(|row| row.frequency_hz)
                .ok_or_else(|| missing("measured mode"))?;
            let tip = |waves: f64| {
                let expected = 60.0 * dominant_hz / (force.teeth as f64 * waves);
                tip_near(&curve, expected).ok_or_else(|| missing("stability peak"))
            };
            let rows = || published.iter().filter(|row| row.configuration == configuration);
            let peak = |spindle_rpm, depth_mm| Peak::new(spindle_rpm, Some(depth_mm));
            Ok(ThesisLobes {
                configuration,
                dominant_hz,
                second_region: tip(2.0)?,
                first_region: tip(1.0)?,
                absolute_limit: solver.absolute_limit().ok_or_else(|| missing("limit"))?,
                commercial: rows().map(|r| peak(r.cutpro_rpm, r.cutpro_depth_mm)).collect(),
                published_program: rows()
                    .map(|r| peak(r.published_program_rpm, r.published_program_depth_mm))
                    .collect(),
                curve,
            })
        })
        .collect()
}

/// The deepest tip within the window about a speed.
pub(super) fn tip_near(curve: &LobeCurve, expected_rpm: f64) -> Option<Peak> {
    let depth = |p: &Peak| p.depth_mm.unwrap_or(f64::INFINITY);
    peaks(curve)
        .into_iter()
        .filter(|p| (p.spindle_rpm / expected_rpm - 1.0).abs() < WINDOW)
        .max_by(|a, b| depth(a).total_cmp(&depth(b)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Computed independently of this program.
    #[test]
    fn table_30_is_what_the_reference_computation_gave() {
        let expected = [
            ((185.0, 0.150), (367.0, 0.320), 0.0218),
            ((221.0, 0.126), (440.0, 0.291), 0.0195),
            ((217.0, 0.096), (430.0, 0.214), 0.0228),
            ((185.0, 0.108), (367.0, 0.238), 0.0279),
        ];
        let ours = thesis_lobes().unwrap();
        assert_eq!(ours.len(), 4);
        for (lobes, (second, first, absolute)) in ours.iter().zip(expected) {
            for (tip, (rpm, depth)) in [(lobes.second_region, second), (lobes.first_region, first)] {
                assert!((tip.spindle_rpm - rpm).abs() <= 1.0, "{tip:?} {rpm}");
                // The table's depths have three decimals.
                assert_relative_eq!(tip.depth_mm.unwrap(), depth, epsilon = 0.00075);
            }
            assert_relative_eq!(lobes.absolute_limit.depth_mm, absolute, epsilon = 0.00005);
            assert_eq!((lobes.commercial.len(), lobes.published_program.len()), (2, 2));
        }
    }
}
