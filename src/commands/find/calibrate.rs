use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use crate::analysis::{FreedLinks, StructureAnalysis};
use crate::campaign::robot_text::RobotComments;
use crate::campaign::{Campaign, LinkGroup, campaign_file};
use crate::commands::document::FitFound;
use crate::commands::next_step::Guide;
use crate::commands::text::{Emphasis, files_first, number, percent, table, warnings_but};
use crate::commands::{CampaignArg, Outcome};
use crate::discrepancy::comparison::compare::ErrorTotals;
use crate::discrepancy::comparison::place::DominantRegion;
use crate::discrepancy::setup::SetupFinding;
use crate::files::write_new;
use crate::identify::frfs::modal_start::ModalStart;
use crate::identify::{Calibration, Options, Scale, StructureCase, StructureModel, Undetermined};
use crate::report::number::{format_si, plus_minus};
use crate::report::words::parameter_of;
use crate::revision::Side;
use crate::text::{listed, quoted, shell_word};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
pub struct CalibrateArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Further starting points, tried where the first fit leaves more than noise.
    #[arg(long, default_value_t = Options::default().extra_starts)]
    starts: usize,
    /// Seed of those starting points.
    #[arg(long, default_value_t = Options::default().seed)]
    seed: u64,
    /// Start from the robot file's values alone, not from where the last revision stood or the measured modes lie.
    #[arg(long)]
    from_nominal: bool,
    /// Link parameters that are fitted as well, with the usual tolerance where campaign.toml gives none: masses, inertias,
    /// centres (of mass), lengths (of the kinematics), walls (of links that bend), or links (all of them). Keeps those that
    /// cannot be what the robot file says; says whether postures left out are predicted better, and what the data cannot tell.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "GROUP",
        conflicts_with = "from_nominal"
    )]
    free: Vec<Free>,
    /// Write the robot with the link parameters that --free found into a robot file in the campaign's folder.
    #[arg(long, value_name = "FILE", requires = "free")]
    write_robot: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Free {
    Links,
    Masses,
    Inertias,
    Centres,
    Lengths,
    Walls,
}

impl Free {
    fn groups(self, bends: bool) -> Vec<LinkGroup> {
        match self {
            Free::Links => LinkGroup::of_model(bends),
            Free::Masses => vec![LinkGroup::Masses],
            Free::Inertias => vec![LinkGroup::Inertias],
            Free::Centres => vec![LinkGroup::Centres],
            Free::Lengths => vec![LinkGroup::Lengths],
            Free::Walls => vec![LinkGroup::Walls],
        }
    }
}

