//! What a page is made of: sections of text, figures and tables. How they become HTML: [`super::page`].

use super::interactive::{Explorer, Plot};

#[derive(Debug, Clone, Default)]
pub struct ReportSection {
    /// Anchor in the page; made from the title where empty.
    pub id: String,
    pub title: String,
    /// One plain sentence that says what the section shows; left out where empty.
    pub lead: String,
    pub blocks: Vec<Block>,
}

#[derive(Debug, Clone)]
pub enum Block {
    Paragraph(String),
    Figure(Figure),
    /// FRFs to choose from; nothing in a page without scripts.
    Explorer(Box<Explorer>),
    Drawing(Drawing),
    Table(ReportTable),
    Warning(String),
    /// Name and value, one a line.
    KeyValues(Vec<(String, String)>),
    /// Shown as it is, in a fixed-width font.
    Pre(String),
    Fold(Fold),
}

/// Blocks behind a line that a reader opens.
#[derive(Debug, Clone, Default)]
pub struct Fold {
    pub title: String,
    pub blocks: Vec<Block>,
    /// Open from the beginning.
    pub open: bool,
}

#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Name of the image next to the page; anything but letters, digits, `-` and `_` is replaced, `.png` added.
    pub file_name: String,
    /// What a reader who cannot see the image should know.
    pub alt: String,
    pub caption: String,
    /// A whole PNG file, as the functions of [`super::figure`] return it.
    pub png: Vec<u8>,
    pub on_screen: OnScreen,
}

/// What a screen shows of a figure where scripts run; paper always gets the image.
#[derive(Debug, Clone, Default)]
pub enum OnScreen {
    #[default]
    Image,
    Plot(Box<Plot>),
    /// Nothing: another block of the page shows the same and more.
    Elsewhere,
}

/// Vector graphics that live in the page only, such as a moving picture.
#[derive(Debug, Clone, Default)]
pub struct Drawing {
    /// A whole `<svg>` element made by this program: it goes into the page as it is.
    pub svg: String,
    pub caption: String,
}

#[derive(Debug, Clone, Default)]
pub struct ReportTable {
    pub caption: String,
    pub columns: Vec<TableColumn>,
    /// The first cell of a row is its heading. Missing cells stay empty, surplus ones are dropped.
    pub rows: Vec<Vec<String>>,
    pub notes: Vec<String>,
}

#[derive(Debug, Clone, Default)]
pub struct TableColumn {
    pub name: String,
    /// Set flush right.
    pub numeric: bool,
}

impl TableColumn {
    pub fn text(name: impl Into<String>) -> Self {
        TableColumn {
            name: name.into(),
            numeric: false,
        }
    }

    pub fn number(name: impl Into<String>) -> Self {
        TableColumn {
            name: name.into(),
            numeric: true,
        }
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
