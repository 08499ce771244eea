//! Poles that stay from order to order, and which of them are modes.

use num_complex::Complex64;

use super::mode::OperationalMode;
use super::subspace::{OrderPoles, SubspacePole};
use crate::modal::shape::{self, mac};
use crate::modal::stabilisation::{
    DAMPING_TOLERANCE, DiagramPole, FREQUENCY_TOLERANCE, MAC_TOLERANCE, Stability,
};
use crate::modal::together::global_modes::RejectedMode;
use crate::signal::median;

/// A pole may be missing at this many orders in a row and still be the same.
const GAP: usize = 6;
/// Orders at which a pole must be there, and the share of all orders from its first one on.
const STAYS: (usize, f64) = (6, 0.25);
/// Share of a chain's poles that agree with the order below in damping and shape, at least.
const STEADY: f64 = 0.5;
/// A mode's damping is known to within this part of itself, and its frequency to within the second. Poles of single
/// orders that are not do not take part: that clears the diagram of most that noise makes (Döhler & Mevel 2013), and of
/// the orders at which a pole is about to part in two.
const KNOWN: (f64, f64) = (0.6, 0.02);
/// Phase collinearity below which a pole is noise rather than a complex mode.
const COLLINEAR: f64 = 0.5;
/// Poles of several orders closer than this many of their half-widths and alike in shape are one mode.
const SAME_WIDTHS: f64 = 0.7;

/// One pole over the orders.
pub(super) struct PoleChain<'a> {
    /// From the lowest order on: index of the order, the pole and how it agrees with the one before.
    links: Vec<(usize, &'a SubspacePole, Stability)>,
}

