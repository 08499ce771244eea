//! Modes of a set of FRFs (one structure in one state), all FRFs together.
//!
//! Noise of every FRF → poles of many orders ([`super::lscf`]) → the ones that stay ([`super::stabilisation`]), with
//! the peaks of the single FRFs as a safety net → maximum-likelihood refinement with needless poles taken out
//! ([`super::joint_fit`]) → noise again, from what the fit leaves over, and a last refinement.

use nalgebra::DMatrix;
use num_complex::Complex64;

use super::curve::{Curve, MIN_LINES};
use super::joint_fit::{self, Change, Data, Doubt, Group, Search};
use super::local_fit::Pole;
use super::lscf::{self, Row};
use super::stabilisation::{self, Candidate, ShapeData, Stabilisation};
use super::{FrfModes, GlobalMode, GlobalModes, Reconstruction, Settings, ml_fit, shape};
use crate::Result;
use crate::signal::frf_noise::{self, LeftOver};

/// Poles of the highest order: at least, and at most.
const POLES: [usize; 2] = [40, 80];
/// More references than this are not taken together.
const MAX_REFERENCES: usize = 6;
/// In sets of at least this many FRFs a mode seen by one of them alone must stand out far.
const SET: usize = 4;
const FAR: f64 = 100.0;
/// Below this many lines in the half-power band the record's leakage counts, see `analysis`.
const LEAKAGE_BELOW_LINES: f64 = 1.0;
const LEAKAGE_LINES: f64 = 0.02;
/// A piece of the band left with this many times the noise power is badly described.
const MISFIT: f64 = 2.0;
/// Lines of a piece: enough that a mode overlooked in it still stands out.
const BLOCK: usize = 48;
/// Modes with fewer lines in the half-power band are named.
const FINE_LINES: f64 = 3.0;

/// One FRF of a set, with what was found in it.
#[derive(Clone, Copy)]
pub struct SetMember<'a> {
    /// Ascending, Hz.
    pub frequency_hz: &'a [f64],
    /// As given to [`super::analyse_frf`], m/N.
    pub receptance_m_per_n: &'a [Complex64],
    pub modes: &'a FrfModes,
    /// Response and reference, as numbers that are equal where the degree of freedom is; `None` where not known.
    pub dofs: Option<[usize; 2]>,
}

/// Modes common to several FRFs of the same structure in the same state. The FRFs may have lines of their own.
///
/// # Errors
/// As [`super::analyse_frf`].
pub fn global(frfs: &[SetMember], settings: &Settings) -> Result<GlobalModes> {
    let mut result = GlobalModes::default();
    let (data, of_member) = prepare(frfs, settings, &mut result.warnings)?;
    result.reconstructions = vec![None; frfs.len()];
    let Some(band_hz) = band(&data) else {
        return Ok(result);
    };
    let members: Vec<&SetMember> = of_member.iter().map(|&m| &frfs[m]).collect();
    let single = single_peaks(&members);
    let rows = rows(&data, &members);
    let references = rows.first().map_or(1, |r| r.receptance.len());
    let lines = data.iter().map(|d| d.frequency_hz.len()).min().unwrap_or(0);
    let wanted_poles = (2 * single.len() + 20).clamp(POLES[0], POLES[1]).min(lines / 3);
    let orders = lscf::poles(&rows, band_hz, (wanted_poles / references).max(2));
    let mut diagram = stabilisation::read(&orders, shape_data(&data).as_ref(), references);

    let mut start: Vec<Pole> = diagram
        .candidates
        .iter()
        .map(|c| Pole {
            frequency_hz: c.frequency_hz,
            damping_ratio: c.damping_ratio,
        })
        .collect();
    for pole in single {
        let near = |p: &Pole| {
            (p.frequency_hz - pole.frequency_hz).abs()
                < 0.7 * pole.frequency_hz * p.damping_ratio.max(pole.damping_ratio)
        };
        if !start.iter().any(near) {
            start.push(pole);
            diagram.candidates.push(Candidate {
                frequency_hz: pole.frequency_hz,
                damping_ratio: pole.damping_ratio,
                orders: 0,
                chosen: false,
                why: "a peak of single FRFs that no order holds".into(),
            });
        }
    }
    start.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut changes = Vec::new();
    let mut data = data;
    let Some(groups) = solve(&mut data, &start, &mut changes) else {
        result
            .warnings
            .push("the FRFs together do not determine common poles: no global modes".into());
        result.stabilisation = diagram;
        return Ok(result);
    };
    collect(&groups, &data, &members, &of_member, &mut result);
    explain(&mut diagram, &result.modes, &changes);
    result.stabilisation = diagram;
    coarse_lines(&data, &mut result);
    Ok(result)
}

