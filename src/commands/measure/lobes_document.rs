//! What `lobestone lobes` found, as docs/json.md has it.

use serde::Serialize;

use crate::analysis::stability::redundancy::ElbowChoice;
use crate::analysis::{LobeAnalysis, LobeCase, LobesBefore, RedundancyAnalysis};
use crate::campaign::{LobeMethod, LobeSource, Process};
use crate::commands::measure::drill::DrillTold;
use crate::commands::measure::hole::{HoleBasis, HoleTold, StiffnessTold, Weighing};
use crate::commands::measure::lobe_tool::ToolTold;
use crate::lobes::drilling::flank_damping::FlankDamping;
use crate::lobes::drilling::whirling::WhirlSpeed;
use crate::lobes::optimum::SurfacePoint;
use crate::lobes::outcome::Outcomes;
use crate::lobes::redundancy::{AnglePosture, Recommendation};
use crate::lobes::setup::LobeCoefficients;
use crate::lobes::{AbsoluteLimit, BlockLobes, LobeCurve, Peak};

#[derive(Serialize)]
pub(super) struct LobesDocument<'a> {
    process: Process,
    method: LobeMethod,
    source: LobeSource,
    teeth: usize,
    #[serde(flatten)]
    coefficients: LobeCoefficients,
    axial_torsional: Option<BlockIncluded<'a>>,
    drill: Option<DrillTold<'a>>,
    flank_damping: Option<FlankDamping>,
    hole_width_mm: Option<f64>,
    tool: Option<ToolTold<'a>>,
    revision: Option<usize>,
    effects: &'a [String],
    curves: Vec<Curve<'a>>,
    #[serde(flatten)]
    absolute: Absolute,
    best: Vec<Best<'a>>,
    outcomes: Option<&'a Outcomes>,
    hole: Vec<HoleTold<'a>>,
    hole_basis: Option<HoleBasis<'a>>,
    feed_stiffness: Vec<StiffnessTold<'a>>,
    redundancy: Option<Redundancy<'a>>,
    warnings: &'a [String],
}

impl<'a> LobesDocument<'a> {
    pub fn new(analysis: &'a LobeAnalysis) -> Self {
        let block = analysis.axial_torsional.as_ref();
        LobesDocument {
            process: analysis.process,
            method: analysis.method,
            source: analysis.source,
            teeth: analysis.teeth,
            coefficients: analysis.coefficients,
            axial_torsional: block.map(BlockIncluded::of),
            drill: DrillTold::of(analysis),
            flank_damping: analysis.flank_damping,
            hole_width_mm: analysis.drilled.map(|hole| hole.width_mm),
            tool: ToolTold::of(analysis),
            revision: analysis.revision,
            effects: &analysis.effects,
            curves: analysis.cases.iter().map(Curve::of).collect(),
            absolute: Absolute::of(analysis.absolute()),
            best: analysis.best().into_iter().map(Best::of).collect(),
            outcomes: analysis.outcomes.as_ref(),
            hole: HoleTold::all(analysis),
            hole_basis: HoleBasis::of(analysis),
            feed_stiffness: analysis.cases.iter().filter_map(StiffnessTold::of).collect(),
            redundancy: analysis
                .redundancy
                .as_ref()
                .map(|found| Redundancy::of(analysis, found)),
            warnings: &analysis.warnings,
        }
    }
}

/// Whether the axial–torsional block of a drill takes part.
#[derive(Serialize)]
struct BlockIncluded<'a> {
    included: bool,
    left_out_because: Option<&'a str>,
}

impl<'a> BlockIncluded<'a> {
    fn of(block: &'a std::result::Result<(), String>) -> Self {
        BlockIncluded {
            included: block.is_ok(),
            left_out_because: block.as_ref().err().map(String::as_str),
        }
    }
}

/// The limit below which no speed chatters.
#[derive(Serialize)]
struct Absolute {
    absolute_limit_mm: Option<f64>,
    absolute_limit_hz: Option<f64>,
}

impl Absolute {
    fn of(limit: Option<AbsoluteLimit>) -> Self {
        Absolute {
            absolute_limit_mm: limit.map(|l| l.depth_mm),
            absolute_limit_hz: limit.map(|l| l.chatter_hz),
        }
    }
}

/// The limit at each speed of a curve, and at every speed.
#[derive(Serialize)]
struct Limits<'a> {
    depth_limit_mm: &'a [Option<f64>],
    chatter_hz: &'a [Option<f64>],
    #[serde(flatten)]
    absolute: Absolute,
}

impl<'a> Limits<'a> {
    fn of(curve: &'a LobeCurve, absolute: Option<AbsoluteLimit>) -> Self {
        Limits {
            depth_limit_mm: &curve.depth_limit_mm,
            chatter_hz: &curve.chatter_hz,
            absolute: Absolute::of(absolute),
        }
    }

    fn of_block(block: &'a BlockLobes) -> Self {
        Limits::of(&block.curve, block.absolute)
    }
}

