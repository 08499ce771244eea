//! What the thesis' tables draw where the library has no name: simple laws at every place of the structure, as
//! `lobestone localise` fits them to FRFs.

use rayon::prelude::*;
use serde::Serialize;

use super::checked::{Checked, checked};
use crate::Result;
use crate::discrepancy::verdict::STRONG_BIC;
use crate::effects::drawn::{self, DrawnForm};
use crate::effects::{Instance, Spot, Structure};
use crate::identify::frfs::calibrate::estimates;
use crate::identify::resonances::resonance_study::ResonanceStudy;
use crate::identify::study::{Effort, Extent, Study, View, try_effect};
use crate::identify::{Estimate, LeastSquares, StructureModel};

/// Laws that frequencies and sizes can show; what only damps is lost in them.
const LAWS: [DrawnForm; 5] = [
    DrawnForm::Spring,
    DrawnForm::Mass,
    DrawnForm::Resonator,
    DrawnForm::RotorOnSpring,
    DrawnForm::FloorMode,
];
/// Parts that are told, at most.
const TOLD: usize = 8;

/// Laws drawn by the tables, and how far they may be believed.
#[derive(Debug, Clone, Serialize)]
pub struct DrawnCase {
    /// Places at which laws were fitted.
    pub places: usize,
    /// Laws that were fitted, over all places.
    pub laws: usize,
    /// The best laws, the best first.
    pub parts: Vec<DrawnLaw>,
    /// Laws whose BIC is within "very strong" of the best one's, the best among them, and none of whose sizes is at the end of its
    /// range.
    pub as_good: usize,
    /// Their places, best first.
    pub places_as_good: Vec<String>,
}

/// A law at a place.
#[derive(Debug, Clone, Serialize)]
pub struct DrawnLaw {
    /// As `lobestone add` takes it: `series@bearing-2.rx`.
    pub name: String,
    /// In words: `a spring in the bearing of joint 2 (rx)`.
    pub words: String,
    /// Its own parameters.
    pub parameters: Vec<Estimate>,
    /// BIC less that of the joints alone: below zero the law pays for its parameters.
    pub delta_bic: f64,
    /// χ² over degrees of freedom.
    pub reduced_chi2: f64,
    /// Whether a parameter ended at the end of its range.
    pub at_bound: bool,
    /// How it meets the tables.
    #[serde(flatten)]
    pub checked: Checked,
}

/// Fits every law at every place besides the joints of `model`; `base`: their fit (solver's scale).
pub fn drawn_case(study: &ResonanceStudy, model: &StructureModel, base: &[f64]) -> Result<DrawnCase> {
    let robot = &model.robot.spec;
    let spots: Vec<Spot> = Spot::parallel(robot)
        .into_iter()
        .chain(Spot::series(robot))
        .collect();
    let instances: Vec<(Spot, Instance<Structure>)> = spots
        .iter()
        .flat_map(|spot| {
            let forms = drawn::forms(*spot).into_iter().filter(|form| LAWS.contains(form));
            forms.map(|form| (*spot, drawn::instance(*spot, form)))
        })
        .collect();
    let base_cost = study.problem(model, View::FULL).cost(base)?;
    let bases = [base.to_vec(), model.nominal_theta()];
    let hints = study.hints(model, base)?;
    let fits: Vec<_> = instances
        .par_iter()
        .filter_map(|(spot, instance)| {
            let tried = try_effect(study, model, instance, &bases, &hints, Effort::Direct)?;
            Some((*spot, tried))
        })
        .collect();
    let values = study.real_values(Extent::Full) as f64;
    let reduced = |cost: f64, parameters: usize| 2.0 * cost / (values - parameters as f64).max(1.0);
    // What even the best leaves scales what counts as chance, as in a diagnosis.
    let least = fits
        .iter()
        .map(|(_, t)| reduced(t.fit.cost, t.model.parameters.len()));
    let scale = least.fold(f64::INFINITY, f64::min).max(1.0);
    let mut parts: Vec<(Spot, DrawnLaw)> = fits
        .iter()
        .map(|(spot, tried)| {
            let own = model.parameters.len()..tried.model.parameters.len();
            let price = own.len() as f64 * values.ln();
            let form = drawn::form_of(tried.instance.variant);
            let part = DrawnLaw {
                name: tried.instance.label(),
                words: format!("{} {}", form.words(), spot.words()),
                parameters: estimates(&tried.model.parameters, &tried.fit, scale)?[own.clone()].to_vec(),
                delta_bic: price - 2.0 * (base_cost - tried.fit.cost) / scale,
                reduced_chi2: reduced(tried.fit.cost, tried.model.parameters.len()),
                at_bound: own.clone().any(|i| tried.fit.at_bound.contains(&i)),
                checked: checked(study, &tried.model, &tried.fit.theta)?,
            };
            Ok((*spot, part))
        })
        .collect::<Result<_>>()?;
    parts.sort_by(|a, b| a.1.delta_bic.total_cmp(&b.1.delta_bic));
    let best = parts
        .iter()
        .find(|(_, p)| !p.at_bound)
        .map_or(0.0, |(_, p)| p.delta_bic);
    let as_good: Vec<&(Spot, DrawnLaw)> = parts
        .iter()
        .filter(|(_, p)| !p.at_bound && p.delta_bic < (best + STRONG_BIC).min(0.0))
        .collect();
    let mut places_as_good: Vec<String> = Vec::new();
    for (spot, _) in &as_good {
        let label = spot.label();
        if !places_as_good.contains(&label) {
            places_as_good.push(label);
        }
    }
    Ok(DrawnCase {
        places: spots.len(),
        laws: instances.len(),
        as_good: as_good.len(),
        places_as_good,
        parts: parts.into_iter().map(|(_, part)| part).take(TOLD).collect(),
    })
}

