//! The cards of a campaign: what its diagnosis says, put into the words of a [`VerdictCard`].

use super::card::{BeforeAfter, ErrorBar, Tone, VerdictCard};
use super::number::{format_si, percent, plus_minus, significant};
use super::picture::Picture;
use super::sections::cutting_section;
use super::words::{self, frf_name};
use crate::analysis::diagnosis::Leading;
use crate::analysis::{CuttingFindings, DiagnosisFindings, StructureFindings, StructureLead, WrongLinks};
use crate::campaign::{Campaign, Process};
use crate::cutting::CfcResult;
use crate::discrepancy::candidate::BaselineFit;
use crate::discrepancy::localise::{BestForm, Localisation};
use crate::discrepancy::setup::SetupFinding;
use crate::discrepancy::verdict::is_noise;
use crate::discrepancy::{CutError, Diagnosis, DiagnosisVerdict};
use crate::effects::{Domain, Instance};
use crate::identify::Modelled;
use crate::identify::forces::cutting_waves::courses;
use crate::identify::{CutFit, Estimate};
use crate::text::{capitalised, listed, shell_word};

const ROBOT: &str = "Robot against FRFs";
const FORCES: &str = "Cutting forces";
/// Parameters told on a card.
const SIZES: usize = 4;

/// An effect as a card calls it.
struct Named {
    /// `local resonator on link 3 (direction y)`.
    title: String,
    explanation: &'static str,
    lab_check: &'static str,
}

/// `local resonator on link 3`.
fn at_its_place<D: Domain>(instance: &Instance<D>) -> String {
    let effect = words::effect(instance.effect.id());
    match words::place(instance.site) {
        Some(place) => format!("{effect} {place}"),
        None => effect,
    }
}

fn named<D: Domain>(instance: &Instance<D>) -> Named {
    let effect = instance.effect;
    let mut title = at_its_place(instance);
    if let Some((key, value)) = instance.variant_label() {
        title += &format!(" ({} {value})", key.replace('_', " "));
    }
    Named {
        title,
        explanation: effect.explanation(),
        lab_check: effect.background().lab_check,
    }
}

/// `mass 5.9 ± 0.3 kg, frequency 31.2 ± 0.1 Hz`.
pub fn sizes(parameters: &[Estimate]) -> String {
    let mut shown: Vec<String> = parameters.iter().take(SIZES).map(size).collect();
    if parameters.len() > SIZES {
        shown.push(format!("{} more", parameters.len() - SIZES));
    }
    shown.join(", ")
}

/// `mass 5.9 ± 0.3 kg`.
pub fn size(p: &Estimate) -> String {
    let name = words::parameter(&p.name);
    let stuck = if p.at_bound { " (end of its range)" } else { "" };
    format!("{name} {}{stuck}", plus_minus(p.value, p.std_error, p.unit))
}

/// `link 4: moment of inertia about x 60.02 ± 0.04 kg·m² instead of 31.28 kg·m²`.
pub fn departure(p: &Estimate) -> String {
    let fitted = plus_minus(p.value, p.std_error, p.unit);
    let name = words::parameter_of(&p.name);
    format!("{name} {fitted} instead of {}", format_si(p.initial, p.unit, 4))
}

/// The commands that put what is drawn into the model of the campaign in `dir`, a word of a shell.
pub fn to_add(best: &BestForm, dir: &str) -> String {
    let commands: Vec<String> = best
        .requests()
        .iter()
        .map(|request| format!("`lobestone add {dir} {request}`"))
        .collect();
    commands.join(", then ")
}

