//! Axes: which range to show, where the ticks go and what they are called.

use crate::report::number::{decimals, superscript};

/// Beyond this a number is nonsense, and differences of such numbers would overflow.
const LARGEST: f64 = 1e200;

pub fn usable(value: f64) -> bool {
    value.is_finite() && value.abs() <= LARGEST
}

/// Smallest and largest of the usable values.
pub fn extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    values
        .into_iter()
        .filter(|v| usable(*v))
        .fold(None, |range, v| match range {
            None => Some((v, v)),
            Some((low, high)) => Some((low.min(v), high.max(v))),
        })
}

/// Extent of the positive values, for a log axis.
pub fn positive_extent(values: impl IntoIterator<Item = f64>) -> Option<(f64, f64)> {
    extent(values.into_iter().filter(|v| *v > 1e-200))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    Log,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    pub at: f64,
    /// Empty: a minor tick, drawn lighter.
    pub label: String,
}

#[derive(Debug, Clone)]
pub struct FigureAxis {
    pub label: String,
    pub low: f64,
    pub high: f64,
    pub ticks: Vec<Tick>,
    scale: Scale,
}

impl FigureAxis {
    /// Exactly from `low` to `high` (widened where both are the same), about `count` labelled ticks.
    pub fn linear(label: &str, (low, high): (f64, f64), count: usize) -> Self {
        let (low, high) = widened(low, high);
        let step = nice_step((high - low) / count.max(1) as f64);
        let exponent = common_exponent(low.abs().max(high.abs()));
        let unit = 10f64.powi(exponent);
        let places = (-(step / unit * 1.000_001).log10().floor()).clamp(0.0, 12.0) as usize;
        let first = (low / step - 1e-9).ceil();
        let ticks = (0..=4 * count.max(1))
            .map(|i| (first + i as f64) * step)
            .take_while(|at| *at <= high + 1e-9 * (high - low))
            .map(|at| Tick {
                at,
                label: decimals(at / unit, places),
            })
            .collect();
        let label = match exponent {
            0 => label.to_owned(),
            _ => with_factor(label, exponent),
        };
        FigureAxis {
            label,
            low,
            high,
            ticks,
            scale: Scale::Linear,
        }
    }

    /// From `low` to `high` with room of `margin` of the span at both ends.
    pub fn padded(label: &str, (low, high): (f64, f64), margin: f64, count: usize) -> Self {
        let (low, high) = widened(low, high);
        let room = margin * (high - low);
        FigureAxis::linear(label, (low - room, high + room), count)
    }

    /// From zero to a little above `high` (below, where all values are negative).
    pub fn from_zero(label: &str, (low, high): (f64, f64), count: usize) -> Self {
        let (low, high) = widened(low.min(0.0), high.max(0.0));
        let room = 0.06 * (high - low);
        let below = if low < 0.0 { low - room } else { 0.0 };
        let above = if high > 0.0 { high + room } else { 0.0 };
        FigureAxis::linear(label, (below, above), count)
    }

    /// Logarithmic; `low` and `high` must be positive (see [`positive_extent`]).
    pub fn log(label: &str, (low, high): (f64, f64)) -> Self {
        let low = if low > 0.0 { low } else { 1e-3 };
        let high = high.max(low);
        // At least a third of a decade on screen.
        let decades = high.log10() - low.log10();
        let shortfall = ((1.0 / 3.0 - decades) / 2.0).max(0.03 * decades);
        let (low, high) = (low * 10f64.powf(-shortfall), high * 10f64.powf(shortfall));
        let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
        let span = high.log10() - low.log10();
        let every = (span / 7.0).ceil().max(1.0) as i32;
        let labelled: &[u32] = match span {
            s if s < 1.2 => &[1, 2, 3, 5, 7],
            s if s < 2.2 => &[1, 2, 5],
            _ => &[1],
        };
        let plain = first >= -3 && last <= 4;
        let ticks = (first..=last)
            .filter(|decade| decade.rem_euclid(every) == 0 || every == 1)
            .flat_map(|decade| (1..10u32).map(move |digit| (decade, digit)))
            .filter(|(_, digit)| *digit == 1 || every == 1)
            .map(|(decade, digit)| {
                let at = f64::from(digit) * 10f64.powi(decade);
                let label = match labelled.contains(&digit) {
                    false => String::new(),
                    true if plain => decimals(at, (-decade).max(0) as usize),
                    true if digit == 1 => format!("10{}", superscript(decade)),
                    true => format!("{digit}·10{}", superscript(decade)),
                };
                Tick { at, label }
            })
            .filter(|tick| tick.at >= low * 0.999_999 && tick.at <= high * 1.000_001)
            .collect();
        FigureAxis {
            label: label.to_owned(),
            low,
            high,
            ticks,
            scale: Scale::Log,
        }
    }

    /// Places `names` at 0, 1, 2, … with half a step of room at both ends.
    pub fn categories(label: &str, names: &[String]) -> Self {
        let ticks = names.iter().enumerate();
        FigureAxis {
            label: label.to_owned(),
            low: -0.5,
            high: names.len().max(1) as f64 - 0.5,
            ticks: ticks
                .map(|(i, name)| Tick {
                    at: i as f64,
                    label: name.clone(),
                })
                .collect(),
            scale: Scale::Linear,
        }
    }

    /// Puts labelled ticks exactly there (angles at 90° steps and the like).
    pub fn with_ticks(mut self, at: &[f64], label: impl Fn(f64) -> String) -> Self {
        self.ticks = at
            .iter()
            .map(|at| Tick {
                at: *at,
                label: label(*at),
            })
            .collect();
        self
    }

