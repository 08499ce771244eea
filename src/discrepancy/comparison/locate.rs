//! Where on the robot the misfit sits: at which joint another compliance, on which body another force would take most of
//! it away, whatever its law.
//!
//! A dynamic stiffness that the model lacks at a coordinate c changes every FRF by Y_oc · g(ω) · Y_ci (one matrix of rank
//! one a coordinate: Özgüven 1990, Structural modifications using frequency response functions). g is left free on every
//! line; what it can explain is projected out of residual and Jacobian, the model's parameters are refitted to the rest
//! (variable projection, Golub & Pereyra 1973), and the place that leaves least is the answer.

use nalgebra::{DMatrix, DVector, Vector3, Vector6};
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use crate::Result;
use crate::data::{Axis, Point};
use crate::identify::frfs::frf_data::{FrfBlock, FrfDatum};
use crate::identify::{FrfData, StructureModel};
use crate::robot::{Dual, Element, FrfBasis, Place, Role, Slot};

/// A joint or body and what it could explain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Location {
    /// `joint-4`, `link-3`, `tool`.
    pub place: String,
    /// Share of Σ|r|²/σ² above its expectation under noise that an unknown stiffness, damping or force there would take
    /// away, corrected for its freedom; below zero: less than chance would.
    pub share: f64,
    /// Σ|r|²/σ² that is left with it, for each value that its freedom leaves: 1 is noise.
    pub left: f64,
}

/// Lines of one posture that are looked at, at most: where much stands above the noise a few show where it comes from.
const LINES: usize = 40;
const LINES_WHERE_FAINT: usize = 200;
/// Misfit per value below which what stands above the noise is faint.
const FAINT: f64 = 1.5;
/// Places that are followed with all steps.
const FOLLOWED: usize = 4;
/// FRFs of a block from which on each posture has a law of its own; fewer could be explained from anywhere.
const RICH: usize = 9;
/// FRFs of a block from which on the axes of a place may be coupled.
const VERY_RICH: usize = 18;
/// Gauss–Newton steps of the model's own parameters.
const STEPS: usize = 4;
/// Standard deviations of Σ|r|²/σ² above its expectation from which on there is something to locate.
const SURE: f64 = 4.0;
/// Stiffness of the bearings whose tilt is asked about, against the stiffest joint: as good as rigid.
const RIGID: f64 = 1e3;
/// A pattern with less than this of its length outside the ones before it says nothing new.
const DEPENDENT: f64 = 1e-6;

/// What one place could explain.
struct Left {
    /// Σ|r|² weighted (2 a complex value under noise) plus twice the priors.
    chi2: f64,
    information: DMatrix<f64>,
    /// Steepest descent of half of it.
    descent: DVector<f64>,
    /// Real values that the free law can fit.
    freedom: f64,
}

/// One place: its name and the axes at which it can give way or be pushed.
struct Candidate {
    place: String,
    axes: std::ops::Range<usize>,
}

/// Joints and bodies by what they would explain, best first; empty where nothing stands above the noise.
///
/// # Errors
/// A model that has no response.
pub fn locate(model: &StructureModel, theta: &[f64], data: &FrfData) -> Result<Vec<Location>> {
    let misfit = misfit(model, theta, data)?;
    let count = 2.0 * data.value_count() as f64;
    if misfit - count < SURE * (2.0 * count).sqrt() {
        return Ok(Vec::new());
    }
    // Faint: near enough to the truth for one step, and every line counts.
    let (most, steps) = match misfit < FAINT * count {
        true => (LINES_WHERE_FAINT, 1),
        false => (LINES, STEPS),
    };
    let lines = data
        .blocks
        .iter()
        .map(|b| b.frequency_hz.len())
        .max()
        .unwrap_or(0);
    let data = data.thinned(lines.div_ceil(most).max(1), 1);
    let values = 2.0 * data.value_count() as f64;
    let plain = fit(model, theta, &data, &(0..0), steps)?;
    let above = plain.chi2 - values;
    if !(above > 0.0) {
        return Ok(Vec::new());
    }
    let location = |candidate: &Candidate, left: &Left| Location {
        place: candidate.place.clone(),
        share: (plain.chi2 - left.chi2 - left.freedom) / above,
        left: left.chi2 / (values - left.freedom).max(1.0),
    };
    let candidates = candidates(model);
    let look = |candidate: &Candidate, steps: usize| -> Result<Location> {
        Ok(location(
            candidate,
            &fit(model, theta, &data, &candidate.axes, steps)?,
        ))
    };
    let mut found: Vec<(Location, &Candidate)> = candidates
        .par_iter()
        .map(|c| Ok((look(c, 1)?, c)))
        .collect::<Result<_>>()?;
    let best_first = |a: &(Location, &Candidate), b: &(Location, &Candidate)| b.0.share.total_cmp(&a.0.share);
    found.sort_by(best_first);
    if steps > 1 {
        found
            .par_iter_mut()
            .take(FOLLOWED)
            .try_for_each(|(location, candidate)| {
                *location = look(candidate, steps)?;
                Ok::<_, crate::Error>(())
            })?;
        found.sort_by(best_first);
    }
    Ok(found.into_iter().map(|(location, _)| location).collect())
}

