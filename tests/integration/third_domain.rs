//! A third kind of model, which the library has never heard of: polynomials that a harmonic or a step may be hidden in. The
//! loop (diagnose, add, diagnose again) finds what is missing without a line of its own.

use nalgebra::{DMatrix, DVector};
use rand::{Rng, SeedableRng};

use lobestone::Result;
use lobestone::discrepancy::extension::Extension;
use lobestone::discrepancy::{DiagnosisVerdict, diagnose};
use lobestone::effects::{At, Background, Domain, Effect, Known, Registry};
use lobestone::identify::first_size::linear_size;
use lobestone::identify::levenberg_marquardt::Stopping;
use lobestone::identify::study::{Extent, Residual, View};
use lobestone::identify::{
    Calibration, Case, HeldOut, LeastSquares, Linearisation, Model, Modelled, Parameter, Prior, Study,
    minimise,
};
use lobestone::robot::Dual;

/// y over x: a polynomial and what is added to it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Curve;

impl Domain for Curve {
    type Object = ();
    /// First and last x.
    type Summary = [f64; 2];
    /// x.
    type Setting<'a> = f64;
    /// y there.
    type Physics = Dual;
    type Sensors = ();
}

#[derive(Debug, Clone)]
struct Samples {
    x: Vec<f64>,
    y: Vec<f64>,
    std: f64,
}

impl Modelled for Curve {
    /// Degree of the polynomial.
    type Fixed = usize;
    type Data = Samples;
}

fn linear(name: &str, nominal: f64, std: f64, bounds: [f64; 2]) -> Parameter {
    Parameter::linear(name, "1", nominal, Prior { mean: nominal, std }, bounds)
}

const NOTHING_TO_READ: Background = Background {
    lab_check: "",
    typical: "",
    best_measured: "",
    sources: &[],
};

struct Harmonic;

impl Effect<Curve> for Harmonic {
    fn id(&self) -> &'static str {
        "harmonic"
    }
    fn explanation(&self) -> &'static str {
        "Something periodic rides on the curve."
    }
    fn fingerprint(&self) -> &'static str {
        "The residual comes back at equal distances."
    }
    fn background(&self) -> Background {
        NOTHING_TO_READ
    }
    fn parameters(&self, _at: At, _known: &Known<Curve>) -> Vec<Parameter> {
        vec![
            linear("amplitude", 0.1, 3.0, [0.0, 10.0]),
            linear("periods_per_unit", 1.0, 3.0, [0.5, 8.0]),
            linear("phase_rad", 0.0, 3.0, [-7.0, 7.0]),
        ]
    }
    fn starts(&self, _at: At, known: &Known<Curve>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let length = known.data[1] - known.data[0];
        let frequencies = (1..=16).map(|n| 0.5 * f64::from(n) / length);
        frequencies
            .flat_map(|f| [0.0, 2.0, -2.0].map(|phase| vec![0.3, f, phase]))
            .collect()
    }
    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0, p[1].nominal, p[2].nominal])
    }
    fn apply(&self, _at: At, values: &[Dual], x: &f64, y: &mut Dual) {
        let angle = &values[1].scale(std::f64::consts::TAU * x) + &values[2];
        let sine = angle.chain(angle.value.sin(), angle.value.cos());
        *y = &*y + &(&values[0] * &sine);
    }
}

/// A jump, rounded off over a hundredth of the range.
struct Step;

impl Effect<Curve> for Step {
    fn id(&self) -> &'static str {
        "step"
    }
    fn explanation(&self) -> &'static str {
        "The curve jumps."
    }
    fn fingerprint(&self) -> &'static str {
        "The residual is one thing before and another behind."
    }
    fn background(&self) -> Background {
        NOTHING_TO_READ
    }
    fn parameters(&self, _at: At, known: &Known<Curve>) -> Vec<Parameter> {
        let [first, last] = known.data;
        vec![
            linear("height", 0.1, 3.0, [-10.0, 10.0]),
            linear("place", 0.5 * (first + last), 1.0, [first, last]),
        ]
    }
    fn starts(&self, _at: At, known: &Known<Curve>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        let [first, last] = known.data;
        (1..10)
            .map(|k| vec![0.5, first + 0.1 * f64::from(k) * (last - first)])
            .collect()
    }
    fn vanishing(&self, _at: At, p: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0, p[1].nominal])
    }
    fn apply(&self, _at: At, values: &[Dual], x: &f64, y: &mut Dual) {
        const SHARPNESS: f64 = 100.0;
        let argument = (&Dual::constant(*x) - &values[1]).scale(SHARPNESS);
        let tanh = argument.value.tanh();
        *y = &*y + &(&values[0] * &argument.chain(0.5 * (1.0 + tanh), 0.5 * (1.0 - tanh * tanh)));
    }
}

/// A rounded hill in the middle, of a height that is known to a factor beforehand.
struct Hill;

