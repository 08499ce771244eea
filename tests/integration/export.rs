//! `lobestone export`: which files there are, what their columns are called, and what is refused. That other programs read the numbers
//! is tested by scripts/check_export.py.

use std::path::Path;

use serde_json::{Value, json};

use crate::support::{blind, document, lobestone};

fn export(campaign: &str, more: &[&str], out: &Path) -> Value {
    let dir = blind(campaign);
    let out = out.to_str().unwrap();
    document(&[&["export", dir.to_str().unwrap(), "--out", out], more].concat())
}

fn header(folder: &Path, file: &str) -> String {
    let text = std::fs::read_to_string(folder.join(file)).unwrap();
    text.lines().next().unwrap().to_string()
}

#[test]
fn all_that_a_campaign_holds_is_written_and_units_are_in_the_names() {
    let folder = tempfile::tempdir().unwrap();
    let found = export("frf-9112", &["--format", "csv,uff,npz,mat,xlsx"], folder.path());
    let names: Vec<&str> = found["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| {
            let path = Path::new(file["path"].as_str().unwrap());
            assert!(path.is_file() && path.starts_with(folder.path()), "{file}");
            path.file_name().unwrap().to_str().unwrap()
        })
        .collect();
    for part in ["frf", "model", "residual", "modes"] {
        for format in ["csv", "npz", "mat", "xlsx"] {
            assert!(
                names.contains(&format!("{part}.{format}").as_str()),
                "{part}.{format}: {names:?}"
            );
        }
    }
    for name in [
        "frf.uff",
        "residual.uff",
        "modes-p1.uff",
        "geometry-p4.uff",
        "shapes.csv",
    ] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    assert!(
        !names
            .iter()
            .any(|n| n.starts_with("lobes") || n.starts_with("record"))
    );
    assert_eq!(found["left_out"], json!([]));
    assert_eq!(
        header(folder.path(), "model.csv"),
        "posture,frf,response,reference,frequency_hz,model_re_m_per_n,model_im_m_per_n,robot_file_re_m_per_n,robot_file_im_m_per_n"
    );
    assert_eq!(
        header(folder.path(), "residual.csv"),
        "posture,frf,response,reference,frequency_hz,residual_re_m_per_n,residual_im_m_per_n,noise_std_m_per_n"
    );
    assert!(
        header(folder.path(), "modes.csv")
            .starts_with("posture,mode,frequency_hz,frequency_std_hz,damping_ratio,")
    );
    // Our own reader takes what was written, with the same lines.
    let uff = folder.path().join("frf.uff");
    let seen = document(&["inspect", uff.to_str().unwrap()]);
    assert_eq!(seen["files"][0]["kind"], "frf");
    let rows = std::fs::read_to_string(folder.path().join("frf.csv"))
        .unwrap()
        .lines()
        .count()
        - 1;
    let channels = seen["files"][0]["channels"].as_array().unwrap();
    let lines: u64 = channels.iter().map(|c| c["lines"].as_u64().unwrap()).sum();
    assert_eq!(rows as u64, lines);
}

#[test]
fn matlab_files_hold_names_and_matrices() {
    let folder = tempfile::tempdir().unwrap();
    export("frf-9112", &["--what", "frf", "--format", "mat"], folder.path());
    let bytes = std::fs::read(folder.path().join("frf.mat")).unwrap();
    let file = matfile::MatFile::parse(bytes.as_slice()).unwrap();
    let lines = file.find_by_name("p1_frequency_hz").unwrap().size()[0];
    let receptance = file.find_by_name("p1_receptance_m_per_n").unwrap();
    assert_eq!(receptance.size()[1], lines);
    let matfile::NumericData::Double { imag: Some(imag), .. } = receptance.data() else {
        panic!("no complex matrix");
    };
    assert!(imag.iter().any(|x| *x != 0.0));
}

#[test]
fn what_has_no_dataset_is_told_and_what_is_not_there_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let found = export(
        "force-9400",
        &["--what", "coefficients,records", "--format", "uff"],
        folder.path(),
    );
    assert_eq!(found["left_out"][0]["what"], "coefficients");
    assert!(folder.path().join("record-01.uff").is_file());

    let refused = |more: &[&str], says: &str| {
        let (dir, out) = (blind("force-9400"), folder.path().join("none"));
        let line = [
            &["export", dir.to_str().unwrap(), "--out", out.to_str().unwrap()],
            more,
        ]
        .concat();
        let run = lobestone(&line);
        assert_eq!(run.status, Some(1), "{line:?}: {}", run.stderr);
        assert!(run.stderr.contains(says), "{line:?}: {}", run.stderr);
        assert!(!out.exists(), "{line:?}");
    };
    refused(&["--what", "frf"], "no measured FRFs");
    refused(&["--what", "lobes"], "[lobes]");
    refused(&["--what", "coefficients", "--format", "uff"], "no dataset");
    if !cfg!(feature = "parquet") {
        refused(&["--format", "parquet"], "built without Parquet");
    }
}
