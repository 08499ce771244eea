//! `lobestone report`: what it writes, and what it leaves alone when it cannot.

use std::path::{Path, PathBuf};

use crate::support::program;
use lobestone::builtin::FIRST_CELL;
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

/// A page that loads nothing: images inside, no script, style or font from elsewhere.
pub fn assert_self_contained(html: &str) {
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
    let json = json_of(&["report", text(&dir), "--out", text(&out), "--json"]);
    assert_eq!(json["html"], text(&out.join("report.html")));
    assert!(!dir.join("report").exists());
}

#[test]
fn one_broken_part_does_not_take_the_others_with_it() {
    let (_folder, dir) = small_campaign();
    for cut in ["01", "02", "03", "04"] {
        std::fs::write(dir.join(format!("force/cut{cut}.txt")), "no measurement at all\n").unwrap();
    }
    let json = json_of(&["report", text(&dir), "--json"]);
    let html = std::fs::read_to_string(json["html"].as_str().unwrap()).unwrap();
    assert!(html.contains("<section id=\"frfs\">"));
    assert!(html.contains("This part could not be worked out."));
    assert!(html.contains("cut01.txt"), "the error names the file");
    assert_eq!(json["missing"].as_array().unwrap().len(), 1);
}

#[test]
fn what_cannot_be_reported_leaves_the_earlier_report_alone() {
    let (_folder, dir) = small_campaign();
    let html = dir.join("report/report.html");
    assert!(run(&["report", text(&dir)]).status.success());
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
    let json = json_of(&["report", text(&dir), "--json"]);
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
