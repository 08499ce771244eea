//! Files that a campaign names: inside its folder, and really there.

use std::path::{Component, Path, PathBuf};

use crate::InputError;
use crate::text::{closest, shown_briefly as shown};

/// The file that makes a folder a campaign.
pub fn campaign_file(dir: &Path) -> PathBuf {
    dir.join("campaign.toml")
}

/// `text` joined with the campaign folder `dir`, if it names a readable file inside it.
///
/// # Errors
/// Problem and remedy (the caller adds file, key and line) for an absolute path, one that leaves the folder
/// by `..` or through a symbolic link, a missing file, and anything that is not a plain file.
pub fn inside(dir: &Path, text: &str) -> Result<PathBuf, Box<InputError>> {
    let name = shown(text);
    let path = named(dir, text)?;
    let fail = |problem: String, remedy: &str| Err(Box::new(InputError::new(problem).remedy(remedy)));
    let leaves = LEAVES;
    let Ok(real) = path.canonicalize() else {
        let remedy = missing_remedy(dir, text);
        return fail(format!("{name} does not exist in the campaign folder"), &remedy);
    };
    if !dir.canonicalize().is_ok_and(|dir| real.starts_with(dir)) {
        return fail(
            format!("{name} leads out of the campaign folder (symbolic link)"),
            leaves,
        );
    }
    // A named pipe would make the reader wait for ever.
    if !real.is_file() {
        return fail(
            format!("{name} is not a file"),
            "give the path of a measurement file",
        );
    }
    Ok(path)
}

const LEAVES: &str = "copy the file into the campaign folder and give its path from there";

/// As [`inside`], but the file may be missing: it is still to be measured.
///
/// # Errors
/// As [`inside`], except for a missing file.
pub fn planned(dir: &Path, text: &str) -> Result<PathBuf, Box<InputError>> {
    let path = named(dir, text)?;
    match path.symlink_metadata() {
        Ok(_) => inside(dir, text),
        Err(_) => Ok(path),
    }
}

/// `text` joined with `dir`, if it names something inside it.
fn named(dir: &Path, text: &str) -> Result<PathBuf, Box<InputError>> {
    let name = shown(text);
    let fail = |problem: String, remedy: &str| Err(Box::new(InputError::new(problem).remedy(remedy)));
    let leaves = LEAVES;
    let relative = Path::new(text);
    let drive = text.as_bytes().get(1) == Some(&b':') && text.as_bytes()[0].is_ascii_alphabetic();
    if relative.is_absolute() || drive || text.starts_with('\\') {
        return fail(format!("{name} is an absolute path"), leaves);
    }
    let mut depth = 0i64;
    for component in relative.components() {
        depth += match component {
            Component::ParentDir => -1,
            Component::Normal(_) => 1,
            _ => 0,
        };
        if depth < 0 {
            return fail(format!("{name} leaves the campaign folder"), leaves);
        }
    }
    Ok(dir.join(relative))
}

fn missing_remedy(dir: &Path, text: &str) -> String {
    if text.contains('\\') && inside(dir, &text.replace('\\', "/")).is_ok() {
        return format!(
            "write it with forward slashes: {}",
            shown(&text.replace('\\', "/"))
        );
    }
    let relative = Path::new(text);
    let folder = relative.parent().unwrap_or(Path::new(""));
    let mut there: Vec<String> = std::fs::read_dir(dir.join(folder))
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    // The order of a directory is the file system's affair; the message is not.
    there.sort();
    // The same name with another ending, or a slip; but `p2` for a missing `p1` is another measurement.
    let digits = |name: &str| name.chars().filter(char::is_ascii_digit).collect::<String>();
    let wanted = relative.file_name().and_then(|n| n.to_str()).unwrap_or("");
    let stem = |name: &str| Path::new(name).file_stem().map(|s| s.to_owned());
    let near = there
        .iter()
        .find(|name| !wanted.is_empty() && stem(name) == stem(wanted))
        .map(String::as_str)
        .or_else(|| {
            closest(
                wanted,
                there
                    .iter()
                    .map(String::as_str)
                    .filter(|n| digits(n) == digits(wanted)),
            )
        });
    match near {
        Some(near) => format!("did you mean {}?", shown(&folder.join(near).to_string_lossy())),
        None => "copy the file there, or correct the path (it counts from the folder of campaign.toml)"
            .to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("c/frf")).unwrap();
        std::fs::write(dir.path().join("c/frf/p1.uff"), "x").unwrap();
        std::fs::write(dir.path().join("secret.uff"), "x").unwrap();
        dir
    }

    #[test]
    fn a_file_inside_is_found_however_it_is_written() {
        let dir = folder();
        let c = dir.path().join("c");
        for text in ["frf/p1.uff", "./frf/p1.uff", "frf/../frf/p1.uff"] {
            assert!(inside(&c, text).is_ok(), "{text}");
        }
    }

    #[test]
    fn what_leaves_the_folder_is_refused() {
        let dir = folder();
        let c = dir.path().join("c");
        let absolute = c.join("frf/p1.uff");
        for text in [
            "../secret.uff",
            "frf/../../secret.uff",
            "../c/frf/p1.uff",
            absolute.to_str().unwrap(),
            "C:\\frf\\p1.uff",
            "frf",
            ".",
            "frf/p9.uff",
            "frf/p1.uff/x",
            "a\0b",
        ] {
            assert!(inside(&c, text).is_err(), "{text}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_may_point_inside_but_not_outside() {
        let dir = folder();
        let c = dir.path().join("c");
        std::os::unix::fs::symlink("frf/p1.uff", c.join("good.uff")).unwrap();
        std::os::unix::fs::symlink("../secret.uff", c.join("bad.uff")).unwrap();
        std::os::unix::fs::symlink("..", c.join("up")).unwrap();
        assert!(inside(&c, "good.uff").is_ok());
        for text in ["bad.uff", "up/secret.uff"] {
            let error = inside(&c, text).unwrap_err();
            assert!(error.problem.contains("symbolic link"), "{error}");
        }
    }

    #[test]
    fn a_missing_file_suggests_its_neighbour() {
        let dir = folder();
        let c = dir.path().join("c");
        let remedy = |text| inside(&c, text).unwrap_err().remedy.unwrap();
        assert_eq!(remedy("frf/P1.uff"), "did you mean frf/p1.uff?");
        assert_eq!(remedy("frf\\p1.uff"), "write it with forward slashes: frf/p1.uff");
        assert_eq!(remedy("frf/p1.csv"), "did you mean frf/p1.uff?");
        assert!(remedy("frf/p2.uff").starts_with("copy the file"));
        assert!(remedy("frf/other.csv").starts_with("copy the file"));
    }
}
