//! Average cutting forces, linear in the coefficients: milling (physics.md §4; Altintas, Manufacturing
//! Automation, 2nd ed., eqs 2.41–2.45, in axes with φ clockwise from +y), two-lip drilling (drilling.md), and turning (see
//! [`super::turning`]).

use std::f64::consts::PI;

use super::turning::{edge_row, engaged_edge};
use super::waveform::MillingCut;
use crate::campaign::{CutGeometry, Immersion, Process, Tool};
use crate::{Error, Result};

/// What is averaged and compared: the forces on the tool in tool axes (x feed, y normal, z axial; turning: x against the
/// feed, y away from the work, z along the cutting speed; N), and the torque about the spindle (N·m, opposing rotation positive).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceAxis {
    X,
    Y,
    Z,
    /// Torque.
    Mz,
}

impl ForceAxis {
    pub const ALL: [ForceAxis; 4] = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z, ForceAxis::Mz];

    pub fn index(self) -> usize {
        self as usize
    }

    pub fn label(self) -> &'static str {
        ["Fx", "Fy", "Fz", "Mz"][self.index()]
    }

    pub fn unit(self) -> &'static str {
        if self == ForceAxis::Mz { "N·m" } else { "N" }
    }

    /// The axes that carry the coefficients of a process.
    pub fn of(process: Process) -> &'static [ForceAxis] {
        match process {
            Process::Milling | Process::Turning => &[ForceAxis::X, ForceAxis::Y, ForceAxis::Z],
            Process::Drilling => &[ForceAxis::Z, ForceAxis::Mz],
        }
    }
}

/// One unknown of a force model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoefficientKind {
    /// Key in JSON, with unit.
    pub key: &'static str,
    pub label: &'static str,
    pub unit: &'static str,
    /// An edge coefficient (N/mm), else a cutting coefficient (N/mm²).
    pub edge: bool,
}

const fn cutting(key: &'static str, label: &'static str) -> CoefficientKind {
    CoefficientKind {
        key,
        label,
        unit: "N/mm²",
        edge: false,
    }
}

const fn edge(key: &'static str, label: &'static str) -> CoefficientKind {
    CoefficientKind {
        key,
        label,
        unit: "N/mm",
        edge: true,
    }
}

/// Ktc Krc Kac Kte Kre Kae: along the cutting speed, normal to the edge out of the work, along the edge away from the tip.
/// Turning has the same.
pub const MILLING_COEFFICIENTS: [CoefficientKind; 6] = [
    cutting("ktc_n_per_mm2", "Ktc"),
    cutting("krc_n_per_mm2", "Krc"),
    cutting("kac_n_per_mm2", "Kac"),
    edge("kte_n_per_mm", "Kte"),
    edge("kre_n_per_mm", "Kre"),
    edge("kae_n_per_mm", "Kae"),
];

/// Ktc Kte Kfc Kfe.
pub const DRILLING_COEFFICIENTS: [CoefficientKind; 4] = [
    cutting("ktc_n_per_mm2", "Ktc"),
    edge("kte_n_per_mm", "Kte"),
    cutting("kfc_n_per_mm2", "Kfc"),
    edge("kfe_n_per_mm", "Kfe"),
];

/// The unknowns of a process, in the order of the columns of [`average_row`].
pub fn coefficients_of(process: Process) -> &'static [CoefficientKind] {
    match process {
        Process::Milling | Process::Turning => &MILLING_COEFFICIENTS,
        Process::Drilling => &DRILLING_COEFFICIENTS,
    }
}

/// Row of the linear model: average force (N; torque N·m) on `axis` = row · coefficients, coefficients in
/// N/mm² and N/mm as [`coefficients_of`] lists them.
///
/// # Errors
/// Drilling with a tool whose point is not given, or a geometry that cuts nothing.
pub fn average_row(tool: &Tool, geometry: &CutGeometry, axis: ForceAxis) -> Result<Vec<f64>> {
    let row = match *geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm,
            axial_depth_mm,
            immersion,
        } if tool.has_straight_edge() => {
            milling_row(tool.teeth, feed_per_tooth_mm, axial_depth_mm, immersion, axis).to_vec()
        }
        CutGeometry::Milling { .. } => shaped_row(tool, geometry, axis),
        CutGeometry::Drilling { .. } => DrillGeometry::new(tool, geometry)?.row(axis).to_vec(),
        CutGeometry::Turning { .. } => edge_row(&engaged_edge(tool, geometry)?, axis).to_vec(),
    };
    if row.iter().all(|v| v.is_finite()) {
        Ok(row)
    } else {
        Err(Error::computation(
            "the geometry of the cut gives no finite force",
        ))
    }
}

