use super::*;
use crate::campaign::Immersion;
use crate::lobes::curve::{LobeCurve, peak_near, peaks, speed_grid};
use crate::lobes::dynamics::frf::{AxisMode, ModalFrf, Mode};
use crate::lobes::dynamics::sampled::SampledFrf;
use approx::assert_relative_eq;
use num_complex::Complex64;
use proptest::prelude::*;
use std::f64::consts::PI;

fn axis_modes(modes: &[(usize, f64, f64, f64)]) -> ModalFrf {
    let modes: Vec<AxisMode> = modes
        .iter()
        .map(
            |&(axis, frequency_hz, damping_ratio, stiffness_n_per_m)| AxisMode {
                axis,
                frequency_hz,
                damping_ratio,
                stiffness_n_per_m,
            },
        )
        .collect();
    ModalFrf::from_axis_modes(&modes).unwrap()
}

/// A robot-like tool point: six modes in oblique directions, two of them close, ζ down to 0.5 %.
fn robot_frf() -> ModalFrf {
    let mode = |f: f64, zeta: f64, k: f64, angle: f64| Mode {
        omega_n_rad_per_s: TAU * f,
        damping_ratio: zeta,
        shape: [angle.cos(), angle.sin()].map(|u| u * TAU * f / k.sqrt()),
    };
    ModalFrf::from_mode_shapes(
        vec![
            mode(6.9, 0.03, 6e6, 0.4),
            mode(12.2, 0.005, 1.2e6, 1.2),
            mode(12.5, 0.02, 1.5e6, -0.3),
            mode(19.1, 0.025, 8e6, 0.9),
            mode(34.0, 0.005, 2e7, -1.1),
            mode(48.0, 0.03, 2e7, 2.0),
        ],
        [[1e-8, 0.0], [0.0, 2e-8]],
    )
    .unwrap()
}

/// A tool-like one: kHz modes with a cross FRF.
fn tool_frf() -> ModalFrf {
    let mode = |f: f64, zeta: f64, k: f64, angle: f64| Mode {
        omega_n_rad_per_s: TAU * f,
        damping_ratio: zeta,
        shape: [angle.cos(), angle.sin()].map(|u| u * TAU * f / k.sqrt()),
    };
    ModalFrf::from_mode_shapes(
        vec![
            mode(420.0, 0.03, 2e7, 0.1),
            mode(980.0, 0.005, 3e7, 1.5),
            mode(1010.0, 0.02, 3e7, 0.3),
            mode(2900.0, 0.012, 4e7, 1.0),
        ],
        [[0.0; 2]; 2],
    )
    .unwrap()
}

fn drilling() -> RegenerativeForce {
    RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).unwrap()
}

fn down_milling(ktc: f64, krc: f64, teeth: usize, radial_ratio: f64) -> RegenerativeForce {
    let immersion = Immersion {
        start_rad: PI - (1.0 - 2.0 * radial_ratio).acos(),
        exit_rad: PI,
    };
    RegenerativeForce::milling_zero_order(ktc, krc, teeth, immersion).unwrap()
}

/// One displacement axis, F = −K b Δx (or +K).
fn single_axis(k_n_per_m2: f64, teeth: usize) -> RegenerativeForce {
    RegenerativeForce {
        matrix_n_per_m2: [[k_n_per_m2, 0.0], [0.0, 0.0]],
        teeth,
    }
}

/// |det(I − b (1 − e^{−iωT}) D Φ)|.
fn characteristic(force: &RegenerativeForce, frf: &dyn ToolPointFrf, rpm: f64, limit: &Limit) -> f64 {
    let h = frf.receptance(limit.chatter_hz);
    let delay = Complex64::new(0.0, -TAU * limit.chatter_hz * 60.0 / (rpm * force.teeth as f64)).exp();
    let factor = limit.depth_mm * 1e-3 * (1.0 - delay);
    let d = force.matrix_n_per_m2;
    let m = |i: usize, j: usize| {
        let identity = if i == j { 1.0 } else { 0.0 };
        identity - factor * (d[i][0] * h[0][j] + d[i][1] * h[1][j])
    };
    (m(0, 0) * m(1, 1) - m(0, 1) * m(1, 0)).norm()
}

