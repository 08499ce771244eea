//! How large a simulated effect is: what its file gives as usual sizes, and how a parameter follows the effect's size.

use crate::effects::usual_size::FollowsSize::{Not, Power, Ratio};
use crate::effects::usual_size::SizeRange::{Either, Log, Times};
use crate::effects::usual_size::{FollowsSize, SizeRange};
use crate::effects::{Domain, Effect};
use crate::parameter::{Parameter, Scale};
use crate::simulate::draw::Draws;

fn usual<D: Domain>(effect: &dyn Effect<D>, parameter: &str) -> (SizeRange, FollowsSize) {
    let name = parameter.split('[').next().unwrap_or(parameter);
    let line = effect.usual_sizes().iter().find(|usual| usual.parameter == name);
    // What has no line of its own is drawn about its nominal value.
    line.map_or((Times(0.7, 1.4), Not), |usual| (usual.range, usual.follows))
}

/// A value of an effect's parameter as a robot may have it, natural units, within the parameter's bounds.
pub fn drawn<D: Domain>(effect: &dyn Effect<D>, parameter: &Parameter, draws: &mut Draws) -> f64 {
    let value = match usual(effect, &parameter.name).0 {
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
pub fn at_size<D: Domain>(effect: &dyn Effect<D>, parameter: &Parameter, value: f64, size: f64) -> f64 {
    let sized = match usual(effect, &parameter.name).1 {
        Power(exponent) => value * size.powf(exponent),
        Ratio => value.powf(size),
        Not => value,
    };
    kept_inside(parameter, sized)
}

/// Whether the parameter follows the size of its effect at all.
pub fn follows_size<D: Domain>(effect: &dyn Effect<D>, parameter: &Parameter) -> bool {
    usual(effect, &parameter.name).1 != Not
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
    use crate::effects::{At, DataSummary, Known, STRUCTURAL};
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
        for effect in STRUCTURAL.into_iter().chain(FOREIGN) {
            let mut names: Vec<String> = Vec::new();
            for parameter in effect.parameters(At::EVERYWHERE, &Known::robot(&irb6640(), data)) {
                let name = parameter.name.split('[').next().unwrap().to_string();
                let known = effect.usual_sizes().iter().any(|usual| usual.parameter == name);
                assert!(known, "{} {name}", effect.id());
                let value = drawn(effect, &parameter, &mut draws);
                for size in [1e-3, 0.3, 1.0, 3.0] {
                    assert!(in_bounds(&parameter, at_size(effect, &parameter, value, size)));
                }
                assert_eq!(at_size(effect, &parameter, value, 1.0), value);
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            assert_eq!(
                names.len(),
                effect.usual_sizes().len(),
                "{}: a line belongs to no parameter",
                effect.id()
            );
        }
    }
}
