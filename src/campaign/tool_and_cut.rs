//! What cut, and what was cut: `[tool]`, and the geometry and speed of a `[[cut]]`.

use super::each_tooth;
use super::shared_keys::{PROCESSES, immersion};
use crate::Result;
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::keys::{self, names};
use crate::campaign::form::section::Section;
use crate::data::{CutGeometry, Process, Tool, ToolKind, USUAL_CHISEL_EDGE_ANGLE_DEG};

/// Keys of `[tool]` that only some kinds have.
const OF_MILLS: [&str; 5] = [
    "corner_radius_mm",
    "lead_angle_deg",
    "pitch_deg",
    "tooth_helix_deg",
    "tooth_radius_offset_mm",
];
const OF_DRILLS: [&str; 3] = [
    "half_point_angle_deg",
    "web_thickness_mm",
    "chisel_edge_angle_deg",
];
const OF_TURNING: [&str; 2] = ["nose_radius_mm", "cutting_edge_angle_deg"];

pub(super) fn tool(top: &Section<'_>) -> Result<Option<Tool>> {
    let Some(section) = top.section("tool", &names(&keys::TOOL))? else {
        return Ok(None);
    };
    // A ball end is an end mill whose corner is as round as can be.
    let kinds = [
        ("endmill", (ToolKind::Endmill, false)),
        ("ballend", (ToolKind::Endmill, true)),
        ("drill", (ToolKind::Drill, false)),
        ("turning", (ToolKind::Turning, false)),
    ];
    let (kind, ball) = section.required(
        "kind",
        section.choice("kind", &kinds)?,
        "\"endmill\", \"ballend\", \"drill\" or \"turning\"",
    )?;
    no_foreign_keys(&section, kind)?;
    if kind == ToolKind::Turning {
        return turning_tool(&section).map(Some);
    }
    let diameter_mm = section.required(
        "diameter_mm",
        section.number("diameter_mm", Bounds::POSITIVE)?,
        "16.0",
    )?;
    let teeth = section.required("teeth", section.whole("teeth", 1, 1000)?, "4")?;
    let each_tooth = each_tooth::read(&section, teeth as usize)?;
    let helix_deg = section.number("helix_deg", Bounds::open(-90.0, 90.0))?;
    let tool = Tool {
        kind,
        diameter_mm,
        teeth: teeth as usize,
        helix_deg: helix_deg.unwrap_or_else(|| each_tooth::mean_helix_deg(&each_tooth)),
        corner_radius_mm: section
            .number("corner_radius_mm", Bounds::closed(0.0, 0.5 * diameter_mm))?
            .unwrap_or(if ball { 0.5 * diameter_mm } else { 0.0 }),
        lead_angle_deg: section
            .number("lead_angle_deg", Bounds::above_up_to(0.0, 90.0))?
            .unwrap_or(90.0),
        half_point_angle_deg: section.number("half_point_angle_deg", Bounds::above_up_to(0.0, 90.0))?,
        web_thickness_mm: section.number("web_thickness_mm", Bounds::open(0.0, diameter_mm))?,
        chisel_edge_angle_deg: section
            .number("chisel_edge_angle_deg", Bounds::open(90.0, 180.0))?
            .unwrap_or(USUAL_CHISEL_EDGE_ANGLE_DEG),
        each_tooth,
    };
    Ok(Some(tool))
}

/// Keys, whose they are, and the word for its kind.
type Foreign = (&'static [&'static str], &'static str, &'static str);

