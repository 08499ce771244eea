//! Circle fit: the Nyquist plot of the mobility of one viscous mode is a circle, passed at the angle
//! θ = θ₀ − 2 atan(u/ζ) as seen from its centre (Kennedy & Pancu 1947; Ewins, Modal Testing, §4.3, in the
//! detuning u, where it is exact). Other modes only shift the circle. The centre comes from Taubin's
//! algebraic fit (1991) and a geometric refinement; resonance is where the fitted sweep is fastest; damping
//! comes from all angles at once, and once more from every pair of points around the resonance:
//! ζ = (u_b − u_a)/(tan(θ_b/2) + tan(θ_a/2)). The scatter of the pairs is reported with it.

use std::f64::consts::{PI, TAU};

use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};
use num_complex::Complex64;

use crate::modal::single::curve::{Curve, detuned_hz, detuning};

/// Lines up to this detuning over ζ take part: an arc of 4 atan(2.5) = 273°.
const REACH: f64 = 2.5;
/// Fewest lines on the arc: three make a circle, five leave something to judge it by.
const MIN_LINES: usize = 5;
/// Pairs are taken among points between these angles from the resonance (on the circle).
const PAIR_ANGLE_RAD: [f64; 2] = [0.35, 2.4];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CircleFit {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    pub frequency_std_hz: f64,
    pub damping_std: f64,
    /// Standard deviation of ζ over the point pairs; `None` with fewer than two pairs.
    pub damping_spread: Option<f64>,
    pub pairs: usize,
    /// Diameter as a phasor: from the off-resonance point to the resonance point, (m/s)/N.
    pub diameter: Complex64,
    /// Root mean square distance of the points from the circle over its radius.
    pub roundness: f64,
}

/// Fits the circle near a first estimate. `None` where too few lines lie on the arc or it is no circle.
pub(crate) fn fit(curve: &Curve, frequency_hz: f64, damping_ratio: f64) -> Option<CircleFit> {
    // One round only: letting the arc follow the answer favours answers that let more lines in.
    let at = |reach: f64| detuned_hz(frequency_hz, reach * damping_ratio);
    let mut lines = curve.range(at(-REACH), at(REACH));
    if lines.len() < MIN_LINES {
        // Coarse lines: the nearest ones, if they still lie on the circle and not on its foot.
        let from = curve.nearest(frequency_hz).saturating_sub(MIN_LINES / 2);
        lines = from..(from + MIN_LINES).min(curve.len());
        let reach = curve.range(at(-2.0 * REACH), at(2.0 * REACH));
        if lines.start < reach.start || lines.end > reach.end || lines.len() < MIN_LINES {
            return None;
        }
    }
    let fitted = fit_lines(curve, lines, (frequency_hz, damping_ratio))?;
    // A first estimate may be off, but one that runs away is no answer.
    let moved = (fitted.frequency_hz - frequency_hz).abs() / frequency_hz;
    (moved <= 2.0 * damping_ratio.max(fitted.damping_ratio)).then_some(fitted)
}

