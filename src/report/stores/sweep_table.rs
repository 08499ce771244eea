//! The rows of a map of the workspace as a table of polars, and back.

use std::fs::File;
use std::path::{Path, PathBuf};

use polars::prelude::{AnyValue, Column, DataFrame, ParquetReader, PolarsError, PolarsResult, SerReader, df};
use serde_json::{Map, Value, json};

use crate::analysis::SweepRow;
use crate::analysis::stability::sweep::PlaceFindings;
use crate::report::stores::sweep_summary::MapTable;
use crate::{Error, Result};

/// Rows that are in memory at a time: those of a group in the merged file, which readers take in one piece, too.
pub const ROWS_AT_A_TIME: usize = 1 << 16;

/// A merged table; stays in its file.
pub struct MergedTable {
    pub path: PathBuf,
    pub places: usize,
}

impl MergedTable {
    fn fault(&self, error: PolarsError) -> Error {
        Error::computation(format!("{}: {error}", self.path.display()))
    }

    /// The named columns, a stretch of places after the other.
    fn stretches(&self, names: &[&str], mut each: impl FnMut(&DataFrame) -> PolarsResult<()>) -> Result<()> {
        for from in (0..self.places).step_by(ROWS_AT_A_TIME) {
            let stretch = read(&self.path, Some(names), from, ROWS_AT_A_TIME)?;
            each(&stretch).map_err(|e| self.fault(e))?;
        }
        Ok(())
    }

    /// One row under its columns' names.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn row(&self, place: usize) -> Result<Map<String, Value>> {
        let one = read(&self.path, None, place, 1)?;
        Ok(row(&one, 0))
    }
}

impl MapTable for MergedTable {
    fn numbers(&self, names: &[&str], each: &mut dyn FnMut(&[Option<f64>])) -> Result<()> {
        self.stretches(names, |stretch| {
            let columns = names.iter().map(|name| stretch.column(name)?.f64());
            let columns = columns.collect::<PolarsResult<Vec<_>>>()?;
            let mut columns: Vec<_> = columns.into_iter().map(|c| c.iter()).collect();
            let mut values = vec![None; columns.len()];
            for _ in 0..stretch.height() {
                for (value, column) in values.iter_mut().zip(&mut columns) {
                    *value = column.next().flatten();
                }
                each(&values);
            }
            Ok(())
        })
    }

    fn statuses(&self, each: &mut dyn FnMut(&str)) -> Result<()> {
        self.stretches(&["status"], |stretch| {
            let status = stretch.column("status")?.str()?;
            status.iter().for_each(|s| each(s.unwrap_or_default()));
            Ok(())
        })
    }
}

/// Rows of a table's file, `count` of them at most; all columns, or those of the names.
///
/// # Errors
/// A file that cannot be read, by its name.
pub fn read(path: &Path, columns: Option<&[&str]>, from: usize, count: usize) -> Result<DataFrame> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let columns = columns.map(|names| names.iter().map(|name| name.to_string()).collect());
    ParquetReader::new(file)
        .with_columns(columns)
        .with_slice(Some((from, count)))
        .finish()
        .map_err(|e| Error::computation(format!("{}: {e}", path.display())))
}

/// One row of a table under its columns' names.
fn row(frame: &DataFrame, index: usize) -> Map<String, Value> {
    let value = |value: AnyValue| match value {
        AnyValue::Float64(v) => json!(v),
        AnyValue::UInt32(v) => json!(v),
        AnyValue::String(v) => json!(v),
        AnyValue::StringOwned(v) => json!(v.as_str()),
        _ => Value::Null,
    };
    let columns = frame.columns().iter();
    columns
        .map(|c| (c.name().to_string(), c.get(index).map_or(Value::Null, value)))
        .collect()
}

/// One row a place, columns q1_deg … for as many joints as the robot has. What a place that cannot be used has no value of is null, and so are depths that nothing limits.
///
/// # Errors
/// polars', which would be a fault of this program.
pub fn frame(rows: &[SweepRow], joints: usize) -> PolarsResult<DataFrame> {
    let place = |f: fn(&SweepRow) -> f64| rows.iter().map(f).collect::<Vec<f64>>();
    let found = |f: &dyn Fn(&PlaceFindings) -> Option<f64>| {
        rows.iter()
            .map(|row| row.findings.as_ref().and_then(f))
            .collect::<Vec<Option<f64>>>()
    };
    let joint = |i: usize| found(&|p| p.joints_deg.get(i).copied());
    let stiffness = |i: usize| found(&|p| Some(p.tcp_stiffness_n_per_m[i]));
    let branch = |row: &SweepRow| row.findings.as_ref().map(|p| p.ik_branch);
    let mut frame = df!(
        "place" => rows.iter().map(|r| r.place.index as u32).collect::<Vec<_>>(),
        "x_m" => place(|r| r.place.tcp_m[0]),
        "y_m" => place(|r| r.place.tcp_m[1]),
        "z_m" => place(|r| r.place.tcp_m[2]),
        "tool_axis_x" => place(|r| r.place.tool_axis[0]),
        "tool_axis_y" => place(|r| r.place.tool_axis[1]),
        "tool_axis_z" => place(|r| r.place.tool_axis[2]),
        "angle_deg" => place(|r| r.place.angle_deg),
        "status" => rows.iter().map(|r| r.status.name()).collect::<Vec<_>>(),
        "ik_branch" => rows.iter().map(branch).collect::<Vec<_>>(),
        "limit_margin_deg" => found(&|p| p.limit_margin_deg),
        "singularity_margin" => found(&|p| Some(p.singularity_margin)),
        "absolute_limit_mm" => found(&|p| p.absolute.map(|a| a.depth_mm)),
        "absolute_limit_hz" => found(&|p| p.absolute.map(|a| a.chatter_hz)),
        "best_depth_mm" => found(&|p| p.best.depth_mm),
        "best_spindle_rpm" => found(&|p| Some(p.best.spindle_rpm)),
        "stiffness_x_n_per_m" => stiffness(0),
        "stiffness_y_n_per_m" => stiffness(1),
        "stiffness_z_n_per_m" => stiffness(2),
        "lowest_frequency_hz" => found(&|p| p.lowest_frequency_hz),
    )?;
    let behind = frame.get_column_index("ik_branch").map_or(0, |i| i + 1);
    for i in 0..joints {
        let column = Column::new(format!("q{}_deg", i + 1).into(), joint(i));
        frame.insert_column(behind + i, column)?;
    }
    Ok(frame)
}
