//! Limits and stiffness over the workspace of the robot model: the work behind `lobestone sweep`.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::analysis::stability::lobe_model::{Asked, ModelState};
use crate::analysis::stability::lobes::CutForce;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, LobeMethod, LobeSource, LobesSection, Posture};
use crate::lobes::best_speed::{BestSpeed, best_speed};
use crate::lobes::workspace::{PlaceStatus, Workspace};
use crate::lobes::workspace_grid::{GridPlace, Span, WorkspaceGrid};
use crate::lobes::{AbsoluteLimit, AveragedCut, SpeedLimit};
use crate::progress::Progress;
use crate::revision::Side;
use crate::robot::{IkSolution, RobotModel};
use crate::{InputError, Result};

/// Reach and number of values about the posture's tool point where no x, y or z is asked for.
const USUAL: [(f64, usize); 3] = [(0.6, 11), (0.6, 11), (0.3, 5)];
const USUAL_STEP_DEG: f64 = 30.0;

/// What a map is asked for; what is left out is chosen about the posture.
#[derive(Debug, Clone, Default)]
pub struct SweepRequest {
    /// Id of the posture that everything refers to; `None`: that of `[lobes.redundancy]`, else the first one.
    pub posture: Option<String>,
    /// x, y, z of the tool point, base frame.
    pub spans_m: [Option<Span>; 3],
    /// Along the tool, from the spindle to the workpiece; none: the posture's.
    pub directions: Vec<[f64; 3]>,
    /// `None`: that of `[lobes.redundancy]`, else 30°.
    pub angle_step_deg: Option<f64>,
    /// Postures nearer to a singularity count as not reachable, 0 to 1.
    pub least_singularity_margin: f64,
}

/// What the model says of one place that can be used.
#[derive(Debug, Clone, Serialize)]
pub struct PlaceFindings {
    /// Joint angles, base first, °.
    pub joints_deg: Vec<f64>,
    /// Which of the solutions of the inverse kinematics, see [`IkSolution::branch`].
    pub ik_branch: u32,
    /// Distance of the nearest joint to its limit; `None` where the robot file gives no limits.
    pub limit_margin_deg: Option<f64>,
    /// 0 to 1, see [`IkSolution::singularity_margin`].
    pub singularity_margin: f64,
    /// `None`: no depth whatever chatters.
    pub absolute: Option<AbsoluteLimit>,
    /// The best of the speeds asked for, and the depth limit there.
    pub best: BestSpeed,
    /// 1/C_ii at the tool point, base axes.
    pub tcp_stiffness_n_per_m: [f64; 3],
    /// Of the model's modes at this posture, Hz; `None` where it has none.
    pub lowest_frequency_hz: Option<f64>,
}

/// One place of a map.
#[derive(Debug, Clone, Serialize)]
pub struct SweepRow {
    /// Tool point, direction and redundancy angle.
    pub place: GridPlace,
    /// Whether it can be used, or why not.
    pub status: PlaceStatus,
    /// `None` where the place cannot be used.
    pub findings: Option<PlaceFindings>,
}

/// A map of the workspace, ready to be computed in any pieces.
pub struct Sweep {
    state: ModelState,
    posture: Posture,
    forbidden_deg: Vec<[f64; 2]>,
    least_singularity_margin: f64,
    cut: AveragedCut,
    spindle_rpm: [f64; 2],
    /// The places, in the order of their numbers.
    pub grid: WorkspaceGrid,
    /// All that the rows depend on, for people and to tell one map from another; no floating-point results, so that every
    /// machine of a cluster has the same.
    pub settings: Map<String, Value>,
    /// What was noticed while reading and fitting.
    pub warnings: Vec<String>,
}

