//! Which numbers a key may have.

use std::fmt;

/// An interval with open or closed ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    low: f64,
    low_open: bool,
    high: f64,
    high_open: bool,
}

impl Bounds {
    /// Every number but NaN.
    pub const ANY: Bounds = Bounds::closed(f64::NEG_INFINITY, f64::INFINITY);
    /// Above zero.
    pub const POSITIVE: Bounds = Bounds::open(0.0, f64::INFINITY);
    /// Zero or above.
    pub const NOT_NEGATIVE: Bounds = Bounds::closed(0.0, f64::INFINITY);

    /// From `low` to `high`, both included; an infinite end is none.
    pub const fn closed(low: f64, high: f64) -> Bounds {
        Bounds {
            low,
            low_open: false,
            high,
            high_open: false,
        }
    }

    /// From `low` to `high`, both left out; an infinite end is none.
    pub const fn open(low: f64, high: f64) -> Bounds {
        Bounds {
            low,
            low_open: true,
            high,
            high_open: true,
        }
    }

    /// Above `low`, up to and including `high`.
    pub const fn above_up_to(low: f64, high: f64) -> Bounds {
        Bounds {
            low,
            low_open: true,
            high,
            high_open: false,
        }
    }

    /// The lower and the upper end, and whether it is open; `None` where there is none.
    pub fn ends(&self) -> [Option<(f64, bool)>; 2] {
        let end = |value: f64, is_open| value.is_finite().then_some((value, is_open));
        [end(self.low, self.low_open), end(self.high, self.high_open)]
    }

    /// False for NaN.
    pub fn contain(&self, x: f64) -> bool {
        let above = if self.low_open {
            x > self.low
        } else {
            x >= self.low
        };
        let below = if self.high_open {
            x < self.high
        } else {
            x <= self.high
        };
        above && below
    }
}

impl fmt::Display for Bounds {
    /// A remedy: `must be above 0 and at most 1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let low = match (self.low.is_finite(), self.low_open) {
            (false, _) => None,
            (true, true) => Some(format!("above {}", self.low)),
            (true, false) => Some(format!("at least {}", self.low)),
        };
        let high = match (self.high.is_finite(), self.high_open) {
            (false, _) => None,
            (true, true) => Some(format!("below {}", self.high)),
            (true, false) => Some(format!("at most {}", self.high)),
        };
        match (low, high) {
            (Some(low), Some(high)) => write!(f, "it must be {low} and {high}"),
            (Some(one), None) | (None, Some(one)) => write!(f, "it must be {one}"),
            (None, None) => write!(f, "it must be a number"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_open_or_closed_and_nan_is_nowhere() {
        assert!(!Bounds::POSITIVE.contain(0.0) && Bounds::NOT_NEGATIVE.contain(0.0));
        assert!(Bounds::above_up_to(0.0, 1.0).contain(1.0) && !Bounds::open(0.0, 1.0).contain(1.0));
        assert!(!Bounds::ANY.contain(f64::NAN));
        assert_eq!(
            Bounds::above_up_to(0.0, 1.0).to_string(),
            "it must be above 0 and at most 1"
        );
    }
}
