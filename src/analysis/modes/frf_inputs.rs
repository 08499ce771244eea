//! FRFs to analyse, out of FRF files and raw tap tests.

use std::f64::consts::TAU;
use std::path::Path;

use num_complex::Complex64;

use crate::analysis::modes::mode_set::FrfInput;
use crate::ingest::units::{self, Dimension};
use crate::ingest::{self, Channel, FrfRecord, Quantity, TimeRecord};
use crate::modal::{self, Hit, TapRecord, TapSettings};
use crate::{Error, InputError, Result};

/// How files are read that do not say all of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrfReading {
    /// What FRFs are where their file does not say.
    pub unsaid: Quantity,
    /// Where the other files all say the same, those that do not say are taken for that instead.
    pub unsaid_like_the_rest: bool,
    /// FRF files were measured with an exponential window e^(−decay t) on the responses (and the force): what it added to the damping
    /// is taken out. 1/s.
    pub added_decay_per_s: f64,
    /// How FRFs are made of the hits of a raw record.
    pub taps: TapSettings,
    /// Sampling rate of raw records that say neither times nor a rate, Hz.
    pub rate_hz: Option<f64>,
    /// The hammer's channel of raw records: its name, or its number among the channels from 1 on. Found where left out.
    pub hammer: Option<String>,
    /// What FRFs of sensors are that say no unit of motion; accelerance where left out.
    pub sensors: Option<Quantity>,
}

/// What reading says besides the FRFs.
#[derive(Debug, Default)]
pub(crate) struct Told {
    /// By file, of raw records.
    pub hits: Vec<(String, Vec<Hit>)>,
    /// What was assumed or left out.
    pub warnings: Vec<String>,
    /// What FRFs of the files say that they are.
    said: Vec<Quantity>,
    /// FRFs of files that do not say.
    unsaid: Vec<Unsaid>,
    /// Raw records without a good hit: they are left out, and told among the warnings.
    pub refused: Vec<Error>,
}

/// FRFs of a file that does not say what they are.
#[derive(Debug)]
struct Unsaid {
    file: String,
    /// Their names, as in [`FrfInput::name`].
    names: Vec<String>,
}

/// FRFs that were read as `reading.unsaid` for want of better, beside files that say what theirs are: made what those are, and told.
pub(crate) fn settle_unsaid(inputs: &mut [FrfInput], reading: &FrfReading, told: &mut Told) {
    let common = told
        .said
        .first()
        .copied()
        .filter(|first| reading.unsaid_like_the_rest && told.said.iter().all(|q| q == first));
    let (taken_as, why) = match common {
        Some(common) => (common, " as those of the other files"),
        None => (reading.unsaid, ""),
    };
    // Back to what the file has, and again.
    let order = order(Some(taken_as)) - order(Some(reading.unsaid));
    for unsaid in &told.unsaid {
        let theirs = |i: &&mut FrfInput| i.set == unsaid.file && unsaid.names.contains(&i.name);
        for input in inputs.iter_mut().filter(theirs).filter(|_| order != 0) {
            let decay = input.added_decay_per_s;
            for (f, v) in input.frequency_hz.iter().zip(&mut input.receptance_m_per_n) {
                *v /= Complex64::new(decay, TAU * f).powi(order);
            }
        }
        let its_frfs = match unsaid.names.len() {
            1 => "FRF is".to_string(),
            many => format!("{many} FRFs are"),
        };
        told.warnings.push(format!(
            "{}: the file does not say which motion per force its {its_frfs}; taken as {}{why} (another: --quantity)",
            unsaid.file,
            units::frf_unit(taken_as)
        ));
    }
}

