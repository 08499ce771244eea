//! `lobestone modal FILE…|DIR`: modal parameters of FRFs and raw tap tests.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::analysis::modes::modal::FrfReading;
use crate::analysis::modes::operational;
use crate::analysis::{ModalAnalysis, SetModes};
use crate::campaign::Campaign;
use crate::commands::Outcome;
use crate::commands::measure::modal_document::ModalDocument;
use crate::commands::measure::modal_files::{self, Files};
use crate::commands::next_step::{self, Guide};
use crate::commands::text::{Emphasis, files_first, said_once, table};
use crate::data::Quantity;
use crate::modal::chosen::Choice;
use crate::modal::operational::OperationalSettings;
use crate::modal::{Estimator, Method, Settings, TapSettings, Tolerances};
use crate::text::hertz;
use crate::{InputError, Result};

#[derive(clap::Args)]
pub struct ModalArgs {
    /// FRF files (UFF 58, CSV, …), time records of tap tests (hammer and sensors), or one campaign folder.
    #[arg(required = true, value_name = "FILE|DIR")]
    paths: Vec<PathBuf>,
    /// Look at this band only, Hz.
    #[arg(long, value_name = "FROM:TO", value_parser = crate::commands::range::band)]
    band: Option<[f64; 2]>,
    /// The files are one set: FRFs of the same structure, exported one by one.
    #[arg(long)]
    together: bool,
    /// What the FRFs are of files that do not say (left out: what the other files say, else receptance).
    #[arg(long, value_enum, conflicts_with = "output_only")]
    quantity: Option<Quantity>,
    /// Print the modes of every single FRF, each fitted by itself with its errors, however many there are.
    #[arg(long)]
    each: bool,
    /// Tap tests: how FRFs are averaged.
    #[arg(long, value_enum, default_value = "h1")]
    estimator: EstimatorArg,
    /// Tap tests: length of a block, s (from the distance of the hits where left out).
    #[arg(long, value_name = "S", value_parser = seconds)]
    block_s: Option<f64>,
    /// Records without a time column (tap tests, responses alone): sampling rate, Hz.
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate: Option<f64>,
    /// Tap tests: the hammer's channel, by its name or its number among the channels (found by its unit, name or pulses where left out).
    #[arg(long, value_name = "CHANNEL", conflicts_with = "output_only")]
    hammer: Option<String>,
    /// The files are records of responses without forces (idling, cutting): modes from them alone.
    #[arg(long, conflicts_with_all = ["together", "each", "block_s"])]
    output_only: bool,
    /// Write a report of its own into this folder (HTML and PNG).
    #[arg(long, value_name = "DIR", conflicts_with = "output_only")]
    report: Option<PathBuf>,
    /// Write modes, shapes and synthesised FRFs for other programs into this folder (UFF 55 and 58, CSV, MAT).
    #[arg(long, value_name = "DIR", conflicts_with = "output_only")]
    export: Option<PathBuf>,
    /// Where the measured points are: universal file with datasets 15/2411 and 82, or CSV with node,x,y,z and line,from,to.
    #[arg(long, value_name = "FILE", conflicts_with = "output_only")]
    geometry: Option<PathBuf>,
    /// Compare the shapes with a model's: universal file with datasets 55 (and 15 or 2411).
    #[arg(long, value_name = "FILE", conflicts_with = "output_only")]
    model: Option<PathBuf>,
    /// Take this pole instead of those found (repeat): frequency in Hz, or frequency:damping ratio.
    #[arg(long, value_name = "HZ[:RATIO]", value_parser = pole, conflicts_with = "output_only")]
    pole: Vec<(f64, Option<f64>)>,
    /// Leave out the mode at this frequency, Hz (repeat).
    #[arg(long, value_name = "HZ", value_parser = positive, conflicts_with = "output_only")]
    without: Vec<f64>,
    /// Only the strongest so many modes.
    #[arg(long, value_name = "N", conflicts_with = "output_only")]
    modes: Option<usize>,
    /// Time constant of the exponential window that the FRFs were measured with, s: its damping is taken out.
    #[arg(long, value_name = "S", value_parser = seconds, conflicts_with = "output_only")]
    window_tau: Option<f64>,
    /// Output-only: speed of the spindle, 1/min, to name its harmonics by.
    #[arg(long, value_name = "RPM", value_parser = positive, requires = "output_only")]
    spindle: Option<f64>,
    /// Highest order of the stabilisation diagram (from the number of peaks where left out; output-only: two a mode).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=300))]
    order: Option<u32>,
    /// How near a pole must be to one of the order below to have stayed: relative change of frequency and of damping at most,
    /// MAC of the shapes at least.
    #[arg(long, value_name = "F:ZETA:MAC", value_parser = tolerances, default_value = "0.01:0.1:0.95",
          conflicts_with = "output_only")]
    tolerances: Tolerances,
    /// Single FRFs: parameters by this method only.
    #[arg(long, value_enum, conflicts_with = "output_only")]
    method: Option<MethodArg>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum EstimatorArg {
    H1,
    H2,
    Hv,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum MethodArg {
    LocalFit,
    CircleFit,
    HalfPower,
}

impl From<MethodArg> for Method {
    fn from(arg: MethodArg) -> Method {
        match arg {
            MethodArg::LocalFit => Method::LocalFit,
            MethodArg::CircleFit => Method::CircleFit,
            MethodArg::HalfPower => Method::HalfPower,
        }
    }
}

/// Of so many FRFs the modes of each are printed unasked.
const FEW_FRFS: usize = 8;
/// Rejected poles shown to a person.
const FEW_REJECTED: usize = 5;
/// Warnings shown to a person; all are in the JSON.
const MOST_WARNINGS: usize = 20;

fn seconds(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|s: &f64| s.is_finite() && *s > 0.0)
        .ok_or_else(|| "give seconds, such as 4.0".into())
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|x: &f64| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "give a number above zero".into())
}

