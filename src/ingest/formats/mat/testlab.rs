//! Functions as Simcenter Testlab (Siemens, before LMS) exports them: a struct each, with `x_values`, `y_values` and `function_record`.

use num_complex::Complex64;

use crate::InputError;
use crate::data::FrfRecord;
use crate::ingest::budget::Budget;
use crate::ingest::contents::{Contents, OtherRecord};
use crate::ingest::formats::mat::variable::{Labels, MIN_AXIS, Variable};
use crate::ingest::formats::waveform;
use crate::ingest::text::Notes;
use crate::ingest::units;
use crate::ingest::{checks, dof_names};

const VALUES: &str = ".y_values.values";

/// Reads all of them, and marks what belongs to them as used.
pub(super) fn functions(
    variables: &[Variable],
    labels: &[Labels],
    used: &mut [bool],
    contents: &mut Contents,
    budget: &mut Budget,
    notes: &mut Notes,
) -> Result<(), InputError> {
    for values in variables {
        let Some(root) = values.name.strip_suffix(VALUES) else {
            continue;
        };
        let number = |field: &str| {
            let name = format!("{root}.{field}");
            variables.iter().find(|v| v.name == name)?.scalar()
        };
        let text = |field: &str| text_of(labels, &format!("{root}.{field}"));
        let Some(step) = number("x_values.increment").filter(|step| *step > 0.0) else {
            continue;
        };
        let start = number("x_values.start_value").unwrap_or(0.0);
        let rows = match values.size.as_slice() {
            [1, columns] => *columns,
            [rows, ..] => *rows,
            [] => continue,
        };
        if rows < MIN_AXIS {
            continue;
        }
        budget.take(48 * values.re.len(), &format!("variable {}", values.name))?;
        let kind = text("function_record.type");
        let name = [
            text("function_record.name"),
            text("function_record.primary_channel.label"),
        ]
        .into_iter()
        .find(|name| !name.is_empty())
        .unwrap_or_else(|| root.to_string());
        let label = text("y_values.quantity.label");
        // The label is what Testlab shows; the numbers are in the system that the note names.
        let is_si = text("y_values.quantity.info").contains("MKS");
        let x_label = text("x_values.quantity.label");
        if x_label != "Hz" && (x_label != "s" || values.im.is_some()) {
            continue;
        }
        let columns = values.re.len() / rows;
        let column_name = |c: usize| match columns {
            1 => name.clone(),
            _ => format!("{name} {}", c + 1),
        };
        for c in 0..columns {
            let range = c * rows..(c + 1) * rows;
            let complex = || -> Vec<Complex64> { range.clone().map(|i| values.value(i)).collect() };
            let axis = || -> Vec<f64> { (0..rows).map(|k| start + step * k as f64).collect() };
            match x_label.as_str() {
                "s" => {
                    let unit = match units::parse(&label)
                        .filter(|_| is_si)
                        .and_then(|u| u.dimension.describe())
                    {
                        Some((_, si)) => si.to_string(),
                        None => label.clone(),
                    };
                    let samples = values.re[range.clone()].to_vec();
                    let channel = waveform::channel(column_name(c), unit, samples, notes)?;
                    waveform::put(&mut contents.times, step.recip(), start, channel)?;
                }
                "Hz" if is_frf(&kind, &label, values) => {
                    let unit = units::parse(&label).and_then(|u| u.dimension.frf().zip(Some(u.factor)));
                    let factor = unit.filter(|_| !is_si).map_or(1.0, |(_, factor)| factor);
                    if let Some(remark) = units::no_motion_per_force(&label) {
                        notes.about(&column_name(c), remark);
                    }
                    let (response, reference) = dof_names::both(&column_name(c)).unzip();
                    let record = FrfRecord {
                        name: column_name(c),
                        response,
                        reference,
                        quantity: unit.map(|(quantity, _)| quantity),
                        frequency_hz: axis(),
                        value: complex().into_iter().map(|v| v * factor).collect(),
                        coherence: None,
                    };
                    contents.frfs.extend(checks::tidy_frf(record, notes)?);
                }
                _ => contents.others.push(OtherRecord {
                    kind: other(&kind),
                    name: column_name(c),
                    abscissa: axis(),
                    abscissa_unit: x_label.clone(),
                    value: complex(),
                    unit: label.clone(),
                }),
            }
        }
        let inside = format!("{root}.");
        for (used, variable) in used.iter_mut().zip(variables) {
            *used |= variable.name.starts_with(&inside);
        }
        if is_si && units::parse(&label).is_some() {
            notes.about(
                &name,
                format!("saved by Testlab in MKS units: the numbers are SI, {label} is what Testlab shows"),
            );
        }
    }
    Ok(())
}