/// physics.md §4, each bracket from entry to exit angle. Units mm, N; no torque.
fn milling_row(teeth: usize, feed_mm: f64, depth_mm: f64, immersion: Immersion, axis: ForceAxis) -> [f64; 6] {
    let (start, exit) = (immersion.start_rad, immersion.exit_rad);
    let over = |f: fn(f64) -> f64| f(exit) - f(start);
    let cos2 = over(|p| (2.0 * p).cos());
    let two_minus_sin2 = over(|p| 2.0 * p - (2.0 * p).sin());
    let (sin, cos, angle) = (over(f64::sin), over(f64::cos), over(|p| p));
    let n_a = teeth as f64 * depth_mm;
    let cut = n_a * feed_mm / (8.0 * PI);
    let edge = n_a / (2.0 * PI);
    match axis {
        ForceAxis::X => [
            cut * cos2,
            -cut * two_minus_sin2,
            0.0,
            -edge * sin,
            edge * cos,
            0.0,
        ],
        ForceAxis::Y => [
            cut * two_minus_sin2,
            cut * cos2,
            0.0,
            -edge * cos,
            -edge * sin,
            0.0,
        ],
        ForceAxis::Z => [0.0, 0.0, -edge * feed_mm * cos, 0.0, 0.0, edge * angle],
        ForceAxis::Mz => [0.0; 6],
    }
}

/// As [`milling_row`], of an edge that is not straight: the waveform's mean.
fn shaped_row(tool: &Tool, geometry: &CutGeometry, axis: ForceAxis) -> Vec<f64> {
    let Some(cut) = MillingCut::new(tool, geometry).filter(|_| axis != ForceAxis::Mz) else {
        return vec![0.0; MILLING_COEFFICIENTS.len()];
    };
    let unit = cut.closed_form(0);
    unit.iter().map(|forces| forces[axis.index()][0].re).collect()
}

/// A drill in a hole: lengths of drilling.md, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrillGeometry {
    pub lips: f64,
    pub radius_mm: f64,
    /// Where the lip begins: the pilot's radius, or the chisel's half length in the full.
    pub inner_radius_mm: f64,
    pub half_point_rad: f64,
    pub feed_per_rev_mm: f64,
}

/// Chisel edge angle of drilling.md, from which its half length follows.
const CHISEL_ANGLE_DEG: f64 = 125.0;

