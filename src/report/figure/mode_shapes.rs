//! Mode shapes on a stick figure: one small picture a mode, at rest and at both ends of the swing.

use super::canvas::{Align, Marker, Stroke, paint};
use super::panel::{Header, Swatch};
use super::{WIDTH, nothing_to_draw, style};
use crate::Result;

/// One mode; positions in m, displacements in any common scale.
#[derive(Debug, Clone, Default)]
pub struct StickPicture {
    /// Such as `7.08 Hz, 3.7 %`.
    pub title: String,
    pub chain: Vec<[f64; 3]>,
    pub chain_moved: Vec<[f64; 3]>,
    /// Measured points and their displacement.
    pub points: Vec<([f64; 3], [f64; 3])>,
}

#[derive(Debug, Clone, Default)]
pub struct ModeShapesFigure {
    pub title: String,
    pub pictures: Vec<StickPicture>,
}

const COLUMNS: usize = 3;
const HEIGHT: f64 = 330.0;
/// Largest displacement drawn, as part of the figure's size.
const SWING: f64 = 0.18;
const AT_REST: Stroke = Stroke::solid(style::GREY, 4.0);
const MOVED: Stroke = Stroke::solid(style::BLUE, 2.4);
const OTHER_WAY: Stroke = Stroke::dashed(style::BLUE, 1.6, &[7.0, 5.0]);
const AXIS: Stroke = Stroke::solid(style::INK, 1.4);

/// Seen from the front right and above (dimetric); up on the sheet is up in the world.
fn project([x, y, z]: [f64; 3]) -> (f64, f64) {
    (0.8 * x - 0.6 * y, 0.35 * (0.6 * x + 0.8 * y) + z * 0.94)
}

impl ModeShapesFigure {
    /// # Errors
    /// No mode with a position.
    pub fn png(&self) -> Result<Vec<u8>> {
        let pictures: Vec<&StickPicture> = self
            .pictures
            .iter()
            .filter(|p| p.chain.len() >= 2 && p.chain.iter().flatten().all(|v| v.is_finite()))
            .collect();
        if pictures.is_empty() {
            return Err(nothing_to_draw(&self.title, "no mode with a shape"));
        }
        let (left, right) = (30.0, f64::from(WIDTH) - 30.0);
        let legend = [
            (Swatch::Line(AT_REST), "at rest".to_owned()),
            (Swatch::Line(MOVED), "one end of the swing".to_owned()),
            (Swatch::Line(OTHER_WAY), "the other end".to_owned()),
            (
                Swatch::Sign(Marker::Disc, 5.0, style::RED),
                "measured points".to_owned(),
            ),
        ];
        let header = Header::new(&self.title, &legend, left, right);
        let columns = COLUMNS.min(pictures.len());
        let width = (right - left) / columns as f64;
        let rows = pictures.len().div_ceil(columns);
        let height = header.bottom() + HEIGHT * rows as f64 + 16.0;
        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (k, picture) in pictures.iter().enumerate() {
                let x = left + width * (k % columns) as f64;
                let y = header.bottom() + HEIGHT * (k / columns) as f64;
                draw(canvas, picture, (x, y), (width, HEIGHT));
            }
        })
    }
}

fn draw(canvas: &super::canvas::Canvas, picture: &StickPicture, at: (f64, f64), size: (f64, f64)) {
    let shifted = |p: &[f64; 3], u: &[f64; 3], factor: f64| -> [f64; 3] {
        std::array::from_fn(|k| p[k] + factor * u[k])
    };
    let length = |u: &[f64; 3]| u.iter().map(|v| v * v).sum::<f64>().sqrt();
    let span = |k: usize| {
        let values = || picture.chain.iter().map(|p| p[k]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let extent = (0..3).map(span).fold(0.0, f64::max).max(1e-6);
    let moves = picture.points.iter().map(|p| &p.1).chain(&picture.chain_moved);
    let largest = moves.map(length).fold(0.0, f64::max);
    let swing = if largest > 0.0 {
        SWING * extent / largest
    } else {
        0.0
    };
    let chain = |factor: f64| -> Vec<(f64, f64)> {
        let pairs = picture.chain.iter().zip(&picture.chain_moved);
        pairs
            .map(|(p, u)| project(shifted(p, u, factor * swing)))
            .collect()
    };
    let all: Vec<(f64, f64)> = [-1.0, 0.0, 1.0].into_iter().flat_map(chain).collect();
    let bounds = |of: fn(&(f64, f64)) -> f64| {
        all.iter()
            .map(of)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                (a.min(v), b.max(v))
            })
    };
    let ((low_x, high_x), (low_y, high_y)) = (bounds(|p| p.0), bounds(|p| p.1));
    let scale =
        ((size.0 - 60.0) / (high_x - low_x).max(1e-6)).min((size.1 - 80.0) / (high_y - low_y).max(1e-6));
    let middle = (at.0 + 0.5 * size.0, at.1 + 20.0 + 0.5 * size.1);
    let place = |(x, y): (f64, f64)| {
        (
            middle.0 + scale * (x - 0.5 * (low_x + high_x)),
            middle.1 - scale * (y - 0.5 * (low_y + high_y)),
        )
    };
    let line = |factor: f64, stroke: Stroke| {
        let points: Vec<(f64, f64)> = chain(factor).into_iter().map(place).collect();
        canvas.polyline(&points, stroke);
        points
    };
    for joint in line(0.0, AT_REST) {
        canvas.marker(joint, Marker::Disc, 3.5, style::GREY);
    }
    line(-1.0, OTHER_WAY);
    line(1.0, MOVED);
    for (p, u) in &picture.points {
        let ends = [0.0, swing].map(|f| place(project(shifted(p, u, f))));
        canvas.line(ends[0], ends[1], Stroke::solid(style::RED, 1.6));
        canvas.marker(ends[1], Marker::Disc, 4.5, style::RED);
    }
    canvas.text(
        (at.0 + 0.5 * size.0, at.1 + 14.0),
        &picture.title,
        style::AXIS.align(Align::Center),
    );
    // Directions of the base frame.
    let origin = (at.0 + 42.0, at.1 + size.1 - 30.0);
    for (k, name) in ["x", "y", "z"].iter().enumerate() {
        let mut unit = [0.0; 3];
        unit[k] = 26.0;
        let (dx, dy) = project(unit);
        let tip = (origin.0 + dx, origin.1 - dy);
        canvas.line(origin, tip, AXIS);
        let text = (origin.0 + 1.45 * dx, origin.1 - 1.45 * dy);
        canvas.text(text, name, style::NOTE.align(Align::Center));
    }
}
