//! From datasets 58 to SI records: quantities, units, degrees of freedom.

use num_complex::Complex64;

use crate::InputError;
use crate::data::{Axis, Channel, ChannelRole, Dof, FrfRecord, Quantity, TimeRecord};
use crate::ingest::checks;
use crate::ingest::contents::{Contents, OtherRecord};
use crate::ingest::formats::uff::dataset58::{Dataset58, EntityDof, Ordinate, UnitAxis};
use crate::ingest::tables::channel_names::role_of;
use crate::ingest::tables::clock::{self, Stamps};
use crate::ingest::text::Notes;
use crate::ingest::units::{self, Unit};

/// Factors of dataset 164: values in the file divided by these are SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FileUnits {
    pub length: f64,
    pub force: f64,
}

impl FileUnits {
    fn is_si(self) -> bool {
        (self.length - 1.0).abs() < 1e-6 && (self.force - 1.0).abs() < 1e-6
    }
}

/// One dataset 58 with the units that were in force where it stood.
#[derive(Debug)]
pub(crate) struct FoundDataset {
    pub dataset: Dataset58,
    pub units: Option<FileUnits>,
}

/// Function types of record 6.
const FUNCTION_NAMES: [&str; 29] = [
    "general function",
    "time response",
    "auto spectrum",
    "cross spectrum",
    "frequency response function",
    "transmissibility",
    "coherence",
    "auto correlation",
    "cross correlation",
    "power spectral density",
    "energy spectral density",
    "probability density",
    "spectrum",
    "cumulative frequency distribution",
    "peaks and valleys",
    "stress/cycles",
    "strain/cycles",
    "orbit",
    "mode indicator function",
    "force pattern",
    "partial power",
    "partial coherence",
    "eigenvalue",
    "eigenvector",
    "shock response spectrum",
    "finite impulse response",
    "multiple coherence",
    "order function",
    "phase compensation",
];

const TIME_RESPONSE: i32 = 1;
const FRF: i32 = 4;
const COHERENCE: i32 = 6;

const DISPLACEMENT: i32 = 8;
const VELOCITY: i32 = 11;
const ACCELERATION: i32 = 12;
const EXCITATION_FORCE: i32 = 13;
const REACTION_FORCE: i32 = 9;
const TIME: i32 = 17;
const FREQUENCY: i32 = 18;

pub(crate) fn contents(found: Vec<FoundDataset>, notes: &mut Notes) -> Result<Contents, InputError> {
    let mut contents = Contents::default();
    let mut coherences = Vec::new();
    for FoundDataset { dataset, units } in found {
        let abscissa = dataset.axes[0].kind;
        match dataset.function_type {
            FRF if matches!(abscissa, FREQUENCY | 0 | 1) => {
                contents.frfs.extend(frf(&dataset, units, notes)?)
            }
            TIME_RESPONSE if matches!(abscissa, TIME | 0 | 1) => time(&dataset, units, &mut contents, notes)?,
            COHERENCE => coherences.push(dataset),
            FRF => {
                notes.about(
                    &dataset.title(),
                    "called an FRF but not over frequency: kept as it stands, not used as an FRF",
                );
                contents.others.push(other(&dataset));
            }
            _ => contents.others.push(other(&dataset)),
        }
    }
    for dataset in coherences {
        attach_coherence(dataset, &mut contents, notes);
    }
    Ok(contents)
}

fn other(dataset: &Dataset58) -> OtherRecord {
    let kind = usize::try_from(dataset.function_type)
        .ok()
        .and_then(|t| FUNCTION_NAMES.get(t));
    let points = dataset
        .abscissa_values()
        .into_iter()
        .zip(complex(&dataset.ordinate));
    let (abscissa, value) = points.filter(|(x, y)| x.is_finite() && y.is_finite()).unzip();
    OtherRecord {
        kind: kind.unwrap_or(&"function of unknown type"),
        name: dataset.title(),
        abscissa,
        abscissa_unit: dataset.axes[0].unit.clone(),
        value,
        unit: dataset.axes[1].unit.clone(),
    }
}

fn complex(ordinate: &Ordinate) -> Vec<Complex64> {
    match ordinate {
        Ordinate::Complex(values) => values.clone(),
        Ordinate::Real(values) => values.iter().map(|&re| Complex64::new(re, 0.0)).collect(),
    }
}

