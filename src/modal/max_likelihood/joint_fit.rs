//! Poles of a whole set: groups of neighbouring candidates are refined together by [`crate::modal::max_likelihood::ml_fit`]; a pole that the
//! FRFs do not need is taken out, one is added where the rest has a resonance of its own.

use num_complex::Complex64;

use crate::modal::max_likelihood::ml_fit::{self, Solution};
use crate::modal::max_likelihood::ml_linear::NoisyFrf;
use crate::modal::shape;
use crate::modal::single::curve::reach;
use crate::modal::single::local_fit::Pole;
use crate::modal::stabilisation::MAX_DAMPING;

/// Modes refined together at most: the normal equations grow with the square.
const MAX_GROUP: usize = 12;
/// Neighbours further apart than this ratio of their frequencies are fitted apart, each with the other held: over so wide a window the
/// residual terms are neither exact nor well conditioned.
const FAR_APART: f64 = 3.0;
/// Lines beyond this ratio to the lowest and the highest pole of a group say nothing of its poles, however large they are.
const REACH: f64 = 8.0;
/// Neighbours beyond a group's edge that take part with fixed poles.
const FIXED_NEIGHBOURS: usize = 3;
const MAX_ADDED: usize = 4;
/// Misfit that one real parameter explains by chance has mean 1 and variance 2; this many standard deviations …
const CHANCE_SIGMA: f64 = 8.0;
/// … and a constant for having looked at every frequency.
const LOOKED_EVERYWHERE: f64 = 20.0;
/// Misfits are compared to this part of what a mode explains by chance …
const COMPARED: f64 = 0.002;
/// … and to this part where the noise is only guessed yet.
const ROUGHLY_COMPARED: f64 = 0.02;
/// Fewer lines in the half-power band than this: the damping may stay uncertain.
const COARSE_LINES: f64 = 1.0;
/// Squared size over uncertainty (two degrees of freedom) from which an FRF shows a mode: five standard deviations.
const SEEN: f64 = 30.0;

/// Poles nearer than this share of both half-widths are one.
const SAME_PLACE: f64 = 0.05;
/// And than these, one after the other, where a group cannot be fitted.
const MERGED: [f64; 3] = [0.5, 1.0, 2.0];
/// Trial poles spread over a window, of each damping.
const TRIALS: usize = 24;
/// So many of them tell what chance brings around a pole.
const NEARBY_TRIALS: usize = 8;
/// Damping of the trial poles over the usual one.
const WIDER: [f64; 2] = [1.0, 3.0];
/// A trial pole that is damped more would explain what modes do.
const WIDEST: f64 = 0.1;

/// Beside a pole a second one is tried this many half-widths away.
const BESIDE_WIDTHS: f64 = 1.5;
/// A pole comes in where it explains this times what a pole must explain to stay.
const ADMITTED: f64 = 1.2;
/// Its damping is within this factor of what is usual in the band, or within the larger one where it explains so many times as much.
const ALIKE: f64 = 4.0;
const UNLIKE: f64 = 10.0;
const CLEARLY_THERE: f64 = 10.0;
/// As [`CHANCE_SIGMA`] and [`LOOKED_EVERYWHERE`], for a pole that may be there.
const DOUBT_SIGMA: f64 = 3.0;
const DOUBT_LOOKED: f64 = 6.0;
/// Before its place is refined a pole must explain this part of what a mode must.
const REFINED: f64 = 0.2;
/// Below this a pole next to another is not worth a fit of its own.
const WORTH_A_FIT_SIGMA: f64 = 1.0;

/// What a refinement may do besides moving poles.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub(crate) enum PoleSearch {
    Nothing,
    /// That, and not more exactly than a comparison needs.
    Roughly,
    /// Take out needless poles, add one where the rest is largest, and look for close pairs: a second pole next to each
    /// that is there.
    Pairs,
}

/// A group of modes and the window that it was fitted in.
pub(crate) struct Group {
    pub window_hz: [f64; 2],
    pub solution: Solution,
    /// Looked for with [`PoleSearch::Pairs`].
    pub doubt: Option<Doubt>,
    /// What any pole explains, over what it would explain of white noise; at least 1.
    pub chance: f64,
}

