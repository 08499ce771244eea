//! How much of what a model leaves the small errors of a careful setup can take: those that every laboratory has, none of
//! them worth a name.
//!
//! Encoders, hammer gain, direction of the hits, sensors and stiffness are each a little wrong, anew at every posture. Their
//! sizes are known beforehand (normal laws about zero, [`care`]), so that they are estimated together with the model's
//! parameters, and each has to pay for its size. Physics that is the same at all postures is not followed by errors that
//! differ from one to the next; the tests of structure are then made on what is left.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use num_complex::Complex64;
use rayon::prelude::*;

use super::care::{self, Care};
use super::group::FrfGroup;
use super::mistake::Mistake;
use super::mistakes::{channel_gain, encoder_offset, hit_direction, sensor_high_pass, turned_sensor};
use super::scene::{Made, predict};
use super::slipped::{Slipped, SmallError};
use crate::Result;
use crate::data::Axis;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData};
use crate::identify::rest::{AfterSlips, RestCurve};
use crate::parameter::Scale;

/// Standard deviations of what a careful setup is wrong by: angles of the joints and of the sensors, direction of the hits
/// (deg), gain of the hammer (relative), stiffness from posture to posture (relative), by chance and as a robot that warms up
/// changes it from one to the next, corner of the sensors (Hz).
const ENCODER_DEG: f64 = 0.1;
const SENSOR_DEG: f64 = 0.7;
const HIT_DEG: f64 = 1.5;
const GAIN: f64 = 0.01;
const STIFFNESS: f64 = 0.003;
const WARMING: f64 = 0.002;
const CORNER_HZ: f64 = 0.03;

/// Differences are taken over this many standard deviations.
const STEP: f64 = 1e-2;
/// Steps of the estimate, all with the slopes at the model's optimum.
const STEPS: usize = 5;
/// Change of χ² by which a step no longer matters: effects are told from small errors by differences of ten.
const SETTLED: f64 = 1.0;

/// One error: what it does where it is, and each place that it may be at on its own.
struct Slip {
    error: SmallError,
    /// Its standard deviation.
    std: f64,
    /// Change of each curve by one standard deviation, over σ.
    change: Vec<Vec<Complex64>>,
    places: Vec<FrfGroup>,
}

/// Takes what small errors of the setup can out of `curves`, the rest of `model` at `theta`, its optimum on `data`.
///
/// # Errors
/// A model without a response.
pub fn absorb(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    curves: &[RestCurve],
) -> Result<AfterSlips> {
    let slips = slips(model, data, theta, curves)?;
    let system = System::new(model, data, theta, curves, &slips)?;
    let found: Vec<Vec<Complex64>> = curves.iter().map(|c| c.rest.clone()).collect();
    let before = energy(&found);
    // What is left at zero as the slopes have it, from the last point that was tried.
    let mut origin = found;
    let mut best: Option<AfterSlips> = None;
    for _ in 0..STEPS {
        let (sizes, care) = system.solve(&origin)?;
        let linear = system.moved(&origin, &sizes, 1.0);
        let Ok(rest) = system.exact(&sizes) else { break };
        let (expected, left) = (energy(&linear), energy(&rest));
        let after = AfterSlips {
            price: care.price,
            unlikely: care.surprise(&SmallError::origins(system.hits_repeat(&sizes))),
            evidence: care.evidence(before - left),
            known_to: (left - expected).abs(),
            rest,
        };
        let better = best.as_ref().is_none_or(|b| after.evidence > b.evidence);
        if better {
            origin = system.moved(&after.rest, &sizes, -1.0);
            best = Some(after);
        }
        if !better || (left - expected).abs() < SETTLED {
            break;
        }
    }
    // Where the model is far off the slopes ask for errors so large that nothing answers any more: small ones take nothing there, and the
    // origin is still what was found.
    Ok(best.unwrap_or(AfterSlips {
        rest: origin,
        price: 0.0,
        unlikely: 0.0,
        evidence: 0.0,
        known_to: 0.0,
    }))
}

/// Σ r²/σ² over real values.
fn energy(rest: &[Vec<Complex64>]) -> f64 {
    2.0 * rest.iter().flatten().map(Complex64::norm_sqr).sum::<f64>()
}

