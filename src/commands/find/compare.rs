use std::collections::BTreeMap;

use serde::Serialize;

use crate::Result;
use crate::analysis::modes::mode_comparison::{FixedMode, ModePair, compare_modes, measured_modes};
use crate::analysis::{CuttingAnalysis, ExpertView, StructureAnalysis};
use crate::campaign::Campaign;
use crate::commands::document::{Convergence, ErrorHeldOut, nrms_by_name};
use crate::commands::next_step::Guide;
use crate::commands::text::{
    Emphasis, error_bar, files_first, number, percent, table, warnings, warnings_but, wrapped,
};
use crate::commands::{Outcome, SideArgs, by_domain};
use crate::data::Process;
use crate::discrepancy::comparison::compare::{Band, ErrorMap, GroupError};
use crate::discrepancy::comparison::compare_cutting::{CutError, HarmonicError};
use crate::discrepancy::comparison::locate::Location;
use crate::discrepancy::comparison::place::DominantRegion;
use crate::discrepancy::setup::SetupFinding;
use crate::discrepancy::{FrfComparison, FrfError};
use crate::identify::frfs::structure_study::{ResidualPeak, held_out_postures, residual_peaks};
use crate::identify::{Estimate, Options, StructureCase};
use crate::revision::Side;

pub fn run(args: SideArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    by_domain(&campaign, args.domain, structure, cutting)
}

fn cutting(campaign: &Campaign) -> Result<Outcome> {
    let analysis = CuttingAnalysis::run(campaign)?;
    let setup = analysis.setup_check()?;
    let c = &analysis.comparison;
    let next =
        Guide::cutting(campaign).compared(analysis.calibration.reduced_chi2, &c.totals, c.mostly.clone());
    let text = files_first(&setup.findings, &analysis.noticed)
        + &describe_cutting(&analysis)
        + &warnings(&analysis.warnings);
    let document = CuttingDocument::new(&analysis, &setup.findings);
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `compare` found about force records.
#[derive(Serialize)]
struct CuttingDocument<'a> {
    domain: Side,
    process: Process,
    error: ErrorHeldOut,
    by_cut: BTreeMap<&'a str, f64>,
    by_axis: BTreeMap<&'a str, f64>,
    by_speed: BTreeMap<&'a str, f64>,
    by_feed: BTreeMap<&'a str, f64>,
    by_order: BTreeMap<&'a str, f64>,
    by_harmonic: &'a [HarmonicError],
    cuts: &'a [CutError],
    mostly: Option<&'a str>,
    parameters: &'a [Estimate],
    chi2_per_value: f64,
    setup: &'a [SetupFinding],
    #[serde(flatten)]
    convergence: Convergence,
    warnings: Vec<&'a String>,
}

impl<'a> CuttingDocument<'a> {
    fn new(analysis: &'a CuttingAnalysis, setup: &'a [SetupFinding]) -> Self {
        let (c, calibration) = (&analysis.comparison, &analysis.calibration);
        CuttingDocument {
            domain: Side::Cutting,
            process: analysis.data.process,
            error: ErrorHeldOut {
                totals: c.totals,
                held_out_nrms: analysis.held_out_nrms,
            },
            by_cut: nrms_by_name(&c.by_cut),
            by_axis: nrms_by_name(&c.by_axis),
            by_speed: nrms_by_name(&c.by_speed),
            by_feed: nrms_by_name(&c.by_feed),
            by_order: nrms_by_name(&c.by_order),
            by_harmonic: &c.by_harmonic,
            cuts: &c.cuts,
            mostly: c.mostly.as_deref(),
            parameters: &calibration.parameters,
            chi2_per_value: calibration.reduced_chi2,
            setup,
            convergence: Convergence::of(calibration),
            warnings: analysis.noticed.iter().chain(&analysis.warnings).collect(),
        }
    }
}

