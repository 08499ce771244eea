//! Plain-text tables for the terminal.

/// A table with a header; the first column and those without a heading (bars, remarks) are left-aligned, the others
/// right-aligned.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let columns = header.len();
    let width = |c: usize| {
        let cells = rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count());
        cells.chain([header[c].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |cells: &[String]| {
        let mut out = String::from("  ");
        for (c, width) in widths.iter().enumerate() {
            let cell = cells.get(c).map(String::as_str).unwrap_or("");
            let padding = " ".repeat(width - cell.chars().count());
            if c > 0 {
                out += "  ";
            }
            if c == 0 || header[c].is_empty() {
                out += cell;
                out += &padding;
            } else {
                out += &padding;
                out += cell;
            }
        }
        out.trim_end().to_string() + "\n"
    };
    let mut out = line(&header.iter().map(|h| h.to_string()).collect::<Vec<_>>());
    for row in rows {
        out += &line(row);
    }
    out
}

/// A number with `digits` significant digits, without exponent where it reads well.
pub fn number(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-4..7).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.*e}", digits.saturating_sub(1))
    }
}

/// A share as per cent.
pub fn percent(share: f64) -> String {
    format!("{} %", number(100.0 * share, 3))
}

/// A bar as long as the share of `largest`.
pub fn bar(value: f64, largest: f64) -> String {
    let share = if largest > 0.0 { value / largest } else { 0.0 };
    "#".repeat((20.0 * share).round() as usize)
}

/// Lines that begin with `warning:`.
pub fn warnings(warnings: &[String]) -> String {
    warnings.iter().map(|w| format!("warning: {w}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let rows = [
            vec!["µ".into(), "1.0".into()],
            vec!["long".into(), "12.25".into()],
        ];
        let text = table(&["name", "value"], &rows);
        assert_eq!(text, "  name  value\n  µ       1.0\n  long  12.25\n");
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(number(0.0123456, 3), "0.0123");
        assert_eq!(number(1_514_321.0, 4), "1514321");
        assert_eq!(number(1.5e9, 3), "1.50e9");
        assert_eq!(number(0.0, 3), "0");
    }
}
