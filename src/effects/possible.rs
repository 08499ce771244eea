//! Sizes that an effect can have: what the hard ends of its prior say about a fitted value.

/// Share of an effect's usual size (a mass, a compliance) that no measurement can show.
pub(crate) const NEGLIGIBLE: f64 = 1e-10;

/// A fitted value, natural units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// In the parameter's unit.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// Standard deviations by which an estimate may lie beyond an end by chance.
const CHANCE: f64 = 2.0;

impl Size {
    /// Why this size is not possible, where it lies beyond the ends by more than chance. `range`: what is possible, in the
    /// value's unit; `shown`: the factor to and the name of the unit that people read; `why`: where the ends come from.
    pub fn outside(self, what: &str, range: [f64; 2], shown: (f64, &str), why: &str) -> Option<String> {
        let [low, high] = range;
        let chance = if self.std.is_finite() {
            CHANCE * self.std
        } else {
            f64::INFINITY
        };
        let (end, word) = if self.value + chance < low {
            (low, "less")
        } else if self.value - chance > high {
            (high, "more")
        } else {
            return None;
        };
        let (factor, unit) = shown;
        let number = |v: f64| {
            format!("{} {unit}", three_digits(v * factor))
                .trim_end()
                .to_string()
        };
        Some(format!(
            "{what} of {} is {word} than {}: {why}",
            number(self.value),
            number(end)
        ))
    }
}

/// Three digits, without zeros that say nothing.
fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let decimals = (2 - value.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_lies_beyond_an_end_by_more_than_chance_is_impossible() {
        let size = |value, std| Size { value, std };
        let outside = |s: Size| s.outside("a delay", [0.0, 2e-3], (1e6, "µs"), "it cannot be early");
        assert_eq!(outside(size(1e-3, 0.0)), None);
        assert_eq!(outside(size(-1e-5, 6e-6)), None);
        assert_eq!(outside(size(2.5e-3, 3e-4)), None);
        assert_eq!(outside(size(-1e-5, f64::NAN)), None);
        let early = outside(size(-2.4e-5, 1e-6)).unwrap();
        assert!(
            early.starts_with("a delay of -24 µs is less than 0 µs"),
            "{early}"
        );
        assert!(outside(size(2.5e-3, 1e-4)).unwrap().contains("more than 2000 µs"));
    }

    #[test]
    fn numbers_have_three_digits_that_say_something() {
        let texts = [0.0123456, 1.5, 24.0, 123.456, 1234.4, -0.05].map(three_digits);
        assert_eq!(texts, ["0.0123", "1.5", "24", "123", "1234", "-0.05"]);
    }
}
