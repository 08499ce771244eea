//! Small things that all sections of a report use.

use super::{Block, Figure, OnScreen, ReportSection};
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

pub fn paragraph(text: impl Into<String>) -> Block {
    Block::Paragraph(text.into())
}

/// The section of a part that failed.
pub fn failed(id: &str, title: &str, error: &crate::Error) -> ReportSection {
    ReportSection {
        id: id.into(),
        title: title.into(),
        lead: String::new(),
        blocks: vec![Block::Warning(format!(
            "This part could not be worked out. {error}"
        ))],
    }
}
