//! Which poles of many model orders are modes of the structure: the stabilisation diagram and its reading.
//!
//! A pole is compared with the nearest one of the order below, in frequency, damping and shape (MAC of its residues
//! over all FRFs). Poles that stay are chained from order to order; a chain that is long enough is a candidate, and
//! for each it is said why it was taken or left.

use faer::linalg::solvers::Solve;
use faer::{Mat, Side, unzip, zip};
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use super::shape::mac;
use crate::modal::single::local_fit::Pole;
use crate::modal::together::lscf::Order;

/// Relative change of frequency from one order to the next, at most.
pub const FREQUENCY_TOLERANCE: f64 = 0.01;
/// Relative change of damping, at most.
pub const DAMPING_TOLERANCE: f64 = 0.1;
/// MAC of the residues over all FRFs, at least.
pub const MAC_TOLERANCE: f64 = 0.95;
/// Orders in a row over which a pole must stay.
pub const ORDERS: usize = 4;
/// Above this a pole is no vibration mode.
pub(super) const MAX_DAMPING: f64 = 0.3;
/// Two chains closer than this part of their half-width and alike in shape are one.
const SAME_WIDTHS: f64 = 0.5;

/// How near a pole has to be to one of the order below to have stayed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Relative change of frequency, at most.
    pub frequency: f64,
    /// Relative change of damping, at most.
    pub damping: f64,
    /// MAC of the residues over all FRFs, at least.
    pub mac: f64,
    /// Orders in a row over which a pole must stay.
    pub orders: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Tolerances {
            frequency: FREQUENCY_TOLERANCE,
            damping: DAMPING_TOLERANCE,
            mac: MAC_TOLERANCE,
            orders: ORDERS,
        }
    }
}

/// How far a pole agrees with the order below.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stability {
    /// No pole of the order below is near in frequency.
    New,
    /// Frequency only.
    Frequency,
    /// Frequency and damping.
    Damping,
    /// Frequency, damping and shape.
    Full,
}

/// One pole in the diagram.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DiagramPole {
    /// Order of the fit that it belongs to.
    pub order: usize,
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Viscous damping ratio.
    pub damping_ratio: f64,
    /// What of it agrees with the order below.
    pub stability: Stability,
}

/// A pole that stayed over several orders, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Undamped natural frequency, Hz.
    pub frequency_hz: f64,
    /// Viscous damping ratio.
    pub damping_ratio: f64,
    /// Orders over which it stayed.
    pub orders: usize,
    /// Whether it became a mode.
    pub chosen: bool,
    /// Why it was taken or left, in words.
    pub why: String,
}

/// The stabilisation diagram of a set of FRFs.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Stabilisation {
    /// References taken together (1: common denominator).
    pub references: usize,
    /// Highest order of the diagram.
    pub max_order: usize,
    /// Poles of all orders.
    pub poles: Vec<DiagramPole>,
    /// Ascending in frequency.
    pub candidates: Vec<Candidate>,
}

#[derive(Clone)]
struct Link {
    pole: Pole,
    residues: Option<Vec<Complex64>>,
    stability: Stability,
    /// Index in the order below.
    before: Option<usize>,
    chain: usize,
}

/// Curves on common lines with common weights, for the shapes of the poles; `None` where lines differ.
pub(super) struct ShapeData<'a> {
    pub frequency_hz: &'a [f64],
    pub receptance: Vec<&'a [Complex64]>,
    pub weight: Vec<f64>,
}

/// Reads the poles of all orders.
pub(super) fn read(
    orders: &[Order],
    shapes: Option<&ShapeData>,
    references: usize,
    tolerances: &Tolerances,
) -> Stabilisation {
    let mut levels: Vec<Vec<Link>> = Vec::with_capacity(orders.len());
    let mut chains = 0;
    type OfOrder = (Vec<Pole>, Option<Vec<Vec<Complex64>>>);
    let of_orders: Vec<OfOrder> = orders
        .par_iter()
        .map(|order| {
            let damped = order.poles.iter().copied();
            let poles: Vec<Pole> = damped.filter(|p| p.damping_ratio < MAX_DAMPING).collect();
            let residues = shapes.and_then(|s| residues(s, &poles));
            (poles, residues)
        })
        .collect();
    for (index, (poles, residues)) in of_orders.into_iter().enumerate() {
        let mut level: Vec<Link> = poles
            .iter()
            .enumerate()
            .map(|(j, &pole)| Link {
                pole,
                residues: residues.as_ref().map(|r| r[j].clone()),
                stability: Stability::New,
                before: None,
                chain: usize::MAX,
            })
            .collect();
        if let Some(below) = index.checked_sub(1).map(|i| &levels[i]) {
            link(&mut level, below, tolerances);
        }
        for one in &mut level {
            let goes_on = one.stability >= Stability::Damping;
            one.chain = match one.before.filter(|_| goes_on) {
                Some(before) => levels[index - 1][before].chain,
                None => {
                    chains += 1;
                    chains - 1
                }
            };
        }
        levels.push(level);
    }
    let mut members: Vec<Vec<&Link>> = vec![Vec::new(); chains];
    for level in &levels {
        for one in level {
            members[one.chain].push(one);
        }
    }
    Stabilisation {
        references,
        max_order: orders.last().map_or(0, |o| o.order),
        poles: levels
            .iter()
            .zip(orders)
            .flat_map(|(level, order)| {
                level.iter().map(|one| DiagramPole {
                    order: order.order,
                    frequency_hz: one.pole.frequency_hz,
                    damping_ratio: one.pole.damping_ratio,
                    stability: one.stability,
                })
            })
            .collect(),
        candidates: candidates(members, tolerances),
    }
}

