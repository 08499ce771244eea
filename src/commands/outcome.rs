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
        let mut json = serde_json::json!(document);
        if let Some(step) = next_step.as_ref().filter(|_| !crate::progress::is_silent()) {
            text += &format!("\n{} {step}\n", text::Emphasis::Strong.on("Next:"));
        }
        json["next_step"] = next_step.into();
        Outcome {
            json,
            text,
            failed: None,
        }
    }
}
