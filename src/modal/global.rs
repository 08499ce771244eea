//! Modes of a set of FRFs (one structure in one state), from the modes of each.
//!
//! Estimates are clustered in frequency, at most one from each FRF in a cluster, nearest pairs first.
//! A cluster's frequency and damping are means weighted with the inverse variance, outliers left out; the
//! standard deviation is the estimates' own or their scatter, whichever is larger (Birge 1932).

use num_complex::Complex64;

use super::curve::Curve;
use super::joint_fit::{self, CurveSet};
use super::local_fit::Pole;
use super::{FrfModes, GlobalMode, GlobalModes, ModeEstimate, Settings};
use crate::Result;

/// Clusters join while their centres are no further apart than this part of the half-power half-width …
const JOIN_WIDTHS: f64 = 0.35;
/// … or this many standard deviations of their difference, but never further than `MOST_WIDTHS`.
const JOIN_SIGMA: f64 = 3.0;
const MOST_WIDTHS: f64 = 1.0;
/// Estimates further than this from the centre, in robust standard deviations, are outliers.
const OUTLIER_SIGMA: f64 = 4.0;
/// In sets of at least this many FRFs a mode seen by one of them alone is not reported.
const SET: usize = 4;

#[derive(Clone, Copy)]
struct Member {
    frf: usize,
    frequency_hz: f64,
    damping_ratio: f64,
    frequency_std_hz: f64,
    damping_std: f64,
}

impl Member {
    fn new(frf: usize, e: &ModeEstimate) -> Member {
        let width = e.damping_ratio * e.frequency_hz;
        Member {
            frf,
            frequency_hz: e.frequency_hz,
            damping_ratio: e.damping_ratio,
            // Not known is not exact.
            frequency_std_hz: e.frequency_std_hz.unwrap_or(0.3 * width),
            damping_std: e.damping_std.unwrap_or(0.5 * e.damping_ratio),
        }
    }
}

/// One FRF of a set, with what was found in it.
#[derive(Clone, Copy)]
pub struct SetMember<'a> {
    /// Ascending, Hz.
    pub frequency_hz: &'a [f64],
    /// As given to [`super::analyse_frf`], m/N.
    pub receptance_m_per_n: &'a [Complex64],
    pub modes: &'a FrfModes,
}

/// Combines the modes of several FRFs of the same structure in the same posture: clusters of the single
/// FRFs' modes, then one fit of common poles to all FRFs. FRFs that are not on common lines cannot be fitted
/// together; then the clusters' weighted means stand, and a warning says so.
///
/// # Errors
/// As [`super::analyse_frf`].
pub fn global(frfs: &[SetMember], settings: &Settings) -> Result<GlobalModes> {
    let members = frfs.iter().enumerate().flat_map(|(frf, found)| {
        found
            .modes
            .modes
            .iter()
            .map(move |mode| Member::new(frf, mode.best()))
    });
    let mut clustered: Vec<GlobalMode> = clusters(members.collect())
        .iter()
        .map(|cluster| combine(cluster))
        .collect();
    clustered.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut result = GlobalModes::default();
    if frfs.len() < 2 {
        result.modes = clustered;
        return Ok(result);
    }

    let curves = frfs
        .iter()
        .map(|frf| {
            let mut curve =
                Curve::from_receptance(frf.frequency_hz, frf.receptance_m_per_n, settings.band_hz)?;
            if frf.modes.conjugated {
                curve.conjugate();
            }
            Ok(curve)
        })
        .collect::<Result<Vec<Curve>>>()?;
    let common = curves.windows(2).all(|w| w[0].frequency_hz == w[1].frequency_hz);
    if !common {
        result.warnings.push(
            "the FRFs are not on common lines: the global modes are means over the single FRFs' modes".into(),
        );
        report(clustered, frfs.len(), &mut result);
        return Ok(result);
    }
    let set = CurveSet {
        frequency_hz: &curves[0].frequency_hz,
        mobility: curves.iter().map(|c| c.mobility.as_slice()).collect(),
    };
    let poles: Vec<Pole> = clustered
        .iter()
        .map(|m| Pole {
            frequency_hz: m.frequency_hz,
            damping_ratio: m.damping_ratio,
        })
        .collect();
    for (group, fitted) in joint_fit::refine(&set, &poles) {
        match fitted {
            Some(modes) => {
                let lost: Vec<String> = group
                    .iter()
                    .map(|&i| &clustered[i])
                    .filter(|m| m.found_in >= 2 && !modes.iter().any(|j| near(m, &j.pole)))
                    .map(|m| format!("{:.2} Hz (in {} FRFs)", m.frequency_hz, m.found_in))
                    .collect();
                if !lost.is_empty() {
                    result.warnings.push(format!(
                        "modes of single FRFs that all FRFs together do not confirm: {}",
                        lost.join(", ")
                    ));
                }
                let modes = modes.into_iter().filter(|m| m.seen_in > 0).map(|m| GlobalMode {
                    frequency_hz: m.pole.frequency_hz,
                    damping_ratio: m.pole.damping_ratio,
                    frequency_std_hz: m.frequency_std_hz,
                    damping_std: m.damping_std,
                    found_in: m.seen_in,
                });
                result.modes.extend(modes);
            }
            None => report(
                group.into_iter().map(|i| clustered[i].clone()),
                frfs.len(),
                &mut result,
            ),
        }
    }
    result
        .modes
        .sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Ok(result)
}

