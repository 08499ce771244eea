//! What every FRF goes through after reading: lines put in order, values that are none left out, signs looked at.

use super::text::Notes;
use crate::InputError;
use crate::data::{FrfRecord, Quantity};

/// Nothing that is measured here has a larger value in SI, whatever its unit: newtons, m/s², metres a newton, volts.
const LARGEST_VALUE: f64 = 1e15;
/// No vibration measurement reaches such a frequency, Hz.
const LARGEST_FREQUENCY_HZ: f64 = 1e9;
/// About thirty years, s.
const LARGEST_TIME_S: f64 = 1e9;

/// Place of the first sample that is not sound. Hardly ever is there one: blocks are looked at by a loop without branches.
pub(super) fn first_that_is_not(samples: &[f64], sound: impl Fn(f64) -> bool) -> Option<usize> {
    const BLOCK: usize = 256;
    let is_sound = |block: &[f64]| block.iter().fold(true, |all, v| all & sound(*v));
    let at = BLOCK * samples.chunks(BLOCK).position(|block| !is_sound(block))?;
    let within = samples[at..].iter().position(|v| !sound(*v))?;
    Some(at + within)
}

/// Refuses samples that are not finite or beyond all that can be measured.
///
/// # Errors
/// Names the channel, the first such sample (counted from 1) and its value.
pub(super) fn plausible_samples(name: &str, samples: &[f64]) -> Result<(), InputError> {
    let Some(at) = first_that_is_not(samples, |v| v.abs() <= LARGEST_VALUE) else {
        return Ok(());
    };
    Err(InputError::new(format!(
        "channel {name}: {:e} in sample {} is no measured value",
        samples[at],
        at + 1
    ))
    .remedy("the file is damaged, or the channel's unit or scale is wrong: export it again"))
}

/// Refuses a sampling rate or start that no recorder has.
///
/// # Errors
/// Names the channel and the value.
pub(super) fn plausible_clock(name: &str, rate_hz: f64, start_s: f64) -> Result<(), InputError> {
    let wrong = |what: String| {
        Err(InputError::new(format!("channel {name}: {what}"))
            .remedy("the file is damaged, or its time axis has a wrong unit: export it again"))
    };
    if !(rate_hz.recip() > 0.0 && rate_hz.recip() <= LARGEST_TIME_S && rate_hz <= LARGEST_FREQUENCY_HZ) {
        return wrong(format!("a sampling rate of {rate_hz:e} Hz"));
    }
    if !(start_s.abs() <= 1e3 * LARGEST_TIME_S) {
        return wrong(format!("begins at {start_s:e} s"));
    }
    Ok(())
}

/// Leaves FRFs out that are copies of others between the same degrees of freedom: the same data twice are no second
/// measurement, and errors estimated from both would be too small by the square root of two.
pub(super) fn drop_copies(frfs: &mut Vec<FrfRecord>, notes: &mut Notes) {
    use std::collections::HashMap;
    let key = |frf: &FrfRecord| {
        let first = frf.frequency_hz.first().copied().unwrap_or(0.0).to_bits();
        (frf.response, frf.reference, frf.frequency_hz.len(), first)
    };
    let mut seen: HashMap<_, Vec<usize>> = HashMap::new();
    let mut copies = Vec::new();
    for k in 0..frfs.len() {
        let alike = seen.entry(key(&frfs[k])).or_default();
        match alike.iter().find(|j| same_data(&frfs[**j], &frfs[k])) {
            Some(j) if frfs[*j].response.is_some() || frfs[*j].name == frfs[k].name => copies.push(k),
            Some(j) => {
                let earlier = frfs[*j].name.clone();
                notes.about(
                    &frfs[k].name,
                    format!("the same data as {earlier}: exported twice under two names?"),
                );
                alike.push(k);
            }
            None => alike.push(k),
        }
    }
    for k in copies.into_iter().rev() {
        let copy = frfs.remove(k);
        notes.about(&copy.name, "the same data twice in this file: used once");
    }
}

