//! What effect is asked for: `EFFECT[@SITE][:parameter=value,…]`.

use serde_json::{Map, Value, json};

use super::draw::Draws;
use super::foreign;
use crate::data::RobotSpec;
use crate::effects::{
    DataSummary, Domain, Instance, Known, Registry, STRUCTURAL, Size, Structure, WrittenEffect,
};
use crate::parameter::Parameter;
use crate::simulate::sizes::magnitude;
use crate::text::closest;
use crate::{InputError, Result};

/// An effect to be hidden in a campaign, as a person writes it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EffectRequest {
    /// Id in the library, or of a foreign effect.
    pub effect: String,
    /// `joint-2`, `link-4`; `None`: drawn where there is a choice.
    pub site: Option<String>,
    /// Given values by parameter name, and discrete choices (`direction=x`); what is not given is drawn.
    pub values: Vec<(String, String)>,
}

impl std::str::FromStr for EffectRequest {
    type Err = InputError;

    fn from_str(text: &str) -> std::result::Result<Self, InputError> {
        let written = WrittenEffect::of(text);
        let mut values = Vec::new();
        for item in written.values.into_iter().flat_map(|l| l.split(',')) {
            let Some((key, value)) = item.split_once('=') else {
                return Err(InputError::new(format!("{item:?} is not parameter=value"))
                    .key(text)
                    .remedy("write it as payload:mass_kg=20 or tool-flexibility:mass_kg=4,frequency_hz=47"));
            };
            values.push((key.trim().to_string(), value.trim().to_string()));
        }
        Ok(EffectRequest {
            effect: written.id.trim().to_string(),
            site: written.site.map(|s| s.trim().to_string()),
            values,
        })
    }
}

/// Parameters by name for the truth's document, lists (`name[i]`) as arrays, and the discrete choice.
pub fn described_parameters<D: Domain>(
    instance: &Instance<D>,
    parameters: &[Parameter],
    values: &[f64],
) -> Map<String, Value> {
    let mut described = Map::new();
    for (parameter, value) in parameters.iter().zip(values) {
        match parameter.name.split_once('[') {
            Some((list, _)) => {
                let entry = described.entry(list.to_string()).or_insert_with(|| json!([]));
                if let Some(values) = entry.as_array_mut() {
                    values.push(json!(value));
                }
            }
            None => {
                described.insert(parameter.name.clone(), json!(value));
            }
        }
    }
    if let Some((key, choice)) = instance.variant_label() {
        described.insert(key.into(), json!(choice));
    }
    described
}

/// An effect with its values settled.
#[derive(Debug, Clone, PartialEq)]
pub struct HiddenEffect {
    pub instance: Instance<Structure>,
    /// Not in the library: the right verdict on it is `unknown`.
    pub foreign: bool,
    pub parameters: Vec<Parameter>,
    /// Natural units, at size 1.
    values: Vec<f64>,
    /// Given by the person: does not follow the size.
    given: Vec<bool>,
    /// How large against what was drawn.
    pub size: f64,
}

impl HiddenEffect {
    /// Values at the present size, natural units.
    pub fn values(&self) -> Vec<f64> {
        let effect = self.instance.effect;
        let each = self.parameters.iter().zip(&self.values).zip(&self.given);
        each.map(|((parameter, value), given)| match given {
            true => *value,
            false => magnitude::at_size(effect, parameter, *value, self.size),
        })
        .collect()
    }

    /// Whether the values at the present size are possible on `robot`.
    fn is_possible(&self, robot: &RobotSpec) -> bool {
        let exactly = |value| Size { value, std: 0.0 };
        let sizes: Vec<Size> = self.values().into_iter().map(exactly).collect();
        let Instance { effect, site, .. } = self.instance;
        effect.impossible(site, robot, &sizes).is_none()
    }

    /// The smallest and the largest size within `range` that are possible on `robot`, where the one drawn is; else `range`.
    pub fn possible_sizes(&self, robot: &RobotSpec, range: [f64; 2]) -> [f64; 2] {
        const STEP: f64 = 1.05;
        let possible = |size| HiddenEffect { size, ..self.clone() }.is_possible(robot);
        if !possible(1.0) {
            return range;
        }
        let reach = |factor: f64, within: &dyn Fn(f64) -> bool| {
            let sizes = std::iter::successors(Some(1.0), |size| Some(size * factor));
            let possible = sizes.take_while(|size| within(*size) && possible(*size));
            possible.last().unwrap_or(1.0)
        };
        let [low, high] = range;
        [reach(STEP.recip(), &|s| s >= low), reach(STEP, &|s| s <= high)]
    }

    /// Whether any value follows the size.
    pub fn has_size(&self) -> bool {
        let effect = self.instance.effect;
        let each = self.parameters.iter().zip(&self.given);
        each.into_iter()
            .any(|(parameter, given)| !given && magnitude::follows_size(effect, parameter))
    }
}

