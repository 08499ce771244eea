//! `lobestone explain [EFFECT]`: the library of effects in plain words.

use std::path::Path;

use serde::Serialize;

use crate::commands::Outcome;
use crate::commands::text::{Emphasis, wrapped};
use crate::data::RobotSpec;
use crate::effects::{Background, CUTTING, STRUCTURAL};
use crate::text::{closest, shown_briefly as shown};
use crate::{InputError, Result};

#[derive(clap::Args)]
pub struct ExplainArgs {
    /// The effect, as `diagnose` names it (payload, local-resonator@link-3, …); left out: a list of all.
    effect: Option<String>,
}

/// An effect as a reader meets it: what it is, how it shows, how to check it.
#[derive(Serialize)]
pub(crate) struct EffectExplained {
    domain: &'static str,
    #[serde(rename = "effect")]
    id: &'static str,
    explanation: &'static str,
    fingerprint: &'static str,
    #[serde(flatten)]
    background: Background,
    /// On the built-in robot; empty where it has no place of its own.
    sites: Vec<String>,
}

/// Every effect.
pub(crate) fn library(robot: &RobotSpec) -> Vec<EffectExplained> {
    let structural = STRUCTURAL.into_iter().map(|e| EffectExplained {
        domain: "structure",
        id: e.id(),
        explanation: e.explanation(),
        fingerprint: e.fingerprint(),
        background: e.background(),
        sites: e.sites(robot).into_iter().filter_map(|s| s.label()).collect(),
    });
    let cutting = CUTTING.into_iter().map(|e| EffectExplained {
        domain: "cutting",
        id: e.id(),
        explanation: e.explanation(),
        fingerprint: e.fingerprint(),
        background: e.background(),
        sites: Vec::new(),
    });
    structural.chain(cutting).collect()
}

#[derive(Serialize)]
struct Library<'a> {
    effects: &'a [EffectExplained],
}

pub fn run(args: ExplainArgs) -> Result<Outcome> {
    let library = library(&RobotSpec::load("irb6640", Path::new(""))?);
    let Some(name) = args.effect else {
        return Ok(Outcome::new(
            Library { effects: &library },
            list(&library),
            Some("run `lobestone explain EFFECT` for one of them".into()),
        ));
    };
    // As diagnose writes it, with its site.
    let id = name.split('@').next().unwrap_or(&name).to_lowercase();
    match library.iter().find(|e| e.id == id) {
        Some(entry) => Ok(Outcome::new(entry, entry.text(), None)),
        None => {
            let ids = library.iter().map(|e| e.id);
            let near = closest(&id, ids.clone()).or_else(|| sharing_a_word(&id, ids));
            let remedy = match near {
                Some(near) => format!("did you mean {near}? `lobestone explain` lists all"),
                None => "`lobestone explain` lists all".into(),
            };
            Err(
                InputError::new(format!("there is no effect \"{}\"", shown(&name)))
                    .key("EFFECT")
                    .remedy(remedy)
                    .into(),
            )
        }
    }
}

/// The first id that has a word of `name` in it: `wear` means `tool-wear`.
fn sharing_a_word<'a>(name: &str, ids: impl Iterator<Item = &'a str> + Clone) -> Option<&'a str> {
    let words = name.split(|c: char| !c.is_alphanumeric()).filter(|w| w.len() > 3);
    words.into_iter().find_map(|word| {
        ids.clone()
            .find(|id| id.split('-').any(|part| part.starts_with(word)))
    })
}

fn list(library: &[EffectExplained]) -> String {
    let mut text = String::new();
    for (domain, title) in [
        ("structure", "Robot and its measurement (FRFs)"),
        ("cutting", "Cutting forces and their measurement"),
    ] {
        text += &format!("{}\n", Emphasis::Strong.on(title));
        for entry in library.iter().filter(|e| e.domain == domain) {
            text += &format!("  {}\n{}", entry.id, wrapped(entry.explanation, "      "));
        }
        text += "\n";
    }
    text.pop();
    text
}

impl EffectExplained {
    fn text(&self) -> String {
        let mut text = format!("{} ({})\n", Emphasis::Strong.on(self.id), self.domain);
        let mut part = |title: &str, body: &str| {
            text += &format!("\n{}\n{}", Emphasis::Strong.on(title), wrapped(body, "  "));
        };
        part("What it is", self.explanation);
        if !self.sites.is_empty() {
            part("Where it may sit (six-axis robot)", &self.sites.join(", "));
        }
        part("How it shows", self.fingerprint);
        part("How to check it in the lab", self.background.lab_check);
        part("What measurement shows it best", self.background.best_measured);
        part("Usual sizes (rules of thumb)", self.background.typical);
        match self.background.sources {
            [] => part("Sources", "None that we vouch for: this is workshop practice."),
            sources => part("Sources", &sources.join("\n")),
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explained(name: &str) -> Result<Outcome> {
        run(ExplainArgs {
            effect: Some(name.into()),
        })
    }

    #[test]
    fn an_effect_is_explained_with_or_without_its_site() {
        for name in ["local-resonator", "local-resonator@link-3"] {
            let outcome = explained(name).unwrap();
            assert_eq!(outcome.json["effect"], "local-resonator");
            assert_eq!(outcome.json["sites"][0], "link-2");
            assert!(outcome.text.contains("Den Hartog"), "{}", outcome.text);
        }
        let outcome = explained("dynamometer-misalignment").unwrap();
        assert!(
            outcome.text.contains("None that we vouch for"),
            "{}",
            outcome.text
        );
    }

    #[test]
    fn a_strange_name_gets_its_nearest() {
        for (name, near) in [
            ("payloud", "did you mean payload?"),
            ("wear", "did you mean tool-wear?"),
            ("resonator", "did you mean local-resonator?"),
            ("zzz", "lists all"),
        ] {
            let error = explained(name).err().unwrap().to_string();
            assert!(error.contains(near), "{name}: {error}");
        }
    }
}
