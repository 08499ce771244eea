use std::collections::BTreeMap;

use serde::Serialize;

use crate::Result;
use crate::analysis::{CampaignSide, CuttingFindings, DiagnosisFindings, Findings, Workbench, WrongLinks};
use crate::campaign::Campaign;
use crate::commands::document::EffectBarred;
use crate::commands::find::localise::{self, PlaceDrawn};
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, files_first, number, percent, table, wrapped};
use crate::commands::{Outcome, SideArgs, by_domain};
use crate::data::Process;
use crate::discrepancy::candidate::BaselineFit;
use crate::discrepancy::comparison::explained::Explained;
use crate::discrepancy::joint_trends::{JointCourse, JointTrend, JointTrends};
use crate::discrepancy::localise::Localisation;
use crate::discrepancy::setup::SetupFinding;
use crate::discrepancy::{CuttingLead, Diagnosis, DiagnosisVerdict, EffectCandidate, NextMeasurement, Trend};
use crate::identify::frfs::structure_study::{ResidualPeak, residual_peaks};
use crate::identify::rest::{BeyondSlips, RestTest};
use crate::identify::{Estimate, HeldOut, Modelled, Options};
use crate::report::verdict_card::departure;
use crate::report::words;
use crate::revision::Side;
use crate::text::{capitalised, chance};

pub fn run(args: SideArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    by_domain(
        &campaign,
        args.domain,
        |c| Ok(structure(c, &diagnosed(c)?)),
        |c| Ok(cutting(c, &diagnosed(c)?)),
    )
}

/// The diagnosis of one side, kept for `add`.
fn diagnosed<D: CampaignSide>(campaign: &Campaign) -> Result<Findings<D>> {
    let bench = Workbench::new(campaign);
    let found = Findings::on(&bench, Options::default())?;
    // A folder that cannot be written to is no reason not to answer.
    let _ = found.keep(&bench);
    Ok(found)
}

/// What was found out about the force records.
pub fn cutting(campaign: &Campaign, findings: &CuttingFindings) -> Outcome {
    let own = CuttingKeys {
        process: findings.case.data.process,
        lead: findings.lead.as_ref(),
    };
    let told = findings.lead.as_ref().map_or(String::new(), lines_in_words);
    outcome(Guide::cutting(campaign), findings, own, &told, None)
}

/// What was found out about the FRFs.
pub fn structure(campaign: &Campaign, findings: &DiagnosisFindings) -> Outcome {
    let peaks = &residual_peaks(&findings.now.predicted, &findings.case.data);
    let joints = joint_trends(findings);
    let own = StructureKeys {
        explains: Explains::of(findings),
        residual_peaks_hz: peaks.iter().map(|p| p.frequency_hz).collect(),
        residual_peaks: peaks,
        // The best place of what the data draw.
        lead: place_drawn(findings)
            .and_then(|found| found.places.first())
            .map(PlaceDrawn::of),
        lead_beside: drawn_beside(findings),
        wrong_links: wrong_links(findings),
        joint_trends: joints.map_or(&[], |j| &j.trends),
        joint_courses: joints.map_or(&[], |j| &j.courses),
    };
    let told = joints.map_or(String::new(), joints_in_words)
        + &crate::commands::find::compare::dominant(peaks)
        + &where_it_shows(findings);
    let guide = Guide::structure(campaign);
    let instead = wrong_links(findings).map(|found| guide.wrong_links(found.beside.as_deref()));
    outcome(guide, findings, own, &told, instead)
}

fn wrong_links(findings: &DiagnosisFindings) -> Option<&WrongLinks> {
    findings.lead.as_ref()?.links.as_ref()
}

fn place_drawn(findings: &DiagnosisFindings) -> Option<&Localisation> {
    findings.lead.as_ref()?.place.as_ref()
}

fn drawn_beside(findings: &DiagnosisFindings) -> Option<&str> {
    findings.lead.as_ref()?.beside.as_deref()
}

