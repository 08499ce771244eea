//! One coordinate frame on the sheet, and what every figure has around it: title, legend, margins.

use super::axis::FigureAxis;
use super::canvas::{Align, Canvas, CanvasPoint, Color, Lettering, Marker, Stroke};
use super::style;

/// A frame with axes; `left … bottom` are the sides of the plotting area.
pub struct Panel {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
    pub x: FigureAxis,
    pub y: FigureAxis,
    /// Panels stacked above another share the x labels of the lowest one.
    pub x_labels: bool,
}

impl Panel {
    /// Room that an axis' labels and title take left of the frame.
    pub fn left_margin(axes: &[&FigureAxis]) -> f64 {
        let labels = axes.iter().flat_map(|axis| &axis.ticks);
        labels
            .map(|tick| style::TICK.width(&tick.label))
            .fold(0.0, f64::max)
            + 52.0
    }

    /// Room below the frame for tick labels and title.
    pub const BOTTOM_MARGIN: f64 = 62.0;
    /// Room right of the frame: half of a tick label that sits on the corner.
    pub const RIGHT_MARGIN: f64 = 36.0;

    /// Frames of one height above each other, with one x axis for all; `sides`: left and right, `gap`: from one to the
    /// next.
    pub fn stack(
        x: &FigureAxis,
        y: Vec<FigureAxis>,
        [left, right]: [f64; 2],
        top: f64,
        height: f64,
        gap: f64,
    ) -> Vec<Panel> {
        let count = y.len();
        let frames = y.into_iter().enumerate().map(|(i, y)| {
            let top = top + i as f64 * (height + gap);
            Panel {
                left,
                top,
                right,
                bottom: top + height,
                x: x.clone(),
                y,
                x_labels: i + 1 == count,
            }
        });
        frames.collect()
    }

    pub fn x_at(&self, value: f64) -> Option<f64> {
        self.x
            .fraction(value)
            .map(|f| self.left + f * (self.right - self.left))
    }

    pub fn y_at(&self, value: f64) -> Option<f64> {
        self.y
            .fraction(value)
            .map(|f| self.bottom - f * (self.bottom - self.top))
    }

    pub fn place(&self, x: f64, y: f64) -> Option<CanvasPoint> {
        Some((self.x_at(x)?, self.y_at(y)?))
    }

    fn holds(&self, (x, y): CanvasPoint) -> bool {
        x >= self.left - 0.5 && x <= self.right + 0.5 && y >= self.top - 0.5 && y <= self.bottom + 0.5
    }

    /// Grid lines; drawn before the data.
    pub fn grid(&self, canvas: &Canvas) {
        for tick in &self.x.ticks {
            if let Some(x) = self.x_at(tick.at) {
                canvas.line((x, self.top), (x, self.bottom), style::grid(tick));
            }
        }
        for tick in &self.y.ticks {
            if let Some(y) = self.y_at(tick.at) {
                canvas.line((self.left, y), (self.right, y), style::grid(tick));
            }
        }
    }

    /// Frame, tick labels and axis titles; drawn after the data.
    pub fn frame(&self, canvas: &Canvas) {
        let corners = [
            (self.left, self.top),
            (self.right, self.top),
            (self.right, self.bottom),
            (self.left, self.bottom),
            (self.left, self.top),
        ];
        canvas.polyline(&corners, style::FRAME);
        for tick in &self.x.ticks {
            let Some(x) = self.x_at(tick.at) else { continue };
            let length = if tick.label.is_empty() { 3.0 } else { 6.0 };
            canvas.line((x, self.bottom), (x, self.bottom + length), style::FRAME);
            if self.x_labels {
                canvas.text(
                    (x, self.bottom + 18.0),
                    &tick.label,
                    style::TICK.align(Align::Center),
                );
            }
        }
        for tick in &self.y.ticks {
            let Some(y) = self.y_at(tick.at) else { continue };
            let length = if tick.label.is_empty() { 3.0 } else { 6.0 };
            canvas.line((self.left - length, y), (self.left, y), style::FRAME);
            canvas.text(
                (self.left - 11.0, y),
                &tick.label,
                style::TICK.align(Align::Right),
            );
        }
        if self.x_labels {
            let middle = (0.5 * (self.left + self.right), self.bottom + 44.0);
            let label = style::AXIS.fit(&self.x.label, self.right - self.left);
            canvas.text(middle, &label, style::AXIS.align(Align::Center));
        }
        self.y_title(canvas);
    }

