//! Mode shapes on a stick figure: one small picture a mode, at rest and at both ends of the swing.

use super::canvas::{Align, Canvas, Color, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Swatch};
use super::style;
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

pub(super) const COLUMNS: usize = 3;
pub(super) const HEIGHT: f64 = 330.0;
/// Largest displacement drawn, as part of the figure's size.
const SWING: f64 = 0.18;
/// Time in which a drawn mode swings once, s.
const PERIOD_S: f64 = 2.0;
const AT_REST: Stroke = Stroke::solid(style::GREY, 4.0);
pub(super) const MOVED: Stroke = Stroke::solid(style::BLUE, 2.4);
const OTHER_WAY: Stroke = Stroke::dashed(style::BLUE, 1.6, &[7.0, 5.0]);
const AXIS: Stroke = Stroke::solid(style::INK, 1.4);

/// Seen from the front right and above (dimetric); up on the sheet is up in the world.
pub(super) fn project([x, y, z]: [f64; 3]) -> (f64, f64) {
    (0.8 * x - 0.6 * y, 0.35 * (0.6 * x + 0.8 * y) + z * 0.94)
}

impl ModeShapesFigure {
    /// Modes that can be drawn.
    fn drawable(&self) -> Vec<&StickPicture> {
        self.pictures
            .iter()
            .filter(|p| {
                let finite = |v: &[[f64; 3]]| v.iter().flatten().all(|v| v.is_finite());
                p.chain.len() >= 2 && finite(&p.chain) && finite(&p.chain_moved)
            })
            .collect()
    }

    /// The same modes swinging, as an SVG element to stand in a page; `None` without a mode that can be drawn. Every mode
    /// swings once in `PERIOD_S`: how fast it really is stands in its title.
    pub fn animated_svg(&self) -> Option<String> {
        let pictures = self.drawable();
        let columns = COLUMNS.min(pictures.len());
        if columns == 0 {
            return None;
        }
        let width = f64::from(WIDTH) / columns as f64;
        let height = HEIGHT * pictures.len().div_ceil(columns) as f64;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" \
             aria-label=\"Mode shapes in motion\">"
        );
        let css = |c: Color| format!("rgb({},{},{})", c.0, c.1, c.2);
        let points = |line: Vec<(f64, f64)>| -> String {
            let pairs: Vec<String> = line.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            pairs.join(" ")
        };
        // A sine between the two ends.
        let timing = format!(
            "dur=\"{PERIOD_S}s\" repeatCount=\"indefinite\" calcMode=\"spline\" keyTimes=\"0;0.5;1\" \
             keySplines=\"0.37 0 0.63 1;0.37 0 0.63 1\""
        );
        for (k, picture) in pictures.into_iter().enumerate() {
            let at = (width * (k % columns) as f64, HEIGHT * (k / columns) as f64);
            let layout = PictureLayout::new(picture, at, (width, HEIGHT));
            let [there, back] = [1.0, -1.0].map(|factor| points(layout.chain(factor)));
            let title = picture.title.replace('&', "&amp;").replace('<', "&lt;");
            svg += &format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"17\">{title}</text>\
                 <polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"4\"/>\
                 <polyline points=\"{there}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2.6\">\
                 <animate attributeName=\"points\" values=\"{there};{back};{there}\" {timing}/></polyline>",
                at.0 + 0.5 * width,
                at.1 + 20.0,
                points(layout.chain(0.0)),
                css(style::GREY),
                css(style::BLUE),
            );
            for (p, u) in &picture.points {
                let [(x1, y1), (x2, y2)] = [1.0, -1.0].map(|factor| layout.place(p, u, factor));
                svg += &format!(
                    "<circle cx=\"{x1:.1}\" cy=\"{y1:.1}\" r=\"5\" fill=\"{}\">\
                     <animate attributeName=\"cx\" values=\"{x1:.1};{x2:.1};{x1:.1}\" {timing}/>\
                     <animate attributeName=\"cy\" values=\"{y1:.1};{y2:.1};{y1:.1}\" {timing}/></circle>",
                    css(style::RED)
                );
            }
        }
        svg += "</svg>";
        Some(svg)
    }

    /// # Errors
    /// No mode with a position.
    pub fn png(&self) -> Result<Vec<u8>> {
        let pictures = self.drawable();
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
        let header = FigureHeader::new(&self.title, &legend, left, right);
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

/// Where a mode's points lie on the sheet.
pub(super) struct PictureLayout<'a> {
    picture: &'a StickPicture,
    /// Factor on displacements.
    swing: f64,
    /// Pixels per projected metre.
    scale: f64,
    /// Projected centre of the figure and its place on the sheet.
    centre: (f64, f64),
    middle: (f64, f64),
}

