//! `lobestone sweep`: limits and stiffness over the workspace, in shards.

use std::path::PathBuf;

#[cfg(not(feature = "parquet"))]
use crate::commands::Outcome;
use crate::lobes::workspace_grid::Span;
#[cfg(not(feature = "parquet"))]
use crate::{InputError, Result};

/// Postures nearer to a singularity are usually of no use.
const USUAL_SINGULARITY_MARGIN: f64 = 0.05;

#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  lobestone sweep cell7 --out map                    # everything at once\n  \
                  lobestone sweep cell7 --out map --shard 3/20       # one of twenty parts\n  \
                  lobestone sweep --merge --out map                  # the parts as one table\n\
                  scripts/sweep holds a Snakemake workflow that runs the parts on one machine or a cluster."
)]
pub struct SweepArgs {
    /// The campaign folder (with campaign.toml in it).
    #[arg(required_unless_present = "merge")]
    dir: Option<PathBuf>,
    /// Where the map is written: sweep.json, shards/, and merged sweep.parquet, summary.json and pictures.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// x of the tool point in the robot's base frame, m: FROM:TO:STEP, or one value [default: 11 values, 0.6 m on either
    /// side of the posture's tool point].
    #[arg(long, value_name = "FROM:TO:STEP", allow_hyphen_values = true)]
    x_m: Option<Span>,
    /// y, likewise.
    #[arg(long, value_name = "FROM:TO:STEP", allow_hyphen_values = true)]
    y_m: Option<Span>,
    /// z, likewise [default: 5 values, 0.3 m on either side].
    #[arg(long, value_name = "FROM:TO:STEP", allow_hyphen_values = true)]
    z_m: Option<Span>,
    /// Along the tool, from the spindle to the workpiece; may be repeated [default: as at the posture].
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    direction: Vec<[f64; 3]>,
    /// Steps of the redundancy angle (the robot turned about the tool's axis), degrees [default: that of
    /// lobes.redundancy, else 30].
    #[arg(long, value_name = "DEG")]
    angle_step_deg: Option<f64>,
    /// The posture that angle 0 and the branch of the joints refer to [default: that of lobes.redundancy, else the
    /// first].
    #[arg(long, value_name = "ID")]
    posture: Option<String>,
    /// Postures nearer to a singularity than this (0 to 1) count as not usable.
    #[arg(long, value_name = "MARGIN", default_value_t = USUAL_SINGULARITY_MARGIN)]
    singularity_margin: f64,
    /// Only this part of the map, such as 3/20; one that is there already is left as it is.
    #[arg(long, value_name = "K/N")]
    shard: Option<String>,
    /// Put the shards of --out together, with a summary and a picture.
    #[arg(
        long,
        conflicts_with_all = ["dir", "shard", "x_m", "y_m", "z_m", "direction", "angle_step_deg", "posture"]
    )]
    merge: bool,
}

fn direction(text: &str) -> std::result::Result<[f64; 3], String> {
    let numbers: Vec<f64> = text
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .collect();
    let three: Option<[f64; 3]> = numbers.try_into().ok();
    three
        .filter(|_| text.split(',').count() == 3)
        .ok_or_else(|| "write three numbers, such as 0,0,-1".to_string())
}

/// The map is a Parquet table, and this program was built without them.
#[cfg(not(feature = "parquet"))]
pub fn run(args: SweepArgs) -> Result<Outcome> {
    Err(InputError::new(
        "this program was built without Parquet tables, which a map of the workspace is written as",
    )
    .file(args.out)
    .remedy("build it with the feature parquet, which is on by default: cargo build --release")
    .into())
}

#[cfg(feature = "parquet")]
pub use with_tables::run;

#[cfg(feature = "parquet")]
mod with_tables {
    use std::path::Path;
    use std::time::Instant;

    use serde_json::{Value, json};

    use crate::analysis::{Shard, Sweep, SweepRequest};
    use crate::campaign::Campaign;
    use crate::commands::measure::sweep::SweepArgs;
    use crate::commands::outcome::Outcome;
    use crate::commands::text::{number, warnings};
    use crate::files::write_atomically;
    use crate::lobes::workspace::PlaceStatus;
    use crate::report::figure::CellFormat;
    use crate::report::stores::sweep_folder::SweepFolder;
    use crate::report::stores::sweep_summary;
    use crate::text::shell_word;
    use crate::{Error, InputError, Result};

    /// Quantity, label, name of the picture.
    const PICTURES: [(&str, &str, &str); 2] = [
        ("best_depth_mm", "Depth at the best speed, mm", "best-depth.png"),
        (
            "absolute_limit_mm",
            "Depth stable at every speed, mm",
            "absolute-limit.png",
        ),
    ];

    pub fn run(args: SweepArgs) -> Result<Outcome> {
        let Some(dir) = args.dir.as_ref().filter(|_| !args.merge) else {
            return merge(&args.out, Vec::new());
        };
        let shard = args.shard.as_deref().map(str::parse::<Shard>).transpose()?;
        let campaign = Campaign::load(dir)?;
        let sweep = Sweep::new(
            &campaign,
            &SweepRequest {
                posture: args.posture.clone(),
                spans_m: [args.x_m, args.y_m, args.z_m],
                directions: args.direction.clone(),
                angle_step_deg: args.angle_step_deg,
                least_singularity_margin: args.singularity_margin,
            },
        )?;
        let whole = Shard { number: 1, of: 1 };
        let part = part(&sweep, &args.out, shard.unwrap_or(whole))?;
        match shard {
            Some(_) => Ok(part),
            None => merge(&args.out, sweep.warnings.clone()).map(|merged| Outcome {
                text: part.text + &merged.text,
                ..merged
            }),
        }
    }

