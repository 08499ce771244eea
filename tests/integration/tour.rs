//! Every command line of `docs/tour.md`, run in an empty folder: it must succeed and print what the page shows.

use std::path::Path;

use crate::sample_reports::{run, same_line};

/// A fenced block of a page: what its fence says it is, its lines.
fn blocks(page: &str) -> Vec<(&str, Vec<&str>)> {
    let mut found: Vec<(&str, Vec<&str>)> = vec![];
    let mut inside = false;
    for line in page.lines() {
        match line.strip_prefix("```") {
            Some(kind) if !inside => found.push((kind, vec![])),
            Some(_) => {}
            None => {
                if let (true, Some((_, lines))) = (inside, found.last_mut()) {
                    lines.push(line);
                }
                continue;
            }
        }
        inside = !inside;
    }
    found
}

/// Lines that the page shows and the program did not print in this order; `…` stands for what is left out.
fn missing<'a>(shown: &[&'a str], printed: &str) -> Vec<&'a str> {
    let mut printed = printed.lines();
    let wanted = shown.iter().filter(|line| line.trim() != "…");
    wanted
        .filter(|line| !printed.by_ref().any(|p| same_line(line, p)))
        .copied()
        .collect()
}

#[test]
fn the_ten_minute_tour_does_what_it_says() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tour.md");
    let page = std::fs::read_to_string(page).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (mut printed, mut commands) = (String::new(), 0);
    for (kind, lines) in blocks(&page) {
        match kind {
            "sh" => {
                for line in lines {
                    let command = line
                        .strip_prefix("lobestone ")
                        .unwrap_or_else(|| panic!("{line}: not a command of this program"));
                    printed = run(command, &[], &folder);
                    commands += 1;
                }
            }
            "text" => {
                let missing = missing(&lines, &printed);
                assert!(
                    missing.is_empty(),
                    "docs/tour.md shows\n{}\nand the program printed\n{printed}",
                    missing.join("\n")
                );
            }
            other => panic!("docs/tour.md: a block of {other:?}"),
        }
    }
    assert!(commands >= 10, "{commands}");
}

/// The book names every page, and every page it names is there.
#[test]
fn the_book_holds_every_page() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let mut named: Vec<&str> = summary
        .split("](")
        .skip(1)
        .filter_map(|rest| rest.split(')').next())
        .collect();
    named.sort_unstable();
    let mut pages: Vec<String> = std::fs::read_dir(&docs)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".md") && name != "SUMMARY.md")
        .collect();
    pages.sort_unstable();
    assert_eq!(named, pages);
}

#[test]
fn a_page_that_shows_something_else_is_noticed() {
    let page = "text\n```sh\nlobestone history cell\n```\nmore\n```text\na\n…\nc 1.5\n```\n";
    assert_eq!(
        blocks(page),
        [
            ("sh", vec!["lobestone history cell"]),
            ("text", vec!["a", "…", "c 1.5"])
        ]
    );
    assert!(missing(&["a", "…", "c 1.5"], "a\nb\nc  1.5\n").is_empty());
    assert_eq!(missing(&["a", "c 1.5"], "a\nc 1.8\n"), ["c 1.5"]);
    assert_eq!(missing(&["c", "a"], "a\nc\n"), ["a"]);
}