impl DrillGeometry {
    /// # Errors
    /// No point angle, no web thickness where the hole has no pilot, or a pilot as large as the drill.
    pub fn new(tool: &Tool, geometry: &CutGeometry) -> Result<DrillGeometry> {
        let CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm,
            ..
        } = *geometry
        else {
            return Err(Error::computation("not a drilling cut"));
        };
        let half_point_deg = tool.half_point_angle_deg.ok_or_else(|| {
            Error::computation("drilling needs [tool] half_point_angle_deg, which is not given")
        })?;
        let inner_radius_mm = if pilot_diameter_mm > 0.0 {
            0.5 * pilot_diameter_mm
        } else {
            let web = tool.web_thickness_mm.ok_or_else(|| {
                Error::computation("a hole without pilot needs [tool] web_thickness_mm, which is not given")
            })?;
            0.5 * web / CHISEL_ANGLE_DEG.to_radians().sin()
        };
        let radius_mm = 0.5 * tool.diameter_mm;
        if inner_radius_mm >= radius_mm {
            return Err(Error::computation(format!(
                "nothing left to drill: lips from {inner_radius_mm} mm to {radius_mm} mm"
            )));
        }
        Ok(DrillGeometry {
            lips: tool.teeth as f64,
            radius_mm,
            inner_radius_mm,
            half_point_rad: half_point_deg.to_radians(),
            feed_per_rev_mm,
        })
    }

    /// Chip thickness normal to the lip.
    pub fn chip_thickness_mm(&self) -> f64 {
        self.feed_per_rev_mm / self.lips * self.half_point_rad.sin()
    }

    /// Travel from first contact of the lips to full diameter.
    pub fn entry_travel_mm(&self) -> f64 {
        (self.radius_mm - self.inner_radius_mm) / self.half_point_rad.tan()
    }

    /// Thrust N (Kfc h + Kfe)(R − r0); torque N (Ktc h + Kte)(R² − r0²)/(2 sin κ)/1000.
    fn row(&self, axis: ForceAxis) -> [f64; 4] {
        let h = self.chip_thickness_mm();
        let (outer, inner) = (self.radius_mm, self.inner_radius_mm);
        match axis {
            ForceAxis::Z => {
                let thrust = self.lips * (outer - inner);
                [0.0, 0.0, thrust * h, thrust]
            }
            ForceAxis::Mz => {
                let torque =
                    self.lips * (outer * outer - inner * inner) / (2.0 * self.half_point_rad.sin()) / 1000.0;
                [torque * h, torque, 0.0, 0.0]
            }
            ForceAxis::X | ForceAxis::Y => [0.0; 4],
        }
    }
}

/// The diameter at which edge and work pass each other: the tool's, in turning the workpiece's; mm.
pub fn cut_diameter_mm(tool: &Tool, geometry: &CutGeometry) -> f64 {
    match *geometry {
        CutGeometry::Turning { diameter_mm, .. } => diameter_mm,
        _ => tool.diameter_mm,
    }
}

/// Speed at a diameter, m/min.
pub fn cutting_speed_m_per_min(diameter_mm: f64, spindle_rpm: f64) -> f64 {
    PI * diameter_mm * spindle_rpm / 1000.0
}

