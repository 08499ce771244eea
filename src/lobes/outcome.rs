//! Cuts of which somebody noted whether they chattered, against the limit at their speed.

use serde::Serialize;

use crate::campaign::CutOutcome;

/// A cut as a point of the diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct NotedCut {
    /// The cut's id in the campaign.
    pub id: String,
    /// Where the robot stood; `None` where the campaign does not say.
    pub posture: Option<String>,
    /// Spindle speed, rpm.
    pub spindle_rpm: f64,
    /// As the limit counts it: axial depth in milling, (diameter − pilot diameter)/2 in drilling.
    pub depth_mm: f64,
    /// Whether it chattered.
    pub outcome: CutOutcome,
}

/// A cut with a noted outcome that the diagram says nothing about.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotCompared {
    /// The cut's id in the campaign.
    pub id: String,
    /// Why, in words.
    pub reason: String,
}

/// Where the limit may lie at one speed, mm; `None` is no limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitRange {
    /// The limit of the nominal model.
    pub limit_mm: Option<f64>,
    /// From the model's uncertainty (see [`super::band`]), widened to hold the limit itself.
    pub lower_mm: Option<f64>,
    /// Upper end of the range.
    pub upper_mm: Option<f64>,
}

fn depth(limit_mm: Option<f64>) -> f64 {
    limit_mm.unwrap_or(f64::INFINITY)
}

fn limit(depth_mm: f64) -> Option<f64> {
    depth_mm.is_finite().then_some(depth_mm)
}

impl LimitRange {
    /// `band`: lower and upper quantile, where the uncertainty is known.
    pub fn new(limit_mm: Option<f64>, band: Option<[Option<f64>; 2]>) -> Self {
        let [lower, upper] = band.unwrap_or([limit_mm; 2]);
        LimitRange {
            limit_mm,
            lower_mm: limit(depth(lower).min(depth(limit_mm))),
            upper_mm: limit(depth(upper).max(depth(limit_mm))),
        }
    }

    /// Where it may lie when it is one of these and nobody knows which; the limit is the least one.
    fn any_of(ranges: impl Iterator<Item = LimitRange>) -> Option<LimitRange> {
        ranges.reduce(|a, b| LimitRange {
            limit_mm: limit(depth(a.limit_mm).min(depth(b.limit_mm))),
            lower_mm: limit(depth(a.lower_mm).min(depth(b.lower_mm))),
            upper_mm: limit(depth(a.upper_mm).max(depth(b.upper_mm))),
        })
    }
}

/// What the limit says of a cut that was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Outside the range that the model leaves open, on the side that the model says.
    Agree,
    /// Outside that range, on the other side.
    Disagree,
    /// Between the lower and the upper limit: the model cannot say.
    WithinBand,
}

/// One cut compared with the limit at its speed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoredCut {
    /// The cut's id in the campaign.
    pub id: String,
    /// Where the robot stood; `None` where the campaign does not say.
    pub posture: Option<String>,
    /// Spindle speed, rpm.
    pub spindle_rpm: f64,
    /// Depth as the limit counts it, mm (see [`NotedCut::depth_mm`]).
    pub depth_mm: f64,
    /// Whether it chattered.
    pub outcome: CutOutcome,
    /// `None`: no limit at this speed.
    pub limit_mm: Option<f64>,
    /// Lower end of where the limit may lie, mm.
    pub lower_mm: Option<f64>,
    /// Upper end of where the limit may lie, mm; `None`: no limit.
    pub upper_mm: Option<f64>,
    /// Whether the lobes agree with it.
    pub verdict: Verdict,
    /// What follows where the cut does not agree; for people.
    pub meaning: Option<String>,
}

