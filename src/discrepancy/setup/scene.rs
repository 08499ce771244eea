//! What the model predicts for files about which something is wrong.

use num_complex::Complex64;
use rayon::prelude::*;

use super::group::FrfGroup;
use super::mistake::{Distortion, Pushed};
use super::truth::Truth;
use crate::Result;
use crate::data::Axis;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData};
use crate::robot::FrfBasis;

/// A mistake of a given size in some of the files.
#[derive(Clone, Copy)]
pub struct Made<'m> {
    pub mistake: &'m dyn Distortion,
    pub group: FrfGroup,
    pub values: &'m [f64],
}

/// Curves in the order of `data.frfs()`, m/N.
pub type Curves = Vec<Vec<Complex64>>;

/// Predicted receptances of files with `made`.
pub fn predict(model: &StructureModel, theta: &[f64], data: &FrfData, made: Option<Made>) -> Result<Curves> {
    let per_block: Vec<Curves> = data
        .blocks
        .par_iter()
        .map(|block| {
            let concerned = |k: usize| made.is_some_and(|m| m.group.holds(&block.frfs[k]));
            let (with, without): (Vec<usize>, Vec<usize>) =
                (0..block.frfs.len()).partition(|k| concerned(*k));
            let mut curves = vec![Vec::new(); block.frfs.len()];
            pass(
                model,
                theta,
                block,
                None,
                0.0,
                (&without, Pushed::AlongHit),
                |k, _, truth| {
                    let frf = &block.frfs[k];
                    curves[k].push(truth.recorded(frf, truth.between(frf.response.axis, frf.reference.axis)));
                },
            )?;
            let spread = made.map(|m| (m, m.mistake.spread(m.values)));
            for (m, (weight, beside)) in spread
                .iter()
                .flat_map(|(m, lines)| lines.iter().map(move |l| (m, l)))
            {
                let mut line = vec![0; block.frfs.len()];
                let own = (&*with, m.mistake.forces());
                pass(model, theta, block, made, *beside, own, |k, omega, truth| {
                    let frf = &block.frfs[k];
                    let shown = truth.recorded(frf, m.mistake.shown(m.values, omega, truth, frf)) * *weight;
                    match curves[k].get_mut(line[k]) {
                        Some(sum) => *sum += shown,
                        None => curves[k].push(shown),
                    }
                    line[k] += 1;
                })?;
            }
            Ok(curves)
        })
        .collect::<Result<_>>()?;
    Ok(per_block.into_iter().flatten().collect())
}

/// Predicted receptances between all axes of each FRF's points, with the sign of the axes that its file names:
/// [response axis][reference axis].
pub fn predict_all_axes(model: &StructureModel, theta: &[f64], data: &FrfData) -> Result<[[Curves; 3]; 3]> {
    let per_block: Vec<[[Curves; 3]; 3]> = data
        .blocks
        .par_iter()
        .map(|block| {
            let mut curves: [[Curves; 3]; 3] =
                std::array::from_fn(|_| std::array::from_fn(|_| vec![Vec::new(); block.frfs.len()]));
            let members: Vec<usize> = (0..block.frfs.len()).collect();
            pass(
                model,
                theta,
                block,
                None,
                0.0,
                (&members, Pushed::AtHit),
                |k, _, truth| {
                    for a in Axis::ALL {
                        for b in Axis::ALL {
                            let value = truth.recorded(&block.frfs[k], truth.between(a, b));
                            curves[a.index()][b.index()][k].push(value);
                        }
                    }
                },
            )?;
            Ok(curves)
        })
        .collect::<Result<_>>()?;
    let mut all: [[Curves; 3]; 3] = Default::default();
    for block in per_block {
        for (row, own) in all.iter_mut().zip(block) {
            for (curves, own) in row.iter_mut().zip(own) {
                curves.extend(own);
            }
        }
    }
    Ok(all)
}

/// Sets the model up once for `members` of a block, all with `made` or all without, and shows each line of each, solved for
/// `forces` at frequencies that lie `beside_rad_per_s` its own.
fn pass(
    model: &StructureModel,
    theta: &[f64],
    block: &FrfBlock,
    made: Option<Made>,
    beside_rad_per_s: f64,
    (members, forces): (&[usize], Pushed),
    mut show: impl FnMut(usize, f64, &Truth),
) -> Result<()> {
    if members.is_empty() {
        return Ok(());
    }
    let filter = model.filter(theta, false);
    let kinematics = match made {
        Some(m) => m.mistake.kinematics(m.values, &block.kinematics),
        None => block.kinematics.clone(),
    };
    let chain = model.chain(theta, &kinematics, block.conditions, false);
    let kinematics = model.kinematics_at(theta, &kinematics);
    let mut points: Vec<usize> = members
        .iter()
        .flat_map(|&k| [block.frfs[k].response.point, block.frfs[k].reference.point])
        .collect();
    points.sort_unstable();
    points.dedup();
    let mut rows = Vec::with_capacity(3 * points.len());
    for &index in &points {
        let point = match made {
            Some(m) => m.mistake.point(m.values, index, &model.points[index]),
            None => model.points[index].clone(),
        };
        for axis in Axis::ALL {
            rows.push(model.robot.output_row(&chain, &kinematics, &point, axis, false));
        }
    }
    let basis = FrfBasis::new(&chain.system(0), &rows)?;
    let first = |point: usize| 3 * points.iter().position(|p| *p == point).unwrap_or(0);
    let firsts: Vec<[usize; 2]> = members
        .iter()
        .map(|&k| {
            [
                first(block.frfs[k].response.point),
                first(block.frfs[k].reference.point),
            ]
        })
        .collect();
    let hits = members.iter().zip(&firsts).map(|(&k, first)| (k, first));
    let mut pushed: Vec<usize> = hits
        .flat_map(|(k, [response, reference])| {
            let axis = block.frfs[k].reference.axis.index();
            match forces {
                Pushed::AlongHit => vec![reference + axis],
                Pushed::AtHit => (*reference..reference + 3).collect(),
                Pushed::AtBothPoints => (*reference..reference + 3)
                    .chain(*response..response + 3)
                    .collect(),
            }
        })
        .collect();
    pushed.sort_unstable();
    pushed.dedup();
    let decay = made.map_or(0.0, |m| m.mistake.decay_per_s(m.values));
    let ratio = made.map_or(1.0, |m| m.mistake.frequency_ratio(m.values));
    let moved = Complex64::new(decay, beside_rad_per_s);
    let rates: Vec<Complex64> = block.rates().into_iter().map(|s| s * ratio + moved).collect();
    basis.solve_lines(&rates, &pushed, |line, response| {
        for (&k, first) in members.iter().zip(&firsts) {
            let truth = Truth {
                basis: &basis,
                response,
                filter: &filter,
                first: *first,
                rate: rates[line],
            };
            show(k, rates[line].im, &truth);
        }
        Ok(())
    })
}

/// (predicted − measured) √2/σ as real numbers, FRF by FRF: each has unit variance where only noise is left.
pub fn weighted(predicted: &Curves, data: &FrfData) -> Vec<f64> {
    let mut residual = Vec::with_capacity(2 * data.value_count());
    for ((_, frf), curve) in data.frfs().zip(predicted) {
        for ((m, h), std) in curve.iter().zip(&frf.receptance).zip(&frf.noise_std) {
            let r = (m - h) * (std::f64::consts::SQRT_2 / std);
            residual.extend([r.re, r.im]);
        }
    }
    residual
}
