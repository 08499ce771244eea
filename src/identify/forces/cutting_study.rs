//! Force records and a cutting model as a [`Study`].

use num_complex::Complex64;

use crate::Result;
use crate::effects::{Cutting, Known, Registry};
use crate::identify::forces::cutting_data::CuttingData;
use crate::identify::forces::cutting_model::CuttingModel;
use crate::identify::forces::cutting_problem::{CutFit, CuttingProblem};
use crate::identify::forces::cutting_waves::axis_waves;
use crate::identify::frfs::calibrate::Calibration;
use crate::identify::levenberg_marquardt::{Stopping, minimise};
use crate::identify::rest::{Rest, RestTest, SMALL_ERROR};
use crate::identify::rest_patterns;
use crate::identify::study::{Extent, HeldOut, Residual, Study, View, held_out};

/// A campaign's force records of one process, arranged for the loop.
#[derive(Debug, Clone)]
pub struct CuttingStudy {
    /// All cuts.
    pub data: CuttingData,
    /// Cuts of each fold, and the data without them.
    folds: Vec<Vec<usize>>,
    without: Vec<CuttingData>,
    registry: Registry<Cutting>,
}

/// Cuts are left out in this many groups, spread over the campaign.
const FOLDS: usize = 5;

impl CuttingStudy {
    /// Divides the cuts into folds.
    pub fn new(data: CuttingData) -> Self {
        let count = FOLDS.min(data.cuts.len());
        let folds: Vec<Vec<usize>> = (0..count)
            .map(|k| (k..data.cuts.len()).step_by(count).collect())
            .collect();
        let without = folds
            .iter()
            .map(|fold| data.filtered(|i| !fold.contains(&i)))
            .collect();
        CuttingStudy {
            data,
            folds,
            without,
            registry: Registry::cutting(),
        }
    }

    /// The same study, which tries these effects.
    pub fn with_registry(self, registry: Registry<Cutting>) -> Self {
        CuttingStudy { registry, ..self }
    }
}

impl Study for CuttingStudy {
    type Domain = Cutting;
    type Problem<'a> = CuttingProblem<'a>;

    fn registry(&self) -> &Registry<Cutting> {
        &self.registry
    }

    fn known<'a>(&'a self, model: &'a CuttingModel) -> Known<'a, Cutting> {
        model.known(&self.data)
    }

    /// One misfit serves near and far, and all data are few enough for every view.
    fn problem<'a>(&'a self, model: &'a CuttingModel, view: View) -> CuttingProblem<'a> {
        CuttingProblem {
            model,
            data: view.left_out.map_or(&self.data, |fold| &self.without[fold]),
        }
    }

    /// Some microseconds a value: all effects cost about the same.
    fn work_s(&self, model: &CuttingModel, _extent: Extent) -> f64 {
        2e-7 * (self.data.value_count() * (1 + model.parameters.len())) as f64
    }

    fn real_values(&self, _extent: Extent) -> usize {
        self.data.value_count()
    }

    fn folds(&self) -> usize {
        self.folds.len()
    }

    fn predict_fold(&self, model: &CuttingModel, theta: &[f64], fold: usize) -> Result<HeldOut> {
        let own = self.data.filtered(|i| self.folds[fold].contains(&i));
        let fits = CuttingProblem { model, data: &own }.fits(theta)?;
        Ok(sums(&own, &fits))
    }

    fn residual(&self, model: &CuttingModel, theta: &[f64]) -> Result<Residual> {
        let fits = CuttingProblem {
            model,
            data: &self.data,
        }
        .fits(theta)?;
        let sums = sums(&self.data, &fits);
        Ok(Residual {
            nrms: sums.nrms(),
            chi2_per_value: sums.chi2 / self.data.value_count().max(1) as f64,
            independent_share: independent_share(&self.data, &fits),
        })
    }

    fn rest(&self, model: &CuttingModel, theta: &[f64]) -> Result<Rest> {
        let data = &self.data;
        let problem = CuttingProblem { model, data };
        let fits = problem.fits(theta)?;
        let total: f64 = fits.iter().map(|f| f.chi2).sum();
        let freedom = data.value_count() as f64 - theta.len() as f64;
        let (common, values) = common_wave(data, &fits);
        // A limit cycle is as large as it likes in each cut: cuts that vibrate say nothing about what is the same in all.
        let calm = data.filtered(|i| data.cuts[i].vibration.is_none());
        let calm = CuttingProblem { model, data: &calm };
        let (apart, differences) = rest_patterns::apart(&calm.by_cut(theta)?);
        let tests = [
            (LIKE_CUTS, apart, differences),
            (COMMON_WAVE, common, values),
            (ALL_OVER, total, freedom),
        ];
        let tests = tests.into_iter().filter_map(|(looks_like, found, freedom)| {
            RestTest::against_known_noise(looks_like, found, freedom, NOISE_KNOWN_TO)
        });
        Ok(Rest {
            tests: tests.collect(),
            small_errors: small_errors(data),
            beyond_slips: None,
        })
    }

    fn calibrate(&self, model: &CuttingModel) -> Result<Calibration> {
        calibrate_cutting(model, &self.data)
    }
}

/// Fits `model` to `data` from its start. (A baseline's nominal values are those of the mean forces: the misfit is nearly
/// quadratic around them.)
pub fn calibrate_cutting(model: &CuttingModel, data: &CuttingData) -> Result<Calibration> {
    let fit = minimise(
        &CuttingProblem { model, data },
        model.start().unwrap_or(&model.nominal_theta()),
        &model.bounds(),
        Stopping::default(),
    )?;
    Calibration::of_fit(&model.parameters, fit, data.value_count())
}

