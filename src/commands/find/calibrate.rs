use serde::Serialize;

use crate::Result;
use crate::analysis::{FreedLinks, StructureAnalysis};
use crate::campaign::{Campaign, LinkGroup};
use crate::commands::document::FitFound;
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, files_first, percent, table, warnings_but};
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::comparison::place::DominantRegion;
use crate::discrepancy::setup::SetupFinding;
use crate::identify::frfs::modal_start::ModalStart;
use crate::identify::{Calibration, Options, Scale, StructureCase, StructureModel, Undetermined};
use crate::report::number::{format_si, plus_minus};
use crate::report::words::parameter_of;
use crate::revision::Side;

#[derive(clap::Args)]
pub struct CalibrateArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Further starting points, tried where the first fit leaves more than noise.
    #[arg(long, default_value_t = Options::default().extra_starts)]
    starts: usize,
    /// Seed of those starting points.
    #[arg(long, default_value_t = Options::default().seed)]
    seed: u64,
    /// Start from the robot file's values alone, not from where the last revision stood or the measured modes lie.
    #[arg(long)]
    from_nominal: bool,
    /// Link parameters that are fitted as well, with the usual tolerance where campaign.toml gives none: masses, inertias,
    /// centres (of mass), lengths (of the kinematics), walls (of links that bend), or links (all of them). Keeps those that
    /// cannot be what the robot file says; says whether postures left out are predicted better, and what the data cannot tell.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "GROUP",
        conflicts_with = "from_nominal"
    )]
    free: Vec<Free>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Free {
    Links,
    Masses,
    Inertias,
    Centres,
    Lengths,
    Walls,
}

impl Free {
    fn groups(self, bends: bool) -> Vec<LinkGroup> {
        match self {
            Free::Links => LinkGroup::of_model(bends),
            Free::Masses => vec![LinkGroup::Masses],
            Free::Inertias => vec![LinkGroup::Inertias],
            Free::Centres => vec![LinkGroup::Centres],
            Free::Lengths => vec![LinkGroup::Lengths],
            Free::Walls => vec![LinkGroup::Walls],
        }
    }
}

pub fn run(args: CalibrateArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let options = Options {
        extra_starts: args.starts,
        seed: args.seed,
    };
    let freed = match args.free.is_empty() {
        true => None,
        false => {
            let case = StructureCase::load(&campaign)?;
            let mut groups: Vec<LinkGroup> = args.free.iter().flat_map(|f| f.groups(case.bends())).collect();
            groups.sort_unstable();
            groups.dedup();
            Some(FreedLinks::run(&campaign, case, &groups, options)?)
        }
    };
    let analysis = if let Some(freed) = &freed {
        &freed.after
    } else if args.from_nominal {
        let mut case = StructureCase::load(&campaign)?;
        case.forget_start();
        &StructureAnalysis::of(case, None, options)?
    } else {
        &StructureAnalysis::run(&campaign, options)?
    };
    let StructureAnalysis {
        case,
        calibration,
        before,
        after,
        start,
        warnings: notes,
        ..
    } = analysis;
    let setup = analysis.setup_check()?;
    let undetermined = match &freed {
        Some(freed) => freed.undetermined.clone(),
        None => Undetermined::new(&case.model.parameters, calibration)?,
    };
    let document = Document {
        domain: Side::Structure,
        revision: case.revision(),
        effects: case.effects(),
        fit: FitFound::of(calibration),
        correlation: calibration.correlation(),
        error: after.totals,
        error_before: before.totals,
        modal_start: start.as_ref(),
        undetermined: &undetermined,
        freed: freed.as_ref().map(WithFreed::of),
        setup: &setup.findings,
        warnings: notes,
    };
    let mut text =
        files_first(&setup.findings, &case.warnings) + &format!("model: {}\n\n", case.model_description());
    text += &describe_parameters(&case.model, calibration);
    if let Some(start) = start {
        text += &format!(
            "\nstarted also from the measured modes: damping ratio {:.2} %, {} of {} modes matched, their frequencies off by \
             {} with the robot file's stiffness, {} at the start\n",
            100.0 * start.damping_ratio,
            start.matched,
            start.measured,
            percent(start.frequency_error_before),
            percent(start.frequency_error),
        );
    }
    text += &format!(
        "\nerror (nrms) {} -> {}, noise floor {}; {} in {} iterations\n",
        percent(before.totals.nrms),
        percent(after.totals.nrms),
        percent(after.totals.noise_floor_nrms),
        if calibration.converged() {
            "converged".to_string()
        } else {
            Emphasis::Bad.on("NOT converged")
        },
        calibration.iterations,
    );
    if after.totals.nrms >= before.totals.nrms {
        text += "in the fit each line counts by its noise, in the nrms by its size: where physics is missing the misfit may fall and the \
                 nrms rise\n";
    }
    if let Some(freed) = &freed {
        text += &describe_freed(freed);
    }
    for sentence in undetermined.in_words() {
        text += &format!("{sentence}\n");
    }
    text += &warnings_but(notes, &case.warnings);
    let next = Guide::structure(&campaign).calibrated(
        calibration.converged(),
        args.starts,
        calibration.reduced_chi2,
        &after.totals,
        after.mostly.as_ref().map(DominantRegion::words),
    );
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `calibrate` found.
#[derive(Serialize)]
struct Document<'a> {
    domain: Side,
    revision: Option<usize>,
    effects: Vec<String>,
    #[serde(flatten)]
    fit: FitFound<'a>,
    correlation: Vec<Vec<Option<f64>>>,
    error: ErrorTotals,
    error_before: ErrorTotals,
    modal_start: Option<&'a ModalStart>,
    undetermined: &'a Undetermined,
    freed: Option<WithFreed<'a>>,
    setup: &'a [SetupFinding],
    warnings: &'a [String],
}

