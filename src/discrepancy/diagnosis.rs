//! What the loop answers: the verdict, how sure it is, and the candidates that it rests on.

use super::candidate::{BaselineFit, EffectCandidate};
use super::verdict::{DiagnosisVerdict, is_noise, leaves_noise};
use crate::effects::Instance;
use crate::identify::Modelled;

/// The answer.
#[derive(Debug, Clone)]
pub struct Diagnosis<D: Modelled> {
    /// Whether an effect is missing.
    pub verdict: DiagnosisVerdict,
    /// Index among the candidates of the effect that is missing, if one is.
    pub effect: Option<usize>,
    /// The best of the library where the verdict is unknown; index among the candidates.
    pub best_guess: Option<usize>,
    /// Probability that the verdict is right.
    pub confidence: f64,
    /// Why there is no verdict, where the data are too few for one.
    pub too_little_data: Option<String>,
    /// Best first, one for each effect and site.
    pub candidates: Vec<EffectCandidate<D>>,
    /// `effect@site` of rivals that this data cannot tell from the verdict.
    pub indistinguishable: Vec<String>,
    /// The other effects, where several together explain what one alone does not.
    pub companions: Vec<String>,
    /// Effects that are in the model and choose otherwise (a direction, a form) beside the missing one.
    pub chosen_anew: Vec<Instance<D>>,
    /// The model as it stands.
    pub baseline: BaselineFit,
    /// Effects that this data cannot show, with the reason.
    pub not_tried: Vec<(String, String)>,
    /// Pairs of effects that were looked at, of how many there are with the leaders; `None` where one effect is enough or
    /// pairs are hopeless.
    pub pairs: Option<[usize; 2]>,
}

impl<D: Modelled> Diagnosis<D> {
    /// The candidate that is missing; `None` where the verdict names none.
    pub fn winner(&self) -> Option<&EffectCandidate<D>> {
        self.effect.map(|w| &self.candidates[w])
    }

    /// The model as it stands leaves noise, and the verdict is unknown for what was found among the files: why, in words.
    pub fn apart_from_files(&self) -> Option<&'static str> {
        // Where there are few lines its structure need not show.
        let only_files = self.verdict == DiagnosisVerdict::Unknown
            && is_noise(self.baseline.reduced_chi2)
            && leaves_noise(&self.baseline.rest, self.baseline.reduced_chi2);
        only_files.then_some(
            "what was found among the files is no effect of the library; apart from it what is left looks like noise",
        )
    }

    /// `It may be small errors of every setup: …`, where these explain nearly all that the model leaves and the verdict is unknown all the
    /// same.
    pub fn slips_in_words(&self) -> Option<String> {
        let excuse = self.baseline.rest.excuse_in_words()?;
        let is_unknown = self.verdict == DiagnosisVerdict::Unknown;
        is_unknown.then(|| {
            format!(
                "It may be small errors of the setup, of sizes that rarely come together: what is left is {excuse}."
            )
        })
    }

    /// `It explains 93 % of what stands above the noise; what it leaves is …`, where small errors of the setup explain nearly all of that;
    /// and which effects would come before the named one, were such errors not fitted beside them.
    pub fn excuse_in_words(&self) -> Option<String> {
        let winner = self.winner()?;
        let left = winner.rest.as_ref()?.excuse_in_words()?;
        let share = 100.0 * winner.share_above_noise(&self.baseline);
        let excuse =
            format!("It explains {share:.0} % of what stands above the noise; what it leaves is {left}.");
        let before = &self.candidates[..self.effect?];
        let tried = |c: &&EffectCandidate<D>| c.rest.as_ref().is_some_and(|r| r.beyond_slips.is_some());
        let labels: Vec<String> = before.iter().filter(tried).map(EffectCandidate::label).collect();
        let explain = match labels.len() {
            0 => return Some(excuse),
            1 => "explains more by itself",
            _ => "explain more by themselves",
        };
        Some(format!(
            "{excuse} {} {explain}, less beside such errors.",
            crate::text::listed(&labels)
        ))
    }

    /// `Beside it local-resonator@link-3 (direction z) fits better than as it was`, where effects of the model choose otherwise beside the
    /// missing one.
    pub fn chosen_anew_in_words(&self) -> Option<String> {
        let titles: Vec<String> = self.chosen_anew.iter().map(Instance::title).collect();
        (!titles.is_empty()).then(|| {
            format!(
                "Beside it {} fits better than as it was; `lobestone add` changes that, too.",
                crate::text::listed(&titles)
            )
        })
    }

    /// `A second effect is likely besides: payload`; `None` where one effect explains all.
    pub fn besides_in_words(&self) -> Option<String> {
        match self.companions.as_slice() {
            [] => None,
            [one] => Some(format!("A second effect is likely besides: {one}")),
            more => Some(format!("Further effects are likely besides: {}", more.join(", "))),
        }
    }

    /// `What stands above the noise looks like a resonance at one place …`, where the verdict is unknown and the library makes nothing of it.
    pub fn unexplained_in_words(&self) -> Option<String> {
        let guess = self.candidates.get(self.best_guess?)?;
        let all = self.baseline.rest.largest().filter(|_| guess.rest.is_none())?;
        Some(format!(
            "What stands above the noise looks like {}.",
            all.in_words()
        ))
    }

    /// What the best of the library makes of the data where the verdict is unknown.
    pub fn best_guess_in_words(&self) -> Option<String> {
        let guess = self.candidates.get(self.best_guess?)?;
        let [share, std] = guess.explained_share()?;
        let left = guess.rest.as_ref()?.largest()?;
        Some(format!(
            "Best guess: {}, which explains {:.0} % (± {:.0} %) of what stands above the noise; the rest looks like {}.",
            guess.label(),
            100.0 * share,
            100.0 * std,
            left.in_words()
        ))
    }
}