/// One more pole would describe the FRFs better than chance does, but not well enough to be called a mode.
pub(crate) struct Doubt {
    pub pole: Pole,
    /// By mode of the solution: change of frequency (Hz) and damping ratio if that pole is one.
    pub shifts: Vec<[f64; 2]>,
}

/// Why a pole went out or came in.
pub(crate) enum Change {
    /// The FRFs are described as well without it.
    Needless(Pole),
    /// Outside the band, too much damping, or not determined.
    NotDetermined(Pole),
    Added(Pole),
}

/// One FRF with its noise, on lines or on means over neighbouring lines.
#[derive(Clone)]
pub(crate) struct Data {
    pub frequency_hz: Vec<f64>,
    pub receptance: Vec<Complex64>,
    /// sqrt(E|e|²), > 0.
    pub sigma: Vec<f64>,
    /// Standard deviation of the frequencies that went into the mean, Hz; may be left empty until [`crate::modal::max_likelihood::condense`].
    pub spread_hz: Vec<f64>,
    /// Lines that went into the mean.
    pub count: Vec<f64>,
}

impl Data {
    /// Its lines from `low` to below `high`, Hz; none where its band does not reach there.
    pub fn window(&self, [low, high]: [f64; 2]) -> NoisyFrf<'_> {
        let from = self.frequency_hz.partition_point(|&f| f < low);
        let to = self.frequency_hz.partition_point(|&f| f < high).max(from);
        NoisyFrf {
            frequency_hz: &self.frequency_hz[from..to],
            receptance: &self.receptance[from..to],
            sigma: &self.sigma[from..to],
            spread_hz: &self.spread_hz[from..to],
        }
    }

    /// Do its lines reach a frequency?
    pub fn reaches(&self, frequency_hz: f64) -> bool {
        reach(&self.frequency_hz, frequency_hz)
    }
}

/// Refines all candidates (ascending in frequency). The poles of a group that cannot be fitted go out; `None` where none
/// can.
pub(crate) fn refine(
    data: &[Data],
    candidates: &[Pole],
    search: PoleSearch,
    changes: &mut Vec<Change>,
) -> Option<Vec<Group>> {
    // A pole can have run onto one of the next group.
    let candidates = &apart(candidates, SAME_PLACE)[..];
    let middle = |at: usize| 0.5 * (candidates[at - 1].frequency_hz + candidates[at].frequency_hz);
    let mut ends: Vec<usize> = groups(candidates)
        .iter()
        .scan(0, |end, group| {
            *end += group.len();
            Some(*end)
        })
        .collect();
    let mut result = Vec::with_capacity(ends.len());
    let (mut g, mut before) = (0, 0);
    while g < ends.len() {
        let after = ends[g];
        let group = &candidates[before..after];
        let first = group.first().map_or(0.0, |p| p.frequency_hz);
        let last = group.last().map_or(f64::INFINITY, |p| p.frequency_hz);
        let low = if before == 0 { 0.0 } else { middle(before) };
        let high = if after == candidates.len() {
            f64::INFINITY
        } else {
            middle(after)
        };
        let fixed: Vec<Pole> = candidates[before.saturating_sub(FIXED_NEIGHBOURS)..before]
            .iter()
            .chain(&candidates[after..(after + FIXED_NEIGHBOURS).min(candidates.len())])
            .copied()
            .collect();
        let window_hz = [low.max(first / REACH), high.min(last * REACH)];
        let mut fit = PoleGroup {
            frfs: data.iter().map(|d| d.window(window_hz)).collect(),
            fixed,
            search,
            chance: Chance::default(),
        };
        // Poles that the lines do not tell apart (one mode that moves from FRF to FRF can have split) are too many.
        let Some(mut solution) = fit
            .fit(group)
            .or_else(|| MERGED.into_iter().find_map(|share| fit.fit(&apart(group, share))))
        else {
            // In two parts, or one that cannot be fitted costs all the others.
            match widest_gap(group, 0) {
                Some((at, _)) => ends.insert(g, before + at),
                None => {
                    changes.extend(group.iter().map(|pole| Change::NotDetermined(*pole)));
                    (g, before) = (g + 1, after);
                }
            }
            continue;
        };
        (g, before) = (g + 1, after);
        if search != PoleSearch::Roughly && !solution.poles.is_empty() {
            fit.chance = fit.by_chance(&solution);
        }
        let mut doubt = None;
        if search >= PoleSearch::Pairs {
            solution = fit.without_needless(solution, changes);
            fit.chance = fit.by_chance(&solution);
            for _ in 0..MAX_ADDED {
                match fit.with_one_more(&solution, &mut doubt) {
                    Some(more) => {
                        changes.push(Change::Added(more.poles[more.poles.len() - 1]));
                        solution = fit.without_needless(more, changes);
                    }
                    None => break,
                }
            }
        }
        result.push(Group {
            window_hz,
            solution,
            doubt,
            chance: fit.chance.overall,
        });
    }
    (!result.is_empty()).then_some(result)
}