/// Within the half-power band.
fn near(mode: &GlobalMode, pole: &Pole) -> bool {
    let width = mode.frequency_hz * mode.damping_ratio.max(pole.damping_ratio);
    (mode.frequency_hz - pole.frequency_hz).abs() < width
}

/// Clusters as they are, but for those of a single FRF in a larger set.
fn report(clustered: impl IntoIterator<Item = GlobalMode>, frfs: usize, result: &mut GlobalModes) {
    for mode in clustered {
        if frfs >= SET && mode.found_in < 2 {
            result.warnings.push(format!(
                "a mode at {:.2} Hz is seen in one FRF only and is left out of the global table",
                mode.frequency_hz
            ));
        } else {
            result.modes.push(mode);
        }
    }
}

/// Joins the nearest clusters first, as long as they are near and share no FRF.
fn clusters(members: Vec<Member>) -> Vec<Vec<Member>> {
    let mut clusters: Vec<Vec<Member>> = members.into_iter().map(|m| vec![m]).collect();
    clusters.sort_by(|a, b| a[0].frequency_hz.total_cmp(&b[0].frequency_hz));
    loop {
        // In ascending order only neighbours can be nearest; but two neighbours may share an FRF and the next
        // one may not, hence the small look-ahead.
        const LOOK_AHEAD: usize = 4;
        let mut nearest: Option<(f64, usize, usize)> = None;
        for a in 0..clusters.len() {
            for b in a + 1..clusters.len().min(a + 1 + LOOK_AHEAD) {
                if let Some(distance) = distance(&clusters[a], &clusters[b])
                    && nearest.is_none_or(|(least, ..)| distance < least)
                {
                    nearest = Some((distance, a, b));
                }
            }
        }
        let Some((_, a, b)) = nearest else { return clusters };
        let other = clusters.remove(b);
        clusters[a].extend(other);
        clusters.sort_by(|a, b| centre(a).0.total_cmp(&centre(b).0));
    }
}

/// Weighted centre, its standard deviation, and the half-power half-width, all in Hz.
fn centre(cluster: &[Member]) -> (f64, f64, f64) {
    let (mean, std) = weighted(cluster.iter().map(|m| (m.frequency_hz, m.frequency_std_hz)));
    let (zeta, _) = weighted(cluster.iter().map(|m| (m.damping_ratio, m.damping_std)));
    (mean, std, zeta * mean)
}

