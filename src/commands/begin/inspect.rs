use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use crate::campaign::draft::measurement_files;
use crate::commands::text::Emphasis;
use crate::commands::{Outcome, next_step};
use crate::ingest::{self, Channel, ChannelRole, Dof, FrfRecord, Quantity, TimeRecord, units};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
pub struct InspectArgs {
    /// Measurement files, or folders of them: UFF 58, FRF CSV, DynoWare export, force CSV, TDMS, LVM, MAT.
    #[arg(required = true, value_name = "FILE|DIR")]
    files: Vec<PathBuf>,
}

/// What can be read is told; a file that cannot is an error that names it, after what was told.
pub fn run(args: InspectArgs) -> Result<Outcome> {
    let mut failures = Vec::new();
    let mut files: Vec<FileSeen> = Vec::new();
    let mut paths = Vec::new();
    for path in args.files {
        match path.is_dir() {
            true => paths.extend(files_of(&path)?),
            false => paths.push(path),
        }
    }
    for path in &paths {
        match inspect(path) {
            Ok(seen) => files.push(seen),
            Err(error) => failures.push(error),
        }
    }
    let unreadable: Vec<String> = failures.iter().map(ToString::to_string).collect();
    let failed = match failures.len() {
        0 => None,
        1 => Some(failures.remove(0)),
        n => Some(
            InputError::new(format!(
                "{n} of {} files cannot be read\n{}",
                paths.len(),
                unreadable.join("\n")
            ))
            .into(),
        ),
    };
    match failed {
        Some(failed) if files.is_empty() => Err(failed),
        failed => {
            let text: String = files.iter().map(FileSeen::text).collect();
            let kinds: Vec<(&Path, &'static str)> =
                files.iter().map(|f| (f.path.as_path(), f.kind)).collect();
            let next = next_step::inspected(&kinds);
            Ok(Outcome {
                failed,
                // The blank line after the last file is that of the next step.
                ..Outcome::new(
                    Document {
                        files: &files,
                        unreadable,
                    },
                    text.trim_end().to_string() + "\n",
                    Some(next),
                )
            })
        }
    }
}

/// The files below a folder that may be measurements, in the order of their names.
fn files_of(dir: &Path) -> Result<Vec<PathBuf>> {
    let files = measurement_files(dir)?;
    match files.is_empty() {
        true => Err(InputError::new("holds no measurement files")
            .file(dir)
            .remedy("give the files, or the folder that they lie in")
            .into()),
        false => Ok(files),
    }
}

/// What `inspect` saw.
#[derive(Serialize)]
struct Document<'a> {
    files: &'a [FileSeen],
    /// What is wrong with the others.
    unreadable: Vec<String>,
}

/// A file and what it is for.
#[derive(Serialize)]
struct FileSeen {
    /// Need not be Unicode: what cannot be written is shown as a replacement character.
    #[serde(serialize_with = "displayed")]
    path: PathBuf,
    format: String,
    why: String,
    kind: &'static str,
    channels: Vec<Row>,
    warnings: Vec<String>,
}

fn displayed<S: Serializer>(path: &Path, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// One channel or FRF, and its cells in the table.
#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    content: Content,
    #[serde(skip)]
    cells: [String; 5],
}

#[derive(Serialize)]
#[serde(untagged)]
enum Content {
    Frf(FrfSeen),
    Signal(SignalSeen),
}

#[derive(Serialize)]
struct FrfSeen {
    name: String,
    response: Option<String>,
    reference: Option<String>,
    quantity: Option<&'static str>,
    unit: Option<&'static str>,
    role: &'static str,
    lines: usize,
    from_hz: Option<f64>,
    to_hz: Option<f64>,
    coherence: bool,
}

#[derive(Serialize)]
struct SignalSeen {
    name: String,
    quantity: &'static str,
    unit: String,
    file_unit: String,
    role: &'static str,
    samples: usize,
    sample_rate_hz: f64,
    start_s: f64,
}