fn frf(
    dataset: &Dataset58,
    file_units: Option<FileUnits>,
    notes: &mut Notes,
) -> Result<Option<FrfRecord>, InputError> {
    let response = dof(&dataset.response, notes);
    let reference = dof(&dataset.reference, notes);
    let name = match (response, reference) {
        (Some(response), Some(reference)) => format!("{response}/{reference}"),
        _ => dataset.title(),
    };
    let (quantity, factor) = frf_quantity(dataset, file_units, &name, notes);
    if matches!(dataset.ordinate, Ordinate::Real(_)) {
        notes.about(&name, "an FRF stored as real numbers: it has no phase");
    }
    let hertz = abscissa_to_hz(&dataset.axes[0], &name, notes);
    let record = FrfRecord {
        name,
        response,
        reference,
        quantity,
        frequency_hz: dataset.abscissa_values().into_iter().map(|f| f * hertz).collect(),
        value: complex(&dataset.ordinate)
            .into_iter()
            .map(|v| v * factor)
            .collect(),
        coherence: None,
    };
    checks::tidy_frf(record, notes)
}

fn abscissa_to_hz(axis: &UnitAxis, name: &str, notes: &mut Notes) -> f64 {
    if units::is_blank(&axis.unit) {
        return 1.0;
    }
    units::frequency_factor(&axis.unit).unwrap_or_else(|| {
        notes.about(
            name,
            format!("frequency unit {:?} not understood: Hz assumed", axis.unit),
        );
        1.0
    })
}

/// Node and direction of record 6; entity names such as `.1.Z-` (component.node.direction) where those are zero.
fn dof(entity: &EntityDof, notes: &mut Notes) -> Option<Dof> {
    let axis = match entity.direction.unsigned_abs() {
        1 => Axis::X,
        2 => Axis::Y,
        3 => Axis::Z,
        0 if entity.node == 0 => {
            let dof = dof_of_name(&entity.name)?;
            notes
                .file("node and direction taken from entity names such as \".1.Z-\", their numbers are zero");
            return Some(dof);
        }
        _ => return None,
    };
    Some(Dof {
        node: entity.node,
        axis,
        negative: entity.direction < 0,
    })
}

fn dof_of_name(name: &str) -> Option<Dof> {
    let mut parts = name.rsplit('.');
    let direction = parts.next()?;
    let node = parts.next()?.parse().ok()?;
    let (axis, sign) = direction.split_at_checked(1)?;
    let axis = Axis::ALL.into_iter().find(|a| axis == a.letter().to_string())?;
    matches!(sign, "" | "+" | "-").then_some(Dof {
        node,
        axis,
        negative: sign == "-",
    })
}

/// Words that name an FRF form.
fn quantity_of_words(text: &str) -> Option<Quantity> {
    let text = text.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|w| text.contains(w));
    match (
        has(&["receptance", "compliance", "admittance"]),
        has(&["mobility"]),
        has(&["accelerance", "inertance"]),
    ) {
        (true, false, false) => Some(Quantity::Receptance),
        (false, true, false) => Some(Quantity::Mobility),
        (false, false, true) => Some(Quantity::Accelerance),
        _ => None,
    }
}

fn quantity_of_type(kind: i32) -> Option<Quantity> {
    match kind {
        DISPLACEMENT => Some(Quantity::Receptance),
        VELOCITY => Some(Quantity::Mobility),
        ACCELERATION => Some(Quantity::Accelerance),
        _ => None,
    }
}

/// What an FRF is and the factor that makes it SI. Asked are the data types of the axes, the unit labels and
/// words in the labels; where they contradict each other the quantity stays open and the campaign file decides.
fn frf_quantity(
    dataset: &Dataset58,
    file_units: Option<FileUnits>,
    name: &str,
    notes: &mut Notes,
) -> (Option<Quantity>, f64) {
    let [_, numerator, denominator, _] = &dataset.axes;
    let label_unit = units::parse_named(&numerator.unit);
    for axis in [numerator, denominator] {
        if units::parse_named(&axis.unit).is_none() && !units::is_blank(&axis.unit) {
            notes.about(name, format!("unit {:?} not understood, SI assumed", axis.unit));
        }
    }
    let is_whole = units::is_blank(&denominator.unit) || numerator.unit.contains('/');
    let ratio = match is_whole {
        true => numerator.unit.clone(),
        false => format!("{}/{}", numerator.unit, denominator.unit),
    };
    if let Some(remark) = units::no_motion_per_force(&ratio) {
        notes.about(name, remark);
    }
    let per_force = match denominator.kind {
        EXCITATION_FORCE | REACTION_FORCE | 0 | 1 => true,
        _ => {
            notes.about(
                name,
                format!(
                    "the excitation is not a force but {:?}: quantity left open",
                    denominator.label
                ),
            );
            false
        }
    };
    let by_type = quantity_of_type(numerator.kind);
    let (by_unit, factor) = match label_unit {
        Some(unit) => unit_quantity(unit, denominator, file_units, name, notes),
        None => (
            None,
            factor_of_file(numerator, denominator, file_units, name, notes),
        ),
    };
    let by_label = quantity_of_words(&numerator.label);
    let votes = [("data type", by_type), ("unit", by_unit), ("label", by_label)];
    let mut said = votes.iter().filter_map(|(who, q)| q.map(|q| (*who, q)));
    let id_words = dataset.id_lines.iter().find_map(|l| quantity_of_words(l));
    if !per_force {
        return (None, factor);
    }
    let Some((_, first)) = said.next() else {
        return (id_words, factor);
    };
    if said.all(|(_, q)| q == first) {
        if let Some(words) = id_words.filter(|w| *w != first) {
            let [words, first] = [words, first].map(word);
            notes.about(
                name,
                format!("the heading speaks of {words}, data type and unit of {first}: read as {first}"),
            );
        }
        return (Some(first), factor);
    }
    let list: Vec<String> = votes
        .iter()
        .filter_map(|(who, q)| q.map(|q| format!("the {who} says {}", word(q))))
        .collect();
    notes.about(
        name,
        format!(
            "{} (label {:?}, unit {:?}): quantity left open, say it in campaign.toml",
            list.join(", "),
            numerator.label,
            numerator.unit
        ),
    );
    (None, factor)
}

