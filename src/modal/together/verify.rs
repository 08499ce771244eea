//! Is a fitted pole a mode of the structure? What the FRFs together do not bear out goes out, with the reason, and the rest
//! is fitted again.

use std::borrow::Cow;

use num_complex::Complex64;

use crate::modal::max_likelihood::joint_fit::{self, Data, Group, PoleSearch};
use crate::modal::max_likelihood::ml_fit::{self, Solution};
use crate::modal::settings::SET;
use crate::modal::shape;
use crate::modal::single::local_fit::Pole;
use crate::modal::together::global_modes::RejectedMode;
use crate::modal::together::halves::Halves;
use crate::modal::together::set_noise;

/// Fits after poles were taken out, at most.
const MAX_ROUNDS: usize = 10;
/// Of poles nearer than so many sums of their half-widths, and so many lines, one goes out at a time.
const APART_WIDTHS: f64 = 2.0;
const APART_LINES: f64 = 2.0;
/// From this many FRFs on the phase of their residues says something.
const ENOUGH_FRFS: usize = 5;
/// Residues of no common phase: what random phases give more often than a structure.
const COLLINEAR: f64 = 0.5;
/// A pole that makes this share of what was measured in its band is there, whatever its phases are …
const DOMINANT: f64 = 0.5;
/// … unless they are those of chance next to a stronger one, in a set whose modes have common ones: at least three and one in three of
/// them.
const BY_CHANCE: f64 = 0.25;
const ALIKE_PHASE: f64 = 0.8;
const OTHERS: usize = 3;
const A_GOOD_PART: usize = 3;
/// … or where, alone, it makes so many times what was measured there: what is far away takes away what it adds.
const CANCELLED: f64 = 2.0;
/// Less of what was measured in its band than this (0.3 % of the amplitude) is beyond what a test can show, however little the noise
/// is: what a file rounds, or a little of what every model lacks.
const BEYOND_TEST: f64 = 1e-5;
/// Share of the FRFs that must show a mode …
const SHARE_OF_FRFS: f64 = 0.08;
/// … unless one of them shows it with this squared size over uncertainty.
const FAR: f64 = 100.0;
/// A frequency that scatters from FRF to FRF by more than this share of the half-width belongs to no mode.
const SCATTER_WIDTHS: f64 = 0.3;
/// A damping ratio uncertain by more than this part of itself, from how the FRFs scatter.
const SCATTER_DAMPING: f64 = 0.5;
/// Of what was measured in its band a mode makes at least this share …
const SMALL_SHARE: f64 = 0.1;
/// … or its residues have a phase this common: what repairs the model of a strong neighbour has neither.
const CLEARLY_IN_PHASE: f64 = 0.95;
/// Power of a mode over the coloured rest in its band.
const OVER_REST: f64 = 2.0;
/// Two poles nearer than this share of the sum of their half-widths may be one.
const CLOSE: f64 = 1.0;
/// Or than so many lines, where the sum is less than so many of them.
const LEAKS_LINES: f64 = 1.5;
const COARSE_LINES: f64 = 1.2;
/// Two poles nearer than this share of that sum are one mode unless both have the phases of one.
const SAME: f64 = 0.2;
/// Residues of a common phase: what a mode next to another one keeps.
const IN_PHASE: f64 = 0.7;
/// Where neither phases nor shapes can tell (few FRFs, or all at one place), two poles are two modes if they leave so many times less
/// than one pole that each FRF has at a place of its own …
const CLEARLY: f64 = 20.0;
/// … as long as they are nearer than this share of the sum of their half-widths, or than a line: what a moving pole may look like.
const HARD_TO_TELL: f64 = 0.5;
/// Two poles that leave hardly less than one that moves are one: they have four parameters more. Two modes leave many times less.
const ONE_MODE: f64 = 1.02;
/// Two that cancel each other are two modes from where one that moves leaves so many times more …
const TWO_MODES: f64 = 1.5;
/// … or where none moves, if both have so many lines in the half-power band,
const RESOLVED_LINES: f64 = 3.0;
/// … so many times the power of the coloured rest there,
const FAR_OVER_REST: f64 = 20.0;
/// … and this part of what their phases add to the displacement right after a blow taken back by other modes.
const BALANCED: f64 = 0.5;
/// A pole so many times as wide as its neighbour is the ground on which that stands …
const GROUND: f64 = 5.0;
/// … where it is more than so many of the neighbour's half-widths away.
const FAR_WIDTHS: f64 = 3.0;
/// Shapes that repeat …
const SAME_SHAPE: f64 = 0.9;
/// … and that do where two poles are at the same place.
const ALIKE_SHAPE: f64 = 0.85;

/// What a set of FRFs can tell modes apart by.
#[derive(Clone, Copy)]
struct Sight {
    /// Its modes have common phases.
    common_phase: bool,
    /// Its shapes tell nothing.
    one_place: bool,
}

