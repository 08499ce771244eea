//! Quantities over time with their control limits, one panel each.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

/// One value.
#[derive(Debug, Clone, Copy, Default)]
pub struct ControlPoint {
    pub value: f64,
    pub std_error: Option<f64>,
    /// Beyond the limits.
    pub outside: bool,
}

/// One quantity.
#[derive(Debug, Clone, Default)]
pub struct ControlPanel {
    /// With its unit.
    pub label: String,
    /// By the figure's `names`; `None` where that campaign does not have it.
    pub points: Vec<Option<ControlPoint>>,
    /// Centre, lower, upper.
    pub limits: Option<[f64; 3]>,
}

#[derive(Debug, Clone, Default)]
pub struct ControlChartFigure {
    pub title: String,
    /// Of the campaigns, oldest first: dates.
    pub names: Vec<String>,
    pub panels: Vec<ControlPanel>,
}

/// Panels that fit on a figure.
pub const MOST_PANELS: usize = 8;

const LIMIT: Stroke = Stroke::dashed(style::ORANGE, 1.6, &[8.0, 4.0]);
const LINE: Stroke = Stroke::solid(style::PALE_BLUE, 1.4);
const SIGN: f64 = 8.0;
const HEIGHT: f64 = 110.0;
const GAP: f64 = 32.0;
/// Between the labels of two campaigns.
const ROOM: f64 = 92.0;

impl ControlChartFigure {
    /// # Errors
    /// No finite value, or more than [`MOST_PANELS`] panels.
    pub fn png(&self) -> Result<Vec<u8>> {
        let values = |panel: &ControlPanel| {
            let points = panel.points.iter().flatten();
            let ends = points.flat_map(|p| {
                let error = p.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
                [p.value - error, p.value + error]
            });
            let limits = panel.limits.into_iter().flatten();
            ends.chain(limits).collect::<Vec<f64>>()
        };
        let shown: Vec<(&ControlPanel, (f64, f64))> = self
            .panels
            .iter()
            .filter(|p| p.points.iter().flatten().any(|p| usable(p.value)))
            .filter_map(|p| Some((p, extent(values(p))?)))
            .collect();
        if shown.is_empty() {
            return Err(nothing_to_draw(&self.title, "no quantity has a finite value"));
        }
        if shown.len() > MOST_PANELS {
            return Err(nothing_to_draw(&self.title, "more panels than fit"));
        }
        let y: Vec<FigureAxis> = shown
            .iter()
            .map(|(_, range)| FigureAxis::padded("", *range, 0.12, 4))
            .collect();
        let left = Panel::left_margin(&y.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let every = (ROOM * self.names.len() as f64 / (right - left)).ceil().max(1.0) as usize;
        let labels: Vec<String> = self
            .names
            .iter()
            .enumerate()
            .map(
                |(i, name)| match (self.names.len() - 1 - i).is_multiple_of(every) {
                    true => style::TICK.fit(name, ROOM),
                    false => String::new(),
                },
            )
            .collect();
        let x = FigureAxis::categories("", &labels);
        let legend = [
            (
                Swatch::LineAndSign(LINE, Marker::Disc, SIGN),
                "value ± standard error".to_string(),
            ),
            (
                Swatch::Sign(Marker::Square, SIGN + 2.0, style::RED),
                "outside".to_string(),
            ),
            (Swatch::Line(style::LEVEL), "mean of the earlier ones".to_string()),
            (Swatch::Line(LIMIT), "limits".to_string()),
        ];
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let panels = Panel::stack(&x, y, [left, right], header.bottom() + 24.0, HEIGHT, GAP);
        let bottom = panels.last().map_or(0.0, |p| p.bottom);
        paint(WIDTH, (bottom + 34.0) as u32, |canvas| {
            header.draw(canvas);
            for (panel, (quantity, _)) in panels.iter().zip(&shown) {
                panel.grid(canvas);
                let level = |value: f64| [(panel.x.low, value), (panel.x.high, value)];
                if let Some([centre, lower, upper]) = quantity.limits {
                    panel.curve(canvas, level(centre), style::LEVEL);
                    panel.curve(canvas, level(lower), LIMIT);
                    panel.curve(canvas, level(upper), LIMIT);
                }
                let known = || {
                    let all = quantity.points.iter().enumerate();
                    all.filter_map(|(i, p)| Some((i as f64, (*p)?)))
                };
                panel.curve(canvas, known().map(|(i, p)| (i, p.value)), LINE);
                for (i, p) in known() {
                    if let Some(error) = p.std_error.filter(|e| usable(*e)) {
                        panel.error_bar(canvas, i, (p.value - error, p.value + error), style::BLUE);
                    }
                }
                let points = |outside: bool| {
                    known()
                        .filter(move |(_, p)| p.outside == outside)
                        .map(|(i, p)| (i, p.value))
                };
                panel.markers(canvas, points(false), (Marker::Disc, SIGN), style::BLUE, 0.0);
                panel.markers(
                    canvas,
                    points(true),
                    (Marker::Square, SIGN + 2.0),
                    style::RED,
                    0.0,
                );
                let label = style::LEGEND.fit(&quantity.label, right - left);
                canvas.text((left, panel.top - 12.0), &label, style::LEGEND);
                panel.frame(canvas);
            }
        })
    }
}
