//! A map of the workspace in few numbers and one picture.

use serde_json::{Map, Value, json};

use crate::Result;
use crate::lobes::workspace::PlaceStatus;
use crate::report::figure::{CellFormat, HeatMap};
use crate::report::number::decimals;
use crate::statistics::quantile_of_sorted;

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

/// Quantities that a summary tells the spread of.
const QUANTITIES: [&str; 7] = [
    "absolute_limit_mm",
    "best_depth_mm",
    "stiffness_x_n_per_m",
    "stiffness_y_n_per_m",
    "stiffness_z_n_per_m",
    LEAST_STIFFNESS,
    "lowest_frequency_hz",
];
/// The least of the three stiffnesses: no column of its own.
const LEAST_STIFFNESS: &str = "least_stiffness_n_per_m";
const STIFFNESSES: [&str; 3] = [
    "stiffness_x_n_per_m",
    "stiffness_y_n_per_m",
    "stiffness_z_n_per_m",
];
/// Of the tool point.
const COORDINATES: [&str; 3] = ["x_m", "y_m", "z_m"];

/// The table of a map, read place by place and only in the columns asked for: a map need not fit into memory.
pub trait MapTable {
    /// Calls `each` for every place in order, with a value for every name; `None` where a place cannot be used or nothing limits it.
    ///
    /// # Errors
    /// A table that cannot be read, or has no such column of numbers.
    fn numbers(&self, names: &[&str], each: &mut dyn FnMut(&[Option<f64>])) -> Result<()>;

    /// Calls `each` for every place with the name of its [`PlaceStatus`].
    ///
    /// # Errors
    /// A table that cannot be read, or has no such column.
    fn statuses(&self, each: &mut dyn FnMut(&str)) -> Result<()>;
}

/// How many places have each status.
pub fn counts(table: &impl MapTable) -> Result<Map<String, Value>> {
    let mut counts = [0_usize; PlaceStatus::ALL.len()];
    table.statuses(&mut |name| {
        if let Some(i) = PlaceStatus::ALL.iter().position(|s| s.name() == name) {
            counts[i] += 1;
        }
    })?;
    let named = PlaceStatus::ALL.iter().zip(counts);
    Ok(named
        .map(|(s, count)| (s.name().to_string(), json!(count)))
        .collect())
}

/// A quantity, place by place.
fn quantity(table: &impl MapTable, name: &str, mut each: impl FnMut(Option<f64>)) -> Result<()> {
    match name {
        LEAST_STIFFNESS => table.numbers(&STIFFNESSES, &mut |values| {
            let all: Option<Vec<f64>> = values.iter().copied().collect();
            each(all.and_then(|all| all.into_iter().reduce(f64::min)));
        }),
        name => table.numbers(&[name], &mut |values| each(values[0])),
    }
}

/// Quantiles of every quantity over the places that have it. One quantity is in memory at a time.
pub fn quantiles(table: &impl MapTable) -> Result<Map<String, Value>> {
    let of = |name: &str| -> Result<Value> {
        let mut known: Vec<f64> = Vec::new();
        let mut places = 0_usize;
        quantity(table, name, |value| {
            places += usize::from(value.is_some());
            known.extend(value.filter(|v| !v.is_nan()));
        })?;
        known.sort_unstable_by(f64::total_cmp);
        let mut out: Map<String, Value> = SHARES
            .iter()
            .map(|(name, share)| (name.to_string(), json!(quantile_of_sorted(&known, *share))))
            .collect();
        out.insert("places".into(), json!(places));
        Ok(Value::Object(out))
    };
    QUANTITIES
        .iter()
        .map(|name| Ok((name.to_string(), of(name)?)))
        .collect()
}

/// The row where a quantity is greatest, the first of equal ones.
pub fn greatest(table: &impl MapTable, name: &str) -> Result<Option<usize>> {
    let mut best: Option<(usize, f64)> = None;
    let mut place = 0_usize;
    quantity(table, name, |value| {
        if let Some(v) = value.filter(|v| best.map_or(!v.is_nan(), |(_, b)| *v > b)) {
            best = Some((place, v));
        }
        place += 1;
    })?;
    Ok(best.map(|(place, _)| place))
}