/// Takes out what is no mode until all are.
pub(crate) fn verified(
    data: &[Data],
    mut groups: Vec<Group>,
    rejected: &mut Vec<RejectedMode>,
) -> Option<Vec<Group>> {
    let mut data = Cow::Borrowed(data);
    for _ in 0..MAX_ROUNDS {
        let mut kept: Vec<Pole> = Vec::new();
        let mut out = false;
        let sight = Sight {
            common_phase: common_phase(&data, &groups),
            one_place: one_place(&data, &groups),
        };
        let at_once = displaced_at_once(&groups);
        for group in &groups {
            let witness = Witness::new(&data, group, &at_once);
            let pairs = close_pairs(&witness, sight);
            let poles = &group.solution.poles;
            let mut doubtful: Vec<(usize, f64, String)> = Vec::new();
            let mut leaves: Vec<Option<String>> = vec![None; poles.len()];
            for j in 0..poles.len() {
                match pairs.iter().find(|p| p.weak == j) {
                    Some(pair) => leaves[j] = Some(pair.reason.clone()),
                    None => doubtful.extend(reason(&witness, j).map(|(s, why)| (j, s, why))),
                }
            }
            // Of neighbours the one that makes least of what was measured goes first: poles that share a mode among them look
            // all alike, and one of them is to stay.
            doubtful.sort_by(|a, b| a.1.total_cmp(&b.1));
            for (j, _, why) in doubtful {
                if !(0..poles.len()).any(|k| leaves[k].is_some() && neighbours(&data, poles[j], poles[k])) {
                    leaves[j] = Some(why);
                }
            }
            for (j, (pole, leaves)) in poles.iter().zip(leaves).enumerate() {
                if let Some(merged) = pairs.iter().find_map(|p| p.merged.filter(|_| p.strong == j)) {
                    kept.push(merged);
                    continue;
                }
                match leaves {
                    None => kept.push(*pole),
                    Some(reason) => {
                        out = true;
                        rejected.push(RejectedMode {
                            frequency_hz: pole.frequency_hz,
                            damping_ratio: pole.damping_ratio,
                            reason,
                        });
                    }
                }
            }
        }
        if !out {
            return Some(groups);
        }
        kept.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
        if kept.is_empty() {
            return None;
        }
        groups = joint_fit::refine(&data, &kept, PoleSearch::Nothing, &mut Vec::new())?;
        louder(data.to_mut(), &groups);
    }
    Some(groups)
}

/// What a pole stood for that is no mode is left over now: held to the noise as it was, the others would leave their places to
/// follow it. Nowhere the noise falls: what has little of it decides as before.
fn louder(data: &mut [Data], groups: &[Group]) {
    let before: Vec<Vec<f64>> = data.iter().map(|d| d.sigma.clone()).collect();
    set_noise::renew(data, groups);
    for (d, before) in data.iter_mut().zip(before) {
        for (sigma, before) in d.sigma.iter_mut().zip(before) {
            *sigma = sigma.max(before);
        }
    }
}

/// Are two poles so near that one may make up for what the other lacks?
fn neighbours(data: &[Data], a: Pole, b: Pole) -> bool {
    let widths = a.damping_ratio * a.frequency_hz + b.damping_ratio * b.frequency_hz;
    let reach = APART_WIDTHS * widths + APART_LINES * joint_fit::line_hz(data, a.frequency_hz);
    (a.frequency_hz - b.frequency_hz).abs() < reach
}

/// A pole of a group, and what was measured around it.
struct Candidate<'a> {
    solution: &'a Solution,
    pole: usize,
    residues: Vec<Complex64>,
    /// As far as they are known.
    known: Vec<Complex64>,
    local: Local,
}

