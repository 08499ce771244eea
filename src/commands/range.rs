//! Ranges on the command line: FROM:TO.

/// A range of frequencies in Hz.
///
/// # Errors
/// No such range, in a sentence for the command line.
pub fn band(text: &str) -> std::result::Result<[f64; 2], String> {
    let number = |t: &str| {
        t.trim()
            .parse::<f64>()
            .ok()
            .filter(|x| x.is_finite() && *x >= 0.0)
    };
    // With a comma it was written before.
    let ends = text.split_once(':').or_else(|| text.split_once(','));
    match ends.map(|(from, to)| (number(from), number(to))) {
        Some((Some(from), Some(to))) if from < to => Ok([from, to]),
        _ => Err("give the band as FROM:TO in Hz, such as 3:60".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_goes_up() {
        assert_eq!(band("3:60"), Ok([3.0, 60.0]));
        assert_eq!(band(" 3 , 60.5"), Ok([3.0, 60.5]));
        for wrong in ["60:3", "3", "3:3", "-1:5", "NaN:9", "3:inf", "3:60:1", "a:b", ""] {
            assert!(band(wrong).is_err(), "{wrong}");
        }
    }
}
