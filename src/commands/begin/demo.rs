//! `lobestone demo [DIR]`: the whole story on the built-in campaigns, each step as the command of its name does it.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::analysis::forces::force_records::identify_forces;
use crate::analysis::modes::stick_shapes;
use crate::analysis::{
    Addition, CampaignFindings, DiagnosisFindings, LobeAnalysis, LobeFindings, ModalAnalysis,
    PostureFindings, StructureFindings, Workbench,
};
use crate::builtin::{BuiltinCampaign, FIRST_CELL, SECOND_CELL};
use crate::campaign::Campaign;
use crate::commands::Outcome;
use crate::commands::text::{number, percent};
use crate::commands::write::report::FilesOfReport;
use crate::cutting::{CfcOptions, CfcResult};
use crate::files::write_atomically;
use crate::identify::{Options, StructureCase};
use crate::report::campaign as pages;
use crate::report::number::with_error;
use crate::revision::{RevisionLog, log_file};
use crate::{Error, InputError, Result, ingest};

#[derive(clap::Args)]
pub struct DemoArgs {
    /// Folder to work in; made if it does not exist.
    #[arg(default_value = "lobestone-demo")]
    dir: PathBuf,
}

/// Tells a demo folder from somebody's work.
const MARKER: &str = "README.txt";
const MARKER_TEXT: &str = "Written by `lobestone demo`. The campaigns in this folder are simulated; each run of the \
demo writes them and the report anew.\n";

/// One step of the story.
#[derive(Debug, Serialize)]
struct Step {
    name: &'static str,
    /// What to type for the same on a campaign of one's own.
    command: String,
    summary: String,
    seconds: f64,
}

/// Runs steps and keeps their story.
#[derive(Default)]
struct Story {
    steps: Vec<Step>,
}

impl Story {
    fn step<T>(
        &mut self,
        name: &'static str,
        command: String,
        work: impl FnOnce() -> Result<T>,
        summary: impl FnOnce(&T) -> String,
    ) -> Result<T> {
        let started = Instant::now();
        let done = work()?;
        self.steps.push(Step {
            name,
            command,
            summary: summary(&done),
            seconds: started.elapsed().as_secs_f64(),
        });
        Ok(done)
    }
}

pub fn run(args: DemoArgs) -> Result<Outcome> {
    let began = Instant::now();
    let dir = &args.dir;
    prepare(dir)?;
    let first = fresh(&FIRST_CELL, dir)?;
    let second = fresh(&SECOND_CELL, dir)?;
    let of = |command: &str, campaign: &Campaign| format!("lobestone {command} {}", campaign.dir.display());
    // Both cells at once: neither needs what the other finds.
    let (told_first, told_second) = std::thread::scope(|scope| {
        let of_first = scope.spawn(|| first_story(&first, of));
        let of_second = second_story(&second, of);
        let panicked = |_| {
            Err(Error::computation(
                "the program failed at the first cell: a fault of its own",
            ))
        };
        (of_first.join().unwrap_or_else(panicked), of_second)
    });
    let (mut story, unexplained, diagnosis, extended) = told_second?;
    let told = told_first?;
    story.steps.extend(told.story.steps);
    let FirstCell {
        bench,
        structure,
        postures,
        modal,
        cutting,
        lobes,
        ..
    } = told;

    let findings = CampaignFindings {
        campaign: &first,
        bench,
        setup: Vec::new(),
        structure: Some(Ok(structure)),
        diagnosis: None,
        postures: Some(Ok(postures)),
        mode_shapes: stick_shapes::of_richest_set(&first, &modal),
        modal: Some(Ok(modal)),
        cutting_diagnosis: None,
        cutting_revisions: Vec::new(),
        cutting: Some(Ok(cutting)),
        lobes: Some(Ok(lobes)),
    };
    let rows: Vec<pages::StepRow> = story
        .steps
        .iter()
        .map(|s| [s.name.to_string(), s.summary.clone(), s.command.clone()])
        .collect();
    let files = story.step(
        "report",
        of("report", &first),
        || {
            let second = pages::SecondCell {
                campaign: &second,
                before: &unexplained,
                diagnosis: &diagnosis,
                after: &extended,
            };
            let page = pages::demo_page(&findings, &second, &rows);
            pages::write(&page, &findings, &dir.join("report"))
        },
        |files| {
            format!(
                "{} figures in one page: {}",
                files.images.len(),
                files.html.display()
            )
        },
    )?;

    let next = format!(
        "open {} in a browser, then begin with your own files: run `lobestone init FOLDER`",
        files.html.display()
    );
    Ok(Outcome::new(
        Document {
            steps: &story.steps,
            dir,
            files: FilesOfReport::of(&files),
        },
        describe(&story.steps, began.elapsed()),
        Some(next),
    ))
}

