//! The house keeps its order: data flow one way. Reads the `use` lines and paths of the sources outside tests and says, with the names of
//! the files, which arrow points up, which files import each other in a circle, which room is crowded, which name means two things.
//! The order of the rooms is that of the table in `src/lib.rs`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Files in a room (a folder); subfolders are rooms of their own.
const CROWDED: usize = 16;

/// A module as its path from the crate's root: `["modal", "peaks"]`.
type Module = Vec<String>;

struct House {
    files: BTreeMap<Module, PathBuf>,
    /// Source text without comments, strings and tests.
    code: BTreeMap<Module, String>,
    /// What a module passes on: name → where it comes from.
    passed_on: BTreeMap<Module, BTreeMap<String, Module>>,
    imports: BTreeMap<Module, BTreeSet<Module>>,
}

impl House {
    fn read() -> House {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        let mut files = BTreeMap::new();
        collect(&root, &mut Vec::new(), &mut files);
        let tests = test_modules(&files);
        files.retain(|module, _| !tests.iter().any(|t| module.starts_with(t)));
        let code: BTreeMap<Module, String> = files
            .iter()
            .map(|(module, path)| (module.clone(), code_of(&std::fs::read_to_string(path).unwrap())))
            .collect();
        let mut house = House {
            files,
            code,
            passed_on: BTreeMap::new(),
            imports: BTreeMap::new(),
        };
        let paths: Vec<(Module, bool, Module)> = house
            .code
            .iter()
            .flat_map(|(module, code)| house.paths(module, code))
            .collect();
        for (module, is_public, path) in &paths {
            if *is_public && let Some(name) = path.last() {
                house
                    .passed_on
                    .entry(module.clone())
                    .or_default()
                    .insert(name.clone(), path.clone());
            }
        }
        for (module, _, path) in paths {
            if let Some(target) = house.file_of(&path, 0).filter(|target| *target != module) {
                house.imports.entry(module).or_default().insert(target);
            }
        }
        house
    }

    /// Absolute paths that a file mentions, and whether it passes them on.
    fn paths(&self, module: &Module, code: &str) -> Vec<(Module, bool, Module)> {
        let mut found = Vec::new();
        let mut rest = String::new();
        for statement in code.split_inclusive(';') {
            let Some(at) = use_at(statement) else {
                rest.push_str(statement);
                continue;
            };
            rest.push_str(&statement[..at]);
            let is_public = statement[..at].trim_end().ends_with([')', 'b'])
                && statement[..at]
                    .trim_end()
                    .rsplit(char::is_whitespace)
                    .next()
                    .is_some_and(|w| w.starts_with("pub"));
            for path in leaves(statement[at + 4..].trim_end_matches(';')) {
                found.extend(
                    self.absolute(module, &path)
                        .map(|p| (module.clone(), is_public, p)),
                );
            }
        }
        for word in rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
            let path: Module = word.split("::").map(str::to_string).collect();
            if path.len() > 1 && matches!(path[0].as_str(), "crate" | "super") {
                found.extend(self.absolute(module, &path).map(|p| (module.clone(), false, p)));
            }
        }
        found
    }

    /// From the crate's root; `None`: not of this crate.
    fn absolute(&self, module: &Module, path: &[String]) -> Option<Module> {
        let mut base = module.clone();
        let mut path = path;
        match path.first()?.as_str() {
            "crate" => return Some(path[1..].to_vec()),
            "self" => path = &path[1..],
            "super" => {
                while path.first().is_some_and(|p| p == "super") {
                    base.pop();
                    path = &path[1..];
                }
            }
            child => {
                base.push(child.to_string());
                if !self.files.contains_key(&base) {
                    return None;
                }
                base.pop();
            }
        }
        base.extend(path.iter().cloned());
        Some(base)
    }

    /// The file that a path means, through what modules pass on.
    fn file_of(&self, path: &[String], steps: usize) -> Option<Module> {
        let n = (0..=path.len())
            .rev()
            .find(|n| self.files.contains_key(&path[..*n]))?;
        let module = path[..n].to_vec();
        let onward = path
            .get(n)
            .and_then(|name| self.passed_on.get(&module)?.get(name));
        match onward {
            Some(next) if next.as_slice() != path && steps < 8 => {
                let mut next = next.clone();
                next.extend(path[n + 1..].iter().cloned());
                self.file_of(&next, steps + 1)
            }
            _ => Some(module),
        }
    }
}

