//! Measured mode shapes at the nodes of a geometry, and next to those of a model (finite elements).

use std::collections::BTreeMap;

use num_complex::Complex64;

use super::mode_set::SetModes;
use crate::ingest::{Dof, Geometry, NodalShape};
use crate::modal::GlobalMode;
use crate::modal::shape::mac;

/// A node of the model belongs to a measured one within this part of the structure's size.
const SAME_PLACE: f64 = 0.03;
/// Modes are paired from this likeness on.
const PAIRED: f64 = 0.5;

/// Measured modes against a model's.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct ShapeComparison {
    /// Degrees of freedom that both have.
    pub common_dofs: usize,
    /// Measured ones that the model lacks.
    pub missing_dofs: Vec<String>,
    /// `place` or `number`: how nodes were matched.
    pub matched_by: &'static str,
    /// By measured mode, then model mode.
    pub mac: Vec<Vec<f64>>,
    /// Best likeness first taken, each mode once.
    pub pairs: Vec<ShapePair>,
    /// Of the model's modes, Hz.
    pub model_frequency_hz: Vec<f64>,
}

/// A measured mode and the model's that is most like it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ShapePair {
    /// Number of the measured mode, from 0.
    pub measured: usize,
    /// Number of the model's mode, from 0.
    pub model: usize,
    /// Measured frequency, Hz.
    pub measured_hz: f64,
    /// The model's frequency, Hz.
    pub model_hz: f64,
    /// Likeness of the shapes, 0 to 1.
    pub mac: f64,
    /// Model over measured frequency, less one.
    pub frequency_error: f64,
}

/// Displacement of each measured node in a mode: by node number along x, y, z; directions that were not measured are 0.
pub fn at_nodes(set: &SetModes, mode: &GlobalMode) -> BTreeMap<i64, [Complex64; 3]> {
    let mut found: BTreeMap<i64, [Complex64; 3]> = BTreeMap::new();
    for (dof, value) in measured(set, mode) {
        found.entry(dof.node).or_default()[dof.axis.index()] += signed(&dof, value);
    }
    found
}

/// Compares all modes of a set with a model's shapes. `None` where they have fewer than two degrees of freedom in common.
pub fn compare(
    set: &SetModes,
    places: Option<&Geometry>,
    model: &Geometry,
    shapes: &[NodalShape],
) -> Option<ShapeComparison> {
    let by_place = places.is_some_and(|p| !p.nodes.is_empty()) && !model.nodes.is_empty();
    let node_of = |node: i64| match (by_place, places) {
        (true, Some(places)) => nearest(places, model, node),
        _ => Some(node),
    };
    let known = |node: i64| shapes.first().is_some_and(|s| s.at_node.contains_key(&node));
    let mut common: Vec<(String, Dof, i64)> = Vec::new();
    let mut missing_dofs = Vec::new();
    for name in &set.dofs {
        let Ok(dof) = name.parse::<Dof>() else { continue };
        match node_of(dof.node).filter(|n| known(*n)) {
            Some(node) => common.push((name.clone(), dof, node)),
            None => missing_dofs.push(name.clone()),
        }
    }
    if common.len() < 2 || shapes.is_empty() {
        return None;
    }
    let of_model: Vec<Vec<Complex64>> = shapes
        .iter()
        .map(|shape| {
            let at = common.iter().map(|(_, dof, node)| {
                let value = shape
                    .at_node
                    .get(node)
                    .map_or(Complex64::ZERO, |v| v[dof.axis.index()]);
                signed(dof, value)
            });
            at.collect()
        })
        .collect();
    let table: Vec<Vec<f64>> = set
        .global
        .modes
        .iter()
        .map(|mode| {
            let own: Vec<Complex64> = common
                .iter()
                .map(|(name, ..)| {
                    let at = mode.shape.iter().find(|(k, _)| set.dofs.get(*k) == Some(name));
                    at.map_or(Complex64::ZERO, |(_, z)| *z)
                })
                .collect();
            of_model.iter().map(|shape| mac(&own, shape)).collect()
        })
        .collect();
    let mut order: Vec<(usize, usize)> = (0..table.len())
        .flat_map(|i| (0..shapes.len()).map(move |j| (i, j)))
        .filter(|(i, j)| table[*i][*j] >= PAIRED)
        .collect();
    order.sort_by(|a, b| table[b.0][b.1].total_cmp(&table[a.0][a.1]));
    let mut pairs: Vec<ShapePair> = Vec::new();
    for (i, j) in order {
        if pairs.iter().any(|p| p.measured == i || p.model == j) {
            continue;
        }
        let (measured_hz, model_hz) = (set.global.modes[i].frequency_hz, shapes[j].frequency_hz);
        pairs.push(ShapePair {
            measured: i,
            model: j,
            measured_hz,
            model_hz,
            mac: table[i][j],
            frequency_error: model_hz / measured_hz - 1.0,
        });
    }
    pairs.sort_by_key(|p| p.measured);
    Some(ShapeComparison {
        common_dofs: common.len(),
        missing_dofs,
        matched_by: if by_place { "place" } else { "number" },
        mac: table,
        pairs,
        model_frequency_hz: shapes.iter().map(|s| s.frequency_hz).collect(),
    })
}

fn measured(set: &SetModes, mode: &GlobalMode) -> Vec<(Dof, Complex64)> {
    let shape = mode.shape.iter();
    shape
        .filter_map(|(k, z)| Some((set.dofs.get(*k)?.parse::<Dof>().ok()?, *z)))
        .collect()
}

fn signed(dof: &Dof, value: Complex64) -> Complex64 {
    if dof.negative { -value } else { value }
}

/// The model's node at the place of a measured one.
fn nearest(places: &Geometry, model: &Geometry, node: i64) -> Option<i64> {
    let at = places.nodes.get(&node)?;
    let span = |k: usize| {
        let values = || places.nodes.values().map(|p| p[k]);
        values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min)
    };
    let size = (0..3).map(span).fold(0.0, f64::max).max(1e-6);
    let far = |p: &[f64; 3]| (0..3).map(|k| (p[k] - at[k]).powi(2)).sum::<f64>().sqrt();
    let (best, distance) = model
        .nodes
        .iter()
        .map(|(n, p)| (*n, far(p)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    (distance <= SAME_PLACE * size).then_some(best)
}
