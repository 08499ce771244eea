//! A model as a function of its parameters: those of the baseline, then those of each effect that was added.

use std::fmt;
use std::ops::{Deref, Range};

use crate::effects::{Domain, Instance, Known};
use crate::parameter::{Parameter, Scale, is_vanished};
use crate::robot::Dual;

/// A domain whose models can be fitted.
pub trait Modelled: Domain {
    /// What of a model is not tuned: the robot with its points, the process of the cuts.
    type Fixed: Clone + fmt::Debug + Send + Sync;
    /// The measurements that models are fitted to.
    type Data: Clone + fmt::Debug + Send + Sync;
}

/// What is not tuned (reached as if it were part of the model: `model.robot`), and the list of what is.
#[derive(Debug, Clone)]
pub struct Model<D: Modelled> {
    fixed: D::Fixed,
    /// Those of the baseline, then those of each added effect.
    pub parameters: Vec<Parameter>,
    /// In the order in which they were added.
    effects: Vec<AddedEffect<D>>,
    /// A solution found earlier, solver's scale: where fits start.
    start: Option<Vec<f64>>,
}

/// An effect in the model and where its parameters stand in the list.
#[derive(Debug, Clone)]
pub struct AddedEffect<D: Domain> {
    /// The effect with its place and discrete choice.
    pub instance: Instance<D>,
    /// Where its own parameters stand in the model's list.
    pub parameters: Range<usize>,
}

impl<D: Modelled> Deref for Model<D> {
    type Target = D::Fixed;

    fn deref(&self) -> &D::Fixed {
        &self.fixed
    }
}

impl<D: Modelled> Model<D> {
    /// A model without effects.
    pub fn of(fixed: D::Fixed, parameters: Vec<Parameter>) -> Self {
        Model {
            fixed,
            parameters,
            effects: Vec::new(),
            start: None,
        }
    }

    /// The same model with what is not tuned changed.
    pub fn with_fixed(&self, change: impl FnOnce(&mut D::Fixed)) -> Self {
        let mut model = self.clone();
        change(&mut model.fixed);
        model
    }

    /// The same model with one more effect; its parameters come last.
    pub fn with_effect(&self, instance: Instance<D>, known: &Known<'_, D>) -> Self {
        let mut model = self.clone();
        let first = model.parameters.len();
        for mut parameter in instance.effect.parameters(instance.at(), known) {
            parameter.name = format!("{}.{}", instance.label(), parameter.name);
            if let Some(start) = &mut model.start {
                start.push(parameter.internal(parameter.nominal));
            }
            model.parameters.push(parameter);
        }
        model.effects.push(AddedEffect {
            instance,
            parameters: first..model.parameters.len(),
        });
        model
    }

    /// The baseline: the same model without the effects added to it.
    pub fn without_effects(&self) -> Self {
        let mut parameters = self.parameters.clone();
        parameters.truncate(self.baseline_parameter_count());
        Model::of(self.fixed.clone(), parameters)
    }

    /// The same model with a solution found earlier (solver's scale) to start from.
    pub fn with_start(&self, theta: Vec<f64>) -> Self {
        let mut model = self.without_start();
        if theta.len() != model.parameters.len() {
            return model;
        }
        let bounds = model.bounds();
        let mut start: Vec<f64> = theta
            .iter()
            .zip(&bounds)
            .map(|(t, b)| t.clamp(b[0], b[1]))
            .collect();
        for added in model.effects.iter().filter(|added| model.vanished(&theta, added)) {
            start[added.parameters.clone()].copy_from_slice(&theta[added.parameters.clone()]);
        }
        model.start = Some(start);
        model
    }

    /// The same model, whose fits start from the nominal values.
    pub fn without_start(&self) -> Self {
        Model {
            start: None,
            ..self.clone()
        }
    }

    /// A solution found earlier, solver's scale; effects added since stand at their nominal values.
    pub fn start(&self) -> Option<&[f64]> {
        self.start.as_deref()
    }