/// The FRFs within the band with their noise, and which member each is.
fn prepare(
    frfs: &[SetMember],
    settings: &Settings,
    warnings: &mut Vec<String>,
) -> Result<(Vec<Data>, Vec<usize>)> {
    // An FRF in which no mode says which way it turns goes with the others.
    let [mut turned, mut straight] = [0, 0];
    for frf in frfs.iter().filter(|f| !f.modes.modes.is_empty()) {
        *if frf.modes.conjugated {
            &mut turned
        } else {
            &mut straight
        } += 1;
    }
    if turned > 0 && straight > 0 {
        warnings.push(format!(
            "{turned} FRFs of the set are conjugated and {straight} are not: they come from different systems, or a peak is misread"
        ));
    }
    let mut data = Vec::new();
    let mut of_member = Vec::new();
    for (m, frf) in frfs.iter().enumerate() {
        let mut curve = Curve::from_receptance(frf.frequency_hz, frf.receptance_m_per_n, settings.band_hz)?;
        if curve.len() < MIN_LINES || curve.mobility.iter().all(|y| *y == Complex64::ZERO) {
            continue;
        }
        let conjugated = if frf.modes.modes.is_empty() {
            turned > straight
        } else {
            frf.modes.conjugated
        };
        if conjugated {
            curve.conjugate();
        }
        let receptance = curve
            .frequency_hz
            .iter()
            .zip(&curve.mobility)
            .map(|(f, y)| y / Complex64::new(0.0, std::f64::consts::TAU * f))
            .collect();
        data.push(Data {
            frequency_hz: curve.frequency_hz,
            receptance,
            sigma: Vec::new(),
        });
        of_member.push(m);
    }
    estimate_noise(&mut data);
    Ok((data, of_member))
}

/// Noise of each FRF, from those on the same lines together.
fn estimate_noise(data: &mut [Data]) {
    let mut todo: Vec<usize> = (0..data.len()).collect();
    while let Some(&first) = todo.first() {
        let (same, other): (Vec<usize>, Vec<usize>) = todo
            .iter()
            .partition(|&&k| data[k].frequency_hz == data[first].frequency_hz);
        let curves: Vec<&[Complex64]> = same.iter().map(|&k| data[k].receptance.as_slice()).collect();
        let estimates = frf_noise::estimate(&data[first].frequency_hz, &curves);
        for (&k, estimate) in same.iter().zip(estimates) {
            let size = rms(&data[k].receptance);
            let floor = |h: Complex64| (1e-6 * h.norm()).max(1e-9 * size);
            data[k].sigma = match estimate {
                Some(e) => e
                    .std
                    .iter()
                    .zip(&data[k].receptance)
                    .map(|(s, h)| s.max(floor(*h)))
                    .collect(),
                // Too few lines to tell: relative noise, as of a hammer; the residual scales it later.
                None => data[k]
                    .receptance
                    .iter()
                    .map(|h| (0.02 * h.norm()).max(1e-3 * size))
                    .collect(),
            };
        }
        todo = other;
    }
}

