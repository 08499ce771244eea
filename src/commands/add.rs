use serde_json::{Value, json};

use super::calibrate::describe_parameters;
use super::next_step::Guide;
use super::text::{Emphasis, number, percent, table, warnings, wrapped};
use super::{CampaignArg, Outcome};
use crate::Result;
use crate::analysis::Addition;
use crate::campaign::Campaign;
use crate::discrepancy::extension::{Extension, Fitted};
use crate::effects::cutting;
use crate::identify::{Calibration, Options};
use crate::revision::RevisionLog;

#[derive(clap::Args)]
pub struct AddArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// The effect and, where it has one, its site: payload, local-resonator@link-3.
    #[arg(value_name = "EFFECT[@SITE]")]
    effect: String,
}

pub fn run(args: AddArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let log = RevisionLog::load(&campaign.dir)?;
    after(log, &campaign, &args.effect)
}

/// Adds `effect` if the campaign's log still is `log` in the end.
pub fn after(log: RevisionLog, campaign: &Campaign, effect: &str) -> Result<Outcome> {
    if !cutting::find(effect).is_empty() {
        let addition = Addition::cutting_after(log, campaign, effect)?;
        let Extension { instance, after, .. } = &addition.extension;
        let variant = instance.effect.variant_label(instance.variant);
        let parameters = describe_estimates(&after.calibration);
        let plain = Plain {
            title: instance.label(),
            explanation: instance.effect.explanation(),
            parameters,
            folds: "cuts",
        };
        return Ok(Outcome::new(
            document("cutting", instance.effect.id(), None, variant, &addition),
            describe(&addition, &plain),
            Some(next_step(Guide::cutting(campaign), &addition)),
        ));
    }
    let addition = Addition::after(log, campaign, effect, Options::default())?;
    let Extension { instance, after, .. } = &addition.extension;
    let variant = instance.effect.variant_label(instance.variant);
    let plain = Plain {
        title: instance.title(),
        explanation: instance.effect.explanation(),
        parameters: describe_parameters(&after.model, &after.calibration),
        folds: "postures",
    };
    Ok(Outcome::new(
        document(
            "structure",
            instance.effect.id(),
            instance.site.label(),
            variant,
            &addition,
        ),
        describe(&addition, &plain),
        Some(next_step(Guide::structure(campaign), &addition)),
    ))
}

/// What a person is told of the effect.
struct Plain {
    title: String,
    explanation: &'static str,
    /// A table.
    parameters: String,
    /// What is left out for the held-out error.
    folds: &'static str,
}

fn document<M, I>(
    domain: &str,
    effect: &str,
    site: Option<String>,
    variant: Option<(&str, &str)>,
    addition: &Addition<M, I>,
) -> Value {
    let Extension {
        before,
        after,
        progress,
        ..
    } = &addition.extension;
    let calibration = &after.calibration;
    let mut error = json!(addition.totals);
    error["held_out_nrms"] = json!(after.held_out_nrms());
    json!({
        "domain": domain,
        "revision": addition.revision,
        "effect": effect,
        "site": site,
        "variant": variant.map(|(key, value)| json!({ key: value })),
        "effects": addition.effects,
        "parameters": calibration.parameters,
        "error": error,
        "iterations": calibration.iterations,
        "converged": calibration.converged(),
        "not_converged_because": calibration.ending.reason(),
        "vanished": addition.extension.vanished,
        "reduced_chi2": calibration.reduced_chi2,
        "starts": calibration.starts,
        "starts_agreeing": calibration.starts_agreeing,
        "before": side(before),
        "after": side(after),
        "progress": progress,
        "warnings": addition.warnings,
    })
}

fn describe_estimates(calibration: &Calibration) -> String {
    let rows: Vec<Vec<String>> = calibration
        .parameters
        .iter()
        .map(|p| {
            vec![
                p.name.clone(),
                number(p.value, 5),
                number(p.std_error, 2),
                p.unit.to_string(),
            ]
        })
        .collect();
    table(&["parameter", "fitted", "± std error", "unit"], &rows)
}

fn side<M>(fitted: &Fitted<M>) -> Value {
    json!({
        "nrms": fitted.residual.nrms,
        "held_out_nrms": fitted.held_out_nrms(),
        "reduced_chi2": fitted.calibration.reduced_chi2,
    })
}

fn next_step<M, I>(guide: Guide<'_>, addition: &Addition<M, I>) -> String {
    let Extension { after, progress, .. } = &addition.extension;
    guide.added(*progress, after.calibration.reduced_chi2, &addition.totals)
}

fn describe<M, I>(addition: &Addition<M, I>, plain: &Plain) -> String {
    let Addition {
        revision,
        extension,
        totals,
        warnings: notes,
        ..
    } = addition;
    let Extension {
        before,
        after,
        progress,
        vanished,
        ..
    } = extension;
    let mut text = format!(
        "revision {revision}: + {}\n{}\n",
        Emphasis::Strong.on(&plain.title),
        wrapped(plain.explanation, "  ")
    );
    text += &plain.parameters;
    text += &format!(
        "\nerror (nrms)    {} -> {}, noise floor {}\n",
        percent(before.residual.nrms),
        percent(totals.nrms),
        percent(totals.noise_floor_nrms),
    );
    if let (Some(was), Some(is)) = (before.held_out_nrms(), after.held_out_nrms()) {
        text += &format!(
            "held-out error  {} -> {} (on {} left out of the fit)\n",
            percent(was),
            percent(is),
            plain.folds
        );
    }
    text += &warnings(notes);
    if *vanished {
        text += &format!(
            "{}: the best fit with it is the fit without it, so that its parameters mean nothing.\n",
            Emphasis::Bad.on("THESE DATA HOLD NOTHING OF IT")
        );
    }
    if *progress == Some(false) {
        text += &format!(
            "{}: the error on {} left out of the fit did not fall by more than chance would let it. The revision is \
             recorded all the same.\n",
            Emphasis::Bad.on("THIS IS NOT PROGRESS"),
            plain.folds
        );
    }
    text
}