/// Without its height.
fn hill(x: f64) -> f64 {
    (-(x - 2.0_f64).powi(2) / 0.08).exp()
}

impl Effect<Curve> for Hill {
    fn id(&self) -> &'static str {
        "hill"
    }
    fn explanation(&self) -> &'static str {
        "The curve has a hill."
    }
    fn fingerprint(&self) -> &'static str {
        "The residual rises once."
    }
    fn background(&self) -> Background {
        NOTHING_TO_READ
    }
    fn parameters(&self, _at: At, _known: &Known<Curve>) -> Vec<Parameter> {
        vec![Parameter::logarithmic("height", "1", 0.5, 0.4, [1e-6, 10.0])]
    }
    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        Some(vec![0.0])
    }
    fn apply(&self, _at: At, values: &[Dual], x: &f64, y: &mut Dual) {
        *y = &*y + &values[0].scale(hill(*x));
    }
}

/// y at x with derivatives by all parameters.
fn value(model: &Model<Curve>, theta: &[f64], x: f64) -> Dual {
    let degree: usize = **model;
    let mut y = Dual::constant(0.0);
    for k in 0..=degree {
        y = &y + &model.value(theta, k, true).scale(x.powi(k as i32));
    }
    for added in model.effects_in_order() {
        let values = model.values(theta, added, true);
        added
            .instance
            .effect
            .apply(added.instance.at(), &values, &x, &mut y);
    }
    y
}

struct CurveStudy {
    data: Samples,
    registry: Registry<Curve>,
}

const FOLDS: usize = 5;

struct Misfit<'a> {
    study: &'a CurveStudy,
    model: &'a Model<Curve>,
    left_out: Option<usize>,
}

impl LeastSquares for Misfit<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.linearise(theta)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        let n = theta.len();
        let data = &self.study.data;
        let (mut cost, mut gradient, mut hessian) = (0.0, DVector::zeros(n), DMatrix::zeros(n, n));
        for (i, (x, y)) in data.x.iter().zip(&data.y).enumerate() {
            if self.left_out == Some(i % FOLDS) {
                continue;
            }
            let model = value(self.model, theta, *x);
            let residual = (model.value - y) / data.std;
            let slope = DVector::from_fn(n, |k, _| model.derivative(k) / data.std);
            cost += 0.5 * residual * residual;
            gradient += &slope * residual;
            hessian += &slope * slope.transpose();
        }
        for (k, parameter) in self.model.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                let [value, slope, curvature] = prior.half_square(theta[k]);
                cost += value;
                gradient[k] += slope;
                hessian[(k, k)] += curvature;
            }
        }
        Ok(Linearisation {
            cost,
            gradient,
            hessian,
        })
    }
}

impl Study for CurveStudy {
    type Domain = Curve;
    type Problem<'a> = Misfit<'a>;

    fn registry(&self) -> &Registry<Curve> {
        &self.registry
    }
    fn known<'a>(&'a self, _model: &'a Model<Curve>) -> Known<'a, Curve> {
        let x = &self.data.x;
        Known {
            object: &(),
            data: [x[0], x[x.len() - 1]],
        }
    }
    fn problem<'a>(&'a self, model: &'a Model<Curve>, view: View) -> Misfit<'a> {
        Misfit {
            study: self,
            model,
            left_out: view.left_out,
        }
    }
    fn work_s(&self, _model: &Model<Curve>, _extent: Extent) -> f64 {
        1e-4
    }
    fn real_values(&self, _extent: Extent) -> usize {
        self.data.x.len()
    }
    fn folds(&self) -> usize {
        FOLDS
    }
    fn predict_fold(&self, model: &Model<Curve>, theta: &[f64], fold: usize) -> Result<HeldOut> {
        let mut sums = HeldOut::default();
        let own = self.data.x.iter().zip(&self.data.y).skip(fold).step_by(FOLDS);
        for (x, y) in own {
            let error = value(model, theta, *x).value - y;
            sums.error += error * error;
            sums.signal += y * y;
            sums.chi2 += (error / self.data.std).powi(2);
        }
        Ok(sums)
    }
    fn residual(&self, model: &Model<Curve>, theta: &[f64]) -> Result<Residual> {
        let mut sums = HeldOut::default();
        for fold in 0..FOLDS {
            let own = self.predict_fold(model, theta, fold)?;
            sums.error += own.error;
            sums.signal += own.signal;
            sums.chi2 += own.chi2;
        }
        Ok(Residual {
            nrms: sums.nrms(),
            chi2_per_value: sums.chi2 / self.data.x.len() as f64,
            independent_share: 1.0,
        })
    }
    fn calibrate(&self, model: &Model<Curve>) -> Result<Calibration> {
        let start = model
            .start()
            .map_or_else(|| model.nominal_theta(), <[f64]>::to_vec);
        let problem = self.problem(model, View::FULL);
        let fit = minimise(&problem, &start, &model.bounds(), Stopping::default())?;
        Calibration::of_fit(&model.parameters, fit, self.real_values(Extent::Full))
    }
}