/// What `demo` did.
#[derive(Serialize)]
struct Document<'a> {
    steps: &'a [Step],
    dir: &'a Path,
    #[serde(flatten)]
    files: FilesOfReport<'a>,
}

/// What the model explains.
struct FirstCell<'a> {
    bench: Workbench<'a>,
    story: Story,
    structure: StructureFindings,
    postures: Vec<PostureFindings>,
    modal: Arc<ModalAnalysis>,
    cutting: CfcResult,
    lobes: LobeFindings,
}

/// `of`: a command on a campaign as it is typed.
fn first_story(first: &Campaign, of: impl Fn(&str, &Campaign) -> String) -> Result<FirstCell<'_>> {
    let (mut story, bench) = (Story::default(), &Workbench::new(first));
    story.step(
        "inspect",
        of("inspect", first) + "/frf/*.uff",
        || inspect(first),
        Clone::clone,
    )?;
    let structure = story.step(
        "calibrate",
        of("calibrate", first),
        || StructureFindings::on(bench),
        calibrated,
    )?;
    let postures = story.step(
        "model",
        of("model", first),
        || PostureFindings::run(first, Some(&structure)),
        |postures| modelled(postures),
    )?;
    let modal = story.step(
        "modal",
        of("modal", first),
        || ModalAnalysis::usual(bench),
        |found| modes(found),
    )?;
    let cutting = story.step(
        "cfc",
        of("cfc", first),
        || identify_forces(bench, CfcOptions::default()),
        coefficients,
    )?;
    let lobes = story.step("lobes", of("lobes", first), || LobeFindings::on(bench), lobes)?;
    Ok(FirstCell {
        bench: bench.clone(),
        story,
        structure,
        postures,
        modal,
        cutting,
        lobes,
    })
}

/// The cell with something hidden: the model without it, the diagnosis, the model with it.
fn second_story(
    second: &Campaign,
    of: impl Fn(&str, &Campaign) -> String,
) -> Result<(Story, StructureFindings, DiagnosisFindings, StructureCase)> {
    let (mut story, bench) = (Story::default(), &Workbench::new(second));
    let unexplained = story.step(
        "compare",
        of("compare", second),
        || StructureFindings::on(bench),
        compared,
    )?;
    let diagnosis = story.step(
        "diagnose",
        of("diagnose", second),
        || DiagnosisFindings::of(second, unexplained.analysis.settled_case(), Options::default()),
        crate::report::sections::diagnosis_section::summary,
    )?;
    let missing = diagnosis.diagnosis.winner().map(|w| w.label());
    let missing =
        missing.ok_or_else(|| Error::computation("the built-in second cell shows no missing effect"))?;
    diagnosis.keep(bench)?;
    story.step(
        "add",
        of("add", second) + " " + &missing,
        || {
            let case = unexplained.analysis.settled_case();
            let log = RevisionLog::load(&second.dir)?;
            Addition::to(case, log, &Workbench::new(second), &missing, Options::default())
        },
        added,
    )?;
    let extended = story.step(
        "history",
        of("history", second),
        || StructureCase::load(second),
        history,
    )?;
    Ok((story, unexplained, diagnosis, extended))
}

/// Makes the folder, or takes one that an earlier demo made.
fn prepare(dir: &Path) -> Result<()> {
    let marker = dir.join(MARKER);
    if dir.exists() {
        let mut entries = std::fs::read_dir(dir).map_err(|e| Error::io(dir, e))?;
        let is_demo = std::fs::read_to_string(&marker).is_ok_and(|text| text == MARKER_TEXT);
        if entries.next().is_some() && !is_demo {
            return Err(InputError::new(
                "the folder holds something that is not a demo; nothing was touched",
            )
            .file(dir)
            .remedy("name a folder that does not exist: lobestone demo FOLDER")
            .into());
        }
    }
    std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, e))?;
    write_atomically(&marker, MARKER_TEXT.as_bytes())
}

/// A built-in campaign as it came, whatever was added to its model since the last demo.
fn fresh(campaign: &BuiltinCampaign, dir: &Path) -> Result<Campaign> {
    let folder = campaign.write(dir)?;
    let log = log_file(&folder);
    if log.exists() {
        std::fs::remove_file(&log).map_err(|e| Error::io(&log, e))?;
    }
    Campaign::load(&folder)
}