fn rms(values: &[Complex64]) -> f64 {
    (values.iter().map(|v| v.norm_sqr()).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn band(data: &[Data]) -> Option<[f64; 2]> {
    let first = data
        .iter()
        .filter_map(|d| d.frequency_hz.first())
        .copied()
        .reduce(f64::min)?;
    let last = data
        .iter()
        .filter_map(|d| d.frequency_hz.last())
        .copied()
        .reduce(f64::max)?;
    (last > first).then_some([first, last])
}

/// Poles of the single FRFs, one for each place: the best determined first.
fn single_peaks(members: &[&SetMember]) -> Vec<Pole> {
    let mut all: Vec<(f64, Pole)> = members
        .iter()
        .flat_map(|m| &m.modes.modes)
        .map(|mode| {
            let best = mode.best();
            let pole = Pole {
                frequency_hz: best.frequency_hz,
                damping_ratio: best.damping_ratio,
            };
            (best.damping_std.map_or(1.0, |s| s / best.damping_ratio), pole)
        })
        .collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut kept: Vec<Pole> = Vec::new();
    for (_, pole) in all {
        let width = |p: &Pole| p.frequency_hz * p.damping_ratio.max(pole.damping_ratio);
        if !kept
            .iter()
            .any(|p| (p.frequency_hz - pole.frequency_hz).abs() < width(p))
        {
            kept.push(pole);
        }
    }
    kept
}

/// Rows of the matrix fraction: one a response with all references where the set is a full grid on common lines,
/// else one an FRF. References are the shorter side of the grid (by reciprocity either side will do).
fn rows<'a>(data: &'a [Data], members: &[&SetMember]) -> Vec<Row<'a>> {
    if let Some(grid) = full_grid(data, members) {
        return grid
            .into_iter()
            .map(|row| {
                let lines = data[row[0]].frequency_hz.len();
                let weight = (0..lines).map(|k| {
                    let log: f64 = row.iter().map(|&m| weight(&data[m], k).ln()).sum();
                    (log / row.len() as f64).exp()
                });
                Row {
                    frequency_hz: &data[row[0]].frequency_hz,
                    weight: weight.collect(),
                    receptance: row.iter().map(|&m| data[m].receptance.as_slice()).collect(),
                }
            })
            .collect();
    }
    data.iter()
        .map(|d| Row {
            frequency_hz: &d.frequency_hz,
            receptance: vec![&d.receptance],
            weight: (0..d.frequency_hz.len()).map(|k| weight(d, k)).collect(),
        })
        .collect()
}

/// 1/σ, but never more than a thousandfold precision: exact data must not rest on a few lines.
fn weight(data: &Data, k: usize) -> f64 {
    1.0 / data.sigma[k].max(1e-3 * data.receptance[k].norm())
}

/// Indices of the FRFs by response, then reference.
fn full_grid(data: &[Data], members: &[&SetMember]) -> Option<Vec<Vec<usize>>> {
    let dofs: Vec<[usize; 2]> = members.iter().map(|m| m.dofs).collect::<Option<_>>()?;
    let sorted = |side: usize| {
        let mut ids: Vec<usize> = dofs.iter().map(|d| d[side]).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    let (responses, references) = (sorted(0), sorted(1));
    let (long, short, long_ids, short_ids) = if references.len() <= responses.len() {
        (0, 1, responses, references)
    } else {
        (1, 0, references, responses)
    };
    let complete = dofs.len() == long_ids.len() * short_ids.len();
    if !complete || short_ids.len() < 2 || short_ids.len() > MAX_REFERENCES {
        return None;
    }
    if data.windows(2).any(|w| w[0].frequency_hz != w[1].frequency_hz) {
        return None;
    }
    long_ids
        .iter()
        .map(|l| {
            let row = short_ids
                .iter()
                .map(|s| dofs.iter().position(|d| d[long] == *l && d[short] == *s));
            row.collect()
        })
        .collect()
}

/// All FRFs on common lines with common weights, `None` where they have lines of their own.
fn shape_data(data: &[Data]) -> Option<ShapeData<'_>> {
    if data.windows(2).any(|w| w[0].frequency_hz != w[1].frequency_hz) {
        return None;
    }
    let lines = data.first()?.frequency_hz.len();
    let weight =
        (0..lines).map(|k| (data.iter().map(|d| weight(d, k).ln()).sum::<f64>() / data.len() as f64).exp());
    Some(ShapeData {
        frequency_hz: &data[0].frequency_hz,
        weight: weight.collect(),
        receptance: data.iter().map(|d| d.receptance.as_slice()).collect(),
    })
}