impl Sweep {
    /// # Errors
    /// No `[lobes]` table, no posture, no robot, a grid without sense, or what calibrating refuses.
    pub fn new(campaign: &Campaign, request: &SweepRequest) -> Result<Self> {
        let campaign = &Workbench::new(campaign);
        let section = campaign.lobes.as_ref().ok_or_else(|| {
            InputError::new(
                "a map of the workspace needs to know the cut, and the campaign has no [lobes] table",
            )
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes")
            .remedy("add one with process, source = \"model\" and spindle_rpm = [from, to, step]")
        })?;
        let least_singularity_margin = request.least_singularity_margin;
        if !(0.0..1.0).contains(&least_singularity_margin) {
            return Err(InputError::new(format!(
                "{least_singularity_margin} is no distance from a singularity"
            ))
            .remedy("give --singularity-margin from 0 to below 1; 0.05 is usual")
            .into());
        }
        let mut warnings = Vec::new();
        let CutForce {
            coefficients,
            cut,
            axial_torsional,
            ..
        } = CutForce::of(campaign, section, &mut warnings)?;
        if let Some(Err(reason)) = axial_torsional {
            warnings.push(format!(
                "the map has the drill's lateral block only, the axial-torsional one is left out: {reason}"
            ));
        }
        let cut = cut.average();
        let asked = Asked::new(section, cut.axial.is_some());
        let posture = posture_of(campaign, section, request)?.clone();
        let state = ModelState::without_history(campaign, asked, &mut warnings)?;
        warnings.extend(remarks(section, &state.current.model.robot));
        if !campaign.contacts.is_empty() {
            warnings.push("the map is that of the free robot: [[contact]] holds at one place only".into());
        }
        let redundancy = section.redundancy.as_ref();
        let forbidden_deg = redundancy.map(|r| r.forbidden_deg.clone()).unwrap_or_default();
        let here = state.current.model.robot.kinematics(&posture.joints_deg)?;
        let span = |axis: usize| {
            let (reach_m, count) = USUAL[axis];
            // To the millimetre, so that people can read and repeat the grid.
            let middle_m = (here.tcp()[axis] * 1e3).round() * 1e-3;
            request.spans_m[axis].unwrap_or(Span::about(middle_m, reach_m, count))
        };
        let directions = match &request.directions[..] {
            [] => vec![here.tool_axis().into()],
            given => given.to_vec(),
        };
        let step = request.angle_step_deg.or(redundancy.map(|r| r.step_deg));
        let grid = WorkspaceGrid::new(
            [span(0), span(1), span(2)],
            &directions,
            step.unwrap_or(USUAL_STEP_DEG),
        )?;
        // Before hours are spent: a robot or posture that a map cannot refer to.
        Workspace::new(&state.current.model.robot, &posture.joints_deg, &[], 0.0)?;
        let spindle_rpm = [section.spindle_rpm[0], section.spindle_rpm[1]];
        let settings = serde_json::json!({
            "program": concat!("lobestone ", env!("CARGO_PKG_VERSION")),
            "data": campaign.fingerprint(Side::Structure)?,
            "robot": campaign.robot.as_ref().map(|r| &r.model),
            "effects": state.effects,
            "revision": state.revision,
            "process": section.process,
            "ktc_n_per_mm2": coefficients.ktc_n_per_mm2,
            "krc_n_per_mm2": coefficients.krc_n_per_mm2,
            "teeth": cut.lateral.teeth,
            "force_matrix_n_per_m2": cut.lateral.matrix_n_per_m2,
            "axial_force_matrix_n_per_m2": cut.axial.map(|a| a.matrix_n_per_m2),
            "tool": section.tool,
            "flank_damping_n_per_m2": cut.damping.map(|d| [d.lateral_n_per_m2, d.axial_n_per_m2]),
            "margin": [section.margin_stiffness_n_per_m, section.margin_damping_ns_per_m],
            "spindle_rpm": spindle_rpm,
            "posture": posture.id,
            "joints_deg": posture.joints_deg,
            "x_m": grid.x_m,
            "y_m": grid.y_m,
            "z_m": grid.z_m,
            "directions": grid.directions,
            "angle_step_deg": grid.angle_step_deg,
            "forbidden_deg": forbidden_deg,
            "least_singularity_margin": least_singularity_margin,
        });
        let settings = settings.as_object().cloned().unwrap_or_default();
        let settings = settings.into_iter().map(|(key, v)| (key, rounded(v))).collect();
        Ok(Sweep {
            state,
            posture,
            forbidden_deg,
            least_singularity_margin,
            cut,
            spindle_rpm,
            grid,
            settings,
            warnings,
        })
    }

