//! Tables of measured resonances and a structural model as a [`Study`]: what the loop works on where only frequencies and
//! sizes were published, not the FRFs.
//!
//! Every measured resonance must be met by a mode of the model, in frequency and in how much it moves the tool point
//! along its axis. Which mode it is stays open: the misfits d² to all modes and the price of having none are combined as
//! 1/d²ᵖ summed, a smooth minimum, so that modes may exchange their roles while the fit moves. A mode of the model that
//! nobody measured costs nothing: such tables name what was published, not all there is.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::Result;
use crate::data::Axis;
use crate::effects::{DataSummary, Effect, Known, Registry, Structure};
use crate::identify::frfs::calibrate::{Calibration, scattered_starts};
use crate::identify::frfs::posture_modes::{PostureMode, posture_modes};
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::{Fit, LeastSquares, Linearisation, Stopping, minimise};
use crate::identify::study::{Extent, HeldOut, Measure, Residual, Study, View};
use crate::robot::Kinematics;

/// How a resonance was read off its FRF.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResonanceReading {
    /// Natural frequency, and the largest real part near it.
    ModalTable,
    /// Where the real part has a minimum, and its depth.
    RealPartMinimum,
}

/// A resonance in the direct receptance at the tool point along a base axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Resonance {
    /// Index of the configuration.
    pub configuration: usize,
    /// Base axis of force and response.
    pub axis: Axis,
    /// How it was read.
    pub reading: ResonanceReading,
    /// As the reading has it, Hz.
    pub frequency_hz: f64,
    /// Lowest and highest reading behind it, Hz.
    pub readings_hz: [f64; 2],
    /// Standard deviation of the frequency's logarithm.
    pub frequency_std: f64,
    /// Real part near the resonance by magnitude, m/N.
    pub size_m_per_n: f64,
    /// Standard deviation of its logarithm.
    pub size_std: f64,
}

/// One line of a list of minima of the real part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum {
    /// Hz.
    pub frequency_hz: f64,
    /// Negative, m/N.
    pub real_m_per_n: f64,
}

/// Minima nearer to each other than this share of their frequency are taken for one resonance that noise or close modes
/// split: a wiggle has no information of its own.
const ONE_RESONANCE: f64 = 0.06;

/// A list of minima of one FRF as resonances, lowest first: neighbours are merged, weighted by depth.
pub fn merged(minima: &[Minimum]) -> Vec<MergedMinimum> {
    let mut sorted: Vec<Minimum> = minima.to_vec();
    sorted.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut groups: Vec<Vec<Minimum>> = Vec::new();
    for minimum in sorted {
        match groups.last_mut() {
            Some(group)
                if minimum.frequency_hz < group[group.len() - 1].frequency_hz * (1.0 + ONE_RESONANCE) =>
            {
                group.push(minimum);
            }
            _ => groups.push(vec![minimum]),
        }
    }
    let merge = |group: &Vec<Minimum>| {
        let weight: f64 = group.iter().map(|m| m.real_m_per_n.abs()).sum();
        let mean = |value: &dyn Fn(&Minimum) -> f64| {
            group.iter().map(|m| m.real_m_per_n.abs() * value(m)).sum::<f64>() / weight
        };
        let centre = mean(&|m| m.frequency_hz.ln());
        MergedMinimum {
            frequency_hz: centre.exp(),
            readings_hz: [group[0].frequency_hz, group[group.len() - 1].frequency_hz],
            spread: mean(&|m| (m.frequency_hz.ln() - centre).powi(2)).sqrt(),
            depth_m_per_n: group.iter().map(|m| m.real_m_per_n.abs()).fold(0.0, f64::max),
        }
    };
    groups.iter().map(merge).collect()
}

/// Neighbouring minima as one resonance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergedMinimum {
    /// Mean weighted by depth.
    pub frequency_hz: f64,
    /// Standard deviation of the logarithm of the frequency within the group.
    pub spread: f64,
    /// Lowest and highest of the group, Hz.
    pub readings_hz: [f64; 2],
    /// Of the deepest.
    pub depth_m_per_n: f64,
}

/// d² of a resonance that no mode meets: four standard deviations. Further off it does not matter how far.
const ABSENT: f64 = 16.0;
/// Sharpness p of the smooth minimum: the nearest mode counts alone unless another is nearly as near.
const SHARPNESS: i32 = 4;
/// Far away the frequencies' standard deviations are this much wider, and having no mode costs this much more.
const ROUGH: f64 = 8.0;

