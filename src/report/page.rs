//! The report as one HTML file: text, tables and figures in sections, nothing loaded from elsewhere.
//!
//! Figures are there as images, and most of them once more for scripts ([`super::interactive`]), which take the place of
//! the image on a screen. Every text is escaped by the template engine; names out of measurement files may hold anything.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use base64::prelude::{BASE64_STANDARD, Engine};
use minijinja::syntax::SyntaxConfig;
use minijinja::{Environment, Value, context};
use serde_json::json;

use super::VerdictCard;
use super::block::{Block, Figure, OnScreen, ReportSection, ReportTable};
use super::interactive::{Arrays, GLUE, packed, plotly_js};
use super::number::percent;
use crate::files::write_atomically;
use crate::{Error, Result};

/// Name of the HTML file in the report's folder.
pub const HTML_NAME: &str = "report.html";

/// An HTML page: cards and sections.
#[derive(Debug, Clone, Default)]
pub struct Page {
    /// In the browser's tab and at the top.
    pub title: String,
    /// Below the title.
    pub subtitle: String,
    /// Where the page comes from: name and value, such as the date and the program's version.
    pub origin: Vec<(String, String)>,
    /// What the answers mean, above them; left out where empty.
    pub opening: String,
    /// The answers, before all sections.
    pub cards: Vec<VerdictCard>,
    /// What follows the cards, in order.
    pub sections: Vec<ReportSection>,
    /// How many sections stand open; of the others a reader sees the titles and opens what he wants. `None`: all.
    pub open_sections: Option<usize>,
    /// Images only, no scripts: a small file.
    pub without_scripts: bool,
}

/// What [`Page::write`] left on the disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrittenPage {
    /// The HTML file.
    pub html: PathBuf,
    /// In the order of the page.
    pub images: Vec<PathBuf>,
}

impl Page {
    /// The page as HTML text with all images inside.
    ///
    /// # Errors
    /// The template engine's, which would be a fault of this program.
    pub fn html(&self) -> Result<String> {
        let failed = |error: minijinja::Error| Error::computation(format!("report template: {error:#}"));
        let mut engine = Environment::new();
        let syntax = SyntaxConfig::builder()
            .trim_blocks(true)
            .lstrip_blocks(true)
            .build()
            .map_err(failed)?;
        engine.set_syntax(syntax);
        // The name's ending turns escaping on.
        engine
            .add_template("report.html", include_str!("template.html"))
            .map_err(failed)?;
        engine.add_filter("code", |text: String| Value::from_safe_string(with_code(&text)));
        let mut ids = Names::default();
        let mut parts = Parts {
            live: !self.without_scripts,
            ..Parts::default()
        };
        let open = self.open_sections.unwrap_or(usize::MAX);
        let sections = self.sections.iter().enumerate().map(|(i, section)| {
            let wanted = if section.id.trim().is_empty() {
                &section.title
            } else {
                &section.id
            };
            context! {
                id => ids.unique(&slug(wanted, "section")),
                title => section.title.as_str(),
                lead => section.lead.as_str(),
                folded => i >= open,
                blocks => section.blocks.iter().map(|block| block.value(&mut parts)).collect::<Vec<_>>(),
            }
        });
        let sections: Vec<Value> = sections.collect();
        let version = env!("CARGO_PKG_VERSION");
        let scripts = parts.scripts()?;
        let page = context! {
            title => self.title.as_str(),
            subtitle => self.subtitle.as_str(),
            origin => self.origin.iter().map(|(name, value)| context! { name, value }).collect::<Vec<_>>(),
            opening => self.opening.as_str(),
            cards => self.cards.iter().map(card).collect::<Vec<_>>(),
            folded => open < self.sections.len(),
            sections,
            scripts,
            version,
        };
        engine
            .get_template("report.html")
            .and_then(|template| template.render(page))
            .map_err(failed)
    }

    /// The images and the names under which the page offers them, in the order of the page.
    pub fn images(&self) -> Vec<(String, &[u8])> {
        let mut files = Names::default();
        let blocks = self.sections.iter().flat_map(|section| &section.blocks);
        let figures = blocks.flat_map(Block::figures);
        figures
            .map(|figure| (figure.unique_name(&mut files), figure.png.as_slice()))
            .collect()
    }

