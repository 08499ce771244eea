//! Errors of a hole over the redundancy angle, each above its tolerance or below it.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

/// One kind of error at every angle.
#[derive(Debug, Clone, Default)]
pub struct HolePanel {
    /// With unit, such as `Tilt (°)`.
    pub label: String,
    pub value: Vec<f64>,
    /// The bound that is held against the tolerance.
    pub bound: Vec<f64>,
    pub tolerance: f64,
}

#[derive(Debug, Clone, Default)]
pub struct HoleFigure {
    pub title: String,
    pub angle_deg: Vec<f64>,
    /// Where it is recommended to drill; drawn as an upright line.
    pub recommended_deg: Option<f64>,
    pub panels: Vec<HolePanel>,
}

const PANEL_HEIGHT: f64 = 215.0;
const GAP: f64 = 20.0;
const SIGN: f64 = 4.5;
const BAR: Stroke = Stroke::solid(style::BLUE, 1.4);
const RECOMMENDED: Stroke = Stroke::dashed(style::ORANGE, 2.2, &[10.0, 4.0]);
const OUT: (Marker, f64) = (Marker::Cross, 5.5);

impl HoleFigure {
    /// # Errors
    /// No finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let values = self.panels.iter().flat_map(|p| &p.value);
        if self.angle_deg.is_empty() || !values.clone().any(|v| usable(*v)) {
            return Err(nothing_to_draw(&self.title, "no angle can be used"));
        }
        let x = FigureAxis::linear("Redundancy angle (°)", (0.0, 360.0), 9);
        let scales: Vec<FigureAxis> = self
            .panels
            .iter()
            .map(|p| {
                let all = p.value.iter().chain(&p.bound).copied().chain([p.tolerance]);
                let range = extent(all.filter(|v| usable(*v))).unwrap_or((0.0, 1.0));
                FigureAxis::from_zero(&p.label, range, 5)
            })
            .collect();
        let left = Panel::left_margin(&scales.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let mut legend = vec![
            (
                Swatch::LineAndSign(BAR, Marker::Disc, SIGN),
                "in tolerance, bar to its 95 % bound".to_string(),
            ),
            (
                Swatch::Sign(OUT.0, OUT.1, style::RED),
                "bound out of tolerance".to_string(),
            ),
            (Swatch::Line(style::LEVEL), "tolerance".to_string()),
        ];
        if self.recommended_deg.is_some() {
            legend.push((Swatch::Line(RECOMMENDED), "recommended".to_string()));
        }
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let panels = Panel::stack(&x, scales, [left, right], header.bottom(), PANEL_HEIGHT, GAP);
        let bottom = panels.last().map_or(header.bottom(), |p| p.bottom);
        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for (panel, data) in panels.iter().zip(&self.panels) {
                panel.grid(canvas);
                let ends = [(panel.x.low, data.tolerance), (panel.x.high, data.tolerance)];
                panel.curve(canvas, ends, style::LEVEL);
                if let Some(angle) = self.recommended_deg {
                    let ends = [(angle, panel.y.low), (angle, panel.y.high)];
                    panel.curve(canvas, ends, RECOMMENDED);
                }
                for ((angle, value), bound) in self.angle_deg.iter().zip(&data.value).zip(&data.bound) {
                    let is_out = *bound > data.tolerance;
                    let color = if is_out { style::RED } else { style::BLUE };
                    panel.error_bar(canvas, *angle, (*value, *bound), color);
                    let sign = if is_out { OUT } else { (Marker::Disc, SIGN) };
                    panel.markers(canvas, [(*angle, *value)], sign, color, 0.0);
                }
                panel.frame(canvas);
            }
        })
    }
}
