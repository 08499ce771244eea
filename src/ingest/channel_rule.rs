//! How channels of a recorder become forces, where the file does not say it all: columns without names, volts, charge, a gain
//! that only the amplifier knows, several cuts in one file.

use std::path::Path;

use super::contents::{Contents, Digest, Format, MeasurementFile, TimeFile};
use super::decode::read_bytes_at;
use super::long::{self, ForceFile, Opened};
use super::read::{self, no_such, read_file};
use super::text::{Notes, is_binary, without_byte_order_mark};
use super::units::{self, Dimension, Unit};
use crate::data::{Channel, ChannelRole, TimeRecord};
use crate::files::regular_file;
use crate::ingest::formats::force;
use crate::ingest::tables::table::Header;
use crate::{Error, InputError, Result};

/// What a channel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measures {
    /// The time of the samples.
    Time,
    /// A force, or the torque about z, by its role.
    Force(ChannelRole),
}

/// Where a channel stands in its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// By its name, case ignored.
    Name(String),
    /// By its place from 1, time included, in a table of text.
    Column(usize),
}

/// What a value is to be multiplied with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gain {
    /// The values are forces already.
    None,
    /// N (N·m) for one of the unit that the values are in.
    PerUnit(f64),
    /// N (N·m) for one volt, coulomb (counts as a volt) or ampere, and the gain's electrical unit: that of the values where nobody
    /// says it.
    PerElectric(f64, Unit),
}

/// One channel.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelRule {
    /// What the channel is.
    pub measures: Measures,
    /// Where it stands in its file.
    pub source: Source,
    /// Of the values in the file, where the file does not say it.
    pub unit: Option<Unit>,
    /// From the values to newtons, or N·m for the torque.
    pub gain: Gain,
    /// Value at no force, in the unit of the file; taken off first.
    pub offset: f64,
    /// The force counts in the other sense: it is multiplied by −1.
    pub is_reversed: bool,
    /// Sampling rate of a file without a time column.
    pub rate_hz: Option<f64>,
}

impl Gain {
    /// `500 N/V`, `2 kN/V`, `-3.85 pC/N`, `10 mV/N`, `350 N/A`; a moment likewise.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> std::result::Result<Gain, String> {
        let text = text.trim();
        let split = text
            .find(|c: char| !(c.is_ascii_digit() || "+-.,eE".contains(c)))
            .unwrap_or(text.len());
        let (number, label) = text.split_at(split);
        let value = number.trim().replace(',', ".").parse::<f64>();
        let value = value.ok().filter(|v| v.is_finite() && *v != 0.0);
        let (Some(value), Some(unit)) = (value, units::unit_of_charge_or_other(label)) else {
            return Err(format!("{text:?} is no gain"));
        };
        let si = value * unit.factor;
        let (above, below) = label.split_once('/').unwrap_or((label, ""));
        let is_load = |u: Unit| [Dimension::FORCE, Dimension::MOMENT].contains(&u.dimension);
        let is_electric = |u: Unit| [Dimension::VOLTAGE, Dimension::CURRENT].contains(&u.dimension);
        if let (Some(above), Some(below)) = (
            units::unit_of_charge_or_other(above),
            units::unit_of_charge_or_other(below),
        ) {
            if is_load(above) && is_electric(below) {
                return Ok(Gain::PerElectric(si, below));
            }
            if is_electric(above) && is_load(below) {
                return Ok(Gain::PerElectric(si.recip(), above));
            }
        }
        Err(format!(
            "{label:?} is no force per volt, charge or ampere, nor the other way round"
        ))
    }
}

/// The time record of a file with its forces as `rules` have them. Without rules: [`super::read_time`].
///
/// # Errors
/// Those of [`super::read_time`]; a channel that is not there, or not in the unit that its rule needs.
pub fn read_time_with(path: &Path, rules: &[ChannelRule]) -> Result<TimeFile> {
    with_rules(path, rules, read_file(path))
}

