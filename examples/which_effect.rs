//! Which physical effect does the model of a robot lack? Every effect of the library is added in turn, fitted together with
//! the joints, and judged; the best are shown with what they make of the data.
//!
//! ```sh
//! cargo run --release --example which_effect [CAMPAIGN_FOLDER]
//! ```

use std::path::PathBuf;

use lobestone::analysis::DiagnosisFindings;
use lobestone::identify::Options;
use lobestone::{Campaign, StructureAnalysis};

fn main() -> lobestone::Result<()> {
    lobestone::sums_in_order();
    let built_in = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/campaigns/second-cell");
    let folder = std::env::args_os().nth(1).map_or(built_in.into(), PathBuf::from);
    let campaign = Campaign::load(&folder)?;
    let calibrated = StructureAnalysis::run(&campaign, Options::default())?;
    let found = DiagnosisFindings::of(&campaign, calibrated.settled_case(), Options::default())?;

    let diagnosis = &found.diagnosis;
    println!(
        "{}: the calibrated model leaves a misfit of {:.1} per degree of freedom (1 is noise)\n",
        campaign.name, diagnosis.baseline.reduced_chi2
    );
    println!(
        "{:<34}{:>12}{:>12}{:>10}",
        "effect@site", "BIC change", "misfit", "error, %"
    );
    for candidate in diagnosis.candidates.iter().take(5) {
        println!(
            "{:<34}{:>12.0}{:>12.2}{:>10.2}  {}",
            candidate.label(),
            candidate.delta_bic,
            candidate.reduced_chi2,
            100.0 * candidate.nrms,
            candidate.remark()
        );
    }
    let confidence = 100.0 * diagnosis.confidence;
    match diagnosis.winner() {
        Some(effect) => {
            println!("\nmissing: {} ({confidence:.0} % sure)", effect.label());
            for p in &effect.parameters {
                println!("  {} = {:.4} ± {:.1e} {}", p.name, p.value, p.std_error, p.unit);
            }
        }
        None => println!("\nverdict: {:?} ({confidence:.0} % sure)", diagnosis.verdict),
    }
    println!("next measurement: {}", found.next_measurement.what);
    Ok(())
}
