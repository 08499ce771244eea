//! What a diagnosis found, kept until an effect is added: `lobestone/diagnoses.json` in the campaign's folder.
//!
//! `add` writes it into its revision, so that a report can say later why the effect is in the model. One diagnosis a side
//! is kept, the last one, and it counts only for the data and the model that it was made of.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::folder::FOLDER;
use crate::files::write_atomically;
use crate::identify::model_history::{Evidence, RecordedEffect, Side};
use crate::{Error, Result};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Entry {
    domain: Side,
    /// Fingerprint of the data.
    data: String,
    /// In the model that was diagnosed.
    effects: Vec<RecordedEffect>,
    evidence: Evidence,
}

fn file(campaign_dir: &Path) -> std::path::PathBuf {
    campaign_dir.join(FOLDER).join("diagnoses.json")
}

/// A file that is not there or not readable holds nothing: it is a help and nothing more.
fn entries(campaign_dir: &Path) -> Vec<Entry> {
    let bytes = std::fs::read(file(campaign_dir)).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}

/// Keeps a diagnosis of one side, made of `data` (a fingerprint) and a model with `effects`, in place of the last one.
///
/// # Errors
/// What the file system refuses.
pub fn keep(
    campaign_dir: &Path,
    domain: Side,
    (data, effects): (String, Vec<RecordedEffect>),
    evidence: Evidence,
) -> Result<()> {
    let mut all = entries(campaign_dir);
    all.retain(|e| e.domain != domain);
    all.push(Entry {
        domain,
        data,
        effects,
        evidence,
    });
    let path = file(campaign_dir);
    let folder = campaign_dir.join(FOLDER);
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, e))?;
    let mut text = serde_json::to_string_pretty(&all)
        .map_err(|e| Error::computation(format!("the diagnosis cannot be written: {e}")))?;
    text.push('\n');
    write_atomically(&path, text.as_bytes())
}

/// What was kept of these data and this model.
pub fn recall(campaign_dir: &Path, domain: Side, data: &str, effects: &[RecordedEffect]) -> Option<Evidence> {
    let all = entries(campaign_dir).into_iter();
    let mut own = all.filter(|e| e.domain == domain && e.data == data && e.effects == effects);
    own.next().map(|e| e.evidence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::model_history::RecordedCandidate;
    use crate::revision::now;

    fn evidence(confidence: f64) -> Evidence {
        Evidence {
            verdict: "effect".into(),
            effect: Some("payload".into()),
            confidence,
            candidates: vec![RecordedCandidate {
                effect: "payload".into(),
                variant: None,
                nrms: Some(0.02),
                held_out_nrms: None,
                delta_bic: Some(-900.0),
                p_value: Some(0.0),
                reduced_chi2: Some(1.01),
                remark: String::new(),
            }],
            when: now(),
        }
    }

    #[test]
    fn it_counts_for_its_own_data_model_and_side_only() {
        let dir = tempfile::tempdir().unwrap();
        let payload = RecordedEffect {
            effect: "payload".into(),
            variant: None,
        };
        let of = |data: &str, effects: &[RecordedEffect]| recall(dir.path(), Side::Structure, data, effects);
        assert_eq!(of("a", &[]), None);
        keep(dir.path(), Side::Structure, ("a".into(), vec![]), evidence(0.9)).unwrap();
        keep(dir.path(), Side::Cutting, ("a".into(), vec![]), evidence(0.5)).unwrap();
        assert_eq!(of("a", &[]).unwrap().confidence, 0.9);
        assert_eq!(of("b", &[]), None);
        assert_eq!(of("a", std::slice::from_ref(&payload)), None);
        keep(
            dir.path(),
            Side::Structure,
            ("a".into(), vec![payload.clone()]),
            evidence(0.7),
        )
        .unwrap();
        assert_eq!(of("a", &[]), None, "the last one only");
        assert_eq!(of("a", &[payload]).unwrap().confidence, 0.7);
        assert_eq!(
            recall(dir.path(), Side::Cutting, "a", &[]).unwrap().confidence,
            0.5
        );
        std::fs::write(file(dir.path()), "{").unwrap();
        assert_eq!(recall(dir.path(), Side::Cutting, "a", &[]), None);
        keep(dir.path(), Side::Cutting, ("c".into(), vec![]), evidence(0.6)).unwrap();
        assert!(recall(dir.path(), Side::Cutting, "c", &[]).is_some());
    }
}
