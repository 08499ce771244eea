//! Numbers as people read them: significant digits, SI prefixes, value ± standard error.

/// What stands for a number that does not exist (NaN, infinite, not measured).
pub const MISSING: &str = "–";

/// `value` with `digits` significant digits: `1234.5678` → `1235`, `0.00012345` → `1.23·10⁻⁴` (3 digits).
///
/// Plain notation between 10⁻³ and 10⁶, a power of ten outside.
pub fn significant(value: f64, digits: usize) -> String {
    let digits = digits.clamp(1, 15);
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    // Let the formatter round first: 9.996 to three digits is 10.0, one order up.
    let scientific = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if (-3..6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        minus(&format!("{value:.decimals$}"))
    } else {
        format!("{}·10{}", minus(mantissa), superscript(exponent))
    }
}

/// A fixed number of decimals with a true minus sign, a power of ten from 10¹⁵ on; `–` where there is no number.
pub fn decimals(value: f64, decimals: usize) -> String {
    if !value.is_finite() || value.abs() >= 1e15 {
        // Hundreds of digits help nobody.
        return significant(value, 3);
    }
    let text = format!("{value:.decimals$}");
    // "-0.00" says nothing that "0.00" does not.
    let is_zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    if is_zero {
        text.trim_start_matches('-').to_owned()
    } else {
        minus(&text)
    }
}

/// A ratio as percent: `0.1234` → `12.3 %` (with a no-break space).
pub fn percent(ratio: f64) -> String {
    let value = 100.0 * ratio;
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    let places = match value.abs() {
        v if v >= 99.95 => 0,
        v if v >= 9.995 => 1,
        v if v >= 0.9995 || v == 0.0 => 2,
        _ => 3,
    };
    format!("{}\u{a0}%", decimals(value, places))
}

/// `value` with an SI prefix on `unit`: `2.53e6, "N/m"` → `2.53 MN/m`.
///
/// Units that bear no prefix (none, degrees, percent, `kg`, anything already prefixed by the lab) keep their number.
pub fn format_si(value: f64, unit: &str, digits: usize) -> String {
    let (scaled, prefix) = match value.is_finite() {
        true => prefixed(value, unit, digits),
        false => (value, ""),
    };
    join(&significant(scaled, digits), &format!("{prefix}{unit}"))
}

/// `value ± standard error` in `unit`, both rounded where the error has no more meaning:
/// `(1.23456e6, 2.1e3)` → `1.2346 ± 0.0021 MN·m/rad`, `(47.26702, 0.00086)` → `47.2670 ± 0.0009 Hz`.
pub fn plus_minus(value: f64, std_error: f64, unit: &str) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    if !std_error.is_finite() || std_error <= 0.0 {
        return format_si(value, unit, 4);
    }
    // Of what will stand there: −980 ± 700 ns is rounded to hundreds, which are tenths of µs.
    let size = {
        let size = value.abs().max(std_error);
        let rounded = (size / last_place(std_error)).round() * last_place(std_error);
        if rounded.is_normal() { rounded } else { size }
    };
    let (scaled, prefix) = prefixed(size, unit, 4);
    let (value, error) = (value * (scaled / size), std_error * (scaled / size));
    join(&with_error(value, error), &format!("{prefix}{unit}"))
}

/// `value ± error` as bare numbers, rounded by the error, which keeps two digits where it begins with less than 3.55 and one
/// otherwise (Particle Data Group, Review of Particle Physics, introduction 5.3); one power of ten for both where they are
/// very large or small.
pub fn with_error(value: f64, error: f64) -> String {
    if !value.is_finite() {
        return MISSING.to_owned();
    }
    // An error that no digit of the value could show is none.
    if !(error.is_finite() && error > 1e-12 * value.abs() && error > 0.0) {
        return significant(value, 5);
    }
    let power = value.abs().max(error).log10().floor() as i32;
    if !(-3..6).contains(&power) {
        let scale = 10f64.powi(power);
        return match scale > 0.0 && scale.is_finite() {
            true => format!(
                "({})·10{}",
                rounded(value / scale, error / scale),
                superscript(power)
            ),
            false => significant(value, 4),
        };
    }
    rounded(value, error)
}

