//! Stability lobes of numbers and arrays.

use lobestone::campaign::Immersion;
use lobestone::lobes::{
    AxisMode, LobeCurve, ModalFrf, RegenerativeForce, SampledFrf, SpeedLimit, StabilitySolver, ToolPointFrf,
};
use num_complex::Complex64;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::work::done;

type Floats<'py> = Bound<'py, PyArray1<f64>>;
/// Depth (mm) and chatter frequency (Hz) at each speed; absolute limit (mm) and its frequency (Hz); tips as speed (rpm) and
/// depth (mm), deepest first, and whether they lie at an end of the speeds.
type Answer<'py> = (
    Floats<'py>,
    Floats<'py>,
    Option<(f64, f64)>,
    Vec<(f64, Option<f64>, bool)>,
);

/// Tips that are told.
const TIPS: usize = 10;

/// Zero-order lobes in milling. `modes`: axis (0 x, 1 y), Hz, damping ratio, N/m; or `receptance`: (lines, 2, 2), m/N, on
/// `frequency_hz`.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub fn zero_order<'py>(
    py: Python<'py>,
    spindle_rpm: PyReadonlyArray1<'py, f64>,
    modes: Option<Vec<(usize, f64, f64, f64)>>,
    receptance: Option<(PyReadonlyArray1<'py, f64>, PyReadonlyArray3<'py, Complex64>)>,
    teeth: usize,
    ktc_n_per_mm2: f64,
    krc_n_per_mm2: f64,
    immersion_rad: (f64, f64),
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let speeds = spindle_rpm.as_array().to_vec();
    if !speeds.iter().all(|n| *n > 0.0 && n.is_finite()) || !speeds.windows(2).all(|n| n[0] < n[1]) {
        return Err(PyValueError::new_err(
            "spindle_rpm must be positive and ascending",
        ));
    }
    let modes = modes.map(|modes| modes.into_iter().map(axis_mode).collect::<Vec<_>>());
    let sampled = match receptance {
        Some((frequency_hz, values)) => {
            let values = values.as_array();
            let (lines, rows, columns) = values.dim();
            if (rows, columns) != (2, 2) {
                return Err(PyValueError::new_err(
                    "receptance must have the shape (n_lines, 2, 2): lines, response axis, force axis",
                ));
            }
            let line = |k: usize| [0, 1].map(|i| [0, 1].map(|j| values[[k, i, j]]));
            Some((
                frequency_hz.as_array().to_vec(),
                (0..lines).map(line).collect::<Vec<_>>(),
            ))
        }
        None => None,
    };
    let immersion = Immersion {
        start_rad: immersion_rad.0,
        exit_rad: immersion_rad.1,
    };
    let (curve, absolute, tips) = done(py, progress, || {
        let force = RegenerativeForce::milling_zero_order(ktc_n_per_mm2, krc_n_per_mm2, teeth, immersion)?;
        let frf: Box<dyn ToolPointFrf> = match (modes, sampled) {
            (_, Some((frequency_hz, values))) => Box::new(SampledFrf::new(frequency_hz, values)?),
            (modes, None) => Box::new(ModalFrf::from_axis_modes(&modes.unwrap_or_default())?),
        };
        let solver = StabilitySolver::new(force, frf.as_ref());
        let curve = solver.curve(&speeds);
        let tips = solver.best(&curve, TIPS);
        Ok((curve, solver.absolute_limit(), tips))
    })?;
    let LobeCurve {
        depth_limit_mm,
        chatter_hz,
        ..
    } = curve;
    // Where nothing limits the cut there is no chatter either.
    let or = |values: Vec<Option<f64>>, none: f64| {
        values.into_iter().map(|v| v.unwrap_or(none)).collect::<Vec<_>>()
    };
    Ok((
        PyArray1::from_vec(py, or(depth_limit_mm, f64::INFINITY)),
        PyArray1::from_vec(py, or(chatter_hz, f64::NAN)),
        absolute.map(|a| (a.depth_mm, a.chatter_hz)),
        tips.iter()
            .map(|p| (p.spindle_rpm, p.depth_mm, p.at_range_end))
            .collect(),
    ))
}

fn axis_mode((axis, frequency_hz, damping_ratio, stiffness_n_per_m): (usize, f64, f64, f64)) -> AxisMode {
    AxisMode {
        axis,
        frequency_hz,
        damping_ratio,
        stiffness_n_per_m,
    }
}