    /// Writes the images and then `report.html` into `folder`, each file whole or not at all. Images of an earlier page
    /// there that this one does not have are removed, if they are still as that page shows them.
    ///
    /// # Errors
    /// What the file system refuses, naming the file.
    pub fn write(&self, folder: &Path) -> Result<WrittenPage> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let html = self.html()?;
        let path = folder.join(HTML_NAME);
        let earlier = std::fs::read_to_string(&path).unwrap_or_default();
        let mut images = vec![];
        for (name, png) in self.images() {
            let path = folder.join(name);
            write_atomically(&path, png)?;
            images.push(path);
        }
        write_atomically(&path, html.as_bytes())?;
        for stale in images_of(&earlier, folder) {
            if !images.contains(&stale) {
                std::fs::remove_file(&stale).map_err(|e| Error::io(&stale, e))?;
            }
        }
        Ok(WrittenPage { html: path, images })
    }
}

/// Files in `folder` that hold what the page `html` of this program shows under their name.
fn images_of(html: &str, folder: &Path) -> Vec<PathBuf> {
    /// Around the content and the name of an image, as the template writes them.
    const MARKS: [&str; 4] = [
        "src=\"data:image/png;base64,",
        "\"",
        "class=\"file\" href=\"",
        "\"",
    ];
    let mut found = Vec::new();
    for figure in html.split("<figure").skip(1) {
        let between = |from: &str, to: &str| {
            let rest = &figure[figure.find(from)? + from.len()..];
            rest.get(..rest.find(to)?)
        };
        let (Some(data), Some(name)) = (between(MARKS[0], MARKS[1]), between(MARKS[2], MARKS[3])) else {
            continue;
        };
        let plain = name
            .strip_suffix(".png")
            .is_some_and(|stem| slug(stem, "") == stem);
        let path = folder.join(name);
        if plain && std::fs::read(&path).is_ok_and(|png| BASE64_STANDARD.encode(&png) == data) {
            found.push(path);
        }
    }
    found
}

/// What the blocks of a page share.
#[derive(Default)]
struct Parts {
    /// Whether the page has scripts.
    live: bool,
    files: Names,
    figures: Vec<serde_json::Value>,
    explorers: Vec<serde_json::Value>,
}

impl Parts {
    /// plotly.js, the figures for it and what joins them; nothing where no figure is for scripts.
    fn scripts(&self) -> Result<Option<Value>> {
        if self.figures.is_empty() && self.explorers.is_empty() {
            return Ok(None);
        }
        let mut arrays = Arrays::default();
        let figures: Vec<serde_json::Value> =
            self.figures.iter().map(|figure| arrays.shared(figure)).collect();
        let figures =
            json!({ "figures": figures, "explorers": self.explorers, "arrays": arrays.table() }).to_string();
        // Packed they have no character that HTML knows, whatever names they hold.
        Ok(Some(context! {
            plotly => Value::from_safe_string(plotly_js()),
            figures => Value::from_safe_string(packed(&figures)?),
            glue => Value::from_safe_string(GLUE.to_owned()),
        }))
    }
}

/// A card for the template.
fn card(card: &VerdictCard) -> Value {
    let bar = card.bar.as_ref().map(|bar| {
        let shares = bar.shares();
        let steps = bar.steps.iter().zip(&shares).map(|((name, nrms), share)| {
            context! { name, error => percent(*nrms), share => format!("{share:.2}") }
        });
        context! {
            steps => steps.collect::<Vec<_>>(),
            noise => percent(bar.noise),
            noise_share => format!("{:.2}", shares.last().copied().unwrap_or(0.0)),
        }
    });
    let curves = card.curves.as_ref().map(|c| {
        context! {
            svg => Value::from_safe_string(c.picture.svg()),
            before => c.before.as_str(),
            after => c.after.as_deref(),
            noise => c.picture.noise.is_some(),
            shaded => c.picture.shaded.is_some(),
            caption => c.caption.as_str(),
        }
    });
    context! {
        id => card.id,
        side => card.side,
        tone => card.tone.name(),
        headline => card.headline.as_str(),
        explanation => card.explanation.as_str(),
        facts => card.facts.iter().map(|(name, value)| context! { name => *name, value }).collect::<Vec<_>>(),
        bar,
        curves,
        check => card.check.as_deref(),
        next => card.next.as_str(),
        remarks => card.remarks.clone(),
    }
}

impl Block {
    /// The figures in it, in the order of the page.
    fn figures(&self) -> Vec<&Figure> {
        match self {
            Block::Figure(figure) => vec![figure],
            Block::Fold(fold) => fold.blocks.iter().flat_map(Block::figures).collect(),
            _ => Vec::new(),
        }
    }