impl<'a> Candidate<'a> {
    fn new(data: &[Data], group: &'a Group, j: usize) -> Candidate<'a> {
        let solution = &group.solution;
        let residues: Vec<Complex64> = (0..solution.frfs.len())
            .map(|m| solution.constant(m, j).0)
            .collect();
        Candidate {
            local: Local::new(data, group, j, &residues),
            known: solution.known_constants(j),
            solution,
            pole: j,
            residues,
        }
    }

    /// Modal phase collinearity, 0 to 1; 1 where there is nothing to compare.
    fn mpc(&self) -> f64 {
        shape::complexity(&self.known).map_or(1.0, |c| c.mpc)
    }

    /// Of its peak, over all FRFs, to compare.
    fn height(&self) -> f64 {
        let squares: f64 = self.residues.iter().map(|c| c.norm_sqr()).sum();
        squares.sqrt() / self.solution.poles[self.pole].damping_ratio
    }

    fn dominates(&self) -> bool {
        self.local.mode >= DOMINANT * self.local.measured
    }
}

/// Whether the modes of this set have common phases: a good part of those that stand alone. Sets whose references or channels are
/// shifted in time have none, and parts of modes are no modes.
fn common_phase(data: &[Data], groups: &[Group]) -> bool {
    let all: Vec<f64> = groups
        .iter()
        .flat_map(|group| (0..group.solution.poles.len()).map(move |j| Candidate::new(data, group, j)))
        .filter(|candidate| candidate.known.len() >= ENOUGH_FRFS && candidate.dominates())
        .map(|candidate| candidate.mpc())
        .collect();
    let in_phase = all.iter().filter(|mpc| **mpc > ALIKE_PHASE).count();
    in_phase >= OTHERS && A_GOOD_PART * in_phase >= all.len()
}

/// Whether modes that stand well apart have one shape all the same: FRFs of one place, whose shapes tell no mode from another.
fn one_place(data: &[Data], groups: &[Group]) -> bool {
    let all: Vec<Candidate> = groups
        .iter()
        .flat_map(|group| (0..group.solution.poles.len()).map(move |j| Candidate::new(data, group, j)))
        .filter(Candidate::dominates)
        .collect();
    let pole = |candidate: &Candidate| candidate.solution.poles[candidate.pole];
    let likeness: Vec<f64> = all
        .iter()
        .enumerate()
        .flat_map(|(k, a)| all[..k].iter().map(move |b| (a, b)))
        .filter(|(a, b)| !neighbours(data, pole(a), pole(b)))
        .map(|(a, b)| shape::mac(&a.known, &b.known))
        .collect();
    likeness.len() >= OTHERS && crate::signal::median(&likeness) > SAME_SHAPE
}

/// The poles without a common phase, by group and number.
#[derive(Default)]
pub(super) struct ComplexPoles {
    /// Modes all the same: see [`Witness`].
    pub modes: Vec<(usize, usize)>,
    /// Those that have phases by chance next to a stronger one, or that others cancel, in a set whose modes have common phases: parts
    /// of those which the model of one mode does not hold. They stay in the fit: what they stand for would do harm to the others.
    pub parts_of_others: Vec<(usize, usize)>,
}

pub(super) fn complex_poles(data: &[Data], groups: &[Group]) -> ComplexPoles {
    let phases_tell = data.len() >= ENOUGH_FRFS && common_phase(data, groups);
    let mut found = ComplexPoles::default();
    let at_once = displaced_at_once(groups);
    for (g, group) in groups.iter().enumerate() {
        let poles = &group.solution.poles;
        let all: Vec<Candidate> = (0..poles.len()).map(|j| Candidate::new(data, group, j)).collect();
        let witness = Witness::new(data, group, &at_once);
        for (j, candidate) in all.iter().enumerate().filter(|(_, c)| c.mpc() < shape::COLLINEAR) {
            if witness.bears_out(candidate) {
                found.modes.push((g, j));
                continue;
            }
            if !phases_tell || candidate.mpc() >= BY_CHANCE {
                continue;
            }
            let mut beside = (0..poles.len())
                .filter(|&k| k != j && neighbours(data, poles[j], poles[k]))
                .peekable();
            let wide = poles[j].damping_ratio * poles[j].frequency_hz
                > joint_fit::line_hz(data, poles[j].frequency_hz);
            let cancelled = wide && candidate.local.mode > CANCELLED * candidate.local.measured;
            let is_part = match beside.peek() {
                // Of two that have no phases both it cannot be told which is the mode.
                Some(_) => beside.any(|k| {
                    all[k].height() > candidate.height() && all[k].mpc() > candidate.mpc() + BY_CHANCE
                }),
                None => cancelled,
            };
            if is_part {
                found.parts_of_others.push((g, j));
            }
        }
    }
    found
}

/// Why pole `j` of a group is no mode, and the share that it makes of what was measured around it.
fn reason(witness: &Witness, j: usize) -> Option<(f64, String)> {
    let candidate = Candidate::new(witness.data, witness.group, j);
    let share = candidate.local.mode / candidate.local.measured;
    Some((share, against(&candidate, || witness.bears_out(&candidate))?))
}

/// By FRF, how far all poles together displace its point right after a blow: of modes with numerators aᵣ + bᵣs it is Σ bᵣ. In a
/// structure it is nought, up to what lies outside the band: a force displaces no mass at once.
fn displaced_at_once(groups: &[Group]) -> Vec<f64> {
    let Some(first) = groups.first() else {
        return Vec::new();
    };
    let of_frf = |m| {
        let solutions = groups.iter().map(|g| &g.solution);
        solutions
            .flat_map(|s| (0..s.poles.len()).map(move |j| s.displaces_at_once(m, j)))
            .sum()
    };
    (0..first.solution.frfs.len()).map(of_frf).collect()
}

/// What can bear a group's poles out where their phases do not: a dashpot at one point makes the phases of close modes as different
/// from FRF to FRF as an error does (Caughey & O'Kelly 1965), and so does a rotor.
struct Witness<'a> {
    data: &'a [Data],
    group: &'a Group,
    halves: Halves,
    at_once: &'a [f64],
}

