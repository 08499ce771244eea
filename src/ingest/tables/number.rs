//! Numbers as lab files print them: decimal point or comma, Fortran `D` exponents, `1.#QNAN`.

/// Powers of ten that `f64` holds exactly; with a mantissa below 2⁵³ one multiplication or division then
/// gives the correctly rounded value (Clinger 1990, "How to read floating point numbers accurately").
const EXACT_POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18,
    1e19, 1e20, 1e21, 1e22,
];

/// Reads the number that starts at `start` and gives it with the position after it; `None` where no number
/// starts there. Text such as `NaN`, `inf` or `1.#QNAN` reads as NaN, an overflow as infinity: callers must
/// test `is_finite`.
pub fn scan(bytes: &[u8], start: usize, decimal: u8) -> Option<(f64, usize)> {
    let mut at = start;
    let negative = match bytes.get(at) {
        Some(b'-') => {
            at += 1;
            true
        }
        Some(b'+') => {
            at += 1;
            false
        }
        _ => false,
    };
    let mut mantissa = 0_u64;
    let mut digits = 0_usize;
    let mut fraction_digits = 0_i32;
    let mut seen_decimal = false;
    while let Some(&byte) = bytes.get(at) {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            digits += 1;
            fraction_digits += i32::from(seen_decimal);
        } else if byte == decimal && !seen_decimal {
            seen_decimal = true;
        } else {
            break;
        }
        at += 1;
    }
    if digits == 0 {
        return scan_word(bytes, at).map(|end| (f64::NAN, end));
    }
    if bytes.get(at) == Some(&b'#') {
        let end = at
            + bytes[at..]
                .iter()
                .take_while(|b| b.is_ascii_alphanumeric() || **b == b'#')
                .count();
        return Some((f64::NAN, end));
    }
    let mantissa_end = at;
    let (exponent, end) = scan_exponent(bytes, at).unwrap_or((0, at));
    let power = exponent.saturating_sub(fraction_digits);
    let value = if digits <= 19 && mantissa < 1 << 53 && power.unsigned_abs() <= 22 {
        let scale = EXACT_POWERS[power.unsigned_abs() as usize];
        if power < 0 {
            mantissa as f64 / scale
        } else {
            mantissa as f64 * scale
        }
    } else {
        let plain = decimal == b'.' && !matches!(bytes.get(mantissa_end), Some(b'd' | b'D'));
        let text = plain
            .then(|| std::str::from_utf8(&bytes[start..end]).ok())
            .flatten();
        text.and_then(|t| t.parse().ok())
            .or_else(|| slow(&bytes[start..mantissa_end], decimal, exponent))?
    };
    // The slow way reads the sign itself.
    Some((if negative { -value.abs() } else { value }, end))
}

/// Reads the plain number that starts at `start`: a sign, up to seven digits, the decimal sign and up to seven more, as
/// recorders print samples. Eight digits are read at a time, without a branch for each. `None` for all else (exponents, words,
/// more digits, less than eight bytes to the end of the data), which [`scan`] reads; the values of both are the same.
#[inline]
pub fn scan_plain(bytes: &[u8], start: usize, decimal: u8) -> Option<(f64, usize)> {
    let negative = *bytes.get(start)? == b'-';
    let whole_at = start + usize::from(negative);
    let (whole, whole_digits) = digits(bytes, whole_at)?;
    let mut at = whole_at + whole_digits;
    let (mut mantissa, mut fraction_digits) = (whole, 0);
    if *bytes.get(at)? == decimal {
        let fraction;
        (fraction, fraction_digits) = digits(bytes, at + 1)?;
        // At most 14 digits: exact in `f64`, as is the power.
        mantissa = whole * POWERS[fraction_digits] + fraction;
        at += 1 + fraction_digits;
    }
    if whole_digits + fraction_digits == 0 || matches!(bytes.get(at)?, b'e' | b'E' | b'd' | b'D' | b'#') {
        return None;
    }
    let value = mantissa as f64 / EXACT_POWERS[fraction_digits];
    Some((if negative { -value } else { value }, at))
}

const POWERS: [u64; 8] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000];