fn inspect(path: &Path) -> Result<FileSeen> {
    let survey = ingest::survey(path).map_err(|error| match error {
        Error::Input(error) => without_times(path, *error).into(),
        other => other,
    })?;
    let file = survey.file;
    let contents = &file.contents;
    let is_force = |record: &TimeRecord| record.channels.iter().any(|c| c.role != ChannelRole::Other);
    let kind = match (contents.frfs.is_empty(), contents.times.as_slice()) {
        (false, _) => "frf",
        (true, []) => {
            return Err(InputError::new(format!(
                "no FRF and no time signal in this {} file, but {}",
                file.format,
                contents.describe()
            ))
            .file(path)
            .remedy("export FRFs or time signals")
            .into());
        }
        (true, times) if times.iter().any(is_force) => "force",
        _ => "time",
    };
    let mut rows: Vec<Row> = contents.frfs.iter().map(frf_row).collect();
    for (record, samples) in contents.times.iter().zip(survey.samples) {
        rows.extend(
            record
                .channels
                .iter()
                .map(|channel| time_row(record, channel, samples)),
        );
    }
    let mut warnings = file.warnings.clone();
    warnings.extend(survey.quality);
    if !contents.others.is_empty() {
        warnings.push(format!(
            "holds {}: only FRFs, coherences and time signals are used",
            contents.describe()
        ));
    }
    Ok(FileSeen {
        path: file.path,
        format: file.format.to_string(),
        why: file.why,
        kind,
        channels: rows,
        warnings,
    })
}

/// Cuts of a file whose lines are shown; those of the others are alike.
const SHOWN_CUTS: usize = 2;

/// What to tell of a file that was not understood: where forces without times are all that is in it, which they are and the lines
/// that say the rest; else `error`, as it is.
fn without_times(path: &Path, error: InputError) -> InputError {
    let found = ingest::timeless(path).unwrap_or_default();
    // What is wrong with times that are there says more than that a rate is missing.
    if found.useless_times {
        return error;
    }
    let cuts = found.cuts;
    let names = |cuts: &[ingest::NamedCut]| {
        let all: Vec<&str> = cuts
            .iter()
            .flat_map(|(_, c)| c.iter().map(|(_, name)| name.as_str()))
            .collect();
        all.join(", ")
    };
    let channels = |cut: Option<&str>, channels: &[ingest::NamedForce]| -> String {
        let each = channels.iter().enumerate().map(|(i, (what, name))| {
            let [unit, of_cut] = cut.map_or(Default::default(), |id| {
                ["\nunit = \"N\"".to_string(), format!("\ncut = \"{id}\"")]
            });
            // Of one table all columns have one rate.
            let rate = if cut.is_some() || i == 0 {
                "\nrate_hz = 10000.0"
            } else {
                ""
            };
            format!("\n[[channel]]\nname = \"{what}\"\nin_file = \"{name}\"{unit}{rate}{of_cut}")
        });
        each.collect()
    };
    match cuts.as_slice() {
        [] => error,
        [(_, own)] => InputError::new(format!(
            "forces ({}), and neither times nor a sampling rate",
            names(&cuts)
        ))
        .file(path)
        .remedy(format!(
            "say how fast it was sampled: `lobestone init FOLDER --rate-hz 10000`, or in campaign.toml{}",
            channels(None, own)
        )),
        several => {
            let file = path
                .file_name()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            let lines: String = several
                .iter()
                .take(SHOWN_CUTS)
                .map(|(id, own)| {
                    format!(
                        "\n[[cut]]\nid = \"{id}\"\nfile = \"{file}\"\nprocess = \"milling\"\n# fill in: spindle_rpm, feed_per_tooth_mm, axial_depth_mm, immersion{}",
                        channels(Some(id), own)
                    )
                })
                .collect();
            let ids: Vec<&str> = several.iter().map(|(id, _)| id.as_str()).collect();
            InputError::new(format!(
                "forces of {} cuts ({}), and neither times nor a sampling rate: {}",
                several.len(),
                ids.join(", "),
                names(several)
            ))
            .file(path)
            .remedy(format!(
                "say in campaign.toml which channels are those of which cut, their unit and how fast they were sampled (`lobestone init FOLDER \
                 --rate-hz 10000` writes it), for each cut such as{lines}"
            ))
        }
    }
}