    /// Where a value lies: 0 at `low`, 1 at `high`. None where the axis has no place for it.
    pub fn fraction(&self, value: f64) -> Option<f64> {
        if !usable(value) {
            return None;
        }
        match self.scale {
            Scale::Linear => Some((value - self.low) / (self.high - self.low)),
            Scale::Log if value > 0.0 => Some((value / self.low).ln() / (self.high / self.low).ln()),
            // Zero lies infinitely far down: far below the frame, so that a line falls out of it.
            Scale::Log => Some(-100.0),
        }
    }
}

/// A range that can be divided by: a single value gets room around it.
fn widened(low: f64, high: f64) -> (f64, f64) {
    let (low, high) = (low.min(high), low.max(high));
    let size = low.abs().max(high.abs());
    // Below a millionth of the value the tick labels would all read the same.
    let least = if size > 0.0 { 2e-6 * size } else { 1.0 };
    if high - low >= least {
        return (low, high);
    }
    let room = if size > 0.0 { 0.1 * size } else { 1.0 };
    (0.5 * low + 0.5 * high - room, 0.5 * low + 0.5 * high + room)
}

/// 1, 2 or 5 times a power of ten, not below `raw`.
fn nice_step(raw: f64) -> f64 {
    let power = 10f64.powf(raw.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= raw * 0.999_999);
    factor.unwrap_or(10.0) * power
}

/// A multiple of three to take out of all labels of an axis, 0 where they are readable as they are.
fn common_exponent(largest: f64) -> i32 {
    match largest {
        v if v <= 0.0 => 0,
        v if (0.01..1e5).contains(&v) => 0,
        v => (v.log10().floor() as i32).div_euclid(3) * 3,
    }
}

/// `Re (m/N)` with exponent −6 → `Re (10⁻⁶ m/N)`.
fn with_factor(label: &str, exponent: i32) -> String {
    let factor = format!("10{}", superscript(exponent));
    // The first bracket after the name: a unit may have brackets of its own.
    match label.find(" (") {
        Some(at) if label.ends_with(')') => {
            let (name, unit) = label.split_at(at + 2);
            format!("{name}{factor} {unit}")
        }
        _ => format!("{label} ({factor})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &FigureAxis) -> Vec<&str> {
        axis.ticks
            .iter()
            .map(|t| t.label.as_str())
            .filter(|l| !l.is_empty())
            .collect()
    }

    #[test]
    fn linear_ticks_are_round_and_the_factor_goes_to_the_unit() {
        let axis = FigureAxis::linear("Speed (rpm)", (100.0, 1500.0), 7);
        assert_eq!(
            labels(&axis),
            ["200", "400", "600", "800", "1000", "1200", "1400"]
        );
        let axis = FigureAxis::linear("Re (m/N)", (-3.1e-6, 2.2e-6), 5);
        assert_eq!(axis.label, "Re (10⁻⁶ m/N)");
        let mobility = FigureAxis::linear("Re (m/(N·s))", (-3.1e-6, 2.2e-6), 5);
        assert_eq!(mobility.label, "Re (10⁻⁶ m/(N·s))");
        assert_eq!(labels(&axis), ["−2", "0", "2"]);
        assert_eq!(
            labels(&FigureAxis::linear("f (mm)", (0.0, 0.25), 5)),
            ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25"]
        );
    }

    #[test]
    fn marks_are_round() {
        let labels = |low, high, count| {
            let ticks = FigureAxis::linear("", (low, high), count).ticks;
            ticks.into_iter().map(|t| t.label).collect::<Vec<_>>().join(" ")
        };
        assert_eq!(labels(0.0, 1316.0, 8), "0 200 400 600 800 1000 1200");
        assert_eq!(labels(0.1, 0.75, 8), "0.1 0.2 0.3 0.4 0.5 0.6 0.7");
        assert_eq!(labels(0.0, 83.2, 5), "0 20 40 60 80");
    }

    #[test]
    fn log_ticks_fit_the_span() {
        assert_eq!(
            labels(&FigureAxis::log("", (2e-8, 3e-5))),
            ["10⁻⁷", "10⁻⁶", "10⁻⁵"]
        );
        assert_eq!(
            labels(&FigureAxis::log("", (1.0, 30.0))),
            ["1", "2", "5", "10", "20"]
        );
        assert!(labels(&FigureAxis::log("", (1e-150, 1e150))).len() <= 9);
        assert!(labels(&FigureAxis::log("", (40.0, 41.0))).len() >= 2);
    }

    #[test]
    fn odd_ranges_still_make_an_axis() {
        for (low, high) in [
            (0.0, 0.0),
            (5.0, 5.0),
            (-1e200, 1e200),
            (1e-200, 1e-200),
            (1e9, 1e9 + 1e-3),
            (2.0, 1.0),
        ] {
            let axis = FigureAxis::linear("x", (low, high), 6);
            assert!(
                axis.high > axis.low && (2..40).contains(&axis.ticks.len()),
                "{low} {high}: {axis:?}"
            );
            assert!(axis.fraction(low).is_some_and(f64::is_finite));
            let mut distinct = labels(&axis);
            distinct.dedup();
            assert_eq!(distinct.len(), axis.ticks.len(), "{axis:?}");
        }
        assert_eq!(extent([f64::NAN, f64::INFINITY, 1e300]), None);
    }
}
