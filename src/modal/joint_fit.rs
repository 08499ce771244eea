//! One set of poles for all FRFs of a set.
//!
//! The candidates of the single FRFs are fitted to all curves at once, group by group of neighbouring modes.
//! A pole that the curves do not need is taken out, and one is added where what the fit leaves over has a
//! resonance of its own: two modes closer than their widths show as one peak in every single FRF, but move
//! with different shapes, so together the FRFs tell them apart.

use num_complex::Complex64;

use super::local_fit::{self, Pole, Problem, Solution};

/// A gap of this many half-widths (of both modes together) separates groups.
const GROUP_GAP: f64 = 4.0;
const MAX_GROUP: usize = 8;
/// Half-widths beyond the outermost poles that take part, and lines at least.
const REACH: f64 = 5.0;
const REACH_LINES: usize = 4;
/// A pole stays if without it the misfit grows by this many times what chance allows …
const NEEDED: f64 = 4.0;
/// … and one is added only if the misfit falls by more.
const WANTED: f64 = 8.0;
const MAX_ADDED: usize = 3;
const MAX_DAMPING: f64 = 0.3;

/// Curves on common lines.
pub(super) struct CurveSet<'a> {
    pub frequency_hz: &'a [f64],
    pub mobility: Vec<&'a [Complex64]>,
}

pub(super) struct JointMode {
    pub pole: Pole,
    pub frequency_std_hz: f64,
    pub damping_std: f64,
    /// Curves in which the mode's peak stands five standard deviations out of the residual.
    pub seen_in: usize,
}

/// `None` for a group that cannot be fitted jointly; its candidates then stand as they are.
pub(super) fn refine(set: &CurveSet, candidates: &[Pole]) -> Vec<(Vec<usize>, Option<Vec<JointMode>>)> {
    let groups = groups(candidates);
    (0..groups.len())
        .map(|g| {
            let group = &groups[g];
            let poles: Vec<Pole> = group.iter().map(|&i| candidates[i]).collect();
            // The window ends half-way to the next group.
            let edge = |other: Option<&Vec<usize>>, last: bool| {
                let other = candidates[*if last { other?.last()? } else { other?.first()? }];
                let own = if last { poles[0] } else { poles[poles.len() - 1] };
                Some(0.5 * (other.frequency_hz + own.frequency_hz))
            };
            let below = g
                .checked_sub(1)
                .and_then(|k| edge(groups.get(k), true))
                .unwrap_or(0.0);
            let above = edge(groups.get(g + 1), false).unwrap_or(f64::INFINITY);
            (group.clone(), fit_group(set, &poles, [below, above]))
        })
        .collect()
}

/// Indices of candidates (ascending in frequency) that are fitted together.
fn groups(candidates: &[Pole]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let width = |p: &Pole| p.damping_ratio * p.frequency_hz;
    for (i, pole) in candidates.iter().enumerate() {
        let joins = i > 0 && {
            let last = &candidates[i - 1];
            pole.frequency_hz - last.frequency_hz < GROUP_GAP * (width(pole) + width(last))
        };
        match groups.last_mut() {
            Some(group) if joins && group.len() < MAX_GROUP => group.push(i),
            _ => groups.push(vec![i]),
        }
    }
    groups
}

fn fit_group(set: &CurveSet, start: &[Pole], limits_hz: [f64; 2]) -> Option<Vec<JointMode>> {
    let f = set.frequency_hz;
    let (first, last) = (start.first()?, start.last()?);
    let low = first.frequency_hz * (1.0 - REACH * first.damping_ratio);
    let high = last.frequency_hz * (1.0 + REACH * last.damping_ratio);
    let index = |hz: f64| f.partition_point(|&x| x < hz);
    let from = index(low.max(limits_hz[0])).min(index(first.frequency_hz).saturating_sub(REACH_LINES));
    let to = index(high.min(limits_hz[1]))
        .max(index(last.frequency_hz) + REACH_LINES)
        .min(f.len());
    let window = f.get(from..to)?;
    let mut group = Group {
        problem: Problem {
            frequency_hz: window,
            curves: set.mobility.iter().map(|y| &y[from..to]).collect(),
            line_weight: vec![1.0; window.len()],
            curve_weight: Vec::new(),
            residual_terms: 3,
        },
    };
    // First weights: curves of equal size. Then by what each leaves over.
    let size = |y: &[Complex64]| (y.iter().map(|y| y.norm_sqr()).sum::<f64>() / y.len() as f64).sqrt();
    let sizes: Vec<f64> = group.problem.curves.iter().map(|y| size(y)).collect();
    let largest = sizes.iter().fold(0.0, |m: f64, s| m.max(*s));
    if largest <= 0.0 || !largest.is_finite() {
        return None;
    }
    group.problem.curve_weight = sizes.iter().map(|s| 1.0 / s.max(1e-9 * largest)).collect();

    let mut solution = group.fit(start)?;
    for _ in 0..2 {
        group.reweight(&solution);
        solution = group.fit(&solution.poles)?;
    }
    solution = group.without_needless(solution);
    for _ in 0..MAX_ADDED {
        match group.with_one_more(&solution) {
            Some(more) => {
                group.reweight(&more);
                let refined = group.fit(&more.poles)?;
                solution = group.without_needless(refined);
            }
            None => break,
        }
    }
    Some(group.modes(&solution))
}

