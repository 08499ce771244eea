//! `lobestone sweep`: a map of the workspace, in one piece or in shards.

use std::path::Path;

use crate::support::lobestone;

/// A robot, a posture and a cut; without FRFs, so that nothing has to be calibrated.
fn campaign() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = "schema = \"lobestone/campaign/1\"\nname = \"map\"\n[robot]\nmodel = \"irb6640\"\n\
                [[posture]]\nid = \"p1\"\njoints_deg = [135.0, -2.0, 53.0, 83.0, 30.0, -117.0]\n\
                [lobes]\nprocess = \"drilling\"\nsource = \"model\"\nktc_n_per_mm2 = 1014.2\nkrc_n_per_mm2 = 619.9\n\
                teeth = 2\nhalf_point_angle_deg = 67.5\nfeed_per_rev_mm = 0.1\nspindle_rpm = [100.0, 1500.0, 10.0]\n";
    std::fs::write(folder.path().join("campaign.toml"), text).unwrap();
    folder
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[cfg(not(feature = "parquet"))]
#[test]
fn a_program_without_tables_says_so() {
    let folder = campaign();
    let out = folder.path().join("map");
    let run = lobestone(&["sweep", text(folder.path()), "--out", text(&out)]);
    assert_eq!(run.status, Some(1));
    assert!(
        run.stderr.contains("built without Parquet tables"),
        "{}",
        run.stderr
    );
    assert!(!out.exists());
}

#[cfg(feature = "parquet")]
mod with_tables {
    use super::*;
    use crate::support::{document, program};

    const GRID: [&str; 9] = [
        "--x-m",
        "-2.0:-0.5:0.5",
        "--y-m=0.2:4.0:1.9",
        "--z-m",
        "0.5",
        "--direction",
        "0,0,-1",
        "--angle-step-deg",
        "90",
    ];

