//! Mode shapes on the wire frame of a measured structure.

use num_complex::Complex64;

use super::canvas::{Color, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::mode_shapes::{HEIGHT, base_axes, project};
use super::panel::{FigureHeader, Swatch};
use super::style;
use crate::Result;

/// One mode on all nodes.
#[derive(Debug, Clone, Default)]
pub struct WirePicture {
    pub title: String,
    /// By node, along x, y, z, in any common scale; complex where points do not move in phase.
    pub shape: Vec<[Complex64; 3]>,
}

#[derive(Debug, Clone, Default)]
pub struct WireShapesFigure {
    pub title: String,
    /// m.
    pub nodes: Vec<[f64; 3]>,
    /// Pairs of indices of nodes.
    pub lines: Vec<[usize; 2]>,
    pub pictures: Vec<WirePicture>,
}

const COLUMNS: usize = 3;
/// Largest displacement drawn, as part of the figure's size.
const SWING: f64 = 0.18;
const PERIOD_S: f64 = 2.0;
/// Pictures a swing in the animation.
const FRAMES: usize = 12;
const AT_REST: Stroke = Stroke::solid(style::GREY, 1.6);
const MOVED: Stroke = Stroke::solid(style::BLUE, 2.2);
const OTHER_WAY: Stroke = Stroke::dashed(style::BLUE, 1.4, &[6.0, 4.0]);

/// Where nodes lie on the sheet.
struct Layout<'a> {
    figure: &'a WireShapesFigure,
    picture: &'a WirePicture,
    swing: f64,
    scale: f64,
    centre: (f64, f64),
    middle: (f64, f64),
}

impl<'a> Layout<'a> {
    fn new(figure: &'a WireShapesFigure, picture: &'a WirePicture, at: (f64, f64), width: f64) -> Self {
        let span = |k: usize| {
            let values = || figure.nodes.iter().map(|p| p[k]);
            values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
        };
        let extent = (0..3).map(span).fold(0.0, f64::max).max(1e-9);
        let length = |u: &[Complex64; 3]| u.iter().map(|z| z.norm_sqr()).sum::<f64>().sqrt();
        let largest = picture.shape.iter().map(length).fold(0.0, f64::max);
        let mut layout = Layout {
            figure,
            picture,
            swing: if largest > 0.0 {
                SWING * extent / largest
            } else {
                0.0
            },
            scale: 1.0,
            centre: (0.0, 0.0),
            middle: (at.0 + 0.5 * width, at.1 + 20.0 + 0.5 * HEIGHT),
        };
        let all: Vec<(f64, f64)> = (0..FRAMES)
            .flat_map(|frame| layout.projected(phase_of(frame)))
            .chain(layout.projected(None))
            .collect();
        let bounds = |of: fn(&(f64, f64)) -> f64| {
            let values = || all.iter().map(of);
            (
                values().fold(f64::INFINITY, f64::min),
                values().fold(f64::NEG_INFINITY, f64::max),
            )
        };
        let ((low_x, high_x), (low_y, high_y)) = (bounds(|p| p.0), bounds(|p| p.1));
        layout.centre = (0.5 * (low_x + high_x), 0.5 * (low_y + high_y));
        layout.scale =
            ((width - 60.0) / (high_x - low_x).max(1e-9)).min((HEIGHT - 90.0) / (high_y - low_y).max(1e-9));
        layout
    }

    /// All nodes at a phase of the swing, or at rest, in m: to the right and up.
    fn projected(&self, phase: Option<f64>) -> Vec<(f64, f64)> {
        let turn = phase.map(|p| Complex64::from_polar(1.0, p));
        let moved = self.figure.nodes.iter().enumerate().map(|(n, at)| {
            let u = self.picture.shape.get(n).copied().unwrap_or_default();
            project(std::array::from_fn(|k| {
                at[k] + turn.map_or(0.0, |t| self.swing * (u[k] * t).re)
            }))
        });
        moved.collect()
    }

    /// The same on the sheet.
    fn nodes(&self, phase: Option<f64>) -> Vec<(f64, f64)> {
        let points = self.projected(phase).into_iter().map(|(x, y)| {
            (
                self.middle.0 + self.scale * (x - self.centre.0),
                self.middle.1 - self.scale * (y - self.centre.1),
            )
        });
        points.collect()
    }
}

fn phase_of(frame: usize) -> Option<f64> {
    Some(std::f64::consts::TAU * frame as f64 / FRAMES as f64)
}

impl WireShapesFigure {
    fn drawable(&self) -> bool {
        let finite = self.nodes.iter().flatten().all(|x| x.is_finite());
        let inside = self.lines.iter().flatten().all(|n| *n < self.nodes.len());
        finite && inside && !self.nodes.is_empty() && !self.pictures.is_empty()
    }

