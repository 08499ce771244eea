use std::path::PathBuf;

use serde::Serialize;

use crate::Result;
use crate::commands::Outcome;
use crate::commands::text::{number, percent, table};
use crate::cutting::{KnownValue, MILLING_COEFFICIENTS};
use crate::lobes::Peak;
use crate::report::number::{format_si, plus_minus};
use crate::report::sections::thesis_section;
use crate::report::words::{parameter_of, sizes};
use crate::thesis::drawn_case::{DrawnCase, DrawnLaw};
use crate::thesis::real_case::Explanation;
use crate::thesis::{CaseStudy, ComparedRow, CuttingTables, LobeTips, RealCase, ThesisFindings};

#[derive(clap::Args)]
pub struct ThesisArgs {
    /// Write it as a page with figures (report.html and PNG files) into this folder as well.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(args: ThesisArgs) -> Result<Outcome> {
    let findings = ThesisFindings::run()?;
    let written = match &args.out {
        Some(folder) => {
            let page = thesis_section::page(&findings).write(folder)?;
            Some(PageWritten {
                html: page.html,
                images: page.images,
            })
        }
        None => None,
    };
    let next = written
        .as_ref()
        .map(|page| format!("open {} in a browser", page.html.display()));
    let document = Document {
        study: &findings.study,
        written,
    };
    Ok(Outcome::new(document, describe(&findings.study), next))
}

/// The case study, and its page where one was asked for.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    study: &'a CaseStudy,
    #[serde(flatten)]
    written: Option<PageWritten>,
}

#[derive(Serialize)]
struct PageWritten {
    html: PathBuf,
    images: Vec<PathBuf>,
}

fn optional(value: Option<f64>) -> String {
    value.map_or("–".into(), |v| number(v, 4))
}

fn rows(rows: &[ComparedRow]) -> String {
    let of_measured =
        |value: f64, row: &ComparedRow| row.measured.map_or("–".into(), |m| format!("{:.2}", value / m));
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

/// The loop on the tables: every explanation, then the answer in words.
fn real_case(case: &RealCase) -> String {
    let row = |e: &Explanation| {
        let bands: Vec<String> = e
            .checked
            .bands
            .iter()
            .map(|b| format!("{}/{}", b.met, b.measured))
            .collect();
        let [low, high] = e.checked.static_ratio;
        vec![
            e.name.clone(),
            format!("{:+.1}", e.delta_bic),
            format!("{:.0e}", e.p_value),
            format!("{:.1}", e.reduced_chi2),
            format!("{:.0}", e.held_out_chi2),
            format!("{}/{}", e.checked.met, case.resonances.len()),
            bands.join(", "),
            format!("{low:.2}-{high:.2}"),
            format!("{:.2}", e.weight),
            if e.at_bound { "at its bound" } else { "" }.to_string(),
            sizes(&e.parameters),
        ]
    };
    let header = [
        "explanation",
        "BIC",
        "p",
        "variance",
        "held out",
        "met",
        "by band",
        "static/meas.",
        "weight",
        "",
        "parameters",
    ];
    let rows: Vec<Vec<String>> = std::iter::once(&case.baseline)
        .chain(&case.candidates)
        .map(row)
        .collect();
    let mut text = format!(
        "\nWhich effect is missing there? The loop on both tables, all four configurations\n{}",
        table(&header, &rows)
    );
    text += &format!("\nWhat the tables draw themselves\n{}", drawn(&case.drawn));
    for paragraph in case.answer().iter().chain(&case.caveats()) {
        text += &format!("  - {paragraph}\n");
    }
    for (effect, reason) in &case.not_tried {
        text += &format!("  not tried: {effect}: {reason}\n");
    }
    text
}

fn drawn(drawn: &DrawnCase) -> String {
    let row = |part: &DrawnLaw| {
        let bands: Vec<String> = part
            .checked
            .bands
            .iter()
            .map(|b| format!("{}/{}", b.close, b.measured))
            .collect();
        let [low, high] = part.checked.static_ratio;
        vec![
            part.name.clone(),
            format!("{:+.1}", part.delta_bic),
            format!("{:.1}", part.reduced_chi2),
            bands.join(", "),
            format!("{low:.2}-{high:.2}"),
            if part.at_bound { "at its bound" } else { "" }.to_string(),
            sizes(&part.parameters),
        ]
    };
    let header = [
        "law and place",
        "BIC",
        "variance",
        "close by band",
        "static/meas.",
        "",
        "parameters",
    ];
    table(&header, &drawn.parts.iter().map(row).collect::<Vec<_>>())
}

fn describe(study: &CaseStudy) -> String {
    let mut text = String::from(
        "The source thesis put right (ABB IRB 6640)\n\nStatic stiffness at the flange, tables 5 and 6\n",
    );
    text += &rows(&study.static_stiffness);
    text += &format!("{}\n", study.static_place());
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
                parameter_of(&p.name),
                format_si(p.initial, p.unit, 4),
                plus_minus(p.value, p.std_error, p.unit),
            ]
        })
        .collect();
    text += &format!(
        "\n{}",
        table(
            &["parameter", "robot file", "fitted ± standard error"],
            &parameters
        )
    );
    text += "\nNot explained by the rigid-link model, before or after calibration on the strongest modes\n";
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
    text += &real_case(&study.real_case);
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
    text += &assumptions(study);
    text += &cutting(&study.cutting);
    text
}

