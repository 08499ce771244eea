//! The `[lobes]` section, and how deep a milling cutter is immersed.

use crate::data::{
    HoleSection, LobeAxis, LobeMethod, LobeMode, LobeSource, LobesSection, Posture, Process, Redundancy,
    ToolSegment,
};

use super::shared_keys::{PROCESSES, immersion, posture_ref};
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::keys::{self, names};
use crate::campaign::form::section::Section;
use crate::{Error, Result};

/// E/G where only Young's modulus is given: Poisson's ratio 0.3.
const YOUNG_OVER_SHEAR: f64 = 2.6;

/// Loss factor of a clamped tool where none is given: about ζ = 1 %.
const TOOL_LOSS_FACTOR: f64 = 0.02;

/// More speeds than this are a slip in the step.
const MOST_SPEEDS: f64 = 1e6;

/// Keys and tables of a source or process that is not chosen may stay, so that one can switch between them.
pub(super) fn read(
    top: &Section<'_>,
    postures: &[Posture],
    has_robot: bool,
    has_frfs: bool,
) -> Result<Option<LobesSection>> {
    let Some(lobes) = top.section("lobes", &names(&keys::LOBES))? else {
        return Ok(None);
    };
    let process = lobes.required(
        "process",
        lobes.choice("process", &PROCESSES)?,
        "\"milling\", \"drilling\" or \"turning\"",
    )?;
    let modes = modes(&lobes, process)?;
    let source = source(&lobes, has_robot, has_frfs, !modes.is_empty())?;
    let redundancy = match lobes.section("redundancy", &names(&keys::REDUNDANCY))? {
        Some(section) => Some(redundancy(&section, postures)?),
        None => None,
    };
    let hole = match lobes.section("hole", &names(&keys::HOLE))? {
        Some(section) => Some(hole(&section)?),
        None => None,
    };
    let tool = match lobes.section("tool", &names(&keys::LOBE_TOOL))? {
        Some(section) => tool(&section)?,
        None => Vec::new(),
    };
    let method = method(&lobes, process)?;
    Ok(Some(LobesSection {
        process,
        source,
        method,
        ktc_n_per_mm2: lobes.number("ktc_n_per_mm2", Bounds::POSITIVE)?,
        krc_n_per_mm2: lobes.number("krc_n_per_mm2", Bounds::ANY)?,
        kac_n_per_mm2: lobes.number("kac_n_per_mm2", Bounds::ANY)?,
        from_orthogonal: from_orthogonal(&lobes, process)?,
        teeth: lobes.whole("teeth", 1, 1000)?.map(|n| n as usize),
        immersion: immersion(&lobes)?,
        process_damping_n_per_m: process_damping(&lobes, process)?,
        margin_stiffness_n_per_m: lobes.number("margin_stiffness_n_per_m", Bounds::NOT_NEGATIVE)?,
        margin_damping_ns_per_m: lobes.number("margin_damping_ns_per_m", Bounds::NOT_NEGATIVE)?,
        half_point_angle_deg: lobes.number("half_point_angle_deg", Bounds::above_up_to(0.0, 90.0))?,
        feed_per_rev_mm: lobes.number("feed_per_rev_mm", Bounds::POSITIVE)?,
        spindle_rpm: speeds(&lobes)?,
        modes,
        redundancy,
        tool,
        hole,
    }))
}

/// C of process damping C/V, N/m: given, or of indentation stiffness and wear land, K_sp L²/2.
fn process_damping(lobes: &Section<'_>, process: Process) -> Result<Option<f64>> {
    let given = lobes.number("process_damping_n_per_m", Bounds::NOT_NEGATIVE)?;
    let indentation = lobes.number("indentation_n_per_mm3", Bounds::POSITIVE)?;
    let land = lobes.number("wear_land_mm", Bounds::POSITIVE)?;
    if indentation.is_none() && land.is_none() {
        return Ok(given);
    }
    if given.is_some() {
        return Err(lobes
            .error(
                "process_damping_n_per_m",
                "given together with indentation_n_per_mm3 and wear_land_mm, which say the same",
            )
            .remedy("keep one of the two ways")
            .into());
    }
    let indentation = lobes.required("indentation_n_per_mm3", indentation, "40000.0")?;
    let land = lobes.required("wear_land_mm", land, "0.08")?;
    match process {
        // N/mm³ mm² = N/mm.
        Process::Drilling => Ok(Some(1e3 * 0.5 * indentation * land * land)),
        _ => Err(lobes
            .error("indentation_n_per_mm3", "is for the lobes of a drill")
            .remedy("give process_damping_n_per_m for milling")
            .into()),
    }
}

