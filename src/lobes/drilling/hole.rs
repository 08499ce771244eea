//! The hole itself: how far the static cutting forces push and tilt the tool, against what the hole may be off by.
//!
//! The forces of a cut at full engagement load the robot's static compliance at the tool point: the part of the
//! displacement normal to the tool axis is the hole's position error, the turn of the axis its error of perpendicularity
//! (small angles). Vibration, friction (lost motion) and the robot's own positioning errors come on top.

use nalgebra::{Matrix2, Matrix6, Vector3, Vector6};

use crate::campaign::{CutGeometry, Tool};
use crate::lobes::band::QUANTILES;
use crate::lobes::drilling::contact::ContactForce;
use crate::lobes::drilling::iso_tolerance::DiameterTolerance;
use crate::lobes::dynamics::robot::lobe_axes;
use crate::robot::CompensatedPose;
use crate::robot::static_deflection::wrench;
use crate::statistics::quantile;

/// Static forces on the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct HoleLoad {
    /// Against the tool, away from the workpiece.
    pub thrust_n: f64,
    /// About the tool axis, against the rotation.
    pub torque_nm: f64,
    /// Across the tool axis: the radial imbalance of a drill, which turns with it, or the mean force of a milling cutter,
    /// which turns with the feed. It counts in the direction that does most harm.
    pub lateral_n: f64,
    /// For people: where these come from.
    pub source: String,
}

impl HoleLoad {
    /// Thrust and torque alone.
    pub fn without_lateral(&self) -> HoleLoad {
        HoleLoad {
            lateral_n: 0.0,
            ..self.clone()
        }
    }
}

/// What a hole may be off by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleTolerance {
    /// Normal to the tool axis, mm.
    pub position_mm: f64,
    /// Turn of the tool axis, degrees.
    pub perpendicularity_deg: f64,
    /// Of the diameter; `None`: it is not judged.
    pub diameter: Option<DiameterTolerance>,
}

/// What loads the tool and what the hole may be off by.
#[derive(Debug, Clone, PartialEq)]
pub struct HoleCheck {
    /// Static forces on the tool.
    pub load: HoleLoad,
    /// What the hole may be off by.
    pub tolerance: HoleTolerance,
}

/// A value and what the uncertainty of the model's parameters makes of it; `None` without a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// At the model's nominal parameters.
    pub value: f64,
    /// Standard deviation over the draws.
    pub std: Option<f64>,
    /// 95 % quantile.
    pub upper: Option<f64>,
}

impl Uncertain {
    fn new(value: f64, drawn: Vec<f64>) -> Self {
        let n = drawn.len() as f64;
        let mean = drawn.iter().sum::<f64>() / n;
        let variance = drawn.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Uncertain {
            value,
            std: (drawn.len() > 1).then(|| variance.sqrt()),
            upper: quantile(drawn, QUANTILES[1]),
        }
    }

    /// What is held against a tolerance: the upper bound, the value itself where nothing is known of its uncertainty.
    pub fn bound(&self) -> f64 {
        self.upper.unwrap_or(self.value)
    }

    /// By how much the bound exceeds the value, as a factor.
    fn allowance(&self) -> f64 {
        if self.value > 0.0 {
            self.bound() / self.value
        } else {
            1.0
        }
    }
}

/// What the load does at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct HoleError {
    /// Of the tool point, base axes, with the lateral force where it does the position most harm.
    pub displacement_mm: [f64; 3],
    /// Part of it along the tool axis, positive into the workpiece.
    pub axial_mm: f64,
    /// Part of it normal to the tool axis.
    pub position_mm: Uncertain,
    /// Turn of the tool axis, with the lateral force where it tilts most.
    pub tilt_deg: Uncertain,
    /// How much wider than the drill the lateral force makes the hole, as it turns with the drill.
    pub oversize_mm: Uncertain,
    /// What the contacts take of the load; empty without contacts.
    pub contacts: Vec<ContactForce>,
    /// How far the tool point skates while the foot is pressed on, if only the free robot holds it; `None` without an axial
    /// contact that says its preload.
    pub skating_mm: Option<f64>,
    /// The pose to command so that the tool stands where it should under thrust and torque, or in words why there is none;
    /// `None` where nobody asked.
    pub compensation: Option<std::result::Result<CompensatedPose, String>>,
}

