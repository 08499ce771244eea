//! Records of some cuts, or one channel of them, with another gain than the rest: a range switched between two cuts, a file in
//! kilonewtons, a plug the other way round, a cable without contact.

use std::sync::Arc;

use super::plausible::fit;
use super::robust::RobustFit;
use super::sequence::{sequences, switch};
use crate::discrepancy::setup::finding::{SetupFinding, with_error};
use crate::identify::forces::cutting_data::CutData;
use crate::identify::{CutFit, CuttingData, CuttingModel, CuttingProblem};
use crate::signal::median;
use crate::text::{figures, listed};

const NAMES: [&str; 4] = ["Fx", "Fy", "Fz", "Mz"];
/// Gains that differ by less are one.
const DEVIATES: f64 = 0.05;
/// A deviation is so many standard errors, and so many times as far as the cuts scatter.
const BEYOND: f64 = 5.0;
/// A channel that is off by less than this share of what the farthest is off is off for a reason of its own.
const ASIDE: f64 = 0.2;
/// A gain that is less certain than this says nothing.
const CERTAIN: f64 = 0.1;
/// Gains this near, over the larger, are those of one mistake.
const ALIKE: f64 = 0.1;
/// A channel with less of its force than this has none of it.
const NONE_OF_IT: f64 = 0.03;
/// What a channel in kN shows of its force among others in N.
const KILO: f64 = 1e-3;
/// Mistakes looked at further.
const MOST: usize = 3;

/// Another gain of some records.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OtherGain {
    /// By index into the data's.
    pub(super) cuts: Vec<usize>,
    /// 0 to 3 for Fx, Fy, Fz, Mz; `None`: all.
    pub(super) channel: Option<usize>,
    /// Recorded over true.
    pub(super) factor: f64,
    /// The channel shows none of its force, as far as the noise lets see.
    pub(super) is_dead: bool,
}

impl OtherGain {
    /// The records with the true gain, if that is `more` times [`OtherGain::factor`].
    pub(super) fn undone(&self, data: &CuttingData, more: f64) -> CuttingData {
        let mut own = data.clone();
        for &i in &self.cuts {
            let cut = Arc::make_mut(&mut own.cuts[i]);
            for (channel, found) in cut.channels.iter_mut().enumerate() {
                if self.channel.is_none_or(|only| only == channel)
                    && let Some(found) = found
                {
                    found.scale(1.0 / (self.factor * more));
                }
            }
        }
        own
    }

    /// All channels of a single record.
    pub(super) fn is_of_one_cut(&self) -> bool {
        self.cuts.len() == 1 && self.channel.is_none()
    }

    /// The records without the channel.
    pub(super) fn left_out(&self, data: &CuttingData) -> Option<CuttingData> {
        let channel = self.channel?;
        let mut own = data.clone();
        for &i in &self.cuts {
            let cut = Arc::make_mut(&mut own.cuts[i]);
            cut.channels[channel] = None;
            cut.channels.iter().any(Option::is_some).then_some(())?;
        }
        Some(own)
    }

    /// The records as they can be used: with the gain that they look like, or without the channel that is dead.
    pub(super) fn mended(&self, data: &CuttingData) -> Option<CuttingData> {
        match self.is_dead {
            true => self.left_out(data),
            false => Some(self.undone(data, 1.0)),
        }
    }

    /// `value`, `std`: logarithm of what the gain is over [`OtherGain::factor`].
    pub(super) fn finding(&self, data: &CuttingData, value: f64, std: f64) -> SetupFinding {
        let factor = self.factor * value.exp();
        let error = (factor * std).abs();
        let ids: Vec<String> = self.cuts.iter().map(|&i| data.cuts[i].id.clone()).collect();
        let what = self.channel.map_or("all channels", |c| NAMES[c]);
        let place = match self.is_of_one_cut() {
            true => format!("cut {}", listed(&ids)),
            false => format!("cut {}, {what}", listed(&ids)),
        };
        let (kind, told) = if self.is_dead {
            let told = format!(
                "{what} shows none of the force that the other channels and cuts ask for: look at its cable, plug and amplifier, and leave \
                 this channel of cut {} out (or the cut).",
                listed(&ids)
            );
            ("dead-channel", told)
        } else {
            let (kind, key) = match is_turned_round(factor) {
                true => ("channel-sign", "sign = -1".to_string()),
                false => (
                    "channel-gain",
                    format!("gain_n_per_unit = {}", figures(1.0 / factor, 4)),
                ),
            };
            let told = format!(
                "Recorded is {} times what the other cuts ask for, {}. Find out which of the two is right; for each of these cuts a \
                 [[channel]] with `cut`, `name` and `{key}` puts it right.",
                with_error(factor, error),
                looks_like(factor)
            );
            (kind, told)
        };
        SetupFinding {
            kind,
            place,
            value: Some(if self.is_dead { 0.0 } else { factor }),
            std_error: (!self.is_dead).then_some(error),
            unit: "1",
            confidence: 0.0,
            remedy: told,
        }
    }
}

