//! Modes of single FRFs against the modes that they were made of.

use num_complex::Complex64;

use crate::modal::synthetic::{Synthetic, SyntheticMode};
use crate::modal::{Disturbance, FrfMode, FrfModes, Method, Settings, analyse_frf, analyse_frfs};

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

/// Frequencies of the modes, Hz, to the next whole number.
fn rounded_hz(found: &FrfModes) -> Vec<f64> {
    let modes = found.modes.iter();
    modes.map(|m| m.best().frequency_hz.round()).collect()
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

/// A mode on two or three noisy lines may turn as it likes, and be the highest of all: the others know better, in the same FRF and in
/// those beside it.
#[test]
fn one_badly_measured_mode_does_not_conjugate_an_frf() {
    let wrong = |f: f64, constant: f64| SyntheticMode::new(f, -0.004, constant);
    let frf = |modes: &[SyntheticMode]| {
        Synthetic::new(3.0, 90.0, 0.1, modes)
            .with_noise(0.0, 0.005, 3)
            .frf()
    };
    let with_it: Vec<SyntheticMode> = MODES.into_iter().chain([wrong(5.0, 0.05)]).collect();
    let (f, h) = frf(&with_it);
    assert!(!analyse_frf(&f, &h, &Settings::default()).unwrap().conjugated);
    // Alone it has nothing to say against it.
    let alone = frf(&[wrong(5.0, 0.05)]);
    assert!(
        analyse_frf(&alone.0, &alone.1, &Settings::default())
            .unwrap()
            .conjugated
    );
    let beside = analyse_frfs(&[alone, frf(&MODES)], &Settings::default()).unwrap();
    assert!(beside.iter().all(|modes| !modes.conjugated));
    // A whole FRF of another convention keeps its word.
    let (f, mut h) = frf(&MODES);
    let straight = (f.clone(), h.clone());
    h.iter_mut().for_each(|h| *h = h.conj());
    let mixed = analyse_frfs(&[straight.clone(), (f, h), straight], &Settings::default()).unwrap();
    assert_eq!(
        mixed.iter().map(|m| m.conjugated).collect::<Vec<_>>(),
        [false, true, false]
    );
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

/// Whatever the number of ripples that turn the other way (leakage, wandering of the structure): the resonances tell how phases are
/// counted.
#[test]
fn ripples_do_not_outvote_the_resonances() {
    let case = |count: i32| {
        let ripples = (0..count).map(|k| SyntheticMode::new(48.0 + 3.3 * f64::from(k), -0.004, 2e-4));
        let modes: Vec<SyntheticMode> = MODES.into_iter().chain(ripples).collect();
        Synthetic::new(3.0, 90.0, 0.1, &modes).with_noise(0.0, 0.005, 3)
    };
    let found = analyse(case(12));
    let ripples = found.warnings.iter().filter(|w| w.contains("wrong way round"));
    assert!(ripples.count() > 3 && !found.conjugated, "{:?}", found.warnings);
    let at = |f: f64| {
        found
            .modes
            .iter()
            .any(|m| (m.best().frequency_hz / f - 1.0).abs() < 2e-3)
    };
    assert!(MODES.iter().all(|m| at(m.frequency_hz)), "{:?}", found.modes);
    let (f, mut h) = case(3).frf();
    h.iter_mut().for_each(|h| *h = h.conj());
    assert!(analyse_frf(&f, &h, &Settings::default()).unwrap().conjugated);
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

/// A mode of 12 Hz beside another, over distance (in sums of their half-widths), damping and noise: for each method the
/// error of its damping and frequency over what is stated.
struct Trial {
    distance: f64,
    mode: FrfMode,
    off: Vec<(Method, f64, f64)>,
}

fn trials(seeds: u64) -> Vec<Trial> {
    let mut found = Vec::new();
    for distance in [1.6, 3.0, 6.0, 25.0] {
        for zeta in [0.01, 0.03] {
            for noise in [0.005, 0.02] {
                for seed in 0..seeds {
                    let sign = if seed % 2 == 0 { 1.0 } else { -1.0 };
                    let at = 12.0 * (1.0 + 2.0 * distance * zeta);
                    let pair = [
                        SyntheticMode::new(12.0, zeta, 0.01),
                        SyntheticMode::new(at, zeta, 0.01 * sign),
                    ];
                    let case = Synthetic::new(3.0, 40.0, 0.05, &pair).with_noise(noise, 0.0, 1000 + seed);
                    for mode in analyse(case).modes {
                        if (mode.best().frequency_hz - 12.0).abs() > 0.5 * zeta * 12.0 {
                            continue;
                        }
                        let off = mode
                            .estimates
                            .iter()
                            .filter_map(|e| {
                                let damping = (e.damping_ratio - zeta) / e.damping_std?;
                                Some((e.method, damping, (e.frequency_hz - 12.0) / e.frequency_std_hz?))
                            })
                            .collect();
                        found.push(Trial { distance, mode, off });
                    }
                }
            }
        }
    }
    found
}

/// Shares of the errors within one and two stated errors, and how many there were.
fn covered(errors: impl Iterator<Item = f64>) -> (f64, f64, usize) {
    let errors: Vec<f64> = errors.map(f64::abs).collect();
    let within =
        |most: f64| errors.iter().filter(|e| **e <= most).count() as f64 / errors.len().max(1) as f64;
    (within(1.0), within(1.96), errors.len())
}

/// The stated errors of all three methods hold the truth at least as often as they say, over distance, damping and noise,
/// and at each distance by itself.
fn errors_are_honest(seeds: u64, allowance: f64) {
    let trials = trials(seeds);
    let mut report = String::new();
    let mut wrong = false;
    for method in [Method::LocalFit, Method::CircleFit, Method::HalfPower] {
        for distance in [None, Some(1.6), Some(3.0), Some(6.0), Some(25.0)] {
            let of = |which: fn(&(Method, f64, f64)) -> f64| {
                let here = trials
                    .iter()
                    .filter(move |t| distance.is_none_or(|d| t.distance == d));
                covered(here.flat_map(|t| &t.off).filter(|o| o.0 == method).map(which))
            };
            for (what, (one, two, count)) in [("damping", of(|o| o.1)), ("frequency", of(|o| o.2))] {
                report += &format!(
                    "{} {distance:?} {what}: {one:.3} {two:.3} of {count}\n",
                    method.id()
                );
                // Three standard deviations of a share of so many trials.
                let chance =
                    |share: f64| 3.0 * (share * (1.0 - share) / count.max(1) as f64).sqrt() + allowance;
                wrong |= count > 20 && (one < 0.68 - chance(0.68) || two < 0.95 - chance(0.95));
            }
        }
    }
    assert!(!wrong, "{report}");
    println!("{report}");
}

#[test]
fn stated_errors_hold_the_truth() {
    errors_are_honest(12, 0.0);
}

#[test]
fn stated_errors_hold_the_truth_in_thousands() {
    errors_are_honest(400, 0.02);
}

/// Close modes are told as such with the local fit recommended for that reason; a mode that stands alone disturbs nobody.
#[test]
fn overlap_is_told_and_an_answer_recommended() {
    let trials = trials(6);
    let (close, far): (Vec<&Trial>, Vec<&Trial>) = trials
        .iter()
        .filter(|t| t.distance == 1.6 || t.distance == 25.0)
        .partition(|t| t.distance == 1.6);
    let overlapping = close
        .iter()
        .filter(|t| t.mode.disturbance == Some(Disturbance::Overlap))
        .count();
    assert!(
        close.len() > 10 && overlapping * 10 >= close.len() * 9,
        "{overlapping} of {}",
        close.len()
    );
    for trial in &close {
        if trial.mode.disturbance.is_some() {
            assert_eq!(trial.mode.recommended, Method::LocalFit);
            assert!(
                trial.mode.reason.contains("overlap") || trial.mode.reason.contains("residual"),
                "{}",
                trial.mode.reason
            );
        }
    }
    let disturbed = far.iter().filter(|t| t.mode.disturbance.is_some()).count();
    assert!(
        far.len() > 20 && disturbed * 20 <= far.len(),
        "{disturbed} of {}",
        far.len()
    );
    assert!(far.iter().all(|t| !t.mode.reason.is_empty()));
    let remarks = analyse(
        Synthetic::new(
            3.0,
            40.0,
            0.05,
            &[
                SyntheticMode::new(12.0, 0.03, 0.01),
                SyntheticMode::new(13.15, 0.03, 0.01),
            ],
        )
        .with_noise(0.005, 0.0, 3),
    )
    .remarks;
    assert!(remarks.iter().any(|r| r.contains("modes overlap")), "{remarks:?}");
}

/// A mode whose width lies between two lines has a frequency and no damping: that is said of it.
#[test]
fn a_width_that_the_lines_do_not_determine_is_told() {
    let narrow = [
        SyntheticMode::new(12.0, 0.02, 0.01),
        SyntheticMode::new(30.013, 2e-5, 3e-5),
    ];
    let found = analyse(Synthetic::new(8.0, 40.0, 0.1, &narrow).with_noise(0.0002, 0.0, 4));
    assert_eq!(rounded_hz(&found), [12.0, 30.0]);
    let says = |m: &FrfMode| m.reason.contains("do not determine its width");
    assert!(
        !says(&found.modes[0]) && says(&found.modes[1]),
        "{:?}",
        found.modes
    );
}

/// A mode on the flank of strong ones far away, of which no peak is in the lines: the residual is named, and half-power, which
/// knows none, is off by what is said.
#[test]
fn a_residual_is_told() {
    let found = analyse(
        Synthetic::new(
            8.0,
            16.0,
            0.02,
            &[
                SyntheticMode::new(12.0, 0.02, 0.01),
                SyntheticMode::new(30.0, 0.02, 2.0),
            ],
        )
        .with_noise(0.0002, 0.0, 4),
    );
    let mode = found
        .modes
        .iter()
        .find(|m| (m.best().frequency_hz - 12.0).abs() < 0.1)
        .unwrap();
    assert_eq!(mode.disturbance, Some(Disturbance::Residual), "{mode:?}");
    if let Some(half) = mode.estimates.iter().find(|e| e.method == Method::HalfPower) {
        let off = half.damping_ratio - 0.02;
        assert!(
            (half.damping_bias.unwrap() - off).abs() < 0.3 * off.abs(),
            "{half:?}"
        );
    }
}

/// A mode so broad that four of its half-widths reach below 0 Hz, beside what one pole cannot follow: no pole is sought there.
#[test]
fn a_very_broad_mode_is_no_trouble() {
    for zeta in [0.26, 0.3, 0.4] {
        let modes = [
            SyntheticMode::new(12.0, zeta, 0.01),
            SyntheticMode::new(15.0, 0.2, 0.008),
        ];
        let found = analyse(Synthetic::new(1.0, 40.0, 0.05, &modes).with_noise(0.0005, 0.0, 9));
        assert!(found.modes.iter().all(|m| m.best().frequency_hz > 0.0));
    }
}

/// Where the force of a hammer fades, noise comes as ripples of a line: peaks above the noise of the whole FRF, but no modes.
#[test]
fn ripples_of_a_line_are_no_modes() {
    let modes = [
        SyntheticMode::new(180.0, 0.009, 1.0),
        SyntheticMode::new(1010.0, 0.009, 1.0),
    ];
    let (f, mut h) = Synthetic::new(5.0, 3200.0, 1.0, &modes)
        .with_noise(0.0, 1e-3, 7)
        .frf();
    let ripples = [1890.0, 1943.0, 2080.0, 2148.0, 2680.0, 2911.0];
    for (k, at) in ripples.iter().enumerate() {
        let line = f.iter().position(|f| f == at).unwrap();
        h[line] *= Complex64::from_polar(1.03, 0.01 * k as f64);
    }
    let found = analyse_frf(&f, &h, &Settings::default()).unwrap();
    assert_eq!(rounded_hz(&found), [180.0, 1010.0], "{:?}", found.remarks);
    assert!(!found.undetermined.is_empty(), "{:?}", found.remarks);
    for peak in &found.undetermined {
        let frequency_hz = peak.best().frequency_hz;
        assert!(
            ripples.iter().any(|f| (f - frequency_hz).abs() < 1.0),
            "{frequency_hz} Hz"
        );
        let named = format!("{frequency_hz:.2} Hz (a ripple whose width its lines do not determine)");
        assert!(
            found.remarks.iter().any(|r| r.contains(&named)),
            "{:?}",
            found.remarks
        );
    }
}

/// It rises out of what is around it: a mode, though its damping is not known.
#[test]
fn a_resonance_narrower_than_a_line_is_no_ripple() {
    let modes = [
        SyntheticMode::new(180.0, 0.009, 1.0),
        SyntheticMode::new(410.0, 1e-6, 1e-3),
    ];
    let found = analyse(Synthetic::new(5.0, 800.0, 1.0, &modes).with_noise(0.0, 1e-3, 7));
    assert_eq!(
        rounded_hz(&found),
        [180.0, 410.0],
        "{:?} {:?}",
        found.undetermined,
        found.remarks
    );
}

/// A disturbance of one line, well above what is around it.
#[test]
fn one_line_that_stands_out_is_no_mode() {
    let modes = [SyntheticMode::new(180.0, 0.009, 1.0)];
    let (f, mut h) = Synthetic::new(5.0, 800.0, 1.0, &modes)
        .with_noise(0.0, 1e-3, 7)
        .frf();
    let line = f.iter().position(|f| *f == 410.0).unwrap();
    h[line] *= 3.0;
    let found = analyse_frf(&f, &h, &Settings::default()).unwrap();
    assert_eq!(rounded_hz(&found), [180.0], "{:?}", found.remarks);
}
