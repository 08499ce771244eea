//! Keys that several tables of `campaign.toml` have.

use std::f64::consts::PI;

use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::section::Section;
use crate::data::{Immersion, Posture, Process};
use crate::text::shown_briefly as shown;

/// The processes by the names that the files have for them.
pub(super) const PROCESSES: [(&str, Process); 3] = [
    ("milling", Process::Milling),
    ("drilling", Process::Drilling),
    ("turning", Process::Turning),
];

/// Index of the posture that the key `posture` of a section names.
pub(super) fn posture_ref(section: &Section<'_>, postures: &[Posture]) -> Result<usize> {
    let id = section.required("posture", section.text("posture")?, "\"p1\"")?;
    postures.iter().position(|p| p.id == id).ok_or_else(|| {
        // Ids are alike (p1, p2): a guess would often be another posture.
        let some: Vec<&str> = postures.iter().take(10).map(|p| p.id.as_str()).collect();
        let remedy = match some[..] {
            [] => format!("add a [[posture]] with id = {:?}", shown(id)),
            _ => format!(
                "name one that is there ({}), or add it as a [[posture]]",
                shown(&some.join(", "))
            ),
        };
        section
            .error(
                "posture",
                format!("there is no [[posture]] with the id {:?}", shown(id)),
            )
            .remedy(remedy)
            .into()
    })
}

/// Immersion from `immersion = "slot"`, from `start_deg` and `exit_deg`, or (in `[lobes]`) from `radial_ratio`
/// with `cut`; `None` where none of them stands.
pub(super) fn immersion(section: &Section<'_>) -> Result<Option<Immersion>> {
    let angles = ["start_deg", "exit_deg"].into_iter().find(|key| section.has(key));
    let ratio = section.has("radial_ratio").then_some("radial_ratio");
    let slot = section.has("immersion").then_some("immersion");
    let given: Vec<&str> = [slot, angles, ratio].into_iter().flatten().collect();
    if let [first, second, ..] = given[..] {
        return Err(section
            .error(
                second,
                format!("the immersion is said twice, by {first} and by {second}"),
            )
            .remedy("keep one of the two")
            .into());
    }
    if section.has("cut") && ratio.is_none() {
        return Err(section
            .error("cut", "needs radial_ratio")
            .remedy("add radial_ratio = 0.5 (width of cut over tool diameter), or take it out")
            .into());
    }
    match given.first() {
        None => Ok(None),
        Some(&"immersion") => section.choice("immersion", &[("slot", Immersion::SLOT)]),
        Some(&"radial_ratio") => by_ratio(section).map(Some),
        Some(_) => by_angles(section).map(Some),
    }
}

fn by_angles(section: &Section<'_>) -> Result<Immersion> {
    // Behind the cutter (180° … 360°) the chip thickness c sin φ is negative: there is nothing to cut.
    let angle =
        |key: &str, example| section.required(key, section.number(key, Bounds::closed(0.0, 180.0))?, example);
    let start = angle("start_deg", "0.0")?;
    let exit = angle("exit_deg", "180.0")?;
    if start >= exit {
        return Err(section
            .error(
                "exit_deg",
                format!("the cut starts at {start} and ends at {exit} degrees"),
            )
            .remedy("start_deg must be below exit_deg; angles from +y, clockwise")
            .into());
    }
    Ok(Immersion {
        start_rad: start.to_radians(),
        exit_rad: exit.to_radians(),
    })
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Direction {
    Up,
    Down,
}

fn by_ratio(section: &Section<'_>) -> Result<Immersion> {
    let ratio = section.number("radial_ratio", Bounds::above_up_to(0.0, 1.0))?;
    let ratio = section.required("radial_ratio", ratio, "0.5")?;
    let words = [("up", Direction::Up), ("down", Direction::Down)];
    let direction = section.required("cut", section.choice("cut", &words)?, "\"up\" or \"down\"")?;
    Ok(radial_immersion(ratio, direction))
}

/// Immersion for a width of cut of `ratio` times the diameter (0 < ratio ≤ 1).
///
/// A tooth at φ (from +y, clockwise) is at (sin φ, cos φ) and moves along (cos φ, −sin φ); the chip is c sin φ thick
/// with the feed along +x. Up-milling begins at φ = 0, where tooth and feed point the same way and the chip is
/// thin; down-milling ends at φ = π (Altintas, Manufacturing Automation, 2012, §2.6).
fn radial_immersion(ratio: f64, direction: Direction) -> Immersion {
    // Clamped: the cosine of a rounded 1 − 2·1 must not leave [−1, 1].
    let swept = (1.0 - 2.0 * ratio).clamp(-1.0, 1.0).acos();
    match direction {
        Direction::Up => Immersion {
            start_rad: 0.0,
            exit_rad: swept,
        },
        Direction::Down => Immersion {
            start_rad: PI - swept,
            exit_rad: PI,
        },
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn half_immersion_is_a_quarter_turn() {
        let up = radial_immersion(0.5, Direction::Up);
        assert_relative_eq!(up.exit_rad, PI / 2.0, epsilon = 1e-15);
        let down = radial_immersion(0.5, Direction::Down);
        assert_relative_eq!(down.start_rad, PI / 2.0, epsilon = 1e-15);
        assert_eq!(radial_immersion(1.0, Direction::Up), Immersion::SLOT);
        assert_eq!(radial_immersion(1.0, Direction::Down), Immersion::SLOT);
    }

    proptest! {
        /// The teeth sweep a strip of the given width (across the feed), thin chip first in up-milling.
        #[test]
        fn the_swept_strip_is_as_wide_as_the_cut(ratio in 1e-6f64..=1.0) {
            for direction in [Direction::Up, Direction::Down] {
                let im = radial_immersion(ratio, direction);
                let width = (im.start_rad.cos() - im.exit_rad.cos()) / 2.0;
                prop_assert!((width - ratio).abs() < 1e-12, "{direction:?} {width}");
                let entry_thinner = im.start_rad.sin() <= im.exit_rad.sin() + 1e-12;
                prop_assert_eq!(entry_thinner, direction == Direction::Up || ratio > 1.0 - 1e-9);
            }
        }
    }
}