/// The same with the error in brackets, in units of the last digit, where it is smaller than 1: `47.2670(9)`, `2.963(10)`.
/// Short, for tables of many columns.
pub fn concise(value: f64, error: f64) -> String {
    let long = with_error(value, error);
    match long.split_once(" ± ") {
        Some((value, small)) if !long.starts_with('(') => {
            let digits = small.strip_prefix("0.").map(|d| d.trim_start_matches('0'));
            match digits {
                Some(digits) if !digits.is_empty() => format!("{value}({digits})"),
                _ => long,
            }
        }
        _ => long,
    }
}

/// Decimal places that an error leaves a value, negative for tens and hundreds.
fn places(error: f64) -> i32 {
    let order = error.log10().floor() as i32;
    let two_digits = error / 10f64.powi(order) < 3.55;
    if two_digits { 1 - order } else { -order }
}

fn last_place(error: f64) -> f64 {
    10f64.powi(-places(error))
}

fn rounded(value: f64, error: f64) -> String {
    let places = places(error);
    // Tens and hundreds are rounded, too.
    let step = 10f64.powi((-places).max(0));
    let text = |v: f64| decimals((v / step).round() * step, 0);
    match places {
        ..=0 => format!("{} ± {}", text(value), text(error)),
        _ => format!(
            "{} ± {}",
            decimals(value, places as usize),
            decimals(error, places as usize)
        ),
    }
}

fn join(number: &str, unit: &str) -> String {
    match unit {
        // A bare number, whose unit is 1 in documents for programs.
        "" | "1" => number.to_owned(),
        // As people write it; documents for programs say deg.
        "deg" => format!("{number}\u{a0}°"),
        // A no-break space keeps number and unit on one line.
        _ => format!("{number}\u{a0}{unit}"),
    }
}

/// The value in the unit with the prefix that suits it.
fn prefixed(value: f64, unit: &str, digits: usize) -> (f64, &'static str) {
    match takes_prefix(unit) {
        // Nobody counts in kiloseconds.
        true if unit == "s" && value.abs() >= 1.0 => (value, ""),
        true => si_prefix(value, digits),
        false => (value, ""),
    }
}

/// Whether a prefix may be put before the unit: only SI units the toolkit itself writes. Coefficients of cutting are in N/mm² and N/mm
/// wherever they are printed.
fn takes_prefix(unit: &str) -> bool {
    ["N", "m", "Pa", "Hz", "s", "W", "J"]
        .iter()
        .any(|base| match unit.strip_prefix(base) {
            // "m" is the metre, "mm" is not; "N·m/rad" and "m/N" are fine. A power of the unit is not:
            // 10⁶ m² is no "Mm²".
            Some(rest) => {
                let is_more = |c: char| c.is_alphanumeric() || c == '²' || c == '³' || c == '^';
                !rest.starts_with(is_more) && !rest.contains("/mm")
            }
            None => false,
        })
}

fn si_prefix(value: f64, digits: usize) -> (f64, &'static str) {
    const PREFIXES: [(i32, &str); 9] = [
        (-12, "p"),
        (-9, "n"),
        (-6, "µ"),
        (-3, "m"),
        (0, ""),
        (3, "k"),
        (6, "M"),
        (9, "G"),
        (12, "T"),
    ];
    if value == 0.0 {
        return (value, "");
    }
    // The exponent after rounding, so that 999.9996 becomes 1.000 k and not 1000.
    let exponent = format!("{value:.*e}", digits.clamp(1, 15) - 1)
        .split_once('e')
        .and_then(|(_, exponent)| exponent.parse::<i32>().ok())
        .unwrap_or(0);
    let step = exponent.div_euclid(3) * 3;
    match PREFIXES.iter().find(|(power, _)| *power == step) {
        Some((power, prefix)) => (value / 10f64.powi(*power), prefix),
        None => (value, ""),
    }
}

/// `-12` → `⁻¹²`.
pub fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    exponent
        .to_string()
        .chars()
        .map(|c| {
            c.to_digit(10)
                .and_then(|d| DIGITS.get(d as usize).copied())
                .unwrap_or('⁻')
        })
        .collect()
}