/// True for the same measurement, as written by one program with other digits: the values agree within single precision.
pub fn same_data(a: &FrfRecord, b: &FrfRecord) -> bool {
    const SINGLE: f64 = 1e-6;
    let largest = a.value.iter().fold(0.0_f64, |most, v| most.max(v.norm()));
    a.quantity == b.quantity
        && a.value.len() == b.value.len()
        && a.value
            .iter()
            .zip(&b.value)
            .all(|(a, b)| (a - b).norm() <= SINGLE * largest)
        && a.frequency_hz
            .iter()
            .zip(&b.frequency_hz)
            .all(|(a, b)| (a - b).abs() <= SINGLE * a)
}

/// Ascending finite lines from 0 Hz on; `None` where nothing is left.
///
/// # Errors
/// A frequency or value beyond all that can be measured, with its line.
pub(super) fn tidy_frf(mut record: FrfRecord, notes: &mut Notes) -> Result<Option<FrfRecord>, InputError> {
    let lines = record.frequency_hz.iter().zip(&record.value);
    // What analysers write at 0 Hz is left out further on.
    let absurd = |f: f64, v: f64| {
        f.is_finite() && v.is_finite() && (f > LARGEST_FREQUENCY_HZ || v > LARGEST_VALUE && f != 0.0)
    };
    if let Some((f, v)) = lines.map(|(f, v)| (*f, v.norm())).find(|(f, v)| absurd(*f, *v)) {
        return Err(
            InputError::new(format!("{}: {v:e} at {f:e} Hz is no measured value", record.name))
                .remedy("the file is damaged, or its unit or scale is wrong: export it again"),
        );
    }
    // Wherever in the file that line stands.
    for (f, v) in record.frequency_hz.iter().zip(&mut record.value) {
        if *f == 0.0 && !(v.norm() <= LARGEST_VALUE) {
            *v = num_complex::Complex64::new(f64::NAN, 0.0);
        }
    }
    let count = record.frequency_hz.len().min(record.value.len());
    let finite = |&i: &usize| record.frequency_hz[i].is_finite() && record.value[i].is_finite();
    let mut lines: Vec<usize> = (0..count).filter(finite).collect();
    if lines.len() < count {
        notes.about(
            &record.name,
            format!("{} lines without a valid number left out", count - lines.len()),
        );
    }
    let before = lines.len();
    lines.retain(|&i| record.frequency_hz[i] >= 0.0);
    if lines.len() < before {
        notes.about(
            &record.name,
            format!("{} lines of negative frequency left out", before - lines.len()),
        );
    }
    if !lines.is_sorted_by(|&a, &b| record.frequency_hz[a] < record.frequency_hz[b]) {
        lines.sort_by(|&a, &b| record.frequency_hz[a].total_cmp(&record.frequency_hz[b]));
        lines.dedup_by(|a, b| record.frequency_hz[*a] == record.frequency_hz[*b]);
        notes.about(
            &record.name,
            "frequencies were not ascending: lines sorted, repeated ones left out",
        );
    }
    if lines.is_empty() {
        notes.about(&record.name, "no usable line: FRF left out");
        return Ok(None);
    }
    if lines.len() < count || !lines.is_sorted() || record.frequency_hz.len() != record.value.len() {
        record.coherence = record
            .coherence
            .map(|c| lines.iter().map(|&i| c.get(i).copied().unwrap_or(0.0)).collect());
        record.frequency_hz = lines.iter().map(|&i| record.frequency_hz[i]).collect();
        record.value = lines.iter().map(|&i| record.value[i]).collect();
    }
    if let ([0.0, ..], [first, next, ..]) = (record.frequency_hz.as_slice(), record.value.as_slice())
        && first.norm() > 100.0 * next.norm()
    {
        notes.about(
            &record.name,
            "the 0 Hz line is invalid (far above its neighbour): do not use it",
        );
    }
    look_at_signs(&record, notes);
    Ok(Some(record))
}

/// Lines needed before the signs of an FRF say anything.
const LINES_FOR_SIGNS: usize = 16;

