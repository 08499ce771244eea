//! What a campaign's `[lobes]` table, its tool and its cuts give for the lobes: coefficients, force and modes.

use crate::analysis::forces::force_records::identify_forces;
use crate::analysis::workbench::Workbench;
use crate::campaign::{
    Campaign, CutGeometry, LobeAxis, LobeMethod, LobeMode, LobesSection, Process, Tool, ToolKind,
};
use crate::cutting::{CfcOptions, DrillPrediction, ForceGroup};
use crate::lobes::drilling::flank_damping::FlankDamping;
use crate::lobes::dynamics::tool_point::ModesHolder;
use crate::lobes::setup::{DrilledHole, LobeCoefficients, LobeCut};
use crate::lobes::{AxisMode, ModalFrf, Mode, PeriodicForce, ProcessDamping, RegenerativeForce};
use crate::{Error, InputError, Result};

/// Something that the lobes need and `campaign.toml` does not say.
fn lacking(campaign: &Campaign, key: &str, problem: impl Into<String>, remedy: &str) -> Error {
    InputError::new(problem)
        .file(campaign.dir.join("campaign.toml"))
        .key(key)
        .remedy(remedy)
        .into()
}

fn lacks_coefficients(campaign: &Campaign, problem: impl Into<String>) -> Error {
    let remedy = "give ktc_n_per_mm2 and krc_n_per_mm2, or add cuts at two feeds or more";
    lacking(campaign, "lobes.ktc_n_per_mm2", problem, remedy)
}

/// The coefficients of the campaign's own cuts of the same process and material, all speeds pooled.
///
/// # Errors
/// No cuts of that process, or several materials of which none is named.
pub fn group_of_cuts(
    campaign: &Workbench,
    section: &LobesSection,
    warnings: &mut Vec<String>,
) -> Result<ForceGroup> {
    let lacks = |problem: &str| lacks_coefficients(campaign, problem);
    if campaign.cuts.is_empty() {
        return Err(lacks(
            "the coefficients are not given and the campaign has no cuts",
        ));
    }
    let cuts = identify_forces(campaign, CfcOptions::default())?;
    warnings.extend(cuts.warnings.iter().cloned());
    let of_process = || {
        cuts.pooled
            .iter()
            .filter(|group| group.process == section.process)
    };
    match of_process().count() {
        0 => return Err(lacks("the campaign has no cuts of the lobes' process")),
        1 => of_process().next(),
        // Of several materials the campaign's own one counts.
        _ => of_process().find(|group| group.material.is_some() && group.material == campaign.material),
    }
    .cloned()
    .ok_or_else(|| lacks("the cuts are of several materials and [material] names none of them"))
}

/// The drill of the campaign at full engagement, predicted from its orthogonal database; the cutting speed is that in the
/// middle (geometric mean) of the lobes' speeds.
///
/// # Errors
/// No `[orthogonal]`, `[tool]` or feed, or a drill whose angles allow no chip.
pub fn predicted_drill(campaign: &Campaign, section: &LobesSection) -> Result<DrillPrediction> {
    let lacks = |key: &str, problem: &str, remedy: &str| lacking(campaign, key, problem, remedy);
    let database = campaign.orthogonal.as_ref().ok_or_else(|| {
        lacks(
            "orthogonal",
            "lobes.coefficients = \"orthogonal\" needs an orthogonal database, and there is none",
            "add [orthogonal] with shear_stress_mpa, friction_angle_deg, chip_ratio and rake_deg",
        )
    })?;
    let tool = campaign.tool.as_ref().filter(|t| t.kind == ToolKind::Drill).ok_or_else(|| {
        lacks(
            "tool",
            "lobes.coefficients = \"orthogonal\" needs the drill's geometry",
            "add [tool] with kind = \"drill\", diameter_mm, teeth, helix_deg, half_point_angle_deg and web_thickness_mm",
        )
    })?;
    let feed_per_rev_mm = section.feed_per_rev_mm.ok_or_else(|| {
        lacks(
            "lobes.feed_per_rev_mm",
            "lobes.coefficients = \"orthogonal\" needs the feed",
            "add feed_per_rev_mm to [lobes]",
        )
    })?;
    let tool = Tool {
        teeth: section.teeth.unwrap_or(tool.teeth),
        half_point_angle_deg: section.half_point_angle_deg.or(tool.half_point_angle_deg),
        ..tool.clone()
    };
    let geometry = CutGeometry::Drilling {
        feed_per_rev_mm,
        pilot_diameter_mm: section
            .hole
            .as_ref()
            .and_then(|h| h.pilot_diameter_mm)
            .unwrap_or(0.0),
        hole_depth_mm: None,
    };
    let rpm = (section.spindle_rpm[0] * section.spindle_rpm[1]).sqrt();
    DrillPrediction::new(&tool, &geometry, rpm, database)
}

