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
/// recorders print samples. Eight bytes are read at a time, without a branch for each. `None` for all else (exponents, words,
/// more digits, less than eight bytes to the end of the data), which [`scan`] reads; the values of both are the same.
#[inline(always)]
pub fn scan_plain(bytes: &[u8], start: usize, decimal: u8) -> Option<(f64, usize)> {
    let negative = *bytes.get(start)? == b'-';
    let at = start + usize::from(negative);
    let (mantissa, fraction_digits, length) = match short(word(bytes, at)?, decimal) {
        Some(short) if short.2 < 8 || !bytes.get(at + 8)?.is_ascii_digit() => short,
        _ => long(bytes, at, decimal)?,
    };
    let end = at + length;
    if matches!(bytes.get(end)?, b'e' | b'E' | b'd' | b'D' | b'#') {
        return None;
    }
    let value = mantissa as f64 / *EXACT_POWERS.get(fraction_digits)?;
    // By its bit: signs change at random in noise, and a branch would be guessed wrongly half the time.
    let sign = u64::from(negative) << 63;
    Some((f64::from_bits(value.to_bits() ^ sign), end))
}

const EACH: u64 = 0x0101_0101_0101_0101;

/// Eight bytes, the first the lowest; what was a digit is 0 to 9.
#[inline(always)]
fn word(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk::<8>()?) ^ (u64::from(b'0') * EACH))
}

/// The top bit of each byte that is no digit. Adding 118 reaches it from 10 on; bytes above 127 have it set already. A carry
/// out of such a byte spoils what is said of bytes behind it, but not of the first two that are none where the first is ASCII.
#[inline(always)]
fn others(word: u64) -> u64 {
    (word.wrapping_add(118 * EACH) | word) & (0x80 * EACH)
}

/// The number that eight digits are, by joining neighbours through multiplication (Lemire 2018, "Quickly parsing eight digits").
#[inline(always)]
fn joined(word: u64) -> i64 {
    let pairs = (word.wrapping_mul(10) + (word >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (pairs.wrapping_mul(100) + (pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    ((fours.wrapping_mul(10_000) + (fours >> 32)) & 0xFFFF_FFFF) as i64
}

/// Mantissa, digits behind the decimal sign and length of a number that, decimal sign included, is not longer than the word, as
/// most samples are: the sign is taken out, and the digits on both sides of it are read at once. With a length of eight it may
/// go on behind the word.
#[inline(always)]
fn short(word: u64, decimal: u8) -> Option<(i64, usize, usize)> {
    let first = others(word);
    if first == 0 {
        return None;
    }
    let second = first & (first - 1);
    let (point, end) = (first.trailing_zeros() / 8, second.trailing_zeros() / 8);
    let is_decimal = (word >> (8 * point)) as u8 == decimal ^ b'0';
    // The decimal sign alone is no number.
    if !is_decimal || end < 2 {
        return None;
    }
    let whole = (1 << (8 * point)) - 1;
    let digits = (word & whole) | ((word >> 8) & !whole);
    let mantissa = joined(digits << (8 * (9 - end)));
    Some((mantissa, (end - point - 1) as usize, end as usize))
}

/// As [`short`], where whole part and fraction have a word each, or there is no fraction.
#[inline(always)]
fn long(bytes: &[u8], at: usize, decimal: u8) -> Option<(i64, usize, usize)> {
    let (whole, whole_digits) = digits(bytes, at)?;
    if *bytes.get(at + whole_digits)? != decimal {
        return (whole_digits > 0).then_some((whole, 0, whole_digits));
    }
    let (fraction, fraction_digits) = digits(bytes, at + whole_digits + 1)?;
    // At most 14 digits: exact in `f64`, as is the power.
    let mantissa = whole * POWERS[fraction_digits] + fraction;
    let length = whole_digits + 1 + fraction_digits;
    (length > 1).then_some((mantissa, fraction_digits, length))
}

const POWERS: [i64; 8] = [1, 10, 100, 1000, 10_000, 100_000, 1_000_000, 10_000_000];

/// The digits that begin at `at` and how many they are; `None` for eight or more.
#[inline(always)]
fn digits(bytes: &[u8], at: usize) -> Option<(i64, usize)> {
    let word = word(bytes, at)?;
    let count = (others(word).trailing_zeros() / 8) as usize;
    if count == 8 {
        return None;
    }
    // Fewer digits are moved up behind zeros. Two shifts: by 64 at once there would be no result for no digits.
    Some((joined((word << (8 * (7 - count))) << 8), count))
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
