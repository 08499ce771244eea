//! Where something sits, in words: the bands, directions, postures (or orders, axes, cuts) that hold most of it.

use serde::Serialize;

use crate::discrepancy::comparison::error_sums::Sums;
use crate::text::listed;

/// What "most" is: the fewest groups that hold this share together.
const MOST: f64 = 0.6;
/// Standard deviations of Σ|r|²/σ² above its expectation from which on more than noise is there.
const SURE: f64 = 4.0;

/// Where most of something sits; an empty list: everywhere.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DominantRegion {
    /// Lower end, Hz.
    pub from_hz: f64,
    /// Upper end, Hz.
    pub to_hz: f64,
    /// Response axis, reference axis: `XX`, `XY`, …
    pub directions: Vec<String>,
    /// Their ids.
    pub postures: Vec<String>,
    /// Node numbers.
    pub points: Vec<String>,
}

/// Excess over what noise leaves: Σ|model − measured|²/σ² − N over N complex values; noise alone leaves 0 ± √N.
pub(crate) fn excess(sums: &Sums) -> f64 {
    sums.weighted - sums.values as f64
}

pub(crate) fn above_noise(sums: &Sums) -> bool {
    excess(sums) > SURE * (sums.values as f64).sqrt()
}

/// Amounts by name, in order of first appearance.
#[derive(Debug, Clone, Default)]
pub(crate) struct Amounts(Vec<(String, f64)>);

impl Amounts {
    pub(crate) fn add(&mut self, name: &str, amount: f64) {
        match self.0.iter_mut().find(|(n, _)| n == name) {
            Some((_, a)) => *a += amount,
            None => self.0.push((name.to_string(), amount)),
        }
    }

    /// The fewest names that hold most of the amount, in their own order; none where that takes more than half of them.
    pub(crate) fn holding_most(&self) -> Vec<String> {
        let mut order: Vec<(usize, f64)> = self.0.iter().map(|(_, a)| a.max(0.0)).enumerate().collect();
        let total: f64 = order.iter().map(|(_, a)| a).sum();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut held = 0.0;
        let mut names: Vec<usize> = Vec::new();
        for (i, a) in order {
            if held >= MOST * total {
                break;
            }
            held += a;
            names.push(i);
        }
        if 2 * names.len() > self.0.len() {
            return Vec::new();
        }
        names.sort_unstable();
        names.into_iter().map(|i| self.0[i].0.clone()).collect()
    }
}

impl DominantRegion {
    /// `bands`: amount in each band between neighbouring `edges` (Hz). Negative amounts count as nothing.
    pub(crate) fn new(
        edges: &[f64],
        bands: &[f64],
        directions: &Amounts,
        postures: &Amounts,
        points: &Amounts,
    ) -> DominantRegion {
        let amounts: Vec<f64> = bands.iter().map(|b| b.max(0.0)).collect();
        let (first, last) = shortest_run(&amounts);
        DominantRegion {
            from_hz: edges[first],
            to_hz: edges[last + 1],
            directions: directions.holding_most(),
            postures: postures.holding_most(),
            points: points.holding_most(),
        }
    }

    /// `at 28–40 Hz in YY at p2 and p5`.
    pub fn words(&self) -> String {
        let hz = |f: f64| {
            if f < 100.0 {
                format!("{f:.1}")
            } else {
                format!("{f:.0}")
            }
        };
        let mut text = format!("at {}–{} Hz", hz(self.from_hz), hz(self.to_hz));
        text += &match self.directions.as_slice() {
            [] => ", in all directions".to_string(),
            some => format!(" in {}", listed(some)),
        };
        text += &match self.postures.as_slice() {
            [] => " and at all postures".to_string(),
            some => format!(" at {}", listed(some)),
        };
        match self.points.as_slice() {
            [] => text,
            [node] => text + &format!(" (node {node})"),
            some => text + &format!(" (nodes {})", listed(some)),
        }
    }
}

