//! A table of numbers as coloured cells: where the error sits.

use crate::Result;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{Align, Canvas, Stroke, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::FigureHeader;
use crate::report::figure::sheet::style;
use crate::report::number::{decimals, percent, significant};

/// How cell values are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CellFormat {
    /// A ratio, shown as percent.
    #[default]
    Percent,
    /// So many significant digits, in the unit of `value_label`.
    Significant(usize),
    /// So many digits behind the point: for numbers between 0 and 1 of which the small ones are as good as 0.
    Decimals(usize),
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
    /// What gives the colours where it is not the values, such as their ratio to the noise; for a single table.
    pub shades: Vec<Vec<Option<f64>>>,
    /// What the colours mean, such as `nrms error`.
    pub value_label: String,
    pub format: CellFormat,
    /// Values at the ends of the colour scale; from 0 to the largest value if None.
    pub range: Option<(f64, f64)>,
    /// A logarithmic colour scale; needs a `range` above zero.
    pub log: bool,
    /// Further tables of the same rows and columns, drawn next to the first on the same colour scale.
    pub beside: Vec<Vec<Vec<Option<f64>>>>,
    /// One a table, above it; none needed for a single table.
    pub table_titles: Vec<String>,
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
        let tables: Vec<Cells> = std::iter::once(&self.values)
            .chain(&self.beside)
            .map(|v| Cells(v))
            .collect();
        let Some((low, high)) = self.scale() else {
            return Err(nothing_to_draw(&self.title, "no cell has a finite value"));
        };
        let log = self.log && low > 0.0;

        let widest = self
            .rows
            .iter()
            .map(|name| style::TICK.width(name))
            .fold(0.0, f64::max)
            .min(300.0);
        let left = widest + 58.0;
        let right = f64::from(WIDTH) - 160.0;
        let gaps = GAP * (tables.len() - 1) as f64;
        let table_width = (right - left - gaps) / tables.len() as f64;
        let cell_width = table_width / columns as f64;
        // Few rows are drawn taller, so that the colour scale next to them has room.
        let cell_height = (840.0 / rows as f64)
            .min((190.0 / rows as f64).max(46.0))
            .max(6.0);
        let header = FigureHeader::new(&self.title, &[], left.min(58.0), f64::from(WIDTH) - 30.0);
        let titled = self.table_titles.iter().any(|t| !t.is_empty());
        let top = header.bottom() + if titled { 24.0 } else { 6.0 };
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
            log,
        };
        // The colour scale needs some height, however few rows there are.
        let height = (bottom + below + 40.0).max(top + 250.0);

        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (i, cells) in tables.iter().enumerate() {
                let left = left + (table_width + GAP) * i as f64;
                let sheet = Sheet {
                    left,
                    right: left + table_width,
                    ..sheet
                };
                let shades = if i == 0 { Cells(self.coloured()) } else { *cells };
                self.draw_cells(canvas, &sheet, cells, &shades);
                self.draw_names(canvas, &sheet, flat, i == 0);
                if let Some(title) = self.table_titles.get(i) {
                    let middle = (0.5 * (sheet.left + sheet.right), top - 13.0);
                    let title = style::AXIS.fit(title, table_width);
                    canvas.text(middle, &title, style::AXIS.align(Align::Center));
                }
            }
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

    /// The ends of the colour scale; `None` where no cell has a finite value.
    pub(crate) fn scale(&self) -> Option<(f64, f64)> {
        let (rows, columns) = (self.rows.len(), self.columns.len());
        let cells = |table: &[Vec<Option<f64>>]| extent(Cells(table).all(rows, columns));
        let all: Vec<(f64, f64)> = std::iter::once(self.coloured())
            .chain(self.beside.iter().map(Vec::as_slice))
            .filter_map(cells)
            .collect();
        cells(&self.values).or_else(|| self.beside.iter().find_map(|t| cells(t)))?;
        let least = all.iter().map(|e| e.0).reduce(f64::min)?;
        let largest = all.iter().map(|e| e.1).reduce(f64::max)?;
        let given = self
            .range
            .filter(|(low, high)| usable(*low) && usable(*high) && high > low);
        let (low, high) = given.unwrap_or((least.min(0.0), largest));
        Some((low, if high > low { high } else { low + 1.0 }))
    }

    /// What gives the colours of the first table.
    pub(crate) fn coloured(&self) -> &[Vec<Option<f64>>] {
        match self.shades.is_empty() {
            true => &self.values,
            false => &self.shades,
        }
    }

    /// How the numbers of the colour scale are written.
    pub(crate) fn scale_format(&self) -> CellFormat {
        match self.shades.is_empty() {
            true => self.format,
            false => CellFormat::Significant(2),
        }
    }

    pub(crate) fn written(&self, value: f64) -> String {
        match self.format {
            CellFormat::Percent => percent(value),
            CellFormat::Significant(digits) => significant(value, digits.min(6)),
            CellFormat::Decimals(digits) => decimals(value, digits.min(6)),
        }
    }

    fn draw_cells(&self, canvas: &Canvas, sheet: &Sheet, cells: &Cells, shades: &Cells) {
        let widest = cells
            .all(self.rows.len(), self.columns.len())
            .map(|v| style::TICK.width(&self.written(v)))
            .fold(0.0, f64::max);
        let with_numbers = widest + 8.0 <= sheet.cell_width && sheet.cell_height >= 17.0;
        for row in 0..self.rows.len() {
            for column in 0..self.columns.len() {
                let (x, y) = sheet.corner(row, column);
                let far = (x + sheet.cell_width, y + sheet.cell_height);
                let middle = (x + 0.5 * sheet.cell_width, y + 0.5 * sheet.cell_height);
                let Some(value) = cells.value(row, column) else {
                    canvas.text(middle, "–", style::TICK.align(Align::Center).color(style::GREY));
                    continue;
                };
                let color = match shades.value(row, column) {
                    Some(shade) => style::ramp(sheet.share(shade)),
                    None => style::WHITE,
                };
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

    fn draw_names(&self, canvas: &Canvas, sheet: &Sheet, flat: bool, with_rows: bool) {
        // Where cells are smaller than letters, every second, third, … name.
        let every = (15.0 / sheet.cell_height).ceil() as usize;
        let rows = if with_rows { self.rows.as_slice() } else { &[] };
        for (row, name) in rows.iter().enumerate().step_by(every.max(1)) {
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
        let unit = if self.scale_format() == CellFormat::Percent {
            100.0
        } else {
            1.0
        };
        let ends = (sheet.low * unit, sheet.high * unit);
        let axis = match sheet.log {
            true => FigureAxis::log("", ends),
            false => FigureAxis::linear("", ends, 6),
        };
        for tick in axis.ticks.iter().filter(|t| !sheet.log || !t.label.is_empty()) {
            let share = sheet.share(tick.at / unit);
            if !(-1e-9..=1.0 + 1e-9).contains(&share) {
                continue;
            }
            let y = sheet.top + length * (1.0 - share);
            canvas.line((x + width, y), (x + width + 5.0, y), style::FRAME);
            let value = match self.scale_format() {
                CellFormat::Percent => format!("{} %", significant(tick.at, 3).trim_end_matches(".0")),
                CellFormat::Significant(digits) => significant(tick.at, digits.clamp(2, 6)),
                CellFormat::Decimals(digits) => decimals(tick.at, digits.min(6)),
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
    log: bool,
}

/// Between two tables.
const GAP: f64 = 18.0;

/// A table of values.
#[derive(Clone, Copy)]
struct Cells<'a>(&'a [Vec<Option<f64>>]);

impl Cells<'_> {
    fn value(&self, row: usize, column: usize) -> Option<f64> {
        let value = *self.0.get(row)?.get(column)?;
        value.filter(|v| usable(*v))
    }

    fn all(&self, rows: usize, columns: usize) -> impl Iterator<Item = f64> + '_ {
        (0..rows).flat_map(move |r| (0..columns).filter_map(move |c| self.value(r, c)))
    }
}

impl Sheet {
    /// Place on the colour scale; 0 and 1 are its ends.
    fn share(&self, value: f64) -> f64 {
        match self.log {
            true => (value.max(f64::MIN_POSITIVE) / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        }
    }

    fn corner(&self, row: usize, column: usize) -> (f64, f64) {
        (
            self.left + self.cell_width * column as f64,
            self.top + self.cell_height * row as f64,
        )
    }
}