/// How the nearest mode of a model meets a resonance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// As the reading has it: at the minimum of the real part, or natural.
    pub frequency_hz: f64,
    /// Real part next to the resonance by magnitude, m/N.
    pub size_m_per_n: f64,
    /// Squared distance in standard deviations, frequency and size together.
    pub distance2: f64,
}

impl Match {
    /// Whether the mode is there, or the resonance has none.
    pub fn is_there(&self) -> bool {
        self.distance2 < ABSENT
    }
}

/// Effects that such a table cannot show, with the reason.
const INVISIBLE: [(&str, &str); 11] = [
    ("time-delay", "a table of resonances holds no phase"),
    (
        "sensor-misalignment",
        "a table of resonances along two axes does not hold the mixed channels' signs",
    ),
    (
        "joint-damping",
        "a table of resonances does not hold the damping of each mode",
    ),
    (
        "hysteretic-damping",
        "a table of resonances does not hold the damping of each mode",
    ),
    (
        "drive-dynamics",
        "a table of resonances does not hold the damping by which a drive tells itself from a gear",
    ),
    (
        "contact",
        "a table of resonances along two axes does not hold the direction of a contact",
    ),
    (
        "thermal-drift",
        "a table of resonances does not say in which order its configurations were measured",
    ),
    (
        "bearing-compliance",
        "a table of resonances holds too few numbers to choose among rarer places as well",
    ),
    (
        "base-mounting",
        "a table of resonances holds too few numbers to choose among rarer places as well",
    ),
    (
        "counterbalance",
        "a table of resonances holds too few numbers to choose among rarer places as well",
    ),
    (
        "payload-inertia",
        "a table of resonances holds too few numbers to choose among rarer places as well",
    ),
];

/// Resonances of several configurations, arranged for the loop.
#[derive(Debug, Clone)]
pub struct ResonanceStudy {
    configurations: Vec<Kinematics>,
    resonances: Vec<Resonance>,
    summary: DataSummary,
    registry: Registry<Structure>,
    /// Starting points of the calibration besides the nominal values.
    extra_starts: usize,
}

impl ResonanceStudy {
    /// A table of `resonances` measured at `configurations`.
    pub fn new(configurations: Vec<Kinematics>, resonances: Vec<Resonance>) -> Self {
        let hz = || resonances.iter().map(|r| r.frequency_hz);
        let summary = DataSummary {
            force_levels: 1,
            postures: configurations.len(),
            lowest_hz: hz().fold(f64::INFINITY, f64::min),
            highest_hz: hz().fold(0.0, f64::max),
        };
        ResonanceStudy {
            configurations,
            resonances,
            summary,
            registry: Registry::structure(),
            extra_starts: 30,
        }
    }

    /// The table.
    pub fn resonances(&self) -> &[Resonance] {
        &self.resonances
    }

    /// Where the robot's frames are at each configuration.
    pub fn configurations(&self) -> &[Kinematics] {
        &self.configurations
    }

    /// Modes above this are too far off to be meant by any resonance of the table, even while starting points are tried.
    fn highest_hz(&self) -> f64 {
        3.0 * self.summary.highest_hz
    }

    /// Modes of each configuration, lowest first.
    pub fn modes(&self, model: &StructureModel, theta: &[f64]) -> Result<Vec<Vec<PostureMode>>> {
        self.configurations
            .iter()
            .map(|kinematics| posture_modes(model, theta, kinematics, self.highest_hz(), false))
            .collect()
    }

    /// The mode that comes nearest to each resonance.
    pub fn matches(&self, model: &StructureModel, theta: &[f64]) -> Result<Vec<Match>> {
        let modes = self.modes(model, theta)?;
        let nearest = |resonance: &Resonance| {
            let candidates = modes[resonance.configuration].iter().map(|mode| {
                let (frequency_hz, size_m_per_n) = reading(resonance, mode);
                let [f, s] = misfit(resonance, mode, 1.0);
                Match {
                    frequency_hz,
                    size_m_per_n,
                    distance2: f * f + s * s,
                }
            });
            candidates
                .min_by(|a, b| a.distance2.total_cmp(&b.distance2))
                .ok_or_else(|| crate::Error::computation("the model has no mode at all"))
        };
        self.resonances.iter().map(nearest).collect()
    }
}

/// A mode as a resonance of this reading would show it: frequency in Hz, size in m/N.
fn reading(resonance: &Resonance, mode: &PostureMode) -> (f64, f64) {
    match resonance.reading {
        ResonanceReading::ModalTable => (mode.frequency_hz, mode.peak_real_m_per_n(resonance.axis)),
        ResonanceReading::RealPartMinimum => (mode.minimum_hz(), mode.depth_m_per_n(resonance.axis)),
    }
}