fn fit_lines(curve: &Curve, lines: std::ops::Range<usize>, start: (f64, f64)) -> Option<CircleFit> {
    let f = &curve.frequency_hz[lines.clone()];
    let y = &curve.mobility[lines];
    let circle = Circle::fit(y)?;
    let free = y.len().checked_sub(3).filter(|&n| n > 0)?;
    let radial: f64 = y
        .iter()
        .map(|y| ((y - circle.centre).norm() - circle.radius).powi(2))
        .sum();
    let roundness = (radial / free as f64).sqrt() / circle.radius;
    if roundness.is_nan() || roundness > 0.5 {
        return None;
    }
    let sweep = Sweep::fit(f, &angles(y, circle.centre), start)?;

    // The scatter of the angles is one part of the uncertainty, the centre's error is the other (independent, as noise
    // along and across the circle is): each angle turns by Im(−δ/(y − c)) when the centre moves by δ.
    let by_centre = |direction: Complex64| {
        let turned = y.iter().map(|y| (-direction / (y - circle.centre)).im);
        sweep.moved_by(f, turned)
    };
    let (by_x, by_y) = (by_centre(Complex64::ONE), by_centre(Complex64::I));
    let centre_covariance = circle.centre_cofactor * (radial / free as f64);
    let std_of = |j: usize| {
        let gradient = Vector2::new(by_x[j], by_y[j]);
        (sweep.std[j].powi(2) + (gradient.transpose() * centre_covariance * gradient)[0].max(0.0)).sqrt()
    };

    let from_resonance: Vec<(f64, f64)> = f
        .iter()
        .zip(angles(y, circle.centre))
        .map(|(&f, a)| (detuning(f, sweep.frequency_hz), sweep.resonance_angle - a))
        .collect();
    let (pairs, spread) = pair_spread(&from_resonance);
    Some(CircleFit {
        frequency_hz: sweep.frequency_hz,
        damping_ratio: sweep.damping_ratio,
        frequency_std_hz: std_of(0),
        damping_std: std_of(1),
        damping_spread: spread,
        pairs,
        diameter: Complex64::from_polar(2.0 * circle.radius, sweep.resonance_angle),
        roundness,
    })
}

/// Angles of the points seen from the centre, without jumps of full turns.
fn angles(points: &[Complex64], centre: Complex64) -> Vec<f64> {
    let mut last: Option<f64> = None;
    points
        .iter()
        .map(|y| {
            let angle = (y - centre).arg();
            let unwrapped = last.map_or(angle, |last| angle + ((last - angle) / TAU).round() * TAU);
            last = Some(unwrapped);
            unwrapped
        })
        .collect()
}

/// θ(f) = θ₀ − 2 atan(u(f; f₀)/ζ) by least squares over f₀, ln ζ, θ₀.
struct Sweep {
    frequency_hz: f64,
    damping_ratio: f64,
    resonance_angle: f64,
    /// Of frequency and damping ratio.
    std: [f64; 2],
    /// Inverse of the normal matrix over (f₀, ln ζ, θ₀).
    cofactor: Matrix3<f64>,
}

impl Sweep {
    /// ∂θ/∂(f₀, ln ζ, θ₀).
    fn slopes(f: f64, f0: f64, zeta: f64) -> Vector3<f64> {
        let u = detuning(f, f0);
        let by_u = -2.0 * zeta / (zeta * zeta + u * u);
        let slope = -0.5 * (f / (f0 * f0) + 1.0 / f);
        Vector3::new(by_u * slope, -by_u * u, 1.0)
    }

    /// Change of frequency and damping ratio for a small change of the angles.
    fn moved_by(&self, f: &[f64], turned: impl Iterator<Item = f64>) -> [f64; 2] {
        let rows = f
            .iter()
            .map(|&f| Sweep::slopes(f, self.frequency_hz, self.damping_ratio));
        let right: Vector3<f64> = rows.zip(turned).map(|(row, angle)| row * angle).sum();
        let change = self.cofactor * right;
        [change[0], change[1] * self.damping_ratio]
    }