fn pole(text: &str) -> std::result::Result<(f64, Option<f64>), String> {
    let wrong = || "give a pole as frequency in Hz, or frequency:damping ratio, such as 12.5:0.02".to_owned();
    let (f, zeta) = match text.split_once(':') {
        Some((f, zeta)) => (f, Some(zeta)),
        None => (text, None),
    };
    let zeta = zeta.map(positive).transpose().map_err(|_| wrong())?;
    match zeta {
        Some(zeta) if zeta >= 1.0 => Err(wrong()),
        _ => Ok((positive(f).map_err(|_| wrong())?, zeta)),
    }
}

fn tolerances(text: &str) -> std::result::Result<Tolerances, String> {
    let share = |text: &str| text.parse().ok().filter(|x: &f64| *x > 0.0 && *x < 1.0);
    let all: Option<Vec<f64>> = text.split(':').map(share).collect();
    match all.as_deref() {
        Some(&[frequency, damping, mac]) => Ok(Tolerances {
            frequency,
            damping,
            mac,
            ..Tolerances::default()
        }),
        _ => Err("give three numbers between 0 and 1, such as 0.01:0.1:0.95".into()),
    }
}

pub fn run(args: ModalArgs) -> Result<Outcome> {
    let settings = Settings {
        band_hz: args.band,
        max_order: args.order.map(|n| n as usize),
        each: args.each,
        tolerances: args.tolerances,
    };
    let taps = TapSettings {
        estimator: match args.estimator {
            EstimatorArg::H1 => Estimator::H1,
            EstimatorArg::H2 => Estimator::H2,
            EstimatorArg::Hv => Estimator::Hv,
        },
        block_s: args.block_s,
        ..TapSettings::default()
    };
    let campaign = args.paths.iter().any(|p| p.is_dir());
    if args.output_only {
        return output_only(&args, campaign);
    }
    if campaign && args.together {
        return Err(
            InputError::new("--together is for files: a campaign's postures are sets of their own")
                .remedy("leave it out, or give the FRF files")
                .into(),
        );
    }
    let (mut analysis, next, guessed) = match args.paths.as_slice() {
        [dir] if campaign => {
            let campaign = Campaign::load(dir)?;
            let analysis = ModalAnalysis::of_campaign(&campaign, &settings)?;
            let next = Guide::structure(&campaign).modes(analysis.mode_count());
            (analysis, next, campaign.guesses.of_robot_told())
        }
        _ if campaign => {
            return Err(
                InputError::new("a campaign folder cannot be mixed with other paths")
                    .remedy("give one folder, or files only")
                    .into(),
            );
        }
        files => {
            let reading = FrfReading {
                unsaid: args.quantity.unwrap_or_default(),
                unsaid_like_the_rest: args.quantity.is_none(),
                added_decay_per_s: args.window_tau.map_or(0.0, |tau| 1.0 / tau),
                taps,
                rate_hz: args.rate,
                hammer: args.hammer.clone(),
                sensors: args.quantity,
            };
            let analysis = ModalAnalysis::of_files(files, args.together, &reading, &settings)?;
            let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
            let next = next_step::modes_of_files(&paths, analysis.mode_count());
            (analysis, next, None)
        }
    };
    if let Some(method) = args.method {
        analysis.keep_method(method.into());
    }
    analysis.choose(&Choice {
        poles: args.pole.clone(),
        without_hz: args.without.clone(),
        modes: args.modes,
    })?;
    let mut said = files_first(&[], guessed.as_slice()) + &text(&analysis, args.each);
    let files = modal_files::write(&args.files(), &analysis, &mut said)?;
    Ok(Outcome::new(
        ModalDocument::new(&analysis, campaign, &files),
        said,
        Some(next),
    ))
}

