use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use crate::commands::{Outcome, next_step};
use crate::ingest::Quantity;
use crate::simulate::forces::{self, ForceScenario};
use crate::simulate::{
    CampaignKind, EffectRequest, FrfFormat, FrfLayout, LabRobot, LineNoise, Slip, StructureScenario,
    check_target, departure, random, structure, truth_beside,
};
use crate::{InputError, Result, effects, simulate};

/// What the files hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum QuantityArg {
    /// Displacement per force.
    Receptance,
    /// Velocity per force.
    Mobility,
    /// Acceleration per force.
    Accelerance,
}

#[derive(clap::Args)]
#[command(
    after_help = "The folder stays blind: what was hidden stands in DIR.truth.json next to it, not in it. The data \
                        come from the same model that the fits use.\n\nExamples:\n  lobestone simulate --out cell1\n  \
                        lobestone simulate --out cell2 --effect payload:mass_kg=25 --seed 3\n  lobestone simulate --out \
                        cell3 --kind dirty --visibility 20 \\\n    --effect joint-transverse-compliance@joint-3\n  lobestone \
                        simulate --out cell4 --unknown\n  lobestone simulate --out cell5 --random --seed 5\n  lobestone simulate --out cell6 \
                        --effect tooth-radii:short_mm=0.03"
)]
pub struct SimulateArgs {
    /// Folder to write; must not exist, or be empty.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Where the truth goes instead of DIR.truth.json.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Same seed and options, same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Draw everything from the seed: kind, effect (or none, or one that is not in the library), how plainly it shows.
    /// Of the other options only --out, --truth, --seed and --lines-hz count.
    #[arg(
        long,
        value_enum,
        value_name = "TIER",
        num_args = 0..=1,
        default_missing_value = "mixed",
        conflicts_with_all = ["kind", "effects", "unknown", "strength", "visibility", "possible", "noise", "noise_floor", "postures",
            "spread_deg", "points", "band", "format", "quantity", "mass_error", "stiffness_error", "force_levels", "robot",
            "share", "laboratory", "line_noise", "common_noise"]
    )]
    random: Option<random::Tier>,
    /// How well the campaign is measured; single options below override it.
    #[arg(long, value_enum, default_value = "careful")]
    kind: CampaignKind,
    /// Force records of milled cuts instead of FRFs; an --effect on cutting forces says that, too. Of the other options only --out,
    /// --truth, --seed, --effect, --strength and --noise-n count.
    #[arg(long, conflicts_with_all = ["unknown", "visibility", "possible", "noise", "noise_floor", "postures", "spread_deg", "points", "band",
        "format", "quantity", "mass_error", "stiffness_error", "force_levels", "laboratory", "line_noise", "common_noise", "random"])]
    milling: bool,
    /// Noise of each channel of force records, N; drawn where it is left out.
    #[arg(long, value_name = "N")]
    noise_n: Option<f64>,
    /// EFFECT[@SITE][:parameter=value,…]: physics to hide in the data; may be given several times. What is not given is
    /// drawn.
    #[arg(long = "effect", value_name = "EFFECT")]
    effects: Vec<EffectRequest>,
    /// Hide physics that the library of effects does not have (drawn, or the one named).
    #[arg(long, value_name = "KIND", num_args = 0..=1, default_missing_value = "")]
    unknown: Option<String>,
    /// Make what --unknown hides as faint as this: χ² per value above noise after everything else was refitted (0.03: 3 %).
    #[arg(
        long,
        value_name = "SHARE",
        requires = "unknown",
        conflicts_with = "visibility"
    )]
    share: Option<f64>,
    /// Small errors of setup everywhere, as in a real laboratory: all of them, or those named.
    #[arg(long, value_enum, value_name = "SLIPS", value_delimiter = ',', num_args = 0..)]
    laboratory: Option<Vec<Slip>>,
    /// How the noise of neighbouring lines belongs together.
    #[arg(long, value_enum, value_name = "KIND")]
    line_noise: Option<LineNoise>,
    /// Share of the noise's variance that all outputs of one hit have in common.
    #[arg(long, value_name = "SHARE")]
    common_noise: Option<f64>,
    /// Size of the effects against what is drawn; values given with --effect stay as given.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    strength: f64,
    /// Instead: size at which each effect stands out of the noise by so many standard deviations, after everything else
    /// was refitted (5: barely visible; 50: clear; 500: plain).
    #[arg(long, value_name = "SIGMAS", conflicts_with = "strength")]
    visibility: Option<f64>,
    /// With --visibility: keep to possible sizes, however faint the effect should be (otherwise links a hundred times as stiff as steel
    /// may be hidden, which `diagnose` rightly does not call flexible).
    #[arg(long, requires = "visibility")]
    possible: bool,
    /// Noise as a share of the response (0.02: 2 %); 0 also takes the constant part away.
    #[arg(long, value_name = "SHARE")]
    noise: Option<f64>,
    /// Noise that is always there, m/N.
    #[arg(long, value_name = "M_PER_N")]
    noise_floor: Option<f64>,
    /// Number of postures.
    #[arg(long, value_name = "N")]
    postures: Option<usize>,
    /// How far each joint may be from the reference postures.
    #[arg(long, value_name = "DEGREES")]
    spread_deg: Option<f64>,
    /// Which FRFs are measured.
    #[arg(long, value_enum)]
    points: Option<FrfLayout>,
    /// First and last spectral line, Hz.
    #[arg(long, value_name = "FROM:TO", value_parser = crate::commands::range::band)]
    band: Option<[f64; 2]>,
    /// Spacing of the spectral lines.
    #[arg(long, value_name = "HZ")]
    lines_hz: Option<f64>,
    /// Format of the FRF files.
    #[arg(long, value_enum)]
    format: Option<FrfFormat>,
    /// What the FRF files hold.
    #[arg(long, value_enum)]
    quantity: Option<QuantityArg>,
    /// Relative standard deviation of the link masses; above zero it also stands in the campaign as mass_tolerance.
    #[arg(long, value_name = "SHARE")]
    mass_error: Option<f64>,
    /// Standard deviation of the logarithm of the joint stiffnesses about the robot file.
    #[arg(long, value_name = "SHARE")]
    stiffness_error: Option<f64>,
    /// Hammer levels in newtons: every FRF is measured at each.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    force_levels: Vec<f64>,
    /// Built-in robot, or the path of a robot file (copied into the campaign).
    #[arg(long, value_name = "MODEL", default_value = "irb6640")]
    robot: String,
}