fn joint_trends(findings: &DiagnosisFindings) -> Option<&JointTrends> {
    findings.lead.as_ref().map(|lead| &lead.joints)
}

/// What the joints follow from posture to posture.
fn joints_in_words(joints: &JointTrends) -> String {
    let Some(first) = joints.trends.first() else {
        return String::new();
    };
    let mut text = String::new();
    for trend in joints.followed() {
        text += &wrapped(&words::joint_trend(trend), "  ");
    }
    if text.is_empty() {
        text = wrapped(
            &format!(
                "Refitted posture by posture, no joint's stiffness or damping follows the order of measurement, the hammer's level, the \
                 joint's angle or gravity's torque by more than chance ({} tests, the least {}).",
                first.tests,
                chance(first.p_value)
            ),
            "  ",
        );
    }
    text
}

/// What both sides say alike; `own`: keys of this side alone, `told`: its own words, `instead`: a next step that is better than a
/// further measurement.
fn outcome<D: CampaignSide>(
    guide: Guide<'_>,
    findings: &Findings<D>,
    own: impl Serialize,
    told: &str,
    instead: Option<String>,
) -> Outcome {
    let Findings {
        case,
        diagnosis: d,
        next_measurement,
        setup,
        ..
    } = findings;
    let noise_floor_nrms = D::totals(&findings.now).noise_floor_nrms;
    let text = files_first(&setup.findings, &case.warnings)
        + &format!("model: {}\n", case.model_description())
        + &as_it_stands(&d.baseline, noise_floor_nrms)
        + &answer(d)
        + told
        + &rest(d, next_measurement);
    let winner = d.winner().map(EffectCandidate::label);
    let only = d.apart_from_files().and(setup.taken_out().first());
    let next = match (instead, only) {
        (Some(instead), _) => instead,
        (None, Some(found)) => format!("look into {}; the model can be used", found.kind),
        (None, None) => guide.diagnosed(d.verdict, winner.as_deref(), &next_measurement.what),
    };
    Outcome::new(Document::new(findings, own), text, Some(next))
}

/// What `diagnose` found; `own`: keys of one side alone.
#[derive(Serialize)]
struct Document<'a, Own> {
    domain: Side,
    revision: Option<usize>,
    effects: Vec<String>,
    verdict: DiagnosisVerdict,
    effect: Option<&'a str>,
    site: Option<&'a str>,
    confidence: f64,
    too_little_data: Option<&'a str>,
    pairs: Option<PairsTried>,
    companion: Option<&'a str>,
    companions: &'a [String],
    best_guess: Option<String>,
    explained_share: Option<f64>,
    explained_share_std_error: Option<f64>,
    rest: RestLeft<'a>,
    candidates: Vec<Candidate<'a>>,
    indistinguishable: &'a [String],
    next_measurement: &'a NextMeasurement,
    baseline: Baseline,
    not_tried: Vec<EffectBarred<'a>>,
    setup: &'a [SetupFinding],
    warnings: &'a [String],
    #[serde(flatten)]
    own: Own,
}

impl<'a, Own> Document<'a, Own> {
    fn new<D: CampaignSide>(findings: &'a Findings<D>, own: Own) -> Self {
        let (case, d) = (&findings.case, &findings.diagnosis);
        let winner = d.winner().map(|c| &c.name);
        let [share, share_std_error] = explained_share(d).map_or([None; 2], |of| of.map(Some));
        Document {
            domain: D::SIDE,
            revision: case.revision(),
            effects: case.effects(),
            verdict: d.verdict,
            effect: winner.map(|name| name.effect.as_str()),
            site: winner.and_then(|name| name.site.as_deref()),
            confidence: d.confidence,
            too_little_data: d.too_little_data.as_deref(),
            pairs: d.pairs.map(|[tried, of]| PairsTried { tried, of }),
            companion: d.companions.first().map(String::as_str),
            companions: &d.companions,
            best_guess: d.best_guess.map(|i| d.candidates[i].label()),
            explained_share: share,
            explained_share_std_error: share_std_error,
            rest: RestLeft::of(d),
            candidates: d.candidates.iter().map(Candidate::of).collect(),
            indistinguishable: &d.indistinguishable,
            next_measurement: &findings.next_measurement,
            baseline: Baseline::of(&d.baseline, D::totals(&findings.now).noise_floor_nrms),
            not_tried: EffectBarred::all(&d.not_tried),
            setup: &findings.setup.findings,
            warnings: &case.warnings,
            own,
        }
    }
}

