//! The rows of a batch as a table: CSV, and Parquet where that is built in.
//!
//! First `campaign`, `robot`, `date` and whatever else the manifest has, then `RESULTS`, then the quantities, each with
//! its standard error behind it.

use std::collections::BTreeSet;
use std::path::Path;

use crate::analysis::many::batch::{BatchQuantity, Manifest, ManifestEntry, Record, SideResult};
use crate::analysis::many::fleet::{FleetRow, FleetVerdict};
use crate::{Error, InputError, Result};

/// Columns that stand first: of the manifest, or else of `campaign.toml`.
const FIRST: [&str; 3] = ["campaign", "robot", "date"];
/// Columns of what every row has.
const RESULTS: [&str; 18] = [
    "line",
    "command",
    "domain",
    "status",
    "error",
    "seconds",
    "version",
    "fingerprint",
    "nrms",
    "noise",
    "held_out_nrms",
    "converged",
    "verdict",
    "effect",
    "site",
    "confidence",
    STARTED_FROM,
    "setup",
];
/// The campaign whose calibration this one started from. Tables of earlier versions have it not.
const STARTED_FROM: &str = "started_from";
/// Those of them that are numbers; quantities are, too.
#[cfg(feature = "parquet")]
const NUMBERS: [&str; 6] = ["line", "seconds", "nrms", "noise", "held_out_nrms", "confidence"];
const STD_ERROR: &str = "_std_error";

/// Names that no column of a manifest may have.
pub fn reserved() -> &'static [&'static str] {
    &RESULTS
}

