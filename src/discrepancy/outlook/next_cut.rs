//! The next cut: another feed, speed, depth or immersion, or the same again, by what it is expected to tell.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::Result;
use crate::cutting::EdgeBit;
use crate::data::Immersion;
use crate::discrepancy::candidate::EffectCandidate;
use crate::discrepancy::diagnosis::Diagnosis;
use crate::discrepancy::outlook::next_measurement::{
    Alternative, ENOUGH_SIGMAS, LEAST_SIGMAS, NextMeasurement,
};
use crate::discrepancy::verdict::DiagnosisVerdict;
use crate::effects::Cutting;
use crate::identify::forces::cutting_data::{CutData, CutKind};
use crate::identify::{CuttingData, CuttingProblem, LeastSquares, Linearisation};

type CuttingCandidate = EffectCandidate<Cutting>;

/// A cut that could be made.
struct Proposal {
    what: String,
    /// Cuts; setting up another immersion counts as a second one.
    cost: f64,
    /// How often it is made.
    times: f64,
    cut: CutData,
}

/// Cuts that proposals start from.
const BASES: usize = 3;

/// What to cut next.
///
/// # Errors
/// A cut that the force model cannot be worked out for.
pub fn advise_cutting(data: &CuttingData, diagnosis: &Diagnosis<Cutting>) -> Result<NextMeasurement> {
    let (DiagnosisVerdict::Effect, Some(winner)) = (diagnosis.verdict, diagnosis.winner()) else {
        return Ok(NextMeasurement::words(match diagnosis.verdict {
            DiagnosisVerdict::Unknown if data.speed_is_contradicted => {
                "the same cuts once more, with sampling rate, spindle speed and columns written down, where these cannot be set right for \
                 the records at hand"
            }
            DiagnosisVerdict::Unknown => {
                "the cut with the largest misfit once more, and once at half its feed: what repeats is physics"
            }
            _ => "none needed for this model; other feeds and speeds would test it further",
        }));
    };
    let test = lab_test(&winner.name.effect);
    let others = || {
        diagnosis
            .candidates
            .iter()
            .filter(|c| c.label() != winner.label())
    };
    let is_rival = |c: &&CuttingCandidate| diagnosis.indistinguishable.contains(&c.label());
    let rival = others().find(is_rival);
    let Some(second) = rival.or_else(|| others().next()) else {
        return Ok(NextMeasurement::words(format!(
            "{test}: it confirms {}",
            winner.label()
        )));
    };
    let Some(best) = best(data, (winner, second), winner.reduced_chi2.max(1.0))? else {
        return Ok(NextMeasurement::words(format!(
            "{test}: it confirms {}",
            winner.label()
        )));
    };
    let sigmas = best.expected_sigmas.unwrap_or(0.0);
    let what = match rival {
        None => format!("{test}: it confirms {}; or {}", winner.label(), best.what),
        Some(rival) if sigmas < LEAST_SIGMAS => format!(
            "{test}: it tells {} from {}; no cut does at four standard deviations (best: {})",
            winner.label(),
            rival.label(),
            best.what
        ),
        Some(_) => best.what.clone(),
    };
    Ok(NextMeasurement { what, ..best })
}

/// The test outside the cut that shows an effect best.
fn lab_test(effect: &str) -> &'static str {
    match effect {
        "size-effect" => "the same cut at a quarter and at four times the feed",
        "runout" => "the same cut with the tool turned by half a pitch in its holder",
        "tooth-radii" => "the radius of each tooth, on a setting device or with a dial gauge",
        "uneven-pitch" => "the angles between the teeth, from a photograph along the tool's axis",
        "push-off" => "the depth of the slots of the smallest and the largest feed, measured",
        "tool-wear" => "the first cut repeated now, and once more with a new tool",
        "speed-dependence" => "the same cut at half and at twice the cutting speed",
        "crosstalk" => "a known static load along one axis at a time",
        "dynamometer-misalignment" => "a known static load along the tool axis",
        "dynamometer-resonance" => "a tap test of the dynamometer with the workpiece on it",
        "nonlinear-drift" => "a minute of record without cutting, before and after a cut",
        "chatter" => "the same cut at half the depth, and at a speed a tenth higher",
        "chisel-edge" => "the same hole with a pilot hole as wide as the chisel edge",
        "margin-friction" => "a hole twice as deep, and the drill turning in the finished hole",
        _ => "the same cut at another feed and another speed",
    }
}

