//! Which channel comes late: a delay turns the modal constants of a channel the further the higher the mode.
//!
//! Modal constants of a structure are real, of either sign, but for a little complexity. A channel that is late by τ has
//! them turned by −ωτ, which no damping of a structure does to all modes alike.

use std::f64::consts::TAU;

use num_complex::Complex64;

/// Delay of a response against the force of one FRF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delay {
    /// Positive: the response comes late.
    pub seconds: f64,
    /// Its standard deviation, s.
    pub std_s: f64,
}

/// Usual phase of a modal constant that noise does not explain (mode complexity), radians.
const COMPLEXITY: f64 = 0.1;
/// Modes that must be seen, and how well: |constant| over its standard deviation.
const MODES: usize = 3;
const SEEN: f64 = 4.0;
/// The delay must explain so much of Σ(sin φ/σ)², and leave no more than this a mode.
const EXPLAINS: f64 = 16.0;
const LEFT: f64 = 4.0;
/// Steps of the search in a quarter period of the highest mode.
const STEPS: i32 = 400;
/// So many modes tell delays of so many quarter periods; fewer would agree with several.
const MANY_MODES: usize = 5;
const MANY_QUARTERS: i32 = 8;

/// Delay from the modes of one FRF: frequency, Hz, constant and its standard deviation. `None` where too few modes are
/// seen, none is needed, or another one would do as well. Delays up to a quarter period of the highest mode are found, with five modes
/// and more up to two periods.
pub fn delay(modes: &[(f64, Complex64, f64)]) -> Option<Delay> {
    let seen: Vec<(f64, f64, f64)> = modes
        .iter()
        .filter(|(f, c, std)| *f > 0.0 && c.norm() > SEEN * std && c.norm() > 0.0)
        .map(|(f, c, std)| (TAU * f, c.arg(), (std / c.norm()).hypot(COMPLEXITY)))
        .collect();
    if seen.len() < MODES {
        return None;
    }
    let highest = seen.iter().map(|s| s.0).fold(0.0, f64::max);
    let cost = |tau: f64| -> f64 {
        let each = seen
            .iter()
            .map(|(w, phase, std)| ((phase + w * tau).sin() / std).powi(2));
        each.sum()
    };
    let step = 0.25 * TAU / highest / f64::from(STEPS);
    let quarters = if seen.len() < MANY_MODES { 1 } else { MANY_QUARTERS };
    let tried: Vec<(i32, f64)> = (-quarters * STEPS..=quarters * STEPS)
        .map(|k| (k, cost(f64::from(k) * step)))
        .collect();
    let (at, left) = tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let best = f64::from(at) * step;
    let alone = tried
        .iter()
        .all(|(k, other)| (k - at).abs() <= STEPS || other - left > EXPLAINS);
    // Curvature of the sum of squares at its minimum.
    let information: f64 = seen.iter().map(|(w, _, std)| (w / std).powi(2)).sum();
    let needed = cost(0.0) - left > EXPLAINS;
    let fits = left < LEFT * (seen.len() - 1) as f64;
    let inside = at.abs() < quarters * STEPS - 1;
    (needed && fits && inside && alone).then(|| Delay {
        seconds: best,
        std_s: (1.0 / information).sqrt(),
    })
}

