use serde::Serialize;

use crate::analysis::planning::{PlanFindings, PlanRequest};
use crate::campaign::Campaign;
use crate::commands::document::EffectBarred;
use crate::commands::text::{files_first, number, percent, table, warnings, wrapped};
use crate::commands::{CampaignArg, Outcome, next_step};
use crate::discrepancy::outlook::plan::{
    Confusable, PlanOutlook, PlannedAddition, PlannedEffect, SEEN_SIGMAS,
};
use crate::ingest::Dof;
use crate::revision::Side;
use crate::{InputError, Result};

#[derive(clap::Args)]
#[command(
    after_help = "Files that campaign.toml names may be missing: they are what is planned. Without [[frf]] every posture is. \
                        What is measured there stands in [plan] or in the options below.\n\nExamples:\n  lobestone plan \
                        cell1\n  lobestone plan cell1 --responses 1X,1Y,1Z,2X --hits 1X,1Y --noise 0.05"
)]
pub struct PlanArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Expected noise as a share of the response (0.03: 3 %).
    #[arg(long, value_name = "SHARE")]
    noise: Option<f64>,
    /// Expected noise that is always there, m/N.
    #[arg(long, value_name = "M_PER_N")]
    noise_floor: Option<f64>,
    /// First and last spectral line, Hz.
    #[arg(long, value_name = "FROM:TO", value_parser = crate::commands::range::band)]
    band: Option<[f64; 2]>,
    /// Spacing of the spectral lines.
    #[arg(long, value_name = "HZ")]
    lines_hz: Option<f64>,
    /// Node and direction of what is measured; without it every point in three directions.
    #[arg(long, value_name = "DOF,…", value_delimiter = ',')]
    responses: Vec<Dof>,
    /// Node and direction of the hits; without it the tool in three directions.
    #[arg(long, value_name = "DOF,…", value_delimiter = ',')]
    hits: Vec<Dof>,
}

pub fn run(args: PlanArgs) -> Result<Outcome> {
    let campaign = Campaign::load_planned(&args.campaign.dir)?;
    let findings = PlanFindings::run(&campaign, &request(&args)?)?;
    let next = next_step::planned(
        &campaign.dir,
        findings.plan.additions.first().map(|a| a.what.as_str()),
    );
    Ok(Outcome::new(
        Document::new(&findings),
        files_first(&[], campaign.guesses.of_robot_told().as_slice())
            + &describe(&findings)
            + &warnings(&findings.warnings),
        Some(next),
    ))
}

fn request(args: &PlanArgs) -> Result<PlanRequest> {
    let wrong = |key: &str, what: String, remedy: &str| InputError::new(what).key(key).remedy(remedy);
    if let Some(noise) = args.noise.filter(|n| !(0.0..=1.0).contains(n)) {
        return Err(wrong(
            "--noise",
            format!("is {noise}, out of range"),
            "give a share from 0 to 1",
        )
        .into());
    }
    if let Some(floor) = args.noise_floor.filter(|n| !(0.0..=1.0).contains(n)) {
        return Err(wrong(
            "--noise-floor",
            format!("is {floor}, out of range"),
            "give m/N, such as 2e-8",
        )
        .into());
    }
    if let Some(step) = args.lines_hz.filter(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(wrong(
            "--lines-hz",
            format!("is {step}, out of range"),
            "give a spacing such as 0.2",
        )
        .into());
    }
    if args.band.is_some_and(|[from, _]| from == 0.0) {
        let remedy = "give first and last line, such as 3:90";
        return Err(wrong("--band", "begins at zero".into(), remedy).into());
    }
    Ok(PlanRequest {
        noise_relative: args.noise,
        noise_floor_m_per_n: args.noise_floor,
        band_hz: args.band,
        lines_hz: args.lines_hz,
        responses: args.responses.clone(),
        hits: args.hits.clone(),
    })
}

/// What `plan` found.
#[derive(Serialize)]
struct Document<'a> {
    domain: Side,
    planned_frfs: usize,
    measured_frfs: usize,
    postures: &'a [String],
    noise: NoiseAssumed,
    effects: Vec<EffectShown<'a>>,
    confusable: &'a [Confusable],
    additions: &'a [PlannedAddition],
    out_of_reach: &'a [String],
    not_possible: Vec<EffectBarred<'a>>,
    warnings: &'a [String],
}

