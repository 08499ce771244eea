//! What a campaign's `[lobes]` table asks for, as a force and an FRF.

use super::force::RegenerativeForce;
use super::frf::{AxisMode, ModalFrf};
use super::periodic_force::{PeriodicForce, ProcessDamping};
use crate::campaign::{Campaign, LobeAxis, LobeMethod, LobesSection, Process};
use crate::cutting::{CfcOptions, Group, identify_forces};
use crate::{Error, InputError, Result};

/// Cutting coefficients that lobes need, N/mm².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeCoefficients {
    pub ktc_n_per_mm2: f64,
    pub krc_n_per_mm2: f64,
}

impl LobeCoefficients {
    /// The ones the `[lobes]` table gives; `None` where it leaves one out (then they come from the cuts).
    pub fn given(section: &LobesSection) -> Option<Self> {
        Some(LobeCoefficients {
            ktc_n_per_mm2: section.ktc_n_per_mm2?,
            krc_n_per_mm2: section.krc_n_per_mm2?,
        })
    }
}

fn lacks_coefficients(campaign: &Campaign, problem: impl Into<String>) -> Error {
    InputError::new(problem)
        .file(campaign.dir.join("campaign.toml"))
        .key("lobes.ktc_n_per_mm2")
        .remedy("give ktc_n_per_mm2 and krc_n_per_mm2, or add cuts at two feeds or more")
        .into()
}

/// The coefficients of the campaign's own cuts of the same process and material, all speeds pooled.
///
/// # Errors
/// No cuts of that process, or several materials of which none is named.
pub fn group_of_cuts(
    campaign: &Campaign,
    section: &LobesSection,
    warnings: &mut Vec<String>,
) -> Result<Group> {
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
    group: &Group,
) -> Result<LobeCoefficients> {
    let value = |label: &str| {
        group.coefficient(label).and_then(|c| c.value).ok_or_else(|| {
            let problem = format!("the campaign's cuts do not determine {label}");
            lacks_coefficients(campaign, problem)
        })
    };
    let krc_n_per_mm2 = match section.process {
        Process::Milling => value("Krc")?,
        Process::Drilling => value("Kfc")? * half_point_angle_rad(campaign, section)?.cos(),
    };
    Ok(LobeCoefficients {
        ktc_n_per_mm2: value("Ktc")?,
        krc_n_per_mm2,
    })
}

pub(super) fn half_point_angle_rad(campaign: &Campaign, section: &LobesSection) -> Result<f64> {
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

/// The force of a cut, as the method wants it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// Zero-order milling, and drilling.
    Averaged(RegenerativeForce),
    /// Milling with its true dependence on time.
    Periodic(PeriodicForce),
}

impl Cut {
    /// The force averaged over a revolution.
    pub fn average(&self) -> RegenerativeForce {
        match self {
            Cut::Averaged(force) => *force,
            Cut::Periodic(force) => force.average(),
        }
    }
}

/// The regenerative force of the campaign's `[lobes]` table and `[tool]`.
///
/// # Errors
/// Where the table lacks something the process needs, or asks for a method that is not here.
pub fn cut_of(campaign: &Campaign, section: &LobesSection, coefficients: LobeCoefficients) -> Result<Cut> {
    let lacks = |key: &str, problem: &str, remedy: &str| -> Error {
        InputError::new(problem)
            .file(campaign.dir.join("campaign.toml"))
            .key(key)
            .remedy(remedy)
            .into()
    };
    let tool = campaign.tool.as_ref();
    let teeth = section.teeth.or(tool.map(|t| t.teeth)).ok_or_else(|| {
        lacks(
            "lobes.teeth",
            "the number of teeth is not known",
            "give it here or in [tool]",
        )
    })?;
    let LobeCoefficients {
        ktc_n_per_mm2,
        krc_n_per_mm2,
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
                true => Cut::Averaged(force.average()),
                false => Cut::Periodic(force),
            })
        }
        Process::Drilling => RegenerativeForce::drilling_lateral(
            ktc_n_per_mm2,
            krc_n_per_mm2,
            half_point_angle_rad(campaign, section)?,
            teeth,
        )
        .map(Cut::Averaged),
    }
}

/// The lateral (x, y) modes of the `[[lobes.mode]]` table. Modes in z and theta belong to the axial–torsional block
/// and are left out.
///
/// # Errors
/// Where the table has no lateral mode, or one that is no damped mode.
pub fn frf_of_modes(campaign: &Campaign, section: &LobesSection) -> Result<ModalFrf> {
    let lateral: Vec<AxisMode> = section
        .modes
        .iter()
        .filter_map(|mode| {
            let axis = match mode.axis {
                LobeAxis::X => 0,
                LobeAxis::Y => 1,
                LobeAxis::Z | LobeAxis::Theta => return None,
            };
            Some(AxisMode {
                axis,
                frequency_hz: mode.frequency_hz,
                damping_ratio: mode.damping_ratio,
                stiffness_n_per_m: mode.stiffness_n_per_m,
            })
        })
        .collect();
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
    ModalFrf::from_axis_modes(&lateral)
}