/// FRFs of one file: as they stand there, or from the hits of a raw record (none where no hit is good).
pub(crate) fn read(path: &Path, reading: &FrfReading, told: &mut Told) -> Result<Vec<FrfInput>> {
    let set = path.display().to_string();
    let file = ingest::read_file_at(path, reading.rate_hz)?;
    told.warnings
        .extend(file.warnings.iter().map(|w| format!("{set}: {w}")));
    if !file.contents.frfs.is_empty() {
        let frfs = &file.contents.frfs;
        told.said.extend(frfs.iter().filter_map(|r| r.quantity));
        let of_none = frfs.iter().filter(|r| r.quantity.is_none());
        let names: Vec<String> = of_none.map(|r| r.name.clone()).collect();
        if !names.is_empty() {
            told.unsaid.push(Unsaid {
                file: set.clone(),
                names,
            });
        }
        return Ok(file
            .contents
            .frfs
            .into_iter()
            .map(|mut record| {
                record.quantity.get_or_insert(reading.unsaid);
                frf_input(&set, record, reading.added_decay_per_s)
            })
            .collect());
    }
    if file.contents.times.is_empty() {
        return Err(InputError::new(format!(
            "neither FRFs nor a raw tap test in this {} file, but {}",
            file.format,
            file.contents.describe()
        ))
        .file(path)
        .remedy("give a UFF 58 file or a CSV with FRFs, or a time record of hammer and sensors")
        .into());
    }
    let mut inputs = Vec::new();
    for alike in file.contents.times.chunk_by(TimeRecord::same_channels) {
        inputs.extend(from_segments(&set, path, alike, reading, told)?);
    }
    Ok(inputs)
}

/// FRFs of records with the same channels: of all hits together, unless they contradict each other (a hammer that goes
/// from point to point).
fn from_segments(
    set: &str,
    path: &Path,
    segments: &[TimeRecord],
    reading: &FrfReading,
    told: &mut Told,
) -> Result<Vec<FrfInput>> {
    let [first, others @ ..] = segments else {
        return Ok(Vec::new());
    };
    if others.is_empty() {
        return Ok(from_taps(set, path, first, reading, told)?.frfs);
    }
    let mut whole = first.clone();
    others.iter().for_each(|segment| whole.append(segment));
    let mut theirs = Told::default();
    let together = from_taps(set, path, &whole, reading, &mut theirs)?;
    if !together.contradictory {
        told.warnings.push(format!(
            "{set}: {} records with the same channels: their hits are averaged",
            segments.len()
        ));
        told.warnings.extend(theirs.warnings);
        told.hits.extend(theirs.hits);
        told.refused.extend(theirs.refused);
        return Ok(together.frfs);
    }
    told.warnings.push(format!(
        "{set}: {} records with the same channels, whose hits contradict each other (other points or directions, or noise \
         as large as the response): FRFs of each record alone",
        segments.len()
    ));
    let mut inputs = Vec::new();
    for (k, segment) in segments.iter().enumerate() {
        let alone = from_taps(set, path, segment, reading, told)?.frfs;
        inputs.extend(alone.into_iter().map(|input| FrfInput {
            name: format!("{} record {}", input.name, k + 1),
            ..input
        }));
    }
    Ok(inputs)
}

/// FRFs of a tap record, and whether its hits contradict each other.
struct FromTaps {
    frfs: Vec<FrfInput>,
    contradictory: bool,
}

fn frf_input(set: &str, record: FrfRecord, added_decay_per_s: f64) -> FrfInput {
    FrfInput {
        set: set.to_owned(),
        receptance_m_per_n: receptance(
            &record.frequency_hz,
            &record.value,
            record.quantity,
            added_decay_per_s,
        ),
        dofs: record
            .response
            .zip(record.reference)
            .map(|(a, b)| [a.to_string(), b.to_string()]),
        name: record.name,
        frequency_hz: record.frequency_hz,
        coherence: record.coherence,
        added_decay_per_s,
    }
}

/// Derivatives with respect to time that make the quantity of a displacement.
fn order(quantity: Option<Quantity>) -> i32 {
    quantity.map_or(0, |q| i32::from(q.derivatives()))
}

/// H = V/p = A/p², p = iω; under an exponential window e^(−at) the FRF is that at p = a + iω (the shift of the Laplace transform). The
/// 0 Hz line of a mobility or accelerance says nothing about receptance; without a window it comes out as not finite and the analysis
/// leaves it out anyway.
fn receptance(
    frequency_hz: &[f64],
    value: &[Complex64],
    quantity: Option<Quantity>,
    added_decay_per_s: f64,
) -> Vec<Complex64> {
    let order = order(quantity);
    if order == 0 {
        return value.to_vec();
    }
    let lines = frequency_hz.iter().zip(value);
    lines
        .map(|(f, v)| v / Complex64::new(added_decay_per_s, TAU * f).powi(order))
        .collect()
}

/// What a channel's unit measures, where it has one that is known.
fn dimension(channel: &Channel) -> Option<Dimension> {
    units::parse_named(&channel.file_unit).map(|u| u.dimension)
}