/// What the delays of the FRFs of a set say in words: the response (or the force, where all are alike) that is late.
/// `delays`: by FRF, response's name and delay where there is one.
pub fn in_words(delays: &[(String, Option<Delay>)]) -> Option<String> {
    let known: Vec<(&str, Delay)> = delays
        .iter()
        .filter_map(|(name, d)| Some((name.as_str(), (*d)?)))
        .collect();
    if known.is_empty() {
        return None;
    }
    let values: Vec<f64> = known.iter().map(|k| k.1.seconds).collect();
    let middle = crate::signal::median(&values);
    let alike = known
        .iter()
        .filter(|(_, d)| (d.seconds - middle).abs() < (4.0 * d.std_s).max(0.2 * middle.abs()))
        .count();
    let ms = |s: f64| format!("{:.3} ms", 1e3 * s.abs());
    // All the same: the force, which they share.
    if delays.len() > 1 && alike == delays.len() {
        return Some(match middle > 0.0 {
            true => format!(
                "all responses come {} after the force: the force channel leads (other filter or sampling)",
                ms(middle)
            ),
            false => format!(
                "the force channel comes {} late: all responses lead it (other filter or sampling)",
                ms(middle)
            ),
        });
    }
    let mut names: Vec<String> = known
        .iter()
        .map(|(name, d)| {
            let what = if d.seconds > 0.0 { "late" } else { "early" };
            format!("{name} {what} by {} ± {}", ms(d.seconds), ms(d.std_s))
        })
        .collect();
    names.dedup();
    let more = names.len().saturating_sub(6);
    names.truncate(6);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    Some(format!(
        "responses out of time with the force (the phase of their modes grows with frequency): {}{more}",
        names.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn modes(tau: f64, turn: f64) -> Vec<(f64, Complex64, f64)> {
        [(8.0, 0.5), (15.0, -1.0), (33.0, 0.7), (47.0, -0.2)]
            .iter()
            .enumerate()
            .map(|(k, (f, c))| {
                // Complexity of a few degrees, now this, now that way.
                let phase = -TAU * f * tau + turn * if k % 2 == 0 { 1.0 } else { -1.0 };
                (*f, Complex64::from_polar(*c, phase), 0.005)
            })
            .collect()
    }

    #[test]
    fn a_late_channel_is_told_to_the_microseconds_and_a_complex_mode_is_none() {
        for tau in [2e-3, -1.5e-3, 4e-3] {
            let found = delay(&modes(tau, 0.05)).unwrap();
            assert!(
                (found.seconds - tau).abs() < 2.5 * found.std_s,
                "{found:?} for {tau}"
            );
            assert!(found.std_s < 4e-4);
        }
        assert_eq!(delay(&modes(0.0, 0.08)), None);
        // One sample at 10 kHz is no more than complexity.
        assert_eq!(delay(&modes(1e-4, 0.05)), None);
        assert_eq!(delay(&modes(2e-3, 0.0)[..2]), None);
    }

    #[test]
    fn a_delay_of_more_than_a_quarter_period_is_told_by_many_modes() {
        let modes = |hz: &[f64], tau: f64| -> Vec<(f64, Complex64, f64)> {
            let one = |(k, f): (usize, &f64)| {
                let size = [0.5, -1.0, 0.7, -0.2][k % 4];
                (*f, Complex64::from_polar(1.0, -TAU * f * tau) * size, 0.005)
            };
            hz.iter().enumerate().map(one).collect()
        };
        let seven = [41.0, 97.0, 163.0, 230.0, 318.0, 405.0, 530.0];
        for tau in [0.59e-3, 0.98e-3, -1.7e-3] {
            let found = delay(&modes(&seven, tau)).unwrap();
            assert!((found.seconds - tau).abs() < 3e-6, "{found:?} for {tau}");
        }
        // Modes at equal distances repeat their phases.
        let even = [100.0, 200.0, 300.0, 400.0, 500.0];
        assert_eq!(delay(&modes(&even, 2.4e-3)), None);
    }

    #[test]
    fn words_name_the_channel_or_the_force() {
        let late = |seconds: f64| Some(Delay { seconds, std_s: 1e-4 });
        let name = |k: usize| format!("{k}Z");
        let one: Vec<_> = (1..=4)
            .map(|k| (name(k), if k == 3 { late(2e-3) } else { None }))
            .collect();
        let words = in_words(&one).unwrap();
        assert!(words.contains("3Z late by 2.000 ms"), "{words}");
        let all: Vec<_> = (1..=4).map(|k| (name(k), late(-2e-3))).collect();
        let words = in_words(&all).unwrap();
        assert!(words.contains("force channel comes 2.000 ms late"), "{words}");
        assert_eq!(in_words(&[(name(1), None)]), None);
    }
}
