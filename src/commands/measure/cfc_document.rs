//! What `lobestone cfc` found, as docs/json.md has it.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::analysis::forces::cutting::WaveformCoefficients;
use crate::campaign::Campaign;
use crate::cutting::{
    Average, CfcResult, ChangeReading, Coefficient, CoefficientChange, CoefficientKind, CutAnalysis,
    ForceAxis, ForceGroup, Influence, KienzleComponent, KienzleFit, KnownValue, MaterialComparison,
    OrthogonalPrediction, Preferred, RegressionMethod, RegressionPoint, SpeedTrends, TellingFeed,
    coefficients_of,
};
use crate::data::Process;
use crate::discrepancy::setup::SetupFinding;
use crate::signal::{DriftLine, SpindleTrack, ToothLine};

/// Kienzle's law for each group, in the groups' order.
pub(super) struct PowerLaws {
    pub groups: Vec<Option<KienzleFit>>,
    pub pooled: Vec<Option<KienzleFit>>,
}

#[derive(Serialize)]
pub(super) struct CfcDocument<'a> {
    campaign: &'a str,
    groups: Vec<Group<'a>>,
    pooled: Vec<Group<'a>>,
    r2: Option<ByAxis>,
    trends: Vec<Trend<'a>>,
    materials: Vec<Difference<'a>>,
    predicted: Option<Predicted<'a>>,
    cuts: Vec<Cut<'a>>,
    setup: &'a [SetupFinding],
    warnings: &'a [String],
}

impl<'a> CfcDocument<'a> {
    pub fn new(
        campaign: &'a Campaign,
        result: &'a CfcResult,
        waveforms: &'a [Option<WaveformCoefficients>],
        power_laws: &'a PowerLaws,
        setup: &'a [SetupFinding],
    ) -> Self {
        let groups = result.groups.iter().zip(&power_laws.groups).zip(waveforms);
        let pooled = result.pooled.iter().zip(&power_laws.pooled);
        let process = result.pooled.first().map(|g| g.process);
        CfcDocument {
            campaign: &campaign.name,
            groups: groups
                .map(|((group, law), waveform)| Group::of(group, law.as_ref(), Some(waveform.as_ref())))
                .collect(),
            pooled: pooled
                .map(|(group, law)| Group::of(group, law.as_ref(), None))
                .collect(),
            r2: process.map(|p| ByAxis::of(p, &result.r2())),
            trends: result.trends.iter().flat_map(Trend::of).collect(),
            materials: result.materials.iter().flat_map(Difference::of).collect(),
            predicted: result.prediction.as_ref().map(Predicted::of),
            cuts: result.cuts.iter().map(Cut::of).collect(),
            setup,
            warnings: &result.warnings,
        }
    }
}

/// Values by axis, of drilling with the torque; what the process does not use is null.
#[derive(Serialize)]
struct ByAxis {
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mz: Option<Option<f64>>,
}

impl ByAxis {
    fn of(process: Process, values: &[Option<f64>; 4]) -> Self {
        let used = |axis: ForceAxis| values[axis.index()].filter(|_| ForceAxis::of(process).contains(&axis));
        ByAxis {
            x: used(ForceAxis::X),
            y: used(ForceAxis::Y),
            z: used(ForceAxis::Z),
            mz: (process == Process::Drilling).then(|| used(ForceAxis::Mz)),
        }
    }
}

/// Cuts that share their coefficients.
#[derive(Serialize)]
struct Group<'a> {
    process: Process,
    material: Option<&'a str>,
    cutting_speed_m_per_min: f64,
    cutting_speed_range_m_per_min: [f64; 2],
    cuts: &'a [String],
    feeds: usize,
    /// By their keys, which say the units.
    #[serde(flatten)]
    coefficients: BTreeMap<&'static str, CoefficientFound>,
    method: RegressionMethod,
    influence: &'a [Influence],
    inseparable: &'a [Vec<&'static str>],
    r2: ByAxis,
    chi2_per_dof: ByAxis,
    /// N; N·m.
    extra_scatter: ByAxis,
    points: &'a [RegressionPoint],
    kienzle: Option<Kienzle<'a>>,
    /// Not of cuts of several speeds together. The coefficients of the mean forces stay what they are: what they cannot
    /// separate is null there even where the waveform's shape can.
    #[serde(skip_serializing_if = "Option::is_none")]
    waveform: Option<Option<&'a WaveformCoefficients>>,
}

