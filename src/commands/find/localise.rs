use std::collections::BTreeMap;

use serde::Serialize;

use crate::Result;
use crate::campaign::Campaign;
use crate::commands::text::{Emphasis, files_first, number, percent, table};
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::localise::{BestForm, DrawnPart, Localisation, LocalisedPlace, localise};
use crate::identify::frfs::calibrate::Estimate;
use crate::identify::{HeldOut, Options, StructureCase};
use crate::report::figure::DrawnCurveFigure;
use crate::report::verdict_card::{size, to_add};
use crate::revision::Side;
use crate::text::shell_word;

#[derive(clap::Args)]
pub struct LocaliseArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Places listed in the table (the document has all).
    #[arg(long, default_value_t = 10)]
    places: usize,
    /// Draw the dynamic stiffness of the best place over frequency into this PNG file.
    #[arg(long, value_name = "FILE")]
    figure: Option<std::path::PathBuf>,
}

pub fn run(args: LocaliseArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let case = StructureCase::load(&campaign)?;
    let found = localise(&case.study(Options::default()), &case.model)?;
    let dir = shell_word(&campaign.dir);
    if let (Some(file), Some(place)) = (&args.figure, found.places.first()) {
        crate::files::write_atomically(file, &DrawnCurveFigure::of(place).png()?)?;
    }
    let best = found.places.first();
    let next = match best.and_then(|p| p.best.as_ref()) {
        Some(form) if found.significant => {
            format!("run {} to put it into the model", to_add(form, &dir))
        }
        _ => format!("nothing to add here; `lobestone compare {dir}` shows where the model fails"),
    };
    Ok(Outcome::new(
        Document::new(&case, &found),
        files_first(&[], &case.warnings) + &describe(&case, &found, args.places),
        Some(next),
    ))
}

/// What `localise` found.
#[derive(Serialize)]
struct Document<'a> {
    domain: Side,
    revision: Option<usize>,
    effects: Vec<String>,
    significant: bool,
    explained_share: Option<f64>,
    places: Vec<PlaceDrawn<'a>>,
    curve: Option<CurveDrawn>,
    baseline: Baseline,
    warnings: &'a [String],
}

impl<'a> Document<'a> {
    fn new(case: &'a StructureCase, found: &'a Localisation) -> Self {
        Document {
            domain: Side::Structure,
            revision: case.revision(),
            effects: case.effects(),
            significant: found.significant,
            explained_share: found.explained_share(),
            places: found.places.iter().map(PlaceDrawn::of).collect(),
            curve: found.places.first().map(CurveDrawn::of),
            baseline: Baseline {
                reduced_chi2: found.baseline.reduced_chi2,
                held_out_nrms: found.baseline_held_out.as_ref().map(HeldOut::nrms),
            },
            warnings: &case.warnings,
        }
    }
}

/// The model as it stands.
#[derive(Serialize)]
struct Baseline {
    reduced_chi2: f64,
    held_out_nrms: Option<f64>,
}

/// The dynamic stiffness of a place over frequency, in `unit`; infinite, which JSON writes as null, where a line says nothing.
#[derive(Serialize)]
struct CurveDrawn {
    place: String,
    unit: &'static str,
    frequency_hz: Vec<f64>,
    re: Vec<f64>,
    im: Vec<f64>,
    std: Vec<f64>,
}

impl CurveDrawn {
    fn of(place: &LocalisedPlace) -> Self {
        let curve = place.curve.iter();
        CurveDrawn {
            place: place.spot.label(),
            unit: place.stiffness_unit(),
            frequency_hz: curve.clone().map(|c| c.frequency_hz).collect(),
            re: curve.clone().map(|c| c.stiffness.re).collect(),
            im: curve.clone().map(|c| c.stiffness.im).collect(),
            std: curve.map(|c| c.std).collect(),
        }
    }
}

/// One place, and what acts there.
#[derive(Serialize)]
pub(crate) struct PlaceDrawn<'a> {
    place: String,
    add: Option<String>,
    left: f64,
    consistency: f64,
    held_out_nrms: Option<f64>,
    form: Option<&'static str>,
    forms: Vec<FormTried>,
    parameters: ByName<'a>,
    errors: ByName<'a>,
    delta_bic: Option<f64>,
    p_value: Option<f64>,
    tied_with: &'a [String],
    second: Option<SecondDrawn<'a>>,
}

impl<'a> PlaceDrawn<'a> {
    pub fn of(p: &'a LocalisedPlace) -> Self {
        let best = p.best.as_ref();
        let (parameters, errors) = best.map(|b| by_name(&b.first.parameters)).unwrap_or_default();
        PlaceDrawn {
            place: p.spot.label(),
            add: best.and_then(|b| b.requests().into_iter().next()),
            left: p.left,
            consistency: p.consistency,
            held_out_nrms: best.and_then(|b| b.held_out.as_ref().map(HeldOut::nrms)),
            form: best.map(|b| b.first.form().label()),
            forms: p
                .forms
                .iter()
                .map(|f| FormTried {
                    form: f.form.label(),
                    delta_bic: f.delta_bic,
                })
                .collect(),
            parameters,
            errors,
            delta_bic: best.map(|b| b.delta_bic),
            p_value: best.map(|b| b.p_value),
            tied_with: &p.tied_with,
            second: best.and_then(SecondDrawn::of),
        }
    }
}

