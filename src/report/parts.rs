//! Small things that all sections of a report use.

use super::{Block, Figure, Section};
use crate::Result;

/// A figure, or a warning in its place that says why there is none.
pub fn figure(file_name: impl Into<String>, alt: &str, caption: impl Into<String>, png: Result<Vec<u8>>) -> Block {
    match png {
        Ok(png) => Block::Figure(Figure {
            file_name: file_name.into(),
            alt: alt.to_string(),
            caption: caption.into(),
            png,
        }),
        Err(error) => Block::Warning(format!("This figure is missing. {error}")),
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
        blocks: vec![Block::Warning(format!("This part could not be worked out. {error}"))],
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_read_as_people_write_them() {
        let items = |n: usize| ["a", "b", "c"][..n].iter().map(|s| s.to_string()).collect::<Vec<_>>();
        assert_eq!(listed(&items(0)), "");
        assert_eq!(listed(&items(1)), "a");
        assert_eq!(listed(&items(2)), "a and b");
        assert_eq!(listed(&items(3)), "a, b and c");
        assert_eq!(count(1, "cut", "cuts"), "1 cut");
        assert_eq!(count(0, "cut", "cuts"), "0 cuts");
    }
}
