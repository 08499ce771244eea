//! What a fitted set says: modes with their uncertainty and shapes, the FRFs put together again from them, and what
//! became of every candidate.

use nalgebra::DMatrix;
use num_complex::Complex64;

use crate::modal::max_likelihood::joint_fit::{self, Change, Data, Group};
use crate::modal::max_likelihood::ml_fit::{self, Jackknife};
use crate::modal::quality::{self, Power};
use crate::modal::settings::SET;
use crate::modal::shape;
use crate::modal::single::local_fit::Pole;
use crate::modal::stabilisation::{Candidate, MAX_DAMPING, Stabilisation};
use crate::modal::together::global_modes::{GlobalMode, GlobalModes, RejectedMode};
use crate::modal::together::own_places;
use crate::modal::together::reconstruction::{Reconstruction, reconstruction};
use crate::modal::together::set_member::SetMember;
use crate::modal::together::verify::{self, Otherwise};

/// In a set a mode seen by one FRF alone must stand out this far (squared size over uncertainty).
const FAR: f64 = 100.0;
/// Below this many lines in the half-power band the record's leakage counts, see `analysis`.
const LEAKAGE_BELOW_LINES: f64 = 1.0;
const LEAKAGE_LINES: f64 = 0.02;
/// Modes with fewer lines in the half-power band are named …
const FINE_LINES: f64 = 3.0;
/// … where their damping is uncertain by more than this share of itself.
const UNCERTAIN: f64 = 0.02;
/// What poles anywhere explain scatters by about this without any model error.
const BY_CHANCE: f64 = 1.5;
/// What a few FRFs know to so many half-widths (or lines) only has no place.
const NOWHERE: f64 = 3.0;
/// A frequency that is uncertain by more than this share of the half-width is not given.
const UNPLACED: f64 = 0.3;
/// A line whose width is not known is a mode where the residues of its FRFs have a common phase (collinearity) …
const IN_PHASE: f64 = 0.9;
/// … which two of them have by chance.
const IN_PHASE_FROM: usize = 3;
/// A peak that the common fit lost is given where it is at least this share as high as the highest of an FRF.
const CLEARLY_HIGH: f64 = 0.05;
/// FRFs that scatter this many times as much as their noise makes them have more than noise.
const BEYOND_NOISE: f64 = 1.5;
/// Of what the mean over the FRFs and the common pole of a mode that moves are apart, this part is uncertainty.
const BETWEEN: f64 = 0.5;
/// The frequencies without the sensor's mass are uncertain by so many of the standard deviations that they move by: a mass that goes
/// round lowers a mode in proportion to φ², and FRFs count in proportion to φ². For a plate's shape, cos·cos, the mean of φ² is then
/// 2.05 standard deviations of it, for a beam's 3: twice this number.
const UNLOADED: f64 = 1.5;
/// Where a pole was left out, the rest is not explained if it is so many times the noise …
const LEFT_OVER_NOISE: f64 = 3.0;
/// … and beyond it this share of what was measured there.
const LEFT_SHARE: f64 = 0.005;
/// So many FRFs tell a broad mode from an error that goes on over many lines; fewer leave one doubtful whose damping ratio is so many
/// times the median of the modes', and this large.
const TELL_BROAD: usize = 3;
const FAR_BROADER: f64 = 3.0;
const BROAD: f64 = 0.03;
/// Two fits of the same lines disagree from this many standard deviations on.
const APART: f64 = 2.0;

