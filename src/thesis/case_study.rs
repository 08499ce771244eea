//! The study as a whole: each table as published, as measured and from this model, side by side.

use super::cutting_tables::{CuttingTables, cutting_tables};
use super::lobe_assumptions::{AssumptionSwitched, assumptions_switched, reading};
use super::measured_lobes::{ThesisLobes, thesis_force, thesis_lobes};
use super::published::{
    FREQUENCIES, FrequencyRow, MINIMA, MODAL, MinimumRow, ModalRow, RECURRING_BANDS, STATIC_STIFFNESS,
    StaticRow, rows, untuned_model,
};
use super::real_case::{RealCase, real_case};
use crate::Result;
use crate::identify::frfs::calibrate::estimates;
use crate::identify::resonances::modal_table::{self, StrongestMode};
use crate::identify::{Estimate, StructureModel};
use crate::ingest::Axis;
use crate::lobes::{AbsoluteLimit, Peak, RobotFrf, SpeedLimit, StabilitySolver, peak_near, speed_grid};
use crate::robot::{PostureReport, posture_deg};

/// Configurations the modal table is fitted on; the last one is predicted.
pub const FITTED_CONFIGURATIONS: [&str; 3] = ["1", "2", "3"];

/// One quantity as published, measured and modelled here.
#[derive(Debug, Clone, serde::Serialize)]
pub struct ComparedRow {
    /// Posture or configuration.
    pub posture: String,
    /// `Kx`, `f X`, …
    pub quantity: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// The thesis's own model; `None` where it prints no value.
    pub published_model: Option<f64>,
    /// Measured by the thesis; `None` where it was not.
    pub measured: Option<f64>,
    /// This model with the published joint compliances, nothing tuned.
    pub before: f64,
    /// After calibration on the modal table of configurations 1–3.
    pub after: f64,
    /// True where this row's measurement was used in the calibration.
    pub fitted: bool,
}

/// A group of measured resonances for which the model calibrated on the strongest modes has no mode.
#[derive(Debug, Clone, serde::Serialize)]
pub struct Unexplained {
    /// Lower end of the band, Hz.
    pub from_hz: f64,
    /// Upper end of the band, Hz.
    pub to_hz: f64,
    /// Minima of the real part that fall in the band, all configurations and axes.
    pub minima: usize,
    /// Configurations in which they appear.
    pub configurations: Vec<String>,
    /// Model frequency nearest to the band at any configuration, Hz.
    pub nearest_model_hz: f64,
}

/// The case study's numbers.
#[derive(Debug, Clone, serde::Serialize)]
pub struct CaseStudy {
    /// Tables 5 and 6: "end effector" in the thesis, read as the flange.
    pub static_stiffness: Vec<ComparedRow>,
    /// What else "end effector" may be: the model's static stiffness at the tool point over that at the flange before
    /// calibration, least and most over the measured postures and axes.
    pub tool_over_flange: [f64; 2],
    /// Tables 9 and 15.
    pub frequencies: Vec<ComparedRow>,
    /// Peak real receptance of the strongest mode.
    pub receptances: Vec<ComparedRow>,
    /// Joint stiffnesses and damping, calibrated on the modal table of configurations 1–3.
    pub parameters: Vec<Estimate>,
    /// Whether that calibration converged.
    pub converged: bool,
    /// Root mean square of the relative frequency error on the fitted configurations and on the predicted one.
    pub fitted_frequency_error: f64,
    /// On the predicted configuration.
    pub predicted_frequency_error: f64,
    /// Bands of measured resonances in which the calibrated model has no mode.
    pub unexplained: Vec<Unexplained>,
    /// What the loop proposes for them.
    pub real_case: RealCase,
    /// Table 30.
    pub lobes: Vec<LobeRow>,
    /// Table 30 with one assumption switched at a time.
    pub lobe_assumptions: Vec<AssumptionSwitched>,
    /// What that comes to, for people.
    pub lobe_reading: Vec<String>,
    /// Tables 20 and 23.
    pub cutting: CuttingTables,
}