/// Refinement with search, noise from the rest, refinement without search.
fn solve(data: &mut [Data], start: &[Pole], changes: &mut Vec<Change>) -> Option<Vec<Group>> {
    let mut groups = joint_fit::refine(data, start, Search::Rest, changes)?;
    // The first noise may have been wrong, and with it what was needless: search once more.
    for search in [Search::Pairs, Search::Nothing] {
        renew_noise(data, &groups);
        let mut poles: Vec<Pole> = groups
            .iter()
            .flat_map(|g| g.solution.poles.iter().copied())
            .collect();
        poles.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        let mut doubts: Vec<Option<Doubt>> = groups.into_iter().map(|g| g.doubt).collect();
        groups = joint_fit::refine(data, &poles, search, changes)?;
        if search == Search::Nothing && doubts.len() == groups.len() {
            for (group, doubt) in groups.iter_mut().zip(&mut doubts) {
                let same = |d: &Doubt| d.shifts.len() == group.solution.poles.len();
                group.doubt = doubt.take().filter(same);
            }
        }
    }
    Some(groups)
}

/// Noise of each FRF from what the fit leaves over. Lines whose group could not be fitted keep theirs. Where a piece of
/// the band is left far worse than the rest (leakage, drifting modes, lines below the sensor's range), it is that much
/// noisier: one bad end of the band must not decide what is needless elsewhere.
fn renew_noise(data: &mut [Data], groups: &[Group]) {
    let left_over: Vec<Vec<LeftOver>> = (0..data.len()).map(|m| left_over(&data[m], groups, m)).collect();
    let laws = frf_noise::laws_of_residuals(&left_over);
    for ((d, lines), law) in data.iter_mut().zip(&left_over).zip(laws) {
        let size = rms(&d.receptance);
        let fitted = lines.iter().filter(|l| l.squared.is_finite());
        let (count, level) = fitted.zip(&d.sigma).fold((0, 0.0), |(n, sum), (line, s)| {
            (n + 1, sum + line.squared / (s * s))
        });
        let scale = (level / f64::from(count.max(1))).sqrt().max(1e-6);
        for (sigma, line) in d
            .sigma
            .iter_mut()
            .zip(lines)
            .filter(|(_, l)| l.squared.is_finite())
        {
            *sigma = match &law {
                Some(law) => law
                    .std(line.frequency_hz, line.magnitude)
                    .max(1e-7 * line.magnitude)
                    .max(1e-10 * size),
                None => *sigma * scale,
            };
        }
    }
    // In a few FRFs alone a mode overlooked would hide in its own misfit.
    if data.len() < SET {
        return;
    }
    for [from, to] in blocks(data) {
        let (mut count, mut level) = (0, 0.0);
        for (d, lines) in data.iter().zip(&left_over) {
            for (line, sigma) in lines.iter().zip(&d.sigma) {
                if (from..to).contains(&line.frequency_hz) && line.squared.is_finite() {
                    level += line.squared / (sigma * sigma);
                    count += 1;
                }
            }
        }
        let excess = level / f64::from(count.max(1));
        if excess.is_finite() && excess > MISFIT {
            for d in data.iter_mut() {
                let sigmas = d.frequency_hz.iter().zip(&mut d.sigma);
                sigmas
                    .filter(|(f, _)| (from..to).contains(*f))
                    .for_each(|(_, sigma)| *sigma *= excess.sqrt());
            }
        }
    }
}

/// The band in pieces of at least [`BLOCK`] lines of the FRF that has most, Hz.
fn blocks(data: &[Data]) -> Vec<[f64; 2]> {
    let Some(finest) = data.iter().max_by_key(|d| d.frequency_hz.len()) else {
        return Vec::new();
    };
    let lines = &finest.frequency_hz;
    let count = (lines.len() / BLOCK).max(1);
    let edge = |k: usize| match k {
        0 => f64::NEG_INFINITY,
        k if k == count => f64::INFINITY,
        k => lines[k * lines.len() / count],
    };
    (0..count).map(|k| [edge(k), edge(k + 1)]).collect()
}

/// By line of FRF m; infinite where no group covers it.
fn left_over(data: &Data, groups: &[Group], m: usize) -> Vec<LeftOver> {
    let mut lines: Vec<LeftOver> = data
        .frequency_hz
        .iter()
        .zip(&data.receptance)
        .map(|(&frequency_hz, h)| LeftOver {
            frequency_hz,
            magnitude: h.norm(),
            squared: f64::INFINITY,
        })
        .collect();
    for group in groups {
        let found = &group.solution.frfs[m];
        let from = data.frequency_hz.partition_point(|&f| f < group.window_hz[0]);
        // The poles are shared by all FRFs and cost each of them next to nothing.
        let freedom = (1.0 - found.leverage).max(0.05);
        for (k, residual) in found.residual.iter().enumerate() {
            let line = &mut lines[from + k];
            line.magnitude = (data.receptance[from + k] - residual).norm();
            line.squared = residual.norm_sqr() / freedom;
        }
    }
    lines
}

