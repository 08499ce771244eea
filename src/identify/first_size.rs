//! Where the fit of a faint effect begins. Next to the end where an effect vanishes, the logarithm of its size hardly changes
//! anything and its prior pulls harder than the data: a fit that begins there stays there. The size itself enters the response
//! nearly linearly there, so one step of Gauss and Newton in the size, without the prior, tells how large the effect is.

use super::levenberg_marquardt::LeastSquares;
use super::model::{Model, Modelled};
use crate::parameter::{Parameter, Scale};

/// Values of the parameters of the effect added last, solver's scale, at the end of their range next to where it vanishes; `None`
/// where it has no such limit.
pub fn faintest<D: Modelled>(model: &Model<D>) -> Option<Vec<f64>> {
    let limit = model.vanishing_limit()?;
    let own = own_parameters(model, limit.len());
    let clamped = own.iter().zip(&limit).map(|(p, l)| {
        let [low, high] = p.internal_bounds();
        l.clamp(low, high)
    });
    Some(clamped.collect())
}

fn own_parameters<D: Modelled>(model: &Model<D>, count: usize) -> &[Parameter] {
    &model.parameters[model.parameters.len() - count..]
}

/// What the data say of the effect added last, were the response linear in its size.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearSize {
    /// All parameters at that size, solver's scale.
    pub theta: Vec<f64>,
    /// Parameters of the effect where it hardly is there, in the shape from which it grew, solver's scale.
    pub shape: Vec<f64>,
    /// By how much χ² would fall, values.
    pub gain: f64,
}

/// The size that the data give the effect added last to `model`, from `base`, the best fit without it. `None` where they do not ask for
/// it, or it has no end where it vanishes.
pub fn linear_size<D: Modelled, P: LeastSquares>(
    problem: &P,
    model: &Model<D>,
    base: &[f64],
) -> Option<LinearSize> {
    size_from(problem, model, base, (&faintest(model)?, &shapes(model)?))
}

/// As [`linear_size`], of the effect in each of the shapes that `own` has (values of its parameters, solver's scale): frequencies, places
/// and the like mean nothing where it vanishes, and must be right for it to grow. The one by which χ² would fall most.
pub fn linear_size_of_shapes<D: Modelled, P: LeastSquares>(
    problem: &P,
    model: &Model<D>,
    base: &[f64],
    own: &[Vec<f64>],
) -> Option<LinearSize> {
    let faint = faintest(model)?;
    let is_shape = shapes(model)?;
    let mut points: Vec<Vec<f64>> = Vec::new();
    for start in own {
        let pick = |i: usize| if is_shape[i] { start[i] } else { faint[i] };
        let point: Vec<f64> = (0..faint.len()).map(pick).collect();
        if !points.contains(&point) {
            points.push(point);
        }
    }
    points
        .iter()
        .filter_map(|point| size_from(problem, model, base, (point, &is_shape)))
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
}

/// Whether each parameter of the effect added last is its shape, which stays where the effect vanishes; none is where all stay.
fn shapes<D: Modelled>(model: &Model<D>) -> Option<Vec<bool>> {
    let limit = model.vanishing_limit()?;
    let own = own_parameters(model, limit.len());
    let stays: Vec<bool> = own
        .iter()
        .zip(&limit)
        .map(|(p, l)| p.internal(p.nominal) == *l)
        .collect();
    let all = stays.iter().all(|s| *s);
    Some(stays.into_iter().map(|s| s && !all).collect())
}