fn is_turned_round(factor: f64) -> bool {
    (factor + 1.0).abs() < ALIKE
}

/// What makes records so many times too large.
fn looks_like(factor: f64) -> &'static str {
    const NEWTONS_PER_POUND: f64 = 4.448_221_615;
    let is = |of: f64| (factor.abs() / of).ln().abs() < DEVIATES;
    if is_turned_round(factor) {
        "as if a plug, the polarity or an axis were turned round between the cuts"
    } else if is(KILO) {
        "as if these files were in kN and the others in N"
    } else if is(1.0 / KILO) {
        "as if these files were in N and the others in kN"
    } else if is(NEWTONS_PER_POUND) || is(1.0 / NEWTONS_PER_POUND) {
        "as if pounds-force and newtons were mixed"
    } else {
        "as if a range or sensitivity of the amplifier had been switched"
    }
}

/// By channel, recorded over what the model says, with its standard error.
type Gains = [Option<(f64, f64)>; 4];

/// The gains of every cut against the model with `theta`.
fn gains(data: &CuttingData, theta: &[f64]) -> Option<Vec<Gains>> {
    let model = CuttingModel::new(data, true).ok()?;
    let fits = CuttingProblem { model: &model, data }.fits(theta).ok()?;
    let of_cut = |(cut, fit): (_, &CutFit)| {
        let cut: &CutData = cut;
        std::array::from_fn(|i| {
            let (recorded, model) = (cut.channels[i].as_ref()?, fit.channels[i].as_ref()?);
            let (mut both, mut own) = (0.0, 0.0);
            for ((m, d), std) in model.orders.iter().zip(&recorded.orders).zip(&recorded.order_std) {
                both += 2.0 * (m.conj() * d).re / (std * std);
                own += 2.0 * m.norm_sqr() / (std * std);
            }
            for b in cut.steady.clone() {
                let (m, std) = (model.level[b], recorded.level_std[b]);
                both += m * (recorded.level[b] - model.reference[b]) / (std * std);
                own += m * m / (std * std);
            }
            (own > 0.0).then(|| (both / own, own.sqrt().recip()))
        })
    };
    Some(
        data.cuts
            .iter()
            .map(|c| c.as_ref())
            .zip(&fits)
            .map(of_cut)
            .collect(),
    )
}

/// What one gain would make of a record's: all channels alike, or one channel alone. `usual`: gain and scatter of each channel.
fn pattern(cuts: Vec<usize>, gains: &Gains, usual: &[(f64, f64); 4]) -> Option<OtherGain> {
    struct Known {
        channel: usize,
        gain: f64,
        std: f64,
        deviates: bool,
    }
    let known: Vec<Known> = (0..4)
        .filter_map(|i| {
            let (gain, std) = gains[i]?;
            let (middle, scatter) = usual[i];
            let (gain, std) = (gain / middle, (std / middle).abs());
            let beyond = DEVIATES.max(BEYOND * std).max(BEYOND * scatter);
            (std < CERTAIN && gain.is_finite()).then_some(Known {
                channel: i,
                gain,
                std,
                deviates: (gain - 1.0).abs() > beyond,
            })
        })
        .collect();
    // What one channel does is told although a zero that is a little off, or a leak, shows in another.
    let off = |k: &Known| (k.gain - 1.0).abs();
    let farthest = known.iter().map(off).fold(0.0, f64::max);
    let other: Vec<&Known> = known
        .iter()
        .filter(|k| k.deviates && off(k) > ASIDE * farthest)
        .collect();
    let (channel, factor, is_dead) = match other.as_slice() {
        [] => return None,
        [one] if known.len() > 1 => {
            let is_dead = one.gain.abs() < NONE_OF_IT && one.gain.abs() < BEYOND * one.std;
            (Some(one.channel), one.gain, is_dead)
        }
        all if all.len() == known.len() => {
            let mean = all.iter().map(|k| k.gain).sum::<f64>() / all.len() as f64;
            let is_one = mean != 0.0 && all.iter().all(|k| is_alike(k.gain, mean));
            is_one.then_some((None, mean, false))?
        }
        _ => return None,
    };
    Some(OtherGain {
        cuts,
        channel,
        factor,
        is_dead,
    })
}

