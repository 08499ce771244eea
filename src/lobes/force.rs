//! What the cut does: force per width of cut and per displacement change, for each process.

use std::f64::consts::PI;

use crate::campaign::Immersion;
use crate::{Error, Result};

/// F = b D Δr on the tool, averaged over a revolution. Δr is the displacement now minus that one tooth earlier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegenerativeForce {
    /// D, N/m²: force (N) per width of cut b (m) and displacement change (m). Row = force, column = displacement. In the
    /// axial–torsional block the second row is a torque (N·m) and the second column a turn (rad).
    pub matrix_n_per_m2: [[f64; 2]; 2],
    /// Teeth or lips N; the delay is T = 60/(N n).
    pub teeth: usize,
}

impl RegenerativeForce {
    /// Milling with averaged directional coefficients, D = (Ktc/2) (N/2π) \[α\] in x (feed) and y (normal):
    /// Altintas & Budak (1995), "Analytical prediction of stability lobes in milling", Annals of the CIRP 44(1),
    /// eqs 10–12. b is the axial depth of cut. Coefficients in N/mm².
    ///
    /// # Errors
    /// Where a coefficient is not finite, Ktc is not positive, there is no tooth, or the immersion is empty.
    pub fn milling_zero_order(
        ktc_n_per_mm2: f64,
        krc_n_per_mm2: f64,
        teeth: usize,
        immersion: Immersion,
    ) -> Result<Self> {
        let ktc = checked_ktc(ktc_n_per_mm2, krc_n_per_mm2, teeth)?;
        let Immersion { start_rad, exit_rad } = immersion;
        if !(start_rad.is_finite() && exit_rad.is_finite() && exit_rad > start_rad) {
            return Err(Error::computation(format!(
                "milling lobes: the immersion from {start_rad} to {exit_rad} rad holds no cut"
            )));
        }
        let alpha = milling_directional_coefficients(krc_n_per_mm2 / ktc_n_per_mm2, immersion);
        let factor = 0.5 * ktc * teeth as f64 / (2.0 * PI);
        Ok(RegenerativeForce {
            matrix_n_per_m2: alpha.map(|row| row.map(|a| factor * a)),
            teeth,
        })
    }

    /// Drilling, lateral block: D = −N Ktc B0 with B0 = 1/(2 tan κ) [[k_rc, 1], [−1, k_rc]], k_rc = Krc/Ktc.
    /// Roukema & Altintas (2007), "Generalized modeling of drilling vibrations", Int. J. Machine Tools &
    /// Manufacture 47(9): Part I pp. 1455–1473 (forces), Part II pp. 1474–1485 (stability).
    ///
    /// Why the matrix is so: a sideways displacement u along a lip of half point angle κ moves the edge by
    /// u cos κ along its normal; over the lip length b/sin κ that is a chip area u b/tan κ, with b the *radial*
    /// width of cut, (diameter − pilot diameter)/2. Averaging cos² and sin² over a turn gives the ½, summing the
    /// N lips the N (they write 2, the twist drill).
    ///
    /// Coefficients in N/mm², κ the half point angle in rad.
    ///
    /// # Errors
    /// Where a coefficient is not finite, Ktc is not positive, there is no lip, or κ is outside (0, π/2).
    pub fn drilling_lateral(
        ktc_n_per_mm2: f64,
        krc_n_per_mm2: f64,
        half_point_angle_rad: f64,
        teeth: usize,
    ) -> Result<Self> {
        let ktc = checked_ktc(ktc_n_per_mm2, krc_n_per_mm2, teeth)?;
        if !(half_point_angle_rad > 0.0 && half_point_angle_rad < PI / 2.0) {
            return Err(Error::computation(format!(
                "drilling lobes: the half point angle must lie between 0 and 90°, not {}°",
                half_point_angle_rad.to_degrees()
            )));
        }
        let krc = krc_n_per_mm2 / ktc_n_per_mm2;
        let factor = -(teeth as f64) * ktc / (2.0 * half_point_angle_rad.tan());
        Ok(RegenerativeForce {
            matrix_n_per_m2: [[factor * krc, factor], [-factor, factor * krc]],
            teeth,
        })
    }
}

