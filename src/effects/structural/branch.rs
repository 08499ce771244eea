//! What effects share that hang a mass on a spring.

use crate::effects::Size;
use crate::effects::structural::DataSummary;
use crate::parameter::Parameter;
use crate::robot::Dual;

/// mass_kg, frequency_hz, damping_ratio of a mass on a spring.
pub fn parameters(data: &DataSummary, mass_kg: f64, frequency_hz: f64) -> Vec<Parameter> {
    // A resonance outside the measured band is a stiffness or a mass, not a resonance: other effects are that.
    let band = [0.7 * data.lowest_hz, 1.6 * data.highest_hz];
    vec![
        Parameter::logarithmic("mass_kg", "kg", mass_kg, 1.5, [0.02, 300.0]),
        Parameter::logarithmic(
            "frequency_hz",
            "Hz",
            frequency_hz.clamp(band[0], band[1]),
            2.0,
            band,
        ),
        Parameter::logarithmic("damping_ratio", "1", 0.03, 1.0, [5e-4, 0.6]),
    ]
}

/// Why a mass on a spring that hangs on a body of `body_kg` cannot be as fitted.
pub fn impossible(body_kg: f64, sizes: &[Size]) -> Option<String> {
    /// Share of the body's mass from which on something resonates that people would find.
    const LEAST: f64 = 3e-3;
    let [mass, _, damping] = sizes else { return None };
    let light = mass.outside(
        "a resonating mass",
        [LEAST * body_kg, body_kg],
        (1.0, "kg"),
        "it hangs on a body of which it should be 0.3 % at least, and not more than all of it",
    );
    light.or_else(|| {
        damping.outside(
            "a damping ratio",
            [5e-4, 0.3],
            (1.0, "of critical"),
            "cable packs and covers reach 0.1, rubber mounts 0.2",
        )
    })
}

/// One starting point for each peak of the residual and for each of a few frequencies between.
pub fn starts(data: &DataSummary, peaks_hz: &[f64], mass_kg: f64) -> Vec<Vec<f64>> {
    const BETWEEN: usize = 5;
    let ratio = data.highest_hz / data.lowest_hz;
    let between = (1..BETWEEN).map(|i| data.lowest_hz * ratio.powf(i as f64 / BETWEEN as f64));
    peaks_hz
        .iter()
        .copied()
        .chain(between)
        // A faint branch is found from a small mass only, a heavy one from a large.
        .flat_map(|f| [1.0, 0.05].map(|share| vec![share * mass_kg, f, 0.04]))
        .collect()
}

/// Spring and damper of a mass with a natural frequency and a damping ratio: k = m ω², c = 2 ζ m ω.
pub fn spring_and_damper(values: &[Dual]) -> (Dual, Dual) {
    let omega = values[1].scale(std::f64::consts::TAU);
    let momentum = &values[0] * &omega;
    let stiffness = &momentum * &omega;
    let damping = (&momentum * &values[2]).scale(2.0);
    (stiffness, damping)
}
