use std::fmt::Write;

use crate::Result;
use crate::analysis::forces::cutting::waveform_groups;
use crate::analysis::forces::force_records::{cutting_trials, identify_forces};
use crate::analysis::workbench::Workbench;
use crate::campaign::Campaign;
use crate::commands::measure::cfc_document::{CfcDocument, PowerLaws};
use crate::commands::next_step::Guide;
use crate::commands::text::files_first;
use crate::commands::{CampaignArg, Outcome};
use crate::cutting::kienzle;
use crate::cutting::{
    CfcOptions, CfcResult, ChangeReading, CoefficientChange, ForceAxis, ForceGroup, KienzleFit, KnownValue,
    MaterialComparison, OrthogonalPrediction, RegressionMethod, SpeedTrends, coefficients_of, depth_mm,
    speed_text,
};
use crate::text::capitalised;

#[derive(clap::Args)]
pub struct CfcArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Hold edge coefficients at zero or above.
    #[arg(long)]
    nonnegative_edges: bool,
    /// Robust (Huber) regression: a spoilt cut cannot pull the coefficients. Without it the robust answer is shown in
    /// --json, and a warning says where the two disagree.
    #[arg(long)]
    robust: bool,
}

pub fn run(args: CfcArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let options = CfcOptions {
        nonnegative_edges: args.nonnegative_edges,
        robust: args.robust,
    };
    let bench = Workbench::new(&campaign);
    let mut result = identify_forces(&bench, options)?;
    let (waveforms, warnings, setup) = waveform_groups(&bench, &result);
    result.warnings.splice(0..0, campaign.guesses.of_cutting_told());
    result.warnings.extend(warnings);
    let trials = cutting_trials(&campaign)?;
    let power_laws = PowerLaws {
        groups: kienzle(&trials, &result, &result.groups),
        pooled: kienzle(&trials, &result, &result.pooled),
    };
    Ok(Outcome::new(
        CfcDocument::new(&campaign, &result, &waveforms, &power_laws, &setup),
        files_first(&setup, &result.warnings) + &text(&campaign, &result, &power_laws),
        Some(Guide::cutting(&campaign).coefficients()),
    ))
}

fn text(campaign: &Campaign, result: &CfcResult, power_laws: &PowerLaws) -> String {
    let mut out = format!("Cutting force coefficients: {}\n", campaign.name);
    for (pooled, of_all) in result.pooled.iter().zip(&power_laws.pooled) {
        let groups: Vec<&ForceGroup> = result.groups.iter().filter(|g| g.is_beside(pooled)).collect();
        let _ = writeln!(out, "\n{}", coefficient_table(&groups, pooled));
        let by_speed = result.groups.iter().zip(&power_laws.groups);
        let laws: Vec<(&ForceGroup, &KienzleFit)> = by_speed
            .filter(|(g, _)| g.is_beside(pooled))
            .filter_map(|(g, law)| Some((g, law.as_ref()?)))
            .collect();
        if let Some(of_all) = of_all {
            let _ = writeln!(out, "{}", kienzle_table(&laws, pooled, of_all));
        }
        let trends = result.trends.iter();
        for trend in trends.filter(|t| t.process == pooled.process && t.material == pooled.material) {
            let _ = writeln!(out, "{}", trend_table(trend));
        }
        let _ = writeln!(out, "{}", cut_table(campaign, result, pooled));
    }
    for comparison in &result.materials {
        let _ = writeln!(out, "{}", material_table(comparison));
    }
    if let Some(prediction) = &result.prediction {
        let _ = writeln!(out, "{}", prediction_table(prediction));
    }
    out
}