fn word(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Receptance => "receptance",
        Quantity::Mobility => "mobility",
        Quantity::Accelerance => "accelerance",
    }
}

/// Quantity and factor by the unit labels of numerator and denominator.
fn unit_quantity(
    unit: Unit,
    denominator: &UnitAxis,
    file_units: Option<FileUnits>,
    name: &str,
    notes: &mut Notes,
) -> (Option<Quantity>, f64) {
    let (quantity, factor) = if let Some(quantity) = unit.dimension.frf() {
        // The label is the whole ratio: `(m/s)/N`.
        (Some(quantity), unit.factor)
    } else {
        let force = match units::parse_named(&denominator.unit) {
            Some(force) if force.dimension == units::Dimension::FORCE => force.factor,
            Some(_) => return (None, unit.factor),
            None => file_units.map_or_else(
                || {
                    notes.about(name, "no unit of force given: N assumed");
                    1.0
                },
                |units| 1.0 / units.force,
            ),
        };
        (unit.dimension.motion(), unit.factor / force)
    };
    if (factor - 1.0).abs() > 1e-9 && quantity.is_some() {
        notes.about(
            name,
            format!(
                "converted to {}, factor {factor:.6}",
                quantity.map_or("SI", units::frf_unit)
            ),
        );
    }
    if let (Some(units), Some(_)) = (file_units, quantity) {
        let by_file = units.force / units.length;
        if !units.is_si() && (by_file / factor - 1.0).abs() > 1e-3 {
            notes.about(
                name,
                "the unit label and dataset 164 (units of the file) disagree: the label is taken",
            );
        }
    }
    (quantity, factor)
}

/// Factor where the ordinate has no unit label: by dataset 164, else none.
fn factor_of_file(
    numerator: &UnitAxis,
    denominator: &UnitAxis,
    file_units: Option<FileUnits>,
    name: &str,
    notes: &mut Notes,
) -> f64 {
    if !units::is_blank(&numerator.unit) {
        // Not understood; said already.
        return 1.0;
    }
    let Some(units) = file_units else {
        notes.about(name, "no units given: SI assumed");
        return 1.0;
    };
    if quantity_of_type(numerator.kind).is_none() {
        if !units.is_si() {
            notes.about(
                name,
                "data type and unit unknown: dataset 164 (units of the file) not applied",
            );
        }
        return 1.0;
    }
    let force = units::parse_named(&denominator.unit).filter(|u| u.dimension == units::Dimension::FORCE);
    let factor = 1.0 / units.length / force.map_or(1.0 / units.force, |f| f.factor);
    if (factor - 1.0).abs() > 1e-6 {
        notes.about(
            name,
            format!("no unit label: converted to SI by dataset 164, factor {factor:.6}"),
        );
    }
    factor
}

