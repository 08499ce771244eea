use serde_json::{Value, json};

use super::calibrate::describe_parameters;
use super::text::{percent, warnings};
use super::{CampaignArg, Outcome};
use crate::Result;
use crate::analysis::Addition;
use crate::campaign::Campaign;
use crate::discrepancy::extension::{Extension, Fitted};
use crate::identify::{Options, StructureModel};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
    /// The effect and, where it has one, its site: payload, local-resonator@link-3.
    #[arg(value_name = "EFFECT[@SITE]")]
    effect: String,
}

pub fn run(args: Args) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let addition = Addition::run(&campaign, &args.effect, Options::default())?;
    let Extension {
        instance,
        before,
        after,
        progress,
    } = &addition.extension;
    let calibration = &after.calibration;
    let mut error = json!(addition.totals);
    error["held_out_nrms"] = json!(after.held_out_nrms());
    let effects = after.model.effects().iter().map(|added| added.instance.label());
    let variant = instance.effect.variant_label(instance.variant);
    let json = json!({
        "domain": "structure",
        "revision": addition.revision,
        "effect": instance.effect.id(),
        "site": instance.site.label(),
        "variant": variant.map(|(key, value)| json!({ key: value })),
        "effects": effects.collect::<Vec<_>>(),
        "parameters": calibration.parameters,
        "error": error,
        "iterations": calibration.iterations,
        "converged": calibration.converged,
        "reduced_chi2": calibration.reduced_chi2,
        "starts": calibration.starts,
        "starts_agreeing": calibration.starts_agreeing,
        "before": side(before),
        "after": side(after),
        "progress": progress,
        "warnings": addition.warnings,
    });
    let text = describe(&campaign, &addition);
    Ok(Outcome { json, text })
}

fn side(fitted: &Fitted<StructureModel>) -> Value {
    json!({
        "nrms": fitted.residual.nrms,
        "held_out_nrms": fitted.held_out_nrms(),
        "reduced_chi2": fitted.calibration.reduced_chi2,
    })
}

fn describe(campaign: &Campaign, addition: &Addition) -> String {
    let Addition {
        revision,
        extension,
        totals,
        warnings: notes,
    } = addition;
    let Extension {
        instance,
        before,
        after,
        progress,
    } = extension;
    let dir = campaign.dir.display();
    let mut text = format!(
        "revision {revision}: + {}\n  {}\n\n",
        instance.title(),
        instance.effect.explanation()
    );
    text += &describe_parameters(&after.model, &after.calibration);
    text += &format!(
        "\nerror (nrms)    {} -> {}, noise floor {}\n",
        percent(before.residual.nrms),
        percent(totals.nrms),
        percent(totals.noise_floor_nrms),
    );
    if let (Some(was), Some(is)) = (before.held_out_nrms(), after.held_out_nrms()) {
        text += &format!(
            "held-out error  {} -> {} (on postures left out of the fit)\n",
            percent(was),
            percent(is)
        );
    }
    text += &warnings(notes);
    text += "\n";
    text += &match progress {
        Some(false) => format!(
            "THIS IS NOT PROGRESS: the error on postures left out of the fit did not fall by more than chance would let \
             it. The revision is recorded all the same; undo it with: lobestone undo {dir}\n"
        ),
        _ if totals.nrms > 1.1 * totals.noise_floor_nrms => {
            format!("More than noise is left. See what else is missing: lobestone diagnose {dir}\n")
        }
        _ => format!("What is left is noise. See the error fall: lobestone history {dir}\n"),
    };
    text
}
