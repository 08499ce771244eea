//! The speed at which a cut may be deepest although neither speed nor frequencies are known exactly, over a whole range
//! of speeds at little cost.

use serde::Serialize;

use super::curve::SpeedLimit;
use super::optimum::SPEED_MARGIN;

/// Steps of speed within the margin on either side.
const STEPS_PER_MARGIN: usize = 2;

/// A speed and the least limit within ±2 % of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BestSpeed {
    /// Spindle speed, rpm.
    pub spindle_rpm: f64,
    /// `None`: nothing limits the cut there.
    pub depth_mm: Option<f64>,
}

/// The best speed of a range (rpm, from ≤ to) on a geometric grid of 1 %: the greatest of the least limits within
/// ±[`SPEED_MARGIN`]. Of equal ones the slowest. The limits of each speed are found once.
pub fn best_speed(method: &dyn SpeedLimit, [from_rpm, to_rpm]: [f64; 2]) -> BestSpeed {
    let step = (1.0 + SPEED_MARGIN).powf(1.0 / STEPS_PER_MARGIN as f64);
    let inside = 1 + ((to_rpm / from_rpm).ln() / step.ln() + 1e-9).floor().max(0.0) as usize;
    let speed = |i: usize| from_rpm * step.powi(i as i32 - STEPS_PER_MARGIN as i32);
    let limits: Vec<f64> = (0..inside + 2 * STEPS_PER_MARGIN)
        .map(|i| method.limit_at(speed(i)).map_or(f64::INFINITY, |l| l.depth_mm))
        .collect();
    let mut best = (from_rpm, f64::NEG_INFINITY);
    for (i, around) in limits.windows(2 * STEPS_PER_MARGIN + 1).enumerate() {
        let least = around.iter().copied().fold(f64::INFINITY, f64::min);
        if least > best.1 {
            best = (speed(i + STEPS_PER_MARGIN), least);
        }
    }
    BestSpeed {
        spindle_rpm: best.0,
        depth_mm: best.1.is_finite().then_some(best.1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::curve::Limit;

    /// A needle of a tip at 500 rpm, narrower than the margin, next to a broad hill about 800 rpm.
    struct Needle {
        free_from_rpm: f64,
    }

    impl SpeedLimit for Needle {
        fn limit_at(&self, n: f64) -> Option<Limit> {
            let depth_mm = match n {
                n if n >= self.free_from_rpm => return None,
                n if (n / 500.0 - 1.0).abs() < 0.008 => 50.0,
                n => 1.0 + 4.0 * (-((n - 800.0) / 100.0).powi(2)).exp(),
            };
            Some(Limit {
                depth_mm,
                chatter_hz: 10.0,
                lobe: 0,
            })
        }
    }

    #[test]
    fn a_broad_hill_beats_a_needle() {
        let limited = Needle {
            free_from_rpm: f64::INFINITY,
        };
        let best = best_speed(&limited, [100.0, 1500.0]);
        assert!((best.spindle_rpm / 800.0 - 1.0).abs() < 0.011, "{best:?}");
        // 2 to 3 % off the top, worked out by hand: 1 + 4 exp(−0.0625) at 25 rpm.
        let depth = best.depth_mm.unwrap();
        assert!(depth > 4.7 && depth < 4.95, "{best:?}");
        let one = best_speed(&limited, [800.0, 800.0]);
        assert_eq!(one.spindle_rpm, 800.0);
        let least = 1.0 + 4.0 * (-(0.16f64.powi(2))).exp();
        assert!((one.depth_mm.unwrap() - least).abs() < 1e-9, "{one:?}");
    }

    #[test]
    fn an_unlimited_speed_is_the_best_and_has_no_depth() {
        let free = Needle {
            free_from_rpm: 1000.0,
        };
        let best = best_speed(&free, [100.0, 1500.0]);
        assert!(
            best.depth_mm.is_none() && best.spindle_rpm > 1000.0 && best.spindle_rpm < 1045.0,
            "{best:?}"
        );
    }
}