/// The digits that begin at `at` and how many they are; `None` for eight or more.
///
/// Eight bytes as one word: what is no digit is found by carries into the top bit of its byte, neighbours are joined by
/// multiplication (Lemire 2018, "Quickly parsing eight digits"; here with fewer digits moved up behind zeros).
#[inline]
fn digits(bytes: &[u8], at: usize) -> Option<(u64, usize)> {
    const EACH: u64 = 0x0101_0101_0101_0101;
    let word = u64::from_le_bytes(*bytes.get(at..)?.first_chunk::<8>()?) ^ (u64::from(b'0') * EACH);
    // A digit is now 0 to 9: adding 118 reaches the top bit from 10 on; bytes above 127 have it set already. A carry out of
    // a byte spoils only bytes behind the first that is no digit.
    let others = (word.wrapping_add(118 * EACH) | word) & (0x80 * EACH);
    let count = (others.trailing_zeros() / 8) as usize;
    if count == 8 {
        return None;
    }
    // Two shifts: by 64 at once there would be no result for no digits.
    let word = (word << (8 * (7 - count))) << 8;
    let pairs = (word.wrapping_mul(10) + (word >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100) + (pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    let all = (fours.wrapping_mul(10_000) + (fours >> 32)) & 0xFFFF_FFFF;
    Some((all, count))
}

/// A whole field, blanks around it allowed; `None` where it is not one number.
pub fn field(bytes: &[u8], decimal: u8) -> Option<f64> {
    let bytes = bytes.trim_ascii();
    let (value, end) = scan(bytes, 0, decimal)?;
    if end == bytes.len() {
        return Some(value);
    }
    // Fortran drops the E before a three-digit exponent: `1.23456-101`.
    let rest = &bytes[end..];
    let exponent = matches!(rest.first(), Some(b'-' | b'+')) && rest.len() == 4;
    let digits = exponent && rest[1..].iter().all(u8::is_ascii_digit);
    if !digits || bytes[..end].iter().any(u8::is_ascii_alphabetic) {
        return None;
    }
    let exponent = std::str::from_utf8(rest).ok()?.parse::<i32>().ok()?;
    slow(&bytes[..end], decimal, exponent)
}

fn scan_exponent(bytes: &[u8], at: usize) -> Option<(i32, usize)> {
    if !matches!(bytes.get(at), Some(b'e' | b'E' | b'd' | b'D')) {
        return None;
    }
    let mut at = at + 1;
    let negative = match bytes.get(at) {
        Some(b'-') => {
            at += 1;
            true
        }
        Some(b'+') => {
            at += 1;
            false
        }
        _ => false,
    };
    let first = at;
    let mut exponent = 0_i32;
    while let Some(digit) = bytes.get(at).map(|b| b.wrapping_sub(b'0')).filter(|d| *d < 10) {
        exponent = exponent
            .saturating_mul(10)
            .saturating_add(i32::from(digit))
            .min(100_000);
        at += 1;
    }
    (at > first).then_some((if negative { -exponent } else { exponent }, at))
}

/// `nan`, `inf`, `infinity` and Fortran's stars for a number too wide for its column.
fn scan_word(bytes: &[u8], at: usize) -> Option<usize> {
    let stars = bytes[at.min(bytes.len())..]
        .iter()
        .take_while(|b| **b == b'*')
        .count();
    if stars > 1 {
        return Some(at + stars);
    }
    let letters = bytes
        .get(at..)?
        .iter()
        .take_while(|b| b.is_ascii_alphabetic())
        .count();
    let word = &bytes[at..at + letters];
    let known = ["nan", "inf", "infinity"];
    known
        .iter()
        .any(|k| word.eq_ignore_ascii_case(k.as_bytes()))
        .then_some(at + letters)
}

/// Any length and exponent, by the standard library.
fn slow(mantissa: &[u8], decimal: u8, exponent: i32) -> Option<f64> {
    let mut text: String = mantissa
        .iter()
        .map(|&b| if b == decimal { '.' } else { char::from(b) })
        .collect();
    text.push_str(&format!("e{exponent}"));
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reads_what_lab_files_print() {
        for (text, decimal, value) in [
            ("0", b'.', 0.0),
            (" -24,89 ", b',', -24.89),
            ("1.23D-05", b'.', 1.23e-5),
            ("-3.09944E-004", b'.', -3.09944e-4),
            ("+.5", b'.', 0.5),
            ("5.", b'.', 5.0),
            ("3.93700787401574814D+01", b'.', 39.370_078_740_157_48),
            ("1.23456-101", b'.', 1.23456e-101),
            ("123456789012345678901234567890", b'.', 1.2345678901234568e29),
        ] {
            assert_eq!(field(text.as_bytes(), decimal), Some(value), "{text}");
        }
        for text in ["", "-", "1.2.3", "1,2", "e5", "12a", "1e", "0x10", "--1"] {
            assert_eq!(field(text.as_bytes(), b'.'), None, "{text}");
        }
        for text in ["NaN", "-inf", "1.#QNAN", "*******"] {
            assert!(field(text.as_bytes(), b'.').is_some_and(f64::is_nan), "{text}");
        }
    }

    #[test]
    fn stops_where_the_next_column_begins() {
        assert_eq!(
            scan(b"-3.09944E-004-2.74181E-004", 0, b'.'),
            Some((-3.09944e-4, 13))
        );
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_library(value in any::<f64>().prop_filter("finite", |v| v.is_finite()), digits in 0_usize..18) {
            for text in [format!("{value:.digits$e}"), format!("{value}"), format!("{value:e}")] {
                let read = field(text.as_bytes(), b'.').unwrap();
                prop_assert_eq!(read.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{}", text);
            }
        }

        #[test]
        fn the_quick_way_agrees_with_the_thorough_one(
            text in "[+-]?[0-9]{0,9}[.,]?[0-9]{0,9}([eEdD#][+-]?[0-9]{0,3})?[,; \n\r\t.:/]?[ -~]{0,12}", decimal in prop::sample::select(vec![b'.', b',']),
        ) {
            if let Some((value, end)) = scan_plain(text.as_bytes(), 0, decimal) {
                let thorough = scan(text.as_bytes(), 0, decimal);
                prop_assert_eq!(thorough.map(|(v, e)| (v.to_bits(), e)), Some((value.to_bits(), end)), "{}", text);
            }
        }

        #[test]
        fn the_quick_way_reads_what_recorders_print(value in -9_999_999.0..9_999_999.0, places in 0_usize..8) {
            let text = format!("{value:.places$};-0.001;");
            let end = text.find(';').unwrap();
            let expected: f64 = text[..end].parse().unwrap();
            prop_assert_eq!(scan_plain(text.as_bytes(), 0, b'.').map(|(v, e)| (v.to_bits(), e)), Some((expected.to_bits(), end)));
        }

        #[test]
        fn never_panics(bytes in prop::collection::vec(any::<u8>(), 0..30), start in 0_usize..40) {
            let _ = scan(&bytes, start, b',');
            let _ = scan_plain(&bytes, start, b',');
            let _ = field(&bytes, b'.');
        }
    }
}