impl<'a> Witness<'a> {
    /// `at_once`: of all groups, see [`displaced_at_once`].
    fn new(data: &'a [Data], group: &'a Group, at_once: &'a [f64]) -> Witness<'a> {
        Witness {
            data,
            group,
            halves: Halves::default(),
            at_once,
        }
    }

    /// Whether a pole is a mode whatever its phases are. What repairs the model of other modes or follows an error of the measurement
    /// is narrower than the lines show, leaves a rest of its own size, displaces a mass at once, or is elsewhere, or another shape, in
    /// other FRFs.
    fn bears_out(&self, candidate: &Candidate) -> bool {
        let Candidate {
            solution,
            pole: j,
            local,
            ..
        } = candidate;
        let pole = solution.poles[*j];
        let line_hz = joint_fit::line_hz(self.data, pole.frequency_hz);
        let lines = 2.0 * pole.damping_ratio * pole.frequency_hz / line_hz;
        let (seen_in, _) = joint_fit::seen_in(solution, *j);
        !local.one_sided
            && lines >= RESOLVED_LINES
            && A_GOOD_PART * seen_in >= solution.taking_part()
            && local.mode > FAR_OVER_REST * local.coloured
            && self.taken_back(*j) > BALANCED
            && self.halves.agree(self.data, self.group, *j)
    }

    /// The part of what pole `j` displaces at once that others take back, over the FRFs: one for a structure's mode whose partners are
    /// in the band, about nought for a pole with phases of its own. Its neighbours alone tell better where there is much besides.
    fn taken_back(&self, j: usize) -> f64 {
        let solution = &self.group.solution;
        let near = |m: usize| -> f64 {
            let poles = solution.poles.len() + solution.fixed().len();
            (0..poles).map(|k| solution.displaces_at_once(m, k)).sum()
        };
        let (mut square, mut by_near, mut by_all) = (0.0, 0.0, 0.0);
        for (m, all) in self.at_once.iter().enumerate() {
            let own = solution.displaces_at_once(m, j);
            square += own * own;
            by_near += own * (own - near(m));
            by_all += own * (own - all);
        }
        if square > 0.0 {
            by_near.max(by_all) / square
        } else {
            0.0
        }
    }
}

/// What speaks against a pole. `borne_out`: whether phases of its own do not.
fn against(candidate: &Candidate, borne_out: impl Fn() -> bool) -> Option<String> {
    let Candidate {
        solution,
        pole: j,
        local,
        ..
    } = candidate;
    let j = *j;
    let pole = solution.poles[j];
    let frfs = solution.taking_part();
    let (seen_in, best) = joint_fit::seen_in(solution, j);
    let wanted = ((SHARE_OF_FRFS * frfs as f64).ceil() as usize).max(2);
    if frfs >= SET && seen_in < wanted && best < FAR {
        return Some(match seen_in {
            0 => "hardly above what is left unexplained".into(),
            n => format!("shown by {n} of {frfs} FRFs only"),
        });
    }
    if local.mode < OVER_REST * local.coloured {
        return Some("no larger than what the modes leave unexplained around it".into());
    }
    if local.mode < BEYOND_TEST * local.measured {
        return Some(format!(
            "it makes {:.0e} of the power measured around it: less than a test can show",
            local.mode / local.measured
        ));
    }
    let mpc = candidate.mpc();
    if frfs >= ENOUGH_FRFS && local.one_sided && mpc < IN_PHASE {
        return Some(format!(
            "only one side of its peak was measured, and its FRFs have no common phase (collinearity {mpc:.2}): what lies beyond the band"
        ));
    }
    if frfs >= ENOUGH_FRFS && !candidate.dominates() {
        if local.mode < SMALL_SHARE * local.measured && mpc < CLEARLY_IN_PHASE && !borne_out() {
            return Some(format!(
                "it makes {:.0} % of what was measured around it and its FRFs have no clear common phase (collinearity {mpc:.2}): \
                 what the model of stronger neighbours lacks",
                100.0 * local.mode / local.measured
            ));
        }
        if mpc < COLLINEAR && !borne_out() {
            return Some(format!(
                "its FRFs have no common phase (collinearity {mpc:.2}): error of the measurement or of its neighbours' model"
            ));
        }
    }
    let [frequency, damping] = solution.scatter_std(j);
    if frfs >= ENOUGH_FRFS
        && !candidate.dominates()
        && (frequency > SCATTER_WIDTHS * pole.damping_ratio || damping > SCATTER_DAMPING)
    {
        return Some("the FRFs do not agree on its frequency or damping".into());
    }
    None
}

/// Powers in the half-power band of a mode, summed over the FRFs.
struct Local {
    mode: f64,
    measured: f64,
    /// Of what is left, the part that goes on from line to line.
    coloured: f64,
    /// Its half-power band reaches beyond the lines of every FRF.
    one_sided: bool,
}

impl Local {
    fn new(data: &[Data], group: &Group, j: usize, residues: &[Complex64]) -> Local {
        let pole = group.solution.poles[j];
        let omega = std::f64::consts::TAU * pole.frequency_hz;
        let mut local = Local {
            mode: 0.0,
            measured: 0.0,
            coloured: 0.0,
            one_sided: true,
        };
        for ((d, found), residue) in data.iter().zip(&group.solution.frfs).zip(residues) {
            let from = d.frequency_hz.partition_point(|&f| f < group.window_hz[0]);
            let line_hz = joint_fit::spacing_hz(&d.frequency_hz, pole.frequency_hz);
            let half_hz = (pole.damping_ratio * pole.frequency_hz).max(1.5 * line_hz);
            let lines = d
                .frequency_hz
                .partition_point(|&f| f < pole.frequency_hz - half_hz)
                ..d.frequency_hz
                    .partition_point(|&f| f <= pole.frequency_hz + half_hz);
            let half_power_hz = pole.damping_ratio * pole.frequency_hz;
            local.one_sided &= ![-1.0, 1.0]
                .iter()
                .all(|side| d.reaches(pole.frequency_hz + side * half_power_hz));
            let mut before: Option<Complex64> = None;
            for k in lines {
                let Some(residual) = k.checked_sub(from).and_then(|k| found.residual.get(k)) else {
                    continue;
                };
                let r = d.frequency_hz[k] / pole.frequency_hz;
                let g = residue / (omega * omega) / Complex64::new(1.0 - r * r, 2.0 * pole.damping_ratio * r);
                local.mode += g.norm_sqr();
                local.measured += d.receptance[k].norm_sqr();
                if let Some(before) = before {
                    local.coloured += (before.conj() * residual).re;
                }
                before = Some(*residual);
            }
        }
        local
    }
}

/// Two poles that stand for one mode.
struct ClosePair {
    strong: usize,
    weak: usize,
    /// What takes the place of the strong one.
    merged: Option<Pole>,
    reason: String,
}

/// The pairs of a group that are one mode: because its frequency moves from FRF to FRF, or because the shapes repeat. No
/// pole is in two of them.
fn close_pairs(witness: &Witness, sight: Sight) -> Vec<ClosePair> {
    let solution = &witness.group.solution;
    let mut order: Vec<usize> = (0..solution.poles.len()).collect();
    order.sort_by(|&a, &b| {
        solution.poles[a]
            .frequency_hz
            .total_cmp(&solution.poles[b].frequency_hz)
    });
    let mut found = Vec::new();
    let mut k = 1;
    while k < order.len() {
        match close_pair(witness, [order[k - 1], order[k]], sight) {
            Some(pair) => {
                found.push(pair);
                k += 2;
            }
            None => k += 1,
        }
    }
    found
}

fn close_pair(witness: &Witness, both: [usize; 2], sight: Sight) -> Option<ClosePair> {
    let (data, group) = (witness.data, witness.group);
    let solution = &group.solution;
    let [a, b] = both.map(|j| solution.poles[j]);
    let width = a.damping_ratio * a.frequency_hz + b.damping_ratio * b.frequency_hz;
    let line_hz = joint_fit::line_hz(data, a.frequency_hz);
    // Where a line is about as wide as a peak, what leaks from one line into the next takes a pole of its own.
    let reach = match width < COARSE_LINES * line_hz {
        true => (CLOSE * width).max(LEAKS_LINES * line_hz),
        false => CLOSE * width,
    };
    let apart_hz = b.frequency_hz - a.frequency_hz;
    if apart_hz > reach {
        return None;
    }
    let residues = both.map(|j| solution.known_constants(j));
    // By the height of the peaks.
    let height = |k: usize, pole: Pole| {
        residues[k].iter().map(|c| c.norm_sqr()).sum::<f64>().sqrt() / pole.damping_ratio
    };
    let (strong, weak) = if height(0, a) >= height(1, b) {
        (both[0], both[1])
    } else {
        (both[1], both[0])
    };
    let beside = solution.poles[strong].frequency_hz;
    let enough = solution.taking_part() >= ENOUGH_FRFS;
    // Leakage and what else one pole lacks gives two poles an edge that more FRFs would see through.
    let hard_to_tell = !enough && apart_hz < (HARD_TO_TELL * width).max(line_hz);
    let most = if hard_to_tell { CLEARLY } else { ONE_MODE };
    // A narrow mode does not move as far as a broad one beside it reaches.
    let half_widths_hz = [a, b].map(|p| p.damping_ratio * p.frequency_hz);
    let (narrow_hz, broad_hz) = (
        half_widths_hz[0].min(half_widths_hz[1]),
        half_widths_hz[0].max(half_widths_hz[1]),
    );
    let is_ground = broad_hz > GROUND * narrow_hz && apart_hz > FAR_WIDTHS * narrow_hz.max(0.5 * line_hz);
    let moving = match is_ground {
        true => None,
        false => moving(data, solution, strong, weak),
    };
    if let Some(moving) = moving.as_ref().filter(|m| m.leaves <= most) {
        return Some(ClosePair {
            strong,
            weak,
            merged: Some(moving.pole),
            reason: format!(
                "one mode with {beside:.2} Hz, whose frequency moves from FRF to FRF: mass of the sensor, temperature"
            ),
        });
    }
    let out_of_phase = |r: &Vec<Complex64>| shape::complexity(r).is_some_and(|c| c.mpc < IN_PHASE);
    let leaks = width < COARSE_LINES * line_hz && apart_hz < reach;
    let same_place = apart_hz < SAME * width || leaks;
    // Two modes as near as that have common phases both, if the others of the set have.
    let cancel = enough
        && (same_place && residues.iter().any(out_of_phase)
            || sight.common_phase && residues.iter().all(out_of_phase));
    let two = || {
        moving.as_ref().is_none_or(|m| m.leaves > TWO_MODES)
            && both
                .iter()
                .all(|&j| witness.bears_out(&Candidate::new(data, group, j)))
    };
    if cancel && !two() {
        return Some(ClosePair {
            strong,
            weak,
            merged: None,
            reason: format!("splits the mode at {beside:.2} Hz: the two nearly cancel each other"),
        });
    }
    let alike = if same_place { ALIKE_SHAPE } else { SAME_SHAPE };
    let clearly_two = sight.one_place && moving.is_some_and(|m| m.leaves > CLEARLY);
    let repeats = enough && !clearly_two && shape::mac(&residues[0], &residues[1]) > alike;
    repeats.then(|| ClosePair {
        strong,
        weak,
        merged: None,
        reason: format!("splits the mode at {beside:.2} Hz, whose shape it repeats"),
    })
}

/// One mode that each FRF has at a place of its own, instead of two common ones; it has about as many parameters.
struct Moving {
    /// Its median over the FRFs.
    pole: Pole,
    /// What it leaves of the FRFs (misfit) over what the two common poles leave.
    leaves: f64,
}

/// `None` where a fit fails, or for a single FRF.
fn moving(data: &[Data], solution: &Solution, strong: usize, weak: usize) -> Option<Moving> {
    if data.len() < 2 {
        return None;
    }
    let pair = [solution.poles[strong], solution.poles[weak]];
    let others: Vec<Pole> = (0..solution.poles.len())
        .filter(|j| ![strong, weak].contains(j))
        .map(|j| solution.poles[j])
        .collect();
    let single = own_poles(data, pair[0], &others)?;
    let window = around(pair[0]);
    let frfs: Vec<_> = data.iter().map(|d| d.window(window)).collect();
    let near = near(&others, window);
    let together = ml_fit::fit(&frfs, &pair, &near, ml_fit::SETTLED)?;
    let misfit: f64 = single
        .iter()
        .zip(&together.frfs)
        .filter(|(_, of_pair)| of_pair.took_part())
        .map(|(s, _)| s.as_ref().map_or(f64::INFINITY, |s| s.misfit))
        .sum();
    let poles: Vec<Pole> = single.iter().flatten().map(|s| s.poles[0]).collect();
    let median = |of: fn(&Pole) -> f64| crate::signal::median(&poles.iter().map(of).collect::<Vec<_>>());
    Some(Moving {
        pole: Pole {
            frequency_hz: median(|p| p.frequency_hz),
            damping_ratio: median(|p| p.damping_ratio),
        },
        leaves: misfit / together.misfit,
    })
}

/// Window of the single fits around a pole, Hz.
fn around(pole: Pole) -> [f64; 2] {
    const REACH_WIDTHS: f64 = 10.0;
    let reach = REACH_WIDTHS * (pole.damping_ratio * pole.frequency_hz).max(2e-4 * pole.frequency_hz);
    [pole.frequency_hz - reach, pole.frequency_hz + reach]
}

/// The poles that have something to say in a window.
fn near(others: &[Pole], window: [f64; 2]) -> Vec<Pole> {
    const MOST: usize = 4;
    let reach = 0.5 * (window[1] - window[0]);
    let mut near: Vec<Pole> = others
        .iter()
        .filter(|p| (window[0] - reach..window[1] + reach).contains(&p.frequency_hz))
        .copied()
        .collect();
    let middle = 0.5 * (window[0] + window[1]);
    near.sort_by(|a, b| {
        (a.frequency_hz - middle)
            .abs()
            .total_cmp(&(b.frequency_hz - middle).abs())
    });
    near.truncate(MOST);
    near
}

/// The mode as each FRF alone has it, the other poles held; `None` inside where its lines do not tell.
pub(crate) fn own_poles(data: &[Data], pole: Pole, others: &[Pole]) -> Option<Vec<Option<Solution>>> {
    use rayon::prelude::*;
    let window = around(pole);
    let near = near(others, window);
    let found: Vec<Option<Solution>> = data
        .par_iter()
        .map(|d| ml_fit::fit(&[d.window(window)], &[pole], &near, ml_fit::SETTLED))
        .collect();
    found.iter().any(|s| s.is_some()).then_some(found)
}

/// Mean of what each FRF says (value, standard deviation), and its standard deviation from how they scatter about it. Each
/// counts by its own uncertainty and by how far all of them lie apart beyond that (random effects: DerSimonian & Laird
/// 1986): one that hardly shows the mode does not decide.
fn mean_over_frfs<T>(own: &[T], of: impl Fn(&T) -> (f64, f64)) -> (f64, f64) {
    let values: Vec<(f64, f64)> = own.iter().map(of).collect();
    let median =
        |of: &dyn Fn(&(f64, f64)) -> f64| crate::signal::median(&values.iter().map(of).collect::<Vec<f64>>());
    let middle = median(&|v| v.0);
    let spread = 1.4826 * median(&|v| (v.0 - middle).abs());
    let between = (spread.powi(2) - median(&|v| v.1).powi(2)).max(0.0);
    let (mut total, mut mean) = (0.0, 0.0);
    for (value, std) in &values {
        let weight = 1.0 / (std * std + between);
        total += weight;
        mean += weight * value;
    }
    mean /= total;
    let count = values.len() as f64;
    let scatter: f64 = values
        .iter()
        .map(|(value, std)| ((value - mean) / (std * std + between)).powi(2))
        .sum();
    (mean, (scatter * count / (count - 1.0)).sqrt() / total)
}

/// [`mean_over_frfs`] of poles with the standard deviations of their frequencies (Hz) and damping ratios.
pub(super) fn mean_pole(own: &[(Pole, [f64; 2])]) -> (Pole, [f64; 2]) {
    let (frequency_hz, frequency_std_hz) = mean_over_frfs(own, |(p, std)| (p.frequency_hz, std[0]));
    let (damping_ratio, damping_std) = mean_over_frfs(own, |(p, std)| (p.damping_ratio, std[1]));
    let pole = Pole {
        frequency_hz,
        damping_ratio,
    };
    (pole, [frequency_std_hz, damping_std])
}

/// [`Solution::own_step`] of each FRF that tells, standard deviations for noise as large as the fit leaves.
fn own_steps(solution: &Solution, j: usize) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    let level = solution.level();
    (0..solution.frfs.len())
        .filter_map(move |m| solution.own_step(m, j))
        .map(move |(step, std)| (step, std.map(|s| level * s)))
}