/// A driving point that takes in energy has Im H ≤ 0 (receptance), Re H ≥ 0 (mobility) or Im H ≥ 0
/// (accelerance), and with time factor exp(+iωt) its Nyquist loops run clockwise. Loops that run the other way
/// mean a conjugated FRF; loops that run rightly with the wrong sign mean an inverted channel or a wrong
/// quantity (accelerance = −ω² receptance).
fn look_at_signs(record: &FrfRecord, notes: &mut Notes) {
    let (Some(response), Some(reference)) = (record.response, record.reference) else {
        return;
    };
    if (response.node, response.axis) != (reference.node, reference.axis)
        || record.value.len() < LINES_FOR_SIGNS
    {
        return;
    }
    let side = if response.negative == reference.negative {
        1.0
    } else {
        -1.0
    };
    let (mut loss, mut energy, mut turn, mut turned) = (0.0, 0.0, 0.0, 0.0);
    let skip = usize::from(record.frequency_hz.first() == Some(&0.0));
    for (i, value) in record.value.iter().enumerate().skip(skip) {
        // Negative where the point takes in energy.
        loss += value.norm()
            * side
            * match record.quantity {
                Some(Quantity::Receptance) => value.im,
                Some(Quantity::Mobility) => -value.re,
                Some(Quantity::Accelerance) => -value.im,
                None => 0.0,
            };
        energy += value.norm_sqr();
        if let Some(next) = record.value.get(i + 1) {
            let area = (value.conj() * next).im;
            turn += area;
            turned += area.abs();
        }
    }
    if energy == 0.0 || turned == 0.0 {
        return;
    }
    let (loss, turn) = (loss / energy, turn / turned);
    let wrong_sign = loss > 0.3;
    let phase_blind = matches!(record.quantity, Some(Quantity::Mobility) | None);
    if turn > 0.3 && (wrong_sign || phase_blind) {
        notes.about(
            &record.name,
            "looks conjugated (loops run counter-clockwise, which is negative damping): the analyser uses exp(-iωt)",
        );
    } else if turn < -0.3 && wrong_sign {
        notes.about(
            &record.name,
            "a driving point with the wrong sign: inverted sensor or hammer, or another quantity than the file says",
        );
    }
}