/// A table whose cells are text; an empty one: nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BatchTable {
    pub columns: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl BatchTable {
    /// A row a side of each campaign, in the order of the entries.
    pub fn new(manifest: &Manifest, work: &[(&ManifestEntry, Record)]) -> Self {
        let carried = manifest.columns.iter().filter(|c| !FIRST.contains(&c.as_str()));
        let quantities: BTreeSet<&str> = work
            .iter()
            .flat_map(|(_, record)| &record.sides)
            .flat_map(|side| &side.findings.quantities)
            .map(|q| q.name.as_str())
            .collect();
        let mut columns: Vec<String> = FIRST.iter().map(|c| c.to_string()).collect();
        columns.extend(carried.clone().cloned());
        columns.extend(RESULTS.iter().map(|c| c.to_string()));
        for name in &quantities {
            columns.extend([name.to_string(), format!("{name}{STD_ERROR}")]);
        }
        let mut rows = Vec::new();
        for (entry, record) in work {
            let said = |column: &str, else_said: &Option<String>| {
                let cell = manifest.cell(entry, column).map(str::to_string);
                cell.or_else(|| else_said.clone()).unwrap_or_default()
            };
            let mut head = vec![
                entry.campaign.clone(),
                said("robot", &record.robot),
                said("date", &record.date),
            ];
            head.extend(
                carried
                    .clone()
                    .map(|c| manifest.cell(entry, c).unwrap_or_default().to_string()),
            );
            for side in &record.sides {
                let results = RESULTS.iter().map(|column| cell(column, entry, record, side));
                let found = quantities.iter().flat_map(|name| {
                    let all = &side.findings.quantities;
                    let found = all.iter().find(|q| q.name == *name);
                    let number = |pick: fn(&BatchQuantity) -> Option<f64>| text(found.and_then(pick));
                    [number(|q| q.value), number(|q| q.std_error)]
                });
                rows.push(head.iter().cloned().chain(results).chain(found).collect());
            }
        }
        BatchTable { columns, rows }
    }

    /// CSV as RFC 4180 has it, with line feeds.
    ///
    /// # Errors
    /// There is none while writing to memory.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let failed = |e: csv::Error| Error::computation(e.to_string());
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(&self.columns).map_err(failed)?;
        for row in &self.rows {
            writer.write_record(row).map_err(failed)?;
        }
        writer.into_inner().map_err(|e| Error::computation(e.to_string()))
    }

    /// Reads what [`csv`](Self::csv) wrote.
    ///
    /// # Errors
    /// A file that cannot be read, or is no table of a batch.
    pub fn read(file: &Path) -> Result<Self> {
        let bytes = std::fs::read(file).map_err(|e| Error::io(file, e))?;
        let broken = |problem: String| -> Error {
            InputError::new(problem)
                .file(file)
                .remedy("take the file away and run the shard again: what is done is not done again")
                .into()
        };
        let mut reader = csv::Reader::from_reader(bytes.as_slice());
        let not_csv = |e: csv::Error| broken(format!("not a CSV table: {e}"));
        let columns: Vec<String> = reader
            .headers()
            .map_err(not_csv)?
            .iter()
            .map(str::to_string)
            .collect();
        if let Some(lacking) = FIRST
            .iter()
            .chain(&RESULTS)
            .find(|c| **c != STARTED_FROM && !columns.iter().any(|n| n == *c))
        {
            return Err(broken(format!(
                "not a table of a batch: there is no column {lacking}"
            )));
        }
        let rows = reader
            .records()
            .map(|row| Ok(row.map_err(not_csv)?.iter().map(str::to_string).collect()))
            .collect::<Result<Vec<Vec<String>>>>()?;
        Ok(BatchTable { columns, rows })
    }

    /// All tables as one: every column that any has, rows in the order of the manifest. How many tables there were does
    /// not show.
    pub fn merged(tables: &[BatchTable]) -> Self {
        let mut carried: Vec<&str> = Vec::new();
        let mut quantities = BTreeSet::new();
        for table in tables {
            for name in table.carried() {
                if !carried.contains(&name) {
                    carried.push(name);
                }
            }
            quantities.extend(table.quantities());
        }
        let mut columns: Vec<String> = FIRST.iter().map(|c| c.to_string()).collect();
        columns.extend(carried.iter().map(|c| c.to_string()));
        columns.extend(RESULTS.iter().map(|c| c.to_string()));
        for name in quantities {
            columns.extend([name.to_string(), format!("{name}{STD_ERROR}")]);
        }
        let mut rows: Vec<Vec<String>> = Vec::new();
        for table in tables {
            let from: Vec<Option<usize>> = columns.iter().map(|c| table.index(c)).collect();
            rows.extend(table.rows.iter().map(|row| {
                let cell = |i: &Option<usize>| i.and_then(|i| row.get(i)).cloned().unwrap_or_default();
                from.iter().map(cell).collect()
            }));
        }
        let mut merged = BatchTable { columns, rows };
        let (line, domain) = (merged.index("line"), merged.index("domain"));
        merged.rows.sort_by_key(|row| {
            let cell = |i: Option<usize>| i.and_then(|i| row.get(i)).cloned().unwrap_or_default();
            let number: usize = cell(line).parse().unwrap_or(usize::MAX);
            // The structure before the cuts, as `batch` has them.
            (number, std::cmp::Reverse(cell(domain)))
        });
        merged
    }

    fn index(&self, column: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == column)
    }

    /// Columns of the manifest besides the first three.
    fn carried(&self) -> impl Iterator<Item = &str> {
        let behind = self.index(RESULTS[0]).unwrap_or(0);
        self.columns[..behind]
            .iter()
            .map(String::as_str)
            .filter(|c| !FIRST.contains(c))
    }

    fn quantities(&self) -> impl Iterator<Item = &str> {
        let last = self
            .index(RESULTS[RESULTS.len() - 1])
            .map_or(self.columns.len(), |i| i + 1);
        self.columns[last..]
            .iter()
            .map(String::as_str)
            .filter(|c| !c.ends_with(STD_ERROR))
    }

    /// The rows as a fleet is made of. A campaign without a robot belongs to one of no name.
    pub fn fleet_rows(&self) -> Vec<FleetRow> {
        let quantities: Vec<(&str, Option<usize>, Option<usize>)> = self
            .quantities()
            .map(|name| (name, self.index(name), self.index(&format!("{name}{STD_ERROR}"))))
            .collect();
        let of_row = |row: &Vec<String>| {
            let at = |i: Option<usize>| i.and_then(|i| row.get(i)).filter(|c| !c.is_empty());
            let text = |column: &str| at(self.index(column)).cloned();
            let number = |i: Option<usize>| {
                at(i)
                    .and_then(|c| c.parse::<f64>().ok())
                    .filter(|v| v.is_finite())
            };
            let of = |column: &str| number(self.index(column));
            let failed = text("status").as_deref() == Some("failed");
            FleetRow {
                campaign: text("campaign").unwrap_or_default(),
                robot: text("robot").unwrap_or_else(|| "(no robot)".into()),
                date: text("date"),
                line: text("line").and_then(|l| l.parse().ok()).unwrap_or(usize::MAX),
                domain: text("domain").unwrap_or_default(),
                error: failed.then(|| text("error").unwrap_or_else(|| "failed".into())),
                verdict: text("verdict").map(|verdict| FleetVerdict {
                    verdict,
                    effect: text("effect"),
                    site: text("site"),
                    confidence: of("confidence"),
                }),
                nrms: of("nrms"),
                noise: of("noise"),
                setup: text("setup"),
                quantities: quantities
                    .iter()
                    .filter_map(|(name, value, error)| {
                        Some((name.to_string(), number(*value)?, number(*error)))
                    })
                    .collect(),
            }
        };
        self.rows.iter().map(of_row).collect()
    }
}

