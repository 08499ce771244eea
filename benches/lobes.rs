//! Lobes of a drilling robot: 1400 speeds, 12 modes with cross FRF.

use std::f64::consts::TAU;

use criterion::{Criterion, criterion_group, criterion_main};
use lobestone::lobes::{ModalFrf, Mode, RegenerativeForce, SpeedLimit, StabilitySolver, speed_grid};

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

criterion_group!(benches, lobes);
criterion_main!(benches);
