//! FRFs that lie in two real arrays: real and imaginary part, or magnitude and phase.

use num_complex::Complex64;

use crate::ingest::formats::mat::variable::{MIN_AXIS, Variable};
use crate::ingest::text::Notes;

/// Words in the names of the two parts; the rest of the names is the same.
const CARTESIAN: [[&str; 2]; 3] = [["real", "imag"], ["realpart", "imagpart"], ["re", "im"]];
const POLAR: [[&str; 2]; 8] = [
    ["magnitude", "phase"],
    ["mag", "phase"],
    ["amplitude", "phase"],
    ["amp", "phase"],
    ["abs", "phase"],
    ["mag", "ph"],
    ["mag", "ang"],
    ["abs", "ang"],
];
/// What may stand behind the word of a phase.
const PHASE_UNITS: [&str; 6] = ["", "_deg", "deg", "_rad", "rad", "le"];
/// A phase beyond this is in degrees: 2π and a bit.
const MOST_RADIANS: f64 = 7.0;
/// A phase that changes by less, in whatever unit, is none.
const LEAST_TURN: f64 = 1.0;

/// Two real arrays of one size whose names differ by such a word only become one complex array.
pub(super) fn join_pairs(variables: &mut Vec<Variable>, notes: &mut Notes) {
    let words = CARTESIAN
        .iter()
        .map(|w| (w, false))
        .chain(POLAR.iter().map(|w| (w, true)));
    for ([first, second], is_polar) in words {
        while let Some((a, b)) = pair(variables, first, second, is_polar) {
            let other = variables.remove(b);
            let one = &mut variables[if b < a { a - 1 } else { a }];
            let told = if is_polar {
                let named = other.own_name().to_lowercase();
                let degrees = match (named.contains("deg"), named.contains("rad")) {
                    (true, _) => true,
                    (_, true) => false,
                    _ => beyond_radians(&other.re),
                };
                let joined = polar(&one.re, &other.re, degrees);
                one.re = joined.iter().map(|z| z.re).collect();
                one.im = Some(joined.iter().map(|z| z.im).collect());
                format!("magnitude, with the phase of {} in {}", other.name, unit(degrees))
            } else {
                one.im = Some(other.re);
                format!("the real part, with the imaginary part {}", other.name)
            };
            notes.about(&one.name, told);
        }
    }
}

/// The arrays of such a pair: the one with the first word in its name, and the one with the second in its place.
fn pair(variables: &[Variable], first: &str, second: &str, is_polar: bool) -> Option<(usize, usize)> {
    let is_part = |v: &Variable| v.im.is_none() && v.re.len() >= MIN_AXIS;
    let name = |v: &Variable| v.name.to_lowercase();
    for (a, one) in variables.iter().enumerate().filter(|(_, v)| is_part(v)) {
        let Some(at) = name(one).rfind(first) else {
            continue;
        };
        if is_polar && one.re.iter().any(|m| *m < 0.0) {
            continue;
        }
        let with = |unit: &str| {
            let mut wanted = name(one);
            wanted.replace_range(at..at + first.len(), &format!("{second}{unit}"));
            wanted
        };
        let units = if is_polar {
            &PHASE_UNITS[..]
        } else {
            &PHASE_UNITS[..1]
        };
        let other = units.iter().find_map(|unit| {
            let wanted = with(unit);
            variables
                .iter()
                .position(|v| is_part(v) && v.size == one.size && name(v) == wanted)
        });
        if let Some(b) = other {
            return Some((a, b));
        }
    }
    None
}

/// Are two columns magnitude and phase (the real part of an FRF has both signs), and the phase in degrees?
pub(super) fn in_degrees(magnitude: &[f64], phase: &[f64]) -> Option<bool> {
    let (least, greatest) = crate::signal::least_and_greatest(phase);
    let is_polar = magnitude.iter().all(|m| *m >= 0.0) && least < 0.0 && greatest - least > LEAST_TURN;
    is_polar.then(|| beyond_radians(phase))
}

fn beyond_radians(phase: &[f64]) -> bool {
    phase.iter().any(|p| p.abs() > MOST_RADIANS)
}

pub(super) fn polar(magnitude: &[f64], phase: &[f64], degrees: bool) -> Vec<Complex64> {
    let factor = if degrees {
        std::f64::consts::PI / 180.0
    } else {
        1.0
    };
    magnitude
        .iter()
        .zip(phase)
        .map(|(m, p)| Complex64::from_polar(*m, factor * p))
        .collect()
}

pub(super) fn unit(degrees: bool) -> &'static str {
    if degrees { "degrees" } else { "radians" }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn real(name: &str, values: impl Fn(Complex64) -> f64) -> Variable {
        let frf =
            (0..40).map(|k| Complex64::from_polar(1.0 + 0.1 * f64::from(k % 7), 1.0 - 0.1 * f64::from(k)));
        Variable {
            name: name.into(),
            size: vec![40, 1],
            re: frf.map(values).collect(),
            im: None,
        }
    }

    #[test]
    fn two_real_arrays_become_one_complex_array() {
        let degrees = |z: Complex64| z.arg().to_degrees();
        let pairs: [[Variable; 2]; 5] = [
            [real("H_re", |z| z.re), real("H_im", |z| z.im)],
            [real("data.Real", |z| z.re), real("data.Imag", |z| z.im)],
            [real("mag", |z| z.norm()), real("phase", |z| z.arg())],
            [
                real("FRF_Magnitude", |z| z.norm()),
                real("FRF_Phase_deg", degrees),
            ],
            [real("Hmag", |z| z.norm()), real("Hangle", degrees)],
        ];
        let expected = real("", |z| z.re).re;
        for pair in pairs {
            let mut variables = vec![real("f", |z| z.re), pair[1].clone(), pair[0].clone()];
            let mut notes = Notes::default();
            join_pairs(&mut variables, &mut notes);
            assert_eq!(variables.len(), 2, "{}", pair[0].name);
            let joined = &variables[1];
            let apart = joined.re.iter().zip(&expected).map(|(a, b)| (a - b).abs());
            assert!(
                apart.fold(0.0, f64::max) < 1e-12 && joined.im.is_some(),
                "{}",
                pair[0].name
            );
        }
        // No partner, or no magnitude.
        let mut alone = vec![
            real("pressure", |z| z.re),
            real("mag", |z| z.re),
            real("phase", |z| z.arg()),
        ];
        join_pairs(&mut alone, &mut Notes::default());
        assert_eq!(alone.len(), 3);
    }

    #[test]
    fn columns_of_magnitude_and_phase_are_told_from_parts() {
        let (re, im) = (real("", |z| z.re).re, real("", |z| z.im).re);
        assert_eq!(in_degrees(&re, &im), None);
        let (magnitude, phase) = (real("", |z| z.norm()).re, real("", |z| z.arg()).re);
        assert_eq!(in_degrees(&magnitude, &phase), Some(false));
        let degrees: Vec<f64> = phase.iter().map(|p| p.to_degrees()).collect();
        assert_eq!(in_degrees(&magnitude, &degrees), Some(true));
    }
}