/// Table 30 for one configuration: tips of the stability envelope and the absolute limit.
#[derive(Debug, Clone, serde::Serialize)]
pub struct LobeRow {
    /// 1..4, as in the thesis.
    pub configuration: u32,
    /// The commercial program on the measured FRFs.
    pub commercial: Vec<Peak>,
    /// The thesis's own program.
    pub published_program: Vec<Peak>,
    /// This program on FRFs rebuilt from the measured minima of the real part.
    pub from_measurements: LobeTips,
    /// This program on the robot model, published compliances, nothing tuned.
    pub from_model_before: LobeTips,
    /// The same after calibration on the modal table of configurations 1–3.
    pub from_model_after: LobeTips,
}

/// Tips of an envelope near 60 f/(N k) for k = 2 and 1 of the dominant mode, and its least depth.
#[derive(Debug, Clone, serde::Serialize)]
pub struct LobeTips {
    /// Tip near 60 f/(2 N), between lobes 1 and 2.
    pub second_region: Option<Peak>,
    /// Tip near 60 f/N, between lobes 0 and 1.
    pub first_region: Option<Peak>,
    /// Least depth of the envelope; `None` where nothing is limited.
    pub absolute_limit: Option<AbsoluteLimit>,
}

/// Works out all tables.
pub fn case_study() -> Result<CaseStudy> {
    let model = untuned_model()?;
    let modal: Vec<ModalRow> = rows(MODAL)?;
    let strongest = modal
        .iter()
        .map(|row| strongest_mode(&model, row))
        .collect::<Result<Vec<_>>>()?;
    let is_fitted = |configuration: &str| FITTED_CONFIGURATIONS.contains(&configuration);
    let fitted: Vec<StrongestMode> = modal
        .iter()
        .zip(&strongest)
        .filter(|(row, _)| is_fitted(&row.configuration))
        .map(|(_, mode)| mode.clone())
        .collect();
    let nominal = model.nominal_theta();
    let fit = modal_table::fit(&model, &fitted)?;
    let before = modal_table::predict(&model, &nominal, &strongest)?;
    let after = modal_table::predict(&model, &fit.theta, &strongest)?;

    let published: Vec<FrequencyRow> = rows(FREQUENCIES)?;
    let published_hz = |row: &ModalRow| {
        published
            .iter()
            .find(|p| p.configuration == row.configuration && p.axis == row.axis)
            .map(|p| p.published_model_hz)
    };
    let mut frequencies = Vec::new();
    let mut receptances = Vec::new();
    let (mut fit_sum, mut prediction_sum) = ((0.0, 0usize), (0.0, 0usize));
    for ((row, before), after) in modal.iter().zip(&before).zip(&after) {
        let fitted = is_fitted(&row.configuration);
        frequencies.push(ComparedRow {
            posture: row.configuration.clone(),
            quantity: format!("f {}", row.axis),
            unit: "Hz",
            published_model: published_hz(row),
            measured: Some(row.frequency_hz),
            before: before.frequency_hz,
            after: after.frequency_hz,
            fitted,
        });
        receptances.push(ComparedRow {
            posture: row.configuration.clone(),
            quantity: format!("max Re {}{}", row.axis, row.axis),
            unit: "m/N",
            published_model: None,
            measured: Some(row.peak_real_receptance_m_per_n),
            before: before.peak_real_m_per_n,
            after: after.peak_real_m_per_n,
            fitted,
        });
        let sum = if fitted { &mut fit_sum } else { &mut prediction_sum };
        sum.0 += (after.frequency_hz / row.frequency_hz - 1.0).powi(2);
        sum.1 += 1;
    }
    let rms = |(sum, count): (f64, usize)| (sum / count.max(1) as f64).sqrt();

    // The table's standard deviations are assumed, not estimated: no widening by the misfit.
    let parameters = estimates(&model.parameters, &fit, 1.0)?;
    let measured_lobes = thesis_lobes()?;
    let lobe_assumptions = assumptions_switched(&measured_lobes)?;
    Ok(CaseStudy {
        static_stiffness: static_rows(&model, &nominal, &fit.theta)?,
        tool_over_flange: tool_over_flange(&model, &nominal)?,
        frequencies,
        receptances,
        parameters,
        converged: fit.converged(),
        fitted_frequency_error: rms(fit_sum),
        predicted_frequency_error: rms(prediction_sum),
        unexplained: unexplained(&model, &fit.theta)?,
        real_case: real_case(&model)?,
        lobe_reading: reading(&lobe_assumptions),
        lobe_assumptions,
        lobes: lobe_rows(measured_lobes, &model, &nominal, &fit.theta)?,
        cutting: cutting_tables()?,
    })
}