fn cell(column: &str, entry: &ManifestEntry, record: &Record, side: &SideResult) -> String {
    let found = &side.findings;
    let said = |value: &Option<String>| value.clone().unwrap_or_default();
    match column {
        "line" => entry.line.to_string(),
        "command" => record.command.clone(),
        "domain" => side.domain.clone(),
        "status" => side.status.name().to_string(),
        "error" => said(&side.error),
        "seconds" => text(Some(side.seconds)),
        "version" => record.version.clone(),
        "fingerprint" => record.fingerprint.clone(),
        "nrms" => text(found.nrms),
        "noise" => text(found.noise),
        "held_out_nrms" => text(found.held_out_nrms),
        "converged" => found.converged.map_or(String::new(), |c| c.to_string()),
        "verdict" => said(&found.verdict),
        "effect" => said(&found.effect),
        "site" => said(&found.site),
        "confidence" => text(found.confidence),
        STARTED_FROM => said(&found.started_from),
        "setup" => found.setup.join("\n"),
        _ => String::new(),
    }
}

/// The shortest form that reads back the same; nothing for nothing.
fn text(value: Option<f64>) -> String {
    value
        .filter(|v| v.is_finite())
        .map_or(String::new(), |v| format!("{v:?}"))
}

#[cfg(feature = "parquet")]
mod parquet {
    use polars::prelude::{Column, DataFrame, ParquetWriter, PolarsResult};

    use super::{BatchTable, NUMBERS, RESULTS};
    use crate::{Error, Result};

    impl BatchTable {
        /// The same as a Parquet table: numbers as numbers, nothing as null.
        ///
        /// # Errors
        /// polars', which would be a fault of this program.
        pub fn parquet(&self) -> Result<Vec<u8>> {
            let failed = |e| Error::computation(format!("the table of a batch: {e}"));
            let mut frame = self.frame().map_err(failed)?;
            let mut bytes = Vec::new();
            ParquetWriter::new(&mut bytes)
                .finish(&mut frame)
                .map_err(failed)?;
            Ok(bytes)
        }

