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
    let faint = faintest(model)?;
    let own = own_parameters(model, faint.len());
    let start = [base, faint.as_slice()].concat();
    let mut here = problem.linearise(&start).ok()?;
    for (i, parameter) in own.iter().enumerate().map(|(i, p)| (base.len() + i, p)) {
        if let Some(prior) = parameter.prior {
            let [_, slope, curvature] = prior.half_square(start[i]);
            here.gradient[i] -= slope;
            here.hessian[(i, i)] -= curvature;
        }
    }
    let step = here.newton_step()?;
    let mut size = start.clone();
    let mut asked_for = false;
    for (i, parameter) in model.parameters.iter().enumerate() {
        let [low, high] = parameter.internal_bounds();
        let away = match i.checked_sub(base.len()) {
            Some(i) if own[i].scale == Scale::Logarithmic => {
                // Towards the usual size the effect grows, in proportion to exp(±θ).
                let towards = (own[i].internal(own[i].nominal) - faint[i]).signum();
                towards * (towards * step[base.len() + i]).max(0.0).ln_1p()
            }
            _ => step[i],
        };
        size[i] = (start[i] + away).clamp(low, high);
        asked_for |= i >= base.len() && size[i] != start[i];
    }
    // The parameters in front stand at their best: what the step gains, the effect gains.
    let gain = -here.gradient.dot(&step);
    (asked_for && size.iter().all(|t| t.is_finite())).then_some(LinearSize { theta: size, gain })
}
