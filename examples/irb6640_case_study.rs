//! The IRB 6640 case study: the tables of a published thesis (`datasets/irb6640/`) against a model calibrated on three of its
//! four configurations, and the effect that the measured resonances propose. `lobestone thesis` shows all of it.
//!
//! ```sh
//! cargo run --release --example irb6640_case_study
//! ```

use lobestone::thesis::{ComparedRow, case_study};

fn main() -> lobestone::Result<()> {
    lobestone::sums_in_order();
    let study = case_study()?;

    println!("static stiffness at the flange, N/m");
    study.static_stiffness.iter().for_each(print);
    println!("\nfrequency of the strongest mode, Hz (calibrated on configurations 1 to 3, 4 is predicted)");
    study.frequencies.iter().for_each(print);
    println!(
        "\nfrequency error (rms): {:.1} % on the configurations fitted, {:.1} % on the one predicted",
        100.0 * study.fitted_frequency_error,
        100.0 * study.predicted_frequency_error
    );

    println!("\nresonances that the calibrated model does not have");
    for band in &study.unexplained {
        println!(
            "  {:.0} to {:.0} Hz, in configurations {}",
            band.from_hz,
            band.to_hz,
            band.configurations.join(", ")
        );
    }
    println!("\nwhat would explain them (BIC change against rigid links)");
    for explanation in study.real_case.candidates.iter().take(3) {
        println!("  {:<28}{:>8.1}", explanation.name, explanation.delta_bic);
    }
    for sentence in study.real_case.answer() {
        println!("- {sentence}");
    }
    Ok(())
}

fn print(row: &ComparedRow) {
    let shown = |value: Option<f64>| value.map_or("-".to_string(), |v| format!("{v:.4}"));
    println!(
        "  {:<3}{:<6} published {:>12}  measured {:>12}  before {:>12.4}  calibrated {:>12.4}",
        row.posture,
        row.quantity,
        shown(row.published_model),
        shown(row.measured),
        row.before,
        row.after
    );
}
