//! The keys as JSON Schema, so that editors complete and check the files while they are written.
//!
//! Draft 4, in which open bounds are flags: what [taplo](https://taplo.tamasfe.dev/configuration/developing-schemas.html)
//! (Even Better TOML) supports; other editors read it, too.

use serde_json::{Map, Value, json};

use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::keys::{Holds, Key, ROBOT_FILE, TOP};

/// The files that have a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum SchemaOf {
    /// campaign.toml
    Campaign,
    /// A robot file.
    Robot,
}

/// The schema of a kind of file.
pub fn json_schema(of: SchemaOf) -> Value {
    let (title, keys) = match of {
        SchemaOf::Campaign => ("Lobestone campaign (campaign.toml)", &TOP[..]),
        SchemaOf::Robot => ("Lobestone robot file", &ROBOT_FILE[..]),
    };
    let mut schema = table(keys);
    schema.insert("$schema".into(), json!("http://json-schema.org/draft-04/schema#"));
    schema.insert("title".into(), json!(title));
    Value::Object(schema)
}

fn table(keys: &[Key]) -> Map<String, Value> {
    let mut properties = Map::new();
    for key in keys {
        let mut value = value(key.holds);
        value.insert("description".into(), json!(key.about));
        properties.insert(key.name.into(), value.into());
    }
    let required: Vec<&str> = keys.iter().filter(|k| k.required).map(|k| k.name).collect();
    let mut schema =
        object(json!({ "type": "object", "additionalProperties": false, "properties": properties }));
    // Draft 4 does not allow an empty list.
    if !required.is_empty() {
        schema.insert("required".into(), json!(required));
    }
    schema
}

fn value(holds: Holds) -> Map<String, Value> {
    let numbers = |count: usize| json!({ "type": "array", "items": { "type": "number" }, "minItems": count, "maxItems": count });
    match holds {
        // Not blank: the loader refuses that.
        Holds::Text => object(json!({ "type": "string", "pattern": "\\S" })),
        Holds::Words(words) => object(json!({ "type": "string", "enum": words })),
        Holds::Form(pattern) => object(json!({ "type": "string", "pattern": pattern })),
        Holds::Number(bounds) => number(bounds),
        Holds::Whole(low, high) => {
            let mut schema = object(json!({ "type": "integer" }));
            // All that there are: no bound.
            if (low, high) != (i64::MIN, i64::MAX) {
                schema.insert("minimum".into(), json!(low));
                schema.insert("maximum".into(), json!(high));
            }
            schema
        }
        Holds::Numbers => object(json!({ "type": "array", "items": { "type": "number" }, "minItems": 1 })),
        Holds::Texts => object(json!({ "type": "array", "items": { "type": "string" } })),
        Holds::Array(count) => object(numbers(count)),
        Holds::Rows(columns, rows) => {
            let mut schema = object(json!({ "type": "array", "items": numbers(columns) }));
            if let Some(rows) = rows {
                schema.insert("minItems".into(), json!(rows));
                schema.insert("maxItems".into(), json!(rows));
            }
            schema
        }
        Holds::Section(keys) => table(keys),
        Holds::Sections(keys) => object(json!({ "type": "array", "items": table(keys) })),
    }
}

