//! A map of the workspace in few numbers and one picture.

use serde_json::{Map, Value, json};

use crate::lobes::workspace::PlaceStatus;
use crate::report::figure::{CellFormat, HeatMap};
use crate::statistics::quantile;

/// Shares of the usable places at which quantities are told.
const SHARES: [(&str, f64); 7] = [
    ("least", 0.0),
    ("p05", 0.05),
    ("p25", 0.25),
    ("median", 0.5),
    ("p75", 0.75),
    ("p95", 0.95),
    ("greatest", 1.0),
];

/// The columns of a map that the summary is made of; all as long.
#[derive(Debug, Clone, Default)]
pub struct MapColumns {
    /// x, y, z of the tool point, m.
    pub tcp_m: [Vec<f64>; 3],
    /// Names of [`PlaceStatus`].
    pub status: Vec<String>,
    /// Names with their units, and values; `None` where a place cannot be used or nothing limits it.
    pub quantities: Vec<(&'static str, Vec<Option<f64>>)>,
}

impl MapColumns {
    /// The values of a quantity; none of an unknown one.
    pub fn of(&self, name: &str) -> &[Option<f64>] {
        let found = self.quantities.iter().find(|(n, _)| *n == name);
        found.map_or(&[], |(_, values)| values)
    }

    /// How many places have each status.
    pub fn counts(&self) -> Map<String, Value> {
        let count = |name: &str| self.status.iter().filter(|s| *s == name).count();
        PlaceStatus::ALL
            .iter()
            .map(|s| (s.name().to_string(), json!(count(s.name()))))
            .collect()
    }

    /// Quantiles of every quantity over the places that have it.
    pub fn quantiles(&self) -> Map<String, Value> {
        let of = |values: &[Option<f64>]| {
            let mut known: Vec<f64> = values.iter().flatten().copied().collect();
            known.sort_by(f64::total_cmp);
            let places = known.len();
            let mut out: Map<String, Value> = SHARES
                .iter()
                .map(|(name, share)| (name.to_string(), json!(quantile(known.clone(), *share))))
                .collect();
            out.insert("places".into(), json!(places));
            Value::Object(out)
        };
        self.quantities
            .iter()
            .map(|(name, values)| (name.to_string(), of(values)))
            .collect()
    }

    /// The row where a quantity is greatest, the first of equal ones.
    pub fn greatest(&self, name: &str) -> Option<usize> {
        let known = self
            .of(name)
            .iter()
            .enumerate()
            .filter_map(|(i, v)| Some((i, (*v)?)));
        let best = known.fold(None, |best: Option<(usize, f64)>, (i, v)| match best {
            Some((_, b)) if b >= v => best,
            _ => Some((i, v)),
        });
        best.map(|(i, _)| i)
    }