/// Feed that sets a cut apart from another: per tooth (milling) or per revolution (drilling, turning), mm.
pub fn feed_mm(geometry: &CutGeometry) -> f64 {
    match *geometry {
        CutGeometry::Milling {
            feed_per_tooth_mm, ..
        } => feed_per_tooth_mm,
        CutGeometry::Drilling { feed_per_rev_mm, .. } | CutGeometry::Turning { feed_per_rev_mm, .. } => {
            feed_per_rev_mm
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::campaign::ToolKind;
    use approx::assert_relative_eq;

    pub(crate) fn drill() -> Tool {
        Tool {
            kind: ToolKind::Drill,
            diameter_mm: 9.5,
            teeth: 2,
            helix_deg: 30.0,
            corner_radius_mm: 0.0,
            lead_angle_deg: 90.0,
            half_point_angle_deg: Some(67.5),
            web_thickness_mm: Some(1.425),
        }
    }

    /// Sums the slice forces of physics.md over one revolution and the helix, teeth and all.
    fn integrated(k: [f64; 6], teeth: usize, c: f64, a: f64, immersion: Immersion) -> [f64; 3] {
        let (turn_steps, slices) = (40_000, 7);
        let lag = 0.4; // rad of helix lag over the depth; must not matter to the average
        let mut sum = [0.0; 3];
        for i in 0..turn_steps {
            let turn = (i as f64 + 0.5) / turn_steps as f64 * 2.0 * PI;
            for tooth in 0..teeth {
                for slice in 0..slices {
                    let z = (slice as f64 + 0.5) / slices as f64;
                    let phi = (turn + 2.0 * PI * tooth as f64 / teeth as f64 - lag * z).rem_euclid(2.0 * PI);
                    if !(immersion.start_rad..immersion.exit_rad).contains(&phi) {
                        continue;
                    }
                    let (h, dz) = (c * phi.sin(), a / slices as f64);
                    let ft = (k[0] * h + k[3]) * dz;
                    let fr = (k[1] * h + k[4]) * dz;
                    let fa = (k[2] * h + k[5]) * dz;
                    sum[0] += -ft * phi.cos() - fr * phi.sin();
                    sum[1] += ft * phi.sin() - fr * phi.cos();
                    sum[2] += fa;
                }
            }
        }
        sum.map(|v| v / turn_steps as f64)
    }

    #[test]
    fn milling_averages_equal_the_integrated_slices_at_any_immersion() {
        let k = [930.0, 374.0, 219.0, 17.3, 16.5, -1.4];
        for (start_deg, exit_deg) in [
            (0.0, 90.0),
            (90.0, 180.0),
            (0.0, 180.0),
            (20.0, 75.0),
            (110.0, 171.0),
        ] {
            let immersion = Immersion {
                start_rad: f64::to_radians(start_deg),
                exit_rad: f64::to_radians(exit_deg),
            };
            let sum = integrated(k, 3, 0.12, 2.5, immersion);
            for (axis, expected) in ForceAxis::ALL.iter().zip(sum) {
                let row = milling_row(3, 0.12, 2.5, immersion, *axis);
                let force: f64 = row.iter().zip(k).map(|(r, k)| r * k).sum();
                assert!(
                    (force - expected).abs() < 2e-3 * 100.0,
                    "{start_deg}..{exit_deg} {axis:?}: {force} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_slot_gives_the_textbook_averages() {
        let (n, a, c) = (4.0, 2.0, 0.1);
        let row = |axis| milling_row(4, c, a, Immersion::SLOT, axis);
        let close = |got: [f64; 6], want: [f64; 6]| {
            for (g, w) in got.iter().zip(want) {
                assert_relative_eq!(*g, w, epsilon = 1e-12);
            }
        };
        close(
            row(ForceAxis::X),
            [0.0, -n * a / 4.0 * c, 0.0, 0.0, -n * a / PI, 0.0],
        );
        close(
            row(ForceAxis::Y),
            [n * a / 4.0 * c, 0.0, 0.0, n * a / PI, 0.0, 0.0],
        );
        close(
            row(ForceAxis::Z),
            [0.0, 0.0, n * a / PI * c, 0.0, 0.0, n * a / 2.0],
        );
    }

    #[test]
    fn drilling_equals_the_lip_integrals() {
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm: 0.2,
            pilot_diameter_mm: 3.5,
            hole_depth_mm: None,
        };
        let g = DrillGeometry::new(&drill(), &geometry).unwrap();
        let kappa = 67.5f64.to_radians();
        // Chip thickness f/N sin κ on lips of length (R − r0)/sin κ at mean radius (R + r0)/2.
        let h = 0.1 * kappa.sin();
        let lip = 3.0 / kappa.sin();
        let (ktc, kte, kfc, kfe) = (272.0, 5.7, 91.0, 3.9);
        let torque = 2.0 * (ktc * h + kte) * lip * 3.25 / 1000.0;
        let thrust = 2.0 * (kfc * h + kfe) * lip * kappa.sin();
        let force = |axis| -> f64 {
            g.row(axis)
                .iter()
                .zip([ktc, kte, kfc, kfe])
                .map(|(r, k)| r * k)
                .sum()
        };
        assert_relative_eq!(force(ForceAxis::Mz), torque, max_relative = 1e-12);
        assert_relative_eq!(force(ForceAxis::Z), thrust, max_relative = 1e-12);
        assert_relative_eq!(g.entry_travel_mm(), 3.0 / kappa.tan());
    }

    #[test]
    fn a_full_hole_starts_at_the_chisel_and_missing_geometry_is_said() {
        let full = CutGeometry::Drilling {
            feed_per_rev_mm: 0.2,
            pilot_diameter_mm: 0.0,
            hole_depth_mm: None,
        };
        // Half length in the truth file of a practice campaign with this tool.
        let g = DrillGeometry::new(&drill(), &full).unwrap();
        assert_relative_eq!(g.inner_radius_mm, 0.8698018944925375, max_relative = 1e-12);
        let blunt = Tool {
            web_thickness_mm: None,
            ..drill()
        };
        let error = DrillGeometry::new(&blunt, &full).unwrap_err().to_string();
        assert!(error.contains("web_thickness_mm"), "{error}");
    }
}
