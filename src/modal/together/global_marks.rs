//! The marks of the global fit on robot-like sets: seven modes from 6 to 60 Hz, two of them closer than their widths,
//! twelve responses at three references.

use num_complex::Complex64;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::modal::synthetic::{Synthetic, SyntheticMode};
use crate::modal::*;

const POLES: [(f64, f64); 7] = [
    (6.4, 0.03),
    (8.2, 0.028),
    // 0.25 Hz apart, half-power bands of 0.83 and 0.72 Hz.
    (13.8, 0.03),
    (14.05, 0.0256),
    (19.3, 0.025),
    (33.0, 0.02),
    (56.0, 0.018),
];
const RESPONSES: usize = 12;
const REFERENCES: usize = 3;

type Frf = (Vec<f64>, Vec<Complex64>);

/// By mode, then response (the first ones are the references too).
fn shapes() -> Vec<Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    (0..POLES.len())
        .map(|_| (0..RESPONSES).map(|_| random.random_range(-1.0..1.0)).collect())
        .collect()
}

fn frfs(step_hz: f64, noise: f64, seed: u64) -> Vec<Frf> {
    let shape = shapes();
    let mut all = Vec::new();
    for response in 0..RESPONSES {
        for reference in 0..REFERENCES {
            let modes: Vec<SyntheticMode> = POLES
                .iter()
                .zip(&shape)
                .map(|(&(f, zeta), phi)| SyntheticMode::new(f, zeta, 0.005 * phi[response] * phi[reference]))
                .collect();
            let number = (response * REFERENCES + reference) as u64;
            all.push(
                Synthetic::new(3.0, 70.0, step_hz, &modes)
                    .with_noise(0.0, noise, 1000 * seed + number)
                    .frf(),
            );
        }
    }
    all
}

fn found(frfs: &[Frf]) -> GlobalModes {
    let settings = Settings::default();
    let single: Vec<FrfModes> = frfs
        .iter()
        .map(|(f, h)| analyse_frf(f, h, &settings).unwrap())
        .collect();
    let members: Vec<SetMember> = frfs
        .iter()
        .zip(&single)
        .enumerate()
        .map(|(k, ((f, h), modes))| SetMember {
            frequency_hz: f,
            receptance_m_per_n: h,
            modes,
            dofs: Some([k / REFERENCES, k % REFERENCES]),
        })
        .collect();
    global(&members, &settings).unwrap()
}

#[test]
fn without_noise_the_poles_are_exact() {
    for step_hz in [0.1, 0.25] {
        let found = found(&frfs(step_hz, 0.0, 0));
        assert_eq!(found.modes.len(), POLES.len(), "{:?}", found.modes);
        for (mode, (f, zeta)) in found.modes.iter().zip(POLES) {
            assert!((mode.frequency_hz / f - 1.0).abs() < 1e-4, "{mode:?}");
            assert!((mode.damping_ratio / zeta - 1.0).abs() < 2e-3, "{mode:?}");
        }
    }
}

#[test]
fn with_noise_the_errors_and_the_standard_deviations_keep_the_marks() {
    keep_the_marks(25);
}

#[test]
#[ignore = "the same over a hundred draws: a minute"]
fn over_a_hundred_draws() {
    keep_the_marks(100);
}

/// Two per cent noise, 0.25 Hz lines: errors, and how often one standard deviation holds the truth.
fn keep_the_marks(draws: u64) {
    let mut squares = [[0.0; 2]; POLES.len()];
    let mut covered = [0usize; 2];
    let mut shapes_covered = [0usize; 2];
    for seed in 1..=draws {
        let found = found(&frfs(0.25, 0.02, seed));
        assert_eq!(found.modes.len(), POLES.len(), "draw {seed}: {:?}", found.modes);
        for (k, (mode, (f, zeta))) in found.modes.iter().zip(POLES).enumerate() {
            let errors = [mode.frequency_hz - f, mode.damping_ratio - zeta];
            covered[0] += (errors[0].abs() <= mode.frequency_std_hz) as usize;
            covered[1] += (errors[1].abs() <= mode.damping_std) as usize;
            squares[k][0] += (errors[0] / f).powi(2) / draws as f64;
            squares[k][1] += (errors[1] / zeta).powi(2) / draws as f64;
            // Proportional damping: the true constants are real.
            for (value, std) in mode.constants.iter().flatten() {
                shapes_covered[0] += (value.im.abs() <= *std) as usize;
                shapes_covered[1] += 1;
            }
            assert!(mode.complexity.unwrap().mpc > 0.95, "draw {seed}: {mode:?}");
        }
    }
    for (k, [f, zeta]) in squares.iter().enumerate() {
        println!(
            "{:5.2} Hz: rms error f {:.4} %, ζ {:.3} %",
            POLES[k].0,
            100.0 * f.sqrt(),
            100.0 * zeta.sqrt()
        );
    }
    let all = (draws as usize * POLES.len()) as f64;
    let part = covered.map(|c| c as f64 / all);
    let shapes = shapes_covered[0] as f64 / shapes_covered[1] as f64;
    println!("covered: f {:.3}, ζ {:.3}, shapes {shapes:.3}", part[0], part[1]);
    for [f, zeta] in squares {
        assert!(f.sqrt() < 5e-4 && zeta.sqrt() < 1e-2);
    }
    for part in [part[0], part[1], shapes] {
        assert!((0.60..=0.76).contains(&part), "{part}");
    }
}

#[test]
fn the_mac_tells_modes_apart_and_the_diagram_says_why() {
    let found = found(&frfs(0.25, 0.02, 7));
    let truth: Vec<Vec<Complex64>> = shapes()
        .iter()
        .map(|phi| phi[..RESPONSES].iter().copied().map(Complex64::from).collect())
        .collect();
    assert_eq!(found.mac.len(), POLES.len());
    for (j, row) in found.mac.iter().enumerate() {
        for (k, value) in row.iter().enumerate() {
            let expected = shape::mac(&truth[j], &truth[k]);
            assert!(
                (value - expected).abs() < 0.05,
                "modes {j} and {k}: {value} for {expected}"
            );
        }
    }
    let diagram = &found.stabilisation;
    assert_eq!(diagram.references, REFERENCES);
    assert_eq!(
        diagram.candidates.iter().filter(|c| c.chosen).count(),
        POLES.len()
    );
    assert!(
        diagram
            .candidates
            .iter()
            .all(|c| c.why.contains("taken") || c.why.contains("left out"))
    );
    // Two per cent of noise, of which the fit follows a little; a single FRF's figure depends on the few lines of its peak.
    let fits: Vec<&Reconstruction> = found.reconstructions.iter().flatten().collect();
    assert_eq!(fits.len(), RESPONSES * REFERENCES);
    let mean = |of: fn(&Reconstruction) -> f64| fits.iter().map(|f| of(f)).sum::<f64>() / fits.len() as f64;
    let (error, noise) = (mean(|f| f.error_nrms), mean(|f| f.noise_nrms));
    assert!((0.015..0.022).contains(&error), "{error}");
    assert!((0.018..0.022).contains(&noise), "{noise}");
}