/// The model's parameters and the errors as the unknowns of one linear problem: first the parameters, then each slip at each
/// of its places, in units of its standard deviation.
struct System<'a> {
    model: &'a StructureModel,
    data: &'a FrfData,
    theta: &'a [f64],
    curves: &'a [RestCurve],
    slips: &'a [Slip],
    /// First unknown of each slip.
    starts: Vec<usize>,
    /// Curve by curve: slips that concern it and their unknown.
    active: Vec<Vec<(usize, usize)>>,
    /// Kind of each error, see [`SmallError::kind`].
    kinds: Vec<usize>,
    of_model: Cholesky<f64, Dyn>,
    /// What the model's parameters do about a unit of each error.
    follow: DMatrix<f64>,
    /// Information on the errors, the model's parameters having followed.
    alone: DMatrix<f64>,
}

impl<'a> System<'a> {
    fn new(
        model: &'a StructureModel,
        data: &'a FrfData,
        theta: &'a [f64],
        curves: &'a [RestCurve],
        slips: &'a [Slip],
    ) -> Result<Self> {
        let own = model.parameters.len();
        let mut count = own;
        let mut starts = Vec::new();
        for slip in slips {
            starts.push(count);
            count += slip.places.len();
        }
        let concerning = |frf| {
            let numbered = slips.iter().zip(&starts).enumerate();
            numbered
                .flat_map(|(s, (slip, start))| {
                    let places = slip.places.iter().enumerate();
                    places
                        .filter(|(_, g)| g.holds(frf))
                        .map(move |(place, _)| (s, start + place))
                })
                .collect()
        };
        let active: Vec<Vec<(usize, usize)>> = data.frfs().map(|(_, frf)| concerning(frf)).collect();
        // Noise has E|r|² = 1 per complex value: each part counts double.
        let mut information = DMatrix::<f64>::zeros(count, count);
        for (k, active) in active.iter().enumerate() {
            let columns = columns(k, curves, slips, active);
            for (a, (i, x)) in columns.iter().enumerate() {
                for (j, y) in &columns[..=a] {
                    let sum = 2.0 * real_product(x, y);
                    information[(*i, *j)] += sum;
                    if i != j {
                        information[(*j, *i)] += sum;
                    }
                }
            }
        }
        for (i, parameter) in model.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                information[(i, i)] += prior.half_square(theta[i])[2];
            }
            // A parameter that this data does not see at all stays where it is.
            information[(i, i)] += 1e-9 * (1.0 + information[(i, i)]);
        }
        let errors = count - own;
        let of_model = information
            .view((0, 0), (own, own))
            .into_owned()
            .cholesky()
            .ok_or_else(|| crate::Error::computation("the data do not determine the parameters"))?;
        let cross = information.view((0, own), (own, errors)).into_owned();
        let follow = of_model.solve(&cross);
        let alone = information.view((own, own), (errors, errors)) - cross.tr_mul(&follow);
        Ok(System {
            model,
            data,
            theta,
            curves,
            slips,
            starts,
            active,
            kinds: slips
                .iter()
                .flat_map(|s| std::iter::repeat_n(s.error.kind(), s.places.len()))
                .collect(),
            of_model,
            follow,
            alone,
        })
    }

    fn columns(&self, k: usize) -> Vec<(usize, &[Complex64])> {
        columns(k, self.curves, self.slips, &self.active[k])
    }

    /// Changes of all unknowns, errors in their standard deviations, of greatest probability for `rest` left at zero.
    fn solve(&self, rest: &[Vec<Complex64>]) -> Result<(DVector<f64>, Care)> {
        let own = self.theta.len();
        let errors = self.kinds.len();
        let mut gradient = DVector::<f64>::zeros(own + errors);
        for (k, rest) in rest.iter().enumerate() {
            for (i, x) in self.columns(k) {
                gradient[i] += 2.0 * real_product(x, rest);
            }
        }
        for (i, parameter) in self.model.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                gradient[i] += prior.half_square(self.theta[i])[1];
            }
        }
        let of_model = gradient.rows(0, own).into_owned();
        let of_errors = gradient.rows(own, errors) - self.follow.tr_mul(&of_model);
        let care = care::estimate(&self.alone, &of_errors, &self.kinds)?;
        let mut sizes = DVector::zeros(own + errors);
        let followed = -self.of_model.solve(&of_model) - &self.follow * &care.sizes;
        sizes.rows_mut(0, own).copy_from(&followed);
        sizes.rows_mut(own, errors).copy_from(&care.sizes);
        Ok((sizes, care))
    }

    /// Whether most of what the directions of the hits are off by is the same at all postures.
    fn hits_repeat(&self, sizes: &DVector<f64>) -> bool {
        let (mut same, mut all) = (0.0, 0.0);
        for (slip, start) in self.slips.iter().zip(&self.starts) {
            if !matches!(slip.error, SmallError::Hit(_)) {
                continue;
            }
            for axis in Axis::ALL {
                let of_axis = slip.places.iter().enumerate();
                let of_axis = of_axis.filter(|(_, g)| g.reference_axis == Some(axis));
                let own: Vec<f64> = of_axis.map(|(place, _)| sizes[start + place]).collect();
                if !own.is_empty() {
                    same += own.iter().sum::<f64>().powi(2) / own.len() as f64;
                    all += own.iter().map(|size| size * size).sum::<f64>();
                }
            }
        }
        2.0 * same > all
    }

    /// `rest` after `times` the change that the slopes foresee for `sizes`.
    fn moved(&self, rest: &[Vec<Complex64>], sizes: &DVector<f64>, times: f64) -> Vec<Vec<Complex64>> {
        let mut moved = rest.to_vec();
        for (k, rest) in moved.iter_mut().enumerate() {
            for (i, column) in self.columns(k) {
                rest.iter_mut()
                    .zip(column)
                    .for_each(|(r, c)| *r += c * (times * sizes[i]));
            }
        }
        moved
    }

    /// What is left with errors of these sizes, all made at once.
    fn exact(&self, sizes: &DVector<f64>) -> Result<Vec<Vec<Complex64>>> {
        let bounds = self.model.bounds();
        let blocks: Vec<Vec<Vec<Complex64>>> = self
            .data
            .blocks
            .par_iter()
            .map(|block| self.exact_block(sizes, &bounds, block))
            .collect::<Result<_>>()?;
        let all: Vec<Vec<Complex64>> = blocks.into_iter().flatten().collect();
        let finite = all.iter().flatten().all(|r| r.is_finite());
        finite
            .then_some(all)
            .ok_or_else(|| crate::Error::computation("small errors of the setup without a response"))
    }

    fn exact_block(
        &self,
        sizes: &DVector<f64>,
        bounds: &[[f64; 2]],
        block: &std::sync::Arc<FrfBlock>,
    ) -> Result<Vec<Vec<Complex64>>> {
        let mut theta: Vec<f64> = self.theta.iter().zip(sizes.iter()).map(|(t, s)| t + s).collect();
        let mut slipped = Slipped::default();
        for (slip, start) in self.slips.iter().zip(&self.starts) {
            let here = |g: &FrfGroup| g.posture.is_none_or(|p| p == block.posture);
            for (place, group) in slip.places.iter().enumerate().filter(|(_, g)| here(g)) {
                let size = slip.std * sizes[start + place];
                match slip.error {
                    SmallError::Stiffness(i) => theta[i] += size,
                    SmallError::Warming => stiffnesses(self.model)
                        .for_each(|i| theta[i] += size * block.conditions.order_fraction),
                    error => slipped.add(error, group, size),
                }
            }
        }
        for (t, [low, high]) in theta.iter_mut().zip(bounds) {
            *t = t.clamp(*low, *high);
        }
        let data = FrfData {
            blocks: vec![std::sync::Arc::clone(block)],
            posture_ids: self.data.posture_ids.clone(),
        };
        let made = Made {
            mistake: &slipped,
            group: FrfGroup::ALL,
            values: &[],
        };
        let predicted = predict(self.model, &theta, &data, Some(made))?;
        let over_noise = |(frf, curve): (&crate::identify::frfs::frf_data::FrfDatum, Vec<Complex64>)| {
            let lines = curve.into_iter().zip(&frf.receptance).zip(&frf.noise_std);
            lines.map(|((m, h), std)| (m - h) / std).collect()
        };
        Ok(block.frfs.iter().zip(predicted).map(over_noise).collect())
    }
}