/// Headline, explanation, facts and check of a verdict.
fn answer<D: Modelled>(
    d: &Diagnosis<D>,
    added: &[String],
    data: &str,
    lead: Option<&StructureLead>,
) -> VerdictCard {
    let mut card = VerdictCard::default();
    let candidate = |label: &String| d.candidates.iter().find(|c| c.label() == *label);
    let label_in_words =
        |label: &String| candidate(label).map_or_else(|| label.clone(), |c| named(&c.instance).title);
    match (d.verdict, d.winner()) {
        (DiagnosisVerdict::Effect, Some(winner)) => {
            let of = named(&winner.instance);
            card.tone = Tone::Missing;
            card.headline = format!("Missing: {}", of.title);
            card.explanation = of.explanation.into();
            card.facts.push(("How big", sizes(&winner.parameters)));
            card.check = Some(of.lab_check.into());
            if let Some(best) = lead
                .and_then(|lead| lead.place.as_ref()?.places.first())
                .and_then(|place| place.best.as_ref())
            {
                card.facts
                    .push(("What it leaves", best.in_words(|_| String::new())));
            }
            if let Some(excuse) = d.excuse_in_words() {
                card.explanation += &format!(" {excuse}");
            }
        }
        (DiagnosisVerdict::None, _) => {
            card.tone = Tone::Clean;
            nothing(&mut card, &d.baseline, added, data);
        }
        _ if d.too_little_data.is_some() => {
            card.headline = "No verdict: the data do not suffice for one".into();
            card.explanation = sentence(d.too_little_data.as_deref().unwrap_or_default());
        }
        _ => {
            unknown(&mut card, d, lead, label_in_words);
            if let Some(links) = lead.and_then(|l| l.links.as_ref()) {
                robot_file_first(&mut card, links);
            }
            let joints = lead.map_or(Vec::new(), |l| l.joints.followed());
            let told = joints.iter().take(JOINTS_TOLD).map(|t| words::joint_trend(t));
            card.facts.splice(0..0, told.map(|text| ("Joint by joint", text)));
            let place = lead.and_then(|l| l.place.as_ref());
            let placed = place.is_some_and(|found| found.partial_share().is_none());
            let files = lead.is_some_and(|l| l.links.is_some());
            if let Some(first) = joints.first().filter(|_| !placed && !files) {
                card.headline = format!(
                    "{} is not the same at all postures",
                    sentence_begin(&first.parameter)
                );
                card.check = Some(first.against.lab_check().into());
            }
        }
    }
    if d.too_little_data.is_none() {
        card.facts.push(("How sure", words::confidence(d.confidence)));
    }
    if !d.indistinguishable.is_empty() {
        let rivals: Vec<String> = d.indistinguishable.iter().map(label_in_words).collect();
        card.facts.push((
            "Not told from",
            format!("{}: these data fit both", listed(&rivals)),
        ));
    }
    if !d.companions.is_empty() {
        // What they chose alone, of candidates, they need not have chosen together.
        let without_choice =
            |label: &String| candidate(label).map_or_else(|| label.clone(), |c| at_its_place(&c.instance));
        let others: Vec<String> = d.companions.iter().map(without_choice).collect();
        let count = match others.len() {
            1 => "a second effect",
            _ => "further effects",
        };
        card.facts
            .push(("Likely besides", format!("{count}: {}", listed(&others))));
    }
    card
}

/// `joint-2.stiffness` → `Stiffness of joint 2`.
fn sentence_begin(parameter: &str) -> String {
    let capital = capitalised(&words::parameter(parameter));
    match parameter.rsplit_once('.') {
        Some((owner, _)) => format!("{capital} of {}", words::at_place(owner)),
        None => capital,
    }
}

/// Joints that a card names of those that follow something.
const JOINTS_TOLD: usize = 2;

fn nothing(card: &mut VerdictCard, baseline: &BaselineFit, added: &[String], data: &str) {
    let more = if added.is_empty() { "" } else { " more" };
    (card.headline, card.explanation) = match baseline.rest.small_errors_in_words() {
        Some(why) => (
            format!("Nothing{more} stands above the small errors of the setup"),
            format!(
                "{}. An effect smaller than that cannot be seen in these {data}.",
                capitalised(&why)
            ),
        ),
        None => (
            format!("Nothing{more} is missing"),
            format!("What the model leaves of these {data} looks like their own noise."),
        ),
    };
    if !added.is_empty() {
        card.explanation += &format!(" The model has what was added: {}.", listed(added));
    }
}

