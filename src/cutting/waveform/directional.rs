//! What a vibration of the tool does to the force: the directional matrix and its time variation.

use num_complex::Complex64;

use super::milling::MillingCut;

/// Fourier coefficients over the tooth-passing frequency, r = −`most`..=`most`, of the matrix that turns a change of the
/// chip's boundary (x, y; mm) into a force (x, y, z; N): `[r][axis][direction]`. r = 0 is the average of the
/// zero-order lobe theory (Altintas & Budak 1995). `cutting`: Ktc Krc Kac, N/mm².
pub fn directional_orders(cut: &MillingCut, cutting: [f64; 3], most: usize) -> Vec<[[Complex64; 2]; 3]> {
    let [kt, kr, ka] = cutting;
    let most = most as i64;
    (-most..=most)
        .map(|r| {
            let n = r * cut.teeth as i64;
            // The chip grows by Δx sin φ + Δy cos φ.
            let of = |value: &dyn Fn(f64, f64) -> f64| -> Complex64 { cut.immersion_integral(n, value) };
            let force = |along: fn(f64, f64) -> f64| {
                [
                    of(&|s, c| (-kt * c - kr * s) * along(s, c)),
                    of(&|s, c| (kt * s - kr * c) * along(s, c)),
                    of(&|s, c| ka * along(s, c)),
                ]
            };
            let (x, y) = (force(|s, _| s), force(|_, c| c));
            [0, 1, 2].map(|axis| [x[axis], y[axis]])
        })
        .collect()
}
