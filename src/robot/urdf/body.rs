//! Rigid bodies held fast to each other taken as one.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

/// Mass, centre of mass and inertia tensor about it, all in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidBody {
    pub mass_kg: f64,
    pub com_m: Point3<f64>,
    pub inertia_kg_m2: Matrix3<f64>,
}

impl RigidBody {
    /// A body of no mass at the origin.
    pub fn none() -> Self {
        RigidBody {
            mass_kg: 0.0,
            com_m: Point3::origin(),
            inertia_kg_m2: Matrix3::zeros(),
        }
    }

    /// The same body in a frame in which its own one stands at `pose`.
    pub fn seen_from(&self, pose: &Isometry3<f64>) -> Self {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        RigidBody {
            mass_kg: self.mass_kg,
            com_m: pose * self.com_m,
            inertia_kg_m2: turned(&self.inertia_kg_m2, &rotation),
        }
    }

    /// Both as one body (parallel axes: J = Σ J_k + m_k (r·r 1 − r rᵀ) about the common centre of mass).
    pub fn with(&self, other: &RigidBody) -> Self {
        let mass_kg = self.mass_kg + other.mass_kg;
        let com_m = match mass_kg > 0.0 {
            true => Point3::from(
                (self.com_m.coords * self.mass_kg + other.com_m.coords * other.mass_kg) / mass_kg,
            ),
            false => self.com_m,
        };
        let about = |body: &RigidBody| body.inertia_kg_m2 + of_a_point(&(body.com_m - com_m), body.mass_kg);
        RigidBody {
            mass_kg,
            com_m,
            inertia_kg_m2: about(self) + about(other),
        }
    }
}

/// R J Rᵀ, kg·m². One half is worked out and stands in the other, too.
///
/// Written out and on its own: as a chain of matrix products rustc 1.95 (LLVM, `opt-level = 3`) once gave another (0, 1) here, depending
/// on what it was compiled with.
#[inline(never)]
fn turned(tensor: &Matrix3<f64>, rotation: &Matrix3<f64>) -> Matrix3<f64> {
    let mut out = Matrix3::zeros();
    for a in 0..3 {
        for b in a..3 {
            let mut sum = 0.0;
            for i in 0..3 {
                for k in 0..3 {
                    sum += rotation[(a, i)] * tensor[(i, k)] * rotation[(b, k)];
                }
            }
            out[(a, b)] = sum;
            out[(b, a)] = sum;
        }
    }
    out
}

/// m (r·r 1 − r rᵀ): the inertia of a point of mass `mass_kg` at `r_m`, kg·m².
#[inline(never)]
fn of_a_point(r_m: &Vector3<f64>, mass_kg: f64) -> Matrix3<f64> {
    let mut out = Matrix3::zeros();
    for a in 0..3 {
        for b in a..3 {
            let along = if a == b { r_m.norm_squared() } else { 0.0 };
            let value = mass_kg * (along - r_m[a] * r_m[b]);
            out[(a, b)] = value;
            out[(b, a)] = value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};

    /// A rod cut in two askew pieces is the whole rod: mL²/12 across, whatever the frames of the pieces.
    #[test]
    fn two_halves_are_the_whole_rod() {
        let (mass_kg, length_m) = (3.0, 1.2f64);
        let half = RigidBody {
            mass_kg: mass_kg / 2.0,
            com_m: Point3::new(0.0, 0.0, length_m / 4.0),
            inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0))
                * (mass_kg / 2.0 * (length_m / 2.0).powi(2) / 12.0),
        };
        let turn = UnitQuaternion::from_euler_angles(0.4, -1.1, 2.0);
        let first = Isometry3::from_parts(Translation3::new(0.3, 0.1, -0.7), turn);
        let second = first * Isometry3::translation(0.0, 0.0, length_m / 2.0);
        let whole = half.seen_from(&first).with(&half.seen_from(&second));
        let back = whole.seen_from(&first.inverse());
        let across = mass_kg * length_m * length_m / 12.0;
        assert!((back.com_m - Point3::new(0.0, 0.0, length_m / 2.0)).norm() < 1e-15);
        let expected = Matrix3::from_diagonal(&Vector3::new(across, across, 0.0));
        assert!((back.inertia_kg_m2 - expected).norm() < 1e-15);
        assert_eq!(whole.with(&RigidBody::none()).mass_kg, mass_kg);
    }
}
