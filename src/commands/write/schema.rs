//! `lobestone schema`: the form of the files, for editors, and of the documents, for programs that read them.

use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser};

use crate::campaign::SchemaOf;
use crate::campaign::json_schema;
use crate::commands::Outcome;
use crate::commands::write::document_schemas::DOCUMENTS;
use crate::{Error, Result};

#[derive(clap::Args)]
#[command(after_help = "Example:\n  lobestone schema campaign > campaign.schema.json\n\
                  and as the first line of campaign.toml, for editors with taplo (Even Better TOML):\n  \
                  #:schema ../campaign.schema.json\n\
                  The document that diagnose prints with --json:\n  \
                  lobestone schema diagnose > diagnose.schema.json")]
pub struct SchemaArgs {
    /// Of which file, or of which command's document.
    #[arg(value_parser = PossibleValuesParser::new(names()), value_name = "FILE|COMMAND", hide_possible_values = true)]
    of: String,
}

/// Those of files and of documents.
fn names() -> Vec<PossibleValue> {
    let files = SchemaOf::value_variants()
        .iter()
        .filter_map(ValueEnum::to_possible_value);
    let documents = DOCUMENTS.iter().map(|(name, _)| PossibleValue::new(*name));
    files.chain(documents).collect()
}

/// The same with and without `--json`.
pub fn run(args: SchemaArgs) -> Result<Outcome> {
    let failed = |e: serde_json::Error| Error::computation(e.to_string());
    let file = SchemaOf::value_variants()
        .iter()
        .find(|of| of.to_possible_value().is_some_and(|v| v.matches(&args.of, false)));
    let document = DOCUMENTS.iter().find(|(name, _)| *name == args.of);
    let json = match (file, document) {
        (Some(of), _) => json_schema(*of),
        (None, Some((_, text))) => serde_json::from_str(text).map_err(failed)?,
        // The command line takes no other name.
        (None, None) => return Err(Error::computation(format!("there is no schema of {}", args.of))),
    };
    let text = serde_json::to_string_pretty(&json).map_err(failed)?;
    Ok(Outcome {
        text: text + "\n",
        json,
        failed: None,
    })
}
