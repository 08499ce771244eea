//! The error falling, revision by revision.

use super::axis::{FigureAxis, extent, usable};
use super::canvas::{Align, Lettering, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use super::panel::{FigureHeader, Panel, Swatch};
use super::style;
use crate::Result;
use crate::report::number::{decimals, percent};

#[derive(Debug, Clone, Default)]
pub struct HistoryMark {
    /// Such as `0 baseline` or `1 + link-flexibility`.
    pub label: String,
    /// Error on the data that was fitted, as a ratio.
    pub fit_nrms: f64,
    /// Error on data left out of the fit, as a ratio.
    pub held_out_nrms: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct HistoryFigure {
    pub title: String,
    pub revisions: Vec<HistoryMark>,
    /// No model can do better than this.
    pub noise_floor_nrms: Option<f64>,
}

const FIT: Stroke = Stroke::solid(style::BLUE, 2.2);
const HELD_OUT: Stroke = Stroke::dashed(style::ORANGE, 2.2, &[8.0, 4.0]);

impl HistoryFigure {
    /// # Errors
    /// No finite error, or more than 100 revisions.
    pub fn png(&self) -> Result<Vec<u8>> {
        if self.revisions.len() > 100 {
            return Err(nothing_to_draw(&self.title, "more than 100 revisions"));
        }
        let shown = |value: f64| usable(value) && value >= 0.0;
        let percentages = || {
            let all = self
                .revisions
                .iter()
                .flat_map(|r| [Some(r.fit_nrms), r.held_out_nrms]);
            all.flatten().filter(|v| shown(*v)).map(|v| 100.0 * v)
        };
        let floor = self.noise_floor_nrms.filter(|v| shown(*v)).map(|v| 100.0 * v);
        let Some((_, worst)) = extent(percentages()) else {
            return Err(nothing_to_draw(&self.title, "no revision has a finite error"));
        };
        let best = extent(percentages().chain(floor).filter(|v| *v > 0.0)).map_or(worst, |range| range.0);
        let label = "Error nrms (%)";
        // Over such a span the small errors would lie on the axis.
        let y = match worst > 8.0 * best {
            true => FigureAxis::log(label, (0.7 * best, 1.6 * worst)),
            false => FigureAxis::from_zero(label, (0.0, 1.08 * worst.max(floor.unwrap_or(0.0))), 6),
        };
        let names: Vec<String> = self.revisions.iter().map(|r| r.label.clone()).collect();
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let held_out = self.revisions.iter().any(|r| r.held_out_nrms.is_some_and(shown));
        let mut legend = vec![(
            Swatch::LineAndSign(FIT, Marker::Disc, SIGN),
            "fitted data".to_owned(),
        )];
        if held_out {
            let swatch = Swatch::LineAndSign(HELD_OUT, Marker::Square, SIGN);
            legend.push((swatch, "held-out data".to_owned()));
        }
        if let Some(floor) = floor {
            legend.push((
                Swatch::Line(style::LEVEL),
                format!("noise floor {}", percent(0.01 * floor)),
            ));
        }
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let top = header.bottom();
        let room = (right - left) / names.len().max(1) as f64;
        let wrapped: Vec<Vec<String>> = names
            .iter()
            .map(|n| style::TICK.wrap(n, room - 10.0, 3))
            .collect();
        let flat = room >= 60.0;
        let below = match flat {
            true => 20.0 + 17.0 * wrapped.iter().map(Vec::len).max().unwrap_or(1) as f64,
            false => {
                20.0 + names
                    .iter()
                    .map(|n| style::TICK.width(n))
                    .fold(0.0, f64::max)
                    .min(160.0)
            }
        };
        let x = FigureAxis::categories("", &vec![String::new(); names.len()]);
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 380.0,
            x,
            y,
            x_labels: false,
        };

        paint(WIDTH, (panel.bottom + below) as u32, |canvas| {
            header.draw(canvas);
            panel.grid(canvas);
            if let Some(floor) = floor {
                panel.curve(
                    canvas,
                    [(panel.x.low, floor), (panel.x.high, floor)],
                    style::LEVEL,
                );
            }
            let points = |pick: fn(&HistoryMark) -> Option<f64>| {
                let values = self.revisions.iter().map(move |r| pick(r).filter(|v| shown(*v)));
                values
                    .enumerate()
                    .map(|(i, v)| (i as f64, v.map_or(f64::NAN, |v| 100.0 * v)))
            };
            // A little apart: where both are the same, one would hide the other.
            let beside = |(x, y): (f64, f64)| (x + APART, y);
            let (outside, inside) = (
                points(|r| r.held_out_nrms).map(beside),
                points(|r| Some(r.fit_nrms)),
            );
            panel.curve(canvas, outside.clone(), HELD_OUT);
            panel.curve(canvas, inside.clone(), FIT);
            panel.markers(
                canvas,
                outside.clone(),
                (Marker::Square, SIGN),
                HELD_OUT.color,
                0.0,
            );
            panel.markers(canvas, inside.clone(), (Marker::Disc, SIGN), FIT.color, 0.0);
            // The larger number right above its point, the smaller left below: falling lines leave both free.
            for ((i, inside), (_, outside)) in inside.zip(outside).filter(|_| room >= 48.0) {
                let fit_above = inside > outside || outside.is_nan();
                for (at, value, above, color) in [
                    (i, inside, fit_above, FIT.color),
                    (i + APART, outside, !fit_above, style::INK),
                ] {
                    if let Some((x, y)) = panel.place(at, value) {
                        let text = percent(0.01 * value);
                        let width = style::LEGEND.width(&text);
                        let y = if above {
                            y - 13.0
                        } else {
                            (y + 14.0).min(panel.bottom - 9.0)
                        };
                        let x = if above { x + 8.0 } else { x - 8.0 - width };
                        canvas.rect((x - 2.0, y - 8.0), (x + width + 2.0, y + 8.0), style::WHITE, 0.85);
                        canvas.text(
                            (x, y),
                            &text,
                            Lettering {
                                color,
                                ..style::LEGEND
                            },
                        );
                    }
                }
            }
            for (i, lines) in wrapped.iter().enumerate() {
                let middle = left + room * (i as f64 + 0.5);
                if flat {
                    for (row, line) in lines.iter().enumerate() {
                        let at = (middle, panel.bottom + 20.0 + 17.0 * row as f64);
                        canvas.text(at, line, style::TICK.align(Align::Center));
                    }
                } else {
                    let every = (16.0 / room).ceil() as usize;
                    if i % every.max(1) == 0 {
                        let name = names.get(i).map_or_else(|| decimals(i as f64, 0), Clone::clone);
                        let lettering = style::TICK.align(Align::Right).upright();
                        canvas.text(
                            (middle, panel.bottom + 10.0),
                            &style::TICK.fit(&name, 160.0),
                            lettering,
                        );
                    }
                }
            }
            panel.frame(canvas);
        })
    }
}

const SIGN: f64 = 9.0;
/// From the fitted to the held-out value, in revisions.
const APART: f64 = 0.035;