/// Σ r²/σ² over all lines, real and imaginary parts.
fn misfit(model: &StructureModel, theta: &[f64], data: &FrfData) -> Result<f64> {
    let predicted = model.predict(theta, data)?;
    let of_frf = |((_, frf), model): ((&FrfBlock, &FrfDatum), &Vec<Complex64>)| {
        let lines = frf.receptance.iter().zip(model).zip(&frf.noise_std);
        lines
            .map(|((h, m), std)| 2.0 * (h - m).norm_sqr() / (std * std))
            .sum::<f64>()
    };
    Ok(data.frfs().zip(&predicted).map(of_frf).sum())
}

/// Joints first, then bodies; three axes each, numbered through as `probe` has them.
fn candidates(model: &StructureModel) -> Vec<Candidate> {
    let joints = model.robot.joint_count();
    let of_joints = (1..=joints).map(|i| format!("joint-{i}"));
    let of_links = (1..joints).map(|i| format!("link-{i}"));
    of_joints
        .chain(of_links)
        .chain(std::iter::once("tool".to_string()))
        .enumerate()
        .map(|(k, place)| Candidate {
            place,
            axes: 3 * k..3 * k + 3,
        })
        .collect()
}

/// The model's parameters refitted together with a free law at `axes`.
fn fit(
    model: &StructureModel,
    theta: &[f64],
    data: &FrfData,
    axes: &std::ops::Range<usize>,
    steps: usize,
) -> Result<Left> {
    let bounds = model.bounds();
    let mut theta = theta.to_vec();
    let mut best = left(model, &theta, data, axes)?;
    for _ in 0..steps {
        let Some(cholesky) = best.information.clone().cholesky() else {
            break;
        };
        let step = cholesky.solve(&best.descent);
        let mut moved = false;
        for share in [1.0, 0.4, 0.1] {
            let trial: Vec<f64> = theta
                .iter()
                .zip(&step)
                .zip(&bounds)
                .map(|((t, s), [low, high])| (t + share * s).clamp(*low, *high))
                .collect();
            match left(model, &trial, data, axes) {
                Ok(next) if next.chi2 < best.chi2 => {
                    moved = best.chi2 - next.chi2 > 1e-3 * best.chi2;
                    (theta, best) = (trial, next);
                    break;
                }
                _ => (),
            }
        }
        if !moved {
            break;
        }
    }
    Ok(best)
}