fn unknown<D: Modelled>(
    card: &mut VerdictCard,
    d: &Diagnosis<D>,
    lead: Option<&StructureLead>,
    label_in_words: impl Fn(&String) -> String,
) {
    let beside = lead.and_then(|lead| lead.beside.as_ref()).map(label_in_words);
    let lead = lead.and_then(|lead| lead.place.as_ref());
    let drawn = lead.and_then(|found| {
        let place = found.places.first()?;
        Some((place, place.best.as_ref()?))
    });
    if let Some(why) = d.apart_from_files() {
        card.headline = "Nothing is missing apart from what was found among the files".into();
        card.explanation = sentence(why);
        return;
    }
    card.explanation = "What is left is real, but no effect that this program knows explains it.".into();
    card.headline = match drawn {
        Some((place, best)) => {
            let what = best.in_words(|_| String::new());
            card.explanation += &match &beside {
                Some(guess) => format!(
                    " The best guess ({guess}) comes near; of what that leaves the data draw what it does and where: {what}."
                ),
                None => {
                    format!(" Without a name for it, the data still draw what it does and where: {what}.")
                }
            };
            let all: Vec<Estimate> = best.parts().flat_map(|p| p.parameters.clone()).collect();
            card.facts.push(("How big", sizes(&all)));
            if !place.tied_with.is_empty() {
                card.facts.push(("Or at", listed(&place.tied_with)));
            }
            match lead.and_then(Localisation::partial_share) {
                Some(share) => {
                    card.explanation += &format!(
                        " That explains {:.0} % of what stands above the noise: it is not all, or not the place.",
                        100.0 * share
                    );
                    "Something is missing that has no name here".into()
                }
                None => {
                    let beside = beside.map_or(String::new(), |guess| format!(", beside: {guess}"));
                    format!("Something unknown {}{beside}", place.in_words())
                }
            }
        }
        None => "Something is missing that has no name here".into(),
    };
    let guess = d.best_guess.and_then(|i| d.candidates.get(i));
    if let (Some(guess), Some(words)) = (guess, d.best_guess_in_words()) {
        let of = named(&guess.instance);
        let words = words.strip_prefix("Best guess: ").unwrap_or(&words);
        card.facts
            .push(("Best guess", words.replacen(&guess.label(), &of.title, 1)));
        card.check = Some(format!("Of the best guess ({}): {}", of.title, of.lab_check));
    }
    card.facts
        .extend(d.unexplained_in_words().map(|words| ("A lead", words)));
}

/// Numbers of the robot file that explain what no effect does stand before what the data draw.
fn robot_file_first(card: &mut VerdictCard, links: &WrongLinks) {
    card.headline = "The robot file may be wrong: other links explain what is left".into();
    card.explanation = format!(
        "No effect that this program knows explains what is left, but links other than in the robot file do: with them {:.2} times \
         the noise's variance is left.",
        links.reduced_chi2
    );
    card.facts
        .retain(|(name, _)| *name != "How big" && *name != "Or at");
    card.facts.insert(
        0,
        (
            "Links",
            listed(&links.departing.iter().map(departure).collect::<Vec<_>>()),
        ),
    );
    card.check = Some("Compare these numbers with a drawing, a CAD model or the maker's data.".into());
}

/// The first letter large, a full stop at the end.
fn sentence(text: &str) -> String {
    let text = capitalised(text);
    match text.ends_with('.') {
        true => text,
        false => text + ".",
    }
}

/// The files before the physics: turns the card into one that says what is wrong with them.
fn files_first(card: &mut VerdictCard, findings: &[&SetupFinding]) {
    let Some(first) = findings.first() else { return };
    let physics = std::mem::take(&mut card.headline);
    card.headline = format!(
        "Your files first: {} ({})",
        words::effect(first.kind),
        first.place
    );
    card.explanation = match card.tone {
        Tone::Missing => format!(
            "A file or a setting looks wrong, which the model cannot make up for. If it is right after all, the answer \
             is: {physics}."
        ),
        _ => "A file or a setting looks wrong. Which physics is missing cannot be told before it is right."
            .into(),
    };
    let mut facts: Vec<_> = findings.iter().map(|f| ("What is wrong", in_full(f))).collect();
    if card.tone != Tone::Missing {
        card.facts.clear();
        card.check = None;
    }
    facts.append(&mut card.facts);
    card.facts = facts;
    card.tone = Tone::Files;
    card.next = format!("{} Then run the same command again.", sentence(&first.remedy));
}