/// Without those within a share of both half-widths of the one before: their residues cannot be told apart.
fn apart(group: &[Pole], share: f64) -> Vec<Pole> {
    let width = |p: &Pole| p.damping_ratio * p.frequency_hz;
    let mut kept: Vec<Pole> = Vec::with_capacity(group.len());
    for pole in group {
        let same = kept
            .last()
            .is_some_and(|p| pole.frequency_hz - p.frequency_hz < share * (width(p) + width(pole)));
        if !same {
            kept.push(*pole);
        }
    }
    kept
}

/// Splits at the widest gaps until no group is too large and no neighbours in one are far apart.
fn groups(candidates: &[Pole]) -> Vec<&[Pole]> {
    let mut todo = vec![candidates];
    let mut done = Vec::new();
    while let Some(group) = todo.pop() {
        let too_large = group.len() > MAX_GROUP;
        // Not at the very ends, or a hundred modes would make a hundred groups.
        let from_ends = if too_large { group.len() / 4 } else { 0 };
        let at = match widest_gap(group, from_ends) {
            Some((at, ratio)) if too_large || ratio > FAR_APART => at,
            _ => {
                done.push(group);
                continue;
            }
        };
        let (below, above) = group.split_at(at);
        todo.push(above);
        todo.push(below);
    }
    done
}

