//! Parameters before and after calibration, as deviation from their nominal values.

use crate::Result;
use crate::report::figure::dynamics::frf::or;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{Align, Canvas, Color, Stroke, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::report::number::plus_minus;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnEstimate {
    pub value: f64,
    pub std_error: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct ParameterRow {
    pub name: String,
    /// Unit of nominal, values and errors.
    pub unit: String,
    /// What the deviation is measured from; a row without a nonzero nominal shows its numbers only.
    pub nominal: f64,
    pub before: Option<DrawnEstimate>,
    pub after: Option<DrawnEstimate>,
}

/// Horizontal bars of value / nominal − 1 with standard errors, and the values in numbers next to them.
#[derive(Debug, Clone, Default)]
pub struct ParameterFigure {
    pub title: String,
    /// Names of the two states; `before` and `after` where empty.
    pub before_label: String,
    pub after_label: String,
    pub rows: Vec<ParameterRow>,
}

const ROW: f64 = 46.0;
const NUMBERS: f64 = 270.0;

impl ParameterFigure {
    /// # Errors
    /// No parameter with a finite value, or more than 120 of them.
    pub fn png(&self) -> Result<Vec<u8>> {
        let rows: Vec<&ParameterRow> = self
            .rows
            .iter()
            .filter(|row| row.shown().next().is_some())
            .collect();
        if rows.is_empty() || rows.len() > 120 {
            return Err(nothing_to_draw(
                &self.title,
                "1 to 120 parameters with finite values are needed",
            ));
        }
        let ends = rows
            .iter()
            .flat_map(|row| row.shown().filter_map(|e| row.deviation(e)));
        let (low, high) =
            extent(ends.flat_map(|(value, error)| [value - error, value + error])).unwrap_or((0.0, 0.0));
        let (low, high) = (low.min(0.0), high.max(0.0));
        // All at their nominal: a span of a percent, not a magnified rounding error.
        let room = (0.06 * (high - low)).max(0.5);
        let axis = FigureAxis::linear("Deviation from nominal (%)", (low - room, high + room), 8);

        let names = rows
            .iter()
            .map(|row| style::TICK.width(&row.name))
            .fold(0.0, f64::max)
            .min(330.0);
        let left = names + 34.0;
        let right = f64::from(WIDTH) - NUMBERS;
        let any =
            |state: fn(&ParameterRow) -> Option<DrawnEstimate>| rows.iter().any(|row| state(row).is_some());
        let mut legend = vec![];
        if any(|row| row.before) {
            legend.push((
                Swatch::Area(BEFORE, 1.0),
                or(&self.before_label, "before").to_owned(),
            ));
        }
        if any(|row| row.after) {
            let label = format!("{}, with standard error", or(&self.after_label, "after"));
            legend.push((Swatch::Area(AFTER, 1.0), label));
        }
        let header = FigureHeader::new(&self.title, &legend, left, f64::from(WIDTH) - 20.0);
        let top = header.bottom() + 4.0;
        let bottom = top + ROW * rows.len() as f64;
        let panel = Panel {
            left,
            top,
            right,
            bottom,
            x: axis,
            y: FigureAxis::categories("", &[]),
            x_labels: true,
        };

        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for row in (1..rows.len()).step_by(2) {
                let y = top + ROW * row as f64;
                canvas.rect((left, y), (right, y + ROW), Color(246, 247, 249), 1.0);
            }
            panel.grid(canvas);
            if let Some(zero) = panel.x_at(0.0) {
                canvas.line((zero, top), (zero, bottom), Stroke::solid(style::INK, 1.6));
            }
            for (i, row) in rows.iter().enumerate() {
                draw_row(canvas, &panel, row, top + ROW * (i as f64 + 0.5));
            }
            panel.frame(canvas);
        })
    }
}

const BEFORE: Color = Color(238, 176, 96);
const AFTER: Color = style::BLUE;

fn draw_row(canvas: &Canvas, panel: &Panel, row: &ParameterRow, y: f64) {
    let name = style::TICK.fit(&row.name, 330.0);
    canvas.text((panel.left - 12.0, y), &name, style::TICK.align(Align::Right));
    let states = [
        (row.before, BEFORE, style::MUTED, -1.0),
        (row.after, AFTER, style::INK, 1.0),
    ];
    let both = row.before.is_some() && row.after.is_some();
    for (estimate, color, ink, side) in states {
        let Some(estimate) = estimate.filter(|e| usable(e.value)) else {
            continue;
        };
        let y = if both { y + side * 9.0 } else { y };
        let number = plus_minus(estimate.value, estimate.std_error.unwrap_or(f64::NAN), &row.unit);
        canvas.text(
            (panel.right + 12.0, y),
            &style::TICK.fit(&number, NUMBERS - 24.0),
            style::TICK.color(ink),
        );
        let Some((value, error)) = row.deviation(estimate) else {
            continue;
        };
        let (Some(zero), Some(end)) = (panel.x_at(0.0), panel.x_at(value)) else {
            continue;
        };
        let edge = |x: f64| x.clamp(panel.left, panel.right);
        // A bar of no length still shows that there is a value.
        let (from, to) = (zero.min(end - 1.5), zero.max(end + 1.5));
        canvas.rect((edge(from), y - 7.0), (edge(to), y + 7.0), color, 1.0);
        let (Some(a), Some(b)) = (panel.x_at(value - error), panel.x_at(value + error)) else {
            continue;
        };
        if b - a > 1.0 {
            let (a, b) = (edge(a), edge(b));
            let bar = Stroke::solid(style::INK, 1.4);
            canvas.line((a, y), (b, y), bar);
            canvas.line((a, y - 4.0), (a, y + 4.0), bar);
            canvas.line((b, y - 4.0), (b, y + 4.0), bar);
        }
    }
}

impl ParameterRow {
    fn shown(&self) -> impl Iterator<Item = DrawnEstimate> {
        [self.before, self.after]
            .into_iter()
            .flatten()
            .filter(|e| usable(e.value))
    }

    /// Deviation from nominal and its error, in percent of the nominal.
    fn deviation(&self, estimate: DrawnEstimate) -> Option<(f64, f64)> {
        let percent = |value: f64| Some(100.0 * value / self.nominal).filter(|v| usable(*v));
        let error = estimate.std_error.filter(|e| usable(*e)).unwrap_or(0.0);
        Some((percent(estimate.value - self.nominal)?, percent(error)?.abs()))
    }
}