fn collect(
    groups: &[Group],
    data: &[Data],
    members: &[&SetMember],
    of_member: &[usize],
    result: &mut GlobalModes,
) {
    let count = result.reconstructions.len();
    let mut hardly_seen = Vec::new();
    let mut without_width = Vec::new();
    for group in groups {
        let solution = &group.solution;
        if let Some(doubt) = &group.doubt {
            result.warnings.push(format!(
                "there may be one more mode at {:.2} Hz: the FRFs hardly tell it from its neighbour, whose standard \
                 deviations allow for it (more response points or another hammer point would tell)",
                doubt.pole.frequency_hz
            ));
        }
        if !solution.converged {
            result.warnings.push(format!(
                "the common fit between {:.1} and {:.1} Hz did not converge",
                group.window_hz[0],
                group.window_hz[1].min(
                    data.iter()
                        .filter_map(|d| d.frequency_hz.last())
                        .fold(0.0, |m: f64, f| m.max(*f))
                )
            ));
        }
        // What the fit leaves beyond the noise widens the standard deviations.
        let level = (solution.misfit / solution.degrees_of_freedom as f64)
            .max(1.0)
            .sqrt();
        for (j, pole) in solution.poles.iter().enumerate() {
            let (found_in, best) = joint_fit::seen_in(solution, j);
            if found_in == 0 || (data.len() >= SET && found_in < 2 && best < FAR) {
                hardly_seen.push(format!("{:.2}", pole.frequency_hz));
                continue;
            }
            let shift = group.doubt.as_ref().map_or([0.0; 2], |d| d.shifts[j]);
            let frequency_std_hz = (level * solution.frequency_std_hz(j)).hypot(shift[0]);
            let mut constants = vec![None; count];
            for m in 0..data.len() {
                let (value, std) = solution.constant(m, j);
                constants[of_member[m]] = Some((value, level * std));
            }
            let line_hz = data
                .iter()
                .map(|d| joint_fit::spacing_hz(&d.frequency_hz, pole.frequency_hz))
                .fold(f64::INFINITY, f64::min);
            let lines_in_half_power_band = 2.0 * pole.damping_ratio * pole.frequency_hz / line_hz;
            let mut damping_std = (level * solution.damping_std(j)).hypot(shift[1]);
            if lines_in_half_power_band < LEAKAGE_BELOW_LINES {
                damping_std = damping_std.hypot(LEAKAGE_LINES * line_hz / (2.0 * pole.frequency_hz));
            }
            if damping_std >= pole.damping_ratio && group.doubt.is_none() {
                without_width.push(format!("{:.2}", pole.frequency_hz));
                continue;
            }
            let shape = shape_of(solution, j, members);
            result.modes.push(GlobalMode {
                frequency_hz: pole.frequency_hz,
                damping_ratio: pole.damping_ratio,
                frequency_std_hz,
                damping_std,
                found_in,
                lines_in_half_power_band,
                complexity: shape::complexity(&shape.iter().map(|s| s.1).collect::<Vec<_>>()),
                shape,
                constants,
            });
        }
    }
    if !hardly_seen.is_empty() {
        result.warnings.push(format!(
            "hardly above the noise, in one FRF or none, and left out: {} Hz",
            hardly_seen.join(", ")
        ));
    }
    if !without_width.is_empty() {
        result.warnings.push(format!(
            "lines without a width that the FRFs determine (hum, a disturbance, or too coarse lines), left out: {} Hz",
            without_width.join(", ")
        ));
    }
    result
        .modes
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let complex: Vec<String> = result
        .modes
        .iter()
        .filter_map(|m| {
            let mpc = m.complexity.filter(shape::Complexity::is_low)?.mpc;
            Some(format!("{:.2} Hz ({mpc:.2})", m.frequency_hz))
        })
        .collect();
    if !complex.is_empty() {
        result.warnings.push(format!(
            "complex modes (phase collinearity under {}): {}: two modes taken for one, channels shifted in time, or noise",
            shape::COLLINEAR,
            complex.join(", ")
        ));
    }
    let residues: Vec<Vec<Complex64>> = result
        .modes
        .iter()
        .map(|m| m.constants.iter().flatten().map(|c| c.0).collect())
        .collect();
    result.mac = residues
        .iter()
        .map(|a| residues.iter().map(|b| shape::mac(a, b)).collect())
        .collect();
    let where_modes_are = around(&result.modes);
    for (m, d) in data.iter().enumerate() {
        result.reconstructions[of_member[m]] = Some(reconstruction(d, groups, m, where_modes_are));
    }
}

