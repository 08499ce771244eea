//! Average force over feed with the fitted lines, and below it what they leave over.

use serde_json::{Value, json};

use super::plot::{Plot, axis, axis_name, line, numbers, sign, stacked, symbol, text, with};
use crate::report::figure::canvas::Marker;
use crate::report::figure::{RegressionFigure, RegressionMark, RegressionSeries, style};

impl RegressionFigure {
    pub fn plot(&self) -> Plot {
        let mut data = Vec::new();
        let feeds = self.series.iter().flat_map(|s| &s.points).map(|p| p.x);
        let most = feeds.filter(|x| x.is_finite()).fold(0.0, f64::max);
        for (i, series) in self.series.iter().enumerate() {
            let stroke = style::series(i);
            let name = text(&series.label);
            if let Some((intercept, slope)) = series.line {
                let x = [0.0, 1.05 * most];
                data.push(json!({
                    "type": "scatter",
                    "mode": "lines",
                    "name": name,
                    "legendgroup": name,
                    "showlegend": false,
                    "hoverinfo": "skip",
                    "line": line(stroke),
                    "x": numbers(x),
                    "y": numbers(x.map(|x| intercept + slope * x)),
                }));
            }
            let all = series.points.iter().map(|p| (p, p.y));
            data.push(signs(series, i, 0, all.collect()));
            if series.line.is_some() {
                data.push(signs(series, i, 1, series.rests().collect()));
            }
        }
        let force = json!({ "zeroline": true, "zerolinecolor": "#9aa0a8" });
        let mut panels = vec![(with(axis(&text(&self.y_label)), force), 2.2)];
        let lined = self.series.iter().any(|s| s.line.is_some());
        if lined {
            let rest = json!({ "zeroline": true, "zerolinecolor": "#3c4046" });
            panels.push((with(axis(&text(&self.rest_label())), rest), 1.0));
        }
        Plot {
            title: self.title.clone(),
            height_px: if lined { 640.0 } else { 480.0 },
            data,
            layout: stacked(
                with(axis(&text(&self.x_label)), json!({ "rangemode": "tozero" })),
                panels,
            ),
            ..Plot::default()
        }
    }
}

/// `points` of a series in the upper (0) or lower (1) panel.
fn signs(series: &RegressionSeries, i: usize, panel: usize, points: Vec<(&RegressionMark, f64)>) -> Value {
    let name = text(&series.label);
    let shape = |p: &RegressionMark| match p.excluded {
        true => Marker::Cross,
        false => style::series_marker(i),
    };
    let mut marker = sign(style::series_marker(i), 9.0, style::series(i).color);
    if points.iter().any(|(p, _)| p.excluded) {
        marker["symbol"] = points.iter().map(|(p, _)| symbol(shape(p))).collect();
    }
    json!({
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "legendgroup": name,
        "showlegend": panel == 0,
        "yaxis": axis_name('y', panel),
        "marker": marker,
        "x": numbers(points.iter().map(|(p, _)| p.x)),
        "y": numbers(points.iter().map(|(_, y)| *y)),
        "text": points.iter().map(|(p, _)| text(&p.label)).collect::<Vec<_>>(),
        "error_y": {
            "type": "data",
            "array": numbers(points.iter().map(|(p, _)| p.std_error.unwrap_or(0.0))),
            "thickness": 1.2,
            "width": 3,
        },
        "hovertemplate": "%{text}, %{x:.4g}: %{y:.4g}",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residuals_are_what_the_line_leaves_over() {
        let point = |x, y, excluded| RegressionMark {
            label: "cut 1".into(),
            x,
            y,
            std_error: Some(0.5),
            excluded,
        };
        let series = RegressionSeries {
            points: vec![
                point(0.1, 13.0, false),
                point(0.2, 12.5, false),
                point(0.2, 99.0, true),
            ],
            line: Some((10.0, 20.0)),
            ..RegressionSeries::default()
        };
        let figure = RegressionFigure {
            y_label: "Average force (N)".into(),
            series: vec![series],
            ..RegressionFigure::default()
        };
        let plot = figure.plot().value();
        let of = |axis: &str| {
            let traces = plot["data"].as_array().unwrap().iter();
            traces
                .filter(|t| t["yaxis"] == axis)
                .map(|t| t["y"].clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            of("y2"),
            [json!([1, -1.5])],
            "a point left out of the fit has none"
        );
        assert_eq!(of("y"), [json!([13, 12.5, 99])]);
        assert_eq!(plot["data"][1]["marker"]["symbol"][2], "x-thin");
        assert_eq!(plot["layout"]["yaxis2"]["title"]["text"], "Residual (N)");
    }
}
