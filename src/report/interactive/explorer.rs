//! All FRFs of a campaign to choose from: measured against the model at each of its revisions.

use num_complex::Complex64;
use serde_json::{Value, json};

use super::frf::{Look, bode_layout, bode_trace, nyquist_layout, nyquist_trace};
use super::packed::{bends, magnitudes, phases};
use super::plot::numbers;
use crate::analysis::StructureFindings;
use crate::campaign::{MeasuredDof, Point};
use crate::discrepancy::FrfComparison;
use crate::ingest::Dof;
use crate::report::figure::sheet::style;
use crate::report::figure::{FrfCurve, lowest_phase};
use crate::report::number::{percent, significant};

const UNIT: &str = "m/N";
/// Complex values in the page at most, measured and of all models: some 1.2 MB of it, so that all of it stays below 3 MB.
const MOST_VALUES: usize = 400_000;

/// FRFs, models, and what to show first.
#[derive(Debug, Clone)]
pub struct Explorer {
    value: Value,
    /// Only every so many lines are in the page.
    pub every: usize,
}

/// A model of the FRFs: what it is called, what it predicts and how well.
pub struct ExplorerStage<'a> {
    pub title: String,
    predicted: &'a [Vec<Complex64>],
    pub comparison: &'a FrfComparison,
}

/// The models of a campaign from the robot file's to the present one.
pub fn stages(findings: &StructureFindings) -> Vec<ExplorerStage<'_>> {
    let analysis = &findings.analysis;
    let first = ExplorerStage {
        title: ROBOT_FILE.into(),
        predicted: &analysis.nominal,
        comparison: &analysis.before,
    };
    let earlier = findings.earlier.iter().map(|stage| ExplorerStage {
        title: revision_title(&stage.title),
        predicted: &stage.predicted,
        comparison: &stage.comparison,
    });
    let now = ExplorerStage {
        title: match analysis.case.revisions.last() {
            Some(current) => revision_title(&current.title()),
            None => CALIBRATED.into(),
        },
        predicted: &analysis.calibrated,
        comparison: &analysis.after,
    };
    std::iter::once(first).chain(earlier).chain([now]).collect()
}

impl ExplorerStage<'_> {
    /// At the beginning of a title.
    pub fn named(&self) -> String {
        match self.title.as_str() {
            ROBOT_FILE => "Model of the robot file".to_string(),
            CALIBRATED => "Calibrated model".to_string(),
            title => format!("Model {title}"),
        }
    }
}

const ROBOT_FILE: &str = "robot file";
const CALIBRATED: &str = "calibrated";

/// `r2 + payload` for revision `2 + payload`.
fn revision_title(title: &str) -> String {
    format!("r{title}")
}

/// The step from one line in the page to the next, so that `values` of them are not too many.
fn step(values: usize) -> usize {
    values.div_ceil(MOST_VALUES).max(1)
}

fn thinned<T: Clone>(values: &[T], every: usize) -> Vec<T> {
    values.iter().step_by(every).cloned().collect()
}