fn left(
    model: &StructureModel,
    theta: &[f64],
    data: &FrfData,
    axes: &std::ops::Range<usize>,
) -> Result<Left> {
    let count = theta.len();
    let mut sum = Left {
        chi2: 0.0,
        information: DMatrix::zeros(count, count),
        descent: DVector::zeros(count),
        freedom: 0.0,
    };
    let mut blocks: Vec<(&FrfBlock, Vec<Line>)> = Vec::new();
    for block in &data.blocks {
        blocks.push((block.as_ref(), weighted(model, theta, block, axes)?));
    }
    // Where a posture has few FRFs, one law for all postures.
    let rich = data.blocks.iter().all(|b| b.frfs.len() >= RICH);
    let alike = blocks
        .windows(2)
        .all(|w| w[0].0.frequency_hz == w[1].0.frequency_hz);
    if rich || !alike {
        for line in blocks.iter().flat_map(|(_, lines)| lines) {
            sum.add(line.clone());
        }
    } else {
        for k in 0..blocks.first().map_or(0, |b| b.1.len()) {
            let mut together = Line::default();
            for (_, lines) in &blocks {
                together.append(&lines[k]);
            }
            sum.add(together);
        }
    }
    for (i, (parameter, t)) in model.parameters.iter().zip(theta).enumerate() {
        if let Some(prior) = parameter.prior {
            let [cost, slope, curvature] = prior.half_square(*t);
            sum.chi2 += 2.0 * cost;
            sum.descent[i] -= slope;
            sum.information[(i, i)] += curvature;
        }
    }
    Ok(sum)
}

/// Weighted values of one line: residual, Jacobian columns, patterns; one entry an FRF each.
#[derive(Debug, Clone, Default)]
struct Line {
    residual: Vec<Complex64>,
    slopes: Vec<Vec<Complex64>>,
    patterns: Vec<Vec<Complex64>>,
}

impl Line {
    fn append(&mut self, other: &Line) {
        self.residual.extend_from_slice(&other.residual);
        let extend = |to: &mut Vec<Vec<Complex64>>, from: &[Vec<Complex64>]| {
            to.resize(from.len().max(to.len()), Vec::new());
            to.iter_mut().zip(from).for_each(|(t, f)| t.extend_from_slice(f));
        };
        extend(&mut self.slopes, &other.slopes);
        extend(&mut self.patterns, &other.patterns);
    }
}

fn inner(a: &[Complex64], b: &[Complex64]) -> Complex64 {
    a.iter().zip(b).map(|(x, y)| x.conj() * y).sum()
}

fn remove(from: &mut [Complex64], unit: &[Complex64]) {
    let part = inner(unit, from);
    from.iter_mut().zip(unit).for_each(|(f, u)| *f -= part * u);
}

impl Left {
    /// Adds a line after what its patterns can explain is taken out.
    fn add(&mut self, mut line: Line) {
        let mut units: Vec<Vec<Complex64>> = Vec::new();
        for mut pattern in line.patterns {
            let length = inner(&pattern, &pattern).re.sqrt();
            for unit in &units {
                remove(&mut pattern, unit);
            }
            let new = inner(&pattern, &pattern).re.sqrt();
            if new > DEPENDENT * length && new > 0.0 && units.len() < line.residual.len() {
                pattern.iter_mut().for_each(|p| *p /= new);
                units.push(pattern);
            }
        }
        self.freedom += 2.0 * units.len() as f64;
        for unit in &units {
            remove(&mut line.residual, unit);
            line.slopes.iter_mut().for_each(|s| remove(s, unit));
        }
        self.chi2 += inner(&line.residual, &line.residual).re;
        for (i, a) in line.slopes.iter().enumerate() {
            self.descent[i] += inner(a, &line.residual).re;
            for (j, b) in line.slopes.iter().enumerate() {
                self.information[(i, j)] += inner(a, b).re;
            }
        }
    }
}

