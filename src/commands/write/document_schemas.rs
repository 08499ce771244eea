//! The form of the documents that commands print with `--json`: JSON Schema, draft 4, as that of campaign files.
//!
//! The files are drawn from documents by `scripts/document_schemas.py`; tests hold documents against them, without a key left over.

/// The schema of each command's document.
pub const DOCUMENTS: [(&str, &str); 27] = [
    ("add", include_str!("documents/add.json")),
    ("batch", include_str!("documents/batch.json")),
    ("calibrate", include_str!("documents/calibrate.json")),
    ("cfc", include_str!("documents/cfc.json")),
    ("compare", include_str!("documents/compare.json")),
    ("completions", include_str!("documents/completions.json")),
    ("demo", include_str!("documents/demo.json")),
    ("diagnose", include_str!("documents/diagnose.json")),
    ("explain", include_str!("documents/explain.json")),
    ("export", include_str!("documents/export.json")),
    ("fleet", include_str!("documents/fleet.json")),
    ("history", include_str!("documents/history.json")),
    ("init", include_str!("documents/init.json")),
    ("inspect", include_str!("documents/inspect.json")),
    ("lobes", include_str!("documents/lobes.json")),
    ("localise", include_str!("documents/localise.json")),
    ("man", include_str!("documents/man.json")),
    ("modal", include_str!("documents/modal.json")),
    ("model", include_str!("documents/model.json")),
    ("plan", include_str!("documents/plan.json")),
    ("report", include_str!("documents/report.json")),
    ("schema", include_str!("documents/schema.json")),
    ("serve", include_str!("documents/serve.json")),
    ("simulate", include_str!("documents/simulate.json")),
    ("sweep", include_str!("documents/sweep.json")),
    ("thesis", include_str!("documents/thesis.json")),
    ("undo", include_str!("documents/undo.json")),
];
