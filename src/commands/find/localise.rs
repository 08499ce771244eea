use serde_json::{Map, Value, json};

use crate::Result;
use crate::campaign::Campaign;
use crate::commands::text::{Emphasis, files_first, number, percent, table};
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::localise::{BestForm, DrawnPart, Localisation, LocalisedPlace, localise};
use crate::identify::frfs::calibrate::Estimate;
use crate::identify::{Options, StructureCase};
use crate::report::figure::DrawnCurveFigure;
use crate::report::verdict_card::size;
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
            let then = form.second.as_ref().map_or(String::new(), |second| {
                format!(", then `lobestone add {dir} {}`", second.instance.label())
            });
            format!(
                "run `lobestone add {dir} {}` to put it into the model{then}",
                form.first.instance.label()
            )
        }
        _ => format!("nothing to add here; `lobestone compare {dir}` shows where the model fails"),
    };
    Ok(Outcome::new(
        document(&case, &found),
        files_first(&[], &case.warnings) + &describe(&case, &found, args.places),
        Some(next),
    ))
}

fn document(case: &StructureCase, found: &Localisation) -> Value {
    let best = found.places.first();
    let curve = best.map(|p| {
        json!({
            "place": p.spot.label(),
            "unit": p.stiffness_unit(),
            "frequency_hz": p.curve.iter().map(|c| c.frequency_hz).collect::<Vec<_>>(),
            "re": p.curve.iter().map(|c| finite(c.stiffness.re)).collect::<Vec<_>>(),
            "im": p.curve.iter().map(|c| finite(c.stiffness.im)).collect::<Vec<_>>(),
            "std": p.curve.iter().map(|c| finite(c.std)).collect::<Vec<_>>(),
        })
    });
    json!({
        "domain": "structure",
        "revision": case.revision(),
        "effects": case.effects(),
        "significant": found.significant,
        "explained_share": found.explained_share(),
        "places": found.places.iter().map(place).collect::<Vec<_>>(),
        "curve": curve,
        "baseline": {
            "reduced_chi2": found.baseline.reduced_chi2,
            "held_out_nrms": found.baseline_held_out.as_ref().map(|h| h.nrms()),
        },
        "warnings": case.warnings,
    })
}

/// JSON has no infinity: null where a line says nothing.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Values and standard errors by the parameters' own names.
fn by_name(estimates: &[Estimate]) -> (Map<String, Value>, Map<String, Value>) {
    let (mut parameters, mut errors) = (Map::new(), Map::new());
    for estimate in estimates {
        let key = estimate.name.rsplit('.').next().unwrap_or(&estimate.name);
        parameters.insert(key.to_string(), json!(estimate.value));
        errors.insert(key.to_string(), json!(estimate.std_error));
    }
    (parameters, errors)
}

/// One place for the document.
pub fn place(p: &LocalisedPlace) -> Value {
    let (parameters, errors) = by_name(p.best.as_ref().map_or(&[], |b| &b.first.parameters));
    json!({
        "place": p.spot.label(),
        "add": p.best.as_ref().map(|b| b.first.instance.label()),
        "left": p.left,
        "consistency": p.consistency,
        "held_out_nrms": p.best.as_ref().and_then(|b| b.held_out.as_ref().map(|h| h.nrms())),
        "form": p.best.as_ref().map(|b| b.first.form().label()),
        "forms": p.forms.iter().map(|f| json!({ "form": f.form.label(), "delta_bic": f.delta_bic })).collect::<Vec<_>>(),
        "parameters": parameters,
        "errors": errors,
        "delta_bic": p.best.as_ref().map(|b| b.delta_bic),
        "p_value": p.best.as_ref().map(|b| b.p_value),
        "tied_with": p.tied_with,
        "second": p.best.as_ref().and_then(|b| b.second.as_ref()).map(|second| {
            let (parameters, errors) = by_name(&second.parameters);
            json!({
                "place": second.spot.label(),
                "add": second.instance.label(),
                "form": second.form().label(),
                "parameters": parameters,
                "errors": errors,
            })
        }),
    })
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
