//! Stabilisation diagram: poles over the model order, on top of the sum of the measured FRFs.

use crate::Result;
use crate::modal::stabilisation::Stability;
use crate::report::figure::sheet::axis::{FigureAxis, extent, positive_extent, usable};
use crate::report::figure::sheet::canvas::{Color, Marker, Stroke, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;

/// One pole of one order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StabilisationPole {
    pub frequency_hz: f64,
    pub order: usize,
    /// How far it agrees with the order below.
    pub stability: Stability,
}

#[derive(Debug, Clone, Default)]
pub struct StabilisationFigure {
    pub title: String,
    pub poles: Vec<StabilisationPole>,
    /// Modes that were taken, Hz.
    pub chosen_hz: Vec<f64>,
    /// Frequency and size (any unit) of the measurement, drawn behind on a log scale.
    pub measured: Vec<(f64, f64)>,
}

/// Sign of each degree of agreement; drawn in this order, so that the best lie on top.
const SIGNS: [(Stability, Marker, f64, Color, &str); 4] = [
    (Stability::New, Marker::Ring, 3.0, style::GREY, "new at its order"),
    (
        Stability::Frequency,
        Marker::Cross,
        5.0,
        style::ORANGE,
        "same frequency as at the order below",
    ),
    (
        Stability::Damping,
        Marker::Diamond,
        4.5,
        style::PALE_BLUE,
        "and damping",
    ),
    (Stability::Full, Marker::Disc, 4.0, style::BLUE, "and shape"),
];

/// Share of its frequency within which a mode's stable poles lie.
const NEAR: f64 = 0.01;
/// A mode that no stable pole speaks for.
const UNSUPPORTED: Stroke = Stroke::dashed(style::RED, 1.6, &[7.0, 4.0]);

impl StabilisationFigure {
    /// Whether a pole that agrees with the order below in frequency and damping lies at `frequency_hz`.
    fn has_pole_at(&self, frequency_hz: f64) -> bool {
        let stable = |p: &&StabilisationPole| matches!(p.stability, Stability::Damping | Stability::Full);
        let mut poles = self.poles.iter().filter(stable);
        poles.any(|p| (p.frequency_hz - frequency_hz).abs() <= NEAR * frequency_hz)
    }

    /// # Errors
    /// No pole with a finite frequency.
    pub fn png(&self) -> Result<Vec<u8>> {
        let frequencies = self
            .measured
            .iter()
            .map(|m| m.0)
            .chain(self.poles.iter().map(|p| p.frequency_hz));
        let orders = self.poles.iter().map(|p| p.order as f64);
        let (Some(frequencies), Some((_, highest))) =
            (extent(frequencies.filter(|f| usable(*f))), extent(orders))
        else {
            return Err(nothing_to_draw(&self.title, "no poles"));
        };
        let x = FigureAxis::linear("Frequency (Hz)", frequencies, 10);
        let y = FigureAxis::from_zero("Model order", (0.0, highest), 8);
        let left = Panel::left_margin(&[&y]);
        let right = f64::from(WIDTH) - 40.0;
        let mut legend: Vec<(Swatch, String)> = SIGNS
            .iter()
            .map(|(_, marker, size, color, what)| (Swatch::Sign(*marker, *size, *color), (*what).to_string()))
            .collect();
        legend.push((
            Swatch::Line(style::LEVEL),
            "modes taken; behind: sum of the FRFs (log)".to_string(),
        ));
        if self.chosen_hz.iter().any(|f| !self.has_pole_at(*f)) {
            legend.push((
                Swatch::Line(UNSUPPORTED),
                "modes taken without a stable pole".to_string(),
            ));
        }
        let header = FigureHeader::new(&self.title, &legend, left, right);
        let top = header.bottom();
        let panel = Panel {
            left,
            top,
            right,
            bottom: top + 520.0,
            x,
            y,
            x_labels: true,
        };
        // The measurement's own log scale, mapped to the orders' axis.
        let sizes = positive_extent(self.measured.iter().map(|m| m.1));
        let behind = sizes.map(|(low, high)| {
            let (low, span) = (low.ln(), (high / low).ln().max(1e-9));
            let top = panel.y.high;
            self.measured
                .iter()
                .filter(|m| m.1 > 0.0)
                .map(|m| (m.0, top * (m.1.ln() - low) / span))
                .collect::<Vec<_>>()
        });
        paint(WIDTH, (panel.bottom + Panel::BOTTOM_MARGIN) as u32, |canvas| {
            header.draw(canvas);
            panel.grid(canvas);
            if let Some(points) = behind {
                panel.curve(canvas, points, style::FRAME);
            }
            for f in &self.chosen_hz {
                let stroke = if self.has_pole_at(*f) {
                    style::LEVEL
                } else {
                    UNSUPPORTED
                };
                panel.curve(canvas, [(*f, 0.0), (*f, panel.y.high)], stroke);
            }
            for (stability, marker, size, color, _) in SIGNS {
                let points = self.poles.iter().filter(|p| p.stability == stability);
                panel.markers(
                    canvas,
                    points.map(|p| (p.frequency_hz, p.order as f64)),
                    (marker, size),
                    color,
                    size,
                );
            }
            panel.frame(canvas);
        })
    }
}
