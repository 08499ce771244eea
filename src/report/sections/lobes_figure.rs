//! The lobes as curves over the spindle speed.

use crate::analysis::{LobeAnalysis, LobeCase};
use crate::campaign::{CutOutcome, LobeMethod, LobeSource, Process};
use crate::lobes::optimum::apart_deg;
use crate::lobes::outcome::Verdict;
use crate::report::Block;
use crate::report::figure::{LobeMarker, LobeOutcome, LobePanel, LobeTrace, LobesFigure};
use crate::report::number::decimals;
use crate::report::parts::figure;

/// Curves in one figure.
const CURVES: usize = 6;
/// Frames in one figure, where every posture has its own.
const PANELS: usize = 3;
/// Tips marked in the figure.
const MARKED: usize = 3;

/// The process, and how its lobes are worked out.
pub fn process(analysis: &LobeAnalysis) -> &'static str {
    match analysis.process {
        Process::Milling => match analysis.method {
            LobeMethod::MultiFrequency => "milling, multi-frequency",
            LobeMethod::SemiDiscretisation => "milling, semi-discretisation",
            LobeMethod::ZeroOrder | LobeMethod::FrequencyDomain => "milling, zero-order",
        },
        Process::Drilling => analysis.drilling(),
        Process::Turning => "turning",
    }
}

/// Where the FRFs of the lobes come from.
pub fn source(analysis: &LobeAnalysis) -> &'static str {
    match analysis.source {
        LobeSource::Model => "from the model",
        LobeSource::Measured => "from the measured FRFs",
        LobeSource::Modes => "from the modes of the campaign file",
    }
}

/// Where curves come with a band or with their state before effects were added, every posture gets its own frame.
pub fn figures(analysis: &LobeAnalysis, file: &str, prefix: &str) -> Vec<Block> {
    let detailed = analysis
        .cases
        .iter()
        .any(|c| c.band.is_some() || c.before.is_some());
    let before = analysis.cases.iter().any(|c| c.before.is_some());
    let each = if detailed { PANELS } else { CURVES };
    let parts = analysis.cases.chunks(each).count();
    let chunks = analysis.cases.chunks(each).enumerate();
    let frames = |cases: &[LobeCase]| LobesFigure {
        panels: match detailed {
            true => cases
                .iter()
                .map(|case| panel(analysis, std::slice::from_ref(case), detailed))
                .collect(),
            false => vec![panel(analysis, cases, detailed)],
        },
        ..LobesFigure::default()
    };
    // One scale in all parts, too: which posture bears more must be seen.
    let caps = analysis.cases.chunks(each).map(|cases| frames(cases).cap());
    let depth_cap_mm = (parts > 1).then(|| caps.fold(0.0, f64::max));
    chunks
        .map(|(part, cases)| {
            let number = if parts > 1 { format!(", part {}", part + 1) } else { String::new() };
            let drawing = LobesFigure {
                title: format!("Stability lobes, {prefix}{}{number}", process(analysis)),
                depth_cap_mm,
                ..frames(cases)
            };
            let name = if parts > 1 { format!("{file}-{}", part + 1) } else { file.to_string() };
            let mut caption = format!("Depth limit over spindle speed, {}; ", source(analysis));
            caption += match detailed {
                true => "one frame a posture. The dotted line is the least limit of that posture",
                false => "one curve a posture. The dotted line is the least limit of all postures",
            };
            if before {
                caption += &format!(
                    "; the grey dashes are the limit before {} {} added, with everything fitted anew",
                    analysis.effects.join(", "),
                    if analysis.effects.len() == 1 { "was" } else { "were" }
                );
            }
            if detailed && cases.iter().any(|c| c.band.is_some()) {
                caption += "; the shade holds 90 % of what the uncertainty of the model's parameters allows";
            }
            caption += "; diamonds mark the deepest tips.";
            if analysis.outcomes.as_ref().is_some_and(|o| !o.cuts.is_empty()) {
                caption += " Discs are cuts that were stable, crosses cuts that chattered; those that do not agree with \
                            the limit have their names.";
            }
            figure(name, &drawing.title.clone(), caption, drawing.png()).with_plot(drawing.plot())
        })
        .collect()
}