/// Ktc and Krc of a group of cuts.
///
/// A drilling regression gives the force normal to the lip, Kfc; its part in the plane of the lobes is Kfc cos κ
/// (κ: half point angle), the axial part Kfc sin κ.
///
/// # Errors
/// Cuts that do not determine the coefficients.
pub fn coefficients_of_group(
    campaign: &Campaign,
    section: &LobesSection,
    group: &ForceGroup,
) -> Result<LobeCoefficients> {
    let value = |label: &str| {
        group.coefficient(label).and_then(|c| c.value).ok_or_else(|| {
            let problem = format!("the campaign's cuts do not determine {label}");
            lacks_coefficients(campaign, problem)
        })
    };
    let (krc_n_per_mm2, kac_n_per_mm2) = match section.process {
        Process::Milling | Process::Turning => (value("Krc")?, None),
        Process::Drilling => {
            let (kfc, kappa) = (value("Kfc")?, half_point_angle_rad(campaign, section)?);
            (kfc * kappa.cos(), Some(kfc * kappa.sin()))
        }
    };
    Ok(LobeCoefficients {
        ktc_n_per_mm2: value("Ktc")?,
        krc_n_per_mm2,
        kac_n_per_mm2,
    })
}

pub(crate) fn half_point_angle_rad(campaign: &Campaign, section: &LobesSection) -> Result<f64> {
    let tool = campaign.tool.as_ref();
    section
        .half_point_angle_deg
        .or(tool.and_then(|t| t.half_point_angle_deg))
        .map(f64::to_radians)
        .ok_or_else(|| {
            InputError::new("drilling lobes need the half point angle")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes.half_point_angle_deg")
                .remedy("give it here or in [tool]; a 135° point has 67.5")
                .into()
        })
}

/// The regenerative force of the campaign's `[lobes]` table and `[tool]`.
///
/// # Errors
/// Where the table lacks something the process needs, or asks for a method that is not here.
pub fn cut_of(
    campaign: &Campaign,
    section: &LobesSection,
    coefficients: LobeCoefficients,
) -> Result<LobeCut> {
    let lacks = |key: &str, problem: &str, remedy: &str| lacking(campaign, key, problem, remedy);
    let tool = campaign.tool.as_ref();
    if let Some(tool) = tool
        && (tool.kind == ToolKind::Turning) != (section.process == Process::Turning)
    {
        return Err(lacks(
            "lobes.process",
            &format!(
                "the lobes are of {}, and [tool] is {} tool",
                section.process.name(),
                match tool.kind {
                    ToolKind::Turning => "a turning",
                    ToolKind::Endmill | ToolKind::Drill => "no turning",
                }
            ),
            "choose the process of the tool, or take [tool] or [lobes] out",
        ));
    }
    let one_edge = (section.process == Process::Turning).then_some(1);
    let teeth = one_edge
        .or(section.teeth)
        .or(tool.map(|t| t.teeth))
        .ok_or_else(|| {
            lacks(
                "lobes.teeth",
                "the number of teeth is not known",
                "give it here or in [tool]",
            )
        })?;
    let LobeCoefficients {
        ktc_n_per_mm2,
        krc_n_per_mm2,
        ..
    } = coefficients;
    match section.process {
        Process::Milling => {
            let immersion = section.immersion.ok_or_else(|| {
                lacks(
                    "lobes.immersion",
                    "milling lobes need the immersion",
                    "give immersion = \"slot\", start_deg and exit_deg, or radial_ratio with cut = \"up\" or \"down\"",
                )
            })?;
            let averaged = section.method == LobeMethod::ZeroOrder;
            let damping = match section.process_damping_n_per_m.filter(|c| *c > 0.0) {
                None => None,
                Some(_) if averaged => {
                    return Err(lacks(
                        "lobes.process_damping_n_per_m",
                        "the zero-order method has no process damping",
                        "use method = \"multi-frequency\" or \"semi-discretisation\", or take it out",
                    ));
                }
                Some(coefficient_n_per_m) => Some(ProcessDamping {
                    coefficient_n_per_m,
                    tool_diameter_mm: tool.map(|t| t.diameter_mm).ok_or_else(|| {
                        lacks(
                            "tool.diameter_mm",
                            "process damping needs the cutting speed, and the tool's diameter is not known",
                            "add a [tool] table",
                        )
                    })?,
                }),
            };
            let force = PeriodicForce::new(ktc_n_per_mm2, krc_n_per_mm2, teeth, immersion, damping)?;
            Ok(match averaged {
                true => LobeCut::Averaged(force.average().into()),
                false => LobeCut::Periodic(force),
            })
        }
        Process::Drilling => RegenerativeForce::drilling_lateral(
            ktc_n_per_mm2,
            krc_n_per_mm2,
            half_point_angle_rad(campaign, section)?,
            teeth,
        )
        .map(|lateral| LobeCut::Averaged(lateral.into())),
        Process::Turning => {
            let kappa_deg = tool
                .filter(|t| t.kind == ToolKind::Turning)
                .map_or(90.0, |t| t.lead_angle_deg);
            RegenerativeForce::turning(krc_n_per_mm2, kappa_deg.to_radians())
                .map(|force| LobeCut::Averaged(force.into()))
        }
    }
}

