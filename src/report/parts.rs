//! Small things that all sections of a report use.

use super::{Block, Figure, OnScreen, ReportSection};
use crate::Result;
use crate::revision;

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

/// When and with what a page is made, for its header.
pub fn made() -> Vec<(String, String)> {
    let now = revision::now().replace('T', " ").replace('Z', " UTC");
    let version = env!("CARGO_PKG_VERSION").to_string();
    vec![("made".into(), now), ("with Lobestone".into(), version)]
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