/// What the mean over the FRFs would change of a common pole.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Otherwise {
    /// Relative change …
    pub change: f64,
    /// … and relative standard deviation.
    pub std: f64,
}

/// Where the FRFs put a mode (frequency, damping ratio) when each counts by how far all of them lie apart, and not only by
/// how well it knows the mode: to the first order, from the common pole. What the two differ by, the model does not know.
/// `None` where too few FRFs tell.
pub(crate) fn otherwise(solution: &Solution, j: usize) -> Option<[Otherwise; 2]> {
    const LEAST_FRFS: usize = 4;
    const KNOWN_WIDTHS: f64 = 0.3;
    const NEAR_WIDTHS: f64 = 3.0;
    const KNOWN_DAMPING: f64 = 0.5;
    const NEAR_DAMPING: f64 = 1.0;
    let width = solution.poles[j].damping_ratio;
    let steps: Vec<([f64; 2], [f64; 2])> = own_steps(solution, j)
        .filter(|(step, std)| {
            std[0] < KNOWN_WIDTHS * width
                && step[0].abs() < NEAR_WIDTHS * width
                && std[1] < KNOWN_DAMPING
                && step[1].abs() < NEAR_DAMPING
        })
        .collect();
    (steps.len() >= LEAST_FRFS).then(|| {
        [0, 1].map(|k| {
            let (change, std) = mean_over_frfs(&steps, |(step, std)| (step[k], std[k]));
            Otherwise { change, std }
        })
    })
}

