//! Cuts for tests. Their forces are worked out tooth by tooth and slice by slice, as the text books state them, not by the
//! model that is fitted to them.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;

use crate::cutting::made_tools::{drill, endmill};
use crate::cutting::waveform::{DrillTerm, DrillingCut, MillingCut};
use crate::cutting::{EdgeBit, feed_mm};
use crate::data::{CutGeometry, Immersion, Process};
use crate::effects::cutting::CutSetting;
use crate::identify::forces::cutting_data::{CutData, CutKind, CuttingData, ForceChannel};
use crate::identify::forces::cutting_problem::CutFit;

pub(crate) const AS_IT_IS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Ktc Krc Kac, N/mm², and Kte Kre Kae, N/mm: about those of aluminium.
pub(crate) const METAL: [f64; 6] = [800.0, 300.0, 150.0, 20.0, 25.0, 3.0];
/// Blocks of a tenth of a second: air, steady cut, air; the middle of the record is at 0 s.
const BLOCKS: usize = 14;
const STEADY: std::ops::Range<usize> = 4..10;
/// Orders of a milled cut.
pub(crate) const ORDERS: usize = 12;

/// Middle of a block, s.
pub(crate) fn middle_s(block: usize) -> f64 {
    0.1 * block as f64 - 0.65
}

/// The zero of every channel: 3 N at the middle of the record, rising by 2 N/s.
pub(crate) fn zero(block: usize) -> f64 {
    3.0 + 2.0 * middle_s(block)
}

/// Errors of 1 N; levels stand `force` above [`zero`].
pub(crate) fn channel(force: impl Fn(usize) -> f64, orders: Vec<Complex64>) -> ForceChannel {
    ForceChannel {
        order_std: vec![1.0; orders.len()],
        orders,
        level: (0..BLOCKS).map(|b| force(b) + zero(b)).collect(),
        level_std: vec![1.0; BLOCKS],
        integral: vec![0.0; BLOCKS],
    }
}

pub(crate) fn cut(
    index: usize,
    kind: CutKind,
    geometry: &CutGeometry,
    forces: [Option<ForceChannel>; 4],
) -> CutData {
    let process = geometry.process();
    CutData {
        cut: index,
        id: format!("cut-{index}"),
        spindle_rpm: 3000.0,
        sample_rate_hz: 10_000.0,
        cutting_speed_m_per_min: 113.0,
        feed_mm: feed_mm(geometry),
        setting: CutSetting {
            process,
            progress: 0.0,
            speed_ratio: 1.0,
            feed_mm: feed_mm(geometry),
            teeth: 2,
            has_vibration: false,
        },
        order: None,
        kind,
        orders: forces[0].as_ref().map_or(0, |c| c.orders.len()),
        channels: forces,
        block_s: (0..BLOCKS)
            .map(|b| [middle_s(b) - 0.05, middle_s(b) + 0.05])
            .collect(),
        steady: STEADY,
        vibration: None,
        lines: Vec::new(),
        spindle: None,
    }
}

pub(crate) fn in_the_cut(block: usize) -> bool {
    STEADY.contains(&block)
}

/// Bars turned 1.5 mm deep with a sharp edge square to the feed: the radial force stands against the feed, the axial one points
/// out of the work (Altintas, Manufacturing Automation, 2nd ed., §2.6).
pub(crate) fn turned(coefficients: [f64; 6], feeds: &[f64]) -> CuttingData {
    let depth = 1.5;
    let made = feeds.iter().enumerate().map(|(i, &feed)| {
        let geometry = CutGeometry::Turning {
            feed_per_rev_mm: feed,
            depth_of_cut_mm: depth,
            diameter_mm: 40.0,
        };
        let [t, r, a, te, re, ae] = coefficients;
        let forces = [r * feed + re, a * feed + ae, t * feed + te].map(|k| k * depth);
        let of = |force: f64| Some(channel(|b| if in_the_cut(b) { force } else { 0.0 }, Vec::new()));
        let edge = vec![EdgeBit {
            length_mm: depth,
            chip_mm: feed,
            sin_kappa: 1.0,
            cos_kappa: 0.0,
        }];
        let [x, y, z] = forces.map(of);
        cut(i, CutKind::Turning { edge }, &geometry, [x, y, z, None])
    });
    CuttingData::new(Process::Turning, 1, AS_IT_IS, made.collect()).unwrap()
}

/// Ways to mill: feed per tooth and depth, mm; angles of entry and exit, degrees; angle that the tool has turned by at the record's
/// first sample, rad.
pub(crate) const MILLED: [[f64; 5]; 3] = [
    [0.05, 1.0, 0.0, 180.0, 0.4],
    [0.1, 2.0, 90.0, 180.0, -0.7],
    [0.08, 1.5, 0.0, 90.0, 1.2],
];

