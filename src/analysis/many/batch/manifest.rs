//! The list of campaigns: a CSV table with a column `campaign`.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::{Error, InputError, Result};

/// A list of campaigns.
#[derive(Debug, Clone)]
pub struct Manifest {
    /// The file that the list was read from.
    pub file: PathBuf,
    /// Names of the columns besides `campaign`, in lower case, in their order.
    pub columns: Vec<String>,
    /// The campaigns, in the order of the lines.
    pub entries: Vec<ManifestEntry>,
}

/// A line of the list.
#[derive(Debug, Clone)]
pub struct ManifestEntry {
    /// In the manifest, from 1.
    pub line: usize,
    /// As written; forward slashes.
    pub campaign: String,
    /// The campaign's folder.
    pub dir: PathBuf,
    /// Cells of [`Manifest::columns`].
    pub cells: Vec<String>,
}

impl Manifest {
    /// Reads a table with commas or semicolons between its cells. Paths count from the folder of the manifest.
    ///
    /// # Errors
    /// No table, no column `campaign`, a name that stands twice or in `reserved`, a line without a campaign, a campaign
    /// that is named twice, or none at all.
    pub fn read(file: &Path, reserved: &[&str]) -> Result<Manifest> {
        crate::files::regular_file(file)?;
        let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
        let text = String::from_utf8(bytes).map_err(|_| {
            InputError::new("the text is not UTF-8")
                .file(file)
                .remedy("save the table as CSV UTF-8")
        })?;
        // Line numbers would be one too low.
        let text = text
            .strip_prefix('\u{feff}')
            .unwrap_or(&text)
            .replace("\r\n", "\n");
        let head = text.lines().next().unwrap_or("");
        let delimiter = if head.contains(';') { b';' } else { b',' };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(text.as_bytes());
        let refuse = |problem: String, line: usize, remedy: &str| -> Error {
            InputError::new(problem)
                .file(file)
                .line(line)
                .remedy(remedy)
                .into()
        };
        let broken = |e: csv::Error| {
            let line = e.position().map_or(1, |p| p.line() as usize);
            refuse(
                format!("not a CSV table: {e}"),
                line,
                "a line a campaign, commas between cells",
            )
        };
        let names: Vec<String> = reader
            .headers()
            .map_err(broken)?
            .iter()
            .map(str::to_lowercase)
            .collect();
        let of_campaign = names.iter().position(|n| n == "campaign").ok_or_else(|| {
            refuse(
                "there is no column campaign".into(),
                1,
                "the first line names the columns: campaign,robot,date; campaign is the path of a folder",
            )
        })?;
        check_names(&names, reserved).map_err(|(problem, remedy)| refuse(problem, 1, remedy))?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let mut entries: Vec<ManifestEntry> = Vec::new();
        let mut seen: HashMap<String, usize> = HashMap::new();
        for row in reader.records() {
            let row = row.map_err(broken)?;
            // A position is that of the blank lines before the row.
            let line = row.position().map_or(0, |at| {
                let rest = text.as_bytes().get(at.byte() as usize..).unwrap_or_default();
                at.line() as usize + rest.iter().take_while(|b| **b == b'\n').count()
            });
            if row.iter().all(str::is_empty) {
                continue;
            }
            if row.len() > names.len() {
                let problem = format!("{} cells, but {} columns", row.len(), names.len());
                return Err(refuse(problem, line, "put cells with commas in double quotes"));
            }
            let campaign = plain(row.get(of_campaign).unwrap_or(""));
            if campaign.is_empty() {
                return Err(refuse(
                    "no campaign in this line".into(),
                    line,
                    "give its folder, or take the line out",
                ));
            }
            if let Some(first) = seen.insert(campaign.clone(), line) {
                let problem = format!("{campaign} stands in line {first}, too");
                return Err(refuse(problem, line, "name each campaign once"));
            }
            let others = (0..names.len()).filter(|i| *i != of_campaign);
            entries.push(ManifestEntry {
                line,
                dir: folder.join(&campaign),
                campaign,
                cells: others.map(|i| row.get(i).unwrap_or("").to_string()).collect(),
            });
        }
        if entries.is_empty() {
            return Err(refuse(
                "names no campaign".into(),
                1,
                "a line a campaign below the first",
            ));
        }
        let mut columns = names;
        columns.remove(of_campaign);
        Ok(Manifest {
            file: file.to_path_buf(),
            columns,
            entries,
        })
    }

    /// The cell of a column; `None` where there is no such column or nothing in it.
    pub fn cell<'a>(&self, entry: &'a ManifestEntry, column: &str) -> Option<&'a str> {
        let index = self.columns.iter().position(|c| c == column)?;
        entry
            .cells
            .get(index)
            .map(String::as_str)
            .filter(|c| !c.is_empty())
    }
}

fn check_names(names: &[String], reserved: &[&str]) -> std::result::Result<(), (String, &'static str)> {
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err((
                format!("column {} has no name", i + 1),
                "name every column in the first line",
            ));
        }
        if names[..i].contains(name) {
            return Err((
                format!("two columns are called {name}"),
                "give each column a name of its own",
            ));
        }
        if reserved.contains(&name.as_str()) {
            return Err((
                format!("the column {name} would hide the result of that name"),
                "give the column another name",
            ));
        }
    }
    Ok(())
}

/// `cell7/`, `cell7\` and `cell7/campaign.toml` are `cell7`.
fn plain(text: &str) -> String {
    // Backslashes as Windows writes them; in a path of Unix nobody has them.
    let text = text.replace('\\', "/");
    let text = text.strip_suffix("campaign.toml").unwrap_or(&text);
    let text = match text.trim_end_matches('/') {
        "" if text.starts_with('/') => "/",
        "" if !text.is_empty() => ".",
        other => other,
    };
    text.strip_prefix("./").unwrap_or(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Manifest> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("nights.csv");
        std::fs::write(&file, text).unwrap();
        Manifest::read(&file, &["status"])
    }

    #[test]
    fn commas_semicolons_marks_and_paths() {
        let manifest =
            read("\u{feff}Robot;Campaign;Shift\r\nr1;a\\b\\;late\r\n\r\nr2;./c/campaign.toml\r\n").unwrap();
        assert_eq!(manifest.columns, ["robot", "shift"]);
        let [first, second] = &manifest.entries[..] else {
            panic!("{manifest:?}");
        };
        assert_eq!((first.campaign.as_str(), first.line), ("a/b", 2));
        assert_eq!((second.campaign.as_str(), second.line), ("c", 4));
        assert!(first.dir.ends_with("a/b"));
        assert_eq!(manifest.cell(first, "shift"), Some("late"));
        assert_eq!(manifest.cell(second, "shift"), None);
        assert_eq!(manifest.cell(second, "date"), None);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        for (text, words) in [
            ("", "no column campaign"),
            ("folder,robot\na,b\n", "nights.csv:1: there is no column campaign"),
            ("campaign,robot,Robot\na,b,c\n", "two columns are called robot"),
            ("campaign,status\na,b\n", "would hide the result"),
            ("campaign,\na,b\n", "column 2 has no name"),
            ("campaign,robot\n,b\n", "nights.csv:2: no campaign"),
            (
                "campaign,robot\na,b\n\nc,d\n./a/,b\n",
                "nights.csv:5: a stands in line 2, too",
            ),
            ("campaign\na,b\n", "2 cells, but 1 columns"),
            ("campaign\n", "names no campaign"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
