//! FRFs: measured, by the model, and the difference. A row a line in the table; in arrays a matrix (FRF × line) for each posture.

use num_complex::Complex64;

use crate::Result;
use crate::analysis::modes::modal::dof_name;
use crate::analysis::structure::StructureAnalysis;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, MeasuredDof};
use crate::ingest::{
    self, Cells, ColumnTable, Dof, Encoding58, FrfRecord, NamedArray, NamedColumn, Quantity, uff58_bytes,
};

/// Unit of receptance, as names have it.
const RECEPTANCE: &str = "m_per_n";

/// One FRF with everything that is told of it, on its own lines.
struct Row<'a> {
    posture: &'a str,
    name: &'a str,
    response: String,
    reference: String,
    frequency_hz: &'a [f64],
    /// By quantity; the first is what a universal file holds.
    curves: Vec<Vec<Complex64>>,
    /// By quantity; empty where the FRF has none.
    reals: Vec<Vec<f64>>,
}

/// What its curves and real numbers are: complex ones are receptances.
struct Names {
    file: &'static str,
    curves: Vec<&'static str>,
    reals: Vec<(&'static str, &'static str)>,
}

type TableAndUniversal = (ColumnTable, (String, Vec<u8>));

/// The measured FRFs on all lines of their files.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn frf_file(campaign: &Workbench) -> Result<TableAndUniversal> {
    let (set, _) = campaign.load_frfs()?;
    let rows: Vec<Row> = set
        .frfs
        .iter()
        .map(|frf| Row {
            posture: &campaign.postures[frf.posture].id,
            name: &frf.name,
            response: dof_name(&campaign.points, &frf.response),
            reference: dof_name(&campaign.points, &frf.reference),
            frequency_hz: &frf.frequency_hz,
            curves: vec![frf.receptance_m_per_n.clone()],
            reals: vec![frf.coherence.clone().unwrap_or_default()],
        })
        .collect();
    let names = Names {
        file: "frf",
        curves: vec!["receptance"],
        reals: vec![("coherence", "")],
    };
    Ok(files(&names, &rows))
}

/// The model's FRFs, or what it lacks, on the lines that it was fitted to.
///
/// # Errors
/// As [`StructureAnalysis::on`].
pub(super) fn model_files(campaign: &Workbench, residual: bool) -> Result<TableAndUniversal> {
    let analysis = StructureAnalysis::on(campaign)?;
    let data = &analysis.case.data;
    let models = analysis.nominal.iter().zip(&analysis.calibrated);
    let plain: &Campaign = campaign;
    let dof = |d: &MeasuredDof| dof_name(&plain.points, d);
    let rows: Vec<Row> = data
        .frfs()
        .zip(models)
        .map(|((block, frf), (nominal, calibrated))| Row {
            posture: &data.posture_ids[frf.posture],
            name: &frf.name,
            response: dof(&frf.response),
            reference: dof(&frf.reference),
            frequency_hz: &block.frequency_hz,
            curves: match residual {
                true => vec![
                    calibrated
                        .iter()
                        .zip(&frf.receptance)
                        .map(|(m, h)| m - h)
                        .collect(),
                ],
                false => vec![calibrated.clone(), nominal.clone()],
            },
            reals: match residual {
                true => vec![frf.noise_std.clone()],
                false => Vec::new(),
            },
        })
        .collect();
    let names = match residual {
        true => Names {
            file: "residual",
            curves: vec!["residual"],
            reals: vec![("noise_std", RECEPTANCE)],
        },
        false => Names {
            file: "model",
            curves: vec!["model", "robot_file"],
            reals: Vec::new(),
        },
    };
    Ok(files(&names, &rows))
}

fn files(names: &Names, rows: &[Row]) -> TableAndUniversal {
    let table = ColumnTable {
        name: names.file.into(),
        columns: columns(names, rows),
        arrays: arrays(names, rows),
    };
    (table, (names.file.into(), universal(rows)))
}

