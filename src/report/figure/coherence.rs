//! Coherence over frequency.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

/// One curve over its own lines.
#[derive(Debug, Clone, Default)]
pub struct CoherenceCurve {
    pub label: String,
    pub frequency_hz: Vec<f64>,
    /// 0..1, same length.
    pub coherence: Vec<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct CoherenceFigure {
    pub title: String,
    pub curves: Vec<CoherenceCurve>,
}

impl CoherenceFigure {
    /// # Errors
    /// No curve with a finite frequency.
    pub fn png(&self) -> Result<Vec<u8>> {
        let frequencies = self.curves.iter().flat_map(|c| c.frequency_hz.iter().copied());
        let Some(frequencies) = extent(frequencies.filter(|f| usable(*f))) else {
            return Err(nothing_to_draw(&self.title, "no coherence"));
        };
        let x = FigureAxis::linear("Frequency (Hz)", frequencies, 10);
        let y = FigureAxis::linear("Coherence (–)", (0.0, 1.02), 5);
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let named = self.curves.iter().enumerate();
        let legend: Vec<_> = named
            .map(|(k, c)| (Swatch::Line(style::series(k)), c.label.clone()))
            .collect();
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let top = header.bottom();
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 300.0,
            x,
            y,
            x_labels: true,
        };
        paint(WIDTH, (panel.bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            panel.grid(canvas);
            for (k, curve) in self.curves.iter().enumerate() {
                let points = curve
                    .frequency_hz
                    .iter()
                    .copied()
                    .zip(curve.coherence.iter().copied());
                panel.curve(canvas, points, style::series(k));
            }
            panel.frame(canvas);
        })
    }
}
