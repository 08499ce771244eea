//! The rows of a map of the workspace as a table of polars, and back.

use polars::prelude::{AnyValue, Column, DataFrame, PolarsError, PolarsResult, df};
use serde_json::{Map, Value, json};

use crate::analysis::SweepRow;
use crate::analysis::stability::sweep::PlaceFindings;
use crate::report::stores::sweep_summary::MapColumns;
use crate::{Error, Result};

/// Quantities that a summary tells the spread of.
const QUANTITIES: [&str; 7] = [
    "absolute_limit_mm",
    "best_depth_mm",
    "stiffness_x_n_per_m",
    "stiffness_y_n_per_m",
    "stiffness_z_n_per_m",
    "least_stiffness_n_per_m",
    "lowest_frequency_hz",
];

/// The columns of a merged table for its summary, and with them the least of the three stiffnesses.
///
/// # Errors
/// A table that this program did not write.
pub fn columns(frame: &DataFrame) -> Result<MapColumns> {
    let failed = |e: PolarsError| Error::computation(format!("the merged map: {e}"));
    let numbers = |name: &str| -> Result<Vec<Option<f64>>> {
        let column = frame.column(name).and_then(|c| c.f64()).map_err(failed)?;
        Ok(column.iter().collect())
    };
    let place = |name: &str| Ok::<_, Error>(numbers(name)?.into_iter().flatten().collect::<Vec<f64>>());
    let status = frame.column("status").and_then(|c| c.str()).map_err(failed)?;
    let [x, y, z] = ["x", "y", "z"].map(|axis| numbers(&format!("stiffness_{axis}_n_per_m")));
    let (x, y, z) = (x?, y?, z?);
    let least = (0..x.len()).map(|i| Some(x[i]?.min(y[i]?).min(z[i]?)));
    let least: Vec<Option<f64>> = least.collect();
    let quantities = QUANTITIES
        .into_iter()
        .map(|name| match name {
            "least_stiffness_n_per_m" => Ok((name, least.clone())),
            _ => Ok((name, numbers(name)?)),
        })
        .collect::<Result<Vec<_>>>()?;
    Ok(MapColumns {
        tcp_m: [place("x_m")?, place("y_m")?, place("z_m")?],
        status: status.iter().map(|s| s.unwrap_or_default().to_string()).collect(),
        quantities,
    })
}

/// One row of a table under its columns' names.
pub fn row(frame: &DataFrame, index: usize) -> Map<String, Value> {
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
