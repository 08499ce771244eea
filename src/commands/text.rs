//! Tables, bars and emphasis for the terminal.
//!
//! Texts carry their colours as escape sequences from here on; the stream they are printed to takes them out again where
//! it is no terminal, or where NO_COLOR is set. Only what [`Emphasis`] adds is coloured: nothing that a file says.

use std::fmt;

use anstyle::{AnsiColor, Style};

use crate::discrepancy::setup::SetupFinding;

/// What a piece of text means to the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Emphasis {
    /// The answer, in a line full of other things.
    Strong,
    /// As it should be.
    Good,
    /// To be looked at.
    Doubtful,
    /// Wrong.
    Bad,
}

impl Emphasis {
    fn style(self) -> Style {
        let colour = |c: AnsiColor| Style::new().fg_color(Some(c.into()));
        match self {
            Emphasis::Strong => Style::new().bold(),
            Emphasis::Good => colour(AnsiColor::Green),
            Emphasis::Doubtful => colour(AnsiColor::Yellow),
            Emphasis::Bad => colour(AnsiColor::Red),
        }
    }

    /// `text` with this emphasis; empty text stays empty.
    pub fn on(self, text: impl fmt::Display) -> String {
        let text = text.to_string();
        let style = self.style();
        match text.is_empty() {
            true => text,
            false => format!("{style}{text}{style:#}"),
        }
    }

    /// Of an error in multiples of the noise.
    pub fn of_times_noise(times: f64) -> Emphasis {
        match times {
            t if t < 1.5 => Emphasis::Good,
            t if t < 10.0 => Emphasis::Doubtful,
            _ => Emphasis::Bad,
        }
    }
}

/// Characters that a reader sees.
fn width_of(text: &str) -> usize {
    anstream::adapter::strip_str(text)
        .map(|part| part.chars().count())
        .sum()
}