fn coefficient_table(groups: &[&ForceGroup], pooled: &ForceGroup) -> String {
    let mut header = vec!["speed m/min".to_string(), "cuts".into(), "feeds".into()];
    header.extend(
        pooled
            .coefficients
            .iter()
            .map(|c| format!("{} {}", c.label, c.unit)),
    );
    let axes = ForceAxis::of(pooled.process);
    header.extend(axes.iter().map(|a| format!("R² {}", a.label())));
    let mut rows = vec![header];
    let alone = groups.len() == 1 && groups[0].cuts == pooled.cuts;
    for (group, name) in groups
        .iter()
        .map(|g| (*g, speed_text(g)))
        .chain((!alone).then(|| (pooled, "all together".to_string())))
    {
        let mut row = vec![name, group.cuts.len().to_string(), group.feeds.to_string()];
        row.extend(group.coefficients.iter().map(|c| match (c.value, c.std_error) {
            _ if c.constraint_active => "0 (held)".to_string(),
            (Some(value), Some(error)) => with_error(value, error),
            (Some(value), None) => format!("{value:.4}"),
            (None, _) => "–".to_string(),
        }));
        row.extend(
            axes.iter()
                .map(|a| group.r2[a.index()].map_or("–".to_string(), |r| format!("{r:.4}"))),
        );
        rows.push(row);
    }
    let process = capitalised(pooled.process.name());
    let method = match pooled.method {
        RegressionMethod::LeastSquares => "least squares",
        RegressionMethod::Huber => "robust (Huber) regression",
    };
    format!(
        "{process}{}: coefficient ± standard error, {method}\n{}",
        pooled
            .material
            .as_ref()
            .map_or(String::new(), |m| format!(", {m}")),
        table(&rows)
    )
}

fn kienzle_table(groups: &[(&ForceGroup, &KienzleFit)], pooled: &ForceGroup, of_all: &KienzleFit) -> String {
    let mut header = vec!["speed m/min".to_string()];
    for c in &of_all.components {
        header.extend([format!("{} N/mm²", c.label), "m".to_string()]);
    }
    header.push("ΔBIC".into());
    let mut rows = vec![header];
    let alone = groups.len() == 1 && groups[0].0.cuts == pooled.cuts;
    let each = groups.iter().map(|(group, law)| (*law, speed_text(group)));
    let mut told = Vec::new();
    for (law, name) in each.chain((!alone).then(|| (of_all, "all together".to_string()))) {
        told.push(format!("  {name}: {}\n", law.reading()));
        let mut row = vec![name];
        for c in &law.components {
            row.extend([maybe(c.k1_1), maybe(c.m)]);
        }
        row.push(format!("{:+.1}", law.delta_bic));
        rows.push(row);
    }
    format!(
        "Kienzle's law k1.1 b h^(1−m) of the same averages; ΔBIC above zero where it fits better than the linear-edge law\n{}{}",
        table(&rows),
        told.concat()
    )
}

/// In words of one line each.
fn reading(change: &CoefficientChange) -> String {
    let chance = change
        .p_value
        .map_or(String::new(), |p| format!(" ({})", crate::text::chance(p)));
    match change.reading {
        ChangeReading::Rises => format!("higher{chance}"),
        ChangeReading::Falls => format!("lower{chance}"),
        ChangeReading::None => format!("no more than chance{chance}"),
        ChangeReading::NotDetermined => "these cuts cannot tell".into(),
    }
}

fn maybe(known: Option<KnownValue>) -> String {
    known.map_or("–".into(), |k| {
        k.std_error
            .map_or_else(|| format!("{:.4}", k.value), |e| with_error(k.value, e))
    })
}

fn trend_table(trend: &SpeedTrends) -> String {
    let reference = trend.reference_speed_m_per_min;
    let mut rows = vec![vec![
        "coefficient".to_string(),
        format!("at {reference:.1} m/min"),
        "per doubling".into(),
        "exponent".into(),
        "faster is".into(),
    ]];
    for (kind, change) in coefficients_of(trend.process).iter().zip(&trend.changes) {
        rows.push(vec![
            format!("{} {}", kind.label, kind.unit),
            maybe(change.reference),
            maybe(change.change),
            maybe(change.exponent()),
            reading(change),
        ]);
    }
    let [low, high] = trend.speed_range_m_per_min;
    format!(
        "Over cutting speed, {low:.1} to {high:.1} m/min, all cuts in one regression; \"exponent\" is m in speed^m\n{}",
        table(&rows)
    )
}

fn material_table(comparison: &MaterialComparison) -> String {
    let MaterialComparison {
        material, reference, ..
    } = comparison;
    let mut rows = vec![vec![
        "coefficient".to_string(),
        reference.clone(),
        "difference".into(),
        "ratio".into(),
        format!("{material} is"),
    ]];
    for (kind, change) in coefficients_of(comparison.process)
        .iter()
        .zip(&comparison.changes)
    {
        rows.push(vec![
            format!("{} {}", kind.label, kind.unit),
            maybe(change.reference),
            maybe(change.change),
            maybe(change.ratio),
            reading(change),
        ]);
    }
    format!(
        "{material} against {reference}, a common trend over speed allowed for\n{}",
        table(&rows)
    )
}