pub fn run(args: SimulateArgs) -> Result<Outcome> {
    let truth = match &args.truth {
        Some(truth) => truth.clone(),
        None => truth_beside(&args.out)?,
    };
    check_target(&args.out, &truth)?;
    let is_on_forces = |e: &EffectRequest| forces::is_on_forces(&e.effect);
    let (lab, kind) = match args.milling || args.effects.iter().any(is_on_forces) {
        true => (forces::simulate(&force_scenario(&args)?)?, "force"),
        false => {
            let robot = LabRobot::load(&args.robot)?;
            (structure::simulate(&scenario(&args)?, &robot)?, "FRF")
        }
    };
    let written = lab.write(&args.out, &truth)?;
    let folder = format!("{}/", kind.to_lowercase());
    let records = lab.files.iter().filter(|f| f.0.starts_with(&folder)).count();
    let dir = written.dir.display();
    Ok(Outcome::new(
        Document {
            dir: &written.dir,
            truth: &written.truth,
            seed: args.seed,
            files: lab.files.iter().map(|(path, _)| path).collect(),
        },
        format!("{dir}: a simulated campaign, {records} {kind} files\n"),
        Some(next_step::simulated(&written.dir, &written.truth)),
    ))
}

/// What `simulate` wrote.
#[derive(Serialize)]
struct Document<'a> {
    dir: &'a Path,
    truth: &'a Path,
    seed: u64,
    files: Vec<&'a String>,
}