fn collect(dir: &Path, module: &mut Module, files: &mut BTreeMap<Module, PathBuf>) {
    for entry in std::fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_string();
        if path.is_dir() {
            module.push(stem);
            collect(&path, module, files);
            module.pop();
        } else if path.extension().is_some_and(|e| e == "rs") && !(module.is_empty() && stem == "main") {
            let mut name = module.clone();
            if stem != "mod" && !(module.is_empty() && stem == "lib") {
                name.push(stem);
            }
            files.insert(name, path);
        }
    }
}

/// Modules that exist for tests only: `#[cfg(test)]` stands before their `mod`.
fn test_modules(files: &BTreeMap<Module, PathBuf>) -> Vec<Module> {
    let mut found = Vec::new();
    for (module, path) in files {
        let text = std::fs::read_to_string(path).unwrap();
        for part in text.split("#[cfg(test)]\n").skip(1) {
            let line = part.lines().find(|l| !l.starts_with("#[")).unwrap_or_default();
            let name = line
                .rsplit_once("mod ")
                .and_then(|(_, rest)| rest.strip_suffix(';'));
            if let Some(name) = name {
                let mut test = module.clone();
                test.push(name.to_string());
                found.push(test);
            }
        }
    }
    found
}

/// Without comments, strings and everything from the inline tests on (they stand last in a file).
fn code_of(text: &str) -> String {
    let text = match text
        .find("\n#[cfg(test)]\nmod ")
        .filter(|at| text[*at..].lines().nth(2).is_some_and(|l| l.ends_with('{')))
    {
        Some(at) => &text[..at],
        None => text,
    };
    let mut out = String::with_capacity(text.len());
    for line in text.lines() {
        let mut chars = line.chars().peekable();
        let mut in_string = false;
        while let Some(c) = chars.next() {
            match c {
                '"' => in_string = !in_string,
                '\\' if in_string => drop(chars.next()),
                '/' if !in_string && chars.peek() == Some(&'/') => break,
                c if !in_string => out.push(c),
                _ => {}
            }
        }
        out.push('\n');
    }
    while let Some(at) = out.find("pub(in ") {
        let end = at + out[at..].find(')').unwrap();
        out.replace_range(at..=end, "pub");
    }
    out
}

/// Where a statement says `use `, as a word of its own.
fn use_at(statement: &str) -> Option<usize> {
    let at = statement.rfind("use ")?;
    let before = statement[..at].chars().next_back();
    before.is_none_or(char::is_whitespace).then_some(at)
}

/// `a::{b, c::d as e}` as `a::b`, `a::c::d`.
fn leaves(tree: &str) -> Vec<Module> {
    fn walk(prefix: &[String], tree: &str, out: &mut Vec<Module>) {
        let tree = tree.trim();
        if let Some(inner) = tree.strip_prefix('{').and_then(|t| t.strip_suffix('}')) {
            let (mut depth, mut start) = (0, 0);
            for (i, c) in inner.char_indices() {
                match c {
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 0 => {
                        walk(prefix, &inner[start..i], out);
                        start = i + 1;
                    }
                    _ => {}
                }
            }
            walk(prefix, &inner[start..], out);
        } else if let Some((head, tail)) = tree.split_once("::") {
            let mut prefix = prefix.to_vec();
            prefix.push(head.trim().to_string());
            walk(&prefix, tail, out);
        } else if !tree.is_empty() {
            let name = tree.split_whitespace().next().unwrap_or_default();
            let mut path = prefix.to_vec();
            if name != "self" {
                path.push(name.to_string());
            }
            out.push(path);
        }
    }
    let mut out = Vec::new();
    walk(&[], tree, &mut out);
    out
}