impl RegenerativeForce {
    /// Turning with a straight edge at κr: D = −(Krc/sin κr) n nᵀ, n = (sin κr, cos κr) in x (against the feed) and y (away
    /// from the work); b is the depth of cut.
    ///
    /// Why the matrix is so: a tool that is pushed out by Δr along the edge's normal n leaves a chip thinner by n·Δr, on an
    /// edge of length b/sin κr, and the force normal to the edge falls by Krc times that. The tangential force stands across
    /// the plane and the force along the edge is left out, so that the limit is that of orthogonal cutting along the normal,
    /// b = −sin κr/(2 Krc Re G) (Tlusty & Polacek 1963; Altintas, Manufacturing Automation, 2nd ed., §4.2).
    ///
    /// Coefficient in N/mm², κr in rad.
    ///
    /// # Errors
    /// Where Krc is not positive and finite, or κr is outside (0, π).
    pub fn turning(krc_n_per_mm2: f64, kappa_rad: f64) -> Result<Self> {
        if !(krc_n_per_mm2 > 0.0 && krc_n_per_mm2.is_finite()) {
            return Err(Error::computation(format!(
                "turning lobes need a positive Krc, the force normal to the edge, not {krc_n_per_mm2} N/mm²"
            )));
        }
        let (sin, cos) = kappa_rad.sin_cos();
        if !(kappa_rad > 0.0 && sin > 0.0) {
            return Err(Error::computation(format!(
                "turning lobes: the cutting edge angle must lie between 0 and 180°, not {}°",
                kappa_rad.to_degrees()
            )));
        }
        let factor = -1e6 * krc_n_per_mm2 / sin;
        Ok(RegenerativeForce {
            matrix_n_per_m2: [
                [factor * sin * sin, factor * sin * cos],
                [factor * sin * cos, factor * cos * cos],
            ],
            teeth: 1,
        })
    }

    /// Drilling, axial–torsional block, displacements along the tool into the workpiece (m) and turns in the sense of the
    /// rotation (rad), forces in the same sense:
    ///
    /// D = −N [[Kac, −c Kac], [Ktc R_t, −c Ktc R_t]], c = f/2π.
    ///
    /// Why the matrix is so: a lip that moves by Δz deeper than the one before, while the drill turns by Δθ ahead, cuts a
    /// chip h_z = f/N + Δz − (f/2π) Δθ thick along the axis (turning ahead it comes to the same place sooner, by Δθ of feed).
    /// Over the radial width b of N lips that is a chip area N b h_z, which pushes back with Kac = Kfc sin κ along the axis
    /// and Ktc at the arm R_t against the rotation: the thrust and torque of the baseline (see
    /// [`crate::cutting::DrillGeometry`]), and so the limit comes from the coefficients that were measured. R_t is the mean
    /// radius of the lips, (R + r₀)/2, so the limit is exact where it equals the width of that hole: the hole is stable
    /// exactly if the limit is above its width.
    ///
    /// Roukema & Altintas (2007, see [`drilling_lateral`](Self::drilling_lateral)) have (1 − k_rc) R_t in the second row
    /// and count θ against the rotation. The radial force of a lip that points to the axis makes no torque, so we leave its
    /// share out. R_t is a radius by its dimension and use: the thesis's word "diameter" for it is a slip, the 8 mm it
    /// lists is half of its 16 mm tool.
    ///
    /// Coefficients in N/mm²; `arm_m` and `feed_per_rev_m` may be zero where the torque or the turn do not matter.
    ///
    /// # Errors
    /// Where a coefficient is not finite, Ktc or Kac is not positive, the arm or feed is negative, or there is no lip.
    pub fn drilling_axial_torsional(
        ktc_n_per_mm2: f64,
        kac_n_per_mm2: f64,
        arm_m: f64,
        feed_per_rev_m: f64,
        teeth: usize,
    ) -> Result<Self> {
        let ktc = checked_ktc(ktc_n_per_mm2, 0.0, teeth)?;
        let right = |v: f64| v >= 0.0 && v.is_finite();
        if !(kac_n_per_mm2 > 0.0 && right(kac_n_per_mm2) && right(arm_m) && right(feed_per_rev_m)) {
            return Err(Error::computation(format!(
                "axial and torsional lobes need a positive Kac, an arm and a feed, not {kac_n_per_mm2} N/mm², {arm_m} m and \
                 {feed_per_rev_m} m per revolution"
            )));
        }
        let lips = teeth as f64;
        let thinner = feed_per_rev_m / (2.0 * PI);
        let (thrust, torque) = (-lips * kac_n_per_mm2 * 1e6, -lips * ktc * arm_m);
        Ok(RegenerativeForce {
            matrix_n_per_m2: [[thrust, -thinner * thrust], [torque, -thinner * torque]],
            teeth,
        })
    }
}

