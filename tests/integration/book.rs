//! The book in `docs`: every command in it is run, and it says everything it has to.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::sample_reports::{run, same_line};
use crate::support::{blind, document};

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn page(name: &str) -> String {
    std::fs::read_to_string(project().join("docs").join(name)).unwrap()
}

/// The pages that docs/SUMMARY.md names, in its order.
fn pages() -> Vec<String> {
    let summary = page("SUMMARY.md");
    let links = summary.split("](").skip(1);
    links
        .filter_map(|rest| Some(rest.split_once(')')?.0.to_string()))
        .collect()
}

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
        .filter(|line| !printed.by_ref().any(|p| is_shown(line, p)))
        .copied()
        .collect()
}

/// Is a printed line the shown one, or its beginning where that ends with `…`?
fn is_shown(shown: &str, printed: &str) -> bool {
    match shown.strip_suffix(" …") {
        Some(beginning) => {
            let words = beginning.split_whitespace().count();
            let same: Vec<&str> = printed.split_whitespace().take(words).collect();
            same_line(beginning, &same.join(" "))
        }
        None => same_line(shown, printed),
    }
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        match from.is_dir() {
            true => copy_folder(&from, &to),
            false => drop(std::fs::copy(&from, &to).unwrap()),
        }
    }
}

/// Runs the `sh` blocks of a page in an empty folder, in their order; a `text` block is what the last command prints. How
/// many commands there were. Blocks `sh yours` need files that only a user has, `text example` shows something else.
fn run_page(name: &str) -> usize {
    let page = page(name);
    let folder = tempfile::tempdir().unwrap();
    let (mut printed, mut commands) = (String::new(), 0);
    for (kind, lines) in blocks(&page) {
        match kind {
            "sh" => {
                for line in lines {
                    commands += 1;
                    if let Some(command) = line.strip_prefix("lobestone ") {
                        let arguments = words(command);
                        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
                        printed = run(arguments[0], &arguments[1..], &folder);
                        continue;
                    }
                    // The only other command of the book.
                    match line.split(' ').collect::<Vec<_>>()[..] {
                        ["cp", "-r", from, to] => copy_folder(&project().join(from), &folder.path().join(to)),
                        _ => panic!("docs/{name}: {line}: neither this program nor cp -r FROM TO"),
                    }
                }
            }
            "text" => {
                let missing = missing(&lines, &printed);
                assert!(
                    missing.is_empty(),
                    "docs/{name} shows\n{}\nand the program printed\n{printed}",
                    missing.join("\n")
                );
            }
            "sh yours" => {
                let ours = |line: &&str| line.starts_with("lobestone ");
                assert!(lines.iter().all(ours), "docs/{name}: {lines:?}");
            }
            // Python is run by scripts/wheel/tests.
            "text example" | "toml" | "csv" | "json" | "rust" | "python" => (),
            other => panic!("docs/{name}: a block of {other:?}"),
        }
    }
    commands
}

/// A command line as a shell splits it: blanks part words but not within double quotes.
fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ' ' if !quoted => words.push(String::new()),
            c => words.last_mut().unwrap().push(c),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[test]
fn the_ten_minute_tour_does_what_it_says() {
    assert!(run_page("tour.md") >= 10);
}

#[test]
fn the_tutorial_does_what_it_says() {
    assert!(run_page("tutorial.md") >= 10);
}

#[test]
fn every_other_page_does_what_it_says() {
    let others = pages()
        .into_iter()
        .filter(|p| p != "tour.md" && p != "tutorial.md");
    assert!(others.map(|page| run_page(&page)).sum::<usize>() >= 8);
}

/// The examples of the README are what the program prints on the test campaigns; `CAMPAIGN` is a copy of one that misses the flexible
/// tool. (`scripts/readme_examples.py` writes their numbers anew.)
#[test]
fn the_readme_shows_what_the_program_prints() {
    let readme = std::fs::read_to_string(project().join("README.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let campaigns = "tests/data/blind";
    copy_folder(&project().join(campaigns), &folder.path().join(campaigns));
    copy_folder(
        &project().join(campaigns).join("frf-9114"),
        &folder.path().join("CAMPAIGN"),
    );
    let examples = blocks(&readme);
    let mut commands = 0;
    for (_, lines) in examples.iter().filter(|(kind, _)| *kind == "text") {
        let mut places: Vec<usize> = (0..lines.len()).filter(|i| lines[*i].starts_with('$')).collect();
        places.push(lines.len());
        for (command, shown) in places.windows(2).map(|w| (lines[w[0]], &lines[w[0] + 1..w[1]])) {
            let Some(command) = command.strip_prefix("$ lobestone ") else {
                panic!("README.md: {command}: no command of this program");
            };
            let arguments = words(command.split('#').next().unwrap());
            let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
            let printed = run(arguments[0], &arguments[1..], &folder);
            let is_output = |line: &&&str| !line.is_empty() && !line.trim_start().starts_with('#');
            let shown: Vec<&str> = shown.iter().filter(is_output).copied().collect();
            let missing = missing(&shown, &printed);
            assert!(
                missing.is_empty(),
                "README.md, {command}: shows\n{}\nand the program printed\n{printed}",
                missing.join("\n")
            );
            commands += 1;
        }
    }
    assert!(commands >= 12, "{commands}");
}

/// The book names every page, and every page it names is there; so is every page and section that a page refers to.
#[test]
fn the_book_holds_together() {
    let docs = project().join("docs");
    let mut named = pages();
    named.sort_unstable();
    let mut there: Vec<String> = std::fs::read_dir(&docs)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".md") && name != "SUMMARY.md")
        .collect();
    there.sort_unstable();
    assert_eq!(named, there);
    for name in &there {
        let text = page(name);
        for link in text
            .split("](")
            .skip(1)
            .filter_map(|rest| Some(rest.split_once(')')?.0))
        {
            let target: PathBuf = docs.join(link.split('#').next().unwrap());
            assert!(link.starts_with("http") || target.exists(), "docs/{name}: {link}");
        }
    }
}

