//! What the arrays of a MAT-file are, by name, shape and kind of number. A MAT-file has no standard for measurements:
//! whatever is decided here is said in the notes.

mod parts;
#[cfg(test)]
mod tests;

use num_complex::Complex64;

use crate::InputError;
use crate::data::{FrfRecord, Quantity, TimeRecord};
use crate::ingest::budget::Budget;
use crate::ingest::contents::{Contents, OtherRecord};
use crate::ingest::formats::mat::testlab;
use crate::ingest::formats::mat::variable::{Labels, MIN_AXIS, Variable};
use crate::ingest::formats::waveform;
use crate::ingest::tables::clock::{self, Grid, Stamps};
use crate::ingest::text::Notes;
use crate::ingest::{checks, dof_names, units};

/// Change of the step from which on times are not evenly spaced.
const UNEVEN: f64 = 0.02;
/// Names of arrays shown in one message.
const SHOWN: usize = 8;

pub(crate) fn contents(
    mut variables: Vec<Variable>,
    labels: &[Labels],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Contents, InputError> {
    if variables.is_empty() {
        return Err(
            InputError::new("a file of arrays (MATLAB, HDF5, NumPy) without one of numbers")
                .remedy("save the frequency axis f (Hz) or the times t (s) and the data as plain arrays"),
        );
    }
    let mut contents = Contents::default();
    join_parts(&mut variables, notes);
    parts::join_pairs(&mut variables, notes);
    let mut used = vec![false; variables.len()];
    let mut damaged = None;
    testlab::functions(&variables, labels, &mut used, &mut contents, budget, notes)?;
    tables(
        &variables,
        labels,
        &mut used,
        &mut contents,
        &mut damaged,
        budget,
        notes,
    )?;
    frequency_functions(&variables, &mut used, &mut contents, budget, notes)?;
    let mut times = time_signals(&variables, &mut used, &mut damaged, budget, notes)?;
    contents.times.append(&mut times);
    // Beside FRFs a damaged signal is a thing by the way; where the signals are the measurement, it is not.
    if let Some(error) = damaged {
        if contents.frfs.is_empty() {
            return Err(error);
        }
        notes.file(format!("{}: signal left out", error.problem));
    }
    if contents.frfs.is_empty() && contents.times.is_empty() && contents.others.is_empty() {
        return Err(InputError::new(format!(
            "arrays in which no FRF and no time signal is recognised ({})",
            names(variables.iter())
        ))
        .remedy(
            "name the axis f (Hz) or t (s); FRFs are complex arrays with a dimension as long as f, signals real ones \
             with a dimension as long as t; without a time axis: `lobestone modal FILE --rate HZ` for a tap test, rate_hz in a \
             [[channel]] of campaign.toml for cutting forces",
        ));
    }
    let left: Vec<&Variable> = variables
        .iter()
        .zip(&used)
        .filter(|(_, u)| !**u)
        .map(|(v, _)| v)
        .collect();
    if !left.is_empty() {
        let told = left.iter().map(|v| match why_left_out(v, &contents.times) {
            Some(why) => format!("{} ({why})", v.name),
            None => v.name.clone(),
        });
        notes.file(format!("arrays left out: {}", listed(told)));
    }
    Ok(contents)
}

/// Why an array that may have been meant for a signal is none.
fn why_left_out(variable: &Variable, times: &[TimeRecord]) -> Option<String> {
    let samples = times.first()?.len();
    let own = variable.size.iter().copied().max()?;
    if variable.im.is_some() || (own as f64) < SHORT * samples as f64 {
        return None;
    }
    let no_number = variable.re.iter().position(|v| !v.is_finite());
    match no_number {
        Some(at) => Some(format!("value {} is no number", at + 1)),
        None if times.iter().all(|t| t.len() != own) => {
            Some(format!("{own} values, the signals have {samples}"))
        }
        None => None,
    }
}

/// Real arrays of two columns that are the real and imaginary parts of an FRF become complex.
fn join_parts(variables: &mut [Variable], notes: &mut Notes) {
    for variable in variables {
        let columns = variable.size.as_slice() == [variable.re.len() / 2, 2];
        if variable.im.is_some() || !columns || variable.re.len() < 2 * MIN_AXIS || !variable.is_called_frf()
        {
            continue;
        }
        let (re, im) = variable.re.split_at(variable.re.len() / 2);
        if rises_evenly(re) {
            continue;
        }
        notes.about(&variable.name, "two columns, taken as real and imaginary part");
        let (re, im) = (re.to_vec(), im.to_vec());
        variable.size = vec![re.len(), 1];
        variable.re = re;
        variable.im = Some(im);
    }
}

/// True for an axis: finite, rising in even steps.
fn rises_evenly(values: &[f64]) -> bool {
    let [first, .., last] = values else { return false };
    let step = (last - first) / (values.len() - 1) as f64;
    let slack = 1e-3 * step + 1e-6 * last.abs();
    values.len() >= MIN_AXIS
        && step > 0.0
        && step.is_finite()
        && values
            .iter()
            .enumerate()
            .all(|(i, v)| (first + step * i as f64 - v).abs() <= slack)
}

/// Arrays that hold their own axis in the first column, `[f, H]` or `[t, x]`, as SignalCalc (Data Physics) and hand-made
/// files have them: `H1_2` an FRF, `C1_2` a coherence, `G1_2` and `S1` spectra, `X1` a signal.
fn tables(
    variables: &[Variable],
    labels: &[Labels],
    used: &mut [bool],
    contents: &mut Contents,
    damaged: &mut Option<InputError>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<(), InputError> {
    let mut coherences = Vec::new();
    for (k, variable) in variables.iter().enumerate() {
        let [rows, columns] = variable.size.as_slice() else {
            continue;
        };
        let (rows, columns) = (*rows, *columns);
        if columns < 2 || rows < MIN_AXIS || columns >= rows || rows * columns != variable.re.len() {
            continue;
        }
        let axis = &variable.re[..rows];
        let no_phase = |im: &Vec<f64>| im[..rows].iter().all(|v| *v == 0.0);
        // Times before the trigger are negative, frequencies never.
        let may_be_time = variable.im.is_none() && matches!(kind(variable), Kind::Unknown);
        if !variable.im.as_ref().is_none_or(no_phase) || axis[0] < 0.0 && !may_be_time || !rises_evenly(axis)
        {
            continue;
        }
        budget.take(48 * variable.re.len(), &format!("variable {}", variable.name))?;
        let column = |c: usize| &variable.re[c * rows..(c + 1) * rows];
        let values =
            |c: usize| -> Vec<Complex64> { (c * rows..(c + 1) * rows).map(|i| variable.value(i)).collect() };
        let mut frf = |name: String, value: Vec<Complex64>, notes: &mut Notes| {
            let mut record = record(variable, name, axis, value);
            if let Some((quantity, factor)) = units::parse(&channel_unit(variable, variables, labels))
                .and_then(|unit| unit.dimension.frf().zip(Some(unit.factor)))
            {
                record.quantity = Some(quantity);
                record.value.iter_mut().for_each(|v| *v *= factor);
            }
            checks::tidy_frf(record, notes).map(|record| contents.frfs.extend(record))
        };
        let suffix = |c: usize| {
            if columns > 2 {
                format!("(:,{})", c + 1)
            } else {
                String::new()
            }
        };
        let is_real = variable.im.is_none();
        match kind(variable) {
            Kind::Coherence if columns == 2 => coherences.push((variable, axis, column(1).to_vec())),
            Kind::Frf if !is_real => {
                for c in 1..columns {
                    frf(format!("{}{}", variable.name, suffix(c)), values(c), notes)?;
                }
            }
            _ if is_real && columns == 3 && variable.is_called_frf() => {
                let both = match parts::in_degrees(column(1), column(2)) {
                    Some(degrees) => {
                        notes.about(
                            &variable.name,
                            format!(
                                "columns of frequency, magnitude and phase in {}",
                                parts::unit(degrees)
                            ),
                        );
                        parts::polar(column(1), column(2), degrees)
                    }
                    None => {
                        let both = column(1).iter().zip(column(2));
                        both.map(|(re, im)| Complex64::new(*re, *im)).collect()
                    }
                };
                frf(variable.name.clone(), both, notes)?;
            }
            Kind::Other(kind) => contents.others.extend((1..columns).map(|c| OtherRecord {
                kind,
                name: format!("{}{}", variable.name, suffix(c)),
                abscissa: axis.to_vec(),
                abscissa_unit: "Hz".into(),
                value: values(c),
                unit: String::new(),
            })),
            Kind::Unknown
                if is_real && (variable.is_called_signal() || axis[1] - axis[0] <= SAMPLE_STEP_S) =>
            {
                let rate = (rows - 1) as f64 / (axis[rows - 1] - axis[0]);
                for c in 1..columns {
                    let name = format!("{}{}", variable.name, suffix(c));
                    let unit = channel_unit(variable, variables, labels);
                    match waveform::channel(name, unit, column(c).to_vec(), notes) {
                        Ok(channel) => waveform::put(&mut contents.times, rate, axis[0], channel)?,
                        Err(error) => {
                            damaged.get_or_insert(error);
                        }
                    }
                }
            }
            _ => continue,
        }
        used[k] = true;
        let what = if matches!(kind(variable), Kind::Unknown)
            && !(is_real && columns == 3 && variable.is_called_frf())
        {
            "time"
        } else {
            "frequency"
        };
        notes.about(&variable.name, format!("its first column is taken as {what}"));
    }
    for (variable, axis, values) in coherences {
        attach(variable, "", axis, &values, variables, contents, notes);
    }
    Ok(())
}

/// What SignalCalc's lists of channels (`ChanNum`, `Unit`) give for a function of its: `g/N` for `H1_2` where channel 1 is a force;
/// blank where the file says nothing.
fn channel_unit(variable: &Variable, variables: &[Variable], labels: &[Labels]) -> String {
    let units = labels.iter().find(|l| l.name.eq_ignore_ascii_case("unit"));
    let (Some(units), Some(channels)) = (units, variable.analyser_channels()) else {
        return String::new();
    };
    let numbers = variables.iter().find(|v| v.is_called(&["channum"]));
    let of = |channel: usize| {
        let row = match numbers {
            Some(numbers) => numbers.re.iter().position(|n| *n == channel as f64),
            None => channel.checked_sub(1),
        };
        units.rows.get(row?).filter(|unit| !units::is_blank(unit))
    };
    match channels.as_slice() {
        [channel] => of(*channel).cloned().unwrap_or_default(),
        // The response over the reference, which stands first; an impulse response is of the same unit for each line.
        [reference, response] if reference != response => of(*response)
            .zip(of(*reference))
            .map_or_else(String::new, |(response, reference)| {
                format!("({response})/({reference})")
            }),
        _ => String::new(),
    }
}

/// Steps up to this are those of a recording where nothing says what an axis is, s.
const SAMPLE_STEP_S: f64 = 2e-3;

/// An FRF of a variable.
fn record(variable: &Variable, name: String, axis: &[f64], value: Vec<Complex64>) -> FrfRecord {
    let (response, reference) = dof_names::both(variable.own_name()).unzip();
    FrfRecord {
        name,
        response,
        reference,
        quantity: quantity(variable),
        frequency_hz: axis.to_vec(),
        value,
        coherence: None,
    }
}

fn names<'a>(variables: impl ExactSizeIterator<Item = &'a Variable>) -> String {
    listed(variables.map(|v| v.name.clone()))
}

/// The first few, with a sign that there are more.
fn listed(texts: impl ExactSizeIterator<Item = String>) -> String {
    let count = texts.len();
    let mut shown: Vec<String> = texts.take(SHOWN).collect();
    if count > SHOWN {
        shown.push("…".into());
    }
    shown.join(", ")
}

/// A frequency axis: a variable of its own, or made of start and step.
struct Axis {
    name: String,
    hz: Vec<f64>,
    /// Only variables that lie in this struct.
    within: Option<String>,
}

/// All frequency axes: variables named so, start and step as scalars, and, where complex arrays have none of those, a
/// rising vector of their length.
fn frequency_axes(
    variables: &[Variable],
    used: &mut [bool],
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<Axis>, InputError> {
    let mut axes = Vec::new();
    for (k, variable) in variables.iter().enumerate() {
        let Some(factor) = variable
            .frequency_factor()
            .filter(|_| !used[k] && variable.is_axis() && variable.re[0] >= 0.0)
        else {
            continue;
        };
        used[k] = true;
        if factor != 1.0 {
            notes.about(&variable.name, "taken as circular frequency, rad/s");
        }
        axes.push(Axis {
            name: variable.name.clone(),
            hz: variable.re.iter().map(|f| f * factor).collect(),
            within: None,
        });
    }
    let steps: Vec<usize> = (0..variables.len())
        .filter(|k| !used[*k] && variables[*k].is_frequency_step())
        .collect();
    for k in steps {
        let (Some(step), root) = (variables[k].scalar().filter(|s| *s > 0.0), variables[k].root()) else {
            continue;
        };
        let inside = |v: &&Variable| v.root() == root;
        let start = variables.iter().filter(inside).find(|v| v.is_frequency_start());
        let lengths = variables
            .iter()
            .filter(inside)
            .filter(|v| v.im.is_some())
            .flat_map(|v| v.size.iter().copied());
        let Some(length) = lengths.max().filter(|n| *n >= MIN_AXIS) else {
            continue;
        };
        budget.take(8 * length, "a frequency axis")?;
        let first = start.and_then(Variable::scalar).unwrap_or(0.0);
        notes.about(
            &variables[k].name,
            format!("frequency axis of {length} lines from {first} Hz in steps of {step} Hz"),
        );
        for (k, v) in variables.iter().enumerate() {
            used[k] |= v.root() == root && (v.is_frequency_start() || v.is_frequency_step());
        }
        axes.push(Axis {
            name: variables[k].name.clone(),
            hz: (0..length).map(|i| first + step * i as f64).collect(),
            within: Some(root.to_owned()),
        });
    }
    // The only rising vector that fits, whatever its name.
    for (k, variable) in variables.iter().enumerate() {
        let is_complex_vector = !used[k] && variable.im.is_some() && !variable.size.is_empty();
        let has_axis = |a: &Axis| variable.size.contains(&a.hz.len());
        if !is_complex_vector || axes.iter().any(has_axis) {
            continue;
        }
        let fits = |(j, v): &(usize, &Variable)| {
            !used[*j]
                && v.im.is_none()
                && v.is_vector()
                && v.re[0] >= 0.0
                && variable.size.contains(&v.re.len())
                && !v.is_called_signal()
                && rises_evenly(&v.re)
                && v.re[1] - v.re[0] > SAMPLE_STEP_S
        };
        let mut candidates = variables.iter().enumerate().filter(fits);
        if let (Some((j, axis)), None) = (candidates.next(), candidates.next()) {
            used[j] = true;
            notes.about(
                &axis.name,
                "the only rising vector as long as the FRFs: taken as frequency in Hz",
            );
            axes.push(Axis {
                name: axis.name.clone(),
                hz: axis.re.clone(),
                within: None,
            });
        }
    }
    Ok(axes)
}

/// FRFs, coherences and spectra on the frequency axes.
fn frequency_functions(
    variables: &[Variable],
    used: &mut [bool],
    contents: &mut Contents,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<(), InputError> {
    let axes = frequency_axes(variables, used, budget, notes)?;
    let mut coherences: Vec<(&Variable, String, Vec<usize>, &Axis)> = Vec::new();
    for axis in &axes {
        for k in 0..variables.len() {
            let variable = &variables[k];
            let elsewhere = axis.within.as_ref().is_some_and(|root| root != variable.root());
            if used[k] || elsewhere || variable.name == axis.name {
                continue;
            }
            let kind = kind(variable);
            if matches!(kind, Kind::Unknown) {
                continue;
            }
            let Some(vectors) = variable.along(axis.hz.len()) else {
                continue;
            };
            // Frequencies, values and indices of each, and the record itself.
            let memory = 40 * variable.re.len() + 512 * vectors.len();
            budget.take(memory, &format!("variable {}", variable.name))?;
            used[k] = true;
            for (suffix, at) in vectors {
                let value = || at.iter().map(|&i| variable.value(i)).collect::<Vec<_>>();
                match kind {
                    Kind::Frf => {
                        let record =
                            record(variable, format!("{}{suffix}", variable.name), &axis.hz, value());
                        contents.frfs.extend(checks::tidy_frf(record, notes)?);
                    }
                    Kind::Coherence => coherences.push((variable, suffix, at, axis)),
                    Kind::Other(kind) => contents.others.push(OtherRecord {
                        kind,
                        name: format!("{}{suffix}", variable.name),
                        abscissa: axis.hz.clone(),
                        abscissa_unit: "Hz".into(),
                        value: value(),
                        unit: String::new(),
                    }),
                    Kind::Unknown => {}
                }
            }
        }
    }
    for (variable, suffix, at, axis) in coherences {
        let values: Vec<f64> = at.iter().map(|&i| variable.re[i]).collect();
        attach(variable, &suffix, &axis.hz, &values, variables, contents, notes);
    }
    let finite =
        |o: &OtherRecord| o.value.iter().all(|v| v.is_finite()) && o.abscissa.iter().all(|v| v.is_finite());
    contents.others.retain(|o| {
        let kept = finite(o);
        if !kept {
            notes.about(&o.name, "values that are not numbers: left out");
        }
        kept
    });
    Ok(())
}

/// A coherence goes to the FRF with the same name but for that word (`H1_2` and `C1_2`), to the only one there is, or, where one array
/// of FRFs is as large as that of the coherences, to the same row or column (`suffix`) of it.
fn attach(
    variable: &Variable,
    suffix: &str,
    axis_hz: &[f64],
    values: &[f64],
    variables: &[Variable],
    contents: &mut Contents,
    notes: &mut Notes,
) {
    let word = |w: &String| !["coh", "coherence", "gamma2"].contains(&w.as_str());
    let bare: Vec<String> = variable.words().into_iter().filter(word).collect();
    let digits = |v: &Variable| v.is_analyser_name().then(|| v.own_name()[1..].to_owned());
    let only = contents.frfs.len() == 1;
    let mut as_large = variables
        .iter()
        .filter(|v| matches!(kind(v), Kind::Frf) && v.size == variable.size);
    let beside = as_large
        .next()
        .filter(|_| as_large.next().is_none() && !suffix.is_empty())
        .map(|v| format!("{}{suffix}", v.name));
    let frf = contents.frfs.iter_mut().find(|frf| {
        let source = variables.iter().find(|v| v.name == frf.name);
        let same = |s: &Variable| s.words() == bare || digits(s).is_some() && digits(s) == digits(variable);
        frf.coherence.is_none() && (only || source.is_some_and(same) || beside.as_ref() == Some(&frf.name))
    });
    match frf {
        Some(frf) => {
            frf.coherence = checks::on_lines(&frf.frequency_hz, axis_hz, values);
            if frf.coherence.is_none() {
                notes.about(&variable.name, "coherence outside 0..1: left out");
            }
        }
        None => notes.about(&variable.name, "a coherence that belongs to no FRF: left out"),
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Frf,
    Coherence,
    Other(&'static str),
    Unknown,
}

fn kind(variable: &Variable) -> Kind {
    let letter = variable
        .own_name()
        .chars()
        .next()
        .filter(|_| variable.is_analyser_name());
    if variable.mentions(&["coh", "gamma2"]) || letter == Some('C') {
        Kind::Coherence
    } else if variable.mentions(&["cross", "csd"]) {
        Kind::Other("cross spectrum")
    } else if variable.mentions(&["psd"]) {
        Kind::Other("power spectral density")
    } else if variable.mentions(&["spec", "fft"]) || matches!(letter, Some('G' | 'S')) {
        Kind::Other("spectrum")
    } else if variable.im.is_some() {
        Kind::Frf
    } else {
        Kind::Unknown
    }
}

fn quantity(variable: &Variable) -> Option<Quantity> {
    if variable.mentions(&["recept", "complian"]) {
        Some(Quantity::Receptance)
    } else if variable.mentions(&["mobil", "veloc", "vibrom"]) {
        Some(Quantity::Mobility)
    } else if variable.mentions(&["accel", "acel", "inert"]) {
        Some(Quantity::Accelerance)
    } else {
        None
    }
}

/// Signals beside one so many times as long are none.
const SHORT: f64 = 0.25;
/// Two rates that differ by less are one, printed or stored with few digits.
const RATES_AGREE: f64 = 1e-3;

/// Real arrays along a time axis, or, where there is only a sampling rate, along their longest dimension.
fn time_signals(
    variables: &[Variable],
    used: &mut [bool],
    damaged: &mut Option<InputError>,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<Vec<TimeRecord>, InputError> {
    let mut records = Vec::new();
    let rates: Vec<(usize, f64)> = variables
        .iter()
        .enumerate()
        .filter_map(|(k, v)| Some((k, v.says_rate_hz()?)))
        .collect();
    let rate = rates.first().copied();
    for (at, (k, hz)) in rates.iter().enumerate() {
        let mut before = rates[..at].iter();
        let said = before.find(|(b, _)| variables[*b].root() == variables[*k].root());
        if let Some((b, said)) = said.filter(|(_, said)| (said / hz - 1.0).abs() > RATES_AGREE) {
            notes.about(
                &variables[*k].name,
                format!(
                    "says {} samples per second, {} says {}: that is taken; find out which is right",
                    units::figures(*hz, 6),
                    variables[*b].name,
                    units::figures(*said, 6)
                ),
            );
        }
    }
    // That of its own struct, where each has one.
    let rate_of = |v: &Variable| {
        let own = rates.iter().find(|(k, _)| variables[*k].root() == v.root());
        own.or(rates.first()).map(|r| r.1)
    };
    let is_time = |v: &Variable| {
        v.im.is_none()
            && v.is_vector()
            && v.re.len() >= MIN_AXIS
            && v.re.iter().all(|t| t.is_finite())
            && (v.is_called(&["t", "zeit", "t_s", "tvec", "time", "time_s"])
                || v.is_axis()
                    && (v.own_name().to_lowercase().starts_with("time")
                        || v.words().iter().any(|w| w == "time")))
    };
    // Length, rate, start, and times with their grid where they are uneven.
    type Uneven<'t> = Option<(&'t [f64], Grid)>;
    let mut axes: Vec<(usize, f64, f64, Uneven)> = Vec::new();
    for (axis, _) in variables
        .iter()
        .zip(used.iter())
        .filter(|(v, u)| !**u && is_time(v))
    {
        let times = axis.re.as_slice();
        let length = times.len();
        let own = (times[length - 1] - times[0]) / (length - 1) as f64;
        // The rate is exact where the axis was stored in single precision.
        let said = rate
            .map(|(_, r)| 1.0 / r)
            .filter(|s| (s / own - 1.0).abs() < RATES_AGREE);
        if let (Some((k, hz)), None) = (rate, said) {
            notes.about(
                &variables[k].name,
                format!(
                    "says {} samples per second, the times {} say {}: the times are taken",
                    units::figures(hz, 6),
                    axis.name,
                    units::figures(1.0 / own, 6)
                ),
            );
        }
        let step = said.unwrap_or(own);
        // Times summed up in single precision drift off the grid, but every step is one.
        let even = |w: &[f64]| ((w[1] - w[0]) / step - 1.0).abs() < UNEVEN;
        if said.is_some() && times.windows(2).all(even) {
            axes.push((length, 1.0 / step, times[0], None));
            continue;
        }
        match clock::look(times, 1e-6 * times[length - 1].abs()) {
            Ok(Stamps::Even(grid)) => axes.push((length, grid.rate_hz, grid.start_s, None)),
            Ok(Stamps::Uneven(grid, told)) => {
                notes.about(&axis.name, told);
                axes.push((length, grid.rate_hz, grid.start_s, Some((times, grid))));
            }
            Err(problem) => notes.about(
                &axis.name,
                format!("times are not evenly spaced ({problem}): left out"),
            ),
        }
    }
    for (k, variable) in variables.iter().enumerate() {
        if is_time(variable) && !used[k] {
            used[k] = true;
        }
    }
    let only_rates = axes.is_empty();
    if only_rates {
        let free = variables
            .iter()
            .zip(used.iter())
            .filter(|(v, u)| !**u && v.im.is_none());
        let lengths: Vec<(usize, f64)> = free
            .filter_map(|(v, _)| Some((v.size.iter().copied().max()?, rate_of(v)?)))
            .collect();
        // Several cuts in one file are of several lengths; what is far shorter than they are is no record.
        let longest = lengths.iter().map(|l| l.0).max().unwrap_or(0);
        for (length, rate) in lengths {
            let is_known = axes.iter().any(|a| (a.0, a.1) == (length, rate));
            if length >= MIN_AXIS.max((SHORT * longest as f64) as usize) && !is_known {
                axes.push((length, rate, 0.0, None));
            }
        }
        axes.sort_by_key(|a| std::cmp::Reverse(a.0));
    }
    // Beside times the first rate says them more exactly; without, each says its struct's.
    let asked = if only_rates { rates.len() } else { 1 };
    for (k, _) in rates.iter().take(asked).filter(|_| !axes.is_empty()) {
        used[*k] = true;
    }
    for (length, rate, start_s, uneven) in axes {
        for (k, variable) in variables.iter().enumerate() {
            if only_rates && rate_of(variable) != Some(rate) {
                continue;
            }
            if used[k] || variable.im.is_some() || variable.re.iter().any(|x| !x.is_finite()) {
                continue;
            }
            let Some(vectors) = variable.along(length) else {
                continue;
            };
            budget.take(
                24 * variable.re.len() + 512 * vectors.len(),
                &format!("variable {}", variable.name),
            )?;
            used[k] = true;
            for (suffix, at) in vectors {
                let mut samples: Vec<f64> = at.iter().map(|&i| variable.re[i]).collect();
                if let Some((times, grid)) = uneven {
                    samples = clock::resample(times, &samples, grid);
                }
                let name = format!("{}{suffix}", variable.name);
                match waveform::channel(name, String::new(), samples, notes) {
                    Ok(channel) => waveform::put(&mut records, rate, start_s, channel)?,
                    Err(error) => {
                        damaged.get_or_insert(error);
                    }
                }
            }
        }
    }
    Ok(records)
}
