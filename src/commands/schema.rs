//! `lobestone schema`: the form of the files, for editors.

use super::Outcome;
use crate::campaign::{SchemaOf, json_schema};
use crate::{Error, Result};

#[derive(clap::Args)]
#[command(after_help = "Example:\n  lobestone schema campaign > campaign.schema.json\n\
                  and as the first line of campaign.toml, for editors with taplo (Even Better TOML):\n  \
                  #:schema ../campaign.schema.json")]
pub struct SchemaArgs {
    /// Of which file.
    #[arg(value_enum)]
    of: SchemaOf,
}

/// The same with and without `--json`.
pub fn run(args: SchemaArgs) -> Result<Outcome> {
    let json = json_schema(args.of);
    let text = serde_json::to_string_pretty(&json).map_err(|e| Error::computation(e.to_string()))?;
    Ok(Outcome {
        text: text + "\n",
        json,
        failed: None,
    })
}
