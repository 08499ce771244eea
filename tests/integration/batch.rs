//! `lobestone batch` and `lobestone fleet`: many campaigns, in shards, over nights.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{blind, copy_folder, document, lobestone, program};

/// Campaigns of two robots, small enough to be quick: FRFs, cuts, FRFs of which one file is missing, one that is no
/// campaign at all.
struct Nights {
    folder: tempfile::TempDir,
}

const MANIFEST: &str = "campaign,robot,date,shift\nfrf,r1,2026-11-01,late\ncuts,r2,2026-11-01,\nlost,r1,2026-11-02,\"late, cold\"\n\
                        nowhere,r2,2026-11-02,\n";

impl Nights {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let nights = Nights { folder };
        copy_folder(&blind("frf-9115"), &nights.path("frf"));
        copy_folder(&blind("force-9439"), &nights.path("cuts"));
        copy_folder(&blind("frf-9115"), &nights.path("lost"));
        std::fs::remove_file(nights.path("lost/frf/p2.uff")).unwrap();
        std::fs::write(nights.path("nights.csv"), MANIFEST).unwrap();
        nights
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, out: &str, more: &[&str]) -> Value {
        let (manifest, out) = (self.path("nights.csv"), self.path(out));
        let start = ["batch", text(&manifest), "--out", text(&out), "--do", "calibrate"];
        document(&[&start, more].concat())
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The rows of a CSV table by campaign, without what a clock says.
fn rows(file: &Path) -> BTreeMap<String, BTreeMap<String, String>> {
    let mut reader = csv::Reader::from_path(file).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_string).collect();
    let row = |row: csv::StringRecord| {
        let cells = names.iter().cloned().zip(row.iter().map(str::to_string));
        let mut cells: BTreeMap<String, String> = cells.filter(|(_, cell)| !cell.is_empty()).collect();
        cells.remove("seconds");
        (cells["campaign"].clone(), cells)
    };
    reader.records().map(|r| row(r.unwrap())).collect()
}

/// Every file below a folder with its contents.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(contents(&path)),
            false => drop(found.insert(path.clone(), std::fs::read(&path).unwrap())),
        }
    }
    found
}

#[test]
fn every_campaign_is_a_row_and_broken_ones_say_why() {
    let nights = Nights::new();
    let before = ["frf", "cuts", "lost"].map(|c| contents(&nights.path(c)));
    let json = nights.run("results", &["--do", "calibrate,compare"]);
    // `--do` given twice is both; the last two campaigns cannot be read.
    assert_eq!(
        (&json["campaigns"], &json["failed"], &json["skipped"]),
        (&4.into(), &2.into(), &0.into())
    );
    assert_eq!(json["command"], "calibrate,compare");
    let after = ["frf", "cuts", "lost"].map(|c| contents(&nights.path(c)));
    assert!(before == after, "a campaign folder was changed");

    let rows = rows(&nights.path("results/shards/shard-00001-of-00001.csv"));
    let cell = |campaign: &str, column: &str| rows[campaign].get(column).map_or("", String::as_str);
    let value = |campaign: &str, column: &str| cell(campaign, column).parse::<f64>().unwrap();
    assert_eq!([cell("frf", "status"), cell("cuts", "status")], ["done", "done"]);
    assert_eq!(
        [cell("lost", "status"), cell("nowhere", "status")],
        ["failed", "failed"]
    );
    assert!(
        cell("lost", "error").contains("frf/p2.uff does not exist"),
        "{rows:?}"
    );
    assert!(cell("nowhere", "error").contains("no such folder"), "{rows:?}");
    assert_eq!((cell("lost", "shift"), cell("lost", "nrms")), ("late, cold", ""));
    assert_eq!(
        (cell("frf", "robot"), cell("frf", "date"), cell("frf", "domain")),
        ("r1", "2026-11-01", "structure")
    );

    // The same numbers as the commands one by one.
    let same = |campaign: &str, column: &str, expected: &Value| {
        let expected = expected.as_f64().unwrap();
        assert!(
            (value(campaign, column) / expected - 1.0).abs() < 1e-9,
            "{column}: {rows:?}, {expected}"
        );
    };
    let alone = document(&["calibrate", text(&nights.path("frf"))]);
    same("frf", "nrms", &alone["error"]["nrms"]);
    for (i, p) in alone["parameters"].as_array().unwrap().iter().take(6).enumerate() {
        let column = format!("joint-{}.stiffness_nm_per_rad", i + 1);
        assert_eq!(p["name"], format!("joint-{}.stiffness", i + 1));
        same("frf", &column, &p["value"]);
        same("frf", &format!("{column}_std_error"), &p["std_error"]);
    }
    let alone = document(&["cfc", text(&nights.path("cuts"))]);
    same(
        "cuts",
        "drilling.unnamed.ktc_n_per_mm2",
        &alone["pooled"][0]["ktc_n_per_mm2"]["value"],
    );
    same(
        "cuts",
        "drilling.unnamed.kfc_n_per_mm2_std_error",
        &alone["pooled"][0]["kfc_n_per_mm2"]["std_error"],
    );
    let alone = document(&["compare", text(&nights.path("cuts"))]);
    same("cuts", "nrms", &alone["error"]["nrms"]);
    same("cuts", "held_out_nrms", &alone["error"]["held_out_nrms"]);
}