/// Pairs of effects that were looked at, of how many.
#[derive(Serialize)]
struct PairsTried {
    tried: usize,
    of: usize,
}

#[derive(Serialize)]
struct CuttingKeys<'a> {
    process: Process,
    lead: Option<&'a CuttingLead>,
}

#[derive(Serialize)]
struct StructureKeys<'a> {
    explains: Option<Explains<'a>>,
    residual_peaks_hz: Vec<f64>,
    residual_peaks: &'a [ResidualPeak],
    lead: Option<PlaceDrawn<'a>>,
    /// The effect that is in the model there.
    lead_beside: Option<&'a str>,
    wrong_links: Option<&'a WrongLinks>,
    joint_trends: &'a [JointTrend],
    joint_courses: &'a [JointCourse],
}

/// What the missing effect (the leading candidate where none explains the rest) takes away of the residual, and where.
#[derive(Serialize)]
struct Explains<'a> {
    effect: &'a str,
    site: Option<&'a str>,
    #[serde(flatten)]
    explained: &'a Explained,
}

impl<'a> Explains<'a> {
    fn of(findings: &'a DiagnosisFindings) -> Option<Self> {
        let name = &findings.leader()?.name;
        Some(Explains {
            effect: &name.effect,
            site: name.site.as_deref(),
            explained: &findings.leading.as_ref()?.explained,
        })
    }
}

/// The model as it stands.
#[derive(Serialize)]
struct Baseline {
    nrms: f64,
    held_out_nrms: Option<f64>,
    noise_floor_nrms: f64,
    reduced_chi2: f64,
    independent_share: f64,
}

impl Baseline {
    fn of(b: &BaselineFit, noise_floor_nrms: f64) -> Self {
        Baseline {
            nrms: b.residual.nrms,
            held_out_nrms: b.held_out.as_ref().map(HeldOut::nrms),
            noise_floor_nrms,
            reduced_chi2: b.reduced_chi2,
            independent_share: b.residual.independent_share,
        }
    }
}

#[derive(Serialize)]
struct Candidate<'a> {
    effect: &'a str,
    site: Option<&'a str>,
    nrms: f64,
    held_out_nrms: Option<f64>,
    delta_bic: f64,
    p_value: f64,
    reduced_chi2: f64,
    at_bound: bool,
    not_credible: Option<&'a str>,
    explained_share: Option<f64>,
    vanished: bool,
    refined: bool,
    parameters: BTreeMap<&'a str, ParameterValue<'a>>,
    parameter_std_errors: Vec<ParameterError<'a>>,
}

impl<'a> Candidate<'a> {
    fn of<D: Modelled>(c: &'a EffectCandidate<D>) -> Self {
        Candidate {
            effect: &c.name.effect,
            site: c.name.site.as_deref(),
            nrms: c.nrms,
            held_out_nrms: c.held_out.as_ref().map(HeldOut::nrms),
            delta_bic: c.delta_bic,
            p_value: c.p_value,
            reduced_chi2: c.reduced_chi2,
            at_bound: c.at_bound,
            not_credible: c.not_credible.as_deref(),
            explained_share: c.explained_share().map(|[share, _]| share),
            vanished: c.vanished,
            refined: c.refined,
            parameters: parameters(c),
            parameter_std_errors: c.parameters.iter().map(ParameterError::of).collect(),
        }
    }
}

/// A parameter of an effect, in its own unit.
#[derive(Serialize)]
#[serde(untagged)]
enum ParameterValue<'a> {
    One(f64),
    List(Vec<f64>),
    Choice(&'a str),
}

