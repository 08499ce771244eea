//! Campaign folders: the commands' documents, and the FRFs behind them.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::Parser;
use lobestone::analysis::StructureAnalysis;
use lobestone::campaign::{Campaign, MeasuredDof, Point};
use lobestone::commands::{self, Cli};
use lobestone::identify::Options;
use num_complex::Complex64;
use numpy::{PyArray1, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde_json::json;

use crate::errors::raised;
use crate::work::done;

/// The JSON document of the command that `arguments` say, as text.
#[pyfunction]
#[pyo3(signature = (arguments, progress=None))]
pub fn document(
    py: Python<'_>,
    arguments: Vec<OsString>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let before = ["lobestone", "--json"].map(OsString::from);
    let cli = Cli::try_parse_from(before.into_iter().chain(arguments))
        .map_err(|e| PyValueError::new_err(e.to_string()))?;
    let outcome = done(py, progress, || commands::run(cli))?;
    match outcome.failed {
        Some(error) => Err(raised(py, &error)),
        None => Ok(outcome.json.to_string()),
    }
}

/// What a campaign holds, as JSON text.
#[pyfunction]
pub fn held(py: Python<'_>, dir: PathBuf) -> PyResult<String> {
    let campaign = done(py, None, || Campaign::load(&dir))?;
    let file = |path: &PathBuf| path.display().to_string();
    let held = json!({
        "name": campaign.name,
        "robot": campaign.robot.as_ref().map(|r| &r.model),
        "postures": campaign.postures.iter().map(|p| json!({"id": p.id, "joints_deg": p.joints_deg})).collect::<Vec<_>>(),
        "frfs": campaign.frfs.iter().map(|f| file(&f.file)).collect::<Vec<_>>(),
        "cuts": campaign.cuts.iter().map(|c| json!({"id": c.id, "spindle_rpm": c.spindle_rpm})).collect::<Vec<_>>(),
        "lobes": campaign.lobes.is_some(),
    });
    Ok(held.to_string())
}

type Line<'py, T> = Bound<'py, PyArray1<T>>;
/// Name, posture, response, reference, frequency (Hz); measured, from the robot file, calibrated (m/N); standard deviation
/// of the measured value's noise (m/N).
type Frf<'py> = (
    String,
    String,
    String,
    String,
    Line<'py, f64>,
    Line<'py, Complex64>,
    Line<'py, Complex64>,
    Line<'py, Complex64>,
    Line<'py, f64>,
);

/// The FRFs of a campaign and those of the calibrated model.
#[pyfunction]
#[pyo3(signature = (dir, progress=None))]
pub fn frfs<'py>(
    py: Python<'py>,
    dir: PathBuf,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Vec<Frf<'py>>> {
    let (points, analysis) = done(py, progress, || {
        let campaign = Campaign::load(&dir)?;
        let analysis = StructureAnalysis::run(&campaign, Options::default())?;
        Ok((campaign.points, analysis))
    })?;
    let data = &analysis.case.data;
    let models = analysis.nominal.iter().zip(&analysis.calibrated);
    let each = data
        .frfs()
        .zip(models)
        .map(|((block, frf), (nominal, calibrated))| {
            (
                frf.name.clone(),
                data.posture_ids[frf.posture].clone(),
                dof(&points, &frf.response),
                dof(&points, &frf.reference),
                block.frequency_hz.to_pyarray(py),
                frf.receptance.to_pyarray(py),
                nominal.to_pyarray(py),
                calibrated.to_pyarray(py),
                frf.noise_std.to_pyarray(py),
            )
        });
    Ok(each.collect())
}

/// As UFF files name them: `1X`, `12-Z`.
fn dof(points: &[Point], dof: &MeasuredDof) -> String {
    let sign = if dof.negative { "-" } else { "" };
    format!("{}{sign}{}", points[dof.point].node, dof.axis.letter())
}
