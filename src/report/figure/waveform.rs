//! Forces over a revolution or a hole: one panel an axis, one scale of time for all.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Marker, WIDTH, nothing_to_draw, paint};
use super::frf::or;
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

/// One axis: measured and modelled values over the same abscissa.
#[derive(Debug, Clone, Default)]
pub struct WaveformPanel {
    /// With unit, such as `Fx (N)`.
    pub label: String,
    pub x: Vec<f64>,
    pub measured: Vec<f64>,
    /// In the order of [`WaveformFigure::models`].
    pub models: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, Default)]
pub struct WaveformFigure {
    pub title: String,
    /// With unit, such as `Rotation (°)`.
    pub x_label: String,
    /// Names of the models; the last one counts.
    pub models: Vec<String>,
    pub panels: Vec<WaveformPanel>,
}

const PANEL_HEIGHT: f64 = 190.0;
const GAP: f64 = 18.0;
const MEASURED: (Marker, f64) = (Marker::Disc, 3.5);

impl WaveformFigure {
    /// # Errors
    /// No finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let xs = extent(
            self.panels
                .iter()
                .flat_map(|p| p.x.iter().copied())
                .filter(|x| usable(*x)),
        );
        let Some(xs) = xs else {
            return Err(nothing_to_draw(
                &self.title,
                "there is no cut with usable channels",
            ));
        };
        let x = FigureAxis::linear(&self.x_label, xs, 9);
        let scales: Vec<FigureAxis> = self
            .panels
            .iter()
            .map(|panel| {
                let all = panel.measured.iter().chain(panel.models.iter().flatten());
                let range = extent(all.copied().filter(|v| usable(*v))).unwrap_or((0.0, 1.0));
                FigureAxis::padded(&panel.label, range, 0.08, 4)
            })
            .collect();
        let left = Panel::left_margin(&scales.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let count = self.models.len();
        let legend = std::iter::once((
            Swatch::Sign(MEASURED.0, MEASURED.1, style::MEASURED),
            "measured".to_string(),
        ))
        .chain(self.models.iter().enumerate().map(|(i, name)| {
            let stroke = style::model(i, count);
            (Swatch::Line(stroke), or(name, "model").to_owned())
        }));
        let header = FigureHeader::new(&self.title, &legend.collect::<Vec<_>>(), left, right);
        let panels = Panel::stack(&x, scales, [left, right], header.bottom(), PANEL_HEIGHT, GAP);
        let bottom = panels.last().map_or(header.bottom(), |p| p.bottom);
        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for (panel, data) in panels.iter().zip(&self.panels) {
                panel.grid(canvas);
                let points = |values: &[f64]| -> Vec<(f64, f64)> {
                    data.x.iter().copied().zip(values.iter().copied()).collect()
                };
                panel.markers(
                    canvas,
                    points(&data.measured),
                    MEASURED,
                    style::MEASURED,
                    MEASURED.1,
                );
                for (i, model) in data.models.iter().enumerate() {
                    panel.curve(canvas, points(model), style::model(i, count));
                }
                panel.frame(canvas);
            }
        })
    }
}
