//! `lobestone modal FILE…|DIR`: modal parameters of FRFs.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use num_complex::Complex64;
use rayon::prelude::*;
use serde_json::json;

use super::Outcome;
use crate::campaign::Campaign;
use crate::ingest::{FrfRecord, Quantity, read_frfs};
use crate::modal::{self, FrfModes, GlobalModes, SetMember, Settings};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
pub struct Args {
    /// FRF files (UFF 58, CSV), or one campaign folder.
    #[arg(required = true, value_name = "FILE|DIR")]
    paths: Vec<PathBuf>,
    /// Look at this band only, Hz.
    #[arg(long, value_name = "LO:HI", value_parser = band)]
    band: Option<[f64; 2]>,
}

/// Warnings shown to a person; all are in the JSON.
const MOST_WARNINGS: usize = 20;

fn band(text: &str) -> std::result::Result<[f64; 2], String> {
    let number = |t: &str| {
        t.trim()
            .parse::<f64>()
            .ok()
            .filter(|x| x.is_finite() && *x >= 0.0)
    };
    match text
        .split_once(':')
        .map(|(low, high)| (number(low), number(high)))
    {
        Some((Some(low), Some(high))) if low < high => Ok([low, high]),
        _ => Err("give the band as LO:HI in Hz, such as 3:60".into()),
    }
}

/// One FRF to analyse, with the set (posture or file) it belongs to.
struct Input {
    name: String,
    set: String,
    frequency_hz: Vec<f64>,
    receptance_m_per_n: Vec<Complex64>,
}

pub fn run(args: Args) -> Result<Outcome> {
    let settings = Settings { band_hz: args.band };
    let mut warnings = Vec::new();
    let campaign = args.paths.iter().any(|p| p.is_dir());
    let inputs = match args.paths.as_slice() {
        [dir] if campaign => read_campaign(dir, &mut warnings)?,
        _ if campaign => {
            return Err(
                InputError::new("a campaign folder cannot be mixed with other paths")
                    .remedy("give one folder, or files only")
                    .into(),
            );
        }
        files => {
            let mut inputs = Vec::new();
            for file in files {
                inputs.extend(read_file(file, &mut warnings)?);
            }
            inputs
        }
    };
    if inputs.is_empty() {
        return Err(Error::computation("there are no FRFs in what was given"));
    }

    let found: Vec<FrfModes> = inputs
        .par_iter()
        .map(|input| modal::analyse_frf(&input.frequency_hz, &input.receptance_m_per_n, &settings))
        .collect::<Result<_>>()?;
    for (input, found) in inputs.iter().zip(&found) {
        warnings.extend(
            found
                .warnings
                .iter()
                .map(|w| format!("{} {}: {w}", input.set, input.name)),
        );
    }
    let mut sets: Vec<&str> = Vec::new();
    for input in &inputs {
        if !sets.contains(&input.set.as_str()) {
            sets.push(&input.set);
        }
    }
    let globals: Vec<(&str, GlobalModes)> = sets
        .into_par_iter()
        .map(|set| {
            let of_set: Vec<SetMember> = inputs
                .iter()
                .zip(&found)
                .filter(|(input, _)| input.set == set)
                .map(|(input, modes)| SetMember {
                    frequency_hz: &input.frequency_hz,
                    receptance_m_per_n: &input.receptance_m_per_n,
                    modes,
                    dofs: None,
                })
                .collect();
            Ok((set, modal::global(&of_set, &settings)?))
        })
        .collect::<Result<_>>()?;
    for (set, global) in &globals {
        warnings.extend(global.warnings.iter().map(|w| format!("{set}: {w}")));
    }
    let text = text(&inputs, &found, &globals, &warnings);
    Ok(Outcome {
        json: document(&inputs, &found, &globals, &warnings, campaign),
        text,
    })
}

fn document(
    inputs: &[Input],
    found: &[FrfModes],
    globals: &[(&str, GlobalModes)],
    warnings: &[String],
    campaign: bool,
) -> serde_json::Value {
    // The set is a posture in a campaign, else a file.
    let set_key = if campaign { "posture" } else { "file" };
    let frfs: Vec<_> = inputs
        .iter()
        .zip(found)
        .map(|(input, found)| {
            let modes: Vec<_> = found.modes.iter().flat_map(|m| &m.estimates).collect();
            json!({ "name": input.name, set_key: input.set, "modes": modes, "warnings": found.warnings })
        })
        .collect();
    let global: Vec<_> = globals
        .iter()
        .flat_map(|(set, global)| global.modes.iter().map(move |mode| (set, mode)))
        .map(|(set, mode)| {
            let mut value = json!(mode);
            value[set_key] = json!(set);
            value
        })
        .collect();
    json!({ "frfs": frfs, "global": global, "warnings": warnings })
}