pub fn run(args: CalibrateArgs) -> Result<Outcome> {
    let campaign = Campaign::load(&args.campaign.dir)?;
    let new_file = args.write_robot.as_deref();
    let new_file = new_file.map(|path| RobotFile::new(&campaign, path)).transpose()?;
    let options = Options {
        extra_starts: args.starts,
        seed: args.seed,
    };
    let freed = match args.free.is_empty() {
        true => None,
        false => {
            let case = StructureCase::load(&campaign)?;
            let mut groups: Vec<LinkGroup> = args.free.iter().flat_map(|f| f.groups(case.bends())).collect();
            groups.sort_unstable();
            groups.dedup();
            Some(FreedLinks::run(&campaign, case, &groups, options)?)
        }
    };
    let analysis = if let Some(freed) = &freed {
        &freed.after
    } else if args.from_nominal {
        let mut case = StructureCase::load(&campaign)?;
        case.forget_start();
        &StructureAnalysis::of(case, None, options)?
    } else {
        &StructureAnalysis::run(&campaign, options)?
    };
    let StructureAnalysis {
        case,
        calibration,
        before,
        after,
        start,
        warnings: notes,
        ..
    } = analysis;
    let setup = analysis.setup_check()?;
    let undetermined = match &freed {
        Some(freed) => freed.undetermined.clone(),
        None => Undetermined::new(&case.model.parameters, calibration)?,
    };
    let written = match (&freed, &new_file) {
        (Some(freed), Some(file)) if !freed.departing.is_empty() => {
            file.write(&campaign, freed)?;
            Some(file)
        }
        _ => None,
    };
    let document = Document {
        domain: Side::Structure,
        revision: case.revision(),
        effects: case.effects(),
        fit: FitFound::of(calibration),
        correlation: calibration.correlation(),
        error: after.totals,
        error_before: before.totals,
        modal_start: start.as_ref(),
        undetermined: &undetermined,
        freed: freed.as_ref().map(|freed| WithFreed::of(freed, written)),
        setup: &setup.findings,
        warnings: notes,
    };
    let mut text =
        files_first(&setup.findings, &case.warnings) + &format!("model: {}\n\n", case.model_description());
    text += &describe_parameters(&case.model, calibration);
    if let Some(start) = start {
        text += &format!(
            "\nstarted also from the measured modes: damping ratio {:.2} %, {} of {} modes matched, their frequencies off by \
             {} with the robot file's stiffness, {} at the start\n",
            100.0 * start.damping_ratio,
            start.matched,
            start.measured,
            percent(start.frequency_error_before),
            percent(start.frequency_error),
        );
    }
    text += &format!(
        "\nerror (nrms) {} -> {}, noise floor {}; {} in {} iterations\n",
        percent(before.totals.nrms),
        percent(after.totals.nrms),
        percent(after.totals.noise_floor_nrms),
        if calibration.converged() {
            "converged".to_string()
        } else {
            Emphasis::Bad.on("NOT converged")
        },
        calibration.iterations,
    );
    if after.totals.nrms >= before.totals.nrms {
        text += "in the fit each line counts by its noise, in the nrms by its size: where physics is missing the misfit may fall and the \
                 nrms rise\n";
    }
    if let Some(freed) = &freed {
        text += &describe_freed(&campaign, freed, &args);
        if let Some(file) = written {
            text += &file.told(&campaign);
        } else if let Some(file) = &new_file {
            text += &format!(
                "{} was not written: nothing in it would differ\n",
                file.path.display()
            );
        }
    }
    for sentence in undetermined.in_words() {
        text += &format!("{sentence}\n");
    }
    text += &warnings_but(notes, &case.warnings);
    let guide = Guide::structure(&campaign);
    let next = match &freed {
        Some(freed) if !freed.is_believable() => guide.imitated(),
        _ => guide.calibrated(
            calibration.converged(),
            args.starts,
            calibration.reduced_chi2,
            &after.totals,
            after.mostly.as_ref().map(DominantRegion::words),
        ),
    };
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `calibrate` found.
#[derive(Serialize)]
struct Document<'a> {
    domain: Side,
    revision: Option<usize>,
    effects: Vec<String>,
    #[serde(flatten)]
    fit: FitFound<'a>,
    correlation: Vec<Vec<Option<f64>>>,
    error: ErrorTotals,
    error_before: ErrorTotals,
    modal_start: Option<&'a ModalStart>,
    undetermined: &'a Undetermined,
    freed: Option<WithFreed<'a>>,
    setup: &'a [SetupFinding],
    warnings: &'a [String],
}

/// With link parameters free.
#[derive(Serialize)]
struct WithFreed<'a> {
    groups: Vec<&'static str>,
    parameters_freed: usize,
    departing: &'a [String],
    error_before: ErrorTotals,
    held_out_nrms_before: Option<f64>,
    held_out_nrms_after: Option<f64>,
    is_progress: Option<bool>,
    at_end_of_range: Vec<&'a str>,
    is_believable: bool,
    robot_file: Option<&'a Path>,
}

