//! Magnitude above phase, and the complex plane.

use num_complex::Complex64;
use serde_json::{Value, json};

use super::plot::{Plot, axis, layout, line, number, numbers, sign, stacked, text, with};
use crate::report::figure::sheet::canvas::{Marker, Stroke};
use crate::report::figure::sheet::style;
use crate::report::figure::{FrfCurve, FrfFigure, NyquistFigure};

/// What the pointer says of a magnitude: four digits with an SI prefix.
fn magnitude_hover(unit: &str) -> String {
    format!("%{{x:.2f}} Hz: %{{y:.4s}}{unit}")
}

const PHASE_HOVER: &str = "%{x:.2f} Hz: %{y:.1f}°";

/// Magnitude (log) above phase over frequency; `quantity` such as `Receptance`.
pub fn bode_layout(quantity: &str, unit: &str) -> Value {
    let (quantity, unit) = (text(quantity), text(unit));
    let magnitude = axis(&format!("{quantity} magnitude ({unit})"));
    let magnitude = with(
        magnitude,
        json!({
            "type": "log",
            "exponentformat": "power",
            "dtick": 1,
            "minor": { "dtick": "D2", "gridcolor": "#f1f2f4", "showgrid": true },
        }),
    );
    let phase = with(axis("Phase (°)"), json!({ "tick0": 0, "dtick": 90 }));
    with(
        stacked(axis("Frequency (Hz)"), vec![(magnitude, 2.1), (phase, 1.0)]),
        json!({ "hovermode": "x" }),
    )
}

/// The complex plane with one scale on both axes.
pub fn nyquist_layout(unit: &str) -> Value {
    let unit = text(unit);
    let scale = |name: &str| {
        with(
            axis(&format!("{name} part ({unit})")),
            json!({ "exponentformat": "SI" }),
        )
    };
    let mut layout = layout();
    layout["showlegend"] = json!(false);
    layout["xaxis"] = with(
        scale("Real"),
        json!({ "zeroline": true, "zerolinecolor": "#9aa0a8" }),
    );
    layout["yaxis"] = with(
        scale("Imaginary"),
        json!({ "scaleanchor": "x", "zeroline": true, "zerolinecolor": "#9aa0a8" }),
    );
    layout
}

/// A trace of magnitudes (panel 0) or phases (panel 1) without its numbers.
pub fn bode_trace(label: &str, look: Look, panel: usize, unit: &str) -> Value {
    let hover = match panel {
        0 => magnitude_hover(&text(unit)),
        _ => PHASE_HOVER.to_string(),
    };
    let mut trace = trace(label, look);
    trace["yaxis"] = json!(super::plot::axis_name('y', panel));
    trace["showlegend"] = json!(panel == 0);
    trace["hovertemplate"] = json!(hover);
    trace
}

/// A trace in the complex plane without its numbers; `customdata` are frequencies, Hz.
pub fn nyquist_trace(label: &str, look: Look, unit: &str) -> Value {
    let mut trace = trace(label, look);
    // Between two lines of the spectrum a mode goes along its circle, not along the chord.
    if trace["line"].is_object() {
        trace["line"]["shape"] = json!("spline");
    }
    trace["hovertemplate"] = json!(format!(
        "%{{customdata:.2f}} Hz: %{{x:.4s}} %{{y:+.4s}}i {}",
        text(unit)
    ));
    trace
}

#[derive(Clone, Copy)]
pub enum Look {
    Measured,
    Curve(Stroke),
}

fn trace(label: &str, look: Look) -> Value {
    let mut trace = json!({ "type": "scatter", "name": text(label), "legendgroup": text(label) });
    match look {
        Look::Measured => {
            trace["mode"] = json!("markers");
            trace["marker"] = with(
                sign(Marker::Disc, 4.5, style::MEASURED),
                json!({ "line": { "width": 0 } }),
            );
        }
        Look::Curve(stroke) => {
            trace["mode"] = json!("lines");
            trace["line"] = line(stroke);
        }
    }
    trace
}

impl FrfFigure {
    pub fn plot(&self) -> Plot {
        let lowest = self.lowest_phase();
        let mut data = Vec::new();
        let mut add = |curve: &FrfCurve, otherwise: &str, look: Look| {
            let label = if curve.label.trim().is_empty() {
                otherwise
            } else {
                &curve.label
            };
            let phase: Vec<(f64, f64)> = match look {
                Look::Measured => curve.phases(lowest),
                Look::Curve(_) => curve.phases_of_line(lowest),
            };
            data.push(with(
                bode_trace(label, look, 0, &self.unit),
                json!({
                    "x": numbers(curve.frequency_hz.iter().copied()),
                    "y": numbers(curve.value.iter().map(|v| positive(v.norm()))),
                }),
            ));
            data.push(with(
                bode_trace(label, look, 1, &self.unit),
                json!({ "x": numbers(phase.iter().map(|p| p.0)), "y": numbers(phase.iter().map(|p| p.1)) }),
            ));
        };
        if let Some(measured) = &self.measured {
            add(measured, "measured", Look::Measured);
        }
        for (i, model) in self.models.iter().enumerate() {
            add(model, "model", Look::Curve(style::model(i, self.models.len())));
        }
        if let Some(noise) = &self.noise {
            data.push(with(
                bode_trace(&noise.label, Look::Curve(style::LEVEL), 0, &self.unit),
                json!({
                    "x": numbers(noise.frequency_hz.iter().copied()),
                    "y": numbers(noise.magnitude.iter().map(|v| positive(*v))),
                }),
            ));
        }
        let mut layout = bode_layout(&self.quantity, &self.unit);
        layout["yaxis2"]["range"] = json!([lowest - 15.0, lowest + 375.0]);
        Plot {
            title: self.title.clone(),
            height_px: 620.0,
            data,
            layout,
            ..Plot::default()
        }
    }
}

impl NyquistFigure {
    pub fn plot(&self) -> Plot {
        let measured = self.measured.iter().map(|curve| (curve, Look::Measured));
        let models = self.models.iter().enumerate();
        let models = models.map(|(i, curve)| (curve, Look::Curve(style::model(i, self.models.len()))));
        let data = measured.chain(models).map(|(curve, look)| {
            with(
                nyquist_trace(&curve.label, look, &self.unit),
                json!({
                    "x": numbers(curve.value.iter().map(|v: &Complex64| v.re)),
                    "y": numbers(curve.value.iter().map(|v| v.im)),
                    "customdata": curve.frequency_hz.iter().map(|f| number(*f)).collect::<Value>(),
                }),
            )
        });
        Plot {
            title: self.title.clone(),
            height_px: 620.0,
            data: data.collect(),
            layout: nyquist_layout(&self.unit),
            ..Plot::default()
        }
    }
}

/// What a logarithmic axis can show.
fn positive(value: f64) -> f64 {
    if value > 0.0 { value } else { f64::NAN }
}
