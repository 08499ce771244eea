//! A dynamic stiffness that the data drew: real and imaginary part over frequency, with the form fitted to it.

use num_complex::Complex64;

use crate::Result;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{Color, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::statistics::quantile;

#[derive(Debug, Clone, Default)]
pub struct DrawnCurveFigure {
    pub title: String,
    /// N/m or N·m/rad.
    pub unit: String,
    pub frequency_hz: Vec<f64>,
    /// Same length; values that are not finite are left out.
    pub stiffness: Vec<Complex64>,
    /// Standard deviation of the complex value, same length.
    pub std: Vec<f64>,
    /// The form fitted, on the same lines; empty where there is none.
    pub form: Vec<Complex64>,
    pub form_label: String,
}

const PALE: Color = Color(198, 216, 232);

impl DrawnCurveFigure {
    /// # Errors
    /// No line with a finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let known = |k: &usize| self.stiffness[*k].is_finite() && self.std[*k].is_finite();
        let lines: Vec<usize> = (0..self.frequency_hz.len()).filter(known).collect();
        let Some(frequencies) = extent(self.frequency_hz.iter().copied()).filter(|_| !lines.is_empty())
        else {
            return Err(nothing_to_draw(&self.title, "no line with a finite value"));
        };
        // Lines that say little must not press the others flat: those with the smaller half of the errors set the scale.
        let middle =
            quantile(lines.iter().map(|k| self.std[*k]).filter(|s| usable(*s)), 0.5).unwrap_or(f64::INFINITY);
        let parts = ["real part", "imaginary part"];
        let part = |name: &str, z: Complex64| if name == parts[0] { z.re } else { z.im };
        let axes: Vec<FigureAxis> = parts
            .iter()
            .map(|name| {
                let part = |z| part(name, z);
                let sure = lines.iter().filter(|k| self.std[**k] <= middle);
                let values = sure
                    .map(|k| part(self.stiffness[*k]))
                    .chain(self.form.iter().map(|z| part(*z)))
                    .chain([0.0]);
                let range = extent(values).unwrap_or((-1.0, 1.0));
                FigureAxis::padded(&format!("{name} ({})", self.unit), range, 0.15, 6)
            })
            .collect();
        let x = FigureAxis::linear("Frequency (Hz)", frequencies, 10);
        let left = Panel::left_margin(&axes.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let fitted = Stroke::solid(style::ORANGE, 2.4);
        let mut legend = vec![
            (
                Swatch::Sign(Marker::Disc, 3.0, style::BLUE),
                "drawn by the data".to_string(),
            ),
            (Swatch::Area(PALE, 1.0), "± one standard deviation".to_string()),
        ];
        if !self.form.is_empty() {
            legend.push((Swatch::Line(fitted), self.form_label.clone()));
        }
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let panels = Panel::stack(&x, axes, [left, right], header.bottom(), 260.0, 24.0);
        let bottom = panels.last().map_or(0.0, |p| p.bottom) + Panel::BOTTOM_MARGIN;
        paint(WIDTH, bottom as u32, |canvas| {
            header.draw(canvas);
            for (panel, name) in panels.iter().zip(parts) {
                let part = |z| part(name, z);
                panel.grid(canvas);
                for &k in &lines {
                    // Half of the complex variance is in each part.
                    let half = self.std[k] / std::f64::consts::SQRT_2;
                    let value = part(self.stiffness[k]);
                    let x = panel.x_at(self.frequency_hz[k]);
                    let ends = (panel.y_at(value - half), panel.y_at(value + half));
                    if let (Some(x), (Some(a), Some(b))) = (x, ends) {
                        let inside = |y: f64| y.clamp(panel.top, panel.bottom);
                        canvas.line((x, inside(a)), (x, inside(b)), Stroke::solid(PALE, 2.0));
                    }
                }
                let points = lines
                    .iter()
                    .map(|&k| (self.frequency_hz[k], part(self.stiffness[k])));
                panel.markers(canvas, points, (Marker::Disc, 2.2), style::BLUE, 0.0);
                let form = self
                    .frequency_hz
                    .iter()
                    .copied()
                    .zip(self.form.iter().map(|z| part(*z)));
                panel.curve(canvas, form, fitted);
                panel.frame(canvas);
            }
        })
    }
}
