//! Stability lobes: the depth of cut that is just stable, over spindle speed.

use crate::Result;
use crate::report::figure::dynamics::frf::or;
use crate::report::figure::sheet::axis::{FigureAxis, extent, usable};
use crate::report::figure::sheet::canvas::{
    Align, Canvas, Color, Marker, Stroke, WIDTH, nothing_to_draw, paint,
};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::report::number::significant;
use crate::statistics::quantile;

#[derive(Debug, Clone, Default)]
pub struct LobeTrace {
    pub label: String,
    pub spindle_rpm: Vec<f64>,
    /// None where no limit exists at that speed.
    pub depth_limit_mm: Vec<Option<f64>>,
    /// The limit before effects were added to the model, at the same speeds; empty where there is none.
    pub before_mm: Vec<Option<f64>>,
    /// Lower and upper quantile of the limit at the same speeds.
    pub band_mm: Option<[Vec<Option<f64>>; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LobeOutcome {
    Stable,
    Chatter,
    /// Where to cut.
    Recommended,
    /// The tip of a lobe; nobody has said that it is wise to cut there.
    Tip,
}

#[derive(Debug, Clone)]
pub struct LobeMarker {
    pub spindle_rpm: f64,
    pub depth_mm: f64,
    pub outcome: LobeOutcome,
    /// Written next to the sign; may be empty.
    pub label: String,
}

/// One frame of the figure.
#[derive(Debug, Clone, Default)]
pub struct LobePanel {
    /// Written into the frame where there are several.
    pub name: String,
    pub curves: Vec<LobeTrace>,
    pub markers: Vec<LobeMarker>,
    /// The depth below which every speed is stable.
    pub absolute_limit_mm: Option<f64>,
}

#[derive(Debug, Clone, Default)]
pub struct LobesFigure {
    pub title: String,
    /// Above each other, over the same speeds.
    pub panels: Vec<LobePanel>,
    /// Top of the depth axis; chosen from the curves if None.
    pub depth_cap_mm: Option<f64>,
}

pub(crate) const BEFORE: Stroke = Stroke::dashed(style::GREY, 1.9, &[9.0, 5.0]);
pub(crate) const BAND: Color = Color(198, 216, 232);
/// Above the limit.
pub(crate) const UNSTABLE: Color = Color(251, 232, 226);
const ALONE: f64 = 470.0;
const STACKED: f64 = 290.0;
const BETWEEN: f64 = 26.0;

impl LobeTrace {
    fn over_speed<'a>(&'a self, depths: &'a [Option<f64>]) -> impl Iterator<Item = (f64, f64)> + 'a {
        let depths = depths.iter().map(|d| d.unwrap_or(f64::NAN));
        self.spindle_rpm.iter().copied().zip(depths)
    }

    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.over_speed(&self.depth_limit_mm)
    }
}

impl LobePanel {
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let points = self.curves.iter().flat_map(LobeTrace::points);
        points.filter(|(x, y)| usable(*x) && usable(*y))
    }

    fn usable_markers(&self) -> impl Iterator<Item = &LobeMarker> {
        let markers = self.markers.iter();
        markers.filter(|m| usable(m.spindle_rpm) && usable(m.depth_mm))
    }

    /// None where there is nothing to see.
    pub(crate) fn deepest(&self) -> Option<f64> {
        let markers = self.usable_markers().map(|m| m.depth_mm);
        extent(self.points().map(|p| p.1).chain(markers)).map(|(_, deepest)| deepest)
    }

    /// High enough to see the pockets, low enough to see the limit: single sharp peaks run out at the top.
    pub(crate) fn cap(&self, deepest: f64) -> f64 {
        let deepest_marker = self.usable_markers().map(|m| m.depth_mm).fold(0.0, f64::max);
        let depths = || {
            let depths = self.curves.iter().flat_map(LobeTrace::points).map(|p| p.1);
            depths.filter(|d| usable(*d))
        };
        let low = quantile(depths(), 0.05).unwrap_or(0.0).max(0.0);
        let most = quantile(depths(), 0.9).unwrap_or(deepest);
        let chosen = most.max(4.0 * low).max(1.1 * deepest_marker);
        let chosen = chosen.max(1.5 * self.absolute_limit_mm.filter(|l| usable(*l)).unwrap_or(0.0));
        let chosen = chosen.min(deepest.max(deepest_marker));
        if chosen > 0.0 { chosen } else { 1.0 }
    }

