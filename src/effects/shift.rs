//! A part that shifts on its support: one stiffness, the same in all directions that give way.

use nalgebra::{DMatrix, Vector6};

use super::spot::Spot;
use super::{NEGLIGIBLE, PostureSetting};
use crate::parameter::Parameter;
use crate::robot::{Chain, Dual, Element, Role};

/// The stiffness, N/m.
pub(super) fn parameters() -> Vec<Parameter> {
    vec![Parameter::logarithmic(
        "stiffness_n_per_m",
        "N/m",
        1e7,
        2.5,
        [1e4, 1e11],
    )]
}

/// Where a fit starts besides.
pub(super) fn starts() -> Vec<Vec<f64>> {
    vec![vec![1e6], vec![1e8]]
}

/// As stiff as if it did not shift.
pub(super) fn vanishing(parameters: &[Parameter]) -> Option<Vec<f64>> {
    Some(vec![parameters[0].nominal / NEGLIGIBLE])
}

/// Lets the chain give way at `spots`, which are motions of one support.
pub(super) fn apply(
    spots: impl Iterator<Item = Spot>,
    role: Role,
    stiffness_n_per_m: &Dual,
    setting: &PostureSetting,
    chain: &mut Chain,
) {
    let motions: Vec<_> = spots.filter_map(|spot| spot.twist(setting.kinematics)).collect();
    let Some((place, at, _)) = motions.first().copied() else {
        return;
    };
    let directions: Vec<Vector6<f64>> = motions.iter().map(|(_, _, twist)| *twist).collect();
    chain.elements.push(Element {
        role,
        place,
        at,
        shape: DMatrix::identity(directions.len(), directions.len()),
        directions,
        stiffness: stiffness_n_per_m.clone(),
        damping: None,
    });
}
