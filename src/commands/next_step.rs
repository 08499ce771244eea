//! What to do next: for every command the one sensible step after what it found, with the command to type.

use std::path::Path;

use super::text::{number, percent};
use crate::campaign::{Campaign, campaign_file};
use crate::discrepancy::DiagnosisVerdict;
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::diagnose::is_all_noise;
use crate::discrepancy::verdict::is_noise;
use crate::revision::{Revision, Side};
use crate::text::shell_word;

/// A campaign and the side of it that a command looked at.
#[derive(Clone, Copy)]
pub struct Guide<'a> {
    pub campaign: &'a Campaign,
    pub side: Side,
}

impl<'a> Guide<'a> {
    pub fn structure(campaign: &'a Campaign) -> Self {
        Guide {
            campaign,
            side: Side::Structure,
        }
    }

    pub fn cutting(campaign: &'a Campaign) -> Self {
        Guide {
            campaign,
            side: Side::Cutting,
        }
    }

    /// `lobestone COMMAND DIR`.
    fn run(&self, command: &str) -> String {
        format!("`lobestone {command} {}`", shell_word(&self.campaign.dir))
    }

    /// As [`run`](Self::run), with the side where the campaign has both.
    fn run_here(&self, command: &str) -> String {
        let both = !self.campaign.frfs.is_empty() && !self.campaign.cuts.is_empty();
        let side = match self.side {
            _ if !both => "",
            Side::Structure => " --domain structure",
            Side::Cutting => " --domain cutting",
        };
        format!("`lobestone {command} {}{side}`", shell_word(&self.campaign.dir))
    }

    /// What a model that fits is good for.
    fn use_it(&self) -> String {
        match self.campaign.lobes {
            Some(_) => format!(
                "the model can be used: run {} for the stable depths of cut, or {}",
                self.run("lobes"),
                self.run("report")
            ),
            None => format!(
                "the model can be used: run {} (with a [lobes] table in campaign.toml there are stability lobes, too)",
                self.run("report")
            ),
        }
    }

    /// A total near the noise hides a small effect easily: only a diagnosis may say that nothing is missing.
    fn hardly_more_than_noise(&self) -> String {
        format!(
            "hardly more than noise is left: run {} for effects that hide in it; where it says none, {}",
            self.run_here("diagnose"),
            self.use_it()
        )
    }

    /// After `calibrate`. `mostly`: where the error sits.
    pub fn calibrated(
        &self,
        converged: bool,
        starts: usize,
        reduced_chi2: f64,
        error: &ErrorTotals,
        mostly: Option<String>,
    ) -> String {
        if !converged && is_noise(reduced_chi2) {
            return format!(
                "the fit did not converge: run `lobestone calibrate {} --starts {}`",
                shell_word(&self.campaign.dir),
                (4 * starts).max(8)
            );
        }
        // Where physics is missing more starts are of no use.
        let doubt = match converged {
            true => "",
            false => "the fit did not converge, as happens where physics is missing; ",
        };
        doubt.to_string()
            + &self.error_then(
                reduced_chi2,
                error,
                mostly,
                "compare",
                "to see where the model fails",
            )
    }

    /// After `calibrate --free`, where the links only imitate what is missing.
    pub fn imitated(&self) -> String {
        format!(
            "leave the links and run {} for what is missing",
            self.run_here("diagnose")
        )
    }

    /// After `compare`. `mostly`: where the error sits.
    pub fn compared(&self, reduced_chi2: f64, error: &ErrorTotals, mostly: Option<String>) -> String {
        self.error_then(
            reduced_chi2,
            error,
            mostly,
            "diagnose",
            "to learn what is missing",
        )
    }

    fn error_then(
        &self,
        reduced_chi2: f64,
        error: &ErrorTotals,
        mostly: Option<String>,
        command: &str,
        purpose: &str,
    ) -> String {
        let errors = format!(
            "error {}, noise {}",
            percent(error.nrms),
            percent(error.noise_floor_nrms)
        );
        if is_all_noise(error.nrms, reduced_chi2) {
            return format!(
                "{errors}: the model explains nothing, and the data are not told from noise: check columns, sampling rates and speeds in \
                 {} before anything else",
                shell_word(&self.campaign.dir.join("campaign.toml"))
            );
        }
        if is_noise(reduced_chi2) {
            return format!("{errors}: {}", self.hardly_more_than_noise());
        }
        let mut place = mostly.map_or(String::new(), |m| format!(", mostly {m}"));
        if error.nrms < 1.1 * error.noise_floor_nrms {
            // The sum does not show it: lines besides the steady waveform, or many small errors of one kind.
            place = format!(
                ", but the misfit is {} times that of noise",
                number(reduced_chi2, 2)
            ) + &place;
        }
        format!("{errors}{place}: run {} {purpose}", self.run_here(command))
    }