#[derive(Serialize)]
struct ParameterError<'a> {
    name: &'a str,
    value: f64,
    std_error: f64,
    unit: &'a str,
}

impl<'a> ParameterError<'a> {
    fn of(p: &'a Estimate) -> Self {
        ParameterError {
            name: &p.name,
            value: p.value,
            std_error: p.std_error,
            unit: p.unit,
        }
    }
}

/// The effect's own parameters by the keys of docs/json.md; `name[0]`, `name[1]`, … become one list.
fn parameters<D: Modelled>(candidate: &EffectCandidate<D>) -> BTreeMap<&str, ParameterValue<'_>> {
    let mut map = BTreeMap::new();
    for p in &candidate.parameters {
        let key = p.name.rsplit('.').next().unwrap_or(&p.name);
        match key.split_once('[') {
            Some((list, _)) => {
                let entry = map
                    .entry(list)
                    .or_insert_with(|| ParameterValue::List(Vec::new()));
                if let ParameterValue::List(values) = entry {
                    values.push(p.value);
                }
            }
            None => {
                map.insert(key, ParameterValue::One(p.value));
            }
        }
    }
    if let Some((key, value)) = &candidate.name.variant {
        map.insert(key, ParameterValue::Choice(value));
    }
    map
}

/// What is left: of the best candidate, of the model as it stands where nothing is said to be missing.
#[derive(Serialize)]
struct RestLeft<'a> {
    significant: bool,
    share: Option<f64>,
    looks_like: Option<&'static str>,
    small_errors_share: Option<f64>,
    small_errors: f64,
    beyond_small_errors: Option<&'a BeyondSlips>,
    tests: &'a [RestTest],
}

impl<'a> RestLeft<'a> {
    fn of<D: Modelled>(d: &'a Diagnosis<D>) -> Self {
        let (rest, gain) = match spoken_of(d).and_then(|c| Some((c.rest.as_ref()?, c.gain))) {
            Some((rest, gain)) => (rest, gain),
            None => (&d.baseline.rest, 0.0),
        };
        let largest = rest.largest();
        RestLeft {
            significant: rest.is_significant(),
            share: largest.map(|t| t.excess / (t.excess + gain.max(0.0))),
            looks_like: largest.map(|t| t.looks_like),
            small_errors_share: rest.share_of_slips(),
            small_errors: rest.small_errors,
            beyond_small_errors: rest.beyond_slips.as_ref(),
            tests: &rest.tests,
        }
    }
}

/// What is left by what it follows, and what usually causes that: what differed between the cuts and within them, then the lines.
fn lines_in_words(lead: &CuttingLead) -> String {
    let mut text = trends_in_words(&lead.trends);
    text += &wrapped(
        &format!(
            "A lead: what stands above the noise is {} N (root mean square); by what it follows, strongest first:",
            number(lead.above_noise_n, 3)
        ),
        "  ",
    );
    for group in lead.lines.iter().filter(|g| g.share > SMALLEST_SHARE) {
        text += &wrapped(
            &format!(
                "{}: {}, in {} of {} cuts; strongest {}",
                group.what,
                percent(group.share),
                group.cuts,
                group.of_cuts,
                group.strongest()
            ),
            "    ",
        );
        text += &wrapped(&format!("usually {}", group.usual_cause), "      ");
    }
    text
}

/// Against what the rest was held, and what it follows.
fn trends_in_words(trends: &[Trend]) -> String {
    let words = |all: &[&Trend]| {
        all.iter()
            .map(|t| t.against.words())
            .collect::<Vec<_>>()
            .join(", ")
    };
    let (follows, not): (Vec<&Trend>, Vec<&Trend>) = trends.iter().partition(|t| t.is_significant());
    let mut text = String::new();
    for trend in &follows {
        let axis = trend.axis.map_or(String::new(), |a| format!(" of {}", a.label()));
        text += &wrapped(
            &format!(
                "The rest{axis} follows {} ({} after {} tests): {}",
                trend.against.words(),
                chance(trend.p_value),
                trend.tests,
                trend.course()
            ),
            "  ",
        );
        text += &wrapped(&format!("usually {}", trend.usual_cause), "      ");
    }
    if !not.is_empty() {
        let of = if follows.is_empty() {
            "The rest follows none of"
        } else {
            "It does not follow"
        };
        text += &wrapped(&format!("{of}: {}", words(&not)), "  ");
    }
    text
}