/// With a 12 mm end mill of two teeth and 30° of helix.
pub(crate) fn milled(coefficients: [f64; 6], ways: &[[f64; 5]]) -> CuttingData {
    let made = ways
        .iter()
        .enumerate()
        .map(|(i, &[feed, depth, from, to, turned])| {
            let geometry = CutGeometry::Milling {
                feed_per_tooth_mm: feed,
                axial_depth_mm: depth,
                immersion: Immersion {
                    start_rad: f64::to_radians(from),
                    exit_rad: f64::to_radians(to),
                },
            };
            let mill = MillingCut::new(&endmill(0.0, 90.0), &geometry).unwrap();
            let waves = waves(coefficients, feed, depth, [from, to], turned);
            let of = |[mean, orders]: [Vec<Complex64>; 2]| {
                Some(channel(|b| if in_the_cut(b) { mean[0].re } else { 0.0 }, orders))
            };
            let [x, y, z] = waves.map(of);
            let kind = CutKind::Milling {
                unit: Box::new(mill.linear(ORDERS)),
                cut: mill,
            };
            cut(i, kind, &geometry, [x, y, z, None])
        });
    CuttingData::new(Process::Milling, 2, AS_IT_IS, made.collect()).unwrap()
}

/// Ten slots and half slots of five feeds, of a metal ten times as hard as [`METAL`]: errors of 1 N hide nothing of its forces.
pub(crate) fn ten_hard_cuts() -> CuttingData {
    let ways = [0.05, 0.08, 0.1, 0.15, 0.2]
        .map(|feed| [[feed, 1.0, 0.0, 180.0, 0.4], [feed, 2.0, 90.0, 180.0, -0.7]]);
    milled(METAL.map(|k| 10.0 * k), &ways.concat())
}

/// Mean and orders of the forces of [`milled`]: dF_t = (K_tc h + K_te) dz with h = c sin φ and likewise dF_r, dF_a of each tooth in
/// each slice of the depth, turned into x, y, z (Altintas, Manufacturing Automation, 2nd ed., eq. 2.65 and 2.66).
fn waves(
    k: [f64; 6],
    feed: f64,
    depth: f64,
    immersion_deg: [f64; 2],
    turned: f64,
) -> [[Vec<Complex64>; 2]; 3] {
    let (angles, slices) = (7200, 25);
    let mut sums = [(); 3].map(|()| [vec![Complex64::ZERO; 1], vec![Complex64::ZERO; ORDERS]]);
    for i in 0..angles {
        let angle = TAU * (i as f64 + 0.5) / angles as f64;
        let mut force = [0.0; 3];
        for slice in 0..slices {
            let height = depth * (slice as f64 + 0.5) / slices as f64;
            let lag = height * f64::to_radians(30.0).tan() / 6.0;
            for tooth in 0..2 {
                let phi = (angle - turned - lag + 0.5 * TAU * tooth as f64).rem_euclid(TAU);
                if phi < immersion_deg[0].to_radians() || phi > immersion_deg[1].to_radians() {
                    continue;
                }
                let (s, c) = phi.sin_cos();
                let [t, r, a] = [0, 1, 2].map(|d| (k[d] * feed * s + k[d + 3]) * depth / slices as f64);
                force[0] += -t * c - r * s;
                force[1] += t * s - r * c;
                force[2] += a;
            }
        }
        for ([mean, orders], force) in sums.iter_mut().zip(force) {
            let share = force / angles as f64;
            mean[0] += share;
            for (n, order) in orders.iter_mut().enumerate() {
                *order += Complex64::from_polar(share, -((n + 1) as f64) * angle);
            }
        }
    }
    sums
}

/// Moment of the first contact in holes of [`drilled`], s.
pub(crate) const CONTACT_S: f64 = -0.55;

/// Holes of 9.5 mm drilled at 3000 rpm, with these feeds per turn and pilot holes, mm. Ktc, Kfc N/mm², Kte, Kfe N/mm.
pub(crate) fn drilled([ktc, kte, kfc, kfe]: [f64; 4], holes: &[[f64; 2]]) -> CuttingData {
    let made = holes.iter().enumerate().map(|(i, &[feed, pilot])| {
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm: feed,
            pilot_diameter_mm: pilot,
            hole_depth_mm: None,
        };
        let hole = DrillingCut::new(&drill(), &geometry, 3000.0).unwrap();
        // Half of the feed for each of the two lips, normal to them.
        let chip = 0.5 * feed * f64::to_radians(67.5).sin();
        let of = |term: DrillTerm, k: f64| {
            let force = |b: usize| {
                let [from, to] = [middle_s(b) - 0.05, middle_s(b) + 0.05];
                let unit = if b < STEADY.end {
                    hole.mean(term, from, to, CONTACT_S).0
                } else {
                    0.0
                };
                k * unit
            };
            Some(channel(force, Vec::new()))
        };
        let thrust = of(DrillTerm::Thrust, kfc * chip + kfe);
        let torque = of(DrillTerm::Torque, ktc * chip + kte);
        let kind = CutKind::Drilling {
            cut: hole,
            contact_s: [CONTACT_S - 0.05, CONTACT_S + 0.05],
        };
        cut(i, kind, &geometry, [None, None, thrust, torque])
    });
    CuttingData::new(Process::Drilling, 2, AS_IT_IS, made.collect()).unwrap()
}

/// Data whose cuts are changed.
pub(crate) fn changed(data: &CuttingData, change: impl Fn(&mut CutData)) -> CuttingData {
    let mut data = data.clone();
    for cut in &mut data.cuts {
        change(Arc::make_mut(cut));
    }
    data
}

/// Gives a cut the orders that the model has.
pub(crate) fn with_orders_of(cut: &mut CutData, fit: &CutFit) {
    let channels = cut.channels.iter_mut().flatten();
    for (channel, made) in channels.zip(fit.channels.iter().flatten()) {
        channel.orders.clone_from(&made.orders);
    }
}