fn describe_cutting(analysis: &CuttingAnalysis) -> String {
    let c = &analysis.comparison;
    let mut text = format!(
        "fitted waveform against measured forces (steady cut, averaged over revolutions)\n  error (nrms)    {}\n  \
         noise floor     {}\n",
        percent(c.totals.nrms),
        percent(c.totals.noise_floor_nrms),
    );
    if let Some(held_out) = analysis.held_out_nrms {
        text += &format!(
            "  held-out nrms   {} (on cuts left out of the fit)\n",
            percent(held_out)
        );
    }
    text += &group_tables(&[
        ("axis", &c.by_axis),
        ("speed m/min", &c.by_speed),
        ("feed mm", &c.by_feed),
    ]);
    let rows: Vec<Vec<String>> = c
        .cuts
        .iter()
        .map(|cut| {
            let times = cut.chi2_per_value.sqrt();
            vec![
                cut.cut.clone(),
                percent(cut.nrms),
                percent(cut.noise_floor_nrms),
                format!("{times:.1}"),
            ]
        })
        .collect();
    text += &format!("\n{}", table(&["cut", "nrms", "noise", "misfit / noise"], &rows));
    let mut strongest: Vec<&HarmonicError> = c.by_harmonic.iter().collect();
    strongest.sort_by(|a, b| (b.nrms - b.noise_floor_nrms).total_cmp(&(a.nrms - a.noise_floor_nrms)));
    let rows: Vec<Vec<String>> = strongest
        .iter()
        .take(6)
        .map(|h| vec![h.order.to_string(), percent(h.nrms), percent(h.noise_floor_nrms)])
        .collect();
    if !rows.is_empty() {
        text += &format!(
            "\norders of rotation with most error (share of the whole signal)\n{}",
            table(&["order", "nrms", "noise"], &rows)
        );
    }
    text
}

fn structure(campaign: &Campaign) -> Result<Outcome> {
    let case = StructureCase::load(campaign)?;
    let measured = measured_modes(&case);
    let analysis = StructureAnalysis::of(case, measured.as_ref().ok(), Options::default())?;
    let StructureAnalysis {
        case,
        calibration,
        after: comparison,
        warnings: notes,
        ..
    } = &analysis;
    let setup = analysis.setup_check()?;
    let held_out = held_out_postures(&case.model, &case.data, &calibration.theta)?.map(|h| h.nrms());
    let peaks = residual_peaks(&analysis.calibrated, &case.data);
    let mut notes = notes.clone();
    // Modes are an addition: FRFs that show none are compared all the same.
    let modes = measured.and_then(|m| compare_modes(case, &analysis.calibrated, &m));
    let modes = modes.unwrap_or_else(|e| {
        notes.push(format!("the modes cannot be compared: {e}"));
        Default::default()
    });
    let expert = ExpertView::of_modes(
        case,
        (&case.model, &calibration.theta),
        &analysis.calibrated,
        &modes,
    )?;
    let document = StructureDocument {
        domain: Side::Structure,
        revision: case.revision(),
        effects: case.effects(),
        error: ErrorHeldOut {
            totals: comparison.totals,
            held_out_nrms: held_out,
        },
        by_posture: nrms_by_name(&comparison.by_posture),
        by_direction: nrms_by_name(&comparison.by_direction),
        by_point: nrms_by_name(&comparison.by_point),
        by_band: &comparison.by_band,
        map: &comparison.map,
        modes: modes.pairs.iter().map(ModeCompared::of).collect(),
        fixed_modes: &expert.fixed_modes,
        located: &expert.located,
        stands_out: expert.sentences(),
        frfs: comparison.frf_errors.iter().map(FrfForm::of).collect(),
        mostly: comparison.mostly.as_ref(),
        residual_peaks_hz: peaks.iter().map(|p| p.frequency_hz).collect(),
        residual_peaks: &peaks,
        worst_frfs: comparison
            .worst_first()
            .iter()
            .take(WORST_TOLD)
            .map(|&i| FrfWithNoise::of(&comparison.frf_errors[i]))
            .collect(),
        setup: &setup.findings,
        convergence: Convergence::of(calibration),
        warnings: &notes,
    };
    let next = Guide::structure(campaign).compared(
        calibration.reduced_chi2,
        &comparison.totals,
        comparison.mostly.as_ref().map(DominantRegion::words),
    );
    let text = files_first(&setup.findings, &case.warnings)
        + &format!("model: {}\n", case.model_description())
        + &stands_out(&expert)
        + &describe(comparison, held_out, &peaks)
        + &mode_table(&modes.pairs)
        + &warnings_but(&notes, &case.warnings);
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `compare` found about FRFs.
#[derive(Serialize)]
struct StructureDocument<'a> {
    domain: Side,
    revision: Option<usize>,
    effects: Vec<String>,
    error: ErrorHeldOut,
    by_posture: BTreeMap<&'a str, f64>,
    by_direction: BTreeMap<&'a str, f64>,
    by_point: BTreeMap<&'a str, f64>,
    by_band: &'a [Band],
    map: &'a ErrorMap,
    modes: Vec<ModeCompared<'a>>,
    fixed_modes: &'a [FixedMode],
    located: &'a [Location],
    stands_out: Vec<String>,
    frfs: Vec<FrfForm<'a>>,
    mostly: Option<&'a DominantRegion>,
    residual_peaks_hz: Vec<f64>,
    residual_peaks: &'a [ResidualPeak],
    worst_frfs: Vec<FrfWithNoise<'a>>,
    setup: &'a [SetupFinding],
    #[serde(flatten)]
    convergence: Convergence,
    warnings: &'a [String],
}

