//! Files that a `campaign.toml` names, also where it cannot be loaded.

use std::collections::BTreeSet;

use toml::{Table, Value};

/// Paths as they are written: every `file` of any table, and `robot.model`, which may be the name of a built-in robot.
/// Each once, in alphabetical order; none of a text that is not TOML.
pub fn named_files(text: &str) -> BTreeSet<String> {
    let mut named = BTreeSet::new();
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if let Ok(table) = text.parse::<Table>() {
        if let Some(model) = table
            .get("robot")
            .and_then(|r| r.get("model"))
            .and_then(Value::as_str)
        {
            named.insert(model.to_string());
        }
        collect(&Value::Table(table), &mut named);
    }
    named
}

fn collect(value: &Value, named: &mut BTreeSet<String>) {
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                match value {
                    Value::String(path) if key == "file" => drop(named.insert(path.clone())),
                    other => collect(other, named),
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|v| collect(v, named)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_all_tables_and_the_robot() {
        let text = "name = 'file'\n[robot]\nmodel = 'r.toml'\n[[frf]]\nfile = 'b.uff'\n[[cut]]\nfile = 'a.txt'\n[[cut]]\nfile = 'a.txt'\n";
        let named: Vec<String> = named_files(text).into_iter().collect();
        assert_eq!(named, ["a.txt", "b.uff", "r.toml"]);
        assert!(named_files("[[frf]\nfile = 'b.uff'").is_empty());
    }
}