/// Where neighbours are furthest apart by the ratio of their frequencies, and that ratio; at least `from_ends` poles on either side.
fn widest_gap(group: &[Pole], from_ends: usize) -> Option<(usize, f64)> {
    let ratio = |k: usize| group[k].frequency_hz / group[k - 1].frequency_hz;
    (from_ends.max(1)..(group.len() - from_ends).max(1))
        .map(|k| (k, ratio(k)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

/// What each candidate explains over what it would have to explain to be a mode (above 1: it is one), with the poles
/// `held` and no others. `None` where the lines do not determine the residues of those.
pub(crate) fn worth(data: &[Data], held: &[Pole], candidates: &[Pole]) -> Option<Vec<f64>> {
    let groups: Vec<&[Pole]> = if held.is_empty() { vec![&[]] } else { groups(held) };
    let mut worth = vec![0.0; candidates.len()];
    let mut before = 0;
    let mut low = 0.0;
    for (g, group) in groups.iter().enumerate() {
        let after = before + group.len();
        let high = groups.get(g + 1).map_or(f64::INFINITY, |next| {
            0.5 * (group[group.len() - 1].frequency_hz + next[0].frequency_hz)
        });
        let window_hz = [low, high];
        low = high;
        let near = &held[before.saturating_sub(FIXED_NEIGHBOURS)..(after + FIXED_NEIGHBOURS).min(held.len())];
        before = after;
        let inside: Vec<usize> = (0..candidates.len())
            .filter(|&k| (window_hz[0]..window_hz[1]).contains(&candidates[k].frequency_hz))
            .collect();
        if inside.is_empty() {
            continue;
        }
        let frfs: Vec<NoisyFrf> = data
            .iter()
            .map(|d| d.window(window_hz))
            .filter(|frf| frf.takes_part(near.len()))
            .collect();
        let damping: Vec<f64> = inside.iter().map(|&k| candidates[k].damping_ratio).collect();
        let mut trials: Vec<Pole> = inside.iter().map(|&k| candidates[k]).collect();
        trials.extend(anywhere(&frfs, crate::signal::median(&damping)));
        let explained = ml_fit::explained_by(&frfs, near, &trials)?;
        let (of_candidates, of_any) = explained.split_at(inside.len());
        let wanted = enough(
            frfs.len(),
            chance(of_any, frfs.len()),
            CHANCE_SIGMA,
            LOOKED_EVERYWHERE,
        );
        for (&k, explained) in inside.iter().zip(of_candidates) {
            worth[k] = explained / wanted;
        }
    }
    Some(worth)
}

/// Trial poles all over the lines: of the damping given, and wider.
fn anywhere(frfs: &[NoisyFrf], damping: f64) -> Vec<Pole> {
    let first = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.first().copied())
        .fold(f64::INFINITY, f64::min);
    let last = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.last().copied())
        .fold(0.0, f64::max);
    let at = |k: usize| first + (last - first) * (k as f64 + 0.5) / TRIALS as f64;
    WIDER
        .iter()
        .flat_map(|wider| {
            (0..TRIALS).map(move |k| Pole {
                frequency_hz: at(k),
                damping_ratio: (damping * wider).min(damping.max(WIDEST)),
            })
        })
        .collect()
}

/// What any pole explains, over what it would explain of white noise of the size assumed; at least 1.
fn chance(explained: &[f64], frfs: usize) -> f64 {
    explained
        .chunks(TRIALS)
        .map(|of_damping| crate::signal::median(of_damping) / median_of_white(frfs))
        .fold(1.0, f64::max)
}

/// Median of what a pole explains of white noise: of a chi-squared variable (Wilson & Hilferty 1931).
fn median_of_white(frfs: usize) -> f64 {
    let k = 2.0 * frfs as f64;
    k * (1.0 - 2.0 / (9.0 * k)).powi(3)
}

/// Misfit that a mode must explain beyond what chance gives to any pole.
fn enough(frfs: usize, chance: f64, sigma: f64, looked: f64) -> f64 {
    let k = 2.0 * frfs as f64 + 2.0;
    chance * (k + sigma * (2.0 * k).sqrt() + looked)
}

/// What poles anywhere in a window explain.
struct Chance {
    /// See [`chance`].
    overall: f64,
    /// Of the trial poles of each damping ([`WIDER`]), in ascending frequency, over what they would explain of white noise.
    explained: Vec<f64>,
    /// Their frequencies, Hz.
    trial_hz: Vec<f64>,
}

impl Default for Chance {
    fn default() -> Self {
        Chance {
            overall: 1.0,
            explained: Vec::new(),
            trial_hz: Vec::new(),
        }
    }
}

impl Chance {
    /// The stretch of the trial poles nearest to a frequency, Hz, and what these explain (as [`chance`]).
    fn around(&self, frequency_hz: f64) -> Option<([f64; 2], f64)> {
        let trials = self.trial_hz.len();
        let from = self.trial_hz.partition_point(|hz| *hz < frequency_hz);
        let from = from
            .saturating_sub(NEARBY_TRIALS / 2)
            .min(trials.checked_sub(NEARBY_TRIALS)?);
        let near = from..from + NEARBY_TRIALS;
        let explained = self
            .explained
            .chunks(trials)
            .map(|of_damping| crate::signal::median(&of_damping[near.clone()]))
            .fold(1.0, f64::max);
        let half = 0.5 * (self.trial_hz[1] - self.trial_hz[0]);
        let stretch_hz = [self.trial_hz[from] - half, self.trial_hz[near.end - 1] + half];
        Some((stretch_hz, explained))
    }
}

/// A group of poles and the lines that it is fitted to.
pub(super) struct PoleGroup<'a> {
    pub(super) frfs: Vec<NoisyFrf<'a>>,
    fixed: Vec<Pole>,
    search: PoleSearch,
    chance: Chance,
}

