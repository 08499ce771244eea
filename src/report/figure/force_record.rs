//! A dynamometer record: raw signal, drift, air segments and the window that was averaged.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Canvas, Color, Stroke, WIDTH, nothing_to_draw, paint};
use super::frf::or;
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;

/// One channel, evenly sampled.
#[derive(Debug, Clone, Default)]
pub struct ForceTrace {
    /// Such as `Fx`.
    pub label: String,
    pub unit: String,
    pub start_s: f64,
    pub sample_interval_s: f64,
    pub samples: Vec<f64>,
    /// (time in s, level in `unit`): the drift that was taken off, as a line through these points.
    pub drift: Vec<(f64, f64)>,
    /// Average over the steady window on the scale of the raw signal (drift included).
    pub steady_level: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct ForceRecord {
    pub title: String,
    pub channels: Vec<ForceTrace>,
    /// Where the tool cut nothing: (from, to) in s.
    pub air_s: Vec<(f64, f64)>,
    /// The window that was averaged: (from, to) in s.
    pub steady_s: Option<(f64, f64)>,
}

pub(crate) const ENVELOPE: Color = Color(112, 128, 146);
pub(crate) const DRIFT: Stroke = Stroke::dashed(style::RED, 2.0, &[9.0, 4.0]);
pub(crate) const LEVEL: Stroke = Stroke::solid(style::INK, 2.2);
pub(crate) const AIR: (Color, f64) = (style::PALE_BLUE, 0.34);
pub(crate) const STEADY: (Color, f64) = (style::PALE_GREEN, 0.55);

impl ForceRecord {
    /// # Errors
    /// No channel with a finite sample and a positive sample interval, or more than 12 of them.
    pub fn png(&self) -> Result<Vec<u8>> {
        let channels: Vec<&ForceTrace> = self.channels.iter().filter(|c| c.is_drawable()).collect();
        if channels.is_empty() || channels.len() > 12 {
            let what = "1 to 12 channels with finite samples at a positive sample interval are needed";
            return Err(nothing_to_draw(&self.title, what));
        }
        let ends = channels.iter().flat_map(|c| {
            [
                c.start_s,
                c.start_s + c.sample_interval_s * c.samples.len() as f64,
            ]
        });
        let Some(times) = extent(ends) else {
            return Err(nothing_to_draw(&self.title, "no usable time axis"));
        };
        let time = FigureAxis::linear("Time (s)", times, 10);
        let forces: Vec<FigureAxis> = channels.iter().map(|c| c.axis()).collect();

        let left = Panel::left_margin(&forces.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let header = FigureHeader::new(&self.title, &self.legend(&channels), left, right);
        let each = if channels.len() <= 4 { 190.0 } else { 140.0 };
        let panels = Panel::stack(&time, forces, [left, right], header.bottom(), each, 16.0);
        let bottom = panels.last().map_or(header.bottom(), |p| p.bottom);
        let height = bottom + Panel::BOTTOM_MARGIN;

        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            for (panel, channel) in panels.iter().zip(&channels) {
                for air in &self.air_s {
                    panel.band(canvas, *air, AIR.0, AIR.1);
                }
                if let Some(steady) = self.steady_s {
                    panel.band(canvas, steady, STEADY.0, STEADY.1);
                }
                panel.grid(canvas);
                channel.draw(canvas, panel);
                panel.curve(canvas, channel.drift.iter().copied(), DRIFT);
                if let (Some(level), Some((from, to))) = (channel.steady_level, self.steady_s) {
                    panel.curve(canvas, [(from, level), (to, level)], LEVEL);
                }
                panel.frame(canvas);
            }
        })
    }

    fn legend(&self, channels: &[&ForceTrace]) -> Vec<(Swatch, String)> {
        let entries = [
            (
                true,
                Swatch::Area(ENVELOPE, 1.0),
                "recorded (smallest to largest)",
            ),
            (
                channels.iter().any(|c| !c.drift.is_empty()),
                Swatch::Line(DRIFT),
                "drift taken off",
            ),
            (!self.air_s.is_empty(), Swatch::Area(AIR.0, AIR.1), "air cut"),
            (
                self.steady_s.is_some(),
                Swatch::Area(STEADY.0, STEADY.1),
                "steady window",
            ),
            (
                self.steady_s.is_some() && channels.iter().any(|c| c.steady_level.is_some()),
                Swatch::Line(LEVEL),
                "average in the window",
            ),
        ];
        let present = entries.into_iter().filter(|(present, ..)| *present);
        present
            .map(|(_, swatch, name)| (swatch, name.to_owned()))
            .collect()
    }
}

impl ForceTrace {
    fn is_drawable(&self) -> bool {
        let timed = usable(self.start_s) && usable(self.sample_interval_s) && self.sample_interval_s > 0.0;
        timed && self.samples.iter().any(|v| usable(*v))
    }

    fn axis(&self) -> FigureAxis {
        let label = format!("{} ({})", or(&self.label, "force"), or(&self.unit, "–"));
        let levels = self.drift.iter().map(|d| d.1).chain(self.steady_level);
        let range = extent(self.samples.iter().copied().chain(levels)).unwrap_or((0.0, 0.0));
        FigureAxis::padded(&label, range, 0.06, 4)
    }

    /// One bar a pixel column from the smallest to the largest sample in it; a plain line where samples are few.
    fn draw(&self, canvas: &Canvas, panel: &Panel) {
        let time = |i: usize| self.start_s + self.sample_interval_s * i as f64;
        let columns = (panel.right - panel.left) as usize;
        if self.samples.len() < 2 * columns {
            let points = self.samples.iter().enumerate().map(|(i, v)| (time(i), *v));
            panel.curve(canvas, points.clone(), Stroke::solid(ENVELOPE, 1.4));
            if self.samples.len() < 3 {
                let sign = (super::canvas::Marker::Disc, 6.0);
                panel.markers(canvas, points, sign, ENVELOPE, 0.0);
            }
            return;
        }
        let mut ranges: Vec<Option<(f64, f64)>> = vec![None; columns];
        for (i, value) in self.samples.iter().enumerate() {
            let Some(x) = panel.x_at(time(i)).filter(|_| usable(*value)) else {
                continue;
            };
            let column = ((x - panel.left).max(0.0) as usize).min(columns.saturating_sub(1));
            if let Some(range) = ranges.get_mut(column) {
                let (low, high) = range.unwrap_or((*value, *value));
                *range = Some((low.min(*value), high.max(*value)));
            }
        }
        for (column, range) in ranges.iter().enumerate() {
            let Some((low, high)) = *range else { continue };
            let (Some(bottom), Some(top)) = (panel.y_at(low), panel.y_at(high)) else {
                continue;
            };
            let x = panel.left + column as f64;
            canvas.rect((x, top.min(bottom - 1.2)), (x + 1.0, bottom), ENVELOPE, 1.0);
        }
    }
}
