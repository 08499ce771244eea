//! Stability lobes: the depth of cut that is just stable, over spindle speed.

use super::axis::{Axis, extent, quantile, usable};
use super::canvas::{Align, Color, Marker, paint};
use super::frf::or;
use super::panel::{Header, Panel, Swatch};
use super::{WIDTH, nothing_to_draw, style};
use crate::Result;
use crate::report::number::significant;

#[derive(Debug, Clone, Default)]
pub struct LobeCurve {
    pub label: String,
    pub spindle_rpm: Vec<f64>,
    /// None where no limit exists at that speed.
    pub depth_limit_mm: Vec<Option<f64>>,
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

#[derive(Debug, Clone, Copy)]
pub struct LobeMarker {
    pub spindle_rpm: f64,
    pub depth_mm: f64,
    pub outcome: LobeOutcome,
}

#[derive(Debug, Clone, Default)]
pub struct LobesFigure {
    pub title: String,
    pub curves: Vec<LobeCurve>,
    /// The depth below which every speed is stable.
    pub absolute_limit_mm: Option<f64>,
    pub markers: Vec<LobeMarker>,
    /// Top of the depth axis; chosen from the curves if None.
    pub depth_cap_mm: Option<f64>,
}

impl LobeCurve {
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let depths = self.depth_limit_mm.iter().map(|d| d.unwrap_or(f64::NAN));
        self.spindle_rpm.iter().copied().zip(depths)
    }
}

impl LobesFigure {
    /// # Errors
    /// No curve or marker with a finite depth.
    pub fn png(&self) -> Result<Vec<u8>> {
        let points = || {
            self.curves
                .iter()
                .flat_map(LobeCurve::points)
                .filter(|(x, y)| usable(*x) && usable(*y))
        };
        let markers = || {
            self.markers
                .iter()
                .filter(|m| usable(m.spindle_rpm) && usable(m.depth_mm))
        };
        let everywhere = self.curves.iter().flat_map(|c| c.spindle_rpm.iter().copied());
        let speeds = extent(everywhere.chain(markers().map(|m| m.spindle_rpm)));
        let depths = extent(points().map(|p| p.1).chain(markers().map(|m| m.depth_mm)));
        let (Some(speeds), Some((_, deepest))) = (speeds, depths) else {
            return Err(nothing_to_draw(&self.title, "no curve has a finite depth limit"));
        };
        let cap = self.cap(deepest, markers().map(|m| m.depth_mm).fold(0.0, f64::max));
        let cut_off = points().any(|(_, depth)| depth > 1.06 * cap);

        let x = Axis::linear("Spindle speed (rpm)", speeds, 10);
        let y = Axis::from_zero("Depth limit (mm)", (0.0, cap), 7);
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let header = Header::new(&self.title, &self.legend(), left, right);
        let top = header.bottom() + if cut_off { 14.0 } else { 0.0 };
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 470.0,
            x,
            y,
            x_labels: true,
        };

        paint(WIDTH, (panel.bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            panel.grid(canvas);
            if let Some(limit) = self.absolute_limit_mm {
                panel.curve(
                    canvas,
                    [(panel.x.low, limit), (panel.x.high, limit)],
                    style::LEVEL,
                );
            }
            for (i, curve) in self.curves.iter().enumerate() {
                let stroke = style::series(i);
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
            }
            panel.frame(canvas);
            if cut_off {
                let note = format!("peaks reach up to {} mm", significant(deepest, 3));
                canvas.text((right, top - 10.0), &note, style::NOTE.align(Align::Right));
            }
        })
    }

    /// High enough to see the pockets, low enough to see the limit: single sharp peaks run out at the top.
    fn cap(&self, deepest: f64, deepest_marker: f64) -> f64 {
        if let Some(cap) = self.depth_cap_mm.filter(|c| usable(*c) && *c > 0.0) {
            return cap;
        }
        let depths = || self.curves.iter().flat_map(LobeCurve::points).map(|p| p.1);
        let low = quantile(depths(), 0.05).unwrap_or(0.0).max(0.0);
        let most = quantile(depths(), 0.9).unwrap_or(deepest);
        let chosen = most.max(4.0 * low).max(1.1 * deepest_marker);
        let chosen = chosen.max(1.5 * self.absolute_limit_mm.filter(|l| usable(*l)).unwrap_or(0.0));
        let chosen = chosen.min(deepest.max(deepest_marker));
        if chosen > 0.0 { chosen } else { 1.0 }
    }

    fn legend(&self) -> Vec<(Swatch, String)> {
        let curves = self.curves.iter().enumerate().map(|(i, curve)| {
            (
                Swatch::Line(style::series(i)),
                or(&curve.label, "depth limit").to_owned(),
            )
        });
        let limit = self.absolute_limit_mm.filter(|l| usable(*l)).map(|limit| {
            let name = format!("absolute limit {} mm", significant(limit, 3));
            (Swatch::Line(style::LEVEL), name)
        });
        let outcomes = [
            (LobeOutcome::Stable, "stable cut"),
            (LobeOutcome::Chatter, "cut with chatter"),
            (LobeOutcome::Recommended, "recommended"),
            (LobeOutcome::Tip, "deepest tips"),
        ];
        let present = outcomes
            .into_iter()
            .filter(|(o, _)| self.markers.iter().any(|m| m.outcome == *o));
        let signs = present.map(|(outcome, name)| {
            let (marker, size, color) = sign(outcome);
            (Swatch::Sign(marker, size, color), name.to_owned())
        });
        curves.chain(limit).chain(signs).collect()
    }
}

fn sign(outcome: LobeOutcome) -> (Marker, f64, Color) {
    match outcome {
        LobeOutcome::Stable => (Marker::Ring, 11.0, style::INK),
        LobeOutcome::Chatter => (Marker::Cross, 11.0, style::RED),
        LobeOutcome::Recommended | LobeOutcome::Tip => (Marker::Diamond, 13.0, style::INK),
    }
}
