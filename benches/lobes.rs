//! Lobes of a drilling robot: 1400 speeds, 12 modes with cross FRF.

use std::f64::consts::TAU;

use criterion::{Criterion, criterion_group};
use lobestone::lobes::{ModalFrf, Mode, RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};
use rayon::prelude::*;

fn robot() -> ModalFrf {
    let modes = (0..12)
        .map(|i| {
            let i = f64::from(i);
            let (f, angle) = (6.0 + 4.3 * i + (3.0 * i).sin(), 1.1 * i);
            let scale = TAU * f / (1.5e6 * (1.0 + i)).sqrt();
            Mode {
                omega_n_rad_per_s: TAU * f,
                damping_ratio: 0.01 + 0.002 * i,
                shape: [scale * angle.cos(), scale * angle.sin()],
            }
        })
        .collect();
    ModalFrf::from_mode_shapes(modes, [[0.0; 2]; 2]).expect("sound modes")
}

fn lobes(c: &mut Criterion) {
    let frf = robot();
    let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).expect("sound cut");
    let speeds = speed_grid([100.0, 1499.0, 1.0]).expect("sound grid");
    c.bench_function("lobes/drilling_12_modes_1400_speeds", |b| {
        b.iter(|| {
            let solver = StabilitySolver::new(force, &frf);
            (solver.curve(&speeds), solver.absolute_limit())
        });
    });
    c.bench_function("lobes/frequency_grid_only", |b| {
        b.iter(|| StabilitySolver::new(force, &frf))
    });
}

/// A robot whose modes move and turn with the redundancy angle; scripts/bench_lobes.py has the same.
fn surface_modes(angle_deg: f64) -> ModalFrf {
    let turn = angle_deg.to_radians();
    let modes = (0..12)
        .map(|i| {
            let i = f64::from(i);
            let f = 6.0 + 4.3 * i + (3.0 * i).sin() + 0.5 * (turn + i).sin();
            let direction = 1.1 * i + turn;
            let scale = TAU * f / (1.5e6 * (1.0 + i)).sqrt();
            Mode {
                omega_n_rad_per_s: TAU * f,
                damping_ratio: 0.01 + 0.002 * i,
                shape: [scale * direction.cos(), scale * direction.sin()],
            }
        })
        .collect();
    ModalFrf::from_mode_shapes(modes, [[0.0; 2]; 2]).expect("sound modes")
}

/// 72 angles × 3000 speeds: absolute limits, mm.
fn surface() -> Vec<f64> {
    let force = RegenerativeForce::drilling_lateral(1014.2, 619.9, 1.178, 2).expect("sound cut");
    let speeds = speed_grid([100.0, 1599.5, 0.5]).expect("sound grid");
    assert_eq!(speeds.len(), 3000);
    (0..72)
        .into_par_iter()
        .map(|i| {
            let frf = surface_modes(5.0 * f64::from(i));
            let solver = StabilitySolver::new(force, &frf);
            let curve = solver.curve(&speeds);
            assert_eq!(curve.depth_limit_mm.len(), 3000);
            solver.absolute_limit().map_or(f64::NAN, |l| l.depth_mm)
        })
        .collect()
}

fn whole_surface(c: &mut Criterion) {
    let mut group = c.benchmark_group("lobes");
    group.sample_size(10);
    group.bench_function("surface_72_angles_3000_speeds", |b| b.iter(surface));
    group.finish();
}

criterion_group!(benches, lobes, whole_surface);

fn main() {
    // For scripts/bench_lobes.py: the fastest of three runs and what it found, as JSON.
    if std::env::args().any(|a| a == "--surface-json") {
        let mut seconds = f64::INFINITY;
        let mut limits = Vec::new();
        for _ in 0..3 {
            let start = std::time::Instant::now();
            limits = surface();
            seconds = seconds.min(start.elapsed().as_secs_f64());
        }
        println!(
            "{}",
            serde_json::json!({"seconds": seconds, "absolute_limit_mm": limits})
        );
        return;
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