impl PoleGroup<'_> {
    pub(super) fn fit(&self, poles: &[Pole]) -> Option<Solution> {
        // A search compares misfits, and a last refinement follows it.
        let by_chance = 2.0 * self.frfs.len() as f64 + 2.0;
        let settled = match self.search {
            PoleSearch::Nothing => ml_fit::SETTLED,
            PoleSearch::Roughly => ROUGHLY_COMPARED * by_chance,
            PoleSearch::Pairs => COMPARED * by_chance,
        };
        ml_fit::fit(&self.frfs, poles, &self.fixed, settled)
    }

    /// Misfit that a mode must explain to be one, for noise as large as the fit leaves.
    pub(super) fn wanted(&self, solution: &Solution) -> f64 {
        self.beyond_chance(solution, CHANCE_SIGMA, LOOKED_EVERYWHERE)
    }

    /// As [`wanted`](Self::wanted), for a pole of the fit: by what is left around it where that is less than elsewhere. A stretch that
    /// no poles describe (beyond what the hammer excites, a bad channel) must not decide what is needless far from it.
    pub(super) fn wanted_of(&self, solution: &Solution, pole: Pole) -> f64 {
        let anywhere = self.wanted(solution);
        let Some((stretch_hz, chance)) = self.chance.around(pole.frequency_hz) else {
            return anywhere;
        };
        let level = self.level_within(solution, stretch_hz).max(chance);
        anywhere.min(enough(
            solution.taking_part(),
            level,
            CHANCE_SIGMA,
            LOOKED_EVERYWHERE,
        ))
    }

    /// What the fit leaves on the lines of a stretch, over what noise would.
    fn level_within(&self, solution: &Solution, [low, high]: [f64; 2]) -> f64 {
        let (mut left, mut expected) = (0.0, 0.0);
        for (frf, found) in self.frfs.iter().zip(&solution.frfs) {
            for ((f, sigma), residual) in frf.frequency_hz.iter().zip(frf.sigma).zip(&found.residual) {
                if (low..=high).contains(f) {
                    left += (residual / sigma).norm_sqr();
                    expected += 1.0 - found.leverage;
                }
            }
        }
        if expected > 0.0 { left / expected } else { 1.0 }
    }

    fn beyond_chance(&self, solution: &Solution, sigma: f64, looked: f64) -> f64 {
        let level = solution.misfit / solution.degrees_of_freedom as f64;
        enough(
            solution.taking_part(),
            level.max(self.chance.overall),
            sigma,
            looked,
        )
    }

    fn by_chance(&self, solution: &Solution) -> Chance {
        let held: Vec<Pole> = solution.poles.iter().chain(&self.fixed).copied().collect();
        let trials = anywhere(&self.frfs, usual_damping(solution));
        let frfs = solution.taking_part();
        ml_fit::explained_by(&self.frfs, &held, &trials).map_or_else(Chance::default, |explained| Chance {
            overall: chance(&explained, frfs),
            explained: explained.iter().map(|e| e / median_of_white(frfs)).collect(),
            trial_hz: trials[..TRIALS].iter().map(|p| p.frequency_hz).collect(),
        })
    }

    fn line_hz(&self, frequency_hz: f64) -> f64 {
        self.frfs
            .iter()
            .map(|c| spacing_hz(c.frequency_hz, frequency_hz))
            .fold(f64::INFINITY, f64::min)
    }

    /// May this pole be a mode of the band?
    pub(super) fn possible(&self, pole: Pole) -> bool {
        self.reached(pole) && pole.damping_ratio < MAX_DAMPING
    }

    /// Do the lines of any FRF reach this pole?
    fn reached(&self, pole: Pole) -> bool {
        self.frfs.iter().any(|c| reach(c.frequency_hz, pole.frequency_hz))
    }

    /// Do the lines determine this pole?
    pub(super) fn determined(&self, solution: &Solution, j: usize) -> bool {
        let pole = solution.poles[j];
        let line_hz = self.line_hz(pole.frequency_hz);
        let width = pole.damping_ratio * pole.frequency_hz;
        let coarse = 2.0 * width < COARSE_LINES * line_hz;
        let level = solution.level();
        level * solution.frequency_std_hz(j) < 0.3 * width.max(line_hz)
            && (coarse || level * solution.damping_std(j) < 0.4 * pole.damping_ratio)
    }

    fn sane(&self, solution: &Solution, j: usize) -> bool {
        self.possible(solution.poles[j]) && self.determined(solution, j)
    }

    /// Adds a pole where the rest is largest, or next to one that is there, if that explains enough; one that explains
    /// something but not enough is a doubt.
    fn with_one_more(&self, solution: &Solution, doubt: &mut Option<Doubt>) -> Option<Solution> {
        let usual = usual_damping(solution);
        let enough = |more: &Solution| {
            let fall = solution.misfit - more.misfit;
            let sane = (0..more.poles.len()).all(|j| self.sane(more, j));
            let added = more.poles[more.poles.len() - 1];
            let within = |times: f64| (usual / times..usual * times).contains(&added.damping_ratio);
            let wanted = ADMITTED * self.wanted(more);
            sane && (within(ALIKE) && fall > wanted || within(UNLIKE) && fall > CLEARLY_THERE * wanted)
        };
        if let Some(more) = self.in_the_rest(solution).filter(enough) {
            return Some(more);
        }
        let more = self.beside(solution)?;
        if enough(&more) {
            return Some(more);
        }
        *doubt = self.doubt(solution, &more);
        None
    }

    /// Does one more pole explain more than chance does?
    fn doubt(&self, solution: &Solution, more: &Solution) -> Option<Doubt> {
        let pole = *more.poles.last()?;
        let fall = solution.misfit - more.misfit;
        // Residues of no common phase are an error of the model.
        let residues: Vec<Complex64> = (0..self.frfs.len())
            .filter(|&m| more.frfs[m].took_part())
            .map(|m| more.constant(m, more.poles.len() - 1).0)
            .collect();
        if residues.len() > 4 && shape::complexity(&residues).is_some_and(|c| c.mpc < 0.5) {
            return None;
        }
        if !self.reached(pole)
            || pole.damping_ratio > MAX_DAMPING
            || fall < self.beyond_chance(more, DOUBT_SIGMA, DOUBT_LOOKED)
        {
            return None;
        }
        let both = solution.poles.iter().zip(&more.poles);
        Some(Doubt {
            pole,
            shifts: both
                .map(|(a, b)| [b.frequency_hz - a.frequency_hz, b.damping_ratio - a.damping_ratio])
                .collect(),
        })
    }

    fn and(&self, solution: &Solution, pole: Pole) -> Option<Solution> {
        let mut poles = solution.poles.clone();
        poles.push(pole);
        self.fit(&poles)
    }

    /// Two modes closer than their widths leave a rest that hides in the noise: a second pole is tried on either side of
    /// each, the others held, and the place that explains most is refined.
    fn beside(&self, solution: &Solution) -> Option<Solution> {
        let usual = usual_damping(solution);
        let trials: Vec<Pole> = solution
            .poles
            .iter()
            .flat_map(|pole| {
                [-1.0, 1.0].map(|side| Pole {
                    frequency_hz: pole.frequency_hz * (1.0 + side * BESIDE_WIDTHS * pole.damping_ratio),
                    damping_ratio: usual,
                })
            })
            .collect();
        // No more than noise gives to any pole: not worth a fit.
        let by_noise = self.beyond_chance(solution, WORTH_A_FIT_SIGMA, 0.0);
        self.best_of(solution, &trials, by_noise)
    }

    /// With the trial pole that explains most, the others held, where that is more than `least`.
    fn best_of(&self, solution: &Solution, trials: &[Pole], least: f64) -> Option<Solution> {
        let held: Vec<Pole> = solution.poles.iter().chain(&self.fixed).copied().collect();
        let explained = ml_fit::explained_by(&self.frfs, &held, trials)?;
        let (fall, best) = explained
            .into_iter()
            .zip(trials)
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        (fall > least).then(|| self.and(solution, *best))?
    }

    /// One more pole where the rest is largest; none where it could not pay for a mode.
    fn in_the_rest(&self, solution: &Solution) -> Option<Solution> {
        // Rest by frequency, over all FRFs; FRFs may have lines of their own.
        let mut rest: Vec<(f64, f64)> = Vec::new();
        for (frf, found) in self.frfs.iter().zip(&solution.frfs) {
            let lines = frf.frequency_hz.iter().zip(frf.sigma).zip(&found.residual);
            rest.extend(lines.map(|((f, s), r)| (*f, (r / s).norm_sqr() - 1.0)));
        }
        rest.sort_by(|a, b| a.0.total_cmp(&b.0));
        let near = 5 * solution.taking_part();
        if rest.len() < 2 * near {
            return None;
        }
        let mut sum: f64 = rest[..near].iter().map(|r| r.1).sum();
        let mut most = (sum, near / 2);
        for k in near..rest.len() {
            sum += rest[k].1 - rest[k - near].1;
            if sum > most.0 {
                most = (sum, k - near / 2);
            }
        }
        // Nothing left that could pay for a mode.
        if most.0 < 0.4 * self.wanted(solution) {
            return None;
        }
        let centre = rest[most.1].0;
        let usual = usual_damping(solution);
        // A pole on top of another one is a saddle: next to it the search begins on either slope.
        let trials = [1.0, 1.0 - usual, 1.0 + usual].map(|factor| Pole {
            frequency_hz: centre * factor,
            damping_ratio: usual,
        });
        self.best_of(solution, &trials, REFINED * self.wanted(solution))
    }
}