impl EffectRequest {
    /// Settles site, choice and values: given ones checked, the rest drawn.
    ///
    /// # Errors
    /// An effect, site or parameter that there is not; a value out of bounds; data that cannot show the effect.
    pub fn settle(&self, robot: &RobotSpec, data: &DataSummary, draws: &mut Draws) -> Result<HiddenEffect> {
        let (instance, foreign) = self.instance(robot, draws)?;
        let known = Known::robot(robot, *data);
        if let Some(obstacle) = instance.effect.obstacle(&known) {
            return Err(self
                .error(format!("this campaign cannot show it: {obstacle}"))
                .remedy("for hammer levels give --force-levels 200,50; for postures --postures 6")
                .into());
        }
        let parameters = instance.effect.parameters(instance.at(), &known);
        let mut values: Vec<f64> = parameters
            .iter()
            .map(|p| magnitude::drawn(instance.effect, p, draws))
            .collect();
        let mut given = vec![false; parameters.len()];
        let choice = instance.variant_label().map(|(key, _)| key);
        for (key, text) in self
            .values
            .iter()
            .filter(|(k, _)| Some(k.as_str()) != choice || foreign)
        {
            let Some(i) = parameters.iter().position(|p| p.name == *key) else {
                let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).chain(choice).collect();
                return Err(self
                    .not_found(&format!("no parameter {key:?}"), key, &names)
                    .into());
            };
            let value = text
                .parse::<f64>()
                .ok()
                .filter(|v| magnitude::in_bounds(&parameters[i], *v));
            let Some(value) = value else {
                let [low, high] = parameters[i].bounds;
                return Err(self
                    .error(format!("{key} = {text} is no value it can have"))
                    .remedy(format!(
                        "give a number from {low} to {high} ({})",
                        parameters[i].unit
                    ))
                    .into());
            };
            values[i] = value;
            given[i] = true;
        }
        Ok(HiddenEffect {
            instance,
            foreign,
            parameters,
            values,
            given,
            size: 1.0,
        })
    }

    fn instance(&self, robot: &RobotSpec, draws: &mut Draws) -> Result<(Instance<Structure>, bool)> {
        if let Some(instance) = foreign::find(&self.effect) {
            return match &self.site {
                None => Ok((instance, true)),
                Some(_) => Err(self
                    .error("it has no site")
                    .remedy(format!("write {} alone", self.effect))
                    .into()),
            };
        }
        let all = Registry::structure().instances(robot);
        let of_effect: Vec<Instance<Structure>> =
            all.into_iter().filter(|i| i.effect.id() == self.effect).collect();
        if of_effect.is_empty() {
            let known = STRUCTURAL.into_iter().chain(foreign::FOREIGN);
            let ids: Vec<&str> = known.map(|e| e.id()).collect();
            return Err(self
                .not_found("there is no such effect on this robot", &self.effect, &ids)
                .into());
        }
        let of_site: Vec<Instance<Structure>> = match &self.site {
            None => of_effect,
            Some(site) => {
                let mut sites: Vec<String> = of_effect.iter().filter_map(|i| i.site.label()).collect();
                sites.dedup();
                let found: Vec<Instance<Structure>> = of_effect
                    .into_iter()
                    .filter(|i| i.site.label().as_deref() == Some(site))
                    .collect();
                if found.is_empty() {
                    let sites: Vec<&str> = sites.iter().map(String::as_str).collect();
                    return Err(match sites.is_empty() {
                        true => self
                            .error("it has no site")
                            .remedy(format!("write {} alone", self.effect)),
                        false => self.not_found(&format!("it cannot sit at {site:?}"), site, &sites),
                    }
                    .into());
                }
                found
            }
        };
        // A site is drawn first and a choice at it second, so that giving one does not change the other.
        let site = draws.pick(&of_site).site;
        let at_site: Vec<Instance<Structure>> = of_site.into_iter().filter(|i| i.site == site).collect();
        let drawn = *draws.pick(&at_site);
        let label = |i: &Instance<Structure>| i.variant_label();
        let asked = self
            .values
            .iter()
            .find(|(k, _)| Some(k.as_str()) == label(&drawn).map(|l| l.0));
        let Some((key, value)) = asked else {
            return Ok((drawn, false));
        };
        let of_value = at_site.iter().find(|i| label(i).map(|l| l.1) == Some(value));
        of_value.map(|i| (*i, false)).ok_or_else(|| {
            let known: Vec<&str> = at_site.iter().filter_map(|i| label(i).map(|l| l.1)).collect();
            self.not_found(&format!("{key} cannot be {value:?}"), value, &known)
                .into()
        })
    }

    fn error(&self, problem: impl Into<String>) -> InputError {
        InputError::new(problem).key(format!("--effect {}", self.effect))
    }

    fn not_found(&self, problem: &str, word: &str, known: &[&str]) -> InputError {
        let all = known.join(", ");
        self.error(problem)
            .remedy(match closest(word, known.iter().copied()) {
                Some(near) => format!("did you mean {near}? There are: {all}"),
                None => format!("there are: {all}"),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::irb6640;
    use crate::simulate::draw::Purpose;

    #[test]
    fn sizes_stay_possible() {
        let data = DataSummary {
            force_levels: 1,
            postures: 6,
            lowest_hz: 3.0,
            highest_hz: 90.0,
        };
        let robot = irb6640();
        let request = EffectRequest {
            effect: "link-flexibility".into(),
            ..Default::default()
        };
        let mut draws = Draws::new(3, Purpose::Effects);
        let hidden = request.settle(&robot, &data, &mut draws).unwrap();
        let [low, high] = hidden.possible_sizes(&robot, [1e-5, 4.0]);
        let young_pa = |size| {
            HiddenEffect {
                size,
                ..hidden.clone()
            }
            .values()[0]
        };
        // Steel at the faint end, magnesium at the other, to one step.
        assert!((210e9..=230e9).contains(&young_pa(low)), "{}", young_pa(low));
        assert!((40e9..=44e9).contains(&young_pa(high)), "{}", young_pa(high));
        assert_eq!(hidden.possible_sizes(&robot, [0.99, 1.01]), [1.0, 1.0]);
    }
}
