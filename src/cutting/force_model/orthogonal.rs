//! Cutting coefficients predicted from an orthogonal database (Budak, Altintas & Armarego, J. Manuf. Sci. Eng. 118,
//! 1996; Altintas, Manufacturing Automation, 2nd ed., §2.6): what a chip needs to be sheared, on an oblique edge.

use crate::cutting::cutting_trials::CuttingTrials;
use crate::cutting::fit::group::ForceGroup;
use crate::data::{ChipFormation, Process};

/// One oblique edge in a material known from orthogonal cutting. Angles in rad, stress in N/mm² (MPa).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObliqueEdge {
    /// τ, in the shear plane.
    pub shear_stress_n_per_mm2: f64,
    /// β_a, on the rake face, from orthogonal cuts.
    pub friction_angle_rad: f64,
    /// Shear angle or chip ratio.
    pub chip: ChipFormation,
    /// α_n, normal to the edge.
    pub rake_rad: f64,
    /// i; an end mill's helix angle. The chip flows at the same angle over the rake face (Stabler's rule, η = i).
    pub inclination_rad: f64,
}

/// Cutting coefficients of an oblique edge, N/mm².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObliqueCoefficients {
    /// Along the cutting speed.
    pub ktc_n_per_mm2: f64,
    /// Normal to the edge.
    pub krc_n_per_mm2: f64,
    /// Along the edge.
    pub kac_n_per_mm2: f64,
    /// φ_n.
    pub shear_angle_rad: f64,
}

impl ObliqueEdge {
    /// tan φ_n = r (cos η/cos i) cos α_n/(1 − r (cos η/cos i) sin α_n), r the chip ratio; tan β_n = tan β_a cos η; then
    /// Ktc = τ/sin φ_n · [cos(β_n − α_n) + tan i tan η sin β_n]/D, Krc = τ/(sin φ_n cos i) · sin(β_n − α_n)/D,
    /// Kac = τ/sin φ_n · [cos(β_n − α_n) tan i − tan η sin β_n]/D,
    /// D = √(cos²(φ_n + β_n − α_n) + tan² η sin² β_n) (the book's oblique transformation, η = i).
    /// `None` where the angles allow no chip (shear angle outside 0…90°, or no finite force).
    pub fn coefficients(&self) -> Option<ObliqueCoefficients> {
        let (alpha, i) = (self.rake_rad, self.inclination_rad);
        let eta = i;
        let phi = match self.chip {
            ChipFormation::ShearAngleRad(phi) => phi,
            ChipFormation::ChipRatio(r) => {
                let r = r * eta.cos() / i.cos();
                (r * alpha.cos()).atan2(1.0 - r * alpha.sin())
            }
        };
        let beta = (self.friction_angle_rad.tan() * eta.cos()).atan();
        let d = ((phi + beta - alpha).cos().powi(2) + (eta.tan() * beta.sin()).powi(2)).sqrt();
        let shear = self.shear_stress_n_per_mm2 / phi.sin() / d;
        let found = ObliqueCoefficients {
            ktc_n_per_mm2: shear * ((beta - alpha).cos() + i.tan() * eta.tan() * beta.sin()),
            krc_n_per_mm2: shear * (beta - alpha).sin() / i.cos(),
            kac_n_per_mm2: shear * ((beta - alpha).cos() * i.tan() - eta.tan() * beta.sin()),
            shear_angle_rad: phi,
        };
        let finite = found.ktc_n_per_mm2.is_finite()
            && found.krc_n_per_mm2.is_finite()
            && found.kac_n_per_mm2.is_finite();
        (finite && phi > 0.0 && phi < std::f64::consts::FRAC_PI_2).then_some(found)
    }
}