/// `faint`: values of the parameters of the effect, next to where it vanishes, and which of them are its shape.
fn size_from<D: Modelled, P: LeastSquares>(
    problem: &P,
    model: &Model<D>,
    base: &[f64],
    (faint, is_shape): (&[f64], &[bool]),
) -> Option<LinearSize> {
    let own = own_parameters(model, faint.len());
    let start = [base, faint].concat();
    let mut here = problem.linearise(&start).ok()?;
    for (i, parameter) in own.iter().enumerate().map(|(i, p)| (base.len() + i, p)) {
        if let Some(prior) = parameter.prior {
            let [_, slope, curvature] = prior.half_square(start[i]);
            here.gradient[i] -= slope;
            here.hessian[(i, i)] -= curvature;
        }
    }
    let step = here.newton_step()?;
    // Towards the usual size the effect grows, in proportion to exp(±θ).
    let towards = |i: usize| (own[i].internal(own[i].nominal) - faint[i]).signum();
    let grows = |i: usize| own[i].scale == Scale::Logarithmic && !is_shape[i];
    let growth = |i: usize| 1.0 + (towards(i) * step[base.len() + i]).max(0.0);
    let all_growth: f64 = (0..own.len()).filter(|i| grows(*i)).map(growth).product();
    let mut size = start.clone();
    let mut asked_for = false;
    for (i, parameter) in model.parameters.iter().enumerate() {
        let [low, high] = parameter.internal_bounds();
        let away = match i.checked_sub(base.len()) {
            Some(i) if grows(i) => towards(i) * growth(i).ln(),
            // What a change of shape does is in proportion to the size that it is a change of.
            Some(own) if is_shape[own] => {
                let most = parameter.prior.map_or(1.0, |prior| prior.std);
                (step[i] / all_growth).clamp(-most, most)
            }
            _ => step[i],
        };
        size[i] = (start[i] + away).clamp(low, high);
        asked_for |= i >= base.len() && size[i] != start[i];
    }
    // The parameters in front stand at their best: what the step gains, the effect gains.
    let gain = -here.gradient.dot(&step);
    (asked_for && size.iter().all(|t| t.is_finite())).then(|| LinearSize {
        theta: size,
        shape: faint.to_vec(),
        gain,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::waveform::DrillTerm;
    use crate::effects::Registry;
    use crate::identify::forces::cutting_data::CutKind;
    use crate::identify::forces::cutting_study::calibrate_cutting;
    use crate::identify::forces::made_cuts::{CONTACT_S, changed, drilled};
    use crate::identify::{CuttingData, CuttingModel, CuttingProblem};

    /// Holes whose wall rubs on the margins of the drill with `friction` N for each mm of depth.
    fn holes(friction: f64) -> CuttingData {
        let holes = [[0.2, 0.0], [0.3, 3.0], [0.4, 3.0]];
        changed(&drilled([900.0, 30.0, 700.0, 45.0], &holes), |cut| {
            let CutKind::Drilling { cut: hole, .. } = &cut.kind else {
                unreachable!()
            };
            let channel = cut.channels[3].as_mut().unwrap();
            channel.level_std.fill(0.01);
            for (b, level) in channel.level.iter_mut().enumerate().take(cut.steady.end) {
                let [from, to] = cut.block_s[b];
                *level += friction * hole.mean(DrillTerm::Margin, from, to, CONTACT_S).0;
            }
        })
    }

    /// Friction adds to the torque: one step in its size finds all of it, and χ² falls by what it explains.
    #[test]
    fn the_size_of_an_effect_that_adds_is_found_in_one_step() {
        for friction in [8.0, -5.0] {
            let data = holes(friction);
            let base = CuttingModel::new(&data, true).unwrap();
            let margin = Registry::cutting().find(&(), "margin-friction")[0];
            let model = base.with_effect(margin, &base.known(&data));
            let theta = calibrate_cutting(&base, &data).unwrap().theta;
            let without = CuttingProblem {
                model: &base,
                data: &data,
            };
            let without = without.cost(&theta).unwrap();
            let problem = CuttingProblem {
                model: &model,
                data: &data,
            };
            let size = linear_size(&problem, &model, &theta).unwrap();
            assert!(
                (size.theta[4] / friction - 1.0).abs() < 0.02,
                "{:?} for {friction}",
                size.theta
            );
            // The cost is half of χ², and with the friction nothing is left of it.
            assert!(
                without > 100.0 && (size.gain / (2.0 * without) - 1.0).abs() < 0.02,
                "{} {without}",
                size.gain
            );
        }
    }

    #[test]
    fn next_to_nothing_is_the_end_of_the_range_on_that_side() {
        let data = holes(0.0);
        let base = CuttingModel::new(&data, true).unwrap();
        assert_eq!(faintest(&base), None);
        let model = base.with_effect(
            Registry::cutting().find(&(), "chisel-edge")[0],
            &base.known(&data),
        );
        let faint = faintest(&model).unwrap();
        let [low, _] = model.parameters[4].internal_bounds();
        assert_eq!(faint, [low, model.parameters[5].internal(0.8)]);
    }
}