/// How much more the FRFs scatter about the frequency of a mode than about its damping.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Movement {
    /// ln of the ratio of the mean squares, each over its uncertainty: of nought on the average where nothing moves.
    pub log_ratio: f64,
    /// Its standard deviation then.
    pub std: f64,
    /// Relative standard deviation of the frequency over the FRFs, each counting by what it knows.
    pub scatter: f64,
}

/// Any error of the measurement, white or coloured, pulls the frequency of an FRF's own pole as much as its damping, each over its
/// uncertainty: in the resonance circle they are the two directions of one complex number. A mass that moves, or the temperature,
/// moves the frequencies alone. The ratio of two mean squares of n values each has the F distribution: its logarithm scatters by
/// √(4/n) (Fisher 1924). A tenth of the FRFs, the largest, does not count. `None` where too few tell.
pub(crate) fn movement(solution: &Solution, j: usize) -> Option<Movement> {
    const LEAST_FRFS: usize = 8;
    const KNOWN: f64 = 0.3;
    const LEFT_OUT: usize = 10;
    let width = solution.poles[j].damping_ratio;
    let steps: Vec<([f64; 2], [f64; 2])> = own_steps(solution, j)
        .filter(|(_, std)| std[0] < KNOWN * width && std[1] < KNOWN)
        .collect();
    if steps.len() < LEAST_FRFS {
        return None;
    }
    let count = steps.len() - steps.len() / LEFT_OUT;
    let [frequency, damping] = [0, 1].map(|k| {
        let mut squares: Vec<f64> = steps
            .iter()
            .map(|(step, std)| (step[k] / std[k]).powi(2))
            .collect();
        squares.sort_by(f64::total_cmp);
        squares[..count].iter().sum::<f64>()
    });
    let precision: f64 = steps.iter().map(|(_, std)| std[0].powi(-2)).sum();
    let found = Movement {
        log_ratio: (frequency / damping).ln(),
        std: (4.0 / count as f64).sqrt(),
        scatter: ((frequency - damping).max(0.0) / precision).sqrt(),
    };
    (found.log_ratio.is_finite() && found.scatter.is_finite()).then_some(found)
}

