//! Plausible data for each figure, made up for the tests.

use std::f64::consts::PI;

use num_complex::Complex64;

use super::*;
use crate::Error;

/// A deterministic stand-in for noise, −1 … 1.
pub fn jitter(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

/// Receptance of a few modes (frequency in Hz, damping ratio, stiffness in N/m), plus noise.
pub fn frf(label: &str, modes: &[(f64, f64, f64)], noise: f64) -> FrfCurve {
    let frequency_hz: Vec<f64> = (0..436).map(|i| 6.0 + 0.125 * i as f64).collect();
    let value = frequency_hz.iter().enumerate().map(|(i, f)| {
        let sum: Complex64 = modes
            .iter()
            .map(|(f0, zeta, k)| {
                let r = f / f0;
                Complex64::new(1.0, 0.0) / (k * Complex64::new(1.0 - r * r, 2.0 * zeta * r))
            })
            .sum();
        sum + noise * Complex64::new(jitter(2 * i), jitter(2 * i + 1))
    });
    FrfCurve {
        label: label.into(),
        value: value.collect(),
        frequency_hz,
    }
}

pub fn frf_figure() -> FrfFigure {
    let truth = [
        (11.3, 0.03, 1.2e6),
        (17.9, 0.025, 3.0e6),
        (34.1, 0.02, 8.0e6),
        (48.0, 0.03, 1.5e7),
    ];
    let nominal = [(13.0, 0.02, 1.5e6), (19.5, 0.02, 3.6e6), (37.0, 0.02, 1.0e7)];
    FrfFigure {
        title: "Posture p1, response 1X to force 1X: measured against model".into(),
        quantity: "Receptance".into(),
        unit: "m/N".into(),
        measured: Some(frf("measured", &truth, 4e-9)),
        models: vec![
            frf("model, nominal (nrms 92 %)", &nominal, 0.0),
            frf("model, calibrated (nrms 11 %)", &truth[..3], 0.0),
        ],
        noise: Some(NoiseLevel {
            label: "noise level".into(),
            frequency_hz: vec![6.0, 60.5],
            magnitude: vec![4e-9, 4e-9],
        }),
    }
}

pub fn nyquist() -> NyquistFigure {
    let frf = frf_figure();
    NyquistFigure {
        title: "Posture p1, 1X/1X in the complex plane".into(),
        unit: "m/N".into(),
        measured: frf.measured,
        models: frf.models,
    }
}

pub fn heat_map(rows: usize, columns: usize) -> HeatMap {
    let value = |r: usize, c: usize| Some(0.04 + 0.5 * (jitter(7 * r + 31 * c) * 0.5 + 0.5).powi(2));
    let mut values: Vec<Vec<_>> = (0..rows)
        .map(|r| (0..columns).map(|c| value(r, c)).collect())
        .collect();
    if let Some(cell) = values.get_mut(1).and_then(|row| row.get_mut(2)) {
        *cell = None;
    }
    HeatMap {
        title: "Calibrated model against measurement: error by posture and direction".into(),
        row_label: "Posture".into(),
        column_label: "Response / excitation".into(),
        rows: (0..rows).map(|r| format!("p{}", r + 1)).collect(),
        columns: (0..columns)
            .map(|c| format!("{0}X/{0}{1}", c / 3 + 1, ["X", "Y", "Z"][c % 3]))
            .collect(),
        values,
        value_label: "Error nrms".into(),
        ..Default::default()
    }
}

/// Two tables on one logarithmic colour scale.
pub fn heat_map_pair() -> HeatMap {
    let before = heat_map(24, 10);
    let times = |factor: f64| {
        let row = |row: &Vec<Option<f64>>| {
            row.iter()
                .map(|v| v.map(|v| (1.0 + factor * v).powi(2)))
                .collect()
        };
        before.values.iter().map(row).collect::<Vec<_>>()
    };
    HeatMap {
        values: times(10.0),
        beside: vec![times(1.0)],
        table_titles: vec!["before".into(), "after".into()],
        value_label: "error / noise".into(),
        format: CellFormat::Significant(2),
        range: Some((1.0, 40.0)),
        log: true,
        ..before
    }
}

pub fn parameters() -> ParameterFigure {
    let row = |i: usize| ParameterRow {
        name: format!("joint {} stiffness", i + 1),
        unit: "N·m/rad".into(),
        nominal: 2.5e6 / (i + 1) as f64,
        before: Some(DrawnEstimate {
            value: 2.5e6 / (i + 1) as f64,
            std_error: None,
        }),
        after: Some(DrawnEstimate {
            value: 2.5e6 / (i + 1) as f64 * (1.0 + 0.3 * jitter(i)),
            std_error: Some(2.5e6 / (i + 1) as f64 * (0.002 + 0.03 * i as f64 * 0.4)),
        }),
    };
    let mut rows: Vec<_> = (0..6).map(row).collect();
    rows.push(ParameterRow {
        name: "damping ratio".into(),
        nominal: 0.02,
        before: Some(DrawnEstimate {
            value: 0.02,
            std_error: None,
        }),
        after: Some(DrawnEstimate {
            value: 0.0263,
            std_error: Some(0.0004),
        }),
        ..Default::default()
    });
    ParameterFigure {
        title: "Parameters before and after calibration".into(),
        before_label: "nominal".into(),
        after_label: "calibrated".into(),
        rows,
    }
}

pub fn force_record() -> ForceRecord {
    let rate = 10_000.0;
    let channel = |label: &str, mean: f64, slope: f64| {
        let samples = (0..40_000).map(|i| {
            let t = i as f64 / rate;
            let cutting = (1.0..3.2).contains(&t);
            let drift = 3.0 + slope * t;
            let teeth = mean * (1.0 + 0.8 * (2.0 * PI * 120.0 * t).sin());
            drift + 2.0 * jitter(i) + if cutting { teeth } else { 0.0 }
        });
        ForceTrace {
            label: label.into(),
            unit: "N".into(),
            start_s: 0.0,
            sample_interval_s: 1.0 / rate,
            samples: samples.collect(),
            drift: vec![(0.0, 3.0), (4.0, 3.0 + 4.0 * slope)],
            steady_level: Some(mean + 3.0 + 2.0 * slope),
        }
    };
    ForceRecord {
        title: "Cut 03: 1200 rpm, 0.10 mm per tooth".into(),
        channels: vec![
            channel("Fx", 60.0, 6.0),
            channel("Fy", -110.0, -9.0),
            channel("Fz", 25.0, 2.0),
        ],
        air_s: vec![(0.0, 0.95), (3.3, 4.0)],
        steady_s: Some((1.2, 2.9)),
    }
}

pub fn regression() -> RegressionFigure {
    let series = |label: &str, intercept: f64, slope: f64, k: usize| RegressionSeries {
        label: label.into(),
        points: (0..5)
            .map(|i| {
                let x = 0.03 + 0.03 * i as f64;
                let y = intercept + slope * x + 3.0 * jitter(i + 10 * k);
                RegressionMark {
                    label: format!("cut {i}"),
                    x,
                    y,
                    std_error: Some(4.0),
                    excluded: i == 4 && k == 1,
                }
            })
            .collect(),
        line: Some((intercept, slope)),
    };
    RegressionFigure {
        title: "Average cutting force over feed, slot milling, 60 m/min".into(),
        x_label: "Feed per tooth (mm)".into(),
        y_label: "Average force (N)".into(),
        series: vec![
            series("Fx: R² = 0.991", -22.0, -520.0, 0),
            series("Fy: R² = 0.998", 31.0, 1480.0, 1),
            series("Fz: R² = 0.962", 4.0, 170.0, 2),
        ],
    }
}

pub fn lobe_curve(label: &str, least: f64, frequency_hz: f64) -> LobeTrace {
    let spindle_rpm: Vec<f64> = (100..=1500).map(f64::from).collect();
    let depth = |n: f64| {
        let waves = 60.0 * frequency_hz / (2.0 * n);
        let phase = waves - waves.floor();
        least * (1.0 + 0.02 * n / 10.0 * (PI * phase).sin().abs().powi(2) / (0.03 + (1.0 - phase)))
    };
    let depth_limit_mm = spindle_rpm
        .iter()
        .map(|n| (!(700.0..740.0).contains(n)).then(|| depth(*n)))
        .collect();
    LobeTrace {
        label: label.into(),
        spindle_rpm,
        depth_limit_mm,
        ..Default::default()
    }
}

fn lobe_markers() -> Vec<LobeMarker> {
    let marker = |spindle_rpm, depth_mm, outcome, label: &str| LobeMarker {
        spindle_rpm,
        depth_mm,
        outcome,
        label: label.into(),
    };
    vec![
        marker(400.0, 0.3, LobeOutcome::Stable, ""),
        marker(900.0, 1.2, LobeOutcome::Chatter, "cut 07"),
        marker(1300.0, 0.6, LobeOutcome::Recommended, ""),
    ]
}

pub fn lobes() -> LobesFigure {
    LobesFigure {
        title: "Stability lobes at the four thesis postures, slot milling".into(),
        panels: vec![LobePanel {
            curves: vec![
                lobe_curve("p1, before calibration", 0.55, 13.0),
                lobe_curve("p1, calibrated", 0.42, 11.3),
                lobe_curve("p2, calibrated", 0.61, 17.9),
                lobe_curve("p3, calibrated", 0.75, 24.0),
            ],
            absolute_limit_mm: Some(0.42),
            markers: lobe_markers(),
            ..Default::default()
        }],
        depth_cap_mm: None,
    }
}

/// Before and after an effect was added, with a band, one frame a posture.
pub fn lobes_before_and_after() -> LobesFigure {
    let panel = |name: &str, least: f64, frequency_hz: f64| {
        let mut curve = lobe_curve("depth limit", least, frequency_hz);
        let scaled = |factor: f64| {
            curve
                .depth_limit_mm
                .iter()
                .map(|d| d.map(|d| factor * d))
                .collect()
        };
        curve.band_mm = Some([scaled(0.85), scaled(1.15)]);
        curve.before_mm = lobe_curve("", 1.3 * least, 1.1 * frequency_hz).depth_limit_mm;
        LobePanel {
            name: name.into(),
            curves: vec![curve],
            absolute_limit_mm: Some(least),
            markers: lobe_markers(),
        }
    };
    LobesFigure {
        title: "Stability lobes before and after link-flexibility was added".into(),
        panels: vec![panel("p1", 0.42, 11.3), panel("p2", 0.6, 17.9)],
        depth_cap_mm: None,
    }
}

pub fn side_by_side() -> SideBySide {
    let values = |scale: f64, k: usize| -> Vec<_> {
        (0..6)
            .map(|i| Some(scale * 10f64.powf(0.5 * jitter(i) + 0.1 * jitter(i + 20 * k))))
            .collect()
    };
    let mut measured = values(1000.0, 1);
    measured[4] = None;
    SideBySide {
        title: "Static stiffness at the flange (tables 5 and 6)".into(),
        y_label: "Stiffness (N/mm)".into(),
        groups: ["A, X", "A, Y", "A, Z", "B, X", "B, Y", "B, Z"]
            .map(|s| format!("posture {s}"))
            .to_vec(),
        series: vec![
            BarSeries {
                label: "published model".into(),
                values: values(1200.0, 0),
            },
            BarSeries {
                label: "measured".into(),
                values: measured,
            },
            BarSeries {
                label: "ours, nominal".into(),
                values: values(1150.0, 2),
            },
            BarSeries {
                label: "ours, calibrated".into(),
                values: values(1020.0, 1),
            },
        ],
        log: true,
        level: Some(("least that can be measured".into(), 500.0)),
    }
}

pub fn history() -> HistoryFigure {
    let revision = |label: &str, fit, held_out| HistoryMark {
        label: label.into(),
        fit_nrms: fit,
        held_out_nrms: Some(held_out),
    };
    HistoryFigure {
        title: "Error by revision of the model".into(),
        revisions: vec![
            revision("0 baseline", 0.412, 0.447),
            revision("1 + base-compliance", 0.183, 0.201),
            revision("2 + tool-flexibility", 0.0212, 0.0224),
        ],
        noise_floor_nrms: Some(0.0201),
    }
}

pub fn resonances() -> ResonanceFigure {
    let row = |i: usize| ResonanceRow {
        label: format!("{} {}", i / 2 + 1, ["X", "Y"][i % 2]),
        measured_hz: [7.0, 12.4, 19.5, 34.0, 47.8]
            .iter()
            .map(|f| f + 0.6 * jitter(i + *f as usize))
            .map(|f| (f, [f - 0.6, f + 0.4]))
            .collect(),
        before_hz: vec![6.8, 8.0, 12.9, 19.0, 25.0],
        after_hz: vec![6.7, 7.9, 12.5, 19.3, 33.5, 48.2, 55.0],
    };
    ResonanceFigure {
        title: "Measured resonances and the model's modes".into(),
        before_label: "modes, rigid links".into(),
        after_label: "modes with link-flexibility".into(),
        rows: (0..8).map(row).collect(),
        bands_hz: vec![(32.0, 37.0), (47.0, 49.0)],
    }
}

pub fn hole() -> HoleFigure {
    let angle_deg: Vec<f64> = (0..72)
        .map(|i| 5.0 * f64::from(i))
        .filter(|a| !(200.0..240.0).contains(a))
        .collect();
    let wave = |middle: f64, swing: f64| -> Vec<f64> {
        let at = |a: &f64| middle + swing * (a + 30.0).to_radians().sin();
        angle_deg.iter().map(at).collect()
    };
    let panel = |label: &str, middle, swing, tolerance| HolePanel {
        label: label.into(),
        value: wave(middle, swing),
        bound: wave(1.1 * middle, 1.1 * swing),
        tolerance,
    };
    HoleFigure {
        title: "Static error of the hole over the redundancy angle".into(),
        recommended_deg: Some(247.3),
        panels: vec![
            panel("Position error (mm)", 0.2, 0.12, 0.25),
            panel("Tilt (°)", 0.02, 0.01, 0.5),
        ],
        angle_deg,
    }
}

pub fn control_chart() -> ControlChartFigure {
    let count = 24;
    let panel = |label: &str, level: f64, step: f64| ControlPanel {
        label: label.into(),
        points: (0..count)
            .map(|i| {
                let last = i + 1 == count;
                (i != 7).then(|| ControlPoint {
                    value: level * (1.0 + 0.01 * jitter(i) - if last { step } else { 0.0 }),
                    std_error: Some(0.004 * level),
                    outside: last && step > 0.0,
                })
            })
            .collect(),
        limits: Some([level, 0.96 * level, 1.04 * level]),
    };
    ControlChartFigure {
        title: "cell-7: what the campaigns say over time".into(),
        names: (1..=count).map(|i| format!("2026-11-{i:02}")).collect(),
        panels: vec![
            panel("joint-2.stiffness_nm_per_rad", 1.6e6, 0.12),
            panel("joint-1.stiffness_nm_per_rad", 2.1e6, 0.0),
            ControlPanel {
                limits: None,
                ..panel("damping_ratio", 0.031, 0.0)
            },
        ],
    }
}

pub fn gallery() -> Vec<(&'static str, Result<Vec<u8>, Error>)> {
    let linear = SideBySide {
        log: false,
        ..side_by_side()
    };
    let mut flat_history = history();
    flat_history.revisions.pop();
    flat_history.noise_floor_nrms = Some(0.09);
    vec![
        ("frf", frf_figure().png()),
        ("nyquist", nyquist().png()),
        ("resonances", resonances().png()),
        ("heat_map", heat_map(6, 9).png()),
        ("heat_map_large", heat_map(40, 36).png()),
        ("heat_map_pair", heat_map_pair().png()),
        ("heat_map_small", heat_map(2, 3).png()),
        ("parameters", parameters().png()),
        ("force_record", force_record().png()),
        ("regression", regression().png()),
        ("lobes", lobes().png()),
        ("hole", hole().png()),
        ("lobes_before_and_after", lobes_before_and_after().png()),
        ("side_by_side", side_by_side().png()),
        ("side_by_side_linear", linear.png()),
        ("control_chart", control_chart().png()),
        ("history", history().png()),
        ("history_linear", flat_history.png()),
    ]
}
