//! Modes of single FRFs against the modes that they were made of.

use num_complex::Complex64;

use crate::modal::synthetic::{Synthetic, SyntheticMode};
use crate::modal::{FrfModes, Settings, analyse_frf, analyse_frfs};

const MODES: [SyntheticMode; 3] = [
    SyntheticMode {
        frequency_hz: 3.6,
        damping_ratio: 0.03,
        constant: 0.01,
    },
    SyntheticMode {
        frequency_hz: 12.0,
        damping_ratio: 0.03,
        constant: -0.01,
    },
    SyntheticMode {
        frequency_hz: 40.0,
        damping_ratio: 0.02,
        constant: 0.02,
    },
];

fn analyse(case: Synthetic) -> FrfModes {
    let (f, h) = case.frf();
    analyse_frf(&f, &h, &Settings::default()).unwrap()
}

#[test]
fn a_conjugated_frf_is_turned_and_that_is_said() {
    let (f, mut h) = Synthetic::new(3.0, 90.0, 0.1, &MODES)
        .with_noise(0.0, 0.02, 3)
        .frf();
    let right = analyse_frf(&f, &h, &Settings::default()).unwrap();
    h.iter_mut().for_each(|h| *h = h.conj());
    let turned = analyse_frf(&f, &h, &Settings::default()).unwrap();
    assert!(!right.conjugated && turned.conjugated);
    assert!(turned.warnings.iter().any(|w| w.contains("conjugated")));
    assert_eq!(right.modes.len(), 3);
    for (a, b) in right.modes.iter().zip(&turned.modes) {
        approx::assert_relative_eq!(
            a.best().damping_ratio,
            b.best().damping_ratio,
            max_relative = 1e-6
        );
    }
}

#[test]
fn a_mode_of_negative_damping_is_named_and_left_out() {
    let unstable = SyntheticMode::new(25.0, -0.02, 0.01);
    let modes: Vec<SyntheticMode> = MODES.into_iter().chain([unstable]).collect();
    let found = analyse(Synthetic::new(3.0, 90.0, 0.1, &modes).with_noise(0.0, 0.02, 3));
    assert_eq!(found.modes.len(), 3);
    assert!(
        found
            .warnings
            .iter()
            .any(|w| w.contains("25.0") && w.contains("negative damping")),
        "{:?}",
        found.warnings
    );
}

#[test]
fn nothing_is_found_in_noise_or_in_a_line() {
    for seed in 0..20 {
        // Only the foot of a far mode, under 20 % noise.
        let found = analyse(
            Synthetic::new(0.0, 90.0, 0.1, &[SyntheticMode::new(900.0, 0.02, 1.0)])
                .with_noise(0.2, 0.0, seed),
        );
        assert!(found.modes.is_empty(), "seed {seed}: {:?}", found.modes);
    }
    // A free mass, with its infinite receptance at 0 Hz.
    let f: Vec<f64> = (0..400).map(|k| 0.1 * f64::from(k)).collect();
    let h: Vec<Complex64> = f.iter().map(|f| Complex64::new(-1.0 / (f * f), 0.0)).collect();
    assert!(
        analyse_frf(&f, &h, &Settings::default())
            .unwrap()
            .modes
            .is_empty()
    );
}

#[test]
fn modes_outside_the_band_are_not_reported() {
    let (f, h) = Synthetic::new(3.0, 90.0, 0.1, &MODES).frf();
    let settings = Settings {
        band_hz: Some([5.0, 30.0]),
        ..Settings::default()
    };
    let found = analyse_frf(&f, &h, &settings).unwrap();
    assert_eq!(found.modes.len(), 1);
    approx::assert_relative_eq!(found.modes[0].best().frequency_hz, 12.0, max_relative = 1e-4);
}

#[test]
fn the_modal_constant_is_that_of_the_mode() {
    let found = analyse(Synthetic::new(3.0, 90.0, 0.1, &MODES));
    for (found, mode) in found.modes.iter().zip(&MODES) {
        let constant = found.best().modal_constant.unwrap();
        approx::assert_relative_eq!(constant.re, mode.constant, max_relative = 0.01);
        assert!(constant.im.abs() < 0.01 * mode.constant.abs());
    }
}

#[test]
fn lines_too_coarse_for_the_damping_are_said() {
    let found = analyse(
        Synthetic::new(3.0, 90.0, 0.5, &[SyntheticMode::new(12.3, 0.01, 1.0)]).with_noise(0.02, 0.0, 5),
    );
    assert_eq!(found.modes.len(), 1);
    let best = found.modes[0].best();
    assert!((best.damping_ratio - 0.01).abs() < 4.0 * best.damping_std.unwrap());
    assert!(
        found.remarks.iter().any(|w| w.contains("too coarse lines")),
        "{:?}",
        found.remarks
    );
}

#[test]
fn constant_zero_and_short_curves_are_no_trouble() {
    for n in [0, 1, 5, 9, 300] {
        let f: Vec<f64> = (0..n).map(f64::from).collect();
        for value in [0.0, 1.0, 1e-300, 1e300] {
            let h = vec![Complex64::new(value, value); f.len()];
            let found = analyse_frf(&f, &h, &Settings::default()).unwrap();
            assert!(found.modes.is_empty());
        }
    }
}

/// With less effort on each of many FRFs every mode is found all the same.
#[test]
fn many_frfs_are_analysed_as_one_is() {
    let frfs: Vec<(Vec<f64>, Vec<Complex64>)> = (0..41)
        .map(|seed| {
            Synthetic::new(3.0, 90.0, 0.1, &MODES)
                .with_noise(0.0, 0.02, seed)
                .frf()
        })
        .collect();
    let settings = Settings::default();
    for many in [&frfs[..], &frfs[..3]] {
        for found in analyse_frfs(many, &settings).unwrap() {
            assert_eq!(found.modes.len(), 3);
            for (found, mode) in found.modes.iter().zip(&MODES) {
                let best = found.best();
                assert!(
                    (best.damping_ratio - mode.damping_ratio).abs() < 5.0 * best.damping_std.unwrap(),
                    "{best:?}"
                );
            }
        }
    }
    let mut wrong = frfs;
    wrong[7].0.swap(2, 3);
    assert!(analyse_frfs(&wrong, &settings).is_err());
}