/// The least limit at speeds within a relative distance.
fn least_within(solver: &StabilitySolver, rpm: f64, distance: f64) -> f64 {
    (-50..=50)
        .filter_map(|i| solver.limit_at(rpm * (1.0 + distance * f64::from(i) / 50.0)))
        .map(|l| l.depth_mm)
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn every_limit_solves_the_characteristic_equation() {
    let (robot, tool) = (robot_frf(), tool_frf());
    let cases: [(RegenerativeForce, &dyn ToolPointFrf, [f64; 3]); 3] = [
        (drilling(), &robot, [60.0, 1500.0, 7.3]),
        (down_milling(800.0, 240.0, 3, 0.4), &tool, [3000.0, 20000.0, 61.0]),
        (down_milling(800.0, 240.0, 4, 0.4), &robot, [60.0, 900.0, 7.0]),
    ];
    for (force, frf, speeds) in cases {
        let solver = StabilitySolver::new(force, frf);
        let mut seen = 0;
        for n in speed_grid(speeds).unwrap() {
            if let Some(limit) = solver.limit_at(n) {
                seen += 1;
                assert!(characteristic(&force, frf, n, &limit) < 1e-7, "{n} rpm {limit:?}");
            }
        }
        assert!(seen > 100);
    }
}

/// The least b by brute force: each lobe k as a dense polyline n_k(ω), crossings of the speed picked off it.
fn by_brute_force(force: &RegenerativeForce, frf: &ModalFrf, rpm: f64, points: usize) -> f64 {
    let (low, high) = frf.band_hz();
    let teeth = force.teeth as f64;
    let mut previous: Option<(f64, [Complex64; 2])> = None;
    let mut least = f64::INFINITY;
    for i in 0..=points {
        let f = low + (high - low) * i as f64 / points as f64;
        let mut lambda = arcs::eigenvalues(force, frf, f);
        if let Some((before, old)) = previous {
            if (lambda[0] - old[1]).norm() + (lambda[1] - old[0]).norm()
                < (lambda[0] - old[0]).norm() + (lambda[1] - old[1]).norm()
            {
                lambda.swap(0, 1);
            }
            for p in 0..2 {
                let (a, b) = (old[p], lambda[p]);
                if a.re <= 0.0 || b.re <= 0.0 {
                    continue;
                }
                let speed = |f: f64, l: Complex64, k: f64| 60.0 * f / (teeth * (k + l.re.atan2(-l.im) / PI));
                let k0 = (f * 60.0 / (teeth * rpm)).floor();
                for k in [k0 - 1.0, k0, k0 + 1.0].into_iter().filter(|k| *k >= 0.0) {
                    let (na, nb) = (speed(before, a, k), speed(f, b, k));
                    if (na - rpm) * (nb - rpm) <= 0.0 && na != nb {
                        let s = (rpm - na) / (nb - na);
                        least = least.min(1e3 / (2.0 * (a.re + s * (b.re - a.re))));
                    }
                }
            }
        }
        previous = Some((f, lambda));
    }
    least
}

#[test]
fn the_least_lobe_is_found_as_by_brute_force() {
    let frf = robot_frf();
    for force in [drilling(), down_milling(900.0, 300.0, 2, 0.3)] {
        let solver = StabilitySolver::new(force, &frf);
        for n in [
            83.0, 141.7, 185.0, 262.0, 333.3, 367.0, 420.0, 610.0, 702.0, 999.0, 1444.0,
        ] {
            let brute = by_brute_force(&force, &frf, n, 400_000);
            match solver.limit_at(n) {
                Some(limit) => assert_relative_eq!(limit.depth_mm, brute, max_relative = 1e-4),
                None => assert!(brute.is_infinite(), "{n} rpm: brute force gives {brute}"),
            }
        }
    }
}

#[test]
fn halving_the_frequency_step_moves_nothing_by_a_hundredth() {
    let (robot, tool) = (robot_frf(), tool_frf());
    let lines: Vec<f64> = (8..1000).map(|i| 0.1 * f64::from(i)).collect();
    let values = lines.iter().map(|f| robot.receptance(*f)).collect();
    let measured = SampledFrf::new(lines, values).unwrap();
    let cases: [(&str, RegenerativeForce, &dyn ToolPointFrf, [f64; 3]); 4] = [
        ("drilling, robot", drilling(), &robot, [100.0, 1500.0, 1.0]),
        ("drilling, measured", drilling(), &measured, [100.0, 1500.0, 1.0]),
        (
            "milling, robot",
            down_milling(800.0, 240.0, 4, 0.5),
            &robot,
            [100.0, 1500.0, 1.0],
        ),
        (
            "milling, tool",
            down_milling(800.0, 240.0, 3, 0.2),
            &tool,
            [5000.0, 20000.0, 10.0],
        ),
    ];
    for (name, force, frf, speeds) in cases {
        let speeds = speed_grid(speeds).unwrap();
        let curve = |halvings| StabilitySolver::with_halved_seeds(force, frf, halvings).curve(&speeds);
        let (coarse, fine) = (curve(0), curve(2));
        let mut limited = 0;
        for (i, n) in speeds.iter().enumerate() {
            match (coarse.depth_limit_mm[i], fine.depth_limit_mm[i]) {
                (Some(a), Some(b)) => {
                    limited += 1;
                    assert!((a / b - 1.0).abs() < 1e-6, "{name}, {n} rpm: {a} against {b} mm");
                }
                (a, b) => assert_eq!(a, b, "{name}, {n} rpm"),
            }
        }
        assert!(limited > speeds.len() / 2, "{name}");
    }
}

/// Lines at half the spacing: the curve through the coarser ones must already give the same lobes.
#[test]
fn halving_the_measured_lines_moves_nothing_by_a_hundredth() {
    let truth = robot_frf();
    let sampled = |step: f64| {
        let lines: Vec<f64> = (1..)
            .map(|i| step * f64::from(i))
            .take_while(|f| *f <= 100.0)
            .collect();
        let values = lines.iter().map(|f| truth.receptance(*f)).collect();
        SampledFrf::new(lines, values).unwrap()
    };
    let (coarse, fine) = (sampled(0.1), sampled(0.05));
    let speeds = speed_grid([100.0, 1500.0, 1.0]).unwrap();
    let curve = |frf: &SampledFrf| StabilitySolver::new(drilling(), frf).curve(&speeds);
    let (a, b) = (curve(&coarse), curve(&fine));
    for (i, n) in speeds.iter().enumerate() {
        let (a, b) = (a.depth_limit_mm[i].unwrap(), b.depth_limit_mm[i].unwrap());
        assert!((a / b - 1.0).abs() < 0.01, "{n} rpm: {a} against {b} mm");
    }
}

/// White noise of 0.3 % of the greatest receptance on every line: no spikes between lines that would limit falsely.
#[test]
fn noise_on_measured_lines_makes_no_false_limit() {
    use rand::{Rng, SeedableRng};
    let truth = robot_frf();
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let lines: Vec<f64> = (1..=1000).map(|i| 0.1 * f64::from(i)).collect();
    let level = 0.003
        * lines
            .iter()
            .map(|f| truth.receptance(*f)[1][1].norm())
            .fold(0.0, f64::max);
    let values = lines
        .iter()
        .map(|f| {
            truth.receptance(*f).map(|row| {
                row.map(|h| {
                    h + level * Complex64::new(random.random_range(-1.2..1.2), random.random_range(-1.2..1.2))
                })
            })
        })
        .collect();
    let measured = SampledFrf::new(lines.clone(), values).unwrap();
    for i in 10..9990 {
        let f = 0.01 * f64::from(i);
        for (noisy, clean) in measured
            .receptance(f)
            .iter()
            .flatten()
            .zip(truth.receptance(f).iter().flatten())
        {
            assert!(
                (noisy - clean).norm() < 6.0 * level,
                "{f} Hz: {noisy} against {clean}"
            );
        }
    }
    let limit = |frf: &dyn ToolPointFrf| {
        StabilitySolver::new(drilling(), frf)
            .absolute_limit()
            .unwrap()
            .depth_mm
    };
    assert_relative_eq!(limit(&measured), limit(&truth), max_relative = 0.02);
}

/// Tlusty: −min Re G = 1/(4kζ(1+ζ)) at f√(1+2ζ), so b = 2kζ(1+ζ)/K.
#[test]
fn one_mode_has_its_closed_form_limit() {
    let (f, zeta, k, force) = (120.0, 0.02, 3e6, 1.5e9);
    let frf = axis_modes(&[(0, f, zeta, k)]);
    let solver = StabilitySolver::new(single_axis(-force, 1), &frf);
    let limit = solver.absolute_limit().unwrap();
    assert_relative_eq!(
        limit.depth_mm,
        1e3 * 2.0 * k * zeta * (1.0 + zeta) / force,
        max_relative = 1e-9
    );
    assert_relative_eq!(
        limit.chatter_hz,
        f * (1.0 + 2.0 * zeta).sqrt(),
        max_relative = 1e-4
    );
    // At that frequency ε = 2 atan2(Re λ, −Im λ); the speed of lobe 3 there has exactly the absolute limit.
    let g = frf.receptance(limit.chatter_hz)[0][0];
    let epsilon = 2.0 * (-g.re).atan2(g.im);
    let at = solver
        .limit_at(60.0 * limit.chatter_hz / (3.0 + epsilon / TAU))
        .unwrap();
    assert_relative_eq!(at.depth_mm, limit.depth_mm, max_relative = 1e-6);
    assert_eq!(at.lobe, 3);
}

/// Bayly (2001), torsional–axial drilling: the torque lengthens the drill, so the positive real part limits,
/// b = 1/(2K max Re G) = 2kζ(1−ζ)/K, with chatter below the natural frequency, f√(1−2ζ).
#[test]
fn torsional_axial_chatter_lies_below_the_mode() {
    let (f, zeta, k, force) = (2000.0, 0.015, 4e7, 2e9);
    let frf = axis_modes(&[(0, f, zeta, k)]);
    let limit = StabilitySolver::new(single_axis(force, 2), &frf)
        .absolute_limit()
        .unwrap();
    assert_relative_eq!(
        limit.depth_mm,
        1e3 * 2.0 * k * zeta * (1.0 - zeta) / force,
        max_relative = 1e-9
    );
    assert_relative_eq!(
        limit.chatter_hz,
        f * (1.0 - 2.0 * zeta).sqrt(),
        max_relative = 1e-4
    );
}

/// Altintas, Manufacturing Automation, shaping with two inclined modes; 7.185 mm at 252.98 Hz.
#[test]
fn shaping_with_two_inclined_modes() {
    let mode = |f: f64, zeta, k: f64, degrees: f64| Mode {
        omega_n_rad_per_s: TAU * f,
        damping_ratio: zeta,
        shape: [degrees.to_radians().cos(), degrees.to_radians().sin()].map(|u| u * TAU * f / k.sqrt()),
    };
    let modes = vec![mode(250.0, 0.012, 2.26e8, 30.0), mode(150.0, 0.01, 2.13e8, -45.0)];
    let frf = ModalFrf::from_mode_shapes(modes, [[0.0; 2]; 2]).unwrap();
    let limit = StabilitySolver::new(single_axis(-1e9, 1), &frf)
        .absolute_limit()
        .unwrap();
    assert_relative_eq!(limit.depth_mm, 7.185, max_relative = 1e-3);
    assert_relative_eq!(limit.chatter_hz, 252.98, max_relative = 1e-4);
}

/// Insperger & Stépán's one-degree-of-freedom mill; zero-order minima 1.792, 0.641, 0.298 mm.
#[test]
fn milling_with_one_degree_of_freedom() {
    let (m, f) = (0.03993, 922.0);
    let frf = axis_modes(&[(0, f, 0.011, m * (TAU * f) * (TAU * f))]);
    for (radial_ratio, expected_mm) in [(0.05, 1.792), (0.5, 0.641), (1.0, 0.298)] {
        let force = down_milling(600.0, 200.0, 2, radial_ratio);
        let limit = StabilitySolver::new(force, &frf).absolute_limit().unwrap();
        assert_relative_eq!(limit.depth_mm, expected_mm, max_relative = 2e-3);
    }
    // Zero-order knows no flip lobes: 4.96 mm where semi-discretisation has 1.30 at a/D 0.05. (The reference computation
    // says 4.87: the least of scattered points within 0.2 % of the speed, on a steep flank.)
    let thin = StabilitySolver::new(down_milling(600.0, 200.0, 2, 0.05), &frf);
    assert_relative_eq!(
        thin.limit_at(18000.0).unwrap().depth_mm,
        4.956612,
        max_relative = 1e-6
    );
    assert_relative_eq!(least_within(&thin, 18000.0, 0.002), 4.87, max_relative = 1e-3);
}

#[test]
fn milling_with_two_modes_in_each_direction() {
    let frf = axis_modes(&[
        (0, 456.7804, 0.1117054, 7.933097e6),
        (0, 1448.8891, 0.01703701, 1.469178e7),
        (1, 516.5182, 0.02457963, 9.374614e6),
        (1, 1408.4481, 0.03135760, 1.240639e7),
    ]);
    let force = down_milling(1319.4, 788.8, 2, 0.5);
    let limit = StabilitySolver::new(force, &frf).absolute_limit().unwrap();
    assert_relative_eq!(limit.depth_mm, 0.957, max_relative = 2e-3);
}

#[test]
fn altintas_and_budak_1995() {
    let frf = axis_modes(&[(0, 603.0, 0.039, 5.59e6), (1, 666.0, 0.035, 5.715e6)]);
    let half_up = Immersion {
        start_rad: 0.0,
        exit_rad: PI / 2.0,
    };
    let up = RegenerativeForce::milling_zero_order(600.0, 42.0, 3, half_up).unwrap();
    let solver = StabilitySolver::new(up, &frf);
    let limit = solver.absolute_limit().unwrap();
    assert_relative_eq!(limit.depth_mm, 1.087, max_relative = 2e-3);
    assert!((limit.chatter_hz - 633.0).abs() < 1.0, "{} Hz", limit.chatter_hz);
    // Second column: root-finding on each eigenvalue and lobe in another language. Third: the reference computation, which took
    // the least of scattered points within 0.2 % of the speed, low on the flanks of lobes.
    for (rpm, exact_mm, scattered_mm) in [
        (5000.0, 1.0870218, 1.087),
        (8000.0, 1.0953637, 1.094),
        (10000.0, 1.3396332, 1.332),
        (12000.0, 4.0335389, 3.954),
    ] {
        let depth = solver.limit_at(rpm).unwrap().depth_mm;
        assert_relative_eq!(depth, exact_mm, max_relative = 1e-6);
        assert_relative_eq!(
            least_within(&solver, rpm, 0.002),
            scattered_mm,
            max_relative = 1e-3
        );
    }
    let slot = RegenerativeForce::milling_zero_order(600.0, 42.0, 3, Immersion::SLOT).unwrap();
    let limit = StabilitySolver::new(slot, &frf).absolute_limit().unwrap();
    assert_relative_eq!(limit.depth_mm, 0.777, max_relative = 2e-3);
}

#[test]
fn speeds_beyond_all_lobes_have_no_limit_and_bad_speeds_none() {
    let frf = axis_modes(&[(0, 12.0, 0.03, 1e6)]);
    let solver = StabilitySolver::new(single_axis(-1e9, 2), &frf);
    assert!(solver.limit_at(300.0).is_some());
    for n in [1e5, 0.0, -3.0, f64::NAN, f64::INFINITY] {
        assert_eq!(solver.limit_at(n), None, "{n}");
    }
    let stable = StabilitySolver::new(single_axis(0.0, 2), &frf);
    assert_eq!(stable.absolute_limit(), None);
    let curve = stable.curve(&[100.0, 200.0]);
    assert_eq!(
        serde_json::to_string(&curve).unwrap(),
        r#"{"spindle_rpm":[100.0,200.0],"depth_limit_mm":[null,null],"chatter_hz":[null,null]}"#
    );
    assert_eq!(stable.best(&curve, 3).len(), 1);
}

#[test]
fn peaks_are_local_maxima() {
    let curve = |depth: &[Option<f64>]| LobeCurve {
        spindle_rpm: (0..depth.len()).map(|i| 100.0 + i as f64).collect(),
        depth_limit_mm: depth.to_vec(),
        chatter_hz: depth.to_vec(),
    };
    let (a, b, c) = (Some(1.0), Some(2.0), Some(3.0));
    let rpm = |depth: &[Option<f64>]| {
        peaks(&curve(depth))
            .iter()
            .map(|p| p.spindle_rpm)
            .collect::<Vec<_>>()
    };
    assert_eq!(rpm(&[a, c, b, b, c, c, a]), [101.0, 104.0]);
    assert_eq!(rpm(&[a, None, None, None, b]), [102.0]);
    assert!(rpm(&[c, b, a, b]).is_empty());
    assert!(rpm(&[]).is_empty());
    assert_eq!(peak_near(&curve(&[a, c, b]), [102.0, 200.0]).unwrap().depth_mm, b);
    assert_eq!(peak_near(&curve(&[a, c, b]), [300.0, 400.0]), None);
}

#[test]
fn best_speeds_are_the_tips_of_the_envelope() {
    let frf = axis_modes(&[(0, 12.3, 0.028, 1.2e6), (1, 12.2, 0.0246, 8e5)]);
    let solver = StabilitySolver::new(drilling(), &frf);
    let curve = solver.curve(&speed_grid([150.0, 600.0, 5.0]).unwrap());
    let best = solver.best(&curve, 2);
    assert_eq!(best.len(), 2);
    assert!(best[0].depth_mm >= best[1].depth_mm);
    for peak in best {
        // A tip: 0.05 rpm to either side is lower already, and no speed of the grid around is higher.
        let depth = |n: f64| solver.limit_at(n).unwrap().depth_mm;
        let tip = peak.depth_mm.unwrap();
        assert!(depth(peak.spindle_rpm - 0.05) < tip && depth(peak.spindle_rpm + 0.05) < tip);
        let around = [peak.spindle_rpm - 6.0, peak.spindle_rpm + 6.0];
        assert!(peak_near(&curve, around).unwrap().depth_mm.unwrap() <= tip);
    }
}

#[test]
fn grids_of_speeds_include_both_ends_or_are_refused() {
    let grid = speed_grid([100.0, 1500.0, 0.1]).unwrap();
    assert_eq!(grid.len(), 14001);
    assert_relative_eq!(grid[14000], 1500.0, epsilon = 1e-9);
    for bad in [
        [0.0, 10.0, 1.0],
        [10.0, 5.0, 1.0],
        [10.0, 20.0, 0.0],
        [1.0, f64::NAN, 1.0],
        [1.0, 1e9, 1e-3],
    ] {
        assert!(speed_grid(bad).is_err(), "{bad:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    /// Whatever the modes: finite positive limits, none under the absolute one, all on the characteristic equation.
    #[test]
    fn any_structure_gives_sound_limits(
        modes in prop::collection::vec((5.0..60.0f64, 0.004..0.1f64, 5e5..5e7f64, -3.2..3.2f64), 1..8),
        krc in -200.0..900.0f64,
        teeth in 1usize..5,
        start in 0.0..3.0f64,
        milling in any::<bool>(),
    ) {
        let shapes = modes.iter().map(|&(f, zeta, k, angle)| Mode {
            omega_n_rad_per_s: TAU * f,
            damping_ratio: zeta,
            shape: [angle.cos(), angle.sin()].map(|u: f64| u * TAU * f / k.sqrt()),
        }).collect();
        let frf = ModalFrf::from_mode_shapes(shapes, [[0.0; 2]; 2]).unwrap();
        let force = if milling {
            let immersion = Immersion { start_rad: start, exit_rad: PI };
            RegenerativeForce::milling_zero_order(900.0, krc, teeth, immersion).unwrap()
        } else {
            RegenerativeForce::drilling_lateral(900.0, krc, 1.1, teeth).unwrap()
        };
        let solver = StabilitySolver::new(force, &frf);
        let least = solver.absolute_limit();
        for i in 0..60 {
            let n = 60.0 + 23.7 * f64::from(i);
            if let Some(limit) = solver.limit_at(n) {
                prop_assert!(limit.depth_mm.is_finite() && limit.chatter_hz > 0.0);
                let least = least.unwrap();
                prop_assert!(limit.depth_mm >= least.depth_mm * (1.0 - 1e-9), "{limit:?} {least:?}");
                prop_assert!(characteristic(&force, &frf, n, &limit) < 1e-6);
            }
        }
    }
}
