//! What is left of force records against what was different: one panel, points with their standard errors.

use crate::Result;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{Marker, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;

/// The rest against one quantity.
#[derive(Debug, Clone, Default)]
pub struct TrendFigure {
    pub title: String,
    /// With their units.
    pub x_label: String,
    pub y_label: String,
    /// What the points are, without what their bars are, and what zero is.
    pub of: [&'static str; 2],
    /// x, value, standard error.
    pub points: Vec<[f64; 3]>,
}

const HEIGHT: f64 = 260.0;
const SIGN: f64 = 8.0;

impl TrendFigure {
    /// # Errors
    /// No finite value.
    pub fn png(&self) -> Result<Vec<u8>> {
        let points: Vec<[f64; 3]> = self
            .points
            .iter()
            .copied()
            .filter(|p| p.iter().all(|v| usable(*v)))
            .collect();
        let ends = points.iter().flat_map(|[_, y, std]| [y - std, y + std, 0.0]);
        let ranges = extent(points.iter().map(|p| p[0])).zip(extent(ends));
        let Some((across, up)) = ranges else {
            return Err(nothing_to_draw(&self.title, "no value is finite"));
        };
        let x = FigureAxis::padded(&self.x_label, across, 0.04, 8);
        let y = FigureAxis::padded(&self.y_label, up, 0.12, 6);
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let legend = [
            (
                Swatch::Sign(Marker::Disc, SIGN, style::BLUE),
                format!("{} ± standard error of the noise", self.of[0]),
            ),
            (Swatch::Line(style::LEVEL), self.of[1].to_string()),
        ];
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let panels = Panel::stack(&x, vec![y], [left, right], header.bottom() + 14.0, HEIGHT, 0.0);
        let bottom = panels.last().map_or(0.0, |p| p.bottom);
        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for panel in &panels {
                panel.grid(canvas);
                panel.curve(canvas, [(panel.x.low, 0.0), (panel.x.high, 0.0)], style::LEVEL);
                for [x, y, std] in &points {
                    panel.error_bar(canvas, *x, (y - std, y + std), style::BLUE);
                }
                let signs = points.iter().map(|p| (p[0], p[1]));
                panel.markers(canvas, signs, (Marker::Disc, SIGN), style::BLUE, 0.0);
                panel.frame(canvas);
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_drawn_and_nothing_is_an_error() {
        let mut figure = TrendFigure {
            title: "The rest against the feed".into(),
            x_label: "Feed (mm)".into(),
            y_label: "Rest (%)".into(),
            of: ["record less model", "no difference"],
            points: vec![[0.05, 4.0, 0.5], [0.1, -1.0, 0.4], [0.15, f64::NAN, 0.4]],
        };
        assert!(figure.png().unwrap().starts_with(b"\x89PNG"));
        figure.points.clear();
        assert!(figure.png().is_err());
    }
}
