use serde_json::json;

use super::next_step::Guide;
use super::text::{Emphasis, number, percent, setup_lines, table, warnings};
use super::{CampaignArg, Outcome};
use crate::Result;
use crate::analysis::StructureAnalysis;
use crate::campaign::Campaign;
use crate::discrepancy::place::Place;
use crate::identify::{Calibration, Options, StructureCase, StructureModel};

#[derive(clap::Args)]
pub struct Args {
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
}

pub fn run(args: Args) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let options = Options {
        extra_starts: args.starts,
        seed: args.seed,
    };
    let analysis = if args.from_nominal {
        let mut case = StructureCase::load(&campaign)?;
        case.forget_start();
        StructureAnalysis::of(case, None, options)?
    } else {
        StructureAnalysis::run(&campaign, options)?
    };
    let StructureAnalysis {
        case,
        calibration,
        before,
        after,
        start,
        warnings: notes,
        ..
    } = &analysis;
    let setup = analysis.setup_check()?;
    let json = json!({
        "domain": "structure",
        "revision": case.revision(),
        "effects": case.effects(),
        "parameters": calibration.parameters,
        "correlation": calibration.correlation(),
        "error": after.totals,
        "error_before": before.totals,
        "iterations": calibration.iterations,
        "converged": calibration.converged(),
        "not_converged_because": calibration.ending.reason(),
        "reduced_chi2": calibration.reduced_chi2,
        "modal_start": start,
        "starts": calibration.starts,
        "starts_agreeing": calibration.starts_agreeing,
        "setup": setup.findings,
        "warnings": notes,
    });
    let mut text = setup_lines(&setup.findings) + &format!("model: {}\n\n", case.model_description());
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
    text += &warnings(notes);
    let next = Guide::structure(&campaign).calibrated(
        calibration.converged(),
        args.starts,
        calibration.reduced_chi2,
        &after.totals,
        after.mostly.as_ref().map(Place::words),
    );
    Ok(Outcome::new(json, text, Some(next)))
}

/// The fitted parameters as a table. Of an effect the robot file says nothing.
pub fn describe_parameters(model: &StructureModel, calibration: &Calibration) -> String {
    let rows: Vec<Vec<String>> = calibration
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let of_robot = i < model.baseline_parameter_count();
            let (initial, change) = match of_robot {
                true => (
                    number(p.initial, 4),
                    format!("{:+.1} %", 100.0 * (p.value / p.initial - 1.0)),
                ),
                false => ("–".into(), "–".into()),
            };
            vec![
                p.name.clone(),
                initial,
                number(p.value, 5),
                number(p.std_error, 2),
                p.unit.to_string(),
                change,
            ]
        })
        .collect();
    table(
        &[
            "parameter",
            "robot file",
            "fitted",
            "± std error",
            "unit",
            "change",
        ],
        &rows,
    )
}