/// Error of `model` at `theta` over the signal, as [`Residual::nrms`].
///
/// # Errors
/// Those of the model.
pub fn cutting_nrms(model: &CuttingModel, data: &CuttingData, theta: &[f64]) -> Result<f64> {
    let fits = CuttingProblem { model, data }.fits(theta)?;
    Ok(sums(data, &fits).nrms())
}

/// A reading of the channels is proposed only where it leaves less than this of the signal: half of its power.
pub const EXPLAINS_NRMS: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Error on cuts left out in turn, refitted from `theta` on the others. `None` with fewer than two cuts.
pub fn held_out_cuts(model: &CuttingModel, data: &CuttingData, theta: &[f64]) -> Result<Option<HeldOut>> {
    let study = CuttingStudy::new(data.clone());
    held_out(&study, model, theta, Extent::Full, Stopping::default())
}

fn sums(data: &CuttingData, fits: &[CutFit]) -> HeldOut {
    let mut sums = HeldOut::default();
    for (cut, fit) in data.cuts.iter().zip(fits) {
        for wave in axis_waves(data, cut, fit).iter().flat_map(|a| &a.orders) {
            sums.error += wave.error;
            sums.signal += wave.signal;
        }
        sums.chi2 += fit.chi2;
    }
    sums
}

const LIKE_CUTS: &str = "parameters that differ from cut to cut";
const COMMON_WAVE: &str = "a waveform that all cuts have in common";
const ALL_OVER: &str = "more than the noise all over";
/// Relative standard deviation of the noise variance as revolutions against one another show it.
pub const NOISE_KNOWN_TO: f64 = 0.02;

/// Σ r²/σ² over real values that errors of [`SMALL_ERROR`] of every recorded order leave.
pub fn small_errors(data: &CuttingData) -> f64 {
    let channels = data.cuts.iter().flat_map(|cut| cut.channels.iter().flatten());
    channels
        .flat_map(|channel| channel.orders.iter().zip(&channel.order_std))
        .map(|(order, std)| 2.0 * order.norm_sqr() / (std * std))
        .sum::<f64>()
        * SMALL_ERROR.powi(2)
}

/// Energy of the residual waveform that the cuts have in common, each turned to the same angle of the tool, and the number
/// of values in it.
fn common_wave(data: &CuttingData, fits: &[CutFit]) -> (f64, f64) {
    let mut sums: Vec<(Complex64, f64)> = Vec::new();
    let orders = data.cuts.iter().map(|c| c.orders).max().unwrap_or(0);
    sums.resize(4 * orders, (Complex64::ZERO, 0.0));
    let calm = data
        .cuts
        .iter()
        .zip(fits)
        .filter(|(cut, _)| cut.vibration.is_none());
    for (cut, fit) in calm {
        for (i, (channel, fitted)) in cut.channels.iter().zip(&fit.channels).enumerate() {
            let (Some(channel), Some(fitted)) = (channel, fitted) else {
                continue;
            };
            let pairs = fitted.orders.iter().zip(&channel.orders).zip(&channel.order_std);
            for (n, ((model, seen), std)) in pairs.enumerate() {
                let turn = Complex64::from_polar(1.0, (n + 1) as f64 * fit.placement);
                let sum = &mut sums[i * orders + n];
                sum.0 += (model - seen) * turn / *std;
                sum.1 += 1.0;
            }
        }
    }
    let shared = || sums.iter().filter(|s| s.1 > 1.0);
    let energy = shared().map(|(sum, count)| 2.0 * sum.norm_sqr() / count).sum();
    (energy, 2.0 * shared().count() as f64)
}

/// Neighbouring orders and blocks over which the residual's correlation is summed.
const CORRELATION_LAGS: usize = 12;

/// Share of the values that counts as independent, from the correlation of neighbouring orders and of neighbouring blocks.
fn independent_share(data: &CuttingData, fits: &[CutFit]) -> f64 {
    let mut lags = [0.0; CORRELATION_LAGS + 1];
    let mut count = 0usize;
    let mut add = |series: &[f64]| {
        count += series.len();
        for (lag, sum) in lags.iter_mut().enumerate() {
            *sum += series
                .iter()
                .zip(series.iter().skip(lag))
                .map(|(a, b)| a * b)
                .sum::<f64>();
        }
    };
    for (cut, fit) in data.cuts.iter().zip(fits) {
        for (channel, fit) in cut.channels.iter().zip(&fit.channels) {
            let (Some(channel), Some(fit)) = (channel, fit) else {
                continue;
            };
            let order = |part: fn(&num_complex::Complex64) -> f64| -> Vec<f64> {
                let pairs = fit.orders.iter().zip(&channel.orders).zip(&channel.order_std);
                pairs.map(|((m, d), s)| part(&(m - d)) / s).collect()
            };
            add(&order(|c| c.re));
            add(&order(|c| c.im));
            let level: Vec<f64> = (0..channel.level.len())
                .map(|b| (fit.level[b] + fit.zero[b] - channel.level[b]) / channel.level_std[b])
                .collect();
            add(&level);
        }
    }
    let chance = 2.0 / (count.max(1) as f64).sqrt();
    let correlation: f64 = (1..lags.len())
        .map(|lag| lags[lag] / lags[0].max(f64::MIN_POSITIVE))
        .take_while(|r| *r > chance)
        .sum();
    1.0 / (1.0 + 2.0 * correlation)
}