    fn y_title(&self, canvas: &Canvas) {
        let room = self.bottom - self.top;
        let lettering = style::AXIS.align(Align::Center).upright();
        let lines = lettering.wrap(&self.y.label, room, 2);
        let first = if lines.len() > 1 { 12.0 } else { 20.0 };
        for (i, line) in lines.iter().enumerate() {
            canvas.text(
                (first + 17.0 * i as f64, 0.5 * (self.top + self.bottom)),
                line,
                lettering,
            );
        }
    }

    /// A line through the points, cut at the frame and interrupted where there is no number.
    pub fn curve(&self, canvas: &Canvas, points: impl IntoIterator<Item = (f64, f64)>, stroke: Stroke) {
        let mut piece: Vec<CanvasPoint> = vec![];
        let mut before: Option<CanvasPoint> = None;
        let flush = |piece: &mut Vec<CanvasPoint>| {
            canvas.polyline(piece, stroke);
            piece.clear();
        };
        for (x, y) in points {
            // Beyond a million pixels the slope on screen does not change any more, but rounding begins to show.
            let here = self
                .place(x, y)
                .map(|(x, y)| (x.clamp(-1e6, 1e6), y.clamp(-1e6, 1e6)));
            if let (Some(a), Some(b)) = (before, here)
                && let Some((start, end)) = self.clip(a, b)
            {
                if piece
                    .last()
                    .is_none_or(|last| (last.0 - start.0).hypot(last.1 - start.1) > 1e-6)
                {
                    flush(&mut piece);
                    piece.push(start);
                }
                piece.push(end);
            } else {
                flush(&mut piece);
            }
            before = here;
        }
        flush(&mut piece);
    }

    /// A sign at each point inside the frame, at least `spacing` pixels from the one before.
    pub fn markers(
        &self,
        canvas: &Canvas,
        points: impl IntoIterator<Item = (f64, f64)>,
        (marker, size): (Marker, f64),
        color: Color,
        spacing: f64,
    ) {
        let mut last: Option<CanvasPoint> = None;
        for (x, y) in points {
            let Some(here) = self.place(x, y).filter(|p| self.holds(*p)) else {
                continue;
            };
            if last.is_none_or(|last| (last.0 - here.0).hypot(last.1 - here.1) >= spacing) {
                canvas.marker(here, marker, size, color);
                last = Some(here);
            }
        }
    }

    /// Vertical bar from `low` to `high` with caps: a standard error.
    pub fn error_bar(&self, canvas: &Canvas, x: f64, (low, high): (f64, f64), color: Color) {
        let (Some(x), Some(a), Some(b)) = (self.x_at(x), self.y_at(low), self.y_at(high)) else {
            return;
        };
        let (a, b) = (a.clamp(self.top, self.bottom), b.clamp(self.top, self.bottom));
        if (a - b).abs() > 1.0 && x >= self.left && x <= self.right {
            canvas.line((x, a), (x, b), Stroke::solid(color, 1.4));
            for y in [a, b] {
                canvas.line((x - 4.0, y), (x + 4.0, y), Stroke::solid(color, 1.4));
            }
        }
    }

    /// Shades the strip between two x values over the full height.
    pub fn band(&self, canvas: &Canvas, (from, to): (f64, f64), color: Color, opacity: f64) {
        let (Some(a), Some(b)) = (self.x_at(from), self.x_at(to)) else {
            return;
        };
        let (a, b) = (a.clamp(self.left, self.right), b.clamp(self.left, self.right));
        canvas.rect((a, self.top), (b, self.bottom), color, opacity);
    }