fn strongest_mode(model: &StructureModel, row: &ModalRow) -> Result<StrongestMode> {
    Ok(StrongestMode {
        kinematics: model.robot.kinematics(&posture_deg(&row.configuration)?)?,
        axis: if row.axis == "Y" { Axis::Y } else { Axis::X },
        frequency_hz: row.frequency_hz,
        peak_real_m_per_n: row.peak_real_receptance_m_per_n,
    })
}

/// Flange stiffness at all postures, measured at A and B.
fn static_rows(model: &StructureModel, nominal: &[f64], fitted: &[f64]) -> Result<Vec<ComparedRow>> {
    let mut result = Vec::new();
    for row in rows::<StaticRow>(STATIC_STIFFNESS)? {
        let kinematics = model.robot.kinematics(&posture_deg(&row.posture)?)?;
        let stiffness = |theta: &[f64]| -> Result<[f64; 3]> {
            let report = PostureReport::new(
                &model.robot,
                &kinematics,
                &model.chain(theta, &kinematics, Default::default(), false),
            )?;
            Ok(report.flange_stiffness_n_per_m)
        };
        let (before, after) = (stiffness(nominal)?, stiffness(fitted)?);
        for (axis, quantity, measured, published) in [
            (0, "Kx", row.kx_measured_n_per_m, row.kx_published_model_n_per_m),
            (1, "Ky", row.ky_measured_n_per_m, row.ky_published_model_n_per_m),
        ] {
            result.push(ComparedRow {
                posture: row.posture.clone(),
                quantity: quantity.into(),
                unit: "N/m",
                published_model: Some(published),
                measured,
                before: before[axis],
                after: after[axis],
                fitted: false,
            });
        }
    }
    Ok(result)
}

/// See [`CaseStudy::tool_over_flange`].
fn tool_over_flange(model: &StructureModel, theta: &[f64]) -> Result<[f64; 2]> {
    let mut range = [f64::INFINITY, 0.0f64];
    for row in rows::<StaticRow>(STATIC_STIFFNESS)? {
        if row.kx_measured_n_per_m.is_none() {
            continue;
        }
        let kinematics = model.robot.kinematics(&posture_deg(&row.posture)?)?;
        let chain = model.chain(theta, &kinematics, Default::default(), false);
        let report = PostureReport::new(&model.robot, &kinematics, &chain)?;
        for axis in 0..2 {
            let ratio = report.tcp_stiffness_n_per_m[axis] / report.flange_stiffness_n_per_m[axis];
            range = [range[0].min(ratio), range[1].max(ratio)];
        }
    }
    Ok(range)
}

impl CaseStudy {
    /// Where the static stiffness is compared, and why there.
    pub fn static_place(&self) -> String {
        let [low, high] = self.tool_over_flange;
        format!(
            "The thesis says \"end effector\" for the place of the static test and no more. The flange is compared: a dial gauge \
             needs a face, and the tool's own length would be part of what is called the robot's stiffness. Measured at the \
             tool point instead, the model's numbers would be {low:.2} to {high:.2} times those here."
        )
    }
}

/// Speeds of the lobes, rpm: from, to, step.
const SPINDLE_RPM: [f64; 3] = [100.0, 1500.0, 1.0];