    fn value(&self, parts: &mut Parts) -> Value {
        match self {
            Block::Paragraph(text) => context! { kind => "paragraph", text },
            Block::Warning(text) => context! { kind => "warning", text },
            Block::Pre(text) => context! { kind => "pre", text },
            Block::Fold(fold) => context! {
                kind => "fold",
                title => fold.title.as_str(),
                open => fold.open,
                blocks => fold.blocks.iter().map(|block| block.value(parts)).collect::<Vec<_>>(),
            },
            Block::KeyValues(pairs) => {
                let pairs = pairs.iter().map(|(name, value)| context! { name, value });
                context! { kind => "key_values", pairs => pairs.collect::<Vec<_>>() }
            }
            Block::Drawing(drawing) => context! {
                kind => "drawing",
                svg => Value::from_safe_string(drawing.svg.clone()),
                caption => drawing.caption.as_str(),
            },
            Block::Table(table) => table.value(),
            Block::Explorer(_) if !parts.live => context! { kind => "nothing" },
            Block::Explorer(explorer) => {
                parts.explorers.push(explorer.value().clone());
                context! { kind => "explorer", number => parts.explorers.len() - 1, every => explorer.every }
            }
            Block::Figure(figure) => {
                let (width, height) = png_size(&figure.png);
                let number = match &figure.on_screen {
                    OnScreen::Plot(plot) if parts.live => {
                        parts.figures.push(plot.value());
                        Some(parts.figures.len() - 1)
                    }
                    _ => None,
                };
                let plot = match &figure.on_screen {
                    OnScreen::Plot(plot) => Some(plot),
                    _ => None,
                };
                context! {
                    kind => "figure",
                    plot => number,
                    // So that nothing moves while figures are drawn.
                    title => plot.map(|p| p.title()),
                    plot_height => plot.map(|p| p.height_px()),
                    chooses => plot.is_some_and(|p| p.offers_choice()),
                    follows => plot.is_some_and(|p| p.follows_models()),
                    elsewhere => matches!(figure.on_screen, OnScreen::Elsewhere),
                    file => figure.unique_name(&mut parts.files),
                    alt => if figure.alt.is_empty() { &figure.caption } else { &figure.alt },
                    caption => figure.caption.as_str(),
                    width,
                    height,
                    // Base64 has no character that HTML knows, so it need not be escaped.
                    data => Value::from_safe_string(BASE64_STANDARD.encode(&figure.png)),
                }
            }
        }
    }
}

impl ReportTable {
    fn value(&self) -> Value {
        let columns = self
            .columns
            .iter()
            .map(|c| context! { name => c.name.as_str(), numeric => c.numeric });
        let rows = self.rows.iter().map(|row| {
            let cells = self.columns.iter().enumerate().map(|(i, column)| {
                let text = row.get(i).map_or("", String::as_str);
                context! { text, numeric => column.numeric }
            });
            cells.collect::<Vec<_>>()
        });
        context! {
            kind => "table",
            caption => self.caption.as_str(),
            columns => columns.collect::<Vec<_>>(),
            rows => rows.collect::<Vec<_>>(),
            notes => self.notes.clone(),
        }
    }
}

impl Figure {
    fn unique_name(&self, files: &mut Names) -> String {
        let stem = self.file_name.trim_end_matches(".png");
        files.unique(&slug(stem, "figure")) + ".png"
    }
}

/// Hands out each name once: the second `a` becomes `a-2`.
#[derive(Default)]
struct Names(HashSet<String>);

impl Names {
    fn unique(&mut self, wanted: &str) -> String {
        let mut name = wanted.to_owned();
        let mut number = 2;
        while !self.0.insert(name.clone()) {
            name = format!("{wanted}-{number}");
            number += 1;
        }
        name
    }
}

/// The text escaped, with what stands between backticks as code: commands and keys, as messages have them.
fn with_code(text: &str) -> String {
    let escaped = minijinja::HtmlEscape(text).to_string();
    let parts: Vec<&str> = escaped.split('`').collect();
    // An odd backtick is none of ours.
    if parts.len().is_multiple_of(2) {
        return with_minus(&escaped);
    }
    let mut html = String::with_capacity(escaped.len() + 13 * parts.len());
    for (k, part) in parts.into_iter().enumerate() {
        match k % 2 {
            0 => html += &with_minus(part),
            // The page of `serve` says what to press instead.
            _ if part.starts_with("lobestone ") => html += &format!("<code class=\"command\">{part}</code>"),
            _ => html += &format!("<code>{part}</code>"),
        }
    }
    html
}

