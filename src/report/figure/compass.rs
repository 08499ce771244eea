//! Components of mode shapes as arrows in the complex plane: along one line for a standing wave.

use num_complex::Complex64;

use super::canvas::{Align, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::FigureHeader;
use super::style;
use crate::Result;

#[derive(Debug, Clone, Default)]
pub struct CompassFigure {
    pub title: String,
    /// Title and components of each mode, in any scale.
    pub modes: Vec<(String, Vec<Complex64>)>,
}

const COLUMNS: usize = 4;
const HEIGHT: f64 = 300.0;
const RADIUS: f64 = 105.0;
const CIRCLE: Stroke = Stroke::solid(style::GREY, 1.0);
const ARROW: Stroke = Stroke::solid(style::BLUE, 1.6);

impl CompassFigure {
    /// # Errors
    /// No mode with a finite component.
    pub fn png(&self) -> Result<Vec<u8>> {
        let size = |shape: &[Complex64]| shape.iter().map(|z| z.norm()).fold(0.0, f64::max);
        let modes: Vec<_> = self
            .modes
            .iter()
            .filter(|m| size(&m.1) > 0.0 && size(&m.1).is_finite())
            .collect();
        if modes.is_empty() {
            return Err(nothing_to_draw(&self.title, "no mode with a shape"));
        }
        let (left, right) = (30.0, f64::from(WIDTH) - 30.0);
        let header = FigureHeader::new(&self.title, &[], left, right);
        let width = (right - left) / COLUMNS as f64;
        let rows = modes.len().div_ceil(COLUMNS);
        let height = header.bottom() + HEIGHT * rows as f64 + 10.0;
        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (k, (title, shape)) in modes.iter().enumerate() {
                let centre = (
                    left + width * ((k % COLUMNS) as f64 + 0.5),
                    header.bottom() + HEIGHT * (k / COLUMNS) as f64 + 168.0,
                );
                let text = style::AXIS.fit(title, width - 16.0);
                canvas.text(
                    (centre.0, centre.1 - 142.0),
                    &text,
                    style::AXIS.align(Align::Center),
                );
                for part in [0.5, 1.0] {
                    let ring: Vec<(f64, f64)> = (0..=72)
                        .map(|i| {
                            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 72.0).sin_cos();
                            (centre.0 + part * RADIUS * cos, centre.1 - part * RADIUS * sin)
                        })
                        .collect();
                    canvas.polyline(&ring, CIRCLE);
                }
                canvas.line(
                    (centre.0 - RADIUS, centre.1),
                    (centre.0 + RADIUS, centre.1),
                    CIRCLE,
                );
                canvas.line(
                    (centre.0, centre.1 - RADIUS),
                    (centre.0, centre.1 + RADIUS),
                    CIRCLE,
                );
                let scale = RADIUS / size(shape);
                for z in shape {
                    let tip = (centre.0 + scale * z.re, centre.1 - scale * z.im);
                    canvas.line(centre, tip, ARROW);
                    canvas.marker(tip, Marker::Disc, 5.0, style::BLUE);
                }
            }
        })
    }
}
