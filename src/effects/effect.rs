//! What an effect is to the loop (fit, compare, add, fit again), for every kind of model: the structure of a robot, the
//! forces of a cut, and whatever else brings its own [`Domain`].

use std::fmt;

use super::site::{At, EffectName, Site};
use super::{Background, Size};
use crate::effects::usual_size::UsualSize;
use crate::parameter::Parameter;
use crate::robot::Dual;

/// A kind of model that effects are added to: what they sit on, what is known before a fit, and what they change.
pub trait Domain: Copy + PartialEq + fmt::Debug + Send + Sync + Sized + 'static {
    /// What has the places that effects sit at, such as the robot; `()` where there are no places.
    type Object: ?Sized;
    /// What is known of the data when an effect is asked for its parameters or whether this data can show it.
    type Summary: Clone;
    /// The posture or cut that an effect is applied to.
    type Setting<'a>;
    /// The physics of that posture or cut, which effects change.
    type Physics;
    /// What records it, where that is kept apart from the physics; `()` where it is not.
    type Sensors;
}

/// What an effect is told before anything is fitted.
pub struct Known<'a, D: Domain> {
    /// What it may sit on.
    pub object: &'a D::Object,
    /// Of the data.
    pub data: D::Summary,
}

/// One physical effect: its place, its parameters, and what it does to the model. One file an effect.
pub trait Effect<D: Domain>: Sync {
    /// As in docs/effects.md: `joint-transverse-compliance`.
    fn id(&self) -> &'static str;

    /// The physics in plain words, one or two sentences.
    fn explanation(&self) -> &'static str;

    /// How it shows in the measurements, one sentence.
    fn fingerprint(&self) -> &'static str;

    /// How to check it in the lab, usual sizes, sources.
    fn background(&self) -> Background;

    /// Where it may sit.
    fn sites(&self, _object: &D::Object) -> Vec<Site> {
        vec![Site::Everywhere]
    }

    /// Discrete choices at a site (an axis of the link, say), by number.
    fn variants(&self, _site: Site) -> Vec<usize> {
        vec![0]
    }

    /// Name of a discrete choice as (key, value) for the JSON; `None` where there is no choice.
    fn variant_label(&self, _variant: usize) -> Option<(&'static str, &'static str)> {
        None
    }

    /// Why this object or this data cannot show the effect; `None` if they can.
    fn obstacle(&self, _known: &Known<D>) -> Option<String> {
        None
    }

    /// Whether a diagnosis follows it only where a first look on few data promises something: for effects that are rare, or
    /// that have many places.
    fn on_promise(&self) -> bool {
        false
    }

    /// Why a discrete choice is not worth trying on this data while others may be; `None` if it is.
    fn choice_obstacle(&self, _variant: usize, _known: &Known<D>) -> Option<String> {
        None
    }

    /// Tunable quantities; names are the keys in docs/json.md. `nominal` is the first starting value.
    fn parameters(&self, at: At, known: &Known<D>) -> Vec<Parameter>;

    /// Further starting points, natural values in the order of the parameters. `peaks_hz`: where the residual peaks, most
    /// prominent first.
    fn starts(&self, _at: At, _known: &Known<D>, _peaks_hz: &[f64]) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// How large it is where it is hidden in a simulated campaign: a line a parameter (lists once).
    fn usual_sizes(&self) -> &'static [UsualSize] {
        &[]
    }

    /// Why this effect cannot be of the size that was fitted (parameters in their order); `None` if it can.
    fn impossible(&self, _site: Site, _object: &D::Object, _sizes: &[Size]) -> Option<String> {
        None
    }

    /// Values of [`Self::parameters`] (given), natural units, at which the effect is not there: the model is the one without
    /// it, to rounding. They may lie outside the parameters' bounds, which are those of an effect worth a name. `None` only
    /// for what is simulated and never fitted.
    fn vanishing(&self, _at: At, _parameters: &[Parameter]) -> Option<Vec<f64>> {
        None
    }

    /// Free amplitudes for each record and channel that are fitted along without standing in the list of parameters.
    fn nuisances_per_channel(&self, _at: At) -> usize {
        0
    }

    /// Id of the simpler effect that this one is the general case of: this leads only where that leaves clearly more.
    fn refines(&self) -> Option<&'static str> {
        None
    }

    /// Effects with lower order are applied first (a payload weighs on the joints before their load is counted).
    fn order(&self) -> u8 {
        1
    }

    /// Changes the physics of a posture or cut; `values`: natural values of its parameters in their order.
    fn apply(&self, _at: At, _values: &[Dual], _setting: &D::Setting<'_>, _physics: &mut D::Physics) {}

    /// Changes what is recorded of it.
    fn distort(&self, _values: &[Dual], _sensors: &mut D::Sensors) {}
}

/// An effect at a site: what is added to a model.
#[derive(Clone, Copy)]
pub struct Instance<D: Domain> {
    /// The effect.
    pub effect: &'static dyn Effect<D>,
    /// Where it sits.
    pub site: Site,
    /// Its discrete choice, from 0.
    pub variant: usize,
}

impl<D: Domain> Instance<D> {
    /// Its place and choice.
    pub fn at(&self) -> At {
        At {
            site: self.site,
            variant: self.variant,
        }
    }

    /// The same effect at the same place with each other discrete choice.
    pub fn other_choices(&self) -> impl Iterator<Item = Self> + use<D> {
        let known = *self;
        let all = known.effect.variants(known.site).into_iter();
        all.filter(move |variant| *variant != known.variant)
            .map(move |variant| Instance { variant, ..known })
    }

    /// What it is called.
    pub fn name(&self) -> EffectName {
        let variant = self.variant_label();
        EffectName {
            effect: self.effect.id().into(),
            site: self.site.label(),
            variant: variant.map(|(key, value)| (key.into(), value.into())),
        }
    }

    /// Its discrete choice as (key, value); `None` where there is no choice.
    pub fn variant_label(&self) -> Option<(&'static str, &'static str)> {
        self.effect.variant_label(self.variant)
    }

    /// `effect@site`, or the bare id; the discrete choice is not part of it.
    pub fn label(&self) -> String {
        self.name().label()
    }

    /// How a user asks for just this one: the label, and the discrete choice where there is one
    /// (`branch@link-3.z:form=resonator`).
    pub fn request(&self) -> String {
        match self.variant_label() {
            Some((key, value)) => format!("{}:{key}={value}", self.label()),
            None => self.label(),
        }
    }

    /// For people: the label, and the discrete choice where there is one.
    pub fn title(&self) -> String {
        match self.variant_label() {
            Some((key, value)) => format!("{} ({key} {value})", self.label()),
            None => self.label(),
        }
    }
}

impl<D: Domain> fmt::Debug for Instance<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}#{}", self.label(), self.variant)
    }
}

impl<D: Domain> PartialEq for Instance<D> {
    fn eq(&self, other: &Self) -> bool {
        self.effect.id() == other.effect.id() && self.at() == other.at()
    }
}
