//! Half-power damping with crossings interpolated on a smooth fit.
//!
//! For one viscous mode f²/|Y|² is a quadratic in s = f² (exactly), so a weighted quadratic through the lines
//! around the peak gives peak and crossings between the lines and averages the noise. In mobility the
//! half-power frequencies fulfil f₁f₂ = f₀² and (f₂ − f₁)/(2f₀) = ζ for any damping; where the lines do not
//! reach the crossing on one side, the fitted curve stands for it and the result says so.

use nalgebra::{Matrix3, Vector3};

use crate::modal::single::curve::{Curve, detuning};

/// Lines with at least this part of the peak's power take part (|u| ≤ 2ζ).
const MIN_POWER: f64 = 0.2;
/// Where the lines are so coarse that three of them reach down to less than this, there is no result.
const LEAST_POWER: f64 = 0.05;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HalfPower {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    pub crossings_hz: [f64; 2],
    /// Which crossings lie inside the lines that were used (lower, upper).
    pub reached: [bool; 2],
    /// From the fit's covariance; `None` where there are just enough lines.
    pub std: Option<HalfPowerStd>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct HalfPowerStd {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
}

/// `None` where the lines around the peak show no maximum, or reach half power on neither side.
pub(crate) fn fit(curve: &Curve, peak_index: usize, noise_std: f64) -> Option<HalfPower> {
    let power: Vec<f64> = curve.mobility.iter().map(|y| y.norm_sqr()).collect();
    let mut result: Option<HalfPower> = None;
    let mut lines = hill(&power, peak_index, power[peak_index]);
    // The first pass finds the peak between the lines and the width; the next uses the lines that belong to it.
    for _ in 0..3 {
        let pass = fit_lines(curve, &power, lines.clone(), noise_std)?;
        let reach = (1.0 / MIN_POWER - 1.0).sqrt() * pass.damping_ratio;
        let hz = |u| crate::modal::single::curve::detuned_hz(pass.frequency_hz, u);
        let allowed = hill(&power, peak_index, 0.0);
        let mut next = curve.range(hz(-reach), hz(reach));
        next = next.start.max(allowed.start)..next.end.min(allowed.end);
        // Three lines are needed for a quadratic.
        if next.len() < 3 {
            next = lines.start.min(next.start)..lines.end.max(next.end);
        }
        result = Some(pass);
        if next == lines {
            break;
        }
        lines = next;
    }
    result.filter(|r| r.reached[0] || r.reached[1])
}

/// The lines around a peak down to `MIN_POWER` of it (all the way for `height` 0), ending before higher ground.
fn hill(power: &[f64], peak: usize, height: f64) -> std::ops::Range<usize> {
    let top = power[peak];
    let walk = |indices: &mut dyn Iterator<Item = usize>| {
        let mut lowest = (top, peak);
        let mut last = peak;
        for k in indices {
            last = k;
            if power[k] < lowest.0 {
                lowest = (power[k], k);
            }
            if power[k] < MIN_POWER * height {
                break;
            }
            // Another, higher peak: what lies beyond the valley between belongs to it. The margin is for noise.
            if power[k] > 1.3 * top || (lowest.0 < 0.4 * top && power[k] > 2.5 * lowest.0 + 0.2 * top) {
                return lowest.1;
            }
        }
        last
    };
    let from = walk(&mut (0..peak).rev());
    let to = walk(&mut (peak + 1..power.len()));
    from..to + 1
}

fn fit_lines(
    curve: &Curve,
    power: &[f64],
    lines: std::ops::Range<usize>,
    noise_std: f64,
) -> Option<HalfPower> {
    if lines.len() < 3 {
        return None;
    }
    let f = &curve.frequency_hz;
    let (low, high) = (f[lines.start], f[lines.end - 1]);
    let centre = 0.5 * (low * low + high * high);
    let scale = 0.5 * (high * high - low * low);
    let top = lines.clone().map(|k| power[k]).fold(0.0, f64::max);
    // E|Y + e|² = |Y|² + σ²; the floor keeps a line that noise has swallowed from having infinite ordinate.
    let true_power = |k: usize| (power[k] - noise_std * noise_std).max(0.02 * top);
    let ordinate = |k: usize| f[k] * f[k] / true_power(k);
    let row = |k: usize| {
        let z = (f[k] * f[k] - centre) / scale;
        Vector3::new(1.0, z, z * z)
    };

    // d(f²/|Y|²) = −2 f² d|Y| / |Y|³, and |Y| has the same scatter on every line: weight ∝ (|Y|³/f²)².
    let mut coefficients = Vector3::zeros();
    let mut normal = Matrix3::zeros();
    let weight = |power: f64, f: f64| power.powi(3) / f.powi(4);
    for pass in 0..4 {
        normal = Matrix3::zeros();
        let mut right = Vector3::zeros();
        for k in lines.clone() {
            let x = row(k);
            let model = coefficients.dot(&x);
            let fitted = f[k] * f[k] / model;
            let usable = pass > 0 && model > 0.0 && fitted < 4.0 * top;
            let w = weight(if usable { fitted } else { true_power(k) }, f[k]);
            normal += x * x.transpose() * w;
            right += x * (ordinate(k) * w);
        }
        coefficients = normal.lu().solve(&right)?;
    }
    let (f0, zeta, crossings) = crossings(&coefficients, centre, scale)?;
    let farthest = detuning(low, f0).abs().max(detuning(high, f0).abs()) / zeta;
    if 1.0 / (1.0 + farthest * farthest) < LEAST_POWER && lines.len() == 3 {
        return None;
    }

    let free = lines.len() - 3;
    let std = (free > 0).then(|| -> Option<HalfPowerStd> {
        let chi2: f64 = lines
            .clone()
            .map(|k| {
                let x = row(k);
                let model = coefficients.dot(&x);
                let w = if model > 0.0 {
                    weight(f[k] * f[k] / model, f[k])
                } else {
                    0.0
                };
                w * (ordinate(k) - model).powi(2)
            })
            .sum();
        let covariance = normal.try_inverse()? * (chi2 / free as f64);
        let mut gradient = [Vector3::zeros(), Vector3::zeros()];
        for j in 0..3 {
            let step = 1e-6 * coefficients.amax();
            let mut moved = coefficients;
            moved[j] += step;
            let (f1, z1, _) = crate::modal::single::half_power::crossings(&moved, centre, scale)?;
            gradient[0][j] = (f1 - f0) / step;
            gradient[1][j] = (z1 - zeta) / step;
        }
        let std_of = |g: &Vector3<f64>| (g.transpose() * covariance * g)[0].max(0.0).sqrt();
        let std = HalfPowerStd {
            frequency_hz: std_of(&gradient[0]),
            damping_ratio: std_of(&gradient[1]),
        };
        (std.frequency_hz.is_finite() && std.damping_ratio.is_finite()).then_some(std)
    });

    Some(HalfPower {
        frequency_hz: f0,
        damping_ratio: zeta,
        crossings_hz: crossings,
        reached: [crossings[0] >= low, crossings[1] <= high],
        std: std.flatten(),
    })
}

/// Peak, damping and crossings of |Y|² = s / q(s), s = f².
fn crossings(q: &Vector3<f64>, centre: f64, scale: f64) -> Option<(f64, f64, [f64; 2])> {
    // q as a + b s + c s².
    let c = q[2] / (scale * scale);
    let b = q[1] / scale - 2.0 * c * centre;
    let a = q[0] - q[1] * centre / scale + c * centre * centre;
    // q/s is least at √(a/c), where it is b + 2√(ac); at half power it is twice that.
    if !(a > 0.0 && c > 0.0) {
        return None;
    }
    let product = (a * c).sqrt();
    let least = b + 2.0 * product;
    if least.is_nan() || least <= 0.0 {
        return None;
    }
    let s0 = product / c;
    // c s² + (b − 2 least) s + a = 0 has the product of roots s0², so they lie at equal |u|.
    let half_sum = (least - 0.5 * b) / c;
    let root = (half_sum * half_sum - s0 * s0).max(0.0).sqrt();
    let upper = half_sum + root;
    let (f0, f1, f2) = (s0.sqrt(), s0 / upper.sqrt(), upper.sqrt());
    let zeta = detuning(f2, f0);
    (zeta.is_finite() && zeta > 0.0 && zeta < 1.0).then_some((f0, zeta, [f1, f2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    fn fit_case(case: Synthetic) -> Option<HalfPower> {
        let (f, h) = case.frf();
        let curve = Curve::from_receptance(&f, &h, None).unwrap();
        let noise = curve.noise_std();
        let peaks = crate::modal::single::peaks::find(&curve, &noise);
        let peak = peaks.first().map_or_else(
            || {
                curve
                    .mobility
                    .iter()
                    .enumerate()
                    .max_by(|a, b| a.1.norm().total_cmp(&b.1.norm()))
                    .unwrap()
                    .0
            },
            |p| p.index,
        );
        fit(&curve, peak, 0.0)
    }

    #[test]
    fn a_clean_mode_is_exact_between_the_lines_at_any_damping() {
        for (f0, zeta) in [(12.337, 0.004), (12.337, 0.02), (12.337, 0.1), (12.337, 0.3)] {
            let result = fit_case(Synthetic::new(
                3.0,
                60.0,
                0.1,
                &[SyntheticMode::new(f0, zeta, 1.0)],
            ))
            .unwrap();
            approx::assert_relative_eq!(result.frequency_hz, f0, max_relative = 1e-9);
            approx::assert_relative_eq!(result.damping_ratio, zeta, max_relative = 1e-6);
            approx::assert_relative_eq!(
                (result.crossings_hz[1] - result.crossings_hz[0]) / (2.0 * f0),
                zeta,
                max_relative = 1e-6
            );
            assert_eq!(result.reached, [true, true]);
        }
    }

    #[test]
    fn a_missing_side_is_said() {
        // The band ends just above the resonance, below the upper crossing at 20.4 Hz.
        let result = fit_case(Synthetic::new(
            3.0,
            20.25,
            0.05,
            &[SyntheticMode::new(20.0, 0.02, 1.0)],
        ))
        .unwrap();
        assert_eq!(result.reached, [true, false]);
        approx::assert_relative_eq!(result.damping_ratio, 0.02, max_relative = 1e-6);
    }

    /// Estimates under noise scatter by what is stated of them.
    #[test]
    fn stated_errors_are_the_scatter_under_noise() {
        for zeta in [0.02, 0.05] {
            let fits: Vec<HalfPower> = (0..300)
                .map(|seed| {
                    let modes = [SyntheticMode::new(20.03, zeta, 2.0)];
                    let (f, h) = Synthetic::new(14.0, 26.0, 0.05, &modes)
                        .with_noise(0.02, 0.0, seed)
                        .frf();
                    let curve = Curve::from_receptance(&f, &h, None).unwrap();
                    let peak = curve.nearest(20.03);
                    fit(&curve, peak, 0.0).unwrap()
                })
                .collect();
            let agree = |value: fn(&HalfPower) -> f64, stated: fn(&HalfPowerStd) -> f64| {
                let n = fits.len() as f64;
                let mean = fits.iter().map(value).sum::<f64>() / n;
                let scatter =
                    (fits.iter().map(|f| (value(f) - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
                let of = |f: &HalfPower| stated(&f.std.unwrap()).powi(2);
                let stated = (fits.iter().map(of).sum::<f64>() / n).sqrt();
                assert!(
                    (0.75..1.35).contains(&(stated / scatter)),
                    "{zeta}: {stated} stated, {scatter} seen"
                );
            };
            agree(|f| f.frequency_hz, |s| s.frequency_hz);
            agree(|f| f.damping_ratio, |s| s.damping_ratio);
        }
    }
}