fn best(
    data: &CuttingData,
    (a, b): (&CuttingCandidate, &CuttingCandidate),
    scale: f64,
) -> Result<Option<NextMeasurement>> {
    let proposals = proposals(data);
    let problem = |c: &CuttingCandidate, data: &CuttingData| {
        CuttingProblem {
            model: &c.model,
            data,
        }
        .linearise(&c.theta)
    };
    let known_a = problem(a, data)?;
    let known_b = problem(b, data)?;
    let none = data.filtered(|_| false);
    let (prior_a, prior_b) = (problem(a, &none)?, problem(b, &none)?);
    let sigmas: Vec<f64> = proposals
        .par_iter()
        .map(|p| {
            let of_b = growth(data, p, a, b, (&known_b.hessian, &prior_b))?;
            let of_a = growth(data, p, b, a, (&known_a.hessian, &prior_a))?;
            Ok((of_b.min(of_a) / scale).sqrt())
        })
        .collect::<Result<_>>()?;
    let by_cost = |x: &usize, y: &usize| {
        let cost = |i: usize| proposals[i].cost;
        cost(*x)
            .total_cmp(&cost(*y))
            .then(sigmas[*y].total_cmp(&sigmas[*x]))
    };
    let all = || 0..proposals.len();
    let chosen = all().filter(|i| sigmas[*i] >= ENOUGH_SIGMAS).min_by(by_cost);
    let Some(chosen) = chosen.or_else(|| all().max_by(|x, y| sigmas[*x].total_cmp(&sigmas[*y]))) else {
        return Ok(None);
    };
    let mut others: Vec<usize> = all().filter(|i| *i != chosen).collect();
    others.sort_by(|x, y| sigmas[*y].total_cmp(&sigmas[*x]));
    Ok(Some(NextMeasurement {
        expected_sigmas: Some(sigmas[chosen]),
        between: Some([a.label(), b.label()]),
        cost: Some(proposals[chosen].cost),
        alternatives: others
            .into_iter()
            .take(2)
            .map(|i| Alternative {
                what: proposals[i].what.clone(),
                expected_sigmas: sigmas[i],
                cost: proposals[i].cost,
            })
            .collect(),
        ..NextMeasurement::words(format!(
            "{}: {:.0} standard deviations expected between {} and {}",
            proposals[chosen].what,
            sigmas[chosen],
            a.label(),
            b.label()
        ))
    }))
}

/// Expected growth of the rival's Σ r²/σ² where `truth` makes the cut. `known`: the rival's information from the present
/// data with its priors, and what the priors alone give.
fn growth(
    data: &CuttingData,
    proposal: &Proposal,
    truth: &CuttingCandidate,
    rival: &CuttingCandidate,
    (known, prior): (&DMatrix<f64>, &Linearisation),
) -> Result<f64> {
    let with = |cut: CutData| CuttingData {
        cuts: vec![Arc::new(cut)],
        ..data.clone()
    };
    let blank = with(proposal.cut.clone());
    let fits = CuttingProblem {
        model: &truth.model,
        data: &blank,
    }
    .fits(&truth.theta)?;
    let mut made = proposal.cut.clone();
    for (channel, fit) in made
        .channels
        .iter_mut()
        .zip(fits.iter().flat_map(|f| &f.channels))
    {
        if let (Some(channel), Some(fit)) = (channel, fit) {
            channel.orders.clone_from(&fit.orders);
            channel.level.clone_from(&fit.level);
        }
    }
    let made = with(made);
    let seen = CuttingProblem {
        model: &rival.model,
        data: &made,
    }
    .linearise(&rival.theta)?;
    let times = proposal.times;
    let square = 2.0 * (seen.cost - prior.cost) * times;
    let gradient = (&seen.gradient - &prior.gradient) * times;
    let information = known + (&seen.hessian - &prior.hessian) * times;
    Ok(match information.cholesky() {
        Some(cholesky) => (square - gradient.dot(&cholesky.solve(&gradient))).clamp(0.0, square.max(0.0)),
        None => 0.0,
    })
}

