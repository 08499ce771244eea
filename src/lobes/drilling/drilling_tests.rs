//! The axial–torsional block and the tool point against closed forms and against stepping through time.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use approx::assert_relative_eq;
use nalgebra::DMatrix;

use crate::campaign::{CutGeometry, Tool as CuttingTool, ToolKind};
use crate::cutting::{ForceAxis, average_row};
use crate::lobes::dynamics::frf::Mode;
use crate::lobes::dynamics::tool_point::{Holder, ModesHolder, ToolDynamics};
use crate::lobes::*;

const KTC: f64 = 1014.2;
const KAC: f64 = 572.0;
const LIPS: usize = 2;

fn axial_mode(frequency_hz: f64, damping_ratio: f64, stiffness_n_per_m: f64) -> ModalFrf {
    ModalFrf::from_axis_modes(&[AxisMode {
        axis: 0,
        frequency_hz,
        damping_ratio,
        stiffness_n_per_m,
    }])
    .unwrap()
}

/// A torsional mode whose unwinding makes the drill longer, m per rad.
fn twisting(frequency_hz: f64, damping_ratio: f64, stiffness_nm_per_rad: f64, longer_m: f64) -> ModalFrf {
    let omega = TAU * frequency_hz;
    let turn = omega / stiffness_nm_per_rad.sqrt();
    let mode = Mode {
        omega_n_rad_per_s: omega,
        damping_ratio,
        shape: [-longer_m * turn, turn],
    };
    ModalFrf::from_mode_shapes(vec![mode], [[0.0; 2]; 2]).unwrap()
}

/// One mode along the axis: Re H has its minimum −1/(4kζ(1+ζ)) at f√(1+2ζ) (Altintas, Manufacturing Automation, 2012,
/// §3.6 and §4.2), so the least limit is b = 1/(2 N Kac max(−Re H)) = 2kζ(1+ζ)/(N Kac), at speeds 60 f/(N (k + ε/2π)) with
/// ε = π + 2 atan √(1+2ζ).
#[test]
fn one_axial_mode_has_its_closed_form() {
    let (f, zeta, k) = (180.0, 0.03, 4e7);
    let frf = axial_mode(f, zeta, k);
    for lips in [1, 2, 3, 7] {
        let force = RegenerativeForce::drilling_axial_torsional(KTC, KAC, 4e-3, 1e-4, lips).unwrap();
        let solver = StabilitySolver::new(force, &frf);
        let expected = 2.0 * k * zeta * (1.0 + zeta) / (lips as f64 * KAC * 1e6);
        let least = solver.absolute_limit().unwrap();
        assert_relative_eq!(least.depth_mm, 1e3 * expected, max_relative = 1e-9);
        let chatter = f * (1.0 + 2.0 * zeta).sqrt();
        assert_relative_eq!(least.chatter_hz, chatter, max_relative = 1e-5);
        let epsilon = PI + 2.0 * (1.0 + 2.0 * zeta).sqrt().atan();
        for lobe in [0.0, 1.0, 5.0] {
            let rpm = 60.0 * chatter / (lips as f64 * (lobe + epsilon / TAU));
            let limit = solver.limit_at(rpm).unwrap();
            assert_relative_eq!(limit.depth_mm, 1e3 * expected, max_relative = 1e-6);
        }
    }
}

/// Torsional–axial chatter: a drill that gets longer as it unwinds. With θ = −T/kθ and z = −pθ the limit is set by the
/// positive real part of the torsional FRF G, b = 1/(2K max Re G), K = N p (Ktc R_t − Kac p), max Re G = 1/(4kζ(1−ζ)) at
/// f√(1−2ζ): below the natural frequency (Bayly, Metzler, Schaut & Young 2001).
#[test]
fn torsional_axial_chatter_lies_below_the_natural_frequency() {
    let (f, zeta, k, longer, arm) = (2400.0, 0.02, 900.0, 6e-4, 3e-3);
    let frf = twisting(f, zeta, k, longer);
    let force = RegenerativeForce::drilling_axial_torsional(KTC, KAC, arm, 0.0, LIPS).unwrap();
    let least = StabilitySolver::new(force, &frf).absolute_limit().unwrap();
    let gain = LIPS as f64 * longer * 1e6 * (KTC * arm - KAC * longer);
    assert!(gain > 0.0);
    let max_re = 1.0 / (4.0 * k * zeta * (1.0 - zeta));
    assert_relative_eq!(least.depth_mm, 1e3 / (2.0 * gain * max_re), max_relative = 1e-9);
    assert_relative_eq!(
        least.chatter_hz,
        f * (1.0 - 2.0 * zeta).sqrt(),
        max_relative = 1e-5
    );
    // A drill that gets shorter damps this mode: the thrust that the axial motion makes is all that is left, above it.
    let shorter = twisting(f, zeta, k, -longer);
    let other = StabilitySolver::new(force, &shorter).absolute_limit().unwrap();
    assert!(other.chatter_hz > f, "{other:?}");
}

