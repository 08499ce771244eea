//! FRFs and a structural model as a [`Study`].

use num_complex::Complex64;

use crate::Result;
use crate::effects::{DataSummary, Known, Registry, Structure};
use crate::identify::common_course;
use crate::identify::frfs::calibrate::{Calibration, GLANCE_VALUES, Options, calibrate, sketch};
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::{FrfProblem, Misfit};
use crate::identify::frfs::place_test;
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::Stopping;
use crate::identify::own_errors::OwnErrors;
use crate::identify::rest::{self, AfterSlips, BeyondSlips, Rest, RestCurve, SMALL_ERROR};
use crate::identify::rest_patterns;
use crate::identify::study::{Extent, HeldOut, Measure, Residual, Study, View, held_out};

/// Takes what small errors of the setup can out of the rest of a model at its optimum on data.
pub type AbsorbSlips = fn(&StructureModel, &FrfData, &[f64], &[RestCurve]) -> Result<AfterSlips>;

/// A campaign's FRFs, arranged for the loop.
#[derive(Debug, Clone)]
pub struct StructureStudy {
    /// All FRFs.
    pub data: FrfData,
    /// How the baseline is calibrated.
    pub options: Options,
    /// Where the measured modes put the model, solver's scale: a starting point of its calibration.
    measured: Option<Vec<f64>>,
    slips: Option<AbsorbSlips>,
    coarse: FrfData,
    thin: FrfData,
    glance: FrfData,
    /// Postures that are left out in turn, and the data without each.
    postures: Vec<usize>,
    coarse_without: Vec<FrfData>,
    full_without: Vec<FrfData>,
    summary: DataSummary,
    registry: Registry<Structure>,
}

/// Lines between those that the coarse view keeps, at most.
const LARGEST_STRIDE: usize = 6;
/// Complex values the coarse view has, about: enough to tell effects apart, few enough to try many starts.
const COARSE_VALUES: usize = 2500;
/// Complex values the thin view has, about.
const THIN_VALUES: usize = 15_000;

impl StructureStudy {
    /// FRFs, with the thinner views that searches use.
    pub fn new(data: FrfData, options: Options) -> Self {
        let share = data.value_count().div_ceil(COARSE_VALUES);
        // A resonance needs its few lines: measurements with coarse lines are left alone.
        let lines = data
            .blocks
            .iter()
            .map(|b| b.frequency_hz.len())
            .min()
            .unwrap_or(0);
        let largest = LARGEST_STRIDE.min((lines / 60).max(1));
        let every = share.div_ceil(share.min(largest)).clamp(1, 3);
        let stride = share.div_ceil(every).min(largest);
        let coarse = data.thinned(stride, every);
        let thin = data.thinned(data.value_count().div_ceil(THIN_VALUES).min(largest), 1);
        let postures = data.measured_postures();
        let without = |data: &FrfData| -> Vec<FrfData> {
            postures.iter().map(|&p| data.filtered(|q| q != p)).collect()
        };
        StructureStudy {
            glance: sketch(&coarse, GLANCE_VALUES),
            coarse_without: without(&coarse),
            full_without: without(&data),
            summary: data.summary(),
            registry: Registry::structure(),
            coarse,
            thin,
            postures,
            data,
            options,
            measured: None,
            slips: None,
        }
    }

    /// Where the measured modes put the model, solver's scale; `None` where they are not known.
    pub fn measured(&self) -> Option<&[f64]> {
        self.measured.as_deref()
    }

    /// The same study, whose model is calibrated also from `start` (such as [`crate::identify::frfs::modal_start`] gives).
    pub fn with_measured(self, start: Option<Vec<f64>>) -> Self {
        StructureStudy {
            measured: start,
            ..self
        }
    }

    /// The same study, which tries these effects.
    pub fn with_registry(self, registry: Registry<Structure>) -> Self {
        StructureStudy { registry, ..self }
    }

    /// The same study, which knows what small errors of the setup do.
    pub fn with_slips(self, absorb: AbsorbSlips) -> Self {
        StructureStudy {
            slips: Some(absorb),
            ..self
        }
    }

    fn view(&self, view: View) -> &FrfData {
        match (view.extent, view.left_out) {
            (Extent::Glance, None) => &self.glance,
            (Extent::Coarse, None) => &self.coarse,
            (Extent::Thin, None) => &self.thin,
            (Extent::Full, None) => &self.data,
            // A fold is too little to glance at.
            (Extent::Glance | Extent::Coarse | Extent::Thin, Some(fold)) => &self.coarse_without[fold],
            (Extent::Full, Some(fold)) => &self.full_without[fold],
        }
    }
}