fn inspect(campaign: &Campaign) -> Result<String> {
    let mut text = Vec::new();
    if let Some(frf) = campaign.frfs.first() {
        let file = ingest::read_file(&frf.file)?;
        text.push(format!(
            "{} FRF files ({}), {} FRFs in the first",
            campaign.frfs.len(),
            file.format,
            file.contents.frfs.len()
        ));
    }
    if let Some(cut) = campaign.cuts.first() {
        let file = ingest::read_file(&cut.file)?;
        let channels = file.contents.times.first().map_or(0, |t| t.channels.len());
        text.push(format!(
            "{} force records ({}), {channels} channels in the first",
            campaign.cuts.len(),
            file.format
        ));
    }
    Ok(text.join("; "))
}

fn calibrated(s: &StructureFindings) -> String {
    let (before, after) = (&s.analysis.before.totals, &s.analysis.after.totals);
    let held_out = s.held_out_nrms.map_or(String::new(), |h| {
        format!("; {} on postures left out", percent(h))
    });
    format!(
        "error {} before, {} after; the noise is {}{held_out}",
        percent(before.nrms),
        percent(after.nrms),
        percent(after.noise_floor_nrms),
    )
}

fn modelled(postures: &[PostureFindings]) -> String {
    let Some(first) = postures.first() else {
        return "no posture".into();
    };
    let lowest = |report: &crate::robot::PostureReport| {
        report
            .natural_frequencies_hz
            .first()
            .map_or("–".into(), |f| number(*f, 3))
    };
    let after = first
        .calibrated
        .as_ref()
        .map_or(String::new(), |c| format!(", {} calibrated", lowest(c)));
    format!(
        "lowest natural frequency at {}: {} Hz as in the robot file{after}",
        first.id,
        lowest(&first.nominal)
    )
}

fn modes(modal: &ModalAnalysis) -> String {
    format!(
        "{} modes found in the measured FRFs of {} postures, no model used",
        modal.mode_count(),
        modal.sets.len()
    )
}

fn coefficients(result: &CfcResult) -> String {
    let of_group = |group: &crate::cutting::ForceGroup| {
        let values: Vec<String> = group
            .coefficients
            .iter()
            .filter(|c| !c.edge)
            .filter_map(|c| Some(format!("{} {}", c.label, with_error(c.value?, c.std_error?))))
            .collect();
        format!("{} N/mm² from {} cuts", values.join(", "), group.cuts.len())
    };
    result.pooled.iter().map(of_group).collect::<Vec<_>>().join("; ")
}

fn lobes(lobes: &LobeFindings) -> String {
    let limit = |analysis: &LobeAnalysis| {
        analysis
            .absolute()
            .map_or("no limit".into(), |a| format!("{} mm", number(a.depth_mm, 3)))
    };
    let measured = match &lobes.measured {
        Some(Ok(measured)) => format!(", {} from the measured FRFs", limit(measured)),
        _ => String::new(),
    };
    let best = lobes.asked.best().first().map_or(String::new(), |(case, peak)| {
        let place = case.posture.as_deref().unwrap_or("the modes");
        let depth = peak
            .depth_mm
            .map_or("no limit".into(), |d| format!("{} mm", number(d, 3)));
        format!(
            "; deepest tip of a lobe at {} rpm and {place} ({depth})",
            number(peak.spindle_rpm, 4)
        )
    });
    format!(
        "drilling is stable at any speed below {} (model){measured}{best}",
        limit(&lobes.asked)
    )
}

fn compared(s: &StructureFindings) -> String {
    let after = &s.analysis.after.totals;
    let what = if after.nrms > 1.1 * after.noise_floor_nrms {
        "the model lacks something, or the measurement is wrong"
    } else {
        "nothing but noise is left"
    };
    format!(
        "{} after calibration, noise {}: {what}",
        percent(after.nrms),
        percent(after.noise_floor_nrms)
    )
}

fn added(addition: &Addition) -> String {
    let held_out = addition.extension.after.held_out_nrms();
    format!(
        "error {} before, {} after; the noise is {}{}",
        percent(addition.extension.before.residual.nrms),
        percent(addition.totals.nrms),
        percent(addition.totals.noise_floor_nrms),
        held_out.map_or(String::new(), |h| format!(
            "; {} on postures left out",
            percent(h)
        )),
    )
}

fn history(case: &StructureCase) -> String {
    let revisions = case.revisions.iter();
    let errors: Vec<String> = revisions
        .map(|r| format!("{}: {}", r.title(), percent(r.nrms)))
        .collect();
    errors.join(", ")
}

fn describe(steps: &[Step], took: Duration) -> String {
    let mut text = String::from("Lobestone demo: simulated campaigns, every step as its command does it\n");
    for step in steps {
        text += &format!(
            "\n{:<10} {}\n{:<10} {} ({:.1} s)\n",
            step.name, step.summary, "", step.command, step.seconds
        );
    }
    text + &format!("\nDone in {:.1} s.\n", took.as_secs_f64())
}