/// A turn ahead makes the chip thinner by f/2π per rad: alone it is a positive real part, b = 1/(2 N Ktc R_t (f/2π) max Re G).
#[test]
fn a_turn_ahead_thins_the_chip() {
    let (f, zeta, k, arm, feed) = (900.0, 0.05, 300.0, 4e-3, 2e-4);
    let frf = twisting(f, zeta, k, 0.0);
    let force = RegenerativeForce::drilling_axial_torsional(KTC, KAC, arm, feed, LIPS).unwrap();
    let least = StabilitySolver::new(force, &frf).absolute_limit().unwrap();
    let gain = LIPS as f64 * KTC * 1e6 * arm * feed / TAU;
    let max_re = 1.0 / (4.0 * k * zeta * (1.0 - zeta));
    assert_relative_eq!(least.depth_mm, 1e3 / (2.0 * gain * max_re), max_relative = 1e-9);
}

/// The block's stiffness is the slope of the campaign's own thrust and torque over the feed per lip.
#[test]
fn the_force_is_the_baseline_of_the_campaign() {
    let tool = CuttingTool {
        kind: ToolKind::Drill,
        diameter_mm: 9.5,
        teeth: LIPS,
        helix_deg: 30.0,
        corner_radius_mm: 0.0,
        lead_angle_deg: 90.0,
        half_point_angle_deg: Some(67.5),
        web_thickness_mm: Some(1.4),
        chisel_edge_angle_deg: 125.0,
        each_tooth: Vec::new(),
    };
    let coefficients = [900.0, 30.0, 450.0, 20.0];
    let at = |feed_per_rev_mm: f64, axis| -> f64 {
        let geometry = CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm: 4.0,
            hole_depth_mm: None,
        };
        let row = average_row(&tool, &geometry, axis).unwrap();
        row.iter().zip(coefficients).map(|(r, c)| r * c).sum()
    };
    // Per metre of feed per lip.
    let slope = |axis| (at(0.3, axis) - at(0.1, axis)) / (0.2e-3 / LIPS as f64);
    let (outer, inner) = (4.75e-3, 2e-3);
    let (width, arm) = (outer - inner, 0.5 * (outer + inner));
    let kac = 450.0 * 67.5f64.to_radians().sin();
    let force = RegenerativeForce::drilling_axial_torsional(900.0, kac, arm, 0.0, LIPS).unwrap();
    let d = force.matrix_n_per_m2;
    assert_relative_eq!(-d[0][0] * width, slope(ForceAxis::Z).abs(), max_relative = 1e-9);
    assert_relative_eq!(-d[1][0] * width, slope(ForceAxis::Mz).abs(), max_relative = 1e-9);
    assert_eq!((d[0][1], d[1][1]), (0.0, 0.0));
    assert!(RegenerativeForce::drilling_axial_torsional(900.0, -1.0, arm, 0.0, 2).is_err());
    assert!(RegenerativeForce::drilling_axial_torsional(900.0, 1.0, f64::NAN, 0.0, 2).is_err());
    assert!(RegenerativeForce::drilling_axial_torsional(900.0, 1.0, arm, 0.0, 0).is_err());
}