/// The values that x, y, z of the tool point take, m; ascending, each once.
pub fn steps(table: &impl MapTable) -> Result<[Vec<f64>; 3]> {
    let mut steps: [Vec<f64>; 3] = Default::default();
    table.numbers(&COORDINATES, &mut |values| {
        for (steps, value) in steps.iter_mut().zip(values) {
            let Some(value) = value else { continue };
            if let Err(place) = steps.binary_search_by(|v| v.total_cmp(value)) {
                steps.insert(place, *value);
            }
        }
    })?;
    // The two zeros are one.
    steps.iter_mut().for_each(Vec::dedup);
    Ok(steps)
}

/// The greatest value of a quantity over all else at each place of the plane with most places; blank where no posture
/// has one. `None` where there is no plane, more cells than can be drawn, or nothing to draw. `steps`: of this table, see
/// [`steps`].
pub fn picture(
    table: &impl MapTable,
    steps: &[Vec<f64>; 3],
    name: &str,
    value_label: &str,
    format: CellFormat,
) -> Result<Option<HeatMap>> {
    // Rows upwards z where there is a choice, columns x.
    let planes = [(2, 0), (1, 0), (2, 1)];
    let cells = |(row, column): (usize, usize)| steps[row].len() * steps[column].len();
    let plane = planes.into_iter().max_by_key(|plane| {
        let preferred = usize::from(*plane == (2, 0));
        (cells(*plane), preferred)
    });
    let Some((row, column)) = plane else {
        return Ok(None);
    };
    let (rows, columns) = (&steps[row], &steps[column]);
    if rows.len() < 2 || columns.len() < 2 || rows.len() > 400 || columns.len() > 300 {
        return Ok(None);
    }
    let mut values: Vec<Vec<Option<f64>>> = vec![vec![None; columns.len()]; rows.len()];
    table.numbers(&[COORDINATES[row], COORDINATES[column], name], &mut |place| {
        let [Some(upwards), Some(along), Some(value)] = *place else {
            return;
        };
        let at = |steps: &[f64], place: f64| steps.partition_point(|v| *v < place);
        // The greatest coordinate on top.
        let cell = &mut values[rows.len() - 1 - at(rows, upwards)][at(columns, along)];
        *cell = Some(cell.map_or(value, |best| best.max(value)));
    })?;
    if values.iter().flatten().flatten().next().is_none() {
        return Ok(None);
    }
    let axis_name = |axis: usize| ["x", "y", "z"][axis];
    let text = |values: &[f64]| values.iter().map(|v| decimals(*v, 3)).collect::<Vec<_>>();
    let mut row_names = text(rows);
    row_names.reverse();
    let rest: String = [0, 1, 2]
        .into_iter()
        .filter(|axis| *axis != row && *axis != column && steps[*axis].len() > 1)
        .map(|axis| format!(", every {}", axis_name(axis)))
        .collect();
    Ok(Some(HeatMap {
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
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns in memory.
    struct Held {
        status: Vec<&'static str>,
        columns: Vec<(&'static str, Vec<Option<f64>>)>,
    }

    impl MapTable for Held {
        fn numbers(&self, names: &[&str], each: &mut dyn FnMut(&[Option<f64>])) -> Result<()> {
            let column = |name: &&str| self.columns.iter().find(|(n, _)| n == name);
            let columns: Option<Vec<_>> = names.iter().map(column).collect();
            let columns = columns.ok_or_else(|| crate::Error::computation("no such column"))?;
            for i in 0..self.status.len() {
                each(&columns.iter().map(|(_, values)| values[i]).collect::<Vec<_>>());
            }
            Ok(())
        }

        fn statuses(&self, each: &mut dyn FnMut(&str)) -> Result<()> {
            self.status.iter().for_each(|s| each(s));
            Ok(())
        }
    }

    /// 3 × 2 × 2 places in x, y, z; depth 10 x + y, none at x = 2, z = 0. Stiffnesses 1e6 (x + axis), no z where y is 0.
    fn table() -> Held {
        let mut rows: Vec<[Option<f64>; 7]> = Vec::new();
        let mut status = Vec::new();
        for x in [1.0, 2.0, 3.0] {
            for y in [0.0, 0.5] {
                for z in [0.0, 1.0] {
                    let usable = !(x == 2.0 && z == 0.0);
                    status.push(if usable { "reachable" } else { "singular" });
                    let stiff = |axis: f64| Some(1e6 * (x + axis)).filter(|_| axis < 2.0 || y > 0.0);
                    rows.push([
                        Some(x),
                        Some(y),
                        Some(z),
                        usable.then_some(10.0 * x + y),
                        stiff(1.0),
                        stiff(0.0),
                        stiff(2.0),
                    ]);
                }
            }
        }
        let names = [&COORDINATES[..], &["best_depth_mm"], &STIFFNESSES].concat();
        let column = |i: usize| rows.iter().map(|row| row[i]).collect();
        let mut columns: Vec<_> = (0..7).map(|i| (names[i], column(i))).collect();
        columns.push(("absolute_limit_mm", vec![None; 12]));
        columns.push(("lowest_frequency_hz", vec![Some(f64::NAN); 12]));
        Held { status, columns }
    }

    #[test]
    fn counts_quantiles_and_the_best_place() {
        let table = table();
        let counts = counts(&table).unwrap();
        assert_eq!(
            (&counts["reachable"], &counts["singular"]),
            (&json!(10), &json!(2))
        );
        assert_eq!(counts["out-of-reach"], 0);
        let quantiles = quantiles(&table).unwrap();
        let of = &quantiles["best_depth_mm"];
        // 10, 10, 10.5, 10.5, 20, 20.5, 30, 30, 30.5, 30.5.
        assert_eq!(
            (&of["least"], &of["median"], &of["places"]),
            (&json!(10.0), &json!(20.25), &json!(10))
        );
        let least = &quantiles[LEAST_STIFFNESS];
        assert_eq!(
            (&least["median"], &least["greatest"], &least["places"]),
            (&json!(2e6), &json!(3e6), &json!(6))
        );
        let none = &quantiles["absolute_limit_mm"];
        assert_eq!((&none["median"], &none["places"]), (&Value::Null, &json!(0)));
        assert_eq!(quantiles["lowest_frequency_hz"]["median"], Value::Null);
        assert_eq!(quantiles.len(), QUANTITIES.len());
        assert_eq!(greatest(&table, "best_depth_mm").unwrap(), Some(10));
        // The first of 3, 3 with all three stiffnesses.
        assert_eq!(greatest(&table, LEAST_STIFFNESS).unwrap(), Some(10));
        assert_eq!(greatest(&table, "absolute_limit_mm").unwrap(), None);
        assert_eq!(greatest(&table, "lowest_frequency_hz").unwrap(), None);
        assert!(greatest(&table, "unknown").is_err());
    }

    #[test]
    fn the_picture_shows_the_best_and_leaves_out_what_cannot_be_reached() {
        let of = |table: &Held, name: &str| {
            let steps = steps(table).unwrap();
            picture(table, &steps, name, "Depth, mm", CellFormat::Significant(3)).unwrap()
        };
        let map = of(&table(), "best_depth_mm").unwrap();
        assert_eq!(map.rows, ["1.000", "0.000"]);
        assert_eq!(map.columns, ["1.000", "2.000", "3.000"]);
        assert_eq!(map.values[0], [Some(10.5), Some(20.5), Some(30.5)]);
        assert_eq!(map.values[1], [Some(10.5), None, Some(30.5)]);
        assert!(map.title.contains("every y"), "{}", map.title);
        assert!(map.png().unwrap().len() > 1000);
        assert!(of(&table(), "absolute_limit_mm").is_none());
        let mut line = table();
        line.columns[1].1 = vec![Some(0.0); 12];
        line.columns[2].1 = [Some(-0.0), Some(0.0)].repeat(6);
        assert_eq!(steps(&line).unwrap()[2].len(), 1);
        assert!(of(&line, "best_depth_mm").is_none());
    }
}