/// With link parameters free.
#[derive(Serialize)]
struct WithFreed<'a> {
    groups: Vec<&'static str>,
    parameters_freed: usize,
    departing: &'a [String],
    error_before: ErrorTotals,
    held_out_nrms_before: Option<f64>,
    held_out_nrms_after: Option<f64>,
    is_progress: Option<bool>,
}

impl<'a> WithFreed<'a> {
    fn of(freed: &'a FreedLinks) -> Self {
        let held_out = freed.held_out.as_ref();
        WithFreed {
            groups: freed.groups.iter().map(|g| g.key()).collect(),
            parameters_freed: freed.freed,
            departing: &freed.departing,
            error_before: freed.before.after.totals,
            held_out_nrms_before: held_out.map(|[before, _]| before.nrms()),
            held_out_nrms_after: held_out.map(|[_, after]| after.nrms()),
            is_progress: freed.progress,
        }
    }
}

/// What freeing link parameters did to the error, and how to keep it.
fn describe_freed(freed: &FreedLinks) -> String {
    if freed.departing.is_empty() {
        return format!(
            "\nall {} link parameters that were free agree with the robot file within their errors: leave them as they are\n",
            freed.freed
        );
    }
    let mut text = format!(
        "\nof {} link parameters that were free {} cannot be what the robot file says: {}; the others agree with it and were left \
         alone\nwith the links as in the robot file the error was {}",
        freed.freed,
        freed.departing.len(),
        freed.departing.join(", "),
        percent(freed.before.after.totals.nrms)
    );
    if let Some([before, after]) = &freed.held_out {
        text += &format!(
            "; on postures left out of the fit {} -> {}",
            percent(before.nrms()),
            percent(after.nrms())
        );
    }
    text += match freed.progress {
        Some(true) => ", better by more than chance\n",
        Some(false) => ", no better than chance would make it: leave them as they are\n",
        None => "\n",
    };
    if freed.progress != Some(false) {
        text += "to keep them, give the campaign a robot file of its own with these values (docs/files.md)\n";
    }
    text
}

/// The fitted parameters as a table. Of an effect the robot file says nothing.
pub fn describe_parameters(model: &StructureModel, calibration: &Calibration) -> String {
    let rows: Vec<Vec<String>> = calibration
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let of_robot = i < model.baseline_parameter_count();
            let (initial, change) = match (of_robot, model.parameters[i].scale, p.unit) {
                // A coordinate has no natural zero that a share could be taken of.
                (true, Scale::Linear, "m") => (
                    format_si(p.initial, p.unit, 4),
                    format!("{:+.2} mm", 1e3 * (p.value - p.initial)),
                ),
                (true, ..) => (
                    format_si(p.initial, p.unit, 4),
                    format!("{:+.1} %", 100.0 * (p.value / p.initial - 1.0)),
                ),
                _ => ("–".into(), "–".into()),
            };
            vec![
                parameter_of(&p.name),
                initial,
                plus_minus(p.value, p.std_error, p.unit),
                change,
            ]
        })
        .collect();
    table(
        &["parameter", "robot file", "fitted ± standard error", "change"],
        &rows,
    )
}