    /// After `diagnose`. `winner`: `effect@site` where one is missing.
    pub fn diagnosed(&self, verdict: DiagnosisVerdict, winner: Option<&str>, measurement: &str) -> String {
        match (verdict, winner) {
            (DiagnosisVerdict::Effect, Some(label)) => format!(
                "{label} is missing: run `lobestone add {} {label}` (what it is: `lobestone explain {}`)",
                shell_word(&self.campaign.dir),
                effect_of(label)
            ),
            (DiagnosisVerdict::None, _) => format!("nothing is missing: {}", self.use_it()),
            _ => {
                let verb = match self.side {
                    Side::Structure => "measure",
                    Side::Cutting => "make",
                };
                format!(
                    "{verb} {}; list it in campaign.toml, then run {} again",
                    measurement.strip_prefix("measure ").unwrap_or(measurement),
                    self.run_here("diagnose")
                )
            }
        }
    }

    /// After `diagnose`, where numbers of the robot file explain what no effect does.
    pub fn wrong_links(&self, beside: Option<&str>) -> String {
        let dir = shell_word(&self.campaign.dir);
        let run = match beside {
            Some(effect) => {
                format!("`lobestone add {dir} {effect}`, then `lobestone calibrate {dir} --free links`")
            }
            None => format!("`lobestone calibrate {dir} --free links`"),
        };
        format!("run {run} for the links that fit, and compare them with what the robot is")
    }

    /// After `add`.
    pub fn added(&self, progress: Option<bool>, reduced_chi2: f64, error: &ErrorTotals) -> String {
        match progress {
            Some(false) => format!(
                "this was no progress: run {} to take it back",
                self.run_here("undo")
            ),
            _ if is_noise(reduced_chi2) => format!(
                "error {}, noise {}: run {} to be sure that nothing else is missing",
                percent(error.nrms),
                percent(error.noise_floor_nrms),
                self.run_here("diagnose")
            ),
            _ => format!(
                "error {}, noise {}: run {} for what else is missing",
                percent(error.nrms),
                percent(error.noise_floor_nrms),
                self.run_here("diagnose")
            ),
        }
    }

    /// After `undo`.
    pub fn undone(&self) -> String {
        format!("run {} for what is missing now", self.run_here("diagnose"))
    }

    /// After `history`. `stale`: the last revision was made with other data.
    pub fn history(&self, current: Option<&Revision>, stale: bool) -> String {
        let Some(current) = current else {
            return format!(
                "no effect was added yet: run {} to learn what is missing",
                self.run_here("diagnose")
            );
        };
        if stale {
            return format!(
                "the data changed since: run {}, then add the effect again",
                self.run_here("undo")
            );
        }
        match (current.progress, current.reduced_chi2) {
            (Some(false), _) => format!(
                "the last step was no progress: run {} to take it back",
                self.run_here("undo")
            ),
            (_, chi2) if is_noise(chi2) => self.hardly_more_than_noise(),
            _ => format!(
                "more than noise is left: run {} for what else is missing",
                self.run_here("diagnose")
            ),
        }
    }

    /// After `cfc`.
    pub fn coefficients(&self) -> String {
        format!(
            "run {} to see whether the whole waveform fits, not only its mean",
            self.run_here("compare")
        )
    }

    /// After `modal` on the campaign, which found `modes`.
    pub fn modes(&self, modes: usize) -> String {
        if modes == 0 {
            return self.no_modes();
        }
        match self.campaign.robot {
            Some(_) => format!("run {} to tune the model to these FRFs", self.run("calibrate")),
            None => format!(
                "without a [robot] there is no model to compare with: run {}",
                self.run("report")
            ),
        }
    }

    fn no_modes(&self) -> String {
        let first = self
            .campaign
            .frfs
            .first()
            .map(|f| shell_word(&f.file))
            .unwrap_or_default();
        format!("no mode was found: run `lobestone inspect {first}` to see what the files are like")
    }

    /// After `model`.
    pub fn modelled(&self) -> String {
        match self.campaign.frfs.is_empty() {
            true => "measure FRFs at these postures and list them as [[frf]] in campaign.toml".into(),
            false => format!("run {} to see where the model fails", self.run_here("compare")),
        }
    }

    /// After `lobes`.
    pub fn lobes(&self) -> String {
        format!(
            "make a cut at a speed proposed, a little below its limit, and listen; for the record run {}",
            self.run("report")
        )
    }

    /// After `report`. `missing`: the effect that the report says is missing.
    pub fn reported(&self, html: &Path, missing: Option<&str>) -> String {
        let open = format!("open {} in a browser", html.display());
        match missing {
            Some(label) => format!(
                "{open}; {label} is missing: run `lobestone add {} {label}`",
                shell_word(&self.campaign.dir)
            ),
            None => open,
        }
    }
}

/// After `modal` on files.
pub fn modes_of_files(files: &[&Path], modes: usize) -> String {
    let Some(first) = files.first() else {
        return String::new();
    };
    match (modes, folder_of(files)) {
        (0, _) => format!(
            "no mode was found: run `lobestone inspect {}` to see what the file is like",
            shell_word(first)
        ),
        (_, Folder::Campaign(dir)) => format!(
            "run `lobestone calibrate {}` to tune the campaign's model to its FRFs",
            shell_word(&dir)
        ),
        (_, Folder::Plain(dir)) => format!(
            "run `lobestone init {}` to make a campaign of these files, to compare a robot's model with",
            shell_word(&dir)
        ),
    }
}