/// Weighted differences of the logarithms of frequency and size. A mode that does not move the axis is infinitely far.
fn misfit(resonance: &Resonance, mode: &PostureMode, widening: f64) -> [f64; 2] {
    let (frequency, size) = reading(resonance, mode);
    [
        (frequency / resonance.frequency_hz).ln() / (widening * resonance.frequency_std),
        (size / resonance.size_m_per_n).ln() / resonance.size_std,
    ]
}

/// Derivatives of [`misfit`].
fn misfit_slopes(resonance: &Resonance, mode: &PostureMode, widening: f64) -> [DVector<f64>; 2] {
    let zeta = mode.damping_ratio;
    let compliance = &mode.ln_compliance_slope[resonance.axis.index()];
    // Of ½ ln(1 + 2ζ), and of −ln ζ(1 ∓ ζ).
    let (shift, scale) = match resonance.reading {
        ResonanceReading::ModalTable => (0.0, -1.0 / zeta + 1.0 / (1.0 - zeta)),
        ResonanceReading::RealPartMinimum => (1.0 / (1.0 + 2.0 * zeta), -1.0 / zeta - 1.0 / (1.0 + zeta)),
    };
    let with_damping = |own: &[f64], factor: f64| {
        let pairs = own.iter().zip(&mode.damping_slope);
        DVector::from_iterator(own.len(), pairs.map(|(o, dz)| o + factor * dz))
    };
    [
        with_damping(&mode.ln_frequency_slope, shift) / (widening * resonance.frequency_std),
        with_damping(compliance, scale) / resonance.size_std,
    ]
}

/// Misfit of a model to the resonances plus the priors on its parameters.
pub struct ResonanceProblem<'a> {
    study: &'a ResonanceStudy,
    model: &'a StructureModel,
    view: View,
}

impl ResonanceProblem<'_> {
    fn evaluate(&self, theta: &[f64], with_derivatives: bool) -> Result<Linearisation> {
        let count = theta.len();
        let mut sum = Linearisation::zero(count);
        let (widening, absent) = match self.view.measure {
            Measure::Likelihood => (1.0, ABSENT),
            Measure::Rough => (ROUGH, ROUGH * ABSENT),
        };
        for (configuration, kinematics) in self.study.configurations.iter().enumerate() {
            if self.view.left_out == Some(configuration) {
                continue;
            }
            let modes = posture_modes(
                self.model,
                theta,
                kinematics,
                self.study.highest_hz(),
                with_derivatives,
            )?;
            let own = self
                .study
                .resonances
                .iter()
                .filter(|r| r.configuration == configuration);
            for resonance in own {
                let misfits: Vec<[f64; 2]> = modes.iter().map(|m| misfit(resonance, m, widening)).collect();
                // Kept from zero, where the power has no value.
                let square = |[f, s]: [f64; 2]| (f * f + s * s).max(1e-9);
                let inverse: f64 = misfits.iter().map(|m| square(*m).powi(-SHARPNESS)).sum();
                let combined = (inverse + absent.powi(-SHARPNESS)).powf(-1.0 / f64::from(SHARPNESS));
                sum.cost += 0.5 * combined;
                if !with_derivatives {
                    continue;
                }
                for (mode, residual) in modes.iter().zip(misfits) {
                    let weight = (combined / square(residual)).powi(SHARPNESS + 1);
                    if !(weight > 1e-12) {
                        continue;
                    }
                    for (r, slope) in residual.iter().zip(misfit_slopes(resonance, mode, widening)) {
                        sum.gradient.axpy(weight * r, &slope, 1.0);
                        sum.hessian.ger(weight, &slope, &slope, 1.0);
                    }
                }
            }
        }
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            if let Some(prior) = parameter.prior {
                let r = (t - prior.mean) / prior.std;
                sum.cost += 0.5 * r * r;
                sum.gradient[i] += r / prior.std;
                sum.hessian[(i, i)] += prior.std.powi(-2);
            }
        }
        Ok(sum)
    }
}

impl LeastSquares for ResonanceProblem<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.evaluate(theta, false)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        self.evaluate(theta, true)
    }
}

impl Study for ResonanceStudy {
    type Domain = Structure;
    type Problem<'a> = ResonanceProblem<'a>;

    fn registry(&self) -> &Registry<Structure> {
        &self.registry
    }