/// Where the error of forces sits: `at 6 times the rotation, in Fy, in cut 07`. `None` where nothing stands above noise.
///
/// `cells`: cut, axis, order of rotation and what they hold.
pub(crate) fn of_cuts(cells: &[(String, String, usize, Sums)], has_orders: bool) -> Option<String> {
    let [mut cuts, mut axes, mut orders] = [Amounts::default(), Amounts::default(), Amounts::default()];
    let mut total = 0.0;
    for (cut, axis, order, sums) in cells {
        let amount = sums.error - sums.noise;
        cuts.add(cut, amount);
        axes.add(axis, amount);
        orders.add(&order.to_string(), amount);
        total += amount;
    }
    if !(total > 0.0) {
        return None;
    }
    let mut parts = Vec::new();
    match orders.holding_most().as_slice() {
        [mean] if has_orders && mean == "0" => parts.push("in the mean force".to_string()),
        some if has_orders && (1..=4).contains(&some.len()) => {
            parts.push(format!("at {} times the rotation", listed(some)));
        }
        _ => (),
    }
    parts.push(match axes.holding_most().as_slice() {
        [] => "in all axes".to_string(),
        some => format!("in {}", listed(some)),
    });
    parts.push(match cuts.holding_most().as_slice() {
        [] => "in all cuts".to_string(),
        [one] => format!("in cut {one}"),
        some => format!("in cuts {}", listed(some)),
    });
    Some(parts.join(", "))
}

/// First and last index of the shortest run that holds most of the sum; of several the fullest.
fn shortest_run(amounts: &[f64]) -> (usize, usize) {
    let total: f64 = amounts.iter().sum();
    let mut best: Option<(usize, usize, f64)> = None;
    for first in 0..amounts.len() {
        for last in first..amounts.len() {
            let held: f64 = amounts[first..=last].iter().sum();
            let better = best.is_none_or(|(f, l, h)| {
                let (long, longest) = (last - first, l - f);
                long < longest || (long == longest && held > h)
            });
            if held >= MOST * total && better {
                best = Some((first, last, held));
            }
        }
    }
    best.map_or((0, amounts.len().saturating_sub(1)), |(f, l, _)| (f, l))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn amounts(list: &[(&str, f64)]) -> Amounts {
        let mut out = Amounts::default();
        for (name, amount) in list {
            out.add(name, *amount);
        }
        out
    }

    #[test]
    fn most_is_the_fewest_names_unless_it_is_everywhere() {
        let names = |list: &[(&str, f64)]| amounts(list).holding_most();
        assert_eq!(names(&[("a", 1.0), ("b", 7.0), ("c", 1.0)]), ["b"]);
        assert_eq!(
            names(&[("a", 4.0), ("b", 0.5), ("c", 4.0), ("d", -3.0)]),
            ["a", "c"]
        );
        assert!(names(&[("a", 1.0), ("b", 1.0), ("c", 1.0)]).is_empty());
        assert!(names(&[("a", 1.0)]).is_empty());
    }

    #[test]
    fn the_shortest_run_holds_most_and_of_several_the_fullest_is_taken() {
        assert_eq!(shortest_run(&[0.0, 1.0, 9.0, 1.0]), (2, 2));
        assert_eq!(shortest_run(&[3.0, 0.0, 3.0, 4.0]), (2, 3));
        assert_eq!(shortest_run(&[1.0, 1.0, 1.0]), (0, 1));
        assert_eq!(shortest_run(&[0.0, 1.0, 5.0, 4.0, 1.0]), (2, 3));
        assert_eq!(shortest_run(&[0.0, 0.0]), (0, 0));
    }

    #[test]
    fn the_place_in_cuts_is_named() {
        let cell = |cut: &str, axis: &str, order: usize, error: f64| {
            let sums = Sums {
                error,
                noise: 1.0,
                ..Sums::default()
            };
            (cut.to_string(), axis.to_string(), order, sums)
        };
        let all = |error: fn(&str, &str, usize) -> f64| {
            let mut cells = Vec::new();
            for cut in ["01", "02", "03"] {
                for axis in ["Fx", "Fy"] {
                    for order in 0..12 {
                        cells.push(cell(cut, axis, order, error(cut, axis, order)));
                    }
                }
            }
            cells
        };
        let tooth = all(|_, axis, order| if order == 6 && axis == "Fy" { 40.0 } else { 1.0 });
        let words = of_cuts(&tooth, true);
        assert_eq!(
            words.as_deref(),
            Some("at 6 times the rotation, in Fy, in all cuts")
        );
        assert_eq!(of_cuts(&tooth, false).as_deref(), Some("in Fy, in all cuts"));
        let mean = all(|cut, _, order| if order == 0 && cut == "02" { 40.0 } else { 1.0 });
        let words = of_cuts(&mean, true);
        assert_eq!(
            words.as_deref(),
            Some("in the mean force, in all axes, in cut 02")
        );
        assert_eq!(of_cuts(&all(|_, _, _| 0.9), true), None);
    }
}