        fn frame(&self) -> PolarsResult<DataFrame> {
            let behind = self.index(RESULTS[RESULTS.len() - 1]).unwrap_or(usize::MAX);
            let columns = self.columns.iter().enumerate().map(|(i, name)| {
                let cells = self
                    .rows
                    .iter()
                    .map(|row| row.get(i).map(String::as_str).filter(|c| !c.is_empty()));
                match i > behind || NUMBERS.contains(&name.as_str()) {
                    true => {
                        let numbers: Vec<Option<f64>> =
                            cells.map(|c| c.and_then(|c| c.parse().ok())).collect();
                        Column::new(name.as_str().into(), numbers)
                    }
                    false => Column::new(name.as_str().into(), cells.collect::<Vec<Option<&str>>>()),
                }
            });
            DataFrame::new_infer_height(columns.collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::many::batch::{BatchFindings, Status};

    fn manifest() -> Manifest {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m.csv");
        std::fs::write(
            &file,
            "campaign,shift,robot\na,late,r1\nb,,\nc,\"x, \"\"y\"\"\",r2\n",
        )
        .unwrap();
        Manifest::read(&file, reserved()).unwrap()
    }

    fn record(campaign: &str, quantity: &str) -> Record {
        let side = |domain: &str, status, error: Option<&str>| SideResult {
            domain: domain.into(),
            status,
            error: error.map(str::to_string),
            seconds: 0.25,
            findings: BatchFindings {
                nrms: Some(0.1 + 0.2),
                quantities: vec![BatchQuantity {
                    name: quantity.into(),
                    value: Some(1.5e9),
                    std_error: None,
                }],
                ..BatchFindings::default()
            },
        };
        Record {
            campaign: campaign.into(),
            fingerprint: "f".into(),
            version: "1".into(),
            command: "calibrate,diagnose".into(),
            robot: Some("irb6640".into()),
            date: Some("2026-11-01".into()),
            sides: vec![
                side("structure", Status::Done, None),
                side("cutting", Status::Failed, Some("line one\nremedy: \"two\"")),
            ],
        }
    }

    #[test]
    fn tables_of_shards_are_the_table_of_all() {
        let manifest = manifest();
        let [a, b, c] = &manifest.entries[..] else {
            panic!("{manifest:?}");
        };
        let records = [
            (a, record("a", "k.one")),
            (b, record("b", "k.two")),
            (c, record("c", "k.one")),
        ];
        let whole = BatchTable::new(&manifest, &records);
        let first = BatchTable::new(&manifest, &[records[0].clone(), records[2].clone()]);
        let second = BatchTable::new(&manifest, &records[1..2]);
        assert_ne!(first.columns, second.columns);
        assert_eq!(BatchTable::merged(&[second, first]), whole);
        assert_eq!(BatchTable::merged(std::slice::from_ref(&whole)), whole);

        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.csv");
        std::fs::write(&file, whole.csv().unwrap()).unwrap();
        assert_eq!(BatchTable::read(&file).unwrap(), whole);
        std::fs::write(&file, "campaign,robot\na,b\n").unwrap();
        let message = BatchTable::read(&file).unwrap_err().to_string();
        assert!(message.contains("there is no column date"), "{message}");
    }

    #[test]
    fn rows_come_back_as_they_went_in() {
        let manifest = manifest();
        let b = &manifest.entries[1];
        let rows = BatchTable::new(&manifest, &[(b, record("b", "k.one"))]).fleet_rows();
        assert_eq!(
            (rows[0].robot.as_str(), rows[0].date.as_deref()),
            ("irb6640", Some("2026-11-01"))
        );
        assert_eq!((rows[0].nrms, rows[0].line), (Some(0.1 + 0.2), 3));
        assert_eq!(rows[0].quantities, [("k.one".to_string(), 1.5e9, None)]);
        assert_eq!(rows[0].error, None);
        assert_eq!(rows[1].error.as_deref(), Some("line one\nremedy: \"two\""));
    }
}
