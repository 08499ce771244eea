//! The measured FRFs of a campaign, as receptance between its points.

use std::path::PathBuf;

use num_complex::Complex64;
use rayon::prelude::*;

use super::schema::{Campaign, FrfFile};
use crate::campaign::form::paths::campaign_file;
use crate::data::{Dof, FrfRecord, FrfSet, MeasuredDof, MeasuredFrf, Quantity};
use crate::ingest::{Digest, MeasurementFile, read_frf_file};
use crate::text::shown_briefly as shown;
use crate::{InputError, Result};

/// What the `[[frf]]` files of a campaign hold.
#[derive(Debug, Clone)]
pub struct FrfFiles {
    /// As receptance between the campaign's points.
    pub set: FrfSet,
    /// What was noticed while reading.
    pub warnings: Vec<String>,
    /// Of each file, in the order of `campaign.toml`.
    pub digests: Vec<Digest>,
}

impl Campaign {
    /// Reads every `[[frf]]` file and converts it to receptance; second: warnings.
    ///
    /// # Errors
    /// As [`read_frf_files`](Self::read_frf_files).
    pub fn load_frfs(&self) -> Result<(FrfSet, Vec<String>)> {
        let files = self.read_frf_files()?;
        Ok((files.set, files.warnings))
    }

    /// Reads every `[[frf]]` file and converts it to receptance.
    ///
    /// # Errors
    /// The first file (in the order of `campaign.toml`) that cannot be read, does not say what it holds, or names
    /// a node without a `[[point]]`.
    pub fn read_frf_files(&self) -> Result<FrfFiles> {
        // Read in parallel, but looked at in order: result and first error do not depend on the threads.
        let read = self.frfs.par_iter().map(|frf| read_frf_file(&frf.file));
        let read: Vec<Result<MeasurementFile>> = read.collect();
        let (mut contents, mut digests) = (Vec::new(), Vec::new());
        for file in read {
            let file = file?;
            contents.push((file.contents.frfs, file.warnings));
            digests.push(file.digest);
        }
        let (set, warnings) = self.collect_frfs(&contents)?;
        Ok(FrfFiles {
            set,
            warnings,
            digests,
        })
    }

    /// Takes the records of each `[[frf]]` file (same order) to one set.
    fn collect_frfs(&self, files: &[FrfContents]) -> Result<(FrfSet, Vec<String>)> {
        let mut set = FrfSet::default();
        let mut warnings = Vec::new();
        for (i, (frf, (records, notes))) in self.frfs.iter().zip(files).enumerate() {
            let shown_file = frf.file.display();
            warnings.extend(
                notes
                    .iter()
                    .map(|note| match note.starts_with(&shown_file.to_string()) {
                        true => note.clone(),
                        false => format!("{shown_file}: {note}"),
                    }),
            );
            if records.is_empty() {
                return Err(self.complaint(i, "file", "holds no FRF", "list force records under [[cut]]"));
            }
            let mut facts = FileFacts::default();
            for record in records {
                let measured = self.measured(i, frf, record, &mut facts)?;
                // A dead channel is no rigid structure: it must neither be fitted nor give endless stability.
                if measured.receptance_m_per_n.iter().all(|h| *h == Complex64::ZERO) {
                    facts.dead.push(measured.name);
                } else {
                    set.frfs.push(measured);
                }
            }
            if facts.dead.len() == records.len() {
                let problem = "is zero on every line: a dead channel";
                return Err(self.complaint(i, "file", problem, "measure it again, or take this [[frf]] out"));
            }
            warnings.extend(facts.warnings(frf));
        }
        for (later, earlier) in identical(files) {
            let (later, earlier) = (&self.frfs[later], &self.frfs[earlier]);
            if later.posture == earlier.posture {
                continue;
            }
            let id = |posture: usize| self.postures.get(posture).map_or("", |p| &p.id);
            warnings.push(format!(
                "{}: the same data as {}: though postures {} and {} differ",
                later.file.display(),
                earlier.file.display(),
                id(earlier.posture),
                id(later.posture)
            ));
        }
        warnings.extend(drop_copies(&mut set.frfs));
        Ok((set, warnings))
    }

