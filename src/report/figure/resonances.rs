//! Measured resonances against a model's modes before and after, row by row.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

#[derive(Debug, Clone, Default)]
pub struct ResonanceRow {
    /// Such as `1 X`.
    pub label: String,
    /// Frequency, and the lowest and highest reading behind it, Hz.
    pub measured_hz: Vec<(f64, [f64; 2])>,
    pub before_hz: Vec<f64>,
    pub after_hz: Vec<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct ResonanceFigure {
    pub title: String,
    pub before_label: String,
    pub after_label: String,
    /// From top to bottom.
    pub rows: Vec<ResonanceRow>,
    /// Shaded, Hz.
    pub bands_hz: Vec<(f64, f64)>,
}

const ROW: f64 = 54.0;
const SIGN: f64 = 9.0;
const BEFORE: Stroke = Stroke::solid(style::ORANGE, 3.0);
const AFTER: Stroke = Stroke::solid(style::BLUE, 3.0);

impl ResonanceFigure {
    /// # Errors
    /// No measured resonance, or more than 24 rows.
    pub fn png(&self) -> Result<Vec<u8>> {
        if self.rows.len() > 24 {
            return Err(nothing_to_draw(&self.title, "more than 24 rows"));
        }
        let measured = || self.rows.iter().flat_map(|r| r.measured_hz.iter().map(|m| m.0));
        let Some((_, highest)) = extent(measured().filter(|f| *f > 0.0)) else {
            return Err(nothing_to_draw(&self.title, "no measured resonance"));
        };
        let names: Vec<String> = self
            .rows
            .iter()
            .rev()
            .map(|r| style::TICK.fit(&r.label, 160.0))
            .collect();
        let x = FigureAxis::linear("Frequency (Hz)", (0.0, 1.1 * highest), 12);
        let y = FigureAxis::categories("Configuration and axis", &names);
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let legend = [
            (
                Swatch::LineAndSign(Stroke::solid(style::MEASURED, 1.6), Marker::Disc, SIGN),
                "measured".to_owned(),
            ),
            (Swatch::Line(BEFORE), self.before_label.clone()),
            (Swatch::Line(AFTER), self.after_label.clone()),
        ];
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let top = header.bottom();
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + ROW * self.rows.len() as f64,
            x,
            y,
            x_labels: true,
        };
        paint(WIDTH, (panel.bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for band in &self.bands_hz {
                panel.band(canvas, *band, style::PALE_GREEN, 0.5);
            }
            panel.grid(canvas);
            for (i, row) in self.rows.iter().rev().enumerate() {
                let Some(middle) = panel.y_at(i as f64) else {
                    continue;
                };
                // Modes before above the signs, after below.
                for (modes, from, to, stroke) in [
                    (&row.before_hz, -22.0, -7.0, BEFORE),
                    (&row.after_hz, 7.0, 22.0, AFTER),
                ] {
                    for at in modes.iter().filter(|f| usable(**f) && **f <= panel.x.high) {
                        if let Some(at) = panel.x_at(*at) {
                            canvas.line((at, middle + from), (at, middle + to), stroke);
                        }
                    }
                }
                for (_, [low, high]) in &row.measured_hz {
                    if let (Some(low), Some(high)) = (panel.x_at(*low), panel.x_at(*high)) {
                        canvas.line((low, middle), (high, middle), Stroke::solid(style::MEASURED, 1.6));
                    }
                }
                let signs = row.measured_hz.iter().map(|m| (m.0, i as f64));
                panel.markers(canvas, signs, (Marker::Disc, SIGN), style::MEASURED, 0.0);
            }
            panel.frame(canvas);
        })
    }
}
