//! A simulated campaign as files: `campaign.toml` and FRFs in a lab's formats.

use std::fmt::Write as _;

use num_complex::Complex64;

use crate::campaign::{AxesRef, BodyRef, Point, Posture, RobotSection};
use crate::ingest::{ByteOrder, Encoding58, FrfRecord, Quantity, frf_dataset, uff58_bytes};

/// Format of the FRF files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum FrfFormat {
    /// Universal file, dataset 58, text.
    UffAscii,
    /// Universal file, dataset 58b, binary.
    UffBinary,
    /// Comma-separated columns, one pair for each FRF.
    Csv,
}

impl FrfFormat {
    /// Ending of the file name, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            FrfFormat::UffAscii | FrfFormat::UffBinary => "uff",
            FrfFormat::Csv => "csv",
        }
    }

    /// The bytes of a file of FRFs that share one frequency axis.
    pub fn bytes(self, frfs: &[FrfRecord]) -> Vec<u8> {
        let encoding = |binary| Encoding58 { binary, double: true };
        let datasets = || frfs.iter().map(frf_dataset).collect::<Vec<_>>();
        match self {
            FrfFormat::UffAscii => uff58_bytes(&datasets(), encoding(None)),
            FrfFormat::UffBinary => uff58_bytes(&datasets(), encoding(Some(ByteOrder::Little))),
            FrfFormat::Csv => csv(frfs).into_bytes(),
        }
    }
}

/// Header and lines of the FRF CSV that campaigns read; numbers in full precision.
fn csv(frfs: &[FrfRecord]) -> String {
    let mut text = String::from("frequency_hz");
    for frf in frfs {
        let _ = write!(text, ",re({0}),im({0})", frf.name);
    }
    text.push('\n');
    let lines = frfs.first().map_or(&[][..], |frf| &frf.frequency_hz);
    for (k, frequency) in lines.iter().enumerate() {
        let _ = write!(text, "{frequency}");
        for frf in frfs {
            let _ = write!(text, ",{:e},{:e}", frf.value[k].re, frf.value[k].im);
        }
        text.push('\n');
    }
    text
}

/// Receptance, m/N, as the quantity that a sensor gives.
pub fn as_quantity(receptance: Complex64, frequency_hz: f64, quantity: Quantity) -> Complex64 {
    let i_omega = Complex64::new(0.0, std::f64::consts::TAU * frequency_hz);
    (0..quantity.derivatives()).fold(receptance, |h, _| h * i_omega)
}

/// As `quantity` in campaign.toml.
pub fn quantity_word(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Receptance => "receptance",
        Quantity::Mobility => "mobility",
        Quantity::Accelerance => "accelerance",
    }
}

/// One `[[frf]]`.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfEntry {
    pub file: String,
    /// Index into the postures.
    pub posture: usize,
    /// Written where the file does not say.
    pub quantity: Option<Quantity>,
    pub force_level_n: Option<f64>,
}

/// `campaign.toml` of the structure side.
pub fn campaign_toml(
    name: &str,
    robot: &RobotSection,
    default_stiffness_tolerance: f64,
    points: &[Point],
    postures: &[Posture],
    frfs: &[FrfEntry],
) -> String {
    let mut text = format!(
        "schema = \"lobestone/campaign/1\"\nname = {}\n\n[robot]\nmodel = {}\n",
        quoted(name),
        quoted(&robot.model)
    );
    if let Some(tolerance) = robot.mass_tolerance {
        let _ = writeln!(text, "mass_tolerance = {}", number(tolerance));
    }
    if robot.stiffness_tolerance != default_stiffness_tolerance {
        let _ = writeln!(
            text,
            "stiffness_tolerance = {}",
            number(robot.stiffness_tolerance)
        );
    }
    for point in points {
        let body = match point.body {
            BodyRef::Base => "base".into(),
            BodyRef::Link(i) => format!("link{i}"),
            BodyRef::Tool => "tool".into(),
        };
        let axes = match point.axes {
            AxesRef::Base => "base",
            AxesRef::Body => "body",
            AxesRef::Tool => "tool",
        };
        let _ = write!(
            text,
            "\n[[point]]\nnode = {}\nbody = \"{body}\"\nposition_m = {}\naxes = \"{axes}\"\n",
            point.node,
            list(&point.position_m)
        );
    }
    for posture in postures {
        let _ = write!(
            text,
            "\n[[posture]]\nid = {}\njoints_deg = {}\n",
            quoted(&posture.id),
            list(&posture.joints_deg)
        );
    }
    for frf in frfs {
        let _ = write!(
            text,
            "\n[[frf]]\nfile = {}\nposture = {}\n",
            quoted(&frf.file),
            quoted(&postures[frf.posture].id)
        );
        if let Some(quantity) = frf.quantity {
            let _ = writeln!(text, "quantity = \"{}\"", quantity_word(quantity));
        }
        if let Some(level) = frf.force_level_n {
            let _ = writeln!(text, "force_level_n = {}", number(level));
        }
    }
    text
}

/// A TOML basic string.
fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A TOML float: always with a point.
fn number(value: f64) -> String {
    format!("{value:?}")
}

fn list(values: &[f64]) -> String {
    let items: Vec<String> = values.iter().map(|v| number(*v)).collect();
    format!("[{}]", items.join(", "))
}