    fn measured(
        &self,
        i: usize,
        frf: &FrfFile,
        record: &FrfRecord,
        facts: &mut FileFacts,
    ) -> Result<MeasuredFrf> {
        let (Some(response), Some(reference)) = (record.response, record.reference) else {
            return Err(self.complaint(
                i,
                "file",
                "does not say at which node and in which direction it was measured",
                "name the columns re(1X/1X),im(1X/1X): response node and direction / excitation node and direction",
            ));
        };
        let name = format!("{response}/{reference}");
        let quantity = match (frf.quantity, record.quantity) {
            (Some(campaign), Some(file)) if campaign != file => {
                facts.contradiction.get_or_insert((file, campaign));
                campaign
            }
            (Some(quantity), _) | (None, Some(quantity)) => quantity,
            (None, None) => {
                return Err(self.complaint(
                    i,
                    "quantity",
                    "missing, and the file does not say whether it holds receptance, mobility or accelerance",
                    "add quantity = \"receptance\" (or \"mobility\", \"accelerance\") to this [[frf]]",
                ));
            }
        };
        let converted = to_receptance(record, quantity).map_err(|problem| {
            self.complaint(
                i,
                "file",
                &format!("{name} {problem}"),
                "export the file again, or leave it out",
            )
        })?;
        facts.static_lines |= converted.static_lines > 0;
        Ok(MeasuredFrf {
            posture: frf.posture,
            response: self.point_of(i, response, &name)?,
            reference: self.point_of(i, reference, &name)?,
            name: match self.postures.get(frf.posture) {
                Some(posture) => format!("{} {name}", posture.id),
                None => name,
            },
            frequency_hz: converted.frequency_hz,
            receptance_m_per_n: converted.receptance_m_per_n,
            coherence: converted.coherence,
            force_level_n: frf.force_level_n,
            file: frf.file.clone(),
        })
    }

    fn point_of(&self, i: usize, dof: Dof, name: &str) -> Result<MeasuredDof> {
        match self.points.iter().position(|point| point.node == dof.node) {
            Some(point) => Ok(MeasuredDof {
                point,
                axis: dof.axis,
                negative: dof.negative,
            }),
            None => Err(self.complaint(
                i,
                "file",
                &format!("{name} was measured at node {}, which has no [[point]]", dof.node),
                &format!(
                    "add a [[point]] with node = {}, body, position_m and axes to campaign.toml",
                    dof.node
                ),
            )),
        }
    }

    /// An error about the `i`-th `[[frf]]`, at its line of `campaign.toml`.
    fn complaint(&self, i: usize, key: &str, problem: &str, remedy: &str) -> crate::Error {
        let frf = self.frfs.get(i);
        let file = frf.map_or_else(String::new, |f| {
            let inside = f.file.strip_prefix(&self.dir).unwrap_or(&f.file);
            format!("{}: ", shown(&inside.to_string_lossy()))
        });
        InputError::new(format!("{file}{problem}"))
            .file(campaign_file(&self.dir))
            .line(frf.map(|f| f.line))
            .key(format!("frf[{i}].{key}"))
            .remedy(remedy)
            .into()
    }
}

/// FRFs of one file, and what was noticed while reading it.
type FrfContents = (Vec<FrfRecord>, Vec<String>);

/// What is said once a file, not once an FRF.
#[derive(Default)]
struct FileFacts {
    /// Quantity of the file and of the campaign.
    contradiction: Option<(Quantity, Quantity)>,
    static_lines: bool,
    /// Names of FRFs that are zero on every line.
    dead: Vec<String>,
}