fn lobe_rows(
    measured: Vec<ThesisLobes>,
    model: &StructureModel,
    nominal: &[f64],
    fitted: &[f64],
) -> Result<Vec<LobeRow>> {
    measured
        .into_iter()
        .map(|row| {
            let of_model = |theta: &[f64]| model_tips(model, theta, row.configuration);
            Ok(LobeRow {
                configuration: row.configuration,
                from_model_before: of_model(nominal)?,
                from_model_after: of_model(fitted)?,
                from_measurements: LobeTips {
                    second_region: Some(row.second_region),
                    first_region: Some(row.first_region),
                    absolute_limit: Some(row.absolute_limit),
                },
                commercial: row.commercial,
                published_program: row.published_program,
            })
        })
        .collect()
}

/// The envelope of the robot model at a configuration: deepest tips within 10 % of where the dominant mode puts them.
fn model_tips(model: &StructureModel, theta: &[f64], configuration: u32) -> Result<LobeTips> {
    let force = thesis_force()?;
    let kinematics = model
        .robot
        .kinematics(&posture_deg(&configuration.to_string())?)?;
    let chain = model.robot.chain(&kinematics, &model.baseline(theta, false));
    let frf = RobotFrf::new(&model.robot, &kinematics, &chain)?;
    let solver = StabilitySolver::new(force, &frf);
    let curve = solver.curve(&speed_grid(SPINDLE_RPM)?);
    let absolute_limit = solver.absolute_limit();
    // The mode that sets the absolute limit dominates; its chatter frequency lies a little above its own.
    let tip = |k: f64| {
        let expected = 60.0 * absolute_limit?.chatter_hz / (force.teeth as f64 * k);
        peak_near(&curve, [0.9 * expected, 1.1 * expected])
    };
    Ok(LobeTips {
        second_region: tip(2.0),
        first_region: tip(1.0),
        absolute_limit,
    })
}

fn unexplained(model: &StructureModel, theta: &[f64]) -> Result<Vec<Unexplained>> {
    let minima: Vec<MinimumRow> = rows(MINIMA)?;
    let mut model_hz = Vec::new();
    for id in ["1", "2", "3", "4"] {
        let kinematics = model.robot.kinematics(&posture_deg(id)?)?;
        let report = PostureReport::new(
            &model.robot,
            &kinematics,
            &model.chain(theta, &kinematics, Default::default(), false),
        )?;
        model_hz.extend(report.natural_frequencies_hz);
    }
    Ok(RECURRING_BANDS
        .iter()
        .map(|&(from_hz, to_hz)| {
            let inside: Vec<&MinimumRow> = minima
                .iter()
                .filter(|m| (from_hz..=to_hz).contains(&m.frequency_hz))
                .collect();
            let mut configurations: Vec<String> = inside.iter().map(|m| m.configuration.clone()).collect();
            configurations.dedup();
            let distance = |f: f64| (from_hz - f).max(f - to_hz).max(0.0);
            let nearest_model_hz = model_hz
                .iter()
                .copied()
                .min_by(|a, b| distance(*a).total_cmp(&distance(*b)))
                .unwrap_or(0.0);
            Unexplained {
                from_hz,
                to_hz,
                minima: inside.len(),
                configurations,
                nearest_model_hz,
            }
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corrected_model_is_near_the_measurements_where_the_published_one_was_not() {
        let study = case_study().unwrap();
        assert!(study.converged);
        for row in study.static_stiffness.iter().filter(|r| r.measured.is_some()) {
            let measured = row.measured.unwrap();
            assert!((row.before / measured - 1.0).abs() < 0.2, "{row:?}");
        }
        let kx_a = &study.static_stiffness[0];
        assert!(kx_a.published_model.unwrap() > 10.0 * kx_a.measured.unwrap());
        for row in &study.frequencies {
            assert!(row.published_model.unwrap() > 1.9 * row.measured.unwrap());
        }
        // Fit on configurations 1-3, prediction of 4: the honest figures, not a target.
        assert!(
            study.fitted_frequency_error < 0.06,
            "{}",
            study.fitted_frequency_error
        );
        assert!(
            study.predicted_frequency_error < 0.20,
            "{}",
            study.predicted_frequency_error
        );
        // Nothing in the model vibrates in the two recurring bands.
        for band in &study.unexplained {
            assert!(band.minima > 0);
            let f = band.nearest_model_hz;
            assert!(f < band.from_hz || f > band.to_hz, "{band:?}");
        }
    }
}
