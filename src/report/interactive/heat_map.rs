//! Cells with their values under the pointer; a click may lead on to an FRF.

use serde_json::{Value, json};

use super::plot::{Plot, axis, axis_key, axis_name, css, layout, number, text, with};
use crate::report::figure::{CellFormat, HeatMap, style};
use crate::report::number::significant;

type Table = [Vec<Option<f64>>];

impl HeatMap {
    pub fn plot(&self) -> Plot {
        let log = self.is_log();
        let tables: Vec<&Table> = std::iter::once(&self.values)
            .chain(&self.beside)
            .map(Vec::as_slice)
            .collect();
        let share = 1.0 / tables.len() as f64;
        let mut layout = layout();
        let data = tables.iter().enumerate().map(|(i, table)| {
            let (left, right) = (
                share * i as f64,
                share * (i + 1) as f64 - if tables.len() > 1 { 0.02 } else { 0.0 },
            );
            let titles = match self.table_titles.get(i).filter(|t| !t.is_empty()) {
                Some(title) => format!("{} – {}", text(title), text(&self.column_label)),
                None => text(&self.column_label),
            };
            layout[axis_key('x', i)] = with(
                named(&titles, &self.columns),
                json!({ "domain": [left, right.max(left)], "anchor": axis_name('y', i) }),
            );
            layout[axis_key('y', i)] = with(
                named(&text(&self.row_label), &self.rows),
                json!({ "autorange": "reversed", "anchor": axis_name('x', i), "showticklabels": i == 0 }),
            );
            if i > 0 {
                let y = &mut layout[axis_key('y', i)];
                y["title"] = Value::Null;
                y["matches"] = json!("y");
            }
            let shades = if i == 0 { self.coloured() } else { table };
            let mut trace = self.trace(shades, table, log);
            trace["xaxis"] = json!(axis_name('x', i));
            trace["yaxis"] = json!(axis_name('y', i));
            trace["showscale"] = json!(i == 0);
            trace
        });
        let data: Vec<Value> = data.collect();
        layout["margin"]["t"] = json!(24);
        Plot {
            title: self.title.clone(),
            height_px: (25.0 * self.rows.len() as f64).clamp(170.0, 900.0) + 130.0,
            data,
            layout,
            ..Plot::default()
        }
    }

    fn is_log(&self) -> bool {
        self.log && self.scale().is_some_and(|(low, _)| low > 0.0)
    }

    fn trace(&self, shades: &Table, values: &Table, log: bool) -> Value {
        let (low, high) = self.scale().unwrap_or((0.0, 1.0));
        let on_scale = |v: f64| if log { v.log10() } else { v };
        let readable = self.columns.len() * (1 + self.beside.len()) <= 16 && self.rows.len() <= 60;
        let scale = (0..=10).map(|k| f64::from(k) / 10.0);
        let mut trace = json!({
            "type": "heatmap",
            "z": self.cells(shades, |v| number(on_scale(v))),
            "text": self.cells(values, |v| json!(self.written(v))),
            "zmin": number(on_scale(low)),
            "zmax": number(on_scale(high)),
            "colorscale": scale.map(|s| json!([s, css(style::ramp(s))])).collect::<Value>(),
            "colorbar": self.colour_bar(low, high, log),
            "xgap": 1,
            "ygap": 1,
            "hoverongaps": false,
            "hovertemplate": "%{y}, %{x}: %{text}<extra></extra>",
        });
        if readable {
            trace["texttemplate"] = json!("%{text}");
        }
        trace
    }

    /// Row by row, null where there is nothing.
    fn cells(&self, table: &Table, cell: impl Fn(f64) -> Value) -> Value {
        let value = |r: usize, c: usize| *table.get(r)?.get(c)?;
        let row = |r| {
            (0..self.columns.len())
                .map(|c| value(r, c).filter(|v| v.is_finite()).map(&cell))
                .collect::<Vec<_>>()
        };
        json!((0..self.rows.len()).map(row).collect::<Vec<_>>())
    }