fn shown(module: &[String]) -> String {
    match module {
        [] => "lib.rs".to_string(),
        _ => format!("src/{}", module.join("/")),
    }
}

/// Groups of nodes that reach each other (Tarjan 1972), largest last.
fn circles(edges: &BTreeMap<Module, BTreeSet<Module>>) -> Vec<Vec<Module>> {
    struct Search<'a> {
        edges: &'a BTreeMap<Module, BTreeSet<Module>>,
        number: BTreeMap<&'a Module, usize>,
        low: BTreeMap<&'a Module, usize>,
        stack: Vec<&'a Module>,
        found: Vec<Vec<Module>>,
    }
    impl<'a> Search<'a> {
        fn visit(&mut self, node: &'a Module) {
            let number = self.number.len();
            self.number.insert(node, number);
            self.low.insert(node, number);
            self.stack.push(node);
            for next in self.edges.get(node).into_iter().flatten() {
                if !self.number.contains_key(next) {
                    self.visit(next);
                    self.low.insert(node, self.low[node].min(self.low[next]));
                } else if self.stack.contains(&next) {
                    self.low.insert(node, self.low[node].min(self.number[next]));
                }
            }
            if self.low[node] == self.number[node] {
                let at = self.stack.iter().position(|n| *n == node).unwrap();
                let group: Vec<Module> = self.stack.drain(at..).cloned().collect();
                if group.len() > 1 {
                    self.found.push(group);
                }
            }
        }
    }
    let mut search = Search {
        edges,
        number: BTreeMap::new(),
        low: BTreeMap::new(),
        stack: Vec::new(),
        found: Vec::new(),
    };
    for node in edges.keys() {
        if !search.number.contains_key(node) {
            search.visit(node);
        }
    }
    search.found.sort_by_key(Vec::len);
    search.found
}

/// The rooms in the order of the table in `lib.rs`; what stands below all of them comes first.
fn order() -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs")).unwrap();
    let of_line = |line: &str| -> Vec<String> {
        let linked = line.split("[`").skip(1).filter_map(|part| part.split_once("`]"));
        linked.map(|(name, _)| name.to_string()).collect()
    };
    let below = text
        .lines()
        .find(|l| l.contains("Below all of them"))
        .expect("lib.rs says what is below all rooms");
    let rows = text.lines().filter(|l| l.contains("| [`"));
    of_line(below)
        .into_iter()
        .chain(rows.flat_map(|row| of_line(row).into_iter().take(1)))
        .collect()
}