/// As [`read_time_with`], for the forces alone; those of a long file in half the memory.
///
/// # Errors
/// As [`read_time_with`].
pub fn read_forces_with(path: &Path, rules: &[ChannelRule]) -> Result<ForceFile> {
    let named = |header: Header| named_by(path, rules, header).ok();
    let file = match long::open_named(path, &named) {
        Ok(Opened::Long(long)) => {
            let is_of_time = |rule: &ChannelRule| rule.rate_hz.is_some() || rule.measures == Measures::Time;
            // Whose times count is looked at with all of them at hand.
            if !long.is_named && rules.iter().any(is_of_time) {
                return with_rules(path, rules, long.whole()).map(ForceFile::Short);
            }
            let mut told = Vec::new();
            let mut file = long.forces(|mut piece| {
                if !rules.is_empty() {
                    let (record, warnings) = forces_by(path, rules, vec![piece])?;
                    piece = record;
                    told = warnings;
                }
                piece.keep_forces();
                Ok(piece)
            })?;
            match &mut file {
                ForceFile::Short(file) => file.warnings.extend(told),
                ForceFile::Long(file) => file.warnings.extend(told),
            }
            return Ok(file);
        }
        Ok(Opened::Read(file)) => Ok(file),
        Err(error) => Err(error),
    };
    let mut file = with_rules(path, rules, file)?;
    file.record.keep_forces();
    Ok(ForceFile::Short(file))
}

/// `file`: as it was read from `path`, or why it was not.
fn with_rules(path: &Path, rules: &[ChannelRule], file: Result<MeasurementFile>) -> Result<TimeFile> {
    if rules.is_empty() {
        return read::one_time_record(path, file?);
    }
    let (mut times, mut warnings, digest) = match file {
        Ok(file) if !file.contents.times.is_empty() => (file.contents.times, file.warnings, file.digest),
        other => {
            match with_rate(path, rules)?
                .map_or_else(|| plain_table(path, rules), |(_, found)| Ok(Some(found)))?
            {
                Some(found) => found,
                None => match other {
                    Ok(file) => {
                        return Err(no_such(&file, "time signal", "give a file with force signals"));
                    }
                    Err(error) => return Err(error),
                },
            }
        }
    };
    warnings.extend(stated_rate(path, rules, &mut times)?);
    let (record, told) = forces_by(path, rules, times)?;
    warnings.extend(told);
    Ok(TimeFile {
        record,
        warnings,
        digest,
    })
}

/// That of the records which holds all channels that the rules name, its forces as they have them; and what was assumed.
fn forces_by(
    path: &Path,
    rules: &[ChannelRule],
    times: Vec<TimeRecord>,
) -> Result<(TimeRecord, Vec<String>)> {
    let forces: Vec<&ChannelRule> = rules
        .iter()
        .filter(|r| matches!(r.measures, Measures::Force(_)))
        .collect();
    let all: Vec<String> = times
        .iter()
        .flat_map(|t| &t.channels)
        .map(|c| c.name.clone())
        .collect();
    let holds = |record: &TimeRecord| forces.iter().all(|rule| index(record, rule).is_some());
    let Some(mut record) = times.into_iter().find(holds) else {
        let missing = forces
            .iter()
            .map(|rule| source_text(&rule.source))
            .collect::<Vec<_>>();
        return Err(InputError::new(format!(
            "channels {} are not in it, or not of one time axis; it holds {}",
            missing.join(", "),
            super::text::shown(&all.join(", "))
        ))
        .file(path)
        .key("channel")
        .remedy("write the channel's name as the file has it after in_file, or its place after column")
        .into());
    };
    let told = apply(&mut record, &forces).map_err(|e| Error::from(e.file(path)))?;
    Ok((record, told))
}