fn from_orthogonal(lobes: &Section<'_>, process: Process) -> Result<bool> {
    let asked = lobes
        .choice("coefficients", &[("orthogonal", true)])?
        .unwrap_or(false);
    if asked && process != Process::Drilling {
        return Err(lobes
            .error("coefficients", "only those of a drill are predicted for the lobes")
            .remedy("take it out and give ktc_n_per_mm2 and krc_n_per_mm2; `lobestone cfc` prints the prediction for end mills")
            .into());
    }
    if asked && lobes.has("ktc_n_per_mm2") {
        return Err(lobes
            .error(
                "coefficients",
                "given together with ktc_n_per_mm2, which says the same",
            )
            .remedy("keep one of the two")
            .into());
    }
    Ok(asked)
}

fn source(lobes: &Section<'_>, has_robot: bool, has_frfs: bool, has_modes: bool) -> Result<LobeSource> {
    let words = [
        ("model", LobeSource::Model),
        ("measured", LobeSource::Measured),
        ("modes", LobeSource::Modes),
    ];
    let source = lobes.required(
        "source",
        lobes.choice("source", &words)?,
        "\"model\", \"measured\" or \"modes\"",
    )?;
    let (there, wanted) = match source {
        LobeSource::Model => (has_robot, "[robot]"),
        LobeSource::Measured => (has_frfs, "[[frf]]"),
        LobeSource::Modes => (has_modes, "[[lobes.mode]]"),
    };
    if there {
        return Ok(source);
    }
    Err(lobes
        .error("source", format!("this source needs {wanted}, and there is none"))
        .remedy(format!(
            "add {wanted}, or choose another source: \"model\", \"measured\", \"modes\""
        ))
        .into())
}

fn method(lobes: &Section<'_>, process: Process) -> Result<LobeMethod> {
    let milling = [
        ("zero-order", LobeMethod::ZeroOrder),
        ("multi-frequency", LobeMethod::MultiFrequency),
        ("semi-discretisation", LobeMethod::SemiDiscretisation),
        ("semi-discretization", LobeMethod::SemiDiscretisation),
    ];
    // The force of a turned cut does not change over a turn: the zero order is all there is.
    let turning = &milling[..1];
    let drilling = [("frequency-domain", LobeMethod::FrequencyDomain)];
    let (words, usual) = match process {
        Process::Milling => (&milling[..], LobeMethod::ZeroOrder),
        Process::Drilling => (&drilling[..], LobeMethod::FrequencyDomain),
        Process::Turning => (turning, LobeMethod::ZeroOrder),
    };
    Ok(lobes.choice("method", words)?.unwrap_or(usual))
}

fn speeds(lobes: &Section<'_>) -> Result<[f64; 3]> {
    let key = "spindle_rpm";
    let example = "[100.0, 1500.0, 1.0]";
    let speeds @ [from, to, step] = lobes.required(key, lobes.array(key, example)?, example)?;
    let problem = if from <= 0.0 {
        format!("starts at {from} rpm; it must be above 0")
    } else if to < from {
        format!("runs backwards from {from} to {to} rpm")
    } else if step <= 0.0 {
        format!("has the step {step}; it must be above 0")
    } else if (to - from) / step > MOST_SPEEDS {
        "holds more than a million speeds".to_string()
    } else {
        return Ok(speeds);
    };
    Err(lobes
        .error(key, problem)
        .remedy(format!("from, to, step in rpm: {key} = {example}"))
        .into())
}

fn modes(lobes: &Section<'_>, process: Process) -> Result<Vec<LobeMode>> {
    let axes = [
        ("x", LobeAxis::X),
        ("y", LobeAxis::Y),
        ("z", LobeAxis::Z),
        ("theta", LobeAxis::Theta),
    ];
    let axes = match process {
        Process::Milling | Process::Turning => &axes[..2],
        Process::Drilling => &axes[..],
    };
    let mut out = Vec::new();
    for mode in lobes.sections("mode", &names(&keys::MODE))? {
        let number = |key: &str, bounds, example| mode.required(key, mode.number(key, bounds)?, example);
        let axis = mode.required("axis", mode.choice("axis", axes)?, "\"x\"")?;
        let extension = mode.number("extension_mm_per_rad", Bounds::ANY)?;
        if axis != LobeAxis::Theta && extension.is_some() {
            return Err(mode
                .error("extension_mm_per_rad", "belongs to a mode in theta")
                .remedy("take it out, or make it a mode with axis = \"theta\"")
                .into());
        }
        out.push(LobeMode {
            axis,
            extension_mm_per_rad: extension.unwrap_or(0.0),
            frequency_hz: number("frequency_hz", Bounds::POSITIVE, "603.0")?,
            damping_ratio: number("damping_ratio", Bounds::open(0.0, 1.0), "0.039")?,
            stiffness_n_per_m: number("stiffness_n_per_m", Bounds::POSITIVE, "5.59e6")?,
        });
    }
    Ok(out)
}

fn elbow_step(section: &Section<'_>, posture: &Posture) -> Result<Option<f64>> {
    let key = "elbow_step_deg";
    let step = section.number(key, Bounds::closed(1.0, 180.0))?;
    if step.is_some() && posture.joints_deg.len() != 7 {
        return Err(section
            .error(
                key,
                format!(
                    "the elbow turns with the tool at rest where an arm has seven joints; this one has {}",
                    posture.joints_deg.len()
                ),
            )
            .remedy("take the key out")
            .into());
    }
    Ok(step)
}