    fn draw(&self, canvas: &Canvas, panel: &Panel) {
        if let [curve] = &self.curves[..] {
            shade(
                canvas,
                panel,
                (&curve.spindle_rpm, &curve.depth_limit_mm, &[]),
                UNSTABLE,
            );
        }
        for curve in &self.curves {
            if let Some([lower, upper]) = &curve.band_mm {
                shade(canvas, panel, (&curve.spindle_rpm, lower, upper), BAND);
            }
        }
        panel.grid(canvas);
        if let Some(limit) = self.absolute_limit_mm {
            let ends = [(panel.x.low, limit), (panel.x.high, limit)];
            panel.curve(canvas, ends, style::LEVEL);
        }
        for (i, curve) in self.curves.iter().enumerate() {
            let stroke = style::series(i);
            panel.curve(canvas, curve.over_speed(&curve.before_mm), BEFORE);
            panel.curve(canvas, curve.points(), stroke);
            if curve.points().filter(|(_, depth)| usable(*depth)).count() == 1 {
                panel.markers(canvas, curve.points(), (Marker::Disc, 7.0), stroke.color, 0.0);
            }
        }
        for marker in &self.markers {
            let (sign, size, color) = sign(marker.outcome);
            let at = [(marker.spindle_rpm, marker.depth_mm)];
            // A white edge sets the sign off from the curves.
            panel.markers(canvas, at, (sign, size + 3.0), style::WHITE, 0.0);
            panel.markers(canvas, at, (sign, size), color, 0.0);
            let place = panel.place(marker.spindle_rpm, marker.depth_mm);
            if let Some((x, y)) = place.filter(|p| !marker.label.is_empty() && p.1 >= panel.top) {
                let left = x > 0.9 * panel.right;
                let (x, align) = if left {
                    (x - 10.0, Align::Right)
                } else {
                    (x + 10.0, Align::Left)
                };
                canvas.text((x, y), &marker.label, style::LEGEND.align(align));
            }
        }
        panel.frame(canvas);
    }
}

/// The area between two limits. An upper limit that is not there runs out at the top.
fn shade(
    canvas: &Canvas,
    panel: &Panel,
    (rpm, lower, upper): (&[f64], &[Option<f64>], &[Option<f64>]),
    color: Color,
) {
    let place = |i: usize, limits: &[Option<f64>]| {
        let limit = limits.get(i).copied().flatten();
        let y = limit.and_then(|l| panel.y_at(l)).unwrap_or(panel.top);
        Some((panel.x_at(*rpm.get(i)?)?, y.clamp(panel.top, panel.bottom)))
    };
    for i in 1..rpm.len() {
        let corners = (|| {
            Some([
                place(i - 1, lower)?,
                place(i, lower)?,
                place(i, upper)?,
                place(i - 1, upper)?,
            ])
        })();
        if let Some(corners) = corners
            && corners
                .iter()
                .all(|(x, _)| *x >= panel.left - 0.5 && *x <= panel.right + 0.5)
        {
            canvas.polygon(&corners, color, 1.0);
        }
    }
}

impl LobesFigure {
    /// The end of the depth axis of every frame.
    pub(crate) fn cap(&self) -> f64 {
        let panels = self.panels.iter().filter_map(|p| Some(p.cap(p.deepest()?)));
        panels.fold(0.0, f64::max)
    }

    /// The speeds that were looked at, 1/min: the frame ends there, as beyond them white would look like stable.
    pub(crate) fn speeds(&self) -> Option<(f64, f64)> {
        let curves = self.panels.iter().flat_map(|p| &p.curves);
        let markers = self.panels.iter().flat_map(LobePanel::usable_markers);
        let everywhere = curves.flat_map(|c| c.spindle_rpm.iter().copied());
        extent(everywhere.chain(markers.map(|m| m.spindle_rpm)))
    }

