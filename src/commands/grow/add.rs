use std::collections::BTreeMap;

use serde::Serialize;

use crate::Result;
use crate::analysis::{Addition, CampaignSide};
use crate::campaign::Campaign;
use crate::commands::document::{ErrorHeldOut, FitFound};
use crate::commands::find::calibrate::describe_parameters;
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, files_first, percent, table, warnings, wrapped};
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::extension::{Extension, Fitted};
use crate::effects::{Cutting, Instance, Registry, Structure};
use crate::identify::Modelled;
use crate::identify::{Calibration, Options};
use crate::report::number::plus_minus;
use crate::report::words::parameter_of;
use crate::revision::{RevisionLog, Side};

#[derive(clap::Args)]
pub struct AddArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// The effect and, where it has one, its site: payload, local-resonator@link-3. Where there is a choice, the best is taken unless
    /// it is stated: branch@link-3.z:form=resonator.
    #[arg(value_name = "EFFECT[@SITE][:choice=value]")]
    effect: String,
}

pub fn run(args: AddArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let log = RevisionLog::load(&campaign.dir)?;
    after(log, &campaign, &args.effect)
}

/// Adds `effect` if the campaign's log still is `log` in the end.
pub fn after(log: RevisionLog, campaign: &Campaign, effect: &str) -> Result<Outcome> {
    if Registry::cutting().effect_of(effect).is_some() {
        let addition = Addition::<Cutting>::after(log, campaign, effect, Options::default())?;
        let parameters = describe_estimates(&addition.extension.after.calibration);
        return Ok(outcome(&addition, parameters, Guide::cutting(campaign)));
    }
    let addition = Addition::<Structure>::after(log, campaign, effect, Options::default())?;
    let after = &addition.extension.after;
    let parameters = describe_parameters(&after.model, &after.calibration);
    Ok(outcome(&addition, parameters, Guide::structure(campaign)))
}

/// `parameters`: a table of them.
fn outcome<D: CampaignSide>(addition: &Addition<D>, parameters: String, guide: Guide<'_>) -> Outcome {
    let next = next_step(guide, addition);
    Outcome::new(
        Document::new(addition),
        describe(addition, &parameters),
        Some(next),
    )
}

/// What `add` did.
#[derive(Serialize)]
struct Document<'a> {
    domain: Side,
    revision: usize,
    effect: &'static str,
    site: Option<String>,
    /// The discrete choice as key and value.
    variant: Option<BTreeMap<&'static str, &'static str>>,
    effects: &'a [String],
    #[serde(flatten)]
    fit: FitFound<'a>,
    error: ErrorHeldOut,
    vanished: bool,
    /// Effects in the model already that choose otherwise now.
    chosen_anew: Vec<String>,
    before: FitInShort,
    after: FitInShort,
    progress: Option<bool>,
    warnings: Vec<&'a String>,
}

impl<'a> Document<'a> {
    fn new<D: CampaignSide>(addition: &'a Addition<D>) -> Self {
        let Extension {
            instance,
            before,
            after,
            vanished,
            progress,
            chosen_anew,
        } = &addition.extension;
        Document {
            domain: D::SIDE,
            revision: addition.revision,
            effect: instance.effect.id(),
            site: instance.site.label(),
            variant: instance.variant_label().map(|variant| BTreeMap::from([variant])),
            effects: &addition.effects,
            fit: FitFound::of(&after.calibration),
            error: ErrorHeldOut {
                totals: addition.totals,
                held_out_nrms: after.held_out_nrms(),
            },
            vanished: *vanished,
            chosen_anew: chosen_anew.iter().map(Instance::title).collect(),
            before: FitInShort::of(before),
            after: FitInShort::of(after),
            progress: *progress,
            warnings: addition.noticed.iter().chain(&addition.warnings).collect(),
        }
    }
}

#[derive(Serialize)]
struct FitInShort {
    nrms: f64,
    held_out_nrms: Option<f64>,
    reduced_chi2: f64,
}

impl FitInShort {
    fn of<D: Modelled>(fitted: &Fitted<D>) -> Self {
        FitInShort {
            nrms: fitted.residual.nrms,
            held_out_nrms: fitted.held_out_nrms(),
            reduced_chi2: fitted.calibration.reduced_chi2,
        }
    }
}

fn describe_estimates(calibration: &Calibration) -> String {
    let rows: Vec<Vec<String>> = calibration
        .parameters
        .iter()
        .map(|p| vec![parameter_of(&p.name), plus_minus(p.value, p.std_error, p.unit)])
        .collect();
    table(&["parameter", "fitted ± standard error"], &rows)
}

fn next_step<D: CampaignSide>(guide: Guide<'_>, addition: &Addition<D>) -> String {
    let Extension { after, progress, .. } = &addition.extension;
    guide.added(*progress, after.calibration.reduced_chi2, &addition.totals)
}

fn describe<D: CampaignSide>(addition: &Addition<D>, parameters: &str) -> String {
    let Addition {
        revision,
        extension,
        totals,
        noticed,
        warnings: of_fit,
        ..
    } = addition;
    let Extension {
        instance,
        before,
        after,
        progress,
        vanished,
        chosen_anew,
    } = extension;
    let mut text = files_first(&[], noticed);
    text += &format!(
        "revision {revision}: + {}\n{}\n",
        Emphasis::Strong.on(instance.title()),
        wrapped(instance.effect.explanation(), "  ")
    );
    for anew in chosen_anew {
        text += &wrapped(
            &format!("Beside it {} fits better than as it was; changed.", anew.title()),
            "  ",
        );
    }
    text += parameters;
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
            D::FOLDS
        );
    }
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
            D::FOLDS
        );
    }
    text + &warnings(of_fit)
}
