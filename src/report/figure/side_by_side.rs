//! Bars in groups: published, measured and computed values of the same things.

use crate::Result;
use crate::report::figure::dynamics::frf::or;
use crate::report::figure::sheet::axis::{FigureAxis, extent, positive_extent, usable};
use crate::report::figure::sheet::canvas::{Align, Canvas, Marker, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::report::number::significant;

#[derive(Debug, Clone, Default)]
pub struct BarSeries {
    pub label: String,
    /// One a group; None where there is no value.
    pub values: Vec<Option<f64>>,
}

#[derive(Debug, Clone, Default)]
pub struct SideBySide {
    pub title: String,
    /// With unit, such as `Stiffness (N/mm)`.
    pub y_label: String,
    pub groups: Vec<String>,
    pub series: Vec<BarSeries>,
    /// Logarithmic values: zeros and negative ones are then left out.
    pub log: bool,
    /// A level to compare with, and what it is.
    pub level: Option<(String, f64)>,
}

const PLOT_HEIGHT: f64 = 420.0;
/// Diameter of a value on a log axis.
const DOT: f64 = 13.0;

impl SideBySide {
    /// # Errors
    /// No value that the axis can show, or more than 240 bars.
    pub fn png(&self) -> Result<Vec<u8>> {
        let bars = self.groups.len() * self.series.len();
        if bars > 240 {
            return Err(nothing_to_draw(
                &self.title,
                &format!("{bars} bars cannot be told apart (240 at most)"),
            ));
        }
        let count = self.groups.len();
        let values = || {
            self.series
                .iter()
                .flat_map(|s| s.values.iter().take(count))
                .filter_map(|v| *v)
        };
        let level = self
            .level
            .as_ref()
            .filter(|(_, v)| usable(*v) && (*v > 0.0 || !self.log));
        let shown = || values().chain(level.map(|(_, v)| *v));
        // Numbers stand above their bars: lying if all of them fit, else upright, with room for the highest.
        let bar = Self::bar_width(f64::from(WIDTH) - 130.0, count, self.series.len());
        let longest = values()
            .map(|v| style::NOTE.width(&significant(v, 3)))
            .fold(0.0, f64::max);
        let lying = longest <= bar - 3.0;
        let headroom = if lying { 24.0 } else { longest + 14.0 } / PLOT_HEIGHT;
        let y = match self.log {
            true => positive_extent(shown()).map(|(low, high)| {
                let low = 0.7 * low;
                FigureAxis::log(
                    &self.y_label,
                    (
                        low,
                        high * (high / low).powf(headroom / (1.0 - headroom)).min(1e6),
                    ),
                )
            }),
            false => extent(shown()).map(|(low, high)| {
                let room = headroom * (high.max(0.0) - low.min(0.0));
                let (low, high) = (
                    if low < 0.0 { low - room } else { low },
                    if high > 0.0 { high + room } else { high },
                );
                FigureAxis::from_zero(&self.y_label, (low, high), 7)
            }),
        };
        let Some(y) = y else {
            return Err(nothing_to_draw(&self.title, "no value that its axis can show"));
        };

        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let room = (right - left) / count.max(1) as f64;
        let names: Vec<Vec<String>> = self
            .groups
            .iter()
            .map(|g| style::TICK.wrap(g, room - 8.0, 3))
            .collect();
        let flat = room >= 44.0;
        let legend = self.series.iter().enumerate().map(|(i, series)| {
            (
                Swatch::Sign(Marker::Disc, 6.5, style::bar(i)),
                or(&series.label, "series").to_owned(),
            )
        });
        let level_legend = level.map(|(name, _)| (Swatch::Line(style::LEVEL), name.clone()));
        let header = FigureHeader::new(
            &self.title,
            &legend.chain(level_legend).collect::<Vec<_>>(),
            left,
            right,
        );
        let top = header.bottom();
        let below = match flat {
            true => 20.0 + 17.0 * names.iter().map(Vec::len).max().unwrap_or(1) as f64,
            false => {
                20.0 + self
                    .groups
                    .iter()
                    .map(|g| style::TICK.width(g))
                    .fold(0.0, f64::max)
                    .min(150.0)
            }
        };
        let x = FigureAxis::categories("", &vec![String::new(); count]);
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + PLOT_HEIGHT,
            x,
            y,
            x_labels: false,
        };

        paint(WIDTH, (panel.bottom + below) as u32, |canvas| {
            header.draw(canvas);
            let rows = panel
                .y
                .ticks
                .iter()
                .filter_map(|tick| Some((panel.y_at(tick.at)?, style::grid(tick))));
            for (at, stroke) in rows {
                canvas.line((left, at), (right, at), stroke);
            }
            // Below the numbers, which it would strike through.
            if let Some(at) = level.and_then(|(_, v)| panel.y_at(*v)) {
                canvas.line((left, at), (right, at), style::LEVEL);
            }
            for group in 0..count {
                self.draw_group(canvas, &panel, group, lying);
            }
            for (group, lines) in names.iter().enumerate() {
                let middle = left + room * (group as f64 + 0.5);
                if flat {
                    for (i, line) in lines.iter().enumerate() {
                        let at = (middle, panel.bottom + 20.0 + 17.0 * i as f64);
                        canvas.text(at, line, style::TICK.align(Align::Center));
                    }
                } else if let Some(name) = self.groups.get(group) {
                    let name = style::TICK.fit(name, 150.0);
                    let lettering = style::TICK.align(Align::Right).upright();
                    canvas.text((middle, panel.bottom + 10.0), &name, lettering);
                }
            }
            panel.frame(canvas);
        })
    }

    fn bar_width(room: f64, groups: usize, series: usize) -> f64 {
        (0.8 * room / (groups * series).max(1) as f64).min(64.0)
    }

    fn draw_group(&self, canvas: &Canvas, panel: &Panel, group: usize, lying: bool) {
        let room = (panel.right - panel.left) / self.groups.len().max(1) as f64;
        let width = Self::bar_width(panel.right - panel.left, self.groups.len(), self.series.len());
        let first = panel.left + room * (group as f64 + 0.5) - 0.5 * width * self.series.len() as f64;
        for (i, series) in self.series.iter().enumerate() {
            let x = first + width * i as f64;
            let middle = x + 0.5 * width;
            let value = series.values.get(group).copied().flatten().filter(|v| usable(*v));
            let value = value.filter(|v| *v > 0.0 || !self.log);
            let Some((value, end)) = value.and_then(|v| Some((v, panel.y_at(v)?))) else {
                canvas.text(
                    (middle, panel.bottom - 10.0),
                    "–",
                    style::AXIS.bold().align(Align::Center),
                );
                continue;
            };
            let foot = panel.y_at(0.0).filter(|_| !self.log);
            let foot = foot.unwrap_or(panel.bottom).clamp(panel.top, panel.bottom);
            let number = significant(value, 3);
            let above = if end <= foot { -1.0 } else { 1.0 };
            let mut end = end;
            if self.log {
                // A log axis has no zero that a bar could stand on.
                canvas.marker((middle, end), Marker::Disc, DOT, style::INK);
                canvas.marker((middle, end), Marker::Disc, DOT - 3.0, style::bar(i));
                end += above * 0.5 * DOT;
            } else {
                canvas.rect((x + 0.5, foot), (x + width - 0.5, end), style::bar(i), 1.0);
            }
            if lying {
                let at = (middle, end + above * 10.0);
                let half = 0.5 * style::NOTE.width(&number) + 1.0;
                canvas.rect(
                    (at.0 - half, at.1 - 7.0),
                    (at.0 + half, at.1 + 7.0),
                    style::WHITE,
                    0.85,
                );
                let lettering = style::NOTE.align(Align::Center).color(style::INK);
                canvas.text(at, &number, lettering);
            } else if width >= 13.0 {
                let lettering = style::NOTE.align(if above < 0.0 { Align::Left } else { Align::Right });
                canvas.text(
                    (middle, end + above * 5.0),
                    &number,
                    lettering.upright().color(style::INK),
                );
            }
        }
    }
}
