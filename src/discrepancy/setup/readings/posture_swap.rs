use super::super::finding::SetupFinding;
use super::super::reading::FileReading;
use super::super::scene::predict;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::Result;
use crate::data::Point;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;
use crate::robot::Kinematics;

/// Files filed under other postures than those that they were measured at.
pub struct PostureSwap {
    /// (posture in campaign.toml, posture in truth), where the two differ.
    moves: Vec<(usize, usize)>,
    /// By posture index, of those that have FRFs.
    kinematics: Vec<Option<Kinematics>>,
}

impl FileReading for PostureSwap {
    fn corrected(&self, data: &FrfData) -> FrfData {
        data.with_kinematics(|posture| {
            let (_, to) = self.moves.iter().find(|(from, _)| *from == posture)?;
            self.kinematics[*to].as_ref()
        })
    }

    fn finding(&self, data: &FrfData, _points: &[Point]) -> SetupFinding {
        let id = |p: usize| data.posture_ids.get(p).map_or("?", |id| id);
        let fits: Vec<String> = self
            .moves
            .iter()
            .map(|(from, to)| format!("the files of {} fit posture {}", id(*from), id(*to)))
            .collect();
        let exchanged = self.moves.len() == 2 && self.moves[0] == (self.moves[1].1, self.moves[1].0);
        let (place, remedy) = match exchanged {
            true => {
                let (a, b) = (id(self.moves[0].0), id(self.moves[0].1));
                (
                    format!("postures {a} and {b}"),
                    format!(
                        "Swap the files of {a} and {b} in campaign.toml: {}.",
                        fits.join(", ")
                    ),
                )
            }
            false => (
                format!(
                    "posture{} {}",
                    if self.moves.len() > 1 { "s" } else { "" },
                    self.moves
                        .iter()
                        .map(|(from, _)| id(*from))
                        .collect::<Vec<_>>()
                        .join(", ")
                ),
                format!("File them right in campaign.toml: {}.", fits.join(", ")),
            ),
        };
        SetupFinding {
            kind: "posture-swap",
            place,
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy,
        }
    }
}

/// Each posture's files under every posture's angles: the best one-to-one assignment, every exchange of two, and every
/// single file that fits elsewhere.
pub fn proposed(
    table: &DistanceTable,
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
) -> Result<Vec<Proposed>> {
    let postures = data.measured_postures();
    let kinematics: Vec<Option<Kinematics>> = data
        .kinematics_by_posture()
        .into_iter()
        .map(Option::<&_>::cloned)
        .collect();
    let n = postures.len();
    // cost[i][j]: files of posture i under the angles of posture j.
    let mut cost = vec![vec![0.0; n]; n];
    for (j, &target) in postures.iter().enumerate() {
        let other = data.with_kinematics(|_| kinematics[target].as_ref());
        let curves = predict(model, theta, &other, None)?;
        for (number, ((_, frf), curve)) in data.frfs().zip(&curves).enumerate() {
            let i = postures.iter().position(|p| *p == frf.posture).unwrap_or(0);
            cost[i][j] += match i == j {
                true => table.now[number],
                false => distance(curve.iter().copied(), frf),
            };
        }
    }
    let mut assignments: Vec<Vec<usize>> = vec![best_assignment(&cost)];
    for i in 0..n {
        for j in 0..n {
            if i < j {
                let mut exchanged: Vec<usize> = (0..n).collect();
                exchanged.swap(i, j);
                assignments.push(exchanged);
            }
            if i != j {
                let mut single: Vec<usize> = (0..n).collect();
                single[i] = j;
                assignments.push(single);
            }
        }
    }
    let identity: Vec<usize> = (0..n).collect();
    assignments.retain(|a| *a != identity);
    Ok(assignments
        .into_iter()
        .map(|assignment| {
            let gain = (0..n).map(|i| cost[i][i] - cost[i][assignment[i]]).sum();
            let moves = (0..n).filter(|i| assignment[*i] != *i);
            Proposed {
                reading: Box::new(PostureSwap {
                    moves: moves.map(|i| (postures[i], postures[assignment[i]])).collect(),
                    kinematics: kinematics.clone(),
                }),
                gain,
            }
        })
        .collect())
}

/// The one-to-one assignment of rows to columns with the least sum (Kuhn 1955, in the form with potentials of Jonker and
/// Volgenant 1987).
fn best_assignment(cost: &[Vec<f64>]) -> Vec<usize> {
    let n = cost.len();
    // Column 0 and row 0 are auxiliary.
    let (mut u, mut v) = (vec![0.0; n + 1], vec![0.0; n + 1]);
    let (mut row_of, mut before) = (vec![0usize; n + 1], vec![0usize; n + 1]);
    for i in 1..=n {
        row_of[0] = i;
        let mut column = 0;
        let mut least = vec![f64::INFINITY; n + 1];
        let mut used = vec![false; n + 1];
        while row_of[column] != 0 {
            used[column] = true;
            let row = row_of[column];
            let (mut delta, mut next) = (f64::INFINITY, 0);
            for j in 1..=n {
                if used[j] {
                    continue;
                }
                let reduced = cost[row - 1][j - 1] - u[row] - v[j];
                if reduced < least[j] {
                    least[j] = reduced;
                    before[j] = column;
                }
                if least[j] < delta {
                    delta = least[j];
                    next = j;
                }
            }
            for j in 0..=n {
                if used[j] {
                    u[row_of[j]] += delta;
                    v[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            column = next;
        }
        while column != 0 {
            let previous = before[column];
            row_of[column] = row_of[previous];
            column = previous;
        }
    }
    let mut assignment = vec![0; n];
    for j in 1..=n {
        if row_of[j] > 0 {
            assignment[row_of[j] - 1] = j - 1;
        }
    }
    assignment
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against all permutations.
    #[test]
    fn the_assignment_is_the_best_of_all() {
        let cost = |seed: u64| -> Vec<Vec<f64>> {
            let value = |i: u64, j: u64| (((seed * 31 + i * 17 + j * 7919) * 2_654_435_761) % 1000) as f64;
            (0..5).map(|i| (0..5).map(|j| value(i, j)).collect()).collect()
        };
        fn all(left: &mut Vec<usize>, chosen: &mut Vec<usize>, cost: &[Vec<f64>], best: &mut f64) {
            if left.is_empty() {
                let sum: f64 = chosen.iter().enumerate().map(|(i, j)| cost[i][*j]).sum();
                *best = best.min(sum);
                return;
            }
            for k in 0..left.len() {
                let j = left.remove(k);
                chosen.push(j);
                all(left, chosen, cost, best);
                chosen.pop();
                left.insert(k, j);
            }
        }
        for seed in 0..50 {
            let cost = cost(seed);
            let mut best = f64::INFINITY;
            all(&mut (0..5).collect(), &mut Vec::new(), &cost, &mut best);
            let found = best_assignment(&cost);
            let sum: f64 = found.iter().enumerate().map(|(i, j)| cost[i][*j]).sum();
            assert_eq!(sum, best, "{found:?}");
        }
    }
}