/// Predicted milling or turning coefficients next to those found from the cuts.
#[derive(Debug, Clone)]
pub struct OrthogonalPrediction {
    /// Of the cuts that it is compared with.
    pub material: Option<String>,
    /// From the orthogonal database.
    pub predicted: ObliqueCoefficients,
    /// Ktc, Krc, Kac: label, predicted, found (value, standard error), all N/mm².
    pub rows: Vec<(&'static str, f64, Option<f64>, Option<f64>)>,
}

/// From the orthogonal database, for the milled or turned cuts of its material; `None` without the database,
/// without such cuts, or where its angles allow no chip (then a warning says so).
pub(crate) fn predict(
    trials: &CuttingTrials,
    pooled: &[ForceGroup],
    warnings: &mut Vec<String>,
) -> Option<OrthogonalPrediction> {
    let table = trials.orthogonal?;
    let comparable = || pooled.iter().filter(|g| g.process != Process::Drilling);
    let group = match comparable().count() {
        1 => comparable().next(),
        _ => comparable().find(|g| g.material.is_some() && g.material.as_deref() == trials.material),
    };
    let Some(group) = group else {
        warnings.push(
            "[orthogonal] is not compared: it needs milled or turned cuts, of the material that [material] names"
                .into(),
        );
        return None;
    };
    let edge = ObliqueEdge {
        shear_stress_n_per_mm2: table.shear_stress_mpa,
        friction_angle_rad: table.friction_angle_deg.to_radians(),
        chip: table.chip,
        rake_rad: table.rake_deg.to_radians(),
        inclination_rad: table
            .inclination_deg
            .unwrap_or(trials.tool.helix_deg)
            .to_radians(),
    };
    let Some(predicted) = edge.coefficients() else {
        warnings.push(
            "[orthogonal]: these angles allow no chip; check chip ratio, rake and friction angle".into(),
        );
        return None;
    };
    let row = |label: &'static str, value: f64| {
        let found = group.coefficient(label);
        (
            label,
            value,
            found.and_then(|c| c.value),
            found.and_then(|c| c.std_error),
        )
    };
    Some(OrthogonalPrediction {
        material: group.material.clone(),
        rows: vec![
            row("Ktc", predicted.ktc_n_per_mm2),
            row("Krc", predicted.krc_n_per_mm2),
            row("Kac", predicted.kac_n_per_mm2),
        ],
        predicted,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Ti6Al4V (docs/physics.md, "Reference cases"): α_n = 12°, i = η = 30°, h = 0.05 mm give Ktc 1510, Krc 215, Kac 515 N/mm², φ_n 39.03°.
    #[test]
    fn the_published_orthogonal_database_gives_the_reference_coefficients() {
        let rake_deg = 12.0;
        let edge = ObliqueEdge {
            shear_stress_n_per_mm2: 613.0,
            friction_angle_rad: f64::to_radians(19.1 + 0.29 * rake_deg),
            chip: ChipFormation::ChipRatio(
                (1.755 - 0.028 * rake_deg) * 0.05f64.powf(0.331 - 0.0082 * rake_deg),
            ),
            rake_rad: f64::to_radians(rake_deg),
            inclination_rad: f64::to_radians(30.0),
        };
        let k = edge.coefficients().unwrap();
        // As many figures as the reference prints.
        assert!((k.ktc_n_per_mm2 - 1510.0).abs() < 0.5, "{k:?}");
        assert!((k.krc_n_per_mm2 - 215.0).abs() < 0.5, "{k:?}");
        assert!((k.kac_n_per_mm2 - 515.0).abs() < 0.5, "{k:?}");
        assert!((k.shear_angle_rad.to_degrees() - 39.03).abs() < 0.005, "{k:?}");
    }

    /// Without inclination it is Merchant's circle: forces τ/sin φ · cos, sin(β − α)/cos(φ + β − α), nothing axial.
    #[test]
    fn no_inclination_is_merchants_circle() {
        let (tau, beta, alpha, phi) = (400.0, 0.5f64, 0.1, 0.45f64);
        let edge = ObliqueEdge {
            shear_stress_n_per_mm2: tau,
            friction_angle_rad: beta,
            chip: ChipFormation::ShearAngleRad(phi),
            rake_rad: alpha,
            inclination_rad: 0.0,
        };
        let k = edge.coefficients().unwrap();
        let circle = tau / phi.sin() / (phi + beta - alpha).cos();
        assert_relative_eq!(
            k.ktc_n_per_mm2,
            circle * (beta - alpha).cos(),
            max_relative = 1e-12
        );
        assert_relative_eq!(
            k.krc_n_per_mm2,
            circle * (beta - alpha).sin(),
            max_relative = 1e-12
        );
        assert_eq!(k.kac_n_per_mm2, 0.0);
        let folded = ObliqueEdge {
            chip: ChipFormation::ShearAngleRad(0.0),
            ..edge
        };
        assert_eq!(folded.coefficients(), None);
    }
}