impl DrawnCase {
    /// What the tables draw, band by band, and what can and cannot be said by it; one paragraph each.
    pub fn answer(&self) -> Vec<String> {
        let tried = format!(
            "What do the tables draw themselves? {} simple laws (springs, masses, resonators, rotors behind gears, a floor that moves) at {} \
             places were fitted besides the joints, as `lobestone localise` does with FRFs.",
            self.laws, self.places
        );
        let Some(best) = self
            .parts
            .iter()
            .find(|p| !p.at_bound)
            .filter(|_| self.as_good > 0)
        else {
            return vec![format!(
                "{tried} None pays for its parameters: the tables draw nothing."
            )];
        };
        let mut answer = vec![format!(
            "{tried} First comes {}: BIC {:+.1}, {:.1} times the variance that the assumed accuracy allows; static stiffness at the flange, which no \
             fit saw, {:.2}–{:.2} of the measured.",
            best.words,
            best.delta_bic,
            best.reduced_chi2,
            best.checked.static_ratio[0],
            best.checked.static_ratio[1],
        )];
        for (k, band) in best.checked.bands.iter().enumerate() {
            let by: Vec<&str> = self
                .parts
                .iter()
                .filter(|p| !p.at_bound && p.checked.bands[k].explained)
                .map(|p| p.words.as_str())
                .collect();
            let by = match by.as_slice() {
                [] => "by none of the best".into(),
                by => format!("by {}", by.join("; ")),
            };
            answer.push(format!(
                "At {}–{} Hz {} of {} resonances find a mode within two standard deviations with the first of them; by the mark above \
                 (more than half, and joints that one can believe) the band is explained {by}.",
                band.from_hz, band.to_hz, band.close, band.measured,
            ));
        }
        // The best of many laws gains 2 ln of their number by having been chosen.
        let chosen = 2.0 * (self.laws as f64).ln();
        let more_than_chance = match best.delta_bic + chosen < -STRONG_BIC {
            true => "something gives way, or swings, that the joints of the model do not hold",
            false => {
                "hardly that something is missing, for the best of so many laws gains a part of that by having been chosen, and what is left \
                 is short of the loop's own standard"
            }
        };
        answer.push(match self.places_as_good.as_slice() {
            [place] => format!(
                "What can be said: {more_than_chance}. Of all places tried only {place} explains it so well. What cannot: whether it has \
                 the law drawn there, for frequencies and sizes hold no damping and no phase."
            ),
            places => format!(
                "What can be said: {more_than_chance}. What cannot: where it is, and by which law. {} laws at {} places do as well \
                 ({}); FRFs at points along the arm would tell them apart, two tables at the tool point cannot.",
                self.as_good,
                places.len(),
                match places.len() > TOLD {
                    true => format!("{}, …", places[..TOLD].join(", ")),
                    false => places.join(", "),
                },
            ),
        });
        answer
    }
}