/// One time response: joins the record that has the same time axis, or starts one.
fn time(
    dataset: &Dataset58,
    file_units: Option<FileUnits>,
    contents: &mut Contents,
    notes: &mut Notes,
) -> Result<(), InputError> {
    let name = dataset.title();
    let Ordinate::Real(values) = &dataset.ordinate else {
        notes.about(
            &name,
            "time signal of complex numbers: kept as it stands, not used",
        );
        contents.others.push(other(dataset));
        return Ok(());
    };
    let seconds = units::parse(&dataset.axes[0].unit).filter(|u| u.dimension == units::Dimension::TIME);
    let seconds = seconds.map_or(1.0, |u| u.factor);
    let times_s: Vec<f64> = dataset.abscissa_values().iter().map(|t| t * seconds).collect();
    let stamps = match times_s.iter().all(|t| t.is_finite()) {
        true => clock::look(&times_s, clock::six_digits(&times_s)),
        false => Err("times that are not numbers".into()),
    };
    let (grid, values) = match stamps {
        Ok(Stamps::Even(grid)) => (grid, values.clone()),
        Ok(Stamps::Uneven(grid, told)) => {
            notes.about(&name, told);
            (grid, clock::resample(&times_s, values, grid))
        }
        Err(problem) => {
            notes.about(
                &name,
                format!("time signal without uniform sampling ({problem}): kept as it stands, not used"),
            );
            contents.others.push(other(dataset));
            return Ok(());
        }
    };
    let step = 1.0 / grid.rate_hz;
    let axis = &dataset.axes[1];
    let unit = units::parse_named(&axis.unit);
    let factor = match (unit, file_units) {
        (Some(unit), _) => unit.factor,
        (None, Some(units)) if units::is_blank(&axis.unit) => match axis.kind {
            DISPLACEMENT | VELOCITY | ACCELERATION => 1.0 / units.length,
            EXCITATION_FORCE | REACTION_FORCE => 1.0 / units.force,
            _ => 1.0,
        },
        _ => {
            notes.about(&name, "unit unknown: values as they stand in the file");
            1.0
        }
    };
    let samples: Vec<f64> = values.iter().map(|v| v * factor).collect();
    if samples.iter().any(|v| !v.is_finite()) {
        notes.about(&name, "time signal with values that are not numbers: left out");
        return Ok(());
    }
    checks::plausible_samples(&name, &samples)?;
    checks::plausible_clock(&name, grid.rate_hz, grid.start_s)?;
    let by_direction = match (axis.kind, dataset.response.direction) {
        (EXCITATION_FORCE | REACTION_FORCE, 1) => Some(ChannelRole::ForceX),
        (EXCITATION_FORCE | REACTION_FORCE, 2) => Some(ChannelRole::ForceY),
        (EXCITATION_FORCE | REACTION_FORCE, 3) => Some(ChannelRole::ForceZ),
        _ => None,
    };
    let channel_name = if units::is_blank(&axis.label) {
        name.clone()
    } else {
        axis.label.clone()
    };
    let channel = Channel {
        role: by_direction.unwrap_or_else(|| role_of(&channel_name, unit)),
        name: channel_name,
        file_unit: axis.unit.clone(),
        samples,
    };
    let start_s = grid.start_s;
    let same = |record: &&mut TimeRecord| {
        record.len() == channel.samples.len()
            && (record.sample_rate_hz * step - 1.0).abs() < 1e-5
            && (record.start_s - start_s).abs() < 0.01 * step
    };
    match contents.times.iter_mut().find(same) {
        Some(record) => record.channels.push(channel),
        None => {
            contents.times.push(TimeRecord {
                filled: Vec::new(),
                sample_rate_hz: rate_of_printed_step(step),
                start_s,
                channels: vec![channel],
            });
        }
    }
    Ok(())
}

/// Sampling rate of a step printed with six digits (`E13.5`): the whole number of hertz where the rounding hides one.
fn rate_of_printed_step(step: f64) -> f64 {
    let rate = 1.0 / step;
    let mantissa = step / 10_f64.powf(step.log10().floor());
    let slack = 5.01e-6 / mantissa.clamp(1.0, 10.0);
    if rate >= 1.0 && (rate.round() / rate - 1.0).abs() <= slack {
        rate.round()
    } else {
        rate
    }
}

/// Gives a coherence to the FRF between the same degrees of freedom on the same lines.
fn attach_coherence(dataset: Dataset58, contents: &mut Contents, notes: &mut Notes) {
    let name = dataset.title();
    let values: Vec<f64> = complex(&dataset.ordinate).iter().map(|v| v.re).collect();
    let frequency = dataset.abscissa_values();
    let (response, reference) = (dof(&dataset.response, notes), dof(&dataset.reference, notes));
    let partner = contents.frfs.iter_mut().find(|frf| {
        let same_dofs = match (frf.response, frf.reference) {
            (Some(a), Some(b)) => Some(a) == response && Some(b) == reference,
            _ => frf.name == name,
        };
        same_dofs && frf.coherence.is_none()
    });
    match partner {
        Some(frf) => match checks::on_lines(&frf.frequency_hz, &frequency, &values) {
            Some(coherence) => frf.coherence = Some(coherence),
            None => {
                notes.about(
                    &name,
                    "the coherence is on other lines than its FRF, or outside 0..1: left out",
                );
                contents.others.push(other(&dataset));
            }
        },
        None => contents.others.push(other(&dataset)),
    }
}