/// As [`read_file`]; a table of text or a file of arrays that says neither times nor a rate was sampled at `rate_hz`, where that is known.
///
/// # Errors
/// Those of [`read_file`].
pub fn read_file_at(path: &Path, rate_hz: Option<f64>) -> Result<MeasurementFile> {
    let Some(rate_hz) = rate_hz else {
        return read_file(path);
    };
    let error = match read_file(path) {
        Ok(mut file) => {
            let own = file.contents.times.first().map(|t| t.sample_rate_hz);
            if let Some(own) = own.filter(|own| (own / rate_hz - 1.0).abs() > 1e-3) {
                let own = units::figures(own, 6);
                file.warnings.push(format!(
                    "the file itself says {own} Hz: that is taken, not the {rate_hz} Hz asked for"
                ));
            }
            return Ok(file);
        }
        Err(error) => error,
    };
    let only_rate = [ChannelRule {
        measures: Measures::Force(ChannelRole::Other),
        source: Source::Column(1),
        unit: None,
        gain: Gain::None,
        offset: 0.0,
        is_reversed: false,
        rate_hz: Some(rate_hz),
    }];
    let (format, found) = match with_rate(path, &only_rate)? {
        Some((format, found)) => (format, Some(found)),
        None => (Format::TimeCsv, plain_table(path, &only_rate)?),
    };
    let (times, warnings, digest) = found.ok_or(error)?;
    Ok(MeasurementFile {
        path: path.to_owned(),
        format,
        why: "signals without times, and a sampling rate that was given".into(),
        contents: Contents {
            times,
            ..Contents::default()
        },
        warnings,
        digest,
    })
}

/// Where a rule gives a rate that is not the file's, the rule counts, and it is told: a time column may count samples, or
/// milliseconds without saying so.
fn stated_rate(path: &Path, rules: &[ChannelRule], times: &mut Vec<TimeRecord>) -> Result<Option<String>> {
    /// Parts by which rates may differ.
    const ALIKE: f64 = 1e-3;
    let Some(rate) = rules.iter().find_map(|r| r.rate_hz) else {
        return Ok(None);
    };
    let differs = |record: &TimeRecord| (record.sample_rate_hz / rate - 1.0).abs() > ALIKE;
    if rules.iter().any(|r| r.measures == Measures::Time) || !times.iter().any(differs) {
        return Ok(None);
    }
    let own = times
        .iter()
        .find(|t| differs(t))
        .map_or(rate, |t| t.sample_rate_hz);
    match plain_table(path, rules)? {
        // Read again, for uneven times may have moved the samples.
        Some((again, _, _)) => *times = again,
        None => {
            for record in times.iter_mut() {
                (record.sample_rate_hz, record.start_s) = (rate, 0.0);
            }
        }
    }
    Ok(Some(format!(
        "the file's own times give {} Hz, the campaign's [[channel]] {rate} Hz: that of the campaign is taken, time from 0 s",
        units::figures(own, 6)
    )))
}

fn source_text(source: &Source) -> String {
    match source {
        Source::Name(name) => format!("{:?}", super::text::shown(name)),
        Source::Column(at) => format!("column {at}"),
    }
}

fn index(record: &TimeRecord, rule: &ChannelRule) -> Option<usize> {
    let wanted = match &rule.source {
        Source::Name(name) => name.trim().to_lowercase(),
        Source::Column(at) => format!("column {at}"),
    };
    let own = |name: &str| name.trim().to_lowercase() == wanted;
    record.channels.iter().position(|c| own(&c.name))
}