impl<'a> WithFreed<'a> {
    fn of(freed: &'a FreedLinks, written: Option<&'a RobotFile>) -> Self {
        let held_out = freed.held_out.as_ref();
        WithFreed {
            groups: freed.groups.iter().map(|g| g.key()).collect(),
            parameters_freed: freed.freed,
            departing: &freed.departing,
            error_before: freed.before.after.totals,
            held_out_nrms_before: held_out.map(|[before, _]| before.nrms()),
            held_out_nrms_after: held_out.map(|[_, after]| after.nrms()),
            is_progress: freed.progress,
            at_end_of_range: freed.at_end_of_range(),
            is_believable: freed.is_believable(),
            robot_file: written.map(|file| file.path.as_path()),
        }
    }
}

/// The robot file that `--write-robot` names.
struct RobotFile {
    path: PathBuf,
    /// As `campaign.toml` refers to it.
    name: String,
}

impl RobotFile {
    /// Checked before anything is fitted.
    fn new(campaign: &Campaign, path: &Path) -> Result<Self> {
        let wrong = |what: &str, remedy: String| {
            let error = InputError::new(what).file(path).key("--write-robot");
            Err(error.remedy(remedy).into())
        };
        let file_name = path.file_name().map(|n| n.to_string_lossy().into_owned());
        let Some(file_name) = file_name else {
            return wrong("is no name of a file", "give the path of a new robot file".into());
        };
        let in_folder = campaign.dir.join(&file_name);
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let inside = folder.canonicalize().ok().zip(campaign.dir.canonicalize().ok());
        let Some(inside) =
            inside.and_then(|(folder, dir)| folder.strip_prefix(dir).map(Path::to_path_buf).ok())
        else {
            return wrong(
                "is not in the campaign's folder, and a campaign names no robot file elsewhere",
                format!("--write-robot {}", shell_word(&in_folder)),
            );
        };
        if path.symlink_metadata().is_ok() {
            return Err(Self::taken(path));
        }
        Ok(RobotFile {
            path: path.to_path_buf(),
            name: inside.join(file_name).to_string_lossy().replace('\\', "/"),
        })
    }

    fn taken(path: &Path) -> Error {
        InputError::new("is there already; nothing was written")
            .file(path)
            .key("--write-robot")
            .remedy("give another name, or take the file away")
            .into()
    }

    fn write(&self, campaign: &Campaign, freed: &FreedLinks) -> Result<()> {
        let before = campaign
            .robot
            .as_ref()
            .map_or("the robot file", |robot| &robot.model);
        let [was, is] = [&freed.before, &freed.after].map(|fit| percent(fit.after.totals.nrms));
        let judged = match (freed.is_believable(), freed.progress) {
            (false, _) => {
                " These values cannot be believed: some stand at the end of their range, and far more than noise is left."
            }
            (true, Some(false)) => {
                " Postures left out of the fit are predicted no better than chance would make it."
            }
            _ => "",
        };
        let robot = freed.robot();
        let mut about = RobotComments {
            head: vec![
                format!(
                    "Made by lobestone of {before}: link parameters fitted to the FRFs of {} (error {was} -> {is}).{judged}",
                    campaign.name
                ),
                format!(
                    "Joint compliances and all else are those of {before}; calibrate fits the joints anew."
                ),
            ],
            joints: vec![Vec::new(); robot.joints.len()],
            links: vec![Vec::new(); robot.links.len()],
            compliance: None,
        };
        for p in freed.departures() {
            let (of, number) = p.name.split_once('.').unwrap_or((&p.name, ""));
            let told = format!(
                "{number} fitted: {}; {} in {before}",
                plus_minus(p.value, p.std_error, p.unit),
                format_si(p.initial, p.unit, 4)
            );
            let index = |kind: &str| of.strip_prefix(kind)?.parse::<usize>().ok()?.checked_sub(1);
            let place = match (index("joint-"), index("link-")) {
                (Some(i), _) => about.joints.get_mut(i),
                (_, Some(i)) => about.links.get_mut(i),
                _ => None,
            };
            place.unwrap_or(&mut about.head).push(told);
        }
        match write_new(&self.path, robot.to_toml(&about).as_bytes())? {
            true => Ok(()),
            false => Err(Self::taken(&self.path)),
        }
    }