fn redundancy(section: &Section<'_>, postures: &[Posture]) -> Result<Redundancy> {
    let posture = posture_ref(section, postures)?;
    let step_deg = section.number("step_deg", Bounds::closed(0.01, 180.0))?;
    let forbidden_deg = section
        .rows::<2>("forbidden_deg", "[[200.0, 240.0]]")?
        .unwrap_or_default();
    for (i, [from, to]) in forbidden_deg.iter().enumerate() {
        let inside = Bounds::closed(-360.0, 720.0);
        if from >= to || to - from > 360.0 || !inside.contain(*from) || !inside.contain(*to) {
            let mut error = section
                .error(
                    "forbidden_deg",
                    format!("the band from {from} to {to} degrees is none"),
                )
                .remedy(
                    "from the smaller to the larger angle; a band through zero is written [350.0, 370.0]",
                );
            error.key = error.key.map(|key| format!("{key}[{i}]"));
            return Err(error.into());
        }
    }
    Ok(Redundancy {
        posture,
        step_deg: section.required("step_deg", step_deg, "5.0")?,
        forbidden_deg,
        elbow_step_deg: elbow_step(section, &postures[posture])?,
    })
}

fn tool(section: &Section<'_>) -> Result<Vec<ToolSegment>> {
    let mut out = Vec::new();
    for part in section.sections("segment", &names(&keys::SEGMENT))? {
        let needed = |key: &str, example| part.required(key, part.number(key, Bounds::POSITIVE)?, example);
        let diameter_mm = needed("diameter_mm", "12.0")?;
        let young_gpa = needed("young_gpa", "210.0")?;
        let segment = ToolSegment {
            length_mm: needed("length_mm", "60.0")?,
            diameter_mm,
            bore_mm: part.number("bore_mm", Bounds::NOT_NEGATIVE)?.unwrap_or(0.0),
            flute_ratio: part
                .number("flute_ratio", Bounds::above_up_to(0.0, 1.0))?
                .unwrap_or(1.0),
            young_gpa,
            shear_gpa: part
                .number("shear_gpa", Bounds::POSITIVE)?
                .unwrap_or(young_gpa / YOUNG_OVER_SHEAR),
            density_kg_per_m3: needed("density_kg_per_m3", "7850.0")?,
            loss_factor: part
                .number("loss_factor", Bounds::closed(0.0, 1.0))?
                .unwrap_or(TOOL_LOSS_FACTOR),
            twist_coupling: part
                .number("twist_coupling", Bounds::closed(-0.9, 0.9))?
                .unwrap_or(0.0),
        };
        if segment.bore_mm >= segment.flute_ratio * segment.diameter_mm {
            return Err(part
                .error("bore_mm", "the bore leaves nothing of the tool")
                .remedy("it must be below diameter_mm times flute_ratio")
                .into());
        }
        // Poisson's ratio E/(2G) − 1 lies between 0 and ½.
        if !(2.0..=3.0).contains(&(young_gpa / segment.shear_gpa)) {
            return Err(part
                .error(
                    "shear_gpa",
                    format!(
                        "{} GPa does not go with {young_gpa} GPa of Young's modulus",
                        segment.shear_gpa
                    ),
                )
                .remedy("E/G lies between 2 and 3; leave shear_gpa out to have E/2.6")
                .into());
        }
        out.push(segment);
    }
    if out.is_empty() {
        return Err(section
            .error("segment", "the tool has no segment")
            .remedy("add [[lobes.tool.segment]] tables from the holder face to the tip: length_mm, diameter_mm, young_gpa, density_kg_per_m3")
            .into());
    }
    Ok(out)
}

fn hole(section: &Section<'_>) -> Result<HoleSection> {
    let usual = HoleSection::default();
    let grades: [(&str, u32); 8] = std::array::from_fn(|i| (keys::HOLE_TOLERANCES[i], 6 + i as u32));
    let tolerance = |key, usual| Ok::<_, Error>(section.number(key, Bounds::POSITIVE)?.unwrap_or(usual));
    Ok(HoleSection {
        thrust_n: section.number("thrust_n", Bounds::ANY)?,
        torque_nm: section.number("torque_nm", Bounds::NOT_NEGATIVE)?,
        lateral_n: section.number("lateral_n", Bounds::NOT_NEGATIVE)?,
        pilot_diameter_mm: section.number("pilot_diameter_mm", Bounds::NOT_NEGATIVE)?,
        position_tolerance_mm: tolerance("position_tolerance_mm", usual.position_tolerance_mm)?,
        perpendicularity_tolerance_deg: tolerance(
            "perpendicularity_tolerance_deg",
            usual.perpendicularity_tolerance_deg,
        )?,
        diameter_grade: section.choice("diameter_tolerance", &grades)?,
    })
}
