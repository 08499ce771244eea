//! Force records and a cutting model as a [`Study`].

use num_complex::Complex64;

use crate::Result;
use crate::effects::{Cutting, Known, Registry};
use crate::identify::forces::cutting_data::{CutData, CuttingData, ForceChannel};
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

/// Σ r²/σ² over real values that errors of [`SMALL_ERROR`] of every recorded order leave; of a channel without orders (drilling,
/// turning), of every level of the steady cut. (Without those nothing would be excused there, and an error of no size has no density.)
pub fn small_errors(data: &CuttingData) -> f64 {
    let of_channel = |cut: &CutData, channel: &ForceChannel| -> f64 {
        match channel.orders.is_empty() {
            true => cut.levels_over_noise(channel).map(|level| level * level).sum(),
            false => {
                let orders = channel.orders.iter().zip(&channel.order_std);
                orders
                    .map(|(order, std)| 2.0 * order.norm_sqr() / (std * std))
                    .sum()
            }
        }
    };
    let cuts = data.cuts.iter();
    let all = cuts.flat_map(|cut| {
        cut.channels
            .iter()
            .flatten()
            .map(move |channel| of_channel(cut, channel))
    });
    all.sum::<f64>() * SMALL_ERROR.powi(2)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::forces::made_cuts::{METAL, MILLED, changed, milled, turned, with_orders_of};
    use approx::assert_relative_eq;
    use rand::SeedableRng;

    fn fitted(data: &CuttingData) -> Vec<CutFit> {
        let model = CuttingModel::new(data, true).unwrap();
        CuttingProblem { model: &model, data }.fits(&METAL).unwrap()
    }

    /// The same ripple of the tool in cuts that stood at different angles adds up to all of its χ²; of the contrary sign in each
    /// second cut nothing is left of it.
    #[test]
    fn a_ripple_that_all_cuts_have_is_found_at_the_angle_of_the_tool() {
        let data = milled(METAL, &[MILLED[0], MILLED[1]]);
        let fits = fitted(&data);
        let ripple = |signs: [f64; 2]| {
            let mut data = data.clone();
            for ((cut, fit), sign) in data.cuts.iter_mut().zip(&fits).zip(signs) {
                let cut = std::sync::Arc::make_mut(cut);
                with_orders_of(cut, fit);
                // Order 3 of x: 4 N at an angle of the tool, recorded from the angle at which it stood; errors of 2 N.
                let x = cut.channels[0].as_mut().unwrap();
                x.orders[2] += Complex64::from_polar(4.0 * sign, 0.5 - 3.0 * fit.placement);
                x.order_std[2] = 2.0;
            }
            common_wave(&data, &fits)
        };
        let (energy, values) = ripple([1.0, 1.0]);
        // Two cuts of 2 · (4 N / 2 N)²; three channels of twelve orders.
        assert_relative_eq!(energy, 16.0, max_relative = 1e-9);
        assert_eq!(values, 72.0);
        assert_relative_eq!(ripple([1.0, -1.0]).0, 0.0, epsilon = 1e-9);
        // A cut that vibrates says nothing, and one alone has nothing in common.
        let mut one_vibrates = data.clone();
        std::sync::Arc::make_mut(&mut one_vibrates.cuts[0]).vibration =
            Some(crate::identify::forces::asynchronous_lines::AsynchronousLines {
                frequency_hz: 431.0,
                lines: Vec::new(),
            });
        assert_eq!(common_wave(&one_vibrates, &fits), (0.0, 0.0));
    }

    /// Neighbours that share ρ leave (1 − ρ)/(1 + ρ) of the values independent (Bayley and Hammersley 1946).
    #[test]
    fn values_alike_their_neighbours_are_fewer_than_they_look() {
        let data = milled(METAL, &MILLED[..1]);
        let fits = fitted(&data);
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        for rho in [0.0f64, 0.5] {
            let mut series = || {
                let mut last = 0.0;
                let next = |_| {
                    last =
                        rho * last + (1.0 - rho * rho).sqrt() * crate::statistics::nearly_normal(&mut random);
                    last
                };
                (0..20_000).map(next).collect::<Vec<f64>>()
            };
            let (re, im) = (series(), series());
            let noisy = changed(&data, |cut| {
                cut.channels = [cut.channels[0].clone(), None, None, None];
                let x = cut.channels[0].as_mut().unwrap();
                // Errors of 3 N of all orders, those of the channel's levels are its own.
                x.orders = re
                    .iter()
                    .zip(&im)
                    .map(|(re, im)| Complex64::new(3.0 * re, 3.0 * im))
                    .collect();
                x.order_std = vec![3.0; x.orders.len()];
            });
            let mut own = fits.clone();
            own[0].channels[0].as_mut().unwrap().orders = vec![Complex64::ZERO; re.len()];
            let share = independent_share(&noisy, &own);
            assert!(
                (share - (1.0 - rho) / (1.0 + rho)).abs() < 0.03,
                "{share} for {rho}"
            );
        }
    }

    /// Errors of a hundredth of every order, each of two real values with half of its variance.
    #[test]
    fn small_errors_are_a_hundredth_of_what_is_recorded() {
        let data = changed(&milled(METAL, &MILLED[..1]), |cut| {
            for channel in cut.channels.iter_mut().flatten() {
                channel.orders = vec![Complex64::new(30.0, 40.0)];
                channel.order_std = vec![2.0];
            }
        });
        // Three channels of 2 · (0.01 · 50 N / 2 N)².
        assert_relative_eq!(small_errors(&data), 3.0 * 2.0 * 0.0625, max_relative = 1e-12);
    }

    /// A bar is turned without orders: six levels of each of its three forces, known to 1 N, above a zero that rises by 2 N/s.
    #[test]
    fn small_errors_of_cuts_without_orders_are_a_hundredth_of_their_levels() {
        let data = turned(METAL, &[0.2]);
        // x, y, z: 1.5 mm · (300 · 0.2 + 25, 150 · 0.2 + 3, 800 · 0.2 + 20) N/mm; the air lies half a second before the cut.
        let squares: f64 = [127.5f64, 49.5, 270.0]
            .iter()
            .map(|force| (force + 1.0).powi(2))
            .sum();
        assert_relative_eq!(small_errors(&data), 6.0 * 1e-4 * squares, max_relative = 1e-3);
    }

    /// Cuts left out are predicted from the others: where all were made by one law there is no error, and its coefficients are found.
    #[test]
    fn turned_cuts_are_fitted_and_predicted() {
        let data = turned(METAL, &[0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4]);
        let model = CuttingModel::new(&data, true).unwrap();
        let calibration = calibrate_cutting(&model, &data).unwrap();
        for (parameter, truth) in calibration.parameters.iter().zip(METAL) {
            assert_relative_eq!(parameter.value, truth, max_relative = 1e-4);
        }
        let held_out = held_out_cuts(&model, &data, &calibration.theta).unwrap().unwrap();
        assert!(held_out.nrms() < 1e-5 && held_out.chi2 < 1e-3);
        assert_eq!(held_out.by_fold.len(), 5);
        assert!(cutting_nrms(&model, &data, &METAL).unwrap() < 1e-9);
        let larger: Vec<f64> = METAL.iter().map(|k| 1.05 * k).collect();
        assert_relative_eq!(
            cutting_nrms(&model, &data, &larger).unwrap(),
            0.05,
            max_relative = 1e-6
        );
    }

    /// Cuts of two metals: no coefficients for all of them, and the cuts' own fits say so.
    #[test]
    fn a_cut_of_another_metal_shows_as_unlike_the_others() {
        let same = turned(METAL, &[0.1, 0.2, 0.3, 0.4]);
        let rest = |data: CuttingData| {
            let study = CuttingStudy::new(data);
            let model = CuttingModel::new(&study.data, true).unwrap();
            let theta = study.calibrate(&model).unwrap().theta;
            study.rest(&model, &theta).unwrap()
        };
        let unlike = |rest: &Rest| {
            rest.tests
                .iter()
                .find(|t| t.looks_like == LIKE_CUTS)
                .map(|t| t.p_value)
        };
        assert!(unlike(&rest(same.clone())).is_none_or(|p| p > 0.1));
        let mut other = same;
        let harder = turned(METAL.map(|k| 1.5 * k), &[0.1, 0.2, 0.3, 0.4]);
        other.cuts[3].clone_from(&harder.cuts[3]);
        other.cuts[1].clone_from(&harder.cuts[1]);
        assert!(unlike(&rest(other)).is_some_and(|p| p < 1e-6));
    }
}