/// The candidate that the verdict names, or the best of the library where it names none.
fn spoken_of<D: Modelled>(d: &Diagnosis<D>) -> Option<&EffectCandidate<D>> {
    let candidate = d.effect.or(d.best_guess)?;
    d.candidates.get(candidate)
}

/// Share of what stands above the noise that the verdict's effect (or the best guess) explains, and its standard deviation.
fn explained_share<D: Modelled>(d: &Diagnosis<D>) -> Option<[f64; 2]> {
    spoken_of(d)
        .filter(|_| d.companions.is_empty())
        .and_then(EffectCandidate::explained_share)
}

/// Groups of lines with less than this share of what stands above the noise are in the JSON only.
const SMALLEST_SHARE: f64 = 0.01;
/// Candidates shown to a person; all are in the JSON.
const SHOWN: usize = 8;

/// What the best candidate takes away, and where; and what the data draw where there is no name for it.
fn where_it_shows(findings: &DiagnosisFindings) -> String {
    let mut text = String::new();
    if let (Some(leading), Some(candidate)) = (&findings.leading, findings.leader()) {
        let who = match findings.diagnosis.verdict {
            DiagnosisVerdict::Unknown => format!("The best candidate, {},", candidate.label()),
            _ => "It".into(),
        };
        text += &wrapped(&leading.explained.sentence(&who), "  ");
    }
    if let Some(found) = wrong_links(findings) {
        text += &wrapped(&wrong_links_in_words(found), "  ");
    }
    if let Some(found) = place_drawn(findings) {
        let drawn = localise::in_words(found);
        let told = match drawn_beside(findings) {
            Some(beside) => format!(
                "Of what {beside} leaves {drawn}. `lobestone localise` draws it once {beside} is in the model."
            ),
            None => format!("A lead: {drawn}. `lobestone localise` draws it."),
        };
        text += &wrapped(&told, "  ");
    }
    text
}

fn wrong_links_in_words(found: &WrongLinks) -> String {
    let (beside, first) = match &found.beside {
        Some(effect) => (
            format!("{effect} and "),
            format!("after `lobestone add` of {effect}, "),
        ),
        None => (String::new(), String::new()),
    };
    format!(
        "The robot file may be wrong: with {beside}{} the model leaves {:.2} times the noise variance. Compare these numbers with a \
         drawing or the maker's data; {first}`lobestone calibrate --free links` fits them.",
        found
            .departing
            .iter()
            .map(departure)
            .collect::<Vec<_>>()
            .join(", "),
        found.reduced_chi2
    )
}

fn as_it_stands(baseline: &BaselineFit, noise_floor_nrms: f64) -> String {
    format!(
        "model as it stands: error (nrms) {}, noise floor {}, {:.2} times the noise variance\n\n",
        percent(baseline.residual.nrms),
        percent(noise_floor_nrms),
        baseline.reduced_chi2,
    )
}

