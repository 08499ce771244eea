//! What every FRF goes through after reading: lines put in order, values that are none left out, signs looked at.

use super::text::Notes;
use super::{FrfRecord, Quantity};

/// Ascending finite lines from 0 Hz on; `None` where nothing is left.
pub(super) fn tidy_frf(mut record: FrfRecord, notes: &mut Notes) -> Option<FrfRecord> {
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
        return None;
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
    Some(record)
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
    use super::super::Dof;
    use super::*;
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
        assert_eq!(tidy_frf(record, &mut notes).unwrap().value.len(), 100);
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
        let record = tidy_frf(record, &mut notes).unwrap();
        assert_eq!(record.frequency_hz, [1.0, 3.0]);
        assert_eq!(record.value, [Complex64::new(1.0, 0.0), Complex64::new(3.0, 0.0)]);
        assert_eq!(record.coherence, Some(vec![0.1, 0.3]));
        assert_eq!(notes.into_warnings().len(), 3);
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