fn prediction_table(prediction: &OrthogonalPrediction) -> String {
    let mut rows = vec![vec![
        "coefficient".to_string(),
        "predicted".into(),
        "from the cuts".into(),
        "cuts / predicted".into(),
    ]];
    for (label, predicted, value, std_error) in &prediction.rows {
        rows.push(vec![
            format!("{label} N/mm²"),
            format!("{predicted:.0}"),
            value.map_or("–".into(), |v| {
                std_error.map_or_else(|| format!("{v:.1}"), |e| with_error(v, e))
            }),
            value.map_or("–".into(), |v| format!("{:.2}", v / predicted)),
        ]);
    }
    format!(
        "Predicted from the orthogonal database by oblique transformation (shear angle {:.1}°)\n{}",
        prediction.predicted.shear_angle_rad.to_degrees(),
        table(&rows)
    )
}

fn cut_table(campaign: &Campaign, result: &CfcResult, pooled: &ForceGroup) -> String {
    let axes = ForceAxis::of(pooled.process);
    let mut header: Vec<String> = ["cut", "rpm", "feed mm", "depth mm", "steady s", "turns", "air"]
        .map(String::from)
        .into();
    for axis in axes {
        header.push(format!("{} {}", axis.label(), axis.unit()));
        header.push("off %".into());
    }
    header.extend(["leverage".to_string(), "off / error".into()]);
    let mut rows = vec![header];
    for cut in result.cuts.iter().filter(|c| pooled.cuts.contains(&c.id)) {
        let air = match (cut.air_before_s.is_some(), cut.air_after_s.is_some()) {
            (true, true) => "both",
            (true, false) => "before",
            (false, true) => "after",
            (false, false) => "none",
        };
        let mut row = vec![
            cut.id.clone(),
            format!("{}", cut.spindle_rpm),
            format!("{}", cut.feed_mm),
            depth_mm(&campaign.cuts[cut.cut].geometry).map_or("–".into(), |d| d.to_string()),
            format!("{:.2}–{:.2}", cut.steady_s[0], cut.steady_s[1]),
            format!("{:.0}", cut.revolutions),
            air.to_string(),
        ];
        for axis in axes {
            let Some(average) = cut.averages[axis.index()] else {
                row.extend(["–".to_string(), "–".to_string()]);
                continue;
            };
            row.push(with_error(average.value, average.std_error));
            let point = pooled.points.iter().find(|p| p.cut == cut.id && p.axis == *axis);
            row.push(point.filter(|p| p.fitted != 0.0).map_or("–".into(), |p| {
                format!("{:+.1}", 100.0 * (p.measured - p.fitted) / p.fitted.abs())
            }));
        }
        let influence = pooled.influence.iter().find(|i| i.cut == cut.id);
        row.push(influence.map_or("–".into(), |i| format!("{:.2}", i.leverage)));
        let off = influence.and_then(|i| Some((i.studentized_residual?, i.axis?)));
        row.push(off.map_or("–".into(), |(t, axis)| format!("{} {t:+.1}", axis.label())));
        rows.push(row);
    }
    format!(
        "Cuts: averages over whole turns in tool axes; \"off\" is against the fit to all cuts together; \"leverage\" \
         (0 to 1) is how\nmuch the cut decides by itself, \"off / error\" its worst axis against the other cuts, in \
         standard errors\n{}",
        table(&rows)
    )
}

/// `929.8 ± 0.5`: decimals by the error, which keeps two figures.
fn with_error(value: f64, error: f64) -> String {
    let decimals = if error > 0.0 && error.is_finite() {
        (1.0 - error.log10().floor()).clamp(0.0, 4.0) as usize
    } else {
        4
    };
    format!("{value:.decimals$} ± {error:.decimals$}")
}

/// Columns aligned to the right, the first to the left.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |j: usize| {
        rows.iter()
            .filter_map(|r| r.get(j))
            .map(|c| c.chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let mut line = String::from(" ");
        for (j, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let pad = " ".repeat(width - cell.chars().count());
            let _ = if j == 0 {
                write!(line, " {cell}{pad}")
            } else {
                write!(line, "  {pad}{cell}")
            };
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}