fn number(bounds: Bounds) -> Map<String, Value> {
    let mut schema = object(json!({ "type": "number" }));
    let ends = [("minimum", "exclusiveMinimum"), ("maximum", "exclusiveMaximum")];
    for ((closed, open), end) in ends.into_iter().zip(bounds.ends()) {
        if let Some((value, is_open)) = end {
            schema.insert(closed.into(), json!(value));
            if is_open {
                schema.insert(open.into(), json!(true));
            }
        }
    }
    schema
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use toml::{Table, Value as Toml};

    use super::*;
    use crate::campaign::Campaign;
    use crate::data::RobotSpec;

    const FULL: &str = include_str!("../../../tests/data/campaign_full.toml");
    const ROBOT: &str = include_str!("../../../datasets/irb6640/robot.toml");
    /// What the full campaign does not use, because it uses what excludes it.
    const MORE: &str = "[orthogonal]\nshear_stress_mpa = 613.0\nfriction_angle_deg = 22.6\nchip_ratio = 0.7\nrake_deg = 12.0\n\
                        [plan]\nlines_hz = 0.2\n[[lobes.tool.segment]]\nlength_mm = 60.0\ndiameter_mm = 12.0\nyoung_gpa = 210.0\n\
                        density_kg_per_m3 = 7850.0\n";

    /// A folder with the files that the full campaign names, and its text.
    fn full() -> (tempfile::TempDir, Table) {
        let folder = tempfile::tempdir().unwrap();
        for file in ["frf/p1.uff", "frf/p2.csv", "force/cut01.txt", "force/cut02.txt"] {
            let path = folder.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "x").unwrap();
        }
        std::fs::write(folder.path().join("robot.toml"), ROBOT).unwrap();
        let text = format!("{FULL}\n{MORE}");
        (folder, text.parse().unwrap())
    }

    /// The loader's complaint about a campaign.
    fn complaint(dir: &Path, campaign: &Table) -> Option<crate::InputError> {
        match Campaign::from_text(dir, &toml::to_string(campaign).unwrap()) {
            Ok(_) => None,
            Err(crate::Error::Input(error)) => Some(*error),
            Err(other) => panic!("{other}"),
        }
    }

    /// Every key with the path to the first table that has it: `["cut", "spindle_rpm"]`.
    fn all(keys: &'static [Key], path: &[&'static str]) -> Vec<(Vec<&'static str>, Key)> {
        let mut found = Vec::new();
        for key in keys {
            let path = [path, &[key.name]].concat();
            found.push((path.clone(), *key));
            if let Holds::Section(keys) | Holds::Sections(keys) = key.holds {
                found.extend(all(keys, &path));
            }
        }
        found
    }

    /// The table that a key stands in; of the cuts the drilling one for keys of drilling.
    fn holder<'a>(campaign: &'a mut Table, path: &[&str]) -> &'a mut Table {
        let drilling = ["feed_per_rev_mm", "pilot_diameter_mm", "hole_depth_mm"];
        let mut table = campaign;
        for name in &path[..path.len() - 1] {
            let wanted = path[path.len() - 1];
            table = match table.get_mut(*name).unwrap_or_else(|| panic!("{path:?}")) {
                Toml::Table(table) => table,
                Toml::Array(tables) => {
                    let number = match (*name, wanted) {
                        ("cut", key) if drilling.contains(&key) => 2,
                        ("cut", "start_deg" | "exit_deg") => 1,
                        ("frf", "quantity" | "force_level_n") => 1,
                        _ => 0,
                    };
                    tables[number].as_table_mut().unwrap()
                }
                other => panic!("{path:?}: {other}"),
            };
        }
        table
    }

    #[test]
    fn the_full_campaign_uses_what_there_is_and_loads() {
        let (folder, campaign) = full();
        assert!(
            complaint(folder.path(), &campaign).is_none(),
            "{:?}",
            complaint(folder.path(), &campaign)
        );
    }

    /// A text where a number should be and the other way round, a wrong word, a number beyond a bound: the loader refuses
    /// each with the words and the bounds that stand in the list; a required key that is taken away it misses.
    #[test]
    fn the_loader_refuses_what_the_schema_refuses() {
        let mut checked = [0; 3];
        for (path, key) in all(&TOP, &[]) {
            let try_with = |value: Option<Toml>| {
                let (folder, mut campaign) = full();
                prepare(&mut campaign, &path);
                let table = holder(&mut campaign, &path);
                match value {
                    Some(value) => drop(table.insert(key.name.into(), value)),
                    None => drop(table.remove(key.name)),
                }
                complaint(folder.path(), &campaign)
            };
            let name = path.join(".");
            let refused = |value: Toml| {
                let shown = value.to_string();
                try_with(Some(value))
                    .unwrap_or_else(|| panic!("{name} = {shown} is not refused"))
                    .to_string()
            };
            if key.required {
                let message = try_with(None)
                    .unwrap_or_else(|| panic!("{name} is not missed"))
                    .to_string();
                assert!(
                    message.contains(key.name) && message.contains("missing") || message.contains("segment"),
                    "{name}: {message}"
                );
                checked[0] += 1;
            }
            match key.holds {
                Holds::Words(words) => {
                    let message = refused(Toml::String("qqqqqqqqqq".into()));
                    for word in words {
                        let of_other_process = ["frequency-domain", "z", "theta"].contains(word);
                        assert!(
                            of_other_process || message.contains(&format!("{word:?}")),
                            "{name}: {message}"
                        );
                    }
                    checked[1] += 1;
                }
                Holds::Number(bounds) => {
                    assert!(
                        refused(Toml::String("x".into())).contains("must be a number"),
                        "{name}"
                    );
                    for (value, side) in bounds.ends().into_iter().zip([-1.0, 1.0]) {
                        let Some((end, is_open)) = value else { continue };
                        let wrong = if is_open {
                            end
                        } else {
                            end + side * (1.0 + end.abs())
                        };
                        let message = refused(Toml::Float(wrong));
                        let own = ["diameter_mm", "corner_radius_mm", "web_thickness_mm"].contains(&key.name);
                        assert!(
                            own || message.contains(&bounds.to_string()),
                            "{name} = {wrong}: {message}"
                        );
                        checked[2] += 1;
                    }
                }
                Holds::Whole(..) => assert!(refused(Toml::Float(1.5)).contains("whole number"), "{name}"),
                Holds::Numbers | Holds::Texts | Holds::Array(_) | Holds::Rows(..) => {
                    assert!(refused(Toml::Float(1.5)).contains("must be a list"), "{name}");
                }
                Holds::Text | Holds::Form(_) => {
                    assert!(refused(Toml::Float(1.5)).contains("must be text"), "{name}");
                }
                Holds::Section(_) | Holds::Sections(_) => {
                    let message = refused(Toml::Float(1.5));
                    assert!(message.contains("section"), "{name}: {message}");
                }
            }
        }
        assert!(
            checked[0] > 30 && checked[1] >= 14 && checked[2] > 50,
            "{checked:?}"
        );
    }

    fn parsed(text: &str) -> Toml {
        Toml::Table(text.parse().unwrap())
    }

    /// Takes away what would exclude a key, or would be missed first.
    fn prepare(campaign: &mut Table, path: &[&str]) {
        let lobes = |campaign: &mut Table, without: &[&str]| {
            let table = campaign["lobes"].as_table_mut().unwrap();
            without.iter().for_each(|key| drop(table.remove(*key)));
        };
        match path {
            [
                "tool",
                "corner_radius_mm"
                | "lead_angle_deg"
                | "pitch_deg"
                | "tooth_helix_deg"
                | "tooth_radius_offset_mm",
            ] => {
                let tool = campaign["tool"].as_table_mut().unwrap();
                tool.insert("kind".into(), Toml::String("endmill".into()));
                tool.remove("half_point_angle_deg");
                tool.remove("web_thickness_mm");
                tool.remove("chisel_edge_angle_deg");
            }
            ["tool", "nose_radius_mm" | "cutting_edge_angle_deg"] => {
                campaign.insert("tool".into(), parsed("kind = \"turning\""));
            }
            [
                "cut",
                "depth_of_cut_mm" | "diameter_mm" | "cutting_speed_m_per_min",
            ] => {
                campaign.insert("tool".into(), parsed("kind = \"turning\""));
                campaign["cut"].as_array_mut().unwrap()[0] = parsed(
                    "id = \"01\"\nfile = \"force/cut01.txt\"\nprocess = \"turning\"\nspindle_rpm = 800.0\n\
                     feed_per_rev_mm = 0.2\ndepth_of_cut_mm = 2.0\ndiameter_mm = 60.0",
                );
            }
            ["orthogonal", "shear_angle_deg"] => {
                campaign["orthogonal"]
                    .as_table_mut()
                    .unwrap()
                    .remove("chip_ratio");
            }
            ["lobes", "coefficients"] => {
                lobes(campaign, &["ktc_n_per_mm2", "method"]);
                let lobes = campaign["lobes"].as_table_mut().unwrap();
                lobes.insert("process".into(), Toml::String("drilling".into()));
            }
            ["lobes", "indentation_n_per_mm3" | "wear_land_mm"] => {
                lobes(campaign, &["method"]);
                let lobes = campaign["lobes"].as_table_mut().unwrap();
                lobes.insert("process".into(), Toml::String("drilling".into()));
            }
            ["lobes", "immersion"] => lobes(campaign, &["radial_ratio", "cut"]),
            ["lobes", "start_deg"] => {
                lobes(campaign, &["radial_ratio", "cut"]);
                campaign["lobes"]
                    .as_table_mut()
                    .unwrap()
                    .insert("exit_deg".into(), Toml::Float(90.0));
            }
            ["lobes", "exit_deg"] => {
                lobes(campaign, &["radial_ratio", "cut"]);
                campaign["lobes"]
                    .as_table_mut()
                    .unwrap()
                    .insert("start_deg".into(), Toml::Float(0.0));
            }
            ["lobes", "mode", "extension_mm_per_rad"] => {
                let lobes = campaign["lobes"].as_table_mut().unwrap();
                lobes.insert("process".into(), Toml::String("drilling".into()));
                lobes.remove("method");
                let mode = lobes["mode"].as_array_mut().unwrap()[0].as_table_mut().unwrap();
                mode.insert("axis".into(), Toml::String("theta".into()));
            }
            ["channel", "gain_n_per_unit"] => {
                campaign["channel"].as_array_mut().unwrap()[1]
                    .as_table_mut()
                    .unwrap()
                    .remove("gain");
            }
            _ => {}
        }
    }

    #[test]
    fn robot_files_too() {
        let folder = tempfile::tempdir().unwrap();
        let load = |robot: &Table| {
            std::fs::write(folder.path().join("r.toml"), toml::to_string(robot).unwrap()).unwrap();
            RobotSpec::load("r.toml", folder.path())
                .map(drop)
                .map_err(|e| e.to_string())
        };
        let robot: Table = ROBOT.parse().unwrap();
        assert_eq!(load(&robot), Ok(()));
        for (path, key) in all(&ROBOT_FILE, &[]) {
            let mut wrong = robot.clone();
            let table = holder(&mut wrong, &path);
            match key.name {
                "origin_m" | "origin_rpy_deg" | "axis" => {
                    for other in ["d_m", "a_m", "alpha_deg", "offset_deg"] {
                        table.remove(other);
                    }
                }
                "rpy_in_flange_deg" => drop(table.remove("tilt_about_flange_y_deg")),
                _ => {}
            }
            // One kind of section a link, whole but for the key that is wrong.
            let section = [
                (
                    &[
                        "section_outer_diameter_m",
                        "section_wall_m",
                        "young_pa",
                        "shear_pa",
                    ][..],
                    &["section_outer_diameter_m", "section_wall_m", "young_pa"][..],
                ),
                (
                    &["section_width_m", "section_height_m"],
                    &[
                        "section_width_m",
                        "section_height_m",
                        "section_wall_m",
                        "section_height_axis",
                    ],
                ),
                (
                    &[
                        "section_area_m2",
                        "section_second_moment_y_m4",
                        "section_second_moment_z_m4",
                        "section_torsion_constant_m4",
                        "section_height_axis",
                    ],
                    &[
                        "section_area_m2",
                        "section_second_moment_y_m4",
                        "section_second_moment_z_m4",
                        "section_torsion_constant_m4",
                        "section_height_axis",
                    ],
                ),
            ];
            if let Some((_, whole)) = section.iter().find(|(of, _)| of.contains(&key.name)) {
                for other in ["section_outer_diameter_m", "section_wall_m"] {
                    table.remove(other);
                }
                for (i, part) in whole.iter().enumerate() {
                    let value = match *part {
                        "section_height_axis" => Toml::Array([0.0, 0.0, 1.0].map(Toml::Float).into()),
                        _ => Toml::Float(1.0 / (1 + 3 * i) as f64),
                    };
                    table.insert((*part).into(), value);
                }
            }
            table.insert(key.name.into(), Toml::Boolean(true));
            let message = load(&wrong).unwrap_err();
            assert!(
                message.contains(key.name) && message.contains("must be"),
                "{path:?}: {message}"
            );
            if key.required {
                let mut without = robot.clone();
                holder(&mut without, &path).remove(key.name);
                assert!(load(&without).is_err(), "{path:?} is not missed");
            }
        }
    }

    #[test]
    fn open_bounds_are_flags() {
        let schema = json_schema(SchemaOf::Campaign);
        let ratio = &schema["properties"]["lobes"]["properties"]["radial_ratio"];
        assert_eq!(
            (
                &ratio["minimum"],
                &ratio["exclusiveMinimum"],
                &ratio["maximum"],
                &ratio["exclusiveMaximum"]
            ),
            (&json!(0.0), &json!(true), &json!(1.0), &Value::Null)
        );
        assert_eq!(schema["required"], json!(["schema"]));
        assert!(schema["properties"]["plan"].get("required").is_none());
        assert_eq!(
            schema["properties"]["cut"]["items"]["additionalProperties"],
            false
        );
    }
}