/// The lobes of one posture, or of one redundancy angle.
#[derive(Serialize)]
struct Curve<'a> {
    posture: Option<&'a str>,
    angle_deg: Option<f64>,
    spindle_rpm: &'a [f64],
    #[serde(flatten)]
    limits: Limits<'a>,
    depth_p05_mm: Option<&'a [Option<f64>]>,
    depth_p95_mm: Option<&'a [Option<f64>]>,
    before: Option<Before<'a>>,
    lateral: Option<Limits<'a>>,
    axial_torsional: Option<Limits<'a>>,
    whirling: &'a [WhirlSpeed],
    frf: &'a str,
    band_hz: (f64, f64),
}

impl<'a> Curve<'a> {
    fn of(case: &'a LobeCase) -> Self {
        let band = case.band.as_ref();
        let blocks = case.by_block.as_ref();
        Curve {
            posture: case.posture.as_deref(),
            angle_deg: case.angle_deg,
            spindle_rpm: &case.curve.spindle_rpm,
            limits: Limits::of(&case.curve, case.absolute),
            depth_p05_mm: band.map(|b| b.lower_mm.as_slice()),
            depth_p95_mm: band.map(|b| b.upper_mm.as_slice()),
            before: case.before.as_ref().map(Before::of),
            lateral: blocks.map(|[lateral, _]| Limits::of_block(lateral)),
            axial_torsional: blocks.map(|[_, axial]| Limits::of_block(axial)),
            whirling: &case.whirling,
            frf: &case.description,
            band_hz: case.band_hz,
        }
    }
}

/// Without the effects that were added: the baseline, which has none.
#[derive(Serialize)]
struct Before<'a> {
    revision: usize,
    effects: [String; 0],
    #[serde(flatten)]
    limits: Limits<'a>,
}

impl<'a> Before<'a> {
    fn of(before: &'a LobesBefore) -> Self {
        Before {
            revision: 0,
            effects: [],
            limits: Limits::of(&before.curve, before.absolute),
        }
    }
}

/// A speed between the lobes.
#[derive(Serialize)]
struct Best<'a> {
    posture: Option<&'a str>,
    angle_deg: Option<f64>,
    spindle_rpm: f64,
    depth_mm: Option<f64>,
    recommended_depth_mm: Option<f64>,
    at_range_end: bool,
}

impl<'a> Best<'a> {
    fn of((case, peak): (&'a LobeCase, Peak)) -> Self {
        Best {
            posture: case.posture.as_deref(),
            angle_deg: case.angle_deg,
            spindle_rpm: peak.spindle_rpm,
            depth_mm: peak.depth_mm,
            recommended_depth_mm: peak.lower_quantile_mm,
            at_range_end: peak.at_range_end,
        }
    }
}

/// The surface over the redundancy angle.
#[derive(Serialize)]
struct Redundancy<'a> {
    posture: &'a str,
    step_deg: f64,
    angles: &'a [AnglePosture],
    recommended: Recommended<'a>,
    elbows: &'a [ElbowChoice],
    hole: Option<Weighing<'a>>,
    enumeration: SurfacePoint,
    swarm: SurfacePoint,
    agree: bool,
    difference: f64,
}

impl<'a> Redundancy<'a> {
    fn of(analysis: &'a LobeAnalysis, found: &'a RedundancyAnalysis) -> Self {
        let r = &found.recommendation;
        Redundancy {
            posture: &found.posture,
            step_deg: found.step_deg,
            angles: &found.angles,
            recommended: Recommended::of(r),
            elbows: &found.elbows,
            hole: Weighing::of(analysis, found),
            enumeration: r.enumeration,
            swarm: r.swarm,
            agree: r.agree,
            difference: r.difference,
        }
    }
}

/// Where to cut, and how the robot stands there.
#[derive(Serialize)]
struct Recommended<'a> {
    #[serde(flatten)]
    point: SurfacePoint,
    speed_margin: f64,
    recommended_depth_mm: Option<f64>,
    tip_depth_mm: Option<f64>,
    absolute_limit_mm: Option<f64>,
    joints_deg: Option<&'a [f64]>,
    limit_margin_deg: Option<f64>,
    singularity_margin: Option<f64>,
    elbow_deg: Option<f64>,
}

impl<'a> Recommended<'a> {
    fn of(r: &'a Recommendation) -> Self {
        Recommended {
            point: r.point,
            speed_margin: r.speed_margin,
            recommended_depth_mm: r.lower_quantile_mm,
            tip_depth_mm: r.tip_depth_mm,
            absolute_limit_mm: r.absolute_limit.map(|a| a.depth_mm),
            joints_deg: r.posture.joints_deg.as_deref(),
            limit_margin_deg: r.posture.limit_margin_deg,
            singularity_margin: r.posture.singularity_margin,
            elbow_deg: r.posture.elbow_deg,
        }
    }
}