    /// The modes swinging, as an SVG element; `None` where there is nothing to draw.
    pub fn animated_svg(&self) -> Option<String> {
        if !self.drawable() {
            return None;
        }
        let columns = COLUMNS.min(self.pictures.len());
        let width = f64::from(WIDTH) / columns as f64;
        let height = HEIGHT * self.pictures.len().div_ceil(columns) as f64;
        let css = |c: Color| format!("rgb({},{},{})", c.0, c.1, c.2);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" \
             aria-label=\"Mode shapes in motion\">"
        );
        for (k, picture) in self.pictures.iter().enumerate() {
            let at = (width * (k % columns) as f64, HEIGHT * (k / columns) as f64);
            let layout = Layout::new(self, picture, at, width);
            let frames: Vec<Vec<(f64, f64)>> = (0..=FRAMES).map(|f| layout.nodes(phase_of(f))).collect();
            let rest = layout.nodes(None);
            #[allow(clippy::type_complexity)]
            let animate = |name: &str, of: &dyn Fn(&[(f64, f64)]) -> f64| {
                let values: Vec<String> = frames.iter().map(|f| format!("{:.1}", of(f))).collect();
                format!(
                    "<animate attributeName=\"{name}\" values=\"{}\" dur=\"{PERIOD_S}s\" repeatCount=\"indefinite\"/>",
                    values.join(";")
                )
            };
            let title = picture.title.replace('&', "&amp;").replace('<', "&lt;");
            svg += &format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"17\">{title}</text>",
                at.0 + 0.5 * width,
                at.1 + 20.0
            );
            let line = |points: &[(f64, f64)], [a, b]: [usize; 2], color: Color, thick: f64, moving: &str| {
                format!(
                    "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{}\" stroke-width=\"{thick}\">{moving}</line>",
                    points[a].0,
                    points[a].1,
                    points[b].0,
                    points[b].1,
                    css(color)
                )
            };
            for ends in &self.lines {
                svg += &line(&rest, *ends, style::GREY, 1.6, "");
            }
            for ends in &self.lines {
                let [a, b] = *ends;
                let moving = animate("x1", &|f| f[a].0)
                    + &animate("y1", &|f| f[a].1)
                    + &animate("x2", &|f| f[b].0)
                    + &animate("y2", &|f| f[b].1);
                svg += &line(&frames[0], *ends, style::BLUE, 2.4, &moving);
            }
            for (n, (x, y)) in frames[0].iter().enumerate() {
                svg += &format!(
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.6\" fill=\"{}\">{}{}</circle>",
                    css(style::RED),
                    animate("cx", &|f| f[n].0),
                    animate("cy", &|f| f[n].1)
                );
            }
        }
        svg += "</svg>";
        Some(svg)
    }

    /// # Errors
    /// No nodes or no mode.
    pub fn png(&self) -> Result<Vec<u8>> {
        if !self.drawable() {
            return Err(nothing_to_draw(&self.title, "no node or no mode with a shape"));
        }
        let (left, right) = (30.0, f64::from(WIDTH) - 30.0);
        let legend = [
            (Swatch::Line(AT_REST), "at rest".to_owned()),
            (Swatch::Line(MOVED), "one end of the swing".to_owned()),
            (Swatch::Line(OTHER_WAY), "the other end".to_owned()),
            (
                Swatch::Sign(Marker::Disc, 4.0, style::RED),
                "measured points".to_owned(),
            ),
        ];
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let columns = COLUMNS.min(self.pictures.len());
        let width = (right - left) / columns as f64;
        let rows = self.pictures.len().div_ceil(columns);
        let height = header.bottom() + HEIGHT * rows as f64 + 16.0;
        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (k, picture) in self.pictures.iter().enumerate() {
                let at = (
                    left + width * (k % columns) as f64,
                    header.bottom() + HEIGHT * (k / columns) as f64,
                );
                let layout = Layout::new(self, picture, at, width);
                for (phase, stroke) in [
                    (None, AT_REST),
                    (Some(std::f64::consts::PI), OTHER_WAY),
                    (Some(0.0), MOVED),
                ] {
                    let nodes = layout.nodes(phase);
                    for [a, b] in &self.lines {
                        canvas.line(nodes[*a], nodes[*b], stroke);
                    }
                    if phase == Some(0.0) {
                        for node in nodes {
                            canvas.marker(node, Marker::Disc, 4.5, style::RED);
                        }
                    }
                }
                let title = style::AXIS.fit(&picture.title, width - 20.0);
                let middle = (at.0 + 0.5 * width, at.1 + 14.0);
                canvas.text(middle, &title, style::AXIS.align(super::canvas::Align::Center));
                base_axes(canvas, at, (width, HEIGHT));
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_swings_within_its_picture() {
        let z = |re: f64, im: f64| Complex64::new(re, im);
        let figure = WireShapesFigure {
            title: "wing".into(),
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.3, 0.0]],
            lines: vec![[0, 1], [1, 2]],
            pictures: vec![WirePicture {
                title: "7 Hz <b>".into(),
                shape: vec![
                    [z(0.0, 0.0); 3],
                    [z(0.0, 0.0), z(0.0, 0.0), z(0.4, 0.1)],
                    [z(0.0, 0.0), z(0.0, 0.0), z(1.0, 0.3)],
                ],
            }],
        };
        let svg = figure.animated_svg().unwrap();
        assert!(svg.contains("7 Hz &lt;b>") && !svg.contains("<b>"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 3);
        let layout = Layout::new(&figure, &figure.pictures[0], (0.0, 0.0), 400.0);
        for frame in 0..FRAMES {
            for (x, y) in layout.nodes(phase_of(frame)) {
                assert!(
                    (0.0..400.0).contains(&x) && (20.0..HEIGHT + 20.0).contains(&y),
                    "{x} {y}"
                );
            }
        }
        assert!(figure.png().unwrap().len() > 1000);
        let broken = WireShapesFigure {
            lines: vec![[0, 9]],
            ..figure
        };
        assert!(broken.png().is_err() && broken.animated_svg().is_none());
    }
}
