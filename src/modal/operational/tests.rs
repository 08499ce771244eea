//! The whole chain on simulated structures.

use std::f64::consts::TAU;

use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

pub fn gauss(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random_range(1e-300..1.0), random.random());
    (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
}

/// f, ζ and shape.
struct Mode(f64, f64, Vec<f64>);

/// Accelerations under independent white forces at every point, held over each sample; exact in discrete time.
fn simulate(modes: &[Mode], rate_hz: f64, samples: usize, noise: f64, seed: u64) -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let points = modes[0].2.len();
    let dt = 1.0 / rate_hz;
    let steps: Vec<([f64; 4], [f64; 2])> = modes
        .iter()
        .map(|Mode(f, zeta, _)| {
            let w = TAU * f;
            let (decay, wd) = (zeta * w, w * (1.0 - zeta * zeta).sqrt());
            let (e, c, s) = ((-decay * dt).exp(), (wd * dt).cos(), (wd * dt).sin());
            let a = [
                e * (c + decay / wd * s),
                e * s / wd,
                -e * w * w / wd * s,
                e * (c - decay / wd * s),
            ];
            // Response to a force held: from the static deflection 1/ω².
            let still = 1.0 / (w * w);
            (a, [still * (1.0 - a[0]), -still * a[2]])
        })
        .collect();
    let mut state = vec![[0.0f64; 2]; modes.len()];
    let mut out = vec![Vec::with_capacity(samples); points];
    for _ in 0..samples {
        let forces: Vec<f64> = (0..points).map(|_| gauss(&mut random)).collect();
        let mut acceleration = vec![0.0; points];
        for ((Mode(f, zeta, shape), (a, b)), x) in modes.iter().zip(&steps).zip(&mut state) {
            let w = TAU * f;
            let force: f64 = shape.iter().zip(&forces).map(|(p, f)| p * f).sum();
            let modal = force - 2.0 * zeta * w * x[1] - w * w * x[0];
            for (total, p) in acceleration.iter_mut().zip(shape) {
                *total += p * modal;
            }
            *x = [
                a[0] * x[0] + a[1] * x[1] + b[0] * force,
                a[2] * x[0] + a[3] * x[1] + b[1] * force,
            ];
        }
        for (channel, a) in out.iter_mut().zip(acceleration) {
            channel.push(a + noise * gauss(&mut random));
        }
    }
    out
}

/// A chain of masses with its sine shapes; the frequencies of the caller.
fn modes(f_zeta: &[(f64, f64)], points: usize) -> Vec<Mode> {
    f_zeta
        .iter()
        .enumerate()
        .map(|(m, &(f, zeta))| {
            let shape = (1..=points)
                .map(|p| (std::f64::consts::PI * (m + 1) as f64 * p as f64 / (points + 1) as f64).sin());
            Mode(f, zeta, shape.collect())
        })
        .collect()
}

const ROBOT: [(f64, f64); 5] = [
    (7.1, 0.03),
    (11.4, 0.02),
    (12.0, 0.025),
    (21.5, 0.015),
    (33.0, 0.02),
];
const RATE_HZ: f64 = 256.0;

fn analyse(channels: &[Vec<f64>], settings: &OperationalSettings) -> OperationalModes {
    let channels: Vec<&[f64]> = channels.iter().map(Vec::as_slice).collect();
    let record = OperationalRecord {
        sample_rate_hz: RATE_HZ,
        channels: &channels,
        differentiations: &[],
    };
    operational_modes(&record, settings).unwrap()
}

fn to_50_hz() -> OperationalSettings {
    OperationalSettings {
        band_hz: Some([2.0, 50.0]),
        ..OperationalSettings::default()
    }
}

/// The standard deviations are a promise: over many records 95 % of all estimates lie within two of them.
#[test]
fn all_modes_and_none_else_with_standard_deviations_that_cover() {
    let truth = modes(&ROBOT, 5);
    const RECORDS: u64 = 24;
    let (mut z_f, mut z_zeta, mut extra) = (Vec::new(), Vec::new(), 0);
    for seed in 0..RECORDS {
        // Four minutes.
        let found = analyse(&simulate(&truth, RATE_HZ, 240 * 256, 0.3, seed), &to_50_hz());
        for Mode(f, zeta, shape) in &truth {
            let shape: Vec<Complex64> = shape.iter().map(|x| Complex64::from(*x)).collect();
            let mode = found
                .modes
                .iter()
                .find(|m| {
                    (m.frequency_hz / f - 1.0).abs() < 0.02
                        && crate::modal::shape::mac(&m.shape, &shape) > 0.9
                })
                .unwrap_or_else(|| {
                    panic!(
                        "seed {seed}: {f} Hz is missing in {:#?} {:#?}",
                        found.modes, found.rejected
                    )
                });
            z_f.push((mode.frequency_hz - f) / mode.frequency_std_hz);
            z_zeta.push((mode.damping_ratio - zeta) / mode.damping_std);
            assert!(
                mode.frequency_std_hz < 0.01 * f && mode.damping_std < 0.5 * zeta,
                "{mode:?}"
            );
        }
        extra += found.modes.len() - truth.len();
        assert!(found.harmonics.is_empty(), "{:?}", found.harmonics);
    }
    for (name, z) in [("f", &z_f), ("zeta", &z_zeta)] {
        let within = z.iter().filter(|z: &&f64| z.abs() < 2.0).count() as f64 / z.len() as f64;
        let size = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        println!("{name}: {:.1} % within 2 sigma, rms z {size:.2}", 100.0 * within);
        // 120 draws: 95 % ± 2 %.
        assert!(within > 0.91, "{name}: {within} {z:?}");
        assert!((0.6..1.25).contains(&size), "{name}: rms z {size}");
    }
    assert!(extra <= 1, "{extra} modes that are none in {RECORDS} records");
}

