//! Is a pole there, with one and the same shape, for either half of the FRFs?

use std::cell::OnceCell;

use crate::modal::max_likelihood::joint_fit::{Data, Group};
use crate::modal::max_likelihood::ml_fit::{self, Solution};
use crate::modal::shape;

/// FRFs that make two halves.
const LEAST_FRFS: usize = 8;
/// The halves have a pole at one place if they differ by less than this share of its half-width, and of the way to the next pole …
const SAME_PLACE: f64 = 0.1;
/// … and in damping by less than this share.
const SAME_DAMPING: f64 = 0.2;
/// The MAC of the shapes that all FRFs have with the poles of either half: a pole that moves a little on the way to its neighbour takes
/// much of the neighbour's shape.
const SAME_SHAPE: f64 = 0.95;

/// The poles of a group fitted to every other FRF and to the rest, each with the residues of all FRFs; worked out when first asked for.
#[derive(Default)]
pub(super) struct Halves(OnceCell<Option<[Solution; 2]>>);

impl Halves {
    /// Whether both halves have pole `j` of the group; not where they cannot tell.
    pub fn agree(&self, data: &[Data], group: &Group, j: usize) -> bool {
        let Some([a, b]) = self.0.get_or_init(|| fit(data, group)) else {
            return false;
        };
        let pole = group.solution.poles[j];
        let next_hz = group
            .solution
            .poles
            .iter()
            .chain(group.solution.fixed())
            .map(|other| (other.frequency_hz - pole.frequency_hz).abs())
            .filter(|apart| *apart > 0.0)
            .fold(f64::INFINITY, f64::min);
        let reach_hz = SAME_PLACE * (pole.damping_ratio * pole.frequency_hz).min(next_hz);
        let [of_a, of_b] = [a, b].map(|half| half.poles[j]);
        (of_a.frequency_hz - of_b.frequency_hz).abs() < reach_hz
            && (of_a.damping_ratio - of_b.damping_ratio).abs() < SAME_DAMPING * pole.damping_ratio
            && shape::mac(&a.known_constants(j), &b.known_constants(j)) > SAME_SHAPE
    }
}

fn fit(data: &[Data], group: &Group) -> Option<[Solution; 2]> {
    if group.solution.taking_part() < LEAST_FRFS {
        return None;
    }
    let (poles, fixed) = (&group.solution.poles, group.solution.fixed());
    let all: Vec<_> = data.iter().map(|d| d.window(group.window_hz)).collect();
    let half = |first: usize| {
        let frfs: Vec<_> = all.iter().skip(first).step_by(2).cloned().collect();
        let own = ml_fit::fit(&frfs, poles, fixed, ml_fit::SETTLED).filter(|s| s.converged)?;
        // Any fall of the misfit will do: the poles stay where the half has them.
        ml_fit::fit(&all, &own.poles, fixed, f64::INFINITY)
    };
    Some([half(0)?, half(1)?])
}
