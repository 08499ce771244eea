//! Do all teeth cut? From how much of the force comes back once per turn instead of once per tooth.
//!
//! With tooth j cutting a_j times the common share, order k of the forces is A_k P_k where A_k = Σ a_j e^{−2πijk/N} and P_k is
//! order k of a single tooth. The mean square deviation of the a_j from one is then Σ |A_k|² / N² over k = 1 … N − 1
//! (Parseval). A missing tooth leaves its chip to the next one: a = 0, 2, 1, 1, … and 2/N.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::cutting::waveform::{MillingCut, ToothPlace, UnitForces};

/// Part of a missing tooth's unevenness that is worth a notice: runout that lets every tooth cut stays below it.
const TOLD: f64 = 0.7;
/// Offset of the tool's axis with which a tooth just does not cut any more: a_j = 1 + cos(2πj/N).
const RUNOUT_UNTIL_A_TOOTH_IDLES: f64 = 0.5;
/// Tangential and radial coefficients where no mean force tells their ratio.
const USUAL_DIRECTION: (f64, f64) = (1.0, 0.3);
/// Orders on which a single tooth puts less than this part of its strongest one show nothing.
const WEAK: f64 = 0.05;

/// How uneven the teeth cut, as a part of what a missing tooth makes (1); `None` where nothing tells, or where it is less than
/// a tooth that does not cut would make. `orders`: 1..=N of the forces in tool axes x and y, N; `mean`: their means, N. Where
/// `zero_is_known` they give scale and direction of the force; otherwise see [`direction`].
pub(crate) fn idle_tooth(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<f64> {
    let teeth = cut.teeth;
    if teeth < 2 || orders.iter().any(|o| o.len() < teeth) {
        return None;
    }
    let n = teeth as f64;
    let unit = single_tooth(cut).closed_form(teeth);
    // The edge is left out: its waveform differs little, and the scale comes from the mean.
    let (k_t, k_r) = direction(&unit, n, orders, mean, zero_is_known)?;
    let of_tooth = |k: usize| power_of_chip(&unit, k, (k_t, k_r));
    let measured = |k: usize| power_of(orders, k);
    let strongest = (1..=teeth).map(of_tooth).fold(0.0, f64::max);
    // |A_k| = |A_{N−k}|: both orders together.
    let share = |k: usize| -> f64 {
        let pair = of_tooth(k) + of_tooth(teeth - k);
        if pair > WEAK * strongest {
            (measured(k) + measured(teeth - k)) / (pair * n * n)
        } else {
            0.0
        }
    };
    let all: f64 = (1..teeth).map(share).sum();
    let beyond_runout: f64 = (2..teeth - 1).map(share).sum();
    let missing_beyond: f64 = (2..teeth - 1)
        .map(|k| 2.0 - 2.0 * (TAU * k as f64 / n).cos())
        .sum::<f64>()
        / (n * n);
    let missing = 2.0 / n;
    let told = if teeth < 4 {
        all > TOLD * missing
    } else {
        beyond_runout > TOLD * missing_beyond || all > TOLD * missing.max(RUNOUT_UNTIL_A_TOOTH_IDLES)
    };
    (told && all.is_finite()).then_some(all / missing)
}

/// What [`idle_tooth`] finds where one of the teeth cuts all and the others nothing, which is as uneven as teeth can cut: then
/// a = N, 0, 0, …, and the mean square deviation is N − 1 against 2/N.
pub(crate) fn one_tooth_alone(teeth: usize) -> f64 {
    let n = teeth as f64;
    0.5 * n * (n - 1.0)
}

/// The line at twice the tooth passing over that at the tooth passing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TwiceOverOnce {
    pub measured: f64,
    /// The largest that teeth cutting at this immersion make, whatever the metal.
    pub at_most: f64,
}

/// Ratios of amplitudes further above what the immersion allows than this are no error of immersion or helix.
const FAR_ABOVE: f64 = 3.0;
/// Radial over tangential coefficient, and edge over cutting coefficient (mm), of metals.
const RADIAL: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
const EDGE_MM: [f64; 4] = [0.0, 0.02, 0.1, 1.0];

/// Part of the amplitude that the mean forces promise at the tooth passing, below which it is not there.
const LACKING: f64 = 0.3;

/// Is the tooth passing too weak against its double for any cut of this immersion? So it is where the spindle ran at twice the
/// stated speed, or with twice the teeth: the double is the tooth passing then, and what stands at half of it, runout. Then it is the
/// strongest line, too (of a cutter with one tooth that cuts, the turn's is); or, of a tool that runs out much, the tooth passing is
/// weak against the mean force as well. `orders`, N, and their `std`: 1..=2N; `mean` where the zero is known, N.
pub(crate) fn tooth_passing_too_weak(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    mean: Option<[f64; 2]>,
) -> Option<TwiceOverOnce> {
    let teeth = cut.teeth;
    if teeth < 1 || orders.iter().any(|o| o.len() < 2 * teeth) {
        return None;
    }
    let unit = cut.closed_form(2 * teeth);
    let made = |k: usize, radial: f64, edge_mm: f64| -> f64 {
        let axis = |a: usize| {
            let chip = unit[0][a][k] + unit[1][a][k] * radial;
            let edge = unit[3][a][k] + unit[4][a][k] * radial;
            (chip + edge * edge_mm).norm_sqr()
        };
        axis(0) + axis(1)
    };
    let mut at_most = 0.0f64;
    for radial in RADIAL {
        for edge_mm in EDGE_MM {
            let (once, twice) = (made(teeth, radial, edge_mm), made(2 * teeth, radial, edge_mm));
            if !(once > 0.0) {
                return None;
            }
            at_most = at_most.max((twice / once).sqrt());
        }
    }
    let power = |k: usize| power_of(orders, k);
    let noise = |k: usize| noise_of(std, k);
    let (once, twice) = (power(teeth), power(2 * teeth));
    // What noise hides of the tooth passing is granted it.
    let measured = (twice / (once + noise(teeth))).sqrt();
    let is_strongest = (1..2 * teeth).all(|k| power(k) < twice);
    let lacks = mean.is_some_and(|mean| {
        let promised = promised_powers(cut, orders, mean, true);
        promised.is_some_and(|promised| once < LACKING * LACKING * promised[teeth - 1])
    });
    let told = (is_strongest || lacks)
        && twice > CERTAIN * CERTAIN * noise(2 * teeth)
        && measured > FAR_ABOVE * at_most.max(WEAK);
    (told && measured.is_finite()).then_some(TwiceOverOnce { measured, at_most })
}