impl<'a> Group<'a> {
    fn of(
        group: &'a ForceGroup,
        law: Option<&'a KienzleFit>,
        waveform: Option<Option<&'a WaveformCoefficients>>,
    ) -> Self {
        let by_axis = |values: &[Option<f64>; 4]| ByAxis::of(group.process, values);
        let coefficients = group.coefficients.iter();
        Group {
            process: group.process,
            material: group.material.as_deref(),
            cutting_speed_m_per_min: group.cutting_speed_m_per_min,
            cutting_speed_range_m_per_min: group.cutting_speed_range_m_per_min,
            cuts: &group.cuts,
            feeds: group.feeds,
            coefficients: coefficients
                .map(|c| (c.key, CoefficientFound::of(c, group.method)))
                .collect(),
            method: group.method,
            influence: &group.influence,
            inseparable: &group.inseparable,
            r2: by_axis(&group.r2),
            chi2_per_dof: by_axis(&group.chi2_per_dof),
            extra_scatter: by_axis(&group.extra_scatter.map(Some)),
            points: &group.points,
            kienzle: law.map(Kienzle::of),
            waveform,
        }
    }
}

/// A coefficient, in the unit of its key.
#[derive(Serialize)]
struct CoefficientFound {
    value: Option<f64>,
    std_error: Option<f64>,
    std_error_bootstrap: Option<f64>,
    /// By the robust method, where the other was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    huber: Option<KnownValue>,
    /// The other way round.
    #[serde(skip_serializing_if = "Option::is_none")]
    least_squares: Option<KnownValue>,
    #[serde(flatten)]
    held: Option<Held>,
}

/// Of a coefficient that is held at zero.
#[derive(Serialize)]
struct Held {
    constraint_active: bool,
    unconstrained: Option<KnownValue>,
}

impl CoefficientFound {
    fn of(c: &Coefficient, method: RegressionMethod) -> Self {
        let (huber, least_squares) = match method {
            RegressionMethod::LeastSquares => (c.other_method, None),
            RegressionMethod::Huber => (None, c.other_method),
        };
        CoefficientFound {
            value: c.value,
            std_error: c.std_error,
            std_error_bootstrap: c.std_error_bootstrap,
            huber,
            least_squares,
            held: c.constraint_active.then_some(Held {
                constraint_active: true,
                unconstrained: c.unconstrained,
            }),
        }
    }
}

/// Kienzle's law compared with the linear-edge law.
#[derive(Serialize)]
struct Kienzle<'a> {
    components: &'a [KienzleComponent],
    converged: bool,
    r2: ByAxis,
    delta_bic: f64,
    p_linear_edge: Option<f64>,
    p_kienzle: Option<f64>,
    preferred: Option<Preferred>,
    measure: Option<TellingFeed>,
    reading: String,
}

impl<'a> Kienzle<'a> {
    fn of(law: &'a KienzleFit) -> Self {
        Kienzle {
            components: &law.components,
            converged: law.converged,
            r2: ByAxis::of(law.process, &law.r2),
            delta_bic: law.delta_bic,
            p_linear_edge: law.p_linear_edge,
            p_kienzle: law.p_kienzle,
            preferred: law.preferred,
            measure: law.telling,
            reading: law.reading(),
        }
    }
}

/// What a coefficient does, and by what chance.
#[derive(Serialize)]
struct Change {
    coefficient: &'static str,
    label: &'static str,
    unit: &'static str,
    p_value: Option<f64>,
    reading: ChangeReading,
}

impl Change {
    fn of(kind: &CoefficientKind, change: &CoefficientChange) -> Self {
        Change {
            coefficient: kind.key,
            label: kind.label,
            unit: kind.unit,
            p_value: change.p_value,
            reading: change.reading,
        }
    }
}

/// A coefficient over cutting speed; values in its unit.
#[derive(Serialize)]
struct Trend<'a> {
    process: Process,
    material: Option<&'a str>,
    #[serde(flatten)]
    change: Change,
    reference_speed_m_per_min: f64,
    value: Option<KnownValue>,
    per_doubling: Option<KnownValue>,
    exponent: Option<KnownValue>,
}

impl<'a> Trend<'a> {
    fn of(trends: &'a SpeedTrends) -> impl Iterator<Item = Trend<'a>> {
        let kinds = coefficients_of(trends.process).iter();
        kinds.zip(&trends.changes).map(|(kind, change)| Trend {
            process: trends.process,
            material: trends.material.as_deref(),
            change: Change::of(kind, change),
            reference_speed_m_per_min: trends.reference_speed_m_per_min,
            value: change.reference,
            per_doubling: change.change,
            exponent: change.exponent(),
        })
    }
}

/// A coefficient of one material against that of another; values in its unit.
#[derive(Serialize)]
struct Difference<'a> {
    process: Process,
    material: &'a str,
    reference: &'a str,
    #[serde(flatten)]
    change: Change,
    reference_value: Option<KnownValue>,
    difference: Option<KnownValue>,
    ratio: Option<KnownValue>,
}