impl Study for StructureStudy {
    type Domain = Structure;
    type Problem<'a> = FrfProblem<'a>;

    fn registry(&self) -> &Registry<Structure> {
        &self.registry
    }

    fn known<'a>(&'a self, model: &'a StructureModel) -> Known<'a, Structure> {
        model.known(&self.summary)
    }

    /// Frequencies at which the weighted residual is largest, most prominent first.
    fn hints(&self, model: &StructureModel, theta: &[f64]) -> Result<Vec<f64>> {
        let peaks = residual_peaks(&model.predict(theta, &self.data)?, &self.data);
        Ok(peaks.iter().map(|p| p.frequency_hz).collect())
    }

    fn problem<'a>(&'a self, model: &'a StructureModel, view: View) -> FrfProblem<'a> {
        FrfProblem {
            model,
            data: self.view(view),
            misfit: match view.measure {
                Measure::Rough => Misfit::LogMagnitude,
                Measure::Likelihood => Misfit::Complex,
            },
            stride: 1,
        }
    }

    fn work_s(&self, model: &StructureModel, extent: Extent) -> f64 {
        model.work_s(self.view(View { extent, ..View::FULL }))
    }

    fn real_values(&self, extent: Extent) -> usize {
        let view = View { extent, ..View::FULL };
        2 * self.view(view).value_count()
    }

    fn folds(&self) -> usize {
        self.postures.len()
    }

    fn predict_fold(&self, model: &StructureModel, theta: &[f64], fold: usize) -> Result<HeldOut> {
        let own = self.data.filtered(|p| p == self.postures[fold]);
        // A model that falls over at a posture it was not fitted to (a spring beside a joint that pushes more than the gear holds)
        // predicts nothing there.
        let nothing = || {
            own.frfs()
                .map(|(_, frf)| vec![Complex64::ZERO; frf.receptance.len()])
                .collect()
        };
        let predicted: Vec<Vec<Complex64>> = model.predict(theta, &own).unwrap_or_else(|_| nothing());
        let mut sums = HeldOut::default();
        for ((_, frf), model) in own.frfs().zip(&predicted) {
            for ((h, m), std) in frf.receptance.iter().zip(model).zip(&frf.noise_std) {
                let square = (m - h).norm_sqr();
                sums.error += square;
                sums.signal += h.norm_sqr();
                // Real and imaginary part have half the variance each.
                sums.chi2 += 2.0 * square / (std * std);
            }
        }
        Ok(sums)
    }

    fn residual(&self, model: &StructureModel, theta: &[f64]) -> Result<Residual> {
        let predicted = model.predict(theta, &self.data)?;
        let (mut error, mut signal, mut weighted, mut values) = (0.0, 0.0, 0.0, 0);
        // Σ r̄(k) r(k + lag) over all FRFs, normalised by lag 0.
        let mut lags = [0.0; CORRELATION_LAGS + 1];
        for ((_, frf), model) in self.data.frfs().zip(&predicted) {
            let difference = |k: usize| model[k] - frf.receptance[k];
            let whitened: Vec<Complex64> = (0..model.len())
                .map(|k| difference(k) / frf.noise_std[k])
                .collect();
            error += (0..model.len()).map(|k| difference(k).norm_sqr()).sum::<f64>();
            signal += frf.receptance.iter().map(|h| h.norm_sqr()).sum::<f64>();
            weighted += whitened.iter().map(|r| r.norm_sqr()).sum::<f64>();
            values += model.len();
            for (lag, sum) in lags.iter_mut().enumerate() {
                let pairs = whitened.iter().zip(whitened.iter().skip(lag));
                *sum += pairs.map(|(a, b)| (a.conj() * b).re).sum::<f64>();
            }
        }
        let chance = 2.0 / (values.max(1) as f64).sqrt();
        let correlation: f64 = (1..lags.len())
            .map(|lag| lags[lag] / lags[0].max(f64::MIN_POSITIVE))
            .take_while(|r| *r > chance)
            .sum();
        Ok(Residual {
            nrms: (error / signal.max(f64::MIN_POSITIVE)).sqrt(),
            chi2_per_value: weighted / values.max(1) as f64,
            independent_share: 1.0 / (1.0 + 2.0 * correlation),
        })
    }