#[test]
fn done_work_is_skipped_until_something_changes() {
    let nights = Nights::new();
    assert_eq!(nights.run("results", &[])["skipped"], 0);
    let table = nights.path("results/shards/shard-00001-of-00001.csv");
    let first = std::fs::read(&table).unwrap();
    let again = nights.run("results", &[]);
    assert_eq!((&again["skipped"], &again["failed"]), (&4.into(), &2.into()));
    // Seconds, too, are those of the work.
    assert_eq!(std::fs::read(&table).unwrap(), first);

    // The missing file comes, a file that is there changes, one result is cut off, another worker was killed while writing.
    std::fs::copy(nights.path("frf/frf/p2.uff"), nights.path("lost/frf/p2.uff")).unwrap();
    let cut = nights.path("cuts/campaign.toml");
    let toml = std::fs::read_to_string(&cut).unwrap();
    std::fs::write(&cut, format!("{toml}\n# looked at\n")).unwrap();
    let kept = nights.path("results/campaigns");
    let result = |name: &str| {
        let all = std::fs::read_dir(&kept).unwrap().map(|e| e.unwrap().path());
        let mut found = all.filter(|p| p.file_name().unwrap().to_str().unwrap().starts_with(name));
        found.next().unwrap()
    };
    let whole = std::fs::read(result("frf-")).unwrap();
    std::fs::write(result("frf-"), &whole[..whole.len() / 2]).unwrap();
    std::fs::write(kept.join(".lobestone-killed"), &whole[..7]).unwrap();
    let changed = nights.run("results", &[]);
    assert_eq!(
        (&changed["skipped"], &changed["failed"]),
        (&1.into(), &1.into()),
        "{changed}"
    );
    let (now, then) = (rows(&table), rows_of(&first));
    assert_eq!(now["frf"], then["frf"]);
    assert_eq!(now["lost"]["status"], "done");
    assert_ne!(now["cuts"]["fingerprint"], then["cuts"]["fingerprint"]);

    // Other steps are other work; what failed is tried again where that is asked for.
    assert_eq!(nights.run("results", &["--retry"])["skipped"], 3);
    assert_eq!(nights.run("other", &[])["skipped"], 0);
}

fn rows_of(table: &[u8]) -> BTreeMap<String, BTreeMap<String, String>> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t.csv");
    std::fs::write(&file, table).unwrap();
    rows(&file)
}

