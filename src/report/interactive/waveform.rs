//! Forces over a revolution or a hole.

use serde_json::json;

use super::frf::Look;
use super::plot::{Plot, axis, axis_name, line, numbers, sign, stacked, text, with};
use crate::report::figure::canvas::Marker;
use crate::report::figure::{WaveformFigure, style};

impl WaveformFigure {
    pub fn plot(&self) -> Plot {
        let mut data = Vec::new();
        let count = self.models.len();
        for (i, panel) in self.panels.iter().enumerate() {
            let measured = ("measured", &panel.measured, Look::Measured);
            let models = panel.models.iter().enumerate().map(|(m, values)| {
                let name = self.models.get(m).map_or("model", String::as_str);
                (name, values, Look::Curve(style::model(m, count)))
            });
            for (name, values, look) in std::iter::once(measured).chain(models) {
                let mut trace = json!({
                    "type": "scatter",
                    "name": text(name),
                    "legendgroup": text(name),
                    "showlegend": i == 0,
                    "yaxis": axis_name('y', i),
                    "x": numbers(panel.x.iter().copied()),
                    "y": numbers(values.iter().copied()),
                });
                match look {
                    Look::Measured => {
                        trace["mode"] = json!("markers");
                        trace["marker"] = sign(Marker::Disc, 4.0, style::MEASURED);
                    }
                    Look::Curve(stroke) => {
                        trace["mode"] = json!("lines");
                        trace["line"] = line(stroke);
                    }
                }
                data.push(trace);
            }
        }
        let panels = self.panels.iter().map(|p| (axis(&text(&p.label)), 1.0)).collect();
        Plot {
            title: self.title.clone(),
            height_px: 110.0 + 180.0 * self.panels.len() as f64,
            data,
            layout: with(
                stacked(axis(&text(&self.x_label)), panels),
                json!({ "hovermode": "x" }),
            ),
            ..Plot::default()
        }
    }
}