/// The hammer's channel: the one that was said, or the only one in newtons, or else the only one that is called so, or else the only one
/// that is no motion, if it is in volts, or else the only one of short pulses where the others ring on.
fn hammer<'a>(record: &'a TimeRecord, path: &Path, said: Option<&str>) -> Result<&'a Channel> {
    if let Some(said) = said {
        return said_hammer(record, path, said);
    }
    let by = |test: &dyn Fn(&Channel) -> bool| -> Vec<&'a Channel> {
        record.channels.iter().filter(|c| test(c)).collect()
    };
    let called = |c: &Channel| ingest::is_called_hammer(&c.name);
    let newtons = by(&|c| dimension(c) == Some(Dimension::FORCE));
    let likely = match newtons.len() {
        0 => by(&called),
        1 => newtons,
        _ => newtons.into_iter().filter(|c| called(c)).collect(),
    };
    if let [one] = likely.as_slice() {
        return Ok(one);
    }
    let is_motion = |c: &Channel| dimension(c).and_then(|d| d.motion()).is_some();
    let others = by(&|c| !is_motion(c));
    let in_volts =
        |c: &Channel| dimension(c) == Some(Dimension::VOLTAGE) && !ingest::is_called_marker(&c.name);
    if let [one] = others.as_slice()
        && record.channels.len() > 1
        && in_volts(one)
    {
        return Ok(one);
    }
    let samples: Vec<&[f64]> = record.channels.iter().map(|c| c.samples.as_slice()).collect();
    let pulsed = crate::signal::pulsed_channel(&samples).map(|k| &record.channels[k]);
    if let Some(one) = pulsed.filter(|c| !is_motion(c) && !ingest::is_called_marker(&c.name)) {
        return Ok(one);
    }
    Err(
        InputError::new(format!("a time record without exactly one hammer channel ({})", named(record)))
            .file(path)
            .remedy(
                "say which it is (`--hammer NAME`), give it the unit N, or call it force; cutting forces go to `lobestone cfc`, \
                 motion without any force (idling, cutting) to `lobestone modal --output-only`",
            )
            .into(),
    )
}

fn said_hammer<'a>(record: &'a TimeRecord, path: &Path, said: &str) -> Result<&'a Channel> {
    let channels = &record.channels;
    // `force [N]` is the force.
    let without_unit = |name: &str| {
        name.split(['[', '('])
            .next()
            .unwrap_or(name)
            .trim()
            .to_lowercase()
    };
    let by_name = channels
        .iter()
        .find(|c| c.name.eq_ignore_ascii_case(said))
        .or_else(|| {
            channels
                .iter()
                .find(|c| without_unit(&c.name) == said.to_lowercase())
        });
    let number = || channels.get(said.parse::<usize>().ok()?.checked_sub(1)?);
    by_name.or_else(number).ok_or_else(|| {
        InputError::new(format!("no channel is called {said} ({})", named(record)))
            .file(path)
            .remedy("give the name of the hammer's channel, or its number from 1 on: `--hammer 1`")
            .into()
    })
}

fn named(record: &TimeRecord) -> String {
    let names: Vec<&str> = record.channels.iter().map(|c| c.name.as_str()).collect();
    names.join(", ")
}

/// What each channel but the hammer's measures of the motion, as far as it does.
fn sensors<'a>(
    set: &str,
    record: &'a TimeRecord,
    hammer: &Channel,
    reading: &FrfReading,
    told: &mut Told,
) -> Vec<(&'a Channel, Quantity)> {
    let others = || record.channels.iter().filter(|c| !std::ptr::eq(*c, hammer));
    let motion = |c: &Channel| dimension(c).and_then(|d| d.motion());
    let blank = |c: &Channel| units::is_blank(&c.file_unit);
    let acceleration = |c: &Channel| blank(c) && ingest::is_called_acceleration(&c.name);
    // Where no channel says that it is one, those that may be are sensors: without a unit, or not calibrated.
    let silent = others().all(|c| motion(c).is_none() && !acceleration(c));
    let may_be = |c: &Channel| {
        silent && !ingest::is_called_marker(&c.name) && (blank(c) || dimension(c) == Some(Dimension::VOLTAGE))
    };
    let (mut sensors, mut assumed) = (Vec::new(), Vec::new());
    for c in others() {
        if let Some(quantity) = motion(c) {
            sensors.push((c, quantity));
        } else if acceleration(c) {
            sensors.push((c, Quantity::Accelerance));
            told.warnings.push(format!(
                "{set}: channel {} has no unit: taken for m/s² (another: name it {}_g)",
                c.name, c.name
            ));
        } else if may_be(c) {
            sensors.push((c, reading.sensors.unwrap_or(Quantity::Accelerance)));
            assumed.push(c);
        } else {
            told.warnings.push(format!(
                "{set}: channel {} ({}) is no displacement, velocity or acceleration: left out",
                c.name, c.file_unit
            ));
        }
    }
    if let Some(first) = assumed.first() {
        let names: Vec<String> = assumed.iter().map(|c| c.name.clone()).collect();
        let unit = match blank(first) {
            true => "no unit".to_owned(),
            false => format!("the unit {}", first.file_unit),
        };
        told.warnings.push(format!(
            "{set}: {} with {unit}: taken for {} as they stand (another: --quantity); frequencies and damping do not depend on the \
             sensitivity, the size of the FRFs and modal masses do",
            crate::text::listed(&names),
            motion_unit(reading.sensors.unwrap_or(Quantity::Accelerance))
        ));
    }
    sensors
}