/// `fitted`: what the groups were fitted to; `data`: every line with its random noise; `tested`: what did not stand the tests.
pub(crate) fn collect(
    groups: &[Group],
    fitted: &[Data],
    data: &[Data],
    members: &[&SetMember],
    of_member: &[usize],
    tested: &[RejectedMode],
    result: &mut GlobalModes,
) {
    let count = result.reconstructions.len();
    let mut hardly_seen = Vec::new();
    let mut without_width = Vec::new();
    let poles: Vec<Pole> = groups
        .iter()
        .flat_map(|g| g.solution.poles.iter().copied())
        .collect();
    let (mut scatters, mut moving) = (Vec::new(), 0);
    let mut elsewhere_hz = Vec::new();
    let complex_poles = verify::complex_poles(fitted, groups);
    let (mut movements, mut moved, mut complex_hz) = (Vec::new(), Vec::new(), Vec::new());
    let lines_hz = || data.iter().flat_map(|d| d.frequency_hz.iter().copied());
    let (first_hz, last_hz) = (
        lines_hz().fold(f64::INFINITY, f64::min),
        lines_hz().fold(0.0, f64::max),
    );
    for (g, group) in groups.iter().enumerate() {
        let solution = &group.solution;
        let frfs = solution.taking_part();
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
            .max(group.chance / BY_CHANCE)
            .max(1.0)
            .sqrt();
        for (j, pole) in solution.poles.iter().enumerate() {
            if let Some(reason) = impossible(data, pole) {
                result.rejected.push(RejectedMode::new(pole, reason));
                continue;
            }
            if complex_poles.parts_of_others.contains(&(g, j)) {
                result.rejected.push(RejectedMode::new(
                    pole,
                    "its FRFs have no common phase where those of the other modes have: a part of its neighbours, which move or bend",
                ));
                continue;
            }
            let (found_in, best) = joint_fit::seen_in(solution, j);
            if found_in == 0 || (frfs >= SET && found_in < 2 && best < FAR) {
                result.rejected.push(RejectedMode::new(
                    pole,
                    "hardly above the noise, in one FRF or none",
                ));
                hardly_seen.push(format!("{:.2}", pole.frequency_hz));
                continue;
            }
            let shift = group.doubt.as_ref().map_or([0.0; 2], |d| d.shifts[j]);
            let few = frfs < SET;
            let small_set = 1.0 + 1.5 / (frfs.max(2) - 1) as f64;
            let noise = [
                level * solution.frequency_std_hz(j) / pole.frequency_hz,
                level * solution.damping_std(j) / pole.damping_ratio,
            ];
            let scatter = scatter(solution, j, noise);
            let seen = solution.scatter_std(j);
            // The larger of what the noise says and of how the FRFs scatter about the common pole; where they do so beyond the
            // noise, what another weighting of them would make of it comes on top.
            let relative = [0, 1].map(|k| match few {
                true => noise[k],
                false => noise[k]
                    .max(small_set * seen[k])
                    .max(scatter[k].std)
                    .hypot(scatter[k].change),
            });
            let mut frequency_std_hz = (relative[0] * pole.frequency_hz).hypot(shift[0]);
            // An FRF whose band ends before the mode knows nothing of it.
            let known: Vec<Option<Complex64>> = (0..data.len())
                .map(|m| {
                    let reached = solution.frfs[m].took_part() && data[m].reaches(pole.frequency_hz);
                    reached.then(|| {
                        let (value, std) = solution.constant(m, j);
                        shape::as_known(value, std)
                    })
                })
                .collect();
            let mut constants = vec![None; count];
            for m in (0..data.len()).filter(|&m| known[m].is_some()) {
                let (value, std) = solution.constant(m, j);
                constants[of_member[m]] = Some((value, level * std));
            }
            let line_hz = joint_fit::line_hz(data, pole.frequency_hz);
            let lines_in_half_power_band = 2.0 * pole.damping_ratio * pole.frequency_hz / line_hz;
            let mut damping_std = (relative[1] * pole.damping_ratio).hypot(shift[1]);
            let others: Vec<Pole> = poles.iter().filter(|p| *p != pole).copied().collect();
            let moves = verify::moves(fitted, solution, j, *pole, &others);
            let (mut frequency_hz, mut damping_ratio) = (pole.frequency_hz, pole.damping_ratio);
            if let Some(moves) = moves {
                scatters.push(moves.scatter);
                moving += usize::from(moves.significant);
                if moves.significant {
                    (frequency_hz, damping_ratio) = (moves.pole.frequency_hz, moves.pole.damping_ratio);
                    let between = between(moves.pole, *pole);
                    frequency_std_hz = (small_set * moves.std[0])
                        .max(scatter[0].std * pole.frequency_hz)
                        .hypot(between[0]);
                    damping_std = (small_set * moves.std[1])
                        .max(scatter[1].std * pole.damping_ratio)
                        .hypot(between[1]);
                }
            }
            let common = Pole {
                frequency_hz,
                damping_ratio,
            };
            if let Some(own) =
                own_places::elsewhere(members, common, [frequency_std_hz, damping_std], &others)
            {
                (frequency_hz, damping_ratio) = (own.pole.frequency_hz, own.pole.damping_ratio);
                let between = between(own.pole, common);
                frequency_std_hz = (small_set * own.std[0]).hypot(between[0]);
                damping_std = (small_set * own.std[1]).hypot(between[1]);
                elsewhere_hz.push(frequency_hz);
            }
            if !(first_hz..=last_hz).contains(&frequency_hz) {
                result.rejected.push(RejectedMode {
                    frequency_hz,
                    damping_ratio,
                    reason: "beyond the measured lines, where nothing holds it".into(),
                });
                continue;
            }
            if lines_in_half_power_band < LEAKAGE_BELOW_LINES {
                damping_std = damping_std.hypot(LEAKAGE_LINES * line_hz / (2.0 * pole.frequency_hz));
            }
            if few {
                let apart = disagreement(members, *pole, [frequency_std_hz, damping_std]);
                frequency_std_hz = frequency_std_hz.hypot(apart[0]);
                damping_std = damping_std.hypot(apart[1]);
            }
            let phases: Vec<Complex64> = known.iter().flatten().copied().collect();
            let collinear = shape::complexity(&phases).is_none_or(|c| c.mpc > IN_PHASE);
            let width_hz = (pole.damping_ratio * pole.frequency_hz).max(line_hz);
            if !collinear && frequency_std_hz > UNPLACED * width_hz.hypot(shift[0]) {
                result.rejected.push(RejectedMode::new(
                    pole,
                    format!("the FRFs know its frequency to ±{frequency_std_hz:.2} Hz only, and have no common phase"),
                ));
                continue;
            }
            let without_place = frequency_std_hz > width_hz.hypot(shift[0]);
            // Where it may be anywhere, a damping that is known means nothing.
            if few && frequency_std_hz > NOWHERE * width_hz.hypot(shift[0]) {
                result.rejected.push(RejectedMode::new(
                    pole,
                    format!("its place is known to ±{frequency_std_hz:.2} Hz only"),
                ));
                continue;
            }
            if without_place && damping_std > pole.damping_ratio.hypot(shift[1]) {
                result.rejected.push(RejectedMode::new(
                    pole,
                    format!(
                        "the FRFs know neither its frequency (±{frequency_std_hz:.2} Hz) nor its damping"
                    ),
                ));
                continue;
            }
            // … in most of them; a disturbance has phases of its own.
            let in_phase = collinear && 2 * found_in > frfs && found_in > 2;
            if damping_std >= pole.damping_ratio && group.doubt.is_none() && !in_phase {
                result.rejected.push(RejectedMode::new(
                    pole,
                    "a line whose width the FRFs do not determine",
                ));
                without_width.push(format!("{:.2}", pole.frequency_hz));
                continue;
            }
            let shape = shape_of(&known, members);
            if complex_poles.modes.contains(&(g, j)) {
                complex_hz.push(frequency_hz);
            }
            let movement = verify::movement(solution, j);
            movements.extend(movement);
            moved.push(movement.map(|m| m.scatter));
            result.modes.push(GlobalMode {
                frequency_hz,
                damping_ratio,
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
    let moves_slightly = verify::set_moves(&movements);
    if moves_slightly.is_some() {
        // A mode that few FRFs tell of moves as the others do.
        let usual = crate::signal::median(&moved.iter().copied().flatten().collect::<Vec<f64>>());
        for (mode, own) in result.modes.iter_mut().zip(moved) {
            let moved_hz = own.unwrap_or(usual) * mode.frequency_hz;
            mode.frequency_std_hz = mode.frequency_std_hz.hypot(UNLOADED * moved_hz);
        }
    }
    let (own_hz, missed_hz) = by_themselves(members, of_member, result);
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
    for (wanted, why) in [
        (
            true,
            "their shapes are complex, and either half of the FRFs has the same (damping at single points, parts that \
             turn, channels shifted in time)",
        ),
        (
            false,
            "two modes taken for one, channels shifted in time, or noise",
        ),
    ] {
        let complex: Vec<String> = result
            .modes
            .iter()
            .filter(|m| complex_hz.contains(&m.frequency_hz) == wanted)
            .filter_map(|m| {
                let mpc = m.complexity.filter(shape::Complexity::is_low)?.mpc;
                Some(format!("{:.2} Hz ({mpc:.2})", m.frequency_hz))
            })
            .collect();
        if !complex.is_empty() {
            result.warnings.push(format!(
                "complex modes (phase collinearity under {}): {}: {why}",
                shape::COLLINEAR,
                complex.join(", ")
            ));
        }
    }
    result.mac = mac(&result.modes);
    let where_modes_are = around(&result.modes);
    let mut power = Power::default();
    let mut unexplained: Vec<(&RejectedMode, LeftThere)> = result
        .rejected
        .iter()
        .chain(tested)
        .map(|rejected| (rejected, LeftThere::default()))
        .collect();
    for (m, d) in data.iter().enumerate() {
        let found = reconstruction(d, groups, m, where_modes_are);
        let from = found.frequency_hz.partition_point(|&f| f < where_modes_are[0]);
        let to = found.frequency_hz.partition_point(|&f| f <= where_modes_are[1]);
        let lines = (from..to).map(|k| {
            let (measured, fitted) = (found.measured_m_per_n[k], found.fitted_m_per_n[k]);
            let line = d.frequency_hz.partition_point(|&f| f < found.frequency_hz[k]);
            (found.frequency_hz[k], measured, measured - fitted, d.sigma[line])
        });
        power.add(of_member[m] + 1, lines);
        for (rejected, left) in &mut unexplained {
            left.add(d, &found, rejected);
        }
        result.reconstructions[of_member[m]] = Some(found);
    }
    let mut left_out_hz: Vec<f64> = unexplained
        .iter()
        .filter(|(_, left)| left.is_much())
        .map(|(rejected, _)| rejected.frequency_hz)
        .collect();
    left_out_hz.sort_by(f64::total_cmp);
    if !result.modes.is_empty() {
        let much = moving > 0 && 2 * moving >= scatters.len();
        // What a pole leaves that moves from FRF to FRF is told as movement.
        if much || moves_slightly.is_some() {
            left_out_hz.clear();
        }
        let doubts = groups.iter().filter(|g| g.doubt.is_some()).count();
        let found = quality::SetFindings {
            power,
            frequency_scatter: match (much, moves_slightly) {
                (false, Some(scatter)) => Some(scatter),
                _ => (!scatters.is_empty()).then(|| crate::signal::median(&scatters)),
            },
            moving: much || moves_slightly.is_some(),
            left_out_hz,
            broad_hz: far_broader(&result.modes, data.len()),
            doubts,
            elsewhere_hz,
            own_hz,
            missed_hz,
            converged: groups.iter().all(|g| g.solution.converged),
        };
        result.quality = quality::judge_set(&found);
    }
}

/// The modes of a set of very few FRFs that are far broader than most.
fn far_broader(modes: &[GlobalMode], frfs: usize) -> Vec<f64> {
    if frfs >= TELL_BROAD {
        return Vec::new();
    }
    let usual = crate::signal::median(&modes.iter().map(|m| m.damping_ratio).collect::<Vec<_>>());
    let far = (FAR_BROADER * usual).max(BROAD);
    let broad = modes.iter().filter(|m| m.damping_ratio > far);
    broad.map(|m| m.frequency_hz).collect()
}

/// Powers where a pole was left out, in its half-power band, summed over the FRFs.
#[derive(Default)]
struct LeftThere {
    measured: f64,
    left: f64,
    noise: f64,
}

impl LeftThere {
    fn add(&mut self, data: &Data, found: &Reconstruction, pole: &RejectedMode) {
        let line_hz = joint_fit::spacing_hz(&data.frequency_hz, pole.frequency_hz);
        let half_hz = (pole.damping_ratio * pole.frequency_hz).max(1.5 * line_hz);
        let from = found
            .frequency_hz
            .partition_point(|&f| f < pole.frequency_hz - half_hz);
        let to = found
            .frequency_hz
            .partition_point(|&f| f <= pole.frequency_hz + half_hz);
        for k in from..to {
            let line = data.frequency_hz.partition_point(|&f| f < found.frequency_hz[k]);
            self.measured += found.measured_m_per_n[k].norm_sqr();
            self.left += (found.measured_m_per_n[k] - found.fitted_m_per_n[k]).norm_sqr();
            self.noise += data.sigma.get(line).map_or(0.0, |sigma| sigma * sigma);
        }
    }

    /// What noise does not explain, and which is more than a test lacks anyway.
    fn is_much(&self) -> bool {
        self.left > LEFT_OVER_NOISE * self.noise && self.left - self.noise > LEFT_SHARE * self.measured
    }
}

/// MAC of every two modes, of their shapes. (Over all FRFs of several references the residues of one shape differ by how strongly each
/// reference drives it: a mode that two references have at two places would look like two.)
pub(crate) fn mac(modes: &[GlobalMode]) -> Vec<Vec<f64>> {
    let places = modes
        .iter()
        .flat_map(|m| &m.shape)
        .map(|(place, _)| place + 1)
        .max();
    let shapes: Vec<Vec<Complex64>> = modes
        .iter()
        .map(|m| {
            let mut shape = vec![Complex64::ZERO; places.unwrap_or(0)];
            m.shape.iter().for_each(|(place, value)| shape[*place] = *value);
            shape
        })
        .collect();
    shapes
        .iter()
        .map(|a| shapes.iter().map(|b| shape::mac(a, b)).collect())
        .collect()
}

/// Gives clear peaks of the FRFs that no common mode accounts for as modes where the FRFs move in one phase there; of those given, and of
/// those that are not, the frequencies, Hz.
pub(crate) fn by_themselves(
    members: &[&SetMember],
    of_member: &[usize],
    result: &mut GlobalModes,
) -> (Vec<f64>, Vec<f64>) {
    let (mut given, mut not_given) = (Vec::new(), Vec::new());
    for missed in own_places::missed(members, &result.modes) {
        let Pole {
            frequency_hz,
            damping_ratio,
        } = missed.own.pole;
        if damping_ratio >= MAX_DAMPING {
            continue;
        }
        let mut known = vec![None; members.len()];
        let mut constants = vec![None; result.reconstructions.len()];
        for &(m, value, std) in &missed.constants {
            known[m] = Some(shape::as_known(value, std));
            constants[of_member[m]] = Some((value, std));
        }
        let phases: Vec<Complex64> = known.iter().flatten().copied().collect();
        let in_phase =
            phases.len() < IN_PHASE_FROM || shape::complexity(&phases).is_some_and(|c| c.mpc > IN_PHASE);
        if phases.is_empty() || !in_phase || missed.height < CLEARLY_HIGH {
            not_given.push(frequency_hz);
            continue;
        }
        given.push(frequency_hz);
        let shape = shape_of(&known, members);
        result.modes.push(GlobalMode {
            frequency_hz,
            damping_ratio,
            frequency_std_hz: missed.own.std[0],
            damping_std: missed.own.std[1],
            found_in: missed.constants.len(),
            lines_in_half_power_band: missed.lines_in_half_power_band,
            complexity: shape::complexity(&shape.iter().map(|s| s.1).collect::<Vec<_>>()),
            shape,
            constants,
        });
    }
    result
        .modes
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    (given, not_given)
}

/// Why a pole cannot be a mode of these lines: it stands for what the model lacks.
fn impossible(data: &[Data], pole: &Pole) -> Option<String> {
    if !data.iter().any(|d| d.reaches(pole.frequency_hz)) {
        return Some("outside the lines that were measured: what lies beyond the band".into());
    }
    (pole.damping_ratio >= MAX_DAMPING).then(|| {
        format!(
            "a damping ratio of {:.0} % is beyond what a mode can have ({:.0} %): what the other modes leave unexplained",
            100.0 * pole.damping_ratio,
            100.0 * MAX_DAMPING
        )
    })
}

/// What two answers leave open of a mode (frequency, Hz; damping ratio).
fn between(a: Pole, b: Pole) -> [f64; 2] {
    [a.frequency_hz - b.frequency_hz, a.damping_ratio - b.damping_ratio].map(|apart| BETWEEN * apart)
}

/// How the FRFs scatter about a common pole (frequency, damping ratio), where that is beyond `noise` (relative): the model
/// lacks something then. Nothing where it is not: the noise tells the same more exactly.
fn scatter(solution: &ml_fit::Solution, j: usize, noise: [f64; 2]) -> [Otherwise; 2] {
    let left_out = solution.jackknife(j);
    let otherwise = verify::otherwise(solution, j).unwrap_or_default();
    // A few FRFs scatter much by chance.
    [0, 1].map(|k| {
        let Jackknife { std, few } = left_out[k];
        match std > BEYOND_NOISE * few * noise[k] {
            true => Otherwise {
                change: otherwise[k].change,
                std: (few * std).max(otherwise[k].std),
            },
            false => Otherwise::default(),
        }
    })
}

/// How far the FRFs' own local fits are from a common pole (frequency, Hz; damping ratio), where that is more than `std`, what the noise
/// makes of the common pole; else zero. With a few FRFs both fits rest on the same lines: noise cannot part them, only what one of
/// the two models does not know (neighbours that one of them has and the other has not, leakage, modes drifting during the record).
fn disagreement(members: &[&SetMember], pole: Pole, std: [f64; 2]) -> [f64; 2] {
    let width_hz = pole.damping_ratio * pole.frequency_hz;
    let mut most = [0.0f64; 2];
    for mode in members.iter().flat_map(|m| m.modes.peaks()) {
        let own = mode.best();
        let line_hz = 2.0 * own.damping_ratio * own.frequency_hz / mode.lines_in_half_power_band;
        let apart = [
            (own.frequency_hz - pole.frequency_hz).abs(),
            (own.damping_ratio - pole.damping_ratio).abs(),
        ];
        // Another mode, or two that the local fit takes for one.
        if apart[0] > 0.5 * width_hz.max(line_hz) || apart[1] > 0.5 * pole.damping_ratio {
            continue;
        }
        for k in 0..2 {
            if apart[k] > APART * std[k] {
                most[k] = most[k].max(apart[k]);
            }
        }
    }
    most
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

/// Shape by response (or by FRF where degrees of freedom are not known), largest component 1, from what each FRF knows of it.
fn shape_of(known: &[Option<Complex64>], members: &[&SetMember]) -> Vec<(usize, Complex64)> {
    let (of_frf, constants): (Vec<usize>, Vec<Complex64>) = known
        .iter()
        .enumerate()
        .filter_map(|(m, constant)| Some((m, (*constant)?)))
        .unzip();
    let dofs: Option<Vec<[usize; 2]>> = of_frf.iter().map(|&m| members[m].dofs).collect();
    let Some(dofs) = dofs else {
        return of_frf.into_iter().zip(shape::normalised(&constants)).collect();
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
    for (dof, constant) in dofs.iter().zip(constants) {
        let at = (
            ids.iter().position(|i| *i == dof[side]),
            others.iter().position(|i| *i == dof[other]),
        );
        if let (Some(i), Some(j)) = at {
            matrix[(i, j)] = constant;
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
pub(crate) fn explain(diagram: &mut Stabilisation, modes: &[GlobalMode], changes: &[Change]) {
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
            .unwrap_or("left out: joined another mode, or explains no more than a pole anywhere near would");
        candidate.why.push_str("; ");
        candidate.why.push_str(why);
    }
    diagram
        .candidates
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
}

/// Lists what is no mode: fitted poles that did not stand the tests, and candidates that were not fitted.
pub(crate) fn reject(tested: Vec<RejectedMode>, diagram: &mut Stabilisation, result: &mut GlobalModes) {
    let mut rejected = std::mem::take(&mut result.rejected);
    rejected.extend(tested);
    for candidate in diagram.candidates.iter_mut().filter(|c| !c.chosen) {
        let width = candidate.frequency_hz * candidate.damping_ratio.max(0.003);
        let same = |r: &&RejectedMode| (r.frequency_hz - candidate.frequency_hz).abs() < width;
        match rejected.iter().find(same) {
            Some(known) => {
                candidate.why = format!("{}; left out: {}", before_semicolon(&candidate.why), known.reason)
            }
            None => rejected.push(RejectedMode {
                frequency_hz: candidate.frequency_hz,
                damping_ratio: candidate.damping_ratio,
                reason: candidate.why.clone(),
            }),
        }
    }
    rejected.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    result.rejected = rejected;
}

fn before_semicolon(text: &str) -> &str {
    text.split(';').next().unwrap_or(text)
}

/// Three digits, without zeros at the end.
pub(crate) fn short(value: f64) -> String {
    let places = (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{value:.places$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// One line for the whole set.
pub(crate) fn coarse_lines(data: &[Data], result: &mut GlobalModes) {
    let coarse: Vec<String> = result
        .modes
        .iter()
        .filter(|m| m.lines_in_half_power_band < FINE_LINES && m.damping_std > UNCERTAIN * m.damping_ratio)
        .map(|m| {
            let share = m.damping_std / m.damping_ratio;
            let known = match share < 1.0 {
                true => format!("is uncertain to {:.0} %", (100.0 * share).ceil()),
                false => "is not known".into(),
            };
            format!(
                "at {} Hz lines the damping of the {} Hz mode {known}",
                short(joint_fit::line_hz(data, m.frequency_hz)),
                crate::text::figures(m.frequency_hz, 4),
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
    use super::*;

    #[test]
    fn broad_modes_of_one_or_two_frfs_are_doubtful() {
        let modes = |damping: &[f64]| -> Vec<GlobalMode> {
            let of = |(k, zeta): (usize, &f64)| GlobalMode {
                frequency_hz: 10.0 * (k + 1) as f64,
                damping_ratio: *zeta,
                frequency_std_hz: 0.01,
                damping_std: 1e-4,
                found_in: 1,
                lines_in_half_power_band: 5.0,
                complexity: None,
                shape: Vec::new(),
                constants: Vec::new(),
            };
            damping.iter().enumerate().map(of).collect()
        };
        let with_one_broad = modes(&[0.01, 0.012, 0.08, 0.009]);
        assert_eq!(far_broader(&with_one_broad, 2), [30.0]);
        assert!(far_broader(&with_one_broad, 3).is_empty());
        assert!(far_broader(&modes(&[0.05, 0.08, 0.06]), 1).is_empty());
        assert!(far_broader(&modes(&[0.005, 0.025, 0.006]), 1).is_empty());
        assert!(far_broader(&[], 1).is_empty());
    }

    #[test]
    fn what_is_left_where_a_pole_was_left_out_counts_beyond_the_noise_only() {
        let lines: Vec<f64> = (0..100).map(|k| 10.0 + 0.1 * k as f64).collect();
        let of = |left: f64, sigma: f64| {
            let data = Data {
                frequency_hz: lines.clone(),
                receptance: vec![Complex64::ONE; 100],
                sigma: vec![sigma; 100],
                spread_hz: Vec::new(),
                count: Vec::new(),
            };
            let found = Reconstruction {
                error_nrms: left,
                noise_nrms: sigma,
                frequency_hz: lines.clone(),
                measured_m_per_n: vec![Complex64::ONE; 100],
                fitted_m_per_n: vec![Complex64::new(1.0 - left, 0.0); 100],
            };
            let pole = Pole {
                frequency_hz: 15.0,
                damping_ratio: 0.02,
            };
            let mut there = LeftThere::default();
            there.add(&data, &found, &RejectedMode::new(&pole, ""));
            there.is_much()
        };
        assert!(of(0.2, 0.01));
        // Noise, and a little that every model lacks.
        assert!(!of(0.2, 0.2) && !of(0.05, 0.001));
    }

    #[test]
    fn a_pole_beyond_the_lines_or_damped_beyond_measure_is_no_mode() {
        let data = |first_hz: f64, last_hz: f64| Data {
            frequency_hz: vec![first_hz, 0.5 * (first_hz + last_hz), last_hz],
            receptance: vec![Complex64::ONE; 3],
            sigma: vec![1.0; 3],
            spread_hz: vec![0.0; 3],
            count: vec![1.0; 3],
        };
        // One FRF that reaches it is enough.
        let set = [data(1.0, 40.0), data(2.0, 200.0)];
        let of = |frequency_hz, damping_ratio| {
            let pole = Pole {
                frequency_hz,
                damping_ratio,
            };
            impossible(&set, &pole)
        };
        assert_eq!(of(120.0, 0.2), None);
        assert!(of(514.0, 0.02).unwrap().contains("outside the lines"));
        assert!(of(46.5, 0.9).unwrap().contains("90 %"));
    }
}
