//! A table of numbers as coloured cells: where the error sits.

use super::axis::{Axis, extent, usable};
use super::canvas::{Align, Canvas, Stroke, paint};
use super::panel::Header;
use super::{WIDTH, nothing_to_draw, style};
use crate::Result;
use crate::report::number::{percent, significant};

/// How cell values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CellFormat {
    /// A ratio, shown as percent.
    #[default]
    Percent,
    /// So many significant digits, in the unit of `value_label`.
    Significant(usize),
}

#[derive(Debug, Clone, Default)]
pub struct HeatMap {
    /// Says what is compared.
    pub title: String,
    /// What the rows are, such as `Posture`.
    pub row_label: String,
    pub column_label: String,
    pub rows: Vec<String>,
    pub columns: Vec<String>,
    /// One inner vector a row; missing or non-finite cells stay empty.
    pub values: Vec<Vec<Option<f64>>>,
    /// What the colours mean, such as `nrms error`.
    pub value_label: String,
    pub format: CellFormat,
    /// Values at the ends of the colour scale; from 0 to the largest value if None.
    pub range: Option<(f64, f64)>,
}

impl HeatMap {
    /// # Errors
    /// No finite value in a named row and column, or more cells than can be seen.
    pub fn png(&self) -> Result<Vec<u8>> {
        let (rows, columns) = (self.rows.len(), self.columns.len());
        if rows > 400 || columns > 300 {
            let what = format!("{rows} × {columns} cells cannot be told apart (400 × 300 at most)");
            return Err(nothing_to_draw(&self.title, &what));
        }
        let cells = (0..rows).flat_map(|r| (0..columns).filter_map(move |c| self.value(r, c)));
        let Some((least, largest)) = extent(cells) else {
            return Err(nothing_to_draw(&self.title, "no cell has a finite value"));
        };
        let given = self
            .range
            .filter(|(low, high)| usable(*low) && usable(*high) && high > low);
        let (low, high) = given.unwrap_or((least.min(0.0), largest));
        let high = if high > low { high } else { low + 1.0 };

        let widest = self
            .rows
            .iter()
            .map(|name| style::TICK.width(name))
            .fold(0.0, f64::max)
            .min(300.0);
        let left = widest + 58.0;
        let right = f64::from(WIDTH) - 160.0;
        let cell_width = (right - left) / columns as f64;
        // Few rows are drawn taller, so that the colour scale beside them has room.
        let cell_height = (840.0 / rows as f64)
            .min((190.0 / rows as f64).max(46.0))
            .max(6.0);
        let header = Header::new(&self.title, &[], left.min(58.0), f64::from(WIDTH) - 30.0);
        let top = header.bottom() + 6.0;
        let bottom = top + cell_height * rows as f64;
        let flat = self
            .columns
            .iter()
            .all(|name| style::TICK.width(name) <= cell_width - 8.0);
        let names = self
            .columns
            .iter()
            .map(|name| style::TICK.width(name))
            .fold(0.0, f64::max)
            .min(150.0);
        let below = if flat { 26.0 } else { names + 18.0 };
        let sheet = Sheet {
            left,
            top,
            right,
            bottom,
            cell_width,
            cell_height,
            low,
            high,
        };
        // The colour scale needs some height, however few rows there are.
        let height = (bottom + below + 40.0).max(top + 250.0);

        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            self.draw_cells(canvas, &sheet);
            self.draw_names(canvas, &sheet, flat);
            let middle = (0.5 * (left + right), bottom + below + 16.0);
            canvas.text(middle, &self.column_label, style::AXIS.align(Align::Center));
            let row_title = style::AXIS.fit(&self.row_label, height - top);
            canvas.text(
                (22.0, 0.5 * (top + bottom)),
                &row_title,
                style::AXIS.align(Align::Center).upright(),
            );
            self.draw_scale(canvas, &sheet);
        })
    }

    fn value(&self, row: usize, column: usize) -> Option<f64> {
        let value = *self.values.get(row)?.get(column)?;
        value.filter(|v| usable(*v))
    }

    fn written(&self, value: f64) -> String {
        match self.format {
            CellFormat::Percent => percent(value),
            CellFormat::Significant(digits) => significant(value, digits.min(6)),
        }
    }

    fn draw_cells(&self, canvas: &Canvas, sheet: &Sheet) {
        let texts =
            (0..self.rows.len()).flat_map(|r| (0..self.columns.len()).filter_map(move |c| self.value(r, c)));
        let widest = texts
            .map(|v| style::TICK.width(&self.written(v)))
            .fold(0.0, f64::max);
        let with_numbers = widest + 8.0 <= sheet.cell_width && sheet.cell_height >= 17.0;
        for row in 0..self.rows.len() {
            for column in 0..self.columns.len() {
                let (x, y) = sheet.corner(row, column);
                let far = (x + sheet.cell_width, y + sheet.cell_height);
                let middle = (x + 0.5 * sheet.cell_width, y + 0.5 * sheet.cell_height);
                let Some(value) = self.value(row, column) else {
                    canvas.text(middle, "–", style::TICK.align(Align::Center).color(style::GREY));
                    continue;
                };
                let color = style::ramp((value - sheet.low) / (sheet.high - sheet.low));
                canvas.rect((x, y), far, color, 1.0);
                if with_numbers {
                    let ink = if color.lightness() > 0.52 {
                        style::INK
                    } else {
                        style::WHITE
                    };
                    let lettering = style::TICK.align(Align::Center).color(ink);
                    canvas.text(middle, &self.written(value), lettering);
                }
            }
        }
        let gap = Stroke::solid(style::WHITE, if sheet.cell_height >= 12.0 { 1.4 } else { 0.4 });
        for row in 1..self.rows.len() {
            let (x, y) = sheet.corner(row, 0);
            canvas.line((x, y), (sheet.right, y), gap);
        }
        for column in 1..self.columns.len() {
            let (x, y) = sheet.corner(0, column);
            canvas.line((x, y), (x, sheet.bottom), gap);
        }
        let corners = [
            (sheet.left, sheet.top),
            (sheet.right, sheet.top),
            (sheet.right, sheet.bottom),
            (sheet.left, sheet.bottom),
            (sheet.left, sheet.top),
        ];
        canvas.polyline(&corners, style::FRAME);
    }

    fn draw_names(&self, canvas: &Canvas, sheet: &Sheet, flat: bool) {
        // Where cells are smaller than letters, every second, third, … name.
        let every = (15.0 / sheet.cell_height).ceil() as usize;
        for (row, name) in self.rows.iter().enumerate().step_by(every.max(1)) {
            let (x, y) = sheet.corner(row, 0);
            let name = style::TICK.fit(name, 300.0);
            canvas.text(
                (x - 9.0, y + 0.5 * sheet.cell_height),
                &name,
                style::TICK.align(Align::Right),
            );
        }
        let every = if flat {
            1
        } else {
            (15.0 / sheet.cell_width).ceil() as usize
        };
        for (column, name) in self.columns.iter().enumerate().step_by(every.max(1)) {
            let (x, _) = sheet.corner(0, column);
            let middle = x + 0.5 * sheet.cell_width;
            if flat {
                canvas.text(
                    (middle, sheet.bottom + 17.0),
                    name,
                    style::TICK.align(Align::Center),
                );
            } else {
                let name = style::TICK.fit(name, 150.0);
                let lettering = style::TICK.align(Align::Right).upright();
                canvas.text((middle, sheet.bottom + 9.0), &name, lettering);
            }
        }
    }

    fn draw_scale(&self, canvas: &Canvas, sheet: &Sheet) {
        let (x, width) = (sheet.right + 46.0, 22.0);
        let length = (sheet.bottom - sheet.top).clamp(180.0, 460.0);
        let steps = 120;
        for i in 0..steps {
            let share = f64::from(i) / f64::from(steps);
            let y = sheet.top + length * (1.0 - share);
            // Each stripe reaches a pixel into the one below, or rounding would leave white seams.
            let foot = (y + 1.0).min(sheet.top + length);
            let head = y - length / f64::from(steps);
            canvas.rect((x, head), (x + width, foot), style::ramp(share), 1.0);
        }
        let corners = [
            (x, sheet.top),
            (x + width, sheet.top),
            (x + width, sheet.top + length),
            (x, sheet.top + length),
            (x, sheet.top),
        ];
        canvas.polyline(&corners, style::FRAME);
        let unit = if self.format == CellFormat::Percent {
            100.0
        } else {
            1.0
        };
        let axis = Axis::linear("", (sheet.low * unit, sheet.high * unit), 6);
        for tick in &axis.ticks {
            let Some(share) = axis.fraction(tick.at) else {
                continue;
            };
            let y = sheet.top + length * (1.0 - share);
            canvas.line((x + width, y), (x + width + 5.0, y), style::FRAME);
            let value = match self.format {
                CellFormat::Percent => format!("{} %", significant(tick.at, 3).trim_end_matches(".0")),
                CellFormat::Significant(digits) => significant(tick.at, digits.clamp(2, 6)),
            };
            canvas.text((x + width + 9.0, y), &value, style::TICK);
        }
        let title = style::AXIS.fit(&self.value_label, length);
        let middle = (x - 15.0, sheet.top + 0.5 * length);
        canvas.text(middle, &title, style::AXIS.align(Align::Center).upright());
    }
}

struct Sheet {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
    cell_width: f64,
    cell_height: f64,
    low: f64,
    high: f64,
}

impl Sheet {
    fn corner(&self, row: usize, column: usize) -> (f64, f64) {
        (
            self.left + self.cell_width * column as f64,
            self.top + self.cell_height * row as f64,
        )
    }
}