    /// The greatest value of a quantity over all else at each place of the plane with most places; blank where no posture
    /// has one. `None` where there is no plane, more cells than can be drawn, or nothing to draw.
    pub fn picture(&self, name: &str, value_label: &str, format: CellFormat) -> Option<HeatMap> {
        let steps = [0, 1, 2].map(|axis| distinct(&self.tcp_m[axis]));
        // Rows upwards z where there is a choice, columns x.
        let planes = [(2, 0), (1, 0), (2, 1)];
        let cells = |(row, column): (usize, usize)| steps[row].len() * steps[column].len();
        let (row, column) = planes.into_iter().max_by_key(|plane| {
            let preferred = usize::from(*plane == (2, 0));
            (cells(*plane), preferred)
        })?;
        let (rows, columns) = (&steps[row], &steps[column]);
        if rows.len() < 2 || columns.len() < 2 || rows.len() > 400 || columns.len() > 300 {
            return None;
        }
        let mut values: Vec<Vec<Option<f64>>> = vec![vec![None; columns.len()]; rows.len()];
        for (i, value) in self.of(name).iter().enumerate() {
            let Some(value) = value else { continue };
            let at = |axis: usize| {
                let place = self.tcp_m[axis][i];
                steps[axis].partition_point(|v| *v < place)
            };
            // The greatest coordinate on top.
            let cell = &mut values[rows.len() - 1 - at(row)][at(column)];
            *cell = Some(cell.map_or(*value, |best| best.max(*value)));
        }
        values.iter().flatten().flatten().next()?;
        let axis_name = |axis: usize| ["x", "y", "z"][axis];
        let text = |values: &[f64]| values.iter().map(|v| format!("{v:.3}")).collect::<Vec<_>>();
        let mut row_names = text(rows);
        row_names.reverse();
        let rest: String = [0, 1, 2]
            .into_iter()
            .filter(|axis| *axis != row && *axis != column && steps[*axis].len() > 1)
            .map(|axis| format!(", every {}", axis_name(axis)))
            .collect();
        Some(HeatMap {
            title: format!("{value_label}: the best over every angle and direction{rest}"),
            row_label: format!("{} of the tool point, m", axis_name(row)),
            column_label: format!(
                "{} of the tool point, m (–: no usable posture)",
                axis_name(column)
            ),
            rows: row_names,
            columns: text(columns),
            values,
            value_label: value_label.to_string(),
            format,
            ..HeatMap::default()
        })
    }
}

/// Ascending, each value once.
fn distinct(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    sorted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 2 × 2 places in x, y, z; depth 10 x + y, none at x = 2, z = 0.
    fn columns() -> MapColumns {
        let mut columns = MapColumns::default();
        let mut depth = Vec::new();
        for x in [1.0, 2.0, 3.0] {
            for y in [0.0, 0.5] {
                for z in [0.0, 1.0] {
                    for (column, value) in columns.tcp_m.iter_mut().zip([x, y, z]) {
                        column.push(value);
                    }
                    let usable = !(x == 2.0 && z == 0.0);
                    columns
                        .status
                        .push(if usable { "reachable" } else { "singular" }.into());
                    depth.push(usable.then_some(10.0 * x + y));
                }
            }
        }
        columns.quantities = vec![("best_depth_mm", depth)];
        columns
    }

    #[test]
    fn counts_quantiles_and_the_best_place() {
        let columns = columns();
        let counts = columns.counts();
        assert_eq!(
            (&counts["reachable"], &counts["singular"]),
            (&json!(10), &json!(2))
        );
        assert_eq!(counts["out-of-reach"], 0);
        let of = &columns.quantiles()["best_depth_mm"];
        // 10, 10, 10.5, 10.5, 20, 20.5, 30, 30, 30.5, 30.5.
        assert_eq!(
            (&of["least"], &of["median"], &of["places"]),
            (&json!(10.0), &json!(20.25), &json!(10))
        );
        assert_eq!(columns.greatest("best_depth_mm"), Some(10));
        assert_eq!(columns.greatest("unknown"), None);
    }

    #[test]
    fn the_picture_shows_the_best_and_leaves_out_what_cannot_be_reached() {
        let map = columns()
            .picture("best_depth_mm", "Depth, mm", CellFormat::Significant(3))
            .unwrap();
        assert_eq!(map.rows, ["1.000", "0.000"]);
        assert_eq!(map.columns, ["1.000", "2.000", "3.000"]);
        assert_eq!(map.values[0], [Some(10.5), Some(20.5), Some(30.5)]);
        assert_eq!(map.values[1], [Some(10.5), None, Some(30.5)]);
        assert!(map.title.contains("every y"), "{}", map.title);
        assert!(map.png().unwrap().len() > 1000);
        let mut line = columns();
        line.tcp_m[1] = vec![0.0; 12];
        line.tcp_m[2] = vec![0.0; 12];
        assert!(
            line.picture("best_depth_mm", "Depth", CellFormat::Percent)
                .is_none()
        );
    }
}