    fn arguments<'a>(campaign: &'a Path, out: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
        [&["sweep", text(campaign), "--out", text(out)], &GRID[..], more].concat()
    }

    /// Whatever the number of shards and threads, the table is the same file; shards that are there stay.
    #[test]
    fn shards_and_threads_do_not_show_in_the_table() {
        let folder = campaign();
        let (whole, pieces) = (folder.path().join("whole"), folder.path().join("pieces"));
        let json = document(&arguments(folder.path(), &whole, &[]));
        assert_eq!(json["places"], 48);
        let counts = &json["counts"];
        let count = |status: &str| counts[status].as_u64().unwrap();
        assert!(count("reachable") > 10 && count("out-of-reach") > 10, "{counts}");
        let all = [
            "reachable",
            "forbidden",
            "out-of-reach",
            "joint-limit",
            "singular",
        ];
        assert_eq!(all.into_iter().map(count).sum::<u64>(), 48);
        assert!(json["images"].as_array().unwrap().len() == 2);
        for image in json["images"].as_array().unwrap() {
            assert!(
                std::fs::read(image.as_str().unwrap())
                    .unwrap()
                    .starts_with(b"\x89PNG")
            );
        }
        let written = std::fs::read(whole.join("summary.json")).unwrap();
        let written: serde_json::Value = serde_json::from_slice(&written).unwrap();
        assert_eq!(written["deepest_cut"], json["deepest_cut"]);

        for shard in ["2/3", "3/3", "1/3"] {
            let missing = lobestone(&["sweep", "--merge", "--out", text(&pieces)]);
            assert_eq!(missing.status, Some(1));
            let output = program()
                .args(arguments(folder.path(), &pieces, &["--shard", shard, "--json"]))
                .env("RAYON_NUM_THREADS", "1")
                .output()
                .unwrap();
            assert!(
                output.status.success(),
                "{}",
                String::from_utf8_lossy(&output.stderr)
            );
        }
        let second = pieces.join("shards/shard-00002-of-00003.parquet");
        let before = std::fs::metadata(&second).unwrap().modified().unwrap();
        let again = document(&arguments(folder.path(), &pieces, &["--shard", "2/3"]));
        assert_eq!(again["skipped"], true);
        assert_eq!(std::fs::metadata(&second).unwrap().modified().unwrap(), before);
        let merged = document(&["sweep", "--merge", "--out", text(&pieces)]);
        assert_eq!(merged["deepest_cut"], json["deepest_cut"]);
        let table = |out: &Path| std::fs::read(out.join("sweep.parquet")).unwrap();
        assert!(table(&whole) == table(&pieces));
    }

    /// The map's own posture is the posture of `lobes`, with its absolute limit; stiffness and frequency are those of
    /// `model`.
    #[test]
    fn the_map_agrees_with_lobes_and_model() {
        let folder = campaign();
        let model = document(&["model", text(folder.path())]);
        let posture = &model["postures"][0];
        let at = |axis: usize| posture["tcp_m"][axis].as_f64().unwrap().to_string();
        let out = folder.path().join("map");
        let (x, y, z) = (at(0), at(1), at(2));
        let json = document(&[
            "sweep",
            text(folder.path()),
            "--out",
            text(&out),
            "--x-m",
            &x,
            "--y-m",
            &y,
            "--z-m",
            &z,
            "--angle-step-deg",
            "360",
        ]);
        let row = &json["deepest_cut"];
        let lobes = document(&["lobes", text(folder.path())]);
        let reason = lobes["axial_torsional"]["left_out_because"].as_str().unwrap();
        assert!(json["warnings"].to_string().contains(reason), "{json}");
        let close = |name: &str, a: &serde_json::Value, b: &serde_json::Value| {
            let (a, b) = (a.as_f64().unwrap(), b.as_f64().unwrap());
            assert!((a / b - 1.0).abs() < 1e-6, "{name}: {a} {b}");
        };
        close("limit", &row["absolute_limit_mm"], &lobes["absolute_limit_mm"]);
        close("chatter", &row["absolute_limit_hz"], &lobes["absolute_limit_hz"]);
        for axis in ["x", "y", "z"] {
            let ours = &row[format!("stiffness_{axis}_n_per_m")];
            close(axis, ours, &posture["tcp_stiffness_n_per_m"][axis]);
        }
        close(
            "frequency",
            &row["lowest_frequency_hz"],
            &posture["natural_frequencies_hz"][0],
        );
        for (i, joint) in [135.0, -2.0, 53.0, 83.0, 30.0, -117.0].into_iter().enumerate() {
            assert!(
                (row[format!("q{}_deg", i + 1)].as_f64().unwrap() - joint).abs() < 1e-6,
                "{row}"
            );
        }
        // Least within 2 % of the speed: never above the curve's own value there, and above the absolute limit.
        let best = row["best_depth_mm"].as_f64().unwrap();
        let curve = &lobes["curves"][0];
        let deepest = curve["depth_limit_mm"].as_array().unwrap().iter();
        let deepest = deepest.filter_map(|d| d.as_f64()).fold(0.0, f64::max);
        assert!(
            best <= deepest && best > row["absolute_limit_mm"].as_f64().unwrap(),
            "{best} {deepest}"
        );
    }

    #[test]
    fn slips_are_refused_in_words() {
        let folder = campaign();
        let out = folder.path().join("map");
        let refused = |more: &[&str]| {
            let run = lobestone(&arguments(folder.path(), &out, more));
            assert_ne!(run.status, Some(0), "{more:?}");
            run.stderr
        };
        assert!(refused(&["--shard", "4/3"]).contains("NUMBER/HOW_MANY"));
        assert!(refused(&["--shard", "1/400"]).contains("400 shards of 48 places"));
        assert!(refused(&["--posture", "p9"]).contains("one of p1"));
        assert!(refused(&["--singularity-margin", "2"]).contains("0.05 is usual"));
        assert!(!out.exists());
        document(&arguments(folder.path(), &out, &["--shard", "1/3"]));
        let message = refused(&["--shard", "2/3", "--singularity-margin", "0.2"]);
        assert!(
            message.contains("least_singularity_margin (there 0.05, now 0.2)"),
            "{message}"
        );
        let nowhere = lobestone(&["sweep", "--merge", "--out", text(&folder.path().join("other"))]);
        assert!(nowhere.stderr.contains("sweep.json"), "{}", nowhere.stderr);
    }
}