    fn rest(&self, model: &StructureModel, theta: &[f64]) -> Result<Rest> {
        let curves = model.rest(theta, &self.data)?;
        let mut tests = rest_patterns::test(&curves);
        // The sharpest test, and the most expensive one: where the others find nothing.
        if rest::largest(&tests).is_none() {
            tests.extend(place_test::test(model, theta, &self.data, &curves)?);
        }
        Ok(Rest {
            tests,
            small_errors: small_errors(&self.data),
            beyond_slips: None,
        })
    }

    fn beyond_slips(
        &self,
        model: &StructureModel,
        theta: &[f64],
        rest: &Rest,
    ) -> Result<Option<BeyondSlips>> {
        let Some(absorb) = self.slips else { return Ok(None) };
        let mut curves = model.rest(theta, &self.data)?;
        let only_a_place = rest
            .tests
            .iter()
            .all(|t| t.is_of_a_place() || !t.is_significant());
        // Of a model that is far off (all files in other units, say) they cannot be told; nothing is lost by that.
        let Ok(after) = absorb(model, &self.data, theta, &curves) else {
            return Ok(None);
        };
        let price = after.price;
        let mut beyond = rest_patterns::test_beyond(&mut curves, after);
        if only_a_place {
            let mut tests = place_test::test(model, theta, &self.data, &curves)?;
            tests.iter_mut().for_each(|t| t.excess += price);
            beyond.tests.extend(tests);
        }
        beyond.own_errors = self.own_errors(model, theta, &curves, &beyond)?;
        Ok(Some(beyond))
    }

    fn calibrate(&self, model: &StructureModel) -> Result<Calibration> {
        calibrate(model, &self.data, self.measured(), self.options)
    }
}

impl StructureStudy {
    /// What `curves`, left after small errors of the setup, say of errors that each has of its own.
    fn own_errors(
        &self,
        model: &StructureModel,
        theta: &[f64],
        curves: &[RestCurve],
        beyond: &BeyondSlips,
    ) -> Result<Option<OwnErrors>> {
        let Some(largest) = rest::largest(&beyond.tests) else {
            return Ok(None);
        };
        // What curves have in common is none of their own: the other test, an expensive one, need not be made.
        let Some(common) =
            common_course::common(curves).filter(|[found, std]| *found < common_course::TOO_MUCH + 3.0 * std)
        else {
            return Ok(None);
        };
        let tests = place_test::test(model, theta, &self.data, curves)?;
        let place = tests.iter().find(|t| t.looks_like == rest::LIKE_A_PLACE);
        Ok(place.map(|place| OwnErrors {
            common: common[0],
            common_std: common[1],
            of_a_place: place.excess / largest.excess,
            of_a_place_std: place.std / largest.excess,
        }))
    }
}

/// Σ r²/σ² over real values that errors of [`SMALL_ERROR`] of every FRF leave.
pub fn small_errors(data: &FrfData) -> f64 {
    let values = data
        .frfs()
        .flat_map(|(_, frf)| frf.receptance.iter().zip(&frf.noise_std));
    2.0 * SMALL_ERROR.powi(2) * values.map(|(h, std)| h.norm_sqr() / (std * std)).sum::<f64>()
}

/// Error on postures left out one at a time, refitted from `theta` on all lines of the others. `None` with fewer than two
/// measured postures.
pub fn held_out_postures(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<Option<HeldOut>> {
    let study = StructureStudy::new(data.clone(), Options::default());
    let stopping = Stopping {
        max_iterations: 30,
        relative_decrease: 1e-6,
    };
    held_out(&study, model, theta, Extent::Full, stopping)
}

/// Whether a misfit (half of Σ r²/σ², of so many real values) is so large that what is missing may have led the model's parameters
/// away from theirs.
pub fn led_astray(cost: f64, real_values: f64) -> bool {
    const ASTRAY: f64 = 1.5;
    2.0 * cost > ASTRAY * real_values
}

/// From where to fit besides, then (solver's scale): the nominal values, and where the `measured` modes put the model.
pub fn starts_elsewhere(model: &StructureModel, measured: Option<&[f64]>) -> Vec<Vec<f64>> {
    let nominal = model.nominal_theta();
    let measured = measured.filter(|m| m.len() == nominal.len());
    let measured = measured.map(<[f64]>::to_vec);
    std::iter::once(nominal).chain(measured).collect()
}

/// Neighbouring lines over which the residual's correlation is summed.
const CORRELATION_LAGS: usize = 40;

/// A frequency around which the residual stands out.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ResidualPeak {
    /// Hz.
    pub frequency_hz: f64,
    /// Root mean square of |model − measured|/σ around there, over all FRFs: 1 is noise.
    pub times_noise: f64,
}