    fn fit(f: &[f64], angles: &[f64], start: (f64, f64)) -> Option<Sweep> {
        let (mut f0, mut zeta) = start;
        // Angles less those of the sweep, their mean, and the squares about it.
        let left = |f0: f64, zeta: f64| {
            let left = f.iter().zip(angles);
            let left: Vec<f64> = left
                .map(|(&f, &a)| a + 2.0 * (detuning(f, f0) / zeta).atan())
                .collect();
            let mean = left.iter().sum::<f64>() / left.len() as f64;
            let cost = left.iter().map(|l| (l - mean).powi(2)).sum::<f64>();
            (left, mean, cost)
        };
        let mut lambda = 1e-3;
        let mut best = left(f0, zeta);
        let mut normal = Matrix3::zeros();
        for _ in 0..50 {
            normal = Matrix3::zeros();
            let mut gradient = Vector3::zeros();
            for (&f, l) in f.iter().zip(&best.0) {
                let row = Sweep::slopes(f, f0, zeta);
                normal += row * row.transpose();
                gradient += row * (l - best.1);
            }
            let damped = normal + Matrix3::from_diagonal(&(normal.diagonal() * lambda));
            let step = damped.lu().solve(&gradient)?;
            let widest = zeta * f0;
            let trial = (
                f0 + step[0].clamp(-widest, widest),
                zeta * step[1].clamp(-1.0, 1.0).exp(),
            );
            let next = left(trial.0, trial.1);
            if trial.0 > 0.0 && next.2 <= best.2 {
                let done = best.2 - next.2 <= 1e-13 * best.2;
                (f0, zeta) = trial;
                best = next;
                lambda = (lambda * 0.2).max(1e-12);
                if done {
                    break;
                }
            } else {
                lambda *= 8.0;
                if lambda > 1e8 {
                    break;
                }
            }
        }
        let free = f.len().checked_sub(3).filter(|&n| n > 0)?;
        let cofactor = normal.try_inverse()?;
        let covariance = cofactor * (best.2 / free as f64);
        let std = [
            covariance[(0, 0)].max(0.0).sqrt(),
            covariance[(1, 1)].max(0.0).sqrt() * zeta,
        ];
        let sane = f0.is_finite() && zeta > 0.0 && zeta < 1.0 && std.iter().all(|s| s.is_finite());
        sane.then_some(Sweep {
            frequency_hz: f0,
            damping_ratio: zeta,
            resonance_angle: best.1,
            std,
            cofactor,
        })
    }
}

/// Number of point pairs around the resonance and the scatter of their damping, each pair weighted by what
/// an equal error of both angles does to it.
fn pair_spread(points: &[(f64, f64)]) -> (usize, Option<f64>) {
    let [least, most] = PAIR_ANGLE_RAD;
    let usable = |angle: f64| (least..most).contains(&angle);
    // Detuning and tan(θ/2) of the points on one side of the resonance.
    let side = |sign: f64| -> Vec<(f64, f64)> {
        let of_side = points.iter().filter(|p| sign * p.0 > 0.0 && usable(sign * p.1));
        of_side.map(|p| (p.0, (0.5 * sign * p.1).tan())).collect()
    };
    let (below, above) = (side(-1.0), side(1.0));
    let mut pairs = Vec::with_capacity(below.len() * above.len());
    for &(u_a, a) in &below {
        for &(u_b, b) in &above {
            let zeta = (u_b - u_a) / (a + b);
            let relative_square = ((1.0 + a * a).powi(2) + (1.0 + b * b).powi(2)) / (a + b).powi(2);
            pairs.push((zeta, relative_square.recip()));
        }
    }
    if pairs.len() < 2 {
        return (pairs.len(), None);
    }
    let total: f64 = pairs.iter().map(|p| p.1).sum();
    let mean = pairs.iter().map(|p| p.0 * p.1).sum::<f64>() / total;
    let variance = pairs.iter().map(|p| p.1 * (p.0 - mean).powi(2)).sum::<f64>() / total;
    (pairs.len(), Some(variance.sqrt()))
}

struct Circle {
    centre: Complex64,
    radius: f64,
    /// Covariance of the centre for unit variance of the points' distances.
    centre_cofactor: Matrix2<f64>,
}