/// Greatest multiplier over one period of y' = L y + B b D (r − r(t − T)), stepped through time with the delayed
/// displacement straight between its steps: a plain semi-discretisation, independent of the frequency domain.
fn greatest_multiplier(states: &StateSpace, force: &RegenerativeForce, rpm: f64, width_m: f64) -> f64 {
    const STEPS: usize = 60;
    let n = states.dynamics.nrows();
    let dt = 60.0 / (force.teeth as f64 * rpm) / STEPS as f64;
    let d = DMatrix::from_fn(2, 2, |i, j| width_m * force.matrix_n_per_m2[i][j]);
    let into = &states.input * &d;
    let own = &states.dynamics + &into * &states.output;
    // exp of [[L + BDC, BD, 0], [0, 0, I/dt], [0, 0, 0]]: constant and straight part of the delayed displacement.
    let mut all = DMatrix::zeros(n + 4, n + 4);
    all.view_mut((0, 0), (n, n)).copy_from(&own);
    all.view_mut((0, n), (n, 2)).copy_from(&-into);
    all.view_mut((n, n + 2), (2, 2))
        .copy_from(&(DMatrix::identity(2, 2) / dt));
    let e = (all * dt).exp();
    let (stay, start, rise) = (
        e.view((0, 0), (n, n)),
        e.view((0, n), (n, 2)),
        e.view((0, n + 2), (n, 2)),
    );
    // y, r one step ago, …, r STEPS ago.
    let size = n + 2 * STEPS;
    let mut map = DMatrix::<f64>::zeros(size, size);
    map.view_mut((0, 0), (n, n)).copy_from(&stay);
    let at = |steps_ago: usize| n + 2 * (steps_ago - 1);
    map.view_mut((0, at(STEPS)), (n, 2)).copy_from(&(start - rise));
    map.view_mut((0, at(STEPS - 1)), (n, 2)).copy_from(&rise);
    map.view_mut((at(1), 0), (2, n)).copy_from(&states.output);
    for ago in 2..=STEPS {
        map.view_mut((at(ago), at(ago - 1)), (2, 2))
            .copy_from(&DMatrix::identity(2, 2));
    }
    let multipliers = map.complex_eigenvalues();
    multipliers.iter().map(|m| m.norm()).fold(0.0, f64::max)
}