/// What was found, how large and how sure, and the remedy.
fn in_full(finding: &SetupFinding) -> String {
    let size = match (finding.value, finding.std_error) {
        (Some(value), error) => {
            format!("{}. ", plus_minus(value, error.unwrap_or(f64::NAN), finding.unit))
        }
        (None, _) => String::new(),
    };
    format!(
        "{} ({}): {size}{}, {}",
        words::effect(finding.kind),
        finding.place,
        words::confidence(finding.confidence),
        finding.remedy
    )
}

/// The robot's side; `files`: likely mistakes of the setup. `None` where no model could be fitted.
pub fn structure(
    campaign: &Campaign,
    files: &[SetupFinding],
    structure: Option<&StructureFindings>,
    diagnosis: Option<&DiagnosisFindings>,
) -> Option<VerdictCard> {
    let case = diagnosis
        .map(|d| &d.case)
        .or_else(|| structure.map(|s| &s.analysis.case))?;
    let added: Vec<String> = case
        .model
        .effects()
        .iter()
        .map(|a| named(&a.instance).title)
        .collect();
    let dir = shell_word(&campaign.dir);
    let mut card = match (diagnosis, structure) {
        (Some(found), _) => {
            let d = &found.diagnosis;
            let mut card = answer(d, &added, "FRFs", found.lead.as_ref());
            if let Some(leading) = &found.leading {
                let place = leading.explained.taken_from.words();
                card.facts
                    .insert(0, ("Where it shows", place.trim_start_matches("at ").into()));
            }
            card.next = match (d.verdict, d.winner(), &found.lead) {
                (DiagnosisVerdict::Effect, Some(winner), _) if d.indistinguishable.is_empty() => format!(
                    "make the check, then add it and fit everything anew: `lobestone add {dir} {}`",
                    winner.label()
                ),
                (DiagnosisVerdict::Effect, Some(winner), _) => format!(
                    "tell the rivals apart first: {}. Then `lobestone add {dir} {}`",
                    found.next_measurement,
                    winner.label()
                ),
                (DiagnosisVerdict::None, ..) => use_it(campaign),
                (_, _, Some(StructureLead { links: Some(_), .. })) => format!(
                    "see which links fit: `lobestone calibrate {dir} --free links`; where the robot is so, give the campaign a robot \
                     file of its own with them"
                ),
                (
                    _,
                    _,
                    Some(StructureLead {
                        place: Some(lead),
                        beside,
                        ..
                    }),
                ) => match (lead.places.first().and_then(|p| p.best.as_ref()), beside) {
                    (Some(best), Some(guess)) => format!(
                        "put the best guess into the model: `lobestone add {dir} {guess}`; then look at what the data draw of the rest: \
                         `lobestone localise {dir}`; to put that in as well: {}",
                        to_add(best, &dir)
                    ),
                    (Some(best), None) => format!(
                        "look at what the data draw: `lobestone localise {dir}`; to put it into the model: {}",
                        to_add(best, &dir)
                    ),
                    (None, _) => format!("{}", found.next_measurement),
                },
                _ => format!("{}", found.next_measurement),
            };
            card
        }
        (None, Some(s)) => not_asked(s.analysis.calibration.reduced_chi2, &added, &dir),
        (None, None) => return None,
    };
    card.next = sentence(&card.next);
    let fitted = diagnosis
        .map(|d| &d.diagnosis.baseline.calibration.parameters)
        .or_else(|| structure.map(|s| &s.analysis.calibration.parameters));
    tell_added(
        &mut card,
        case.model.effects().iter().map(|a| &a.instance),
        fitted,
    );
    card.side = ROBOT;
    card.bar = Some(error_bar(structure, diagnosis, &added));
    card.curves = frf(structure, diagnosis);
    if let (None, [.., last]) = (&card.check, case.model.effects()) {
        card.check = Some(last.instance.effect.background().lab_check.to_string())
            .filter(|_| card.tone == Tone::Clean || diagnosis.is_none());
    }
    card.remarks = case.warnings.clone();
    files_first(&mut card, &files.iter().collect::<Vec<_>>());
    Some(card)
}

