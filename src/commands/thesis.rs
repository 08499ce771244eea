use serde_json::json;

use super::Outcome;
use super::text::{number, percent, table};
use crate::Result;
use crate::lobes::Peak;
use crate::thesis::{CaseStudy, LobeTips, Row, case_study};

#[derive(clap::Args)]
pub struct Args {}

pub fn run(_args: Args) -> Result<Outcome> {
    let study = case_study()?;
    Ok(Outcome {
        text: describe(&study),
        json: json!(study),
    })
}

fn optional(value: Option<f64>) -> String {
    value.map_or("–".into(), |v| number(v, 4))
}

fn rows(rows: &[Row]) -> String {
    let of_measured =
        |value: f64, row: &Row| row.measured.map_or("–".into(), |m| format!("{:.2}", value / m));
    let rows: Vec<Vec<String>> = rows
        .iter()
        .map(|row| {
            vec![
                format!("{} {}", row.posture, row.quantity),
                row.unit.to_string(),
                optional(row.published_model),
                optional(row.measured),
                number(row.before, 4),
                number(row.after, 4),
                row.published_model.map_or("–".into(), |p| of_measured(p, row)),
                of_measured(row.before, row),
                of_measured(row.after, row),
                if row.fitted { "fitted" } else { "" }.to_string(),
            ]
        })
        .collect();
    let header = [
        "",
        "unit",
        "published",
        "measured",
        "ours before",
        "ours after",
        "publ./meas.",
        "before/meas.",
        "after/meas.",
        "",
    ];
    table(&header, &rows)
}

fn peak(peak: Option<Peak>) -> String {
    match peak {
        Some(Peak {
            spindle_rpm,
            depth_mm: Some(depth),
            ..
        }) => format!("{spindle_rpm:.0} / {depth:.3}"),
        Some(Peak {
            spindle_rpm,
            depth_mm: None,
            ..
        }) => format!("{spindle_rpm:.0} / no limit"),
        None => "–".into(),
    }
}

fn tips(name: &str, tips: &LobeTips) -> Vec<String> {
    vec![
        name.to_string(),
        peak(tips.second_region),
        peak(tips.first_region),
        tips.absolute_limit
            .map_or("–".into(), |a| format!("{:.4}", a.depth_mm)),
    ]
}

fn describe(study: &CaseStudy) -> String {
    let mut text = String::from(
        "The source thesis put right (ABB IRB 6640)\n\nStatic stiffness at the flange, tables 5 and 6\n",
    );
    text += &rows(&study.static_stiffness);
    text += "\nStrongest mode of each axis, tables 9 and 15 (fitted on configurations 1-3, 4 is predicted)\n";
    text += &rows(&study.frequencies);
    text += "\nLargest real part of the receptance at that mode\n";
    text += &rows(&study.receptances);
    text += &format!(
        "\nfrequency error (rms) {} on the fitted configurations, {} on the predicted one; {}\n",
        percent(study.fitted_frequency_error),
        percent(study.predicted_frequency_error),
        if study.converged {
            "the fit converged"
        } else {
            "the fit did NOT converge"
        },
    );
    let parameters: Vec<Vec<String>> = study
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                number(p.initial, 4),
                number(p.value, 4),
                number(p.std_error, 2),
                p.unit.to_string(),
            ]
        })
        .collect();
    text += &format!(
        "\n{}",
        table(
            &["parameter", "robot file", "fitted", "± std error", "unit"],
            &parameters
        )
    );
    text += "\nNot explained by any rigid-link model, calibrated or not\n";
    for band in &study.unexplained {
        text += &format!(
            "  {} minima of the real part at {}-{} Hz, configurations {}; the model's nearest mode is at {:.1} Hz\n",
            band.minima,
            band.from_hz,
            band.to_hz,
            band.configurations.join(", "),
            band.nearest_model_hz,
        );
    }
    text += "\nDrilling lobes, table 30: tips of the envelope (rpm / mm) and absolute limit (mm)\n";
    let mut lobes = Vec::new();
    for row in &study.lobes {
        let published = |name: &str, peaks: &[Peak]| {
            vec![
                name.to_string(),
                peak(peaks.first().copied()),
                peak(peaks.get(1).copied()),
                "–".into(),
            ]
        };
        let c = row.configuration;
        lobes.push(published(
            &format!("{c} published program"),
            &row.published_program,
        ));
        lobes.push(published(
            &format!("{c} commercial, measured FRFs"),
            &row.commercial,
        ));
        lobes.push(tips(
            &format!("{c} ours, measured minima"),
            &row.from_measurements,
        ));
        lobes.push(tips(&format!("{c} ours, model before"), &row.from_model_before));
        lobes.push(tips(&format!("{c} ours, model after"), &row.from_model_after));
    }
    text += &table(
        &["configuration", "second region", "first region", "absolute"],
        &lobes,
    );
    text
}
