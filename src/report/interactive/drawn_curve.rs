//! A dynamic stiffness that the data drew, with the form fitted to it.

use serde_json::json;

use super::plot::{Plot, axis, axis_name, line, number, numbers, sign, stacked, text, with};
use crate::report::figure::DrawnCurveFigure;
use crate::report::figure::dynamics::drawn_curve::PARTS;
use crate::report::figure::sheet::canvas::{Marker, Stroke};
use crate::report::figure::sheet::style;

/// Room above and below what must be seen, as a share of it.
const MARGIN: f64 = 0.15;

impl DrawnCurveFigure {
    pub fn plot(&self) -> Plot {
        let lines = self.lines();
        let mut data = Vec::new();
        let mut panels = Vec::new();
        for (i, (name, part)) in PARTS.into_iter().enumerate() {
            let (least, largest) = self.range(part);
            let room = MARGIN * (largest - least);
            let range = json!([number(least - room), number(largest + room)]);
            panels.push((
                with(
                    axis(&text(&format!("{name} ({})", self.unit))),
                    json!({ "range": range }),
                ),
                1.0,
            ));
            data.push(json!({
                "type": "scatter",
                "mode": "markers",
                "name": "drawn by the data, ± one standard deviation",
                "legendgroup": "drawn",
                "showlegend": i == 0,
                "yaxis": axis_name('y', i),
                "marker": sign(Marker::Disc, 5.0, style::BLUE),
                "x": numbers(lines.iter().map(|&k| self.frequency_hz[k])),
                "y": numbers(lines.iter().map(|&k| part(self.stiffness[k]))),
                "error_y": {
                    "type": "data",
                    "array": numbers(lines.iter().map(|&k| self.std_of_part(k))),
                    "thickness": 1,
                    "width": 0,
                    "color": "#c6d8e8",
                },
                "hovertemplate": "%{x:.2f} Hz: %{y:.3g}",
            }));
            if !self.form.is_empty() {
                data.push(json!({
                    "type": "scatter",
                    "mode": "lines",
                    "name": text(&self.form_label),
                    "legendgroup": "form",
                    "showlegend": i == 0,
                    "yaxis": axis_name('y', i),
                    "line": line(Stroke::solid(style::ORANGE, 2.4)),
                    "x": numbers(self.frequency_hz.iter().copied()),
                    "y": numbers(self.form.iter().map(|z| part(*z))),
                    "hovertemplate": "%{x:.2f} Hz: %{y:.3g}",
                }));
            }
        }
        Plot {
            title: self.title.clone(),
            height_px: 560.0,
            data,
            layout: stacked(axis("Frequency (Hz)"), panels),
            ..Plot::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;

    #[test]
    fn both_parts_are_there_with_half_of_the_variance_each_and_lines_that_say_nothing_are_left_out() {
        let figure = DrawnCurveFigure {
            unit: "N/m".into(),
            frequency_hz: vec![10.0, 20.0, 30.0],
            stiffness: vec![
                Complex64::new(1e6, 2e3),
                Complex64::new(f64::NAN, 0.0),
                Complex64::new(3e6, 4e3),
            ],
            std: vec![2f64.sqrt(), 1.0, 2f64.sqrt()],
            form: vec![Complex64::new(5e6, 1.0); 3],
            form_label: "fitted: spring".into(),
            ..DrawnCurveFigure::default()
        };
        let plot = figure.plot().value();
        let traces = plot["data"].as_array().unwrap();
        assert_eq!(traces.len(), 4);
        assert_eq!(traces[0]["x"], json!([10, 30]));
        assert_eq!(traces[0]["y"], json!([1_000_000, 3_000_000]));
        assert_eq!(traces[2]["y"], json!([2000, 4000]));
        assert_eq!(
            (&traces[2]["yaxis"], &traces[0]["error_y"]["array"]),
            (&json!("y2"), &json!([1, 1]))
        );
        assert_eq!(traces[1]["y"], json!([5_000_000, 5_000_000, 5_000_000]));
        let top = plot["layout"]["yaxis"]["range"][1].as_f64().unwrap();
        assert_eq!(top, 5.75e6);
    }
}