/// Every effect stands in the catalogue, with all that `explain` says of it.
#[test]
fn the_catalogue_holds_every_effect() {
    let joined = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let catalogue = joined(&page("effects.md"));
    let effects = document(&["explain"])["effects"].as_array().unwrap().clone();
    assert!(effects.len() >= 23);
    for effect in &effects {
        let id = effect["effect"].as_str().unwrap();
        let sources = effect["sources"].as_array().unwrap().iter();
        let parts = ["explanation", "fingerprint", "lab_check", "typical"].map(|key| &effect[key]);
        let texts = parts
            .into_iter()
            .chain(sources)
            .map(|text| joined(text.as_str().unwrap()));
        for text in texts.chain([format!("### `{id}`")]) {
            assert!(
                catalogue.contains(&text),
                "docs/effects.md lacks of {id}: {text}\nrun python3 scripts/effect_catalogue.py"
            );
        }
        // Simulated cuts always have edge forces: there they are never missing.
        let own = catalogue
            .split("### `")
            .find(|part| part.starts_with(&format!("{id}`")))
            .unwrap();
        let shown = own.contains(&format!("(pictures/effects/{id}.png)")) && own.contains("**Look-alikes.**");
        assert!(
            shown || id == "edge-force",
            "{id}: run python3 scripts/effect_fingerprints.py {id}"
        );
    }
}

/// A section of the JSON reference; with the lines about all commands.
fn section(command: &str) -> String {
    let reference = page("json.md");
    let (general, _) = reference.split_once("\n## ").unwrap();
    let own = reference
        .split("\n## ")
        .find(|part| part.starts_with(&format!("`{command}`")))
        .unwrap_or_else(|| panic!("docs/json.md has no section ## `{command}`"));
    format!("{general}\n{own}")
}

/// Keys at the top of a document that the reference does not name.
fn undocumented(section: &str, document: &Value) -> Vec<String> {
    let named = |key: &str| {
        section.match_indices(&format!("`{key}")).any(|(at, found)| {
            let after = section[at + found.len()..].chars().next();
            !after.is_some_and(|c| c.is_alphanumeric() || c == '_')
        })
    };
    let keys = document.as_object().unwrap().keys();
    keys.filter(|key| !named(key)).cloned().collect()
}