/// Frequencies at which the weighted residual is largest, most prominent first. What neighbouring lines have in common
/// is counted: noise has nothing, however well its size is known. `predicted` in the order of `data.frfs()`.
pub fn residual_peaks(predicted: &[Vec<Complex64>], data: &FrfData) -> Vec<ResidualPeak> {
    const PEAKS: usize = 5;
    const BINS: usize = 90;
    /// Standard deviations of pure noise that a peak stands above.
    const CHANCE: f64 = 4.0;
    #[derive(Clone, Copy, Default)]
    struct Bin {
        /// Σ of the real part of r̄(k) r(k − 1).
        shared: f64,
        squares: f64,
        lines: usize,
    }
    let summary = data.summary();
    let ratio = (summary.highest_hz / summary.lowest_hz).ln();
    let mut bins = vec![Bin::default(); BINS];
    for ((block, frf), model) in data.frfs().zip(predicted) {
        let weighted = |k: usize| (model[k] - frf.receptance[k]) / frf.noise_std[k];
        for (k, f) in block.frequency_hz.iter().enumerate().skip(1) {
            let position = (f / summary.lowest_hz).ln() / ratio * BINS as f64;
            let bin = &mut bins[(position.max(0.0) as usize).min(BINS - 1)];
            bin.shared += (weighted(k).conj() * weighted(k - 1)).re;
            bin.squares += weighted(k).norm_sqr();
            bin.lines += 1;
        }
    }
    // The product of two independent unit complex values has variance ½ in each part.
    let level = |i: usize| bins[i].shared / (0.5 * bins[i].lines.max(1) as f64).sqrt();
    let mut peaks: Vec<usize> = (0..BINS)
        .filter(|&i| {
            let left = if i > 0 { level(i - 1) } else { 0.0 };
            let right = if i + 1 < BINS { level(i + 1) } else { 0.0 };
            level(i) > left && level(i) >= right && level(i) > CHANCE
        })
        .collect();
    peaks.sort_by(|a, b| level(*b).total_cmp(&level(*a)));
    let peak = |i: usize| ResidualPeak {
        frequency_hz: summary.lowest_hz * (ratio * (i as f64 + 0.5) / BINS as f64).exp(),
        times_noise: (bins[i].squares / bins[i].lines.max(1) as f64).sqrt(),
    };
    peaks.into_iter().take(PEAKS).map(peak).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::first_size::linear_size_of_shapes;
    use crate::identify::frfs::frf_problem::tests::{data, model};
    use crate::identify::study::{own_starts, rounds_of_bases};
    use approx::assert_relative_eq;

    /// FRFs that are a tenth larger than the model's, known to 2 %: two postures of three FRFs of five lines.
    fn larger(model: &StructureModel) -> FrfData {
        let mut data = data(model);
        let mut curves = model.predict(&model.nominal_theta(), &data).unwrap().into_iter();
        for block in &mut data.blocks {
            for frf in &mut std::sync::Arc::make_mut(block).frfs {
                frf.receptance = curves.next().unwrap().iter().map(|h| h * 1.1).collect();
                frf.noise_std = frf.receptance.iter().map(|h| 0.02 * h.norm()).collect();
            }
        }
        data
    }

    /// Each line is off by a part of 0.1/1.1, which is 4.5 times its noise; real and imaginary part have half of its variance each.
    #[test]
    fn errors_are_shares_of_the_signal_and_multiples_of_the_noise() {
        let model = model();
        let study = StructureStudy::new(larger(&model), Options::default());
        let theta = model.nominal_theta();
        let part = 0.1f64 / 1.1;
        let residual = study.residual(&model, &theta).unwrap();
        assert_relative_eq!(residual.nrms, part, max_relative = 1e-9);
        assert_relative_eq!(
            residual.chi2_per_value,
            (part / 0.02).powi(2),
            max_relative = 1e-9
        );
        assert_eq!((study.folds(), study.real_values(Extent::Full)), (2, 2 * 30));
        let fold = study.predict_fold(&model, &theta, 1).unwrap();
        assert_relative_eq!(fold.nrms(), part, max_relative = 1e-9);
        assert_relative_eq!(fold.chi2, 15.0 * 2.0 * (part / 0.02).powi(2), max_relative = 1e-9);
        // Errors of a hundredth are half of the noise.
        assert_relative_eq!(small_errors(&study.data), 30.0 * 2.0 * 0.25, max_relative = 1e-9);
    }

    /// A spring beside joint 2 that pushes more than the gear holds: at the posture where the robot falls over, nothing is predicted.
    #[test]
    fn where_the_robot_falls_over_nothing_is_predicted() {
        let bare = model();
        let study = StructureStudy::new(larger(&bare), Options::default());
        let spring = Registry::structure().find(&bare.robot.spec, "counterbalance@joint-2")[0];
        let held = bare.with_effect(spring, &study.known(&bare));
        let count = bare.parameters.len();
        let folds = [-120.0, -60.0, 0.0, 60.0].map(|stiffest_at_deg| {
            let sizes = [1e8, stiffest_at_deg];
            let own = held.parameters[count..]
                .iter()
                .zip(sizes)
                .map(|(p, v)| p.internal(v));
            let theta: Vec<f64> = bare.nominal_theta().into_iter().chain(own).collect();
            let fold = study.predict_fold(&held, &theta, 0).unwrap();
            (held.predict(&theta, &study.data).is_err(), fold.nrms())
        });
        assert!(
            folds
                .iter()
                .any(|(fell, nrms)| *fell && (nrms - 1.0).abs() < 1e-12),
            "{folds:?}"
        );
        assert!(folds.iter().all(|(_, nrms)| nrms.is_finite()), "{folds:?}");
    }

    /// A joint a third as stiff as in the robot file is put back, one twice as stiff is not.
    #[test]
    fn parameters_far_from_the_robot_file_are_put_back() {
        let model = model();
        let nominal = model.nominal_theta();
        let first = |found: &[f64]| vec![found.to_vec(), nominal.clone()];
        let mut found = nominal.clone();
        found[1] += 2f64.ln();
        assert_eq!(rounds_of_bases(&model, &found), [first(&found)]);
        let near = found.clone();
        found[2] -= 3f64.ln();
        assert_eq!(rounds_of_bases(&model, &found), [first(&found), vec![near]]);
        // All joints: the file is wrong.
        let all: Vec<f64> = nominal.iter().map(|t| t + 3f64.ln()).collect();
        assert_eq!(rounds_of_bases(&model, &all), [first(&all)]);
    }

    /// A load of 0.5 kg off the flange's axis: next to nothing, its centre of mass means nothing, and one step from there gives both.
    #[test]
    fn one_step_finds_the_size_and_the_shape_of_a_faint_effect() {
        let bare = model();
        let mut data = data(&bare);
        let load = Registry::structure().find(&bare.robot.spec, "payload-inertia")[0];
        let loaded = bare.with_effect(load, &bare.known(&data.summary()));
        let (count, sizes) = (bare.parameters.len(), [0.5, 0.14, 0.07, 0.12, 0.1]);
        let own = loaded.parameters[count..]
            .iter()
            .zip(sizes)
            .map(|(p, v)| p.internal(v));
        let truth: Vec<f64> = bare.nominal_theta().into_iter().chain(own).collect();
        let mut curves = loaded.predict(&truth, &data).unwrap().into_iter();
        for block in &mut data.blocks {
            for frf in &mut std::sync::Arc::make_mut(block).frfs {
                frf.receptance = curves.next().unwrap();
                frf.noise_std = frf.receptance.iter().map(|h| 0.5 * h.norm()).collect();
            }
        }
        let study = StructureStudy::new(data, Options::default());
        let starts = own_starts(&study, &loaded, count, &load, &[]);
        let problem = study.problem(&loaded, View::FULL);
        let size = linear_size_of_shapes(&problem, &loaded, &bare.nominal_theta(), &starts).unwrap();
        let found: Vec<f64> = (count..truth.len())
            .map(|i| loaded.parameters[i].natural(size.theta[i]))
            .collect();
        assert!((found[0] / sizes[0] - 1.0).abs() < 0.1, "{found:?}");
        for (found, true_m) in found[1..4].iter().zip(&sizes[1..4]) {
            assert!((found - true_m).abs() < 0.03, "{found} for {true_m}");
        }
        // It grew from the end of its range next to nothing, in one of the shapes that it was given.
        assert_eq!(size.shape[0], loaded.parameters[count].internal_bounds()[0]);
        assert!(starts.iter().any(|start| start[1..] == size.shape[1..]));
    }
}