/// Checks what all processes share and gives Ktc in N/m².
fn checked_ktc(ktc_n_per_mm2: f64, krc_n_per_mm2: f64, teeth: usize) -> Result<f64> {
    if !(ktc_n_per_mm2 > 0.0 && ktc_n_per_mm2.is_finite() && krc_n_per_mm2.is_finite()) {
        return Err(Error::computation(format!(
            "lobes need a positive Ktc and a finite Krc, not {ktc_n_per_mm2} and {krc_n_per_mm2} N/mm²"
        )));
    }
    if teeth == 0 {
        return Err(Error::computation("lobes need a tool with at least one tooth"));
    }
    Ok(ktc_n_per_mm2 * 1e6)
}

/// \[\[αxx, αxy\], \[αyx, αyy\]\]: Altintas & Budak (1995) eq. 11, for Kr = Krc/Ktc; angles from +y, clockwise.
pub fn milling_directional_coefficients(kr: f64, immersion: Immersion) -> [[f64; 2]; 2] {
    let primitive = |phi: f64| {
        let (s, c) = (2.0 * phi).sin_cos();
        [
            [
                0.5 * (c - 2.0 * kr * phi + kr * s),
                0.5 * (-s - 2.0 * phi + kr * c),
            ],
            [
                0.5 * (-s + 2.0 * phi + kr * c),
                0.5 * (-c - 2.0 * kr * phi - kr * s),
            ],
        ]
    };
    let (exit, start) = (primitive(immersion.exit_rad), primitive(immersion.start_rad));
    std::array::from_fn(|i| std::array::from_fn(|j| exit[i][j] - start[i][j]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn slot_coefficients_have_their_closed_form() {
        let kr = 0.37;
        let a = milling_directional_coefficients(kr, Immersion::SLOT);
        assert_relative_eq!(a[0][0], -PI * kr, epsilon = 1e-12);
        assert_relative_eq!(a[1][1], -PI * kr, epsilon = 1e-12);
        assert_relative_eq!(a[0][1], -PI, epsilon = 1e-12);
        assert_relative_eq!(a[1][0], PI, epsilon = 1e-12);
    }

    /// Against the definition: the mean over immersion of the force that a chip Δx sin φ + Δy cos φ makes.
    #[test]
    fn milling_matrix_is_the_average_of_the_tooth_forces() {
        let (ktc, krc, teeth) = (800.0, 250.0, 4);
        let immersion = Immersion {
            start_rad: 0.4,
            exit_rad: 2.1,
        };
        let force = RegenerativeForce::milling_zero_order(ktc, krc, teeth, immersion).unwrap();
        let steps = 20_000;
        let dphi = (immersion.exit_rad - immersion.start_rad) / steps as f64;
        let mut mean = [[0.0; 2]; 2];
        for i in 0..steps {
            let (s, c) = (immersion.start_rad + (i as f64 + 0.5) * dphi).sin_cos();
            for (j, chip) in [s, c].into_iter().enumerate() {
                let (ft, fr) = (ktc * 1e6 * chip, krc * 1e6 * chip);
                mean[0][j] += (-ft * c - fr * s) * dphi * teeth as f64 / (2.0 * PI);
                mean[1][j] += (ft * s - fr * c) * dphi * teeth as f64 / (2.0 * PI);
            }
        }
        for (got, expected) in force.matrix_n_per_m2.iter().flatten().zip(mean.iter().flatten()) {
            assert_relative_eq!(got, expected, max_relative = 1e-6);
        }
    }

    #[test]
    fn drilling_matrix_is_minus_two_ktc_b0_for_two_lips() {
        let force = RegenerativeForce::drilling_lateral(1000.0, 600.0, 1.178, 2).unwrap();
        let b0 = 1.0 / (2.0 * 1.178f64.tan());
        assert_relative_eq!(
            force.matrix_n_per_m2[0][0],
            -2.0 * 1e9 * 0.6 * b0,
            max_relative = 1e-12
        );
        assert_relative_eq!(force.matrix_n_per_m2[0][1], -2.0 * 1e9 * b0, max_relative = 1e-12);
        assert_relative_eq!(force.matrix_n_per_m2[1][0], 2.0 * 1e9 * b0, max_relative = 1e-12);
    }

    #[test]
    fn impossible_cuts_are_refused() {
        assert!(RegenerativeForce::drilling_lateral(1000.0, 600.0, 1.6, 2).is_err());
        assert!(RegenerativeForce::drilling_lateral(-1000.0, 600.0, 1.0, 2).is_err());
        assert!(RegenerativeForce::drilling_lateral(1000.0, f64::NAN, 1.0, 2).is_err());
        assert!(RegenerativeForce::milling_zero_order(1000.0, 0.0, 0, Immersion::SLOT).is_err());
        let empty = Immersion {
            start_rad: 1.0,
            exit_rad: 1.0,
        };
        assert!(RegenerativeForce::milling_zero_order(1000.0, 0.0, 2, empty).is_err());
    }
}