fn text(
    inputs: &[Input],
    found: &[FrfModes],
    globals: &[(&str, GlobalModes)],
    warnings: &[String],
) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    for (input, found) in inputs.iter().zip(found) {
        let _ = writeln!(out, "{} {}", input.set, input.name);
        if found.modes.is_empty() {
            let _ = writeln!(out, "  no modes found");
            continue;
        }
        let _ = writeln!(out, "      f Hz      ±     ζ %      ±  method      lines in band");
        for mode in &found.modes {
            for (k, e) in mode.estimates.iter().enumerate() {
                let lines = if k == 0 {
                    format!("{:.1}", mode.lines_in_half_power_band)
                } else {
                    String::new()
                };
                let _ = writeln!(
                    out,
                    "  {:8.3} {} {:7.3} {}  {:<10}  {lines}",
                    e.frequency_hz,
                    deviation(e.frequency_std_hz, 1.0),
                    100.0 * e.damping_ratio,
                    deviation(e.damping_std, 100.0),
                    e.method.id(),
                );
            }
        }
    }
    for (set, global) in globals {
        let _ = writeln!(out, "\n{set}: all FRFs together");
        let _ = writeln!(out, "      f Hz      ±     ζ %      ±  found in");
        for mode in &global.modes {
            let _ = writeln!(
                out,
                "  {:8.3} {} {:7.3} {}  {}",
                mode.frequency_hz,
                deviation(Some(mode.frequency_std_hz), 1.0),
                100.0 * mode.damping_ratio,
                deviation(Some(mode.damping_std), 100.0),
                mode.found_in,
            );
        }
    }
    if !warnings.is_empty() {
        let _ = writeln!(out, "\nwarnings");
        for warning in warnings.iter().take(MOST_WARNINGS) {
            let _ = writeln!(out, "  {warning}");
        }
        if warnings.len() > MOST_WARNINGS {
            let _ = writeln!(out, "  … and {} more: see --json", warnings.len() - MOST_WARNINGS);
        }
    }
    out
}

fn deviation(std: Option<f64>, scale: f64) -> String {
    std.map_or("     –".into(), |s| format!("{:6.3}", s * scale))
}

/// FRFs of one file, one set a file.
fn read_file(path: &Path, warnings: &mut Vec<String>) -> Result<Vec<Input>> {
    let set = path.display().to_string();
    let (records, file_warnings) = read_frfs(path)?;
    warnings.extend(file_warnings.into_iter().map(|w| format!("{set}: {w}")));
    let unsaid = records.iter().filter(|r| r.quantity.is_none()).count();
    if unsaid > 0 {
        warnings.push(format!(
            "{set}: the file does not say what its {unsaid} FRFs are; taken as receptance (m/N)"
        ));
    }
    Ok(records
        .into_iter()
        .map(|record| Input {
            set: set.clone(),
            receptance_m_per_n: receptance(&record),
            name: record.name,
            frequency_hz: record.frequency_hz,
        })
        .collect())
}

/// H = V/(iω) = A/(iω)². The 0 Hz line of a mobility or accelerance says nothing about receptance; it comes
/// out as not finite and the analysis leaves it out anyway.
fn receptance(record: &FrfRecord) -> Vec<Complex64> {
    let order = match record.quantity {
        None | Some(Quantity::Receptance) => return record.value.clone(),
        Some(Quantity::Mobility) => 1,
        Some(Quantity::Accelerance) => 2,
    };
    let lines = record.frequency_hz.iter().zip(&record.value);
    lines
        .map(|(f, v)| v / Complex64::new(0.0, std::f64::consts::TAU * f).powi(order))
        .collect()
}

/// FRFs of a campaign, one set a posture.
fn read_campaign(dir: &Path, warnings: &mut Vec<String>) -> Result<Vec<Input>> {
    let campaign = Campaign::load(dir)?;
    let (set, read_warnings) = campaign.load_frfs()?;
    warnings.extend(read_warnings);
    Ok(set
        .frfs
        .into_iter()
        .map(|frf| Input {
            name: frf.name,
            set: campaign.postures[frf.posture].id.clone(),
            frequency_hz: frf.frequency_hz,
            receptance_m_per_n: frf.receptance_m_per_n,
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_two_ascending_numbers() {
        assert_eq!(band("3:60.5"), Ok([3.0, 60.5]));
        for wrong in ["", "3", "60:3", "3:inf", "-1:5", "a:b", "3:3"] {
            assert!(band(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn accelerance_and_mobility_become_receptance() {
        let f = 10.0;
        let omega = std::f64::consts::TAU * f;
        let mut record = FrfRecord {
            name: "1X/1X".into(),
            response: None,
            reference: None,
            quantity: Some(Quantity::Accelerance),
            frequency_hz: vec![f],
            value: vec![Complex64::new(-omega * omega * 2e-6, 0.0)],
            coherence: None,
        };
        approx::assert_relative_eq!(receptance(&record)[0].re, 2e-6, max_relative = 1e-12);
        record.quantity = Some(Quantity::Mobility);
        record.value = vec![Complex64::new(0.0, omega * 2e-6)];
        approx::assert_relative_eq!(receptance(&record)[0].re, 2e-6, max_relative = 1e-12);
    }
}
