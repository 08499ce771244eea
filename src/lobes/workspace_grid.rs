//! The places of a map of the workspace, numbered: tool points × tool directions × redundancy angles.
//!
//! The angle runs fastest, then z, y, x, then the direction; any stretch of numbers is a piece of work of its own.

use std::str::FromStr;

use nalgebra::{Unit, Vector3};
use serde::Serialize;

use super::redundancy::steps_of_a_turn;
use crate::{Error, InputError, Result};

/// More places than this are a slip in the grid.
const MOST_PLACES: u128 = 20_000_000;

/// Even steps from one value to another, both included; in m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Span {
    /// First value, m.
    pub from_m: f64,
    /// Last value, m.
    pub to_m: f64,
    /// At least 1; a single value stands at `from_m`.
    pub count: usize,
}

impl Span {
    /// # Errors
    /// Ends that are not finite or run backwards, no value, or several values on no length.
    pub fn new(from_m: f64, to_m: f64, count: usize) -> Result<Self> {
        let finite = from_m.is_finite() && to_m.is_finite();
        let sound = finite && count >= 1 && (count == 1 && from_m == to_m || count > 1 && from_m < to_m);
        if !sound {
            return Err(InputError::new(format!(
                "{count} value(s) from {from_m} to {to_m} m are no part of a grid"
            ))
            .remedy("write FROM:TO:STEP in metres, such as 1.2:2.0:0.1, or one value, such as 1.2")
            .into());
        }
        Ok(Span { from_m, to_m, count })
    }

    /// `count` values about a middle, up to `reach_m` on either side.
    pub fn about(middle_m: f64, reach_m: f64, count: usize) -> Self {
        Span {
            from_m: middle_m - reach_m,
            to_m: middle_m + reach_m,
            count,
        }
    }

    /// Value `i`, m.
    pub fn at_m(&self, i: usize) -> f64 {
        match i {
            0 => self.from_m,
            i if i + 1 == self.count => self.to_m,
            i => self.from_m + (self.to_m - self.from_m) * i as f64 / (self.count - 1) as f64,
        }
    }
}

/// How many steps make the length; `None` where that is no whole number of them.
fn steps(length: f64, step: f64) -> Option<usize> {
    let steps = length / step;
    let whole = steps.round();
    let fits = (1.0..1e9).contains(&whole) && (steps - whole).abs() < 1e-6 * whole;
    fits.then_some(whole as usize)
}

/// `FROM:TO:STEP` or one value, in m.
impl FromStr for Span {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parts: Vec<&str> = text.split(':').collect();
        let number = |part: &str| part.trim().parse::<f64>().ok();
        let read = match parts[..] {
            [value] => number(value).map(|v| (v, v, 1)),
            [from, to, step] => number(from)
                .zip(number(to))
                .zip(number(step))
                .and_then(|((from, to), step)| Some((from, to, 1 + steps(to - from, step)?))),
            _ => None,
        };
        let (from_m, to_m, count) = read.ok_or_else(|| {
            InputError::new(format!("{text:?} is no part of a grid"))
                .remedy("write FROM:TO:STEP in metres, such as 1.2:2.0:0.1, or one value, such as 1.2")
        })?;
        Span::new(from_m, to_m, count)
    }
}

/// The places of a map, base frame of the robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorkspaceGrid {
    /// Along x of the base.
    pub x_m: Span,
    /// Along y of the base.
    pub y_m: Span,
    /// Along z of the base.
    pub z_m: Span,
    /// Unit vectors along the tool, from the spindle to the workpiece.
    pub directions: Vec<[f64; 3]>,
    /// The redundancy angle runs from 0 in these steps, below 360.
    pub angle_step_deg: f64,
}

/// One place of a map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GridPlace {
    /// Number within the grid.
    pub index: usize,
    /// Tool centre point, base frame, m.
    pub tcp_m: [f64; 3],
    /// Unit vector along the tool, from the spindle to the workpiece.
    pub tool_axis: [f64; 3],
    /// Redundancy angle, degrees.
    pub angle_deg: f64,
}

