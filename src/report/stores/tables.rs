//! The numbers of a report as Parquet tables, for other programs: `tables/*.parquet`.
//!
//! Missing values are null. Units are in the column names; `nrms` and `damping_ratio` are ratios.

use std::path::{Path, PathBuf};

use polars::prelude::{DataFrame, ParquetWriter, PolarsResult, df};

use crate::analysis::CampaignFindings;
use crate::cutting::{CfcResult, ForceAxis};
use crate::files::write_atomically;
use crate::{Error, Result};

/// A table ready to be written.
pub struct ResultTable {
    pub name: &'static str,
    pub bytes: Vec<u8>,
}

/// All tables that the findings fill; empty ones are left out.
///
/// # Errors
/// polars', which would be a fault of this program.
pub fn tables(findings: &CampaignFindings) -> Result<Vec<ResultTable>> {
    let mut frames = Vec::new();
    if let Some(s) = findings.structure() {
        frames.push(("errors_by_frf", frf_errors(&s.analysis)));
        frames.push(("errors_by_band", band_errors(&s.analysis)));
        frames.push(("parameters", parameters(&s.analysis)));
    }
    if let Some(modal) = findings.modal() {
        frames.push(("modes", modes(modal)));
    }
    if let Some(result) = findings.cutting() {
        frames.push(("cut_averages", cut_averages(result)));
        frames.push(("cutting_coefficients", coefficients(result)));
    }
    if let Some(lobes) = findings.lobes() {
        let measured = lobes.measured.as_ref().and_then(|m| m.as_ref().ok());
        frames.push((
            "lobes",
            lobe_curves([Some(&lobes.asked), measured].into_iter().flatten()),
        ));
    }
    let mut tables = Vec::new();
    for (name, frame) in frames {
        let failed = |e| Error::computation(format!("table {name}: {e}"));
        let mut frame = frame.map_err(failed)?;
        if frame.height() == 0 {
            continue;
        }
        let mut bytes = Vec::new();
        ParquetWriter::new(&mut bytes)
            .finish(&mut frame)
            .map_err(failed)?;
        tables.push(ResultTable { name, bytes });
    }
    Ok(tables)
}

/// Writes the tables into `folder`, each file whole or not at all; gives their paths.
///
/// # Errors
/// What the file system refuses, naming the file.
pub fn write(tables: &[ResultTable], folder: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
    tables
        .iter()
        .map(|table| {
            let path = folder.join(format!("{}.parquet", table.name));
            write_atomically(&path, &table.bytes)?;
            Ok(path)
        })
        .collect()
}

type Analysis = crate::analysis::StructureAnalysis;

fn frf_errors(analysis: &Analysis) -> PolarsResult<DataFrame> {
    let (before, after) = (&analysis.before.frf_errors, &analysis.after.frf_errors);
    let text = |f: fn(&crate::discrepancy::FrfError) -> &String| {
        after.iter().map(|e| f(e).clone()).collect::<Vec<_>>()
    };
    df!(
        "posture" => text(|e| &e.posture),
        "frf" => text(|e| &e.name),
        "direction" => text(|e| &e.direction),
        "nrms_robot_file" => before.iter().map(|e| e.nrms).collect::<Vec<_>>(),
        "nrms_calibrated" => after.iter().map(|e| e.nrms).collect::<Vec<_>>(),
        "noise_floor_nrms" => after.iter().map(|e| e.noise_floor_nrms).collect::<Vec<_>>(),
    )
}

/// One row an FRF and band.
fn band_errors(analysis: &Analysis) -> PolarsResult<DataFrame> {
    let edges = &analysis.after.map.band_edges_hz;
    let (mut posture, mut frf, mut direction) = (Vec::new(), Vec::new(), Vec::new());
    let (mut from_hz, mut to_hz, mut before_nrms, mut after_nrms) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (before, after) in analysis.before.frf_errors.iter().zip(&analysis.after.frf_errors) {
        let bands = edges
            .windows(2)
            .zip(before.band_nrms.iter().zip(&after.band_nrms));
        for (edge, (b, a)) in bands.filter(|(_, (_, a))| a.is_some()) {
            posture.push(after.posture.clone());
            frf.push(after.name.clone());
            direction.push(after.direction.clone());
            from_hz.push(edge[0]);
            to_hz.push(edge[1]);
            before_nrms.push(*b);
            after_nrms.push(*a);
        }
    }
    df!(
        "posture" => posture,
        "frf" => frf,
        "direction" => direction,
        "from_hz" => from_hz,
        "to_hz" => to_hz,
        "nrms_robot_file" => before_nrms,
        "nrms_calibrated" => after_nrms,
    )
}