/// What was added to the model, and how big it came out.
fn tell_added<'a, D: Domain + 'a>(
    card: &mut VerdictCard,
    added: impl Iterator<Item = &'a Instance<D>>,
    fitted: Option<&Vec<Estimate>>,
) {
    let told: Vec<String> = added
        .filter_map(|instance| {
            let owner = format!("{}.", instance.label());
            let own = fitted?.iter().filter(|p| p.name.starts_with(&owner));
            let own: Vec<Estimate> = own.cloned().collect();
            (!own.is_empty()).then(|| format!("{}: {}", named(instance).title, sizes(&own)))
        })
        .collect();
    if !told.is_empty() {
        card.facts.insert(0, ("Added", told.join("; ")));
    }
}

/// Where nobody looked for what is missing.
fn not_asked(reduced_chi2: f64, added: &[String], dir: &str) -> VerdictCard {
    let mut card = VerdictCard::default();
    let noise = is_noise(reduced_chi2);
    card.headline = match (added, noise) {
        ([], true) => "Hardly more than noise is left".into(),
        ([], false) => "What is left is not noise: physics is missing, or a file is wrong".into(),
        (some, true) => format!("The model has {}: hardly more than noise is left", listed(some)),
        (some, false) => format!("The model has {}, and more than noise is left", listed(some)),
    };
    card.explanation = match added {
        [] => "The model was fitted; what it may lack was not looked for.".into(),
        _ => "Whether more is missing was not looked for since.".into(),
    };
    if noise {
        card.tone = Tone::Clean;
    }
    card.next = format!("learn what is missing: `lobestone diagnose {dir}`");
    card
}

fn use_it(campaign: &Campaign) -> String {
    let dir = shell_word(&campaign.dir);
    match campaign.lobes {
        Some(_) => format!("use the model; for the stable depths of cut: `lobestone lobes {dir}`"),
        None => "use the model; with a [lobes] table in campaign.toml there are stability lobes, too".into(),
    }
}

fn error_bar(
    structure: Option<&StructureFindings>,
    diagnosis: Option<&DiagnosisFindings>,
    added: &[String],
) -> ErrorBar {
    let mut bar = ErrorBar::default();
    let first = structure.and_then(|s| s.earlier.first());
    let now = match (diagnosis, structure) {
        (Some(d), _) => d.now.comparison.totals,
        (None, Some(s)) => s.analysis.after.totals,
        (None, None) => return bar,
    };
    bar.noise = now.noise_floor_nrms;
    let leading = diagnosis.and_then(|d| Some((d, d.leading.as_ref()?)));
    match (added, first, leading) {
        ([], _, None) => {
            let robot_file = structure.map(|s| s.analysis.before.totals.nrms);
            bar.steps
                .extend(robot_file.map(|nrms| ("robot file".to_string(), nrms)));
        }
        ([_, ..], Some(first), _) => {
            bar.steps
                .push(("calibrated, nothing added".into(), first.comparison.totals.nrms));
        }
        _ => {}
    }
    let name = match added {
        [] => "calibrated".to_string(),
        some => format!("with {}", listed(some)),
    };
    bar.steps.push((name, now.nrms));
    if let Some((d, leading)) = leading {
        let name = with_candidate(d.diagnosis.verdict);
        bar.steps.push((name.into(), leading.view.comparison.totals.nrms));
    }
    bar
}