fn is_alike(a: f64, b: f64) -> bool {
    (a - b).abs() < ALIKE * a.abs().max(b.abs()).max(NONE_OF_IT)
}

/// Cuts that stand far from the rest, by what is alike of them.
fn single_cuts(data: &CuttingData, robust: &RobustFit) -> Option<Vec<OtherGain>> {
    // With noise alike in all channels none of them alone decides on the phase of a cut.
    let gains = gains(&robust.even, &robust.theta)?;
    let usual: [(f64, f64); 4] = std::array::from_fn(|i| {
        let all: Vec<f64> = gains.iter().filter_map(|g| Some(g[i]?.0)).collect();
        let middle = median(&all);
        let apart: Vec<f64> = all.iter().map(|g| (g / middle - 1.0).abs()).collect();
        (middle, 1.4826 * median(&apart))
    });
    let mut found: Vec<OtherGain> = Vec::new();
    for (i, own) in gains.iter().enumerate() {
        let Some(one) = pattern(vec![i], own, &usual) else {
            continue;
        };
        let same = |f: &&mut OtherGain| {
            f.channel == one.channel && f.is_dead == one.is_dead && is_alike(f.factor, one.factor)
        };
        match found.iter_mut().find(same) {
            Some(same) => same.cuts.push(i),
            None => found.push(one),
        }
    }
    found.retain(|f| 2 * f.cuts.len() < gains.len());
    // Nothing of the force by the noise of the other cuts; but where the noise is as small, it is all there in another unit.
    if found.iter().any(|f| f.is_dead) {
        let own = self::gains(data, &robust.theta)?;
        for one in found.iter_mut().filter(|f| f.is_dead) {
            let seen = |i: &usize| one.channel.and_then(|channel| own[*i][channel]);
            let is_kilo =
                |(gain, std): (f64, f64)| (gain / KILO - 1.0).abs() < DEVIATES && gain > BEYOND * std;
            if one.cuts.iter().all(|i| seen(i).is_some_and(is_kilo)) {
                (one.is_dead, one.factor) = (false, KILO);
            }
        }
    }
    found.sort_by_key(|f| std::cmp::Reverse(f.cuts.len()));
    found.truncate(MOST);
    Some(found)
}

/// Each channel with the other sign in `cuts`. (The phase that is fitted to each cut hides such a channel from its gain.)
fn turned_round(data: &CuttingData, cuts: &[usize]) -> impl Iterator<Item = OtherGain> {
    let recorded = |channel: &usize| cuts.iter().all(|&i| data.cuts[i].channels[*channel].is_some());
    (0..4).filter(recorded).map(|channel| OtherGain {
        cuts: cuts.to_vec(),
        channel: Some(channel),
        factor: -1.0,
        is_dead: false,
    })
}