/// Of the modes of a group; what is damped beyond that stands for something else.
fn usual_damping(solution: &Solution) -> f64 {
    const LIGHTLY: f64 = 0.15;
    let damping = solution.poles.iter().map(|p| p.damping_ratio);
    let light: Vec<f64> = damping.filter(|d| *d < LIGHTLY).collect();
    match light.is_empty() {
        true => 0.02,
        false => crate::signal::median(&light),
    }
}

/// FRFs of the group that show the mode, and the squared size over uncertainty in the one that shows it best.
pub(crate) fn seen_in(solution: &Solution, mode: usize) -> (usize, f64) {
    let level = (solution.misfit / solution.degrees_of_freedom as f64).max(1.0);
    let evidence: Vec<f64> = (0..solution.frfs.len())
        .map(|m| solution.evidence(m, mode) / level)
        .collect();
    (
        evidence.iter().filter(|e| **e > SEEN).count(),
        evidence.iter().fold(0.0, |m: f64, e| m.max(*e)),
    )
}

/// Distance of the finest lines of some FRFs at a frequency, Hz.
pub(crate) fn line_hz(data: &[Data], at_hz: f64) -> f64 {
    data.iter()
        .map(|d| spacing_hz(&d.frequency_hz, at_hz))
        .fold(f64::INFINITY, f64::min)
}