fn force_scenario(args: &SimulateArgs) -> Result<ForceScenario> {
    let positive = |v: f64| v.is_finite() && v >= 0.0;
    if !args.noise_n.is_none_or(positive) {
        return Err(InputError::new("is no noise")
            .key("--noise-n")
            .remedy("give a standard deviation in N, such as 4")
            .into());
    }
    Ok(ForceScenario {
        seed: args.seed,
        effects: args.effects.clone(),
        strength: args.strength,
        noise_n: args.noise_n,
    })
}

fn scenario(args: &SimulateArgs) -> Result<StructureScenario> {
    let mut scenario = match args.random {
        Some(tier) => random::scenario(tier, args.seed),
        None => StructureScenario::of_kind(args.kind, args.seed),
    };
    if let Some(step) = args.lines_hz {
        scenario.step_hz = step;
    }
    if args.random.is_some() {
        return Ok(scenario);
    }
    scenario.effects = args.effects.clone();
    if let Some(kind) = &args.unknown {
        match departure::ids().find(|id| id == kind) {
            Some(id) => scenario.departures.push(id.into()),
            None => scenario.effects.push(unknown(kind, args.seed)?),
        }
    }
    scenario.excess_share = args.share;
    if let Some(slips) = &args.laboratory {
        scenario.slips = match slips.is_empty() {
            true => Slip::value_variants().to_vec(),
            false => slips.clone(),
        };
    }
    scenario.line_noise = args.line_noise.unwrap_or_default();
    scenario.common_noise = args.common_noise.unwrap_or_default();
    scenario.strength = args.strength;
    scenario.visibility_sigmas = args.visibility;
    scenario.possible_only = args.possible;
    scenario.force_levels_n = args.force_levels.clone();
    scenario.noise_floor_m_per_n = match (args.noise_floor, args.noise) {
        (Some(floor), _) => floor,
        (None, Some(0.0)) => 0.0,
        _ => scenario.noise_floor_m_per_n,
    };
    scenario.band_hz = args.band.unwrap_or(scenario.band_hz);
    scenario.noise_relative = args.noise.unwrap_or(scenario.noise_relative);
    scenario.postures.count = args.postures.unwrap_or(scenario.postures.count);
    scenario.postures.spread_deg = args.spread_deg.unwrap_or(scenario.postures.spread_deg);
    scenario.layout = args.points.unwrap_or(scenario.layout);
    scenario.format = args.format.unwrap_or(scenario.format);
    scenario.mass_error = args.mass_error.unwrap_or(scenario.mass_error);
    scenario.stiffness_error = args.stiffness_error.unwrap_or(scenario.stiffness_error);
    scenario.quantity = match args.quantity {
        Some(QuantityArg::Receptance) => Quantity::Receptance,
        Some(QuantityArg::Mobility) => Quantity::Mobility,
        Some(QuantityArg::Accelerance) => Quantity::Accelerance,
        None => scenario.quantity,
    };
    Ok(scenario)
}

/// The foreign effect named, or one drawn where the name is empty.
fn unknown(kind: &str, seed: u64) -> Result<EffectRequest> {
    let name = match kind {
        "" => simulate::foreign::any(seed).id().to_string(),
        kind => kind.to_string(),
    };
    let in_library = effects::STRUCTURAL.iter().any(|e| e.id() == name);
    if in_library || simulate::foreign::find(&name).is_none() {
        let foreign = simulate::foreign::FOREIGN.iter().map(|e| e.id());
        let known: Vec<&str> = foreign.chain(departure::ids()).collect();
        return Err(
            InputError::new(format!("{name} is no effect outside the library"))
                .key("--unknown")
                .remedy(format!("leave the name out, or give one of {}", known.join(", ")))
                .into(),
        );
    }
    Ok(EffectRequest {
        effect: name,
        ..Default::default()
    })
}
