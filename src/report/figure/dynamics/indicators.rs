//! Curves of equal rank over frequency, with the modes marked: mode indicator functions.

use crate::Result;
use crate::report::figure::sheet::axis::{FigureAxis, extent, positive_extent, usable};
use crate::report::figure::sheet::canvas::{WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::statistics::quantile;

#[derive(Debug, Clone, Default)]
pub struct IndicatorFigure {
    pub title: String,
    /// With unit.
    pub label: String,
    /// A logarithmic scale; else from 0 to 1.
    pub log: bool,
    pub frequency_hz: Vec<f64>,
    /// Name and values, one a frequency.
    pub curves: Vec<(String, Vec<f64>)>,
    /// Modes that were taken, Hz.
    pub chosen_hz: Vec<f64>,
}

impl IndicatorFigure {
    /// # Errors
    /// No finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let values = || {
            self.curves
                .iter()
                .flat_map(|c| c.1.iter().copied())
                .filter(|v| usable(*v))
        };
        let frequencies = extent(self.frequency_hz.iter().copied().filter(|f| usable(*f)));
        let (Some(frequencies), Some((low, high))) = (frequencies, positive_extent(values())) else {
            return Err(nothing_to_draw(&self.title, "no finite value"));
        };
        let x = FigureAxis::linear("Frequency (Hz)", frequencies, 10);
        let y = match self.log {
            true => {
                let low = quantile(values().filter(|v| *v > 0.0), 0.002).map_or(low, |q| low.max(q / 10.0));
                FigureAxis::log(&self.label, (low.min(high), high))
            }
            false => FigureAxis::linear(&self.label, (0.0, 1.0), 5),
        };
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let mut legend: Vec<(Swatch, String)> = self
            .curves
            .iter()
            .enumerate()
            .map(|(k, (name, _))| (Swatch::Line(style::series(k)), name.clone()))
            .collect();
        legend.push((Swatch::Line(style::LEVEL), "modes taken".into()));
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let top = header.bottom();
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 380.0,
            x,
            y,
            x_labels: true,
        };
        paint(WIDTH, (panel.bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            panel.grid(canvas);
            for f in &self.chosen_hz {
                if let Some(x) = panel.x_at(*f) {
                    canvas.line((x, panel.top), (x, panel.bottom), style::LEVEL);
                }
            }
            for (k, (_, values)) in self.curves.iter().enumerate() {
                let points = self.frequency_hz.iter().copied().zip(values.iter().copied());
                panel.curve(canvas, points.filter(|p| usable(p.1)), style::series(k));
            }
            panel.frame(canvas);
        })
    }
}