/// How far all modes of a set move, slightly as it may be: by the median over them, and only where several do, most of those that
/// tell, and all together far beyond chance.
pub(crate) fn set_moves(modes: &[Movement]) -> Option<f64> {
    const LEAST_MODES: usize = 3;
    const FAR_BEYOND_CHANCE: f64 = 5.0;
    const EACH: f64 = 2.0;
    let moving = modes.iter().filter(|m| m.log_ratio > EACH * m.std).count();
    let sum: f64 = modes.iter().map(|m| m.log_ratio).sum();
    let std = modes.iter().map(|m| m.std.powi(2)).sum::<f64>().sqrt();
    let moves = moving >= LEAST_MODES && 2 * moving > modes.len() && sum > FAR_BEYOND_CHANCE * std;
    moves.then(|| crate::signal::median(&modes.iter().map(|m| m.scatter).collect::<Vec<_>>()))
}

/// How far a mode moves from FRF to FRF.
pub(crate) struct Moves {
    /// Relative standard deviation of the frequency beyond its uncertainty in each FRF.
    pub scatter: f64,
    /// More than uncertainty and a part of the half-width: a common pole does not describe it.
    pub significant: bool,
    /// Means over the FRFs, with their standard deviations.
    pub pole: Pole,
    pub std: [f64; 2],
}

