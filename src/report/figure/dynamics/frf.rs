//! Magnitude and phase of one FRF: measurement, models, noise.

use num_complex::Complex64;

use crate::Result;
use crate::report::figure::sheet::axis::{FigureAxis, extent, positive_extent, usable};
use crate::report::figure::sheet::canvas::{Marker, WIDTH, nothing_to_draw, paint};
use crate::report::figure::sheet::panel::{FigureHeader, Panel, Swatch};
use crate::report::figure::sheet::style;
use crate::report::number::decimals;
use crate::statistics::quantile;

/// One curve over its own frequency grid; both vectors of the same length.
#[derive(Debug, Clone, Default)]
pub struct FrfCurve {
    pub label: String,
    pub frequency_hz: Vec<f64>,
    pub value: Vec<Complex64>,
}

impl FrfCurve {
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, Complex64)> + '_ {
        self.frequency_hz.iter().copied().zip(self.value.iter().copied())
    }

    /// Frequency, Hz, and phase, degrees, from `lowest` to `lowest` + 360°.
    pub(crate) fn phases(&self, lowest: f64) -> Vec<(f64, f64)> {
        self.points().map(|(f, v)| (f, degrees(v, lowest))).collect()
    }

    /// The same for a line, with a gap where it would jump from one end of the range to the other.
    pub(crate) fn phases_of_line(&self, lowest: f64) -> Vec<(f64, f64)> {
        broken_at_wraps(self, lowest)
    }

    pub(crate) fn is_empty(&self) -> bool {
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
        let low = quantile(magnitudes().filter(|v| usable(*v)), 0.002)
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
        let magnitude = FigureAxis::log(&left_title, (low, high));
        let lowest = lowest_phase(&curves);
        let ticks = [0.0, 90.0, 180.0, 270.0, 360.0].map(|a| lowest + a);
        let phase = FigureAxis::linear("Phase (°)", (lowest - 15.0, lowest + 375.0), 4)
            .with_ticks(&ticks, |v| decimals(v, 0));
        let frequency = FigureAxis::linear("Frequency (Hz)", frequencies, 10);

        let left = Panel::left_margin(&[&magnitude, &phase]);
        let right = f64::from(WIDTH) - Panel::RIGHT_MARGIN;
        let header = FigureHeader::new(&self.title, &self.legend(noise.is_some()), left, right);
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
                let angle = measured.points().map(|(f, v)| (f, degrees(v, lowest)));
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
                lower.curve(canvas, broken_at_wraps(model, lowest), stroke);
            }
            upper.frame(canvas);
            lower.frame(canvas);
        })
    }

    /// Where the phase axis begins, degrees.
    pub(crate) fn lowest_phase(&self) -> f64 {
        lowest_phase(&self.measured.iter().chain(&self.models).collect::<Vec<_>>())
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

pub(crate) const MEASURED: (Marker, f64) = (Marker::Disc, 5.0);

pub(crate) fn or<'a>(text: &'a str, otherwise: &'a str) -> &'a str {
    if text.trim().is_empty() { otherwise } else { text }
}

/// Phase of `value` in `lowest` … `lowest` + 360°.
fn degrees(value: Complex64, lowest: f64) -> f64 {
    if value.norm() > 0.0 {
        lowest + (value.arg().to_degrees() - lowest).rem_euclid(360.0)
    } else {
        f64::NAN
    }
}

/// Where the phase axis begins: a measured phase around ±180° must not jump between both edges of the figure.
pub(crate) fn lowest_phase(curves: &[&FrfCurve]) -> f64 {
    let jumps = |lowest: f64| -> usize {
        let of = |curve: &&FrfCurve| {
            let angles: Vec<f64> = curve.points().map(|(_, v)| degrees(v, lowest)).collect();
            angles
                .windows(2)
                .filter(|pair| (pair[1] - pair[0]).abs() > 180.0)
                .count()
        };
        curves.iter().map(of).sum()
    };
    if jumps(-270.0) < jumps(-180.0) {
        -270.0
    } else {
        -180.0
    }
}

/// Phase in degrees with a gap where it jumps from one end of its range to the other.
fn broken_at_wraps(curve: &FrfCurve, lowest: f64) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = vec![];
    for (frequency, value) in curve.points() {
        let angle = degrees(value, lowest);
        if points.last().is_some_and(|last| (angle - last.1).abs() > 180.0) {
            points.push((frequency, f64::NAN));
        }
        points.push((frequency, angle));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_phase_around_180_degrees_does_not_jump_between_the_edges() {
        let curve = |angles: &[f64]| FrfCurve {
            frequency_hz: (1..=angles.len()).map(|k| k as f64).collect(),
            value: angles
                .iter()
                .map(|a| Complex64::from_polar(1e-6, a.to_radians()))
                .collect(),
            ..FrfCurve::default()
        };
        let beyond_resonance = curve(&[0.0, -90.0, -179.0, 179.0, -178.0, 178.0]);
        assert_eq!(lowest_phase(&[&beyond_resonance]), -270.0);
        assert!(
            broken_at_wraps(&beyond_resonance, -270.0)
                .iter()
                .all(|p| p.1.is_finite())
        );
        assert_eq!(lowest_phase(&[&curve(&[0.0, 90.0, 178.0, 91.0])]), -180.0);
    }
}
