//! Cutting force coefficients from dynamometer records: milling cuts of a campaign, each read, averaged over whole turns of
//! its steady window and put into one regression.
//!
//! ```sh
//! cargo run --release --example cutting_coefficients [CAMPAIGN_FOLDER]
//! ```

use std::path::PathBuf;

use lobestone::Campaign;
use lobestone::analysis::Workbench;
use lobestone::analysis::forces::force_records::identify_forces;
use lobestone::cutting::{CfcOptions, ForceAxis};

fn main() -> lobestone::Result<()> {
    let built_in = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/campaigns/first-cell");
    let folder = std::env::args_os().nth(1).map_or(built_in.into(), PathBuf::from);
    let campaign = Campaign::load(&folder)?;
    let found = identify_forces(&Workbench::new(&campaign), CfcOptions::default())?;

    println!("cut           feed, mm   mean Fx, N   mean Fy, N   mean Fz, N");
    for cut in &found.cuts {
        let mean = |axis: ForceAxis| {
            let average = cut.averages[axis.index()];
            average.map_or("-".to_string(), |a| format!("{:.1}", a.value))
        };
        let [x, y, z] = [ForceAxis::X, ForceAxis::Y, ForceAxis::Z].map(mean);
        println!("{:<12}{:>10.3}{x:>13}{y:>13}{z:>13}", cut.id, cut.feed_mm);
    }
    for group in &found.groups {
        println!(
            "\n{} at {:.0} m/min, {} cuts, {} feeds",
            group.process.name(),
            group.cutting_speed_m_per_min,
            group.cuts.len(),
            group.feeds
        );
        for coefficient in &group.coefficients {
            let std_error = coefficient
                .std_error
                .map_or(String::new(), |e| format!(" ± {e:.2}"));
            match coefficient.value {
                Some(value) => println!(
                    "  {:<5}{value:10.2}{std_error} {}",
                    coefficient.label, coefficient.unit
                ),
                None => println!("  {:<5} not determined by these cuts", coefficient.label),
            }
        }
        let r2: Vec<String> = group.r2.iter().flatten().map(|r2| format!("{r2:.4}")).collect();
        println!("  R² by axis: {}", r2.join(", "));
    }
    for warning in &found.warnings {
        println!("warning: {warning}");
    }
    Ok(())
}
