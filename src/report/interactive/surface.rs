//! Depth limits over spindle speed and redundancy angle.

use serde_json::{Value, json};

use super::plot::{Plot, axis, css, layout, number, numbers, with};
use crate::report::figure::style;

/// The surface b(n, θ) as numbers.
#[derive(Debug, Clone, Default)]
pub struct Surface {
    pub title: String,
    pub spindle_rpm: Vec<f64>,
    pub angle_deg: Vec<f64>,
    /// mm, one inner vector an angle; `None` where the angle cannot be used or no limit exists.
    pub depth_mm: Vec<Vec<Option<f64>>>,
    /// End of the colour scale, mm; deeper places have its last colour.
    pub top_mm: Option<f64>,
    /// Speed and angle to cut at.
    pub recommended: Option<(f64, f64)>,
}

impl Surface {
    pub fn plot(&self) -> Plot {
        let row = |row: &Vec<Option<f64>>| row.iter().map(|d| d.map(number)).collect::<Vec<_>>();
        let scale = (0..=10).map(|k| f64::from(k) / 10.0);
        let map = json!({
            "type": "heatmap",
            "x": numbers(self.spindle_rpm.iter().copied()),
            "y": numbers(self.angle_deg.iter().copied()),
            "z": self.depth_mm.iter().map(row).collect::<Vec<_>>(),
            "zmin": 0,
            "zmax": self.top_mm.map(number),
            "colorscale": scale.map(|s| json!([s, css(style::ramp(s))])).collect::<Vec<_>>(),
            "colorbar": { "title": { "text": "Depth limit (mm)", "side": "right" }, "thickness": 16, "outlinewidth": 1 },
            "hoverongaps": false,
            "hovertemplate": "%{x:.0f} rpm, %{y:.1f}°: %{z:.3g} mm<extra></extra>",
        });
        let place = self.recommended.map(|(rpm, angle)| {
            json!({
                "type": "scatter",
                "mode": "markers",
                "cliponaxis": false,
                "name": "recommended",
                "x": [number(rpm)],
                "y": [number(angle)],
                "marker": { "symbol": "diamond", "size": 13, "color": css(style::BLUE), "line": { "color": "#fff", "width": 2 } },
                "hovertemplate": "recommended: %{x:.0f} rpm, %{y:.1f}°<extra></extra>",
            })
        });
        let mut layout = layout();
        layout["xaxis"] = with(
            axis("Spindle speed (rpm)"),
            json!({ "showgrid": false, "range": ends(&self.spindle_rpm) }),
        );
        layout["yaxis"] = with(
            axis("Redundancy angle (°)"),
            json!({ "showgrid": false, "range": ends(&self.angle_deg) }),
        );
        // What cannot be used is grey, not the colour of no depth.
        layout["plot_bgcolor"] = json!("#e4e6ea");
        Plot {
            title: self.title.clone(),
            height_px: 560.0,
            data: std::iter::once(map).chain(place).collect(),
            layout,
            ..Plot::default()
        }
    }
}

/// Of an axis of cells: half a cell beyond the first and the last.
fn ends(places: &[f64]) -> Value {
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        return Value::Null;
    };
    let half = 0.5 * (last - first) / (places.len().max(2) - 1) as f64;
    numbers([first - half, last + half])
}