    fn colour_bar(&self, low: f64, high: f64, log: bool) -> Value {
        // Short maps have a short scale.
        let label = match self.rows.len() {
            0..12 => text(&self.value_label).replacen(" (", "<br>(", 1),
            _ => text(&self.value_label),
        };
        let title = json!({ "text": label, "side": "right" });
        let mut bar = json!({ "title": title, "thickness": 16, "outlinewidth": 1 });
        if self.scale_format() == CellFormat::Percent {
            bar["tickformat"] = json!("~p");
        }
        if log {
            let steps = (-6..9).flat_map(|e| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(e)));
            let ticks: Vec<f64> = steps.filter(|t| (low..=high).contains(t)).collect();
            bar["tickvals"] = ticks.iter().map(|t| t.log10()).collect();
            bar["ticktext"] = ticks.iter().map(|t| significant(*t, 1)).collect();
        }
        bar
    }
}

/// An axis of names at 0, 1, 2, …; equal names stay apart.
fn named(title: &str, names: &[String]) -> Value {
    with(
        axis(title),
        json!({
            "tickvals": (0..names.len()).collect::<Vec<_>>(),
            "ticktext": names.iter().map(|n| text(n)).collect::<Vec<_>>(),
            "showgrid": false,
        }),
    )
}

impl Plot {
    /// Makes the cells lead to FRFs: `frf` their numbers, `bands_hz` what to mark there, one a column (empty where columns
    /// are no bands).
    pub fn leading_to(mut self, frf: &[Vec<Option<usize>>], bands_hz: &[[f64; 2]]) -> Self {
        self.links = json!({ "frf": frf, "bands_hz": bands_hz });
        self
    }

    /// What the map is for each model of the page's FRFs, so that it changes with the choice.
    pub fn at_stages(mut self, maps: &[HeatMap]) -> Self {
        let stage = |map: &HeatMap| {
            let mut trace = map.trace(map.coloured(), &map.values, map.is_log());
            json!({ "title": map.title, "z": trace["z"].take(), "text": trace["text"].take() })
        };
        self.stages = maps.iter().map(stage).collect();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> HeatMap {
        HeatMap {
            title: "error".into(),
            rows: vec!["p1 <b>".into(), "p1 <b>".into()],
            columns: vec!["XX".into()],
            values: vec![vec![Some(0.25)], vec![None]],
            shades: vec![vec![Some(10.0)], vec![None]],
            range: Some((1.0, 100.0)),
            log: true,
            ..HeatMap::default()
        }
    }

    #[test]
    fn cells_say_the_error_and_are_coloured_by_its_ratio_to_the_noise() {
        let plot = map().leading_map().value();
        let trace = &plot["data"][0];
        assert_eq!(trace["z"], json!([[1], [null]]), "log10 of the ratio");
        assert_eq!(trace["text"], json!([["25.0\u{a0}%"], [null]]));
        assert_eq!((&trace["zmin"], &trace["zmax"]), (&json!(0), &json!(2)));
        assert_eq!(trace["colorbar"]["ticktext"][0], "1");
        // Equal names stay two rows, and are no markup.
        assert_eq!(
            plot["layout"]["yaxis"]["ticktext"],
            json!(["p1 &lt;b&gt;", "p1 &lt;b&gt;"])
        );
        assert_eq!(plot["links"]["frf"][0][0], 7);
        assert_eq!(plot["stages"][0]["z"], trace["z"]);
        assert_eq!(plot["stages"][0]["title"], "error");
    }

    impl HeatMap {
        fn leading_map(&self) -> Plot {
            let frfs = [vec![Some(7)], vec![None]];
            self.plot()
                .leading_to(&frfs, &[])
                .at_stages(std::slice::from_ref(self))
        }
    }
}