impl<'a> PictureLayout<'a> {
    pub(super) fn new(picture: &'a StickPicture, at: (f64, f64), size: (f64, f64)) -> Self {
        let length = |u: &[f64; 3]| u.iter().map(|v| v * v).sum::<f64>().sqrt();
        let span = |k: usize| {
            let values = || picture.chain.iter().map(|p| p[k]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        let extent = (0..3).map(span).fold(0.0, f64::max).max(1e-6);
        let moves = picture.points.iter().map(|p| &p.1).chain(&picture.chain_moved);
        let largest = moves.map(length).fold(0.0, f64::max);
        let mut layout = PictureLayout {
            picture,
            swing: match largest > 0.0 {
                true => SWING * extent / largest,
                false => 0.0,
            },
            scale: 1.0,
            centre: (0.0, 0.0),
            middle: (0.0, 0.0),
        };
        let all: Vec<(f64, f64)> = [-1.0, 0.0, 1.0]
            .into_iter()
            .flat_map(|factor| layout.chain(factor))
            .collect();
        let bounds = |of: fn(&(f64, f64)) -> f64| {
            all.iter()
                .map(of)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
                    (a.min(v), b.max(v))
                })
        };
        // With the y axis of a sheet, down.
        let ((low_x, high_x), (low_y, high_y)) = (bounds(|p| p.0), bounds(|p| p.1));
        layout.scale =
            ((size.0 - 60.0) / (high_x - low_x).max(1e-6)).min((size.1 - 80.0) / (high_y - low_y).max(1e-6));
        layout.centre = (0.5 * (low_x + high_x), 0.5 * (low_y + high_y));
        layout.middle = (at.0 + 0.5 * size.0, at.1 + 20.0 + 0.5 * size.1);
        layout
    }

    fn place(&self, p: &[f64; 3], u: &[f64; 3], factor: f64) -> (f64, f64) {
        let (x, y) = project(std::array::from_fn(|k| p[k] + factor * self.swing * u[k]));
        (
            self.middle.0 + self.scale * (x - self.centre.0),
            self.middle.1 - self.scale * (y + self.centre.1),
        )
    }

    /// The arm at `factor` times its swing.
    pub(super) fn chain(&self, factor: f64) -> Vec<(f64, f64)> {
        let pairs = self.picture.chain.iter().zip(&self.picture.chain_moved);
        pairs.map(|(p, u)| self.place(p, u, factor)).collect()
    }
}

fn draw(canvas: &Canvas, picture: &StickPicture, at: (f64, f64), size: (f64, f64)) {
    let layout = PictureLayout::new(picture, at, size);
    let line = |factor: f64, stroke: Stroke| {
        let points = layout.chain(factor);
        canvas.polyline(&points, stroke);
        points
    };
    for joint in line(0.0, AT_REST) {
        canvas.marker(joint, Marker::Disc, 3.5, style::GREY);
    }
    line(-1.0, OTHER_WAY);
    line(1.0, MOVED);
    for (p, u) in &picture.points {
        let ends = [0.0, 1.0].map(|factor| layout.place(p, u, factor));
        canvas.line(ends[0], ends[1], Stroke::solid(style::RED, 1.6));
        canvas.marker(ends[1], Marker::Disc, 4.5, style::RED);
    }
    picture_title(canvas, picture, at, size);
    base_axes(canvas, at, size);
}

pub(super) fn picture_title(canvas: &Canvas, picture: &StickPicture, at: (f64, f64), size: (f64, f64)) {
    let middle = (at.0 + 0.5 * size.0, at.1 + 14.0);
    let title = style::AXIS.fit(&picture.title, size.0 - 20.0);
    canvas.text(middle, &title, style::AXIS.align(Align::Center));
}

/// Directions of the base frame, in the lower left corner.
pub(super) fn base_axes(canvas: &Canvas, at: (f64, f64), size: (f64, f64)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moving_picture_swings_between_the_two_ends_and_escapes_its_title() {
        let picture = StickPicture {
            title: "7 Hz <b>".into(),
            chain: vec![[0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]],
            chain_moved: vec![[0.0; 3], [0.1, 0.0, 0.0], [0.2, 0.0, 0.1]],
            points: vec![([1.0, 0.0, 1.0], [0.2, 0.0, 0.1])],
        };
        let figure = ModeShapesFigure {
            title: "p1".into(),
            pictures: vec![picture],
        };
        let svg = figure.animated_svg().unwrap();
        assert!(svg.contains("7 Hz &lt;b>") && !svg.contains("<b>"), "{svg}");
        let values = svg.split("attributeName=\"points\" values=\"").nth(1).unwrap();
        let values = values.split('"').next().unwrap();
        let frames: Vec<&str> = values.split(';').collect();
        assert_eq!(frames.len(), 3);
        assert_eq!(frames[0], frames[2]);
        assert_ne!(frames[0], frames[1]);
        assert_eq!(frames[0].split(' ').count(), 3);
        assert!(ModeShapesFigure::default().animated_svg().is_none());
    }
}