/// Makes forces of the channels; gives what was assumed.
fn apply(record: &mut TimeRecord, rules: &[&ChannelRule]) -> std::result::Result<Vec<String>, InputError> {
    let mut notes = Notes::default();
    let places: Vec<usize> = rules.iter().filter_map(|rule| index(record, rule)).collect();
    // What the file's names say of these forces no longer counts.
    let given: Vec<Measures> = rules.iter().map(|r| r.measures).collect();
    for channel in &mut record.channels {
        if given.contains(&Measures::Force(channel.role)) {
            channel.role = ChannelRole::Other;
        }
    }
    for (rule, at) in rules.iter().zip(places) {
        let channel = &mut record.channels[at];
        let Measures::Force(role) = rule.measures else {
            continue;
        };
        // Readers turn what they understand into SI already.
        let said = units::parse(&channel.file_unit);
        let of_gain = match rule.gain {
            Gain::PerElectric(_, unit) => Some(unit),
            _ => None,
        };
        let unit = rule.unit.or(said).or(of_gain);
        let refuse = |problem: String, remedy: &str| {
            InputError::new(format!(
                "channel {:?}: {problem}",
                super::text::shown(&channel.name)
            ))
            .key("channel")
            .remedy(remedy)
        };
        if let (Some(said), Some(ours)) = (said, rule.unit)
            && said.dimension != ours.dimension
        {
            let problem = format!("the file says {:?}, the campaign another unit", channel.file_unit);
            return Err(refuse(problem, "leave `unit` out, or correct it"));
        }
        let expected = match role {
            ChannelRole::TorqueZ => Dimension::MOMENT,
            _ => Dimension::FORCE,
        };
        let factor = unit.map_or(1.0, |u| u.factor);
        let gain = match rule.gain {
            Gain::None => {
                match unit {
                    None => {
                        let assumed = if role == ChannelRole::TorqueZ { "N·m" } else { "N" };
                        notes.about(
                        &channel.name,
                        format!("neither the file nor its [[channel]] gives a unit or a gain: {assumed} assumed"),
                    );
                        1.0
                    }
                    Some(unit) if unit.dimension != expected => {
                        let remedy = "give the amplifier's: gain = \"500 N/V\" or gain = \"-3.9 pC/N\"";
                        return Err(refuse("its values are no forces and have no gain".into(), remedy));
                    }
                    _ => 1.0,
                }
            }
            Gain::PerUnit(gain) => gain / factor,
            Gain::PerElectric(gain, electric) => match unit {
                Some(unit) if unit.dimension == electric.dimension => gain,
                _ => {
                    let remedy =
                        "give a gain for the unit the values are in, or leave it out where they are forces";
                    let of_gain = match electric.dimension {
                        Dimension::CURRENT => "amperes",
                        _ => "volts or charge",
                    };
                    return Err(refuse(
                        format!("its gain is for {of_gain}, its values are not"),
                        remedy,
                    ));
                }
            },
        };
        if let (Some(said), Some(ours), Gain::None) = (said, rule.unit, &rule.gain)
            && (ours.factor / said.factor - 1.0).abs() > 1e-9
        {
            notes.about(
                &channel.name,
                format!(
                    "the file says {:?}, and that counts, not the unit of its [[channel]]: where the file is wrong, give gain_n_per_unit",
                    channel.file_unit
                ),
            );
        }
        let to_si = if said.is_some() { 1.0 } else { factor };
        let sign = if rule.is_reversed { -1.0 } else { 1.0 };
        for value in &mut channel.samples {
            *value = sign * gain * (*value * to_si - rule.offset * factor);
        }
        channel.role = role;
        channel.file_unit = if expected == Dimension::MOMENT {
            "N·m"
        } else {
            "N"
        }
        .to_string();
    }
    // Of forces that a rule names twice the last one counts; checked where rules are made.
    Ok(notes.into_warnings())
}

/// Records, warnings, and what identifies the file.
type PlainTable = (Vec<TimeRecord>, Vec<String>, Digest);

/// A binary file that holds signals and no rate, with the rate that a rule gives.
fn with_rate(path: &Path, rules: &[ChannelRule]) -> Result<Option<(Format, PlainTable)>> {
    let Some(rate) = rules.iter().find_map(|r| r.rate_hz) else {
        return Ok(None);
    };
    regular_file(path)?;
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    if !is_binary(&bytes) {
        return Ok(None);
    }
    let mut notes = Notes::default();
    let (format, _, contents) =
        read_bytes_at(&bytes, false, Some(rate), &mut notes).map_err(|e| Error::from(e.file(path)))?;
    if contents.times.is_empty() {
        return Ok(None);
    }
    let found = (contents.times, notes.into_warnings(), Digest::of(&bytes));
    Ok(Some((format, found)))
}

/// What a force is (`fx`), and how its channel is called.
pub type NamedForce = (&'static str, String);

/// Forces of one cut, told by their names: what the channels have in common in them (`R_1`; empty in a file of one cut), and the
/// channels.
pub type NamedCut = (String, Vec<NamedForce>);

/// What is in a file that says neither times nor a sampling rate; nothing where it holds no forces, or says its times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timeless {
    /// The forces, as those of one cut.
    pub forces: Vec<NamedForce>,
    /// The cuts, told apart by what stands beside Fx, Fy, Fz, Mz in the names of the channels (`Fx_R_1`, `Fy_R_1`: `R_1`).
    pub cuts: Vec<NamedCut>,
    /// There are times, and they are of no use (not rising, not even).
    pub useless_times: bool,
}