impl FileSeen {
    fn text(&self) -> String {
        let mut text = format!(
            "{}\n  {} ({}): {}\n",
            Emphasis::Strong.on(self.path.display()),
            self.kind,
            self.format,
            self.why
        );
        let head = ["channel", "quantity", "unit", "role", "extent"].map(str::to_owned);
        let shown: Vec<&[String; 5]> = std::iter::once(&head)
            .chain(self.channels.iter().map(|r| &r.cells))
            .collect();
        let width = |i: usize| {
            shown
                .iter()
                .map(|cells| cells[i].chars().count())
                .max()
                .unwrap_or(0)
        };
        let widths = [0, 1, 2, 3].map(width);
        for cells in shown {
            let [name, quantity, unit, role, extent] = cells;
            let [a, b, c, d] = widths;
            let _ = writeln!(text, "  {name:a$}  {quantity:b$}  {unit:c$}  {role:d$}  {extent}");
        }
        for warning in &self.warnings {
            let _ = writeln!(text, "  {} {warning}", Emphasis::Doubtful.on("warning:"));
        }
        text.push('\n');
        text
    }
}

fn frf_row(frf: &FrfRecord) -> Row {
    let (from, to) = (
        frf.frequency_hz.first().copied(),
        frf.frequency_hz.last().copied(),
    );
    let unit = frf.quantity.map(units::frf_unit);
    let quantity = frf.quantity.map(|q| match q {
        Quantity::Receptance => "receptance",
        Quantity::Mobility => "mobility",
        Quantity::Accelerance => "accelerance",
    });
    let dof = |dof: Option<Dof>| dof.map(|d| d.to_string());
    let extent = match (from, to) {
        (Some(from), Some(to)) => format!("{} lines, {from:.4} to {to:.4} Hz", frf.frequency_hz.len()),
        _ => "no lines".into(),
    };
    let coherence = if frf.coherence.is_some() {
        ", with coherence"
    } else {
        ""
    };
    Row {
        content: Content::Frf(FrfSeen {
            name: frf.name.clone(),
            response: dof(frf.response),
            reference: dof(frf.reference),
            quantity,
            unit,
            role: "frf",
            lines: frf.frequency_hz.len(),
            from_hz: from,
            to_hz: to,
            coherence: frf.coherence.is_some(),
        }),
        cells: [
            frf.name.clone(),
            quantity.unwrap_or("not said").to_owned(),
            unit.unwrap_or("?").to_owned(),
            "frf".to_owned(),
            extent + coherence,
        ],
    }
}

fn time_row(record: &TimeRecord, channel: &Channel, samples: usize) -> Row {
    let role = match channel.role {
        ChannelRole::ForceX => "force-x",
        ChannelRole::ForceY => "force-y",
        ChannelRole::ForceZ => "force-z",
        ChannelRole::TorqueZ => "torque-z",
        ChannelRole::Other => "other",
    };
    let (quantity, unit) = channel.quantity_and_unit();
    let seconds = samples as f64 / record.sample_rate_hz;
    let converted = if unit == channel.file_unit || channel.file_unit.is_empty() {
        String::new()
    } else {
        format!(" (file: {})", channel.file_unit)
    };
    let extent = format!(
        "{samples} samples at {} Hz, {seconds:.4} s from {} s",
        // A resampled record's rate has no end of digits, nor has a start within a sample.
        (record.sample_rate_hz * 1e4).round() / 1e4,
        (record.start_s * 1e6).round() / 1e6
    );
    Row {
        content: Content::Signal(SignalSeen {
            name: channel.name.clone(),
            quantity,
            unit: unit.to_owned(),
            file_unit: channel.file_unit.clone(),
            role,
            samples,
            sample_rate_hz: record.sample_rate_hz,
            start_s: record.start_s,
        }),
        cells: [
            channel.name.clone(),
            quantity.to_owned(),
            format!("{unit}{converted}"),
            role.to_owned(),
            extent,
        ],
    }
}