/// Table 30 with one assumption switched at a time.
fn assumptions(study: &CaseStudy) -> String {
    let ratio = |r: Option<f64>| r.map_or("–".into(), |r| format!("{r:.2}"));
    let rows: Vec<Vec<String>> = study
        .lobe_assumptions
        .iter()
        .map(|a| {
            vec![
                a.assumption.to_string(),
                ratio(a.speed_ratio[0]),
                ratio(a.speed_ratio[1]),
                ratio(a.depth_ratio[0]),
                ratio(a.depth_ratio[1]),
                format!("{}, {}", a.found[0], a.found[1]),
            ]
        })
        .collect();
    let header = [
        "assumption",
        "speed 2nd",
        "speed 1st",
        "depth 2nd",
        "depth 1st",
        "found",
    ];
    let mut text = format!(
        "\nTable 30 with one assumption switched at a time: the commercial program over ours, geometric mean over the \
         configurations in which there is such a tip\n{}",
        table(&header, &rows)
    );
    for paragraph in &study.lobe_reading {
        text += &format!("  - {paragraph}\n");
    }
    text
}

/// Tables 20 and 23: the rows, trends over all speeds, and what they come to.
fn cutting(tables: &CuttingTables) -> String {
    let mut header = vec!["material", "row", "m/min", "feeds"];
    header.extend(MILLING_COEFFICIENTS.iter().map(|c| c.label));
    header.push("negative");
    let rows: Vec<Vec<String>> = tables
        .rows
        .iter()
        .map(|r| {
            let mut row = vec![
                r.material.clone(),
                r.graph.clone(),
                number(r.cutting_speed_m_per_min, 3),
                r.feeds_in_words(),
            ];
            row.extend(r.coefficients.iter().map(|k| number(*k, 3)));
            row.push(r.negative.join(" "));
            row
        })
        .collect();
    let mut text = format!(
        "\nMilling coefficients, tables 20 and 23 (N/mm² and N/mm)\n{}",
        table(&header, &rows)
    );
    let trends: Vec<Vec<String>> = tables
        .trends
        .iter()
        .filter(|t| t.speeds == "all")
        .map(|t| {
            let known = |k: Option<KnownValue>| {
                k.map_or("–".into(), |k| {
                    let error = k
                        .std_error
                        .map_or(String::new(), |e| format!(" ± {}", number(e, 2)));
                    format!("{}{error}", number(k.value, 3))
                })
            };
            vec![
                t.material.clone(),
                format!("{} {}", t.coefficient, t.unit),
                known(t.value),
                known(t.per_doubling),
                t.p_value.map_or("–".into(), |p| number(p, 2)),
            ]
        })
        .collect();
    text += &format!(
        "\nOver all cutting speeds (least squares on log2 of the speed, errors from the scatter about the line)\n{}",
        table(
            &["material", "coefficient", "at mean speed", "per doubling", "p"],
            &trends
        )
    );
    for paragraph in &tables.reading {
        text += &format!("  - {paragraph}\n");
    }
    text
}