fn limit_through_time(states: &StateSpace, force: &RegenerativeForce, rpm: f64, about_m: f64) -> f64 {
    let (mut low, mut high) = (0.8 * about_m, 1.2 * about_m);
    assert!(greatest_multiplier(states, force, rpm, low) < 1.0);
    assert!(greatest_multiplier(states, force, rpm, high) > 1.0);
    for _ in 0..9 {
        let middle = 0.5 * (low + high);
        if greatest_multiplier(states, force, rpm, middle) > 1.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

/// An axial mode and a torsional one that also moves along the axis: the limit of the frequency domain is that of
/// stepping through time within 1 %, on tips and in between.
#[test]
fn the_limit_is_that_of_stepping_through_time() {
    let modes = [(150.0, 0.03, [0.09, 1.0]), (480.0, 0.04, [-0.05, 60.0])];
    let modes = modes.map(|(f, zeta, shape)| Mode {
        omega_n_rad_per_s: TAU * f,
        damping_ratio: zeta,
        shape,
    });
    let frf = ModalFrf::from_mode_shapes(modes.to_vec(), [[0.0; 2]; 2]).unwrap();
    let states = StateSpace::from(&frf);
    let force = RegenerativeForce::drilling_axial_torsional(KTC, KAC, 4e-3, 2e-4, LIPS).unwrap();
    let solver = StabilitySolver::new(force, &frf);
    for rpm in [3_000.0, 4_600.0, 7_700.0, 13_000.0] {
        let limit_m = 1e-3 * solver.limit_at(rpm).unwrap().depth_mm;
        let stepped = limit_through_time(&states, &force, rpm, limit_m);
        assert_relative_eq!(limit_m, stepped, max_relative = 0.01);
    }
}

fn carbide(length_m: f64, diameter_m: f64) -> BeamSegment {
    BeamSegment {
        length_m,
        diameter_m,
        bore_m: 0.0,
        young_pa: 600e9,
        shear_pa: 240e9,
        density_kg_per_m3: 14_500.0,
        loss_factor: 0.01,
        twist_coupling: 0.0,
    }
}

fn robot_like() -> ModesHolder {
    let mode = |axis, frequency_hz, stiffness_n_per_m| AxisMode {
        axis,
        frequency_hz,
        damping_ratio: 0.03,
        stiffness_n_per_m,
    };
    ModesHolder {
        lateral: ModalFrf::from_axis_modes(&[mode(0, 12.0, 1e6), mode(1, 15.0, 2e6)]).unwrap(),
        axial: Some(ModalFrf::from_axis_modes(&[mode(0, 20.0, 2e6), mode(1, 40.0, 1e5)]).unwrap()),
    }
}

/// No tool is no change; a tool makes the tip softer by its own static cantilever: L³/3EI + L/κGA across, L/EA along.
#[test]
fn a_tool_adds_its_own_give() {
    let holder = Arc::new(robot_like());
    let point = |segments| ToolPoint {
        holder: holder.clone(),
        tool: Arc::new(ToolDynamics::new(ToolBeam { segments })),
    };
    let bare = point(vec![]);
    let tool = carbide(0.08, 0.01);
    let tipped = point(vec![tool]);
    for f in [0.5, 12.0, 300.0] {
        assert_eq!(bare.receptance(f), holder.receptance(f));
    }
    let (a, b) = (bare.receptance(0.2), tipped.receptance(0.2));
    let own = 0.08f64.powi(3) / (3.0 * 600e9 * tool.second_moment_m4())
        + 0.08 / (tool.shear_coefficient() * 240e9 * tool.area_m2());
    assert_relative_eq!((b - a)[(0, 0)].re, own, max_relative = 1e-3);
    assert_relative_eq!(
        (b - a)[(4, 4)].re,
        0.08 / (600e9 * tool.area_m2()),
        max_relative = 0.01
    );
}

/// Chatter of the robot and of the tool are both found: at the least limit of each speed range, and the tool's as deep as a
/// search with every interval of the frequency grid halved twice finds it.
#[test]
fn neither_the_robots_nor_the_tools_modes_are_lost() {
    for (length_m, diameter_m) in [(0.12, 0.01), (0.08, 0.008), (0.05, 0.012)] {
        let mut slim = carbide(length_m, diameter_m);
        slim.loss_factor = 0.002;
        let point = ToolPoint {
            holder: Arc::new(robot_like()),
            tool: Arc::new(ToolDynamics::new(ToolBeam { segments: vec![slim] })),
        };
        let force = RegenerativeForce::drilling_lateral(KTC, 619.9, 1.178, LIPS).unwrap();
        let frf = point.lateral();
        let first = point.tool.clamped_hz[0][0];
        assert!(frf.band_hz().1 > first && frf.band_hz().0 < 1.0);
        let (plain, fine) = (
            StabilitySolver::new(force, &frf),
            StabilitySolver::with_halved_seeds(force, &frf, 2),
        );
        for rpm in [150.0, 366.0, 900.0, 6_000.0, 30_000.0] {
            let (a, b) = (plain.limit_at(rpm).unwrap(), fine.limit_at(rpm).unwrap());
            assert_relative_eq!(a.depth_mm, b.depth_mm, max_relative = 1e-6);
        }
        let (a, b) = (plain.absolute_limit().unwrap(), fine.absolute_limit().unwrap());
        assert_relative_eq!(a.depth_mm, b.depth_mm, max_relative = 1e-6);
    }
    // Peaks of the robot's FRF are 1/(2ζk) = 1.7e-5 m/N. A stubby tool's (k = 3EI/L³ = 6.8e7 N/m, ζ = 0.5 %) are 1.5e-6, and its
    // like modes in x and y, which chatter more easily than single ones, do not make up for that: the robot sets the limit
    // that holds at every speed. A slender one's (2.1e5 N/m) are 5e-4: it does, close to where it would ring when clamped.
    let chatter_hz = |length_m, diameter_m| {
        let point = ToolPoint {
            holder: Arc::new(robot_like()),
            tool: Arc::new(ToolDynamics::new(ToolBeam {
                segments: vec![carbide(length_m, diameter_m)],
            })),
        };
        let force = RegenerativeForce::drilling_lateral(KTC, 619.9, 1.178, LIPS).unwrap();
        let frf = point.lateral();
        let least = StabilitySolver::new(force, &frf).absolute_limit();
        (least.unwrap().chatter_hz, point.tool.clamped_hz[0][0])
    };
    let (stubby, _) = chatter_hz(0.03, 0.012);
    assert!(stubby < 30.0, "{stubby}");
    let (slender, clamped) = chatter_hz(0.12, 0.008);
    assert_relative_eq!(slender, clamped, max_relative = 0.03);
}