#[test]
fn no_arrow_points_up() {
    let (house, order) = (House::read(), order());
    let below = order
        .iter()
        .position(|room| room == "data")
        .expect("lib.rs names the room data");
    let level = |room: &String| {
        order
            .iter()
            .position(|o| o == room)
            .unwrap_or_else(|| panic!("the table in lib.rs has no room {room}"))
    };
    let mut wrong = String::new();
    for (from, targets) in house.imports.iter().filter(|(from, _)| !from.is_empty()) {
        for to in targets.iter().filter(|to| !to.is_empty() && to[0] != from[0]) {
            let (a, b) = (level(&from[0]), level(&to[0]));
            // What stands below all rooms has no order of its own; circles are found by the other test.
            if b > a && (a >= below || b >= below) {
                writeln!(wrong, "{} imports {}, which is above it", shown(from), shown(to)).unwrap();
            }
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn no_circle_of_files_and_none_of_rooms() {
    let house = House::read();
    let mut wrong = String::new();
    for circle in circles(&house.imports) {
        let names: Vec<String> = circle.iter().map(|m| shown(m)).collect();
        writeln!(wrong, "files: {}", names.join(", ")).unwrap();
    }
    let mut rooms: BTreeMap<Module, BTreeSet<Module>> = BTreeMap::new();
    for (from, targets) in house.imports.iter().filter(|(from, _)| !from.is_empty()) {
        for to in targets.iter().filter(|to| !to.is_empty() && to[0] != from[0]) {
            rooms
                .entry(from[..1].to_vec())
                .or_default()
                .insert(to[..1].to_vec());
        }
    }
    for circle in circles(&rooms) {
        let names: Vec<String> = circle.iter().map(|m| shown(m)).collect();
        writeln!(wrong, "rooms: {}", names.join(", ")).unwrap();
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

#[test]
fn no_room_is_crowded() {
    let house = House::read();
    let mut count: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for path in house.files.values() {
        *count.entry(path.parent().unwrap().to_path_buf()).or_default() += 1;
    }
    let crowded: Vec<String> = count
        .iter()
        .filter(|(_, n)| **n > CROWDED)
        .map(|(dir, n)| format!("{} has {n} files", dir.display()))
        .collect();
    assert!(crowded.is_empty(), "{crowded:#?}");
}

#[test]
fn a_name_means_one_thing() {
    let house = House::read();
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (module, code) in &house.code {
        for line in code.lines().map(str::trim_start).filter(|l| l.starts_with("pub")) {
            let mut words = line.split_whitespace().skip(1).skip_while(|w| w.ends_with(')'));
            if matches!(words.next(), Some("struct" | "enum" | "trait" | "type"))
                && let Some(name) = words.next()
            {
                let end = name.find(|c: char| !c.is_alphanumeric()).unwrap_or(name.len());
                places
                    .entry(name[..end].to_string())
                    .or_default()
                    .push(shown(module));
            }
        }
    }
    let twice: Vec<String> = places
        .iter()
        .filter(|(_, at)| at.len() > 1)
        .map(|(name, at)| format!("{name}: {}", at.join(", ")))
        .collect();
    assert!(twice.is_empty(), "{twice:#?}");
}

#[test]
fn physics_knows_no_files() {
    let house = House::read();
    let physics = [
        "data",
        "signal",
        "modal",
        "robot",
        "cutting",
        "lobes",
        "effects",
        "identify",
        "discrepancy",
    ];
    let files = ["ingest", "campaign", "revision", "analysis"];
    let mut wrong = String::new();
    for (from, targets) in house
        .imports
        .iter()
        .filter(|(from, _)| from.first().is_some_and(|r| physics.contains(&r.as_str())))
    {
        for to in targets
            .iter()
            .filter(|to| to.first().is_some_and(|r| files.contains(&r.as_str())))
        {
            writeln!(wrong, "{} imports {}", shown(from), shown(to)).unwrap();
        }
    }
    for (module, code) in house
        .code
        .iter()
        .filter(|(m, _)| m.first().is_some_and(|r| physics.contains(&r.as_str())))
    {
        for word in ["std::fs", "File::open", "&Campaign"] {
            if code.contains(word) {
                writeln!(wrong, "{} says {word}", shown(module)).unwrap();
            }
        }
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

/// One place decides, and tests, what a full disk or an interrupted call leaves behind: `src/files.rs`.
#[test]
fn files_are_written_in_one_place() {
    const WRITERS: [&str; 5] = [
        "fs::write(",
        "fs::rename(",
        "fs::copy(",
        "File::create(",
        "OpenOptions",
    ];
    let house = House::read();
    let mut wrong = String::new();
    for (module, code) in house.code.iter().filter(|(module, _)| **module != ["files"]) {
        for writer in WRITERS.iter().filter(|writer| code.contains(**writer)) {
            let _ = writeln!(wrong, "{} writes by itself ({writer})", shown(module));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