/// After `inspect`: files and what they are for.
pub fn inspected(files: &[(&Path, &'static str)]) -> String {
    let paths: Vec<&Path> = files.iter().map(|(p, _)| *p).collect();
    let has = |kind| files.iter().any(|(_, k)| *k == kind);
    if !has("frf") && !has("force") {
        let words: Vec<String> = paths.iter().map(|p| shell_word(p)).collect();
        return format!(
            "if this is a tap test (hammer and sensor), run `lobestone modal {}`; with --output-only if no force was recorded \
             (idling, cutting). If it holds cutting forces under other names (volts, motor currents), say in a [[channel]] of \
             campaign.toml which they are: name, in_file, gain",
            words.join(" ")
        );
    }
    match folder_of(&paths) {
        Folder::Campaign(dir) if has("frf") => {
            format!(
                "run `lobestone compare {}` to see how its model fits",
                shell_word(&dir)
            )
        }
        Folder::Campaign(dir) => format!(
            "run `lobestone cfc {}` for the cutting coefficients",
            shell_word(&dir)
        ),
        Folder::Plain(dir) => format!(
            "run `lobestone init {}` to make a campaign of the folder",
            shell_word(&dir)
        ),
    }
}

/// After `simulate`.
pub fn simulated(dir: &Path, truth: &Path) -> String {
    format!(
        "run `lobestone diagnose {}`, then look at what was hidden: {}",
        shell_word(dir),
        truth.display()
    )
}

/// After `plan`. `addition`: the cheapest that mends something, beginning with `measure`.
pub fn planned(dir: &Path, addition: Option<&str>) -> String {
    let measure = match addition {
        Some(what) => format!("plan to {what} as well, then measure"),
        None => "measure as planned".to_string(),
    };
    format!(
        "{measure}, list the files in campaign.toml, and run `lobestone calibrate {}`",
        shell_word(dir)
    )
}

/// What a campaign begins with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measured {
    Frfs,
    Forces,
    Nothing,
}

/// After `init`.
pub fn begun(dir: &Path, to_fill_in: usize, measured: Measured) -> String {
    match (to_fill_in, measured) {
        (0, Measured::Frfs) => format!(
            "run `lobestone compare {}` to see how the model fits",
            shell_word(dir)
        ),
        (0, Measured::Nothing) => format!(
            "add [[posture]] tables (or --posture ID=DEG,… with --force), then `lobestone model {dir}`, and `lobestone plan {dir}` for \
             what to measure",
            dir = shell_word(dir)
        ),
        (0, Measured::Forces) => format!(
            "run `lobestone cfc {}` for the cutting coefficients",
            shell_word(dir)
        ),
        (n, _) => format!(
            "fill in what is missing ({n}): edit {}, or give the flags and run `lobestone init {} --force` again",
            campaign_file(dir).display(),
            shell_word(dir)
        ),
    }
}

enum Folder {
    /// Holds campaign.toml.
    Campaign(std::path::PathBuf),
    /// The folder that all the files lie in.
    Plain(std::path::PathBuf),
}

fn folder_of(files: &[&Path]) -> Folder {
    let parent = |path: &Path| match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
        _ => ".".into(),
    };
    let mut common = files.first().map_or(".".into(), |f| parent(f));
    while !files.iter().all(|f| parent(f).starts_with(&common)) && common.pop() {}
    if common.as_os_str().is_empty() {
        common = ".".into();
    }
    // A campaign keeps its files one or two folders down.
    let campaign = common
        .ancestors()
        .take(3)
        .filter(|dir| !dir.as_os_str().is_empty())
        .find(|dir| campaign_file(dir).is_file());
    match campaign {
        Some(dir) => Folder::Campaign(dir.to_path_buf()),
        None => Folder::Plain(common),
    }
}

fn effect_of(label: &str) -> &str {
    label.split('@').next().unwrap_or(label)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_belong_to_the_campaign_around_them() {
        let dir = tempfile::tempdir().unwrap();
        let cell = dir.path().join("cell");
        std::fs::create_dir_all(cell.join("frf")).unwrap();
        let (a, b) = (cell.join("frf/p1.uff"), cell.join("force/cut.txt"));
        let plain = inspected(&[(&a, "frf"), (&b, "force")]);
        assert!(
            plain.contains(&format!("lobestone init {}`", cell.display())),
            "{plain}"
        );
        std::fs::write(campaign_file(&cell), "").unwrap();
        let frf = inspected(&[(&a, "frf")]);
        assert!(
            frf.contains(&format!("lobestone compare {}`", cell.display())),
            "{frf}"
        );
        let force = inspected(&[(&b, "force")]);
        assert!(
            force.contains(&format!("lobestone cfc {}`", cell.display())),
            "{force}"
        );
        let tap = inspected(&[(&b, "time")]);
        assert!(tap.contains("lobestone modal"), "{tap}");
        assert!(inspected(&[(Path::new("a.uff"), "frf")]).contains("lobestone init .`"));
    }
}