#[test]
fn a_spindle_is_recognised_and_takes_no_mode_along() {
    let truth = modes(&ROBOT, 5);
    let mut channels = simulate(&truth, RATE_HZ, 180 * 256, 0.3, 77);
    let spindle_hz = 9.37;
    for (c, channel) in channels.iter_mut().enumerate() {
        for (k, x) in channel.iter_mut().enumerate() {
            let turn = TAU * (spindle_hz * k as f64 / RATE_HZ).fract();
            *x += 6.0 * (turn + c as f64).sin()
                + 3.0 * (2.0 * turn).cos()
                + 3.0 * (3.0 * turn + 0.4 * c as f64).sin();
        }
    }
    let found = analyse(&channels, &to_50_hz());
    let multiples: Vec<Option<u32>> = found.harmonics.iter().map(|h| h.multiple).collect();
    assert_eq!(multiples, [Some(1), Some(2), Some(3)], "{:?}", found.harmonics);
    assert_eq!(
        found.modes.len(),
        truth.len(),
        "{:#?} {:#?}",
        found.modes,
        found.rejected
    );
    for (mode, Mode(f, zeta, _)) in found.modes.iter().zip(&truth) {
        assert!(
            (mode.frequency_hz - f).abs() < 4.0 * mode.frequency_std_hz,
            "{mode:?} for {f}"
        );
        assert!(
            (mode.damping_ratio - zeta).abs() < 4.0 * mode.damping_std,
            "{mode:?} for {zeta}"
        );
    }
    assert!(
        found.warnings.iter().any(|w| w.contains("9.37 Hz")),
        "{:?}",
        found.warnings
    );
}

/// A spindle whose speed wavers by half a per cent is no line any more; its pole must still not be called a mode.
#[test]
fn a_wavering_spindle_is_no_mode_either() {
    let truth = modes(&ROBOT, 5);
    let mut channels = simulate(&truth, RATE_HZ, 180 * 256, 0.3, 78);
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let (mut phase, mut offset) = (0.0, 0.0);
    for k in 0..channels[0].len() {
        offset += 0.004 * gauss(&mut random) - 0.002 * offset;
        phase += TAU * (27.0 + offset) / RATE_HZ;
        for (c, channel) in channels.iter_mut().enumerate() {
            channel[k] += 8.0 * (phase + 0.3 * c as f64).sin();
        }
    }
    let found = analyse(&channels, &to_50_hz());
    assert!(
        !found.modes.iter().any(|m| (m.frequency_hz - 27.0).abs() < 0.6),
        "{:#?}",
        found.modes
    );
    for (f, _) in ROBOT {
        assert!(
            found
                .modes
                .iter()
                .any(|m| (m.frequency_hz / f - 1.0).abs() < 0.02),
            "{f} Hz"
        );
    }
}

#[test]
fn one_channel_will_do_and_white_noise_gives_nothing() {
    let truth = modes(&[(8.0, 0.02), (19.0, 0.015)], 3);
    let channels = simulate(&truth, RATE_HZ, 200 * 256, 0.2, 5);
    let found = analyse(&channels[..1], &to_50_hz());
    for (f, zeta) in [(8.0, 0.02), (19.0, 0.015)] {
        let mode = found.modes.iter().find(|m| (m.frequency_hz - f).abs() < 0.2);
        let mode = mode.unwrap_or_else(|| panic!("{f} Hz in {:#?} {:#?}", found.modes, found.rejected));
        assert!(
            (mode.damping_ratio - zeta).abs() < 4.0 * mode.damping_std,
            "{mode:?}"
        );
        assert!(mode.complexity.is_none());
    }
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut phantoms = 0;
    for _ in 0..5 {
        let noise: Vec<Vec<f64>> = (0..3)
            .map(|_| (0..100 * 256).map(|_| gauss(&mut random)).collect())
            .collect();
        phantoms += analyse(&noise, &to_50_hz()).modes.len();
    }
    assert!(phantoms <= 1, "{phantoms} modes in noise");
}

#[test]
fn bad_records_are_errors_that_say_so() {
    let good = [1.0, -1.0].repeat(5000);
    let dead = vec![0.0; 10_000];
    let gap = {
        let mut gap = good.clone();
        gap[77] = f64::NAN;
        gap
    };
    let cases: [(&[&[f64]], &str); 4] = [
        (&[], "without a response"),
        (&[&good, &good[..50]], "not of one length"),
        (&[&gap], "not numbers"),
        (&[&good, &dead], "channel 2 does not move"),
    ];
    for (channels, expected) in cases {
        let record = OperationalRecord {
            sample_rate_hz: 100.0,
            channels,
            differentiations: &[],
        };
        let error = operational_modes(&record, &OperationalSettings::default()).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    }
}

/// A velocity beside accelerations: the shape is of one standing wave all the same.
#[test]
fn velocities_beside_accelerations_have_one_phase_with_them() {
    let shape = [1.0, -0.7, 0.4, 0.9].map(Complex64::from);
    let s = std::f64::consts::TAU * 5.0 * Complex64::new(-0.02, (1.0f64 - 0.02 * 0.02).sqrt());
    let mut pole = subspace::SubspacePole {
        frequency_hz: 5.0,
        damping_ratio: 0.02,
        frequency_std_hz: 0.0,
        damping_std: 0.0,
        // As recorded: two accelerations, a velocity, a displacement.
        shape: vec![shape[0], shape[1], shape[2] / s, shape[3] / (s * s)],
    };
    pole.differentiate(&[0, 0, 1, 2]);
    for (z, truth) in pole.shape.iter().zip(shape) {
        assert!((z - truth).norm() < 1e-12, "{z}");
    }
}