    fn told(&self, campaign: &Campaign) -> String {
        format!(
            "written: {}; to use it, put model = {} into [robot] of {}: `calibrate` comes to the same error then\n",
            self.path.display(),
            quoted(&self.name),
            campaign_file(&campaign.dir).display()
        )
    }
}

/// What freeing link parameters did to the error, and how to keep it.
fn describe_freed(campaign: &Campaign, freed: &FreedLinks, args: &CalibrateArgs) -> String {
    if freed.departing.is_empty() {
        return format!(
            "\nall {} link parameters that were free agree with the robot file within their errors: leave them as they are\n",
            freed.freed
        );
    }
    let dir = shell_word(&campaign.dir);
    let believable = freed.is_believable();
    let verb = match believable && freed.progress != Some(false) {
        true => "cannot be what the robot file says",
        false => "fit better with other values than the robot file's",
    };
    let mut text = format!(
        "\nof {} link parameters that were free {} {verb}: {}; the others agree with it and were left alone\nwith the links as in the \
         robot file the error was {}",
        freed.freed,
        freed.departing.len(),
        freed.departing.join(", "),
        percent(freed.before.after.totals.nrms)
    );
    if let Some([before, after]) = &freed.held_out {
        text += &format!(
            "; on postures left out of the fit {} -> {}",
            percent(before.nrms()),
            percent(after.nrms())
        );
    }
    if !believable {
        let ends: Vec<String> = freed.at_end_of_range().into_iter().map(str::to_string).collect();
        let stand = match ends.len() {
            1 => "stands at the end of its range",
            _ => "stand at the end of their range",
        };
        let rigid = match freed.after.case.bends() {
            true => "",
            false => " (its links are rigid: where the real ones bend, `link-flexibility` is missing)",
        };
        return text
            + &format!(
                "\nthese values cannot be believed: {} {stand}, and the misfit is still {} times that of noise. Links imitate what the model \
                 does not have{rigid}: leave them as they are, and see what `lobestone diagnose {dir}` finds missing\n",
                listed(&ends),
                number(freed.after.calibration.reduced_chi2, 2)
            );
    }
    text += match freed.progress {
        Some(true) => ", better by more than chance\n",
        Some(false) => ", no better than chance would make it: leave them as they are\n",
        None => "\n",
    };
    if freed.progress != Some(false) && args.write_robot.is_none() {
        let groups: Vec<String> = args
            .free
            .iter()
            .filter_map(ValueEnum::to_possible_value)
            .map(|v| v.get_name().to_string())
            .collect();
        text += &format!(
            "to keep them, write a robot file: `lobestone calibrate {dir} --free {} --write-robot {}`\n",
            groups.join(","),
            shell_word(&campaign.dir.join("robot-fitted.toml"))
        );
    }
    text
}

/// The fitted parameters as a table. Of an effect the robot file says nothing.
pub fn describe_parameters(model: &StructureModel, calibration: &Calibration) -> String {
    let rows: Vec<Vec<String>> = calibration
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let of_robot = i < model.baseline_parameter_count();
            let (initial, change) = match (of_robot, model.parameters[i].scale, p.unit) {
                // A coordinate has no natural zero that a share could be taken of.
                (true, Scale::Linear, "m") => (
                    format_si(p.initial, p.unit, 4),
                    format!("{:+.2} mm", 1e3 * (p.value - p.initial)),
                ),
                (true, ..) => (
                    format_si(p.initial, p.unit, 4),
                    format!("{:+.1} %", 100.0 * (p.value / p.initial - 1.0)),
                ),
                _ => ("–".into(), "–".into()),
            };
            vec![
                parameter_of(&p.name),
                initial,
                plus_minus(p.value, p.std_error, p.unit),
                change,
            ]
        })
        .collect();
    table(
        &["parameter", "robot file", "fitted ± standard error", "change"],
        &rows,
    )
}
