//! What a command hands back.

use serde::Serialize;

use super::text;

/// What a command has to say: the document of docs/json.md, and the same for a person.
pub struct Outcome {
    /// Printed with `--json`; null where there is nothing to say (any more).
    pub json: serde_json::Value,
    /// Printed without; may be coloured.
    pub text: String,
    /// What failed although there is something to say: told on stderr, and the status is 1.
    pub failed: Option<crate::Error>,
}

impl Outcome {
    /// With the next sensible step: `next_step` in the document, the last line of the text.
    pub fn new(document: impl Serialize, mut text: String, next_step: Option<String>) -> Self {
        // Only a path that is no Unicode cannot be written as JSON.
        let (mut json, failed) = match serde_json::to_value(document) {
            Ok(json) => (json, None),
            Err(error) => {
                let why = format!("the document cannot be written as JSON: {error}");
                (serde_json::Value::Null, Some(crate::Error::computation(why)))
            }
        };
        if let Some(step) = next_step.as_ref().filter(|_| !crate::progress::is_silent()) {
            text += &format!("\n{} {step}\n", text::Emphasis::Strong.on("Next:"));
        }
        json["next_step"] = next_step.into();
        Outcome { json, text, failed }
    }
}