/// Coherence values on the lines of an FRF; `None` where they are on other lines or no coherence at all.
pub(super) fn on_lines(frequency_hz: &[f64], own_frequency_hz: &[f64], values: &[f64]) -> Option<Vec<f64>> {
    let mut own = own_frequency_hz.iter().zip(values);
    let at = |f: &f64| {
        let (_, value) = own.find(|(own, _)| (**own - f).abs() <= 1e-6 * f.abs())?;
        match (-0.01..=1.01).contains(value) {
            true => Some(value.clamp(0.0, 1.0)),
            // What an analyser writes at 0 Hz says nothing.
            false => (*f == 0.0).then_some(0.0),
        }
    };
    frequency_hz.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Dof;
    use num_complex::Complex64;

    /// Driving point of one mode, 10 Hz, 3 %.
    fn mode(change: impl Fn(f64, Complex64) -> Complex64, quantity: Quantity) -> Vec<String> {
        let dof: Dof = "1X".parse().unwrap();
        let frequency_hz: Vec<f64> = (0..100).map(|i| 0.2 * f64::from(i)).collect();
        let value = frequency_hz
            .iter()
            .map(|f| change(*f, 1.0 / Complex64::new(100.0 - f * f, 0.6 * f)))
            .collect();
        let record = FrfRecord {
            name: "1X/1X".into(),
            response: Some(dof),
            reference: Some(dof),
            quantity: Some(quantity),
            frequency_hz,
            value,
            coherence: None,
        };
        let mut notes = Notes::default();
        assert_eq!(tidy_frf(record, &mut notes).unwrap().unwrap().value.len(), 100);
        notes.into_warnings()
    }

    #[test]
    fn right_signs_are_left_alone() {
        let i = Complex64::I;
        assert!(mode(|_, h| h, Quantity::Receptance).is_empty());
        assert!(mode(|f, h| h * i * f, Quantity::Mobility).is_empty());
        assert!(mode(|f, h| -h * f * f, Quantity::Accelerance).is_empty());
    }

    #[test]
    fn conjugated_inverted_and_mislabelled_ones_are_told_apart() {
        for (warnings, what) in [
            (mode(|_, h| h.conj(), Quantity::Receptance), "conjugated"),
            (
                mode(|f, h| (h * Complex64::I * f).conj(), Quantity::Mobility),
                "conjugated",
            ),
            (
                mode(|f, h| -h.conj() * f * f, Quantity::Accelerance),
                "conjugated",
            ),
            (mode(|_, h| -h, Quantity::Receptance), "wrong sign"),
            (mode(|f, h| -h * f * f, Quantity::Receptance), "wrong sign"),
        ] {
            assert!(
                warnings.len() == 1 && warnings[0].contains(what),
                "{what}: {warnings:?}"
            );
        }
    }

    #[test]
    fn invalid_and_disordered_lines() {
        let line = |f: f64, v: f64| (f, Complex64::new(v, 0.0));
        let lines = [
            line(3.0, 3.0),
            line(-1.0, 9.0),
            line(2.0, f64::NAN),
            line(1.0, 1.0),
            line(3.0, 4.0),
        ];
        let record = FrfRecord {
            name: "a".into(),
            response: None,
            reference: None,
            quantity: None,
            frequency_hz: lines.iter().map(|l| l.0).collect(),
            value: lines.iter().map(|l| l.1).collect(),
            coherence: Some(vec![0.3, 0.9, 0.2, 0.1, 0.4]),
        };
        let mut notes = Notes::default();
        let record = tidy_frf(record, &mut notes).unwrap().unwrap();
        assert_eq!(record.frequency_hz, [1.0, 3.0]);
        assert_eq!(record.value, [Complex64::new(1.0, 0.0), Complex64::new(3.0, 0.0)]);
        assert_eq!(record.coherence, Some(vec![0.1, 0.3]));
        assert_eq!(notes.into_warnings().len(), 3);
    }

    fn plain(name: &str, dof: Option<&str>, values: &[f64]) -> FrfRecord {
        let dof = dof.map(|d| d.parse().unwrap());
        FrfRecord {
            name: name.into(),
            response: dof,
            reference: dof,
            quantity: None,
            frequency_hz: (1..=values.len()).map(|f| f as f64).collect(),
            value: values.iter().map(|v| Complex64::new(*v, 0.0)).collect(),
            coherence: None,
        }
    }

    #[test]
    fn copies_are_used_once_and_measurements_kept() {
        let mut frfs = vec![
            plain("1X/1X", Some("1X"), &[1.0, 2.0]),
            plain("1X/1X", Some("1X"), &[1.0, 2.000001]),
            plain("1X/1X", Some("1X"), &[1.0, 2.001]),
            plain("2X/2X", Some("2X"), &[1.0, 2.0]),
            plain("a", None, &[1.0, 2.0]),
            plain("b", None, &[1.0, 2.0]),
        ];
        let mut notes = Notes::default();
        drop_copies(&mut frfs, &mut notes);
        let names: Vec<&str> = frfs.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["1X/1X", "1X/1X", "2X/2X", "a", "b"]);
        let told = notes.into_warnings();
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(
            told[0].contains("b: the same data as a") && told[1].contains("used once"),
            "{told:?}"
        );
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        let mut notes = Notes::default();
        let error = tidy_frf(plain("h", None, &[1.0, 1e300]), &mut notes).unwrap_err();
        assert!(error.problem.contains("h: 1e300 at 2e0 Hz"), "{error}");
        let mut at_zero = plain("h", None, &[1e300, 1.0]);
        at_zero.frequency_hz = vec![0.0, 1.0];
        let kept = tidy_frf(at_zero, &mut notes).unwrap().unwrap();
        assert_eq!(kept.frequency_hz, [1.0]);
        assert!(plausible_samples("Fx", &[1e14, -1e14]).is_ok());
        for bad in [f64::NAN, f64::INFINITY, -1e300] {
            assert!(
                plausible_samples("Fx", &[0.0, bad])
                    .unwrap_err()
                    .problem
                    .contains("sample 2")
            );
        }
        for rate in [0.0, f64::INFINITY, f64::NAN, -1.0, 1e300, 1e-300] {
            assert!(plausible_clock("Fx", rate, 0.0).is_err(), "{rate}");
        }
        assert!(plausible_clock("Fx", 1e4, f64::INFINITY).is_err());
        assert!(plausible_clock("Fx", 1e4, -3.0).is_ok());
    }

    #[test]
    fn coherence_follows_the_lines() {
        assert_eq!(
            on_lines(&[1.0, 3.0], &[1.0, 2.0, 3.0], &[0.5, 0.6, 1.001]),
            Some(vec![0.5, 1.0])
        );
        assert_eq!(on_lines(&[1.0, 4.0], &[1.0, 2.0, 3.0], &[0.5, 0.6, 0.7]), None);
        assert_eq!(on_lines(&[1.0], &[1.0], &[7.0]), None);
    }
}