/// Distance of neighbouring lines at a frequency, Hz.
pub(crate) fn spacing_hz(frequency_hz: &[f64], at_hz: f64) -> f64 {
    let n = frequency_hz.len();
    if n < 2 {
        return f64::INFINITY;
    }
    let k = frequency_hz.partition_point(|&f| f < at_hz).clamp(1, n - 1);
    frequency_hz[k] - frequency_hz[k - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poles_far_apart_are_fitted_apart() {
        let poles = |frequencies: &[f64]| -> Vec<Pole> {
            let pole = |&frequency_hz: &f64| Pole {
                frequency_hz,
                damping_ratio: 0.01,
            };
            frequencies.iter().map(pole).collect()
        };
        let lengths = |frequencies: &[f64]| -> Vec<usize> {
            groups(&poles(frequencies))
                .iter()
                .map(|group| group.len())
                .collect()
        };
        assert_eq!(lengths(&[10.0, 12.0, 100.0, 110.0, 250.0, 2000.0]), [2, 3, 1]);
        assert_eq!(lengths(&[10.0, 29.0, 80.0]), [3]);
        // Too many for one group: at the widest gap that is not at the ends.
        let many: Vec<f64> = (0..14)
            .map(|k| if k < 6 { 10.0 } else { 11.0 } + 0.01 * f64::from(k))
            .collect();
        assert_eq!(lengths(&many), [6, 8]);
        assert_eq!(lengths(&[]), [0]);
        assert_eq!(widest_gap(&poles(&[10.0]), 0), None);
    }

    /// A stretch that no poles describe decides what chance brings there, and not far from it.
    #[test]
    fn what_chance_brings_is_that_of_the_neighbourhood() {
        let explained = (0..2 * TRIALS).map(|k| if k % TRIALS < TRIALS / 2 { 1.2 } else { 400.0 });
        let chance = Chance {
            overall: 200.0,
            explained: explained.collect(),
            trial_hz: (0..TRIALS).map(|k| 5.0 + 10.0 * k as f64).collect(),
        };
        let around = |f: f64| chance.around(f).unwrap();
        assert_eq!(around(12.0), ([0.0, 80.0], 1.2));
        assert_eq!(around(1e4), ([160.0, 240.0], 400.0));
        assert!(Chance::default().around(10.0).is_none());
    }
}
