//! A dynamometer record: smallest and largest values, drift, air and the window that was averaged.

use serde_json::{Value, json};

use super::plot::{Plot, axis, axis_name, css, css_with, line, number, numbers, stacked, text, with};
use crate::report::figure::canvas::Color;
use crate::report::figure::force_record::{AIR, DRIFT, ENVELOPE, LEVEL, STEADY};
use crate::report::figure::{ForceRecord, ForceTrace};

/// Pairs of smallest and largest value in the page, one channel.
const MOST_PAIRS: usize = 1000;

impl ForceRecord {
    pub fn plot(&self) -> Plot {
        let mut data = Vec::new();
        for (i, channel) in self.channels.iter().enumerate() {
            let mut add = |name: &str, line: Value, points: Vec<(f64, f64)>| {
                data.push(json!({
                    "type": "scatter",
                    "mode": "lines",
                    "name": name,
                    "legendgroup": name,
                    "showlegend": i == 0,
                    "yaxis": axis_name('y', i),
                    "line": line,
                    "x": numbers(points.iter().map(|p| p.0)),
                    "y": numbers(points.iter().map(|p| p.1)),
                    "hovertemplate": format!("%{{x:.3f}} s: %{{y:.4g}} {}", text(&channel.unit)),
                }));
            };
            let thin = json!({ "color": css(ENVELOPE), "width": 1 });
            add("recorded (smallest and largest)", thin, extremes(channel));
            if !channel.drift.is_empty() {
                add("drift taken off", line(DRIFT), channel.drift.clone());
            }
            if let (Some(level), Some((from, to))) = (channel.steady_level, self.steady_s) {
                add(
                    "average in the window",
                    line(LEVEL),
                    vec![(from, level), (to, level)],
                );
            }
        }
        let axis_of = |c: &ForceTrace| (axis(&format!("{} ({})", text(&c.label), text(&c.unit))), 1.0);
        let mut layout = stacked(axis("Time (s)"), self.channels.iter().map(axis_of).collect());
        let air = self.air_s.iter().map(|s| (*s, AIR));
        let steady = self.steady_s.iter().map(|s| (*s, STEADY));
        layout["shapes"] = air
            .clone()
            .chain(steady.clone())
            .map(|(span, look)| stretch(span, look))
            .collect();
        let names = air
            .map(|(span, _)| (span, "air cut"))
            .chain(steady.map(|(span, _)| (span, "steady window")));
        layout["annotations"] = names
            .map(|((from, to), name)| heading(0.5 * (from + to), name))
            .collect();
        layout["legend"]["y"] = json!(1.06);
        Plot {
            title: self.title.clone(),
            height_px: 120.0 + 170.0 * self.channels.len() as f64,
            data,
            layout: with(layout, json!({ "hovermode": "x" })),
            ..Plot::default()
        }
    }
}

/// Over all panels, below the curves.
fn stretch((from, to): (f64, f64), (color, opacity): (Color, f64)) -> Value {
    json!({
        "type": "rect",
        "layer": "below",
        "xref": "x",
        "yref": "paper",
        "x0": number(from),
        "x1": number(to),
        "y0": 0,
        "y1": 1,
        "line": { "width": 0 },
        "fillcolor": css_with(color, opacity),
    })
}

fn heading(x: f64, name: &str) -> Value {
    json!({
        "x": number(x),
        "xref": "x",
        "y": 1,
        "yref": "paper",
        "yanchor": "bottom",
        "text": name,
        "showarrow": false,
        "font": { "size": 12 },
    })
}

/// Time and value of the smallest and the largest sample of each of up to [`MOST_PAIRS`] stretches, in their order.
fn extremes(channel: &ForceTrace) -> Vec<(f64, f64)> {
    let time = |i: usize| channel.start_s + channel.sample_interval_s * i as f64;
    let stretch = channel.samples.len().div_ceil(2 * MOST_PAIRS).max(1) * 2;
    let mut points = Vec::new();
    for (k, samples) in channel.samples.chunks(stretch).enumerate() {
        let finite = || samples.iter().enumerate().filter(|(_, v)| v.is_finite());
        let least = finite().min_by(|a, b| a.1.total_cmp(b.1));
        let largest = finite().max_by(|a, b| a.1.total_cmp(b.1));
        if let (Some(least), Some(largest)) = (least, largest) {
            let (first, second) = if least.0 <= largest.0 {
                (least, largest)
            } else {
                (largest, least)
            };
            points.push((time(k * stretch + first.0), *first.1));
            if first.0 != second.0 {
                points.push((time(k * stretch + second.0), *second.1));
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_records_keep_their_extremes() {
        let mut samples: Vec<f64> = (0..100_000).map(|i| (f64::from(i) * 0.01).sin()).collect();
        samples[54_321] = 9.0;
        samples[54_322] = -9.0;
        let channel = ForceTrace {
            samples,
            sample_interval_s: 1e-3,
            start_s: 1.0,
            ..ForceTrace::default()
        };
        let points = extremes(&channel);
        assert!(points.len() <= 2 * MOST_PAIRS, "{}", points.len());
        assert!(points.windows(2).all(|p| p[0].0 < p[1].0));
        let at = |value: f64| points.iter().find(|p| p.1 == value).unwrap().0;
        assert!((at(9.0) - 55.321).abs() < 1e-9 && (at(-9.0) - 55.322).abs() < 1e-9);
        // Few samples are all there.
        let few = ForceTrace {
            samples: vec![3.0, f64::NAN, 1.0, 2.0],
            sample_interval_s: 1.0,
            ..ForceTrace::default()
        };
        assert_eq!(extremes(&few), [(0.0, 3.0), (2.0, 1.0), (3.0, 2.0)]);
    }
}