/// The band around the modes, Hz: what lies far outside says nothing about them.
fn around(modes: &[GlobalMode]) -> [f64; 2] {
    const REACH: f64 = 1.5;
    let frequencies = || modes.iter().map(|m| m.frequency_hz);
    match (frequencies().reduce(f64::min), frequencies().reduce(f64::max)) {
        (Some(first), Some(last)) => [first / REACH, last * REACH],
        _ => [0.0, f64::INFINITY],
    }
}

/// FRF m on the lines that a group covers; errors as mobility, within `band_hz`.
fn reconstruction(d: &Data, groups: &[Group], m: usize, band_hz: [f64; 2]) -> Reconstruction {
    let mut found = Reconstruction {
        error_nrms: 0.0,
        noise_nrms: 0.0,
        frequency_hz: Vec::with_capacity(d.frequency_hz.len()),
        measured_m_per_n: Vec::with_capacity(d.frequency_hz.len()),
        fitted_m_per_n: Vec::with_capacity(d.frequency_hz.len()),
    };
    let mut total = 0.0;
    for group in groups {
        let from = d.frequency_hz.partition_point(|&f| f < group.window_hz[0]);
        for (k, residual) in group.solution.frfs[m].residual.iter().enumerate() {
            let (f, h) = (d.frequency_hz[from + k], d.receptance[from + k]);
            found.frequency_hz.push(f);
            found.measured_m_per_n.push(h);
            found.fitted_m_per_n.push(h - residual);
            if (band_hz[0]..=band_hz[1]).contains(&f) {
                found.error_nrms += f * f * residual.norm_sqr();
                found.noise_nrms += (f * d.sigma[from + k]).powi(2);
                total += f * f * h.norm_sqr();
            }
        }
    }
    // Nothing measured there: nothing to be wrong about.
    let total = if total > 0.0 { total } else { 1.0 };
    found.error_nrms = (found.error_nrms / total).sqrt();
    found.noise_nrms = (found.noise_nrms / total).sqrt();
    found
}