/// A table with a header; the first column and those without a heading (bars, remarks) are left-aligned, the others
/// right-aligned.
pub fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let columns = header.len();
    let width = |c: usize| {
        let cells = rows.iter().filter_map(|r| r.get(c)).map(|s| width_of(s));
        cells.chain([header[c].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let line = |cells: &[String]| {
        let mut out = String::from("  ");
        for (c, width) in widths.iter().enumerate() {
            let cell = cells.get(c).map(String::as_str).unwrap_or("");
            let padding = " ".repeat(width - width_of(cell));
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

/// The likely mistakes of the setup, each on lines of its own; empty where there is none. Stands before everything else.
pub fn setup_lines(findings: &[SetupFinding]) -> String {
    let likely = findings.iter().filter(|f| f.is_likely());
    let text: String = likely
        .map(|f| {
            let told = wrapped(&f.sentence(), "  ");
            format!(
                "{}\n{told}",
                Emphasis::Bad.on("SETUP: a mistake in the files or the setup is likely")
            )
        })
        .collect();
    match text.is_empty() {
        true => text,
        false => text + "\n",
    }
}

/// What is to be known of the files before anything else is believed: likely mistakes, then what was guessed and noticed.
pub fn files_first(findings: &[SetupFinding], noticed: &[String]) -> String {
    let noticed = match warnings(noticed) {
        none if none.is_empty() => none,
        some => some + "\n",
    };
    setup_lines(findings) + &noticed
}

/// Those of `warnings` that were not told before.
pub fn warnings_but(all: &[String], told: &[String]) -> String {
    let left: Vec<String> = all.iter().filter(|w| !told.contains(w)).cloned().collect();
    warnings(&left)
}

/// Characters of the longest bar.
const BAR_LENGTH: usize = 20;
/// Eighths of a character, from one to seven.
const EIGHTHS: [char; 7] = ['▏', '▎', '▍', '▌', '▋', '▊', '▉'];

/// A bar as long as the share of `largest`; nothing where there is no such share.
pub fn bar(value: f64, largest: f64) -> String {
    let share = if largest > 0.0 { value / largest } else { 0.0 };
    if !(share > 0.0) {
        return String::new();
    }
    // What is there at all is seen.
    let eighths = ((8 * BAR_LENGTH) as f64 * share.min(1.0)).round().max(1.0) as usize;
    let mut bar = "█".repeat(eighths / 8);
    bar.extend((eighths % 8).checked_sub(1).map(|i| EIGHTHS[i]));
    bar
}

/// As [`bar`], coloured by how far the value stands above its noise.
pub fn error_bar(nrms: f64, noise_floor_nrms: f64, largest: f64) -> String {
    let bar = bar(nrms, largest);
    match noise_floor_nrms > 0.0 {
        true => Emphasis::of_times_noise(nrms / noise_floor_nrms).on(bar),
        false => bar,
    }
}

/// Lines that begin with `warning:`.
pub fn warnings(warnings: &[String]) -> String {
    let label = Emphasis::Doubtful.on("warning:");
    warnings.iter().map(|w| format!("{label} {w}\n")).collect()
}

/// What is said of several files in the same words is said once: `a.csv and 11 more: …`. In the order of the first of each.
pub fn said_once(warnings: &[String]) -> Vec<String> {
    let mut groups: Vec<(&str, &str, usize)> = Vec::new();
    for warning in warnings {
        let (about, what) = warning.split_once(": ").unwrap_or(("", warning));
        match groups.iter_mut().find(|(_, said, _)| *said == what) {
            Some((_, _, more)) => *more += 1,
            None => groups.push((about, what, 0)),
        }
    }
    groups
        .into_iter()
        .map(|(about, what, more)| match (about, more) {
            ("", _) => what.to_string(),
            (about, 0) => format!("{about}: {what}"),
            (about, more) => format!("{about} and {more} more: {what}"),
        })
        .collect()
}

/// Words broken to lines of at most 100 characters, each line after `indent`. Line breaks of the text stay, and so do
/// commands between backticks, which somebody may want to copy.
pub fn wrapped(text: &str, indent: &str) -> String {
    const WIDTH: usize = 100;
    let mut out = String::new();
    for paragraph in text.lines() {
        let mut length = 0;
        for word in words(paragraph) {
            let longer = length + 1 + width_of(&word);
            if length > 0 && longer + indent.len() <= WIDTH {
                out += " ";
                length = longer;
            } else {
                if length > 0 {
                    out += "\n";
                }
                out += indent;
                length = width_of(&word);
            }
            out += &word;
        }
        out += "\n";
    }
    out
}

/// What stands between blanks; what stands between backticks is one word.
fn words(paragraph: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut open = false;
    for word in paragraph.split_whitespace() {
        match words.last_mut().filter(|_| open) {
            Some(last) => *last += &format!(" {word}"),
            None => words.push(word.to_string()),
        }
        open ^= word.matches('`').count() % 2 == 1;
    }
    words
}

/// What an error message begins with on a terminal.
pub(super) fn error_label() -> String {
    Emphasis::Bad.on("error:")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_of_several_files_is_said_once() {
        let said = ["a.csv: no unit", "b.csv: late", "c.csv: no unit", "alone"].map(str::to_string);
        assert_eq!(
            said_once(&said),
            ["a.csv and 1 more: no unit", "b.csv: late", "alone"]
        );
    }

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
    fn colours_take_no_room_in_a_table() {
        let rows = [
            vec!["a".into(), Emphasis::Bad.on("1.0"), Emphasis::Good.on("")],
            vec!["bb".into(), "12.0".into(), "x".into()],
        ];
        let text = table(&["", "value", ""], &rows);
        assert!(text.contains("\u{1b}[31m1.0\u{1b}[0m"), "{text:?}");
        let plain = anstream::adapter::strip_str(&text).to_string();
        assert_eq!(plain, "      value\n  a     1.0\n  bb   12.0  x\n");
    }

    #[test]
    fn bars_grow_by_eighths_and_never_vanish() {
        assert_eq!(bar(1.0, 1.0).chars().count(), BAR_LENGTH);
        assert_eq!(bar(3.0, 1.0), bar(1.0, 1.0));
        assert_eq!(bar(0.5, 1.0), "█".repeat(10));
        assert_eq!(bar(0.525, 1.0), "█".repeat(10) + "▌");
        assert_eq!(bar(1e-9, 1.0), "▏");
        for nothing in [bar(0.0, 1.0), bar(1.0, 0.0), bar(f64::NAN, 1.0)] {
            assert_eq!(nothing, "");
        }
    }

    #[test]
    fn long_text_is_broken_between_words() {
        let text = wrapped(&"word ".repeat(30), "  ");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2);
        assert!(
            lines
                .iter()
                .all(|l| l.starts_with("  word") && l.chars().count() <= 100)
        );
        assert_eq!(wrapped("a\nb", "- "), "- a\n- b\n");
        let command = "`lobestone add /a/folder/with/a/long/name/of/its/own local-resonator@link-3`";
        let text = wrapped(&format!("{} run {command}, then look", "word ".repeat(14)), "  ");
        assert!(text.contains(&format!("\n  {command}, then look\n")), "{text}");
    }

    #[test]
    fn numbers_keep_their_digits() {
        assert_eq!(number(0.0123456, 3), "0.0123");
        assert_eq!(number(1_514_321.0, 4), "1514321");
        assert_eq!(number(1.5e9, 3), "1.50e9");
        assert_eq!(number(0.0, 3), "0");
    }
}