impl ModalArgs {
    /// What is to be written besides, and with what.
    fn files(&self) -> Files<'_> {
        Files {
            report: self.report.as_deref(),
            export: self.export.as_deref(),
            geometry: self.geometry.as_deref(),
            model: self.model.as_deref(),
            inputs: &self.paths,
            together: self.together,
            band_hz: self.band,
            window_tau_s: self.window_tau,
            rate_hz: self.rate,
        }
    }
}

fn output_only(args: &ModalArgs, folder: bool) -> Result<Outcome> {
    if folder {
        return Err(InputError::new("--output-only is for records, not for a folder")
            .remedy("give the files of recorded accelerations")
            .into());
    }
    let settings = OperationalSettings {
        band_hz: args.band,
        max_order: args.order.map(|n| n as usize),
        spindle_rpm: args.spindle,
    };
    let sets = operational::of_files(&args.paths, args.rate, &settings)?;
    let found = sets.iter().map(|s| s.modes.modes.len()).sum();
    let paths: Vec<&Path> = args.paths.iter().map(PathBuf::as_path).collect();
    Ok(Outcome::new(
        crate::commands::measure::operational::OperationalDocument::new(&sets),
        crate::commands::measure::operational::text(&sets),
        Some(next_step::modes_of_files(&paths, found)),
    ))
}

/// One row a mode, one column a set.
fn tracked(analysis: &ModalAnalysis) -> String {
    let mut header = vec!["mode"];
    header.extend(analysis.sets.iter().map(|s| s.set.as_str()));
    let cell = |set: &SetModes, mode: Option<usize>| {
        mode.map_or("–".to_owned(), |k| {
            let m = &set.global.modes[k];
            let places = places(std::iter::once(m.frequency_hz));
            format!(
                "{:.places$}±{:.places$} Hz {:.2}±{:.2} %",
                m.frequency_hz,
                m.frequency_std_hz,
                100.0 * m.damping_ratio,
                100.0 * m.damping_std
            )
        })
    };
    let rows: Vec<Vec<String>> = analysis
        .tracks()
        .iter()
        .enumerate()
        .map(|(k, track)| {
            let cells = analysis.sets.iter().zip(&track.mode_of_set);
            let mut row = vec![(k + 1).to_string()];
            row.extend(cells.map(|(set, mode)| cell(set, *mode)));
            row
        })
        .collect();
    table(&header, &rows)
}