/// Chains the poles of neighbouring orders, nearest pairs first; fills the diagram.
pub(super) fn follow<'a>(orders: &'a [OrderPoles], diagram: &mut Vec<DiagramPole>) -> Vec<PoleChain<'a>> {
    let mut chains: Vec<PoleChain> = Vec::new();
    for (index, order) in orders.iter().enumerate() {
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        let known: Vec<bool> = order.poles.iter().map(is_known).collect();
        for (j, pole) in order.poles.iter().enumerate().filter(|(j, _)| known[*j]) {
            for (c, chain) in chains.iter().enumerate() {
                let (last, other, _) = chain.links[chain.links.len() - 1];
                let apart = (pole.frequency_hz / other.frequency_hz - 1.0).abs();
                if index - last > GAP + 1 || apart > FREQUENCY_TOLERANCE {
                    continue;
                }
                let unlike = 1.0 - mac(&pole.shape, &other.shape);
                let damping = (pole.damping_ratio / other.damping_ratio).ln().abs();
                pairs.push((apart / FREQUENCY_TOLERANCE + damping + unlike, j, c));
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut of_pole: Vec<Option<usize>> = vec![None; order.poles.len()];
        let mut taken = vec![false; chains.len()];
        for (_, j, c) in pairs {
            if of_pole[j].is_none() && !taken[c] {
                of_pole[j] = Some(c);
                taken[c] = true;
            }
        }
        for (j, (pole, chain)) in order.poles.iter().zip(of_pole).enumerate() {
            let stability = match chain {
                _ if !known[j] => Stability::New,
                Some(c) => {
                    let before = chains[c].links[chains[c].links.len() - 1].1;
                    let stability = agreement(pole, before);
                    chains[c].links.push((index, pole, stability));
                    stability
                }
                None => {
                    chains.push(PoleChain {
                        links: vec![(index, pole, Stability::New)],
                    });
                    Stability::New
                }
            };
            diagram.push(DiagramPole {
                order: order.order,
                frequency_hz: pole.frequency_hz,
                damping_ratio: pole.damping_ratio,
                stability,
            });
        }
    }
    chains
}

fn is_known(pole: &SubspacePole) -> bool {
    pole.damping_std <= KNOWN.0 * pole.damping_ratio && pole.frequency_std_hz <= KNOWN.1 * pole.frequency_hz
}

/// Damping agrees within the tolerance or within what it scatters by: from responses alone it is known far worse than
/// from FRFs.
fn agreement(pole: &SubspacePole, before: &SubspacePole) -> Stability {
    let apart = (pole.damping_ratio - before.damping_ratio).abs();
    let allowed = (DAMPING_TOLERANCE * before.damping_ratio).max(pole.damping_std.min(before.damping_ratio));
    match (apart <= allowed, mac(&pole.shape, &before.shape) >= MAC_TOLERANCE) {
        (true, true) => Stability::Full,
        (true, false) => Stability::Damping,
        _ => Stability::Frequency,
    }
}

/// Modes among the chains, and long chains that are none with the reason.
pub(super) fn choose(
    chains: &[PoleChain],
    orders: usize,
    channels: usize,
) -> (Vec<OperationalMode>, Vec<RejectedMode>) {
    let mut long: Vec<&PoleChain> = chains.iter().filter(|c| c.links.len() >= STAYS.0).collect();
    long.sort_by_key(|c| std::cmp::Reverse(c.links.len()));
    let mut modes: Vec<OperationalMode> = Vec::new();
    let mut rejected = Vec::new();
    for chain in long {
        let mode = summary(chain);
        let twin = modes.iter().find(|other| {
            let width = mode.damping_ratio.max(other.damping_ratio) * other.frequency_hz;
            (mode.frequency_hz - other.frequency_hz).abs() < SAME_WIDTHS * width
                && mac(&mode.shape, &other.shape) > 0.8
        });
        let reason = match twin {
            Some(twin) => Some(format!(
                "the same shape as the mode at {:.2} Hz, within its width",
                twin.frequency_hz
            )),
            None => fault(chain, &mode, orders, channels),
        };
        match reason {
            None => modes.push(mode),
            Some(reason) => rejected.push(RejectedMode {
                frequency_hz: mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                reason,
            }),
        }
    }
    modes.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    (modes, rejected)
}

/// Mean over the upper two thirds of a chain (low orders are biased by what they cannot follow), weighted with 1/σ²: at
/// an order that parts two nearly equal singular values all poles are badly determined. To the scatter between segments,
/// which all orders share, comes that between orders.
fn summary(chain: &PoleChain) -> OperationalMode {
    let upper = &chain.links[chain.links.len() / 3..];
    let weighted = |of: &dyn Fn(&SubspacePole) -> (f64, f64)| -> (f64, f64) {
        let (mut sum, mut weights) = (0.0, 0.0);
        for (value, std) in upper.iter().map(|l| of(l.1)) {
            let weight = 1.0 / (std * std).max(f64::MIN_POSITIVE);
            sum += weight * value;
            weights += weight;
        }
        let centre = sum / weights;
        let apart: Vec<f64> = upper.iter().map(|l| (of(l.1).0 - centre).abs()).collect();
        let own = (upper.len() as f64 / weights).sqrt();
        (centre, own.hypot(1.4826 * median(&apart)))
    };
    let (frequency_hz, frequency_std_hz) = weighted(&|p| (p.frequency_hz, p.frequency_std_hz));
    let (damping_ratio, damping_std) = weighted(&|p| (p.damping_ratio, p.damping_std));
    let surest = upper
        .iter()
        .min_by(|a, b| a.1.frequency_std_hz.total_cmp(&b.1.frequency_std_hz));
    let shape = surest.map_or_else(Vec::new, |l| l.1.shape.clone());
    let shape: Vec<Complex64> = shape::normalised(&shape);
    OperationalMode {
        frequency_hz,
        damping_ratio,
        frequency_std_hz,
        damping_std,
        orders: chain.links.len(),
        complexity: shape::complexity(&shape),
        shape,
        doubts: Vec::new(),
    }
}

/// Why a chain is no mode.
fn fault(chain: &PoleChain, mode: &OperationalMode, orders: usize, channels: usize) -> Option<String> {
    let first = chain.links[0].0;
    let possible = orders - first;
    let held = chain.links.len();
    if (held as f64) < STAYS.1 * possible as f64 {
        return Some(format!("there at {held} of {possible} orders only"));
    }
    let steady = chain.links.iter().filter(|l| l.2 == Stability::Full).count();
    if (steady as f64) < STEADY * held as f64 {
        return Some(format!(
            "damping and shape agree with the order below at {steady} of {held} orders only"
        ));
    }
    if mode.damping_std > KNOWN.0 * mode.damping_ratio || mode.frequency_std_hz > KNOWN.1 * mode.frequency_hz
    {
        return Some(format!(
            "scatters too much between segments: {:.2} ± {:.2} Hz, damping {:.1} ± {:.1} %",
            mode.frequency_hz,
            mode.frequency_std_hz,
            100.0 * mode.damping_ratio,
            100.0 * mode.damping_std
        ));
    }
    // Of two channels even noise is collinear half the time.
    match mode.complexity {
        Some(c) if channels > 2 && c.mpc < COLLINEAR => {
            Some(format!("no standing wave: collinearity {:.2}", c.mpc))
        }
        _ => None,
    }
}