/// Power of all orders out of step with the parts of a turn, over that of the orders in step, below which the turn consists of such
/// parts: no tool is mounted so well that nothing comes back once per turn while lines between that and the tooth passing do.
const OUT_OF_STEP: f64 = 0.03;
/// Power of the strongest order in step over that of the strongest of all, at least: teeth that merely differ a little stay below it.
const IN_STEP: f64 = 0.02;
/// Where the zero is not known: times the power of any other order that the strongest one must have.
const ABOVE_OTHERS: f64 = 2.0;

/// Into how many alike parts the forces divide the turn, where those are more than one and fewer than the teeth: of a tool with
/// fewer teeth, or at a multiple of the stated speed. An offset of the tool's axis, and a tooth that stands back, put most on
/// the turn itself. `orders` of the forces in tool axes x and y from 1 on, N, and their `std`. Where the zero is known
/// [`idle_tooth`] tells the former.
pub(crate) fn parts_of_turn(
    teeth: usize,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    zero_is_known: bool,
) -> Option<usize> {
    let power = |k: usize| power_of(orders, k);
    let noise = |k: usize| noise_of(std, k);
    let count = orders.iter().map(|o| o.len()).min()?;
    let strongest_of_all = (1..=count).map(power).fold(0.0, f64::max);
    (2..teeth).rev().filter(|m| teeth.is_multiple_of(*m)).find(|m| {
        let in_step = |k: &usize| k.is_multiple_of(*m) && !k.is_multiple_of(teeth);
        let strongest = (1..=count).filter(in_step).map(power).fold(0.0, f64::max);
        let is_certain = (1..=count)
            .filter(in_step)
            .any(|k| power(k) > CERTAIN * CERTAIN * noise(k));
        let inside: f64 = (1..=count).filter(in_step).map(power).sum();
        let outside: f64 = (1..=count).filter(|k| !k.is_multiple_of(*m)).map(power).sum();
        let others = (1..=count).filter(|k| !in_step(k)).map(power).fold(0.0, f64::max);
        let stands_out = !zero_is_known && strongest > ABOVE_OTHERS * others;
        let is_strong = strongest > IN_STEP * strongest_of_all;
        is_certain && is_strong && (outside < OUT_OF_STEP * inside || stands_out)
    })
}

/// Share of the chips of the teeth that are too many which the others take over, as a power, at least: of teeth that merely alternate
/// each cuts, and the line of every so many of them is weaker.
const TAKEN_OVER: f64 = 0.5;
/// Below this part of a tooth's strongest order its line at the tooth passing says nothing of that (a slot has none on even orders).
const HAS_A_LINE: f64 = 1e-3;

