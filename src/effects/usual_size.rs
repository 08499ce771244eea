//! How large an effect usually is, for campaigns that hide one: what robots in the literature and the practice campaigns show.

/// How one parameter of an effect is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsualSize {
    /// Name of the parameter, without the index of a list.
    pub parameter: &'static str,
    /// Where its value is drawn from.
    pub range: SizeRange,
    /// How the value follows the size of the effect.
    pub follows: FollowsSize,
}

impl UsualSize {
    /// One line of an effect's [`usual_sizes`](super::Effect::usual_sizes).
    pub const fn new(parameter: &'static str, range: SizeRange, follows: FollowsSize) -> Self {
        UsualSize {
            parameter,
            range,
            follows,
        }
    }
}

/// Where a value is drawn from, in the parameter's unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SizeRange {
    /// From, to; uniform on the logarithm.
    Log(f64, f64),
    /// Log-uniform factor, from, to, on the parameter's nominal value.
    Times(f64, f64),
    /// Uniform between −x and x.
    Either(f64),
}

/// How a value follows the size of the effect (1: as drawn; smaller: weaker).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FollowsSize {
    /// value × size^exponent: +1 for a mass, −1 for a stiffness that an ideal structure has infinite.
    Power(f64),
    /// value^size: a ratio that is 1 where there is no effect.
    Ratio,
    /// Not at all.
    Not,
}