/// y = 1 − 0.5 x + 0.3 x² with noise, and what `hidden` adds.
fn study(hidden: impl Fn(f64) -> f64) -> CurveStudy {
    const STD: f64 = 0.02;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    // A sum of twelve uniform numbers is normal to three digits.
    let mut noise = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * STD;
    let x: Vec<f64> = (0..1000).map(|i| 0.004 * f64::from(i)).collect();
    let y = x
        .iter()
        .map(|x| 1.0 - 0.5 * x + 0.3 * x * x + hidden(*x) + noise());
    CurveStudy {
        data: Samples {
            y: y.collect(),
            x,
            std: STD,
        },
        registry: Registry::new(&[&Harmonic, &Step]),
    }
}

fn bare() -> Model<Curve> {
    let coefficient = |k| linear(&format!("c{k}"), 0.0, 10.0, [-100.0, 100.0]);
    Model::of(2, (0..3).map(coefficient).collect())
}

#[test]
fn a_hidden_harmonic_is_found_added_and_the_error_falls() {
    let study = study(|x| 0.1 * (std::f64::consts::TAU * 1.7 * x + 0.4).sin());
    let diagnosis = diagnose(&study, &bare()).unwrap();
    assert_eq!(diagnosis.verdict, DiagnosisVerdict::Effect);
    assert_eq!(diagnosis.winner().unwrap().label(), "harmonic");
    assert!(diagnosis.confidence > 0.9, "{}", diagnosis.confidence);

    let instances = study.registry().find(&(), "harmonic");
    let extension = Extension::new(&study, &bare(), &instances).unwrap();
    assert_eq!(extension.progress, Some(true));
    assert!(extension.after.residual.nrms < 0.4 * extension.before.residual.nrms);
    let own = &extension.after.calibration.parameters[3..];
    for (found, truth) in own.iter().zip([0.1, 1.7, 0.4]) {
        assert!((found.value - truth).abs() < 4.0 * found.std_error, "{found:?}");
        assert!(found.std_error < 0.1 * truth, "{found:?}");
    }

    let mut case = Case::without_history(bare(), study.data.clone(), Vec::new());
    let after = extension.after;
    case.model = after.model.with_start(after.calibration.theta);
    assert_eq!(case.model_description(), "baseline + harmonic, no effect added");
    let again = diagnose(&study, &case.model).unwrap();
    assert_eq!(again.verdict, DiagnosisVerdict::None);
}

#[test]
fn a_step_is_no_harmonic_and_noise_is_nothing() {
    let step = diagnose(&study(|x| if x > 2.3 { 0.1 } else { 0.0 }), &bare()).unwrap();
    assert_eq!(step.winner().unwrap().label(), "step");
    let nothing = diagnose(&study(|_| 0.0), &bare()).unwrap();
    assert_eq!(nothing.verdict, DiagnosisVerdict::None);
}

/// A height to which the prior says twelve times as much, to a factor of e^0.4: the size is that of linear least squares.
#[test]
fn the_size_of_an_effect_that_is_linear_in_it_is_found_in_one_step_whatever_the_prior() {
    const HEIGHT: f64 = 0.04;
    let of = |height: f64| {
        let study = CurveStudy {
            registry: Registry::new(&[&Hill]),
            ..study(|x| height * hill(x))
        };
        let base = study.calibrate(&bare()).unwrap();
        let instance = study.registry().find(&(), "hill").remove(0);
        let model = bare().with_effect(instance, &study.known(&bare()));
        let found = linear_size(&study.problem(&model, View::FULL), &model, &base.theta);
        (study.data, found)
    };
    let (data, found) = of(HEIGHT);
    let found = found.unwrap();
    let column = |k: usize, x: f64| if k < 3 { x.powi(k as i32) } else { hill(x) };
    let columns = DMatrix::from_fn(data.x.len(), 4, |i, k| column(k, data.x[i]));
    let inverse = (columns.transpose() * &columns).try_inverse().unwrap();
    let height = (&inverse * columns.transpose() * DVector::from_column_slice(&data.y))[3];
    let std = data.std * inverse[(3, 3)].sqrt();
    assert!((height - HEIGHT).abs() < 3.0 * std, "{height} ± {std}");
    let size = found.theta[3].exp();
    assert!((size / height - 1.0).abs() < 1e-3, "{size}, not {height}");
    let gain = (height / std).powi(2);
    assert!(
        (found.gain / gain - 1.0).abs() < 1e-3,
        "{}, not {gain}",
        found.gain
    );
    // A hollow is not asked for.
    assert_eq!(of(-HEIGHT).1, None);
}