/// What of a document is not as the schema of its command says, and which keys the schema does not know. Knows the words of JSON
/// Schema that those schemas use; `scripts/document_schemas.py check` asks an independent validator.
fn against_schema(value: &Value, schema: &Value, root: &Value, path: &str, wrong: &mut Vec<String>) {
    let schema = match schema.get("$ref") {
        Some(whole) if whole == "#" => root,
        _ => schema,
    };
    // Anything: what is there was never seen when the schema was drawn.
    if schema.as_object().is_none_or(|words| words.is_empty()) {
        return;
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(n) if n.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let is = |word: &Value| word == kind || (word == "number" && kind == "integer");
    let right = match &schema["type"] {
        Value::Array(words) => words.iter().any(is),
        Value::Null => true,
        word => is(word),
    };
    if !right {
        wrong.push(format!("{path} is {kind}, should be {}", schema["type"]));
    }
    for key in schema["required"].as_array().into_iter().flatten() {
        if value.get(key.as_str().unwrap()).is_none() {
            wrong.push(format!("{path} lacks {key}"));
        }
    }
    for (k, item) in value.as_array().into_iter().flatten().enumerate() {
        against_schema(item, &schema["items"], root, &format!("{path}[{k}]"), wrong);
    }
    for (key, inner) in value.as_object().into_iter().flatten() {
        let of_key = schema["properties"]
            .get(key)
            .or(schema.get("additionalProperties"));
        match of_key {
            Some(of_key) => against_schema(inner, of_key, root, &format!("{path}.{key}"), wrong),
            None => wrong.push(format!("{path}.{key} is not in the schema")),
        }
    }
}

#[test]
fn a_document_of_another_form_is_noticed() {
    let schema = serde_json::json!({
        "type": "object",
        "required": ["a"],
        "properties": {
            "a": { "type": ["null", "number"] },
            "list": { "type": "array", "items": { "type": "object", "properties": { "x": { "type": "string" } } } },
            "both": { "$ref": "#" },
        },
    });
    let wrong = |document: Value| {
        let mut wrong = Vec::new();
        against_schema(&document, &schema, &schema, "$", &mut wrong);
        wrong
    };
    assert!(wrong(serde_json::json!({ "a": null, "list": [{ "x": "y" }], "both": { "a": 1 } })).is_empty());
    let told = wrong(serde_json::json!({ "list": [{ "x": 5 }, { "z": 1 }], "both": { "a": "text" } }));
    assert_eq!(
        told,
        [
            "$ lacks \"a\"",
            "$.both.a is string, should be [\"null\",\"number\"]",
            "$.list[0].x is integer, should be \"string\"",
            "$.list[1].z is not in the schema",
        ]
    );
}

/// Fails where a document has a key that the JSON reference or the schema of its command does not name, or is not as that says.
pub fn assert_documented(command: &str, document: &Value) {
    let printed = crate::support::lobestone(&["schema", command]).stdout;
    let schema: Value = serde_json::from_str(&printed).unwrap();
    let mut wrong = Vec::new();
    against_schema(document, &schema, &schema, "$", &mut wrong);
    assert!(
        wrong.is_empty(),
        "{command}: {wrong:#?}\na new key: python3 scripts/document_schemas.py draw PROGRAM {command}"
    );
    let keys = undocumented(&section(command), document);
    assert!(
        keys.is_empty(),
        "docs/json.md, section `{command}`, lacks {keys:?}"
    );
}

#[test]
fn an_undocumented_key_is_noticed() {
    let section = "`dir`, `nodes[]: {x}`, `error {nrms}` and `file_name`";
    let keys = |document: Value| undocumented(section, &document);
    assert!(keys(serde_json::json!({ "dir": 1, "nodes": 2, "error": 3 })).is_empty());
    assert_eq!(
        keys(serde_json::json!({ "dir": 1, "file": 2, "x": 3 })),
        ["file", "x"]
    );
}

/// Every command has its section, and every key of what it prints stands there. `thesis` and `demo`, which take long, are
/// held against the page where they are run anyway (demo.rs).
#[test]
fn the_json_reference_names_every_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    let (frf, cell, out) = (path("frf"), path("cell"), path("out"));
    copy_folder(&blind("frf-9112"), Path::new(&frf));
    copy_folder(&project().join("datasets/campaigns/first-cell"), Path::new(&cell));
    let force = blind("force-9400");
    let force = force.to_str().unwrap();
    let frf_file = path("frf/frf/p1.uff");
    let mut commands: Vec<Vec<&str>> = vec![
        vec!["inspect", &frf_file],
        vec!["cfc", force],
        vec!["modal", &frf],
        vec!["model", &frf, "--matrices"],
        vec!["calibrate", &frf],
        vec!["compare", &frf],
        vec!["compare", force],
        vec!["diagnose", &frf],
        vec!["explain"],
        vec!["explain", "runout"],
        vec!["add", &frf, "time-delay"],
        vec!["history", &frf],
        vec!["undo", &frf],
        vec!["lobes", &cell],
        vec!["report", &frf, "--no-diagnosis"],
        vec!["simulate", "--out", &out, "--kind", "direct", "--seed", "11"],
        vec!["export", &frf, "--what", "frf,modes", "--out", &out],
        vec!["completions", "bash"],
        vec!["man"],
        vec!["man", "--out", &out],
        vec!["init", &cell, "--force"],
    ];
    let map = path("map");
    if cfg!(feature = "parquet") {
        let grid = ["--x-m", "-1.2", "--y-m", "0.8", "--z-m", "0.6", "--shard"];
        let sweep = |shard: &'static str| [&["sweep", &frf, "--out", &map], &grid[..], &[shard]].concat();
        let lobes = "[lobes]\nprocess = \"drilling\"\nsource = \"model\"\nktc_n_per_mm2 = 1000.0\nkrc_n_per_mm2 = 600.0\n\
                     teeth = 2\nhalf_point_angle_deg = 67.5\nspindle_rpm = [100.0, 1500.0, 10.0]\n";
        let file = path("frf/campaign.toml");
        let campaign = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, format!("{campaign}\n{lobes}")).unwrap();
        commands.extend([
            sweep("1/2"),
            sweep("1/2"),
            sweep("2/2"),
            vec!["sweep", "--merge", "--out", &map],
        ]);
    }
    let (list, results) = (path("nights.csv"), path("results"));
    std::fs::write(
        &list,
        "campaign,robot,date\nfrf,r1,2026-11-22\nnowhere,r1,2026-11-23\n",
    )
    .unwrap();
    commands.extend([
        vec!["batch", &list, "--out", &results, "--do", "calibrate"],
        vec!["fleet", &results],
        vec!["schema", "campaign"],
        vec!["schema", "robot"],
    ]);
    for command in &commands {
        assert_documented(command[0], &document(command));
    }
    use clap::CommandFactory;
    for command in lobestone::commands::Cli::command().get_subcommands() {
        section(command.get_name());
    }
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
    assert_eq!(
        words("init cell --name \"my cell\""),
        ["init", "cell", "--name", "my cell"]
    );
}