/// With the surface over the redundancy angle: the lobes of the posture as it stands, where test cuts were made, and those
/// of the step nearest to the recommended angle.
pub fn as_it_stands_and_recommended(analysis: &LobeAnalysis, recommended_deg: f64) -> Option<Block> {
    let away = |case: &&LobeCase| apart_deg(case.angle_deg.unwrap_or(0.0), recommended_deg);
    let nearest = analysis.cases.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
    let standing = analysis
        .cases
        .iter()
        .find(|c| c.angle_deg == Some(0.0) && c.angle_deg != nearest.angle_deg);
    let panels = standing
        .into_iter()
        .chain([nearest])
        .map(|case| panel(analysis, std::slice::from_ref(case), true));
    let drawing = LobesFigure {
        title: format!("Stability lobes at the recommended angle, {}", process(analysis)),
        panels: panels.collect(),
        depth_cap_mm: None,
    };
    let mut caption = "Depth limit over spindle speed at the step of the sweep nearest to the recommended angle, and with the \
                       robot as it stands (0°). The dotted line is the least limit there"
        .to_string();
    if nearest.before.is_some() {
        caption += &format!(
            "; the grey dashes are the limit before {} {} added, with everything fitted anew",
            analysis.effects.join(", "),
            if analysis.effects.len() == 1 {
                "was"
            } else {
                "were"
            }
        );
    }
    caption += "; diamonds mark the deepest tips. Discs are test cuts that were stable, crosses cuts that chattered.";
    let (title, png) = (drawing.title.clone(), drawing.png());
    Some(figure("lobes-recommended".to_string(), &title, caption, png))
}

fn panel(analysis: &LobeAnalysis, cases: &[LobeCase], detailed: bool) -> LobePanel {
    let name = |case: &LobeCase| {
        let posture = case.posture.clone().unwrap_or_else(|| "modes".into());
        case.angle_deg.map_or(posture.clone(), |a| {
            format!("{posture} turned by {}°", decimals(a, 1))
        })
    };
    let curves = cases.iter().map(|case| LobeTrace {
        label: if detailed { String::new() } else { name(case) },
        spindle_rpm: case.curve.spindle_rpm.clone(),
        depth_limit_mm: case.curve.depth_limit_mm.clone(),
        before_mm: case
            .before
            .as_ref()
            .map(|b| b.curve.depth_limit_mm.clone())
            .unwrap_or_default(),
        band_mm: case
            .band
            .as_ref()
            .map(|b| [b.lower_mm.clone(), b.upper_mm.clone()]),
    });
    let best = analysis.best();
    let tips = best
        .iter()
        .filter(|(case, _)| {
            cases
                .iter()
                .any(|c| c.posture == case.posture && c.angle_deg == case.angle_deg)
        })
        .filter_map(|(_, peak)| {
            Some(LobeMarker {
                spindle_rpm: peak.spindle_rpm,
                depth_mm: peak.depth_mm?,
                outcome: LobeOutcome::Tip,
                label: String::new(),
            })
        })
        .take(MARKED);
    let cuts = analysis.outcomes.iter().flat_map(|o| &o.cuts);
    let cuts = cuts
        .filter(|cut| {
            // Test cuts were made with the robot as it stands.
            let mut here = cases.iter().filter(|c| c.angle_deg.unwrap_or(0.0) == 0.0);
            here.any(|c| cut.posture.is_none() || c.posture.is_none() || c.posture == cut.posture)
        })
        .map(|cut| LobeMarker {
            spindle_rpm: cut.spindle_rpm,
            depth_mm: cut.depth_mm,
            outcome: match cut.outcome {
                CutOutcome::Stable => LobeOutcome::Stable,
                CutOutcome::Chatter => LobeOutcome::Chatter,
            },
            label: match cut.verdict {
                Verdict::Agree => String::new(),
                Verdict::Disagree | Verdict::WithinBand => format!("cut {}", cut.id),
            },
        });
    LobePanel {
        name: cases.first().map(name).unwrap_or_default(),
        markers: tips.chain(cuts).collect(),
        absolute_limit_mm: match (detailed, cases) {
            (true, [case]) => case.absolute.map(|a| a.depth_mm),
            _ => analysis.absolute().map(|a| a.depth_mm),
        },
        curves: curves.collect(),
    }
}