fn columns(names: &Names, rows: &[Row]) -> Vec<NamedColumn> {
    let each = |of: fn(&Row) -> String| -> Vec<String> {
        let repeated = |row: &Row| vec![of(row); row.frequency_hz.len()];
        rows.iter().flat_map(repeated).collect()
    };
    let mut columns = vec![
        NamedColumn::text("posture", each(|r| r.posture.into())),
        NamedColumn::text("frf", each(|r| r.name.into())),
        NamedColumn::text("response", each(|r| r.response.clone())),
        NamedColumn::text("reference", each(|r| r.reference.clone())),
        NamedColumn::numbers(
            "frequency",
            "hz",
            rows.iter().flat_map(|r| r.frequency_hz).copied().collect(),
        ),
    ];
    for (k, name) in names.curves.iter().enumerate() {
        let values = rows.iter().flat_map(|r| &r.curves[k]).copied().collect();
        columns.push(NamedColumn::complex(name, RECEPTANCE, values));
    }
    for (k, (name, unit)) in names.reals.iter().enumerate() {
        // Nobody wants a column of nothing.
        if rows.iter().any(|r| !r.reals[k].is_empty()) {
            let values = rows.iter().flat_map(|r| on_its_lines(r, k)).collect();
            columns.push(NamedColumn::numbers(name, unit, values));
        }
    }
    columns
}

fn on_its_lines(row: &Row, k: usize) -> Vec<f64> {
    match row.reals[k].is_empty() {
        true => vec![f64::NAN; row.frequency_hz.len()],
        false => row.reals[k].clone(),
    }
}

/// FRFs of one posture on the same lines share a matrix; its rows are in the order of the table.
fn arrays(names: &Names, rows: &[Row]) -> Vec<NamedArray> {
    let mut groups: Vec<Vec<&Row>> = Vec::new();
    for row in rows {
        let same = |g: &&mut Vec<&Row>| g[0].posture == row.posture && g[0].frequency_hz == row.frequency_hz;
        match groups.iter_mut().find(same) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    let mut arrays: Vec<NamedArray> = Vec::new();
    let mut taken: Vec<String> = Vec::new();
    for group in &groups {
        let stem = ingest::variable_name(group[0].posture);
        let mut prefix = stem.clone();
        let mut number = 1;
        while taken.contains(&prefix) {
            number += 1;
            prefix = format!("{stem}_{number}");
        }
        taken.push(prefix.clone());
        let mut put = |name: String, shape: Vec<usize>, cells: Cells| {
            arrays.push(NamedArray {
                name: format!("{prefix}_{name}"),
                shape,
                cells,
            });
        };
        let (count, lines) = (group.len(), group[0].frequency_hz.len());
        let texts = |of: fn(&Row) -> String| Cells::Text(group.iter().map(|r| of(r)).collect());
        put(
            "frequency_hz".into(),
            vec![lines],
            Cells::Number(group[0].frequency_hz.to_vec()),
        );
        put("response".into(), vec![count], texts(|r| r.response.clone()));
        put("reference".into(), vec![count], texts(|r| r.reference.clone()));
        for (k, name) in names.curves.iter().enumerate() {
            let values = group.iter().flat_map(|r| &r.curves[k]).copied().collect();
            put(
                format!("{name}_{RECEPTANCE}"),
                vec![count, lines],
                Cells::Complex(values),
            );
        }
        for (k, (name, unit)) in names.reals.iter().enumerate() {
            if group.iter().any(|r| !r.reals[k].is_empty()) {
                let values = group.iter().flat_map(|r| on_its_lines(r, k)).collect();
                let name = NamedColumn::numbers(name, unit, Vec::new()).name();
                put(name, vec![count, lines], Cells::Number(values));
            }
        }
    }
    arrays
}

/// Dataset 58 of the first curve of each FRF.
fn universal(rows: &[Row]) -> Vec<u8> {
    let datasets: Vec<_> = rows
        .iter()
        .map(|row| {
            ingest::frf_dataset(&FrfRecord {
                name: row.name.into(),
                response: row.response.parse::<Dof>().ok(),
                reference: row.reference.parse::<Dof>().ok(),
                quantity: Some(Quantity::Receptance),
                frequency_hz: row.frequency_hz.to_vec(),
                value: row.curves[0].clone(),
                coherence: None,
            })
        })
        .collect();
    uff58_bytes(
        &datasets,
        Encoding58 {
            binary: None,
            double: true,
        },
    )
}