    /// The rows of a stretch of places, in their order whatever the number of threads.
    ///
    /// # Errors
    /// A chain without a positive definite stiffness, which a sound robot file does not have.
    pub fn rows(&self, places: Range<usize>) -> Result<Vec<SweepRow>> {
        let workspace = Workspace::new(
            &self.state.current.model.robot,
            &self.posture.joints_deg,
            &self.forbidden_deg,
            self.least_singularity_margin,
        )?;
        let progress = Progress::new("places", places.len());
        places
            .into_par_iter()
            .map(|index| {
                let place = self.grid.place(index);
                let row = match workspace.stand(&place) {
                    Ok(stand) => SweepRow {
                        findings: Some(self.findings(&stand)?),
                        status: PlaceStatus::Reachable,
                        place,
                    },
                    Err(status) => SweepRow {
                        findings: None,
                        status,
                        place,
                    },
                };
                progress.step();
                Ok(row)
            })
            .collect()
    }

    fn findings(&self, stand: &IkSolution) -> Result<PlaceFindings> {
        let joints_deg = stand.joints_deg();
        let (blocks, report) = self.state.blocks_and_report(&joints_deg)?;
        let solver = self.cut.on(&blocks);
        Ok(PlaceFindings {
            joints_deg,
            ik_branch: stand.branch,
            limit_margin_deg: Some(stand.limit_margin_rad.max(0.0).to_degrees()).filter(|m| m.is_finite()),
            singularity_margin: stand.singularity_margin,
            absolute: solver.absolute_limit(),
            best: best_speed(&solver, self.spindle_rpm),
            tcp_stiffness_n_per_m: report.tcp_stiffness_n_per_m,
            lowest_frequency_hz: report.natural_frequencies_hz.first().copied(),
        })
    }
}

/// Numbers to twelve digits: a text of that length is read back as the number that was written, and the last digits may
/// differ between machines.
fn rounded(value: Value) -> Value {
    match value {
        Value::Array(all) => all.into_iter().map(rounded).collect(),
        Value::Object(all) => all.into_iter().map(|(key, v)| (key, rounded(v))).collect(),
        Value::Number(n) if n.is_f64() => {
            let short = n.as_f64().and_then(|v| format!("{v:.11e}").parse::<f64>().ok());
            serde_json::json!(short)
        }
        other => other,
    }
}

fn posture_of<'a>(
    campaign: &'a Campaign,
    section: &LobesSection,
    request: &SweepRequest,
) -> Result<&'a Posture> {
    let missing = |problem: String| {
        let known: Vec<&str> = campaign.postures.iter().map(|p| p.id.as_str()).collect();
        let remedy = match known.is_empty() {
            true => "add a [[posture]] table with id and joints_deg".to_string(),
            false => format!("--posture with one of {}", known.join(", ")),
        };
        InputError::new(problem)
            .file(campaign.dir.join("campaign.toml"))
            .key("posture")
            .remedy(remedy)
    };
    let found = match (&request.posture, &section.redundancy) {
        (Some(id), _) => campaign.postures.iter().find(|p| p.id == *id),
        (None, Some(redundancy)) => campaign.postures.get(redundancy.posture),
        (None, None) => campaign.postures.first(),
    };
    found.ok_or_else(|| {
        missing(match &request.posture {
            Some(id) => format!("there is no posture {id:?}"),
            None => "a map of the workspace refers to a posture, and the campaign has none".into(),
        })
        .into()
    })
}

/// Where the map is not what the campaign file might lead one to expect.
fn remarks(section: &LobesSection, robot: &RobotModel) -> Vec<String> {
    let mut remarks = Vec::new();
    if section.source != LobeSource::Model {
        remarks.push(
            "the map is that of the robot model: measured FRFs and modes (lobes.source) hold at one place only".into(),
        );
    }
    if !matches!(
        section.method,
        LobeMethod::ZeroOrder | LobeMethod::FrequencyDomain
    ) {
        remarks.push(
            "the map uses the zero-order method, not that of lobes.method: check the places you choose with \
             lobestone lobes"
                .into(),
        );
    }
    let without: Vec<String> = (1..)
        .zip(&robot.spec.joints)
        .filter(|(_, joint)| joint.limits_rad.is_none())
        .map(|(i, _)| i.to_string())
        .collect();
    if !without.is_empty() {
        remarks.push(format!(
            "the robot file gives no limits_deg for joint {}: they turn without end in the map",
            without.join(", ")
        ));
    }
    remarks
}