impl Circle {
    /// Taubin's algebraic fit, then Gauss–Newton on the distances.
    fn fit(points: &[Complex64]) -> Option<Circle> {
        let n = points.len() as f64;
        let mean = points.iter().sum::<Complex64>() / n;
        let scale = (points.iter().map(|p| (p - mean).norm_sqr()).sum::<f64>() / n).sqrt();
        if !scale.is_finite() || scale <= 0.0 {
            return None;
        }
        let local: Vec<Complex64> = points.iter().map(|p| (p - mean) / scale).collect();

        // Taubin by SVD (Chernov 2010, §5.9): rows ((z − z̄)/(2√z̄), x, y), z = x² + y².
        let z_mean = local.iter().map(|p| p.norm_sqr()).sum::<f64>() / n;
        let half = 2.0 * z_mean.sqrt();
        let rows = DMatrix::from_fn(local.len(), 3, |k, j| match j {
            0 => (local[k].norm_sqr() - z_mean) / half,
            1 => local[k].re,
            _ => local[k].im,
        });
        let svd = rows.svd(false, true);
        let smallest = svd.singular_values.imin();
        let v = svd.v_t?.row(smallest).transpose();
        let a = v[0] / half;
        if a.abs() < 1e-9 {
            return None;
        }
        let mut centre = Complex64::new(-v[1] / (2.0 * a), -v[2] / (2.0 * a));
        let mut radius = local.iter().map(|p| (p - centre).norm()).sum::<f64>() / n;

        let mut normal = Matrix3::zeros();
        for _ in 0..20 {
            normal = Matrix3::zeros();
            let mut gradient = Vector3::zeros();
            for p in &local {
                let arm = p - centre;
                let distance = arm.norm_sqr().sqrt();
                if distance == 0.0 {
                    return None;
                }
                let row = Vector3::new(arm.re / distance, arm.im / distance, 1.0);
                normal += row * row.transpose();
                gradient += row * (distance - radius);
            }
            let step = normal.lu().solve(&gradient)?;
            centre += Complex64::new(step[0], step[1]);
            radius += step[2];
            if step.norm() < 1e-12 {
                break;
            }
        }
        // Lengths were scaled on both sides, so the cofactor needs no scale.
        let cofactor = normal.try_inverse()?;
        (centre.norm() < 1e3 && radius > 0.0 && radius < 1e3).then(|| Circle {
            centre: centre * scale + mean,
            radius: radius * scale,
            centre_cofactor: cofactor.fixed_view::<2, 2>(0, 0).into_owned(),
        })
    }
}