    fn part(sweep: &Sweep, out: &Path, shard: Shard) -> Result<Outcome> {
        let count = sweep.grid.place_count();
        if shard.of > count {
            return Err(InputError::new(format!("{} shards of {count} places", shard.of))
                .remedy("fewer shards, or a finer grid")
                .into());
        }
        let folder = SweepFolder::begin(out, &sweep.settings, shard.of, count)?;
        let places = shard.places(count);
        let name = format!("shard {} of {}", shard.number, shard.of);
        let merge = format!("lobestone sweep --merge --out {}", shell_word(out));
        let mut json = json!({
            "shard": shard.number,
            "shards": shard.of,
            "file": folder.path(shard),
            "from_place": places.start,
            "places": places.len(),
            "skipped": folder.has(shard)?,
            "settings": sweep.settings,
            "warnings": sweep.warnings,
        });
        if json["skipped"] == true {
            let text = format!(
                "{name} is there already and stays as it is: {}\n",
                folder.path(shard).display()
            );
            return Ok(Outcome::new(json, text + &warnings(&sweep.warnings), None));
        }
        let begun = Instant::now();
        let rows = sweep.rows(places.clone())?;
        let seconds = begun.elapsed().as_secs_f64();
        folder.write(shard, &rows)?;
        let of_status = |status: PlaceStatus| rows.iter().filter(|r| r.status == status).count();
        let usable = of_status(PlaceStatus::Reachable);
        json["counts"] = PlaceStatus::ALL
            .iter()
            .map(|s| (s.name().to_string(), json!(of_status(*s))))
            .collect();
        json["seconds"] = json!(seconds);
        json["places_per_s"] = json!(places.len() as f64 / seconds.max(1e-9));
        let text = format!(
            "{name}: {} places, {usable} of them usable, in {} s ({} places/s)\n{}",
            places.len(),
            number(seconds, 3),
            number(places.len() as f64 / seconds.max(1e-9), 3),
            warnings(&sweep.warnings)
        );
        let next = (shard.of > 1).then(|| format!("when every shard is there, {merge}"));
        Ok(Outcome::new(json, text, next))
    }

    fn merge(out: &Path, sweep_warnings: Vec<String>) -> Result<Outcome> {
        let folder = SweepFolder::open(out)?;
        let table = folder.merge()?;
        let best = |quantity: &str| -> Result<Value> {
            let found = sweep_summary::greatest(&table, quantity)?;
            let row = found.map(|place| table.row(place)).transpose()?;
            Ok(row.map_or(Value::Null, Value::Object))
        };
        let steps = sweep_summary::steps(&table)?;
        let mut images = Vec::new();
        for (quantity, label, name) in PICTURES {
            let format = CellFormat::Significant(3);
            if let Some(picture) = sweep_summary::picture(&table, &steps, quantity, label, format)? {
                let path = out.join(name);
                write_atomically(&path, &picture.png()?)?;
                images.push(path);
            }
        }
        let summary = out.join("summary.json");
        let document = json!({
            "table": table.path,
            "summary": summary,
            "images": images,
            "places": table.places,
            "shards": folder.shards,
            "counts": sweep_summary::counts(&table)?,
            "quantiles": sweep_summary::quantiles(&table)?,
            "deepest_cut": best("best_depth_mm")?,
            "highest_absolute_limit": best("absolute_limit_mm")?,
            "stiffest": best("least_stiffness_n_per_m")?,
            "settings": folder.settings,
            "warnings": sweep_warnings,
        });
        let written = serde_json::to_vec_pretty(&document).map_err(|e| Error::computation(e.to_string()))?;
        write_atomically(&summary, &written)?;
        let text = summary_text(&document) + &warnings(&sweep_warnings);
        Ok(Outcome::new(document, text, None))
    }

    fn summary_text(document: &Value) -> String {
        let mut text = format!("{} places:", document["places"]);
        let counts = document["counts"].as_object().into_iter().flatten();
        let counts: Vec<String> = counts
            .filter(|(_, n)| **n != json!(0))
            .map(|(status, n)| format!(" {n} {status}"))
            .collect();
        text += &counts.join(",");
        text.push('\n');
        let say = |key: &str, what: &str, of: &str, unit: &str| {
            let row = &document[key];
            let value = |key: &str| row[key].as_f64();
            let Some(found) = value(of) else {
                return format!("{what}: nowhere\n");
            };
            let part = |key: &str, digits: usize| value(key).map_or("–".into(), |v| number(v, digits));
            format!(
                "{what}: {} {unit} with the tool at x {} y {} z {} m, angle {}°, {} rpm; joints {}°\n",
                number(found, 4),
                part("x_m", 4),
                part("y_m", 4),
                part("z_m", 4),
                part("angle_deg", 4),
                part("best_spindle_rpm", 4),
                (1..=6)
                    .map(|i| part(&format!("q{i}_deg"), 5))
                    .collect::<Vec<_>>()
                    .join(" "),
            )
        };
        text += &say("deepest_cut", "Deepest cut", "best_depth_mm", "mm");
        text += &say(
            "highest_absolute_limit",
            "Deepest at every speed",
            "absolute_limit_mm",
            "mm",
        );
        let median = &document["quantiles"]["best_depth_mm"]["median"];
        if let Some(median) = median.as_f64() {
            text += &format!(
                "Half of the usable places allow {} mm or more at their best speed\n",
                number(median, 3)
            );
        }
        let files = [&document["table"], &document["summary"]].into_iter();
        let images = document["images"].as_array().into_iter().flatten();
        for file in files.chain(images).filter_map(Value::as_str) {
            text += &format!("  {file}\n");
        }
        text
    }
}