/// What `function_record.type` calls an FRF; where it says nothing, complex values of one unit over another.
fn is_frf(kind: &str, label: &str, values: &Variable) -> bool {
    let kind = kind.to_lowercase();
    match kind.is_empty() {
        true => values.im.is_some() && (label.is_empty() || label.contains('/')),
        false => {
            kind.contains("frf") || kind.contains("frequencyresponse") || kind.contains("frequency response")
        }
    }
}

fn other(kind: &str) -> &'static str {
    let kind = kind.to_lowercase();
    let is = |part: &str| kind.contains(part);
    match () {
        () if is("coherence") => "coherence",
        () if is("cross") => "cross spectrum",
        () if is("psd") => "power spectral density",
        () => "spectrum",
    }
}

/// Text of this name; nothing where there is none. A column of letters is a word.
fn text_of(labels: &[Labels], name: &str) -> String {
    let rows = labels.iter().find(|l| l.name == name).map(|l| l.rows.as_slice());
    match rows {
        Some([one]) => one.trim().to_string(),
        Some(rows) if rows.iter().all(|r| r.chars().count() <= 1) => rows.concat().trim().to_string(),
        Some(rows) => rows.join(" ").trim().to_string(),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Quantity;

    /// A struct of Testlab: so many values from `start` in steps of `step`.
    fn exported(
        [x_label, y_label, kind]: [&str; 3],
        [start, step]: [f64; 2],
        re: Vec<f64>,
        im: Option<Vec<f64>>,
    ) -> (Contents, Vec<String>) {
        let scalar = |name: &str, value: f64| Variable {
            name: name.into(),
            size: vec![1, 1],
            re: vec![value],
            im: None,
        };
        let variables = vec![
            scalar("Exported.x_values.start_value", start),
            scalar("Exported.x_values.increment", step),
            scalar("Exported.y_values.quantity.unit_transformation.factor", 0.10197),
            Variable {
                name: "Exported.y_values.values".into(),
                size: vec![re.len(), 1],
                re,
                im,
            },
        ];
        let label = |name: &str, rows: &[&str]| Labels {
            name: format!("Exported.{name}"),
            rows: rows.iter().map(|r| r.to_string()).collect(),
        };
        let letters: Vec<String> = kind.chars().map(String::from).collect();
        let letters: Vec<&str> = letters.iter().map(String::as_str).collect();
        let labels = [
            label("x_values.quantity.label", &[x_label]),
            label("y_values.quantity.label", &[y_label]),
            label("y_values.quantity.info", &["Data saved by Testlab in MKS"]),
            // As a column: some versions write words so.
            label("function_record.type", &letters),
            label("function_record.name", &["Tip"]),
        ];
        let (mut contents, mut notes) = (Contents::default(), Notes::default());
        let mut used = vec![false; variables.len()];
        functions(
            &variables,
            &labels,
            &mut used,
            &mut contents,
            &mut Budget::for_file(0),
            &mut notes,
        )
        .unwrap();
        assert!(used.iter().all(|u| *u));
        (contents, notes.into_warnings())
    }

    #[test]
    fn a_signal_has_its_clock_and_is_in_si_already() {
        let (held, told) = exported(["s", "g", "Signal"], [0.5, 1e-3], vec![9.80665; 6], None);
        let record = &held.times[0];
        assert!((record.sample_rate_hz - 1000.0).abs() < 1e-9);
        assert!((record.channels[0].samples[0] - 9.80665).abs() < 1e-12);
        assert_eq!(record.channels[0].name, "Tip");
        assert!(told.iter().any(|w| w.contains("MKS")), "{told:?}");
    }

    #[test]
    fn an_frf_has_its_quantity_and_a_spectrum_is_none() {
        let values = || (vec![1.0; 6], Some(vec![2.0; 6]));
        let (re, im) = values();
        let (held, _) = exported(["Hz", "g/N", "FRF"], [10.0, 2.0], re, im);
        assert_eq!(held.frfs[0].quantity, Some(Quantity::Accelerance));
        assert_eq!(held.frfs[0].frequency_hz[..2], [10.0, 12.0]);
        assert_eq!(held.frfs[0].value[0], Complex64::new(1.0, 2.0));
        // Motion over motion: Testlab's label is a stroke.
        let (re, im) = values();
        let (held, told) = exported(["Hz", "/", "FRF"], [10.0, 2.0], re, im);
        assert_eq!(held.frfs[0].quantity, None);
        assert!(told.iter().any(|w| w.contains("transmissibility")), "{told:?}");
        assert!(!told.iter().any(|w| w.contains("MKS")), "{told:?}");
        let (re, im) = values();
        let (held, _) = exported(["Hz", "g", "FrequencySpectrum"], [0.0, 2.0], re, im);
        assert_eq!((held.frfs.len(), held.others[0].kind), (0, "spectrum"));
    }
}
