//! Stability lobes with their bands, and cuts whose outcome was noted.

use serde_json::{Value, json};

use super::plot::{Plot, axis, axis_name, css, css_with, line, number, numbers, sign, stacked, text, with};
use crate::report::figure::machining::lobes::{BAND, BEFORE, UNSTABLE, sign as look};
use crate::report::figure::sheet::style;
use crate::report::figure::{LobeOutcome, LobePanel, LobeTrace, LobesFigure};

impl LobesFigure {
    pub fn plot(&self) -> Plot {
        let mut traces = Traces::default();
        let several = self.panels.len() > 1;
        let mut axes = Vec::new();
        // One scale for all: which posture bears more must be seen.
        let cap = self.depth_cap_mm.unwrap_or_else(|| self.cap());
        for (i, panel) in self.panels.iter().enumerate() {
            if let [curve] = &panel.curves[..] {
                traces.unstable(curve, 1.06 * cap, i);
            }
            for (k, curve) in panel.curves.iter().enumerate() {
                traces.curve(curve, k, i);
            }
            traces.limit(panel, i);
            for outcome in [
                LobeOutcome::Stable,
                LobeOutcome::Chatter,
                LobeOutcome::Recommended,
                LobeOutcome::Tip,
            ] {
                traces.signs(panel, outcome, i);
            }
            let title = match several {
                true => format!("{}<br>Depth limit (mm)", text(&panel.name)),
                false => "Depth limit (mm)".to_string(),
            };
            let range = json!({ "range": [0, number(1.06 * cap)] });
            axes.push((with(axis(&title), range), 1.0));
        }
        let height = if several {
            260.0 * self.panels.len() as f64
        } else {
            470.0
        };
        let speeds = match self.speeds() {
            Some((from, to)) if to > from => json!({ "range": [number(from), number(to)] }),
            _ => json!({}),
        };
        Plot {
            title: self.title.clone(),
            height_px: height + 120.0,
            data: traces.0,
            layout: stacked(with(axis("Spindle speed (rpm)"), speeds), axes),
            ..Plot::default()
        }
    }
}

#[derive(Default)]
struct Traces(Vec<Value>);

impl Traces {
    /// Adds a trace of panel `i`; of each name the first has the entry in the legend.
    fn add(&mut self, name: &str, i: usize, trace: Value) {
        let known = self.0.iter().any(|t| t["name"] == name);
        let common = json!({
            "type": "scatter",
            "name": name,
            "legendgroup": name,
            "showlegend": !known,
            "yaxis": axis_name('y', i),
        });
        self.0.push(with(common, trace));
    }

    /// The side above the limit.
    fn unstable(&mut self, curve: &LobeTrace, top: f64, i: usize) {
        let rpm = numbers(curve.spindle_rpm.iter().copied());
        let edge = json!({ "width": 0 });
        let limit = curve.depth_limit_mm.iter().map(|d| d.unwrap_or(top).min(top));
        let below = json!({ "mode": "lines", "line": edge, "x": rpm, "y": numbers(limit), "hoverinfo": "skip",
                            "showlegend": false, "name": "limit", "legendgroup": "unstable" });
        self.add("limit", i, below);
        let above = json!({ "mode": "lines", "line": edge, "x": rpm, "y": numbers(vec![top; curve.spindle_rpm.len()]),
                            "hoverinfo": "skip", "fill": "tonexty", "fillcolor": css_with(UNSTABLE, 0.9) });
        self.add("unstable", i, above);
    }

    fn curve(&mut self, curve: &LobeTrace, k: usize, i: usize) {
        let rpm = numbers(curve.spindle_rpm.iter().copied());
        let depths = |values: &[Option<f64>]| numbers(values.iter().map(|d| d.unwrap_or(f64::NAN)));
        let hover = "%{x:.0f} rpm: %{y:.3g} mm";
        if let Some([lower, upper]) = &curve.band_mm {
            // Where there is no upper limit, the band runs out at the top.
            let deepest = upper.iter().chain(lower).flatten().copied().fold(0.0, f64::max);
            let filled = |values: &[Option<f64>]| numbers(values.iter().map(|d| d.unwrap_or(10.0 * deepest)));
            let edge = json!({ "width": 0 });
            let name = "5 to 95 % by the model's uncertainty";
            let group = format!("{name} {i} {k}");
            let below = json!({ "mode": "lines", "line": edge, "x": rpm, "y": filled(lower), "hoverinfo": "skip",
                                "showlegend": false, "name": "lower", "legendgroup": group });
            self.add("lower", i, below);
            let above = json!({ "mode": "lines", "line": edge, "x": rpm, "y": filled(upper), "hoverinfo": "skip",
                                "fill": "tonexty", "fillcolor": css_with(BAND, 0.75) });
            self.add(name, i, above);
        }
        if !curve.before_mm.is_empty() {
            let before = json!({ "mode": "lines", "line": line(BEFORE), "x": rpm, "y": depths(&curve.before_mm),
                                 "hovertemplate": hover });
            self.add("before the effects were added", i, before);
        }
        let name = if curve.label.trim().is_empty() {
            "depth limit"
        } else {
            &curve.label
        };
        let limit = json!({ "mode": "lines", "line": line(style::series(k)), "x": rpm, "y": depths(&curve.depth_limit_mm),
                            "hovertemplate": hover });
        self.add(&text(name), i, limit);
    }

