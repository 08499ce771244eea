//! STAND-IN, dropped at merge: reads the cutting half of a campaign, without any validation.

use std::path::Path;

use super::*;
use crate::{Error, InputError, Result};

impl Campaign {
    pub fn load(dir: &Path) -> Result<Campaign> {
        let path = dir.join("campaign.toml");
        let text = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, e))?;
        let table: toml::Table = text
            .parse()
            .map_err(|e: toml::de::Error| InputError::new(e.to_string()).file(&path))?;
        let number = |t: &toml::Table, key: &str| t.get(key).and_then(as_number);
        let string = |t: &toml::Table, key: &str| t.get(key).and_then(|v| v.as_str()).map(str::to_string);
        let tool = table.get("tool").and_then(|v| v.as_table()).map(|t| Tool {
            kind: if string(t, "kind").as_deref() == Some("drill") {
                ToolKind::Drill
            } else {
                ToolKind::Endmill
            },
            diameter_mm: number(t, "diameter_mm").unwrap_or(0.0),
            teeth: number(t, "teeth").unwrap_or(0.0) as usize,
            helix_deg: number(t, "helix_deg").unwrap_or(0.0),
            half_point_angle_deg: number(t, "half_point_angle_deg"),
            web_thickness_mm: number(t, "web_thickness_mm"),
        });
        let mut tool_from_dyno = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if let Some(rows) = table
            .get("dynamometer")
            .and_then(|v| v.get("tool_from_dyno"))
            .and_then(|v| v.as_array())
        {
            for (i, row) in rows.iter().take(3).enumerate() {
                for (j, v) in row.as_array().into_iter().flatten().take(3).enumerate() {
                    tool_from_dyno[i][j] = as_number(v).unwrap_or(0.0);
                }
            }
        }
        let mut cuts = Vec::new();
        for t in table.get("cut").and_then(|v| v.as_array()).into_iter().flatten() {
            let Some(t) = t.as_table() else { continue };
            let geometry = if string(t, "process").as_deref() == Some("drilling") {
                CutGeometry::Drilling {
                    feed_per_rev_mm: number(t, "feed_per_rev_mm").unwrap_or(0.0),
                    pilot_diameter_mm: number(t, "pilot_diameter_mm").unwrap_or(0.0),
                    hole_depth_mm: number(t, "hole_depth_mm"),
                }
            } else {
                CutGeometry::Milling {
                    feed_per_tooth_mm: number(t, "feed_per_tooth_mm").unwrap_or(0.0),
                    axial_depth_mm: number(t, "axial_depth_mm").unwrap_or(0.0),
                    immersion: match (number(t, "start_deg"), number(t, "exit_deg")) {
                        (Some(a), Some(b)) => Immersion {
                            start_rad: a.to_radians(),
                            exit_rad: b.to_radians(),
                        },
                        _ => Immersion::SLOT,
                    },
                }
            };
            cuts.push(Cut {
                id: string(t, "id").unwrap_or_default(),
                file: dir.join(string(t, "file").unwrap_or_default()),
                spindle_rpm: number(t, "spindle_rpm").unwrap_or(0.0),
                geometry,
                order: t.get("order").and_then(|v| v.as_integer()),
                steady_s: t
                    .get("steady_s")
                    .and_then(|v| v.as_array())
                    .and_then(|v| Some([as_number(v.first()?)?, as_number(v.get(1)?)?])),
                line: 0,
            });
        }
        Ok(Campaign {
            dir: dir.to_path_buf(),
            name: string(&table, "name").unwrap_or_default(),
            robot: None,
            postures: Vec::new(),
            points: Vec::new(),
            frfs: Vec::new(),
            tool,
            dynamometer: Dynamometer { tool_from_dyno },
            cuts,
            lobes: None,
            material: table
                .get("material")
                .and_then(|v| v.get("name"))
                .and_then(|v| v.as_str())
                .map(str::to_string),
        })
    }
}

fn as_number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}
