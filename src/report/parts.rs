//! Small things that all sections of a report use.

use super::interactive::Plot;
use super::number::significant;
use super::{Block, Figure, OnScreen, Section};
use crate::Result;

/// A figure, or a warning in its place that says why there is none.
pub fn figure(
    file_name: impl Into<String>,
    alt: &str,
    caption: impl Into<String>,
    png: Result<Vec<u8>>,
) -> Block {
    match png {
        Ok(png) => Block::Figure(Figure {
            file_name: file_name.into(),
            alt: alt.to_string(),
            caption: caption.into(),
            png,
            on_screen: OnScreen::Image,
        }),
        Err(error) => Block::Warning(format!("This figure is missing. {error}")),
    }
}

impl Block {
    /// The figure with what a screen shows in place of its image.
    pub fn on_screen(mut self, on_screen: OnScreen) -> Self {
        if let Block::Figure(figure) = &mut self {
            figure.on_screen = on_screen;
        }
        self
    }

    /// As [`on_screen`](Self::on_screen) with a plot.
    pub fn with_plot(self, plot: Plot) -> Self {
        self.on_screen(OnScreen::Plot(Box::new(plot)))
    }
}

pub fn paragraph(text: impl Into<String>) -> Block {
    Block::Paragraph(text.into())
}

/// The section of a part that failed.
pub fn failed(id: &str, title: &str, error: &crate::Error) -> Section {
    Section {
        id: id.into(),
        title: title.into(),
        lead: String::new(),
        blocks: vec![Block::Warning(format!(
            "This part could not be worked out. {error}"
        ))],
    }
}

/// `3 cuts`, `1 cut`.
pub fn count(number: usize, one: &str, many: &str) -> String {
    match number {
        1 => format!("1 {one}"),
        n => format!("{n} {many}"),
    }
}

/// `a`, `a and b`, `a, b and c`.
pub fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// A setting as somebody wrote it: `1160`, `0.05`.
pub fn setting(value: f64) -> String {
    if value.is_finite() && value.abs() < 1e9 {
        // Display gives the shortest form that reads back the same.
        format!("{value}")
    } else {
        significant(value, 5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_read_as_people_write_them() {
        let items = |n: usize| {
            ["a", "b", "c"][..n]
                .iter()
                .map(|s| s.to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(listed(&items(0)), "");
        assert_eq!(listed(&items(1)), "a");
        assert_eq!(listed(&items(2)), "a and b");
        assert_eq!(listed(&items(3)), "a, b and c");
        assert_eq!(count(1, "cut", "cuts"), "1 cut");
        assert_eq!(count(0, "cut", "cuts"), "0 cuts");
    }

    #[test]
    fn settings_keep_their_digits() {
        assert_eq!(setting(1160.0), "1160");
        assert_eq!(setting(0.05), "0.05");
    }
}