impl<'a> Document<'a> {
    fn new(findings: &'a PlanFindings) -> Self {
        let plan = &findings.plan;
        Document {
            domain: Side::Structure,
            planned_frfs: findings.planned,
            measured_frfs: findings.measured,
            postures: &findings.postures,
            noise: NoiseAssumed {
                relative: findings.noise.relative,
                floor_m_per_n: findings.noise.floor,
            },
            effects: plan.effects.iter().map(EffectShown::of).collect(),
            confusable: &plan.confusable,
            additions: &plan.additions,
            out_of_reach: &plan.out_of_reach,
            not_possible: EffectBarred::all(&plan.not_possible),
            warnings: &findings.warnings,
        }
    }
}

#[derive(Serialize)]
struct NoiseAssumed {
    /// Share of the response.
    relative: f64,
    floor_m_per_n: f64,
}

/// How plainly an effect would show, and whether that is enough.
#[derive(Serialize)]
struct EffectShown<'a> {
    #[serde(flatten)]
    planned: &'a PlannedEffect,
    seen: bool,
}

impl<'a> EffectShown<'a> {
    fn of(planned: &'a PlannedEffect) -> Self {
        EffectShown {
            planned,
            seen: planned.sigmas >= SEEN_SIGMAS,
        }
    }
}

fn describe(findings: &PlanFindings) -> String {
    let plan: &PlanOutlook = &findings.plan;
    let mut text = format!(
        "planned: {} FRFs at {} postures ({} measured already), noise {} of the response and {:.1e} m/N\n",
        findings.planned + findings.measured,
        findings.postures.len(),
        findings.measured,
        percent(findings.noise.relative),
        findings.noise.floor,
    );
    let rows: Vec<Vec<String>> = plan
        .effects
        .iter()
        .map(|e| {
            let name = e
                .site
                .as_ref()
                .map_or(e.effect.clone(), |site| format!("{}@{site}", e.effect));
            let mut size: Vec<String> = e
                .size
                .iter()
                .take(2)
                .map(|(_, value, unit)| format!("{} {unit}", number(*value, 3)))
                .collect();
            if e.size.len() > size.len() {
                size.push("…".into());
            }
            let seen = if e.sigmas >= SEEN_SIGMAS { "" } else { "not seen" };
            vec![name, size.join(", "), number(e.sigmas, 3), seen.into()]
        })
        .collect();
    text += &format!(
        "\nhow plainly each effect would show, after the baseline has taken in what it can\n{}",
        table(&["effect", "of this size", "σ", ""], &rows)
    );
    let rows: Vec<Vec<String>> = plan
        .confusable
        .iter()
        .map(|c| vec![c.a.clone(), c.b.clone(), format!("{:.1}", c.sigmas)])
        .collect();
    text += &match rows.is_empty() {
        true => "\nno two effects that show would be taken for each other\n".to_string(),
        false => format!(
            "\ntaken for each other\n{}",
            table(&["effect", "effect", "σ"], &rows)
        ),
    };
    let rows: Vec<Vec<String>> = plan
        .additions
        .iter()
        .map(|a| {
            vec![
                a.what.trim_start_matches("measure ").to_string(),
                number(a.cost, 3),
                format!("+{:.1}", a.sigmas_gained),
                a.mends.join(", "),
            ]
        })
        .collect();
    if !rows.is_empty() {
        text += &format!(
            "\ncheapest additions that reach {SEEN_SIGMAS:.0} σ (effort: one FRF with everything in place is 1)\n{}",
            table(&["measure besides", "effort", "σ", "for"], &rows)
        );
    }
    if !plan.out_of_reach.is_empty() {
        text += "\n";
        text += &wrapped(
            &format!(
                "No single measurement brings to {SEEN_SIGMAS:.0} σ: {}",
                plan.out_of_reach.join(", ")
            ),
            "  ",
        );
    }
    let why = plan
        .not_possible
        .iter()
        .map(|(_, why)| why)
        .collect::<std::collections::BTreeSet<_>>();
    for why in why {
        let of: Vec<&str> = plan
            .not_possible
            .iter()
            .filter(|(_, w)| w == why)
            .map(|(e, _)| e.as_str())
            .collect();
        text += &wrapped(&format!("Cannot show {}: {why}", of.join(", ")), "  ");
    }
    text
}
