//! `lobestone report`: what it writes, and what it leaves alone when it cannot.

use std::path::{Path, PathBuf};

use crate::support::{copy_of, document, program};
use lobestone::Error;
use lobestone::analysis::CampaignFindings;
use lobestone::builtin::FIRST_CELL;
use lobestone::campaign::Campaign;
use lobestone::report::campaign::page;
use serde_json::Value;
use tempfile::TempDir;

pub fn run(arguments: &[&str]) -> std::process::Output {
    program().args(arguments).output().unwrap()
}

pub fn json_of(arguments: &[&str]) -> Value {
    let output = run(arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Every image listed must be a PNG that decodes to the end.
pub fn assert_png(path: &Path) {
    let mut reader = png::Decoder::new(std::fs::File::open(path).unwrap())
        .read_info()
        .unwrap();
    let mut pixels = vec![0; reader.output_buffer_size()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert!(info.width >= 400 && info.height >= 100, "{}", path.display());
    let first = pixels[0];
    assert!(pixels.iter().any(|p| *p != first), "{} is blank", path.display());
}

/// A page that loads nothing: images inside, no script, style or font from elsewhere. Its own scripts are three: two
/// packed ones, of letters only, and what joins them.
pub fn assert_self_contained(html: &str) {
    let mut rest = html.to_string();
    for id in ["plotly", "figures"] {
        let begin = format!("<script type=\"application/octet-stream\" id=\"{id}\">");
        if let Some((before, after)) = rest.clone().split_once(&begin) {
            let (packed, after) = after.split_once("</script>").unwrap();
            assert!(
                packed
                    .bytes()
                    .all(|b| b.is_ascii_alphanumeric() || b"+/=".contains(&b))
            );
            rest = format!("{before}{after}");
        }
    }
    if let Some((before, after)) = rest.clone().split_once("<script>\n") {
        let (glue, after) = after.split_once("</script>").unwrap();
        assert!(!glue.contains("http") && !glue.contains("fetch(") && !glue.contains("import("));
        rest = format!("{before}{after}");
    }
    let html = rest;
    for outside in [
        "src=\"http",
        "src='http",
        "<script",
        "<link",
        "@import",
        "url(",
        "<iframe",
    ] {
        assert!(!html.contains(outside), "{outside}");
    }
    let images = html.matches("<img").count();
    assert!(images > 0);
    assert_eq!(html.matches("src=\"data:image/png;base64,").count(), images);
    for link in html.split("href=\"").skip(1) {
        let target = link.split('"').next().unwrap();
        assert!(target.starts_with('#') || target.ends_with(".png"), "{target}");
    }
}

/// Two postures and four cuts of the built-in campaign, which is quick.
fn small_campaign() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let dir = FIRST_CELL.write(folder.path()).unwrap();
    let file = dir.join("campaign.toml");
    let mut document: toml::Table = std::fs::read_to_string(&file).unwrap().parse().unwrap();
    for (key, most) in [("posture", 2), ("frf", 2), ("cut", 4)] {
        document[key].as_array_mut().unwrap().truncate(most);
    }
    std::fs::write(&file, document.to_string()).unwrap();
    (folder, dir)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_report_is_one_page_with_its_figures_beside_it() {
    let (_folder, dir) = small_campaign();
    let json = json_of(&["report", text(&dir), "--json"]);
    let html_path = Path::new(json["html"].as_str().unwrap());
    assert_eq!(html_path, dir.join("report/report.html"));
    let html = std::fs::read_to_string(html_path).unwrap();
    assert_self_contained(&html);
    assert!(html.len() < 8_000_000);
    let images = json["images"].as_array().unwrap();
    assert_eq!(html.matches("<img").count(), images.len());
    for image in images {
        assert_png(Path::new(image.as_str().unwrap()));
    }
    for section in [
        "summary",
        "frfs",
        "error-map",
        "missing-physics",
        "parameters",
        "modes",
        "records",
        "regression-milling",
        "lobes",
    ] {
        assert!(html.contains(&format!("<section id=\"{section}\">")), "{section}");
    }
    assert!(!html.contains("id=\"thesis\""), "only where asked for");
    assert_eq!(json["missing"].as_array().unwrap().len(), 0);
    assert_eq!(json.get("tables").is_some(), cfg!(feature = "parquet"));

    // The error that the page states is the one that compare computes.
    let compared = json_of(&["compare", text(&dir), "--json"]);
    let nrms = compared["structure"]["error"]["nrms"]
        .as_f64()
        .or(compared["error"]["nrms"].as_f64())
        .unwrap();
    let stated = lobestone::report::number::percent(nrms);
    assert!(
        html.contains(&format!("after calibration it is {stated}")),
        "{stated}"
    );
}

#[test]
fn the_folder_can_be_chosen() {
    let (folder, dir) = small_campaign();
    let out = folder.path().join("elsewhere/cell");
    let json = json_of(&[
        "report",
        text(&dir),
        "--no-diagnosis",
        "--out",
        text(&out),
        "--json",
    ]);
    assert_eq!(json["html"], text(&out.join("report.html")));
    assert!(!dir.join("report").exists());
}

#[test]
fn a_broken_file_stops_the_report_unless_a_partial_one_is_wanted() {
    let (_folder, dir) = small_campaign();
    let whole = json_of(&["report", text(&dir), "--no-diagnosis", "--json"]);
    let html = PathBuf::from(whole["html"].as_str().unwrap());
    let before = std::fs::read(&html).unwrap();
    for record in std::fs::read_dir(dir.join("force")).unwrap() {
        std::fs::write(record.unwrap().path(), "no measurement at all\n").unwrap();
    }
    let refused = run(&["report", text(&dir), "--no-diagnosis"]);
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8_lossy(&refused.stderr).to_string();
    assert!(
        message.contains("cut01.txt") && message.contains("--partial"),
        "{message}"
    );
    assert_eq!(std::fs::read(&html).unwrap(), before, "the whole report stays");
    for image in whole["images"].as_array().unwrap() {
        assert!(Path::new(image.as_str().unwrap()).exists());
    }

    let json = json_of(&["report", text(&dir), "--no-diagnosis", "--partial", "--json"]);
    let page = std::fs::read_to_string(&html).unwrap();
    assert!(page.contains("<section id=\"frfs\">"));
    assert!(page.contains("This part could not be worked out."));
    assert!(page.contains("cut01.txt"), "the error names the file");
    assert_eq!(json["missing"].as_array().unwrap().len(), 1);
    assert!(
        !dir.join("report/record-01.png").exists(),
        "figures of the earlier report go"
    );
}

#[test]
fn a_diagnosis_that_fails_takes_nothing_else_with_it() {
    let (_folder, dir) = small_campaign();
    let campaign = Campaign::load(&dir).unwrap();
    let mut findings = CampaignFindings::run(&campaign, false).unwrap();
    findings.diagnosis = Some(Err(Error::computation("no effect could be tried")));
    assert!(findings.input_errors().is_empty());
    assert_eq!(findings.errors().len(), 1);
    let html = page(&findings, None).html().unwrap();
    assert!(html.contains("<section id=\"missing-physics\">"));
    assert!(html.contains("This part could not be worked out. no effect could be tried"));
    assert!(html.contains("<section id=\"frfs\">") && html.contains("<section id=\"regression-milling\">"));
}

/// A cell with something hidden in it: what is missing, drawn and said as `diagnose` says it.
#[test]
fn the_report_says_which_physics_is_missing() {
    let copy = copy_of("frf-9114");
    let dir = text(copy.path());
    let found = document(&["diagnose", dir]);
    let json = json_of(&["report", dir, "--json"]);
    let html = std::fs::read_to_string(json["html"].as_str().unwrap()).unwrap();
    let start = html.find("<section id=\"missing-physics\">").unwrap();
    let section = &html[start..start + html[start..].find("</section>").unwrap()];
    let effect = found["effect"].as_str().unwrap();
    let stated = format!(
        "The model lacks {effect} (confidence {:.0} %)",
        100.0 * found["confidence"].as_f64().unwrap()
    );
    assert!(section.contains(&stated), "{stated}");
    // The card says it first: what, the error before and after, the check, the command.
    let card = &html[html
        .find("<article class=\"card missing\" id=\"verdict\"")
        .unwrap()..start];
    let card = &card[..card.find("</article>").unwrap()].replace("&#x2f;", "/");
    let name = effect.replace('-', " ");
    assert!(card.contains(&format!("Missing: {name}")), "{card:.600}");
    for key in ["nrms", "noise_floor_nrms"] {
        let stated = lobestone::report::number::percent(found["baseline"][key].as_f64().unwrap());
        assert!(card.contains(&stated), "{key}: {stated}");
    }
    let check = document(&["explain", effect])["lab_check"].as_str().unwrap()[..40].to_string();
    assert!(
        card.contains(&check) && card.contains(&format!("lobestone add {dir} {effect}")),
        "{check}"
    );
    assert!(card.contains("class=\"before\"") && card.contains("class=\"after\""));
    let best = found["candidates"][0]["nrms"].as_f64().unwrap();
    assert!(section.contains(&lobestone::report::number::percent(best)));
    // The template engine writes a slash as an entity.
    assert!(
        section
            .replace("&#x2f;", "/")
            .contains(&format!("lobestone add {dir} {effect}"))
    );
    let drawn = [
        "missing-candidates",
        "missing-map",
        "missing-frf-1",
        "missing-frf-2",
        "missing-frf-3",
    ];
    for name in drawn {
        let file = copy.path().join("report").join(format!("{name}.png"));
        assert!(section.contains(&format!("{name}.png")));
        assert_png(&file);
    }

    let without = json_of(&["report", dir, "--no-diagnosis", "--json"]);
    let html = std::fs::read_to_string(without["html"].as_str().unwrap()).unwrap();
    assert!(!html.contains("id=\"missing-physics\""));
    for name in drawn {
        assert!(
            !copy.path().join("report").join(format!("{name}.png")).exists(),
            "{name}"
        );
    }
}

/// After `add` the report says why: what the diagnosis said then, the model before and after; and calibration does not get
/// the credit for what the effect did.
#[test]
fn evidence_stays_after_an_effect_was_added() {
    let copy = copy_of("frf-9114");
    let dir = text(copy.path());
    let found = document(&["diagnose", dir]);
    let effect = found["effect"].as_str().unwrap();
    document(&["add", dir, effect]);
    let history = document(&["history", dir]);
    let why = &history["revisions"][1]["why"];
    assert!(history["revisions"][0]["why"].is_null());
    for key in ["verdict", "effect", "confidence"] {
        assert_eq!(why[key], found[key], "{key}");
    }
    let (then, now) = (&why["candidates"], &found["candidates"]);
    assert_eq!(then.as_array().unwrap().len(), now.as_array().unwrap().len());
    assert_eq!(then[0]["nrms"], now[0]["nrms"]);

    let json = json_of(&["report", dir, "--no-diagnosis", "--json"]);
    let html = std::fs::read_to_string(json["html"].as_str().unwrap()).unwrap();
    let percent = |v: &Value| lobestone::report::number::percent(v.as_f64().unwrap());
    let before = percent(&history["revisions"][0]["nrms"]);
    assert!(
        html.contains(&format!("after calibration alone it was {before}")),
        "{before}"
    );
    assert!(!html.contains("; after calibration it is"));
    let step = &html[html.find("<summary>Revision 1 + ").unwrap()..];
    let step = &step[..step.find("</details>").unwrap()];
    for said in [
        "Candidates then, best first",
        "Held-out test",
        "history-1-map.png",
        "history-1-frf.png",
        &before,
    ] {
        assert!(step.contains(said), "{said}");
    }
    let card = &html[html.find("<article class=\"card clean\"").unwrap()..];
    assert!(card[..card.find("</article>").unwrap()].contains("nothing added"));
}

#[test]
fn what_cannot_be_reported_leaves_the_earlier_report_alone() {
    let (_folder, dir) = small_campaign();
    let html = dir.join("report/report.html");
    assert!(run(&["report", text(&dir), "--no-diagnosis"]).status.success());
    let before = std::fs::read(&html).unwrap();
    let modified = std::fs::metadata(&html).unwrap().modified().unwrap();

    let toml = std::fs::read_to_string(dir.join("campaign.toml")).unwrap();
    let broken = toml.replace("joints_deg", "joint_degrees");
    std::fs::write(dir.join("campaign.toml"), broken).unwrap();
    let output = run(&["report", text(&dir)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());

    // A sound campaign file, but nothing that can be read.
    std::fs::write(
        dir.join("campaign.toml"),
        "schema = \"lobestone/campaign/1\"\nname = \"x\"\n[tool]\nkind = \"endmill\"\ndiameter_mm = 16.0\nteeth = 6\n\
         [[cut]]\nid = \"1\"\nfile = \"force/none.txt\"\nprocess = \"milling\"\nspindle_rpm = 1000.0\n\
         feed_per_tooth_mm = 0.1\naxial_depth_mm = 2.0\nimmersion = \"slot\"\n",
    )
    .unwrap();
    std::fs::write(dir.join("force/none.txt"), "nothing\n").unwrap();
    let output = run(&["report", text(&dir)]);
    assert_eq!(output.status.code(), Some(1));
    let message = String::from_utf8_lossy(&output.stderr).to_string();
    assert!(message.contains("none.txt"), "{message}");

    assert_eq!(std::fs::read(&html).unwrap(), before);
    assert_eq!(std::fs::metadata(&html).unwrap().modified().unwrap(), modified);
}

#[test]
fn a_campaign_with_nothing_in_it_is_told_so() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("campaign.toml"),
        "schema = \"lobestone/campaign/1\"\nname = \"empty\"\n",
    )
    .unwrap();
    let output = run(&["report", text(folder.path())]);
    assert_eq!(output.status.code(), Some(1));
    assert!(!folder.path().join("report").exists());
}

#[cfg(feature = "parquet")]
#[test]
fn tables_read_back_as_they_were_computed() {
    use polars::prelude::{ChunkAgg, ParquetReader, SerReader};

    let (_folder, dir) = small_campaign();
    let json = json_of(&["report", text(&dir), "--no-diagnosis", "--json"]);
    let tables = json["tables"].as_array().unwrap();
    let frame = |name: &str| {
        let path = tables
            .iter()
            .map(|t| t.as_str().unwrap())
            .find(|t| t.ends_with(&format!("tables/{name}.parquet")))
            .unwrap();
        ParquetReader::new(std::fs::File::open(path).unwrap())
            .finish()
            .unwrap()
    };
    let parameters = frame("parameters");
    let calibrated = json_of(&["calibrate", text(&dir), "--json"]);
    let expected: Vec<f64> = calibrated["parameters"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["value"].as_f64().unwrap())
        .collect();
    let read: Vec<f64> = parameters
        .column("value")
        .unwrap()
        .f64()
        .unwrap()
        .into_no_null_iter()
        .collect();
    assert_eq!(read, expected);

    assert_eq!(frame("errors_by_frf").height(), 18);
    assert_eq!(frame("errors_by_band").height(), 180);
    let averages = frame("cut_averages");
    assert_eq!(averages.height(), 4);
    // Milling has no torque: null, not zero.
    assert_eq!(averages.column("mz_nm").unwrap().null_count(), 4);
    let lobes = frame("lobes");
    assert_eq!(lobes.height(), 1401 * 4, "two postures, model and measured");
    assert!(
        lobes
            .column("depth_limit_mm")
            .unwrap()
            .f64()
            .unwrap()
            .min()
            .unwrap()
            > 0.0
    );
}