impl FileFacts {
    fn warnings(&self, frf: &FrfFile) -> Vec<String> {
        let file = frf.file.display();
        let mut out = Vec::new();
        if let Some((found, decided)) = self.contradiction {
            out.push(format!(
                "{file}: the file says {}, campaign.toml says {}; campaign.toml decides",
                word(found),
                word(decided)
            ));
        }
        if self.static_lines {
            out.push(format!("{file}: the line at 0 Hz is left out"));
        }
        if !self.dead.is_empty() {
            let names = self.dead.join(", ");
            out.push(format!(
                "{file}: {names}: zero on every line (a dead channel), left out"
            ));
        }
        out
    }
}

fn word(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Receptance => "receptance",
        Quantity::Mobility => "mobility",
        Quantity::Accelerance => "accelerance",
    }
}

/// Pairs (later, earlier) of files with the same data.
fn identical(files: &[FrfContents]) -> Vec<(usize, usize)> {
    let same = |a: &[FrfRecord], b: &[FrfRecord]| {
        a.len() == b.len()
            && a.iter()
                .zip(b)
                .all(|(a, b)| a.value == b.value && a.frequency_hz == b.frequency_hz)
    };
    (0..files.len())
        .filter_map(|later| {
            let earlier = (0..later).find(|&earlier| same(&files[later].0, &files[earlier].0))?;
            Some((later, earlier))
        })
        .collect()
}

/// Takes FRFs out that are copies of others of the same posture and points: the same measurement twice is no second one,
/// and would make every standard error too small. Returns what to tell.
fn drop_copies(frfs: &mut Vec<MeasuredFrf>) -> Vec<String> {
    use std::collections::{BTreeMap, HashMap};
    let mut seen: HashMap<_, Vec<usize>> = HashMap::new();
    let mut copies = Vec::new();
    // By the two files, so that a whole folder taken twice is one sentence a file.
    let mut told: BTreeMap<(PathBuf, PathBuf), Vec<String>> = BTreeMap::new();
    for k in 0..frfs.len() {
        let frf = &frfs[k];
        let key = (frf.posture, frf.response, frf.reference, frf.frequency_hz.len());
        let alike = seen.entry(key).or_default();
        match alike.iter().find(|j| same_measurement(&frfs[**j], frf)) {
            Some(j) => {
                let files = (frf.file.clone(), frfs[*j].file.clone());
                told.entry(files).or_default().push(frf.name.clone());
                copies.push(k);
            }
            None => alike.push(k),
        }
    }
    for k in copies.into_iter().rev() {
        frfs.remove(k);
    }
    let sentence = |((later, earlier), names): ((PathBuf, PathBuf), Vec<String>)| {
        format!(
            "{}: the same data as {} ({}): used once",
            later.display(),
            earlier.display(),
            names.join(", ")
        )
    };
    told.into_iter().map(sentence).collect()
}

/// Equal within single precision, in which some programs write: two measurements never are.
fn same_measurement(a: &MeasuredFrf, b: &MeasuredFrf) -> bool {
    const SINGLE: f64 = 1e-6;
    let values = a.receptance_m_per_n.iter().zip(&b.receptance_m_per_n);
    let lines = a.frequency_hz.iter().zip(&b.frequency_hz);
    values
        .clone()
        .all(|(a, b)| (a - b).norm() <= SINGLE * a.norm().max(b.norm()))
        && lines.clone().all(|(a, b)| (a - b).abs() <= SINGLE * a)
}

#[derive(Debug)]
struct Converted {
    frequency_hz: Vec<f64>,
    receptance_m_per_n: Vec<Complex64>,
    coherence: Option<Vec<f64>>,
    /// Lines at 0 Hz, left out.
    static_lines: usize,
}