    /// The part of the segment inside the frame (Liang and Barsky, 1984).
    fn clip(&self, a: CanvasPoint, b: CanvasPoint) -> Option<(CanvasPoint, CanvasPoint)> {
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        let sides = [
            (-dx, a.0 - self.left),
            (dx, self.right - a.0),
            (-dy, a.1 - self.top),
            (dy, self.bottom - a.1),
        ];
        for (direction, distance) in sides {
            if direction == 0.0 {
                if distance < 0.0 {
                    return None;
                }
            } else if direction < 0.0 {
                enter = enter.max(distance / direction);
            } else {
                leave = leave.min(distance / direction);
            }
        }
        let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
        (enter <= leave).then(|| (at(enter), if leave >= 1.0 { b } else { at(leave) }))
    }
}

/// What stands before a name in the legend.
#[derive(Debug, Clone, Copy)]
pub enum Swatch {
    Line(Stroke),
    Sign(Marker, f64, Color),
    LineAndSign(Stroke, Marker, f64),
    Area(Color, f64),
}

/// Title and legend above the plots, laid out before the sheet's height is known.
pub struct FigureHeader {
    title: Vec<String>,
    /// (x, row, swatch, name)
    entries: Vec<(f64, usize, Swatch, String)>,
    left: f64,
    height: f64,
}

const TOP: f64 = 28.0;
const TITLE_LINE: f64 = 25.0;
const LEGEND_LINE: f64 = 24.0;
const SWATCH: f64 = 34.0;

impl FigureHeader {
    /// `left` and `right` are the sides of the plots below.
    pub fn new(title: &str, legend: &[(Swatch, String)], left: f64, right: f64) -> Self {
        let room = (right - left).max(100.0);
        let title = style::TITLE.wrap(title, room, 2);
        let (mut x, mut row) = (left, 0);
        let mut entries = vec![];
        for (swatch, name) in legend {
            let name = style::LEGEND.fit(name, (room - SWATCH - 10.0).min(520.0));
            let width = SWATCH + 8.0 + style::LEGEND.width(&name) + 28.0;
            if x > left && x + width - 28.0 > right {
                (x, row) = (left, row + 1);
            }
            entries.push((x, row, *swatch, name));
            x += width;
        }
        let rows = if entries.is_empty() { 0 } else { row + 1 };
        let height = TOP + TITLE_LINE * title.len() as f64 + LEGEND_LINE * rows as f64;
        FigureHeader {
            title,
            entries,
            left,
            height,
        }
    }

    /// Where the first frame may begin.
    pub fn bottom(&self) -> f64 {
        self.height
    }

    pub fn draw(&self, canvas: &Canvas) {
        for (i, line) in self.title.iter().enumerate() {
            canvas.text((self.left, TOP + TITLE_LINE * i as f64), line, style::TITLE);
        }
        let first = TOP + TITLE_LINE * self.title.len() as f64 + 2.0;
        for (x, row, swatch, name) in &self.entries {
            let y = first + LEGEND_LINE * *row as f64;
            let (a, b, middle) = ((*x, y), (x + SWATCH, y), (x + 0.5 * SWATCH, y));
            match *swatch {
                Swatch::Line(stroke) => canvas.line(a, b, stroke),
                Swatch::Sign(marker, size, color) => canvas.marker(middle, marker, size.max(5.0), color),
                Swatch::LineAndSign(stroke, marker, size) => {
                    canvas.line(a, b, stroke);
                    canvas.marker(middle, marker, size, stroke.color);
                }
                Swatch::Area(color, opacity) => {
                    canvas.rect((x + 4.0, y - 7.0), (x + SWATCH, y + 7.0), color, opacity);
                }
            }
            canvas.text(
                (x + SWATCH + 8.0, y),
                name,
                Lettering {
                    align: Align::Left,
                    ..style::LEGEND
                },
            );
        }
    }
}