impl WorkspaceGrid {
    /// `directions`: of any length but none.
    ///
    /// # Errors
    /// No direction or one without a length, a step outside 0.01° to 360°, or more places than can be meant.
    pub fn new([x_m, y_m, z_m]: [Span; 3], directions: &[[f64; 3]], angle_step_deg: f64) -> Result<Self> {
        let refuse =
            |problem: String, remedy: &str| -> Error { InputError::new(problem).remedy(remedy).into() };
        if !(0.01..=360.0).contains(&angle_step_deg) {
            return Err(refuse(
                format!("{angle_step_deg}° is no step of the redundancy angle"),
                "give 0.01° to 360°; 360 takes the one angle 0",
            ));
        }
        let unit = |d: &[f64; 3]| {
            let vector = Unit::try_new(Vector3::from(*d), 1e-9);
            let finite = d.iter().all(|v| v.is_finite());
            vector.filter(|_| finite).map(|v| v.into_inner().into())
        };
        let directions: Option<Vec<[f64; 3]>> = directions.iter().map(unit).collect();
        let directions = directions.filter(|d| !d.is_empty()).ok_or_else(|| {
            refuse(
                "a tool direction has no length, or there is none".into(),
                "three numbers along the tool from the spindle to the workpiece, such as 0,0,-1",
            )
        })?;
        let grid = WorkspaceGrid {
            x_m,
            y_m,
            z_m,
            directions,
            angle_step_deg,
        };
        let counts = [
            x_m.count,
            y_m.count,
            z_m.count,
            grid.directions.len(),
            grid.angle_count(),
        ];
        let places = counts.iter().try_fold(1u128, |n, c| n.checked_mul(*c as u128));
        if places.is_none_or(|n| n > MOST_PLACES) {
            return Err(refuse(
                format!("a grid of more than {MOST_PLACES} places"),
                "fewer values of x, y, z, or a larger step of the angle",
            ));
        }
        Ok(grid)
    }

    /// Steps of the redundancy angle.
    pub fn angle_count(&self) -> usize {
        steps_of_a_turn(self.angle_step_deg)
    }

    /// Places of the map: points × directions × angles.
    pub fn place_count(&self) -> usize {
        let places = self.x_m.count * self.y_m.count * self.z_m.count;
        places * self.directions.len() * self.angle_count()
    }

    /// The place of a number below [`place_count`](Self::place_count).
    pub fn place(&self, index: usize) -> GridPlace {
        let mut rest = index;
        let mut next = |count: usize| {
            let here = rest % count;
            rest /= count;
            here
        };
        let angle_deg = self.angle_step_deg * next(self.angle_count()) as f64;
        let z = self.z_m.at_m(next(self.z_m.count));
        let y = self.y_m.at_m(next(self.y_m.count));
        let x = self.x_m.at_m(next(self.x_m.count));
        GridPlace {
            index,
            tcp_m: [x, y, z],
            tool_axis: self.directions[next(self.directions.len())],
            angle_deg,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(text: &str) -> Span {
        text.parse().unwrap()
    }

    fn grid() -> WorkspaceGrid {
        let spans = [span("1.0:2.0:0.5"), span("-0.5"), span("0.5:1.0:0.5")];
        WorkspaceGrid::new(spans, &[[0.0, 0.0, -2.0], [1.0, 0.0, 0.0]], 100.0).unwrap()
    }

    #[test]
    fn spans_are_read_and_slips_refused() {
        let s = span("1.2:2.0:0.2");
        assert_eq!((s.at_m(0), s.at_m(4)), (1.2, 2.0));
        assert!((s.at_m(2) - 1.6).abs() < 1e-15);
        assert_eq!(span(" 1.5 ").count, 1);
        for slip in [
            "",
            "1:2",
            "2:1:0.1",
            "1:1:0.1",
            "1:2:0",
            "1:2:0.3",
            "1:2:13",
            "nan",
            "1:inf:3",
            "1:2:2:2",
            "1:2:-1",
            "0:1:1e-300",
        ] {
            let message = slip.parse::<Span>().unwrap_err().to_string();
            assert!(message.contains("FROM:TO:STEP"), "{slip}: {message}");
        }
        let spans = [span("0:1:0.001"), span("0:1:0.001"), span("0:1:0.001")];
        assert!(WorkspaceGrid::new(spans, &[[0.0, 0.0, -1.0]], 90.0).is_err());
        let one = [span("1"), span("1"), span("1")];
        assert!(WorkspaceGrid::new(one, &[[0.0; 3]], 90.0).is_err());
        assert!(WorkspaceGrid::new(one, &[], 90.0).is_err());
        assert!(WorkspaceGrid::new(one, &[[0.0, 0.0, 1.0]], 0.0).is_err());
    }

    /// Every combination exactly once, the angle fastest.
    #[test]
    fn the_numbering_covers_the_grid() {
        let grid = grid();
        assert_eq!(grid.place_count(), 3 * 2 * 2 * 4);
        let places: Vec<GridPlace> = (0..grid.place_count()).map(|i| grid.place(i)).collect();
        let angles: Vec<f64> = places[..5].iter().map(|p| p.angle_deg).collect();
        assert_eq!(angles, [0.0, 100.0, 200.0, 300.0, 0.0]);
        assert_eq!(places[4].tcp_m, [1.0, -0.5, 1.0]);
        assert_eq!(places[8].tcp_m, [1.5, -0.5, 0.5]);
        assert_eq!(places[23].tool_axis, [0.0, 0.0, -1.0]);
        assert_eq!(places[24].tool_axis, [1.0, 0.0, 0.0]);
        let mut distinct: Vec<String> = places
            .iter()
            .map(|p| format!("{:?}{:?}{}", p.tcp_m, p.tool_axis, p.angle_deg))
            .collect();
        distinct.sort();
        distinct.dedup();
        assert_eq!(distinct.len(), grid.place_count());
    }
}