impl Explorer {
    pub fn new(findings: &StructureFindings) -> Self {
        let analysis = &findings.analysis;
        let data = &analysis.case.data;
        let stages = stages(findings);
        let lines: usize = data.frfs().map(|(block, _)| block.frequency_hz.len()).sum();
        let every = step(lines * (1 + stages.len()));
        let points = &analysis.case.model.points;
        let mut names = Names::default();
        let mut frfs = Vec::new();
        for (grid, block) in data.blocks.iter().enumerate() {
            let curve = |values: &[Complex64]| FrfCurve {
                frequency_hz: block.frequency_hz.clone(),
                value: values.to_vec(),
                ..FrfCurve::default()
            };
            for frf in &block.frfs {
                let index = frfs.len();
                let posture = &data.posture_ids[frf.posture];
                let (response, reference) = (dof(points, frf.response), dof(points, frf.reference));
                let curves = [curve(&frf.receptance), curve(&analysis.calibrated[index])];
                let measured = thinned(&frf.receptance, every);
                frfs.push(json!({
                    "posture": posture,
                    "response": response,
                    "reference": names.unique(posture, &response, reference),
                    "grid": grid,
                    "lowest": lowest_phase(&curves.iter().collect::<Vec<_>>()),
                    "noise": percent(analysis.after.frf_errors[index].noise_floor_nrms),
                    "magnitude": magnitudes(measured.iter().map(|v| v.norm())),
                    "phase": phases(&measured),
                    "level": magnitudes(thinned(&frf.noise_std, every).into_iter().map(coarse)),
                }));
            }
        }
        let models: Vec<Value> = stages
            .iter()
            .map(|stage| {
                let thin = |values: &Vec<Complex64>| thinned(values, every);
                json!({
                    "title": stage.title,
                    "error": percent(stage.comparison.totals.nrms),
                    "errors": stage.comparison.frf_errors.iter().map(|e| percent(e.nrms)).collect::<Vec<_>>(),
                    "times": stage.comparison.frf_errors.iter().map(|e| significant(e.times_noise(), 2)).collect::<Vec<_>>(),
                    "magnitude": stage.predicted.iter().map(|v| bends(magnitudes(thin(v).iter().map(|v| v.norm())))).collect::<Vec<_>>(),
                    "phase": stage.predicted.iter().map(|v| bends(phases(&thin(v)))).collect::<Vec<_>>(),
                })
            })
            .collect();
        let model = Look::Curve(style::model(0, 1));
        let value = json!({
            "noise": percent(analysis.after.totals.noise_floor_nrms),
            "worst": analysis.after.worst_first(),
            "grids": data.blocks.iter().map(|b| numbers(thinned(&b.frequency_hz, every))).collect::<Vec<_>>(),
            "frfs": frfs,
            "models": models,
            "bode": {
                "data": [
                    bode_trace("noise level", Look::Curve(style::LEVEL), 0, UNIT),
                    bode_trace("measured", Look::Measured, 0, UNIT),
                    bode_trace("measured", Look::Measured, 1, UNIT),
                    bode_trace("model", model, 0, UNIT),
                    bode_trace("model", model, 1, UNIT),
                ],
                "layout": bode_layout("Receptance", UNIT),
            },
            "nyquist": {
                "data": [nyquist_trace("measured", Look::Measured, UNIT), nyquist_trace("model", model, UNIT)],
                "layout": nyquist_layout(UNIT),
            },
        });
        Explorer { value, every }
    }

    pub(crate) fn value(&self) -> &Value {
        &self.value
    }
}

/// Of a noise level two digits are enough, and take little room.
fn coarse(level: f64) -> f64 {
    match level > 0.0 && level.is_finite() {
        true => (0.02 * (50.0 * level.ln()).round()).exp(),
        false => level,
    }
}

fn dof(points: &[Point], measured: MeasuredDof) -> String {
    let node = points[measured.point].node;
    Dof {
        node,
        axis: measured.axis,
        negative: measured.negative,
    }
    .to_string()
}

/// Sets FRFs apart that were measured twice, such as at two force levels.
#[derive(Default)]
struct Names(std::collections::HashSet<[String; 3]>);

impl Names {
    fn unique(&mut self, posture: &str, response: &str, reference: String) -> String {
        let mut name = reference.clone();
        let mut number = 2;
        while !self
            .0
            .insert([posture.to_string(), response.to_string(), name.clone()])
        {
            name = format!("{reference} ({number})");
            number += 1;
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_twice_has_two_names() {
        let mut names = Names::default();
        assert_eq!(names.unique("p1", "1X", "1Y".into()), "1Y");
        assert_eq!(names.unique("p1", "1X", "1Y".into()), "1Y (2)");
        assert_eq!(names.unique("p2", "1X", "1Y".into()), "1Y");
    }

    #[test]
    fn lines_are_left_out_only_where_there_are_too_many() {
        assert_eq!(step(0), 1);
        assert_eq!(step(MOST_VALUES), 1);
        assert_eq!(step(MOST_VALUES + 1), 2);
        assert_eq!(thinned(&[1, 2, 3, 4, 5], 2), [1, 3, 5]);
        assert!((coarse(3.21e-9) / 3.21e-9 - 1.0).abs() < 0.0101);
    }
}
