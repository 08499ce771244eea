//! A dynamic stiffness that the data drew: real and imaginary part over frequency, with the form fitted to it.

use num_complex::Complex64;

use crate::Result;
use crate::discrepancy::localise::LocalisedPlace;
use crate::effects::drawn;
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

/// Share of the lines, the surest, that must be seen.
const SURE: f64 = 0.2;
const PALE: Color = Color(198, 216, 232);

/// Name of a part of a complex stiffness, and how to take it.
type StiffnessPart = (&'static str, fn(Complex64) -> f64);

/// What is drawn, topmost first.
pub(crate) const PARTS: [StiffnessPart; 2] = [("real part", |z| z.re), ("imaginary part", |z| z.im)];

impl DrawnCurveFigure {
    /// What the data draw at `place`, with its best form where it has one.
    pub fn of(place: &LocalisedPlace) -> Self {
        let best = place.best.as_ref();
        let values: Vec<f64> = best
            .iter()
            .flat_map(|b| b.first.parameters.iter().map(|p| p.value))
            .collect();
        let frequency_hz: Vec<f64> = place.curve.iter().map(|c| c.frequency_hz).collect();
        DrawnCurveFigure {
            title: format!("Dynamic stiffness that the data draw {}", place.spot.words()),
            unit: place.stiffness_unit().to_string(),
            stiffness: place.curve.iter().map(|c| c.stiffness).collect(),
            std: place.curve.iter().map(|c| c.std).collect(),
            form: best.map_or_else(Vec::new, |b| {
                let of = |f: &f64| drawn::dynamic_stiffness(place.spot, b.first.form(), &values, *f);
                frequency_hz.iter().map(of).collect()
            }),
            form_label: best.map_or(String::new(), |b| {
                format!("fitted: {}", b.first.form().label().replace('-', " "))
            }),
            frequency_hz,
        }
    }

    /// Indices of the lines that say something.
    pub(crate) fn lines(&self) -> Vec<usize> {
        let known = |k: &usize| self.stiffness[*k].is_finite() && self.std[*k].is_finite();
        (0..self.frequency_hz.len()).filter(known).collect()
    }

    /// Standard deviation of one part at a line: half of the complex variance is in each.
    pub(crate) fn std_of_part(&self, line: usize) -> f64 {
        self.std[line] / std::f64::consts::SQRT_2
    }

    /// Least and largest value of a part that must be seen. Lines that say little must not press the others flat: those that
    /// say most, and the form, set the scale.
    pub(crate) fn range(&self, part: fn(Complex64) -> f64) -> (f64, f64) {
        let lines = self.lines();
        let stds = lines.iter().map(|k| self.std[*k]).filter(|s| usable(*s));
        let most = quantile(stds, SURE).unwrap_or(f64::INFINITY);
        let sure = lines.iter().filter(|k| self.std[**k] <= most);
        let values = sure
            .map(|k| part(self.stiffness[*k]))
            .chain(self.form.iter().map(|z| part(*z)))
            .chain([0.0]);
        extent(values).unwrap_or((-1.0, 1.0))
    }

    /// # Errors
    /// No line with a finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let lines = self.lines();
        let Some(frequencies) = extent(self.frequency_hz.iter().copied()).filter(|_| !lines.is_empty())
        else {
            return Err(nothing_to_draw(&self.title, "no line with a finite value"));
        };
        let axis =
            |(name, part)| FigureAxis::padded(&format!("{name} ({})", self.unit), self.range(part), 0.15, 6);
        let axes: Vec<FigureAxis> = PARTS.into_iter().map(axis).collect();
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
            for (panel, (_, part)) in panels.iter().zip(PARTS) {
                panel.grid(canvas);
                for &k in &lines {
                    let half = self.std_of_part(k);
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A faint spring that a fifth of the lines know to a tenth of it and the others to a thousand times of it.
    #[test]
    fn lines_that_say_little_do_not_press_the_law_flat() {
        let sure = |k: usize| k < 20;
        let figure = DrawnCurveFigure {
            frequency_hz: (1..=100).map(|k| k as f64).collect(),
            stiffness: (0..100)
                .map(|k| {
                    let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                    let off = if sure(k) { 1e3 } else { 1e7 };
                    Complex64::new(1e4 + sign * off, sign * off)
                })
                .collect(),
            std: (0..100).map(|k| if sure(k) { 1e3 } else { 1e7 }).collect(),
            form: vec![Complex64::new(1e4, 0.0); 100],
            ..DrawnCurveFigure::default()
        };
        assert_eq!(figure.range(|z| z.re), (0.0, 1.1e4));
        assert_eq!(figure.range(|z| z.im), (-1e3, 1e3));
    }
}
