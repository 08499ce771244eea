//! FRFs in the complex plane, both axes to the same scale.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{nothing_to_draw, paint};
use super::frf::{FrfCurve, MEASURED, or};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

#[derive(Debug, Clone, Default)]
pub struct NyquistFigure {
    pub title: String,
    /// Unit of the values, such as `m/N`.
    pub unit: String,
    pub measured: Option<FrfCurve>,
    /// As in [`super::FrfFigure`]: the last one counts.
    pub models: Vec<FrfCurve>,
}

const SIDE: f64 = 1000.0;

impl NyquistFigure {
    /// # Errors
    /// No finite value in any curve.
    pub fn png(&self) -> Result<Vec<u8>> {
        let values = || {
            self.measured
                .iter()
                .chain(&self.models)
                .flat_map(|c| c.points())
                .map(|(_, v)| v)
        };
        let finite = || values().filter(|v| usable(v.re) && usable(v.im));
        let ranges = (extent(finite().map(|v| v.re)), extent(finite().map(|v| v.im)));
        let (Some(re), Some(im)) = ranges else {
            return Err(nothing_to_draw(&self.title, "no curve has a finite value"));
        };
        // A flat plot keeps the true angles: the same span per pixel along both axes.
        let unit = or(&self.unit, "–");
        let (wide, high) = (SIDE - 130.0, 640.0);
        let span = ((re.1 - re.0) / wide).max((im.1 - im.0) / high) * 1.1;
        let least = (re.0.abs().max(re.1.abs()).max(im.0.abs()).max(im.1.abs()) * 2e-3).max(1e-190);
        let span = span.max(least / high);
        let around = |(low, high): (f64, f64), length: f64| {
            let middle = 0.5 * low + 0.5 * high;
            (middle - 0.5 * span * length, middle + 0.5 * span * length)
        };
        let x = FigureAxis::linear(&format!("Real part ({unit})"), around(re, wide), 8);
        let y = FigureAxis::linear(&format!("Imaginary part ({unit})"), around(im, high), 6);

        let left = SIDE - Panel::RIGHT_MARGIN - wide;
        let mut legend = vec![];
        if let Some(measured) = &self.measured {
            let sign = Swatch::Sign(MEASURED.0, MEASURED.1, style::MEASURED);
            legend.push((sign, or(&measured.label, "measured").to_owned()));
        }
        for (i, model) in self.models.iter().enumerate() {
            let stroke = style::model(i, self.models.len());
            legend.push((Swatch::Line(stroke), or(&model.label, "model").to_owned()));
        }
        let header = FigureHeader::new(&self.title, &legend, left, left + wide);
        let top = header.bottom();
        let panel = Panel {
            left,
            top,
            right: left + wide,
            bottom: top + high,
            x,
            y,
            x_labels: true,
        };
        paint(
            SIDE as u32,
            (panel.bottom + Panel::BOTTOM_MARGIN) as u32,
            |canvas| {
                header.draw(canvas);
                panel.grid(canvas);
                panel.curve(canvas, [(panel.x.low, 0.0), (panel.x.high, 0.0)], style::FRAME);
                panel.curve(canvas, [(0.0, panel.y.low), (0.0, panel.y.high)], style::FRAME);
                if let Some(measured) = &self.measured {
                    let points = measured.points().map(|(_, v)| (v.re, v.im));
                    panel.markers(canvas, points, MEASURED, style::MEASURED, MEASURED.1);
                }
                for (i, model) in self.models.iter().enumerate() {
                    let points = model.points().map(|(_, v)| (v.re, v.im));
                    panel.curve(canvas, points, style::model(i, self.models.len()));
                }
                panel.frame(canvas);
            },
        )
    }
}
