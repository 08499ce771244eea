//! A robot model tuned to measured FRFs: joint stiffnesses and damping with standard errors, and the error before and after.
//!
//! ```sh
//! cargo run --release --example calibrate_robot [CAMPAIGN_FOLDER]
//! ```

use std::path::PathBuf;

use lobestone::identify::Options;
use lobestone::{Campaign, StructureAnalysis};

fn main() -> lobestone::Result<()> {
    // The same whatever the number of threads, to the last digit.
    lobestone::sums_in_order();
    let built_in = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/campaigns/first-cell");
    let folder = std::env::args_os().nth(1).map_or(built_in.into(), PathBuf::from);
    let campaign = Campaign::load(&folder)?;
    let analysis = StructureAnalysis::run(&campaign, Options::default())?;

    let case = &analysis.case;
    println!(
        "{}: {} on {} FRFs at {} postures\n",
        campaign.name,
        case.model.robot.spec.name,
        case.data.frfs().count(),
        case.data.measured_postures().len()
    );
    println!(
        "{:<24}{:>14}{:>14}{:>12}",
        "parameter", "robot file", "fitted", "± std"
    );
    for p in &analysis.calibration.parameters {
        println!(
            "{:<24}{:>14.4e}{:>14.4e}{:>12.1e}  {}",
            p.name, p.initial, p.value, p.std_error, p.unit
        );
    }
    let (before, after) = (&analysis.before.totals, &analysis.after.totals);
    println!(
        "\nerror, rms of the difference over rms of the measurement: {:.1} % before, {:.2} % after; noise alone {:.2} %",
        100.0 * before.nrms,
        100.0 * after.nrms,
        100.0 * after.noise_floor_nrms
    );
    println!(
        "misfit per degree of freedom: {:.2} (1 is noise)",
        analysis.calibration.reduced_chi2
    );
    for warning in &analysis.warnings {
        println!("warning: {warning}");
    }
    Ok(())
}
