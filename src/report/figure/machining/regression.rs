//! Average force over feed with the fitted straight lines.

use crate::Result;
use crate::report::figure::dynamics::frf::or;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{Canvas, Marker, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;

#[derive(Debug, Clone, Default)]
pub struct RegressionMark {
    /// Such as the cut.
    pub label: String,
    pub x: f64,
    pub y: f64,
    pub std_error: Option<f64>,
    /// Left out of the fit: drawn as a cross.
    pub excluded: bool,
}

#[derive(Debug, Clone, Default)]
pub struct RegressionSeries {
    /// Such as `Fx, R² = 0.998`.
    pub label: String,
    pub points: Vec<RegressionMark>,
    /// (intercept, slope) of the fitted line in the units of the axes.
    pub line: Option<(f64, f64)>,
}

#[derive(Debug, Clone, Default)]
pub struct RegressionFigure {
    pub title: String,
    /// With unit, such as `Feed per tooth (mm)`.
    pub x_label: String,
    pub y_label: String,
    pub series: Vec<RegressionSeries>,
}

impl RegressionFigure {
    /// # Errors
    /// No series with a finite point.
    pub fn png(&self) -> Result<Vec<u8>> {
        let points = || {
            self.series
                .iter()
                .flat_map(|s| &s.points)
                .filter(|p| usable(p.x) && usable(p.y))
        };
        let Some(xs) = extent(points().map(|p| p.x)) else {
            return Err(nothing_to_draw(&self.title, "no series has a finite point"));
        };
        // From zero: the intercept is the edge force, half of what is looked for.
        let x = FigureAxis::from_zero(&self.x_label, xs, 8);
        let bars = points().flat_map(|p| {
            let error = p.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
            [p.y - error, p.y + error]
        });
        let lines = self.series.iter().filter_map(|s| s.line);
        let ends =
            lines.flat_map(|(intercept, slope)| [intercept + slope * x.low, intercept + slope * x.high]);
        let ys = extent(bars.chain(ends).chain([0.0])).unwrap_or((0.0, 1.0));
        let y = FigureAxis::padded(&self.y_label, ys, 0.06, 7);

        // What the lines leave over is small compared with the forces: it needs a scale of its own.
        let rests = self.series.iter().flat_map(RegressionSeries::rests);
        let rests = rests.flat_map(|(point, rest)| {
            let error = point.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
            [rest - error, rest + error]
        });
        let rests = extent(rests.filter(|v| usable(*v)).chain([0.0])).unwrap_or((0.0, 1.0));
        let rest_axis = FigureAxis::padded(&self.rest_label(), rests, 0.12, 5);
        let left = Panel::left_margin(&[&y, &rest_axis]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let excluded = points().any(|p| p.excluded);
        let legend = self.series.iter().enumerate().map(|(i, s)| {
            let stroke = style::series(i);
            let sign = style::series_marker(i);
            let swatch = match s.line {
                Some(_) => Swatch::LineAndSign(stroke, sign, SIGN),
                None => Swatch::Sign(sign, SIGN, stroke.color),
            };
            (swatch, or(&s.label, "series").to_owned())
        });
        let crosses = excluded.then(|| {
            (
                Swatch::Sign(Marker::Cross, SIGN, style::MUTED),
                "left out of the fit".to_owned(),
            )
        });
        let header = FigureHeader::new(
            &self.title,
            &legend.chain(crosses).collect::<Vec<_>>(),
            left,
            right,
        );
        let top = header.bottom();
        let lined = self.series.iter().any(|s| s.line.is_some());
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 440.0,
            x: x.clone(),
            y,
            x_labels: !lined,
        };
        let below = lined.then_some(Panel {
            left,
            top: panel.bottom + 20.0,
            right,
            bottom: panel.bottom + 170.0,
            x,
            y: rest_axis,
            x_labels: true,
        });
        let bottom = below.as_ref().map_or(panel.bottom, |p| p.bottom);

        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            if let Some(below) = &below {
                self.draw_rests(canvas, below);
            }
            panel.grid(canvas);
            panel.curve(canvas, [(panel.x.low, 0.0), (panel.x.high, 0.0)], style::FRAME);
            for (i, series) in self.series.iter().enumerate() {
                let stroke = style::series(i);
                if let Some((intercept, slope)) = series.line {
                    let at = |x: f64| (x, intercept + slope * x);
                    panel.curve(canvas, [at(panel.x.low), at(panel.x.high)], stroke);
                }
                for point in &series.points {
                    let error = point.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
                    if !point.excluded {
                        panel.error_bar(canvas, point.x, (point.y - error, point.y + error), stroke.color);
                    }
                    let sign = if point.excluded {
                        Marker::Cross
                    } else {
                        style::series_marker(i)
                    };
                    panel.markers(canvas, [(point.x, point.y)], (sign, SIGN), stroke.color, 0.0);
                }
            }
            panel.frame(canvas);
        })
    }
}

impl RegressionFigure {
    /// `Residual (N)` where the forces are in N.
    pub(crate) fn rest_label(&self) -> String {
        match self.y_label.rsplit_once(" (") {
            Some((_, unit)) => format!("Residual ({unit}"),
            None => "Residual".to_string(),
        }
    }

    fn draw_rests(&self, canvas: &Canvas, panel: &Panel) {
        panel.grid(canvas);
        panel.curve(canvas, [(panel.x.low, 0.0), (panel.x.high, 0.0)], style::FRAME);
        for (i, series) in self.series.iter().enumerate() {
            let color = style::series(i).color;
            for (point, rest) in series.rests() {
                let error = point.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
                panel.error_bar(canvas, point.x, (rest - error, rest + error), color);
                let sign = (style::series_marker(i), 0.8 * SIGN);
                panel.markers(canvas, [(point.x, rest)], sign, color, 0.0);
            }
        }
        panel.frame(canvas);
    }
}

impl RegressionSeries {
    /// Points of the fit and how far each lies above the line; none without a line.
    pub(crate) fn rests(&self) -> impl Iterator<Item = (&RegressionMark, f64)> {
        let points = self.points.iter().filter(|p| !p.excluded);
        points.filter_map(|p| {
            let (intercept, slope) = self.line?;
            Some((p, p.y - intercept - slope * p.x))
        })
    }
}

const SIGN: f64 = 9.0;