fn minus(text: &str) -> String {
    text.replacen('-', "−", 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn significant_digits_round_across_the_decade() {
        assert_eq!(significant(1234.5678, 3), "1235");
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(-0.012345, 3), "−0.0123");
        assert_eq!(significant(1.2345e-4, 3), "1.23·10⁻⁴");
        assert_eq!(significant(-2.5e12, 2), "−2.5·10¹²");
        assert_eq!(significant(0.0, 3), "0");
        assert_eq!(significant(f64::NAN, 3), MISSING);
        assert_eq!(significant(f64::INFINITY, 0), MISSING);
    }

    #[test]
    fn prefixes_go_only_where_they_mean_something() {
        assert_eq!(format_si(2.531e6, "N·m/rad", 3), "2.53\u{a0}MN·m/rad");
        assert_eq!(format_si(3.1e-7, "m/N", 2), "310\u{a0}nm/N");
        assert_eq!(format_si(999.9996, "N", 4), "1.000\u{a0}kN");
        assert_eq!(format_si(1250.0, "kg", 4), "1250\u{a0}kg");
        assert_eq!(format_si(0.012, "mm", 2), "0.012\u{a0}mm");
        assert_eq!(format_si(0.012, "", 2), "0.012");
        assert_eq!(format_si(0.0, "Hz", 2), "0\u{a0}Hz");
    }

    #[test]
    fn the_error_sets_the_digits_of_the_value() {
        assert_eq!(
            plus_minus(1.23456e6, 2.1e3, "N·m/rad"),
            "1.2346 ± 0.0021\u{a0}MN·m/rad"
        );
        assert_eq!(plus_minus(-1014.23, 12.3, "N/mm²"), "−1014 ± 12\u{a0}N/mm²");
        assert_eq!(plus_minus(0.02, 0.3, ""), "0.02 ± 0.30");
        assert_eq!(plus_minus(5.0, f64::NAN, "kg"), "5.000\u{a0}kg");
        assert_eq!(plus_minus(f64::NAN, 1.0, "kg"), MISSING);
        assert_eq!(plus_minus(0.0, 2.0, "N"), "0.0 ± 2.0\u{a0}N");
        assert_eq!(plus_minus(47.26702, 0.00086, "Hz"), "47.2670 ± 0.0009\u{a0}Hz");
        assert_eq!(plus_minus(-9.8e-7, 7e-7, "s"), "−1.0 ± 0.7\u{a0}µs");
        assert_eq!(plus_minus(-9.8e-7, 1e-8, "s"), "−980 ± 10\u{a0}ns");
        assert_eq!(plus_minus(9e10, 14e10, "s"), "(0.9 ± 1.4)·10¹¹\u{a0}s");
        assert_eq!(with_error(2.458e-4, 4e-2), "0.00 ± 0.04");
        assert_eq!(with_error(929.782, 0.59), "929.8 ± 0.6");
        assert_eq!(with_error(929.782, 5.9), "930 ± 6");
        assert_eq!(with_error(929.782, 59.0), "930 ± 60");
        assert_eq!(with_error(929.782, 0.354), "929.78 ± 0.35");
        assert_eq!(with_error(929.782, 0.0097), "929.782 ± 0.010");
        assert_eq!(with_error(-2.4583e-7, 4.1e-9), "(−2.46 ± 0.04)·10⁻⁷");
        assert_eq!(with_error(929.782, f64::NAN), "929.78");
        assert_eq!(with_error(f64::NAN, 1.0), MISSING);
        assert_eq!(with_error(1e300, 1e-300), "1.0000·10³⁰⁰");
        assert_eq!(with_error(1e300, f64::MIN_POSITIVE), "1.0000·10³⁰⁰");
        assert_eq!(with_error(0.0, 1e300), "(0.0 ± 1.0)·10³⁰⁰");
        assert_eq!(with_error(0.0, 5e-324), "0");
    }

    #[test]
    fn an_error_in_brackets_counts_in_the_last_digit() {
        for (value, error, text) in [
            (47.26702, 0.00086, "47.2670(9)"),
            (2.9631, 0.0101, "2.963(10)"),
            (88.58, 0.12, "88.58(12)"),
            (120.0, 4.0, "120 ± 4"),
            (7.1234, f64::NAN, "7.1234"),
        ] {
            assert_eq!(concise(value, error), text);
        }
    }

    #[test]
    fn percentages_keep_three_digits() {
        assert_eq!(percent(0.1234), "12.3\u{a0}%");
        assert_eq!(percent(0.00021), "0.021\u{a0}%");
        assert_eq!(percent(3.5), "350\u{a0}%");
        assert_eq!(percent(-0.0), "0.00\u{a0}%");
        assert_eq!(percent(1e300), "1.00·10³⁰²\u{a0}%");
        assert_eq!(percent(f64::NAN), MISSING);
    }
}