/// A true minus sign where a hyphen stands before a number; texts that a terminal shows as well have a hyphen.
fn with_minus(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let number = letter == '-'
            && (before.is_whitespace() || before == '(')
            && letters.peek().is_some_and(char::is_ascii_digit);
        html.push(if number { '−' } else { letter });
        before = letter;
    }
    html
}

/// Lower-case letters, digits, `-` and `_`, at most 80 of them: good for file names and anchors everywhere.
fn slug(text: &str, otherwise: &str) -> String {
    let mut slug = String::new();
    for c in text.trim().chars().take(80) {
        match c.to_ascii_lowercase() {
            c if c.is_ascii_alphanumeric() || c == '_' => slug.push(c),
            _ if !slug.is_empty() && !slug.ends_with('-') => slug.push('-'),
            _ => {}
        }
    }
    let slug = slug.trim_end_matches('-');
    if slug.is_empty() {
        otherwise.to_owned()
    } else {
        slug.to_owned()
    }
}

/// Width and height out of the IHDR chunk; zeros where there is none.
fn png_size(png: &[u8]) -> (u32, u32) {
    let number = |at: usize| {
        let bytes = png.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_be_bytes(bytes))
    };
    (number(16).unwrap_or(0), number(20).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::figure::HeatMap;
    use crate::report::{Fold, TableColumn};

    #[test]
    fn what_stands_between_backticks_is_code_and_everything_is_escaped() {
        assert_eq!(
            with_code("run `lobestone add <DIR>` & see"),
            "run <code class=\"command\">lobestone add &lt;DIR&gt;</code> &amp; see"
        );
        assert_eq!(with_code("a ` alone <b>"), "a ` alone &lt;b&gt;");
        assert_eq!(with_code("plain"), "plain");
    }

    fn page(name: &str) -> Page {
        let map = HeatMap {
            title: name.to_owned(),
            rows: vec![name.to_owned()],
            columns: vec!["1X".to_owned()],
            values: vec![vec![Some(0.5)]],
            ..Default::default()
        };
        let figure = Figure {
            file_name: name.to_owned(),
            alt: name.to_owned(),
            caption: name.to_owned(),
            png: map.png().unwrap(),
            ..Figure::default()
        };
        let table = ReportTable {
            caption: name.to_owned(),
            columns: vec![TableColumn::text(name), TableColumn::number("value")],
            rows: vec![vec![name.to_owned(), "1.5".to_owned()], vec!["short".to_owned()]],
            notes: vec![name.to_owned()],
        };
        let section = |id: &str| ReportSection {
            id: id.to_owned(),
            title: name.to_owned(),
            lead: name.to_owned(),
            blocks: vec![
                Block::Paragraph(name.to_owned()),
                Block::Figure(figure.clone()),
                Block::Table(table.clone()),
                Block::Warning(name.to_owned()),
                Block::KeyValues(vec![(name.to_owned(), name.to_owned())]),
                Block::Pre(name.to_owned()),
                Block::Fold(Fold {
                    title: name.to_owned(),
                    blocks: vec![Block::Paragraph(name.to_owned())],
                    open: false,
                }),
            ],
        };
        let card = VerdictCard {
            headline: name.to_owned(),
            explanation: name.to_owned(),
            facts: vec![("Where", name.to_owned())],
            check: Some(name.to_owned()),
            next: name.to_owned(),
            remarks: vec![name.to_owned()],
            ..VerdictCard::default()
        };
        Page {
            cards: vec![card],
            opening: name.to_owned(),
            origin: vec![(name.to_owned(), name.to_owned())],
            title: name.to_owned(),
            subtitle: name.to_owned(),
            sections: vec![section(""), section("errors")],
            ..Page::default()
        }
    }

    #[test]
    fn names_cannot_become_markup() {
        let name = "\"><script>alert('x')</script><img src=x onerror=alert(1)>{{ 7*7 }}&amp;";
        let html = page(name).html().unwrap();
        assert!(!html.contains("<script"), "the page itself has no script either");
        assert!(!html.contains("<img src=x"));
        assert!(html.contains("&lt;script&gt;"));
        assert!(
            html.contains("{{ 7*7 }}&amp;amp;"),
            "text is never taken for a template"
        );
    }

    #[test]
    fn the_page_is_whole_and_needs_nothing_else() {
        let html = page("cell 7").html().unwrap();
        assert!(html.starts_with("<!DOCTYPE html>"));
        assert!(html.contains("<html lang=\"en\">") && html.trim_end().ends_with("</html>"));
        assert!(html.contains("scope=\"col\"") && html.contains("scope=\"row\""));
        assert!(html.contains("href=\"#cell-7\"") && html.contains("id=\"cell-7\""));
        assert_eq!(html.matches("src=\"data:image/png;base64,iVBORw0KGgo").count(), 2);
        assert_eq!(html.matches("src=").count(), 2);
        for outside in ["http:", "https:", "url(", "@import", "<link"] {
            assert!(!html.contains(outside), "{outside}");
        }
        assert!(html.len() < 200_000);
    }

    #[test]
    fn images_stay_in_the_folder_under_names_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out/deep");
        let written = page("../../etc/p1 Ü.png").write(&target).unwrap();
        assert_eq!(written.html, target.join("report.html"));
        assert_eq!(
            written.images,
            [target.join("etc-p1.png"), target.join("etc-p1-2.png")]
        );
        let mut names: Vec<_> = std::fs::read_dir(&target)
            .unwrap()
            .map(|f| f.unwrap().file_name())
            .collect();
        names.sort();
        assert_eq!(
            names,
            ["etc-p1-2.png", "etc-p1.png", "report.html"],
            "no temporary file is left"
        );
        let html = std::fs::read_to_string(&written.html).unwrap();
        assert!(html.contains("href=\"etc-p1-2.png\""));
        // A second time over the first.
        assert_eq!(page("../../etc/p1 Ü.png").write(&target).unwrap(), written);
    }

    #[test]
    fn images_that_the_new_page_lacks_are_removed_unless_they_are_somebodys() {
        let folder = tempfile::tempdir().unwrap();
        let files = |name: &str| folder.path().join(name);
        page("old").write(folder.path()).unwrap();
        std::fs::write(files("mine.png"), "a photograph").unwrap();
        // Painted over since: somebody's now.
        std::fs::write(files("old-2.png"), "changed").unwrap();
        page("new").write(folder.path()).unwrap();
        assert!(files("new.png").exists() && files("new-2.png").exists());
        assert!(!files("old.png").exists());
        assert!(files("old-2.png").exists() && files("mine.png").exists());
        // A page that this program did not write names files, too.
        std::fs::create_dir(files("below")).unwrap();
        std::fs::write(files("secret.png"), "").unwrap();
        let foreign = "<figure><img src=\"data:image/png;base64,\"><a class=\"file\" href=\"../secret.png\">x</a></figure>";
        assert!(images_of(foreign, &files("below")).is_empty());
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = page("x")
            .write(&file.path().join("below"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("below"), "{error}");
    }

    #[test]
    fn what_is_folded_up_is_there_and_needs_no_contents() {
        let mut page = page("cell 7");
        assert!(!page.html().unwrap().contains("class=\"part\""));
        page.open_sections = Some(1);
        let html = page.html().unwrap();
        assert!(html.contains("<section id=\"errors\">\n<details class=\"part\">"));
        assert!(html.contains("<summary><h2>cell 7</h2></summary>"));
        assert!(html.contains("<section id=\"cell-7\">\n<h2>1. cell 7</h2>"));
        assert!(!html.contains("<nav"));
        let verdict = html.find("<article class=\"card open\" id=\"verdict\"").unwrap();
        assert!(verdict < html.find("<section").unwrap(), "the answer comes first");
    }

    #[test]
    fn images_in_folds_are_files_like_others() {
        let mut page = page("x");
        let Block::Figure(figure) = page.sections[0].blocks[1].clone() else {
            panic!("no figure");
        };
        page.sections[0].blocks.push(Block::Fold(Fold {
            title: "more".into(),
            blocks: vec![Block::Figure(figure)],
            open: false,
        }));
        let names: Vec<String> = page.images().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["x.png", "x-2.png", "x-3.png"]);
        let html = page.html().unwrap();
        let linked: Vec<&str> = html
            .split("class=\"file\" href=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .collect();
        assert_eq!(linked, names, "the page offers them under the names they have");
    }

    #[test]
    fn an_empty_page_and_a_broken_image_still_render() {
        assert!(Page::default().html().is_ok());
        let blocks = vec![Block::Figure(Figure {
            png: vec![1, 2, 3],
            ..Default::default()
        })];
        let section = ReportSection {
            blocks,
            ..Default::default()
        };
        let html = Page {
            sections: vec![section],
            ..Default::default()
        }
        .html()
        .unwrap();
        assert!(html.contains("href=\"figure.png\""));
    }
}