/// Cuts near those that were made: what a shop can cut with the same tool.
fn proposals(data: &CuttingData) -> Vec<Proposal> {
    let count = data.cuts.len();
    let mut bases: Vec<usize> = (0..BASES)
        .map(|k| k * count.saturating_sub(1) / (BASES - 1))
        .collect();
    bases.dedup();
    let mut all = Vec::new();
    for base in bases.into_iter().filter_map(|i| data.cuts.get(i)) {
        let mut plain = base.as_ref().clone();
        plain.vibration = None;
        plain.setting.has_vibration = false;
        // Whatever is cut next comes last in the sequence.
        plain.setting.progress = 1.0;
        let again = |what: &str, times: f64| Proposal {
            what: format!("cut {} {what} more", base.id),
            cost: times,
            times,
            cut: plain.clone(),
        };
        all.extend([again("once", 1.0), again("three times", 3.0)]);
        let mut propose = |what: String, cost: f64, cut: CutData| {
            all.push(Proposal {
                what,
                cost,
                times: 1.0,
                cut,
            });
        };
        for (factor, words) in [
            (0.25, "a quarter of"),
            (0.5, "half"),
            (2.0, "twice"),
            (4.0, "four times"),
        ] {
            let mut faster = plain.clone();
            faster.spindle_rpm *= factor;
            faster.cutting_speed_m_per_min *= factor;
            faster.setting.speed_ratio *= factor;
            if (0.5..=2.0).contains(&factor) {
                propose(format!("cut {} at {words} its speed", base.id), 1.0, faster);
            }
            if let CutKind::Turning { edge } = &plain.kind {
                let mut fed = plain.clone();
                fed.feed_mm *= factor;
                fed.setting.feed_mm *= factor;
                // The tip aside, the chip grows with the feed all along the edge.
                let thicker = edge.iter().map(|bit| EdgeBit {
                    chip_mm: factor * bit.chip_mm,
                    ..*bit
                });
                fed.kind = CutKind::Turning {
                    edge: thicker.collect(),
                };
                propose(format!("cut {} at {words} its feed", base.id), 1.0, fed);
            }
            let CutKind::Milling { cut, .. } = &plain.kind else {
                continue;
            };
            let orders = plain.orders;
            let with = |cut: crate::cutting::waveform::MillingCut| {
                let mut other = plain.clone();
                other.feed_mm = cut.feed_per_tooth_mm;
                other.setting.feed_mm = cut.feed_per_tooth_mm;
                other.kind = CutKind::Milling {
                    unit: Box::new(cut.linear(orders)),
                    cut,
                };
                other
            };
            let mut fed = cut.clone();
            fed.feed_per_tooth_mm *= factor;
            propose(format!("cut {} at {words} its feed", base.id), 1.0, with(fed));
            if (0.5..=2.0).contains(&factor) {
                let deep = with(cut.deeper(factor));
                propose(format!("cut {} at {words} its depth", base.id), 1.0, deep);
            }
        }
        if let CutKind::Milling { cut, .. } = &plain.kind {
            for (start_rad, exit_rad, words) in [
                (0.0, FRAC_PI_2, "at half immersion, up milling"),
                (FRAC_PI_2, PI, "at half immersion, down milling"),
                (0.0, PI, "as a slot"),
            ] {
                let immersion = Immersion { start_rad, exit_rad };
                if immersion == cut.immersion {
                    continue;
                }
                let mut other = plain.clone();
                let cut = crate::cutting::waveform::MillingCut {
                    immersion,
                    ..cut.clone()
                };
                other.kind = CutKind::Milling {
                    unit: Box::new(cut.linear(plain.orders)),
                    cut,
                };
                propose(format!("cut {} {words}", base.id), 2.0, other);
            }
        }
    }
    all
}