/// What stands out to an expert's eye, a line each.
pub fn stands_out(expert: &ExpertView) -> String {
    expert.sentences().iter().map(|s| wrapped(s, "  ")).collect()
}

/// A pair of modes; errors are model over measured less 1.
#[derive(Serialize)]
struct ModeCompared<'a> {
    #[serde(flatten)]
    pair: &'a ModePair,
    frequency_error: Option<f64>,
    damping_error: Option<f64>,
}

impl<'a> ModeCompared<'a> {
    fn of(pair: &'a ModePair) -> Self {
        ModeCompared {
            pair,
            frequency_error: pair.frequency_error(),
            damping_error: pair.damping_error(),
        }
    }
}

/// An FRF in short.
#[derive(Serialize)]
struct FrfForm<'a> {
    name: &'a str,
    posture: &'a str,
    frac: Option<f64>,
    nrms: f64,
    times_noise: f64,
}

impl<'a> FrfForm<'a> {
    fn of(error: &'a FrfError) -> Self {
        FrfForm {
            name: &error.name,
            posture: &error.posture,
            frac: error.frac,
            nrms: error.nrms,
            times_noise: error.times_noise(),
        }
    }
}

/// An FRF with all that is known of its error.
#[derive(Serialize)]
struct FrfWithNoise<'a> {
    #[serde(flatten)]
    error: &'a FrfError,
    times_noise: f64,
}

impl<'a> FrfWithNoise<'a> {
    fn of(error: &'a FrfError) -> Self {
        FrfWithNoise {
            error,
            times_noise: error.times_noise(),
        }
    }
}

/// A table with bars for each kind of group.
fn group_tables(kinds: &[(&str, &Vec<GroupError>)]) -> String {
    let mut text = String::new();
    for (title, groups) in kinds {
        let largest = groups.iter().map(|g| g.nrms).fold(0.0, f64::max);
        let rows: Vec<Vec<String>> = groups
            .iter()
            .map(|g| {
                vec![
                    g.name.clone(),
                    percent(g.nrms),
                    percent(g.noise_floor_nrms),
                    error_bar(g.nrms, g.noise_floor_nrms, largest),
                ]
            })
            .collect();
        text += &format!("\n{}", table(&[title, "nrms", "noise", ""], &rows));
    }
    text
}

fn describe(comparison: &FrfComparison, held_out: Option<f64>, peaks: &[ResidualPeak]) -> String {
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
    text += &dominant(peaks);
    text += &group_tables(&[
        ("posture", &comparison.by_posture),
        ("direction", &comparison.by_direction),
        ("node", &comparison.by_point),
    ]);
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
                error_bar(times, if b.noise_floor_nrms > 0.0 { 1.0 } else { 0.0 }, largest),
            ]
        })
        .collect();
    text += &format!(
        "\n{}",
        table(&["band Hz", "nrms", "noise", "times noise", ""], &rows)
    );
    text += &format!("\n{}", grid(&comparison.map));
    text + &format!("\n{}", worst(comparison))
}

