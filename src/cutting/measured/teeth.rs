//! Do all teeth cut? From how much of the force comes back once per turn instead of once per tooth.
//!
//! With tooth j cutting a_j times the common share, order k of the forces is A_k P_k where A_k = Σ a_j e^{−2πijk/N} and P_k is
//! order k of a single tooth. The mean square deviation of the a_j from one is then Σ |A_k|² / N² over k = 1 … N − 1
//! (Parseval). A missing tooth leaves its chip to the next one: a = 0, 2, 1, 1, … and 2/N.

use std::f64::consts::TAU;

use num_complex::Complex64;

use crate::cutting::waveform::MillingCut;

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
/// `zero_is_known` they give scale and direction of the force; otherwise the tooth-passing order gives the scale.
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
    let single = MillingCut {
        teeth: 1,
        places: Vec::new(),
        ..cut.clone()
    };
    let unit = single.closed_form(teeth);
    // The edge is left out: its waveform differs little, and the scale comes from the mean.
    let at_zero = |k: usize, axis: usize| unit[k][axis][0].re;
    let (a, b, c, d) = (at_zero(0, 0), at_zero(1, 0), at_zero(0, 1), at_zero(1, 1));
    let determinant = a * d - b * c;
    let (k_t, k_r) = if zero_is_known {
        let turned = (d * mean[0] - b * mean[1], a * mean[1] - c * mean[0]);
        (turned.0 / (n * determinant), turned.1 / (n * determinant))
    } else {
        USUAL_DIRECTION
    };
    let of_tooth = |k: usize| -> f64 {
        let axis = |axis: usize| (unit[0][axis][k] * k_t + unit[1][axis][k] * k_r).norm_sqr();
        axis(0) + axis(1)
    };
    let measured = |k: usize| orders[0][k - 1].norm_sqr() + orders[1][k - 1].norm_sqr();
    let strongest = (1..=teeth).map(of_tooth).fold(0.0, f64::max);
    let scale = if zero_is_known {
        1.0
    } else if of_tooth(teeth) > WEAK * strongest {
        measured(teeth) / (n * n * of_tooth(teeth))
    } else {
        return None;
    };
    // |A_k| = |A_{N−k}|: both orders together.
    let share = |k: usize| -> f64 {
        let pair = of_tooth(k) + of_tooth(teeth - k);
        if pair > WEAK * strongest {
            (measured(k) + measured(teeth - k)) / (pair * scale * n * n)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Immersion;

    fn cut(teeth: usize, start_deg: f64, exit_deg: f64) -> MillingCut {
        MillingCut {
            teeth,
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 2.0,
            immersion: Immersion {
                start_rad: start_deg.to_radians(),
                exit_rad: exit_deg.to_radians(),
            },
            lag_rad: 0.15,
            shape: None,
            places: Vec::new(),
        }
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

    #[test]
    fn an_unknown_zero_does_not_hide_it() {
        let cut = cut(3, 120.0, 180.0);
        assert!(told(&cut, &[0.0, 2.0, 1.0], Some(12.0)).is_some());
        assert_eq!(told(&cut, &[1.0, 1.1, 0.9], Some(12.0)), None);
    }
}
