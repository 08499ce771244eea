//! How much of what a model leaves the small errors of a careful setup can take: those that every laboratory has, none of
//! them worth a name.
//!
//! Encoders, hammer gain, direction of the hits, sensors and stiffness are each a little wrong, anew at every posture. Their
//! sizes are known beforehand (normal laws about zero), so that they are estimated together with the model's parameters in
//! one linear step, and each has to pay for its size. Physics that is the same at all postures is not followed by errors that
//! differ from one to the next; the tests of structure are then made on what is left.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::group::Group;
use super::mistake::Mistake;
use super::mistakes::{channel_gain, encoder_offset, hit_direction, sensor_high_pass, turned_sensor};
use super::scene::{Made, predict};
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::frf_data::{FrfData, FrfDatum};
use crate::identify::rest::{AfterSlips, RestCurve};
use crate::ingest::Axis;
use crate::parameter::Scale;

/// Standard deviations of what a careful setup is wrong by: angles of the joints and of the sensors, direction of the hits
/// (deg), gain of the hammer (relative), stiffness from posture to posture (relative), corner of the sensors (Hz).
const ENCODER_DEG: f64 = 0.1;
const SENSOR_DEG: f64 = 0.7;
const HIT_DEG: f64 = 1.5;
const GAIN: f64 = 0.01;
const STIFFNESS: f64 = 0.003;
const CORNER_HZ: f64 = 0.03;

/// Differences are taken over this many standard deviations.
const STEP: f64 = 1e-2;