    /// The effects that were added, in their order.
    pub fn effects(&self) -> &[AddedEffect<D>] {
        &self.effects
    }

    /// `effect@site` of each of them.
    pub fn effect_labels(&self) -> Vec<String> {
        self.effects.iter().map(|added| added.instance.label()).collect()
    }

    /// The effects in the order in which they change the physics.
    pub fn effects_in_order(&self) -> Vec<&AddedEffect<D>> {
        let mut order: Vec<&AddedEffect<D>> = self.effects.iter().collect();
        order.sort_by_key(|added| added.instance.effect.order());
        order
    }

    /// Whether `effect@site` is in the model, with whatever discrete choice.
    pub fn has(&self, label: &str) -> bool {
        self.effects.iter().any(|added| added.instance.label() == label)
    }

    /// Number of parameters of the baseline; those of the effects come after them.
    pub fn baseline_parameter_count(&self) -> usize {
        self.effects
            .first()
            .map_or(self.parameters.len(), |added| added.parameters.start)
    }

    /// A point on the solver's scale: what is known of a parameter (natural units), else its nominal value.
    pub fn theta_of(&self, known: impl Fn(&Parameter) -> Option<f64>) -> Vec<f64> {
        let parameters = self.parameters.iter();
        parameters
            .map(|p| p.internal(known(p).unwrap_or(p.nominal)))
            .collect()
    }

    /// Nominal values on the solver's scale.
    pub fn nominal_theta(&self) -> Vec<f64> {
        self.theta_of(|_| None)
    }

    /// Values of the effect's own parameters at which it is not there, solver's scale.
    pub fn vanishing(&self, added: &AddedEffect<D>) -> Option<Vec<f64>> {
        let own = &self.parameters[added.parameters.clone()];
        let values = added.instance.effect.vanishing(added.instance.at(), own)?;
        Some(own.iter().zip(values).map(|(p, v)| p.internal(v)).collect())
    }

    /// Values of the parameters of the effect added last, solver's scale, at which it is not there; `None` without effects.
    pub fn vanishing_limit(&self) -> Option<Vec<f64>> {
        self.vanishing(self.effects().last()?)
    }

    fn vanished(&self, theta: &[f64], added: &AddedEffect<D>) -> bool {
        let own = added.parameters.clone();
        self.vanishing(added)
            .is_some_and(|limit| is_vanished(&self.parameters[own.clone()], &limit, &theta[own]))
    }

    /// Where a fit may go, solver's scale. An effect that had vanished where the model starts is held there: its
    /// parameters mean nothing, and every step back into their range would make the fit worse.
    pub fn bounds(&self) -> Vec<[f64; 2]> {
        let mut bounds: Vec<[f64; 2]> = self.parameters.iter().map(Parameter::internal_bounds).collect();
        if let Some(start) = &self.start {
            for added in self.effects.iter().filter(|added| self.vanished(start, added)) {
                for i in added.parameters.clone() {
                    bounds[i] = [start[i]; 2];
                }
            }
        }
        bounds
    }

    /// Parameter `i` in natural units as a variable of the solver's scale.
    pub fn value(&self, theta: &[f64], i: usize, with_derivatives: bool) -> Dual {
        let natural = self.parameters[i].natural(theta[i]);
        if !with_derivatives {
            return Dual::constant(natural);
        }
        let variable = Dual::variable(theta[i], i, theta.len());
        match self.parameters[i].scale {
            Scale::Logarithmic => variable.chain(natural, natural),
            Scale::Linear => variable,
        }
    }

    /// The effect's own parameters, likewise.
    pub fn values(&self, theta: &[f64], added: &AddedEffect<D>, with_derivatives: bool) -> Vec<Dual> {
        let own = added.parameters.clone();
        own.map(|i| self.value(theta, i, with_derivatives)).collect()
    }
}
