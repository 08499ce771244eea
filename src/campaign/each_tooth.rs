//! Teeth that differ: `pitch_deg`, `tooth_helix_deg` and `tooth_radius_offset_mm` of `[tool]`, one number for each tooth.

use super::form::bounds::Bounds;
use super::form::section::Section;
use crate::Result;
use crate::data::{Tool, Tooth};

const KEYS: [&str; 3] = ["pitch_deg", "tooth_helix_deg", "tooth_radius_offset_mm"];

/// By so much pitches may miss a whole turn: rounding on a drawing. They are scaled to it.
const WHOLE_TURN_DEG: f64 = 0.5;

/// The teeth in the order in which they cut; empty where none of the keys is given.
pub(super) fn read(tool: &Section<'_>, teeth: usize) -> Result<Vec<Tooth>> {
    if !KEYS.iter().any(|key| tool.has(key)) {
        return Ok(Vec::new());
    }
    let lists = [
        ("pitch_deg", Bounds::above_up_to(0.0, 360.0)),
        ("tooth_helix_deg", Bounds::open(-90.0, 90.0)),
        ("tooth_radius_offset_mm", Bounds::closed(-1000.0, 1000.0)),
    ];
    let mut read = [None, None, None];
    for (list, (key, bounds)) in read.iter_mut().zip(lists) {
        *list = of_each_tooth(tool, key, bounds, teeth)?;
    }
    let [pitch_deg, helix_deg, radius_mm] = read;
    let even = 360.0 / teeth as f64;
    let whole: f64 = pitch_deg.as_ref().map_or(360.0, |p| p.iter().sum());
    // One tooth is its own neighbour.
    if (whole - 360.0).abs() > WHOLE_TURN_DEG {
        return Err(tool
            .error("pitch_deg", format!("adds up to {whole}°, not to a whole turn"))
            .remedy("give for each tooth the angle to the one that cuts next; together they make 360")
            .into());
    }
    let usual_helix = tool
        .number("helix_deg", Bounds::open(-90.0, 90.0))?
        .unwrap_or(0.0);
    let of = |list: &Option<Vec<f64>>, k: usize, usual: f64| list.as_ref().map_or(usual, |l| l[k]);
    Ok((0..teeth)
        .map(|k| Tooth {
            pitch_deg: of(&pitch_deg, k, even) * 360.0 / whole,
            helix_deg: of(&helix_deg, k, usual_helix),
            radius_offset_mm: of(&radius_mm, k, 0.0),
        })
        .collect())
}

fn of_each_tooth(tool: &Section<'_>, key: &str, bounds: Bounds, teeth: usize) -> Result<Option<Vec<f64>>> {
    let Some(list) = tool.numbers(key)? else {
        return Ok(None);
    };
    if list.len() != teeth {
        return Err(tool
            .error(key, format!("has {} numbers for {teeth} teeth", list.len()))
            .remedy("give one number for each tooth, in the order in which they cut")
            .into());
    }
    if let Some(value) = list.iter().find(|v| !bounds.contain(**v)) {
        return Err(tool
            .error(key, format!("{value} is out of range"))
            .remedy(format!("each number {bounds}"))
            .into());
    }
    Ok(Some(list))
}

/// The helix of the tool where only those of its teeth are given.
pub(super) fn mean_helix_deg(teeth: &[Tooth]) -> f64 {
    let sum: f64 = teeth.iter().map(|t| t.helix_deg).sum();
    sum / teeth.len().max(1) as f64
}

/// Teeth of different helix must not meet within the depth of a cut.
pub(super) fn check_depth(cut: &Section<'_>, tool: &Tool, depth_mm: f64) -> Result<()> {
    let lag_deg =
        |tooth: &Tooth| (2.0 * depth_mm * tooth.helix_deg.to_radians().tan() / tool.diameter_mm).to_degrees();
    let teeth = &tool.each_tooth;
    let next = teeth.iter().cycle().skip(1);
    let meet = |(this, next): (&Tooth, &Tooth)| this.pitch_deg + lag_deg(next) - lag_deg(this) <= 0.0;
    if teeth.len() > 1 && teeth.iter().zip(next).any(meet) {
        return Err(cut
            .error(
                "axial_depth_mm",
                format!("is {depth_mm}, and within it teeth of [tool] meet"),
            )
            .remedy("check pitch_deg and tooth_helix_deg of [tool], or the depth")
            .into());
    }
    Ok(())
}