/// Keys of another kind of tool.
fn no_foreign_keys(tool: &Section<'_>, kind: ToolKind) -> Result<()> {
    let (this, foreign): (&str, [Foreign; 2]) = match kind {
        ToolKind::Endmill => (
            "an endmill",
            [
                (&OF_DRILLS, "a drill", "drill"),
                (&OF_TURNING, "a turning tool", "turning"),
            ],
        ),
        ToolKind::Drill => (
            "a drill",
            [
                (&OF_MILLS, "an end mill", "endmill"),
                (&OF_TURNING, "a turning tool", "turning"),
            ],
        ),
        ToolKind::Turning => (
            "a turning tool",
            [
                (&OF_DRILLS, "a drill", "drill"),
                (&OF_MILLS, "an end mill", "endmill"),
            ],
        ),
    };
    for (keys, owner, word) in foreign {
        let Some(key) = keys.iter().find(|key| tool.has(key)) else {
            continue;
        };
        let remedy = match (kind, *key) {
            (ToolKind::Turning, "corner_radius_mm") => "of a turning tool write nose_radius_mm".to_string(),
            (ToolKind::Turning, "lead_angle_deg") => {
                "of a turning tool write cutting_edge_angle_deg, the angle between feed and cutting edge (κr); a catalogue's lead \
                 angle is 90° less that"
                    .to_string()
            }
            _ => format!("take it out, or write kind = \"{word}\""),
        };
        return Err(tool
            .error(key, format!("belongs to {owner}, and this tool is {this}"))
            .remedy(remedy)
            .into());
    }
    Ok(())
}

fn turning_tool(tool: &Section<'_>) -> Result<Tool> {
    if tool.has("diameter_mm") {
        return Err(tool
            .error(
                "diameter_mm",
                "a turning tool has no diameter: the workpiece turns",
            )
            .remedy("give the workpiece's diameter_mm in each [[cut]]")
            .into());
    }
    for (key, why) in [
        ("teeth", "a turning tool has one edge"),
        ("helix_deg", "a turning tool has no helix"),
    ] {
        if tool.has(key) {
            return Err(tool.error(key, why).remedy("take it out").into());
        }
    }
    Ok(Tool {
        kind: ToolKind::Turning,
        diameter_mm: 0.0,
        teeth: 1,
        helix_deg: 0.0,
        corner_radius_mm: tool
            .number("nose_radius_mm", Bounds::NOT_NEGATIVE)?
            .unwrap_or(0.0),
        lead_angle_deg: tool
            .number("cutting_edge_angle_deg", Bounds::closed(1.0, 150.0))?
            .unwrap_or(90.0),
        half_point_angle_deg: None,
        web_thickness_mm: None,
        chisel_edge_angle_deg: USUAL_CHISEL_EDGE_ANGLE_DEG,
        each_tooth: Vec::new(),
    })
}

/// Keys of `[[cut]]` that only some processes have.
const MILLING: [&str; 5] = [
    "feed_per_tooth_mm",
    "axial_depth_mm",
    "immersion",
    "start_deg",
    "exit_deg",
];
const DRILLING: [&str; 3] = ["feed_per_rev_mm", "pilot_diameter_mm", "hole_depth_mm"];
const TURNING: [&str; 4] = [
    "feed_per_rev_mm",
    "depth_of_cut_mm",
    "diameter_mm",
    "cutting_speed_m_per_min",
];

