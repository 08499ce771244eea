//! Magnitude and phase of one FRF: measurement, models, noise.

use num_complex::Complex64;

use super::axis::{Axis, extent, positive_extent, quantile, usable};
use super::canvas::{Marker, paint};
use super::panel::{Header, Panel, Swatch};
use super::{WIDTH, nothing_to_draw, style};
use crate::Result;
use crate::report::number::decimals;

/// One curve over its own frequency grid; both vectors of the same length.
#[derive(Debug, Clone, Default)]
pub struct FrfCurve {
    pub label: String,
    pub frequency_hz: Vec<f64>,
    pub value: Vec<Complex64>,
}

impl FrfCurve {
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, Complex64)> + '_ {
        self.frequency_hz.iter().copied().zip(self.value.iter().copied())
    }

    pub(super) fn is_empty(&self) -> bool {
        !self
            .points()
            .any(|(f, v)| usable(f) && usable(v.re) && usable(v.im))
    }
}

/// The level below which the measurement says nothing, in the unit of the FRF.
#[derive(Debug, Clone, Default)]
pub struct NoiseLevel {
    pub label: String,
    pub frequency_hz: Vec<f64>,
    pub magnitude: Vec<f64>,
}

/// Measured against model, magnitude (log) above phase.
#[derive(Debug, Clone, Default)]
pub struct FrfFigure {
    pub title: String,
    /// What the values are, such as `Receptance`.
    pub quantity: String,
    /// Unit of the values, such as `m/N`.
    pub unit: String,
    pub measured: Option<FrfCurve>,
    /// In the order of their making: the last one is drawn as the one that counts.
    pub models: Vec<FrfCurve>,
    pub noise: Option<NoiseLevel>,
}

impl FrfFigure {
    /// # Errors
    /// No finite, nonzero value in any curve.
    pub fn png(&self) -> Result<Vec<u8>> {
        let curves: Vec<&FrfCurve> = self
            .measured
            .iter()
            .chain(&self.models)
            .filter(|c| !c.is_empty())
            .collect();
        let frequencies = curves
            .iter()
            .flat_map(|c| c.points())
            .filter(|(_, v)| usable(v.norm()));
        let frequencies = extent(frequencies.map(|(f, _)| f));
        let magnitudes = || {
            curves
                .iter()
                .flat_map(|c| c.points())
                .map(|(_, v)| v.norm())
                .filter(|v| *v > 0.0)
        };
        let (Some(frequencies), Some((low, high))) = (frequencies, positive_extent(magnitudes())) else {
            return Err(nothing_to_draw(
                &self.title,
                "no curve has a finite value other than zero",
            ));
        };
        // A few exact near-zeros must not press the peaks into the upper edge.
        let low = quantile(magnitudes(), 0.002)
            .map_or(low, |q| low.max(q / 30.0))
            .min(high);
        let noise = self
            .noise
            .as_ref()
            .filter(|n| n.magnitude.iter().any(|v| usable(*v) && *v > 0.0));
        let noise_low = noise.and_then(|n| positive_extent(n.magnitude.iter().copied()));
        let low = noise_low.map_or(low, |(n, _)| low.min((0.6 * n).max(high * 1e-6)));

        let left_title = format!(
            "{} magnitude ({})",
            or(&self.quantity, "FRF"),
            or(&self.unit, "–")
        );
        let magnitude = Axis::log(&left_title, (low, high));
        let phase = Axis::linear("Phase (°)", (-195.0, 195.0), 4)
            .with_ticks(&[-180.0, -90.0, 0.0, 90.0, 180.0], |v| decimals(v, 0));
        let frequency = Axis::linear("Frequency (Hz)", frequencies, 10);

        let left = Panel::left_margin(&[&magnitude, &phase]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let header = Header::new(&self.title, &self.legend(noise.is_some()), left, right);
        let top = header.bottom();
        let upper = Panel {
            left,
            top,
            right,
            bottom: top + 380.0,
            x: frequency.clone(),
            y: magnitude,
            x_labels: false,
        };
        let lower = Panel {
            left,
            top: top + 400.0,
            right,
            bottom: top + 580.0,
            x: frequency,
            y: phase,
            x_labels: true,
        };
        let height = lower.bottom + Panel::BOTTOM_MARGIN;

        paint(WIDTH, height as u32, |canvas| {
            header.draw(canvas);
            upper.grid(canvas);
            lower.grid(canvas);
            if let Some(noise) = noise {
                let points = noise
                    .frequency_hz
                    .iter()
                    .copied()
                    .zip(noise.magnitude.iter().copied());
                upper.curve(canvas, points, style::LEVEL);
            }
            if let Some(measured) = &self.measured {
                let magnitude = measured.points().map(|(f, v)| (f, v.norm()));
                let angle = measured.points().map(|(f, v)| (f, degrees(v)));
                upper.markers(
                    canvas,
                    magnitude,
                    (MEASURED.0, MEASURED.1),
                    style::MEASURED,
                    MEASURED.1,
                );
                lower.markers(
                    canvas,
                    angle,
                    (MEASURED.0, MEASURED.1),
                    style::MEASURED,
                    MEASURED.1,
                );
            }
            for (i, model) in self.models.iter().enumerate() {
                let stroke = style::model(i, self.models.len());
                upper.curve(canvas, model.points().map(|(f, v)| (f, v.norm())), stroke);
                lower.curve(canvas, broken_at_wraps(model), stroke);
            }
            upper.frame(canvas);
            lower.frame(canvas);
        })
    }

    fn legend(&self, noise: bool) -> Vec<(Swatch, String)> {
        let measured = self.measured.iter().map(|m| {
            let sign = Swatch::Sign(MEASURED.0, MEASURED.1, style::MEASURED);
            (sign, or(&m.label, "measured").to_owned())
        });
        let models = self.models.iter().enumerate().map(|(i, m)| {
            (
                Swatch::Line(style::model(i, self.models.len())),
                or(&m.label, "model").to_owned(),
            )
        });
        let level = self.noise.iter().filter(|_| noise);
        let level = level.map(|n| (Swatch::Line(style::LEVEL), or(&n.label, "noise level").to_owned()));
        measured.chain(models).chain(level).collect()
    }
}

pub(super) const MEASURED: (Marker, f64) = (Marker::Disc, 5.0);

pub(super) fn or<'a>(text: &'a str, otherwise: &'a str) -> &'a str {
    if text.trim().is_empty() { otherwise } else { text }
}

fn degrees(value: Complex64) -> f64 {
    if value.norm() > 0.0 {
        value.arg().to_degrees()
    } else {
        f64::NAN
    }
}

/// Phase in degrees with a gap where it jumps from −180° to 180°.
fn broken_at_wraps(curve: &FrfCurve) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = vec![];
    for (frequency, value) in curve.points() {
        let angle = degrees(value);
        if points.last().is_some_and(|last| (angle - last.1).abs() > 180.0) {
            points.push((frequency, f64::NAN));
        }
        points.push((frequency, angle));
    }
    points
}