fn motion_unit(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Receptance => "m",
        Quantity::Mobility => "m/s",
        Quantity::Accelerance => "m/s²",
    }
}

fn from_taps(
    set: &str,
    path: &Path,
    record: &TimeRecord,
    reading: &FrfReading,
    told: &mut Told,
) -> Result<FromTaps> {
    let hammer = hammer(record, path, reading.hammer.as_deref())?;
    let is_known = ingest::is_called_hammer(&hammer.name) || reading.hammer.is_some();
    if units::is_blank(&hammer.file_unit) {
        let what = match is_known {
            true => format!("the hammer's channel {} has no unit", hammer.name),
            false => format!(
                "{} is taken for the hammer, as the only channel of short pulses (another: --hammer); it has no unit",
                hammer.name
            ),
        };
        told.warnings.push(format!("{set}: {what}: taken for newtons"));
    } else if dimension(hammer) != Some(Dimension::FORCE) {
        told.warnings.push(format!(
            "{set}: {} is taken for the hammer; it counts in {}, not in newtons: frequencies and damping do not depend on it, the size of the \
             FRFs and modal masses do (with the hammer's sensitivity: give the values in N)",
            hammer.name, hammer.file_unit
        ));
    }
    let sensors = sensors(set, record, hammer, reading, told);
    if sensors.is_empty() {
        let others: Vec<&str> = record
            .channels
            .iter()
            .filter(|c| !std::ptr::eq(*c, hammer))
            .map(|c| c.name.as_str())
            .collect();
        return Err(InputError::new(format!(
            "a tap record without a response channel (hammer {}, others: {})",
            hammer.name,
            if others.is_empty() { "none".into() } else { others.join(", ") }
        ))
        .file(path)
        .remedy(
            "give the sensors' channels a unit, where the file has no place for it at the end of their name: acc_m_per_s2, acc_g, \
             \"Acc [m/s²]\", vel_m_per_s, disp_um",
        )
        .into());
    }
    let responses: Vec<&[f64]> = sensors.iter().map(|(c, _)| c.samples.as_slice()).collect();
    let tap = TapRecord {
        sample_rate_hz: record.sample_rate_hz,
        force_n: &hammer.samples,
        responses: &responses,
    };
    let found = match modal::impact_test(&tap, &reading.taps) {
        Ok(found) => found,
        Err(Error::Input(why)) => {
            told.warnings.push(format!("{set}: left out: {}", why.problem));
            told.refused.push((*why).file(path).into());
            return Ok(FromTaps {
                frfs: Vec::new(),
                contradictory: false,
            });
        }
        Err(other) => return Err(other),
    };
    told.warnings
        .extend(found.warnings.iter().map(|w| format!("{set}: {w}")));
    told.hits.push((set.to_owned(), found.hits));
    let frfs = sensors
        .iter()
        .enumerate()
        .map(|(k, (channel, quantity))| FrfInput {
            name: format!("{}/{}", channel.name, hammer.name),
            set: set.to_owned(),
            dofs: None,
            receptance_m_per_n: receptance(
                &found.frequency_hz,
                &found.frf[k],
                Some(*quantity),
                found.added_decay_per_s,
            ),
            frequency_hz: found.frequency_hz.clone(),
            coherence: found.coherence.as_ref().map(|c| c[k].clone()),
            added_decay_per_s: found.added_decay_per_s,
        })
        .collect();
    Ok(FromTaps {
        frfs,
        contradictory: found.contradictory,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One channel of an analyser has no unit of motion (an amplifier that was not set up): it is what the others are, not m/N.
    #[test]
    fn a_file_that_does_not_say_is_what_the_others_are() {
        let file = |names: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            let rows: String = (1..40)
                .map(|k| format!("{k},{}.5,{}\n", k % 7, -(k % 5)))
                .collect();
            std::fs::write(file.path(), format!("{names}\n{rows}")).unwrap();
            file
        };
        let says = file("frequency_hz,Real [(m/s²)/N],Imag [(m/s²)/N]");
        let silent = file("frequency_hz,Real [V/N],Imag [V/N]");
        let read_both = |reading: FrfReading| {
            let mut told = Told::default();
            let mut inputs = read(says.path(), &reading, &mut told).unwrap();
            inputs.extend(read(silent.path(), &reading, &mut told).unwrap());
            settle_unsaid(&mut inputs, &reading, &mut told);
            (inputs, told.warnings)
        };
        let (inputs, warnings) = read_both(FrfReading {
            unsaid_like_the_rest: true,
            ..FrfReading::default()
        });
        for (a, b) in inputs[0]
            .receptance_m_per_n
            .iter()
            .zip(&inputs[1].receptance_m_per_n)
        {
            assert!((a - b).norm() <= 1e-12 * a.norm());
        }
        assert!(
            warnings
                .iter()
                .any(|w| w.contains("taken as (m/s²)/N as those of the other files")),
            "{warnings:?}"
        );
        // What was said on the command line counts.
        let (inputs, warnings) = read_both(FrfReading {
            unsaid: Quantity::Mobility,
            ..FrfReading::default()
        });
        let (a, b) = (inputs[0].receptance_m_per_n[9], inputs[1].receptance_m_per_n[9]);
        assert!((a.norm() / b.norm() - 1.0 / (TAU * 10.0)).abs() < 1e-9);
        assert!(
            warnings
                .iter()
                .any(|w| w.contains("taken as (m/s)/N (another: --quantity)")),
            "{warnings:?}"
        );
    }

    /// A record of one hit, or of none, with these names.
    fn record(names: &str, hit_n: f64) -> tempfile::NamedTempFile {
        let mut text = format!("{names}\n");
        for k in 0..4000 {
            let t = (f64::from(k) - 100.0) / 2000.0;
            let (force, motion) = match k {
                100..104 => (hit_n, 0.0),
                _ if t > 0.0 => (0.0, hit_n * (-20.0 * t).exp() * (300.0 * t).sin()),
                _ => (0.0, 0.0),
            };
            let noise = 1e-3 * f64::from(k * k % 7 - 3);
            text += &format!(
                "{:.4},{:.5},{:.5}\n",
                f64::from(k) / 2000.0,
                force + noise,
                motion + noise
            );
        }
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    #[test]
    fn a_record_without_a_good_hit_is_left_out() {
        let names = "time_s,force_n,acc_m_per_s2";
        let (bad, good) = (record(names, 0.0), record(names, 10.0));
        let of = |files: &[&Path]| {
            let (reading, settings) = (FrfReading::default(), modal::Settings::default());
            crate::analysis::modes::modal::ModalAnalysis::of_files(files, true, &reading, &settings)
        };
        let found = of(&[bad.path(), good.path()]).unwrap();
        assert_eq!((found.sets[0].frfs.len(), found.hits.len()), (1, 1));
        // What lies beside them.
        let beside = tempfile::Builder::new().suffix(".md").tempfile().unwrap();
        let found_beside = of(&[beside.path(), good.path()]).unwrap();
        assert_eq!(found_beside.sets[0].frfs.len(), 1);
        assert!(
            found_beside
                .warnings
                .iter()
                .any(|w| w.contains("passed over: no measurement")),
            "{:?}",
            found_beside.warnings
        );
        assert!(of(&[beside.path()]).is_err());
        let told = format!("{}: left out: no hit found", bad.path().display());
        assert!(
            found.warnings.iter().any(|w| w.starts_with(&told)),
            "{:?}",
            found.warnings
        );
        let error = of(&[bad.path(), bad.path()]).unwrap_err().to_string();
        assert!(
            error.contains("no hit found") && error.contains("remedy"),
            "{error}"
        );
    }

    #[test]
    fn sensors_are_known_by_their_unit_or_called_acc() {
        let of = |names: &str| {
            let mut told = Told::default();
            let file = record(names, 10.0);
            let found = read(file.path(), &FrfReading::default(), &mut told);
            (found.map(|f| f.len()), told.warnings.join("\n"))
        };
        for names in ["time,force_n,acc_m_per_s2", "time,force [N],tool acc_g"] {
            let (count, told) = of(names);
            assert_eq!(
                (count.unwrap(), told.contains("taken for")),
                (1, false),
                "{names}: {told}"
            );
        }
        let (count, told) = of("time,force,Acc 1");
        assert_eq!(count.unwrap(), 1);
        assert!(told.contains("force has no unit: taken for newtons"), "{told}");
        assert!(told.contains("Acc 1 has no unit: taken for m/s²"), "{told}");
        // Volts: the hammer was not calibrated, and that is said, whether it is called so or is what is no motion.
        for names in ["time,hammer [V],acc_m_per_s2", "time,CH8 [V],CH2 [cm/s2]"] {
            let (count, told) = of(names);
            assert_eq!(count.unwrap(), 1, "{names}");
            assert!(told.contains("counts in V, not in newtons"), "{names}: {told}");
        }
        assert!(of("time,Tacho [V],CH2 [cm/s2]").0.is_err());
        let error = of("time,force,temperature [°C]").0.unwrap_err().to_string();
        assert!(
            error.contains("others: temperature") && error.contains("acc_m_per_s2"),
            "{error}"
        );
        // Nothing says anything: the hammer is what holds short pulses while the other rings on.
        for names in ["time,f,x", "time,a [V],b [V]"] {
            let (count, told) = of(names);
            assert_eq!(count.unwrap(), 1, "{names}");
            assert!(
                told.contains("taken for the hammer") && told.contains("taken for m/s²"),
                "{names}: {told}"
            );
        }
    }

    #[test]
    fn the_hammer_may_be_said() {
        let file = record("time,out [V],in [V]", 10.0);
        let of = |hammer: &str| {
            let reading = FrfReading {
                hammer: Some(hammer.into()),
                ..FrfReading::default()
            };
            read(file.path(), &reading, &mut Told::default())
        };
        for said in ["out", "1"] {
            assert_eq!(of(said).unwrap()[0].name, "in [V]/out [V]");
        }
        let error = of("force").unwrap_err().to_string();
        assert!(
            error.contains("no channel is called force (out [V], in [V])"),
            "{error}"
        );
    }

    #[test]
    fn a_tap_test_without_times_needs_a_rate() {
        let whole = record("time_s,force_n,acc_m_per_s2", 10.0);
        let text = std::fs::read_to_string(whole.path()).unwrap();
        let rows = text
            .lines()
            .map(|l| l.split_once(',').unwrap().1.to_owned() + "\n");
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), rows.collect::<String>()).unwrap();
        let of = |rate_hz| {
            let reading = FrfReading {
                rate_hz,
                ..FrfReading::default()
            };
            read(file.path(), &reading, &mut Told::default())
        };
        let error = of(None).unwrap_err().to_string();
        assert!(
            error.contains("without a time base") && error.contains("--rate"),
            "{error}"
        );
        let (with, own) = (of(Some(2000.0)).unwrap(), {
            read(whole.path(), &FrfReading::default(), &mut Told::default()).unwrap()
        });
        let apart = with[0]
            .frequency_hz
            .iter()
            .zip(&own[0].frequency_hz)
            .map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-6);
        assert_eq!(with[0].receptance_m_per_n.len(), own[0].receptance_m_per_n.len());
    }

    #[test]
    fn accelerance_and_mobility_become_receptance() {
        let f = 10.0;
        let omega = TAU * f;
        let of = |value: Complex64, quantity| receptance(&[f], &[value], quantity, 0.0)[0].re;
        let a = of(
            Complex64::new(-omega * omega * 2e-6, 0.0),
            Some(Quantity::Accelerance),
        );
        let v = of(Complex64::new(0.0, omega * 2e-6), Some(Quantity::Mobility));
        let x = of(Complex64::new(2e-6, 0.0), None);
        for value in [a, v, x] {
            approx::assert_relative_eq!(value, 2e-6, max_relative = 1e-12);
        }
    }
}
