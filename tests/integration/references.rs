//! What comments and pages refer to is there: files of the repository, pages and their sections.

use std::path::{Path, PathBuf};

/// Folders of the repository that a path may begin with.
const FOLDERS: [&str; 9] = [
    ".ci/",
    "benches/",
    "datasets/",
    "docs/",
    "examples/",
    "reports/",
    "scripts/",
    "src/",
    "tests/",
];

/// Written by a script, with names of other projects in it.
const FOREIGN: &str = "reports/third-party.md";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// All files of the repository, relative to its root.
fn files() -> Vec<String> {
    fn walk(folder: &Path, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let (path, name) = (entry.path(), entry.file_name());
            let name = name.to_str().unwrap();
            let skipped = ["target", "node_modules", "__pycache__"].contains(&name);
            if skipped || name.starts_with('.') && name != ".ci" {
                continue;
            }
            match path.is_dir() {
                true => walk(&path, found),
                false => found.push(path.strip_prefix(root()).unwrap().to_str().unwrap().to_string()),
            }
        }
    }
    let mut found = Vec::new();
    walk(root(), &mut found);
    found
}

/// Comments of a source file, neighbouring lines together.
fn comments(source: &str) -> Vec<String> {
    let mut blocks: Vec<String> = Vec::new();
    let mut before = false;
    for line in source.lines().map(str::trim) {
        let comment = match line.starts_with("//") {
            true => Some(line),
            false => line.find(" // ").map(|at| &line[at + 1..]),
        };
        if let Some(comment) = comment {
            let text = comment.trim_start_matches(['/', '!']).trim();
            match blocks.last_mut().filter(|_| before) {
                Some(block) => *block += &format!(" {text}"),
                None => blocks.push(text.to_string()),
            }
        }
        before = comment.is_some();
    }
    blocks
}

