//! Modes for other programs: universal files (55 and synthesised 58), CSV, MATLAB.

use std::path::{Path, PathBuf};

use num_complex::Complex64;

use crate::analysis::modes::mode_set::{SetModes, dofs_of_frfs};
use crate::analysis::modes::shape_comparison::at_nodes;
use crate::files::write_atomically;
use crate::ingest::{
    self, Cells, ColumnTable, Dof, Encoding58, FrfRecord, Geometry, MatArray, NamedArray, NamedColumn,
    NodalShape, Quantity, csv_bytes, geometry_text, mat5_bytes,
};
use crate::modal::GlobalMode;
use crate::modal::scaling::{self, ScaledMode};
use crate::modal::shape::Complexity;
use crate::{Error, Result};

/// By mode; `None` where no driving point gives it a scale.
pub fn scaled_modes(set: &SetModes) -> Vec<Option<ScaledMode>> {
    let dofs = dofs_of_frfs(set);
    set.global
        .modes
        .iter()
        .map(|m| scaling::scaled(m.frequency_hz, m.damping_ratio, &m.constants, &dofs))
        .collect()
}

/// Writes `modes.uff` (datasets 15, 82 and 55), `synthesised.uff` (58), `modes.csv`, `shapes.csv` and `modes.mat` into a
/// folder; with several sets one folder a set. What was written.
///
/// # Errors
/// What the file system refuses; no modes at all.
pub fn export(sets: &[SetModes], geometry: Option<&Geometry>, folder: &Path) -> Result<Vec<PathBuf>> {
    if sets.iter().all(|s| s.global.modes.is_empty()) {
        return Err(Error::computation("there are no modes to export"));
    }
    let mut written = Vec::new();
    for (k, set) in sets.iter().enumerate() {
        let folder = match sets.len() {
            1 => folder.to_owned(),
            _ => folder.join(format!("set-{}", k + 1)),
        };
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
        let mut put = |name: &str, bytes: &[u8]| -> Result<()> {
            let path = folder.join(name);
            write_atomically(&path, bytes)?;
            written.push(path);
            Ok(())
        };
        put("modes.uff", uff55(set, geometry).as_bytes())?;
        put("synthesised.uff", &uff58(set))?;
        put(
            "modes.csv",
            &csv_bytes(&ColumnTable::new("modes", modes_columns(set)))?,
        )?;
        put(
            "shapes.csv",
            &csv_bytes(&ColumnTable::new("shapes", shapes_columns(set)))?,
        )?;
        put("modes.mat", &mat(set))?;
    }
    Ok(written)
}

/// Shapes with unity modal mass where there is a driving point (else largest component 1), as complex modes.
pub fn uff55(set: &SetModes, geometry: Option<&Geometry>) -> String {
    let scaled = scaled_modes(set);
    let shapes: Vec<NodalShape> = set
        .global
        .modes
        .iter()
        .zip(&scaled)
        .map(|(mode, scale)| {
            let damped = std::f64::consts::TAU
                * mode.frequency_hz
                * (1.0 - mode.damping_ratio * mode.damping_ratio).max(0.0).sqrt();
            let mut source = mode.clone();
            if let Some(scale) = scale {
                source.shape = scale.unity_mass.clone();
            }
            NodalShape {
                title: format!(
                    "{:.4} Hz, damping ratio {:.3e}, {}",
                    mode.frequency_hz,
                    mode.damping_ratio,
                    if scale.is_some() {
                        "unity modal mass"
                    } else {
                        "not scaled"
                    }
                ),
                frequency_hz: mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                modal_mass_kg: if scale.is_some() { 1.0 } else { 0.0 },
                modal_a: Some(match scale {
                    Some(_) => Complex64::new(0.0, 2.0 * damped),
                    None => Complex64::ZERO,
                }),
                at_node: at_nodes(set, &source),
            }
        })
        .filter(|s| !s.at_node.is_empty())
        .collect();
    geometry_text(geometry.unwrap_or(&Geometry::default()), &shapes)
}

/// Receptance put together from the modes.
fn uff58(set: &SetModes) -> Vec<u8> {
    let frfs: Vec<FrfRecord> = set
        .frfs
        .iter()
        .zip(&set.global.reconstructions)
        .filter_map(|(frf, fit)| {
            let fit = fit.as_ref()?;
            let dof = |k: usize| frf.input.dofs.as_ref().and_then(|d| d[k].parse::<Dof>().ok());
            Some(FrfRecord {
                name: frf.input.name.clone(),
                response: dof(0),
                reference: dof(1),
                quantity: Some(Quantity::Receptance),
                frequency_hz: fit.frequency_hz.clone(),
                value: fit.fitted_m_per_n.clone(),
                coherence: None,
            })
        })
        .collect();
    let datasets: Vec<_> = frfs.iter().map(ingest::frf_dataset).collect();
    ingest::uff58_bytes(
        &datasets,
        Encoding58 {
            binary: None,
            double: true,
        },
    )
}