/// Distance in half-widths; `None` where the clusters must not join.
fn distance(a: &[Member], b: &[Member]) -> Option<f64> {
    if a.iter().any(|m| b.iter().any(|n| n.frf == m.frf)) {
        return None;
    }
    let ((fa, sa, wa), (fb, sb, wb)) = (centre(a), centre(b));
    let width = wa.min(wb);
    let apart = (fa - fb).abs();
    let near = (JOIN_WIDTHS * width).max((JOIN_SIGMA * sa.hypot(sb)).min(MOST_WIDTHS * wa.max(wb)));
    (apart <= near).then(|| apart / width.max(1e-6 * fa))
}

/// Mean with inverse-variance weights and its standard deviation. Standard deviations far below the others'
/// are raised: a lucky residual must not outvote the rest.
fn weighted(samples: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let samples: Vec<(f64, f64)> = samples.collect();
    let floor = 0.3 * median(samples.iter().map(|s| s.1));
    let weight = |std: f64| std.max(floor).max(1e-12).powi(-2);
    let total: f64 = samples.iter().map(|s| weight(s.1)).sum();
    let mean = samples.iter().map(|s| s.0 * weight(s.1)).sum::<f64>() / total;
    (mean, total.powf(-0.5))
}

fn combine(cluster: &[Member]) -> GlobalMode {
    let (frequency_hz, frequency_std_hz) = robust_mean(
        cluster
            .iter()
            .map(|m| (m.frequency_hz, m.frequency_std_hz))
            .collect(),
    );
    let (damping_ratio, damping_std) =
        robust_mean(cluster.iter().map(|m| (m.damping_ratio, m.damping_std)).collect());
    GlobalMode {
        frequency_hz,
        damping_ratio,
        frequency_std_hz,
        damping_std,
        found_in: cluster.len(),
    }
}

/// Weighted mean without outliers, and its standard deviation with the Birge ratio where the scatter is
/// larger than the estimates' own standard deviations say.
fn robust_mean(samples: Vec<(f64, f64)>) -> (f64, f64) {
    let middle = median(samples.iter().map(|s| s.0));
    let scatter = 1.4826 * median(samples.iter().map(|s| (s.0 - middle).abs()));
    let kept: Vec<(f64, f64)> = samples
        .iter()
        .copied()
        .filter(|s| samples.len() < 4 || (s.0 - middle).abs() <= OUTLIER_SIGMA * s.1.max(scatter))
        .collect();
    let kept = if kept.is_empty() { samples } else { kept };
    let (mean, std) = weighted(kept.iter().copied());
    if kept.len() < 2 {
        return (mean, std);
    }
    let floor = 0.3 * median(kept.iter().map(|s| s.1));
    let chi2: f64 = kept
        .iter()
        .map(|s| ((s.0 - mean) / s.1.max(floor).max(1e-12)).powi(2))
        .sum();
    let birge = (chi2 / (kept.len() - 1) as f64).sqrt();
    (mean, std * birge.max(1.0))
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
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
    fn frfs_on_different_lines_are_averaged_and_that_is_said() {
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
        assert!(found.warnings[0].contains("common lines"), "{:?}", found.warnings);
        assert_eq!(found.modes.len(), 1);
        assert!((found.modes[0].damping_ratio - 0.03).abs() < 4.0 * found.modes[0].damping_std);
    }

    #[test]
    fn an_outlier_does_not_move_the_mean() {
        let samples = vec![(1.0, 0.01), (1.01, 0.01), (0.99, 0.01), (1.0, 0.01), (3.0, 0.01)];
        let (mean, std) = robust_mean(samples);
        approx::assert_relative_eq!(mean, 1.0, epsilon = 1e-9);
        assert!(std < 0.01);
    }

    #[test]
    fn scatter_beyond_the_claimed_deviations_widens_the_result() {
        let (mean, std) = robust_mean(vec![(1.0, 0.001), (1.1, 0.001), (0.9, 0.001)]);
        approx::assert_relative_eq!(mean, 1.0, epsilon = 1e-9);
        // Sample standard deviation 0.1 over √3.
        approx::assert_relative_eq!(std, 0.1 / 3f64.sqrt(), max_relative = 1e-6);
    }
}