#[test]
fn shards_are_the_whole() {
    let nights = Nights::new();
    nights.run("whole", &[]);
    let first = nights.run("parts", &["--shard", "1/2"]);
    assert_eq!(
        (&first["shard"], &first["shards"], &first["campaigns"]),
        (&1.into(), &2.into(), &2.into())
    );
    let half = document(&["fleet", text(&nights.path("parts"))]);
    assert_eq!(half["missing_shards"], serde_json::json!(["2/2"]));
    assert!(
        half["warnings"][0]
            .as_str()
            .unwrap()
            .contains("1 of 2 shards are missing: 2/2")
    );

    let (manifest, out) = (nights.path("nights.csv"), nights.path("parts"));
    let slurm = program()
        .args([
            "batch",
            text(&manifest),
            "--out",
            text(&out),
            "--do",
            "calibrate",
            "--shard",
            "slurm",
        ])
        .envs([
            ("SLURM_ARRAY_TASK_ID", "1"),
            ("SLURM_ARRAY_TASK_COUNT", "2"),
            ("SLURM_ARRAY_TASK_MIN", "0"),
        ])
        .output()
        .unwrap();
    assert!(
        slurm.status.success(),
        "{}",
        String::from_utf8_lossy(&slurm.stderr)
    );
    for (name, missing) in [("parts", 0), ("whole", 0)] {
        let json = document(&["fleet", text(&nights.path(name))]);
        assert_eq!(json["missing_shards"].as_array().unwrap().len(), missing);
    }
    let all = |name: &str| rows(&nights.path(name).join("fleet/all.csv"));
    assert_eq!(all("parts"), all("whole"));
    assert_eq!(all("parts").len(), 4);
}

#[test]
fn a_warm_start_ends_where_a_cold_one_does() {
    let nights = Nights::new();
    copy_folder(&blind("frf-9216"), &nights.path("later"));
    let list = "campaign,robot\nfrf,r1\ncuts,r1\nlater,r1\nfrf/../later,r2\n";
    std::fs::write(nights.path("nights.csv"), list).unwrap();
    nights.run("cold", &[]);
    assert_eq!(nights.run("warm", &["--warm-start"])["skipped"], 0);
    let table = |name: &str| rows(&nights.path(name).join("shards/shard-00001-of-00001.csv"));
    let (cold, warm) = (table("cold"), table("warm"));
    // The cuts between gave no structure; another robot starts afresh.
    let from = |campaign: &str| warm[campaign].get("started_from").map_or("", String::as_str);
    assert_eq!(
        ["frf", "cuts", "later", "frf/../later"].map(from),
        ["", "", "frf", ""]
    );
    let mut compared = 0;
    for (name, value) in &cold["later"] {
        if let Some(error) = cold["later"].get(&format!("{name}_std_error")) {
            let number = |text: &str| text.parse::<f64>().unwrap();
            let moved = (number(&warm["later"][name]) - number(value)).abs() / number(error);
            assert!(moved < 0.1, "{name}: {moved} standard errors");
            compared += 1;
        }
    }
    assert!(compared >= 6, "{cold:?}");

    // Broken off and run again: the same table, of the same starts.
    let lost = contents(&nights.path("warm/campaigns")).into_keys();
    let lost: Vec<PathBuf> = lost.filter(|path| text(path).contains("later")).collect();
    lost.iter().for_each(|path| std::fs::remove_file(path).unwrap());
    assert_eq!(nights.run("warm", &["--warm-start"])["skipped"], 2);
    assert_eq!(table("warm"), warm);
    // What a start was made of counts as what a campaign is made of; r2 has none.
    let about = nights.path("frf/campaign.toml");
    let changed = format!("{}\n# seen again\n", std::fs::read_to_string(&about).unwrap());
    std::fs::write(&about, changed).unwrap();
    assert_eq!(nights.run("warm", &["--warm-start"])["skipped"], 3);
}

