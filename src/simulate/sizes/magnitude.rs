//! How large a simulated effect is: ranges that robots in the literature and the practice campaigns show, and how a
//! parameter follows the effect's size.

use crate::parameter::{Parameter, Scale};
use crate::simulate::draw::Draws;

/// How a value follows the size of the effect (1: as drawn; smaller: weaker).
#[derive(Debug, Clone, Copy, PartialEq)]
enum Follows {
    /// value × size^exponent: +1 for a mass, −1 for a stiffness that an ideal structure has infinite.
    Power(f64),
    /// value^size: a ratio that is 1 where there is no effect.
    Ratio,
    /// Not at all.
    Not,
}

/// Where a value is drawn from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Range {
    /// Uniform on the logarithm.
    Log(f64, f64),
    /// Log-uniform factor on the parameter's nominal value.
    Times(f64, f64),
    /// Uniform between −x and x.
    Either(f64),
}

use Follows::{Not, Power, Ratio};
use Range::{Either, Log, Times};

/// (effect, parameter without list index, range, how it follows the size).
const TABLE: [(&str, &str, Range, Follows); 23] = [
    ("link-flexibility", "young_pa", Log(60e9, 200e9), Power(-1.0)),
    (
        "joint-transverse-compliance",
        "transverse_nm_per_rad",
        Log(1e6, 4e6),
        Power(-1.0),
    ),
    (
        "base-compliance",
        "rocking_nm_per_rad",
        Log(4e6, 1.2e7),
        Power(-1.0),
    ),
    ("tool-flexibility", "mass_kg", Log(2.0, 8.0), Not),
    // Its compliance is 1/(m ω²).
    ("tool-flexibility", "frequency_hz", Log(35.0, 80.0), Power(-0.5)),
    ("tool-flexibility", "damping_ratio", Log(0.015, 0.04), Not),
    ("load-dependent-stiffness", "beta", Log(0.05, 0.2), Power(1.0)),
    ("payload", "mass_kg", Log(10.0, 40.0), Power(1.0)),
    ("local-resonator", "mass_kg", Log(4.0, 12.0), Power(1.0)),
    ("local-resonator", "frequency_hz", Log(8.0, 25.0), Not),
    ("local-resonator", "damping_ratio", Log(0.03, 0.08), Not),
    ("joint-damping", "c_nms_per_rad", Times(0.25, 3.3), Not),
    // All damping sits in the joints.
    ("joint-damping", "common_share", Either(1e-9), Not),
    ("time-delay", "delay_s", Log(2e-4, 1.2e-3), Power(1.0)),
    (
        "sensor-misalignment",
        "rotation_vector_deg",
        Either(9.0),
        Power(1.0),
    ),
    (
        "amplitude-dependent-stiffness",
        "low_level_ratio",
        Log(0.6, 0.9),
        Ratio,
    ),
    (
        "viscoelastic-joints",
        "stiffness_ratio",
        Log(1.5, 4.0),
        Power(-1.0),
    ),
    ("viscoelastic-joints", "relaxation_hz", Log(5.0, 20.0), Not),
    ("base-sliding", "sliding_n_per_m", Log(3e6, 1e7), Power(-1.0)),
    ("cross-axis-leak", "leak", Either(0.15), Power(1.0)),
    ("tool-axial-flexibility", "mass_kg", Log(3.0, 8.0), Not),
    (
        "tool-axial-flexibility",
        "frequency_hz",
        Log(20.0, 60.0),
        Power(-0.5),
    ),
    ("tool-axial-flexibility", "damping_ratio", Log(0.015, 0.04), Not),
];

fn row(effect: &str, parameter: &str) -> (Range, Follows) {
    let name = parameter.split('[').next().unwrap_or(parameter);
    TABLE
        .iter()
        .find(|(e, p, ..)| *e == effect && *p == name)
        // An effect without lines of its own is drawn about its nominal value.
        .map_or((Times(0.7, 1.4), Not), |(_, _, range, follows)| {
            (*range, *follows)
        })
}

/// A value of an effect's parameter as a robot may have it, natural units, within the parameter's bounds.
pub fn drawn(effect: &str, parameter: &Parameter, draws: &mut Draws) -> f64 {
    let value = match row(effect, &parameter.name).0 {
        Log(low, high) => draws.log_uniform(low, high),
        Times(low, high) => parameter.nominal * draws.log_uniform(low, high),
        Either(most) => draws.uniform(-most, most),
    };
    kept_inside(parameter, value)
}

/// A factor from the ends of a logarithmic range: a fit that arrives at an end holds that against the effect, so no
/// truth may stand there.
const MARGIN: f64 = 1.2;

fn kept_inside(parameter: &Parameter, value: f64) -> f64 {
    let [low, high] = parameter.bounds;
    match parameter.scale {
        Scale::Logarithmic => value.clamp(low * MARGIN, high / MARGIN),
        Scale::Linear => value.clamp(low, high),
    }
}

/// The value that belongs to an effect of this size, within the parameter's bounds.
pub fn at_size(effect: &str, parameter: &Parameter, value: f64, size: f64) -> f64 {
    let sized = match row(effect, &parameter.name).1 {
        Power(exponent) => value * size.powf(exponent),
        Ratio => value.powf(size),
        Not => value,
    };
    kept_inside(parameter, sized)
}

/// Whether the parameter follows the size of its effect at all.
pub fn follows_size(effect: &str, parameter: &Parameter) -> bool {
    row(effect, &parameter.name).1 != Not
}

/// A value given by a person, checked.
pub fn in_bounds(parameter: &Parameter, value: f64) -> bool {
    value.is_finite()
        && (parameter.bounds[0]..=parameter.bounds[1]).contains(&value)
        && (parameter.scale == Scale::Linear || value > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{DataSummary, STRUCTURAL};
    use crate::robot::fixture::irb6640;
    use crate::simulate::draw::Purpose;
    use crate::simulate::foreign::FOREIGN;

    /// Every parameter of every effect has a line of its own, and what is drawn is within its bounds at any size.
    #[test]
    fn every_parameter_has_a_range() {
        let data = DataSummary {
            force_levels: 2,
            postures: 6,
            lowest_hz: 3.0,
            highest_hz: 90.0,
        };
        let mut draws = Draws::new(1, Purpose::Effects);
        let mut lines = 0;
        for effect in STRUCTURAL.into_iter().chain(FOREIGN) {
            let mut names: Vec<String> = Vec::new();
            for parameter in effect.parameters(&irb6640(), &data) {
                let name = parameter.name.split('[').next().unwrap().to_string();
                let known = TABLE.iter().any(|(e, p, ..)| *e == effect.id() && *p == name);
                assert!(known, "{} {name}", effect.id());
                let value = drawn(effect.id(), &parameter, &mut draws);
                for size in [1e-3, 0.3, 1.0, 3.0] {
                    assert!(in_bounds(
                        &parameter,
                        at_size(effect.id(), &parameter, value, size)
                    ));
                }
                assert_eq!(at_size(effect.id(), &parameter, value, 1.0), value);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            lines += names.len();
        }
        assert_eq!(lines, TABLE.len(), "a line of the table belongs to no parameter");
    }
}
