use serde_json::{Map, Value, json};

use super::text::{bar, number, percent, table, warnings};
use super::{CampaignArg, Domain, Outcome, structure_only};
use crate::Result;
use crate::analysis::StructureAnalysis;
use crate::campaign::Campaign;
use crate::discrepancy::FrfComparison;
use crate::discrepancy::compare::Group;
use crate::identify::Options;
use crate::identify::structure_study::held_out_postures;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Side of the campaign to look at.
    #[arg(long, value_enum)]
    domain: Option<Domain>,
}

pub fn run(args: Args) -> Result<Outcome> {
    structure_only(args.domain)?;
    let campaign = Campaign::load(&args.campaign.dir)?;
    let analysis = StructureAnalysis::run(&campaign, Options::default())?;
    let StructureAnalysis {
        case,
        calibration,
        after: comparison,
        warnings: notes,
        ..
    } = &analysis;
    let held_out = held_out_postures(&case.model, &case.data, &calibration.theta)?.map(|h| h.nrms());
    let mut error = json!(comparison.totals);
    error["held_out_nrms"] = json!(held_out);
    let json = json!({
        "domain": "structure",
        "revision": case.revision(),
        "effects": case.effects(),
        "error": error,
        "by_posture": object(&comparison.by_posture),
        "by_direction": object(&comparison.by_direction),
        "by_point": object(&comparison.by_point),
        "by_band": comparison.by_band,
        "map": comparison.map,
        "worst_frfs": comparison.by_frf.iter().take(10).collect::<Vec<_>>(),
        "converged": calibration.converged,
        "warnings": notes,
    });
    Ok(Outcome {
        json,
        text: format!("model: {}\n", case.model_description()) + &describe(comparison, held_out, notes),
    })
}

fn object(groups: &[Group]) -> Value {
    let map: Map<String, Value> = groups.iter().map(|g| (g.name.clone(), json!(g.nrms))).collect();
    map.into()
}

fn describe(comparison: &FrfComparison, held_out: Option<f64>, notes: &[String]) -> String {
    let t = &comparison.totals;
    let mut text = format!(
        "calibrated model against measured FRFs\n  error (nrms)    {}\n  noise floor     {}\n  mean |dB|       {}\n",
        percent(t.nrms),
        percent(t.noise_floor_nrms),
        number(t.mean_abs_db, 3),
    );
    if let Some(held_out) = held_out {
        text += &format!(
            "  held-out nrms   {} (on postures left out of the fit)\n",
            percent(held_out)
        );
    }
    for (title, groups) in [
        ("posture", &comparison.by_posture),
        ("direction", &comparison.by_direction),
        ("node", &comparison.by_point),
    ] {
        let largest = groups.iter().map(|g| g.nrms).fold(0.0, f64::max);
        let rows: Vec<Vec<String>> = groups
            .iter()
            .map(|g| vec![g.name.clone(), percent(g.nrms), bar(g.nrms, largest)])
            .collect();
        text += &format!("\n{}", table(&[title, "nrms", ""], &rows));
    }
    let excess = |nrms: f64, floor: f64| if floor > 0.0 { nrms / floor } else { 0.0 };
    let largest = comparison
        .by_band
        .iter()
        .map(|b| excess(b.nrms, b.noise_floor_nrms))
        .fold(0.0, f64::max);
    let rows: Vec<Vec<String>> = comparison
        .by_band
        .iter()
        .map(|b| {
            let times = excess(b.nrms, b.noise_floor_nrms);
            vec![
                format!("{} - {}", number(b.from_hz, 3), number(b.to_hz, 3)),
                percent(b.nrms),
                percent(b.noise_floor_nrms),
                format!("{times:.1}"),
                bar(times, largest),
            ]
        })
        .collect();
    text += &format!(
        "\n{}",
        table(&["band Hz", "nrms", "noise", "times noise", ""], &rows)
    );
    text + &warnings(notes)
}