/// True where the plot turns counter-clockwise over these lines: the sign convention e^{−iωt}, or negative
/// damping. `None` where the turn is lost in the noise.
pub(crate) fn turns_backwards(curve: &Curve, lines: std::ops::Range<usize>, noise_std: f64) -> Option<bool> {
    let y = curve.mobility.get(lines)?;
    if y.len() < 3 {
        return None;
    }
    // Twice the signed area of the polygon, closed over the off-resonance end.
    let area: f64 = (0..y.len())
        .map(|k| (y[k].conj() * y[(k + 1) % y.len()]).im)
        .sum();
    let perimeter: f64 = (0..y.len()).map(|k| (y[k] - y[(k + 1) % y.len()]).norm()).sum();
    // Noise moves each corner by σ across an edge of mean length perimeter/n.
    let uncertainty = noise_std * perimeter / (y.len() as f64).sqrt();
    // A circle fills 1/(4π) of its squared perimeter; a flat or tangled curve nearly nothing.
    let filled = area.abs() / (perimeter * perimeter);
    (area.abs() > 3.0 * uncertainty && filled > 0.1 / (4.0 * PI)).then_some(area > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    fn curve_of(case: Synthetic) -> Curve {
        let (f, h) = case.frf();
        Curve::from_receptance(&f, &h, None).unwrap()
    }

    #[test]
    fn a_clean_mode_is_an_exact_circle_whatever_the_damping() {
        for zeta in [0.01, 0.05, 0.3] {
            let curve = curve_of(Synthetic::new(
                3.0,
                60.0,
                0.1,
                &[SyntheticMode::new(20.03, zeta, 2.0)],
            ));
            let fitted = fit(&curve, 20.3, 1.3 * zeta).unwrap();
            approx::assert_relative_eq!(fitted.frequency_hz, 20.03, max_relative = 1e-7);
            approx::assert_relative_eq!(fitted.damping_ratio, zeta, max_relative = 1e-6);
            assert!(fitted.damping_spread.unwrap() < 1e-6 * zeta);
            // Diameter A/(2ζω₀).
            let diameter = 2.0 / (2.0 * zeta * TAU * 20.03);
            approx::assert_relative_eq!(fitted.diameter.re, diameter, max_relative = 1e-6);
            approx::assert_relative_eq!(fitted.diameter.im, 0.0, epsilon = 1e-6 * diameter);
        }
    }

    #[test]
    fn the_sense_of_turning_tells_the_phase_convention() {
        let mut curve = curve_of(Synthetic::new(
            3.0,
            60.0,
            0.1,
            &[SyntheticMode::new(20.0, 0.03, -1.0)],
        ));
        let lines = curve.range(19.0, 21.0);
        assert_eq!(turns_backwards(&curve, lines.clone(), 0.0), Some(false));
        curve.conjugate();
        assert_eq!(turns_backwards(&curve, lines.clone(), 0.0), Some(true));
        assert_eq!(turns_backwards(&curve, lines, curve.mobility[170].norm()), None);
    }

    #[test]
    fn two_points_make_no_circle() {
        let curve = curve_of(Synthetic::new(
            3.0,
            60.0,
            1.0,
            &[SyntheticMode::new(20.0, 0.01, 1.0)],
        ));
        assert!(fit(&curve, 20.0, 0.01).is_none());
    }

    /// Estimates under noise scatter by what is stated of them, however wide the peak is against its lines.
    #[test]
    fn stated_errors_are_the_scatter_under_noise() {
        for zeta in [0.01, 0.05] {
            let fits: Vec<CircleFit> = (0..300)
                .map(|seed| {
                    let modes = [SyntheticMode::new(20.03, zeta, 2.0)];
                    let noisy = Synthetic::new(14.0, 26.0, 0.1, &modes).with_noise(0.02, 0.0, seed);
                    fit(&curve_of(noisy), 20.0, zeta).unwrap()
                })
                .collect();
            let agree = |value: fn(&CircleFit) -> f64, stated: fn(&CircleFit) -> f64| {
                let n = fits.len() as f64;
                let mean = fits.iter().map(value).sum::<f64>() / n;
                let scatter =
                    (fits.iter().map(|f| (value(f) - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
                let stated = (fits.iter().map(|f| stated(f).powi(2)).sum::<f64>() / n).sqrt();
                assert!(
                    (0.8..1.25).contains(&(stated / scatter)),
                    "{zeta}: {stated} stated, {scatter} seen"
                );
            };
            agree(|f| f.frequency_hz, |f| f.frequency_std_hz);
            agree(|f| f.damping_ratio, |f| f.damping_std);
        }
    }

    /// The points of a circle are on it: centre and radius of three and more of them, wherever it lies.
    #[test]
    fn a_circle_is_found_from_an_arc_of_it() {
        let points: Vec<Complex64> = (0..8)
            .map(|k| Complex64::new(3.0, -7.0) + Complex64::from_polar(2.5, 0.3 * f64::from(k)))
            .collect();
        let circle = Circle::fit(&points).unwrap();
        assert!((circle.centre - Complex64::new(3.0, -7.0)).norm() < 1e-9);
        approx::assert_relative_eq!(circle.radius, 2.5, max_relative = 1e-9);
        let line: Vec<Complex64> = (0..8).map(|k| Complex64::new(f64::from(k), 2.0)).collect();
        assert!(Circle::fit(&line).is_none());
    }

    /// Two and a half turns are five half turns, not one.
    #[test]
    fn angles_go_on_over_full_turns() {
        let points: Vec<Complex64> = (0..=25)
            .map(|k| Complex64::new(1.0, 1.0) + Complex64::from_polar(1.0, -0.2 * PI * f64::from(k)))
            .collect();
        let turned = angles(&points, Complex64::new(1.0, 1.0));
        approx::assert_relative_eq!(turned[25] - turned[0], -5.0 * PI, max_relative = 1e-9);
    }
}