/// The verdict.
fn answer<D: Modelled>(d: &Diagnosis<D>) -> String {
    let sure = format!("confidence {:.0} %", 100.0 * d.confidence);
    match (d.verdict, d.winner()) {
        (DiagnosisVerdict::Effect, Some(winner)) => {
            let effect = winner.instance.effect;
            let left: String = d
                .excuse_in_words()
                .into_iter()
                .chain(d.chosen_anew_in_words())
                .map(|words| wrapped(&words, "  "))
                .collect();
            format!(
                "{} ({sure})\n{}{}{left}",
                Emphasis::Strong.on(format!("MISSING: {}", winner.label())),
                wrapped(effect.explanation(), "  "),
                wrapped(&format!("How it shows: {}", effect.fingerprint()), "  "),
            )
        }
        (DiagnosisVerdict::None, _) => match d.baseline.rest.small_errors_in_words() {
            Some(why) => format!(
                "{} that the library knows is larger than the small errors of the setup ({sure})\n{}",
                Emphasis::Good.on("NOTHING"),
                wrapped(&format!("{}.", capitalised(&why)), "  ")
            ),
            None => format!(
                "{} is missing: what is left looks like noise ({sure})\n",
                Emphasis::Good.on("NOTHING")
            ),
        },
        _ if d.too_little_data.is_some() => format!(
            "{}: {}\n",
            Emphasis::Bad.on("NO VERDICT"),
            d.too_little_data.as_deref().unwrap_or_default()
        ),
        _ => {
            let guess = d
                .best_guess_in_words()
                .into_iter()
                .chain(d.unexplained_in_words())
                .chain(d.slips_in_words())
                .map(|words| wrapped(&words, "  "))
                .collect::<String>();
            let why = d
                .apart_from_files()
                .unwrap_or("what is left is real, but no effect of the library explains it");
            format!("{}: {why} ({sure})\n{guess}", Emphasis::Bad.on("UNKNOWN"))
        }
    }
}

/// Rivals, candidates and what to do next.
fn rest<D: Modelled>(d: &Diagnosis<D>, next_measurement: &NextMeasurement) -> String {
    let mut text = String::new();
    if let Some(besides) = d.besides_in_words() {
        text += &format!("  {besides}\n");
    }
    if !d.indistinguishable.is_empty() {
        text += &format!(
            "  This data cannot tell it from: {}\n",
            d.indistinguishable.join(", ")
        );
    }
    match d.pairs {
        Some([tried, of]) if tried < of => {
            text += &format!(
                "  Of {of} pairs of effects {tried} were tried, the likeliest first: there was no time for more\n"
            );
        }
        Some([_, of]) if d.verdict == DiagnosisVerdict::Unknown && of > 0 => {
            text += &format!("  Nor does any of {of} pairs of effects with the best of them\n");
        }
        _ => {}
    }
    let rows: Vec<Vec<String>> = d
        .candidates
        .iter()
        .take(SHOWN)
        .map(|c| {
            vec![
                c.label(),
                percent(c.nrms),
                c.held_out.as_ref().map_or("–".into(), |h| percent(h.nrms())),
                number(c.delta_bic, 4),
                if c.p_value < 1e-12 {
                    "< 1e-12".into()
                } else {
                    number(c.p_value, 2)
                },
                number(c.reduced_chi2, 3),
                c.remark().into(),
            ]
        })
        .collect();
    for (i, c) in d.candidates.iter().take(SHOWN).enumerate() {
        // Of what is not there no size need be told; what is missing with others went too far alone.
        let is_named = d.effect == Some(i) || d.companions.contains(&c.label());
        if let Some(why) = c.not_credible.as_ref().filter(|_| !c.vanished && !is_named) {
            text += &wrapped(&format!("Not {}: {why}.", c.label()), "  ");
        }
    }
    let header = ["candidate", "nrms", "held out", "ΔBIC", "p", "χ²/dof", ""];
    text += &format!(
        "\n{}\nMost telling further measurement: {}\n",
        table(&header, &rows),
        next_measurement
    );
    text + &alternatives(next_measurement)
}

/// Cheaper and more telling measurements than the one advised.
fn alternatives(next: &NextMeasurement) -> String {
    let rows: Vec<Vec<String>> = next
        .alternatives
        .iter()
        .map(|a| {
            let what = a.what.trim_start_matches("measure ");
            vec![
                number(a.cost, 3),
                format!("{:.1}", a.expected_sigmas),
                what.to_string(),
            ]
        })
        .collect();
    match rows.is_empty() {
        true => String::new(),
        false => table(&["instead", "effort", "σ"], &rows),
    }
}