/// Residual, Jacobian and patterns of every line of a block.
fn weighted(
    model: &StructureModel,
    theta: &[f64],
    block: &FrfBlock,
    axes: &std::ops::Range<usize>,
) -> Result<Vec<Line>> {
    let predicted = model.predict_with_slopes(theta, block)?;
    let probe = match axes.is_empty() {
        true => None,
        false => Some(probe(model, theta, block, axes)?),
    };
    let mut lines = Vec::with_capacity(block.frequency_hz.len());
    for (k, f) in block.frequency_hz.iter().enumerate() {
        let weight: Vec<f64> = block
            .frfs
            .iter()
            .map(|frf| std::f64::consts::SQRT_2 / frf.noise_std[k])
            .collect();
        let each = || block.frfs.iter().zip(&predicted).zip(&weight);
        let mut line = Line {
            residual: each()
                .map(|((frf, p), w)| (frf.receptance[k] - p.receptance[k]) * *w)
                .collect(),
            slopes: (0..theta.len())
                .map(|i| each().map(|((_, p), w)| p.slopes(k)[i] * *w).collect())
                .collect(),
            patterns: Vec::new(),
        };
        if let Some(basis) = &probe {
            let response = basis.solve(std::f64::consts::TAU * f)?;
            let first = block.outputs.len();
            // [axis][output]: what a unit there moves.
            let reach: Vec<Vec<Complex64>> = (0..axes.len())
                .map(|axis| {
                    (0..first)
                        .map(|out| basis.receptance(&response, out, first + axis))
                        .collect()
                })
                .collect();
            let mut push = |a: usize, b: usize| {
                let of_frf = |frf: &FrfDatum| {
                    let out = frf.response_outputs[frf.response.axis.index()];
                    reach[a][out] * reach[b][frf.input] + reach[b][out] * reach[a][frf.input]
                };
                let each = block.frfs.iter().zip(&weight);
                line.patterns
                    .push(each.map(|(frf, w)| of_frf(frf) * (frf.sign * w)).collect());
            };
            for a in 0..axes.len() {
                push(a, a);
            }
            if block.frfs.len() >= VERY_RICH {
                for a in 0..axes.len() {
                    for b in 0..a {
                        push(a, b);
                    }
                }
            }
        }
        lines.push(line);
    }
    Ok(lines)
}

/// The block's outputs, then the coordinates of a place: a joint's turn and the tilt of its bearing about two axes
/// (transmitted moment per force), or a body's three displacements.
fn probe(
    model: &StructureModel,
    theta: &[f64],
    block: &FrfBlock,
    axes: &std::ops::Range<usize>,
) -> Result<FrfBasis> {
    let (robot, kinematics) = model.at(theta, &block.kinematics);
    let joints = robot.joint_count();
    let number = axes.start / 3;
    let mut chain = model.chain(theta, &block.kinematics, block.conditions, false);
    let joint_stiffness = chain.elements.iter().filter(|e| matches!(e.role, Role::Joint(_)));
    let stiffest = joint_stiffness.map(|e| e.stiffness.value).fold(0.0, f64::max);
    let mut coordinates = Vec::new();
    if number < joints {
        let joint = number + 1;
        let frame = kinematics.joint_frame(joint);
        let tilt = |axis: Vector3<f64>| {
            let a = frame.rotation * axis;
            Vector6::new(0.0, 0.0, 0.0, a.x, a.y, a.z)
        };
        chain.elements.push(Element {
            role: Role::Bearing,
            place: Place::new(joint, Slot::Joint),
            at: kinematics.joint_origin(joint),
            directions: vec![tilt(Vector3::x()), tilt(Vector3::y())],
            shape: DMatrix::identity(2, 2),
            stiffness: Dual::constant(RIGID * stiffest),
            damping: None,
        });
        let mut column = 0;
        for element in &chain.elements {
            if element.role == Role::Joint(joint) {
                coordinates.push(column);
            }
            column += element.directions.len();
        }
        coordinates.extend([column - 2, column - 1]);
    }
    let n = chain.coordinate_count();
    let of_point = |point: &Point, axis: Axis| robot.output_row(&chain, &kinematics, point, axis, false);
    let mut rows: Vec<DVector<f64>> = block
        .outputs
        .iter()
        .map(|(point, axis)| of_point(&model.points[*point], *axis))
        .collect();
    for column in coordinates {
        let mut row = DVector::zeros(n);
        row[column] = 1.0;
        rows.push(row);
    }
    if number >= joints {
        let link = number - joints + 1;
        for axis in 0..3 {
            let mut direction = Vector3::zeros();
            direction[axis] = 1.0;
            rows.push(match link < joints {
                true => chain.output_row(
                    robot.link_com(&kinematics, link),
                    Place::new(link, Slot::Body),
                    false,
                    &direction,
                ),
                false => chain.output_row(kinematics.tcp(), robot.flange_place(), true, &direction),
            });
        }
    }
    FrfBasis::new(&chain.system(0), &rows)
}

/// `joint 4`, `link 3`, `the tool`.
pub fn place_words(place: &str) -> String {
    match place {
        "tool" => "the tool".into(),
        other => other.replace('-', " "),
    }
}