/// Process damping of a drill's flanks; `None` where it is not asked for.
///
/// # Errors
/// A drill whose point or diameter is not known.
pub fn flank_damping(
    campaign: &Campaign,
    section: &LobesSection,
    lips: usize,
) -> Result<Option<FlankDamping>> {
    let asked = section.process_damping_n_per_m.filter(|c| *c > 0.0);
    let Some(coefficient_n_per_m) = asked.filter(|_| section.process == Process::Drilling) else {
        return Ok(None);
    };
    let hole = DrilledHole::of(campaign.tool.as_ref(), section).ok_or_else(|| {
        lacking(
            campaign,
            "tool.diameter_mm",
            "process damping needs the cutting speed along the lips, and the drill is not known",
            "add a [tool] table with the drill's diameter_mm and half_point_angle_deg",
        )
    })?;
    let kappa = half_point_angle_rad(campaign, section)?;
    let slowest_rpm = section.spindle_rpm[0];
    Ok(Some(FlankDamping::new(
        coefficient_n_per_m,
        hole.radii_mm(),
        kappa,
        lips,
        slowest_rpm,
    )))
}

/// The modes of the `[[lobes.mode]]` table: x and y for the lateral block, z and theta for the axial–torsional one.
///
/// # Errors
/// Where the table has no lateral mode, or one that is no damped mode.
pub fn modes_of_table(campaign: &Campaign, section: &LobesSection) -> Result<ModesHolder> {
    let of_axes = |axes: [LobeAxis; 2]| -> Vec<AxisMode> {
        let on = |mode: &LobeMode| axes.iter().position(|a| *a == mode.axis);
        let modes = section.modes.iter();
        modes
            .filter_map(|mode| {
                Some(AxisMode {
                    axis: on(mode)?,
                    frequency_hz: mode.frequency_hz,
                    damping_ratio: mode.damping_ratio,
                    stiffness_n_per_m: mode.stiffness_n_per_m,
                })
            })
            .collect()
    };
    let lateral = of_axes([LobeAxis::X, LobeAxis::Y]);
    if lateral.is_empty() {
        return Err(
            InputError::new("source = \"modes\" needs at least one mode in x or y")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes.mode")
                .remedy(
                    "add a [[lobes.mode]] table with axis, frequency_hz, damping_ratio and stiffness_n_per_m",
                )
                .into(),
        );
    }
    let axial = of_axes([LobeAxis::Z, LobeAxis::Theta]);
    let axial = match axial.is_empty() {
        true => None,
        false => {
            let frf = ModalFrf::from_axis_modes(&axial)?;
            let table = section.modes.iter();
            let extensions = table
                .filter(|m| matches!(m.axis, LobeAxis::Z | LobeAxis::Theta))
                .map(|m| 1e-3 * m.extension_mm_per_rad);
            // Unwinding is a turn against the rotation, and the longer drill reaches deeper.
            let modes = frf
                .modes()
                .iter()
                .zip(extensions)
                .map(|(mode, extension_m)| Mode {
                    shape: [mode.shape[0] - extension_m * mode.shape[1], mode.shape[1]],
                    ..*mode
                });
            Some(ModalFrf::from_mode_shapes(modes.collect(), [[0.0; 2]; 2])?)
        }
    };
    Ok(ModesHolder {
        lateral: ModalFrf::from_axis_modes(&lateral)?,
        axial,
    })
}