fn mode_table(modes: &[ModePair]) -> String {
    let optional =
        |value: Option<f64>, digits: usize| value.map_or("–".into(), |v| format!("{v:.digits$}"));
    let rows: Vec<Vec<String>> = modes
        .iter()
        .map(|m| {
            vec![
                m.posture.clone(),
                format!("{:.3}±{:.3}", m.measured_hz, m.measured_std_hz),
                optional(m.model_hz, 3),
                optional(m.model_hz.map(|f| 100.0 * (f / m.measured_hz - 1.0)), 1),
                format!(
                    "{:.2}±{:.2}",
                    100.0 * m.measured_damping,
                    100.0 * m.measured_damping_std
                ),
                optional(m.model_damping.map(|d| 100.0 * d), 2),
                optional(m.mac, 2),
            ]
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let header = [
        "posture",
        "measured Hz",
        "model Hz",
        "off %",
        "measured ζ %",
        "model ζ %",
        "MAC",
    ];
    format!(
        "\nmodes: measured, and the model's nearest\n{}",
        table(&header, &rows)
    )
}

/// The residual's dominant frequencies, in one line.
pub fn dominant(peaks: &[ResidualPeak]) -> String {
    let parts: Vec<String> = peaks
        .iter()
        .map(|p| format!("{} Hz ({:.1} × noise)", number(p.frequency_hz, 3), p.times_noise))
        .collect();
    match parts.is_empty() {
        true => "  the residual stands out at no frequency\n".into(),
        false => format!("  residual stands out at {}\n", parts.join(", ")),
    }
}

/// Times noise from which on a character of the error map is used.
const SHADES: [(f64, char); 5] = [(0.0, '·'), (1.5, '░'), (3.0, '▒'), (10.0, '▓'), (30.0, '█')];
/// Directions side by side, so that a line fits a terminal of 80 columns.
const DIRECTIONS_A_LINE: usize = 5;

/// The error map at a glance: a row a posture, a block a direction, a character a band.
fn grid(map: &ErrorMap) -> String {
    let shade = |value: &Option<f64>| match value {
        None => " ".to_string(),
        Some(v) => {
            let shades = SHADES.iter().rev();
            let character = shades.clone().find(|(from, _)| v >= from).map_or('·', |s| s.1);
            Emphasis::of_times_noise(*v).on(character)
        }
    };
    let bands = map.band_edges_hz.len().saturating_sub(1);
    let width = map.postures.iter().map(|p| p.chars().count()).max().unwrap_or(0);
    let ends = [map.band_edges_hz.first(), map.band_edges_hz.last()].map(|f| number(*f.unwrap_or(&0.0), 3));
    let mut text = format!(
        "  error map: a character a band, {} to {} Hz from left to right; times noise: · below 1.5, ░ from 1.5, ▒ from 3, \
         ▓ from 10, █ from 30\n",
        ends[0], ends[1]
    );
    for first in (0..map.directions.len()).step_by(DIRECTIONS_A_LINE) {
        let directions = first..(first + DIRECTIONS_A_LINE).min(map.directions.len());
        let names = directions
            .clone()
            .map(|d| format!("  {:<bands$}", map.directions[d]));
        text += format!("  {:width$}{}", "", names.collect::<String>()).trim_end();
        text += "\n";
        for (posture, cells) in map.postures.iter().zip(&map.times_noise) {
            let blocks = directions
                .clone()
                .map(|d| "  ".to_string() + &cells[d].iter().map(shade).collect::<String>());
            text += format!("  {posture:<width$}{}", blocks.collect::<String>()).trim_end();
            text += "\n";
        }
    }
    text
}

/// The worst FRFs in the document.
const WORST_TOLD: usize = 10;
/// FRFs in the table of the worst.
const WORST_SHOWN: usize = 5;

fn worst(comparison: &FrfComparison) -> String {
    let row = |&i: &usize| {
        let error = &comparison.frf_errors[i];
        let frac = error.frac.map_or("–".into(), |f| format!("{f:.2}"));
        let mut row = vec![error.name.clone(), format!("{:.1}", error.times_noise()), frac];
        row.extend(error.worst_line.iter().flat_map(|line| {
            [
                line.frequency_hz,
                line.measured_m_per_n * 1e6,
                line.model_m_per_n * 1e6,
                line.noise_m_per_n * 1e6,
            ]
            .map(|v| number(v, 3))
        }));
        row
    };
    let rows: Vec<Vec<String>> = comparison
        .worst_first()
        .iter()
        .take(WORST_SHOWN)
        .map(row)
        .collect();
    table(
        &[
            "worst FRFs",
            "times noise",
            "FRAC",
            "worst at Hz",
            "measured µm/N",
            "model µm/N",
            "noise µm/N",
        ],
        &rows,
    )
}
