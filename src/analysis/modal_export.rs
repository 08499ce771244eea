//! Modes for other programs: universal files (55 and synthesised 58), CSV, MATLAB.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use num_complex::Complex64;

use super::mode_set::{SetModes, dofs_of_frfs};
use super::shape_comparison::at_nodes;
use crate::files::write_atomically;
use crate::ingest::{
    self, Dof, Encoding58, FrfRecord, Geometry, MatArray, NodalShape, Quantity, geometry_text, mat5_bytes,
};
use crate::modal::scaling::{self, ScaledMode};
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
        put("modes.csv", modes_csv(set).as_bytes())?;
        put("shapes.csv", shapes_csv(set).as_bytes())?;
        put("modes.mat", &mat(set))?;
    }
    Ok(written)
}

/// Shapes with unity modal mass where there is a driving point (else largest component 1), as complex modes.
fn uff55(set: &SetModes, geometry: Option<&Geometry>) -> String {
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

fn modes_csv(set: &SetModes) -> String {
    let mut out = String::from(
        "mode,frequency_hz,frequency_std_hz,damping_ratio,damping_std,found_in,mpc,mpd_deg,modal_mass_kg,modal_mass_std_kg,\
         modal_a_re_kg_per_s,modal_a_im_kg_per_s\n",
    );
    for (k, (mode, scale)) in set.global.modes.iter().zip(scaled_modes(set)).enumerate() {
        let complexity = mode.complexity;
        let cell = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{},{},{},{},{},{},{},{},{},{},{},{}",
            k + 1,
            mode.frequency_hz,
            mode.frequency_std_hz,
            mode.damping_ratio,
            mode.damping_std,
            mode.found_in,
            cell(complexity.map(|c| c.mpc)),
            cell(complexity.map(|c| c.mpd_deg)),
            cell(scale.as_ref().map(|s| s.modal_mass_kg)),
            cell(scale.as_ref().map(|s| s.modal_mass_std_kg)),
            cell(scale.as_ref().map(|s| s.modal_a.re)),
            cell(scale.as_ref().map(|s| s.modal_a.im)),
        );
    }
    out
}

/// Name of a degree of freedom of the set; that of the FRF where the file has none.
fn dof_name(set: &SetModes, dof: usize) -> String {
    match set.dofs.is_empty() {
        true => set.frfs.get(dof).map_or(String::new(), |f| f.input.name.clone()),
        false => set.dofs.get(dof).cloned().unwrap_or_default(),
    }
}

fn shapes_csv(set: &SetModes) -> String {
    let mut out = String::from("mode,dof,re,im,unity_mass_re,unity_mass_im,real_normal\n");
    for (k, (mode, scale)) in set.global.modes.iter().zip(scaled_modes(set)).enumerate() {
        for (dof, z) in &mode.shape {
            let unity = scale
                .as_ref()
                .and_then(|s| s.unity_mass.iter().find(|u| u.0 == *dof));
            let real = scale
                .as_ref()
                .and_then(|s| s.real_normal.iter().find(|u| u.0 == *dof));
            let pair = unity.map_or(",".into(), |(_, z)| format!("{},{}", z.re, z.im));
            let real = real.map_or(String::new(), |(_, x)| x.to_string());
            let name = dof_name(set, *dof).replace([',', '"', '\n'], " ");
            let _ = writeln!(out, "{},{name},{},{},{pair},{real}", k + 1, z.re, z.im);
        }
    }
    out
}

/// `frequency_hz`, `damping_ratio`, both with `_std`, and `shape` (degree of freedom × mode).
fn mat(set: &SetModes) -> Vec<u8> {
    let modes = &set.global.modes;
    let column = |name: &str, of: &dyn Fn(&crate::modal::GlobalMode) -> f64| {
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