#[derive(Serialize)]
struct FormTried {
    form: &'static str,
    delta_bic: f64,
}

/// What acts along another displacement of the same place.
#[derive(Serialize)]
struct SecondDrawn<'a> {
    place: String,
    add: String,
    form: &'static str,
    parameters: ByName<'a>,
    errors: ByName<'a>,
}

impl<'a> SecondDrawn<'a> {
    fn of(best: &'a BestForm) -> Option<Self> {
        let (second, add) = (best.second.as_ref()?, best.requests().pop()?);
        let (parameters, errors) = by_name(&second.parameters);
        Some(SecondDrawn {
            place: second.spot.label(),
            add,
            form: second.form().label(),
            parameters,
            errors,
        })
    }
}

/// Numbers by the parameters' own names.
type ByName<'a> = BTreeMap<&'a str, f64>;

/// Values and standard errors.
fn by_name(estimates: &[Estimate]) -> (ByName<'_>, ByName<'_>) {
    let each = estimates.iter().map(|e| {
        let key = e.name.rsplit('.').next().unwrap_or(&e.name);
        ((key, e.value), (key, e.std_error))
    });
    each.unzip()
}

fn describe(case: &StructureCase, found: &Localisation, most: usize) -> String {
    let mut text = format!("model: {}\n\n", case.model_description());
    if let Some((p, best)) = found.places.first().and_then(|p| Some((p, p.best.as_ref()?))) {
        text += &match found.significant {
            true => format!(
                "{}: {}\n",
                Emphasis::Strong.on("The data draw"),
                drawn_in_words(best)
            ),
            false => format!(
                "{}: no place explains more than chance\n",
                Emphasis::Strong.on("The data draw nothing")
            ),
        };
        if found.significant && !p.tied_with.is_empty() {
            text += &format!(
                "tied with {}: this data cannot tell them apart\n",
                p.tied_with.join(", ")
            );
        }
        if let Some(share) = found.partial_share().filter(|_| found.significant) {
            text += &format!(
                "that explains {} of what stands above the noise: it is not all, or not the place\n",
                percent(share)
            );
        }
        text += &format!(
            "left of the misfit {} (1 is noise; {} without it)\n",
            number(p.left, 3),
            number(found.baseline.reduced_chi2, 3)
        );
        if let (Some(with), Some(without)) = (&best.held_out, &found.baseline_held_out) {
            text += &format!(
                "error on postures left out {} -> {}\n",
                percent(without.nrms()),
                percent(with.nrms())
            );
        }
        text.push('\n');
    }
    let rows: Vec<Vec<String>> = found
        .places
        .iter()
        .take(most)
        .map(|p| {
            vec![
                p.spot.label(),
                number(p.left, 4),
                number(p.consistency, 3),
                p.best
                    .as_ref()
                    .map_or("–".into(), |b| b.first.form().label().replace('-', " ")),
                p.best.as_ref().map_or(String::new(), all_values),
                p.tied_with.join(", "),
            ]
        })
        .collect();
    text += &table(
        &["place", "left", "scatter", "form", "parameters", "tied with"],
        &rows,
    );
    text += "left: misfit over noise, 1 is noise; scatter: of the drawn stiffness over postures, 1 if it is the same everywhere\n";
    text
}

fn values(part: &DrawnPart) -> String {
    part.parameters.iter().map(size).collect::<Vec<_>>().join(", ")
}

/// Values of the form of a place, and what acts there besides.
fn all_values(best: &BestForm) -> String {
    let besides = best.second.iter().map(|part| {
        format!(
            "; {}: {} {}",
            part.spot.label(),
            part.form().words(),
            values(part)
        )
    });
    values(&best.first) + &besides.collect::<String>()
}

/// What the data draw, as a sentence without its end.
pub fn in_words(found: &Localisation) -> String {
    let best = found.places.first().and_then(|p| Some((p, p.best.as_ref()?)));
    best.map_or_else(
        || "no place explains more than chance".into(),
        |(p, best)| {
            let before = found.baseline.reduced_chi2;
            format!(
                "the data draw {}, which leaves {:.2} times the noise variance of {before:.2}{}",
                drawn_in_words(best),
                p.left,
                match found.partial_share() {
                    Some(_) => ": not all, or not the place",
                    None => "",
                }
            )
        },
    )
}

fn drawn_in_words(best: &BestForm) -> String {
    best.in_words(|part| format!(" ({})", values(part)))
}