/// All noted outcomes of a campaign against its lobes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcomes {
    /// Outside the range that the model leaves open, and as it says.
    pub agree: usize,
    /// Outside the range, and not as the model says.
    pub disagree: usize,
    /// Inside the range: the model cannot say.
    pub within_band: usize,
    /// Against the limit alone.
    pub stable_below_limit: usize,
    /// Stable cuts deeper than the limit.
    pub stable_above_limit: usize,
    /// Cuts with chatter deeper than the limit.
    pub chatter_above_limit: usize,
    /// Cuts with chatter not deeper than the limit.
    pub chatter_below_limit: usize,
    /// Every cut that was compared.
    pub cuts: Vec<ScoredCut>,
    /// Cuts with an outcome that could not be compared.
    pub not_compared: Vec<NotCompared>,
}

impl Outcomes {
    /// `limits`: for each curve its posture (`None`: of any) and the limit at every noted cut's speed. `None` where
    /// there is no outcome at all.
    pub fn score(
        noted: &[NotedCut],
        limits: &[(Option<&str>, &[LimitRange])],
        mut not_compared: Vec<NotCompared>,
    ) -> Option<Self> {
        let mut cuts = Vec::new();
        for (i, cut) in noted.iter().enumerate() {
            let of_posture = limits
                .iter()
                .filter(|(posture, _)| match (&cut.posture, posture) {
                    (Some(own), Some(posture)) => own == posture,
                    _ => true,
                });
            match LimitRange::any_of(of_posture.filter_map(|(_, at)| at.get(i)).copied()) {
                Some(range) => cuts.push(scored(cut, range)),
                None => not_compared.push(NotCompared {
                    id: cut.id.clone(),
                    reason: "there are no lobes of its posture".into(),
                }),
            }
        }
        if cuts.is_empty() && not_compared.is_empty() {
            return None;
        }
        let verdicts = |verdict| cuts.iter().filter(|c| c.verdict == verdict).count();
        let sides = |outcome, below: bool| {
            cuts.iter()
                .filter(|c| c.outcome == outcome && (c.depth_mm <= depth(c.limit_mm)) == below)
                .count()
        };
        Some(Outcomes {
            agree: verdicts(Verdict::Agree),
            disagree: verdicts(Verdict::Disagree),
            within_band: verdicts(Verdict::WithinBand),
            stable_below_limit: sides(CutOutcome::Stable, true),
            stable_above_limit: sides(CutOutcome::Stable, false),
            chatter_above_limit: sides(CutOutcome::Chatter, false),
            chatter_below_limit: sides(CutOutcome::Chatter, true),
            cuts,
            not_compared,
        })
    }
}