/// What the model with the leading candidate is called.
fn with_candidate(verdict: DiagnosisVerdict) -> &'static str {
    match verdict {
        DiagnosisVerdict::Effect => "with what is missing",
        _ => "with the best guess",
    }
}

/// The FRF that stands out most, without and with what is missing (or was added).
fn frf(structure: Option<&StructureFindings>, diagnosis: Option<&DiagnosisFindings>) -> Option<BeforeAfter> {
    let (data, before, after) = match (diagnosis, structure) {
        (Some(d), _) if d.leading.is_some() => {
            let leading = d.leading.as_ref()?;
            let with = with_candidate(d.diagnosis.verdict);
            (
                &d.case.data,
                (&d.now.predicted, &d.now.comparison, "as it stands"),
                Some((&leading.view.predicted, &leading.view.comparison, with)),
            )
        }
        (_, Some(s)) => {
            let a = &s.analysis;
            let now = |name| (&a.calibrated, &a.after, name);
            match s.earlier.first() {
                Some(first) if !a.case.model.effects().is_empty() => (
                    &a.case.data,
                    (&first.predicted, &first.comparison, "nothing added"),
                    Some(now("as it is now")),
                ),
                _ => (
                    &a.case.data,
                    (&a.nominal, &a.before, "robot file"),
                    Some(now("calibrated")),
                ),
            }
        }
        (Some(d), None) => (
            &d.case.data,
            (&d.now.predicted, &d.now.comparison, "calibrated"),
            None,
        ),
        (None, None) => return None,
    };
    let index = before.1.worst_first().into_iter().next()?;
    let (block, frf) = data.frfs().nth(index)?;
    let error = before.1.frf_errors.get(index)?;
    let name = frf_name(&error.posture, &error.name);
    let magnitudes = |curves: &Vec<Vec<num_complex::Complex64>>| -> Option<Vec<f64>> {
        Some(curves.get(index)?.iter().map(|v| v.norm()).collect())
    };
    let mut caption = format!(
        "The FRF that stands out most: {name}. Error {}",
        percent(error.nrms)
    );
    if let Some((_, comparison, _)) = &after {
        caption += &format!(" → {}", percent(comparison.frf_errors.get(index)?.nrms));
    }
    caption += &format!(", noise {}.", percent(error.noise_floor_nrms));
    let picture = Picture {
        alt: caption.clone(),
        x_label: "Frequency (Hz)".into(),
        y_label: "Receptance".into(),
        unit: "m/N".into(),
        log: true,
        x: block.frequency_hz.clone(),
        measured: frf.receptance.iter().map(|v| v.norm()).collect(),
        before: magnitudes(before.0),
        after: after.as_ref().and_then(|(curves, ..)| magnitudes(curves)),
        noise: Some(frf.noise_std.clone()),
        shaded: diagnosis
            .and_then(|d| d.leading.as_ref())
            .map(|l| [l.explained.taken_from.from_hz, l.explained.taken_from.to_hz]),
    };
    Some(BeforeAfter {
        picture,
        before: before.2.into(),
        after: after.map(|(_, _, name)| name.into()),
        caption,
    })
}