struct Group<'a> {
    problem: Problem<'a>,
}

impl Group<'_> {
    fn fit(&self, poles: &[Pole]) -> Option<Solution> {
        local_fit::fit(&self.problem, poles)
    }

    fn line_hz(&self) -> f64 {
        let f = self.problem.frequency_hz;
        f.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min)
    }

    /// Each curve's weight from its residual.
    fn reweight(&mut self, solution: &Solution) {
        let rms: Vec<f64> = solution
            .residual
            .iter()
            .map(|r| (r.iter().map(|r| r.norm_sqr()).sum::<f64>() / r.len().max(1) as f64).sqrt())
            .collect();
        let largest = rms.iter().fold(0.0, |m: f64, s| m.max(*s));
        // One curve without any noise must not take all the weight.
        if largest > 0.0 {
            self.problem.curve_weight = rms.iter().map(|s| 1.0 / s.max(1e-3 * largest)).collect();
        }
    }

    /// Real parameters that one pole brings: its own two and a complex residue a curve.
    fn cost_of_a_pole(&self) -> f64 {
        2.0 * self.problem.curves.len() as f64 + 2.0
    }

    fn misfit(solution: &Solution) -> f64 {
        solution.variance * solution.degrees_of_freedom as f64
    }

    /// Is each pole one that these lines determine?
    fn sane(&self, solution: &Solution, j: usize) -> bool {
        let pole = solution.poles[j];
        let f = self.problem.frequency_hz;
        let line_hz = self.line_hz();
        let width = pole.damping_ratio * pole.frequency_hz;
        let inside = pole.frequency_hz >= f[1] && pole.frequency_hz <= f[f.len() - 2];
        inside
            && pole.damping_ratio < MAX_DAMPING
            && solution.frequency_std_hz(j) < 0.3 * width.max(line_hz)
            && solution.damping_std(j) < 0.5 * pole.damping_ratio
    }

    /// Takes out the least needed pole until all are needed.
    fn without_needless(&self, mut solution: Solution) -> Solution {
        while solution.poles.len() > 1 {
            let trials = (0..solution.poles.len()).filter_map(|j| {
                let mut rest = solution.poles.clone();
                rest.remove(j);
                let without = self.fit(&rest)?;
                let growth = (Self::misfit(&without) - Self::misfit(&solution)) / solution.variance;
                let wanted = if self.sane(&solution, j) {
                    NEEDED * self.cost_of_a_pole()
                } else {
                    f64::INFINITY
                };
                (growth < wanted).then_some((growth, without))
            });
            match trials.min_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((_, without)) => solution = without,
                None => break,
            }
        }
        solution
    }

    /// Adds a pole where the residual is largest, if that explains much of it.
    fn with_one_more(&self, solution: &Solution) -> Option<Solution> {
        let f = self.problem.frequency_hz;
        let left_over: Vec<f64> = (0..f.len())
            .map(|k| {
                let curves = solution.residual.iter().zip(&self.problem.curve_weight);
                curves.map(|(r, w)| (r[k] * w).norm_sqr()).sum()
            })
            .collect();
        let around = |k: usize| left_over[k - 2..=k + 2].iter().sum::<f64>();
        let most = (2..f.len().checked_sub(2)?).max_by(|&a, &b| around(a).total_cmp(&around(b)))?;
        let mut damping: Vec<f64> = solution.poles.iter().map(|p| p.damping_ratio).collect();
        damping.sort_by(f64::total_cmp);
        let usual = damping[damping.len() / 2];
        let more = [f[most] - usual * f[most], f[most], f[most] + usual * f[most]]
            .into_iter()
            .filter_map(|frequency_hz| {
                let mut poles = solution.poles.clone();
                poles.push(Pole {
                    frequency_hz,
                    damping_ratio: usual,
                });
                self.fit(&poles)
            })
            .min_by(|a, b| a.variance.total_cmp(&b.variance))?;
        let fall = (Self::misfit(solution) - Self::misfit(&more)) / more.variance;
        let all_sane = (0..more.poles.len()).all(|j| self.sane(&more, j));
        let added = more.poles[more.poles.len() - 1].damping_ratio;
        let alike = (usual / 3.0..usual * 3.0).contains(&added);
        (all_sane && alike && fall > WANTED * self.cost_of_a_pole()).then_some(more)
    }

    fn modes(&self, solution: &Solution) -> Vec<JointMode> {
        (0..solution.poles.len())
            .filter(|&j| self.sane(solution, j))
            .map(|j| {
                let pole = solution.poles[j];
                let seen = solution
                    .residues
                    .iter()
                    .zip(&solution.residual)
                    .filter(|(residues, residual)| {
                        let noise =
                            residual.iter().map(|r| r.norm_sqr()).sum::<f64>() / residual.len() as f64;
                        (residues[j] / pole.damping_ratio).norm() > 5.0 * noise.sqrt()
                    });
                JointMode {
                    pole,
                    frequency_std_hz: solution.frequency_std_hz(j),
                    damping_std: solution.damping_std(j),
                    seen_in: seen.count(),
                }
            })
            .collect()
    }
}
