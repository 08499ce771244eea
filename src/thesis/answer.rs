//! The real case's answer in plain words, from its numbers.

use super::checked::BandCheck;
use super::real_case::{Explanation, RealCase, WIDENED};
use crate::discrepancy::DiagnosisVerdict;
use crate::discrepancy::verdict::is_convincing;
use crate::text::chance;

/// A joint whose stiffness the fit moved by more than this factor is worth a word.
const MOVED: f64 = 1.5;

impl RealCase {
    fn best(&self) -> Option<&Explanation> {
        self.candidates.first()
    }

    /// Verdict, proposal, each band, what speaks against it, what would settle it; one paragraph each.
    pub fn answer(&self) -> Vec<String> {
        let mut answer = vec![self.verdict_text()];
        if let Some(best) = self.best() {
            answer.push(self.proposal_text(best));
            for (band, check) in best.checked.bands.iter().enumerate() {
                answer.push(self.band_text(best, band, check));
            }
        }
        answer.push(self.open_text());
        answer.push(self.rigid_text());
        answer.push(self.widened_text());
        answer.extend(self.drawn.answer());
        answer.extend(self.next_text());
        answer
    }

    fn verdict_text(&self) -> String {
        let left = |e: &Explanation| {
            format!(
                "leaves {:.1} times the variance that the assumed accuracy allows, against {:.1} without it",
                e.reduced_chi2, self.baseline.reduced_chi2
            )
        };
        let (confidence, best) = (self.confidence, self.best());
        match (self.verdict, best) {
            (DiagnosisVerdict::Effect, Some(best)) => format!(
                "Verdict: effect, {} (confidence {confidence:.2}). It {}.",
                best.name,
                left(best)
            ),
            (DiagnosisVerdict::Unknown, Some(best)) => format!(
                "Verdict: unknown (confidence {confidence:.2}). What is left is more than the assumed accuracy allows, and no \
                 single effect of the library takes it away; the best one, {}, {}.",
                best.name,
                left(best)
            ),
            _ => format!(
                "Verdict: none (confidence {confidence:.2}). Joint springs and rigid links explain the tables within \
                 their assumed accuracy."
            ),
        }
    }

    fn proposal_text(&self, best: &Explanation) -> String {
        let strength = if is_convincing(best.p_value, best.delta_bic) {
            "more than chance by the loop's own standard"
        } else {
            "weak, short of the loop's own standard"
        };
        let held_out = if best.held_out_chi2 < self.baseline.held_out_chi2 {
            "falls"
        } else {
            "does not fall"
        };
        let rivals = match self.rivals.as_slice() {
            [] => "No other effect comes near it.".to_string(),
            rivals => format!("The tables do not tell it from {}.", rivals.join(", ")),
        };
        format!(
            "Proposed first is {}; the evidence is {strength}: BIC {:+.1}, {} corrected for the number of effects \
             tried, and on configurations left out of the fit the misfit {held_out} ({:.0} against {:.0}). What it says: {} \
             Its weight among all explanations is {:.2}, that of no effect at all {:.2}. {rivals}",
            best.name,
            best.delta_bic,
            chance(best.p_value),
            best.held_out_chi2,
            self.baseline.held_out_chi2,
            best.explanation,
            best.weight,
            self.baseline.weight,
        )
    }

    fn band_text(&self, best: &Explanation, band: usize, check: &BandCheck) -> String {
        let met = |e: &Explanation| e.checked.bands[band].met;
        let others: Vec<String> = self
            .candidates
            .iter()
            .filter(|c| self.rivals.contains(&c.name))
            .map(|c| format!("{} {}", c.name, met(c)))
            .collect();
        let others = if others.is_empty() {
            String::new()
        } else {
            format!("; rivals: {}", others.join(", "))
        };
        let told = |e: &Explanation| {
            let band = &e.checked.bands[band];
            if band.explained {
                return format!("explained by {}", e.name);
            }
            let why = match &e.checked.farthest_joint {
                Some(joint) if !joint.is_credible() => format!(
                    "{} would have to be {:.2} times as stiff as published, {:.1} standard deviations of its tolerance",
                    joint.name.trim_end_matches(".stiffness"),
                    joint.factor,
                    joint.sigmas
                ),
                _ => format!("{} of {} find one within two", band.close, band.measured),
            };
            format!("not explained by {} ({why})", e.name)
        };
        format!(
            "{}–{} Hz: of {} measured resonances (neighbours merged) {} find a mode within four standard deviations in \
             {}, {} with rigid links alone{others}. That is near, not an explanation: for one, more than half must find a mode within \
             two, by joints that one can believe. By that mark the band is {}, and {}.",
            check.from_hz,
            check.to_hz,
            check.measured,
            check.met,
            best.name,
            met(&self.baseline),
            told(&self.baseline),
            told(best),
        )
    }