impl HoleError {
    /// `drawn`: the same place with parameters drawn from their uncertainty; may be empty.
    pub fn new(nominal: &Deflection, drawn: &[Deflection]) -> Self {
        let of = |value: fn(&Deflection) -> f64, unit: fn(f64) -> f64| {
            Uncertain::new(
                unit(value(nominal)),
                drawn.iter().map(|d| unit(value(d))).collect(),
            )
        };
        HoleError {
            displacement_mm: (nominal.displacement_m * 1e3).into(),
            axial_mm: 1e3 * nominal.axial_m,
            position_mm: of(|d| d.position_m, |m| 1e3 * m),
            tilt_deg: of(|d| d.tilt_rad, f64::to_degrees),
            oversize_mm: of(|d| d.oversize_m, |m| 1e3 * m),
            contacts: Vec::new(),
            skating_mm: None,
            compensation: None,
        }
    }
}

impl HoleTolerance {
    /// Whether the bound of the position error keeps the tolerance.
    pub fn position_met(&self, error: &HoleError) -> bool {
        error.position_mm.bound() <= self.position_mm
    }

    /// Whether the bound of the tilt keeps the tolerance.
    pub fn perpendicularity_met(&self, error: &HoleError) -> bool {
        error.tilt_deg.bound() <= self.perpendicularity_deg
    }

    /// Whether the bound of the oversize keeps the tolerance of the diameter; `None` where that is not judged.
    pub fn diameter_met(&self, error: &HoleError) -> Option<bool> {
        let diameter = self.diameter?;
        Some(error.oversize_mm.bound() <= diameter.width_mm)
    }

    /// Whether all tolerances are kept.
    pub fn met(&self, error: &HoleError) -> bool {
        self.position_met(error)
            && self.perpendicularity_met(error)
            && self.diameter_met(error).unwrap_or(true)
    }

    /// Whether a place without draws of its own keeps the tolerance, when its uncertainty is in proportion that of a
    /// neighbour.
    pub fn met_near(&self, here: &Deflection, neighbour: &HoleError) -> bool {
        let position_mm = 1e3 * here.position_m * neighbour.position_mm.allowance();
        let tilt_deg = here.tilt_rad.to_degrees() * neighbour.tilt_deg.allowance();
        let oversize_mm = 1e3 * here.oversize_m * neighbour.oversize_mm.allowance();
        position_mm <= self.position_mm
            && tilt_deg <= self.perpendicularity_deg
            && self.diameter.is_none_or(|d| oversize_mm <= d.width_mm)
    }
}

/// What a load does to the tool.
#[derive(Debug, Clone, PartialEq)]
pub struct Deflection {
    /// Base axes, with the lateral force where it does the position most harm.
    pub displacement_m: Vector3<f64>,
    /// Along the tool axis, positive into the workpiece.
    pub axial_m: f64,
    /// Normal to the tool axis.
    pub position_m: f64,
    /// Turn of the tool axis, with the lateral force where it tilts most.
    pub tilt_rad: f64,
    /// Width of what the tool's axis runs through while the lateral force turns: 2 L times the greatest singular value of
    /// the compliance across the axis, L the force.
    pub oversize_m: f64,
    /// Displacement and turn (base axes) under thrust and torque alone, which can be allowed for in the commanded pose.
    pub steady: Vector6<f64>,
    /// The same for each direction of the lateral force; the steady one alone where there is none.
    pub all: Vec<Vector6<f64>>,
}

/// Directions of the lateral force that are tried: the worst one is met within cos 0.5°.
const DIRECTIONS: u32 = 360;