fn parameters(analysis: &Analysis) -> PolarsResult<DataFrame> {
    let p = &analysis.calibration.parameters;
    df!(
        "name" => p.iter().map(|p| p.name.clone()).collect::<Vec<_>>(),
        "unit" => p.iter().map(|p| p.unit).collect::<Vec<_>>(),
        "initial" => p.iter().map(|p| p.initial).collect::<Vec<_>>(),
        "value" => p.iter().map(|p| p.value).collect::<Vec<_>>(),
        "std_error" => p.iter().map(|p| finite(p.std_error)).collect::<Vec<_>>(),
        "at_bound" => p.iter().map(|p| p.at_bound).collect::<Vec<_>>(),
    )
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn modes(modal: &crate::analysis::ModalAnalysis) -> PolarsResult<DataFrame> {
    let all: Vec<_> = modal
        .sets
        .iter()
        .flat_map(|p| p.global.modes.iter().map(move |m| (p, m)))
        .collect();
    df!(
        "posture" => all.iter().map(|(p, _)| p.set.clone()).collect::<Vec<_>>(),
        "frequency_hz" => all.iter().map(|(_, m)| m.frequency_hz).collect::<Vec<_>>(),
        "frequency_std_hz" => all.iter().map(|(_, m)| finite(m.frequency_std_hz)).collect::<Vec<_>>(),
        "damping_ratio" => all.iter().map(|(_, m)| m.damping_ratio).collect::<Vec<_>>(),
        "damping_std" => all.iter().map(|(_, m)| finite(m.damping_std)).collect::<Vec<_>>(),
        "found_in" => all.iter().map(|(_, m)| m.found_in as u32).collect::<Vec<_>>(),
    )
}

/// One row a cut; N, torque N·m, tool axes.
fn cut_averages(result: &CfcResult) -> PolarsResult<DataFrame> {
    let cuts = &result.cuts;
    let average = |axis: ForceAxis| move |c: &crate::cutting::CutAnalysis| c.averages[axis.index()];
    let value = |axis| {
        cuts.iter()
            .map(move |c| average(axis)(c).map(|a| a.value))
            .collect::<Vec<_>>()
    };
    let error = |axis| {
        cuts.iter()
            .map(move |c| average(axis)(c).and_then(|a| finite(a.std_error)))
            .collect::<Vec<_>>()
    };
    let fitted = |axis: ForceAxis| {
        let points = || result.pooled.iter().flat_map(|g| &g.points);
        let of_cut = |id: &str| points().find(|p| p.cut == id && p.axis == axis).map(|p| p.fitted);
        cuts.iter().map(|c| of_cut(&c.id)).collect::<Vec<_>>()
    };
    df!(
        "cut" => cuts.iter().map(|c| c.id.clone()).collect::<Vec<_>>(),
        "spindle_rpm" => cuts.iter().map(|c| c.spindle_rpm).collect::<Vec<_>>(),
        "cutting_speed_m_per_min" => cuts.iter().map(|c| c.cutting_speed_m_per_min).collect::<Vec<_>>(),
        "feed_mm" => cuts.iter().map(|c| c.feed_mm).collect::<Vec<_>>(),
        "steady_from_s" => cuts.iter().map(|c| c.steady_s[0]).collect::<Vec<_>>(),
        "steady_to_s" => cuts.iter().map(|c| c.steady_s[1]).collect::<Vec<_>>(),
        "revolutions" => cuts.iter().map(|c| c.revolutions).collect::<Vec<_>>(),
        "fx_n" => value(ForceAxis::X),
        "fx_std_error_n" => error(ForceAxis::X),
        "fx_fitted_n" => fitted(ForceAxis::X),
        "fy_n" => value(ForceAxis::Y),
        "fy_std_error_n" => error(ForceAxis::Y),
        "fy_fitted_n" => fitted(ForceAxis::Y),
        "fz_n" => value(ForceAxis::Z),
        "fz_std_error_n" => error(ForceAxis::Z),
        "fz_fitted_n" => fitted(ForceAxis::Z),
        "mz_nm" => value(ForceAxis::Mz),
        "mz_std_error_nm" => error(ForceAxis::Mz),
        "mz_fitted_nm" => fitted(ForceAxis::Mz),
    )
}

/// One row a group and coefficient; the group over all speeds is `pooled`.
fn coefficients(result: &CfcResult) -> PolarsResult<DataFrame> {
    let groups = result.groups.iter().map(|g| (g, false));
    let all: Vec<_> = groups
        .chain(result.pooled.iter().map(|g| (g, true)))
        .flat_map(|(g, pooled)| g.coefficients.iter().map(move |c| (g, pooled, c)))
        .collect();
    df!(
        "process" => all.iter().map(|(g, ..)| g.process.name()).collect::<Vec<_>>(),
        "pooled" => all.iter().map(|(_, pooled, _)| *pooled).collect::<Vec<_>>(),
        "cutting_speed_m_per_min" => all.iter().map(|(g, ..)| g.cutting_speed_m_per_min).collect::<Vec<_>>(),
        "coefficient" => all.iter().map(|(_, _, c)| c.label).collect::<Vec<_>>(),
        "unit" => all.iter().map(|(_, _, c)| c.unit).collect::<Vec<_>>(),
        "value" => all.iter().map(|(_, _, c)| c.value).collect::<Vec<_>>(),
        "std_error" => all.iter().map(|(_, _, c)| c.std_error).collect::<Vec<_>>(),
    )
}

fn lobe_curves<'a>(
    analyses: impl Iterator<Item = &'a crate::analysis::LobeAnalysis>,
) -> PolarsResult<DataFrame> {
    let (mut source, mut posture, mut rpm) = (Vec::new(), Vec::new(), Vec::new());
    let (mut depth, mut chatter) = (Vec::new(), Vec::new());
    for analysis in analyses {
        let name = match analysis.source {
            crate::campaign::LobeSource::Model => "model",
            crate::campaign::LobeSource::Measured => "measured",
            crate::campaign::LobeSource::Modes => "modes",
        };
        for case in &analysis.cases {
            let rows = case.curve.spindle_rpm.len();
            source.extend(std::iter::repeat_n(name, rows));
            posture.extend(std::iter::repeat_n(case.posture.clone(), rows));
            rpm.extend_from_slice(&case.curve.spindle_rpm);
            depth.extend_from_slice(&case.curve.depth_limit_mm);
            chatter.extend_from_slice(&case.curve.chatter_hz);
        }
    }
    df!(
        "source" => source,
        "posture" => posture,
        "spindle_rpm" => rpm,
        "depth_limit_mm" => depth,
        "chatter_hz" => chatter,
    )
}