/// The cutting side, as far as it was diagnosed.
pub fn cutting(campaign: &Campaign, files: &[SetupFinding], found: &CuttingFindings) -> VerdictCard {
    let d = &found.diagnosis;
    let effects = found.case.model.effects();
    let added: Vec<String> = effects.iter().map(|a| named(&a.instance).title).collect();
    let mut card = answer(d, &added, "force records", None);
    card.id = "verdict-cutting";
    card.side = FORCES;
    if let (DiagnosisVerdict::Effect, Some(place)) = (d.verdict, &found.now.comparison.mostly) {
        card.facts
            .insert(0, ("Where it shows", place.trim_start_matches("at ").into()));
    }
    let taken_out = found.setup.taken_out().iter();
    card.facts
        .extend(taken_out.map(|f| ("Taken out of the records", in_full(f))));
    if let Some(first) = found.lead.as_ref().and_then(|l| l.lines.first()) {
        card.facts.insert(
            0,
            (
                "What stands out",
                format!(
                    "{}: {} of what stands above the noise, strongest {}; usually {}",
                    first.what,
                    percent(first.share),
                    first.strongest(),
                    first.usual_cause
                ),
            ),
        );
    }
    let dir = shell_word(&campaign.dir);
    card.next = match (d.verdict, d.winner()) {
        (DiagnosisVerdict::Effect, Some(winner)) if d.indistinguishable.is_empty() => format!(
            "make the check, then add it and fit everything anew: `lobestone add {dir} {}`",
            winner.label()
        ),
        (DiagnosisVerdict::Effect, Some(winner)) => format!(
            "tell the rivals apart first: {}. Then `lobestone add {dir} {}`",
            found.next_measurement,
            winner.label()
        ),
        (DiagnosisVerdict::None, _) => format!("use the coefficients: `lobestone cfc {dir}`"),
        _ if d.apart_from_files().is_some() => {
            format!("look into what was found; the coefficients can be used: `lobestone cfc {dir}`")
        }
        _ => found.next_measurement.to_string(),
    };
    card.next = sentence(&card.next);
    let fitted = &d.baseline.calibration.parameters;
    tell_added(&mut card, effects.iter().map(|a| &a.instance), Some(fitted));
    let now = &found.now.comparison.totals;
    let mut bar = ErrorBar {
        noise: now.noise_floor_nrms,
        ..ErrorBar::default()
    };
    let first = found.case.revisions.first().filter(|_| !added.is_empty());
    bar.steps
        .extend(first.map(|r| ("nothing added".to_string(), r.nrms)));
    let name = match added.as_slice() {
        [] => "force model".to_string(),
        some => format!("with {}", listed(some)),
    };
    bar.steps.push((name, now.nrms));
    if let Some(Leading { view, .. }) = &found.leading {
        bar.steps
            .push((with_candidate(d.verdict).into(), view.comparison.totals.nrms));
    }
    card.bar = Some(bar);
    card.curves = force(found);
    if let (None, Some(last), Tone::Clean) = (&card.check, effects.last(), card.tone) {
        card.check = Some(last.instance.effect.background().lab_check.to_string());
    }
    card.remarks = found.case.warnings.clone();
    files_first(&mut card, &files.iter().collect::<Vec<_>>());
    card
}

/// The force that stands out most, without and with what is missing.
fn force(found: &CuttingFindings) -> Option<BeforeAfter> {
    let comparison = &found.now.comparison;
    let worst = |c: &CutError| {
        let times = c.times_noise.iter().filter_map(|(name, t)| Some((name, (*t)?)));
        times
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(name, times)| (name.clone(), times))
    };
    let all = comparison.cuts.iter().enumerate();
    let (cut, error, (axis, times)) = all
        .filter_map(|(i, c)| Some((i, c, worst(c)?)))
        .max_by(|a, b| a.2.1.total_cmp(&b.2.1))?;
    let data = &found.case.data;
    let own = data.cuts.get(cut)?;
    let course = |fits: &[CutFit]| {
        let all = courses(data, own, fits.get(cut)?);
        all.into_iter().find(|c| c.axis.label() == axis)
    };
    let now = course(&found.now.fits)?;
    let with = found.leading.as_ref().and_then(|l| course(&l.view.fits));
    // A fit has a zero line and a phase of its own: only its difference from the record counts.
    let after = with.map(|with| -> Vec<f64> {
        let rests = with.model.iter().zip(&with.measured).map(|(m, r)| m - r);
        rests.zip(&now.measured).map(|(rest, r)| r + rest).collect()
    });
    let caption = format!(
        "The force that stands out most: {axis} of cut {}, {} times its noise. Error of the cut {}, noise {}.",
        own.id,
        significant(times, 2),
        percent(error.nrms),
        percent(error.noise_floor_nrms)
    );
    let unit = now.axis.unit();
    let picture = Picture {
        alt: caption.clone(),
        x_label: match data.process {
            Process::Milling => "Rotation of the tool (°)".into(),
            Process::Drilling | Process::Turning => "Time (s)".into(),
        },
        y_label: format!("{axis} ({unit})"),
        unit: unit.into(),
        log: false,
        x: now.x,
        measured: now.measured,
        before: Some(now.model),
        after,
        noise: None,
        shaded: None,
    };
    Some(BeforeAfter {
        before: "as it stands".into(),
        after: picture
            .after
            .as_ref()
            .map(|_| with_candidate(found.diagnosis.verdict).into()),
        picture,
        caption,
    })
}