/// `None` where too few FRFs tell. `j`: the mode in the solution that `pole` is of.
pub(crate) fn moves(
    data: &[Data],
    solution: &Solution,
    j: usize,
    pole: Pole,
    others: &[Pole],
) -> Option<Moves> {
    const LEAST_FRFS: usize = 4;
    const KNOWN_WIDTHS: f64 = 0.3;
    const BEYOND: f64 = 2.0;
    const OF_WIDTH: f64 = 0.1;
    // A single step from the common pole says whether an FRF's own is worth a fit.
    const WORTH_A_FIT: f64 = 0.5;
    let steps: Vec<(f64, f64)> = own_steps(solution, j)
        .map(|(step, std)| (step[0], std[0]))
        .filter(|(_, std)| *std < KNOWN_WIDTHS * pole.damping_ratio)
        .collect();
    if steps.len() < LEAST_FRFS {
        return None;
    }
    let median =
        |of: fn(&(f64, f64)) -> f64| crate::signal::median(&steps.iter().map(of).collect::<Vec<_>>());
    let (middle, uncertain) = (median(|s| s.0), median(|s| s.1));
    let spread =
        1.4826 * crate::signal::median(&steps.iter().map(|s| (s.0 - middle).abs()).collect::<Vec<_>>());
    if spread < WORTH_A_FIT * BEYOND * uncertain || spread < WORTH_A_FIT * OF_WIDTH * pole.damping_ratio {
        return Some(Moves {
            scatter: (spread * spread - uncertain * uncertain).max(0.0).sqrt(),
            significant: false,
            pole,
            std: [0.0; 2],
        });
    }
    let own: Vec<(Pole, [f64; 2])> = own_poles(data, pole, others)?
        .into_iter()
        .flatten()
        .filter_map(|s| {
            let level = s.level();
            let std = [level * s.frequency_std_hz(0), level * s.damping_std(0)];
            let width = pole.damping_ratio * pole.frequency_hz;
            let near = (s.poles[0].frequency_hz - pole.frequency_hz).abs() < 3.0 * width
                && (0.3..3.0).contains(&(s.poles[0].damping_ratio / pole.damping_ratio));
            (near && std[0] < KNOWN_WIDTHS * width).then_some((s.poles[0], std))
        })
        .collect();
    if own.len() < LEAST_FRFS {
        return None;
    }
    #[allow(clippy::type_complexity)]
    let median = |of: &dyn Fn(&(Pole, [f64; 2])) -> f64| {
        crate::signal::median(&own.iter().map(of).collect::<Vec<f64>>())
    };
    let middle = median(&|o| o.0.frequency_hz);
    let spread = 1.4826 * median(&|o| (o.0.frequency_hz - middle).abs());
    let uncertain = median(&|o| o.1[0]);
    let scatter = (spread * spread - uncertain * uncertain).max(0.0).sqrt() / middle;
    let (mean, std) = mean_pole(&own);
    Some(Moves {
        scatter,
        significant: spread > BEYOND * uncertain && scatter > OF_WIDTH * pole.damping_ratio,
        pole: mean,
        std,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_frf_that_hardly_shows_a_mode_does_not_decide_its_mean() {
        // Alike: the plain mean and its standard error.
        let (mean, std) = mean_over_frfs(&[(1.0, 0.1), (2.0, 0.1), (3.0, 0.1), (4.0, 0.1)], |v| *v);
        approx::assert_relative_eq!(mean, 2.5, max_relative = 1e-12);
        approx::assert_relative_eq!(std, (5.0f64 / 12.0).sqrt(), max_relative = 1e-12);
        // One that knows nothing is far off: with all others at the same place they decide.
        let (mean, std) = mean_over_frfs(&[(1.0, 0.01), (1.0, 0.01), (1.0, 0.01), (9.0, 10.0)], |v| *v);
        assert!((mean - 1.0).abs() < 1e-4 && std < 1e-4, "{mean} {std}");
    }
}