fn text(analysis: &ModalAnalysis, each: bool) -> String {
    let mut out = String::new();
    // Writing to a String cannot fail.
    for (file, hits) in &analysis.hits {
        let _ = writeln!(out, "{file}: hits");
        for (k, hit) in hits.iter().enumerate() {
            let what = hit
                .left_out
                .as_ref()
                .map_or("used".into(), |why| format!("left out: {why}"));
            let _ = writeln!(
                out,
                "  {:>3}  {:8.3} s  {:9.1} N  {what}",
                k + 1,
                hit.time_s,
                hit.peak_n
            );
        }
    }
    let frfs: usize = analysis.sets.iter().map(|s| s.frfs.len()).sum();
    if each || frfs <= FEW_FRFS {
        for set in &analysis.sets {
            single(set, &mut out);
        }
    } else {
        let _ = writeln!(out, "{frfs} FRFs (the modes of each: --each, or --json)");
    }
    for set in &analysis.sets {
        let _ = writeln!(out, "\n{}: all FRFs together ({})", set.set, set.why);
        let _ = writeln!(out, "      f Hz      ±     ζ %      ±  found in  collinear");
        let places = places(set.global.modes.iter().map(|m| m.frequency_hz));
        for mode in &set.global.modes {
            let collinear = mode.complexity.map_or("–".into(), |c| {
                format!("{:.3}{}", c.mpc, if c.is_low() { " complex" } else { "" })
            });
            let _ = writeln!(
                out,
                "  {:8.places$} {} {:7.3} {}  {:<8}  {collinear}",
                mode.frequency_hz,
                deviation(Some(mode.frequency_std_hz), places),
                100.0 * mode.damping_ratio,
                deviation(Some(100.0 * mode.damping_std), PLACES),
                mode.found_in,
            );
        }
        for pole in set.global.rejected.iter().take(FEW_REJECTED) {
            let _ = writeln!(
                out,
                "    no mode: {} Hz, {}",
                hertz(pole.frequency_hz),
                pole.reason
            );
        }
        let more = set.global.rejected.len().saturating_sub(FEW_REJECTED);
        if more > 0 {
            let _ = writeln!(out, "    and {more} more that are no modes (which: --json)");
        }
    }
    if analysis.sets.len() > 1 && analysis.mode_count() > 0 {
        let _ = writeln!(
            out,
            "\nthe modes from set to set (paired by frequency and shape)\n{}",
            tracked(analysis)
        );
    }
    if !analysis.warnings.is_empty() {
        let _ = writeln!(out, "\n{}", Emphasis::Doubtful.on("warnings"));
        let warnings = said_once(&analysis.warnings);
        for warning in warnings.iter().take(MOST_WARNINGS) {
            let _ = writeln!(out, "  {warning}");
        }
        if warnings.len() > MOST_WARNINGS {
            let _ = writeln!(out, "  … and {} more: see --json", warnings.len() - MOST_WARNINGS);
        }
    }
    out
}

/// Modes of the single FRFs of a set.
fn single(set: &SetModes, out: &mut String) {
    for frf in &set.frfs {
        let _ = writeln!(out, "{} {}", set.set, frf.input.name);
        if frf.modes.modes.is_empty() {
            let _ = writeln!(out, "  no modes found");
            continue;
        }
        let _ = writeln!(out, "      f Hz      ±     ζ %      ±  method      lines in band");
        let places = places(frf.modes.modes.iter().map(|m| m.best().frequency_hz));
        for mode in &frf.modes.modes {
            for (k, e) in mode.estimates.iter().enumerate() {
                let lines = if k == 0 {
                    format!("{:.1}", mode.lines_in_half_power_band)
                } else {
                    String::new()
                };
                let _ = writeln!(
                    out,
                    "  {:8.places$} {} {:7.3} {}  {:<10}  {lines}",
                    e.frequency_hz,
                    deviation(e.frequency_std_hz, places),
                    100.0 * e.damping_ratio,
                    deviation(e.damping_std.map(|s| 100.0 * s), PLACES),
                    e.method.id(),
                );
            }
            let _ = writeln!(out, "      take the {}: {}", mode.recommended.id(), mode.reason);
        }
    }
}

/// Places behind the point of a table, of most tables.
const PLACES: usize = 3;

/// Places that show five figures of the lowest frequency of a table, Hz.
fn places(frequencies_hz: impl Iterator<Item = f64>) -> usize {
    let lowest = frequencies_hz.filter(|f| *f > 0.0).fold(f64::INFINITY, f64::min);
    let wanted = if lowest.is_finite() {
        4.0 - lowest.log10().floor()
    } else {
        0.0
    };
    (wanted as usize).clamp(PLACES, 8)
}

fn deviation(std: Option<f64>, places: usize) -> String {
    std.map_or("     –".into(), |s| format!("{s:6.places$}"))
}
