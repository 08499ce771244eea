//! The robot as a stick figure that can be turned, at each posture.

use serde_json::{Value, json};

use super::plot::{Plot, css, layout, number, numbers, text};
use crate::report::figure::RobotFigure;
use crate::report::figure::sheet::style;

impl RobotFigure {
    pub fn plot(&self) -> Plot {
        let all = || self.postures.iter().flat_map(|(_, chain)| chain).flatten();
        let reach = all().fold(0.1, |most: f64, v| most.max(v.abs())) * 1.05;
        let data = self.postures.iter().enumerate().map(|(i, (name, chain))| {
            let stroke = style::series(i);
            let last = chain.len().saturating_sub(1);
            let names = (0..chain.len()).map(|k| match k {
                0 => "base".to_string(),
                k if k == last => "tool centre point".to_string(),
                k if k + 1 == last => "flange".to_string(),
                k => format!("joint {k}"),
            });
            let coordinate = |k: usize| numbers(chain.iter().map(|p| p[k]));
            json!({
                "type": "scatter3d",
                "mode": "lines+markers",
                "name": text(name),
                "x": coordinate(0),
                "y": coordinate(1),
                "z": coordinate(2),
                "text": names.collect::<Vec<_>>(),
                "line": { "color": css(stroke.color), "width": 9 },
                "marker": { "color": css(style::INK), "size": 4 },
                "hovertemplate": "%{text}: %{x:.3f}, %{y:.3f}, %{z:.3f} m",
            })
        });
        let data: Vec<Value> = data.collect();
        let axis = |title: &str, low: f64| {
            json!({ "title": { "text": title }, "range": [low, reach], "backgroundcolor": "#fff", "gridcolor": "#dee1e5",
                    "zerolinecolor": "#9aa0a8" })
        };
        let floor = all_z(&self.postures).fold(0.0, f64::min);
        let mut layout = layout();
        layout["scene"] = json!({
            "xaxis": axis("x (m)", -reach),
            "yaxis": axis("y (m)", -reach),
            "zaxis": axis("z (m)", floor),
            "aspectmode": "data",
            "camera": self.camera(),
        });
        layout["margin"] = json!({ "l": 0, "r": 0, "t": 8, "b": 0 });
        layout["showlegend"] = json!(false);
        // Turned as the reader has turned it, whichever posture he chooses.
        layout["uirevision"] = json!("robot");
        let plot = |data: Vec<Value>| Plot {
            title: self.title.clone(),
            height_px: 560.0,
            data,
            layout: layout.clone(),
            ..Plot::default()
        };
        let one = self.postures.iter().zip(&data);
        let one = one.map(|((name, _), trace)| (name.clone(), plot(vec![trace.clone()])));
        let all = ("all".to_string(), plot(data.clone()));
        match data.len() {
            0 | 1 => plot(data),
            _ => Plot::one_of("Posture", one.chain([all]).collect()),
        }
    }
}

impl RobotFigure {
    /// From the side of the arm in the first posture, a little from the front and above.
    fn camera(&self) -> Value {
        let joints = self.postures.first().into_iter().flat_map(|(_, chain)| chain);
        let farthest = joints.max_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])));
        let ahead = farthest.map_or(0.0, |p| p[1].atan2(p[0]));
        let (y, x) = (ahead - 65f64.to_radians()).sin_cos();
        json!({
            "eye": { "x": number(2.4 * x), "y": number(2.4 * y), "z": 0.6 },
            "center": { "x": 0, "y": 0, "z": 0 },
        })
    }
}

fn all_z(postures: &[(String, Vec<[f64; 3]>)]) -> impl Iterator<Item = f64> {
    postures.iter().flat_map(|(_, chain)| chain).map(|p| p[2])
}