/// Slopes of the `k`-th curve by the unknowns that concern it.
fn columns<'a>(
    k: usize,
    curves: &'a [RestCurve],
    slips: &'a [Slip],
    active: &[(usize, usize)],
) -> Vec<(usize, &'a [Complex64])> {
    let of_model = curves[k].slopes.iter().map(Vec::as_slice).enumerate();
    let of_slips = active.iter().map(|(s, i)| (*i, slips[*s].change[k].as_slice()));
    of_model.chain(of_slips).collect()
}

/// χ² that the small errors take of what `model` leaves, less what they pay for it.
///
/// # Errors
/// A model without a response.
pub fn gain(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<f64> {
    let curves = model.rest(theta, data)?;
    Ok(2.0 * absorb(model, data, theta, &curves)?.evidence)
}

fn real_product(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

fn slips(model: &StructureModel, data: &FrfData, theta: &[f64], curves: &[RestCurve]) -> Result<Vec<Slip>> {
    let base = predict(model, theta, data, None)?;
    let postures: Vec<FrfGroup> = data
        .measured_postures()
        .into_iter()
        .map(|p| FrfGroup {
            posture: Some(p),
            ..FrfGroup::ALL
        })
        .collect();
    let hits: Vec<FrfGroup> = postures
        .iter()
        .flat_map(|g| {
            Axis::ALL.map(|axis| FrfGroup {
                reference_axis: Some(axis),
                ..*g
            })
        })
        .collect();
    let points = data.response_points();
    // Half of the variance is the same at all postures, half new at each.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let always_and_anew = || std::iter::once(&FrfGroup::ALL).chain(&postures);
    let encoders: Vec<FrfGroup> = always_and_anew().copied().collect();
    let sensors: Vec<FrfGroup> = always_and_anew()
        .flat_map(|g| {
            points.iter().map(|p| FrfGroup {
                response_point: Some(*p),
                ..*g
            })
        })
        .collect();
    let mistakes: Vec<Sort> = (1..=model.robot.joint_count())
        .map(|joint| {
            let mistake: Box<dyn Mistake> = Box::new(encoder_offset::EncoderOffset { joint });
            let part: Part = Box::new(move |_| SmallError::Encoder(joint));
            (mistake, part, half * ENCODER_DEG, encoders.as_slice())
        })
        .chain([
            (
                Box::new(channel_gain::ChannelGain) as Box<dyn Mistake>,
                Box::new(|_| SmallError::Gain) as Part,
                GAIN,
                hits.as_slice(),
            ),
            (
                Box::new(hit_direction::HitDirection),
                Box::new(SmallError::Hit),
                HIT_DEG,
                hits.as_slice(),
            ),
            (
                Box::new(turned_sensor::TurnedSensor),
                Box::new(SmallError::Sensor),
                half * SENSOR_DEG,
                sensors.as_slice(),
            ),
            (
                Box::new(sensor_high_pass::SensorHighPass { order: 1 }),
                Box::new(|_| SmallError::Corner),
                std::f64::consts::TAU * CORNER_HZ,
                &[FrfGroup::ALL],
            ),
        ])
        .collect();
    let mut slips = Vec::new();
    for (mistake, part_of, std, places) in &mistakes {
        let parts = mistake.sizes().len();
        for part in 0..parts {
            let mut values = vec![0.0; parts];
            values[part] = STEP * std;
            let made = Made {
                mistake: mistake.as_ref(),
                group: FrfGroup::ALL,
                values: &values,
            };
            let with = predict(model, theta, data, Some(made))?;
            let changed = data.frfs().zip(with.iter().zip(&base));
            slips.push(Slip {
                error: part_of(part),
                std: *std,
                change: changed
                    .map(|((_, frf), (with, without))| {
                        let lines = with.iter().zip(without).zip(&frf.noise_std);
                        lines.map(|((w, b), std)| (w - b) / (STEP * std)).collect()
                    })
                    .collect(),
                places: places.to_vec(),
            });
        }
    }
    // What a joint's stiffness does at a posture is what it does at all of them.
    slips.extend(stiffnesses(model).map(|i| {
        Slip {
            error: SmallError::Stiffness(i),
            std: STIFFNESS,
            change: curves
                .iter()
                .map(|c| c.slopes[i].iter().map(|s| s * STIFFNESS).collect())
                .collect(),
            places: postures.clone(),
        }
    }));
    // In the order of two postures nothing can be seen.
    if postures.len() > 2 {
        let all: Vec<usize> = stiffnesses(model).collect();
        let std = WARMING * (postures.len() - 1) as f64;
        let change = |((block, _), curve): ((&FrfBlock, _), &RestCurve)| -> Vec<Complex64> {
            let size = std * block.conditions.order_fraction;
            let together = |l: usize| all.iter().map(|i| curve.slopes[*i][l]).sum::<Complex64>();
            (0..curve.rest.len()).map(|l| together(l) * size).collect()
        };
        slips.push(Slip {
            error: SmallError::Warming,
            std,
            change: data.frfs().zip(curves).map(change).collect(),
            places: vec![FrfGroup::ALL],
        });
    }
    Ok(slips)
}

/// The stiffnesses among the model's parameters.
fn stiffnesses(model: &StructureModel) -> impl Iterator<Item = usize> {
    let parameters = model.parameters.iter().enumerate();
    parameters
        .filter(|(_, p)| p.scale == Scale::Logarithmic && p.name.contains("stiffness"))
        .map(|(i, _)| i)
}

/// Which error the numbers of a mistake are.
type Part = Box<dyn Fn(usize) -> SmallError>;
/// A mistake, which errors its numbers are, their standard deviation, and where each may be on its own.
type Sort<'a> = (Box<dyn Mistake>, Part, f64, &'a [FrfGroup]);