/// Looks for forces in a file that says neither times nor a sampling rate.
///
/// # Errors
/// The operating system's.
pub fn timeless(path: &Path) -> Result<Timeless> {
    let (records, useless_times) = timeless_records(path)?;
    Ok(Timeless {
        useless_times,
        forces: forces_of(&records),
        cuts: cuts_of(&records),
    })
}

/// What of the first record's channels are forces.
pub fn forces_of(records: &[TimeRecord]) -> Vec<NamedForce> {
    let of = |channel: &Channel| {
        let what = match channel.role {
            ChannelRole::ForceX => "fx",
            ChannelRole::ForceY => "fy",
            ChannelRole::ForceZ => "fz",
            ChannelRole::TorqueZ => "mz",
            ChannelRole::Other => return None,
        };
        Some((what, channel.name.clone()))
    };
    let first = records.first();
    first.map_or_else(Vec::new, |record| record.channels.iter().filter_map(of).collect())
}

/// The cuts in a file whose channels are called by the cut as well (`Fx_R_1`, `Fx_R_2`); one where each force stands there once.
pub fn cuts_of(records: &[TimeRecord]) -> Vec<NamedCut> {
    let named = |channel: &Channel| -> Option<(&'static str, String, String)> {
        let name = channel.name.as_str();
        let lower = name.to_ascii_lowercase();
        let mut all = ["fx", "fy", "fz", "mz"].into_iter();
        let (what, at) = all.find_map(|what| Some((what, lower.find(what)?)))?;
        let beside = format!("{}{}", &name[..at], &name[at + 2..]);
        let id = beside.trim_matches(|c: char| !c.is_alphanumeric());
        Some((what, name.to_string(), id.to_string()))
    };
    let found: Vec<_> = records
        .iter()
        .flat_map(|r| &r.channels)
        .filter_map(named)
        .collect();
    let is_one_cut = found
        .iter()
        .all(|(what, ..)| found.iter().filter(|(other, ..)| what == other).count() == 1);
    // Units and the like stand beside the names of one cut, too.
    if is_one_cut {
        let own = forces_of(records);
        let some = (!own.is_empty()).then(|| (String::new(), own));
        return some.into_iter().collect();
    }
    let mut cuts: Vec<NamedCut> = Vec::new();
    for (what, name, id) in found {
        let place = cuts
            .iter()
            .position(|(known, _)| *known == id)
            .unwrap_or_else(|| {
                cuts.push((id, Vec::new()));
                cuts.len() - 1
            });
        let own = &mut cuts[place].1;
        if own.iter().all(|(known, _)| *known != what) {
            own.push((what, name));
        }
    }
    // A force without another beside it is no dynamometer's record.
    cuts.retain(|(_, channels)| channels.len() > 1);
    cuts
}

/// The records of a file that says neither times nor a sampling rate, at any rate, and whether it has times of no use; empty where
/// it says its times.
fn timeless_records(path: &Path) -> Result<(Vec<TimeRecord>, bool)> {
    /// Any will do.
    const RATE_HZ: f64 = 1000.0;
    /// A shorter table is a list of results.
    const SHORTEST: usize = 500;
    regular_file(path)?;
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let mut notes = Notes::default();
    if read_bytes_at(&bytes, false, None, &mut notes).is_ok() {
        return Ok((Vec::new(), false));
    }
    let mut useless_times = false;
    let times = if is_binary(&bytes) {
        read_bytes_at(&bytes, false, Some(RATE_HZ), &mut notes).map(|(_, _, contents)| contents.times)
    } else {
        let text = &*without_byte_order_mark(&bytes);
        match Header::find(text).filter(|header| !header.names.is_empty()) {
            Some(mut header) => {
                useless_times = header.without_time();
                header.lines.push(format!("Sampling rate [Hz]:,{RATE_HZ}"));
                force::read(text, &header, &mut notes).map(|record| vec![record])
            }
            None => return Ok((Vec::new(), false)),
        }
    };
    let mut records = times.unwrap_or_default();
    records.retain(|record| record.len() >= SHORTEST);
    Ok((records, useless_times))
}

