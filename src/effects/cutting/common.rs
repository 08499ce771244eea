//! What several effects on cutting forces share: parameters in short, reasons why data cannot show them.

use super::{CuttingSummary, Mixing};
use crate::data::Process;
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::Dual;

/// Unit matrix.
pub(super) fn unit_mixing() -> Mixing {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| Dual::constant(f64::from(u8::from(i == j)))))
}

pub(super) fn linear(
    name: impl Into<String>,
    unit: &'static str,
    nominal: f64,
    std: f64,
    mean: f64,
    bounds: [f64; 2],
) -> Parameter {
    Parameter {
        name: name.into(),
        unit,
        scale: Scale::Linear,
        nominal,
        prior: Some(Prior { mean, std }),
        bounds,
    }
}

pub(super) fn logarithmic(
    name: impl Into<String>,
    unit: &'static str,
    nominal: f64,
    std: f64,
    bounds: [f64; 2],
) -> Parameter {
    Parameter {
        name: name.into(),
        unit,
        scale: Scale::Logarithmic,
        nominal,
        prior: Some(Prior {
            mean: nominal.ln(),
            std,
        }),
        bounds,
    }
}

pub(super) fn milling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Milling)
        .then(|| "milling only: it shows in the waveform over a revolution".to_string())
}

pub(super) fn straight_edge_only(data: &CuttingSummary) -> Option<String> {
    (data.process == Process::Milling && !data.straight_edge).then(|| {
        "not worked out for an edge that is not straight (corner_radius_mm, lead_angle_deg of [tool])"
            .to_string()
    })
}

pub(super) fn drilling_only(data: &CuttingSummary) -> Option<String> {
    (data.process != Process::Drilling).then(|| "drilling only".to_string())
}