/// Words of a text that look like files of this repository, each with what follows it.
fn named_files(text: &str) -> Vec<(&str, &str)> {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_./*-".contains(c);
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(begin) = text[at..].find(is_part).map(|i| at + i) {
        let end = text[begin..]
            .find(|c| !is_part(c))
            .map_or(text.len(), |i| begin + i);
        let word = text[begin..end].trim_end_matches('.').trim_start_matches("./");
        let word = word.trim_start_matches("../");
        let is_source = [".rs", ".md", ".py"]
            .iter()
            .any(|e| word.ends_with(e) && word.len() > 3);
        let is_in_folder = FOLDERS
            .iter()
            .any(|f| word.starts_with(f) && word.len() > f.len());
        let is_elsewhere = word.starts_with('/') || word.starts_with("docs.rs") || word.contains("your_");
        if (is_source || is_in_folder) && !is_elsewhere {
            found.push((word, &text[end..]));
        }
        at = end;
    }
    found
}

/// Whether `name`, written in `file`, is a file or folder of the repository. A path may leave out its beginning.
fn is_there(name: &str, file: &str, files: &[String]) -> bool {
    let beside = Path::new(file).parent().unwrap().join(name);
    if let Some((head, tail)) = name.split_once('*') {
        return files.iter().any(|f| f.starts_with(head) && f.ends_with(tail))
            || files.iter().any(|f| {
                let beside = beside.to_str().unwrap().split_once('*').unwrap();
                f.starts_with(beside.0) && f.ends_with(beside.1)
            });
    }
    if root().join(name).exists() || root().join(beside).exists() {
        return true;
    }
    // Pages are named by their whole path: several folders have a README.md, and others have pages of the same names.
    let ends_so = |f: &String| f.strip_suffix(name).is_some_and(|rest| rest.ends_with('/'));
    !name.ends_with(".md") && files.iter().any(ends_so)
}

/// The headings of a page.
fn headings(page: &str) -> Vec<String> {
    let mut fenced = false;
    let mut found = Vec::new();
    for line in page.lines() {
        fenced ^= line.starts_with("```");
        if let (false, Some(heading)) = (fenced, line.strip_prefix('#')) {
            found.push(heading.trim_start_matches('#').trim().to_string());
        }
    }
    found
}

/// The name by which a link finds a heading.
fn anchor(heading: &str) -> String {
    let kept = heading
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.collect::<String>().to_lowercase().replace(' ', "-")
}

/// A section that a text names after a page: `docs/physics.md, "Structure"`.
fn named_section(after: &str) -> Option<&str> {
    after
        .strip_prefix(", \"")?
        .split_once('"')
        .map(|(section, _)| section)
}

/// Links of a page: what stands in `](…)`, not in code.
fn links(page: &str) -> Vec<&str> {
    let mut fenced = false;
    let outside = page.lines().filter(|line| {
        fenced ^= line.starts_with("```");
        !fenced
    });
    outside
        .flat_map(|line| line.split("](").skip(1))
        .filter_map(|rest| Some(rest.split_once(')')?.0))
        .collect()
}

#[test]
fn files_that_comments_and_pages_name_are_there() {
    let files = files();
    let mut wrong = Vec::new();
    for file in files.iter().filter(|f| *f != FOREIGN) {
        let is_data =
            file.starts_with("tests/data/") || file.starts_with("reports/") && !file.ends_with(".md");
        let extension = Path::new(file).extension().and_then(|e| e.to_str()).unwrap_or("");
        let is_script = file.starts_with("scripts/") && ["", "py"].contains(&extension) || file == ".ci/run";
        let read = || std::fs::read_to_string(root().join(file)).unwrap();
        let texts = match extension {
            _ if is_data => continue,
            "rs" => comments(&read()),
            "md" => vec![read()],
            _ if is_script => vec![read()],
            _ => continue,
        };
        for text in &texts {
            for (name, after) in named_files(text) {
                // Reports are also what a script writes when it is run; the catalogue is written into the folder of the book.
                let is_written = name.starts_with("reports/") && !file.ends_with(".md");
                let is_page = is_script && root().join("docs").join(name).exists();
                if !is_there(name, file, &files) && !is_written && !is_page {
                    wrong.push(format!("{file}: {name} is not there"));
                } else if after.trim_start().starts_with('§') {
                    wrong.push(format!(
                        "{file}: {name}: name the section as its heading is, in quotes"
                    ));
                } else if let Some(section) = named_section(after) {
                    let page = std::fs::read_to_string(root().join(name)).unwrap_or_default();
                    if !headings(&page).iter().any(|h| h == section) {
                        wrong.push(format!("{file}: {name} has no section {section:?}"));
                    }
                }
            }
            if extension == "rs" && text.to_lowercase().contains("the contract") {
                wrong.push(format!("{file}: which page is \"the contract\"?"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn links_of_all_pages_lead_somewhere() {
    let files = files();
    let mut wrong = Vec::new();
    let pages = files
        .iter()
        .filter(|f| f.ends_with(".md") && !f.starts_with("tests/"));
    for file in pages.filter(|f| *f != FOREIGN) {
        let page = std::fs::read_to_string(root().join(file)).unwrap();
        for link in links(&page).into_iter().filter(|l| !l.starts_with("http")) {
            let (path, section) = link.split_once('#').unwrap_or((link, ""));
            let target: PathBuf = match path {
                "" => root().join(file),
                path => root().join(file).parent().unwrap().join(path),
            };
            if !target.exists() {
                wrong.push(format!("{file}: {link} leads nowhere"));
            } else if !section.is_empty() {
                let there = headings(&std::fs::read_to_string(&target).unwrap_or_default());
                if !there.iter().any(|h| anchor(h) == section) {
                    wrong.push(format!("{file}: {link}: no such section"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Fenced blocks of a text that are Rust, with the lines that a reader sees.
fn rust_blocks<'a>(lines: impl Iterator<Item = &'a str>, fence: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut block: Option<String> = None;
    let mut is_open = false;
    for line in lines {
        if line.starts_with("```") {
            match is_open {
                true => found.extend(block.take()),
                false => block = (line == fence).then(String::new),
            }
            is_open = !is_open;
        } else if let Some(block) = block.as_mut().filter(|_| !line.starts_with("# ")) {
            *block += line;
            block.push('\n');
        }
    }
    found
}

/// The example in the README is one of the doctests of the front page, which are run.
#[test]
fn the_readme_shows_a_doctest() {
    let read = |file: &str| std::fs::read_to_string(root().join(file)).unwrap();
    let (readme, front) = (read("README.md"), read("src/lib.rs"));
    let docs = front.lines().filter_map(|line| line.strip_prefix("//!"));
    let doctests = rust_blocks(docs.map(|line| line.strip_prefix(' ').unwrap_or(line)), "```");
    assert!(doctests.len() >= 3);
    let (_, section) = readme.split_once("\n## As a library\n").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let shown = rust_blocks(section.lines(), "```rust");
    assert!(!shown.is_empty());
    for example in &shown {
        assert!(
            doctests.contains(example),
            "no doctest of src/lib.rs is\n{example}"
        );
    }
    // And every example is named.
    for entry in std::fs::read_dir(root().join("examples")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let name = name.strip_suffix(".rs").unwrap();
        assert!(
            section.contains(&format!("`{name}`")),
            "README.md does not name the example {name}"
        );
    }
}

#[test]
fn a_name_of_nothing_is_noticed() {
    let files = files();
    let source = "//! See `cutting/faults.rs` and\n//! docs/physics.md, \"Structure\".\n\nlet a = \"b.rs\"; // robot.rs\n";
    let found: Vec<String> = comments(source);
    assert_eq!(found.len(), 2, "{found:?}");
    let named = named_files(&found[0]);
    let names: Vec<&str> = named.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, ["cutting/faults.rs", "docs/physics.md"]);
    assert_eq!(named_section(named[1].1), Some("Structure"));
    assert!(is_there("tests/integration/references.rs", "src/lib.rs", &files));
    assert!(is_there("integration/references.rs", "src/lib.rs", &files));
    assert!(!is_there("SUMMARY.md", "src/lib.rs", &files));
    assert!(!is_there("src/no_such_file.rs", "src/lib.rs", &files));
    assert_eq!(
        anchor("Maps of the `workspace`, in shards"),
        "maps-of-the-workspace-in-shards"
    );
    assert_eq!(links("[a](b.md)\n```\n[c](d.md)\n```\n[e](#f)"), ["b.md", "#f"]);
}
