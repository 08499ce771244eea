//! Modes of FRFs given as arrays.

use lobestone::analysis::modes::modal::{FrfInput, TOGETHER};
use lobestone::analysis::{ModalAnalysis, SetModes};
use lobestone::modal::Settings;
use num_complex::Complex64;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work::done;

const MISSING: Complex64 = Complex64::new(f64::NAN, f64::NAN);

/// Modes that all FRFs share: a dictionary that `lobestone.modal.fit` makes its answer from.
#[pyfunction]
#[pyo3(signature = (frf, frequency_hz, dofs, band_hz, max_order, progress))]
pub fn fit<'py>(
    py: Python<'py>,
    frf: PyReadonlyArray2<'py, Complex64>,
    frequency_hz: PyReadonlyArray1<'py, f64>,
    dofs: Option<Vec<[String; 2]>>,
    band_hz: Option<[f64; 2]>,
    max_order: Option<usize>,
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let inputs = inputs(&frf, &frequency_hz, dofs.as_deref())?;
    let settings = Settings {
        band_hz,
        max_order,
        ..Settings::default()
    };
    let analysis = done(py, progress, || ModalAnalysis::of(inputs, Vec::new(), &settings))?;
    let answer = PyDict::new(py);
    if let Some(set) = analysis.sets.first() {
        put(py, &answer, set)?;
        answer.set_item("warnings", &analysis.warnings)?;
    }
    Ok(answer)
}

fn inputs(
    frf: &PyReadonlyArray2<'_, Complex64>,
    frequency_hz: &PyReadonlyArray1<'_, f64>,
    dofs: Option<&[[String; 2]]>,
) -> PyResult<Vec<FrfInput>> {
    let frf = frf.as_array();
    let frequency_hz: Vec<f64> = frequency_hz.as_array().to_vec();
    let (count, lines) = frf.dim();
    if lines != frequency_hz.len() {
        return Err(PyValueError::new_err(format!(
            "frf holds {lines} lines and frequency_hz {}: give frf as (n_frf, n_lines)",
            frequency_hz.len()
        )));
    }
    if dofs.is_some_and(|d| d.len() != count) {
        return Err(PyValueError::new_err(format!(
            "dofs must name response and reference of each of the {count} FRFs"
        )));
    }
    let one = |k: usize| FrfInput {
        name: k.to_string(),
        set: TOGETHER.into(),
        dofs: dofs.map(|d| d[k].clone()),
        frequency_hz: frequency_hz.clone(),
        receptance_m_per_n: frf.row(k).to_vec(),
        coherence: None,
        added_decay_per_s: 0.0,
    };
    Ok((0..count).map(one).collect())
}

fn put(py: Python<'_>, answer: &Bound<'_, PyDict>, set: &SetModes) -> PyResult<()> {
    let found = &set.global;
    let modes = &found.modes;
    let each = |of: fn(&lobestone::modal::GlobalMode) -> f64| {
        let values: Vec<f64> = modes.iter().map(of).collect();
        PyArray1::from_vec(py, values)
    };
    answer.set_item("frequency_hz", each(|m| m.frequency_hz))?;
    answer.set_item("frequency_std_hz", each(|m| m.frequency_std_hz))?;
    answer.set_item("damping_ratio", each(|m| m.damping_ratio))?;
    answer.set_item("damping_std", each(|m| m.damping_std))?;
    answer.set_item("mpc", each(|m| m.complexity.map_or(f64::NAN, |c| c.mpc)))?;
    let found_in: Vec<usize> = modes.iter().map(|m| m.found_in).collect();
    answer.set_item("found_in", found_in)?;
    // Degrees of freedom by name where they were given, else one a FRF.
    let width = match set.dofs.len() {
        0 => set.frfs.len(),
        named => named,
    };
    let shapes = modes.iter().map(|mode| {
        let mut row = vec![MISSING; width];
        for (dof, component) in &mode.shape {
            row[*dof] = *component;
        }
        row
    });
    answer.set_item("shapes", matrix(py, shapes.collect(), width)?)?;
    answer.set_item("dofs", &set.dofs)?;
    let frfs = set.frfs.len();
    let of_constants = |of: fn(&(Complex64, f64)) -> Complex64| {
        let row = |mode: &lobestone::modal::GlobalMode| {
            let values = mode.constants.iter().map(|c| c.as_ref().map_or(MISSING, of));
            values.collect::<Vec<_>>()
        };
        matrix(py, modes.iter().map(row).collect(), frfs)
    };
    answer.set_item("modal_constants", of_constants(|c| c.0)?)?;
    answer.set_item("modal_constants_std", of_constants(|c| Complex64::new(c.1, 0.0))?)?;
    answer.set_item("mac", matrix(py, found.mac.clone(), modes.len())?)?;
    let fitted: Vec<_> = found
        .reconstructions
        .iter()
        .map(|r| {
            r.as_ref()
                .map(|r| (r.frequency_hz.to_pyarray(py), r.fitted_m_per_n.to_pyarray(py)))
        })
        .collect();
    answer.set_item("fitted", fitted)?;
    let rejected: Vec<_> = found
        .rejected
        .iter()
        .map(|r| (r.frequency_hz, r.damping_ratio, r.reason.as_str()))
        .collect();
    answer.set_item("rejected", rejected)?;
    answer.set_item("verdict", set.verdict.to_string())?;
    answer.set_item("why", &set.why)
}

/// Rows of equal length; `(0, width)` where there are none.
fn matrix<T: numpy::Element + Clone>(
    py: Python<'_>,
    rows: Vec<Vec<T>>,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let count = rows.len();
    let flat: Vec<T> = rows.into_iter().flatten().collect();
    PyArray1::from_vec(py, flat).reshape([count, width])
}