#[test]
fn a_fleet_over_nights() {
    let nights = Nights::new();
    // Seven quiet nights of r1, and one in which joint 2 gave way: rows as a batch writes them.
    nights.run("results", &[]);
    let shard = nights.path("results/shards/shard-00001-of-00001.csv");
    let mut reader = csv::Reader::from_path(&shard).unwrap();
    let names = reader.headers().unwrap().clone();
    let quiet = reader
        .records()
        .map(Result::unwrap)
        .find(|r| &r[0] == "frf")
        .unwrap();
    let column = |name: &str| names.iter().position(|n| n == name).unwrap();
    let stiffness = column("joint-2.stiffness_nm_per_rad");
    let mut writer = csv::Writer::from_path(&shard).unwrap();
    writer.write_record(&names).unwrap();
    for night in 1..=8 {
        let mut row: Vec<String> = quiet.iter().map(str::to_string).collect();
        let level: f64 = quiet[stiffness].parse().unwrap();
        row[0] = format!("night{night}");
        row[column("date")] = format!("2026-11-{night:02}");
        row[column("line")] = (night + 1).to_string();
        row[column("verdict")] = if night == 8 { "effect" } else { "none" }.into();
        row[column("effect")] = if night == 8 { "payload" } else { "" }.into();
        let scatter = 0.002 * f64::from((night * 7) % 5);
        row[stiffness] = (level * if night == 8 { 0.8 } else { 1.0 + scatter }).to_string();
        row[column("joint-2.stiffness_nm_per_rad_std_error")] = (0.001 * level).to_string();
        writer.write_record(&row).unwrap();
    }
    writer.flush().unwrap();
    let json = document(&["fleet", text(&nights.path("results"))]);
    let robot = &json["robots"][0];
    assert_eq!(
        (&robot["robot"], &robot["attention"], &robot["new_verdict"]),
        (&"r1".into(), &"new-verdict".into(), &true.into())
    );
    assert_eq!(
        robot["reasons"][0].as_str().unwrap().split(',').next().unwrap(),
        "missing: payload"
    );
    let worst = &robot["parameters"][0];
    assert_eq!(worst["name"], "joint-2.stiffness_nm_per_rad");
    assert!(worst["last_sigmas"].as_f64().unwrap() < -3.0, "{worst}");
    let outside: Vec<bool> = worst["points"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| p["outside"].as_bool().unwrap())
        .collect();
    assert_eq!(outside, [[false; 7].as_slice(), &[true]].concat());
    let html = std::fs::read_to_string(json["html"].as_str().unwrap()).unwrap();
    assert!(
        html.contains("joint 2: stiffness (N·m&#x2f;rad) is out of its limits"),
        "no reason on the page"
    );
    for image in json["images"].as_array().unwrap() {
        assert!(
            std::fs::read(image.as_str().unwrap())
                .unwrap()
                .starts_with(b"\x89PNG")
        );
    }
    let told = lobestone(&["fleet", text(&nights.path("results"))]);
    assert!(
        told.stdout.contains("new verdict") && told.stdout.contains("missing: payload, before nothing"),
        "{}",
        told.stdout
    );
}

#[test]
fn wrong_manifests_and_folders_are_told() {
    let nights = Nights::new();
    let (manifest, out) = (nights.path("nights.csv"), nights.path("results"));
    let refused = |arguments: &[&str]| {
        let run = lobestone(arguments);
        assert_eq!((run.status, run.stdout.as_str()), (Some(1), ""), "{arguments:?}");
        run.stderr
    };
    let message = refused(&["batch", text(&manifest), "--out", text(&out), "--shard", "5/4"]);
    assert!(message.contains("is no shard"), "{message}");
    let message = refused(&["fleet", text(&out)]);
    assert!(
        message.contains("no shards of a batch") && message.contains("lobestone batch"),
        "{message}"
    );
    std::fs::write(&manifest, "campaign\nfrf\nfrf/\n").unwrap();
    let message = refused(&["batch", text(&manifest), "--out", text(&out)]);
    assert!(
        message.contains("nights.csv:3: frf stands in line 2, too"),
        "{message}"
    );
    std::fs::write(&manifest, "campaign\nfrf\n").unwrap();
    let message = refused(&["batch", text(&manifest), "--out", text(&out), "--warm-start"]);
    assert!(message.contains("add a column robot"), "{message}");
    assert!(!out.exists(), "a folder for work that was refused");
}