impl<'a> Difference<'a> {
    fn of(comparison: &'a MaterialComparison) -> impl Iterator<Item = Difference<'a>> {
        let kinds = coefficients_of(comparison.process).iter();
        kinds.zip(&comparison.changes).map(|(kind, change)| Difference {
            process: comparison.process,
            material: &comparison.material,
            reference: &comparison.reference,
            change: Change::of(kind, change),
            reference_value: change.reference,
            difference: change.change,
            ratio: change.ratio,
        })
    }
}

/// From the orthogonal database, next to what the cuts gave.
#[derive(Serialize)]
struct Predicted<'a> {
    material: Option<&'a str>,
    shear_angle_deg: f64,
    coefficients: Vec<CoefficientPredicted>,
}

#[derive(Serialize)]
struct CoefficientPredicted {
    label: &'static str,
    unit: &'static str,
    predicted: f64,
    value: Option<f64>,
    std_error: Option<f64>,
}

impl<'a> Predicted<'a> {
    fn of(prediction: &'a OrthogonalPrediction) -> Self {
        let rows = prediction.rows.iter();
        Predicted {
            material: prediction.material.as_deref(),
            shear_angle_deg: prediction.predicted.shear_angle_rad.to_degrees(),
            coefficients: rows
                .map(|&(label, predicted, value, std_error)| CoefficientPredicted {
                    label,
                    unit: "N/mm²",
                    predicted,
                    value,
                    std_error,
                })
                .collect(),
        }
    }
}

/// What one record says.
#[derive(Serialize)]
struct Cut<'a> {
    id: &'a str,
    process: Process,
    spindle_rpm: f64,
    cutting_speed_m_per_min: f64,
    feed_mm: f64,
    record_s: [f64; 2],
    air_before_s: Option<[f64; 2]>,
    air_after_s: Option<[f64; 2]>,
    steady_s: [f64; 2],
    steady_given: bool,
    revolutions: f64,
    drift: Vec<Drift<'a>>,
    /// N; N·m.
    averages: BTreeMap<String, Average>,
    tooth_line: Option<&'a ToothLine>,
    spindle: Option<Spindle>,
}

impl<'a> Cut<'a> {
    fn of(cut: &'a CutAnalysis) -> Self {
        let average = |axis: ForceAxis| Some((axis.label().to_lowercase(), cut.averages[axis.index()]?));
        let channels = cut.channels.iter();
        Cut {
            id: &cut.id,
            process: cut.process,
            spindle_rpm: cut.spindle_rpm,
            cutting_speed_m_per_min: cut.cutting_speed_m_per_min,
            feed_mm: cut.feed_mm,
            record_s: cut.record_s,
            air_before_s: cut.air_before_s,
            air_after_s: cut.air_after_s,
            steady_s: cut.steady_s,
            steady_given: cut.steady_given,
            revolutions: cut.revolutions,
            drift: channels
                .map(|c| Drift {
                    channel: &c.name,
                    line: &c.drift,
                })
                .collect(),
            averages: ForceAxis::ALL.into_iter().filter_map(average).collect(),
            tooth_line: cut.tooth_line.as_ref(),
            spindle: cut
                .spindle
                .as_ref()
                .map(|track| Spindle::of(track, cut.spindle_rpm)),
        }
    }
}

/// The zero line that was taken off a channel.
#[derive(Serialize)]
struct Drift<'a> {
    channel: &'a str,
    line: &'a DriftLine,
}

/// How the spindle ran; changes and wander are shares of the stated speed.
#[derive(Serialize)]
struct Spindle {
    found_rpm: f64,
    std_error_rpm: f64,
    change_over_cut: f64,
    change_std_error: f64,
    wander_rms: f64,
    wander_std_error: f64,
    in_step_before: f64,
    in_step_after: f64,
}

impl Spindle {
    fn of(track: &SpindleTrack, stated_rpm: f64) -> Self {
        let [in_step_before, in_step_after] = track.in_step;
        Spindle {
            found_rpm: stated_rpm * (1.0 + track.offset),
            std_error_rpm: stated_rpm * track.offset_std,
            change_over_cut: track.droop,
            change_std_error: track.droop_std,
            wander_rms: track.wander,
            wander_std_error: track.wander_std,
            in_step_before,
            in_step_after,
        }
    }
}