    /// # Errors
    /// No curve or marker with a finite depth.
    pub fn png(&self) -> Result<Vec<u8>> {
        let panels = || self.panels.iter().filter_map(|p| Some((p, p.deepest()?)));
        let speeds = self.speeds();
        let count = panels().count();
        let (Some(speeds), true) = (speeds, count > 0) else {
            return Err(nothing_to_draw(&self.title, "no curve has a finite depth limit"));
        };
        let asked = self.depth_cap_mm.filter(|c| usable(*c) && *c > 0.0);
        // One scale for all: which posture bears more must be seen.
        let cap = asked.unwrap_or_else(|| self.cap());
        let caps = vec![cap; count];
        let axes: Vec<FigureAxis> = caps
            .iter()
            .map(|cap| FigureAxis::from_zero("Depth limit (mm)", (0.0, *cap), if count > 1 { 5 } else { 7 }))
            .collect();
        let left = Panel::left_margin(&axes.iter().collect::<Vec<_>>());
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let header = FigureHeader::new(&self.title, &self.legend(), left, right);
        let (height, between) = if count > 1 {
            (STACKED, BETWEEN)
        } else {
            (ALONE, 0.0)
        };
        let first = header.bottom() + 14.0;
        let speed = FigureAxis::linear("Spindle speed (rpm)", speeds, 10);
        let frames = Panel::stack(&speed, axes, [left, right], first, height, between);
        let bottom = frames.last().map_or(first, |p| p.bottom);
        paint(WIDTH, (bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            for (((panel, deepest), frame), cap) in panels().zip(&frames).zip(&caps) {
                panel.draw(canvas, frame);
                let above = frame.top - 10.0;
                if count > 1 {
                    canvas.text((frame.left, above), &panel.name, style::AXIS);
                }
                if panel.points().any(|(_, depth)| depth > 1.06 * cap) {
                    let note = format!("peaks reach up to {} mm", significant(deepest, 3));
                    canvas.text((right, above), &note, style::NOTE.align(Align::Right));
                }
            }
        })
    }

    fn legend(&self) -> Vec<(Swatch, String)> {
        let curves = || self.panels.iter().flat_map(|p| &p.curves);
        // All panels alike are explained once.
        let widest = self.panels.iter().max_by_key(|p| p.curves.len());
        let drawn = widest
            .into_iter()
            .flat_map(|p| &p.curves)
            .enumerate()
            .map(|(i, curve)| {
                let name = or(&curve.label, "depth limit").to_owned();
                (Swatch::Line(style::series(i)), name)
            });
        let before = curves().any(|c| !c.before_mm.is_empty());
        let before = before.then(|| (Swatch::Line(BEFORE), "before the effects were added".to_owned()));
        let band = curves().any(|c| c.band_mm.is_some());
        let band = band.then(|| {
            (
                Swatch::Area(BAND, 1.0),
                "5 to 95 % by the model's uncertainty".to_owned(),
            )
        });
        let unstable = self.panels.iter().any(|p| p.curves.len() == 1);
        let unstable = unstable.then(|| (Swatch::Area(UNSTABLE, 1.0), "unstable".to_owned()));
        let limits: Vec<f64> = self
            .panels
            .iter()
            .filter_map(|p| p.absolute_limit_mm.filter(|l| usable(*l)))
            .collect();
        let limit = (!limits.is_empty()).then(|| {
            let name = match &limits[..] {
                [one] => format!("absolute limit {} mm", significant(*one, 3)),
                _ => "absolute limit".to_owned(),
            };
            (Swatch::Line(style::LEVEL), name)
        });
        let outcomes = [
            (LobeOutcome::Stable, "stable cut"),
            (LobeOutcome::Chatter, "cut with chatter"),
            (LobeOutcome::Recommended, "recommended"),
            (LobeOutcome::Tip, "deepest tips"),
        ];
        let present = outcomes.into_iter().filter(|(o, _)| {
            let mut markers = self.panels.iter().flat_map(|p| &p.markers);
            markers.any(|m| m.outcome == *o)
        });
        let signs = present.map(|(outcome, name)| {
            let (marker, size, color) = sign(outcome);
            (Swatch::Sign(marker, size, color), name.to_owned())
        });
        drawn
            .chain(before)
            .chain(band)
            .chain(unstable)
            .chain(limit)
            .chain(signs)
            .collect()
    }
}

pub(crate) fn sign(outcome: LobeOutcome) -> (Marker, f64, Color) {
    match outcome {
        LobeOutcome::Stable => (Marker::Disc, 11.0, style::INK),
        LobeOutcome::Chatter => (Marker::Cross, 12.0, style::RED),
        LobeOutcome::Recommended | LobeOutcome::Tip => (Marker::Diamond, 13.0, style::INK),
    }
}