/// Receptance H of mobility iωH or accelerance −ω²H.
///
/// Lines at 0 Hz are left out whatever the quantity: the conversion has no value there, and analysers write an
/// offset instead of a static compliance.
///
/// # Errors
/// The problem, where lengths differ, a number is not finite, or no line is left.
fn to_receptance(record: &FrfRecord, quantity: Quantity) -> std::result::Result<Converted, String> {
    let lines = record.frequency_hz.len();
    let coherence_lines = record.coherence.as_ref().map_or(lines, Vec::len);
    if record.value.len() != lines || coherence_lines != lines {
        return Err(format!(
            "has {lines} frequencies, {} values and {coherence_lines} coherence values",
            record.value.len()
        ));
    }
    let mut out = Converted {
        frequency_hz: Vec::with_capacity(lines),
        receptance_m_per_n: Vec::with_capacity(lines),
        coherence: record.coherence.as_ref().map(|_| Vec::with_capacity(lines)),
        static_lines: 0,
    };
    for (i, (&f, &value)) in record.frequency_hz.iter().zip(&record.value).enumerate() {
        if f == 0.0 {
            out.static_lines += 1;
            continue;
        }
        let omega = 2.0 * std::f64::consts::PI * f;
        let receptance = match quantity {
            Quantity::Receptance => value,
            Quantity::Mobility => value / Complex64::new(0.0, omega),
            Quantity::Accelerance => value / (-omega * omega),
        };
        if !(f > 0.0 && f.is_finite() && receptance.re.is_finite() && receptance.im.is_finite()) {
            return Err(format!("has no finite value at line {} ({f} Hz)", i + 1));
        }
        out.frequency_hz.push(f);
        out.receptance_m_per_n.push(receptance);
        if let (Some(kept), Some(all)) = (out.coherence.as_mut(), record.coherence.as_ref()) {
            kept.extend(all.get(i));
        }
    }
    if out.frequency_hz.is_empty() {
        return Err("has no line above 0 Hz".to_string());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::campaign::*;
    use crate::data::Axis;

    /// Receptance of a single mass on a spring, and its derivatives.
    fn record(quantity: Option<Quantity>, dofs: Option<(i64, i64)>) -> FrfRecord {
        let frequency_hz: Vec<f64> = (0..50).map(f64::from).collect();
        let value = frequency_hz
            .iter()
            .map(|f| oscillator(*f) * factor(quantity.unwrap_or(Quantity::Receptance), *f))
            .collect();
        let dof = |node| Dof {
            node,
            axis: Axis::X,
            negative: false,
        };
        FrfRecord {
            name: "1X/1X".to_string(),
            response: dofs.map(|d| dof(d.0)),
            reference: dofs.map(|d| dof(d.1)),
            quantity,
            coherence: Some(frequency_hz.iter().map(|f| 1.0 - f / 100.0).collect()),
            frequency_hz,
            value,
        }
    }

    fn oscillator(f: f64) -> Complex64 {
        let (m, c, k) = (10.0, 60.0, 1e5);
        let w = 2.0 * std::f64::consts::PI * f;
        1.0 / Complex64::new(k - m * w * w, c * w)
    }

    fn factor(quantity: Quantity, f: f64) -> Complex64 {
        let iw = Complex64::new(0.0, 2.0 * std::f64::consts::PI * f);
        match quantity {
            Quantity::Receptance => 1.0.into(),
            Quantity::Mobility => iw,
            Quantity::Accelerance => iw * iw,
        }
    }

    fn campaign(quantity: Option<Quantity>) -> Campaign {
        let frf = |file: &str, line| FrfFile {
            file: file.into(),
            posture: 0,
            quantity,
            force_level_n: Some(200.0),
            line,
        };
        Campaign {
            dir: "cell".into(),
            name: "n".into(),
            operator: None,
            date: None,
            robot: None,
            postures: vec![Posture {
                id: "p1".into(),
                joints_deg: vec![0.0],
            }],
            beyond_limits: vec![],
            points: vec![Point {
                node: 1,
                body: BodyRef::Tool,
                position_m: [0.0; 3],
                axes: AxesRef::Base,
            }],
            frfs: vec![frf("cell/frf/a.csv", 7), frf("cell/frf/b.csv", 11)],
            tool: None,
            dynamometer: Dynamometer {
                tool_from_dyno: [[0.0; 3]; 3],
            },
            cuts: vec![],
            lobes: None,
            material: None,
            channels: Vec::new(),
            orthogonal: None,
            plan: Default::default(),
            guesses: Default::default(),
            contacts: Vec::new(),
        }
    }

    fn collect(campaign: &Campaign, records: [FrfRecord; 2]) -> Result<(FrfSet, Vec<String>)> {
        let files = records.map(|r| (vec![r], vec![]));
        campaign.collect_frfs(&files)
    }

    #[test]
    fn every_quantity_becomes_the_same_receptance() {
        for quantity in [Quantity::Receptance, Quantity::Mobility, Quantity::Accelerance] {
            let out = to_receptance(&record(Some(quantity), None), quantity).unwrap();
            assert_eq!((out.frequency_hz.len(), out.static_lines), (49, 1));
            assert_eq!(out.coherence.unwrap()[0], 0.99);
            for (f, h) in out.frequency_hz.iter().zip(&out.receptance_m_per_n) {
                assert_relative_eq!(h.re, oscillator(*f).re, max_relative = 1e-12);
                assert_relative_eq!(h.im, oscillator(*f).im, max_relative = 1e-12);
            }
        }
    }

    #[test]
    fn names_points_and_levels_come_along() {
        let mobility = record(Some(Quantity::Mobility), Some((1, 1)));
        let mut receptance = record(Some(Quantity::Receptance), Some((1, 1)));
        receptance.value.iter_mut().for_each(|v| *v *= 1.01);
        let (set, warnings) = collect(&campaign(None), [mobility, receptance]).unwrap();
        assert_eq!(set.frfs[0].name, "p1 1X/1X");
        assert_eq!(
            (set.frfs[0].response.point, set.frfs[0].force_level_n),
            (0, Some(200.0))
        );
        // One note a file for 0 Hz; the two hold different numbers.
        assert_eq!(warnings.len(), 2, "{warnings:?}");
    }

    #[test]
    fn where_file_and_campaign_contradict_the_campaign_decides() {
        let records = [Quantity::Mobility, Quantity::Receptance].map(|q| record(Some(q), Some((1, 1))));
        let (set, warnings) = collect(&campaign(Some(Quantity::Receptance)), records).unwrap();
        assert_eq!(
            warnings[0],
            "cell/frf/a.csv: the file says mobility, campaign.toml says receptance; campaign.toml decides"
        );
        let as_written = oscillator(1.0) * factor(Quantity::Mobility, 1.0);
        assert_eq!(set.frfs[0].receptance_m_per_n[0], as_written);
    }

    #[test]
    fn the_same_data_twice_is_said() {
        let one = record(Some(Quantity::Mobility), Some((1, 1)));
        let (set, warnings) = collect(&campaign(None), [one.clone(), one]).unwrap();
        let last = warnings.last().unwrap();
        assert_eq!(
            last,
            "cell/frf/b.csv: the same data as cell/frf/a.csv (p1 1X/1X): used once"
        );
        assert_eq!(set.frfs.len(), 1);
    }

    #[test]
    fn what_the_file_does_not_say_is_asked_for() {
        let good = || record(Some(Quantity::Mobility), Some((1, 1)));
        let mut broken = good();
        broken.value[9].im = f64::NAN;
        let mut short = good();
        short.value.pop();
        for (bad, words) in [
            (
                record(None, Some((1, 1))),
                "cell/campaign.toml:11: frf[1].quantity: frf/b.csv: missing",
            ),
            (
                record(Some(Quantity::Mobility), None),
                "frf[1].file: frf/b.csv: does not say at which node",
            ),
            (
                record(Some(Quantity::Mobility), Some((1, 7))),
                "frf[1].file: frf/b.csv: 1X/7X was measured at node 7, which has no [[point]]",
            ),
            (broken, "1X/1X has no finite value at line 10 (9 Hz)"),
            (short, "has 50 frequencies, 49 values"),
        ] {
            let message = collect(&campaign(None), [good(), bad]).unwrap_err().to_string();
            assert!(message.contains(words) && message.contains("remedy"), "{message}");
        }
    }
}