impl Deflection {
    /// `compliance`: of the tool point in base axes ([`crate::robot::Chain::tool_compliance`]); `tool_axis`: unit vector
    /// from the spindle to the workpiece.
    pub fn new(compliance: &Matrix6<f64>, tool_axis: Vector3<f64>, load: &HoleLoad) -> Self {
        let steady = compliance * wrench(-tool_axis * load.thrust_n, -tool_axis * load.torque_nm);
        let across = |v: Vector3<f64>| v - tool_axis * v.dot(&tool_axis);
        let shift = |twist: &Vector6<f64>| twist.fixed_rows::<3>(0).into_owned();
        let position = |twist: &Vector6<f64>| across(shift(twist)).norm();
        let tilt = |twist: &Vector6<f64>| across(twist.fixed_rows::<3>(3).into_owned()).norm();
        let mut worst = steady;
        let mut tilt_rad = tilt(&steady);
        let mut oversize_m = 0.0;
        let mut all = Vec::new();
        if load.lateral_n > 0.0 {
            let axes = lobe_axes(tool_axis);
            let sides = axes.map(|side| compliance * wrench(side * load.lateral_n, Vector3::zeros()));
            let across = Matrix2::from_fn(|row, column| shift(&sides[column]).dot(&axes[row]));
            oversize_m = 2.0 * across.singular_values().max();
            for i in 0..DIRECTIONS {
                let (sin, cos) = f64::from(i).to_radians().sin_cos();
                let twist = steady + sides[0] * cos + sides[1] * sin;
                if i == 0 || position(&twist) > position(&worst) {
                    worst = twist;
                }
                tilt_rad = tilt_rad.max(tilt(&twist));
                all.push(twist);
            }
        } else {
            all.push(steady);
        }
        Deflection {
            displacement_m: shift(&worst),
            axial_m: shift(&worst).dot(&tool_axis),
            position_m: position(&worst),
            tilt_rad,
            oversize_m,
            steady,
            all,
        }
    }
}