/// The gain of the cuts `after` against those `before`, and the misfit per value that is left with it.
fn switched(data: &CuttingData, before: &[usize], after: &[usize]) -> Option<(OtherGain, f64)> {
    let base = fit(&data.filtered(|i| before.contains(&i)))?;
    let gains = gains(data, &base.theta)?;
    let of_channel = |i: usize| {
        let all: Vec<(f64, f64)> = after.iter().filter_map(|&c| gains[c][i]).collect();
        let weight: f64 = all.iter().map(|g| g.1.powi(-2)).sum();
        let mean = all.iter().map(|g| g.0 * g.1.powi(-2)).sum::<f64>() / weight;
        (weight > 0.0).then(|| (mean, weight.sqrt().recip()))
    };
    let mut cuts = after.to_vec();
    cuts.sort_unstable();
    let seen = pattern(cuts.clone(), &std::array::from_fn(of_channel), &[(1.0, 0.0); 4]);
    let seen = seen.filter(|found| !found.is_dead);
    let tried = turned_round(data, &cuts).chain(seen).filter_map(|found| {
        let left = fit(&found.undone(data, 1.0))?.reduced_chi2;
        Some((found, left))
    });
    tried.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Gains to be tried: of single cuts, and switched at some time, in the order of making or in that of the list.
/// `far_off`: the cuts that stand farthest from the `robust` fit.
pub(super) fn other_gains(
    data: &CuttingData,
    robust: Option<&RobustFit>,
    far_off: &[usize],
) -> Vec<OtherGain> {
    let mut found = robust
        .and_then(|robust| single_cuts(data, robust))
        .unwrap_or_default();
    for &cut in far_off {
        found.extend(turned_round(data, &[cut]));
    }
    let of_sequence = |cuts: &Vec<usize>| switch(cuts, |before, after| switched(data, before, after));
    for (_, switched) in sequences(data).iter().filter_map(of_sequence) {
        if !found
            .iter()
            .any(|f| f.cuts == switched.cuts && f.channel == switched.channel)
        {
            found.push(switched);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discrepancy::setup::examine_cutting;
    use crate::identify::forces::made_cuts::ten_hard_cuts;

    fn found(data: &CuttingData, case: &str) -> SetupFinding {
        let findings = examine_cutting(data, || None).unwrap().findings;
        findings.into_iter().next().expect(case)
    }

    #[test]
    fn some_records_with_another_gain_are_named_with_it() {
        let made = ten_hard_cuts();
        assert_eq!(examine_cutting(&made, || None).unwrap().findings, []);
        let all: [(&[usize], Option<usize>, f64, &str); 8] = [
            (&[3], None, 0.01, "channel-gain"),
            (&[2, 6], None, 1e-3, "channel-gain"),
            (&[5, 6, 7, 8, 9], None, 0.5, "channel-gain"),
            (&[4, 5, 6, 7, 8, 9], Some(1), -1.0, "channel-sign"),
            (&[6], Some(1), -1.0, "channel-sign"),
            (&[1], Some(0), 1.0 / 4.448_221_615, "channel-gain"),
            (&[0, 7], Some(1), 1.2, "channel-gain"),
            (&[5], Some(1), 1e-3, "channel-gain"),
        ];
        for (cuts, channel, factor, kind) in all {
            let other = OtherGain {
                cuts: cuts.to_vec(),
                channel,
                factor: 1.0 / factor,
                is_dead: false,
            };
            let found = found(&other.undone(&made, 1.0), &format!("{other:?}"));
            let ids: Vec<String> = cuts.iter().map(|&i| made.cuts[i].id.clone()).collect();
            let what = match (channel, cuts) {
                (None, [_]) => String::new(),
                (None, _) => ", all channels".into(),
                (Some(c), _) => format!(", {}", NAMES[c]),
            };
            assert_eq!(
                (found.kind, found.place.as_str()),
                (kind, format!("cut {}{what}", listed(&ids)).as_str()),
                "{found:?}"
            );
            assert!(found.confidence > 0.9, "{found:?}");
            approx::assert_relative_eq!(found.value.unwrap(), factor, max_relative = 1e-2);
        }
    }

    #[test]
    fn a_channel_without_its_force_is_named() {
        let mut made = ten_hard_cuts();
        let cut = Arc::make_mut(&mut made.cuts[4]);
        let channel = cut.channels[1].as_mut().unwrap();
        channel.orders.iter_mut().for_each(|line| *line *= 0.0);
        channel.level.iter_mut().for_each(|level| *level = 3.0);
        let found = found(&made, "dead");
        assert_eq!(
            (found.kind, found.value),
            ("dead-channel", Some(0.0)),
            "{found:?}"
        );
        assert!(found.place.ends_with("Fy") && found.confidence > 0.9, "{found:?}");
    }
}
