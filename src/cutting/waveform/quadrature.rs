//! Gauss–Legendre quadrature.

use std::f64::consts::PI;
use std::sync::OnceLock;

/// Rules up to this many points are worked out once: fits ask for the same few again and again.
const KEPT: usize = 512;
type Rule = Vec<(f64, f64)>;
static RULES: [OnceLock<Rule>; KEPT] = [const { OnceLock::new() }; KEPT];

/// Nodes and weights for the integral over `[from, to]` with `count` points, exact for polynomials up to degree
/// 2 count − 1.
pub fn gauss_legendre(from: f64, to: f64, count: usize) -> Vec<(f64, f64)> {
    let n = count.max(1);
    let (centre, half) = (0.5 * (from + to), 0.5 * (to - from));
    let moved = |rule: &[(f64, f64)]| rule.iter().map(|(x, w)| (centre + half * x, half * w)).collect();
    match RULES.get(n) {
        Some(kept) => moved(kept.get_or_init(|| rule(n))),
        None => moved(&rule(n)),
    }
}

/// The rule over [−1, 1]: roots of the Legendre polynomial by Newton's method from Tricomi's estimates.
fn rule(n: usize) -> Rule {
    let mut nodes = Vec::with_capacity(n);
    for i in 0..n {
        let mut x = -(PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..100 {
            let (mut previous, mut value) = (1.0, x);
            for k in 2..=n {
                let k = k as f64;
                let next = ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k;
                previous = value;
                value = next;
            }
            if n == 1 {
                (previous, value) = (1.0, x);
            }
            slope = n as f64 * (x * value - previous) / (x * x - 1.0);
            let step = value / slope;
            x -= step;
            if step.abs() < 1e-15 {
                break;
            }
        }
        nodes.push((x, 2.0 / ((1.0 - x * x) * slope * slope)));
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_and_oscillations_are_integrated_exactly() {
        for n in [1, 2, 5, 40, KEPT - 1, KEPT] {
            let degree = 2 * n as i32 - 1;
            let sum: f64 = gauss_legendre(1.0, 3.0, n)
                .iter()
                .map(|(x, w)| w * x.powi(degree.min(20)))
                .sum();
            let d = degree.min(20) + 1;
            let exact = (3f64.powi(d) - 1.0) / f64::from(d);
            assert!((sum / exact - 1.0).abs() < 1e-12, "{n}: {sum} {exact}");
        }
        let sum: f64 = gauss_legendre(0.0, PI, 192)
            .iter()
            .map(|(x, w)| w * (97.0 * x).sin())
            .sum();
        assert!((sum - 2.0 / 97.0).abs() < 1e-11, "{sum}");
    }
}