/// How many teeth the tool has in truth, where those are fewer than listed (two at least): all that comes back in a turn comes back
/// that many times. Where the listed ones are a multiple of it, every so many of them might cut little; they are too many only where
/// they cut next to nothing. What is asked for is as for [`idle_tooth`] and [`parts_of_turn`].
pub(crate) fn fewer_teeth(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<usize> {
    let listed = cut.teeth;
    let power = |k: usize| power_of(orders, k);
    let count = orders.iter().map(|o| o.len()).min()?;
    (2..listed).rev().find(|teeth| {
        let in_step = |k: &usize| k.is_multiple_of(*teeth);
        let inside: f64 = (1..=count).filter(in_step).map(power).sum();
        let outside: f64 = (1..=count).filter(|k| !in_step(k)).map(power).sum();
        let is_certain = power(*teeth) > CERTAIN * CERTAIN * noise_of(std, *teeth);
        let others_idle = || {
            promised_powers(cut, orders, mean, zero_is_known).is_some_and(|promised| {
                let strongest = promised.iter().copied().fold(0.0, f64::max);
                let own = promised[teeth - 1];
                own > HAS_A_LINE * strongest && power(*teeth) > TAKEN_OVER * own
            })
        };
        let is_clear = is_certain && outside < OUT_OF_STEP * inside;
        is_clear && (!listed.is_multiple_of(*teeth) || others_idle())
    })
}

/// A tooth that stands back by this part of the feed per tooth is worth a notice: from four teeth on, where an offset of the
/// tool's axis is told apart from it, and below, where both look the same.
const STANDS_BACK: f64 = 0.15;
const STANDS_BACK_OR_RUNOUT: f64 = 0.4;
/// Standard errors above nothing.
pub(crate) const CERTAIN: f64 = 6.0;

/// How far one tooth stands back against the others, mm, where that is no offset of the tool's axis (four teeth and more) or may
/// be one (two, three); `None` where that is little, or not certain. `std`: of the orders, N.
///
/// While every tooth cuts, tooth j has the chip c sin φ + ρ_j − ρ_(j−1): at orders that are no multiple of N only the constant
/// part stands, D_k = Σ (ρ_j − ρ_(j−1)) e^(−2πijk/N), on the waveform of a chip of even thickness. An axis offset makes D_1 and
/// D_(N−1) alone; a tooth that stands back by d makes |D_k|² = d² (2 − 2 cos 2πk/N).
pub(crate) fn tooth_back_mm(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<f64> {
    let teeth = cut.teeth;
    let even_chip = power_of_even_chip(cut, orders, std, mean, zero_is_known)?;
    let strongest = even_chip.iter().skip(1).copied().fold(0.0, f64::max);
    let tell = if teeth < 4 { 1..teeth } else { 2..teeth - 1 };
    let (mut power, mut noise, mut of_tooth) = (0.0, 0.0, 0.0);
    for k in tell {
        let gain = even_chip[k];
        if gain <= WEAK * strongest {
            continue;
        }
        power += power_of(orders, k) / gain;
        noise += noise_of(std, k) / gain;
        of_tooth += 2.0 - 2.0 * (TAU * k as f64 / teeth as f64).cos();
    }
    let back = (power / of_tooth).sqrt();
    let part = if teeth < 4 {
        STANDS_BACK_OR_RUNOUT
    } else {
        STANDS_BACK
    };
    let told = back > part * cut.feed_per_tooth_mm && power > CERTAIN * CERTAIN * noise;
    (told && back.is_finite()).then_some(back)
}

/// Root mean square over the teeth of ρ_j − ρ_(j−1), mm: by how much their chips differ from the common one, while every tooth cuts (see
/// [`tooth_back_mm`]); by Parseval's theorem Σ |D_k|² = N Σ (ρ_j − ρ_(j−1))². `None` where that does not stand above the noise. What
/// turns with the spindle in the air as well (`air_power` of orders from 1 on, N²) is no tooth.
pub(crate) fn uneven_chip_mm(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    (mean, zero_is_known): ([f64; 2], bool),
    air_power: &[f64],
) -> Option<f64> {
    let teeth = cut.teeth;
    let even_chip = power_of_even_chip(cut, orders, std, mean, zero_is_known)?;
    let strongest = even_chip.iter().skip(1).copied().fold(0.0, f64::max);
    let (mut sum, mut noise) = (0.0, 0.0);
    for k in 1..teeth {
        // |D_k| = |D_(N−k)|: both orders together.
        let gain = even_chip[k] + even_chip[teeth - k];
        if gain <= WEAK * strongest {
            continue;
        }
        let of = |k: usize| power_of(orders, k) - air_power.get(k - 1).copied().unwrap_or(0.0);
        sum += (of(k) + of(teeth - k)).max(0.0) / gain;
        noise += (noise_of(std, k) + noise_of(std, teeth - k)) / gain;
    }
    let uneven = (sum - noise).max(0.0).sqrt() / teeth as f64;
    (sum > CERTAIN * CERTAIN * noise && uneven.is_finite()).then_some(uneven)
}

/// Of what comes back once per turn and not once per tooth, N (root of the sum of the squares of the amplitudes).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AgainstList {
    pub measured: f64,
    pub listed: f64,
    /// The same list read the other way round agrees.
    pub is_reversed: bool,
}

/// Parts of the power of both by which they differ: another list, not another metal or edge.
const OTHER_TEETH: f64 = 0.5;
/// Power against that by the list below which teeth are listed that cut nothing, and cut: an offset of the axis adds as a rule.
const LESS: f64 = 0.4;
/// Amplitude against the strongest line below which the teeth differ too little to speak of.
const LITTLE: f64 = 0.15;
/// Part of the power of the difference that is left by a list read the other way round where that is how the teeth follow one another.
const REVERSED: f64 = 0.1;
/// Turns of the tool that are tried for each of its orders.
const TURNS_TRIED: usize = 16;

/// Powers over some orders of the turn, N².
#[derive(Default)]
struct Powers {
    measured: f64,
    by_list: f64,
    difference: f64,
    noise: f64,
}

/// Do the teeth cut otherwise than the tool's list of pitches and radii has it? `orders`: from 1 on, of the forces in tool axes x and y,
/// N, and their `std`. What an offset of the tool's axis makes is left out where it can be told apart (four teeth and more).
pub(crate) fn other_than_listed(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<AgainstList> {
    let teeth = cut.teeth;
    let count = orders.iter().map(|o| o.len()).min()?;
    if cut.places.is_empty() || teeth < 2 || count < teeth || std.iter().any(|s| s.len() < count) {
        return None;
    }
    let single = single_tooth(cut).closed_form(teeth);
    let coefficients = direction(&single, teeth as f64, orders, mean, zero_is_known)?;
    let once_per_turn = |k: usize| !k.is_multiple_of(teeth);
    let beyond_runout = |k: usize| match k % teeth {
        0 => false,
        rest => teeth < 4 || (rest != 1 && rest != teeth - 1),
    };
    let strongest = (1..=count).map(|k| power_of(orders, k)).fold(0.0, f64::max);
    let counts =
        |p: &Powers| p.difference > LITTLE * LITTLE * strongest && p.difference > CERTAIN * CERTAIN * p.noise;
    let [all, beyond] = powers_by_list(cut, coefficients, orders, std, [&once_per_turn, &beyond_runout]);
    let other = beyond.difference > OTHER_TEETH * (beyond.measured + beyond.by_list) && counts(&beyond);
    let less = all.measured < LESS * all.by_list && counts(&all);
    let is_reversed = counts(&all) && {
        let mut reversed = cut.clone();
        reversed.places = ToothPlace::reversed(&cut.places);
        let [of_reversed] = powers_by_list(&reversed, coefficients, orders, std, [&once_per_turn]);
        of_reversed.difference < REVERSED * all.difference
    };
    (other || less || is_reversed).then_some(AgainstList {
        measured: all.measured.sqrt(),
        listed: all.by_list.sqrt(),
        is_reversed,
    })
}

/// What `cut`'s list of teeth and two `coefficients` (tangential, radial) make of each of the groups of orders.
fn powers_by_list<const N: usize>(
    cut: &MillingCut,
    (k_t, k_r): (f64, f64),
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    groups: [&dyn Fn(usize) -> bool; N],
) -> [Powers; N] {
    let count = orders[0].len().min(orders[1].len());
    let unit = cut.linear(count);
    let listed = |axis: usize, k: usize| unit[0][axis][k] * k_t + unit[1][axis][k] * k_r;
    let both = || (0..2).flat_map(|axis| (1..=count).map(move |k| (axis, k)));
    // The tool may stand anywhere when the record begins.
    let turned = |turn: f64, k: usize| Complex64::from_polar(1.0, -turn * k as f64);
    let tried = TURNS_TRIED * count;
    let alike = |turn: f64| -> f64 {
        let products =
            both().map(|(axis, k)| (listed(axis, k) * turned(turn, k)).conj() * orders[axis][k - 1]);
        products.sum::<Complex64>().re
    };
    let turn = (0..tried)
        .map(|step| TAU * step as f64 / tried as f64)
        .max_by(|a, b| alike(*a).total_cmp(&alike(*b)))
        .unwrap_or(0.0);
    groups.map(|which| {
        let mut powers = Powers::default();
        for (axis, k) in both().filter(|(_, k)| which(*k)) {
            let (own, by_list) = (orders[axis][k - 1], listed(axis, k) * turned(turn, k));
            powers.measured += own.norm_sqr();
            powers.by_list += by_list.norm_sqr();
            powers.difference += (own - by_list).norm_sqr();
            powers.noise += std[axis][k - 1].powi(2);
        }
        powers
    })
}

/// Of order `k` of the forces in tool axes x and y, N².
fn power_of(orders: [&[Complex64]; 2], k: usize) -> f64 {
    orders.iter().map(|o| o[k - 1].norm_sqr()).sum()
}

/// Variance of that, N².
fn noise_of(std: [&[f64]; 2], k: usize) -> f64 {
    std.iter().map(|s| s[k - 1].powi(2)).sum()
}

/// Powers of orders 0 to the number of teeth of a chip of 1 mm all along its way, cut by one tooth with the force that the `mean` (N) tells,
/// N². `None` for a single tooth, or where an order is missing.
fn power_of_even_chip(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    std: [&[f64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<Vec<f64>> {
    let teeth = cut.teeth;
    if teeth < 2 || orders.iter().any(|o| o.len() < teeth) || std.iter().any(|s| s.len() < teeth) {
        return None;
    }
    let unit = single_tooth(cut).closed_form(teeth);
    let (k_t, k_r) = direction(&unit, teeth as f64, orders, mean, zero_is_known)?;
    let of_axis = |axis: usize, k: usize| (unit[3][axis][k] * k_t + unit[4][axis][k] * k_r).norm_sqr();
    Some((0..=teeth).map(|k| of_axis(0, k) + of_axis(1, k)).collect())
}

/// The same of a chip that is cut with so much tangential and radial force.
fn power_of_chip(unit: &UnitForces, k: usize, (k_t, k_r): (f64, f64)) -> f64 {
    let axis = |axis: usize| (unit[0][axis][k] * k_t + unit[1][axis][k] * k_r).norm_sqr();
    axis(0) + axis(1)
}

fn single_tooth(cut: &MillingCut) -> MillingCut {
    MillingCut {
        teeth: 1,
        places: Vec::new(),
        ..cut.clone()
    }
}

/// Powers of orders 1 to the number of teeth, N², as if all teeth added up there: those of one tooth with the force that [`direction`]
/// has, times their number squared.
fn promised_powers(
    cut: &MillingCut,
    orders: [&[Complex64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<Vec<f64>> {
    let n = cut.teeth as f64;
    let single = single_tooth(cut).closed_form(cut.teeth);
    let direction = direction(&single, n, orders, mean, zero_is_known)?;
    let powers = (1..=cut.teeth).map(|k| n * n * power_of_chip(&single, k, direction));
    Some(powers.collect())
}

/// Tangential and radial force for a chip of 1 mm and 1 mm of depth, as the means have it; with an unknown zero as the
/// tooth-passing order and a usual direction have it. Where teeth make no such order (four of them in a slot), the means are believed
/// all the same if they are larger than all that changes within a turn: a zero so far off would be seen.
fn direction(
    unit: &UnitForces,
    teeth: f64,
    orders: [&[Complex64]; 2],
    mean: [f64; 2],
    zero_is_known: bool,
) -> Option<(f64, f64)> {
    let of_tooth = |k: usize| power_of_chip(unit, k, USUAL_DIRECTION);
    let measured = |k: usize| power_of(orders, k);
    let at = teeth as usize;
    let strongest = (1..=at).map(of_tooth).fold(0.0, f64::max);
    let is_weak = of_tooth(at) <= WEAK * strongest;
    if zero_is_known || is_weak {
        let largest = (1..=at).map(measured).fold(0.0, f64::max);
        if !zero_is_known && mean.iter().map(|m| m * m).sum::<f64>() < largest {
            return None;
        }
        let at_zero = |k: usize, axis: usize| unit[k][axis][0].re;
        let (a, b, c, d) = (at_zero(0, 0), at_zero(1, 0), at_zero(0, 1), at_zero(1, 1));
        let determinant = teeth * (a * d - b * c);
        let (k_t, k_r) = (
            (d * mean[0] - b * mean[1]) / determinant,
            (a * mean[1] - c * mean[0]) / determinant,
        );
        return (k_t.is_finite() && k_r.is_finite()).then_some((k_t, k_r));
    }
    let scale = (measured(at) / (of_tooth(at) * teeth * teeth)).sqrt();
    let (k_t, k_r) = USUAL_DIRECTION;
    scale.is_finite().then_some((scale * k_t, scale * k_r))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::made_tools::milling_cut as cut;
    use crate::cutting::waveform::{TeethSlopes, ToothPlace};

    /// Three teeth with radii of their own, all cutting: the root mean square of the differences comes back from the orders, less what
    /// the air has of them.
    #[test]
    fn differences_of_chips_come_back_from_the_orders() {
        let mut own = cut(3, 40.0, 140.0);
        own.places = own.places_or_even();
        let radii = [0.0, 0.012, -0.004];
        own.places
            .iter_mut()
            .zip(radii)
            .for_each(|(p, r)| p.radius_mm = r);
        let squares: f64 = (0..3).map(|j| (radii[(j + 1) % 3] - radii[j]).powi(2)).sum();
        let unit = own.linear(3);
        let force = |axis: usize, k: usize| unit[0][axis][k] * 1500.0 + unit[1][axis][k] * 450.0;
        let orders = [0, 1].map(|axis| (1..=3).map(|k| force(axis, k)).collect::<Vec<_>>());
        let mean = [force(0, 0).re, force(1, 0).re];
        let found = |noise: f64, air: &[f64]| {
            let std = vec![noise; 3];
            let orders = [orders[0].as_slice(), orders[1].as_slice()];
            uneven_chip_mm(&cut(3, 40.0, 140.0), orders, [&std, &std], (mean, true), air)
        };
        let chip = (squares / 3.0).sqrt();
        approx::assert_relative_eq!(found(1e-6, &[]).unwrap(), chip, max_relative = 0.02);
        // Half of the power is unbalance.
        let half: Vec<f64> = (0..3)
            .map(|k| 0.5 * (orders[0][k].norm_sqr() + orders[1][k].norm_sqr()))
            .collect();
        approx::assert_relative_eq!(
            found(1e-6, &half).unwrap(),
            chip * 0.5f64.sqrt(),
            max_relative = 0.02
        );
        assert_eq!(found(1e3, &[]), None);
    }

    /// A tool of six teeth, or of two, is known whatever the list says, as long as it says more; teeth that alternate, are missing or stand
    /// unevenly are not too many.
    #[test]
    fn a_tool_with_fewer_teeth_than_listed_is_known() {
        let found_in = |[start_deg, exit_deg]: [f64; 2], teeth: usize, radii: &[f64], listed: usize| {
            let mut own = cut(teeth, start_deg, exit_deg);
            own.places = own.places_or_even();
            own.places
                .iter_mut()
                .zip(radii.iter().cycle())
                .for_each(|(place, radius)| place.radius_mm = *radius);
            let highest = 2 * listed;
            let unit = own.linear(highest);
            let force = |axis: usize, k: usize| {
                (unit[0][axis][k] + unit[1][axis][k] * 0.3) * 1500.0
                    + (unit[3][axis][k] + unit[4][axis][k]) * 20.0
            };
            let orders = [0, 1].map(|axis| (1..=highest).map(|k| force(axis, k)).collect::<Vec<_>>());
            let mean = [force(0, 0).re, force(1, 0).re];
            let std = vec![0.5; highest];
            let orders = [orders[0].as_slice(), orders[1].as_slice()];
            fewer_teeth(
                &cut(listed, start_deg, exit_deg),
                orders,
                [&std, &std],
                mean,
                true,
            )
        };
        let found = |teeth, radii: &[f64], listed| found_in([20.0, 130.0], teeth, radii, listed);
        for listed in [7, 8, 9, 10, 12, 18] {
            assert_eq!(found(6, &[0.0], listed), Some(6), "{listed}");
        }
        assert_eq!(found(6, &[0.0, 0.002, -0.002], 7), Some(6));
        assert_eq!(found(2, &[0.0], 3), Some(2));
        assert_eq!(found(2, &[0.0], 4), Some(2));
        assert_eq!(found(6, &[0.0], 6), None);
        // Every second tooth is set back, by less than a third of the feed per tooth.
        for back_mm in [0.01, 0.02, 0.03] {
            assert_eq!(found(12, &[0.0, -back_mm], 12), None, "{back_mm}");
        }
        // In a slot no line of six teeth tells what every second of twelve does; seven are too many all the same.
        assert_eq!(found_in([0.0, 180.0], 12, &[0.0, -0.03], 12), None);
        assert_eq!(found_in([0.0, 180.0], 5, &[0.0], 7), Some(5));
        // One of three, and two of four beside each other, do not cut.
        assert_eq!(found(3, &[0.0, 0.0, -2.0], 3), None);
        assert_eq!(found(4, &[0.0, 0.0, -2.0, -2.0], 4), None);
        // Of one alone nothing is said: it may be the last of a tool that lost the others.
        assert_eq!(found(1, &[0.0], 2), None);
    }

    /// One tooth of four missing: told by the right list, by one with its neighbour missing as well, and where none is missing.
    #[test]
    fn teeth_that_cut_otherwise_than_the_list_has_it_are_told() {
        let with = |radii: [f64; 4]| {
            let mut own = cut(4, 20.0, 150.0);
            own.places = own.places_or_even();
            own.places
                .iter_mut()
                .zip(radii)
                .for_each(|(p, r)| p.radius_mm = r);
            own
        };
        let [none, one, two] = [[0.0; 4], [0.0, -2.0, 0.0, 0.0], [0.0, -2.0, -2.0, 0.0]];
        for (truth, list, told) in [
            (one, one, false),
            (one, two, true),
            (none, one, true),
            (two, two, false),
            // An offset of the axis besides is no fault of the list.
            ([0.01, -2.0, -0.01, 0.0], one, false),
            // Three radii, counted the way the tool turns and the other way; told apart by their first order alone.
            ([0.0, 0.03, 0.02, -0.02], [0.0, 0.03, 0.02, -0.02], false),
            ([0.0, -0.02, 0.02, 0.03], [0.0, 0.03, 0.02, -0.02], true),
        ] {
            let unit = with(truth).own_teeth(8, None, TeethSlopes::None).unit;
            // A tool that stands 50° on, 1900 and 700 N/mm² and edges of 20 and 25 N/mm.
            let of = |axis: usize| -> Vec<Complex64> {
                let sum = |k: usize| {
                    unit[0][axis][k] * 1900.0
                        + unit[1][axis][k] * 700.0
                        + unit[3][axis][k] * 20.0
                        + unit[4][axis][k] * 25.0
                };
                let turned = |k: usize| sum(k) * Complex64::from_polar(1.0, -0.87 * k as f64);
                (0..=8).map(turned).collect()
            };
            let (x, y) = (of(0), of(1));
            let std = [0.1; 8];
            let found = other_than_listed(
                &with(list),
                [&x[1..], &y[1..]],
                [&std, &std],
                [x[0].re, y[0].re],
                true,
            );
            assert_eq!(found.is_some(), told, "{truth:?} {list:?} {found:?}");
        }
    }

    /// Two teeth told as four, at the right speed and at half of it, with runout; and four teeth with runout or one set back.
    #[test]
    fn a_turn_of_fewer_parts_than_teeth_is_told() {
        let parts = |power: [f64; 8], zero_is_known: bool| {
            let orders: Vec<Complex64> = power.iter().map(|p| Complex64::new(p.sqrt(), 0.0)).collect();
            let nothing = vec![Complex64::ZERO; 8];
            let std = vec![0.5; 8];
            parts_of_turn(4, [&orders, &nothing], [&std, &std], zero_is_known)
        };
        let two_teeth = [3000.0, 21000.0, 140.0, 1900.0, 30.0, 1800.0, 40.0, 3300.0];
        assert_eq!(parts(two_teeth, false), Some(2));
        assert_eq!(parts(two_teeth, true), None);
        let half_the_speed = [0.3, 3000.0, 0.2, 21000.0, 0.1, 140.0, 0.2, 1900.0];
        assert_eq!(parts(half_the_speed, false), Some(2));
        assert_eq!(parts(half_the_speed, true), Some(2));
        let runout = [3000.0, 40.0, 300.0, 900.0, 10.0, 4.0, 10.0, 200.0];
        assert_eq!(parts(runout, false), None);
        let set_back = [2000.0, 700.0, 200.0, 900.0, 10.0, 40.0, 10.0, 200.0];
        assert_eq!(parts(set_back, false), None);
        let even = [0.3, 0.2, 0.3, 900.0, 0.2, 0.1, 0.2, 200.0];
        assert_eq!(parts(even, false), None);
        // Certain, and a hundredth of the tooth passing: every second tooth a little shorter.
        let alternating = [0.0, 15.0, 0.0, 900.0, 0.0, 0.1, 0.0, 200.0];
        assert_eq!(parts(alternating, true), None);
        // Of a prime number of teeth there are no parts.
        let orders = vec![Complex64::ONE; 6];
        assert_eq!(
            parts_of_turn(3, [&orders, &orders], [&[0.01; 6], &[0.01; 6]], false),
            None
        );
    }

    /// Forces of teeth that cut `share` each, edge forces where they cut at all; `zero`: an offset of the channels.
    fn told(cut: &MillingCut, share: &[f64], zero: Option<f64>) -> Option<f64> {
        let single = MillingCut {
            teeth: 1,
            ..cut.clone()
        };
        let unit = single.closed_form(cut.teeth);
        let coefficient = [900.0, 350.0, 0.0, 15.0, 18.0, 0.0];
        let order = |axis: usize, k: usize| -> Complex64 {
            let turn = |j: usize| {
                Complex64::from_polar(1.0, -TAU * (j * k) as f64 / cut.teeth as f64 + 0.4 * k as f64)
            };
            let tooth = |(j, s): (usize, &f64)| {
                let engaged = if *s > 0.0 { 1.0 } else { 0.0 };
                let force: Complex64 = (0..6)
                    .map(|c| unit[c][axis][k] * coefficient[c] * if c < 3 { *s } else { engaged })
                    .sum();
                force * turn(j)
            };
            share.iter().enumerate().map(tooth).sum()
        };
        let orders: [Vec<Complex64>; 2] =
            [0, 1].map(|axis| (1..=cut.teeth).map(|k| order(axis, k)).collect());
        let mean = [0, 1].map(|axis| order(axis, 0).re + zero.unwrap_or(0.0));
        idle_tooth(cut, [&orders[0], &orders[1]], mean, zero.is_none())
    }

    #[test]
    fn a_missing_tooth_is_told_and_runout_that_leaves_all_cutting_is_not() {
        for (start, exit) in [(0.0, 180.0), (0.0, 70.0), (120.0, 180.0), (60.0, 120.0)] {
            for teeth in 2..=6 {
                let cut = cut(teeth, start, exit);
                let mut share = vec![1.0; teeth];
                assert_eq!(told(&cut, &share, None), None);
                for missing in 0..teeth {
                    let mut share = vec![1.0; teeth];
                    share[missing] = 0.0;
                    share[(missing + 1) % teeth] = 2.0;
                    let found = told(&cut, &share, None)
                        .unwrap_or_else(|| panic!("{start}–{exit}: {missing} of {teeth}"));
                    assert!((0.6..1.5).contains(&found), "{found}");
                }
                for (j, s) in share.iter_mut().enumerate() {
                    *s = 1.0 + 0.6 * (TAU * j as f64 / teeth as f64 + 0.3).cos();
                }
                assert_eq!(told(&cut, &share, None), None, "{start}–{exit}: {teeth}");
            }
        }
    }

    /// Six teeth of a tool off its axis by three quarters of what makes one idle: all still cut.
    #[test]
    fn a_large_runout_of_many_teeth_is_no_idle_tooth() {
        let share: Vec<f64> = (0..6)
            .map(|j| 1.0 + 0.75 * (TAU * f64::from(j) / 6.0).cos())
            .collect();
        assert_eq!(told(&cut(6, 0.0, 180.0), &share, None), None);
    }

    /// Four teeth in a slot put next to nothing on their own passing: the means tell, unless an amplifier without direct current
    /// took them away.
    #[test]
    fn an_unknown_zero_hides_it_in_a_slot_only_where_the_means_are_gone() {
        let cut = cut(4, 0.0, 180.0);
        assert!(told(&cut, &[0.0, 2.0, 1.0, 1.0], Some(20.0)).is_some());
        assert_eq!(told(&cut, &[1.0, 1.1, 1.0, 0.9], Some(20.0)), None);
        let (zeros, large) = ([0.0; 2], vec![Complex64::new(30.0, 0.0); 4]);
        assert_eq!(idle_tooth(&cut, [&large, &large], zeros, false), None);
    }

    #[test]
    fn an_unknown_zero_does_not_hide_it() {
        let cut = cut(3, 120.0, 180.0);
        assert!(told(&cut, &[0.0, 2.0, 1.0], Some(12.0)).is_some());
        assert_eq!(told(&cut, &[1.0, 1.1, 0.9], Some(12.0)), None);
    }

    /// What is found for radii of the teeth, by the closed form of such teeth; noise of `std` N on every order.
    fn back(cut: &MillingCut, radii: &[f64], std: f64) -> Option<f64> {
        let teeth = cut.teeth;
        let place = |(j, r): (usize, &f64)| ToothPlace {
            ahead_rad: TAU * j as f64 / teeth as f64,
            lag_rad: cut.lag_rad,
            radius_mm: *r,
        };
        let own = MillingCut {
            places: radii.iter().enumerate().map(place).collect(),
            ..cut.clone()
        };
        let unit = own.own_teeth(teeth, None, TeethSlopes::None).unit;
        let coefficient = [900.0, 350.0, 0.0, 15.0, 18.0, 0.0];
        let order = |axis: usize, k: usize| -> Complex64 {
            let force: Complex64 = (0..6).map(|c| unit[c][axis][k] * coefficient[c]).sum();
            force * Complex64::from_polar(1.0, 0.7 * k as f64)
        };
        let orders: [Vec<Complex64>; 2] = [0, 1].map(|axis| (1..=teeth).map(|k| order(axis, k)).collect());
        let mean = [0, 1].map(|axis| order(axis, 0).re);
        let std = vec![std; teeth];
        tooth_back_mm(cut, [&orders[0], &orders[1]], [&std, &std], mean, true)
    }

    #[test]
    fn a_tooth_that_stands_back_is_told_at_every_feed_and_an_axis_offset_is_not() {
        for (start, exit) in [(0.0, 180.0), (0.0, 90.0), (110.0, 180.0)] {
            for teeth in 4..=6 {
                let cut = cut(teeth, start, exit);
                for d in [0.03, 0.05, 0.09] {
                    let mut radii = vec![0.0; teeth];
                    radii[1] = -d;
                    let found =
                        back(&cut, &radii, 0.01).unwrap_or_else(|| panic!("{start}–{exit} {teeth} {d}"));
                    assert!(
                        (0.5 * d..1.4 * d).contains(&found),
                        "{start}–{exit} {teeth}: {d} found as {found}"
                    );
                    assert_eq!(back(&cut, &radii, 100.0), None);
                }
                let offset: Vec<f64> = (0..teeth)
                    .map(|j| 0.01 * (TAU * j as f64 / teeth as f64 + 0.5).cos())
                    .collect();
                assert_eq!(back(&cut, &offset, 0.01), None, "{start}–{exit} {teeth}");
            }
        }
        let two = cut(2, 0.0, 180.0);
        assert!(back(&two, &[0.0, -0.06], 0.01).is_some_and(|d| (0.03..0.09).contains(&d)));
        assert_eq!(back(&two, &[0.0, -0.02], 0.01), None);
        let three = cut(3, 0.0, 180.0);
        assert!(back(&three, &[0.0, -0.06, 0.0], 0.01).is_some());
    }

    /// Orders 1..=2N that even teeth leave when the speed is taken for `stated` times the true one, runout added as a part of the
    /// tooth passing; and what is told of them. `stated`: 1 or ½.
    fn too_weak(cut: &MillingCut, half_stated: bool, runout: f64) -> Option<TwiceOverOnce> {
        let teeth = cut.teeth;
        let unit = cut.closed_form(2 * teeth);
        let coefficient = [900.0, 350.0, 0.0, 15.0, 18.0, 0.0];
        let force = |axis: usize, k: usize| -> Complex64 {
            let even: Complex64 = (0..6).map(|c| unit[c][axis][k] * coefficient[c]).sum();
            let passing: Complex64 = (0..6).map(|c| unit[c][axis][teeth] * coefficient[c]).sum();
            // An axis offset makes lines once per turn and beside the tooth passing.
            let beside = [1, teeth - 1, teeth + 1].contains(&k);
            even + if beside { passing * runout } else { Complex64::ZERO }
        };
        let orders: [Vec<Complex64>; 2] = [0, 1].map(|axis| {
            let of = |k: usize| match half_stated {
                false => force(axis, k),
                true if k.is_multiple_of(2) => force(axis, k / 2),
                true => Complex64::ZERO,
            };
            (1..=2 * teeth).map(of).collect()
        });
        let std = vec![0.01; 2 * teeth];
        tooth_passing_too_weak(cut, [&orders[0], &orders[1]], [&std, &std], None)
    }

    /// Four teeth told as two, and two as one, of a tool that runs out so much that the turn's line is the strongest.
    #[test]
    fn half_the_teeth_are_told_whatever_the_tool_runs_out() {
        let coefficient = [900.0, 350.0, 0.0, 15.0, 18.0, 0.0];
        for (start, exit) in [(0.0, 180.0), (0.0, 70.0), (150.0, 180.0)] {
            for stated in [1, 2, 3] {
                let true_cut = cut(2 * stated, start, exit);
                let unit = true_cut.closed_form(2 * stated);
                let force = |axis: usize, k: usize| -> Complex64 {
                    let passing: Complex64 = (0..6).map(|c| unit[c][axis][k] * coefficient[c]).sum();
                    // An axis offset makes the turn's line and those beside the tooth passing.
                    let turn = [1, 2 * stated - 1].contains(&k) && stated > 1;
                    passing + if turn { 300.0.into() } else { Complex64::ZERO }
                };
                let orders: [Vec<Complex64>; 2] =
                    [0, 1].map(|axis| (1..=2 * stated).map(|k| force(axis, k)).collect());
                let std = vec![0.01; 2 * stated];
                let mean = [0, 1].map(|axis| force(axis, 0).re);
                let told = |cut: &MillingCut, mean: Option<[f64; 2]>| {
                    tooth_passing_too_weak(cut, [&orders[0], &orders[1]], [&std, &std], mean).is_some()
                };
                // What is stated has half the teeth at twice the feed.
                let stated_cut = MillingCut {
                    teeth: stated,
                    feed_per_tooth_mm: 0.2,
                    ..true_cut.clone()
                };
                assert!(told(&stated_cut, Some(mean)), "{stated}: {start}–{exit}");
                assert_eq!(told(&stated_cut, None), stated == 1, "{stated}: {start}–{exit}");
            }
        }
    }

    #[test]
    fn half_the_true_speed_is_told_and_the_true_one_never() {
        for (start, exit) in [(0.0, 180.0), (0.0, 70.0), (150.0, 180.0), (60.0, 120.0)] {
            for teeth in [2, 3, 5] {
                for runout in [0.0, 0.2] {
                    let cut = cut(teeth, start, exit);
                    let place = format!("{start}–{exit}: {teeth} teeth, runout {runout}");
                    assert_eq!(too_weak(&cut, false, runout), None, "{place}");
                    let found = too_weak(&cut, true, runout).unwrap_or_else(|| panic!("{place}"));
                    assert!(found.measured > 3.0 * found.at_most, "{place}: {found:?}");
                }
            }
        }
    }

    #[test]
    fn one_tooth_alone_is_the_most_uneven_cutter() {
        for teeth in 2..=6 {
            let cut = cut(teeth, 30.0, 110.0);
            let mut share = vec![0.0; teeth];
            share[0] = teeth as f64;
            let found = told(&cut, &share, None).unwrap();
            // The edge force, which is left out of the reckoning, comes once a turn instead of N times.
            let most = one_tooth_alone(teeth);
            assert!(
                (0.6 * most..1.4 * most).contains(&found),
                "{teeth}: {found} of {most}"
            );
        }
    }
}
