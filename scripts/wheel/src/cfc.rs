//! Cutting force coefficients of averages given as arrays.

use lobestone::InputError;
use lobestone::campaign::{CutGeometry, Immersion, Process, Tool, ToolKind};
use lobestone::cutting::{
    CoefficientEstimate, CoefficientFit, ForceAxis, Observation, RegressionMethod, average_row, bootstrap,
    coefficients_of, estimate, fit,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work::done;

/// What was cut: `kind` "milling" with (feed a tooth, axial depth, immersion from and to) of each cut, mm and rad; or
/// "drilling" with (feed a revolution, pilot diameter), mm.
#[derive(FromPyObject)]
pub struct Cutting {
    #[pyo3(item)]
    kind: String,
    #[pyo3(item)]
    teeth: usize,
    #[pyo3(item)]
    diameter_mm: f64,
    #[pyo3(item)]
    half_point_angle_deg: Option<f64>,
    #[pyo3(item)]
    web_thickness_mm: Option<f64>,
    #[pyo3(item)]
    cuts: Vec<Vec<f64>>,
}

impl Cutting {
    fn process(&self) -> Process {
        match self.kind.as_str() {
            "drilling" => Process::Drilling,
            _ => Process::Milling,
        }
    }

    fn tool(&self) -> Tool {
        Tool {
            kind: match self.kind.as_str() {
                "drilling" => ToolKind::Drill,
                _ => ToolKind::Endmill,
            },
            diameter_mm: self.diameter_mm,
            teeth: self.teeth,
            helix_deg: 0.0,
            corner_radius_mm: 0.0,
            lead_angle_deg: 90.0,
            half_point_angle_deg: self.half_point_angle_deg,
            web_thickness_mm: self.web_thickness_mm,
            chisel_edge_angle_deg: lobestone::data::USUAL_CHISEL_EDGE_ANGLE_DEG,
            each_tooth: Vec::new(),
        }
    }

    fn geometry(&self, cut: usize) -> lobestone::Result<CutGeometry> {
        match (self.process(), self.cuts[cut].as_slice()) {
            (Process::Milling, &[feed_per_tooth_mm, axial_depth_mm, start_rad, exit_rad])
                if feed_per_tooth_mm > 0.0
                    && axial_depth_mm > 0.0
                    && start_rad >= 0.0
                    && exit_rad > start_rad =>
            {
                Ok(CutGeometry::Milling {
                    feed_per_tooth_mm,
                    axial_depth_mm,
                    immersion: Immersion { start_rad, exit_rad },
                })
            }
            (Process::Drilling, &[feed_per_rev_mm, pilot_diameter_mm])
                if feed_per_rev_mm > 0.0 && pilot_diameter_mm >= 0.0 =>
            {
                Ok(CutGeometry::Drilling {
                    feed_per_rev_mm,
                    pilot_diameter_mm,
                    hole_depth_mm: None,
                })
            }
            (_, other) => Err(InputError::new(format!("cut {cut} cuts nothing: {other:?}"))
                .remedy("give feeds and depths above zero, and an exit angle above the start angle")
                .into()),
        }
    }
}

/// The averages that are there: value and, where it is known, standard error (0: not known).
fn observations(
    cutting: &Cutting,
    averages: &[Vec<f64>],
    errors: Option<&[Vec<f64>]>,
) -> lobestone::Result<Vec<Observation>> {
    let tool = cutting.tool();
    let mut all = Vec::new();
    for (cut, values) in averages.iter().enumerate() {
        let geometry = cutting.geometry(cut)?;
        for (column, &axis) in ForceAxis::of(cutting.process()).iter().enumerate() {
            let (value, std_error) = (values[column], errors.map_or(0.0, |e| e[cut][column]));
            // NaN: not measured.
            if value.is_nan() {
                continue;
            }
            if !(value.is_finite() && std_error >= 0.0 && std_error.is_finite()) {
                return Err(InputError::new(format!(
                    "cut {cut}, {}: {value} with standard error {std_error} is no average",
                    axis.label()
                ))
                .remedy("give finite numbers; NaN where an axis was not measured")
                .into());
            }
            all.push(Observation {
                cut,
                axis,
                row: average_row(&tool, &geometry, axis)?,
                value,
                std_error,
            });
        }
    }
    Ok(all)
}

struct Found {
    observations: Vec<Observation>,
    free: CoefficientFit,
    chosen: Option<CoefficientEstimate>,
    bootstrap: Option<Vec<f64>>,
}

fn regression(
    cutting: &Cutting,
    averages: &[Vec<f64>],
    errors: Option<&[Vec<f64>]>,
    robust: bool,
    nonnegative_edges: bool,
) -> lobestone::Result<Found> {
    let observations = observations(cutting, averages, errors)?;
    let free = fit(&observations).ok_or_else(|| {
        lobestone::Error::from(
            InputError::new("there is no average among what was given").remedy("give one cut at least"),
        )
    })?;
    let kinds = coefficients_of(cutting.process());
    let bounds: Vec<bool> = kinds.iter().map(|k| nonnegative_edges && k.edge).collect();
    let method = if robust {
        RegressionMethod::Huber
    } else {
        RegressionMethod::LeastSquares
    };
    let determined = free.inseparable.is_empty() && free.value.iter().all(Option::is_some);
    if !determined && (robust || nonnegative_edges) {
        return Err(lobestone::Error::computation(
            "these cuts do not determine all coefficients, so neither a robust regression nor bounds can be had: cut with \
             further feeds, or leave out robust and nonnegative_edges",
        ));
    }
    let chosen = match determined {
        true => Some(estimate(&observations, &free, &bounds, method)?),
        false => None,
    };
    let bootstrap = chosen
        .as_ref()
        .and_then(|chosen| bootstrap(&observations, chosen, &bounds, method));
    Ok(Found {
        observations,
        free,
        chosen,
        bootstrap,
    })
}

/// The regression as a dictionary that `lobestone.cfc` makes its answer from.
#[pyfunction]
#[pyo3(signature = (cutting, averages, std_errors, robust, nonnegative_edges))]
pub fn coefficients<'py>(
    py: Python<'py>,
    cutting: Cutting,
    averages: PyReadonlyArray2<'py, f64>,
    std_errors: Option<PyReadonlyArray2<'py, f64>>,
    robust: bool,
    nonnegative_edges: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let rows = |array: &PyReadonlyArray2<'py, f64>| -> Vec<Vec<f64>> {
        array.as_array().rows().into_iter().map(|r| r.to_vec()).collect()
    };
    let (averages, errors) = (rows(&averages), std_errors.as_ref().map(rows));
    let kinds = coefficients_of(cutting.process());
    let axes = ForceAxis::of(cutting.process());
    let found = done(py, None, || {
        regression(&cutting, &averages, errors.as_deref(), robust, nonnegative_edges)
    })?;
    let Found {
        observations,
        free,
        chosen,
        bootstrap,
    } = &found;
    let answer = PyDict::new(py);
    answer.set_item("names", kinds.iter().map(|k| k.label).collect::<Vec<_>>())?;
    answer.set_item("units", kinds.iter().map(|k| k.unit).collect::<Vec<_>>())?;
    let or_nan =
        |values: &[Option<f64>]| -> Vec<f64> { values.iter().map(|v| v.unwrap_or(f64::NAN)).collect() };
    let (value, std_error, solution) = match chosen {
        Some(chosen) => (chosen.value.clone(), or_nan(&chosen.std_error), &chosen.value),
        None => (or_nan(&free.value), or_nan(&free.std_error), &free.solution),
    };
    let residual: Vec<(usize, usize, f64)> = observations
        .iter()
        .map(|o| {
            let fitted: f64 = o.row.iter().zip(solution).map(|(r, x)| r * x).sum();
            let column = axes.iter().position(|a| *a == o.axis).unwrap_or(0);
            (o.cut, column, o.value - fitted)
        })
        .collect();
    answer.set_item("residual", residual)?;
    answer.set_item("value", PyArray1::from_vec(py, value))?;
    answer.set_item("std_error", PyArray1::from_vec(py, std_error))?;
    answer.set_item("std_error_bootstrap", bootstrap.clone())?;
    let held = chosen.as_ref().map(|c| c.active.clone());
    answer.set_item("held", held.unwrap_or_else(|| vec![false; kinds.len()]))?;
    answer.set_item("covariance", covariance(py, free)?)?;
    let labels = |set: &Vec<usize>| set.iter().map(|&j| kinds[j].label).collect::<Vec<_>>();
    answer.set_item(
        "inseparable",
        free.inseparable.iter().map(labels).collect::<Vec<_>>(),
    )?;
    let r2: Vec<(&str, Option<f64>)> = axes.iter().map(|a| (a.label(), free.r2[a.index()])).collect();
    answer.set_item("r2", r2)?;
    Ok(answer)
}

fn covariance<'py>(py: Python<'py>, free: &CoefficientFit) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let matrix = &free.covariance;
    let flat: Vec<f64> = matrix
        .row_iter()
        .flat_map(|r| r.iter().copied().collect::<Vec<_>>())
        .collect();
    PyArray1::from_vec(py, flat).reshape([matrix.nrows(), matrix.ncols()])
}