/// One kind of error: what it does where it is, and each place that it may be at on its own.
struct Slip {
    /// Change of each curve by one standard deviation, over σ.
    change: Vec<Vec<Complex64>>,
    places: Vec<Group>,
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
    let own = model.parameters.len();
    // Unknowns: the model's parameters, then each slip at each place, in units of its standard deviation.
    let mut first = own;
    let starts: Vec<usize> = slips
        .iter()
        .map(|slip| {
            let start = first;
            first += slip.places.len();
            start
        })
        .collect();
    let count = first;
    let active = |frf: &FrfDatum| -> Vec<(usize, usize)> {
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
    let frfs: Vec<&FrfDatum> = data.frfs().map(|(_, frf)| frf).collect();
    let columns = |k: usize| -> Vec<(usize, &[Complex64])> {
        let of_model = curves[k].slopes.iter().map(Vec::as_slice).enumerate();
        let of_slips = active(frfs[k])
            .into_iter()
            .map(|(s, i)| (i, slips[s].change[k].as_slice()));
        of_model.chain(of_slips).collect()
    };
    // Noise has E|r|² = 1 per complex value: each part counts double.
    let (mut information, mut gradient) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
    for (k, curve) in curves.iter().enumerate() {
        let columns = columns(k);
        for (a, (i, x)) in columns.iter().enumerate() {
            gradient[*i] += 2.0 * real_product(x, &curve.rest);
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
            let [_, slope, curvature] = prior.half_square(theta[i]);
            information[(i, i)] += curvature;
            gradient[i] += slope;
        }
        // A parameter that this data does not see at all stays where it is.
        information[(i, i)] += 1e-9 * (1.0 + information[(i, i)]);
    }
    let (usual, occam) = usual_energy(&information, own)?;
    for i in own..count {
        information[(i, i)] += 1.0;
    }
    let factor = information.cholesky().ok_or_else(|| {
        crate::Error::computation("the data do not determine the small errors of the setup")
    })?;
    let sizes = -factor.solve(&gradient);
    let rest = curves
        .iter()
        .enumerate()
        .map(|(k, curve)| {
            let mut rest = curve.rest.clone();
            for (i, column) in columns(k) {
                rest.iter_mut().zip(column).for_each(|(r, c)| *r += c * sizes[i]);
            }
            rest
        })
        .collect();
    Ok(AfterSlips {
        rest,
        price: sizes.rows(own, count - own).norm_squared(),
        usual,
        occam,
    })
}

/// Energy that slips of one standard deviation each leave after the model's parameters, the first `own` ones, have followed;
/// and ln det of their information then: what so many unknowns pay for being fitted (Occam's factor, MacKay 1992).
fn usual_energy(information: &DMatrix<f64>, own: usize) -> Result<(f64, f64)> {
    let slips = information.nrows() - own;
    let undetermined = || crate::Error::computation("the data do not determine the parameters");
    let model = information.view((0, 0), (own, own)).into_owned();
    let cross = information.view((0, own), (own, slips)).into_owned();
    let factor = model.cholesky().ok_or_else(undetermined)?;
    let alone = information.view((own, own), (slips, slips)) - cross.tr_mul(&factor.solve(&cross));
    let energy = alone.trace().max(0.0);
    let factor = (alone + DMatrix::identity(slips, slips))
        .cholesky()
        .ok_or_else(undetermined)?;
    let occam = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    Ok((energy, occam))
}

/// χ² that the small errors take of what `model` leaves, less what they pay for it.
///
/// # Errors
/// A model without a response.
pub fn gain(model: &StructureModel, data: &FrfData, theta: &[f64]) -> Result<f64> {
    let curves = model.rest(theta, data)?;
    let after = absorb(model, data, theta, &curves)?;
    let sum = |rest: &[Complex64]| 2.0 * rest.iter().map(Complex64::norm_sqr).sum::<f64>();
    let pairs = curves.iter().zip(&after.rest);
    let taken: f64 = pairs.map(|(before, after)| sum(&before.rest) - sum(after)).sum();
    Ok(taken - after.price - after.occam)
}

fn real_product(a: &[Complex64], b: &[Complex64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.re * b.re + a.im * b.im).sum()
}

fn slips(model: &StructureModel, data: &FrfData, theta: &[f64], curves: &[RestCurve]) -> Result<Vec<Slip>> {
    let base = predict(model, theta, data, None)?;
    let postures: Vec<Group> = data
        .measured_postures()
        .into_iter()
        .map(|p| Group {
            posture: Some(p),
            ..Group::ALL
        })
        .collect();
    let hits: Vec<Group> = postures
        .iter()
        .flat_map(|g| {
            Axis::ALL.map(|axis| Group {
                reference_axis: Some(axis),
                ..*g
            })
        })
        .collect();
    let mut points: Vec<usize> = data.frfs().map(|(_, f)| f.response.point).collect();
    points.sort_unstable();
    points.dedup();
    // Half of the variance is the same at all postures, half new at each.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let always_and_anew = || std::iter::once(&Group::ALL).chain(&postures);
    let encoders: Vec<Group> = always_and_anew().copied().collect();
    let sensors: Vec<Group> = always_and_anew()
        .flat_map(|g| {
            points.iter().map(|p| Group {
                response_point: Some(*p),
                ..*g
            })
        })
        .collect();
    let mistakes: Vec<(Box<dyn Mistake>, f64, &[Group])> = (1..=model.robot.joint_count())
        .map(|joint| {
            let mistake: Box<dyn Mistake> = Box::new(encoder_offset::EncoderOffset { joint });
            (mistake, half * ENCODER_DEG, encoders.as_slice())
        })
        .chain([
            (
                Box::new(channel_gain::ChannelGain) as Box<dyn Mistake>,
                GAIN,
                hits.as_slice(),
            ),
            (Box::new(hit_direction::HitDirection), HIT_DEG, hits.as_slice()),
            (
                Box::new(turned_sensor::TurnedSensor),
                half * SENSOR_DEG,
                sensors.as_slice(),
            ),
            (
                Box::new(sensor_high_pass::SensorHighPass { order: 1 }),
                std::f64::consts::TAU * CORNER_HZ,
                &[Group::ALL],
            ),
        ])
        .collect();
    let mut slips = Vec::new();
    for (mistake, std, places) in &mistakes {
        let parts = mistake.sizes().len();
        for part in 0..parts {
            let mut values = vec![0.0; parts];
            values[part] = STEP * std;
            let made = Made {
                mistake: mistake.as_ref(),
                group: Group::ALL,
                values: &values,
            };
            let with = predict(model, theta, data, Some(made))?;
            let changed = data.frfs().zip(with.iter().zip(&base));
            slips.push(Slip {
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
    let stiffness = model.parameters.iter().enumerate();
    slips.extend(
        stiffness
            .filter(|(_, p)| p.scale == Scale::Logarithmic && p.name.contains("stiffness"))
            .map(|(i, _)| Slip {
                change: curves
                    .iter()
                    .map(|c| c.slopes[i].iter().map(|s| s * STIFFNESS).collect())
                    .collect(),
                places: postures.clone(),
            }),
    );
    Ok(slips)
}