/// One row a mode.
pub fn modes_columns(set: &SetModes) -> Vec<NamedColumn> {
    let modes = &set.global.modes;
    let scaled = scaled_modes(set);
    let of_mode = |of: fn(&GlobalMode) -> f64| modes.iter().map(of).collect::<Vec<f64>>();
    let of_scale = |of: fn(&ScaledMode) -> f64| scaled.iter().map(move |s| s.as_ref().map(of));
    let modal_a = scaled.iter().map(|s| s.as_ref().map_or(NOTHING, |s| s.modal_a));
    let complexity = |of: fn(Complexity) -> f64| modes.iter().map(move |m| m.complexity.map(of));
    vec![
        NamedColumn::numbers("mode", "", (1..=modes.len()).map(|k| k as f64).collect()),
        NamedColumn::numbers("frequency", "hz", of_mode(|m| m.frequency_hz)),
        NamedColumn::numbers("frequency_std", "hz", of_mode(|m| m.frequency_std_hz)),
        NamedColumn::numbers("damping_ratio", "", of_mode(|m| m.damping_ratio)),
        NamedColumn::numbers("damping_std", "", of_mode(|m| m.damping_std)),
        NamedColumn::numbers("found_in", "", of_mode(|m| m.found_in as f64)),
        NamedColumn::known("mpc", "", complexity(|c| c.mpc)),
        NamedColumn::known("mpd", "deg", complexity(|c| c.mpd_deg)),
        NamedColumn::known("modal_mass", "kg", of_scale(|s| s.modal_mass_kg)),
        NamedColumn::known("modal_mass_std", "kg", of_scale(|s| s.modal_mass_std_kg)),
        NamedColumn::complex("modal_a", "kg_per_s", modal_a.collect()),
    ]
}

/// What stands for a complex number that is not there.
const NOTHING: Complex64 = Complex64::new(f64::NAN, f64::NAN);

/// Name of a degree of freedom of the set; that of the FRF where the file has none.
fn dof_name(set: &SetModes, dof: usize) -> String {
    match set.dofs.is_empty() {
        true => set.frfs.get(dof).map_or(String::new(), |f| f.input.name.clone()),
        false => set.dofs.get(dof).cloned().unwrap_or_default(),
    }
}

/// One row a mode and degree of freedom. A shape's largest component is 1; `unity_mass` (1/√kg) and `real_normal` where a
/// driving point gives it a scale.
pub fn shapes_columns(set: &SetModes) -> Vec<NamedColumn> {
    let (mut number, mut dofs, mut shape) = (Vec::new(), Vec::new(), Vec::new());
    let (mut unity_mass, mut real_normal) = (Vec::new(), Vec::new());
    for (k, (mode, scale)) in set.global.modes.iter().zip(scaled_modes(set)).enumerate() {
        for (dof, z) in &mode.shape {
            let unity = scale
                .as_ref()
                .and_then(|s| s.unity_mass.iter().find(|u| u.0 == *dof));
            let real = scale
                .as_ref()
                .and_then(|s| s.real_normal.iter().find(|u| u.0 == *dof));
            number.push((k + 1) as f64);
            dofs.push(dof_name(set, *dof));
            shape.push(*z);
            unity_mass.push(unity.map_or(NOTHING, |u| u.1));
            real_normal.push(real.map(|r| r.1));
        }
    }
    let part = |of: fn(&Complex64) -> f64| shape.iter().map(of).collect();
    vec![
        NamedColumn::numbers("mode", "", number),
        NamedColumn::text("dof", dofs),
        NamedColumn::numbers("re", "", part(|z| z.re)),
        NamedColumn::numbers("im", "", part(|z| z.im)),
        NamedColumn::complex("unity_mass", "", unity_mass),
        NamedColumn::known("real_normal", "", real_normal),
    ]
}

/// Shapes as a matrix (mode × degree of freedom, NaN where one was not measured), with frequencies and names.
pub fn shape_arrays(set: &SetModes, prefix: &str) -> Vec<NamedArray> {
    let modes = &set.global.modes;
    let mut dofs: Vec<usize> = modes.iter().flat_map(|m| m.shape.iter().map(|s| s.0)).collect();
    dofs.sort_unstable();
    dofs.dedup();
    let at =
        |mode: &GlobalMode, dof: &usize| mode.shape.iter().find(|s| s.0 == *dof).map_or(NOTHING, |s| s.1);
    let dofs = &dofs;
    let shapes: Vec<Complex64> = modes
        .iter()
        .flat_map(|m| dofs.iter().map(move |d| at(m, d)))
        .collect();
    let array = |name: &str, shape: Vec<usize>, cells: Cells| NamedArray {
        name: format!("{prefix}_{name}"),
        shape,
        cells,
    };
    let frequency_hz = modes.iter().map(|m| m.frequency_hz).collect();
    let names = dofs.iter().map(|d| dof_name(set, *d)).collect();
    vec![
        array("frequency_hz", vec![modes.len()], Cells::Number(frequency_hz)),
        array("dof", vec![dofs.len()], Cells::Text(names)),
        array("shape", vec![modes.len(), dofs.len()], Cells::Complex(shapes)),
    ]
}

/// `frequency_hz`, `damping_ratio`, both with `_std`, and `shape` (degree of freedom × mode).
fn mat(set: &SetModes) -> Vec<u8> {
    let modes = &set.global.modes;
    let column = |name: &str, of: &dyn Fn(&GlobalMode) -> f64| {
        MatArray::column(name, &modes.iter().map(of).collect::<Vec<_>>())
    };
    let mut dofs: Vec<usize> = modes.iter().flat_map(|m| m.shape.iter().map(|s| s.0)).collect();
    dofs.sort_unstable();
    dofs.dedup();
    let shapes: Vec<Vec<Complex64>> = modes
        .iter()
        .map(|m| {
            let at = |dof: &usize| {
                m.shape
                    .iter()
                    .find(|s| s.0 == *dof)
                    .map_or(Complex64::ZERO, |s| s.1)
            };
            dofs.iter().map(at).collect()
        })
        .collect();
    mat5_bytes(&[
        column("frequency_hz", &|m| m.frequency_hz),
        column("frequency_std_hz", &|m| m.frequency_std_hz),
        column("damping_ratio", &|m| m.damping_ratio),
        column("damping_std", &|m| m.damping_std),
        MatArray::complex("shape", &shapes),
    ])
}