    /// Resonances that the best explanation has no mode for.
    fn open_text(&self) -> String {
        let open: Vec<String> = self
            .resonances
            .iter()
            .filter(|r| !r.best_met)
            .map(|r| format!("{} {} {:.1}", r.configuration, r.axis, r.frequency_hz))
            .collect();
        match open.as_slice() {
            [] => "Every measured resonance finds a mode in the best explanation.".into(),
            open => format!(
                "Without a mode even in the best explanation (configuration, axis, Hz): {}.",
                open.join("; ")
            ),
        }
    }

    fn rigid_text(&self) -> String {
        let moved: Vec<String> = self
            .baseline_parameters
            .iter()
            .filter(|p| p.name.starts_with("joint-") && (p.value / p.initial).ln().abs() > MOVED.ln())
            .map(|p| format!("{} × {:.2}", p.name, p.value / p.initial))
            .collect();
        let moved = match moved.as_slice() {
            [] => "its joints stay near the published stiffness".to_string(),
            moved => format!("the fit moves {}", moved.join(", ")),
        };
        let fixed = |[low, high]: [f64; 2]| format!("{low:.2}–{high:.2}");
        let best = self.best().map_or(String::new(), |best| {
            format!(", with {} {}", best.name, fixed(best.checked.static_ratio))
        });
        format!(
            "The plainest rival needs no new physics: with rigid links tuned to all resonances, not only the strongest, {} \
             of {} resonances find a mode within four standard deviations; for that {moved}, which nobody would believe without further \
             evidence. A check that no fit saw, static stiffness at the flange, \
             model over measurement: rigid links {}{best}.",
            self.baseline.checked.met,
            self.resonances.len(),
            fixed(self.baseline.checked.static_ratio),
        )
    }

    fn widened_text(&self) -> String {
        let w = &self.widened;
        let same = self.best().is_some_and(|b| b.name == w.best) && self.verdict == w.verdict;
        let verdict = match w.verdict {
            DiagnosisVerdict::Effect => "effect",
            DiagnosisVerdict::None => "none",
            DiagnosisVerdict::Unknown => "unknown",
        };
        format!(
            "With frequencies {WIDENED:.0} times less certain the loop says {verdict} (confidence {:.2}) with {} first, BIC \
             {:+.1}, {}, {:.1} times the variance: {}.",
            w.confidence,
            w.best,
            w.delta_bic,
            chance(w.p_value),
            w.reduced_chi2,
            if same {
                "the same answer"
            } else {
                "not the same answer, so it depends on the assumed accuracy"
            }
        )
    }

    fn next_text(&self) -> Vec<String> {
        self.next
            .iter()
            .map(|n| {
                let [first, second] = &n.explanations;
                let sentence = n.difference.sentence();
                format!("What would settle it, {first} against {second}: {sentence} between 30 and 52 Hz.")
            })
            .collect()
    }

    /// What the answer must not be taken for.
    pub fn caveats(&self) -> Vec<String> {
        let numbers = 2 * self.resonances.len();
        vec![
            format!(
                "The FRFs are not public. The loop had {numbers} numbers: frequency and size of {} resonances, of which \
                 many are minima that noise may have made.",
                self.resonances.len()
            ),
            format!(
                "The accuracies are assumed: {:.0} % in frequency (posture angles are published in whole degrees), a \
                 factor {:.1} in the size of a strongest mode and {:.1} in the depth of a minimum. Neighbouring minima \
                 were merged into one resonance.",
                100.0 * self.frequency_std,
                self.peak_std.exp(),
                self.depth_std.exp()
            ),
            "Which mode belongs to which resonance was left open, and a model mode that no list names costs nothing: this \
             favours models with many modes."
                .to_string(),
            format!(
                "Such tables have many nearly equal best fits: {} of {} starting points led the rigid model to the one given \
                 here. The order of the rivals is no firmer than that.",
                self.starts_agreeing, self.starts
            ),
            "Link masses and inertias are the published ones. An error there moves all frequencies and would be taken for \
             an effect."
                .to_string(),
        ]
    }
}