/// Pairs each pole with the nearest of the order below, nearest pairs first, each used once.
fn link(level: &mut [Link], below: &[Link], tolerances: &Tolerances) {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (j, one) in level.iter().enumerate() {
        for (i, other) in below.iter().enumerate() {
            let apart = (one.pole.frequency_hz / other.pole.frequency_hz - 1.0).abs();
            // Half a width counts as near too, for heavily damped modes.
            if apart < tolerances.frequency {
                // Damping and shape tell close modes apart.
                let damping = (one.pole.damping_ratio / other.pole.damping_ratio).ln().abs();
                let shape = likeness(one, other).map_or(0.0, |m| 1.0 - m);
                pairs.push((apart / tolerances.frequency + damping + shape, j, i));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut used = vec![false; below.len()];
    for (_, j, i) in pairs {
        if used[i] || level[j].before.is_some() {
            continue;
        }
        used[i] = true;
        let damping = (level[j].pole.damping_ratio / below[i].pole.damping_ratio - 1.0).abs();
        let alike = likeness(&level[j], &below[i]).unwrap_or(1.0);
        level[j].before = Some(i);
        level[j].stability = match (damping < tolerances.damping, alike >= tolerances.mac) {
            (true, true) => Stability::Full,
            (true, false) => Stability::Damping,
            _ => Stability::Frequency,
        };
    }
}

fn likeness(a: &Link, b: &Link) -> Option<f64> {
    Some(mac(a.residues.as_ref()?, b.residues.as_ref()?))
}

fn candidates(chains: Vec<Vec<&Link>>, tolerances: &Tolerances) -> Vec<Candidate> {
    let long_enough = |c: &Vec<&Link>| c.len() >= tolerances.orders;
    let mut long: Vec<Vec<&Link>> = chains.into_iter().filter(long_enough).collect();
    // The longest first: what is nearly the same joins it.
    long.sort_by_key(|c| std::cmp::Reverse(c.len()));
    let mut merged: Vec<Vec<&Link>> = Vec::new();
    for chain in long {
        let last = chain[chain.len() - 1];
        let same = merged.iter_mut().find(|other| {
            let first = other[other.len() - 1];
            let width = first.pole.damping_ratio.max(last.pole.damping_ratio) * first.pole.frequency_hz;
            let near = (first.pole.frequency_hz - last.pole.frequency_hz).abs() < SAME_WIDTHS * width;
            // Poles of one order are different poles by that.
            near && likeness(first, last).unwrap_or(1.0) > 0.8
        });
        match same {
            Some(other) => other.splice(0..0, chain).for_each(drop),
            None => merged.push(chain),
        }
    }
    let mut found: Vec<Candidate> = merged
        .iter()
        .map(|chain| {
            // The upper half of the orders: low ones are biased by what they cannot follow.
            let upper = &chain[chain.len() / 2..];
            let frequency_hz =
                crate::signal::median(&upper.iter().map(|l| l.pole.frequency_hz).collect::<Vec<_>>());
            let damping_ratio =
                crate::signal::median(&upper.iter().map(|l| l.pole.damping_ratio).collect::<Vec<_>>());
            let full = chain.iter().filter(|l| l.stability == Stability::Full).count();
            Candidate {
                frequency_hz,
                damping_ratio,
                orders: chain.len(),
                chosen: false,
                why: format!(
                    "stays over {} orders ({full} with shape): frequency within {} %, damping within {} %",
                    chain.len(),
                    100.0 * tolerances.frequency,
                    100.0 * tolerances.damping
                ),
            }
        })
        .collect();
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    found
}

/// Residues of all poles in all curves by linear least squares with a constant and a slope for the rest: by pole.
fn residues(data: &ShapeData, poles: &[Pole]) -> Option<Vec<Vec<Complex64>>> {
    let f = data.frequency_hz;
    let columns = poles.len() + 3;
    if poles.is_empty() || f.len() <= columns {
        return None;
    }
    let middle = f[f.len() / 2];
    let mut basis = Mat::<Complex64>::from_fn(f.len(), columns, |k, j| {
        let r = |p: &Pole| f[k] / p.frequency_hz;
        let value = match j.checked_sub(poles.len()) {
            None => {
                let (r, zeta) = (r(&poles[j]), poles[j].damping_ratio);
                1.0 / Complex64::new(1.0 - r * r, 2.0 * zeta * r)
            }
            Some(0) => Complex64::ONE,
            Some(1) => Complex64::from(f[k] / middle),
            Some(_) => Complex64::from((middle / f[k]).powi(2)),
        };
        value * data.weight[k]
    });
    for column in basis.col_iter_mut() {
        let norm = column.norm_l2().max(f64::MIN_POSITIVE);
        zip!(column).for_each(|unzip!(value)| *value /= norm);
    }
    let target = Mat::<Complex64>::from_fn(f.len(), data.receptance.len(), |k, m| {
        data.receptance[m][k] * data.weight[k]
    });
    let mut gram = basis.adjoint() * &basis;
    for j in 0..columns {
        gram[(j, j)] += 1e-12;
    }
    let x = gram.llt(Side::Lower).ok()?.solve(basis.adjoint() * target);
    Some(
        (0..poles.len())
            .map(|j| x.row(j).iter().copied().collect())
            .collect(),
    )
}
