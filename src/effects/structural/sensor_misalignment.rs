use crate::data::RobotSpec;
use crate::effects::background::EWINS;
use crate::effects::structural::{ChannelFilter, Structure};
use crate::effects::usual_size::{FollowsSize, SizeRange, UsualSize};
use crate::effects::{At, Effect, Known, Site};
use crate::effects::{Background, Size};
use crate::parameter::{Parameter, Prior, Scale};
use crate::robot::Dual;

/// Response axes turned by a small rotation: H_measured = Rᵀ H.
pub struct SensorMisalignment;

impl Effect<Structure> for SensorMisalignment {
    fn id(&self) -> &'static str {
        "sensor-misalignment"
    }

    fn explanation(&self) -> &'static str {
        "The response sensor's axes are turned against the axes that the file names: what is called X holds a little Y and \
         Z."
    }

    fn fingerprint(&self) -> &'static str {
        "Cross FRFs show the direct ones' peaks with the wrong size or sign; reciprocity fails; nothing shifts in \
         frequency."
    }

    fn background(&self) -> Background {
        Background {
            lab_check: "Set a machinist's square against the sensor. Turn the sensor by 180° about its mounting axis and repeat \
             one FRF: what changes sign and should not is misalignment. Swap hammer and sensor: reciprocal FRFs must \
             agree.",
            typical: "Sensors glued by eye: 2 to 10°. The sensor's own cross sensitivity (up to 5 % on most data sheets) looks \
             like 3°.",
            best_measured: "All nine FRFs of a point (three directions hit, three measured) at one posture; a \
             second posture tells a turned sensor from a wrong posture.",
            sources: &[
                EWINS,
                "ISO 7626-5: Vibration and shock – Experimental determination of mechanical mobility – Part 5: \
                 Measurements using impact excitation with an exciter which is not attached to the structure.",
            ],
        }
    }

    fn sites(&self, _robot: &RobotSpec) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    fn parameters(&self, _at: At, _known: &Known<Structure>) -> Vec<Parameter> {
        (0..3)
            .map(|i| Parameter {
                name: format!("rotation_vector_deg[{i}]"),
                unit: "deg",
                scale: Scale::Linear,
                nominal: 0.5,
                prior: Some(Prior { mean: 0.0, std: 8.0 }),
                bounds: [-45.0, 45.0],
            })
            .collect()
    }

    fn impossible(&self, _site: Site, _robot: &RobotSpec, sizes: &[Size]) -> Option<String> {
        let square = |f: fn(&Size) -> f64| sizes.iter().map(|s| f(s).powi(2)).sum::<f64>().sqrt();
        let angle = Size {
            value: square(|s| s.value),
            std: square(|s| s.std),
        };
        angle.outside(
            "an angle",
            [0.1, 45.0],
            (1.0, "°"),
            "no sensor is set more precisely, and every eye sees half a right angle",
        )
    }

    fn starts(&self, _at: At, _known: &Known<Structure>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        vec![vec![-3.0, 3.0, -3.0]]
    }

    fn usual_sizes(&self) -> &'static [UsualSize] {
        const {
            &[UsualSize::new(
                "rotation_vector_deg",
                SizeRange::Either(9.0),
                FollowsSize::Power(1.0),
            )]
        }
    }

    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0; 3])
    }

    fn distort(&self, values: &[Dual], filter: &mut ChannelFilter) {
        let v: Vec<Dual> = values.iter().map(|d| d.scale(1f64.to_radians())).collect();
        let square = |d: &Dual| d * d;
        let s = &(&square(&v[0]) + &square(&v[1])) + &square(&v[2]);
        let (a, b) = (sine_over_angle(&s), one_minus_cosine_over_square(&s));
        let zero = Dual::constant(0.0);
        let minus = |d: &Dual| d.scale(-1.0);
        // [v]×
        let w = [
            [zero.clone(), minus(&v[2]), v[1].clone()],
            [v[2].clone(), zero.clone(), minus(&v[0])],
            [minus(&v[1]), v[0].clone(), zero.clone()],
        ];
        // R = I + a [v]× + b [v]×² (Rodrigues); Rᵀ has −a.
        filter.mixing = [0, 1, 2].map(|i| {
            [0, 1, 2].map(|j| {
                let squared = (0..3).fold(zero.clone(), |sum, k| &sum + &(&w[i][k] * &w[k][j]));
                let unit = Dual::constant(if i == j { 1.0 } else { 0.0 });
                &(&unit + &(&b * &squared)) - &(&a * &w[i][j])
            })
        });
    }
}

/// Σ (−s)^k / (2k + first)!, term by term with its derivative: converges for every angle a sensor can have.
fn series(s: &Dual, first: usize) -> Dual {
    let (mut value, mut slope) = (0.0, 0.0);
    let mut factorial: f64 = (1..=first).map(|i| i as f64).product();
    for k in 0..12i32 {
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        value += sign * s.value.powi(k) / factorial;
        if k > 0 {
            slope += sign * f64::from(k) * s.value.powi(k - 1) / factorial;
        }
        let next = 2 * k as usize + first;
        factorial *= ((next + 1) * (next + 2)) as f64;
    }
    s.chain(value, slope)
}

/// sin φ / φ of s = φ².
fn sine_over_angle(s: &Dual) -> Dual {
    series(s, 1)
}

/// (1 − cos φ) / φ² of s = φ².
fn one_minus_cosine_over_square(s: &Dual) -> Dual {
    series(s, 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mixing_is_the_transposed_rotation() {
        let degrees = [10.0, -20.0, 5.0f64];
        let values: Vec<Dual> = degrees.iter().map(|d| Dual::constant(*d)).collect();
        let mut filter = ChannelFilter::faithful();
        SensorMisalignment.distort(&values, &mut filter);
        let v = nalgebra::Vector3::from(degrees.map(f64::to_radians));
        let rotation = nalgebra::Rotation3::new(v).into_inner().transpose();
        for i in 0..3 {
            for j in 0..3 {
                assert!((filter.mixing[i][j].value - rotation[(i, j)]).abs() < 1e-12);
            }
        }
    }

    /// By s = φ²: d(sin φ / φ)/ds = (φ cos φ − sin φ) / 2φ³, and d((1 − cos φ) / φ²)/ds = (φ sin φ − 2 (1 − cos φ)) / 2φ⁴.
    #[test]
    fn the_series_have_the_slopes_of_their_functions() {
        for phi in [0.2f64, 1.0, 2.0] {
            let s = Dual::variable(phi * phi, 0, 1);
            let (sin, cos) = phi.sin_cos();
            let first = sine_over_angle(&s);
            approx::assert_relative_eq!(first.value, sin / phi, max_relative = 1e-12);
            let slope = (phi * cos - sin) / (2.0 * phi.powi(3));
            approx::assert_relative_eq!(first.derivative(0), slope, max_relative = 1e-9);
            let second = one_minus_cosine_over_square(&s);
            approx::assert_relative_eq!(second.value, (1.0 - cos) / (phi * phi), max_relative = 1e-12);
            let slope = (phi * sin - 2.0 * (1.0 - cos)) / (2.0 * phi.powi(4));
            approx::assert_relative_eq!(second.derivative(0), slope, max_relative = 1e-9);
        }
    }
}