/// A table of text that has no names, or no time: columns are named as the rules name them.
fn plain_table(path: &Path, rules: &[ChannelRule]) -> Result<Option<PlainTable>> {
    regular_file(path)?;
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
    let digest = Digest::of(&bytes);
    let bytes = &*without_byte_order_mark(&bytes);
    if is_binary(bytes) {
        return Ok(None);
    }
    let Some(header) = Header::find(bytes) else {
        return Ok(None);
    };
    let header = named_by(path, rules, header)?;
    let mut notes = Notes::default();
    let record = force::read(bytes, &header, &mut notes).map_err(|e| Error::from(e.file(path)))?;
    Ok(Some((vec![record], notes.into_warnings(), digest)))
}

/// The header with the names, the time and the rate that the rules give.
fn named_by(path: &Path, rules: &[ChannelRule], mut header: Header) -> Result<Header> {
    if header.names.is_empty() {
        header.names = (1..=header.columns).map(|i| format!("column {i}")).collect();
    }
    // By its place a column is found whatever it is called.
    for rule in rules {
        if let Source::Column(at) = rule.source
            && let Some(name) = at.checked_sub(1).and_then(|at| header.names.get_mut(at))
        {
            *name = format!("column {at}");
        }
    }
    for rule in rules.iter().filter(|r| r.measures == Measures::Time) {
        let at = match &rule.source {
            Source::Column(at) => at.checked_sub(1).filter(|at| *at < header.columns),
            Source::Name(name) => header.names.iter().position(|n| n.eq_ignore_ascii_case(name)),
        };
        let Some(at) = at else {
            return Err(
                InputError::new(format!("{} is not in it", source_text(&rule.source)))
                    .file(path)
                    .key("channel")
                    .remedy(format!("it has {} columns", header.columns))
                    .into(),
            );
        };
        let factor = rule.unit.map_or(1.0, |u| u.factor);
        let unit = [(1.0, "s"), (1e-3, "ms"), (1e-6, "us")]
            .into_iter()
            .find(|(f, _)| (f / factor - 1.0).abs() < 1e-9);
        header.names[at] = format!("time [{}]", unit.map_or("s", |u| u.1));
    }
    if let Some(rate) = rules.iter().find_map(|r| r.rate_hz) {
        if rules.iter().all(|r| r.measures != Measures::Time) {
            // A time column that is there and cannot be used: the rate counts.
            header.without_time();
        }
        header.lines.push(format!("Sampling rate [Hz]:,{rate}"));
    }
    if !force::is_time_table(&header) {
        return Err(InputError::new("no time column and no sampling rate")
            .file(path)
            .key("channel")
            .remedy(
                "give rate_hz = 10000.0 in a [[channel]], or a [[channel]] with name = \"time\" and its column",
            )
            .into());
    }
    Ok(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(role: ChannelRole, source: Source) -> ChannelRule {
        ChannelRule {
            measures: Measures::Force(role),
            source,
            unit: None,
            gain: Gain::None,
            offset: 0.0,
            is_reversed: false,
            rate_hz: None,
        }
    }

    fn read(text: &str, rules: &[ChannelRule]) -> Result<TimeRecord> {
        read_and_told(text, rules).map(|r| r.0)
    }

    fn read_and_told(text: &str, rules: &[ChannelRule]) -> Result<(TimeRecord, Vec<String>)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("r.txt");
        std::fs::write(&path, text).unwrap();
        read_time_with(&path, rules).map(|r| (r.record, r.warnings))
    }

    #[test]
    fn gains_are_forces_per_volt_or_sensitivities() {
        let value = |text: &str| match Gain::parse(text).unwrap() {
            Gain::PerElectric(value, _) => value,
            other => panic!("{other:?}"),
        };
        assert!((value("500 N/V") - 500.0).abs() < 1e-9);
        assert!((value("2 kN/V") - 2000.0).abs() < 1e-9);
        assert!((value("10 mV/N") - 100.0).abs() < 1e-9);
        assert!((value("-3.85 pC/N") / (-1.0 / 3.85e-12) - 1.0).abs() < 1e-12);
        assert!((value("2 N·m/V") - 2.0).abs() < 1e-9);
        assert!((value("350 N/A") - 350.0).abs() < 1e-9);
        assert!((value("0.4 Nm/A") - 0.4).abs() < 1e-9);
        assert!((value("20 mA/kN") - 50e3).abs() < 1e-6);
        for text in ["N/V", "500", "500 N", "0 N/V", "5 m/V", "3 V/A"] {
            assert!(Gain::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn columns_without_names_become_forces() {
        let rows: String = (0..20)
            .map(|i| format!("{} {} 7\n", 0.1 + 0.001 * i as f64, -0.2))
            .collect();
        let mut x = rule(ChannelRole::ForceX, Source::Column(1));
        x.unit = units::parse("V");
        x.gain = Gain::parse("500 N/V").unwrap();
        x.offset = 0.1;
        x.rate_hz = Some(2000.0);
        let mut z = rule(ChannelRole::ForceZ, Source::Column(2));
        z.unit = units::parse("kN");
        z.is_reversed = true;
        let record = read(&rows, &[x.clone(), z.clone()]).unwrap();
        assert_eq!(record.sample_rate_hz, 2000.0);
        let of = |role| record.channel(role).unwrap().samples[10];
        assert!((of(ChannelRole::ForceX) - 5.0).abs() < 1e-9);
        assert!((of(ChannelRole::ForceZ) - 200.0).abs() < 1e-9);
        x.unit = None;
        x.offset = 0.0;
        x.gain = Gain::parse("10 pC/N").unwrap();
        let in_pc = read(&rows, &[x.clone()]).unwrap();
        assert!((in_pc.channel(ChannelRole::ForceX).unwrap().samples[10] - 0.011).abs() < 1e-12);
        (x.unit, x.offset, x.gain) = (units::parse("V"), 0.1, Gain::None);
        assert!(
            read(&rows, &[x.clone()])
                .unwrap_err()
                .to_string()
                .contains("no gain")
        );
        x.gain = Gain::PerUnit(250.0);
        let record = read(&rows, &[x.clone()]).unwrap();
        assert!((record.channel(ChannelRole::ForceX).unwrap().samples[10] - 2.5).abs() < 1e-9);
        x.rate_hz = None;
        assert!(read(&rows, &[x]).unwrap_err().to_string().contains("rate_hz"));
        z.source = Source::Column(9);
        z.rate_hz = Some(1.0);
        assert!(read(&rows, &[z]).unwrap_err().to_string().contains("column 9"));
    }

    #[test]
    fn named_channels_are_taken_by_name_and_units_must_agree() {
        let rows: String = (0..20)
            .map(|i| format!("{},{},5\n", 0.001 * i as f64, i))
            .collect();
        let text = format!("time_s,Fx_R_1 [mV],Fx_R_2 [mV]\n{rows}");
        let mut x = rule(ChannelRole::ForceX, Source::Name("fx_r_2 [mv]".into()));
        x.gain = Gain::parse("100 N/V").unwrap();
        let record = read(&text, &[x.clone()]).unwrap();
        assert!((record.channel(ChannelRole::ForceX).unwrap().samples[3] - 0.5).abs() < 1e-12);
        x.unit = units::parse("N");
        assert!(
            read(&text, &[x])
                .unwrap_err()
                .to_string()
                .contains("another unit")
        );
        // Of one dimension the file's counts, and it is told.
        let text = text.replace("Fx_R_1 [mV],Fx_R_2 [mV]", "Fx [N],Fy [N]");
        let mut x = rule(ChannelRole::ForceX, Source::Name("fx [n]".into()));
        x.unit = units::parse("kN");
        let (record, told) = read_and_told(&text, &[x.clone()]).unwrap();
        assert_eq!(record.channel(ChannelRole::ForceX).unwrap().samples[3], 3.0);
        assert!(told.join(" ").contains("gain_n_per_unit"), "{told:?}");
        (x.unit, x.gain) = (None, Gain::PerUnit(1000.0));
        let (record, told) = read_and_told(&text, &[x]).unwrap();
        assert_eq!(record.channel(ChannelRole::ForceX).unwrap().samples[3], 3000.0);
        assert!(!told.join(" ").contains("gain_n_per_unit"), "{told:?}");
    }

    #[test]
    fn a_rate_makes_a_record_of_a_file_without_times_or_with_useless_ones() {
        let rows: String = (0..600)
            .map(|i| format!("{},{},{}\n", 2048 + i, 20480 - i, i / 7))
            .collect();
        let text = format!("Torque,Thrust,Time\n{rows}");
        let mut z = rule(ChannelRole::ForceZ, Source::Name("Thrust".into()));
        (z.gain, z.offset) = (Gain::PerUnit(2.5), 20480.0);
        // Counted in units that nobody names: seven rows each.
        assert_eq!(read(&text, &[z.clone()]).unwrap().sample_rate_hz.round(), 7.0);
        z.rate_hz = Some(10_000.0);
        let record = read(&text, &[z]).unwrap();
        assert_eq!(record.sample_rate_hz, 10_000.0);
        assert_eq!(record.channel(ChannelRole::ForceZ).unwrap().samples[4], -10.0);
        let rows: String = (0..600)
            .map(|i| format!("{},{},0\n", 2048 + i, 20480 - i))
            .collect();
        let useless = format!("Torque,Thrust,Time\n{rows}");
        assert!(
            read(
                &useless,
                &[rule(ChannelRole::ForceZ, Source::Name("Thrust".into()))]
            )
            .is_err()
        );
        let folder = tempfile::tempdir().unwrap();
        let forces = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            (timeless(&path).unwrap().forces, path)
        };
        let ramp: Vec<f64> = (0..600).map(f64::from).collect();
        let mat = crate::ingest::mat5_bytes(&[crate::ingest::MatArray::column("Fx", &ramp)]);
        let (found, path) = forces("a.mat", &mat);
        assert_eq!(found, [("fx", "Fx".to_owned())]);
        let mut x = rule(ChannelRole::ForceX, Source::Name("fx".into()));
        x.rate_hz = Some(500.0);
        assert_eq!(read_time_with(&path, &[x]).unwrap().record.sample_rate_hz, 500.0);
        let (found, path) = forces("b.csv", useless.as_bytes());
        assert_eq!(found.len(), 2);
        assert!(timeless(&path).unwrap().useless_times);
        assert!(forces("c.csv", b"time_s,fx\n0,1\n1,2\n2,3\n3,4\n").0.is_empty());
        assert!(forces("d.csv", b"1,2\n2,1\n3,3\n4,3\n").0.is_empty());
    }

    #[test]
    fn several_cuts_in_one_file_are_told_apart_by_the_names_of_their_channels() {
        let folder = tempfile::tempdir().unwrap();
        let ramp: Vec<f64> = (0..600).map(|i| f64::from(i % 7)).collect();
        let cuts = |names: &[&str]| {
            let path = folder.path().join("cuts.mat");
            let arrays: Vec<_> = names
                .iter()
                .map(|n| crate::ingest::MatArray::column(n, &ramp))
                .collect();
            std::fs::write(&path, crate::ingest::mat5_bytes(&arrays)).unwrap();
            timeless(&path).unwrap().cuts
        };
        let found = cuts(&["Fx_R_1", "Fy_R_1", "Fz_R_1", "Fx_R_2", "Fy_R_2"]);
        let of = |id: &str| found.iter().find(|(own, _)| own == id).map(|(_, c)| c.clone());
        assert_eq!(found.len(), 2);
        let second = [("fx", "Fx_R_2".to_owned()), ("fy", "Fy_R_2".to_owned())];
        assert_eq!(of("R_2").unwrap(), second);
        assert_eq!(of("R_1").unwrap().len(), 3);
        let one = cuts(&["Fx", "Fy", "Fz"]);
        assert_eq!((one.len(), one[0].0.as_str(), one[0].1.len()), (1, "", 3));
    }
}