/// What was cut, and the spindle's speed in rpm.
pub(super) fn geometry(cut: &Section<'_>, tool: &Tool) -> Result<(CutGeometry, f64)> {
    let process = cut.required(
        "process",
        cut.choice("process", &PROCESSES)?,
        "\"milling\", \"drilling\" or \"turning\"",
    )?;
    let keys = |process| match process {
        Process::Milling => &MILLING[..],
        Process::Drilling => &DRILLING[..],
        Process::Turning => &TURNING[..],
    };
    let this = process.name();
    for other in Process::ALL.into_iter().filter(|p| *p != process) {
        let strange = |key: &&&str| cut.has(key) && !keys(process).contains(*key);
        if let Some(key) = keys(other).iter().find(strange) {
            let other = other.name();
            let remedy = match (process, *key) {
                (Process::Turning, "axial_depth_mm") => "of a turned cut write depth_of_cut_mm".to_string(),
                _ => format!("take it out, or write process = {other:?}"),
            };
            return Err(cut
                .error(key, format!("belongs to {other}, and this cut is {this}"))
                .remedy(remedy)
                .into());
        }
    }
    if (process == Process::Turning) != (tool.kind == ToolKind::Turning) {
        let (problem, remedy) = match process {
            Process::Turning => (
                "this cut is turning, and [tool] is no turning tool",
                "write kind = \"turning\" in [tool], or keep the turned cuts in a campaign of their own",
            ),
            _ => (
                "[tool] is a turning tool, which neither mills nor drills",
                "write process = \"turning\", or keep the other cuts in a campaign of their own",
            ),
        };
        return Err(cut.error("process", problem).remedy(remedy).into());
    }
    let number = |key: &str, bounds, example| cut.required(key, cut.number(key, bounds)?, example);
    let geometry = match process {
        Process::Milling => CutGeometry::Milling {
            feed_per_tooth_mm: number("feed_per_tooth_mm", Bounds::POSITIVE, "0.05")?,
            axial_depth_mm: {
                let depth_mm = number("axial_depth_mm", Bounds::POSITIVE, "2.0")?;
                each_tooth::check_depth(cut, tool, depth_mm)?;
                depth_mm
            },
            immersion: cut.required(
                "immersion",
                immersion(cut)?,
                "\"slot\" (or start_deg and exit_deg)",
            )?,
        },
        Process::Drilling => CutGeometry::Drilling {
            feed_per_rev_mm: number("feed_per_rev_mm", Bounds::POSITIVE, "0.1")?,
            pilot_diameter_mm: match cut.number("pilot_diameter_mm", Bounds::NOT_NEGATIVE)? {
                Some(pilot) if pilot >= tool.diameter_mm => {
                    return Err(cut
                        .error(
                            "pilot_diameter_mm",
                            format!("is {pilot}, but the tool's diameter is {}", tool.diameter_mm),
                        )
                        .remedy("the pilot hole must be smaller than the tool; 0 where there is none")
                        .into());
                }
                pilot => pilot.unwrap_or(0.0),
            },
            hole_depth_mm: cut.number("hole_depth_mm", Bounds::POSITIVE)?,
        },
        Process::Turning => return turned(cut),
    };
    let spindle_rpm = cut.required(
        "spindle_rpm",
        cut.number("spindle_rpm", Bounds::POSITIVE)?,
        "1200.0",
    )?;
    Ok((geometry, spindle_rpm))
}

/// Part of the spindle speed by which speed, cutting speed and diameter may contradict each other: rounding.
const SPEEDS_AGREE: f64 = 0.02;

/// Two of spindle speed, cutting speed and diameter give the third.
fn turned(cut: &Section<'_>) -> Result<(CutGeometry, f64)> {
    let positive = |key: &str| cut.number(key, Bounds::POSITIVE);
    let required = |key: &str, example| cut.required(key, positive(key)?, example);
    // vc = π D n, in m/min, mm and rpm.
    let per_turn = std::f64::consts::PI / 1000.0;
    let (rpm, speed, diameter) = (
        positive("spindle_rpm")?,
        positive("cutting_speed_m_per_min")?,
        positive("diameter_mm")?,
    );
    let (spindle_rpm, diameter_mm) = match (rpm, speed, diameter) {
        (Some(rpm), Some(speed), Some(diameter)) => {
            let own = per_turn * diameter * rpm;
            if (own / speed - 1.0).abs() > SPEEDS_AGREE {
                return Err(cut
                    .error(
                        "cutting_speed_m_per_min",
                        format!("is {speed}, but {diameter} mm at {rpm} rpm make {own:.1} m/min"),
                    )
                    .remedy(
                        "give two of spindle_rpm, cutting_speed_m_per_min and diameter_mm, or correct one",
                    )
                    .into());
            }
            (rpm, diameter)
        }
        (Some(rpm), None, Some(diameter)) => (rpm, diameter),
        // To a thousandth of a revolution a minute: it is printed.
        (None, Some(speed), Some(diameter)) => {
            let rpm = speed / (per_turn * diameter);
            ((1e3 * rpm).round().max(1.0) / 1e3, diameter)
        }
        (Some(rpm), Some(speed), None) => (rpm, speed / (per_turn * rpm)),
        (Some(_), None, None) => (0.0, required("diameter_mm", "60.0")?),
        (None, _, _) => (required("spindle_rpm", "1200.0")?, 0.0),
    };
    let geometry = CutGeometry::Turning {
        feed_per_rev_mm: required("feed_per_rev_mm", "0.2")?,
        depth_of_cut_mm: required("depth_of_cut_mm", "2.0")?,
        diameter_mm,
    };
    Ok((geometry, spindle_rpm))
}