    fn limit(&mut self, panel: &LobePanel, i: usize) {
        let speeds = || {
            panel
                .curves
                .iter()
                .flat_map(|c| c.spindle_rpm.iter().copied())
                .filter(|n| n.is_finite())
        };
        let ends = [speeds().reduce(f64::min), speeds().reduce(f64::max)];
        if let (Some(limit), [Some(from), Some(to)]) = (panel.absolute_limit_mm, ends) {
            let trace = json!({ "mode": "lines", "line": line(style::LEVEL), "x": numbers([from, to]),
                                "y": numbers([limit, limit]), "hovertemplate": "absolute limit %{y:.3g} mm" });
            self.add("absolute limit", i, trace);
        }
    }

    fn signs(&mut self, panel: &LobePanel, outcome: LobeOutcome, i: usize) {
        let of: Vec<_> = panel.markers.iter().filter(|m| m.outcome == outcome).collect();
        if of.is_empty() {
            return;
        }
        let name = match outcome {
            LobeOutcome::Stable => "stable cut",
            LobeOutcome::Chatter => "cut with chatter",
            LobeOutcome::Recommended => "recommended",
            LobeOutcome::Tip => "deepest tips",
        };
        let (marker, size, color) = look(outcome);
        let mut marker = sign(marker, size, color);
        if outcome == LobeOutcome::Tip {
            // Open: what was cut is filled.
            marker = json!({ "symbol": "diamond-open", "size": size, "color": css(color), "line": { "width": 2 } });
        }
        let trace = json!({
            "mode": "markers+text",
            "marker": marker,
            "x": numbers(of.iter().map(|m| m.spindle_rpm)),
            "y": numbers(of.iter().map(|m| m.depth_mm)),
            "text": of.iter().map(|m| text(&m.label)).collect::<Vec<_>>(),
            "textposition": "middle right",
            "cliponaxis": false,
            "hovertemplate": format!("{name}: %{{x:.0f}} rpm, %{{y:.3g}} mm<extra></extra>"),
        });
        self.add(name, i, trace);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::LobeMarker;

    #[test]
    fn bands_have_an_end_and_each_name_stands_once_in_the_legend() {
        let panel = |name: &str| LobePanel {
            name: name.into(),
            curves: vec![LobeTrace {
                spindle_rpm: vec![100.0, 200.0],
                depth_limit_mm: vec![Some(1.0), None],
                band_mm: Some([vec![Some(0.8), Some(2.0)], vec![Some(1.2), None]]),
                ..LobeTrace::default()
            }],
            markers: vec![LobeMarker {
                spindle_rpm: 150.0,
                depth_mm: 0.5,
                outcome: LobeOutcome::Chatter,
                label: "cut <7>".into(),
            }],
            absolute_limit_mm: Some(0.4),
        };
        let figure = LobesFigure {
            panels: vec![panel("p1"), panel("p2")],
            ..LobesFigure::default()
        };
        let plot = figure.plot().value();
        let traces = plot["data"].as_array().unwrap();
        let entries: Vec<&Value> = traces
            .iter()
            .filter(|t| t["showlegend"] == true)
            .map(|t| &t["name"])
            .collect();
        let names = [
            "unstable",
            "5 to 95 % by the model's uncertainty",
            "depth limit",
            "absolute limit",
            "cut with chatter",
        ];
        assert_eq!(entries, names);
        let unstable: Vec<&Value> = traces.iter().filter(|t| t["name"] == "limit").collect();
        assert_eq!(
            unstable[0]["y"][1], unstable[1]["y"][1],
            "one scale: where there is no limit, the frame's end"
        );
        let band: Vec<&Value> = traces
            .iter()
            .filter(|t| t["fill"] == "tonexty" && t["name"] != "unstable")
            .collect();
        assert_eq!(
            (band.len(), &band[0]["y"]),
            (2, &json!([1.2, 20])),
            "no upper limit: beyond the frame"
        );
        let crosses = traces.iter().find(|t| t["name"] == "cut with chatter").unwrap();
        assert_eq!(
            (&crosses["text"][0], &crosses["yaxis"]),
            (&json!("cut &lt;7&gt;"), &json!("y"))
        );
        assert_eq!(crosses["marker"]["symbol"], "x-thin");
    }
}