/// Where nothing was compared with a model of the robot: what was found of the cutting forces, or of nothing.
pub fn coefficients(campaign: &Campaign, result: &CfcResult, files: &[SetupFinding]) -> VerdictCard {
    let (tone, what) = match cutting_section::misses_more_than_noise(result) {
        true => (Tone::Open, "the force model misses more than noise"),
        false => (Tone::Clean, "what the force model may lack was not looked for"),
    };
    let mut card = VerdictCard {
        id: "verdict-cutting",
        side: FORCES,
        tone,
        headline: format!("Coefficients found; {what}"),
        explanation: cutting_section::summary(result),
        next: format!(
            "Learn what is missing: `lobestone diagnose {}`.",
            shell_word(&campaign.dir)
        ),
        remarks: result.warnings.clone(),
        ..VerdictCard::default()
    };
    files_first(&mut card, &files.iter().collect::<Vec<_>>());
    card
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(kind: &'static str, confidence: f64) -> SetupFinding {
        SetupFinding {
            kind,
            place: "joint 3".into(),
            value: Some(0.2345),
            std_error: Some(0.0123),
            unit: "deg",
            confidence,
            remedy: "correct the joint angles of all postures".into(),
        }
    }

    #[test]
    fn wrong_files_come_before_the_physics_that_they_may_make_up() {
        let found = [finding("encoder-offset", 0.97), finding("gain", 0.6)];
        for (tone, keeps) in [(Tone::Open, false), (Tone::Missing, true)] {
            let mut card = VerdictCard {
                tone,
                headline: "Missing: payload".into(),
                facts: vec![("How big", "mass 3 kg".into())],
                check: Some("weigh it".into()),
                ..VerdictCard::default()
            };
            files_first(&mut card, &found.iter().collect::<Vec<_>>());
            assert_eq!(card.tone, Tone::Files);
            assert_eq!(card.headline, "Your files first: encoder offset (joint 3)");
            assert_eq!(card.explanation.contains("Missing: payload"), keeps);
            assert_eq!(card.check.is_some(), keeps);
            assert!(
                card.facts[0].1.contains("0.234 ± 0.012\u{a0}°"),
                "{:?}",
                card.facts
            );
            assert!(card.facts[1].1.starts_with("gain"));
            assert!(card.next.starts_with("Correct the joint angles of all postures."));
        }
        let mut untouched = VerdictCard::default();
        files_first(&mut untouched, &[]);
        assert_eq!(untouched.tone, Tone::Open);
    }

    #[test]
    fn sizes_are_words_rounded_to_their_errors() {
        let estimate = |name: &str, value, std_error, unit| Estimate {
            name: name.into(),
            value,
            unit,
            std_error,
            initial: value,
            at_bound: false,
        };
        let of = [
            estimate("local-resonator@link-3.mass_kg", 5.912, 0.31, "kg"),
            estimate("local-resonator@link-3.frequency_hz", 31.2345, 0.0612, "Hz"),
            estimate("local-resonator@link-3.damping_ratio", 0.03123, 0.0021, "1"),
        ];
        assert_eq!(
            sizes(&of),
            "mass 5.91 ± 0.31\u{a0}kg, frequency 31.23 ± 0.06\u{a0}Hz, damping ratio 0.0312 ± 0.0021"
        );
        let many: Vec<Estimate> = (0..7)
            .map(|i| estimate(&format!("x.c_nms_per_rad[{i}]"), 10.0, 1.0, "N·m·s/rad"))
            .collect();
        assert!(sizes(&many).ends_with("3 more"));
    }
}