    fn known<'a>(&'a self, model: &'a StructureModel) -> Known<'a, Structure> {
        model.known(&self.summary)
    }

    fn blind_to(&self, effect: &dyn Effect<Structure>) -> Option<String> {
        let invisible = INVISIBLE.iter().find(|(id, _)| *id == effect.id())?;
        Some(invisible.1.to_string())
    }

    fn noise_is_given(&self) -> bool {
        true
    }

    /// The frequencies that are furthest from any mode, one for each tenth of an octave or so.
    fn hints(&self, model: &StructureModel, theta: &[f64]) -> Result<Vec<f64>> {
        const HINTS: usize = 6;
        let matches = self.matches(model, theta)?;
        let mut open: Vec<(f64, f64)> = self
            .resonances
            .iter()
            .zip(&matches)
            .map(|(r, m)| (m.distance2, r.frequency_hz))
            .collect();
        open.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut hints: Vec<f64> = Vec::new();
        for (_, f) in open {
            if hints.iter().all(|h| (f / h).ln().abs() > 0.1) && hints.len() < HINTS {
                hints.push(f);
            }
        }
        Ok(hints)
    }

    fn problem<'a>(&'a self, model: &'a StructureModel, view: View) -> ResonanceProblem<'a> {
        ResonanceProblem {
            study: self,
            model,
            view,
        }
    }

    /// A frequency and a size for each resonance; there are too few to leave any out.
    fn work_s(&self, _model: &StructureModel, _extent: Extent) -> f64 {
        1e-4 * self.configurations.len() as f64
    }

    fn real_values(&self, _extent: Extent) -> usize {
        2 * self.resonances.len()
    }

    fn folds(&self) -> usize {
        self.configurations.len()
    }

    fn predict_fold(&self, model: &StructureModel, theta: &[f64], fold: usize) -> Result<HeldOut> {
        let mut sums = HeldOut::default();
        for (resonance, found) in self.resonances.iter().zip(self.matches(model, theta)?) {
            if resonance.configuration == fold {
                sums.error += (found.frequency_hz - resonance.frequency_hz).powi(2);
                sums.signal += resonance.frequency_hz.powi(2);
                sums.chi2 += found.distance2.min(ABSENT);
            }
        }
        Ok(sums)
    }

    /// nrms is that of the frequencies, each against the mode that comes nearest in frequency and size.
    fn residual(&self, model: &StructureModel, theta: &[f64]) -> Result<Residual> {
        let mut sums = HeldOut::default();
        for fold in 0..self.folds() {
            let own = self.predict_fold(model, theta, fold)?;
            sums.error += own.error;
            sums.signal += own.signal;
            sums.chi2 += own.chi2;
        }
        Ok(Residual {
            nrms: sums.nrms(),
            chi2_per_value: sums.chi2 / self.real_values(Extent::Full).max(1) as f64,
            // Neighbouring minima were merged.
            independent_share: 1.0,
        })
    }

    fn calibrate(&self, model: &StructureModel) -> Result<Calibration> {
        const SEED: u64 = 1;
        let bounds = model.bounds();
        let mut points = vec![model.nominal_theta()];
        points.extend(scattered_starts(&model.parameters, self.extra_starts, SEED));
        let fit = |start: &Vec<f64>| -> Result<Fit> {
            let rough = View {
                measure: Measure::Rough,
                ..View::FULL
            };
            let near = minimise(&self.problem(model, rough), start, &bounds, Stopping::default())?;
            let from = |start: &[f64]| {
                minimise(
                    &self.problem(model, View::FULL),
                    start,
                    &bounds,
                    Stopping::default(),
                )
            };
            let (direct, staged) = (from(start)?, from(&near.theta)?);
            Ok(if direct.cost <= staged.cost {
                direct
            } else {
                staged
            })
        };
        let fits: Vec<Fit> = points.par_iter().map(fit).collect::<Result<_>>()?;
        let lowest = fits.iter().map(|f| f.cost).fold(f64::INFINITY, f64::min);
        let starts_agreeing = fits.iter().filter(|f| f.cost < 1.001 * lowest).count();
        let best = fits
            .into_iter()
            .find(|f| f.cost <= lowest)
            .ok_or_else(|| crate::Error::computation("no starting point leads to a fit"))?;
        let values = self.real_values(Extent::Full);
        Ok(Calibration {
            starts: points.len(),
            starts_agreeing,
            ..Calibration::of_fit(&model.parameters, best, values)?
        })
    }
}

#[cfg(test)]
pub(crate) mod made_table;
#[cfg(test)]
mod tests;