/// Mean torque: the tangential force Ktc c sin φ + Kte (N/mm² and N/mm) of N teeth from entry to exit, at the radius.
pub fn milling_torque_nm(tool: &Tool, geometry: &CutGeometry, ktc: f64, kte: f64) -> f64 {
    let CutGeometry::Milling {
        feed_per_tooth_mm,
        axial_depth_mm,
        immersion,
    } = *geometry
    else {
        return 0.0;
    };
    let (start, exit) = (immersion.start_rad, immersion.exit_rad);
    let per_depth = ktc * feed_per_tooth_mm * (start.cos() - exit.cos()) + kte * (exit - start);
    let teeth_at_once = tool.teeth as f64 / std::f64::consts::TAU;
    teeth_at_once * axial_depth_mm * per_depth * 0.5 * tool.diameter_mm / 1000.0
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::campaign::Immersion;
    use crate::cutting::test_drill;

    fn load(thrust_n: f64, torque_nm: f64, lateral_n: f64) -> HoleLoad {
        HoleLoad {
            thrust_n,
            torque_nm,
            lateral_n,
            source: String::new(),
        }
    }

    /// Springs along the base axes under a vertical tool: thrust lifts it, the lateral force finds the softer side, a
    /// torque turns the tool about its axis and tilts nothing.
    #[test]
    fn springs_along_the_axes() {
        let diagonal = Vector6::new(2e-6, 3e-6, 1e-6, 4e-7, 5e-7, 6e-7);
        let down = -Vector3::z();
        let compliance = Matrix6::from_diagonal(&diagonal);
        let found = Deflection::new(&compliance, down, &load(400.0, 5.0, 100.0));
        assert_relative_eq!(found.axial_m, -4e-4, max_relative = 1e-12);
        assert_relative_eq!(found.position_m, 3e-4, max_relative = 1e-12);
        assert_relative_eq!(found.displacement_m.y.abs(), 3e-4, max_relative = 1e-12);
        assert!(found.tilt_rad.abs() < 1e-15);
        // A force of 100 N that turns with the drill carries it 0.3 mm to either side of y.
        assert_relative_eq!(found.oversize_m, 6e-4, max_relative = 1e-12);
        assert_relative_eq!(
            found.steady,
            Vector6::new(0.0, 0.0, 4e-4, 0.0, 0.0, 3e-6),
            max_relative = 1e-12
        );
        let balanced = Deflection::new(&compliance, down, &load(400.0, 5.0, 0.0));
        assert_eq!((balanced.oversize_m, balanced.all.len()), (0.0, 1));
    }

    /// A drill at the end of a lever of one spring (compliance c about the base's y, lever a along x, tool down): the
    /// thrust T lifts by c a² T and tilts by c a T; with a lateral force L at a height h below the joint the tilt is
    /// c (a T + h L) and the position error h times that.
    #[test]
    fn a_drill_on_a_lever() {
        let (c, a, h, thrust, lateral) = (1e-6, 0.9, 0.4, 300.0, 50.0);
        // Displacement of the point (a, 0, −h) for a turn about y: y × r = (−h, 0, −a).
        let s = Vector6::new(-h, 0.0, -a, 0.0, 1.0, 0.0);
        let compliance = s * s.transpose() * c;
        let found = Deflection::new(&compliance, -Vector3::z(), &load(thrust, 7.0, lateral));
        let turn = c * (a * thrust + h * lateral);
        assert_relative_eq!(found.tilt_rad, turn, max_relative = 1e-9);
        assert_relative_eq!(found.position_m, h * turn, max_relative = 1e-9);
        assert_relative_eq!(found.axial_m, -a * turn, max_relative = 1e-9);
    }

    #[test]
    fn tolerances_are_held_against_the_upper_bound() {
        let deflection = |position_m: f64, tilt_rad: f64| Deflection {
            displacement_m: Vector3::new(position_m, 0.0, 0.0),
            axial_m: 0.0,
            position_m,
            tilt_rad,
            oversize_m: 0.2 * position_m,
            steady: Vector6::zeros(),
            all: Vec::new(),
        };
        let drawn: Vec<Deflection> = (0..=100)
            .map(|i| deflection(1e-4 + 1e-6 * f64::from(i), 1e-3))
            .collect();
        let error = HoleError::new(&deflection(1.5e-4, 1e-3), &drawn);
        assert_relative_eq!(error.position_mm.bound(), 0.195, max_relative = 1e-9);
        // Variance of 0 … 100: n (n + 1)/12 with n = 101.
        let std = 1e-3 * (101.0 * 102.0 / 12.0f64).sqrt();
        assert_relative_eq!(error.position_mm.std.unwrap(), std, max_relative = 1e-9);
        let tolerance = |position_mm, perpendicularity_deg| HoleTolerance {
            position_mm,
            perpendicularity_deg,
            diameter: None,
        };
        assert!(!tolerance(0.19, 0.5).met(&error) && tolerance(0.20, 0.5).met(&error));
        assert!(!tolerance(0.20, 0.05).met(&error) && tolerance(0.20, 0.05).position_met(&error));
        // Half the deflection with the same uncertainty in proportion.
        let near = deflection(0.75e-4, 1e-3);
        assert!(tolerance(0.098, 0.5).met_near(&near, &error));
        assert!(!tolerance(0.097, 0.5).met_near(&near, &error));
        let certain = HoleError::new(&deflection(1.5e-4, 1e-3), &[]);
        assert_eq!((certain.position_mm.std, certain.position_mm.upper), (None, None));
        assert!(tolerance(0.15001, 0.5).met(&certain));
        // The bound of the oversize, 0.039 mm, against H8 (0.022 mm) and H10 (0.058 mm) of 6.35 mm.
        let judged = |grade| HoleTolerance {
            diameter: DiameterTolerance::h(grade, 6.35),
            ..tolerance(0.20, 0.5)
        };
        assert_eq!(tolerance(0.20, 0.5).diameter_met(&error), None);
        assert_eq!(judged(8).diameter_met(&error), Some(false));
        assert_eq!(judged(10).diameter_met(&error), Some(true));
        assert!(!judged(8).met(&error) && judged(10).met(&error));
        assert!(!judged(8).met_near(&near, &error) || near.oversize_m < 2e-5);
    }

    /// Slot: mean tangential force times radius, N a/(2π) (2 Ktc c + π Kte) D/2.
    #[test]
    fn torque_of_a_slot() {
        let tool = Tool {
            diameter_mm: 16.0,
            teeth: 6,
            ..test_drill()
        };
        let slot = CutGeometry::Milling {
            feed_per_tooth_mm: 0.1,
            axial_depth_mm: 2.0,
            immersion: Immersion::SLOT,
        };
        let found = milling_torque_nm(&tool, &slot, 800.0, 12.0);
        let pi = std::f64::consts::PI;
        let force = 6.0 * 2.0 / (2.0 * pi) * (2.0 * 800.0 * 0.1 + pi * 12.0);
        assert_relative_eq!(found, force * 8.0 / 1000.0, max_relative = 1e-12);
    }
}