/// Shape by response (or by FRF where degrees of freedom are not known), largest component 1.
fn shape_of(solution: &ml_fit::Solution, mode: usize, members: &[&SetMember]) -> Vec<(usize, Complex64)> {
    let constant = |m: usize| solution.constant(m, mode).0;
    let dofs: Option<Vec<[usize; 2]>> = members.iter().map(|m| m.dofs).collect();
    let Some(dofs) = dofs else {
        let all: Vec<Complex64> = (0..members.len()).map(constant).collect();
        return shape::normalised(&all).into_iter().enumerate().collect();
    };
    let unique = |side: usize| {
        let mut ids: Vec<usize> = dofs.iter().map(|d| d[side]).collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    // A roving hammer moves the excitation: then the references carry the shape.
    let (side, other) = if unique(1).len() > unique(0).len() {
        (1, 0)
    } else {
        (0, 1)
    };
    let (ids, others) = (unique(side), unique(other));
    let mut matrix = DMatrix::zeros(ids.len(), others.len());
    let mut filled = 0;
    for (m, dof) in dofs.iter().enumerate() {
        let at = (
            ids.iter().position(|i| *i == dof[side]),
            others.iter().position(|i| *i == dof[other]),
        );
        if let (Some(i), Some(j)) = at {
            matrix[(i, j)] = constant(m);
            filled += 1;
        }
    }
    if filled == ids.len() * others.len()
        && let Some(shape) = shape::from_residues(&matrix)
    {
        return ids.into_iter().zip(shape).collect();
    }
    // Gaps in the grid: the column that shows the mode best, as far as it was measured.
    let best = (0..others.len()).max_by(|&a, &b| matrix.column(a).norm().total_cmp(&matrix.column(b).norm()));
    let Some(best) = best else { return Vec::new() };
    let (measured, column): (Vec<usize>, Vec<Complex64>) = dofs
        .iter()
        .filter(|dof| dof[other] == others[best])
        .filter_map(|dof| ids.iter().position(|i| *i == dof[side]))
        .map(|i| (ids[i], matrix[(i, best)]))
        .unzip();
    measured.into_iter().zip(shape::normalised(&column)).collect()
}

/// Says of every candidate what became of it.
fn explain(diagram: &mut Stabilisation, modes: &[GlobalMode], changes: &[Change]) {
    let near = |a: f64, b: &Pole| (a / b.frequency_hz - 1.0).abs() < 0.7 * b.damping_ratio.max(0.003);
    for change in changes {
        if let Change::Added(pole) = change {
            diagram.candidates.push(Candidate {
                frequency_hz: pole.frequency_hz,
                damping_ratio: pole.damping_ratio,
                orders: 0,
                chosen: false,
                why: "what the fit left over has a resonance here".into(),
            });
        }
    }
    let mut owner: Vec<bool> = vec![false; modes.len()];
    for candidate in &mut diagram.candidates {
        let mode = modes
            .iter()
            .enumerate()
            .filter(|(k, m)| {
                let width = m.frequency_hz * m.damping_ratio.max(0.003);
                !owner[*k] && (m.frequency_hz - candidate.frequency_hz).abs() < width
            })
            .min_by(|(_, a), (_, b)| {
                let distance = |m: &GlobalMode| (m.frequency_hz - candidate.frequency_hz).abs();
                distance(a).total_cmp(&distance(b))
            });
        if let Some((k, mode)) = mode {
            owner[k] = true;
            candidate.chosen = true;
            candidate
                .why
                .push_str(&format!("; taken, seen in {} FRFs", mode.found_in));
            continue;
        }
        let why = changes
            .iter()
            .rev()
            .find_map(|change| match change {
                Change::Needless(p) if near(candidate.frequency_hz, p) => {
                    Some("left out: the FRFs are described as well without it")
                }
                Change::NotDetermined(p) if near(candidate.frequency_hz, p) => {
                    Some("left out: the lines do not determine it")
                }
                _ => None,
            })
            .unwrap_or("left out: joined another mode, or hardly above the noise");
        candidate.why.push_str("; ");
        candidate.why.push_str(why);
    }
    diagram
        .candidates
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
}

/// Three digits, without zeros at the end.
fn short(value: f64) -> String {
    let places = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// One line for the whole set.
fn coarse_lines(data: &[Data], result: &mut GlobalModes) {
    let coarse: Vec<String> = result
        .modes
        .iter()
        .filter(|m| m.lines_in_half_power_band < FINE_LINES)
        .map(|m| {
            format!(
                "at {} Hz lines the damping of the {:.1} Hz mode is uncertain to {:.0} %",
                short(
                    data.iter()
                        .map(|d| joint_fit::spacing_hz(&d.frequency_hz, m.frequency_hz))
                        .fold(f64::INFINITY, f64::min)
                ),
                m.frequency_hz,
                (100.0 * m.damping_std / m.damping_ratio).ceil()
            )
        })
        .collect();
    if !coarse.is_empty() {
        result.warnings.push(format!(
            "fewer than {FINE_LINES:.0} lines in the half-power band: {}",
            coarse.join("; ")
        ));
    }
}
#[cfg(test)]
mod tests {
    use super::super::analyse_frf;
    use super::super::synthetic::{Mode, Synthetic};
    use super::*;

    /// FRFs of modes with the given modal constants (one row an FRF).
    fn set(f_zeta: &[(f64, f64)], constants: &[Vec<f64>], noise: f64) -> Vec<(Vec<f64>, Vec<Complex64>)> {
        constants
            .iter()
            .enumerate()
            .map(|(k, row)| {
                let modes: Vec<Mode> = f_zeta
                    .iter()
                    .zip(row)
                    .map(|(&(f, z), &a)| Mode::new(f, z, a))
                    .collect();
                Synthetic::new(3.0, 60.0, 0.2, &modes)
                    .with_noise(0.0, noise, 100 + k as u64)
                    .frf()
            })
            .collect()
    }

    fn global_of(frfs: &[(Vec<f64>, Vec<Complex64>)]) -> GlobalModes {
        let settings = Settings::default();
        let modes: Vec<FrfModes> = frfs
            .iter()
            .map(|(f, h)| analyse_frf(f, h, &settings).unwrap())
            .collect();
        let members: Vec<SetMember> = frfs
            .iter()
            .zip(&modes)
            .map(|((f, h), modes)| SetMember {
                frequency_hz: f,
                receptance_m_per_n: h,
                modes,
                dofs: None,
            })
            .collect();
        global(&members, &settings).unwrap()
    }

    #[test]
    fn two_modes_within_one_half_power_band_are_told_apart_by_their_shapes() {
        // 8.0 and 8.2 Hz with half-widths of 0.25 Hz: one peak in every FRF.
        let modes = [(8.0, 0.03), (8.2, 0.03), (13.0, 0.03), (20.0, 0.02)];
        let constants = [
            vec![1.0, 0.3, 0.5, 1.0],
            vec![0.4, 1.0, -0.5, 1.0],
            vec![0.7, -0.5, 0.8, -0.6],
            vec![-0.3, 0.9, 1.0, 0.2],
            vec![1.0, 1.0, 0.3, 0.9],
        ];
        let found = global_of(&set(&modes, &constants, 0.02));
        assert_eq!(found.modes.len(), modes.len(), "{:?}", found.modes);
        for (found, (f, zeta)) in found.modes.iter().zip(modes) {
            assert!(
                (found.frequency_hz - f).abs() < 4.0 * found.frequency_std_hz,
                "{found:?} for {f} Hz"
            );
            assert!(
                (found.damping_ratio - zeta).abs() < 4.0 * found.damping_std,
                "{found:?} for {f} Hz"
            );
            assert!(found.damping_std < 0.05 * zeta, "{found:?}");
        }
    }

    #[test]
    fn a_second_mode_that_the_frfs_hardly_show_is_named_and_widens_the_first() {
        // As at a robot's tool: the second mode a tenth as strong, 1.6 half-widths above, in two driving points.
        let modes = [(7.07, 0.0376), (7.5, 0.0376), (14.2, 0.0376)];
        let mut said = 0;
        let mut misses = 0;
        for seed in 0..10 {
            let frfs: Vec<_> = [vec![1.0, 0.09, 0.8], vec![0.5, 0.04, 1.0]]
                .iter()
                .enumerate()
                .map(|(k, row)| {
                    let modes: Vec<Mode> = modes
                        .iter()
                        .zip(row)
                        .map(|(&(f, z), &a)| Mode::new(f, z, a))
                        .collect();
                    Synthetic::new(3.0, 30.0, 0.25, &modes)
                        .with_noise(0.0, 0.03, 2 * seed + k as u64)
                        .frf()
                })
                .collect();
            let found = global_of(&frfs);
            let first = &found.modes[0];
            let separated = found.modes.len() == 3;
            let named = found.warnings.iter().any(|w| w.contains("one more mode"));
            said += usize::from(separated || named);
            misses += usize::from((first.damping_ratio - 0.0376).abs() > 3.0 * first.damping_std);
        }
        assert!(said >= 7, "{said} of 10");
        assert!(misses <= 3, "{misses} of 10");
    }

    #[test]
    fn numbers_in_messages_have_three_digits() {
        let cases = [
            (0.03126, "0.0313"),
            (0.25, "0.25"),
            (1.0, "1"),
            (0.1 + 0.2, "0.3"),
            (120.0, "120"),
        ];
        for (value, expected) in cases {
            assert_eq!(short(value), expected);
        }
    }

    #[test]
    fn frfs_may_have_lines_of_their_own() {
        let modes = [Mode::new(12.0, 0.03, 1.0)];
        let frfs = vec![
            Synthetic::new(3.0, 60.0, 0.2, &modes)
                .with_noise(0.02, 0.0, 1)
                .frf(),
            Synthetic::new(3.0, 60.0, 0.25, &modes)
                .with_noise(0.02, 0.0, 2)
                .frf(),
        ];
        let found = global_of(&frfs);
        assert_eq!(found.modes.len(), 1);
        assert!((found.modes[0].damping_ratio - 0.03).abs() < 4.0 * found.modes[0].damping_std);
    }
}