fn scored(cut: &NotedCut, range: LimitRange) -> ScoredCut {
    let below = cut.depth_mm <= depth(range.lower_mm);
    let above = cut.depth_mm > depth(range.upper_mm);
    let verdict = match (cut.outcome, below, above) {
        (_, false, false) => Verdict::WithinBand,
        (CutOutcome::Stable, true, _) | (CutOutcome::Chatter, _, true) => Verdict::Agree,
        _ => Verdict::Disagree,
    };
    let mm = |limit: Option<f64>| limit.map_or("no limit".into(), |l| format!("{l:.4} mm"));
    let meaning = match (verdict, cut.outcome) {
        (Verdict::Agree, _) => None,
        (Verdict::WithinBand, _) => Some(format!(
            "the model cannot say: the limit at this speed lies between {} and {}",
            mm(range.lower_mm),
            mm(range.upper_mm)
        )),
        (Verdict::Disagree, CutOutcome::Chatter) => Some(format!(
            "it chattered where the model promises stability (limit {}, at the least {}): do not trust the lobes here. \
             The structure is more compliant or less damped than the model, the cutting coefficients are larger, or the \
             vibration was not chatter (a worn tool, a forced vibration)",
            mm(range.limit_mm),
            mm(range.lower_mm)
        )),
        (Verdict::Disagree, CutOutcome::Stable) => Some(format!(
            "it was stable where the model expects chatter (limit {}, at the most {}): the lobes are too careful here. \
             Something damps that the model lacks (process damping at low speed), the cutting coefficients are smaller, \
             or the cut was too short for chatter to grow",
            mm(range.limit_mm),
            mm(range.upper_mm)
        )),
    };
    ScoredCut {
        id: cut.id.clone(),
        posture: cut.posture.clone(),
        spindle_rpm: cut.spindle_rpm,
        depth_mm: cut.depth_mm,
        outcome: cut.outcome,
        limit_mm: range.limit_mm,
        lower_mm: range.lower_mm,
        upper_mm: range.upper_mm,
        verdict,
        meaning,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noted(id: &str, posture: Option<&str>, depth_mm: f64, outcome: CutOutcome) -> NotedCut {
        NotedCut {
            id: id.into(),
            posture: posture.map(str::to_string),
            spindle_rpm: 500.0,
            depth_mm,
            outcome,
        }
    }

    #[test]
    fn cuts_are_judged_outside_the_band_only() {
        use CutOutcome::{Chatter, Stable};
        let cuts = [
            noted("a", None, 0.7, Stable),
            noted("b", None, 0.7, Chatter),
            noted("c", None, 0.95, Stable),
            noted("d", None, 1.1, Chatter),
            noted("e", None, 1.3, Stable),
            noted("f", None, 1.3, Chatter),
        ];
        let range = LimitRange::new(Some(1.0), Some([Some(0.8), Some(1.2)]));
        let found = Outcomes::score(&cuts, &[(None, &[range; 6])], vec![]).unwrap();
        let verdicts: Vec<Verdict> = found.cuts.iter().map(|c| c.verdict).collect();
        use Verdict::{Agree, Disagree, WithinBand};
        assert_eq!(
            verdicts,
            [Agree, Disagree, WithinBand, WithinBand, Disagree, Agree]
        );
        assert_eq!((found.agree, found.disagree, found.within_band), (2, 2, 2));
        assert_eq!((found.stable_below_limit, found.stable_above_limit), (2, 1));
        assert_eq!((found.chatter_above_limit, found.chatter_below_limit), (2, 1));
        assert!(found.cuts[1].meaning.as_ref().unwrap().contains("chattered"));
        assert!(found.cuts[4].meaning.as_ref().unwrap().contains("too careful"));
        assert!(found.cuts[0].meaning.is_none());
    }

    /// Without a band every cut is on one side; no limit at all is above every depth.
    #[test]
    fn a_limit_alone_leaves_nothing_open() {
        use CutOutcome::{Chatter, Stable};
        let cuts = [
            noted("a", None, 0.99, Stable),
            noted("b", None, 1.01, Stable),
            noted("c", None, 50.0, Chatter),
        ];
        let at = [
            LimitRange::new(Some(1.0), None),
            LimitRange::new(Some(1.0), None),
            LimitRange::new(None, None),
        ];
        let found = Outcomes::score(&cuts, &[(None, &at)], vec![]).unwrap();
        assert_eq!((found.agree, found.disagree, found.within_band), (1, 2, 0));
        // A tip lies above its own upper quantile; the model still means its limit.
        let tip = LimitRange::new(Some(2.0), Some([Some(0.5), Some(1.5)]));
        assert_eq!((tip.lower_mm, tip.upper_mm), (Some(0.5), Some(2.0)));
        assert!(Outcomes::score(&[], &[], vec![]).is_none());
    }

    #[test]
    fn a_cut_counts_at_its_own_posture_or_anywhere() {
        use CutOutcome::Stable;
        let cuts = [
            noted("a", Some("p1"), 1.5, Stable),
            noted("b", Some("p2"), 1.5, Stable),
            noted("c", None, 1.5, Stable),
            noted("d", Some("p3"), 1.5, Stable),
        ];
        let (low, high) = (
            [LimitRange::new(Some(1.0), None); 4],
            [LimitRange::new(Some(2.0), None); 4],
        );
        let found = Outcomes::score(&cuts, &[(Some("p1"), &low), (Some("p2"), &high)], vec![]).unwrap();
        let verdicts: Vec<Verdict> = found.cuts.iter().map(|c| c.verdict).collect();
        assert_eq!(verdicts, [Verdict::Disagree, Verdict::Agree, Verdict::WithinBand]);
        assert_eq!(found.not_compared[0].id, "d");
    }
}
