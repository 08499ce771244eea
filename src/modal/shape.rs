//! Mode shapes: likeness and complexity.

use nalgebra::DMatrix;
use num_complex::Complex64;

/// Modal assurance criterion |φᴴψ|²/(φᴴφ ψᴴψ), 0..1 (Allemang & Brown 1982). Zero where either is all zero.
pub fn mac(a: &[Complex64], b: &[Complex64]) -> f64 {
    let inner: Complex64 = a.iter().zip(b).map(|(a, b)| a.conj() * b).sum();
    let (aa, bb): (f64, f64) = (
        a.iter().map(|a| a.norm_sqr()).sum(),
        b.iter().map(|b| b.norm_sqr()).sum(),
    );
    let product = aa * bb;
    if product > 0.0 && product.is_finite() {
        (inner.norm_sqr() / product).min(1.0)
    } else {
        0.0
    }
}

/// Mode complexity.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Complexity {
    /// Modal phase collinearity, 0..1: 1 where all degrees of freedom move in phase or against it (Juang & Pappa 1985).
    pub mpc: f64,
    /// Mean phase deviation from the best line, degrees (weighted with the magnitude).
    pub mpd_deg: f64,
}

/// Below this phase collinearity a mode is called complex.
pub const COLLINEAR: f64 = 0.9;

impl Complexity {
    /// Whether the shape is a standing wave as good as any measured one: MPC of [`COLLINEAR`] or more.
    pub fn is_low(&self) -> bool {
        self.mpc < COLLINEAR
    }
}

/// Direction of the line in the complex plane that a shape lies along best, radians.
pub fn principal_angle(shape: &[Complex64]) -> f64 {
    let (along, across) = shape.iter().fold((0.0, 0.0), |(a, b), z| {
        (a + z.re * z.re - z.im * z.im, b + z.re * z.im)
    });
    0.5 * (2.0 * across).atan2(along)
}

/// A component as far as it is known, shrunk by |A|²/(|A|² + σ²): what one FRF does not determine must not decide on the phases or the
/// shape of all.
pub fn as_known(value: Complex64, std: f64) -> Complex64 {
    let square = value.norm_sqr();
    value * (square / (square + std * std).max(f64::MIN_POSITIVE))
}

/// Complexity of a shape; `None` for fewer than two degrees of freedom (one is always collinear with itself).
pub fn complexity(shape: &[Complex64]) -> Option<Complexity> {
    if shape.len() < 2 {
        return None;
    }
    let (sxx, syy, sxy) = shape.iter().fold((0.0, 0.0, 0.0), |(xx, yy, xy), z| {
        (xx + z.re * z.re, yy + z.im * z.im, xy + z.re * z.im)
    });
    let total: f64 = sxx + syy;
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mpc = ((sxx - syy).powi(2) + 4.0 * sxy * sxy) / (total * total);
    // Principal direction of the cloud in the complex plane.
    let direction = principal_angle(shape);
    let (mut sum, mut weight) = (0.0, 0.0);
    for z in shape {
        let size = z.norm();
        if size > 0.0 {
            let along = (z * Complex64::from_polar(1.0, -direction)).re.abs() / size;
            sum += size * along.min(1.0).acos();
            weight += size;
        }
    }
    Some(Complexity {
        mpc: mpc.clamp(0.0, 1.0),
        mpd_deg: (sum / weight).to_degrees(),
    })
}

/// Shape (by response) of a mode from its residues at all responses and references: the dominant left singular
/// vector of the residue matrix times its singular value, so that noise in weakly excited references counts little.
/// The largest component is turned real. `residues[(response, reference)]`.
pub fn from_residues(residues: &DMatrix<Complex64>) -> Option<Vec<Complex64>> {
    if residues.is_empty() || residues.iter().any(|r| !r.re.is_finite() || !r.im.is_finite()) {
        return None;
    }
    let svd = residues.clone().svd(true, false);
    let best = svd.singular_values.imax();
    let u = svd.u?;
    let shape: Vec<Complex64> = u
        .column(best)
        .iter()
        .map(|u| u * svd.singular_values[best])
        .collect();
    Some(normalised(&shape))
}

/// Scaled so that the largest component is 1.
pub fn normalised(shape: &[Complex64]) -> Vec<Complex64> {
    let Some(largest) = shape.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm())) else {
        return Vec::new();
    };
    if largest.norm() > 0.0 {
        shape.iter().map(|z| z / largest).collect()
    } else {
        shape.to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(values: &[(f64, f64)]) -> Vec<Complex64> {
        values.iter().map(|&(re, im)| Complex64::new(re, im)).collect()
    }

    #[test]
    fn scale_and_phase_do_not_change_the_mac() {
        let a = shape(&[(1.0, 0.0), (-0.5, 0.2), (0.3, 0.0)]);
        let b: Vec<Complex64> = a.iter().map(|z| z * Complex64::new(0.3, -2.0)).collect();
        approx::assert_relative_eq!(mac(&a, &b), 1.0, max_relative = 1e-12);
        let orthogonal = mac(
            &shape(&[(1.0, 0.0), (1.0, 0.0)]),
            &shape(&[(1.0, 0.0), (-1.0, 0.0)]),
        );
        assert!(orthogonal < 1e-15);
        assert_eq!(mac(&shape(&[(0.0, 0.0)]), &shape(&[(1.0, 0.0)])), 0.0);
    }

    #[test]
    fn a_turned_real_shape_is_collinear_and_a_travelling_wave_is_not() {
        let real = shape(&[(1.0, 1.0), (-0.5, -0.5), (0.2, 0.2)]);
        let found = complexity(&real).unwrap();
        approx::assert_relative_eq!(found.mpc, 1.0, max_relative = 1e-12);
        assert!(found.mpd_deg < 1e-4);
        let wave = complexity(&shape(&[(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])).unwrap();
        assert!(wave.mpc < 1e-12 && wave.mpd_deg > 40.0, "{wave:?}");
        assert!(complexity(&shape(&[(1.0, 0.0)])).is_none());
    }

    #[test]
    fn the_shape_of_rank_one_residues_is_their_column() {
        let phi = [1.0, -0.5, 0.25];
        let psi = [0.3, 2.0];
        let residues = DMatrix::from_fn(3, 2, |i, j| Complex64::new(0.0, phi[i] * psi[j]));
        let found = from_residues(&residues).unwrap();
        for (found, expected) in found.iter().zip(phi) {
            approx::assert_relative_eq!(found.re, expected, epsilon = 1e-12);
        }
    }
}
