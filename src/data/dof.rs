//! Directions at measurement points.

use serde::Serialize;

use crate::InputError;

/// One of the three axes of a measurement frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub enum Axis {
    /// First axis of the frame.
    X,
    /// Second axis of the frame.
    Y,
    /// Third axis of the frame.
    Z,
}

impl Axis {
    /// X, Y, Z.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// 0, 1 or 2: its place in a vector.
    pub fn index(self) -> usize {
        self as usize
    }

    /// `X`, `Y` or `Z`.
    pub fn letter(self) -> char {
        ['X', 'Y', 'Z'][self.index()]
    }
}

/// A degree of freedom as measurement files name it: node number, axis, and sense along it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Dof {
    /// Node number of the measurement file.
    pub node: i64,
    /// Axis of the frame that the node's signals are in.
    pub axis: Axis,
    /// True where the file says −X, −Y or −Z.
    pub negative: bool,
}

impl std::fmt::Display for Dof {
    /// `1X`, `12-Z`: the form of the FRF CSV header.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.negative { "-" } else { "" };
        write!(f, "{}{}{}", self.node, sign, self.axis.letter())
    }
}

impl std::str::FromStr for Dof {
    type Err = InputError;

    /// Node, optional sign, axis letter: `1X`, `12-Z`, `1+x`.
    fn from_str(text: &str) -> std::result::Result<Self, InputError> {
        let wrong = || {
            InputError::new(format!("{text:?} is no degree of freedom"))
                .remedy("write node, optional sign and axis: 1X, 12-Z")
        };
        let text = text.trim();
        let digits = text.chars().take_while(char::is_ascii_digit).count();
        let (node, rest) = text.split_at_checked(digits).ok_or_else(wrong)?;
        let (negative, letter) = match rest.strip_prefix('-') {
            Some(letter) => (true, letter),
            None => (false, rest.strip_prefix('+').unwrap_or(rest)),
        };
        let axis = match letter {
            "X" | "x" => Axis::X,
            "Y" | "y" => Axis::Y,
            "Z" | "z" => Axis::Z,
            _ => return Err(wrong()),
        };
        Ok(Dof {
            node: node.parse().map_err(|_| wrong())?,
            axis,
            negative,
        })
    }
}
